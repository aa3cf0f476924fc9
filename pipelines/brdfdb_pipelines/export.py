"""The export job: tables as files of other formats."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from brdfdb.errors import CannotHoldError, ParameterError, WriteError, counted
from brdfdb.formats import EXPORTERS, written_by
from brdfdb.formats._record import extrapolated_remark
from brdfdb.formats._written import Written
from brdfdb.place import path_of
from brdfdb.store import open_tables
from brdfdb.store.summary_words import NOT_AUDITED, audited_materials, is_of_store
from brdfdb_pipelines import terminal, workers

_FEW = 3  # materials that are written before other processes would have started
_NAMED = 3  # materials that a remark names


class _Export(NamedTuple):
    """Result of the export of one material: its files, and the reason why one of them cannot be written."""

    name: str
    files: list[Written]
    refusal: str = ""


def run(
    root: Path | str,
    names: list[str],
    directory: Path,
    file_format: str,
    options: Mapping[str, Any],
    audit: Path | None,
    jobs: int,
) -> bool:
    """Write the named materials of a store, or all of them, as files; return whether all are accurate enough.

    A format with several kinds of files writes one of each, NAME_KIND.SUFFIX, unless the options choose a kind. Of all
    materials, those that the format cannot hold are left out and named. `audit` is the report whose verdicts are
    written, by default that of the store. A few materials are written by `jobs` threads, more by as many processes.

    Raises
    ------
    ParameterError
        If `audit` is no report.
    CannotHoldError
        If the format cannot hold a material that is named, or any of all; the others are written and printed.
    WriteError
        If a file cannot be written.
    """
    directory = path_of(directory, "directory")
    store = open_tables(root)
    revisions = {name: store.head(name) for name in names or store}
    verdicts = _verdicts(root, audit, revisions)
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = "it is a file, not a directory" if isinstance(error, FileExistsError) else error.strerror
        raise WriteError(f"cannot write to {directory}: {reason}") from None
    write = partial(_write, root, directory, file_format, options, verdicts)
    exports: list[_Export] = []
    pool = workers.threads(jobs) if len(revisions) <= _FEW else workers.processes(jobs)
    with terminal.progress() as bar, pool as opened:
        try:
            results = opened.executor.map(write, revisions)
            exports += bar.track(results, total=len(revisions), description="exporting tables")
        except BaseException:
            opened.executor.shutdown(cancel_futures=True)
            raise
    refusals = [export.refusal for export in exports if export.refusal]
    within = not any(export.files for export in exports) or _report(exports, directory, file_format)
    if names and refusals:
        raise CannotHoldError("; ".join(refusals))
    if refusals and not any(export.files for export in exports):
        raise CannotHoldError(refusals[0])
    for refusal in refusals:
        print(f"{refusal}; left out")
    return within


def _write(
    root: Path | str,
    directory: Path,
    file_format: str,
    options: Mapping[str, Any],
    verdicts: Mapping[str, str],
    name: str,
) -> _Export:
    """Write the files of one material."""
    exporter = EXPORTERS[file_format]
    table = open_tables(root)[name]
    verdict = verdicts.get(name, NOT_AUDITED)
    kinds = (options["kind"],) if "kind" in options else exporter.kinds
    paths = [(directory / f"{name}_{kind}{exporter.suffix}", {"kind": kind}) for kind in kinds]
    files: list[Written] = []
    try:
        for path, kind in paths or [(directory / f"{name}{exporter.suffix}", {})]:
            written = written_by(exporter, table, path, verdict=verdict, **{**options, **kind})
            files.append(replace(written, remarks=(*written.remarks, *extrapolated_remark(table))))
    except (CannotHoldError, ParameterError) as error:  # also for an option that the table does not allow
        return _Export(name, files, str(error) if name in str(error) else f"{name}: {error}")
    return _Export(name, files)


def _verdicts(root: Path | str, audit: Path | None, revisions: Mapping[str, str]) -> dict[str, str]:
    """Return the verdicts of an audit report on these revisions by name; none if the store has no report."""
    try:
        materials = audited_materials(root) if audit is None else json.loads(audit.read_bytes())["materials"]
        ours = [entry for entry in materials if is_of_store(root, entry)]
        given = {
            (entry["material"], entry["revision"]): entry.get("verdict_in_words") or entry["verdict"] for entry in ours
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not a report of `brdfdb audit`"
        raise ParameterError("audit", f"{audit} cannot be read: {reason}", str(audit)) from None
    return {key[0]: given[key] for key in revisions.items() if key in given}


def _report(exports: list[_Export], directory: Path, file_format: str) -> bool:
    """Print what was written, and what is beyond its tolerance; return True if nothing is beyond."""
    written = [(export.name, files) for export in exports for files in export.files]
    more_files = sum(len(files.paths) - 1 for _, files in written)
    total = sum(files.nbytes for _, files in written)
    others = f" and {more_files} more" if more_files else ""
    print(f"{counted(len(written), f'{file_format.upper()} file')}{others}, {terminal.size(total)}, in {directory}")
    stated = [(files.error.document()["p99"], files.paths[0].name) for _, files in written if files.error is not None]
    if stated:
        worst, file = max(stated)
        print(f"error relative to the table: 99 % of the values within {_share(worst)} ({file}); files state theirs")
    known = [(files.error.statement, files.paths[0].name) for _, files in written if files.error is not None]
    if statements := [(statement, name) for statement, name in known if statement is not None]:
        whole, file = max(statements, key=lambda item: item[0].p98)
        rows = whole.places
        of_places = {"near the light": rows.alongside, "next to the horizon": rows.one_grazing + rows.both_grazing}
        shown = [  # the error is 0 where there are no data
            f"{place} {_share(max(errors)) if any(errors) or whole.against == 'the model' else 'there are no data'}"
            for place, errors in of_places.items()
        ]
        print(
            f"error relative to {whole.against}, with that of the table: 98 % of the values within {_share(whole.p98)} "
            f"({file}), {', '.join(shown)}"
        )
    beyond = [files for _, files in written if not files.within]
    for files in beyond:
        assert files.error is not None
        assert files.tolerance is not None
        p99 = files.error.document()["p99"]
        print(f"{files.paths[0].name}: {_share(p99)}, above the tolerance of {_share(files.tolerance)}")
    for remark in sorted({remark for _, files in written for remark in files.remarks}):
        names = list(dict.fromkeys(name for name, files in written if remark in files.remarks))
        more = f" and {counted(len(names) - _NAMED, 'other material')}" if len(names) > _NAMED else ""
        print(f"{', '.join(names[:_NAMED])}{more}: {remark}")
    return not beyond


def _share(error: float) -> str:
    """Return a relative error in percent, or above 100 % as a multiple of the value."""
    return f"{100.0 * error:.3g}%" if error <= 1.0 else f"{error:.3g} times the value"
