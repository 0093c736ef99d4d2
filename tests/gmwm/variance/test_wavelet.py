"""The empirical wavelet variance: both paths against a textbook loop, R's numbers and allantools."""

import inspect
import json

import allantools
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chi2

import gmwm_jax as gj
from gmwm_jax.variance import blocked as wavelet_host
from gmwm_jax.variance.blocked import host_wavelet_variance
from gmwm_jax.variance.haar import (
    check_num_levels,
    degrees_of_freedom,
    haar_dwt_variance,
    haar_wavelet_variance,
    interval_factors,
)


def textbook(x, J, *, decimated=False):
    """Half the difference of two neighbouring means, squared and averaged, in extended precision."""
    sums = np.concatenate([[0], np.cumsum(np.asarray(x, dtype=np.longdouble))])
    result = []
    for j in range(1, J + 1):
        tau, n = 2**j, 2 ** (j - 1)
        W = (sums[tau:] - 2 * sums[n:-n] + sums[:-tau]) / tau
        if decimated:
            # W of a block of tau samples without overlap, scaled to the variance of the MODWT
            W = W[::tau]
        result.append(np.mean(W**2))
    return np.array(result, dtype=float)


# around every edge of the blocks and slabs of the host path
LENGTHS = [4, 5, 7, 8, 9, 100, 1000, 1024, 2047, 2048, 2049, 32767, 32768, 32769, 33791, 33792, 65536, 100_003]


@pytest.mark.parametrize("num", LENGTHS)
def test_host_path_equals_the_textbook_loop(num):
    x = np.random.default_rng(num).normal(size=num) + 7.0
    J = num.bit_length() - 2
    np.testing.assert_allclose(host_wavelet_variance(x), textbook(x, J), rtol=1e-11)


@pytest.mark.parametrize("num", [4, 7, 100, 1024, 2049, 5000])
def test_jax_path_equals_the_textbook_loop(num):
    x = np.random.default_rng(num).normal(size=num) + 7.0
    J = num.bit_length() - 2
    np.testing.assert_allclose(jax.jit(haar_wavelet_variance)(x), textbook(x, J), rtol=1e-11)
    np.testing.assert_allclose(jax.jit(haar_dwt_variance)(x), textbook(x, J, decimated=True), rtol=1e-11)


@pytest.mark.parametrize(("fine", "block"), [(1, 64), (3, 64), (5, 128), (10, 4096)])
def test_result_does_not_depend_on_how_the_record_is_cut(monkeypatch, fine, block):
    x = np.cumsum(np.random.default_rng(0).normal(size=9_999))
    expected = host_wavelet_variance(x)
    monkeypatch.setattr(wavelet_host, "_FINE_LEVELS", fine)
    monkeypatch.setattr(wavelet_host, "_BLOCK", block)
    np.testing.assert_allclose(host_wavelet_variance(x), expected, rtol=1e-11)


def test_all_levels_down_to_a_single_coefficient():
    x = np.random.default_rng(1).normal(size=64)
    np.testing.assert_allclose(host_wavelet_variance(x, 6), textbook(x, 6), rtol=1e-11)
    x = np.random.default_rng(1).normal(size=2**16 + 5)
    np.testing.assert_allclose(host_wavelet_variance(x, 16), textbook(x, 16), rtol=1e-11)


def test_large_mean_and_trend_do_not_cost_digits():
    """A constant of 1e6 sigma and a drift leave the fine scales right to 1e-8: what the input's rounding allows."""
    rng = np.random.default_rng(3)
    x = rng.normal(size=20_000)
    shifted = x + 1e6
    np.testing.assert_allclose(host_wavelet_variance(shifted), textbook(shifted, 13), rtol=1e-9)
    trend = x + 1e-3 * np.arange(20_000)
    np.testing.assert_allclose(host_wavelet_variance(trend), textbook(trend, 13), rtol=1e-10)


def test_memory_map_and_blocks_equal_the_array(tmp_path):
    x = np.random.default_rng(2).normal(size=70_001) + 3
    whole = gj.wavelet_variance(x, rate=10.0)
    file = tmp_path / "x.npy"
    np.save(file, x)
    mapped = gj.wavelet_variance(np.load(file, mmap_mode="r"), rate=10.0, scratch=tmp_path)
    blocks = gj.wavelet_variance((x[i : i + 999] for i in range(0, x.size, 999)), rate=10.0, scratch=tmp_path)
    for chunked in (mapped, blocks):
        np.testing.assert_allclose(chunked.variance, whole.variance, rtol=1e-11)
        np.testing.assert_allclose(chunked.ci_high, whole.ci_high, rtol=1e-11)
        assert chunked.num_samples == whole.num_samples
    assert [p.name for p in tmp_path.iterdir()] == ["x.npy"], "scratch files are removed"


def test_integer_and_single_precision_records_are_computed_in_double():
    x = np.random.default_rng(4).integers(-1000, 1000, size=3000).astype(np.int16)
    np.testing.assert_allclose(gj.wavelet_variance(x).variance, textbook(x, 10), rtol=1e-11)
    y = x.astype(np.float32) / 7
    np.testing.assert_allclose(gj.wavelet_variance(y).variance, textbook(y, 10), rtol=1e-11)


def test_is_half_the_overlapping_allan_variance_of_allantools():
    x = np.random.default_rng(5).normal(size=30_000).cumsum()
    wv = gj.wavelet_variance(x, rate=100.0)
    taus, adev, _, _ = allantools.oadev(x, rate=100.0, data_type="freq", taus=wv.scales / 200.0)
    np.testing.assert_allclose(taus, wv.scales / 200.0)
    np.testing.assert_allclose(wv.variance, adev**2 / 2, rtol=1e-9)


def as_r_sums_it(x, J):
    """The pyramid in double precision, squares added one after the other (a cumulative sum), as a C loop does."""
    result = []
    for j in range(1, J + 1):
        n = 2 ** (j - 1)
        W, x = (x[n:] - x[:-n]) / 2, (x[n:] + x[:-n]) / 2
        result.append(np.cumsum(W * W)[-1] / W.size)
    return np.array(result)


@pytest.fixture(scope="module")
def adis(request):
    folder = request.getfixturevalue("shared")
    rec = gj.read_recording(folder / "data" / "adis_16405_imu1.rda", units="1")
    reference = json.loads((folder / "reference" / "gmwm_wvar.json").read_text())
    return rec, [reference[f"imu1.{i + 1}"]["modwt"] for i in range(6)]


@pytest.mark.slow
def test_real_recording_equals_r(adis):
    """Six channels of ADIS16405 unit 1 against wv::wvar (R 4.2.2, wv 0.1.3).

    The samples are quantised, so the rounding errors of R's plain summation do not average out: its accelerometer
    values are 1.2e-11 off the exact ones. Ours are compared with extended precision to 1e-13, R's way of summing is
    shown to give R's numbers to 1e-12, and both to differ by no more than that.
    """
    rec, reference = adis
    wv = gj.wavelet_variance(rec)
    for i, r in enumerate(reference):
        np.testing.assert_array_equal(wv.scales, r["scales"])
        x = rec.data[:, i]
        np.testing.assert_allclose(wv.variance[:, i], textbook(x - x.mean(), 18), rtol=1e-12)
        np.testing.assert_allclose(as_r_sums_it(x, 18), r["variance"], rtol=1e-11)
        np.testing.assert_allclose(wv.variance[:, i], r["variance"], rtol=1e-11 if i < 3 else 2e-11)


def test_intervals_of_the_real_recording_equal_r(adis):
    rec, reference = adis
    wv = gj.wavelet_variance(rec)
    for i, r in enumerate(reference):
        np.testing.assert_allclose(wv.ci_low[:, i], r["ci_low"], rtol=1e-10)
        np.testing.assert_allclose(wv.ci_high[:, i], r["ci_high"], rtol=1e-10)


def test_interval_is_chi_square():
    eta = degrees_of_freedom(1000, 8)
    np.testing.assert_allclose(eta, np.maximum((1000 - 2.0 ** np.arange(1, 9) + 1) / 2.0 ** np.arange(1, 9), 1))
    for level in (0.5, 0.95, 0.999):
        low, high = interval_factors(eta, level)
        np.testing.assert_allclose(low, eta / chi2.ppf((1 + level) / 2, eta), rtol=1e-11)
        np.testing.assert_allclose(high, eta / chi2.ppf((1 - level) / 2, eta), rtol=1e-11)


@pytest.mark.slow
def test_jax_path_maps_compiles_once_and_differentiates(key):
    x = jax.random.normal(key, (5, 300), dtype=jnp.float64)
    f = jax.jit(jax.vmap(eqx.debug.assert_max_traces(haar_wavelet_variance, max_traces=1)))
    np.testing.assert_allclose(f(x)[2], jax.jit(haar_wavelet_variance)(x[2]), rtol=1e-12)
    f(x + 1)
    # the variance is a quadratic form: its gradient along x itself is twice the value
    value, slope = jax.jit(lambda x: jax.jvp(haar_wavelet_variance, (x,), (x,)))(x[0])
    np.testing.assert_allclose(slope, 2 * value, rtol=1e-11)
    gradient = jax.jit(jax.jacrev(haar_wavelet_variance))(x[0])
    np.testing.assert_allclose(gradient @ x[0], 2 * value, rtol=1e-11)


@pytest.mark.parametrize(
    ("record", "message"),
    [
        (np.zeros(0), "not empty"),
        (np.ones(1), "at least 4 samples"),
        (np.ones(100), "does not change"),
        (np.array([1.0, 2.0, np.nan, 3.0, 1.0]), r"NaN or infinite.*index 2"),
        (np.array([1.0, 2.0, 5.0, 3.0, np.inf]), r"NaN or infinite.*index 4"),
        (np.ma.masked_array([1.0, 2.0, 5.0, 3.0, 1.0], mask=[0, 0, 0, 1, 0]), r"NaN or infinite.*index 3"),
        (np.ma.masked_array([1, 2, 5, 3, 1], mask=[0, 1, 0, 0, 0]), r"NaN or infinite.*index 1"),
        (iter([np.ma.masked_array([1.0, 2.0, 5.0, 3.0], mask=[0, 0, 1, 0])]), r"NaN or infinite.*index 2"),
        (np.random.default_rng(0).normal(size=(3, 100)), "3 samples of 100 channels.*transpose"),
        ([np.arange(3.0), np.arange(4.0)], r"no array.*iter\(blocks\)"),
        ([[1.0, 2.0, 3.0], [4.0, 5.0, 7.0]], "2 samples of 3 channels"),
        (np.tile([1.0, -1.0], 50), "coarsely quantised.*"),
        (np.array(["a"] * 10), "real numbers"),
        (np.ones((3, 3, 3)), r"\(N,\) or \(N, C\)"),
        (iter([]), "no block"),
        (iter([np.ones((2, 2))]), "one-dimensional"),
    ],
)
def test_bad_records_name_their_fault(record, message):
    with pytest.raises(ValueError, match=message):
        gj.wavelet_variance(record)


@pytest.mark.parametrize("record", ["abc", b"abc", {"x": np.ones(5)}, {1.0, 2.0}, 5.0, None])
def test_what_is_no_record_is_named(record):
    with pytest.raises(TypeError, match=f"no {type(record).__name__}"):
        gj.wavelet_variance(record)


def test_lists_are_arrays():
    x = np.random.default_rng(3).normal(size=(40, 2))
    for record in (x[:, 0].tolist(), tuple(x[:, 0])):
        np.testing.assert_array_equal(gj.wavelet_variance(record).variance, gj.wavelet_variance(x[:, 0]).variance)
    np.testing.assert_array_equal(gj.wavelet_variance(x.tolist()).variance, gj.wavelet_variance(x).variance)


def test_an_array_without_masked_samples_is_like_any_other():
    x = np.random.default_rng(3).normal(size=40)
    np.testing.assert_array_equal(gj.wavelet_variance(np.ma.array(x)).variance, gj.wavelet_variance(x).variance)


def test_scales_that_vanish_by_quantisation_are_named():
    """Alternating +1, -1: every sum over two samples is zero."""
    x = np.tile([1.0, -1.0], 50)
    with pytest.raises(ValueError, match=r"x changes.*zero at spans of 4, 8, 16, 32 samples"):
        gj.wavelet_variance(x)
    assert gj.wavelet_variance(x, num_levels=1).variance == [1.0]


def test_which_wavelet_variances_have_a_theory():
    x = np.random.default_rng(3).normal(size=(40, 2))
    assert gj.wavelet_variance(x).has_theory
    assert not gj.wavelet_variance(x, method="dwt").has_theory
    assert gj.variance.WaveletVariance.from_table(**TABLE, num_samples=100).has_theory
    assert not gj.variance.WaveletVariance.from_table(**TABLE).has_theory
    assert not gj.variance.WaveletVariance.from_table(**{**TABLE, "scales": [4, 8, 16]}, num_samples=100).has_theory
    assert not gj.variance.WaveletVariance.from_table(**{**TABLE, "scales": [2, 4, 6]}, num_samples=100).has_theory


def test_infinity_far_into_a_long_record_is_named():
    x = np.random.default_rng(0).normal(size=100_000)
    x[77_777] = -np.inf
    with pytest.raises(ValueError, match="index 77777"):
        gj.wavelet_variance(x)


def test_bad_options_name_their_fault():
    x = np.random.default_rng(0).normal(size=100)
    with pytest.raises(ValueError, match="modwt"):
        gj.wavelet_variance(x, method="haar")
    with pytest.raises(ValueError, match=r"7 levels need 2\^7 samples"):
        gj.wavelet_variance(x, num_levels=7)
    for wrong in (0, -1):
        with pytest.raises(ValueError, match=f"num_levels must be an integer of 1 or more, and is {wrong!r}"):
            gj.wavelet_variance(x, num_levels=wrong)
    for wrong in (2.5, "3"):
        with pytest.raises(ValueError, match=f"num_levels must be an integer of 1 or more, and is {wrong!r}"):
            inspect.unwrap(check_num_levels)(100, wrong)
    for wrong in ("deg/s", "g", "rad", ""):
        with pytest.raises(ValueError, match=r"unit is one of rad/s, m/s\^2, 1.*Recording.from_array"):
            gj.wavelet_variance(x, unit=wrong)
    with pytest.raises(ValueError, match="positive number of Hz"):
        gj.wavelet_variance(x, rate=-1.0)
    with pytest.raises(ValueError, match="between 0 and 1"):
        gj.wavelet_variance(x, level=95.0)
    with pytest.raises(ValueError, match=r"rate=5.0 was given"):
        gj.wavelet_variance(gj.Recording.from_array(x, rate=1.0, units="1"), rate=5.0)


@pytest.mark.slow
def test_the_jax_path_takes_one_record():
    """Two channels would be summed into one; single precision would stay single."""
    x = np.random.default_rng(0).normal(size=(100, 2))
    for function in (gj.variance.haar_wavelet_variance, gj.variance.haar_dwt_variance):
        with pytest.raises(ValueError, match=r"shape \(N,\), and this one \(100, 2\): use jax.vmap"):
            function(x)
        assert function(jnp.asarray(x[:, 0], dtype=jnp.float32)).dtype == jnp.float64


def test_a_bad_sample_is_named_with_its_channel():
    x = np.random.default_rng(0).normal(size=(100, 3))
    x[7, 2] = np.nan
    for method in ("modwt", "dwt"):
        with pytest.raises(ValueError, match=r"channel_2 holds 1 values that are NaN .* at index 7"):
            gj.wavelet_variance(x, method=method)
    with pytest.raises(ValueError, match="x are beyond floating point"):
        gj.wavelet_variance(1e200 * x[:, 0])
    with pytest.raises(ValueError, match=r"Block 1 has the shape .* complex128"):
        gj.wavelet_variance(iter([x[:, 0], x[:, 0] * 1j]))


TABLE = {"scales": [2, 4, 8], "variance": [3.0, 2.0, 1.0], "ci_low": [2.0, 1.0, 0.5], "ci_high": [4.0, 3.0, 2.0]}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scales": [0.02, 0.04, 0.08]}, "multiplied by the sampling rate"),
        ({"scales": [2, 8, 4]}, "increasing"),
        ({"variance": [3.0, -2.0, 1.0]}, "variance must be positive"),
        ({"variance": [3.0, np.nan, 1.0]}, "finite"),
        ({"variance": [3.0, 2.0]}, "equally long"),
        ({"ci_high": [4.0, 1.5, 2.0]}, "scale 4 does not hold"),
        ({"ci_low": [2.0, 2.0, 0.5]}, "scale 4 does not hold"),
        ({"rate": 0.0}, "positive number of Hz"),
        ({"unit": "deg/s"}, r"rad/s, m/s\^2, 1, and is 'deg/s'"),
        ({"num_samples": 7}, "num_samples must be an integer of 8 or more, and is 7"),
        ({"level": 95.0}, "between 0 and 1, and is 95"),
    ],
)
def test_bad_tables_name_their_fault(change, message):
    with pytest.raises(ValueError, match=message):
        gj.variance.WaveletVariance.from_table(**{**TABLE, **change})


def test_object_knows_its_channels_and_prints_itself():
    x = np.random.default_rng(8).normal(size=(200, 2))
    rec = gj.Recording.from_array(x, rate=50.0, units=["deg/s", "g"], channels=["gyro_x", "accel_x"], name="bench")
    wv = gj.wavelet_variance(rec)
    assert wv.variance.shape == (6, 2)
    assert isinstance(wv, gj.variance.WaveletVariances)
    one = wv["accel_x"]
    np.testing.assert_array_equal(one.variance, wv.variance[:, 1])
    assert one.units == ("m/s^2",)
    np.testing.assert_allclose(one.variance, textbook(x[:, 1] * 9.80665, 6), rtol=1e-11)
    np.testing.assert_allclose(one.times, one.scales / 50)
    assert "accel_x [(m/s^2)^2]" in repr(wv)
    assert "95 % low" in repr(one)
    assert [name for name, _ in wv.items()] == ["gyro_x", "accel_x"]
    with pytest.raises(KeyError, match="gyro_x, accel_x"):
        wv["gyro_y"]
    assert isinstance(gj.wavelet_variance(rec["gyro_x"]), gj.variance.WaveletVariance)
