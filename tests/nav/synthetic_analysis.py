"""Results of covariance analyses without a filter: every number is chosen, none computed."""

import numpy as np

import nav_jax as nj
from nav_jax.filter.layout import QUANTITIES

OUTAGE = (10.0, 20.0)
START, END = OUTAGE
TIME = np.arange(1.0, 31.0)
OUTAGES = {"gnss": (OUTAGE,), "baro": ()}
FIXES = {"gnss": np.r_[1.0:START, END + 1 : 31.0], "baro": TIME}
JUDGED = 20.0
"""The end of the outage."""
GROWTH = 1 + np.array([(t - START) ** 2 / 10 if START < t <= END else 0.0 for t in TIME])
TRUTH = nj.ImuErrors("WN(sigma2=1e-4) + GM(beta=0.01, variance=1e-6)", "WN(sigma2=1e-7)", 20.0)
WHITE = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-7)", 20.0)


def make_covariances(name="right", *, inflation=1.0, scale=1.0):
    """Standard deviations of 0.1 m, 0.01 m/s and 1 mrad that grow in the outage; true errors are `inflation` times."""
    sd = scale * GROWTH[:, None] * np.repeat([0.1, 0.01, 1e-3, 1e-3, 1e-4], 3)
    claimed = sd[:, :, None] ** 2 * np.eye(15)
    return nj.lincov.Covariances(
        name=name,
        time=TIME,
        true=inflation**2 * claimed,
        claimed=claimed,
        channels=(0, 1, 2),
        fixes=FIXES,
        outages=OUTAGES,
    )


def make_analysis():
    """A filter that is right and one that claims half its error."""
    filters = {"right": make_covariances(), "optimist": make_covariances("optimist", inflation=2.0)}
    return nj.lincov.Analysis(filters, "a line", "a model")


def make_sensitivities(num=6):
    """Of `num` parameters of the truth and as many of the filter, each half as important as the one before."""
    names = tuple(f"accel p{i}" for i in range(num))
    rms = {q: GROWTH * (0.1 if q != "tilt" else 1e-3) for q in QUANTITIES}
    weights = np.concatenate([0.5 ** np.arange(num), -(0.5 ** (np.arange(num) + 0.5))])
    derivative = {q: x[:, None] * weights for q, x in rms.items()}
    sides = ("truth",) * num + ("filter",) * num
    return nj.lincov.Sensitivities(TIME, sides, (*names, *names), rms, derivative, dict(OUTAGES), FIXES)


def make_budget(num=10):
    """Sources each twice as large as the one before; nothing at the first epoch."""
    part = 2.0 ** np.arange(num)[:, None, None] * np.ones((num, len(TIME), 9)) * GROWTH[None, :, None] ** 2 * 1e-4
    part[:, 0] = 0.0
    return nj.lincov.Budget(TIME, tuple(f"source {i}" for i in range(num)), part, dict(OUTAGES), FIXES)


def make_calibration(num=50):
    """Draws that spread by ten per cent, and a loss of one."""
    spread = 1 + 0.1 * np.linspace(-1, 1, num)[:, None]
    rms = dict.fromkeys(QUANTITIES, 0.1 * GROWTH)
    used = {q: spread * x for q, x in rms.items()}
    best = {q: x / 1.01 for q, x in used.items()}
    sd = dict.fromkeys(QUANTITIES, np.full(len(TIME), 0.06))
    return nj.lincov.CalibrationEffect(TIME, rms, used, best, sd, dict(OUTAGES), FIXES)


def make_design():
    """Four structures, two of them with three states; one did not converge, one is not on the front."""
    structures = (((0, 0), 3.0, True), ((1, 0), 1.0, True), ((0, 1), 2.0, True), ((1, 1), 0.5, False))
    candidates = tuple(
        nj.lincov.Candidate(
            num_accel=a,
            num_gyro=g,
            num_states=3 * (a + g),
            errors=TRUTH if a else WHITE,
            naive=WHITE,
            loss=loss,
            loss_naive=loss + 1,
            converged=converged,
            covariances=(make_covariances("designed", scale=1 + 0.1 * loss),),
            covariances_naive=(make_covariances("truncated", inflation=2.0, scale=1 + 0.1 * loss),),
        )
        for (a, g), loss, converged in structures
    )
    scenario = nj.Scenario(nj.motions.static(30.0, 20.0), ())
    return nj.lincov.Design(candidates, (make_covariances(),), "score", TRUTH, (scenario,))


def make_tuning():
    """Four parameters: the record says nothing of the second, and the last was held."""
    start, nan = np.array([1e-4, 0.01, 1e-6, 1e-7]), np.nan
    return nj.recorded.Tuning(
        errors=TRUTH,
        aiding=(nj.GnssPosition(1.0, horizontal=1.0, vertical=2.0),),
        names=("accel WN sigma2", "accel GM beta", "accel GM variance", "gyro WN sigma2"),
        start=start,
        value=start * [2.0, 1.0, 0.5, 1.0],
        se=np.array([0.1, nan, 0.2, nan]),
        ci_low=start * [1.6, nan, 0.3, nan],
        ci_high=start * [2.5, nan, 0.8, nan],
        sought=np.array([True, False, True, False]),
        lost=np.full(4, False),
        observable=np.array([True, False, True, False]),
        held=("gyro WN sigma2",),
        loss_start=-100.0,
        loss=-112.0,
        num_innovations=300,
        converged=True,
        level=0.95,
    )


def make_noise_in_motion(**changes):
    """Of six axes: one as at rest, one whose factor the record does not limit."""
    factor = np.array([0.1, 0.2, 0.1, 0.0, 0.3, 0.1])
    given = {
        "factor": factor, "ci_low": factor / 2, "ci_high": np.append(2 * factor[:5] + 0.1, 1.0),
        "ratio": 40 * factor, "ratio_of_all": 120.0, "window": 0.25, "num_innovations": 600, "converged": True,
        "level": 0.95,
    }  # fmt: skip
    return nj.recorded.NoiseInMotion(**{**given, **changes})
