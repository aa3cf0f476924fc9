"""Text of other programs: one row for each pair of directions, with commas, tabs, semicolons or spaces.

Columns are recognised by their names, such as ``theta_i``, ``sza``, ``view_z``, ``raa`` or ``550nm``, or the caller
names them. Titles may stand before the names. Values are f_r in 1/sr, reflectance factors (pi f_r), or f_r times the
cosine of the viewer or the light.
"""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats._channels import RGB, XYZ
from brdfdb.formats._doubts import doubt_comments, doubt_last_light
from brdfdb.formats._input import HEAD, check_text, encoding_of, lines_of
from brdfdb.formats._record import of_comments
from brdfdb.formats.text._angles import angles_of_rows, lobe_of
from brdfdb.formats.text._blocks import assigned_in
from brdfdb.formats.text._columns import ANGLES, BRACKETS, element_columns, plain_name, roles_of, scale_of, state_of
from brdfdb.formats.text._layout import EMPTY, FEWEST, SHOWN, TextLayout, layout_of, missing_roles
from brdfdb.formats.text._rows import rows_of
from brdfdb.formats.text._selection import (
    check_words,
    explained,
    light_of,
    matrices_of,
    polarisation_columns,
    states_of,
    unpolarised,
)
from brdfdb.formats.text._sheet import TextSheet, distinct
from brdfdb.formats.text._values import (
    Array,
    ListedValues,
    values_of,
    wavelengths_of_names,
    wavelengths_of_rows,
    without_products,
)
from brdfdb.measurements.conventions import FROM_LIGHT, LOGARITHMS, QUANTITIES, ListedRows
from brdfdb.place import path_of

suffix = ".txt"
angle_unit = "deg"
_MOST_BYTES = 1 << 28  # of a file that is read
_LONGEST_TITLE = 1000  # lines before the first row
_ROLES = (*ANGLES, "values", "uncertainty", "wavelength")
keywords = (*_ROLES, "quantity", "angles", "wavelength_unit", "where", "missing")
_NO_VECTORS = "; directions as vectors or cosines are not read"
HOW = f"--column theta_i=NAME --column theta_r=NAME --column values=NAME{_NO_VECTORS}"
_OF_FORWARD = re.compile(r"\b(?:azimuths?|phi(?:_\w+)?)\b.*\b0\b[^\d,;]*\b(?:forward|specular|mirror)\b", re.IGNORECASE)
_NO = re.compile(r"\b(?:no|not|without|divided|excluding)\b", re.IGNORECASE)


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a text whose columns have names of angles and values."""
    layout = _layout_of_head(head)
    if layout is None or layout.heads is not None:
        return layout is not None
    of_lines = (given.role for line in layout.lines for given in assigned_in(line))
    return not missing_roles({*roles_of(layout.names), *of_lines})


def nearly_recognises(head: bytes) -> bool:
    """Return True for the first bytes of a text with names of two of values and the two polar angles."""
    layout = _layout_of_head(head)
    return layout is not None and len(missing_roles(roles_of(layout.names))) < 2


def columns_of(head: bytes) -> tuple[str, ...]:
    """Return the names of the columns in the first bytes of a text, their numbers if they have none."""
    layout = _layout_of_head(head) or _layout_of_head(head, 3)
    return () if layout is None else layout.names


@lru_cache(maxsize=2)  # of the file that is being recognised
def _layout_of_head(head: bytes, fewest: int = FEWEST) -> TextLayout | None:
    """Return the layout of a text by its first bytes, without a line that they may cut; None of any other file."""
    encoding = encoding_of(head)
    if encoding is None:
        return None
    lines = head[: len(head) // 2 * 2].decode(encoding, "replace").splitlines(keepends=True)
    return layout_of(enumerate(lines if len(head) < HEAD else lines[:-1], 1), fewest=fewest)


def read(
    path: str | os.PathLike[str],
    *,
    quantity: str = "",
    angles: str = "",
    wavelength_unit: str = "",
    where: Mapping[str, str | Sequence[str]] | None = None,
    missing: float | None = None,
    **columns: str | Sequence[str],
) -> ListedRows:
    """Return the rows of a text.

    Other parameters are those of `brdfdb.formats.read`. By default quantity and units are those of names, of a row of
    units below them, or of titles, such as BRF; angles are in degrees else, and wavelengths in the unit of their size.

    Parameters
    ----------
    where : mapping of str to str or sequence of str, optional
        Values of columns, by name or role: only rows that have one of them are read.
    **columns : str or sequence of str
        Names of columns for theta_i, phi_i, theta_r, phi_r, delta_phi, from_specular (theta_r minus theta_i in the
        plane of incidence), rotation (of the sample), values, uncertainty and wavelength; numbers from 1 in a text
        without names. A role that is not given is recognised by names.

    Returns
    -------
    ListedRows
        f_r, unless the user states a quantity. A negative polar angle is one at the opposite azimuth; without azimuths,
        viewers are in the plane of incidence, and positive theta_r is on the mirror side. Where theta of most rows
        exceeds 90 degrees and phi of none does, the file has exchanged the two letters, and the record says so.
        Uncertainties are standard ones in 1/sr. Of rows of s and p the mean is read, with entries "polarisation" and
        "polarisation_column" in the record.

    A FileFormatError names the line and the field: of a missing column, of a unit of angles or values that is not
    known, of a column with several words of which one is to be chosen, or of rows below a line that changes their
    columns or units.
    """
    path = path_of(path)
    check_text(path, _MOST_BYTES)
    given = {role: [names] if isinstance(names, str) else list(names) for role, names in columns.items()}
    roles: dict[str, str] = {}
    for role, names in given.items():
        for name in names:
            if roles.setdefault(name, role) != role:
                raise ParameterError(role, f"the column {name!r} is given for {roles[name]}, too", name)
    wanted = {name for names in given.values() for name in names}
    layout = _layout(path, wanted)
    record: dict[str, Any] = {"titles": layout.titles} if layout.lines else {}
    sheet = _one_state_a_row(rows_of(path, layout, record, wanted), given)
    sheet = replace(sheet, roles=_roles(sheet, given)).where(where or {})
    states = states_of(sheet)
    check_words(sheet)
    if wavelength_unit and "wavelength" not in sheet.roles:
        raise ParameterError("wavelength_unit", f"{path} has no column of wavelengths", wavelength_unit)
    turned = angles_of_rows(sheet, angles)
    doubt_last_light(path, np.rad2deg(turned[:, :2]), record)
    sheet = replace(sheet, roles={**sheet.roles, "values": without_products(sheet, quantity, turned)})
    table = values_of(sheet, turned, quantity, missing)
    channels = [sheet.names[column] for column in sheet.roles["values"]]
    if "mueller" in sheet.roles and len(channels) == 1:
        table = table._replace(mueller=matrices_of(sheet))
    lengths: Array = np.zeros(len(sheet.lines))
    if "wavelength" in sheet.roles:
        if len(channels) > 1:
            raise sheet.error("a text with a column of wavelengths may have only one column of values")
        lengths = wavelengths_of_rows(sheet, wavelength_unit)
    keys = np.column_stack([np.rad2deg(turned), lengths])
    if len(set(states)) > 1:
        if quantity in LOGARITHMS:
            name = sheet.name("polarisation")
            text = f"values are stated to be {quantity}, and rows of s and p have no mean then"
            raise ParameterError("quantity", f"{path}: {text}; --where {name}=s reads one polarisation", quantity)
        rows, table = unpolarised(sheet, table, keys, states)
        sheet, keys = sheet.selected(rows), keys[rows]
    elif states:
        record["polarisation"] = states[0]
        sheet.note(f"All rows have the polarisation {states[0]}.")
    unread = [n for n, name in enumerate(sheet.names) if not (name.startswith(EMPTY) and sheet.is_empty(n))]
    unread = [column for column in unread if column not in sheet.used]
    explanation = explained(sheet, unread, keys, table.mean)
    if unread:
        record.setdefault("columns_left_out", []).extend(sheet.names[column] for column in unread)
    at = keys[:, 4:] if "wavelength" in sheet.roles else wavelengths_of_names(sheet)
    table = table if at is None else table.with_channels(at)
    known = (*QUANTITIES, quantity) if quantity or record["quantity"] != "f_r" else ("percent",)
    scaled = any(scale_of(sheet.described[column])[0] != 1.0 for column in sheet.roles["values"])
    doubt_comments(layout.titles, record, (*known, "factor") if scaled else known)
    if title := layout.title(_OF_FORWARD, but=_NO):
        record["forward_title"] = title
    listed = _listed(sheet, table, channels, at, named="values" in given)
    refused = () if "wavelength" in sheet.roles else ("--wavelength-unit",)
    rows_each = _rows_each(sheet, table, states)
    return replace(listed, wavelength_unit=wavelength_unit, explanation=explanation, refused=refused, rows=rows_each)


def _rows_each(sheet: TextSheet, table: ListedValues, states: Sequence[str]) -> NDArray[np.int64]:
    """Return the number of rows of the file (N,) that each row of values was made of, over wavelengths and states."""
    of_states = 1 if "polarised_columns" in sheet.record else max(len(set(states)), 1)
    known = np.isfinite(table.values)
    return np.asarray(of_states * (known.sum(axis=1) if "wavelength" in sheet.roles else np.ones(len(known))), np.int64)


def _listed(
    sheet: TextSheet, table: ListedValues, channels: Sequence[str], lengths: Array | None, *, named: bool
) -> ListedRows:
    """Return rows of values at wavelengths [nm], which may repeat, or that of the titles.

    FileFormatError if several channels are neither these nor colours, unless the user has named them.
    """
    record = sheet.record
    instrument, length = of_comments({"titles": "\n".join(sheet.layout.titles)})
    if lengths is None and len(channels) == 1 and length is not None:
        lengths = np.array([length])
        sheet.note(f"The wavelength {length:g} nm was read from the titles of the file.")
    at = None if lengths is None else np.unique(lengths)
    colours = tuple(BRACKETS.sub("", name).strip().upper() for name in channels)
    if at is not None:
        channels = [f"{nm:g}nm" for nm in at]
    elif len(channels) == 1 or colours in (RGB, XYZ):
        channels = ["grey"] if len(channels) == 1 else colours
    elif not named:
        text = f"{', '.join(channels)[:SHOWN]} are all values, and are neither named by wavelengths, such as 550nm, nor"
        raise sheet.error(f"{text} colours; name the column to read: --column values=NAME")
    if "plane" in record:
        record["lobe"] = lobe_of(table.angles, np.nan_to_num(table.values[:, 0], nan=-1.0))
    instrument = replace(instrument, polarisation=record.get("polarisation") or instrument.polarisation)
    azimuth = record.pop(FROM_LIGHT, "absolute")
    units = {"radians": "rad", "milliradians": "mrad"}
    return ListedRows(
        table.angles - np.outer(table.angles[:, 1], [0.0, 0.0, 0.0, azimuth == "light"]),
        table.values,
        sheet.path.stem,
        channels,
        at,
        record,
        uncertainty=table.uncertainty,
        mueller=table.mueller,
        instrument=instrument,
        angle_unit=units.get(record["angles"], "deg"),
        quantity=record["quantity"],
        azimuth=azimuth,
        relative="azimuths" in record,
        exchanged="exchanged" in record,
    )


def choices(path: str | os.PathLike[str]) -> dict[str, tuple[str, ...]]:
    """Return the distinct words of each column of a text that is no angle, value or wavelength, for `where` of `read`.

    Columns that lines above rows make, such as ``Sample: A``, and states of the polarisation in names of values, such
    as BRDF_s, count, too. Errors as of `read`.
    """
    path = path_of(path)
    sheet = _one_state_a_row(rows_of(path, _layout(path), {}))
    used = {column for numbers in roles_of(sheet.names).values() for column in numbers}
    return {
        name: tuple(distinct(sheet.labels(column))) for column, name in enumerate(sheet.names) if column not in used
    }


def _layout(path: Path, wanted: Collection[str] = ()) -> TextLayout:
    """Return the layout of a text; FileFormatError if it has no row, or its first row is damaged."""
    layout = layout_of(itertools.islice(lines_of(path), _LONGEST_TITLE), wanted)
    if layout is None:
        for number, line in itertools.islice(lines_of(path), _LONGEST_TITLE):
            if not missing_roles(roles_of([name for part in line.split(",") for name in part.split()])):
                raise FileFormatError(f"{path}: line {number} has the names of columns, but no row of numbers follows")
        raise FileFormatError(
            f"{path}: line 1: none of the first {_LONGEST_TITLE} lines is a row of numbers, three below names or four"
        )
    if layout.damaged:
        raise FileFormatError(f"{path}: {layout.damaged}")
    return layout


def _one_state_a_row(sheet: TextSheet, given: Collection[str] = ()) -> TextSheet:
    """Return a sheet whose columns of several polarisations, such as BRDF_s and BRDF_p, are one, and the state another.

    It stays if there is a column of the quantity alone, or values are among the roles that the caller names.
    """
    of_states: dict[str, dict[int, str]] = {}
    bases = [state_of(name) for name in sheet.described]
    if "values" not in roles_of(sheet.names):  # names such as s and p, or TE and TM, are those of f_r then
        bases = [("brdf", state) if (state := light_of(name)) in ("s", "p") else (name, "") for name in sheet.described]
    for column, (base, state) in enumerate(bases):
        if state:
            of_states.setdefault(base, {})[column] = state
    alone = {plain_name(name) for name, (_, state) in zip(sheet.names, bases, strict=True) if not state}
    several = [base for base, columns in of_states.items() if len(columns) > 1]
    if "values" in given or len(several) != 1 or plain_name(several[0]) in alone:
        return sheet
    columns = of_states[several[0]]
    sheet.record["polarised_columns"] = " and ".join(sheet.names[column] for column in columns)
    return sheet.stacked(list(columns), list(columns.values()), "polarisation", several[0])


def _roles(sheet: TextSheet, names: Mapping[str, Sequence[str]]) -> dict[str, list[int]]:
    """Return the columns of each role: those of the names that the caller gives, and others by their names.

    ParameterError if a text has no such column.
    """
    shown = ", ".join(sheet.names)[:SHOWN]
    given: dict[str, list[int]] = {}
    for role, of_role in names.items():
        if role not in _ROLES:
            raise ParameterError(role, f"columns may be given for {', '.join(_ROLES)}", of_role, _ROLES)
        for name in of_role:
            if name not in sheet.names:
                text = f"{name!r} is not a column of {sheet.path}, which has {shown}"
                raise ParameterError(role, text, name, sheet.names)
            given.setdefault(role, []).append(sheet.names.index(name))
    known = roles_of(sheet.names, given)
    if "delta_phi" in given or "phi_r" in given:
        known.pop("phi_r" if "delta_phi" in given else "delta_phi", None)
    elif {"phi_r", "delta_phi"} <= set(known):  # without phi_i, phi_r may count from any direction
        known.pop("delta_phi" if "phi_i" in known or "phi_i" in given else "phi_r")
    if "from_specular" in given and "theta_r" not in given:
        known.pop("theta_r", None)
    roles = {role: numbers for role, numbers in (known | given).items() if numbers}
    if missing := missing_roles(roles):
        lines = "; a line such as AOI = 30 above rows gives theta_i to all" if "theta_i" in missing else ""
        how = f"name it: --column {missing[0]}=NAME{'' if missing[0] == 'values' else _NO_VECTORS}"
        raise sheet.error(f"no column is {', '.join(missing)}, among {shown}; {how}{lines}")
    for role in (*ANGLES, "wavelength"):
        if len(roles.get(role, ())) > 1:
            twice = " and ".join(sheet.names[column] for column in roles[role])
            raise sheet.error(f"{twice} are both {role}; name the column to read")
    used = {column for columns in roles.values() for column in columns}
    others = {"polarisation": polarisation_columns(sheet.names, used)}
    others["mueller"] = list(element_columns([plain_name(name) for name in sheet.names]).values())
    return roles | {role: columns for role, columns in others.items() if columns}
