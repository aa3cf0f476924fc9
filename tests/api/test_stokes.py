"""Reflected Stokes vectors over HTTP: those of the table, with the convention, and every way to ask wrongly."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb.store.publication import publish_layout
from brdfdb.store.reader import Store
from brdfdb.tables import stokes
from tests.api.a_store import NPY, Client, client_of, npy, pinned_of, publish, read_npy, serving
from tests.tables.test_polarisation import WAVELENGTHS, polarised, rough

COPPER = "/v1/materials/made-up/lookup"
LIGHT = (1.0, 0.3, -0.2, 0.4)
POINT = {"theta_i": 60, "phi_i": 10, "theta_r": 50, "phi_r": 170}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("stokes")
    publish_layout(root, "made-up", polarised(rough(), 0.05))
    publish(root, "white-tile", "lambert", rho=1.0)
    return root


@pytest.fixture(scope="module")
def client(root: Path) -> Client:
    return client_of(root)


def test_one_point(root: Path, client: Client) -> None:
    answer = client.get(COPPER, params={**POINT, "stokes": "1,0.3,-0.2,0.4"})
    document, table = answer.json(), brdfdb.open(root)["made-up"]
    angles = [math.radians(POINT[name]) for name in ("theta_i", "phi_i", "theta_r", "phi_r")]
    light = document["stokes"]
    np.testing.assert_allclose(light["reflected"], table.mueller(*angles) @ LIGHT, rtol=1e-12)
    np.testing.assert_allclose(light["specular"], table.specular_mueller(angles[0]) @ LIGHT, rtol=1e-12)
    assert document["brdf"] == pytest.approx(table.lookup(*angles).tolist(), rel=1e-12)
    assert (light["incident"], light["convention"], light["basis"]) == (
        list(LIGHT),
        stokes.CONVENTION,
        stokes.SURFACE_BASIS,
    )
    assert table.metadata.polarisation is not None
    assert table.metadata.polarisation.error is not None
    assert light["element_error"] == table.metadata.polarisation.error.worst_p99
    address = f"/v1/materials/made-up/revisions/{pinned_of(Store(root), 'made-up')}/lookup"
    answer = client.get(address, params={**POINT, "stokes": "1,0,0,0"})
    assert "immutable" not in answer.headers["cache-control"]


def test_many_points_as_json_and_as_npy(root: Path, client: Client) -> None:
    theta_r = [0.0, 30.0, 60.0, 90.5]
    body = {"theta_i": 40, "theta_r": theta_r, "phi_r": 180, "wavelength_nm": 500.0}
    expected = brdfdb.open(root)["made-up"].mueller(math.radians(40), 0.0, np.radians(theta_r), np.pi, 500.0) @ LIGHT
    query = {"stokes": "1,0.3,-0.2,0.4"}
    light = client.post(COPPER, json=body, params=query).json()["stokes"]["reflected"]
    np.testing.assert_allclose(light, expected, rtol=1e-9, atol=1e-15)
    array = read_npy(client.post(COPPER, json=body, params={**query, "format": "npy"}).content)
    np.testing.assert_allclose(array, expected, rtol=1e-9, atol=1e-15)
    assert array.shape == (4, 4)
    assert not array[3].any()  # below the horizon


def test_answers_without_a_stokes_vector_are_as_they_were(client: Client) -> None:
    assert "stokes" not in client.get(COPPER, params=POINT).json()


def test_what_is_no_stokes_vector_is_refused(client: Client) -> None:
    for query, sentence in [
        ({"stokes": "1,0"}, "stokes: '1,0' is not made of four finite numbers, I,Q,U,V"),
        ({"stokes": "1,0,0,x"}, "stokes: '1,0,0,x' is not made of four finite numbers, I,Q,U,V"),
        ({"stokes": "1,0,0,nan"}, "stokes: '1,0,0,nan' is not made of four finite numbers, I,Q,U,V"),
        ({"stokes": "1,1,1,0"}, "stokes: sqrt(Q^2 + U^2 + V^2) exceeds I = 1"),
        ({"stokes": "1,0,0,0", "from": "model"}, "stokes: it goes with from=table and output=spectrum alone"),
        ({"stokes": "1,0,0,0", "output": "xyz"}, "stokes: it goes with from=table and output=spectrum alone"),
        ({"stokes": "1,0,0,0", "format": "npy", "error": "true"}, "stokes: a .npy answer holds either Stokes"),
    ]:
        problem = client.problem("GET", COPPER, 422, params={**POINT, **query})
        assert problem["detail"].startswith(sentence)
        assert problem["parameter"] == "stokes"


def test_an_unpolarised_table_says_so(client: Client) -> None:
    problem = client.problem("GET", "/v1/materials/white-tile/lookup", 422, params={**POINT, "stokes": "1,0,0,0"})
    assert (problem["detail"], problem["parameter"]) == ("stokes: the table of white-tile is unpolarised", "stokes")


def test_a_matrix_counts_as_sixteen_values(client: Client) -> None:
    points = {"theta_i": 40, "theta_r": np.linspace(0.0, 80.0, 5000).tolist(), "wavelength_nm": WAVELENGTHS.tolist()}
    assert client.post(COPPER, json=points).status_code == 200
    answer = client.post(COPPER, json=points | {"theta_r": points["theta_r"] * 2}, params={"stokes": "1,0,0,0"})
    assert answer.status_code == 200
    many = np.zeros((200_000, 4))
    headers = {"content-type": NPY}
    refused = client.problem("POST", COPPER, 413, content=npy(many), headers=headers, params={"stokes": "1,0,0,0"})
    assert refused["detail"].startswith("9600000 values are more than the")


def test_a_table_behind_a_service_has_the_matrices_of_the_directory(root: Path) -> None:
    table = brdfdb.open(root)["made-up"]
    theta_i, phi_r = np.array([[0.3], [1.2]]), np.array([0.4, 2.0, 3.1])
    with serving(root) as url:
        remote = brdfdb.open(url)["made-up"]
        for at in (None, float(WAVELENGTHS[0]), np.array(WAVELENGTHS[:2])):
            matrix = remote.mueller(theta_i, 0.2, 0.7, phi_r, at)
            np.testing.assert_allclose(matrix, table.mueller(theta_i, 0.2, 0.7, phi_r, at), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(remote.mueller(0.3, 0.2, 0.7, 2.0), table.mueller(0.3, 0.2, 0.7, 2.0), atol=1e-12)
        assert np.all(np.isnan(remote.mueller(np.nan, 0.2, 0.7, 2.0)))
        with pytest.raises(brdfdb.errors.BrdfdbError, match="unpolarised"):
            brdfdb.open(url)["white-tile"].mueller(0.3, 0.2, 0.7, 2.0)
