"""The chart job: measures speed against accuracy of the forms of materials and families, and draws charts."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import brdfdb
from brdfdb.errors import BrdfdbError, ParameterError
from brdfdb.forms.catalogue import Form, of_table
from brdfdb.forms.tradeoff import STEPS, TIMED, Chart, ChartPoint, Charts, FamilyChart, chart, chart_family
from brdfdb.materials import Material, Source
from brdfdb.measurements import Measured
from brdfdb.store.family import Family, Sweep
from brdfdb.store.family_records import recorded
from brdfdb.store.reader import Store
from brdfdb.tables.planner import check_tolerance
from brdfdb.tables.table import Table
from brdfdb.tables.table_source import source_of_table
from brdfdb_pipelines import family_plot, recipe_file, terminal, tradeoff_plot
from brdfdb_pipelines.named_source import measured_source
from brdfdb_pipelines.plot_panels import percent


class _Subject(NamedTuple):
    """A source to chart at its wavelengths, and its table in a store."""

    source: Source
    wavelength_nm: NDArray[np.float64] | None
    stored: tuple[Form, ...] = ()


class _Family(NamedTuple):
    """A family to chart: its members at their wavelengths, and the family of the store."""

    sweep: Sweep
    materials: list[Material]
    wavelength_nm: NDArray[np.float64] | None
    stored: Family | None


def run(
    names: Sequence[str],
    out: Path,
    *,
    store: Path | None = None,
    recipe_path: Path | None = None,
    tolerances: Sequence[float] | None = None,
) -> Charts:
    """Chart materials and families; write ``NAME.json``, ``NAME.svg`` and ``NAME.png`` for each.

    Parameters
    ----------
    names : sequence of str
        Materials or families of the recipe (by default every preset) or of the store.
    out : Path
        Directory to write to; made if it does not exist.
    store : Path, optional
        Store whose tables and families are charted as well; it need not exist.
    recipe_path : Path, optional
        A recipe that defines materials or families, and the wavelengths of spectral ones.
    tolerances : sequence of float, optional
        Tolerances of planned tables: see `brdfdb.forms.catalogue`.

    Returns
    -------
    Charts
        All charts. Each is written to a file of its own, so that another run replaces only what it charts again.

    Raises
    ------
    ParameterError
        If a name is neither in the recipe nor in the store, or a tolerance is out of range.
    """
    for tolerance in tolerances or ():
        check_tolerance(tolerance)
    subjects = _subjects(names, store, recipe_path)
    material_charts: list[Chart] = []
    families: list[FamilyChart] = []
    with terminal.progress(counted=False) as bar:
        for subject in subjects:
            if isinstance(subject, _Family):
                task = bar.add_task(subject.sweep.name, total=len(subject.materials) + TIMED)
                tick = functools.partial(bar.advance, task)
                members = (subject.sweep, subject.materials, subject.wavelength_nm)
                families.append(chart_family(*members, tolerances, family=subject.stored, tick=tick))
                continue
            task = bar.add_task(subject.source.name, total=STEPS)
            tick = functools.partial(bar.advance, task)
            material_charts.append(
                chart(subject.source, subject.wavelength_nm, tolerances, also=subject.stored, tick=tick)
            )
    charts = Charts(
        brdfdb=version("brdfdb"),
        when=datetime.now(UTC),
        machine=terminal.machine(),
        charts=material_charts,
        families=families,
    )
    out.mkdir(parents=True, exist_ok=True)
    for one in material_charts:
        _write(out / one.material, charts.model_copy(update={"charts": [one], "families": []}), one)
        _print(one)
    for whole in families:
        _write(out / whole.family, charts.model_copy(update={"charts": [], "families": [whole]}), whole)
        _print_family(whole)
    written = [*(one.material for one in material_charts), *(whole.family for whole in families)]
    print(f"{out}: .json, .svg and .png of {', '.join(written)}")
    return charts


def _write(stem: Path, document: Charts, drawn: Chart | FamilyChart) -> None:
    """Write a chart as data and as pictures; names of materials have no dots."""
    stem.with_suffix(".json").write_text(document.model_dump_json(indent=1) + "\n", encoding="utf-8")
    stem.with_suffix(".svg").write_text(tradeoff_plot.svg(drawn), encoding="utf-8")
    stem.with_suffix(".png").write_bytes(tradeoff_plot.png(drawn))


def _subjects(names: Sequence[str], root: Path | None, recipe_path: Path | None) -> list[_Subject | _Family]:
    recipe = recipe_file.load(recipe_path, to_build=False)
    listed = recipe.jobs()
    jobs, sweeps = {job.material.name: job for job in listed}, {sweep.name: sweep for sweep in recipe.sweeps(listed)}
    store: Store | None = brdfdb.open(root) if root is not None and root.exists() else None
    measured = {job.name: job for job in recipe.measured_jobs()}
    subjects: list[_Subject | _Family] = []
    for name in dict.fromkeys(names):
        table = store[name] if store is not None and name in store else None
        if name in jobs:
            subject = _Subject(jobs[name].material, jobs[name].wavelength_nm)
        elif name in measured:
            data, at = measured_source(measured[name])
            subject = _Subject(data, at)
            print(f"{name}: it is measured. Errors are those against the data, interpolated.{_trust(data.measured)}")
        elif table is not None:
            source = source_of_table(table)
            subject = _Subject(source, table.wavelength_nm)
            if table.metadata.measured is not None:
                print(
                    f"{name}: it is measured, and the store does not hold the data. Errors are those against the "
                    f"stored table itself, --recipe FILE reads the data.{_trust(table.metadata.measured)}"
                )
                subjects.append(subject)
                continue
            if not isinstance(source, Material):
                print(
                    f"{name}: its source cannot be evaluated here. A function is not in the store, and a model of your "
                    "own needs --models. Errors are those against the stored table itself."
                )
                subjects.append(subject)
                continue
        elif name in sweeps:
            members = [jobs[member] for member in sweeps[name].members]
            materials = [job.material for job in members]
            same = store is not None and recorded(store.root, sweeps[name]) is not None
            stored = store.family(name) if store is not None and same else None
            subjects.append(_Family(sweeps[name], materials, members[0].wavelength_nm, stored))
            continue
        elif store is not None and name in store.families():
            family = store.family(name)
            materials = [_material_of(store[member]) for member in family.record.members]
            subjects.append(_Family(family.record, materials, family.wavelength_nm, family))
            continue
        else:
            known = "the recipe" if recipe_path else "the presets; `brdfdb list --presets` names them"
            raise ParameterError(name, f"no such material or family, neither in the store nor among {known}", name)
        if table is not None and _fits(table.wavelength_nm, subject.wavelength_nm):
            title = f"table of the store, {terminal.error(table.error.overall.p99 if table.error else None)}"
            subject = subject._replace(stored=(of_table(table, "table-stored", title),))
        subjects.append(subject)
    return subjects


def _trust(measured: Measured) -> str:
    """Return how far measured data are to be trusted, in a sentence; empty if nothing is known."""
    held = measured.held_out
    if held is not None:
        return f" The data are within {terminal.error(held.p95)} of 95 of 100 samples that were held out."
    noise = measured.noise
    return "" if noise is None else f" The noise of the data is below {terminal.error(noise.p95)} in 95 of 100 values."


def _material_of(table: Table) -> Material:
    """Return the material behind a table; BrdfdbError where the table does not say."""
    if not isinstance(table.source, Material):
        raise BrdfdbError(
            f"{table.name}: the table does not name a model that is known here, so its family cannot be charted"
        )
    return table.source


def _fits(stored: NDArray[np.float64] | None, wanted: NDArray[np.float64] | None) -> bool:
    return (None if stored is None else stored.tolist()) == (None if wanted is None else wanted.tolist())


def _print(one: Chart) -> None:
    """Print all points as a table, and the front in a sentence."""
    rows = [
        (
            "*" if point.key in one.fronts.batch else "",
            point.key,
            point.title,
            percent(point.l1),
            tradeoff_plot.tail(point),
            *map(percent, (point.forward, point.back, point.grazing)),
            tradeoff_plot.quartiles(point.batch),
            *map(terminal.count, (point.block.ns, point.single.ns, point.mixed.ns)),
            tradeoff_plot.against(point),
            terminal.size(point.bytes),
        )
        for point in one.points
    ]
    errors = ("mean error", "p99 (95 % interval)", "forward", "back", "grazing")
    numbers = (*errors, "ns a value", "ns, 256", "ns, one", "ns, in turn", "times as fast as its rung", "bytes")
    terminal.print_table(f"{one.material}: {one.title}", ("", "key", "form", *numbers), rows, numbers=numbers)
    for out in one.left_out:
        print(f"  left out: {out.title}: {out.reason}")
    points = {point.key: point for point in one.points}
    print("  worth having: " + "; ".join(_said(points[key]) for key in one.fronts.batch))
    heads = ("variance", "ns a sample", "ms to 1 %")
    work = tuple(f"{problem}: {head}" for problem in ("albedo", "sphere") for head in heads)
    rows = [(sampler.title, *tradeoff_plot.works(sampler)) for sampler in one.samplers]
    terminal.print_table(f"{one.material}: samplers, noise and time", ("sampler", *work), rows, numbers=work)


def _said(point: ChartPoint) -> str:
    off = f"{percent(point.l1)} off in the mean, p99 {percent(point.p99)}"
    error = "the truth" if point.l1 == 0.0 else off
    faster = "" if point.saving is None else f", {terminal.count(float(f'{point.saving.times:.2g}'))} times as fast as"
    rung = f"{faster} {point.rung}" if faster else ""
    return f"{point.title} ({terminal.count(point.batch.ns)} ns{rung}, {error})"


def _print_family(whole: FamilyChart) -> None:
    """Print the mean error of every form along each parameter, and where each form of the front is worth having."""
    for axis, values in whole.axes.items():
        rows = []
        for curve in whole.curves:
            cells = []
            for some in family_plot.along(whole, axis):
                chosen = 2 * sum(curve.key in whole.fronts[index] for index in some) > len(some)
                middle = family_plot.middle([curve.l1[index] for index in some])
                cells.append("-" if middle is None else f"{'*' if chosen else ''}{percent(middle)}")
            rows.append((curve.key, curve.title, terminal.count(curve.batch.ns), *cells))
        columns = [f"{value:g}" for value in values]
        if whole.diagnostic is not None and len(whole.axes) == 1:
            rows.insert(0, ("", whole.diagnostic.title, "", *map(terminal.count, whole.diagnostic.values)))
        title = f"{whole.family}: {whole.title}. Mean error along {axis}; * is worth having"
        terminal.print_table(title, ("key", "form", "ns a value", *columns), rows, numbers=("ns a value", *columns))
    for out in whole.left_out:
        print(f"  left out of {out.member}: {out.title}: {out.reason}")
    print(f"  times are those of one member, {whole.curves[0].timed} for most")
    for curve in whole.curves:
        if where := [index for index, front in enumerate(whole.fronts) if curve.key in front]:
            print(f"  worth having: {curve.title} ({terminal.count(curve.batch.ns)} ns) {_where(whole, where)}")
    for curve in whole.curves:
        if curve.kind in ("closed form", "approximation", "customary", "printed"):
            close = [index for index, error in enumerate(curve.l1) if error is not None and error <= family_plot.CLOSE]
            where_close = _where(whole, close) if close else "nowhere"
            print(f"  within {percent(family_plot.CLOSE)} in the mean: {curve.title} {where_close}")
    if whole.between is not None:
        off = f"{percent(whole.between.l1)} off in the mean, p99 {percent(whole.between.p99)}"
        time = f"{terminal.count(whole.between.batch.ns)} ns, {terminal.count(whole.between.single.ns)} of one"
        print(f"  between members: {off}, as the family states ({time}, {terminal.size(whole.between.bytes)})")


def _where(whole: FamilyChart, members: Sequence[int]) -> str:
    """Return the part of a family that some members lie in, in words."""
    points = list(itertools.product(*whole.axes.values()))
    spans = []
    for number, axis in enumerate(whole.axes):
        inside = [points[index][number] for index in members]
        least, most = min(inside), max(inside)
        spans.append(f"{axis} {least:g} to {most:g}" if least < most else f"{axis} {least:g}")
    if whole.diagnostic is not None:
        symbol, inside = whole.diagnostic.symbol, [whole.diagnostic.values[index] for index in members]
        least, most = min(inside), max(inside)
        spans.append(f"{symbol} {least:g} to {most:g}" if least < most else f"{symbol} {least:g}")
    return f"at {len(members)} of {len(points)} members, {', '.join(spans)}"
