"""Recorded navigation data: columns and units of the samples of an IMU and of fixes, and what is refused."""

import warnings

import numpy as np
import pytest

import nav_jax as nj
from gmwm_jax._internal.gravity import ImplausibleUnitsWarning

TIME = np.arange(20) / 10
TABLE = np.column_stack([TIME, *(np.sin(TIME + i) for i in range(6))])
NAMES = ("time", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
SI = {"gyro": "rad/s", "accel": "m/s^2"}
ANGLES = ("rad", "mrad", "urad", "deg", "mdeg", "arcmin", "arcsec")
GNSS = nj.GnssPosition(1.0, horizontal=1.0, vertical=2.0)
BARO = nj.Barometer(1.0, height=0.5)


def columns(names=NAMES, table=TABLE):
    return dict(zip(names, table.T, strict=True))


def test_samples_by_order_by_name_and_by_what_is_told():
    by_order = nj.read_imu(TABLE, units=SI)
    assert by_order.rate == pytest.approx(10.0)
    np.testing.assert_array_equal(by_order.time, TIME)
    np.testing.assert_array_equal(by_order.gyro, TABLE[:, 1:4])
    np.testing.assert_array_equal(by_order.accel, TABLE[:, 4:])
    mixed = ["accel_x", "temperature", "time", "Gyro X", "gyr_y", "omega_z", "roll", "acc_y", "f_z"]
    at = [4, 0, 0, 1, 2, 3, 1, 5, 6]
    told = nj.read_imu(columns([*mixed[:-1], "up"], TABLE[:, at]), units=SI, columns={"accel_z": "up"}, rate=10.0)
    for found in (nj.read_imu(columns(mixed, TABLE[:, at]), units=SI), told):
        np.testing.assert_array_equal(found.gyro, by_order.gyro)
        np.testing.assert_array_equal(found.accel, by_order.accel)


def written(path, stamps, names=NAMES, table=TABLE[:, 1:]):
    """A text file whose first column is text."""
    rows = [",".join([stamp, *(f"{x:.17g}" for x in row)]) for stamp, row in zip(stamps, table, strict=True)]
    path.write_text("\n".join([",".join(names), *rows]))
    return path


@pytest.mark.parametrize(("head", "tail"), [("2024-07-08T", ""), ("2024-07-08 ", "Z"), ("2024-07-08T", "+00:00")])
def test_stamps_of_utc_are_seconds_since_1970(tmp_path, head, tail):
    at = np.datetime64("2024-07-08T23:59:59.000") + (1000 * TIME).round().astype("m8[ms]")
    imu = nj.read_imu(written(tmp_path / "a.csv", [str(t).replace("2024-07-08T", head) + tail for t in at]), units=SI)
    np.testing.assert_allclose(imu.time, 1720483199 + TIME, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(imu.gyro, TABLE[:, 1:4])
    for stamps in (at, at.astype(str)):
        np.testing.assert_array_equal(nj.read_imu({**columns(), "time": stamps}, units=SI).time, imu.time)


def test_times_of_the_day_and_of_the_week_go_on(tmp_path):
    at = np.datetime64("2024-07-08T23:59:59.000") + (1000 * TIME).round().astype("m8[ms]")
    imu = nj.read_imu(written(tmp_path / "a.csv", [str(t)[11:] for t in at]), units=SI)
    np.testing.assert_allclose(imu.time, 86399 + TIME, rtol=0, atol=1e-9)
    table = np.column_stack([(604799 + TIME) % 604800, TABLE[:, 1:]])
    np.testing.assert_allclose(nj.read_imu(table, units=SI).time, 604799 + TIME, rtol=0, atol=1e-9)
    np.savetxt(tmp_path / "a.txt", table)
    np.testing.assert_allclose(nj.read_imu(tmp_path / "a.txt", format="kf-gins").time, 604799 + TIME, atol=1e-9)


@pytest.mark.parametrize("read", [nj.read_imu, nj.recorded.read_samples])
def test_times_that_are_no_seconds_are_doubted(read):
    with pytest.warns(UserWarning, match=r'come at 1e-05 Hz .* time_unit="ms" \(0.01 Hz\) or "us" \(10 Hz\)'):
        read(TABLE * [1e6, *[1] * 6], units=SI)


@pytest.mark.parametrize(
    ("units", "suffixes", "factors"),
    [
        ({"gyro": "deg/s", "accel": "g"}, ("", ""), (np.pi / 180, 9.80665)),
        ({"gyro": "deg/h", "accel": "mg"}, ("", ""), (np.pi / 648000, 9.80665e-3)),
        (None, (" [deg/s]", " [m/s^2]"), (np.pi / 180, 1.0)),
        ({"accel": "m/s2"}, ("_rad_s", ""), (1.0, 1.0)),
    ],
)
def test_units_are_told_or_in_the_names(units, suffixes, factors):
    names = ["time_ms", *(n + suffixes[n.startswith("accel")] for n in NAMES[1:])]
    table = TABLE * [1000, *[1] * 6]
    imu = nj.read_imu(columns(names, table), units=units)
    np.testing.assert_allclose(imu.time, TIME)
    np.testing.assert_allclose(imu.gyro, factors[0] * TABLE[:, 1:4], rtol=1e-14)
    np.testing.assert_allclose(imu.accel, factors[1] * TABLE[:, 4:], rtol=1e-14)


def test_fixes_of_each_sensor(tmp_path):
    time = np.array([1.0, 2.5, 4.0])
    table = np.column_stack([time, np.arange(9.0).reshape(3, 3)])
    found = nj.read_fixes(table, GNSS)
    np.testing.assert_array_equal(found.time, time)
    np.testing.assert_array_equal(found.value, table[:, 1:])
    speed = nj.GnssVelocity(1.0, horizontal=1.0, vertical=2.0)
    kilometres = columns(("time", "vn_km_h", "ve_km_h", "vd_km_h"), table)
    np.testing.assert_allclose(nj.read_fixes(kilometres, speed).value, table[:, 1:] / 3.6)
    (tmp_path / "baro.csv").write_text("time;alt\n1;5\n2;6\n")
    np.testing.assert_array_equal(nj.read_fixes(tmp_path / "baro.csv", BARO).value, [[5], [6]])


COMPASS = nj.aiding.Magnetometer(10.0, sd=2e-7, field=(22e-6, 1e-6, 43e-6))
PAIR = nj.aiding.DualAntenna(1.0, horizontal=0.01, vertical=0.02, baseline=(1.0, 0.0, 0.0))


def test_fields_and_baselines_by_their_names_and_units():
    field = np.array([[20.0, -5.0, 43.0], [22.0, 1.0, 40.0]])
    table = columns(("time", "mag_x_uT", "mag_y_uT", "mag_z_uT"), np.column_stack([[0.0, 0.1], field]))
    np.testing.assert_allclose(nj.read_fixes(table, COMPASS).value, field * 1e-6)
    way = np.array([[80.0, 60.0, 1.0], [-60.0, 80.0, 0.0]])  # as u-blox names it
    table = columns(("time", "relPosN_cm", "relPosE_cm", "relPosD_cm"), np.column_stack([[0.0, 1.0], way]))
    np.testing.assert_allclose(nj.read_fixes(table, PAIR, origin=(0.8, 0.1, 0.0)).value, way / 100)


@pytest.mark.parametrize(("sensor", "named"), [(COMPASS, "about 43 T long"), (PAIR, "about 100 m long")])
def test_vectors_in_another_unit_are_noticed_by_their_length(sensor, named):
    values = [[0.0, 0.0, 43.0]] if sensor is COMPASS else [[60.0, 80.0, 0.0]]
    with pytest.raises(ValueError, match=named):
        nj.read_fixes(np.column_stack([[0.0], values]), sensor)


def test_fixes_in_outages_are_kept_from_the_filter():
    sensor = nj.Barometer(1.0, height=0.5, outages=[(2.0, 3.0)])
    found = nj.read_fixes({"time": np.arange(1.0, 5.0), "height": np.arange(4.0)}, sensor)
    np.testing.assert_array_equal(found.time, [1, 2, 3, 4])
    np.testing.assert_array_equal(found.given, [True, False, False, True])


def test_geodetic_positions_become_local():
    table = {"time": np.arange(2.0), "lat": np.array([45, 45.001]), "lon": np.full(2, 7.0), "h": np.array([100.0, 90])}
    found = nj.read_fixes(table, GNSS, origin=(np.pi / 4, np.deg2rad(7), 100.0), angles="deg")
    np.testing.assert_allclose(found.value, [[0, 0, 0], [111.13, 0, 10]], atol=0.01)


def test_rows_without_a_value_are_no_fixes():
    table = {"time": np.arange(3.0), "height": np.array([500.0, np.nan, 502.0])}
    with pytest.warns(
        UserWarning, match=r"1 of 3 rows are no fix with height \(NaN\), the first at index 1, and are l"
    ):
        found = nj.read_fixes(table, BARO)
    assert found.time.tolist() == [0.0, 2.0]
    geodetic = {"time": np.arange(2.0), "lat_deg": [0.0, 46.5], "lon_deg": [0.0, 6.6], "h": [0.0, 400.0]}
    with pytest.warns(
        UserWarning, match="1 of 2 rows are no fix with latitude, longitude, height .*latitude and longi"
    ):
        assert nj.read_fixes(geodetic, GNSS, origin=(0.8115, 0.115, 400.0)).time.tolist() == [1.0]


def test_heights_above_an_origin():
    table = {"time": np.arange(2.0), "height": np.array([500.0, 502.0])}
    np.testing.assert_array_equal(nj.read_fixes(table, BARO, origin=(0.8, 0.1, 500.0)).value, [[0], [2]])


class Odometer(nj.GnssVelocity):
    """Of another kind."""


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda: nj.read_imu(TABLE), r"The unit of gyro_x is not stated: give units=\{\"gyro\": ...\}"),
        (lambda: nj.read_imu(TABLE, units={"gyro": "rad/s"}), "unit of accel_x is not stated"),
        (lambda: nj.read_imu(TABLE, units={**SI, "baro": "m"}), "these are gyro, accel, baro"),
        (
            lambda: nj.read_imu(TABLE, units={**SI, "gyro": "m/s"}),
            f"{', '.join(f'{a}/{t}' for a in ANGLES for t in ('min', 's', 'h'))}, {', '.join(ANGLES)}, and is 'm/s'",
        ),
        (lambda: nj.read_imu(columns(("time", "gyro_x_deg_s", *NAMES[2:])), units=SI), "the source says deg_s"),
        (lambda: nj.read_imu(TABLE[:, :6], units=SI), "there are 6, without names"),
        (lambda: nj.read_imu(columns(("time", "turn_x", *NAMES[2:])), units=SI), "No column is found for gyro_x"),
        (lambda: nj.read_imu(columns(), units=SI, columns={"yaw": 1}), "columns names yaw; the quantities are: time"),
        (lambda: nj.read_imu({**columns(), "acc_x": TIME}, units=SI), "Both 'accel_x' and 'acc_x' may be"),
        (
            lambda: nj.read_imu(TABLE[[0, 1, 4, 5]], units=SI),
            r"gap of 0\.3 s before index 2.* 2 samples are missing.*gaps=\"longest\" takes the longest run",
        ),
        (lambda: nj.read_imu(TABLE[::-1], units=SI), "does not increase"),
        (lambda: nj.read_imu(TABLE[:1], units=SI), "has 1 value: a rate needs two"),
        (
            lambda: nj.read_fixes(TABLE[:, :4], nj.GnssVelocity(1.0, horizontal=1.0, vertical=1.0), origin=(0, 0, 0)),
            "Velocities have no origin",
        ),
        (lambda: nj.read_fixes(TABLE, GNSS), "The columns are time, north, east, down, and there are 7"),
        (lambda: nj.read_fixes(TABLE[:, :2] * np.nan, BARO), "None of the 20 rows is a fix with height"),
        (lambda: nj.read_fixes(TABLE, Odometer(1.0, horizontal=1.0, vertical=1.0)), "and this is Odometer"),
        (
            lambda: nj.read_fixes(TABLE[:, :2], nj.Barometer(1.0, height=1.0, outages=[(0, 9)])),
            "All 20 fixes of barometer lie in its outages: leave it out",
        ),
    ],
)
def test_refusals(call, complaint):
    with pytest.raises(ValueError, match=complaint):
        call()


def test_errors_name_the_file(tmp_path):
    (tmp_path / "a.csv").write_text("time,north\n1,2\n")
    with pytest.raises(ValueError, match=r"a\.csv: No column is found for east, down"):
        nj.read_fixes(tmp_path / "a.csv", GNSS)
    with pytest.raises(FileNotFoundError, match="no file"):
        nj.read_imu(tmp_path / "b.csv")


# As loggers write them

AXES = TABLE[:, 1:]


def text(rows, separator=","):
    return "".join(separator.join(map(repr, map(float, row))) + "\n" for row in rows)


@pytest.mark.parametrize("rate", [99.4, 152.3])
def test_stamps_are_regressed_and_not_trusted(rate):
    """Of a clock that writes milliseconds, whose zero stays where it was."""
    time = 50.0 + np.arange(3000) / rate
    table = np.column_stack([np.round(time, 3), np.random.default_rng(0).normal(size=(3000, 6))])
    imu = nj.read_imu(table, units=SI)
    # the slope and the middle of a line by least squares through errors of 1 ms / sqrt(12)
    assert imu.rate == pytest.approx(rate, abs=5 * 1e-3 / np.sqrt(12) * np.sqrt(12 / 3000) / 3000 * rate**2)
    np.testing.assert_allclose(imu.time, time, atol=5 * 1e-3 / np.sqrt(12) * 2 / np.sqrt(3000), rtol=0)
    np.testing.assert_array_equal(imu.gyro, table[:, 1:4])


def test_the_longest_run_of_a_record_with_gaps():
    imu = nj.read_imu(np.delete(TABLE, 5, axis=0), units=SI, gaps="longest")
    np.testing.assert_array_equal(imu.time, TIME[6:])
    np.testing.assert_array_equal(imu.accel, TABLE[6:, 4:])
    with pytest.raises(ValueError, match="gaps is refuse or longest, and is 'nan': a navigation needs all samples"):
        nj.read_imu(TABLE, units=SI, gaps="nan")


def test_increments_of_kf_gins(tmp_path):
    """At the seconds of the week that the file states."""
    file = tmp_path / "imu.txt"
    file.write_text(text(np.column_stack([456300 + TIME, AXES / 10]), " "))
    imu = nj.read_imu(file, format="kf-gins")
    np.testing.assert_allclose(imu.time, 456300 + TIME, rtol=1e-12)
    np.testing.assert_allclose(np.hstack([imu.gyro, imu.accel]), AXES, rtol=1e-9)
    names = [f"dtheta_{x}[rad]" for x in "xyz"] + [f"dvel_{x}[m/s]" for x in "xyz"]
    named = nj.read_imu(columns(["time", *names], np.column_stack([TIME, AXES / 10])))
    np.testing.assert_allclose(named.gyro, imu.gyro, rtol=1e-9)


def test_counts_with_a_scale():
    counts = np.column_stack([TIME, np.round(AXES * 1000)])
    imu = nj.read_imu(counts, scale={"gyro": "0.1 deg/s", "accel": "1.25 mg"})
    np.testing.assert_allclose(imu.gyro, counts[:, 1:4] * 0.1 * np.pi / 180, rtol=1e-12)
    np.testing.assert_allclose(imu.accel, counts[:, 4:] * 1.25e-3 * 9.80665, rtol=1e-12)
    with pytest.raises(ValueError, match="Both units and scale are given for gyro"):
        nj.read_imu(counts, units=SI, scale={"gyro": "0.1 deg/s"})


def test_a_format_that_its_content_tells(tmp_path):
    file = tmp_path / "data.csv"
    names = [f"w_RS_S_{x} [rad s^-1]" for x in "xyz"] + [f"a_RS_S_{x} [m s^-2]" for x in "xyz"]
    rows = [f"{1403636579 * 10**9 + round(t * 1e9)}," + text([row]) for t, row in zip(TIME, AXES, strict=True)]
    file.write_text(",".join(["#timestamp [ns]", *names]) + "\n" + "".join(rows))
    imu = nj.read_imu(file)
    np.testing.assert_allclose(imu.time, 1403636579 + TIME, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(np.hstack([imu.gyro, imu.accel]), AXES)


def test_units_that_gravity_contradicts_are_doubted(tmp_path):
    names = ["time", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    rows = np.column_stack([np.arange(8) / 20.0, np.zeros((8, 5)), np.full(8, -1.0)])
    np.savetxt(tmp_path / "imu.csv", rows, delimiter=",", header=",".join(names), comments="")
    with pytest.warns(ImplausibleUnitsWarning, match="look like g. If they are, say so"):
        nj.read_imu(tmp_path / "imu.csv", units={"gyro": "rad/s", "accel": "m/s^2"})
    with warnings.catch_warnings(action="error"):
        nj.read_imu(tmp_path / "imu.csv", units={"gyro": "rad/s", "accel": "g"})
