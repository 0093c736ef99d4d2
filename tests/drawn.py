"""Compare what a figure shows with the arrays that it says it shows."""

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Rectangle

from gmwm_jax._internal.figure_data import Band, Bars, Histogram, Line, Mark, Points, Span


def assert_shows(figure, frames):
    """Each frame is one pair of axes: its labels, units and scales, all its items, and no other entry of a legend."""
    assert len(figure.axes) == len(frames)
    for ax, frame in zip(figure.axes, frames, strict=True):
        for axis, text, scale in (
            (frame.x, ax.get_xlabel(), ax.get_xscale()),
            (frame.y, ax.get_ylabel(), ax.get_yscale()),
        ):
            unit = axis.unit.replace("^2", "²").replace("^3", "³")
            if text:  # else it stands below another frame
                assert text.replace("\n", " ") == (f"{axis.label} [{unit}]" if unit else axis.label)
            assert scale == axis.scale, text
        assert not frame.x.names
        if frame.y.names:
            rows = [t.get_text() for t in ax.get_yticklabels()] or [t.get_text() for t in ax.texts]
            assert rows == list(frame.y.names)
        assert ax.get_title() == frame.title
        for item in frame.items:
            assert is_drawn(ax, item), (frame.title, item)
        assert set(ax.get_legend_handles_labels()[1]) == {item.label for item in frame.items if item.label}


def is_drawn(ax, item):
    """Whether an artist of the axes has the arrays and the label of an item."""
    artists = [*ax.lines, *ax.collections, *ax.patches, *ax.containers]
    named = [a for a in artists if not item.label or a.get_label() == item.label]
    lines = [a.get_xydata() for a in ax.lines]
    if not named:
        return False
    match item:
        case Line() | Points():
            if isinstance(item, Points) and item.names and [t.get_text() for t in ax.texts] != list(item.names):
                return False
            return any(same(a.get_xydata(), np.transpose(item[1:3])) for a in named if a in ax.lines)
        case Band():
            corners = np.concatenate([np.stack([item.x, end], axis=1) for end in (item.low, item.high)])
            bands = [a.get_paths() for a in named if isinstance(a, PolyCollection)]
            return any(contains(np.concatenate([p.vertices for p in b]), corners) for b in bands if b)
        case Bars():
            centres, at = np.concatenate(lines), (item.y if item.lying else item.x)
            ends = np.stack([at, item.low, item.high], axis=1)
            segments = [s for a in ax.collections if isinstance(a, LineCollection) for s in a.get_segments()]
            drawn = [[*s[0], s[1][0]] if item.lying else [s[0][1], s[0][0], s[1][1]] for s in segments if len(s)]
            drawn = np.array(drawn)[:, [1, 0, 2]]
            return contains(centres, np.stack([item.x, item.y], axis=1)) and contains(drawn, ends)
        case Histogram():
            bars = np.array([p.get_bbox().bounds for p in ax.patches if isinstance(p, Rectangle)])
            return contains(bars[:, [0, 3]], np.stack([item.edges[:-1], item.counts], axis=1))
        case Mark():
            return any(same(xy[:, "xy".index(item.of)], np.full(2, item.at)) for xy in lines if len(xy) == 2)
        case Span():
            boxes = [p.get_bbox().get_points()[:, "xy".index(item.of)] for p in named if isinstance(p, Rectangle)]
            return any(same(box, np.array([item.low, item.high])) for box in boxes)


def same(one, other):
    """Up to rounding; NaN is NaN."""
    return one.shape == other.shape and np.allclose(one.astype(float), other.astype(float), 1e-12, 0, equal_nan=True)


def contains(rows, wanted):
    """Whether each of the wanted rows without NaN is there, up to rounding."""
    wanted = wanted[np.isfinite(wanted).all(axis=1)]
    return all(np.isclose(rows, row, 1e-9, 1e-300).all(axis=1).any() for row in wanted)
