"""The import job: reads files of measurements, states what they hold, and makes audited tables of them."""

from __future__ import annotations

import json as _json
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brdfdb import formats
from brdfdb.errors import BrdfdbError, MissingExtraError, ParameterError
from brdfdb.formats.netcdf import write_samples
from brdfdb.measurements.samples import Samples
from brdfdb.measurements.statement import SampleStatement, statement
from brdfdb_pipelines import import_tables, terminal
from brdfdb_pipelines.import_tables import Tables, Target

if TYPE_CHECKING:
    from brdfdb.audit import AuditReport
    from brdfdb_pipelines.import_summary import Line

PATIENCE_S = 2.0  # time [s] after which the bar of progress appears


@dataclass
class Imported:
    """The result of an import.

    Attributes
    ----------
    statements : list of (Target, SampleStatement)
        The materials that were read.
    refused : list of str
        A sentence on each file or table that was refused.
    report : AuditReport or None
        Audit of the tables; None if no table was built.
    """

    statements: list[tuple[Target, SampleStatement]] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    report: AuditReport | None = None


def run(
    files: Sequence[Path],
    keys: dict[str, Any],
    *,
    join: bool = False,
    json: bool = False,
    out: Path | None = None,
    tables: Tables | None = None,
) -> Imported:
    """Read files, print a statement on each, and build and audit tables of them if that is asked for.

    A file that is refused is one sentence on stderr; the others are imported.

    Parameters
    ----------
    files : sequence of Path
        Files of measurements.
    keys : dict
        Keys of `brdfdb_pipelines.measured_job.MeasuredTable`, `samples` apart. All materials of an archive are
        imported unless a `member` is named.
    join : bool
        Take all files as one set of samples.
    json : bool
        Print one JSON object.
    out : Path, optional
        The netCDF file to write the samples of the one material to.
    tables : Tables, optional
        What to make of the samples beside statements.

    Raises
    ------
    ParameterError
        If options do not go together; before anything is read, unless a file is an archive.
    StoreError
        If the store cannot be written.
    """
    if out is not None and out.suffix != ".nc":
        raise ParameterError("--out", f"{str(out)!r} does not end in .nc", str(out), "FILE.nc")
    result = Imported()
    targets = _targets(files, keys, join, result)
    count = len(targets) + len(result.refused)
    if out is not None and count != 1:
        raise ParameterError("--out", f"it takes the samples of one file, and there are {count}", count, 1)
    if tables is not None:
        targets, same = import_tables.named(targets, tables, count)
        result.refused += same
        for sentence in same:
            terminal.say(sentence)
    start = time.monotonic()
    for number, target in enumerate(targets, 1):
        label = f"{target.label}, {number} of {len(targets)}" if len(targets) > 1 else target.label
        try:
            samples, known = _read(target, label, PATIENCE_S - (time.monotonic() - start))
            if out is not None:
                write_samples(samples, out)
        except (BrdfdbError, OSError) as error:
            _refuse(result, target, error)
            continue
        result.statements.append((target, known))
        if not json:
            lines = [f"{target.label}: {known.name}", *(f"  {sentence}" for sentence in known.sentences)]
            lines += [f"  written: {out}"] if out is not None else []
            print(terminal.plain("\n".join(lines)), flush=True)
    if count > 1 and (lost := count - len(result.statements)):
        terminal.say(f"{lost} of {count} materials {'was' if lost == 1 else 'were'} not imported")
    audited: list[Line] = []
    if tables is not None and result.statements:
        made = import_tables.make([target for target, _ in result.statements], tables)
        result.refused += made.refused
        result.report = made.report
        audited = _lines(tables.store, made.report) if made.report and tables.store else []
    if json:
        print(_json.dumps(_document(result, audited), indent=1, ensure_ascii=False, allow_nan=False))
    elif result.report is not None and tables is not None:
        from brdfdb_pipelines import import_summary

        import_summary.show(audited, result.report, tables.tolerance)
    return result


def _lines(store: Path, report: AuditReport) -> list[Line]:
    from brdfdb_pipelines.import_summary import lines_of  # with the audit, which takes half a second to load

    return lines_of(store, report)


def _document(result: Imported, audited: Sequence[Line]) -> dict[str, Any]:
    """Return the result as JSON."""
    document: dict[str, Any] = {
        "statements": [{"file": target.label, **known.document()} for target, known in result.statements],
        "refused": result.refused,
    }
    if result.report is not None:
        from brdfdb_pipelines import import_summary

        document |= import_summary.document(audited, result.report)
    return document


def _targets(files: Sequence[Path], keys: dict[str, Any], join: bool, result: Imported) -> list[Target]:
    """Return the materials of files, all members of archives; files that cannot be opened are refused."""
    target = Target(tuple(files), keys)
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


def _refuse(result: Imported, target: Target, error: BrdfdbError | OSError) -> None:
    """Record and print the sentence of an error with the name of its file, unless it was printed before."""
    sentence = str(error)
    if isinstance(error, OSError) and not isinstance(error, BrdfdbError) and error.filename:
        sentence = f"{error.filename}: {error.strerror}"
    if not isinstance(error, MissingExtraError) and not any(file.name in sentence for file in target.files):
        sentence = f"{target.label}: {sentence}"
    if sentence not in result.refused:
        result.refused.append(sentence)
        terminal.say(sentence)


def _read(target: Target, label: str, patience_s: float) -> tuple[Samples, SampleStatement]:
    """Return the samples of a material and the statement on them; a bar appears after some time."""
    with terminal.progress(counted=False, transient=True) as bar:
        task = bar.add_task(label, total=1.0, visible=patience_s <= 0.0)
        shown = threading.Timer(max(patience_s, 0.0), lambda: bar.update(task, visible=True))
        shown.start()
        try:
            samples = target.table.joined(target.files)
            return samples, statement(samples, lambda share: bar.update(task, completed=share))
        finally:
            shown.cancel()
