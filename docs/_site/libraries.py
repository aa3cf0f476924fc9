"""The tables of the computed libraries: finishes, and substances with the source and the range of their n and k."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from _site.markup import plain, table, write_page
from brdfdb.materials import PAPERS, libraries
from brdfdb.materials.preset_files import Entry, entries, files
from brdfdb.refractive_indices import refractive_index

_AT_NM = 550.0
_KINDS = {"metal": "Metals", "semiconductor": "Semiconductors", "dielectric": "Dielectrics"}


def write(docs: Path, _: Path) -> None:
    """Write ``reference/generated/finishes.txt`` and ``substances.txt``, which ``reference/libraries.md`` includes."""
    folder = docs / "reference" / "generated"
    write_page(folder / "finishes.txt", _finishes())
    write_page(folder / "substances.txt", "\n".join(_substances(kind) for kind in _KINDS))


def _finishes() -> str:
    rows = []
    for file in files():
        for name, finish in file.finishes.items():
            g = (4.0 * math.pi * finish.sigma_0_um / (1e-3 * _AT_NM)) ** 2
            share = 100.0 * math.exp(-g)
            rows.append(
                (
                    f"`{name}`",
                    f"{finish.sigma_0_um:g}",
                    f"{finish.tau_um:g}",
                    f"{finish.sigma_0_um / finish.tau_um:.3g}",
                    f"{share:.3g} %" if share >= 0.01 else "none",
                    plain(finish.source),
                )
            )
    shared = f"specular share at {_AT_NM:g} nm, along the normal"
    return table(("finish", "sigma_0 [um]", "tau [um]", "slope sigma_0 / tau", shared, "origin"), rows)


def _substances(kind: str) -> str:
    """Return the table of the substances of a kind, with their wavelengths in each library."""
    names = [name for name in libraries() if name != PAPERS]
    of = {name: {entry.substance.symbol: entry for entry in entries(name)} for name in names}
    finishes: dict[str, list[str]] = {}
    for entry in entries(names[0]):
        finishes.setdefault(entry.substance.symbol, []).append(entry.material.name.rpartition("-")[2])
    rows = []
    for symbol, entry in of[names[0]].items():
        substance = entry.substance
        if substance.kind == kind:
            rows.append(
                (
                    plain(substance.title),
                    f"`{entry.material.name.removesuffix('-' + finishes[symbol][-1])}`",
                    f"`{substance.refractive_index}`",
                    plain(substance.citation),
                    "{:g} to {:g}".format(*substance.covers_nm),
                    *(_range(of[name].get(symbol), name) for name in names),
                    f"{_reflectance(substance.refractive_index):.3f}",
                    ", ".join(finishes[symbol]),
                    plain(substance.note),
                )
            )
    headings = ("substance", "name begins", "entry of n and k", "source", "entry covers [nm]")
    last = (f"reflectance at {_AT_NM:g} nm", "finishes", "note")
    return f"### {_KINDS[kind]}\n\n" + table((*headings, *(f"`{name}` [nm]" for name in names), *last), rows)


def _range(entry: Entry | None, library: str) -> str:
    """Return the wavelengths [nm] of a material in the recipe of a library; a dash where it has none."""
    if entry is None:
        return "–"
    nodes = next(file.libraries[library] for file in files() if library in file.libraries).wavelengths_nm
    stated = entry.material.wavelengths_nm
    return f"{stated[0]:g} to {stated[-1]:g}" if stated else f"{nodes.start:g} to {nodes.stop:g}"


def _reflectance(entry: str) -> float:
    """Return the reflectance [1] of a smooth surface along the normal."""
    n, k = refractive_index(entry, np.array(_AT_NM))
    return float(((n - 1.0) ** 2 + k**2) / ((n + 1.0) ** 2 + k**2))
