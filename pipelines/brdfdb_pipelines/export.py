"""The export job: tables as files of other formats."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import brdfdb
from brdfdb.errors import counted
from brdfdb.formats import EXPORTERS
from brdfdb_pipelines import terminal


def run(root: Path, names: list[str], directory: Path, file_format: str, options: Mapping[str, Any]) -> None:
    """Write the named materials of a store, or all of them, in a format of `EXPORTERS`, and print the number of files.

    A format with several kinds of files writes one of each, NAME_KIND.SUFFIX, unless the options choose a kind.
    """
    exporter, store = EXPORTERS[file_format], brdfdb.open(root)
    revisions = {name: store.head(name) for name in names or store}
    kinds = (options["kind"],) if "kind" in options else exporter.kinds
    directory.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    with terminal.progress() as bar:
        for name in bar.track(revisions, description="exporting tables"):
            table = store[name]
            for kind in kinds:
                written.append(directory / f"{name}_{kind}{exporter.suffix}")
                exporter.write(table, written[-1], **{**options, "kind": kind})
            if not kinds:
                written.append(directory / f"{name}{exporter.suffix}")
                exporter.write(table, written[-1], **options)
    total = sum(path.stat().st_size for path in written)
    print(f"{counted(len(written), f'{file_format.upper()} file')}, {terminal.size(total)}, in {directory}")
