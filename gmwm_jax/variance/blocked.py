"""Haar MODWT wavelet variance of long recordings on the host, at memory speed, in or out of memory.

XLA on a CPU walks the whole record once or twice a level; here each sample is fetched from memory twice in all.

*Fine levels*, span up to 2^m: the record is taken in blocks that fit the cache, each with the 2^m - 1 samples before
it, and all m levels are worked off inside the block. The running sums S_m are kept.

*Coarse levels*: they combine S_m only at distances that are multiples of 2^m. Written as a matrix of 2^m columns, row
by row, S_m falls apart into independent columns; a slab of columns that fits the cache is worked off for all levels.

S_m lives in memory or, for records that do not fit, in a scratch file; the record itself may be an array, a memory map
or any iterable of blocks. All ways run the same operations.
"""

import os
import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np
from jaxtyping import Float, Shaped

from gmwm_jax._internal.checks import finite_record
from gmwm_jax._internal.cores import num_threads
from gmwm_jax.variance.haar import check_num_levels

_FINE_LEVELS = 10
_BLOCK = 1 << 15
"""Samples in a block or slab: 256 kB, so that three buffers stay in the second-level cache."""


def host_wavelet_variance(
    x: Shaped[np.ndarray, " N"],
    num_levels: int | None = None,
    *,
    scratch: str | os.PathLike | None = None,
    name: str = "the record",
) -> Float[np.ndarray, " J"]:
    """Haar MODWT wavelet variance of an array or memory map.

    Parameters
    ----------
    x
        Record of N samples; a `numpy.memmap` is read block by block.
    num_levels
        J, by default floor(log2 N) - 1.
    scratch
        A folder for a temporary file of 8 N bytes, which then takes the place of as much memory.
    name
        Of the record, for messages.

    Returns
    -------
    nu_j^2 at the spans 2, 4, .. 2^J.

    Raises
    ------
    ValueError
        Too short, or NaN or inf in the record.
    """
    num = x.shape[0]
    J = check_num_levels(num, num_levels)
    m = min(J, _FINE_LEVELS)
    origin = float(np.mean(x[:_BLOCK]))  # a constant changes no coefficient; without it the sums stay small
    if not np.isfinite(origin):
        finite_record(np.asarray(x), name)
    # Blocks do not depend on each other, and NumPy leaves the interpreter lock: one thread a core.
    workers = num_threads()
    with working_array(num, scratch) as S, ThreadPoolExecutor(workers) as pool:
        starts = range(0, num, _BLOCK)
        shares = [starts[w::workers] for w in range(workers)]
        energy = sum(pool.map(lambda share: _fine_levels(x, share, origin, m, S), shares))
        if m < J:
            width = max(_BLOCK * (1 << m) // num, 8)
            firsts = range(0, 1 << m, width)
            shares = [firsts[w::workers] for w in range(workers)]
            coarse = sum(pool.map(lambda share: _coarse_levels(S, share, width, m, J), shares))
            energy = np.concatenate([energy, coarse])
    if not np.all(np.isfinite(energy)):
        finite_record(np.asarray(x), name)
        raise ValueError(f"The squares of {name} are beyond floating point: take other units, or scale the data.")
    j = np.arange(1, J + 1)
    return energy / (4.0**j * (num - 2.0**j + 1))


def blocks_to_file(blocks: Iterable[np.ndarray], file: str | os.PathLike) -> np.memmap:
    """Write an iterable of one-dimensional blocks to a raw float64 file and map it.

    Raises
    ------
    ValueError
        A block that is not one-dimensional or holds no real numbers; none at all.
    """
    num = 0
    with open(file, "wb") as out:
        for i, block in enumerate(blocks):
            block = np.asarray(block)
            if block.ndim != 1 or block.dtype.kind not in "fiu":
                raise ValueError(
                    f"Block {i} has the shape {block.shape} and the dtype {block.dtype}; blocks of one channel are "
                    "one-dimensional and hold real numbers."
                )
            block = np.ascontiguousarray(block, dtype=np.float64)
            block.tofile(out)
            num += block.size
    if num == 0:
        raise ValueError("The record is empty: no block, or only empty ones.")
    return np.memmap(file, dtype=np.float64, mode="r", shape=(num,))


@contextmanager
def working_array(num: int, scratch: str | os.PathLike | None) -> Iterator[Float[np.ndarray, " N"]]:
    """`num` floats, in memory or, if a folder is named, in a temporary file of 8 `num` bytes there."""
    if scratch is None:
        yield np.empty(num)
        return
    with tempfile.TemporaryDirectory(dir=scratch) as folder:
        S = np.memmap(os.path.join(folder, "working.f64"), dtype=np.float64, mode="w+", shape=(num,))
        yield S
        del S


@np.errstate(invalid="ignore", over="ignore")  # inf - inf: the caller names the sample
def _fine_levels(
    x: np.ndarray, starts: Iterable[int], origin: float, m: int, S_m: np.ndarray
) -> Float[np.ndarray, " fine"]:
    """Energies of levels 1..m of the coefficients that end in the blocks; their sums S_m are stored."""
    before = (1 << m) - 1
    buffers = np.empty((3, _BLOCK + before))
    energy = np.zeros(m)
    for start in starts:
        stop = min(start + _BLOCK, x.shape[0])
        first = max(start - before, 0)
        S = np.subtract(x[first:stop], origin, out=buffers[0, : stop - first], dtype=np.float64)
        for j in range(m):
            n = 1 << j
            if n >= S.size:  # only in a first block that is shorter than the span
                S = S[:0]
                break
            # the last entry of S always ends at stop - 1; coefficients of this block are its last ones
            own = max(S.size - n - (stop - start), 0)
            D = np.subtract(S[n + own :], S[own:-n], out=buffers[2, : S.size - n - own])
            energy[j] += _energy(D)
            S = np.add(S[n:], S[:-n], out=buffers[(j + 1) % 2, : S.size - n])
        kept = S[-(stop - start) :]
        S_m[start : stop - kept.size] = 0.0
        S_m[stop - kept.size : stop] = kept
    return energy


@np.errstate(invalid="ignore", over="ignore")  # inf - inf: the caller names the sample
def _coarse_levels(S_m: np.ndarray, firsts: Iterable[int], width: int, m: int, J: int) -> Float[np.ndarray, " coarse"]:
    """Energies of levels m+1..J from the sums S_m, by slabs of columns first <= t mod 2^m < first + width."""
    period = 1 << m
    rows = S_m.shape[0] // period
    matrix, last_row = S_m[: rows * period].reshape(rows, period), S_m[rows * period :]
    buffers = np.empty((3, (rows + 1) * width))
    energy = np.zeros(J - m)
    for first in firsts:
        body, tail = matrix[:, first : first + width], last_row[first : first + width]
        columns = body.shape[1]
        S = buffers[0, : rows * columns + tail.size]
        S[: rows * columns].reshape(rows, columns)[:] = body
        S[rows * columns :] = tail
        # S_m is complete from t = 2^m - 1 on: of the first row only the very last column
        incomplete = columns - 1 if first + columns == period else columns
        for i in range(J - m):
            shift = columns << i
            D = np.subtract(S[shift:], S[:-shift], out=buffers[2, : S.size - shift])[incomplete:]
            energy[i] += _energy(D)
            S = np.add(S[shift:], S[:-shift], out=buffers[(i + 1) % 2, : S.size - shift])
    return energy


def _energy(D: np.ndarray) -> float:
    """Sum of squares, in pieces too short for BLAS to wake its own threads, which would fight with ours."""
    return sum((float(np.dot(D[i : i + 8192], D[i : i + 8192])) for i in range(0, D.size, 8192)), 0.0)
