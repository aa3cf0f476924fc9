"""Dense tables as netCDF, zarr, NumPy and CSV: read back as every program does, within the error that they state."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.io import netcdf_file

import brdfdb
from brdfdb.errors import ParameterError
from brdfdb.formats import eradiate, netcdf
from brdfdb.formats._dense_grid import dense_table, rounded
from brdfdb.geometry import radians
from brdfdb.materials import Material
from brdfdb.store.publication import publish_dataset
from brdfdb.tables.grids import (
    ANISOTROPIC_AXES,
    ANISOTROPIC_HALF_DIFFERENCE_AXES,
    HALF_DIFFERENCE_AXES,
    ISOTROPIC_AXES,
    directions,
)
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import tabulate
from tests.formats.a_file import exported, read_table
from tests.formats.small_tables import ANISOTROPIC, DIFFUSE, GREY, SPECTRAL, small_table

CF_CHECKER = os.environ.get("BRDFDB_CF")  # the program compliance-checker
FORMATS = ("netcdf", "zarr", "numpy", "csv")
AT_NODES = {"netcdf": 2e-7, "zarr": 2e-7, "numpy": 2e-7, "csv": 5.1e-5}  # float32, or five digits: worst 6e-8, 5e-5


@pytest.mark.parametrize(
    ("kind", "axes", "tolerances"),
    [(GREY, "half_difference", (0.1, 0.4)), (DIFFUSE, "light_viewer", (0.02, 0.06))],
)
def test_the_smallest_grid_is_within_the_tolerance_and_grows_with_it(
    kind: str, axes: str, tolerances: tuple[float, float]
) -> None:
    table = small_table(kind)
    fine, coarse = (dense_table(table, tolerance, axes=axes) for tolerance in tolerances)
    assert fine.error.p99 <= tolerances[0] < coarse.error.p99 <= tolerances[1]
    assert coarse.values.size < fine.values.size


def test_a_file_that_cannot_be_within_the_tolerance_says_how_near_it_comes() -> None:
    dense = dense_table(small_table(GREY), 1e-3, axes="light_viewer", most_values=20_000)
    assert 10_000 < dense.values.size <= 20_000
    assert 1e-3 < dense.error.p99 < 0.5


@pytest.mark.parametrize(
    ("kind", "axes", "name"),
    [
        (SPECTRAL, "light_viewer", "csv"),
        (SPECTRAL, "half_difference", "zarr"),
        (ANISOTROPIC, "light_viewer", "netcdf"),
        (ANISOTROPIC, "half_difference", "numpy"),
    ],
)
def test_a_regular_grid_has_the_values_of_the_table_at_its_nodes(
    kind: str, axes: str, name: str, tmp_path: Path
) -> None:
    table = small_table(kind)
    reading = read_table(exported(tmp_path, name, kind, axes=axes))
    names = {
        "light_viewer": ANISOTROPIC_AXES if kind == ANISOTROPIC else ISOTROPIC_AXES,
        "half_difference": ANISOTROPIC_HALF_DIFFERENCE_AXES if kind == ANISOTROPIC else HALF_DIFFERENCE_AXES,
    }[axes]
    polar = np.array([0.0, 29.8333, 59.6667] if kind == ANISOTROPIC else [0.0, 30.0, 60.0])  # the last node is 89.5
    nodes = [polar if name in ("theta_i", "theta_r") else np.array([0.0, 30.0, 60.0]) for name in names]
    theta_i, phi_i, theta_r, phi_r = np.broadcast_arrays(*directions(names, nodes))
    above = np.maximum(theta_i, theta_r) < radians(87.0)
    pairs = [angle[above] for angle in (theta_i, phi_i, theta_r, phi_r)]
    atol = 1e-5 * float(np.max(table.lookup(*pairs)))
    assert np.allclose(reading.lookup(*pairs), table.lookup(*pairs), rtol=AT_NODES[name], atol=atol)


def test_programs_that_know_nothing_of_us_open_the_files(tmp_path: Path) -> None:
    table = small_table(SPECTRAL)
    paths = {name: exported(tmp_path, name, SPECTRAL, axes="light_viewer") for name in FORMATS}
    with xr.open_dataset(paths["netcdf"]) as nc, xr.open_zarr(paths["zarr"], chunks=None, consolidated=False) as group:
        assert nc["brdf"].dims == group["brdf"].dims == ("theta_i", "theta_r", "delta_phi", "wavelength")
        assert nc["brdf"].attrs["units"] == "sr-1"
        assert [nc[name].attrs["units"] for name in nc["brdf"].dims] == ["degree", "degree", "degree", "nm"]
        assert nc.attrs["Conventions"].startswith("CF-")
        assert np.array_equal(nc["brdf"], group["brdf"])
        mirror = nc["specular_reflectance"].interp(specular_theta_i=30.0)
        assert np.allclose(mirror, table.specular_reflectance(radians(30.0)), rtol=1e-6)  # worst seen 1e-7
        brdf = nc["brdf"].values
    with np.load(paths["numpy"]) as arrays:
        assert np.array_equal(arrays["brdf"], brdf)
        assert arrays["axes"].tolist() == ["theta_i", "theta_r", "delta_phi", "wavelength"]
    pandas = pytest.importorskip("pandas")
    frame = pandas.read_csv(paths["csv"], comment="#")
    assert list(frame.columns) == ["theta_i", "theta_r", "delta_phi", "400nm", "550nm", "700nm"]
    row = frame[(frame.theta_i == 30.0) & (frame.theta_r == 60.0) & (frame.delta_phi == 180.0)]
    expected = table.lookup(radians(30.0), 0.0, radians(60.0), np.pi, 550.0)
    assert row["550nm"].item() == pytest.approx(float(expected), rel=AT_NODES["csv"])


def test_rounding_keeps_digits_and_prints_no_more() -> None:
    values = rounded(np.array([0.0, 1234567.0, 0.0012345678, 9.99999e-7, 31.41592]), 5)
    assert [repr(value) for value in values.tolist()] == ["0.0", "1234567.0", "0.0012346", "1e-06", "31.416"]


def test_a_regular_grid_that_is_too_large_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"resolution: 0\.1 degrees need .* values; at most 25000000"):
        exported(tmp_path, "netcdf", ANISOTROPIC, resolution=0.1)


def netcdf_files(folder: Path) -> list[Path]:
    """Write all that becomes netCDF and names the CF conventions: two kinds of export, and a table of a store."""
    paths = [folder / f"{kind}.nc" for kind in (ANISOTROPIC, SPECTRAL)]
    for kind, path in zip((ANISOTROPIC, SPECTRAL), paths, strict=True):
        netcdf.write(small_table(kind), path, resolution=30.0)
    eradiate.write(small_table(DIFFUSE), folder / "eradiate.nc", nodes=9)
    table = small_table(SPECTRAL)
    assert isinstance(table.source, Material)
    publish_dataset(folder / "store", "copper", tabulate(Layout(table.source, table.grid, table.wavelength_nm)))
    brdfdb.open(folder / "store").dataset("copper").to_netcdf(folder / "store.nc", engine="scipy")
    return [*paths, folder / "eradiate.nc", folder / "store.nc"]


def test_coordinates_of_netcdf_files_have_no_fill_value(tmp_path: Path) -> None:
    for path in netcdf_files(tmp_path):
        with netcdf_file(path, mmap=False) as file:
            coordinates = [name for name in file.dimensions if name in file.variables]
            assert len(coordinates) >= 3
            assert not any(hasattr(file.variables[name], "_FillValue") for name in coordinates)


def judged(conventions: str, paths: list[Path], folder: Path) -> dict[str, Any]:
    """Return what the checker finds in files, by their paths."""
    assert CF_CHECKER is not None
    command = [CF_CHECKER, "--test", conventions, "--format", "json_new", "--output", str(folder / "faults.json")]
    subprocess.run([*command, *map(str, paths)], capture_output=True, check=False)
    found: dict[str, Any] = json.loads((folder / "faults.json").read_text(encoding="utf-8"))
    assert len(found) == len(paths)
    return found


# What ACDD asks of observations of the Earth, and what CF has no name for; then what only the owner can state
NOT_OF_TABLES = ("geospatial_", "time_coverage_", "date_created", "acknowledgment", "standard_name")
OF_THE_OWNER = ("creator_email", "creator_url", "institution", "publisher_email", "publisher_url")


@pytest.mark.judge
@pytest.mark.skipif(CF_CHECKER is None, reason="BRDFDB_CF names no compliance-checker")
def test_the_checker_of_acdd_misses_only_what_tables_do_not_have(tmp_path: Path) -> None:
    path = tmp_path / "copper.nc"
    store = tmp_path / "store"
    table = small_table(SPECTRAL)
    assert isinstance(table.source, Material)
    publish_dataset(store, "copper", tabulate(Layout(table.source, table.grid, table.wavelength_nm)))
    netcdf.write(brdfdb.open(store)["copper"], path, resolution=30.0)
    entries = judged("acdd:1.3", [path], tmp_path)[str(path)]["acdd:1.3"]
    missed = {
        text
        for key in ("high_priorities", "medium_priorities")
        for part in entries[key]
        for text in part["msgs"]
        if not any(word in text for word in (*NOT_OF_TABLES, *OF_THE_OWNER))
    }
    assert missed == set()
    assert entries["scored_points"] > 15


@pytest.mark.judge
@pytest.mark.skipif(CF_CHECKER is None, reason="BRDFDB_CF names no compliance-checker")
def test_the_checker_of_the_cf_conventions_finds_no_fault(tmp_path: Path) -> None:
    paths = netcdf_files(tmp_path)
    found = judged("cf:1.11", paths, tmp_path)
    for path in paths:
        entries = found[str(path)]["cf:1.11"]
        assert entries["scored_points"] > 50
        recommended = ["medium_priorities"] if path.name != "store.nc" else []  # it has no history yet
        some = [part for key in ("high_priorities", *recommended) for part in entries[key]]
        assert [text for part in some for text in part["msgs"]] == [], path
