"""Results of several channels, by name of the channel: one class for all kinds of result."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.labelled import UNIT_OF_CHANNEL, Labelled, import_pandas
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import register
from gmwm_jax._internal.stores import import_xarray

if TYPE_CHECKING:
    import pandas
    import xarray


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

    def plot(self, *, datasheet: Any = None, axes: GivenAxes | None = None) -> Figure:
        """Draw a panel for each channel.

        Parameters
        ----------
        datasheet
            Of fits only: a model of what the datasheet promises; by unit if there are several, as
            ``{"rad/s": ..., "m/s^2": ...}``.
        axes
            The Axes to draw into, as many as a new figure has; a new figure if left out.

        Returns
        -------
        Figure
            See `gmwm_jax.plotting.plot_fits`, `plot_selections`, `plot_joint_fits`, `plot_cross_validations`.
        """
        return self._draw(axes=axes) if datasheet is None else self._draw(datasheet=datasheet, axes=axes)

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

    def to_xarray(self) -> "xarray.Dataset":
        """All channels as one Dataset along `channel`, with the units of each; needs the extra ``io``.

        Raises
        ------
        TypeError
            The results have none.
        """
        xarray = import_xarray()
        each = [r.to_xarray() for r in self._labelled()]
        joined = xarray.concat(
            each, "channel", coords="different", compat="equals", join="outer", combine_attrs="drop_conflicts"
        )
        for name, variable in joined.data_vars.items():
            if "units" in each[0][name].attrs and "units" not in variable.attrs:  # they differ
                variable.attrs["units"] = UNIT_OF_CHANNEL
        return joined.assign_coords(channel=list(self))

    def to_pandas(self) -> "pandas.DataFrame":
        """The tables of all channels below each other, in the units of `to_xarray`; needs the extra ``io``.

        Raises
        ------
        TypeError
            The results have none.
        """
        tables = {name: r.to_pandas() for name, r in zip(self, self._labelled(), strict=True)}
        return import_pandas().concat(tables, names=["channel"])

    def _labelled(self) -> list[Labelled]:
        if not self or not isinstance(self[0], Labelled):
            raise TypeError(f"{type(self[0]).__name__ if self else 'Nothing'} has no table for pandas or xarray.")
        return list(self.values())  # type: ignore[arg-type]

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
