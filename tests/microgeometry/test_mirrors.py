"""Tests of mirror-like facets against closed forms, and of their energy and reciprocity."""

import numpy as np
import pytest

from brdfdb.microgeometry.facets import Facets
from brdfdb.microgeometry.goniometer import bounces
from brdfdb.microgeometry.height_map import HeightMap
from brdfdb.microgeometry.mirrors import (
    CONE,
    _estimated_density,
    cone_projected,
    mirror_bounces,
    one_bounce_is_smoothed,
)
from brdfdb.microgeometry.rays import Tracer
from brdfdb.microgeometry.surfaces import MadeSurface, gaussian_field, v_grooves

PERFECT = Facets(mirror=1.0)


def vectors(*degrees):
    """Return unit vectors of pairs (theta, phi) [degrees]."""
    theta, phi = np.radians(np.array(degrees, np.float64)).T
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def hemisphere(count):
    """Return directions (count, 3), each of which stands for the projected solid angle pi / count."""
    places = (np.arange(count) + 0.5) / count
    phi = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    radius = np.sqrt(places)
    return np.stack([radius * np.cos(phi), radius * np.sin(phi), np.sqrt(1.0 - places)], axis=-1)


@pytest.fixture(scope="module")
def steep():
    return Tracer(MadeSurface("gaussian", 0.5, nodes=256).draw(3))


def test_nearly_flat_gaussian_facets_reflect_as_beckmanns_distribution_without_shadowing():
    lights = vectors((0, 0), (30, 20), (40, 250))
    viewers = vectors((0, 0), (8, 60), (30, 200), (22, 190), (38, 75), (42, 65))
    seeds = range(10)  # maps
    measured = []
    for seed in seeds:
        field = gaussian_field(sigma_0_um=0.06, tau_x_um=1.0, tau_y_um=2.0, step_um=0.25, nodes=160, seed=seed)
        measured.append(mirror_bounces(Tracer(field), PERFECT, lights, viewers, rays=256, seed=seed).one[..., 0])
    half = lights[:, np.newaxis] + viewers
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    # variances of slopes from the correlation exp(-r^2): 2 sigma_0^2 (1 - exp(-(step / tau)^2)) / step^2
    variance = 2.0 * 0.06**2 * -np.expm1(-(np.array([0.25, 0.125]) ** 2)) / 0.25**2
    exponent = np.sum((half[..., :2] / half[..., 2:]) ** 2 / variance, axis=-1)
    density = np.exp(-0.5 * exponent) / (2.0 * np.pi * np.sqrt(variance.prod()))
    expected = density / (4.0 * half[..., 2] ** 4 * lights[:, np.newaxis, 2] * viewers[:, 2])
    ratio = np.array(measured) / expected
    bright = exponent < 4.0
    assert bright.sum() >= 5
    error = ratio.std(axis=0, ddof=1) / np.sqrt(len(seeds))
    assert error[bright].max() < 0.1
    assert np.all(np.abs(ratio.mean(axis=0) - 1.0)[bright] < 3.0 * error[bright] + 0.005)


def gaussian_density(slopes, deviations):
    """Return the density of Gaussian slopes (N, 2) with standard deviations along x and y."""
    deviations = np.broadcast_to(deviations, 2)
    return np.exp(-0.5 * np.sum((slopes / deviations) ** 2, axis=-1)) / (2.0 * np.pi * deviations.prod())


@pytest.mark.parametrize(("share", "wide"), [(0.0, 1.0), (0.05, 0.4), (0.3, 0.06), (0.01, 1.0)])
def test_a_narrow_core_of_slopes_is_not_smeared_by_wide_tails(share, wide):
    narrow = 0.02
    at = np.array([[0.0, 0.0], [0.01, 0.0], [0.0, 0.02], [0.02, -0.02]])
    expected = (1.0 - share) * gaussian_density(at, narrow) + share * gaussian_density(at, wide)
    ratio = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        slopes = np.where(rng.random((1 << 15, 1)) < share, wide, narrow) * rng.standard_normal((1 << 15, 2))
        ratio.append(_estimated_density(slopes / slopes.std(), 1.0 / slopes.std() ** 2)(at / slopes.std()) / expected)
    error = np.std(ratio, axis=0, ddof=1) / np.sqrt(len(ratio))
    assert error.max() < 0.02
    # 0.27 % of the peak is the bias of the kernel
    assert np.all(np.abs(np.mean(ratio, axis=0) - 1.0) < 4.0 * error + 0.005)


def test_rough_walls_of_ridges_reflect_as_two_populations_of_slopes():
    steep, nodes = np.tan(np.radians(30.0)), 256
    ridges = np.abs(np.arange(nodes) % 64 - 32.0)
    made = MadeSurface("gaussian", 0.02, nodes=nodes, steps=4)
    light = vectors((0, 0))
    slopes = np.array([[steep, 0.0], [-steep, 0.0], [steep + 0.015, 0.0], [steep, 0.02], [0.0, 0.0]])
    normals = np.column_stack([-slopes, np.ones(len(slopes))])
    cosine = 1.0 / np.linalg.norm(normals, axis=1)
    viewers = 2.0 * cosine[:, np.newaxis] ** 2 * normals - light
    measured = []
    for seed in range(5):
        field = made.draw(seed)
        heights = field.heights_um + steep * field.step_x_um * ridges[:, np.newaxis]
        tracer = Tracer(HeightMap(heights, field.step_x_um, field.step_y_um, periodic=True))
        measured.append(mirror_bounces(tracer, PERFECT, light, viewers, rays=256, seed=seed).one[0, :, 0])
    walls = np.array([[steep, 0.0], [-steep, 0.0]])
    density = sum(0.5 * gaussian_density(slopes - wall, 0.02) for wall in walls)
    expected = density / (4.0 * cosine**4 * viewers[:, 2])
    error = np.std(measured, axis=0, ddof=1) / np.sqrt(len(measured))
    assert np.all(error[:4] < 0.05 * expected[:4])
    assert np.all(np.abs(np.mean(measured, axis=0) - expected) < 3.0 * error + 0.01 * expected + 1e-3)


def test_slopes_of_digital_heights_have_the_density_of_the_surface():
    field = MadeSurface("gaussian", 0.1, nodes=256).draw(1)
    light, viewers = vectors((0, 0)), vectors((0, 0), (8, 30), (14, 200))
    quantum = field.step_x_um * 0.1 / 20.0  # slopes are multiples of a twentieth of their standard deviation
    one = []
    for heights in (field.heights_um, quantum * np.round(field.heights_um / quantum)):
        surface = HeightMap(heights, field.step_x_um, field.step_y_um, periodic=True)
        one.append(mirror_bounces(Tracer(surface), PERFECT, light, viewers, rays=1024, seed=0).one[0, :, 0])
    # two roundings widen the variance of slopes by 1 / 6 of the square of their step
    np.testing.assert_allclose(one[1], one[0], rtol=0.02)


def test_flat_parts_have_no_density_of_slopes():
    field = MadeSurface("gaussian", 0.1, nodes=128).draw(1)
    cut = HeightMap(np.minimum(field.heights_um, 0.0), field.step_x_um, field.step_y_um, periodic=True)
    assert one_bounce_is_smoothed(cut)
    assert not one_bounce_is_smoothed(field)


def test_known_gaussian_slopes_take_the_noise_of_the_density_away():
    lights, viewers = vectors((20, 0)), vectors((20, 180), (10, 180), (35, 180), (0, 0))
    surface = MadeSurface("gaussian", 0.08, nodes=128)
    one = [
        mirror_bounces(
            Tracer(surface.draw(seed)), PERFECT, lights, viewers, rays=1024, seed=seed, gaussian_slopes=(0.08, 0.08)
        ).one[0, :, 0]
        for seed in (1, 2)
    ]
    half = lights + viewers
    tan2 = (half[:, 0] ** 2 + half[:, 1] ** 2) / half[:, 2] ** 2
    cos_half = 1.0 / np.sqrt(1.0 + tan2)
    expected = np.exp(-0.5 * tan2 / 0.08**2) / (2.0 * np.pi * 0.08**2)
    expected /= 4.0 * cos_half**4 * np.cos(np.radians(20.0)) * viewers[:, 2]
    # the correlation of slopes along x and y is that of the map, and not quite 0
    np.testing.assert_allclose(one, np.broadcast_to(expected, (2, 4)), rtol=0.01)


@pytest.mark.parametrize("theta_i", [20.0, 60.0, 75.0])
def test_light_of_one_bounce_is_the_light_of_paths_that_leave_after_one_bounce(steep, theta_i):
    viewers = hemisphere(600)
    light = vectors((theta_i, 70.0))
    measured = mirror_bounces(steep, PERFECT, light, viewers, rays=16384, seed=1)
    # 16384 paths that are spread evenly: the standard error of a share is below 0.004
    assert np.pi * measured.one.mean(axis=1)[0, 0] == pytest.approx(measured.escaped[0, 0, 0], abs=0.012)
    assert np.pi * measured.two.mean(axis=1)[0, 0] == pytest.approx(measured.escaped[0, 1, 0], rel=0.03, abs=2e-3)


def test_light_and_viewer_may_be_exchanged(steep):
    first, second = hemisphere(9), vectors((0, 0), (25, 100), (50, 30), (65, 300), (80, 170))
    there = mirror_bounces(steep, PERFECT, first, second, rays=256, seed=5, turned=True).one[..., 0]
    back = mirror_bounces(steep, PERFECT, second, first, rays=256, seed=5, turned=True).one[..., 0]
    assert np.count_nonzero(there) > 30
    np.testing.assert_allclose(there, back.T, rtol=1e-9)
    same = mirror_bounces(steep, PERFECT, first, first, rays=4096, seed=5)
    each = mirror_bounces(steep, PERFECT, first, np.stack([first] * 9)[:, ::-1], rays=4096, seed=5)
    np.testing.assert_allclose(same.one, each.one[:, ::-1], rtol=1e-9)
    # of later bounces the mean of both directions: within the noise of paths, and of the receivers
    np.testing.assert_allclose(same.two, same.two.transpose(1, 0, 2), rtol=1e-12)
    two = each.two[:, ::-1]
    np.testing.assert_allclose(same.two, 0.5 * (two + two.transpose(1, 0, 2)), rtol=1e-9)
    assert np.abs(two - two.transpose(1, 0, 2)).sum() < 0.4 * two.sum()


def test_f_r_at_the_mirror_direction_is_as_quiet_as_beside_it():
    # at the mirror direction of an isotropic surface the half vector is the normal, whatever the azimuth
    made = MadeSurface("gaussian", 0.2, nodes=128)
    light, viewers = vectors((80, 0)), vectors((80, 180), (76, 180))
    f_r = [
        mirror_bounces(
            Tracer(made.draw(seed)),
            PERFECT,
            light,
            viewers,
            rays=256,
            seed=seed,
            turned=True,
            gaussian_slopes=made.gaussian_slopes,
        ).one[0, :, 0]
        for seed in range(24)
    ]
    noise = np.std(f_r, axis=0, ddof=1) / np.mean(f_r, axis=0)
    # each has a standard error of 15 %; the same 16 points for all azimuths have three times the noise
    assert noise[0] < 2.0 * noise[1]


def test_facets_of_all_slopes_along_one_direction_have_no_density():
    ridge = np.random.default_rng(0).standard_normal(32)
    along_diagonal = HeightMap(0.1 * ridge[np.add.outer(np.arange(32), np.arange(32)) % 32], 1.0, 1.0, periodic=True)
    light = vectors((30, 0))
    for surface in (along_diagonal, HeightMap(np.zeros((32, 32)), 1.0, 1.0, periodic=True)):
        measured = mirror_bounces(Tracer(surface), PERFECT, light, vectors((30, 180), (30, 90)), rays=4096, seed=0)
        assert one_bounce_is_smoothed(surface)
    # the last is a plane mirror: all light reaches the receiver about the mirror direction
    expected = 1.0 / (np.pi * np.sin(CONE) ** 2 * np.cos(np.radians(30.0)))
    np.testing.assert_allclose(measured.one[0, :, 0], [expected, 0.0], rtol=1e-4)


@pytest.mark.parametrize("mirror", [1.0, 0.6, 0.3])
def test_all_light_leaves_facets_that_absorb_nothing(mirror):
    tracer = Tracer(MadeSurface("gaussian", 0.8, nodes=128).draw(0))
    facets = Facets(rho=1.0 - mirror, mirror=mirror)
    lights = vectors((10, 0), (50, 10), (85, 200))
    shares = [mirror_bounces(tracer, facets, lights, lights, rays=2048, seed=s).escaped.sum(axis=1) for s in range(12)]
    # the choice between Lambert and mirror has a probability of its own below a half; above, all paths weigh the same
    # but those that end by chance
    error = np.std(shares, axis=0, ddof=1) / np.sqrt(len(shares))
    assert error.max() < (1e-4 if mirror >= 0.5 else 0.015)
    assert np.all(np.abs(np.mean(shares, axis=0) - 1.0) < 4.0 * error + 1e-12)


@pytest.mark.parametrize("rho", [0.3, 0.7])
def test_mixed_facets_in_a_white_furnace_are_white(rho):
    tracer = Tracer(MadeSurface("gaussian", 0.7, nodes=128).draw(2))
    facets = Facets(rho=rho, mirror=1.0 - rho)
    lights, viewers = vectors((10, 0), (65, 260)), hemisphere(200)
    lambert = bounces(tracer, Facets(rho=rho), lights, viewers, rays=2048, seed=1)
    mirror = mirror_bounces(tracer, facets, lights, viewers, rays=8192, seed=1)
    total = np.pi * (lambert.total + mirror.one + mirror.two + mirror.further).mean(axis=1)[:, 0]
    np.testing.assert_allclose(total, 1.0, atol=0.02)


def test_v_grooves_send_light_once_and_twice_reflected_where_their_walls_do():
    alpha = 35.0  # walls; a viewer above sees 2 cos(2 alpha) of the light leave after one bounce, in two directions
    light = vectors((0, 0))
    viewers = vectors((2 * alpha, 0), (2 * alpha, 180), (180 - 4 * alpha, 0), (2 * alpha, 90), (0, 0))
    grooves = v_grooves(np.radians(alpha))
    measured = mirror_bounces(Tracer(grooves), PERFECT, light, viewers, rays=65536, seed=0)
    once = 2.0 * np.cos(np.radians(2.0 * alpha))
    assert one_bounce_is_smoothed(grooves)
    # a share of 65536 paths has a standard error of 0.0018 at most
    np.testing.assert_allclose(measured.escaped[0, :, 0], [once, 1.0 - once, 0.0], atol=0.006)
    receiver = np.pi * np.sin(CONE) ** 2
    expected = once / 2.0 / (receiver * np.cos(np.radians(2 * alpha)))
    np.testing.assert_allclose(measured.one[0, :, 0], [expected, expected, 0, 0, 0], rtol=0.02)
    expected = (1.0 - once) / 2.0 / (receiver * np.cos(np.radians(180 - 4 * alpha)))
    np.testing.assert_allclose(measured.two[0, :, 0], [0, 0, expected, 0, 0], rtol=0.03)


def test_reflectance_is_fresnels_at_the_half_vector():
    tracer = Tracer(gaussian_field(sigma_0_um=0.01, tau_x_um=1.0, step_um=0.2, nodes=64))
    lights = vectors((0, 0), (60, 0))
    viewers = np.stack([vectors((0, 0)), vectors((60, 180))])
    glass = mirror_bounces(tracer, Facets(mirror=0.5, n=1.5), lights, viewers, rays=256, seed=0)
    perfect = mirror_bounces(tracer, PERFECT, lights, viewers, rays=256, seed=0)
    # of n = 1.5 by hand: ((n - 1) / (n + 1))^2, and (0.420204^2 + 0.042449^2) / 2
    np.testing.assert_allclose((glass.one / perfect.one)[:, 0, 0], [0.5 * 0.04, 0.5 * 0.0891867], rtol=1e-4)
    np.testing.assert_allclose(glass.escaped[:, 0, 0], [0.02, 0.5 * 0.0891867], rtol=0.01)


def test_wavelengths_are_measured_as_each_alone(steep):
    lights, viewers = vectors((65, 40)), vectors((0, 0), (50, 220), (30, 100))
    n, k = np.array([1.4, 0.2]), np.array([1.8, 3.4])
    spectral = Facets(rho=[0.1, 0.3], mirror=0.6, n=n, k=k, wavelength_nm=[450.0, 650.0])
    both = mirror_bounces(steep, spectral, lights, viewers, rays=16384, seed=2)
    for number in (0, 1):
        single = Facets(rho=(0.1, 0.3)[number], mirror=0.6, n=n[number], k=k[number])
        alone = mirror_bounces(steep, single, lights, viewers, rays=16384, seed=2)
        np.testing.assert_allclose(both.one[..., number], alone.one[..., 0], rtol=1e-12)
        # other choices between Lambert and mirror: within the noise of 16384 paths
        np.testing.assert_allclose(both.escaped[0, :, number], alone.escaped[0, :, 0], atol=0.01)
        assert both.two[..., number].mean() == pytest.approx(alone.two.mean(), rel=0.15)


def test_regions_of_a_map_have_its_f_r_in_the_mean(steep):
    lights, viewers = vectors((40, 0)), vectors((40, 180), (20, 170), (0, 0), (60, 190))
    side = steep.sides[0]
    half = (0.0, side / 2.0, side)
    regions = [(half[i], half[i + 1], half[j], half[j + 1]) for i in (0, 1) for j in (0, 1)]
    parts = [mirror_bounces(steep, PERFECT, lights, viewers, rays=16384, seed=1, region=r).one for r in regions]
    complete = mirror_bounces(steep, PERFECT, lights, viewers, rays=16384, seed=1).one
    assert np.std(parts, axis=0).min() > 0.01 * complete.mean()
    np.testing.assert_allclose(np.mean(parts, axis=0), complete, rtol=0.06)


def test_projected_solid_angles_of_receivers():
    # pi sin^2(a) cos(theta) above the horizon; half a receiver at the horizon has a - sin(a) cos(a)
    cosine = np.cos(np.radians([0.0, 30.0, 79.9, 90.0]))
    expected = np.pi * np.sin(CONE) ** 2 * cosine
    expected[3] = CONE - np.sin(CONE) * np.cos(CONE)
    np.testing.assert_allclose(cone_projected(cosine), expected, rtol=1e-4)


def test_facets_that_reflect_nothing_are_black(steep):
    lights, viewers = vectors((40, 0)), vectors((40, 180), (0, 0))
    for facets in (Facets(mirror=1.0, n=1.0), Facets(rho=0.5)):
        measured = mirror_bounces(steep, facets, lights, viewers, rays=512, seed=0)
        assert not (measured.one + measured.two + measured.further).any()
    few = mirror_bounces(steep, PERFECT, lights, viewers, rays=1, seed=0)
    assert np.all(np.isfinite(few.one + few.two + few.further))


def test_a_flat_part_inside_one_block_of_a_measured_map_leaves_no_density() -> None:
    rough = gaussian_field(sigma_0_um=0.3, tau_x_um=1.0, step_um=0.1, nodes=256, seed=3).heights_um
    assert not one_bounce_is_smoothed(HeightMap(rough, 0.1, 0.1))
    clipped = rough.copy()
    clipped[70:100, 70:100] = 0.0  # 1.4 % of the map, a fifth of a block
    assert one_bounce_is_smoothed(HeightMap(clipped, 0.1, 0.1))
