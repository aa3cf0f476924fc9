"""Layout of a text: its delimiter, the names of its columns, titles above them, and the first row."""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from brdfdb.formats.text._blocks import assigned_in
from brdfdb.formats.text._columns import (
    ANGLE_WORDS,
    ANGLES,
    AZIMUTHS,
    BARE_POLAR,
    OTHER_ANGLES,
    angle_unit,
    factor_of,
    length_unit,
    plain_name,
    role_of,
    roles_of,
)
from brdfdb.formats.text._fields import TextLine, fields_of, number_of
from brdfdb.measurements.conventions import ANGLE_UNITS

INDEX = "index"  # name of a first column whose header is empty
EMPTY = "column "  # start of the names of columns at the end whose headers are empty
FEWEST = 4  # numbers of a row whose columns have no names that are known
_FEWEST_NAMES = 3  # fields of a line of names that are no numbers; two of a line of two
_CACHED = 4096  # lines whose names are kept: they are looked at for each line below
SHOWN = 200  # characters of a line or of names that a sentence repeats
_NEAREST = 50  # lines above a row that may have the names
_UPRIGHT_DEG = 90.0
_MOST_WORDS = 24  # of a line of names that single spaces separate
_HEAD = re.compile(
    r"(?P<word>.*?)[\s_=:@(\[]*(?P<number>(?<![\d.,])[-+]?\d+(?:[.,]\d+)?)\s*"
    r"(?P<unit>\u00b0|\u00ba|deg(?:rees?)?\.?|Grad|m?rad)?[)\]]?"
)
_PREFIX = re.compile(r"^\s*(?:columns?|fields?|names?|data|format|header|spalten|colonnes)\s*:\s*", re.IGNORECASE)
_OF_SR = re.compile(r"(?<=\d)\s*[\[(]\s*(?:1 ?/ ?sr|sr ?\^?-1)\s*[\])]\s*$")  # behind a number
_AXES = re.compile(
    r"\brows?\b\W*(?:are|is)?\W*(?P<rows>[^,;]+?)[,;]? *(?:and )?\bcolumns?\b\W*(?:are|is)?\W*(?P<columns>[^,;]+)",
    re.IGNORECASE,
)
_QUANTITY = re.compile(
    r"(?:log_?10|ln|log)?[ (]*\b(?:cc-?BRDF|cc-?BSDF|cosine[- ]corrected (?:BRDF|BSDF)|BRDF|BSDF|BRF|HCRF|BCRF|ARS|DSF|"
    r"reflectance factors?)\b\)?(?:\s*[\[(][^\])]*[\])]|\s*%)?",
    re.IGNORECASE,
)


class Heads(NamedTuple):
    """Numbers above the columns of a matrix from column `first` on: their names are `name`, values below are `values`.

    `unit` is that of the numbers, `note` says what was assumed, or what to do if the name is empty, `names` are those
    of all columns, and `lines` the numbers of the lines that hold them.
    """

    first: int
    numbers: tuple[float, ...]
    unit: str
    name: str
    values: str
    note: str = ""
    names: tuple[str, ...] = ()
    lines: tuple[int, ...] = ()


@dataclass(frozen=True)
class TextLayout:
    """The layout of a text."""

    delimiter: str | None  #: the character between fields; None: any white space
    line: int  #: line of the names of the columns; that of the first row if it has none
    names: tuple[str, ...]  #: names of the columns; their numbers, from 1, if it has none
    lines: tuple[TextLine, ...]  #: titles: lines before the numbers that are not the names
    first: int  #: line of the first row
    units: tuple[str, ...] = ()  #: units in a line below the names, one a column; () without such a line
    damaged: str = ""  #: a sentence on an earlier line that looks like a row but has fields that are not numbers
    heads: Heads | None = None  #: numbers above columns of a matrix, such as angles of incidence

    @property
    def titles(self) -> list[str]:
        """The titles as texts."""
        return [line.text for line in self.lines]

    @property
    def described(self) -> tuple[str, ...]:
        """Names of the columns with the units of the line below them in brackets."""
        pairs = itertools.zip_longest(self.names, self.units, fillvalue="")
        return tuple(f"{name} [{unit.strip('[]()')}]" if unit else name for name, unit in pairs)

    def title(self, words: re.Pattern[str], but: re.Pattern[str] | None = None) -> str:
        """Return the first title with some words and without others, as a sentence repeats it; "" if there is none."""
        found = (text for text in self.titles if words.search(text) and not (but and but.search(text)))
        return next(found, "").strip()[:SHOWN]


def layout_of(
    lines: Iterable[tuple[int, str]], wanted: Collection[str] = (), fewest: int = FEWEST
) -> TextLayout | None:
    """Return the layout of a text by its first lines, with their numbers; None if there is no row.

    The first line of `fewest` numbers alone is the first row, or of fewer below names of angles and values. Below names
    a row may have texts, too. The last line before it with as many fields, three of them no numbers, has the names,
    also behind a sign of a comment. `wanted` are names of columns that the caller gives.
    """
    before: list[TextLine] = []
    for number, line in lines:
        signs: list[str | None] = [sign for sign in "\t;," if sign in line]
        if not signs or "," in signs:  # which may be that of decimals
            signs.append(None)
        delimiter = next((sign for sign in signs if _is_row(fields_of(line, sign), sign, before, wanted, fewest)), "")
        if delimiter == "":
            before.append(TextLine.of(number, line))
            continue
        fields = fields_of(line, delimiter)
        for count in (len(fields), len(fields) - (not fields[-1])):  # rows may end in a delimiter where names do not
            heads = _heads(before, delimiter, count)
            at, names = (heads.lines[-1], heads.names) if heads else _names(before, delimiter, count, wanted)
            if at:
                break
        used = heads.lines if heads else (at,)
        rows_of_units = [above for above in before if above.number > at and are_units(above.text, delimiter, count)]
        units = _split(rows_of_units[-1].text, delimiter, count, empty=True) if rows_of_units else ()
        before = [above for above in before if above not in rows_of_units]
        titles = tuple(above for above in before if above.number not in used and above.text.strip())
        between = [above for above in before if above.number > at and not above.comment]
        if not at:
            between = [above for above in between[-1:] if len(fields_of(above.text, delimiter)) == count]
        damaged = next((fault for above in between if (fault := _fault(above, delimiter, names))), "")
        return TextLayout(delimiter, at or number, names, titles, number, units, damaged, heads)
    return None


def header_of(text: str, layout: TextLayout) -> tuple[str, ...]:
    """Return the names of columns in a line with as many as a layout has, three or all of them known; else none."""
    names = _split(text, layout.delimiter, len(layout.names))
    known = sum(name in layout.names or bool(role_of(name)) for name in names if number_of(name) is None)
    return names if names and known >= min(_FEWEST_NAMES, len(layout.names)) else ()


def _is_row(
    fields: Sequence[str], delimiter: str | None, before: Sequence[TextLine], wanted: Collection[str], fewest: int
) -> bool:
    """Return True if fields are the numbers of a row, and texts of columns with names."""
    numbers = [number_of(field) for field in fields]
    count = len(fields)
    known = sum(value is not None and value == value for value in numbers)
    words = numbers.count(None)
    if count < 2 or known < (2 if words else 1) or (not words and count >= fewest and fields[0]):
        return count >= fewest and known >= 1 and not words
    at, names = _names(before, delimiter, count, wanted)
    of_numbers = bool(at) and any(number_of(name) is not None for name in names)
    if not of_numbers and set(wanted) and set(wanted) <= set(names):
        return True
    roles = {*roles_of(names), *(each.role for line in before for each in assigned_in(line))}
    if at and not of_numbers and len(missing_roles(roles)) < 2:
        return True
    return not words and (count > 2 or of_numbers) and _heads(before, delimiter, count) is not None


def missing_roles(roles: Collection[str]) -> list[str]:
    """Return the roles that a text cannot do without and that are missing."""
    known = {*roles, *(("theta_r",) if "from_specular" in roles else ())}
    return [role for role in ("theta_i", "theta_r", "values") if role not in known]


def _names(
    before: Sequence[TextLine], delimiter: str | None, count: int, wanted: Collection[str] = ()
) -> tuple[int, tuple[str, ...]]:
    """Return the line and the names of columns; without names, line 0 and numbers from 1.

    They are in the last line that has the wanted names, or in the last one with as many names, one of which is known,
    or else in the last line that is no row.
    """
    numbered = tuple(str(1 + column) for column in range(count))
    fewest = min(_FEWEST_NAMES, count)
    near = before[: -_NEAREST - 1 : -1]
    split = [
        (line, _unlike(_names_in(line, delimiter, count), near[place + 1 :], delimiter))
        for place, line in enumerate(near)
    ]
    for line, names in split:
        if set(wanted) and set(wanted) <= set(names):
            return line.number, names
    for line, names in split:
        words = [name for name in names if number_of(name) is None and not name.startswith(EMPTY)]
        of_wavelengths = names and all(map(role_of, names)) and "theta_r" in roles_of(names)
        if (len(words) >= fewest and any(map(role_of, words))) or of_wavelengths:
            return line.number, names
    for line, names in split:
        of_words = sum(number_of(name) is None for name in names) >= fewest
        if count > 2 and of_words and not are_units(line.text, delimiter, count):
            return line.number, names
        if line.text.strip() and (line.comment or not _fault(line, delimiter, numbered)):
            break
    return 0, numbered


def _unlike(names: tuple[str, ...], above: Sequence[TextLine], delimiter: str | None) -> tuple[str, ...]:
    """Return names of which those that are alike have the word of a cell above them, which may reach over several."""
    if len(set(names)) == len(names) or delimiter is None or are_units(delimiter.join(names), delimiter, len(names)):
        return names
    line = next((line for line in above if line.text.strip()), None)
    cells = _split(line.text, delimiter, len(names), empty=True) if line else ()
    cells = tuple(
        itertools.accumulate(("" if cell == INDEX else cell for cell in cells), lambda last, cell: cell or last)
    )
    pairs = itertools.zip_longest(names, cells, fillvalue="")
    return tuple(f"{name} {cell}".strip() if names.count(name) > 1 else name for name, cell in pairs)


def _names_in(line: TextLine, delimiter: str | None, count: int) -> tuple[str, ...]:
    """Return the names in a line; a semicolon before them is the sign of a comment, or an empty first name."""
    names = _split(_PREFIX.sub("", line.text), delimiter, count) or _split(line.text, delimiter, count)
    return names or (_split(line.raw, delimiter, count) if line.raw.startswith(";") else ())


def _heads(before: Sequence[TextLine], delimiter: str | None, count: int) -> Heads | None:
    """Return the numbers above the columns of a matrix; None if none are there.

    Their line has names of columns first, also an empty one, then a number for each other column. Names of the angle of
    rows and of the quantity may stand below it.
    """
    nearest = [line for line in before if line.text.strip()][-3:]
    below: tuple[str, ...] = ()  # names between the numbers and the rows
    lines: tuple[int, ...] = ()
    for place, line in reversed(list(enumerate(nearest))):
        names = _split(line.raw, delimiter, count, empty=True) or _split(line.text, delimiter, count, empty=True)
        names = ("", *names[1:]) if names[:1] == (INDEX,) else tuple(_OF_SR.sub("", name) for name in names)
        heads = _heads_in(names)
        if heads is None:
            if not below and any(map(role_of, names)) and not are_units(line.text, delimiter, count):
                below, lines = names, (line.number,)
        elif below:
            corner = names[0].strip(": ")
            of_rows = below[heads.first :]
            if len(set(of_rows)) > 1 or role_of(of_rows[0]) != "values" or not _is_angle(corner):
                return None  # the names of columns are below, and the numbers have another meaning
            return heads._replace(name=corner, values=of_rows[0], names=below, lines=(line.number, *lines))
        else:
            matrix = _matrix(heads._replace(names=names, lines=(line.number,)), nearest[:place], before)
            cells = [cell for cell in fields_of(nearest[place - 1].raw, delimiter) if cell] if place else []
            if len(cells) > 2 and _is_angle(cells[0]) and None not in map(number_of, cells[1:]):
                other = f"so has line {nearest[place - 1].number}; write a row for each pair of directions"
                return matrix._replace(name="", note=other)
            if matrix.name or not names[0]:
                return matrix
    return None


def _heads_in(names: Sequence[str]) -> Heads | None:
    """Return the numbers behind the first of names, such as "BRDF at 30 deg"; None if these are names of columns."""
    matches = [_HEAD.fullmatch(name) if name else None for name in names]
    first = next((n for n in range(len(names)) if all(matches[n:])), len(names))
    heads = [match for match in matches[first:] if match]
    words = {match["word"].strip(" _-@=:(") for match in heads}
    units = {match["unit"] or "" for match in heads}
    of_words = all(not name or name[0].isalpha() or name[0] in "\u03b8\u03d1" for name in names[:first])
    if first < 1 or len(heads) < 2 or not of_words or len(words) > 1 or len(units) > 1:
        return None
    numbers = tuple(float(match["number"].replace(",", ".")) for match in heads)
    word, unit = words.pop(), units.pop()
    role = role_of(word)
    quantity, _, name = ("", "", word) if role else word.partition(" ")
    if role == "values":
        quantity, name = word, ""
    of_wavelengths = role == "wavelength" or (not word and not unit and min(numbers) >= 100.0)
    repeats = role == "values" and not unit  # such as BRDF_1
    has_directions = not word and {"theta_i", "theta_r"} <= set(roles_of(names[:first]))
    unknown = word and not role and role_of(quantity) != "values"
    if of_wavelengths or repeats or has_directions or unknown:
        return None
    return Heads(first, numbers, unit, name, quantity)


def _matrix(heads: Heads, above: Sequence[TextLine], before: Sequence[TextLine]) -> Heads:
    """Return the heads of a matrix with the name of what they are; an empty name if nothing tells it.

    `heads` has what their own line says; `above` are the lines next to it, and `before` all lines.
    """
    lines = heads.lines
    corner = heads.names[0]
    parts = re.sub(r"\s*[\\|]\s*|\s+/\s+|(?<=[\w)\]])/(?=\w)", "|", corner).partition("|")
    of_rows, of_columns = parts[0].strip(), parts[2].strip()
    if parts[1] and not (_is_angle(of_rows) and _is_angle(of_columns)):
        of_rows, of_columns = corner.strip(), ""
    of_columns = heads.name or of_columns
    for line in reversed(above):
        if axes := _AXES.search(line.text):
            of_rows, of_columns = of_rows or axes["rows"].strip(), of_columns or axes["columns"].strip()
        cells = [cell.strip() for cell in re.split(r"[\t;,]|\s{2,}", line.raw.strip()) if cell.strip()]
        if not of_columns and len(cells) in (1, 2) and all(map(_is_angle, cells)):
            of_rows, of_columns = of_rows or ("", *cells)[-2], cells[-1]
            lines = (line.number, *lines)
    note = ""
    if not of_columns and (_is_angle(of_rows) or role_of(of_rows) == "wavelength"):
        given = {each.role for line in before for each in assigned_in(line)}
        of_columns, words = "theta_i", "polar angles of the light"
        if "theta_i" in roles_of((of_rows,)) or not _is_angle(of_rows):
            of_columns, words = "theta_r", "polar angles of the viewer"
        elif "theta_i" in given or max(heads.numbers) > _UPRIGHT_DEG:
            of_columns, words = "delta_phi", "azimuths from the light to the viewer"
        note = f"Numbers above the columns were taken as {words}: rows are those of {of_rows}."
    if heads.unit and of_columns and not angle_unit(of_columns):
        of_columns = f"{of_columns} [{heads.unit}]"
    titles = (match[0].strip() for line in reversed(above) if (match := _QUANTITY.search(line.text)))
    values = heads.values or next(titles, "")
    if not of_columns:
        note = "nothing says what they are; write the angles of rows and columns into its first field, such as "
        note += "theta_r\\theta_i"
    elif not values:
        note += " No name says what the values are: they were taken as f_r."
    names = (of_rows, *heads.names[1:])
    return heads._replace(name=of_columns, values=values or "f_r", note=note.strip(), names=names, lines=lines)


def _is_angle(name: str) -> bool:
    """Return True if a name is that of an angle, also of an azimuth or a polar angle that does not say of what."""
    return role_of(name) in ANGLES or plain_name(name) in (*BARE_POLAR, *AZIMUTHS)


def are_units(text: str, delimiter: str | None, count: int) -> bool:
    """Return True if a line has as many fields as there are columns, all of them units, one of them of an angle."""
    fields = [unit.strip("[]() ") for unit in _split(text, delimiter, count, empty=True)]
    of_angles = sum(unit.lower() in (*ANGLE_WORDS, *OTHER_ANGLES) for unit in fields)
    return of_angles >= 2 or (
        of_angles == 1
        and all(
            not unit or angle_unit(f"[{unit}]") in ANGLE_UNITS or factor_of(unit) is not None or length_unit(f" {unit}")
            for unit in fields
        )
    )


@lru_cache(maxsize=_CACHED)
def _split(text: str, delimiter: str | None, count: int, *, empty: bool = False) -> tuple[str, ...]:
    """Return the names in a line if it has as many as there are columns, with the delimiter of rows or another one.

    The first may be empty: pandas writes the numbers of rows into such a column. With `empty` others may, too.
    """
    for sign in dict.fromkeys((delimiter, None, ",", ";", "\t")):
        first, *others = fields_of(text, sign) or [""]
        if len(others) == count - 1 and (first or len(others) >= _FEWEST_NAMES - 1):
            if all(others):
                return (first or INDEX, *others)
            if empty and sign is not None and any(others):
                return (first, *others)
            if sign is not None and sign == delimiter and first and any(others):
                return (first, *(name or f"{EMPTY}{n}" for n, name in enumerate(others, 2)))
    if delimiter is None:
        parts = re.split(r"\s{2,}|\t", text.strip())
        if len(parts) == count and all(parts):
            return tuple(parts)
        return _phrases(text, count)
    return ()


def _phrases(text: str, count: int) -> tuple[str, ...]:
    """Return names of several words that single spaces separate: the division with most known names, all long ones."""
    words = [word.replace("\n", " ") for word in re.sub(r"\s+(?=[\[(])", "\n", text.strip()).split(" ") if word]
    if not count <= len(words) <= _MOST_WORDS:
        return ()
    best: dict[tuple[int, int], tuple[int, tuple[str, ...]]] = {(0, 0): (0, ())}  # by numbers of words and names
    for end, length in itertools.product(range(1, len(words) + 1), range(5, 0, -1)):
        name = " ".join(words[max(end - length, 0) : end])
        known = _is_angle(name) or bool(role_of(name))
        for number in range(count):
            score, names = best.get((end - length, number), (-1, ()))
            if score >= 0 and (known or length == 1) and score + known > best.get((end, number + 1), (-1, ()))[0]:
                best[end, number + 1] = (score + known, (*names, name))
    score, names = best.get((len(words), count), (0, ()))
    return names if score >= 2 else ()


def _fault(line: TextLine, delimiter: str | None, names: Sequence[str]) -> str:
    """Return a sentence on a line that is a row of numbers except for some fields; empty for other lines."""
    fields = fields_of(line.text, delimiter)
    numbers = [number_of(field) for field in fields]
    known = sum(value is not None and value == value for value in numbers)
    if len(fields) == len(names) and known >= 2 and None in numbers:
        wrong = numbers.index(None)
        return f"line {line.number}, field {names[wrong]}: {fields[wrong][:40]!r} is not a number"
    if len(fields) != len(names) and len(fields) >= 3 and None not in numbers and known:
        return f"line {line.number} has {len(fields)} fields, but the first valid row has {len(names)}"
    return ""
