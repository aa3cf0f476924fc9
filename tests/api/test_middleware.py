"""Around every answer: pages of other origins, request ids, the log and the counters."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import AsyncMock

import pytest

from brdfdb_api.http.errors import problem_of
from brdfdb_api.http.middleware import Edge
from brdfdb_api.log import flush
from tests.api.a_store import NPY, Client, client_of, npy

FELT = "/v1/materials/grey-felt"
POINT = f"{FELT}/lookup?theta_i=10&theta_r=20"


def test_pages_of_other_origins_may_ask_only_where_that_is_set(root: Path) -> None:
    origin, other = {"Origin": "https://a.example"}, {"Origin": "https://b.example"}
    asked = {**origin, "Access-Control-Request-Method": "POST", "Access-Control-Request-Headers": "content-type"}
    assert "access-control-allow-origin" not in client_of(root).get(POINT, headers=origin).headers
    client = client_of(root, cors_origins=("https://a.example",))
    answer = client.get(POINT, headers=origin)
    assert answer.headers["access-control-allow-origin"] == "https://a.example"
    assert "ETag" in answer.headers["access-control-expose-headers"]
    assert "access-control-allow-origin" not in client.get(POINT, headers=other).headers
    assert client.request("OPTIONS", f"{FELT}/lookup", headers=asked).status_code == 200
    for wrong, reason in [(other, "origin"), ({"Access-Control-Request-Method": "DELETE"}, "method")]:
        assert reason in client.problem("OPTIONS", f"{FELT}/lookup", 400, headers=asked | wrong)["detail"]


ADDRESSES = [POINT, FELT, "/healthz", "/nothing", "/v1/materials/grey-fell", f"{FELT}/lookup?theta_i=900&theta_r=1"]


def test_a_request_has_an_id(client: Client) -> None:
    for address in ADDRESSES:
        assert client.get(address, headers={"X-Request-ID": "my-id.7_A"}).headers["x-request-id"] == "my-id.7_A"
        made = [client.get(address).headers["x-request-id"] for _ in range(2)]
        assert made[0] != made[1]
    for harmful in ["", "two words", "a" * 65, 'a"b', "a\tb"]:
        made.append(client.get(POINT, headers={"X-Request-ID": harmful}).headers["x-request-id"])
    assert all(re.fullmatch("[0-9a-f]{16}", each) for each in made)


def test_head_is_get_without_the_body(client: Client) -> None:
    for address in [*ADDRESSES, "/", "/v1/materials"]:
        got, asked = client.get(address), client.request("HEAD", address)
        assert (asked.status_code, asked.content) == (got.status_code, b"")
        for name in ("content-type", "content-length", "etag", "cache-control"):
            assert asked.headers.get(name) == got.headers.get(name)
    send = AsyncMock()  # the client of these tests would drop a body
    scope = {"type": "http", "http_version": "1.1", "method": "HEAD", "path": FELT, "query_string": b"", "headers": []}
    asyncio.run(client.app(scope, AsyncMock(return_value={"type": "http.request", "body": b""}), send))
    assert [message.args[0].get("body") for message in send.await_args_list] == [None, b""]


def test_a_server_is_ready_when_its_kernels_are_loaded(client: Client) -> None:
    shelf = client.app.state.shelf
    shelf.warming = True
    assert "kernels" in client.problem("GET", "/readyz", 503)["detail"]
    assert client.get("/readyz").headers["retry-after"] == "1"
    assert client.get("/healthz").status_code == 200
    shelf.warm()
    assert client.get("/readyz").json() == {"status": "ok", "materials": 4}


Log = Callable[[], list[dict[str, Any]]]


@pytest.fixture
def log(capfd: pytest.CaptureFixture[str]) -> Log:
    """The lines of the log since it was read last."""

    def lines() -> list[dict[str, Any]]:
        flush()
        return [json.loads(line) for line in capfd.readouterr().err.splitlines()]

    flush()  # lines of tests before
    capfd.readouterr()
    return lines


DOWNLOAD = f"{FELT}/download.zarr"
REQUESTS = [(POINT, 200), (FELT, 200), ("/nothing", 404), (f"{FELT}/lookup", 422)]


def test_the_log_has_a_line_of_json_for_each_request(client: Client, log: Log) -> None:
    # A download that was read to its end is no client that went away
    for method, address, status in [
        *(("GET", *each) for each in REQUESTS),
        ("GET", DOWNLOAD, 200),
        ("HEAD", POINT, 200),
    ]:
        client.request(method, address, headers={"X-Request-ID": "mine"})
        (line,) = log()
        path, _, query = address.partition("?")
        told = {"request": "mine", "method": method, "path": path, "query": query, "status": status}
        assert {key: line[key] for key in told} == told
        assert line["ms"] > 0.0


def test_the_log_may_be_of_refusals_or_failures_alone(own: Path, log: Log) -> None:
    (own / "materials" / "white-tile" / "r000001" / "zarr.json").write_bytes(b"{}")
    for level, lowest in [("info", 0), ("warning", 400), ("error", 500)]:
        client = client_of(own, log_level=level)
        for address in [*(address for address, _ in REQUESTS), "/v1/materials/white-tile"]:
            client.get(address)
        statuses = [line["status"] for line in log()]
        assert statuses == [status for status in (200, 200, 404, 422, 503) if status >= lowest], level


def test_long_lines_of_the_log_are_shortened(client: Client, log: Log, capfd: pytest.CaptureFixture[str]) -> None:
    client.get(POINT + "".join(f"&wavelength_nm={wavelength}.25" for wavelength in range(400, 441)))
    (line,) = log()
    assert line["query"].endswith("wavelength_nm=440.25")
    for character in ["a", "%01", "%5C", "%C3%A9", "%F0%9F%98%80"]:
        client.get(f"/{character * 2000}?{'%01' * 2000}", headers={"X-Request-ID": "i" * 64})
        flush()
        written = capfd.readouterr().err
        assert len(written.encode()) <= 4096, character
        assert written.isascii(), character
        assert json.loads(written)["path"].startswith("/"), character


def test_an_answer_that_breaks_in_the_middle_is_a_failure(log: Log) -> None:
    async def breaks(_: Any, __: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"first", "more_body": True})
        raise OSError("the disk \udcff")

    edge = Edge(breaks, limit=1, quick=(), failed=problem_of, log_level="error")
    scope = {"type": "http", "method": "GET", "path": "/", "query_string": b"", "headers": []}
    with pytest.raises(OSError, match="the disk"):
        asyncio.run(edge(scope, AsyncMock(), AsyncMock()))
    failed, answered = log()
    assert failed["failed"] == "OSError: the disk \\udcff"
    assert answered["status"] == 500


@pytest.mark.parametrize("address", [POINT, FELT])
def test_a_failure_is_only_in_the_log(client: Client, log: Log, monkeypatch: pytest.MonkeyPatch, address: str) -> None:
    def fail(*_: Any) -> Any:
        raise RuntimeError("secret")

    monkeypatch.setattr("brdfdb.store.shelf.Shelf.held", fail)
    monkeypatch.setattr("brdfdb.store.shelf.Shelf.table", fail)
    assert "secret" not in client.problem("GET", address, 500, headers={"X-Request-ID": "mine"})["detail"]
    failed, answered = log()  # a line each, the traceback included
    assert (failed["request"], failed["failed"]) == ("mine", "RuntimeError: secret")
    assert "in fail\n" in failed["traceback"]
    assert failed["traceback"].endswith("RuntimeError: secret\n")
    assert (answered["request"], answered["status"]) == ("mine", 500)


def test_a_client_that_goes_away_is_no_failure(client: Client, log: Log) -> None:
    send = AsyncMock()
    line = 'brdfdb_requests_total{route="/v1/materials/{name}/lookup",status="499"}'
    before = counted(client, line)
    log()
    scope = {"type": "http", "http_version": "1.1", "method": "POST", "path": f"{FELT}/lookup", "query_string": b""}
    asyncio.run(client.app({**scope, "headers": []}, AsyncMock(return_value={"type": "http.disconnect"}), send))
    send.assert_not_awaited()
    assert [each["status"] for each in log()] == [499]
    assert counted(client, line) - before == 1


def counted(client: Client, line: str) -> float:
    """The value of a line of /metrics, 0 where there is none."""
    lines = client.get("/metrics").text.splitlines()
    return next((float(text.rpartition(" ")[2]) for text in lines if text.startswith(line + " ")), 0.0)


def test_requests_and_points_are_counted(client: Client) -> None:
    for address, line in [
        (POINT, 'brdfdb_requests_total{route="/v1/materials/{name}/lookup",status="200"}'),
        (POINT, 'brdfdb_points_total{source="table"}'),
        (POINT + "&from=model", 'brdfdb_points_total{source="model"}'),
        (POINT, 'brdfdb_request_seconds_count{route="/v1/materials/{name}/lookup"}'),
        (FELT, 'brdfdb_requests_total{route="/v1/materials/{name}",status="200"}'),
        (f"{FELT}/lookup", 'brdfdb_requests_total{route="/v1/materials/{name}/lookup",status="422"}'),
        ("/nothing/at/all", 'brdfdb_requests_total{route="other",status="404"}'),
    ]:
        before = counted(client, line)
        client.get(address)
        assert counted(client, line) - before == 1, line
    points = 'brdfdb_points_total{source="table"}'
    before = counted(client, points)
    client.post(f"{FELT}/lookup", content=npy([[10.0, 0.0, 20.0, 0.0]] * 17), headers={"Content-Type": NPY})
    assert counted(client, points) - before == 17
