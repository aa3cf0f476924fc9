"""Columns of texts that are no angles: words that select rows, polarisations, and what explains a contradiction."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError, counted
from brdfdb.formats.text._columns import OF_SAMPLES, element_columns, plain_name
from brdfdb.formats.text._sheet import TextSheet, distinct, listed
from brdfdb.formats.text._values import ListedValues

Array = NDArray[np.float64]

_POLARISATIONS = re.compile(
    r"(?:(?P<side>source|incident|in|input|light|detector|receiver|out|output|scatter|scattered|view|analy[sz]er)_)?"
    r"(?:pol|polari[sz]ation|polari[sz]er|polari[sz]ationszustand)(?:_state)?(?:_(?P<end>i|in|inc|r|s|o|out|scat|det))?"
)
_OF_LIGHT = ("source", "incident", "in", "input", "light", "i", "inc")
_STATE = re.compile(
    r"(?:(?P<s>s|te|senkrecht|perpendicular)|(?P<p>p|tm|parallel))(?:[-_ ]?pol(?:ari[sz]ed)?)?"
    r"|(?P<first>[sp])[-_/ >]*(?P<second>[sp])"
)
#: words for what a row has of its own, whose values may differ from row to row
_OF_ROWS = re.compile(
    r"(?:date|datum|time|zeit|uhrzeit|heure|timestamp|date_time|datetime|operator|user|comments?|kommentar|remarks?|"
    r"notes?|file|filename|file_name|repeat|repetition|run|scan|index|row|no|nr|number|id|status|flags?|quality|gain|"
    r"range|messung|measurement|point)"
)
_ONE = 1e-3  # distance of m00 from 1, or from f_r relative to it, within which they are the same
_MOST = 1.5  # size of an element over m00: larger ones are not elements over m00
_FEW = 20  # values of a column that rows may be selected by
_EXPLAINED = 0.5  # share of a contradiction that a column that explains it leaves, at most


def check_words(sheet: TextSheet) -> None:
    """Refuse rows of several samples, or of several words of a column that may mean as much.

    FileFormatError names the column, its values, and the option that selects one of them.
    """
    for column, name in enumerate(sheet.names):
        plain = plain_name(name)
        of_samples = OF_SAMPLES.fullmatch(plain) is not None
        if column in sheet.used or not (of_samples or column in sheet.words) or _OF_ROWS.fullmatch(plain):
            continue
        labels = sheet.labels(column)
        values = distinct(labels)
        if len(values) > 1 and (of_samples or len(values) <= min(_FEW, len(labels) // 2)):
            text = f"rows have different values, {listed(labels)}; {_select(name, values[0])} reads one value"
            raise sheet.error(text, column)


def _select(name: str, value: str) -> str:
    """Return the option of the command line that selects rows by the value of a column."""
    return f"--where '{name}'={value}" if re.search(r"[\s()]", name) else f"--where {name}={value}"


def polarisation_columns(names: Sequence[str], used: Collection[int]) -> list[int]:
    """Return the columns of the polarisation: that of the light, of both, and of the receiver."""
    by_side: dict[str, int] = {}
    for column, name in enumerate(names):
        match = _POLARISATIONS.fullmatch(plain_name(name))
        if match and column not in used:
            side = match["side"] or match["end"] or ""
            by_side.setdefault(side and ("i" if side in _OF_LIGHT else "r"), column)
    return [by_side[side] for side in ("i", "", "r") if side in by_side]


def states_of(sheet: TextSheet) -> list[str]:
    """Return the polarisation of each row: s or p of the light, with another letter for the receiver if it is known.

    It is empty if no column has them. FileFormatError if rows have several that have no mean that is known.
    """
    columns = sheet.roles.get("polarisation", ())
    parts = zip(*([light_of(label) for label in sheet.labels(column)] for column in columns), strict=True)
    states = [("" if max(map(len, state)) <= 2 else " ").join(state) for state in parts]
    several = sorted(set(states))
    if len(several) > 1 and several not in (["p", "s"], ["pp", "ps", "sp", "ss"], ["sp", "ss"], ["pp", "ps"]):
        text = f"rows have different polarisations, {', '.join(several)}, and only s and p, ss and sp, ps and pp, or"
        text += f" all four have an f_r that is known; {_one_state(sheet)} reads one polarisation"
        raise sheet.error(text, columns[0])
    return states


def _one_state(sheet: TextSheet) -> str:
    """Return the options that select the polarisation of the first row."""
    of_columns = ((sheet.names[column], sheet.labels(column)) for column in sheet.roles["polarisation"])
    return " ".join(_select(name, labels[0]) for name, labels in of_columns if len(set(labels)) > 1)


def light_of(label: str) -> str:
    """Return s or p for a word that says so, two letters for two, or the word itself in lower case."""
    match = _STATE.fullmatch(label.strip().lower())
    if match is None:
        return label.strip().lower()
    return "s" if match["s"] else "p" if match["p"] else match["first"] + match["second"]


class UnpolarisedRows(NamedTuple):
    """Numbers (N,) of rows whose directions have all polarisations, and their values of unpolarised light."""

    rows: NDArray[np.intp]
    table: ListedValues


def unpolarised(sheet: TextSheet, table: ListedValues, keys: Array, of_rows: Sequence[str]) -> UnpolarisedRows:
    """Return f_r, and the Mueller elements that are known, of rows of two or four polarisations.

    `keys` (N, K) tell directions and wavelengths apart, `of_rows` are polarisations. f_r is the mean over polarisations
    of the light, and the sum over those of the receiver, where rows of all are there; others are left out, and counted.
    If the light has one, such as in ss and sp, f_r is that of this light, and no element is known.
    """
    from brdfdb.measurements.joining import in_columns
    from brdfdb.measurements.mueller import of_lights, of_polarisers

    name = sheet.name("polarisation")
    states, state = np.unique(of_rows, return_inverse=True)
    same = np.unique(np.round(keys, 9), axis=0, return_inverse=True)[1].reshape(-1)
    cells = in_columns(same, state.reshape(-1), len(states), np.arange(float(len(same))), None, None).values
    rows = np.asarray(cells[np.all(np.isfinite(cells), axis=1)], dtype=np.intp)  # a column a state
    if not len(rows):
        text = f"no direction has rows of {' and '.join(states)}; {_one_state(sheet)} reads one polarisation"
        raise ParameterError("where", text, name)
    rows = rows[np.argsort(rows[:, 0])]
    by_state = {str(word): table.values[of_state] for word, of_state in zip(states, rows.T, strict=True)}
    lights = sorted({word[0] for word in by_state})
    head, mueller = "Unpolarised", None
    if len(lights) == 1:
        light, head = lights[0], f"Light of {lights[0]}"
        shown = f"the sum of {' and '.join(sorted(by_state))}"
        mean = np.sum(list(by_state.values()), axis=0)
    elif len(by_state) == 4:
        light = "half of the sum of ss, sp, ps and pp"
        shown = f"{light}, whose first letter is that of the light,"
        mean, mueller = of_polarisers(**by_state)
    else:
        light = "mean of s and p"
        shown = f"the {light}"
        mean, mueller = of_lights(**by_state)
    sheet.record.update(polarisation=light, polarisation_column=name, polarisers=True)
    without = len(same) - rows.size
    verb = "was" if without == 1 else "were"
    end = f"; {counted(without, 'row')} without the other polarisation {verb} left out" if without else ""
    needs = "" if len(by_state) == 4 else " A polarised table needs ss, sp, ps and pp."
    sheet.note(
        f"{head}: f_r is {shown} at the same directions{end}. {_one_state(sheet)} reads one polarisation.{needs}"
    )
    noise = table.uncertainty
    if noise is not None:
        noise = np.sqrt(np.sum(noise[rows] ** 2, axis=1)) / len(lights)
    return UnpolarisedRows(rows[:, 0], ListedValues(table.angles[rows[:, 0]], mean, noise, mueller))


def matrices_of(sheet: TextSheet) -> Array:
    """Return matrices (N, 1, 4, 4) over their first element, of the columns of elements of rows.

    The column of values is that of f_r, its own or that of m00. FileFormatError if elements are over m00 and f_r has no
    column, or m00 is neither 1 nor f_r.
    """
    elements = element_columns(list(map(plain_name, sheet.names)))
    column = sheet.roles["values"][0]
    f_r = sheet.numbers[:, column]
    mueller = np.full((len(f_r), 4, 4), np.nan)
    for place, number in elements.items():
        mueller[(slice(None), *place)] = sheet.numbers[:, number]
    first = mueller[:, 0, 0].copy()
    known = np.isfinite(first)
    if np.all(np.abs(first[known] - 1.0) <= _ONE):
        if column == elements.get((0, 0)):
            raise sheet.error("elements are divided by m00, and no column has f_r; add one, named brdf, in 1/sr")
        mueller[:, 0, 0] = np.where(np.isfinite(f_r), 1.0, np.nan)
        if not known.any() and np.nanmax(np.abs(mueller[np.isfinite(f_r)]), initial=0.0) > _MOST:
            text = f"elements above {_MOST:g} are not divided by m00; add the column of m00, which is 1 if they are"
            raise sheet.error(text)
        sheet.note("Elements of Mueller matrices were read as divided by m00.")
    elif np.allclose(first[known], f_r[known], rtol=_ONE, atol=0.0):
        sheet.note("Elements of Mueller matrices were read as absolute: m00 is f_r of unpolarised light.")
        mueller /= np.where(first > 0.0, first, np.nan)[:, np.newaxis, np.newaxis]
    else:
        text = "m00 is neither 1 nor the column of f_r; divide elements by m00, or leave the column of f_r out"
        raise sheet.error(text)
    return mueller[:, np.newaxis]


def explained(sheet: TextSheet, columns: Sequence[int], keys: Array, f_r: Array) -> str:
    """Return a sentence on the column whose values tell rows apart that contradict; "" if no column does.

    Rows of the same `keys` (N, K) contradict where f_r (N,) differs. A column explains it if f_r of rows with the same
    keys and the same value in the column differs by less than half as much, and it has few values.
    """
    keys = np.round(keys, 9)
    most = 1.0 + _EXPLAINED * (_spread(keys, f_r) - 1.0)
    explaining: list[tuple[float, str, list[str]]] = []
    for column in columns:
        labels = sheet.labels(column)
        values = distinct(labels)
        if 2 <= len(values) <= _FEW:
            coded = np.unique(labels, return_inverse=True)[1]
            if (spread := _spread(np.column_stack([keys, coded]), f_r)) < most:
                explaining.append((spread, sheet.names[column], values))
    if not explaining:
        return ""
    _, name, values = min(explaining)
    text = f"The column {name} tells these rows apart ({listed(values)})"
    return f"{text}: {_select(name, values[0])} reads one value."


def _spread(keys: Array, f_r: Array) -> float:
    """Return the median ratio of the largest to the smallest f_r of the same keys; 1 if no rows share keys."""
    _, same, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    high, low = np.full(count.size, -np.inf), np.full(count.size, np.inf)
    np.maximum.at(high, same.reshape(-1), f_r)
    np.minimum.at(low, same.reshape(-1), f_r)
    several = (count > 1) & (low > 0.0) & np.isfinite(high)
    return float(np.median(high[several] / low[several])) if several.any() else 1.0
