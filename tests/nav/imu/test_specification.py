"""Datasheets: every conversion against a number worked out apart, what truth and filter hold, and what is refused."""

import jax
import numpy as np
import pytest

import gmwm_jax as gj
import nav_jax as nj
from gmwm_jax._internal.states import from_state, to_state
from nav_jax.imu.deterministic import GSensitivity, Misalignment, ScaleFactor, TemperatureBias
from nav_jax.imu.entries import ENTRIES, SIGMAS
from nav_jax.imu.specification import FLOOR, ImuSpecification

DEG, G = 0.017453292519943295, 9.80665
N = {"N": "0.6 deg/sqrt(h)"}, {"N": "0.06 m/s/sqrt(h)"}

CONVERSIONS = [
    # (sensor, entry, text, SI)
    ("gyro", "N", "0.15 deg/sqrt(h)", 4.363323129985824e-05),  # 0.15 pi/180/60
    ("gyro", "N", "0.008 deg/s/sqrt(Hz), typ", 0.008 * DEG),
    ("gyro", "N", "0.008 deg/s/sqrt(Hz), one-sided", 0.008 * DEG / 2**0.5),
    ("accel", "N", "60 ug/sqrt(Hz)", 5.88399e-4),
    ("accel", "N", "0.065 ft/s/sqrt(h), max", 3.302e-4),
    ("gyro", "B", "10 deg/h, max", 4.84813681109536e-5),
    ("gyro", "in_run_bias", "0.3 °/h", 1.454441043328608e-06),
    ("accel", "f0", "0.5 Hz", 0.5),
    ("gyro", "K", "2 deg/h/sqrt(h)", 1.616045603698454e-07),  # 2 pi/180/3600/60
    ("gyro", "Q", "1 arcsec", 4.84813681109536e-06),
    ("accel", "turn_on_bias", "±50 mg, 1 sigma", 0.4903325),
    ("accel", "scale_factor", "300 ppm, 3 sigma", 3e-4),
    ("gyro", "nonlinearity", "0.1 %", 1e-3),
    ("gyro", "misalignment", "1 mrad", 1e-3),
    ("gyro", "misalignment", "0.05 deg", 0.05 * DEG),
    ("accel", "misalignment", "20 arcsec", 9.69627362219072e-05),
    ("gyro", "misalignment", "2 %, typ", 0.02),
    ("gyro", "g_sensitivity", "7 deg/h/g", 3.460606596306335e-06),  # 7 pi/180/3600/9.80665
    ("gyro", "bias_temperature", "0.01 deg/s/degC, rms", 0.01 * DEG),
    ("accel", "scale_temperature", "50 ppm/K", 5e-5),
    ("gyro", "range", "300 deg/s", 5.235987755982989),
    ("accel", "range", "+/-18 g", 176.5197),
    ("gyro", "LSB", "1/16.4 deg/s", DEG / 16.4),
    ("accel", "LSB", "250/2^15 mg", 250e-3 * G / 32768),
    ("accel", "bandwidth", "330 Hz", 330.0),
]


def sheet(gyro=None, accel=None, **options):
    return ImuSpecification(N[0] | (gyro or {}), N[1] | (accel or {}), **options)


@pytest.mark.parametrize(("sensor", "entry", "text", "si"), CONVERSIONS)
def test_conversions(sensor, entry, text, si):
    found = ImuSpecification(**({"gyro": {}, "accel": {}} | {sensor: _alone(entry, text)}))
    np.testing.assert_allclose(found.value(sensor, entry), [si] * 3, rtol=1e-6)


def _alone(entry, text):
    return {entry: text} | ({"B": "1 ug"} if entry == "f0" else {})


def test_every_entry_has_a_row():
    assert {entry for _, entry, *_ in CONVERSIONS} == set(ENTRIES)


@pytest.mark.parametrize("kind", SIGMAS)
def test_a_number_is_so_many_standard_deviations(kind):
    number = {"2 sigma": 2, "3 sigma": 3, "max": 3, "min-max": 3}.get(kind, 1)
    one = sheet({"turn_on_bias": f"6 deg/s, {kind}" if kind else "6 deg/s"})
    np.testing.assert_allclose(one.sd("gyro", "turn_on_bias"), [6 * DEG / number] * 3, rtol=1e-12)
    np.testing.assert_array_equal(one.sd("accel", "turn_on_bias"), 0.0)
    if kind:
        other = one.with_entries(sigmas={kind: 1.5})
        np.testing.assert_allclose(other.sd("gyro", "turn_on_bias"), [4 * DEG] * 3, rtol=1e-12)


def test_an_axis_has_its_own_text():
    found = sheet(accel={"turn_on_bias": ("1 mg", "2 mg, 2 sigma", "3 mg")})
    np.testing.assert_allclose(found.truth(100.0).bias_sd, [0.001 * G, 0.001 * G, 0.003 * G, 0, 0, 0], rtol=1e-12)
    assert "1 mg | 2 mg, 2 sigma | 3 mg" in repr(found)


def test_what_is_emulated_and_believed():
    """White noise N^2 f, random walk K^2/f, constants with their standard deviations; a filter believes the same."""
    gyro = {"K": "2 deg/h/sqrt(h)", "Q": "1 arcsec", "turn_on_bias": "3 deg/h", "scale_factor": "300 ppm, max"}
    gyro |= {"g_sensitivity": "7 deg/h/g"}
    found = sheet(gyro, {"misalignment": "0.1 deg"}, rate="200 Hz")
    for errors in (found.truth(), found.filter()):
        assert errors.rate == 200.0
        white, walk, quantisation = errors.models[3].processes
        np.testing.assert_allclose(white.sigma2, (0.6 * DEG / 60) ** 2 * 200, rtol=1e-12)
        np.testing.assert_allclose(walk.gamma2, (2 * DEG / 3600 / 60) ** 2 / 200, rtol=1e-12)
        np.testing.assert_allclose(quantisation.q2, (DEG / 3600 * 200) ** 2, rtol=1e-12)
        np.testing.assert_allclose(errors.models[0].processes[0].sigma2, (0.06 / 60) ** 2 * 200, rtol=1e-12)
        np.testing.assert_allclose(errors.bias_sd, [0, 0, 0, *[3 * DEG / 3600] * 3], rtol=1e-12)
        scale, bent, by_force = errors.deterministic
        assert isinstance(scale, ScaleFactor)
        assert isinstance(bent, Misalignment)
        assert isinstance(by_force, GSensitivity)
        np.testing.assert_allclose(by_force.sd, [0, 0, 0, *[7 * DEG / 3600 / G] * 3], rtol=1e-12)
        np.testing.assert_allclose(scale.sd, [0, 0, 0, 1e-4, 1e-4, 1e-4], rtol=1e-12)
        np.testing.assert_allclose(bent.sd, [*[0.1 * DEG] * 3, 0, 0, 0], rtol=1e-12)
        assert len(errors.bank().states) == 3 + 3 + 3 + 6 + 9  # random walk, bias, scale; misalignment; g-sensitivity
        assert errors.output is None


def test_temperature_adds_to_biases_and_scale_factors():
    found = sheet(
        {"turn_on_bias": "3 deg/h", "bias_temperature": "2 deg/h/K, 2 sigma"}, {"scale_temperature": "10 ppm/K"}
    )
    warm = found.truth(100.0, temperature_sd=4.0)
    np.testing.assert_allclose(warm.bias_sd[3:], 5 * DEG / 3600, rtol=1e-12)  # 3 and 4
    np.testing.assert_allclose(warm.deterministic[0].sd, [*[4e-5] * 3, 0, 0, 0], rtol=1e-12)
    assert not found.truth(100.0).deterministic
    assert [text.split(":")[0] for text in found.unused] == ["gyro bias_temperature", "accel scale_temperature"]


def test_a_thermometer_makes_a_state_of_the_bias_by_temperature():
    found = sheet({"turn_on_bias": "3 deg/h", "bias_temperature": "2 deg/h/K, 2 sigma"}, {})
    for errors in (found.truth(100.0, thermometer=True), found.filter(100.0, thermometer=True)):
        np.testing.assert_allclose(errors.bias_sd[3:], 3 * DEG / 3600, rtol=1e-12)
        (by_temperature,) = errors.deterministic
        assert isinstance(by_temperature, TemperatureBias)
        np.testing.assert_allclose(by_temperature.sd, [0, 0, 0, *[DEG / 3600] * 3], rtol=1e-12)
    with pytest.raises(ValueError, match="thermometer: the datasheet leaves bias_temperature open"):
        sheet({}, {}).truth(100.0, thermometer=True)


@pytest.mark.parametrize("rate", [10.0, 400.0])
def test_the_ladder_has_the_allan_variance_of_the_datasheet(rate):
    """N, B and K of IEEE 952 up to a quarter of the longest period: 1 % the truth, 3 % the filter.

    And 4 % where a scale is less than 10 samples, at which a ladder ends.
    """
    found = sheet({"in_run_bias": "15 deg/h", "K": "6 deg/h/sqrt(h)"}, {"B": "0.2 mg"})
    tau = 2.0 ** np.arange(1, np.log2(900 * rate))
    slow = tau > 10
    b = 15 * DEG / 3600 / np.sqrt(2 * np.log(2) / np.pi)
    white, walk = gj.WN((0.6 * DEG / 60) ** 2 * rate), gj.RW((6 * DEG / 3600 / 60) ** 2 / rate)
    ideals = {3: white + gj.BI(b) + walk, 0: gj.WN(1e-6 * rate) + gj.BI(0.2e-3 * G)}
    for channel, ideal in ideals.items():
        expected = np.asarray(ideal.wavelet_variance(tau))
        for errors, most in ((found.truth(rate), 0.01), (found.filter(rate), 0.03)):
            off = np.asarray(errors.models[channel].wavelet_variance(tau)) / expected - 1
            assert np.abs(off[slow]).max() < most
            assert np.abs(off).max() < 0.04
    assert not found.truth(rate).notes()  # states for all of it


def test_a_corner_ends_the_ladder():
    """Below f0 the ladder has the spectrum of flicker noise, above it falls as 1/f^2: to 4/30 at 30 times f0."""
    found = sheet({"B": "100 deg/h", "f0": "0.01 Hz"})
    processes = found.truth(100.0).models[3].processes[1:]
    ladder, free = gj.Composite(list(processes)), gj.BI(100 * DEG / 3600)
    assert ladder.psd(0.3 / 100) < 4 / 30 * free.psd(0.3 / 100)
    np.testing.assert_allclose(ladder.psd(0.003 / 100), free.psd(0.003 / 100), rtol=0.02)


def test_one_process_in_the_place_of_the_ladder():
    found = sheet({"in_run_bias": "10 deg/h"})
    (process,) = found.filter(100.0, correlation_time=300.0).models[4].processes[1:]
    np.testing.assert_allclose(process.variance, (10 * DEG / 3600 / FLOOR) ** 2, rtol=1e-12)
    np.testing.assert_allclose(process.beta, 1 / 30000.0, rtol=1e-12)


def test_effects():
    found = sheet(
        {"range": "300 deg/s", "LSB": "0.05 deg/s", "bandwidth": "30 Hz", "Q": "1 arcsec"},
        {"range": "10 g", "LSB": "1 mg", "bandwidth": "330 Hz"},
    )
    output = found.truth(100.0, effects=["range", "LSB", "bandwidth"]).output
    np.testing.assert_allclose(output.range, [*[10 * G] * 3, *[300 * DEG] * 3], rtol=1e-12)
    np.testing.assert_allclose(output.step, [*[1e-3 * G] * 3, *[0.05 * DEG] * 3], rtol=1e-12)
    np.testing.assert_allclose(output.bandwidth, [*[330.0] * 3, *[30.0] * 3], rtol=1e-12)
    assert not output.increments
    # the noise of rounding is emulated by rounding, and known to the filter
    assert [len(found.truth(100.0, effects=e).models[3].processes) for e in ((), ("LSB",))] == [2, 1]
    white = found.filter(100.0, effects=["LSB"]).bank().white
    np.testing.assert_allclose(white[0], (0.06 / 60) ** 2 * 100 + (1e-3 * G) ** 2 / 12, rtol=1e-12)
    counted = sheet({"LSB": "1 arcsec"}, {"LSB": "1 mm/s"}, reads="increments")
    output = counted.truth(100.0, effects=["LSB"]).output
    assert output.increments
    np.testing.assert_allclose(output.step, [*[1e-3] * 3, *[DEG / 3600] * 3], rtol=1e-12)


def test_what_is_open_is_named():
    found = sheet({"in_run_bias": "10 deg/h", "LSB": "1 arcsec"}, reads="increments")
    assert found.open[0] == "rate"
    named = {text.split(":")[0] for text in found.open[1:]}
    gyro = set(ENTRIES) - {"N", "in_run_bias", "B", "LSB", "Q"}
    accel = set(ENTRIES) - {"N", "in_run_bias", "f0", "g_sensitivity"}
    assert named == {f"gyro {n}" for n in gyro} | {f"accel {n}" for n in accel}
    assert "left open: rate; gyro f0: corner frequency" in repr(found)


def test_a_specification_is_saved(tmp_path):
    found = sheet({"turn_on_bias": ("1 deg/h", "2 deg/h", "3 deg/h")}, rate="100 Hz", sigmas={"max": 2.0}, name="A")
    assert from_state(to_state(found)) == found
    assert nj.load(found.save(tmp_path / "sheet.json")) == found


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: sheet({"N": "0.15 deg/h"}),
            r"gyro N = '0.15 deg/h' measures rad/s, and angle or velocity random walk",
        ),
        (lambda: sheet(accel={"turn_on_bias": "60 ug/sqrt(Hz)"}), "measures m/s.2/sqrt.Hz., and bias from run to run"),
        (lambda: sheet({"in_run_bias": "0.2 mg"}), "gyro in_run_bias = '0.2 mg' measures m/s.2"),
        (lambda: sheet({"turn_on_bias": "-3 deg/s"}), "cannot be read: a positive number with its unit"),
        (lambda: sheet({"turn_on_bias": "0 deg/s"}), "is not positive: leave out"),
        (lambda: sheet({"turn_on_bias": "nan deg/s"}), "cannot be read"),
        (lambda: sheet({"turn_on_bias": 3.0}), "has no unit"),
        (lambda: sheet({"turn_on_bias": "3"}), "has no unit"),
        (lambda: sheet({"turn_on_bias": "3 deg/year"}), "gyro turn_on_bias = '3 deg/year': Unknown unit"),
        (lambda: sheet({"turn_on_bias": "3 deg/s, about"}), "a number is 1 sigma, typ, .* and not 'about'"),
        (lambda: sheet({"turn_on_bias": "3 deg/s, one-sided"}), "only a density of white noise"),
        (lambda: sheet({"ARW": "0.1 deg/sqrt(h)"}), "gyro has no entry 'ARW'; it has N, B"),
        (lambda: sheet(accel={"g_sensitivity": "1 deg/h/g"}), "accel has no entry 'g_sensitivity'"),
        (lambda: sheet({"turn_on_bias": ("1 deg/h", "2 deg/h")}), "one text or three"),
        (lambda: sheet({"B": "1 deg/h", "in_run_bias": "1 deg/h"}), "state the same, in_run_bias = 0.664 B"),
        (lambda: sheet({"f0": "1 Hz"}), "and there is none"),
        (lambda: sheet({"LSB": "1 arcsec"}), 'this IMU reads rates: state LSB in rad/s .* reads="increments"'),
        (lambda: sheet(reads="counts"), "reads is one of rates, increments"),
        (lambda: sheet(rate="100 deg/s"), "is no frequency"),
        (lambda: sheet(sigmas={"about": 2.0}), "sigmas: a number is"),
        (lambda: sheet(sigmas={"max": 0.0}), "sigmas: max must be positive"),
        (lambda: sheet().truth(), "leaves the rate open"),
        (lambda: sheet().truth(100.0, effects=["LSB"]), "leaves the gyro's LSB open"),
        (lambda: sheet().truth(100.0, effects=["noise"]), "'noise' is none of range, LSB, bandwidth"),
        (lambda: sheet().truth(100.0, temperature_sd=-1.0), "temperature_sd must be non-negative"),
        (lambda: sheet({"B": "1 deg/h"}).truth(100.0, longest=0.05), "longest = 0.05 s is too short"),
        (lambda: sheet({"B": "1 deg/h"}).filter(100.0, correlation_time=0.0), "correlation_time must be positive"),
        (lambda: ImuSpecification({}, N[1], name="X").truth(100.0), "X leaves the gyro's N open"),
        (
            lambda: sheet({"bandwidth": "60 Hz"}, {"bandwidth": "70 Hz"}).truth(100.0, effects=["bandwidth"]),
            "a bandwidth of 60 Hz and more has no effect in samples of 100 Hz",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_devices_from_a_phone_to_an_airliner():
    """Twelve or more, each with its source, over three decades of noise."""
    assert len(nj.devices) >= 12
    noise = [d.value("gyro", "N")[0] for d in nj.devices.values()]
    assert max(noise) > 500 * min(noise)
    for name, device in nj.devices.items():
        assert device.name == name
        assert len(device.source) > 20
        assert name in repr(nj.devices)
    with pytest.raises(KeyError, match=r"There is no datasheet of 'MPU'; there are MPU-6000"):
        nj.devices["MPU"]


def test_every_entry_of_every_device_is_plausible():
    """In SI between what a phone and what an airliner has: a slip of a unit is a factor of 60 or more."""
    limits = {
        ("gyro", "N"): (3e-7, 1e-3), ("accel", "N"): (1e-4, 6e-3),
        ("gyro", "in_run_bias"): (1e-7, 2e-4), ("accel", "in_run_bias"): (2e-5, 4e-3),
        ("gyro", "turn_on_bias"): (1e-8, 0.4), ("accel", "turn_on_bias"): (2e-4, 0.8),
        ("gyro", "range"): (2.0, 40.0), ("accel", "range"): (19.0, 500.0),
        ("gyro", "scale_factor"): (4e-6, 0.05), ("accel", "scale_factor"): (5e-5, 0.05),
        ("gyro", "misalignment"): (5e-4, 0.03), ("accel", "misalignment"): (5e-4, 0.03),
        ("gyro", "bandwidth"): (100.0, 1000.0), ("accel", "bandwidth"): (100.0, 1000.0),
    }  # fmt: skip
    for name, device in nj.devices.items():
        for (sensor, entry), (least, most) in limits.items():
            value = device.value(sensor, entry)
            assert value is None or ((least < value) & (value < most)).all(), (name, sensor, entry)
        for sensor in ("gyro", "accel"):
            bit, largest = device.value(sensor, "LSB"), device.value(sensor, "range")
            if bit is not None and largest is not None and device.reads == "rates":
                assert (largest / bit > 2**12).all(), name
                assert (largest / bit < 2**16).all(), name


@pytest.mark.parametrize("name", list(nj.devices))
def test_truth_and_filter_of_a_device(name):
    device = nj.devices[name]
    for sensor in ("gyro", "accel"):
        if device.value(sensor, "N") is None:
            device = device.with_entries(**{sensor: {"N": "10 ug/sqrt(Hz)"}})
    stated = [e for e in ("range", "LSB") if all(device.value(s, e) is not None for s in ("gyro", "accel"))]
    truth = device.truth(100.0, effects=stated)
    believed = device.filter(100.0, effects=stated, correlation_time=100.0)
    bank = jax.device_get(believed.bank())
    assert (np.diag(bank.initial) > 0).all()
    assert (bank.white > 0).all()
    assert {s.channel for s in believed.states} <= {s.channel for s in truth.states}
