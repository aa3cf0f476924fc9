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
from brdfdb.tables.table import Table
from brdfdb_pipelines import cli
from tests.api.a_store import NPY, VISIBLE_NM, Client, client_of, degrees, pinned_of, publish, read_npy
from tests.api.explored import FOUND

FOIL, FELT, TILE, METAL = (
    f"/v1/materials/{name}" for name in ("copper-foil", "grey-felt", "white-tile", "brushed-metal")
)
EXACT = {"rtol": 1e-12}


# Albedo


def test_albedo_is_that_of_the_table(client: Client, store: Store) -> None:
    white = client.get(f"{TILE}/albedo").json()
    for key in ("albedo", "hemispherical"):
        np.testing.assert_allclose(white[key], 1.0, rtol=2**-23)  # stored as float32
    assert not np.any(white["specular_reflectance"])
    assert white["wavelength_nm"] is None
    albedo = client.get(f"{FOIL}/albedo").json()
    table = store["copper-foil"]
    expected = directional_albedo(table)
    assert albedo["wavelength_nm"] == VISIBLE_NM.tolist()
    np.testing.assert_array_equal(albedo["theta_i"], expected.theta_i_deg)
    np.testing.assert_array_equal(albedo["albedo"], expected.mean)
    specular = table.specular_reflectance(np.deg2rad(albedo["theta_i"]))
    np.testing.assert_allclose(albedo["specular_reflectance"], specular, **EXACT)
    total = np.array(albedo["albedo"]) + albedo["specular_reflectance"]
    assert np.all(total.min(axis=0) <= albedo["hemispherical"])
    assert np.all(albedo["hemispherical"] <= total.max(axis=0))


# Lobes


def test_lobes_are_lookups_at_their_axes(client: Client, store: Store) -> None:
    for name in ["copper-foil", "grey-felt", "brushed-metal"]:
        lobe = client.get(f"/v1/materials/{name}/lobe?theta_i=40&phi_i=20").json()
        theta_r = np.array(lobe["axes_deg"]["theta_r"])
        assert (theta_r[0], theta_r[-1]) == (-90.0, 90.0)
        assert {40.0, 40.5, 39.5, -40.0} <= set(theta_r)
        expected = degrees(store, name, 40, 20, np.abs(theta_r), np.where(theta_r > 0, 200, 20))
        np.testing.assert_allclose(lobe["brdf"], expected, **EXACT)
        specular = store[name].specular_reflectance(math.radians(40))
        np.testing.assert_array_equal(lobe["specular_reflectance"], specular)
    lobe = client.get(f"{METAL}/lobe?theta_i=40&phi_i=20&view=hemisphere").json()
    theta_r, delta_phi = (np.array(lobe["axes_deg"][axis]) for axis in ("theta_r", "delta_phi"))
    assert (theta_r[0], theta_r[-1], delta_phi[0], delta_phi[-1]) == (0.0, 90.0, 0.0, 360.0)
    expected = degrees(store, "brushed-metal", 40, 20, theta_r[:, None], 20 + delta_phi)
    np.testing.assert_allclose(lobe["brdf"], expected, **EXACT)
    lobe = client.get(f"{FELT}/lobe?view=half-difference&phi_i=20").json()
    axes = lobe["axes_deg"]
    assert axes["theta_h"] == axes["theta_d"] == (np.arange(90) + 0.5).tolist()
    theta_h, theta_d = np.deg2rad(axes["theta_h"])[:, None], np.deg2rad(axes["theta_d"])
    directions = directions_from_half_difference(theta_h, math.radians(20), theta_d, math.pi / 2)
    np.testing.assert_allclose(lobe["brdf"], store["grey-felt"].lookup(*directions), **EXACT)
    assert lobe["theta_i"] is lobe["specular_reflectance"] is None


def test_a_lobe_in_colour_at_wavelengths_with_its_error_and_as_npy(client: Client) -> None:
    spectra = np.array(client.get(f"{FOIL}/lobe").json()["brdf"])
    colour = client.get(f"{FOIL}/lobe?output=linear-srgb&illuminant=A").json()
    of = srgb_weights(tuple(VISIBLE_NM.tolist()), "A")
    np.testing.assert_allclose(colour["brdf"], spectra @ of, **EXACT)
    assert colour["illuminant"] == "A"
    two = client.get(f"{FOIL}/lobe?wavelength_nm=700&wavelength_nm=400").json()
    np.testing.assert_array_equal(two["brdf"], spectra[:, [-1, 0]])
    for binary in (client.get(f"{FOIL}/lobe?format=npy"), client.get(f"{FOIL}/lobe", headers={"Accept": NPY})):
        assert binary.headers["content-type"] == NPY
        np.testing.assert_array_equal(read_npy(binary.content), spectra)
    assert client.get(f"{FOIL}/lobe?format=json", headers={"Accept": NPY}).json()["brdf"] == spectra.tolist()
    document = client.get(f"{FOIL}/lobe?error=true").json()
    assert np.shape(document["error"]) == np.shape(document["brdf"])
    array = read_npy(client.get(f"{FOIL}/lobe?error=true&format=npy").content)
    np.testing.assert_allclose(array, [document["brdf"], document["error"]], rtol=1e-12)


def test_a_bad_view_names_the_parameter(client: Client) -> None:
    for query, parameter in [
        ("lobe?theta_i=91", "theta_i"),
        ("lobe?theta_i=nan", "theta_i"),
        ("lobe?phi_i=721", "phi_i"),
        ("lobe?view=top", "view"),
        ("lobe?theta_r=3", "theta_r"),
        ("lobe?wavelength_nm=200", "wavelength_nm"),
        ("lobe?output=rgb", "output"),
        ("lobe?error=true&from=model", "error"),
        ("export/exr?kind=map", "kind"),
        ("export/exr?theta_i=-1", "theta_i"),
        ("export/exr?half=perhaps", "half"),
        ("export/exr?wavelength_nm=500", "wavelength_nm"),
        ("export/fred?wavelength=900", "wavelength"),
        ("sphere?size=15", "size"),
        ("sphere?format=jpg", "format"),
        ("thumbnail.png?size=257", "size"),
        ("thumbnail.png?light=1", "light"),
    ]:
        assert client.problem("GET", f"{FOIL}/{query}", 422)["parameter"] == parameter, query


def test_a_lobe_at_more_wavelengths_than_an_answer_holds_is_refused(client: Client) -> None:
    # 810 000 values: the 8100 points of the largest view, and 100 numbers of JSON for each
    for view, most in [("half-difference", 100), ("hemisphere", 150)]:
        for count, status in [(most, 200), (2 * most, 413)]:
            answer = client.get(f"{FELT}/lobe?view={view}" + "&wavelength_nm=500" * count)
            assert answer.status_code == status, (view, count)


# Slices


def test_a_slice_is_what_the_export_writes(client: Client, store: Store, tmp_path: Path) -> None:
    for name in ("copper-foil", "grey-felt"):
        table = store[name]
        images = {
            "": slices.lobe_map(table, theta_i_deg=45.0, phi_i_deg=0.0),
            "?kind=lobe&theta_i=30&phi_i=10": slices.lobe_map(table, theta_i_deg=30.0, phi_i_deg=10.0),
            "?kind=in_plane": slices.in_plane_slice(table, phi_i_deg=0.0),
            "?kind=half_difference": slices.half_difference_slice(table, phi_h_deg=0.0),
        }
        for query, image in images.items():
            answer = client.get(f"/v1/materials/{name}/export/exr{query}")
            kind = query.partition("kind=")[2].partition("&")[0] or "lobe"
            assert answer.headers["content-disposition"] == f'attachment; filename="{name}_{kind}.exr"'
            write_slice(tmp_path / "expected.exr", image, table)
            found, expected = (
                pixels(answer.content, tmp_path),
                pixels((tmp_path / "expected.exr").read_bytes(), tmp_path),
            )
            assert found.keys() == expected.keys()
            for channel, values in expected.items():
                assert values.dtype == np.float32
                np.testing.assert_array_equal(found[channel], values)
    channels = pixels(client.get(f"{FELT}/export/exr?half=true").content, tmp_path)
    assert {values.dtype for values in channels.values()} == {np.dtype(np.float16)}


def pixels(content: bytes, folder: Path) -> dict[str, Any]:
    """The channels of an EXR file."""
    (folder / "read.exr").write_bytes(content)
    with OpenEXR.File(str(folder / "read.exr"), separate_channels=True) as file:
        return {name: channel.pixels.copy() for name, channel in file.channels().items()}


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
    assert detail.startswith("brushed-metal: the table is anisotropic")


# Verdicts


ANSWERS = {
    key: {"word": word, "text": "yes", "reason": "it does"}
    for key, word in (("as_published", "passes"), ("conserves_energy", "conserves"))
}


def report(root: Path, revision: str = "r000001", when: str = "2026-11-21T12:00:00Z", **more: Any) -> dict[str, Any]:
    """Write what an audit of the white tile would, as far as the service reads it."""
    about = {"material": "white-tile", "model": "lambert", "revision": revision, "verdict": "passes"}
    finding = FOUND | about | {"findings": {"energy": {"verdict": "conserves"}}, **ANSWERS, **more}
    document = {"format": "brdfdb-audit", "when": when, "materials": [finding]}
    (root / "audit.json").write_text(json.dumps(document), encoding="utf-8")
    return finding


def line_of_tile(client: Client) -> dict[str, Any]:
    """The line of the white tile in the catalogue."""
    (line,) = client.get("/v1/materials?q=white").json()["materials"]
    return dict(line)


def test_the_verdict_of_the_last_audit(own: Path) -> None:
    client = client_of(own)
    assert "brdfdb audit" in client.problem("GET", f"{TILE}/audit", 404)["detail"]
    exported = client.get(f"{TILE}/export/csv")
    held = {"if-none-match": exported.headers["etag"]}
    assert "# audit: not audited" in exported.text
    assert client.get(f"{TILE}/export/csv", headers=held).status_code == 304
    finding = report(own)
    assert "# audit: passes" in client.get(f"{TILE}/export/csv", headers=held).text
    about = {"revision": "r000001", "current": True, "when": "2026-11-21T12:00:00Z"}
    answer = client.get(f"{TILE}/audit").json()
    assert answer == {"material": "white-tile", **about, "finding": finding}
    assert client.get(f"{TILE}/revisions/r000001/audit").json() == answer
    shown = {key: finding[key] for key in ("verdict", "model", "sentences", *ANSWERS)}
    assert client.get(TILE).json()["audit"] == shown | about
    lines = {line["name"]: line["verdict"] for line in client.get("/v1/materials").json()["materials"]}
    assert (lines["white-tile"], lines["grey-felt"]) == ("passes", None)
    assert {key: line_of_tile(client)[key] for key in ANSWERS} == ANSWERS
    client.problem("GET", f"{FELT}/audit", 404)


def test_a_verdict_of_another_store_with_the_same_number_is_not_shown(own: Path, tmp_path: Path) -> None:
    report(own, manifest_sha256=Store(own)["white-tile"].digest)
    client = client_of(own)
    pinned = pinned_of(Store(own), "white-tile")
    assert client.get(f"{TILE}/revisions/{pinned}/audit").json()["finding"]["verdict"] == "passes"
    assert "passes" in client.get(f"{TILE}/export/csv?resolution=45").text
    assert last_audit(own)["white-tile", "r000001"].as_published == "yes"
    shutil.rmtree(own / "materials" / "white-tile")
    assert publish(own, "white-tile", "lambert", rho=0.5) == "r000001"
    client.problem("GET", f"{TILE}/audit", 404)
    assert client.get(TILE).json()["audit"] is None
    assert "passes" not in client.get(f"{TILE}/export/csv?resolution=45").text
    assert line_of_tile(client)["verdict"] is None
    assert last_audit(own) == {}
    (own / "audit.json").rename(tmp_path / "other.json")
    out = ("--store", str(own), "--out", str(tmp_path / "out"), "--resolution", "45")
    assert cli.main(["export", "csv", "white-tile", "--audit", str(tmp_path / "other.json"), *out]) == 0
    assert "not audited" in (tmp_path / "out" / "white-tile.csv").read_text()


def test_a_verdict_of_another_revision_says_so(own: Path) -> None:
    report(own)
    client = client_of(own)
    tags = {address: client.get(address).headers["etag"] for address in (TILE, f"{TILE}/audit")}
    publish(own, "white-tile", "lambert", rho=0.5)
    assert client.get(f"{TILE}/audit").json()["current"] is False
    assert client.get(TILE).json()["audit"]["current"] is False
    assert line_of_tile(client)["verdict"] is None
    client.problem("GET", f"{TILE}/revisions/r000002/audit", 404)
    report(own, "r000002", "2026-11-22T12:00:00Z")
    for address, tag in tags.items():
        assert client.get(address, headers={"If-None-Match": tag}).status_code == 200
    assert client.get(TILE).json()["audit"]["current"] is True


def test_a_report_that_is_none_is_no_verdict(own: Path) -> None:
    entry = '{"material": "white-tile", "verdict": "passes"}'
    for content in [
        *("", "{}", "[]", '{"when": "", "materials": [1]}', '{"materials": {}}'),
        f'{{"when": "2026", "materials": [{entry}]}}',
    ]:
        (own / "audit.json").write_text(content)
        client = client_of(own)
        assert client.get(TILE).json()["audit"] is None, content
        assert line_of_tile(client)["verdict"] is None, content
        client.problem("GET", f"{TILE}/audit", 404)
    report(own, as_published={"word": 1}, conserves_energy=None)
    assert [line_of_tile(client_of(own))[key] for key in ("verdict", *ANSWERS)] == [None] * 3


# Pictures


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The sizes of the spheres that are drawn [pixel]."""
    sizes: list[int] = []
    draw = lit_sphere.sphere_png

    def noted(table: Table, size: int, detail: Any) -> bytes:
        sizes.append(size)
        return draw(table, size, detail)

    monkeypatch.setattr(lit_sphere, "sphere_png", noted)
    return sizes


@pytest.mark.parametrize("name", ["copper-foil", "brushed-metal"])
def test_the_last_thumbnail_of_a_table_is_stored(own: Path, drawn: list[int], name: str) -> None:
    client, address = client_of(own), f"/v1/materials/{name}"
    first = client.get(f"{address}/thumbnail.png?size=32")
    assert (first.headers["content-type"], first.headers["cache-control"]) == ("image/png", "no-cache")
    held = {"If-None-Match": first.headers["etag"]}
    assert client.get(f"{address}/thumbnail.png?size=32", headers=held).status_code == 304
    assert client.get(f"{address}/revisions/r000001/thumbnail.png?size=32").content == first.content
    assert drawn == [32]
    assert first.content == lit_sphere.sphere_png(Store(own)[name], 32, lit_sphere.DRAFT)
    publish(own, name, "lambert", rho=0.5)
    again = client.get(f"{address}/thumbnail.png?size=32", headers=held)
    assert (again.status_code, drawn) == (200, [32] * 3)
    assert again.content != first.content
    for size in (16, 16, 17, 16):
        assert client.get(f"{address}/thumbnail.png?size={size}").status_code == 200
    assert drawn[3:] == [16, 17, 16]


def test_a_sphere_is_that_of_the_table(client: Client, store: Store) -> None:
    answer = client.get(f"{FOIL}/sphere?size=24&format=npy")
    expected = lit_sphere.linear_sphere(store["copper-foil"], 24, detail=lit_sphere.DRAFT)
    np.testing.assert_array_equal(read_npy(answer.content), expected.astype(np.float32))
    assert client.get(f"{FOIL}/sphere").content.startswith(b"\x89PNG")
