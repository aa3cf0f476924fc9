"""Oren and Nayar 1994 by hand: equations for single directions, which share no code with the models."""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np

# Nodes of `facets`, for four digits
_SLOPES = 200
_AZIMUTHS = 360


class Direct(NamedTuple):
    """A BRDF [1/sr] in two parts: light reflected by one facet, and light reflected by two."""

    direct: float
    bounced: float


@cache
def facets(theta_i_deg: float, theta_r_deg: float, rho: float, sigma_deg: float) -> Direct:
    """Return f_r [1/sr] of V-cavities with Gaussian slopes by a plain sum over facets, eqs 8 to 22 and 26.

    The sum has four digits. The viewer is in the plane of incidence. Its angle is positive on the side of the light.
    """
    sigma = math.radians(sigma_deg)
    reach = min(math.pi / 2.0, 6.0 * sigma)
    theta_a = ((np.arange(_SLOPES) + 0.5) / _SLOPES * reach)[:, np.newaxis]
    phi_a = 2.0 * np.pi * (np.arange(_AZIMUTHS) + 0.5) / _AZIMUTHS
    s, v = (
        np.array([math.sin(math.radians(angle)), 0.0, math.cos(math.radians(angle))])
        for angle in (theta_i_deg, theta_r_deg)
    )
    a = np.stack(np.broadcast_arrays(np.sin(theta_a) * np.cos(phi_a), np.sin(theta_a) * np.sin(phi_a), np.cos(theta_a)))
    b = a * np.array([-1.0, -1.0, 1.0])[:, np.newaxis, np.newaxis]
    s_a, v_a, s_b, v_b = (np.einsum("k,kij->ij", w, facet) for facet in (a, b) for w in (s, v))
    s_n, v_n, a_n = s[2], v[2], a[2]
    # Eqs (10) and (11)
    seen = (s_a > 0.0) & (v_a > 0.0)
    with np.errstate(all="ignore"):
        GAF = np.minimum(1.0, np.minimum(2.0 * s_n * a_n / s_a, 2.0 * v_n * a_n / v_a))
        direct = np.where(seen, s_a * v_a / (a_n * v_n * s_n) * GAF, 0.0)
        # Eqs (15) to (20)
        m_v, m_s = np.clip(-v_b / v_a, 0.0, 1.0), np.clip(-s_a / s_b, 0.0, 1.0)
        terms = (1.0, m_v, 1.0), (1.0, m_s, 1.0), (m_s, m_v, -1.0), (1.0, 1.0, -1.0)
        cos_2 = np.cos(2.0 * theta_a)
        d = sum(sign * np.sqrt(np.maximum(x * x + 2.0 * x * y * cos_2 + y * y, 0.0)) for x, y, sign in terms)
        bounced = np.where((s_b > 0.0) & (v_a > 0.0), s_b * v_a / (a_n * v_n * s_n) * 0.5 * d, 0.0)
    # Eq. (26), normalised over the slope. The mean over azimuths includes both facets of a cavity, eq. (22)
    weight = np.exp(-(theta_a[:, 0] ** 2) / (2.0 * sigma**2)) * np.sin(theta_a[:, 0])
    weight /= weight.sum()
    return Direct(
        float(rho / np.pi * weight @ direct.mean(axis=1)), float(rho**2 / np.pi * weight @ bounced.mean(axis=1))
    )


def fit(theta_i_deg: float, theta_r_deg: float, rho: float, sigma_deg: float) -> Direct:
    """Return f_r [1/sr] of the functional approximation, eqs 27 and 28; directions are those of `facets`."""
    s2 = math.radians(sigma_deg) ** 2
    cos = 1.0 if theta_i_deg * theta_r_deg >= 0.0 else -1.0
    beta, alpha = sorted((math.radians(abs(theta_i_deg)), math.radians(abs(theta_r_deg))))
    C_1 = 1.0 - 0.5 * s2 / (s2 + 0.33)
    C_2 = 0.45 * s2 / (s2 + 0.09) * (math.sin(alpha) - (0.0 if cos > 0.0 else (2.0 * beta / math.pi) ** 3))
    direct = rho / math.pi * (C_1 + cos * C_2 * math.tan(beta))
    return Direct(direct, 0.17 * rho**2 / math.pi * s2 / (s2 + 0.13) * (1.0 - cos * (2.0 * beta / math.pi) ** 2))


def surface(theta_i_deg: float, theta_r_deg: float, sigma_deg: float) -> float:
    """Return f_r [1/sr] of mirror-like facets, eq. 31 with F = 1 and E_0 = 1; directions are those of `facets`."""
    i, r = math.radians(theta_i_deg), math.radians(theta_r_deg)
    theta_a = abs(0.5 * (i + r))
    cos_half = math.cos(0.5 * (i - r))
    GAF = min(1.0, 2.0 * math.cos(theta_a) * min(math.cos(i), math.cos(r)) / cos_half)
    gaussian = math.exp(-(theta_a**2) / (2.0 * math.radians(sigma_deg) ** 2))
    return GAF * gaussian / (math.cos(i) * math.cos(r) * math.cos(theta_a))


def cylinder(x: float, light_deg: float, rho: float, sigma_deg: float) -> float:
    """Return the radiance [1] of an upright cylinder of radius 1 at x, by eqs 27 and 28.

    The unit is the radiance of a white Lambertian surface that faces the light. The light is light_deg to the right of
    the camera.
    """
    viewer_deg = -math.degrees(math.asin(x))
    theta_i_deg = viewer_deg + light_deg
    if abs(theta_i_deg) >= 90.0:
        return 0.0
    return math.pi * sum(fit(theta_i_deg, viewer_deg, rho, sigma_deg)) * math.cos(math.radians(theta_i_deg))
