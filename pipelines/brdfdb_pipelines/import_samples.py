"""The import job: reads files of measurements, states what they hold, and writes their samples as netCDF."""

from __future__ import annotations

import json as _json
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from brdfdb import formats
from brdfdb.errors import ParameterError
from brdfdb.formats.netcdf import write_samples
from brdfdb.measurements.samples import Samples
from brdfdb.measurements.statement import Statement, statement
from brdfdb_pipelines import terminal

PATIENCE_S = 2.0  # time [s] after which the bar of progress appears


def run(
    files: Sequence[Path],
    *,
    file_format: str = "",
    columns: Sequence[str] = (),
    more: Mapping[str, str | None] | None = None,
    json: bool = False,
    out: Path | None = None,
) -> list[Statement]:
    """Read files, and print a statement on each.

    Parameters
    ----------
    files : sequence of Path
        Files of measurements.
    file_format : str
        One of `brdfdb.formats.IMPORTERS`; by default recognised by content.
    columns : sequence of str
        Columns of a text, ``NAME=HEADER``. A name may stand more than once.
    more : mapping, optional
        Other keywords of `brdfdb.formats.samples`; None of what is not given.
    json : bool
        Print a list of JSON objects.
    out : Path, optional
        The netCDF file to write the samples of the one file to.

    Raises
    ------
    ParameterError
        If `out` is given with several files, or a column is not written as NAME=HEADER.
    """
    if out is not None and len(files) != 1:
        raise ParameterError("--out", f"it takes the samples of one file, and there are {len(files)}", len(files), 1)
    if out is not None and out.suffix != ".nc":
        raise ParameterError("--out", f"{str(out)!r} does not end in .nc", str(out), "FILE.nc")
    keywords: dict[str, Any] = {**_columns(columns), **{key: value for key, value in (more or {}).items() if value}}
    statements: list[Statement] = []
    for file in files:
        samples, known = _read(file, file_format, keywords)
        statements.append(known)
        if out is not None:
            write_samples(samples, out)
        if not json:
            lines = [f"{file}: {known.name}", *(f"  {sentence}" for sentence in known.sentences)]
            lines += [f"  written: {out}"] if out is not None else []
            print(terminal.plain("\n".join(lines)))
    if json:
        documents = [{"file": str(file), **known.document()} for file, known in zip(files, statements, strict=True)]
        print(_json.dumps(documents, indent=1, ensure_ascii=False, allow_nan=False))
    return statements


def _columns(texts: Sequence[str]) -> dict[str, list[str]]:
    """Return the headers of each column from texts NAME=HEADER."""
    columns: dict[str, list[str]] = {}
    for text in texts:
        name, sign, header = text.partition("=")
        if not (name and sign and header):
            raise ParameterError("--column", f"{text!r} is not NAME=HEADER", text, "NAME=HEADER")
        columns.setdefault(name, []).append(header)
    return columns


def _read(file: Path, file_format: str, keywords: Mapping[str, Any]) -> tuple[Samples, Statement]:
    """Return the samples of a file and the statement on them; a bar appears after some time."""
    with terminal.progress(counted=False, transient=True) as bar:
        task = bar.add_task(file.name, total=1.0, visible=False)
        shown = threading.Timer(PATIENCE_S, lambda: bar.update(task, visible=True))
        shown.start()
        try:
            samples = formats.samples(file, file_format, **keywords)
            return samples, statement(samples, lambda share: bar.update(task, completed=share))
        finally:
            shown.cancel()
