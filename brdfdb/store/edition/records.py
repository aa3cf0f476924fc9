"""The records of an edition: members of a group with the place and the digest of each of their files, index and root.

A member is a revision of a store: its manifest, and its files. Large files, the chunks of the main variable, lie in a
shard of the group, byte for byte as a store has them. All others lie in the records.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, NotRequired, TypedDict

from numcodecs.zstd import Zstd

from brdfdb.errors import StoreError, UnknownMaterialError, UnknownRevisionError
from brdfdb.store.edition.objects import Objects, checked
from brdfdb.store.files import FileEntry, sealed, unsealed
from brdfdb.store.paths import EDITION, METADATA, pinned
from brdfdb.store.records import Manifest, Summary, record_of

_ZSTD = Zstd(level=3)
FORMAT = "brdfdb-edition"
FORMAT_VERSION = 1
_RECORDS_FORMAT = "brdfdb-records"


def sha256(content: bytes) -> str:
    """Return the sha256 of bytes, in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


class Chunk(NamedTuple):
    """The place of a file in the shard of its group [byte]."""

    start: int
    size: int


@dataclass(frozen=True)
class RevisionFiles:
    """A revision: its manifest, and its files by their path inside the group."""

    manifest: Manifest
    files: Mapping[str, bytes]

    @classmethod
    def of(cls, name: str, revision: str, summary: Summary, files: Mapping[str, bytes]) -> RevisionFiles:
        """Return a revision with the manifest of its files."""
        entries: dict[str, FileEntry] = {
            key: {"size": len(content), "sha256": sha256(content)} for key, content in files.items()
        }
        return cls({"material": name, "revision": revision, "summary": summary, "files": entries}, files)

    @property
    def name(self) -> str:
        """Name of the material."""
        return self.manifest["material"]

    @cached_property
    def digest(self) -> str:
        """The sha256 of the manifest, as the store that has the revision names it."""
        return sha256(sealed(self.manifest))

    @cached_property
    def metadata(self) -> dict[str, Any]:
        """The metadata of the zarr group."""
        document: dict[str, Any] = json.loads(self.files[METADATA])
        return document


class _MemberLine(TypedDict):
    """A line of the records: a member, its files in the order of `_Common.keys`."""

    revision: str
    digest: str
    summary: dict[str, Any]
    metadata: str  # the beginning of zarr.json; its end is common
    sha256: list[str]
    chunks: dict[str, list[int]]
    content: dict[str, str]  # base64, by sha256: files of this member alone


class _Common(TypedDict):
    """The first line of the records."""

    format: str
    version: int
    names: list[str]
    keys: list[str]
    shard: str  # path of the shard in the group; empty if all files lie in the records
    metadata_end: str
    content: dict[str, str]  # files that members share
    files: dict[str, FileEntry]  # of the group


def encoded_records(
    members: Sequence[RevisionFiles],
    shard: str,
    chunks: Sequence[Mapping[str, Chunk]],
    files: Mapping[str, bytes],
) -> bytes:
    """Return the records of a group.

    `chunks` has the files of each member that lie in the shard; `files` are those of the group. All members have files
    of the same paths.
    """
    keys = list(members[0].files)
    metadata = [member.files[METADATA].decode() for member in members]
    end = _common_end(metadata)
    small = [
        {entry["sha256"] for key, entry in member.manifest["files"].items() if key != METADATA and key not in large}
        for member, large in zip(members, chunks, strict=True)
    ]
    counts = Counter(digest for digests in small for digest in digests)
    content = {
        member.manifest["files"][key]["sha256"]: file for member in members for key, file in member.files.items()
    }
    shared = {digest for digest, count in counts.items() if count > 1 or len(members) == 1}
    common: _Common = {
        "format": _RECORDS_FORMAT,
        "version": FORMAT_VERSION,
        "names": [member.name for member in members],
        "keys": keys,
        "shard": shard,
        "metadata_end": metadata[0][len(metadata[0]) - end :],
        "content": {digest: base64.b64encode(content[digest]).decode() for digest in sorted(shared)},
        "files": {key: {"size": len(file), "sha256": sha256(file)} for key, file in files.items()},
    }
    lines = [json.dumps(common)]
    for member, text, digests, places in zip(members, metadata, small, chunks, strict=True):
        line: _MemberLine = {
            "revision": member.manifest["revision"],
            "digest": member.digest,
            "summary": dict(member.manifest["summary"]),
            "metadata": text[: len(text) - end],
            "sha256": [member.manifest["files"][key]["sha256"] for key in keys],
            "chunks": {key: list(place) for key, place in places.items()},
            "content": {digest: base64.b64encode(content[digest]).decode() for digest in sorted(digests - shared)},
        }
        lines.append(json.dumps(line))
    compressed: bytes = _ZSTD.encode("\n".join(lines).encode())
    return compressed


def _common_end(texts: Sequence[str]) -> int:
    """Return the length of the longest end that texts share; 0 for a single text."""
    if len(texts) == 1:
        return 0
    first = min(texts, key=len)
    low = 0
    high = len(first)
    while low < high:  # an end that all share has shorter ends that all share
        middle = (low + high + 1) // 2
        if all(text.endswith(first[len(first) - middle :]) for text in texts):
            low = middle
        else:
            high = middle - 1
    return low


class Records:
    """The decoded records of a group; `digest` is the name of the group, and was checked."""

    def __init__(self, objects: Objects, digest: str) -> None:
        self.digest = digest
        self.objects = objects
        content = checked(objects, records_key(digest), digest)
        where = objects.name
        try:
            self._lines = bytes(_ZSTD.decode(content)).split(b"\n")
            self.common: _Common = json.loads(self._lines[0])
        except (RuntimeError, ValueError) as error:
            raise StoreError(f"{where} is damaged: the records of the group {digest[:16]} cannot be read") from error
        check_format(self.common, _RECORDS_FORMAT, f"{where}: the records of the group {digest[:16]}")
        self.numbers = {name: number for number, name in enumerate(self.common["names"])}

    @property
    def nbytes(self) -> int:
        """Size in memory [byte]."""
        return sum(map(len, self._lines))

    @property
    def shard(self) -> str:
        """Key of the object with the chunks of all members; empty without any."""
        return self.common["shard"] and f"groups/{self.digest}/{self.common['shard']}"

    def digest_of(self, name: str) -> str:
        """Return the digest of the manifest of a member."""
        line: _MemberLine = json.loads(self._lines[self.numbers[name] + 1])
        return line["digest"]

    def member(self, name: str) -> Member:
        """Return a member; UnknownMaterialError if the group has none of this name."""
        if name not in self.numbers:
            raise UnknownMaterialError(name, self.numbers)
        line: _MemberLine = json.loads(self._lines[self.numbers[name] + 1])
        common = self.common
        content = {**common["content"], **line["content"]}
        metadata = (line["metadata"] + common["metadata_end"]).encode()
        chunks = {key: Chunk(*place) for key, place in line["chunks"].items()}
        files: dict[str, FileEntry] = {}
        for key, digest in zip(common["keys"], line["sha256"], strict=True):
            if key == METADATA:
                size = len(metadata)
            else:
                size = chunks[key].size if key in chunks else len(base64.b64decode(content[digest]))
            files[key] = {"size": size, "sha256": digest}
        manifest: Any = {"material": name, "revision": line["revision"], "summary": line["summary"], "files": files}
        record_of(manifest, Manifest, f"{self.objects.name}: {name}", "its record")
        return Member(manifest, line["digest"], chunks, metadata, content, self)


@dataclass(frozen=True, eq=False)
class Member:
    """A revision as the records of its group describe it, with the methods of `brdfdb.store.reader.StoredRevision`."""

    manifest: Manifest
    digest: str
    chunks: Mapping[str, Chunk]
    _metadata: bytes
    _content: Mapping[str, str]
    _records: Records

    @property
    def name(self) -> str:
        """Name of the material."""
        return self.manifest["material"]

    @property
    def number(self) -> str:
        """Number of the revision in the store that it comes from, such as ``r000003``."""
        return self.manifest["revision"]

    @property
    def group(self) -> str:
        """Name of the group that has the member."""
        return self._records.digest

    @property
    def manifest_bytes(self) -> bytes:
        """The content of the manifest as the store has it; StoreError if its sha256 is not `digest`."""
        content = sealed(self.manifest)
        if sha256(content) != self.digest:
            raise StoreError(f"{self._records.objects.name} is damaged: the manifest of {self.name} changed")
        return content

    def check_revision(self, revision: str) -> None:
        """Raise UnknownRevisionError unless a revision is that of the member: ``r000003``, or with its digest."""
        if revision not in (self.number, pinned(self.number, self.digest)):
            raise UnknownRevisionError(
                f"{self.name} has no revision {revision[:40]!r}; this edition has {pinned(self.number, self.digest)}"
            )

    def read(self, key: str) -> bytes:
        """Return a file by its path inside the group; StoreError if it is missing or changed."""
        entry = self.manifest["files"].get(key)
        objects = self._records.objects
        if entry is None:
            raise StoreError(f"{self.name} of {objects.name} has no file {key}")
        if key in self.chunks:
            return checked(objects, self._records.shard, entry["sha256"], *self.chunks[key])
        content = self._metadata if key == METADATA else base64.b64decode(self._content[entry["sha256"]])
        if sha256(content) != entry["sha256"]:
            raise StoreError(f"{objects.name} is damaged: the content of {key} of {self.name} changed")
        return content


# The index and the root


class GroupEntry(TypedDict):
    """A group in the index; `names` if the edition has few materials, in the order of the members."""

    digest: str
    first: str
    last: str
    materials: int
    bytes: int
    objects: int
    names: NotRequired[list[str]]


class EditionIndex(TypedDict):
    """All that an edition has; its digest is that of the edition."""

    format: str
    version: int
    materials: int
    bytes: int
    groups: list[GroupEntry]
    families: dict[str, str]
    catalogue: str
    snapshot: NotRequired[dict[str, str]]  # name and sha256


class Root(TypedDict):
    """The root: the digest of the index."""

    format: str
    version: int
    index: str


def check_format(content: Mapping[str, Any], name: str, where: str) -> None:
    """Raise StoreError unless a document has a format and the version that this program reads."""
    if (content.get("format"), content.get("version")) != (name, FORMAT_VERSION):
        raise StoreError(
            f"{where} is of format {content.get('format')} version {content.get('version')}; this program reads "
            f"{name} version {FORMAT_VERSION}"
        )


def encoded_root(index_digest: str) -> bytes:
    """Return the root of an edition."""
    return sealed({"format": FORMAT, "version": FORMAT_VERSION, "index": index_digest})


def read_root(content: bytes, where: str) -> Root:
    """Return the root in the bytes of an object; StoreError if it is damaged or of another version."""
    root = unsealed(content, where, EDITION)
    check_format(root, FORMAT, f"{where}: {EDITION}")
    return record_of(root, Root, where, EDITION)


def index_key(digest: str) -> str:
    """Return the key of an index."""
    return f"index/{digest}.json"


def catalogue_key(digest: str) -> str:
    """Return the key of a catalogue."""
    return f"catalogue/{digest}.parquet"


def family_key(digest: str) -> str:
    """Return the key of the record of a family."""
    return f"families/{digest}.json"


def records_key(digest: str) -> str:
    """Return the key of the records of a group."""
    return f"groups/{digest}.records"


def read_index(objects: Objects, digest: str) -> EditionIndex:
    """Return an index, checked; StoreError if it is missing or damaged."""
    key = index_key(digest)
    try:
        index = json.loads(checked(objects, key, digest))
    except ValueError as error:
        raise StoreError(f"{objects.name} is damaged: {key} is not JSON") from error
    check_format(index, f"{FORMAT}-index", f"{objects.name}: {key}")
    return record_of(index, EditionIndex, objects.name, key)
