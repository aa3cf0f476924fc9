"""Directions that pictures of tables draw of an environment: unbiased, even where no lobe is stated, and energy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import brdfdb
from brdfdb.geometry import unit_vector
from brdfdb.materials import Source, presets
from brdfdb.parameters import Floats
from brdfdb.scenes.gbuffer import gather
from brdfdb.scenes.renderer import render
from brdfdb.store.publication import publish
from brdfdb.tables.sampler import LOBE_SHARE, Sampler
from brdfdb.tables.table import TableSource
from tests.formats.small_tables import ANISOTROPIC, GREY, SPECTRAL, small_table
from tests.formats.small_tables import DIFFUSE as ROUGH
from tests.measurements.made_up import source_of
from tests.scenes.a_scene import scene
from tests.scenes.test_environment import FAR, ROOM, STANDARD_ERRORS, WAVELENGTH, around, estimates, reference_radiance

Array = NDArray[np.float64]

POINTS, SAMPLES = 600, 16
GRID = 3e-4  # of the quadrature over a grid of directions, relative; measured 2.2e-4
PRECISE = 0.006  # standard error of the mean of all points, relative; measured 0.0049
ROUNDING = 1e-5  # of logarithms that the table stores as float32; measured 8.1e-6
BIASED = 20.0  # standard errors that a wrong density is off at least; measured 26
SHINY = 0.1  # noise of the sampler of a table over that of the cosine, of a peak back to the light; measured 0.082
NOISE = 0.04  # of a pixel in uniform light, 64 directions; measured 0.038, of the peak back to the light
ALBEDO = 1e-3  # of those that ambient light meets: see test_environment.py
WIDTH = 0.01  # width [1] of the peak back to the light, in its cosine
LIT = ("half-mirror", "road-sign")


def _back(wi: Floats, wr: Floats) -> Floats:
    """Return f_r of a sheet that sends light back to where it comes from, which no lobe around the mirror describes."""
    return np.asarray(0.02 + 3.0 * np.exp((np.sum(wi * wr, axis=1, keepdims=True) - 1.0) / WIDTH))


def _glossy(wi: Floats, wr: Floats) -> Floats:
    h = wi + wr
    return np.asarray(0.05 + np.exp(-((h[:, :1] ** 2 + h[:, 1:2] ** 2) / h[:, 2:] ** 2) / 0.02))


def _white(wi: Floats, _wr: Floats) -> Floats:
    return np.full((len(wi), 1), 1.0 / np.pi)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lit") / "store"
    for name, f_r in (("road-sign", _back), ("half-mirror", _glossy), ("white-paper", _white)):
        publish(folder, source_of(f_r, name=name), tolerance=0.05)
    return folder


def in_room(source: TableSource, wr: Array, drawn_by: Source | None = None) -> Array:
    """Return the radiance (N, L) in a room, by drawn directions."""
    return estimates(source, wr, around(ROOM, samples=SAMPLES), drawn_by)


def integral(source: TableSource, wr: Array) -> Array:
    """The same by a grid over the hemisphere, (L,), for one viewer."""
    steps = 400
    cos, phi = (np.arange(steps) + 0.5) / steps, (np.arange(2 * steps) + 0.5) * np.pi / steps
    cos, phi = np.meshgrid(cos, phi, indexing="ij")
    wi = unit_vector(np.arccos(cos), phi).reshape(-1, 3)
    f_r = source.brdf_at(source.evaluated_at(WAVELENGTH))(wi, np.broadcast_to(wr, wi.shape))
    weight = reference_radiance(ROOM, wi) * wi[:, 2] * np.pi / steps**2
    return np.asarray(weight @ f_r)


def table_source(kind: str, store: Path) -> TableSource:
    return TableSource(brdfdb.open(store)[kind] if kind in LIT else small_table(kind))


@pytest.mark.parametrize("kind", [*LIT, GREY, ANISOTROPIC, ROUGH, SPECTRAL])
@pytest.mark.parametrize("theta_deg", [10.0, 65.0])
def test_a_room_is_reflected_as_by_a_grid_over_the_hemisphere(kind: str, theta_deg: float, store: Path) -> None:
    source, wr = table_source(kind, store), unit_vector(np.radians(theta_deg), 0.7)
    found = in_room(source, np.tile(wr, (POINTS, 1)))
    expected = integral(source, wr)
    standard_error = found.std(axis=0, ddof=1) / np.sqrt(POINTS)
    assert np.all(standard_error < PRECISE * expected)
    assert np.all(np.abs(found.mean(axis=0) - expected) < STANDARD_ERRORS * standard_error + GRID * expected)


def test_a_wrong_density_is_noticed(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    true = Sampler.density

    def shared_wrongly(self: Sampler, wi: Array, wr: Array) -> Array:
        cosine = np.maximum(wr[..., 2], 0.0) / np.pi
        of_cells = (true(self, wi, wr) - (1.0 - LOBE_SHARE) * cosine) / LOBE_SHARE
        return 0.7 * of_cells + 0.3 * cosine  # the cosine has a fifth of the directions

    monkeypatch.setattr(Sampler, "density", shared_wrongly)
    source, wr = table_source("half-mirror", store), unit_vector(0.2, 0.7)
    found = in_room(source, np.tile(wr, (POINTS, 1)))
    standard_error = found.std(ddof=1) / np.sqrt(POINTS)
    assert abs(found.mean() - integral(source, wr)) > BIASED * standard_error


def test_a_peak_without_a_lobe_has_little_noise(store: Path) -> None:
    source, wr = table_source("road-sign", store), np.tile(unit_vector(0.6, 0.7), (POINTS, 1))
    assert not source.has_lobe
    cosine = presets()["aluminum-cylinder-13c"]  # of Lambert's model
    assert in_room(source, wr).std() < SHINY * in_room(source, wr, cosine).std()


def picture(store: Path, material: str, rows: Array | None, **fields: int) -> Array:
    light = {"ambient": 1.0} if rows is None else {"environment": around(rows, **fields).model_dump()}
    coarse = list(range(420, 681, 20))
    of = scene(f"store:{material}", store=str(store), camera=FAR, wavelengths_nm=coarse, **light)
    return np.asarray(render(of, gather(of, 24))[..., 0])


@pytest.mark.parametrize("material", LIT)
def test_in_uniform_light_pictures_have_the_albedo(material: str, store: Path) -> None:
    sampled, exact = picture(store, material, np.ones((1, 1)), samples=64), picture(store, material, None)
    relative = (sampled / exact - 1.0)[exact != 1.0]
    assert abs(relative.mean()) < STANDARD_ERRORS * relative.std() / np.sqrt(relative.size) + ALBEDO
    assert relative.std() < NOISE


def test_white_paper_cannot_be_seen_in_a_uniform_environment(store: Path) -> None:
    assert TableSource(brdfdb.open(store)["white-paper"]).sampler is None
    assert np.abs(picture(store, "white-paper", np.ones((1, 1)), samples=4) - 1.0).max() < ROUNDING


@pytest.mark.parametrize("material", LIT)
def test_pictures_by_lobe_and_by_table_agree(material: str, store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    by_table = picture(store, material, ROOM, samples=64)
    monkeypatch.setattr("brdfdb.scenes.environment.TableSource", type(None))  # no source is a table then
    off = (by_table - picture(store, material, ROOM, samples=64, seed=1)).ravel()
    assert np.any(off)
    assert abs(off.mean()) < STANDARD_ERRORS * off.std() / np.sqrt(off.size)
