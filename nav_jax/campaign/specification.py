"""What defines a campaign: all that its numbers depend on, apart from how many there are.

The size of a chunk is part of it, since another size is another program, whose results differ in their last bits. The
number of runs is not: a campaign is continued.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gmwm_jax._internal.chunks import key_of_words
from gmwm_jax._internal.states import saved
from nav_jax.filter.scenario import Scenario
from nav_jax.imu.errors import ImuErrors

NUMBERS = 2
"""Version of the numbers that a definition stands for. Who changes what the runs of a key are, be it the random numbers
(`nav_jax.imu._counter`), what they are for or what is made of them, raises it: no store has numbers of two kinds."""


@saved()
@dataclass(frozen=True, eq=False)
class Definition:
    """All that the numbers of a campaign depend on, apart from how many there are.

    Attributes
    ----------
    scenarios, filters
        By name.
    truth
        Errors of the IMU that are emulated.
    key_kind, key_data
        Of the random numbers.
    chunk_size, keep, gains
        See `Campaign`.
    """

    scenarios: Mapping[str, Scenario]
    truth: ImuErrors
    filters: Mapping[str, ImuErrors]
    key_kind: str
    key_data: tuple[int, ...]
    chunk_size: int
    keep: str
    gains: str

    @property
    def key(self) -> Any:
        """The key of the campaign, from which each run has its own."""
        return key_of_words(self.key_kind, self.key_data)
