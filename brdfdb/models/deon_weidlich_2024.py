"""d'Eon and Weidlich 2024: VMF diffuse, a fit of rough diffuse surfaces from Lambert to a layer of spheres."""

from __future__ import annotations

import math

import numpy as np

from brdfdb._numba import elementwise, kernel
from brdfdb.geometry import Directions
from brdfdb.models.declaration import DeclaredModel
from brdfdb.parameters import Floats, HeightRelation, Parameter, SurfaceRelation, white

RHO = Parameter("rho", "c", "1", 0.0, 1.0, "albedo of a facet, for one scattering", reflectance=True)
ROUGHNESS = Parameter("roughness", "r", "1", 0.0, 1.0, "0 is Lambert, 1 a layer of spheres")

_SMOOTH, _ROUGH = 0.25, 0.9  # widths m between which the program has more terms of the cross section
_TINY = 1e-300


@kernel
def _width(roughness: float) -> float:
    """Return the width m [1] of the facets' normals, -ln(1 - sqrt(roughness)), for a roughness below 1."""
    return math.log1p(math.sqrt(roughness)) - math.log1p(-roughness)


@kernel
def _gaussian_cross_section(u: float, sin: float, m: float) -> float:
    """Return the cross section of facets [1] with Gaussian slopes, expanded for small m, towards a cosine u."""
    a = abs(u) / (m * sin + _TINY)
    rest = 0.5 * (math.exp(-a * a) * m * sin / math.sqrt(np.pi) - abs(u) * math.erfc(a))
    return rest + u * (1.0 - 0.5 * m * m) if u > 0.0 else rest


@kernel
def _cross_section(u: float, sin: float, roughness: float) -> float:
    """Return the projected area [1] of facets that face a direction of cosine u, per area of all facets.

    It is the clamped cosine in Legendre polynomials, each damped by the distribution of normals: by the ratio of
    modified spherical Bessel functions i_n(kappa) / i_0(kappa), for kappa = 2 / m^2.
    """
    if roughness == 1.0:
        return 0.25
    m = _width(roughness)
    if m < _SMOOTH:
        return _gaussian_cross_section(u, sin, m)
    half_m2 = 0.5 * m * m  # 1 / kappa
    # ratios i_n / i_{n-1} by their continued fraction, from a large n down; products from the first up
    r12 = 0.0
    for n in range(60, 12, -1):
        r12 = 1.0 / ((2 * n + 1) * half_m2 + r12)
    r12 = 1.0 / (25.0 * half_m2 + r12)
    r11 = 1.0 / (23.0 * half_m2 + r12)
    r10 = 1.0 / (21.0 * half_m2 + r11)
    r9 = 1.0 / (19.0 * half_m2 + r10)
    r8 = 1.0 / (17.0 * half_m2 + r9)
    r7 = 1.0 / (15.0 * half_m2 + r8)
    r6 = 1.0 / (13.0 * half_m2 + r7)
    r5 = 1.0 / (11.0 * half_m2 + r6)
    r4 = 1.0 / (9.0 * half_m2 + r5)
    r3 = 1.0 / (7.0 * half_m2 + r4)
    r2 = 1.0 / (5.0 * half_m2 + r3)
    a1 = 1.0 / (3.0 * half_m2 + r2)
    a2 = a1 * r2
    x = u * u
    sigma = 0.25 + 0.5 * a1 * u + 5.0 / 32.0 * a2 * (3.0 * x - 1.0)
    if m > _ROUGH:
        return sigma
    a4 = a2 * r3 * r4
    a6 = a4 * r5 * r6
    a8 = a6 * r7 * r8
    a10 = a8 * r9 * r10
    a12 = a10 * r11 * r12
    p4 = (3.0 + x * (-30.0 + x * 35.0)) / 8.0
    p6 = (-5.0 + x * (105.0 + x * (-315.0 + x * 231.0))) / 16.0
    p8 = (35.0 + x * (-1260.0 + x * (6930.0 + x * (-12012.0 + x * 6435.0)))) / 128.0
    p10 = (-63.0 + x * (3465.0 + x * (-30030.0 + x * (90090.0 + x * (-109395.0 + x * 46189.0))))) / 256.0
    p12 = 231.0 + x * (-18018.0 + x * (225225.0 + x * (-1021020.0 + x * (2078505.0 + x * (-1939938.0 + x * 676039.0)))))
    sigma += -3.0 / 32.0 * a4 * p4 + 13.0 / 256.0 * a6 * p6 - 17.0 / 512.0 * a8 * p8
    return sigma + 49.0 / 2048.0 * a10 * p10 - 75.0 / 4096.0 * a12 * p12 / 1024.0


@kernel
def _many_orders(u_i: float, u_r: float, r: float, c: float) -> float:
    """Return the fit of f_r [1/sr] of the fourth scattering and all later ones."""
    C2 = 1.0 - c
    C = math.sqrt(C2)
    scale = (1.0 - 0.5441615108674713 * C - 0.45302863761693374 * C2) / (1.0 + 1.4293127703064865 * C)
    power = math.atan((0.0225272 + (-0.264641 + r) * r) * math.erf(C))
    a = c / math.pow(1.0075 + 1.16942 * C, power)
    shape = -0.0578978 / (0.287663 + u_i * u_r) + abs(-0.0898863 + math.tanh(r))
    return max(0.0, 0.384016 * (-0.341969 + a) * a * scale * shape)


@kernel
def _vmf(
    u_i: float,
    sin_i: float,
    u_r: float,
    sin_r: float,
    cos_dphi: float,
    sigma_i: float,
    sigma_r: float,
    beneath: float,
    r: float,
    c: float,
) -> float:
    """Return f_r [1/sr]; sigma_i, sigma_r are cross sections, `beneath` is that from below the viewer."""
    if r == 0.0:
        return c / np.pi
    root = math.sqrt(r)
    r2, r3, r4, r5 = r * r, r**3, r**4, r**5
    r25, r45 = r2 * root, r4 * root
    total, product, squares = u_i + u_r, u_i * u_r, u_i * u_i + u_r * u_r
    both = product * product
    sines = sin_i * sin_r
    cos_2 = 2.0 * cos_dphi * cos_dphi - 1.0
    sections, below = sigma_i * sigma_r, u_r * sigma_i + u_i * beneath
    # first scattering: mean, first and second cosine of the azimuth
    c100 = 1.0 + (-0.1 * r + 0.84 * r4) / (1.0 + 9.0 * r3)
    c101 = (0.0173 * r + 20.4 * r2 - 9.47 * r3) / (1.0 + 7.46 * r)
    c102 = (-0.927 * r + 2.37 * r2) / (1.24 + r2)
    c103 = (-0.11 * r - 1.54 * r2) / (1.0 - 1.05 * r + 7.1 * r2)
    f10 = (c100 + c101 * product + c102 * both + c103 * squares) * sections / below
    c110 = (0.54 * r - 0.182 * r3) / (1.0 + 1.32 * r2)
    c111 = (-0.097 * r + 0.62 * r2 - 0.375 * r3) / (1.0 + 0.4 * r3)
    c112 = 0.283 + 0.862 * r - 0.681 * r2
    f11 = sines * (c110 + c111 * product) * math.pow(sections, c112) / below
    c120 = (2.25 * r + 5.1 * r2) / (1.0 + 9.8 * r + 32.4 * r2)
    c121 = (-4.32 * r + 6.0 * r3) / (1.0 + 9.7 * r + 287.0 * r3)
    f12 = sines * sines * (c120 + c121 * u_r) * (c120 + c121 * u_i) / total
    first = max(0.0, f10 + 2.0 * (f11 * cos_dphi + f12 * cos_2))
    # second scattering
    c200 = (0.00056 * r + 0.226 * r2) / (1.0 + 7.07 * r2)
    c201 = (-0.268 * r + 4.57 * r2 - 12.04 * r3) / (1.0 + 36.7 * r3)
    c202 = (0.418 * r + 2.52 * r2 - 0.97 * r3) / (1.0 + 10.0 * r2)
    c203 = (0.068 * r - 2.25 * r2 + 2.65 * r3) / (1.0 + 21.4 * r3)
    c204 = (0.05 * r - 4.22 * r3) / (1.0 + 17.6 * r2 + 43.1 * r3)
    f20 = (c200 + c201 * product + c203 * both + c202 * total + c204 * squares) / total
    c210 = (-0.049 * r - 0.027 * r3) / (1.0 + 3.36 * r2)
    c211 = (2.77 * r2 - 8.332 * r25 + 6.073 * r3) / (1.0 + 50.0 * r4)
    c212 = (-0.431 * r2 - 0.295 * r3) / (1.0 + 23.9 * r3)
    f21 = sines * (c210 + c211 * product + c212 * total) / total
    second = max(0.0, f20 + 2.0 * f21 * cos_dphi)
    # third scattering
    c300 = (-0.083 * r3 + 0.262 * r4) / (1.0 - 1.9 * r2 + 38.6 * r4)
    c301 = (-0.627 * r2 + 4.95 * r25 - 2.44 * r3) / (1.0 + 31.5 * r4)
    c302 = (0.33 * r2 + 0.31 * r25 + 1.4 * r3) / (1.0 + 20.0 * r3)
    c303 = (-0.74 * r2 + 1.77 * r25 - 4.06 * r3) / (1.0 + 215.0 * r5)
    c304 = -1.026 * r3 / (1.0 + 5.81 * r2 + 13.2 * r3)
    f30 = (c300 + c301 * product + c303 * both + c302 * total + c304 * squares) / total
    c310 = (0.028 * r2 - 0.0132 * r3) / (1.0 + 7.46 * r2 - 3.315 * r4)
    c311 = (-0.134 * r2 + 0.162 * r25 + 0.302 * r3) / (1.0 + 57.5 * r45)
    c312 = (-0.119 * r2 + 0.5 * r25 - 0.207 * r3) / (1.0 + 18.7 * r3)
    f31 = sines * (c310 + c311 * product + c312 * total) / total
    third = max(0.0, f30 + 2.0 * f31 * cos_dphi)
    return c * (first + c * (second + c * third)) / np.pi + _many_orders(u_i, u_r, r, c)


_section, _evaluate = elementwise(_cross_section), elementwise(_vmf)


@DeclaredModel(
    title="VMF diffuse",
    equation="the authors' program",
    references="deonweidlich2024, deon2021",
    parameters=(RHO, ROUGHNESS),
    grazing_pole=True,
    grazing_power=0.0,
    excess="d'Eon and Weidlich 2024: the scatterings are fitted one by one; measured 1.14 at 89.9 degrees for rho = 1 "
    "and a roughness of 0.98",
    lossless=white,
    surfaces=(SurfaceRelation(facets="diffuse", bounces="all", parameters=("roughness",), by_rho=True),),
    heights=HeightRelation(
        left_out="its facets face all directions of a sphere, overhangs included, which no height map shows"
    ),
)
def vmf_diffuse(directions: Directions, rho: Floats, roughness: Floats) -> Floats:
    """Return the BRDF [1/sr] of diffuse facets whose normals follow a von Mises-Fisher distribution.

    The normals have kappa = 2 / m^2 with m = -ln(1 - sqrt(roughness)). f_r is the sum of three scatterings and of all
    later ones, each fitted. The formulas are those of the authors' program, which three other programs repeat; one of
    them has erf(c) where the others have erf(sqrt(1 - c)). That makes up to 4 % of f_r.

    * The fit does not conserve energy: at rho = 1 its albedo is 0.90 to 1.14, most at grazing for a high roughness.
    * It does not tend to Lambert: at rho = 1 and a roughness of 1e-12 its albedo at normal incidence is 1.02.
    * At roughness 0.049 and 0.352, where the program changes the expansion of the cross section, f_r jumps.
    * At a roughness of 1 and rho = 0.9 the mean over azimuths is up to 13 % from that of transport in the layer;
      `lambert_sphere` is within 1 %.

    >>> round(float(vmf_diffuse(0.3, 0.0, 0.4, 0.0, rho=0.9, roughness=0.5)), 4)
    0.2679
    """
    c, r = rho, roughness
    u_i, sin_i, u_r, sin_r = directions.cos_i, directions.sin_i, directions.cos_r, directions.sin_r
    sections = _section(u_i, sin_i, r), _section(u_r, sin_r, r), _section(-u_r, sin_r, r)
    f_r: Floats = _evaluate(u_i, sin_i, u_r, sin_r, directions.cos_dphi, *sections, r, c)
    return f_r
