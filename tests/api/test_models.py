"""Models at the parameters of a request, families, and several materials at once."""

from __future__ import annotations

import io
import json
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb.materials import Material, presets
from brdfdb.models import MODELS
from brdfdb.spectra import PICTURE_NM, colour_weights
from brdfdb.store import family_records
from brdfdb.store.family import Sweep
from brdfdb.store.publication import publish_dataset
from brdfdb.tables.albedo import source_albedo
from brdfdb.tables.evaluation import view_directions
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import tabulate
from tests.api.a_store import GREY, NPY, Client, client_of, publish, read_npy

COPPER = {"parameters": {"sigma_0_um": 0.1, "tau_um": 2.0}, "refractive_index": "main/Cu/Johnson"}
BRASS = {"parameters": {"rho_d": 0.1, "rho_s": 0.33, "alpha_x": 0.05, "alpha_y": 0.16}}
PLASTER = {"parameters": {"rho": 0.5, "sigma_deg": 20.0}}
TILE = {"parameters": {"rho": 0.5}}
POINTS = {"theta_i": 40, "phi_i": 10, "theta_r": [[0], [30]], "phi_r": [170, 200, 300]}
GIVEN = [("he_torrance", COPPER), ("ward", BRASS), ("oren_nayar", PLASTER)]


def material(model: str, body: dict[str, Any]) -> Material:
    return Material.from_table("same", {"title": "The same", "source": "a test", "model": model, **body})


def test_models_have_units_ranges_and_what_papers_publish(client: Client) -> None:
    models = {model["name"]: model for model in client.get("/v1/models").json()["models"]}
    assert list(models) == list(MODELS)
    ward = client.get(models["ward"]["href"]).json()
    assert ward == models["ward"]
    alpha = next(parameter for parameter in ward["parameters"] if parameter["name"] == "alpha_x")
    papers = {name: preset.parameters["alpha_x"] for name, preset in presets().items() if preset.model == "ward"}
    assert {mark["material"]: mark["value"] for mark in alpha["published"]} == papers
    assert alpha["typical"] == [min(papers.values()), max(papers.values())]
    assert (alpha["low"], alpha["high"], alpha["default"]) == (1e-6, 2.0, None)
    sigma = next(each for each in models["oren_nayar"]["parameters"] if each["name"] == "sigma_deg")
    assert (sigma["unit"], sigma["high"]) == ("degree", 90.0)
    assert all(0.0 <= mark["value"] < 90.0 for mark in sigma["published"])


@pytest.mark.parametrize(("model", "body"), GIVEN)
def test_a_model_is_evaluated_as_python_does(client: Client, model: str, body: dict[str, Any]) -> None:
    same, at = material(model, body), None if model != "he_torrance" else PICTURE_NM
    answer = client.post(f"/v1/models/{model}/lookup", json={**body, **POINTS})
    assert answer.headers["cache-control"] == "no-store"
    document = answer.json()
    values = np.asarray(same.lookup(*(np.deg2rad(angle) for angle in POINTS.values()), at))
    np.testing.assert_allclose(document["brdf"], values, rtol=1e-12)
    assert document["wavelength_nm"] == (None if at is None else at.tolist())
    assert document["parameters"] == same.file_parameters()
    assert (document["model"], document["model_version"]) == (model, MODELS[model].version)
    colour = {"output": "linear-srgb", "illuminant": "A", "format": "npy"}
    mixed = read_npy(client.post(f"/v1/models/{model}/lookup", json={**body, **POINTS}, params=colour).content)
    values = values[..., np.newaxis] if at is None else values
    np.testing.assert_allclose(mixed, values @ colour_weights("linear-srgb", at, "A"), rtol=1e-12, atol=1e-15)
    for view in ("cut", "hemisphere"):
        query = {"view": view, "theta_i": 30, "phi_i": 5, "wavelength_nm": 550}
        lobe = client.post(f"/v1/models/{model}/lobe", json=body, params=query).json()
        axes, angles = view_directions(view, 30.0, 5.0)  # type: ignore[arg-type]
        assert {key: np.array(values).tolist() for key, values in axes.items()} == lobe["axes_deg"]
        np.testing.assert_allclose(lobe["brdf"], same.lookup(*angles, 550.0), rtol=1e-12)


def test_the_albedo_of_a_model(client: Client) -> None:
    white = client.post("/v1/models/lambert/albedo", json={"parameters": {"rho": 1.0}}).json()
    np.testing.assert_allclose(white["albedo"], 1.0, rtol=1e-6)
    np.testing.assert_allclose(white["hemispherical"], 1.0, rtol=1e-6)
    copper = client.post("/v1/models/he_torrance/albedo", json=COPPER, params={"wavelength_nm": [450, 650]}).json()
    same, at = material("he_torrance", COPPER), np.array([450.0, 650.0])
    row = copper["theta_i"].index(45.0)
    expected = source_albedo(same, np.pi / 4.0, 0.0, at, tolerance=1e-6).albedo
    np.testing.assert_allclose(copper["albedo"][row], expected, atol=1e-3)
    specular = same.specular_reflectance(np.pi / 4.0, at)
    np.testing.assert_allclose(copper["specular_reflectance"][row], specular, rtol=1e-12)


def test_spheres_of_models(client: Client) -> None:
    def sphere(rho: float, file_format: str) -> Any:
        query = {"size": 32, "format": file_format}
        return client.post("/v1/models/lambert/sphere", json={"parameters": {"rho": rho}}, params=query)

    dark, light = (pixels(sphere(rho, "png").content) for rho in (0.2, 0.8))
    assert dark.shape == (32, 32, 4)
    assert dark[0, 0, 3] == 0 < dark[16, 16, 3] == 255
    assert dark[16, 16, 0] < light[16, 16, 0]
    answer = sphere(0.8, "npy")
    linear = read_npy(answer.content)
    assert (answer.headers["content-type"], linear.dtype, linear.shape) == (NPY, np.float32, (32, 32, 4))
    srgb = 255.0 * (1.055 * linear[16, 16, :3] ** (1 / 2.4) - 0.055)  # IEC 61966-2-1
    np.testing.assert_allclose(light[16, 16, :3], srgb, atol=0.51)


def pixels(content: bytes) -> np.ndarray:
    """The pixels of a PNG file that this project writes: 8 bits, four channels, no filters."""
    width, height = struct.unpack(">2I", content[16:24])
    start = content.index(b"IDAT") + 4
    (length,) = struct.unpack(">I", content[start - 8 : start - 4])
    rows = np.frombuffer(zlib.decompress(content[start : start + length]), np.uint8).reshape(height, -1)
    assert not rows[:, 0].any()
    return rows[:, 1:].reshape(height, width, 4)


def test_refused_models_name_the_parameter(client: Client) -> None:
    many = "&".join(["wavelength_nm=500"] * 500)
    for path, body, status, parameter in [
        ("ward/lobe", {"parameters": BRASS["parameters"] | {"rho_s": 2}}, 422, "rho_s"),
        ("oren_nayar/lobe", {"parameters": {"rho": 0.5, "sigma": 20}}, 422, "sigma"),
        ("oren_nayar/lobe", {"parameters": {"rho": 0.5}}, 422, "sigma_deg"),
        ("oren_nayar/lobe", {"parameters": {"rho": 0.5, "sigma_deg": 91}}, 422, "sigma_deg"),
        ("he_torrance/lobe", {"parameters": COPPER["parameters"]}, 422, "refractive_index"),
        ("he_torrance/sphere", {**COPPER, "refractive_index": "main/Cx/Q"}, 422, "refractive_index"),
        ("he_torrance/lobe?wavelength_nm=9", COPPER, 422, "wavelength_nm"),
        ("lambert/lobe", {}, 422, "parameters"),
        ("lambert/lobe", {"parameters": [1]}, 422, "parameters"),
        ("lambert/lobe", {"parameters": {"rho": "red"}}, 422, "rho"),
        ("lambert/lobe", {"parameters": {"rho": {"csv": "/etc/hostname"}}}, 422, "rho"),  # no file is read
        ("lambert/lobe", TILE | {"rho": 1}, 422, "rho"),
        ("lambert/sphere?size=513", TILE, 422, "size"),
        ("lambert/lookup", TILE | {"theta_i": 3}, 422, "theta_r"),
        ("lambert/lookup?from=table", TILE, 422, "from"),
        ("lambert/albedo?wavelength_nm=nan", TILE, 422, "wavelength_nm"),
        ("oren_nayar/lookup", {**PLASTER, "theta_i": [[1]] * 7, "theta_r": [2] * 143}, 413, None),
        (f"he_torrance/lobe?view=hemisphere&{many}", COPPER, 413, None),
    ]:
        problem = client.problem("POST", f"/v1/models/{path}", status, json=body)
        assert problem.get("parameter") == parameter, path
        assert parameter is None or problem["detail"].startswith(f"{parameter}: "), path
        assert "request" not in problem["detail"], path
        assert "hostname" not in problem["detail"], path


def test_names_that_are_no_text_or_very_long_are_shown_in_part(client: Client) -> None:
    for name in ("\\ud800", "a" * 60_000):
        body = f'{{"parameters": {{"{name}": 1, "rho": 0.5}}, "theta_i": 1, "theta_r": 1}}'
        problem = client.problem("POST", "/v1/models/lambert/lookup", 422, content=body)
        assert len(problem["detail"]) <= 2000
        assert len(problem["parameter"]) <= 100


def test_a_family_between_its_members(tmp_path: Path) -> None:
    members = {"tile-0": 0.2, "tile-1": 0.4, "tile-2": 0.8}
    axes = {"rho": [*members.values()]}
    hashes = ["0" * 64] * 3
    sweep = Sweep(name="tiles", title="Tiles", model="lambert", axes=axes, members=[*members], request_sha256=hashes)
    for name, rho in members.items():
        about = {"title": name, "model": "lambert", "source": "a test", "parameters": {"rho": rho}}
        dataset = tabulate(Layout(Material.from_table(name, about), GREY))
        publish_dataset(tmp_path, name, dataset.assign_attrs(request_sha256="0" * 64))
    publish(tmp_path, "other", "lambert", rho=0.5)
    family_records.write_family(str(tmp_path), sweep)
    client = client_of(tmp_path)
    assert client.get("/v1/families").json()["families"] == [sweep.model_dump(exclude={"request_sha256"})]
    lines = client.get("/v1/materials?family=tiles").json()["materials"]
    assert [line["name"] for line in lines] == sweep.members
    body = {"parameters": {"rho": 0.3}, "theta_i": 20, "theta_r": [10, 60]}
    answer = client.post("/v1/families/tiles/lookup?error=true", json=body).json()
    np.testing.assert_allclose(answer["brdf"], 0.3 / np.pi, rtol=1e-6)
    assert (answer["source"], answer["family"], answer["parameters"]) == ("family", "tiles", {"rho": 0.3})
    assert np.shape(answer["error"]) == (2,)
    for parameters, parameter in (({"rho": 0.9}, "rho"), ({}, "rho"), ({"sigma_deg": 3.0}, "sigma_deg")):
        problem = client.problem("POST", "/v1/families/tiles/lookup", 422, json=body | {"parameters": parameters})
        assert problem["detail"].startswith(f"{parameter}: ")
    assert client.problem("POST", "/v1/families/tile/lookup", 404, json=body)["closest"] == ["tiles"]
    assert client.problem("GET", "/v1/materials?family=tile", 404)["closest"] == ["tiles"]


# Several materials


def test_several_materials_in_one_request(client: Client) -> None:
    body = {"theta_i": 20, "theta_r": [10, 60], "phi_r": 170}
    names = ["copper-foil", "grey-felt"]
    answer = client.post("/v1/lookup", json={**body, "materials": names}, params={"error": "true"}).json()
    for name, found in zip(names, answer["materials"], strict=True):
        assert found == client.post(f"/v1/materials/{name}/lookup?error=true", json=body).json()
    packed = client.post("/v1/lookup", json={**body, "materials": names}, params={"error": "true", "format": "npz"})
    arrays = np.load(io.BytesIO(packed.content))
    assert sorted(arrays) == ["copper-foil", "copper-foil.error", "grey-felt", "grey-felt.error"]
    np.testing.assert_array_equal(arrays["copper-foil"], answer["materials"][0]["brdf"])
    np.testing.assert_array_equal(arrays["grey-felt.error"], answer["materials"][1]["error"])


def test_several_materials_are_answered_together_or_not_at_all(client: Client) -> None:
    for materials, parameter in [
        ([], "materials"),
        ("grey-felt", "materials"),
        (["grey-felt", "white-tile", "grey-felt"], "materials"),  # names are not merged
        (["brushed-metal", "white-tile"], "error"),  # the tile states none
    ]:
        body = {"theta_i": 1, "theta_r": 2, "materials": materials}
        problem = client.problem("POST", "/v1/lookup?error=true", 422, json=body)
        assert problem["parameter"] == parameter, materials
    names = ["copper-foil", "grey-felt", "white-tile", "brushed-metal"]
    body = {"theta_i": 1, "theta_r": [2] * 900, "wavelength_nm": [500] * 101, "materials": names}
    assert "of all materials" in client.problem("POST", "/v1/lookup", 413, json=body)["detail"]
    assert json.loads(client.post("/v1/lookup", json={**body, "materials": names[:1]}).content)["materials"]
