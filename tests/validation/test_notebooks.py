"""Every notebook runs from top to bottom in this interpreter, and what is stored in it is what it shows."""

import re
from pathlib import Path

import nbformat
import pytest
from jupyter_client import AsyncKernelManager
from jupyter_client.kernelspec import KernelSpecManager
from nbclient import NotebookClient

FOLDER = Path(__file__).resolve().parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
MAX_BYTES = 700_000
_PATH = re.compile(r"/(?:home|root|tmp|work|usr|Users|var|opt|mnt)/\S+|[A-Z]:\\\S+")


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def texts(notebook):
    """All text that the cells have put out."""
    outputs = [output for cell in code_cells(notebook) for output in cell.outputs]
    return [o["text"] if "text" in o else o.get("data", {}).get("text/plain", "") for o in outputs]


def num_figures(notebook):
    outputs = [output for cell in code_cells(notebook) for output in cell.outputs]
    return sum("image/png" in output.get("data", {}) for output in outputs)


def complaints(notebook):
    """Errors, warnings and anything else on stderr."""
    outputs = [output for cell in code_cells(notebook) for output in cell.outputs]
    return [o for o in outputs if o.output_type == "error" or o.get("name") == "stderr"]


def test_there_are_notebooks():
    assert NOTEBOOKS


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_is_stored(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert path.stat().st_size < MAX_BYTES
    counts = [cell.execution_count for cell in code_cells(notebook)]
    assert counts == list(range(1, len(counts) + 1)), "run all cells once, in order, and save"
    assert num_figures(notebook) > 0
    assert not complaints(notebook)
    assert 'jax.config.update("jax_enable_x64", True)' in code_cells(notebook)[0].source
    paths = [found for text in texts(notebook) for found in _PATH.findall(text)]
    assert not paths, "paths of the machine it ran on"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("default")  # of the notebook machinery, not ours
def test_it_runs(path, tmp_path):
    """In a temporary folder: a notebook must not rely on files beside it."""
    notebook = nbformat.read(path, as_version=4)
    stored = num_figures(notebook)
    # without folders of kernels there is one left, that of this interpreter
    kernels = KernelSpecManager(kernel_dirs=[])
    manager = AsyncKernelManager(kernel_name="python3", kernel_spec_manager=kernels)
    client = NotebookClient(notebook, km=manager, timeout=300, resources={"metadata": {"path": str(tmp_path)}})
    client.execute(cleanup_kc=True)  # raises where a cell does; it would leave a kernel that it did not start
    assert not complaints(notebook)
    assert num_figures(notebook) == stored
    assert not list(tmp_path.iterdir()), "files were left behind"
