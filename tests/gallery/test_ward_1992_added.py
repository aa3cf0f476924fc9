"""Figs 3, 7 and 9 of Ward 1992: noise, rays and pictures are checked."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.gallery import GALLERY, ward_1992_renderings
from brdfdb.gallery.ward_1992_renderings import SpherePoints
from brdfdb.measurements import gonioreflectometer
from brdfdb.reference import ward_1992 as reference
from tests.gallery.figures import figure

BRASS = 0.33, 0.050, 0.16  # rho_s, alpha_x, alpha_y of the table in section 6


def test_figures_are_the_same_each_time() -> None:
    for name in ("fig-03", "fig-07-techniques", "fig-07-noise", "fig-09", "fig-09-profile"):
        assert GALLERY[f"ward-1992-{name}"]() == figure(f"ward-1992-{name}")  # seeds are fixed


# Fig. 3


def test_a_camera_in_the_middle_sees_the_target_s_angles() -> None:
    theta, phi = np.array([0.2, 0.9]), np.array([0.4, -2.0])
    expected = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    np.testing.assert_allclose(gonioreflectometer.eq_3(theta, phi, 0.0), expected, atol=1e-15)
    np.testing.assert_allclose(gonioreflectometer.traced(theta, phi, 0.0), expected, atol=1e-15)


def test_eq_3_points_from_the_target_to_where_the_camera_looks() -> None:
    """A ray along y at 45 degrees with D = 0.2 meets the sphere at r_c of the law of cosines."""
    D, root = 0.2, np.sqrt(0.5)
    r_c = D * root + np.sqrt(D**2 / 2.0 + 1.0 - D**2)
    y, z = r_c * root - 2.0 * D, r_c * root
    direction = gonioreflectometer.eq_3(np.array(np.pi / 4), np.array(np.pi / 2), D)
    np.testing.assert_allclose(direction, np.array([0.0, y, z]) / np.hypot(y, z), atol=1e-15)


def test_traced_rays_come_from_beside_the_target() -> None:
    """The mirrored ray meets the sample within D^2 of the target, for R = 1."""
    theta, phi = np.meshgrid(np.deg2rad([10.0, 40.0, 70.0]), np.deg2rad([0.0, 60.0, 150.0, 250.0]))
    for D in (0.02, 0.05):
        out = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
        camera = np.array([0.0, -D, 0.0])
        along = out @ camera
        point = camera + (np.sqrt(along**2 + 1.0 - D**2) - along)[..., None] * out
        leaves = gonioreflectometer.traced(theta, phi, D)
        sample = point - (point[..., 2] / leaves[..., 2])[..., None] * leaves
        assert np.linalg.norm(sample[..., :2] - [0.0, D], axis=-1).max() < 4.0 * D**2


# Fig. 7


def test_noise_of_strict_monte_carlo_is_that_of_a_light_that_is_hit_or_missed() -> None:
    """The share p of rays that meet the disc is the density of eq. 7 at its middle times its solid angle."""
    (panel,) = figure("ward-1992-fig-07-noise").panels
    strict, hybrid, even = panel.curves
    middle = int(np.argmin(hybrid.y))
    up = strict.x[middle]
    # In the frame of the camera: the normal at that height, and the light at an elevation of 40 degrees
    normal = np.arcsin(up)
    light, viewer = np.deg2rad(40.0) - normal, -normal
    theta_i, theta_r = abs(light), abs(viewer)
    assert light * viewer < 0.0  # The viewer is in the mirror half plane
    f_r = float(reference.elliptical(theta_i, 0, theta_r, np.pi, 0, *BRASS))
    h_i, tan = np.cos((light - viewer) / 2.0), np.tan((light + viewer) / 2.0)
    density = np.exp(-((tan / BRASS[1]) ** 2)) / (4 * np.pi * BRASS[1] * BRASS[2] * h_i * np.cos(np.arctan(tan)) ** 3)
    solid_angle = np.pi * np.sin(np.deg2rad(2.0)) ** 2
    p = density * solid_angle
    source = f_r * np.cos(theta_i)
    diffuse = 0.10 / np.pi * (np.cos(theta_i) + np.pi * 0.2)
    expected = source * np.sqrt((1.0 - p) / p / 16.0) / (source + diffuse)
    assert strict.y[middle] == pytest.approx(expected, rel=0.15)  # 2000 rays meet the disc about 25 times
    assert all(a is not None and b is not None and a <= b for a, b in zip(hybrid.y, even.y, strict=True))


def test_pictures_b_and_c_differ_by_the_highlight_alone() -> None:
    pictures = figure("ward-1992-fig-07-techniques").panels
    deterministic, strict, hybrid = (np.array(picture.radiance, dtype=np.float64) for picture in pictures)
    seen = np.isfinite(hybrid)
    dark = seen & (np.arange(len(hybrid))[:, None] > len(hybrid) // 2)  # Below the highlight
    np.testing.assert_array_equal(strict[dark], hybrid[dark])
    assert np.all(hybrid[seen] >= deterministic[seen])
    assert np.mean((strict == 1.0)[seen]) < 0.5 * np.mean((hybrid == 1.0)[seen])


def test_evenly_drawn_rays_and_those_of_eq_7_have_one_mean() -> None:
    _, line = ward_1992_renderings._line()
    points = SpherePoints(*(values[::20] for values in line))
    seven = ward_1992_renderings._by_eq_7(points, 20000).around
    even = ward_1992_renderings._evenly(points, 200000).around
    error = np.sqrt(seven.var(axis=0) / len(seven) + even.var(axis=0) / len(even))
    assert np.all(error < 0.02 * seven.mean(axis=0))
    assert np.all(np.abs(seven.mean(axis=0) - even.mean(axis=0)) < 4.0 * error)


# Fig. 9


def test_the_lid_that_is_not_brushed_has_no_wave() -> None:
    at = np.array([-0.4, 0.1, 0.35]), np.full(3, 0.2)
    one, other = (ward_1992_renderings._radiance(*at, swing, (0.09, 0.09)) for swing in (0.0, 40.0))
    np.testing.assert_allclose(one, other, rtol=1e-12)


def test_radiance_of_the_lid_is_that_of_eq_5a_under_four_lights() -> None:
    x, y = 0.3, 0.1
    total = 0.0
    lights = (*ward_1992_renderings.CANDLES, ward_1992_renderings.OVERHEAD, 1e6 * ward_1992_renderings.MOON)
    viewer = ward_1992_renderings.CAMERA - [x, y, 0.0]
    for light, strength in zip(lights, ward_1992_renderings.STRENGTHS, strict=True):
        towards = light - np.array([x, y, 0.0])
        angles = [
            angle
            for vector in (towards, viewer)
            for angle in (np.arccos(vector[2] / np.linalg.norm(vector)), np.arctan2(vector[1], vector[0]))
        ]
        f_r = float(reference.elliptical(*angles, 0.10, *BRASS))
        total += strength * np.sum(light**2) / np.sum(towards**2) * f_r * np.cos(angles[0])
    radiance = ward_1992_renderings._radiance(np.array(x), np.array(y), 0.0, BRASS[1:])
    assert float(radiance) == pytest.approx(total, rel=1e-9)
