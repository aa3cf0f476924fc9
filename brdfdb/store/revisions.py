"""The revisions of a material: how the current one stands to a request, history, rollback, collection."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from brdfdb.errors import BusyError, ParameterError, StoreError, UnknownMaterialError
from brdfdb.store.lock import Lock, writing
from brdfdb.store.paths import (
    marker_path,
    material_path,
    materials_path,
    number_of,
    pointer_path,
    revision_of,
    revision_path,
    staging_path,
)
from brdfdb.store.reader import Store
from brdfdb.store.records import (
    Summary,
    check_manifest,
    known_manifests,
    point_to,
    read_manifest,
    read_snapshot,
    snapshot_names,
    whole_revisions,
)

SNAPSHOTS = ".snapshots"  # the lock that snapshots and collections take in turns; no material has such a name


@dataclass(frozen=True)
class Standing:
    """The standing of a material towards a request.

    "current" if the current revision answers it and is undamaged, "adoptable" if another one does, else "missing"; the
    revision that answers it, if any; and in a phrase why the current revision does not.
    """

    state: Literal["current", "adoptable", "missing"]
    revision: str = ""
    why: str = ""


def standing(root: Path, name: str, request: Mapping[str, Any]) -> Standing:
    """Return how a material stands to a request, after a look at every byte of the revisions in question."""
    from brdfdb.tables.layout import digest  # it imports models, which histories and collections do not need

    wanted = digest(request)
    store = Store(root)
    why = "new"
    try:
        if name in store:  # the error for an unknown material compares its name with all others
            head = store.summary(name)
            if head["request_sha256"] == wanted:
                store.verify(name)
                return Standing("current", head["revision"])
            why = difference(store.metadata(name).whole_request, request)
    except StoreError as error:
        why = str(error)
    sound = adoptable(root, name, wanted)
    return Standing("missing", "", why) if sound is None else Standing("adoptable", sound, why)


def adoptable(root: Path, name: str, request_sha256: str) -> str | None:
    """Return the newest revision of a material that answers a request and is undamaged; None without any."""
    material = material_path(root, name)
    known = known_manifests(material)
    for group in reversed(whole_revisions(material)):
        with suppress(StoreError):
            manifest = read_manifest(group, known.get(group.name))
            if manifest.content["summary"]["request_sha256"] == request_sha256:
                check_manifest(group, manifest.digest, contents=True)
                return group.name
    return None


def difference(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    """Return a phrase on how a request differs from that of the current table."""
    if not old:
        return "the current table does not record its request"
    new = json.loads(json.dumps(new))
    changes: list[str] = []
    for key in sorted({*old, *new}):
        before = old.get(key)
        after = new.get(key)
        if before == after:
            continue
        words = key.replace("_", " ")
        if isinstance(before, dict) and isinstance(after, dict) and key == "material":
            parts = [part for part in sorted({*before, *after}) if before.get(part) != after.get(part)]
            changes.append(f"{', '.join(part.replace('_', ' ') for part in parts)} changed")
        elif isinstance(before, int | str) and isinstance(after, int | str):
            changes.append(f"{words} {before} -> {after}")
        else:
            changes.append(f"{words} changed")
    return ", ".join(changes)


@dataclass(frozen=True)
class Revision:
    """A line of a history: a revision, what its manifest says, and whether it is the current one."""

    name: str
    summary: Summary
    current: bool


def history(root: Path, name: str) -> list[Revision]:
    """Return the complete revisions of a material, oldest first; StoreError if a manifest cannot be read."""
    head = Store(root).summary(name)
    revisions = []
    for group in whole_revisions(material_path(root, name)):
        manifest = read_manifest(group, head["manifests"].get(group.name)).content
        revisions.append(Revision(group.name, manifest["summary"], group.name == head["revision"]))
    return revisions


def rollback(root: Path, name: str, revision: str) -> str:
    """Make another revision current, which also repairs a pointer that is missing or damaged.

    Returns the revision that was current; empty if the pointer was missing or damaged. StoreError says that the
    material has no such revision, or that it is damaged.
    """
    store = Store(root)
    material = material_path(root, name)
    if name not in store:
        raise UnknownMaterialError(name, list(store))
    with Lock(root, name):
        known = [group.name for group in whole_revisions(material)]
        if revision not in known:
            raise StoreError(f"{name} has no revision {revision[:40]!r}; it has {', '.join(known)}")
        before = ""
        with suppress(StoreError):
            before = store.head(name)
        check_manifest(material / revision, known_manifests(material).get(revision), contents=True)
        with writing(root, name):
            point_to(material, revision)
    return before


@dataclass
class Collected:
    """The result of a collection: removed paths below the root, materials with a build at work, and freed bytes."""

    removed: list[str] = field(default_factory=list)
    busy: list[str] = field(default_factory=list)
    freed: int = 0


def collect(root: Path, keep: int = 2, *, damaged: bool = False) -> Collected:
    """Remove what neither readers nor builds use.

    Staging directories of interrupted builds (they could have been resumed), revisions that are neither current nor
    among the newest nor named by a snapshot, and the remains of crashes: directories without a manifest, manifests
    without a directory, temporary files, files in a revision that its manifest does not list. Decoded tables stay
    usable; a reader of a revision that is removed reads the current one instead, or gets an error.

    Parameters
    ----------
    root : Path
        Directory of the store.
    keep : int
        Number of revisions of each material that stay, the current one included; at least 1.
    damaged : bool
        Read the other revisions that stay, too, and remove those that are damaged.

    Raises
    ------
    StoreError
        If there is no store, a snapshot is damaged, or something cannot be removed.
    """
    if keep < 1:
        raise ParameterError("keep", f"{keep} is not at least 1; the current revision always stays", keep)
    store = Store(root)
    collected = Collected()
    try:
        with Lock(store.root, SNAPSHOTS):
            _collect(store, keep, damaged, collected)
    except OSError as error:
        raise StoreError(f"cannot collect in the store at {root}: {error.filename}: {error.strerror}") from error
    return collected


def pinned(root: Path) -> dict[Path, str]:
    """Return the revisions that snapshots name, with the name of a snapshot; StoreError if a snapshot is damaged."""
    groups = {}
    for name in snapshot_names(root):
        for material, pin in read_snapshot(root, name)["materials"].items():
            groups[revision_path(root, material, pin["revision"])] = name
    return groups


def _collect(store: Store, keep: int, damaged: bool, collected: Collected) -> None:
    stay: dict[Path, set[Path]] = {}  # by material
    try:
        for group in pinned(store.root):
            stay.setdefault(group.parent, set()).add(group)
    except StoreError as error:
        raise StoreError(f"nothing is collected, since {error}; remove it with `brdfdb snapshot --remove`") from error
    for path in store.root.glob(f".{marker_path(store.root).name}.*"):
        _remove(store.root, path, collected)
    staged = staging_path(store.root)
    materials = materials_path(store.root)
    names = {path.name for directory in (staged, materials) for path in directory.iterdir() if path.is_dir()}
    for name in sorted(names - {SNAPSHOTS}):
        try:
            with Lock(store.root, name, wait=False) as lock:
                material = materials / name
                if whole_revisions(material) and not pointer_path(material).is_file():
                    continue  # killed before the first pointer, or it was lost: the next build makes one
                for path in lock.path.parent.iterdir():
                    if path != lock.path:
                        _remove(store.root, path, collected)
                if material.is_dir():
                    _collect_material(store, material, keep, damaged, stay.get(material, set()), collected)
        except BusyError:
            if not name.startswith("."):  # else it is the presence of a build
                collected.busy.append(name)
    for path in staged.iterdir():
        if path.is_file():
            _remove(store.root, path, collected)


def _collect_material(
    store: Store, material: Path, keep: int, damaged: bool, stay: set[Path], collected: Collected
) -> None:
    revisions = whole_revisions(material)
    known = known_manifests(material)
    kept: set[Path] = set()
    try:
        current = store.path(material.name)
        others = [group for group in revisions if group != current]
        # a revision that a snapshot names stays, even damaged: it may be the only copy
        kept = {current, *others[max(0, len(others) - (keep - 1)) :], *stay}
    except UnknownMaterialError:  # nothing but what crashes left behind
        current = material
    except StoreError:
        return  # the current revision is unknown until the next build repairs the pointer
    for group in sorted(kept & set(revisions)):
        if damaged and group != current and group not in stay:
            try:
                check_manifest(group, known.get(group.name), contents=True)
            except StoreError:
                kept.remove(group)
                continue
        for path in strangers(group, known.get(group.name)):
            _remove(store.root, path, collected)
    for path in sorted(material.iterdir(), reverse=True):  # a manifest before its directory: that is then an orphan
        group = revision_of(path)
        if (number_of(group.name) and group not in kept) or path.name.startswith("."):
            _remove(store.root, path, collected)
    if not any(material.iterdir()):
        material.rmdir()


def strangers(group: Path, digest: str | None) -> list[Path]:
    """Return the files in a revision that its manifest does not list; none where the manifest is damaged."""
    try:
        files = read_manifest(group, digest).content["files"]
    except StoreError:
        return []
    return [path for path in group.rglob("*") if path.is_file() and path.relative_to(group).as_posix() not in files]


def _remove(root: Path, path: Path, collected: Collected) -> None:
    files = [path] if path.is_file() else [file for file in path.rglob("*") if file.is_file()]
    freed = sum(file.stat().st_size for file in files)
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
    collected.freed += freed
    collected.removed.append(str(path.relative_to(root)))
