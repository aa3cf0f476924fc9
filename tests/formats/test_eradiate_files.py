"""Tables for Eradiate's mqdiffuse: its kernel, and its own checks, where they are installed."""

from __future__ import annotations

import json
import os
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from brdfdb import formats
from brdfdb.errors import CannotHoldError, FileFormatError, ParameterError
from brdfdb.formats import eradiate
from brdfdb.formats._channels import Channels
from brdfdb.formats._readings import FileTable
from brdfdb.formats._stated_error import Comparison
from brdfdb.geometry import unit_vector
from tests.formats.small_tables import ANISOTROPIC, DIFFUSE, GREY, SPECTRAL, small_table

PYTHON = os.environ.get("BRDFDB_ERADIATE")  # of an environment with the package eradiate-mitsuba
VALUES = Path(__file__).parents[1] / "models" / "eradiate_values.py"
KERNEL_RTOL = 2e-5  # of the largest value: its textures compute with float32; worst seen 4e-6


@pytest.mark.parametrize("kind", [GREY, DIFFUSE, SPECTRAL])
def test_a_file_read_back_is_within_the_error_that_it_states(kind: str, tmp_path: Path) -> None:
    table, path = small_table(kind), tmp_path / "table.nc"
    written = eradiate.write(table, path, tolerance=0.3, wavelength=600.0)
    back = formats.read(path)
    assert isinstance(back, FileTable)
    assert written.error is not None
    assert written.within
    at = None if table.wavelength_nm is None else np.array([600.0])
    comparison = Comparison(table, Channels(("one",), at, None, ""))
    assert comparison.error_of(lambda wi, wr: back.lookup_vectors(wi, wr).reshape(-1, 1)) == written.error
    assert back.record["wavelength_nm"] if at is not None else "wavelength_nm" not in back.record
    assert [text == "f_r at 600 nm alone" for text in written.remarks] == ([False, True] if at is not None else [])


def test_each_node_has_its_place_in_the_file(tmp_path: Path) -> None:
    """The kernel reads node d of N azimuths at 2 pi d / (N - 1), the last axis with the direction of the light."""
    table, path = small_table(DIFFUSE), tmp_path / "table.nc"
    eradiate.write(table, path, resolution=5)
    with xr.open_dataset(path) as opened:
        brdf = opened["brdf"]
        assert brdf.dims == ("cos_theta_o", "phi_d", "cos_theta_i")
        assert np.allclose(opened["phi_d"], 2.0 * np.pi * np.arange(5) / 5)
        assert [opened[name].attrs["units"] for name in brdf.dims] == ["dimensionless", "rad", "dimensionless"]
        expected = table.lookup(np.arccos(0.25), 0.0, np.arccos(0.75), np.pi / 2)
        assert brdf[3, 1, 1].item() == brdf[3, 3, 1].item() == pytest.approx(float(expected), rel=1e-6)


@pytest.mark.skipif(PYTHON is None, reason="BRDFDB_ERADIATE names no Python with eradiate-mitsuba")
@pytest.mark.parametrize("kind", [GREY, DIFFUSE])
def test_the_kernel_of_eradiate_reads_what_we_read(kind: str, tmp_path: Path) -> None:
    path, volume = tmp_path / "table.nc", tmp_path / "table.vol"
    eradiate.write(small_table(kind), path, resolution=13)
    with xr.open_dataset(path) as opened:  # asymmetric values, which no exchange of axes or azimuths leaves the same
        values = opened["brdf"].values[:9]
        values = values * np.random.default_rng(3).uniform(0.5, 1.5, values.shape).astype(np.float32)
        xr.Dataset({"brdf": (opened["brdf"].dims, values)}, eradiate._coordinates(values.shape)).to_netcdf(
            tmp_path / "asymmetric.nc", engine="scipy"
        )
    back = formats.read(tmp_path / "asymmetric.nc")
    assert isinstance(back, FileTable)
    size = struct.pack("<3sBi4i6f", b"VOL", 3, 1, *values.shape[::-1], 1, 0, 0, 0, 1, 1, 1)
    volume.write_bytes(size + values.tobytes())
    rng = np.random.default_rng(5)
    wi, wr = (unit_vector(np.arccos(rng.uniform(0.02, 1.0, 500)), rng.uniform(0.0, 7.0, 500)) for _ in range(2))
    question = {"plugins": {"ours": {"type": "mqdiffuse", "filename": str(volume)}}}
    # a path that comes from the camera has the viewer as wi
    answer = subprocess.run(
        [str(PYTHON), str(VALUES)],
        input=json.dumps({**question, "wi": wr.tolist(), "wr": wi.tolist()}),
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    theirs = np.array(json.loads(answer.stdout)["ours"])
    assert np.abs(back.lookup_vectors(wi, wr) - theirs).max() <= KERNEL_RTOL * theirs.max()


@pytest.mark.skipif(PYTHON is None, reason="BRDFDB_ERADIATE names no Python with eradiate-mitsuba")
def test_eradiate_accepts_the_file(tmp_path: Path) -> None:
    path = tmp_path / "table.nc"
    eradiate.write(small_table(DIFFUSE), path, resolution=9)
    script = (
        "import sys\ntry:\n    import eradiate\nexcept ImportError:\n    sys.exit(5)\n"
        "import xarray\nfrom eradiate.scenes.bsdfs import MQDiffuseBSDF\neradiate.set_mode('mono_double')\n"
        "MQDiffuseBSDF(data=xarray.load_dataset(sys.argv[1]))\n"
    )
    answer = subprocess.run([str(PYTHON), "-c", script, str(path)], stderr=subprocess.PIPE, text=True, check=False)
    if answer.returncode == 5:
        pytest.skip("eradiate is not installed beside eradiate-mitsuba")
    assert answer.returncode == 0, answer.stderr


def test_what_the_format_cannot_hold_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CannotHoldError, match="anisotropic, and mqdiffuse holds isotropic tables only"):
        eradiate.write(small_table(ANISOTROPIC), tmp_path / "table.nc")
    with pytest.raises(ParameterError, match=r"wavelength: 900 nm is outside \[400, 700\] nm"):
        eradiate.write(small_table(SPECTRAL), tmp_path / "table.nc", wavelength=900.0)
    with pytest.raises(ParameterError, match=r"resolution: 4\.5 is not a whole number"):
        eradiate.write(small_table(DIFFUSE), tmp_path / "table.nc", resolution=4.5)
    assert not list(tmp_path.iterdir())


def test_files_that_eradiate_refuses_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "table.nc"
    eradiate.write(small_table(DIFFUSE), path, resolution=5)
    with xr.open_dataset(path) as opened:
        opened.load()
    opened.assign_coords(phi_d=np.linspace(0.0, 2.0 * np.pi, 5)).to_netcdf(path, engine="scipy")
    with pytest.raises(FileFormatError, match="coordinates phi_d are not in the equal steps"):
        formats.read(path)
    opened.isel(phi_d=0).to_netcdf(path, engine="scipy")
    with pytest.raises(FileFormatError, match="no variable brdf over cos_theta_o, phi_d, cos_theta_i"):
        eradiate.read(path)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(FileFormatError, match="is no netCDF 3 file, or is damaged"):
        eradiate.read(path)
