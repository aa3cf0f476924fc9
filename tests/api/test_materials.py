"""The catalogue, one material, health, and the answers that a client already holds."""

from __future__ import annotations

from typing import Any

import pytest

from brdfdb.store import StoreError
from brdfdb_api.app import create_app
from brdfdb_api.settings import Settings

FOIL = "/v1/materials/blue-foil"
FOIL_POINT = f"{FOIL}/lookup?theta_i=10&theta_r=20"


def test_catalogue(client: Any) -> None:
    materials = client.get("/v1/materials").json()["materials"]
    assert [material["name"] for material in materials] == ["blue-foil", "grey-felt"]
    assert materials[0] == {
        "name": "blue-foil",
        "title": "Made-up blue-foil",
        "model": "formula",
        "anisotropic": True,
        "wavelength_range_nm": [400.0, 600.0],
        "revision": "r000001",
        "href": FOIL,
    }
    assert materials[1]["wavelength_range_nm"] is None
    assert client.get(materials[1]["href"]).status_code == 200


def test_catalogue_follows_the_store(client: Any, store: Any) -> None:
    assert client.get("/v1/materials").json()["materials"][1]["title"] == "Made-up grey-felt"
    store["grey-felt"].attrs["title"] = "Other felt"
    store["grey-felt"].revision = "r000002"
    del store.tables["blue-foil"]
    (material,) = client.get("/v1/materials").json()["materials"]
    assert (material["title"], material["revision"]) == ("Other felt", "r000002")


def test_material(client: Any) -> None:
    material = client.get(FOIL).json()
    assert material["axes_deg"] == {
        "theta_i": [0.0, 30.0, 60.0, 90.0],
        "theta_r": pytest.approx([0.0, 180 / 7, 360 / 7, 540 / 7]),
    }
    assert material["wavelength_nm"] == [400.0, 500.0, 600.0]
    assert material["anisotropic"] is True
    assert material["specular"] is True
    assert material["attributes"]["source"] == "no paper"
    assert material["attributes"]["parameters"] == {"rho": 0.5, "n": [1.5, None]}
    assert client.get(material["links"]["self"]).json() == material
    assert client.get(material["links"]["materials"]).status_code == 200
    assert client.get(material["links"]["lookup"], params={"theta_i": 1, "theta_r": 2}).status_code == 200


def test_grey_material(client: Any) -> None:
    material = client.get("/v1/materials/grey-felt").json()
    assert material["wavelength_nm"] is None
    assert material["specular"] is False


@pytest.mark.parametrize("address", ["", "/lookup?theta_i=1&theta_r=2"])
def test_unknown_material_names_the_closest(client: Any, address: str) -> None:
    problem = client.problem("GET", f"/v1/materials/blue-foul{address}", 404)
    assert problem["closest"][0] == "blue-foil"
    assert "blue-foul" in problem["detail"]


@pytest.mark.parametrize("name", ["..", "%2e%2e", "..%2F..%2Fetc%2Fpasswd", "%00", "blue-foil%2F..", "BLUE-FOIL"])
def test_a_name_is_not_a_path(client: Any, name: str) -> None:
    assert client.request("GET", f"/v1/materials/{name}/lookup?theta_i=1&theta_r=2").status_code == 404


@pytest.mark.parametrize(
    ("method", "address", "status"),
    [("GET", "/", 404), ("GET", "/v2", 404), ("DELETE", FOIL, 405), ("PUT", f"{FOIL}/lookup", 405)],
)
def test_addresses_and_methods_that_do_not_exist(client: Any, method: str, address: str, status: int) -> None:
    client.problem(method, address, status)


@pytest.mark.parametrize("address", [FOIL, FOIL_POINT])
def test_etag_follows_the_revision(client: Any, store: Any, address: str) -> None:
    first = client.get(address)
    assert first.headers["etag"] == '"blue-foil-r000001"'
    assert first.headers["cache-control"] == "no-cache"
    for held in (first.headers["etag"], f'"other", W/{first.headers["etag"]}', "*"):
        again = client.get(address, headers={"If-None-Match": held})
        assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", first.headers["etag"])
    store["blue-foil"].revision = "r000002"
    assert client.get(address, headers={"If-None-Match": first.headers["etag"]}).status_code == 200


def test_etag_of_npy_is_another(client: Any) -> None:
    tag = client.get(FOIL_POINT).headers["etag"]
    answer = client.get(FOIL_POINT, headers={"If-None-Match": tag, "Accept": "application/x-npy"})
    assert (answer.status_code, answer.headers["etag"]) == (200, '"blue-foil-r000001-npy"')
    assert answer.headers["vary"] == "Accept"


def test_etag_does_not_hide_an_error(client: Any) -> None:
    client.problem("GET", f"{FOIL_POINT}&thetai=3", 422, headers={"If-None-Match": "*"})
    client.problem("GET", "/v1/materials/blue-foul", 404, headers={"If-None-Match": "*"})


def test_health(client: Any) -> None:
    assert client.get("/healthz").json() == {"status": "ok", "materials": 2}


@pytest.mark.parametrize("address", ["/healthz", "/v1/materials", FOIL, FOIL_POINT])
def test_a_store_that_cannot_be_read(client: Any, tmp_path: Any, address: str) -> None:
    client.app = create_app(Settings(store=tmp_path / "nothing"))
    assert "nothing" in client.problem("GET", address, 503)["detail"]


def test_a_store_that_appears_later(client: Any, store: Any, tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    client.app = create_app(Settings(store=tmp_path / "later"))
    client.problem("GET", "/healthz", 503)
    monkeypatch.setattr("brdfdb.open", {tmp_path / "later": store}.get)
    assert client.get("/healthz").json()["materials"] == 2


def test_a_store_that_breaks(client: Any, store: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: Any) -> int:
        raise StoreError("the pointer of blue-foil is not readable")

    monkeypatch.setattr(type(store), "__len__", fail)
    assert client.problem("GET", "/healthz", 503)["detail"] == "the pointer of blue-foil is not readable"


def test_an_unexpected_error_tells_nothing(client: Any, store: Any) -> None:
    del store["blue-foil"].attrs["title"]
    problem = client.problem("GET", "/v1/materials", 500)
    assert "title" not in problem["detail"]
