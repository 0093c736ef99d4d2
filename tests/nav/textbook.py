"""An error-state EKF as a textbook writes it: dense matrices, one run, NumPy and SciPy. For comparison only.

Nothing is shared with the package: the attitude error is in b (there F is constant over a sample, and Phi and Q are
matrix exponentials, exact for white noise and for errors that hold over a sample), updates are joint with an explicit
inverse, rotations are SciPy's.
"""

import numpy as np
import scipy.linalg
from nav.setups import skew
from scipy.spatial.transform import Rotation


class Bank:
    """States of the sensor errors, from the matrices of a `SensorBank`."""

    def __init__(self, bank):
        self.Phi, self.Q = np.asarray(bank.transition), np.asarray(bank.driving)
        self.white, self.initial = np.asarray(bank.white) / float(bank.rate), np.asarray(bank.initial)
        self.size = len(bank.states)
        self.readout = np.zeros((6, self.size))
        self.readout[list(bank.channels), np.arange(self.size)] = np.asarray(bank.readout)


def constant_step(p, v, C, omega, f, dt, g):
    """Exact motion for constant omega and f, as the exponential of one matrix."""
    A = np.zeros((5, 5))
    A[:3, :3], A[:3, 3], A[3, 4] = skew(omega), f, 1.0
    # columns of exp(A t): rotation, its integral times f, and the double integral
    E = scipy.linalg.expm(A * dt)
    return p + v * dt + C @ E[:3, 4] + g * dt**2 / 2, v + C @ E[:3, 3] + g * dt, C @ E[:3, :3]


def discretise(C, omega, f, bank, dt):
    """Phi and Q of p, v, attitude error in b and sensor states that hold: matrix exponential, Van Loan."""
    n = 9 + bank.size
    F, G = np.zeros((n, n)), np.zeros((n, 6))
    F[0:3, 3:6] = np.eye(3)
    # v' = C exp(phi) f - C f, where the estimate is C exp(-omega t): in axes that turn with b
    F[6:9, 6:9] = -skew(omega)
    F[6:9, 9:], G[6:9, 3:] = -bank.readout[3:], -np.eye(3)
    # position and velocity errors in axes of b, which turn
    F[0:3, 0:3] = F[3:6, 3:6] = -skew(omega)
    F[3:6, 6:9], F[3:6, 9:], G[3:6, :3] = -skew(f), -bank.readout[:3], -np.eye(3)
    W = np.diag(bank.white)
    E = scipy.linalg.expm(np.block([[-F, G @ W @ G.T], [np.zeros((n, n)), F.T]]) * dt)
    Phi = E[n:, n:].T
    Q = Phi @ E[:n, n:]
    turn = scipy.linalg.expm(skew(omega) * dt)
    before, after = into_b(C, n), into_b(C @ turn, n)
    return after.T @ Phi @ before, after.T @ Q @ after


def into_b(C, n):
    """From errors in n to errors in b."""
    return scipy.linalg.block_diag(C.T, C.T, C.T, np.eye(n - 9))


def run(bank, start, P, samples, sample_dt, events, g):
    """Filter one run.

    `start`: p, v, C. `samples` (N, 6): accelerometers, gyros. `events`: rows of (time, H, R, z), in order of time.
    Returns p, v, C, x, P after each event.
    """
    (p, v, C), x, t, k = start, np.zeros(bank.size), 0.0, 0
    P, out, n = P.copy(), [], 9 + bank.size
    for time, H, R, z in events:
        while t < time - 1e-9:
            end = (k + 1) * sample_dt
            dt = min(end, time) - t
            sensed = samples[k] - bank.readout @ x
            Phi, Q = discretise(C, sensed[3:], sensed[:3], bank, dt)
            p, v, C = constant_step(p, v, C, sensed[3:], sensed[:3], dt, g)
            P = Phi @ P @ Phi.T + Q
            t += dt
            if t > end - 1e-9:
                jump = scipy.linalg.block_diag(np.eye(9), bank.Phi)
                x, P, k = bank.Phi @ x, jump @ P @ jump.T, k + 1
                P[9:, 9:] += bank.Q
        if len(z):
            H = np.hstack([H, np.zeros((len(z), n - 9))])
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            c = K @ (z - H[:, :3] @ p - H[:, 3:6] @ v)
            P = (np.eye(n) - K @ H) @ P
            P = (P + P.T) / 2
            p, v, C, x = p + c[:3], v + c[3:6], Rotation.from_rotvec(c[6:9]).as_matrix() @ C, x + c[9:]
        out.append((p, v, C, x, P))
    return out
