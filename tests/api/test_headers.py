"""Headers: what is compressed, accepted and kept, methods, ranges, and that refusals are problems."""

from __future__ import annotations

import errno
import gzip
import json
from pathlib import Path
from typing import Any

import pytest

from brdfdb import __version__
from brdfdb.models import MODELS
from brdfdb.store.reader import Store
from brdfdb_api.http import files, responses, views
from brdfdb_api.http.responses import preferred
from tests.api.a_store import NPY, PROBLEM, Client, client_of, pinned_of

FOIL = "/v1/materials/copper-foil"
POINT = "lookup?theta_i=10&theta_r=20"
CHUNK = "/v1/store/materials/copper-foil/r000001/brdf/c/0/0/0/0"
BODY = {"theta_i": 1, "theta_r": [2] * 500}
JSON = "application/json"
VIEWS = ("", f"/{POINT}", "/albedo", "/lobe", "/sphere?size=16", "/export/csv?resolution=45", "/download.zarr")
FOREVER = "public, max-age=31536000, immutable"


# compression


def test_documents_are_compressed_for_who_takes_that(client: Client) -> None:
    for address in [FOIL, f"{FOIL}/lobe", f"{FOIL}/albedo", "/v1/models", "/v1/materials", "/openapi.json"]:
        codings = ("gzip", "identity", "gzip;q=0, br")
        answers = [client.get(address, headers={"Accept-Encoding": coding}) for coding in codings]
        assert [answer.headers.get("content-encoding") for answer in answers] == ["gzip", None, None]
        assert answers[0].content == answers[1].content == answers[2].content
        assert all("Accept-Encoding" in answer.headers["vary"] for answer in answers)


def test_numbers_and_files_are_not_compressed(client: Client) -> None:
    bodies: dict[str, dict[str, Any]] = {
        f"{FOIL}/lookup": {},
        "/v1/models/lambert/lookup": {"parameters": {"rho": 0.5}},
        "/v1/lookup": {"materials": ["copper-foil"]},
    }
    asked = {"Accept-Encoding": "gzip"}
    answers = [client.post(address, json=BODY | more, headers=asked) for address, more in bodies.items()]
    views = ("lobe?format=npy", "sphere?size=32", "export/csv?resolution=45", "export/exr", "download.zarr")
    answers += [client.get(address, headers=asked) for address in (*(f"{FOIL}/{view}" for view in views), CHUNK)]
    for answer in answers:
        assert answer.status_code == 200, answer.url
        assert len(answer.content) > 1024, answer.url
        assert "content-encoding" not in answer.headers, answer.url


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
    for accepted, kind in [
        ([f"{NPY};q=0"], JSON),
        ([f"{NPY};q=0.5, {JSON}"], JSON),
        ([f"{NPY}, {JSON};q=0.5"], NPY),
        ([f"{JSON};q=0.1", NPY], NPY),  # the header may come in several lines
    ]:
        headers = [("Accept", line) for line in accepted]
        answers = [client.get(address, headers=headers) for address in (f"{FOIL}/{POINT}", f"{FOIL}/lobe")]
        answers.append(client.post(f"{FOIL}/lookup", json=BODY, headers=headers))
        assert [answer.headers["content-type"] for answer in answers] == [kind] * 3, accepted


# tags and how long answers hold


def test_an_answer_of_another_program_is_not_held(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    addresses = [f"{FOIL}{rest}" for rest in VIEWS]
    tags = {address: client.get(address).headers["etag"] for address in addresses}
    assert all(__version__ in tag for tag in tags.values())
    for status in (304, 200):
        for address, tag in tags.items():
            assert client.get(address, headers={"If-None-Match": tag}).status_code == status, address
        for module in (responses, files, views):
            monkeypatch.setattr(module, "__version__", "99.0")


def test_the_tag_of_a_model_names_its_version(client: Client) -> None:
    version = MODELS["he_torrance"].version
    for address in (f"{FOIL}/{POINT}&from=model", f"{FOIL}/lobe?from=model"):
        assert client.get(address).headers["etag"].endswith(f'-{__version__}-{version}"')


def test_what_is_computed_of_a_revision_is_not_kept_for_good(client: Client, store: Store) -> None:
    lookups = (f"{POINT}&from=model", f"{POINT}&output=xyz")
    for rest in (*lookups, "lobe", "albedo", "sphere?size=16", "thumbnail.png?size=16", "export/csv?resolution=45"):
        for revision in ("r000001", pinned_of(store, "copper-foil")):
            assert client.get(f"{FOIL}/revisions/{revision}/{rest}").headers["cache-control"] == "no-cache"


def test_what_a_revision_stores_is_kept_for_good_under_its_digest(client: Client, store: Store) -> None:
    pinned = pinned_of(store, "copper-foil")
    for address in (
        f"{FOIL}/revisions/r000001/{POINT}",
        f"{FOIL}/revisions/r000001/download.zarr",
        "/v1/store/materials/copper-foil/r000001.MANIFEST.json",
        "/v1/store/materials/copper-foil/r000001/zarr.json",
        CHUNK,
    ):
        short, long = (client.get(address.replace("r000001", name)) for name in ("r000001", pinned))
        assert (short.headers["cache-control"], long.headers["cache-control"]) == ("no-cache", FOREVER), address
        assert (short.content, short.headers["etag"]) == (long.content, long.headers["etag"]), address
        again = client.get(address, headers={"If-None-Match": short.headers["etag"]})
        assert (again.status_code, again.content) == (304, b""), address


# ranges


def test_ranges_of_bytes(client: Client) -> None:
    content = client.get(CHUNK).content
    size = len(content)
    for asked, part in (("2-5", content[2:6]), (f"{size - 3}-", content[-3:]), ("-4", content[-4:])):
        answer = client.get(CHUNK, headers={"Range": f"bytes={asked}"})
        assert (answer.status_code, answer.content) == (206, part), asked
    for ignored in ["lines=1-2", "bytes", "bytes=", "bytes=b-c", "bytes=5-4x", "items=0-1", "bytes=0-1,4-5"]:
        answer = client.get(CHUNK, headers={"Range": ignored})
        assert (answer.status_code, answer.content) == (200, content), ignored
    for beyond in ["bytes=99999999-", "bytes=99999999-100000000", "bytes=-0"]:
        answer = client.get(CHUNK, headers={"Range": beyond})
        assert (answer.status_code, answer.headers["content-type"]) == (416, PROBLEM), beyond
        assert answer.headers["content-range"] == f"bytes */{size}", beyond


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
        assert answer.json()["detail"].endswith(allowed)
    assert "/v1/material/grey-felt" in client.problem("GET", "/v1/material/grey-felt", 404)["detail"]


def test_a_compressed_body_is_refused(client: Client) -> None:
    for address in [f"{FOIL}/lookup", "/v1/lookup", "/v1/models/lambert/lookup"]:
        content = gzip.compress(json.dumps(BODY).encode())
        answer = client.post(address, content=content, headers={"Content-Encoding": "gzip", "Content-Type": JSON})
        assert (answer.status_code, answer.headers["content-type"]) == (415, PROBLEM)
        assert answer.headers["accept-encoding"] == "identity"
        assert answer.json()["detail"].startswith("Content-Encoding: 'gzip'")


def test_each_503_has_a_time_and_no_path(own: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    missing = client_of(tmp_path / "a b" / "nothing")
    for address in ("/readyz", "/v1/materials", FOIL, f"{FOIL}/{POINT}", f"{FOIL}/albedo", "/v1/families"):
        detail = missing.problem("GET", address, 503)["detail"]
        assert "no store at nothing" in detail, address
        assert str(tmp_path) not in detail, address
        assert missing.get(address).headers["retry-after"] == "60", address
    (own / "materials" / "copper-foil" / "r000001" / "zarr.json").write_bytes(b"{}")
    assert client_of(own).get(FOIL).headers["retry-after"] == "60"

    def fail(*_: Any, **__: Any) -> Any:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr("brdfdb_api.http.pages._explorer_file", fail)
    assert "too many files" in missing.problem("GET", "/", 503)["detail"]
    assert missing.get("/").headers["retry-after"] == "1"


def test_only_true_and_false_are_booleans_at_each_address(client: Client) -> None:
    for address in [f"{FOIL}/{POINT}&error=", "/v1/materials?anisotropic=", f"{FOIL}/export/exr?half="]:
        for value in ["True", "1", "yes", "on", "t", ""]:
            problem = client.problem("GET", f"{address}{value}", 422)
            assert problem["parameter"] in ("error", "anisotropic", "half")
