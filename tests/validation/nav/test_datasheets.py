"""A datasheet, emulated: its Allan variance on a table, its filters on a drive, and what rounding does to them."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import assert_mean
from nav import setups

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.imu.emulation import emulate, write_out

pytestmark = pytest.mark.slow

DEG, G = np.pi / 180, 9.80665
RATE, NUM, RUNS = 10.0, 2**14, 24


@eqx.filter_jit
def on_a_table(errors, keys):
    """Samples (NUM, 6, R) of an IMU at rest."""
    rest = jnp.array([0.0, 0.0, -G, 0.0, 0.0, 0.0])
    sensed = jnp.broadcast_to(rest, (NUM, 1, 1, 6)), jnp.broadcast_to(rest, (NUM, 6))
    ends = jnp.ones((NUM, 1, 1))
    return write_out(emulate(errors, keys, NUM, ends, sensed), ends).per_step[:, 0, 0] + rest[None, :, None]


@pytest.mark.parametrize("effects", [(), ("LSB",)])
def test_allan_variance_of_what_is_emulated(effects):
    """N, B and K of a gyro and an accelerometer, rounding as white noise: 4.5 sigma at every scale of a record."""
    sheet = nj.ImuSpecification(
        {"N": "0.6 deg/sqrt(h)", "in_run_bias": "15 deg/h", "K": "20 deg/h/sqrt(h)", "LSB": "0.05 deg/s"},
        {"N": "0.06 m/s/sqrt(h)", "B": "0.05 mg", "K": "2 mg/sqrt(h)", "LSB": "1 mg"},
    )
    found = on_a_table(sheet.truth(RATE, effects=effects), nj.filter.run_keys(jax.random.key(5), 0, RUNS))
    floor = np.sqrt(2 * np.log(2) / np.pi)
    gyro = (0.6 * DEG / 60, 15 * DEG / 3600 / floor, 20 * DEG / 3600 / 60, 0.05 * DEG)
    accel = (0.06 / 60, 0.05e-3 * G, 2e-3 * G / 60, 1e-3 * G)
    for channels, (n, b, k, lsb) in ((slice(0, 3), accel), (slice(3, 6), gyro)):
        ideal = gj.WN(n**2 * RATE + (lsb**2 / 12 if effects else 0.0)) + gj.BI(b) + gj.RW(k**2 / RATE)
        x = np.asarray(found)[:, channels].reshape(NUM, -1)
        measured = gj.wavelet_variance(x, rate=RATE)
        values = np.stack([m.variance for m in measured])
        assert_mean(values / np.asarray(ideal.wavelet_variance(measured[0].scales)), 1.0)


def test_rounding_is_white_noise_to_a_filter(judge):
    """800 runs with readings in steps of two standard deviations of the noise: the covariance has them, and needs to.

    Along a lemniscate, through an outage; RMS within 5 standard errors of the covariance at every epoch, and more than
    6 off what it would be without, somewhere.
    """
    output = nj.imu.Output(accel_step=0.02, gyro_step=0.002)
    noise = gj.WN(1e-4), gj.WN(1e-6)
    plain, truth = (nj.ImuErrors(*noise, setups.RATE, output=o) for o in (None, output))
    start = nj.InitialUncertainty(0.01, 0.002, np.radians([0.002, 0.002, 0.01]))
    scenario = nj.Scenario(nj.motions.lemniscate(20.0, setups.RATE), setups.aiding(5.0, 18.0), start, every=10)
    runs = nj.monte_carlo(scenario, truth, num_runs=800, key=jax.random.key(2), gains="reference")
    for errors in (truth, plain):
        analysis = nj.analyse(scenario, errors)["filter"]
        for block in ("position", "velocity", "attitude"):
            squares = np.sum(runs.errors(block) ** 2, axis=2)
            z = (squares.mean(axis=0) - analysis.rms(block) ** 2) / (squares.std(axis=0) / np.sqrt(800))
            if errors is truth:
                judge(f"mean square of {block}, in standard errors", z, -5, 5, num_draws=800)
            else:
                assert z.max() > 6, block


SCENARIO = nj.Scenario(
    nj.motions.lemniscate(30.0, 50.0),
    [
        nj.GnssPosition(1.0, horizontal=0.5, vertical=1.0, outages=((18.0, 28.0),)),
        nj.GnssVelocity(1.0, horizontal=0.05, vertical=0.1, outages=((18.0, 28.0),)),
    ],
    nj.InitialUncertainty(0.5, 0.1, np.radians([0.2, 0.2, 1.0])),
    every=5,
)


def test_a_filter_that_knows_the_datasheet_is_consistent(judge):
    """The ladder of a filter has half the processes of the truth's: expected NEES within 3 % of its dof, everywhere."""
    device = nj.devices["MTi-300"]
    nees = nj.analyse(SCENARIO, device.truth(50.0), device.filter(50.0))["filter"].nees("navigation") / 9
    judge("expected NEES over dof", nees, 0.97, 1.03, num_draws=1)


def test_increments_in_steps_through_a_monte_carlo(judge):
    """100 runs of an IMU that counts, with its range: NEES within 4.5 sigma of 9 at every epoch."""
    device = nj.devices["HG1700 AG58"]
    truth, believed = (make(50.0, effects=["range", "LSB"]) for make in (device.truth, device.filter))
    runs = nj.monte_carlo(SCENARIO, truth, believed, num_runs=100, key=jax.random.key(1))
    nees = runs.nees["navigation"].mean(axis=0) / 9
    band = 4.5 * np.sqrt(2 / 900)
    judge("NEES over dof", nees, 1 - band, 1 + band, num_draws=100)
