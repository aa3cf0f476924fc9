"""Settings from the environment, the OpenAPI document, and the server's own errors."""

from __future__ import annotations

import json
import os
import re
import socket
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from brdfdb.errors import ParameterError, StoreError
from brdfdb_api.http.app import create_app, openapi_json
from brdfdb_api.server import ServerError, serve
from brdfdb_api.settings import Settings
from tests.api.a_store import Client

OPENAPI = Path(__file__).parents[2] / "api" / "openapi.json"
FOIL = "/v1/materials/copper-foil"
FELT = "/v1/materials/grey-felt"
POINT = f"{FOIL}/lookup?theta_i=1&theta_r=2"


def test_settings_of_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    default = Settings()
    assert (default.store, default.max_points, default.max_body_bytes) == (Path("brdf-store"), 10_000, 67_108_864)
    assert default.cors_origins == ()
    reports = (tmp_path / "audit.json", tmp_path / "audit-part.json")
    assert Settings(store=tmp_path).audit_files == reports
    for variable, value in {
        "BRDFDB_STORE": str(tmp_path),
        "BRDFDB_AUDIT": "other.json",
        "BRDFDB_MAX_POINTS": "7",
        "BRDFDB_MAX_BODY_BYTES": "99",
        "BRDFDB_CACHE_BYTES": "1000",
        "BRDFDB_CORS_ORIGINS": "https://a.example, https://b.example",
        "BRDFDB_LOG_LEVEL": "warning",
        "BRDFDB_SNAPSHOT": "paper",
    }.items():
        monkeypatch.setenv(variable, value)
    settings = create_app().state.settings
    assert (settings.store, settings.audit_files, settings.snapshot) == (tmp_path, (Path("other.json"),), "paper")
    assert (settings.max_points, settings.max_body_bytes, settings.cache_bytes) == (7, 99, 1000)
    assert settings.cors_origins == ("https://a.example", "https://b.example")
    assert settings.log_level == "warning"


def test_a_bad_setting_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    numbers = ("0", "-1", "1e4", "", "many", "²")
    origins = ("a.example", "https://", "https://a.example/", "ftp://a.example")
    for variable, values in {
        "BRDFDB_MAX_POINTS": numbers,
        "BRDFDB_MAX_BODY_BYTES": numbers,
        "BRDFDB_CACHE_BYTES": numbers,
        "BRDFDB_LOG_LEVEL": ("loud",),
        "BRDFDB_CORS_ORIGINS": tuple(f"https://b.example, {origin}" for origin in origins),
    }.items():
        for value in values:
            with monkeypatch.context() as patch:
                patch.setenv(variable, value)
                with pytest.raises(ParameterError, match=f"^{variable}: "):
                    create_app()


def test_openapi_document_is_the_reviewed_one_and_has_a_page_without_scripts(client: Client) -> None:
    document = json.loads(OPENAPI.read_text())
    changed = "the HTTP interface changed; review it, then: python -m brdfdb_api.http.app > api/openapi.json"
    assert json.loads(openapi_json()) == document, changed
    assert client.get("/openapi.json").json() == client.get("/openapi.json").json() == document
    page = client.get("/docs").text
    for path, methods in document["paths"].items():
        for method in methods:
            assert f"<h2>{method.upper()} {path}</h2>" in page
    assert "<code>family</code> (path): name of a family</li>" in page
    assert ": </li>" not in page  # each parameter is explained
    assert "<script" not in page
    assert "//" not in page.replace("<!doctype", "")  # nothing comes from other servers


def test_answers_are_as_documented(client: Client) -> None:
    document = json.loads(OPENAPI.read_text())
    paths = sorted(document["paths"], key=lambda path: path.count("{"))
    names = {path: re.compile(re.sub(r"{file}", ".+", re.sub(r"{(?!file})\w+}", "[^/]+", path))) for path in paths}
    for method, address, status in [
        *(("GET", address, 200) for address in ("/healthz", "/readyz", "/metrics", "/v1/models", "/v1/models/ward")),
        *(("GET", address, 200) for address in ("/v1/families", "/v1/store/zarr.json", "/v1/materials", FELT, FOIL)),
        *(("GET", f"{FOIL}/{view}", 200) for view in ("revisions/r000001", "albedo", "export/exr", "download.zarr")),
        *(("GET", f"{FOIL}/lobe{query}", 200) for query in ("", "?view=hemisphere&output=xyz", "?format=npy")),
        ("GET", f"{FOIL}/thumbnail.png", 200),
        ("GET", f"{FOIL}/audit", 404),
        ("GET", f"{FOIL}/revisions/r000002", 404),
        ("GET", "/v1/materials/grey-fell", 404),
        ("GET", "/v1/models/wrad", 404),
        ("GET", "/v1/materials?limit=0", 422),
        ("GET", "/v1/store/materials/copper-foil/r000001/brdf/c/0/0/0/0", 200),
        ("GET", "/v1/store/materials/copper-foil/r000001/nothing", 404),
        *(("GET", f"{POINT}{more}", 200) for more in ("", "&error=true", "&output=linear-srgb", "&from=model")),
        ("GET", f"{POINT}&format=npy", 200),
        ("GET", f"{FOIL}/lookup?theta_i=1&theta_r=200", 422),
        ("POST", f"{FOIL}/lookup", 200),
        ("POST", f"{FOIL}/lookup?thetai=1", 422),
        *(("POST", f"/v1/models/lambert/{view}", 200) for view in ("lookup", "lobe", "albedo", "sphere")),
    ]:
        path = next(path for path in paths if names[path].fullmatch(address.partition("?")[0]))
        operation = document["paths"][path][method.lower()]
        content = {}
        if method == "POST":
            documented = operation["requestBody"]["content"]["application/json"]
            jsonschema.validate(documented["example"], {**documented["schema"], "components": document["components"]})
            content = {"json": documented["example"]}
        answer = client.request(method, address, **content)
        assert answer.status_code == status, address
        media = operation["responses"][str(status)]["content"][answer.headers["content-type"].partition(";")[0]]
        if "json" in answer.headers["content-type"]:
            jsonschema.validate(answer.json(), {**media["schema"], "components": document["components"]})


def test_serve_needs_a_store_and_a_free_port(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BRDFDB_STORE", "put back afterwards")
    with pytest.raises(StoreError):
        serve(tmp_path, "127.0.0.1", 0)
    with pytest.raises(ParameterError, match=r"^port: 65536 is outside \[0, 65535\]$"):
        serve(root, "127.0.0.1", 65536)
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
