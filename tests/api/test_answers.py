"""What else a lookup can be asked for: the model, colours, errors; and angles that come as .npy."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb.spectra import srgb_weights, xyz_weights
from brdfdb.store.reader import Store
from tests.api.a_store import NPY, VISIBLE_NM, Client, client_of, degrees, npy, read_npy

FOIL, FELT, TILE, METAL = (
    f"/v1/materials/{name}/lookup" for name in ("copper-foil", "grey-felt", "white-tile", "brushed-metal")
)
POINT = {"theta_i": 20, "phi_i": 5, "theta_r": 25, "phi_r": 170}
RADIANS = tuple(math.radians(angle) for angle in POINT.values())
EXACT = {"rtol": 1e-12}

JSON = "application/json"
BINARY = {"Content-Type": NPY}


# from=model


def test_the_model_itself(client: Client, store: Store) -> None:
    for name in ["copper-foil", "grey-felt", "brushed-metal"]:
        for wavelengths in [None, 455.0, [455.0, 600.0]]:
            table = store[name]
            at = table.wavelength_nm if wavelengths is None else wavelengths
            params = {**POINT, "from": "model"} | ({} if wavelengths is None else {"wavelength_nm": wavelengths})
            answer = client.get(f"/v1/materials/{name}/lookup", params=params).json()
            assert answer["source"] == "model"
            material = table.source
            np.testing.assert_allclose(answer["brdf"], material.lookup(*RADIANS, at), **EXACT)
            np.testing.assert_allclose(
                answer["specular_reflectance"], material.specular_reflectance(RADIANS[0], at), **EXACT
            )


def test_a_lambertian_model_is_exact(client: Client) -> None:
    params = {"theta_i": 20, "theta_r": 70, "from": "model"}
    assert client.get(TILE, params=params).json()["brdf"] == pytest.approx(1.0 / math.pi, rel=1e-15)


def test_a_model_reaches_as_far_as_its_table(client: Client) -> None:
    for source in ("table", "model"):
        problem = client.problem("GET", FOIL, 422, params={**POINT, "from": source, "wavelength_nm": 701})
        assert problem["detail"] == "wavelength_nm: 701 is outside [400, 700] nm of copper-foil"


# output=xyz, linear-srgb


@pytest.mark.parametrize("illuminant", [None, "D65", "A", "FL2"])
@pytest.mark.parametrize(("output", "weights"), [("xyz", xyz_weights), ("linear-srgb", srgb_weights)])
@pytest.mark.parametrize("source", ["table", "model"])
def test_colours(client: Client, store: Store, output: str, weights: Any, illuminant: str | None, source: str) -> None:
    params = {**POINT, "output": output, "from": source} | ({} if illuminant is None else {"illuminant": illuminant})
    answer = client.get(FOIL, params=params).json()
    assert (answer["output"], answer["illuminant"]) == (output, illuminant or "D65")
    of = weights(tuple(VISIBLE_NM.tolist()), illuminant or "D65")
    table = store["copper-foil"]
    spectrum = table.lookup(*RADIANS) if source == "table" else table.source.lookup(*RADIANS, VISIBLE_NM)
    np.testing.assert_allclose(answer["brdf"], spectrum @ of, **EXACT)
    if source == "table":
        specular = table.specular_reflectance(RADIANS[0])
        np.testing.assert_allclose(answer["specular_reflectance"], specular @ of, **EXACT)


@pytest.mark.parametrize("illuminant", ["D65", "A"])
def test_white_is_one_over_pi_in_linear_srgb_and_y(client: Client, illuminant: str) -> None:
    white = np.full(3, 1.0 / math.pi)
    rgb = client.get(TILE, params={**POINT, "output": "linear-srgb", "illuminant": illuminant}).json()["brdf"]
    np.testing.assert_allclose(rgb, white, rtol=2**-24)  # stored as float32
    xyz = client.get(TILE, params={**POINT, "output": "xyz", "illuminant": illuminant}).json()["brdf"]
    assert xyz[1] == pytest.approx(1.0 / math.pi, rel=2**-24)


def test_colours_of_many_points(client: Client, store: Store) -> None:
    body = {"theta_i": [[10], [50]], "theta_r": [20, 40, 60], "phi_r": 170}
    answer = client.post(FOIL, json=body, params={"output": "xyz", "format": "npy"})
    spectra = degrees(store, "copper-foil", body["theta_i"], 0, body["theta_r"], 170)
    np.testing.assert_allclose(read_npy(answer.content), spectra @ xyz_weights(tuple(VISIBLE_NM.tolist())), **EXACT)


def test_colours_of_more_points_than_are_worked_on_at_once(root: Path, store: Store) -> None:
    points = np.random.default_rng(41).random((60_001, 4)) * [90.0, 360.0, 90.0, 360.0]
    answer = client_of(root).post(
        FOIL,
        content=npy(points),
        headers=BINARY,
        params={"output": "linear-srgb", "format": "npy", "error": "true"},
    )
    spectra = store["copper-foil"].lookup_with_error(*np.radians(points.T))
    of = srgb_weights(tuple(VISIBLE_NM.tolist()))
    expected = np.stack([spectra.brdf @ of, spectra.error @ np.abs(of)])
    np.testing.assert_allclose(read_npy(answer.content), expected, rtol=1e-12, atol=1e-15)


def test_colours_may_be_of_more_spectra_than_an_answer_holds(client: Client) -> None:
    body = {"theta_i": [1] * 500, "theta_r": 2, "wavelength_nm": np.linspace(400.0, 700.0, 201).tolist()}
    assert "100500 values" in client.problem("POST", FOIL, 413, json=body)["detail"]
    assert client.post(FOIL, json=body, params={"output": "xyz"}).status_code == 200
    client.problem("POST", FOIL, 413, json=body, params={"output": "xyz", "from": "model"})
    much = {**body, "theta_i": [1] * 1000, "wavelength_nm": np.linspace(400.0, 700.0, 1000).tolist()}
    assert client.post(FOIL, json=much, params={"output": "xyz"}).status_code == 200
    more = {**much, "wavelength_nm": np.linspace(400.0, 700.0, 1001).tolist()}
    client.problem("POST", FOIL, 413, json=more, params={"output": "xyz"})


def test_what_cannot_be_asked_for(client: Client) -> None:
    for address, query, parameter in [
        (FOIL, {"output": "xyz", "illuminant": "D66"}, "illuminant"),
        (FOIL, {"illuminant": "A"}, "illuminant"),
        (FOIL, {"output": "rgb"}, "output"),
        (FOIL, {"from": "paper"}, "from"),
        (FOIL, {"error": "yes"}, "error"),
        (FOIL, {"error": "true", "from": "model"}, "error"),
        (TILE, {"error": "true"}, "error"),
        (FOIL, {"output": "xyz", "wavelength_nm": [450, 550, 650]}, "wavelength_nm"),
        (FELT, {"output": "xyz", "wavelength_nm": 500}, "wavelength_nm"),
    ]:
        problem = client.problem("GET", address, 422, params={**POINT, **query})
        assert problem["parameter"] == parameter
        assert problem["detail"].startswith(f"{parameter}: ")


def test_a_colour_of_very_many_wavelengths_is_refused(client: Client) -> None:
    said = []
    for count in (1001, 1000):
        query = {"output": "xyz", "wavelength_nm": np.linspace(400.0, 700.0, count).tolist()}
        said.append(client.get(FOIL, params={**POINT, **query}))
    assert [answer.status_code for answer in said] == [422, 200]
    assert said[0].json()["parameter"] == "wavelength_nm"
    assert said[0].json()["detail"].startswith("wavelength_nm: 1001 wavelengths are more than the 1000")


# error=true


@pytest.mark.parametrize("name", ["copper-foil", "grey-felt"])
def test_the_stated_error_stands_beside_the_values(client: Client, store: Store, name: str) -> None:
    address = f"/v1/materials/{name}/lookup"
    brdf, error = store[name].lookup_with_error(*RADIANS)
    answer = client.get(address, params={**POINT, "error": "true"}).json()
    np.testing.assert_array_equal(answer["brdf"], brdf)
    np.testing.assert_array_equal(answer["error"], error)
    assert client.get(address, params={**POINT, "error": "false"}).json()["error"] is None
    both = read_npy(client.get(address, params={**POINT, "error": "true", "format": "npy"}).content)
    np.testing.assert_array_equal(both, np.stack([brdf, error]))


def test_the_error_of_a_colour_adds_up(client: Client, store: Store) -> None:
    answer = client.get(FOIL, params={**POINT, "error": "true", "output": "linear-srgb"}).json()
    stated = store["copper-foil"].lookup_with_error(*RADIANS).error
    np.testing.assert_allclose(answer["error"], stated @ np.abs(srgb_weights(tuple(VISIBLE_NM.tolist()))), **EXACT)


# .npy bodies


def points(*shape: int) -> np.ndarray:
    """Angles [degree] in the order of a body."""
    return np.random.default_rng(3).uniform(0.0, 90.0, (*shape, 4))


def test_a_npy_body(client: Client, store: Store) -> None:
    for shape in [(), (1,), (7,), (3, 5)]:
        for dtype in [np.float32, np.float64]:
            for order in ["C", "F"]:
                given = np.asarray(points(*shape).astype(dtype), order=order)
                expected = degrees(store, "brushed-metal", *np.moveaxis(given.astype(np.float64), -1, 0))
                for accept in (JSON, f"text/html, {JSON}"):
                    answer = client.post(METAL, content=npy(given), headers={**BINARY, "Accept": accept})
                    np.testing.assert_allclose(answer.json()["brdf"], expected, **EXACT)
                for accept in (NPY, "*/*"):
                    answer = client.post(METAL, content=npy(given), headers={**BINARY, "Accept": accept})
                    assert read_npy(answer.content).shape == shape
                    np.testing.assert_allclose(read_npy(answer.content), expected, **EXACT)


def test_a_npy_body_has_its_wavelengths_in_the_query(client: Client, store: Store) -> None:
    for wavelengths in [None, 455.0, [600.0, 455.0]]:
        params = {} if wavelengths is None else {"wavelength_nm": wavelengths}
        answer = client.post(FOIL, content=npy(points(6)), headers={**BINARY, "Accept": NPY}, params=params)
        expected = degrees(store, "copper-foil", *points(6).T, wavelength_nm=wavelengths)
        np.testing.assert_allclose(read_npy(answer.content), expected, **EXACT)


def test_a_json_body_has_its_wavelengths_inside(client: Client) -> None:
    problem = client.problem("POST", FOIL, 422, json=POINT, params={"wavelength_nm": 500})
    assert problem["detail"] == "wavelength_nm: a JSON body holds it, not the query"


WHOLE = npy(points(4))


def test_a_bad_npy_body_is_refused(client: Client) -> None:
    for body, said in [
        (b"", "not a .npy file"),
        (b"\x93NUMPY", "not a .npy file"),
        (WHOLE[:60], "not a .npy file"),
        (b"PK" + WHOLE, "not a .npy file"),
        (WHOLE.replace(b"NUMPY\x01", b"NUMPY\x09"), "not a .npy file"),
        (WHOLE[:-1], "shorter or longer than its .npy header says"),
        (WHOLE + b"\0", "shorter or longer than its .npy header says"),
        (WHOLE.replace(b"(4, 4), }", b"(4, 5), }"), "shorter or longer than its .npy header says"),
        (WHOLE.replace(b"(4, 4), }      ", b"(10**9, 4), }"), "not a .npy file"),
        (WHOLE.replace(b"(4, 4), }     ", b"(-4,-4), }    "), "shorter or longer than its .npy header says"),
        (WHOLE.replace(b"(4, 4), }               ", b"(99999999999999, 4), }  "), "shorter or longer"),
        (npy(points(4).astype(np.int64)), "int64 is not float32 or float64"),
        (npy(points(4).astype(">f8")), ">f8 is not float32 or float64"),
        (npy(points(4).astype(complex)), "complex128 is not float32 or float64"),
        (npy(np.array([{"theta_i": 1}], dtype=object)), "object is not float32 or float64"),
        (npy(points(4)[:, :3]), "its shape (4, 3) is not (..., 4)"),
        (npy(np.float64(3.0)), "its shape () is not (..., 4)"),
        (npy(points(0)), "an empty array"),
        (npy(np.full((2, 4), np.nan)), "theta_i: nan is outside [0, 180] degrees"),
        (npy(np.full((2, 4), [0.0, np.inf, 0.0, 0.0])), "phi_i: inf is outside [-720, 720] degrees"),
        (npy(np.full((2, 4), 181.0)), "theta_i: 181.0 is outside [0, 180] degrees"),
    ]:
        assert said in client.problem("POST", METAL, 422, content=body, headers=BINARY)["detail"]


def test_a_npy_body_is_counted_too(client: Client) -> None:
    client.problem("POST", METAL, 413, content=b" " * 100_001, headers=BINARY)
    said = client.problem("POST", METAL, 413, content=npy(points(1001)), headers=BINARY, params={"format": "json"})[
        "detail"
    ]
    assert said == "1001 points are more than the 1000 that one json answer may hold; format=npy may hold more"
