"""Reflected Stokes vectors over HTTP: those of the table, with the convention, and refused questions."""

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
    angles = [math.radians(angle) for angle in POINT.values()]
    light = document["stokes"]
    np.testing.assert_allclose(light["reflected"], table.mueller(*angles) @ LIGHT, rtol=1e-12)
    np.testing.assert_allclose(light["specular"], table.specular_mueller(angles[0]) @ LIGHT, rtol=1e-12)
    assert document["brdf"] == pytest.approx(table.lookup(*angles).tolist(), rel=1e-12)
    assert light["incident"] == list(LIGHT)
    assert (light["convention"], light["basis"]) == (stokes.CONVENTION, stokes.SURFACE_BASIS)
    assert table.metadata.polarisation is not None
    assert table.metadata.polarisation.error is not None
    assert light["element_error"] == table.metadata.polarisation.error.worst_p99
    address = f"/v1/materials/made-up/revisions/{pinned_of(Store(root), 'made-up')}/lookup"
    computed = client.get(address, params={**POINT, "stokes": "1,0,0,0"})
    assert "immutable" not in computed.headers["cache-control"]
    assert "stokes" not in client.get(COPPER, params=POINT).json()


def test_many_points_as_json_and_as_npy(root: Path, client: Client) -> None:
    theta_r = [0.0, 30.0, 60.0, 90.5]
    body = {"theta_i": 40, "theta_r": theta_r, "phi_r": 180, "wavelength_nm": 500.0}
    expected = brdfdb.open(root)["made-up"].mueller(math.radians(40), 0.0, np.radians(theta_r), np.pi, 500.0) @ LIGHT
    query = {"stokes": "1,0.3,-0.2,0.4"}
    light = client.post(COPPER, json=body, params=query).json()["stokes"]["reflected"]
    array = read_npy(client.post(COPPER, json=body, params={**query, "format": "npy"}).content)
    for found in (light, array):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-15)
    assert array.shape == (4, 4)
    assert not array[3].any()  # below the horizon


def test_refused_stokes_vectors(client: Client) -> None:
    unpolarised = "/v1/materials/white-tile/lookup"
    for address, query in [
        *((COPPER, {"stokes": vector}) for vector in ("1,0", "1,0,0,x", "1,0,0,nan")),
        (COPPER, {"stokes": "1,1,1,0"}),  # Q, U and V make more than I
        (COPPER, {"stokes": "1,0,0,0", "from": "model"}),
        (COPPER, {"stokes": "1,0,0,0", "output": "xyz"}),
        (COPPER, {"stokes": "1,0,0,0", "format": "npy", "error": "true"}),
        (unpolarised, {"stokes": "1,0,0,0"}),
    ]:
        problem = client.problem("GET", address, 422, params={**POINT, **query})
        assert problem["parameter"] == "stokes", query
        assert problem["detail"].startswith("stokes: "), query


def test_a_matrix_counts_as_sixteen_values(client: Client) -> None:
    points = {"theta_i": 40, "theta_r": np.linspace(0.0, 80.0, 5000).tolist(), "wavelength_nm": WAVELENGTHS.tolist()}
    assert client.post(COPPER, json=points).status_code == 200
    answer = client.post(COPPER, json=points | {"theta_r": points["theta_r"] * 2}, params={"stokes": "1,0,0,0"})
    assert answer.status_code == 200
    many, headers = npy(np.zeros((200_000, 4))), {"content-type": NPY}
    problem = client.problem("POST", COPPER, 413, content=many, headers=headers, params={"stokes": "1,0,0,0"})
    assert problem["detail"].startswith("9600000 values")


def test_a_table_behind_a_service_has_the_matrices_of_the_directory(root: Path) -> None:
    table = brdfdb.open(root)["made-up"]
    theta_i, phi_r = np.array([[0.3], [1.2]]), np.array([0.4, 2.0, 3.1])
    with serving(root) as url:
        remote = brdfdb.open(url)["made-up"]
        for at in (None, float(WAVELENGTHS[0]), np.array(WAVELENGTHS[:2])):
            for angles in ((theta_i, 0.2, 0.7, phi_r), (0.3, 0.2, 0.7, 2.0)):
                matrix = table.mueller(*angles, at)
                np.testing.assert_allclose(remote.mueller(*angles, at), matrix, rtol=1e-9, atol=1e-12)
        assert np.all(np.isnan(remote.mueller(np.nan, 0.2, 0.7, 2.0)))
        with pytest.raises(brdfdb.errors.BrdfdbError, match="unpolarised"):
            brdfdb.open(url)["white-tile"].mueller(0.3, 0.2, 0.7, 2.0)
