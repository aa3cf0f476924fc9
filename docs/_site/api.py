"""The pages of the Python interface: a page for every public module of the library, below the page of its room."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from pathlib import Path

import brdfdb
from _site.markup import remove_others, write_page


def public_modules() -> list[str]:
    """Return the names of all modules of the library that have no underscore in front."""
    names = [module.name for module in pkgutil.walk_packages(brdfdb.__path__, "brdfdb.")]
    return ["brdfdb", *(name for name in names if not any(part.startswith("_") for part in name.split(".")))]


def write(docs: Path, _: Path) -> None:
    """Write ``reference/api``: an index of rooms, a page a room, and below it a page for each of its modules."""
    folder = docs / "reference" / "api"
    modules = public_modules()
    for name in modules:
        write_page(folder / f"{name}.rst", _page(name, modules))
    write_page(folder / "index.rst", _index(modules))
    remove_others(folder, {"index.rst", *(f"{name}.rst" for name in modules)})


def _children(name: str, modules: list[str]) -> list[str]:
    return [other for other in modules if other.rpartition(".")[0] == name]


def _page(name: str, modules: list[str]) -> str:
    """Return the page of a module. A function named like a module of its package is on the page of that module."""
    below = [] if name == "brdfdb" else _children(name, modules)
    lines = [name, "=" * len(name), "", f".. automodule:: {name}"]
    if shadowed := [module.rpartition(".")[2] for module in _children(name, modules)]:
        lines.append(f"   :exclude-members: {', '.join(shadowed)}")
    for constant, kind in _constants(name).items():
        lines += ["", f".. py:data:: {constant}", f"   :module: {name}", f"   :type: {kind}"]
    if below:
        lines += ["", "Modules", "-------", "", *_listed(below, f"{name}.")]
    return "\n".join(lines) + "\n"


def _constants(name: str) -> dict[str, str]:
    """Return the constants that a module exports, with their types."""
    module = importlib.import_module(name)
    exported = {constant: getattr(module, constant) for constant in getattr(module, "__all__", ())}
    others = (inspect.isclass, inspect.isroutine, inspect.ismodule)
    constants = {key: value for key, value in exported.items() if not any(kind(value) for kind in others)}
    return {key: type(value).__name__.lstrip("_") for key, value in constants.items()}


def _index(modules: list[str]) -> str:
    """Return the page that lists the rooms and the modules outside rooms."""
    title = "Python"
    top = _children("brdfdb", modules)
    rooms = [name for name in top if _children(name, modules)]
    files = [name for name in top if name not in rooms]
    lines = [title, "=" * len(title), "", "Every public module of the library, by room."]
    lines += ["Angles are in radians, and f_r is in 1/sr without the cosine.", ""]
    for heading, names in (("Rooms", ["brdfdb", *rooms]), ("Modules", files)):
        lines += [heading, "-" * len(heading), "", *_listed(names, "brdfdb.")]
    return "\n".join(lines)


def _listed(names: list[str], prefix: str) -> list[str]:
    """Return modules with the first lines of their docstrings, and the tree of their pages."""
    lines = []
    for name in names:
        summary = (importlib.import_module(name).__doc__ or "").strip().splitlines()[0]
        lines += [f":doc:`{name.removeprefix(prefix)} <{name}>`", f"    {summary}", ""]
    return [
        *lines,
        ".. toctree::",
        "   :hidden:",
        "",
        *(f"   {name.removeprefix(prefix)} <{name}>" for name in names),
        "",
    ]
