"""What gmwm_jax exports for nav-jax is what nav-jax reads."""

import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.fitting.result import Fit, Status
from gmwm_jax.fitting.weights import Default
from nav_jax.imu.errors import fitted_errors

RATE = 250.0
MODELS = {
    "accel_x": "WN(sigma2=1e-4) + QN(q2=1e-5) + GM(beta=0.01, variance=1e-7)",
    "accel_y": "WN(sigma2=2e-4) + RW(gamma2=1e-11)",
    "accel_z": "WN(sigma2=3e-4) + RW(gamma2=2e-11) + GM(beta=0.001, variance=3e-7)",
    "gyro_x": "GM(beta=2.0573, variance=5.119e-5) + RW(gamma2=2.7878e-12)",
    "gyro_y": "WN(sigma2=1e-6) + MAT32(beta=0.01, variance=1e-8)",
    "gyro_z": "WN(sigma2=0) + ARMA(2,1)(phi1=0.5, phi2=0.2, theta1=0.4, sigma2=1e-6)",
}


def fit_of(name, text):
    """The result of a fit that has found this model."""
    model, tau = gj.parse_model(text), 2.0 ** np.arange(1, 13)
    nu = np.asarray(model.wavelet_variance(tau))
    unit = "rad/s" if name.startswith("gyro") else "m/s^2"
    wv = gj.variance.WaveletVariance.from_table(tau, nu, 0.9 * nu, 1.1 * nu, rate=RATE, unit=unit, name=name)
    return Fit(model, wv, 0.0, np.eye(len(tau)), Default(), Status.converged, rate=RATE)


@pytest.mark.slow
def test_six_axes_there_and_back(tmp_path):
    """In the order of the file's channels, not of the fits; every parameter to its last digit."""
    fits = gj.fitting.Channels({name: fit_of(name, text) for name, text in reversed(MODELS.items())})
    fits.export("nav-jax", path=tmp_path / "fit.json")
    errors = fitted_errors(tmp_path / "fit.json")
    assert errors.rate == RATE
    for model, text in zip(errors.models, MODELS.values(), strict=True):
        given = [p for p in gj.parse_model(text).processes if p.amplitude > 0]
        assert [p.kind for p in model.processes] == [p.kind for p in given]
        for p, q in zip(model.processes, given, strict=True):
            assert [float(v) for v in p.values] == [float(v) for v in q.values]


def test_one_axis_of_each_serves_three(tmp_path):
    fits = [fit_of(name, MODELS[name]) for name in ("gyro_y", "accel_z")]
    Fit.export_of(fits, "nav-jax", path=tmp_path / "fit.json")
    errors = fitted_errors(tmp_path / "fit.json")
    assert len({repr(m) for m in errors.models[:3]}) == len({repr(m) for m in errors.models[3:]}) == 1
    assert float(errors.models[0].processes[0].sigma2) == pytest.approx(3e-4, rel=1e-15, abs=0)
