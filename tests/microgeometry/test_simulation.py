"""Simulations: independent estimates, their means and standard errors, blocks of a single map, and the stop rule."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from brdfdb.errors import ParameterError
from brdfdb.geometry import unit_vector
from brdfdb.integrals.patches import BASES
from brdfdb.microgeometry.facets import Bounces, Facets
from brdfdb.microgeometry.height_map import HeightMap
from brdfdb.microgeometry.simulation import PARTS, Simulation
from brdfdb.microgeometry.surfaces import MadeSurface

LIGHTS = unit_vector(np.radians([15.0, 60.0]), np.array([0.3, 0.3]))
VIEWERS = BASES["quarter"].middles
FIELD = MadeSurface(slope=0.4, nodes=64, steps=6)
MADE = Simulation(FIELD, Facets(rho=0.8), LIGHTS, VIEWERS, rays=256)
SINGLE = replace(MADE, surface=replace(FIELD.draw(1), periodic=False), rays=128)


def numbered(simulation: Simulation, values: list[float]) -> list[Bounces]:
    """Return estimates whose three parts have these values, twice them and three times them."""
    ones = np.ones((len(simulation.lights), len(simulation.viewers), 1))
    escaped = np.zeros((len(simulation.lights), 3, 1))
    return [Bounces(ones * value, 2.0 * ones * value, 3.0 * ones * value, escaped) for value in values]


@pytest.mark.parametrize("simulation", [MADE, SINGLE])
def test_an_estimate_depends_on_its_number_alone(simulation: Simulation) -> None:
    third = simulation.estimate(3)
    np.testing.assert_array_equal(simulation.estimate(3).total, third.total)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(simulation)).estimate(3).total, third.total)
    assert not np.array_equal(simulation.estimate(4).total, third.total)
    assert not np.array_equal(replace(simulation, seed=1).estimate(3).total, third.total)


def test_facets_in_shadow_are_counted() -> None:
    lights = unit_vector(np.radians([20.0, 80.0]), np.zeros(2))
    grooves = replace(MADE, surface=MadeSurface("grooves", 0.5), lights=lights, rays=2048)
    # Torrance and Sparrow 1967, of a light that reaches one wall alone: 2 cos / (cos + sin tan(theta)) of it are lit
    lit = 2.0 / (1.0 + 0.5 * np.tan(np.radians(80.0)))
    np.testing.assert_allclose(grooves.shadowed(), [0.0, 1.0 - lit], atol=1e-3)
    single = replace(grooves, surface=MadeSurface("grooves", 0.5).draw(0))
    np.testing.assert_allclose(single.shadowed(), [0.0, 1.0 - lit], atol=1e-3)


def test_means_and_errors_of_made_surfaces_are_those_of_the_estimates() -> None:
    brdf = MADE.combined(numbered(MADE, [1.0, 2.0, 4.0, 5.0]))
    assert brdf.count == 4
    for part, scale in zip(PARTS, (1.0, 2.0, 3.0, 6.0), strict=True):
        estimated = getattr(brdf, part)
        np.testing.assert_allclose(estimated.mean, 3.0 * scale, rtol=1e-12)
        np.testing.assert_allclose(estimated.error, np.sqrt(10.0 / 3.0 / 4.0) * scale, rtol=1e-12)
        np.testing.assert_array_equal(estimated.noise, estimated.error)
    assert brdf.standard_errors.judged == pytest.approx(np.sqrt(10.0 / 12.0) / 3.0)


def test_errors_of_a_single_map_are_those_of_its_blocks_and_noise_is_that_within_them() -> None:
    simulation = replace(SINGLE, blocks=2)
    brdf = simulation.combined(numbered(simulation, [1.0, 2.0, 3.0, 4.0, 1.2, 1.8, 3.2, 3.8]))
    np.testing.assert_allclose(brdf.one.mean, 2.5, rtol=1e-12)
    # means of blocks 1.1, 1.9, 3.1, 3.9; each pair is 0.2 wide, whose variance is 0.02
    error = simulation.widening * np.std([1.1, 1.9, 3.1, 3.9], ddof=1) / 2.0
    np.testing.assert_allclose(brdf.one.error, error, rtol=1e-12)
    np.testing.assert_allclose(brdf.one.noise, np.sqrt(0.02 / 8.0), rtol=1e-9)


def test_errors_of_narrow_blocks_are_widened_by_the_correlation_of_their_neighbours() -> None:
    wave = 2.0 * np.pi / 40.0 * np.arange(41.0)
    surface = HeightMap(np.add.outer(np.sin(wave), np.sin(wave)), 1.0, 1.0)
    simulation = replace(SINGLE, surface=surface, blocks=2)
    tau = surface.realised().tau_x_um
    x = (np.arange(400) + 0.5) / 10.0
    correlation = np.exp(-((np.subtract.outer(x, x) / tau) ** 2))
    of_map, of_block = correlation.mean() ** 2, correlation[:200, :200].mean() ** 2
    # spread of four blocks about their mean, in the mean: 4 / 3 of what the map's mean lacks of the block's variance
    expected = np.sqrt(of_map / (4.0 / 3.0 * (of_block - of_map) / 4.0))
    assert simulation.widening == pytest.approx(expected, rel=1e-3)
    assert expected > 1.3
    assert MADE.widening == 1.0
    many = HeightMap(np.random.default_rng(1).random((256, 256)), 1.0, 1.0)
    assert replace(SINGLE, surface=many).widening == pytest.approx(1.0, abs=0.02)


def test_shadows_that_are_longer_than_a_map_are_said() -> None:
    heights = np.random.default_rng(1).standard_normal((21, 41))
    small = replace(SINGLE, surface=HeightMap(heights / heights.std(), 1.0, 1.0))
    # shadows of 4 um at the cotangent 4 / 20 are 20 um long
    assert small.shadows == ""
    low = replace(small, viewers=unit_vector(np.radians([80.0]), np.zeros(1)))
    brdf = low.combined(numbered(low, [1.0] * 32))
    assert "beyond 79 degrees shadows may be longer than the map" in low.shadows
    assert brdf.samples("map").record["shadows"] == low.shadows
    assert replace(low, surface=replace(low.surface, periodic=True)).shadows == ""
    assert replace(low, surface=FIELD).shadows == ""


def test_a_single_map_states_how_far_it_is_from_its_kind_of_surface() -> None:
    facets, viewers = Facets(rho=1.0), unit_vector(np.radians([70.0, 70.0]), np.array([0.0, np.pi]))
    kind = MadeSurface(slope=0.5, nodes=128, steps=4)
    made = Simulation(kind, facets, LIGHTS[1:], viewers, rays=512, least=32, most=32).run()
    single = [replace(made.simulation, surface=kind.draw(1000 + number), rays=64).run() for number in range(12)]
    z = np.array([(each.one.mean - made.one.mean) / np.hypot(each.one.error, made.one.error) for each in single])
    assert 0.4 < np.sqrt(np.mean(z**2)) < 1.8
    noise = np.mean([each.one.noise for each in single], axis=0)
    assert np.all(noise < 0.8 * np.mean([each.one.error for each in single], axis=0))


def test_estimates_are_added_until_the_error_is_below_the_target() -> None:
    seen: list[tuple[int, float | None]] = []
    simulation = replace(MADE, target=0.03, least=8)
    brdf = simulation.run(progress=lambda count, error: seen.append((count, error)))
    errors = [(count, error) for count, error in seen if error is not None]
    assert brdf.standard_errors.judged <= 0.03
    assert brdf.count == errors[-1][0] > 8
    assert all(error > 0.03 for _, error in errors[:-1])
    assert errors[-1][1] == pytest.approx(brdf.standard_errors.judged)
    assert [count for count, error in seen if error is None] == list(range(1, brdf.count + 1))
    serial = simulation.combined([simulation.estimate(number) for number in range(brdf.count)])
    np.testing.assert_array_equal(serial.total.mean, brdf.total.mean)


def test_a_simulation_ends_with_as_many_estimates_as_allowed() -> None:
    brdf = replace(MADE, target=1e-4, least=4, most=8).run()
    assert brdf.count == 8
    assert brdf.standard_errors.judged > 1e-4


def test_never_fewer_estimates_than_the_minimum() -> None:
    flat = replace(MADE, surface=HeightMap(np.zeros((8, 8)), 1.0, 1.0), least=40)
    assert flat.minimum == 48  # three rounds of 16 blocks
    brdf = flat.run()
    assert brdf.count == 48
    assert brdf.standard_errors.judged < 1e-7
    np.testing.assert_allclose(brdf.total.mean, 0.8 / np.pi, rtol=1e-12)


def test_the_relative_error_leaves_dark_pairs_out() -> None:
    def estimate(bright: float, dim: float) -> Bounces:
        values = np.array([[[bright], [dim]]])
        return Bounces(values, 0.0 * values, 0.0 * values, np.zeros((len(values), 3, 1)))

    simulation = replace(MADE, lights=LIGHTS[:1], viewers=VIEWERS[:2])
    brdf = simulation.combined([estimate(1.0, 0.001), estimate(1.02, 0.009)])
    assert brdf.standard_errors.judged == pytest.approx(0.01 / 1.01)


def test_a_spectrum_becomes_samples_with_their_uncertainty() -> None:
    facets = Facets(rho=[0.2, 0.8], wavelength_nm=[450.0, 650.0])
    brdf = replace(MADE, facets=facets, least=4, most=4).run()
    samples = brdf.samples("a field")
    assert len(samples) == 2 * len(VIEWERS)
    assert samples.channels == ("450nm", "650nm")
    np.testing.assert_array_equal(samples.values, brdf.total.mean.reshape(-1, 2))
    np.testing.assert_array_equal(samples.uncertainty, brdf.total.error.reshape(-1, 2))
    np.testing.assert_allclose(samples.w_i[len(VIEWERS)], LIGHTS[1], atol=1e-12)
    np.testing.assert_allclose(samples.w_r[len(VIEWERS) :], VIEWERS, atol=1e-12)
    assert samples.record["surface"]["slope"] == 0.4
    grey = MADE.combined(numbered(MADE, [1.0, 2.0])).samples("grey", "two")
    assert grey.channels == ("grey",)
    assert np.all(grey.values == 3.0)


@pytest.mark.parametrize(
    ("arguments", "parameter"),
    [
        ({"rays": 0}, "rays"),
        ({"blocks": 1}, "blocks"),
        ({"target": 0.0}, "target"),
        ({"target": np.nan}, "target"),
        ({"seed": -1}, "seed"),
        ({"least": 1}, "least"),
        ({"most": 15}, "most"),
        ({"surface": SINGLE.surface, "most": 31}, "most"),
    ],
)
def test_simulations_that_cannot_be_run_are_refused(arguments: dict[str, Any], parameter: str) -> None:
    with pytest.raises(ParameterError) as refused:
        replace(MADE, **arguments)
    assert refused.value.parameter == parameter


@pytest.mark.parametrize(("simulation", "count"), [(MADE, 1), (SINGLE, 16), (SINGLE, 40)])
def test_incomplete_rounds_are_refused(simulation: Simulation, count: int) -> None:
    with pytest.raises(ParameterError, match="estimates"):
        simulation.combined(numbered(simulation, [1.0] * count))
