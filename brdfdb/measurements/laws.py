"""Measured f_r made to keep a law: reciprocity, and energy."""

from __future__ import annotations

import numpy as np

from brdfdb.geometry import radians, unit_vector
from brdfdb.integrals.quadrature import gauss_rule
from brdfdb.materials.source import Evaluate
from brdfdb.parameters import Floats

_LIGHTS_DEG = np.concatenate([np.arange(0.0, 80.0, 2.5), np.arange(80.0, 90.0, 1.0), [89.5, 89.9]])
_AZIMUTHS = 16  # of the lights of a surface that may be turned
_RINGS, _SPOKES = 64, 96  # of the half vectors over which an albedo is summed
_CROWDED = 8.0  # rings next to the normal are so many e-folds closer than those at the horizon
_ROUNDS = 40  # of the factors of a reciprocal f_r, each of which counts for light and viewer


def reciprocal(f_r: Evaluate) -> Evaluate:
    """Return the mean of f_r and f_r with light and viewer exchanged: the nearest in the mean square."""
    return lambda wi, wr: 0.5 * (f_r(wi, wr) + f_r(wr, wi))


def conserving(f_r: Evaluate, *, reciprocal: bool, turned: bool, margin: float) -> Evaluate:
    """Return f_r scaled so that no light has an albedo above 1 - margin: one factor for each polar angle and channel.

    The factor is the largest up to 1, so that the relative change of a light is as small as it can be. Of a reciprocal
    f_r it is a product of a factor for the light and one for the viewer, each of which is 1 or makes the albedo of its
    light 1 - margin. f_r of a surface that may not be turned is taken as that of its mirror image, too.
    """
    theta = radians(_LIGHTS_DEG)
    azimuths = np.arange(_AZIMUTHS) * (2.0 * np.pi / _AZIMUTHS) if turned else np.zeros(1)
    shares = np.stack([_shares(f_r, unit_vector(t, phi), theta, whole=turned) for t in theta for phi in azimuths])
    limit = 1.0 - margin

    def reflected(of_viewer: Floats) -> Floats:
        albedo = np.einsum("lkc,kc->lc", shares, of_viewer)
        return np.asarray(albedo.reshape(theta.size, azimuths.size, -1).max(axis=1))

    factors = np.minimum(1.0, limit / np.maximum(reflected(np.ones(shares.shape[1:])), limit))
    if reciprocal:
        for _ in range(_ROUNDS):  # the mean of the old and the new factor, in the logarithm: they would swing otherwise
            factors = np.minimum(1.0, np.sqrt(factors * limit / np.maximum(reflected(factors), 1e-12)))
        albedo = factors * reflected(factors)
        factors *= np.sqrt(np.minimum(1.0, limit / np.maximum(albedo.max(axis=0), 1e-12)))

    def scaled(wi: Floats, wr: Floats) -> Floats:
        light = _at(factors, theta, np.arccos(np.clip(wi[:, 2], -1.0, 1.0)))
        viewer = _at(factors, theta, np.arccos(np.clip(wr[:, 2], -1.0, 1.0))) if reciprocal else 1.0
        return np.asarray(f_r(wi, wr) * light * viewer)

    return scaled


def _at(factors: Floats, theta: Floats, wanted: Floats) -> Floats:
    return np.stack([np.interp(wanted, theta, column) for column in factors.T], axis=1)


def _shares(f_r: Evaluate, light: Floats, theta: Floats, *, whole: bool) -> Floats:
    """Return the shares (K, C) of the albedo of a light (3,) that go to the polar angles (K,) [rad] of the viewer.

    A viewer between two of the angles counts for both, as straight lines between factors at these angles do.
    """
    viewers, weight = _viewers(light, whole=whole)
    reflected = weight[:, np.newaxis] * f_r(np.broadcast_to(light, viewers.shape), viewers)
    theta_r = np.clip(np.arccos(np.clip(viewers[:, 2], 0.0, 1.0)), theta[0], theta[-1])
    below = np.clip(np.searchsorted(theta, theta_r, side="right") - 1, 0, theta.size - 2)
    part = (theta_r - theta[below]) / (theta[below + 1] - theta[below])
    return np.stack(
        [
            np.bincount(below, (1.0 - part) * column, theta.size) + np.bincount(below + 1, part * column, theta.size)
            for column in reflected.T
        ],
        axis=1,
    )


def _viewers(light: Floats, *, whole: bool) -> tuple[Floats, Floats]:
    """Return viewers (N, 3), and weights (N,) that sum f_r to the albedo of a light (3,); half of them if not `whole`.

    They are the mirror images of the light in half vectors, on spokes from the normal to where the viewer is at the
    horizon: tan(2 theta_h) = -cos(theta_i) / (sin(theta_i) cos(phi_h - phi_i)). Half vectors crowd around the normal:
    the rule of Gauss and Legendre in u, for theta_h in proportion to sinh(k u), and that of the midpoint in phi_h. A
    half vector of d omega_h makes viewers of 4 cos(theta_d) d omega_h.
    """
    x, w = gauss_rule(_RINGS)
    u = 0.5 * (x + 1.0)
    spokes = _SPOKES if whole else _SPOKES // 2
    turn = 2.0 * np.pi if whole else np.pi
    phi_h = (np.arange(spokes) + 0.5) * (turn / spokes) + np.arctan2(light[1], light[0])
    last = 0.5 * np.arctan2(light[2], -(light[0] * np.cos(phi_h) + light[1] * np.sin(phi_h)))
    theta_h = np.outer(np.sinh(_CROWDED * u) / np.sinh(_CROWDED), last)
    width = np.outer(0.5 * w * _CROWDED * np.cosh(_CROWDED * u) / np.sinh(_CROWDED), last)
    half = unit_vector(theta_h, phi_h)
    cos_d = half @ light
    viewers = 2.0 * cos_d[..., np.newaxis] * half - light
    weight = 4.0 * cos_d * np.maximum(viewers[..., 2], 0.0) * np.sin(theta_h) * width * (2.0 * np.pi / spokes)
    return viewers.reshape(-1, 3), weight.ravel()
