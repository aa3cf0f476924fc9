"""The values of a file at their own directions: samples above the horizon, each of them once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats._angles import System
from brdfdb.parameters import Floats

if TYPE_CHECKING:
    from brdfdb.measurements.samples import Samples

_HORIZON = 0.5 * np.pi * (1.0 + 1e-9)  # largest polar angle [rad], with rounding
_SAME = 1e-6  # difference of coordinates within which directions are the same: angles of files may have 32 bits
FILL_VALUES = (-99.0, -999.0, -9999.0, -99999.0, -32768.0, 9.969209968386869e36)  # the last is that of netCDF
_MIXED = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)  # odd: a hash of rows


def without_holes(f_r: NDArray[Any]) -> NDArray[Any]:
    """Return f_r of a file with nan for numbers below 0: what was not measured, or what no lookup can tell from it."""
    return np.where(f_r < 0.0, np.asarray(np.nan, f_r.dtype), f_r) if np.any(f_r < 0.0) else f_r


def without_fill_values(numbers: Floats) -> Floats:
    """Return numbers of a file with nan for those that tables write where there is no value."""
    missing = np.isin(numbers, FILL_VALUES)
    return np.where(missing, np.nan, numbers) if missing.any() else numbers


def weighted(weight: Floats, values: NDArray[Any]) -> NDArray[Any]:
    """Return weight (N,) times values (N, C), where a hole that has no weight does not count."""
    return np.where(weight[:, np.newaxis] == 0.0, 0.0, weight[:, np.newaxis] * values)


def samples_at_vectors(wi: Floats, wr: Floats, values: Floats, *arguments: Any, **keywords: Any) -> Samples:
    """Return samples at unit vectors (N, 3); all other arguments are those of `samples_at_angles`."""
    return samples_at_angles(_angles_of(wi, wr), values, *arguments, **keywords)


def samples_at_angles(
    angles: Floats,
    values: Floats,
    name: str,
    channels: Sequence[str],
    wavelength_nm: NDArray[np.float64] | None,
    record: Mapping[str, Any],
    *,
    uncertainty: Floats | None = None,
    **origin: Any,
) -> Samples:
    """Return samples at theta_i, phi_i, theta_r, phi_r [rad], shape (N, 4), above the horizon and without repetitions.

    Values (N, C) [1/sr] are nan, or one of `FILL_VALUES`, where there are none. The other parameters, such as the
    instrument and the provenance, are those of `Samples`. The record counts the rows ``below_the_horizon`` and those
    ``repeated``: with the same directions and the same values, as at all azimuths of the normal.

    Raises
    ------
    FileFormatError
        If no row is above the horizon.
    ParameterError
        If an angle is outside its range, or nan.
    """
    from brdfdb.geometry import check_phi, check_theta
    from brdfdb.measurements.samples import ANGLES, Samples

    for axis, column in zip(ANGLES, angles.T, strict=True):
        (check_theta if axis.startswith("theta") else check_phi)(axis, column)
        if np.any(np.isnan(column)):
            raise ParameterError(axis, "nan is not an angle", np.nan)
    values = without_fill_values(values)
    above = np.flatnonzero((angles[:, 0] <= _HORIZON) & (angles[:, 2] <= _HORIZON))
    kept = above[_first_of_each(angles[above], values[above])]
    if not len(kept):
        raise FileFormatError(f"{name}: none of its {len(angles)} values is above the horizon")
    counts = {"below_the_horizon": len(angles) - len(above), "repeated": len(above) - len(kept)}
    theta_i, phi_i, theta_r, phi_r = np.minimum(angles[kept], [_HORIZON, np.inf, _HORIZON, np.inf]).T
    return Samples(
        name,
        theta_i,
        phi_i,
        theta_r,
        phi_r,
        tuple(channels),
        wavelength_nm,
        values[kept],
        uncertainty=None if uncertainty is None else uncertainty[kept],
        record={**record, **{key: count for key, count in counts.items() if count}},
        **origin,
    )


def samples_of_grid(
    system: System, nodes: Sequence[Floats], values: Floats, *arguments: Any, **keywords: Any
) -> Samples:
    """Return samples at all nodes [rad] of the angles of a system; the last angle changes fastest.

    Values (n, ..., C) [1/sr] have an axis for each angle. Four angles may be given of an isotropic system, too. Lights
    of an isotropic system have an azimuth of 0. The other arguments are those of `samples_at_angles`.
    """
    angles = np.stack([grid.reshape(-1) for grid in np.meshgrid(*nodes, indexing="ij")], axis=1)
    flat = np.asarray(values, dtype=np.float64).reshape(len(angles), -1)
    turned = _angles_of(*system.vectors(angles))
    if not system.anisotropic:
        turned[:, 3], turned[:, 1] = turned[:, 3] - turned[:, 1], 0.0
    return samples_at_angles(turned, flat, *arguments, **keywords)


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
