"""Build the API reference, HTML made of the docstrings: ``python notebooks/api_reference.py out/docs`` (``make docs``).

A chapter is a room: its paragraph, then all of its public names. The page of a package lists what stands at its door,
with links to the chapters. The files of a room and the cellar `_internal` are not public and are left out.
"""

import importlib
import inspect
import pkgutil
import sys
from pathlib import Path

import pdoc

PACKAGES = ("gmwm_jax", "nav_jax")

NAMESPACES = {"datasets", "motions", "weights"}
"""Files whose functions are reached through the file, as in ``gj.datasets.load``; they have pages of their own."""


def chapters(package):
    """Return the rooms of a package, its units among them, as modules."""
    below = pkgutil.iter_modules(importlib.import_module(package).__path__, f"{package}.")
    return [importlib.import_module(info.name) for info in below if not info.name.split(".")[-1].startswith("_")]


def public_names(module):
    """Return the names that a module defines or exports, in its own order; rooms export what both packages share."""
    package = module.__name__.split(".")[0]
    ours = PACKAGES if hasattr(module, "__path__") else (package,)
    names = []
    for name, thing in vars(module).items():
        if inspect.ismodule(thing):
            public = name in NAMESPACES
        else:  # a constant has no module, what is imported from another library has another one
            public = (getattr(thing, "__module__", None) or package).split(".")[0] in ours
        if public and not name.startswith("_"):
            names.append(name)
    return names


def door(package):
    """Return a text for the page of a package: what its door exports, chapter by chapter."""
    top = importlib.import_module(package)
    for name in dir(top):  # a name is loaded when it is asked for
        getattr(top, name)
    lines = ["", "", "At the door", "-----------"]
    listed = set()
    for chapter in chapters(package):
        names = [name for name in public_names(chapter) if getattr(top, name, None) is getattr(chapter, name)]
        listed.update(names)
        if names:
            links = ", ".join(f"`{chapter.__name__}.{name}`" for name in names)
            lines.append(f"* {chapter.__name__.split('.')[-1]}: {links}")
    missing = {name for name in public_names(top)} - listed
    if missing:
        raise ValueError(f"{package} exports {sorted(missing)}, which no room does: export them there as well.")
    return "\n".join(lines)


def build(folder):
    """Write the pages of both packages into a folder, made where it is missing."""
    for package in PACKAGES:
        top = importlib.import_module(package)
        top.__doc__ += door(package)
        top.__all__ = [chapter.__name__.split(".")[-1] for chapter in chapters(package)]
        for chapter in chapters(package):
            chapter.__all__ = public_names(chapter)
    pdoc.render.configure(docformat="numpy", show_source=False, footer_text="gmwm_jax and nav_jax")
    pdoc.pdoc(*PACKAGES, output_directory=Path(folder))


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the packages beside this folder, installed or not
    build(sys.argv[1])
