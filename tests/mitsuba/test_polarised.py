"""The plugins in polarised variants: Mueller matrices of models and tables, and the Stokes picture of a sphere."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from brdfdb.geometry import spherical_angles, unit_vector
from brdfdb.models import (
    he_torrance_mueller_vectors,
    he_torrance_specular_mueller_vectors,
    oren_nayar_qualitative_vectors,
)
from brdfdb.tables import stokes
from tests.formats.a_file import random_pairs
from tests.formats.test_kaist import NM, plastic
from tests.mitsuba.polarised import Array, as_mitsuba_has_them, off_by, picture_of_lookups, picture_of_mitsuba
from tests.mitsuba.surfaces import interaction, specular_sample, variant, vectors
from tests.mitsuba.test_table import surface_of

FLOAT32, OF_TABLES = 2e-5, 5e-5  # of elements over the first one
IMAGE = 0.01  # share of I, Q and U by which a picture is off
PAIRS = 2000
MONO_NM = 549.1
INDICES = {"plastic": (1.53, 0.0), "copper": (1.13, 2.56), "silver": (0.05, 3.1)}
ROUGH = {"sigma_0_um": 0.3, "tau_um": 1.5, "a": 0.1, "wavelength_nm": NM}


def he_torrance(n: float, k: float) -> dict[str, Any]:
    return {"type": "brdfdb_he_torrance", "n": n, "k": k, **ROUGH}


def rounded(n: float, k: float) -> dict[str, float]:
    """Return the arguments of the model, rounded to float32 as Mitsuba reads them."""
    return {name: float(np.float32(value)) for name, value in {"n": n, "k": k, **ROUGH}.items()}


def pairs() -> tuple[Array, Array]:
    wi, wr = random_pairs(PAIRS, 8, 0.1)
    wi[:10] = wr[:10]  # back towards the light, where any plane serves
    return wi.astype(np.float32), wr.astype(np.float32)


def matrices(value: Any) -> Array:
    """Return the first channel of matrices of Mitsuba, shape (N, 4, 4)."""
    elements = np.broadcast_arrays(*(np.array(value[i, j])[0] for i in range(4) for j in range(4)))
    return np.stack(elements, axis=-1).reshape(-1, 4, 4)


def reflected(mitsuba: Any, surface: Any, wi: Array, wr: Array) -> Array:
    """Return matrices times the cosine: in radiance mode, light arrives along wo."""
    place = interaction(mitsuba, wr)
    if mitsuba.is_spectral:
        place.wavelengths = [NM] * 4
    value = surface.eval(mitsuba.BSDFContext(), place, vectors(mitsuba, wi))
    return matrices(value) / wi[:, 2, np.newaxis, np.newaxis]


def exact(wi: Array, wr: Array) -> tuple[Array, Array]:
    return tuple(w / np.linalg.norm(w, axis=-1, keepdims=True) for w in (wi.astype(np.float64), wr.astype(np.float64)))


@pytest.mark.parametrize("name", ["llvm_ad_mono_polarized", "llvm_ad_spectral_polarized"])
@pytest.mark.parametrize("index", INDICES)
def test_matrices_are_those_of_the_model(index: str, name: str) -> None:
    mitsuba = variant(name)
    wi, wr = pairs()
    theirs = reflected(mitsuba, mitsuba.load_dict(he_torrance(*INDICES[index])), wi, wr)
    matrix = he_torrance_mueller_vectors(*exact(wi, wr), **rounded(*INDICES[index]))
    ours = as_mitsuba_has_them(mitsuba, matrix, *exact(wi, wr))
    assert np.max(np.abs(theirs - ours) / ours[:, :1, :1]) <= FLOAT32
    assert np.abs(ours[:, 1:, 1:] / ours[:, :1, :1]).max() > 0.5  # the light is polarised


@pytest.mark.parametrize("name", ["llvm_ad_mono_polarized", "llvm_ad_spectral_polarized"])
def test_matrices_are_those_of_the_table(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mitsuba = variant(name)
    wi, wr = pairs()
    surface = surface_of(mitsuba, monkeypatch, plastic())
    theirs = reflected(mitsuba, surface, wi, wr)
    at = NM if mitsuba.is_spectral else MONO_NM
    ours = as_mitsuba_has_them(mitsuba, plastic().mueller_vectors(*exact(wi, wr), at), *exact(wi, wr))
    assert np.quantile(np.abs(theirs - ours) / ours[:, :1, :1], 0.999) <= OF_TABLES


@pytest.mark.parametrize("name", ["llvm_ad_spectral_polarized", "llvm_ad_mono_polarized"])
def test_the_stokes_picture_of_a_sphere_is_that_of_the_model(name: str) -> None:
    mitsuba = variant(name)
    check_picture(picture_of_mitsuba(mitsuba, he_torrance(*INDICES["plastic"])), picture_of_lookups(in_plane))


def test_the_stokes_picture_of_a_sphere_is_that_of_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    mitsuba = variant("llvm_ad_mono_polarized")
    surface_of(mitsuba, monkeypatch, plastic())  # of this material in any store
    theirs = picture_of_mitsuba(mitsuba, {"type": "brdfdb_table", "material": "plastic"})
    check_picture(theirs, picture_of_lookups(lambda wi, wr: plastic().mueller_in_plane(wi, wr, MONO_NM)))


def check_picture(theirs: Array, ours: Array) -> None:
    assert max(off_by(theirs, ours)) <= IMAGE
    assert np.abs(ours[..., 1:3]).sum() / ours[..., 0].sum() > 0.1
    assert np.abs(theirs[..., 3]).max() <= 1e-6  # one reflection of unpolarised light makes no circular light


def in_plane(wi: Array, wr: Array) -> Array:
    """Return matrices of the model between bases of the plane of light and viewer."""
    plane = stokes.plane(*spherical_angles(wi), *spherical_angles(wr))
    matrix = he_torrance_mueller_vectors(wi, wr, **rounded(*INDICES["plastic"]))
    return np.swapaxes(plane.viewer, -1, -2) @ matrix @ np.swapaxes(plane.light, -1, -2)


def test_samples_of_the_specular_part_carry_its_matrix() -> None:
    mitsuba = variant("llvm_ad_mono_polarized")
    wr = unit_vector(np.linspace(0.05, 1.5, 100), np.linspace(0.0, 6.0, 100)).astype(np.float32)
    smooth = {**rounded(1.53, 0.0), "sigma_0_um": float(np.float32(0.02))}
    surface = mitsuba.load_dict({"type": "brdfdb_he_torrance", **smooth})
    sample, weight = specular_sample(mitsuba, surface, interaction(mitsuba, wr))
    wi = np.array(sample.wo).T
    del smooth["a"]
    ours = as_mitsuba_has_them(
        mitsuba, he_torrance_specular_mueller_vectors(exact(wi, wr)[0], **smooth), *exact(wi, wr)
    )
    assert np.max(np.abs(matrices(weight) - ours) / ours[:, :1, :1]) <= FLOAT32


@pytest.mark.parametrize("name", ["scalar_spectral_polarized", "llvm_ad_mono_polarized"])
def test_importance_travels_the_other_way(name: str) -> None:
    mitsuba = variant(name)
    surface = mitsuba.load_dict(he_torrance(*INDICES["copper"]))
    importance = mitsuba.BSDFContext(mitsuba.TransportMode.Importance)
    one, other = mitsuba.Vector3f(0.6, 0.0, 0.8), mitsuba.Vector3f(-0.48, 0.64, 0.6)
    values = []
    for context, wi, wo in ((mitsuba.BSDFContext(), one, other), (importance, other, one)):
        place = mitsuba.SurfaceInteraction3f()
        place.wi = wi
        values.append(np.array(matrices_of_one(surface.eval(context, place, wo))) / float(np.ravel(wo.z)[0]))
    np.testing.assert_allclose(values[0], values[1], rtol=1e-4, atol=1e-7)


def matrices_of_one(value: Any) -> list[list[float]]:
    return [[float(np.ravel(value[i, j])[0]) for j in range(4)] for i in range(4)]


def test_models_without_polarisation_depolarise() -> None:
    mitsuba = variant("llvm_ad_mono_polarized")
    wi, wr = pairs()
    of_clay = {"form": "oren_nayar_qualitative", "rho": 0.7, "sigma_deg": 20.0}
    surface = mitsuba.load_dict({"type": "brdfdb_oren_nayar", **of_clay})
    theirs = reflected(mitsuba, surface, wi, wr)
    sigma = float(np.deg2rad(np.float32(20.0)))
    f_r = oren_nayar_qualitative_vectors(*exact(wr, wi), rho=float(np.float32(0.7)), sigma=sigma)
    np.testing.assert_allclose(theirs[:, 0, 0], f_r, rtol=FLOAT32)
    assert np.count_nonzero(theirs) == np.count_nonzero(theirs[:, 0, 0])
