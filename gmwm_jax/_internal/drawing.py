"""Results draw themselves and know no figures: the one place from which figures are imported, when one is asked for."""

import functools
import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Drawable:
    """A result that has a figure: `plot` looks it up among those of the result's package."""

    __slots__ = ()

    def plot(self, **options: Any) -> "Figure":
        """Draw this result.

        Parameters
        ----------
        **options
            Those of the function that draws results of this class: for a `Fit` they are those of
            `gmwm_jax.plotting.plot_fit`, for a `Comparison` those of `nav_jax.plotting.plot_comparison`. All take
            ``axes=``, the Axes to draw into; without it a new figure is made.

        Returns
        -------
        Figure
            A figure of Matplotlib that pyplot does not know of: a notebook shows it, ``savefig`` writes it.
        """
        # a user's subclass lives elsewhere; its figure is that of the class that it extends
        own = next(c for c in type(self).__mro__ if Drawable in c.__bases__)
        return importlib.import_module(f"{own.__module__.partition('.')[0]}.plotting").draw(self, **options)


def registry(package: str) -> "functools._SingleDispatchCallable[Figure]":
    """Make the function ``draw(result, **options)`` of a package, at which its figures register by class of result."""

    def draw(result: Any, **options: Any) -> "Figure":
        known = sorted(c.__name__ for c in dispatch.registry if c is not object)
        raise TypeError(f"{package} has no figure of a {type(result).__name__}, only of {', '.join(known)}.")

    dispatch = functools.singledispatch(draw)
    return dispatch
