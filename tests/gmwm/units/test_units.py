"""Units against numbers worked out apart, and the continuous-time forms against what they mean physically."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gmwm.cases import rows
from helpers import assert_mean

from gmwm_jax import units
from gmwm_jax._internal.checks import sampling_rate
from gmwm_jax._internal.columns import plain_name
from gmwm_jax.fitting.tables import continuous_table
from gmwm_jax.processes.continuous import from_continuous, to_continuous
from gmwm_jax.processes.continuous_form import derived_unit
from gmwm_jax.processes.gauss_markov import GM
from gmwm_jax.processes.quantisation import QN
from gmwm_jax.processes.random_walk import RW
from gmwm_jax.processes.registry import PROCESSES
from gmwm_jax.processes.white_noise import WN
from gmwm_jax.units import UNITS, convert, signal_unit, unit

DEG = 0.017453292519943295

PINNED = [
    # (unit, SI unit, value of one of it)
    ("deg/sqrt(h)", "rad/s/sqrt(Hz)", 2.9088820866572e-4),
    ("deg/h", "rad/s", 4.84813681109536e-6),
    ("deg/s", "rad/s", 1.7453292519943295e-2),
    ("deg/s/sqrt(Hz)", "rad/s/sqrt(Hz)", 1.7453292519943295e-2),
    ("deg/h/sqrt(Hz)", "rad/s/sqrt(Hz)", 4.84813681109536e-6),
    ("deg/h/sqrt(h)", "rad/s/sqrt(s)", 8.08022801849227e-8),  # pi/180/3600/60
    ("deg/s/sqrt(h)", "rad/s/sqrt(s)", 2.9088820866572e-4),
    ("deg/h/h", "rad/s^2", 1.34670466974871e-9),  # pi/180/3600^2
    ("arcsec", "rad", 4.84813681109536e-6),
    ("urad", "rad", 1e-6),
    ("mrad", "rad", 1e-3),
    ("arcmin", "rad", 2.9088820866572e-4),
    ("arcsec/sqrt(s)", "rad/s/sqrt(Hz)", 4.84813681109536e-6),
    ("ug/sqrt(Hz)", "m/s^2/sqrt(Hz)", 9.80665e-6),
    ("mg/sqrt(Hz)", "m/s^2/sqrt(Hz)", 9.80665e-3),
    ("m/s/sqrt(h)", "m/s^2/sqrt(Hz)", 1 / 60),
    ("m/s/h/sqrt(h)", "m/s^2/sqrt(s)", 1 / 216000),
    ("ug/sqrt(s)", "m/s^2/sqrt(s)", 9.80665e-6),
    ("g", "m/s^2", 9.80665),
    ("mg", "m/s^2", 9.80665e-3),
    ("ug", "m/s^2", 9.80665e-6),
    ("mGal", "m/s^2", 1e-5),
    ("ug/h", "m/s^3", 9.80665e-6 / 3600),
    ("m/s", "m/s", 1.0),
    ("km/h", "m/s", 1 / 3.6),
    ("mm/s", "m/s", 1e-3),
    ("min", "s", 60.0),
    ("h", "s", 3600.0),
    ("day", "s", 86400.0),
    ("1/h", "1/s", 1 / 3600),
    ("deg/min", "rad/s", DEG / 60),
    ("1", "1", 1.0),
    ("%", "1", 0.01),
    ("ppm", "1", 1e-6),
    ("ft/s/sqrt(h)", "m/s^2/sqrt(Hz)", 0.3048 / 60),
    ("deg/h/g", "rad/s/(m/s^2)", 4.94372370900905e-07),  # pi/180/3600/9.80665
    ("deg/s/degC", "rad/s/K", DEG),
    ("mg/K", "m/s^2/K", 9.80665e-3),
    ("ppm/K", "1/K", 1e-6),
    ("%/°C", "1/K", 0.01),
]

SPELLINGS = [
    ("µg/√Hz", "ug/sqrt(Hz)"),  # U+00B5, the micro sign
    ("μg/√Hz", "ug/sqrt(Hz)"),  # U+03BC, the Greek letter
    ("ug/rt(Hz)", "ug/sqrt(Hz)"),
    ("°/√h", "deg/sqrt(h)"),
    ("°/√hr", "deg/sqrt(h)"),
    ("deg/sqrt(hr)", "deg/sqrt(h)"),
    ("deg / sqrt(h)", "deg/sqrt(h)"),
    ("deg/hr", "deg/h"),
    ("°/h", "deg/h"),
    ("°/s", "deg/s"),
    ("dps", "deg/s"),
    ("dps/√Hz", "deg/s/sqrt(Hz)"),
    ("mdps/√Hz", "mdeg/s/sqrt(Hz)"),
    ("ug/rtHz", "ug/sqrt(Hz)"),
    ("°/s/√Hz", "deg/s/sqrt(Hz)"),
    ("deg/s/sqrtHz", "deg/s/sqrt(Hz)"),
    ("°/h/√Hz", "deg/h/sqrt(Hz)"),
    ("°/h/√h", "deg/h/sqrt(h)"),
    ("m/s/√h", "m/s/sqrt(h)"),
    ("m/s/sqrt(hr)", "m/s/sqrt(h)"),
    ("rad/s/√Hz", "rad/s/sqrt(Hz)"),
    ("m/s²", "m/s^2"),
    ("m/s**2", "m/s^2"),
    ("m/s/s", "m/s^2"),
    ("m/s²/√Hz", "m/s^2/sqrt(Hz)"),
    ("m/s/s/√Hz", "m/s^2/sqrt(Hz)"),
    ("°/s²", "deg/s^2"),
    ("µrad", "urad"),
    ("m/s2", "m/s^2"),
    ("mm/s2", "mm/s^2"),
    ("m/s3", "m/s^3"),
    ("rad/s2", "rad/s^2"),
    ("m/s2/√Hz", "m/s^2/sqrt(Hz)"),
    ("deg/sec", "deg/s"),
    ("rad/sec", "rad/s"),
    ("rad/sec2", "rad/s^2"),
    ("deg/hr2", "deg/h^2"),
    ("arcsec/sec", "arcsec/s"),
    ("deg/s/Hz^0.5", "deg/s/sqrt(Hz)"),
    ("deg/hr^0.5", "deg/sqrt(h)"),
    ("m/s/rt(h)", "m/s/sqrt(h)"),
    ("deg/rthr", "deg/sqrt(h)"),
]

RATES = [1.0, 100.0, 400.0]


# -- names and sizes -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "si", "size"), PINNED)
def test_pinned_sizes(name, si, size):
    assert unit(name).si == si
    assert convert(1.0, name, si) == pytest.approx(size, rel=1e-13, abs=0)
    assert convert(size, si, name) == pytest.approx(1.0, rel=1e-13, abs=0)


def test_every_unit_has_its_inverse():
    for name, u in UNITS.items():
        assert UNITS[u.si].factor == 1.0, f"{name}: {u.si} must be an SI unit of the table"
        assert UNITS[u.si].si == u.si
        for value in (1.0, 3.7e-9):
            assert convert(convert(value, name, u.si), u.si, name) == pytest.approx(value, rel=1e-15, abs=0)


def test_conversion_of_arrays_is_differentiable():
    one_deg_h = 4.84813681109536e-6
    np.testing.assert_allclose(convert(np.array([1.0, 2.0]), "deg/h", "rad/s"), [one_deg_h, 2 * one_deg_h], rtol=1e-14)
    assert float(jax.grad(lambda x: convert(x, "deg/s", "rad/s"))(1.0)) == pytest.approx(DEG, abs=0)


@pytest.mark.parametrize(("written", "meant"), SPELLINGS)
def test_spellings(written, meant):
    assert unit(written) == UNITS[meant]


@pytest.mark.parametrize("name", ["furlong", "", "deg/year", "Deg/h", "%/h", "sqrt(Hz)"])
def test_unknown_unit(name):
    with pytest.raises(ValueError, match=r"Unknown unit .* Known ones near it: ") as seen:
        unit(name)
    assert repr(name) in str(seen.value)


def test_unknown_unit_lists_those_of_the_same_quantity():
    with pytest.raises(ValueError, match=r"near it: deg, .*deg/h"):
        unit("deg/fortnight")


@pytest.mark.parametrize(
    ("source", "target"),
    [("deg/h", "deg/sqrt(h)"), ("ug", "deg/s"), ("deg/h/sqrt(h)", "deg/sqrt(h)"), ("m/s", "m/s^2"), ("rad", "rad/s")],
)
def test_units_of_different_quantities_do_not_convert(source, target):
    with pytest.raises(ValueError, match=r"measures .* and .* measures .* cannot be converted"):
        convert(1.0, source, target)


# -- units of records ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "si", "factor", "increments"),
    [
        ("rad/s", "rad/s", 1.0, False),
        ("deg/s", "rad/s", DEG, False),
        ("deg/h", "rad/s", DEG / 3600, False),
        ("m/s^2", "m/s^2", 1.0, False),
        ("g", "m/s^2", 9.80665, False),
        ("mg", "m/s^2", 9.80665e-3, False),
        ("1", "1", 1.0, False),
        ("rad", "rad/s", 1.0, True),
        ("arcsec", "rad/s", DEG / 3600, True),
        ("m/s", "m/s^2", 1.0, True),
        ("mm/s", "m/s^2", 1e-3, True),
    ],
)
def test_the_unit_tells_rates_from_increments(name, si, factor, increments):
    seen = signal_unit(name)
    assert (seen.si, seen.increments) == (si, increments)
    assert seen.factor == pytest.approx(factor, rel=1e-14, abs=0)


@pytest.mark.parametrize("name", ["deg/sqrt(h)", "s", "Hz", "ug/sqrt(Hz)", "deg/h/h"])
def test_no_sensor_signal(name):
    with pytest.raises(ValueError, match=r"no sensor signal.*Rates: rad/s.*Increments per sample: rad"):
        signal_unit(name)


@pytest.mark.parametrize(
    ("signal", "suffix", "expected"),
    [
        ("rad/s", "/sqrt(Hz)", "rad/s/sqrt(Hz)"),
        ("rad/s", "*s", "rad"),
        ("m/s^2", "*s", "m/s"),
        ("m/s^2", "/s", "m/s^3"),
        ("rad/s", "/s", "rad/s^2"),
        ("rad/s", "^2/Hz", "(rad/s)^2/Hz"),
        ("V", "/sqrt(s)", "V/sqrt(s)"),
        ("V", "*s", "V*s"),
    ],
)
def test_derived_units(signal, suffix, expected):
    assert derived_unit(signal, suffix) == expected


@pytest.mark.parametrize("kind", PROCESSES)
@pytest.mark.parametrize("signal", ["rad/s", "m/s^2"])
def test_datasheet_units_measure_the_quantity(kind, signal):
    """Every unit a quantity is shown in converts from its SI unit, and there is at least one for each sensor."""
    for quantity in PROCESSES[kind].continuous.datasheet:
        assert quantity.gyro if signal == "rad/s" else quantity.accel, f"{kind} {quantity.symbol}: no datasheet unit"
        for name in quantity.datasheet_units(signal):
            convert(1.0, quantity.si_unit(signal), name)
        assert quantity.datasheet_units("V") == (quantity.si_unit("V"),)


# -- continuous time -------------------------------------------------------------------------------------------------


def test_every_process_has_a_continuous_form():
    for cls in PROCESSES.values():
        assert len(cls.continuous.filter) == len(cls.parameters)


def sensible(case):
    """AR1 has a continuous-time form for phi > 0 only; near 0 its logarithm costs digits."""
    if case.cls.kind == "AR1":
        return [v for v in case.parameters if v[0] > 0.1]
    return case.parameters


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("case", [row for row in rows() if row.id in PROCESSES])
def test_continuous_form_round_trip(case, rate):
    for values in sensible(case):
        quantities = to_continuous(case.cls.kind, tuple(map(jnp.asarray, values)), rate)
        again = from_continuous(case.cls.kind, quantities, rate)
        np.testing.assert_allclose(again, values, rtol=1e-12, err_msg=str(values))


def test_arma_belongs_to_its_sampling_rate():
    """Its coefficients have no continuous form; its variance, and its density at long times, are physical."""
    for use in (to_continuous, from_continuous):
        with pytest.raises(ValueError, match=r"ARMA\(2,1\) has no continuous-time form: .* sampling rate"):
            use("ARMA(2,1)", (0.5, 0.2, 0.3, 1.0), 100.0)
    # theta(1)^2/phi(1)^2 sigma2, and by hand for an MA(1)
    q = continuous_table("ARMA(2,1)(phi1=0.5, phi2=0.2, theta1=0.3, sigma2=2)", 100.0, "1")["ARMA(2,1)", "q_0"]
    assert q.value == pytest.approx(2 * (1.3 / 0.3) ** 2 / 100, rel=1e-14)
    table = continuous_table("MA(1)(theta1=0.5, sigma2=4)", 100.0, "1", datasheet=True)
    assert table["MA(1)", "sigma"].value == pytest.approx(np.sqrt(5), rel=1e-14)
    assert table["MA(1)", "N_0"].value == pytest.approx(0.3, rel=1e-14)


@pytest.mark.parametrize("rate", RATES)
def test_continuous_forms_by_hand(rate):
    """The table of shared/design.md."""
    one = jnp.asarray(4.0)
    assert float(to_continuous("WN", (one,), rate)[0]) == pytest.approx(4 / rate, abs=0)
    assert float(to_continuous("QN", (one,), rate)[0]) == pytest.approx(2 / rate, abs=0)
    assert float(to_continuous("RW", (one,), rate)[0]) == pytest.approx(4 * rate, abs=0)
    assert float(to_continuous("DR", (one,), rate)[0]) == pytest.approx(4 * rate, abs=0)
    beta, q = to_continuous("GM", (jnp.asarray(0.01), one), rate)
    assert (float(beta), float(q)) == pytest.approx((0.01 * rate, 2 * 0.01 * rate * 4), abs=0)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("beta", [1e-6, 1.688923e-3, 0.5])
def test_ar1_has_the_continuous_form_of_its_gm(beta, rate):
    """q = 2 beta_c sigma2/(1 - exp(-2 beta_c/f)) with sigma2 the variance of the innovations: exact discretisation."""
    variance = 1.190042e-7
    phi, sigma2 = np.exp(-beta), -variance * np.expm1(-2 * beta)
    gm = to_continuous("GM", (jnp.asarray(beta), jnp.asarray(variance)), rate)
    ar1 = to_continuous("AR1", (jnp.asarray(phi), jnp.asarray(sigma2)), rate)
    np.testing.assert_allclose(ar1, gm, rtol=1e-15 / beta + 1e-13)
    beta_c = beta * rate
    assert float(gm[1]) == pytest.approx(2 * beta_c * sigma2 / -np.expm1(-2 * beta_c / rate), rel=1e-12, abs=0)


@pytest.mark.parametrize("rate", RATES)
def test_gm_driving_noise_keeps_the_variance(rate):
    """dP/dt = -2 beta_c P + q is at rest at P = q/(2 beta_c), the variance of the process."""
    variance = jnp.asarray(0.3)
    beta_c, q = to_continuous("GM", (jnp.asarray(0.01), variance), rate)
    assert float(q / (2 * beta_c)) == pytest.approx(0.3, rel=1e-14, abs=0)


@pytest.mark.parametrize("rate", RATES)
def test_the_platforms_driving_noise_is_too_large(rate):
    """The online platform shows variance * f: 1/(2 beta) times too large, 296-fold for beta = 1.69e-3 per sample."""
    beta, variance = jnp.asarray(1.688923e-3), jnp.asarray(1.190042e-7)
    q = to_continuous("GM", (beta, variance), rate)[1]
    assert float(variance * rate / q) == pytest.approx(296.05, rel=1e-4, abs=0)


@pytest.mark.parametrize("rate", [1.0, 100.0])
def test_continuous_gm_integrated_in_fine_steps_is_the_sampled_gm(rate):
    """Variance and lag-one autocovariance of dx = -beta_c x dt + sqrt(q) dW, integrated in 2000 steps a sample."""
    beta, variance = 0.2, 3.0
    beta_c, q = map(float, to_continuous("GM", (jnp.asarray(beta), jnp.asarray(variance)), rate))
    dt = 1 / rate / 2000
    P, C = variance, variance
    for _ in range(2000):
        P += dt * (q - 2 * beta_c * P) + dt**2 * beta_c**2 * P
        C -= dt * beta_c * C
    assert pytest.approx(P, rel=1e-3, abs=0) == variance
    assert pytest.approx(float(GM(beta, variance).autocovariance([1])[0]), rel=1e-3, abs=0) == C


def test_random_walk_grows_as_its_density_says(key):
    """After T seconds the variance of the walk is q T."""
    rate, seconds, gamma2 = 50.0, 4.0, 0.7
    q = float(to_continuous("RW", (jnp.asarray(gamma2),), rate)[0])
    model = RW(gamma2)
    walks = jax.vmap(lambda k: model.simulate(int(rate * seconds), k)[-1])(jax.random.split(key, 4000))
    assert_mean(walks**2, q * seconds)


def test_integrated_white_noise_grows_as_its_density_says(key):
    """The angle after T seconds has the variance q T: angle random walk N = sqrt(q) in u/sqrt(Hz) = u sqrt(s)."""
    rate, seconds, sigma2 = 50.0, 4.0, 0.7
    q = float(to_continuous("WN", (jnp.asarray(sigma2),), rate)[0])
    model = WN(sigma2)
    angles = jax.vmap(lambda k: jnp.sum(model.simulate(int(rate * seconds), k)) / rate)(jax.random.split(key, 4000))
    assert_mean(angles**2, q * seconds)


@pytest.mark.parametrize("rate", RATES)
def test_quantisation_of_an_integrated_signal(rate):
    """An angle read in steps of LSB, differenced to a rate, carries QN with Q = LSB/sqrt(12) (IEEE 952, C.1.1)."""
    lsb = 0.02
    q2 = jnp.asarray((lsb * rate) ** 2 / 12)
    Q, LSB = (float(quantity.value(q2, rate)) for quantity in QN.continuous.datasheet)
    assert pytest.approx(lsb, rel=1e-14, abs=0) == LSB
    assert pytest.approx(lsb / np.sqrt(12), rel=1e-14, abs=0) == Q
    assert float(to_continuous("QN", (q2,), rate)[0]) == Q
    # a signal that wanders over many steps between samples, as rounding assumes
    rng = np.random.default_rng(1)
    angle = np.cumsum(rng.normal(0.0, 1.0, (400, 1001)), axis=1)
    error = (np.round(angle / lsb) * lsb - angle)[:, 1:] - (np.round(angle / lsb) * lsb - angle)[:, :-1]
    error *= rate
    assert_mean(np.mean(error**2, axis=1), 2 * float(q2))
    assert_mean(np.mean(error[:, 1:] * error[:, :-1], axis=1), -float(q2))


@pytest.mark.parametrize("kind", ["WN", "RW", "GM"])
def test_datasheet_densities_are_roots(kind):
    parameters = {"WN": (0.3,), "RW": (0.3,), "GM": (0.01, 0.3)}[kind]
    parameters = tuple(map(jnp.asarray, parameters))
    q = to_continuous(kind, parameters, 100.0)[-1]
    shown = {s.symbol: s.value(*parameters, 100.0) for s in PROCESSES[kind].continuous.datasheet}
    assert float(shown[{"WN": "N", "RW": "K", "GM": "sqrt(q)"}[kind]]) == pytest.approx(
        float(jnp.sqrt(q)), rel=1e-14, abs=0
    )
    if kind == "GM":
        assert (float(shown["sigma"]), float(shown["tau_c"])) == pytest.approx((np.sqrt(0.3), 1.0), abs=0)


def test_an_alternating_ar1_has_no_continuous_form():
    """Its quantities are NaN, which results print as a dash."""
    assert np.all(np.isnan(to_continuous("AR1", (jnp.asarray(-0.5), jnp.asarray(1.0)), 100.0)))


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf])
def test_the_rate_is_never_guessed(rate):
    with pytest.raises(ValueError, match=r"missing: give rate=\.\.\. in Hz"):
        sampling_rate(None)
    with pytest.raises(ValueError, match="sampling rate"):
        to_continuous("WN", (jnp.asarray(1.0),), rate)
    with pytest.raises(ValueError, match="sampling rate"):
        from_continuous("WN", (jnp.asarray(1.0),), rate)


@pytest.mark.parametrize("kind", ["WN", "QN", "RW", "DR", "GM", "AR1"])
def test_continuous_forms_are_differentiable(kind):
    """What the delta method needs: finite derivatives, the inverse of those of the way back."""
    parameters = jnp.asarray({"GM": (1e-6, 0.3), "AR1": (0.999, 0.3)}.get(kind, (0.3,)))

    def there(p):
        return jnp.stack(to_continuous(kind, tuple(p), 100.0))

    def back(q):
        return jnp.stack(from_continuous(kind, tuple(q), 100.0))

    product = jax.jacfwd(back)(there(parameters)) @ jax.jacrev(there)(parameters)
    np.testing.assert_allclose(product, np.eye(len(parameters)), atol=1e-8)


@pytest.mark.parametrize("beta", [1e-4, 0.1, 2.0, 20.0])
def test_a_gauss_markov_process_is_white_noise_of_density_n_0_at_long_spans(beta):
    """tau nu^2(tau) / f tends to the PSD at 0, from the autocovariance: variance (1 + 2 sum phi^h) / f."""
    rate, variance = 50.0, 3e-4
    (n_0,) = (q for q in GM.continuous.datasheet if q.symbol == "N_0")
    phi = np.exp(-beta)
    total = variance * (1 + 2 * phi / (1 - phi))
    assert float(n_0.value(beta, variance, rate)) ** 2 == pytest.approx(total / rate, rel=1e-12, abs=0)
    tau = 2.0**30 if beta < 1 else 2.0**24
    nu = float(GM(beta, variance).wavelet_variance(np.array([tau]))[0])
    assert tau * nu == pytest.approx(total, rel=1e-4, abs=0)


@pytest.mark.parametrize("kind", list(PROCESSES))
def test_quantities_read_the_parameters_they_say(kind):
    """`reads` against autodiff: it decides which quantities a held parameter holds."""
    form = PROCESSES[kind].continuous
    parameters = tuple(jnp.asarray(v) for v in (0.2, 0.3)[-len(form.filter) :])
    for q in (*form.filter, *form.datasheet):
        slopes = jax.grad(lambda p, q=q: q.value(*p, 10.0))(parameters)
        assert tuple(i for i, s in enumerate(slopes) if s != 0) == q.reads, q.symbol


@pytest.mark.parametrize("signal", ["deg/s", "g", "furlong"])
def test_tables_are_of_si_signals(signal):
    with pytest.raises(ValueError, match=r"unit is one of rad/s, m/s\^2, 1"):
        continuous_table("WN(sigma2=1)", 1.0, signal)


def test_conversions_check_what_they_get():
    with pytest.raises(ValueError, match=r"Unknown process 'FOO'.*Known: WN, QN"):
        to_continuous("FOO", (1.0,), 100.0)
    with pytest.raises(ValueError, match="GM has 2 parameters, and 1 were given"):
        from_continuous("GM", (1.0,), 100.0)
    with jax.enable_x64(False), pytest.raises(RuntimeError, match="64-bit"):
        to_continuous("AR1", (0.9, 1.0), 100.0)


@pytest.mark.parametrize(
    ("name", "si", "expected"),
    [
        ("km", "m", 1000.0), ("metres", "m", 1.0), ("degrees_north", "rad", DEG), ("deg_s", "rad/s", DEG),
        ("deg_h", "rad/s", DEG / 3600), ("°/s", "rad/s", DEG), ("m_s_2", "m/s^2", 1.0), ("m_s2", "m/s^2", 1.0),
        ("m/s2", "m/s^2", 1.0), ("mg", "m/s^2", 9.80665e-3), ("m s-1", "m/s", 1.0), ("mps", "m/s", 1.0),
        ("km_h", "m/s", 1 / 3.6), ("seconds", "s", 1.0), ("ns", "s", 1e-9), ("arcsec", "rad", DEG / 3600),
    ],
)  # fmt: skip
def test_words_of_tables(name, si, expected):
    """Units behind the names of columns and of attributes, in one table with the others."""
    assert units.size(name, si) == pytest.approx(expected, rel=1e-15, abs=0)
    with pytest.raises(ValueError, match=r"Unknown unit|cannot be converted"):
        units.size(name, "1/s")


def test_every_unit_can_stand_behind_a_name():
    """No two units of one quantity are written alike there."""
    for si in ("m", "s", "rad", "m/s", "rad/s", "m/s^2"):
        sizes = units.written(si)
        assert all(sizes[plain_name(name)] == UNITS[name].factor for name in units.names(si))


def test_units_of_time():
    assert [units.time_size(name) for name in ("s", "ms", "us", "ns", "min", "h")] == [
        1, 1e-3, 1e-6, 1e-9, 60, 3600,
    ]  # fmt: skip
    with pytest.raises(ValueError, match="Unknown unit of time 'day'; it is one of: s, ms, us, ns, min, h"):
        units.time_size("day")
