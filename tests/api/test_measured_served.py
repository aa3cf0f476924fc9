"""A measured table over HTTP: who measured, its errors, and where it is extrapolated."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.formats._readings import FileTable
from brdfdb.geometry import radians, unit_vector
from brdfdb.materials import presets
from brdfdb.store import http_client
from brdfdb.store.publication import publish
from brdfdb.store.reader import Store
from brdfdb.store.revisions import rollback
from tests.api.a_store import Client, client_of, serving

CLAY = "/v1/materials/my-clay"
INSIDE, OUTSIDE = {"theta_i": 30, "theta_r": 20, "phi_r": 120}, {"theta_i": 80, "theta_r": 20, "phi_r": 120}


@pytest.fixture
def client(measured: Path) -> Client:
    return client_of(measured)


def test_documents_say_by_whom_and_how_well_a_table_was_measured(client: Client, measured: Path) -> None:
    known = client.get(CLAY).json()["measured"]
    record = Store(measured).metadata("my-clay").measured
    assert record is not None
    assert (known["by"], known["file"]) == ("a made-up goniophotometer", "clay.csv")
    assert known["held_out"] == record.model_dump(mode="json")["held_out"]
    assert client.get("/v1/materials/clay-vase").json()["measured"] is None
    lines = client.get("/v1/materials").json()["materials"]
    assert {line["name"]: line["measured"] for line in lines} == {"clay-vase": False, "my-clay": True}
    assert [line["model"] for line in lines] == ["oren_nayar", None]
    assert client.get("/v1/materials?q=none").json()["materials"] == []
    assert client.get(CLAY).json()["model"] is None
    only = client.get("/v1/materials?model=measured").json()["materials"]
    assert [line["name"] for line in only] == ["my-clay"]


def test_lookup_with_its_error_marks_what_is_extrapolated(client: Client) -> None:
    inside, outside = (client.get(f"{CLAY}/lookup", params={**at, "error": "true"}).json() for at in (INSIDE, OUTSIDE))
    assert not inside["extrapolated"]
    assert 0.0 < inside["error"] < inside["brdf"]
    assert outside["extrapolated"]
    assert outside["error"] is None
    assert outside["brdf"] > 0.0
    assert client.get(f"{CLAY}/lookup", params=INSIDE).json()["extrapolated"] is None
    body = {"theta_i": [30, 80], "theta_r": 20, "phi_r": 120}
    assert client.post(f"{CLAY}/lookup?error=true", json=body).json()["extrapolated"] == [False, True]
    assert client.post("/v1/materials/clay-vase/lookup?error=true", json=body).json()["extrapolated"] == [False, False]


def test_cut_tells_where_it_is_extrapolated(client: Client) -> None:
    lobe = client.get(f"{CLAY}/lobe?theta_i=30").json()
    theta_r = np.abs(lobe["axes_deg"]["theta_r"])
    assert np.all(np.array(lobe["extrapolated"])[theta_r > 77.0])
    assert not np.any(np.array(lobe["extrapolated"])[theta_r < 75.0])
    assert client.get("/v1/materials/clay-vase/lobe?theta_i=30").json()["extrapolated"] is None


def test_a_model_and_its_source_code_are_refused_in_a_sentence(client: Client) -> None:
    code = client.get(f"{CLAY}/export/glsl")
    assert code.status_code == 422
    assert "the table is measured" in code.json()["detail"]
    model = client.get(f"{CLAY}/lookup", params={**INSIDE, "from": "model"})
    assert model.status_code == 422
    assert "keeps no model" in model.json()["detail"]


def test_remote_table_knows_where_it_is_extrapolated(measured: Path) -> None:
    with serving(measured) as address:
        table = http_client.RemoteStore(address)["my-clay"]
        angles = radians(np.array([30.0, 80.0])), 0.0, radians(20.0), radians(120.0)
        assert table.extrapolated(*angles).tolist() == [False, True]
        assert np.isnan(table.lookup_with_error(*angles).error).tolist() == [False, True]


def test_a_file_of_a_measured_table_is_read_again(client: Client, measured: Path, tmp_path: Path) -> None:
    path = tmp_path / "my-clay.csv"
    path.write_bytes(client.get(f"{CLAY}/export/csv").content)
    reading = formats.read(path)
    assert isinstance(reading, FileTable)
    theta_i, phi_i, theta_r, phi_r = (radians(np.array([angle])) for angle in (30.0, 0.0, 20.0, 120.0))
    expected = Store(measured)["my-clay"].lookup(theta_i, phi_i, theta_r, phi_r)
    found = reading.evaluate(unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r))
    np.testing.assert_allclose(np.ravel(found), expected, rtol=0.05)


def test_a_measured_table_goes_back_to_an_older_revision(measured: Path, tmp_path: Path) -> None:
    root = Path(shutil.copytree(measured, tmp_path / "store"))
    client = client_of(root)
    older = client.get(CLAY).json()
    picture = client.get(f"{CLAY}/thumbnail.png?size=16")
    publish(root, presets()["clay-vase"].model_copy(update={"name": "my-clay"}), tolerance=0.3)
    newer = client.get(CLAY).json()
    assert (newer["revision"], newer["measured"], newer["model"]) == ("r000002", None, "oren_nayar")
    rollback(root, "my-clay", "r000001")
    again = client.get(CLAY).json()
    assert again == older | {"revisions": ["r000001", "r000002"]}
    answer = client.get(f"{CLAY}/lookup", params={**OUTSIDE, "error": "true"}).json()
    assert (answer["revision"], answer["extrapolated"], answer["error"]) == ("r000001", True, None)
    held = {"If-None-Match": picture.headers["etag"]}
    assert client.get(f"{CLAY}/thumbnail.png?size=16", headers=held).status_code == 304
    problem = client.problem("POST", f"{CLAY}/lookup?from=model", 422, json=OUTSIDE)
    assert problem["parameter"] == "from"
