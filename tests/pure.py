"""What a function that is documented as pure must bear: jit, vmap and grad, and the values that it has without."""

import re

import jax
import jax.numpy as jnp
import numpy as np

_ROW = re.compile(r"^\| `([\w.]+)` \|", re.MULTILINE)
_STEP = 1e-4


def documented(package):
    """Names in the table of pure functions of a package."""
    return _ROW.findall(package.__doc__)


def found(package, name):
    """What a name in the table stands for."""
    for part in name.split("."):
        package = getattr(package, part)
    return package


def assert_pure(function, x, *, rtol=1e-6):
    """Walk a function of one vector.

    Parameters
    ----------
    function
        From (P,) to an array.
    x
        Where to look; no entry is zero.
    rtol
        Of a derivative against a central difference over 1e-4 of each entry, whose error is the square of that times
        the third derivative, and of the largest derivative.
    """
    x = jnp.asarray(x, dtype=float)
    jitted = jax.jit(function)
    value = np.asarray(jitted(x))
    scale = np.abs(value).max()
    np.testing.assert_allclose(value, function(x), rtol=1e-9, atol=1e-12 * scale)
    several = x[None] * jnp.array([[1.0], [1.01], [0.98]])
    together, loop = jax.jit(jax.vmap(function))(several), np.stack([jitted(one) for one in several])
    np.testing.assert_allclose(together, loop, rtol=1e-9, atol=1e-12 * scale)

    mix = np.random.default_rng(0).normal(size=value.shape) / scale  # one number that each entry moves
    slope = np.asarray(jax.jit(jax.grad(lambda x: jnp.sum(mix * function(x))))(x)) * x
    differences = np.zeros(len(x))
    for k in range(len(x)):
        d = np.zeros(len(x))
        d[k] = _STEP * float(x[k])
        differences[k] = np.sum(mix * (np.asarray(jitted(x + d)) - np.asarray(jitted(x - d)))) / (2 * _STEP)
    assert np.any(slope != 0)
    np.testing.assert_allclose(slope, differences, atol=rtol * np.abs(slope).max(), rtol=0)
