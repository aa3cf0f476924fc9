"""Settings from the environment, the OpenAPI document, and the server's own errors."""

from __future__ import annotations

import json
import os
import socket
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import brdfdb_api
from brdfdb.errors import ParameterError, StoreError
from brdfdb_api.http.app import create_app, openapi_json
from brdfdb_api.server import ServerError, serve
from brdfdb_api.settings import Settings
from tests.api.a_store import Client

OPENAPI = Path(__file__).parents[2] / "api" / "openapi.json"
FOIL = "/v1/materials/copper-foil"
LOOKUP = f"{FOIL}/lookup"
STORED = "/v1/store/materials/{name}/{revision}/{file}"


def test_settings_default() -> None:
    assert (Settings().store, Settings().max_points, Settings().cors_origins) == (Path("brdf-store"), 10_000, ())


def test_settings_of_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    told = {
        "BRDFDB_STORE": str(tmp_path),
        "BRDFDB_AUDIT": "other.json",
        "BRDFDB_MAX_POINTS": "7",
        "BRDFDB_MAX_BODY_BYTES": "99",
        "BRDFDB_CACHE_BYTES": "1000",
        "BRDFDB_CORS_ORIGINS": "https://a.example, https://b.example",
        "BRDFDB_LOG_LEVEL": "warning",
        "BRDFDB_SNAPSHOT": "paper",
    }
    for variable, value in told.items():
        monkeypatch.setenv(variable, value)
    settings = create_app().state.settings
    assert (settings.store, settings.audit_files, settings.snapshot) == (tmp_path, (Path("other.json"),), "paper")
    assert (settings.max_points, settings.max_body_bytes, settings.cache_bytes) == (7, 99, 1000)
    assert settings.cors_origins == ("https://a.example", "https://b.example")
    assert settings.log_level == "warning"


def test_the_audit_lies_in_the_store_unless_it_is_named(tmp_path: Path) -> None:
    assert Settings(store=tmp_path).audit_files == (tmp_path / "audit.json", tmp_path / "audit-part.json")
    assert Settings(store=tmp_path, audit=Path("other.json")).audit_files == (Path("other.json"),)


def test_a_bad_setting_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for value in ["0", "-1", "1e4", "", "many", "²"]:
        for variable in ["BRDFDB_MAX_POINTS", "BRDFDB_MAX_BODY_BYTES", "BRDFDB_CACHE_BYTES"]:
            with monkeypatch.context() as patch:
                patch.setenv(variable, value)
                with pytest.raises(ParameterError, match=f"^{variable}: "):
                    create_app()


def test_an_unknown_level_of_the_log_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BRDFDB_LOG_LEVEL", "loud")
    with pytest.raises(ParameterError, match=r"^BRDFDB_LOG_LEVEL: 'loud' is not one of 'info', 'warning', 'error'$"):
        create_app()


@pytest.mark.parametrize("origin", ["a.example", "https://", "https://a.example/", "ftp://a.example"])
def test_an_origin_that_no_page_has_is_refused(monkeypatch: pytest.MonkeyPatch, origin: str) -> None:
    monkeypatch.setenv("BRDFDB_CORS_ORIGINS", f"https://b.example, {origin}")
    with pytest.raises(ParameterError, match=r"^BRDFDB_CORS_ORIGINS: '.*' is not \* or an origin"):
        create_app()


def test_openapi_document_is_the_reviewed_one() -> None:
    assert json.loads(openapi_json()) == json.loads(OPENAPI.read_text()), (
        "the HTTP interface changed; review it, then: python -m brdfdb_api.http.app > api/openapi.json"
    )


def test_openapi_is_served(client: Client) -> None:
    document = client.get("/openapi.json").json()
    assert document == json.loads(OPENAPI.read_text())
    assert client.get("/openapi.json").json() == document
    assert "/openapi.json" in client.get("/docs").text


def test_answers_are_as_documented(client: Client) -> None:
    document = json.loads(OPENAPI.read_text())
    for method, address, path, status in [
        ("GET", "/healthz", "/healthz", 200),
        ("GET", "/v1/materials", "/v1/materials", 200),
        ("GET", "/v1/materials/copper-foil", "/v1/materials/{name}", 200),
        ("GET", "/readyz", "/readyz", 200),
        ("GET", "/metrics", "/metrics", 200),
        ("GET", "/v1/materials?limit=0", "/v1/materials", 422),
        ("GET", "/v1/materials/grey-felt", "/v1/materials/{name}", 200),
        ("GET", f"{FOIL}/revisions/r000001", "/v1/materials/{name}/revisions/{revision}", 200),
        ("GET", f"{FOIL}/revisions/r000002", "/v1/materials/{name}/revisions/{revision}", 404),
        ("GET", f"{FOIL}/albedo", "/v1/materials/{name}/albedo", 200),
        ("GET", f"{FOIL}/lobe", "/v1/materials/{name}/lobe", 200),
        ("GET", f"{FOIL}/lobe?view=hemisphere&output=xyz", "/v1/materials/{name}/lobe", 200),
        ("GET", f"{FOIL}/lobe?format=npy", "/v1/materials/{name}/lobe", 200),
        ("GET", f"{FOIL}/export/exr", "/v1/materials/{name}/export/{file_format}", 200),
        ("GET", f"{FOIL}/audit", "/v1/materials/{name}/audit", 404),
        ("GET", f"{FOIL}/download.zarr", "/v1/materials/{name}/download.zarr", 200),
        ("GET", "/v1/store/materials/copper-foil/r000001/brdf/c/0/0/0/0", STORED, 200),
        ("GET", "/v1/store/materials/copper-foil/r000001/nothing", STORED, 404),
        ("GET", f"{LOOKUP}?theta_i=1&theta_r=2&error=true", "/v1/materials/{name}/lookup", 200),
        ("GET", f"{LOOKUP}?theta_i=1&theta_r=2&output=linear-srgb", "/v1/materials/{name}/lookup", 200),
        ("GET", f"{LOOKUP}?theta_i=1&theta_r=2&from=model", "/v1/materials/{name}/lookup", 200),
        ("GET", "/v1/materials/grey-fell", "/v1/materials/{name}", 404),
        ("GET", f"{LOOKUP}?theta_i=1&theta_r=2", "/v1/materials/{name}/lookup", 200),
        ("GET", f"{LOOKUP}?theta_i=1&theta_r=2&format=npy", "/v1/materials/{name}/lookup", 200),
        ("GET", f"{LOOKUP}?theta_i=1&theta_r=200", "/v1/materials/{name}/lookup", 422),
        ("POST", LOOKUP, "/v1/materials/{name}/lookup", 200),
        ("POST", f"{LOOKUP}?thetai=1", "/v1/materials/{name}/lookup", 422),
        ("GET", "/v1/models", "/v1/models", 200),
        ("GET", "/v1/models/ward", "/v1/models/{model}", 200),
        ("GET", "/v1/models/wrad", "/v1/models/{model}", 404),
        ("POST", "/v1/models/lambert/lookup", "/v1/models/{model}/lookup", 200),
        ("POST", "/v1/models/lambert/lobe", "/v1/models/{model}/lobe", 200),
        ("POST", "/v1/models/lambert/albedo", "/v1/models/{model}/albedo", 200),
        ("POST", "/v1/models/lambert/sphere", "/v1/models/{model}/sphere", 200),
        ("GET", "/v1/families", "/v1/families", 200),
        ("GET", "/v1/store/zarr.json", "/v1/store/zarr.json", 200),
        ("GET", f"{FOIL}/thumbnail.png", "/v1/materials/{name}/thumbnail.png", 200),
    ]:
        operation = document["paths"][path][method.lower()]
        content = {}
        if method == "POST":
            documented = operation["requestBody"]["content"]["application/json"]
            jsonschema.validate(documented["example"], {**documented["schema"], "components": document["components"]})
            content = {"json": documented["example"]}
        answer = client.request(method, address, **content)
        assert answer.status_code == status
        media = operation["responses"][str(status)]["content"][answer.headers["content-type"].partition(";")[0]]
        if "json" in answer.headers["content-type"]:
            jsonschema.validate(answer.json(), {**media["schema"], "components": document["components"]})


def test_serve_needs_a_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BRDFDB_STORE", "put back afterwards")
    with pytest.raises(StoreError):
        serve(tmp_path, "127.0.0.1", 0)


def test_serve_on_a_port_that_is_taken(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BRDFDB_STORE", "put back afterwards")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ServerError, match=f"^cannot listen on 127.0.0.1, port {port}: Address already in use$"):
            serve(root, "127.0.0.1", port)


@pytest.mark.parametrize(("host", "lines"), [("127.0.0.1", 1), ("localhost", 1), ("0.0.0.0", 2)])
def test_serve(
    root: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], host: str, lines: int
) -> None:
    ports = []

    def run(server: Any, sockets: list[socket.socket]) -> None:
        (listener,) = sockets
        assert listener.getsockname()[0] in ("127.0.0.1", host)
        # an accepted socket inherits this; asyncio turns the 40 ms delay of small answers off only where it is named
        assert listener.proto == socket.IPPROTO_TCP
        server.config.load()
        assert os.environ["BRDFDB_STORE"] == str(root)
        ports.append(listener.getsockname()[1])
        raise KeyboardInterrupt

    monkeypatch.setenv("BRDFDB_STORE", "put back afterwards")
    monkeypatch.setattr("uvicorn.Server.run", run)
    serve(root, host, 0)
    said = capsys.readouterr().out.splitlines()
    assert said[0] == f"serving {root} at http://{host}:{ports[0]}/"
    assert len(said) == lines
    assert all("nginx or Caddy" in line for line in said[1:])


def test_serve_on_no_port(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"^port: 65536 is outside \[0, 65535\]$"):
        serve(tmp_path, "127.0.0.1", 65536)


def test_package_is_typed() -> None:
    assert (Path(brdfdb_api.__file__).parent / "py.typed").exists()
