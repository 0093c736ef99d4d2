"""From noise models to what a filter holds of them, at any rate; what is left out is said."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import gmwm_jax as gj
import nav_jax as nj
from gmwm_jax.processes import to_continuous

WHITE = gj.WN(1e-4)


def bank(accel, gyro=WHITE, **options):
    return nj.ImuErrors(accel, gyro, 100.0, **options).bank()


def same(a, b):
    """Do two banks hold the same numbers?"""
    for name in ("transition", "driving", "readout", "initial", "white"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert a.states == b.states


def test_all_ways_to_say_a_model():
    model = gj.WN(1e-4) + gj.AR1(0.99, 1e-8)
    expected = bank(model)
    for given in (
        "WN(sigma2=1e-4) + AR1(phi=0.99, sigma2=1e-8)",
        [model] * 3,
        (model, "WN(sigma2=1e-4) + AR1(phi=0.99, sigma2=1e-8)", model),
        {"z": model, "x": model, "y": model},
    ):
        same(bank(given), expected)
    same(bank(gj.WN(1e-4)), bank("WN(sigma2=1e-4)"))


def test_axes_go_to_their_channels():
    b = bank({"z": WHITE + gj.RW(3.0), "x": WHITE, "y": WHITE + gj.AR1(0.5, 2.0)}, [WHITE, WHITE, gj.RW(4.0)])
    assert [str(s) for s in b.states] == ["accel y AR1", "accel z RW", "gyro z RW"]
    np.testing.assert_allclose(np.diag(b.driving), [2.0, 3.0, 4.0])
    np.testing.assert_allclose(b.white, [1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 0.0])


def test_what_a_process_is_to_a_filter():
    rest = WHITE + gj.AR1(0.9, 2.0) + gj.RW(3.0) + gj.DR(0.1)
    b = bank([rest, WHITE, WHITE], accel_bias_sd=[0.0, 0.0, 0.5])
    assert len(b.states) == 5
    assert b.channels == (0, 0, 0, 0, 2)
    assert not b.diagonal
    np.testing.assert_allclose(b.transition[0, 0], 0.9)
    np.testing.assert_allclose(b.initial[0, 0], 2.0 / (1 - 0.81))
    np.testing.assert_allclose(b.driving[:2, :2], np.diag([2.0, 3.0]))
    # a drift: its value grows by its slope, of which the square is known
    x = np.array([0.0, 0.0, 1.0, 0.2, 0.0])
    drift = [i for i, s in enumerate(b.states) if s.label.startswith("DR")]
    slope = next(i for i in drift if "slope" in b.states[i].label)
    value = next(i for i in drift if i != slope)
    x = np.zeros(5)
    x[slope] = 0.2
    np.testing.assert_allclose((np.asarray(b.transition) @ x)[[value, slope]], [0.2, 0.2])
    np.testing.assert_allclose(b.initial[slope, slope], 0.01)
    # a turn-on bias stays
    assert str(b.states[-1]) == "accel z bias"
    np.testing.assert_allclose([b.transition[4, 4], b.driving[4, 4], b.initial[4, 4]], [1.0, 0.0, 0.25])


def test_starting_from_zero_the_first_sample_is_the_first_innovation():
    b = bank(WHITE + gj.AR1(0.9, 2.0), start="zero", accel_bias_sd=0.5)
    np.testing.assert_array_equal(np.diag(b.initial), [2.0, 0.25] * 3)


@pytest.mark.parametrize("complete", [False, True], ids=["filter", "truth"])
def test_variances_of_a_start_from_zero(complete):
    """Sample by sample those of the sums of innovations so far: of a filter's states and of the truth's alike."""
    models = [
        gj.AR1(0.9, 2.0),
        gj.RW(3.0),
        gj.ARMA(2, 1)(0.5, 0.2, 0.4, 1.5),
    ]
    b = nj.ImuErrors(models, WHITE + gj.QN(4.0), 100.0, start="zero").bank(complete=complete)
    response = [1.0, 0.9]  # of the ARMA: psi_0 = 1, psi_1 = phi_1 + theta_1, and from there by phi
    while len(response) < 20:
        response.append(0.5 * response[-1] + 0.2 * response[-2])
    P = np.asarray(b.initial)
    for k in range(20):
        seen = [float(h @ P @ h) for h in (np.where(np.equal(b.channels, c), b.readout, 0.0) for c in range(4))]
        powers = 0.81 ** np.arange(k + 1)
        expected = [2.0 * powers.sum(), 3.0 * (k + 1), 1.5 * np.sum(np.square(response[: k + 1]))]
        # quantisation noise has no start: what rounding there was before the first sample nobody knows
        np.testing.assert_allclose(seen, [*expected, 8.0 if complete else 0.0], rtol=1e-11)
        P = np.asarray(b.transition @ P @ b.transition.T + b.driving)


def test_components_of_zero_are_no_states():
    assert bank(WHITE + gj.AR1(0.9, 0.0)).states == ()
    np.testing.assert_array_equal(bank(gj.WN(0.0)).white[:3], 0.0)


@pytest.fixture(scope="module")
def fits():
    """Of three short records of white noise and a random walk."""
    rng = np.random.default_rng(4)
    data = rng.normal(size=(4000, 3)) * 1e-2 + np.cumsum(rng.normal(size=(4000, 3)) * 1e-4, axis=0)
    recording = gj.Recording(data, rate=50.0, channels=("accel_x", "accel_y", "accel_z"), units=("m/s^2",) * 3)
    return gj.fit(recording, "WN() + RW()")


def test_fits_bring_their_rate(fits):
    errors = nj.ImuErrors(fits, WHITE)
    assert errors.rate == 50.0
    white = [f.model.processes[0].values[0] for f in fits.values()]
    np.testing.assert_allclose(errors.bank().white[:3], white)
    one = nj.ImuErrors(fits[1], WHITE)
    np.testing.assert_allclose(one.bank().white[:3], [white[1]] * 3)
    with pytest.raises(ValueError, match="different rates"):
        nj.ImuErrors(fits, WHITE, 100.0)


@pytest.mark.parametrize("rate", [10.0, 123.4, 1000.0])
def test_another_rate_keeps_the_physics(rate):
    """Continuous-time densities are what they were, and come back."""
    errors = nj.ImuErrors(
        gj.WN(1e-4) + gj.AR1(0.99, 1e-8) + gj.RW(1e-10) + gj.DR(1e-7) + gj.QN(1e-9),
        gj.WN(1e-6),
        100.0,
        gyro_bias_sd=0.1,
    )
    other = errors.at_rate(rate)
    assert other.rate == rate
    for a, b in zip(errors.models, other.models, strict=True):
        for p, q in zip(a.processes, b.processes, strict=True):
            np.testing.assert_allclose(
                to_continuous(p.kind, p.values, 100.0), to_continuous(q.kind, q.values, rate), rtol=1e-9
            )
    np.testing.assert_array_equal(other.bias_sd, errors.bias_sd)
    back = other.at_rate(100.0)
    for a, b in zip(errors.models, back.models, strict=True):
        for p, q in zip(a.processes, b.processes, strict=True):
            np.testing.assert_allclose(p.values, q.values, rtol=1e-9)
    # white noise of a sample goes with the rate
    np.testing.assert_allclose(other.bank().white[0], 1e-4 * rate / 100, rtol=1e-11)


@pytest.mark.parametrize("process", [gj.AR1(0.0, 1e-8), gj.AR1(-0.5, 1e-8), gj.AR(2)(0.5, 0.2, 1e-8)], ids=repr)
def test_a_process_that_belongs_to_its_rate_has_no_other(process):
    with pytest.raises(ValueError, match="no continuous-time form"):
        nj.ImuErrors(WHITE + process, WHITE, 100.0).at_rate(50.0)


def test_states_of_processes_that_have_several():
    """In the order of their models, the process itself first; noise without a state is named."""
    errors = nj.ImuErrors([gj.MAT52(0.1, 2.0), gj.MAT32(0.1, 2.0), gj.BI(1e-4) + gj.FLK(0.1, 1e-4)], WHITE, 100.0)
    names = ["accel x MAT52", "accel x MAT52 driver 1", "accel x MAT52 driver 2", "accel y MAT32"]
    b = errors.bank()
    assert [str(s) for s in b.states] == [*names, "accel y MAT32 driver 1"]
    np.testing.assert_allclose(np.diag(b.initial)[[0, 3]], 2.0, rtol=1e-13)
    assert errors.notes() == tuple(
        f"{kind} of accel z has no state and is left out of the filter." for kind in ("BI", "FLK")
    )


def test_what_is_left_out_is_said():
    errors = nj.ImuErrors([WHITE + gj.QN(2e-6), WHITE, WHITE], WHITE, 100.0)
    (note,) = errors.notes()
    assert "accel x" in note
    assert "2e-05 m/s" in note
    assert errors.stateless(0) is not None
    assert errors.stateless(1) is None
    assert not nj.ImuErrors(WHITE, WHITE, 100.0).notes()
    # quantisation noise alone has neither state nor white part
    alone = nj.ImuErrors(gj.QN(1e-6), WHITE, 100.0).bank()
    assert alone.states == ()
    np.testing.assert_array_equal(alone.white[:3], 0.0)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: nj.ImuErrors(WHITE, WHITE), "rate of the models is missing"),
        (lambda: nj.ImuErrors(WHITE, WHITE, -1.0), "rate"),
        (lambda: nj.ImuErrors(gj.WN(-1.0), WHITE, 100.0), "sigma2"),
        (lambda: nj.ImuErrors(gj.AR1(1.0, 1.0), WHITE, 100.0), "phi"),
        (lambda: nj.ImuErrors(gj.AR1(-1.2, 1.0), WHITE, 100.0), "phi"),
        (lambda: nj.ImuErrors("WN()", WHITE, 100.0), "WN"),
        (lambda: nj.ImuErrors("XY(a=1)", WHITE, 100.0), "XY"),
        (lambda: nj.ImuErrors(3.0, WHITE, 100.0), "accel x: a noise model is wanted"),
        (lambda: nj.ImuErrors([WHITE] * 2, WHITE, 100.0), "three of them are wanted, and these are 2"),
        (lambda: nj.ImuErrors({"x": WHITE, "y": WHITE, "up": WHITE}, WHITE, 100.0), "keys x, y, z"),
        (lambda: nj.ImuErrors({"x": WHITE, "y": WHITE}, WHITE, 100.0), "keys x, y, z"),
        (lambda: nj.ImuErrors(WHITE, WHITE, 100.0, start="middle"), "start is"),
        (lambda: nj.ImuErrors(WHITE, WHITE, 100.0, accel_bias_sd=-1.0), "accel_bias_sd"),
        (lambda: nj.ImuErrors(WHITE, WHITE, 100.0, gyro_bias_sd=[1.0, 2.0]), "gyro_bias_sd is one number or three"),
        (lambda: nj.RecordedErrors(np.zeros((5, 3)), np.zeros((6, 3)), 100.0), "accel has 5 samples and gyro 6"),
        (lambda: nj.RecordedErrors(np.full((5, 3), np.nan), np.zeros((5, 3)), 100.0), "accel"),
        (lambda: nj.RecordedErrors(np.zeros((5, 2)), np.zeros((5, 2)), 100.0), "accel"),
    ],
)
def test_bad_models(build, message):
    with pytest.raises(ValueError, match=message):
        build()


def test_a_table_of_what_is_believed():
    text = repr(nj.ImuErrors(WHITE, [WHITE, gj.WN(2e-4), WHITE], 100.0, accel_bias_sd=0.1, start="zero"))
    assert "100 Hz, started from zero" in text
    assert "accel x, y, z" in text
    assert "gyro y" in text
    assert "turn-on bias" in text
    assert jnp.shape(nj.ImuErrors(WHITE, WHITE, 100.0).bias_sd) == (6,)


def test_no_bias_has_no_state_under_a_trace_either():
    """Nor have channels of the other sensor where one is traced, of which nobody knows whether it is zero."""

    def num_states(**options):
        sizes = []

        def build(sd, scale):
            given = {name: sd if value is None else value for name, value in options.items()}
            sizes.append(nj.ImuErrors(WHITE + gj.RW(1e-9), WHITE, 100.0, **given).bank().initial.shape[0])
            return scale

        jax.eval_shape(build, 0.1, 1.0)
        return sizes[0]

    assert num_states() == nj.ImuErrors(WHITE + gj.RW(1e-9), WHITE, 100.0).bank().initial.shape[0] == 3
    assert num_states(gyro_bias_sd=[0.0, 0.5, 0.0]) == 4
    assert num_states(accel_bias_sd=None) == 6
