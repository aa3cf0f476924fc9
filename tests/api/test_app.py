"""Settings from the environment, the OpenAPI document, and the server's own errors."""

from __future__ import annotations

import json
import socket
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import brdfdb_api
from brdfdb.store import StoreError
from brdfdb_api.app import create_app, openapi_json, serve
from brdfdb_api.settings import Settings

OPENAPI = Path(__file__).parents[2] / "api" / "openapi.json"
LOOKUP = "/v1/materials/blue-foil/lookup"


def test_settings_default() -> None:
    assert Settings.from_environment({}) == Settings()


def test_settings_of_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("BRDFDB_STORE", str(tmp_path))
    monkeypatch.setenv("BRDFDB_MAX_POINTS", "7")
    monkeypatch.setenv("BRDFDB_MAX_BODY_BYTES", "99")
    assert create_app().state.settings == Settings(store=tmp_path, max_points=7, max_body_bytes=99)


@pytest.mark.parametrize("variable", ["BRDFDB_MAX_POINTS", "BRDFDB_MAX_BODY_BYTES"])
@pytest.mark.parametrize("value", ["0", "-1", "1e4", "", "many", "²"])
def test_a_bad_setting_is_named(variable: str, value: str) -> None:
    with pytest.raises(ValueError, match=f"^{variable}: '.*' is not a positive whole number$"):
        Settings.from_environment({variable: value})


def test_openapi_document_is_the_reviewed_one() -> None:
    assert json.loads(openapi_json()) == json.loads(OPENAPI.read_text()), (
        "the HTTP interface changed; review it, then: python -m brdfdb_api.app > api/openapi.json"
    )


def test_openapi_is_served(client: Any) -> None:
    document = client.get("/openapi.json").json()
    assert document == json.loads(OPENAPI.read_text())
    assert client.get("/openapi.json").json() == document
    assert "/openapi.json" in client.get("/docs").text


@pytest.mark.parametrize(
    ("method", "address", "path", "status"),
    [
        ("GET", "/healthz", "/healthz", 200),
        ("GET", "/v1/materials", "/v1/materials", 200),
        ("GET", "/v1/materials/blue-foil", "/v1/materials/{name}", 200),
        ("GET", "/v1/materials/grey-felt", "/v1/materials/{name}", 200),
        ("GET", "/v1/materials/grey-fell", "/v1/materials/{name}", 404),
        ("GET", f"{LOOKUP}?theta_i=1&theta_r=2", "/v1/materials/{name}/lookup", 200),
        ("GET", f"{LOOKUP}?theta_i=1&theta_r=2&format=npy", "/v1/materials/{name}/lookup", 200),
        ("GET", f"{LOOKUP}?theta_i=1&theta_r=200", "/v1/materials/{name}/lookup", 422),
        ("POST", LOOKUP, "/v1/materials/{name}/lookup", 200),
        ("POST", f"{LOOKUP}?thetai=1", "/v1/materials/{name}/lookup", 422),
    ],
)
def test_answers_are_as_documented(client: Any, method: str, address: str, path: str, status: int) -> None:
    document = json.loads(OPENAPI.read_text())
    operation = document["paths"][path][method.lower()]
    content = {}
    if method == "POST":
        documented = operation["requestBody"]["content"]["application/json"]
        jsonschema.validate(documented["example"], documented["schema"])
        content = {"json": documented["example"]}
    answer = client.request(method, address, **content)
    assert answer.status_code == status
    media = operation["responses"][str(status)]["content"][answer.headers["content-type"]]
    if "json" in answer.headers["content-type"]:
        jsonschema.validate(answer.json(), {**media["schema"], "components": document["components"]})


def test_serve_needs_a_store(tmp_path: Path) -> None:
    with pytest.raises(StoreError):
        serve(tmp_path, "127.0.0.1", 0)


def test_serve_on_a_port_that_is_taken(store: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("brdfdb.open", lambda _: store)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(OSError, match=f"^cannot listen on 127.0.0.1, port {port}: Address already in use$"):
            serve(tmp_path, "127.0.0.1", port)


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_serve(store: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, host: str) -> None:
    def run(server: Any, sockets: list[socket.socket]) -> None:
        (listener,) = sockets
        assert listener.getsockname()[0] == "127.0.0.1"
        # an accepted socket inherits this; asyncio turns the 40 ms delay of small answers off only where it is named
        assert listener.proto == socket.IPPROTO_TCP
        assert server.config.app.state.store is store
        assert server.config.app.state.settings.store == tmp_path
        raise KeyboardInterrupt

    monkeypatch.setattr("brdfdb.open", lambda _: store)
    monkeypatch.setattr("uvicorn.Server.run", run)
    serve(tmp_path, host, 0)


def test_serve_on_no_port(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"^port: 65536 is outside \[0, 65535\]$"):
        serve(tmp_path, "127.0.0.1", 65536)


def test_package_is_typed() -> None:
    assert (Path(brdfdb_api.__file__).parent / "py.typed").exists()
