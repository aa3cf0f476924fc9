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

from brdfdb.errors import BusyError, StoreError
from brdfdb.store.files import FileEntry, read_sealed, sealed, sha256_of, sync_path, write_file, write_files
from brdfdb.store.lock import Lock, writing
from brdfdb.store.paths import marker_path, materials_path, request_path, staging_path, store_of_staged
from brdfdb.tables import tabulation
from brdfdb.tables.layout import Layout, digest


class Block(TypedDict):
    """A complete block: its file inside the group, and whether an earlier build wrote it."""

    name: str
    entry: FileEntry
    kept: bool


def remove_begun(root: Path) -> None:
    """Remove a new store and its staged builds, unless it has a material or another build is at work."""
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
    """Remove the staging directory of a request; the caller holds the lock."""
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
    """Return a layout from JSON; the cache serves a worker that gets many blocks of one layout.

    StoreError says that the JSON is of another version of this program, which computes something else.
    """
    document = json.loads(text)
    layout = Layout.from_document(document)
    if json.loads(json.dumps(layout.document())) != document:
        raise StoreError(f"{layout.source.name}: the table was laid out by another version of this program")
    return layout


def write_block(
    staging: str, layout: str, number: int, values: NDArray[np.float32] | None = None, *, sync: bool = True
) -> Block:
    """Compute a block and write it, unless it is complete already: the task that a build gives to its workers.

    `staging` and `layout` are text: a directory that builder and worker share, and JSON. `values` are those of the
    block, if they are known already. Without `sync` the caller syncs the file. StoreError says that it cannot be
    written.
    """
    from brdfdb.store.codec import chunk_bytes, chunk_name

    directory = Path(staging)
    table = _layout(layout)
    name = chunk_name(table, number)
    path = directory / "table" / name
    marker = directory / "blocks" / f"{number:06d}.json"
    if (entry := _kept(marker, path, layout)) is not None:
        if sync:  # the build that wrote it may have been killed before
            sync_path(path)
        return {"name": name, "entry": entry, "kept": True}
    values = tabulation.block(table, table.blocks[number]) if values is None else values
    data = chunk_bytes(values, table.block_rows)
    with writing(store_of_staged(directory), table.source.name):
        entry = write_file(path, data, directory, sync=sync)
        record = {**entry, "layout": _short(layout)}
        # `_kept` compares the block with its marker, and notices a marker that a power cut damaged
        write_file(marker, json.dumps(record, indent=1).encode(), directory, sync=False)
    return {"name": name, "entry": entry, "kept": False}


def _short(layout: str) -> str:
    return digest({"layout": layout})[:16]


def _kept(marker: Path, path: Path, layout: str) -> FileEntry | None:
    """Return the entry of a block in its marker if the block on disk agrees, else None."""
    try:
        content = json.loads(marker.read_bytes())
        entry: FileEntry = {"size": content["size"], "sha256": content["sha256"]}
        agrees = (
            content["layout"] == _short(layout)
            and path.stat().st_size == entry["size"]
            and sha256_of(path) == entry["sha256"]
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return entry if agrees else None


def write_frame(staging: str, layout: str, *, sync: bool = True) -> dict[str, FileEntry]:
    """Write all of a table but its blocks, which exist, as the last task of a table; return the written files.

    Without `sync` the caller syncs them.
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
        return write_files(directory / "table", files, directory, sync=sync)


def _reader(layout: Layout, table: Path) -> Callable[[slice], NDArray[np.float32]]:
    """Return a function that reads rows of a table from the finished blocks in the group `table`.

    A small table, whose albedo is integrated, is decoded at once, each block once.
    """
    from brdfdb.store.codec import chunk_name, decoded
    from brdfdb.tables.statements import LARGE

    @lru_cache(maxsize=4)
    def block(number: int) -> NDArray[np.float32]:
        return decoded(layout, number, (table / chunk_name(layout, number)).read_bytes())

    def read(rows: slice) -> NDArray[np.float32]:
        first = rows.start // layout.block_rows
        last = (rows.stop - 1) // layout.block_rows
        start = first * layout.block_rows
        blocks = np.concatenate([block(number) for number in range(first, last + 1)])
        return blocks[rows.start - start : rows.stop - start]

    if layout.size > LARGE:
        return read
    values = np.empty(layout.shape, dtype=np.float32)
    for number, rows in enumerate(layout.blocks):
        values[rows] = decoded(layout, number, (table / chunk_name(layout, number)).read_bytes())
    return values.__getitem__
