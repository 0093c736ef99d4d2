"""The cosine integral Ci(x) = gamma + log(x) + int_0^x (cos t - 1)/t dt, which JAX does not have.

A power series up to 4; beyond it the continued fraction of the exponential integral (Abramowitz & Stegun 1964, 5.1.22),

    exp(ix) E_1(ix) = 1/(1 + ix - 1/(3 + ix - 4/(5 + ix - ..))) = g - i f,    Ci = f sin - g cos.
"""

import math

import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float

_SWITCH = 4.0
_NUM_TERMS = 18
_NUM_FRACTIONS = 60


@jax.custom_jvp
def cosine_integral(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Ci(x) for x > 0, to 1e-14 or 15 digits."""
    small = x < _SWITCH
    y = jnp.where(small, x, 1.0)
    total = jnp.zeros_like(y)
    for k in reversed(range(1, _NUM_TERMS)):
        total = total * y * y + (-1) ** k / (2 * k * math.factorial(2 * k))
    series = jnp.euler_gamma + jnp.log(y) + y * y * total
    f, g = _auxiliary(jnp.where(small, _SWITCH, x))
    return jnp.where(small, series, f * jnp.sin(x) - g * jnp.cos(x))


@cosine_integral.defjvp
def _cosine_integral_jvp(primals, tangents):
    (x,), (dx,) = primals, tangents
    return cosine_integral(x), jnp.cos(x) / x * dx


def _auxiliary(x: Float[Array, "..."]) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """f(x) and g(x), see the file, for x >= 4."""
    ix = lax.complex(jnp.zeros_like(x), x)

    def step(i: Array, tail: Array) -> Array:
        k = (_NUM_FRACTIONS - i).astype(x.dtype)
        return lax.complex(2 * k - 1, 0 * k) + ix - lax.complex(k * k, 0 * k) / tail

    last = lax.complex(jnp.full_like(x, 2.0 * _NUM_FRACTIONS + 1), x)
    value = 1 / lax.fori_loop(0, _NUM_FRACTIONS, step, last)
    return -value.imag, value.real
