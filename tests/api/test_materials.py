"""The catalogue, one material, health, and the answers that a client already holds."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from brdfdb import __version__
from brdfdb.store.publication import publish_dataset
from brdfdb.store.reader import Store
from brdfdb.store.shelf import Shelf
from brdfdb_api.http.app import create_app
from brdfdb_api.settings import Settings
from tests.api.a_store import VISIBLE_NM, Client, client_of, pinned_of, publish

FOIL = "/v1/materials/copper-foil"
FOIL_POINT = f"{FOIL}/lookup?theta_i=10&theta_r=20"
TILE = "/v1/materials/white-tile"
TILE_POINT = f"{TILE}/lookup?theta_i=10&theta_r=20"


def test_catalogue(client: Client, store: Store) -> None:
    page = client.get("/v1/materials").json()
    assert (page["total"], page["next"]) == (4, None)
    materials = {material["name"]: material for material in page["materials"]}
    assert list(materials) == ["brushed-metal", "copper-foil", "grey-felt", "white-tile"]
    head = store.summary("copper-foil")
    assert materials["copper-foil"] == {
        "name": "copper-foil",
        "title": "Test copper-foil",
        "model": "he_torrance",
        "model_title": store.metadata("copper-foil").model_title,
        "paper": "he1991",
        "source": "no paper, copper-foil",
        "measured": False,
        "anisotropic": False,
        "wavelength_range_nm": [400.0, 700.0],
        "spectrum": "spectral",
        "incomplete": None,
        "error_p99": head["error_p99"],
        "formula_error": head["formula_error"],
        "largest_albedo": head["largest_albedo"],
        "verdict": None,
        "as_published": None,
        "conserves_energy": None,
        "revision": "r000001",
        "created": head["created"],
        "bytes": head["bytes"],
        "href": FOIL,
        "thumbnail": f"{FOIL}/thumbnail.png",
    }
    assert materials["grey-felt"]["wavelength_range_nm"] is None
    assert {name: line["spectrum"] for name, line in materials.items()} == {
        "brushed-metal": "grey",
        "copper-foil": "spectral",
        "grey-felt": "grey",
        "white-tile": "grey",
    }
    assert materials["brushed-metal"]["anisotropic"] is True
    assert client.get(materials["grey-felt"]["href"]).status_code == 200


def test_a_table_of_another_program_is_served_with_a_sentence_on_what_it_lacks(own: Path) -> None:
    publish_dataset(own, "bare-tile", xr.open_zarr(Store(own).path("white-tile"))[["brdf"]].drop_attrs(deep=False))
    client = client_of(own)
    lines = {line["name"]: line for line in client.get("/v1/materials?q=tile").json()["materials"]}
    assert list(lines) == ["bare-tile", "white-tile"]
    sentence = lines["bare-tile"]["incomplete"]
    assert sentence.startswith("does not state its title, material, table version, model")
    document = client.get("/v1/materials/bare-tile").json()
    assert (document["title"], document["parameters"], document["incomplete"]) == ("", [], sentence)
    brdf = client.get("/v1/materials/bare-tile/lookup?theta_i=20&theta_r=70").json()["brdf"]
    assert brdf == client.get("/v1/materials/white-tile/lookup?theta_i=20&theta_r=70").json()["brdf"]


def test_filters_of_the_catalogue(client: Client) -> None:
    for query, names in [
        ("model=ward", ["brushed-metal"]),
        ("model=hapke", []),
        ("paper=he1991", ["copper-foil"]),
        ("paper=NO+PAPER,+GREY", ["grey-felt"]),
        ("q=felt+test", ["grey-felt"]),
        ("q=FELT+copper", []),
        ("q=torrance", ["copper-foil"]),
        ("anisotropic=true", ["brushed-metal"]),
        ("anisotropic=false&q=tile", ["white-tile"]),
        ("wavelength_nm=399", ["brushed-metal", "grey-felt", "white-tile"]),
        ("wavelength_nm=400&wavelength_nm=700&model=he_torrance", ["copper-foil"]),
        ("verdict=not+audited&model=lambert", ["white-tile"]),
        ("verdict=passes", []),
    ]:
        page = client.get(f"/v1/materials?{query}").json()
        assert [line["name"] for line in page["materials"]] == names
        assert (page["total"], page["next"]) == (len(names), None)


def test_the_catalogue_is_sorted_and_what_is_unknown_comes_last(own: Path) -> None:
    publish(own, "half-tile", "lambert", rho=0.5, error=True)
    client = client_of(own)
    (own / "materials" / "grey-felt" / "r000001" / "zarr.json").write_bytes(b"{}")
    for sort in ["error_p99", "-error_p99", "created", "-created", "bytes", "-bytes"]:
        lines = client.get(f"/v1/materials?sort={sort}").json()["materials"]
        assert len(lines) == 5
        values = [line.get(sort.removeprefix("-")) for line in lines]
        known = [value for value in values if value is not None]
        assert values == sorted(known, reverse=sort.startswith("-")) + [None] * (5 - len(known))
        names, address = [], f"/v1/materials?limit=2&sort={sort}"
        while address is not None:
            page = client.get(address).json()
            names += [line["name"] for line in page["materials"]]
            address = page["next"]
        assert names == [line["name"] for line in lines]


def test_a_page_begins_after_the_one_before_also_where_that_is_gone(own: Path) -> None:
    client = client_of(own)
    following = client.get("/v1/materials?limit=2&sort=bytes").json()["next"]
    whole = [line["name"] for line in client.get("/v1/materials?sort=bytes").json()["materials"]]
    shutil.rmtree(own / "materials" / whole[1])
    assert [line["name"] for line in client.get(following).json()["materials"]] == whole[2:]


def test_pages_of_the_catalogue(client: Client) -> None:
    for query in ["", "&q=no+paper", "&model=ward", "&sort=-bytes", "&anisotropic=false"]:
        whole = client.get(f"/v1/materials?{query[1:]}").json()
        names, address = [], f"/v1/materials?limit=1{query}"
        while address is not None:
            page = client.get(address).json()
            assert (len(page["materials"]), page["total"]) == (1, whole["total"])
            names += [line["name"] for line in page["materials"]]
            address = page["next"]
        assert names == [line["name"] for line in whole["materials"]]


def test_a_bad_page_names_the_parameter(client: Client) -> None:
    for query in [
        "limit=0",
        "limit=1001",
        "limit=many",
        "limits=3",
        "model=a&model=b",
        "sort=colour",
        "cursor=a",
        "anisotropic=1",
        "verdict=bad",
    ]:
        problem = client.problem("GET", f"/v1/materials?{query}", 422)
        assert problem["parameter"] == query.partition("=")[0]


def test_catalogue_follows_the_store(own: Path) -> None:
    client = client_of(own)
    assert client.get("/v1/materials").json()["total"] == 4
    publish(own, "grey-felt", "oren_nayar", rho=0.25, sigma_deg=20.0)
    shutil.rmtree(own / "materials" / "copper-foil")
    lines = client.get("/v1/materials").json()["materials"]
    assert [(line["name"], line["revision"]) for line in lines] == [
        ("brushed-metal", "r000001"),
        ("grey-felt", "r000002"),
        ("white-tile", "r000001"),
    ]


def test_material(client: Client, store: Store) -> None:
    material = client.get(FOIL).json()
    table = store["copper-foil"]
    assert material["axes_deg"] == {name: nodes.tolist() for name, nodes in table.axes_deg.items()}
    assert material["wavelength_nm"] == VISIBLE_NM.tolist()
    assert material["anisotropic"] is False
    assert material["specular"] is True
    assert material["error"] == table.attrs["error"]
    assert material["audit"] is None
    assert material["revisions"] == ["r000001"]
    assert material["attributes"]["source"] == "no paper, copper-foil"
    (sigma,) = (each for each in material["parameters"] if each["name"] == "sigma_0_um")
    assert (sigma["value"], sigma["source"], sigma["assumed"]) == (0.1, "no paper, copper-foil", False)
    links = material["links"]
    assert client.get(links["self"]).json() == material
    pinned = pinned_of(store, "copper-foil")
    assert material["digest"] == store["copper-foil"].digest
    assert client.get(links["revision"]).json()["links"]["lookup"] == f"{FOIL}/revisions/{pinned}/lookup"
    for name in ("materials", "albedo", "lobe", "export/exr", "download.zarr"):
        assert client.get(links[name]).status_code == 200
    assert client.get(links["lookup"], params={"theta_i": 1, "theta_r": 2}).status_code == 200
    assert client.get(f"{links['store']}/zarr.json").status_code == 200


def test_grey_material(client: Client) -> None:
    material = client.get("/v1/materials/grey-felt").json()
    assert material["wavelength_nm"] is None
    assert material["specular"] is False


def test_a_material_with_a_colour(own: Path) -> None:
    given = {"wavelengths_nm": [400.0, 500.0, 700.0], "values": [0.2, 0.6, 0.4]}
    publish(own, "green-tile", "lambert", error=True, rho=given)
    client, green = client_of(own), "/v1/materials/green-tile"
    (parameter,) = client.get(green).json()["parameters"]
    assert {key: parameter["value"][key] for key in given} == given
    for source in ("table", "model"):
        query = f"/lookup?theta_i=20&theta_r=70&wavelength_nm=440&wavelength_nm=600&from={source}"
        assert client.get(green + query).json()["brdf"] == pytest.approx([0.36 / np.pi, 0.5 / np.pi], rel=1e-6)
    for rest in ("/albedo", "/lobe?theta_i=30", "/export/exr", "/lookup?theta_i=1&theta_r=2&output=linear-srgb"):
        assert client.get(green + rest).status_code == 200, rest


@pytest.mark.parametrize("address", ["", "/lookup?theta_i=1&theta_r=2"])
def test_unknown_material_names_the_closest(client: Client, address: str) -> None:
    problem = client.problem("GET", f"/v1/materials/copper-foul{address}", 404)
    assert problem["closest"][0] == "copper-foil"
    assert "copper-foul" in problem["detail"]


def test_a_name_is_not_a_path(client: Client) -> None:
    for name in ["..", "%2e%2e", "..%2F..%2Fetc%2Fpasswd", "%00", "copper-foil%2F..", "COPPER-FOIL"]:
        status = 405 if name == ".." else 404  # the client asks for /v1/lookup, which takes POST
        assert client.request("GET", f"/v1/materials/{name}/lookup?theta_i=1&theta_r=2").status_code == status


@pytest.mark.parametrize("address", [FOIL, FOIL_POINT])
def test_etag_follows_the_revision(own: Path, address: str) -> None:
    client = client_of(own)
    first = client.get(address)
    assert first.headers["etag"].startswith('W/"copper-foil-r000001-')  # weak: JSON may be compressed
    assert first.headers["cache-control"] == "no-cache"
    for held in (first.headers["etag"], f'"other", {first.headers["etag"]}', first.headers["etag"][2:], "*"):
        again = client.get(address, headers={"If-None-Match": held})
        assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", first.headers["etag"])
    publish(own, "copper-foil", "lambert", rho=0.5)
    answer = client.get(address, headers={"If-None-Match": first.headers["etag"]})
    assert answer.status_code == 200
    assert answer.headers["etag"].startswith('W/"copper-foil-r000002-')


def test_etag_of_the_catalogue_follows_what_it_shows(own: Path) -> None:
    client = client_of(own)
    first = client.get("/v1/materials")
    assert (first.status_code, first.headers["cache-control"]) == (200, "no-cache")
    held = {"If-None-Match": first.headers["etag"]}
    again = client.get("/v1/materials", headers=held)
    assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", first.headers["etag"])
    assert client.get("/v1/materials?q=foil", headers=held).status_code == 200
    assert client.get("/v1/materials?limit=3", headers=held).status_code == 200
    publish(own, "copper-foil", "lambert", rho=0.5)
    assert client.get("/v1/materials", headers=held).status_code == 200


def test_etag_of_npy_is_another(client: Client) -> None:
    tag = client.get(FOIL_POINT).headers["etag"]
    answer = client.get(FOIL_POINT, headers={"If-None-Match": tag, "Accept": "application/x-npy"})
    assert answer.status_code == 200
    assert re.fullmatch(rf'"copper-foil-r000001-[0-9a-f]{{16}}-{re.escape(__version__)}-npy"', answer.headers["etag"])
    assert answer.headers["vary"] == "Accept"


@pytest.mark.parametrize("address", [TILE, TILE_POINT, f"{TILE}/albedo", f"{TILE}/download.zarr"])
def test_a_store_built_anew_gives_the_same_revision_another_etag(own: Path, address: str) -> None:
    client = client_of(own)
    first = client.get(address)
    shutil.rmtree(own / "materials" / "white-tile")
    assert publish(own, "white-tile", "lambert", rho=0.25) == "r000001"
    answer = client.get(address, headers={"If-None-Match": first.headers["etag"]})
    assert answer.status_code == 200
    assert answer.content != first.content


def test_revisions_of_a_store_built_anew_are_read_anew(own: Path) -> None:
    client = client_of(own)
    publish(own, "white-tile", "lambert", rho=0.5)
    address = f"{TILE}/revisions/r000001/lookup?theta_i=10&theta_r=20"
    assert client.get(address).json()["brdf"] == pytest.approx(1.0 / np.pi, rel=1e-6)
    shutil.rmtree(own / "materials" / "white-tile")
    for rho in (0.25, 0.125):
        publish(own, "white-tile", "lambert", rho=rho)
    assert client.get(address).json()["brdf"] == pytest.approx(0.25 / np.pi, rel=1e-6)


def test_what_is_said_of_a_revision_changes_with_what_stands_beside_it(own: Path) -> None:
    client, address = client_of(own), f"{TILE}/revisions/r000001"
    first = client.get(address)
    publish(own, "white-tile", "lambert", rho=0.04)
    answer = client.get(address, headers={"If-None-Match": first.headers["etag"]})
    assert answer.status_code == 200
    assert answer.json()["revisions"] == ["r000001", "r000002"]


def test_an_older_revision_is_served_while_the_current_one_is_damaged(own: Path) -> None:
    publish(own, "white-tile", "lambert", rho=0.5)
    (own / "materials" / "white-tile" / "r000002" / "zarr.json").write_text("{}")
    client = client_of(own)
    assert client.get(f"{TILE}/revisions/r000001").status_code == 200
    assert "white-tile r000002 is damaged" in client.problem("GET", TILE, 503)["detail"]


def test_numbers_say_which_revision_they_are_of(own: Path) -> None:
    publish(own, "white-tile", "lambert", rho=0.5)
    client = client_of(own)
    posted = client.post(f"{TILE}/lookup", json={"theta_i": 1, "theta_r": 2}, headers={"Accept": "application/x-npy"})
    assert posted.headers["brdfdb-revision"] == client.get(TILE_POINT).headers["brdfdb-revision"] == "r000002"
    assert posted.headers["brdfdb-digest"] == Store(own)["white-tile"].digest
    assert posted.headers["cache-control"] == "no-store"
    assert "etag" not in posted.headers


def test_a_report_with_an_entry_that_is_none_does_not_keep_the_others_from_being_read(own: Path) -> None:
    (own / "audit.json").write_text('{"when": "2026", "materials": [{"material": "white-tile", "verdict": "passes"}]}')
    client = client_of(own)
    assert client.get(TILE).json()["audit"] is None
    assert client.get("/v1/materials").status_code == 200


def test_etag_does_not_hide_an_error(client: Client) -> None:
    client.problem("GET", f"{FOIL_POINT}&thetai=3", 422, headers={"If-None-Match": "*"})
    client.problem("GET", "/v1/materials/copper-foul", 404, headers={"If-None-Match": "*"})


def test_an_answer_of_a_revision_is_kept_for_good(own: Path) -> None:
    client = client_of(own)
    address = f"{TILE}/revisions/{pinned_of(Store(own), 'white-tile')}/lookup?theta_i=10&theta_r=20"
    first = client.get(address)
    assert first.headers["cache-control"] == "public, max-age=31536000, immutable"
    short = client.get(f"{TILE}/revisions/r000001/lookup?theta_i=10&theta_r=20")
    assert (short.headers["cache-control"], short.headers["etag"]) == ("no-cache", first.headers["etag"])
    assert short.json() == first.json()
    publish(own, "white-tile", "lambert", rho=0.25)
    assert client.get(address).json() == first.json()
    current = client.get("/v1/materials/white-tile/lookup?theta_i=10&theta_r=20").json()
    assert (current["revision"], current["brdf"]) == ("r000002", pytest.approx(first.json()["brdf"] / 4, rel=1e-7))
    assert client.get("/v1/materials/white-tile").json()["revisions"] == ["r000001", "r000002"]
    posted = client.post(address.partition("?")[0], json={"theta_i": 10, "theta_r": 20})
    assert posted.json() == first.json()


DIGITS = "0123456789abcdef"


def test_an_unknown_revision(client: Client) -> None:
    for rest in ["", "/lookup?theta_i=1&theta_r=2", "/albedo", "/lobe", "/export/exr", "/download.zarr"]:
        for revision in [
            "r000002",
            "r1",
            "latest",
            "%2e%2e",
            "..%2fr000001",
            "r000001-",
            f"r000001-{DIGITS}",
            f"r000001-{DIGITS}01",
        ]:
            problem = client.problem("GET", f"{FOIL}/revisions/{revision}{rest}", 404)
            assert problem.get("parameter", "revision") == "revision"
            if revision == "r000002":
                assert problem["detail"].startswith("copper-foil has no revision 'r000002'")


def test_health(client: Client, tmp_path: Path) -> None:
    assert client.get("/healthz").json() == {"status": "ok"}
    assert client.get("/readyz").json() == {"status": "ok", "materials": 4}
    client.app = create_app(Settings(store=tmp_path / "nothing"))
    assert client.get("/healthz").json() == {"status": "ok"}


@pytest.mark.parametrize("address", ["/readyz", "/v1/materials", FOIL, FOIL_POINT, f"{FOIL}/albedo"])
def test_a_store_that_cannot_be_read(client: Client, tmp_path: Path, address: str) -> None:
    client.app = create_app(Settings(store=tmp_path / "nothing"))
    assert "nothing" in client.problem("GET", address, 503)["detail"]


def test_a_store_that_appears_later(root: Path, tmp_path: Path) -> None:
    client = client_of(tmp_path / "later")
    client.problem("GET", "/readyz", 503)
    shutil.copytree(root, tmp_path / "later")
    assert client.get("/readyz").json()["materials"] == 4


def test_a_damaged_material_is_named_and_the_others_go_on(own: Path) -> None:
    (own / "materials" / "grey-felt" / "r000001" / "zarr.json").write_bytes(b"{}")
    client = client_of(own)
    said = client.problem("GET", "/v1/materials/grey-felt", 503)["detail"]
    assert said.startswith("grey-felt r000001 is damaged: ")
    assert client.problem("GET", "/v1/materials/grey-felt/lookup?theta_i=1&theta_r=2", 503)["detail"] == said
    lines = client.get("/v1/materials").json()["materials"]
    assert lines[2] == {"name": "grey-felt", "damaged": said, "href": "/v1/materials/grey-felt"}
    assert len(lines) == 4
    assert client.get("/readyz").json()["materials"] == 4
    assert client.get(FOIL_POINT).status_code == 200


def test_what_is_removed_while_it_is_served_may_come_back(own: Path) -> None:
    client = client_of(own)
    assert client.get(FOIL_POINT).status_code == 200
    shutil.move(own / "materials" / "copper-foil", own / "aside")
    assert client.problem("GET", FOIL_POINT, 503)["detail"] == "copper-foil is gone from the store"
    assert client.problem("GET", FOIL, 503)["detail"] == "copper-foil is gone from the store"
    shutil.move(own / "aside", own / "materials" / "copper-foil")
    assert client.get(FOIL_POINT).status_code == 200
    shutil.move(own, own.with_name("aside"))
    client.problem("GET", FOIL_POINT, 503)
    client.problem("GET", "/readyz", 503)
    shutil.move(own.with_name("aside"), own)
    assert client.get("/readyz").json()["materials"] == 4


def test_an_unexpected_error_tells_nothing(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> Any:
        raise RuntimeError("secret")

    monkeypatch.setattr(Shelf, "names", fail)
    problem = client_of(own).problem("GET", "/v1/materials", 500)
    assert "secret" not in problem["detail"]
