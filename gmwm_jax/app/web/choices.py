"""Names to choose from that depend on what is computed."""

from collections.abc import Callable, Sequence

from shiny import reactive, ui


def offer(select: str, names: Callable[[], Sequence[str] | None], chosen: Callable[[], str]) -> None:
    """Keep the choices of a select: it is told of them when they are others, and only then.

    What a page is told undoes what its user has just chosen. Told after each click, an answer to the choice before and
    one to the choice itself follow each other for ever.

    Parameters
    ----------
    select
        Name of the input.
    names
        What there is to choose from; reactive. None while nothing is known.
    chosen
        What stays chosen; asked after the names, without taking a dependency.
    """
    offered: list[str] | None = None

    @reactive.effect
    def _offer() -> None:
        nonlocal offered
        found = names()
        if found is None or list(found) == offered:
            return
        offered = list(found)
        with reactive.isolate():
            ui.update_select(select, choices=offered, selected=chosen())
