"""The noise of the instrument in the slopes that rays meet, and the S-filter of ISO 25178-2, which takes it out."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from brdfdb.errors import ParameterError, import_extra
from brdfdb.microgeometry.levelling import Array, Levelled
from brdfdb.microgeometry.topography import InstrumentNoise, instrument_noise

_ALPHA = math.sqrt(math.log(2.0) / math.pi)  # ISO 16610-61: half of the amplitude of the cutoff wavelength remains
_LEAST_STEPS = 4.0  # shortest cutoff: a narrower Gaussian on the grid leaves more of it than half
_MOST_SHARE = 0.1  # longest cutoff, as a share of the shorter side of the map
_TOLERATED = 0.05  # relative change of a slope from which noise is not left in without being asked for
_LEFT = 0.01  # share of the mean squares of slopes that the noise may have after the filter that is proposed
_PREFERRED = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)  # ISO 3, R10


class FilteredMap(NamedTuple):
    """A levelled map for rays, and the noise in its slopes.

    Attributes
    ----------
    levelled : Levelled
        The map after the S-filter.
    sentence : str
        The noise, and the slopes with it, without it and after the filter.
    """

    levelled: Levelled
    sentence: str


def s_filtered(levelled: Levelled, cutoff_um: float | None, noise_um: float | None = None) -> FilteredMap:
    """Return a map without waves shorter than a cutoff, and a sentence on its noise.

    Parameters
    ----------
    levelled : Levelled
        A map without holes.
    cutoff_um : float, optional
        Wavelength of which the filter leaves half of the amplitude [um], from four steps of the grid to a tenth of the
        shorter side. Half a cutoff is cut off at each edge, where the filter would need heights beyond the map. 0
        leaves the map as it is. None does so, too, unless its noise is known and changes slopes by more than 5 %.
    noise_um : float, optional
        Standard deviation of the white noise of the instrument [um]; by default it is estimated.

    Raises
    ------
    ParameterError
        For a cutoff outside its range, for noise that exceeds the heights, and for noise that changes the slopes while
        no cutoff is given.

    Notes
    -----
    The weights are those of the Gaussian filter of ISO 16610-61, exp(-pi r^2 / (alpha cutoff)^2) with alpha^2 =
    ln(2) / pi, which leave 2^-(cutoff / wavelength)^2 of the amplitude of a wave.
    """
    noise = instrument_noise(levelled, noise_um)
    measured = levelled.measured
    steps = (measured.step_x_um, measured.step_y_um)
    before = slopes_of(measured.heights_um, steps)
    of_noise = [noise.sigma_um * gain for gain in noise_gains(0.0, steps)]
    without = [math.sqrt(max(slope**2 - part**2, 0.0)) for slope, part in zip(before, of_noise, strict=True)]
    words = f"noise of the instrument: {noise.in_words}"
    slopes = f"slopes along x and y: {_pair(before)} as measured"
    if noise.kind != "negligible":
        least = "at least " if noise.kind == "not separable" else ""
        slopes += f", {least}{_pair(without)} without the noise"
    if cutoff_um:
        shortest, longest = _cutoffs(levelled)
        if not shortest <= cutoff_um <= longest:
            text = (
                f"{cutoff_um:g} um is outside [{shortest:.4g}, {longest:.4g}] um, from four steps of the grid to a "
                "tenth of the map; 0 is no filter"
            )
            raise ParameterError("s_filter_um", text, cutoff_um, (shortest, longest))
        heights = _filtered(measured.heights_um, cutoff_um, steps)
        slopes += f", {_pair(slopes_of(heights, steps))} after an S-filter of {cutoff_um:g} um (Gaussian, ISO 16610-61)"
        if noise.kind != "negligible":
            left = _pair([noise.sigma_um * gain for gain in noise_gains(cutoff_um, steps)])
            slopes += f"; slopes of the noise alone after the filter: {left}"
        return FilteredMap(replace(levelled, measured=replace(measured, heights_um=heights)), f"{words}; {slopes}")
    if noise.kind == "negligible":
        return FilteredMap(levelled, words)
    narrowed = min(clean / noisy for clean, noisy in zip(without, before, strict=True) if noisy > 0.0)
    if cutoff_um is None and noise.kind != "not separable" and narrowed < 1.0 - _TOLERATED:
        proposed = _proposed(noise, without, levelled)
        such = "" if proposed is None else f", such as {proposed:g}"
        text = (
            f"is missing for a map with noise of the instrument: {noise.in_words}; {slopes}; give the cutoff of a "
            f"filter in um{such}, or 0 to leave the noise in, which is right if sharp edges of the surface look like "
            "noise"
        )
        raise ParameterError("s_filter_um", text, None)
    return FilteredMap(levelled, f"{words}; it is left in; {slopes}")


def slopes_of(heights: Array, steps_um: tuple[float, float]) -> list[float]:
    """Return the rms slopes [1] between neighbouring heights along x and y."""
    return [math.sqrt(float(np.mean(np.diff(heights, axis=axis) ** 2))) / step for axis, step in enumerate(steps_um)]


def noise_gains(cutoff_um: float, steps_um: tuple[float, float]) -> list[float]:
    """Return the rms slopes along x and y [1/um] that white noise of 1 um has after a filter; 0 is no filter."""
    weights = []
    for step in steps_um:
        impulse = np.zeros(2 * math.ceil(cutoff_um / step) + 5)
        impulse[impulse.size // 2] = 1.0
        weights.append(_smoothed(impulse, (cutoff_um / step,)))
    squares = [float(np.sum(row**2)) for row in weights]
    edges = [float(np.sum(np.diff(row) ** 2)) for row in weights]
    return [math.sqrt(edges[0] * squares[1]) / steps_um[0], math.sqrt(edges[1] * squares[0]) / steps_um[1]]


def _smoothed(heights: Array, cutoffs: tuple[float, ...]) -> Array:
    """Return heights after a Gaussian filter with cutoffs in steps of the grid."""
    sigmas = [_ALPHA * cutoff / math.sqrt(2.0 * math.pi) for cutoff in cutoffs]
    return np.asarray(import_extra("scipy.ndimage").gaussian_filter(heights, sigmas, truncate=5.0))


def _filtered(heights: Array, cutoff_um: float, steps_um: tuple[float, float]) -> Array:
    """Return filtered heights, without half a cutoff at each edge."""
    cutoffs = tuple(cutoff_um / step for step in steps_um)
    x, y = (math.ceil(0.5 * cutoff) for cutoff in cutoffs)
    cut = _smoothed(heights, cutoffs)[x:-x, y:-y]
    return np.asarray(cut - cut.mean())


def _cutoffs(levelled: Levelled) -> tuple[float, float]:
    """Return the shortest and the longest cutoff [um] of a map."""
    measured = levelled.measured
    return _LEAST_STEPS * max(measured.step_x_um, measured.step_y_um), _MOST_SHARE * min(measured.widths_um)


def _proposed(noise: InstrumentNoise, slopes: list[float], levelled: Levelled) -> float | None:
    """Return the shortest preferred cutoff [um] after which noise has 1 % of the mean squares of slopes, or None."""
    steps = (levelled.measured.step_x_um, levelled.measured.step_y_um)
    shortest, longest = _cutoffs(levelled)
    decades = range(math.floor(math.log10(shortest)), math.ceil(math.log10(longest)) + 1)
    for cutoff in (number * 10.0**decade for decade in decades for number in _PREFERRED):
        if shortest <= cutoff <= longest:
            left = [noise.sigma_um * gain for gain in noise_gains(cutoff, steps)]
            if all(part**2 <= _LEFT * slope**2 for part, slope in zip(left, slopes, strict=True)):
                return cutoff
    return None


def _pair(slopes: list[float]) -> str:
    return " and ".join(f"{slope:.3g}" for slope in slopes)
