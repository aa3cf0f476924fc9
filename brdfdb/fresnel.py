"""Fresnel reflection of unpolarised light at a plane interface."""

from __future__ import annotations

import math

import numpy as np

from brdfdb._numba import elementwise, kernel


@kernel
def _unpolarised(cos_theta: float, n: float, k: float) -> float:
    """|F|^2 = (|F_s|^2 + |F_p|^2) / 2 at a vacuum interface of complex index n + ik.

    With w = (n + ik)^2 - 1 and q = sqrt(cos^2 + w),
    F_s = -w / (cos + q)^2 and F_p = w (cos^2 (1 + w) - sin^2) / ((1 + w) cos + q)^2:
    the same as the textbook quotients, but the difference that cancels as n -> 1 is taken once, in w.
    """
    cos2 = cos_theta * cos_theta
    sin2 = (1.0 - cos_theta) * (1.0 + cos_theta)
    e_re = (n - k) * (n + k)  # 1 + w, which keeps its digits as n -> 0
    # n - 1 to 15 decimals: an index is typed as a decimal, and the float64 nearest to 1.000001 is off by 8e-11 of n - 1
    n_less_1: float = np.floor((n - 1.0) * 1e15 + 0.5) * 1e-15
    w_re = n_less_1 * (n_less_1 + 2.0) - k * k
    w_im = 2.0 * n * k
    # q = a + ib, the root with a, b >= 0; each of the two is formed where it does not cancel
    q2_re = cos2 + w_re if cos2 < 0.5 else e_re - sin2
    modulus = math.sqrt(q2_re * q2_re + w_im * w_im)
    if q2_re >= 0.0:
        a = math.sqrt(0.5 * (modulus + q2_re))
        b = w_im / (2.0 * a) if a > 0.0 else 0.0
    else:
        b = math.sqrt(0.5 * (modulus - q2_re))
        a = w_im / (2.0 * b)
    w_abs2 = w_re * w_re + w_im * w_im
    if w_abs2 == 0.0:  # n = 1, k = 0: no interface, and 0 / 0 at grazing
        return 0.0
    # F_s
    d_s = (cos_theta + a) * (cos_theta + a) + b * b
    F_s2 = w_abs2 / (d_s * d_s)
    # F_p
    num_re = cos2 * e_re - sin2
    num_im = cos2 * w_im
    den_re = e_re * cos_theta + a
    den_im = w_im * cos_theta + b
    d_p = den_re * den_re + den_im * den_im
    F_p2 = w_abs2 * (num_re * num_re + num_im * num_im) / (d_p * d_p)
    return min(0.5 * (F_s2 + F_p2), 1.0)  # rounding passes 1 by 4e-16 in total reflection


unpolarised = elementwise(_unpolarised)
