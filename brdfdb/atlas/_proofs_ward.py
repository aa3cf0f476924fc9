"""Laws for Ward 1992: slopes of a Gaussian surface, samples that average to the integral, and energy."""

from __future__ import annotations

import math

import numpy as np

from brdfdb.atlas._proofs import Array, Form, Proof, largest
from brdfdb.geometry import unit_vector

_ALPHA = 0.1
_LOSS = 0.05  # tolerance: 4 alpha^2, and the 0.026 that a lobe of alpha 0.1 sends below the horizon at 60 degrees
_SAMPLED = 1e-3  # tolerance of 64 x 64 samples. Worst measured: 4e-4


def _not_all_reflected(form: Form) -> float:
    """Return the largest share [1] of light up to 60 degrees that a lobe with rho_s = 1 does not reflect."""
    lobe = {"rho_d": 0.0, "rho_s": 1.0, "alpha_x": _ALPHA, "alpha_y": _ALPHA}
    return largest(form(theta_i=np.deg2rad(theta), **lobe) - 1.0 for theta in (0.0, 30.0, 60.0))


def _off_gaussian(form: Form) -> float:
    """Return the difference [1] of the logarithm of the lobe from -tan^2(delta) / alpha^2, light along the normal."""
    delta, alpha = np.deg2rad([5.0, 10.0, 20.0, 30.0]), 0.2
    lobe = {"theta_i": 0.0, "phi_i": 0.0, "phi_r": 0.0, "rho_d": 0.0, "rho_s": 1.0, "alpha_x": alpha, "alpha_y": alpha}
    peak, shoulder = form(theta_r=0.0, **lobe), form(theta_r=2.0 * delta, **lobe) * np.sqrt(np.cos(2.0 * delta))
    return largest([np.log(shoulder / peak) + np.tan(delta) ** 2 / alpha**2])


def _deviation(form: Form) -> float:
    """Return the relative error [1] of the rms slope along x: slopes have exp(-(p / alpha_x)^2 - (q / alpha_y)^2)."""
    alpha = 0.2
    p = np.linspace(-10.0 * alpha, 10.0 * alpha, 2001)
    density = np.exp(-((p / alpha) ** 2))
    expected = math.sqrt(np.sum(p**2 * density) / np.sum(density))
    return largest([form(alpha_x=alpha, alpha_y=0.5 * alpha) / expected - 1.0])


def _mean_square_slope(form: Form) -> float:
    """Return the relative error [1] of the mean square slope that a round lobe draws, which is alpha^2.

    The mean over u1 is computed by the rule of Gauss and Laguerre in -log(u1).
    """
    x, weights = np.polynomial.laguerre.laggauss(6)
    alpha = 0.2
    delta = form(u1=np.exp(-x), u2=0.1, alpha_x=alpha, alpha_y=alpha)
    return largest([weights @ np.tan(delta) ** 2 / alpha**2 - 1.0])


def _mean_direction(form: Form) -> float:
    """Return the mean [1] of the drawn directions, which is 0 for a lobe that is symmetric about its centre."""
    u2 = (np.arange(400) + 0.5) / 400
    phi = form(u1=0.3, u2=u2, alpha_x=0.1, alpha_y=0.2)
    return largest([np.cos(phi).mean(), np.sin(phi).mean()])


def _mean_weight(form: Form) -> float:
    """Return the largest difference [1], over four lights, of the mean weight from the integral of eq. 5a."""
    u = (np.arange(64.0) + 0.5) / 64.0

    def difference(theta: float) -> float:
        wi = unit_vector(theta, 0.0)
        weights = form(u1=u[:, np.newaxis], u2=u, wi=wi, rho_s=1.0, alpha_x=_ALPHA, alpha_y=_ALPHA)
        return float(np.mean(weights)) - _lobe_albedo(wi)

    return largest(difference(theta) for theta in np.deg2rad([0.0, 30.0, 60.0, 75.0]))


def _lobe_albedo(wi: Array) -> float:
    """Return the albedo [1] of eq. 5a by a sum over slopes of the half vector."""
    slopes = np.linspace(-6.0 * _ALPHA, 6.0 * _ALPHA, 301)
    p, q = slopes[:, np.newaxis], slopes
    h_z = 1.0 / np.sqrt(1.0 + p**2 + q**2)
    i_h = (p * wi[0] + q * wi[1] + wi[2]) * h_z
    cos_r = 2.0 * i_h * h_z - wi[2]
    seen = (cos_r > 0.0) & (i_h > 0.0)
    # f_r cos(theta_r) d omega_r, and d omega_r = 4 (i.h) d omega_h, d omega_h = h_z^3 dp dq
    f_r = np.exp(-(p**2 + q**2) / _ALPHA**2) / (4.0 * np.pi * _ALPHA**2 * np.sqrt(wi[2] * np.where(seen, cos_r, 1.0)))
    return float(np.sum(np.where(seen, f_r * cos_r * 4.0 * i_h * h_z**3, 0.0)) * (slopes[1] - slopes[0]) ** 2)


PROOFS = {
    "lobe-that-loses-light": Proof(
        "a lobe of reflectance 1 reflects all light except its tails", _not_all_reflected, _LOSS
    ),
    "deviation-of-slopes": Proof("the second moment of Gaussian slopes", _deviation, 1e-6),
    "half-vector-form": Proof(
        "Gaussian slopes: the logarithm of the lobe is the square of the slope", _off_gaussian, 1e-9
    ),
    "delta-without-arctan": Proof("drawn slopes have the mean square alpha^2", _mean_square_slope, 1e-9),
    "arctangent-of-7a": Proof("a symmetric lobe is drawn on both sides of its centre", _mean_direction, 1e-9),
    "uniform-weights": Proof("samples average to the integral of eq. 5a", _mean_weight, _SAMPLED),
}
