"""What a figure shows, as arrays with labels and units and without a library that draws: any of them can draw it."""

from typing import NamedTuple

import numpy as np


class Axis(NamedTuple):
    """One axis of a frame."""

    label: str
    unit: str
    scale: str = "linear"
    """``linear``, ``log``, or ``symlog``: linear around zero and logarithmic beyond."""
    names: tuple[str, ...] = ()
    """Of the whole numbers from 0, where they stand for something."""


class Line(NamedTuple):
    """A line through points in their order."""

    label: str
    x: np.ndarray
    y: np.ndarray


class Points(NamedTuple):
    """Points without a line."""

    label: str
    x: np.ndarray
    y: np.ndarray
    names: tuple[str, ...] = ()
    """Of the points, if they have names."""


class Band(NamedTuple):
    """The area between two curves: an interval of confidence at each x, or one part of a sum."""

    label: str
    x: np.ndarray
    low: np.ndarray
    high: np.ndarray


class Bars(NamedTuple):
    """Points with intervals, of y or, if they lie, of x."""

    label: str
    x: np.ndarray
    y: np.ndarray
    low: np.ndarray
    high: np.ndarray
    lying: bool = False


class Histogram(NamedTuple):
    """Numbers of draws between edges, of which there is one more."""

    label: str
    edges: np.ndarray
    counts: np.ndarray


class Mark(NamedTuple):
    """A line at a value, across the frame."""

    label: str
    at: float
    of: str = "x"
    """The axis that has the value."""


class Span(NamedTuple):
    """An interval, across the frame: an outage, or where a consistent filter lies."""

    label: str
    low: float
    high: float
    of: str = "x"
    """The axis that has the interval."""


Item = Line | Points | Band | Bars | Histogram | Mark | Span


class Frame(NamedTuple):
    """What one pair of axes shows. An item without label has no entry in a legend."""

    title: str
    x: Axis
    y: Axis
    items: tuple[Item, ...]
