"""How a run ended."""

import enum


class Status(enum.IntEnum):
    """How a run ended."""

    ok = 0
    non_finite = 1
    not_positive = 2

    @property
    def sentence(self) -> str:
        """For a reader."""
        return {
            Status.ok: "finished",
            Status.non_finite: "the state or the covariance became infinite or NaN",
            Status.not_positive: "a variance became negative",
        }[self]
