"""What a function that is documented as pure must bear: jit of vmap of grad, and the values that it has without."""

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
    x = np.asarray(x, dtype=float)
    steps = _STEP * np.diag(x)
    rows = np.concatenate([x * np.array([[1.0], [1.01], [0.98]]), x + steps, x - steps])
    plain = np.stack([function(jnp.asarray(row)) for row in rows[:3]])
    scale = np.abs(plain[0]).max()
    mix = np.random.default_rng(0).normal(size=plain[0].shape) / scale  # one number that each entry moves

    def mixed(row):
        value = function(row)
        return jnp.sum(mix * value), value

    # all three in one program, most of whose time is its compilation
    (mixture, values), slopes = jax.jit(jax.vmap(jax.value_and_grad(mixed, has_aux=True)))(rows)
    np.testing.assert_allclose(values[:3], plain, rtol=1e-9, atol=1e-12 * scale)
    slope = np.asarray(slopes[0]) * x
    above, below = np.split(np.asarray(mixture)[3:], 2)
    assert np.any(slope != 0)
    np.testing.assert_allclose(slope, (above - below) / (2 * _STEP), atol=rtol * np.abs(slope).max(), rtol=0)
