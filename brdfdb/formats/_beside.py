"""The record of a file that has no place for text: JSON in a file beside it, with .json after its name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from brdfdb.formats._record import document_of

_LARGEST = 1 << 20  # byte of a record


def beside(path: Path) -> Path:
    """Return the path of the record that goes with a file."""
    return path.with_name(f"{path.name}.json")


def record_beside(path: Path) -> dict[str, Any]:
    """Return the record beside a file; empty if there is none, or it is not one."""
    there = beside(path)
    try:
        if not there.is_file() or there.stat().st_size > _LARGEST:
            return {}
        return document_of(there.read_bytes())
    except OSError:
        return {}
