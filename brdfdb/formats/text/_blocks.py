"""Lines that give a number or a word to all rows below them, such as ``AOI = 30`` or ``# Sample: A``."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import NamedTuple

from brdfdb.formats.text._columns import ANGLES, role_of
from brdfdb.formats.text._fields import TextLine, fields_of, number_of

_NUMBER = r"(?P<number>(?>[-+\u2212]?(?:\d+(?:[.,]\d+)?|[.,]\d+)(?:[eE][-+]?\d+)?))(?![\d.:/-])"
_NO_UNIT = r"(?!(?:to|and|or|bis|et|und|a|in|at|with|for)\b)"
_UNIT = rf"(?:\s*(?P<unit>\u00b0|\u00ba|{_NO_UNIT}[A-Za-z\u00b5\u03bc]+\b\.?(?!\s*[:=])))?+"
_NO_LIST = r"(?!\s*(?:[,;/]|to\b|bis\b|and\b|-|\u2013|\.\.+)?\s*[-+\u2212]?\d)"  # of numbers, or a range
_KEY = r"(?P<key>[^\W\d_][^=:;,\t\[\]()]*?)\s*(?:[\[(](?P<of>[^\])]*)[\])])?"
_PAIR = re.compile(_KEY + r"\s*[=:]\s*" + _NUMBER + _UNIT + _NO_LIST)
_ALONE = re.compile(r"\s*" + _KEY + r"[\s,;]+" + _NUMBER + r"[\s;,]*" + _UNIT + r"[\s,;]*")
_NEXT = re.compile(r"\s*(?P<key>[^\W\d]\w*(?: \w+){0,2}?)(?P<of>)\s+" + _NUMBER + _UNIT + r"(?:[\s,;]+|$)")
_WORDS = re.compile(
    r"\s*(?P<key>(?:sample|specimen|coupon|probe|muster)(?=\s+\S+[\s,;]*$)|[^\W\d_][\w .-]{0,40}?(?=\s*[:=]))"
    r"[\s:=]*(?P<word>\S.*?)[\s,;]*",
    re.IGNORECASE,
)
_MOST_WORDS = 4  # of the name of an angle in a sentence
_LONGEST = 200  # characters of a line that may give a number


class Assigned(NamedTuple):
    """A number, or a word, of all rows below a line.

    `role` is that of a column, or the name of a column that has none, in lower case. `name` has the unit in brackets.
    """

    role: str
    name: str
    number: float | None
    word: str
    line: int

    @property
    def value(self) -> float | str:
        """The number, or the word if it is none."""
        return self.word if self.number is None or self.number != self.number else self.number


@lru_cache(maxsize=4096)  # of lines above rows, which are looked at for each line below
def assigned_in(line: TextLine) -> tuple[Assigned, ...]:
    """Return the angles and the wavelength that a line gives to rows, each with its name and unit."""
    text = line.text.strip()
    if len(text) > _LONGEST or not text:
        return ()
    alone = _ALONE.fullmatch(text)
    matches = list(_NEXT.finditer(text))
    if sum(len(match[0]) for match in matches) != len(text) or not all(_key(match["key"]) for match in matches):
        matches = [alone] if alone and _key(alone["key"]) else list(_PAIR.finditer(text))
    assigned = []
    for match in matches:
        if name := _key(match["key"]):
            word, unit = match["number"], match["of"] or match["unit"]
            described = f"{name} [{unit}]" if unit else name
            assigned.append(Assigned(role_of(name), described, number_of(word), word, line.number))
    return tuple(assigned)


def given_by(line: TextLine, delimiter: str | None) -> dict[str, Assigned]:
    """Return what a line gives to rows, by role: angles, a wavelength, or the word of another name, ``Sample: A``."""
    text = line.text
    match = _WORDS.fullmatch(text) if len(text) <= _LONGEST else None
    pair = [match["key"], match["word"]] if match else []
    assigned = assigned_in(line)
    if not (match or assigned or line.comment or delimiter is None):
        pair = [field for field in fields_of(text, delimiter) if field]
        if len(pair) != 2 or number_of(pair[0]) is not None:
            pair = []
    given = {}
    if pair and not _key(re.sub(r"[\[(].*", "", pair[0])):
        given[pair[0].lower()] = Assigned(pair[0].lower(), pair[0], number_of(pair[1]), pair[1], line.number)
    return given | {each.role: each for each in assigned}


def _key(text: str) -> str:
    """Return the name of an angle or a wavelength with which a text ends; "" if it does not."""
    words = text.split()
    for start in range(max(0, len(words) - _MOST_WORDS), len(words)):
        name = " ".join(words[start:])
        if role_of(name) in (*ANGLES, "wavelength"):
            return name
    return ""
