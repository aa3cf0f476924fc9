"""Staging: a table while it is written, so that a killed build can be resumed.

ROOT/.staging/NAME/lock              lock of the material: one build at a time
ROOT/.staging/NAME/KEY/              one request, named by the first digits of its digest
ROOT/.staging/NAME/KEY/request.json  the request
ROOT/.staging/NAME/KEY/layout.json   the layout of the table
ROOT/.staging/NAME/KEY/table/        the zarr group
ROOT/.staging/NAME/KEY/blocks/       a marker for each complete block: size, sha256 and layout

`write_block` computes and writes a block, `write_frame` the rest of the table. Their arguments are plain strings and
numbers, so that threads, processes and other machines with the same file system can call them. The holder of the lock
publishes.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import (
    BusyError,
    StoreError,
)
from brdfdb.store.files import Entry, sha256_of, write_file, write_files
from brdfdb.store.lock import Lock, writing
from brdfdb.store.paths import marker_path, materials_path, request_path, staging_path, store_of_staged
from brdfdb.store.sealed_json import read_sealed, sealed, write_json
from brdfdb.tables import tabulation
from brdfdb.tables.layout import Layout, digest


class Block(TypedDict):
    """A block that is whole: its file inside the group, and whether an earlier build had written it."""

    name: str
    entry: Entry
    kept: bool


def remove_begun(root: Path) -> None:
    """Remove a store that was made a moment ago, with what is staged; a material or another build makes it stay."""
    if any(materials_path(root).glob("*")):
        return
    with suppress(OSError, BusyError, StoreError):
        for staged in list(staging_path(root).iterdir()):
            with Lock(root, staged.name, wait=False):
                for path in staged.iterdir():
                    if path.is_dir():
                        shutil.rmtree(path)
        materials_path(root).rmdir()
        staging_path(root).rmdir()
        marker_path(root).unlink()
        root.rmdir()


def prepare(root: Path, name: str, request: Mapping[str, Any], layout: str) -> Path:
    """Make the staging directory of a request, with its layout as JSON, and return it."""
    staging = request_path(root, name, digest(request))
    with writing(root, name):
        (staging / "blocks").mkdir(parents=True, exist_ok=True)
        texts = sealed(dict(request)), sealed(json.loads(layout))
        for file, text in zip(("request.json", "layout.json"), texts, strict=True):
            if not (staging / file).is_file() or (staging / file).read_bytes() != text:
                write_file(staging / file, text, staging, sync=False)  # the digest in its first line is checked
    return staging


def discard(root: Path, name: str, request: Mapping[str, Any]) -> None:
    """Remove what is staged of a request; the lock must be held."""
    shutil.rmtree(request_path(root, name, digest(request)), ignore_errors=True)


def planned(root: Path, name: str, request: Mapping[str, Any]) -> str | None:
    """Return the layout that an earlier build of the same request left staged, as JSON; None without one."""
    staging = request_path(root, name, digest(request))
    try:
        if read_sealed(staging / "request.json", name) != json.loads(json.dumps(request)):
            return None
        text = json.dumps(read_sealed(staging / "layout.json", name))
        _layout(text)
    except (OSError, StoreError, ValueError, KeyError):
        return None
    return text


@lru_cache(maxsize=64)
def _layout(text: str) -> Layout:
    """Return a layout from JSON. Kept, since a worker gets many blocks of one.

    Raises
    ------
    StoreError
        If this program would compute something else than the program that wrote the JSON.
    """
    document = json.loads(text)
    layout = Layout.from_document(document)
    if json.loads(json.dumps(layout.document())) != document:
        raise StoreError(f"{layout.source.name}: the table was laid out by another version of this program")
    return layout


def write_block(staging: str, layout: str, number: int, values: NDArray[np.float32] | None = None) -> Block:
    """Compute a block and write it, unless it is there already: the task that a build gives to its workers.

    Parameters
    ----------
    staging : str
        The staging directory, on a file system that builder and worker share.
    layout : str
        Of the table, as JSON.
    number : int
        Of the block.
    values : float32 array, optional
        The values of the block, if they are known.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    from brdfdb.store.codec import chunk_bytes, chunk_name

    directory = Path(staging)
    table = _layout(layout)
    name = chunk_name(table, number)
    path = directory / "table" / name
    marker = directory / "blocks" / f"{number:06d}.json"
    if (entry := _kept(marker, path, layout)) is not None:
        return {"name": name, "entry": entry, "kept": True}
    values = tabulation.block(table, table.blocks[number]) if values is None else values
    data = chunk_bytes(values, table.block_rows)
    with writing(store_of_staged(directory), table.source.name):
        entry = write_file(path, data, directory)
        # `_kept` reads the block, and notices what a power cut left of the marker
        write_json(marker, {**entry, "layout": _short(layout)}, directory, sync=False)
    return {"name": name, "entry": entry, "kept": False}


def _short(layout: str) -> str:
    return digest({"layout": layout})[:16]


def _kept(marker: Path, path: Path, layout: str) -> Entry | None:
    """Return the entry of a block in its marker, if the block on disk agrees; None else."""
    try:
        content = json.loads(marker.read_bytes())
        entry: Entry = {"size": content["size"], "sha256": content["sha256"]}
        whole = (
            content["layout"] == _short(layout)
            and path.stat().st_size == entry["size"]
            and sha256_of(path) == entry["sha256"]
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return entry if whole else None


def write_frame(staging: str, layout: str) -> dict[str, Entry]:
    """Write all of a table but its blocks, which are there: the last task of a table; returns the files it wrote.

    Raises
    ------
    StoreError
        If they cannot be written.
    """
    from brdfdb.store.codec import frame_files
    from brdfdb.tables.statements import stated_metadata

    directory = Path(staging)
    table = _layout(layout)
    request = read_sealed(directory / "request.json", table.source.name)
    metadata = stated_metadata(table, _reader(table, directory / "table"), request)
    frame = tabulation.frame(table)
    attributes = {**frame.attrs, **metadata.attributes()}
    with writing(store_of_staged(directory), table.source.name):
        files = frame_files(table, frame._replace(attrs=attributes))
        return write_files(directory / "table", files, directory)


def _reader(layout: Layout, table: Path) -> Callable[[slice], NDArray[np.float32]]:
    """Return a function that reads rows of a table from the finished blocks in the group `table`.

    A table whose albedo is integrated is held as a whole, so that each block is decoded once.
    """
    from brdfdb.store.codec import chunk_name, decoded
    from brdfdb.tables.statements import LARGE

    @lru_cache(maxsize=4)
    def block(number: int) -> NDArray[np.float32]:
        return decoded(layout, number, (table / chunk_name(layout, number)).read_bytes())

    def read(rows: slice) -> NDArray[np.float32]:
        first, last = rows.start // layout.block_rows, (rows.stop - 1) // layout.block_rows
        start = first * layout.block_rows
        blocks = np.concatenate([block(number) for number in range(first, last + 1)])
        return blocks[rows.start - start : rows.stop - start]

    if layout.size > LARGE:
        return read
    whole = np.empty(layout.shape, dtype=np.float32)
    for number, rows in enumerate(layout.blocks):
        whole[rows] = decoded(layout, number, (table / chunk_name(layout, number)).read_bytes())
    return whole.__getitem__
