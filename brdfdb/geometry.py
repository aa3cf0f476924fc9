"""The conventions: frames, angles, half and difference vectors, the reciprocity swap.

Directions are unit vectors that point away from the surface; theta is measured from the normal (z), phi
counter-clockwise from x. Index i is the light, r the viewer. ``delta_phi = phi_r - phi_i``: 0 looks back towards the
light, pi is the half plane of the mirror direction. Angles are radians in every function; degrees exist only at human
and file boundaries, and `degrees` / `radians` below are where they are converted.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.parameters import Floats

HALF_PI = np.pi / 2
PHI_MAX = 1e15  # beyond, neighbouring float64 are more than a tenth of a radian apart


def radians(angle_deg: ArrayLike) -> NDArray[np.float64]:
    """Degrees to radians (90 degrees gives exactly the float64 nearest pi/2)."""
    return np.deg2rad(np.asarray(angle_deg, dtype=np.float64))


def degrees(angle: ArrayLike) -> NDArray[np.float64]:
    """Radians to degrees."""
    return np.rad2deg(np.asarray(angle, dtype=np.float64))


def check_theta(name: str, theta: ArrayLike) -> Floats:
    """Return a polar angle [rad] as a float array, or raise a ValueError that says what is wrong with it.

    Allowed are 0 to pi, and nan, which passes through to the result. An angle past pi/2 is below the horizon and
    allowed: the BRDF is 0 there.
    """
    array = _float_array(name, theta)
    bad = (array < 0.0) | (array > array.dtype.type(np.pi))
    if np.any(bad):
        first = np.atleast_1d(array)[np.atleast_1d(bad)][0]
        raise ValueError(f"{name}: {first:.9g} rad ({degrees(first):.6g} degrees) is outside [0, pi] rad")
    return array


def check_phi(name: str, phi: ArrayLike) -> Floats:
    """Return an azimuth [rad] as a float array; nan passes through, what is not in [-1e15, 1e15] is a ValueError."""
    array = _float_array(name, phi)
    bad = np.abs(array) > PHI_MAX
    if np.any(bad):
        first = np.atleast_1d(array)[np.atleast_1d(bad)][0]
        raise ValueError(f"{name}: {first:.9g} rad is outside [-{PHI_MAX:g}, {PHI_MAX:g}] rad")
    return array


def _float_array(name: str, angle: ArrayLike) -> Floats:
    array = np.asarray(angle)
    if array.dtype.kind not in "iuf":
        raise ValueError(f"{name}: {angle!r} is not a number of radians")
    return array if array.dtype in (np.float32, np.float64) else array.astype(np.float64)


class Angles(NamedTuple):
    """Checked angles [rad] as float64, thetas held at the horizon, and what `finished` needs to know of the input."""

    theta_i: NDArray[np.float64]
    phi_i: NDArray[np.float64]
    theta_r: NDArray[np.float64]
    phi_r: NDArray[np.float64]
    below: NDArray[np.bool_]
    dtype: np.dtype[Any]


def checked_angles(theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike) -> Angles:
    """Check the four angles and note which directions lie below the horizon.

    float32 arrays in give float32 out; the arithmetic is float64. The float32 nearest pi/2 lies above pi/2: it is
    read as the horizon itself, where every model returns its limit from below.
    """
    t_i, t_r = check_theta("theta_i", theta_i), check_theta("theta_r", theta_r)
    p_i, p_r = check_phi("phi_i", phi_i), check_phi("phi_r", phi_r)
    below = (t_i > t_i.dtype.type(HALF_PI)) | (t_r > t_r.dtype.type(HALF_PI))
    arrays = [a for a in (theta_i, phi_i, theta_r, phi_r) if isinstance(a, np.ndarray | np.generic)]
    single = bool(arrays) and np.result_type(*arrays) == np.float32
    return Angles(
        np.minimum(t_i.astype(np.float64), HALF_PI),
        p_i.astype(np.float64),
        np.minimum(t_r.astype(np.float64), HALF_PI),
        p_r.astype(np.float64),
        below,
        np.dtype(np.float32 if single else np.float64),
    )


def finished(values: Floats, angles: Angles, *, trailing: int = 0) -> Floats:
    """Broadcast to all four angles; 0 below the horizon, nan where an angle is nan, in the dtype asked for.

    `trailing` axes of `values`, such as wavelengths, come after those of the angles.
    """
    own = np.shape(values)[np.ndim(values) - trailing :]

    def aligned(array: NDArray[Any]) -> NDArray[Any]:
        return array.reshape(array.shape + (1,) * trailing)

    four = angles[:4]
    shape = np.broadcast_shapes(np.shape(values), *(aligned(angle).shape for angle in four), own)
    result: Floats = np.broadcast_to(values, shape)
    if np.any(angles.below):
        result = np.where(aligned(angles.below), 0.0, result)
    for angle in four:
        if np.any(np.isnan(angle)):
            result = np.where(aligned(np.isnan(angle)), np.nan, result)
    if result.dtype != angles.dtype or not result.flags.writeable:
        result = result.astype(angles.dtype)
    return result[()]


def unit_vector(theta: ArrayLike, phi: ArrayLike) -> NDArray[np.float64]:
    """The unit vectors, shape (..., 3), of directions (theta, phi) [rad]."""
    sin_theta = np.sin(theta)
    x, y, z = np.broadcast_arrays(sin_theta * np.cos(phi), sin_theta * np.sin(phi), np.cos(theta))
    return np.stack([x, y, z], axis=-1)


def spherical_angles(w: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The angles (theta, phi) [rad] of vectors of shape (..., 3); phi in (-pi, pi], 0 at the pole."""
    x, y, z = np.moveaxis(np.asarray(w, dtype=np.float64), -1, 0)
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)


def fold_delta_phi(delta_phi: ArrayLike) -> NDArray[np.float64]:
    """An azimuth difference [rad] folded to [0, pi] by its period and by the mirror symmetry of isotropic surfaces."""
    return np.abs(np.remainder(np.asarray(delta_phi, dtype=np.float64) + np.pi, 2.0 * np.pi) - np.pi)


def directions_from_half_difference(
    theta_h: ArrayLike, phi_h: ArrayLike, theta_d: ArrayLike, phi_d: ArrayLike
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Directions of light and viewer from half/difference angles (Rusinkiewicz 1998, ``rusinkiewicz1998``).

    Parameters
    ----------
    theta_h, phi_h : array_like [rad]
        Direction of the half vector, the bisector of light and viewer.
    theta_d, phi_d : array_like [rad]
        Direction of the light in the frame whose pole is the half vector; theta_d in [0, pi/2].

    Returns
    -------
    theta_i, phi_i, theta_r, phi_r : arrays [rad]
        Broadcast; either theta may pass pi/2, where that direction is below the horizon.
    """
    sin_h, cos_h = np.sin(theta_h), np.cos(theta_h)
    d = unit_vector(theta_d, phi_d)
    d_x, d_y, d_z = np.moveaxis(d, -1, 0)
    angles: list[NDArray[Any]] = []
    for sign in (1.0, -1.0):  # the viewer is the light turned by pi about the half vector
        x = sign * d_x * cos_h + d_z * sin_h
        z = d_z * cos_h - sign * d_x * sin_h
        y = sign * d_y
        theta, phi = spherical_angles(np.stack(np.broadcast_arrays(x, y, z), axis=-1))
        angles += [theta, phi + np.asarray(phi_h)]
    theta_i, phi_i, theta_r, phi_r = angles
    return theta_i, phi_i, theta_r, phi_r
