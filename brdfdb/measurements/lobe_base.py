"""The base that the ratio of samples is taken to: Lambert and one lobe."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from brdfdb.measurements.coordinates import half_angles
from brdfdb.measurements.samples import Samples
from brdfdb.measurements.usable_values import FLOOR, listed
from brdfdb.parameters import Floats

Base = Callable[[Floats, Floats], Floats]  # f_r [1/sr] (N, C) at unit vectors (N, 3)

_ALPHAS = np.geomspace(0.01, 2.0, 24)  # widths of the lobe of the base that are tried
_WIDEST_LOBE = 0.7  # width of a lobe beyond which it is no region of its own
_RISE = (
    49.0  # of Schlick's reflectance, from 0.02 at normal incidence to 1: steeper lobes would explode where they graze
)
_SEEN = 5  # samples within the width of a lobe that are needed to see its height
_FITTED = 2000  # samples that are fitted, at most
_SEED = 1998


class LobeBase(NamedTuple):
    """A base, the width of its lobe [1], its name, and tan(theta_h) up to which the lobe outshines the rest."""

    f_r: Base
    alpha: float
    words: str
    reach: float


class _LobeFit(NamedTuple):
    """Coefficients (3, C) of a base with a lobe of a width [1], the residual of its fit, and its least denominator."""

    residual: float
    alpha: float
    tail: bool
    coefficients: Floats
    least: float


def lambert_and_lobe(samples: Samples) -> LobeBase:
    """Return the base that fits samples best.

    It is Lambert and one lobe in tan theta_h, Gaussian or with a tail, alone and with Schlick's fifth power, over a
    denominator that is never below that of the samples; coefficients are not negative, and reflectances of 0.02 rise
    to 1 at most. A lobe that a few samples do not
    lie within could have any height, and is not tried.
    """
    from scipy.optimize import nnls

    wi, wr, values, _ = listed(samples)
    some = np.random.default_rng(_SEED).permutation(len(wi))[:_FITTED]
    wi = wi[some]
    wr = wr[some]
    values = values[some]
    weight = 1.0 / (np.abs(values) + FLOOR * np.nanmean(np.abs(values), axis=0))
    best: _LobeFit | None = None
    tan2 = np.sort(half_angles(wi, wr).tan2_h)
    least = float(np.min(_denominator(wi, wr)))  # beyond the samples, where light and viewer graze, it would go to 0
    narrowest = np.sqrt(tan2[min(_SEEN, tan2.size) - 1])
    for alpha, tail in itertools.product(np.append(_ALPHAS[narrowest <= _ALPHAS], _ALPHAS[-1]), (False, True)):
        columns = _columns(wi, wr, alpha, least, tail=tail)
        fits = [
            nnls(columns[good] * weight[good, c, np.newaxis], values[good, c] * weight[good, c])
            for c in range(values.shape[1])
            for good in [np.isfinite(values[:, c])]
        ]
        residual = float(sum(residual for _, residual in fits))
        if best is None or residual < best.residual:
            best = _LobeFit(residual, float(alpha), tail, np.stack([fit for fit, _ in fits], axis=1), least)
    assert best is not None
    chosen = best

    def base(wi: Floats, wr: Floats) -> Floats:
        return np.asarray(_columns(wi, wr, chosen.alpha, chosen.least, tail=chosen.tail) @ chosen.coefficients)

    kind = "with a tail" if chosen.tail else "Gaussian"
    words = f"Lambert and one {kind} lobe of width {chosen.alpha:.2g}"
    return LobeBase(base, chosen.alpha, words, _reach(chosen))


def _reach(fit: _LobeFit) -> float:
    """Return tan(theta_h) up to which the lobe is brighter than the Lambertian part of a base; 0 without a lobe."""
    rest, lobe = (float(part.mean()) for part in (fit.coefficients[0] / np.pi, fit.coefficients[1:].sum(axis=0)))
    if lobe <= rest or fit.alpha >= _WIDEST_LOBE:
        return 0.0
    ratio = lobe / max(rest, 1e-3 * lobe)
    return float(fit.alpha * np.sqrt(np.sqrt(ratio) - 1.0 if fit.tail else np.log(ratio)))


def _denominator(wi: Floats, wr: Floats) -> Floats:
    return np.asarray(wi[:, 2] + wr[:, 2] - wi[:, 2] * wr[:, 2])


def _columns(wi: Floats, wr: Floats, alpha: float, least: float, *, tail: bool) -> Floats:
    tan2, theta_d = half_angles(wi, wr)
    slope = tan2 / alpha**2
    lobe = (1.0 + slope) ** -2.0 if tail else np.exp(-slope)
    lobe = lobe / np.maximum(_denominator(wi, wr), least)
    return np.stack([np.full(len(wi), 1.0 / np.pi), lobe, lobe * (1.0 + _RISE * (1.0 - np.cos(theta_d)) ** 5)], axis=1)
