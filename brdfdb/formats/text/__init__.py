"""Text of other programs: one row for each pair of directions, with commas, tabs, semicolons or spaces.

Columns are recognised by their names, such as ``theta_i``, ``sza``, ``view_z``, ``raa`` or ``550nm``, or the caller
names them. Titles may stand before the names. Values are f_r in 1/sr, reflectance factors (pi f_r), or f_r times the
cosine of the viewer or the light.
"""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats._input import check_text, lines_of
from brdfdb.formats._nodes import samples_at_angles, without_fill_values
from brdfdb.formats._record import note, of_comments
from brdfdb.formats.text._angles import angles_of_rows
from brdfdb.formats.text._columns import (
    ANGLES,
    PERCENT,
    QUANTITIES,
    UNKNOWN_COSINE,
    TextLayout,
    is_logarithm,
    layout_of,
    length_unit,
    plain_name,
    quantity_of,
    roles_of,
    scale_of,
    units_in,
    wavelength_of,
)
from brdfdb.formats.text._rows import doubt_end, line_of_row, rows_of
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.measurements.samples import Samples

Array = NDArray[np.float64]

suffix = ".txt"
_MOST_BYTES = 1 << 28  # of a file that is read
_LONGEST_TITLE = 1000  # lines before the first row
_ROLES = (*ANGLES, "values", "uncertainty", "wavelength")
keywords = (*_ROLES, "quantity", "angles")
_UNITS = ("auto", "deg", "rad")
_LEAST_NM, _LEAST_UM = 10.0, 100.0  # numbers without a unit below the first are not nm, from the second on not um
HOW = "theta_i=NAME and so on, at the command line --column theta_i=NAME"  # columns are named
_OF_COSINE = re.compile(r"\b(?:times|multiplied|including|with)\b.{0,20}\bcos(?:ine)?\b|\* ?cos\b", re.IGNORECASE)
_OF_FORWARD = re.compile(r"\b(?:azimuths?|phi)\b.*\b0\b[^\d,;]*\b(?:forward|specular|mirror)\b", re.IGNORECASE)
_NO = re.compile(r"\b(?:no|not|without|divided|excluding)\b", re.IGNORECASE)
_GRAZING = 1e-6  # cosine below which f_r cannot be made of f_r times it
_SHOWN = 200  # characters of names that a sentence repeats
_COVERAGE = re.compile(r"\bk ?= ?(\d+(?:\.\d+)?)[ ,;]*")
_RELATIVE = re.compile(r"[\[(]rel(?:ative|\.)?[\])]", re.IGNORECASE)
_PROBABILITY = re.compile(r"\d+(?:\.\d+)? ?(?:%|percent\b)")  # of an interval, such as U (95 %)


class ListedValues(NamedTuple):
    """Angles (N, 4) [rad], f_r (N, C) [1/sr] and its uncertainties of the rows of a text."""

    angles: Array
    values: Array
    uncertainty: Array | None

    def pivoted(self, at: Array) -> ListedValues:
        """Return rows with a column a wavelength, of rows that have one wavelength each; what is missing is nan."""
        wavelengths, channel = np.unique(np.round(at, 6), return_inverse=True)
        pairs, first, pair = np.unique(np.round(self.angles, 9), axis=0, return_index=True, return_inverse=True)
        cell = pair.reshape(-1) * wavelengths.size + channel.reshape(-1)
        order = np.argsort(cell, kind="stable")
        starts = np.flatnonzero(np.append(True, np.diff(cell[order]) > 0))
        again: NDArray[np.intp] = np.empty(len(cell), dtype=np.intp)  # number of earlier measurements of the same
        again[order] = np.arange(len(cell)) - np.repeat(starts, np.diff(np.append(starts, len(cell))))
        row = again * len(pairs) + pair.reshape(-1)
        count = (again.max() + 1) * len(pairs)

        def table(column: Array) -> Array:
            grid = np.full((count, wavelengths.size), np.nan)
            grid[row, channel.reshape(-1)] = column[:, 0]
            return grid

        wide = table(self.values)
        known = np.flatnonzero(np.any(np.isfinite(wide), axis=1))
        uncertainty = None if self.uncertainty is None else table(self.uncertainty)[known]
        return ListedValues(self.angles[first][known % len(pairs)], wide[known], uncertainty)


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a text whose columns have names of angles and values."""
    layout = _layout_of_head(head)
    return layout is not None and not _missing(roles_of(layout.names))


def columns_of(head: bytes) -> tuple[str, ...]:
    """Return the names of the columns in the first bytes of a text, their numbers if they have none."""
    layout = _layout_of_head(head)
    return () if layout is None else layout.names


def _layout_of_head(head: bytes) -> TextLayout | None:
    """Return the layout of a text by its first bytes, without a line that they may cut; None of any other file."""
    if b"\0" in head and not head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return None
    encoding = "utf-16" if head.startswith((b"\xff\xfe", b"\xfe\xff")) else "utf-8-sig"
    lines = head[: len(head) // 2 * 2].decode(encoding, "replace").splitlines(keepends=True)
    return layout_of(enumerate(lines if len(head) < 4096 else lines[:-1], 1))


def read(
    path: str | os.PathLike[str], *, quantity: str = "auto", angles: str = "auto", **columns: str | Sequence[str]
) -> Samples:
    """Return the samples of a text.

    Parameters
    ----------
    quantity : {"auto", "f_r", "reflectance_factor", "f_r_cos", "f_r_cos_i"}
        Quantity of the values: f_r_cos is f_r times the cosine of the viewer, f_r_cos_i that of the light. By default
        the one that names or titles give, such as BRF, and else f_r. With a quantity, numbers whose unit is not known
        are taken as they stand.
    angles : {"auto", "deg", "rad"}
        Unit of the angles. By default the one that names, or a row of units below them, give (mrad, too), and else
        degrees; the record has a note where the numbers may be radians as well.
    **columns : str or sequence of str
        Names of columns for theta_i, phi_i, theta_r, phi_r, delta_phi, values, uncertainty and wavelength; numbers from
        1 in a text without names. A role that is not given is recognised by names.

    Returns
    -------
    Samples
        Reflectance factors are divided by pi, f_r_cos by the cosine of theta_r and f_r_cos_i by that of theta_i. A
        negative polar angle is one at the opposite azimuth; without azimuths, it is one on the other side of the plane
        of incidence. Where theta of most rows exceeds 90 degrees and phi of none does, the file has exchanged the two
        letters, and the record says so. Uncertainties that are relative, or expanded by a factor k, are made standard
        ones in 1/sr. Values that contradict at the same directions are an entry "contradiction" of the record.

    A FileFormatError names the line and the field: of a missing column, of a unit of angles or values that is not
    known, or of rows below a comment that changes their wavelength, columns or units.
    """
    from brdfdb.measurements.joining import contradiction_within

    path = path_of(path)
    check_text(path, _MOST_BYTES)
    for name, value, allowed in (("quantity", quantity, ("auto", *QUANTITIES)), ("angles", angles, _UNITS)):
        if value not in allowed:
            raise ParameterError(name, f"{value!r} is not one of {', '.join(allowed)}", value, allowed)
    layout = _layout(path)
    roles = _roles(path, layout, columns)
    rows = rows_of(path, layout, one_wavelength="wavelength" not in roles and len(roles["values"]) == 1)
    record: dict[str, Any] = {"titles": list(layout.titles)} if layout.titles else {}
    turned = angles_of_rows(path, rows, roles, layout, angles, record)
    doubt_end(path, np.rad2deg(turned[:, :2]), record)
    names = [layout.names[column] for column in roles["values"]]
    table = _values(path, rows, roles, layout, quantity, turned, record)
    at = _wavelengths(path, names, layout)
    if "wavelength" in roles:
        if table.values.shape[1] != 1:
            raise FileFormatError(
                f"{path}: line {layout.line}: a text with a column of wavelengths may have only one column of values"
            )
        lengths = _nm(path, rows[:, roles["wavelength"][0]], layout.described[roles["wavelength"][0]], layout, record)
        at = np.unique(np.round(lengths, 6))
        table = table.pivoted(lengths)
    elif at is not None:
        note(record, "Wavelengths are those in the names of the columns.")
        order = np.argsort(at)
        at = at[order]
        uncertainty = None if table.uncertainty is None else table.uncertainty[:, order]
        table = table._replace(values=table.values[:, order], uncertainty=uncertainty)
    _doubt_titles(layout, quantity, record)
    instrument, length = of_comments({"titles": "\n".join(layout.titles)})
    if at is None and len(names) == 1 and length is not None:
        at = np.array([length])
        note(record, f"The wavelength {length:g} nm was read from the titles of the file.")
    channels = [f"{nm:g}nm" for nm in at] if at is not None else ["grey"] if len(names) == 1 else names
    channels = ["R", "G", "B"] if channels == ["r", "g", "b"] else channels
    left = set(range(len(layout.names))) - {column for columns_ in roles.values() for column in columns_}
    if left:
        record["columns_left_out"] = [layout.names[column] for column in sorted(left)]
    listed = samples_at_angles(
        table.angles,
        table.values,
        path.stem,
        channels,
        at,
        record,
        uncertainty=table.uncertainty,
        instrument=instrument,
    )
    contradiction = contradiction_within(listed)
    return replace(listed, record={**listed.record, "contradiction": contradiction}) if contradiction else listed


def _layout(path: Path) -> TextLayout:
    """Return the layout of a text; FileFormatError if it has no row, or its first row is damaged."""
    layout = layout_of(itertools.islice(lines_of(path), _LONGEST_TITLE))
    if layout is None:
        for number, line in itertools.islice(lines_of(path), _LONGEST_TITLE):
            if not _missing(roles_of([name for part in line.split(",") for name in part.split()])):
                raise FileFormatError(f"{path}: line {number} has the names of columns, but no row of numbers follows")
        raise FileFormatError(
            f"{path}: line 1: none of the first {_LONGEST_TITLE} lines is a row of numbers, three below names or four"
        )
    if layout.damaged:
        raise FileFormatError(f"{path}: {layout.damaged}")
    return layout


def _roles(path: Path, layout: TextLayout, columns: Mapping[str, str | Sequence[str]]) -> dict[str, list[int]]:
    """Return the columns of each role: those that the caller names, and others by their names."""
    shown = ", ".join(layout.names)[:_SHOWN]
    given: dict[str, list[int]] = {}
    for role, wanted in columns.items():
        if role not in _ROLES:
            raise ParameterError(role, f"columns may be given for {', '.join(_ROLES)}", wanted, _ROLES)
        names = [wanted] if isinstance(wanted, str) else list(wanted)
        for name in names:
            if name not in layout.names:
                raise ParameterError(role, f"{name!r} is not a column of {path}, which has {shown}", name, layout.names)
        given[role] = [layout.names.index(name) for name in names]
    used = {column for numbers in given.values() for column in numbers}
    known = {role: [n for n in numbers if n not in used] for role, numbers in roles_of(layout.names).items()}
    if "delta_phi" in given or "phi_r" in given:
        known.pop("phi_r" if "delta_phi" in given else "delta_phi", None)
    elif {"phi_r", "delta_phi"} <= set(known):  # without phi_i, phi_r may count from any direction
        known.pop("delta_phi" if "phi_i" in known or "phi_i" in given else "phi_r")
    roles = {role: numbers for role, numbers in (known | given).items() if numbers}
    if missing := _missing(roles):
        raise FileFormatError(f"{path}: line {layout.line}: no column is {missing}, among {shown}; name it: {HOW}")
    for role in (*ANGLES, "wavelength"):
        if len(roles.get(role, ())) > 1:
            names = [layout.names[column] for column in roles[role]]
            raise FileFormatError(
                f"{path}: line {layout.line}: {' and '.join(names)} are both {role}; name the column to read"
            )
    return roles


def _missing(roles: Mapping[str, list[int]]) -> str:
    """Return the roles that a text cannot do without and that are missing, as text."""
    return ", ".join(role for role in ("theta_i", "theta_r", "values") if role not in roles)


def _scale(
    path: Path, names: Sequence[str], layout: TextLayout, quantity: str, angles: Array, record: dict[str, Any]
) -> Array:
    """Return the factors, shape (N, C) or (1, C), that make f_r of values: each column has the quantity of its name."""
    quantities = [quantity_of(name, layout.names) for name in names]
    if quantity == "auto" and UNKNOWN_COSINE in quantities:
        where = f"line {layout.line}, field {names[quantities.index(UNKNOWN_COSINE)]}"
        text = "the cosine is neither that of the viewer nor that of the light; --quantity f_r_cos divides by the first"
        raise FileFormatError(f"{path}: {where}: {text}, and --quantity f_r_cos_i by the second")
    distinct = sorted(set(quantities) - {""})
    if len(distinct) > 1 and any(wavelength_of(name) is None for name in names):
        shown = " and ".join(next(n for n, q in zip(names, quantities, strict=True) if q == one) for one in distinct)
        raise FileFormatError(
            f"{path}: line {layout.line}: {shown} are different quantities; name the columns to read as values"
        )
    if quantity != "auto":
        quantities = [quantity] * len(names)
    other = distinct[0] if len(distinct) == 1 else "f_r"  # of names that give none
    if not distinct and layout.names_factors:
        other = "reflectance_factor"
    quantities = [one or other for one in quantities]
    record["quantity"] = next((one for one in quantities if one != "f_r"), "f_r")
    of_light, of_viewer = (
        np.where(cosine > _GRAZING, 1.0 / np.maximum(cosine, _GRAZING), np.nan)
        for cosine in np.cos(angles[:, [0, 2]]).T
    )
    of_quantity = {
        "f_r": np.ones_like(of_light),
        "reflectance_factor": np.full_like(of_light, 1.0 / np.pi),
        "f_r_cos": of_viewer,
        "f_r_cos_i": of_light,
    }
    return np.stack([of_quantity[one] for one in quantities], axis=1)


def _values(
    path: Path,
    rows: Array,
    roles: Mapping[str, list[int]],
    layout: TextLayout,
    quantity: str,
    angles: Array,
    record: dict[str, Any],
) -> ListedValues:
    """Return f_r [1/sr] of rows at their angles, shape (N, C), and their uncertainties if there are any.

    A unit that is not known is refused, unless the user has stated the quantity.
    """
    scale = _scale(path, [layout.names[column] for column in roles["values"]], layout, quantity, angles, record)
    names = {role: [layout.described[column] for column in roles.get(role, ())] for role in ("values", "uncertainty")}
    factors = []
    for name in names["values"]:
        factor, unit = scale_of(name)
        where = f"{path}: line {layout.line}, field {name}"
        if is_logarithm(name):
            raise FileFormatError(f"{where}: values are logarithms; write f_r itself")
        if unit and quantity == "auto":
            known = "known are 1/sr, 1/msr, % and these times a power of ten such as 10^-3"
            raise FileFormatError(
                f"{where}: the unit {unit!r} is not known; {known}; --quantity f_r takes numbers as they stand"
            )
        if unit:
            note(record, f"The unit {unit!r} of the column {name} is not known: its numbers were taken as they stand.")
        factors.append(factor)
    percent = any(PERCENT.search(name) for name in names["values"])
    if layout.names_percent and not any("[" in name or "(" in name for name in names["values"]):
        factors = [0.01] * len(factors)
        percent = True
    if percent:
        note(record, "Values in percent were divided by 100.")
    elif any(factor != 1.0 for factor in factors):
        shown = " and ".join(f"{factor:g}" for factor in sorted(set(factors)))
        note(record, f"Values were multiplied by {shown}, as their unit says.")
    of_values = np.array(factors) * scale
    values: Array = without_fill_values(rows[:, roles["values"]]) * of_values
    if "uncertainty" not in roles:
        return ListedValues(angles, values, None)
    given = rows[:, roles["uncertainty"]]
    if given.shape != values.shape:
        raise FileFormatError(
            f"{path}: line {layout.line}: the columns of uncertainties are not as many as those of values"
        )
    where = f"{path}: line {layout.line}"
    uncertainty = uncertainty_of(where, names["uncertainty"], given, values, scale, np.array(factors), record)
    return ListedValues(angles, values, uncertainty)


def _doubt_titles(layout: TextLayout, quantity: str, record: dict[str, Any]) -> None:
    """Note titles that speak of a cosine or of the forward direction, where the values were read without."""
    for line in layout.titles:
        shown = line.strip()[:_SHOWN]
        if quantity == "auto" and record["quantity"] == "f_r" and _OF_COSINE.search(line) and not _NO.search(line):
            text = "were read as f_r; --quantity f_r_cos divides by the cosine of the viewer, f_r_cos_i by the light's"
            note(record, f"Cosine? A title says {shown!r}, and values {text}.")
        if _OF_FORWARD.search(line) and not _NO.search(line):
            record["forward_title"] = shown


def _wavelengths(path: Path, names: Sequence[str], layout: TextLayout) -> Array | None:
    """Return the wavelengths [nm] that names of columns give; None if one gives none."""
    lengths = [wavelength_of(name) for name in names]
    if None in lengths:
        return None
    at = np.array(lengths, dtype=np.float64)
    if np.unique(at).size != at.size:
        raise FileFormatError(f"{path}: line {layout.line}: a wavelength is listed twice")
    if at.min() < _LEAST_NM or any(name.startswith("-") for name in names):
        raise FileFormatError(f"{path}: line {layout.line}: {', '.join(names)}: a wavelength is less than 10 nm")
    return at


def _nm(path: Path, lengths: Array, name: str, layout: TextLayout, record: dict[str, Any]) -> Array:
    """Return wavelengths in nm, by the unit that a name gives, or by their size."""
    where = f"{path}: line {layout.line}, field {name}"
    if np.any(np.isnan(lengths)):
        line = line_of_row(path, layout, int(np.argmax(np.isnan(lengths))))
        raise FileFormatError(f"{path}: line {line}, field {name}: a wavelength is missing")
    unit_nm = length_unit(name)
    word = ""
    if unit_nm is None:
        if units := units_in(name):
            raise FileFormatError(
                f"{where}: the unit {units[0]!r} is not a unit of wavelengths; allowed are nm, um and m"
            )
        low, high = float(lengths.min()), float(lengths.max())
        if low < _LEAST_NM <= _LEAST_UM <= high:
            raise FileFormatError(f"{where}: {low:g} and {high:g} have no unit in common; write it into the name")
        unit_nm, word = (1e9, "metres") if high < 1e-3 else (1e3, "micrometres") if high < _LEAST_UM else (1.0, "")
    if word:
        of_numbers = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        end = f"a name such as {plain_name(name)}_nm would say otherwise"
        note(record, f"The column {name} gives no unit: its numbers, {of_numbers}, were taken as {word}; {end}.")
    else:
        note(record, f"Wavelengths are those of the column {name}.")
    return np.asarray(lengths * unit_nm)


def uncertainty_of(
    where: str,
    names: Sequence[str],
    given: NDArray[np.float64],
    values: NDArray[np.float64],
    scale: NDArray[np.float64],
    factors: NDArray[np.float64],
    record: dict[str, Any],
) -> NDArray[np.float64]:
    """Return the standard uncertainties [1/sr] of values (N, C), of the numbers of their columns.

    `names` are the names of the columns with their units. `scale` makes f_r of the quantity of the values, and
    `factors` of their units, which uncertainties without a unit share. Notes of the record say how the columns were
    read; `where`, the file and the line of the names, begins the sentence on a name with a probability and no factor k,
    or with a k of 0.
    """
    columns = f"column {names[0]}" if len(names) == 1 else f"columns {', '.join(names)}"
    note(record, f"Standard uncertainties were read from the {columns[:_SHOWN]}.")
    shares = []
    coverages = []
    own = np.broadcast_to(factors, len(names)).copy()
    for column, name in enumerate(names):
        coverage = _COVERAGE.search(name)
        field = f"{where}, field {name}"
        if coverage is None and _PROBABILITY.search(name):
            raise FileFormatError(f"{field}: a probability is not a unit; write the coverage factor, such as U (k=2)")
        coverages.append(1.0 if coverage is None else float(coverage[1]))
        if coverages[-1] == 0.0:
            raise FileFormatError(f"{field}: the coverage factor k is 0; allowed are positive numbers")
        unit = _COVERAGE.sub("", _PROBABILITY.sub("", name))
        shares.append(0.01 if PERCENT.search(unit) else 1.0 if _RELATIVE.search(unit) else 0.0)
        factor, unknown = scale_of(unit)
        if shares[-1]:
            continue
        if unknown:
            note(
                record, f"The unit {unknown!r} of the column {name} is not known: its numbers were taken as they stand."
            )
        elif any("sr" in text.lower() for text in units_in(unit)):
            own[column] = factor
    if 0.01 in shares:
        note(record, "Uncertainties in percent were taken as percent of the values of their rows.")
    if 1.0 in shares:
        note(record, "Relative uncertainties were multiplied by the values of their rows.")
    if expanded := sorted({k for k in coverages if k != 1.0}):
        shown = " and ".join(f"{k:g}" for k in expanded)
        note(record, f"Expanded uncertainties were divided by their coverage factor k, {shown}.")
    relative = np.array(shares)
    in_1_sr = np.where(relative > 0.0, relative * given * np.abs(values), given * own * scale)
    return np.asarray(in_1_sr / np.array(coverages))
