"""Integrals of a spectrum against sines and cosines of any frequency, by weights that the spectrum is multiplied with.

The band (0, 1/2] is cut into panels that halve in width towards 0 and, less far, towards 1/2, with Gauss's nodes in
each. A panel in which a cosine turns by few radians is summed as it is; in the others the spectrum is expanded in
Legendre polynomials, whose integrals against a wave are spherical Bessel functions (Bakhvalov & Vasil'eva 1968),

    int_-1^1 P_k(x) exp(i w x) dx = 2 i^k j_k(w),

so that what is resolved is the spectrum, however fast the wave. Below 2^-28 cycles per sample no filter that fits into
a record has a whole turn, and panels of four octaves in log(f) go on to 2^-64. With half spans n = tau/2 (see `haar`)

    nu^2(tau) = 2 int_0^1/2 S(f) sin(pi f n)^4/(n sin(pi f))^2 df,
    gamma(0) - gamma(h) = 4 int_0^1/2 S(f) sin(pi f h)^2 df.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Float

from gmwm_jax.processes._maths.by_lags import lattice

_NODES = 16
_LOWEST_OCTAVE = 28
_HIGHEST_OCTAVE = 8
"""Towards 1/2."""
_BELOW = 9
"""Panels of four octaves below."""
_FEW_RADIANS = 10.0
"""Half of what a wave turns in a panel: up to it Gauss's rule, beyond it the upward recurrence of Bessel functions."""


class Panels(NamedTuple):
    """Where a spectrum is looked at, (B, Q), and the panels, (B,)."""

    frequency: Any
    weight: Any
    """Of Gauss's rule in f."""
    centre: Any
    half: Any
    """Half the width; 0 for those in the logarithm, which no wave turns in."""


@lru_cache
def panels(resolution: int = 1) -> Panels:
    """Two panels an octave, or a multiple of that."""
    x, w = np.polynomial.legendre.leggauss(_NODES)
    steps = 1 + np.arange(2 * resolution) / (2 * resolution)
    up = (0.5 ** np.arange(_LOWEST_OCTAVE, 2.0, -1)[:, None] * steps).ravel()
    down = (0.5 ** np.arange(_HIGHEST_OCTAVE, 2.0, -1)[:, None] * steps).ravel()
    edges = np.concatenate([up, [0.25], 0.5 - down[::-1], [0.5]])[::-1]
    centre, half = (edges[1:] + edges[:-1]) / 2, (edges[:-1] - edges[1:]) / 2
    inside = centre[:, None] + half[:, None] * x
    bottom = 2.0 ** (-_LOWEST_OCTAVE - 4 * np.arange(1, _BELOW + 1))
    far_below = bottom[:, None] * 2 ** (2 * (1 + x))
    zero = np.zeros(_BELOW)
    return Panels(
        np.concatenate([inside, far_below]),
        np.concatenate([half[:, None] * w, 2 * np.log(2) * w * far_below]),
        np.concatenate([centre, zero]),
        np.concatenate([half, zero]),
    )


@lru_cache
def _legendre() -> Float[np.ndarray, "K Q"]:
    """From the values at the nodes, times the weights: (2k + 1) P_k(x_q)."""
    x, _ = np.polynomial.legendre.leggauss(_NODES)
    return np.stack([(2 * k + 1) * np.polynomial.legendre.Legendre.basis(k)(x) for k in range(_NODES)])


def _cosine(p: Panels, m: Any, xp: Any) -> Any:
    """Weights (M, B, Q) of int G(f) cos(2 pi f m) df for m >= 0, (M,)."""
    m = m[:, None]
    turn = 2 * np.pi * m * p.half[None]
    many = turn > _FEW_RADIANS
    w = xp.where(many, turn, _FEW_RADIANS)
    # of the wave at the centre, without the whole turns
    phase = m * p.centre[None]
    phase = 2 * np.pi * (phase - xp.floor(phase))
    cosine, sine = xp.cos(phase), xp.sin(phase)
    before, bessel = xp.sin(w) / w, (xp.sin(w) / w - xp.cos(w)) / w
    terms = [before * cosine]
    for k in range(1, _NODES):  # i^k = 1, i, -1, -i
        terms.append(bessel * (-sine, -cosine, sine, cosine)[(k - 1) % 4])
        before, bessel = bessel, (2 * k + 1) / w * bessel - before
    waves = xp.stack(terms, axis=-1) @ _legendre() * p.weight[None]
    few = p.weight[None] * xp.cos(2 * np.pi * xp.where(many, 0.0, m)[..., None] * p.frequency[None])
    return xp.where(many[..., None], waves, few)


def wavelet_variance(p: Panels, spectrum: Float[Array, "B Q"], tau: Float[Array, "*J"]) -> Float[Array, "*J"]:
    """Haar wavelet variance at even spans."""
    n = lax.optimization_barrier(tau.ravel() / 2)  # known spans would be folded into constants, slowly
    few = 4 * np.pi * n[:, None] * p.half[None] <= _FEW_RADIANS
    safe = jnp.where(few, n[:, None], 0.0)[..., None]
    slow = p.weight[None] * jnp.sin(np.pi * p.frequency[None] * safe) ** 4
    fast = (3 * p.weight[None] - 4 * _cosine(p, n, jnp) + _cosine(p, 2 * n, jnp)) / 8
    weights = jnp.where(few[..., None], slow, fast) * (2 / np.sin(np.pi * p.frequency) ** 2)[None]
    return (jnp.einsum("jbq,bq->j", weights, spectrum) / (n * n)).reshape(tau.shape)


def structure(resolution: int, spectrum: Float[Array, "B Q"]) -> Float[Array, " L"]:
    """gamma(0) - gamma(h) at the lags of `by_lags.lattice`."""
    return jnp.asarray(_structure_weights(resolution)) @ spectrum.ravel()


@lru_cache
def _structure_weights(resolution: int) -> Float[np.ndarray, "L F"]:
    p, lag = panels(resolution), lattice(resolution).lags
    few = 2 * np.pi * lag[:, None] * p.half <= _FEW_RADIANS
    slow = 4 * p.weight * np.sin(np.pi * p.frequency * np.where(few, lag[:, None], 0.0)[..., None]) ** 2
    return np.where(few[..., None], slow, 2 * (p.weight - _cosine(p, lag, np))).reshape(len(lag), -1)


def variance(p: Panels, spectrum: Float[Array, "B Q"]) -> Float[Array, ""]:
    """gamma(0), with what a power of frequency leaves below the last panel; infinite where there is no end to it."""
    parts = 2 * jnp.sum(p.weight * spectrum, axis=1)
    ratio = parts[-1] / jnp.where(parts[-2] > 0, parts[-2], 1.0)
    rest = jnp.where(ratio < 1, parts[-1] * ratio / jnp.where(ratio < 1, 1 - ratio, 1.0), jnp.inf)
    return jnp.sum(parts) + rest
