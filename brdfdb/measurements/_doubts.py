"""Doubts about samples: units, numbers that mean missing, and azimuths that begin elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brdfdb.errors import counted
from brdfdb.measurements._incidences import PEAK, Incidence, bands, lights
from brdfdb.measurements.samples import Samples
from brdfdb.parameters import Floats

_EXCESS = 1.02  # albedo above which the unit is doubted
_BLACK = 2e-4  # albedo below which the unit is doubted: the blackest coatings reflect more
_MISSING = np.array([-1.0, -99.0, -999.0, -9999.0])  # numbers that files write for values that are missing
_FILLED = np.array([9.99, 99.99, 999.99, 99999.0, 1e20, 9.96921e36])  # the same above 0; the last two are of netCDF
_FAR = 10.0  # times the largest other value is where a number is a mark
_LOBE, _LEVEL = 2.0, 1.25  # f_r of a lobe over the median from which on there is one, and below which there is none
_ABOUT_DEG = 15.0  # angles to the mirror direction and to the light within which lobes are looked for
_TILTED_DEG = (20.0, 75.0)  # polar angles of lights that tell the sides apart
_FEWEST = 5  # viewers of a light


def units(samples: Samples, incidences: Sequence[Incidence]) -> tuple[str, ...]:
    """Return what looks wrong with the unit of the values, in sentences."""
    if not samples.known.any():
        return ("There is no value at all.",)
    sound = [max(some.albedo) for some in incidences if some.peak <= PEAK]
    if sound:
        albedo, how = float(np.median(sound)), "the values integrate to"
    else:
        albedo, how = float(np.pi * np.nanmedian(samples.values)), "pi times the median of f_r is"
    if albedo > _EXCESS:
        reasons = [f"reflectance factors, which make {albedo / np.pi:.3g} when they are divided by pi"]
        if albedo / 100.0 > _BLACK and albedo > 10.0:
            reasons = [
                f"percent, which make {albedo / 100.0:.3g}",
                f"reflectance factors in percent ({albedo / 314.16:.3g})",
            ]
        return (f"Units? An albedo above 1: {how} {albedo:.4g}. The values may be {', or '.join(reasons)}.",)
    if 0.0 <= albedo < _BLACK:
        text = f"Units? Too dark: {how} {albedo:.2g}, and the blackest coatings reflect more."
        return (f"{text} A thousand times is {1e3 * albedo:.2g}.",)
    return ()


def missing(samples: Samples) -> tuple[str, ...]:
    """Return whether negative values, or the largest, look like marks of missing ones, in a sentence."""
    known = samples.values[samples.known]
    scale = np.pi if samples.record.get("quantity") == "reflectance_factor" else 1.0
    low = float(known.min(initial=0.0))
    if low >= 0.0:
        return _missing_above(known, scale)
    if not np.any(known > 0.0):
        return ("Sign? No value is above 0: f_r is not negative, and nothing can be tabulated or fitted.",)
    number = low * scale
    marks = np.isclose(known, low, rtol=1e-9, atol=0.0)
    count, others = int(marks.sum()), known[~marks]
    if not others.size or (count == 1 and not np.isclose(number, _MISSING).any()):
        return ()
    far = low < -float(np.abs(others).max()) and low < 10.0 * min(float(others.min()), 0.0)
    if far or np.isclose(number, _MISSING).any():
        verb, they = ("is", "does it") if count == 1 else ("are", "do they")
        return (f"{counted(count, 'value')} {verb} {number:.4g}: {they} mean missing?",)
    return ()


def _missing_above(known: Floats, scale: float) -> tuple[str, ...]:
    """Return whether the largest values look like marks of missing ones: nines that are far above the others."""
    high = float(known.max(initial=0.0))
    marks = np.isclose(known, high, rtol=1e-9, atol=0.0)
    count, others = int(marks.sum()), known[~marks]
    nines = np.isclose(high * scale, -_MISSING).any() or np.isclose(high * scale, _FILLED, rtol=1e-6).any()
    if not others.size or not nines or high <= _FAR * float(others.max()):
        return ()
    verb, they = ("is", "does it") if count == 1 else ("are", "do they")
    return (f"{counted(count, 'value')} {verb} {high * scale:.4g}: {they} mean missing?",)


def is_constant(samples: Samples) -> bool:
    """Return True if f_r of each channel with a few values is one number at all directions."""
    seen = samples.known.sum(axis=0) >= _FEWEST
    values = np.where(samples.known, samples.values, np.nan)[:, seen]
    return bool(seen.any() and np.all(np.nanmin(values, axis=0) == np.nanmax(values, axis=0)))


def azimuths(samples: Samples, delta_deg: Floats) -> tuple[str, ...]:
    """Return whether a lobe lies at the light and none in the mirror direction, in a sentence.

    Parameters
    ----------
    samples : Samples
        Samples.
    delta_deg : array (N,) [degree]
        Azimuths from the light to the viewer, in [0, 360).
    """
    known, theta_i = samples.known, np.degrees(samples.theta_i)
    f_r = np.where(known, samples.values, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    low, high = _TILTED_DEG
    seen = known.any(axis=1) & (theta_i >= low) & (theta_i <= high)
    level = np.abs(np.degrees(samples.theta_r) - theta_i) <= _ABOUT_DEG
    back = seen & level & (np.abs((delta_deg + 180.0) % 360.0 - 180.0) <= _ABOUT_DEG)
    mirror = seen & level & (np.abs(delta_deg - 180.0) <= _ABOUT_DEG)
    votes = []
    for rows in lights(samples, _FEWEST) or bands(samples):
        if back[rows].any():
            middle = float(np.median(f_r[rows][seen[rows]]))
            lobe, mirrored = (f_r[rows].max(where=side[rows], initial=0.0) for side in (back, mirror))
            votes.append(lobe > _LOBE * max(middle, mirrored) and mirrored <= _LEVEL * max(middle, 0.0))
    if 2 * sum(votes) <= len(votes):
        return ()
    other, direction = ("light", "light") if samples.record.get("azimuth") else ("forward", "forward direction")
    text = "Azimuths? The lobe lies at delta_phi = 0, towards the light, and none lies in the mirror direction."
    return (f"{text} If the file counts azimuths from the {direction}, import it with --azimuth {other}.",)
