"""The sealed records of a store: its marker, the manifests of revisions, the pointers of materials, and snapshots.

Each record is a JSON object with the fields of a TypedDict. pydantic would check them as well, but its import takes a
fifth of the time of ``brdfdb list``, which reads pointers alone.
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import uuid
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import UnionType
from typing import (
    TYPE_CHECKING,
    Any,
    NamedTuple,
    NotRequired,
    TypedDict,
    TypeVar,
    cast,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

from brdfdb.errors import StoreError
from brdfdb.place import path_of
from brdfdb.store.files import (
    FileEntry,
    Sync,
    bytes_of,
    read_json,
    read_sealed,
    regular_bytes,
    sealed,
    sha256_of,
    swap_sealed,
    sync_path,
    syncing,
    unsealed,
)
from brdfdb.store.paths import (
    DIRECTORIES,
    HEAD,
    METADATA,
    NAME,
    is_edition,
    manifest_path,
    marker_path,
    materials_path,
    number_of,
    pointer_path,
    revision_of,
    snapshot_path,
    snapshots_path,
    staging_path,
    store_around,
)

if TYPE_CHECKING:
    from brdfdb.tables.metadata import TableMetadata

FORMAT = "brdfdb"
FORMAT_VERSION = 2  # version 1 had no digests in the first lines
SNAPSHOT_FORMAT = "brdfdb-snapshot"
SNAPSHOT_VERSION = 1


class Summary(TypedDict):
    """Facts of a table for lists of materials and revisions, which need not open the table then."""

    title: str
    model: str
    model_version: int
    request_sha256: str
    error_p99: float | None
    created: str
    bytes: int
    wavelength_range_nm: NotRequired[list[float]]  # this field and the next ones exist since version 4 of tables
    formula_error: NotRequired[dict[str, Any] | None]
    largest_albedo: NotRequired[dict[str, Any] | None]
    measured: NotRequired[bool]
    model_title: NotRequired[str]  # this field and the next ones serve filters of lists; older pointers lack them
    model_reference: NotRequired[str]
    source: NotRequired[str]
    anisotropic: NotRequired[bool | None]
    parameters: NotRequired[dict[str, Any]]
    incomplete: NotRequired[str]


class Manifest(TypedDict):
    """The files of a revision, by their path inside it; nothing else belongs there."""

    material: str
    revision: str
    summary: Summary
    files: dict[str, FileEntry]


class Head(Summary):
    """The pointer of a material: its current revision, the digests of its manifests, the newest number ever given."""

    material: str
    revision: str
    manifests: dict[str, str]
    last: int


class Pin(TypedDict):
    """A revision that a snapshot names."""

    revision: str
    manifest_sha256: str


class Snapshot(TypedDict):
    """A whole database under one name: a revision of each material, and the records of the families."""

    format: str
    version: int
    name: str
    materials: dict[str, Pin]
    families: dict[str, dict[str, Any]]


class DamagedMarkerError(StoreError):
    """A damaged brdfdb.json: `brdfdb build` writes it again if the directory holds tables."""


class WrongSummaryError(StoreError):
    """A pointer whose facts of its revision differ from those of the manifest."""


# The fields of records

Record = TypeVar("Record")


class _Field(NamedTuple):
    """A field of a record, and what its value must be."""

    name: str
    required: bool
    types: Any  # types that the value may have
    record: Any = None  # TypedDict that the value must be
    members: _Field | None = None  # what each value of a mapping must be

    @classmethod
    def of(cls, name: str, hint: Any) -> _Field:
        """Return the field that an annotation declares."""
        required = get_origin(hint) is not NotRequired
        kind = hint if required else get_args(hint)[0]
        if is_typeddict(kind):
            return cls(name, required, (dict,), record=kind)
        alternatives = get_args(kind) if isinstance(kind, UnionType) else (kind,)
        types = tuple(get_origin(kind) or kind for kind in alternatives)
        if float in types:
            types = (*types, int)
        if types == (dict,) and get_args(kind)[1] is not Any:
            return cls(name, required, types, members=cls.of(name, get_args(kind)[1]))
        return cls(name, required, types)

    def check(self, value: Any, where: str, file: str) -> None:
        """Raise StoreError unless a value is one of the field."""
        if not isinstance(value, self.types):
            raise StoreError(f"{where} is damaged: {file} has no valid {self.name!r}")
        if self.record is not None:
            record_of(value, self.record, where, file)
        elif self.members is not None:
            for member in value.values():
                self.members.check(member, where, file)


@functools.cache
def fields_of(record: Any) -> tuple[_Field, ...]:
    """Return the fields of a TypedDict."""
    return tuple(_Field.of(name, hint) for name, hint in get_type_hints(record, include_extras=True).items())


def record_of(content: Mapping[str, Any], record: type[Record], where: str, file: str) -> Record:
    """Return a JSON object as a record; StoreError names a field that is missing or of another type."""
    for field in fields_of(cast(Any, record)):
        if field.required or field.name in content:
            field.check(content.get(field.name, ...), where, file)
    return cast(Record, content)


# The marker of a store, brdfdb.json


def check_marker(root: Path) -> None:
    """Raise StoreError unless there is a store at `root` that this program reads."""
    marker = marker_path(root)
    try:
        data = marker.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        if (around := store_around(root)) is not None:
            raise StoreError(f"{root} lies in the store at {around}; name that directory") from None
        if is_edition(root):
            raise StoreError(f"{root} is an edition, which is only read; name the directory of a store") from None
        raise StoreError(
            f"no store at {root}: brdfdb.json is missing there; `brdfdb build --store {root}` makes one of the papers' "
            "materials. --store, $BRDFDB_STORE and brdfdb.open() take another directory, or the address of an edition"
        ) from None
    except OSError as error:
        raise StoreError(f"cannot read {marker}: {error.strerror}") from error
    try:
        content = unsealed(data, str(root), marker.name)
    except StoreError as damaged:
        content = {"format": FORMAT, "version": 1}
        if data != json.dumps(content, indent=1).encode():  # as version 1 wrote it
            raise DamagedMarkerError(f"{damaged}; `brdfdb build` writes it anew") from None
    if (content.get("format"), content.get("version")) != (FORMAT, FORMAT_VERSION):
        old = content.get("version") == 1
        way = (
            "`brdfdb build RECIPE --store DIR` builds its tables anew in another directory" if old else "update brdfdb"
        )
        raise StoreError(
            f"{marker} says format {content.get('format')} version {content.get('version')}, this program reads "
            f"{FORMAT} version {FORMAT_VERSION}; {way}"
        )


def make_store(root: Path) -> bool:
    """Make a store unless there is one; return whether it was made.

    A brdfdb.json that is missing or damaged beside tables of this version is written anew. StoreError says that `root`
    cannot be written, is a directory of a store such as its materials, or is something else.
    """
    marker = marker_path(path_of(root, "root"))
    made = False
    try:
        around = None if marker.exists() else store_around(root)
        if around is not None and root.resolve().relative_to(around).parts[0] in DIRECTORIES:
            raise StoreError(f"{root} lies in the store at {around}; name that directory, or one outside")
        root.mkdir(parents=True, exist_ok=True)
        strangers = [path for path in root.iterdir() if not path.name.startswith(f".{marker.name}.")]
        if marker.exists():  # checked after the listing: another build may be making the store right now
            try:
                check_marker(root)
            except DamagedMarkerError:
                if not _has_tables(root):
                    raise
                made = True
        elif strangers and not _has_tables(root):
            if is_edition(root):
                raise StoreError(f"{root} is an edition; `brdfdb build RECIPE --to {root}` builds an edition")
            raise StoreError(f"{root} is not empty and not a store; name an empty or a new directory")
        else:
            made = True
        if made:
            swap_sealed(marker, {"format": FORMAT, "version": FORMAT_VERSION})
        materials_path(root).mkdir(exist_ok=True)
        staging_path(root).mkdir(exist_ok=True)
        if made:
            sync_path(root)
    except OSError as error:
        raise StoreError(f"cannot write a store at {root}: {error.strerror or error}") from error
    return made and not strangers


def _has_tables(root: Path) -> bool:
    """Return whether a revision in `root` has a manifest of this version."""
    for path in materials_path(root).glob(f"*/{manifest_path(Path('r*')).name}"):
        with suppress(StoreError):
            read_sealed(path, path.parent.name)
            return True
    return False


# The manifests of revisions


class ReadManifest(NamedTuple):
    """A manifest, and the sha256 of its file."""

    content: Manifest
    digest: str


def summary_of(metadata: TableMetadata, stored: int, created: str) -> Summary:
    """Return the facts of a table, from its metadata, its size [byte] and the date of its publication."""
    largest = metadata.largest_albedo
    return {
        "title": metadata.title or "",
        "model": metadata.model or "",
        "model_version": metadata.model_version or 0,
        "request_sha256": metadata.request_sha256 or "",
        "error_p99": None if metadata.error is None else metadata.error.overall.p99,
        "created": created,
        "bytes": stored,
        "wavelength_range_nm": metadata.wavelength_range_nm,
        "formula_error": None if metadata.formula_error is None else metadata.formula_error.in_lists(),
        "largest_albedo": None if largest is None else largest.model_dump(mode="json"),
        "measured": metadata.measured is not None,
        "model_title": metadata.model_title or metadata.model or "",
        "model_reference": metadata.model_reference or "",
        "source": metadata.source or "",
        "anisotropic": metadata.anisotropic,
        "parameters": metadata.model_dump(mode="json", include={"parameters"})["parameters"],
        "incomplete": metadata.gaps,
    }


def whole_revisions(material: Path) -> list[Path]:
    """Return the revisions of a material that have a directory and a manifest, oldest first."""
    try:
        numbered = sorted((number_of(name), name) for name in os.listdir(material))
    except (FileNotFoundError, NotADirectoryError):
        return []
    paths = (material / name for number, name in numbered if number)
    return [path for path in paths if path.is_dir() and manifest_path(path).is_file()]


def read_manifest(group: Path, digest: str | None) -> ReadManifest:
    """Return the manifest of a revision, whose digest is None if neither a pointer nor a snapshot records it.

    StoreError says that it is missing, changed or that of another revision, or has another digest.
    """
    where = f"{group.parent.name} {group.name}"
    path = manifest_path(group)
    data = bytes_of(path, where)
    content = unsealed(data, where, path.name)
    actual = hashlib.sha256(data).hexdigest()
    if digest not in (None, actual):
        raise StoreError(f"{where} is damaged: {path.name} is not the one whose digest was recorded")
    manifest = record_of(content, Manifest, where, path.name)
    if (manifest["material"], manifest["revision"]) != (group.parent.name, group.name):
        raise StoreError(f"{where} is damaged: {path.name} is that of {manifest['material']} {manifest['revision']}")
    return ReadManifest(manifest, actual)


def check_manifest(group: Path, digest: str | None, *, contents: bool) -> Manifest:
    """Check that the files of a revision exist, with the sizes in its manifest, and return the manifest.

    The content of metadata is checked too, since no checksum of a chunk protects it; with `contents`, the content of
    every file, and what the manifest says of the table. StoreError names the first file that differs.
    """
    where = f"{group.parent.name} {group.name}"
    directory = str(group)
    manifest = read_manifest(group, digest).content
    for name, entry in manifest["files"].items():
        file = f"{directory}/{name}"
        try:
            size = os.stat(file).st_size
            if size != entry["size"]:
                raise StoreError(f"{where} is damaged: {name} has {size} bytes, not {entry['size']}")
            if (contents or name.endswith(METADATA)) and sha256_of(file) != entry["sha256"]:
                raise StoreError(f"{where} is damaged: the content of {name} changed")
        except FileNotFoundError:
            raise StoreError(f"{where} is damaged: {name} is missing") from None
        except OSError as error:
            raise StoreError(f"{where} is damaged: {name} cannot be read: {error.strerror}") from None
    if not contents:
        return manifest
    summary: Mapping[str, Any] = manifest["summary"]
    stored = sum(entry["size"] for entry in manifest["files"].values())
    for key, value in summary_of(read_metadata(group), stored, summary["created"]).items():
        if key in summary and not _agrees(summary[key], value):  # older manifests may say less
            file = manifest_path(group).name
            raise StoreError(f"{where} is damaged: {file} says {key} {summary[key]!r}, where the table has {value!r}")
    return manifest


def check_file(
    group: Path, key: str, value: bytes | None, files: Mapping[str, FileEntry], *, complete: bool = True
) -> None:
    """Raise StoreError if a file of a revision is missing, or changed, by the list of files in its manifest.

    The path `key` is inside the revision; `value` is None for a missing file, and a part of the file unless `complete`.
    """
    if (entry := files.get(key)) is None:
        return
    where = f"{group.parent.name} {group.name}"
    if value is None:
        if not manifest_path(group).is_file():
            raise StoreError(f"{where} was removed while it was read; open the material again")
        raise StoreError(f"{where} is damaged: {key} is missing")
    if complete and hashlib.sha256(value).hexdigest() != entry["sha256"]:
        raise StoreError(f"{where} is damaged: the content of {key} changed")


def read_metadata(group: Path) -> TableMetadata:
    """Return the metadata in the directory of a revision, whose files were checked against its manifest."""
    from brdfdb.tables.metadata import TableMetadata  # it loads numpy, which a list does not need

    return TableMetadata.read(read_json(group / METADATA).get("attributes", {}))


def _agrees(stated: Any, value: Any) -> bool:
    """Return True if every part of a statement is that of a value."""
    if isinstance(stated, dict) and isinstance(value, dict):
        return all(key in value and _agrees(part, value[key]) for key, part in stated.items())
    return bool(stated == value)


# The pointers of materials, HEAD.json


def head_from(path: Path, data: bytes) -> Head:
    """Return the pointer in the bytes of a file; StoreError if it is damaged or that of another material."""
    name = path.parent.name
    head = record_of(unsealed(data, name, path.name), Head, name, path.name)
    if head["material"] != name:
        raise StoreError(f"{name} is damaged: {path.name} is that of {head['material']}")
    if not (number_of(head["revision"]) and head["revision"] in head["manifests"]):
        raise StoreError(f"{name} is damaged: {path.name} does not name a revision and its manifest")
    if head["last"] < max(map(number_of, head["manifests"])):
        raise StoreError(f"{name} is damaged: {path.name} says that the last revision was {head['last']}")
    return head


def _undamaged_head(material: Path) -> Head | None:
    """Return the pointer in the directory of a material; None if it is missing or damaged."""
    path = pointer_path(material)
    with suppress(OSError, StoreError):
        return head_from(path, regular_bytes(path))
    return None


def check_summary(head: Head, manifest: Manifest) -> None:
    """Raise WrongSummaryError unless a pointer has the summary of the manifest."""
    for key, value in manifest["summary"].items():
        if head.get(key) != value:
            raise WrongSummaryError(
                f"{head['material']} is damaged: {HEAD} says {key} {head.get(key)!r}, not {value!r}"
            )


def point_to(material: Path, revision: str) -> None:
    """Swap the pointer of a material to one of its revisions; the caller holds the lock. Errors as by `swap_pointers`.

    The build that made the revision may have been killed before it synced its files: they are synced first.
    """
    group = material / revision
    with syncing(material) as sync:
        sync([*group.rglob("*"), group])
        swap_pointers([group], sync)


def swap_pointers(groups: Sequence[Path], sync: Sync) -> None:
    """Swap the pointers of materials to revisions whose files are synced; the caller holds the locks.

    Before the first swap, names and manifests of the revisions and the new pointers are synced, and after the last the
    swaps. StoreError says that a manifest is damaged, or has another digest than in the pointer before.
    """
    new = {group: group.with_name(f".{HEAD}.{uuid.uuid4().hex}") for group in groups}
    try:
        for group, pointer in new.items():
            pointer.write_bytes(sealed(_head_of(group)))
        sync(
            path
            for group, pointer in new.items()
            for path in (manifest_path(group), pointer, group.parent, group.parent.parent)
        )
        for group, pointer in new.items():
            os.replace(pointer, pointer_path(group.parent))
    except BaseException:
        for pointer in new.values():
            pointer.unlink(missing_ok=True)
        raise
    sync(group.parent for group in groups)


def _head_of(group: Path) -> Head:
    """Return the pointer of a material to one of its revisions."""
    material = group.parent
    known = known_manifests(material)
    manifest = read_manifest(group, known.get(group.name)).content
    manifests = {}
    for other in whole_revisions(material):
        with suppress(StoreError):  # of another revision, whose damage `verify` names
            manifests[other.name] = known.get(other.name) or read_manifest(other, None).digest
    return {
        "material": material.name,
        "revision": group.name,
        **manifest["summary"],
        "manifests": manifests,
        "last": newest(material),
    }


def known_manifests(material: Path) -> dict[str, str]:
    """Return the digests of manifests in the pointer of a material; none if the pointer is damaged or missing."""
    head = _undamaged_head(material)
    return {} if head is None else head["manifests"]


def newest(material: Path) -> int:
    """Return the highest number that a revision of a material ever had, also if it was removed; 0 without any."""
    head = _undamaged_head(material)
    numbers = (number_of(revision_of(path).name) for path in material.iterdir())
    return max(0 if head is None else head["last"], *numbers, 0)


# Snapshots


def snapshot_names(root: Path) -> list[str]:
    """Return the names of the snapshots of the store at `root`, sorted."""
    try:
        files = sorted(os.listdir(snapshots_path(root)))
    except FileNotFoundError:
        return []
    except OSError as error:
        raise StoreError(f"cannot read {snapshots_path(root)}: {error.strerror}") from error
    return [name[:-5] for name in files if name.endswith(".json") and NAME.fullmatch(name[:-5])]


def read_snapshot(root: Path, name: str) -> Snapshot:
    """Return a snapshot of the store at `root`; StoreError if there is none, or it is damaged or of another version."""
    where = f"the snapshot {name}"
    if not (NAME.fullmatch(name) and snapshot_path(root, name).is_file()):
        others = ", ".join(snapshot_names(root)) or "none"
        raise StoreError(f"no snapshot {name[:60]!r} in the store at {root}; it has {others}")
    path = snapshot_path(root, name)
    content = read_sealed(path, where)
    if (content.get("format"), content.get("version")) != (SNAPSHOT_FORMAT, SNAPSHOT_VERSION):
        raise StoreError(
            f"{path} says format {content.get('format')} version {content.get('version')}, "
            f"this program reads {SNAPSHOT_FORMAT} version {SNAPSHOT_VERSION}"
        )
    snapshot = record_of(content, Snapshot, where, path.name)
    if snapshot["name"] != name:
        raise StoreError(f"{where} is damaged: {path.name} is that of {snapshot['name']}")
    for material, pin in snapshot["materials"].items():
        if not (NAME.fullmatch(material) and number_of(pin["revision"])):
            raise StoreError(f"{where} is damaged: {path.name} names {material} {pin['revision']}")
    return snapshot
