"""Statistics of measured surfaces: intervals contain what made maps are known to have, and faults are named."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from brdfdb.errors import ParameterError
from brdfdb.microgeometry.height_map_files import MeasuredHeights, read_heights
from brdfdb.microgeometry.levelling import LevellingOptions, fill_holes, levelled
from brdfdb.microgeometry.model_errors import SurfaceError, suited_parameters, surface_error_of
from brdfdb.microgeometry.surface_models import (
    ModelStanding,
    index_entry,
    spatial_band,
    standings,
    surface_materials,
)
from brdfdb.microgeometry.topography import SurfaceStatistics, surface_statistics, uncertain
from brdfdb.models import MODELS
from brdfdb.parameters import HeightRelation, Standing, StatedLimit, SurfaceAssumption
from tests.microgeometry.made_maps import TWELVE, MadeMap, write

MADE = MadeMap(nodes=(160, 160), noise=0.02)
# Of the 60 intervals of twelve maps, each 95 %, fewer than 52 contain the truth in 1 of 1000 draws
LEAST_INSIDE = 52


def statistics(made: MadeMap, seed: int = 0, **options: float) -> SurfaceStatistics:
    return surface_statistics(levelled(made.measured(seed)), **options)  # type: ignore[arg-type]


def test_twelve_files_have_their_known_statistics_inside_the_intervals(tmp_path: Path) -> None:
    inside, wide = [], []
    for seed, made in enumerate(TWELVE):
        path = tmp_path / f"map.{made.file}"
        options = write(path, made.measured(seed))
        found = surface_statistics(levelled(read_heights(path, options)))
        for name, true in made.truth().items():
            value, low, high = getattr(found, name)
            inside.append(low <= true <= high)
            wide.append((high - low) / 2.0 / value)
            assert abs(value / true - 1.0) < 0.3, (made, name)
    assert len(inside) == 60
    assert sum(inside) >= LEAST_INSIDE
    assert np.median(wide) < 0.12


def test_noise_is_estimated_and_taken_out_of_heights_and_slopes() -> None:
    # slopes of 0.5 / sqrt(2) um in 0.5 um would be noise of sqrt(2) 0.1 / 0.5 = 0.28 beside those of 0.14
    made = replace(MADE, noise=0.1, nodes=(192, 192))
    found = statistics(made)
    assert found.noise.kind == "estimated"
    assert found.noise.sigma_um == pytest.approx(0.1, rel=0.05)
    assert found.slope_x.low <= made.truth()["slope_x"] <= found.slope_x.high
    assert found.slope_x.high < 0.18
    given = statistics(made, noise_um=0.1)
    assert given.noise.kind == "given"
    assert given.slope_x.value == pytest.approx(found.slope_x.value, rel=0.05)


def test_noise_that_roughness_hides_widens_the_intervals() -> None:
    made = MadeMap("exponential", noise=0.05, nodes=(192, 192))
    found = statistics(made)
    assert found.noise.kind == "not separable"
    assert found.noise.sigma_um > 0.05
    true = made.truth()["slope_x"]
    assert found.slope_x.low <= true <= found.slope_x.high
    narrower = statistics(made, noise_um=0.05)
    assert narrower.slope_x.low <= true <= narrower.slope_x.high
    assert narrower.slope_x.high - narrower.slope_x.low < 0.2 * (found.slope_x.high - found.slope_x.low)
    assert any("rough down to the pixel" in sentence for sentence in uncertain(levelled(made.measured(0)), found))


@pytest.mark.parametrize(
    ("correlation", "words"),
    [("gaussian", "Gaussian"), ("exponential", "exponential"), ("band", "steeper than Gaussian")],
)
def test_the_form_of_the_correlation_is_told(correlation: str, words: str) -> None:
    found = statistics(MadeMap(correlation, nodes=(256, 256), tau_x=4.0, tau_y=4.0, sigma=0.3))
    assert words in found.form


def test_levelling_takes_the_variance_that_is_added_again() -> None:
    # Share of the variance along 1, x and y of a square of side L: about 3 pi tau^2 / L^2 of a Gaussian correlation
    made = replace(MADE, noise=0.0, tau_x=8.0, tau_y=8.0)
    found = [statistics(made, seed) for seed in range(12)]
    assert np.mean([one.lost for one in found]) == pytest.approx(3.0 * math.pi * 8.0**2 / 80.0**2, rel=0.25)
    ratio = np.array([one.sigma_0_um.value for one in found]) / made.sigma
    bare = np.array([np.std(levelled(made.measured(seed)).measured.heights_um) for seed in range(12)]) / made.sigma
    assert abs(ratio.mean() - 1.0) < abs(bare.mean() - 1.0)


def test_anisotropy_and_its_direction() -> None:
    found = statistics(replace(MADE, tau_x=6.0, tau_y=3.0))
    assert found.anisotropy.significant
    assert found.anisotropy.ratio == pytest.approx(2.0, rel=0.15)
    assert found.anisotropy.direction_deg == pytest.approx(90.0, abs=5.0)
    assert not statistics(MADE).anisotropy.significant
    # lines of equal height along x + y: slopes are largest at 45 degrees
    x, y = np.meshgrid(np.arange(160.0), np.arange(160.0), indexing="ij")
    lines = np.interp(x + y, np.arange(320), MADE.surface(3)[:, 0].repeat(2))
    made = MeasuredHeights(lines + 0.3 * MADE.surface(4), 0.5, 0.5)
    ready = levelled(made)
    oblique = surface_statistics(ready)
    assert oblique.anisotropy.direction_deg == pytest.approx(45.0, abs=3.0)
    assert any("45 degrees from x" in sentence or "oblique" in sentence for sentence in uncertain(ready, oblique))


def test_distributions_that_are_not_gaussian_are_told() -> None:
    even = statistics(MADE)
    assert even.slopes_x is not None
    assert even.heights.gaussian
    assert even.slopes_x.gaussian
    ready = levelled(MeasuredHeights(-np.exp(2.0 * MADE.surface(0)), 0.5, 0.5), LevellingOptions(outliers="keep"))
    found = surface_statistics(ready)
    assert found.heights.skewness < -3.0 * found.heights.skewness_error
    assert not found.heights.gaussian
    # the variance of a square grows with the kurtosis
    widths = [math.log(one.sigma_0_um.high / one.sigma_0_um.low) for one in (found, even)]
    assert widths[0] > 1.5 * widths[1]
    assert any("heights are not Gaussian" in sentence for sentence in uncertain(ready, found))


def test_a_surface_of_two_roughnesses_widens_the_intervals_by_its_blocks() -> None:
    rise = 1.0 + 3.0 / (1.0 + np.exp(-(np.arange(160.0) - 80.0) / 4.0))
    z = MADE.surface(0) * rise[:, np.newaxis]
    ready = levelled(MeasuredHeights(z, 0.5, 0.5))
    found = surface_statistics(ready)
    even = statistics(MADE)
    assert found.scatter["slope_x"].factor > 2.0
    assert even.scatter["slope_x"].factor == 1.0
    relative = [(one.slope_x.high - one.slope_x.low) / one.slope_x.value for one in (found, even)]
    assert relative[0] > 1.5 * relative[1]
    assert any("not homogeneous" in sentence for sentence in uncertain(ready, found))


# Faults of maps


def test_a_tilt_is_measured_and_taken_out() -> None:
    made = replace(MADE, tilt=(math.tan(math.radians(3.0)), 0.0), noise=0.0)
    ready = levelled(made.measured(0))
    assert ready.tilt_deg == pytest.approx(3.0, abs=0.3)
    flat = levelled(replace(made, tilt=(0.0, 0.0)).measured(0))
    assert np.allclose(ready.measured.heights_um, flat.measured.heights_um, atol=1e-9)


def test_a_bowl_needs_a_quadratic_surface() -> None:
    x = np.linspace(-1.0, 1.0, 160)
    bowl = MeasuredHeights(MADE.surface(0) + 20.0 * x[:, np.newaxis] ** 2, 0.5, 0.5)
    ready = levelled(bowl, LevellingOptions("quadratic"))
    assert np.std(ready.measured.heights_um) < 1.1 * MADE.sigma
    assert surface_statistics(ready).lost > statistics(MADE).lost
    assert np.std(levelled(bowl).measured.heights_um) > 5.0


def test_outliers_are_refused_left_out_or_kept() -> None:
    z = MADE.surface(0)
    z[40, 50] += 5.0
    z[90:92, 20:22] -= 4.0
    made = MeasuredHeights(z, 0.5, 0.5)
    with pytest.raises(ParameterError, match=r"5 heights of 25600 are outliers, the first at node \(40, 50\)") as found:
        levelled(made)
    assert found.value.parameter == "outliers"
    left = levelled(made, LevellingOptions(outliers="leave-out"))
    assert (left.outliers, left.left_out, left.measured.holes) == (5, 5, 5)
    kept = levelled(made, LevellingOptions(outliers="keep"))
    assert (kept.outliers, kept.left_out, kept.measured.holes) == (5, 0, 0)
    assert "outliers are kept" in uncertain(kept, surface_statistics(kept))[0]


@pytest.mark.parametrize("axis", [0, 1])
def test_steps_are_refused_removed_or_kept(axis: int) -> None:
    z = MADE.surface(0)
    (z if axis == 0 else z.T)[70:] += 0.4
    made = MeasuredHeights(z, 0.5, 0.5)
    with pytest.raises(ParameterError, match=rf"jumps by 0\.[34]\d* um at {'xy'[axis]} = 34\.75 um") as found:
        levelled(made)
    assert found.value.parameter == "steps"
    mended = levelled(made, LevellingOptions(steps="remove"))
    assert [(step.axis, step.node) for step in mended.steps] == [(axis, 69)]
    known = levelled(MeasuredHeights(MADE.surface(0), 0.5, 0.5)).measured.heights_um
    assert np.abs(mended.measured.heights_um - known).max() < 0.05
    kept = levelled(made, LevellingOptions(steps="keep"))
    assert any("steps are kept" in sentence for sentence in uncertain(kept, surface_statistics(kept)))


def test_holes_are_left_out_filled_or_refused() -> None:
    made = replace(MADE, holes=0.05, noise=0.0)
    known = made.surface(0)
    holes = ~np.isfinite(made.measured(0).heights_um)
    left = levelled(made.measured(0))
    assert (left.holes, left.filled, left.measured.holes) == (holes.sum(), 0, holes.sum())
    with pytest.raises(ParameterError, match=r"heights_um: .* heights are holes"):
        left.height_map()
    filled = levelled(made.measured(0), LevellingOptions(holes="fill"))
    assert (filled.filled, filled.measured.holes) == (holes.sum(), 0)
    assert filled.height_map().heights_um.shape == known.shape
    error = fill_holes(made.measured(0).heights_um)[holes] - known[holes]
    assert np.sqrt(np.mean(error**2)) < 0.05 * made.sigma
    assert "interpolated" in uncertain(filled, surface_statistics(filled))[0]
    with pytest.raises(ParameterError, match=f"{holes.sum()} of 25600 heights are holes; allowed is none"):
        levelled(made.measured(0), LevellingOptions(holes="refuse"))
    with pytest.raises(ParameterError, match="60 % of the heights are holes; allowed are up to 50 %"):
        levelled(replace(MADE, holes=0.6).measured(0))


def test_a_plane_through_holes_is_filled_exactly() -> None:
    x, y = np.meshgrid(np.arange(40.0), np.arange(30.0), indexing="ij")
    plane = 0.3 * x - 0.1 * y
    holed = plane.copy()
    holed[10:15, 5:9] = holed[30, 20] = np.nan
    assert np.allclose(fill_holes(holed), plane)


@pytest.mark.parametrize(
    ("made", "options", "sentence"),
    [
        (replace(MADE, tau_x=16.0, tau_y=16.0), {}, "lengths of correlation of .* um; at least 8 are needed"),
        (
            replace(MADE, tau_x=0.6, tau_y=0.6, noise=0.0),
            {},
            "pixels; 2 or more are needed: measure with a smaller pixel",
        ),
        (MADE, {"noise_um": 3.0}, "3 um is not at least 0 and below "),
        (MADE, {"noise_um": -1.0}, "-1 um is not at least 0"),
        # neighbours of a smooth surface differ by less than the noise would make them differ
        (
            replace(MADE, noise=0.0),
            {"noise_um": 0.1},
            "0.1 um is not .* below 0.0.* um, the largest noise that the map",
        ),
    ],
)
def test_maps_that_are_too_small_or_coarse_are_refused(made: MadeMap, options: dict[str, float], sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence):
        statistics(made, **options)


def test_slopes_that_no_instrument_measures_are_doubted() -> None:
    measured = MADE.measured(0)
    as_um = levelled(replace(measured, heights_um=1e3 * measured.heights_um))  # nanometres read as micrometres
    assert any(
        "are the units of heights and pixels right?" in words for words in uncertain(as_um, surface_statistics(as_um))
    )
    right = levelled(measured)
    assert not any("units" in words for words in uncertain(right, surface_statistics(right)))


def test_flat_maps_and_unknown_options_are_refused() -> None:
    with pytest.raises(ParameterError, match="all heights are the same"):
        levelled(MeasuredHeights(np.ones((64, 64)), 1.0, 1.0))
    with pytest.raises(ParameterError, match="level: 'cubic' is not one of none, plane, quadratic"):
        LevellingOptions("cubic")  # type: ignore[arg-type]


def test_few_lengths_are_a_warning_and_a_texture_has_no_tau_along_it() -> None:
    short = statistics(replace(MADE, tau_x=5.5, tau_y=5.5))
    assert any("lengths of correlation along x" in one for one in uncertain(levelled(MADE.measured(0)), short))
    made = replace(MADE, tau_x=3.0, tau_y=30.0)
    found = statistics(made)
    assert found.tau_y_um is None
    assert found.tau_x_um is not None
    assert any("no tau is stated" in one for one in uncertain(levelled(made.measured(0)), found))


def test_grooves_have_slopes_across_alone() -> None:
    walls = 0.3 * np.abs(np.arange(200.0) % 20.0 - 10.0)  # 0.3 um a step of 0.5 um
    found = surface_statistics(levelled(MeasuredHeights(np.repeat(walls[:, np.newaxis], 160, axis=1), 0.5, 0.5)))
    assert found.slope_x.value == pytest.approx(0.6, abs=1e-4)
    assert found.slope_y.value == pytest.approx(0.0, abs=1e-9)
    assert found.tau_y_um is found.slopes_y is None
    assert found.slopes_x is not None
    assert found.slopes_x.kurtosis == pytest.approx(1.0, abs=0.01)  # two slopes of equal probability
    left_out = surface_materials(found, "grooves").left_out
    assert left_out["ggx"].startswith("alpha_y: ")


def test_holes_without_neighbours_are_refused() -> None:
    z = MADE.surface(0)
    z[::2, ::2] = z[1::2, 1::2] = np.nan
    with pytest.raises(ParameterError, match="holes leave 0 pairs of neighbours; at least 500 are needed"):
        surface_statistics(levelled(MeasuredHeights(z, 0.5, 0.5)))


# Models


def test_materials_have_the_statistics_of_the_surface() -> None:
    found = statistics(MADE)
    materials = surface_materials(found, "plate", entry="main/Cu/Babar", rho=0.8).materials
    assert sorted(materials) == ["beckmann", "ggx", "he_torrance", "oren_nayar"]
    assert materials["he_torrance"].parameters["sigma_0_um"] == pytest.approx(found.sigma_0_um.value, rel=1e-5)
    assert materials["he_torrance"].parameters["tau_um"] == pytest.approx(found.tau_um, rel=1e-5)
    assert materials["oren_nayar"].parameters["sigma"] == pytest.approx(found.slope, rel=1e-5)
    assert materials["oren_nayar"].parameters["rho"] == 0.8
    for model in ("ggx", "beckmann"):  # isotropic within chance: a single alpha
        for axis in ("alpha_x", "alpha_y"):
            assert materials[model].parameters[axis] == pytest.approx(math.sqrt(2.0) * found.slope, rel=1e-5)


def test_assumptions_are_judged_by_the_surface_and_the_wavelength() -> None:
    found = statistics(MADE)
    judged = {
        (one.model, one.wavelength_nm): one.worst
        for one in standings(found, surface_materials(found, "plate").materials)
    }
    # sigma_0 0.5 um: g is 130 at 550 nm and 0.35 at 10.6 um, where tau is also below the wavelength
    assert judged["beckmann", 550.0] == "inside"
    assert judged["oren_nayar", 550.0] == "inside"
    assert judged["ggx", 550.0] == "outside"  # Gaussian slopes
    assert judged["beckmann", 10600.0] == judged["oren_nayar", 10600.0] == "outside"
    rough = statistics(MadeMap("exponential", nodes=(192, 192)))
    of_he = next(
        one
        for one in standings(rough, surface_materials(rough, "plate").materials)
        if (one.model, one.wavelength_nm) == ("he_torrance", 550.0)
    )
    assert {"outside"} == {limit.standing for limit in of_he.limits if limit.quantity.startswith("exponent H")}
    assert "slope sigma_0 / tau" in {limit.quantity for limit in of_he.limits}  # stated of the parameters


@pytest.mark.parametrize(
    ("standings_of_limits", "worst"),
    [
        (("inside", "at the edge", "unknown"), "at the edge"),
        (("outside", "at the edge", "inside"), "outside"),
        (("inside", "unknown"), "inside"),
        (("unknown",), "unknown"),
        ((), "unknown"),
    ],
)
def test_the_limit_that_is_met_least_decides(standings_of_limits: tuple[Standing, ...], worst: Standing) -> None:
    limits = [StatedLimit("", "", "", of_limit, "", "") for of_limit in standings_of_limits]
    assert ModelStanding("ggx", 550.0, limits).worst == worst


@pytest.mark.parametrize(
    ("entry", "diffuse", "mirrors"),
    [  # a substance absorbs light within a wavelength from k = 1 / (4 pi) = 0.0796 on
        ("main/Cu/Babar", "outside", "inside"),
        ("constant/1.5/0.08", "outside", "inside"),
        ("constant/1.5/0.079", "unknown", "unknown"),
        ("constant/1.5/0", "unknown", "unknown"),
    ],
)
def test_facets_of_a_metal_are_mirrors_and_not_diffuse(entry: str, diffuse: Standing, mirrors: Standing) -> None:
    found = statistics(MADE)
    for judged in standings(found, surface_materials(found, "plate", entry=entry).materials, entry):
        of_facets = [limit.standing for limit in judged.limits if limit.quantity.startswith("extinction coefficient")]
        expected = {"oren_nayar": [diffuse], "ggx": [mirrors], "beckmann": [mirrors], "he_torrance": []}
        assert of_facets == expected[judged.model]
        if judged.model == "oren_nayar" and diffuse == "outside":
            assert judged.worst == "outside"


def test_a_model_that_heights_do_not_tell_is_left_out_with_what_suits_best() -> None:
    found = statistics(MADE)
    reason = surface_materials(found, "plate", rho=0.9).left_out["vmf_diffuse"]
    suited = suited_parameters("vmf_diffuse", found.slope)
    assert suited is not None
    assert f"roughness = {suited['roughness']:.3g} suits a Gaussian surface" in reason
    assert reason.endswith(stated_error("vmf_diffuse", rho=0.9, **suited).sentence)
    steep = statistics(replace(MADE, sigma=5.0, noise=0.0))  # beyond the map
    assert surface_materials(steep, "plate").left_out["vmf_diffuse"].endswith("which no height map shows")


def stated_error(model: str, **parameters: float) -> SurfaceError:
    error = surface_error_of(model, parameters)
    assert error is not None
    return error


def test_the_materials_are_those_that_models_declare() -> None:
    found = statistics(replace(MADE, tau_x=6.0, tau_y=3.0))
    materials = surface_materials(found, "plate").materials
    assert materials["beckmann"].parameters["alpha_y"] == pytest.approx(math.sqrt(2.0) * found.slope_y.value, rel=1e-5)
    assert set(materials) == {name for name, spec in MODELS.items() if spec.heights and spec.heights.parameters}
    directions = {
        judged.model: [limit.standing for limit in judged.limits if limit.words == "The surface is isotropic."]
        for judged in standings(found, materials)
    }
    assert directions == {"he_torrance": ["outside"], "oren_nayar": ["outside"], "ggx": [], "beckmann": []}


def test_a_model_of_the_user_that_declares_its_surface_is_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    assumption = SurfaceAssumption("no specular part", "Dust has no specular part.", "a notebook")
    relation = HeightRelation(lambda _: {}, "it has no roughness", (assumption,))
    dust = replace(MODELS["lambert"], name="dust", title="Dust, of a user", heights=relation)
    monkeypatch.setitem(MODELS, "dust", dust)
    found = statistics(MADE)
    made = surface_materials(found, "plate", rho=0.3)
    assert made.tables["dust"]["parameters"] == {"rho": 0.3}
    assert made.tables["dust"]["title"] == "Dust with the statistics of plate"
    (judged, _) = (one for one in standings(found, {"dust": made.materials["dust"]}))
    assert [(limit.words, limit.standing) for limit in judged.limits] == [
        ("Dust has no specular part.", "inside"),
        ("The surface is isotropic.", "inside"),
    ]


def test_the_band_of_a_map() -> None:
    # pixels of 0.5 um, map of 80 um: sin(theta_r) from 0.55 / 80 to 0.55 / 1
    band = spatial_band(statistics(MADE), 550.0)
    assert band.nearest_deg == pytest.approx(math.degrees(math.asin(0.55 / 80.0)))
    assert band.farthest_deg == pytest.approx(math.degrees(math.asin(0.55)))
    assert not band.everywhere
    assert spatial_band(statistics(MADE), 10_600.0).everywhere


def test_refractive_indices_have_short_names() -> None:
    assert index_entry("Cu").startswith("main/Cu/")
    assert index_entry("constant/1.5/0") == "constant/1.5/0"
    with pytest.raises(ParameterError, match="'Unobtainium' is no refractive index; allowed are shelf/book/page"):
        index_entry("Unobtainium")


def test_statistics_are_json() -> None:
    found = json.loads(json.dumps(statistics(MADE).document(), allow_nan=False))
    assert found["sigma_0_um"]["low"] < found["sigma_0_um"]["value"] < found["sigma_0_um"]["high"]
    assert found["noise"]["kind"] == "estimated"
    assert found["confidence"] == 0.95
