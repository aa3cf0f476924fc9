"""Albedos, lobes, slices and verdicts: what a page shows of a material."""

from __future__ import annotations

import io
import json
import math
import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest

from brdfdb import formats
from brdfdb.formats.exr import write_slice
from brdfdb.geometry import directions_from_half_difference
from brdfdb.scenes import lit_sphere
from brdfdb.spectra import srgb_weights
from brdfdb.store.reader import Store
from brdfdb.store.summary_words import last_audit
from brdfdb.tables import slices
from brdfdb.tables.albedo import directional_albedo
from brdfdb_pipelines import cli
from tests.api.a_store import NPY, VISIBLE_NM, Client, client_of, degrees, pinned_of, publish, read_npy

FOIL, FELT, TILE, METAL = (
    f"/v1/materials/{name}" for name in ("copper-foil", "grey-felt", "white-tile", "brushed-metal")
)
EXACT = {"rtol": 1e-12}


# Albedo


def test_a_white_tile_reflects_everything(client: Client) -> None:
    albedo = client.get(f"{TILE}/albedo").json()
    np.testing.assert_allclose(albedo["albedo"], 1.0, rtol=2**-23)  # stored as float32
    np.testing.assert_allclose(albedo["hemispherical"], 1.0, rtol=2**-23)
    assert not np.any(albedo["specular_reflectance"])
    assert albedo["wavelength_nm"] is None


def test_albedo_is_that_of_the_table(client: Client, store: Store) -> None:
    albedo = client.get(f"{FOIL}/albedo").json()
    table = store["copper-foil"]
    expected = directional_albedo(table)
    assert albedo["wavelength_nm"] == VISIBLE_NM.tolist()
    np.testing.assert_array_equal(albedo["theta_i"], expected.theta_i_deg)
    np.testing.assert_array_equal(albedo["albedo"], expected.mean)
    specular = table.specular_reflectance(np.deg2rad(albedo["theta_i"]))
    np.testing.assert_allclose(albedo["specular_reflectance"], specular, **EXACT)
    whole = np.array(albedo["albedo"]) + albedo["specular_reflectance"]
    assert np.all(whole.min(axis=0) <= albedo["hemispherical"])
    assert np.all(albedo["hemispherical"] <= whole.max(axis=0))


# Lobes


@pytest.mark.parametrize("name", ["copper-foil", "grey-felt", "brushed-metal"])
def test_a_cut_is_lookups_at_its_axis(client: Client, store: Store, name: str) -> None:
    lobe = client.get(f"/v1/materials/{name}/lobe?theta_i=40&phi_i=20").json()
    theta_r = np.array(lobe["axes_deg"]["theta_r"])
    assert (theta_r[0], theta_r[-1]) == (-90.0, 90.0)
    assert {40.0, 40.5, 39.5, -40.0} <= set(theta_r)
    expected = degrees(store, name, 40, 20, np.abs(theta_r), np.where(theta_r > 0, 200, 20))
    np.testing.assert_allclose(lobe["brdf"], expected, **EXACT)
    specular = store[name].specular_reflectance(math.radians(40))
    np.testing.assert_array_equal(lobe["specular_reflectance"], specular)


def test_a_hemisphere_is_lookups_at_its_axes(client: Client, store: Store) -> None:
    lobe = client.get(f"{METAL}/lobe?view=hemisphere&theta_i=40&phi_i=20").json()
    theta_r, delta_phi = (np.array(lobe["axes_deg"][axis]) for axis in ("theta_r", "delta_phi"))
    assert (theta_r[0], theta_r[-1], delta_phi[0], delta_phi[-1]) == (0.0, 90.0, 0.0, 360.0)
    expected = degrees(store, "brushed-metal", 40, 20, theta_r[:, None], 20 + delta_phi)
    np.testing.assert_allclose(lobe["brdf"], expected, **EXACT)


def test_half_and_difference_angles_are_lookups_at_their_axes(client: Client, store: Store) -> None:
    lobe = client.get(f"{FELT}/lobe?view=half-difference&phi_i=20").json()
    axes = lobe["axes_deg"]
    assert axes["theta_h"] == axes["theta_d"] == (np.arange(90) + 0.5).tolist()
    theta_h, theta_d = np.deg2rad(axes["theta_h"])[:, None], np.deg2rad(axes["theta_d"])
    directions = directions_from_half_difference(theta_h, math.radians(20), theta_d, math.pi / 2)
    np.testing.assert_allclose(lobe["brdf"], store["grey-felt"].lookup(*directions), **EXACT)
    assert lobe["theta_i"] is lobe["specular_reflectance"] is None


def test_a_lobe_in_colour_at_wavelengths_and_as_npy(client: Client) -> None:
    spectra = np.array(client.get(f"{FOIL}/lobe").json()["brdf"])
    colour = client.get(f"{FOIL}/lobe?output=linear-srgb&illuminant=A").json()
    of = srgb_weights(tuple(VISIBLE_NM.tolist()), "A")
    np.testing.assert_allclose(colour["brdf"], spectra @ of, **EXACT)
    assert colour["illuminant"] == "A"
    two = client.get(f"{FOIL}/lobe?wavelength_nm=700&wavelength_nm=400").json()
    np.testing.assert_array_equal(two["brdf"], spectra[:, [-1, 0]])
    np.testing.assert_array_equal(read_npy(client.get(f"{FOIL}/lobe?format=npy").content), spectra)


def test_a_lobe_is_npy_for_those_who_accept_it(client: Client) -> None:
    asked = {"Accept": NPY}
    binary, named = (client.get(f"{FOIL}/lobe{query}", headers=asked) for query in ("", "?format=json"))
    assert [answer.headers["content-type"] for answer in (binary, named)] == [NPY, "application/json"]
    np.testing.assert_array_equal(read_npy(binary.content), named.json()["brdf"])


def test_a_lobe_states_its_error_as_a_lookup_does(client: Client) -> None:
    document = client.get(f"{FOIL}/lobe?error=true").json()
    assert np.shape(document["error"]) == np.shape(document["brdf"])
    array = read_npy(client.get(f"{FOIL}/lobe?error=true&format=npy").content)
    np.testing.assert_allclose(array, [document["brdf"], document["error"]], rtol=1e-12)


def test_a_bad_lobe_names_the_parameter(client: Client) -> None:
    for query, parameter in [
        ("theta_i=91", "theta_i"),
        ("theta_i=nan", "theta_i"),
        ("phi_i=721", "phi_i"),
        ("view=top", "view"),
        ("theta_r=3", "theta_r"),
        ("wavelength_nm=200", "wavelength_nm"),
        ("output=rgb", "output"),
        ("error=true&from=model", "error"),
    ]:
        assert client.problem("GET", f"{FOIL}/lobe?{query}", 422)["parameter"] == parameter


@pytest.mark.parametrize(("view", "most"), [("half-difference", 100), ("hemisphere", 150)])
def test_a_lobe_at_more_wavelengths_than_an_answer_holds_is_refused(client: Client, view: str, most: int) -> None:
    # 810 000 values: the 8100 points of the largest view, and 100 numbers of JSON for each
    answers = [
        client.get(f"{FELT}/lobe?view={view}&" + "&".join(["wavelength_nm=500"] * count)).status_code
        for count in (most, 2 * most)
    ]
    assert answers == [200, 413]


# Slices


@pytest.mark.parametrize(
    ("query", "kind"),
    [
        ("", "lobe"),
        ("?kind=lobe&theta_i=30&phi_i=10", "lobe"),
        ("?kind=in_plane", "in_plane"),
        ("?kind=half_difference", "half_difference"),
    ],
)
@pytest.mark.parametrize("address", [FOIL, FELT])
def test_a_slice_is_what_the_export_writes(
    client: Client, store: Store, tmp_path: Path, address: str, query: str, kind: str
) -> None:
    answer = client.get(f"{address}/export/exr{query}")
    name = address.rpartition("/")[2]
    assert answer.headers["content-disposition"] == f'attachment; filename="{name}_{kind}.exr"'
    at = (30.0, 10.0) if "theta_i" in query else (45.0, 0.0)
    image = {
        "lobe": lambda: slices.lobe_map(store[name], theta_i_deg=at[0], phi_i_deg=at[1]),
        "in_plane": lambda: slices.in_plane_slice(store[name], phi_i_deg=0.0),
        "half_difference": lambda: slices.half_difference_slice(store[name], phi_h_deg=0.0),
    }[kind]()
    write_slice(tmp_path / "expected.exr", image, store[name])
    found, expected = (
        pixels(content, tmp_path) for content in (answer.content, (tmp_path / "expected.exr").read_bytes())
    )
    assert found.keys() == expected.keys()
    for channel, values in expected.items():
        assert values.dtype == np.float32
        np.testing.assert_array_equal(found[channel], values)


def test_a_slice_of_16_bits(client: Client, tmp_path: Path) -> None:
    channels = pixels(client.get(f"{FELT}/export/exr?half=true").content, tmp_path)
    assert {values.dtype for values in channels.values()} == {np.dtype(np.float16)}


def pixels(content: bytes, folder: Path) -> dict[str, Any]:
    """The channels of an EXR file."""
    (folder / "read.exr").write_bytes(content)
    with OpenEXR.File(str(folder / "read.exr"), separate_channels=True) as file:
        return {name: channel.pixels.copy() for name, channel in file.channels().items()}


@pytest.mark.parametrize("query", ["kind=map", "theta_i=-1", "half=perhaps", "wavelength_nm=500"])
def test_a_bad_slice_names_the_parameter(client: Client, query: str) -> None:
    assert client.problem("GET", f"{FOIL}/export/exr?{query}", 422)["parameter"] == query.partition("=")[0]


# Files of other formats


def test_a_file_and_its_record_are_one_archive(client: Client, tmp_path: Path) -> None:
    answer = client.get(f"{FELT}/export/fred?tolerance=0.1")
    assert answer.headers["content-type"] == "application/zip"
    assert answer.headers["content-disposition"] == 'attachment; filename="grey-felt.fred.txt.zip"'
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.namelist() == ["grey-felt.fred.txt", "grey-felt.fred.txt.json"]
        archive.extractall(tmp_path)
    reading = formats.read(tmp_path / "grey-felt.fred.txt")
    assert reading.record["name"] == "grey-felt"
    assert reading.record["error_of_file"]["p99"] <= 0.1


def test_a_table_that_a_format_cannot_hold_is_refused(client: Client) -> None:
    detail = client.problem("GET", f"{METAL}/export/fred", 422)["detail"]
    assert detail == "brushed-metal: the table is anisotropic, and only isotropic tables are written in this format"
    assert client.problem("GET", f"{FOIL}/export/fred?wavelength=900", 422)["parameter"] == "wavelength"


def test_the_tag_of_a_file_changes_with_the_verdict(own: Path) -> None:
    client, address = client_of(own), f"{TILE}/export/csv"
    before = client.get(address)
    assert "# audit: not audited" in before.text
    held = {"if-none-match": before.headers["etag"]}
    assert client.get(address, headers=held).status_code == 304
    report(own)
    after = client.get(address, headers=held)
    assert after.status_code == 200
    assert "# audit: passes" in after.text


# Verdicts


ANSWERS = {
    key: {"word": word, "text": "yes", "reason": "it does"}
    for key, word in (("as_published", "passes"), ("conserves_energy", "conserves"))
}


def report(root: Path, revision: str = "r000001", when: str = "2026-11-21T12:00:00Z") -> dict[str, Any]:
    """Write what an audit of the white tile would, as far as the service reads it."""
    sentence = {"finding": "energy", "title": "Energy", "word": "conserves", "text": "it reflects 1 at all angles"}
    finding = {
        "material": "white-tile",
        "revision": revision,
        "model": "lambert",
        "verdict": "passes",
        "findings": {"energy": {"verdict": "conserves"}},
        "sentences": [sentence],
        **ANSWERS,
    }
    document = {"format": "brdfdb-audit", "when": when, "materials": [finding]}
    (root / "audit.json").write_text(json.dumps(document), encoding="utf-8")
    return finding


def test_the_verdict_of_the_last_audit(own: Path) -> None:
    client = client_of(own)
    assert "no audit of it is here" in client.problem("GET", f"{TILE}/audit", 404)["detail"]
    finding = report(own)
    answer = client.get(f"{TILE}/audit").json()
    assert answer == {
        "material": "white-tile",
        "revision": "r000001",
        "current": True,
        "when": "2026-11-21T12:00:00Z",
        "finding": finding,
    }
    assert client.get(f"{TILE}/revisions/r000001/audit").json() == answer
    assert client.get(TILE).json()["audit"] == {
        "verdict": "passes",
        **ANSWERS,
        "model": "lambert",
        "sentences": finding["sentences"],
        "revision": "r000001",
        "current": True,
        "when": "2026-11-21T12:00:00Z",
    }
    lines = {line["name"]: line["verdict"] for line in client.get("/v1/materials").json()["materials"]}
    assert (lines["white-tile"], lines["grey-felt"]) == ("passes", None)
    line = next(line for line in client.get("/v1/materials?q=white").json()["materials"])
    assert {key: line[key] for key in ANSWERS} == ANSWERS
    client.problem("GET", f"{FELT}/audit", 404)


def test_a_verdict_of_another_store_with_the_same_number_is_not_shown(own: Path, tmp_path: Path) -> None:
    finding = report(own)
    document = {
        "when": "2026-11-21T12:00:00Z",
        "materials": [finding | {"manifest_sha256": Store(own)["white-tile"].digest}],
    }
    (own / "audit.json").write_text(json.dumps(document), encoding="utf-8")
    client = client_of(own)
    pinned = pinned_of(Store(own), "white-tile")
    assert client.get(f"{TILE}/revisions/{pinned}/audit").json()["finding"]["verdict"] == "passes"
    written = "passes" in client.get(f"{TILE}/export/csv?resolution=45").text
    assert (last_audit(own)["white-tile", "r000001"].as_published, written) == ("yes", True)
    shutil.rmtree(own / "materials" / "white-tile")
    assert publish(own, "white-tile", "lambert", rho=0.5) == "r000001"
    client.problem("GET", f"{TILE}/audit", 404)
    assert client.get(TILE).json()["audit"] is None
    assert "passes" not in client.get(f"{TILE}/export/csv?resolution=45").text
    line = next(line for line in client.get("/v1/materials?q=white").json()["materials"])
    assert line["verdict"] is None
    assert last_audit(own) == {}
    (own / "audit.json").rename(tmp_path / "other.json")
    out = ("--store", str(own), "--out", str(tmp_path / "out"), "--resolution", "45")
    assert cli.main(["export", "csv", "white-tile", "--audit", str(tmp_path / "other.json"), *out]) == 0
    assert "not audited" in (tmp_path / "out" / "white-tile.csv").read_text()


def test_an_audit_that_lacks_an_answer_is_none(own: Path) -> None:
    report(own)
    document = json.loads((own / "audit.json").read_text(encoding="utf-8"))
    del document["materials"][0]["conserves_energy"]
    document["materials"][0]["as_published"] = {"word": 1}
    (own / "audit.json").write_text(json.dumps(document), encoding="utf-8")
    line = next(line for line in client_of(own).get("/v1/materials?q=white").json()["materials"])
    assert (line["verdict"], line["as_published"], line["conserves_energy"]) == (None, None, None)


def test_a_verdict_of_another_revision_says_so(own: Path) -> None:
    report(own)
    client = client_of(own)
    tags = [client.get(address).headers["etag"] for address in (TILE, f"{TILE}/audit")]
    publish(own, "white-tile", "lambert", rho=0.5)
    assert client.get(f"{TILE}/audit").json()["current"] is False
    assert client.get(TILE).json()["audit"]["current"] is False
    line = next(line for line in client.get("/v1/materials?q=white").json()["materials"])
    assert line["verdict"] is None
    client.problem("GET", f"{TILE}/revisions/r000002/audit", 404)
    report(own, "r000002", "2026-11-22T12:00:00Z")
    for address, tag in zip((TILE, f"{TILE}/audit"), tags, strict=True):
        assert client.get(address, headers={"If-None-Match": tag}).status_code == 200
    assert client.get(TILE).json()["audit"]["current"] is True


@pytest.mark.parametrize("content", ["", "{}", "[]", '{"when": "", "materials": [1]}', '{"materials": {}}'])
def test_a_report_that_is_none_is_no_verdict(own: Path, content: str) -> None:
    (own / "audit.json").write_text(content)
    client = client_of(own)
    assert client.get(TILE).json()["audit"] is None
    client.problem("GET", f"{TILE}/audit", 404)


# Pictures


@pytest.mark.parametrize("address", [FOIL, METAL])
def test_thumbnails_are_kept_and_change_with_the_table(
    own: Path, monkeypatch: pytest.MonkeyPatch, address: str
) -> None:
    drawn = []
    draw = lit_sphere.sphere_png
    monkeypatch.setattr(lit_sphere, "sphere_png", lambda *given: drawn.append(given) or draw(*given))
    client = client_of(own)
    first = client.get(f"{address}/thumbnail.png?size=32")
    assert first.content == draw(Store(own)[address.rpartition("/")[2]], 32, lit_sphere.DRAFT)
    assert (first.headers["content-type"], first.headers["cache-control"]) == ("image/png", "no-cache")
    held = {"If-None-Match": first.headers["etag"]}
    assert client.get(f"{address}/thumbnail.png?size=32", headers=held).status_code == 304
    assert client.get(f"{address}/revisions/r000001/thumbnail.png?size=32").content == first.content
    assert len(drawn) == 1
    publish(own, address.rpartition("/")[2], "lambert", rho=0.5)
    again = client.get(f"{address}/thumbnail.png?size=32", headers=held)
    assert (again.status_code, len(drawn)) == (200, 2)
    assert again.content != first.content


def test_one_thumbnail_of_a_table_is_kept(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn, draw = [], lit_sphere.sphere_png
    monkeypatch.setattr(
        lit_sphere, "sphere_png", lambda table, size, detail: drawn.append(size) or draw(table, size, detail)
    )
    for size in (16, 16, 17, 16):
        assert client.get(f"{TILE}/thumbnail.png?size={size}").status_code == 200
    assert drawn == [16, 17, 16]


def test_a_sphere_is_that_of_the_table(client: Client, store: Store) -> None:
    answer = client.get(f"{FOIL}/sphere?size=24&format=npy")
    expected = lit_sphere.linear_sphere(store["copper-foil"], 24, detail=lit_sphere.DRAFT)
    np.testing.assert_array_equal(read_npy(answer.content), expected.astype(np.float32))
    assert client.get(f"{FOIL}/sphere").content.startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "query", ["sphere?size=15", "sphere?format=jpg", "thumbnail.png?size=257", "thumbnail.png?light=1"]
)
def test_a_bad_picture_names_the_parameter(client: Client, query: str) -> None:
    assert client.problem("GET", f"{FOIL}/{query}", 422)["parameter"] == query.partition("?")[2].partition("=")[0]
