"""The figure of what is in a record."""

from matplotlib.figure import Figure

from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Frame, Item, Line, Mark, Span
from gmwm_jax._internal.figures import describe, frames, legend_below, put, put_in_turns
from gmwm_jax._internal.palette import COLOURS
from nav_jax.plotting._style import DEGREES, TIME, draw, grid
from nav_jax.recorded.inspection import Inspection

_REST, _GAP = "#d9ead3", "#c23b22"
_SERIES = {
    "specific force": ("mean |f|", "m/s^2", 1.0),
    "turn rate": ("mean |turn rate|", "deg/s", DEGREES),
    "speed of the fixes": ("speed", "m/s", 1.0),
}


def inspection_data(inspection: Inspection) -> tuple[Frame, ...]:
    """Return what `plot_inspection` shows: specific force, turn rate, speed of the fixes, offsets of the clocks.

    Parameters
    ----------
    inspection
        Of a record; without fixes it has two frames.

    Examples
    --------
    >>> imu, exact = nj.perfect_imu(nj.motions.racetrack(duration=60.0, rate=50.0, straight=40.0, turn=20.0))
    >>> found = nj.recorded.inspect_record(imu.time, imu.gyro, imu.accel)
    >>> [frame.title for frame in nj.plotting.inspection_data(found)]
    ['specific force', 'turn rate']
    """
    rests: list[Item] = [Span("" if i else "rest", r.start, r.end) for i, r in enumerate(inspection.rests)]
    gaps: list[Item] = [Mark("" if i else "gap", time) for i, (time, _) in enumerate(inspection.imu.gaps)]
    shown = []
    for name, (at, values) in inspection.series.items():
        label, unit, factor = _SERIES[name]
        beside = [*rests, *gaps] if name != "speed of the fixes" else []
        shown.append(Frame(name, TIME, Axis(label, unit), (Line("", at, factor * values), *beside)))
    if inspection.offsets:
        lines = tuple(Line(f"{o.fixes}, {o.signal}", o.tried, o.correlation) for o in inspection.offsets)
        marks = tuple(Mark(f"{source}: {value:.3f} s", value) for source, (value, _) in inspection.time_offsets.items())
        axes = Axis("added to the times of the fixes", "s"), Axis("correlation with the IMU", "")
        shown.append(Frame("offset of the clocks", *axes, (*lines, *marks)))
    return tuple(shown)


@draw.register(Inspection)
def plot_inspection(inspection: Inspection, *, axes: GivenAxes | None = None) -> Figure:
    """Plot what is in a record: specific force, turn rate and speed over time with rest, and the offsets of the clocks.

    Parameters
    ----------
    inspection
        Of a record.
    axes
        Two Axes to draw into, with fixes four; a new figure if left out.

    Examples
    --------
    >>> imu, exact = nj.perfect_imu(nj.motions.racetrack(duration=60.0, rate=50.0, straight=40.0, turn=20.0))
    >>> nj.recorded.inspect_record(imu.time, imu.gyro, imu.accel).plot().savefig("record.png")
    """
    shown = inspection_data(inspection)
    figure, drawn = frames(axes, -(-len(shown) // 2), 2, (10.5, 1.0 + 2.8 * -(-len(shown) // 2)), num=len(shown))
    for ax, frame in zip(drawn, shown, strict=True):
        num = sum(isinstance(item, Line) for item in frame.items)
        marked = iter(COLOURS[4:])
        for i, item in enumerate(frame.items):  # curves come first
            if isinstance(item, Span):
                put(ax, item, color=_REST, zorder=0)
            elif isinstance(item, Mark):
                put(ax, item, color=_GAP if item.label in ("gap", "") else next(marked), lw=1.0, ls=":")
            elif isinstance(item, Line):
                put_in_turns(ax, item, i, num)
        describe(ax, frame)
        ax.margins(x=0)
        grid(ax)
    legend_below(figure, drawn, alone=axes is None)
    return figure
