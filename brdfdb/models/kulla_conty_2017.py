"""Kulla and Conty 2017: GGX facets, and a lobe that returns the light that they lose to one another."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.geometry import Directions, checked_angles, checked_vectors, finished
from brdfdb.lobes import GGX, Lobe
from brdfdb.models import _microfacets
from brdfdb.models._ggx_albedo import lost_share, mean_lost_share, share_bytes
from brdfdb.models._microfacets import CORRELATED, F_0, SCHLICK, by_checked_angles, by_vectors, painted
from brdfdb.models.heitz_2014 import ggx_schlick_vectors
from brdfdb.models.large_calls import for_large_calls_of_one
from brdfdb.models.turquin_2019 import ALPHA, ggx_scaled_vectors
from brdfdb.parameters import Arguments, Floats, ModelForm, ModelSpec, bytes_of

_GGX = (_microfacets.GGX, CORRELATED, SCHLICK)


@for_large_calls_of_one("alpha")
def ggx_compensated(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, f_0: ArrayLike, alpha: ArrayLike
) -> Floats:
    """Return the BRDF [1/sr] of GGX facets with the light that they reflect to one another (Kulla and Conty).

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    f_0 : array_like [1]
        Reflectance of a facet at normal incidence, in [0, 1].
    alpha : array_like [1]
        Width of the slopes in all directions, in [1e-6, 1]. The papers have one width.

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    Notes
    -----
    `ggx_schlick` without a uniform part, and F_ms (1 - E(theta_i)) (1 - E(theta_r)) / (pi (1 - E_avg)). E is the albedo
    of the facets with F = 1, and E_avg its mean. F_ms is F_avg^2 E_avg / (1 - F_avg (1 - E_avg)), with the mean
    F_avg = (20 f_0 + 1) / 21 of Schlick's reflectance. With f_0 = 1 the albedo is 1 for every angle and every alpha.
    1 - E has 12 digits for every alpha. Each alpha takes up to 10 ms at first.

    Departures from the paper: the first slides have F_avg in the place of F_avg^2. Light in this lobe has met two
    facets at least, so its reflectance is of second order in F. Hill 2018 says so, and later slides have the square.
    `ggx_scaled` is the form of Turquin 2019, which many renderers evaluate. It is not reciprocal.

    References
    ----------
    kullaconty2017, hill2018, kelemen2001, heitz2014, schlick1994

    Examples
    --------
    >>> import numpy as np
    >>> round(float(ggx_compensated(0.3, 0.0, 0.4, np.pi, f_0=0.9, alpha=0.5)), 4)
    0.3981
    """
    checked = checked_angles(theta_i, phi_i, theta_r, phi_r)
    f_0, alpha = F_0.check(f_0), ALPHA.check(alpha)
    single = by_checked_angles(_GGX, checked, painted(0.0, f_0, alpha, alpha))
    return finished(single + _multiple(checked, f_0, alpha, bounces=2), checked)


@for_large_calls_of_one("alpha")
def ggx_compensated_vectors(wi: ArrayLike, wr: ArrayLike, *, f_0: ArrayLike, alpha: ArrayLike) -> Floats:
    """Return `ggx_compensated` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    return _of_vectors(wi, wr, f_0, alpha, bounces=2)


def _first_slides(wi: Floats, wr: Floats, *, f_0: ArrayLike, alpha: ArrayLike) -> Floats:
    return _of_vectors(wi, wr, f_0, alpha, bounces=1)


def _of_vectors(wi: ArrayLike, wr: ArrayLike, f_0: ArrayLike, alpha: ArrayLike, bounces: int) -> Floats:
    checked = checked_vectors(wi, wr)
    f_0, alpha = F_0.check(f_0), ALPHA.check(alpha)
    single = by_vectors(_GGX, wi, wr, painted(0.0, f_0, alpha, alpha))
    return finished(single + _multiple(checked, f_0, alpha, bounces), checked)


def _reflected_again(f_0: Floats, mean_lost: Floats, bounces: int) -> Floats:
    """Return F_ms [1], the share of light that the facets lose once and that leaves the surface in the end."""
    F_avg = (20.0 * f_0 + 1.0) / 21.0
    return np.asarray(F_avg**bounces * (1.0 - mean_lost) / (1.0 - F_avg * mean_lost))


def _multiple(directions: Directions, f_0: Floats, alpha: Floats, bounces: int) -> Floats:
    """Return the second lobe [1/sr] in float64."""
    mean = mean_lost_share(alpha)
    lost_twice = lost_share(directions.cos_i, alpha) * lost_share(directions.cos_r, alpha)
    return np.asarray(_reflected_again(f_0, mean, bounces) * lost_twice / (np.pi * mean))


def _lobe(cos_i: Floats, *, f_0: ArrayLike, alpha: ArrayLike) -> Lobe:
    """Return the lobe of the facets. Its share is that of the light which they reflect once."""
    f_0, alpha = np.asarray(f_0, np.float64), np.asarray(alpha, np.float64)
    cos = np.clip(cos_i, 1e-16, 1.0)
    lost = lost_share(cos, alpha)
    once = (f_0 + (1.0 - f_0) * (1.0 - cos) ** 5) * (1.0 - lost)
    total = once + _reflected_again(f_0, mean_lost_share(alpha), 2) * lost
    return Lobe(once / total, alpha, alpha, GGX, visible=True)


def _lossless(_: Mapping[str, Any]) -> dict[str, float]:
    return {"f_0": 1.0}


def _forms(arguments: Arguments) -> Iterator[ModelForm]:
    size = bytes_of(arguments) + share_bytes(np.asarray(arguments["alpha"], np.float64))
    exact = "models.ggx_compensated"
    yield ModelForm("compensated", "F_avg squared", "exact", exact, ggx_compensated_vectors, size, single=True)
    yield ModelForm("first-slides", "F_avg of the first slides", "printed", exact, _first_slides, size)
    yield ModelForm("scaled", "scaled lobe, Turquin 2019", "customary", "models.ggx_scaled", ggx_scaled_vectors, size)
    title = "GGX, light lost among facets"
    yield ModelForm("single", title, "customary", "models.ggx_schlick", _single, bytes_of(arguments))


def _single(wi: Floats, wr: Floats, *, f_0: ArrayLike, alpha: ArrayLike) -> Floats:
    return ggx_schlick_vectors(wi, wr, rho_d=0.0, f_0=f_0, alpha_x=alpha, alpha_y=alpha)


SPEC = ModelSpec(
    name="ggx_compensated",
    version=1,
    title="GGX, energy compensated",
    equation="single and multiple scattering",
    reference="kullaconty2017",
    parameters=(F_0, ALPHA),
    evaluate=ggx_compensated,
    vectors=ggx_compensated_vectors,
    grazing_pole=True,
    grazing_power=0.0,
    lobe=_lobe,
    lossless=_lossless,
    forms=_forms,
)
