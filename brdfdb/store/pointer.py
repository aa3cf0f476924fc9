"""The pointer of a material: its current revision, and the digests of the manifests of all revisions."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import cast

from brdfdb.errors import (
    StoreError,
)
from brdfdb.store.files import regular_bytes
from brdfdb.store.manifest import Manifest, Summary, read_manifest, summary_fields, whole_revisions
from brdfdb.store.paths import HEAD, number_of, pointer_path, revision_of
from brdfdb.store.sealed_json import check_fields, swap_sealed, unsealed


class Head(Summary):
    """The pointer of a material: its current revision, the digests of its manifests, the newest number ever given."""

    material: str
    revision: str
    manifests: dict[str, str]
    last: int


_HEAD = {"material": str, "revision": str, "manifests": dict, "last": int}


class WrongSummaryError(StoreError):
    """A pointer that says of its revision other than the manifest."""


def head_from(path: Path, data: bytes) -> Head:
    """Return the pointer of a material from the bytes of its file; StoreError if it is damaged or of another one."""
    name = path.parent.name
    content = unsealed(data, name, path.name)
    check_fields(content, summary_fields(content) | _HEAD, name, path.name)
    if content["material"] != name:
        raise StoreError(f"{name} is damaged: {path.name} is that of {content['material']}")
    if not (number_of(content["revision"]) and isinstance(content["manifests"].get(content["revision"]), str)):
        raise StoreError(f"{name} is damaged: {path.name} does not name a revision and its manifest")
    if content["last"] < max(map(number_of, content["manifests"])):
        raise StoreError(f"{name} is damaged: {path.name} says that the last revision was {content['last']}")
    return cast(Head, content)


def read_head(material: Path) -> Head | None:
    """Return the pointer in the directory of a material; None without one; StoreError if it is damaged."""
    path = pointer_path(material)
    try:
        return head_from(path, regular_bytes(path))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise StoreError(f"{material.name} is damaged: {path.name} cannot be read: {error.strerror}") from error


def check_summary(head: Head, manifest: Manifest) -> None:
    """Raise WrongSummaryError unless a pointer says of its revision what the manifest does."""
    for key, value in manifest["summary"].items():
        if head.get(key) != value:
            raise WrongSummaryError(
                f"{head['material']} is damaged: {HEAD} says {key} {head.get(key)!r}, not {value!r}"
            )


def point_to(material: Path, revision: str) -> None:
    """Swap the pointer of a material to one of its revisions; the lock must be held.

    Raises
    ------
    StoreError
        If the manifest of the revision is damaged, or not the one that the pointer before knew.
    """
    known = known_manifests(material)
    manifest, manifests = read_manifest(material / revision, known.get(revision))[0], {}
    for group in whole_revisions(material):
        with suppress(StoreError):  # of another revision, whose damage `verify` names
            manifests[group.name] = known.get(group.name) or read_manifest(group, None)[1]
    head: Head = {
        "material": material.name,
        "revision": revision,
        **manifest["summary"],
        "manifests": manifests,
        "last": newest(material),
    }
    swap_sealed(pointer_path(material), head)


def known_manifests(material: Path) -> dict[str, str]:
    """Return the digests of manifests that the pointer of a material knows; none of one that is damaged or missing."""
    with suppress(StoreError):
        head = read_head(material)
        return {} if head is None else head["manifests"]
    return {}


def newest(material: Path) -> int:
    """Return the highest number that a revision of a material ever had, also one removed since; 0 without any."""
    last = 0
    with suppress(StoreError):
        head = read_head(material)
        last = 0 if head is None else head["last"]
    numbers = (number_of(revision_of(path).name) for path in material.iterdir())
    return max(last, *numbers, 0)
