"""Ends of texts: a last line without an end may be one of a file that was cut."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._record import note

_NUMBER = re.compile(r"[-+]?\d*(?:[.,](?P<decimals>\d*))?(?P<exponent>[eEdD][-+]?\d*)?")
_SAME_DEG = 1e-6  # directions closer than this are one


def has_open_end(path: Path) -> bool:
    """Return True if the last line of a text has no end."""
    with path.open("rb") as file:
        file.seek(max(path.stat().st_size - 4, 0))
        return not file.read().rstrip(b"\0").endswith((b"\n", b"\r"))


def check_last_number(path: Path, fields: Iterable[tuple[int, str]]) -> None:
    """Refuse a text that was cut within its last number.

    Parameters
    ----------
    path : path
        A text whose last line has no end.
    fields : iterable of (int, str)
        The last field of each row, with the number of its line.

    Raises
    ------
    FileFormatError
        If the last one has fewer digits behind the decimal point and in the exponent than all before it.
    """
    last, fewest = (0, ""), np.inf
    for field in fields:
        fewest = min(fewest, _digits(last[1])) if last[1] else fewest
        last = field
    if fewest < np.inf and _digits(last[1]) < fewest:
        text = f"{last[1]!r} has fewer decimals than all numbers above it, and the line has no end"
        raise FileFormatError(
            f"{path}: line {last[0]}: {text}: the file was cut within it; remove the line, or fetch the file again"
        )


def doubt_end(path: Path, lights_deg: NDArray[np.float64], record: dict[str, Any]) -> None:
    """Note that a text may have been cut: its last line has no end, and its last light has the fewest viewers.

    Parameters
    ----------
    path : path
        A text.
    lights_deg : array (N, 2) [degree]
        Direction of the light of each row, in the order of the file.
    record : dict
        Record of the samples.
    """
    number, counts = np.unique(np.rint(lights_deg / _SAME_DEG), axis=0, return_inverse=True, return_counts=True)[1:]
    number = number.reshape(-1)
    others = np.delete(counts, number[-1])
    other_rows = np.flatnonzero(number != number[-1])
    if not others.size or counts[number[-1]] >= others.min() or not has_open_end(path):
        return
    if counts[number[-1]] != len(number) - 1 - other_rows[-1]:
        return  # the rows of this light are not one block at the end
    seen = f"{others.min()}" if others.min() == others.max() else f"{others.min()} to {others.max()}"
    text = f"its last line has no end, and its last light has {counts[number[-1]]} rows where others have {seen}"
    note(record, f"Cut? {text[0].upper()}{text[1:]}: rows may be missing, and digits of the last number.")


def _digits(text: str) -> int:
    """Return the number of digits behind the decimal point of a number, and of characters of its exponent."""
    match = _NUMBER.fullmatch(text.strip())
    return 0 if match is None else len(match["decimals"] or "") + len(match["exponent"] or "")
