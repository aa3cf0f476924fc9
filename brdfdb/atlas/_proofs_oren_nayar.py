"""Laws for Oren and Nayar 1994: rays in V-grooves, energy, reciprocity, and radiances that follow the light."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from brdfdb.atlas._proofs import Array, Form, Proof, albedo, largest
from brdfdb.geometry import unit_vector
from brdfdb.integrals.quadrature import gauss_rule

_RAYS = 20_000  # rays across a facet: the edge of a shadow is known to half of a 20000th of the facet
_POINTS = 500  # points on each facet, between which light bounces
_FEW = 100  # points on each facet where grooves of many slopes and azimuths are averaged
_TRACED = 2e-3  # tolerance over 1 / pi. Worst measured: 4e-5 for direct light, 8e-4 for the bounce
_AVERAGED = 0.02  # relative tolerance for few slopes, azimuths and points. Worst measured: 0.006
_GROOVES = ((60.0, 20.0, 10.0), (70.0, 40.0, 160.0), (20.0, 65.0, 100.0), (80.0, 75.0, 30.0), (50.0, 30.0, 180.0))
_SLOPE = np.deg2rad(45.0)


def _facet(x: Array, towards: Array, theta_a: float, phi_a: float) -> Array:
    """Return whether rays in a direction leave a facet of width 1 from distances x to the bottom of its groove."""
    across = np.array([np.cos(phi_a), np.sin(phi_a), 0.0])
    d_u, d_z = towards @ across, towards[2]
    c, s = np.cos(theta_a), np.sin(theta_a)
    # The ray x (-c, s) + t (d_u, d_z) meets the opposite facet at y (c, s)
    det = d_z * c - d_u * s
    with np.errstate(all="ignore"):
        t, y = -2.0 * x * c * s / det, -x * (d_u * s + d_z * c) / det
    blocked = (t > 0.0) & (y >= 0.0) & (y <= 1.0)
    return np.asarray((d_u * s + d_z * c > 0.0) & ~blocked)


@functools.cache
def traced(theta_i: float, theta_r: float, phi_r: float, theta_a: float, phi_a: float, points: int = 0) -> float:
    """Return f_r [1/sr] of grooves of white facets for light that is reflected once, or twice.

    Rays from points across both facets show which points are lit and which are seen. With `points` on each facet the
    light is reflected twice: it bounces between the facets by their form factors.
    """
    s, v = unit_vector(theta_i, 0.0), unit_vector(theta_r, phi_r)
    count = points or _RAYS
    x, total = (np.arange(count) + 0.5) / count, 0.0
    for turn in (phi_a, phi_a + np.pi):
        a, b = unit_vector(theta_a, turn), unit_vector(theta_a, turn + np.pi)
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
    along, up = (x[:, np.newaxis] + edges) * c, (edges - x[:, np.newaxis]) * s
    sines = (up * s - along * c) / np.hypot(along, up)
    return np.asarray(0.5 * np.abs(np.diff(sines, axis=1)))


def _off_rays(form: Form, points: int = 0) -> float:
    """Return the difference from traced rays, over 1 / pi [1]."""

    def difference(theta_i: float, theta_r: float, phi_r: float) -> float:
        f_r = form(theta_i=theta_i, phi_i=0.0, theta_r=theta_r, phi_r=phi_r, rho=1.0, theta_a=_SLOPE, phi_a=0.3)
        return float(np.pi * (f_r - traced(theta_i, theta_r, phi_r, _SLOPE, 0.3, points)))

    return largest(difference(*np.deg2rad(groove)) for groove in _GROOVES)


def _bounce(form: Form) -> float:
    """Return the difference of the bounce from traced rays, over 1 / pi [1]."""
    return _off_rays(form, _POINTS)


def _averaged_bounce(form: Form) -> float:
    """Return the relative error [1] of the bounce, averaged over Gaussian slopes of 30 degrees and all azimuths."""
    sigma, theta_i, theta_r = np.deg2rad(30.0), np.deg2rad(75.0), np.deg2rad(10.0)
    nodes, w = gauss_rule(10)
    slopes = (nodes + 1.0) * np.pi / 4.0
    share = w * np.exp(-(slopes**2) / (2.0 * sigma**2)) * np.sin(slopes)
    azimuths = (np.arange(12) + 0.5) * np.pi / 12  # The other half belongs to the other facet
    rays = [np.mean([_few_rays(theta_i, theta_r, slope, azimuth) for azimuth in azimuths]) for slope in slopes]
    expected = np.sum(share * rays) / np.sum(share)
    f_r = form(theta_i=theta_i, phi_i=0.0, theta_r=theta_r, phi_r=0.0, rho=1.0, sigma=sigma)
    return largest([f_r / expected - 1.0])


def _few_rays(theta_i: float, theta_r: float, theta_a: float, phi_a: float) -> float:
    """Return f_r [1/sr] of the bounce by few points."""
    return traced(theta_i, theta_r, 0.0, theta_a, phi_a, _FEW)


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
        wi, wr = [across, 0.0, np.sin(height)], [-across, 0.0, np.sin(height)]
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


PROOFS = {
    "gaf-of-the-larger": Proof("rays in V-grooves, for light that is reflected once", _off_rays, _TRACED),
    "shadowed-facet": Proof("rays in V-grooves, for light that is reflected once", _off_rays, _TRACED),
    "visible-and-masked-widths": Proof("rays in V-grooves, for light that bounces once", _bounce, _TRACED),
    "normalised-over-the-hemisphere": Proof("white facets that hardly lean reflect all light", _flat_and_white, 1e-3),
    "fit-below-zero": Proof("no radiance is below zero", _below_zero, 1e-12),
    "tangent-at-grazing": Proof("no jump between the horizon and next to it", _jump_on_the_horizon, 1e-4),
    "surface-radiance-as-brdf": Proof("reciprocity: light and viewer may be exchanged", _exchanged, 1e-12),
    "surface-without-e-0": Proof("ten times the light gives ten times the radiance", _in_more_light, 1e-12),
    "interreflection-factor": Proof("rays in V-grooves of many slopes and azimuths", _averaged_bounce, _AVERAGED),
}
