"""The Allan deviation, what is read off it, and slopes averaged along it."""

import allantools
import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.variance.allan import FLICKER_FLOOR

DEG = 180 / np.pi


def exact(model, rate, levels=20, num_samples=None, unit="rad/s"):
    """The Allan deviation that a model has in theory, as if it had been measured."""
    tau = 2.0 ** np.arange(1, levels + 1)
    nu = np.asarray(gj.parse_model(model).wavelet_variance(tau))
    table = gj.variance.WaveletVariance.from_table(
        tau, nu, 0.9 * nu, 1.1 * nu, rate=rate, num_samples=num_samples, unit=unit, name="gyro_x"
    )
    return gj.allan_deviation(table)


def test_equals_allantools():
    x = np.random.default_rng(1).normal(size=20_000)
    rec = gj.Recording.from_array(x, rate=50.0, units="rad/s")
    adev = gj.allan_deviation(rec)
    taus, expected, _, _ = allantools.oadev(x, rate=50.0, data_type="freq", taus=adev.times)
    np.testing.assert_allclose(adev.times, taus)
    np.testing.assert_allclose(adev.deviation, expected, rtol=1e-10)
    np.testing.assert_allclose(adev.ci_low, np.sqrt(2 * adev.wv.ci_low))


def test_coefficients_are_read_off_pure_processes():
    """IEEE 952: N is the -1/2 line at 1 s, K the +1/2 line at 3 s; B the flat bottom over 0.664."""
    rate, N, K = 100.0, 2e-4, 3e-6
    white = f"WN(sigma2={N**2 * rate})"
    walk = f"RW(gamma2={K**2 / rate})"
    table = gj.fitting.read_off(exact(f"{white} + {walk}", rate))
    assert table["Allan", "N"].value == pytest.approx(N, rel=2e-2, abs=0)
    assert table["Allan", "N"].unit == "rad/s/sqrt(Hz)"
    assert table["Allan", "K"].value == pytest.approx(K, rel=2e-2, abs=0)
    # the minimum of N^2/T + K^2 T/3, which is no flicker noise at all, at the sampled times
    adev = exact(f"{white} + {walk}", rate)
    lowest = np.sqrt(np.min(N**2 / adev.times + K**2 * adev.times / 3))
    assert table["Allan", "B"].value == pytest.approx(lowest / 0.6643, rel=1e-3, abs=0)
    assert pytest.approx(0.6643, abs=1e-4) == FLICKER_FLOOR


@pytest.mark.parametrize(
    ("unit", "N", "B", "K"),
    [
        (
            "rad/s",
            ("deg/sqrt(h)", 60 * 180 / np.pi),
            ("deg/h", 3600 * 180 / np.pi),
            ("deg/h/sqrt(h)", 3600 * 60 * 180 / np.pi),
        ),
        ("m/s^2", ("ug/sqrt(Hz)", 1e6 / 9.80665), ("ug", 1e6 / 9.80665), ("m/s/h/sqrt(h)", 3600 * 60.0)),
        ("1", ("1/sqrt(Hz)", 1.0), ("1", 1.0), ("1/sqrt(s)", 1.0)),
    ],
)
def test_coefficients_in_the_units_of_datasheets(unit, N, B, K):
    adev = exact("WN(sigma2=1e-4) + RW(gamma2=1e-10)", 100.0, num_samples=2**22, unit=unit)
    si, shown = gj.fitting.read_off(adev), gj.fitting.read_off(adev, datasheet=True)
    for a, b, (name, size) in zip(si, shown, (N, B, K), strict=True):
        assert b.unit == name
        assert (a.symbol, a.note) == (b.symbol, b.note)
        for end in ("value", "ci_low", "ci_high"):
            assert getattr(b, end) == pytest.approx(size * getattr(a, end), rel=1e-12, abs=0)


def test_what_is_not_there_is_not_read():
    table = gj.fitting.read_off(exact("WN(sigma2=1)", 1.0))
    assert np.isnan(table["Allan", "K"].value)
    assert "no slope of +0.5" in table["Allan", "K"].note
    assert "upper bound" in table["Allan", "B"].note
    assert table["Allan", "N"].value == pytest.approx(1.0, rel=1e-9, abs=0)


@pytest.mark.parametrize(
    ("kind", "model", "coefficient"),
    [
        ("WN", "WN(sigma2=4)", np.sqrt(4 / 10.0)),
        ("QN", "QN(q2=9)", np.sqrt(9.0) / 10),
        ("RW", "RW(gamma2=16)", np.sqrt(16 * 10.0)),
        ("DR", "DR(omega=0.5)", 0.5 * 10),
    ],
)
def test_slope_regression_is_exact_for_a_process_alone(kind, model, coefficient):
    adev = exact(model, 10.0)
    # a random walk is a straight line only at many samples: (tau^2 + 2)/tau
    shortest = 5.0 if kind == "RW" else 0.1
    result = gj.fitting.slope_regression(adev, {kind: (shortest, 1e9)})
    (estimate,) = result.table
    assert estimate.value == pytest.approx(coefficient, rel=1e-3 if kind == "RW" else 1e-12, abs=0)
    use = adev.times >= shortest
    np.testing.assert_allclose(result.implied_deviation[use], adev.deviation[use], rtol=2e-3)


def test_slope_regression_is_biased_where_processes_overlap():
    """The reason for the GMWM. AVAR = 1/T + K^2 (T + 1/(2T))/3: near the bottom each slope carries the other, too."""
    adev = exact("WN(sigma2=1) + RW(gamma2=1e-6)", 1.0)
    result = gj.fitting.slope_regression(adev, {"WN": (256.0, 2048.0), "RW": (1024.0, 8192.0)})
    T = 2.0 ** np.arange(8, 12)
    assert result.table["WN", "N"].value == pytest.approx(
        np.exp(np.mean(np.log(1 + 1e-6 * (T**2 + 0.5) / 3)) / 2), rel=1e-9
    )
    assert result.table["WN", "N"].value > 1.15
    assert result.table["RW", "K"].value > 1.15e-3
    fitted = gj.fit(adev.wv, "WN + RW").model
    assert float(fitted.processes[0].sigma2) == pytest.approx(1.0, rel=1e-9, abs=0)
    assert float(fitted.processes[1].gamma2) == pytest.approx(1e-6, rel=1e-9, abs=0)


def test_slope_regression_without_a_theory_has_no_intervals():
    """Leaving octaves out, or not knowing the record's length, leaves the estimate as it is."""
    tau = 4.0 ** np.arange(1, 8)
    for scales, num_samples in ((tau, 2**16), (2.0 ** np.arange(1, 8), None)):
        wv = gj.variance.WaveletVariance.from_table(
            scales, 1 / scales, 0.9 / scales, 1.1 / scales, rate=1.0, num_samples=num_samples
        )
        (estimate,) = gj.fitting.slope_regression(gj.allan_deviation(wv), {"WN": (0.0, 1e9)}).table
        assert estimate.value == pytest.approx(1.0, rel=1e-12, abs=0)
        assert np.isnan([estimate.ci_low, estimate.ci_high]).all()
        assert gj.fit(wv, "WN").wv_covariance is None


def test_errors_name_their_fault():
    with pytest.raises(TypeError):
        gj.allan_deviation(np.ones(100))
    x = np.random.default_rng(1).normal(size=(100, 2))
    with pytest.raises(ValueError, match="sampling rate is missing"):
        gj.allan_deviation(gj.wavelet_variance(x))
    adev = gj.allan_deviation(gj.wavelet_variance(x, rate=1.0))
    with pytest.raises(ValueError, match="Choose one channel"):
        gj.fitting.read_off(adev)
    with pytest.raises(ValueError, match="no straight line"):
        gj.fitting.slope_regression(adev[0], {"GM": (1.0, 2.0)})
    with pytest.raises(ValueError, match=r"no averaging time between 1000 and 2000 s; there are 1, 2, 4"):
        gj.fitting.slope_regression(adev[0], {"WN": (1000.0, 2000.0)})
    with pytest.raises(ValueError, match="at least 3 averaging times"):
        gj.fitting.read_off(gj.allan_deviation(gj.wavelet_variance(x[:10, 0], rate=1.0)))
    with pytest.raises(ValueError, match=r"rate=2.0 was given, and the data have 1.0 Hz"):
        gj.allan_deviation(adev.wv, rate=2.0)


def test_prints_as_a_table():
    text = repr(exact("WN(sigma2=1)", 2.0, levels=3))
    assert text.startswith("Overlapping Allan deviation at 2 Hz")
    assert "gyro_x [rad/s]" in text
    assert len(text.splitlines()) == 7
