"""Text of other programs: a row a pair of directions, with commas, tabs, semicolons or spaces.

Columns are recognised by their names, such as ``theta_i``, ``sza``, ``view_z``, ``raa`` or ``550nm``, or the caller
names them. Titles may stand before the names. Values are f_r in 1/sr, reflectance factors (pi f_r), or f_r times the
cosine of the viewer.
"""

from __future__ import annotations

import itertools
import os
from array import array
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats._columns import (
    ANGLES,
    AZIMUTHS,
    QUANTITIES,
    Layout,
    angle_unit,
    fields_of,
    in_percent,
    layout_of,
    length_unit,
    number_of,
    plain_name,
    quantity_of,
    roles_of,
    unknown_unit,
    wavelength_of,
)
from brdfdb.formats._nodes import samples_at_angles
from brdfdb.formats._record import note, of_comments
from brdfdb.formats._text_file import check_text, lines_of

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
_SHOWN = 200  # characters of names that a sentence repeats
_IN_PLANE = 1e-6  # sine of an angle to the plane of incidence that is rounding
_UPRIGHT = np.radians(90.0 + 1e-6)


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a text whose columns have names of angles and values."""
    layout = _layout_of_head(head)
    return layout is not None and not _missing(roles_of(layout.names))


def columns_of(head: bytes) -> tuple[str, ...]:
    """Return the names of the columns in the first bytes of a text, their numbers if they have none."""
    layout = _layout_of_head(head)
    return () if layout is None else layout.names


def _layout_of_head(head: bytes) -> Layout | None:
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
    path : path
        The file.
    quantity : {"auto", "f_r", "reflectance_factor", "f_r_cos"}
        Quantity of the values. By default the one that names or titles give, such as BRF, and else f_r.
    angles : {"auto", "deg", "rad"}
        Unit of the angles. By default the one that names give, and else degrees; the record has a note where the
        numbers may be radians as well.
    **columns : str or sequence of str
        Names of columns for theta_i, phi_i, theta_r, phi_r, delta_phi, values, uncertainty and wavelength; numbers from
        1 in a text without names. A role that is not given is recognised by names.

    Returns
    -------
    Samples
        Reflectance factors are divided by pi, and f_r cos by the cosine of theta_r. A negative polar angle is one at
        the opposite azimuth. Where theta exceeds 90 degrees for the light and phi does not, the file has exchanged the
        two letters, and the record says so.

    Raises
    ------
    ParameterError
        If there is no such role, column, quantity or unit.
    FileFormatError
        If the file is no text of numbers, or a column is missing; with the line and the field.
    """
    path = Path(path)
    check_text(path, _MOST_BYTES)
    for name, value, allowed in (("quantity", quantity, ("auto", *QUANTITIES)), ("angles", angles, _UNITS)):
        if value not in allowed:
            raise ParameterError(name, f"{value!r} is not one of {', '.join(allowed)}", value, allowed)
    layout = _layout(path)
    roles = _roles(path, layout, columns)
    rows = _rows(path, layout)
    record: dict[str, Any] = {"titles": list(layout.titles)} if layout.titles else {}
    turned = _angles(path, rows, roles, layout, angles, record)
    names = [layout.names[column] for column in roles["values"]]
    scale = _scale(path, names, layout, quantity, turned[:, 2], record)
    values, uncertainty = _values(path, rows, roles, layout, scale, record)
    at = _wavelengths(path, names, layout)
    if "wavelength" in roles:
        if values.shape[1] != 1:
            raise FileFormatError(f"{path}: line {layout.line}: beside a wavelength there may be one column of values")
        lengths = _nm(path, rows[:, roles["wavelength"][0]], layout.names[roles["wavelength"][0]], layout, record)
        turned, values, uncertainty, at = _pivoted(turned, values, uncertainty, lengths)
    elif at is not None:
        note(record, "Wavelengths are those in the names of the columns.")
        order = np.argsort(at)
        at, values = at[order], values[:, order]
        uncertainty = None if uncertainty is None else uncertainty[:, order]
    instrument, length = of_comments({"titles": "\n".join(layout.titles)})
    if at is None and len(names) == 1 and length is not None:
        at = np.array([length])
        note(record, f"The wavelength {length:g} nm was read from the titles of the file.")
    channels = [f"{nm:g}nm" for nm in at] if at is not None else ["grey"] if len(names) == 1 else names
    if channels == ["r", "g", "b"]:
        channels = ["R", "G", "B"]
    left = set(range(len(layout.names))) - {column for columns_ in roles.values() for column in columns_}
    if left:
        record["columns_left_out"] = [layout.names[column] for column in sorted(left)]
    return samples_at_angles(
        turned, values, path.stem, channels, at, record, uncertainty=uncertainty, instrument=instrument
    )


def _layout(path: Path) -> Layout:
    """Return the layout of a text; FileFormatError if it has no row, or its first row is damaged."""
    layout = layout_of(itertools.islice(lines_of(path), _LONGEST_TITLE))
    if layout is None:
        for number, line in itertools.islice(lines_of(path), _LONGEST_TITLE):
            if not _missing(roles_of([name for part in line.split(",") for name in part.split()])):
                raise FileFormatError(f"{path}: line {number} has the names of columns, and no row of numbers follows")
        raise FileFormatError(
            f"{path}: line 1: none of the first {_LONGEST_TITLE} lines is a row of four numbers or more"
        )
    if layout.damaged:
        raise FileFormatError(f"{path}: {layout.damaged}")
    return layout


def _roles(path: Path, layout: Layout, columns: Mapping[str, str | Sequence[str]]) -> dict[str, list[int]]:
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
    roles = {role: numbers for role, numbers in (known | given).items() if numbers}
    if missing := _missing(roles):
        raise FileFormatError(
            f"{path}: line {layout.line}: among the columns {shown} is none of {missing}; name it: {HOW}"
        )
    for role in (*ANGLES, "wavelength"):
        if len(roles.get(role, ())) > 1:
            names = [layout.names[column] for column in roles[role]]
            raise FileFormatError(f"{path}: line {layout.line}: {' and '.join(names)} are both {role}; name one")
    return roles


def _missing(roles: Mapping[str, list[int]]) -> str:
    """Return the roles that a text cannot do without and that are missing, as text."""
    missing = [role for role in ("theta_i", "theta_r", "values") if role not in roles]
    if not {"phi_r", "delta_phi"} & set(roles):
        missing.append("phi_r or delta_phi")
    return ", ".join(missing)


def _rows(path: Path, layout: Layout) -> Array:
    """Return the numbers of a text from its first row on, shape (N, columns)."""
    numbers, count = array("d"), len(layout.names)
    decimals = ""  # the sign before decimals: a comma beside points may be that of thousands
    for line_number, line in lines_of(path):
        if line_number < layout.first or not line.strip() or line.lstrip().startswith(("#", "%")):
            continue
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
    return np.frombuffer(numbers, dtype=np.float64).reshape(-1, count)


def _angles(
    path: Path, rows: Array, roles: Mapping[str, list[int]], layout: Layout, unit: str, record: dict[str, Any]
) -> Array:
    """Return theta_i, phi_i, theta_r, phi_r [rad] of rows, shape (N, 4)."""
    from brdfdb.measurements.samples import RELATIVE

    given = {name: rows[:, roles[name][0]] for name in ANGLES if name in roles}
    for name, column in given.items():
        if np.any(np.isnan(column)):
            line = f"line {layout.line}, field {layout.names[roles[name][0]]}"
            raise FileFormatError(f"{path}: {line}: an angle is missing")
    units = {name: unit if unit != "auto" else angle_unit(layout.names[roles[name][0]]) for name in given}
    named = sorted(set(units.values()) - {""})
    other = named[0] if len(named) == 1 else "deg"  # of columns whose names give none
    if not named and _may_be_radians(given):
        text = "no polar angle exceeds pi/2 and no azimuth 2 pi, so they may be radians: --angles rad reads them so"
        note(record, f"Angles were taken as degrees, but no name gives a unit, {text}.")
    if "delta_phi" in given and plain_name(layout.names[roles["delta_phi"][0]]) in AZIMUTHS:
        note(
            record,
            f"The column {layout.names[roles['delta_phi'][0]]} was taken as the azimuth from the light to the viewer.",
        )
    units = {name: unit or other for name, unit in units.items()}
    record["angles"] = " and ".join({"deg": "degrees", "rad": "radians"}[unit] for unit in sorted(set(units.values())))
    given = {name: np.deg2rad(column) if units[name] == "deg" else column for name, column in given.items()}
    relative = "phi_i" not in given
    if relative:
        given["phi_i"] = np.zeros(len(rows))
    _exchange(given, record)
    swept = bool(np.any(given["theta_i"] < 0.0)) and np.ptp(given["phi_i"]) == 0.0
    for side in ("i", "r"):
        theta, phi = given[f"theta_{side}"], f"phi_{side}" if f"phi_{side}" in given else "delta_phi"
        given[phi] = np.where(theta < 0.0, given[phi] + np.pi, given[phi])
        if side == "i" and "delta_phi" in given:  # the viewer turns with the light
            given["delta_phi"] = np.where(theta < 0.0, given["delta_phi"] - np.pi, given["delta_phi"])
        given[f"theta_{side}"] = np.abs(theta)
        if np.any(np.abs(theta) > np.pi * (1.0 + 1e-9)):
            shown = np.rad2deg(np.abs(theta).max())
            raise FileFormatError(f"{path}: line {layout.line}: theta_{side} of {shown:g} degrees is no polar angle")
    phi_i = given["phi_i"]
    phi_r = given["phi_r"] if "phi_r" in given else phi_i + given["delta_phi"]
    in_plane = np.abs(np.sin(phi_r - phi_i)) * np.sin(given["theta_r"]) < _IN_PLANE
    if relative or (swept and in_plane.all()):  # signed angles in one plane: the surface has not turned
        record["azimuths"] = RELATIVE
        phi_i, phi_r = np.zeros(len(rows)), phi_r - phi_i
    return np.stack([given["theta_i"], phi_i, given["theta_r"], phi_r], axis=1)


def _may_be_radians(given: Mapping[str, Array]) -> bool:
    """Return True if angles without a unit are as small as radians are, and not 0 alone."""
    largest = {name: float(np.abs(column).max(initial=0.0)) for name, column in given.items()}
    within = all(size <= (0.5 if name.startswith("theta") else 2.0) * np.pi + 1e-3 for name, size in largest.items())
    return within and any(largest.values())


def _exchange(given: dict[str, Array], record: dict[str, Any]) -> None:
    """Exchange theta and phi where theta cannot be the polar angle, and phi can."""
    if not {"phi_i", "phi_r"} <= set(given) or np.all(np.abs(given["theta_i"]) <= _UPRIGHT):
        return
    if max(np.abs(given["phi_i"]).max(), np.abs(given["phi_r"]).max()) <= _UPRIGHT:
        for side in ("i", "r"):
            theta, phi = f"theta_{side}", f"phi_{side}"
            given[theta], given[phi] = given[phi], given[theta]
        record["exchanged"] = "theta exceeds 90 degrees and phi does not: phi was read as the polar angle"


def _scale(
    path: Path, names: Sequence[str], layout: Layout, quantity: str, theta_r: Array, record: dict[str, Any]
) -> Array:
    """Return the factors, shape (N, C) or (1, C), that make f_r of values: each column has the quantity of its name."""
    quantities = [quantity_of([name]) for name in names]
    distinct = sorted(set(quantities) - {""})
    if len(distinct) > 1 and any(wavelength_of(name) is None for name in names):
        shown = " and ".join(next(n for n, q in zip(names, quantities, strict=True) if q == one) for one in distinct)
        raise FileFormatError(f"{path}: line {layout.line}: {shown} are different quantities; name one as values")
    if quantity != "auto":
        quantities = [quantity] * len(names)
    other = distinct[0] if len(distinct) == 1 else "f_r"  # of names that give none
    if not distinct and layout.names_factors:
        other = "reflectance_factor"
    quantities = [one or other for one in quantities]
    record["quantity"] = next((one for one in quantities if one != "f_r"), "f_r")
    cosine = np.cos(theta_r)
    of_quantity = {
        "f_r": np.ones_like(cosine),
        "reflectance_factor": np.full_like(cosine, 1.0 / np.pi),
        "f_r_cos": np.where(cosine > 1e-6, 1.0 / np.maximum(cosine, 1e-6), np.nan),
    }
    return np.stack([of_quantity[one] for one in quantities], axis=1)


def _values(
    path: Path, rows: Array, roles: Mapping[str, list[int]], layout: Layout, scale: Array, record: dict[str, Any]
) -> tuple[Array, Array | None]:
    """Return f_r [1/sr] of rows, shape (N, C), and their uncertainties if there are any."""
    names = {role: [layout.names[column] for column in roles.get(role, ())] for role in ("values", "uncertainty")}
    for name in (*names["values"], *names["uncertainty"]):
        if unit := unknown_unit(name):
            note(record, f"The unit {unit!r} of the column {name} is not known: its numbers were taken as they stand.")
    percent = np.array([in_percent(name) for name in names["values"]])
    if percent.any():
        note(record, "Values in percent were divided by 100.")
    values: Array = rows[:, roles["values"]] * np.where(percent, 0.01, 1.0) * scale
    if "uncertainty" not in roles:
        return values, None
    given = rows[:, roles["uncertainty"]]
    if given.shape != values.shape:
        raise FileFormatError(f"{path}: line {layout.line}: there are not as many uncertainties as values")
    columns = (
        f"column {names['uncertainty'][0]}" if given.shape[1] == 1 else f"columns {', '.join(names['uncertainty'])}"
    )
    note(record, f"Standard uncertainties were read from the {columns[:_SHOWN]}.")
    relative = np.array([in_percent(name) for name in names["uncertainty"]])
    if relative.any():
        note(record, "Uncertainties in percent were taken as percent of the values of their rows.")
    uncertainty = np.where(relative, 0.01 * given * np.abs(values), given * np.where(percent, 0.01, 1.0) * scale)
    return values, uncertainty


def _wavelengths(path: Path, names: Iterable[str], layout: Layout) -> Array | None:
    """Return the wavelengths [nm] that names of columns give; None if one gives none."""
    lengths = [wavelength_of(name) for name in names]
    if None in lengths:
        return None
    at = np.array(lengths, dtype=np.float64)
    if np.unique(at).size != at.size:
        raise FileFormatError(f"{path}: line {layout.line}: a wavelength stands twice")
    return at


def _nm(path: Path, lengths: Array, name: str, layout: Layout, record: dict[str, Any]) -> Array:
    """Return wavelengths in nm, by the unit that a name gives, or by their size."""
    where = f"{path}: line {layout.line}, field {name}"
    if np.any(np.isnan(lengths)):
        raise FileFormatError(f"{where}: a wavelength is missing")
    unit_nm, word = length_unit(name), ""
    if unit_nm is None:
        if unit := unknown_unit(name):
            raise FileFormatError(f"{where}: the unit {unit!r} is none of wavelengths; allowed are nm, um and m")
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


def _pivoted(
    angles: Array, values: Array, uncertainty: Array | None, at: Array
) -> tuple[Array, Array, Array | None, Array]:
    """Return rows with a column a wavelength of rows with one wavelength each; what is missing is nan."""
    wavelengths, channel = np.unique(np.round(at, 6), return_inverse=True)
    pairs, first, pair = np.unique(np.round(angles, 9), axis=0, return_index=True, return_inverse=True)
    cell = pair.reshape(-1) * wavelengths.size + channel.reshape(-1)
    order = np.argsort(cell, kind="stable")
    starts = np.flatnonzero(np.append(True, np.diff(cell[order]) > 0))
    again: NDArray[np.intp] = np.empty(len(cell), dtype=np.intp)  # the number of measurements of the same before it
    again[order] = np.arange(len(cell)) - np.repeat(starts, np.diff(np.append(starts, len(cell))))
    row = again * len(pairs) + pair.reshape(-1)
    count = (again.max() + 1) * len(pairs)

    def table(column: Array) -> Array:
        grid = np.full((count, wavelengths.size), np.nan)
        grid[row, channel.reshape(-1)] = column[:, 0]
        return grid

    wide = table(values)
    some = np.flatnonzero(np.any(np.isfinite(wide), axis=1))
    of_rows = angles[first][some % len(pairs)]
    return of_rows, wide[some], None if uncertainty is None else table(uncertainty)[some], wavelengths
