"""Looks of a rule of stopping at the runs of one scenario of a store, from its first chunk on.

A decision is a function of the rule and of the numbers in the store: whoever asks later gets the same one.
"""

import numpy as np

from nav_jax.campaign.store import Store
from nav_jax.campaign.tasks import Bench
from nav_jax.filter.status import Status
from nav_jax.simulation.stopping import Rule, Stopped, Watch


class Looks:
    """What a rule has seen of a scenario. Looks are at whole chunks.

    Parameters
    ----------
    store
        Of the campaign.
    bench
        The scenario, prepared.
    scenario
        Its name.
    rule
        By which it stops.
    """

    def __init__(self, store: Store, bench: Bench, scenario: str, rule: Rule):
        self._store, self._scenario, self._size = store, scenario, bench.definition.chunk_size
        template = next(iter(bench.templates.values()))
        self._models = tuple(bench.templates)
        most = store.num_chunks * self._size
        self._watch = Watch(rule, most, float(template.time[bench.epoch]), whole=self._size)
        self._error: list[np.ndarray] = []
        self._status: list[np.ndarray] = []

    @property
    def next_chunks(self) -> int:
        """Number of chunks, from the first on, that the next look takes."""
        return self._watch.next // self._size

    def look(self) -> Stopped | None:
        """Read the chunks that follow those that were read, look after each, and say how the runs have ended.

        None where they have not: a chunk that a look takes is not there.
        """
        while (ended := self._watch.ended) is None:
            arrays = self._store.read(self._scenario, len(self._status))
            if arrays is None:
                return None
            self._error.append(arrays["error"][..., :3])
            self._status.append(arrays["status"])
            if len(self._status) == self.next_chunks:
                error, status = np.concatenate(self._error), np.concatenate(self._status)
                self._watch.look(
                    len(status),
                    {name: error[:, i] for i, name in enumerate(self._models)},
                    {name: status[:, i] == Status.ok for i, name in enumerate(self._models)},
                )
        return ended
