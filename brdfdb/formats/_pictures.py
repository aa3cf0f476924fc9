"""Pictures of tables: slices by name, and their colours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdfdb import spectra
from brdfdb.tables import slices
from brdfdb.tables.slices import Slice
from brdfdb.tables.table import Table

RGB_COLOUR = "linear sRGB, D65"
RGB_GREY = "grey: colour was not measured"
RGB_MEAN = "grey: colour was not measured, mean over the wavelengths"


def slice_of(table: Table, kind: str, theta_i: float, phi_i: float) -> Slice:
    """Return the slice of a kind, for a light at theta_i, phi_i [degree], as the formats of pictures take them."""
    if kind == "lobe":
        return slices.lobe_map(table, theta_i_deg=theta_i, phi_i_deg=phi_i)
    if kind == "in_plane":
        return slices.in_plane_slice(table, phi_i_deg=phi_i)
    return slices.half_difference_slice(table, phi_h_deg=phi_i)


def rgb_of(image: Slice) -> tuple[NDArray[np.float32], str]:
    """Return R, G, B of a slice, shape (H, W, 3), and their meaning in words."""
    if image.wavelength_nm is None:
        grey = image.values
        meaning = RGB_GREY
    elif spectra.covers_visible(image.wavelength_nm):
        return np.asarray(spectra.linear_srgb(image.wavelength_nm, image.values), dtype=np.float32), RGB_COLOUR
    else:
        grey = image.values.mean(axis=-1, dtype=np.float64).astype(np.float32)
        meaning = RGB_MEAN
    return np.repeat(grey[..., np.newaxis], 3, axis=-1), meaning
