"""He et al. 1991 in its limits, part by part, through apertures, and under the bound of energy conservation."""

import numba
import numpy as np
import pytest

from brdfdb import fresnel
from brdfdb.geometry import unit_vector
from brdfdb.integrals import uniform_bound
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.models import (
    he_torrance,
    he_torrance_aperture,
    he_torrance_parts,
    he_torrance_smooth,
    he_torrance_specular,
    he_torrance_very_rough,
)
from brdfdb.reference import he_torrance_1991
from tests.models.he_torrance_surfaces import ALUMINUM, CERAMIC, CONES, HALF_PI, directions

# Relative differences, each just above the worst measured, which stands behind it
VERY_ROUGH = 1e-12  # 2.1e-13, where exp has a large exponent
PARTS = 5e-15  # 8.2e-16


def test_very_rough_against_the_reference() -> None:
    rng = np.random.default_rng(13)
    for _ in range(200):
        theta_i, theta_r, delta_phi = rng.uniform([0.0, 0.0, -3.0], [1.55, 1.55, 3.0])
        slope, n, k = 10.0 ** rng.uniform(-2.0, 1.0), rng.uniform(0.2, 3.0), rng.uniform(0.0, 5.0)
        expected = float(he_torrance_1991.very_rough(theta_i, theta_r, delta_phi, slope, n, k))
        value = he_torrance_very_rough(theta_i, 0.3, theta_r, 0.3 + delta_phi, sigma_0_over_tau=slope, n=n, k=k)
        assert value == pytest.approx(expected, rel=VERY_ROUGH, abs=1e-250)


@pytest.mark.parametrize("wavelength_nm", [20.0, 5.0, 1.0])
def test_he_torrance_converges_to_the_very_rough_limit(wavelength_nm: float) -> None:
    """He et al. 1991, section 4 and Fig. 13 (a); the first term left out is the share (b^2 / 2 - 2 b + 1) / g."""
    rng = np.random.default_rng(5)
    theta_i, theta_r = rng.uniform(0.0, 1.2, (2, 400))
    phi_r = np.pi + rng.uniform(-0.8, 0.8, 400)
    optics, slope = {"n": 0.769, "k": 6.08}, 0.16
    value = he_torrance(
        theta_i, 0.0, theta_r, phi_r, wavelength_nm=wavelength_nm, sigma_0_um=0.48, tau_um=3.0, **optics
    )
    limit = he_torrance_very_rough(theta_i, 0.0, theta_r, phi_r, sigma_0_over_tau=slope, **optics)
    sigma = [
        float(he_torrance_1991.effective_roughness(*pair, slope, 1)) for pair in zip(theta_i, theta_r, strict=True)
    ]
    wi, wr = unit_vector(theta_i, 0.0), unit_vector(theta_r, phi_r)
    v = wi + wr
    g = (2000.0 * np.pi / wavelength_nm * 3.0 * np.array(sigma) * v[:, 2]) ** 2
    b = (v[:, 0] ** 2 + v[:, 1] ** 2) / (2.0 * np.array(sigma) * v[:, 2]) ** 2
    likely = b < 4.0  # where the next term is of the order 1 / g^2, and not b^4 / g^2
    assert likely.sum() > 100
    first = (b**2 / 2.0 - 2.0 * b + 1.0) / g
    np.testing.assert_array_less(abs(value / limit - 1.0 - first)[likely], (20.0 / g**2 + 1e-11)[likely])
    assert abs(value / limit - 1.0)[likely].max() < 10.0 / g.min()


def test_smooth_is_fresnels_reflectance() -> None:
    theta_i = np.linspace(0.0, HALF_PI, 19)
    for n, k in ((1.5, 0.0), (0.769, 6.08)):
        value = he_torrance_smooth(theta_i, n=n, k=k)
        np.testing.assert_allclose(value, [float(he_torrance_1991.smooth(t, n, k)) for t in theta_i], rtol=1e-14)
        mirror = he_torrance_specular(theta_i, wavelength_nm=500.0, sigma_0_um=0.0, tau_um=1.0, n=n, k=k)
        np.testing.assert_allclose(mirror, value, rtol=1e-15)


def test_parts_add_up() -> None:
    rng = np.random.default_rng(69)
    angles = directions(rng, 500)
    surface = ALUMINUM | {"wavelength_nm": 500.0}
    parts = he_torrance_parts(*angles, a=0.3, **surface)
    np.testing.assert_allclose(sum(parts), he_torrance(*angles, a=0.3, **surface), rtol=PARTS)
    np.testing.assert_allclose(parts.directional_diffuse, he_torrance(*angles, **surface), rtol=PARTS)
    np.testing.assert_allclose(parts.uniform_diffuse, 0.3 / np.pi, rtol=1e-15)
    assert parts.uniform_diffuse.shape == (500,)


def test_a_number_of_rings_is_a_whole_number() -> None:
    for rings in (-1, 9, 2.5, True):
        with pytest.raises(ValueError, match=r"rings: .* is not a whole number in"):
            he_torrance_aperture(0.1, 0.0, 0.1, 0.0, rings=rings, **CONES, **CERAMIC)


# The bound of energy conservation: a million directions, too many for kernels that are not compiled

compiled = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")


@compiled
def test_a_max_is_where_the_worst_angle_reflects_all() -> None:
    bound = uniform_bound.largest_uniform("he_torrance", **CERAMIC, tolerance=1e-5)
    theta_i = np.deg2rad(np.linspace(82.0, 85.0, 13))
    albedo, _ = directional_albedo("he_torrance", theta_i, tolerance=1e-6, specular=True, a=float(bound), **CERAMIC)
    assert albedo.max() == pytest.approx(1.0, abs=1e-4)
    assert albedo.max() <= 1.0 + 1e-5
    assert bound < 0.9  # what the paper takes


@compiled
def test_a_max_of_a_smooth_surface_is_nothing() -> None:
    smooth = {"wavelength_nm": 460.0, "tau_um": 1.0, "n": 1.5, "k": 0.0}
    bound = uniform_bound.largest_uniform("he_torrance", sigma_0_um=[0.0, 1e-3], **smooth, tolerance=1e-4)
    assert bound.shape == (2,)
    assert bound[0] == pytest.approx(0.0, abs=1e-14)
    assert 0.0 < bound[1] < 0.1
    with pytest.raises(ValueError, match="n: 0 is outside"):
        uniform_bound.largest_uniform("he_torrance", sigma_0_um=0.0, **smooth | {"n": 0.0})


@compiled
def test_without_an_interface_a_may_be_one() -> None:
    nothing = {"wavelength_nm": 500.0, "sigma_0_um": 0.3, "tau_um": 2.0, "n": 1.0, "k": 0.0}
    assert fresnel.unpolarised(0.5, 1.0, 0.0) == 0.0
    assert uniform_bound.largest_uniform("he_torrance", **nothing, tolerance=1e-3) == 1.0
