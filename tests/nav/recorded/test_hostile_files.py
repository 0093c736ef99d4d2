"""Files that ask for more than they are, at the doors of nav_jax: each is refused with its name, and in a moment."""

import gzip

import numpy as np
import pytest

import nav_jax as nj
from gmwm_jax._internal import limits

DOORS = {
    "imu": lambda path, **how: nj.read_imu(path, **how),
    "samples": lambda path, **how: nj.recorded.read_samples(path, **how),
    "fixes": lambda path, **how: nj.read_fixes(path, nj.Barometer(height=1.0), **how),
    "gnss": lambda path, **how: nj.read_gnss(path, **how),
    "trajectory": lambda path, **how: nj.read_trajectory(path, position="ned", angles="rad", **how),
}


@pytest.mark.parametrize("door", DOORS)
def test_packed_text(tmp_path, door, monkeypatch):
    monkeypatch.setattr(limits, "FREE", 100_000)
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(b"time,height\n" + b"1,2\n" * 100_000))
    with pytest.raises(ValueError, match=r"a\.csv\.gz: The file of .* unpacks to more than") as refused:
        DOORS[door](path)
    assert "max_bytes=" in str(refused.value) or "name" in str(refused.value)


def test_what_is_allowed_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(limits, "FREE", 1000)
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(b"time,height\n" + b"".join(b"%d,2\n" % i for i in range(1000))))
    with pytest.raises(ValueError, match="max_bytes"):
        nj.read_fixes(path, nj.Barometer(height=1.0), max_bytes=1000)
    assert len(nj.read_fixes(path, nj.Barometer(height=1.0), max_bytes="1MB").time) == 1000


@pytest.mark.parametrize("door", DOORS)
def test_what_is_no_size(tmp_path, door):
    np.savetxt(tmp_path / "a.csv", np.ones((3, 3)), delimiter=",")
    with pytest.raises(ValueError, match="max_bytes is a number of bytes"):
        DOORS[door](tmp_path / "a.csv", max_bytes="lots")


@pytest.mark.parametrize(
    ("name", "start"),
    [("a.pos", b"%  GPST latitude(deg) longitude(deg) height(m)\n"), ("a.nmea", b"$GPGGA\n"), ("a.csv", b"time,lat\n")],
)
def test_a_line_of_50_mb(tmp_path, name, start):
    path = tmp_path / name
    path.write_bytes(start + b"1 2," * 12_000_000)
    with pytest.raises(ValueError, match="Line 2 is longer than 65536 characters"):
        nj.read_gnss(path)


def test_gpx_that_multiplies_its_text(tmp_path):
    """The parser of XML has its own limit for it."""
    doubled = "".join(f'<!ENTITY a{i} "&a{i - 1};&a{i - 1};&a{i - 1};&a{i - 1};">' for i in range(1, 16))
    text = f'<?xml version="1.0"?><!DOCTYPE gpx [<!ENTITY a0 "{"x" * 100}">{doubled}]><gpx>&a15;</gpx>'
    (tmp_path / "a.gpx").write_text(text)
    with pytest.raises(ValueError, match="no GPX file"):
        nj.read_gnss(tmp_path / "a.gpx")
