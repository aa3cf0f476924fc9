"""The light that facets with GGX slopes lose: 1 less their directional albedo at F = 1, with all its digits.

The azimuth of the viewer is integrated in closed form, so the share is a single integral over the cosine c of the
viewer's polar angle. Nothing is subtracted from 1: the integrand is the density of mirrored directions times the share
of each that other facets hide, so that surfaces of any alpha have a small relative error.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.gauss import gauss_rule
from brdfdb.parameters import Floats

_NODES = 14  # of Gauss's rule on a panel
_PANEL = 1.8  # largest length of a panel, in the variable v of c = c_0 + r sinh(v)
_DEGREE = 20  # coefficients of a Chebyshev series
_WIDTH = 1.5  # largest width of a series, in the variable v of `Share`
_MEAN_NODES = 24  # nodes of Gauss's rule for the mean, on each series
_TABLES = 1024  # alphas that are remembered, 0.2 to 2 kB each
_FEW = 16  # distinct alphas up to which each has series of its own
_BLOCK = 1000  # values of a quadrature at a time
_NARROWEST = 1e-6  # alpha

_RULE = gauss_rule(_NODES)


def _graded(length: Floats, r: Floats) -> tuple[Floats, Floats]:
    """Return nodes r sinh(v) from 0 to the lengths, dense up to r, and their weights, for columns of both."""
    v = np.arcsinh(length / r)
    panels = max(1, int(np.ceil(np.max(v) / _PANEL)))
    y = ((np.arange(panels)[:, np.newaxis] + (_RULE.nodes + 1.0) / 2.0) / panels).ravel()
    return r * np.sinh(v * y), r * np.cosh(v * y) * v * np.tile(_RULE.weights / (2.0 * panels), panels)


def lost_by_quadrature(cos: Floats, alpha: Floats) -> Floats:
    """Return the share [1] of light that is lost, for cosines of its polar angle in (0, 1] and alpha in (0, 1]."""
    mu, alpha = cos[..., np.newaxis], np.asarray(alpha)[..., np.newaxis]
    a2, beta = alpha * alpha, np.maximum((1.0 - alpha) * (1.0 + alpha), 1e-300)
    R_i, sin2 = np.sqrt(beta * mu * mu + a2), (1.0 - mu) * (1.0 + mu)

    def density(c: Floats, versine: Floats, d: Floats) -> Floats:
        # D G_1(i) / (4 mu) over all azimuths. c = cos theta_r, versine = 1 - c, d = beta c - mu (1 + alpha^2)
        z, q = mu + c, d * d + 4.0 * a2 * sin2
        C = a2 * z * z + sin2 + versine * (1.0 + c)
        return a2 / (mu + R_i) * (1.0 + 2.0 * beta * z / np.sqrt(q) + beta * beta * z * C / (q * np.sqrt(q)))

    def hidden(c: Floats, versine: Floats) -> Floats:
        # 1 - G_2 / G_1 = Lambda_r / (1 + Lambda_i + Lambda_r)
        R_r = np.sqrt(c * c + a2 * versine * (1.0 + c))
        return a2 * versine * (1.0 + c) / ((R_r + c) * (R_r + c * R_i / mu))

    # Facets that mirror the light below the horizon, c in [-mu, 0]
    c: Floats = -mu * (_RULE.nodes + 1.0) / 2.0
    lost = density(c, 1.0 - c, beta * c - mu * (1.0 + a2)) @ _RULE.weights * mu[..., 0] / 2.0
    # The peak at c = mu (1 + alpha^2) / beta, or 1 where that is larger: c = peak + r sinh(v)
    beyond = 2.0 * a2 * mu / beta - (1.0 - mu)
    peak = np.where(beyond < 0.0, mu * (1.0 + a2) / beta, 1.0)
    versine_peak = np.maximum(-beyond, 0.0)
    d_peak = np.where(beyond < 0.0, 0.0, (1.0 - mu) - a2 * (1.0 + mu))
    r = np.hypot(np.maximum(beyond, 0.0), 2.0 * alpha * np.sqrt(sin2) / beta)
    # No wider than the distance to c = -mu, where the hidden share has a pole
    r = np.clip(r, 1e-30, peak + mu)
    for sign, length in ((1.0, versine_peak), (-1.0, peak / 2.0)):
        step, weight = _graded(length, r)
        c, versine = peak + sign * step, versine_peak - sign * step
        lost = lost + np.sum(density(c, versine, d_peak + beta * sign * step) * hidden(c, versine) * weight, axis=-1)
    # The lower half towards the horizon, where the hidden share varies with c / mu and c / alpha
    c, weight = _graded(peak / 2.0, np.minimum(mu, alpha))
    below = density(c, 1.0 - c, beta * c - mu * (1.0 + a2)) * hidden(c, 1.0 - c) * weight
    return np.asarray(lost + np.sum(below, axis=-1))


def _transform(turn: Floats) -> Floats:
    """Return the matrix from values at cos(turn) to coefficients of a Chebyshev series."""
    transform = 2.0 / _DEGREE * np.cos(np.arange(_DEGREE)[:, np.newaxis] * turn)
    transform[0] /= 2.0
    return np.asarray(transform)


def _clenshaw(series: Floats, at: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Return the number of the series at each place, whose series have the length 1, and its value."""
    number = np.fmin(np.fmax(at, 0.0), series.shape[1] - 0.5).astype(np.intp)
    x = 2.0 * (at - number) - 1.0
    last, value = np.zeros_like(x), np.zeros_like(x)
    for row in series[:0:-1]:
        last, value = value, row[number] + 2.0 * x * value - last
    return number, series[0][number] + x * value - last


class Share(NamedTuple):
    """The lost share of one alpha as Chebyshev series in v = arcsinh(s mu / alpha) / s, with s^2 = 1 - alpha^2.

    In v the share has no singularity near the real axis but a logarithm at grazing. The first series is that of
    L / mu + R ln(mu), R = sqrt(s^2 mu^2 + alpha^2), in which the logarithm is cancelled. The others are those of L R^2.
    """

    alpha: float
    s: float
    width: float
    series: Floats  # (`_DEGREE`, count)

    def __call__(self, cos: Floats) -> Floats:
        """Return the share [1] for cosines of any shape; nan for nan."""
        mu = np.asarray(cos, np.float64)
        place, value = _clenshaw(self.series, np.arcsinh(self.s * mu / self.alpha) / (self.s * self.width))
        R2 = (self.s * mu) ** 2 + self.alpha**2
        return np.asarray(np.where(place == 0, mu * (value - np.sqrt(R2) * np.log(mu)), value / R2))


@functools.lru_cache(_TABLES)
def share_of(alpha: float) -> tuple[Share, float]:
    """Return the lost share of an alpha in (0, 1] as a function of the cosine, and its mean over all directions."""
    s = max(np.sqrt((1.0 - alpha) * (1.0 + alpha)), 1e-8)
    v_end = np.arcsinh(s / alpha) / s
    count = int(np.ceil(v_end / _WIDTH))
    width = v_end / count
    turn = (np.arange(_DEGREE) + 0.5) * np.pi / _DEGREE
    v = width * (np.arange(count) + (np.cos(turn)[:, np.newaxis] + 1.0) / 2.0)
    mu = np.minimum(alpha / s * np.sinh(s * v), 1.0)
    lost = lost_by_quadrature(mu, np.asarray(alpha))
    R2 = (s * mu) ** 2 + alpha**2
    values = lost * R2
    values[:, 0] = lost[:, 0] / mu[:, 0] + np.sqrt(R2[:, 0]) * np.log(mu[:, 0])
    share = Share(alpha, s, width, _transform(turn) @ values)
    return share, _mean(share)


def _mean(share: Share) -> float:
    """Return the mean [1] over all directions, weighted by the cosine: 2 L mu dmu, and dmu = R dv."""
    x, w = gauss_rule(_MEAN_NODES)
    y = (x[:, np.newaxis] + 1.0) / 2.0
    v, step = share.width * (np.arange(share.series.shape[1]) + y), np.full((x.size, share.series.shape[1]), 1.0)
    v[:, 0], step[:, 0] = share.width * y[:, 0] ** 4, 4.0 * y[:, 0] ** 3  # for the logarithm
    mu = np.minimum(share.alpha / share.s * np.sinh(share.s * v), 1.0)
    R = np.sqrt((share.s * mu) ** 2 + share.alpha**2)
    return float(np.sum(share(mu) * mu * R * step * w[:, np.newaxis]) * share.width)


@functools.cache
def _means() -> tuple[float, Floats]:
    """Return Chebyshev series of ln(mean / alpha^2) in the logarithm of alpha, and their width."""
    count = int(np.ceil(-np.log(_NARROWEST) / _WIDTH))
    width = -np.log(_NARROWEST) / count
    turn = (np.arange(_DEGREE) + 0.5) * np.pi / _DEGREE
    alphas = np.exp(-width * (np.arange(count) + (np.cos(turn)[:, np.newaxis] + 1.0) / 2.0))
    values = np.array([[np.log(share_of(alpha)[1] / alpha**2) for alpha in row] for row in alphas.tolist()])
    return width, _transform(turn) @ values


def lost_share(cos: Floats, alpha: Floats) -> Floats:
    """Return the share [1] of light that GGX facets with F = 1 lose, 1 - E.

    Parameters
    ----------
    cos : array [1]
        Cosine of the polar angle of light or viewer, in (0, 1]; nan passes through.
    alpha : array [1]
        Width of the slopes, in [1e-6, 1]. A few of them take 1 to 10 ms each at first; many take 15 us a value.

    Returns
    -------
    array [1]
        In the broadcast shape. Relative error below 1e-12.
    """
    distinct = np.unique(alpha)
    if distinct.size == 1:
        return share_of(float(distinct[0]))[0](np.broadcast_to(cos, np.broadcast_shapes(np.shape(cos), alpha.shape)))
    cos, alpha = np.broadcast_arrays(cos, alpha)
    lost = np.empty(cos.shape)
    if distinct.size <= _FEW:
        for one in distinct:
            where = alpha == one
            lost[where] = share_of(float(one))[0](cos[where])
        return lost
    for start in range(0, cos.size, _BLOCK):
        block = slice(start, start + _BLOCK)
        lost.reshape(-1)[block] = lost_by_quadrature(cos.reshape(-1)[block], alpha.reshape(-1)[block])
    return lost


def mean_lost_share(alpha: Floats) -> Floats:
    """Return the mean [1] of `lost_share` over all directions, weighted by the cosine: 1 less the mean of E."""
    distinct, place = np.unique(alpha, return_inverse=True)
    if distinct.size <= _FEW:
        means = np.array([share_of(float(one))[1] for one in distinct])
    else:
        width, series = _means()
        means = distinct**2 * np.exp(_clenshaw(series, -np.log(distinct) / width)[1])
    return means[place].reshape(alpha.shape)


def share_bytes(alpha: Floats) -> int:
    """Return the size [byte] of the series that `lost_share` reads."""
    return sum(share_of(float(one))[0].series.nbytes for one in np.unique(alpha))
