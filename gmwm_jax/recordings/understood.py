"""What was understood when a recording was read: the format, the columns and their units, and what stamps tell."""

from dataclasses import dataclass

from gmwm_jax._internal.text_table import format_table
from gmwm_jax._internal.timing import Timing


@dataclass(frozen=True, eq=False, repr=False)
class Understood:
    """How a file was read. Print it.

    Attributes
    ----------
    format
        Of the logger or the file.
    columns
        Channel -> its column in the file, and the unit of the samples there.
    rate
        In Hz.
    rate_from
        Who states it.
    time
        The column of time, and what it tells of missing samples and jitter; None without one.
    drift
        By how much that clock runs faster than the second one in parts per million, and the standard deviation.
    notes
        What else was done.

    Examples
    --------
    >>> rows = np.column_stack([np.arange(8) / 50, np.random.default_rng(0).normal(size=8)])
    >>> np.savetxt("static.csv", rows, delimiter=",", header="time,gyro_x [deg/s]", comments="")
    >>> print(gj.read_recording("static.csv", time="time").understood)
    Read as a table: 50 Hz by the column of time 'time' [s], none missing, none written twice, no jitter
    channel  column          unit
    -------  --------------  -----
    gyro_x   gyro_x [deg/s]  deg/s
    """

    format: str
    columns: dict[str, tuple[str, str]]
    rate: float
    rate_from: str
    time: Timing | None = None
    drift: tuple[float, float] | None = None
    notes: tuple[str, ...] = ()

    def in_short(self) -> str:
        """The rate and what the stamps tell, in a line."""
        parts = [f"{self.rate:.7g} Hz by {self.rate_from}", *([str(self.time)] if self.time else [])]
        if self.drift:
            parts.append(f"clock drift {self.drift[0]:+.3g} +- {self.drift[1]:.1g} ppm")
        return f"Read as {self.format}: {', '.join(parts)}"

    def __repr__(self) -> str:
        rows = [[channel, *of] for channel, of in self.columns.items()]
        table = format_table(["channel", "column", "unit"], rows, left=3)
        return "\n".join([self.in_short(), table, *self.notes])
