"""The job of `brdfdb plot`: the plots of tables as files."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

import brdfdb
from brdfdb.store.files import write_file
from brdfdb_pipelines import terminal

_SIZE = (6.4, 3.9)  # inches
_DPI = 150


def run(
    root: str | Path,
    names: Sequence[str],
    kinds: Sequence[str],
    file_format: str,
    wavelength_nm: float | None,
    directory: Path,
) -> None:
    """Write NAME-KIND.FORMAT for each material and kind, and print where."""
    store = brdfdb.open(root)
    revisions = {name: store.head(name) for name in names}  # a name that is unknown is refused before anything is drawn
    directory.mkdir(parents=True, exist_ok=True)
    with terminal.progress() as bar:
        task = bar.add_task("plotting", total=len(revisions) * len(kinds))
        for name in revisions:
            table = store[name]
            for kind in kinds:
                # a fixed salt and no date: the same table gives the same bytes
                with mpl.rc_context({"svg.hashsalt": f"{name}-{kind}"}):
                    figure = Figure(figsize=_SIZE, layout="constrained")
                    getattr(table.plot, kind)(wavelength_nm=wavelength_nm, ax=figure.add_subplot())
                    path = directory / f"{name}-{kind}.{file_format}"
                    undated = {"Date": None} if file_format == "svg" else None
                    drawn = io.BytesIO()
                    figure.savefig(drawn, format=file_format, dpi=_DPI, metadata=undated)
                    write_file(path, drawn.getvalue(), directory)  # whole, or not at all
                bar.advance(task)
    files = len(revisions) * len(kinds)
    print(f"{files} {file_format.upper()} file{'s' if files > 1 else ''} in {directory}")
