"""Other answers to a lookup: the model, colours and stated errors; and angles that come as .npy."""

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


def test_the_model_itself(client: Client, store: Store) -> None:
    for name in ["copper-foil", "grey-felt", "brushed-metal"]:
        for wavelengths in [None, 455.0, [455.0, 600.0]]:
            table = store[name]
            at = table.wavelength_nm if wavelengths is None else wavelengths
            params = {**POINT, "from": "model"} | ({} if wavelengths is None else {"wavelength_nm": wavelengths})
            answer = client.get(f"/v1/materials/{name}/lookup", params=params).json()
            assert answer["source"] == "model"
            np.testing.assert_allclose(answer["brdf"], table.source.lookup(*RADIANS, at), **EXACT)
            specular = table.source.specular_reflectance(RADIANS[0], at)
            np.testing.assert_allclose(answer["specular_reflectance"], specular, **EXACT)


# Colours


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
    white = client.get(TILE, params=params).json()["brdf"]  # 1/pi is stored as float32
    np.testing.assert_allclose(white[1] if output == "xyz" else white, 1.0 / math.pi, rtol=2**-24)


def test_colours_of_many_points(root: Path, client: Client, store: Store) -> None:
    body = {"theta_i": [[10], [50]], "theta_r": [20, 40, 60], "phi_r": 170}
    answer = client.post(FOIL, json=body, params={"output": "xyz", "format": "npy"})
    spectra = degrees(store, "copper-foil", body["theta_i"], 0, body["theta_r"], 170)
    np.testing.assert_allclose(read_npy(answer.content), spectra @ xyz_weights(tuple(VISIBLE_NM.tolist())), **EXACT)
    # more points than the 25 000 whose spectra are in memory at once
    points = np.random.default_rng(41).random((60_001, 4)) * [90.0, 360.0, 90.0, 360.0]
    query = {"output": "linear-srgb", "format": "npy", "error": "true"}
    answer = client_of(root).post(FOIL, content=npy(points), headers=BINARY, params=query)
    values = store["copper-foil"].lookup_with_error(*np.radians(points.T))
    of = srgb_weights(tuple(VISIBLE_NM.tolist()))
    expected = np.stack([values.brdf @ of, values.error @ np.abs(of)])
    np.testing.assert_allclose(read_npy(answer.content), expected, rtol=1e-12, atol=1e-15)


def test_colours_may_be_of_more_spectra_than_an_answer_holds(client: Client) -> None:
    colour, model = {"output": "xyz"}, {"output": "xyz", "from": "model"}
    for points, wavelengths, query, status in [
        (500, 201, {}, 413),
        (500, 201, colour, 200),
        (500, 201, model, 413),
        (1000, 1000, colour, 200),
        (1000, 1001, colour, 413),
    ]:
        body = {"theta_i": [1] * points, "theta_r": 2, "wavelength_nm": np.linspace(400.0, 700.0, wavelengths).tolist()}
        assert client.post(FOIL, json=body, params=query).status_code == status, (points, wavelengths, query)


def test_refused_outputs_name_the_parameter(client: Client) -> None:
    many = np.linspace(400.0, 700.0, 1001).tolist()
    queries: list[tuple[str, dict[str, Any], str]] = [
        (FOIL, {"output": "xyz", "illuminant": "D66"}, "illuminant"),
        (FOIL, {"illuminant": "A"}, "illuminant"),
        (FOIL, {"output": "rgb"}, "output"),
        (FOIL, {"from": "paper"}, "from"),
        (FOIL, {"from": "model", "wavelength_nm": 701}, "wavelength_nm"),  # as far as its table
        (FOIL, {"error": "yes"}, "error"),
        (FOIL, {"error": "true", "from": "model"}, "error"),
        (TILE, {"error": "true"}, "error"),
        (FOIL, {"output": "xyz", "wavelength_nm": [450, 550, 650]}, "wavelength_nm"),
        (FELT, {"output": "xyz", "wavelength_nm": 500}, "wavelength_nm"),
        (FOIL, {"output": "xyz", "wavelength_nm": many}, "wavelength_nm"),
    ]
    for address, query, parameter in queries:
        problem = client.problem("GET", address, 422, params={**POINT, **query})
        assert problem["parameter"] == parameter, query
        assert problem["detail"].startswith(f"{parameter}: "), query
        assert query.get("illuminant") != "D66" or "A, B, C, D50" in problem["detail"]  # all that are allowed
    assert client.get(FOIL, params={**POINT, "output": "xyz", "wavelength_nm": many[:1000]}).status_code == 200


# Stated errors


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
    if name == "copper-foil":  # the errors of the wavelengths add up
        colour = client.get(address, params={**POINT, "error": "true", "output": "linear-srgb"}).json()
        np.testing.assert_allclose(colour["error"], error @ np.abs(srgb_weights(tuple(VISIBLE_NM.tolist()))), **EXACT)


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
                for accept in (JSON, f"text/html, {JSON}", NPY, "*/*"):
                    answer = client.post(METAL, content=npy(given), headers={**BINARY, "Accept": accept})
                    found = np.array(answer.json()["brdf"]) if JSON in accept else read_npy(answer.content)
                    assert found.shape == shape
                    np.testing.assert_allclose(found, expected, **EXACT)


def test_a_npy_body_has_its_wavelengths_in_the_query_and_json_has_them_inside(client: Client, store: Store) -> None:
    for wavelengths in [None, 455.0, [600.0, 455.0]]:
        params = {} if wavelengths is None else {"wavelength_nm": wavelengths}
        answer = client.post(FOIL, content=npy(points(6)), headers={**BINARY, "Accept": NPY}, params=params)
        expected = degrees(store, "copper-foil", *points(6).T, wavelength_nm=wavelengths)
        np.testing.assert_allclose(read_npy(answer.content), expected, **EXACT)
    problem = client.problem("POST", FOIL, 422, json=POINT, params={"wavelength_nm": 500})
    assert (problem["parameter"], "JSON" in problem["detail"]) == ("wavelength_nm", True)


WHOLE = npy(points(4))


def test_a_bad_npy_body_is_refused(client: Client) -> None:
    for body, parameter, reason in [
        (b"", "body", "not a .npy file"),
        (b"\x93NUMPY", "body", "not a .npy file"),
        (WHOLE[:60], "body", "not a .npy file"),
        (b"PK" + WHOLE, "body", "not a .npy file"),
        (WHOLE.replace(b"NUMPY\x01", b"NUMPY\x09"), "body", "not a .npy file"),
        (WHOLE[:-1], "body", "header"),
        (WHOLE + b"\0", "body", "header"),
        (WHOLE.replace(b"(4, 4), }", b"(4, 5), }"), "body", "header"),
        (WHOLE.replace(b"(4, 4), }      ", b"(10**9, 4), }"), "body", "not a .npy file"),
        (WHOLE.replace(b"(4, 4), }     ", b"(-4,-4), }    "), "body", "header"),
        (WHOLE.replace(b"(4, 4), }               ", b"(99999999999999, 4), }  "), "body", "header"),
        (npy(points(4).astype(np.int64)), "body", "int64"),
        (npy(points(4).astype(">f8")), "body", ">f8"),
        (npy(points(4).astype(complex)), "body", "complex128"),
        (npy(np.array([{"theta_i": 1}], dtype=object)), "body", "object"),
        (npy(points(4)[:, :3]), "body", "(4, 3)"),
        (npy(np.float64(3.0)), "body", "()"),
        (npy(points(0)), "body", "empty"),
        (npy(np.full((2, 4), np.nan)), "theta_i", "nan"),
        (npy(np.full((2, 4), [0.0, np.inf, 0.0, 0.0])), "phi_i", "inf"),
        (npy(np.full((2, 4), 181.0)), "theta_i", "181.0"),
    ]:
        problem = client.problem("POST", METAL, 422, content=body, headers=BINARY)
        assert (problem["parameter"], reason in problem["detail"]) == (parameter, True), problem["detail"]
