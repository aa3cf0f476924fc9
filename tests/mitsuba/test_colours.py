"""Spectra in variants of Mitsuba: n and k at the wavelengths of channels, sRGB of f_r, and what has no colour."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mitsuba")

import brdfdb.mitsuba.table
from brdfdb.formats import mitsuba as exporter
from brdfdb.models import MODELS
from brdfdb.refractive_indices import refractive_index
from tests.mitsuba.every_variant import MONO_NM, RGB_NM, results_of, tabulated
from tests.mitsuba.surfaces import Array, directions, variant
from tests.tables.made_up import made_up

STORED = np.arange(380.0, 781.0, 1.0)
SURFACE = {"sigma_0_um": 0.25, "tau_um": 1.5}
FLOAT32 = 5e-6
WI, WR = (0.6, 0.0, 0.8), (-0.36, 0.48, 0.8)
PLANNED, COLOURS = 0.1, 0.01  # of f_r, 99 in 100, and of R / G, 95 in 100: the tolerance of the table is 0.1
METALS = pytest.mark.parametrize("metal", ["Au", "Cu"])


@pytest.fixture(autouse=True)
def tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(brdfdb.mitsuba.table, "loaded", tabulated)


def metal_of(name: str, stored: Array = STORED, **options: Any) -> dict[str, Any]:
    """Return a plugin with n and k of a metal as spectra."""
    document = {"type": "brdfdb_he_torrance", **SURFACE, **options}
    for key, values in zip(("n", "k"), refractive_index(f"main/{name}/Johnson", stored), strict=True):
        document[key] = {"type": "spectrum", "value": list(zip(stored.tolist(), values.tolist(), strict=True))}
    return document


def model_of(name: str, nm: float, **indices: Any) -> float:
    """Return f_r [1/sr] of the model at the wavelength, with n and k of the metal there or with others."""
    known = dict(zip(("n", "k"), refractive_index(f"main/{name}/Johnson", nm), strict=True)) | indices
    return float(MODELS["he_torrance"].vectors(np.array(WI), np.array(WR), **SURFACE, **known, wavelength_nm=nm))


def f_r(mitsuba: Any, document: dict[str, Any], nm: list[float] | None = None) -> Array:
    """Return f_r [1/sr] of a plugin in all channels."""
    place = mitsuba.SurfaceInteraction3f()
    place.wi = mitsuba.Vector3f(*WI)
    if mitsuba.is_spectral:
        place.wavelengths = nm or [450.0, 500.0, 550.0, 600.0]
    value = mitsuba.load_dict(document).eval(mitsuba.BSDFContext(), place, mitsuba.Vector3f(*WR))
    return np.ravel(np.array(value[0, 0] if mitsuba.is_polarized else value, dtype=np.float64)) / WR[2]


@METALS
@pytest.mark.parametrize("name", ["scalar_rgb", "llvm_ad_rgb", "llvm_ad_mono", "llvm_ad_mono_polarized"])
def test_n_and_k_are_those_at_the_wavelengths_of_the_channels(metal: str, name: str) -> None:
    mitsuba = variant(name)
    nm = RGB_NM if mitsuba.is_rgb else [MONO_NM]
    values = f_r(mitsuba, metal_of(metal, channels="wavelengths"))
    np.testing.assert_allclose(values, [model_of(metal, at) for at in nm], rtol=1e-4)


@METALS
@pytest.mark.parametrize("name", ["scalar_rgb", "scalar_spectral", "llvm_ad_mono", "llvm_ad_spectral_polarized"])
def test_one_wavelength_of_all_channels_is_that_of_n_and_k(metal: str, name: str) -> None:
    values = f_r(variant(name), metal_of(metal, wavelength_nm=480.0))
    np.testing.assert_allclose(values, np.full(values.size, model_of(metal, 480.0)), rtol=FLOAT32)


def test_a_colour_of_n_stands_for_the_wavelengths_of_the_channels() -> None:
    mitsuba = variant("scalar_rgb")
    n, k = refractive_index("main/Au/Johnson", RGB_NM)
    document = metal_of("Au") | {name: {"type": "rgb", "value": x.tolist()} for name, x in (("n", n), ("k", k))}
    np.testing.assert_allclose(f_r(mitsuba, document), [model_of("Au", nm) for nm in RGB_NM], rtol=FLOAT32)


def test_spectra_continue_as_constants() -> None:
    mitsuba = variant("scalar_spectral")
    nm = [400.0, 500.0, 700.0, 830.0]
    ward = {"type": "brdfdb_ward", "rho_d": spectrum((500.0, 0.2), (600.0, 0.6)), "rho_s": 0.0, "alpha": 0.2}
    np.testing.assert_allclose(f_r(mitsuba, ward, nm), np.array([0.2, 0.2, 0.6, 0.6]) / np.pi, rtol=FLOAT32)
    short = f_r(mitsuba, metal_of("Cu", np.array([500.0, 550.0, 600.0])), nm)
    ends = [refractive_index("main/Cu/Johnson", at) for at in (500.0, 500.0, 600.0, 600.0)]
    expected = [model_of("Cu", at, n=n, k=k) for at, (n, k) in zip(nm, ends, strict=True)]
    np.testing.assert_allclose(short, expected, rtol=FLOAT32)


def spectrum(*values: tuple[float, float]) -> dict[str, Any]:
    return {"type": "spectrum", "value": list(values)}


def test_spectra_that_have_no_colour_or_leave_their_range_are_refused() -> None:
    mitsuba = variant("scalar_rgb")
    few, ward = metal_of("Cu", np.array([450.0, 550.0, 650.0])), {"type": "brdfdb_ward", "rho_s": 0.0, "alpha": 0.2}
    colour = {"n": {"type": "rgb", "value": [0.2, 0.4, 1.4]}, "channels": "srgb"}
    for document, sentence in (
        (ward | {"rho_d": spectrum((420.0, 0.5), (680.0, 1.5))}, r"rho_d: 1.5 is outside \[0, 1\]"),
        (metal_of("Au") | {"k": spectrum((420.0, 1.0), (680.0, -1.0))}, r"k: -1 is outside \[0, 10000\]"),
        (metal_of("Au") | colour, "n: a colour or a texture has no spectrum, and channels = srgb needs one"),
        (few, "channels: wavelengths of 450 to 650 nm give no colour"),
        (few | {"channels": "xyz"}, "channels: 'xyz' is neither srgb nor wavelengths"),
    ):
        with pytest.raises(RuntimeError, match=sentence):
            mitsuba.load_dict(document)
    assert np.all(np.isfinite(f_r(mitsuba, few | {"channels": "wavelengths"})))


def test_a_scene_sees_no_parameter_that_changes_nothing() -> None:
    mitsuba = variant("llvm_ad_rgb")
    shown = {
        channels: mitsuba.traverse(mitsuba.load_dict(metal_of("Au", channels=channels)))
        for channels in ("srgb", "wavelengths")
    }
    assert {"sigma_0_um.value", "tau_um.value"} <= set(shown["srgb"].keys())
    assert not {"n.value", "k.value"} & set(shown["srgb"].keys())
    assert {"n.value", "k.value"} <= set(shown["wavelengths"].keys())


def test_a_table_is_not_looked_up_outside_its_wavelengths(monkeypatch: pytest.MonkeyPatch) -> None:
    infrared = made_up("isotropic", np.array([1400.0, 1420.0, 1440.0]))
    monkeypatch.setattr(brdfdb.mitsuba.table, "loaded", lambda *_: infrared)
    document = {"type": "brdfdb_table", "material": "infrared"}
    for name, options, sentence in (
        ("scalar_rgb", {}, "channels: wavelengths of 1400 to 1440 nm give no colour"),
        ("scalar_rgb", {"channels": "wavelengths"}, r"wavelength_nm: 611.4 is outside \[1400, 1440\] nm"),
        ("scalar_spectral", {"wavelength_nm": 500.0}, r"wavelength_nm: 500 is outside \[1400, 1440\] nm"),
        ("llvm_ad_mono", {}, r"wavelength_nm: 549.1 is outside \[1400, 1440\] nm"),
    ):
        with pytest.raises(RuntimeError, match=sentence):
            variant(name).load_dict(document | options)
    for name in ("scalar_rgb", "scalar_spectral", "llvm_ad_mono"):
        values = f_r(variant(name), document | {"wavelength_nm": 1410.0})
        expected = infrared.lookup_vectors(np.float32(WI).astype(float), np.float32(WR).astype(float), 1410.0)
        np.testing.assert_allclose(values, np.full(values.size, expected), rtol=5e-5)


@pytest.mark.parametrize("name", ["llvm_ad_rgb", "llvm_ad_spectral_polarized", "cuda_ad_rgb"])
def test_the_plugin_of_a_model_and_that_of_its_table_agree(name: str, tmp_path: Path) -> None:
    mitsuba, table = variant(name), tabulated("factored")
    wi, wr = directions(200, seed=3)
    nm, values = np.array([430.0, 500.0, 560.0, 650.0]), []
    for plugin in ("model", "table"):
        written = exporter.write(table, tmp_path / f"{plugin}.xml", plugin=plugin).paths[1]
        surface = mitsuba.load_dict(json.loads(written.read_text(encoding="utf-8")))
        (value,) = results_of(mitsuba, nm, lambda *asked, surface=surface: (surface.eval(*asked),), wi, wr)
        values.append(value / wr[:, 2:])
    model, tabular = values
    bright = np.all(model > 0.01, axis=1) & (np.minimum(wi[:, 2], wr[:, 2]) > 0.01)
    model, tabular = model[bright], tabular[bright]
    assert np.quantile(np.abs(tabular / model - 1.0), 0.99) <= PLANNED
    if mitsuba.is_rgb:
        ratios = (tabular[:, 0] / tabular[:, 1]) / (model[:, 0] / model[:, 1])
        assert np.quantile(np.abs(ratios - 1.0), 0.95) <= COLOURS
