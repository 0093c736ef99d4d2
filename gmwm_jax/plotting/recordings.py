"""The figure of a recording."""

from matplotlib.figure import Figure

from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Band, Frame, Line
from gmwm_jax._internal.figures import describe, frames, legend_below, put
from gmwm_jax.plotting._style import DATA, FIT, MAX_POINTS, TIME, draw, in_bins
from gmwm_jax.recordings.recording import Recording


def recording_data(rec: Recording) -> tuple[Frame, ...]:
    """Return what `plot_recording` shows: a frame for each channel.

    Parameters
    ----------
    rec
        The recording.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> frames = gj.plotting.recording_data(rec)
    """
    t = rec.time()
    title = f"{rec.name or 'recording'}: {len(rec):,} samples at {rec.rate:g} Hz".replace(",", "\u2009")
    shown = []
    for i, name in enumerate(rec.channels):
        x = rec.data[:, i]
        items = (Line("", t, x),) if len(x) <= MAX_POINTS else in_bins(t, x)[1:]
        shown.append(Frame("" if i else title, TIME, Axis(name, rec.units[i]), items))
    return tuple(shown)


@draw.register(Recording)
def plot_recording(rec: Recording, *, axes: GivenAxes | None = None) -> Figure:
    """Plot each channel against time; a long record as the range of the samples in each of a few thousand bins.

    Parameters
    ----------
    rec
        The recording.
    axes
        An Axes for each channel to draw into; a new figure if left out.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> figure = gj.plotting.plot_recording(rec)
    >>> figure.savefig("recording.png")
    """
    shown = recording_data(rec)
    figure, drawn = frames(axes, len(shown), 1, (9, 1.2 + 1.6 * len(shown)), sharex=True)
    for ax, frame in zip(drawn, shown, strict=True):
        describe(ax, frame, apart="\n")
        for item in frame.items:
            if isinstance(item, Band):
                put(ax, item, color=DATA, alpha=0.45)
            else:
                put(ax, item, color=FIT if len(frame.items) > 1 else DATA, lw=0.7)
        ax.margins(x=0)
    legend_below(figure, drawn, alone=axes is None)
    for ax in drawn[:-1]:
        ax.set_xlabel("")
    figure.align_ylabels()
    return figure
