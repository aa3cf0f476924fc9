"""Physical laws that the right forms obey and the printed ones break, computed without reference or kernels.

Oren and Nayar 1994: rays in V-grooves, energy, reciprocity, and radiances that follow the light. He et al. 1991:
images in mirrors, visible slopes, diffraction, energy, scales, and eq. 56 itself. Ward 1992: slopes of a Gaussian
surface, samples that average to the integral, and energy.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.figure import Statement
from brdfdb.gauss import gauss_rule
from brdfdb.geometry import unit_vector
from brdfdb.misprints import Misprint

Array = NDArray[np.float64]
Form = Callable[..., Any]
Law = Callable[[Form], float]

NAMES = {"printed": "the printed form", "customary": "the customary form", "words": "the form of the words"}
BREAKS = 3.0  # A form breaks the law where its deviation exceeds this multiple of `Proof.within`

_RAYS = 20_000  # rays across a facet: the edge of a shadow is known to half of a 20000th of the facet
_POINTS = 500  # points on each facet, between which light bounces
_FEW = 100  # points on each facet where grooves of many slopes and azimuths are averaged
_TRACED = 2e-3  # tolerance over 1 / pi. Worst measured: 4e-5 for direct light, 8e-4 for the bounce
_AVERAGED = 0.02  # relative tolerance for few slopes, azimuths and points. Worst measured: 0.006
_GROOVES = ((60.0, 20.0, 10.0), (70.0, 40.0, 160.0), (20.0, 65.0, 100.0), (80.0, 75.0, 30.0), (50.0, 30.0, 180.0))
_SLOPE = np.deg2rad(45.0)

_MIRROR = {"n": 1e-3, "k": 1e4}  # |F| is 1 within 1e-7. The phase of F is off by 2e-4
_PAIRS = ((50.0, 30.0, 60.0), (70.0, 65.0, 170.0), (45.0, 45.0, 90.0), (20.0, 80.0, 130.0))
_BACK = ((40.0, 40.0, 0.0), (70.0, 70.0, 0.0))
_FIG_8 = {"wavelength_nm": 500.0, "sigma_0_um": 0.28, "tau_um": 1.77}
_SUMS = ((0.5, 1.0), (9.0, 0.0), (18.5, 20.0), (800.0, 100.0))  # g and V, also where g is large
_LIMITS = ((18.5, 0.0), (18.5, 60.0), (100.0, 100.0))  # g and V where the limit of eq. 78 is customary
# Tolerances of the laws
_PHASE = 1e-3  # of images in a mirror, because of the phase of F
_SLOPES = 1e-6  # of the trapezoid rule over 20 001 slopes. Worst measured: 6e-8
_WAVES = 1e-3  # A plate of 2000 wavelengths diffracts 3e-4 of the light beyond the summed angles
_SUMMED = 1e-7  # of Gauss's rule for eq. 56. Worst measured: 1e-12
_ENERGY = 5e-3  # of a plain sum over the hemisphere

_ALPHA = 0.1
_LOSS = 0.05  # tolerance: 4 alpha^2, and the 0.026 that a lobe of alpha 0.1 sends below the horizon at 60 degrees
_SAMPLED = 1e-3  # tolerance of 64 x 64 samples. Worst measured: 4e-4


@dataclass(frozen=True)
class Proof:
    """A law, and the deviation of a form from it.

    `deviation` takes one of the two forms of an entry of `brdfdb.misprints`. It returns the largest deviation from the
    law, or nan where the form gives no finite number. `within` is the error of the law's own arithmetic, such as a
    quadrature or a count of rays.
    """

    says: str
    deviation: Law
    within: float


def proved(entry: Misprint, proof: Proof, where: str) -> Statement:
    """Return the statement that the right form obeys the law and the printed one breaks it."""
    with np.errstate(all="ignore"):
        right, printed = proof.deviation(entry.corrected), proof.deviation(entry.as_printed)
    seen = "no finite number" if np.isnan(printed) else f"off by {printed:.2g}"
    return Statement(
        says=f"physical proof: {proof.says}",
        where=where,
        seen=f"ours is off by {right:.2g}, {NAMES[entry.kind]} {seen}; {proof.within:.2g} is allowed",
        holds=right <= proof.within and not printed <= BREAKS * proof.within,
    )


def largest(deviations: Iterable[Any]) -> float:
    """Return the largest absolute value, or nan if one value is not finite."""
    values = np.concatenate([np.ravel(np.abs(deviation)) for deviation in deviations])
    return float(values.max()) if np.isfinite(values).all() else np.nan


@functools.cache
def hemisphere(polar: int, azimuths: int) -> tuple[Array, Array, Array]:
    """Return theta [rad] of shape (polar, 1), phi [rad], and the weights cos(theta) d omega [sr] of a hemisphere."""
    x, w = gauss_rule(polar)
    theta = (x[:, np.newaxis] + 1.0) * np.pi / 4.0
    phi = (np.arange(azimuths) + 0.5) * 2.0 * np.pi / azimuths
    weights = w[:, np.newaxis] * np.pi / 4.0 * np.sin(theta) * np.cos(theta) * 2.0 * np.pi / azimuths
    return theta, phi, np.broadcast_to(weights, (polar, azimuths))


def albedo(form: Form, theta_i: float, polar: int, azimuths: int, **arguments: Any) -> float:
    """Return the directional albedo [1] of a form by a plain sum over the hemisphere."""
    theta_r, phi_r, weights = hemisphere(polar, azimuths)
    f_r = form(theta_i=theta_i, phi_i=0.0, theta_r=theta_r, phi_r=phi_r, **arguments)
    return float(np.sum(f_r * weights))


def _facet(x: Array, towards: Array, theta_a: float, phi_a: float) -> Array:
    """Return whether rays in a direction leave a facet of width 1 from distances x to the bottom of its groove."""
    across = np.array([np.cos(phi_a), np.sin(phi_a), 0.0])
    d_u = towards @ across
    d_z = towards[2]
    c, s = np.cos(theta_a), np.sin(theta_a)
    # The ray x (-c, s) + t (d_u, d_z) meets the opposite facet at y (c, s)
    det = d_z * c - d_u * s
    with np.errstate(all="ignore"):
        t = -2.0 * x * c * s / det
        y = -x * (d_u * s + d_z * c) / det
    blocked = (t > 0.0) & (y >= 0.0) & (y <= 1.0)
    return np.asarray((d_u * s + d_z * c > 0.0) & ~blocked)


@functools.cache
def traced(theta_i: float, theta_r: float, phi_r: float, theta_a: float, phi_a: float, points: int = 0) -> float:
    """Return f_r [1/sr] of grooves of white facets for light that is reflected once, or twice.

    Rays from points across both facets show which points are lit and which are seen. With `points` on each facet the
    light is reflected twice: it bounces between the facets by their form factors.
    """
    s = unit_vector(theta_i, 0.0)
    v = unit_vector(theta_r, phi_r)
    count = points or _RAYS
    x = (np.arange(count) + 0.5) / count
    total = 0.0
    for turn in (phi_a, phi_a + np.pi):
        a = unit_vector(theta_a, turn)
        b = unit_vector(theta_a, turn + np.pi)
        seen = _facet(x, v, theta_a, turn) * (v @ a)
        if points:
            lit = _facet(x, s, theta_a, turn + np.pi) * (s @ b)
            arrives = _exchange(x, np.arange(count + 1) / count, theta_a) @ lit
        else:
            arrives = _facet(x, s, theta_a, turn) * (s @ a)
        total += float(np.mean(seen * arrives)) / np.pi
    return total / float(2.0 * np.cos(theta_a) * np.cos(theta_i) * np.cos(theta_r))


def _exchange(x: Array, edges: Array, theta_a: float) -> Array:
    """Return the form factors [1] from points x of a facet to strips of the other: half of the sines that they span."""
    c, s = np.cos(theta_a), np.sin(theta_a)
    along = (x[:, np.newaxis] + edges) * c
    up = (edges - x[:, np.newaxis]) * s
    sines = (up * s - along * c) / np.hypot(along, up)
    return np.asarray(0.5 * np.abs(np.diff(sines, axis=1)))


def _off_rays(form: Form, points: int = 0) -> float:
    """Return the difference from traced rays, over 1 / pi [1]."""

    def difference(theta_i: float, theta_r: float, phi_r: float) -> float:
        f_r = form(theta_i=theta_i, phi_i=0.0, theta_r=theta_r, phi_r=phi_r, rho=1.0, theta_a=_SLOPE, phi_a=0.3)
        return float(np.pi * (f_r - traced(theta_i, theta_r, phi_r, _SLOPE, 0.3, points)))

    return largest(difference(*np.deg2rad(groove)) for groove in _GROOVES)


def _averaged_bounce(form: Form) -> float:
    """Return the relative error [1] of the bounce, averaged over Gaussian slopes of 30 degrees and all azimuths."""
    sigma, theta_i, theta_r = np.deg2rad(30.0), np.deg2rad(75.0), np.deg2rad(10.0)
    nodes, w = gauss_rule(10)
    slopes = (nodes + 1.0) * np.pi / 4.0
    share = w * np.exp(-(slopes**2) / (2.0 * sigma**2)) * np.sin(slopes)
    azimuths = (np.arange(12) + 0.5) * np.pi / 12  # The other half belongs to the other facet
    rays = [np.mean([traced(theta_i, theta_r, 0.0, slope, azimuth, _FEW) for azimuth in azimuths]) for slope in slopes]
    expected = np.sum(share * rays) / np.sum(share)
    f_r = form(theta_i=theta_i, phi_i=0.0, theta_r=theta_r, phi_r=0.0, rho=1.0, sigma=sigma)
    return largest([f_r / expected - 1.0])


def _flat_and_white(form: Form) -> float:
    """Return the albedo of white facets that hardly lean, less 1 [1]."""
    return largest([albedo(form, 0.7, 6, 4, rho=1.0, sigma=0.01) - 1.0])


def _below_zero(form: Form) -> float:
    """Return the most negative f_r over rho / pi [1]."""
    theta = np.deg2rad(np.linspace(0.0, 89.0, 30))
    f_r = form(theta_i=theta[:, None], phi_i=0.0, theta_r=theta, phi_r=np.pi, rho=0.1, sigma=np.deg2rad(60.0))
    return largest([np.maximum(0.0, -f_r * np.pi / 0.1)])


def _jump_on_the_horizon(form: Form) -> float:
    """Return the relative change [1] of f_r from next to the horizon to the horizon itself."""

    def f_r(height: float) -> Any:
        across = np.cos(height)
        wi = [across, 0.0, np.sin(height)]
        wr = [-across, 0.0, np.sin(height)]
        return form(wi=[wi], wr=[wr], rho=0.5, sigma=0.5)

    return largest(
        [
            f_r(1e-9) / f_r(1e-6) - 1.0,
            np.asarray(form(wi=[[1, 0, 0]], wr=[[-1, 0, 0]], rho=0.5, sigma=0.5)) / f_r(1e-6) - 1.0,
        ]
    )


def _exchanged(form: Form) -> float:
    """Return the relative change [1] of f_r when light and viewer are exchanged."""
    pairs = np.deg2rad([(60.0, 30.0, 180.0), (80.0, 10.0, 90.0), (20.0, 70.0, 40.0)])
    both = (
        [form(theta_i=a, phi_i=0.0, theta_r=b, phi_r=phi, sigma=0.35) for a, b in ((i, r), (r, i))]
        for i, r, phi in pairs
    )
    return largest(one / other - 1.0 for one, other in both)


def _in_more_light(form: Form) -> float:
    """Return the relative change [1] of f_r with the irradiance."""
    pair = {"theta_i": 1.0, "phi_i": 0.0, "theta_r": 1.2, "phi_r": 3.0}
    return largest([form(**pair, e_0=10.0) / form(**pair, e_0=1.0) - 1.0])


def _directions(pair: tuple[float, float, float]) -> dict[str, float]:
    """Return the angles [rad] of theta_i, theta_r and phi_r - phi_i in degrees."""
    theta_i, theta_r, delta_phi = np.deg2rad(pair)
    return {"theta_i": theta_i, "phi_i": 0.0, "theta_r": theta_r, "phi_r": delta_phi}


def _image(theta_i: float, phi_i: float, theta_r: float, phi_r: float) -> Array:
    """Return the Jones matrix [1] of a perfect mirror: E_r = 2 n (n.E) - E, without a field along its surface.

    The mirror is the facet that bisects light and viewer. s and p refer to the surface whose normal is z. Eqs 61 to 64
    are this field with the opposite sign, which no intensity shows.
    """
    k_i = -unit_vector(theta_i, phi_i)
    k_r = unit_vector(theta_r, phi_r)
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
    deviation = math.sqrt(2.0) * slope
    cos = math.cos(theta)
    sin = math.sin(theta)
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
    center = -h[:2] / h[2]
    step = 1e-5

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


def _residual(form: Form) -> float:
    """Return the residual [sigma_0] of z_0 in eq. 81."""

    def residual(theta: float, slope: float) -> Any:
        K = 2.0 * math.tan(theta) * math.erfc(1.0 / (2.0 * slope * math.tan(theta))) / 4.0
        z = form(theta_i=theta, theta_r=theta, slope=slope)
        return math.sqrt(math.pi / 2.0) * z - K * np.exp(-0.5 * z * z)

    return largest(residual(theta, slope) for theta in np.deg2rad([70.0, 85.0, 89.0]) for slope in (0.16, 1.0))


def _not_all_reflected(form: Form) -> float:
    """Return the largest share [1] of light up to 60 degrees that a lobe with rho_s = 1 does not reflect."""
    lobe = {"rho_d": 0.0, "rho_s": 1.0, "alpha_x": _ALPHA, "alpha_y": _ALPHA}
    return largest(form(theta_i=np.deg2rad(theta), **lobe) - 1.0 for theta in (0.0, 30.0, 60.0))


def _off_gaussian(form: Form) -> float:
    """Return the difference [1] of the logarithm of the lobe from -tan^2(delta) / alpha^2, light along the normal."""
    delta = np.deg2rad([5.0, 10.0, 20.0, 30.0])
    alpha = 0.2
    lobe = {"theta_i": 0.0, "phi_i": 0.0, "phi_r": 0.0, "rho_d": 0.0, "rho_s": 1.0, "alpha_x": alpha, "alpha_y": alpha}
    peak = form(theta_r=0.0, **lobe)
    shoulder = form(theta_r=2.0 * delta, **lobe) * np.sqrt(np.cos(2.0 * delta))
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
    p = slopes[:, np.newaxis]
    q = slopes
    h_z = 1.0 / np.sqrt(1.0 + p**2 + q**2)
    i_h = (p * wi[0] + q * wi[1] + wi[2]) * h_z
    cos_r = 2.0 * i_h * h_z - wi[2]
    seen = (cos_r > 0.0) & (i_h > 0.0)
    # f_r cos(theta_r) d omega_r, and d omega_r = 4 (i.h) d omega_h, d omega_h = h_z^3 dp dq
    f_r = np.exp(-(p**2 + q**2) / _ALPHA**2) / (4.0 * np.pi * _ALPHA**2 * np.sqrt(wi[2] * np.where(seen, cos_r, 1.0)))
    return float(np.sum(np.where(seen, f_r * cos_r * 4.0 * i_h * h_z**3, 0.0)) * (slopes[1] - slopes[0]) ** 2)


PROOFS = {
    "gaf-of-the-larger": Proof("rays in V-grooves, for light that is reflected once", _off_rays, _TRACED),
    "shadowed-facet": Proof("rays in V-grooves, for light that is reflected once", _off_rays, _TRACED),
    "visible-and-masked-widths": Proof(
        "rays in V-grooves, for light that bounces once", lambda form: _off_rays(form, _POINTS), _TRACED
    ),
    "normalised-over-the-hemisphere": Proof("white facets that hardly lean reflect all light", _flat_and_white, 1e-3),
    "fit-below-zero": Proof("no radiance is below zero", _below_zero, 1e-12),
    "tangent-at-grazing": Proof("no jump between the horizon and next to it", _jump_on_the_horizon, 1e-4),
    "surface-radiance-as-brdf": Proof("reciprocity: light and viewer may be exchanged", _exchanged, 1e-12),
    "surface-without-e-0": Proof("ten times the light gives ten times the radiance", _in_more_light, 1e-12),
    "interreflection-factor": Proof("rays in V-grooves of many slopes and azimuths", _averaged_bounce, _AVERAGED),
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
    "ten-terms": Proof(
        "the integral over the surface of eq. 56, which the sum replaces",
        lambda form: _waves_of_eq_56(form, _SUMS),
        _SUMMED,
    ),
    "beckmanns-limit": Proof(
        "the integral over the surface of eq. 56, which the sum replaces",
        lambda form: _waves_of_eq_56(form, _LIMITS),
        _SUMMED,
    ),
    "root-search": Proof("z_0 solves eq. 81", _residual, 1e-12),
    "local-normal-for-z": Proof("the image in a perfect mirror", lambda form: _off_image(form, _PAIRS), _PHASE),
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
