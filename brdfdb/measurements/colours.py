"""Spectra that stand for colours: a table over wavelengths gives measured red, green and blue back exactly."""

from __future__ import annotations

from functools import cache

import numpy as np

from brdfdb.parameters import Floats
from brdfdb.spectra import PICTURE_NM, srgb_weights

_EXACT = 1e5  # weight of the colour against the smoothness of a spectrum
# CIE XYZ, of which a white surface has 1, 1 and 1, to linear sRGB (IEC 61966-2-1)
_TO_RGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
_TO_RGB *= np.array([0.9505, 1.0, 1.0890])
_TO_RGB /= _TO_RGB.sum(axis=1, keepdims=True)


@cache
def spectra_of_colours() -> Floats:
    """Return spectra (3, L) [1] over `brdfdb.spectra.PICTURE_NM` whose colours are linear red, green and blue.

    Notes
    -----
    They are not negative, add up to 1, and are as smooth as that allows. A measured colour (R, G, B) has the spectrum
    R, G and B times the three. A value at one wavelength is therefore a guess, the colour of all of them is not.
    """
    from scipy.optimize import nnls

    count = PICTURE_NM.size
    weights = srgb_weights(tuple(PICTURE_NM.tolist()))
    rough = np.diff(np.eye(count), axis=0)
    of_one = np.kron(np.eye(3), rough)
    colour = _EXACT * np.kron(np.eye(3), weights.T)
    whole = _EXACT * np.tile(np.eye(count), 3)
    matrix = np.concatenate([of_one, colour, whole])
    wanted = np.concatenate([np.zeros(len(of_one)), _EXACT * np.eye(3).reshape(-1), np.full(count, _EXACT)])
    return np.asarray(nnls(matrix, wanted, maxiter=100 * matrix.shape[1])[0].reshape(3, count))


def rgb_of(channels: tuple[str, ...], values: Floats) -> Floats:
    """Return linear sRGB (..., 3) of values in the channels R, G, B or X, Y, Z."""
    return np.asarray(values @ _TO_RGB.T) if channels == ("X", "Y", "Z") else values
