"""Files are there whole or not at all, and as readable as any other."""

import os

import pytest

from gmwm_jax._internal.atomic import write_atomically


def test_the_folder_is_made_and_the_file_is_whole(tmp_path):
    path = tmp_path / "a" / "b" / "x.txt"
    assert write_atomically(path, lambda file: file.write(b"whole")) == path
    assert path.read_bytes() == b"whole"
    assert [p.name for p in path.parent.iterdir()] == ["x.txt"]


def test_permissions_are_those_of_an_ordinary_file(tmp_path):
    (tmp_path / "plain").touch()
    path = write_atomically(tmp_path / "x", lambda file: None)
    assert os.stat(path).st_mode == os.stat(tmp_path / "plain").st_mode


def test_what_cannot_be_written_is_named(tmp_path):
    with pytest.raises(IsADirectoryError, match="is a folder, and a file is to be written"):
        write_atomically(tmp_path, lambda file: None)
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match=r"file/x cannot be written: (File exists|Not a directory)\."):
        write_atomically(tmp_path / "file" / "x", lambda file: None)


@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt])
def test_an_interruption_leaves_the_old_file(tmp_path, error):
    (tmp_path / "x").write_bytes(b"old")

    def interrupted(file):
        file.write(b"ne")
        raise error("stop")

    with pytest.raises(error, match="stop"):
        write_atomically(tmp_path / "x", interrupted)
    assert (tmp_path / "x").read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["x"]
