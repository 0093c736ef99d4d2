"""Who may import whom, read from the source: `ROOMS` is the architecture, and a new file needs no row in it.

A package is a door (its ``__init__``), rooms (folders) and nothing flat but what `FLAT` names. A room imports from the
rooms that its row lists, and files that begin with an underscore from nobody else's room; `app` comes by the door, as
users do. No circle of files anywhere.
"""

import ast
import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

_BELOW = {
    "gmwm_jax": """
        _internal
        units
        processes: units
        recordings: units processes
        variance: units processes recordings
        fitting: units processes recordings variance
        inference: units processes recordings variance fitting
        regression: units processes recordings variance fitting
        multisignal: units processes recordings variance fitting inference
        plotting: units processes recordings variance fitting inference regression multisignal
        app: units processes recordings variance fitting inference regression multisignal plotting
    """,
    "nav_jax": """
        kinematics
        statistics
        trajectory: kinematics
        imu: kinematics trajectory
        aiding: kinematics trajectory imu
        filter: kinematics trajectory imu aiding
        simulation: kinematics trajectory imu aiding filter statistics
        campaign: kinematics trajectory imu aiding filter statistics simulation
        lincov: kinematics trajectory imu aiding filter statistics simulation
        recorded: kinematics trajectory imu aiding filter statistics
        plotting: kinematics trajectory imu aiding filter statistics simulation campaign lincov recorded
        app: kinematics trajectory imu aiding filter statistics simulation campaign lincov recorded plotting
    """,
}
ROOMS = {
    package: {row.partition(":")[0].strip(): set(row.partition(":")[2].split()) for row in rows.strip().splitlines()}
    for package, rows in _BELOW.items()
}
"""Package -> room -> the rooms it may import, `_internal` apart, which all may."""

FLAT = {"gmwm_jax": {"__init__", "__main__", "units"}, "nav_jax": {"__init__", "__main__"}}
"""The only files outside rooms."""

SHARED = {"units", "_internal"}
"""Rooms of gmwm_jax that all of nav_jax may import."""

DOORS = {"imu", "aiding"}
"""Rooms of nav_jax that see gmwm_jax, and there what its door and those of its rooms export."""

DRAWING = "_internal/drawing"
"""The one file that imports the figures of a result, at the moment of drawing."""

HEAVY = ("matplotlib", "typer", "tqdm", "rdata", "pooch", "pyarrow", "xarray", "pandas", "zarr", "pydantic", "pynmea2",
         "rosbags", "shiny", "plotly", "uvicorn", "starlette")  # fmt: skip
"""Imported by leaves, or inside a function at the moment of use."""

LEAVES = {"plotting", "app", "__main__"}

ROOM_OF_PAGE = "app/web/"
"""Of both packages: that of nav_jax is joined to the page of gmwm_jax, and sees its files, its command and the door."""

FIGURES = "_internal/figures"
"""What the rooms `plotting` of both packages share; it imports matplotlib, and nobody else imports it."""

MAX_NAMES_OF_FITTING = 20
"""By which other rooms may know the room `fitting`; it may only fall."""

MAX_NAMES_AT_DOOR = {"gmwm_jax": 40, "nav_jax": 40}
"""Rooms apart."""


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
    for node in [*tree.body, *(n for i in tree.body if isinstance(i, ast.If) for n in i.body)]:
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                names.add(name)
            case ast.Assign() | ast.AnnAssign():
                names |= {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    return names


class Package:
    """The files of a package by their path in it (``fitting/search``), parsed."""

    def __init__(self, root, name):
        self.name = name
        paths = sorted((root / name).rglob("*.py"))
        self.trees = {str(p.relative_to(root / name).with_suffix("")): ast.parse(p.read_text()) for p in paths}

    def file_of(self, i):
        """The file that an import names, and the name it takes from it (None: all of it); None if there is none."""
        below = "/".join(i.module.split(".")[1:])
        whole = "/".join(filter(None, [below, i.name or ""]))
        for target, name in ((whole, None), (f"{whole}/__init__", None), (below, i.name)):
            if target in self.trees:
                return target, name
        target = "/".join(filter(None, [below, "__init__"]))
        return (target, i.name) if target in self.trees else None


def room_of(file):
    """The room of a file: a folder, or the file itself where it is flat."""
    return file.split("/")[0]


def violations(root):
    """Every breach of the rules in the packages under a folder, as text."""
    packages = {name: Package(root, name) for name in ROOMS}
    found = []
    for package in packages.values():
        for file, tree in package.trees.items():
            where = f"{package.name}/{file}.py"
            if "/" not in file and file not in FLAT[package.name]:
                found.append(f"{where}: lies flat; put it into one of the rooms {', '.join(ROOMS[package.name])}")
            elif room_of(file) not in {*ROOMS[package.name], *FLAT[package.name]}:
                found.append(f"{where}: {room_of(file)} is none of the rooms in {Path(__file__).name}")
            else:
                for i in imports(tree):
                    found += wrong(f"{where}:{i.line}", package, file, i, packages)
        found += [f"{package.name}/{c[0]}.py: a circle of files, {' -> '.join(c)}" for c in circles(package)]
    return found


def wrong(at, package, file, i, packages):
    """What is wrong with one import, as a list of texts."""
    top = i.module.split(".")[0]
    if top == "":
        return [f"{at}: relative import; name the file in full"]
    if top in HEAVY and file != FIGURES and room_of(file) not in LEAVES and not (i.in_function or i.typing_only):
        return [f"{at}: {top} is imported on import of the package; import it where it is used"]
    if top not in packages:
        return []
    if package.name == "gmwm_jax" and top == "nav_jax":
        return [f"{at}: gmwm_jax knows nothing of nav_jax"]
    seen = packages[top].file_of(i)
    if seen is None:
        return [f"{at}: there is no {i.module}"]
    target, name = seen
    if target == FIGURES and room_of(file) != "plotting":
        return [f"{at}: {FIGURES} is for the rooms plotting"]
    return crossing(at, file, target) if top != package.name else inside(at, package, file, target, name)


def crossing(at, file, target):
    """From nav_jax to gmwm_jax: what both share, or at the door where noise models enter."""
    if room_of(target) in SHARED:
        return []
    if file.startswith(ROOM_OF_PAGE):
        page = target.startswith(ROOM_OF_PAGE) and not any(part.startswith("_") for part in target.split("/")[:-1])
        allowed = page or target in ("__init__", "app/cli")
        return [] if allowed else [f"{at}: the page of gmwm_jax, its command and its door, nothing else"]
    if room_of(file) not in DOORS:
        return [f"{at}: only the rooms {', '.join(sorted(DOORS))} of nav_jax see gmwm_jax, others its units"]
    if not target.endswith("__init__"):
        return [f"{at}: public names only, from the door of gmwm_jax or of one of its rooms"]
    return []


def inside(at, package, file, target, name):
    """Within a package: the own room, or one below; from the file that defines the name."""
    own, other = room_of(file), room_of(target)
    if own != other and own not in ("__init__", "__main__") and file != DRAWING:
        if other == "__init__" and own == "app":
            return []
        if other in ("__init__", "__main__"):
            return [f"{at}: imports from the door of the package, not from the file that defines {name}"]
        if other != "_internal" and other not in ROOMS[package.name][own]:
            return [f"{at}: {other} is not below {own}"]
        if any(part.startswith("_") and part != "__init__" for part in target.split("/")[1:]):
            return [f"{at}: {target} belongs to its room"]
    defined = name is None or name in defined_names(package.trees[target]) or file.endswith("__init__")
    return [] if defined else [f"{at}: {name} is not defined in {target}.py; import it from where it is"]


def circles(package):
    """Files that import each other, imports inside functions included; those of `DRAWING` are not."""
    below = {file: set() for file in package.trees}
    for file, tree in package.trees.items():
        if file != DRAWING:
            known = (package.file_of(i) for i in imports(tree) if i.module.split(".")[0] == package.name)
            below[file] |= {target for target, _ in filter(None, known)} - {file}
    for file in [f for f in below if f.endswith("__init__")]:  # a door imports; who imports it means what is behind
        below[file] = set()
    while True:  # take away what imports nothing; what is left goes in circles
        free = {file for file, targets in below.items() if not targets & set(below)}
        if not free:
            break
        below = {file: targets for file, targets in below.items() if file not in free}
    if not below:
        return []
    path = [min(below)]
    while path[-1] not in path[:-1]:
        path.append(min(below[path[-1]] & set(below)))
    return [path[path.index(path[-1]) :]]


def test_the_packages_keep_their_rooms():
    found = violations(ROOT)
    assert not found, "\n" + "\n".join(found)


def test_other_rooms_know_little_of_fitting():
    package = Package(ROOT, "gmwm_jax")
    names = set()
    for file, tree in package.trees.items():
        if room_of(file) in (*LEAVES, "fitting", "__init__"):
            continue
        for i in imports(tree):
            target = package.file_of(i) if i.module.startswith("gmwm_jax") else None
            if target and room_of(target[0]) == "fitting":
                names.add(target)
    assert len(names) <= MAX_NAMES_OF_FITTING, f"{len(names)}: {sorted(names, key=str)}"


@pytest.mark.parametrize("name", ROOMS)
def test_the_door_is_small(name):
    door = importlib.import_module(name)
    public = {n for n in dir(door) if not n.startswith("_")} - set(ROOMS[name])
    assert len(public) <= MAX_NAMES_AT_DOOR[name], len(public)


def test_no_file_has_the_name_of_a_function_at_its_door():
    for name, rooms in ROOMS.items():
        package = Package(ROOT, name)
        for room in ("", *(r for r in rooms if f"{r}/__init__" in package.trees)):
            door = importlib.import_module(".".join(filter(None, [name, room])))
            functions = {n for n in dir(door) if inspect.isfunction(getattr(door, n))}
            start = f"{room}/" if room else ""
            files = {f.removeprefix(start).split("/")[0] for f in package.trees if f.startswith(start)}
            assert not functions & files, f"{door.__name__}: {functions & files}"


def test_every_room_says_what_lives_there():
    for name, rooms in ROOMS.items():
        package = Package(ROOT, name)
        for room in rooms:
            if f"{room}/__init__" in package.trees:
                tree = package.trees[f"{room}/__init__"]
                assert len(ast.get_docstring(tree) or "") > 40, room


@pytest.mark.parametrize(
    ("file", "source", "complaint"),
    [
        ("gmwm_jax/units.py", "from gmwm_jax.variance.haar import scales", "variance is not below units"),
        ("gmwm_jax/units.py", "def f():\n    from gmwm_jax.variance.haar import scales", "not below units"),
        ("gmwm_jax/processes/base.py", "from gmwm_jax.variance.haar import scales", "not below processes"),
        ("gmwm_jax/fitting/fit.py", "from gmwm_jax.variance._blocks import blocks", "belongs to its room"),
        ("gmwm_jax/fitting/fit.py", "from gmwm_jax import WN", "not from the file that defines WN"),
        ("gmwm_jax/fitting/fit.py", "import gmwm_jax", "imports from the door of the package"),
        ("gmwm_jax/fitting/fit.py", "from gmwm_jax.variance import scales", "scales is not defined in variance"),
        ("gmwm_jax/units.py", "from ._internal import require_x64", "relative import"),
        ("gmwm_jax/fitting/fit.py", "from gmwm_jax.variance.haar import numpy", "numpy is not defined"),
        ("gmwm_jax/fitting/fit.py", "from gmwm_jax.nowhere import f", "there is no gmwm_jax.nowhere"),
        ("gmwm_jax/fitting/fit.py", "def f():\n    from gmwm_jax.plotting.fit import plot_fit", "is not below"),
        ("gmwm_jax/plotting/fit.py", "from gmwm_jax.app.cli import app", "app is not below plotting"),
        ("gmwm_jax/variance/haar.py", "import matplotlib.pyplot as plt", "matplotlib is imported on import"),
        ("gmwm_jax/variance/haar.py", "from gmwm_jax._internal.figures import frames", "is for the rooms plotting"),
        ("nav_jax/imu/errors.py", "from gmwm_jax._internal.figures import frames", "is for the rooms plotting"),
        ("gmwm_jax/units.py", "try:\n    import pyarrow\nexcept ImportError:\n    pass", "pyarrow is imported"),
        ("gmwm_jax/units.py", "class A:\n    from rdata import read_rda", "rdata is imported on import"),
        ("gmwm_jax/units.py", "def f():\n    import nav_jax", "knows nothing of nav_jax"),
        ("gmwm_jax/surprise.py", "", "lies flat"),
        ("gmwm_jax/surprise/file.py", "", "surprise is none of the rooms"),
        ("gmwm_jax/variance/_blocks.py", "def f():\n    from gmwm_jax.variance.haar import scales", "a circle"),
        ("nav_jax/filter/ekf.py", "from gmwm_jax import GM", "only the rooms aiding, imu"),
        ("nav_jax/imu/errors.py", "from gmwm_jax.variance.haar import scales", "public names only"),
        ("nav_jax/app/web/room.py", "from gmwm_jax.variance.haar import scales", "the page of gmwm_jax, its command"),
        # what is allowed
        ("nav_jax/app/web/room.py", "from gmwm_jax.app.web.page import ROOM\nimport gmwm_jax as gj", None),
        ("gmwm_jax/fitting/fit.py", "from gmwm_jax import units as units_", None),
        ("gmwm_jax/fitting/fit.py", "from gmwm_jax.variance.haar import scales, TAU", None),
        ("gmwm_jax/variance/other.py", "from gmwm_jax.variance._blocks import blocks", None),
        ("gmwm_jax/_internal/drawing.py", "def f():\n    from gmwm_jax.plotting.fit import plot_fit", None),
        ("gmwm_jax/app/cli.py", "import matplotlib, typer\nfrom gmwm_jax.plotting.fit import plot_fit", None),
        ("gmwm_jax/app/cli.py", "import gmwm_jax as gj", None),
        ("gmwm_jax/units.py", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import matplotlib", None),
        ("gmwm_jax/units.py", "def f():\n    import pyarrow", None),
        ("gmwm_jax/__init__.py", "from gmwm_jax.variance.haar import scales", None),
        ("nav_jax/plotting/runs.py", "from gmwm_jax._internal.figures import frames", None),
        ("nav_jax/imu/errors.py", "from gmwm_jax.variance import scales", None),
        ("nav_jax/filter/ekf.py", "from gmwm_jax.units import TAU\nfrom gmwm_jax._internal.checks import x64", None),
    ],
)
def test_the_rules_see_what_they_should(tmp_path, file, source, complaint):
    """Each rule on a small package that keeps or breaks it."""
    small = {
        "gmwm_jax/__init__.py": "WN = 1",
        "gmwm_jax/units.py": "TAU = 6.28",
        "gmwm_jax/variance/__init__.py": "from gmwm_jax.variance.haar import scales as scales",
        "gmwm_jax/variance/haar.py": "from gmwm_jax.variance._blocks import blocks\nimport numpy\nTAU: float = 2.0\n"
        "def scales(): ...",
        "gmwm_jax/variance/_blocks.py": "def blocks(): ...",
        "gmwm_jax/plotting/fit.py": "def plot_fit(): ...",
        "gmwm_jax/app/cli.py": "app = 1",
        "gmwm_jax/app/web/page.py": "ROOM = 1",
        "gmwm_jax/_internal/checks.py": "def x64(): ...",
        "gmwm_jax/_internal/figures.py": "import matplotlib\ndef frames(): ...",
        "gmwm_jax/processes/drift.py": "class DR: ...",
        file: source + ("\ndef blocks(): ..." if file.endswith("_blocks.py") else ""),
    }
    if file == "gmwm_jax/units.py":
        small[file] += "\nTAU = 6.28"
    if file == "gmwm_jax/variance/haar.py":
        small[file] += "\ndef scales(): ..."
    for name, text in small.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    found = violations(tmp_path)
    if complaint is None:
        assert not found
    else:
        assert len(found) == 1, found
        assert found[0].startswith(file)
        assert complaint in found[0]


def test_importing_the_package_is_light_and_changes_nothing():
    """In a fresh interpreter: no plotting or optional library is loaded, and no setting of JAX is touched."""
    program = f"""
import sys, jax
before = dict(jax.config.values)
import gmwm_jax, nav_jax
for package in gmwm_jax, nav_jax:
    for name in package.__all__:
        name == "plotting" or getattr(package, name)
print(sorted(m for m in {HEAVY!r} if m in sys.modules), before == dict(jax.config.values))
"""
    seen = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert seen.stdout.strip() == "[] True"
