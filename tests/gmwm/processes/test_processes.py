"""Every process against its definition, in 80 digits: see `cases` for the table that all tests run over."""

import json
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gmwm.cases import (
    CASES,
    MP,
    closed_wavelet_variance,
    defined_wavelet_variance,
    exact,
    exact_autocovariance,
    haar_filter,
    row_of,
    rows,
    sample_covariance,
)
from helpers import CountTraces

from gmwm_jax._internal.checks import require_x64
from gmwm_jax.processes.arma import ARMA, MA, AbstractArma
from gmwm_jax.processes.band_flicker import FLK
from gmwm_jax.processes.base import Composite
from gmwm_jax.processes.drift import DR
from gmwm_jax.processes.flicker import BI
from gmwm_jax.processes.fractional import FGN
from gmwm_jax.processes.gauss_markov import AR1, GM
from gmwm_jax.processes.matern import MAT32, MAT52
from gmwm_jax.processes.parameter import Fixed
from gmwm_jax.processes.quantisation import QN
from gmwm_jax.processes.random_walk import RW
from gmwm_jax.processes.registry import PROCESSES
from gmwm_jax.processes.sinusoid import SIN
from gmwm_jax.processes.white_noise import WN

DYADIC = [2**j for j in range(1, 25)]
SUMMED = [2**j for j in range(1, 13)]
ODD_HALVES = [6, 10, 14, 250]
"""Spans 2n with odd n, where phi^n is negative for phi < 0."""
SPANS = DYADIC + ODD_HALVES


def seen_wavelet_variance(process, taus):
    """At some of `SPANS`: those of all are asked for, so that one program serves all tests of a class."""
    return np.asarray(process.wavelet_variance(SPANS))[[SPANS.index(tau) for tau in taus]]


def relative_error(values, references):
    """Of float64 values against 80 digits, without rounding the references first."""
    return max(float(abs(MP.mpf(float(v)) / r - 1)) for v, r in zip(np.asarray(values), references, strict=True))


def test_every_process_has_a_row():
    one_class_each = {c.cls.kind: c.cls for c in CASES if not issubclass(c.cls, AbstractArma)}
    assert one_class_each == PROCESSES
    assert {"AR(2)", "MA(1)", "ARMA(2,1)"} == {c.cls.kind for c in CASES} - set(PROCESSES)


# -- wavelet variance ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", rows())
def test_textbook_formula_is_the_sum_over_lags(case):
    """The formula that serves for long spans, held against the definition."""
    for values in case.parameters:
        taus = [2, 6, 8, 250, 512]
        defined, closed = defined_wavelet_variance(case, values, taus), closed_wavelet_variance(case, values, taus)
        assert max(abs(a / b - 1) for a, b in zip(defined, closed, strict=True)) < 1e-39, values


@pytest.mark.slow
@pytest.mark.parametrize("case", rows())
def test_wavelet_variance_is_the_sum_over_lags(case):
    for values in case.parameters:
        taus = SUMMED + ODD_HALVES
        seen = seen_wavelet_variance(case.cls(*values), taus)
        assert relative_error(seen, defined_wavelet_variance(case, values, taus)) < case.rtol, values


@pytest.mark.parametrize("case", rows())
def test_wavelet_variance_up_to_two_to_the_24(case):
    """The bar is 1e-10; the formulas keep 14 digits from beta = 1e-12 to 50."""
    for values in case.parameters:
        closed = closed_wavelet_variance(case, values, DYADIC)
        assert relative_error(seen_wavelet_variance(case.cls(*values), DYADIC), closed) < case.rtol, values


@pytest.mark.parametrize("phi", [-0.999999, -0.9, -0.5, -0.1])
@pytest.mark.parametrize("tau", [2, 6, 10, 14, 1022])
def test_alternating_ar1_at_odd_half_spans(phi, tau):
    """R's package wv has the wrong sign of phi^n there (its issue 11)."""
    expected = defined_wavelet_variance(row_of("AR1"), (phi, 1.0), [tau])
    assert relative_error(AR1(phi, 1.0).wavelet_variance([tau]), expected) < 1e-13


@pytest.mark.slow
def test_reference_wavelet_variances(shared):
    """R's wv 0.1.3 (shared/reference/README.md); where its AR1 formula cancels, the 50-digit values beside it."""
    reference = json.loads((shared / "reference" / "gmwm_theoretical_wv.json").read_text())
    compared = set()
    for row in reference["models"]:
        kind, given = row["model"], row["par"]
        match kind:
            case "MA1":
                process = MA(1)(given["theta"], given["sigma2"])
            case "ARMA11":
                process = ARMA(1, 1)(given["phi"], given["theta"], given["sigma2"])
            case "ARMA":
                process = ARMA(len(given["ar"]), len(given["ma"]))(*given["ar"], *given["ma"], given["sigma2"])
            case "GM":
                process = GM(given["beta"] / given["freq"], given["sigma2_gm"])
            case "DR":
                process = DR(abs(given["omega"]))  # the sign is not seen in a variance
            case _:
                process = PROCESSES[kind](**given)
        expected = [float(v) for v in row.get("exact_wv_mp50", row["wv"])]
        # printed with 15 digits; those of GM come from a phi rounded to 15 digits, of which 1 - phi keeps 11 to 15
        np.testing.assert_allclose(
            process.wavelet_variance(row.get("scales", reference["scales"])),
            expected,
            rtol={"GM": 1e-10, "ARMA11": 1e-12}.get(kind, 1e-13),
            err_msg=f"{kind} {given}",
        )
        compared.add(kind)
    assert compared == {"WN", "QN", "RW", "DR", "GM", "AR1", "MA1", "ARMA11", "ARMA"}


def test_new_parameter_values_do_not_retrace():
    """Values are arrays in the pytree: a loop over parameters compiles once."""
    function = CountTraces(lambda model, tau: model.wavelet_variance(tau))
    jitted = jax.jit(function)
    tau = jnp.asarray([2.0, 4.0, 8.0])
    for k in range(1, 5):
        jitted(WN(1.0 * k) + RW(0.1 * k) + GM(0.1 * k, 2) + GM(0.01 * k, 3.0), tau)
    assert function.count == 1


# -- spectrum and autocovariance -------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", [c for c in rows() if c.values[0].psd])
def test_psd_is_its_definition(case):
    """|transfer function|^2 times the variance of the innovations, at frequencies from 1e-9 to 1/2."""
    frequency = [1e-9, 1e-6, 1e-3, 0.01, 0.1, 0.25, 0.4, 0.5]
    for values in case.parameters:
        expected = [case.psd(*exact(values), MP.mpf(f)) for f in frequency]
        seen = np.asarray(case.cls(*values).psd(frequency))
        some = np.array([e > 0 for e in expected])
        assert relative_error(seen[some], [e for e in expected if e > 0]) < 1e-9, values
        np.testing.assert_array_equal(seen[~some], 0.0)


def midpoints(num):
    """Midpoint rule on (0, 1/2): exact for trigonometric polynomials, and never at f = 0."""
    return (np.arange(num) + 0.5) / (2 * num)


def short_memory(case):
    """Parameter sets for which the midpoint rule is exact."""
    return [v for v in case.parameters if case.short_memory(*v)]


@pytest.mark.parametrize("case", rows(stationary=True, ergodic=True))
def test_psd_integrates_to_the_variance(case):
    f = midpoints(2**18)
    for values in short_memory(case):
        process = case.cls(*values)
        variance = float(exact_autocovariance(case, values, 1)[0])
        np.testing.assert_allclose(np.mean(process.psd(f)), variance, rtol=1e-9, err_msg=str(values))
        np.testing.assert_allclose(process.autocovariance([0])[0], variance, rtol=1e-9)


def test_haar_transfer_function():
    """|H_j(f)|^2 = 4 sin^4(pi f n)/(tau^2 sin^2(pi f)), against the filter itself."""
    f = np.linspace(0.001, 0.5, 20)
    for tau in (2, 4, 6, 64):
        response = np.exp(-2j * np.pi * np.outer(f, np.arange(tau))) @ haar_filter(tau) / tau
        np.testing.assert_allclose(haar_gain(tau, f), np.abs(response) ** 2, atol=1e-13)


def haar_gain(tau, f):
    return 4 * np.sin(np.pi * f * tau / 2) ** 4 / (tau * np.sin(np.pi * f)) ** 2


@pytest.mark.parametrize("case", [c for c in rows() if c.values[0].psd])
def test_psd_through_the_haar_filter_is_the_wavelet_variance(case):
    f = midpoints(2**18)
    taus = [2, 4, 6, 64, 4096]
    gains = [haar_gain(tau, f) for tau in taus]
    for values in short_memory(case):
        process = case.cls(*values)
        spectrum = np.asarray(process.psd(f))
        np.testing.assert_allclose(
            [np.mean(g * spectrum) for g in gains],
            seen_wavelet_variance(process, taus),
            rtol=1e-8,
            err_msg=str(values),
        )


@pytest.mark.parametrize(
    "process",
    [FGN(0.01, 1.3), FGN(0.3, 1.3), FGN(0.8, 1.3), FGN(0.99, 1.3), BI(0.2), FLK(0.125, 0.2), FLK(2.5, 0.2)],
    ids=repr,
)
def test_long_memory_psd_through_the_haar_filter(process):
    """The same for a spectrum with a pole: by a Gauss rule in each octave of frequencies."""
    x, w = np.polynomial.legendre.leggauss(64)
    octaves = 0.5 ** np.arange(2, 300)[:, None]
    f, weight = octaves * (1.5 + 0.5 * x), octaves * w  # f = 1/2 down to 0; both signs of f
    spectrum = np.asarray(process.psd(f.ravel())).reshape(f.shape)
    taus = [2, 4, 6, 32]
    seen = [np.sum(weight * spectrum * haar_gain(tau, f)) for tau in taus]
    np.testing.assert_allclose(seen, process.wavelet_variance(taus), rtol=1e-11)
    if isinstance(process, FGN):
        # what lies below the last octave, 2^-300, is 1.6 % of the variance for H = 0.99
        missed = 2 * float(process.psd(octaves[-1])[0]) * octaves[-1, 0] / (2 - 2 * float(process.values[0]))
        np.testing.assert_allclose(np.sum(weight * spectrum) + missed, 1.3, rtol=1e-10)


@pytest.mark.parametrize("case", rows(stationary=True))
def test_autocovariance_is_its_definition(case):
    for values in case.parameters:
        seen = np.asarray(case.cls(*values).autocovariance(np.arange(200)))
        expected = np.array([float(g) for g in exact_autocovariance(case, values, 200)])
        np.testing.assert_allclose(seen, expected, rtol=1e-12, atol=1e-300, err_msg=str(values))
        np.testing.assert_array_equal(case.cls(*values).autocovariance([-3, -1]), seen[[3, 1]])


@pytest.mark.parametrize("case", rows(stationary=False))
def test_no_autocovariance_where_not_stationary(case):
    process = case.cls(*case.parameters[0])
    with pytest.raises(ValueError, match=f"{case.cls.kind} is not stationary"):
        process.autocovariance([0, 1])
    with pytest.raises(ValueError, match="not stationary"):
        (WN(1.0) + process).autocovariance([0, 1])


def test_drift_has_no_psd():
    with pytest.raises(ValueError, match="DR is deterministic"):
        DR(1.0).psd([0.1])


def test_sinusoid_has_no_psd():
    with pytest.raises(ValueError, match="SIN is a line in the spectrum"):
        SIN(0.1, 1.0).psd([0.1])


MOST_LAGS = 161


@jax.jit
def _haar_covariance(process, *where):
    return process.amplitude * process.unit_haar_covariance(process.shape, *where)


def haar_covariance(process, lag, n_j, n_k):
    """Of coefficients of spans 2 n_j and 2 n_k; as many lags every time, so that a class has one program."""
    lag, n_j, n_k = np.broadcast_arrays(np.asarray(lag, dtype=float), n_j, n_k)
    where = (np.resize(a, MOST_LAGS).astype(float) for a in (lag, 1.0 - 2.0 * (lag % 2), n_j, n_k))
    return np.asarray(_haar_covariance(process, *where))[: len(lag)]


@pytest.mark.parametrize("case", rows())
def test_haar_covariance_at_lag_zero_is_the_wavelet_variance(case):
    """The formula behind wv_covariance and the one behind fits: the same number for j = k, h = 0."""
    taus = np.array([2.0**j for j in range(1, 21)])
    n = taus / 2
    for values in case.parameters:
        p = case.cls(*values)
        mean = np.asarray(p.unit_haar_mean(jnp.asarray(n)))
        second_moment = haar_covariance(p, np.zeros(20), n, n) + p.amplitude * mean**2
        expected = seen_wavelet_variance(p, taus)
        np.testing.assert_allclose(second_moment, expected, rtol=1e-10, err_msg=str(values))


@pytest.mark.slow
@pytest.mark.parametrize("case", rows())
def test_haar_cross_covariance_is_the_double_sum(case):
    """Cov(W_{j,t+h}, W_{k,t}) = sum_ab h_a h_b Cov(x_{t+h-a}, x_{t-b}), filters overlapping, touching and apart."""
    num, t = 200, 115
    lags = np.arange(-80, 81)
    for values in case.parameters:
        p = case.cls(*values)
        covariance = sample_covariance(case, values, num, less_variance=True)
        for tau_j, tau_k in [(2, 2), (8, 2), (2, 8), (16, 8), (32, 32), (2, 64)]:
            with_one = covariance[:, t - np.arange(tau_k)] @ haar_filter(tau_k)
            expected = np.convolve(with_one, haar_filter(tau_j))[t + lags] / (tau_j * tau_k)
            seen = haar_covariance(p, lags, tau_j / 2, tau_k / 2)
            scale = np.sqrt(np.prod(seen_wavelet_variance(p, [tau_j, tau_k])))
            # an alternating process leaves rounding of the size of its variance in the double sum
            atol = 1e-11 * scale + 1e-15 * np.max(np.abs(covariance))
            np.testing.assert_allclose(seen, expected, rtol=1e-9, atol=atol, err_msg=f"{values} {tau_j} {tau_k}")


# -- GM and AR1 are one process --------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("beta", [1e-6, 1e-3, 0.3, 20.0])
def test_gm_is_ar1(beta, key):
    """GM(beta, variance) = AR1(exp(-beta), variance (1 - phi^2)) in everything; 1 - phi keeps 1e-16/beta of beta."""
    rtol = 1e-15 / beta + 1e-13
    gm, ar1 = GM(beta, 0.7), AR1(np.exp(-beta), -0.7 * np.expm1(-2 * beta))
    f, tau, lag = [1e-6, 0.01, 0.5], [2.0**j for j in range(1, 21)], np.arange(50.0)
    np.testing.assert_allclose(gm.wavelet_variance(tau), ar1.wavelet_variance(tau), rtol=rtol)
    np.testing.assert_allclose(gm.psd(f), ar1.psd(f), rtol=2 * rtol)
    np.testing.assert_allclose(gm.autocovariance(lag), ar1.autocovariance(lag), rtol=2 * rtol)
    np.testing.assert_allclose(gm.simulate(1000, key), ar1.simulate(1000, key), rtol=0, atol=1000 * rtol)
    np.testing.assert_allclose(gm.correlation_time(gm.shape), ar1.correlation_time(ar1.shape), rtol=rtol)
    covariance = [haar_covariance(p, [0, 1, -3, 9], [1, 2, 4, 4], 1) for p in (gm, ar1)]
    np.testing.assert_allclose(*covariance, rtol=100 * rtol)


# -- parameters ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", rows())
def test_unconstrained_round_trip(case):
    for values in case.parameters:
        process = case.cls(*values)
        vector = process.unconstrained()
        assert vector.shape == (len(values),)
        again = case.cls.from_unconstrained(vector)
        np.testing.assert_allclose(again.values, values, rtol=1e-13, atol=1e-14, err_msg=str(values))
        # any point of the real line is a valid process
        for x in (-20.0, 0.0, 20.0):
            case.cls.from_unconstrained(jnp.full(len(values), x))


def test_unconstrained_is_the_log_or_the_logit():
    np.testing.assert_allclose(GM(0.1, 3.0).unconstrained(), np.log([0.1, 3.0]), rtol=1e-14)
    np.testing.assert_allclose(AR1(0.5, 3.0).unconstrained(), np.log([1.5 / 0.5, 3.0]), rtol=1e-14)


@pytest.mark.parametrize("case", rows())
def test_each_line_decides_what_it_names(case):
    for values in case.parameters[:2]:
        process = case.cls(*values)
        vector = process.unconstrained()
        before = process.per_line()
        assert len(before) == len(vector)
        for i, name in enumerate(before):
            after = case.cls.from_unconstrained(vector.at[i].add(0.1)).per_line()
            assert after.pop(name) > before[name]
            rest = {k: v for k, v in before.items() if k != name}
            np.testing.assert_allclose([*after.values()], [*rest.values()], rtol=1e-6, atol=1e-9)


def test_composite_unconstrained_follows_the_components():
    model = WN(2.0) + GM(0.1, 3.0) + GM(0.01, 4.0)
    vector = model.unconstrained()
    np.testing.assert_allclose(vector, np.log([2.0, 0.1, 3.0, 0.01, 4.0]), rtol=1e-14)
    moved = model.with_unconstrained(vector + np.log(2.0))
    assert repr(moved) == "WN(sigma2=4) + GM(beta=0.2, variance=6) + GM(beta=0.02, variance=8)"


@pytest.mark.parametrize("case", rows())
def test_parameters_outside_are_refused(case):
    """With the name of the process and of the parameter, its interval and what was seen."""
    names = [p.name for p in case.cls.parameters]
    kind = re.escape(case.cls.kind)
    for values in case.outside:
        with pytest.raises(ValueError, match=rf"{kind}: ({'|'.join(names)}) must be one number in .*, and is"):
            case.cls(*values)


@pytest.mark.parametrize("case", rows())
def test_arrays_of_parameters_are_refused(case):
    """Many models are a vmap over one."""
    values = [np.full(3, v) for v in case.parameters[0]]
    with pytest.raises(ValueError, match="must be one number"):
        case.cls(*values)


@pytest.mark.parametrize("case", rows())
def test_amplitude_may_be_zero_and_nothing_else(case):
    values = case.parameters[0]
    process = case.cls(*values[:-1], 0.0)
    np.testing.assert_array_equal(process.wavelet_variance(SPANS), 0.0)
    assert float(case.cls.value_of(process.amplitude)) == 0.0


@pytest.mark.parametrize("case", rows())
def test_amplitude_scales_the_wavelet_variance(case):
    """What the estimator relies on: linear in the amplitude, `value_of` inverts `amplitude_of`."""
    values = case.parameters[-1]
    process = case.cls(*values)
    np.testing.assert_allclose(case.cls.value_of(process.amplitude), values[-1], rtol=1e-14)
    doubled = case.cls(*values[:-1], case.cls.value_of(2 * process.amplitude))
    np.testing.assert_allclose(doubled.wavelet_variance(SPANS), 2 * process.wavelet_variance(SPANS), rtol=1e-13)


@pytest.mark.parametrize("case", rows())
def test_incomplete_process_says_what_is_missing(case, key):
    process, kind, name = case.cls(), re.escape(case.cls.kind), case.cls.parameters[0].name
    for use in (
        lambda: process.wavelet_variance([2]),
        lambda: process.autocovariance([0]),
        lambda: process.psd([0.1]),
        lambda: process.simulate(10, key),
        lambda: process.unconstrained(),
        lambda: (process + (GM() if case.cls is RW else RW())).wavelet_variance([2]),
    ):
        with pytest.raises(ValueError, match=rf"{kind} has no value for {name}.*{kind}\({name}=\.\.\.\)"):
            use()


@pytest.mark.parametrize("case", rows())
def test_fix_and_fixed(case):
    values = case.parameters[0]
    names = tuple(p.name for p in case.cls.parameters)
    free = case.cls(*values)
    assert free.fixed == ()
    assert free.fix().fixed == names
    assert free.fix(names[-1]).fixed == (names[-1],)
    assert free.fix(names[0]).fix(names[-1]).fixed == tuple(dict.fromkeys((names[0], names[-1])))
    assert case.cls(*map(Fixed, values)).fixed == names
    np.testing.assert_array_equal(free.fix().values, free.values)
    model = Composite((free.fix(names[0]),))
    assert (model.num_parameters, model.num_free) == (len(names), len(names) - 1)
    with pytest.raises(ValueError, match=f"no parameter 'gamma'; it has {', '.join(names)}"):
        free.fix("gamma")
    with pytest.raises(ValueError, match=f"{names[0]} cannot be held, it has no value"):
        case.cls().fix(names[0])
    with pytest.raises(ValueError, match="must be one number"):
        case.cls(*map(Fixed, case.outside[0]))


def test_single_precision_is_refused():
    """The message names the flag and the environment variable."""
    with jax.enable_x64(False):
        for use in (require_x64, lambda: WN(1.0), lambda: GM(0.1)):
            with pytest.raises(RuntimeError, match=r'jax\.config\.update\("jax_enable_x64", True\)') as seen:
                use()
            assert "JAX_ENABLE_X64=1" in str(seen.value)


# -- sums ------------------------------------------------------------------------------------------------------------


def test_plus_adds_variances():
    parts = [WN(1.0), QN(0.5), RW(0.1), DR(0.01), GM(0.1, 2.0), GM(0.01, 3.0)]
    model = parts[0] + parts[1] + (parts[2] + parts[3]) + parts[4] + parts[5]
    assert model.labels == ("WN", "QN", "RW", "DR", "GM_1", "GM_2")
    assert model.num_parameters == model.num_free == 8
    tau = [2, 4, 64]
    np.testing.assert_allclose(
        model.wavelet_variance(tau), np.sum([p.wavelet_variance(tau) for p in parts], axis=0), rtol=1e-14
    )
    stationary = [WN(1.0), QN(0.5), AR1(-0.5, 2.0)]
    model = stationary[0] + stationary[1] + stationary[2]
    f, lag = [0.1, 0.4], np.arange(4)
    np.testing.assert_allclose(model.psd(f), np.sum([p.psd(f) for p in stationary], axis=0), rtol=1e-14)
    np.testing.assert_allclose(
        model.autocovariance(lag), np.sum([p.autocovariance(lag) for p in stationary], axis=0), rtol=1e-14
    )


def test_times_repeats():
    assert (3 * GM()).labels == ("GM_1", "GM_2", "GM_3")
    assert (WN() + 2 * AR1()).labels == ("WN", "AR1_1", "AR1_2")
    assert len((2 * (GM() + GM())).processes) == 4
    for count in (0, -1):
        with pytest.raises(ValueError, match="1, 2, 3"):
            count * GM()


@pytest.mark.parametrize("case", rows())
def test_only_what_can_be_told_apart_repeats(case):
    if case.cls.repeatable:
        assert (case.cls() + case.cls()).labels == (f"{case.cls.kind}_1", f"{case.cls.kind}_2")
    else:
        with pytest.raises(ValueError, match=rf"2 x {re.escape(case.cls.kind)}.*cannot be told apart"):
            case.cls() + case.cls()


def test_gm_and_ar1_do_not_mix():
    with pytest.raises(ValueError, match="one process in two parametrisations"):
        GM() + WN() + AR1()


def test_other_things_do_not_add():
    with pytest.raises(TypeError):
        WN() + 3
    with pytest.raises(ValueError, match="at least one process"):
        Composite(())


# -- the coordinate that estimation searches -------------------------------------------------------------------------


@pytest.mark.parametrize("cls", [GM, AR1, MAT32, MAT52, FGN, FLK])
def test_shape_coordinate(cls):
    """A bijection that is increasing in the correlation time or its inverse; the search starts between its bounds."""
    tau_max = 2.0**20
    low, high = cls.coordinate_bounds(tau_max)
    for z in np.linspace(low, high, 9)[1:-1]:
        shape = cls.shape_from_coordinate(jnp.asarray(z))
        cls(*shape, 1.0)
        # phi and H keep 1e-16/(1 - phi) of the coordinate
        slack = 1e-12 + (4e-16 / (1 - abs(float(shape[0]))) if cls in (AR1, FGN) else 0.0)
        np.testing.assert_allclose(cls.coordinate_from_shape(shape), z, rtol=slack, atol=slack)
    nodes = cls.start_nodes(tau_max, 12)
    assert len(nodes) == 12
    assert (nodes[0], nodes[-1]) == (low, high)
    assert np.all(np.diff(nodes) > 0)


@pytest.mark.parametrize("cls", [GM, AR1])
def test_nothing_is_lost_beyond_the_bounds(cls):
    """At the slow end of the search the wavelet variance is a random walk's to 1e-9, at the fast one white noise's."""
    tau = np.array([2.0**j for j in range(1, 21)])
    ends = [cls.shape_from_coordinate(jnp.asarray(z)) for z in cls.coordinate_bounds(tau[-1])]
    slow = max(ends, key=lambda shape: float(shape[0]) if cls is AR1 else -float(shape[0]))
    seen = np.asarray(cls.unit_wavelet_variance(slow, jnp.asarray(tau)))
    walk = np.asarray(RW(1.0).wavelet_variance(tau))
    np.testing.assert_allclose(seen / seen[-1], walk / walk[-1], rtol=1e-8)
    if cls is GM:
        fast = max(ends, key=lambda shape: float(shape[0]))
        np.testing.assert_allclose(GM.unit_wavelet_variance(fast, jnp.asarray(tau)), 1 / tau, rtol=1e-12)


@pytest.mark.parametrize("cls", [MAT32, MAT52, FGN, FLK])
def test_the_ends_of_the_search_are_the_limits(cls):
    """To 1e-7: a drift and white noise; flicker noise and quantisation noise."""
    tau = 2.0 ** np.arange(1, 21)
    seen = {}
    for z in cls.coordinate_bounds(tau[-1]):
        shape = cls.shape_from_coordinate(jnp.asarray(z))
        seen[cls.limit_of(shape, tau[-1])] = np.asarray(cls.unit_wavelet_variance(shape, jnp.asarray(tau)))
    limits = {"drift": DR(1.0), "white noise": WN(1.0), "flicker noise": BI(1.0), "quantisation noise": QN(1.0)}
    expected = {FGN: {"flicker noise", "quantisation noise"}, FLK: {"flicker noise", "drift"}}
    assert set(seen) == expected.get(cls, {"drift", "white noise"})
    for name, variance in seen.items():
        expected = np.asarray(limits[name].wavelet_variance(tau))
        np.testing.assert_allclose(variance / variance[-1], expected / expected[-1], rtol=1e-7)


@pytest.mark.parametrize(
    ("process", "limit"),
    [
        (GM(1e-9, 1.0), "random walk"),
        (GM(1e-3, 1.0), ""),
        (GM(7.0, 1.0), "white noise"),
        (AR1(1 - 1e-9, 1.0), "random walk"),
        (AR1(0.9, 1.0), ""),
        (MAT32(1e-8, 1.0), "drift"),
        (MAT32(1e-3, 1.0), ""),
        (MAT32(7.0, 1.0), ""),
        (MAT32(11.0, 1.0), "white noise"),
        (MAT52(1e-8, 1.0), "drift"),
        (MAT52(9.0, 1.0), ""),
        (MAT52(10.5, 1.0), "white noise"),
        (FGN(0.9999, 1.0), "flicker noise"),
        (FGN(0.99, 1.0), ""),
        (FGN(1e-4, 1.0), "quantisation noise"),
        (FGN(0.01, 1.0), ""),
        (FLK(1e-6, 1.0), "drift"),
        (FLK(1e-4, 1.0), ""),
        (FLK(0.5, 1.0), ""),
        (FLK(3.0, 1.0), "flicker noise"),
    ],
)
def test_limit_is_named_where_the_variance_agrees_to_one_per_cent(process, limit):
    tau = np.array([2.0**j for j in range(1, 17)])
    assert type(process).limit_of(process.shape, tau[-1]) == limit
    seen = np.asarray(process.wavelet_variance(tau))
    others = {"random walk": RW(1.0), "white noise": WN(1.0), "drift": DR(1.0), "flicker noise": BI(1.0)}
    for name, other in {**others, "quantisation noise": QN(1.0)}.items():
        ratio = np.asarray(other.wavelet_variance(tau)) / seen
        assert (np.ptp(ratio) < 0.01 * np.mean(ratio)) == (limit == name)
