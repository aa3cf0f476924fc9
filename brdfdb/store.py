"""The store, for reading: one immutable revision per build of a material, a manifest for each, a pointer to one.

ROOT/brdfdb.json                     format name and version
ROOT/materials/NAME/r000001/         a self-contained zarr v3 group, never modified
ROOT/materials/NAME/r000001.MANIFEST.json   size and sha256 of its files; beside it, zarr warns of strangers inside
ROOT/materials/NAME/HEAD.json        current revision, digest of its manifest, and what lists show; swapped atomically
ROOT/families/NAME.json              which materials make a family, and how well it interpolates (`brdfdb.family`)
ROOT/.staging/NAME/                  a build in progress or broken off (`brdfdb.staging`)

ROOT is not itself a zarr group: xarray would rewrite a shared root file, and stale metadata hides groups.
"""

from __future__ import annotations

import difflib
import functools
import os
import re
import threading
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brdfdb.manifest import Head, StoreError, check_manifest, json_object, manifest_digest, number_of, read_json

if TYPE_CHECKING:
    import xarray as xr

    from brdfdb.family import Family
    from brdfdb.lookup import Table
    from brdfdb.whole import Whole

__all__ = [
    "FORMAT",
    "FORMAT_VERSION",
    "Store",
    "StoreError",
    "UnknownFamilyError",
    "UnknownMaterialError",
    "UnknownRevisionError",
]

FORMAT = "brdfdb"
FORMAT_VERSION = 1

CACHE_BYTES = 256 * 2**20  # of decoded tables that a Store keeps
# Of a material: what does not match is never joined to a path. Files may have names of 255 characters
NAME = re.compile(r"(?!.{129})[a-z0-9]+(-[a-z0-9]+)*")
_SHOWN = 60  # characters of an unknown name


class UnknownMaterialError(KeyError):
    """A name that is not in the store.

    Attributes
    ----------
    name : str
        What was asked for.
    closest : list of str
        Up to five names that are close to it.
    """

    kind = "material"

    def __init__(self, name: str, names: list[str]) -> None:
        super().__init__(name)
        self.name = name
        self.closest = difflib.get_close_matches(name, names, n=5, cutoff=0.4)

    def __str__(self) -> str:
        hint = f"; closest: {', '.join(self.closest)}" if self.closest else ""
        shown = self.name if len(self.name) <= _SHOWN else f"{self.name[:_SHOWN]}..."
        return f"no {self.kind} {shown!r} in the store{hint}"


class UnknownFamilyError(UnknownMaterialError):
    """A name that is not that of a family in the store."""

    kind = "family"


class UnknownRevisionError(KeyError):
    """A revision that a material does not have; str() is one sentence."""

    def __str__(self) -> str:
        return str(self.args[0])


class Store(Mapping[str, "Table"]):
    """A store opened for reading: a mapping from material names to decoded tables of the current revisions.

    Parameters
    ----------
    root : path
        Directory of the store.
    cache_bytes : int
        How much of decoded tables is kept; those used last stay, and always the very last.

    Raises
    ------
    StoreError
        If there is no store at `root`, or one of another format version.
    """

    def __init__(self, root: str | os.PathLike[str], cache_bytes: int = CACHE_BYTES) -> None:
        self.root = Path(root)
        marker = self.root / "brdfdb.json"
        if not marker.is_file():
            raise StoreError(f"no store at {self.root}: brdfdb.json is missing there; `brdfdb build` makes one")
        found = read_json(marker)
        if (found.get("format"), found.get("version")) != (FORMAT, FORMAT_VERSION):
            raise StoreError(
                f"{marker} says format {found.get('format')} version {found.get('version')}, "
                f"this program reads {FORMAT} version {FORMAT_VERSION}"
            )
        self._cache_bytes = cache_bytes
        self._decoded: OrderedDict[tuple[str, str], Table] = OrderedDict()
        self._pointers: dict[str, _Pointer] = {}
        self._lock = threading.Lock()
        self._decoding = threading.Lock()

    def __iter__(self) -> Iterator[str]:
        directory = f"{self.root}/materials"
        try:
            names = sorted(os.listdir(directory))
        except OSError as error:
            raise StoreError(f"no store at {self.root}: {error.strerror}") from error
        return (name for name in names if NAME.fullmatch(name) and os.path.isfile(f"{directory}/{name}/HEAD.json"))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return (
            isinstance(name, str)
            and NAME.fullmatch(name) is not None
            and os.path.isfile(f"{self.root}/materials/{name}/HEAD.json")
        )

    def __getitem__(self, name: str) -> Table:
        while True:
            group, digest = self.location(name)
            try:
                return self._table(name, group, digest)
            except StoreError:
                if self.location(name) == (group, digest):
                    raise
                # a newer revision was published, and the one we were reading removed: read the newer one

    def table(self, name: str, revision: str) -> Table:
        """The decoded table of a revision, current or not.

        Raises
        ------
        UnknownMaterialError, UnknownRevisionError
            If the store has no such material, or it no such revision.
        StoreError
            If the revision is damaged.
        """
        group, digest = self.location(name)
        if group.name != revision:
            if revision not in self.revisions(name):
                raise UnknownRevisionError(f"{name} has no revision {revision[:40]!r}; the current one is {group.name}")
            group = group.with_name(revision)
            digest = manifest_digest(group)
        return self._table(name, group, digest)

    def revisions(self, name: str) -> list[str]:
        """The revisions of a material that are whole, oldest first."""
        material = self.path(name).parent
        found = {file.name.removesuffix(".MANIFEST.json") for file in material.glob("r*.MANIFEST.json")}
        return sorted((each for each in found if number_of(each) and (material / each).is_dir()), key=number_of)

    def held(self, name: str) -> Table | None:
        """The current table of a material if it is decoded already: an answer without waiting; None else.

        Raises
        ------
        StoreError
            As `location` does.
        """
        pointer = self._read_pointer(name)
        return None if pointer is None else self._used((name, pointer.location[1]))

    def _table(self, name: str, group: Path, digest: str) -> Table:
        key = name, digest
        if (held := self._used(key)) is not None:
            return held
        from brdfdb.whole import Whole  # loads zarr

        with self._decoding:  # who asks for the same table meanwhile waits for it
            if (held := self._used(key)) is not None:
                return held
            files = check_manifest(group, digest, contents=False)["files"]
            try:
                table = _decode(name, group, Whole(group, files), digest)
            except StoreError:
                check_manifest(group, digest, contents=True)  # names the file
                raise
            with self._lock:
                self._decoded[key] = table
                size = sum(each.nbytes for each in self._decoded.values())
                while size > self._cache_bytes and len(self._decoded) > 1:
                    size -= self._decoded.popitem(last=False)[1].nbytes
            return table

    def _used(self, key: tuple[str, str]) -> Table | None:
        """A decoded table, which is now the one used last."""
        with self._lock:
            if key in self._decoded:
                self._decoded.move_to_end(key)
            return self._decoded.get(key)

    def head(self, name: str) -> str:
        """The current revision of a material, such as ``r000003``, read anew each time.

        Raises
        ------
        UnknownMaterialError
            If the store has no such material.
        """
        return self.path(name).name

    def path(self, name: str) -> Path:
        """Directory of the current revision: a zarr group that xarray opens."""
        return self.location(name)[0]

    def summary(self, name: str) -> Head:
        """What lists show of the current revision: what its pointer says, without a look at the table.

        Raises
        ------
        UnknownMaterialError
            If the store has no such material.
        StoreError
            If the pointer cannot be read.
        """
        head = self._pointer(name).head
        if "title" not in head:  # of a table that was built before pointers told it
            attributes = self.attributes(name)
            head = {**head, "title": attributes["title"], "model": attributes["model"]}
        return head  # type: ignore[return-value]  # written by this program

    def attributes(self, name: str) -> dict[str, Any]:
        """What the current revision says of itself, without decoding its values."""
        group, digest = self.location(name)
        check_manifest(group, digest, contents=False)
        return dict(read_json(group / "zarr.json")["attributes"])

    def families(self) -> list[str]:
        """The names of the families, sorted."""
        try:
            found = sorted(os.listdir(f"{self.root}/families"))
        except FileNotFoundError:
            return []
        except OSError as error:
            raise StoreError(f"cannot read {self.root}/families: {error.strerror}") from error
        names = (name.removesuffix(".json") for name in found if name.endswith(".json"))
        return [name for name in names if NAME.fullmatch(name)]

    def family(self, name: str) -> Family:
        """A family: its model at any parameters between those of its members.

        Raises
        ------
        UnknownFamilyError
            If the store has no such family.
        StoreError
            If its record cannot be read.
        """
        from brdfdb.family import Family, path_of, read_record

        if name not in self.families():
            raise UnknownFamilyError(name, self.families())
        return Family(read_record(path_of(self.root, name)), self)

    def dataset(self, name: str) -> xr.Dataset:
        """The current revision as a lazy xarray Dataset.

        Raises
        ------
        UnknownMaterialError
            If the store has no such material.
        StoreError
            If a file of it is missing, also later, while it is read: xarray would read nan in its place.
        """
        import xarray as xr

        from brdfdb.rebuilt import with_brdf
        from brdfdb.whole import Whole

        group, digest = self.location(name)
        files = check_manifest(group, digest, contents=False)["files"]
        return with_brdf(xr.open_zarr(Whole(group, files), chunks=None))

    def verify(self, name: str) -> None:
        """Check every file of the current revision against its manifest, and the manifest against the pointer.

        Raises
        ------
        StoreError
            Naming the first file that is missing, of another size or of another content.
        """
        check_manifest(*self.location(name), contents=True)

    def _pointer(self, name: str) -> _Pointer:
        pointer = self._read_pointer(name)
        if pointer is None:
            raise UnknownMaterialError(name, list(self))
        return pointer

    def _read_pointer(self, name: str) -> _Pointer | None:
        """The pointer of a material, read anew if it changed; None if there is none."""
        known = self._pointers.get(name)
        if known is None and not NAME.fullmatch(name):
            return None
        path = f"{self.root}/materials/{name}/HEAD.json"
        try:
            at = os.stat(path)
            seen = at.st_ino, at.st_mtime_ns, at.st_size  # a swap gives the file a new inode
            if known is None or known.seen != seen:
                with open(path, "rb") as handle:
                    known = self._pointers[name] = _Pointer(seen, Path(path), json_object(Path(path), handle.read()))
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            raise StoreError(f"cannot read {path}: {error.strerror}") from error
        return known

    def location(self, name: str) -> tuple[Path, str]:
        """Directory of the current revision and the digest of its manifest, both from one look at the pointer."""
        return self._pointer(name).location

    def current(self, name: str) -> tuple[Path, str, dict[str, Any]]:
        """What `location` gives, and what else the pointer says, from one look at it."""
        pointer = self._pointer(name)
        return *pointer.location, dict(pointer.head)


class _Pointer:
    """The pointer of a material as it was read, and how to tell that it is another now."""

    def __init__(self, seen: tuple[int, int, int], path: Path, head: dict[str, Any]) -> None:
        self.seen, self.path, self.head = seen, path, head

    @functools.cached_property
    def location(self) -> tuple[Path, str]:
        """Directory of the revision, and the digest of its manifest."""
        revision, digest = self.head.get("revision"), self.head.get("manifest_sha256")
        if not (isinstance(revision, str) and isinstance(digest, str) and number_of(revision)):
            name = self.path.parent.name
            raise StoreError(f"{name} is damaged: {self.path} does not name a revision and its manifest")
        return self.path.with_name(revision), digest


def _decode(name: str, path: Path, files: Whole, digest: str) -> Table:
    import numpy as np
    import zarr

    from brdfdb.lookup import table_from

    try:
        group = zarr.open_group(files, mode="r")
        arrays = {key: np.asarray(array[...]) for key, array in group.arrays()}
    except StoreError:
        raise
    except Exception as error:  # zarr's codecs raise many kinds; each means that the bytes are damaged
        raise StoreError(f"{name} {path.name} is damaged: its values cannot be decoded") from error
    return replace(table_from(name, path.name, arrays, dict(group.attrs)), digest=digest)
