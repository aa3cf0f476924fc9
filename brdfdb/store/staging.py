"""Staging: a table while it is being written, so that a build killed at any moment goes on where it was.

ROOT/.staging/NAME/lock              held by the build at work on the material: one at a time
ROOT/.staging/NAME/KEY/              one request, by the first digits of its digest
ROOT/.staging/NAME/KEY/request.json  what was asked for
ROOT/.staging/NAME/KEY/layout.json   what the table is going to be
ROOT/.staging/NAME/KEY/table/        the zarr group, growing
ROOT/.staging/NAME/KEY/blocks/       a marker for each block that is whole: size, sha256, and of which layout

Blocks are computed and written by `write_block`, the rest of the table by `write_frame`: functions of plain arguments,
for threads, processes and other machines alike that see the same file system. Whoever holds the lock publishes.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import BusyError, ParameterError, StoreError
from brdfdb.store.manifest import (
    NAME,
    Entry,
    Head,
    Manifest,
    Summary,
    check_manifest,
    manifest_of,
    number_of,
    read_head,
    read_manifest,
    read_sealed,
    sealed,
    sha256_of,
    swap_sealed,
    sync_directory,
    whole_revisions,
    write_file,
    write_json,
    write_sealed,
)
from brdfdb.store.reader import FORMAT, FORMAT_VERSION, DamagedMarkerError, Store, read_metadata
from brdfdb.tables import tabulation
from brdfdb.tables.layout import Layout, digest
from brdfdb.tables.stated_error import Error

if TYPE_CHECKING:
    import xarray as xr


class Block(TypedDict):
    """A block that is whole: its file inside the group, and whether an earlier build had written it."""

    name: str
    entry: Entry
    kept: bool


def make_store(root: Path) -> bool:
    """Make a store, or see that there is one; return whether it was made.

    A brdfdb.json that is missing or damaged beside tables of this version is written anew.

    Raises
    ------
    StoreError
        If `root` cannot be written, or is something other than a store.
    """
    marker, made = root / "brdfdb.json", False
    try:
        root.mkdir(parents=True, exist_ok=True)
        strangers = [path for path in root.iterdir() if not path.name.startswith(f".{marker.name}.")]
        if marker.exists():  # asked after the look around: another build may be making the store right now
            try:
                Store(root)
            except DamagedMarkerError:
                if not _has_tables(root):
                    raise
                made = True
        elif strangers and not _has_tables(root):
            raise StoreError(f"{root} is not empty and not a store; name an empty or a new directory")
        else:
            made = True
        if made:
            swap_sealed(marker, {"format": FORMAT, "version": FORMAT_VERSION})
        (root / "materials").mkdir(exist_ok=True)
        (root / ".staging").mkdir(exist_ok=True)
        if made:
            sync_directory(root)
    except OSError as error:
        raise StoreError(f"cannot write a store at {root}: {error.strerror or error}") from error
    return made and not strangers


def _has_tables(root: Path) -> bool:
    """Return whether a revision in `root` has a manifest of this version."""
    for path in root.glob("materials/*/r*.MANIFEST.json"):
        with suppress(StoreError):
            read_sealed(path, path.parent.name)
            return True
    return False


def remove_begun(root: Path) -> None:
    """Remove a store in which nothing was built: plans and empty directories; anything else makes it stay."""
    if any(root.glob(".staging/*/*/blocks/*")) or any(root.glob("materials/*")):
        return
    with suppress(OSError, BusyError, StoreError):
        for staged in list((root / ".staging").iterdir()):
            with Lock(root, staged.name, wait=False):
                for path in staged.iterdir():
                    if path.is_dir():
                        shutil.rmtree(path)
        (root / "materials").rmdir()
        (root / ".staging").rmdir()
        (root / "brdfdb.json").unlink()
        root.rmdir()


@contextmanager
def writing(root: Path, name: str) -> Iterator[None]:
    """Turns what the file system says into one sentence."""
    try:
        yield
    except OSError as error:
        raise StoreError(f"cannot write {name} to the store at {root}: {error.strerror or error}") from error


class Lock:
    """The right to change a material: a context manager; others see it with `held_elsewhere`.

    Parameters
    ----------
    root : Path
        Directory of the store.
    name : str
        Of the material.
    wait : bool
        Whether to wait for another holder; without, `BusyError` is raised.

    Raises
    ------
    BusyError
        If another process, or another thread of this one, holds it.
    """

    def __init__(self, root: Path, name: str, *, wait: bool = True) -> None:
        self.path = root / ".staging" / name / "lock"
        self.root, self.name, self.wait = root, name, wait
        self._handle: IO[bytes] | None = None

    def __enter__(self) -> Lock:
        with writing(self.root, self.name):
            (self.root / ".staging").mkdir(exist_ok=True)
            while self._handle is None:
                self._handle = self._acquired()
        return self

    def _acquired(self) -> IO[bytes] | None:
        """The locked file; None if its holder took it away in the meantime."""
        try:
            self.path.parent.mkdir(exist_ok=True)
            handle = self.path.open("ab")
        except (FileNotFoundError, FileExistsError):  # its holder took the directory away, maybe between two calls
            if self.path.parent.is_file():  # one look: between two the directory may go
                raise
            return None
        try:
            fcntl.flock(handle, fcntl.LOCK_EX if self.wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.fstat(handle.fileno()).st_ino == self.path.stat().st_ino:
                return handle
        except BlockingIOError:
            handle.close()
            raise BusyError(f"another build is at work on {self.name}") from None
        except FileNotFoundError:
            pass
        except BaseException:
            handle.close()
            raise
        handle.close()
        return None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Give it back, and take the directory away if nothing is left in it."""
        assert self._handle is not None
        try:
            if os.listdir(self.path.parent) == ["lock"]:
                self.path.unlink()
                self.path.parent.rmdir()
        except OSError:  # another build has come in: it is theirs
            pass
        fcntl.flock(self._handle, fcntl.LOCK_UN)  # closing is not enough where a child was forked meanwhile
        self._handle.close()
        self._handle = None


def directory_of(root: Path, name: str, request_sha256: str) -> Path:
    """Where a request is staged."""
    return root / ".staging" / name / request_sha256[:16]


def prepare(root: Path, name: str, request: Mapping[str, Any], layout: str) -> Path:
    """Make the staging directory of a request, with its layout as JSON, and return it."""
    staging = directory_of(root, name, digest(request))
    with writing(root, name):
        (staging / "blocks").mkdir(parents=True, exist_ok=True)
        texts = sealed(dict(request)), sealed(json.loads(layout))
        for file, text in zip(("request.json", "layout.json"), texts, strict=True):
            if not (staging / file).is_file() or (staging / file).read_bytes() != text:
                write_file(staging / file, text, staging)
    return staging


def discard(root: Path, name: str, request: Mapping[str, Any]) -> None:
    """Remove what is staged of a request; the lock must be held."""
    shutil.rmtree(directory_of(root, name, digest(request)), ignore_errors=True)


def planned(root: Path, name: str, request: Mapping[str, Any]) -> str | None:
    """The layout that an earlier build of the same request left in the staging directory, as JSON; None without."""
    staging = directory_of(root, name, digest(request))
    try:
        if read_sealed(staging / "request.json", name) != json.loads(json.dumps(request)):
            return None
        text = json.dumps(read_sealed(staging / "layout.json", name))
        _layout(text)
    except (OSError, StoreError, ValueError, KeyError):
        return None
    return text


@lru_cache(maxsize=64)
def _layout(text: str) -> Layout:
    """A layout from JSON, kept: a worker gets many blocks of one.

    Raises
    ------
    StoreError
        If this program would compute something else than the program that wrote the JSON.
    """
    document = json.loads(text)
    layout = Layout.from_document(document)
    if json.loads(json.dumps(layout.document())) != document:
        raise StoreError(f"{layout.source.name}: the table was laid out by another version of this program")
    return layout


def write_block(staging: str, layout: str, number: int) -> Block:
    """Compute a block and write it, unless it is there already: the task that a build gives to its workers.

    Parameters
    ----------
    staging : str
        The staging directory, on a file system that builder and worker share.
    layout : str
        Of the table, as JSON.
    number : int
        Of the block.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    from brdfdb.store.codec import chunk_name, encoded

    directory = Path(staging)
    table = _layout(layout)
    name = chunk_name(table, number)
    path = directory / "table" / name
    marker = directory / "blocks" / f"{number:06d}.json"
    if (entry := _kept(marker, path, layout)) is not None:
        return {"name": name, "entry": entry, "kept": True}
    data = encoded(table, number, tabulation.block(table, table.blocks[number]))
    with writing(directory.parent.parent.parent, table.source.name):
        entry = write_file(path, data, directory)
        write_json(marker, {**entry, "layout": _short(layout)}, directory)
    return {"name": name, "entry": entry, "kept": False}


def _short(layout: str) -> str:
    return digest({"layout": layout})[:16]


def _kept(marker: Path, path: Path, layout: str) -> Entry | None:
    """What a marker says of a block, if the block is what the marker says."""
    try:
        found = json.loads(marker.read_bytes())
        entry: Entry = {"size": found["size"], "sha256": found["sha256"]}
        whole = (
            found["layout"] == _short(layout)
            and path.stat().st_size == entry["size"]
            and sha256_of(path) == entry["sha256"]
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return entry if whole else None


def write_frame(staging: str, layout: str) -> dict[str, Entry]:
    """Write all of a table but its blocks, which are there: the last task of a table; returns the files it wrote.

    Raises
    ------
    StoreError
        If they cannot be written.
    """
    from brdfdb.store.codec import array_metadata, frame_files

    directory = Path(staging)
    table = _layout(layout)
    request = read_sealed(directory / "request.json", table.source.name)
    with writing(directory.parent.parent.parent, table.source.name):
        write_file(directory / "table" / table.variable / "zarr.json", array_metadata(table), directory)
    measured = {"request": request, "request_sha256": digest(request), "error": _measured(table, directory / "table")}
    metadata = tabulation.metadata_of(table).model_copy(update=measured)
    frame = tabulation.frame(table).assign_attrs(metadata.attributes())
    with writing(directory.parent.parent.parent, table.source.name):
        return {
            name: write_file(directory / "table" / name, data, directory)
            for name, data in frame_files(table, frame).items()
        }


def _measured(layout: Layout, table: Path) -> Error:
    """Return the error of a table against its model, from the finished blocks in the group `table`."""
    from brdfdb.store.codec import chunk_name, decoded
    from brdfdb.tables.error_measurement import measure

    @lru_cache(maxsize=4)
    def block(number: int) -> NDArray[np.float32]:
        return decoded(layout, number, (table / chunk_name(layout, number)).read_bytes())

    def read(rows: slice) -> NDArray[np.float32]:
        first, last = rows.start // layout.block_rows, (rows.stop - 1) // layout.block_rows
        start = first * layout.block_rows
        blocks = np.concatenate([block(number) for number in range(first, last + 1)])
        return blocks[rows.start - start : rows.stop - start]

    return measure(layout, read)


def publish(root: Path, name: str, staging: Path, files: Mapping[str, Entry]) -> tuple[str, int]:
    """Make a staged table the current revision of its material; the lock must be held. Returns revision and bytes.

    Until the pointer is swapped, as the last step, readers see the revision before. After a crash in between, the
    revision lies whole in its place and the next build of the request makes it current.

    Parameters
    ----------
    files : mapping
        Every file of the group, by its path inside: what else lies there is removed.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    material = root / "materials" / name
    table = staging / "table"
    with writing(root, name):
        for path in table.rglob("*"):
            if path.is_file() and path.relative_to(table).as_posix() not in files:
                path.unlink()
        metadata = read_metadata(table)
        stored = sum(entry["size"] for entry in files.values())
        summary: Summary = {
            "title": metadata.title or "",
            "model": metadata.model or "",
            "model_version": metadata.model_version or 0,
            "request_sha256": metadata.request_sha256 or "",
            "error_p99": None if metadata.error is None else metadata.error.overall.p99,
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "bytes": stored,
        }
        for directory, _, _ in os.walk(table, topdown=False):
            sync_directory(Path(directory))
        material.mkdir(exist_ok=True)
        sync_directory(material.parent)
        revision = f"r{newest(material) + 1:06d}"
        manifest: Manifest = {"material": name, "revision": revision, "summary": summary, "files": dict(files)}
        write_sealed(manifest_of(material / revision), manifest, staging)
        table.rename(material / revision)
        sync_directory(material)
        point_to(material, revision)
        shutil.rmtree(staging, ignore_errors=True)
    return revision, stored


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
    swap_sealed(material / "HEAD.json", head)


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
    numbers = (number_of(name.removesuffix(".MANIFEST.json")) for name in os.listdir(material))
    return max(last, *numbers, 0)


def publish_dataset(root: str | os.PathLike[str], name: str, dataset: xr.Dataset) -> tuple[str, int]:
    """Publish a table that is in memory, whoever computed it, as the next revision of a material.

    Parameters
    ----------
    root : path
        Directory of the store; made if it does not exist.
    name : str
        Of the material.
    dataset : Dataset
        As `tabulate.tabulate` makes it.

    Returns
    -------
    revision, bytes
        Such as ``r000003``, and how much it takes.

    Raises
    ------
    StoreError
        If the store cannot be written.
    ValueError
        If the name is none of a material: it would never be found again.
    """
    from brdfdb.store.codec import dataset_files

    if not NAME.fullmatch(name):
        raise ParameterError("name", f"{name!r} is not made of lower-case letters, digits and single hyphens", name)
    store = Path(root)
    make_store(store)
    files = dataset_files(dataset)
    with Lock(store, name):
        staging = store / ".staging" / name / "dataset"
        with writing(store, name):
            shutil.rmtree(staging, ignore_errors=True)
            try:
                staging.mkdir()
                written = {file: write_file(staging / "table" / file, data, staging) for file, data in files.items()}
                return publish(store, name, staging, written)
            finally:
                shutil.rmtree(staging, ignore_errors=True)


def adoptable(root: Path, name: str, request_sha256: str) -> str | None:
    """Return the newest revision of a material that answers a request and is undamaged; None without any."""
    material = root / "materials" / name
    known = known_manifests(material)
    for group in reversed(whole_revisions(material)):
        with suppress(StoreError):
            manifest, digest = read_manifest(group, known.get(group.name))
            if manifest["summary"]["request_sha256"] == request_sha256:
                check_manifest(group, digest, contents=True)
                return group.name
    return None
