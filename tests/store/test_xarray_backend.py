"""The backend of xarray: brdf over all axes of a revision, of a material and of a service; and files made of it."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import brdfdb
from brdfdb.errors import ParameterError, StoreError, UnknownMaterialError, UnknownRevisionError
from brdfdb.materials import presets
from brdfdb.store import publication
from brdfdb.store.publication import publish_dataset
from brdfdb.store.snapshots import create
from brdfdb.tables.tabulation import tabulate
from tests.api.a_store import serving
from tests.tables.test_xarray_view import LAYOUTS as TABLES

LAYOUTS = {name: TABLES[kind] for name, kind in (("clay", "plain"), ("brass", "anisotropic"), ("copper", "factored"))}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with a plain table, an anisotropic one and a factored one with a specular part; two revisions of clay."""
    store = tmp_path_factory.mktemp("backend") / "store"
    publish_dataset(store, "clay", tabulate(replace(LAYOUTS["clay"], source=presets()["foam"])))
    create(store, "first")
    for name, layout in LAYOUTS.items():
        publish_dataset(store, name, tabulate(layout))
    return store


def opened(place: Any, **keywords: Any) -> xr.Dataset:
    return xr.open_dataset(place, engine="brdfdb", **keywords)


@pytest.mark.parametrize("name", LAYOUTS)
def test_all_ways_to_a_revision_give_brdf_lazily(name: str, root: Path, tmp_path: Path) -> None:
    store = brdfdb.open(root)
    table = store[name]
    copy = shutil.copytree(store.path(name), tmp_path / "copy")
    for place, keywords in ((store.path(name).parent, {}), (copy, {}), (root, {"material": name})):
        with opened(place, **keywords) as dataset:
            assert not dataset["brdf"].variable._in_memory
            np.testing.assert_array_equal(dataset["brdf"].values, table.brdf)
            assert dataset.attrs["title"] == table.metadata.title
            assert dataset.attrs["Conventions"].startswith("CF-")
            assert all(found.attrs["units"] and found.attrs["long_name"] for found in dataset.variables.values())
            assert "parts" not in opened(place, drop_variables=["parts", "spectra"], **keywords)
    with opened(str(store.path(name))) as dataset:
        spectrum = () if table.wavelength_nm is None else ("wavelength",)
        assert dataset["brdf"].dims == (*table.grid.names, *spectrum)
        dataset.to_netcdf(tmp_path / "table.nc", engine="scipy")
        dataset.to_zarr(tmp_path / "table.zarr", consolidated=False)
    for written in (
        xr.open_dataset(tmp_path / "table.nc", engine="scipy"),
        xr.open_zarr(tmp_path / "table.zarr", consolidated=False, chunks=None),
    ):
        with written:
            np.testing.assert_array_equal(written["brdf"].values, table.brdf)
            if table.specular is not None:
                np.testing.assert_allclose(written["specular_reflectance"].values, table.specular, rtol=1e-7)
            assert json.loads(written.attrs["parameters"]) == table.metadata.parameters
            assert json.loads(written.attrs["symmetries"]) == table.grid.symmetries
            assert written.attrs["anisotropic"] == table.anisotropic


def test_revisions_and_snapshots_are_named_by_keywords(root: Path) -> None:
    foam = brdfdb.open(root).table("clay", "r000001").brdf
    for keywords in ({"revision": "r000001"}, {"snapshot": "first"}):
        np.testing.assert_array_equal(opened(root, material="clay", **keywords)["brdf"].values, foam)
        np.testing.assert_array_equal(opened(root / "materials" / "clay", **keywords)["brdf"].values, foam)


def test_a_service_is_read_as_far_as_needed(root: Path) -> None:
    copper = brdfdb.open(root)["copper"]
    pinned = f"r000001-{copper.digest[:16]}"
    with serving(root) as url:
        for place, keywords in (
            (url, {"material": "copper"}),
            (url, {"material": "copper", "revision": "r000001"}),
            (url, {"material": "copper", "revision": pinned}),
            (f"{url}/v1/store/materials/copper/r000001", {}),
        ):
            with opened(place, **keywords) as dataset:
                np.testing.assert_array_equal(dataset["brdf"].isel(theta_i=1).values, copper.brdf[1])
        with pytest.raises(ParameterError, match=r"^material: http.* is not the address of a revision"):
            opened(url)
        with pytest.raises(UnknownMaterialError, match=r"^no material 'cooper' in the store; closest: copper"):
            opened(url, material="cooper")
        for revision in ("r000009", "r000001-0123456789abcdef"):
            with pytest.raises(UnknownRevisionError, match=rf"^copper has no revision '{revision}'"):
                opened(f"{url}/v1/store/materials/copper/{revision}")


def test_other_places_are_refused(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place: Path
    for place, keywords, error, said in (
        (root, {}, ParameterError, "material: .* is a store; name one of its materials, such as brass"),
        (root / "materials" / "clya", {}, UnknownMaterialError, "no material 'clya' in the store; closest: clay$"),
        (root, {"material": "clay", "revision": "r9"}, UnknownRevisionError, "clay has no revision 'r9'"),
        (tmp_path / "empty", {}, StoreError, "no table at .*empty: name a revision, a material of a store, or"),
    ):
        with pytest.raises(error, match=f"^{said}"):
            opened(place, **keywords)
    with monkeypatch.context() as patch:  # another program does not check
        patch.setattr(publication, "checked_dataset", lambda _, dataset: dataset)
        publish_dataset(tmp_path / "other", "odd", xr.Dataset({"rho": ("theta", [0.5, 0.25])}))
    material = tmp_path / "other" / "materials" / "odd"
    for place in (material, shutil.copytree(material / "r000001", tmp_path / "copy")):
        with pytest.raises(StoreError, match=r"is not a table: brdf: neither it nor parts is among the arrays rho$"):
            opened(place)


def test_a_damaged_chunk_is_an_error_when_it_is_read(root: Path, tmp_path: Path) -> None:
    shutil.copytree(root, tmp_path / "store")
    (chunk,) = (tmp_path / "store" / "materials" / "brass" / "r000001" / "parts" / "c").rglob("0/0/0/0")
    chunk.write_bytes(chunk.read_bytes()[::-1])
    dataset = opened(tmp_path / "store" / "materials" / "brass")
    with pytest.raises(StoreError, match=r"^brass r000001 is damaged: the content of parts/c/0/0/0/0 changed$"):
        dataset["brdf"].load()
