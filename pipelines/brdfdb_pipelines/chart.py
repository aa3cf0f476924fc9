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

from brdfdb.errors import BrdfdbError, ParameterError
from brdfdb.forms.catalogue import Form, of_table
from brdfdb.forms.tradeoff import STEPS, TIMED, Chart, Charts, FamilyChart, chart, chart_family
from brdfdb.materials import Material, Source
from brdfdb.measurements import Measured
from brdfdb.store.family import Family, Sweep
from brdfdb.store.family_records import recorded
from brdfdb.store.reader import Store
from brdfdb.tables.planner import check_tolerance
from brdfdb.tables.table import Table, source_of_table
from brdfdb_pipelines import chart_picture, recipe_file, terminal
from brdfdb_pipelines.chart_picture import CLOSE, percent
from brdfdb_pipelines.named_source import tables_at


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
    store: Path | str | None = None,
    recipe_path: Path | None = None,
    tolerances: Sequence[float] | None = None,
) -> Charts:
    """Chart materials and families of recipe or store; write ``NAME.json``, ``NAME.svg`` and ``NAME.png`` of each.

    The tables and families of a store are charted as well; the store need not exist. ParameterError if a name is
    unknown, or a tolerance is out of range.
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
    for family in families:
        _write(out / family.family, charts.model_copy(update={"charts": [], "families": [family]}), family)
        _print_family(family)
    written = [*(one.material for one in material_charts), *(family.family for family in families)]
    print(f"{out}: .json, .svg and .png of {', '.join(written)}")
    return charts


def _write(stem: Path, document: Charts, drawn: Chart | FamilyChart) -> None:
    """Write a chart as data and as pictures; names of materials have no dots."""
    stem.with_suffix(".json").write_text(document.model_dump_json(indent=1) + "\n", encoding="utf-8")
    stem.with_suffix(".svg").write_text(chart_picture.svg(drawn), encoding="utf-8")
    stem.with_suffix(".png").write_bytes(chart_picture.png(drawn))


def _subjects(names: Sequence[str], root: Path | str | None, recipe_path: Path | None) -> list[_Subject | _Family]:
    """Return the subject of each name; names in the recipe precede those in the store."""
    recipe = recipe_file.load(recipe_path, to_build=False)
    listed = recipe.jobs()
    jobs = {job.material.name: job for job in listed}
    sweeps = {sweep.name: sweep for sweep in recipe.sweeps(listed)}
    measured = {job.name: job for job in recipe.measured_jobs()}
    store = tables_at(root)
    subjects: list[_Subject | _Family] = []
    for name in dict.fromkeys(names):
        table = store[name] if store is not None and name in store else None
        if name in jobs:
            subject = _with_table(_Subject(jobs[name].material, jobs[name].wavelength_nm), table)
        elif name in measured:
            data = measured[name].lawful_source()
            at = None if data.wavelengths_nm is None else np.array(data.wavelengths_nm)
            print(f"{name}: measured data. Errors are relative to these data, interpolated.{_trust(data.measured)}")
            subject = _with_table(_Subject(data, at), table)
        elif table is not None:
            subject = _of_table(table)
        elif name in sweeps:
            members = [jobs[member] for member in sweeps[name].members]
            materials = [job.material for job in members]
            same = isinstance(store, Store) and recorded(store.root, sweeps[name]) is not None
            stored = store.family(name) if store is not None and same else None
            subjects.append(_Family(sweeps[name], materials, members[0].wavelength_nm, stored))
            continue
        elif store is not None and name in store.families():
            family = store.family(name)
            sources = [store[member].source for member in family.record.members]
            materials = [source for source in sources if isinstance(source, Material)]
            if len(materials) < len(sources):
                raise BrdfdbError(f"{name}: the family cannot be charted, because a table of it names no known model")
            subjects.append(_Family(family.record, materials, family.wavelength_nm, family))
            continue
        elif name in (job.name for job in recipe.simulated_jobs()):
            raise ParameterError(name, "is simulated; build the recipe first, and give the store", name)
        else:
            others = "the recipe" if recipe_path else "the presets; `brdfdb list --presets` prints their names"
            raise ParameterError(name, f"no such material or family, neither in the store nor among {others}", name)
        subjects.append(subject)
    return subjects


def _of_table(table: Table) -> _Subject:
    """Return a table of the store; without a model that can be evaluated, errors are those against the table itself."""
    source = source_of_table(table)
    measured = table.metadata.measured
    subject = _Subject(source, table.wavelength_nm)
    terminal.say_without_glints("the chart", source)
    if measured is not None:
        print(
            f"{table.name}: measured data, which the store does not contain. Errors are relative to the stored table; "
            f"with --recipe FILE they are relative to the data.{_trust(measured)}"
        )
        return subject
    if not isinstance(source, Material):
        print(
            f"{table.name}: its source cannot be evaluated here, because the store does not contain functions, and a "
            "model of your own needs --models. Errors are relative to the stored table."
        )
        return subject
    return _with_table(subject, table)


def _with_table(subject: _Subject, table: Table | None) -> _Subject:
    """Return a subject with its table in the store as a form, if the table has the same wavelengths."""
    if table is None:
        return subject
    stored, wanted = table.wavelength_nm, subject.wavelength_nm
    if (None if stored is None else stored.tolist()) != (None if wanted is None else wanted.tolist()):
        return subject
    title = f"table of the store, {terminal.error(table.error.overall.p99 if table.error else None)}"
    return subject._replace(stored=(of_table(table, "table-stored", title),))


def _trust(measured: Measured) -> str:
    """Return a sentence on the error of measured data; empty if it is not known."""
    held = measured.held_out
    if held is not None:
        return f" The data are within {terminal.error(held.p95)} of 95 % of the samples left out of the interpolation."
    noise = measured.noise
    return "" if noise is None else f" The noise of the data is below {terminal.error(noise.p95)} in 95 of 100 values."


def _print(one: Chart) -> None:
    """Print all points as a table, and the front in a sentence."""
    rows = [
        (
            "*" if point.key in one.fronts.batch else "",
            point.key,
            point.title,
            percent(point.l1),
            chart_picture.tail(point),
            *map(percent, (point.forward, point.back, point.grazing)),
            chart_picture.quartiles(point.batch),
            *map(terminal.count, (point.block.ns, point.single.ns, point.mixed.ns)),
            chart_picture.against(point),
            terminal.size(point.bytes),
        )
        for point in one.points
    ]
    if one.surface is not None:
        off = f"truth {one.surface.error.in_lists} off" if one.surface.error.inside else ""
        ns = "" if one.surface.cost is None else terminal.count(one.surface.cost.ns)
        rows.append(("", "surface", one.surface.title, off, *[""] * 4, ns, *[""] * 5))
    errors = ("mean error", "p99 (95 % interval)", "forward", "back", "grazing")
    numbers = (*errors, "ns a value", "ns, 256", "ns, one", "ns, in turn", "times as fast as its rung", "bytes")
    terminal.print_table(f"{one.material}: {one.title}", ("", "key", "form", *numbers), rows, numbers=numbers)
    for out in one.left_out:
        print(f"  left out: {out.title}: {out.reason}")
    if one.surface is not None:
        print(f"  surface: {' '.join(chart_picture.of_surface(one.surface))}")
    points = {point.key: point for point in one.points}
    phrases = []
    for point in (points[key] for key in one.fronts.batch):
        off = f"{percent(point.l1)} off in the mean, p99 {percent(point.p99)}"
        error = "the truth" if point.l1 == 0.0 else off
        faster = ""
        if point.saving is not None:
            faster = f", {terminal.count(float(f'{point.saving.times:.2g}'))} times as fast as {point.rung}"
        phrases.append(f"{point.title} ({terminal.count(point.batch.ns)} ns{faster}, {error})")
    print(f"  worth having: {'; '.join(phrases)}")
    heads = ("variance", "ns a sample", "ms to 1 %")
    work = tuple(f"{problem}: {head}" for problem in ("albedo", "sphere") for head in heads)
    rows = [(sampler.title, *chart_picture.works(sampler)) for sampler in one.samplers]
    terminal.print_table(f"{one.material}: samplers, noise and time", ("sampler", *work), rows, numbers=work)


def _print_family(family: FamilyChart) -> None:
    """Print the mean error of every form along each parameter, and where each form of the front is worth having."""
    for axis, values in family.axes.items():
        rows = []
        for curve in family.curves:
            cells = []
            for alike in chart_picture.along(family, axis):
                chosen = 2 * sum(curve.key in family.fronts[index] for index in alike) > len(alike)
                middle = chart_picture.middle([curve.l1[index] for index in alike])
                cells.append("-" if middle is None else f"{'*' if chosen else ''}{percent(middle)}")
            rows.append((curve.key, curve.title, terminal.count(curve.batch.ns), *cells))
        if any(family.surface):
            cells = []
            for alike in chart_picture.along(family, axis):
                errors = [error.median for index in alike if (error := family.surface[index]) is not None]
                middle = chart_picture.middle(errors)
                cells.append("-" if middle is None else percent(middle))
            rows.append(("surface", "truth against rays on Gaussian surfaces, median", "", *cells))
        columns = [f"{value:g}" for value in values]
        if family.diagnostic is not None and len(family.axes) == 1:
            rows.insert(0, ("", family.diagnostic.title, "", *map(terminal.count, family.diagnostic.values)))
        title = f"{family.family}: {family.title}. Mean error along {axis}; * is worth having"
        terminal.print_table(title, ("key", "form", "ns a value", *columns), rows, numbers=("ns a value", *columns))
    for out in family.left_out:
        print(f"  left out of {out.member}: {out.title}: {out.reason}")
    print(f"  times are those of one member, {family.curves[0].timed} for most")
    for curve in family.curves:
        if where := [index for index, front in enumerate(family.fronts) if curve.key in front]:
            print(f"  worth having: {curve.title} ({terminal.count(curve.batch.ns)} ns) {_where(family, where)}")
    for curve in family.curves:
        if curve.kind in ("closed form", "approximation", "customary", "printed"):
            close = [index for index, error in enumerate(curve.l1) if error is not None and error <= CLOSE]
            where_close = _where(family, close) if close else "nowhere"
            print(f"  within {percent(CLOSE)} in the mean: {curve.title} {where_close}")
    if family.between is not None:
        off = f"{percent(family.between.l1)} off in the mean, p99 {percent(family.between.p99)}"
        time = f"{terminal.count(family.between.batch.ns)} ns, {terminal.count(family.between.single.ns)} of one"
        print(f"  between members: {off}, as the family states ({time}, {terminal.size(family.between.bytes)})")


def _where(family: FamilyChart, members: Sequence[int]) -> str:
    """Return the ranges of the parameters of members in words."""
    points = list(itertools.product(*family.axes.values()))
    spans = []
    for number, axis in enumerate(family.axes):
        inside = [points[index][number] for index in members]
        least, most = min(inside), max(inside)
        spans.append(f"{axis} {least:g} to {most:g}" if least < most else f"{axis} {least:g}")
    if family.diagnostic is not None:
        symbol = family.diagnostic.symbol
        inside = [family.diagnostic.values[index] for index in members]
        least, most = min(inside), max(inside)
        spans.append(f"{symbol} {least:g} to {most:g}" if least < most else f"{symbol} {least:g}")
    return f"at {len(members)} of {len(points)} members, {', '.join(spans)}"
