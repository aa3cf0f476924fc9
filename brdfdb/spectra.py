"""Colours of reflectance spectra: XYZ under any light, and linear sRGB.

Colour-matching functions, illuminants and the primaries of sRGB are those of `colour-science`.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from functools import cache, lru_cache
from itertools import groupby
from operator import itemgetter
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.errors import ParameterError
from brdfdb.parameters import closest

ILLUMINANT = "D65"
OBSERVER = "CIE 1931 2 Degree Standard Observer"
# Wavelengths make a colour if they reach from 420 to 680 nm in steps of 20 nm or less
VISIBLE_FROM_NM = 420.0
VISIBLE_TO_NM = 680.0
VISIBLE_STEP_NM = 20.0
MOST_OF_A_COLOUR = 1000  # wavelengths of a colour: the cost of its weights grows with the square
PICTURE_NM = np.arange(VISIBLE_FROM_NM, VISIBLE_TO_NM + 1.0, VISIBLE_STEP_NM)  # wavelengths of a picture


def covers_visible(wavelength_nm: ArrayLike) -> bool:
    """Return True if wavelengths [nm] are enough for a colour: from 420 or less to 680 or more, in steps up to 20."""
    wavelength = np.asarray(wavelength_nm, dtype=np.float64)
    if wavelength.ndim != 1 or wavelength.size < 2:
        return False
    step = np.diff(wavelength)
    return bool(
        wavelength[0] <= VISIBLE_FROM_NM
        and wavelength[-1] >= VISIBLE_TO_NM
        and np.all((step > 0.0) & (step <= VISIBLE_STEP_NM))
    )


def picture_wavelengths(stored_nm: ArrayLike) -> NDArray[np.float64] | None:
    """Return the wavelengths [nm] at which a picture looks up a table: 420 to 680 in steps of 20, or None.

    None stands for a table whose wavelengths `stored_nm`, in increasing order, do not reach from 420 to 680 nm. A
    picture of it is grey. Steps of a table may be wider than 20 nm: its lookups interpolate between its wavelengths.
    """
    stored = np.asarray(stored_nm, dtype=np.float64).reshape(-1)
    if stored.size < 2 or stored[0] > VISIBLE_FROM_NM or stored[-1] < VISIBLE_TO_NM:
        return None
    return PICTURE_NM


def colour_wavelengths(stored_nm: ArrayLike) -> NDArray[np.float64] | None:
    """Return the wavelengths [nm] of which a colour of a table is summed; None if they do not reach over the visible.

    They are the wavelengths of the table, `stored_nm` in increasing order, where these are close enough, else those of
    `picture_wavelengths`.
    """
    stored = np.asarray(stored_nm, dtype=np.float64).reshape(-1)
    return stored if covers_visible(stored) else picture_wavelengths(stored)


@cache
def colour_science() -> Any:
    """Return the package `colour`, imported when colours are first needed: a second or more."""
    with warnings.catch_warnings():
        # colour-science warns on import where its optional plotting library is missing; nothing here plots
        warnings.filterwarnings("ignore", message='"Matplotlib" related API features are not available')
        import colour

    return colour


def check_illuminant(name: str) -> str:
    """Return the name of an illuminant of colour-science, or raise a ParameterError with all names."""
    names = tuple(colour_science().SDS_ILLUMINANTS)
    if name not in names:
        sentence = f"{name!r} is unknown{closest(name, names)}; allowed are {_in_runs(names)}"
        raise ParameterError("illuminant", sentence, name, names)
    return name


def _in_runs(names: Sequence[str]) -> str:
    """Return names as a text in which those that are numbered one after the other are a run: A, FL1 to FL12."""
    stems = (re.fullmatch(r"(.*?)(\d*)", name) for name in names)
    numbered = [(stem[1], int(stem[2] or 0) - place) for place, stem in enumerate(stems) if stem]
    runs = [[name for name, _ in run] for _, run in groupby(zip(names, numbered, strict=True), itemgetter(1))]
    return ", ".join(f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(run) for run in runs)


def check_observer(name: str) -> str:
    """Return the name of a standard observer of the CIE, or raise a ValueError with all names."""
    names = [observer for observer in colour_science().MSDS_CMFS if "Standard Observer" in observer]
    if name not in names:
        raise ParameterError("observer", f"{name!r} is not one of {', '.join(names)}", name, tuple(names))
    return name


def illuminant_spectrum(name: str, wavelength_nm: ArrayLike) -> NDArray[np.float64]:
    """Return relative spectral power [1] of an illuminant of colour-science: 1 at 560 nm, linear between samples."""
    spectrum = colour_science().SDS_ILLUMINANTS[check_illuminant(name)]
    at = spectrum.wavelengths
    power = spectrum.values
    return np.asarray(np.interp(np.asarray(wavelength_nm), at, power) / np.interp(560.0, at, power))


@lru_cache(maxsize=64)  # bounded, because clients choose wavelengths, too
def xyz_weights(
    wavelengths: tuple[float, ...], illuminant: str = ILLUMINANT, observer: str = OBSERVER
) -> NDArray[np.float64]:
    """Return weights (L, 3) that take a reflectance spectrum at `wavelengths` [nm] to X, Y, Z: Y = 1 of a white one.

    The sums of the columns are X, Y and Z of the illuminant. Summed in steps of 1 nm from 360 to 780 nm, the practice
    of ASTM E308; between samples the spectrum is a straight line, beyond the first and the last it is constant.
    """
    colour = colour_science()
    shape = colour.SPECTRAL_SHAPE_ASTME308
    matching = colour.MSDS_CMFS[check_observer(observer)].copy().align(shape)
    light = colour.SDS_ILLUMINANTS[check_illuminant(illuminant)].copy().align(shape)
    spread = np.stack([np.interp(shape.wavelengths, wavelengths, unit) for unit in np.eye(len(wavelengths))], axis=-1)
    xyz = spread.T @ (matching.values * light.values[:, np.newaxis])
    return np.asarray(xyz / xyz[:, 1].sum(), dtype=np.float64)


@lru_cache(maxsize=64)
def srgb_weights(
    wavelengths: tuple[float, ...], illuminant: str = ILLUMINANT, observer: str = OBSERVER
) -> NDArray[np.float64]:
    """Return weights (L, 3) that take a reflectance spectrum at `wavelengths` [nm] to linear sRGB: white is (1, 1, 1).

    With an illuminant other than D65, the white of sRGB, colours are adapted by Bradford's matrix.
    """
    colour = colour_science()
    space = colour.RGB_COLOURSPACES["sRGB"]
    weights = xyz_weights(wavelengths, illuminant, observer)
    to_rgb = np.asarray(space.matrix_XYZ_to_RGB)
    if illuminant != ILLUMINANT:
        to_rgb = to_rgb @ colour.adaptation.matrix_chromatic_adaptation_VonKries(
            weights.sum(axis=0), colour.xy_to_XYZ(space.whitepoint), transform="Bradford"
        )
    weights = weights @ to_rgb.T
    return np.asarray(weights / weights.sum(axis=0), dtype=np.float64)


def linear_srgb(wavelength_nm: ArrayLike, reflectance: ArrayLike) -> NDArray[np.floating[Any]]:
    """Return linear sRGB of a reflectance-like spectrum under CIE standard illuminant D65.

    Parameters
    ----------
    wavelength_nm : array_like [nm], shape (L,)
        Increasing, from 420 nm or less to 680 nm or more in steps of at most 20 nm (see `covers_visible`).
    reflectance : array_like, shape (..., L)
        Any quantity that is linear in reflectance: an albedo [1], a BRDF [1/sr]. The unit carries over.

    Returns
    -------
    array, shape (..., 3)
        R, G, B without a transfer curve, in the unit of `reflectance`; not clipped, so that a saturated spectrum can
        have a negative component. A flat spectrum of value v gives (v, v, v). float32 in, float32 out; nan passes.

    Raises
    ------
    ValueError
        If the wavelengths do not cover the visible, or if there is not one value for each of them.

    Notes
    -----
    CIE 1931 2 degree observer, summed in steps of 1 nm from 360 to 780 nm over the piecewise linear spectrum. All of
    it is one matrix of shape (L, 3). Its columns are divided by their sums, because the printed XYZ to sRGB matrix
    (four decimals) sends the summed D65 to (1.00000, 1.00008, 0.99983).

    Examples
    --------
    >>> linear_srgb(np.linspace(380.0, 780.0, 41), np.full(41, 0.5)).round(12).tolist()
    [0.5, 0.5, 0.5]
    """
    wavelength = np.asarray(wavelength_nm, dtype=np.float64)
    values = np.asarray(reflectance)
    if not covers_visible(wavelength):
        summary = "an empty axis"
        if wavelength.size:
            summary = f"{wavelength.size} from {wavelength.flat[0]:g} to {wavelength.flat[-1]:g} nm"
        raise ParameterError(
            "wavelength_nm",
            f"{summary} does not cover the visible; needed are increasing wavelengths "
            f"from {VISIBLE_FROM_NM:g} nm or less to {VISIBLE_TO_NM:g} nm or more in steps of at most "
            f"{VISIBLE_STEP_NM:g} nm",
        )
    if values.ndim == 0 or values.shape[-1] != wavelength.size:
        raise ParameterError(
            "reflectance",
            f"the last axis of shape {values.shape} must hold one value for each of the {wavelength.size} wavelengths",
        )
    dtype = np.float32 if values.dtype == np.float32 else np.float64
    weights = srgb_weights(tuple(wavelength.tolist())).astype(dtype)
    return np.asarray(np.matmul(values.astype(dtype, copy=False), weights), dtype=dtype)


def colour_weights(
    colour: Literal["xyz", "linear-srgb"], wavelength_nm: NDArray[np.float64] | None, illuminant: str = ILLUMINANT
) -> NDArray[np.float64]:
    """Return weights (L, 3) from a spectrum to a colour, (1, 3) of a grey material; white is Y = 1, or (1, 1, 1).

    Parameters
    ----------
    colour : str
        "xyz" or "linear-srgb".
    wavelength_nm : array (L,) [nm], or None
        Increasing, over the visible in steps of at most 20 nm; at most 1000. None of a grey material.
    illuminant : str
        A name of colour-science.

    Raises
    ------
    ParameterError
        For an unknown illuminant, with the closest names; for too many wavelengths, or such that make no colour.
    """
    check_illuminant(illuminant)
    if wavelength_nm is not None and wavelength_nm.size > MOST_OF_A_COLOUR:
        sentence = f"{wavelength_nm.size} wavelengths are more than the {MOST_OF_A_COLOUR} that a colour is of"
        raise ParameterError("wavelength_nm", sentence, wavelength_nm.size, (1, MOST_OF_A_COLOUR))
    if wavelength_nm is not None and not covers_visible(wavelength_nm):
        raise ParameterError(
            "wavelength_nm",
            "a colour needs increasing wavelengths from 420 nm or less to 680 nm or more in steps of at most 20 nm",
        )
    # a grey material is a flat spectrum: any wavelengths sum to the same
    at = (380.0, 780.0) if wavelength_nm is None else tuple(wavelength_nm.tolist())
    weights = (xyz_weights if colour == "xyz" else srgb_weights)(at, illuminant)
    return weights.sum(axis=0, keepdims=True) if wavelength_nm is None else weights
