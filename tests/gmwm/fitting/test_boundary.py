"""Intervals at a boundary, against closed forms of two components and against fits again."""

import os
import subprocess
import sys

import jax
import numpy as np
import pytest
from programs import MEDIUM, as_channels, blank

import gmwm_jax as gj

Z = 1.959963984540054


def fit_of(truth, model, relative=0.0, num_samples=MEDIUM, **options):
    """A fit to the theory of a truth, times 1 + relative."""
    wv = blank(num_samples)
    nu = np.asarray(gj.parse_model(truth).wavelet_variance(wv.scales)) * (1 + relative)
    return gj.fit(as_channels(wv, nu[None])["0"], model, **options)


@pytest.fixture(scope="module")
def white():
    """White noise whose shortest scale is a little low, so that QN is zero beside it; two-step weights."""
    return fit_of("WN(sigma2=1)", "WN + QN", relative=-0.004 * (np.arange(13) == 0), weights="two-step")


@pytest.mark.slow
def test_a_component_at_zero_in_closed_form(white):
    """Two columns: the upper limit is z standard deviations of the signed estimate, under the limit itself.

    The variance of the wavelet variance there is that of the fit, scaled. The other amplitude falls along with it.
    """
    assert white.at_boundary == {"QN": "at boundary: zero"}
    tau, (w, V) = white.wv.scales, (np.diag(white.omega), white.wv_covariance)
    X = np.stack([1 / tau, 6 / tau**2], axis=1)
    B = np.linalg.solve(X.T @ (w[:, None] * X), X.T * w)
    sigma2 = float(white.model.processes[0].sigma2)

    def deviations(q2):
        """Of the signed amplitude of QN, where it is q2, and the amplitude of WN there."""
        other = (X[:, 0] * w) @ (sigma2 * X[:, 0] - q2 * X[:, 1]) / ((X[:, 0] * w) @ X[:, 0])
        ratio = (other * X[:, 0] + q2 * X[:, 1]) / (sigma2 * X[:, 0])
        return q2 / np.sqrt(B[1] @ (V * np.outer(ratio, ratio)) @ B[1]), other

    grid = np.linspace(0, 0.1, 100_001)
    limit = grid[np.argmax([deviations(q2)[0] > Z for q2 in grid])]
    e, beside = white.parameters()["QN", "q2"], white.parameters()["WN", "sigma2"]
    assert (e.value, e.ci_low) == (0, 0)
    # the end is found between two of 24 places that are 24 times closer than those of a coarse grid
    assert e.ci_high == pytest.approx(limit, rel=0.03)
    held = np.sqrt((X[:, 0] * w) @ V @ (X[:, 0] * w)) / ((X[:, 0] * w) @ X[:, 0]) / sigma2
    assert np.log(beside.ci_high / sigma2) == pytest.approx(Z * held, rel=1e-4)
    moved = np.log(deviations(limit)[1] / sigma2)
    assert np.log(beside.ci_low / sigma2) == pytest.approx(-np.hypot(Z * held, moved), rel=0.03)


def test_all_tables_have_the_same_limit(white):
    """In continuous time, as a datasheet has it, and as the white noise of a filter."""
    high = white.parameters()["QN", "q2"].ci_high
    assert white.continuous()["QN", "Q"].ci_high == pytest.approx(np.sqrt(high) / white.rate, rel=1e-9)
    assert white.datasheet()["QN", "Q"].ci_low == 0
    beside = white.parameters()["WN", "sigma2"]
    N = white.white_and_bias().table()["white", "N"]
    assert N.ci_low == pytest.approx(np.sqrt(beside.ci_low / white.rate), rel=1e-9)
    rows = {(r["component"], r["symbol"]): r for r in white.to_dict()["continuous"]}
    assert rows["QN", "Q"]["ci_low"] == 0
    # at another rate as well
    timeless = fit_of("WN(sigma2=1)", "WN + QN", relative=-0.004 * (np.arange(13) == 0), weights="two-step")
    assert timeless.parameters()["QN", "q2"].ci_high == pytest.approx(high, rel=1e-9)


def test_far_from_a_boundary_nothing_changes():
    fit = fit_of("WN(sigma2=1) + GM(beta=0.03, variance=0.2)", "WN + GM")
    assert fit.boundary() is None


def test_a_faint_amplitude_in_closed_form():
    """Beside all of the noise that it is not, its own noise: symmetric for asinh(b c/a)/b, cut at zero."""
    fit = fit_of("WN(sigma2=1) + RW(gamma2=1e-6)", "WN + RW", weights="two-step")
    s = np.sqrt(fit.covariance[1, 1])
    assert not fit.at_boundary
    assert 0.25 < s < 3
    tau, w, V = fit.wv.scales, np.diag(fit.omega), fit.wv_covariance
    X = np.stack([1 / tau, (tau**2 + 2) / (12 * tau)], axis=1)
    row = np.linalg.solve(X.T @ (w[:, None] * X), X.T * w)[1]
    gamma2 = float(fit.model.processes[1].gamma2)
    share = gamma2 * X[:, 1] / fit.fitted
    own = row @ (V * np.outer(share, share)) @ row
    a, b = np.sqrt(row @ V @ row - own), np.sqrt(own) / gamma2
    ends = [a / b * np.sinh(np.arcsinh(b * gamma2 / a) + sign * Z * b) for sign in (-1, 1)]
    e = fit.parameters()["RW", "gamma2"]
    assert e.ci_low == pytest.approx(max(ends[0], 0), rel=1e-6)
    assert e.ci_high == pytest.approx(max(ends[1], gamma2 * np.exp(min(Z * s, 1))), rel=1e-6)


@pytest.mark.slow
def test_a_random_walk_may_have_a_long_correlation_time():
    """The places that data leave a Gauss-Markov process: up to the one whose fit they would reject."""
    fit = fit_of("WN(sigma2=1) + RW(gamma2=1e-4)", "WN + GM", weights="two-step")
    assert fit.at_boundary == {"GM": "at boundary: random walk"}
    e = fit.parameters()["GM", "beta"]
    assert np.isnan(e.value)
    assert e.ci_low == 0
    assert 1 / MEDIUM < e.ci_high < 1e-2
    # fitted again with that correlation time held: its score, by the standard error of a free one
    wv = fit.wv
    again = gj.fit(as_channels(wv, fit.fitted[None])["0"], gj.WN() + gj.GM(beta=gj.Fixed(e.ci_high)), weights=fit.omega)
    free = gj.fit(as_channels(wv, again.fitted[None])["0"], "WN + GM", weights=fit.omega)
    _, B = free.derivatives
    row = B[list(free.active).index(1)]
    V = gj.variance.wv_covariance(again.model, MEDIUM, wv.num_scales)
    score = row @ (fit.fitted - again.fitted) / np.sqrt(row @ np.asarray(V) @ row)
    # the covariance is scaled, not computed again; the end lies between two of 24 places
    assert abs(score) == pytest.approx(Z, rel=0.1)
    q = fit.continuous()["GM", "q"]
    assert q.ci_low < q.value < q.ci_high
    assert q.ci_high > 2 * e.ci_high * again.model.processes[1].variance * fit.rate * 0.99


@pytest.mark.slow
def test_replicates_reach_as_far_as_theory(white):
    """Percentiles of refits, and no mirrored ones."""
    boot = gj.bootstrap(white, 1000, key=jax.random.key(0))
    e, theory = boot.parameters()["QN", "q2"], white.parameters()["QN", "q2"]
    assert e.ci_low == 0
    assert e.ci_high == pytest.approx(theory.ci_high, rel=0.15)
    assert boot.continuous()["QN", "Q"].ci_high == pytest.approx(np.sqrt(e.ci_high) / white.rate, rel=1e-9)
    for name in ("ci_low", "ci_high"):
        found, expected = (np.log(getattr(t.parameters()["WN", "sigma2"], name)) for t in (boot, white))
        assert found == pytest.approx(expected, abs=0.3 * abs(expected - np.log(white.model.processes[0].sigma2)))
    for kind in ("basic", "studentised"):
        with pytest.raises(ValueError, match=f"no {kind} intervals here .QN at boundary: zero."):
            boot.parameters(kind)


@pytest.mark.slow
def test_a_component_at_zero_with_shapes_to_choose():
    """A Gauss-Markov process too many: an upper limit for its variance, none for its correlation time."""
    truth = "WN(sigma2=1.0) + GM(beta=0.01, variance=0.1)"
    x = gj.simulate(truth, 2**14, key=jax.random.key(0))
    fit = gj.fit(gj.wavelet_variance(np.asarray(x), rate=1.0), "WN + 2*GM")
    assert fit.at_boundary == {"GM_2": "at boundary: zero"}
    table, alone = fit.parameters(), gj.fit(fit.wv, "WN + GM").parameters()
    assert table["GM_2", "variance"].ci_low == 0 < table["GM_2", "variance"].ci_high
    assert np.isnan(table["GM_2", "beta"].ci_high)
    for name, others in (("WN", "WN"), ("GM_1", "GM")):
        for e, known in zip(
            *([e for e in t if e.component == c] for t, c in ((table, name), (alone, others))), strict=True
        ):
            assert e.value == pytest.approx(known.value, rel=1e-4)
            assert e.ci_low <= known.ci_low * (1 + 1e-4)
            assert e.ci_high >= known.ci_high * (1 - 1e-4)


def test_draws_of_a_component_at_zero_reach_to_its_limit():
    """Of half a normal variable 95 % lie below the two-sided quantile of 95 %; white noise gives way."""
    fit = fit_of("WN(sigma2=1e-4)", "WN + RW", relative=-0.1 * (np.arange(13) > 8))
    assert fit.at_boundary == {"RW": "at boundary: zero"}
    near = fit.boundary()
    assert near is not None
    start = np.asarray(near.lifted.unconstrained())
    moved = start + near.moves(np.random.default_rng(0), 20_000)
    assert np.quantile(np.exp(moved[:, 1]), 0.95) == pytest.approx(fit.parameters()["RW", "gamma2"].ci_high, rel=0.03)
    assert start[0] == pytest.approx(np.log(fit.parameters()["WN", "sigma2"].value))
    assert np.all(moved[:, 0] <= start[0] + 1e-9)


_THREADS = """
import threading
import jax
import gmwm_jax as gj
from gmwm_jax.app.web.library import published

jax.config.update("jax_enable_x64", True)
wv = published("mti-g")["gyro_x"]

def limits():
    return [(e.ci_low, e.ci_high) for e in gj.fit(wv, "WN + RW + 3*GM", throw=False).parameters()]

def chosen():
    return str(gj.select(wv, "WN + RW + 2*GM"))

works = [limits, limits, chosen, chosen]
expected, found = [work() for work in works], [[] for _ in works]

def again(i):
    found[i] = [works[i]() for _ in range(6)]

threads = [threading.Thread(target=again, args=(i,), daemon=True) for i in range(4)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert found == [[answer] * 6 for answer in expected]
"""


@pytest.mark.slow
def test_two_threads_have_their_intervals():
    """On two cores XLA has two threads of its own; LAPACK of two batches at once takes both, and waits for a third."""
    environment = {name: value for name, value in os.environ.items() if name != "NPROC"}
    subprocess.run([sys.executable, "-c", _THREADS], env=environment, timeout=300, check=True)
