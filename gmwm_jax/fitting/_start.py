"""Where the search over correlation times looks first.

The objective as a function of the correlation times alone (amplitudes solved for) is smooth, its basins a factor 2 to
10 wide, and one evaluation costs microseconds. So it is evaluated on a lattice: all ways to place the components of a
kind on nodes spread evenly over the logarithm of the correlation times that the record can show.
"""

import itertools
import math

import jax
import numpy as np
from jaxtyping import Float

from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.processes.base import AbstractProcess

_NUM_PLACEMENTS = 1000


def lattice(
    kinds: tuple[type[AbstractProcess], ...], tau_max: float, key: PRNGKey | None = None, *, alike: bool = True
) -> tuple[Float[np.ndarray, "S C"], Float[np.ndarray, "S C"]]:
    """Placements of the components whose shape is free, and nodes at which to try single ones.

    Parameters
    ----------
    kinds
        Class of each of the K components, with C coordinates together; those of one class stand together.
    tau_max
        Largest span of the wavelet variance, in samples.
    key
        Moves every node but those at the ends of a line at random, by up to half the distance to its neighbours; None
        leaves them where they are.
    alike
        Components of a kind may change places: only one of the two ways to place them is needed.

    Returns
    -------
    placements
        Search coordinates, about a thousand rows.
    nodes
        As many rows; the columns of a component have nodes for it.
    """
    if not kinds:
        return np.zeros((1, 0)), np.zeros((1, 0))
    groups = [(kind, len(list(members))) for kind, members in itertools.groupby(kinds)]
    budget = _NUM_PLACEMENTS ** (1 / len(groups))
    choices = []
    for kind, count in groups:
        num = count
        while (math.comb(num + 1, count) if alike else (num + 1) ** count) <= budget:
            num += 1
        at = _nodes(kind, tau_max, num, key)
        choices.append(list(itertools.combinations(at, count) if alike else itertools.product(at, repeat=count)))
    placements = np.array([np.concatenate(sum(parts, ())) for parts in itertools.product(*choices)])
    columns = {kind: _nodes(kind, tau_max, len(placements), key) for kind, _ in groups}
    return placements, np.column_stack([columns[kind] for kind in kinds])


def _nodes(kind: type[AbstractProcess], tau_max: float, num: int, key: PRNGKey | None) -> Float[np.ndarray, "N d"]:
    """Nodes of one component, a row each."""
    nodes = kind.start_nodes(tau_max, num)
    if kind.num_coordinates == 1:
        return np.array(nodes if key is None else _moved(nodes, key))[:, None]
    at = np.array(nodes)
    if key is None:
        return at
    # by half the mean distance between points that fill the box
    gap = np.ptp(at, axis=0) / num ** (1 / kind.num_coordinates)
    return at + gap * np.asarray(jax.random.uniform(key, at.shape, minval=-0.5, maxval=0.5))


def _moved(nodes: tuple[float, ...], key: PRNGKey) -> tuple[float, ...]:
    gaps = np.diff(nodes)
    shift = np.asarray(jax.random.uniform(key, (len(nodes) - 2,), minval=-0.5, maxval=0.5))
    inner = np.array(nodes[1:-1]) + shift * np.minimum(gaps[:-1], gaps[1:])
    return nodes[0], *inner.tolist(), nodes[-1]
