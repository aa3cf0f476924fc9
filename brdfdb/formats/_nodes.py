"""The values of a file at their own directions: samples above the horizon, each of them once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError, ParameterError, counted
from brdfdb.formats._angles import System
from brdfdb.formats._channels import names_of
from brdfdb.formats._record import note
from brdfdb.measurements.conventions import ANGLES, Convention, FormatConventions, ListedRows, converted, remedy
from brdfdb.parameters import Floats

if TYPE_CHECKING:
    from brdfdb.measurements.samples import Samples

_HORIZON = 0.5 * np.pi * (1.0 + 1e-9)  # largest polar angle [rad], with rounding
_TWO_TURNS = 4.0 * np.pi * (1.0 + 1e-9)
_SAME = 1e-6  # difference of coordinates within which directions are the same: angles of files may have 32 bits
FILL_VALUES = (-99.0, -999.0, -9999.0, -99999.0, -32768.0, 9.969209968386869e36)  # the last is that of netCDF
_SMALLEST = 90.0  # size of fill values, at least
_ROUNDED = 1e-7  # relative difference of a number that was written with 32 bits, or converted there and back
_OVERFLOW = 1e20  # larger numbers are marks of programs, such as 1e30 and 9.9e37
_BITS = (12, 14, 15, 16, 20, 24, 31, 32)  # of converters, whose largest number marks saturation
_MIXED = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)  # odd: a hash of rows


def without_holes(f_r: NDArray[Any]) -> NDArray[Any]:
    """Return f_r of a file with nan for numbers below 0: what was not measured, or what no lookup can tell from it."""
    return np.where(f_r < 0.0, np.asarray(np.nan, f_r.dtype), f_r) if np.any(f_r < 0.0) else f_r


def fill_values(numbers: Floats, record: dict[str, Any], missing: float | None = None) -> NDArray[np.bool_]:
    """Return True where numbers of a file stand for no value: `missing`, or those that tables write there.

    Notes of the record count those that are `missing` or too large for f_r, and those that may be marks of saturation.
    """
    holes = np.abs(numbers) > _SMALLEST
    holes[holes] = np.any([_is_close(numbers[holes], fill) for fill in FILL_VALUES], axis=0)
    if (large := np.abs(numbers) > _OVERFLOW).any():
        note(record, f"Values above {_OVERFLOW:g} were read as holes: {int(large.sum())}.")
    holes |= large
    if missing is not None:
        stated = _is_close(numbers, missing)
        note(record, f"Holes, as was stated: {counted(int(stated.sum()), 'value')} of {missing:g}.")
        holes |= stated
    top = round(float(np.max(numbers, where=np.isfinite(numbers) & ~holes, initial=0.0)), 3)
    if top in [2**bits - 1 for bits in _BITS]:
        count = counted(int(np.sum(_is_close(numbers, top))), "value")
        text = f"{count} of {top:.0f} may be marks of saturation: --missing {top:.0f} leaves them out"
        note(record, f"Saturated? {text}.")
    return holes


def _is_close(numbers: Floats, mark: float) -> NDArray[np.bool_]:
    return np.isclose(numbers, mark, rtol=_ROUNDED, atol=0.0)


def weighted(weight: Floats, values: NDArray[Any]) -> NDArray[Any]:
    """Return weight (N,) times values (N, C), where a hole that has no weight does not count."""
    return np.where(weight[:, np.newaxis] == 0.0, 0.0, weight[:, np.newaxis] * values)


def rows_at_vectors(wi: Floats, wr: Floats, values: Floats, *arguments: Any, **keywords: Any) -> ListedRows:
    """Return rows at unit vectors (N, 3); all other arguments are those of `ListedRows`."""
    return ListedRows(_angles_of(wi, wr), values, *arguments, **keywords)


def rows_of_grid(
    system: System, nodes: Sequence[Floats], values: Floats, *arguments: Any, **keywords: Any
) -> ListedRows:
    """Return rows at all nodes [rad] of the angles of a system; the last angle changes fastest.

    Values (n, ..., C) [1/sr] have an axis for each angle. Four angles may be given of an isotropic system, too. Lights
    of an isotropic system have an azimuth of 0. The other arguments are those of `ListedRows`.
    """
    angles = np.stack([grid.reshape(-1) for grid in np.meshgrid(*nodes, indexing="ij")], axis=1)
    flat = np.asarray(values, dtype=np.float64).reshape(len(angles), -1)
    turned = _angles_of(*system.vectors(angles))
    if not system.anisotropic:
        turned[:, 3], turned[:, 1] = turned[:, 3] - turned[:, 1], 0.0
    return ListedRows(turned, flat, *arguments, **keywords)


def samples_of(
    listed: ListedRows, convention: Convention, own: FormatConventions, missing: float | None = None
) -> Samples:
    """Return the rows of a file as samples by what a user states, above the horizon and without repetitions.

    Values are nan where the file has none, the number `missing`, or one of `FILL_VALUES`. The record counts the rows
    ``below_the_horizon`` and those ``repeated``: with the same directions and the same values, as at all azimuths of
    the normal.

    Raises
    ------
    FileFormatError
        If no row is above the horizon, or the reader knows where an angle is wrong.
    ParameterError
        If an angle is outside its range, or nan.
    """
    from brdfdb.formats._channels import check_file_wavelengths
    from brdfdb.measurements.conventions import REFUSED, numbers_of
    from brdfdb.measurements.joining import contradiction_within
    from brdfdb.measurements.samples import Samples

    known = {**listed.record}
    numbers = numbers_of(listed.quantity, listed.values, listed.angles[:, 0], listed.angles[:, 2]) / listed.scale
    holes = fill_values(numbers, known, missing)
    listed = replace(listed, values=np.where(holes, np.nan, listed.values), record=known)
    rows = converted(listed, convention, own)
    angles = opposite(rows.angles) if rows.signed else rows.angles
    _check_angles(rows, angles, stated=bool(convention.angles))
    above = np.flatnonzero((angles[:, 0] <= _HORIZON) & (angles[:, 2] <= _HORIZON))
    kept = above[_first_of_each(angles[above], rows.values[above])]
    if not len(kept):
        raise FileFormatError(f"{rows.name}: none of its {len(angles)} values is above the horizon")
    number = np.ones(len(angles), np.int64) if rows.rows is None else rows.rows
    whole, of_above, of_kept = (int(part.sum()) for part in (number, number[above], number[kept]))
    counts = {"below_the_horizon": whole - of_above, "repeated": of_above - of_kept}
    record = {**rows.record, **{key: count for key, count in counts.items() if count}}
    at = rows.wavelength_nm
    if at is not None:
        taken = convention.wavelength_unit or rows.wavelength_unit or own.wavelengths
        check_file_wavelengths(at, taken, rows.record.get(REFUSED, ()))
    theta_i, phi_i, theta_r, phi_r = np.minimum(angles[kept], [_HORIZON, np.inf, _HORIZON, np.inf]).T
    samples = Samples(
        rows.name,
        theta_i,
        phi_i,
        theta_r,
        phi_r,
        names_of(at) if at is not None and at is not listed.wavelength_nm else tuple(rows.channels),
        at,
        rows.values[kept],
        None if rows.uncertainty is None else rows.uncertainty[kept],
        rows.bandwidth_nm,
        rows.instrument,
        rows.provenance,
        None if rows.mueller is None else rows.mueller[kept],
        record,
    )
    if rows.explanation is None or not (contradiction := contradiction_within(samples)):
        return samples
    return replace(samples, record={**record, "contradiction": f"{contradiction} {rows.explanation}".strip()})


def wrong_radians(number: float, column: int) -> str:
    """Return a sentence on a number that is no angle in radians; `column` is that of theta_i, phi_i, theta_r, phi_r."""
    if column % 2:
        return f"{number:g} is no azimuth in radians, as polar angles of the file are; write all angles in radians"
    remedy_deg = "--angles deg reads degrees"
    if 0.0 <= number <= 2.0 * np.pi:
        remedy_deg = f"if theta and phi are exchanged: --angles exchanged; {remedy_deg}"
    return f"{number:g} is no polar angle in radians, which these files hold; {remedy_deg}"


def _check_angles(rows: ListedRows, angles: Floats, *, stated: bool) -> None:
    """Refuse angles (N, 4) [rad] of rows that are none; `stated` is True if a user says what they are."""
    from brdfdb.geometry import check_phi, check_theta

    polar = angles[:, [0, 2]]
    if rows.wrong_angle is not None and not stated:
        beyond = np.abs(angles) > _TWO_TURNS
        beyond[:, [0, 2]] = (polar < 0.0) | (polar > np.pi)
        for columns in ([0, 2], [1, 3]):
            if len(wrong := np.argwhere(beyond[:, columns])):
                row, side = wrong[0].tolist()
                raise FileFormatError(rows.wrong_angle(row, columns[side]))
    if np.any(polar > np.pi):
        turns = angles[:, [1, 3]]
        text = f"{np.rad2deg(polar.max()):.6g} degrees is not a polar angle"
        if np.all((turns >= 0.0) & (turns <= _HORIZON)) and np.unique(turns).size > 2:
            text += f"; if theta and phi are exchanged: {remedy(rows.record, '--angles exchanged')}"
        elif polar.max() <= 90.0 + 1e-6:
            text += f"; if the numbers of the file are degrees: {remedy(rows.record, '--angles deg')}"
        raise ParameterError("theta", text, float(polar.max()), (0.0, _HORIZON))
    for axis, column in zip(ANGLES, angles.T, strict=True):
        (check_theta if axis.startswith("theta") else check_phi)(axis, column)
        if np.any(np.isnan(column)):
            raise ParameterError(axis, "nan is not an angle", np.nan)


def opposite(angles: Floats) -> Floats:
    """Return angles (N, 4) [rad] with each negative polar angle as one at the opposite azimuth."""
    turned = angles.copy()
    for polar in (0, 2):
        turned[:, polar + 1] += np.where(angles[:, polar] < 0.0, np.pi, 0.0)
        turned[:, polar + 1] += np.where(turned[:, polar + 1] < 0.0, 2.0 * np.pi, 0.0)
    turned[:, [0, 2]] = np.abs(angles[:, [0, 2]])
    return turned


def _angles_of(wi: Floats, wr: Floats) -> Floats:
    """Return theta_i, phi_i, theta_r, phi_r [rad] of unit vectors (N, 3), shape (N, 4); phi of the normal is 0."""
    from brdfdb.geometry import spherical_angles

    columns = []
    for w in (wi, wr):
        theta, phi = spherical_angles(w)
        columns += [theta, np.where(np.sin(theta) < _SAME, 0.0, phi)]
    return np.stack(columns, axis=1)


def _first_of_each(angles: Floats, values: Floats) -> NDArray[np.intp]:
    """Return the numbers of the rows without those whose directions and values another row before them has."""
    theta_i, phi_i, theta_r, phi_r = angles.T
    parts = [np.sin(theta_i) * np.cos(phi_i), np.sin(theta_i) * np.sin(phi_i)]
    parts += [np.sin(theta_r) * np.cos(phi_r), np.sin(theta_r) * np.sin(phi_r)]
    code = np.zeros(len(angles), dtype=np.uint64)
    for part in parts:
        code = _mixed(code, np.rint(part / _SAME).astype(np.int64).view(np.uint64))
    for column in (values + 0.0).T:  # -0 is 0
        code = _mixed(code, np.ascontiguousarray(column, dtype=np.float64).view(np.uint64))
    return np.sort(np.unique(code, return_index=True)[1])


def _mixed(code: NDArray[np.uint64], part: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return 64 bits that tell the values of `part` apart as well as those of `code`."""
    mixed = (code ^ part * _MIXED[0]) * _MIXED[1]
    return np.asarray((mixed ^ (mixed >> np.uint64(29))) * _MIXED[2])
