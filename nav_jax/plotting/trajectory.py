"""The figure of a trajectory."""

import numpy as np
from matplotlib.figure import Figure

from gmwm_jax._internal.figures import GivenAxes, frames, new_figure
from nav_jax.plotting._style import COLOURS, DEGREES, draw, grid, plan_and_height
from nav_jax.trajectory.trajectory import Trajectory

_FLAT = 1.0
"""m: less than this between lowest and highest is drawn as level."""


@draw.register(Trajectory)
def plot_trajectory(trajectory: Trajectory, *, attitude: bool = True, axes: GivenAxes | None = None) -> Figure:
    """Plan, height and attitude of a trajectory.

    Parameters
    ----------
    trajectory
        What to draw.
    attitude
        Whether roll, pitch and yaw are drawn too.
    axes
        Two Axes to draw into, plan and height, or with the attitude three; a new figure if left out.
    """
    if attitude:
        if axes is None:
            places = new_figure(10.5, 5.2).subplot_mosaic([["plan", "height"], ["plan", "attitude"]])
            axes = [places[name] for name in ("plan", "height", "attitude")]
        _, (*pair, ax) = frames(axes, 1, 3, (10.5, 5.2))
        for colour, name, angle in zip(COLOURS, ("roll", "pitch", "yaw"), trajectory.euler.T, strict=False):
            ax.plot(trajectory.time, DEGREES * angle, color=colour, lw=1.2, label=name)
        ax.set(xlabel="time [s]", ylabel="angle [deg]", title="attitude")
        ax.legend(fontsize=8, ncols=3)
        grid(ax)
    else:
        pair = axes
    figure, (plan, height) = plan_and_height(pair)
    north, east, down = trajectory.position.T
    plan.plot(east, north, color=COLOURS[0], lw=1.4)
    plan.plot(east[0], north[0], "o", color=COLOURS[1], label="start")
    plan.legend(fontsize=8)
    height.plot(trajectory.time, -down, color=COLOURS[0], lw=1.4)
    if np.ptp(down) < _FLAT:  # else the axis shows rounding
        height.set_ylim(-down.mean() - _FLAT, -down.mean() + _FLAT)
    plan.set_title(f"{trajectory.name or 'trajectory'}: plan")
    return figure
