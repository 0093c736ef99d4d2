"""The figure of a trajectory."""

import numpy as np
from matplotlib.figure import Figure

from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Frame, Line, Points
from gmwm_jax._internal.figures import describe, frames, legend_below, new_figure, put, put_in_turns
from gmwm_jax._internal.palette import COLOURS
from nav_jax.plotting._style import DEGREES, TIME, draw, grid, height_frame, plan_and_height, plan_frame
from nav_jax.trajectory.trajectory import Trajectory

_FLAT = 1.0
"""m: less than this between lowest and highest is drawn as level."""


def trajectory_data(trajectory: Trajectory, *, attitude: bool = True) -> tuple[Frame, ...]:
    """Return what `plot_trajectory` shows: plan, height and attitude.

    Parameters
    ----------
    trajectory
        What to draw.
    attitude
        Whether roll, pitch and yaw are drawn too.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> frames = nj.plotting.trajectory_data(reference)
    """
    north, east, down = trajectory.position.T
    way = Line("", east, north), Points("start", east[:1], north[:1])
    plan = plan_frame(way, f"{trajectory.name or 'trajectory'}: plan")
    height = height_frame([Line("", trajectory.time, -down)])
    angles = zip(("roll", "pitch", "yaw"), trajectory.euler.T, strict=True)
    turns = tuple(Line(name, trajectory.time, DEGREES * angle) for name, angle in angles)
    return (plan, height, Frame("attitude", TIME, Axis("angle", "deg"), turns)) if attitude else (plan, height)


@draw.register(Trajectory)
def plot_trajectory(trajectory: Trajectory, *, attitude: bool = True, axes: GivenAxes | None = None) -> Figure:
    """Plot plan, height and attitude of a trajectory.

    Parameters
    ----------
    trajectory
        What to draw.
    attitude
        Whether roll, pitch and yaw are drawn too.
    axes
        Two Axes to draw into, plan and height, or with the attitude three; a new figure if left out.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> figure = nj.plotting.plot_trajectory(reference)
    >>> figure.savefig("trajectory.png")
    """
    shown = trajectory_data(trajectory, attitude=attitude)
    alone = axes is None
    if attitude:
        if axes is None:
            places = new_figure(10.5, 5.2).subplot_mosaic([["plan", "height"], ["plan", "attitude"]])
            axes = [places[name] for name in ("plan", "height", "attitude")]
        _, (*pair, ax) = frames(axes, 1, 3, (10.5, 5.2))
        describe(ax, shown[2])
        for i, item in enumerate(shown[2].items):
            assert isinstance(item, Line)
            put_in_turns(ax, item, i, len(shown[2].items))
        grid(ax)
        more = [ax]
    else:
        pair, more = axes, []
    figure, (plan, height) = plan_and_height(pair, shown[:2])
    way, start = shown[0].items
    put(plan, way, color=COLOURS[0], lw=1.4)
    put(plan, start, color=COLOURS[3], marker="o", ls="")
    put(height, shown[1].items[0], color=COLOURS[0], lw=1.4)
    down = trajectory.position[:, 2]
    if np.ptp(down) < _FLAT:  # else the axis shows rounding
        height.set_ylim(-down.mean() - _FLAT, -down.mean() + _FLAT)
    legend_below(figure, [plan, height, *more], alone=alone)
    return figure
