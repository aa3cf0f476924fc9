"""The import job: it reads files of measurements, states what they contain, and makes audited tables of them."""

from __future__ import annotations

import json as _json
import math
import re
import threading
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from brdfdb import formats
from brdfdb.errors import BrdfdbError, MissingExtraError, ParameterError, StoreError, counted, import_extra, percent
from brdfdb.formats.netcdf import write_samples
from brdfdb.materials import presets
from brdfdb.materials.recipe_text import toml_of
from brdfdb.measurements.joining import common_name
from brdfdb.measurements.measured_source import slug
from brdfdb.measurements.samples import Samples
from brdfdb.measurements.statement import SampleStatement, statement
from brdfdb.store.files import write_file
from brdfdb.store.paths import NAME
from brdfdb.store.reader import Store
from brdfdb.store.summary_words import REPORT_OF_SOME
from brdfdb.tables.planner import check_tolerance
from brdfdb_pipelines import terminal, workers
from brdfdb_pipelines.build import build
from brdfdb_pipelines.build_progress import Bars, Event
from brdfdb_pipelines.build_survey import machine_memory
from brdfdb_pipelines.measured_job import MeasuredTable, measured_table
from brdfdb_pipelines.recipe_file import Recipe, path_from
from brdfdb_pipelines.workers import WorkersError

if TYPE_CHECKING:  # the audit takes half a second to load
    from brdfdb.audit import AuditReport

PATIENCE_S = 2.0  # time [s] after which the progress bar appears
TOLERANCE = 0.05  # default tolerance of tables
NOT_JUDGED = "not judged"
_LISTED = 12  # materials that a sentence names
_DOUBT = re.compile(r"(?P<word>[A-Z][\w ]*\?)|(?P<differs>At \d+ directions? .* differs)")  # starts of sentences
_UNTOLD = re.compile(r"(whether [^;()]*) \([^()]*--")  # what an option decides


@dataclass(frozen=True)
class ImportTarget:
    """A material to import: its files, the keys of a recipe that say how to read them, and its name in the store."""

    files: tuple[Path, ...]
    keys: dict[str, Any]
    name: str = ""

    @property
    def label(self) -> str:
        """Return the paths of the files."""
        return ", ".join(map(str, self.files))

    @property
    def shown(self) -> str:
        """Return the paths of the files, and the member of an archive."""
        member = self.keys.get("member", "")
        return f"{self.label} ({member})" if member else self.label

    @cached_property
    def table(self) -> MeasuredTable:
        """Return the keys, checked."""
        return measured_table(self.name or "material", {**self.keys, "samples": list(map(str, self.files))})

    def define(self, folder: Path) -> dict[str, Any]:
        """Return the keys of the material in a recipe in a folder."""
        paths = [path_from(folder, file) for file in self.files]
        given = {key: value for key, value in self.keys.items() if value}
        return {"samples": paths[0] if len(paths) == 1 else paths, **given}


@dataclass(frozen=True)
class Tables:
    """Outputs of imported samples: tables in a store, and the recipe of the same tables.

    Name and title are those of a single material; by default those of the file.
    """

    store: Path | None
    recipe: Path | None = None
    name: str | None = None
    title: str | None = None
    tolerance: float = TOLERANCE
    jobs: int = 1

    def __post_init__(self) -> None:
        check_tolerance(self.tolerance)
        if self.recipe is not None and self.recipe.suffix != ".toml":
            raise ParameterError("--recipe", f"{str(self.recipe)!r} does not end in .toml", str(self.recipe))


@dataclass
class Imported:
    """The result of an import: statements on what was read, a sentence on each refusal, and the audit of the tables."""

    statements: list[tuple[ImportTarget, SampleStatement]] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    report: AuditReport | None = None


@dataclass(frozen=True)
class ImportedTable:
    """Figures of one imported table; a row of the summary.

    `error_p99` [1] is the relative error of the table against the interpolated data, as lists show it; the table
    `keeps_tolerance` if that of 95 % of the values does. Three numbers tell whether the samples are kept:
    `held_out_p95` [1], the error of the interpolation at samples that it did not get; `worst_sample` [1], the largest
    difference of the table from a sample at its own direction; `incidence_energy` [1], the largest relative change of
    the energy of an incidence, summed over its samples. None: unknown. `measured` [1] is the share of all pairs of
    directions that were measured. The asymmetry [1] is abs(f - f') / (abs(f) + abs(f')) of the interpolated f_r, with
    light and viewer exchanged in f'; None: unknown. `uncertainty` [1] holds for 99 % of the values; the table is
    `asymmetric` if that does not explain its asymmetry. `albedo` is the largest directional albedo; None: not finite.
    Its error includes that at samples that were held out. `verdict` is that of the audit, also in words; `energy` is
    "not judged" where the error of the albedo does not tell whether it is above 1.
    """

    material: str
    revision: str
    error_p99: float
    keeps_tolerance: bool
    held_out_p95: float | None
    worst_sample: float | None
    incidence_energy: float | None
    glints: int
    measured: float
    asymmetry_median: float | None
    asymmetry_p99: float | None
    uncertainty: float | None
    asymmetric: bool | None
    albedo: float | None
    albedo_error: float | None
    at_theta_i_deg: float
    above_1: bool
    verdict: str
    verdict_in_words: str
    energy: str


def run(
    files: Sequence[Path],
    keys: dict[str, Any],
    *,
    join: bool = False,
    json: bool = False,
    full: bool = False,
    out: Path | None = None,
    tables: Tables | None = None,
) -> Imported:
    """Read files, print a statement on each, and build and audit tables of them if that is asked for.

    A folder stands for the files in it. Of several materials each has a line, with `full` the whole statement. A file
    that is refused is one sentence on stderr; the others are imported. `keys` are those of `MeasuredTable`,
    without `samples`. All materials of an archive are imported unless a `member` is named. The samples of a single file
    are written to `out`, as netCDF. With `join`, all files are one set of samples.

    Raises
    ------
    ParameterError
        If options cannot be combined; before anything is read, unless a file is an archive.
    StoreError
        If the store cannot be written.
    """
    if out is not None and out.suffix != ".nc":
        raise ParameterError("--out", f"{str(out)!r} does not end in .nc", str(out), "FILE.nc")
    if tables is not None and tables.store is not None:
        check_audit()
    result = Imported()
    targets = _targets(files_of(files), keys, join, result)
    count = len(targets) + len(result.refused)
    if out is not None and count != 1:
        raise ParameterError("--out", f"writes the samples of a single file, and there are {count}", count, 1)
    if tables is not None:
        targets = _named(targets, tables, count, result)
    start = time.monotonic()
    for number, target in enumerate(targets, 1):
        label = f"{target.label}, {number} of {len(targets)}" if len(targets) > 1 else target.label
        try:
            read = _read(target, label, PATIENCE_S - (time.monotonic() - start))
            if out is not None:
                write_samples(read.samples, out)
        except (BrdfdbError, OSError) as error:
            _refuse(result, target, error)
            continue
        result.statements.append((target, read.statement))
        stated = read.statement
        if not json and count > 1 and not full:
            print(terminal.plain(f"{target.label}: {in_a_line(stated)}"), flush=True)
        elif not json:
            lines = [f"{target.label}: {stated.name}", *(f"  {sentence}" for sentence in stated.sentences)]
            lines += [f"  written: {out}"] if out is not None else []
            print(terminal.plain("\n".join(lines)), flush=True)
    if not json and count > 1 and not full and result.statements:
        print("Statement on a file: `brdfdb import FILE`; on all files: --full")
    if count > 1 and (lost := count - len(result.statements)):
        terminal.say(f"{lost} of {count} materials {'was' if lost == 1 else 'were'} not imported")
    audited: list[ImportedTable] = []
    if tables is not None and result.statements:
        _make([target for target, _ in result.statements], tables, result)
        if result.report and tables.store:
            audited = figures_of(tables.store, result.report)
    if json:
        document: dict[str, Any] = {
            "statements": [{"file": target.label, **stated.document()} for target, stated in result.statements],
            "refused": result.refused,
        }
        if result.report is not None:
            document |= summary(audited, result.report)
        print(_json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False))
    elif result.report is not None and tables is not None:
        show_tables(audited, result.report, tables.tolerance)
    return result


def check_audit() -> None:
    """Raise MissingExtraError if the audit of a table cannot run: before the time for the table is spent."""
    for module in ("jinja2", "matplotlib", "mpmath"):
        import_extra(module)


def _targets(files: Sequence[Path], keys: dict[str, Any], join: bool, result: Imported) -> list[ImportTarget]:
    """Return the materials of files, all members of archives; files that cannot be opened are refused."""
    target = ImportTarget(tuple(files), keys)
    if join or keys.get("member"):
        return [target] if join else [replace(target, files=(file,)) for file in files]
    targets = []
    for file in files:
        one = replace(target, files=(file,))
        try:
            members = formats.members(file, one.table.format, **one.table.keywords)
        except (BrdfdbError, OSError) as error:
            _refuse(result, one, error)
            continue
        targets += [replace(one, keys={**keys, "member": member}) for member in members] or [one]
    return targets


def files_of(paths: Sequence[Path]) -> list[Path]:
    """Return files, with those in a folder, in the order of their names, instead of the folder; a zarr group is a file.

    Hidden files, and folders in a folder, are left out. ParameterError if a folder has no file.
    """
    files: list[Path] = []
    for path in paths:
        if not path.is_dir() or (path / "zarr.json").exists():
            files.append(path)
            continue
        parts = [part for part in sorted(path.iterdir()) if not part.name.startswith(".")]
        inside = [part for part in parts if not part.is_dir() or (part / "zarr.json").exists()]
        if not inside:
            raise ParameterError("FILE", f"the folder {path} has no files", str(path))
        files += inside
    return files


def in_a_line(stated: SampleStatement) -> str:
    """Return the name, samples, lights and wavelengths of a statement, and the first words of each doubt."""
    low, high = stated.wavelength_nm or (0.0, 0.0)
    of_light = f"{low:.9g} to {high:.9g} nm" if high > low else f"{low:.9g} nm" if high else ", ".join(stated.channels)
    of_light = "no wavelength" if of_light == "grey" else of_light
    doubts = []
    for sentence in (*stated.hints, *stated.notes):
        if match := _DOUBT.match(sentence):
            doubts.append("contradictions" if match["differs"] else match["word"])
    doubts += [sentence.partition(":")[0] for sentence in stated.hints if not _DOUBT.match(sentence)]
    if wrong := [abs(claim.relative) for claim in stated.wrong_claims]:
        doubts.append(f"claims of the header off by up to {percent(max(wrong))}")
    doubts += [f"cannot tell {match}" for match in _UNTOLD.findall(" ".join(stated.untold))]
    counts = f"{counted(stated.samples, 'sample')}, {counted(stated.lights, 'light')}, {of_light}"
    return f"{stated.name}; {counts}; {'; '.join(dict.fromkeys(doubts)) or 'no doubt'}"


def _refuse(result: Imported, target: ImportTarget, error: BrdfdbError | OSError) -> None:
    """Record and print the sentence of an error with the name of its file, unless it was printed before."""
    sentence = str(error)
    if isinstance(error, OSError) and not isinstance(error, BrdfdbError) and error.filename:
        sentence = f"{error.filename}: {error.strerror}"
    if not isinstance(error, MissingExtraError) and not any(file.name in sentence for file in target.files):
        sentence = f"{target.label}: {sentence}"
    if sentence not in result.refused:
        result.refused.append(sentence)
        terminal.say(sentence)


class _Read(NamedTuple):
    """Samples of a material, and the statement on them."""

    samples: Samples
    statement: SampleStatement


def _read(target: ImportTarget, label: str, patience_s: float) -> _Read:
    """Read the samples of a material; a progress bar appears after `patience_s` [s]."""
    with terminal.progress(counted=False, transient=True) as bar:
        task = bar.add_task(label, total=1.0, visible=patience_s <= 0.0)
        shown = threading.Timer(max(patience_s, 0.0), lambda: bar.update(task, visible=True))
        shown.start()
        try:
            samples = target.table.joined(target.files)
            return _Read(samples, statement(samples, lambda share: bar.update(task, completed=share)))
        finally:
            shown.cancel()


def _named(targets: Sequence[ImportTarget], tables: Tables, count: int, result: Imported) -> list[ImportTarget]:
    """Return materials with their names; materials that would have the same name are refused.

    A name is that of the command line, that of the file or the member, as words, or the words that the names of joined
    files begin with. ParameterError if a name is not allowed.
    """
    for option, text in (("--name", tables.name), ("--title", tables.title)):
        if text is not None and count != 1:
            raise ParameterError(option, f"names a single material, and there are {count}", text)
    materials: dict[str, list[ImportTarget]] = {}
    for target in targets:
        stems = [file.stem for file in target.files]
        of_files = common_name(stems) or ("" if len(stems) > 1 else stems[0])
        if tables.name is None and not of_files:
            raise ParameterError("--name", f"{target.label} have no word in common; give a name", None)
        of_files = target.keys.get("member", "").removesuffix(".h5") or of_files
        name = slug(of_files) if tables.name is None else tables.name
        if not NAME.fullmatch(name):
            raise ParameterError(
                "--name", f"{name!r} is not made of lower-case letters, digits and single hyphens, 128 at most", name
            )
        if name in presets():
            raise ParameterError("--name", f"{name!r} is the name of a preset; give {target.files[0]} another", name)
        title = {} if tables.title is None else {"title": tables.title}
        one = replace(target, name=name, keys={**target.keys, **title})
        assert one.table  # checked before anything is read
        materials.setdefault(name, []).append(one)
    for name, same in materials.items():
        if len(same) > 1:
            files = " and ".join(one.shown for one in same)
            sentence = (
                f"{files} would {'both' if len(same) == 2 else 'all'} be {name!r}; import them one by one, with --name"
            )
            result.refused.append(sentence)
            terminal.say(sentence)
    return [same[0] for same in materials.values() if len(same) == 1]


def _make(targets: Sequence[ImportTarget], tables: Tables, result: Imported) -> None:
    """Write the recipe of materials, build its tables, and audit them, where that is asked for.

    A table that fails is recorded, and the others are built.
    """
    recipe = Recipe.model_validate(_content(targets, tables.tolerance, Path()))
    recipe.jobs()
    if tables.recipe is not None:
        folder = tables.recipe.parent
        content = _content(targets, tables.tolerance, folder)
        names = ", ".join(f'"{name}"' for name in content["materials"])
        parts = [f"materials = [{names}]\ntolerance = {tables.tolerance:g}\n"]
        parts += [toml_of(name, keys) for name, keys in content["define"].items()]
        write_file(tables.recipe, "\n".join(parts).encode(), folder)
    if tables.store is None:
        return
    names_built = _build(recipe, tables.store, min(tables.jobs, len(targets)), result)
    if names_built:
        from brdfdb_pipelines import audit

        report_path = tables.store / REPORT_OF_SOME
        jobs = min(tables.jobs, len(names_built))
        result.report = audit.run(tables.store, names_built, report_path, jobs=jobs, figures=False, shown=False)


def _content(targets: Sequence[ImportTarget], tolerance: float, folder: Path) -> dict[str, Any]:
    """Return the content of a recipe file in a folder."""
    define = {target.name: target.define(folder) for target in targets}
    return {"materials": list(define), "tolerance": tolerance, "define": define}


def _build(recipe: Recipe, store: Path, jobs: int, result: Imported) -> list[str]:
    """Build tables; return the names of those that the store contains then."""
    built: list[str] = []
    failed: list[str] = []
    with workers.interruptible(jobs) as opened, Bars() as bars:

        def report(event: Event) -> None:
            if event["event"] == "failed":
                failed.append(event["error"])
            elif event["event"] in ("published", "adopted", "unchanged"):
                built.append(event["material"])
            bars(event)

        try:
            build(recipe, store, opened, report, memory=machine_memory())
        except (StoreError, WorkersError):
            raise
        except BrdfdbError:
            if not failed:
                raise
    result.refused += failed
    names = [job.name for job in recipe.measured_jobs()]
    return sorted(built, key=names.index)


def figures_of(root: Path, report: AuditReport) -> list[ImportedTable]:
    """Return the figures of the audited tables of a store."""
    from brdfdb.audit.energy import Energy
    from brdfdb.audit.reciprocity import Reciprocity

    store = Store(root)
    tables = []
    for audited in report.materials:
        metadata = store.metadata(audited.material)
        measured = metadata.measured
        error = store[audited.material].error
        assert measured is not None
        seen = measured.reciprocity.asymmetry
        samples = measured.at_samples
        energy = audited.of(Energy).table
        tables.append(
            ImportedTable(
                audited.material,
                audited.revision,
                math.nan if error is None else error.overall.p99,
                error is not None and error.overall.p95 <= metadata.whole_request["tolerance"],
                None if measured.held_out is None else measured.held_out.p95,
                None if samples is None else samples.worst.error,
                None if samples is None or samples.worst_energy is None else samples.worst_energy.error,
                0 if measured.glints is None else len(measured.glints.lit),
                1.0 if measured.extrapolated is None else 1.0 - measured.extrapolated,
                None if seen is None else seen.median,
                None if seen is None else seen.p99,
                measured.uncertainty,
                None if measured.uncertainty is None else audited.of(Reciprocity).verdict == "violates",
                energy.max_albedo,
                energy.uncertainty,
                energy.max_at_theta_i_deg,
                energy.exceeds_1_from_theta_i_deg is not None,
                audited.verdict,
                audited.verdict_in_words,
                audited.conserves_energy.word,
            )
        )
    return tables


def summary(tables: Sequence[ImportedTable], report: AuditReport) -> dict[str, Any]:
    """Return figures of all tables, and the summary, as JSON."""
    medians = [table.asymmetry_median for table in tables if table.asymmetry_median is not None]
    return {
        "tables": [asdict(table) for table in tables],
        "summary": {
            "materials": len(tables),
            "asymmetry_median": float(np.median(medians)) if medians else None,
            "asymmetric": [table.material for table in tables if table.asymmetric],
            "without_uncertainty": sum(table.uncertainty is None for table in tables),
            "above_1": [table.material for table in tables if table.above_1],
            "passes": sum(table.verdict == "passes" for table in tables),
            "not_judged": [table.material for table in tables if table.energy == NOT_JUDGED],
            "violates": report.violations,
        },
    }


def show_tables(
    tables: Sequence[ImportedTable], report: AuditReport, tolerance: float, *, origin: str = "measured"
) -> None:
    """Print a row for each table, the problems of tables, and the summary; `origin` is measured or simulated."""
    print()
    shares = {
        "error_p99": "table error (p99)",
        "held_out_p95": "held out (p95)",
        "worst_sample": "worst sample",
        "incidence_energy": "energy of incidences",
        "measured": origin,
        "asymmetry_median": "asymmetry (median)",
        "asymmetry_p99": "asymmetry (p99)",
        "uncertainty": "uncertainty (p99)",
    }
    numbers = (*shares.values(), "albedo up to")
    terminal.print_table(
        f"{origin.capitalize()} tables in {report.store}",
        ("material", *numbers, "audit"),
        [
            (
                table.material,
                *(_percent(getattr(table, field)) for field in shares),
                _albedo(table),
                table.verdict_in_words,
            )
            for table in tables
        ],
        numbers=numbers,
        less=("asymmetry (p99)", "uncertainty (p99)", "asymmetry (median)", origin, "held out (p95)"),
    )
    print(f"table error (p99): 99 % of the values are this near to the interpolated data, where f_r was {origin}")
    print("held out (p95): 95 % of the samples that were left out are this near to f_r interpolated between the others")
    print("worst sample: largest difference of the table, with its glints, from a sample at its own direction")
    print("energy of incidences: largest change of the sum of f_r cos theta_r over the samples of an incidence")
    print(f"{origin}: share of all pairs of directions; elsewhere f_r is extrapolated, and its error is unknown")
    print("asymmetry: |f - f'| / (|f| + |f'|) of the interpolated f_r, for directions up to 80 degrees; f' is f with")
    print("light and viewer exchanged; the faintest pairs are left out")
    print("uncertainty (p99): 99 % of the samples that were held out are this near to the interpolated f_r")
    print("albedo: largest value of the table, ± its uncertainty; energy is not judged if that reaches above 1")
    for audited in report.materials:
        for problem in audited.problems():
            print(f"{audited.material}: {problem}")
    for sentence in sentences(tables, tolerance):
        print(sentence)
    verdicts = dict.fromkeys(["passes", *sorted(table.verdict for table in tables)])
    counts = ", ".join(f"{word} {sum(table.verdict == word for table in tables)}" for word in verdicts)
    if len(tables) == 1:
        counts = tables[0].verdict_in_words
    unsure = [table.material for table in tables if table.energy == NOT_JUDGED]
    energy = f"; conservation of energy not judged: {_counted(unsure)}" if unsure else ""
    print(f"{counted(len(tables), 'table')} audited: {counts}{energy}")


def sentences(tables: Sequence[ImportedTable], tolerance: float) -> list[str]:
    """Return the summary of errors, asymmetries and albedos in sentences."""
    far = [table.material for table in tables if not table.keeps_tolerance]
    share = f"the tolerance of {_percent(tolerance)} for 95 % of the values"
    missed = f"{'all tables keep' if len(tables) > 1 else 'the table keeps'} to {share}"
    if far:
        missed = f"beyond {share}, even on the finest grid: {_counted(far)}"
    medians = [table.asymmetry_median for table in tables if table.asymmetry_median is not None]
    asymmetry = "reciprocity asymmetry: cannot be computed from these data"
    if medians:
        spread = f", from {_percent(min(medians))} to {_percent(max(medians))}" if len(medians) > 1 else ""
        asymmetry = (
            f"reciprocity asymmetry of f_r, interpolated: median over materials {_percent(np.median(medians))}{spread}"
        )
    beyond = [table.material for table in tables if table.asymmetric]
    unknown = sum(table.uncertainty is None for table in tables)
    judged = f"more asymmetric than their uncertainty explains: {_counted(beyond)}"
    if unknown:
        judged += f"; {unknown} of {len(tables)} state no uncertainty and are not judged"
    return [
        missed,
        asymmetry,
        judged,
        f"albedo above 1: {_counted([table.material for table in tables if table.above_1])}",
    ]


def _albedo(table: ImportedTable) -> str:
    """Return the largest albedo of a table with its error, and no more digits than this leaves."""
    if table.albedo is None:
        return "not finite"
    where = f"at {table.at_theta_i_deg:g}°"
    if not table.albedo_error:
        return f"{table.albedo:.4f} {where}"
    digits = int(np.clip(math.ceil(-math.log10(table.albedo_error)), 1, 4))
    return f"{table.albedo:.{digits}f} ± {table.albedo_error:.1g} {where}"


def _counted(names: Sequence[str]) -> str:
    """Return the number of names, and the first of them."""
    if not names:
        return "none"
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return f"{len(names)} ({', '.join(names[:_LISTED])}{more})"


def _percent(value: float | np.floating[Any] | None) -> str:
    """Return a share as text in percent with two digits, a hyphen if it is not known."""
    if value is None:
        return "-"
    return f"{100.0 * value:.2g} %" if value < 0.0995 else f"{100.0 * value:.0f} %"
