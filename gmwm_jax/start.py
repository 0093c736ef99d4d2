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

from gmwm_jax._typing import PRNGKey
from gmwm_jax.processes._base import AbstractProcess

_NUM_PLACEMENTS = 1000


def lattice(
    kinds: tuple[type[AbstractProcess], ...], tau_max: float, key: PRNGKey | None = None
) -> tuple[Float[np.ndarray, "S K"], Float[np.ndarray, "S K"]]:
    """Placements of the components whose shape is free, and nodes at which to try single ones.

    Parameters
    ----------
    kinds
        Class of each of the K components; those of one class stand together.
    tau_max
        Largest span of the wavelet variance, in samples.
    key
        Moves every coordinate at random by up to half the distance of the nodes; None leaves them where they are.

    Returns
    -------
    placements
        Search coordinates, about a thousand rows.
    nodes
        As many rows; column k has nodes for component k.
    """
    if not kinds:
        return np.zeros((1, 0)), np.zeros((1, 0))
    groups = [(kind, len(list(members))) for kind, members in itertools.groupby(kinds)]
    budget = _NUM_PLACEMENTS ** (1 / len(groups))
    choices, spacings = [], []
    for kind, count in groups:
        num = count
        while math.comb(num + 1, count) <= budget:
            num += 1
        at = kind.start_nodes(tau_max, num)
        choices.append(list(itertools.combinations(at, count)))
        spacings += [float(np.mean(np.diff(at))) if num > 1 else 1.0] * count
    placements = np.array([sum(parts, ()) for parts in itertools.product(*choices)])
    nodes = np.column_stack([kind.start_nodes(tau_max, len(placements)) for kind in kinds])
    if key is not None:
        shift = np.asarray(jax.random.uniform(key, (2, *placements.shape), minval=-0.5, maxval=0.5))
        placements = placements + shift[0] * np.array(spacings)
        nodes = nodes + shift[1] * (nodes[1:2] - nodes[:1] if len(nodes) > 1 else 1.0)
    return placements, nodes
