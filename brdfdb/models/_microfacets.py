"""Mirror facets of Walter 2007 and Heitz 2014: two distributions of slopes, two shadowings, two reflectances."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb._elementary import cosine, erfcx, exp
from brdfdb._numba import inner_loop, kernel, loop
from brdfdb.fresnel import reflectance_quotient
from brdfdb.geometry import Directions, Vectors
from brdfdb.lobes import Lobe, SlopeDistribution
from brdfdb.models._rows import RowLoops, by_rows, by_rows_of_vectors
from brdfdb.parameters import Floats, K, N, Parameter

ALPHA_X = Parameter("alpha_x", "α_x", "1", 1e-6, 2.0, "width of the facets' slopes along x")
ALPHA_Y = Parameter("alpha_y", "α_y", "1", 1e-6, 2.0, "width of the facets' slopes along y")
F_0 = Parameter("f_0", "F_0", "1", 0.0, 1.0, "reflectance of a facet at normal incidence", reflectance=True)
RHO_D = Parameter("rho_d", "ρ_d", "1", 0.0, 1.0, "albedo of the uniform part", reflectance=True)

Rows = NDArray[np.float64]

_GGX, _BECKMANN = range(2)  # distributions of slopes
_CORRELATED, _SEPARABLE = range(2)  # shadowing
_SCHLICK, _EXACT = range(2)  # reflectance of a facet

_SQRT_PI = 1.7724538509055160
_TINY = 1e-100  # guard against 0 / 0 at normal incidence, where nothing is shadowed
_FLAT = 30.0  # a from which on exp(-a^2) is 0
_NEVER = 1.6  # a of Walter's eq. (27) from which on nothing is shadowed


@kernel
def _reach(distribution: int, shadowing: int, cos: float, t2: float) -> float:
    """Return a function of one direction from which `_lobe` makes its shadowing.

    t is the width of the slopes towards the direction, times its sine: alpha tan(theta) is t / cos. With Smith's
    Lambda, cos (1 + 2 Lambda) of GGX, cos Lambda of Beckmann, or cos / G_1 where the shadowing is separable.
    """
    if distribution == _GGX:
        # Walter 2007, eq. (34); Heitz 2014: Lambda = (sqrt(1 + 1 / a^2) - 1) / 2
        root = math.sqrt(cos * cos + t2)
        return root if shadowing == _CORRELATED else 0.5 * (cos + root)
    t = math.sqrt(t2) + _TINY
    a = cos / t
    a = _FLAT if a > _FLAT else a
    if shadowing == _CORRELATED:
        # Heitz 2014: Lambda = (erf(a) - 1) / 2 + exp(-a^2) / (2 a sqrt(pi)), without the difference erf(a) - 1
        return 0.5 * exp(-a * a) * (t / _SQRT_PI - cos * erfcx(a))
    # Walter 2007, eq. (27), cos / G_1
    above = t * (1.0 + a * (2.276 + a * 2.577)) / (3.535 + a * 2.181)
    return cos if a >= _NEVER else above


@kernel
def _reflected(kind: int, u: float, sin2: float, first: float, second: float, above: float, below: float) -> float:
    """Return F above / below, with the reflectance F [1] of a facet, of f_0 or of n and k.

    u is the cosine of the angle on the facet and sin2 the square of its sine. There is a single division, because a
    division takes as long as many products.
    """
    if kind == _EXACT:
        numerator, denominator = reflectance_quotient(u, first, second)
        numerator = denominator if numerator > denominator else numerator  # by rounding
        return numerator * above / (denominator * below)
    # 1 - u is sin2 / (1 + u), which keeps its digits near normal incidence
    one_plus_u = 1.0 + u
    inverse = 1.0 / (one_plus_u * below)
    m = sin2 * (below * inverse)
    m2 = m * m
    return (first + (1.0 - first) * (m2 * m2 * m)) * above * (one_plus_u * inverse)


@kernel
def _lobe(
    distribution: int,
    shadowing: int,
    fresnel: int,
    i: tuple[float, float, float],
    r: tuple[float, float, float],
    reach: tuple[float, float],
    slopes: tuple[float, float, float],
    index: tuple[float, float],
) -> float:
    """Return f_r [1/sr] of the facets: F D G / (4 cos_i cos_r), Walter 2007, eq. (20).

    i and r are unit vectors, reach is `_reach` of each, slopes is 1 / alpha along x and y and 1 / (pi alpha_x alpha_y),
    and index is f_0 or n and k.
    """
    cos_i, cos_r, reach_i, reach_r = i[2], r[2], reach[0], reach[1]
    h_x, h_y, h_z = i[0] + r[0], i[1] + r[1], cos_i + cos_r
    u_x, u_y, peak = slopes
    h_z2 = h_z * h_z
    length2 = h_x * h_x + h_y * h_y + h_z2
    u = 0.5 * math.sqrt(length2)
    sin2 = 0.25 * ((i[0] - r[0]) ** 2 + (i[1] - r[1]) ** 2 + (cos_i - cos_r) ** 2)
    u = 1.0 if u > 1.0 else u
    s2 = (h_x * u_x) ** 2 + (h_y * u_y) ** 2
    # G / (4 cos_i cos_r)
    if shadowing == _SEPARABLE:
        below = 4.0 * (reach_i * reach_r)
    elif distribution == _GGX:
        # Heitz 2014, eq. (99): 1 / (1 + Lambda_i + Lambda_r)
        below = 2.0 * (cos_r * reach_i + cos_i * reach_r)
    else:
        below = 4.0 * (cos_i * cos_r + cos_r * reach_i + cos_i * reach_r)
    # D of the slopes over cos^4 of h
    if distribution == _GGX:
        q = h_z2 + s2
        above, below = peak, q * q * below
    else:
        above, below = peak * exp(-s2 / h_z2), h_z2 * h_z2 * below
    return _reflected(fresnel, u, sin2, index[0], index[1], above * (length2 * length2), below)


@inner_loop
def _angle_rows(
    distribution: int, shadowing: int, fresnel: int, cos_phi: Rows, sin_phi: Rows, scalars: Rows, f_r: Rows
) -> None:
    for row in range(f_r.shape[0]):
        s, f = scalars[:, row], f_r[row]
        x_i, y_i, cos_i, sin_r, cos_r = s[0], s[1], s[2], s[3], s[4]
        uniform, first, second, alpha_x, alpha_y = s[5] / np.pi, s[6], s[7], s[8], s[9]
        slopes = 1.0 / alpha_x, 1.0 / alpha_y, 1.0 / (np.pi * alpha_x * alpha_y)
        c_phi, s_phi = cos_phi[min(row, cos_phi.shape[0] - 1)], sin_phi[min(row, sin_phi.shape[0] - 1)]
        reach_i = _reach(distribution, shadowing, cos_i, (x_i * alpha_x) ** 2 + (y_i * alpha_y) ** 2)
        for j in range(f.shape[0]):
            x_r, y_r = sin_r * c_phi[j], sin_r * s_phi[j]
            reach_r = _reach(distribution, shadowing, cos_r, (x_r * alpha_x) ** 2 + (y_r * alpha_y) ** 2)
            i, r = (x_i, y_i, cos_i), (x_r, y_r, cos_r)
            f[j] = uniform + _lobe(distribution, shadowing, fresnel, i, r, (reach_i, reach_r), slopes, (first, second))


@inner_loop
def _vector_rows(
    distribution: int, shadowing: int, fresnel: int, w_i: Floats, w_r: Floats, scalars: Rows, f_r: Floats
) -> None:
    for row in range(f_r.shape[0]):
        s, f = scalars[row], f_r[row]
        uniform, first, second, alpha_x, alpha_y = s[0] / np.pi, s[1], s[2], s[3], s[4]
        slopes = 1.0 / alpha_x, 1.0 / alpha_y, 1.0 / (np.pi * alpha_x * alpha_y)
        v, w = w_i[min(row, w_i.shape[0] - 1)].reshape(-1), w_r[min(row, w_r.shape[0] - 1)].reshape(-1)
        for j in range(f.shape[0]):
            x_i, y_i, z_i = np.float64(v[3 * j]), np.float64(v[3 * j + 1]), np.float64(v[3 * j + 2])
            x_r, y_r, z_r = np.float64(w[3 * j]), np.float64(w[3 * j + 1]), np.float64(w[3 * j + 2])
            cos_i, cos_r = cosine(z_i), cosine(z_r)
            reach_i = _reach(distribution, shadowing, cos_i, (x_i * alpha_x) ** 2 + (y_i * alpha_y) ** 2)
            reach_r = _reach(distribution, shadowing, cos_r, (x_r * alpha_x) ** 2 + (y_r * alpha_y) ** 2)
            i, r = (x_i, y_i, cos_i), (x_r, y_r, cos_r)
            lobe = _lobe(distribution, shadowing, fresnel, i, r, (reach_i, reach_r), slopes, (first, second))
            f[j] = (uniform + lobe) * (0.0 if z_i < 0.0 or z_r < 0.0 else 1.0)  # nan stays nan


def _loops(distribution: int, shadowing: int, fresnel: int) -> RowLoops:
    """Return loops of a form. The form is a constant to them, so they have no branch, and vectorise."""

    @loop
    def by_angles(cos_phi: Rows, sin_phi: Rows, scalars: Rows, f_r: Rows) -> None:
        _angle_rows(distribution, shadowing, fresnel, cos_phi, sin_phi, scalars, f_r)

    @loop
    def by_vectors(w_i: Floats, w_r: Floats, scalars: Rows, f_r: Floats) -> None:
        _vector_rows(distribution, shadowing, fresnel, w_i, w_r, scalars, f_r)

    return RowLoops(by_angles, by_vectors)


GGX_LOOPS = _loops(_GGX, _CORRELATED, _EXACT)
GGX_SCHLICK_LOOPS = _loops(_GGX, _CORRELATED, _SCHLICK)
BECKMANN_LOOPS = _loops(_BECKMANN, _CORRELATED, _EXACT)
BECKMANN_SCHLICK_LOOPS = _loops(_BECKMANN, _CORRELATED, _SCHLICK)
GGX_SEPARABLE_LOOPS = _loops(_GGX, _SEPARABLE, _EXACT)
BECKMANN_SEPARABLE_LOOPS = _loops(_BECKMANN, _SEPARABLE, _EXACT)

_NONE = np.zeros(())


class FacetParameters(NamedTuple):
    """The parameters [1] that the loops read: the uniform part, f_0 or n and k, and the widths of the slopes."""

    rho_d: Floats
    f_0_or_n: Floats
    k: Floats
    alpha_x: Floats
    alpha_y: Floats


def metal(alpha_x: Floats, alpha_y: Floats, n: Floats, k: Floats, _: Floats | None = None) -> FacetParameters:
    """Return facets of a material with the index n + ik. The formulas do not read its wavelength, the last argument."""
    return FacetParameters(_NONE, n, k, alpha_x, alpha_y)


def painted(rho_d: Floats, f_0: Floats, alpha_x: Floats, alpha_y: Floats) -> FacetParameters:
    """Return facets with Schlick's reflectance over a uniform part."""
    return FacetParameters(rho_d, f_0, _NONE, alpha_x, alpha_y)


def single_scattering(directions: Directions, f_0: Floats, alpha: Floats) -> Floats:
    """Return f_r [1/sr] of GGX facets with Schlick's reflectance, with any value below the horizon."""
    facets = painted(_NONE, f_0, alpha, alpha)
    if isinstance(directions, Vectors):
        return by_rows_of_vectors(GGX_SCHLICK_LOOPS.by_vectors, directions, facets)
    columns = (directions.cos_phi_r, directions.sin_phi_r)
    scalars = (directions.x_i, directions.y_i, directions.cos_i, directions.sin_r, directions.cos_r, *facets)
    return by_rows(GGX_SCHLICK_LOOPS.by_angles, columns, scalars)


_SHARE = 0.9  # share of samples in the lobe: the rest bounds the weights at grazing


def _most(distribution: SlopeDistribution, alpha_x: Floats, alpha_y: Floats) -> Floats:
    """Return the share [1] of samples in a lobe that reflects all light.

    Visible facets bound their own weights. Rough ones mirror light below the horizon: samples of the cosine, which are
    never lost, then lower the variance.
    """
    if distribution.visible is None:
        return np.full(np.broadcast_shapes(alpha_x.shape, alpha_y.shape), _SHARE)
    return 1.0 / (1.0 + 0.25 * alpha_x * alpha_y)


def lobe_of_metal(distribution: SlopeDistribution) -> Callable[..., Lobe]:
    """Return the `lobe` of a model without a uniform part, for one distribution of slopes."""

    def lobe(cos_i: Floats, *, alpha_x: ArrayLike, alpha_y: ArrayLike, n: ArrayLike, **_: ArrayLike) -> Lobe:
        """Return the lobe of the facets. Its widths are the alphas."""
        alpha_x, alpha_y = np.asarray(alpha_x, np.float64), np.asarray(alpha_y, np.float64)
        most = _most(distribution, alpha_x, alpha_y)
        share = np.broadcast_to(most, np.broadcast_shapes(np.shape(cos_i), np.shape(n), most.shape))
        return Lobe(share, alpha_x, alpha_y, distribution, distribution.visible is not None)

    return lobe


def lobe_of_painted(distribution: SlopeDistribution) -> Callable[..., Lobe]:
    """Return the `lobe` of a model with a uniform part, for one distribution of slopes."""

    def lobe(cos_i: Floats, *, rho_d: ArrayLike, f_0: ArrayLike, alpha_x: ArrayLike, alpha_y: ArrayLike) -> Lobe:
        """Return the lobe of the facets. Its share follows from the reflectances, and its widths are the alphas."""
        f_0, rho_d = np.asarray(f_0, np.float64), np.asarray(rho_d, np.float64)
        alpha_x, alpha_y = np.asarray(alpha_x, np.float64), np.asarray(alpha_y, np.float64)
        reflected = f_0 + (1.0 - f_0) * (1.0 - np.clip(cos_i, 0.0, 1.0)) ** 5
        total = reflected + rho_d
        share = np.divide(reflected, total, where=total > 0.0, out=np.zeros(np.shape(total)))
        share = share * _most(distribution, alpha_x, alpha_y)
        return Lobe(share, alpha_x, alpha_y, distribution, distribution.visible is not None)

    return lobe


def lossless_metal(_: Mapping[str, Any]) -> dict[str, float]:
    """Return the n and k of a metal that absorbs next to nothing, at most n / k of the light."""
    return {"n": N.low, "k": K.high}


def lossless_painted(_: Mapping[str, Any]) -> dict[str, float]:
    """Return facets that reflect all light, without a uniform part."""
    return {"rho_d": 0.0, "f_0": 1.0}
