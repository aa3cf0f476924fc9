"""Verification of every byte of an edition against the chain of digests that begins at its root."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator

from brdfdb.errors import StoreError
from brdfdb.store.decoding import is_ours, read_group
from brdfdb.store.edition.objects import Objects, checked
from brdfdb.store.edition.reader import Edition
from brdfdb.store.edition.records import GroupEntry, Records, catalogue_key, family_key, sha256
from brdfdb.store.paths import METADATA


def damages(edition: Edition, names: Iterable[str] = (), advance: Callable[[], None] = lambda: None) -> Iterator[str]:
    """Yield a sentence for each damage of an edition, or of the groups of some of its materials.

    Each object is read once and compared with its digest; the files of each member are compared with its manifest, and
    its chunks are decoded. `advance` is called after each group.
    """
    objects = edition.objects
    groups = edition.entries(names)
    if len(groups) == len(edition.index["groups"]):
        others = [catalogue_key(edition.index["catalogue"]), *map(family_key, edition.index["families"].values())]
        digests = [edition.index["catalogue"], *edition.index["families"].values()]
        for key, digest in zip(others, digests, strict=True):
            if damage := _damage(objects, key, digest):
                yield damage
    for entry in groups:
        yield from _damages_of_group(objects, entry)
        advance()


def _damage(objects: Objects, key: str, digest: str) -> str:
    """Return the sentence of the StoreError that reading an object raises; empty without one."""
    try:
        checked(objects, key, digest)
    except StoreError as error:
        return str(error)
    return ""


def _damages_of_group(objects: Objects, entry: GroupEntry) -> Iterator[str]:
    try:
        records = Records(objects, entry["digest"])
    except StoreError as error:
        yield str(error)
        return
    names = list(records.numbers)
    if (len(names), min(names), max(names)) != (entry["materials"], entry["first"], entry["last"]):
        yield f"{objects.name} is damaged: the index names other members of the group {entry['digest'][:16]}"
    shard = b""
    for key, file in records.common["files"].items():
        address = f"groups/{entry['digest']}/{key}"
        try:
            content = checked(objects, address, file["sha256"])
        except StoreError as error:
            yield str(error)
            continue
        if key == records.common["shard"]:
            shard = content
    for name in names:
        try:
            member = records.member(name)
            member.manifest_bytes  # noqa: B018  # compares its sha256
            files = {}
            for key, place in member.chunks.items():
                files[key] = shard[place.start : place.start + place.size]
                if shard and sha256(files[key]) != member.manifest["files"][key]["sha256"]:
                    raise StoreError(f"{objects.name} is damaged: the shard has other values of {name}")
            files |= {key: member.read(key) for key in member.manifest["files"] if key not in member.chunks}
            described = (json.loads(files[METADATA]).get("consolidated_metadata") or {}).get("metadata", {})
            if (shard or not member.chunks) and all(map(is_ours, described.values())):
                read_group(files.__getitem__)
        except StoreError as error:
            yield str(error)
        except Exception as error:  # codecs raise many kinds
            yield f"{objects.name} is damaged: {name} cannot be decoded: {error}"
