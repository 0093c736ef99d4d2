"""Where the search over correlation times starts.

The objective as a function of the correlation times alone (amplitudes solved for) is smooth, and its basins are wide:
half a decade or more. Starts are therefore all ways to place the components of a kind on a few nodes spread evenly
over the logarithm of the correlation times that the record can show.
"""

import itertools
import math

import jax
import numpy as np
from jaxtyping import Float

from gmwm_jax._typing import PRNGKey
from gmwm_jax.processes._base import AbstractProcess

_MAX_STARTS = 60
_NODES_ALONE = 20
"""Nodes where one component is searched for; fewer for several, so that their combinations stay below the maximum."""


def start_coordinates(
    kinds: tuple[type[AbstractProcess], ...], tau_max: float, key: PRNGKey | None = None
) -> Float[np.ndarray, "S K"]:
    """Starting points in the search coordinates of the components whose shape is free.

    Parameters
    ----------
    kinds
        Class of each of the K components; those of one class stand together.
    tau_max
        Largest span of the wavelet variance, in samples.
    key
        Moves every coordinate at random by up to one (a factor e in the correlation time); None: as they are.
    """
    groups = [(kind, len(list(members))) for kind, members in itertools.groupby(kinds)]
    budget = _MAX_STARTS ** (1 / max(len(groups), 1))
    choices = []
    for kind, count in groups:
        num = _NODES_ALONE
        while num > count and math.comb(num, count) > budget:
            num -= 1
        choices.append(list(itertools.combinations(kind.start_nodes(tau_max, num), count)))
    placements = [sum(parts, ()) for parts in itertools.product(*choices)]
    starts = np.array(placements).reshape(len(placements), len(kinds))
    if key is None:
        return starts
    return starts + np.asarray(jax.random.uniform(key, starts.shape, minval=-1.0, maxval=1.0))
