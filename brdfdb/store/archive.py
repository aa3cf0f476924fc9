"""Files of a folder as one zip archive, and all current revisions as one zarr group."""

from __future__ import annotations

import contextlib
import json
import tempfile
import zipfile
from collections.abc import Iterable, Iterator
from typing import Any

from pydantic import BaseModel

from brdfdb.errors import StoreError, UnknownMaterialError
from brdfdb.store.edition.reader import Edition
from brdfdb.store.paths import METADATA, pinned
from brdfdb.store.reader import Store

ZIP = "application/zip"

_PIECE = 1 << 20


class Group(BaseModel):
    """A zarr group (version 3) with the metadata of all groups and arrays in it."""

    zarr_format: int
    node_type: str
    attributes: dict[str, Any]
    consolidated_metadata: dict[str, Any]


def zipped(contents: Iterable[tuple[str, bytes]], compression: int = zipfile.ZIP_DEFLATED) -> Iterator[bytes]:
    """Yield named contents as a zip archive in pieces, from a temporary file: memory holds one content at a time."""
    with tempfile.TemporaryFile() as file:
        with zipfile.ZipFile(file, "w") as archive:
            for name, content in contents:
                archive.writestr(zipfile.ZipInfo(name), content, compression)  # without the time: the same bytes again
        file.seek(0)
        while piece := file.read(_PIECE):
            yield piece


def root_group(store: Store | Edition) -> dict[str, Any]:
    """Return the fields of `Group`: all current revisions as materials/NAME/REVISION-DIGEST, without damaged ones."""
    metadata: dict[str, Any] = {"materials": _group()}
    for name in store:
        with contextlib.suppress(StoreError, UnknownMaterialError):
            stored = store.revision(name)
            metadata_of_group = json.loads(stored.read(METADATA))
            arrays = metadata_of_group.pop("consolidated_metadata", {}).get("metadata", {})
            revision = pinned(stored.number, stored.digest)
            place = f"materials/{name}/{revision}"
            metadata |= {f"materials/{name}": _group(revision=revision), place: metadata_of_group}
            metadata |= {f"{place}/{key}": array for key, array in arrays.items()}
    consolidated = {"kind": "inline", "must_understand": False, "metadata": metadata}
    return {**_group(), "consolidated_metadata": consolidated}


def _group(**attributes: Any) -> dict[str, Any]:
    return {"zarr_format": 3, "node_type": "group", "attributes": attributes}
