"""Results of several channels, by name of the channel: one class for all kinds of result."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import register


@runtime_checkable
class OfChannel(Protocol):
    """A result that belongs to one channel."""

    @classmethod
    def table_of(cls, results: Sequence[Any], /) -> str:
        """Several such results as text, one row a channel."""
        ...


T = TypeVar("T", bound=OfChannel)


class Channels(Mapping[str, T], Drawable, Saved, Generic[T]):
    """Results by name of the channel, or by its number; they print as one table and draw a panel each.

    Parameters
    ----------
    results
        Name of the channel -> its result.
    """

    def __init__(self, results: Mapping[str, T]):
        self._results = dict(results)

    @classmethod
    def of(cls, names: Sequence[str], results: Sequence[T]) -> "Channels[T]":
        """Results in the order of the channels."""
        return cls(dict(zip(names, results, strict=True)))

    def __getitem__(self, channel: str | int) -> T:
        if isinstance(channel, int):
            return list(self._results.values())[channel]
        if channel not in self._results:
            raise KeyError(f"No channel {channel!r}; there are {', '.join(self)}.")
        return self._results[channel]

    def __iter__(self) -> Iterator[str]:
        return iter(self._results)

    def __len__(self) -> int:
        return len(self._results)

    def export(self, format: str, **options: Any) -> str:
        """Return all channels in the format of another filter.

        Parameters
        ----------
        format, **options
            As of `gmwm_jax.Fit.export_of`.

        Raises
        ------
        TypeError
            These are no fits.
        """
        kind: Any = type(self[0])
        if not hasattr(kind, "export_of"):
            raise TypeError(f"Fits are exported, and these are of the class {kind.__name__}.")
        return kind.export_of(list(self.values()), format, **options)

    def __repr__(self) -> str:
        """One row a channel."""
        return type(self[0]).table_of(list(self.values())) if self else "no channels"


class _State(NamedTuple):
    results: Mapping[str, OfChannel]


def _from_state(state: _State) -> Channels[Any]:
    if len({type(r) for r in state.results.values()}) > 1:
        raise ValueError("the results of its channels are of several classes.")
    return Channels(state.results)


register(Channels, _State, lambda channels: _State(dict(channels)), _from_state)
