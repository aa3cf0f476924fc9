"""The choice for a scene: costs decide among what keeps to the tolerance, and the whole is held to it elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.choices import Price, describe
from brdfdb.choose import Candidate, Decision, InfeasibleError, Left, Pick, Seen, candidates, choose, pick
from brdfdb.cost import ALIKE, CHEAPER
from brdfdb.gather import gather
from brdfdb.materials import presets
from brdfdb.render import reflectors, render
from brdfdb.representations import representations
from brdfdb.scene import Scene, Tolerance
from brdfdb_pipelines.scene import load, shipped

COARSE = [float(wavelength) for wavelength in range(420, 681, 20)]
WIDTH, DENSER = 48, 73

# Made-up costs of a wavelength: more for what is nearer the truth, so that there is always something cheaper
COSTS = {
    "exact": 100.0,
    "quadrature": 70.0,
    "customary": 65.0,
    "printed": 60.0,
    "closed form": 50.0,
    "approximation": 10.0,
    "table": 5.0,
}


def made_up_costs(offered: dict[str, list[Candidate]]) -> dict[str, list[float]]:
    return {
        name: [COSTS[each.form.kind] * (1 if each.wavelength_nm is None else each.wavelength_nm.size) for each in forms]
        for name, forms in offered.items()
    }


class Summed:
    """A scene that shows every material at every pixel: candidates are their errors, and errors add up."""

    scene = Scene.model_validate(
        {
            "ambient": 1.0,
            "camera": {"position": (0.0, -1.0, 0.0), "height": 1.0},
            "tolerance": {"ciede2000": 1.0},
            "objects": [{"name": "ball", "material": "clay-vase", "shape": {"kind": "sphere", "radius": 1}}],
        }
    )

    def picture(self, forms: dict[str, float]) -> float:
        return sum(forms.values())

    def left(self, _name: str, picture: float) -> Left:
        return Left(picture, picture)


def scene_of(tolerance: dict[str, float], *materials: str) -> Scene:
    """Spheres side by side, with a light from the left and ambient light."""
    places = [2.2 * number for number in range(len(materials))]
    return Scene.model_validate(
        {
            "ambient": 0.05,
            "lights": [{"direction": (-1.0, -1.0, 0.5)}],
            "camera": {
                "position": (places[-1] / 2, -6.0, 0.0),
                "target": (places[-1] / 2, 0.0, 0.0),
                "height": 2.3,
                "aspect": 1.0 * len(materials),
            },
            "wavelengths_nm": COARSE,
            "tolerance": tolerance,
            "objects": [
                {"name": name, "material": name, "shape": {"kind": "sphere", "radius": 1, "position": (x, 0, 0)}}
                for name, x in zip(materials, places, strict=True)
            ],
        }
    )


def offered_and_seen(scene: Scene, *widths: int) -> tuple[dict[str, list[Candidate]], list[Seen]]:
    """Candidates without tables, and the scene at some widths."""
    materials = reflectors(scene)
    offered = {name: candidates(each.material, each.wavelength_nm, ()) for name, each in materials.items()}
    truths = {name: forms[0] for name, forms in offered.items()}
    return offered, [Seen(scene, gather(scene, width), truths, materials) for width in widths]


@pytest.mark.parametrize(
    ("tolerance", "expected"),
    [
        pytest.param(0.0, Pick(0, 1), id="only-the-truth-keeps"),
        pytest.param(0.1, Pick(1, 2), id="the-cheapest-that-keeps"),
        pytest.param(0.3, Pick(2, 4), id="of-two-alike-the-more-accurate"),
        pytest.param(9.0, Pick(4, None), id="nothing-is-cheaper"),
    ],
)
def test_the_cheapest_that_keeps_to_the_tolerance_is_picked(tolerance: float, expected: Pick) -> None:
    costs = [100.0, 50.0, 10.0 * (1.0 + CHEAPER) / 2.0, 10.0, 1.0]  # the third and fourth cost about the same
    errors = [0.0, 0.1, 0.2, 0.3, 1.0]
    assert pick(costs, errors.__getitem__, tolerance) == expected


@pytest.mark.parametrize(
    ("costs", "errors", "expected"),
    [
        pytest.param([1.0, 0.96, 0.9], [0.0, 0.0, 0.0], Pick(0, None), id="equals"),
        pytest.param([1.0, 0.9], [0.5 * ALIKE, 0.5], Pick(0, None), id="a-hairs-breadth"),
        pytest.param([1.0, 0.9], [0.51 * ALIKE, 0.5], Pick(1, None), id="more-accurate"),
        pytest.param([1.0, 0.9], [0.7 * ALIKE, 0.7], Pick(1, None), id="the-first-breaks-the-tolerance"),
        pytest.param([9.0, 1.0, 0.9], [0.0, 2.0, 2.0], Pick(0, 1), id="equals-that-are-cheaper"),
    ],
)
def test_of_what_is_alike_in_cost_and_error_the_first_is_picked(
    costs: list[float], errors: list[float], expected: Pick
) -> None:
    assert pick(costs, errors.__getitem__, 0.75) == expected


def test_errors_of_what_costs_clearly_more_are_not_asked_for() -> None:
    asked = []

    def error(index: int) -> float:
        asked.append(index)
        return 0.0

    assert pick([100.0, 1.0, 2.0], error, 0.1) == Pick(1, None)
    assert asked == [1]


def test_what_is_cheaper_than_the_cheapest_that_keeps_breaks_the_tolerance() -> None:
    rng = np.random.default_rng(1994)
    for _ in range(200):
        costs, errors = rng.random(8), rng.random(8)
        errors[0] = 0.0
        found = pick(costs.tolist(), errors.tolist().__getitem__, 0.5)
        assert errors[found.chosen] <= 0.5
        if found.cheaper is not None:
            assert errors[found.cheaper] > 0.5
            assert costs[found.cheaper] < costs[found.chosen]
        assert costs[found.chosen] <= CHEAPER * costs[errors <= 0.5].min()


def test_a_spectrum_at_a_few_wavelengths_is_joined_by_straight_lines() -> None:
    material = presets()["scene-copper-sphere"]
    wavelength = np.array(COARSE)
    few = next(each for each in candidates(material, wavelength, ()) if each.form.key == "sum-3-wavelengths")
    assert few.wavelength_nm is not None
    wi, wr = np.array([[0.6, 0.0, 0.8]]), np.array([[-0.6, 0.0, 0.8]])
    whole = candidates(material, few.wavelength_nm, ())[0].brdf(wi, wr)
    expected = np.interp(wavelength, few.wavelength_nm, whole[0])
    np.testing.assert_allclose(few.brdf(wi, wr)[0], expected, rtol=1e-12)


@pytest.mark.parametrize("name", ["wall-plaster", "rolled-brass", "scene-plastic-cube"])
def test_forms_that_differ_from_another_in_rounding_alone_are_not_offered(name: str) -> None:
    material = presets()[name]
    wavelength = np.array([550.0]) if material.spectral else None
    rounded = {form.key for form in representations(material, wavelength, ()) if form.rounded}
    offered = {each.form.key: each.form for each in candidates(material, wavelength, ())}
    assert rounded
    assert not rounded & set(offered)
    assert all(form.dtype is np.float64 for form in offered.values())


def test_a_picture_of_truths_is_that_of_the_models() -> None:
    scene = scene_of({"relative": 0.1}, "scene-copper-sphere")
    _, (seen,) = offered_and_seen(scene, 12)
    np.testing.assert_array_equal(seen.truth, render(scene, seen.view))
    assert not seen.differences(seen.truth).any()


def test_only_the_pixels_of_a_material_count_for_it() -> None:
    scene = scene_of({"ciede2000": 1.0}, "rendered-sphere-0deg", "rendered-sphere-40deg")
    offered, (seen,) = offered_and_seen(scene, 24)
    flat = next(each for each in offered["rendered-sphere-40deg"] if each.form.key == "lambert")
    picture = seen.picture({"rendered-sphere-40deg": flat})
    assert seen.left("rendered-sphere-0deg", picture) == Left(0.0, 0.0)
    changed = np.flatnonzero(seen.differences(picture))
    assert changed.size
    assert set(changed) <= set(seen.pixels("rendered-sphere-40deg"))


def test_relative_errors_are_those_of_the_worst_wavelength() -> None:
    scene = scene_of({"relative": 0.1}, "rendered-sphere-0deg")
    _, (seen,) = offered_and_seen(scene, 8)
    off = seen.truth.copy()
    off[..., 3] *= 1.25
    off[..., 5] *= 0.9
    at = seen.pixels("rendered-sphere-0deg")
    np.testing.assert_allclose(seen.differences(off).ravel()[at], 0.25, rtol=1e-9)


@pytest.mark.parametrize(("percentile", "counted"), [(100.0, 0.5), (90.0, 0.25), (50.0, 0.0)])
def test_every_pixel_counts_or_as_many_as_the_tolerance_says(percentile: float, counted: float) -> None:
    scene = scene_of({"relative": 0.1, "percentile": percentile}, "rendered-sphere-0deg")
    _, (seen,) = offered_and_seen(scene, 16)
    at = seen.pixels("rendered-sphere-0deg")
    off = seen.truth.reshape(-1, len(COARSE)).copy()
    bright = at[seen.truth.reshape(-1, len(COARSE))[at, 0] > 0.1]
    off[bright[: at.size // 5]] *= 1.25
    off[bright[0]] *= 1.2
    left = seen.left("rendered-sphere-0deg", off.reshape(seen.truth.shape))
    np.testing.assert_allclose(left, (counted, 0.5), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", shipped())
def test_the_choice_for_a_shipped_scene_keeps_its_tolerance_where_it_was_not_planned(name: str) -> None:
    scene = load(name).model_copy(update={"wavelengths_nm": COARSE})
    offered, (planned, checked) = offered_and_seen(scene, WIDTH, DENSER)
    costs = made_up_costs(offered)
    chosen = choose(planned, checked, offered, costs)
    tolerance = scene.tolerance.ciede2000
    assert tolerance is not None
    picture = checked.picture({key: offered[key][one.pick.chosen] for key, one in chosen.items()})
    assert checked.differences(picture).max() <= tolerance
    for key, one in chosen.items():
        assert one.left.most <= tolerance
        assert one.whole.most <= tolerance
        for index, form in enumerate(offered[key]):
            if CHEAPER * costs[key][index] < costs[key][one.pick.chosen]:
                broken = [seen.left(key, seen.picture({key: form})).most for seen in (planned, checked)]
                assert max(broken) > tolerance
                if index == one.pick.cheaper:
                    assert one.cheaper_left is not None
                    assert one.cheaper_left.most == broken[1 if one.refused else 0] > tolerance


@pytest.mark.parametrize(
    "name", [name for name in shipped() if any(light.solid_angle_sr for light in load(name).lights)]
)
def test_samples_of_lights_leave_less_than_half_the_tolerance(name: str) -> None:
    tolerance = Tolerance(ciede2000=load(name).tolerance.value, percentile=99.0)
    scene = load(name).model_copy(update={"wavelengths_nm": COARSE, "tolerance": tolerance})
    lights = [light.model_copy(update={"samples": 512}) for light in scene.lights]
    offered, (given,) = offered_and_seen(scene, 32)
    _, (finer,) = offered_and_seen(scene.model_copy(update={"lights": lights}), 32)
    for key in offered:
        assert given.left(key, finer.truth).counted < tolerance.value / 2.0


def test_what_breaks_the_tolerance_on_the_denser_sampling_is_refused() -> None:
    # three pixels across, the fit is 0.58 off, but 1.4 where it was not looked at
    scene = scene_of({"ciede2000": 0.8}, "rendered-sphere-40deg")
    offered, (planned, checked) = offered_and_seen(scene, 3, 60)
    chosen = choose(planned, checked, offered, made_up_costs(offered))
    (one,) = chosen.values()
    forms = [each.form.key for each in offered["rendered-sphere-40deg"]]
    assert forms[one.pick.chosen] == "bounce-49"  # the closed forms cost about the same
    assert one.whole.most <= 0.8
    assert one.cheaper_left is not None
    assert one.cheaper_left.most > 0.8
    fit = {"rendered-sphere-40deg": offered["rendered-sphere-40deg"][forms.index("fit")]}
    assert planned.left("rendered-sphere-40deg", planned.picture(fit)).most <= 0.8
    assert checked.left("rendered-sphere-40deg", checked.picture(fit)).most > 0.8


def test_what_breaks_the_tolerance_only_together_refuses_the_furthest_off() -> None:
    offered = {"a": [0.0, 0.2, 0.7], "b": [0.0, 0.6]}
    costs = {"a": [10.0, 5.0, 1.0], "b": [10.0, 1.0]}
    chosen = choose(Summed(), Summed(), offered, costs)
    assert {name: one.pick for name, one in chosen.items()} == {"a": Pick(1, 2), "b": Pick(1, None)}
    assert chosen["a"].refused
    assert chosen["a"].cheaper_left == Left(0.7 + 0.6, 0.7 + 0.6)
    assert not chosen["b"].refused


def test_the_truth_is_what_is_left_when_all_else_is_refused() -> None:
    class Worse(Summed):
        def picture(self, forms: dict[str, float]) -> float:
            return 100.0 * super().picture(forms)

    offered = {"a": [0.0, 0.02, 0.2], "b": [0.0, 0.5, 0.05]}
    chosen = choose(Summed(), Worse(), offered, {"a": [3.0, 2.0, 1.0], "b": [3.0, 2.0, 1.0]})
    assert [one.pick.chosen for one in chosen.values()] == [0, 0]
    assert all(one.refused for one in chosen.values())
    assert [one.cheaper_left for one in chosen.values()] == [Left(2.0, 2.0), Left(5.0, 5.0)]


FIT = "the best of what is cheaper, functional fit, eqs 27-29, would leave 1.2"


@pytest.mark.parametrize(
    ("chosen", "cheaper", "share", "reason"),
    [
        ("facets", None, 1.0, "is the truth itself, and nothing is cheaper"),
        ("facets", "fit", 1.0, f"is the truth itself; {FIT}"),
        ("bounce-49", None, 0.2, "leaves 0.5, and nothing is cheaper"),
        ("bounce-49", None, 0.9, "leaves 0.5 at 0.9 of the truth's cost, more than a third, and nothing is cheaper"),
        ("bounce-49", "fit", 0.9, f"leaves 0.5 at 0.9 of the truth's cost, more than a third; {FIT}"),
    ],
)
def test_a_reason_says_each_thing_once(chosen: str, cheaper: str | None, share: float, reason: str) -> None:
    scene = scene_of({"ciede2000": 1.0}, "rendered-sphere-40deg")
    offered, _ = offered_and_seen(scene)
    ((name, forms),) = offered.items()
    keys = [each.form.key for each in forms]
    pick = Pick(keys.index(chosen), None if cheaper is None else keys.index(cheaper))
    left = None if cheaper is None else Left(1.2, 1.2)
    prices = {name: [Price(1.0, share if index else 1.0) for index in range(len(forms))]}
    decision = Decision(pick, Left(0.5, 0.5), left, False, Left(0.6, 0.6))
    (one,) = describe(scene, {name: decision}, offered, prices, {name: 1}, {})
    assert one.reason == reason


@pytest.mark.parametrize(("refused", "where"), [(True, " on the denser sampling"), (False, "")])
def test_the_reason_says_by_how_much_and_where_the_next_cheaper_breaks_the_tolerance(refused: bool, where: str) -> None:
    scene = scene_of({"ciede2000": 1.0}, "rendered-sphere-40deg")
    offered, _ = offered_and_seen(scene)
    ((name, forms),) = offered.items()
    keys = [each.form.key for each in forms]
    pick = Pick(keys.index("fit"), keys.index("qualitative"))
    decision = Decision(pick, Left(0.5, 0.5), Left(1.004, 1.004), refused, Left(0.6, 0.6))
    prices = {name: [Price(1.0, 0.1 if index else 1.0) for index in range(len(forms))]}
    (one,) = describe(scene, {name: decision}, offered, prices, {name: 1}, {})
    assert one.refused == refused
    assert one.reason == f"leaves 0.5; the best of what is cheaper, qualitative, eq. 30, would leave 1.004{where}"


@pytest.mark.parametrize(
    ("tolerance", "said"),
    [
        ({"relative": 1e-9}, r"tolerance: 1e-09 \(relative\) is finer than the truth is known, 1e-06"),
        ({"ciede2000": 1e-6}, r"tolerance: 1e-06 \(CIEDE2000\) is finer than the truth is known, 0.0001"),
    ],
)
def test_a_tolerance_finer_than_the_truth_is_known_is_infeasible(tolerance: dict[str, float], said: str) -> None:
    scene = scene_of(tolerance, "rendered-sphere-40deg")
    offered, (seen,) = offered_and_seen(scene, 8)
    with pytest.raises(InfeasibleError, match=said):
        choose(seen, seen, offered, made_up_costs(offered))


def test_a_tolerance_has_one_value_and_its_unit() -> None:
    found = [(each.value, each.unit) for each in (Tolerance(relative=0.02), Tolerance(ciede2000=3.0))]
    assert found == [(0.02, "relative"), (3.0, "CIEDE2000")]


def test_with_an_environment_all_forms_meet_the_same_directions() -> None:
    alone = scene_of({"relative": 0.03}, "rendered-sphere-40deg")
    room = {"rows": [[1.0, 2.0, 1.0, 0.5], [0.2, 0.4, 0.2, 0.1]], "samples": 4}
    scene = Scene.model_validate({**alone.model_dump(), "ambient": 0.0, "environment": room})
    offered, (planned, checked) = offered_and_seen(scene, 24, 37)
    chosen = choose(planned, checked, offered, made_up_costs(offered))
    (one,) = chosen.values()
    assert one.whole.counted <= 0.03
    assert one.cheaper_left is not None
    assert one.cheaper_left.counted > 0.03
    # another 4 directions a point are further off than the tolerance, and than what was chosen
    other = gather(Scene.model_validate({**scene.model_dump(), "environment": {**room, "seed": 1}}), 37)
    noise = checked.differences(render(scene, other)).ravel()[checked.pixels("rendered-sphere-40deg")]
    assert np.percentile(noise, 99.0) > 0.03
