"""Bags of ROS 1 and ROS 2: the samples that rosbags wrote come back bit by bit, at the rate of the sensor's stamps."""

import gzip
import sys

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from gmwm_jax._internal import limits
from gmwm_jax.recordings.files import read_recording

N, RATE = 60, 200
X = np.random.default_rng(3).normal(size=(N, 6))
START = 1_700_000_000_000_000_000
STAMPS = START + np.arange(N) * (1_000_000_000 // RATE)
KINDS = {"bag": None, "mcap": StoragePlugin.MCAP, "db3": StoragePlugin.SQLITE3}


def message(types, k, stamp, sequence):
    def vector(values):
        return types["geometry_msgs/msg/Vector3"](*map(float, values))

    time = types["builtin_interfaces/msg/Time"](int(stamp) // 10**9, int(stamp) % 10**9)
    header = types["std_msgs/msg/Header"](**sequence, stamp=time, frame_id="imu")
    quaternion, nine = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0), np.zeros(9)
    return types["sensor_msgs/msg/Imu"](header, quaternion, nine, vector(X[k, :3]), nine, vector(X[k, 3:]), nine)


@pytest.fixture
def record(tmp_path):
    """Write a bag of one of the three kinds."""

    def record(kind, topics=("/imu",), stamps=STAMPS, keep=range(N), late=0):
        first = kind == "bag"
        store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
        serialize = store.serialize_ros1 if first else store.serialize_cdr
        path = tmp_path / f"run.{kind}" if first else tmp_path / f"run_{kind}"
        with Writer1(path) if first else Writer2(path, version=9, storage_plugin=KINDS[kind]) as bag:
            text = bag.add_connection("/chatter", "std_msgs/msg/String", typestore=store)
            raw = serialize(store.types["std_msgs/msg/String"]("hello"), "std_msgs/msg/String")
            bag.write(text, START, raw)
            for topic in topics:
                connection = bag.add_connection(topic, "sensor_msgs/msg/Imu", typestore=store)
                for k in keep:
                    sequence = {"seq": k} if first else {}
                    raw = serialize(message(store.types, k, stamps[k], sequence), "sensor_msgs/msg/Imu")
                    bag.write(connection, int(STAMPS[k] + late * (k % 3)), raw)
        return path

    return record


@pytest.mark.parametrize("kind", KINDS)
def test_bags(record, kind):
    """Jitter of the receipt is none of the sensor's."""
    path = record(kind, late=1_000_000)
    for file in (path, *(() if kind == "bag" else path.glob(f"*.{kind}"))):
        rec = read_recording(file)
        np.testing.assert_array_equal(rec.data, X)
        assert rec.channels == ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
        assert rec.units == ("rad/s",) * 3 + ("m/s^2",) * 3
        assert (rec.rate, rec.understood.time.jitter < 1e-9) == (RATE, True)
        assert (rec.understood.format, rec.understood.notes) == ("ros", ("Topic /imu.",))


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_is_as_large_as_its_files(record, monkeypatch, kind):
    """Messages that are not packed are never more than the files, those of a folder too, whatever the limits."""
    monkeypatch.setattr(limits, "FREE", 1000)
    monkeypatch.setattr(limits, "MAX_RATIO", 1)
    assert len(read_recording(record(kind))) == N


def test_a_bag_with_gaps(record):
    path = record("mcap", keep=np.delete(np.arange(N), 20))
    with pytest.raises(ValueError, match="1 samples are missing in 1 gaps"):
        read_recording(path)
    assert np.flatnonzero(np.isnan(read_recording(path, gaps="nan").data[:, 0])).tolist() == [20]


def test_messages_without_stamps_have_the_time_of_receipt(record):
    rec = read_recording(record("bag", stamps=np.zeros(N, dtype=int)))
    assert rec.rate == RATE
    assert "its time (the time of receipt)" in str(rec.understood)


def test_messages_out_of_order(record):
    stamps = STAMPS.copy()
    stamps[[10, 11]] = stamps[[11, 10]]
    rec = read_recording(record("bag", stamps=stamps))
    np.testing.assert_array_equal(rec.data[[10, 11]], X[[11, 10]])
    assert rec.understood.notes[1] == "1 messages were received out of order, and are sorted by their stamps."


def test_a_topic_is_named_where_there_are_several(record):
    path = record("db3", topics=("/front", "/rear"))
    with pytest.raises(ValueError, match=r"several topics of type .*: /front, /rear; variable=\.\.\. names one"):
        read_recording(path)
    np.testing.assert_array_equal(read_recording(path, variable="/rear").data, X)
    with pytest.raises(ValueError, match="no topic '/left' of type"):
        read_recording(path, variable="/left")
    with pytest.raises(ValueError, match=r"no topic of type sensor_msgs/msg/Imu; it has /chatter \(std_msgs"):
        read_recording(record("bag", topics=()))


def test_bad_bags(record, tmp_path, monkeypatch):
    path = record("bag")
    packed = tmp_path / "run.bag.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    np.testing.assert_array_equal(read_recording(packed).data, X)
    path.write_bytes(path.read_bytes()[:-3000])
    with pytest.raises(ValueError, match="no bag, or it is truncated or corrupt"):
        read_recording(path)
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(ImportError, match=r"needs the package rosbags: pip install \"gmwm-jax\[ros\]\""):
        read_recording(path)
