"""A process of which a user defines all laws is fitted and printed as those of the package are.

One that defines a single law is in test_own_process.py.
"""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import gmwm_jax as gj
import nav_jax as nj
from gmwm_jax._internal.typing import Scalar
from gmwm_jax.processes import AbstractProcess, to_continuous
from gmwm_jax.processes.continuous_form import ContinuousForm, Quantity
from gmwm_jax.processes.parameter import Parameter


class Hiss(AbstractProcess):
    """White noise by its standard deviation, from outside the package and without a continuous-time form."""

    s: Scalar | None

    kind: ClassVar[str] = "HISS"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("s", "{u}", "standard deviation"),)

    def __init__(self, s: Any = None):
        self._set(s=s)

    @staticmethod
    def amplitude_of(value):
        return value * value

    @staticmethod
    def value_of(amplitude):
        return jnp.sqrt(amplitude)

    @classmethod
    def unit_wavelet_variance(cls, shape, tau):
        return gj.WN.unit_wavelet_variance(shape, tau)

    @classmethod
    def unit_psd(cls, shape, frequency):
        return gj.WN.unit_psd(shape, frequency)

    @classmethod
    def unit_haar_covariance(cls, shape, lag, parity, n_j, n_k):
        return gj.WN.unit_haar_covariance(shape, lag, parity, n_j, n_k)

    def simulate(self, num_samples, key):
        return gj.WN(self.amplitude).simulate(num_samples, key)

    def state_space(self):
        self.require_complete()
        return gj.WN(self.amplitude).state_space()


class TimedHiss(Hiss):
    """The same with a density."""

    continuous: ClassVar[ContinuousForm | None] = ContinuousForm(
        filter=(Quantity("q", "PSD", "^2/Hz", lambda s, f: s * s / f),),
        datasheet=(
            Quantity("N", "density", "/sqrt(Hz)", lambda s, f: s / jnp.sqrt(f), gyro=("deg/sqrt(h)",), accel=("ug",)),
        ),
        inverse=lambda q, f: (jnp.sqrt(q * f),),
    )


@pytest.fixture(scope="module")
def recording():
    x = gj.simulate(gj.WN(4.0) + gj.RW(1e-3), 20_000, key=jax.random.key(2))
    return gj.Recording(np.asarray(x)[:, None], rate=100.0, channels=("gyro_x",), units=("rad/s",))


@pytest.fixture(scope="module")
def inside(recording):
    return gj.fit(recording, "WN + RW")


def test_a_process_without_continuous_form_says_so(recording, inside):
    fit = gj.fit(recording, Hiss() + gj.RW())
    assert float(fit.model.processes[0].s) ** 2 == pytest.approx(float(inside.model.processes[0].sigma2), rel=1e-9)
    text = repr(fit)
    assert text.count("HISS has no continuous-time form: its class does not define `continuous`.") == 2
    assert fit.continuous()["RW", "q"].value == pytest.approx(inside.continuous()["RW", "q"].value, rel=1e-9)
    assert fit.continuous()["RW", "q"].ci_low == pytest.approx(inside.continuous()["RW", "q"].ci_low, rel=1e-6)
    alone = gj.fit(recording, Hiss())
    assert "HISS has no continuous-time form" in repr(alone)
    assert len(alone.continuous()) == 0
    with pytest.raises(ValueError, match="HISS has no continuous-time form"):
        to_continuous(Hiss, (1.0,), 100.0)


def test_a_process_with_continuous_form_is_in_the_tables(recording, inside):
    fit = gj.fit(recording, TimedHiss() + gj.RW())
    ours, theirs = fit.datasheet()["HISS", "N"], inside.datasheet()["WN", "N"]
    assert (ours.value, ours.ci_low, ours.ci_high) == pytest.approx(
        (theirs.value, theirs.ci_low, theirs.ci_high), rel=1e-6
    )
    assert ours.unit == "deg/sqrt(h)"
    assert "no continuous-time form" not in repr(fit)


def test_a_filter_takes_a_process_from_outside():
    errors = nj.ImuErrors(TimedHiss(2.0) + gj.RW(1e-3), gj.WN(1e-6), 100.0)
    assert [s.label for s in errors.bank().states] == ["RW"] * 3
    assert float(errors.bank().white[0]) == pytest.approx(4.0)
    assert float(errors.at_rate(400.0).bank().white[0]) == pytest.approx(16.0)
    with pytest.raises(ValueError, match="HISS has no continuous-time form"):
        nj.ImuErrors(Hiss(2.0), gj.WN(1e-6), 100.0).at_rate(400.0)
