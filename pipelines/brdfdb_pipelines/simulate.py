"""The simulation job: it simulates the BRDF of a surface by rays, and makes an audited table, or samples, of it."""

from __future__ import annotations

import functools
import json as _json
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from brdfdb.errors import ParameterError
from brdfdb.formats.netcdf import write_samples
from brdfdb.materials import presets
from brdfdb.materials.recipe_text import toml_of
from brdfdb.measurements.record import SimulationRecord
from brdfdb.store.estimates import estimates_path
from brdfdb.store.files import write_file
from brdfdb.store.paths import NAME
from brdfdb.store.reader import Store
from brdfdb.store.summary_words import REPORT_OF_SOME
from brdfdb.tables.planner import check_tolerance
from brdfdb_pipelines import import_samples, terminal, workers
from brdfdb_pipelines.build import build
from brdfdb_pipelines.build_progress import Bars
from brdfdb_pipelines.build_survey import machine_memory
from brdfdb_pipelines.recipe_file import Recipe, path_from
from brdfdb_pipelines.recipe_grids import RecipeError
from brdfdb_pipelines.simulated_job import (
    SimulatedJob,
    combined,
    estimate_simulated,
    estimates_needed,
    simulated_job,
    simulated_samples,
)
from brdfdb_pipelines.simulated_table import in_options, option_of
from brdfdb_pipelines.workers import Workers


@dataclass(frozen=True)
class SimulationOutputs:
    """Outputs of a simulation: a table in a store, or samples in a file, and a recipe of the same table."""

    name: str
    store: Path | None = None
    out: Path | None = None
    recipe: Path | None = None
    tolerance: float = import_samples.TOLERANCE
    jobs: int = 1
    scheduler: str | None = None

    def __post_init__(self) -> None:
        try:
            check_tolerance(self.tolerance)
        except ParameterError as error:
            raise ParameterError("--tolerance", error.sentence, error.value, error.allowed) from None
        if self.store is None and self.out is None and self.recipe is None:
            raise ParameterError("--store, --out, --recipe", "none of them is given; give at least one")
        if self.store is not None and self.out is not None:
            raise ParameterError("--out", "writes samples in place of a table; leave out --store", str(self.out))
        if self.out is not None and self.scheduler is not None:
            raise ParameterError("--scheduler", "is only for tables; give --store in place of --out", self.scheduler)
        for option, path, suffix in (("--out", self.out, ".nc"), ("--recipe", self.recipe, ".toml")):
            if path is not None and path.suffix != suffix:
                raise ParameterError(option, f"{str(path)!r} does not end in {suffix}", str(path))
        if not NAME.fullmatch(self.name):
            text = f"{self.name!r} is not made of lower-case letters, digits and single hyphens, 128 at most"
            raise ParameterError("--name", text, self.name)
        if self.name in presets():
            raise ParameterError("--name", f"{self.name!r} is the name of a preset; give another", self.name)


def run(keys: dict[str, Any], outputs: SimulationOutputs, *, json: bool = False) -> bool:
    """Simulate a surface, and write what is asked for; return False if the audit of the table finds a violation.

    `keys` are those of `SimulatedTable`. ParameterError names the option that is wrong; StoreError says that the store
    cannot be written. Estimates that were finished stay in the store if the command is interrupted.
    """
    name = outputs.name
    start = time.perf_counter()
    content = {"materials": [name], "tolerance": outputs.tolerance, "define": {name: keys}}
    recipe = Recipe.model_validate(content)
    try:
        job = simulated_job(name, keys, None, outputs.tolerance, None)
    except RecipeError as error:
        field = error.parameter.removeprefix(f"define.{name}.")
        options = ", ".join(option_of(key) for key in field.split(", "))
        sentence = in_options(error.sentence)
        if "height_map" in keys:
            sentence = sentence.replace(str(Path(keys["height_map"]).absolute()), keys["height_map"])
        raise ParameterError(options, sentence, error.value, error.allowed) from None
    if outputs.store is not None:
        import_samples.check_audit()
    if outputs.recipe is not None:
        folder = outputs.recipe.parent
        written = keys if job.path is None else {**keys, "height_map": path_from(folder, job.path)}
        text = f'materials = ["{name}"]\ntolerance = {outputs.tolerance:g}\n\n{toml_of(name, written)}'
        write_file(outputs.recipe, text.encode(), folder)
    document: dict[str, Any] = {"material": name}
    record = None
    changes: list[str] = []
    tables: list[import_samples.ImportedTable] = []
    report = None
    if outputs.out is not None:
        record = _write_samples(job, outputs.out, outputs.jobs)
        document["file"] = str(outputs.out)
    elif outputs.store is not None:
        address = outputs.scheduler
        at = workers.cluster(address) if address else workers.interruptible(outputs.jobs)
        with at as opened, Bars() as bars:
            (built,) = build(
                recipe, outputs.store, opened, bars, memory=None if outputs.scheduler else machine_memory()
            )
        measured = Store(outputs.store).metadata(name).measured
        if measured is not None:
            record = measured.simulation
            changes = [change.sentence for change in measured.changes]
        document |= {"state": built.state, "revision": built.revision}
        from brdfdb_pipelines import audit  # it takes half a second to load

        path = outputs.store / REPORT_OF_SOME
        report = audit.run(outputs.store, [name], path, jobs=1, figures=False, shown=False)
        tables = import_samples.figures_of(outputs.store, report)
        document |= import_samples.summary(tables, report)
    seconds = time.perf_counter() - start
    if record is not None:
        document |= {"simulation": record.model_dump(mode="json"), "seconds": round(seconds, 1)}
    if json:
        print(_json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False))
        return report is None or not report.violations
    if record is not None:
        lines = [in_options(line) for line in [*record.in_words(), *changes]]
        print(terminal.plain("\n".join([name, *(f"  {line}" for line in lines)])))
    for file in (outputs.out, outputs.recipe):
        if file is not None:
            print(f"  written: {file}")
    if record is not None:
        print(f"  finished in {seconds:.0f} s")
    if report is not None:
        import_samples.show_tables(tables, report, outputs.tolerance, origin="simulated")
    return report is None or not report.violations


def _write_samples(job: SimulatedJob, out: Path, jobs: int) -> SimulationRecord:
    """Simulate a surface, write its samples as netCDF, and return the record of the simulation."""
    with tempfile.TemporaryDirectory() as scratch, Bars() as bars:
        folder = estimates_path(Path(scratch), job.name, job.estimates_request)
        folder.mkdir(parents=True)
        bars({"event": "simulating", "material": job.name})
        with workers.interruptible(jobs) as opened:
            count = estimates_needed(job, folder, lambda numbers: _computed(job, folder, numbers, opened, bars), bars)
        assert count is not None
        samples = simulated_samples(job, combined(folder, job, count))
    write_samples(samples, out)
    return SimulationRecord.model_validate(samples.record["simulation"])


def _computed(job: SimulatedJob, folder: Path, numbers: range, at: Workers, bars: Bars) -> bool:
    estimates = at.executor.map(functools.partial(estimate_simulated, str(folder), job), numbers)
    for number, _ in zip(numbers, estimates, strict=True):
        bars({"event": "estimate", "material": job.name, "number": number, "of": numbers.stop, "kept": False})
    return True
