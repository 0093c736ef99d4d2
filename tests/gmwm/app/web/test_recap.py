"""The last example: what is printed of it lies where ours does."""

import pytest

from gmwm_jax.app.web import recap


@pytest.mark.slow
def test_intervals_are_as_wide_as_those_that_are_printed():
    for _, truth, estimate, low, high, inside, *_ in recap.table().rows:
        assert low < estimate < high
        assert inside == "yes"
        assert estimate == pytest.approx(truth, rel=0.15)
    assert [row[6:] for row in recap.table().rows] == [p[1:] for p in recap.PRINTED]
