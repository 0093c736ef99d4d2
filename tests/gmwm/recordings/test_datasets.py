"""Named data sets: by hand, from the cache, by download (none reaches the network); and R files of their kind."""

import math
import re
import shutil
import sys
from dataclasses import dataclass

import numpy as np
import pytest
import rdata
import requests

from gmwm_jax.recordings import datasets
from gmwm_jax.recordings._public_files import KNOWN_FILES, sha256
from gmwm_jax.recordings.files import read_recording

DEG = math.pi / 180
G = 9.80665
X = np.random.default_rng(6).normal(size=(40, 3))
NAMES = (*(f"adis_16405_imu{i}" for i in range(1, 7)), "cont.imu1")


@pytest.fixture(autouse=True)
def offline(monkeypatch, tmp_path):
    """An empty cache, no folder placed by hand, and no network."""
    import pooch

    def no_network(*arguments, **options):
        raise requests.exceptions.ConnectionError("name resolution failed")

    monkeypatch.delenv("GMWM_JAX_DATA", raising=False)
    monkeypatch.setattr(pooch, "os_cache", lambda project: tmp_path / "cache" / project)
    monkeypatch.setattr(requests, "get", no_network)
    return tmp_path / "cache" / "gmwm_jax"


def test_names_and_info():
    assert datasets.names() == NAMES
    adis = datasets.info("adis_16405_imu3")
    assert (adis.file, adis.rate, adis.units) == ("adis_16405_imu3.rda", 100.0, ("deg/s",) * 3 + ("g",) * 3)
    assert adis.channels == ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
    assert "unit 3" in adis.description
    assert (
        adis.source + adis.file
        == "https://raw.githubusercontent.com/SMAC-Group/imudata/master/data/adis_16405_imu3.rda"
    )
    cont = datasets.info("cont.imu1")
    assert (cont.rate, cont.channels, cont.units) == (100.0, ("gyro_x",), ("rad/s",))


@pytest.mark.parametrize("ask", [datasets.info, datasets.load, datasets.fetch])
def test_unknown_name(ask):
    with pytest.raises(ValueError, match=r"no data set 'adis'; there are: adis_16405_imu1, .*cont.imu1"):
        ask("adis")


def test_hashes_are_those_of_the_real_files(shared):
    for name in NAMES:
        known = datasets.info(name)
        assert sha256(shared / "data" / known.file) == known.sha256


def test_files_placed_by_hand_come_first(shared, monkeypatch):
    monkeypatch.setenv("GMWM_JAX_DATA", str(shared / "data"))
    assert datasets.fetch("cont.imu1") == shared / "data" / "cont.imu1.rda"
    rec = datasets.load("cont.imu1")
    assert (rec.name, rec.rate, rec.channels, rec.units) == ("cont.imu1", 100.0, ("gyro_x",), ("rad/s",))
    # five sigma outliers are what this record is for; the bulk has the noise of the sensor
    x = rec.column("gyro_x")
    assert np.abs(x - np.median(x)).max() > 5 * 1.4826 * np.median(np.abs(x - np.median(x)))


def test_a_file_by_hand_must_be_the_public_one(tmp_path, monkeypatch):
    (tmp_path / "cont.imu1.rda").write_bytes(b"half of it")
    monkeypatch.setenv("GMWM_JAX_DATA", str(tmp_path))
    with pytest.raises(ValueError, match=r"not the public file: its SHA-256 is .*, and should be 0c177912"):
        datasets.load("cont.imu1")


def test_the_cache_is_used(shared, offline, monkeypatch, tmp_path):
    offline.mkdir(parents=True)
    shutil.copy(shared / "data" / "cont.imu1.rda", offline)
    monkeypatch.setenv("GMWM_JAX_DATA", str(tmp_path / "without the file"))
    assert datasets.fetch("cont.imu1") == offline / "cont.imu1.rda"


def test_download_into_the_cache(shared, offline, monkeypatch):
    asked = []

    class Response:
        def __init__(self, content):
            self.headers = {"content-length": str(len(content))}
            self.content = content

        def raise_for_status(self):
            pass

        def iter_content(self, chunk_size):
            yield self.content

        def close(self):
            pass

    def get(url, **options):
        asked.append(url)
        return Response((shared / "data" / "cont.imu1.rda").read_bytes())

    monkeypatch.setattr(requests, "get", get)
    assert datasets.fetch("cont.imu1") == offline / "cont.imu1.rda"
    assert datasets.fetch("cont.imu1") == offline / "cont.imu1.rda"
    assert asked == ["https://raw.githubusercontent.com/SMAC-Group/imudata/master/data/cont.imu1.rda"]

    monkeypatch.setattr(requests, "get", lambda url, **options: Response(b"an error page"))
    with pytest.raises(ValueError, match="hash of downloaded file"):
        datasets.fetch("adis_16405_imu1")
    assert [p.name for p in offline.iterdir()] == ["cont.imu1.rda"]


def test_without_a_network_the_message_says_what_to_do():
    address = re.escape("https://raw.githubusercontent.com/SMAC-Group/imudata/master/data/adis_16405_imu2.rda")
    message = (
        rf"adis_16405_imu2\.rda could not be fetched from {address}.*name resolution failed.*by hand.*GMWM_JAX_DATA"
    )
    with pytest.raises(OSError, match=message):
        datasets.load("adis_16405_imu2")


def test_a_missing_package_is_named_only_where_it_is_needed(shared, monkeypatch):
    monkeypatch.setitem(sys.modules, "pooch", None)
    with pytest.raises(ImportError, match=r'package pooch: pip install "gmwm-jax\[io\]"'):
        datasets.fetch("cont.imu1")
    monkeypatch.setenv("GMWM_JAX_DATA", str(shared / "data"))
    assert datasets.fetch("cont.imu1").is_file()


@pytest.mark.slow
def test_real_imu_file_needs_no_argument(shared):
    path = shared / "data" / "adis_16405_imu1.rda"
    rec = read_recording(path)
    assert rec.data.shape == (1_000_000, 6)
    assert rec.rate == 100.0
    assert rec.channels == ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
    assert rec.units == ("rad/s",) * 3 + ("m/s^2",) * 3
    assert rec.name == "adis_16405_imu1"
    # facts of the sensor: gyros count in steps of 0.05 deg/s, and one axis carries gravity
    counts = rec.column("gyro_x") / (0.05 * DEG)
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    assert abs(rec.column("accel_z").mean()) == pytest.approx(G, rel=0.03)
    stated = read_recording(path, columns=["accel_z", "gyro_x"], units=["g", "deg/s"], names=["down", "roll"])
    assert (stated.channels, stated.rate) == (("down", "roll"), 100.0)
    np.testing.assert_array_equal(stated.column("down"), rec.column("accel_z"))
    np.testing.assert_array_equal(stated.column("roll"), rec.column("gyro_x"))


@pytest.mark.slow
def test_real_contaminated_file_under_another_name(shared, tmp_path):
    path = tmp_path / "mine.RData"
    path.write_bytes((shared / "data" / "cont.imu1.rda").read_bytes())
    rec = read_recording(path)
    assert (rec.data.shape, rec.rate, rec.units, rec.channels) == ((500_000, 1), 100.0, ("rad/s",), ("gyro_x",))
    with pytest.raises(ValueError, match=r"Wrong rate .*: rate= says 250 Hz, and the file 100 Hz"):
        read_recording(path, rate=250.0)
    with pytest.raises(ValueError, match="Wrong rate"):
        read_recording(path, rate=250.0, units="rad/s")


def test_real_file_cut_short(shared, tmp_path):
    path = tmp_path / "cont.imu1.rda"
    whole = (shared / "data" / "cont.imu1.rda").read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ValueError, match=r"cont\.imu1\.rda: .*truncated or corrupt"):
        read_recording(path)


def test_known_files_describe_each_channel():
    for known in KNOWN_FILES:
        assert len(known.channels) == len(known.units)
        assert len(known.sha256) == 64


@dataclass
class Classed:
    """An R matrix with a class and other attributes."""

    value: np.ndarray
    attributes: dict

    def to_r(self, converter):
        plain = converter.convert_to_r_object(self.value.ravel(order="F"))
        dim = np.array(self.value.shape, dtype=np.int32)
        attributes = converter.convert_to_r_attributes({"dim": dim, **self.attributes})
        return rdata.conversion.to_r.build_r_object(
            plain.info.type, value=plain.value, is_object=True, attributes=attributes
        )


def write_r(path, series):
    constructors = {**rdata.conversion.to_r.DEFAULT_CLASS_MAP, Classed: Classed.to_r}
    rdata.write_rda(path, {"series": series}, constructor_dict=constructors)
    return path


def test_r_objects_of_class_imu_state_their_rate(tmp_path):
    names = [None, np.array(["Gyro. X", "Gyro. Y", "Accel. Z"])]
    imu = Classed(X, {"dimnames": names, "freq": np.array([250.0]), "class": np.array(["imu", "matrix"])})
    path = write_r(tmp_path / "mine.rda", imu)
    rec = read_recording(path, units={"gyro": "deg/s", "accel": "g"})
    np.testing.assert_allclose(rec.data, X * [DEG, DEG, G], rtol=1e-15)
    assert (rec.rate, rec.channels) == (250.0, ("gyro_x", "gyro_y", "accel_z"))
    assert read_recording(path, units="1", rate=249.0).rate == 249.0
    with pytest.raises(ValueError, match=r"Wrong rate .*: rate= says 100 Hz, and the file 250 Hz"):
        read_recording(path, units="1", rate=100.0)
    with pytest.raises(ValueError, match="unit of the samples is missing"):  # no public file
        read_recording(path)


@pytest.mark.parametrize("classes", [["ts"], ["mts", "ts"], ["gts", "matrix"]])
def test_r_objects_of_other_classes_are_read_for_their_samples(tmp_path, classes):
    series = Classed(X, {"tsp": np.array([1.0, 1.39, 100.0]), "class": np.array(classes)})
    rec = read_recording(write_r(tmp_path / "ts.rda", series), rate=50.0, units="rad/s")
    np.testing.assert_array_equal(rec.data, X)
    assert rec.rate == 50.0


def test_the_rate_of_a_sensor_is_that_of_its_records():
    for sensor in datasets.sensors():
        assert datasets.sensor_rate(sensor) == datasets.simulated(sensor, 2, channels=["gyro_x"]).rate
    with pytest.raises(ValueError, match="no sensor 'mti-h'"):
        datasets.sensor_rate("mti-h")
