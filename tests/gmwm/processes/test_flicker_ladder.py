"""The ladder of GM that stands for flicker noise in a filter: its error in the band, and what it refuses."""

import jax
import numpy as np
import pytest

from gmwm_jax.processes.flicker import BI, flicker_ladder
from gmwm_jax.processes.gauss_markov import GM


@pytest.mark.parametrize(("low", "high"), [(1e-3, 1e-2), (1e-5, 1e-2), (1e-6, 0.1), (1e-8, 1e-2)])
@pytest.mark.parametrize(("per_decade", "error"), [(1, 0.08), (2, 0.01)])
def test_error_of_the_spectrum_in_the_band(low, high, per_decade, error):
    """As the docstring states it, on a grid that the ladder was not made on; and with some margin in the middle."""
    model = flicker_ladder(0.3, low, high, per_decade * round(np.log10(high / low)) + 1)
    assert all(type(p) is GM and float(p.amplitude) > 0 for p in model.processes)
    f = np.geomspace(low, high, 4001)
    np.testing.assert_allclose(model.psd(f), BI(0.3).psd(f), rtol=error)


def test_allan_deviation_is_flat_inside_the_band():
    """0.664 B at averaging times inside the band, by a ladder of two a decade: a filter's bias instability."""
    B = 2e-5
    model = flicker_ladder(B, 1e-6, 0.05, 11)
    averaging = 2.0 ** np.arange(6, 15)
    deviation = np.sqrt(2 * np.asarray(model.wavelet_variance(2 * averaging)))
    np.testing.assert_allclose(deviation, np.sqrt(2 * np.log(2) / np.pi) * B, rtol=0.01)


def test_it_is_linear_in_the_variance_and_differentiable():
    slope = jax.grad(lambda B: flicker_ladder(B, 1e-3, 0.1, 3).wavelet_variance([64])[0])(2.0)
    value = flicker_ladder(2.0, 1e-3, 0.1, 3).wavelet_variance([64])[0]
    np.testing.assert_allclose(slope, value, rtol=1e-13)  # d(B^2 c)/dB = B^2 c at B = 2


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.1), (0.1, 0.01), (1e-3, 0.2), (np.nan, 0.1), (0.01, 0.01)])
def test_bands_outside(low, high):
    with pytest.raises(ValueError, match=r"0 < low < high <= 0\.1 cycles per sample"):
        flicker_ladder(1.0, low, high, 4)


def test_refusals():
    with pytest.raises(ValueError, match="num must be an integer of 2 or more"):
        flicker_ladder(1.0, 1e-3, 0.1, 1)
    with pytest.raises(ValueError, match="B must be non-negative"):
        flicker_ladder(-1.0, 1e-3, 0.1, 3)
