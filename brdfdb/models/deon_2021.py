"""d'Eon 2021: a deep layer of small Lambertian spheres, sparse and at random, as an analytic fit of its transport."""

from __future__ import annotations

import math

import numpy as np

from brdfdb._numba import elementwise, kernel
from brdfdb.geometry import Directions
from brdfdb.models.declaration import DeclaredModel
from brdfdb.parameters import Floats, Parameter, white

RHO = Parameter("rho", "c", "1", 0.0, 1.0, "albedo of a sphere, for one scattering", reflectance=True)

Cubic = tuple[float, float, float, float]


def _in_1_less(*s: float) -> Cubic:
    """Return the coefficients in 1 - C of a polynomial whose coefficients in C are s: it keeps its digits at C = 1."""
    s_0, s_1, s_2, s_3 = (*s, 0.0)[:4]
    return (
        math.fsum((s_0, s_1, s_2, s_3)),
        -math.fsum((s_1, s_2, s_2, s_3, s_3, s_3)),
        math.fsum((s_2, 3.0 * s_3)),
        -s_3,
    )


# Numerators and denominators of the author's fits, in C = sqrt(1 - c)
_B = _in_1_less(-0.08446297239646791, 0.5153566145541554, -0.77757371002123, 0.34668869623791543)
_B_BELOW = _in_1_less(0.9648932738041012, -0.6655015709030936, 0.1826019462608555)
_BOTH = _in_1_less(682.8479477533338, -2567.7368047535556, 7487.987105705168, -5602.448801045478)
_BOTH_BELOW = _in_1_less(5850.602606063662, -4008.3309624647227, 1480.250743805733)
_MIXED = _in_1_less(0.2855294320307508, 160.39651500649123, -327.42799697993706, 166.88327184107732)
_MIXED_BELOW = _in_1_less(674.1908010450103, -412.9837444306491, 596.4232294419696)
_F = _in_1_less(-1.9208967199948512, -242.16001167844007, -21.914139454773085, 266.06342182761813)
_F_BELOW = _in_1_less(1499.904420175135, 457.4200839912641, 215.77342164754094)


@kernel
def _cubic(coefficients: Cubic, x: float) -> float:
    """Return a polynomial of degree 3 [1]."""
    return coefficients[0] + x * (coefficients[1] + x * (coefficients[2] + x * coefficients[3]))


@kernel
def _h0_less_1(u: float, c: float) -> float:
    """Return H - 1 [1] for the H function of the mean over azimuths, eq. (37)."""
    C = math.sqrt(1.0 - c)
    a = (8.216443463470172 + 1.501116252342486 * math.pow(C, 6.054351911707695)) / (
        4.175932557866179 - 1.2122216865199813 * C
    )
    d = (7.773097842804312 - 0.5658108102188075 * math.pow(C, 0.9615460393324836)) / (
        8.659120811349371 - 0.15997430541238322 * C**7
    )
    # 1 - 2 (89 c / 288 + 59 c^2 / 288 - c^3 / 72), factored: 0 at c = 1, without a difference that cancels
    loss = math.sqrt((1.0 - c) * (288.0 + 110.0 * c - 8.0 * c * c) / 288.0)
    gain = c * (178.0 + 118.0 * c - 8.0 * c * c) / (288.0 * (1.0 + loss))  # 1 - loss
    power = a * math.pow(u, d)
    return power * gain / (1.0 + loss * power)


@kernel
def _log_h1(u: float, c: float) -> float:
    """Return the logarithm [1] of the H function of the first cosine of the azimuth."""
    power = 0.45944184025347456 + u * (-1.0787917226917565 + u * (1.8572804924335546 - u * 1.1283119660147671))
    return (-0.14483935877260054 + 0.024285125615255733 * c) * c * math.pow(u, power)


@kernel
def _mean(u_i: float, u_r: float, h_i: float, h_r: float, c: float) -> float:
    """Return the mean of f_r over azimuths, of all scatterings but the first, times u_i + u_r [1/sr].

    h is H - 1. The constants A of all scatterings and 207 c / 384 of the first are the same. They cancel, so that f_r
    keeps its digits where both directions graze.
    """
    D = c / (1.0 + math.sqrt(1.0 - c))  # 1 - C
    A = 69.0 * c / 128.0
    B = _cubic(_B, D) / _cubic(_B_BELOW, D)
    both = _cubic(_BOTH, D) / _cubic(_BOTH_BELOW, D)
    mixed = _cubic(_MIXED, D) / _cubic(_MIXED_BELOW, D)
    E = 15.0 * (1.0 - c) * c * (3.0 + 4.0 * c / 3.0) / 128.0
    F = _cubic(_F, D) / _cubic(_F_BELOW, D)
    product, total = u_i * u_r, u_i + u_r
    squares = u_i**2 + u_r**2
    polynomial = both * product + E * product**2 + (B + mixed * product) * total + F * squares
    h = h_i + h_r + h_i * h_r
    first = c * (256.0 * product - 45.0 * squares + 135.0 * product**2) / 384.0
    return 0.5 / np.pi * (polynomial + h * (A + polynomial) - first)


@kernel
def _lambert_sphere(
    u_i: float,
    sin_i: float,
    u_r: float,
    sin_r: float,
    cos_dphi: float,
    h0_i: float,
    h0_r: float,
    log_i: float,
    log_r: float,
    c: float,
) -> float:
    product, s = u_i * u_r, sin_i * sin_r * cos_dphi
    cosine = min(1.0, max(-1.0, product + s))  # of the angle between light and viewer
    # phase function of a Lambertian sphere [1/sr]: the largest value is back towards the light
    phase = 2.0 / (3.0 * np.pi**2) * (math.sqrt((1.0 - cosine) * (1.0 + cosine)) + cosine * math.acos(-cosine))
    mean = _mean(u_i, u_r, h0_i, h0_r, c)
    # first cosine of the azimuth, of all scatterings but the first; 1 - (1 + l u_i) (1 + l u_r) H without cancellation
    l = (-0.05890107167021953 - 0.004740543453386809 * c) * c  # noqa: E741 - the author's letter
    less_1 = math.expm1(log_i + log_r)
    H = 1.0 + less_1
    lost = -less_1 - H * l * (u_i + u_r + l * product)
    turned = 4.0 / 3.0 * lost + 15.0 / 16.0 * product * (1.0 - (1.0 + 0.44 * c) * H)
    total = c * phase + mean - c * s * turned / (4.0 * np.pi)
    return max(0.0, total) / (u_i + u_r)


_mean_features, _turned_features = elementwise(_h0_less_1), elementwise(_log_h1)
_evaluate = elementwise(_lambert_sphere)


@DeclaredModel(
    title="Lambertian spheres",
    equation="eqs. 28, 37",
    references="deon2021",
    parameters=(RHO,),
    grazing_pole=True,
    grazing_power=0.0,
    lossless=white,
)
def lambert_sphere(directions: Directions, rho: Floats) -> Floats:
    """Return the BRDF [1/sr] of a deep layer of small Lambertian spheres, which lie sparse and at random.

    The layer is darker than a sphere: for rho = 0.5 its albedo is 0.18 to 0.30. f_r is the first scattering, exact, and
    a fit of all others in the mean over azimuths and in the first cosine of the azimuth. Against transport in the
    layer, solved by doubling, the mean over azimuths is within 0.2 % for rho = 0.1, 1 % for 0.9, and 2.7 % for 1, where
    up to 2.2 % of the light is lost. At rho = 0 the fit leaves up to 5e-5 / sr below 88 degrees. The formulas are those
    of the author's program, with which another public program agrees.

    >>> round(float(lambert_sphere(0.3, 0.0, 0.4, 0.0, rho=0.9)), 4)
    0.1692
    """
    c, u_i, u_r = rho, directions.cos_i, directions.cos_r
    functions = _mean_features(u_i, c), _mean_features(u_r, c), _turned_features(u_i, c), _turned_features(u_r, c)
    f_r: Floats = _evaluate(u_i, directions.sin_i, u_r, directions.sin_r, directions.cos_dphi, *functions, c)
    return f_r
