"""Arrays of a revision read from their chunks are those that zarr reads, and others are left to zarr."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import zarr

import brdfdb
from brdfdb.errors import StoreError
from brdfdb.store.codec import dataset_files
from brdfdb.store.decoding import read_by_zarr, read_group


@pytest.fixture
def group(tmp_path: Path) -> Path:
    """A revision with arrays of several shapes: one without axes, and one in chunks, the last of which is not full."""
    import xarray as xr

    rng = np.random.default_rng(3)
    dataset = xr.Dataset(
        {
            "brdf": (("theta_i", "theta_r"), rng.random((1201, 1000), dtype=np.float32)),
            "uniform": ((), np.float64(0.25)),
        },
        coords={"theta_i": np.linspace(0.0, 90.0, 1201)},
        attrs={"title": "a table"},
    )
    path = tmp_path / "white" / "r000001"
    for name, data in dataset_files(dataset).items():
        (path / name).parent.mkdir(parents=True, exist_ok=True)
        (path / name).write_bytes(data)
    return path


def test_arrays_are_those_that_zarr_reads(group: Path) -> None:
    found = read_group(group, {})
    assert found is not None
    by_zarr = zarr.open_group(group, mode="r")
    assert {"brdf", "uniform", "theta_i"} == found.arrays.keys() == dict(by_zarr.arrays()).keys()
    assert len(list((group / "brdf" / "c").iterdir())) == 2
    for name, array in by_zarr.arrays():
        assert found.arrays[name].dtype == array.dtype
        np.testing.assert_array_equal(found.arrays[name], np.asarray(array[...]))
        assert found.dims[name] == tuple(array.metadata.dimension_names or ())
    assert found.attrs == dict(by_zarr.attrs) == {"title": "a table"}


def test_other_encodings_are_left_to_zarr(group: Path) -> None:
    values = np.arange(12.0).reshape(3, 4)
    shutil.rmtree(group)
    foreign = zarr.open_group(group, mode="w")
    foreign.create_array("brdf", data=values, dimension_names=("theta_i", "theta_r"))
    assert read_group(group, {}) is None
    found = read_by_zarr(group, {})
    np.testing.assert_array_equal(found.arrays["brdf"], values)
    assert found.dims["brdf"] == ("theta_i", "theta_r")


def test_a_wrong_checksum_is_an_error(group: Path) -> None:
    chunk = group / "uniform" / "c"
    chunk.write_bytes(chunk.read_bytes()[:-1] + b"\0")
    with pytest.raises(StoreError, match="its values cannot be decoded"):
        read_group(group, {})


def test_a_missing_chunk_is_an_error_and_not_nan(group: Path) -> None:
    (group / "brdf" / "c" / "1" / "0").unlink()
    with pytest.raises(StoreError, match="brdf/c/1/0 is missing"):
        read_group(group, {})


def test_lookups_load_neither_zarr_nor_numba(tmp_path: Path) -> None:
    """In a process of its own: this one has loaded both."""
    import subprocess
    import sys

    root = Path(brdfdb.__file__).parents[1]
    script = tmp_path / "lookup.py"
    script.write_text(
        "import sys\n"
        "from brdfdb_pipelines import cli\n"
        "sys.argv = ['brdfdb', 'lookup', 'nothing', '0', '0', '0', '0', '--store', 'none']\n"
        "cli.main()\n"
        "from brdfdb.store import decoding\n"
        "from brdfdb.tables import table\n"
        "print(sorted({'zarr', 'numba', 'xarray'} & sys.modules.keys()))\n"
    )
    done = subprocess.run([sys.executable, script], cwd=root, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout.replace("'", '"')) == []
