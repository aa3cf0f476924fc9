"""Publication of an edition: the groups of a store, its families, the catalogue, the index, and last the root."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from brdfdb.errors import ParameterError, StoreError, counted, import_extra
from brdfdb.store.edition.catalogue import encoded_rows, rows_of
from brdfdb.store.edition.groups import EditionGroup, grouped
from brdfdb.store.edition.objects import ChangedRootError, Objects, Versioned, objects_at
from brdfdb.store.edition.records import (
    FORMAT,
    FORMAT_VERSION,
    EditionIndex,
    GroupEntry,
    RevisionFiles,
    catalogue_key,
    encoded_root,
    family_key,
    index_key,
    read_index,
    read_root,
    records_key,
    sha256,
)
from brdfdb.store.files import seal_of
from brdfdb.store.paths import EDITION, marker_path, snapshot_path, store_around
from brdfdb.store.reader import Store

FEW_NAMES = 10_000  # materials up to which the index has all names


class PublishedEdition(NamedTuple):
    """An edition that was published: its digest, its size, and the bytes in it of `brdf` for other readers.

    `replaced` says in words which other edition it replaced.
    """

    digest: str
    materials: int
    objects: int
    bytes: int
    plain_bytes: int = 0
    replaced: str = ""


def publish_edition(
    root: Path,
    destination: str | Path,
    snapshot: str | None = None,
    *,
    plain: bool = False,
    rewrite: bool = False,
    storage_options: Mapping[str, Any] | None = None,
    advance: Callable[[], None] = lambda: None,
) -> PublishedEdition:
    """Publish the current revisions of a store, or those of a snapshot, as an edition.

    Every file is checked while it is read. Objects that the destination has already are not written again; those of
    earlier editions stay, so that their readers go on. The root is swapped last.

    Parameters
    ----------
    root : path
        Directory of the store.
    destination : path or address
        A directory, made if it does not exist, or ``s3://bucket/prefix``, ``gs://``, ``az://``.
    snapshot : str, optional
        Name of a snapshot of the store.
    plain : bool
        If True, also write f_r itself [1/sr] as an array ``brdf``, for readers of zarr that do not know the formula.
    rewrite : bool
        If True, also write objects that the destination has already: some may be lost or damaged.
    storage_options : mapping, optional
        Options of obstore for the bucket.
    advance : callable
        Is called after each material.

    Raises
    ------
    ParameterError
        If the destination is a store or lies in one, or is only read.
    StoreError
        If a table is damaged, the destination cannot be written, or another edition was published there meanwhile.
    """
    import_extra("pyarrow")  # before anything is written
    store = Store(root, snapshot=snapshot)
    objects = destination_at(destination, storage_options)
    before = objects.versioned(EDITION)
    names = sorted(store)
    if not names:
        raise StoreError(f"the store at {root} has no material to publish")

    def revisions() -> Iterator[RevisionFiles]:
        for name in names:
            current = store.revision(name)
            yield RevisionFiles(current.manifest, {key: current.read(key) for key in current.manifest["files"]})
            advance()

    entries: list[GroupEntry] = []
    rows: list[dict[str, Any]] = []
    plain_bytes = 0
    for group in grouped(revisions(), plain=plain):
        write_group(objects, group, rewrite=rewrite)
        entries.append(group.entry)
        rows += rows_of(group)
        plain_bytes += group.plain_bytes
    rows.sort(key=lambda row: str(row["name"]))
    families = {name: json.dumps(store.family_content(name)).encode() for name in store.families()}
    pin = {} if snapshot is None else {"name": snapshot, "sha256": seal_of(snapshot_path(store.root, snapshot))}
    edition = finish_edition(objects, before, entries, encoded_rows(rows), families, pin)
    return edition._replace(plain_bytes=plain_bytes, replaced=replaced(objects, before, edition))


def destination_at(place: str | Path, storage_options: Mapping[str, Any] | None = None) -> Objects:
    """Return the objects at the destination of an edition; ParameterError if it is a store or lies in one."""
    objects = objects_at(place, storage_options)
    path = Path(objects.name)
    if path.is_absolute() and (marker_path(path).is_file() or store_around(path)):
        raise ParameterError("destination", f"{path} is a store, or lies in one; name another directory", str(path))
    return objects


def replaced(objects: Objects, before: Versioned, edition: PublishedEdition) -> str:
    """Return in words which other edition had the root `before`; empty if there was none."""
    if before.content is None:
        return ""
    try:
        digest = read_root(before.content, objects.name)["index"]
        if digest == edition.digest:
            return ""
        return f"an edition of {counted(read_index(objects, digest)['materials'], 'material')}, sha256 {digest}"
    except StoreError:
        return "an edition that cannot be read"


def write_group(objects: Objects, group: EditionGroup, *, rewrite: bool = False) -> None:
    """Write a group, and last its records; unless the place has it, or with `rewrite`."""
    digest = group.digest
    if rewrite or not objects.has(records_key(digest)):
        objects.put({f"groups/{digest}/{key}": content for key, content in group.files.items()})
        objects.put({records_key(digest): group.records})


def finish_edition(
    objects: Objects,
    before: Versioned,
    entries: Sequence[GroupEntry],
    catalogue: bytes,
    families: Mapping[str, bytes],
    snapshot: Mapping[str, str],
) -> PublishedEdition:
    """Write the families, the catalogue and the index of groups that are written, and swap the root.

    `before` is the root at the beginning; StoreError says that another publisher has replaced it.
    """
    entries = sorted(entries, key=lambda entry: (entry["first"], entry["last"], entry["digest"]))
    materials = sum(entry["materials"] for entry in entries)
    if materials > FEW_NAMES:
        entries = [{key: value for key, value in entry.items() if key != "names"} for entry in entries]  # type: ignore[misc]
    digests = {name: sha256(content) for name, content in families.items()}
    objects.put({family_key(digests[name]): content for name, content in families.items()})
    objects.put({catalogue_key(sha256(catalogue)): catalogue})
    size = sum(entry["bytes"] for entry in entries) + len(catalogue) + sum(map(len, families.values()))
    index: EditionIndex = {
        "format": f"{FORMAT}-index",
        "version": FORMAT_VERSION,
        "materials": materials,
        "bytes": size,
        "groups": list(entries),
        "families": digests,
        "catalogue": sha256(catalogue),
    }
    if snapshot:
        index["snapshot"] = dict(snapshot)
    content = json.dumps(index, indent=1).encode()
    digest = sha256(content)
    objects.put({index_key(digest): content})
    root = encoded_root(digest)
    try:
        objects.swap(EDITION, root, before)
    except ChangedRootError:
        if objects.versioned(EDITION).content != root:  # another builder may have published the same edition
            raise
    count = sum(entry["objects"] for entry in entries) + len(families) + 3
    return PublishedEdition(digest, materials, count, size + len(content))
