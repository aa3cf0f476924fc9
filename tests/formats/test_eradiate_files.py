"""Tables for Eradiate's mqdiffuse, as Eradiate's own loader and kernel see them where they are installed."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from brdfdb import formats
from brdfdb.errors import ParameterError
from brdfdb.formats import eradiate
from brdfdb.formats._stated_error import Comparison
from brdfdb.parameters import Floats
from tests.formats.a_file import check_refused, exported, random_pairs, read_table
from tests.formats.small_tables import DIFFUSE, GREY, SPECTRAL, small_table

PYTHON = os.environ.get("BRDFDB_ERADIATE")  # of an environment with the package eradiate
NOT_INSTALLED = 5  # exit status of eradiate_bsdf.py
KERNEL_RTOL = 2e-5  # of the largest value: its textures compute with float32; worst seen 4e-6
P99_RTOL = 1e-6  # of the error that Eradiate sees; worst seen 1e-7


def test_each_node_has_its_place_in_the_file(tmp_path: Path) -> None:
    """The last axis has the direction of the light; the first azimuth is not repeated."""
    table = small_table(DIFFUSE)
    with xr.open_dataset(exported(tmp_path, "eradiate", nodes=5)) as opened:
        brdf = opened["brdf"]
        assert brdf.dims == ("cos_theta_o", "phi_d", "cos_theta_i")
        assert brdf.shape == (5, 6, 5)
        assert np.allclose(opened["phi_d"], 2.0 * np.pi * np.arange(6) / 6)
        assert [opened[name].attrs["units"] for name in brdf.dims] == ["1", "rad", "1"]
        expected = table.lookup(np.arccos(0.25), 0.0, np.arccos(0.75), np.pi / 3)
        assert brdf[3, 1, 1].item() == brdf[3, 5, 1].item() == pytest.approx(float(expected), rel=1e-6)


@pytest.mark.judge
@pytest.mark.skipif(PYTHON is None, reason="BRDFDB_ERADIATE names no Python with eradiate")
@pytest.mark.parametrize("kind", [GREY, DIFFUSE])
def test_eradiate_reads_what_we_read(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "asymmetric.nc"
    eradiate.write(small_table(kind), tmp_path / "table.nc", nodes=13)
    with xr.open_dataset(tmp_path / "table.nc") as opened:  # no exchange of axes or azimuths leaves these values
        values = opened["brdf"].values[:9]
        values = values * np.random.default_rng(3).uniform(0.5, 1.5, values.shape).astype(np.float32)
        xr.Dataset({"brdf": (opened["brdf"].dims, values)}, eradiate._coordinates(values.shape)).to_netcdf(
            path, engine="scipy"
        )
    back = read_table(path)
    wi, wr = random_pairs(500)
    theirs = _through_eradiate(path, wi, wr)
    assert np.abs(back.lookup_vectors(wi, wr) - theirs).max() <= KERNEL_RTOL * theirs.max()


@pytest.mark.judge
@pytest.mark.skipif(PYTHON is None, reason="BRDFDB_ERADIATE names no Python with eradiate")
@pytest.mark.parametrize("kind", [GREY, DIFFUSE])
def test_eradiate_sees_the_error_that_the_file_states(kind: str, tmp_path: Path) -> None:
    table, path = small_table(kind), tmp_path / "table.nc"
    stated = eradiate.write(table, path, tolerance=0.1).error
    comparison = Comparison(table)

    def evaluate(wi: Floats, wr: Floats) -> Floats:
        values = np.zeros((len(wi), 1))
        above = wr[:, 2] > 0.0
        values[above, 0] = _through_eradiate(path, wi[above], wr[above])
        return values

    assert stated is not None
    assert comparison.error_of(evaluate).p99 == pytest.approx(stated.p99, rel=P99_RTOL)


def _through_eradiate(path: Path, wi: Floats, wr: Floats) -> Floats:
    """Return f_r [1/sr] of a file, which Eradiate loads."""
    answer = subprocess.run(
        [str(PYTHON), str(Path(__file__).with_name("eradiate_bsdf.py"))],
        input=json.dumps({"path": str(path), "wi": wi.tolist(), "wr": wr.tolist()}),
        capture_output=True,
        text=True,
        check=False,
    )
    if answer.returncode == NOT_INSTALLED:
        pytest.skip("eradiate is not installed beside eradiate-mitsuba")
    assert answer.returncode == 0, answer.stderr
    return np.array(json.loads(answer.stdout))


def test_what_the_format_cannot_hold_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"wavelength: 900 nm is outside \[400, 700\] nm"):
        eradiate.write(small_table(SPECTRAL), tmp_path / "table.nc", wavelength=900.0)
    for count in (1, 4.5, 514):
        with pytest.raises(ParameterError, match=r"nodes: '.*' is not a whole number in \[3, 513\], or 0"):
            formats.write(small_table(DIFFUSE), tmp_path / "table.nc", "eradiate", nodes=count)
    assert not list(tmp_path.iterdir())


def test_files_that_eradiate_refuses_are_refused(tmp_path: Path) -> None:
    path = exported(tmp_path, "eradiate", nodes=5)
    with xr.open_dataset(path) as opened:
        opened.load()
    opened.assign_coords(phi_d=np.linspace(0.0, 2.0 * np.pi, 6)).to_netcdf(path, engine="scipy")
    check_refused(path, "coordinates phi_d do not have the equal steps", "eradiate")
    opened.isel(phi_d=0).to_netcdf(path, engine="scipy")
    check_refused(path, "no variable brdf over cos_theta_o, phi_d, cos_theta_i", "eradiate")
