"""The forms of a material: finite, reciprocal, as far from the truth as their papers and limits say."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brdfdb import models
from brdfdb.forms import catalogue
from brdfdb.forms.catalogue import Form
from brdfdb.geometry import radians, unit_vector
from brdfdb.materials import Material, presets
from brdfdb.materials.provenance import Assumption
from brdfdb.misprints import MISPRINTS
from brdfdb.models import oren_nayar_1994 as model
from brdfdb.models._oren_nayar_facets import NODES
from brdfdb.reference import he_torrance_1991, oren_nayar_1994, ward_1992
from brdfdb.tables import error_measurement

PRESETS = [
    *("wall-plaster", "foam", "rendered-sphere-0deg", "rolled-brass", "enamel-finished-metal"),
    *("scene-copper-sphere", "blue-plastic", "scene-plastic-cube"),
]
TOLERANCE = 0.1  # of the one planned table

SINGLE = 3e-7  # l1 of float32: 1.6e-7 of rolled brass
SWAPPED = 1e-9  # light and viewer, of the largest value: 1.6e-12
SLOPES = 2e-6  # relative, of facets integrated: 1.1e-6 by its docstring
SUM = 2e-12  # relative, of the whole sum: as its model
LIMIT_OF_VERY_ROUGH = 1e-12  # relative: where exp has a large exponent
COARSE = 0.02  # relative, of a coarser sum of eq. 78: what its coarsest rung is off
CLOSED = 1e-3  # relative, 24 slopes less the 400 of the misprint: 4.1e-4
SHORT = 3e-8  # l1 of ten terms where g stays below 1.3: 2.3e-8; the first one left out is g^10 / (11! 11) of the first


def of(material: Material, *tolerances: float) -> tuple[dict[str, Form], error_measurement.RandomPairs]:
    wavelength_nm = wavelengths(material)
    forms = {form.key: form for form in catalogue.forms(material, wavelength_nm, tolerances)}
    return forms, error_measurement.draw(material, wavelength_nm, 100, 7)


def wavelengths(material: Material) -> Any:
    return np.array(material.wavelengths_nm or (450.0, 550.0, 650.0)) if material.spectral else None


def values(form: Form, wi: Any, wr: Any) -> Any:
    return form.evaluate(np.asarray(wi, dtype=form.dtype), np.asarray(wr, dtype=form.dtype)).astype(np.float64)


def l1(forms: dict[str, Form], drawn: error_measurement.RandomPairs, key: str) -> float:
    truth = values(next(iter(forms.values())), drawn.wi, drawn.wr)
    return float(error_measurement.mean_error(values(forms[key], drawn.wi, drawn.wr), truth, drawn.weight).max())


def rough_copper(**parameters: float) -> Material:
    return Material(
        name="copper",
        title="Copper",
        model="he_torrance",
        parameters=parameters,
        source="a test",
        refractive_index="main/Cu/Johnson",
    )


@pytest.mark.parametrize("name", PRESETS)
def test_every_form_is_finite_not_negative_reciprocal_and_the_same_alone(name: str) -> None:
    forms, drawn = of(presets()[name], TOLERANCE)
    wi, wr = drawn.wi[drawn.above], drawn.wr[drawn.above]
    count = wavelengths(presets()[name]).size if presets()[name].spectral else 1
    for form in forms.values():
        f_r = values(form, wi, wr)
        assert f_r.shape == (len(wi), count)
        assert np.isfinite(f_r).all(), form.key
        assert (f_r >= 0.0).all(), form.key
        if form.kind != "table":
            np.testing.assert_allclose(values(form, wr, wi), f_r, rtol=0.0, atol=SWAPPED * f_r.max(), err_msg=form.key)
        alone = np.concatenate([values(form, wi[[row]], wr[[row]]) for row in (0, 1, 2)])
        # a coarser sum of eq. 78 has as many terms as the neediest direction of a block
        rtol = COARSE if form.kind == "quadrature" else 1e-5
        np.testing.assert_allclose(alone, values(form, wi[:3], wr[:3]), rtol=rtol, err_msg=form.key)


@pytest.mark.parametrize("name", PRESETS)
def test_keys_are_unique_the_truth_comes_first_and_float32_is_off_by_rounding(name: str) -> None:
    found = catalogue.forms(presets()[name], wavelengths(presets()[name]), (TOLERANCE, TOLERANCE))
    forms, drawn = of(presets()[name])
    keys = [form.key for form in found]
    assert len(set(keys)) == len(keys)
    assert {"table-10", "table-even", "table-halves"} <= set(keys)
    assert (found[0].kind, found[0].dtype) == ("exact", np.float64)
    single = {key for key, form in forms.items() if form.dtype is np.float32}
    assert single == {key for key, form in forms.items() if form.rounded}
    assert any(forms[key].kind == "exact" for key in single)
    for key in single:
        double = forms[key.removesuffix("-float32")]
        assert forms[key].title == f"{double.title}, float32 in and out"
        assert abs(l1(forms, drawn, key) - l1(forms, drawn, double.key)) < SINGLE
        assert not np.array_equal(values(forms[key], drawn.wi, drawn.wr), values(double, drawn.wi, drawn.wr))


def test_the_truth_is_that_of_the_references() -> None:
    theta_i, theta_r, delta_phi = 0.7, 0.4, 1.9
    wi, wr = unit_vector(theta_i, 0.2)[np.newaxis], unit_vector(theta_r, 0.2 + delta_phi)[np.newaxis]

    def truth(name: str) -> Any:
        material = presets()[name]
        return values(catalogue.forms(material, wavelengths(material), ())[0], wi, wr)[0]

    plaster = oren_nayar_1994.gaussian(theta_i, theta_r, delta_phi, 0.9, float(radians(30.0)))
    np.testing.assert_allclose(truth("wall-plaster"), sum(plaster), rtol=SLOPES)
    brass = ward_1992.elliptical(theta_i, 0.2, theta_r, 0.2 + delta_phi, 0.1, 0.33, 0.05, 0.16)
    np.testing.assert_allclose(truth("rolled-brass"), float(brass), rtol=1e-13)
    copper = presets()["scene-copper-sphere"]
    spectrum = copper.arguments(wavelengths(copper))
    expected = [
        float(he_torrance_1991.directional_diffuse(theta_i, theta_r, delta_phi, w, 0.13, 1.2, n, k))
        for w, n, k in zip(spectrum["wavelength_nm"], spectrum["n"], spectrum["k"], strict=True)
    ]
    np.testing.assert_allclose(truth("scene-copper-sphere"), expected, rtol=SUM)


@pytest.mark.parametrize(("name", "tolerance"), [("wall-plaster", 0.01), ("rolled-brass", 0.1), ("blue-plastic", 0.1)])
def test_a_planned_table_keeps_to_its_tolerance_of_the_truth(name: str, tolerance: float) -> None:
    forms, _ = of(presets()[name], tolerance)
    drawn = error_measurement.draw(presets()[name], wavelengths(presets()[name]), 1000, 8)
    truth = values(next(iter(forms.values())), drawn.wi, drawn.wr)
    found = values(forms[f"table-{100 * tolerance:g}"], drawn.wi, drawn.wr)
    assert error_measurement.compare(found, truth, drawn).overall.p99 < tolerance


def test_a_flat_surface_of_lambertian_facets_is_lamberts_in_every_form() -> None:
    material = presets()["rendered-sphere-0deg"]
    forms, drawn = of(material, TOLERANCE)
    expected = float(material.parameters["rho"]) / np.pi
    for form in forms.values():
        f_r = values(form, drawn.wi, drawn.wr)
        np.testing.assert_allclose(f_r, expected, rtol=TOLERANCE if form.kind == "table" else 1e-6, err_msg=form.key)


def test_the_fit_is_a_few_percent_off_and_the_qualitative_model_worse_forward() -> None:
    forms, drawn = of(presets()["wall-plaster"])
    fit, rough, smooth = (l1(forms, drawn, key) for key in ("fit", "qualitative", "lambert"))
    assert 0.01 < fit < 0.04 < rough < smooth
    forward, back = (drawn.classes()[name] for name in ("forward", "back"))
    truth = values(forms["facets"], drawn.wi, drawn.wr)
    found = values(forms["qualitative-057"], drawn.wi, drawn.wr)
    ahead, behind = (
        error_measurement.mean_error(found, truth, np.where(rows, drawn.weight, 0.0)) for rows in (forward, back)
    )
    assert ahead > 3.0 * behind


def test_the_closed_forms_over_slopes_are_those_of_the_misprint() -> None:
    (printed,) = [misprint for misprint in MISPRINTS if misprint.key == "interreflection-factor"]
    where = printed.where
    material = presets()["wall-plaster"]
    once = material.model_copy(update={"parameters": {**material.parameters, "interreflection": False}})
    wi = unit_vector(where["theta_i"], where["phi_i"])[np.newaxis]
    wr = unit_vector(where["theta_r"], where["phi_r"])[np.newaxis]
    both, direct = (values(of(each)[0]["closed-forms"], wi, wr) for each in (material, once))
    assert where["rho"] == material.parameters["rho"]
    np.testing.assert_allclose(both - direct, printed.as_printed(**where), rtol=CLOSED)


@pytest.mark.parametrize(
    ("name", "key", "asked"),
    [
        pytest.param("foam", "facets", {"facets direct"}, id="no-bounce"),
        pytest.param("foam", "closed-forms", {"eq. 45"}, id="no-bounce-in-closed-forms"),
        pytest.param("wall-plaster", "closed-forms", {"eq. 45", "eq. 49"}, id="closed-forms"),
        pytest.param("wall-plaster", "bounce-49", {"facets direct", "eq. 49"}, id="bounce-of-eq-49"),
        pytest.param("wall-plaster", "direct-45", {"eq. 45", "facets bounce"}, id="direct-light-of-eq-45"),
    ],
)
def test_a_form_computes_what_it_shows_and_nothing_else(
    name: str, key: str, asked: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = set()

    def spy(kernel: str, what: Any) -> None:
        original = getattr(model, kernel)

        def called(*features: Any, **parts: bool) -> Any:
            found.update(what(**parts))
            return original(*features, **parts)

        monkeypatch.setattr(model, kernel, called)

    def of_facets(lit: bool, bounce: bool, nodes: int) -> list[str]:
        assert nodes == NODES
        return ["facets direct"] * lit + ["facets bounce"] * bounce

    def of_closed_forms(lit: bool, bounce: bool) -> list[str]:
        return ["eq. 45"] * lit + ["eq. 49"] * bounce

    spy("gaussian", of_facets)
    spy("over_slopes", of_closed_forms)
    forms, drawn = of(presets()[name])
    values(forms[key], drawn.wi[:3], drawn.wr[:3])
    assert found == asked


def test_ten_terms_do_where_g_is_small_and_beckmanns_limit_does_not() -> None:
    forms, drawn = of(rough_copper(sigma_0_um=0.04, tau_um=1.0))  # g of at most 1.3, at 450 nm
    assert l1(forms, drawn, "ten-terms") < SHORT
    assert l1(forms, drawn, "beckmann") > 0.3


def test_beckmanns_limit_does_where_g_is_large_and_ten_terms_do_not() -> None:
    forms, _ = of(rough_copper(sigma_0_um=3.0, tau_um=30.0))
    normal = np.array([[0.0, 0.0, 1.0]])
    truth, limit, corrected, ten = (
        values(forms[key], normal, normal)[0] for key in ("sum", "beckmann", "beckmann-corrected", "ten-terms")
    )
    # g of eq. 79 along the normal, where nothing is hidden and b = 0: the limit is off by 1 / g, corrected by 2 / g^2
    g = (4.0 * np.pi * 3.0 / (wavelengths(rough_copper(sigma_0_um=3.0, tau_um=30.0)) / 1000.0)) ** 2
    np.testing.assert_allclose(1.0 - limit / truth, 1.0 / g, rtol=3.0 / g.min())
    assert np.all(np.abs(corrected / truth - 1.0) < 3.0 / g**2)
    assert np.all(ten == 0.0)  # e^-g is


def test_beckmanns_limit_is_that_of_very_rough_surfaces() -> None:
    material = presets()["magnesium-oxide-ceramic"]
    forms, drawn = of(material)
    wi, wr = drawn.wi[drawn.above], drawn.wr[drawn.above]
    given = material.arguments(None)
    slope = given["sigma_0_um"] / given["tau_um"]
    optical = {name: given[name] for name in ("n", "k", "a")}
    expected = models.he_torrance_very_rough_vectors(wi, wr, sigma_0_over_tau=slope, **optical)
    np.testing.assert_allclose(forms["beckmann"].evaluate(wi, wr)[:, 0], expected, rtol=LIMIT_OF_VERY_ROUGH)


def cpu_seconds(*calls: Callable[[], Any]) -> list[float]:
    """The least time of each call, on the processor and in turn: other programs slow all of them down, or none."""
    taken = []
    for _ in range(20):
        for call in calls:
            start = time.process_time()
            call()
            taken.append(time.process_time() - start)
    return [min(taken[number :: len(calls)]) for number in range(len(calls))]


def many(form: Form, drawn: error_measurement.RandomPairs, count: int = 20_000) -> Callable[[], Any]:
    """A call of a form at many of the directions that were drawn; what it compiles is there."""
    wi, wr = np.resize(drawn.wi, (count, 3)), np.resize(drawn.wr, (count, 3))
    form.evaluate(wi, wr)
    return lambda: form.evaluate(wi, wr)


# Preset, forms whose time is compared, the share of the dearer one's that the others take at most, and directions
COSTS = [
    # the sum takes 190 ns, the limit 45, ten terms 70; in NumPy they took 450 and 600
    ("magnesium-oxide-ceramic", ("sum", "beckmann", "beckmann-corrected"), 0.6, 20_000),
    ("magnesium-oxide-ceramic", ("sum", "ten-terms"), 0.8, 20_000),
    # 0.65 us for 24 slopes, and 3.0 us for facets with two nodes; slope by slope in NumPy they took 3.3
    ("clay-vase", ("facets-2", "closed-forms"), 0.5, 20_000),
    # the truth and its coarsest rung: 20 us and 0.1 us a direction
    ("clay-vase", ("facets", "facets-1"), 0.8, 2_000),
    ("magnesium-oxide-ceramic", ("sum", "sum-9"), 0.8, 20_000),
]


@pytest.mark.parametrize(("name", "keys", "share", "count"), COSTS, ids=lambda value: str(value)[:40])
def test_approximations_and_coarser_rungs_are_compiled_and_cost_less(
    name: str, keys: tuple[str, ...], share: float, count: int
) -> None:
    forms, drawn = of(presets()[name])
    dearest, *others = cpu_seconds(*(many(forms[key], drawn, count) for key in keys))
    assert max(others) < share * dearest


@pytest.mark.parametrize(
    ("name", "least", "most"), [("clay-vase", 1e-6, 0.1), ("magnesium-oxide-ceramic", 1e-7, 0.1), ("foam", 1e-6, 0.5)]
)
def test_rungs_of_the_truth_come_nearer_to_it_the_more_they_take(name: str, least: float, most: float) -> None:
    forms, drawn = of(presets()[name])
    rungs = [key for key, form in forms.items() if form.kind == "quadrature"]
    errors = [l1(forms, drawn, key) for key in rungs]
    assert len(rungs) >= 3
    assert errors == sorted(errors)
    assert errors[0] < least < 0.001 < errors[-1] < most


def test_a_few_directions_of_one_wavelength_take_the_loop_of_many() -> None:
    # 256 directions took 2.5 times as long as they do now, each of them a row of its own
    forms, drawn = of(presets()["magnesium-oxide-ceramic"])
    evaluate = forms["sum"].evaluate
    few, more = drawn.wi[:256], np.resize(drawn.wi, (2560, 3))
    np.testing.assert_allclose(evaluate(more, more)[:256], evaluate(few, few), rtol=SUM)
    of_few, of_one = cpu_seconds(lambda: evaluate(few, few), lambda: evaluate(few[:1], few[:1]))
    assert of_few < 4.0 * of_one


@pytest.mark.parametrize("model", ["oren_nayar", "ward_half_vector"])
def test_a_table_of_another_model_says_where_its_numbers_come_from(model: str) -> None:
    preset = presets()["wall-plaster" if model == "oren_nayar" else "rolled-brass"]
    first, second, *_ = preset.parameters
    material = Material(
        **preset.model_dump(exclude={"model", "sources", "assumed", "note"}),
        model=model,
        sources={first: "a figure", list(preset.parameters)[-1]: "a table"},
        assumed={second: Assumption(why="a guess")},
        note="of another paper",
    )
    forms, _ = of(material, TOLERANCE)
    layout = forms["table-10"].layout
    assert layout is not None
    table = layout.source
    assert table.model != model
    assert (table.source, table.title, table.assumed, table.note) == (
        preset.source,
        preset.title,
        {second: Assumption(why="a guess")},
        material.note,
    )
    assert table.sources == {name: where for name, where in material.sources.items() if name in table.parameters}
    assert table == Material(**table.model_dump())  # as valid as one that was read


def test_a_table_takes_its_nodes_and_a_model_its_parameters() -> None:
    forms, _ = of(presets()["rolled-brass"], TOLERANCE)
    assert forms["elliptical"].bytes == 8 * len(presets()["rolled-brass"].parameters)
    nodes = (10, 10, 10, 37)  # every ten degrees, phi_i over a quarter turn
    assert forms["table-even"].bytes == 4 * np.prod(nodes) + 8 * sum(nodes)


def test_a_body_with_a_surface_is_their_weighted_sum() -> None:
    plaster = {"rho": 0.9, "sigma": float(radians(30.0)), "interreflection": True}
    weighted = {**plaster, "k_s": 0.0, "k_b": 0.5}
    body, half = (
        of(Material(name="m", title="m", model=model, parameters=parameters, source="a test"))[0]
        for model, parameters in (("oren_nayar", plaster), ("oren_nayar_body_surface", weighted))
    )
    wi, wr = unit_vector([0.7], [0.2]), unit_vector([0.4], [2.1])
    assert set(body) == set(half)
    for key in body:
        rtol = 1e-6 if body[key].dtype is np.float32 else 1e-14
        np.testing.assert_allclose(values(half[key], wi, wr), 0.5 * values(body[key], wi, wr), rtol=rtol, err_msg=key)


def test_a_mirror_has_no_sum_to_shorten() -> None:
    forms, _ = of(presets()["scene-plastic-cube"])
    assert not {"ten-terms", "beckmann"} & set(forms)


def test_other_models_are_their_own_truth() -> None:
    material = Material(name="m", title="m", model="minnaert", parameters={"k": 0.5, "rho": 0.7}, source="a test")
    forms, drawn = of(material)
    assert list(forms) == ["model", "model-float32"]
    assert l1(forms, drawn, "model") == 0.0
