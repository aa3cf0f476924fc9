"""Fig. 6, effective roughness and polarised light of He et al. 1991: curves against the reference."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from brdfdb.figure import Curve, Panel
from brdfdb.gallery.he_torrance_1991_roughness import SPACING, profile, reached
from brdfdb.reference import he_torrance_1991 as reference
from tests.gallery.figures import curve_of, figure, optics, panel_of, value_at

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")

DIGITS = 5e-5  # relative error of numbers with five digits


def panel(name: str, index: int = 0) -> Panel:
    return panel_of(figure(f"he-torrance-1991-{name}"), index)


def curve(name: str, label: str, index: int = 0) -> Curve:
    return curve_of(figure(f"he-torrance-1991-{name}"), label, index)


ALUMINUM = {"sigma_0_um": 0.28, "tau_um": 1.77}
TABLE = {"sigma_0_um": 0.20, "tau_um": 2.0}


# Fig. 6


def test_the_parts_of_the_table_top_against_the_reference() -> None:
    page = optics("other/ZeonexE48R/Sultanova", 550.0)
    angles = np.deg2rad(60.0), np.deg2rad(75.0), np.pi
    expected = reference.directional_diffuse(*angles, **TABLE, **page)
    for index in (0, 1):
        for label, value in (("directional diffuse", float(expected)), ("uniform diffuse", 0.28 / np.pi)):
            assert value_at(curve("fig-06", label, index), 75.0) == pytest.approx(value, rel=DIGITS)


def test_the_share_of_the_specular_part_is_e_to_the_minus_g() -> None:
    """At normal incidence on gentle slopes that reflect all light, g is (4 pi sigma_0 / lambda)^2."""
    drawn = curve("fig-06", "specular", 2)
    for x, y in zip(drawn.x[:5], drawn.y[:5], strict=True):
        assert y == pytest.approx(np.exp(-((4.0 * np.pi * x) ** 2)), rel=1e-3)  # |F|^2 is 0.9996


# Effective roughness


@pytest.mark.parametrize("theta_deg", [45.0, 80.0, 89.0])
def test_roughness_and_shadowing_of_the_aluminum_against_the_reference(theta_deg: float) -> None:
    theta = np.deg2rad(theta_deg)
    sigma = reference.effective_roughness(theta, theta, 0.28, 1.77) / 0.28
    S = reference.shadowing(theta, 0.28, 1.77) ** 2
    for index, expected in enumerate((sigma, S)):
        drawn = curve("effective-roughness", "aluminum of Fig. 8", index)
        assert value_at(drawn, theta_deg) == pytest.approx(float(expected), rel=1e-4)


def test_specular_reflectance_with_either_roughness() -> None:
    page = optics("main/Al/Rakic", 500.0)
    theta = np.deg2rad(75.0)
    with_sigma = reference.specular_reflectance(theta, **ALUMINUM, **page)
    g_0 = (4.0 * np.pi * 0.28 / 0.5 * np.cos(theta)) ** 2
    fixed = reference.smooth(theta, page["n"], page["k"]) * reference.shadowing(theta, 0.28, 1.77) ** 2 * np.exp(-g_0)
    drawn = panel("effective-roughness", 2).curves
    assert value_at(drawn[0], 75.0) == pytest.approx(float(with_sigma), rel=DIGITS)
    assert value_at(drawn[1], 75.0) == pytest.approx(float(fixed), rel=1e-4)


def test_profiles_have_the_autocorrelation_of_eq_48() -> None:
    heights = profile(3)
    assert heights.mean() == pytest.approx(0.0, abs=0.05)
    assert heights.std() == pytest.approx(1.0, abs=1e-12)
    for lag in (0.5, 1.0, 1.5):
        shifted = np.roll(heights, round(lag / SPACING))
        assert float(np.mean(heights * shifted)) == pytest.approx(np.exp(-(lag**2)), abs=0.05)


def test_a_direction_reaches_the_points_whose_rays_are_free() -> None:
    heights = profile(5)[:400]
    slope, theta = 0.3, np.deg2rad(75.0)
    steps = SPACING * np.arange(heights.size)
    rays = slope * heights[:, np.newaxis] + (steps - steps[:, np.newaxis]) / np.tan(theta)
    free = np.all(np.tril(np.ones(rays.shape, dtype=bool)) | (slope * heights <= rays), axis=1)
    np.testing.assert_array_equal(reached(heights, slope, theta), free)


# Polarised light


def test_elements_in_the_plane_and_around_the_normal_against_the_reference() -> None:
    aluminum = {**ALUMINUM, **optics("main/Al/Rakic", 500.0)}
    M = reference.mueller(np.deg2rad(60.0), np.deg2rad(40.0), np.pi, **aluminum)
    for row, column in ((1, 1), (2, 3), (3, 3)):
        expected = float(M[row, column] / M[0, 0])
        assert value_at(curve("polarisation", f"m_{row}{column}", 1), 40.0) == pytest.approx(expected, rel=DIGITS)
    M = reference.mueller(np.deg2rad(60.0), np.deg2rad(60.0), np.deg2rad(70.0), **aluminum)
    for drawn in panel("mueller").curves:
        row, column = (int(digit) for digit in drawn.label.removeprefix("m_"))
        assert value_at(drawn, 70.0) == pytest.approx(float(M[row, column] / M[0, 0]), rel=DIGITS)


def test_plastic_with_its_uniform_part_against_the_reference() -> None:
    table = {**TABLE, **optics("other/ZeonexE48R/Sultanova", 550.0)}
    M = reference.mueller(np.deg2rad(60.0), np.deg2rad(70.0), np.pi, **table)
    drawn = curve("polarisation", "plastic with its uniform part")
    assert value_at(drawn, 70.0) == pytest.approx(float(M[0, 1] / (M[0, 0] + 0.28 / np.pi)), rel=DIGITS)


def test_the_map_is_the_share_of_s_that_leaves_as_p() -> None:
    shown = figure("he-torrance-1991-mueller").panels[2]
    page = optics("main/Al/Rakic", 500.0)
    row, column = 30, 12
    x, y = shown.x[column], shown.y[row]
    J = reference.jones(np.deg2rad(60.0), np.arcsin(np.hypot(x, y)), np.arctan2(y, x), page["n"], page["k"])
    ss, ps = (abs(complex(J[row, 0])) ** 2 for row in (0, 1))
    assert shown.values[row][column] == pytest.approx(ps / (ss + ps), rel=2e-3)  # three digits; x and y have four
