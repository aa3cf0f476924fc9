"""The store: one immutable revision per build of a material, a manifest for each, a pointer to the current one.

ROOT/brdfdb.json                     format name and version
ROOT/materials/NAME/r000001/         a self-contained zarr v3 group, never modified
ROOT/materials/NAME/r000001.MANIFEST.json   size and sha256 of its files; beside it, zarr warns of strangers inside
ROOT/materials/NAME/HEAD.json        current revision and the digest of its manifest, swapped atomically
ROOT/.staging/UUID/                  a build in progress: locked, with its recipe

ROOT is not itself a zarr group: xarray would rewrite a shared root file, and stale metadata hides groups.
"""

from __future__ import annotations

import difflib
import fcntl
import hashlib
import json
import os
import shutil
import threading
import uuid
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from brdfdb.lookup import Table, table_from

if TYPE_CHECKING:
    import xarray as xr

FORMAT = "brdfdb"
FORMAT_VERSION = 1

_DECODED = 8  # tables kept decoded by a Store
_CHUNK_VALUES = 1 << 20  # values of a chunk of brdf, 4 MB


class StoreError(Exception):
    """A store that is missing, damaged, of another version, or cannot be written; str() is one sentence."""


class UnknownMaterialError(KeyError):
    """A name that is not in the store.

    Attributes
    ----------
    name : str
        What was asked for.
    closest : list of str
        Up to five names that are close to it.
    """

    def __init__(self, name: str, names: list[str]) -> None:
        super().__init__(name)
        self.name = name
        self.closest = difflib.get_close_matches(name, names, n=5, cutoff=0.4)

    def __str__(self) -> str:
        hint = f"; closest: {', '.join(self.closest)}" if self.closest else ""
        return f"no material {self.name!r} in the store{hint}"


class Store(Mapping[str, Table]):
    """A store opened for reading: a mapping from material names to decoded tables of the current revisions.

    Parameters
    ----------
    root : path
        Directory of the store.

    Raises
    ------
    StoreError
        If there is no store at `root`, or one of another format version.
    """

    def __init__(self, root: str | os.PathLike[str]) -> None:
        self.root = Path(root)
        marker = self.root / "brdfdb.json"
        if not marker.is_file():
            raise StoreError(f"no store at {self.root}: brdfdb.json is missing there; `brdfdb build` makes one")
        found = _read_json(marker)
        if (found.get("format"), found.get("version")) != (FORMAT, FORMAT_VERSION):
            raise StoreError(
                f"{marker} says format {found.get('format')} version {found.get('version')}, "
                f"this program reads {FORMAT} version {FORMAT_VERSION}"
            )
        self._decoded: OrderedDict[tuple[str, str], Table] = OrderedDict()
        self._lock = threading.Lock()

    def __iter__(self) -> Iterator[str]:
        try:
            names = sorted(os.listdir(self.root / "materials"))
        except OSError as error:
            raise StoreError(f"no store at {self.root}: {error.strerror}") from error
        return (name for name in names if (self.root / "materials" / name / "HEAD.json").is_file())

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return any(name == known for known in self)  # matched, never joined to a path unseen

    def __getitem__(self, name: str) -> Table:
        group, digest = self._head(name)
        with self._lock:
            if (name, group.name) in self._decoded:
                self._decoded.move_to_end((name, group.name))
                return self._decoded[name, group.name]
        check_manifest(group, digest, contents=False)
        table = _decode(name, group)
        with self._lock:
            self._decoded[name, group.name] = table
            while len(self._decoded) > _DECODED:
                self._decoded.popitem(last=False)
        return table

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
        return self._head(name)[0]

    def attributes(self, name: str) -> dict[str, Any]:
        """What the current revision says of itself, without decoding its values."""
        group, digest = self._head(name)
        check_manifest(group, digest, contents=False)
        return dict(_read_json(group / "zarr.json")["attributes"])

    def dataset(self, name: str) -> xr.Dataset:
        """The current revision as a lazy xarray Dataset.

        Raises
        ------
        UnknownMaterialError
            If the store has no such material.
        StoreError
            If a file of it is missing: xarray would read nan in its place.
        """
        import xarray as xr

        group, digest = self._head(name)
        check_manifest(group, digest, contents=False)
        from brdfdb.rebuilt import with_brdf

        return with_brdf(xr.open_zarr(group, chunks=None))

    def verify(self, name: str) -> None:
        """Check every file of the current revision against its manifest, and the manifest against the pointer.

        Raises
        ------
        StoreError
            Naming the first file that is missing, of another size or of another content.
        """
        check_manifest(*self._head(name), contents=True)

    def _head(self, name: str) -> tuple[Path, str]:
        """Directory of the current revision and the digest of its manifest, both from one look at the pointer."""
        if name not in self:
            raise UnknownMaterialError(name, list(self))
        pointer = self.root / "materials" / name / "HEAD.json"
        head = _read_json(pointer)
        try:
            return pointer.with_name(head["revision"]), head["manifest_sha256"]
        except (KeyError, TypeError, ValueError) as error:
            raise StoreError(f"{name} is damaged: {pointer} does not name a revision and its manifest") from error


def _decode(name: str, path: Path) -> Table:
    import zarr

    group = zarr.open_group(path, mode="r")
    try:
        arrays = {key: np.asarray(array[...]) for key, array in group.arrays()}
    except Exception as error:  # zarr's codecs raise many kinds; each means that the bytes are damaged
        raise StoreError(f"{name} {path.name} is damaged: its values cannot be decoded") from error
    return table_from(name, path.name, arrays, dict(group.attrs))


class Build:
    """Writes revisions: a context manager that stages them, locked, under the root, and publishes each when whole.

    Parameters
    ----------
    root : path
        Directory of the store; made if it does not exist.
    recipe : dict
        What is being built; kept in the staging directory and in the attributes of every revision.

    Raises
    ------
    StoreError
        If `root` cannot be written, or is something other than a store.
    """

    def __init__(self, root: str | os.PathLike[str], recipe: dict[str, Any]) -> None:
        self.root = Path(root)
        self.recipe = recipe
        self._staging = self.root / ".staging" / uuid.uuid4().hex

    def __enter__(self) -> Build:
        try:
            _make_store(self.root)
            with (self.root / ".staging" / "lock").open("wb") as entrance:
                fcntl.flock(entrance, fcntl.LOCK_EX)  # no other build sweeps before our own lock is held
                _sweep(self.root / ".staging")
                self._staging.mkdir()
                self._lock = (self._staging / "lock").open("wb")
                fcntl.flock(self._lock, fcntl.LOCK_EX)
            _write_json(self._staging / "recipe.json", self.recipe)
        except OSError as error:
            raise StoreError(f"cannot write a store at {self.root}: {error.strerror or error}") from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        shutil.rmtree(self._staging, ignore_errors=True)
        self._lock.close()

    def publish(self, name: str, dataset: xr.Dataset) -> tuple[str, int]:
        """Write a dataset as the next revision of a material and point to it; returns the revision and its bytes.

        Until the pointer is swapped, as the last step, readers see the revision before.

        Raises
        ------
        StoreError
            If it cannot be written.
        """
        staged = self._staging / name
        try:
            _write_group(staged, dataset.assign_attrs(recipe=self.recipe))
            files = _digests(staged)
            revision = _move_in(staged, self.root / "materials" / name)
            digest = _write_json(_manifest_of(self.root / "materials" / name / revision), {"files": files})
            _swap_json(self.root / "materials" / name / "HEAD.json", {"revision": revision, "manifest_sha256": digest})
        except OSError as error:
            raise StoreError(f"cannot write {name} to the store at {self.root}: {error.strerror or error}") from error
        return revision, sum(int(entry["size"]) for entry in files.values())


def _make_store(root: Path) -> None:
    marker = root / "brdfdb.json"
    root.mkdir(parents=True, exist_ok=True)
    strangers = [path for path in root.iterdir() if not path.name.startswith(f".{marker.name}.")]
    if marker.exists():  # asked after the look around: another build may be making the store right now
        Store(root)
    elif strangers:
        raise StoreError(f"{root} is not empty and not a store; name an empty or a new directory")
    else:
        _swap_json(marker, {"format": FORMAT, "version": FORMAT_VERSION})
    (root / "materials").mkdir(exist_ok=True)
    (root / ".staging").mkdir(exist_ok=True)


def _sweep(staging: Path) -> None:
    """Remove what builds that were killed left behind: staging directories whose lock nobody holds."""
    for directory in staging.iterdir():
        try:
            with (directory / "lock").open("wb") as handle:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(directory, ignore_errors=True)
        except OSError:  # at work, just ended, or another user's
            continue


def _write_group(path: Path, dataset: xr.Dataset) -> None:
    from zarr.codecs import BloscCodec, Crc32cCodec

    encoding: dict[str, Any] = {}
    for name, variable in dataset.variables.items():
        # crc32c last: without it nearly every flipped bit reads back as a plausible number
        encoding[str(name)] = {
            "compressors": (BloscCodec(cname="zstd", clevel=1, shuffle="shuffle"), Crc32cCodec()),
            "fill_value": np.nan,
            "chunks": _chunks(variable.shape),
        }
    dataset.to_zarr(path, mode="w-", zarr_format=3, consolidated=False, encoding=encoding, write_empty_chunks=True)
    _consolidate(path)


def _consolidate(group: Path) -> None:
    """Repeat the metadata of the arrays in that of the group, where a plain `xarray.open_zarr` looks for it first.

    As `zarr.consolidate_metadata` does, which warns while doing so. A revision never changes: nothing goes stale.
    """
    metadata = _read_json(group / "zarr.json")
    arrays = {path.parent.name: _read_json(path) for path in sorted(group.glob("*/zarr.json"))}
    metadata["consolidated_metadata"] = {"kind": "inline", "must_understand": False, "metadata": arrays}
    _write_json(group / "zarr.json", metadata)


def _chunks(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Whole rows of the first axis, as many as make a chunk of _CHUNK_VALUES."""
    rest = int(np.prod(shape[1:]))
    return (max(1, min(shape[0], _CHUNK_VALUES // max(rest, 1))), *shape[1:])


def _digests(group: Path) -> dict[str, dict[str, Any]]:
    """Size and sha256 of every file of a group, each synced to disk."""
    files: dict[str, dict[str, Any]] = {}
    for path in sorted(p for p in group.rglob("*") if p.is_file()):
        with path.open("rb") as handle:
            digest = hashlib.file_digest(handle, "sha256").hexdigest()
            files[path.relative_to(group).as_posix()] = {"size": path.stat().st_size, "sha256": digest}
            os.fsync(handle.fileno())
    return files


def _manifest_of(group: Path) -> Path:
    return group.with_name(f"{group.name}.MANIFEST.json")


def check_manifest(group: Path, digest: str, *, contents: bool) -> None:
    """Check the files of a revision against its manifest: that they are there and their sizes.

    Also their contents, where no checksum of a chunk tells: of the metadata, and with `contents` of every file.

    Raises
    ------
    StoreError
        Naming the first file that differs.
    """
    where = f"{group.parent.name} {group.name}"
    manifest = _manifest_of(group)
    if not manifest.is_file() or hashlib.sha256(manifest.read_bytes()).hexdigest() != digest:
        raise StoreError(f"{where} is damaged: {manifest.name} is not the one that HEAD.json points to")
    for name, entry in _read_json(manifest)["files"].items():
        path = group / name
        if not path.is_file():
            raise StoreError(f"{where} is damaged: {name} is missing")
        if path.stat().st_size != entry["size"]:
            raise StoreError(f"{where} is damaged: {name} has {path.stat().st_size} bytes, not {entry['size']}")
        if (contents or path.name == "zarr.json") and hashlib.sha256(path.read_bytes()).hexdigest() != entry["sha256"]:
            raise StoreError(f"{where} is damaged: the content of {name} changed")


def _move_in(staged: Path, material: Path) -> str:
    """Rename a staged group to the next free revision of a material."""
    material.mkdir(parents=True, exist_ok=True)
    while True:
        taken = [int(path.name[1:]) for path in material.glob("r[0-9]*") if path.is_dir()]
        revision = f"r{max(taken, default=0) + 1:06d}"
        try:
            staged.rename(material / revision)
        except OSError:
            if not (material / revision).exists():
                raise
            continue  # another build took the number first
        return revision


def _read_json(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise StoreError(f"cannot read {path}: {error}") from error
    if not isinstance(content, dict):
        raise StoreError(f"cannot read {path}: not a JSON object")
    return content


def _write_json(path: Path, content: dict[str, Any]) -> str:
    """Write a JSON file, synced to disk, and return its sha256."""
    data = json.dumps(content, indent=1).encode()
    with path.open("wb") as handle:
        handle.write(data)
        handle.flush()
        os.fsync(handle.fileno())
    return hashlib.sha256(data).hexdigest()


def _swap_json(path: Path, content: dict[str, Any]) -> None:
    """Write a file so that a reader sees the old content or the new, whatever happens in between."""
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    try:
        _write_json(temporary, content)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    directory = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(directory)
    finally:
        os.close(directory)
