"""The approximations of Oren and Nayar: curves against traced rays and the reference."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.figure import Curve
from brdfdb.gallery._oren_nayar_lines import evaluated_parts
from brdfdb.gallery.oren_nayar_1994_bounces import bounces, view_factors
from brdfdb.reference import mp, oren_nayar_1994
from tests.gallery.figures import figure, panel_of, value_at

Array = NDArray[np.float64]


def curves(name: str, panel: int = 0) -> list[Curve]:
    return panel_of(figure(f"oren-nayar-1994-{name}"), panel).curves


# The paper's own evaluation


@pytest.mark.parametrize(("theta_i", "theta_r", "delta_phi"), [(0.5, 1.4, np.pi), (1.3, 1.2, 2.0), (1.05, 1.5, 0.9)])
def test_their_evaluation_is_eq_25_over_eqs_24_and_49(theta_i: float, theta_r: float, delta_phi: float) -> None:
    rho, sigma = 0.8, 0.6
    both = np.arctan(np.hypot(1.0 / np.tan(theta_i), 1.0 / np.tan(theta_r)))
    kinks = sorted([0.0, np.pi / 2 - theta_i, np.pi / 2 - theta_r, both, np.pi / 2])
    with mp.workdps(15):

        def weight(theta_a: mp.mpf) -> mp.mpf:
            return mp.exp(-(theta_a**2) / (2 * sigma**2)) * mp.sin(theta_a)

        def light(theta_a: mp.mpf) -> mp.mpc:
            parts = oren_nayar_1994.single_slope(theta_i, theta_r, delta_phi, rho, theta_a)
            return weight(theta_a) * mp.mpc(*parts)

        expected = mp.quad(light, kinks) / mp.quad(weight, kinks)
    parts = evaluated_parts(theta_i, 0.0, theta_r, delta_phi, rho=rho, sigma=sigma)
    assert float(parts.direct) == pytest.approx(float(expected.real), rel=1e-9)  # Worst measured: 6e-11
    assert float(parts.interreflected) == pytest.approx(float(expected.imag), rel=1e-8)  # Worst measured: 2e-10


# Strips against rays


def traced(theta_i: float, phi_a: Array, theta_a: Array, orders: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Count the rays that leave V-grooves after each bounce. Every ray has its own groove.

    The bottom of a groove is at 0, and its upper edges are at x = -1 and x = 1. It is endless along y. Facets are
    Lambertian and absorb nothing.
    """
    x = rng.uniform(-1.0, 1.0, theta_a.size)
    z = np.tan(theta_a)
    # Light travels down. Its azimuth counts from the normal of the facet at x < 0, which points to x > 0
    d_x, d_z = -np.sin(theta_i) * np.cos(phi_a), np.full(theta_a.size, -np.cos(theta_i))
    left = np.zeros(orders, dtype=np.int64)
    for order in range(orders + 1):
        sine, cosine = np.sin(theta_a), np.cos(theta_a)
        # Distances along the ray to the facet at x < 0, whose normal is (sin, cos), and to the other facet
        speeds = np.stack([sine * d_x + cosine * d_z, -sine * d_x + cosine * d_z])
        gaps = np.stack([sine * x + cosine * z, -sine * x + cosine * z])
        lengths = np.where(speeds < 0.0, -gaps / np.where(speeds < 0.0, speeds, -1.0), np.inf)
        lengths[lengths < 1e-12] = np.inf
        length = lengths.min(axis=0)
        meets = np.isfinite(length)
        reached = np.where(meets, length, 0.0)
        meets &= z + reached * d_z <= np.tan(theta_a)
        if order:
            left[order - 1] = np.sum(~meets)
        side = np.argmin(lengths, axis=0)[meets]
        x, z, theta_a = (x + reached * d_x)[meets], (z + reached * d_z)[meets], theta_a[meets]
        # Lambert: the sum of the normal and a point on the unit sphere
        up, turn = rng.uniform(-1.0, 1.0, x.size), rng.uniform(0.0, 2.0 * np.pi, x.size)
        around = np.sqrt(1.0 - up**2)
        d = np.stack([np.where(side == 0, 1.0, -1.0) * np.sin(theta_a), np.zeros(x.size), np.cos(theta_a)])
        d += np.stack([around * np.cos(turn), around * np.sin(turn), up])
        d_x, _, d_z = d / np.linalg.norm(d, axis=0)
    return left


def hemisphere() -> tuple[Array, Array, Array]:
    """Return theta_r, phi_r - phi_i [rad] of half a hemisphere, and the weights [sr] of f_r in the albedo."""
    x, w = np.polynomial.legendre.leggauss(16)
    polar, azimuth = np.meshgrid(np.arccos(np.sqrt((x + 1.0) / 2.0)), (x + 1.0) / 2.0 * np.pi, indexing="ij")
    return polar.ravel(), azimuth.ravel(), np.outer(w, w).ravel() * np.pi / 4.0


def test_strips_reflect_what_traced_rays_do_bounce_by_bounce() -> None:
    rng = np.random.default_rng(1994)
    theta_i, rho, sigma, orders = 1.0, 0.9, 0.6, 4
    # Rejection gives slopes of eq. 26 with the sine of eq. 8
    slopes = rng.uniform(0.0, np.pi / 2, 600_000)
    density = np.exp(-(slopes**2) / (2 * sigma**2)) * np.sin(slopes)
    slopes = slopes[rng.uniform(0.0, density.max(), slopes.size) < density]
    left = traced(theta_i, rng.uniform(0.0, 2.0 * np.pi, slopes.size), slopes, orders, rng)
    share = left / slopes.size
    error = np.sqrt(share * (1.0 - share) / slopes.size)
    assert np.all(error < 0.02 * share)

    theta_r, delta_phi, weight = hemisphere()
    strips = bounces(theta_i, theta_r, delta_phi, rho, sigma, orders + 1)[:orders] @ weight
    expected = share * rho ** np.arange(1, orders + 1)
    # The strips contribute an error of 2e-3
    assert np.all(np.abs(strips / expected - 1.0) < 3.5 * error / share + 2e-3), strips / expected


def test_a_facet_sees_as_much_of_the_other_as_its_slope_hides_of_the_sky() -> None:
    """The crossed strings of whole facets give 1 - cos(theta_a)."""
    for slope in (0.2, 0.7, 1.3):
        assert view_factors(slope, 8).mean(axis=0).sum() == pytest.approx(1.0 - np.cos(slope), rel=1e-12)


def test_all_bounces_of_white_cavities_reflect_all_light() -> None:
    theta_r, delta_phi, weight = hemisphere()
    f_r = bounces(0.6, theta_r, delta_phi, 1.0 - 1e-9, 0.5, 3).sum(axis=0)
    assert float(f_r @ weight) == pytest.approx(1.0, abs=2e-3)


# Eqs 44 and 48


def test_the_integral_of_eq_23_is_that_of_the_reference() -> None:
    lines = {curve.label: curve for curve in curves("eq-44")}
    angles = np.deg2rad(75.0), np.deg2rad(75.0), np.deg2rad(60.0), 1.0, np.deg2rad(30.0)
    with mp.workdps(15):
        expected, _ = oren_nayar_1994.single_slope_integral(*angles)
        weighted, _ = oren_nayar_1994.single_slope(*angles)
    assert value_at(lines["integral of eq. 23, θ_i = θ_r = 75°"], 60.0) == pytest.approx(float(expected), rel=1e-3)
    assert value_at(lines["eq. 44, 75°"], 60.0) == pytest.approx(float(weighted), rel=5e-5)


def test_the_factor_of_eq_48_over_that_of_eq_47() -> None:
    for curve, slope in zip(curves("eq-44", 2), np.deg2rad([15.0, 30.0, 45.0, 60.0]), strict=True):
        for m, ratio in list(zip(curve.x, curve.y, strict=True))[5::11]:
            # Eqs (20), (47) and (48)
            d_1m, d_mm, d_11 = np.sqrt(1 + 2 * m * np.cos(2 * slope) + m * m), 2 * m * np.cos(slope), 2 * np.cos(slope)
            exact = np.pi / 2 * (2 * d_1m - d_mm - d_11)
            assert ratio == pytest.approx(np.pi * (1 - np.cos(slope)) * (1 - m) ** 2 / exact, rel=5e-5)


def test_bounces_fall_with_their_number_at_every_angle_of_the_mean() -> None:
    for panel in (0, 1):
        means = [np.mean(np.array(curve.y, dtype=float)) for curve in curves("bounces", panel)[2:5]]
        assert all(b < a for a, b in pairwise(means))
