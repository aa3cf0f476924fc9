"""Fields of lines of texts: delimiters, numbers, words for holes, and signs of comments."""

from __future__ import annotations

import csv
import re
from typing import NamedTuple

SIGNS = ("#", "%", "//", "!", ";")  # of comments
_COMMENT = re.compile(r"^\s*(?:#|%|//|!|;)+\s?")
_HOLES = frozenset(
    (
        *("", "na", "n/a", "n.a.", "#n/a", "#na", "#nv", "#n/v", "null", "none", "nil", "nan", "-nan", "nan(ind)"),
        *("-", "--", "---", "*", "?", "nd", "n.d.", "k.a.", "n/d", "missing", "invalid", "#value!", "#wert!", "#num!"),
        *("#zahl!", "#div/0!", "#ref!", "#bezug!", "#null!", "#valeur!", "#nombre!", "1.#qnan", "-1.#ind", "1.#ind"),
        *("overflow", "ovf", "ovfl", "overrange", "sat", "sat.", "saturated"),
    )
)
_EXPONENT = re.compile(r"(?<=[\d.])[dD](?=[-+]?\d)")  # of Fortran
_REMARK = re.compile(r"\s+(?:#|//|!)(?![A-Z]+[/!?]).*")  # behind the fields of a row
_SPACES = str.maketrans("", "", "\u00a0\u202f\u2009'\u2019")  # that separate thousands
_THOUSANDS = (  # the sign of decimals, and a number with others between thousands
    (".", re.compile(r"[-+]?\d{1,3}(?:,\d{3})+\.\d*(?:[eE][-+]?\d+)?")),
    (",", re.compile(r"[-+]?\d{1,3}(?:\.\d{3})+,\d*(?:[eE][-+]?\d+)?")),
)


class TextLine(NamedTuple):
    """A line before the first row, or between rows: as it is in the file, and without the sign of a comment."""

    number: int
    text: str
    comment: bool
    raw: str

    @classmethod
    def of(cls, number: int, line: str) -> TextLine:
        """Return a line of a file by its number."""
        raw = line.rstrip("\r\n")
        text = _COMMENT.sub("", raw)
        return cls(number, text, text != raw, raw)


def fields_of(line: str, delimiter: str | None) -> list[str]:
    """Return the fields of a line; those in quotation marks may hold the delimiter."""
    line = line.strip("\r\n")
    if "#" in line or "!" in line or "//" in line:
        line = _REMARK.sub("", line) or line
    if delimiter is not None and '"' in line:
        try:
            return [field.strip() for field in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))]
        except csv.Error:  # a field is too long
            pass
    return [field.strip().strip('"') for field in line.split(delimiter)]


def number_of(text: str) -> float | None:
    """Return the number in a field, with a decimal point or comma; nan of a word for a hole; None if it is neither.

    Signs between thousands are left out where the number has decimals, too, or the sign is a kind of space.
    """
    try:
        number = float(text)
    except ValueError:
        pass
    else:
        return number if "_" not in text else None
    if text.lower() in _HOLES:
        return float("nan")
    text = _EXPONENT.sub("e", text.translate(_SPACES).replace("\u2212", "-").rstrip("\u00b0\u00ba "))
    for decimal, pattern in _THOUSANDS:
        if pattern.fullmatch(text):
            text = text.replace("," if decimal == "." else ".", "")
    try:
        return float(text.replace(",", ".")) if "_" not in text else None
    except ValueError:
        return None


def decimal_sign(text: str) -> str:
    """Return the sign before the decimals of a number: the last one of a comma and a point, or ""."""
    return max(",.", key=text.rfind) if "," in text or "." in text else ""
