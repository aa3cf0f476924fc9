"""Dense tables as netCDF, zarr, NumPy and CSV: read back as every program does, within the error that they state."""

from __future__ import annotations

import io
import json
import os
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.io import netcdf_file

import brdfdb
from brdfdb import formats
from brdfdb.errors import FileFormatError, ParameterError, WriteError
from brdfdb.formats import EXPORTERS, IMPORTERS, eradiate, netcdf
from brdfdb.formats._dense_grid import dense_table, rounded
from brdfdb.formats._readings import FileTable
from brdfdb.formats._stated_error import Comparison
from brdfdb.geometry import radians
from brdfdb.materials import Material
from brdfdb.measurements.samples import Samples
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
from tests.formats.small_tables import ANISOTROPIC, DIFFUSE, GREY, SMOOTH, SPECTRAL, SPECULAR, small_table

CF_CHECKER = os.environ.get("BRDFDB_CF")  # the program compliance-checker
FORMATS = ("netcdf", "zarr", "numpy", "csv")
TRIPS = [
    (GREY, "netcdf"),
    (ANISOTROPIC, "zarr"),
    (DIFFUSE, "numpy"),
    (SPECTRAL, "csv"),
    (SMOOTH, "csv"),
    (SPECTRAL, "numpy"),
]
AT_NODES = {
    "netcdf": 2e-7,
    "zarr": 2e-7,
    "numpy": 2e-7,
    "csv": 5.1e-5,
}  # float32, or five digits: worst seen 6e-8, 5e-5


@pytest.mark.parametrize(("kind", "name"), TRIPS)
def test_files_read_back_are_within_the_error_that_they_state(kind: str, name: str, tmp_path: Path) -> None:
    table, path = small_table(kind), tmp_path / f"table{EXPORTERS[name].suffix}"
    written = EXPORTERS[name].write(table, path, tolerance=0.5, verdict="passes")
    back = formats.read(path)
    assert isinstance(back, FileTable)
    assert written.error is not None
    assert written.within
    count = len(back.channels)
    again = Comparison(table).error_of(lambda wi, wr: np.reshape(back.lookup_vectors(wi, wr), (len(wi), count)))
    assert again == written.error
    assert again.p99 <= back.record["error_of_file"]["p99"] <= 1.02 * again.p99
    assert (back.record["name"], back.record["audit"], back.record["tolerance"]) == (table.name, "passes", 0.5)
    assert back.record["parameters"] == table.metadata.model_dump(mode="json")["parameters"]
    assert (back.wavelength_nm is None) == (table.wavelength_nm is None)
    said = " ".join((*written.remarks, *back.record.get("remarks", [])))
    assert ("in the exact mirror direction" in said) == (kind in SPECULAR and name == "csv")


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
    table, path = small_table(kind), tmp_path / f"table{EXPORTERS[name].suffix}"
    assert EXPORTERS[name].write(table, path, axes=axes, resolution=30.0).tolerance is None
    reading = formats.read(path)
    assert isinstance(reading, FileTable)
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
    paths = {name: tmp_path / f"table{EXPORTERS[name].suffix}" for name in FORMATS}
    for name, path in paths.items():
        EXPORTERS[name].write(table, path, axes="light_viewer", resolution=30.0)
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


def test_a_list_of_directions_gives_samples(tmp_path: Path) -> None:
    path = tmp_path / "list.csv"
    path.write_text(
        "theta_i, phi_i, theta_r, phi_r, brdf\n30, 10, 40, 190, 0.25\n60, 0, 5, 90, 0.5\n", encoding="utf-8"
    )
    samples = formats.read(path)
    assert isinstance(samples, Samples)
    assert (samples.name, samples.channels, samples.values.tolist()) == ("list", ("grey",), [[0.25], [0.5]])
    assert np.allclose(np.rad2deg(samples.phi_r), [190.0, 90.0], rtol=1e-15)


def test_rounding_keeps_digits_and_prints_no_more() -> None:
    values = np.array([0.0, 1234567.0, 0.0012345678, 9.99999e-7, 31.41592])
    assert [repr(value) for value in rounded(values, 5).tolist()] == [
        "0.0",
        "1234567.0",
        "0.0012346",
        "1e-06",
        "31.416",
    ]


@pytest.mark.parametrize("name", FORMATS)
def test_damaged_files_are_refused_in_a_sentence(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"table{EXPORTERS[name].suffix}"
    EXPORTERS[name].write(small_table(DIFFUSE), path, axes="light_viewer", resolution=30.0)
    whole = path / "brdf" / "zarr.json" if name == "zarr" else path
    data = whole.read_bytes()
    for cut in (0.3, 0.9):
        whole.write_bytes(data[: int(cut * len(data))])
        with pytest.raises(FileFormatError, match="table"):
            IMPORTERS[name].read(path)
    with pytest.raises(FileNotFoundError):
        IMPORTERS[name].read(tmp_path / "missing")


def _archive(path: Path, **arrays: Any) -> Path:
    np.savez(path, **arrays)
    return path


def test_archives_that_lie_are_refused(tmp_path: Path) -> None:
    axes = {"theta_i": [0.0, 90.0], "theta_r": [0.0, 90.0], "delta_phi": [0.0, 180.0], "axes": ["theta_i", "theta_r"]}
    with pytest.raises(FileFormatError, match="grid axes"):
        IMPORTERS["numpy"].read(_archive(tmp_path / "two.npz", brdf=np.ones((2, 2)), **axes))
    axes["axes"] = ["theta_i", "theta_r", "delta_phi"]
    with pytest.raises(FileFormatError, match=r"shape \(2, 3, 2\), not numbers of shape \(2, 2, 2\)"):
        IMPORTERS["numpy"].read(_archive(tmp_path / "shape.npz", brdf=np.ones((2, 3, 2)), **axes))
    with pytest.raises(FileFormatError, match="not finite"):
        IMPORTERS["numpy"].read(_archive(tmp_path / "nan.npz", brdf=np.full((2, 2, 2), np.nan), **axes))
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f4", "fortran_order": False, "shape": (10**12,)})
    path = _archive(tmp_path / "large.npz", **axes)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("brdf.npy", header.getvalue())
    with pytest.raises(FileFormatError, match="has 0 bytes"):
        IMPORTERS["numpy"].read(path)


def test_what_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"resolution: 0\.1 degrees take .* values; the most are 25000000"):
        EXPORTERS["netcdf"].write(small_table(ANISOTROPIC), tmp_path / "table.nc", resolution=0.1)
    for name in FORMATS:
        (tmp_path / "file").touch()
        with pytest.raises(WriteError, match="cannot write"):
            EXPORTERS[name].write(
                small_table(DIFFUSE), tmp_path / "file" / f"x{EXPORTERS[name].suffix}", resolution=45.0
            )
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


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


@pytest.mark.judge
@pytest.mark.skipif(CF_CHECKER is None, reason="BRDFDB_CF names no compliance-checker")
def test_the_checker_of_the_cf_conventions_finds_no_fault(tmp_path: Path) -> None:
    assert CF_CHECKER is not None
    paths = netcdf_files(tmp_path)
    command = [CF_CHECKER, "--test", "cf:1.11", "--format", "json_new", "--output", str(tmp_path / "faults.json")]
    subprocess.run([*command, *map(str, paths)], capture_output=True, check=False)
    found = json.loads((tmp_path / "faults.json").read_text(encoding="utf-8"))
    assert len(found) == len(paths)
    for path in paths:
        entries = found[str(path)]["cf:1.11"]
        assert entries["scored_points"] > 50
        recommended = ["medium_priorities"] if path.name != "store.nc" else []  # it has no history yet
        some = [part for key in ("high_priorities", *recommended) for part in entries[key]]
        assert [text for part in some for text in part["msgs"]] == [], path
