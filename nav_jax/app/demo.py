"""The second half of the demonstration: what the noise models that were just fitted do to navigation."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from gmwm_jax._internal.atomic import write_atomically
from gmwm_jax._internal.progress import Progress
from nav_jax.app.comparison_file import read_config
from nav_jax.app.reports import comparison_report
from nav_jax.simulation.comparison import Comparison

FITS = ("noise_model.json", "noise_model_wn.json", "noise_model_wn_gm.json")
"""What the demonstration of gmwm_jax leaves."""

_CONFIG = """\
# Does the noise model matter? Filters that believe three fits of one recording, in the same {num_runs} runs.
# A number is SI; a text has its unit. Run it again, or change it: nav-jax compare {file}

[trajectory]
motion = "lemniscate"
duration = "5 min"

[truth]  # the recording was simulated: its true model is known
sensor = "mti-g"

[filters."fitted model"]
fit = {fits[0]}

[filters."WN + 1 GM"]
fit = {fits[2]}

[filters."WN only"]
fit = {fits[1]}

[[aiding]]
type = "gnss_position"
rate = "1 Hz"
horizontal = "2.5 cm"
vertical = "5 cm"
outages = [[260, 300]]

[[aiding]]
type = "gnss_velocity"
rate = "1 Hz"
horizontal = "0.01 m/s"
vertical = "0.02 m/s"
outages = [[260, 300]]

[[aiding]]
type = "barometer"
rate = "1 Hz"
height = "0.5 m"

[run]
num_runs = {num_runs}
seed = 1

[output]
folder = "."
"""


def run_demo(
    fits: Path, out: Path, num_runs: int, say: Callable[[str], Any], *, progress: Progress = False
) -> Comparison:
    """Write a configuration, run it, and write its tables and figures.

    Parameters
    ----------
    fits
        Folder in which ``gmwm-jax demo`` has left its fits.
    out
        Folder, made if it is not there.
    num_runs
        Of each filter.
    say
        Receives the text for the screen.
    progress
        Show a bar.

    Raises
    ------
    FileNotFoundError
        The fits are not there.
    """
    for name in FITS:
        if not (fits / name).is_file():
            raise FileNotFoundError(f'There is no {fits / name}: make the fits first, by "gmwm-jax demo --out {fits}".')
    file = out / "comparison.toml"
    # beside the configuration, or wherever they are; a TOML text in single quotes has no escapes
    names = [f"'{name if fits.resolve() == out.resolve() else (fits / name).resolve()}'" for name in FITS]
    text = _CONFIG.format(num_runs=num_runs, file=file, fits=names)
    write_atomically(file, lambda stream: stream.write(text.encode()))
    comparison = read_config(file).compare(progress=progress)
    say(f"{comparison}\n")
    written = comparison_report(comparison).write(out)
    say(f"Configuration, tables and figures are in {out}/: {', '.join([file.name, *written])}")
    return comparison
