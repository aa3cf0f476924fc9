"""JSON files of tables: parsing without surprises, angles as others round them, and the record as text."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._text_file import check_text

MOST_BYTES = 40_000_000  # size of a file that is written, about
_MOST_READ = 1 << 29  # of a file that is read
_DECIMALS = 4  # of angles [degree]: radians in files have six


def parsed(path: Path) -> dict[str, Any]:
    """Return the object in a JSON file; FileFormatError if it holds none, or more than 512 MiB."""
    check_text(path, _MOST_READ)
    try:
        document = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{path}: it is no JSON, or is damaged ({error})") from error
    if not isinstance(document, dict):
        raise FileFormatError(f"{path}: it holds no object")
    return document


def column(path: Path, name: str, values: Any, *, holes: bool = False) -> NDArray[np.float64]:
    """Return a list of numbers, with nan for null if it may have holes; FileFormatError if it holds anything else."""
    try:
        numbers = np.array(values, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        numbers = np.empty((0, 0))
    if numbers.ndim != 1 or not numbers.size or np.any(np.isinf(numbers) | (np.isnan(numbers) & ~holes)):
        raise FileFormatError(f"{path}: {name} is not a list of numbers")
    return numbers


def degrees_of(values: NDArray[np.float64], unit: str) -> NDArray[np.float64]:
    """Return angles [degree] to four decimals; `unit` is "rad" or another word for degrees."""
    return np.round(np.rad2deg(values) if unit == "rad" else values, _DECIMALS)


def title_of(known: Mapping[str, Any]) -> str:
    """Return what a record says of a file, its error and the audit, in one line."""
    error = known["error_of_file"]["p99"]
    text = f"{known['title'] or known['name']}; model {known['model']}; {known['holds']}; audit: {known['audit']}; "
    return text + f"99 of 100 values are within {error:.3g} of the table, relative, with linear interpolation"
