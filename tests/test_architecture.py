"""Who may import whom, read from the source. The order below is the architecture (shared/design.md).

A file imports only from files above its own, and every name from the file that defines it. Heavy and optional
libraries stay out of the import of the package. A new file needs a place in the list.
"""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

GMWM_JAX = """
    _typing _check _safe _table
    processes/__init__ processes/_parameter processes/_haar processes/_recursion processes/_circulant
    processes/_state_space processes/_base
    processes/white_noise processes/quantisation processes/random_walk processes/drift processes/gauss_markov
    processes/_doubling processes/_arma_covariance processes/arma
    processes/matern processes/_power_law processes/fractional processes/_cosine_integral processes/flicker
    processes/band_flicker processes/sinusoid
    processes/registry
    continuous units
    simulation datasheet
    wavelet wavelet_host robust pairs
    _columns _files _known_files _sensors _text _timebase
    recording io datasets
    variance
    _nnls start estimate problem
    wv_covariance wv_skewness gap_covariance inference estimates weights
    outliers cleaning
    result goodness allan fitting refit intervals replicates _progress draws bootstrapping
    submodels sweep criterion candidates selection
    records joint joint_fitting joint_refit resampling record_comparison stationarity cross_validation
    whitening regressors regression
    plot plot_bootstrap plot_selection plot_records demo cli_parts cli __main__
    __init__
"""
NAV_JAX = """
    _typing _check _files _table _progress status components
    rotation linalg earth
    attitudes trajectory motions _columns _quantities trajectory_io
    strapdown sensors
    layout sensor_bank recorded noise_models noise counter emulation
    measurements/__init__ measurements/_base measurements/_ned
    measurements/gnss_position measurements/gnss_velocity measurements/barometer
    initial schedule
    error_model ekf judge filter smoother experiment
    epochs _distributions statistics energy
    parameters lincov analysis sensitivities budget calibration
    _store results_io
    runs ranking comparison
    monte_carlo navigate record_io likelihood information tuning_search tuning design_family design_search design
    plot_runs plot plot_analysis config_sections config config_record report report_analysis demo cli __main__
    __init__
"""
ORDER = {"gmwm_jax": GMWM_JAX.split(), "nav_jax": NAV_JAX.split()}
"""From low to high, files of each package. A file that does not exist (yet) is no error."""

LEAVES = (
    *("plot", "plot_bootstrap", "plot_selection", "plot_records", "plot_runs", "plot_analysis"),
    *("config_sections", "config", "config_record", "report", "report_analysis"),
    *("demo", "cli_parts", "cli", "__main__"),
)
"""Imported by nobody but other leaves; `plot...` also inside methods."""

HEAVY = ("matplotlib", "typer", "tqdm", "rdata", "pooch", "pyarrow", "xarray", "pandas", "zarr", "pydantic")
"""Imported by leaves, or inside a function at the moment of use."""

MAX_LINES = 400

DOOR = {"noise", "noise_models"}
"""The files of nav_jax that see gmwm_jax, and there its public names only."""


class Import:
    """One `from module import name` (name None: `import module`) and where in the file it stands."""

    def __init__(self, module, name, line, *, in_function, typing_only):
        self.module, self.name, self.line = module, name, line
        self.in_function, self.typing_only = in_function, typing_only


def imports(tree):
    """All imports of a file, with the knowledge of whether they run on import."""
    found = []

    def visit(node, in_function, typing_only):
        for child in ast.iter_child_nodes(node):
            flags = {"in_function": in_function, "typing_only": typing_only}
            if isinstance(child, ast.Import):
                found.extend(Import(a.name, None, child.lineno, **flags) for a in child.names)
            elif isinstance(child, ast.ImportFrom):
                module = "." * child.level + (child.module or "")
                found.extend(Import(module, a.name, child.lineno, **flags) for a in child.names)
            elif isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
                visit(child, True, typing_only)
            elif isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
                visit(child, in_function, True)
            else:
                visit(child, in_function, typing_only)

    visit(tree, False, False)
    return found


def defined_names(tree):
    """Names a file binds itself at module level, not by importing them."""
    names = set()
    for node in tree.body:
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                names.add(name)
            case ast.Assign() | ast.AnnAssign():
                names |= {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    return names


def violations(root):
    """Every breach of the rules in the packages under a folder, as text."""
    found = []
    files = {
        package: {str(p.relative_to(root / package).with_suffix("")): p for p in sorted((root / package).rglob("*.py"))}
        for package in ORDER
    }
    trees = {p: ast.parse(p.read_text()) for of_package in files.values() for p in of_package.values()}
    for package, of_package in files.items():
        order = {name: rank for rank, name in enumerate(ORDER[package])}
        for name, path in of_package.items():
            where = f"{package}/{name}.py"
            if name not in order:
                found.append(f"{where}: has no place in the order of layers; add it to ORDER in {Path(__file__).name}")
                continue
            num_lines = len(path.read_text().splitlines())
            if num_lines > MAX_LINES:
                found.append(f"{where}: {num_lines} lines, more than {MAX_LINES}: cut it")
            for i in imports(trees[path]):
                at = f"{where}:{i.line}"
                top = i.module.split(".")[0]
                if top == "":
                    found.append(f"{at}: relative import; name the file in full")
                elif top in HEAVY and name not in LEAVES and not (i.in_function or i.typing_only):
                    found.append(f"{at}: {top} is imported on import of the package; import it where it is used")
                elif top in ORDER and top != package:
                    found += crossing(at, package, name, i)
                elif top == package:
                    found += inside(at, package, name, i, order, of_package, trees)
    return found


def crossing(at, package, name, i):
    """From one package to the other: only by the door, and only public names."""
    if package == "gmwm_jax":
        return [f"{at}: gmwm_jax knows nothing of nav_jax"]
    if name not in DOOR:
        return [f"{at}: only {', '.join(sorted(DOOR))} of nav_jax may import gmwm_jax"]
    if i.module != "gmwm_jax" or i.name is None or i.name.startswith("_"):
        return [f"{at}: public names only, from gmwm_jax import ..."]
    return []


def inside(at, package, name, i, order, of_package, trees):
    """Within a package: downwards, from the defining file."""
    target = "/".join(i.module.split(".")[1:])
    as_module = "/".join(filter(None, [target, i.name or ""]))
    if as_module in of_package:  # from gmwm_jax import units
        target, imported = as_module, None
    elif target in of_package and i.name:
        imported = i.name
    else:
        return [f"{at}: imports from the package {i.module}, not from the file that defines {i.name}"]
    if target.startswith("plot") and i.in_function:
        pass  # a method that draws
    elif target in LEAVES and name not in LEAVES:
        return [f"{at}: {target} is a leaf, nobody imports it"]
    elif order.get(target, -1) >= order[name]:
        return [f"{at}: {target} is not below {name} in the order of layers"]
    if imported and imported not in defined_names(trees[of_package[target]]):
        return [f"{at}: {imported} is not defined in {target}.py; import it from where it is"]
    return []


def test_the_packages_keep_their_layers():
    found = violations(ROOT)
    assert not found, "\n" + "\n".join(found)


@pytest.mark.parametrize(
    ("file", "source", "complaint"),
    [
        ("gmwm_jax/units.py", "from gmwm_jax.variance.haar import scales", "wavelet is not below units"),
        ("gmwm_jax/units.py", "def f():\n    from gmwm_jax.variance.haar import scales", "wavelet is not below units"),
        ("gmwm_jax/processes/_base.py", "from gmwm_jax.processes.drift import DR", "not below processes/_base"),
        ("gmwm_jax/units.py", "from gmwm_jax import fit", "not from the file that defines fit"),
        ("gmwm_jax/units.py", "import gmwm_jax", "imports from the package gmwm_jax"),
        ("gmwm_jax/units.py", "from ._check import require_x64", "relative import"),
        ("gmwm_jax/io.py", "from gmwm_jax.variance.haar import numpy", "numpy is not defined in wavelet.py"),
        ("gmwm_jax/result.py", "from gmwm_jax.plotting.figures import plot_fit", "plot is a leaf"),
        ("gmwm_jax/plot.py", "from gmwm_jax.app.cli import app", "cli is not below plot"),
        ("gmwm_jax/__init__.py", "from gmwm_jax.plotting.figures import plot_fit", "plot is a leaf"),
        ("gmwm_jax/io.py", "import matplotlib.pyplot as plt", "matplotlib is imported on import"),
        ("gmwm_jax/io.py", "try:\n    import pyarrow\nexcept ImportError:\n    pass", "pyarrow is imported on import"),
        ("gmwm_jax/io.py", "class A:\n    from rdata import read_rda", "rdata is imported on import"),
        ("gmwm_jax/io.py", "def f():\n    import nav_jax", "knows nothing of nav_jax"),
        ("gmwm_jax/surprise.py", "", "add it to ORDER"),
        ("gmwm_jax/processes/surprise.py", "", "add it to ORDER"),
        ("gmwm_jax/units.py", "\n" * 401, "401 lines"),
        ("nav_jax/__init__.py", "from gmwm_jax import GM", "only noise, noise_models of nav_jax"),
        # what is allowed
        ("gmwm_jax/io.py", "from gmwm_jax import units as units_", None),
        ("gmwm_jax/io.py", "from gmwm_jax.variance.haar import scales, TAU", None),
        ("gmwm_jax/result.py", "def f():\n    from gmwm_jax.plotting.figures import plot_fit", None),
        ("gmwm_jax/cli.py", "import matplotlib, typer\nfrom gmwm_jax.plotting.figures import plot_fit", None),
        ("gmwm_jax/io.py", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import matplotlib", None),
        ("gmwm_jax/io.py", "def f():\n    import pyarrow", None),
        ("gmwm_jax/__init__.py", "from gmwm_jax.variance.haar import scales", None),
    ],
)
def test_the_rules_see_what_they_should(tmp_path, file, source, complaint):
    """Each rule on a small package that keeps or breaks it."""
    small = {
        "gmwm_jax/wavelet.py": "import numpy\nTAU: float = 2.0\ndef scales(): ...",
        "gmwm_jax/units.py": "",
        "gmwm_jax/plot.py": "def plot_fit(): ...",
        "gmwm_jax/cli.py": "app = 1",
        "gmwm_jax/_check.py": "def require_x64(): ...",
        "gmwm_jax/processes/drift.py": "class DR: ...",
        file: source,
    }
    for name, text in small.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    found = violations(tmp_path)
    if complaint is None:
        assert not found
    else:
        assert len(found) == 1
        assert found[0].startswith(file)
        assert complaint in found[0]


def test_importing_the_package_is_light_and_changes_nothing():
    """In a fresh interpreter: no plotting or optional library is loaded, and no setting of JAX is touched."""
    program = f"""
import sys, jax
before = dict(jax.config.values)
import gmwm_jax, nav_jax
print(sorted(m for m in {HEAVY!r} if m in sys.modules), before == dict(jax.config.values))
"""
    seen = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert seen.stdout.strip() == "[] True"
