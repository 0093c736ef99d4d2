"""A process of which one law is given: the others follow, to the accuracy that `OwnProcess` states.

Processes of the package serve as the second computation: each law of theirs alone, and what follows beside their own.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gmwm.alone import LAWS, TAU, alone, difference_of_covariances

import gmwm_jax as gj
import nav_jax as nj
from gmwm_jax.processes import OwnProcess, Parameter, StateSpace, register
from gmwm_jax.processes.registry import _REGISTERED

LAGS = np.unique(np.round(np.append(0, np.geomspace(1, 1e6, 100))))


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("beta", [1e-4, 0.01, 3.0])
def test_what_follows_from_one_law(law, beta):
    process = gj.GM(beta, 1.3)
    own = alone(gj.GM, law)(beta, 1.3)
    nu = np.asarray(process.wavelet_variance(TAU))
    rtol, floor = (1e-9, 0.0) if law == "unit_psd" else (1e-8, 1e-15 * 1.3)
    assert np.all(np.abs(np.asarray(own.wavelet_variance(TAU)) - nu) < rtol * nu + floor)
    np.testing.assert_allclose(own.autocovariance(LAGS), process.autocovariance(LAGS), atol=1e-9 * 1.3)
    f = np.geomspace(1e-6, 0.5, 100)
    psd = np.asarray(process.psd(f))
    atol = 1e-5 if law == "unit_wavelet_variance" else 1e-6
    np.testing.assert_allclose(own.psd(f), psd, rtol=1e-12, atol=atol * np.max(psd))
    assert difference_of_covariances(own, process) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("process", "law", "stationary"),
    [
        (gj.GM(0.05, 1.3), "unit_psd", True),
        (gj.GM(0.05, 1.3), "unit_wavelet_variance", True),
        (gj.GM(1e-5, 1.3), "unit_psd", True),  # remembers much longer than the record
        (gj.FGN(0.8, 1.0), "unit_autocovariance", True),
        (gj.RW(2.0), "unit_psd", False),
    ],
    ids=repr,
)
def test_draws_have_its_wavelet_variance(process, law, stationary):
    own = alone(type(process), law, stationary=stationary)(*process.values)
    keys = jax.random.split(jax.random.key(5), 1000)
    draws = jax.jit(jax.vmap(lambda key: own.simulate(256, key)))(keys)
    nu = np.asarray(jax.vmap(lambda x: gj.variance.haar_wavelet_variance(x, 6))(draws))
    error = np.std(nu, axis=0) / np.sqrt(len(keys))
    assert np.all(np.abs(np.mean(nu, axis=0) - np.asarray(process.wavelet_variance(TAU[:6]))) < 4 * error)
    if stationary:
        squares = np.asarray(draws)[:, 0] ** 2  # from the first sample on
        assert abs(np.mean(squares) - float(process.autocovariance([0])[0])) < 4 * np.std(squares) / np.sqrt(len(keys))


@pytest.mark.slow
def test_what_cannot_be_drawn_says_so():
    says_that_it_is_stationary = alone(gj.RW, "unit_psd")(1.0)
    smooth_and_slow = alone(gj.MAT32, "unit_psd")(1e-4, 1.0)
    for own in (says_that_it_is_stationary, smooth_and_slow):
        with pytest.raises(RuntimeError, match="stationary = False"):
            jax.block_until_ready(gj.simulate(own, 512, key=jax.random.key(0)))


@pytest.fixture(scope="module")
def recording():
    x = gj.simulate(gj.WN(1.0) + gj.GM(0.003, 0.5), 50_000, key=jax.random.key(3))
    return gj.Recording(np.asarray(x)[:, None], rate=100.0, channels=("gyro_x",), units=("rad/s",))


@pytest.fixture(scope="module")
def inside(recording):
    return gj.fit(recording, "WN + GM")


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_a_fit_and_its_intervals_are_those_of_the_process(recording, inside, law):
    fit = gj.fit(recording, gj.WN() + alone(gj.GM, law)())
    for ours, theirs in zip(fit.parameters().estimates, inside.parameters().estimates, strict=True):
        assert (ours.value, ours.ci_low, ours.ci_high) == pytest.approx(
            (theirs.value, theirs.ci_low, theirs.ci_high), rel=1e-6
        )


@pytest.mark.slow
def test_a_fit_without_rate_is_printed(recording):
    fit = gj.fit(gj.wavelet_variance(np.asarray(recording.data)[:, 0]), gj.WN() + alone(gj.GM, "unit_psd")())
    assert "Parameters per sample" in repr(fit)


def test_a_wavelet_variance_alone_is_no_covariance_where_nothing_is_stationary(recording):
    cls = alone(gj.BI, "unit_wavelet_variance", stationary=False)
    fit = gj.fit(recording, gj.WN() + cls())
    assert fit.wv_covariance is None
    assert all(not np.isfinite(e.ci_low) for e in fit.parameters().estimates)
    repr(fit)
    with pytest.raises(ValueError, match="does not determine a covariance: define unit_psd"):
        gj.variance.wv_covariance(cls(1.0), 1000)
    with pytest.raises(ValueError, match="no covariance to draw from"):
        gj.simulate(cls(1.0), 100, key=jax.random.key(0))
    for law in ("psd", "autocovariance"):
        with pytest.raises(ValueError, match="is not stationary"):
            getattr(cls(1.0), law)(np.ones(1))


# -- one with two shapes, a text form and states ----------------------------------------------------------------------


@register
class Bend(OwnProcess):
    """Flat up to fc, then a power of frequency; as the process of the notebooks, in its own name."""

    fc: jax.Array | None
    a: jax.Array | None
    c: jax.Array | None
    kind = "Bend"
    parameters = (
        Parameter("fc", "1/sample", "corner frequency"),
        Parameter("a", "1", "exponent", lower=0.5, upper=1.5),
        Parameter("c", "({u})^2", "PSD at 0"),
    )

    @classmethod
    def unit_psd(cls, shape, frequency):
        fc, a = shape
        return 1 / (1 + (frequency / fc) ** a)

    def state_space(self):
        """A mixture of Gauss-Markov spectra."""
        b, log_t = self.a / 2, jnp.linspace(-8.0, 10.0, 10)
        t, step = jnp.exp(log_t), log_t[1] - log_t[0]
        density = jnp.sin(jnp.pi * b) / jnp.pi / (t**b + 2 * jnp.cos(jnp.pi * b) + t**-b)
        beta = 2 * jnp.pi * self.fc * jnp.sqrt(t)
        phi, variance = jnp.exp(-beta), self.c * step * density * jnp.tanh(beta / 2)
        return StateSpace(
            jnp.diag(phi), jnp.diag((1 - phi**2) * variance), jnp.ones(10), jnp.diag(variance), jnp.zeros(())
        )


TRUTH = "WN(sigma2=1e-06) + Bend(fc=0.002, a=1.3, c=0.0001)"


@pytest.fixture(scope="module")
def bent():
    x = gj.simulate(TRUTH, 100_000, key=jax.random.key(7))
    return gj.Recording(np.asarray(x)[:, None], rate=100.0, channels=("gyro_x",), units=("rad/s",))


@pytest.fixture(scope="module")
def fitted(bent):
    return gj.fit(bent, "WN + BEND")


def test_it_has_a_text_form():
    assert repr(gj.parse_model(TRUTH)) == TRUTH
    assert gj.parse_model("WN + bend(a=1.2 fixed)").processes[1].fixed == ("a",)
    with pytest.raises(ValueError, match="Bend has no parameter 'b'"):
        gj.parse_model("bend(b=1)")


@pytest.mark.slow
def test_it_is_fitted_by_name(fitted):
    table = fitted.parameters()
    for name, true in (("fc", 0.002), ("a", 1.3), ("c", 1e-4)):
        e = table["Bend", name]
        spread = (e.ci_high - e.ci_low) / 2
        assert abs(e.value - true) < 2 * spread < true  # four standard errors
    assert "Bend has no continuous-time form" in repr(fitted)


@pytest.mark.slow
def test_a_selection_prefers_it(bent):
    ranked = gj.select(bent, ["WN + BEND", "WN + GM"], nested=False)
    assert ranked.recommended.fit.model.labels == ("WN", "Bend")


@pytest.mark.slow
def test_a_fit_of_it_is_saved_and_loaded(fitted, tmp_path, monkeypatch):
    path = tmp_path / "fit.json"
    fitted.save(path)
    assert repr(gj.load(path)) == repr(fitted)
    monkeypatch.delitem(_REGISTERED, "BEND")  # as for someone who has not run the code
    with pytest.raises(ValueError, match="import the code that registers it first"):
        gj.load(path)


@pytest.mark.slow
def test_its_states_are_near_its_spectrum_and_a_filter_runs_on_them():
    process = gj.parse_model(TRUTH).processes[1]
    form = process.state_space()
    f = np.geomspace(1e-6, 0.05, 20)
    phi, q = np.diag(form.transition), np.diag(form.driving)
    psd = np.sum(q / np.abs(1 - phi * np.exp(-2j * np.pi * f[:, None])) ** 2, axis=1)
    np.testing.assert_allclose(psd, process.psd(f), rtol=0.05)
    scenario = nj.Scenario(nj.motions.lemniscate(10.0, 20.0), [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    errors = nj.ImuErrors("WN(sigma2=1e-4)", [TRUTH, "WN(sigma2=1e-6)", "WN(sigma2=1e-6)"], 20.0)
    assert [s.label for s in errors.bank().states].count("Bend") == 1
    runs = nj.monte_carlo(scenario, errors, num_runs=4, key=jax.random.key(0))
    assert runs.num_good == 4


def test_without_states_a_filter_says_so():
    errors = nj.ImuErrors(alone(gj.GM, "unit_psd")(0.01, 1e-8), "WN(sigma2=1e-6)", 20.0)
    scenario = nj.Scenario(nj.motions.lemniscate(10.0, 20.0), [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    with pytest.raises(ValueError, match=r"GM_PSD of .* has no state-space form"):
        nj.analyse(scenario, errors)


# -- what a class must say --------------------------------------------------------------------------------------------


def test_a_class_without_a_law_is_refused():
    with pytest.raises(TypeError, match="must define one of unit_psd, unit_autocovariance, unit_wavelet_variance"):
        type("Nothing", (OwnProcess,), {"kind": "NOTHING", "parameters": Bend.parameters})
    with pytest.raises(TypeError, match="has no `parameters`"):
        type("Nameless", (OwnProcess,), {"kind": "NAMELESS", "unit_psd": Bend.unit_psd})


def test_wrong_values_are_refused():
    with pytest.raises(TypeError, match="has the parameters fc, a, c, and was given 4 values"):
        Bend(1, 2, 3, 4)
    with pytest.raises(TypeError, match="and was given b, once more or unknown"):
        Bend(b=1)
    with pytest.raises(ValueError, match=r"a must be one number in \(0.5, 1.5\)"):
        Bend(a=2.0)


@pytest.mark.parametrize(
    ("cls", "complaint"),
    [
        (type("Gm", (Bend,), {"kind": "gm"}), "There is a process GM already: give Gm another"),
        (type("Ar", (Bend,), {"kind": "AR"}), "There is a process AR already"),
        (type("Other", (Bend,), {"kind": "BEND"}), "There is a process BEND already"),
        (type("Spaced", (Bend,), {"kind": "MY P"}), "letters and digits"),
    ],
)
def test_names_that_texts_cannot_hold_are_refused(cls, complaint):
    with pytest.raises(ValueError, match=complaint):
        register(cls)


def test_only_processes_are_registered():
    with pytest.raises(TypeError, match=r"is no class of a process|parameter 'cls'"):
        register(Bend(0.1, 1.0, 1.0))
    assert register(Bend) is Bend  # as when a cell of a notebook runs again


def test_the_search_goes_by_units_and_bounds():
    low, high = np.array(Bend.coordinate_bounds(1000.0)).T
    np.testing.assert_allclose(np.exp(low), [1e-5, 0.501])
    np.testing.assert_allclose(np.exp(high), [np.pi, 1.499])
    nodes = np.array(Bend.start_nodes(1000.0, 50))
    assert np.all((nodes > low) & (nodes < high))
    shape = (jnp.array([0.1, 0.2]), jnp.array([1.0, 1.2]))
    np.testing.assert_allclose(Bend.shape_from_coordinate(Bend.coordinate_from_shape(shape)), shape)

    class Signed(Bend):
        parameters = (
            Parameter("fc", "sample", "time"),
            Parameter("a", "1", "any", lower=-1.0, upper=3.0),
            Bend.parameters[-1],
        )

    (first, last), (low, high) = Signed.coordinate_bounds(1000.0)
    np.testing.assert_allclose([np.exp(first), np.exp(last), low, high], [1 / np.pi, 1e5, -0.996, 2.996])
    assert float(Signed.correlation_time((7.0, 1.0))) == 7.0


@pytest.mark.slow
def test_an_estimate_at_the_end_of_the_search_is_marked():
    """A class that does not say what its process is there; where it was found inside, nothing is."""
    tau = 2.0 ** np.arange(1, 15)
    nu = np.asarray(gj.parse_model("WN(sigma2=1.0)").wavelet_variance(tau))
    wv = gj.variance.WaveletVariance.from_table(tau, nu, 0.9 * nu, 1.1 * nu)
    fit = gj.fit(wv, Bend(), throw=False)
    assert {label: note.value for label, note in fit.at_boundary.items()} == {"Bend": "at boundary: end of its range"}
    assert [e.note for e in fit.parameters()] == ["at boundary: end of its range"] * len(Bend.parameters)
    assert all(np.isfinite(e.value) for e in fit.parameters())
    assert [p.kind for p in fit.reduced.processes] == ["Bend"]
    inside = Bend.shape_from_coordinate(np.mean(np.reshape(Bend.coordinate_bounds(2.0**14), (-1, 2)), axis=1).squeeze())
    assert not Bend.limit_of(inside, 2.0**14)
