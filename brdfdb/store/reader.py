"""The store, for reading: one immutable revision per build of a material, a manifest for each, a pointer to one.

ROOT/brdfdb.json                     format name and version
ROOT/materials/NAME/r000001/         a self-contained zarr v3 group, never modified
ROOT/materials/NAME/r000001.MANIFEST.json   size and sha256 of its files, outside: zarr warns of others inside
ROOT/materials/NAME/HEAD.json        current revision, digests of the manifests, and what lists show; swapped atomically
ROOT/families/NAME.json              which materials make a family, and how well it interpolates (`brdfdb.store.family`)
ROOT/snapshots/NAME.json             a whole database: a revision of each material, families (`brdfdb.store.snapshots`)
ROOT/.staging/NAME/                  a build in progress or broken off (`brdfdb.store.staging`)

The first line of each of these JSON files is the digest of the rest. ROOT is not itself a zarr group: xarray would
rewrite a shared root file, and stale metadata hides groups.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from brdfdb.errors import StoreError, UnknownFamilyError, UnknownMaterialError, UnknownRevisionError, percent
from brdfdb.notebook import listing
from brdfdb.place import path_of
from brdfdb.store.files import read_json, read_sealed, regular_bytes
from brdfdb.store.paths import (
    HEAD,
    METADATA,
    NAME,
    families_path,
    family_path,
    manifest_path,
    material_path,
    materials_path,
    number_of,
    pinned,
    pointer_path,
    revision_path,
    staged_path,
)
from brdfdb.store.records import (
    Head,
    Manifest,
    Snapshot,
    check_manifest,
    check_marker,
    check_summary,
    head_from,
    read_manifest,
    read_snapshot,
    whole_revisions,
)
from brdfdb.store.summary_words import COLUMNS, colours, energy, formula_error, kind, last_audit, surface_error
from brdfdb.store.table_cache import CACHE_BYTES, TableCache

if TYPE_CHECKING:
    import xarray as xr

    from brdfdb.store.family import Family
    from brdfdb.tables.metadata import TableMetadata
    from brdfdb.tables.table import Table


class Store(Mapping[str, "Table"]):
    """A store opened for reading: a mapping from material names to decoded tables of the current revisions.

    Threads may share it. A child of `os.fork` may go on using it, also while threads of the parent read tables, once a
    table was read before the fork: the first one imports modules, whose locks a child would find taken.

    Parameters
    ----------
    root : path
        Directory of the store; a relative path begins at the working directory of the call.
    cache_bytes : int
        Largest size of the decoded tables in memory; the tables used last stay, at least one.
    snapshot : str, optional
        Name of a snapshot: the store has the materials, revisions and families that it names, whatever is built later.

    Raises
    ------
    StoreError
        If there is no store at `root`, or one of another format version; if it has no such snapshot, or a damaged one.
    """

    def __init__(
        self, root: str | os.PathLike[str], cache_bytes: int = CACHE_BYTES, *, snapshot: str | None = None
    ) -> None:
        self.root = path_of(root, "root").absolute()
        check_marker(self.root)
        self.snapshot: Snapshot | None = None if snapshot is None else read_snapshot(self.root, snapshot)
        self._decoded: TableCache[Table] = TableCache(cache_bytes)
        self._pointers: dict[str, Pointer] = {}

    def _repr_html_(self) -> str:
        """Return the store for notebooks: its materials, with their errors and the answers of its last audit."""
        audits = last_audit(self.root)
        rows = []
        for name in self:
            try:
                head = self.summary(name)
                surface = surface_error(head, partial(self.attributes, name))
            except StoreError as error:
                rows.append((name, str(error), *[""] * 7))
                continue
            audited = audits.get((name, head["revision"]))
            rows.append(
                (
                    *(name, head["title"], kind(head), colours(head), percent(head.get("error_p99"))),
                    *(formula_error(head, percent), surface),
                    "" if audited is None else audited.as_published,
                    energy(head, audited),
                )
            )
        families = len(self.families())
        title = f"{len(rows)} materials" + (f", {families} families" if families else "")
        errors = ("table error (p99)", "formula error (p99)", "surface error (median)")
        columns = ("material", "title", "model", "colours", *errors, *COLUMNS)
        return listing("Store", str(self.root), title, columns, rows)

    def __iter__(self) -> Iterator[str]:
        if self.snapshot is not None:
            return iter(sorted(self.snapshot["materials"]))
        directory = materials_path(self.root)
        try:
            names = sorted(os.listdir(directory))
        except OSError as error:
            raise StoreError(f"no store at {self.root}: {error.strerror}") from error
        return (name for name in names if self._has(name))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        if self.snapshot is not None:
            return name in self.snapshot["materials"]
        return isinstance(name, str) and self._has(name)

    def _has(self, name: str) -> bool:
        """Return whether there is a material of a name; its pointer may be lost."""
        return NAME.fullmatch(name) is not None and (
            pointer_path(material_path(self.root, name)).is_file() or self._lost(name)
        )

    def _lost(self, name: str) -> bool:
        """Return whether a material has revisions, and no pointer that a first publication is about to write."""
        material = material_path(self.root, name)
        staged = staged_path(self.root, name)
        revisions = [group.name for group in whole_revisions(material)]
        if not revisions or (revisions == ["r000001"] and any(path.is_dir() for path in staged.glob("*"))):
            return False
        return not pointer_path(material).is_file()  # the last check: it may have been written meanwhile

    def __getitem__(self, name: str) -> Table:
        while True:
            location = self.location(name)
            try:
                return self._table(name, location)
            except StoreError:
                if self.location(name) == location:
                    raise
                # a newer revision was published, and this one was removed: read the newer one

    def table(self, name: str, revision: str) -> Table:
        """Return the decoded table of a revision, current or not: ``r000003``, or ``r000003-0123456789abcdef``.

        The second name has the first 16 digits of `Table.digest`, and means the same table in any store.
        UnknownMaterialError and UnknownRevisionError say that there is none; StoreError, that it is damaged.
        """
        return self._table(name, self.located(name, revision))

    def located(self, name: str, revision: str) -> Location:
        """Return where a revision lies, current or not; errors as by `table`."""
        number, dash, _ = revision.partition("-")
        current = self.current(name)
        group, digest = current.location
        if number != group.name:
            if number not in self.revisions(name):
                raise UnknownRevisionError(f"{name} has no revision {revision[:40]!r}; the current one is {group.name}")
            group = group.with_name(number)
            # a revision that a crash left is not in the pointer: the seal of its manifest is checked
            digest = read_manifest(group, current.head["manifests"].get(number)).digest
        if dash and revision != pinned(number, digest):
            raise UnknownRevisionError(f"{name} has no revision {revision[:40]!r}; here it is {pinned(number, digest)}")
        return Location(group, digest)

    def revision(self, name: str, revision: str | None = None) -> StoredRevision:
        """Return a revision, by default the current one, for reading its files; errors as by `table`."""
        return StoredRevision(self.location(name) if revision is None else self.located(name, revision))

    def revisions(self, name: str) -> list[str]:
        """Return the complete revisions of a material, oldest first; of a snapshot the one that it names."""
        current = self.path(name)
        groups = whole_revisions(current.parent) if self.snapshot is None else [current]
        return [group.name for group in groups]

    def held(self, name: str) -> Table | None:
        """Return the current table of a material if it is decoded already, without waiting, else None."""
        pointer = self._read_pointer(name)
        return None if pointer is None else self._decoded.used((name, pointer.location.digest))

    def _table(self, name: str, location: Location) -> Table:
        def decoded() -> Table:
            files = check_manifest(*location, contents=False)["files"]
            from brdfdb.store.decoding import decode  # lists need no arrays

            return decode(name, location.group, files, location.digest)

        return self._decoded.get((name, location.digest), decoded)

    def head(self, name: str) -> str:
        """Return the current revision of a material, such as ``r000003``, at this moment; errors as by `summary`."""
        return self.path(name).name

    def path(self, name: str) -> Path:
        """Return the directory of the current revision: a zarr group that xarray opens."""
        return self.location(name).group

    def place_of(self, name: str) -> str:
        """Return where the current revision lies, for people."""
        return str(self.path(name))

    def summary(self, name: str) -> Head:
        """Return the content of the pointer of a material: what lists show of the current revision.

        UnknownMaterialError says that the store has no such material; StoreError, that the pointer is damaged.
        """
        return self.current(name).head

    def attributes(self, name: str) -> dict[str, Any]:
        """Return the attributes of the current revision as JSON, for lists, which need no arrays."""
        attributes: dict[str, Any] = read_json(self.path(name) / METADATA).get("attributes", {})
        return attributes

    def metadata(self, name: str) -> TableMetadata:
        """Return the metadata of the current revision, without decoding its values; errors as by `summary`."""
        from brdfdb.store.records import read_metadata

        location = self.location(name)
        check_manifest(*location, contents=False)
        return read_metadata(location.group)

    def families(self) -> list[str]:
        """Return the names of the families, sorted."""
        if self.snapshot is not None:
            return sorted(self.snapshot["families"])
        try:
            files = sorted(os.listdir(families_path(self.root)))
        except FileNotFoundError:
            return []
        except OSError as error:
            raise StoreError(f"cannot read {families_path(self.root)}: {error.strerror}") from error
        names = (name.removesuffix(".json") for name in files if name.endswith(".json"))
        return [name for name in names if NAME.fullmatch(name)]

    def family(self, name: str) -> Family:
        """Return a family: its model at any parameters between those of its members.

        UnknownFamilyError says that the store has no such family; StoreError, that its record cannot be read.
        """
        from brdfdb.store.family import Family, record_from

        return Family(record_from(self.family_content(name), f"the family {name}"), self)

    def family_content(self, name: str) -> dict[str, Any]:
        """Return the record of a family as JSON, for lists; errors as by `family`."""
        path = family_path(self.root, name)
        if self.snapshot is not None and name in self.snapshot["families"]:
            return self.snapshot["families"][name]
        if self.snapshot is None and NAME.fullmatch(name) and path.exists():
            return read_sealed(path, f"the family {name}")
        raise UnknownFamilyError(name, self.families())

    def dataset(self, name: str, revision: str | None = None) -> xr.Dataset:
        """Return a revision, by default the current one, as a lazy Dataset: see `brdfdb.tables.xarray_view.opened`.

        Errors are those of `table`; StoreError, naming material, revision and file, is also raised later, while the
        Dataset is read.
        """
        from brdfdb.store.zarr_store import CheckedRevision
        from brdfdb.tables.xarray_view import opened

        location = self.location(name) if revision is None else self.located(name, revision)
        files = check_manifest(*location, contents=False)["files"]
        try:
            return opened(CheckedRevision(location.group, files))
        except ValueError as error:  # written by another program
            raise StoreError(f"{name} {location.group.name} is not a table: {error}") from error

    def verify(self, name: str) -> None:
        """Check every file of the current revision against its manifest, and the manifest against the pointer.

        StoreError names the first file that is missing, of another size or of another content.
        """
        current = self.current(name)
        check_summary(current.head, check_manifest(*current.location, contents=True))

    def current(self, name: str) -> Pointer:
        """Return the pointer of a material, from one look at it; errors as by `summary`."""
        pointer = self._read_pointer(name)
        if pointer is not None:
            return pointer
        if self.snapshot is None and NAME.fullmatch(name) and self._lost(name):
            raise StoreError(f"{name} is damaged: {HEAD} is missing")
        raise UnknownMaterialError(name, list(self))

    def _pinned(self, name: str, snapshot: Snapshot) -> Pointer | None:
        """Return the pointer of a material to the revision that the snapshot names; None if it names none."""
        known = self._pointers.get(name)
        pin = snapshot["materials"].get(name)
        if known is None and pin is not None:
            group = revision_path(self.root, name, pin["revision"])
            manifest, digest = read_manifest(group, pin["manifest_sha256"])
            head: Head = {
                **manifest["summary"],
                "material": name,
                "revision": group.name,
                "manifests": {group.name: digest},
                "last": number_of(group.name),
            }
            known = self._pointers[name] = Pointer.of((0, 0, 0), pointer_path(group.parent), head)
        return known

    def _read_pointer(self, name: str) -> Pointer | None:
        """Return the pointer of a material, read anew if it changed; None if there is none."""
        if self.snapshot is not None:
            return self._pinned(name, self.snapshot)
        known = self._pointers.get(name)
        if known is None and not NAME.fullmatch(name):
            return None
        path = pointer_path(material_path(self.root, name)) if known is None else known.path
        try:
            at = os.stat(path)
            seen = at.st_ino, at.st_mtime_ns, at.st_size  # a swap gives the file a new inode
            if known is None or known.seen != seen:
                head = head_from(path, regular_bytes(path))
                known = self._pointers[name] = Pointer.of(seen, path, head)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            raise StoreError(f"{name} is damaged: {HEAD} cannot be read: {error.strerror}") from error
        return known

    def location(self, name: str) -> Location:
        """Return where the current revision lies, from one look at the pointer; errors as by `summary`."""
        return self.current(name).location


class StoredRevision:
    """A revision of a material of a store: its files, each checked when it is read, and its manifest."""

    def __init__(self, location: Location) -> None:
        self.group, self.digest = location

    @property
    def number(self) -> str:
        """Number of the revision, such as ``r000003``."""
        return self.group.name

    @cached_property
    def manifest(self) -> Manifest:
        """The manifest, after a check of the sizes of all files; StoreError names the first that differs."""
        return check_manifest(self.group, self.digest, contents=False)

    @property
    def manifest_bytes(self) -> bytes:
        """The content of the manifest, whose sha256 is `digest`; StoreError if it changed."""
        read_manifest(self.group, self.digest)
        return manifest_path(self.group).read_bytes()

    def read(self, key: str) -> bytes:
        """Return a file by its path inside the group; StoreError if it is missing or changed."""
        from brdfdb.store.decoding import checked_bytes

        return checked_bytes(self.group, key, self.manifest["files"])


class Location(NamedTuple):
    """Location of a revision: its directory, and the digest of its manifest."""

    group: Path
    digest: str


class Pointer(NamedTuple):
    """The pointer of a material as it was read, with the state of its file, which a change of the pointer changes."""

    seen: tuple[int, int, int]  # inode, time of the last change [ns], size [byte]
    path: Path
    head: Head
    location: Location  # of the current revision: made once, since each lookup asks for it

    @classmethod
    def of(cls, seen: tuple[int, int, int], path: Path, head: Head) -> Pointer:
        """Return the pointer with the content of its file."""
        revision = head["revision"]
        return cls(seen, path, head, Location(path.parent / revision, head["manifests"][revision]))
