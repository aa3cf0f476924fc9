"""Energy of the models behind tables: closed forms, published findings, white furnaces, bounds on a, and verdicts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numba
import numpy as np
import pytest
import scipy.optimize

from brdfdb import fresnel
from brdfdb.audit import energy as joined
from brdfdb.audit import model_energy
from brdfdb.audit.model_energy import (
    BOUND_TOLERANCE,
    FINE,
    LIMITS,
    TOLERANCE,
    EnergyVerdict,
    ModelEnergy,
    model_energy_of,
    published_excess,
)
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.integrals.uniform_bound import largest_uniform
from brdfdb.materials import Material, presets
from brdfdb.materials.provenance import KnownExcess
from brdfdb.models import MODELS
from tests.audit.a_table import PARAMETERS, known, lambert, material

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")

PEAK = 2e-4  # absolute, of the largest albedo over angles; measured 9e-5
SEVEN_DIGITS = 5e-7  # relative, half of the last digit that is written
UNIFORM = 2.5e-4  # relative, of the mean over uniform light with a pole at the horizon; measured 2e-4 for k = 0.5
WAVELENGTHS = np.array([400.0, 550.0, 780.0])
COS_LAST = float(np.cos(np.deg2rad(89.9)))  # of the last light of a model with a pole


def energy(made: Material, wavelength_nm: Any = None) -> ModelEnergy:
    if made.wavelengths_nm:
        wavelength_nm = made.wavelengths_nm
    wavelength = None if wavelength_nm is None else np.array(wavelength_nm)
    return model_energy_of(made, wavelength, published_excess(made, wavelength))


def at(found: Any, theta_i_deg: float) -> float:
    """The albedo at an angle, of the first wavelength."""
    return float(found.albedo[found.theta_i_deg.index(theta_i_deg)][0])


# Closed forms


def test_a_lambertian_reflects_rho_from_everywhere_and_its_furnace_is_ideal() -> None:
    found = energy(material("lambert", {"rho": 0.6}))
    assert (found.verdict, found.exceeds_1_from_theta_i_deg, found.bound_on_a) == ("conserves", None, None)
    for values, rho in ((found, 0.6), (found.furnace, 1.0)):
        assert {0.0, 45.0, 89.9, 90.0} <= set(values.theta_i_deg)
        np.testing.assert_allclose(values.albedo, rho, rtol=SEVEN_DIGITS)
        assert values.hemispherical == [rho]
    assert found.furnace.lossless == "rho = 1"


def test_a_mirror_reflects_what_fresnels_equations_say() -> None:
    found = energy(presets()["blue-plastic"])
    n = presets()["blue-plastic"].arguments([460.0])["n"]
    cos_i = np.cos(np.deg2rad(found.theta_i_deg))
    cos_t = np.sqrt(1.0 - (1.0 - cos_i**2) / n**2)
    s, p = (cos_i - n * cos_t) / (cos_i + n * cos_t), (n * cos_i - cos_t) / (n * cos_i + cos_t)
    reflectance = (s**2 + p**2) / 2.0
    np.testing.assert_allclose(np.ravel(found.specular), reflectance, rtol=SEVEN_DIGITS)
    np.testing.assert_allclose(np.ravel(found.albedo), reflectance + 0.15, rtol=SEVEN_DIGITS)
    assert found.integration_error <= TOLERANCE


@pytest.mark.parametrize("k", [0.5, 0.9])
def test_minnaerts_means_over_uniform_light_have_a_closed_form(k: float) -> None:
    found = energy(material("minnaert", {"k": k, "rho": 0.4}))
    cos_i = np.cos(np.deg2rad(found.theta_i_deg))
    np.testing.assert_allclose(np.ravel(found.albedo), 0.4 * cos_i ** (k - 1.0), atol=TOLERANCE)
    # 2 int cos^(k - 1) cos sin dtheta = 2 / (k + 1)
    np.testing.assert_allclose(found.hemispherical, 0.8 / (k + 1.0), rtol=UNIFORM)


def test_the_albedo_of_an_anisotropic_lobe_is_the_largest_over_azimuths() -> None:
    surface = {"rho_d": 0.1, "rho_s": 0.5, "alpha_x": 0.05, "alpha_y": 0.4}
    found = energy(material("ward", surface))
    phi_i = np.linspace(0.0, np.pi, 13)
    each, _ = directional_albedo("ward", np.deg2rad(60.0), phi_i, tolerance=TOLERANCE, **surface)
    assert np.ptp(each) > 0.02
    assert at(found, 60.0) == pytest.approx(each.max(), abs=2.0 * TOLERANCE)
    mean, _ = directional_albedo(
        "ward", np.deg2rad(np.linspace(0.9, 89.1, 50))[:, None], phi_i[:-1], tolerance=1e-4, **surface
    )
    sines = np.sin(2.0 * np.deg2rad(np.linspace(0.9, 89.1, 50)))
    assert found.hemispherical == [pytest.approx(np.average(mean.mean(axis=1), weights=sines), rel=2e-3)]


@pytest.mark.parametrize("model", ["ward", "ward_duer", "ward_bounded"])
def test_a_narrow_lobe_converges_up_to_grazing(model: str) -> None:
    found = energy(material(model, {"rho_d": 0.1, "rho_s": 0.3, "alpha_x": 0.01, "alpha_y": 0.01}))
    assert found.theta_i_deg[-1] == 89.9  # a pole: not 90
    assert found.integration_error <= TOLERANCE


# What nothing absorbs


def test_every_model_can_be_lossless_but_those_that_are_not_normalised() -> None:
    assert all(spec.excess for spec in MODELS.values() if spec.lossless is None)
    for name, spec in MODELS.items():
        if spec.lossless is not None:
            made = material(name, PARAMETERS[name])
            lossless = {**made.arguments(WAVELENGTHS if spec.spectral else None), **spec.lossless(made.parameters)}
            assert np.all(spec.evaluate(0.5, 0.0, 0.7, 3.0, **lossless) > 0.0)  # each in its range


@pytest.mark.parametrize(("rho_d", "rho_s"), [(0.2, 0.3), (0.0, 0.1), (0.7, 0.0), (0.0, 0.0)])
def test_wards_reflectances_are_scaled_to_a_sum_of_1(rho_d: float, rho_s: float) -> None:
    lossless = MODELS["ward"].lossless
    scaled = lossless({"rho_d": rho_d, "rho_s": rho_s, "alpha_x": 0.1, "alpha_y": 0.1})
    assert scaled["rho_d"] + scaled["rho_s"] == pytest.approx(1.0, rel=1e-15)
    assert scaled["rho_d"] * rho_s == pytest.approx(scaled["rho_s"] * rho_d, rel=1e-15)


def test_the_lossless_metal_of_he_and_torrance_absorbs_next_to_nothing() -> None:
    lossless = MODELS["he_torrance"].lossless
    metal = lossless({})
    n, k = metal["n"], metal["k"]
    cos = np.cos(np.deg2rad([0.0, 30.0, 60.0, 85.0, 89.0, 89.9]))
    lost = 1.0 - fresnel.unpolarised(cos, n, k)
    # of F_s and F_p for k well above n: 4 n cos / k^2 and 4 n / (k^2 cos), of unpolarised light the mean
    np.testing.assert_allclose(lost, 2.0 * n / k**2 * (cos + 1.0 / cos), rtol=0.01, atol=1e-15)
    assert np.max(1.0 - fresnel.unpolarised(np.append(0.0, np.logspace(-8, 0, 2000)), n, k)) < 1.01 * n / k


def test_wards_lobe_loses_half_of_the_light_at_60_degrees() -> None:
    """ERRATA of Ward 1992, eqs 4 and 5: the albedo of the lobe is about cos(theta_i), 0.49 for alpha of 0.1."""
    found = energy(material("ward", {"rho_d": 0.0, "rho_s": 0.4, "alpha_x": 0.1, "alpha_y": 0.1}))
    assert at(found.furnace, 60.0) == pytest.approx(0.49, abs=0.005)
    assert at(found.furnace, 60.0) == pytest.approx(at(found, 60.0) / 0.4, abs=4.0 * TOLERANCE)
    assert found.verdict == "loses"
    assert found.reason.startswith("lossless (rho_d = 0, rho_s = 1), the model reflects 0.")
    assert found.furnace.smallest < found.furnace.largest < 1.0


def test_he_and_torrances_gentle_slopes_reflect_all_near_the_normal_and_lose_light_near_grazing() -> None:
    found = energy(presets()["aluminum-cylinder-12b"], np.arange(380.0, 781.0, 100.0))
    assert found.furnace.wavelength_nm == [380.0, 580.0, 780.0]
    assert np.shape(found.furnace.albedo) == (len(found.theta_i_deg), 3)
    assert at(found.furnace, 0.0) == pytest.approx(1.0, abs=1e-3)  # ERRATA: 1.000 near normal incidence
    assert at(found.furnace, 85.0) < 0.7
    # Its lossless form also reflects a little more than arrives: an excess is not filed under a loss
    assert found.verdict == "gains"
    assert found.furnace.largest > 1.0
    at_nm = {found.furnace.smallest_at_wavelength_nm, found.furnace.largest_at_wavelength_nm}
    assert at_nm <= {380.0, 580.0, 780.0}
    assert all(f" and {nm:g} nm" in found.reason for nm in at_nm)


@pytest.mark.xfail(
    strict=True,
    reason="He et al. 1991, eqs 71-84: near grazing, where the diffuse part gives way to the specular one, both of a "
    "lossless surface as gentle as that of Fig. 12 (a) add up to 1.035, at 80 degrees and 780 nm",
)
def test_lossless_gentle_slopes_never_reflect_more_than_they_receive() -> None:
    found = energy(presets()["aluminum-cylinder-12a"], [780.0])
    assert found.furnace.largest <= 1.001


# What exceeds 1


@pytest.mark.parametrize(
    ("model", "parameters", "theta_i_deg", "albedo", "where"),
    [
        # ERRATA of Oren and Nayar 1994, eqs 27 and 28
        ("oren_nayar", {"rho": 1.0, "sigma_deg": 10}, 89.0, 1.031, "(Oren and Nayar 1994, eqs 27, 28 and 30"),
        ("oren_nayar", {"rho": 1.0, "sigma_deg": 20}, 89.0, 1.042, "(Oren and Nayar 1994, eqs 27, 28 and 30"),
        ("oren_nayar", {"rho": 1.0, "sigma_deg": 30}, 89.0, 1.012, "(Oren and Nayar 1994, eqs 27, 28 and 30"),
        # rho cos^(k - 1)
        ("minnaert", {"k": 0.5, "rho": 1.0}, 89.9, COS_LAST**-0.5, "(Oren and Nayar 1994, section 1"),
        ("minnaert", {"k": 0.6, "rho": 1.0}, 89.9, COS_LAST**-0.4, "degrees; grows as cos^-0.4; this model does so"),
    ],
)
def test_an_excess_of_the_model_itself_violates_unless_accepted(
    model: str, parameters: dict[str, float], theta_i_deg: float, albedo: float, where: str
) -> None:
    surface = material(model, parameters)
    found = energy(surface)
    assert at(found, theta_i_deg) == pytest.approx(albedo, abs=6e-4)
    assert found.verdict == "violates"
    assert f"; this model does so by itself for such parameters: up to {found.max_albedo:.4g}, from " in found.reason
    assert where in found.reason
    accepted = model_energy_of(surface, None, None, accept_excess=True)
    assert (accepted.verdict, accepted.reason) == ("accepted excess", found.reason)


def test_duers_normalisation_exceeds_1_without_bound() -> None:
    found = energy(material("ward_duer", {"rho_d": 0.0, "rho_s": 1.0, "alpha_x": 0.1, "alpha_y": 0.1}))
    assert at(found, 89.5) == pytest.approx(3.65, abs=5e-3)  # ERRATA of Ward 1992, later fixes
    assert (found.verdict, found.max_at_theta_i_deg) == ("violates", 89.9)


def test_the_verdict_says_up_to_which_light_it_holds_and_how_the_albedo_goes_on() -> None:
    brass = energy(presets()["rolled-brass"])
    assert brass.judged_up_to_theta_i_deg == 89.9
    assert (brass.grazing.power, brass.grazing.origin) == (0.5, "declared")
    assert brass.reason.endswith(
        "; with the given parameters, it reflects at most 0.417 of the incident light, for lights up to 89.9 degrees, "
        "at 0 degrees; grows as cos^-1/2 and exceeds 1 above 89.9965 degrees"
    )
    wide = {"rho_d": 0.3, "rho_s": 0.1, "alpha_x": 0.12, "alpha_y": 0.25}
    bounded = energy(material("ward_bounded", wide))
    assert bounded.reason.endswith("for lights up to 89.9 degrees, at 89.9 degrees; bounded, at most 0.4")
    assert energy(material("ward_duer", wide)).reason.startswith(
        "the model reflects 3.911 of the incident light at 89.9 degrees; grows as cos^-1; this model does so"
    )


@pytest.mark.parametrize(("k", "rho"), [(0.6, 0.9), (0.5, 0.3), (0.9, 0.8)])
def test_the_angle_from_which_on_more_is_reflected_than_received_is_that_of_a_closed_form(k: float, rho: float) -> None:
    found = energy(material("minnaert", {"k": k, "rho": rho}))
    # rho cos^(k - 1) = 1
    expected = np.degrees(np.arccos(rho ** (1.0 / (1.0 - k))))
    assert expected not in found.theta_i_deg
    assert found.exceeds_1_from_theta_i_deg == pytest.approx(expected, abs=2e-3)


def test_a_smooth_plastic_exceeds_1_where_fresnels_equations_say() -> None:
    plastic = presets()["blue-plastic"]
    n = float(plastic.arguments()["n"][0])

    def reflectance(theta: float) -> float:
        t = np.arcsin(np.sin(theta) / n)
        s, p = np.sin(theta - t) / np.sin(theta + t), np.tan(theta - t) / np.tan(theta + t)
        return float(s * s + p * p) / 2.0

    expected = np.degrees(scipy.optimize.brentq(lambda theta: reflectance(theta) + 0.15 - 1.0, 1.0, 1.57))
    assert energy(plastic).exceeds_1_from_theta_i_deg == pytest.approx(expected, abs=2e-3)


def test_the_published_magnesium_oxide_leaves_no_room_for_its_uniform_part() -> None:
    """ERRATA of He et al. 1991: 0.977 at 30 degrees, 1.016 at 60, 1.11 at 85."""
    found = energy(presets()["magnesium-oxide-ceramic"])
    for theta_i_deg, albedo in ((30.0, 0.977), (60.0, 1.016), (85.0, 1.116)):
        assert at(found, theta_i_deg) == pytest.approx(albedo, abs=6e-4)
    assert found.verdict == "known published excess"
    assert (found.bound_on_a.preset, found.bound_on_a.keeps) == ([0.9], False)
    assert found.bound_on_a.largest == [pytest.approx(0.777, abs=5e-4)]


@pytest.mark.parametrize("excess", [None, known(1.2, 50.0), known(1.1, 50.0), known(1.2, 60.1)])
def test_an_excess_is_known_as_far_as_it_is_published(excess: KnownExcess | None) -> None:
    found = model_energy_of(presets()["magnesium-oxide-ceramic"], np.array([500.0]), excess)
    published = excess == known(1.2, 50.0)  # of 1.123, from 54 degrees on
    assert found.verdict == ("known published excess" if published else "violates")
    assert found.reason.startswith("reflects 1.123 of" if published else "the model reflects 1.")
    assert ("Somebody 1991" in found.reason) == published


def test_an_excess_is_published_of_the_very_parameters_of_a_paper() -> None:
    magnesium = presets()["magnesium-oxide-ceramic"]
    at_500 = np.array([500.0])
    assert published_excess(magnesium, at_500) == magnesium.known_excess
    assert published_excess(magnesium.model_copy(update={"name": "mine"}), at_500) == magnesium.known_excess
    assert published_excess(magnesium, np.array([500.0, 600.0])) is None
    for change in ({"parameters": {**magnesium.parameters, "a": 0.91}}, {"refractive_index": "main/Al/Rakic"}):
        assert published_excess(magnesium.model_copy(update=change), at_500) is None
    gold = material("he_torrance", {"sigma_0_um": 0.1, "tau_um": 3.0}, refractive_index="main/Au/Johnson")
    assert published_excess(gold, at_500) is None


@pytest.mark.parametrize("name", [name for name, each in presets().items() if each.known_excess])
def test_no_published_excess_rests_on_what_was_assumed(name: str) -> None:
    preset = presets()[name]
    others = {"refractive_index": ["main/Al2O3/Malitson-o", "main/H2O/Hale"], "tau_um": [0.1, 50.0]}
    for value in preset.assumed:
        for other in others[value]:
            parameters = preset.parameters if value == "refractive_index" else {**preset.parameters, value: other}
            index = other if value == "refractive_index" else preset.refractive_index
            changed = preset.model_copy(update={"parameters": parameters, "refractive_index": index})
            found = energy(changed)
            assert found.max_albedo == pytest.approx(preset.known_excess.max_albedo, abs=1e-4)


def doctored(monkeypatch: pytest.MonkeyPatch, change: Callable[[Any, Any], Any]) -> ModelEnergy:
    """Energy of a Lambertian whose f_r, 0.95 / pi, is changed by a function of light and viewer."""

    def vectors(wi: Any, wr: Any, *, rho: float) -> Any:
        return rho / np.pi + change(wi, wr)

    monkeypatch.setitem(MODELS, "lambert", replace(MODELS["lambert"], vectors=vectors))
    return energy(material("lambert", {"rho": 0.95}))


def test_a_model_that_is_not_finite_violates_and_is_null(monkeypatch: pytest.MonkeyPatch) -> None:
    found = doctored(monkeypatch, lambda wi, wr: np.where(wr[..., 2] * wi[..., 2] < 0.1, np.nan, 0.0))
    assert (found.verdict, found.max_albedo) == ("violates", None)
    assert found.reason == "the model reflects no finite share of the incident light at 0 degrees"
    assert ModelEnergy.model_validate_json(found.model_dump_json()) == found


def test_an_integral_that_gives_up_at_one_light_excuses_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    def rough_at_60(wi: Any, wr: Any) -> Any:
        dark = abs(wi[..., 2] - 0.5) < 1e-9
        return np.where(dark, -0.5 * np.sin(1e6 * wr[..., 0]) ** 2, 0.1) / np.pi

    found = doctored(monkeypatch, rough_at_60)
    assert found.integration_error > 0.05
    assert (found.verdict, found.max_albedo) == ("violates", pytest.approx(1.05))


# The bound on a


def test_bounds_of_many_surfaces_at_once_are_those_of_each() -> None:
    copper = presets()["scene-copper-sphere"].arguments(WAVELENGTHS)
    surfaces = {name: copper[name] for name in ("wavelength_nm", "sigma_0_um", "tau_um", "n", "k")}
    together = largest_uniform("he_torrance", **surfaces, tolerance=1e-6)
    for w in range(WAVELENGTHS.size):
        one = {name: np.ravel(value)[w % np.size(value)] for name, value in surfaces.items()}
        assert together[w] == pytest.approx(largest_uniform("he_torrance", **one, tolerance=1e-6), abs=2e-6)
        theta_i = np.deg2rad(np.linspace(0.0, 89.5, 40))
        reflectance, _ = directional_albedo("he_torrance", theta_i, tolerance=1e-6, specular=True, **one)
        assert reflectance.max() <= 1.0 - together[w] + 2e-6
    found = energy(presets()["scene-copper-sphere"], WAVELENGTHS).bound_on_a
    assert found.keeps
    np.testing.assert_allclose(np.array(found.largest, dtype=float), together, atol=BOUND_TOLERANCE)


@pytest.mark.parametrize(
    ("model", "parameters"),
    [
        ("oren_nayar_gaussian", {"rho": 0.7, "sigma_deg": 30}),
        ("ward", {"rho_d": 0.1, "rho_s": 0.2, "alpha_x": 0.1, "alpha_y": 0.3}),
    ],
)
def test_a_model_and_its_furnace_have_the_albedos_of_each(model: str, parameters: dict[str, float]) -> None:
    surface = material(model, parameters)
    lights = model_energy._Lights(np.array([0.0, 60.0]), np.zeros(2))
    model = model_energy._Model.of(surface, None, LIMITS)
    for both, alone in zip(model.reflected(lights), (surface, model.lossless.source), strict=True):
        expected, nothing = model._replace(source=alone, lossless=None).reflected(lights)
        assert nothing is None
        np.testing.assert_allclose(both.largest, expected.largest, atol=2.0 * TOLERANCE)
        np.testing.assert_allclose(both.mean, expected.mean, atol=2.0 * TOLERANCE)


def test_an_albedo_is_integrated_again_where_it_is_closer_to_a_limit_than_its_error() -> None:
    surface = material("ward", {"rho_d": 0.1, "rho_s": 0.2, "alpha_x": 0.15, "alpha_y": 0.15})
    lights = model_energy._Lights(np.array([30.0, 80.0]), np.zeros(2))
    model = model_energy._Model(surface, None, None, None, (2.0,))
    coarse = model.reflected(lights).source
    assert FINE < coarse.error[1, 0] <= TOLERANCE
    limit = float(coarse.largest[1, 0]) + 0.5 * float(coarse.error[1, 0])
    fine = model._replace(limits=(limit,)).reflected(lights).source
    assert fine.error[1, 0] <= FINE
    assert fine.error[0, 0] == coarse.error[0, 0]
    exact, _ = directional_albedo("ward", np.deg2rad(80.0), tolerance=1e-9, **surface.arguments())
    assert abs(fine.largest[1, 0] - exact) <= fine.error[1, 0]
    assert abs(coarse.largest[1, 0] - exact) <= coarse.error[1, 0]


# Model and table together


@pytest.mark.parametrize(
    ("of_model", "of_table", "verdict", "reason"),
    [
        ("conserves", "passes", "conserves", "model"),
        ("loses", "passes", "loses", "model"),
        ("gains", "passes", "gains", "model"),
        ("loses", "known published excess", "known published excess", "table"),
        ("conserves", "violates", "violates", "the table table"),
        ("known published excess", "known published excess", "known published excess", "model"),
        ("violates", "known published excess", "violates", "model"),
    ],
)
def test_the_worse_of_model_and_table_counts(
    of_model: EnergyVerdict, of_table: str, verdict: str, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    table, made = lambert(0.5), material("lambert", {"rho": 0.5})
    both = joined.energy_of(table, made)
    model = both.model.model_copy(update={"verdict": of_model, "reason": "model"})
    stored = both.table.model_copy(update={"verdict": of_table, "reason": "table"})
    monkeypatch.setattr(joined, "model_energy_of", lambda *_, **__: model)
    monkeypatch.setattr(joined, "table_energy_of", lambda *_, **__: stored)
    found = joined.energy_of(table, made)
    assert (found.verdict, found.reason) == (verdict, reason)


def test_a_peak_between_round_angles_is_found() -> None:
    """The plastic table of He et al.: largest where shadowing begins, at angles that nobody would ask for."""
    table = presets()["scene-plastic-table"]
    wavelength_nm = np.array([550.0])
    found = model_energy_of(table, wavelength_nm, None)
    theta_i = np.radians(np.arange(78.0, 87.0, 0.25))
    arguments = table.arguments(550.0)
    dense, _ = directional_albedo("he_torrance", theta_i, tolerance=1e-7, specular=True, **arguments)
    assert found.max_albedo == pytest.approx(float(np.max(dense)), abs=PEAK)
    assert found.max_at_theta_i_deg == pytest.approx(float(np.degrees(theta_i[np.argmax(dense)])), abs=0.5)
    (largest,) = (each for each in found.bound_on_a.largest if each is not None)
    assert 1.0 - largest == pytest.approx(found.max_albedo - float(table.parameters["a"]), abs=2.0 * PEAK)
