"""Outputs onto inputs are refused, whatever the path is called, and so are places that cannot be written."""

import os
from pathlib import Path

import pytest

from gmwm_jax._internal.outputs import check_outputs, make_folder, refuse_overwriting, require_folder


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
    check_outputs([other], [source])


def test_devices_are_written_as_they_are(source):
    check_outputs([Path("/dev/null"), Path("/dev/null")], [source])


@pytest.mark.parametrize(
    ("file", "complaint"),
    [
        ("folder", "folder is a folder, and a file is to be written"),
        ("in.csv/out.json", "in.csv is a file, and a folder is needed"),
        ("in.csv/deeper/out.json", "cannot be made: .*in.csv is a file"),
        ("missing/out.json", "There is no folder .*missing: make it first. Those below the working folder are made"),
    ],
)
def test_places_where_no_file_can_be(source, file, complaint):
    (source.parent / "folder").mkdir()
    with pytest.raises(OSError, match=complaint):
        check_outputs([source.parent / file], [source])


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="a folder in which nobody can write, root neither")
def test_places_that_nobody_can_write(tmp_path):
    with pytest.raises(OSError, match="/proc/self cannot be written: "):
        check_outputs([Path("/proc/self/out.json")], [])
    with pytest.raises(OSError, match="/proc/self/out cannot be written: "):
        require_folder(Path("/proc/self/out"), beside=Path("/proc"))


def test_folders_are_made_below_the_working_folder_only(tmp_path, monkeypatch):
    with pytest.raises(FileNotFoundError, match="make it first"):
        make_folder(tmp_path / "a" / "b")
    assert not list(tmp_path.iterdir())
    make_folder(tmp_path / "c" / "d", beside=tmp_path)
    monkeypatch.chdir(tmp_path)
    make_folder(Path("a/b"))
    make_folder(tmp_path / "e")
    assert sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*")) == ["a", "a/b", "c", "c/d", "e"]
    with pytest.raises(FileNotFoundError, match="make it first"):
        make_folder(Path("a/../../elsewhere/out"))
