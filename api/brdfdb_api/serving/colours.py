"""Colours of what is looked up: XYZ and linear sRGB under a named illuminant, and a swatch of a whole material."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import radians, unit_vector
from brdfdb.parameters import Floats
from brdfdb.spectra import (
    check_illuminant,
    colour_science,
    covers_visible,
    picture_wavelengths,
    srgb_weights,
    xyz_weights,
)

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

Colour = Literal["xyz", "linear-srgb"]

_WAVELENGTHS = 1000  # largest number of wavelengths of a colour: the cost of its weights grows with the square
_LIGHT_DEG = 45.0  # theta_i of the swatch
_SAMPLES = 256  # viewers of the swatch
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


def weights(colour: Colour, wavelength_nm: NDArray[np.float64] | None, illuminant: str) -> NDArray[np.float64]:
    """Weights (L, 3) from a spectrum to a colour, (1, 3) of a grey material; white is Y = 1, or (1, 1, 1).

    Raises
    ------
    ValueError
        For an unknown illuminant, with the closest names; for more than 1000 wavelengths [nm],
        or such that make no colour.
    """
    check_illuminant(illuminant)
    if wavelength_nm is not None and wavelength_nm.size > _WAVELENGTHS:
        raise ParameterError(
            "wavelength_nm",
            f"{wavelength_nm.size} wavelengths are more than the {_WAVELENGTHS} that a colour is of",
            wavelength_nm.size,
            (1, _WAVELENGTHS),
        )
    if wavelength_nm is not None and not covers_visible(wavelength_nm):
        raise ParameterError(
            "wavelength_nm",
            "a colour needs increasing wavelengths from 420 nm or less to 680 nm or more in steps of at most 20 nm",
        )
    # a grey material is a flat spectrum: any wavelengths sum to the same
    at = (380.0, 780.0) if wavelength_nm is None else tuple(wavelength_nm.tolist())
    weights_at = (xyz_weights if colour == "xyz" else srgb_weights)(at, illuminant)
    return weights_at.sum(axis=0, keepdims=True) if wavelength_nm is None else weights_at


def coloured(values: Floats, of: NDArray[np.float64], *, grey: bool) -> Floats:
    """Colours (..., 3) of spectra (..., L), or of grey values (...)."""
    whole = np.asarray(values)
    return np.asarray((whole[..., np.newaxis] if grey else whole) @ of)


def swatch(table: Table) -> str:
    """Return the colour of a table under D65 as ``#rrggbb``: albedo for light at 45 degrees, specular part included.

    Grey where its wavelengths do not reach from 420 to 680 nm. For display only: the albedo is a mean over few
    directions.
    """
    from brdfdb.integrals.sampling import DIFFUSE, directions, mixture_density

    wi = unit_vector(radians(_LIGHT_DEG), 0.0)
    number = np.arange(_SAMPLES) + 0.5
    middle = None if table.wavelength_nm is None else np.array(table.wavelength_nm[table.wavelength_nm.size // 2])
    lobe = None if table.source is None else table.source.lobe(wi[2], middle)
    wr = directions(lobe or DIFFUSE, number / _SAMPLES, number * _GOLDEN % 1.0, wi)
    density = mixture_density(lobe or DIFFUSE, wi, wr)
    cosine = np.maximum(wr[:, 2], 0.0)
    weight = np.divide(cosine, density, out=np.zeros(_SAMPLES), where=density > 0.0) / _SAMPLES
    visible = None if table.wavelength_nm is None else picture_wavelengths(table.wavelength_nm)
    f_r = np.asarray(table.lookup_vectors(wi, wr, visible)).reshape(_SAMPLES, -1)
    reflected = weight @ f_r + np.ravel(table.specular_reflectance(radians(_LIGHT_DEG), visible))
    rgb = np.full(3, reflected.mean()) if visible is None else reflected @ srgb_weights(tuple(visible.tolist()))
    encoded = colour_science().cctf_encoding(np.clip(rgb, 0.0, 1.0), function="sRGB")
    return "#" + "".join(f"{round(255.0 * value):02x}" for value in encoded.tolist())
