"""Colours, dashes and markers of curves in one frame: told apart without red and green, and none hides another."""

from typing import Any

COLOURS = ("#1f4e79", "#c23b22", "#16a085", "#e69f00", "#c77be0", "#4c2c12", "#3f7fe0")
"""In their order; any two differ for an eye without green receptors too."""

DASHES = (
    (0, (5, 2)),
    (0, (1, 1.4)),
    (0, (7, 2, 1.2, 2)),
    (0, (11, 3)),
    (0, (4, 1.5, 1.2, 1.5, 1.2, 1.5)),
    (0, (2.5, 2.5)),
)
"""Of parts of a sum, where colour alone would not tell them apart."""

MARKERS = ("o", "x", "^", "+", "s", "v", "D")

_TURNS, _DASH = 4, 3.0
"""So many curves share the way before they become thinner; the length of a dash in widths of the line."""


def turns(index: int, num: int) -> dict[str, Any]:
    """Style of one of some curves that may coincide: the first is solid, the others take turns on it with dashes.

    Parameters
    ----------
    index
        Of the curve, in the order in which they are drawn.
    num
        Of curves.
    """
    count = min(num, _TURNS)
    turn, layer = index % count, index // count
    style: dict[str, Any] = {"color": COLOURS[index % len(COLOURS)], "lw": 1.7 / (1 + 0.7 * layer)}
    if turn:
        style["ls"] = ((count - turn) * _DASH, (_DASH, (count - 1) * _DASH))
    return style


def nested(index: int, num: int) -> dict[str, Any]:
    """Style of one of some solid curves that may coincide: each is thinner than those below it."""
    return {"color": COLOURS[index % len(COLOURS)], "lw": 1.3 + min(1.2, 4.0 / max(num - 1, 1)) * (num - 1 - index)}


def marked(index: int) -> dict[str, Any]:
    """Style of one of some sets of points that may coincide: hollow markers of different shapes."""
    return {"color": COLOURS[index % len(COLOURS)], "marker": MARKERS[index % len(MARKERS)], "mfc": "none", "ls": ""}
