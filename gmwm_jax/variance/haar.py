"""Haar wavelet variance: maximal-overlap (MODWT) and decimated (DWT), with chi-square confidence intervals.

Definition (Percival 1995; Percival & Walden 2000, ch. 8). With S_{j,t} the sum of the 2^j samples that end at t, the
Haar MODWT coefficient of level j, span tau_j = 2^j, is

    W_{j,t} = (S_{j-1,t} - S_{j-1,t-n}) / tau_j,    n = 2^(j-1),    t = tau_j - 1 .. N - 1,

and nu_j^2 is the mean of W_{j,t}^2 over these M_j = N - tau_j + 1 values (none touches the ends: "brick wall"). It is
half the Allan variance at the averaging time n samples. The DWT keeps every 2^j-th of them.

The interval is chi-square with eta_j = max(M_j/2^j, 1) degrees of freedom ("eta 3" of Percival 1995).

Two paths, one definition: `haar_wavelet_variance` is a pure JAX function for vmap, jit and grad;
`gmwm_jax.variance.blocked` computes recordings at memory speed. A test holds them equal.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float
from scipy.special import gammaincinv

from gmwm_jax._internal.checks import as_float, confidence, integer


def default_num_levels(num_samples: int) -> int:
    """J = floor(log2 N) - 1: the largest span is then covered at least twice."""
    return num_samples.bit_length() - 2


def check_num_levels(num_samples: int, num_levels: int | None) -> int:
    """Return the number of levels, or raise ValueError if it is no positive integer or the record is too short."""
    longest = default_num_levels(num_samples)
    if longest < 1:
        raise ValueError(f"A wavelet variance needs at least 4 samples, and the record has {num_samples}.")
    if num_levels is None:
        return longest
    J = integer("num_levels", num_levels, 1)
    if num_samples.bit_length() - 1 < J:
        raise ValueError(
            f"{J} levels need 2^{J} samples or more, and the record has {num_samples}. "
            f"Leave num_levels out for the default, {longest}."
        )
    return J


def scales(num_levels: int) -> Float[np.ndarray, " J"]:
    """tau_j = 2^j samples, j = 1..J."""
    return 2.0 ** np.arange(1, num_levels + 1)


def num_coefficients(num_samples: int, num_levels: int, *, decimated: bool = False) -> Float[np.ndarray, " J"]:
    """M_j: how many coefficients each level averages."""
    tau = scales(num_levels)
    return np.floor(num_samples / tau) if decimated else num_samples - tau + 1


def degrees_of_freedom(num_samples: int, num_levels: int, *, decimated: bool = False) -> Float[np.ndarray, " J"]:
    """eta_j = max(M_j/2^j, 1) for the MODWT; the number of coefficients for the DWT, which hardly correlate."""
    M = num_coefficients(num_samples, num_levels, decimated=decimated)
    return np.maximum(M if decimated else M / scales(num_levels), 1.0)


def interval_factors(
    eta: Float[np.ndarray, "*J"], level: float = 0.95
) -> tuple[Float[np.ndarray, "*J"], Float[np.ndarray, "*J"]]:
    """What a variance with eta degrees of freedom is multiplied by for the ends of its confidence interval.

    Parameters
    ----------
    eta
        Degrees of freedom.
    level
        Confidence, 0.95 unless told otherwise.

    Returns
    -------
    eta/chi2_{(1+level)/2} and eta/chi2_{(1-level)/2}, the factors of the lower and the upper end.
    """
    level = confidence(level)
    # chi2 quantile = 2 gammaincinv(eta/2, p)
    upper, lower = (2 * gammaincinv(eta / 2, p) for p in ((1 + level) / 2, (1 - level) / 2))
    return eta / upper, eta / lower


def haar_wavelet_variance(x: Any, num_levels: int | None = None) -> Float[Array, " J"]:
    """Compute the Haar MODWT wavelet variance of one record, as a pure JAX function.

    Parameters
    ----------
    x
        Record, shape (N,).
    num_levels
        J, by default floor(log2 N) - 1. Static under jit.

    Returns
    -------
    nu_j^2 at the spans 2, 4, .. 2^J samples, in squared units of x.

    Raises
    ------
    ValueError
        The record is too short, or has another shape: vmap over channels.

    Examples
    --------
    >>> gj.variance.haar_wavelet_variance(np.array([1.0, -1.0, 1.0, -1.0]), num_levels=1).tolist()
    [1.0]
    """
    x = one_record(x)
    J = check_num_levels(x.shape[0], num_levels)
    S = x - jnp.mean(x)  # a constant changes no coefficient, and without it the sums stay small
    variances = []
    for j in range(1, J + 1):
        n = 2 ** (j - 1)
        D = S[n:] - S[:-n]
        variances.append(jnp.vdot(D, D) / (4.0**j * D.shape[0]))
        S = S[n:] + S[:-n]
    return jnp.stack(variances)


def one_record(x: Any) -> Float[Array, " N"]:
    """Return a record as an array of floats, or raise a ValueError if it is not one-dimensional."""
    if jnp.ndim(x) != 1:
        raise ValueError(
            f"A record has the shape (N,), and this one {jnp.shape(x)}: use jax.vmap for several channels."
        )
    return as_float(x)


def haar_dwt_variance(x: Any, num_levels: int | None = None) -> Float[Array, " J"]:
    """Compute the Haar DWT wavelet variance, that of `haar_wavelet_variance` from every 2^j-th coefficient only.

    Its expectation is that of the MODWT (R's package wv leaves the factor 2^j in), its variance is larger. Samples
    that fill no whole span at the end are left out.

    Parameters
    ----------
    x
        Record, shape (N,).
    num_levels
        J, by default floor(log2 N) - 1.

    Examples
    --------
    >>> gj.variance.haar_dwt_variance(np.array([1.0, -1.0, 1.0, -1.0]), num_levels=1).tolist()
    [1.0]
    """
    x = one_record(x)
    J = check_num_levels(x.shape[0], num_levels)
    S: Any = x - jnp.mean(x)
    variances = []
    for j in range(1, J + 1):
        even = S[: S.shape[0] // 2 * 2]
        D = even[1::2] - even[::2]
        variances.append(jnp.vdot(D, D) / (4.0**j * D.shape[0]))
        S = even[1::2] + even[::2]
    return jnp.stack(variances)
