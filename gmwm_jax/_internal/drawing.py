"""Results draw themselves and know no figures: the one place from which figures are imported, when one is asked for."""

import functools
import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    import matplotlib.figure
    import numpy as np
    from matplotlib.axes import Axes

    Figure = matplotlib.figure.Figure
    GivenAxes = Axes | Sequence[Axes] | np.ndarray
    """Where to draw: an Axes for each frame of the figure, in reading order."""
else:  # Matplotlib is imported when a figure is asked for, not by those who look at annotations
    Figure = GivenAxes = Any


class Drawable:
    """A result that has a figure: `plot` looks it up among those of the result's package.

    A class whose figure has options states them, with their defaults, in a `plot` of its own.
    """

    __slots__ = ()

    def plot(self, *, axes: GivenAxes | None = None) -> Figure:
        """Draw this result.

        Parameters
        ----------
        axes
            The Axes to draw into, one for each frame in reading order; a new figure if left out.

        Returns
        -------
        Figure
            A figure of Matplotlib that pyplot does not know of: a notebook shows it, ``savefig`` writes it.
        """
        return self._draw(axes=axes)

    def _draw(self, **options: Any) -> Figure:
        """By the function that the package has registered for the class."""
        # a user's subclass lives elsewhere; its figure is that of the class that it extends
        own = next(c for c in type(self).__mro__ if Drawable in c.__bases__)
        return importlib.import_module(f"{own.__module__.partition('.')[0]}.plotting").draw(self, **options)


def registry(package: str) -> "functools._SingleDispatchCallable[Figure]":
    """Make the function ``draw(result, **options)`` of a package, at which its figures register by class of result."""

    def draw(result: Any, **options: Any) -> Figure:
        known = sorted(c.__name__ for c in dispatch.registry if c is not object)
        raise TypeError(f"{package} has no figure of a {type(result).__name__}, only of {', '.join(known)}.")

    dispatch = functools.singledispatch(draw)
    return dispatch
