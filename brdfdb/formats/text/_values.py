"""Values of texts: the quantity, unit and logarithm of their columns, uncertainties and wavelengths."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.formats._nodes import fill_values
from brdfdb.formats.text._columns import (
    PERCENT,
    UNKNOWN_COSINE,
    ValueName,
    length_unit,
    plain_name,
    scale_of,
    spectral_unit,
    units_in,
    value_name,
    wavelength_of,
)
from brdfdb.formats.text._layout import SHOWN
from brdfdb.formats.text._sheet import TextSheet
from brdfdb.measurements.conventions import LOGARITHMS, NM_PER, f_r_of, factor_of_quantity

Array = NDArray[np.float64]

_LEAST_NM, _LEAST_UM = 10.0, 100.0  # numbers without a unit below the first are not nm, from the second on not um
_OF_F_R = ("f_r_cos", "f_r_cos_i", "reflectance_factor")  # quantities that may stand beside f_r
_AGREE = 0.02  # relative difference of quantities that are made of the same f_r, in the median
_COVERAGE = re.compile(r"\bk ?= ?(\d+(?:\.\d+)?)[ ,;]*|^(\d)[ _-]?(?=sigma|\u03c3)", re.IGNORECASE)
_RELATIVE = re.compile(r"[\[(]rel(?:ative|\.)?[\])]|(?:\b|_)rel(?:ative|\.)?(?![a-z])", re.IGNORECASE)
_PROBABILITY = re.compile(r"\d+(?:\.\d+)? ?(?:%|percent\b)")  # of an interval, such as U (95 %)
_OF_FACTORS = re.compile(r"\b(?:BRF|HCRF|reflectance factors?)\b", re.IGNORECASE)
_OF_PERCENT = re.compile(
    r"\b(?:BRDF|BRF|HCRF|BCRF|DSF|f_r|reflectance factors?|values)\b[\s,:;=(\[]*(?:(?:is|are|given|in|units?) )*"
    r"(?:%|(?:percent|pct)\b)|\bunits?\W{1,3}% ?/ ?sr\b",
    re.IGNORECASE,
)
_OF_ANGSTROM = re.compile(
    r"\b(?i:wavelengths?|lambda)\b[^.;\d]{0,30}?(?:\b(?i:\u00e5ngstr\w+|angstr\w+)|\u00c5|\u212b|(?:\bin |[\[(])A\b)"
)
_OF_UNCERTAINTY = re.compile(r"uncertaint|error|deviation|\bstd\b", re.IGNORECASE)


class ListedValues(NamedTuple):
    """Angles (N, 4) [rad], f_r (N, C) [1/sr], its uncertainties and Mueller matrices of the rows of a text."""

    angles: Array
    values: Array
    uncertainty: Array | None = None
    mueller: Array | None = None

    @property
    def mean(self) -> Array:
        """Mean of f_r over the columns that have a value, shape (N,); 0 where none has."""
        known = np.isfinite(self.values)
        return np.asarray(np.where(known, self.values, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1))

    def with_channels(self, lengths: Array) -> ListedValues:
        """Return values with a column for each of the distinct wavelengths (C,) or (N, 1) of these, in their order.

        A wavelength that repeats at a direction is another row, and what is missing is nan.
        """
        from brdfdb.measurements.joining import in_columns

        distinct, channel = np.unique(lengths, return_inverse=True)
        if lengths.ndim == 1 and distinct.size == lengths.size:
            order = np.argsort(lengths)
            ordered = (table if table is None else table[:, order] for table in self[2:])
            return ListedValues(self.angles, self.values[:, order], *ordered)
        count = self.values.shape[1]
        same = np.unique(np.round(self.angles, 9), axis=0, return_inverse=True)[1].reshape(-1)
        channel = np.broadcast_to(channel.reshape(lengths.shape), self.values.shape).reshape(-1)
        cells: list[Any] = [table if table is None else table.reshape(-1, *table.shape[2:]) for table in self[1:]]
        wide = in_columns(np.repeat(same, count), channel, distinct.size, *cells)
        return ListedValues(self.angles[wide.first // count], *wide[1:])


def values_of(sheet: TextSheet, angles: Array, quantity: str, missing: float | None) -> ListedValues:
    """Return f_r [1/sr] of rows at their angles, shape (N, C), and their uncertainties if there are any.

    A unit that is not known is refused, unless the user has stated the quantity.
    """
    columns = list(sheet.roles["values"])
    quantities = _quantities(sheet, columns, quantity)
    scale = np.stack([1.0 / factor_of_quantity(each, angles[:, 0], angles[:, 2]) for each in quantities], axis=1)
    parts = _units(sheet, columns, quantity)
    logarithms, factors = [each.logarithm for each in parts], np.array([each.factor for each in parts])
    numbers = sheet.numbers[:, columns]
    numbers = np.where(fill_values(numbers, sheet.record, missing), np.nan, numbers)
    values = numbers * factors * scale
    slope = scale.copy()  # of f_r over the number
    for column, logarithm in enumerate(logarithms):
        if logarithm and not quantity:
            f_r = f_r_of(logarithm, numbers[:, column, np.newaxis], angles[:, 0], angles[:, 2])[:, 0]
            values[:, column] = f_r * scale[:, column]
            slope[:, column] = LOGARITHMS[logarithm] * values[:, column]
    if any(logarithms) and not quantity:
        sheet.record["quantity"] = logarithms[0] if quantities[0] == "f_r" else sheet.record["quantity"]
        sheet.note(f"f_r was made of logarithms, as the name {sheet.described[columns[0]]} says.")
    if "uncertainty" not in sheet.roles:
        return ListedValues(angles, values)
    of_columns = sheet.numbers[:, list(sheet.roles["uncertainty"])]
    if of_columns.shape != values.shape:
        raise sheet.error("the columns of uncertainties are not as many as those of values")
    # a relative uncertainty of f_r is an absolute one of its logarithm
    size = np.full_like(values, 1.0 / LOGARITHMS[quantity]) if quantity in LOGARITHMS else np.abs(values)
    return ListedValues(angles, values, _uncertainty(sheet, of_columns, size, slope, factors))


def _quantities(sheet: TextSheet, columns: Sequence[int], stated: str) -> list[str]:
    """Return the quantity of each column of values: that of its name, or of other names, or of a title."""
    names = [sheet.names[column] for column in columns]
    parts = [value_name(name, sheet.names) for name in names]
    quantities = [each.quantity for each in parts]
    if not stated and UNKNOWN_COSINE in quantities:
        raise sheet.error(
            "the cosine is neither that of the viewer nor that of the light; --quantity f_r_cos divides by the first, "
            "and --quantity f_r_cos_i by the second",
            columns[quantities.index(UNKNOWN_COSINE)],
        )
    distinct = sorted(set(quantities) - {""})
    if len(distinct) > 1 and any(each.wavelength_nm is None for each in parts):
        shown = " and ".join(names[quantities.index(quantity)] for quantity in distinct)
        text = f"{shown} are different quantities; name the columns to read as values: --column values=NAME"
        raise sheet.error(text)
    of_titles = "reflectance_factor" if sheet.layout.title(_OF_FACTORS) else "f_r"
    other = distinct[0] if len(distinct) == 1 else "f_r" if distinct else of_titles
    # f_r is made of a quantity that is stated where the rows become samples
    quantities = ["f_r"] * len(names) if stated else [quantity or other for quantity in quantities]
    sheet.record["quantity"] = next((quantity for quantity in quantities if quantity != "f_r"), "f_r")
    return quantities


def _units(sheet: TextSheet, columns: Sequence[int], quantity: str) -> list[ValueName]:
    """Return what the names of columns of values say, with the factors of their units, that of a title among them.

    A quantity that the user states allows units that are not known.
    """
    names = [sheet.described[column] for column in columns]
    parts = [value_name(name, sheet.names) for name in names]
    for column, name, (_, logarithm, _, unit, _) in zip(columns, names, parts, strict=True):
        fault = ""
        if logarithm == "log" and not quantity:
            fault = f"the base of the logarithms of {name!r} is not known; state --quantity log10 or --quantity ln"
        elif logarithm and quantity not in ("", *LOGARITHMS):
            fault = f"values are logarithms; --quantity {', '.join(LOGARITHMS)} says which, or write f_r itself"
        elif unit and not quantity:
            known = "known are 1/sr, 1/msr, % and these times a power of ten such as 10^-3"
            fault = f"the unit {unit!r} is not known; {known}; --quantity f_r takes numbers as they stand"
        if fault:
            raise sheet.error(fault, column)
        if unit:
            sheet.note(f"The unit {unit!r} of the column {name} is not known: its numbers were taken as they stand.")
    percent = any(PERCENT.search(name) for name in names)
    if sheet.layout.title(_OF_PERCENT, but=_OF_UNCERTAINTY) and not any("[" in name or "(" in name for name in names):
        parts = [each._replace(factor=0.01) for each in parts]
        percent = True
    if percent:
        sheet.note("Values in percent were divided by 100.")
    elif factors := sorted({each.factor for each in parts} - {1.0}):
        shown = " and ".join(f"{factor:g}" for factor in factors)
        sheet.note(f"Values were multiplied by {shown}, as their unit says.")
    return parts


def _uncertainty(sheet: TextSheet, numbers: Array, size: Array, slope: Array, factors: Array) -> Array:
    """Return the standard uncertainties (N, C) [1/sr] of the numbers of their columns.

    Those without a unit share that of the values: f_r has a `slope` (N, C) over numbers in units of `factors` (C,).
    Relative ones are multiplied by `size` (N, C). FileFormatError if one is negative, or the factor k of a name is 0 or
    missing beside a probability.
    """
    columns = sheet.roles["uncertainty"]
    names = [sheet.described[column] for column in columns]
    if np.any(negative := numbers < 0.0):
        row, place = np.argwhere(negative)[0].tolist()
        text = f"{numbers[row, place]:g} is below 0; an uncertainty is positive, or empty"
        raise sheet.error(text, columns[place], row)
    shown = f"column {names[0]}" if len(names) == 1 else f"columns {', '.join(names)}"
    sheet.note(f"Standard uncertainties were read from the {shown[:SHOWN]}.")
    shares, coverages = np.zeros(len(names)), np.ones(len(names))
    own = factors.copy()
    for place, (column, name) in enumerate(zip(columns, names, strict=True)):
        coverage = _COVERAGE.search(name)
        if coverage is None and _PROBABILITY.search(name):
            raise sheet.error("a probability is not a unit; write the coverage factor, such as U (k=2)", column)
        coverages[place] = float(coverage[1] or coverage[2]) if coverage else 1.0
        if coverages[place] == 0.0:
            raise sheet.error("the coverage factor k is 0; allowed are positive numbers", column)
        unit = _COVERAGE.sub("", _PROBABILITY.sub("", name))
        shares[place] = 0.01 if PERCENT.search(unit) else 1.0 if _RELATIVE.search(unit) else 0.0
        if shares[place]:
            continue
        factor, unknown = scale_of(unit)
        if unknown:
            sheet.note(f"The unit {unknown!r} of the column {name} is not known: its numbers were taken as they stand.")
        elif any("sr" in text.lower() for text in units_in(unit)):
            own[place] = factor
    if 0.01 in shares:
        sheet.note("Uncertainties in percent were taken as percent of the values of their rows.")
    if 1.0 in shares:
        sheet.note("Relative uncertainties were multiplied by the values of their rows.")
    if expanded := sorted(set(coverages.tolist()) - {1.0}):
        text = " and ".join(f"{k:g}" for k in expanded)
        sheet.note(f"Expanded uncertainties were divided by their coverage factor k, {text}.")
    return np.asarray(np.where(shares > 0.0, shares * numbers * size, numbers * own * slope) / coverages)


def without_products(sheet: TextSheet, quantity: str, angles: Array) -> list[int]:
    """Return the column of f_r alone if others are its products or logarithms, as their names and numbers say."""
    columns = list(sheet.roles["values"])
    parts = [value_name(sheet.described[column], sheet.names) for column in columns]
    of_f_r = [each.quantity == "f_r" and not each.logarithm for each in parts]
    known_quantities = {each.quantity for each in parts} <= {"f_r", *_OF_F_R}
    if quantity or len(columns) == 1 or of_f_r.count(True) != 1 or not known_quantities:
        return columns
    first = columns[of_f_r.index(True)]
    f_r = sheet.numbers[:, first] * parts[of_f_r.index(True)].factor
    for column, (other, logarithm, scale, *_) in zip(columns, parts, strict=True):
        numbers = sheet.numbers[:, column] * scale
        if logarithm:
            numbers = np.exp(numbers * LOGARITHMS.get(logarithm, LOGARITHMS["log10"]))
        factor = factor_of_quantity(other, angles[:, 0], angles[:, 2])
        known = (f_r > 0.0) & np.isfinite(numbers) & np.isfinite(factor)
        if not known.any() or np.median(np.abs(numbers[known] / (factor * f_r)[known] - 1.0)) > _AGREE:
            return columns
    others = ", ".join(sheet.names[column] for column in columns if column != first)
    sheet.note(f"{sheet.names[first]} was read; {others} agrees with it.")
    return [first]


def wavelengths_of_names(sheet: TextSheet) -> Array | None:
    """Return the wavelengths [nm] that names of columns of values give; None if one gives none."""
    names = [sheet.names[column] for column in sheet.roles["values"]]
    lengths = [wavelength_of(name) for name in names]
    if None in lengths:
        return None
    at = np.array(lengths, dtype=np.float64)
    if len(names) == 1 and re.fullmatch(r"\D+10+", names[0]):
        text = f"the number in {names[0]!r} may be a wavelength or a factor; write it with a unit, such as BRDF_1000nm"
        raise sheet.error(f"{text} or BRDF [10^-3/sr]")
    if at.min() < _LEAST_NM or any(name.startswith("-") for name in names):
        raise sheet.error(f"{', '.join(names)}: a wavelength is less than 10 nm")
    sheet.note("Wavelengths are those in the names of the columns.")
    distinct, counts = np.unique(at, return_counts=True)
    if twice := [f"{nm:g} nm" for nm in distinct[counts > 1]]:
        sheet.note(f"Columns of the same wavelength, {', '.join(twice)}, were read as repeated measurements.")
    return at


def wavelengths_of_rows(sheet: TextSheet, unit: str) -> Array:
    """Return the wavelengths (N,) [nm] of a column, by the unit that the user or its name gives, or by their size."""
    column = sheet.roles["wavelength"][0]
    name = sheet.described[column]
    lengths = sheet.numbers[:, column]
    if np.any(np.isnan(lengths)):
        raise sheet.error("a wavelength is missing", column, int(np.argmax(np.isnan(lengths))))
    product = spectral_unit(name)
    if product is not None and unit:
        raise ParameterError("wavelength_unit", f"{name} of {sheet.path} is no column of wavelengths", unit)
    if title := "" if unit or length_unit(name) else sheet.layout.title(_OF_ANGSTROM):
        text = f"a title says {title!r}: angstroms are not read; allowed are nm, um and m"
        raise sheet.error(text, column)
    if product is not None:
        sheet.note(f"Wavelengths were made of the column {name}.")
        return np.round(product / np.where(lengths > 0.0, lengths, np.nan), 4)
    unit_nm = NM_PER[unit] if unit else length_unit(name)
    if unit_nm is None and (units := units_in(name)):
        text = f"the unit {units[0]!r} is not a unit of wavelengths; allowed are nm, um and m"
        raise sheet.error(text, column)
    low, high = float(lengths.min()), float(lengths.max())
    if unit_nm is None and low < _LEAST_NM <= _LEAST_UM <= high:
        raise sheet.error(f"{low:g} and {high:g} have no unit in common; write it into the name", column)
    if unit_nm is None and high < _LEAST_UM:
        unit_nm, word = (1e9, "metres") if high < 1e-3 else (1e3, "micrometres")
        numbers = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        end = f"a name such as {plain_name(name)}_nm would say otherwise"
        sheet.note(f"The column {name} gives no unit: its numbers, {numbers}, were taken as {word}; {end}.")
    else:
        sheet.note(f"Wavelengths are those of the column {name}.")
    return np.round(lengths * (unit_nm or 1.0), 6)
