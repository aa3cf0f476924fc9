"""Arrays of a revision read from their chunks are those that zarr reads, and others are left to zarr."""

from __future__ import annotations

import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import zarr

from brdfdb.errors import StoreError
from brdfdb.store.codec import dataset_files
from brdfdb.store.decoding import checked_bytes, read_by_zarr, read_group
from brdfdb.store.zarr_store import CheckedRevision


@pytest.fixture
def group(tmp_path: Path) -> Path:
    """A revision with arrays of several shapes: one without axes, and one in chunks, the last of which is not full."""
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
    found = read_group(partial(checked_bytes, group, files={}))
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
    assert read_group(partial(checked_bytes, group, files={})) is None
    found = read_by_zarr(CheckedRevision(group, {}))
    np.testing.assert_array_equal(found.arrays["brdf"], values)
    assert found.dims["brdf"] == ("theta_i", "theta_r")


def test_a_wrong_checksum_and_a_missing_chunk_are_errors(group: Path) -> None:
    chunk = group / "uniform" / "c"
    data = chunk.read_bytes()
    chunk.write_bytes(data[:-1] + b"\0")
    with pytest.raises(ValueError, match="the checksum of a chunk of uniform is wrong"):
        read_group(partial(checked_bytes, group, files={}))
    chunk.write_bytes(data)
    (group / "brdf" / "c" / "1" / "0").unlink()
    with pytest.raises(StoreError, match="brdf/c/1/0 is missing"):
        read_group(partial(checked_bytes, group, files={}))
    for _, array in zarr.open_group(group, mode="r").arrays():
        assert np.isnan(array.fill_value)  # zarr's own 0 would read as a black surface
        assert [type(each).__name__ for each in array.compressors] == ["BloscCodec", "Crc32cCodec"]
