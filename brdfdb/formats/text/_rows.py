"""Rows of texts: their numbers and words, and lines between them that give something to the rows below."""

from __future__ import annotations

import re
from array import array
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._doubts import check_last_number
from brdfdb.formats._input import lines_of
from brdfdb.formats._record import note, of_comments
from brdfdb.formats.text._blocks import Assigned, assigned_in, given_by
from brdfdb.formats.text._columns import ANGLES, OF_SAMPLES, angle_unit, plain_name, role_of, roles_of, wavelength_of
from brdfdb.formats.text._fields import SIGNS, TextLine, decimal_sign, fields_of, number_of
from brdfdb.formats.text._layout import SHOWN, TextLayout, are_units, header_of
from brdfdb.formats.text._sheet import TextSheet, listed

_ANGLE_UNIT = re.compile(r"(?<![\d.])(?<![\d.] )\b(?:degrees?|deg|m?rad|(?:milli)?radians?)\b", re.IGNORECASE)
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d{3}")  # a number whose sign may separate them
_DIGITS = re.compile(r"\d+(?:[.,]\d+)?")
_SPLIT = "write a file for each"


def rows_of(path: Path, layout: TextLayout, record: dict[str, Any], wanted: Collection[str] = ()) -> TextSheet:
    """Return the rows of a text, whose columns of numbers are those of known names and of those that are wanted.

    Lines above rows, also comments, may give an angle, a wavelength or a word to all rows below them: these are further
    columns, of angles and wavelengths in any case, of words where they differ. FileFormatError if a row is damaged,
    stands below a line with other columns or another unit of angles, or the file was cut within its last number.
    """
    heads = layout.heads
    count = len(layout.names)
    columns = [column for column, name in enumerate(layout.names) if heads is None and name in wanted]
    roles = roles_of(layout.names, {"given": columns} if columns else None)
    numeric = {*columns, *(column for of_role in roles.values() for column in of_role)}
    numeric |= set(range(heads.first, count)) if heads else set()
    of_numbers = {column: layout.names[column] for column in sorted(numeric)}
    numbers, lines, of_rows = array("d"), array("q"), array("q")
    words: dict[int, dict[int, str]] = {}
    holes = Counter[str]()  # words that stand for no value
    given: dict[str, Assigned] = {}
    for title in layout.lines:
        given |= given_by(title, layout.delimiter)
    blocks: list[dict[str, Assigned]] = []
    decimals = ""  # the sign before decimals: a comma in a file with points may separate thousands
    settled = False  # True if a number shows that the sign does not separate thousands
    other = ""  # a sentence on the last comments: rows below them are not as those above
    for line_number, line in _from_first(path, layout):
        plain = settled and decimals == "." and not words
        row: Sequence[float | None] | None = _plain_row(line, layout) if plain else None
        fields = fields_of(line, layout.delimiter) if row is None else []
        if row is None:
            fields = fields[:count] if len(fields) == count + 1 and not fields[-1] else fields
            row = [number_of(field) for field in fields]
            if _is_between(line, row, layout, numeric):
                text = TextLine.of(line_number, line)
                new = given_by(text, layout.delimiter)
                if new and not are_units(text.text, layout.delimiter, count):
                    given = given | new
                else:
                    other = other or _other_rows(text, layout)
                continue
        if other:
            raise FileFormatError(f"{path}: {other}")
        if len(row) != count:
            raise FileFormatError(f"{path}: line {line_number} has {len(row)} fields, but the first row has {count}")
        if fields:
            decimals = _decimals(f"{path}: line {line_number}", fields, row, of_numbers, decimals)
            settled = settled or any(map(_has_decimals, (fields[column] for column in of_numbers)))
            for column, number in enumerate(row):
                if number is None:
                    words.setdefault(column, {})[len(lines)] = fields[column]
                elif number != number and column in numeric and fields[column].lower() not in ("", "nan"):
                    holes[fields[column]] += 1
        if not blocks or given is not blocks[-1]:
            blocks.append(given)
        numbers.extend(np.nan if number is None else number for number in row)
        of_rows.append(len(blocks) - 1)
        lines.append(line_number)
    if not lines:
        raise FileFormatError(f"{path}: line {layout.first}: all rows begin with the sign of a comment; remove it")
    if len(lines) > 1 and list(numbers[:count]) == list(range(1, count + 1)):
        doubt = f"Line {lines[0]} has 1 to {count}, and was read as a row"
        note(record, f"Row? {doubt}: remove it if it numbers the columns.")
    if decimals and not settled:
        doubt = f"All numbers with {decimals!r} have three digits behind it, and it was read as that of decimals"
        note(record, f"Thousands? {doubt}: remove it if it separates thousands.")
    if holes:
        note(record, f"Words read as holes: {', '.join(f'{count} of {word!r}' for word, count in holes.items())}.")
    below = [f"{each.name} = {each.word}" for each in given.values() if each not in blocks[-1].values()]
    if below:
        note(record, f"Below the last row, and left out: {listed(below)}.")
    ends = ((number, fields_of(line, layout.delimiter)[-1]) for number, line in _from_first(path, layout))
    known = frozenset(lines)
    check_last_number(path, ((number, end) for number, end in ends if number in known))
    dense = {column: np.full(len(lines), "", dtype=object) for column in words}
    for column, of_rows_with_words in words.items():
        dense[column][list(of_rows_with_words)] = list(of_rows_with_words.values())
    table = np.frombuffer(numbers, dtype=np.float64).reshape(-1, count)
    at = np.frombuffer(lines, dtype=np.int64)
    sheet = TextSheet(path, layout, record, layout.names, layout.described, table, dense, at)
    sheet = _with_blocks(sheet, blocks, np.frombuffer(of_rows, dtype=np.int64), roles)
    if not heads:
        return sheet
    if not heads.name:
        raise FileFormatError(f"{path}: line {layout.line} has numbers above the columns, and {heads.note}")
    if heads.note:
        sheet.note(heads.note)
    return sheet.stacked(range(heads.first, count), heads.numbers, heads.name, heads.values)


def _plain_row(line: str, layout: TextLayout) -> list[float] | None:
    """Return the numbers of a row that is nothing but finite numbers with decimal points; None of any other line."""
    try:
        row = list(map(float, line.split(layout.delimiter)))
    except ValueError:
        return None
    return row if len(row) == len(layout.names) and "_" not in line and -np.inf < sum(row) < np.inf else None


def _has_decimals(field: str) -> bool:
    """Return True if the sign in a number is that of decimals, and does not separate thousands."""
    return decimal_sign(field) != "" and not _THOUSANDS.fullmatch(field)


def _decimals(
    where: str, fields: Sequence[str], row: Sequence[float | None], names: Mapping[int, str], known: str
) -> str:
    """Return the sign before decimals in a row and those above it; FileFormatError if a number has another one.

    `names` are those of the columns of numbers, `known` is the sign above, and `where` the file and the line.
    """
    for column, name in names.items():
        field, number = fields[column], row[column]
        sign = (decimal_sign(field) if number == number else "") or known
        fault = ""
        if number is None or number in (np.inf, -np.inf):
            fault = "is not a number"
        elif known not in ("", sign):
            fault = f"has {sign!r} where numbers above it have {known!r}; write numbers without signs between thousands"
        if fault:
            raise FileFormatError(f"{where}, field {name}: {field[:40]!r} {fault}")
        known = sign
    return known


def _with_blocks(
    sheet: TextSheet,
    blocks: Sequence[Mapping[str, Assigned]],
    of_rows: NDArray[np.int64],
    roles: Mapping[str, list[int]],
) -> TextSheet:
    """Return a sheet with columns of what lines above its rows give; `of_rows` are the numbers of their blocks."""
    layout = sheet.layout
    of_values = roles.get("values", ())
    titles_have_wavelength = of_comments({"titles": "\n".join(layout.titles)})[1] is not None
    one_length = not titles_have_wavelength and all(wavelength_of(layout.names[column]) is None for column in of_values)
    for key in dict.fromkeys(key for block in blocks for key in block):
        of_blocks = [block.get(key) for block in blocks]
        known = [given for given in of_blocks if given]
        if key in ANGLES and key in roles and not np.isin(known[0].value, sheet.numbers[:, roles[key][0]]):
            column = sheet.names[roles[key][0]]
            sheet.note(f"Line {known[0].line} gives {known[0].name} = {known[0].word}, but {column} was read.")
        other_azimuth = {"phi_r": "delta_phi", "delta_phi": "phi_r"}.get(key, key)
        in_table = any(plain_name(known[0].name) == plain_name(name) for name in sheet.names)
        if {key, other_azimuth} & set(roles) or (key == "phi_i" and "delta_phi" in roles) or in_table:
            continue
        several = len({given and given.value for given in of_blocks}) > 1
        if key in ANGLES or key == "wavelength":
            alone = {line.number for line in layout.lines if len(_DIGITS.findall(line.text)) == 1}
            of_titles = one_length and len(of_values) < 2 and alone.issuperset(each.line for each in known)
            if key == "wavelength" and not several and not of_titles:
                continue
            unit = angle_unit if key in ANGLES else str
            if other := next((each for each in known if unit(each.name) != unit(known[0].name)), None):
                text = f"line {other.line} gives {other.name}, but line {known[0].line} {known[0].name}; {_SPLIT}"
                raise FileFormatError(f"{sheet.path}: {text}")
            if None in of_blocks:
                line = sheet.lines[np.argmax(of_rows == of_blocks.index(None))]
                text = f"line {known[0].line} gives a {key} to rows below it, but no line gives one to line {line}"
                raise FileFormatError(f"{sheet.path}: {text}; {_SPLIT}")
            if several:
                sheet.note(f"Lines above rows give {known[0].name}: {listed(each.word for each in known)}.")
            else:
                sheet.note(f"Line {known[0].line} gives {known[0].name} = {known[0].word} to all rows.")
        elif not several:
            continue
        missing = "unnamed" if OF_SAMPLES.fullmatch(plain_name(key)) else np.nan
        values = [missing if given is None else given.value for given in of_blocks]
        sheet = sheet.with_column(known[0].name, [values[block] for block in of_rows])
    return sheet


def _from_first(path: Path, layout: TextLayout) -> Iterator[tuple[int, str]]:
    """Yield the lines from the first row on, with their numbers, without empty ones."""
    return ((number, line) for number, line in lines_of(path) if number >= layout.first and line.strip())


def _is_between(line: str, row: Sequence[float | None], layout: TextLayout, numeric: Collection[int]) -> bool:
    """Return True for a comment and for a line that names something instead of holding numbers: it is no row."""
    count = len(layout.names)
    known = sum(value is not None and value == value for value in row)
    start = line.lstrip()
    if start.startswith(SIGNS) and not (start[0] == "#" and row[0] is not None and len(row) == count and known):
        return True
    of_heads = (
        layout.heads is not None and len(row) == count and tuple(row[layout.heads.first :]) == layout.heads.numbers
    )
    if of_heads and (row[0] is None or row[0] != row[0]):
        return True
    if row[0] is not None or not start[0].isalpha():
        return known == 0
    if len(row) == count and 0 not in numeric and known:
        return role_of(fields_of(line, layout.delimiter)[0]) in ANGLES
    return known <= 1 or bool(assigned_in(TextLine.of(0, start)))


def _other_rows(line: TextLine, layout: TextLayout) -> str:
    """Return a sentence on a line between rows that gives them other columns or units; empty if it does not."""
    text = line.text
    fields = tuple(fields_of(text, layout.delimiter))
    if are_units(text, layout.delimiter, len(layout.names)):
        same = fields == layout.units
        return "" if same else f"line {line.number} gives other units than line {layout.line}; {_SPLIT}"
    names = header_of(text, layout)
    if layout.heads and not line.comment and len(fields) == len(layout.names):
        names = fields
    unknown = not names and not layout.heads and not line.comment and any(map(role_of, fields))
    if unknown or (names and names[1:] != layout.names[1:]):
        shown = text.strip() if unknown else ", ".join(names)
        return f"line {line.number} names other columns than line {layout.line}: {shown[:SHOWN]}; {_SPLIT}"
    if names or layout.heads:
        return ""
    units = {unit for name in layout.described if (unit := angle_unit(name))}
    units |= {angle_unit(f"[{word}]") for title in layout.titles for word in _ANGLE_UNIT.findall(title)}
    new = {angle_unit(f"[{word}]") for word in _ANGLE_UNIT.findall(text)}
    if new and new != (units or {"deg"}):
        return f"line {line.number} gives angles another unit: {text.strip()[:SHOWN]!r}; {_SPLIT}"
    return ""
