"""The export job: tables as files of other formats."""

from __future__ import annotations

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import brdfdb
from brdfdb.errors import counted
from brdfdb.formats import EXPORTERS
from brdfdb.store.reader import Store
from brdfdb_pipelines import terminal


def run(root: Path, names: list[str], directory: Path, file_format: str, options: Mapping[str, Any]) -> None:
    """Write the named materials of a store, or all of them, in a format of `EXPORTERS`, and print the number of files.

    A format with several kinds of files writes one of each, NAME_KIND.SUFFIX, unless the options choose a kind.
    """
    store = brdfdb.open(root)
    revisions = {name: store.head(name) for name in names or store}
    directory.mkdir(parents=True, exist_ok=True)
    write = partial(_write, store, directory=directory, file_format=file_format, options=options)
    written: list[Path] = []
    with terminal.progress() as bar, ThreadPoolExecutor(os.cpu_count()) as threads:
        for paths in bar.track(threads.map(write, revisions), total=len(revisions), description="exporting tables"):
            written += paths
    total = sum(path.stat().st_size for path in written)
    print(f"{counted(len(written), f'{file_format.upper()} file')}, {terminal.size(total)}, in {directory}")


def _write(store: Store, name: str, *, directory: Path, file_format: str, options: Mapping[str, Any]) -> list[Path]:
    """Write the files of one material, and return their paths."""
    exporter, table = EXPORTERS[file_format], store[name]
    kinds = (options["kind"],) if "kind" in options else exporter.kinds
    if not kinds:
        path = directory / f"{name}{exporter.suffix}"
        exporter.write(table, path, **options)
        return [path]
    paths = [directory / f"{name}_{kind}{exporter.suffix}" for kind in kinds]
    for kind, path in zip(kinds, paths, strict=True):
        exporter.write(table, path, **{**options, "kind": kind})
    return paths
