"""Angles of pairs of directions as programs of measurement and optical design name them, and the directions of angles.

Every system begins at 0 on each axis. Directions of nodes below the horizon do not exist. Interpolation next to the
horizon needs values there, so that the value at such a node is that of the closest direction above the horizon: of the
same half vector, or on the same line to the specular direction.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple, Self

import numpy as np

from brdfdb.parameters import Floats

HALF_PI = 0.5 * np.pi

# Largest polar angles [rad] at which a table is looked up. At 90 degrees f_r of many models has a pole: a node there
# with a finite value of the right size is better. Others have lobes that lie closer to the horizon.
STEEPEST = float(np.deg2rad(89.5))
STEEPER = float(np.deg2rad(89.95))


class LightAndViewer(NamedTuple):
    """Unit vectors (N, 3) of light and viewer."""

    wi: Floats
    wr: Floats


@dataclass(frozen=True)
class System(ABC):
    """A system of angles [rad] of a pair of directions: a polar angle and an azimuth, twice."""

    anisotropic: bool  #: false: without the first azimuth; the second one counts from it
    mirrored: bool = True  #: f_r is the same for the negative second azimuth, so that it ends at pi
    steepest: float = field(default=STEEPEST, kw_only=True)  #: largest polar angle of directions of nodes, [rad]

    names: ClassVar[tuple[str, ...]]

    @property
    @abstractmethod
    def ends_of_four(self) -> tuple[float, ...]:
        """Largest value [rad] of each of the four angles."""

    @abstractmethod
    def angles(self, wi: Floats, wr: Floats) -> Floats:
        """Return the angles [rad], shape (N, axes), of unit vectors (N, 3) of light and viewer."""

    @abstractmethod
    def vectors(self, angles: Floats) -> LightAndViewer:
        """Return unit vectors for angles (N, axes) [rad], also below the horizon."""

    @abstractmethod
    def directions(self, angles: Floats) -> LightAndViewer:
        """Return unit vectors for angles (N, axes) [rad]; those below the horizon are moved above it."""

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the angles."""
        return self.names if self.anisotropic else (self.names[0], *self.names[2:])

    @property
    def ends(self) -> tuple[float, ...]:
        """Largest value [rad] of each angle."""
        four = self.ends_of_four
        return four if self.anisotropic else (four[0], *four[2:])

    def steeper(self) -> Self:
        """Return the same system with directions of nodes that come closer to the horizon."""
        return replace(self, steepest=STEEPER)

    def _stacked(self, *four: Floats) -> Floats:
        """Return the angles, shape (N, axes), of all four."""
        return np.stack(four if self.anisotropic else (four[0], *four[2:]), axis=1)


class Spherical(System):
    """Polar angle and azimuth of light and viewer."""

    names = ("theta_i", "phi_i", "theta_r", "phi_r")

    @property
    def ends_of_four(self) -> tuple[float, ...]:
        return HALF_PI, 2.0 * np.pi, HALF_PI, 2.0 * np.pi / (1 + self.mirrored)

    def angles(self, wi: Floats, wr: Floats) -> Floats:
        phi_i = _azimuth(wi[:, 0], wi[:, 1])
        phi_r = _azimuth(wr[:, 0], wr[:, 1])
        if not self.anisotropic:
            phi_r = (phi_r - phi_i) % (2.0 * np.pi)
        return self._stacked(_polar(wi), phi_i, _polar(wr), _folded(phi_r) if self.mirrored else phi_r)

    def vectors(self, angles: Floats) -> LightAndViewer:
        from brdfdb.geometry import unit_vector

        theta_i, phi_i, theta_r, phi_r = _four(angles)
        return LightAndViewer(unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r))

    def directions(self, angles: Floats) -> LightAndViewer:
        theta_i, phi_i, theta_r, phi_r = _four(angles)
        theta_i = np.minimum(theta_i, self.steepest)
        theta_r = np.minimum(theta_r, self.steepest)
        return self.vectors(np.stack([theta_i, phi_i, theta_r, phi_r], axis=1))


class Specular(System):
    """The light, and the viewer about the specular direction.

    The polar angle of the viewer is that from the specular direction. Its azimuth is 0 from there towards the normal
    and grows counter-clockwise as seen from above (libbsdf, ``SpecularCoordinateSystem``; Zemax has the same).
    """

    names = ("theta_i", "phi_i", "theta_s", "phi_s")

    @property
    def ends_of_four(self) -> tuple[float, ...]:
        return HALF_PI, 2.0 * np.pi, np.pi, 2.0 * np.pi / (1 + self.mirrored)

    def angles(self, wi: Floats, wr: Floats) -> Floats:
        theta_i = _polar(wi)
        phi_i = _azimuth(wi[:, 0], wi[:, 1])
        w = _tilted(_turned(wr, -phi_i), theta_i)
        phi_s = _azimuth(w[:, 0], w[:, 1])
        return self._stacked(theta_i, phi_i, _polar(w), _folded(phi_s) if self.mirrored else phi_s)

    def vectors(self, angles: Floats) -> LightAndViewer:
        from brdfdb.geometry import unit_vector

        theta_i, phi_i, theta_s, phi_s = _four(angles)
        viewer = _turned(_tilted(unit_vector(theta_s, phi_s), -theta_i), phi_i)
        return LightAndViewer(unit_vector(theta_i, phi_i), viewer)

    def directions(self, angles: Floats) -> LightAndViewer:
        theta_i, phi_i, theta_s, phi_s = _four(angles)
        theta_i = np.minimum(theta_i, self.steepest)
        # The cosine to the normal is length cos(theta_s - inclined): it is the lowest one at the largest theta_s
        inclined = np.arctan2(np.sin(theta_i) * np.cos(phi_s), np.cos(theta_i))
        length = np.hypot(np.cos(theta_i), np.sin(theta_i) * np.cos(phi_s))
        largest = inclined + np.arccos(np.minimum(np.cos(self.steepest) / length, 1.0))
        return self.vectors(np.stack([theta_i, phi_i, np.minimum(theta_s, np.maximum(largest, 0.0)), phi_s], axis=1))


@dataclass(frozen=True)
class HalfDifference(System):
    """The half vector, and the light about it (Rusinkiewicz 1998, ``rusinkiewicz1998``).

    Attributes
    ----------
    mirrored, reciprocal : bool
        f_r is the same for -phi_d, and for phi_d + pi, where light and viewer are exchanged. Each halves the range of
        phi_d.
    """

    reciprocal: bool = True

    names = ("theta_h", "phi_h", "theta_d", "phi_d")

    @property
    def ends_of_four(self) -> tuple[float, ...]:
        return HALF_PI, 2.0 * np.pi, HALF_PI, 2.0 * np.pi / (1 + self.mirrored) / (1 + self.reciprocal)

    def angles(self, wi: Floats, wr: Floats) -> Floats:
        half = wi + wr
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        theta_h = _polar(half)
        phi_h = _azimuth(half[:, 0], half[:, 1])
        d = _tilted(_turned(wi, -phi_h), -theta_h)
        phi_d = _azimuth(d[:, 0], d[:, 1])
        if self.mirrored:
            phi_d = _folded(phi_d)
            phi_d = np.minimum(phi_d, np.pi - phi_d) if self.reciprocal else phi_d
        elif self.reciprocal:
            phi_d = phi_d % np.pi
        return self._stacked(theta_h, phi_h, np.minimum(_polar(d), HALF_PI), phi_d)

    def vectors(self, angles: Floats) -> LightAndViewer:
        from brdfdb.geometry import unit_vector

        theta_h, phi_h, theta_d, phi_d = _four(angles)
        d = unit_vector(theta_d, phi_d)
        opposite = d * np.array([-1.0, -1.0, 1.0])
        return LightAndViewer(_turned(_tilted(d, theta_h), phi_h), _turned(_tilted(opposite, theta_h), phi_h))

    def directions(self, angles: Floats) -> LightAndViewer:
        theta_h, phi_h, theta_d, phi_d = _four(angles)
        theta_h = np.minimum(theta_h, self.steepest)
        # The lower one of the two directions has the cosine length cos(theta_d + inclined) to the normal
        inclined = np.arctan2(np.sin(theta_h) * np.abs(np.cos(phi_d)), np.cos(theta_h))
        length = np.hypot(np.cos(theta_h), np.sin(theta_h) * np.cos(phi_d))
        largest = np.maximum(np.arccos(np.minimum(np.cos(self.steepest) / length, 1.0)) - inclined, 0.0)
        return self.vectors(np.stack([theta_h, phi_h, np.minimum(theta_d, largest), phi_d], axis=1))


def _polar(w: Floats) -> Floats:
    return np.asarray(np.arctan2(np.hypot(w[:, 0], w[:, 1]), w[:, 2]))


def _azimuth(x: Floats, y: Floats) -> Floats:
    """Return azimuths [rad] in [0, 2 pi)."""
    phi = np.arctan2(y, x)
    return np.where(phi < 0.0, phi + 2.0 * np.pi, phi) % (2.0 * np.pi)


def _turned(w: Floats, phi: Floats) -> Floats:
    """Return vectors (N, 3) turned about the normal by an azimuth [rad]."""
    c, s = np.cos(phi), np.sin(phi)
    return np.stack([c * w[:, 0] - s * w[:, 1], s * w[:, 0] + c * w[:, 1], w[:, 2]], axis=1)


def _tilted(w: Floats, theta: Floats) -> Floats:
    """Return vectors (N, 3) tilted in the plane of x and z, so that the normal moves by theta [rad] towards x."""
    c, s = np.cos(theta), np.sin(theta)
    return np.stack([c * w[:, 0] + s * w[:, 2], w[:, 1], c * w[:, 2] - s * w[:, 0]], axis=1)


def _four(angles: Floats) -> Floats:
    """Return four rows of angles (N, 3) or (N, 4) [rad]; the second angle is 0 if there are three."""
    columns = angles.T
    return columns if len(columns) == 4 else np.insert(columns, 1, 0.0, axis=0)


def _folded(phi: Floats) -> Floats:
    """Return azimuths [rad] of the mirror image with an azimuth in [0, pi]."""
    phi = np.abs(phi) % (2.0 * np.pi)
    return np.minimum(phi, 2.0 * np.pi - phi)
