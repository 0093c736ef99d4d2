"""Sensors, models, scenarios and results that test files share, those of tests/validation too.

Each length of a trajectory, set of aiding sensors and structure of a noise model is programs of its own, which take
longer to compile than to run: tests take these unless another one is their point. The numbers of the sensors are those
of R's lemniscate example.
"""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.filter.layout import NAVIGATION
from nav_jax.filter.measurement import Measurements
from nav_jax.filter.timeline import Inputs
from nav_jax.imu.emulation import AtEnd, GivenErrors, write_out
from nav_jax.kinematics.state import NavState

GRAVITY = 9.8056
RATE = 100.0
ACCEL_WN, GYRO_WN = 5.989778e-05, 1.503793e-06
ACCEL_AR1 = ((0.9982454, 1.848297e-10), (0.9999121, 2.435414e-11), (0.9999998, 1.026718e-12))
GYRO_AR1 = ((0.9968999, 2.42898e-11), (0.9999001, 1.238142e-12))


def sensor(white, ar1=()):
    """White noise and AR1, as one model."""
    model = gj.WN(white)
    for phi, innovation in ar1:
        model = model + gj.AR1(phi, innovation)
    return model


def imu_errors(which="right", start="stationary", **options):
    """R's three filter models: all processes, white noise only, white noise and the fastest AR1."""
    count = {"right": (3, 2), "wrong": (0, 0), "partial": (1, 1)}[which]
    accel, gyro = sensor(ACCEL_WN, ACCEL_AR1[: count[0]]), sensor(GYRO_WN, GYRO_AR1[: count[1]])
    return nj.ImuErrors(accel, gyro, RATE, start=start, **options)


def aiding(*outage, rate=1.0, **options):
    """GNSS with an outage, barometer without."""
    gaps = (outage,) if outage else ()
    return (
        nj.GnssPosition(rate, horizontal=0.025, vertical=0.05, outages=gaps, **options),
        nj.GnssVelocity(rate, horizontal=0.01, vertical=0.02, outages=gaps, **options),
        nj.Barometer(rate, height=0.5, **options),
    )


ARM = (1.0, 0.5, -1.5)
"""From the IMU to an antenna: front, right, down in m."""
WHEEL_ARM = (-1.0, 0.3, 0.8)


def on_arms():
    """Sensors that are not linear in position and velocity: an antenna, and a wheel with a scale factor, on arms."""
    return (
        nj.GnssPosition(1.0, horizontal=0.05, vertical=0.1, lever_arm=ARM),
        nj.Odometer(2.0, speed=0.03, sideways=0.05, lever_arm=WHEEL_ARM, scale_sd=0.02),
    )


# -- covariances ------------------------------------------------------------------------------------------------------

OUTAGE = (12.0, 20.0)
START = nj.InitialUncertainty(0.05, 0.02, 0.002)
SCENARIO = nj.Scenario(nj.motions.lemniscate(20.0, RATE), aiding(*OUTAGE), START, every=10)
TRUTH = nj.ImuErrors(
    gj.WN(6e-5) + gj.GM(0.01, 4e-5) + gj.GM(0.0005, 1e-4), gj.WN(1.5e-6) + gj.GM(0.002, 3e-7), RATE, gyro_bias_sd=1e-4
)
FEWER = nj.ImuErrors(gj.WN(6e-5) + gj.GM(0.01, 4e-5), gj.WN(1.5e-6), RATE, gyro_bias_sd=1e-4)
"""What a filter believes that has fewer states than `TRUTH`."""


@cache
def experiment():
    """`SCENARIO`, prepared."""
    return nj.filter.prepare(SCENARIO, rate=RATE)


@cache
def motion():
    """Of `SCENARIO`."""
    return nj.lincov.motion_of(experiment())


def covariances(truth, believed):
    """Along `SCENARIO`: the program of `nav_jax.analyse` there."""
    return nj.lincov.linear_covariance(experiment(), truth, believed, believed_initial=START, motion=motion())


@cache
def designed():
    """Filters with no or one process of the gyros, for a truth with one, and two of the accelerometers."""
    scenario = nj.Scenario(nj.motions.lemniscate(12.0, RATE), aiding(6.0, 12.0), START, every=20)
    return nj.design(scenario, TRUTH, max_accel=0, max_gyro=1, num_starts=1)


@cache
def fits():
    """Of the accelerometers and the gyros, from a short static recording."""
    out = []
    for model, seed in (("WN(sigma2=6e-5) + GM(beta=0.005, variance=4e-5)", 1), ("WN(sigma2=1.5e-6)", 2)):
        x = np.asarray(gj.simulate(model, 20_000, key=jax.random.key(seed)))
        wv = gj.wavelet_variance(gj.Recording.from_array(x, rate=RATE, units="m/s^2" if seed == 1 else "rad/s"))
        kinds = " + ".join(p.kind for p in gj.parse_model(model).processes)
        out.append(gj.fit(wv, kinds))
    return out


# -- smoothing --------------------------------------------------------------------------------------------------------

SMOOTHED_OUTAGE = (6.0, 12.0)
SMOOTHED = nj.Scenario(
    nj.motions.lemniscate(16.0, RATE), aiding(*SMOOTHED_OUTAGE)[:2], nj.InitialUncertainty(0.1, 0.05, 0.01), every=10
)
SMOOTHED_ERRORS = nj.ImuErrors(gj.WN(6e-5) + gj.GM(0.002, 2e-5), gj.WN(1.5e-6) + gj.GM(0.005, 2e-7), RATE)


# -- runs -------------------------------------------------------------------------------------------------------------


def quiet_inputs(experiment, num_states=0, num_runs=1):
    """Inputs without any error: exact start, perfect sensors, exact fixes."""
    timeline = experiment.timeline
    M, G, n, _ = timeline.imu.shape
    truth = NavState(*(a[:, :, 0].T for a in timeline.truth[:3]), jnp.zeros((timeline.own.size, M)))
    z = Measurements(experiment.sensors, timeline.own, timeline.earth.rate).predict(truth, timeline.sensed.T).T
    start = experiment.start
    start = type(start)(*(jnp.tile(a, (1, num_runs)) for a in start[:3]), jnp.zeros((num_states, num_runs)))
    return Inputs(
        start,
        GivenErrors(jnp.zeros((M, G, n, 6, num_runs)), AtEnd(*jnp.zeros((2, M, 6, num_runs)))),
        jnp.tile(z[:, :, None], (1, 1, num_runs)),
    )


def samples(experiment):
    """The IMU sample of each piece; for one that fills up a segment, any."""
    ends = np.asarray(experiment.timeline.ends)[np.asarray(experiment.timeline.pattern)].ravel().astype(int)
    return np.minimum(np.cumsum(ends) - ends, experiment.num_samples - 1)


def given(experiment, inputs):
    """The inputs with their errors as arrays."""
    timeline = experiment.timeline
    return inputs._replace(errors=write_out(inputs.errors, timeline.ends[timeline.pattern]))


def derivative(sensors):
    """H of linear sensors, (K, 9)."""
    return np.concatenate([s.jacobian(None, None, NAVIGATION)[:, :, 0] for s in sensors])


def skew(a):
    """Matrix of the vector product."""
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
