"""The error of models against rays, quoted for materials: from rows made by hand, and what the shipped file holds."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from typing import Any

import pytest

from brdfdb.errors import ParameterError
from brdfdb.materials import Material
from brdfdb.microgeometry import model_errors
from brdfdb.microgeometry.model_errors import SurfaceError, has_map, suited_parameters, surface_error, surface_error_of
from brdfdb.models import MODELS

LIGHTS = [0, 45, 75]
Rows = list[dict[str, Any]]


def row(slope: float, parameters: dict[str, float], median: list[float], rho: float | None = None, **more: Any) -> Any:
    """Return a row whose other statistics are multiples of its medians."""
    statistics = {
        "p95": [2.0 * value for value in median],
        "worst": [4.0 * value for value in median],
        "towards_light": [0.9, -0.04, -0.08],  # light along the normal has no azimuth
        "forward": [None, 0.0, 0.0],
        "noise": [0.001] * 3,
    }
    return {"slope": slope, "rho": rho, "parameters": parameters, "median": median, **statistics, **more}


@pytest.fixture
def maps(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Maps of models made by hand in place of the shipped ones: tests add rows."""
    models: dict[str, Any] = {}
    monkeypatch.setattr(model_errors, "_document", lambda: {"lights_deg": LIGHTS, "models": models})
    return models


def stated(model: str, **parameters: Any) -> SurfaceError:
    found = surface_error_of(model, parameters)
    assert found is not None
    return found


def degrees(sigma: float) -> float:
    return math.degrees(sigma)


def test_errors_are_interpolated_in_the_slope_and_the_albedo(maps: dict[str, Any]) -> None:
    maps["oren_nayar"] = {
        "rows": [
            row(0.2, {"sigma": 0.2}, [0.01, 0.02, 0.03], 0.2),
            row(0.4, {"sigma": 0.3}, [0.03, 0.04, 0.07], 0.2),
            row(0.2, {"sigma": 0.2}, [0.05, 0.06, 0.07], 0.6),
            row(0.4, {"sigma": 0.3}, [0.07, 0.08, 0.11], 0.6),
        ]
    }
    # sigma of 0.25 is half way of slopes 0.2 and 0.4
    first = stated("oren_nayar", rho=0.2, sigma_deg=degrees(0.25))
    assert first.slope == pytest.approx(0.3)
    assert (first.median, first.at_75) == pytest.approx((0.03, 0.05))
    second = stated("oren_nayar", rho=0.6, sigma_deg=degrees(0.25))
    assert (second.median, second.at_75) == pytest.approx((0.07, 0.09))
    # an albedo of 0.3 is a quarter of the way from 0.2 to 0.6
    between = stated("oren_nayar", rho=0.3, sigma_deg=degrees(0.25))
    assert between.slope == pytest.approx(0.3)
    assert (between.median, between.at_75) == pytest.approx((0.04, 0.06))
    assert (between.p95, between.worst) == pytest.approx((0.12, 0.24))
    assert (between.towards_light, between.forward) == pytest.approx((-0.06, 0.0))  # of the lights at 45 and 75 degrees
    assert between.noise == pytest.approx(0.001)
    assert between.inside


def test_a_side_that_one_of_two_rows_does_not_see_has_no_error(maps: dict[str, Any]) -> None:
    # forward: seen by one row alone at 45 degrees, by both at 75
    rows = [row(s, {"alpha_x": s, "alpha_y": s}, [0.1] * 3, forward=[None, x, s]) for s, x in ((0.1, None), (0.3, 0.9))]
    maps["beckmann"] = {"rows": rows}
    assert stated("beckmann", alpha_x=0.2, alpha_y=0.2).forward == pytest.approx(0.2)
    assert stated("beckmann", alpha_x=0.3, alpha_y=0.3).forward == pytest.approx(0.6)


def test_of_the_least_and_largest_albedo_of_a_spectrum_the_worse_is_stated(maps: dict[str, Any]) -> None:
    maps["oren_nayar"] = {"rows": [row(s, {"sigma": s}, [rho * s] * 3, rho) for rho in (0.2, 0.6) for s in (0.1, 0.3)]}
    spectrum = {"wavelengths_nm": [400, 500, 600], "values": [0.3, 0.5, 0.25], "origin": "made up"}
    expected = stated("oren_nayar", rho=0.5, sigma_deg=degrees(0.2))
    assert expected.median == pytest.approx(0.1)
    assert stated("oren_nayar", rho=spectrum, sigma_deg=degrees(0.2)) == expected
    fields = {"title": "t", "source": "s", "parameters": {"rho": spectrum, "sigma_deg": degrees(0.2)}}
    of_material = surface_error(Material.from_table("x", {"model": "oren_nayar", **fields}))
    assert of_material is not None
    assert of_material.median == pytest.approx(expected.median)  # files have twelve digits of an angle
    assert of_material.sentence == expected.sentence


@pytest.mark.parametrize(
    ("sigma", "rho", "sentence"),
    [
        (
            0.5,
            0.5,
            "Against rays on Gaussian surfaces: sigma = 28.6 degrees is outside of the map, 6.3 to 22.9 degrees.",
        ),
        (
            0.1,
            0.2,
            "Against rays on Gaussian surfaces: sigma = 5.73 degrees is outside of the map, 6.3 to 22.9 degrees.",
        ),
    ],
)
def test_nothing_is_extrapolated(maps: dict[str, Any], sigma: float, rho: float, sentence: str) -> None:
    ends = ((0.1, 0.11), (0.5, 0.4))  # slope, sigma
    maps["oren_nayar"] = {"rows": [row(s, {"sigma": x}, [0.1] * 3, albedo) for s, x in ends for albedo in (0.2, 0.6)]}
    outside = stated("oren_nayar", rho=rho, sigma_deg=degrees(sigma))
    assert outside == SurfaceError(sentence, inside=False)
    assert outside.in_lists == "outside of map"


def test_the_nearest_albedo_of_the_map_is_taken_and_named(maps: dict[str, Any]) -> None:
    maps["oren_nayar"] = {"rows": [row(s, {"sigma": s}, [rho * s] * 3, rho) for rho in (0.2, 0.6) for s in (0.1, 0.3)]}
    found = stated("oren_nayar", rho=0.95, sigma_deg=degrees(0.3))
    assert found.median == pytest.approx(0.18)
    assert found.sentence.endswith(". The map has no albedo of 0.95; the nearest is 0.6.")


def test_of_two_axes_the_worse_is_stated(maps: dict[str, Any]) -> None:
    rows = [row(s, {"alpha_x": 2.0 * s, "alpha_y": 2.0 * s}, [s, s, 2.0 * s]) for s in (0.1, 0.3)]
    maps["beckmann"] = {"rows": rows, "arguments": {"n": 1.0, "k": 1e6}, "bounces": "one"}
    assert stated("beckmann", alpha_x=0.3, alpha_y=0.3).sentence == (
        "Against rays of one bounce on Gaussian surfaces of these slopes: 15 % in the median (30 % for light at 75 "
        "degrees), at most 60 % for 95 % of the viewers, "
        "too dark towards the light."
    )
    for alphas in ({"alpha_x": 0.3, "alpha_y": 0.5}, {"alpha_x": 0.5, "alpha_y": 0.3}):
        worse = stated("beckmann", **alphas)
        assert (worse.slope, worse.median) == pytest.approx((0.25, 0.25))
        assert worse.sentence.endswith("with the slopes of one axis or the other, and the worse is stated.")
    assert not stated("beckmann", alpha_x=0.3, alpha_y=0.7).inside


GAUSSIAN = "Against rays on Gaussian surfaces of these slopes: "
STEEP = "4.0 % in the median (11 % for light at 75 degrees)"
MOST = ", at most 22 % for 95 % of the viewers"


@pytest.mark.parametrize(
    ("model", "more", "sentence"),
    [
        (
            "beckmann",
            {},
            f"{GAUSSIAN}{STEEP}{MOST}, too dark towards the light.",
        ),
        (
            "beckmann",
            {"towards_light": [None, 0.03, 0.05], "forward": [None, -0.03, -0.05]},
            f"{GAUSSIAN}{STEEP}{MOST}, too dark forward, too bright towards the light.",
        ),
        (
            "beckmann",
            {"towards_light": [None, 0.03, 0.05], "forward": [None, 0.03, 0.05]},
            f"{GAUSSIAN}{STEEP}{MOST}, too bright towards the light and forward.",
        ),
        (
            "beckmann",
            {"towards_light": [None, -0.01, -0.02], "forward": [None, None, None]},
            f"{GAUSSIAN}{STEEP}{MOST}.",
        ),
        (
            "beckmann",
            {"noise": [0.05] * 3},
            f"{GAUSSIAN}within the noise (5.0 %) in the median (11 % for light at 75 degrees){MOST}, too dark towards "
            "the light.",
        ),
        (
            "beckmann",
            {"noise": [0.2] * 3},  # a mean error of 6 % is within this noise, too
            f"{GAUSSIAN}within the noise of the rays, 20 %.",
        ),
        (
            "beckmann",
            {"noise": [0.001, 0.001, 0.12]},
            f"{GAUSSIAN}4.0 % in the median (within the noise (12 %) for light at 75 degrees){MOST}, too dark towards "
            "the light.",
        ),
        (
            "ggx",
            {},
            f"Against rays on the Gaussian surface that the model fits best: {STEEP}{MOST}, too dark "
            "towards the light.",
        ),
    ],
)
def test_the_sentence_says_what_the_numbers_say(maps: dict[str, Any], model: str, more: Any, sentence: str) -> None:
    rows = [row(s, {"alpha_x": s, "alpha_y": s}, [0.02, 0.04, 0.11], **more) for s in (0.1, 0.3)]
    maps[model] = {"rows": rows, "only_fit": model == "ggx"}
    assert stated(model, alpha_x=0.2, alpha_y=0.2).sentence == sentence


@pytest.mark.parametrize(
    ("median", "noise", "cell"),
    [(0.04, 0.001, "4.0 %"), (0.0, 0.0036, "< 0.36 %"), (0.003, 0.003, "< 0.30 %"), (0.0, 0.0, "< 0.001 %")],
)
def test_the_cell_of_a_list_is_not_smaller_than_the_noise(median: float, noise: float, cell: str) -> None:
    assert SurfaceError("", inside=True, slope=0.2, median=median, noise=noise).in_lists == cell


def test_the_parameters_that_suit_a_slope_are_interpolated(maps: dict[str, Any]) -> None:
    rows = [row(s, {"roughness": s * s}, [0.1] * 3, rho) for rho in (0.2, 0.6) for s in (0.1, 0.3)]
    maps["vmf_diffuse"] = {"rows": rows}
    assert suited_parameters("vmf_diffuse", 0.15) == pytest.approx({"roughness": 0.03})  # a quarter from 0.01 to 0.09
    assert suited_parameters("vmf_diffuse", 0.31) is None
    assert suited_parameters("vmf_diffuse", math.nan) is None
    assert suited_parameters("ward", 0.2) is None


def test_a_flat_surface_has_no_error(maps: dict[str, Any]) -> None:
    zeros = {name: [0.0] * 3 for name in ("towards_light", "forward", "noise")}
    maps["oren_nayar_qualitative"] = {
        "rows": [row(0.0, {"sigma": 0.0}, [0.0] * 3, **zeros), row(0.5, {"sigma": 0.4}, [0.1] * 3)]
    }
    flat = stated("oren_nayar_qualitative", rho=0.5, sigma_deg=0.0)
    assert (flat.sentence, flat.in_lists) == (f"{GAUSSIAN}0, since the surface is flat.", "0")


def test_a_map_is_only_about_the_arguments_that_it_names(maps: dict[str, Any]) -> None:
    for name, offset, error in (("oren_nayar_qualitative", 0.33, 0.1), ("another", 0.57, 0.2)):
        rows = [row(s, {"sigma": s}, [error] * 3) for s in (0.0, 0.5)]
        maps[name] = {"model": "oren_nayar_qualitative", "arguments": {"offset": offset}, "rows": rows}
    for offset, error in ((0.33, 0.1), (0.57, 0.2)):
        found = stated("oren_nayar_qualitative", rho=0.5, sigma_deg=10.0, offset=offset)
        assert found.median == pytest.approx(error)
    assert surface_error_of("oren_nayar_qualitative", {"rho": 0.5, "sigma_deg": 10.0, "offset": 0.5}) is None
    assert has_map("oren_nayar_qualitative")
    assert not has_map("another")


def test_without_a_map_or_a_roughness_there_is_no_number(maps: dict[str, Any]) -> None:
    maps["lambert"] = {"rows": [row(s, {}, [s] * 3, 0.5) for s in (0.1, 0.3)]}
    assert surface_error_of("lambert", {"rho": 0.5}) is None
    assert surface_error_of("ward", {"rho_d": 0.5, "rho_s": 0.1, "alpha_x": 0.1, "alpha_y": 0.1}) is None
    assert surface_error_of(None, {}) is None


# The shipped file


@pytest.mark.parametrize("rho", [math.nan, None, [], "0.5", [0.2, 1.2], {"file": "a.csv"}])
def test_what_is_no_albedo_is_refused(rho: Any) -> None:
    with pytest.raises(ParameterError, match="is no albedo"):
        surface_error_of("oren_nayar", {"rho": rho, "sigma": 0.3})


@pytest.mark.parametrize("sigma", [math.nan, math.inf, "0.2", [0.2]])
def test_a_roughness_that_is_no_finite_number_is_refused(sigma: Any) -> None:
    with pytest.raises(ParameterError, match=r"sigma: .* is not a finite number"):
        surface_error_of("oren_nayar", {"rho": 0.5, "sigma": sigma})


def test_shipped_maps_name_all_parameters_and_grow_with_the_slope() -> None:
    document = model_errors._document()
    assert document["version"] == 1
    assert document["provenance"]
    lights = len(document["lights_deg"])
    assert {"oren_nayar", "oren_nayar_gaussian", "oren_nayar_qualitative", "torrance_sparrow", "beckmann", "ggx"} <= (
        document["models"].keys()
    )
    for name, entry in document["models"].items():
        spec = MODELS[entry.get("model", name)]
        rows: Rows = entry["rows"]
        axes = rows[0]["parameters"].keys() & {parameter.name for parameter in spec.parameters}
        named = {"rho", *axes, *entry.get("arguments", {})}
        if axes:
            assert {parameter.name for parameter in spec.parameters} <= named, name
        assert entry.get("bounces", "all") in model_errors._BOUNCES
        for rho in {each["rho"] for each in rows}:
            of_rho = sorted((each for each in rows if each["rho"] == rho), key=lambda each: float(each["slope"]))
            for key in axes:
                values = [each["parameters"][key] for each in of_rho]
                assert values == sorted(set(values)), (name, rho, key)
                assert values == sorted({each["parameters"][key] for each in rows})  # the same for all albedos
        for each in rows:
            for statistic in ("median", "p95", "worst", "noise"):
                assert len(each[statistic]) == lights
                assert all(value >= 0.0 for value in each[statistic])
            assert all(m <= p <= w for m, p, w in zip(each["median"], each["p95"], each["worst"], strict=True))


def test_a_list_loads_neither_numpy_nor_pydantic_for_it() -> None:
    program = (
        "import sys; from brdfdb.microgeometry.model_errors import surface_error_of as f; "
        "assert f('oren_nayar_gaussian', {'rho': 0.5, 'sigma_deg': 20.0}); "
        "print([m for m in ('numpy', 'pydantic', 'scipy', 'embreex') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == []
