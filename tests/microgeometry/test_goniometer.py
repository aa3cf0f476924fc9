"""The goniometer against closed forms of V-grooves, and against laws: energy, reciprocity, isotropy, scale."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import qmc

from brdfdb import models
from brdfdb.errors import ParameterError
from brdfdb.geometry import spherical_angles, unit_vector
from brdfdb.integrals.patches import BASES
from brdfdb.microgeometry import goniometer
from brdfdb.microgeometry.facets import Bounces, Facets
from brdfdb.microgeometry.goniometer import bounces, shadowed
from brdfdb.microgeometry.height_map import HeightMap
from brdfdb.microgeometry.rays import Tracer
from brdfdb.microgeometry.surfaces import MadeSurface, gaussian_field, v_grooves
from tests.microgeometry.residuals import Residuals, residuals

WHITE = Facets(rho=1.0)
PATCHES = BASES["full"].middles
NORMAL = np.array([[0.0, 0.0, 1.0]])
SLOPE = np.radians(30.0)


def cosine_directions(count: int, seed: int) -> NDArray[np.float64]:
    """Return directions with the density cos / pi."""
    u, v = qmc.Sobol(2, rng=np.random.default_rng(seed)).random(count).T
    return unit_vector(np.arcsin(np.sqrt(u)), 2.0 * np.pi * v)


def against_closed_forms(slope: float = SLOPE, estimates: int = 32, rays: int = 256) -> list[Residuals]:
    """Return the residuals of one and of two bounces of V-grooves, for nine lights and the viewers of the basis."""
    lights = unit_vector(np.radians(np.linspace(4.0, 84.0, 9)), np.radians(np.arange(9) * 23.0))
    surface = Tracer(v_grooves(slope))
    of_seeds = [bounces(surface, WHITE, lights, PATCHES, rays=rays, seed=seed) for seed in range(estimates)]
    theta_i, phi_i = spherical_angles(lights[:, np.newaxis])
    exact = models.oren_nayar_unidirectional_parts(
        theta_i, phi_i, *spherical_angles(PATCHES), rho=1.0, theta_a=slope, phi_a=0.0
    )
    return [
        residuals([by_seed.one[..., 0] for by_seed in of_seeds], exact.direct),
        residuals([by_seed.two[..., 0] for by_seed in of_seeds], exact.interreflected),
    ]


def test_v_grooves_reflect_as_the_exact_cavities() -> None:
    one, two = against_closed_forms()
    assert one.agree
    assert two.agree
    assert one.relative_error < 0.005
    assert two.relative_error < 0.1


def test_grooves_of_gaussian_slopes_in_all_azimuths_reflect_as_the_facet_integral() -> None:
    lights = unit_vector(np.radians([5.0, 40.0, 70.0]), np.zeros(3))
    viewers = BASES["quarter"].middles
    made = MadeSurface("gaussian-grooves", float(np.tan(0.45)), all_azimuths=True, nodes=256)
    of_seeds = [
        bounces(made.draw(seed), WHITE, lights, viewers, rays=512, seed=seed, turned=True) for seed in range(32)
    ]
    theta_i, phi_i = spherical_angles(lights[:, np.newaxis])
    exact = models.oren_nayar_gaussian_parts(theta_i, phi_i, *spherical_angles(viewers), rho=1.0, sigma=0.45)
    one = residuals([each.one[..., 0] for each in of_seeds], exact.direct)
    two = residuals([each.two[..., 0] for each in of_seeds], exact.interreflected)
    assert one.agree
    assert two.agree
    assert one.relative_error < 0.02


def test_white_grooves_of_30_degrees_return_these_shares_after_one_and_two_bounces() -> None:
    # a point of a wall, at s from the bottom of the groove, sees the other wall, of length 1, from the bottom to the
    # edge; of a strip without ends, the share is half the difference of the sines of these angles to the normal
    s = (np.arange(20_000) + 0.5) / 20_000
    opening = np.pi - 2.0 * SLOPE
    share = 0.5 * (1.0 + (np.cos(opening) - s) / np.hypot(np.cos(opening) - s, np.sin(opening)))
    expected = {"one": 1.0 - share.mean(), "two": 1.0 - np.mean(share**2)}
    assert expected["one"] == pytest.approx(0.8660, abs=5e-5)  # as known: the sine of 60 degrees
    assert expected["two"] == pytest.approx(0.97939, abs=5e-6)
    surface = Tracer(v_grooves(SLOPE))
    by_seed = [
        bounces(surface, WHITE, NORMAL, cosine_directions(64, 100 + seed), rays=4096, seed=seed) for seed in range(12)
    ]
    one = np.array([np.pi * each.one.mean() for each in by_seed])
    both = one + np.array([np.pi * each.two.mean() for each in by_seed])
    left = np.array([each.escaped[0, :, 0] for each in by_seed])
    assert left.sum(axis=1) == pytest.approx(1.0, abs=1e-9)
    for found, known in (
        (one, expected["one"]),
        (both, expected["two"]),
        (left[:, 0], expected["one"]),
        (left[:, 0] + left[:, 1], expected["two"]),
    ):
        error = found.std(ddof=1) / np.sqrt(len(found))
        assert error < 1e-3
        assert abs(found.mean() - known) < 3.0 * error


@pytest.fixture
def fault(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Plant a fault into the tracer or the goniometer."""
    prepare = Tracer.__init__

    def wrong_normals(self: Tracer, surface: HeightMap) -> None:
        prepare(self, surface)
        self.normals = self.normals * [1.05, 1.0, 1.0]
        self.normals /= np.linalg.norm(self.normals, axis=1, keepdims=True)

    def uniform(*at: Any) -> Any:
        return unit_vector(np.arccos(1.0 - at[1][:, 0]), 2.0 * np.pi * at[1][:, 1])

    cosines = goniometer._cosines
    faults: dict[str, tuple[Any, str, Callable[..., Any]]] = {
        "wrong normals": (Tracer, "__init__", wrong_normals),
        "no shadow rays": (Tracer, "leave", lambda *at: np.ones(len(at[1]), dtype=bool)),
        "no wrap": (Tracer, "_entering", lambda *at: at[3][:0]),
        "no cosines": (goniometer, "_cosines", lambda *at: np.sign(cosines(*at))),
        "uniform scattering": (goniometer, "_scattered", uniform),
    }
    monkeypatch.setattr(*faults[request.param])


@pytest.mark.usefixtures("fault")
@pytest.mark.parametrize(
    "fault", ["wrong normals", "no shadow rays", "no wrap", "no cosines", "uniform scattering"], indirect=True
)
def test_planted_faults_are_noticed() -> None:
    assert not all(part.agree for part in against_closed_forms(estimates=16, rays=256))


def test_a_flat_map_is_lambert() -> None:
    flat = HeightMap(np.zeros((8, 8)), 1.0, 1.0)
    result = bounces(flat, Facets(rho=0.7), PATCHES, PATCHES, rays=64, seed=1)
    np.testing.assert_allclose(result.one, 0.7 / np.pi, rtol=1e-12)
    assert not result.two.any()
    assert not result.further.any()


def test_a_white_gaussian_field_loses_no_light() -> None:
    surface = MadeSurface(slope=0.6, nodes=128, steps=8)
    light = unit_vector(np.radians([55.0]), np.radians([20.0]))
    albedos = []
    for seed in range(12):
        result = bounces(
            surface.draw(seed), WHITE, light, cosine_directions(256, seed), rays=512, seed=seed, turned=True
        )
        albedos.append(np.pi * result.total.mean())
    error = np.std(albedos, ddof=1) / np.sqrt(len(albedos))
    assert error < 0.02
    assert abs(np.mean(albedos) - 1.0) < 3.0 * error


def test_light_and_viewer_may_be_exchanged() -> None:
    lights, viewers = cosine_directions(8, 1), cosine_directions(8, 2)
    surface = Tracer(MadeSurface(slope=0.5, slope_y=0.25, nodes=256, steps=8).draw(3))
    differences = []
    for seed in range(24):
        there = bounces(surface, WHITE, lights, viewers, rays=512, seed=seed)
        back = bounces(surface, WHITE, viewers, lights, rays=512, seed=1000 + seed)
        differences.append([getattr(there, part) - np.swapaxes(getattr(back, part), 0, 1) for part in ("one", "two")])
    z = np.mean(differences, axis=0) / np.std(differences, axis=0, ddof=1) * np.sqrt(24)
    assert np.mean(np.abs(z) < 3.0) >= 0.99


def test_isotropic_surfaces_are_turned() -> None:
    pair = unit_vector(np.radians([50.0, 60.0]), np.radians([0.0, 35.0]))
    turned = unit_vector(np.radians([50.0, 60.0]), np.radians([70.0, 105.0]))
    grooves = Tracer(v_grooves(0.5))

    def seen(at: NDArray[np.float64], turn: bool) -> NDArray[np.float64]:
        return np.array(
            [bounces(grooves, WHITE, at[:1], at[1:], rays=1024, seed=seed, turned=turn).one for seed in range(12)]
        )

    one, other = seen(pair, True), seen(turned, True)
    azimuths = (np.arange(720) + 0.5) * np.pi / 720
    (ti, tr), (pi, pr) = spherical_angles(pair)
    exact = np.mean(
        [
            models.oren_nayar_unidirectional_parts(ti, pi, tr, pr, rho=1.0, theta_a=0.5, phi_a=phi_a).direct
            for phi_a in azimuths
        ]
    )
    for values in (one, other):
        assert abs(values.mean() - exact) < 3.0 * values.std(ddof=1) / np.sqrt(12)
    assert abs(seen(pair, False).mean() - seen(turned, False).mean()) > 0.05


def test_the_same_field_with_half_the_spacing_reflects_alike() -> None:
    coarse = gaussian_field(sigma_0_um=0.3, tau_x_um=1.0, step_um=0.125, nodes=128, seed=4)
    spectrum = np.fft.fftshift(np.fft.fft2(coarse.heights_um))
    heights = np.fft.ifft2(np.fft.ifftshift(np.pad(spectrum, 64))).real * 4.0
    np.testing.assert_allclose(heights[::2, ::2], coarse.heights_um, atol=1e-12)
    fine = HeightMap(heights, 0.0625, 0.0625, periodic=True)
    lights = unit_vector(np.radians([10.0, 60.0]), np.zeros(2))
    viewers = cosine_directions(32, 3)
    first, second = (
        np.array([bounces(tracer, WHITE, lights, viewers, rays=2048, seed=seed).total for seed in range(8)])
        for tracer in (Tracer(coarse), Tracer(fine))
    )
    # the same seeds: only the shape differs. The chords of the coarse field are 0.3 % less steep
    np.testing.assert_allclose(first.mean(axis=0), second.mean(axis=0), rtol=0.03)
    assert np.mean(first.mean(axis=0) / second.mean(axis=0)) == pytest.approx(1.0, abs=0.003)


def test_a_spectrum_weighs_bounces_by_powers_of_its_albedo() -> None:
    rho = np.array([0.2, 0.5, 0.9])
    facets = Facets(rho=rho, wavelength_nm=np.array([450.0, 550.0, 650.0]))
    surface = v_grooves(0.9)
    lights = cosine_directions(4, 1)
    spectrum = bounces(surface, facets, lights, PATCHES, rays=256, seed=2)
    white = bounces(surface, WHITE, lights, PATCHES, rays=256, seed=2)
    np.testing.assert_allclose(spectrum.one, white.one * rho, rtol=1e-12)
    np.testing.assert_allclose(spectrum.two, white.two * rho**2, rtol=1e-12)
    for number, albedo in enumerate(rho):
        grey = bounces(surface, Facets(rho=albedo), lights, PATCHES, rays=256, seed=2)
        np.testing.assert_allclose(spectrum.further[..., number], grey.further[..., 0], rtol=1e-12)
    assert not bounces(surface, Facets(), lights, PATCHES, rays=16, seed=2).total.any()


def test_one_bounce_of_mixed_facets_is_the_mixture_of_both() -> None:
    made = MadeSurface(slope=0.4, nodes=64, steps=6)
    lights = unit_vector(np.radians([20.0, 50.0]), np.zeros(2))

    def one(facets: Facets) -> NDArray[np.float64]:
        return bounces(
            made.draw(1),
            facets,
            lights,
            BASES["quarter"].middles,
            rays=64,
            seed=2,
            turned=True,
            gaussian_slopes=made.gaussian_slopes,
            region=(0.0, 6.0, 0.0, 6.0),
        ).one

    body, surface = one(WHITE), one(Facets(mirror=1.0, n=1.5))
    np.testing.assert_allclose(one(Facets(rho=0.3, mirror=0.5, n=1.5)), 0.3 * body + 0.5 * surface, rtol=1e-9)
    assert np.all(body > 0.0)
    assert surface.max() > 0.01


def test_viewers_of_each_light_and_of_all_lights_agree() -> None:
    lights = cosine_directions(4, 1)
    surface = v_grooves(0.7)
    shared = bounces(surface, WHITE, lights, PATCHES, rays=128, seed=2)
    each = bounces(surface, WHITE, lights, np.broadcast_to(PATCHES, (4, *PATCHES.shape)), rays=128, seed=2)
    np.testing.assert_allclose(shared.one, each.one, rtol=1e-9)
    assert shared.total.shape == each.total.shape == (4, 145, 1)


def test_the_seed_decides() -> None:
    surface = Tracer(MadeSurface(slope=0.4, nodes=64, steps=6).draw(1))

    def measured(seed: int) -> Bounces:
        return bounces(surface, WHITE, PATCHES[::9], PATCHES[::7], rays=128, seed=seed)

    np.testing.assert_array_equal(measured(1).total, measured(1).total)
    assert np.all(measured(1).total != measured(2).total)


def test_the_height_above_the_instrument_does_not_matter() -> None:
    low = MadeSurface(slope=0.4, nodes=64, steps=6).draw(1)
    high = replace(low, heights_um=low.heights_um + 1e6)
    first, second = (bounces(at, WHITE, PATCHES[::9], PATCHES[::7], rays=256, seed=1).total for at in (low, high))
    np.testing.assert_allclose(first, second, rtol=0.01)


@pytest.mark.parametrize("theta_deg", [20.0, 65.0, 80.0])
def test_shadowing_of_grooves_is_that_of_torrance_and_sparrow(theta_deg: float) -> None:
    theta = np.radians(theta_deg)
    shares = shadowed(v_grooves(SLOPE), unit_vector(theta, np.array([0.0, 0.5 * np.pi])), rays=4096, seed=1)
    across = np.sin(SLOPE) * np.tan(theta)
    # Torrance and Sparrow 1967: the lit part of the wall that faces the light, once the other does not
    lit = min(1.0, 2.0 * np.cos(SLOPE) / (np.cos(SLOPE) + across))
    np.testing.assert_allclose(shares, [1.0 - lit, 0.0], atol=1e-3)


@pytest.mark.parametrize(
    ("arguments", "parameter"),
    [
        ({"lights": np.array([[0.0, 0.0, 1.1]])}, "lights"),
        ({"lights": np.array([[1.0, 0.0, 0.0]])}, "lights"),
        ({"viewers": np.array([[0.0, 0.6, -0.8]])}, "viewers"),
        ({"viewers": np.array([[np.nan, 0.0, 1.0]])}, "viewers"),
        ({"viewers": np.ones((3, 2))}, "viewers"),
        ({"viewers": np.empty((0, 3))}, "viewers"),
        ({"viewers": np.broadcast_to(NORMAL, (2, 1, 3))}, "viewers"),
        ({"rays": 0}, "rays"),
        ({"region": (0.0, 9.0, 0.0, 1.0)}, "region"),
        ({"region": (1.0, 1.0, 0.0, 1.0)}, "region"),
        ({"region": (np.nan, 1.0, 0.0, 1.0)}, "region"),
    ],
)
def test_bad_arguments_are_refused(arguments: dict[str, Any], parameter: str) -> None:
    given = {"lights": NORMAL, "viewers": NORMAL, "rays": 4, "seed": 0, **arguments}
    with pytest.raises(ParameterError) as refused:
        bounces(v_grooves(0.5), WHITE, **given)
    assert refused.value.parameter == parameter


def test_light_first_meets_the_region_alone() -> None:
    heights = np.zeros((32, 32))
    heights[16:] = np.where(np.arange(16) % 2 == 0, 0.0, -0.5)[:, np.newaxis]
    surface = HeightMap(heights, 1.0, 1.0, periodic=True)
    viewer = unit_vector(np.radians([[30.0]]), np.zeros((1, 1)))[0]
    flat = bounces(surface, WHITE, NORMAL, viewer, rays=256, seed=0, region=(4.0, 12.0, 0.0, 32.0))
    rough = bounces(surface, WHITE, NORMAL, viewer, rays=256, seed=0, region=(18.0, 28.0, 0.0, 32.0))
    np.testing.assert_allclose(flat.one, 1.0 / np.pi, rtol=1e-12)
    assert flat.two.sum() == 0.0
    assert rough.two.sum() > 0.0
    assert replace(surface, periodic=False).width_um == 31.0


def test_a_part_of_a_sawtooth_reflects_as_the_periodic_sawtooth() -> None:
    tooth = 6.0 * np.minimum(np.arange(16) / 12.0, (16 - np.arange(16)) / 4.0)
    profile = np.tile(tooth, 10)[:, np.newaxis] + np.zeros((160, 8))
    directions = unit_vector(np.radians([50.0, 50.0, 75.0, 75.0]), np.array([0.0, np.pi, 0.0, np.pi]))
    periodic, part = [
        bounces(surface, Facets(rho=0.9), directions, directions, rays=8192, seed=1).total[..., 0]
        for surface in (
            HeightMap(profile, 1.0, 1.0, periodic=True),
            HeightMap(profile[5:134], 1.0, 1.0),  # eight periods
        )
    ]
    np.testing.assert_allclose(part, periodic, rtol=0.03)
    assert part[3, 3] < 0.8 * part[2, 2]  # its gentle sides face -x, its steep sides +x


def test_parts_of_a_surface_shade_themselves_as_the_surface() -> None:
    kind, low = MadeSurface(slope=0.4, nodes=160, steps=8), unit_vector(np.radians([75.0, 82.0]), np.zeros(2))
    fields = [kind.draw(seed) for seed in range(30)]
    parts = [HeightMap(field.heights_um[:40], field.step_x_um, field.step_y_um) for field in fields]
    of_fields, of_parts = (
        np.array([shadowed(each, low, rays=256, seed=seed, turned=True) for seed, each in enumerate(surfaces)])
        for surfaces in (fields, parts)
    )
    error = np.hypot(of_fields.std(axis=0, ddof=1), of_parts.std(axis=0, ddof=1)) / np.sqrt(30)
    assert np.all(error < 0.015)
    assert np.all(np.abs(of_parts.mean(axis=0) - of_fields.mean(axis=0)) < 3.0 * error)


def test_no_light_is_scattered_by_facets_that_are_mirrors_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(goniometer, "_starts", lambda *_: pytest.fail("a path of Lambert's law was started"))
    lights = unit_vector(np.radians([20.0]), np.zeros(1))
    surface = MadeSurface(slope=0.3, nodes=64, steps=6).draw(1)
    assert bounces(surface, Facets(rho=0.0, mirror=1.0), lights, lights, rays=256, seed=1).one[0, 0, 0] > 0.0
