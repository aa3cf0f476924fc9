"""Kulla and Conty 2017: GGX facets, and a lobe that returns the light that they lose to one another."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.geometry import Directions, checked_vectors, finished
from brdfdb.lobes import GGX, Lobe
from brdfdb.models._ggx_albedo import lost_share, mean_lost_share, share_bytes
from brdfdb.models._microfacets import F_0, single_scattering
from brdfdb.models.declaration import DeclaredModel
from brdfdb.models.heitz_2014 import ggx_schlick
from brdfdb.models.turquin_2019 import ALPHA, ggx_scaled
from brdfdb.parameters import Arguments, Floats, ModelForm, bytes_of


def _reflected_again(f_0: Floats, mean_lost: Floats, bounces: int) -> Floats:
    """Return F_ms [1], the share of light that the facets lose once and that leaves the surface in the end."""
    F_avg = (20.0 * f_0 + 1.0) / 21.0
    return np.asarray(F_avg**bounces * (1.0 - mean_lost) / (1.0 - F_avg * mean_lost))


def _first_slides(wi: Floats, wr: Floats, *, f_0: ArrayLike, alpha: ArrayLike) -> Floats:
    directions = checked_vectors(wi, wr)
    return finished(_f_r(directions, F_0.check(f_0), ALPHA.check(alpha), bounces=1), directions)


def _lobe(cos_i: Floats, *, f_0: ArrayLike, alpha: ArrayLike) -> Lobe:
    """Return the lobe of the facets. Its share is that of the light which they reflect once."""
    f_0 = np.asarray(f_0, np.float64)
    alpha = np.asarray(alpha, np.float64)
    cos = np.clip(cos_i, 1e-16, 1.0)
    lost = lost_share(cos, alpha)
    once = (f_0 + (1.0 - f_0) * (1.0 - cos) ** 5) * (1.0 - lost)
    total = once + _reflected_again(f_0, mean_lost_share(alpha), 2) * lost
    return Lobe(once / total, alpha, alpha, GGX, visible=True)


def _forms(arguments: Arguments) -> Iterator[ModelForm]:
    size = bytes_of(arguments) + share_bytes(np.asarray(arguments["alpha"], np.float64))
    exact = "models.ggx_compensated"
    yield ModelForm("compensated", "F_avg squared", "exact", exact, ggx_compensated.vectors, size, single=True)
    yield ModelForm("first-slides", "F_avg of the first slides", "printed", exact, _first_slides, size)
    yield ModelForm("scaled", "scaled lobe, Turquin 2019", "customary", "models.ggx_scaled", ggx_scaled.vectors, size)
    title = "GGX, light lost among facets"
    yield ModelForm("single", title, "customary", "models.ggx_schlick", _single, bytes_of(arguments))


def _single(wi: Floats, wr: Floats, *, f_0: ArrayLike, alpha: ArrayLike) -> Floats:
    return ggx_schlick.vectors(wi, wr, rho_d=0.0, f_0=f_0, alpha_x=alpha, alpha_y=alpha)


@DeclaredModel(
    title="GGX, energy compensated",
    equation="single and multiple scattering",
    references="kullaconty2017, hill2018, kelemen2001, heitz2014, schlick1994",
    parameters=(F_0, ALPHA),
    together="alpha",
    grazing_pole=True,
    grazing_power=0.0,
    lobe=_lobe,
    lossless=lambda _: {"f_0": 1.0},
    forms=_forms,
)
def ggx_compensated(directions: Directions, f_0: Floats, alpha: Floats) -> Floats:
    """Return the BRDF [1/sr] of GGX facets with the light that they reflect to one another (Kulla and Conty).

    `ggx_schlick` without a uniform part, and F_ms (1 - E(theta_i)) (1 - E(theta_r)) / (pi (1 - E_avg)). E is the albedo
    of the facets with F = 1, and E_avg its mean. F_ms is F_avg^2 E_avg / (1 - F_avg (1 - E_avg)), with the mean
    F_avg = (20 f_0 + 1) / 21 of Schlick's reflectance. With f_0 = 1 the albedo is 1 for every angle and every alpha.
    1 - E has 12 digits for every alpha. Each alpha takes up to 10 ms at first.

    Departures from the paper: the first slides have F_avg in the place of F_avg^2. Light in this lobe has met two
    facets at least, so its reflectance is of second order in F. Hill 2018 says so, and later slides have the square.
    `ggx_scaled` is the form of Turquin 2019, which many renderers evaluate. It is not reciprocal.

    >>> round(float(ggx_compensated(0.3, 0.0, 0.4, np.pi, f_0=0.9, alpha=0.5)), 4)
    0.3981
    """
    return _f_r(directions, f_0, alpha, bounces=2)


def _f_r(directions: Directions, f_0: Floats, alpha: Floats, *, bounces: int) -> Floats:
    mean = mean_lost_share(alpha)
    lost_twice = lost_share(directions.cos_i, alpha) * lost_share(directions.cos_r, alpha)
    multiple = _reflected_again(f_0, mean, bounces) * lost_twice / (np.pi * mean)
    return np.asarray(single_scattering(directions, f_0, alpha) + multiple)
