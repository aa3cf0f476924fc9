"""Files of other formats and pictures over HTTP: their sizes, their tags, and how many are made at once."""

from __future__ import annotations

import asyncio
import threading
from pathlib import Path
from typing import Any

import httpx
import pytest

from brdfdb import formats
from brdfdb.formats._written import Written
from brdfdb.scenes import lit_sphere
from brdfdb.tables.table import Table
from brdfdb_api.http import lookups
from tests.api.a_store import Client, client_of

FOIL, FELT, TILE, METAL = (
    f"/v1/materials/{name}" for name in ("copper-foil", "grey-felt", "white-tile", "brushed-metal")
)


class MostAtOnce:
    """Counts calls that run at the same time."""

    def __init__(self) -> None:
        self.running = self.most = 0

    def __enter__(self) -> None:
        self.running += 1
        self.most = max(self.most, self.running)

    def __exit__(self, *_: object) -> None:
        self.running -= 1


def asked_at_once(app: Any) -> httpx.AsyncClient:
    """A client whose requests may overlap."""
    transport = httpx.ASGITransport(app, raise_app_exceptions=False)
    return httpx.AsyncClient(transport=transport, base_url="http://test")


def test_sizes_of_files_have_lower_limits_than_at_the_command_line(client: Client) -> None:
    for query, highest in [
        ("rgl?megabytes=65", 64),
        ("kaist?megabytes=65", 64),
        ("radiance?cells=600001", 600_000),
        ("png?size=513", 512),
        ("eradiate?nodes=130", 129),
        *((f"{name}?size=17", 16) for name in ("astm", "fred", "ssdd", "zemax")),
    ]:
        problem = client.problem("GET", f"{FELT}/export/{query}", 422)
        assert problem["parameter"] == query.partition("?")[2].partition("=")[0]
        assert f", {highest:g}]" in problem["detail"]


def test_few_files_are_made_at_once(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    makes, files = threading.Event(), MostAtOnce()

    def write(table: Table, path: Path, **_: Any) -> Written:
        with files:
            makes.wait()
        path.write_text(table.name)
        return Written((path,))

    monkeypatch.setattr(formats.EXPORTERS["csv"], "write", write)
    monkeypatch.setattr(lookups, "TURN_S", 1.0)

    async def ask() -> tuple[list[httpx.Response], list[httpx.Response]]:
        async with asked_at_once(client_of(root).app) as client:
            asks = [asyncio.create_task(client.get(f"{TILE}/export/csv")) for _ in range(6)]
            try:
                done: set[asyncio.Task[httpx.Response]] = set()
                while len(done) < 4:
                    done, _ = await asyncio.wait(asks, timeout=0.05)
            finally:
                makes.set()
            return [task.result() for task in done], [await task for task in asks if task not in done]

    refused, made = asyncio.run(ask())
    assert files.most == 2
    assert [(answer.status_code, answer.headers["retry-after"]) for answer in refused] == [(503, "1")] * 4
    assert [answer.text for answer in made] == ["white-tile"] * 2


def test_pictures_are_drawn_in_turns(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pictures, draw = MostAtOnce(), lit_sphere.sphere_png

    def counting(*arguments: Any) -> bytes:
        with pictures:
            return draw(*arguments)

    monkeypatch.setattr(lit_sphere, "sphere_png", counting)

    async def all_at_once() -> list[httpx.Response]:
        async with asked_at_once(client_of(own).app) as client:
            return await asyncio.gather(*(client.get(f"{FELT}/sphere?size={size}") for size in range(40, 60)))

    assert [answer.status_code for answer in asyncio.run(all_at_once())] == [200] * 20
    assert 1 <= pictures.most <= lookups.LARGE_AT_ONCE


def test_a_client_that_holds_any_answer_is_told_of_a_bad_request(client: Client) -> None:
    point = f"{FOIL}/lookup?theta_i=10&theta_r=20"
    for address, status in [
        (f"{METAL}/export/fred", 422),
        (f"{FELT}/export/csv", 304),
        (f"{point}&wavelength_nm=9999", 422),
        (f"{point}&thetai=3", 422),
        (f"{point}&wavelength_nm=550", 304),
        (f"{FOIL}/lobe?wavelength_nm=9999", 422),
        (f"{FOIL}/lobe?wavelength_nm=550", 304),
        ("/v1/materials/copper-foul", 404),
    ]:
        assert client.get(address, headers={"If-None-Match": "*"}).status_code == status, address
    assert client.get(f"{FELT}/export/csv").headers["etag"].startswith('W/"grey-felt-r000001-')


MANY = {"theta_i": [10.0] * 20, "theta_r": 20}


def test_many_values_wait_for_a_turn_and_not_for_good(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lookups, "TURN_S", 0.1)
    monkeypatch.setattr(lookups, "INLINE_VALUES", 5)
    monkeypatch.setattr(lookups, "LARGE_VALUES", 10)
    large: dict[str, dict[str, Any]] = {
        f"{TILE}/lookup": MANY,
        "/v1/models/lambert/lookup": {**MANY, "parameters": {"rho": 0.5}},
        "/v1/lookup": {**MANY, "materials": ["white-tile"]},
    }

    async def ask(address: str) -> list[httpx.Response]:
        app = client_of(root).app
        async with asked_at_once(app) as client:
            turns = lookups.LARGE_AT_ONCE
            for _ in range(turns):
                await app.state.large.acquire()
            refused = await client.post(address, json=large[address])
            small = await client.post(f"{TILE}/lookup", json={**MANY, "theta_i": 10.0})
            for _ in range(turns):
                app.state.large.release()
            return [refused, small, await client.post(address, json=large[address])]

    for address in large:
        refused, small, again = asyncio.run(ask(address))
        assert (refused.status_code, refused.headers["retry-after"]) == (503, "0"), address
        assert (small.status_code, again.status_code) == (200, 200), address
