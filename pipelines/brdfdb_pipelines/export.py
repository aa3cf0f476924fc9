"""The export job: slices of tables as image files."""

from __future__ import annotations

from pathlib import Path

import brdfdb
from brdfdb.formats import exr
from brdfdb_pipelines import terminal


def run_exr(root: Path, names: list[str], directory: Path, *, half: bool) -> None:
    """Write the EXR slices of the named materials of a store, or of all, and say where they are."""
    store = brdfdb.open(root)
    revisions = {name: store.head(name) for name in names or store}
    written: list[Path] = []
    with terminal.progress() as bar:
        for name in bar.track(revisions, description="exporting"):
            written += exr.export(store[name], directory, half=half)
    total = sum(path.stat().st_size for path in written)
    print(f"{len(written)} EXR files, {terminal.size(total)}, in {directory}")
