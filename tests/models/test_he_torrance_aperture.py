"""He et al. 1991 through the apertures of light and receiver."""

import itertools

import numpy as np
import pytest

from brdfdb import models
from brdfdb.geometry import common_solid_angle, unit_vector
from brdfdb.models import he_torrance, he_torrance_aperture, he_torrance_smooth
from brdfdb.reference import he_torrance_1991
from tests.models.he_torrance_surfaces import ALUMINUM, CERAMIC, CONE, CONES, HALF_PI, directions

EXCHANGE = 2e-12  # 3.5e-13: the nodes in exchanged cones are summed in another order
AREA = 2e-13  # 5.5e-14
SPREAD_REFERENCE = 5e-15  # 7.8e-16
APERTURE = 2e-13  # 4.6e-14; of the reference through pinholes 6.2e-14
TWO_RINGS = 2e-8  # 1.2e-8: the ceramic near grazing, whose lobe is steep there
SPREAD = 2e-14  # 4.8e-15, rho_s from the integral of the spread peak


def area_by_quadrature(first: float, second: float, apart: float) -> float:
    """The common area of two circles on the sphere, as arcs of the one integrated over the other."""
    x, weight = np.polynomial.legendre.leggauss(100)
    edges = sorted({0.0, *np.clip([abs(second - apart), second + apart], 0.0, first), first})
    area = 0.0
    for low, high in itertools.pairwise(edges):
        turn = (x + 1.0) * HALF_PI  # the ends of an arc open like square roots
        off = low + (high - low) * (1.0 - np.cos(turn)) / 2.0
        cos_arc = (np.cos(second) - np.cos(off) * np.cos(apart)) / (np.sin(off) * np.sin(apart))
        arc = 2.0 * np.arccos(np.clip(cos_arc, -1.0, 1.0))
        area += float(weight @ (arc * np.sin(off) * np.sin(turn))) * HALF_PI * (high - low) / 2.0
    return area


@pytest.mark.parametrize(
    ("first", "second", "apart"),
    [(0.5, 0.5, 0.3), (0.5, 0.2, 0.6), (0.5, 0.2, 0.4), (0.5, 0.2, 0.31), (0.6, 0.59, 0.05), (0.03, 0.03, 0.01)],
)
def test_common_area_of_two_cones(first: float, second: float, apart: float) -> None:
    expected = area_by_quadrature(first, second, apart)
    assert common_solid_angle(first, second, apart) == pytest.approx(expected, rel=AREA)
    assert common_solid_angle(second, first, apart) == pytest.approx(
        common_solid_angle(first, second, apart), rel=1e-12
    )


def test_common_area_has_its_closed_forms() -> None:
    assert common_solid_angle(0.3, 0.2, 0.05) == pytest.approx(2.0 * np.pi * (1.0 - np.cos(0.2)), rel=1e-14)
    assert common_solid_angle(0.3, 0.3, 0.0) == pytest.approx(2.0 * np.pi * (1.0 - np.cos(0.3)), rel=1e-14)
    assert common_solid_angle(0.3, 0.3, 1e-24) == pytest.approx(2.0 * np.pi * (1.0 - np.cos(0.3)), rel=1e-14)
    assert common_solid_angle(0.3, 0.2, 0.5) == 0.0
    assert common_solid_angle(0.3, 0.2, np.pi) == 0.0
    # small circles of one size lie in a plane
    radius, half = 1e-6, 0.5
    lens = 2.0 * (np.arccos(half) - half * np.sqrt(1.0 - half**2)) * radius**2
    assert common_solid_angle(radius, radius, 2.0 * half * radius) == pytest.approx(lens, rel=AREA)


@pytest.mark.parametrize("theta_deg", [0.0, 10.0, 60.0])
@pytest.mark.parametrize("received", [CONE, 0.2 * CONE])
def test_the_spread_specular_part_integrates_to_rho_s(theta_deg: float, received: float) -> None:
    theta_i, n, k = np.deg2rad(theta_deg), 2.15, 20.7
    arguments = {"incident_solid_angle_sr": CONE, "received_solid_angle_sr": received, "rings": 0}
    smooth = {"wavelength_nm": 2000.0, "sigma_0_um": 0.0, "tau_um": 1.77, "n": n, "k": k}
    # around the mirror direction, in rings whose edges are those of the cones
    radii = np.arcsin(np.sqrt(np.array([received, CONE]) / np.pi))
    x, weight = np.polynomial.legendre.leggauss(48)
    total = 0.0
    for low, high in ((0.0, radii[1] - radii[0]), (radii[1] - radii[0], radii.sum())):
        turn = (x + 1.0) * HALF_PI
        off = (low + (high - low) * (1.0 - np.cos(turn)) / 2.0)[:, None]
        around = 2.0 * np.pi * np.arange(12) / 12.0
        mirror, along = unit_vector(theta_i, np.pi), unit_vector(theta_i + HALF_PI, np.pi)
        across = np.cross(mirror, along)
        wr = (
            np.cos(off)[..., None] * mirror
            + (np.sin(off) * np.cos(around))[..., None] * along
            + (np.sin(off) * np.sin(around))[..., None] * across
        )
        f_r = models.he_torrance_aperture_vectors(unit_vector(theta_i, 0.0), wr, **arguments, **smooth)
        ring = (f_r * wr[..., 2]).mean(axis=1) * 2.0 * np.pi * np.sin(off[:, 0])
        total += float(weight @ (ring * np.sin(turn))) * HALF_PI * (high - low) / 2.0
    assert total == pytest.approx(he_torrance_smooth(theta_i, n=n, k=k), rel=SPREAD)


def test_diffuse_parts_are_averaged_over_both_cones() -> None:
    theta_i, theta_r = np.deg2rad(75.0), np.deg2rad(78.0)
    rough = CERAMIC | {"a": 0.2}

    def averaged(rings: int) -> float:
        value = he_torrance_aperture(theta_i, 0.0, theta_r, np.pi, rings=rings, **CONES, **rough)
        return float(value - he_torrance_aperture(theta_i, 0.0, theta_r, np.pi, rings=0, **CONES, **rough))

    on_axis = he_torrance(theta_i, 0.0, theta_r, np.pi, **rough)
    # by chance: pairs of directions, evenly spread over both cones
    rng, alpha = np.random.default_rng(7), np.arcsin(1.0 / 32.0)
    w = []
    for theta, phi in ((theta_i, 0.0), (theta_r, np.pi)):
        versine, turn = rng.uniform(0.0, 1.0 - np.cos(alpha), 20_000), rng.uniform(0.0, 2.0 * np.pi, 20_000)
        sin = np.sqrt(versine * (2.0 - versine))
        axis, along = unit_vector(theta, phi), unit_vector(theta + HALF_PI, phi)
        around = np.cos(turn)[:, None] * along + np.sin(turn)[:, None] * np.cross(axis, along)
        w.append((1.0 - versine)[:, None] * axis + sin[:, None] * around)
    by_chance = models.he_torrance_vectors(*w, **rough)
    noise = by_chance.std() / np.sqrt(by_chance.size)
    assert abs(averaged(3) + on_axis - by_chance.mean()) < 4.0 * noise
    assert abs(averaged(3)) > 10.0 * noise
    assert averaged(2) == pytest.approx(averaged(5), abs=1e-5 * on_axis)  # 2.5e-7
    assert averaged(3) == pytest.approx(averaged(5), abs=1e-8 * on_axis)  # 6e-11


@pytest.mark.parametrize(
    ("theta_i", "theta_r", "delta_phi", "received"),
    [
        (0.3, 0.3, np.pi, CONE),
        (0.3, 0.3, np.pi, 0.2 * CONE),
        (0.3, 0.33, np.pi, CONE),
        (1.2, 1.19, 3.12, 0.01),
        (0.0, 0.04, 1.0, CONE),
        (1.5, 1.5, 3.12, 1e-8),
        (0.3, 0.4, np.pi, CONE),
    ],
)
def test_the_spread_specular_part_against_the_reference(
    theta_i: float, theta_r: float, delta_phi: float, received: float
) -> None:
    smooth = {"wavelength_nm": 2000.0, "sigma_0_um": 0.0, "tau_um": 1.77, "n": 2.15, "k": 20.7}
    cones = {"incident_solid_angle_sr": CONE, "received_solid_angle_sr": received}
    expected = float(he_torrance_1991.aperture_specular(theta_i, theta_r, delta_phi, **cones, **smooth))
    value = he_torrance_aperture(theta_i, 0.3, theta_r, 0.3 + delta_phi, a=0.3, **cones, **smooth)
    assert value - 0.3 / np.pi == pytest.approx(expected, rel=SPREAD_REFERENCE, abs=1e-15)
    assert (expected > 0.0) == (theta_r < 0.4 or theta_i > 0.4)


@pytest.mark.parametrize(
    ("surface", "theta_i", "theta_r", "delta_phi", "received"),
    [
        (ALUMINUM | {"wavelength_nm": 2000.0}, 0.3, 0.32, 3.12, CONE),
        (ALUMINUM | {"wavelength_nm": 500.0}, 1.2, 1.3, np.pi, 0.1 * CONE),
        (ALUMINUM | {"wavelength_nm": 500.0}, 0.0, 0.2, 1.0, 0.02),
        (CERAMIC, 0.4, 0.5, 2.9, CONE),
        (CERAMIC, 1.2, 1.3, np.pi, CONE),
    ],
)
def test_all_parts_through_apertures_against_the_reference(
    surface: dict[str, float], theta_i: float, theta_r: float, delta_phi: float, received: float
) -> None:
    cones = {"incident_solid_angle_sr": CONE, "received_solid_angle_sr": received}
    arguments = theta_i, theta_r, delta_phi, *cones.values()
    expected = float(he_torrance_1991.aperture_specular(*arguments, **surface))
    expected += he_torrance_1991.aperture_diffuse(*arguments, **surface) + 0.2 / np.pi
    for rings, tolerance in ((4, APERTURE), (2, TWO_RINGS)):
        value = he_torrance_aperture(theta_i, 0.0, theta_r, delta_phi, a=0.2, rings=rings, **cones, **surface)
        assert value == pytest.approx(expected, rel=tolerance)


def test_the_diffuse_reference_through_pinholes_is_the_one_of_40_digits() -> None:
    for arguments in ((0.4, 0.5, 2.9), (0.0, 1.2, 1.0)):
        value = he_torrance_1991.aperture_diffuse(*arguments, 1e-16, 1e-16, **CERAMIC)
        exact = he_torrance_1991.directional_diffuse(*arguments, **CERAMIC)
        assert value == pytest.approx(float(exact), rel=APERTURE)
    assert he_torrance_1991.aperture_diffuse(0.4, 0.5, 2.9, CONE, CONE, **CERAMIC | {"sigma_0_um": 0.0}) == 0.0


def test_light_and_receiver_exchange_with_their_cones() -> None:
    rng = np.random.default_rng(3)
    theta_i, phi_i, theta_r, phi_r = directions(rng, 50)
    surface = ALUMINUM | {"wavelength_nm": 500.0}
    one = he_torrance_aperture(
        theta_i, phi_i, theta_r, phi_r, incident_solid_angle_sr=CONE, received_solid_angle_sr=0.1, **surface
    )
    other = he_torrance_aperture(
        theta_r, phi_r, theta_i, phi_i, incident_solid_angle_sr=0.1, received_solid_angle_sr=CONE, **surface
    )
    away = np.linalg.norm(unit_vector(theta_i, phi_i + np.pi) - unit_vector(theta_r, phi_r), axis=-1) > 0.3
    assert away.sum() > 30
    np.testing.assert_allclose(one[away], other[away], rtol=EXCHANGE)
