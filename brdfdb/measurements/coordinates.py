"""Coordinates of pairs of directions for scattered samples, and the hull of some of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.parameters import Floats

_FLAT = 1e-6  # spread of the samples along an axis of their hull, relative to the largest, that counts as none
_WITHIN = 1e-6  # distance [rad] outside of the hull that rounding makes


class DirectionPairs(NamedTuple):
    """Unit vectors (N, 3) of light and viewer."""

    wi: Floats
    wr: Floats


class HalfAngles(NamedTuple):
    """The squared tangent of theta_h, and theta_d [rad]."""

    tan2_h: Floats
    theta_d: Floats


def half_angles(wi: Floats, wr: Floats) -> HalfAngles:
    """Return the half and difference angles of unit vectors (N, 3) above the horizon."""
    half = wi + wr
    across = half[:, 0] ** 2 + half[:, 1] ** 2
    length = np.sqrt(across + half[:, 2] ** 2)
    theta_d = np.arctan2(np.linalg.norm(wi - wr, axis=1), length)
    return HalfAngles(across / np.maximum(half[:, 2], 1e-9) ** 2, theta_d)


def features(wi: Floats, wr: Floats, alpha: float, scales: tuple[float, float, float], *, turned: bool) -> Floats:
    """Return coordinates (N, 3 or 5) in which f_r of a lobe is smooth, each divided by its scale.

    They are ln(1 + tan(theta_h)^2 / alpha^2) / 2, theta_d, and cos theta_r - cos theta_i, which changes its sign if
    light and viewer are exchanged. All are the same for the mirror image. If the surface may be `turned`, the
    slopes of the half vector join them, crowded towards the lobe.
    """
    tan2, theta_d = half_angles(wi, wr)
    first = 0.5 * np.log1p(tan2 / alpha**2)
    columns = [first / scales[0], theta_d / scales[1], (wr[:, 2] - wi[:, 2]) / scales[2]]
    if turned:
        half = wi + wr
        length = np.maximum(np.hypot(half[:, 0], half[:, 1]), 1e-12)
        columns += [first * half[:, axis] / length / scales[0] for axis in (0, 1)]
    return np.stack(columns, axis=1)


def beyond(at: Floats, x: Floats) -> NDArray[np.bool_]:
    """Return which points (N, D) lie outside of the convex hull of others (M, D), which is flat if they are."""
    from scipy.spatial import ConvexHull

    centre = x.mean(axis=0)
    _, spread, axes = np.linalg.svd(np.linalg.qr(x - centre, mode="r"), full_matrices=True)
    spread = np.pad(spread, (0, x.shape[1] - spread.size))
    wide = spread > _FLAT * max(spread[0], 1e-12)
    along = axes[wide]
    across = axes[~wide]
    inside = (x - centre) @ along.T
    if inside.shape[1] > 1:
        planes = ConvexHull(inside).equations
    else:
        low, high = inside.min(initial=0.0), inside.max(initial=0.0)
        planes = np.array([[1.0, -high], [-1.0, low]])[:, 1 - inside.shape[1] :]
    at = at - centre
    outside: NDArray[np.bool_] = np.any(np.abs(at @ across.T) > _WITHIN, axis=1)
    at = at @ along.T
    for plane in planes:  # one at a time: there may be many
        outside |= at @ plane[:-1] + plane[-1] > _WITHIN
    return outside


def places(wi: Floats, wr: Floats, *, turned: bool) -> Floats:
    """Return coordinates [rad] of pairs of unit vectors (N, 3), shape (N, 3), or (N, 4) if the azimuth counts.

    Isotropic pairs are points (theta_i, theta_r cos delta_phi, theta_r sin delta_phi). Others are points
    theta (cos phi, sin phi) of light and viewer.
    """
    theta_i, theta_r = (np.arctan2(np.hypot(w[:, 0], w[:, 1]), w[:, 2]) for w in (wi, wr))
    phi_i, phi_r = (np.arctan2(w[:, 1], w[:, 0]) for w in (wi, wr))
    if turned:
        polar = ((theta_i, phi_i), (theta_r, phi_r))
        return np.stack([theta * turn(phi) for theta, phi in polar for turn in (np.cos, np.sin)], axis=1)
    delta = phi_r - phi_i
    return np.stack([theta_i, theta_r * np.cos(delta), theta_r * np.sin(delta)], axis=1)
