"""Rows of texts: their numbers, and comments between them after which rows mean something else."""

from __future__ import annotations

import itertools
import re
from array import array
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._input import lines_of
from brdfdb.formats._record import note, of_comments
from brdfdb.formats.text._columns import TextLayout, angle_unit, comment_of, fields_of, header_of, number_of

_ANGLE_UNIT = re.compile(r"(?<![\d.])(?<![\d.] )\b(?:degrees?|deg|m?rad|(?:milli)?radians?)\b", re.IGNORECASE)
_SHOWN = 200  # characters of a comment that a sentence repeats
_SPLIT = "write a file for each"
_NUMBER = re.compile(r"[-+]?\d*(?:[.,](?P<decimals>\d*))?(?P<exponent>[eEdD][-+]?\d*)?")
_SAME_DEG = 1e-6  # directions closer than this are one


def rows_of(path: Path, layout: TextLayout, *, one_wavelength: bool) -> NDArray[np.float64]:
    """Return the numbers of a text from its first row on, shape (N, columns).

    If all rows have the wavelength of the titles, `one_wavelength`, a comment with another wavelength is refused.
    FileFormatError if a row is damaged, stands below a comment with other columns, another unit of angles or another
    wavelength, or the file was cut within its last number.
    """
    numbers = array("d")
    count = len(layout.names)
    decimals = ""  # the sign before decimals: a comma in a file with points may separate thousands
    other = ""  # a sentence on the last comments: rows below them are not as those above
    for line_number, line in _from_first(path, layout):
        if _is_comment(line):
            text = comment_of(line)
            other = other or _other_rows(text, line_number, layout, one_wavelength=one_wavelength)
            continue
        if other:
            raise FileFormatError(f"{path}: {other}")
        fields = fields_of(line, layout.delimiter)
        fields = fields[:count] if len(fields) == count + 1 and not fields[-1] else fields
        if len(fields) != count:
            raise FileFormatError(f"{path}: line {line_number} has {len(fields)} fields, but the first row has {count}")
        for field, name in zip(fields, layout.names, strict=True):
            number = number_of(field)
            if number is None or number in (np.inf, -np.inf):
                raise FileFormatError(f"{path}: line {line_number}, field {name}: {field[:40]!r} is not a number")
            sign = "," if "," in field else "." if "." in field else decimals
            if decimals not in ("", sign):
                where = f"line {line_number}, field {name}"
                raise FileFormatError(
                    f"{path}: {where}: {field[:40]!r} has {sign!r} where numbers above it have {decimals!r}"
                )
            decimals = sign
            numbers.append(number)
    if has_open_end(path):
        rows = ((number, line) for number, line in _from_first(path, layout) if not _is_comment(line))
        check_last_number(path, ((number, fields_of(line, layout.delimiter)[-1]) for number, line in rows))
    return np.frombuffer(numbers, dtype=np.float64).reshape(-1, count)


def line_of_row(path: Path, layout: TextLayout, row: int) -> int:
    """Return the number of the line that has a row, whose number counts from 0."""
    rows = (number for number, line in _from_first(path, layout) if not _is_comment(line))
    return next(itertools.islice(rows, row, None))


def _from_first(path: Path, layout: TextLayout) -> Iterator[tuple[int, str]]:
    """Yield the lines from the first row on, with their numbers, without empty ones."""
    return ((number, line) for number, line in lines_of(path) if number >= layout.first and line.strip())


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(("#", "%"))


def _other_rows(text: str, number: int, layout: TextLayout, *, one_wavelength: bool) -> str:
    """Return a sentence on a comment between rows that gives them other columns or units; empty if it does not."""
    names = header_of(text, layout)
    if names and names != layout.names:
        return f"line {number} names other columns than line {layout.line}: {', '.join(names)[:_SHOWN]}; {_SPLIT}"
    units = {unit for name in layout.described if (unit := angle_unit(name))}
    units |= {_unit_of(match) for title in layout.titles for match in _ANGLE_UNIT.finditer(title)}
    new = {_unit_of(match) for match in _ANGLE_UNIT.finditer(text)}
    if new and new != (units or {"deg"}):
        return f"line {number} gives angles another unit: {text.strip()[:_SHOWN]!r}; {_SPLIT}"
    if one_wavelength:
        at, before = (of_comments({"titles": titles})[1] for titles in (text, "\n".join(layout.titles)))
        if at is not None and at != before:
            was = "have none" if before is None else f"have {before:g} nm"
            return f"line {number} gives a wavelength of {at:g} nm, but rows above it {was}; {_SPLIT}"
    return ""


def _unit_of(match: re.Match[str]) -> str:
    """Return the unit of angles, as of `angle_unit`, in a match of its words."""
    return angle_unit(f"[{match[0]}]")


def has_open_end(path: Path) -> bool:
    """Return True if the last line of a text has no end."""
    with path.open("rb") as file:
        file.seek(max(path.stat().st_size - 4, 0))
        return not file.read().rstrip(b"\0").endswith((b"\n", b"\r"))


def check_last_number(path: Path, fields: Iterable[tuple[int, str]]) -> None:
    """Refuse a text without an end of its last line, of which the last number was cut.

    It was cut if it has fewer digits behind the decimal point and in the exponent than the last fields of all rows
    before it; `fields` are these, with the numbers of their lines.
    """
    last = (0, "")
    fewest = np.inf
    for field in fields:
        fewest = min(fewest, _digits(last[1])) if last[1] else fewest
        last = field
    if fewest < np.inf and _digits(last[1]) < fewest:
        text = f"{last[1]!r} has fewer decimals than all numbers above it, and the line has no end"
        raise FileFormatError(
            f"{path}: line {last[0]}: {text}: the file was cut within it; remove the line, or download the file again"
        )


def doubt_end(path: Path, lights_deg: NDArray[np.float64], record: dict[str, Any]) -> None:
    """Note that a text may have been cut: its last line has no end, and its last light has the fewest viewers.

    `lights_deg` (N, 2) [degree] are the directions of the light of all rows, in the order of the file.
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
