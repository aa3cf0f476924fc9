"""The figures of Oren and Nayar 1994: curves have their captions, and are those of the reference."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from brdfdb.figure import Curve
from brdfdb.reference import mp, oren_nayar_1994
from tests.gallery.figures import figure, panel_of

# Relative errors of the digits that `numbers` leaves, just above the worst measured
FIVE_DIGITS = 4e-5  # Worst measured: 3.2e-5
PIXEL = 2.5e-3  # Worst measured: 2.3e-3


def curves(name: str, panel: int = 0) -> list[Curve]:
    return panel_of(figure(f"oren-nayar-1994-{name}"), panel).curves


def at(curve: Curve, x: float) -> Any:
    return curve.y[int(np.argmin(np.abs(np.array(curve.x) - x)))]


def rad(angle_deg: float) -> float:
    return float(np.deg2rad(angle_deg))


def line(theta_r_deg: float, delta_phi_deg: float = 0.0) -> tuple[float, float]:
    """Return theta_r and phi_r - phi_i [rad] of a viewer, whose angle is negative away from the light."""
    return rad(abs(theta_r_deg)), rad(delta_phi_deg + (180.0 if theta_r_deg < 0.0 else 0.0))


def close(value: Any, expected: Any, tolerance: float = FIVE_DIGITS) -> None:
    assert value == pytest.approx(float(expected), rel=tolerance)


def integral(theta_i_deg: float, viewer: tuple[float, float], rho: float, sigma_deg: float) -> Any:
    """Return f_r [1/sr] of both bounces by the integral over facets."""
    return sum(oren_nayar_1994.gaussian(rad(theta_i_deg), *viewer, rho, rad(sigma_deg)))


def fit(theta_i_deg: float, viewer: tuple[float, float], rho: float, sigma_deg: float) -> Any:
    """Return f_r [1/sr] of both bounces by eqs 27 and 28."""
    return sum(oren_nayar_1994.functional(rad(theta_i_deg), *viewer, rho, rad(sigma_deg)))


COS_75 = np.cos(rad(75.0))


@pytest.mark.parametrize("theta_r_deg", [-60.0, 30.0, 80.0])
def test_fig_08_is_the_radiance_of_the_integral_with_the_second_bounce_and_without(theta_r_deg: float) -> None:
    direct, bounce = oren_nayar_1994.gaussian(rad(75.0), *line(theta_r_deg), 0.9, rad(30.0))
    both, alone, _ = curves("fig-08")
    close(at(both, theta_r_deg), (direct + bounce) * COS_75)
    close(at(alone, theta_r_deg), direct * COS_75)


def test_figs_09_to_11_are_radiance_by_roughness_the_brdf_and_radiance_out_of_the_plane() -> None:
    drawn = {
        (name, curve.label): curve
        for name, panel in ((9, 0), (10, 0), (11, 1))
        for curve in curves(f"fig-{name:02}", panel)
    }
    close(at(drawn[9, "σ = 0°"], -30.0), 0.9 / np.pi * COS_75)
    close(at(drawn[9, "σ = 40°"], -30.0), integral(75.0, line(-30.0), 0.9, 40.0) * COS_75)
    close(at(drawn[10, "θ_i = 45°"], 20.0), integral(45.0, line(20.0), 0.9, 40.0))
    close(at(drawn[11, "φ_r - φ_i = 60°"], -50.0), integral(75.0, line(-50.0, 60.0), 0.9, 40.0) * COS_75)


@pytest.mark.parametrize(
    ("name", "panel", "delta_phi_deg"), [("fig-12", 4, 0.0), ("fig-13", 1, 45.0)], ids=["fig-12", "fig-13"]
)
def test_the_three_forms_of_figs_12_and_13(name: str, panel: int, delta_phi_deg: float) -> None:
    forms = {curve.role: curve for curve in curves(name, panel)}
    for theta_r_deg in (-40.0, 65.0):
        viewer = line(theta_r_deg, delta_phi_deg)
        qualitative = oren_nayar_1994.qualitative(rad(75.0), *viewer, 0.9, rad(30.0))
        close(at(forms["truth"], theta_r_deg), integral(75.0, viewer, 0.9, 30.0) * COS_75)
        close(at(forms["ours"], theta_r_deg), float(fit(75.0, viewer, 0.9, 30.0)) * COS_75)
        close(at(forms["textbook"], theta_r_deg), float(qualitative) * COS_75)


@pytest.mark.parametrize(
    ("number", "caption"),
    [
        # As the captions of the paper print them
        (15, "σ = 30°, ρ = 0.90"),
        (16, "σ = 40°, ρ = 0.80"),
        (17, "σ = 35°, ρ = 0.80"),
        (18, "σ = 35°, ρ = 0.80"),
        (19, "σ = 20°, ρ = 0.80, k_s/k_b = 0.019"),
        (20, "σ = 42°, ρ = 0.75, k_s/k_b = 0.085"),
        (21, "σ = 26°, ρ = 0.70, k_s/k_b = 0.043"),
    ],
)
def test_samples_have_the_parameters_of_their_captions(number: int, caption: str) -> None:
    drawn = figure(f"oren-nayar-1994-fig-{number}")
    assert drawn.caption.startswith((f"{caption}. ", f"{caption}, F = 1"))
    for panel in range(len(drawn.panels)):
        assert at(curves(f"fig-{number}", panel)[0], 0.0) == 1.0  # normalised along the normal


def own_evaluation(theta_i: float, theta_r: float, delta_phi: float, rho: float, sigma: float) -> float:
    """Return f_r [1/sr] of eqs 24 and 49 integrated by eq. 25, with eq. 26 normalised over the slope."""
    kinks = {0.0, np.pi / 2 - theta_i, np.pi / 2 - theta_r, np.pi / 2}
    x, w = np.polynomial.legendre.leggauss(20)
    total = light = 0.0
    for low, high in pairwise(sorted(kinks)):
        for node, share in zip(x, w, strict=True):
            theta_a = low + (high - low) * (node + 1) / 2
            weight = share * (high - low) * np.exp(-(theta_a**2) / (2 * sigma**2)) * np.sin(theta_a)
            light += weight * float(sum(oren_nayar_1994.single_slope(theta_i, theta_r, delta_phi, rho, theta_a)))
            total += weight
    return light / total


def test_fig_16_is_the_painted_sandpaper_under_the_lights_of_fig_15() -> None:
    for panel, theta_i_deg in enumerate((30.0, 45.0, 60.0)):
        evaluated, facets, functional = curves("fig-16", panel)
        assert "eqs 24 and 49" in evaluated.label
        value, normal = (own_evaluation(rad(theta_i_deg), *line(angle), 0.8, rad(40.0)) for angle in (-55.0, 0.0))
        close(at(evaluated, -55.0), value / normal)
        assert "eq. 47" in facets.label
        value, normal = (integral(theta_i_deg, line(angle), 0.8, 40.0) for angle in (-55.0, 0.0))
        close(at(facets, -55.0), value / normal)
        value, normal = (fit(theta_i_deg, line(angle), 0.8, 40.0) for angle in (70.0, 0.0))
        close(at(functional, 70.0), value / normal)


def test_fig_18_leaves_the_plane_of_incidence_by_45_and_60_degrees() -> None:
    for panel, (theta_i_deg, delta_phi_deg) in enumerate([(60.0, 45.0), (75.0, 60.0)]):
        value, normal = (fit(theta_i_deg, line(angle, delta_phi_deg), 0.8, 35.0) for angle in (-65.0, 0.0))
        close(at(curves("fig-18", panel)[2], -65.0), value / normal)


def test_fig_20_is_eq_32_with_eq_27_for_the_body() -> None:
    weights = {"k_b": 1, "k_s": 0.085 / np.pi}  # The preset assumes E_0 = pi
    body_normal, _, surface_normal = oren_nayar_1994.body_surface(rad(45.0), *line(0.0), 0.75, rad(42.0), **weights)
    body, _, surface = oren_nayar_1994.body_surface(rad(45.0), *line(-50.0), 0.75, rad(42.0), **weights)
    both, alone = curves("fig-20", panel=1)
    close(at(both, -50.0), (body + surface) / (body_normal + surface_normal))
    close(at(alone, -50.0), body / (body_normal + surface_normal))


# The vase is a cylinder: at x its normal is turned from the camera by arcsin(x)


def across(light_deg: float, x: float) -> tuple[float, float, float]:
    """Return theta_i, theta_r and phi_r - phi_i [rad] at x."""
    normal = float(np.arcsin(x))
    light, viewer = rad(light_deg) - normal, -normal
    return abs(light), abs(viewer), 0.0 if light * viewer >= 0.0 else np.pi


def test_fig_23_is_the_vase_over_its_largest_radiance() -> None:
    _, functional, lambertian = curves("fig-23")
    xs = np.array(functional.x)[40:-40:20]
    middle = sum(oren_nayar_1994.functional(0, 0, 0, 0.7, rad(40.0)))
    for x in xs:
        angles = across(0.0, x)
        value = sum(oren_nayar_1994.functional(*angles, 0.7, rad(40.0))) * mp.cos(angles[0])
        close(at(functional, x), value / middle)
        close(at(lambertian, x), np.cos(angles[0]))


def test_fig_23_b_has_the_light_20_degrees_to_the_right() -> None:
    integrated, _, lambertian = curves("fig-23", panel=1)
    xs = np.array(lambertian.x)[10::10]
    for x in xs:
        close(at(lambertian, x), max(np.cos(across(20.0, x)[0]), 0.0))
    angles = {x: across(20.0, x) for x in (xs[5], xs[12], xs[-2])}
    radiance = {x: sum(oren_nayar_1994.gaussian(*a, 0.7, rad(40.0))) * np.cos(a[0]) for x, a in angles.items()}
    first, *others = (at(integrated, x) / radiance[x] for x in angles)
    for other in others:
        close(other, first)


@pytest.mark.parametrize(("panel", "sigma_deg"), [(0, 0.0), (1, 10.0), (2, 20.0), (3, 40.0)])
def test_spheres_are_lit_from_the_camera_by_eq_27(panel: int, sigma_deg: float) -> None:
    picture = figure("oren-nayar-1994-spheres").panels[panel]
    half = len(picture.radiance) // 2
    for row, column in ((half, half), (10, half), (half + 20, 15)):
        x, y = (column + 0.5) / half - 1.0, (row + 0.5) / half - 1.0
        theta = float(np.arcsin(np.hypot(x, y)))
        direct, _ = oren_nayar_1994.functional(theta, theta, 0, 0.9, rad(sigma_deg))
        close(picture.radiance[row][column], direct * mp.pi * mp.cos(theta), PIXEL)


def test_the_picture_of_the_vase_is_upright() -> None:
    lambertian, rough = figure("oren-nayar-1994-fig-22").panels
    for picture in (lambertian, rough):
        assert all(row == picture.radiance[0] for row in picture.radiance)
        assert picture.radiance[0] == picture.radiance[0][::-1]
    x = 1.0 / 96 - 1.0
    close(lambertian.radiance[0][0], 0.7 * np.sqrt(1.0 - x * x), PIXEL)
    angles = across(0.0, x)
    expected = sum(oren_nayar_1994.functional(*angles, 0.7, rad(40.0))) * mp.pi * mp.cos(angles[0])
    close(rough.radiance[0][0], expected, PIXEL)


def test_the_cylinder_of_the_scenes_is_smooth_and_rough() -> None:
    for panel, light_deg in enumerate((0.0, 20.0)):
        smooth, _ = curves("scenes", panel)
        for x in np.array(smooth.x)[40::40]:
            close(at(smooth, x), np.cos(across(light_deg, x)[0]))
    _, rough = curves("scenes")
    middle = sum(oren_nayar_1994.functional(0, 0, 0, 0.9, rad(30.0)))
    x = rough.x[30]
    angles = across(0.0, x)
    close(at(rough, x), sum(oren_nayar_1994.functional(*angles, 0.9, rad(30.0))) * mp.cos(angles[0]) / middle)
