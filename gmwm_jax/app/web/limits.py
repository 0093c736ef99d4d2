"""What one session, and all of them, may ask of the server; each limit says a sentence."""

from dataclasses import dataclass
from pathlib import Path

from gmwm_jax._internal.limits import as_bytes
from gmwm_jax.processes.base import Composite


@dataclass(frozen=True)
class Limits:
    """The limits of a server.

    Examples
    --------
    >>> from gmwm_jax.app.web.limits import Limits
    >>> Limits(upload=5_000_000).too_large()
    'The file is larger than 5 MB, the most that this server takes (--max-upload).'
    """

    upload: int = 100_000_000
    """Bytes of a file."""
    uploads_per_session: int = 1_000_000_000
    """Bytes of all files that a session sends."""
    free_disk: int = 1_000_000_000
    """Bytes that an upload leaves free."""
    sessions: int = 20
    """Pages that are open at a time."""
    idle: float = 1800.0
    """Seconds after which a page that says nothing is closed."""
    message: int = 1 << 20
    """Bytes of a message of the page."""
    read_seconds: float = 120.0
    """For reading a file."""
    read_memory: int = 4 << 30
    """Bytes that the reader may take, and a file may unfold to."""
    pasted: int = 200_000
    """Characters of pasted values."""
    saved: int = 8_000_000
    """Bytes of a saved page."""
    records: int = 20
    """Of a sensor, that are fitted together."""
    samples: int = 2_000_000
    """Of a simulated record."""
    channels: int = 12
    """Of a recording."""
    processes: int = 8
    """Of a model."""
    gauss_markov: int = 5
    """Of them."""
    ranked: int = 200
    """Models of a ranking."""
    compute_seconds: float = 180.0
    """For what is computed at a click; longer than for reading a file."""
    job_seconds: float = 600.0
    """For replicates or a ranking; what is done by then is kept."""
    folder: Path | None = None
    """Of recordings that every page may open, by name."""

    def stored(self) -> dict[str, Path]:
        """Find the recordings of the folder: name -> file; no links, no hidden files, no folders."""
        if self.folder is None:
            return {}
        files = (f for f in self.folder.iterdir() if f.is_file() and not f.is_symlink())
        return {f.name: f for f in sorted(files) if not f.name.startswith(".")}

    def too_large(self) -> str:
        """Say that a file is too large."""
        return f"The file is larger than {as_bytes(self.upload)}, the most that this server takes (--max-upload)."

    def require_model(self, model: Composite) -> None:
        """Raise a ValueError if a model is larger than this server fits."""
        if len(model.processes) > self.processes:
            raise ValueError(f"The model has {len(model.processes)} processes, and this server fits {self.processes}.")
        gauss_markov = sum(p.kind == "GM" for p in model.processes)
        if gauss_markov > self.gauss_markov:
            raise ValueError(f"The model has {gauss_markov} GM, and this server fits {self.gauss_markov}.")

    def too_many_sessions(self) -> str:
        """Say that no more pages can be open."""
        return f"{self.sessions} pages are open, the most that this server serves at a time: close one, or wait."
