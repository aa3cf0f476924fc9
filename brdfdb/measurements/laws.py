"""Measured f_r made to keep a law: reciprocity, and energy."""

from __future__ import annotations

import numpy as np

from brdfdb.geometry import radians, unit_vector
from brdfdb.materials.source import Evaluate
from brdfdb.parameters import Floats

_LIGHTS_DEG = np.append(np.arange(0.0, 85.0, 5.0), np.arange(85.0, 90.0, 1.0))
_AZIMUTHS, _RINGS = 48, 64  # of the viewers over which an albedo is summed
_ROUNDS = 40  # of the factors of a reciprocal f_r, each of which counts for light and viewer


def reciprocal(f_r: Evaluate) -> Evaluate:
    """Return the mean of f_r and f_r with light and viewer exchanged: the nearest in the mean square."""
    return lambda wi, wr: 0.5 * (f_r(wi, wr) + f_r(wr, wi))


def conserving(f_r: Evaluate, *, reciprocal: bool, turned: bool, margin: float) -> Evaluate:
    """Return f_r scaled so that no light has an albedo above 1 - margin: one factor for each polar angle and channel.

    The factor is the largest up to 1, so that the relative change of a light is as small as it can be. Of a reciprocal
    f_r it is a product of a factor for the light and one for the viewer, each of which is 1 or makes the albedo of its
    light 1 - margin.
    """
    theta = radians(_LIGHTS_DEG)
    viewers, weight = _hemisphere()
    lights = [unit_vector(t, phi) for t in theta for phi in (np.arange(0.0, 2.0 * np.pi, 0.5) if turned else (0.0,))]
    values = [f_r(np.broadcast_to(light, viewers.shape), viewers) for light in lights]
    theta_r = np.arccos(viewers[:, 2])
    limit = 1.0 - margin
    channels = values[0].shape[1]

    def reflected(of_viewer: Floats | float) -> Floats:
        albedo = np.stack([weight @ (f * of_viewer) for f in values])
        return np.asarray(albedo.reshape(theta.size, -1, channels).max(axis=1))

    factors = np.minimum(1.0, limit / np.maximum(reflected(1.0), limit))
    if reciprocal:
        for _ in range(_ROUNDS):  # the mean of the old and the new factor, in the logarithm: they would swing otherwise
            albedo = np.maximum(reflected(_at(factors, theta, theta_r)), 1e-12)
            factors = np.minimum(1.0, np.sqrt(factors * limit / albedo))
        albedo = factors * reflected(_at(factors, theta, theta_r))
        factors *= np.sqrt(np.minimum(1.0, limit / np.maximum(albedo.max(axis=0), 1e-12)))

    def scaled(wi: Floats, wr: Floats) -> Floats:
        light = _at(factors, theta, np.arccos(np.clip(wi[:, 2], -1.0, 1.0)))
        viewer = _at(factors, theta, np.arccos(np.clip(wr[:, 2], -1.0, 1.0))) if reciprocal else 1.0
        return np.asarray(f_r(wi, wr) * light * viewer)

    return scaled


def _at(factors: Floats, theta: Floats, wanted: Floats) -> Floats:
    return np.stack([np.interp(wanted, theta, column) for column in factors.T], axis=1)


def _hemisphere() -> tuple[Floats, Floats]:
    """Return viewers (N, 3), and weights (N,) that sum f_r to an albedo: Gauss-Legendre in the squared sine."""
    x, w = np.polynomial.legendre.leggauss(_RINGS)
    phi = (np.arange(_AZIMUTHS) + 0.5) * (2.0 * np.pi / _AZIMUTHS)
    theta = np.arcsin(np.sqrt(0.5 * (x + 1.0)))
    ring, turn = (a.ravel() for a in np.meshgrid(theta, phi, indexing="ij"))
    return unit_vector(ring, turn), np.repeat(0.5 * w, _AZIMUTHS) * (np.pi / _AZIMUTHS)
