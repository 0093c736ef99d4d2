"""Chunks, keys by number, interrupts, and the p-value of replicates."""

import jax
import numpy as np
import pytest

from gmwm_jax._internal.chunks import (
    chunks,
    numbered_keys,
    replicate_p_value,
    replicates_done,
    stream_keys,
    until_interrupted,
)


@pytest.mark.parametrize(("num", "size"), [(0, 4), (1, 4), (4, 4), (5, 4), (12, 4), (3, 1), (3, 100)])
def test_chunks_have_one_size_and_hold_every_row_once(num, size):
    x = np.arange(num) ** 2
    found = [(x[rows], count) for rows, count in chunks(num, size)]
    assert {len(part) for part, _ in found} <= {size}
    assert [v for part, count in found for v in part[:count]] == list(x)
    assert all(v == x[-1] for part, count in found for v in part[count:])


def test_a_numbered_key_depends_on_its_number_alone():
    key = jax.random.key(3)
    many, few = numbered_keys(key, range(10)), numbered_keys(key, [7, 2])
    for i in range(10):
        assert many[i] == jax.random.fold_in(key, i)
    assert (few == many[np.array([7, 2])]).all()


def test_streams_of_keys():
    keys = jax.random.split(jax.random.key(0), 3)
    for i in (0, 5):
        assert all(s == jax.random.fold_in(k, i) for s, k in zip(stream_keys(keys, i), keys, strict=True))


@pytest.mark.parametrize("empty", [list, dict])
def test_an_interrupt_keeps_what_is_done_and_is_one_where_nothing_is(empty):
    done = empty()
    with pytest.raises(KeyboardInterrupt), until_interrupted(done, 3, "step", False):
        raise KeyboardInterrupt
    done = empty([(1, 2)])
    with until_interrupted(done, 3, "step", False):
        raise KeyboardInterrupt
    assert len(done) == 1


def test_other_errors_are_not_kept():
    with pytest.raises(ValueError, match="broken"), until_interrupted([1], 3, "step", False):
        raise ValueError("broken")


@pytest.mark.parametrize("error", [None, KeyboardInterrupt, ValueError])
def test_the_bar_is_told_and_closed(monkeypatch, error):
    class Bar:
        told, closed = 0, False

        def update(self, n):
            self.told += n

        def close(self):
            self.closed = True

    made = Bar()
    monkeypatch.setattr("gmwm_jax._internal.chunks.progress_bar", lambda total, unit, wanted: made)
    try:
        with until_interrupted([1], 3, "step", True) as bar:
            bar.update(2)
            if error:
                raise error
    except ValueError:
        assert error is ValueError
    assert (made.told, made.closed) == (2, True)


def test_p_value_counts_the_data_in_and_ties_as_larger():
    assert replicate_p_value(2.0, np.array([1.0, 2.0, 3.0])) == 3 / 4
    assert replicate_p_value(9.0, np.array([1.0, 2.0, 3.0])) == 1 / 4
    assert replicate_p_value(0.0, np.array([])) == 1.0


def test_replicates_in_words():
    assert replicates_done(20, 20, 0, "records") == "20 replicates by records"
    text = "20 replicates of 50 asked for by variances; 3 did not converge and are left out"
    assert replicates_done(20, 50, 3, "variances") == text
