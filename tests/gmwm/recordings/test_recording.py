"""Recordings: conversion to SI against factors written out here, selection, and every refusal."""

import math
import sys
import types

import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.recordings.recording import Recording

DEG = math.pi / 180
G = 9.80665
IMU = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")


@pytest.fixture
def samples():
    return np.random.default_rng(1).normal(size=(50, 6))


@pytest.fixture
def imu(samples):
    return Recording.from_array(samples, rate=100.0, units={"gyro": "deg/s", "accel": "g"}, channels=IMU, name="static")


@pytest.mark.parametrize(
    ("unit", "factor", "si"),
    [
        ("rad/s", 1.0, "rad/s"),
        ("deg/s", DEG, "rad/s"),
        ("deg/h", DEG / 3600, "rad/s"),
        ("m/s^2", 1.0, "m/s^2"),
        ("g", G, "m/s^2"),
        ("mg", 1e-3 * G, "m/s^2"),
        ("1", 1.0, "1"),
        # increments per sample, at 20 Hz
        ("rad", 20.0, "rad/s"),
        ("deg", 20 * DEG, "rad/s"),
        ("arcsec", 20 * DEG / 3600, "rad/s"),
        ("m/s", 20.0, "m/s^2"),
    ],
)
def test_units_to_si(samples, unit, factor, si):
    rec = Recording.from_array(samples[:, 0], rate=20, units=unit)
    assert rec.units == (si,)
    np.testing.assert_allclose(rec.column(0), samples[:, 0] * factor, rtol=1e-15)


def test_units_for_each_channel_by_sequence_group_and_name(samples):
    expected = samples[:, 2:5] * [DEG, G, 1e-3 * G]
    names = ["gyro_z", "accel_x", "accel_y"]
    for units in (["deg/s", "g", "mg"], {"gyro": "deg/s", "accel": "g", "accel_y": "mg"}):
        rec = Recording.from_array(samples[:, 2:5], rate=100.0, units=units, channels=names)
        np.testing.assert_allclose(rec.data, expected, rtol=1e-15)
        assert rec.units == ("rad/s", "m/s^2", "m/s^2")


@pytest.mark.parametrize("dtype", [np.int16, np.uint8, np.float32, ">f8", np.longdouble])
@pytest.mark.parametrize("order", ["C", "F"])
def test_any_real_dtype_becomes_float64_and_the_array_stays_the_callers(dtype, order):
    mine = np.array([[1, 2], [3, 5], [2, 7]], dtype=dtype, order=order)
    rec = Recording.from_array(mine, rate=1.0, units="deg/s")
    assert rec.data.dtype == np.float64
    np.testing.assert_array_equal(mine, [[1, 2], [3, 5], [2, 7]])
    mine[:] = 0
    np.testing.assert_allclose(rec.data, np.array([[1, 2], [3, 5], [2, 7]]) * DEG, rtol=1e-15)


def test_lists_and_single_channels():
    rec = Recording.from_array([1.0, 2.0, 4.0], rate=10, units="1", channels="pressure")
    assert rec.data.shape == (3, 1)
    assert rec.channels == ("pressure",)
    assert Recording.from_array(np.eye(3), rate=1, units="1").channels == ("channel_0", "channel_1", "channel_2")


def test_sizes_and_time(imu):
    assert len(imu) == 50
    assert imu.num_channels == 6
    assert imu.duration == 0.5
    np.testing.assert_allclose(imu.time(), np.arange(50) * 0.01, rtol=1e-15)


def test_channels_are_contiguous_views_that_cannot_be_written(imu):
    for name, x in imu.items():
        assert x.flags.c_contiguous
        assert np.shares_memory(x, imu.data)
        np.testing.assert_array_equal(x, imu.column(name))
        with pytest.raises(ValueError, match="read-only"):
            x[0] = 0.0
    with pytest.raises(AttributeError):
        imu.rate = 1.0


@pytest.mark.parametrize(
    ("key", "positions"),
    [
        ("gyro_x", [0]),
        (5, [5]),
        (-1, [5]),
        (np.int64(2), [2]),
        ("accel", [3, 4, 5]),
        (["gyro_x", "gyro_y"], [0, 1]),
        (["accel_z", "gyro_x"], [5, 0]),
        (["accel", 0], [3, 4, 5, 0]),
    ],
)
def test_selection(imu, key, positions):
    part = imu[key]
    assert part.channels == tuple(IMU[i] for i in positions)
    assert part.units == tuple(imu.units[i] for i in positions)
    assert (part.rate, part.name) == (imu.rate, imu.name)
    np.testing.assert_array_equal(part.data, imu.data[:, positions])
    assert part.data.flags.f_contiguous
    assert not part.data.flags.writeable


def test_an_exact_name_wins_over_a_group(samples):
    rec = Recording.from_array(samples[:, :2], rate=1, units="1", channels=["gyro", "gyro_x"])
    assert rec["gyro"].channels == ("gyro",)


def test_unknown_channels(imu):
    for key in ("mag", ["gyro_x", "gyro_w"], ""):
        with pytest.raises(KeyError, match=r"no channel or group .*gyro_x, gyro_y.*accel_z"):
            imu[key]
    with pytest.raises(KeyError, match="is a group of 3 channels"):
        imu.column("gyro")
    with pytest.raises(KeyError, match="no channel is asked for"):
        imu[[]]
    with pytest.raises(IndexError):
        imu[6]
    with pytest.raises(ValueError, match="occur twice: gyro_x"):
        imu[["gyro", "gyro_x"]]


def test_iteration_and_arrays(imu):
    assert list(imu) == list(IMU)
    assert "gyro_y" in imu
    assert [name for name, _ in imu.items()] == list(IMU)
    np.testing.assert_array_equal(np.asarray(imu), imu.data)


def test_repr_is_a_table():
    rec = Recording.from_array(
        [[1.0, 10.0], [3.0, 30.0]], rate=4, units=["rad/s", "1"], channels=["a", "long"], name="x"
    )
    head, titles, rule, *rows = repr(rec).splitlines()
    assert head == "Recording 'x': 2 samples at 4 Hz, 0.5 s"
    assert titles.split() == ["channel", "unit", "mean", "std"]
    assert [row.split() for row in rows] == [["a", "rad/s", "2", "1"], ["long", "1", "20", "10"]]
    assert len({len(row) for row in (titles, rule, *rows)}) == 1


def test_plot_delegates(imu, monkeypatch):
    seen = types.ModuleType("gmwm_jax.plotting")
    seen.draw = lambda rec, **options: ("figure of", rec, options)
    monkeypatch.setitem(sys.modules, "gmwm_jax.plotting", seen)
    assert imu.plot(axes=7) == ("figure of", imu, {"axes": 7})


def spoilt(value):
    x = np.random.default_rng(2).normal(size=(20, 2))
    x[7, 1] = value
    return x


NOISE = np.random.default_rng(3).normal(size=(20, 2))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ([], "empty"),
        (np.zeros((0, 3)), "empty"),
        (np.zeros((5, 0)), "empty"),
        ([1.0], "one sample"),
        (np.zeros((1, 1)), "one sample"),
        (np.float64(3.0), r"shape \(N,\) or \(N, C\)"),
        (np.zeros((4, 3, 2)), r"\(4, 3, 2\)"),
        (NOISE.T, "2 samples of 20 channels.*transpose"),
        (NOISE + 0j, "real numbers.*complex128"),
        (["1.0", "2.0"], "real numbers.*dtype <U3"),
        (NOISE.astype(object), "real numbers.*object"),
        ([True, False], "real numbers.*bool"),
        (NOISE * [1, 0] + 5, r"'channel_1' is constant \(5 in all 20"),
        (spoilt(np.nan), r"'channel_1' holds 1 values.*\(nan\) at index 7"),
        (spoilt(-np.inf), r"'channel_1' holds 1 values.*\(-inf\) at index 7"),
        (np.ma.masked_greater(spoilt(1e9), 1e6), r"'channel_1' holds 1 values.*\(nan\) at index 7"),
    ],
)
def test_data_that_are_no_record(data, message):
    with pytest.raises(ValueError, match=message):
        Recording.from_array(data, rate=1.0, units="1")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"rate": None}, "sampling rate is missing"),
        ({"rate": 0.0}, "positive number of Hz"),
        ({"rate": -5}, "positive number of Hz"),
        ({"rate": math.nan}, "positive number of Hz"),
        ({"units": None}, "unit of the samples is missing.*never guessed.*rates.*increments"),
        ({"units": "parsec"}, "Unknown unit 'parsec'"),
        ({"units": "s"}, "no sensor signal"),
        ({"units": ["g"]}, r"1 units \(g\) were given for 2 channels"),
        ({"units": {"gyro_x": "deg/s"}}, "No unit is given for: gyro_y"),
        ({"units": {"gyro": "deg/s", "accel": "g"}}, "units names accel, and the channels are: gyro_x, gyro_y"),
        ({"units": {"gyro": "deg/s", "gyro_x": "rad/s", "gyro_y": "rad/s"}}, "units names gyro,"),
        ({"channels": ["gyro_x"]}, "1 channel names"),
        ({"channels": ["gyro_x", "gyro_y", "gyro_z"]}, "3 channel names"),
        ({"channels": ["gyro_x", "gyro_x"]}, "occur twice: gyro_x"),
    ],
)
def test_descriptions_that_do_not_fit(arguments, message):
    good = {"rate": 1.0, "units": "deg/s", "channels": ["gyro_x", "gyro_y"]}
    with pytest.raises(ValueError, match=message):
        Recording.from_array(NOISE, **{**good, **arguments})


@pytest.mark.parametrize("units", [("rad/s",), ("deg/s", "deg/s")])
def test_a_recording_is_in_si(units):
    with pytest.raises(ValueError, match="one of the units rad/s"):
        Recording(NOISE, 1.0, ("a", "b"), units)


def test_what_was_understood_is_printed_in_a_line(tmp_path):
    rec = gj.Recording.from_array(np.random.default_rng(0).normal(size=50), rate=20.0, units="rad/s")
    assert "Read as" not in repr(rec)
    read = gj.read_recording(gj.save_recording(rec, tmp_path / "x.npz"))
    assert repr(read).splitlines()[-1] == repr(read.understood).splitlines()[0]
    assert "20 Hz by " in repr(read)
