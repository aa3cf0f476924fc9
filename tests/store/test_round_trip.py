"""The store takes back what it gives: each kind of table is published again as the same files."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import brdfdb
from brdfdb.errors import ParameterError
from brdfdb.geometry import vectors_from_half_difference
from brdfdb.materials import FunctionSource, presets
from brdfdb.measurements.measured_source import MeasuredSource
from brdfdb.store.publication import publish, publish_dataset
from brdfdb.store.reader import Store
from brdfdb.store.records import read_manifest
from brdfdb_pipelines import cli
from tests.measurements.made_up import scattered
from tests.store.a_store import lambert
from tests.tables.test_mixture import NM, PAINTED


def _planned(name: str, wavelengths_nm: Any = None, tolerance: float = 0.2) -> Callable[[Path], str]:
    def build(root: Path) -> str:
        publish(root, presets()[name], tolerance=tolerance, wavelengths_nm=wavelengths_nm)
        return name

    return build


def _mixed(root: Path) -> str:
    publish(root, PAINTED, tolerance=0.2, wavelengths_nm=NM)
    return PAINTED.name


def _polarised(root: Path) -> str:
    recipe = root.with_suffix(".toml")
    recipe.write_text('materials = ["magnesium-oxide-ceramic"]\ntolerance = 0.2\npolarised = true\n')
    assert cli.main(["build", str(recipe), "--store", str(root)]) == 0
    return "magnesium-oxide-ceramic"


def _measured(root: Path) -> str:
    source = MeasuredSource.of_samples(scattered(presets()["clay-vase"].brdf_at(None), 240, 0.03), name="made-up")
    publish(root, source, tolerance=0.2)
    return "made-up"


def _function(root: Path) -> str:
    def brdf(wi: Any, wr: Any, _: Any) -> Any:
        return 0.2 + 0.1 * wi[:, 2] * wr[:, 2]

    source = FunctionSource(brdf=brdf, name="velvet", title="Velvet", provenance="made up for a test")
    publish(root, source, tolerance=0.1)
    return "velvet"


KINDS = {
    "f_r": (_planned("clay-vase"), {"brdf"}),
    "numbers": (_planned("rendered-sphere-10deg", tolerance=0.01), {"brdf", "parts"}),
    "half-difference": (_planned("white-ceramic-tile"), {"theta_h", "parts", "uniform"}),
    "anisotropic": (_planned("rolled-brass"), {"phi_h", "parts", "uniform"}),
    "spectral": (_planned("roughened-aluminum-500nm"), {"wavelength", "specular_reflectance", "n", "k"}),
    "factored": (_planned("scene-copper-sphere", NM), {"spectra", "parts", "specular_theta_i"}),
    "mixture": (_mixed, {"mixture", "parts"}),
    "polarised": (_polarised, {"mueller", "depolarised"}),
    "measured": (_measured, {"extrapolated"}),
    "function": (_function, {"brdf"}),
}


def _files(root: Path, name: str) -> dict[str, Any]:
    """Return the digest of each file of the current revision; the JSON of the group itself, in any order."""
    group = Store(root).path(name)
    digests: dict[str, Any] = dict(read_manifest(group, None)[0]["files"])
    return digests | {"zarr.json": json.loads((group / "zarr.json").read_bytes())}


@pytest.mark.parametrize(("build", "holds"), KINDS.values(), ids=KINDS)
def test_a_table_is_taken_back_bit_for_bit(build: Callable[[Path], str], holds: set[str], tmp_path: Path) -> None:
    name = build(tmp_path / "first")
    dataset = brdfdb.open(tmp_path / "first").dataset(name)
    assert holds <= set(dataset.variables)
    publish_dataset(tmp_path / "second", name, dataset)
    assert _files(tmp_path / "second", name) == _files(tmp_path / "first", name)
    # and by way of a file that holds no objects, lists of text, true, false or null
    dataset.to_netcdf(tmp_path / "table.nc")
    with xr.open_dataset(tmp_path / "table.nc") as read:
        publish_dataset(tmp_path / "third", name, read)
    first, third = brdfdb.open(tmp_path / "first")[name], brdfdb.open(tmp_path / "third")[name]
    assert third.metadata == first.metadata
    angles = np.random.default_rng(1).uniform(0.0, 1.5, (4, 100))
    np.testing.assert_array_equal(third.lookup(*angles), first.lookup(*angles))


def test_values_that_no_longer_agree_with_their_parts_are_refused(tmp_path: Path) -> None:
    name = _planned("rolled-brass")(tmp_path / "first")
    dataset = brdfdb.open(tmp_path / "first").dataset(name)
    brighter = dataset.assign(brdf=2.0 * dataset["brdf"])
    with pytest.raises(ParameterError, match=r"^brdf: differs from the f_r that is rebuilt"):
        publish_dataset(tmp_path / "second", name, brighter)
    alone = brighter.drop_vars(["parts", "uniform"])  # its attributes say that logarithms are stored
    with pytest.raises(ParameterError, match=r"^brdf: the attributes say"):
        publish_dataset(tmp_path / "second", name, alone)
    assert not (tmp_path / "second").exists()
    del alone.attrs["interpolation"]
    publish_dataset(tmp_path / "second", name, alone)
    node = [np.radians(dataset[axis].values[1]) for axis in ("theta_h", "phi_h", "theta_d", "phi_d")]
    light, viewer = vectors_from_half_difference(*node)
    stored = brdfdb.open(tmp_path / "second")[name].lookup_vectors(light, viewer)
    assert stored == pytest.approx(float(brighter["brdf"][1, 1, 1, 1]), rel=1e-5)


def test_attributes_of_others_stay_as_they_are(tmp_path: Path) -> None:
    table = lambert(0.5).assign_attrs(Conventions="CF-1.9", bits="7", mine='{"a": 1}', flag=np.int64(3))
    publish_dataset(tmp_path, "white", table)
    attrs = brdfdb.open(tmp_path)["white"].attrs
    assert (attrs["Conventions"], attrs["bits"], attrs["mine"], attrs["flag"]) == ("CF-1.9", 7, '{"a": 1}', 3)
