"""Places: thin sets of directions whose error is measured separately, and pairs of directions drawn in them.

Bands of theta_i pool all viewers. In two places a table can be less exact than in the band: at viewers as high as the
light and on its side of the normal, where models have a ridge, and next to the horizon, where they have a pole.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import Directions, checked_vectors, degrees, radians, unit_vector
from brdfdb.parameters import Floats

BANDS_DEG = np.linspace(0.0, 90.0, 10)  # of theta_i
ALONGSIDE_DEG = 10.0  # largest difference of theta_r and theta_i of a viewer alongside the light
RINGS_DEG = (85.0, 87.0, 89.0, 90.0)  # edges of rings next to the horizon
_CLOSE_DEG = 2.0  # of the light, in theta_r and across: viewers that hardly miss it
_SAME_DEG = 1e-9  # an angle that is so little below an edge is on it: unit vectors round

BANDS = BANDS_DEG.size - 1
RINGS = len(RINGS_DEG) - 1
# Rows of a table of errors: bands of theta_i, viewers alongside the light in each band, rings with one direction beyond
# 85 degrees, and with both
ALONGSIDE = BANDS
ONE_GRAZING = 2 * BANDS
BOTH_GRAZING = 2 * BANDS + RINGS
ROWS = 2 * BANDS + 2 * RINGS


class Pairs(NamedTuple):
    """Pairs of directions that were drawn in places."""

    #: wi, wr: unit vectors of light and viewer, above the horizon, (N, 3)
    wi: Floats
    wr: Floats
    row: NDArray[np.int64]  #: the place of each, (N,)
    sample: NDArray[np.int64]  #: the number of its sample: a place may have several samples, (N,)

    def some(self, chosen: NDArray[np.bool_]) -> Pairs:
        """Return the pairs that are chosen."""
        return Pairs(self.wi[chosen], self.wr[chosen], self.row[chosen], self.sample[chosen])


def rows_of(directions: Directions) -> NDArray[np.int64]:
    """Return the rows that hold for pairs of directions, of shape (3, ...): the band, and places or the band again."""
    theta_i, theta_r = (degrees(np.nan_to_num(theta)) + _SAME_DEG for theta in (directions.theta_i, directions.theta_r))
    band = np.clip(np.searchsorted(BANDS_DEG, theta_i, side="right") - 1, 0, BANDS - 1)
    higher = np.minimum(theta_i, theta_r)
    lower = np.maximum(theta_i, theta_r)
    near = (lower - higher <= ALONGSIDE_DEG + _SAME_DEG) & (directions.cos_dphi >= -_SAME_DEG)
    alongside = near & (higher < RINGS_DEG[0])
    ring = np.clip(np.searchsorted(RINGS_DEG, lower, side="right") - 1, 0, RINGS - 1)
    grazing = np.where(higher >= RINGS_DEG[0], BOTH_GRAZING, ONE_GRAZING) + ring
    rows = (band, np.where(alongside, ALONGSIDE + band, band), np.where(lower >= RINGS_DEG[0], grazing, band))
    return np.stack(np.broadcast_arrays(*rows))


def anywhere(wi: Floats, wr: Floats) -> NDArray[np.bool_]:
    """Return a mask of the pairs of unit vectors (N, 3) that lie in a place; for the others only the band counts."""
    rows = rows_of(checked_vectors(wi, wr))
    return np.asarray(np.any(rows[1:] != rows[:1], axis=0))


@functools.lru_cache(maxsize=4)
def draw(count: int, seed: int) -> Pairs:
    """Draw pairs of directions in every place, `count` a sample; all angles are uniform.

    The pairs are cached and shared by all tables, so their arrays are read-only.

    Alongside the light there are four samples a band, up to 85 degrees: exactly towards the light; within two degrees
    of that; at theta_r = theta_i; and within 10 degrees of that. With both directions beyond 85 degrees there are
    three a ring: any azimuth, exactly towards the light, and theta_r = theta_i. With one of them there is one sample,
    any azimuth. Where the two polar angles differ, light and viewer are exchanged by chance.
    """
    rng = np.random.default_rng(seed)
    samples: list[tuple[int, Floats, Floats, Floats]] = []  # row, two polar angles, difference of azimuths [degree]
    still = np.zeros(count)
    end = RINGS_DEG[0]
    for band in range(BANDS):
        light = rng.uniform(BANDS_DEG[band], min(BANDS_DEG[band + 1], end), count)
        beside = np.abs(light + rng.uniform(-ALONGSIDE_DEG, ALONGSIDE_DEG, count))
        beside = np.minimum(beside, 2.0 * end - beside)
        close = np.abs(light + rng.uniform(-_CLOSE_DEG, _CLOSE_DEG, count))
        close = np.minimum(close, 2.0 * end - close)
        aside = np.minimum(_CLOSE_DEG / np.maximum(np.sin(radians(light)), 1e-9), 90.0)
        samples += [
            (ALONGSIDE + band, light, light, still),
            (ALONGSIDE + band, light, close, aside * rng.uniform(-1.0, 1.0, count)),
            (ALONGSIDE + band, light, light, _turn(rng, 90.0, count)),
            (ALONGSIDE + band, light, beside, _turn(rng, 90.0, count)),
        ]
    for ring in range(RINGS):
        lower = rng.uniform(RINGS_DEG[ring], RINGS_DEG[ring + 1], count)
        theta = _either(rng, lower, rng.uniform(0.0, end, count))
        samples.append((ONE_GRAZING + ring, theta[0], theta[1], _turn(rng, 180.0, count)))
    for ring in range(RINGS):
        lower = rng.uniform(RINGS_DEG[ring], RINGS_DEG[ring + 1], count)
        theta = _either(rng, lower, rng.uniform(end, lower))
        samples += [
            (BOTH_GRAZING + ring, theta[0], theta[1], _turn(rng, 180.0, count)),
            (BOTH_GRAZING + ring, lower, lower, still),
            (BOTH_GRAZING + ring, lower, lower, _turn(rng, 90.0, count)),
        ]
    rows, theta_i, theta_r, turns = zip(*samples, strict=True)
    phi_i = rng.uniform(0.0, 360.0, len(samples) * count)
    pairs = Pairs(
        unit_vector(radians(np.concatenate(theta_i)), radians(phi_i)),
        unit_vector(radians(np.concatenate(theta_r)), radians(phi_i + np.concatenate(turns))),
        np.repeat(rows, count),
        np.repeat(np.arange(len(samples)), count),
    )
    for array in pairs:
        array.flags.writeable = False
    return pairs


def _turn(rng: np.random.Generator, most: float, count: int) -> Floats:
    return rng.uniform(-most, most, count)


def _either(rng: np.random.Generator, one: Floats, other: Floats) -> Floats:
    """Return two arrays as rows, with their values exchanged by chance."""
    swapped = rng.random(one.size) < 0.5
    return np.where(swapped, [other, one], [one, other])
