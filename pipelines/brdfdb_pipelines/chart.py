"""Charting speed against accuracy: measures materials, writes chart.json and a picture of each, prints the fronts."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import brdfdb
from brdfdb.albedo import material_of
from brdfdb.chart import STEPS, Chart, Charts, Point, chart
from brdfdb.materials import Material
from brdfdb.representations import Representation, of_table
from brdfdb.store import Store
from brdfdb_pipelines import recipe, scatter, terminal


class _Subject(NamedTuple):
    """What is charted: a material at its wavelengths, and its table in a store."""

    material: Material
    wavelength_nm: NDArray[np.float64] | None
    stored: tuple[Representation, ...] = ()


def run(
    names: Sequence[str],
    out: Path,
    *,
    store: Path | None = None,
    recipe_file: Path | None = None,
    tolerances: Sequence[float] | None = None,
) -> Charts:
    """Chart materials, and write ``chart.json`` and, of each, ``NAME.svg`` and ``NAME.png``.

    Parameters
    ----------
    names : sequence of str
        Materials of the recipe, which by default has every built-in one, or else of the store.
    out : Path
        Directory to write to; made if it is not there.
    store : Path, optional
        Its tables are charted beside the planned ones; it need not exist.
    recipe_file : Path, optional
        A recipe that defines materials, and the wavelengths of spectral ones.
    tolerances : sequence of float, optional
        Of planned tables: see `brdfdb.representations`.

    Returns
    -------
    Charts
        What was written.

    Raises
    ------
    ValueError
        If a name is neither of the recipe nor of the store, or a tolerance is none.
    """
    subjects = _subjects(names, store, recipe_file)
    found = []
    with terminal.progress(counted=False) as bar:
        for subject in subjects:
            task = bar.add_task(subject.material.name, total=STEPS)
            found.append(
                chart(
                    subject.material,
                    subject.wavelength_nm,
                    tolerances,
                    also=subject.stored,
                    tick=lambda task=task: bar.advance(task),  # type: ignore[misc]  # lambda of a default
                )
            )
    charts = Charts(brdfdb=version("brdfdb"), when=datetime.now(UTC), machine=_machine(), charts=found)
    out.mkdir(parents=True, exist_ok=True)
    (out / "chart.json").write_text(charts.model_dump_json(indent=1) + "\n", encoding="utf-8")
    for one in found:
        (out / f"{one.material}.svg").write_text(scatter.svg(one), encoding="utf-8")
        (out / f"{one.material}.png").write_bytes(scatter.png(one))
        _print(one)
    print(f"{out}: chart.json and the pictures of {', '.join(one.material for one in found)}")
    return charts


def _subjects(names: Sequence[str], root: Path | None, recipe_file: Path | None) -> list[_Subject]:
    jobs = {job.material.name: job for job in recipe.load(recipe_file).jobs()}
    store: Store | None = brdfdb.open(root) if root is not None and root.exists() else None
    subjects = []
    for name in names:
        table = store[name] if store is not None and name in store else None
        if name in jobs:
            subject = _Subject(jobs[name].material, jobs[name].wavelength_nm)
        elif table is not None:
            subject = _Subject(material_of(table), table.wavelength_nm)
        else:
            known = "the recipe" if recipe_file else "the built-in ones; `brdfdb list --presets` names them"
            raise ValueError(f"{name}: no such material, neither in the store nor among {known}")
        if table is not None and _fits(table.wavelength_nm, subject.wavelength_nm):
            title = f"table of the store, {terminal.error(table.error.overall.p99 if table.error else None)}"
            subject = subject._replace(stored=(of_table(table, "table-stored", title),))
        subjects.append(subject)
    return subjects


def _fits(stored: NDArray[np.float64] | None, wanted: NDArray[np.float64] | None) -> bool:
    return (None if stored is None else stored.tolist()) == (None if wanted is None else wanted.tolist())


def _machine() -> str:
    return f"{platform.machine()}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"


def _print(one: Chart) -> None:
    """All points as a table, and the front in a sentence."""
    percent = scatter.percent
    rows = [
        (
            "*" if point.key in one.fronts.batch else "",
            point.key,
            point.title,
            *map(percent, (point.l1, point.p99, point.forward, point.back, point.grazing)),
            f"{scatter.count(point.batch.ns)} ({scatter.count(point.batch.low)}-{scatter.count(point.batch.high)})",
            scatter.count(point.single.ns),
            terminal.size(point.bytes),
        )
        for point in one.points
    ]
    numbers = ("mean error", "p99", "forward", "back", "grazing", "ns a value", "ns, one", "bytes")
    terminal.print_table(f"{one.material}: {one.title}", ("", "key", "form", *numbers), rows, numbers=numbers)
    points = {point.key: point for point in one.points}
    print("  worth having: " + "; ".join(_said(points[key]) for key in one.fronts.batch))


def _said(point: Point) -> str:
    error = "the truth" if point.l1 == 0.0 else f"{scatter.percent(point.l1)} off"
    return f"{point.title} ({scatter.count(point.batch.ns)} ns, {error})"
