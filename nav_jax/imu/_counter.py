"""Normal random numbers by counter: number t of a stream is a function of a key, the stream and t, and of nothing else.

So a time loop draws the noise of a sample when it comes to it, and nothing has to be kept. The hash is Threefry-2x32 of
20 rounds (Salmon et al. 2011), that of `jax.random`, whose own form on a CPU writes every array to memory after every
fourth round. Its two words make two normals (Box and Muller 1958): number t of a stream is a pair.

A pair is one complex number. XLA on a CPU makes a loop of its own for every array and computes in each all that it is
made of: as two arrays, pairs would hash every counter twice, and a time loop on shared gains took 93 ns for a step of a
run in place of 66 (183 and 129 where loops are not compiled as a whole; by the quantile of one word of each hash it was
114 and 181, of which the numbers were 85 and 114). The logarithm is a polynomial, since that of XLA, which takes every
number, cost 9 ns of them, and a series with a quotient 10; its sine and cosine cost 96.

The numbers are of single precision: 24 bits of noise are enough, at half the time. They reach 6.76 sigma, which one
sample in 70 billion exceeds, and 16,000 of the distances from 0 lie beyond 5 sigma.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Complex64, Float32, Key, UInt32

from nav_jax.kinematics.rotation import alternating, horner

_ROTATIONS = ((13, 15, 26, 6), (17, 29, 16, 24))
_PARITY = np.uint32(0x1BD11BDA)

Words = tuple[UInt32[Array, "*#S"], UInt32[Array, "*#S"]]


def counter_keys(keys: Key[Array, " R"]) -> UInt32[Array, "2 R"]:
    """The two words that `normals` takes of each key."""
    return jax.vmap(lambda key: jax.random.bits(key, (2,), dtype=jnp.uint32), out_axes=1)(keys)


def threefry(key: Words, counter: Words) -> Words:
    """Hash a counter of two words with a key of two words."""
    k = (key[0], key[1], key[0] ^ key[1] ^ _PARITY)
    x, y = counter[0] + k[0], counter[1] + k[1]
    for group in range(5):
        for bits in _ROTATIONS[group % 2]:
            x = x + y
            y = x ^ ((y << np.uint32(bits)) | (y >> np.uint32(32 - bits)))
        x, y = x + k[(group + 1) % 3], y + k[(group + 2) % 3] + np.uint32(group + 1)
    return x, y


def normals(
    keys: UInt32[Array, "2 R"], streams: UInt32[np.ndarray, " S"], t: UInt32[Array, ""]
) -> Complex64[Array, "S R"]:
    """Pair number t of several streams of each run: two standard normals, as real and imaginary part.

    Parameters
    ----------
    keys
        See `counter_keys`.
    streams
        Numbers of the streams.
    t
        The counter.
    """
    return gaussians(threefry((keys[0][None], keys[1][None]), (t, jnp.asarray(streams)[:, None])))


@jax.jit
def gaussians(words: Words) -> Complex64[Array, "*S"]:
    """Two independent normals of two random words: one says how far from 0 their point of the plane is, one where.

    There is no sum of two products, of which a compiler could round either one together with the sum; and all is one
    program also where nothing else is, for it rounds products and sums of several programs one by one.
    """
    distance = jnp.sqrt(np.float32(-2.0 * np.log(2.0)) * _log2_uniform(words[0]))
    angle = jax.lax.bitcast_convert_type(words[1], jnp.int32).astype(jnp.float32) * np.float32(np.pi * 2.0**-31)
    square = angle * angle
    return jax.lax.complex(distance * horner(_COSINE, square), distance * angle * horner(_SINE, square))


_COSINE, _SINE = alternating(0, 10), alternating(1, 9)
"""Series in the squared angle, exact to 3e-8 up to pi."""

_LOWEST = np.float32(np.sqrt(0.5))
_LOG2 = tuple(
    np.polynomial.Chebyshev.interpolate(
        lambda x: np.log1p(x) / x / np.log(2.0), 8, domain=[np.sqrt(0.5) - 1, np.sqrt(2) - 1]
    )
    .convert(kind=np.polynomial.Polynomial)
    .coef.tolist()
)
"""Polynomial that is log2(1 + x)/x to 3e-8 of it for sqrt(1/2) <= 1 + x <= sqrt(2)."""


def _log2_uniform(word: UInt32[Array, "*S"]) -> Float32[Array, "*S"]:
    """Binary logarithm of (word + 1/2)/2^32, in which the smallest words, that lead furthest, keep all digits."""
    lowest = _LOWEST.view(np.uint32)
    bits = jax.lax.bitcast_convert_type(word.astype(jnp.float32) + np.float32(0.5), jnp.uint32) - lowest
    # as a power of two times a number in the polynomial's interval
    power = jax.lax.bitcast_convert_type(bits, jnp.int32) >> 23
    x = jax.lax.bitcast_convert_type((bits & np.uint32(0x7FFFFF)) + lowest, jnp.float32) - np.float32(1.0)
    return (power - 32).astype(jnp.float32) + x * horner(_LOG2, x)
