"""He et al. 1991 by hand: closed forms to check the figures, which share no code with the models."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from brdfdb.parameters import Floats
from brdfdb.reference import he_torrance_1991 as reference


def fresnel(theta_deg: float | Floats, n: float, k: float) -> Floats:
    """Return |F|^2 [1] of unpolarised light, eq. 75, as textbooks write it, for an index n + ik."""
    cos = np.cos(np.deg2rad(np.asarray(theta_deg, dtype=np.float64)))
    index2 = complex(n, k) ** 2
    q = np.sqrt(index2 - (1.0 - cos**2) + 0j)
    s = (cos - q) / (cos + q)
    p = (index2 * cos - q) / (index2 * cos + q)
    value: Floats = 0.5 * (np.abs(s) ** 2 + np.abs(p) ** 2)
    return value


def smith(theta_deg: float, slope: float) -> float:
    """Return Smith's shadowing S_1 [1] of one direction, eqs 23 to 25 with the Gaussian of Smith 1967."""
    if theta_deg == 0.0:
        return 1.0
    x = 1.0 / math.tan(math.radians(theta_deg)) / (2.0 * slope)
    Lambda = 0.5 * (math.exp(-x * x) / (math.sqrt(math.pi) * x) - math.erfc(x))
    return (1.0 - 0.5 * math.erfc(x)) / (Lambda + 1.0)


def share_of_variance(theta_i_deg: float, theta_r_deg: float, slope: float) -> float:
    """Return (sigma / sigma_0)^2 [1] of eqs 80 to 83; bisection gives the root of eq. 81."""
    K = 0.0
    for theta_deg in (theta_i_deg, theta_r_deg):
        tan = math.tan(math.radians(theta_deg))
        K += tan * math.erfc(1.0 / (2.0 * slope * tan)) / 4.0 if tan > 0.0 else 0.0
    low = 0.0
    high = 1.0 + K  # bounds of z = z_0 / sigma_0, with sqrt(pi / 2) z = K exp(-z^2 / 2)
    for _ in range(80):
        middle = 0.5 * (low + high)
        rising = math.sqrt(math.pi / 2.0) * middle > K * math.exp(-0.5 * middle * middle)
        low, high = (low, middle) if rising else (middle, high)
    return 1.0 / (1.0 + low * low)


def specular(surface: dict[str, Any], theta_i_deg: float) -> float:
    """Return rho_s [1] of a surface, eq. 73, by eqs 23 to 25, 75 and 79 to 83."""
    slope = surface["sigma_0_um"] / surface["tau_um"]
    waves = surface["sigma_0_um"] * 1000.0 / surface["wavelength_nm"]
    cos = math.cos(math.radians(theta_i_deg))
    g = (4.0 * math.pi * waves * cos) ** 2 * share_of_variance(theta_i_deg, theta_i_deg, slope)
    shadow = smith(theta_i_deg, slope) ** 2
    return float(fresnel(theta_i_deg, surface["n"], surface["k"])) * math.exp(-g) * shadow


def very_rough(slope: float, n: float, k: float, theta_i_deg: float, theta_r_deg: float) -> float:
    """Return f_r [1/sr] for sigma_0 / lambda -> infinity, eqs 71 to 84 with e^-b / g for the sum of eq. 78.

    `slope` is sigma_0 / tau [1]. The viewer is in the plane of incidence, and its angle is positive on the mirror side.
    """
    i, r = math.radians(theta_i_deg), math.radians(theta_r_deg)
    v_x = math.sin(i) - math.sin(r)
    v_z = math.cos(i) + math.cos(r)
    tan2 = (v_x / v_z) ** 2
    bisecting_deg = math.degrees(math.acos(min(0.5 * math.hypot(v_x, v_z), 1.0)))
    slope2 = slope**2 * share_of_variance(abs(theta_i_deg), abs(theta_r_deg), slope)
    lobe = math.exp(-tan2 / (4.0 * slope2)) / (16.0 * math.pi * slope2) * (1.0 + tan2) ** 2
    shadow = smith(abs(theta_i_deg), slope) * smith(abs(theta_r_deg), slope)
    return float(fresnel(bisecting_deg, n, k)) * lobe * shadow / (math.cos(i) * math.cos(r))


def half_width_deg(slope: float) -> float:
    """Return theta_r [degree] where the lobe of light along the normal has half its height, for large g.

    |F|^2 is constant and nothing is shadowed. Then f_r is proportional to
    exp(-tan^2(d) / (4 slope^2)) / (cos^4(d) cos(2 d)), where d is half of theta_r.
    """
    d = np.deg2rad(np.linspace(0.0, 40.0, 40001))
    lobe = np.exp(-(np.tan(d) ** 2) / (4.0 * slope**2)) / (np.cos(d) ** 4 * np.cos(2.0 * d))
    return float(np.rad2deg(2.0 * d[np.argmax(lobe < 0.5)]))


def directional_diffuse(surface: dict[str, Any], theta_i_deg: float, theta_r_deg: float) -> float:
    """Return f_r [1/sr] of the directional diffuse part by the reference; angles are those of `very_rough`."""
    return _directional_diffuse(tuple(sorted(surface.items())), theta_i_deg, theta_r_deg)


@cache
def _directional_diffuse(surface: tuple[tuple[str, float], ...], theta_i_deg: float, theta_r_deg: float) -> float:
    """Return f_r [1/sr] of the directional diffuse part; kept because the reference is slow."""
    arguments = {name: value for name, value in surface if name != "a"}
    angles = np.deg2rad(theta_i_deg), np.deg2rad(abs(theta_r_deg)), np.pi if theta_r_deg >= 0.0 else 0.0
    return float(reference.directional_diffuse(*angles, **arguments))
