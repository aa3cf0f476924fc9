"""The plugin of tables: values and densities of `Table`, on the four grids, linear and cubic, in parts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb.tables.albedo import directional_albedo
from brdfdb.tables.planner import plan
from brdfdb.tables.table import Table
from tests.api.a_store import publish, serving
from tests.formats.small_tables import ANISOTROPIC, DIFFUSE, GREY, KINDS, SMOOTH, SPECTRAL, small_table, table_of
from tests.mitsuba.surfaces import (
    FURNACE,
    LIGHTS_DEG,
    check_samples_have_their_density,
    directions,
    interaction,
    mean_weight,
    smooth,
    specular_sample,
    variant,
    vectors,
)
from tests.store.a_store import lambert
from tests.tables import glinting
from tests.tables.made_up import WAVELENGTHS, made_up
from tests.tables.test_mixture import NM, PAINTED
from tests.tables.test_wavelengths import TABLES as STRAIGHT

PAIRS = 20_000
# Of f_r and of densities: angles of float32 in tables whose logarithm is steep. The largest measured is 2e-4, and
# 99.9 % of the pairs differ by less than 3e-5. Below the floor [1/sr], sums of numbers of a table cancel
FLOAT32, MOST, FLOOR = 5e-4, 5e-5, 5e-3
# Of 1000 densities, those next to an edge of a cell may be of the neighbour
OTHER_CELLS = 0.002
TURNED = np.pi / 6


def painted() -> Table:
    layout = plan(PAINTED, NM, 0.1)
    assert layout.part_nm is not None
    return table_of(layout)


TABLES: dict[str, Any] = {
    **{kind: (lambda kind=kind: small_table(kind)) for kind in KINDS},
    "linear": lambda: made_up("isotropic", WAVELENGTHS, dirac=True),
    "linear-anisotropic": lambda: made_up("anisotropic"),
    "mixture": painted,
    "straight": STRAIGHT["logarithms"],
    "straight-factored": STRAIGHT["factored-logarithms"],
}


def surface_of(mitsuba: Any, monkeypatch: pytest.MonkeyPatch, table: Table) -> Any:
    import brdfdb.mitsuba.table

    monkeypatch.setattr(brdfdb.mitsuba.table, "loaded", lambda *_: table)
    return mitsuba.load_dict({"type": "brdfdb_table", "material": table.name})


@pytest.mark.parametrize("kind", TABLES)
def test_values_and_densities_are_those_of_the_table(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mitsuba = variant("llvm_ad_spectral")
    table = TABLES[kind]()
    surface = surface_of(mitsuba, monkeypatch, table)
    wi, wr = directions(PAIRS)
    place = interaction(mitsuba, wi)
    at = np.array([400.0, 480.25, 549.1, 700.0])
    place.wavelengths = at.tolist()
    value, density = surface.eval_pdf(smooth(mitsuba), place, vectors(mitsuba, wr))
    wi, wr = wi.astype(np.float64), wr.astype(np.float64)
    stored = table.wavelength_nm
    wavelength = None if stored is None else np.clip(at, stored[0], stored[-1])
    expected = table.lookup_vectors(wi, wr, wavelength)
    expected = np.broadcast_to(expected.T if stored is not None else expected, np.shape(value))
    difference = np.abs(np.array(value) / wr[:, 2] - expected) / np.maximum(expected, FLOOR)
    assert np.max(difference) <= FLOAT32
    assert np.quantile(difference, 0.999) <= MOST
    difference = np.abs(np.array(density) / table.pdf(wi, wr) - 1.0)
    assert np.mean(difference > FLOAT32) <= OTHER_CELLS


@pytest.mark.parametrize("kind", [GREY, ANISOTROPIC, SPECTRAL, SMOOTH])
def test_densities_of_samples_pass_mitsubas_chi2(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mitsuba = variant("llvm_ad_mono")
    surface = surface_of(mitsuba, monkeypatch, small_table(kind))
    check_samples_have_their_density(mitsuba, surface, LIGHTS_DEG, TURNED)


@pytest.mark.parametrize("kind", [GREY, ANISOTROPIC, SPECTRAL, SMOOTH])
def test_weights_of_samples_add_up_to_our_albedo(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mitsuba = variant("llvm_ad_mono")
    table = small_table(kind)
    surface = surface_of(mitsuba, monkeypatch, table)
    for theta_deg in LIGHTS_DEG:
        albedo = directional_albedo(table, np.array([theta_deg])).albedo[0, 1 if table.anisotropic else 0]
        nm = table.wavelength_nm
        at = None if nm is None else float(np.clip(549.1, nm[0], nm[-1]))
        expected = albedo[0] if nm is None else np.interp(at, nm, albedo)
        expected += float(table.specular_reflectance(np.deg2rad(theta_deg), at))
        assert mean_weight(mitsuba, surface, theta_deg, TURNED) == pytest.approx(expected, rel=FURNACE)


@pytest.mark.parametrize("name", ["scalar_rgb", "scalar_spectral", "llvm_ad_rgb"])
def test_each_variant_reads_a_store(name: str, tmp_path: Path) -> None:
    from brdfdb.store.publication import publish_dataset

    mitsuba = variant(name)
    publish_dataset(tmp_path, "white", lambert(0.5))
    surface = mitsuba.load_dict({"type": "brdfdb_table", "material": "white", "store": str(tmp_path)})
    place = mitsuba.SurfaceInteraction3f()
    place.wi = mitsuba.Vector3f(0.6, 0.0, 0.8)
    context, viewer = mitsuba.BSDFContext(), mitsuba.Vector3f(-0.48, 0.64, 0.6)
    np.testing.assert_allclose(np.ravel(surface.eval(context, place, viewer)), 0.5 / np.pi * 0.6, rtol=1e-6)
    with pytest.raises(RuntimeError, match="no-such"):
        mitsuba.load_dict({"type": "brdfdb_table", "material": "no-such", "store": str(tmp_path)})


def test_the_numbers_of_a_table_have_derivatives(monkeypatch: pytest.MonkeyPatch) -> None:
    mitsuba = variant("llvm_ad_mono")
    import drjit

    table = small_table(GREY)
    surface = surface_of(mitsuba, monkeypatch, table)
    parameters = mitsuba.traverse(surface)
    numbers = parameters["values_0"]
    drjit.enable_grad(numbers)
    parameters.update()
    wi, wr = directions(100)
    value = surface.eval(mitsuba.BSDFContext(), interaction(mitsuba, wi), vectors(mitsuba, wr))
    drjit.backward(drjit.sum(value, axis=None))
    # All numbers larger by one: the logarithm of f_r and of the offset
    wi, wr = wi.astype(np.float64), wr.astype(np.float64)
    power = (wi[:, 2] * wr[:, 2]) ** -table.interpolation.power
    tabulated = table.lookup_vectors(wi, wr) - table.uniform[0]
    expected = np.sum((tabulated + table.interpolation.offset * power) * wr[:, 2])
    assert float(np.sum(np.array(drjit.grad(numbers)))) == pytest.approx(expected, rel=1e-3)


def test_a_table_behind_a_service_is_that_of_the_directory(tmp_path: Path) -> None:
    mitsuba = variant("scalar_spectral")
    publish(tmp_path, "foil", "he_torrance", refractive_index="main/Cu/Johnson", sigma_0_um=0.1, tau_um=2.0)
    place = mitsuba.SurfaceInteraction3f()
    place.wi, place.wavelengths = mitsuba.Vector3f(0.6, 0.0, 0.8), [450.0, 500.0, 550.0, 600.0]
    values = []
    with serving(tmp_path) as url:
        for store in (str(tmp_path), url):
            surface = mitsuba.load_dict({"type": "brdfdb_table", "material": "foil", "store": store})
            value = surface.eval(mitsuba.BSDFContext(), place, mitsuba.Vector3f(-0.48, 0.0, 0.8772))
            _, weight = specular_sample(mitsuba, surface, place)
            values.append(np.array([np.ravel(value), np.ravel(weight)]))
    np.testing.assert_array_equal(values[0], values[1])
    assert np.all(values[0] > 0.0)


def test_two_tables_in_a_scene_have_derivatives(monkeypatch: pytest.MonkeyPatch) -> None:
    mitsuba = variant("llvm_ad_mono")
    import drjit

    import brdfdb.mitsuba.table

    monkeypatch.setattr(brdfdb.mitsuba.table, "loaded", lambda name, _: small_table(name))
    spheres = {
        kind: {"type": "sphere", "center": [x, 0, 5], "bsdf": {"type": "brdfdb_table", "material": kind}}
        for kind, x in ((GREY, -1.1), (DIFFUSE, 1.1))
    }
    film = {"type": "hdrfilm", "width": 16, "height": 16, "pixel_format": "luminance"}
    sensor = {"type": "perspective", "fov": 45, "film": film}
    scene = mitsuba.load_dict(
        {"type": "scene", "integrator": {"type": "prb"}, "sensor": sensor, "sky": {"type": "constant"}, **spheres}
    )
    parameters = mitsuba.traverse(scene)
    keys = [f"{kind}.bsdf.values_0" for kind in spheres]
    for key in keys:
        drjit.enable_grad(parameters[key])
    parameters.update()
    picture = mitsuba.render(scene, parameters, spp=16)
    drjit.backward(drjit.mean(picture, axis=None))
    for key in keys:
        gradient = np.array(drjit.grad(parameters[key]))
        assert np.all(np.isfinite(gradient))
        assert np.sum(gradient) > 0.0  # a brighter table, a brighter picture


def test_the_plugin_leaves_glints_out_and_says_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    mitsuba = variant("llvm_ad_spectral")
    table = glinting.stored(tmp_path)
    mitsuba.set_log_level(mitsuba.LogLevel.Warn)
    surface = surface_of(mitsuba, monkeypatch, table)
    out, err = capfd.readouterr()
    assert "glinting: not in the values of the plugin: the glints of the table, up to 75.4 %" in out + err
    wi, wr = (np.array([[np.sin(t), 0.0, np.cos(t)]], np.float32) for t in np.deg2rad([60.0, -60.5]))
    place = interaction(mitsuba, wi)
    place.wavelengths = [550.0] * 4
    value, _ = surface.eval_pdf(smooth(mitsuba), place, vectors(mitsuba, wr))
    assert np.array(value).ravel()[0] / wr[0, 2] == pytest.approx(glinting.GROUND, rel=1e-2)
