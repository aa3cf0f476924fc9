"""An edition opened for reading: a mapping of names to tables, read when they are first used.

Requests: two to open; two for the first table of a group, one for a further table of it, none for a decoded one.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brdfdb.errors import NoEditionError, StoreError, UnknownFamilyError, UnknownMaterialError
from brdfdb.notebook import card
from brdfdb.place import is_service
from brdfdb.store.edition.objects import MissingObjectError, checked, objects_at
from brdfdb.store.edition.records import (
    GroupEntry,
    Member,
    Records,
    family_key,
    read_index,
    read_root,
)
from brdfdb.store.paths import EDITION, METADATA, NAME
from brdfdb.store.table_cache import CACHE_BYTES, TableCache

if TYPE_CHECKING:
    import xarray as xr
    from zarr.abc.store import Store as ZarrStore

    from brdfdb.store.family import Family
    from brdfdb.tables.metadata import TableMetadata
    from brdfdb.tables.table import Table

_RECORDS_BYTES = 128 * 2**20  # largest size of the records in memory


class Edition(Mapping[str, "Table"]):
    """An edition: the tables of a database as `brdfdb publish` wrote them, with the methods of `Store`.

    It shows the edition that it was opened with, also when the place has a newer one, and a copy by pickle shows the
    same. Threads may share it; so may children of `os.fork`, except of an edition in a bucket.

    Parameters
    ----------
    place : path or address
        A directory, ``https://...``, ``s3://bucket/prefix``, ``gs://...`` or ``az://...``.
    cache_bytes : int
        Largest size of the decoded tables in memory; the tables used last stay, at least one.
    storage_options : mapping, optional
        Options of obstore for a bucket.
    digest : str, optional
        The sha256 of the edition, `Edition.digest`, where the place may have a newer one by now.

    Raises
    ------
    StoreError
        If there is no edition at `place`, or one of another format version; also later, where an object is missing or
        changed.
    """

    def __init__(
        self,
        place: str | Path,
        cache_bytes: int = CACHE_BYTES,
        *,
        storage_options: Mapping[str, Any] | None = None,
        digest: str | None = None,
    ) -> None:
        self.objects = objects_at(place, storage_options)
        self.place = self.objects.name
        self.digest = self._current_digest() if digest is None else digest
        try:
            self.index = read_index(self.objects, self.digest)
        except MissingObjectError:
            if digest is None:
                raise
            raise StoreError(f"{self.place} has no edition with the digest {digest}") from None
        self._decoded: TableCache[Table] = TableCache(cache_bytes)
        self._records: TableCache[Records] = TableCache(_RECORDS_BYTES)
        again = partial(Edition, cache_bytes=cache_bytes, storage_options=storage_options, digest=self.digest)
        self._reduced = again, (self.place,)

    def __reduce__(self) -> tuple[Callable[[str], Edition], tuple[str]]:
        return self._reduced

    def _current_digest(self) -> str:
        """Return the digest in the root; NoEditionError if there is none."""
        try:
            root: bytes | None = self.objects.get(EDITION)
        except MissingObjectError:
            root = None
        if root is None or (is_service(self.place) and not root.startswith(b'{"sha256"')):  # as the login of a network
            raise NoEditionError(f"no edition at {self.place}; `brdfdb publish` makes one")
        return read_root(root, self.place)["index"]

    def _repr_html_(self) -> str:
        """Return the edition for notebooks."""
        facts = [
            ("place", self.place),
            ("materials", str(len(self))),
            ("families", str(len(self.families()))),
            ("sha256", self.digest),
        ]
        return card("Edition", self.place, "", facts)

    def __len__(self) -> int:
        return self.index["materials"]

    def __iter__(self) -> Iterator[str]:
        groups = self.index["groups"]
        return iter(sorted(name for entry in groups for name in self._names(entry)))

    def __contains__(self, name: object) -> bool:
        if self._by_name is not None:
            return name in self._by_name
        return isinstance(name, str) and self._found(name) is not None

    def __getitem__(self, name: str) -> Table:
        member = self.revision(name)

        def as_zarr() -> ZarrStore:
            from brdfdb.store.edition.zarr_group import PublishedRevision

            return PublishedRevision(member)

        def decoded() -> Table:
            from brdfdb.store.decoding import decoded_table

            return decoded_table(name, member.number, member.digest, member.read, as_zarr)

        return self._decoded.get((name, member.digest), decoded)

    def held(self, name: str) -> Table | None:
        """Return the table of a material if it is decoded already, without waiting, else None."""
        for entry in self._candidates(name):
            records = self._records.used(entry["digest"])
            if records is not None and name in records.numbers:
                return self._decoded.used((name, records.digest_of(name)))
        return None

    def table(self, name: str, revision: str) -> Table:
        """Return the table of a revision, which is the only one of its material; errors as of `Store.table`."""
        self.revision(name, revision)
        return self[name]

    def revision(self, name: str, revision: str | None = None) -> Member:
        """Return the revision of a material, for reading its files; errors as by `table`."""
        records = self._found(name)
        if records is None:
            groups = self.index["groups"] if self._by_name is not None else self._candidates(name)
            raise UnknownMaterialError(name, [known for entry in groups for known in self._names(entry)])
        member = records.member(name)
        if revision is not None:
            member.check_revision(revision)
        return member

    def revisions(self, name: str) -> list[str]:
        """Return the revision of a material, in a list."""
        return [self.head(name)]

    def head(self, name: str) -> str:
        """Return the revision of a material, such as ``r000003``."""
        return self.revision(name).number

    def place_of(self, name: str) -> str:
        """Return where the group of a material lies, for people."""
        return f"{self.place}/groups/{self.revision(name).group}"

    def summary(self, name: str) -> dict[str, Any]:
        """Return what lists show of a material; UnknownMaterialError if there is none of this name."""
        member = self.revision(name)
        return {**member.manifest["summary"], "material": name, "revision": member.number}

    def metadata(self, name: str) -> TableMetadata:
        """Return the metadata of a material, without reading its values; errors as of `summary`."""
        from brdfdb.tables.metadata import TableMetadata

        return TableMetadata.read(self.attributes(name))

    def attributes(self, name: str) -> dict[str, Any]:
        """Return the attributes of a material as JSON."""
        attributes: dict[str, Any] = json.loads(self.revision(name).read(METADATA)).get("attributes", {})
        return attributes

    def families(self) -> list[str]:
        """Return the names of the families, sorted."""
        return sorted(self.index["families"])

    def family(self, name: str) -> Family:
        """Return a family: its model at any parameters between those of its members; errors as of `Store.family`."""
        from brdfdb.store.family import Family, record_from

        return Family(record_from(self.family_content(name), f"the family {name}"), self)

    def family_content(self, name: str) -> dict[str, Any]:
        """Return the record of a family as JSON; UnknownFamilyError if the edition has none of this name."""
        digest = self.index["families"].get(name)
        if digest is None:
            raise UnknownFamilyError(name, self.families())
        content: dict[str, Any] = json.loads(checked(self.objects, family_key(digest), digest))
        return content

    def dataset(self, name: str, revision: str | None = None) -> xr.Dataset:
        """Return a table as a lazy Dataset: see `brdfdb.tables.xarray_view.opened`; errors as of `table`."""
        from brdfdb.store.edition.zarr_group import PublishedRevision
        from brdfdb.tables.xarray_view import opened

        try:
            return opened(PublishedRevision(self.revision(name, revision)))
        except ValueError as error:  # written by another program
            raise StoreError(f"{name} is not a table: {error}") from error

    def verify(self, name: str) -> None:
        """Check every file of a material against its manifest; StoreError names the first that differs."""
        member = self.revision(name)
        for key in member.manifest["files"]:
            member.read(key)

    def entries(self, names: Iterable[str] = ()) -> list[GroupEntry]:
        """Return the groups of the index, or those that have some of the names."""
        digests = {self.revision(name).group for name in names}
        return [entry for entry in self.index["groups"] if not digests or entry["digest"] in digests]

    def _names(self, entry: GroupEntry) -> Iterable[str]:
        return entry.get("names") or self._group(entry).numbers

    def _found(self, name: str) -> Records | None:
        """Return the records of the group that has a material; None if no group has it."""
        if not NAME.fullmatch(name):
            return None
        groups = (self._group(entry) for entry in self._candidates(name))
        return next((records for records in groups if name in records.numbers), None)

    def _candidates(self, name: str) -> Collection[GroupEntry]:
        """Return the groups that may have a material: the only one, if the index has names."""
        if (known := self._by_name) is not None:
            return known.get(name, ())
        return [entry for entry in self.index["groups"] if entry["first"] <= name <= entry["last"]]

    @cached_property
    def _by_name(self) -> dict[str, tuple[GroupEntry]] | None:
        """The group of each name; None if the index has no names."""
        groups = self.index["groups"]
        if not all("names" in entry for entry in groups):
            return None
        return {name: (entry,) for entry in groups for name in entry["names"]}

    def _group(self, entry: GroupEntry) -> Records:
        """Return the records of a group; those used last stay in memory."""
        digest = entry["digest"]
        return self._records.get(digest, lambda: Records(self.objects, digest))
