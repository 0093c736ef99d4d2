"""An Earth that only the tests know: the perfect IMU, the filter, its error model and the covariances all ask it."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from nav import setups

import gmwm_jax as gj
import nav_jax as nj

pytestmark = pytest.mark.usefixtures("quick_compilation")

RATE = 20.0


class SmallPlanet(nj.kinematics.AbstractEarth):
    """Of 2 km radius: gravity falls by a thousandth with each metre of height, as an inverse square."""

    is_uniform: ClassVar[bool] = False

    def gravity_n(self, position):
        zero = jnp.zeros_like(position[0])
        return jnp.stack([zero, zero, 9.8 * (2000.0 / (2000.0 - position[2])) ** 2])


WHITE = nj.ImuErrors(gj.WN(1e-4), gj.WN(1e-6), RATE)


@pytest.mark.parametrize("gains", ["estimate", "reference"])
@pytest.mark.parametrize("every", [1, 10])
def test_without_noise_the_reference_comes_back(gains, every):
    """30 s of climbing: 1e-6 m is asked for; on an Earth with the same gravity everywhere it would be metres off."""
    reference = nj.motions.climb(30.0, RATE)
    scenario = nj.Scenario(reference, setups.aiding()[2:], earth=SmallPlanet(), every=every)
    assert np.ptp(reference.position[:, 2]) > 5.0
    e = nj.filter.prepare(scenario, rate=RATE)
    shared = nj.filter.gains_of(e, WHITE) if gains == "reference" else None
    error = nj.filter.run_filter(e, WHITE, setups.quiet_inputs(e), shared).judgement.error
    assert np.abs(np.asarray(error)[:, :3]).max() < 1e-6
    np.testing.assert_allclose(e.timeline.truth.p[:, :, 0], reference.position[20::20], rtol=0, atol=1e-5)
    # the same samples on a flat Earth
    imu, truth = nj.perfect_imu(reference, RATE, SmallPlanet())
    start = {"position": truth.position[0], "velocity": truth.velocity[0], "quaternion": truth.quaternion[0]}
    free = {"initial": nj.InitialUncertainty(), "every": every, **start}
    there = nj.navigate(imu, (), WHITE, earth=SmallPlanet(), **free).trajectory.position[-1]
    flat = nj.navigate(imu, (), WHITE, earth=nj.FlatEarth(9.8), **free).trajectory.position[-1]
    assert np.abs(there - truth.position[-1]).max() < 1e-6
    assert np.abs(flat - truth.position[-1]).max() > 1.0


@pytest.mark.parametrize("every", [1, 10])
def test_runs_have_the_errors_that_the_covariances_say(every):
    """400 runs of free inertial navigation: heights fall away from the truth, as the gradient of gravity makes them.

    RMS of every component within 4.5 standard errors of its scatter, and the NEES too; without the gradient in the
    error model the vertical would be tens of standard errors off.
    """
    start = nj.InitialUncertainty(0.5, 0.05, 1e-4)
    scenario = nj.Scenario(nj.motions.climb(20.0, RATE), (), start, SmallPlanet(), every=every, output_interval=5.0)
    c = nj.analyse(scenario, WHITE)["filter"]
    np.testing.assert_allclose(c.nees("navigation"), 9.0, rtol=1e-6)
    runs = nj.monte_carlo(scenario, WHITE, num_runs=400, key=jax.random.key(3))
    squares = runs.error[:, :, :9] ** 2
    z = (squares.mean(axis=0) - c.sd[:, :9] ** 2) / (squares.std(axis=0, ddof=1) / np.sqrt(400))
    assert np.abs(z).max() < 4.5
    nees = runs.nees["navigation"]
    assert np.abs((nees.mean(axis=0) - 9) / (nees.std(axis=0, ddof=1) / np.sqrt(400))).max() < 4.5
    flat = nj.analyse(nj.Scenario(scenario.reference, (), start, every=every, output_interval=5.0), WHITE)["filter"]
    off = (squares.mean(axis=0) - flat.sd[:, :9] ** 2) / (squares.std(axis=0, ddof=1) / np.sqrt(400))
    assert off[-1, 2] > 10
