"""Stokes vectors: THE convention of polarised light, rotations between bases, and the record of a polarised table.

* The Stokes vector is (I, Q, U, V) of the fields E_s and E_p that travel along k, varying as exp(i k.r - i omega t):
  I = abs(E_s)^2 + abs(E_p)^2, Q = abs(E_s)^2 - abs(E_p)^2, U + iV = 2 E_s conj(E_p). Q > 0 is s-polarised, U > 0 is
  linear along s + p, and V > 0 turns counter-clockwise for an observer who looks towards the incoming light.
* (p, s, k) is right-handed: p = s x k. Light travels along -w_i before and along w_r after reflection.
* The basis of the surface: s = z x w / abs(z x w) for light and viewer, horizontal, which is (-sin phi, cos phi, 0).
  Functions of unit vectors take 0 as the azimuth of the pole.
* The basis of the plane of light and viewer, in which a facet mirrors one to the other: s along w_i x w_r for both.
* A Mueller matrix acts on the column of the incident light: a row belongs to the reflected light.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field

from brdfdb.geometry import unit_vector
from brdfdb.parameters import Floats

_NO_PLANE = 1e-12  # sine of the angle between light and viewer below which any plane through both serves

CONVENTION = (
    "Stokes vectors (I, Q, U, V): Q > 0 is s-polarised, U > 0 linear along s + p, V > 0 counter-clockwise for an "
    "observer who looks towards the incoming light; p = s x k, with k the direction of travel"
)
SURFACE_BASIS = "s = z x w / |z x w|, horizontal, for light and viewer"
PLANE_BASIS = "s = w_i x w_r / |w_i x w_r|, normal to the plane of light and viewer, for both"
POLARISATION_VERSION = 1  # of the arrays, and of the record, of a polarised table
MEASURED_POLARISATION_VERSION = 2  # of those of measured data
ELEMENTS = ("m01", "m22", "m23")

Matrix = list[list[float]]


class Plane(NamedTuple):
    """The plane of light and viewer, seen from the basis of the surface.

    `theta_d` [rad] is half the angle between light and viewer. `light` and `viewer` (..., 4, 4) rotate Stokes vectors:
    of the light from the basis of the surface to that of the plane, of the viewer back. The Mueller matrix between
    bases of the surface is ``viewer @ M @ light`` of that between bases of the plane.
    """

    theta_d: NDArray[np.float64]
    light: NDArray[np.float64]
    viewer: NDArray[np.float64]


def rotation(angle: ArrayLike) -> NDArray[np.float64]:
    """Return the rotation (..., 4, 4) of Stokes vectors to a basis whose s is turned by `angle` [rad] from s to p.

    Examples
    --------
    >>> (rotation(np.pi / 4) @ [1.0, 0.0, 1.0, 0.0]).round(9).tolist()  # linear along s + p is s there
    [1.0, 1.0, 0.0, 0.0]
    """
    twice = 2.0 * np.asarray(angle, dtype=np.float64)
    return _turned(np.cos(twice), np.sin(twice))


def plane(theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike) -> Plane:
    """Return the plane of light and viewer at angles [rad], which broadcast."""
    angles = np.broadcast_arrays(*(np.asarray(angle, np.float64) for angle in (theta_i, phi_i, theta_r, phi_r)))
    w_i = unit_vector(angles[0], angles[1])
    w_r = unit_vector(angles[2], angles[3])
    s_i = horizontal(angles[1])
    s_r = horizontal(angles[3])
    normal = np.cross(w_i, w_r)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    s = np.where(length > _NO_PLANE, normal / np.maximum(length, _NO_PLANE), s_i)
    return Plane(half_angle(w_i, w_r), _to(s, s_i, -w_i), np.swapaxes(_to(s, s_r, w_r), -1, -2))


def half_angle(w_i: Floats, w_r: Floats) -> NDArray[np.float64]:
    """Return theta_d [rad], half the angle between unit vectors (..., 3)."""
    return np.asarray(np.arctan2(np.linalg.norm(w_i - w_r, axis=-1), np.linalg.norm(w_i + w_r, axis=-1)))


def horizontal(phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return s (..., 3) of the basis of the surface for a direction of azimuth phi [rad]."""
    return np.stack([-np.sin(phi), np.cos(phi), np.zeros_like(phi)], axis=-1)


def _to(s: NDArray[np.float64], own: NDArray[np.float64], k: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation to the basis of `s` from that of `own`, unit vectors normal to the direction of travel k."""
    cos = np.sum(s * own, axis=-1)
    sin = np.sum(s * np.cross(own, k), axis=-1)
    return _turned(cos * cos - sin * sin, 2.0 * cos * sin)


def _turned(cos: NDArray[np.float64], sin: NDArray[np.float64]) -> NDArray[np.float64]:
    matrix = np.zeros((*np.shape(cos), 4, 4))
    matrix[..., 0, 0] = matrix[..., 3, 3] = 1.0
    matrix[..., 1, 1] = matrix[..., 2, 2] = cos
    matrix[..., 1, 2], matrix[..., 2, 1] = sin, -sin
    return matrix


class ElementError(BaseModel):
    """Error of the normalised elements m_ij / m_00 of a table, abs(table - model), each at its worst wavelength."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    directions: int = Field(
        description="number of random pairs above the horizon, half over the hemisphere and half in the lobe"
    )
    seed: int
    p99: Matrix = Field(description="[row][column] of the Mueller matrix, between bases of the surface")
    max: Matrix = Field(description="[row][column]")
    between_p99: Matrix | None = Field(
        description="[row][column], half way between neighbouring wavelengths; null: there is one wavelength"
    )
    between_max: Matrix | None = Field(description="[row][column], as between_p99")

    facet: float = Field(
        description="largest error of the stored elements, between bases of the plane, over theta_d: what physical "
        "realisability is judged with"
    )
    between_facet: float | None = Field(description="as facet, half way between neighbouring wavelengths")

    @property
    def worst_p99(self) -> float:
        """Return the largest p99 of all elements."""
        return float(np.max(self.p99))


class MeasuredElements(BaseModel):
    """Measured Mueller matrices of a table: which elements, how near the table is to them, and how physical they are.

    Errors are abs(table - measured) of the normalised elements m_ij / m_00, of the worst element.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    rows: int = Field(ge=2, le=4, description="number of rows I, Q, U, V that were measured")
    columns: int = Field(ge=2, le=4, description="number of columns I, Q, U, V that were measured")
    samples: int = Field(description="number of directions with Mueller matrices")
    table_p99: float = Field(description="99 of 100 elements at the measured directions are this near to the table")
    held_out_p99: float | None = Field(
        description="99 of 100 elements are this near to the interpolation of the samples of other lights; the lowest "
        "and the highest light are not left out; null: there are fewer than three lights"
    )
    noise: float = Field(
        description="what 99 of 100 values of normal noise with the median error of samples that were left out at "
        "random are within, which outliers do not widen: eigenvalues may be below 0 by it"
    )
    physical: float = Field(
        description="share [0, 1] of the matrices without negative eigenvalue of the coherency matrix; of fewer than "
        "sixteen elements that of the Stokes criterion"
    )
    stokes: float = Field(description="share [0, 1] of the matrices that make no light more than fully polarised")
    statement: list[str] = Field(description="the shares in words: the criterion, its tolerance, and where it fails")

    @property
    def p99(self) -> float:
        """Return the larger of the errors: that of elements of the table."""
        return max(self.table_p99, self.held_out_p99 or 0.0)


class Polarisation(BaseModel):
    """The record of a polarised table: convention, the stored elements, and their error."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    version: int = Field(
        description="version of the arrays: 1 of a model, mueller over mueller_theta_d, and depolarised; 2 of "
        "measured data, mueller over mueller_theta_h, mueller_theta_d and mueller_phi_d"
    )
    convention: str = Field(description="meaning of Stokes vectors, in words")
    surface_basis: str = Field(description="basis of lookups and of the error, in words")
    plane_basis: str = Field(description="basis of the stored elements, in words")
    elements: list[str] = Field(
        description="stored elements, m_ij over m_00; of a model, of the light that is not depolarised"
    )
    reconstruction: str = Field(description="the way from the arrays to the Mueller matrix, in words")
    error: ElementError | None = Field(default=None, description="the stated error of the elements; null: not measured")
    measured: MeasuredElements | None = Field(
        default=None, description="what was measured of the elements; null: they are a model's"
    )

    @property
    def p99(self) -> float | None:
        """Return the 99th percentile of the error of the worst element; None if it was not measured."""
        stated = self.measured.p99 if self.measured is not None else None
        return stated if self.error is None else self.error.worst_p99

    @property
    def in_words(self) -> str:
        """The stored elements and their error, in a sentence."""
        error = "error not stated" if self.p99 is None else f"99 of 100 elements are within {self.p99:.2g}"
        return f"Mueller matrices; stored are {', '.join(self.elements)}, over m_00; {error}"


def record(error: ElementError | None = None) -> Polarisation:
    """Return the record of a polarised table."""
    return Polarisation(
        version=POLARISATION_VERSION,
        convention=CONVENTION,
        surface_basis=SURFACE_BASIS,
        plane_basis=PLANE_BASIS,
        elements=list(ELEMENTS),
        reconstruction=(
            "m10 = m01, m11 = 1, m33 = m22, m32 = -m23, others 0, at theta_d, half the angle between light and viewer, "
            "cubic over theta_d and wavelength; f_r - depolarised times that matrix, between bases of the plane, plus "
            "depolarised in the first element"
        ),
        error=error,
    )


def measured_record(elements: tuple[str, ...], measured: MeasuredElements) -> Polarisation:
    """Return the record of a polarised table of measured data."""
    basis = "surface" if (measured.rows, measured.columns) == (2, 2) else "plane"
    return Polarisation(
        version=MEASURED_POLARISATION_VERSION,
        convention=CONVENTION,
        surface_basis=SURFACE_BASIS,
        plane_basis=PLANE_BASIS,
        elements=list(elements),
        reconstruction=(
            "f_r times the matrix of m00 = 1 and the elements, linear over theta_h, theta_d, phi_d and wavelength, "
            f"between bases of the {basis}; where mueller_phi_d ends at 180, that of the mirror image has the opposite "
            "sign where one of row and column is U or V; elements that are not stored were not measured"
        ),
        measured=measured,
    )


def reflected(matrix: ArrayLike, incident: ArrayLike) -> NDArray[np.float64]:
    """Return Stokes vectors (..., 4) of the light that matrices (..., 4, 4) reflect of incident light (4,).

    An element that was not measured, nan, makes a component unknown only where the incident light has the one that it
    is multiplied by.
    """
    light = np.asarray(incident, np.float64)
    return np.asarray(np.where(light != 0.0, np.asarray(matrix, np.float64), 0.0) @ light)
