"""Files are there whole or not at all, and as readable as any other."""

import errno
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gmwm_jax._internal import atomic
from gmwm_jax._internal.atomic import make_atomically, settle_abandoned, write_atomically


def test_the_folder_is_made_and_the_file_is_whole(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
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
    with pytest.raises(OSError, match="file is a file, and a folder is needed"):
        write_atomically(tmp_path / "file" / "x", lambda file: None)


def test_a_link_stays_and_its_file_is_replaced(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real" / "x")
    for content in (b"first", b"second"):
        assert write_atomically(tmp_path / "link", lambda file, content=content: file.write(content)).is_symlink()
        assert (tmp_path / "real" / "x").read_bytes() == content
    assert [p.name for p in (tmp_path / "real").iterdir()] == ["x"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a pipe with a name")
def test_a_device_is_written_and_stays_one(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with ThreadPoolExecutor(1) as pool:
        read = pool.submit((tmp_path / "pipe").read_bytes)
        write_atomically(tmp_path / "pipe", lambda file: file.write(b"whole"))
        assert read.result(30) == b"whole"
    assert (tmp_path / "pipe").is_fifo()


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


LEFT = ".x.0123abcd.part"


def test_what_a_killed_writer_has_left_is_removed_by_the_next_one(tmp_path):
    for name in (LEFT, ".y.0123abcd.part", ".x.notes.part"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "new").write_text("half")
    write_atomically(tmp_path / "x", lambda file: file.write(b"whole"))
    assert sorted(p.name for p in tmp_path.iterdir()) == [".x.notes.part", ".y.0123abcd.part", "x"]


def test_what_a_living_writer_is_at_is_left_alone(tmp_path):
    def slow(file):
        write_atomically(tmp_path / "x", lambda inner: inner.write(b"the other"))
        file.write(b"whole")
        assert len(list(tmp_path.glob(".x.*.part"))) == 1

    write_atomically(tmp_path / "x", slow)
    assert (tmp_path / "x").read_bytes() == b"whole"
    assert [p.name for p in tmp_path.iterdir()] == ["x"]


def test_many_writers_of_one_file_leave_one_of_theirs(tmp_path):
    contents = [bytes([n]) * 100_000 for n in range(40)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda content: write_atomically(tmp_path / "x", lambda file: file.write(content)), contents))
    assert (tmp_path / "x").read_bytes() in contents
    assert [p.name for p in tmp_path.iterdir()] == ["x"]


def make_folder(content):
    def make(path):
        path.mkdir()
        for part in "ab":
            (path / part).write_bytes(content)

    return make


def test_a_folder_is_replaced_whole(tmp_path):
    for content in (b"old", b"new"):
        make_atomically(tmp_path / "x", make_folder(content))
        assert {p.read_bytes() for p in (tmp_path / "x").iterdir()} == {content}
    assert [p.name for p in tmp_path.iterdir()] == ["x"]


def test_who_is_killed_between_the_renames_of_a_folder_loses_nothing(tmp_path):
    (tmp_path / LEFT).mkdir()
    for part in ("old", "new"):
        make_folder(part.encode())(tmp_path / LEFT / part)
    settle_abandoned(tmp_path / "x")
    assert {p.read_bytes() for p in (tmp_path / "x").iterdir()} == {b"new"}
    assert [p.name for p in tmp_path.iterdir()] == ["x"]


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT])
def test_where_the_disk_is_full_the_file_is_named(tmp_path, code):
    (tmp_path / "x").write_bytes(b"old")

    def full(file):
        file.write(b"ne")
        raise OSError(code, os.strerror(code))

    with pytest.raises(OSError, match=rf"/x cannot be written: {os.strerror(code)}\."):
        write_atomically(tmp_path / "x", full)
    assert (tmp_path / "x").read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["x"]


WRITER = """
import importlib.util, sys
from pathlib import Path

source, target = sys.argv[1:]
spec = importlib.util.spec_from_file_location("atomic", source)
atomic = importlib.util.module_from_spec(spec)
spec.loader.exec_module(atomic)

def fill(file, n):
    for _ in range(50):
        file.write(bytes([n % 256]) * 1000)

def make(path, n):
    path.mkdir()
    for name in "abc":
        with (path / name).open("wb") as file:
            fill(file, n)

print("ready", flush=True)
for n in range(10**9):
    atomic.write_atomically(Path(target) / "file", lambda file: fill(file, n))
    atomic.make_atomically(Path(target) / "folder", lambda path: make(path, n))
"""


def test_a_kill_at_any_moment_leaves_the_old_or_the_new_one(tmp_path):
    """Processes that write without end are killed after times of chance."""
    rng = np.random.default_rng(7)
    for _ in range(10):
        command = [sys.executable, "-c", WRITER, atomic.__file__, tmp_path]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as writer:
            assert writer.stdout is not None
            writer.stdout.readline()
            time.sleep(rng.uniform(0, 0.05))
            writer.kill()
        for path in (tmp_path / "file", tmp_path / "folder"):
            settle_abandoned(path)
        assert {p.name for p in tmp_path.iterdir()} <= {"file", "folder"}
        for path in [p for p in (tmp_path / "file", *(tmp_path / "folder").glob("*")) if p.exists()]:
            content = path.read_bytes()
            assert content == content[:1] * 50_000
        versions = {p.read_bytes()[:1] for p in (tmp_path / "folder").glob("*")}
        assert len(versions) <= 1
