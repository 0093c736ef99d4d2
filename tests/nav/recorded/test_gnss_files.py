"""Fixes from files of GNSS receivers: every format of time and position, what goes with them, and what is refused."""

import datetime as dt

import numpy as np
import pymap3d
import pytest

import nav_jax as nj
from nav_jax.recorded.gnss import FORMATS
from nav_jax.recorded.gnss.nmea import IncompleteLogWarning
from nav_jax.recorded.gnss.time_scales import from_calendar, from_weeks, on_clock

LEAP = 18
"""GPST - UTC since 2017."""
START = dt.datetime(2024, 7, 8, 19, 34, 0)
"""Of the fixes, GPST; a Monday."""
TOW = 86400 + 19 * 3600 + 34 * 60
WEEK = 2322
TIMES = np.array([0.0, 0.25, 1.5, 2.0])
LLH = np.array([[46.5, -6.6, 400.0], [46.5001, -6.6001, 401.5], [46.5003, -6.6002, 402.0], [46.5004, -6.6, 402.5]])
QUALITY = [1, 2, 5, 1]
SD = np.array([[0.01, 0.02, 0.03], [0.4, 0.5, 0.9], [2.0, 3.0, 4.0], [0.02, 0.01, 0.05]])
"""North, east, up or down."""
ROOTS = np.array([[0.004, -0.006, 0.005], [0.2, -0.3, 0.1], [1.0, -1.5, 1.2], [0.003, 0.002, -0.004]])
"""Signed roots of covariances north-east, east-up, up-north."""
VELOCITY = np.array([[1.0, -2.0, 0.1], [1.5, -1.0, -0.2], [0.5, 3.0, 0.0], [4.0, 0.5, 0.3]])
"""North, east, up."""


def ned(llh=LLH, origin=LLH[0]):
    return np.column_stack(pymap3d.geodetic2ned(*llh.T, *origin))


def enu_covariance():
    """Of the fixes, along east, north, up."""
    n, e, u = SD.T
    ne, eu, un = np.sign(ROOTS.T) * ROOTS.T**2
    return np.moveaxis(np.array([[e**2, ne, eu], [ne, n**2, un], [eu, un, u**2]]), 2, 0)


TO_NED = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])


def dms(angle):
    sign, angle = "-" if angle < 0 else "", abs(angle)
    minutes = (angle % 1) * 60
    return f"{sign}{int(angle)} {int(minutes)} {(minutes % 1) * 60:.9f}"


def pos(path, kind="llh", time="date", scale="GPST", separator=" ", velocity=False, head=()):
    """A solution in one of RTKLIB's formats."""
    late = {"GPST": 0.0, "UTC": -LEAP, "JST": 9 * 3600 - LEAP}[scale]
    moments = [START + dt.timedelta(seconds=float(t) + late) for t in TIMES]
    if time == "date":
        stamps = [m.strftime("%Y/%m/%d %H:%M:%S.") + f"{m.microsecond // 1000:03d}" for m in moments]
    else:
        stamps = [f"{WEEK} {TOW + late + t:.3f}" for t in TIMES]
    C = enu_covariance()
    if kind == "xyz":
        points = np.column_stack(pymap3d.geodetic2ecef(*LLH.T))
        east = [np.stack(pymap3d.enu2uvw(*np.eye(3), *p[:2])) for p in LLH]  # columns are east, north, up
        C = np.array([R @ c @ R.T for R, c in zip(east, C, strict=True)])
        speeds = np.array([R @ v[[1, 0, 2]] for R, v in zip(east, VELOCITY, strict=True)])
        names, order = "x-ecef(m) y-ecef(m) z-ecef(m)", (0, 1, 2)
    elif kind == "enu":
        points, speeds, order = ned() @ TO_NED.T, VELOCITY[:, [1, 0, 2]], (0, 1, 2)
        names = "e-baseline(m) n-baseline(m) u-baseline(m)"
    else:
        points, speeds, order = LLH, VELOCITY, (1, 0, 2)
        unit = "deg" if kind == "llh" else "d'\""
        names = f"latitude({unit}) longitude({unit}) height(m)"
    sd = np.sqrt(np.diagonal(C, axis1=1, axis2=2))[:, order]
    roots = [np.sign(c) * np.sqrt(np.abs(c)) for c in (C[:, order[i], order[j]] for i, j in ((0, 1), (1, 2), (2, 0)))]
    table = np.column_stack([QUALITY, [9, 8, 7, 9], sd, *roots, [0.5] * 4, [3.0] * 4])
    a, b, c = {"llh": "neu", "dms": "neu", "xyz": "xyz", "enu": "enu"}[kind]
    columns = f"{names} Q ns sd{a}(m) sd{b}(m) sd{c}(m) sd{a + b}(m) sd{b + c}(m) sd{c + a}(m) age(s) ratio"
    if velocity:
        columns += f" v{a}(m/s) v{b}(m/s) v{c}(m/s) sdv{a} sdv{b} sdv{c} sdv{a + b} sdv{b + c} sdv{c + a}"
        table = np.column_stack([table, speeds, 2 * sd, *(2 * r for r in roots)])
    lines = [*head, f"%  {scale}  {columns}".replace(" ", separator)]
    for stamp, point, row in zip(stamps, points, table, strict=True):
        place = (
            f"{dms(point[0])} {dms(point[1])} {point[2]:.12f}"
            if kind == "dms"
            else " ".join(f"{x:.12f}" for x in point)
        )
        lines.append(
            separator.join([stamp.replace(" ", separator), place.replace(" ", separator), *map("{:.12f}".format, row)])
        )
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("separator", [" ", ",", "\t"])
@pytest.mark.parametrize(
    ("time", "scale"), [("date", "GPST"), ("date", "UTC"), ("date", "JST"), ("tow", "GPST"), ("tow", "UTC")]
)
@pytest.mark.parametrize("kind", ["llh", "dms", "xyz", "enu"])
def test_rtklib(tmp_path, kind, time, scale, separator):
    velocity = kind != "enu"
    file = pos(tmp_path / "a.pos", kind, time, scale, separator, velocity=velocity)
    found = nj.read_gnss(file, origin=None if kind != "enu" else (*np.deg2rad(LLH[0, :2]), LLH[0, 2]))
    np.testing.assert_allclose(found.time, TOW + TIMES, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.position, ned(), rtol=0, atol=1e-5)
    np.testing.assert_allclose(found.origin, [*np.deg2rad(LLH[0, :2]), LLH[0, 2]], rtol=0, atol=1e-8)
    # the axes of the last fix differ from those of the first by 6e-6 rad
    expected = TO_NED @ enu_covariance() @ TO_NED.T
    np.testing.assert_allclose(found.covariance, expected, rtol=0, atol=3e-5 * SD.max() ** 2)
    if velocity:
        np.testing.assert_allclose(found.velocity, VELOCITY * [1, 1, -1], rtol=0, atol=1e-4)
        np.testing.assert_allclose(found.velocity_covariance, 4 * expected, rtol=0, atol=1.2e-4 * SD.max() ** 2)
    assert found.quality.tolist() == QUALITY
    assert found.age.tolist() == [0.5] * 4
    assert found.without("single", 2).time.tolist() == found.time[[0, 3]].tolist()


def test_minus_zero_degrees_and_the_reference_of_a_baseline(tmp_path):
    file = tmp_path / "a.pos"
    head = "%  GPST  latitude(d'\") longitude(d'\") height(m) Q ns"
    file.write_text(f"{head}\n2300 1.0 -0 30 0.0 -0 15 0.0 10.0 1 5\n")
    np.testing.assert_allclose(np.rad2deg(nj.read_gnss(file).origin[:2]), [-0.5, -0.25], rtol=1e-14)
    for reference in ("46.5 -6.6 400.0", "46 30 0.0 -6 36 0.0 400.0"):
        found = nj.read_gnss(pos(file, "enu", head=[f"% ref pos   : {reference}"]))
        np.testing.assert_allclose(found.origin, [*np.deg2rad(LLH[0, :2]), 400.0], rtol=1e-14)
        np.testing.assert_allclose(found.position, ned(), rtol=0, atol=1e-6)
        # about another origin
        other = (*np.deg2rad([46.49, -6.61]), 390.0)
        moved = nj.read_gnss(file, origin=other)
        np.testing.assert_allclose(moved.position, ned(origin=[46.49, -6.61, 390.0]), rtol=0, atol=1e-5)
    assert nj.read_gnss(pos(file, "enu")).origin is None


def checked(sentence):
    total = 0
    for c in sentence:
        total ^= ord(c)
    return f"${sentence}*{total:02X}"


def nmea(path, *, date=True, sd=True, midnight=False):
    """A log of a receiver; UTC."""
    start = dt.datetime(2024, 7, 8, 23, 59, 59) if midnight else START - dt.timedelta(seconds=LEAP)
    lines = []
    for t, (lat, lon, h), (n, e, u), (vn, ve, _) in zip(TIMES, LLH, SD, VELOCITY, strict=True):
        moment = start + dt.timedelta(seconds=float(t))
        clock = moment.strftime("%H%M%S.") + f"{moment.microsecond // 10000:02d}"
        place = f"{int(lat):02d}{lat % 1 * 60:012.9f},N,{int(-lon):03d}{-lon % 1 * 60:012.9f},W"
        course, knots = np.rad2deg(np.arctan2(ve, vn)) % 360, np.hypot(vn, ve) * 3600 / 1852
        if date:
            lines.append(checked(f"GNRMC,{clock},A,{place},{knots:.9f},{course:.9f},{moment:%d%m%y},,,A"))
        lines.append(checked(f"GNGGA,{clock},{place},4,12,0.8,{h - 50:.3f},M,50.0,M,1.0,0001"))
        if sd:
            lines.append(checked(f"GNGST,{clock},1.0,,,,{n},{e},{u}"))
        lines.append("$GPGSV,not,read")
    path.write_text("a logger starts here\n" + "\r\n".join(lines) + "\r\n")
    return path


def test_nmea(tmp_path):
    found = nj.read_gnss(nmea(tmp_path / "a.nmea"))
    np.testing.assert_allclose(found.time, TOW + TIMES, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.position, ned(), rtol=0, atol=1e-4)
    np.testing.assert_allclose(np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2)), SD, rtol=1e-4)
    np.testing.assert_allclose(found.velocity[:, :2], VELOCITY[:, :2], rtol=0, atol=1e-4)
    assert found.kinds[int(found.quality[0])] == "fix"
    assert found.height == "ellipsoid"
    with pytest.raises(ValueError, match=r"no vertical velocity: give vertical=\.\.\."):
        found.velocity_fixes(horizontal=0.1)
    fixes = found.velocity_fixes(horizontal=0.1, vertical=0.5)
    assert fixes.value[:, 2].tolist() == [0.0] * 4


def test_nmea_over_midnight_and_its_date(tmp_path):
    found = nj.read_gnss(nmea(tmp_path / "a.nmea", midnight=True), clock="day")
    np.testing.assert_allclose(found.time, 86399.0 + TIMES, rtol=0, atol=1e-9)
    nmea(tmp_path / "b.nmea", date=False, midnight=True)
    with pytest.raises(ValueError, match=r"No sentence has a date \(RMC, ZDA\): give date="):
        nj.read_gnss(tmp_path / "b.nmea")
    dated = nj.read_gnss(tmp_path / "b.nmea", date="2024-07-08", clock="unix")
    assert dated.time[0] == dt.datetime(2024, 7, 8, 23, 59, 59, tzinfo=dt.UTC).timestamp()
    with (tmp_path / "b.nmea").open("a") as file:  # a date that comes later is counted back
        file.write(checked("GNZDA,000003.00,09,07,2024,00,00") + "\n")
    assert nj.read_gnss(tmp_path / "b.nmea", clock="unix").time[0] == dated.time[0]


def test_nmea_that_is_broken(tmp_path):
    file = nmea(tmp_path / "a.nmea")
    lines = file.read_text().splitlines()
    gga = [i for i, line in enumerate(lines) if "GGA" in line]
    lines[gga[1]] = lines[gga[1]].replace("46", "47", 1)
    file.write_text("\n".join(lines))
    with pytest.warns(IncompleteLogWarning, match="1 of 12 sentences are corrupt"):
        assert len(nj.read_gnss(file)) == 3
    lines = nmea(file).read_text().splitlines()
    file.write_text("\n".join(line for i, line in enumerate(lines) if not (i > 8 and "GST" in line)))
    with pytest.warns(IncompleteLogWarning, match="2 of 4 fixes have no GST"):
        assert len(nj.read_gnss(file)) == 2
    file.write_text("hello\n")
    with pytest.raises(ValueError, match="no GGA sentence with a fix"):
        nj.read_gnss(file)


@pytest.mark.parametrize("wide", [False, True])
def test_kf_gins(tmp_path, wide):
    table = np.column_stack([TOW + TIMES, LLH, SD])
    if wide:
        table = np.column_stack([table, VELOCITY, SD / 10])
    np.savetxt(tmp_path / "GNSS.txt", table, "%.12f")
    found = nj.read_gnss(tmp_path / "GNSS.txt", format="kf-gins")
    np.testing.assert_allclose(found.time, TOW + TIMES, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.position, ned(), rtol=0, atol=1e-5)
    np.testing.assert_allclose(np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2)), SD, rtol=1e-4)
    assert (found.velocity is not None) == wide
    if wide:
        np.testing.assert_allclose(found.velocity, VELOCITY, rtol=0, atol=1e-4)
    dated = nj.read_gnss(tmp_path / "GNSS.txt", format="kf-gins", week=WEEK, clock="unix")
    start = (START - dt.timedelta(seconds=LEAP)).replace(tzinfo=dt.UTC).timestamp()
    np.testing.assert_allclose(dated.time, start + TIMES, rtol=0, atol=1e-6)
    with pytest.raises(ValueError, match="the file has bare seconds: leave clock out"):
        nj.read_gnss(tmp_path / "GNSS.txt", format="kf-gins", clock="unix")


@pytest.mark.parametrize("undulation", [False, True])
def test_gpx(tmp_path, undulation):
    points = []
    for t, (lat, lon, h) in zip(TIMES, LLH, strict=True):
        moment = START - dt.timedelta(seconds=LEAP - float(t))
        height = f"<ele>{h - 50}</ele><geoidheight>50</geoidheight>" if undulation else f"<ele>{h}</ele>"
        points.append(
            f'<trkpt lat="{lat}" lon="{lon}">{height}<time>{moment.isoformat()}Z</time><fix>dgps</fix></trkpt>'
        )
    body = f"<trk><trkseg>{''.join(points)}</trkseg></trk>"
    (tmp_path / "a.gpx").write_text(f'<gpx xmlns="http://www.topografix.com/GPX/1/1" version="1.1">{body}</gpx>')
    found = nj.read_gnss(tmp_path / "a.gpx")
    np.testing.assert_allclose(found.time, TOW + TIMES, rtol=0, atol=1e-6)
    np.testing.assert_allclose(found.position, ned(), rtol=0, atol=1e-6)
    assert found.height == ("ellipsoid" if undulation else "geoid")
    assert found.kinds[int(found.quality[0])] == "dgps"
    assert found.covariance is None
    with pytest.raises(ValueError, match="has no standard deviations; give horizontal and vertical"):
        found.position_fixes()


@pytest.mark.parametrize("kind", ["geodetic", "ned", "enu", "ecef"])
def test_tables(tmp_path, kind):
    names, points = {
        "geodetic": ("lat_deg,lon_deg,h", LLH),
        "ned": ("north,east,down", ned()),
        "enu": ("E,N,U", ned() @ TO_NED.T),
        "ecef": ("x_ecef_m,y_ecef_m,z_ecef_m", np.column_stack(pymap3d.geodetic2ecef(*LLH.T))),
    }[kind]
    speed, values = ("vn,ve,vu", VELOCITY) if kind == "enu" else ("vn,ve,vd", VELOCITY * [1, 1, -1])
    head = f"time,{names},sdn,sde,sdu,{speed},sdvn,sdve,sdvu,Q"
    table = np.column_stack([TIMES, points, SD, values, SD / 10, QUALITY])
    np.savetxt(tmp_path / "a.csv", table, "%.12f", delimiter=",", header=head, comments="")
    found = nj.read_gnss(tmp_path / "a.csv")
    assert found.clock == "as in the file"
    np.testing.assert_array_equal(found.time, TIMES)
    np.testing.assert_allclose(found.position, ned(), rtol=0, atol=1e-5)
    sd = [np.sqrt(np.diagonal(C, axis1=1, axis2=2)) for C in (found.covariance, found.velocity_covariance)]
    if kind == "ecef":  # north, east, down of a table are those of its position, here x, y, z
        assert np.all(sd[0] < 1.01 * SD.max())
    else:
        np.testing.assert_allclose(sd, [SD, SD / 10], rtol=1e-4)
        np.testing.assert_allclose(found.velocity, VELOCITY * [1, 1, -1], rtol=0, atol=1e-4)
    assert found.without(5).quality.tolist() == [1, 2, 1]


def table_of(path, times, rows, names="time,lat_deg,lon_deg,h,vn,ve,vd"):
    lines = [",".join([str(t), *(f"{x:.12g}" for x in row)]) for t, row in zip(times, rows, strict=True)]
    path.write_text("\n".join([names, *lines]) + "\n")
    return path


def test_stamps_of_a_table_are_utc(tmp_path):
    rows = np.column_stack([LLH, VELOCITY])
    utc = [START - dt.timedelta(seconds=LEAP - float(t)) for t in TIMES]
    found = nj.read_gnss(table_of(tmp_path / "a.csv", [f"{m.isoformat()}Z" for m in utc], rows))
    np.testing.assert_allclose(found.time, TOW + TIMES, rtol=0, atol=1e-9)
    assert nj.read_gnss(tmp_path / "a.csv", clock="unix").time[0] == utc[0].replace(tzinfo=dt.UTC).timestamp()
    of_day = table_of(tmp_path / "b.csv", [m.time().isoformat() for m in utc], rows)
    np.testing.assert_allclose(nj.read_gnss(of_day, date="2024-07-08").time, found.time, rtol=0, atol=1e-9)
    np.testing.assert_allclose(nj.read_gnss(of_day).time, TOW - LEAP - 86400 + TIMES, rtol=0, atol=1e-9)


@pytest.mark.parametrize("nothing", [np.full(6, np.nan), np.zeros(6)])
def test_rows_without_a_position_are_no_fixes(tmp_path, nothing):
    rows = np.column_stack([LLH, VELOCITY])
    rows[1] = nothing
    file = table_of(tmp_path / "a.csv", TIMES, rows)
    with pytest.warns(IncompleteLogWarning, match="1 of 4 rows are no fix with lat.* index 1, and are left out"):
        found = nj.read_gnss(file)
    np.testing.assert_array_equal(found.time, TIMES[[0, 2, 3]])
    np.testing.assert_allclose(found.position, ned()[[0, 2, 3]], rtol=0, atol=1e-5)
    with pytest.raises(ValueError, match="None of the 2 rows is a fix with latitude"):
        nj.read_gnss(table_of(file, TIMES[:2], [nothing, nothing]))


def test_fixes_may_lack_a_velocity(tmp_path):
    rows = np.column_stack([LLH, VELOCITY])
    rows[2, 3:] = np.nan
    found = nj.read_gnss(table_of(tmp_path / "a.csv", TIMES, rows))
    np.testing.assert_array_equal(found.time, TIMES)
    np.testing.assert_array_equal(found.velocity_fixes(horizontal=0.1, vertical=0.1).time, TIMES[[0, 1, 3]])


@pytest.mark.parametrize("kind", ["table", "kf-gins"])
def test_seconds_of_the_week_go_on_and_others_do_not_fall(tmp_path, kind):
    def read(times):
        table = np.column_stack([times, LLH, SD])
        np.savetxt(
            tmp_path / "a.csv", table, "%.9f", delimiter=",", comments="", header=
            "" if kind == "kf-gins" else "time,lat_deg,lon_deg,h,sdn,sde,sdd",
        )  # fmt: skip
        return nj.read_gnss(tmp_path / "a.csv", format=kind)

    np.testing.assert_allclose(read((604799 + TIMES) % 604800).time, 604799 + TIMES, rtol=0, atol=1e-9)
    with pytest.raises(ValueError, match=r"Time falls back at index 2: 1.5 s is followed by 0.25 s"):
        read(TIMES[[0, 2, 1, 3]])


def test_clocks():
    """Against the calendar of Python, which knows no leap seconds."""
    utc = dt.datetime(2016, 12, 31, 23, 59, 58)  # two seconds before the last leap second
    epochs = from_calendar(np.full(3, np.datetime64("2016-12-31")), np.array([86398.0, 86399.0, 86401.0]), "UTC")
    gps = (utc - dt.datetime(1980, 1, 6)).total_seconds() + 17
    np.testing.assert_array_equal(on_clock(epochs, "gps"), gps + np.array([0, 1, 4]))
    unix = utc.replace(tzinfo=dt.UTC).timestamp()
    np.testing.assert_array_equal(on_clock(epochs, "unix"), unix + np.array([0, 1, 3]))
    np.testing.assert_array_equal(on_clock(epochs, "first"), [0, 1, 4])
    # a week goes on over its end
    over = from_weeks([2300, 2301], [604799.5, 0.5])
    np.testing.assert_array_equal(on_clock(over, "week"), [604799.5, 604800.5])
    assert on_clock(from_calendar([np.datetime64("2024-07-08")], [0.0], "GPST"), "week").tolist() == [86400.0]


def test_what_becomes_of_a_record(tmp_path):
    found = nj.read_gnss(pos(tmp_path / "a.pos", velocity=True))
    fixes = found.position_fixes(lever_arm=(1.0, 0.0, -1.0), outages=[(TOW + 0.2, TOW + 1.6)], name="rtk")
    assert fixes.sensor.name == "rtk"
    assert fixes.given.tolist() == [True, False, False, True]
    np.testing.assert_array_equal(fixes.covariance, found.covariance)
    np.testing.assert_allclose(found.position_fixes(sd_factor=2.0).covariance, 4 * found.covariance)
    alone = found.position_fixes(correlated=False).covariance
    np.testing.assert_array_equal(alone, found.covariance * np.eye(3))
    mixed = found.position_fixes(vertical=7.0, sd_factor=3.0).covariance
    np.testing.assert_allclose(mixed[:, :2, :2], 9 * found.covariance[:, :2, :2])
    np.testing.assert_allclose(mixed[:, 2], np.tile([0, 0, 49.0], (4, 1)))
    stated = found.velocity_fixes(horizontal=0.1, vertical=0.2)
    assert stated.covariance is None
    assert np.asarray(stated.sensor.believed).tolist() == [0.1, 0.1, 0.2]
    assert found.shifted(0.5).time[0] == found.time[0] + 0.5
    text = repr(found)
    for part in ("4 fixes of a.pos", "2 x 1 (fix)", "1 x 5 (single)", "position sd, median"):
        assert part in text


@pytest.mark.parametrize(
    ("text", "name", "options", "complaint"),
    [
        ("1 2 3\n", "a.pos", {}, "no line of column names"),
        ("@ Q\n", "a.pos", {}, "The file holds no fix"),
        ("@ Q\n2300 1 2 3 x 1\n", "a.pos", {}, "Line 2 is no line of numbers"),
        ("@ Q\n2300 1 2 3 4\n", "a.pos", {}, "Line 2 has 5 numbers"),
        ("@\n2300 1 2 3 4\n2300 2 2 3\n", "a.pos", {}, "Line 3 has 4 numbers"),
        ("% GPST azimuth(deg) Q\n2300 1 2 1\n", "a.pos", {}, "none of them is a position"),
        ("@\n23.5 1 2 3 4\n", "a.pos", {}, "A GPS week is a whole number"),
        ("1 2 3\n", "a.txt", {"format": "kf-gins"}, "this one has 3"),
        ("900000 1 2 3 1 1 1\n9e7 1 2 3 1 1 1\n", "a.txt", {"format": "kf-gins"}, "reaches from 900000 to 9e\\+07"),
        ("<gpx><trk>", "a.gpx", {}, "no GPX file, or it is cut off"),
        ("<gpx></gpx>", "a.gpx", {}, "no point of a track"),
        ('<gpx><trkpt lat="1" lon="2"><ele>3</ele></trkpt></gpx>', "a.gpx", {}, "Point 1 has no time"),
        ("1,2,3,4\n", "a.csv", {}, "columns have no names"),
        ("time,lat\n1,2\n", "a.csv", {}, "no position is found"),
        ("tow,lat_deg,lon_deg,h\n1,2,3,4\n", "a.csv", {}, "No column is found for time among tow, lat_deg"),
        ("time,lat,lon,h,n,e,d\n1,2,3,4,5,6,7\n", "a.csv", {}, "those of 2 kinds of position are found"),
        ("time,lat,lon,h\n1,2,3,4\n", "a.csv", {}, "unit of latitude is not stated"),
        ("time,lat,lon,h\n1,46,7,4\n", "a.csv", {"angles": "rad"}, "is wrong"),
        ("time,lat,lon,h,q\n1,46,7,4,1.5\n", "a.csv", {"angles": "deg"}, "quality holds whole numbers"),
        ("time,n,e,d\n1,46,7,4\n", "a.csv", {"format": "csv"}, "format is one of rtklib, nmea, gpx, kf-gins, table"),
        ("time,n,e,d\n1,46,7,4\n", "a.csv", {"clock": "sun"}, "The clock is one of week, gps, unix, day, first"),
        ("time,n,e,d\n1,46,7,4\n", "a.csv", {"origin": (46.0, 7.0, 0.0)}, "latitude and longitude in rad"),
        ("", "a.nmea", {"date": "today week"}, "date is a day"),
    ],
)  # fmt: skip
def test_refusals(tmp_path, text, name, options, complaint):
    (tmp_path / name).write_text(text.replace("@", "% GPST latitude(deg) longitude(deg) height(m)"))
    with pytest.raises(ValueError, match=complaint):
        nj.read_gnss(tmp_path / name, **options)


def test_qualities_that_are_not_there(tmp_path):
    found = nj.read_gnss(pos(tmp_path / "a.pos"))
    with pytest.raises(ValueError, match=r"no quality .manual.; there are 1 \(fix\), 2 \(float\)"):
        found.without("manual")
    with pytest.raises(ValueError, match="All 4 fixes have one of the qualities"):
        found.without(1, 2, 5)
    with pytest.raises(ValueError, match="have no velocity"):
        found.velocity_fixes()
    with pytest.raises(FileNotFoundError, match="no file"):
        nj.read_gnss(tmp_path / "b.pos")


def test_every_format_has_a_test():
    assert set(FORMATS) == {"rtklib", "nmea", "gpx", "kf-gins", "table"}
