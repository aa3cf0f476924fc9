"""The pages of the Python interface: a page for every public module of the library, by room."""

from __future__ import annotations

import importlib
import pkgutil
from itertools import groupby
from pathlib import Path

import brdfdb
from _site.files import remove_others, write_page


def public_modules() -> list[str]:
    """Return the names of all modules of the library that have no underscore in front."""
    names = [module.name for module in pkgutil.walk_packages(brdfdb.__path__, "brdfdb.")]
    return ["brdfdb", *(name for name in names if not any(part.startswith("_") for part in name.split(".")))]


def write(docs: Path, _: Path) -> None:
    """Write ``reference/api``: an index of rooms, and a page a module."""
    folder = docs / "reference" / "api"
    modules = public_modules()
    for name in modules:
        write_page(folder / f"{name}.rst", _page(name, modules))
    write_page(folder / "index.rst", _index(modules))
    remove_others(folder, {"index.rst", *(f"{name}.rst" for name in modules)})


def _page(name: str, modules: list[str]) -> str:
    """Return the page of a module. A function named like a module of its package is on the page of that module."""
    lines = [name, "=" * len(name), "", f".. automodule:: {name}"]
    shadowed = [last for package, _, last in (other.rpartition(".") for other in modules) if package == name]
    if shadowed:
        lines.append(f"   :exclude-members: {', '.join(shadowed)}")
    return "\n".join(lines) + "\n"


def _index(modules: list[str]) -> str:
    """Return the page that lists the modules of each room with the first line of their docstrings."""
    title = "Python"
    lines = [title, "=" * len(title), "", "Every public module of the library, by room.", ""]
    for room, names in groupby(modules, key=lambda name: ".".join(name.split(".")[:2])):
        listed = list(names)
        lines += [room, "-" * len(room), ""]
        for name in listed:
            summary = (importlib.import_module(name).__doc__ or "").strip().splitlines()[0]
            lines += [f":doc:`{name} <{name}>`", f"    {summary}", ""]
        lines += [".. toctree::", "   :hidden:", "", *(f"   {name}" for name in listed), ""]
    return "\n".join(lines)
