"""Averages of f_r over the solid angles of light and receiver, which an instrument measures in place of f_r."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdfdb.materials.source import Evaluate
from brdfdb.measurements.samples import Instrument
from brdfdb.parameters import Floats

# Points of a disk of radius 1 and their weights: exact for polynomials of degree 5
_TURNS = np.arange(6) * np.pi / 3.0
POINTS = np.concatenate([np.zeros((1, 2)), np.sqrt(2.0 / 3.0) * np.stack([np.cos(_TURNS), np.sin(_TURNS)], axis=1)])
WEIGHTS = np.array([0.25, *[0.125] * 6])


def cone(w: Floats, half_angle: float) -> Floats:
    """Return directions (7, N, 3) in a cone about unit vectors (N, 3); the half angle [rad] is small.

    A mean over the cone is their sum, weighted by `WEIGHTS`.
    """
    helper = np.where(np.abs(w[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    u = np.cross(w, helper)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(w, u)
    at = np.tan(half_angle) * POINTS
    spread = w + at[:, 0, np.newaxis, np.newaxis] * u + at[:, 1, np.newaxis, np.newaxis] * v
    return np.asarray(spread / np.linalg.norm(spread, axis=2, keepdims=True))


def averaged(brdf: Evaluate, instrument: Instrument) -> Evaluate:
    """Return f_r averaged over the solid angles of an instrument, a function of unit vectors like `brdf`.

    Parameters
    ----------
    brdf : callable
        f_r [1/sr], shape (N, C), at unit vectors (N, 3) of light and viewer.
    instrument : Instrument
        Solid angles that are unknown count as 0.

    Notes
    -----
    Light and receiver are disks. A direction counts by its cosine, as light does on the sample and on the receiver. The
    mean over both is that over the light, plus that over the receiver, less f_r itself. What is left out is of the
    fourth order in the ratio of aperture and lobe. Directions below the horizon count with the value of the middle.
    """
    angles = [_half_angle(instrument.source_solid_angle_sr), _half_angle(instrument.receiver_solid_angle_sr)]
    if not any(angles):
        return brdf

    def mean(wi: Floats, wr: Floats) -> Floats:
        middle = np.asarray(brdf(wi, wr))
        result = middle.copy()
        for number, half_angle in enumerate(angles):
            if half_angle:
                result += _over(brdf, (wi, wr), number, half_angle, middle) - middle
        return result

    return mean


def _half_angle(solid_angle: float | None) -> float:
    """Return half of the angle [rad] of the cone with a solid angle [sr]."""
    return 0.0 if solid_angle is None else float(np.arccos(max(1.0 - solid_angle / (2.0 * np.pi), 0.0)))


def _over(
    brdf: Evaluate, pair: tuple[Floats, Floats], number: int, half_angle: float, middle: Floats
) -> NDArray[np.float64]:
    """Return the mean of f_r (N, C) over a cone about the first or the second direction of a pair."""
    total = WEIGHTS[0] * middle
    for weight, w in zip(WEIGHTS[1:], cone(pair[number], half_angle)[1:], strict=True):
        above = w[:, 2:] > 0.0
        moved = np.where(above, w, pair[number])
        values = brdf(moved, pair[1]) if number == 0 else brdf(pair[0], moved)
        total = total + weight * np.where(above, values * w[:, 2:] / pair[number][:, 2:], middle)
    return np.asarray(total)
