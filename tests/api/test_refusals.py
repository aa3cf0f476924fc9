"""Refusals of the service: a sentence with what is allowed, and the name of the parameter."""

from __future__ import annotations

import asyncio
import errno
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb.materials import Material
from brdfdb.scenes import lit_sphere
from brdfdb.store.publication import publish_dataset
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import tabulate
from brdfdb_api.http import lookups
from tests.api.a_store import GREY, Client, client_of, npy

FELT = "/v1/materials/grey-felt/lookup"
FOIL = "/v1/materials/copper-foil/lookup"
NPY = {"Content-Type": "application/x-npy"}
MODEL = "/v1/models/he_torrance/lookup"
POINT = {"theta_i": 1, "theta_r": 2}
COPPER = {"refractive_index": "main/Cu/Johnson", "parameters": {"sigma_0_um": 0.2, "tau_um": 2.0}}


@pytest.fixture(scope="module")
def client(root: Path) -> Client:
    return client_of(root)


def test_names_that_are_repeated_are_not_merged(client: Client) -> None:
    body = POINT | {"materials": ["grey-felt", "white-tile", "grey-felt"]}
    problem = client.problem("POST", "/v1/lookup", 422, json=body)
    assert problem["detail"] == "materials: 'grey-felt' is given more than once"
    assert problem["parameter"] == "materials"


def test_an_address_that_is_none_says_where_all_are(client: Client) -> None:
    problem = client.problem("GET", "/v1/material/grey-felt", 404)
    assert problem["detail"] == "'/v1/material/grey-felt' is no address; /docs lists all that there are"


def test_a_filter_that_nothing_can_have_says_what_is_allowed(client: Client) -> None:
    for query, sentence in [
        ("model=phong", "model: 'phong' is not one of abg, beckmann, "),
        ("paper=he1992", "paper: 'he1992' is in no source, and in none of "),
        ("verdict=good", "verdict: 'good' is not one of 'passes', "),
    ]:
        problem = client.problem("GET", f"/v1/materials?{query}", 422)
        assert problem["detail"].startswith(sentence)
        assert problem["parameter"] == query.partition("=")[0]


def test_a_refusal_names_its_parameter(client: Client) -> None:
    for address, request_of, status, parameter in [
        (FELT, {"json": {"theta_i": [1, 2], "theta_r": [1, 2, 3]}}, 422, "theta_r"),
        (FELT, {"content": "[]"}, 422, "body"),
        (FELT, {"content": b"no array", "headers": NPY}, 422, "body"),
        (FELT, {"content": npy(np.ones((2, 3))), "headers": NPY}, 422, "body"),
        (MODEL, {"json": POINT | COPPER | {"refractive_index": "main/Cx/Q"}}, 422, "refractive_index"),
        ("/v1/materials/none/lookup", {"json": POINT}, 404, "name"),
        ("/v1/models/none/lookup", {"json": POINT}, 404, "model"),
        ("/v1/families/none/lookup", {"json": POINT | {"parameters": {}}}, 404, "family"),
        ("/v1/materials/grey-felt/revisions/r9/lookup", {"json": POINT}, 404, "revision"),
    ]:
        problem = client.problem("POST", address, status, **request_of)
        assert problem["parameter"] == parameter
        if status == 422:
            assert problem["detail"].startswith(f"{parameter}: ")


def test_an_unknown_illuminant_is_answered_with_all(client: Client) -> None:
    query = {**POINT, "output": "xyz", "illuminant": "D66"}
    detail = client.problem("GET", FOIL, 422, params=query)["detail"]
    assert detail.startswith("illuminant: 'D66' is unknown; closest: D65")
    assert "allowed are A, B, C, D50, D55, D60, D65, D75, E, FL1 to FL12, " in detail


def test_a_table_of_one_wavelength_names_it(own: Path) -> None:
    about = {"title": "One", "model": "he_torrance", "source": "no paper", **COPPER}
    publish_dataset(own, "one", tabulate(Layout(Material.from_table("one", about), GREY, np.array([500.0]))))
    problem = client_of(own).problem("GET", "/v1/materials/one/lookup", 422, params={**POINT, "wavelength_nm": 600})
    assert problem["detail"] == "wavelength_nm: 600 is not 500 nm, the one wavelength of one"


def test_summaries_of_operations_are_sentences(client: Client) -> None:
    document = client.get("/openapi.json").json()
    operations = [operation for methods in document["paths"].values() for operation in methods.values()]
    summaries = [operation["summary"] for operation in operations]
    assert all(summary.startswith(("Return ", "Report ")) for summary in summaries)


def test_without_descriptors_the_page_is_to_be_asked_for_again(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any, **__: Any) -> Any:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr("brdfdb_api.http.pages._explorer_file", fail)
    assert "too many files" in client.problem("GET", "/", 503)["detail"]
    assert client.get("/").headers["retry-after"] == "1"


def test_a_file_of_a_material_that_vanished_is_no_missing_one(own: Path) -> None:
    address = "/v1/store/materials/grey-felt/r000001/zarr.json"
    client = client_of(own)
    assert client.get(address).status_code == 200
    (own / "materials" / "grey-felt").rename(own / "grey-felt")
    assert client.problem("GET", address, 503)["detail"] == "grey-felt is gone from the store"  # 404 is a fill value


def test_pictures_are_drawn_in_turns(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn, most, draw = 0, 0, lit_sphere.sphere_png

    def counting(*arguments: Any) -> bytes:
        nonlocal drawn, most
        drawn += 1
        most = max(most, drawn)
        picture = draw(*arguments)
        drawn -= 1
        return picture

    monkeypatch.setattr(lit_sphere, "sphere_png", counting)
    client = client_of(own)

    async def ask(size: int) -> int:
        statuses = []

        async def receive() -> dict[str, Any]:
            return {"type": "http.request", "body": b""}

        async def send(message: dict[str, Any]) -> None:
            statuses.append(message.get("status"))

        scope = {
            "type": "http",
            "http_version": "1.1",
            "method": "GET",
            "path": "/v1/materials/grey-felt/sphere",
            "headers": [],
        }
        await client.app({**scope, "query_string": f"size={size}".encode()}, receive, send)
        return int(statuses[0] or 0)

    async def all_at_once() -> list[int]:
        return await asyncio.gather(*(ask(size) for size in range(40, 60)))

    assert asyncio.run(all_at_once()) == [200] * 20
    assert 1 <= most <= lookups.LARGE_AT_ONCE
