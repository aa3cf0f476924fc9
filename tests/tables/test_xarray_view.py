"""f_r of tables that are stored in parts: computed when it is read, and rebuilt from one line by any zarr reader."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
import zarr

import brdfdb
from brdfdb.geometry import directions_from_half_difference
from brdfdb.materials import presets
from brdfdb.store.publication import publish_dataset
from brdfdb.store.reader import Store
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Interpolation, Layout
from brdfdb.tables.tabulation import tabulate
from brdfdb.tables.xarray_view import with_brdf

WAVELENGTHS = np.array([400.0, 500.0, 600.0, 700.0])
ROUNDING = 3e-6  # of numbers up to 10 in float32, by the exponential; measured: 1.3e-6
POLAR = {"theta_i": [0, 30, 60, 89], "theta_r": [0, 30, 60, 89], "delta_phi": [0, 90, 180]}
HALF = {"theta_h": [0, 3, 10, 40], "theta_d": [0, 45, 79], "phi_d": [0, 45, 90]}
TURNED = {"theta_h": [0, 3, 10, 40], "phi_h": [0, 45, 90], "theta_d": [0, 45, 79], "phi_d": [0, 90, 180]}
BASIS = np.linalg.qr(np.array([[1.0, 1.0, 1.0, 1.0], [0.0, 1.0, 2.0, 4.0], [1.0, 0.0, 0.5, 0.0]]).T)[0].T

ROOT = Interpolation("cubic", True, 1e-3, 0.5)
LAYOUTS = {
    "plain": Layout(presets()["clay-vase"], Grid(POLAR)),
    "logarithms": Layout(presets()["glossy-grey-paper"], Grid(HALF), interpolation=ROOT),
    "anisotropic": Layout(presets()["rolled-brass"], Grid(TURNED), interpolation=ROOT),
    "weighted": Layout(presets()["clay-vase"], Grid(POLAR), interpolation=Interpolation("cubic", False, 0.0, 1.0)),
    "factored": Layout(
        presets()["scene-copper-sphere"], Grid(POLAR), WAVELENGTHS, Interpolation("cubic", True, 1e-3), BASIS
    ),
}


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """A store with one table of each kind."""
    root = tmp_path_factory.mktemp("parts") / "store"
    for name, layout in LAYOUTS.items():
        publish_dataset(root, name, tabulate(layout))
    return brdfdb.open(root)


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_dataset_shows_brdf_computed_on_demand(name: str, store: Store) -> None:
    table, layout = store[name], LAYOUTS[name]
    with store.dataset(name) as dataset:
        brdf = dataset["brdf"]
        spectral = () if layout.wavelength_nm is None else ("wavelength",)
        assert brdf.dims == (*layout.grid.axes, *spectral)
        assert brdf.attrs["units"] == "sr-1"
        assert not brdf.variable._in_memory or layout.plain
        np.testing.assert_array_equal(brdf.values, table.brdf)
        first = brdf.dims[0]
        np.testing.assert_array_equal(brdf.isel({first: 1}).values, table.brdf[1])
        some = brdf.isel({first: slice(1, 3), brdf.dims[1]: [0, 2], brdf.dims[2]: -1})
        np.testing.assert_array_equal(some.values, table.brdf[1:3][:, [0, 2]][:, :, -1])
        if spectral:
            np.testing.assert_array_equal(brdf.isel(wavelength=2).values, table.brdf[..., 2])
            np.testing.assert_array_equal(brdf.sel(wavelength=[700.0, 400.0]).values, table.brdf[..., [3, 0]])


@pytest.mark.parametrize("name", LAYOUTS)
def test_nodes_hold_the_model_and_nothing_below_the_horizon(name: str, store: Store) -> None:
    table, layout = store[name], LAYOUTS[name]
    theta_i, phi_i, theta_r, phi_r = np.broadcast_arrays(*layout.grid.directions())
    spectrum = [None] if layout.wavelength_nm is None else list(layout.wavelength_nm)
    if layout.spectra is not None:
        return  # three parts of four wavelengths are not the model
    for w, wavelength in enumerate(spectrum):
        expected = layout.source.spec.evaluate(theta_i, phi_i, theta_r, phi_r, **layout.source.arguments(wavelength))
        found = table.brdf if wavelength is None else table.brdf[..., w]
        np.testing.assert_allclose(found, expected, rtol=ROUNDING, atol=1e-3 * ROUNDING)
    below = np.maximum(theta_i, theta_r) > np.pi / 2
    assert np.all(table.brdf[below] == 0.0)
    assert below.any() == layout.grid.half_difference


@pytest.mark.parametrize("name", LAYOUTS)
def test_any_reader_rebuilds_f_r_from_the_arrays_and_one_line(name: str, store: Store) -> None:
    group = zarr.open_group(store.path(name), mode="r")
    arrays = {key: np.asarray(array[...]) for key, array in group.arrays()}
    line = str(group.attrs["reconstruction"])
    table = store[name]
    if line.startswith("brdf is f_r"):
        np.testing.assert_array_equal(arrays["brdf"], table.brdf)
        return
    names = list(LAYOUTS[name].grid.axes)
    axes = np.ix_(*(np.deg2rad(arrays[axis]) for axis in names))
    if names[0] == "theta_h":
        h, d, phi_d = axes[0], axes[-2], axes[-1]
        theta_i, _, theta_r, _ = directions_from_half_difference(h, axes[1] if len(axes) == 4 else 0.0, d, phi_d)
    else:
        theta_i, theta_r = axes[0], axes[1]
    space = {**arrays, "theta_i": theta_i, "theta_r": theta_r, "exp": np.exp, "cos": np.cos, "max": np.maximum}
    with np.errstate(invalid="ignore"):  # cosines below the horizon
        brdf = eval(line.partition(" = ")[2].partition(";")[0], {"__builtins__": {}}, space)
    above = np.broadcast_to(np.maximum(theta_i, theta_r) <= np.pi / 2, table.brdf.shape[: len(names)])
    np.testing.assert_allclose(brdf[above], table.brdf[above], rtol=ROUNDING)
    assert above.any()


def test_a_dataset_that_has_brdf_is_left_alone() -> None:
    dataset = xr.Dataset({"brdf": ("x", [1.0])})
    assert with_brdf(dataset) is dataset


def test_a_plain_reader_sees_the_stored_parts_without_a_warning(store: Store) -> None:
    with xr.open_zarr(store.path("factored")) as dataset:
        assert dataset["parts"].dims == ("theta_i", "theta_r", "delta_phi", "part")
        assert dataset["spectra"].shape == (3, 4)
        assert dataset.attrs["symmetries"]
