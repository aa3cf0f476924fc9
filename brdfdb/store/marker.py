"""The marker of a store, ``brdfdb.json``: checked by readers, written by the first build."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path

from brdfdb.errors import (
    StoreError,
)
from brdfdb.place import path_of
from brdfdb.store.files import sync_directory
from brdfdb.store.paths import DIRECTORIES, manifest_path, marker_path, materials_path, staging_path, store_around
from brdfdb.store.sealed_json import read_sealed, swap_sealed, unsealed

FORMAT = "brdfdb"


FORMAT_VERSION = 2  # 1 had no digests in the first lines


class DamagedMarkerError(StoreError):
    """A damaged brdfdb.json: `brdfdb build` writes it again if the directory holds tables."""


def check_marker(root: Path) -> None:
    """Raise StoreError unless there is a store at `root` that this program reads."""
    marker = marker_path(root)
    try:
        data = marker.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        if (around := store_around(root)) is not None:
            raise StoreError(f"{root} lies in the store at {around}; name that directory") from None
        raise StoreError(f"no store at {root}: brdfdb.json is missing there; `brdfdb build` makes one") from None
    except OSError as error:
        raise StoreError(f"cannot read {marker}: {error.strerror}") from error
    try:
        content = unsealed(data, str(root), marker.name)
    except StoreError as damaged:
        if data != json.dumps({"format": FORMAT, "version": 1}, indent=1).encode():  # as version 1 wrote it
            raise DamagedMarkerError(f"{damaged}; `brdfdb build` writes it anew") from None
        content = {"format": FORMAT, "version": 1}
    if (content.get("format"), content.get("version")) != (FORMAT, FORMAT_VERSION):
        raise StoreError(
            f"{marker} says format {content.get('format')} version {content.get('version')}, this program reads "
            f"{FORMAT} version {FORMAT_VERSION}; `brdfdb build --store DIR` builds its recipe in another directory"
        )


def make_store(root: Path) -> bool:
    """Make a store, or see that there is one; return whether it was made.

    A brdfdb.json that is missing or damaged beside tables of this version is written anew.

    Raises
    ------
    StoreError
        If `root` cannot be written, is a directory of a store such as its materials, or is something else.
    """
    marker, made = marker_path(path_of(root, "root")), False
    try:
        around = None if marker.exists() else store_around(root)
        if around is not None and root.resolve().relative_to(around).parts[0] in DIRECTORIES:
            raise StoreError(f"{root} lies in the store at {around}; name that directory, or one outside")
        root.mkdir(parents=True, exist_ok=True)
        strangers = [path for path in root.iterdir() if not path.name.startswith(f".{marker.name}.")]
        if marker.exists():  # asked after the look around: another build may be making the store right now
            try:
                check_marker(root)
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
        materials_path(root).mkdir(exist_ok=True)
        staging_path(root).mkdir(exist_ok=True)
        if made:
            sync_directory(root)
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
