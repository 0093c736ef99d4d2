"""Many of a kind, some at a time: their rows, their keys, and what is there when the keyboard interrupts."""

from collections.abc import Iterator, Sized
from contextlib import contextmanager
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Int

from gmwm_jax._internal.progress import Bar, Progress, progress_bar


def chunks(num: int, size: int) -> Iterator[tuple[Int[np.ndarray, " size"], int]]:
    """Rows of each chunk, and how many of them count.

    The last chunk is filled up with the last row: a program of another size would be compiled again.
    """
    for first in range(0, num, size):
        yield np.minimum(np.arange(first, first + size), num - 1), min(size, num - first)


def numbered_keys(key: Any, numbers: Any) -> Any:
    """A key for each number: it depends on nothing but the key and the number."""
    return jax.vmap(lambda i: jax.random.fold_in(key, i))(np.asarray(numbers, dtype=np.uint32))


def words_of_key(key: Any) -> tuple[str, tuple[int, ...]]:
    """Kind and words of a key, by which files and other processes know it."""
    return str(jax.random.key_impl(key)), tuple(int(word) for word in np.asarray(jax.random.key_data(key)))


def key_of_words(kind: str, words: tuple[int, ...]) -> Any:
    """The key of `words_of_key`."""
    return jax.random.wrap_key_data(jnp.array(words, jnp.uint32), impl=kind)


def stream_keys(keys: Any, number: Any) -> Any:
    """The stream of one number, which may be traced, from each of many keys."""
    return jax.vmap(lambda key: jax.random.fold_in(key, number))(keys)


@contextmanager
def until_interrupted(done: Sized, total: int, unit: str, progress: Progress) -> Iterator[Bar]:
    """Show progress while `done` grows; an interrupt from the keyboard ends that, unless nothing is done yet.

    Yields
    ------
    The bar, with ``update(n)``.

    Raises
    ------
    KeyboardInterrupt
        It came while `done` was empty.
    """
    bar = progress_bar(total, unit, progress)
    try:
        yield bar
    except KeyboardInterrupt:
        if not len(done):
            raise
    finally:
        bar.close()


def replicate_p_value(statistic: float, replicates: np.ndarray) -> float:
    """Share of the replicates, the data counted in, whose statistic is at least that of the data."""
    return (1 + int((replicates >= statistic).sum())) / (1 + len(replicates))


def replicates_done(num: int, num_requested: int, num_failed: int, by: str) -> str:
    """How many replicates there are and of which kind, how many were asked for, and how many failed."""
    cut = f" of {num_requested} asked for" if num < num_requested else ""
    failed = f"; {num_failed} did not converge and are left out" if num_failed else ""
    return f"{num} replicates{cut} by {by}{failed}"
