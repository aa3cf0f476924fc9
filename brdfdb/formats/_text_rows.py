"""Rows of texts: their numbers, and comments between them after which rows mean something else."""

from __future__ import annotations

import itertools
import re
from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._columns import Layout, angle_unit, comment_of, fields_of, header_of, number_of
from brdfdb.formats._record import of_comments
from brdfdb.formats._text_end import check_last_number, has_open_end
from brdfdb.formats._text_file import lines_of

_ANGLE_UNIT = re.compile(r"(?<![\d.])(?<![\d.] )\b(?:degrees?|deg|m?rad|(?:milli)?radians?)\b", re.IGNORECASE)
_SHOWN = 200  # characters of a comment that a sentence repeats
_SPLIT = "write a file for each"


def rows_of(path: Path, layout: Layout, *, one_wavelength: bool) -> NDArray[np.float64]:
    """Return the numbers of a text from its first row on, shape (N, columns).

    Parameters
    ----------
    path : path
        The file.
    layout : Layout
        Its layout.
    one_wavelength : bool
        True if all rows have the wavelength of the titles: a comment with another one is refused.

    Raises
    ------
    FileFormatError
        If a row is damaged, stands below a comment with other columns, another unit of angles or another wavelength, or
        the file was cut within its last number.
    """
    numbers, count = array("d"), len(layout.names)
    decimals = ""  # the sign before decimals: a comma beside points may be that of thousands
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
            raise FileFormatError(f"{path}: line {line_number} has {len(fields)} fields, and the first row {count}")
        for field, name in zip(fields, layout.names, strict=True):
            number = number_of(field)
            if number is None or number in (np.inf, -np.inf):
                raise FileFormatError(f"{path}: line {line_number}, field {name}: {field[:40]!r} is not a number")
            sign = "," if "," in field else "." if "." in field else decimals
            if decimals not in ("", sign):
                where = f"line {line_number}, field {name}"
                raise FileFormatError(
                    f"{path}: {where}: {field[:40]!r} has {sign!r}, and numbers before it {decimals!r}"
                )
            decimals = sign
            numbers.append(number)
    if has_open_end(path):
        rows = ((number, line) for number, line in _from_first(path, layout) if not _is_comment(line))
        check_last_number(path, ((number, fields_of(line, layout.delimiter)[-1]) for number, line in rows))
    return np.frombuffer(numbers, dtype=np.float64).reshape(-1, count)


def line_of_row(path: Path, layout: Layout, row: int) -> int:
    """Return the number of the line that has a row, whose number counts from 0."""
    rows = (number for number, line in _from_first(path, layout) if not _is_comment(line))
    return next(itertools.islice(rows, row, None))


def _from_first(path: Path, layout: Layout) -> Iterator[tuple[int, str]]:
    """Yield the lines from the first row on, with their numbers, without empty ones."""
    return ((number, line) for number, line in lines_of(path) if number >= layout.first and line.strip())


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(("#", "%"))


def _other_rows(text: str, number: int, layout: Layout, *, one_wavelength: bool) -> str:
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
        at, before = (of_comments({"titles": some})[1] for some in (text, "\n".join(layout.titles)))
        if at is not None and at != before:
            was = "have none" if before is None else f"have {before:g} nm"
            return f"line {number} gives a wavelength of {at:g} nm, and rows before it {was}; {_SPLIT}"
    return ""


def _unit_of(match: re.Match[str]) -> str:
    """Return the unit of angles, as of `angle_unit`, in a match of its words."""
    return angle_unit(f"[{match[0]}]")
