"""Lookups over HTTP: values, degrees, shapes, formats, limits, and every way to ask wrongly."""

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
from brdfdb_api.http.app import create_app
from brdfdb_api.settings import Settings
from tests.api.a_store import NPY, VISIBLE_NM, Client, client_of, degrees, npy, read_npy

FOIL = "/v1/materials/copper-foil/lookup"
FELT = "/v1/materials/grey-felt/lookup"


EXACT = {"rtol": 1e-12}  # of numbers that take the same way; the closed forms of degrees are off by 1e-15


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


def test_a_white_lambertian_is_one_over_pi(client: Client) -> None:
    brdf = client.get("/v1/materials/white-tile/lookup", params={"theta_i": 20, "theta_r": 70}).json()["brdf"]
    assert brdf == pytest.approx(1.0 / math.pi, rel=2**-24)  # stored as float32


def test_azimuths_default_to_zero(client: Client, store: Store) -> None:
    brdf = degrees(store, "grey-felt", 50, 0, 40, 0)
    assert client.get(FELT, params={"theta_i": 50, "theta_r": 40}).json()["brdf"] == brdf
    assert client.post(FELT, json={"theta_i": 50, "theta_r": 40}).json()["brdf"] == brdf


@pytest.mark.parametrize(("theta_i", "theta_r"), [(90.5, 10), (10, 180), (180, 180)])
def test_below_the_horizon(client: Client, theta_i: float, theta_r: float) -> None:
    assert client.get(FELT, params={"theta_i": theta_i, "theta_r": theta_r}).json()["brdf"] == 0.0


def test_the_horizon_itself_is_above(client: Client) -> None:
    assert client.get(FELT, params={"theta_i": 90, "theta_r": 90}).json()["brdf"] > 0.0


@pytest.mark.parametrize(
    ("wavelengths", "said"), [([], VISIBLE_NM.tolist()), ([450], 450.0), ([600, 450], [600.0, 450.0])]
)
def test_wavelengths_of_one_point(client: Client, store: Store, wavelengths: list[float], said: Any) -> None:
    answer = client.get(FOIL, params={"theta_i": 20, "theta_r": 25, "phi_r": 170, "wavelength_nm": wavelengths}).json()
    assert answer["wavelength_nm"] == said
    np.testing.assert_array_equal(answer["brdf"], degrees(store, "copper-foil", 20, 0, 25, 170, wavelength_nm=said))
    specular = store["copper-foil"].specular_reflectance(math.radians(20), said)
    np.testing.assert_array_equal(answer["specular_reflectance"], specular)


def test_azimuths_may_turn_twice_and_no_more(client: Client) -> None:
    point = {"theta_i": 40, "theta_r": 50, "phi_i": 10}
    once, turned = (client.get(FELT, params={**point, "phi_r": phi}).json()["brdf"] for phi in (130, 490))
    assert once == turned
    assert client.post(FELT, json={**point, "phi_r": 490}).json()["brdf"] == once
    for phi in (-720.25, 850, 130 + 360 * 2**44):
        answers = client.get(FELT, params={**point, "phi_r": phi}), client.post(FELT, json={**point, "phi_r": [0, phi]})
        assert [(answer.status_code, answer.json()["parameter"]) for answer in answers] == [(422, "phi_r")] * 2


def test_a_grey_material_takes_any_wavelength(client: Client, store: Store) -> None:
    point = {"theta_i": 0, "theta_r": 0, "wavelength_nm": [5, 50_000]}
    for answer in (client.get(FELT, params=point).json(), client.post(FELT, json=point).json()):
        assert answer["wavelength_nm"] == [5, 50_000]
        assert answer["brdf"] == [degrees(store, "grey-felt", 0, 0, 0, 0)] * 2
        assert answer["specular_reflectance"] == [0, 0]


@pytest.mark.parametrize("wavelength", [None, 450, [450], [600, 450]])
def test_post_broadcasts_like_numpy(client: Client, store: Store, wavelength: Any) -> None:
    body = {
        "theta_i": [[0], [30], [60]],
        "phi_i": 15,
        "theta_r": [0, 45.5, 90, 135],
        "phi_r": [[-720], [700.5], [180.25]],
    }
    answer = client.post(FOIL, json={**body, "wavelength_nm": wavelength}).json()
    assert answer["wavelength_nm"] == (VISIBLE_NM.tolist() if wavelength is None else wavelength)
    expected = degrees(store, "copper-foil", *body.values(), wavelength_nm=wavelength)
    assert expected.shape[:2] == (3, 4)
    np.testing.assert_allclose(answer["brdf"], expected, **EXACT)
    specular = store["copper-foil"].specular_reflectance(np.deg2rad(body["theta_i"]), wavelength)
    np.testing.assert_allclose(answer["specular_reflectance"], specular, **EXACT)


def test_post_of_numbers_is_get(client: Client) -> None:
    point = {"theta_i": 12.5, "phi_i": -3, "theta_r": 77, "phi_r": 181}
    assert client.post(FOIL, json=point).json() == client.get(FOIL, params=point).json()


@pytest.mark.parametrize(
    "ask", [{"params": {"format": "npy"}}, {"headers": {"Accept": "application/x-npy, */*;q=0.1"}}]
)
def test_npy_holds_the_numbers_of_json(client: Client, ask: dict[str, Any]) -> None:
    body = {"theta_i": [[5.1], [25.3]], "theta_r": [10.7, 20.9, 100], "phi_r": 33.3}
    answer = client.post(FOIL, json=body, **ask)
    assert (answer.status_code, answer.headers["content-type"]) == (200, "application/x-npy")
    brdf = read_npy(answer.content)
    assert (brdf.shape, brdf.dtype) == ((2, 3, VISIBLE_NM.size), np.float64)
    np.testing.assert_array_equal(brdf, client.post(FOIL, json=body).json()["brdf"])


def test_npy_of_one_point(client: Client) -> None:
    point = {"theta_i": 12.5, "theta_r": 77}
    brdf = read_npy(client.get(FELT, params={**point, "format": "npy"}).content)
    assert (brdf.shape, brdf.item()) == ((), client.get(FELT, params=point).json()["brdf"])


def test_format_wins_over_accept(client: Client) -> None:
    answer = client.get(
        FELT, params={"theta_i": 1, "theta_r": 2, "format": "json"}, headers={"Accept": "application/x-npy"}
    )
    assert answer.headers["content-type"] == "application/json"


@pytest.mark.parametrize(("points", "in_main_thread"), [(1000, True), (1001, False)])
def test_many_values_are_looked_up_in_a_thread(
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


@pytest.mark.parametrize(("levels", "status"), [(32, 200), (33, 422), (64, 422), (65, 422)])
def test_lists_in_lists(client: Client, levels: int, status: int) -> None:
    body = '{"theta_i": 10, "theta_r": ' + "[" * levels + "20" + "]" * levels + "}"
    answer = client.post(FELT, content=body)
    assert answer.status_code == status
    if status == 422:
        assert answer.json()["parameter"] == "theta_r"
    if levels < 64:
        degrees = np.full((1,) * levels + (4,), 10.0)
        assert client.post(FELT, content=npy(degrees), headers={"Content-Type": NPY}).status_code == status


# Wrong questions


def test_a_bad_query_names_the_parameter(client: Client) -> None:
    for query, parameter in [
        ("theta_i=200&theta_r=2", "theta_i"),
        ("theta_i=-0.001&theta_r=2", "theta_i"),
        ("theta_i=1&theta_r=180.001", "theta_r"),
        ("theta_i=nan&theta_r=2", "theta_i"),
        ("theta_i=1&theta_r=inf", "theta_r"),
        ("theta_i=1&theta_r=2&phi_i=-inf", "phi_i"),
        ("theta_i=1&theta_r=2&phi_r=nan", "phi_r"),
        ("theta_i=1&theta_r=2&phi_r=1e999", "phi_r"),
        ("theta_i=1&theta_r=2&phi_r=720.5", "phi_r"),
        ("theta_i=1&theta_r=2&phi_i=-10313", "phi_i"),
        ("theta_i=1&theta_r=2&wavelength_nm=0.55", "wavelength_nm"),
        ("theta_i=45deg&theta_r=2", "theta_i"),
        ("theta_i=&theta_r=2", "theta_i"),
        ("theta_i=1", "theta_r"),
        ("theta_r=1", "theta_i"),
        ("thetai=10&theta_r=2", "thetai"),
        ("theta_i=1&theta_r=2&phi=3", "phi"),
        ("theta_i=1&theta_i=1&theta_r=2", "theta_i"),
        ("theta_i=1&theta_r=2&wavelength_nm=200", "wavelength_nm"),
        ("theta_i=1&theta_r=2&wavelength_nm=500&wavelength_nm=701", "wavelength_nm"),
        ("theta_i=1&theta_r=2&wavelength_nm=green", "wavelength_nm"),
        ("theta_i=1&theta_r=2&wavelength_nm=nan", "wavelength_nm"),
        ("theta_i=1&theta_r=2&format=csv", "format"),
    ]:
        problem = client.problem("GET", f"{FOIL}?{query}", 422)
        assert problem["parameter"] == parameter
        assert problem["detail"].startswith(f"{parameter}: ")


def test_a_bad_body_names_the_parameter(client: Client) -> None:
    for body, parameter in [
        ('{"theta_i": NaN, "theta_r": 2}', "theta_i"),
        ('{"theta_i": 1, "theta_r": [2, -Infinity]}', "theta_r"),
        ('{"theta_i": 1, "theta_r": 1e999}', "theta_r"),
        ('{"theta_i": 1, "theta_r": 2, "phi_r": [[1], [NaN]]}', "phi_r"),
        ('{"theta_i": [1, 181], "theta_r": 2}', "theta_i"),
        ('{"theta_i": -1, "theta_r": 2}', "theta_i"),
        ('{"theta_i": "45", "theta_r": 2}', "theta_i"),
        ('{"theta_i": [1, "45"], "theta_r": 2}', "theta_i"),
        ('{"theta_i": true, "theta_r": 2}', "theta_i"),
        ('{"theta_i": [1, [2, true]], "theta_r": 2}', "theta_i"),
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
        ('{"theta_i": 1, "theta_r": 2, "thetai": 3}', "thetai"),
        ('{"theta_i": 1, "theta_r": 2, "wavelength_nm": []}', "wavelength_nm"),
        ('{"theta_i": 1, "theta_r": 2, "wavelength_nm": [[500]]}', "wavelength_nm"),
        ('{"theta_i": 1, "theta_r": 2, "wavelength_nm": "500"}', "wavelength_nm"),
        ('{"theta_i": 1, "theta_r": 2, "wavelength_nm": NaN}', "wavelength_nm"),
        ('{"theta_i": 1, "theta_r": 2, "wavelength_nm": [500, 399]}', "wavelength_nm"),
    ]:
        problem = client.problem("POST", FOIL, 422, content=body)
        assert problem["parameter"] == parameter
        assert problem["detail"].startswith(f"{parameter}: ")


def test_a_body_that_is_no_object(client: Client) -> None:
    for body in [b"", b"theta_i=1", b"[1, 2]", b"null", b'{"theta_i": 1', b"\xff\xfe{", b"[" * 50_000, b"{" * 20]:
        problem = client.problem("POST", FOIL, 422, content=body)
        assert "JSON" in problem["detail"]
        assert problem["parameter"] == "body"


def test_the_body_is_not_echoed(client: Client) -> None:
    for body in ('{"theta_i": "secret", "theta_r": 2}', '["secret"]', '{"theta_i": secret}'):
        assert "secret" not in json.dumps(client.problem("POST", FOIL, 422, content=body))


def test_a_name_that_is_no_text(client: Client) -> None:
    problem = client.problem("POST", FOIL, 422, content='{"\\ud800": NaN, "theta_i": 1, "theta_r": 2}')
    assert problem["detail"].startswith("\\ud800: unknown parameter")
    assert len(client.problem("POST", FOIL, 422, json={"x" * 90_000: 1})["parameter"]) == 40


def test_the_number_is_told_in_full(client: Client) -> None:
    problem = client.problem("GET", f"{FOIL}?theta_i=1&theta_r=180.00000000000003", 422)
    assert problem["detail"] == "theta_r: '180.00000000000003' must be at most 180"


@pytest.mark.parametrize(
    "error",
    [
        ValueError("cannot reshape array of size 7 into shape (3,)"),
        ValueError("wavelength_nm: a sentence that names a parameter is not an error about it"),
        ParameterError("specular", "shape (3,) is not (2,)"),  # no client names this parameter
    ],
)
def test_an_error_about_no_parameter_of_the_request_is_ours(
    error: Exception, client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any, **__: Any) -> Any:
        raise error

    monkeypatch.setattr(Table, "lookup", fail)
    problem = client.problem("GET", f"{FOIL}?theta_i=1&theta_r=2", 500)
    assert str(error) not in problem["detail"]
    assert "parameter" not in problem


def test_shapes_that_do_not_broadcast(client: Client) -> None:
    problem = client.problem("POST", FOIL, 422, json={"theta_i": [1, 2], "theta_r": [1, 2, 3]})
    assert problem["parameter"] == "theta_r"
    assert "theta_i (2,)" in problem["detail"]
    assert "theta_r (3,)" in problem["detail"]


def test_unknown_query_of_a_post(client: Client) -> None:
    problem = client.problem("POST", f"{FOIL}?theta_i=3", 422, json={"theta_i": 1, "theta_r": 2})
    assert (
        problem["detail"]
        == "theta_i: unknown parameter; allowed are output, illuminant, format, from, error, stokes, wavelength_nm"
    )


def test_unknown_material_of_a_post(client: Client) -> None:
    body = {"theta_i": 1, "theta_r": 2}
    assert client.problem("POST", "/v1/materials/grey-fell/lookup", 404, json=body)["closest"][0] == "grey-felt"


# Limits: the application under test allows 1000 points and a body of 100 kB


def outer(n: int, m: int) -> dict[str, Any]:
    """The body of n x m points."""
    return {"theta_i": [[1]] * n, "theta_r": [2] * m}


def test_points_in_one_answer(client: Client) -> None:
    assert client.post(FELT, json=outer(20, 50)).status_code == 200
    said = client.problem("POST", FELT, 413, json=outer(7, 143))["detail"]
    assert said == "1001 points are more than the 1000 that one json answer may hold; format=npy may hold more"
    assert client.post(FELT, json=outer(7, 143), params={"format": "npy"}).status_code == 200
    assert client.post(FELT, json=outer(200, 500), params={"format": "npy"}).status_code == 200
    client.problem("POST", FELT, 413, json=outer(201, 500), params={"format": "npy"})
    client.problem("POST", FELT, 413, json={**outer(10_000, 1), "phi_i": [2] * 10_000})


def test_wavelengths_count_too(client: Client) -> None:
    body = {**outer(1, 1000), "wavelength_nm": [500] * 101}
    assert "101000 values" in client.problem("POST", FOIL, 413, json=body)["detail"]
    assert client.post(FOIL, json={**outer(1, 990), "wavelength_nm": [500] * 101}).status_code == 200


def test_a_large_body(client: Client) -> None:
    client.problem("POST", FELT, 413, content=b" " * 100_001)
    assert client.post(FELT, content=b'{"theta_i": 1, "theta_r": 2}'.ljust(100_000)).status_code == 200


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


def test_default_limits() -> None:
    app = create_app(Settings())
    assert (app.state.settings.max_points, app.state.settings.max_body_bytes) == (10_000, 67_108_864)
