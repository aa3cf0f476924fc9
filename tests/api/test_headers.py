"""Headers: what is compressed, accepted and kept, methods, ranges, and that refusals are problems."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import pytest

from brdfdb import __version__
from brdfdb.models import MODELS
from brdfdb.store.reader import Store
from brdfdb_api.http import responses
from brdfdb_api.http.app import create_app
from brdfdb_api.http.responses import preferred
from brdfdb_api.settings import Settings
from tests.api.a_store import NPY, PROBLEM, Client, client_of, pinned_of, read_npy

FOIL = "/v1/materials/copper-foil"
POINT = "lookup?theta_i=10&theta_r=20"
CHUNK = "/v1/store/materials/copper-foil/r000001/brdf/c/0/0/0/0"
BODY = {"theta_i": 1, "theta_r": [2] * 500}
JSON = "application/json"
FOREVER = "public, max-age=31536000, immutable"


# compression


def test_documents_are_compressed_for_who_takes_that(client: Client) -> None:
    for address in [FOIL, f"{FOIL}/lobe", f"{FOIL}/albedo", "/v1/models", "/v1/materials", "/openapi.json"]:
        answers = [
            client.get(address, headers={"Accept-Encoding": how}) for how in ("gzip", "identity", "gzip;q=0, br")
        ]
        assert [answer.headers.get("content-encoding") for answer in answers] == ["gzip", None, None]
        assert answers[0].content == answers[1].content == answers[2].content
        assert all("Accept-Encoding" in answer.headers["vary"] for answer in answers)


def test_numbers_are_not_compressed_because_that_takes_longer_than_the_lookup(client: Client) -> None:
    for address in [f"{FOIL}/lookup", "/v1/models/lambert/lookup", "/v1/lookup"]:
        more = {"/v1/lookup": {"materials": ["copper-foil"]}, "/v1/models/lambert/lookup": {"parameters": {"rho": 0.5}}}
        answer = client.post(address, json=BODY | more.get(address, {}), headers={"Accept-Encoding": "gzip"})
        assert len(answer.content) > 1024
        assert "content-encoding" not in answer.headers


def test_files_are_not_compressed(client: Client) -> None:
    for address in [f"{FOIL}/sphere?size=32", f"{FOIL}/export/csv?resolution=45", f"{FOIL}/download.zarr", CHUNK]:
        assert "content-encoding" not in client.get(address, headers={"Accept-Encoding": "gzip"}).headers


# Accept


def test_the_best_liked_is_chosen() -> None:
    for accepted, liked in [
        ("", "a/json"),
        ("*/*", "a/json"),
        ("a/*, */*;q=0.1", "a/json"),
        ("a/npy", "a/npy"),
        ("a/npy, */*", "a/npy"),
        ("A/NPY , a/json;q=0.9", "a/npy"),
        ("a/npy;q=0.2, a/json;q=0.1", "a/npy"),
        ("a/json, a/npy", "a/json"),
        ("a/npy, a/json", "a/npy"),
        ("a/npy;q=0.5, a/json", "a/json"),
        ("a/npy;q=0.5, */*", "a/json"),
        ("a/npy;q=0", "a/json"),
        ("a/npy;q=0.0, text/html", "a/json"),
        ("a/json;q=0, */*", "a/npy"),
        ("text/html", "a/json"),
        ("a/npy;level=1; q=0.5,a/json;version=q=1;q=0.4", "a/npy"),
    ]:
        assert preferred(accepted, "a/json", "a/npy") == liked


def test_lookups_and_lobes_weigh_what_is_accepted(client: Client) -> None:
    for accepted, kind in [(f"{NPY};q=0", JSON), (f"{NPY};q=0.5, {JSON}", JSON), (f"{NPY}, {JSON};q=0.5", NPY)]:
        for address in (f"{FOIL}/{POINT}", f"{FOIL}/lobe"):
            assert client.get(address, headers={"Accept": accepted}).headers["content-type"] == kind
        posted = client.post(f"{FOIL}/lookup", json=BODY, headers={"Accept": accepted})
        assert posted.headers["content-type"] == kind


def test_a_header_may_come_in_several_lines(client: Client) -> None:
    lines = [("Accept", f"{JSON};q=0.1"), ("Accept", NPY)]
    for address in (f"{FOIL}/{POINT}", f"{FOIL}/lobe"):
        assert read_npy(client.get(address, headers=lines).content).size > 1


# tags and how long answers hold


def test_an_answer_of_another_program_is_not_held(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    addresses = [f"{FOIL}{rest}" for rest in ("", f"/{POINT}", "/albedo", "/lobe", "/sphere?size=16", "/download.zarr")]
    held = [client.get(address).headers["etag"] for address in addresses]
    assert all(__version__ in tag for tag in held)
    same = [client.get(address, headers={"If-None-Match": tag}) for address, tag in zip(addresses, held, strict=True)]
    assert {answer.status_code for answer in same} == {304}
    for module in (responses, *(__import__(f"brdfdb_api.http.{name}", fromlist=["_"]) for name in ("files", "views"))):
        monkeypatch.setattr(module, "__version__", "99.0")
    for address, tag in zip(addresses, held, strict=True):
        assert client.get(address, headers={"If-None-Match": tag}).status_code == 200, address


def test_the_tag_of_a_model_names_its_version(client: Client) -> None:
    version = MODELS["he_torrance"].version
    for address in (f"{FOIL}/{POINT}&from=model", f"{FOIL}/lobe?from=model"):
        assert client.get(address).headers["etag"].endswith(f'-{__version__}-{version}"')


def test_what_is_computed_of_a_revision_is_not_kept_for_good(client: Client, store: Store) -> None:
    for rest in [
        f"{POINT}&from=model",
        f"{POINT}&output=xyz",
        "lobe",
        "albedo",
        "sphere?size=16",
        "thumbnail.png?size=16",
        "export/csv?resolution=45",
    ]:
        for revision in ("r000001", pinned_of(store, "copper-foil")):
            assert client.get(f"{FOIL}/revisions/{revision}/{rest}").headers["cache-control"] == "no-cache"


def test_what_a_revision_stores_is_kept_for_good_under_its_digest(client: Client, store: Store) -> None:
    pinned = pinned_of(store, "copper-foil")
    for address in (f"{FOIL}/revisions/r000001/{POINT}", CHUNK, f"{FOIL}/revisions/r000001/download.zarr"):
        assert client.get(address).headers["cache-control"] == "no-cache"
        assert client.get(address.replace("r000001", pinned)).headers["cache-control"] == FOREVER


# ranges


def test_a_range_that_is_not_one_of_bytes_is_ignored(client: Client) -> None:
    for unit in ["lines=1-2", "bytes", "bytes=", "bytes=b-c", "bytes=5-4x", "items=0-1", "bytes=0-1,4-5"]:
        answer = client.get(CHUNK, headers={"Range": unit})
        assert (answer.status_code, answer.content) == (200, client.get(CHUNK).content)


def test_a_range_of_bytes(client: Client) -> None:
    whole = client.get(CHUNK).content
    for asked, part in (("2-5", whole[2:6]), (f"{len(whole) - 3}-", whole[-3:]), ("-4", whole[-4:])):
        answer = client.get(CHUNK, headers={"Range": f"bytes={asked}"})
        assert (answer.status_code, answer.content) == (206, part)


def test_a_range_after_the_end_is_a_problem(client: Client) -> None:
    for asked in ["bytes=99999999-", "bytes=99999999-100000000", "bytes=-0"]:
        answer = client.get(CHUNK, headers={"Range": asked})
        assert (answer.status_code, answer.headers["content-type"]) == (416, PROBLEM)
        assert answer.headers["content-range"] == f"bytes */{len(client.get(CHUNK).content)}"


# methods, encodings, waiting, and refusals


def test_a_refused_method_names_all_that_are_allowed(client: Client) -> None:
    for address, allowed in [
        (f"{FOIL}/lookup", "GET, HEAD, POST"),
        (FOIL, "GET, HEAD"),
        ("/v1/lookup", "POST"),
        ("/openapi.json", "GET, HEAD"),
        ("/v1/models/lambert/lobe", "POST"),
    ]:
        answer = client.request("DELETE", address)
        assert (answer.status_code, answer.headers["content-type"], answer.headers["allow"]) == (405, PROBLEM, allowed)
        assert answer.json()["detail"] == f"DELETE is not allowed at this address; allowed are {allowed}"


def test_a_compressed_body_is_refused(client: Client) -> None:
    for address in [f"{FOIL}/lookup", "/v1/lookup", "/v1/models/lambert/lookup"]:
        content = gzip.compress(json.dumps(BODY).encode())
        answer = client.post(address, content=content, headers={"Content-Encoding": "gzip", "Content-Type": JSON})
        assert (answer.status_code, answer.headers["content-type"]) == (415, PROBLEM)
        assert answer.headers["accept-encoding"] == "identity"
        assert answer.json()["detail"].startswith("Content-Encoding: 'gzip' is not read")


def test_each_503_says_when_to_ask_again(client: Client, own: Path, tmp_path: Path) -> None:
    client.app.state.shelf.warming = True
    assert client.get("/readyz").headers["retry-after"] == "1"
    missing = client_of(tmp_path / "nothing")
    for address in ("/readyz", "/v1/materials", FOIL, f"{FOIL}/{POINT}"):
        assert missing.get(address).headers["retry-after"] == "60", address
    (own / "materials" / "copper-foil" / "r000001" / "zarr.json").write_bytes(b"{}")
    assert client_of(own).get(FOIL).headers["retry-after"] == "60"


def test_a_sentence_does_not_show_where_the_store_lies(tmp_path: Path) -> None:
    missing = client_of(tmp_path / "a b" / "nothing")
    for address in ("/readyz", "/v1/materials", FOIL, f"{FOIL}/{POINT}", "/v1/families"):
        problem = missing.problem("GET", address, 503)
        assert str(tmp_path) not in problem["detail"]
        assert "no store at nothing" in problem["detail"]


@pytest.mark.parametrize(
    ("asked", "said"),
    [({"Origin": "https://evil.example"}, "origin"), ({"Access-Control-Request-Method": "DELETE"}, "method")],
)
def test_a_refused_preflight_is_a_problem(root: Path, asked: dict[str, str], said: str) -> None:
    app = create_app(Settings(store=root, cors_origins=("https://a.example",)))
    headers: dict[str, Any] = {"Origin": "https://a.example", "Access-Control-Request-Method": "GET"}
    problem = Client(app).problem("OPTIONS", FOIL, 400, headers=headers | asked)
    assert said in problem["detail"]
    assert Client(app).request("OPTIONS", FOIL, headers=headers).status_code == 200


def test_only_true_and_false_are_booleans_at_each_address(client: Client) -> None:
    for address in [f"{FOIL}/{POINT}&error=", "/v1/materials?anisotropic=", f"{FOIL}/export/exr?half="]:
        for value in ["True", "1", "yes", "on", "t", ""]:
            problem = client.problem("GET", f"{address}{value}", 422)
            assert problem["parameter"] in ("error", "anisotropic", "half")


def test_the_list_of_operations_needs_no_network_and_no_script(client: Client) -> None:
    page = client.get("/docs").text
    assert "<script" not in page
    assert "//" not in page.replace("<!doctype", "")
    operations = [
        f"{method.upper()} {path}"
        for path, methods in client.get("/openapi.json").json()["paths"].items()
        for method in methods
    ]
    assert [operation for operation in operations if f"<h2>{operation}</h2>" not in page] == []
