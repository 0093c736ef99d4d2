"""The files of GNSS receivers and of the programs that compute positions: one file a format, one row in a table."""

from nav_jax.recorded.gnss.reading import read_gnss as read_gnss
from nav_jax.recorded.gnss.record import GnssRecord as GnssRecord
from nav_jax.recorded.gnss.registry import FORMATS as FORMATS
