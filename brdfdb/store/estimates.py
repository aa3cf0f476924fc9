"""Estimates of a simulation in the working folder of a store, so that a killed build can be resumed.

ROOT/.staging/NAME/KEY/request.json          what decides the estimates
ROOT/.staging/NAME/KEY/estimates/000003.npz  arrays of an estimate, and behind them their sha256 in 32 bytes

KEY is the beginning of the digest of the request. `brdfdb.store.revisions.collect` removes folders that no build uses.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.store.files import regular_bytes, sealed, write_file
from brdfdb.store.lock import writing
from brdfdb.store.paths import request_path, store_of_staged
from brdfdb.tables.layout import digest

_DIGEST = hashlib.sha256().digest_size  # bytes


def estimates_path(root: Path, name: str, request: Mapping[str, Any]) -> Path:
    """Return the folder of the estimates of a request."""
    return request_path(root, name, digest(request)) / "estimates"


def begin_estimates(folder: Path, name: str, request: Mapping[str, Any]) -> None:
    """Make the folder of the estimates of a request; the caller holds the lock of the material."""
    with writing(store_of_staged(folder.parent), name):
        folder.mkdir(parents=True, exist_ok=True)
        write_file(folder.parent / "request.json", sealed(dict(request)), folder, sync=False)


def write_estimate(folder: Path, number: int, arrays: Mapping[str, Any]) -> None:
    """Write the arrays of an estimate, so that its file is complete or does not exist."""
    data = io.BytesIO()
    np.savez(data, **arrays)
    with writing(folder, f"estimate {number}"):
        folder.mkdir(parents=True, exist_ok=True)  # another build may have removed it
        content = data.getvalue()
        write_file(_path(folder, number), content + hashlib.sha256(content).digest(), folder, sync=False)


def read_estimate(folder: Path, number: int) -> dict[str, NDArray[Any]] | None:
    """Return the arrays of an estimate; None if it is missing, or any bit of it changed."""
    try:
        data = regular_bytes(_path(folder, number))
    except OSError:
        return None
    content = data[:-_DIGEST]
    if hashlib.sha256(content).digest() != data[-_DIGEST:]:
        return None
    with np.load(io.BytesIO(content)) as arrays:
        return {name: arrays[name] for name in arrays.files}


def _path(folder: Path, number: int) -> Path:
    return folder / f"{number:06d}.npz"
