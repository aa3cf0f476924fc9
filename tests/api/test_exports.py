"""Files of other formats over HTTP: their sizes, how many are made at once, and their tags."""

from __future__ import annotations

import asyncio
import re
import threading
from pathlib import Path
from typing import Any

import httpx
import pytest

from brdfdb import __version__, formats
from brdfdb.formats._written import Written
from brdfdb.tables.table import Table
from brdfdb_api.http import lookups
from tests.api.a_store import Client, client_of

FOIL, FELT, TILE, METAL = (
    f"/v1/materials/{name}" for name in ("copper-foil", "grey-felt", "white-tile", "brushed-metal")
)


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
    makes, running, most = threading.Event(), 0, 0

    def write(table: Table, path: Path, **_: Any) -> Written:
        nonlocal running, most
        running += 1
        most = max(most, running)
        makes.wait()
        running -= 1
        path.write_text(table.name)
        return Written((path,))

    monkeypatch.setattr(formats.EXPORTERS["csv"], "write", write)
    monkeypatch.setattr(lookups, "TURN_S", 1.0)
    app = client_of(root).app

    async def ask() -> tuple[list[httpx.Response], list[httpx.Response]]:
        transport = httpx.ASGITransport(app, raise_app_exceptions=False)
        async with httpx.AsyncClient(transport=transport, base_url="http://test") as client:
            asks = [asyncio.create_task(client.get(f"{TILE}/export/csv")) for _ in range(6)]
            try:
                done: set[asyncio.Task[httpx.Response]] = set()
                while len(done) < 4:
                    done, _ = await asyncio.wait(asks, timeout=0.05)
            finally:
                makes.set()
            return [task.result() for task in done], [await task for task in asks if task not in done]

    refused, made = asyncio.run(ask())
    assert most == 2
    assert [answer.status_code for answer in refused] == [503] * 4
    assert {answer.headers["retry-after"] for answer in refused} == {"1"}
    assert [answer.text for answer in made] == ["white-tile"] * 2


def test_the_tag_of_a_file_is_weak_and_names_the_program(client: Client) -> None:
    tag = client.get(f"{FELT}/export/csv").headers["etag"]
    assert re.fullmatch(rf'W/"grey-felt-r000001-[0-9a-f]{{16}}-{re.escape(__version__)}-None-csv"', tag)


def test_a_client_that_holds_anything_is_told_of_a_bad_request(client: Client) -> None:
    for address, status in [
        (f"{METAL}/export/fred", 422),
        (f"{FELT}/export/csv", 304),
        (f"{FOIL}/lookup?theta_i=10&theta_r=20&wavelength_nm=9999", 422),
        (f"{FOIL}/lookup?theta_i=10&theta_r=20&wavelength_nm=550", 304),
        (f"{FOIL}/lobe?wavelength_nm=9999", 422),
        (f"{FOIL}/lobe?wavelength_nm=550", 304),
    ]:
        assert client.get(address, headers={"If-None-Match": "*"}).status_code == status


MANY = {"theta_i": [10.0] * 20, "theta_r": 20}
LARGE = [
    (f"{TILE}/lookup", MANY),
    ("/v1/models/lambert/lookup", {**MANY, "parameters": {"rho": 0.5}}),
    ("/v1/lookup", {**MANY, "materials": ["white-tile"]}),
]


@pytest.mark.parametrize(("address", "body"), LARGE)
def test_many_values_wait_for_a_turn_and_not_for_good(
    root: Path, monkeypatch: pytest.MonkeyPatch, address: str, body: dict[str, Any]
) -> None:
    monkeypatch.setattr(lookups, "TURN_S", 0.1)
    monkeypatch.setattr(lookups, "INLINE_VALUES", 5)
    monkeypatch.setattr(lookups, "LARGE_VALUES", 10)
    app = client_of(root).app

    async def ask() -> list[httpx.Response]:
        transport = httpx.ASGITransport(app, raise_app_exceptions=False)
        async with httpx.AsyncClient(transport=transport, base_url="http://test") as client:
            for _ in range(lookups.LARGE_AT_ONCE):
                await app.state.large.acquire()
            few = {**MANY, "theta_i": 10.0}
            answers = [await client.post(address, json=body), await client.post(f"{TILE}/lookup", json=few)]
            app.state.large.release()
            return [*answers, await client.post(address, json=body)]

    refused, small, again = asyncio.run(ask())
    assert (refused.status_code, refused.headers["retry-after"]) == (503, "0")
    assert (small.status_code, again.status_code) == (200, 200)
