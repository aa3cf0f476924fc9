"""Figs 7 to 14 of He et al. 1991: curves have their captions, and are those of the reference."""

import numba
import numpy as np
import pytest

from brdfdb.figure import Curve, Figure, Panel
from brdfdb.reference import he_torrance_1991 as reference
from tests.gallery.figures import curve_of, figure, optics, panel_of, value_at

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")

CONE = np.pi / 1024  # solid angle [sr] of light and receiver, section 4
DIGITS = 5e-5  # relative error of numbers with five digits: half a unit of the last digit of 1.0000
SLOPE = 3e-4  # absolute error of slopes. Worst measured: 2.3e-4, from the second terms


def fig(number: int) -> Figure:
    return figure(f"he-torrance-1991-fig-{number:02d}")


def panel(number: int, index: int = 0) -> Panel:
    return panel_of(fig(number), index)


def curve(number: int, label: str, index: int = 0) -> Curve:
    return curve_of(fig(number), label, index)


ALUMINUM = {"sigma_0_um": 0.28, "tau_um": 1.77}  # section 4
CERAMIC = {"sigma_0_um": 1.45, "tau_um": 13.2}


@pytest.mark.parametrize(
    ("number", "angles"),
    [(7, [10, 45, 75]), (8, [10, 30, 45, 60, 75]), (9, [10, 45, 60, 75]), (11, [15, 30, 45, 60])],
)
def test_the_angles_of_incidence_are_those_of_the_captions(number: int, angles: list[int]) -> None:
    assert [curve.label for curve in panel(number).curves] == [f"θ_i = {angle}°" for angle in angles]


@pytest.mark.parametrize("number", [7, 8, 9])
def test_curves_are_over_their_value_in_the_mirror_direction(number: int) -> None:
    """The curves are those of eq. 11."""
    for curve in panel(number).curves:
        assert value_at(curve, float(curve.label.removeprefix("θ_i = ").removesuffix("°"))) == 1.0
    assert value_at(panel(10).curves[0], 0.0) == 1.0


def through_apertures(theta_i: float, x: float, surface: dict[str, float], a: float) -> float:
    arguments = np.deg2rad(theta_i), np.deg2rad(abs(x)), np.pi if x > 0.0 else 0.0, CONE, CONE
    specular = float(reference.aperture_specular(*arguments, **surface))
    return specular + reference.aperture_diffuse(*arguments, **surface) + a / np.pi


@pytest.mark.parametrize(
    ("number", "theta_i", "x", "surface", "a"),
    [
        (7, 10.0, 11.0, ALUMINUM | optics("main/Al/Rakic", 2000.0), 0.0),
        (7, 45.0, 60.0, ALUMINUM | optics("main/Al/Rakic", 2000.0), 0.0),
        (8, 45.0, 67.0, ALUMINUM | optics("main/Al/Rakic", 500.0), 0.0),
        (8, 75.0, 77.0, ALUMINUM | optics("main/Al/Rakic", 500.0), 0.0),
        (9, 60.0, 82.0, CERAMIC | optics("main/MgO/Stephens-vis", 500.0), 0.9),
        (9, 10.0, -20.0, CERAMIC | optics("main/MgO/Stephens-vis", 500.0), 0.9),
    ],
)
def test_curves_through_apertures(number: int, theta_i: float, x: float, surface: dict[str, float], a: float) -> None:
    expected = through_apertures(theta_i, x, surface, a) / through_apertures(theta_i, theta_i, surface, a)
    assert value_at(curve(number, f"θ_i = {theta_i:g}°"), x) == pytest.approx(expected, rel=DIGITS)


def test_across_the_plane_of_incidence_against_the_reference() -> None:
    surface = CERAMIC | optics("main/MgO/Stephens-vis", 500.0)
    angles = np.deg2rad(10.0), np.deg2rad(20.0), np.pi / 2.0
    expected = 1.0 + float(reference.directional_diffuse(*angles, **surface)) * np.pi / 0.9
    for x in (-20.0, 20.0):
        assert value_at(curve(9, "θ_i = 10°", 1), x) == pytest.approx(expected, rel=DIGITS)


def test_sandpaper_against_the_reference() -> None:
    page = optics("main/Al2O3/Malitson-o", 550.0)
    n, k = page["n"], page["k"]
    full = {"sigma_0_um": 44.0, "tau_um": 10.0, **page}
    normal = reference.directional_diffuse(0.0, 0.0, 0.0, **full)
    for x in (-40.0, 88.0):
        theta_r = np.deg2rad(abs(x))
        ratio = reference.directional_diffuse(0.0, theta_r, 0.0, **full) / normal
        assert value_at(curve(10, "σ_0 = 44 µm"), x) == pytest.approx(float(ratio), rel=DIGITS)
        limit = reference.very_rough(0.0, theta_r, 0.0, 4.4, n, k) / reference.very_rough(0.0, 0.0, 0.0, 4.4, n, k)
        assert value_at(curve(10, "σ_0/λ → ∞"), x) == pytest.approx(float(limit), rel=DIGITS)


def test_blue_plastic_is_in_absolute_values() -> None:
    smooth = {"sigma_0_um": 0.0, "tau_um": 1.0, **optics("other/ZeonexE48R/Sultanova", 460.0)}
    assert panel(11).log_y
    for theta_i in (15.0, 60.0):
        drawn = curve(11, f"θ_i = {theta_i:g}°")
        assert value_at(drawn, -30.0) == pytest.approx(0.15 / np.pi, rel=DIGITS)
        for x in (theta_i, theta_i + 2.0):
            arguments = np.deg2rad(theta_i), np.deg2rad(x), np.pi, CONE, CONE
            expected = float(reference.aperture_specular(*arguments, **smooth)) + 0.15 / np.pi
            assert value_at(drawn, x) == pytest.approx(expected, rel=DIGITS)


def test_cylinders_against_the_reference() -> None:
    page = optics("main/Al/Rakic", 550.0)
    labels = [
        f"({name}) σ_0 = {sigma:g} µm, τ = 3 µm"
        for name, sigma in zip("abcde", (0.18, 0.28, 0.38, 0.48, 0.58), strict=True)
    ]
    assert [curve.label for curve in panel(12).curves] == [*labels, "(f) σ_0 = 2.5 µm, τ = 16 µm"]
    cylinder = {"sigma_0_um": 0.38, "tau_um": 3.0, **page}
    rho_s = reference.specular_reflectance(np.deg2rad(80.0), **cylinder)
    assert value_at(curve(12, labels[2]), 80.0) == pytest.approx(float(rho_s), rel=DIGITS)
    lobe = [reference.directional_diffuse(np.deg2rad(30.0), np.deg2rad(x), np.pi, **cylinder) for x in (50.0, 30.0)]
    assert value_at(curve(12, labels[2], 1), 50.0) == pytest.approx(float(lobe[0] / lobe[1]), rel=DIGITS)


def test_the_limiting_cases_against_the_reference() -> None:
    page = optics("main/Al/Rakic", 550.0)
    n, k = page["n"], page["k"]
    angles = np.deg2rad(30.0), np.deg2rad(50.0), np.pi
    expected = {
        "(a)": reference.directional_diffuse(*angles, sigma_0_um=2.5, tau_um=16.0, **page),
        "(a), σ_0/λ → ∞": reference.very_rough(*angles, 2.5 / 16.0, n, k),
        "(c)": 1.0 / np.pi,
    }
    assert [curve.label for curve in panel(13).curves] == list(expected)
    for label, value in expected.items():
        assert value_at(curve(13, label), 50.0) == pytest.approx(float(value), rel=DIGITS)
    mirror = reference.smooth(np.deg2rad(80.0), n, k)
    assert value_at(curve(13, "(b)", 1), 80.0) == pytest.approx(float(mirror), rel=DIGITS)


def test_the_way_to_the_limits_has_the_slopes_of_their_first_terms() -> None:
    """1 - e^-g is proportional to sigma_0^2, and the first term beyond the very rough limit to 1 / g."""
    for label, ends, slope in (("smooth", slice(0, 2), 2.0), ("very rough", slice(-2, None), -2.0)):
        (drawn,) = (curve for curve in panel(13, 2).curves if curve.label.startswith(label))
        x, y = np.log10(drawn.x[ends]), np.log10(np.array(drawn.y[ends], dtype=np.float64))
        assert np.diff(y)[0] / np.diff(x)[0] == pytest.approx(slope, abs=SLOPE)


def test_the_images_in_plastic_against_the_reference() -> None:
    page = optics("other/ZeonexE48R/Sultanova", 550.0)
    for label, sigma_0 in (("cube", 0.0), ("table", 0.20)):
        expected = reference.specular_reflectance(np.deg2rad(75.0), sigma_0_um=sigma_0, tau_um=2.0, **page)
        assert value_at(curve(14, label), 75.0) == pytest.approx(float(expected), rel=DIGITS)
