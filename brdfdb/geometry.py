"""The conventions: frames, angles, half and difference vectors, the reciprocity swap.

Directions are unit vectors that point away from the surface; theta is measured from the normal (z), phi
counter-clockwise from x. Index i is the light, r the viewer. ``delta_phi = phi_r - phi_i``: 0 looks back towards the
light, pi is the half plane of the mirror direction. Angles are radians in every function; degrees exist only at human
and file boundaries, and `degrees` and `radians` below convert them.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb._elementary import COS_HORIZON, cos, sine
from brdfdb._numba import elementwise, loop
from brdfdb.arrays import PLAIN_TYPES, array_function, plain, unlabelled
from brdfdb.errors import ParameterError, warn_of_degrees
from brdfdb.parameters import Floats

HALF_PI = np.pi / 2
AZIMUTH_MOST_DEG = 720.0
PHI_USUAL = 4.0 * np.pi  # azimuths of more turns are likely to be degrees
PHI_MAX = 1e15  # largest azimuth: neighbouring float64 beyond it are more than a tenth of a radian apart
NO_AZIMUTH = 1e-290  # product of two sines below which an azimuth carries too few digits
UNIT_LENGTH = 1e-5  # largest difference of the length of a unit vector from 1; that of float32 is 1e-7

_sines, _cosines = elementwise(sine), elementwise(cos)  # 1 ns a value in place of 10, but 2 us more a call


@array_function
def radians(angle_deg: ArrayLike) -> NDArray[np.float64]:
    """Return degrees in radians (90 degrees gives exactly the float64 nearest pi/2)."""
    return np.deg2rad(np.asarray(angle_deg, dtype=np.float64))


@array_function
def degrees(angle: ArrayLike) -> NDArray[np.float64]:
    """Return radians in degrees."""
    return np.rad2deg(np.asarray(angle, dtype=np.float64))


def check_theta(name: str, theta: ArrayLike) -> Floats:
    """Return a polar angle [rad] as a float array, or raise a ValueError.

    Angles from 0 to pi are allowed. nan passes through to the result. An angle beyond pi/2 is below the horizon: the
    BRDF is 0 there.
    """
    array = _float_array(name, theta)
    bad = (array < 0.0) | (array > array.dtype.type(np.pi))
    if bad.any():
        first = np.atleast_1d(array)[np.atleast_1d(bad)][0]
        raise ParameterError(
            name,
            f"{first:.9g} rad ({degrees(first):.6g} degrees) is outside [0, pi] rad",
            float(first),
            (0.0, float(np.pi)),
        )
    return array


def check_phi(name: str, phi: ArrayLike) -> Floats:
    """Return an azimuth [rad] as a float array; nan passes through, values outside [-1e15, 1e15] raise.

    Azimuths of more than two turns give a `DegreesWarning`.
    """
    array = _float_array(name, phi)
    wide = np.abs(array) > PHI_USUAL
    if wide.any():
        beyond = array[wide]
        largest = beyond[np.argmax(np.abs(beyond))]
        if abs(largest) > PHI_MAX:
            raise ParameterError(
                name,
                f"{largest:.9g} rad is outside [-{PHI_MAX:g}, {PHI_MAX:g}] rad",
                float(largest),
                (-PHI_MAX, PHI_MAX),
            )
        warn_of_degrees(
            name, f"{largest:.9g} rad is more than two turns; angles are radians, and np.deg2rad converts degrees"
        )
    return array


def check_azimuth_deg(name: str, phi_deg: ArrayLike) -> None:
    """Raise a ParameterError if an azimuth [degree] is not a finite number of at most two turns."""
    array = np.asarray(phi_deg)
    bad = ~(np.abs(array) <= AZIMUTH_MOST_DEG)  # True for nan, too
    if bad.any():
        first, most = float(array[bad].flat[0]), AZIMUTH_MOST_DEG
        raise ParameterError(name, f"{first:g} is outside [{-most:g}, {most:g}] degrees", first, (-most, most))


def _float_array(name: str, angle: ArrayLike) -> Floats:
    array = np.asarray(angle if type(angle) in PLAIN_TYPES else plain(name, unlabelled(name, angle)))
    if array.dtype.kind not in "iuf":
        raise ParameterError(name, f"{angle!r} is not a number of radians")
    return array if array.dtype in (np.float32, np.float64) else array.astype(np.float64)


@dataclass(frozen=True)
class Angles:
    """Directions of light and viewer by angles [rad], checked: float64, thetas held at the horizon.

    Functions of one angle are computed when a model needs them, and stay on the axis of that angle.
    """

    theta_i: NDArray[np.float64]
    phi_i: NDArray[np.float64]
    theta_r: NDArray[np.float64]
    phi_r: NDArray[np.float64]
    below: NDArray[np.bool_]
    dtype: np.dtype[Any]

    @property
    def given(self) -> tuple[Floats, ...]:
        """The arrays whose shapes broadcast to that of the result."""
        return self.theta_i, self.phi_i, self.theta_r, self.phi_r

    @functools.cached_property
    def lights_scattered(self) -> bool:
        """True if the light changes along the last axis."""
        return _changes(self.theta_i) or _changes(self.phi_i)

    @functools.cached_property
    def scattered(self) -> bool:
        """True if more than the azimuth of the viewer changes along the last axis: rows have too little in common."""
        return self.lights_scattered or _changes(self.theta_r)

    @property
    def vectors(self) -> Vectors:
        """The directions as unit vectors; those below the horizon lie at the horizon."""
        w_i, w_r = unit_vector(self.theta_i, self.phi_i), unit_vector(self.theta_r, self.phi_r)
        return Vectors(w_i, w_r, self.dtype)

    def sine(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the sine of angles [rad]; of scattered ones by a polynomial, whatever their number."""
        return np.asarray(_sines(angle) if self.scattered else np.sin(angle))

    def cosine(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the cosine of angles [rad], as `sine`."""
        return np.asarray(_cosines(angle) if self.scattered else np.cos(angle))

    sin_i = functools.cached_property(lambda self: self.sine(self.theta_i))
    cos_i = functools.cached_property(lambda self: self.cosine(self.theta_i))
    sin_r = functools.cached_property(lambda self: self.sine(self.theta_r))
    cos_r = functools.cached_property(lambda self: self.cosine(self.theta_r))
    x_i = functools.cached_property(lambda self: self.sin_i * self.cosine(self.phi_i))
    y_i = functools.cached_property(lambda self: self.sin_i * self.sine(self.phi_i))
    x_r = functools.cached_property(lambda self: self.sin_r * self.cosine(self.phi_r))
    y_r = functools.cached_property(lambda self: self.sin_r * self.sine(self.phi_r))
    # Read once a call: to keep them costs 1 us each
    cos_phi_i = property(lambda self: self.cosine(self.phi_i))
    sin_phi_i = property(lambda self: self.sine(self.phi_i))
    cos_phi_r = property(lambda self: self.cosine(self.phi_r))
    sin_phi_r = property(lambda self: self.sine(self.phi_r))
    cos_dphi = functools.cached_property(lambda self: self.cosine(self.phi_r - self.phi_i))
    sin_dphi = functools.cached_property(lambda self: self.sine(self.phi_r - self.phi_i))
    one_plus_cos_dphi = functools.cached_property(lambda self: 2.0 * self.cosine((self.phi_r - self.phi_i) / 2.0) ** 2)
    one_less_abs_cos_dphi = property(lambda self: _one_less_abs_cos(self.sin_dphi, self.cos_dphi))


def _one_less_abs_cos(sin: Floats, cos: Floats) -> Floats:
    """Return 1 - abs(cos) [1] with all its digits where abs(cos) is near 1."""
    result: Floats = sin**2 / (1.0 + np.abs(cos))
    return result


def _changes(angle: NDArray[np.float64]) -> bool:
    return angle.ndim > 0 and angle.shape[-1] > 1


def checked_angles(theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike) -> Angles:
    """Check the four angles and note which directions lie below the horizon.

    float32 arrays in give float32 out; the arithmetic is float64. The float32 nearest pi/2 lies above pi/2: it is
    read as the horizon itself, where every model returns its limit from below. ParameterError if the shapes do not
    broadcast.
    """
    given = (theta_i, phi_i, theta_r, phi_r)
    if not PLAIN_TYPES.issuperset(map(type, given)):
        names = ("theta_i", "phi_i", "theta_r", "phi_r")
        given = tuple(plain(name, unlabelled(name, angle)) for name, angle in zip(names, given, strict=True))
    t_i, t_r = check_theta("theta_i", given[0]), check_theta("theta_r", given[2])
    p_i, p_r = check_phi("phi_i", given[1]), check_phi("phi_r", given[3])
    shape_of_angles(t_i, p_i, t_r, p_r)
    return Angles(
        np.minimum(t_i, HALF_PI, dtype=np.float64),
        p_i.astype(np.float64, copy=False),
        np.minimum(t_r, HALF_PI, dtype=np.float64),
        p_r.astype(np.float64, copy=False),
        (t_i > t_i.dtype.type(HALF_PI)) | (t_r > t_r.dtype.type(HALF_PI)),
        asked_for(*given),
    )


@dataclass(frozen=True)
class Vectors:
    """Directions of light and viewer as unit vectors, checked: the properties of `Angles` without trigonometry.

    At a pole, where an azimuth means nothing, the difference of azimuths is 0.
    """

    w_i: Floats
    w_r: Floats
    dtype: np.dtype[Any]

    @property
    def below(self) -> NDArray[np.bool_]:
        """Directions below the horizon: True for each of them."""
        return (self.w_i[..., 2] < 0.0) | (self.w_r[..., 2] < 0.0)

    @property
    def given(self) -> tuple[Floats, ...]:
        """The arrays whose shapes broadcast to that of the result, nan where a vector is nan."""
        i, r = (w[..., 0] + w[..., 1] + w[..., 2] for w in (self.w_i, self.w_r))  # in a third of the time of `sum`
        return i, r

    x_i = functools.cached_property(lambda self: self.w_i[..., 0].astype(np.float64))
    y_i = functools.cached_property(lambda self: self.w_i[..., 1].astype(np.float64))
    cos_i = functools.cached_property(lambda self: np.maximum(self.w_i[..., 2].astype(np.float64), COS_HORIZON))
    sin_i = functools.cached_property(lambda self: np.hypot(self.x_i, self.y_i))
    x_r = functools.cached_property(lambda self: self.w_r[..., 0].astype(np.float64))
    y_r = functools.cached_property(lambda self: self.w_r[..., 1].astype(np.float64))
    cos_r = functools.cached_property(lambda self: np.maximum(self.w_r[..., 2].astype(np.float64), COS_HORIZON))
    sin_r = functools.cached_property(lambda self: np.hypot(self.x_r, self.y_r))
    theta_i = functools.cached_property(lambda self: np.arctan2(self.sin_i, self.cos_i))
    theta_r = functools.cached_property(lambda self: np.arctan2(self.sin_r, self.cos_r))

    @functools.cached_property
    def cos_dphi(self) -> NDArray[np.float64]:
        """cos(phi_r - phi_i)."""
        product = self.sin_i * self.sin_r
        along = self.x_i * self.x_r + self.y_i * self.y_r
        cos: NDArray[np.float64] = np.divide(along, product, where=product > NO_AZIMUTH, out=np.ones_like(along))
        return np.clip(cos, -1.0, 1.0)

    @functools.cached_property
    def one_plus_cos_dphi(self) -> NDArray[np.float64]:
        """1 + cos(phi_r - phi_i) with all its digits next to the mirror half plane."""
        cos = self.cos_dphi
        return np.where(cos < 0.0, self.sin_dphi**2 / (1.0 + np.abs(cos)), 1.0 + cos)

    @functools.cached_property
    def sin_dphi(self) -> NDArray[np.float64]:
        """sin(phi_r - phi_i)."""
        product = self.sin_i * self.sin_r
        across = self.x_i * self.y_r - self.y_i * self.x_r
        sin: NDArray[np.float64] = np.divide(across, product, where=product > NO_AZIMUTH, out=np.zeros_like(across))
        return np.clip(sin, -1.0, 1.0)

    one_less_abs_cos_dphi = property(lambda self: _one_less_abs_cos(self.sin_dphi, self.cos_dphi))


def checked_vectors(wi: ArrayLike, wr: ArrayLike) -> Vectors:
    """Check the unit vectors of light and viewer, each of shape (..., 3); nan passes through to the result.

    float32 arrays in give float32 out; the arithmetic is float64. Below the horizon, z < 0, every model is 0; at z = 0
    it has its limit from above. In long arrays the length of a thousand vectors, evenly spread, is checked.

    Raises
    ------
    ValueError
        If an array has no last axis of 3, does not hold numbers, or holds vectors that are not of length 1, or if the
        shapes do not broadcast.
    """
    wi, wr = plain("wi", unlabelled("wi", wi)), plain("wr", unlabelled("wr", wr))
    w_i, w_r = _unit_vectors("wi", wi), _unit_vectors("wr", wr)
    common_shape("wi, wr", w_i, w_r)
    return Vectors(w_i, w_r, asked_for(wi, wr))


def shape_of_angles(*angles: NDArray[Any]) -> tuple[int, ...]:
    """Return the shape that the four angles broadcast to; ParameterError with their shapes if they do not."""
    return common_shape("theta_i, phi_i, theta_r, phi_r", *angles)


def common_shape(names: str, *arrays: NDArray[Any]) -> tuple[int, ...]:
    """Return the shape that arrays broadcast to; ParameterError with their names and shapes if they do not."""
    shapes = tuple(array.shape for array in arrays)
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError:
        raise ParameterError(names, f"the shapes {', '.join(map(str, shapes))} do not broadcast", shapes) from None


Directions = Angles | Vectors


def _unit_vectors(name: str, w: ArrayLike) -> Floats:
    array = np.asarray(w)
    if array.dtype.kind not in "iuf" or array.ndim == 0 or array.shape[-1] != 3:
        raise ParameterError(
            name, f"{array.dtype} of shape {array.shape} is not an array of vectors, shape (..., 3)", array.shape
        )
    if array.dtype not in (np.float32, np.float64):
        array = array.astype(np.float64)
    count = array.size // 3
    some = array.reshape(-1, 3)[:: max(1, count // 1000)].astype(np.float64)  # a view of contiguous arrays
    length = np.sqrt(np.einsum("ij,ij->i", some, some))
    bad = np.abs(length - 1.0) > UNIT_LENGTH
    if np.any(bad):
        x, y, z = some[bad][0]
        raise ParameterError(name, f"({x:.9g}, {y:.9g}, {z:.9g}) has the length {length[bad][0]:.9g}, not 1", (x, y, z))
    return array


def asked_for(*directions: ArrayLike) -> np.dtype[Any]:
    """Return float32 if the arrays among the directions are, else float64."""
    arrays = [array for array in directions if isinstance(array, np.ndarray | np.generic)]
    single = bool(arrays) and np.result_type(*arrays) == np.float32
    return np.dtype(np.float32 if single else np.float64)


def finished(values: Floats, directions: Directions, *, trailing: int = 0) -> Floats:
    """Broadcast to all directions; 0 below the horizon, nan where a direction is nan, in the dtype asked for.

    `trailing` axes of `values`, such as wavelengths, come after those of the directions. Values that need
    no change are returned without a copy.
    """
    own = np.shape(values)[np.ndim(values) - trailing :]

    def aligned(array: NDArray[Any]) -> NDArray[Any]:
        return array.reshape(array.shape + (1,) * trailing)

    shape = np.broadcast_shapes(np.shape(values), *(aligned(angle).shape for angle in directions.given), own)
    result: Floats = values if np.shape(values) == shape else np.broadcast_to(values, shape)
    if directions.below.any():
        result = np.where(aligned(directions.below), 0.0, result)
    for angle in directions.given:
        if np.isnan(angle).any():
            result = np.where(aligned(np.isnan(angle)), np.nan, result)
    if result.dtype != directions.dtype or not result.flags.writeable:
        result = result.astype(directions.dtype)
    return result[()]


@array_function
def unit_vector(theta: ArrayLike, phi: ArrayLike) -> NDArray[np.float64]:
    """Return the unit vectors, shape (..., 3), of directions (theta, phi) [rad]."""
    angles = np.broadcast_arrays(theta, phi)
    vectors = np.empty((*angles[0].shape, 3))
    of_theta, of_phi = (np.ascontiguousarray(angle, dtype=np.float64).reshape(-1) for angle in angles)
    for view in (of_theta, of_phi):
        view.flags.writeable = False  # the loop is compiled anew for arrays that are writable
    _fill(of_theta, of_phi, vectors.reshape(-1))
    return vectors


@loop
def _fill(theta: NDArray[np.float64], phi: NDArray[np.float64], vectors: NDArray[np.float64]) -> None:
    for j in range(theta.shape[0]):
        sin_theta = sine(theta[j])
        vectors[3 * j] = sin_theta * cos(phi[j])
        vectors[3 * j + 1] = sin_theta * sine(phi[j])
        vectors[3 * j + 2] = cos(theta[j])


@array_function
def spherical_angles(vectors: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the angles (theta, phi) [rad] of vectors of shape (..., 3); phi in (-pi, pi], 0 at the pole."""
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=np.float64), -1, 0)
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)


def vectors_from_half_difference(
    theta_h: ArrayLike, phi_h: ArrayLike, theta_d: ArrayLike, phi_d: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return unit vectors, shape (..., 3), of the directions that `directions_from_half_difference` returns."""
    sin_h, cos_h, sin_d, cos_d = np.sin(theta_h), np.cos(theta_h), np.sin(theta_d), np.cos(theta_d)
    turned = bool(np.any(phi_h))
    sin_phi, cos_phi = np.sin(phi_h), np.cos(phi_h)
    d_x, d_y = sin_d * np.cos(phi_d), sin_d * np.sin(phi_d)
    shape = np.broadcast_shapes(*(np.shape(angle) for angle in (theta_h, phi_h, theta_d, phi_d)))
    light, viewer = np.empty((*shape, 3)), np.empty((*shape, 3))
    # the viewer is the light turned by pi about the half vector
    for w, sign in ((light, 1.0), (viewer, -1.0)):
        x, y = sign * d_x * cos_h + cos_d * sin_h, sign * d_y
        w[..., 0] = x * cos_phi - y * sin_phi if turned else x
        w[..., 1] = x * sin_phi + y * cos_phi if turned else y
        w[..., 2] = cos_d * cos_h - sign * d_x * sin_h
    return light, viewer


def directions_from_half_difference(
    theta_h: ArrayLike, phi_h: ArrayLike, theta_d: ArrayLike, phi_d: ArrayLike
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return directions of light and viewer from half/difference angles (Rusinkiewicz 1998, ``rusinkiewicz1998``).

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
    light, viewer = vectors_from_half_difference(theta_h, 0.0, theta_d, phi_d)
    (theta_i, phi_i), (theta_r, phi_r) = spherical_angles(light), spherical_angles(viewer)
    return theta_i, phi_i + np.asarray(phi_h), theta_r, phi_r + np.asarray(phi_h)


def versine(angle: Floats) -> Floats:
    """Return 1 - cos(angle) [1], with all digits of small angles [rad]."""
    return np.asarray(2.0 * np.sin(0.5 * angle) ** 2)


def common_solid_angle(first: Floats, second: Floats, apart: Floats) -> Floats:
    """Return the solid angle [sr] common to two circular cones of half angles `first` and `second`, axes `apart` [rad].

    It is the area of two sectors less twice the triangle of both axes and a point where the circles cross. L'Huilier's
    formula gives the area of the triangle and half-angle formulas give its angles, so that small cones keep their
    digits.
    """
    half = 0.5 * (first + second + apart)
    # Half the perimeter less each of the three sides
    to_first = np.maximum(0.5 * ((second - first) + apart), 0.0)
    to_second = np.maximum(0.5 * ((first - second) + apart), 0.0)
    to_apart = np.maximum(0.5 * ((first + second) - apart), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):  # cones that do not cross are replaced below
        angle_first = 2.0 * np.arctan(np.sqrt(np.sin(to_first) * np.sin(to_apart) / (np.sin(half) * np.sin(to_second))))
        angle_second = 2.0 * np.arctan(
            np.sqrt(np.sin(to_second) * np.sin(to_apart) / (np.sin(half) * np.sin(to_first)))
        )
        tangents = np.tan(0.5 * half) * np.tan(0.5 * to_first) * np.tan(0.5 * to_second) * np.tan(0.5 * to_apart)
        triangle = 4.0 * np.arctan(np.sqrt(np.maximum(tangents, 0.0)))
        crossing = 2.0 * (angle_first * versine(first) + angle_second * versine(second) - triangle)
    inside = 2.0 * np.pi * versine(np.minimum(first, second))
    crossing = np.where(apart <= np.abs(first - second), inside, crossing)
    return np.where(apart >= first + second, 0.0, crossing)
