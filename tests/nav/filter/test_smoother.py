"""The fixed-interval smoother: against the textbook form with inverses, by its NEES, and on a record."""

import jax
import numpy as np
import pytest
from nav import setups

import nav_jax as nj

ERRORS = setups.SMOOTHED_ERRORS


def textbook(Phi, P_after, H, R, valid, states):
    """Rauch, Tung & Striebel with inverses: corrections of the estimates and covariances (Gelb 1974, sec. 5.2).

    The covariance before an update from that after it, in the form of information. `states` are corrections that the
    filter made, in the error coordinates of each event.
    """
    num = len(P_after)
    before = []
    for k in range(num):
        used = valid[k] > 0
        information = np.linalg.inv(P_after[k]) - H[used].T @ np.diag(1 / R[used]) @ H[used]
        before.append(np.linalg.inv(information))
    x, P = [np.zeros(len(H[0]))], [P_after[-1]]
    for k in range(num - 2, -1, -1):
        C = P_after[k] @ Phi[k + 1].T @ np.linalg.inv(before[k + 1])
        # what the smoother knows at k + 1 beyond the prediction: the filter's correction and its own
        x.append(C @ (states[k + 1] + x[-1]))
        P.append(P_after[k] + C @ (P[-1] - before[k + 1]) @ C.T)
    return np.array(x[::-1]), np.array(P[::-1])


@pytest.fixture(scope="module")
def experiment():
    return nj.filter.prepare(setups.SMOOTHED, rate=setups.RATE)


@pytest.fixture(scope="module")
def inputs(experiment):
    return nj.filter.draw_inputs(experiment, ERRORS, nj.filter.run_keys(jax.random.key(2), 0, 4))


@pytest.fixture(scope="module")
def gains(experiment):
    return nj.filter.gains_of(experiment, ERRORS, smooth=True)


@pytest.fixture(scope="module")
def outcomes(experiment, inputs, gains):
    """Of four runs: the filter that remembers, and the smoother."""
    return nj.filter.run_filter(experiment, ERRORS, inputs, gains), nj.filter.run_filter(
        experiment, ERRORS, inputs, gains, smooth=True
    )


@pytest.mark.slow
def test_it_is_the_textbook_smoother(experiment, outcomes):
    """Estimates and covariances at every event, relative to the standard deviations 1e-6."""
    plain, smooth = outcomes
    H = setups.derivative(experiment.sensors)
    R = np.concatenate([s.believed**2 for s in experiment.sensors])
    memory = jax.tree.map(lambda a: np.asarray(a)[..., 0], plain.memory)
    H = np.pad(H, ((0, 0), (0, memory.P.shape[1] - 9)))
    valid = np.asarray(experiment.timeline.valid)
    run = 1
    nu = np.asarray(plain.innovation)[:, :, run] * valid
    # K nu, summed: innovations are given those before, and gains too
    corrections = np.einsum("mkn,mk->mn", memory.gain, nu)
    x, P = textbook(memory.transition, memory.P, H, R, valid, corrections)
    sd = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    seen = np.asarray(smooth.memory.P)[..., 0]
    np.testing.assert_allclose(seen / sd[:, :, None] / sd[:, None, :], P / sd[:, :, None] / sd[:, None, :], atol=1e-6)
    moved = np.concatenate([np.asarray(a)[:, :, run] for a in (smooth.state.p, smooth.state.v, smooth.state.x)], axis=1)
    from_ = np.concatenate([np.asarray(a)[:, :, run] for a in (plain.state.p, plain.state.v, plain.state.x)], axis=1)
    others = [*range(6), *range(9, x.shape[1])]
    np.testing.assert_allclose((moved - from_) / sd[:, others], x[:, others] / sd[:, others], atol=1e-5)
    assert np.abs(x / sd).max() > 1


@pytest.mark.slow
def test_the_last_estimate_is_the_filter_s(outcomes):
    plain, smooth = outcomes
    for a, b in zip(plain.state, smooth.state, strict=True):
        np.testing.assert_allclose(a[-1], b[-1], rtol=1e-11, atol=1e-14)
    np.testing.assert_allclose(plain.judgement.sd[-1], smooth.judgement.sd[-1], rtol=1e-9)
    np.testing.assert_allclose(plain.innovation, smooth.innovation, rtol=1e-9)


def test_gains_that_do_not_remember_are_refused(experiment, inputs, gains):
    forgetful = gains._replace(memory=None)
    with pytest.raises(ValueError, match="smooth=True"):
        nj.filter.run_filter(experiment, ERRORS, inputs, forgetful, smooth=True)


@pytest.mark.slow
def test_navigation_is_smoothed():
    """A record whose sensors are perfect comes back, at outputs and fixes; standard deviations are the smaller."""
    imu, reference = nj.perfect_imu(nj.motions.lemniscate(8.0, setups.RATE), setups.RATE, nj.FlatEarth())
    t = np.arange(1.0, 9.0)
    at = np.round(t * setups.RATE).astype(int)
    sensor = nj.GnssPosition(1.0, horizontal=0.03, vertical=0.05)
    options = {
        "position": reference.position[0],
        "velocity": reference.velocity[0],
        "quaternion": reference.quaternion[0],
        "initial": setups.SMOOTHED.initial,
        "every": 10,
        "output_interval": 0.5,
    }
    fixes = [nj.Fixes(sensor, t, reference.position[at])]
    plain = nj.navigate(imu, fixes, ERRORS, **options)
    smooth = nj.navigate(imu, fixes, ERRORS, smooth=True, **options)
    np.testing.assert_allclose(smooth.time, 0.5 * np.arange(1, 17))
    assert len(smooth.before) == 0
    rows = np.searchsorted(plain.time, smooth.time - 1e-9)
    np.testing.assert_allclose(smooth.trajectory.position, reference.position[::50][1:], atol=1e-6)
    assert np.all(smooth.sd[:-1, :3] < plain.sd[rows[:-1], :3])
    assert smooth.trajectory.name == "smoothed navigation"
    np.testing.assert_allclose(smooth.nis["gnss_position"], plain.nis["gnss_position"], atol=1e-19)


@pytest.mark.slow
def test_it_is_better_where_fixes_are_missing(outcomes):
    """In the middle of the outage, by its own claims and in the errors of the four runs taken together."""
    plain, smooth = (o.judgement for o in outcomes)
    errors = [np.sqrt(np.mean(np.square(np.asarray(j.error)[:, :3]), axis=(1, 2))) for j in (plain, smooth)]
    claims = [np.asarray(j.sd)[:, :3].mean(axis=(1, 2)) for j in (plain, smooth)]
    worst = errors[0].argmax()
    assert errors[1][worst] < 0.5 * errors[0][worst]
    assert np.all(claims[1][:-1] < claims[0][:-1])
