"""The revisions of a material: how the current one stands to a request, history, rollback, verification, collection."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from brdfdb.layout import digest
from brdfdb.manifest import (
    Summary,
    check_manifest,
    manifest_of,
    number_of,
    read_json,
)
from brdfdb.staging import BusyError, Lock, adoptable, point_to, summary_of, writing
from brdfdb.store import Store, StoreError, UnknownMaterialError

REQUIRED = ("title", "material", "table_version", "model", "model_version", "parameters", "source", "conventions")


@dataclass(frozen=True)
class Standing:
    """How a material stands to a request.

    Attributes
    ----------
    state : str
        "current" if the current revision answers it and is undamaged, "adoptable" if another one does, else "missing".
    revision : str
        The one that answers it; empty if none does.
    why : str
        In a phrase, why the current revision does not.
    """

    state: Literal["current", "adoptable", "missing"]
    revision: str = ""
    why: str = ""


def standing(root: Path, name: str, request: Mapping[str, Any]) -> Standing:
    """How a material stands to a request, after a look at every byte of the revisions in question."""
    wanted = digest(request)
    pointer = root / "materials" / name / "HEAD.json"
    why = "new"
    if pointer.is_file():
        try:
            store = Store(root)
            group, manifest_sha256 = store.location(name)
            head = read_json(pointer)
            if head.get("request_sha256") == wanted:
                check_manifest(group, manifest_sha256, contents=True)
                return Standing("current", group.name)
            why = difference(store.attributes(name).get("request", {}), request)
        except StoreError as error:
            why = str(error)
    found = adoptable(root, name, wanted)
    return Standing("missing", "", why) if found is None else Standing("adoptable", found, why)


def difference(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    """In a phrase, how a request differs from that of the current table."""
    if not old:
        return "the current table does not say what was asked for"
    new = json.loads(json.dumps(new))
    said: list[str] = []
    for key in sorted({*old, *new}):
        before, after = old.get(key), new.get(key)
        if before == after:
            continue
        words = key.replace("_", " ")
        if isinstance(before, dict) and isinstance(after, dict) and key == "material":
            parts = [part for part in sorted({*before, *after}) if before.get(part) != after.get(part)]
            said.append(f"{', '.join(part.replace('_', ' ') for part in parts)} changed")
        elif isinstance(before, int | str) and isinstance(after, int | str):
            said.append(f"{words} {before} -> {after}")
        else:
            said.append(f"{words} changed")
    return ", ".join(said)


@dataclass(frozen=True)
class Revision:
    """A line of a history: a revision, what its manifest says, and whether it is the current one."""

    name: str
    summary: Summary
    current: bool


def history(root: Path, name: str) -> list[Revision]:
    """The revisions of a material that are whole, oldest first.

    Raises
    ------
    UnknownMaterialError
        If the store has no such material.
    StoreError
        If a manifest cannot be read.
    """
    current = Store(root).path(name)
    return [Revision(group.name, summary_of(group), group == current) for group in _whole(current.parent)]


def _whole(material: Path) -> list[Path]:
    """The revisions of a material that have a directory and a manifest, oldest first."""
    found = sorted((number_of(path.name), path) for path in material.iterdir())
    return [path for number, path in found if number and path.is_dir() and manifest_of(path).is_file()]


def rollback(root: Path, name: str, revision: str) -> str:
    """Make an older revision current again, or a newer one; returns the one that was current.

    Raises
    ------
    UnknownMaterialError
        If the store has no such material.
    StoreError
        If the material has no such revision, or it is damaged.
    """
    current = Store(root).path(name)
    with Lock(root, name):
        known = [group.name for group in _whole(current.parent)]
        if revision not in known:
            raise StoreError(f"{name} has no revision {revision!r}; it has {', '.join(known)}")
        before = Store(root).path(name).name
        check_manifest(current.with_name(revision), None, contents=True)
        with writing(root, name):
            point_to(current.parent, revision)
    return before


def verify(root: Path, name: str) -> int:
    """Check all of the current revision of a material; returns its bytes.

    Sizes and sha256 of its files against the manifest, that against the pointer, and that nothing else lies there;
    every chunk is decoded, which checks its crc32c; dimensions, types and shapes agree, and the attributes are those of
    a table.

    Raises
    ------
    UnknownMaterialError
        If the store has no such material.
    StoreError
        Naming what is damaged first.
    """
    import zarr

    from brdfdb.whole import Whole

    group, manifest_sha256 = Store(root).location(name)
    where = f"{name} {group.name}"
    files = check_manifest(group, manifest_sha256, contents=True)["files"]
    for path in group.rglob("*"):
        if path.is_file() and path.relative_to(group).as_posix() not in files:
            raise StoreError(f"{where} is damaged: {path.relative_to(group)} does not belong there")
    try:
        opened = zarr.open_group(Whole(group, files), mode="r")
        arrays = dict(opened.arrays())
    except StoreError:
        raise
    except Exception as error:
        raise StoreError(f"{where} is damaged: its metadata cannot be read: {error}") from error
    attributes = dict(opened.attrs)
    if missing := [key for key in REQUIRED if key not in attributes]:
        raise StoreError(f"{where} is not a table: it lacks the attribute {missing[0]}")
    sizes: dict[str, int] = {}
    for key, array in arrays.items():
        metadata: Any = array.metadata
        dims = metadata.dimension_names or ()
        if len(dims) != len(array.shape):
            raise StoreError(f"{where} is not a table: {key} does not name its dimensions")
        for dimension, size in zip(dims, array.shape, strict=True):
            if sizes.setdefault(dimension, size) != size:
                raise StoreError(
                    f"{where} is not a table: {key} has {size} values along {dimension}, not {sizes[dimension]}"
                )
        if len(dims) > 1 and key in ("brdf", "parts") and array.dtype != np.float32:
            raise StoreError(f"{where} is not a table: {key} is {array.dtype}, not float32")
        step = array.chunks[0] if array.shape else 1
        for number, start in enumerate(range(0, array.shape[0] if array.shape else 1, step)):
            try:
                array[start : start + step] if array.shape else array[...]
            except StoreError:
                raise
            except Exception as error:
                raise StoreError(f"{where} is damaged: chunk {number} of {key} cannot be decoded: {error}") from error
    for dimension in sizes:
        if dimension not in arrays:
            raise StoreError(f"{where} is not a table: it lacks the coordinate {dimension}")
    return sum(entry["size"] for entry in files.values())


@dataclass
class Collected:
    """What a collection removed.

    Attributes
    ----------
    removed : list of str
        Paths, below the root of the store.
    busy : list of str
        Materials that were left alone, since a build is at work on them.
    freed : int
        Bytes.
    """

    removed: list[str] = field(default_factory=list)
    busy: list[str] = field(default_factory=list)
    freed: int = 0


def collect(root: Path, keep: int = 2) -> Collected:
    """Remove what no reader is served and no build is at work on.

    Staging directories of builds that were broken off (they could have been resumed), revisions that are neither
    current nor among the newest, and what crashes left behind: directories without a manifest, manifests without a
    directory, temporary files. A reader that holds a decoded table keeps it; one that is just reading a revision that
    goes reads the current one instead, or is told.

    Parameters
    ----------
    root : Path
        Directory of the store.
    keep : int
        How many revisions of each material stay, the current one included; at least 1.

    Raises
    ------
    StoreError
        If there is no store, or something cannot be removed.
    """
    if keep < 1:
        raise ValueError(f"keep: {keep} is not at least 1; the current revision always stays")
    store = Store(root)
    collected = Collected()
    try:
        for path in root.glob(".brdfdb.json.*"):
            _remove(root, path, collected)
        staged, materials = root / ".staging", root / "materials"
        names = {path.name for directory in (staged, materials) for path in directory.iterdir() if path.is_dir()}
        for name in sorted(names):
            try:
                with Lock(root, name, wait=False) as lock:
                    for path in lock.path.parent.iterdir():
                        if path != lock.path:
                            _remove(root, path, collected)
                    if (materials / name).is_dir():
                        _collect_material(store, materials / name, keep, collected)
            except BusyError:
                collected.busy.append(name)
        for path in staged.iterdir():
            if path.is_file():
                _remove(root, path, collected)
    except OSError as error:
        raise StoreError(f"cannot collect in the store at {root}: {error.filename}: {error.strerror}") from error
    return collected


def _collect_material(store: Store, material: Path, keep: int, collected: Collected) -> None:
    whole = _whole(material)
    try:
        current = store.path(material.name)
        others = [group for group in whole if group != current]
        kept = {current, *others[max(0, len(others) - (keep - 1)) :]}
    except UnknownMaterialError:  # never published: the next build of the same request takes what is whole
        kept = set(whole)
    except StoreError:
        return  # nobody knows what the pointer pointed to: the next build repairs it
    for path in sorted(material.iterdir(), reverse=True):  # a manifest before its directory: that is then an orphan
        group = path.with_name(path.name.removesuffix(".MANIFEST.json"))
        if (number_of(group.name) and group not in kept) or path.name.startswith("."):
            _remove(store.root, path, collected)
    if not any(material.iterdir()):
        material.rmdir()


def _remove(root: Path, path: Path, collected: Collected) -> None:
    files = [path] if path.is_file() else [found for found in path.rglob("*") if found.is_file()]
    freed = sum(file.stat().st_size for file in files)
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
    collected.freed += freed
    collected.removed.append(str(path.relative_to(root)))
