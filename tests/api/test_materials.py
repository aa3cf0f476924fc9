"""The catalogue, one material, health, and answers that a client already has."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from brdfdb import __version__
from brdfdb.store.publication import publish_dataset
from brdfdb.store.reader import Store
from tests.api.a_store import NPY, VISIBLE_NM, Client, client_of, pinned_of, publish

POINT = "lookup?theta_i=10&theta_r=20"
FOIL = "/v1/materials/copper-foil"
FOIL_POINT = f"{FOIL}/{POINT}"
TILE = "/v1/materials/white-tile"
TILE_POINT = f"{TILE}/{POINT}"
FELT = "/v1/materials/grey-felt"


def names_on_pages(client: Client, address: str | None) -> list[str]:
    """Names of the materials on a page of the catalogue and on all that follow."""
    names = []
    while address is not None:
        page = client.get(address).json()
        names += [line["name"] for line in page["materials"]]
        address = page["next"]
    return names


def test_catalogue(client: Client, store: Store) -> None:
    page = client.get("/v1/materials").json()
    assert (page["total"], page["next"]) == (4, None)
    materials = {material["name"]: material for material in page["materials"]}
    assert list(materials) == ["brushed-metal", "copper-foil", "grey-felt", "white-tile"]
    head = store.summary("copper-foil")
    measured = ("error_p99", "formula_error", "largest_albedo", "created", "bytes")
    assert materials["copper-foil"] == {key: head[key] for key in measured} | {
        "name": "copper-foil",
        "title": "Test copper-foil",
        "model": "he_torrance",
        "model_title": store.metadata("copper-foil").model_title,
        "paper": "he1991",
        "source": "no paper, copper-foil",
        "surface_error": None,
        "measured": False,
        "anisotropic": False,
        "wavelength_range_nm": [400.0, 700.0],
        "spectrum": "spectral",
        "incomplete": None,
        "verdict": None,
        "as_published": None,
        "verdict_in_words": None,
        "conserves_energy": None,
        "revision": "r000001",
        "href": FOIL,
        "thumbnail": f"{FOIL}/thumbnail.png",
    }
    grey = [name for name, line in materials.items() if line["spectrum"] == "grey" and not line["wavelength_range_nm"]]
    assert grey == ["brushed-metal", "grey-felt", "white-tile"]
    assert materials["brushed-metal"]["anisotropic"] is True
    assert client.get(materials["grey-felt"]["href"]).status_code == 200


def test_a_table_of_another_program_is_served_with_a_sentence_on_what_it_lacks(own: Path) -> None:
    publish_dataset(own, "bare-tile", xr.open_zarr(Store(own).path("white-tile"))[["brdf"]].drop_attrs(deep=False))
    client = client_of(own)
    bare, white = client.get("/v1/materials?q=tile").json()["materials"]
    assert (bare["name"], white["name"]) == ("bare-tile", "white-tile")
    assert bare["incomplete"].startswith("does not state its title, material, table version, model")
    document = client.get("/v1/materials/bare-tile").json()
    assert (document["title"], document["parameters"], document["incomplete"]) == ("", [], bare["incomplete"])
    brdf = client.get(f"/v1/materials/bare-tile/{POINT}").json()["brdf"]
    assert brdf == client.get(TILE_POINT).json()["brdf"]


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
        assert [line["name"] for line in page["materials"]] == names, query
        assert (page["total"], page["next"]) == (len(names), None), query
    for query in ["", "q=no+paper", "model=ward", "sort=-bytes", "anisotropic=false"]:
        every = client.get(f"/v1/materials?{query}").json()["materials"]
        assert names_on_pages(client, f"/v1/materials?limit=1&{query}") == [line["name"] for line in every], query


def test_a_bad_page_names_the_parameter(client: Client) -> None:
    for query in [
        *("limit=0", "limit=1001", "limit=many", "limits=3", "cursor=a", "sort=colour", "anisotropic=1"),
        *("model=a&model=b", "model=phong", "paper=he1992", "verdict=good"),
    ]:
        problem = client.problem("GET", f"/v1/materials?{query}", 422)
        parameter = query.partition("=")[0]
        assert problem["parameter"] == parameter
        assert problem["detail"].startswith(f"{parameter}: ")
        allowed = {"model=phong": "abg, beckmann", "verdict=good": "'passes'", "paper=he1992": "he1991"}
        assert allowed.get(query, "") in problem["detail"]


def test_the_catalogue_is_sorted_and_what_is_unknown_comes_last(own: Path) -> None:
    publish(own, "half-tile", "lambert", rho=0.5, error=True)
    client = client_of(own)
    (own / "materials" / "grey-felt" / "HEAD.json").write_bytes(b"{}")
    for sort in ["error_p99", "-error_p99", "created", "-created", "bytes", "-bytes"]:
        lines = client.get(f"/v1/materials?sort={sort}").json()["materials"]
        assert len(lines) == 5
        values = [line.get(sort.removeprefix("-")) for line in lines]
        known = [value for value in values if value is not None]
        assert values == sorted(known, reverse=sort.startswith("-")) + [None] * (5 - len(known)), sort
        names = names_on_pages(client, f"/v1/materials?limit=2&sort={sort}")
        assert names == [line["name"] for line in lines], sort


def test_the_catalogue_follows_the_store(own: Path) -> None:
    client = client_of(own)
    following = client.get("/v1/materials?limit=2&sort=bytes").json()["next"]
    names = names_on_pages(client, "/v1/materials?sort=bytes")
    assert len(names) == 4
    shutil.rmtree(own / "materials" / names[1])  # the next page begins after a material that is gone
    assert names_on_pages(client, following) == names[2:]
    group = {"If-None-Match": client.get("/v1/store/zarr.json").headers["etag"]}
    assert client.get("/v1/store/zarr.json", headers=group).status_code == 304
    held = {"If-None-Match": client.get("/v1/materials").headers["etag"]}
    again = client.get("/v1/materials", headers=held)
    assert (again.status_code, again.content, again.headers["cache-control"]) == (304, b"", "no-cache")
    for query in ("?q=foil", "?limit=2"):
        assert client.get(f"/v1/materials{query}", headers=held).status_code == 200
    publish(own, "copper-foil", "lambert", rho=0.5)
    assert client.get("/v1/store/zarr.json", headers=group).status_code == 200
    newer = client.get("/v1/materials", headers=held)
    revisions = {line["name"]: line["revision"] for line in newer.json()["materials"]}
    assert (newer.status_code, revisions["copper-foil"]) == (200, Store(own).head("copper-foil"))


def test_material(client: Client, store: Store) -> None:
    material = client.get(FOIL).json()
    table = store["copper-foil"]
    assert material["axes_deg"] == {name: nodes.tolist() for name, nodes in table.axes_deg.items()}
    assert material["wavelength_nm"] == VISIBLE_NM.tolist()
    assert (material["anisotropic"], material["specular"], material["audit"]) == (False, True, None)
    assert (material["error"], material["digest"]) == (table.attrs["error"], table.digest)
    assert material["revisions"] == ["r000001"]
    assert material["attributes"]["source"] == "no paper, copper-foil"
    (sigma,) = (each for each in material["parameters"] if each["name"] == "sigma_0_um")
    assert (sigma["value"], sigma["source"], sigma["assumed"]) == (0.1, "no paper, copper-foil", False)
    links = material["links"]
    assert client.get(links["self"]).json() == material
    pinned = pinned_of(store, "copper-foil")
    assert client.get(links["revision"]).json()["links"]["lookup"] == f"{FOIL}/revisions/{pinned}/lookup"
    for name in ("materials", "albedo", "lobe", "export/exr", "download.zarr"):
        assert client.get(links[name]).status_code == 200
    assert client.get(links["lookup"], params={"theta_i": 1, "theta_r": 2}).status_code == 200
    assert client.get(f"{links['store']}/zarr.json").status_code == 200
    grey = client.get(FELT).json()
    assert (grey["wavelength_nm"], grey["specular"]) == (None, False)


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


def test_unknown_names(client: Client) -> None:
    point = {"theta_i": 1, "theta_r": 2}
    for method, address, body, parameter, closest in [
        ("GET", "/v1/materials/copper-foul", None, "name", "copper-foil"),
        ("GET", f"/v1/materials/copper-foul/{POINT}", None, "name", "copper-foil"),
        ("POST", "/v1/materials/grey-fell/lookup", point, "name", "grey-felt"),
        ("POST", "/v1/lookup", point | {"materials": ["grey-felt", "grey-fell"]}, "name", "grey-felt"),
        ("POST", "/v1/models/wrad/lookup", point | {"parameters": {}}, "model", "ward"),
        ("POST", "/v1/families/none/lookup", point | {"parameters": {}}, "family", None),
    ]:
        problem = client.problem(method, address, 404, json=body)
        assert (problem["parameter"], [*problem["closest"], None][0]) == (parameter, closest), address
    for name in ["..", "%2e%2e", "..%2F..%2Fetc%2Fpasswd", "%00", "copper-foil%2F..", "COPPER-FOIL"]:
        status = 405 if name == ".." else 404  # the client asks for /v1/lookup, which takes POST
        assert client.get(f"/v1/materials/{name}/{POINT}").status_code == status, name


def test_an_unknown_revision(client: Client) -> None:
    digits = "0123456789abcdef"
    for rest in ["", f"/{POINT}", "/albedo", "/lobe", "/export/exr", "/download.zarr"]:
        for revision in [
            *("r000002", "r1", "latest", "%2e%2e", "..%2fr000001", "r000001-"),
            *(f"r000001-{digits}", f"r000001-{digits}01"),
        ]:
            problem = client.problem("GET", f"{FOIL}/revisions/{revision}{rest}", 404)
            assert problem.get("parameter", "revision") == "revision"
    assert client.problem("GET", f"{FOIL}/revisions/r000002", 404)["detail"].startswith("copper-foil has no revision")


# Tags


@pytest.mark.parametrize("address", [FOIL, FOIL_POINT])
def test_etag_follows_the_revision(own: Path, address: str) -> None:
    client = client_of(own)
    first = client.get(address)
    tag = first.headers["etag"]
    assert tag.startswith('W/"copper-foil-r000001-')  # weak: JSON may be compressed
    assert first.headers["cache-control"] == "no-cache"
    for held in (tag, f'"other", {tag}', tag[2:], "*"):
        again = client.get(address, headers={"If-None-Match": held})
        assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag)
    binary = client.get(FOIL_POINT, headers={"If-None-Match": tag, "Accept": NPY})
    assert (binary.status_code, binary.headers["vary"]) == (200, "Accept")
    assert re.fullmatch(rf'"copper-foil-r000001-[0-9a-f]{{16}}-{re.escape(__version__)}-npy"', binary.headers["etag"])
    publish(own, "copper-foil", "lambert", rho=0.5)
    answer = client.get(address, headers={"If-None-Match": tag})
    assert answer.status_code == 200
    assert answer.headers["etag"].startswith('W/"copper-foil-r000002-')


def test_a_store_built_anew_gives_the_same_revision_another_etag(own: Path) -> None:
    client = client_of(own)
    addresses = [TILE, TILE_POINT, f"{TILE}/albedo", f"{TILE}/download.zarr", f"{TILE}/revisions/r000001/{POINT}"]
    before = {address: client.get(address) for address in addresses}
    shutil.rmtree(own / "materials" / "white-tile")
    for rho in (0.25, 0.125):
        publish(own, "white-tile", "lambert", rho=rho)
    assert client.get(addresses[-1]).json()["brdf"] == pytest.approx(0.25 / np.pi, rel=1e-6)
    for address, first in before.items():
        answer = client.get(address, headers={"If-None-Match": first.headers["etag"]})
        assert answer.status_code == 200, address
        assert answer.content != first.content, address


def test_answers_of_a_revision_stay_while_newer_ones_are_published(own: Path) -> None:
    client = client_of(own)
    pinned = f"{TILE}/revisions/{pinned_of(Store(own), 'white-tile')}"
    first, document = client.get(f"{pinned}/{POINT}"), client.get(pinned)
    publish(own, "white-tile", "lambert", rho=0.25)
    assert client.get(f"{pinned}/{POINT}").json() == first.json()
    assert client.post(f"{pinned}/lookup", json={"theta_i": 10, "theta_r": 20}).json() == first.json()
    current = client.get(TILE_POINT)
    assert current.json()["brdf"] == pytest.approx(first.json()["brdf"] / 4, rel=1e-7)
    posted = client.post(f"{TILE}/lookup", json={"theta_i": 1, "theta_r": 2}, headers={"Accept": NPY})
    assert posted.headers["brdfdb-revision"] == current.headers["brdfdb-revision"] == "r000002"
    assert posted.headers["brdfdb-digest"] == Store(own)["white-tile"].digest
    assert (posted.headers["cache-control"], "etag" in posted.headers) == ("no-store", False)
    # The document of a revision lists the others
    newer = client.get(pinned, headers={"If-None-Match": document.headers["etag"]})
    assert (newer.status_code, newer.json()["revisions"]) == (200, ["r000001", "r000002"])
    (own / "materials" / "white-tile" / "r000002" / "zarr.json").write_text("{}")
    client = client_of(own)
    assert client.get(pinned).status_code == 200
    assert "white-tile r000002 is damaged" in client.problem("GET", TILE, 503)["detail"]


# Health


def test_health_of_a_store_that_appears_later(root: Path, tmp_path: Path) -> None:
    client = client_of(tmp_path / "later")
    client.problem("GET", "/readyz", 503)
    shutil.copytree(root, tmp_path / "later")
    assert client.get("/readyz").json() == {"status": "ok", "materials": 4}
    assert client.get("/healthz").json() == {"status": "ok"}


def test_a_damaged_material_is_named_and_the_others_are_served(own: Path) -> None:
    (own / "materials" / "grey-felt" / "r000001" / "zarr.json").write_bytes(b"{}")
    client = client_of(own)
    damage = client.problem("GET", FELT, 503)["detail"]
    assert damage.startswith("grey-felt r000001 is damaged: ")
    assert client.problem("GET", f"{FELT}/{POINT}", 503)["detail"] == damage
    lines = client.get("/v1/materials").json()["materials"]
    assert lines[2] == {"name": "grey-felt", "damaged": damage, "href": FELT}
    assert len(lines) == client.get("/readyz").json()["materials"] == 4
    assert client.get(FOIL_POINT).status_code == 200


def test_what_is_removed_while_it_is_served_may_come_back(own: Path) -> None:
    client = client_of(own)
    assert client.get(FOIL_POINT).status_code == 200
    shutil.move(own / "materials" / "copper-foil", own / "aside")
    for address in (FOIL_POINT, FOIL):
        assert client.problem("GET", address, 503)["detail"] == "copper-foil is gone from the store"
    shutil.move(own / "aside", own / "materials" / "copper-foil")
    assert client.get(FOIL_POINT).status_code == 200
    shutil.move(own, own.with_name("aside"))
    for address in (FOIL_POINT, "/readyz"):
        client.problem("GET", address, 503)
    shutil.move(own.with_name("aside"), own)
    assert client.get("/readyz").json()["materials"] == 4
