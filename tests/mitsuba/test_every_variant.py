"""Every plugin in every variant of Mitsuba that is installed: values, densities, samples; nan; masked rays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("mitsuba")

import brdfdb.mitsuba.table
from tests.mitsuba.every_variant import CASES, PAIRS, PAIRS_ONE_BY_ONE, case_of, measure, tabulated
from tests.mitsuba.surfaces import variant

VARIANTS = (
    *("scalar_rgb", "scalar_spectral", "scalar_spectral_polarized"),
    *("llvm_ad_rgb", "llvm_ad_mono", "llvm_ad_mono_polarized", "llvm_ad_spectral", "llvm_ad_spectral_polarized"),
    *("cuda_ad_rgb", "cuda_ad_mono", "cuda_ad_mono_polarized", "cuda_ad_spectral", "cuda_ad_spectral_polarized"),
)
# Relative. The largest measured are 2e-5, 4e-6 and 3e-7; tables are steep logarithms, of angles of float32
OF_TABLES, OF_MODELS, DENSITY, WEIGHT = 5e-5, 5e-6, 1e-5, 2e-6
SIGNIFICANCE = 1e-3  # of 200 cases together 0.2 reject by chance; the random numbers are always the same

GOOD, NAN, INF = (0.6, 0.0, 0.8), np.nan, np.inf
NOT_FINITE = ((NAN, 0.0, 0.8), (0.6, NAN, 0.8), (0.6, 0.0, NAN), (INF, 0.0, 0.8), (0.6, 0.0, INF), (NAN, NAN, NAN))


@pytest.fixture(autouse=True)
def tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(brdfdb.mitsuba.table, "loaded", tabulated)


def test_all_variants_are_named() -> None:
    mitsuba = pytest.importorskip("mitsuba")
    assert set(mitsuba.variants()) <= set(VARIANTS)


def test_all_plugins_are_judged() -> None:
    assert {case_of(name).document["type"] for name in CASES} == set(brdfdb.mitsuba.PLUGINS)


@pytest.mark.parametrize("name", VARIANTS)
def test_values_densities_and_samples_are_those_of_the_library(name: str) -> None:
    mitsuba = variant(name)
    for plugin in CASES:
        case = case_of(plugin)
        measured = measure(mitsuba, case)
        assert measured.pairs >= (PAIRS_ONE_BY_ONE if name.startswith("scalar") else PAIRS), plugin
        assert measured.value <= (OF_MODELS if case.table is None else OF_TABLES), plugin
        assert measured.density <= DENSITY, plugin
        assert measured.weight <= WEIGHT, plugin
        assert measured.p_value >= SIGNIFICANCE, plugin


def place_of(mitsuba: Any, wi: tuple[float, ...]) -> Any:
    place = mitsuba.SurfaceInteraction3f()
    place.wi = mitsuba.Vector3f(*wi)
    if mitsuba.is_spectral:
        place.wavelengths = [450.0, 500.0, 550.0, 600.0]
    return place


def numbers(*results: Any) -> Any:
    """Return all numbers of results in one array."""
    return np.concatenate([np.ravel(np.array(result, dtype=np.float64)) for result in results])


@pytest.mark.parametrize("name", VARIANTS)
def test_nan_in_nan_out_and_masked_rays_are_0(name: str) -> None:
    mitsuba = variant(name)
    context = mitsuba.BSDFContext()
    few = name.startswith("scalar")  # which compute nothing beforehand, and take a ray at a time
    for plugin in CASES:
        surface = mitsuba.load_dict(case_of(plugin).document)
        for bad in NOT_FINITE[::3] if few else NOT_FINITE:
            for wi, wo in ((bad, GOOD), (GOOD, bad)):
                asked = context, place_of(mitsuba, wi), mitsuba.Vector3f(*wo)
                assert np.all(np.isnan(numbers(surface.eval(*asked), surface.pdf(*asked), *surface.eval_pdf(*asked))))
                assert np.all(numbers(*surface.eval_pdf(*asked, False)) == 0.0)
        for wi, u in (
            (bad, (0.3, 0.2, 0.7)),
            (GOOD, (NAN, 0.2, 0.7)),
            (GOOD, (0.3, NAN, 0.7)),
            (GOOD, (0.3, 0.2, NAN)),
        ):
            asked = context, place_of(mitsuba, wi), u[0], mitsuba.Point2f(*u[1:])
            sample, weight = surface.sample(*asked)
            assert np.all(np.isnan(numbers(sample.wo, sample.pdf, weight)))
            sample, weight = surface.sample(*asked, False)
            assert np.all(numbers(sample.pdf, weight) == 0.0)
        both = mitsuba.load_dict({"type": "twosided", "bsdf": surface})
        both.eval_pdf(context, place_of(mitsuba, bad), mitsuba.Vector3f(*GOOD))  # the process goes on


@pytest.mark.parametrize("name", [name for name in VARIANTS if "spectral" in name])
def test_a_wavelength_that_is_nan_gives_nan(name: str) -> None:
    mitsuba = variant(name)
    for plugin in ("he_torrance-gold", "table-spectral", "table-factored", "table-mixture"):
        surface, place = mitsuba.load_dict(case_of(plugin).document), place_of(mitsuba, GOOD)
        place.wavelengths = [500.0, NAN, 550.0, 600.0]
        value = surface.eval(mitsuba.BSDFContext(), place, mitsuba.Vector3f(0.0, 0.6, 0.8))
        assert np.all(np.isnan(numbers(value)))


@pytest.mark.parametrize("name", ["scalar_rgb", "llvm_ad_rgb", "cuda_ad_rgb"])
def test_a_texture_that_is_nan_gives_nan(name: str) -> None:
    mitsuba = variant(name)

    def texture() -> dict[str, Any]:  # a plugin takes the picture away
        picture = mitsuba.TensorXf(np.array([[[0.2], [NAN]]], np.float32))
        return {"type": "bitmap", "data": picture, "raw": True, "filter_type": "nearest"}

    surfaces = (
        {"type": "brdfdb_ward", "rho_d": 0.1, "rho_s": 0.5, "alpha": texture()},
        {"type": "brdfdb_he_torrance", "sigma_0_um": texture(), "tau_um": 2.0, "n": 1.5, "k": 0.0},
        {"type": "brdfdb_hapke", "w": 0.5, "b": texture(), "c": 0.6, "b_0": 0.8, "h": 0.08, "theta_bar_deg": 10.0},
    )
    for document in surfaces:
        surface, place = mitsuba.load_dict(document), place_of(mitsuba, GOOD)
        for u, known in ((0.25, True), (0.75, False)):
            place.uv = mitsuba.Point2f(u, 0.5)
            results = surface.eval_pdf(mitsuba.BSDFContext(), place, mitsuba.Vector3f(0.0, 0.6, 0.8))
            assert np.all(np.isfinite(numbers(*results)) == known)


@pytest.mark.parametrize("name", ["scalar_rgb", "llvm_ad_mono", "scalar_spectral_polarized"])
def test_every_plugin_has_a_diffuse_reflectance(name: str) -> None:
    mitsuba = variant(name)
    for plugin in CASES:
        surface = mitsuba.load_dict(case_of(plugin).document)
        assert np.all(np.isfinite(numbers(surface.eval_diffuse_reflectance(place_of(mitsuba, GOOD)))))
    surface = mitsuba.load_dict(case_of("he_torrance").document)
    reflectance = numbers(surface.eval_diffuse_reflectance(place_of(mitsuba, GOOD)))
    assert reflectance[0] == pytest.approx(0.05)  # the uniform part, which is `a`
