"""Outputs onto inputs are refused, whatever the path is called."""

import os
from pathlib import Path

import pytest

from gmwm_jax._internal.overwriting import refuse_overwriting


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "in.csv"
    path.write_text("1\n")
    return path


def spelled(source, how):
    if how == "same":
        return source
    if how == "dots":
        return source.parent / ".." / source.parent.name / source.name
    if how == "relative":
        return Path(os.path.relpath(source))
    link = source.parent / "link"
    (link.symlink_to if how == "symbolic" else link.hardlink_to)(source)
    return link


@pytest.mark.parametrize("how", ["same", "dots", "relative", "symbolic", "hard"])
def test_an_output_that_is_the_input(source, how):
    output = spelled(source, how)
    with pytest.raises(ValueError, match=r"would be written over .*which is read: name another file"):
        refuse_overwriting([source.parent / "other", output], [source])


def test_a_link_to_what_will_be_written(source):
    """A link whose target is not there yet is the same file by name."""
    link = source.parent / "link"
    link.symlink_to(source.parent / "new")
    with pytest.raises(ValueError, match="would be written twice"):
        refuse_overwriting([link, source.parent / "new"], [source])


def test_other_files_are_left_alone(source):
    other = source.parent / "out.csv"
    refuse_overwriting([other, source.parent / "missing" / "a"], [source, source.parent / "none.csv"])
    other.write_text("1\n")  # the same content is no reason
    refuse_overwriting([other], [source])
