"""Laws for He et al. 1991: images in mirrors, visible slopes, diffraction, energy, scales, and eq. 56 itself."""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np

from brdfdb.atlas._proofs import Array, Form, Proof, albedo, largest
from brdfdb.geometry import unit_vector
from brdfdb.integrals.quadrature import gauss_rule

_MIRROR = {"n": 1e-3, "k": 1e4}  # |F| is 1 within 1e-7. The phase of F is off by 2e-4
_PAIRS = ((50.0, 30.0, 60.0), (70.0, 65.0, 170.0), (45.0, 45.0, 90.0), (20.0, 80.0, 130.0))
_BACK = ((40.0, 40.0, 0.0), (70.0, 70.0, 0.0))
_FIG_8 = {"wavelength_nm": 500.0, "sigma_0_um": 0.28, "tau_um": 1.77}
# Tolerances of the laws
_PHASE = 1e-3  # of images in a mirror, because of the phase of F
_SLOPES = 1e-6  # of the trapezoid rule over 20 001 slopes. Worst measured: 6e-8
_WAVES = 1e-3  # A plate of 2000 wavelengths diffracts 3e-4 of the light beyond the summed angles
_SUMMED = 1e-7  # of Gauss's rule for eq. 56. Worst measured: 1e-12
_ENERGY = 5e-3  # of a plain sum over the hemisphere


def _directions(pair: tuple[float, float, float]) -> dict[str, float]:
    """Return the angles [rad] of theta_i, theta_r and phi_r - phi_i in degrees."""
    theta_i, theta_r, delta_phi = np.deg2rad(pair)
    return {"theta_i": theta_i, "phi_i": 0.0, "theta_r": theta_r, "phi_r": delta_phi}


def _image(theta_i: float, phi_i: float, theta_r: float, phi_r: float) -> Array:
    """Return the Jones matrix [1] of a perfect mirror: E_r = 2 n (n.E) - E, without a field along its surface.

    The mirror is the facet that bisects light and viewer. s and p refer to the surface whose normal is z. Eqs 61 to 64
    are this field with the opposite sign, which no intensity shows.
    """
    k_i, k_r = -unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    n = (k_r - k_i) / np.linalg.norm(k_r - k_i)
    bases = []
    for k in (k_i, k_r):
        s = np.cross(k, (0.0, 0.0, 1.0)) / np.hypot(k[0], k[1])
        bases.append(np.stack([s, np.cross(s, k)]))
    turned = 2.0 * np.outer(n, n) - np.eye(3)
    return np.asarray(-bases[1] @ turned @ bases[0].T)


def _off_image(form: Form, pairs: tuple[tuple[float, float, float], ...]) -> float:
    """Return the largest difference [1] of a Jones matrix from the image in a perfect mirror."""
    return largest(form(**_directions(pair), **_MIRROR) - _image(**_directions(pair)) for pair in pairs)


def _lost_by_a_mirror(form: Form) -> float:
    """Return the largest deviation [1] from 1 of the squared singular values, the extreme shares of reflected light."""
    return largest(np.linalg.svd(form(**_directions(pair), **_MIRROR), compute_uv=False) ** 2 - 1.0 for pair in _PAIRS)


@functools.cache
def _seen(theta: float, slope: float) -> tuple[float, float]:
    """Return the share [1] of facets that face a direction, and their projected area [1] over that of the surface.

    The slopes along the direction are Gaussian, with the deviation sqrt(2) sigma_0 / tau of the correlation of eq. 48.
    """
    deviation, cos, sin = math.sqrt(2.0) * slope, math.cos(theta), math.sin(theta)
    top = 10.0 * deviation if cos >= 10.0 * deviation * sin else cos / sin
    p = np.linspace(-10.0 * deviation, top, 20_001)
    density = np.exp(-0.5 * (p / deviation) ** 2) / (math.sqrt(2.0 * math.pi) * deviation)
    return float(np.trapezoid(density, p)), float(np.trapezoid((cos - p * sin) * density, p))


def _unseen_area(form: Form) -> float:
    """Return the relative error [1] of S_1 / cos(theta), the share of facing facets over their area."""
    cosines, slope = (0.0, 0.05, 0.3, 0.8), 0.2
    expected = [_seen(math.acos(cos), slope) for cos in cosines]
    return largest(
        form(cos_theta=cos, slope=slope) * area / share - 1.0
        for cos, (share, area) in zip(cosines, expected, strict=True)
    )


def _smiths_integral(form: Form) -> float:
    """Return the relative error [1] of S_1 against Smith's integral over slopes."""

    def error(theta: float, slope: float) -> float:
        share, area = _seen(theta, slope)
        return float(form(theta=theta, slope=slope) * area / (share * math.cos(theta)) - 1.0)

    return largest(error(theta, slope) for slope in (0.16, 0.5) for theta in np.deg2rad([50.0, 70.0, 85.0]))


def _mirror_facets(form: Form) -> float:
    """Return the relative error [1] of G; mirror facets give 4 v_z^2 (i.h) / h_z d(slopes) / d(omega_r)."""
    return largest(
        form(**_directions(pair)) / _spread(**_directions(pair)) - 1.0 for pair in (*_PAIRS, *_BACK, (0.0, 0.0, 0.0))
    )


def _spread(theta_i: float, phi_i: float, theta_r: float, phi_r: float) -> float:
    """Return G [1] by the change of the mirrored direction with the slopes of a facet."""
    w_i, w_r = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    h = w_i + w_r
    center, step = -h[:2] / h[2], 1e-5

    def reflected(slopes: Array) -> Array:
        normal = np.array([-slopes[0], -slopes[1], 1.0]) / math.sqrt(1.0 + slopes @ slopes)
        return np.asarray(2.0 * (normal @ w_i) * normal - w_i)

    columns = [(reflected(center + step * e) - reflected(center - step * e))[:2] / (2.0 * step) for e in np.eye(2)]
    density = w_r[2] / abs(float(np.linalg.det(np.stack(columns))))
    return float(4.0 * h[2] ** 2 * (w_i @ h) / h[2] * density)


def _diffracted_by_a_plate(form: Form) -> float:
    """Return the relative error [1] of the reflectance of a mirror; a plate of 2000 x 2000 wavelengths diffracts it."""
    half, step = 1000.0, 2e-5  # half of the edge [wavelengths], and step of a direction cosine
    u = np.arange(-0.3, 0.3, step)
    # A (sinc v_x L_x)^2 (sinc v_y L_y)^2, A = 4 L_x L_y; d omega cos(theta_r) = du_x du_y
    along = np.sum(2.0 * half * np.sinc(2.0 * half * u) ** 2) * step
    return largest([form(theta_i=theta, wavelength_nm=500.0, **_MIRROR) / along**2 - 1.0 for theta in (0.0, 1.0)])


def _more_than_arrives(form: Form) -> float:
    """Return the largest excess [1] of the directional albedo over 1."""
    excesses = (albedo(form, np.deg2rad(theta), 120, 180, **_FIG_8) - 1.0 for theta in (0.0, 60.0, 89.9))
    return largest(np.maximum(0.0, excess) for excess in excesses)


def _all_lengths_doubled(form: Form) -> float:
    """Return the relative change [1] of f_r when all lengths, the wavelength too, are doubled."""
    doubled = {name: 2.0 * value for name, value in _FIG_8.items()}
    return largest(form(**_directions(p), **doubled) / form(**_directions(p), **_FIG_8) - 1.0 for p in _PAIRS)


def _not_transmitted(form: Form) -> float:
    """Return the error [1] of a reflectance: 1 less the energy that enters, by fields continuous across the surface."""

    def reflected(cos: float, n: float, k: float) -> float:
        index = complex(n, k)
        q = np.sqrt(index**2 - 1.0 + cos**2)  # normal component of the wave vector inside
        enters = 0.0
        for inside in (q, q / index**2):  # s: E along the surface, p: H
            # 1 + r = t and cos (1 - r) = inside t
            t = 2.0 * cos / (cos + inside)
            enters += 0.5 * inside.real * abs(t) ** 2 / cos
        return float(1.0 - enters)

    cases = [(cos, n, k) for cos in (0.1, 0.5, 1.0) for n, k in ((0.8126, 6.048), (1.5, 0.0), (0.2, 3.0))]
    return largest(form(cos_theta=cos, n=n, k=k) - reflected(cos, n, k) for cos, n, k in cases)


def _far_from_the_mirror(form: Form) -> float:
    """Return f_r of a nearly flat metal 30 degrees beside the mirror direction, over its value there [1]."""
    flat = {"wavelength_nm": 500.0, "sigma_0_um": 0.28, "tau_um": 14.0, "n": 0.8126, "k": 6.048}
    return largest([form(**_directions((45.0, 15.0, 180.0)), **flat)])


def _uniform(form: Form) -> float:
    """Return the error [1] of the albedo of the uniform part."""
    return largest(np.pi * form(a=a) - a for a in (0.1, 0.5, 0.9))


def _waves_of_eq_56(form: Form, cases: tuple[tuple[float, float], ...]) -> float:
    """Return the relative error [1] of the sum of eq. 78 against the integral of eq. 56."""
    return largest(form(g=g, V=V) / _scattered(g, V) - 1.0 for g, V in cases)


@functools.cache
def _scattered(g: float, V: float) -> float:
    """Return the left side of eq. 56 without its coherent part, over pi tau^2 [1]: an integral over t = r^2 / tau^2."""
    x, w = gauss_rule(24)
    edges = np.concatenate([[0.0], np.geomspace(1e-3 / (1.0 + g), 60.0, 60)])
    half = np.diff(edges)[:, np.newaxis] / 2.0
    t = edges[:-1, np.newaxis] + half * (x + 1.0)
    turn = (np.arange(64) + 0.5) * np.pi / 64
    bessel = np.cos(2.0 * np.sqrt(V * t)[..., np.newaxis] * np.sin(turn)).mean(axis=-1)  # J_0
    waves = np.exp(-g) * np.expm1(g * np.exp(-t)) if g < 500.0 else np.exp(g * np.expm1(-t))
    return float(np.sum(half * w * bessel * waves))


def _sum_off_waves(form: Form) -> float:
    """Return the relative error [1] of the sum of eq. 78, also where g is large."""
    return _waves_of_eq_56(form, ((0.5, 1.0), (9.0, 0.0), (18.5, 20.0), (800.0, 100.0)))


def _limit_off_waves(form: Form) -> float:
    """Return the relative error [1] of the sum of eq. 78 where its limit is used."""
    return _waves_of_eq_56(form, ((18.5, 0.0), (18.5, 60.0), (100.0, 100.0)))


def _residual(form: Form) -> float:
    """Return the residual [sigma_0] of z_0 in eq. 81."""

    def residual(theta: float, slope: float) -> Any:
        K = 2.0 * math.tan(theta) * math.erfc(1.0 / (2.0 * slope * math.tan(theta))) / 4.0
        z = form(theta_i=theta, theta_r=theta, slope=slope)
        return math.sqrt(math.pi / 2.0) * z - K * np.exp(-0.5 * z * z)

    return largest(residual(theta, slope) for theta in np.deg2rad([70.0, 85.0, 89.0]) for slope in (0.16, 1.0))


PROOFS = {
    "uniform-diffuse-without-pi": Proof("the uniform diffuse part reflects the share a of the light", _uniform, 1e-12),
    "hemispherical-for-bidirectional": Proof("a nearly flat metal mirrors", _far_from_the_mirror, 1e-3),
    "shadowing-divided-by-cosines": Proof(
        "the visible parts of facing facets have the area of the surface", _unseen_area, _SLOPES
    ),
    "lambda-without-gaussian": Proof(
        "Smith's integral over slopes: the visible parts have the area of the surface", _smiths_integral, _SLOPES
    ),
    "one-matrix-for-two": Proof("the image in a perfect mirror", lambda form: _off_image(form, _PAIRS), _PHASE),
    "two-pi-in-the-cone": Proof("diffraction by a large plate, summed over directions", _diffracted_by_a_plate, _WAVES),
    "amplitudes-over-cross-product": Proof(
        "the image in a perfect mirror, backscatter included", lambda form: _off_image(form, (*_PAIRS, *_BACK)), _PHASE
    ),
    "sign-of-m-ps": Proof("a perfect mirror's Jones matrix is unitary", _lost_by_a_mirror, 1e-6),
    "intensities-without-shadowing": Proof("|F| = 1: no more is reflected than arrives", _more_than_arrives, _ENERGY),
    "squares-without-moduli": Proof("light that is not reflected enters: Poynting's theorem", _not_transmitted, 1e-12),
    "four-dot-products": Proof("solid angles into which mirror facets spread the light", _mirror_facets, 1e-6),
    "v-without-wave-number": Proof(
        "light goes the same ways when all lengths are doubled, the wavelength too", _all_lengths_doubled, 1e-9
    ),
    "ten-terms": Proof("the integral over the surface of eq. 56, which the sum replaces", _sum_off_waves, _SUMMED),
    "beckmanns-limit": Proof(
        "the integral over the surface of eq. 56, which the sum replaces", _limit_off_waves, _SUMMED
    ),
    "root-search": Proof("z_0 solves eq. 81", _residual, 1e-12),
    "local-normal-for-z": Proof("the image in a perfect mirror", lambda form: _off_image(form, _PAIRS), _PHASE),
}
