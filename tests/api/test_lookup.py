"""Lookups over HTTP: values, degrees, shapes, formats, limits, and refused questions."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from brdfdb.errors import ParameterError
from brdfdb.store.reader import Store
from brdfdb.tables.table import Table
from tests.api.a_store import NPY, VISIBLE_NM, Client, client_of, degrees, npy, read_npy

FOIL = "/v1/materials/copper-foil/lookup"
FELT = "/v1/materials/grey-felt/lookup"
EXACT = {"rtol": 1e-12}  # the closed forms of degrees differ by 1e-15


def test_one_point_in_degrees(client: Client, store: Store) -> None:
    answer = client.get(FELT, params={"theta_i": 60, "phi_i": 30, "theta_r": 60, "phi_r": 90})
    assert answer.json() == {
        "material": "grey-felt",
        "revision": "r000001",
        "digest": store["grey-felt"].digest,
        "source": "table",
        "unit": "1/sr",
        "output": "spectrum",
        "illuminant": None,
        "wavelength_nm": None,
        "brdf": pytest.approx(degrees(store, "grey-felt", 60, 30, 60, 90), rel=1e-15),
        "error": None,
        "extrapolated": None,
        "specular_reflectance": 0.0,
    }


def test_azimuths_default_to_zero_and_the_horizon_is_above(client: Client, store: Store) -> None:
    white = client.get("/v1/materials/white-tile/lookup", params={"theta_i": 20, "theta_r": 70}).json()["brdf"]
    assert white == pytest.approx(1.0 / math.pi, rel=2**-24)  # stored as float32
    brdf = degrees(store, "grey-felt", 50, 0, 40, 0)
    assert client.get(FELT, params={"theta_i": 50, "theta_r": 40}).json()["brdf"] == brdf
    assert client.post(FELT, json={"theta_i": 50, "theta_r": 40}).json()["brdf"] == brdf
    for theta_i, theta_r, reflects in [(90, 90, True), (90.5, 10, False), (10, 180, False), (180, 180, False)]:
        found = client.get(FELT, params={"theta_i": theta_i, "theta_r": theta_r}).json()["brdf"]
        assert (found > 0.0) is reflects, (theta_i, theta_r)


def test_wavelengths_of_one_point(client: Client, store: Store) -> None:
    for wavelengths, shown in [([], VISIBLE_NM.tolist()), ([450], 450.0), ([600, 450], [600.0, 450.0])]:
        query = {"theta_i": 20, "theta_r": 25, "phi_r": 170, "wavelength_nm": wavelengths}
        answer = client.get(FOIL, params=query).json()
        assert answer["wavelength_nm"] == shown
        expected = degrees(store, "copper-foil", 20, 0, 25, 170, wavelength_nm=shown)
        np.testing.assert_array_equal(answer["brdf"], expected)
        specular = store["copper-foil"].specular_reflectance(math.radians(20), shown)
        np.testing.assert_array_equal(answer["specular_reflectance"], specular)


def test_azimuths_may_turn_twice_and_no_more(client: Client) -> None:
    point = {"theta_i": 40, "theta_r": 50, "phi_i": 10}
    once, turned = (client.get(FELT, params={**point, "phi_r": phi}).json()["brdf"] for phi in (130, 490))
    assert once == turned == client.post(FELT, json={**point, "phi_r": 490}).json()["brdf"]
    for phi in (-720.25, 850, 130 + 360 * 2**44):
        answers = client.get(FELT, params={**point, "phi_r": phi}), client.post(FELT, json={**point, "phi_r": [0, phi]})
        assert [(answer.status_code, answer.json()["parameter"]) for answer in answers] == [(422, "phi_r")] * 2


def test_a_grey_material_takes_any_wavelength(client: Client, store: Store) -> None:
    point = {"theta_i": 0, "theta_r": 0, "wavelength_nm": [5, 50_000]}
    for answer in (client.get(FELT, params=point).json(), client.post(FELT, json=point).json()):
        assert answer["wavelength_nm"] == [5, 50_000]
        assert answer["brdf"] == [degrees(store, "grey-felt", 0, 0, 0, 0)] * 2
        assert answer["specular_reflectance"] == [0, 0]


def test_post_broadcasts_like_numpy(client: Client, store: Store) -> None:
    angles = {
        "theta_i": [[0], [30], [60]],
        "phi_i": 15,
        "theta_r": [0, 45.5, 90, 135],
        "phi_r": [[-720], [700.5], [180.25]],
    }
    for wavelength in [None, 450, [450], [600, 450]]:
        answer = client.post(FOIL, json={**angles, "wavelength_nm": wavelength}).json()
        assert answer["wavelength_nm"] == (VISIBLE_NM.tolist() if wavelength is None else wavelength)
        expected = degrees(store, "copper-foil", *angles.values(), wavelength_nm=wavelength)
        assert expected.shape[:2] == (3, 4)
        np.testing.assert_allclose(answer["brdf"], expected, **EXACT)
        specular = store["copper-foil"].specular_reflectance(np.deg2rad(angles["theta_i"]), wavelength)
        np.testing.assert_allclose(answer["specular_reflectance"], specular, **EXACT)
    point = {"theta_i": 12.5, "phi_i": -3, "theta_r": 77, "phi_r": 181}
    assert client.post(FOIL, json=point).json() == client.get(FOIL, params=point).json()


def test_npy_has_the_numbers_of_json(client: Client) -> None:
    body = {"theta_i": [[5.1], [25.3]], "theta_r": [10.7, 20.9, 100], "phi_r": 33.3}
    accept = {"Accept": f"{NPY}, */*;q=0.1"}
    asked: list[dict[str, Any]] = [{"params": {"format": "npy"}}, {"headers": accept}]
    for ask in asked:
        answer = client.post(FOIL, json=body, **ask)
        assert (answer.status_code, answer.headers["content-type"]) == (200, NPY)
        brdf = read_npy(answer.content)
        assert (brdf.shape, brdf.dtype) == ((2, 3, VISIBLE_NM.size), np.float64)
        np.testing.assert_array_equal(brdf, client.post(FOIL, json=body).json()["brdf"])
    point = {"theta_i": 12.5, "theta_r": 77}
    brdf = read_npy(client.get(FELT, params={**point, "format": "npy"}).content)
    assert (brdf.shape, brdf.item()) == ((), client.get(FELT, params=point).json()["brdf"])
    named = client.get(FELT, params={**point, "format": "json"}, headers=accept)
    assert named.headers["content-type"] == "application/json"


@pytest.mark.parametrize(("points", "in_main_thread"), [(1000, True), (1001, False)])
def test_many_values_take_a_thread(
    root: Path, points: int, in_main_thread: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    threads = []
    lookup = Table.lookup

    def watched(*args: Any, **keywords: Any) -> Any:
        threads.append(threading.current_thread())
        return lookup(*args, **keywords)

    monkeypatch.setattr(Table, "lookup", watched)
    assert client_of(root).post(FELT, json={"theta_i": [1] * points, "theta_r": 2}).status_code == 200
    assert [thread is threading.main_thread() for thread in threads] == [in_main_thread]


def test_a_long_body(root: Path, store: Store) -> None:
    angles = np.linspace(0, 90, 2000)
    fields = dict.fromkeys(("theta_i", "phi_i", "theta_r", "phi_r"), angles.tolist())
    expected = degrees(store, "grey-felt", angles, angles, angles, angles)
    np.testing.assert_allclose(client_of(root).post(FELT, json=fields).json()["brdf"], expected, **EXACT)


def test_lists_in_lists(client: Client) -> None:
    for levels, status in [(32, 200), (33, 422), (64, 422), (65, 422)]:
        answer = client.post(FELT, content='{"theta_i": 10, "theta_r": ' + "[" * levels + "20" + "]" * levels + "}")
        assert (answer.status_code, answer.json().get("parameter", "theta_r")) == (status, "theta_r"), levels
        if levels < 64:
            array = npy(np.full((1,) * levels + (4,), 10.0))
            assert client.post(FELT, content=array, headers={"Content-Type": NPY}).status_code == status, levels


# Refused questions


def test_a_bad_query_names_the_parameter(client: Client) -> None:
    for query, parameter in [
        ("theta_i=200&theta_r=2", "theta_i"),
        ("theta_i=-0.001&theta_r=2", "theta_i"),
        ("theta_i=1&theta_r=180.00000000000003", "theta_r"),
        ("theta_i=nan&theta_r=2", "theta_i"),
        ("theta_i=1&theta_r=2&phi_i=-inf", "phi_i"),
        ("theta_i=1&theta_r=2&phi_r=1e999", "phi_r"),
        ("theta_i=1&theta_r=2&phi_r=720.5", "phi_r"),
        ("theta_i=1&theta_r=2&phi_i=-10313", "phi_i"),
        ("theta_i=45deg&theta_r=2", "theta_i"),
        ("theta_i=&theta_r=2", "theta_i"),
        ("theta_i=1", "theta_r"),
        ("theta_r=1", "theta_i"),
        ("thetai=10&theta_r=2", "thetai"),
        ("theta_i=1&theta_i=1&theta_r=2", "theta_i"),
        ("theta_i=1&theta_r=2&wavelength_nm=500&wavelength_nm=701", "wavelength_nm"),
        ("theta_i=1&theta_r=2&wavelength_nm=green", "wavelength_nm"),
        ("theta_i=1&theta_r=2&wavelength_nm=nan", "wavelength_nm"),
        ("theta_i=1&theta_r=2&format=csv", "format"),
    ]:
        problem = client.problem("GET", f"{FOIL}?{query}", 422)
        assert problem["parameter"] == parameter, query
        assert problem["detail"].startswith(f"{parameter}: "), query
        if "180.00000000000003" in query:
            assert "180.00000000000003" in problem["detail"]
    client.problem("POST", f"{FOIL}?theta_i=3", 422, json={"theta_i": 1, "theta_r": 2})


def test_a_bad_body_names_the_parameter_and_is_not_echoed(client: Client) -> None:
    for body, parameter in [
        ('{"theta_i": NaN, "theta_r": 2}', "theta_i"),
        ('{"theta_i": 1, "theta_r": [2, -Infinity]}', "theta_r"),
        ('{"theta_i": 1, "theta_r": 1e999}', "theta_r"),
        ('{"theta_i": 1, "theta_r": 2, "phi_r": [[1], [NaN]]}', "phi_r"),
        ('{"theta_i": [1, 181], "theta_r": 2}', "theta_i"),
        ('{"theta_i": -1, "theta_r": 2}', "theta_i"),
        ('{"theta_i": "secret", "theta_r": 2}', "theta_i"),
        ('{"theta_i": [1, "45"], "theta_r": 2}', "theta_i"),
        ('{"theta_i": true, "theta_r": 2}', "theta_i"),
        ('{"theta_i": [[1.5, 0], [2, true]], "theta_r": 2}', "theta_i"),
        ('{"theta_i": null, "theta_r": 2}', "theta_i"),
        ('{"theta_i": [1, null], "theta_r": 2}', "theta_i"),
        ('{"theta_i": {"x": 1}, "theta_r": 2}', "theta_i"),
        ('{"theta_i": [[1, 2], [3]], "theta_r": 2}', "theta_i"),
        ('{"theta_i": ' + 100 * "[" + "1" + 100 * "]" + ', "theta_r": 2}', "theta_i"),
        ('{"theta_i": ' + 400 * "9" + ', "theta_r": 2}', "theta_i"),
        ('{"theta_i": [], "theta_r": 2}', "theta_i"),
        ('{"theta_i": [[], []], "theta_r": []}', "theta_i"),
        ('{"theta_r": 2}', "theta_i"),
        ('{"theta_i": 1}', "theta_r"),
        ('{"theta_i": [1, 2], "theta_r": [1, 2, 3]}', "theta_r"),  # the shapes do not broadcast
        ('{"theta_i": 1, "theta_r": 2, "thetai": 3}', "thetai"),
        ('{"\\ud800": NaN, "theta_i": 1, "theta_r": 2}', "\\ud800"),  # no text
        ('{"theta_i": 1, "theta_r": 2, "wavelength_nm": []}', "wavelength_nm"),
        ('{"theta_i": 1, "theta_r": 2, "wavelength_nm": [[500]]}', "wavelength_nm"),
        ('{"theta_i": 1, "theta_r": 2, "wavelength_nm": "500"}', "wavelength_nm"),
        ('{"theta_i": 1, "theta_r": 2, "wavelength_nm": 0}', "wavelength_nm"),
        ('{"theta_i": 1, "theta_r": 2, "wavelength_nm": NaN}', "wavelength_nm"),
        ('{"theta_i": 1, "theta_r": 2, "wavelength_nm": [500, 399]}', "wavelength_nm"),
        *((body, "body") for body in (b"", b"theta_i=1", b"[1, 2]", b"null", b'{"theta_i": 1', b"\xff\xfe{")),
        *((body, "body") for body in (b"[" * 50_000, b"{" * 20, '["secret"]', '{"theta_i": secret}')),
    ]:
        problem = client.problem("POST", FOIL, 422, content=body)
        assert problem["parameter"] == parameter, body[:80]
        assert problem["detail"].startswith(f"{parameter}: "), body[:80]
        assert "secret" not in json.dumps(problem)
        assert ("JSON" in problem["detail"]) is (parameter == "body")
    assert len(client.problem("POST", FOIL, 422, json={"x" * 90_000: 1})["parameter"]) == 40


@pytest.mark.parametrize(
    "error",
    [
        ValueError("cannot reshape array of size 7 into shape (3,)"),
        ValueError("wavelength_nm: a sentence that names a parameter is not an error about it"),
        ParameterError("specular", "shape (3,) is not (2,)"),  # no client names this parameter
    ],
)
def test_an_error_about_no_parameter_of_a_request(
    error: Exception, client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any, **__: Any) -> Any:
        raise error

    monkeypatch.setattr(Table, "lookup", fail)
    problem = client.problem("GET", f"{FOIL}?theta_i=1&theta_r=2", 500)
    assert str(error) not in problem["detail"]
    assert "parameter" not in problem


# Limits: the application under test allows 1000 points and a body of 100 kB


def outer(n: int, m: int) -> dict[str, Any]:
    """The body of n x m points."""
    return {"theta_i": [[1]] * n, "theta_r": [2] * m}


def test_points_and_wavelengths_of_one_answer(client: Client) -> None:
    for address, body, file_format, status, count in [
        (FELT, outer(20, 50), "json", 200, ""),
        (FELT, outer(7, 143), "json", 413, "1001 points"),
        (FELT, outer(7, 143), "npy", 200, ""),
        (FELT, outer(200, 500), "npy", 200, ""),
        (FELT, outer(201, 500), "npy", 413, "100500 points"),
        (FELT, {**outer(10_000, 1), "phi_i": [2] * 10_000}, "json", 413, "100000000 points"),
        (FOIL, {**outer(1, 990), "wavelength_nm": [500] * 101}, "json", 200, ""),
        (FOIL, {**outer(1, 1000), "wavelength_nm": [500] * 101}, "json", 413, "101000 values"),
    ]:
        answer = client.post(address, json=body, params={"format": file_format})
        assert answer.status_code == status, (file_format, count)
        assert status == 200 or count in answer.json()["detail"], count


@pytest.mark.parametrize(("chunks", "sent"), [(1000, 101), (100, 100)])
def test_a_body_is_counted_while_it_arrives(client: Client, chunks: int, sent: int) -> None:
    taken = []

    async def body() -> AsyncIterator[bytes]:
        for _ in range(chunks):
            taken.append(1)
            yield b" " * 1000

    response = client.post(FELT, content=body())
    assert "content-length" not in response.request.headers
    assert response.status_code == (413 if chunks > sent else 422)
    assert len(taken) == sent


# Any angles


angle = st.floats(allow_nan=False, allow_infinity=False)
theta = st.floats(0.0, 180.0) | angle
phi = st.floats(-720.0, 720.0) | angle
angles = st.fixed_dictionaries({"theta_i": theta, "phi_i": phi, "theta_r": theta, "phi_r": phi})


@given(angles)
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_finite_angles_are_answered_or_refused(client: Client, point: dict[str, float]) -> None:
    limits = {"theta_i": (0.0, 180.0), "phi_i": (-720.0, 720.0), "theta_r": (0.0, 180.0), "phi_r": (-720.0, 720.0)}
    outside = {name for name, (low, high) in limits.items() if not low <= point[name] <= high}
    for answer in (client.get(FELT, params=point), client.post(FELT, json=point)):
        if not outside:
            assert answer.status_code == 200
            assert 0.0 <= answer.json()["brdf"] < math.inf
        else:
            assert answer.status_code == 422
            assert answer.json()["parameter"] in outside


@given(st.binary() | st.recursive(st.none() | st.booleans() | st.floats() | st.text(), st.lists).map(json.dumps))
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_body_is_a_server_error(client: Client, junk: str | bytes) -> None:
    assert client.post(FELT, content=junk).status_code == 422
    if isinstance(junk, str):
        assert client.post(FELT, content=f'{{"theta_i": {junk}, "theta_r": 1}}').status_code in (200, 422)
