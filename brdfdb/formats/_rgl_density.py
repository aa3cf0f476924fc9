"""The densities over half vectors by whose warp the values of RGL's files are stored.

A density has two marginals that matter: along a row, over theta_m, and over the rows, phi_m. Each is made dense where
the values bend, because readers join them by straight lines, and thin below the horizon.
"""

from __future__ import annotations

import numpy as np

from brdfdb.formats._rgl_fields import Floats32, bilinear
from brdfdb.formats._rgl_surface import Surface, Values
from brdfdb.formats._rgl_warp import Array

_FLOOR = 0.02  # share of the mean value that bends are relative to, where values are smaller
_MOST_BENT = 1e4  # largest relative second derivative that counts
_EVERYWHERE = 0.03  # weight of half vectors that no pair of directions has
_POWER = 0.2  # densities are least in error for a power of the second derivative between 1/5 and 1/2
_SHARE = 0.5  # share of a density that follows the bends; the rest is even
_RAMP = 0.3  # cosine of theta_r below the horizon at which the even part of a ramp ends
_LEAST = 0.02  # density there
_SMOOTHINGS = 3
_CENTRE = 0.15  # place up to which densities grow from 0 along rows: theta_m then grows as the uniform numbers


def densities(surface: Surface, wi: Array, ndf: Floats32, rows: int, columns: int, horizon: float) -> Floats32:
    """Return densities over half vectors, shape (slices, rows, columns), for lights (slices, 1, 1, 3).

    Parameters
    ----------
    surface : Surface
        Values of the table.
    wi : array (slices, 1, 1, 3)
        Unit vectors of the light.
    ndf : array (h, w)
        Factor over half vectors, which is not in the values that are stored.
    rows, columns : int
        Nodes; 2 and 2 give the identity warp.
    horizon : float
        Share of each row above the horizon. 0: there is none, and densities fall off slowly below it.
    """
    if rows == 2:
        return np.ones((len(wi), 2, 2), np.float32)
    shape = (len(wi), rows, columns)
    u, v = np.linspace(0.0, 1.0, columns), np.linspace(0.0, 1.0, rows)
    x, y = (np.broadcast_to(axis, shape) for axis in np.meshgrid(u, v))
    values = surface.values(wi, x, y)
    ramp = np.clip(1.0 + values.cosine / _RAMP, _LEAST, 1.0)
    factor = bilinear(ndf, x[0], y[0])
    along, across = _bends(values, factor, np.sin(x**2 * (np.pi / 2.0)) * x, ramp)
    if horizon == 0.0:
        line = _SHARE * _even(along * ramp) + (1.0 - _SHARE) * _even(ramp) + 1e-3
    else:
        azimuth = 0.0 if surface.isotropic else np.arctan2(wi[..., 1], wi[..., 0])[..., 0]
        line = _up_to_horizon(along, u, _horizon(wi[:, 0], (2.0 * v - 1.0) * np.pi - azimuth), horizon)
    line = line * np.clip(u / _CENTRE, 1e-3, 1.0)
    whole = np.sum(line[..., 1:] + line[..., :-1], axis=-1)
    row = _SHARE * across / across.mean(axis=-1, keepdims=True) + (1.0 - _SHARE)
    density = line * (row / whole)[..., np.newaxis]
    density = density / density.mean(axis=(1, 2), keepdims=True)
    return np.asarray(density).astype(np.float32)


def _bends(values: Values, factor: Array, area: Array, ramp: Array) -> tuple[Array, Array]:
    """Return densities along rows (slices, rows, columns) and over the rows (slices, rows) from second derivatives."""
    stored = values.brdf / factor[..., np.newaxis]
    scale = np.abs(stored) + _FLOOR * np.abs(stored).mean(axis=(1, 2), keepdims=True) + 1e-30
    rows, columns = factor.shape
    along = np.zeros(stored.shape)
    along[:, :, 1:-1] = np.abs(np.diff(stored, 2, axis=2)) / scale[:, :, 1:-1] * (columns - 1) ** 2
    along[:, :, 0], along[:, :, -1] = along[:, :, 1], along[:, :, -2]
    across = np.abs(np.diff(_around(stored), 2, axis=1)) / scale * (rows - 1) ** 2
    bent_along, bent_across = (np.minimum(bent.mean(axis=-1), _MOST_BENT) for bent in (along, across))
    above = values.cosine > 0.0
    hemisphere = np.where(above, values.cosine * values.solid_angle, 0.0)
    lobe = np.where(above, factor * area, 0.0)
    weight = sum(part / np.maximum(part.mean(axis=(1, 2), keepdims=True), 1e-30) for part in (hemisphere, lobe))
    dense = (bent_along**2 * (weight + _EVERYWHERE)) ** _POWER + 1e-9
    over_rows = np.sum((bent_across**2 * weight) ** _POWER * ramp, axis=2) / np.sum(ramp, axis=2) + 1e-9
    for _ in range(_SMOOTHINGS):
        dense[:, :, 1:-1] = 0.25 * (dense[:, :, 2:] + 2.0 * dense[:, :, 1:-1] + dense[:, :, :-2])
        dense, over_rows = _smooth(dense), _smooth(over_rows)
    return dense, over_rows


def _up_to_horizon(dense: Array, u: Array, horizon: Array, share: float) -> Array:
    """Return densities along rows of which a share lies before the horizon, at (slices, rows) of [0, 1].

    They go on beyond it for as far as the rest takes them: of a mixture of two lights the horizon then is where it is
    of each, because the readers mix the integrals of densities.
    """
    inside = u <= horizon[..., np.newaxis]
    count = np.maximum(inside.sum(axis=-1), 1)
    last = (count - 1)[..., np.newaxis]
    dense = np.take_along_axis(dense, np.minimum(np.arange(u.size), last), axis=-1)
    mean = np.sum(dense * inside, axis=-1) / count
    line = _SHARE * dense / mean[..., np.newaxis] + (1.0 - _SHARE)
    edge = np.take_along_axis(line, last, axis=-1)[..., 0]
    width = np.maximum((1.0 - share) / share * horizon * np.sum(line * inside, axis=-1) / (count * edge), u[1])
    beyond = np.clip(((horizon + width)[..., np.newaxis] - u) / u[1] + 0.5, 0.0, 1.0)
    first, second = np.where(inside, line, 0.0), np.where(inside, 0.0, line * beyond + 1e-3)
    ends = np.ones_like(horizon)
    wanted = share * _integral(first, ends) - _integral(first, horizon)
    given = _integral(second, horizon) - share * _integral(second, ends)
    scale = np.clip(wanted / np.minimum(given, -1e-9), 0.02, 50.0)
    return np.asarray(first + scale[..., np.newaxis] * second)


def _horizon(wi: Array, azimuth: Array) -> Array:
    """Return where rows meet the horizon of the viewer, shape (slices, rows), for azimuths from that of the light."""
    sine = np.hypot(wi[..., 0], wi[..., 1])
    theta_m = 0.5 * np.arctan2(wi[..., 2], -sine * np.cos(azimuth))
    return np.asarray(np.sqrt(theta_m * (2.0 / np.pi)))


def _integral(line: Array, end: Array) -> Array:
    """Return the integrals, in cells, of straight lines between nodes over [0, 1], up to their ends."""
    cells = line.shape[-1] - 1
    i = np.minimum((end * cells).astype(np.int64), cells - 1)[..., np.newaxis]
    part = end * cells - i[..., 0]
    sums = np.zeros(line.shape)
    np.cumsum(0.5 * (line[..., 1:] + line[..., :-1]), axis=-1, out=sums[..., 1:])
    low, high, below = (np.take_along_axis(a, k, axis=-1)[..., 0] for a, k in ((line, i), (line, i + 1), (sums, i)))
    return np.asarray(below + part * (low + 0.5 * part * (high - low)))


def _even(line: Array) -> Array:
    return np.asarray(line / line.mean(axis=-1, keepdims=True))


def _around(values: Array) -> Array:
    """Return values with one more row at each end: azimuths go round."""
    return np.concatenate([values[:, -2:-1], values, values[:, 1:2]], axis=1)


def _smooth(values: Array) -> Array:
    around = _around(values)
    return np.asarray(0.25 * (around[:, 2:] + 2.0 * around[:, 1:-1] + around[:, :-2]))
