"""Slices of a table: the half/difference image, the plane of incidence and the lobe over the hemisphere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb import geometry
from brdfdb.errors import ParameterError
from brdfdb.parameters import Floats

LOBE_SIZE = 256
LEFT_TO_RIGHT = "left to right"
BOTTOM_TO_TOP = "bottom to top"


class Sliced(Protocol):
    """The properties of a table that slices need."""

    @property
    def wavelength_nm(self) -> NDArray[np.float64] | None: ...

    def lookup(
        self,
        theta_i: ArrayLike,
        phi_i: ArrayLike,
        theta_r: ArrayLike,
        phi_r: ArrayLike,
        wavelength_nm: ArrayLike | None = None,
    ) -> Floats:
        """Return f_r [1/sr] at angles [rad]."""


@dataclass(frozen=True)
class SliceAxis:
    """One axis of a slice: `first` and `last` are the pixel centres where `direction` starts and where it ends."""

    name: str
    first: float
    last: float
    direction: str
    unit: str = "degree"


@dataclass(frozen=True, eq=False)
class Slice:
    """A picture of a table: f_r [1/sr] over two angles, row 0 at the top as in an image file.

    Raises
    ------
    ValueError
        If the shape of `values` does not fit `wavelength_nm`.
    """

    kind: str  #: "half_difference", "in_plane" or "lobe"
    description: str  #: explanation of the axes in words
    #: x, y: columns and rows
    x: SliceAxis
    y: SliceAxis
    fixed_deg: tuple[tuple[str, float], ...]  #: the angles that are the same in every pixel, by name [degrees]
    values: NDArray[np.float32]  #: without and with a wavelength axis, (H, W) or (H, W, L) [1/sr]
    wavelength_nm: NDArray[Any] | None  #: the wavelengths of the last axis of `values` [nm], (L,)

    def __post_init__(self) -> None:
        spectral = () if self.wavelength_nm is None else self.wavelength_nm.shape
        if self.values.ndim < 2 or self.values.shape[2:] != spectral:
            raise ParameterError(
                "values", f"shape {self.values.shape} is not (height, width, *{spectral})", self.values.shape
            )


def half_difference_slice(table: Sliced, *, phi_h_deg: float = 0.0, phi_d_deg: float = 90.0) -> Slice:
    """Return f_r [1/sr] over theta_h (to the right) and theta_d (upwards), (90, 90[, L]), one pixel a degree.

    `phi_h_deg` is the azimuth of the half vector; it matters for anisotropic tables only. `phi_d_deg` is the azimuth of
    the light about the half vector. At 90 degrees, the usual choice for pictures of measured materials, light and
    viewer are equally far from the normal and no pixel is below the horizon, where f_r is 0. Column x is theta_h = x +
    0.5 degrees, row y is theta_d = 89.5 - y degrees: the specular lobe is on the left edge, grazing incidence along the
    top, retroreflection along the bottom.
    """
    theta_h_deg = np.arange(90) + 0.5
    theta_d_deg = theta_h_deg[::-1, np.newaxis]
    directions = geometry.directions_from_half_difference(
        *(geometry.radians(angle) for angle in (theta_h_deg, phi_h_deg, theta_d_deg, phi_d_deg))
    )
    return Slice(
        kind="half_difference",
        description="specular lobe on the left edge, grazing incidence at the top, retroreflection at the bottom",
        x=SliceAxis("theta_h", 0.5, 89.5, LEFT_TO_RIGHT),
        y=SliceAxis("theta_d", 0.5, 89.5, BOTTOM_TO_TOP),
        fixed_deg=(("phi_h", phi_h_deg), ("phi_d", phi_d_deg)),
        values=np.asarray(table.lookup(*directions), dtype=np.float32),
        wavelength_nm=table.wavelength_nm,
    )


def in_plane_slice(table: Sliced, *, phi_i_deg: float = 0.0) -> Slice:
    """Return f_r [1/sr] in the plane of incidence over signed theta_r and theta_i (upwards), (90, 180[, L]).

    `phi_i_deg` is the azimuth of the light; it matters for anisotropic tables only. Column x is theta_r = x - 89.5
    degrees, positive on the mirror side (phi_r = phi_i + 180 degrees) and negative back towards the light (phi_r =
    phi_i); row y is theta_i = 89.5 - y degrees. The mirror direction is the diagonal from the middle of the bottom edge
    to the top right corner, retroreflection the one to the top left corner.
    """
    signed_deg = np.arange(180) - 89.5
    theta_i_deg = np.arange(90)[::-1, np.newaxis] + 0.5
    phi_r_deg = phi_i_deg + np.where(signed_deg > 0.0, 180.0, 0.0)
    directions = (geometry.radians(angle) for angle in (theta_i_deg, phi_i_deg, np.abs(signed_deg), phi_r_deg))
    return Slice(
        kind="in_plane",
        description="theta_r is positive on the mirror side and negative back towards the light",
        x=SliceAxis("signed theta_r", -89.5, 89.5, LEFT_TO_RIGHT),
        y=SliceAxis("theta_i", 0.5, 89.5, BOTTOM_TO_TOP),
        fixed_deg=(("phi_i", phi_i_deg),),
        values=np.asarray(table.lookup(*directions), dtype=np.float32),
        wavelength_nm=table.wavelength_nm,
    )


def lobe_map(table: Sliced, *, theta_i_deg: float = 45.0, phi_i_deg: float = 0.0) -> Slice:
    """Return f_r [1/sr] over the hemisphere of viewers for one light, a disc with the radius theta_r, (256, 256[, L]).

    The surface is seen from above and turned so that the light comes from the left: the point (x, y) degrees from the
    centre, x to the right and y upwards, is x = -theta_r cos(phi_r - phi_i), y = -theta_r sin(phi_r - phi_i).
    Retroreflection is thus theta_i to the left of the centre, the mirror direction theta_i to the right, and phi_r
    grows counter-clockwise. f_r is 0 outside the disc. The azimuth of the light matters for anisotropic tables only.
    ParameterError if `theta_i_deg` is outside [0, 90].
    """
    if not 0.0 <= theta_i_deg <= 90.0:
        raise ParameterError("theta_i_deg", f"{theta_i_deg:g} is outside [0, 90] degrees", theta_i_deg, (0.0, 90.0))
    pitch = 180.0 / LOBE_SIZE
    x_deg = (np.arange(LOBE_SIZE) + 0.5) * pitch - 90.0
    y_deg = x_deg[::-1, np.newaxis]
    # the corners reach theta_r = 127 degrees: below the horizon, where a table is 0
    theta_r_deg = np.hypot(x_deg, y_deg)
    phi_r_deg = phi_i_deg + geometry.degrees(np.arctan2(-y_deg, -x_deg))
    directions = (geometry.radians(angle) for angle in (theta_i_deg, phi_i_deg, theta_r_deg, phi_r_deg))
    edge = 90.0 - 0.5 * pitch
    return Slice(
        kind="lobe",
        description="radius = theta_r, seen from above, light from the left, mirror direction on the right",
        x=SliceAxis("-theta_r cos(phi_r - phi_i)", -edge, edge, LEFT_TO_RIGHT),
        y=SliceAxis("-theta_r sin(phi_r - phi_i)", -edge, edge, BOTTOM_TO_TOP),
        fixed_deg=(("theta_i", theta_i_deg), ("phi_i", phi_i_deg)),
        values=np.asarray(table.lookup(*directions), dtype=np.float32),
        wavelength_nm=table.wavelength_nm,
    )
