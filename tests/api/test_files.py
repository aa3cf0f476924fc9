"""The files of the store over HTTP: one by one, as xarray reads them, and a revision as a zip."""

from __future__ import annotations

import hashlib
import io
import zipfile
from pathlib import Path

import fsspec
import httpx
import numpy as np
import pytest
import xarray as xr
import zarr
from zarr.storage import ZipStore

from brdfdb.store import snapshots
from brdfdb.store.reader import Store
from brdfdb.store.revisions import collect, rollback
from tests.api.a_store import Client, client_of, pinned_of, publish, serving
from tests.api.connections import WAIT_S

FOIL = "/v1/materials/copper-foil"
STORED = "/v1/store/materials/copper-foil/r000001"
CHUNK = "brdf/c/0/0/0/0"
WHITE = "/v1/materials/white"


def files(directory: Path) -> dict[str, bytes]:
    return {str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def test_each_file_is_served_as_it_is(client: Client, store: Store) -> None:
    stored = files(store.path("copper-foil"))
    assert {"zarr.json", CHUNK} < stored.keys()
    for name, content in stored.items():
        answer = client.get(f"{STORED}/{name}")
        assert (answer.status_code, answer.content) == (200, content)
        kind = "application/json" if name.endswith(".json") else "application/octet-stream"
        assert answer.headers["content-type"] == kind
    manifest = client.get(f"{STORED}.MANIFEST.json")
    assert hashlib.sha256(manifest.content).hexdigest() == store["copper-foil"].digest
    assert set(manifest.json()["files"]) == stored.keys()


def test_nothing_but_the_files_of_a_manifest(own: Path) -> None:
    (own / "materials" / "copper-foil" / "r000001" / "stranger.txt").write_text("nobody's")
    client = client_of(own)
    for address in [
        f"{STORED}/nothing",
        f"{STORED}/",
        f"{STORED}/brdf",
        f"{STORED}/stranger.txt",
        f"{STORED}/%2e%2e/r000001.MANIFEST.json",
        f"{STORED}/..%2fHEAD.json",
        f"{STORED}/%2e%2e%2f%2e%2e%2f%2e%2e%2fbrdfdb.json",
        f"{STORED}//etc/passwd",
        f"{STORED}/%2fetc%2fpasswd",
        f"{STORED}/zarr.json%00",
        "/v1/store/materials/copper-foil/r000002/zarr.json",
        "/v1/store/materials/copper-foil/%2e%2e/HEAD.json",
        "/v1/store/materials/copper-foil/HEAD.json",
        "/v1/store/materials/copper-foil/.staging/zarr.json",
        "/v1/store/materials/%2e%2e/materials/copper-foil/r000001/zarr.json",
        "/v1/store/materials/copper-fool/r000001/zarr.json",
        "/v1/store/brdfdb.json",
    ]:
        client.problem("GET", address, 404)


def test_a_file_that_is_missing_is_an_error_not_a_fill_value(own: Path) -> None:
    (own / "materials" / "copper-foil" / "r000001" / CHUNK).unlink()
    client = client_of(own)
    for address in (f"{STORED}/{CHUNK}", f"{STORED}/zarr.json", f"{FOIL}/download.zarr"):
        assert "damaged" in client.problem("GET", address, 503)["detail"]
    (own / "materials" / "white-tile" / "r000001.MANIFEST.json").unlink()
    detail = client.problem("GET", "/v1/materials/white-tile/download.zarr", 503)["detail"]
    assert detail.startswith("white-tile")
    address = "/v1/store/materials/grey-felt/r000001/zarr.json"
    assert client.get(address).status_code == 200
    (own / "materials" / "grey-felt").rename(own / "grey-felt")
    assert client.problem("GET", address, 503)["detail"] == "grey-felt is gone from the store"


def test_a_file_that_changed_in_place_is_not_sent_to_be_kept_for_good(own: Path) -> None:
    chunk = own / "materials" / "copper-foil" / "r000001" / CHUNK
    sound = chunk.read_bytes()
    chunk.write_bytes(bytes([sound[0] ^ 1]) + sound[1:])
    client = client_of(own)
    addresses = (f"{STORED}/{CHUNK}", f"{FOIL}/download.zarr", f"{FOIL}/revisions/r000001/download.zarr")
    for address in addresses:
        detail = client.problem("GET", address, 503)["detail"]
        assert detail == f"copper-foil r000001 is damaged: the content of {CHUNK} changed"
    chunk.unlink()
    for address in addresses:
        assert "missing" in client.problem("GET", address, 503)["detail"]
    chunk.write_bytes(sound)
    answers = [client.get(address) for address in addresses]
    assert [answer.status_code for answer in answers] == [200] * 3
    assert answers[1].content == answers[2].content == client.get(addresses[1]).content


def test_a_zip_that_xarray_opens(client: Client, store: Store, tmp_path: Path) -> None:
    answer = client.get(f"{FOIL}/download.zarr")
    assert answer.headers["content-type"] == "application/zip"
    assert answer.headers["content-disposition"] == 'attachment; filename="copper-foil-r000001.zarr.zip"'
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.testzip() is None
        assert {name: archive.read(name) for name in archive.namelist()} == files(store.path("copper-foil"))
    (tmp_path / "copper.zip").write_bytes(answer.content)
    zipped = ZipStore(tmp_path / "copper.zip", mode="r")
    with xr.open_zarr(zipped) as found, xr.open_zarr(store.path("copper-foil")) as expected:
        assert found.load().identical(expected.load())
    zipped.close()


def test_a_service_that_is_pinned_to_a_snapshot_goes_on_serving_it(tmp_path: Path) -> None:
    publish(tmp_path, "white", "lambert", rho=0.25)
    snapshots.create(tmp_path, "paper")
    publish(tmp_path, "white", "lambert", rho=0.5)
    publish(tmp_path, "black", "lambert", rho=0.0)
    collect(tmp_path, 1)
    at = f"{WHITE}/lookup?theta_i=30&theta_r=30"
    pinned, current = client_of(tmp_path, snapshot="paper"), client_of(tmp_path)
    assert current.get(at).json()["brdf"] == 2 * pinned.get(at).json()["brdf"]
    assert [each["name"] for each in pinned.get("/v1/materials").json()["materials"]] == ["white"]
    assert pinned.get(WHITE).json()["revisions"] == ["r000001"]
    assert pinned.get("/v1/store/materials/white/r000001/zarr.json").status_code == 200
    pinned.problem("GET", "/v1/store/materials/white/r000002/zarr.json", 404)
    client_of(tmp_path, snapshot="poster").problem("GET", at, 503)


def test_zarr_xarray_and_fsspec_read_the_store(own: Path, store: Store) -> None:
    pytest.importorskip("aiohttp")
    content = (store.path("copper-foil") / CHUNK).read_bytes()
    publish(own, "white-tile", "lambert", rho=0.5)
    (own / "materials" / "grey-felt" / "r000001" / "zarr.json").unlink()  # a damaged material is left out
    with serving(own) as url:
        group = zarr.open_group(f"{url}/v1/store", mode="r")
        assert sorted(group["materials"].group_keys()) == ["brushed-metal", "copper-foil", "white-tile"]
        revisions = {name: list(group[f"materials/{name}"].group_keys()) for name in ("copper-foil", "white-tile")}
        foil, tile = pinned_of(Store(own), "copper-foil"), pinned_of(Store(own), "white-tile", "r000002")
        assert revisions == {"copper-foil": [foil], "white-tile": [tile]}
        table = group[f"materials/copper-foil/{foil}"]
        assert table.attrs["title"] == "Test copper-foil"
        local = zarr.open_group(store.path("copper-foil"), mode="r")
        np.testing.assert_array_equal(table["brdf"][:2], local["brdf"][:2])
        place = f"materials/copper-foil/{foil}"
        with xr.open_zarr(f"{url}/v1/store", group=place) as found, xr.open_zarr(store.path("copper-foil")) as expected:
            assert found.load().identical(expected.load())
        web = fsspec.filesystem("http", skip_instance_cache=True)
        stored = httpx.get(f"{url}{FOIL}", timeout=WAIT_S).json()["links"]["store"]
        assert stored == f"/v1/store/{place}"
        assert web.size(f"{url}{stored}/{CHUNK}") == len(content)
        assert web.cat_file(f"{url}{stored}/{CHUNK}", 4, 12) == content[4:12]
        assert web.cat_file(f"{url}{stored}/{CHUNK}", start=-8) == content[-8:]
        assert not web.exists(f"{url}{stored}/nothing")


def test_an_older_revision_may_become_current_again(tmp_path: Path) -> None:
    for rho in (0.25, 0.5):
        publish(tmp_path, "white", "lambert", rho=rho)
    client = client_of(tmp_path)
    at = f"{WHITE}/lookup?theta_i=30&theta_r=30"
    newer = client.get(at)
    rollback(tmp_path, "white", "r000001")
    older = client.get(at, headers={"If-None-Match": newer.headers["etag"]})
    assert (older.status_code, older.json()["revision"]) == (200, "r000001")
    assert older.json()["brdf"] == newer.json()["brdf"] / 2.0
    assert client.get(at.replace("lookup", "revisions/r000002/lookup")).json() == newer.json()
    with zipfile.ZipFile(io.BytesIO(client.get(f"{WHITE}/download.zarr").content)) as archive:
        assert archive.read("zarr.json") == (tmp_path / "materials" / "white" / "r000001" / "zarr.json").read_bytes()
