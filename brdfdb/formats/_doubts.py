"""Doubts about texts: rows that are missing or belong to another light, and comments on what the values are."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from brdfdb.errors import FileFormatError, counted
from brdfdb.formats._record import note
from brdfdb.parameters import Floats

_NUMBER = re.compile(r"[-+]?\d*(?:[.,](?P<decimals>\d*))?(?P<exponent>[eEdD][-+]?\d*)?")
_VALUES = r"\b(?:values?|numbers?|data|quantity|BRDF|BSDF|f_?r)\b[^.;]{0,40}?"
_QUANTITIES = {  # in comments, by the option that states them
    "percent": re.compile(rf"(?:{_VALUES}|\bunits?\W{{1,3}})(?:%|\b(?:percent|pct)\b)", re.IGNORECASE),
    "reflectance_factor": re.compile(
        r"(?:\b(?:values?|data|quantity)\b[^.;]{0,40}|^\W*(?:bidirectional )?)\b(?:reflectance factors?|H?C?BRF)\b",
        re.IGNORECASE,
    ),
    "log10": re.compile(
        rf"{_VALUES}\blog(?:10|arithms?)?\b|^\W*log(?:10|arithms?)? (?:of )?(?:the )?BRDF", re.IGNORECASE
    ),
    "f_r_cos": re.compile(
        _VALUES + r"(?:\b(?:times|multiplied|including|with|x)\b|[*\u00d7])[^.;:]{0,20}\bcos", re.IGNORECASE
    ),
}
_TEN = (  # a power of ten that is not 1, and no time, date or length
    r"(?:10 ?(?:\^|\*\*) ?\{?[-+]?\d+\}?|10[\u207a\u207b\u00b2\u00b3\u00b9\u2070-\u2079]+"
    r"|10+|1(?:\.0*)?e[-+]?\d+|0?\.0*1)"
    r"(?![\d.]*\d)(?! ?(?:deg|\u00b0|[nu\u00b5\u03bcmck]?m\b|min|h\b|s\b|[:/-]\d))"
)
_UNIT = rf"(?:\bunits?\b[^.;]{{0,30}}?|{_VALUES}(?:[\[(]|\bin ))\W{{0,3}}"
_FACTOR = re.compile(
    rf"{_VALUES}(?:[*\u00d7]|(?<!\d)[x/]|\b(?:times|in units of)) ?{_TEN}"
    rf"|\b(?:multipl\w*|divided?|scaled?)\b[^.;]{{0,25}}?\bby {_TEN}"
    r"|\bscal(?:ed by|e ?[:=]|(?:e|ing) factor)(?: (?:is|of)| ?[:=])* ?(?!1(?:\.0*)?\b(?! ?[e^]))"
    r"\d[\d.e^-]*(?! ?(?:[:%]|[nu\u00b5\u03bcmck]?m\b))\b"
    rf"|{_UNIT}{_TEN} ?[*x\u00b7\u00d7]? ?(?:1? ?/ ?sr|per sr|sr ?(?:\^|\*\*)? ?\W?[-\u207b])"
    rf"|{_UNIT}(?:ppm|per ?mille?|\u2030|per thousand)(?!\w)"
    r"|(?:/|\bper) ?(?:[mu\u00b5\u03bc]sr|(?:milli|micro)-?steradians?)\b"
    r"|(?<![a-z])(?:[mu\u00b5\u03bc]sr|(?:milli|micro)-?steradians?) ?(?:\^|\*\*)? ?\W?[-\u207b]"
    r"|\b(?:values?|reflectance|BRDF|BSDF|f_?r)\b[^.;]{0,30}?\b(?:relative|normali[sz]ed) to\b",
    re.IGNORECASE,
)
_NO_FACTOR = re.compile(
    r"\b(?:no|not|without|uncertaint\w*|errors?|TIS|noise|floor|limits?|thresholds?|below|above|solid angles?"
    r"|angles? (?:\w+ )?(?:scaled|multiplied|divided))\b|[<>]",
    re.IGNORECASE,
)
_CLOCKWISE = re.compile(r"(?<!counter)(?<!anti)(?<!counter[- ])(?<!anti[- ])\bclockwise\b", re.IGNORECASE)
_OF_TRANSMISSION = re.compile(r"\bBTDF\b(?!.*\b(?:BRDF|reflect))(?<!BRDF)", re.IGNORECASE)
_POLARISED = re.compile(
    r"\b(?:[sp]|TE|TM)[- ]pol(?:ari[sz]ed|ari[sz]ation)?\b|\bpolari[sz]ation(?:_[ir])?\s*[:=]?\s*(?:s|p|TE|TM)\b",
    re.IGNORECASE,
)
_NO = re.compile(r"\b(?:no|not|without|divided|excluding|uncertaint\w*|errors?|TIS)\b", re.IGNORECASE)
_SHOWN = 80  # characters of a comment that a note repeats
OPEN_END = "The last line has no end: digits of its last number are missing if the file was cut there."
_FEWEST = 3  # lights of a file, from which on their numbers of viewers can be compared
_SAME_DEG = 1e-4  # directions closer than this are the same
_ROUNDED_DEG = 1e-3  # of a turn in radians with few digits
_SAME = 1e-6  # relative difference of values that are the same


def has_open_end(path: Path) -> bool:
    """Return True if the last line of a text has no end."""
    with path.open("rb") as file:
        file.seek(max(path.stat().st_size - 4, 0))
        return not file.read().rstrip(b"\0\x1a").endswith((b"\n", b"\r"))


def check_last_number(path: Path, fields: Iterable[tuple[int, str]]) -> None:
    """Refuse a text without an end of its last line, of which the last number was cut.

    It was cut if it has fewer digits behind the decimal point and in the exponent than the last fields of all rows
    before it; `fields`, which are read of such a text alone, are these, with the numbers of their lines.
    """
    if not has_open_end(path):
        return
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


def doubt_last_light(path: Path, lights_deg: Floats, record: dict[str, Any]) -> bool:
    """Note in a record that a text may have been cut, as its last light has another number of rows; True if it has.

    It has fewer than any other light and the last line has no end, or all other lights have the same number. A single
    row without an end, of which the number may have been cut, is noted, too.
    `lights_deg` (N, 2) [degree] are the directions of the light of all rows, in the order of the file.
    """
    starts = np.flatnonzero(np.any(np.diff(lights_deg, axis=0, prepend=np.nan) != 0.0, axis=1))
    *others, last = np.diff(np.append(starts, len(lights_deg))).tolist()
    if not others:
        alone = len(lights_deg) == 1 and has_open_end(path)
        if alone:
            note(record, OPEN_END)
        return alone
    seen = f"{min(others)}" if min(others) == max(others) else f"{min(others)} to {max(others)}"
    text = f"its last light has {last} rows where others have {seen}"
    if last < min(others) and has_open_end(path):
        end = "rows may be missing, and digits of the last number"
        note(record, f"Cut? Its last line has no end, and {text}: {end}.")
        return True
    if len(others) + 1 >= _FEWEST and min(others) == max(others) != last:
        note(record, f"Cut or joined? {text[0].upper()}{text[1:]}.")
        return True
    return False


def doubt_rows(path: Path, angles_deg: Floats, values: Floats, record: dict[str, Any]) -> None:
    """Note in a record that rows of a text without counts may be missing, stand below a wrong light, or be in gon.

    Rows are doubted if `doubt_last_light` says so, if the last line has no end, or if a pair of directions has several
    values. `angles_deg` (N, 4) [degree] are theta_i, phi_i, theta_r, phi_r of the rows in the order of the file,
    `values` (N, C) their values.
    """
    if not doubt_last_light(path, angles_deg[:, :2], record) and has_open_end(path):
        note(record, OPEN_END)
    most = np.ptp(angles_deg, axis=0).max()
    if 360.0 + _ROUNDED_DEG < most <= 400.0 + _ROUNDED_DEG and np.all(np.abs(angles_deg[:, [0, 2]]) <= 100.0):
        text = f"Azimuths span {most:.6g} degrees, more than a turn"
        note(record, f"Angles? {text}: if they are gon, of which a turn has 400, multiply all angles by 0.9.")
    places = np.rint(angles_deg / _SAME_DEG).astype(np.int64)
    places[:, [1, 3]] %= round(360.0 / _SAME_DEG)
    places[:, 3] = np.where(places[:, 2] == 0, 0, places[:, 3])
    _, pair = np.unique(places, axis=0, return_inverse=True)
    last = np.empty(values.shape)
    last[pair.reshape(-1)] = values
    again = last[pair.reshape(-1)]
    differ = np.any(np.abs(again - values) > _SAME * np.maximum(np.abs(again), np.abs(values)), axis=1)
    if count := np.unique(pair.reshape(-1)[differ]).size:
        verb = "stands" if count == 1 else "stand"
        note(record, f"{counted(count, 'pair')} of directions {verb} in several rows with different values.")


def doubt_comments(comments: Iterable[str], record: dict[str, Any], but: Collection[str] = ()) -> None:
    """Note in a record the comments of a file on another quantity than f_r, a factor, a polarisation, or azimuths.

    Quantities in `but` were read as such.
    """
    for comment in comments:
        text = f"A comment says {comment.strip()[:_SHOWN]!r}"
        factor = None if "factor" in but else _FACTOR.search(comment)
        if factor and not _NO_FACTOR.search(comment[: factor.end()]):
            remedy = "correct them, or name the column of a text BRDF [10^-3/sr]"
            note(record, f"Factor? {text}; numbers were read as they stand: {remedy}.")
        if _NO.search(comment):
            continue
        for quantity, words in _QUANTITIES.items():
            if words.search(comment) and quantity not in but:
                note(record, f"Quantity? {text}; values were read as f_r: --quantity {quantity} would read them so.")
        if _OF_TRANSMISSION.search(comment):
            note(record, f"Transmission? {text}; values were read as f_r of reflected light.")
        if _POLARISED.search(comment) and "polarisation" not in record:
            note(record, f"Polarised? {text}; f_r is then that of this light, and not of unpolarised light.")
        if _CLOCKWISE.search(comment):
            end = "an asymmetry of the surface is mirrored if that is seen from above"
            note(record, f"Azimuths? {text}; they were read counter-clockwise, seen from above: {end}.")


def _digits(text: str) -> int:
    """Return the number of digits behind the decimal point of a number, and of characters of its exponent."""
    match = _NUMBER.fullmatch(text.strip())
    return 0 if match is None else len(match["decimals"] or "") + len(match["exponent"] or "")
