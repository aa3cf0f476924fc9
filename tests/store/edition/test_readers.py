"""Editions read by the commands, by xarray and by the service, from a directory and from a web server."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import brdfdb
from brdfdb.errors import ParameterError
from brdfdb.store.edition.reader import Edition
from brdfdb.store.http_client import RemoteStore
from brdfdb.store.reader import Store
from tests.api.a_store import Client, client_of, degrees, pinned_of, same, serving
from tests.pipelines.command import Captured, run
from tests.store.edition.an_edition import ANGLES, LONE, served

Published = tuple[Store, Path]
ADDRESSES = (
    "/v1/materials",
    "/v1/materials?q=shade",
    "/v1/materials/copper",
    "/v1/materials/polarised-copper",
    "/v1/families",
    "/v1/materials/copper/lookup?theta_i=30&theta_r=20&wavelength_nm=500",
    "/v1/materials/copper/lobe?theta_i=30",
    "/v1/materials/white/albedo",
    "/v1/materials/white/thumbnail.png",
    "/v1/materials/white/sphere",
    "/readyz",
    "/v1/store/zarr.json",
)


@pytest.fixture(params=["directory", "web"])
def place(request: pytest.FixtureRequest, published: Published) -> Iterator[str]:
    """The edition, in a directory and at the address of a web server."""
    if request.param == "directory":
        yield str(published[1])
    else:
        with served(published[1]) as server:
            yield server.url


def test_commands_print_what_they_print_of_the_store(
    place: str, published: Published, tmp_path: Path, capsys: Captured
) -> None:
    store, _ = published
    for command in (
        ["list"],
        ["show", "white"],
        ["show", "copper"],
        ["show", "polarised-copper"],
        ["show", "shade"],
        ["lookup", LONE, "30", "0", "50", "120"],
        ["lookup", "copper", "30", "0", "50", "120", "--wavelength", "500"],
        ["lookup", "shade", "30", "0", "50", "120", "--set", "rho=0.3"],
        ["plot", "white", "--out", "PLOT.svg"],
        ["export", "csv", "white", "--out", "DIR"],
    ):
        printed = []
        for at in (store.root, place):
            given = [str(tmp_path / each) if each.isupper() or "PLOT" in each else each for each in command]
            assert run(*given, "--store", at) == 0, capsys.readouterr().err
            printed.append(capsys.readouterr().out.replace(str(at), "PLACE").replace(f"{store.root}", "PLACE"))
            for path in sorted(tmp_path.rglob("*")):
                if path.is_file():
                    printed[-1] += str(path.read_bytes().replace(str(at).encode(), b"PLACE"))
                    path.unlink()
        known = [[line for line in text.splitlines() if "PLACE" not in line] for text in printed]
        assert known[0] == known[1]
    assert run("verify", "--store", place) == 0


def test_xarray_opens_a_material(place: str, published: Published) -> None:
    store, _ = published
    for name in ("white", "copper", "in-chunks", LONE):
        with xr.open_dataset(place, engine="brdfdb", material=name) as dataset:
            assert not dataset["brdf"].variable._in_memory or name != LONE
            assert dataset.load().identical(store.dataset(name).load())
    if not place.startswith("http"):
        with xr.open_dataset(place, engine="brdfdb", material="white", revision="r000002") as dataset:
            assert dataset["brdf"].size
        with pytest.raises(
            ParameterError, match=r"^material: .* is an edition; name one of its materials, such as bronze"
        ):
            xr.open_dataset(place)  # the engine is found


@pytest.fixture(scope="module")
def clients(published: Published) -> tuple[Client, Client]:
    """Clients of a service of the store, and of one of the edition."""
    return client_of(published[0].root), client_of(published[1])


@pytest.mark.parametrize("address", ADDRESSES)
def test_the_service_answers_as_of_the_store(address: str, clients: tuple[Client, Client]) -> None:
    of_store, of_edition = (client.get(address) for client in clients)
    assert of_edition.status_code == of_store.status_code == 200, of_edition.text
    if "json" in of_store.headers["content-type"]:
        assert of_edition.json() == of_store.json()
    else:
        assert of_edition.content == of_store.content


def test_files_of_the_service(published: Published, clients: tuple[Client, Client]) -> None:
    store, _ = published
    for name in store:
        at = f"/v1/store/materials/{name}/{pinned_of(store, name, store.head(name))}"
        for address in [f"{at}.MANIFEST.json", *(f"{at}/{key}" for key in store.revision(name).manifest["files"])]:
            of_store, of_edition = (client.get(address) for client in clients)
            assert of_edition.status_code == 200
            assert of_edition.content == of_store.content
        answer = clients[1].get(f"/v1/materials/{name}/download.zarr")
        assert answer.content == clients[0].get(f"/v1/materials/{name}/download.zarr").content
    assert clients[1].get("/v1/materials/white/revisions/r000001").status_code == 404


def test_tables_of_the_service(place: str, published: Published) -> None:
    store, _ = published
    with serving(place) as url:
        remote = brdfdb.open(url)
        assert isinstance(remote, RemoteStore)
        assert list(remote) == list(store)
        assert remote["white"].digest == store["white"].digest
        same(remote["white"].lookup(*ANGLES), store["white"].lookup(*ANGLES))
        assert remote.dataset("copper").load().identical(store.dataset("copper").load())
    assert isinstance(brdfdb.open(place), Edition)
    assert degrees(store, "white", 10, 0, 10, 0) == brdfdb.open(place)["white"].lookup(*np.deg2rad([10, 0, 10, 0]))
