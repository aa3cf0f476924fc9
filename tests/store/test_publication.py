"""A function of the user from end to end: tabulated, published, audited, served, charted and rendered."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brdfdb
from brdfdb.audit import audit
from brdfdb.errors import ParameterError
from brdfdb.forms.catalogue import forms
from brdfdb.geometry import unit_vector
from brdfdb.materials import FunctionRecord, FunctionSource, presets
from brdfdb.scenes.gbuffer import gather
from brdfdb.scenes.offered_forms import offered_forms
from brdfdb.scenes.renderer import reflectors, render
from brdfdb.store.publication import Published, publish
from brdfdb.tables.table import source_of_table
from brdfdb_pipelines import cli, scene_file
from tests.api.a_store import client_of

TOLERANCE = 0.02
VISIBLE_NM = tuple(float(wavelength) for wavelength in range(400, 701, 50))
SCENE = """\
store = "store"
lights = [{{ direction = [0, -1, 1] }}]
camera = {{ position = [0, -5, 0], height = 2.5 }}
wavelengths_nm = [400, 420, 440, 460, 480, 500, 520, 540, 560, 580, 600, 620, 640, 660, 680, 700]
ambient = 0.1
[[objects]]
name = "ball"
material = "{material}"
shape = {{ kind = "sphere", radius = 1 }}
"""


def gloss(wi: np.ndarray, wr: np.ndarray, wavelength_nm: Any) -> np.ndarray:
    """Blinn's lobe, coloured: reciprocal, isotropic, and no model of the library."""
    half = wi + wr
    cosine = half[:, 2] / np.linalg.norm(half, axis=1)
    return (0.1 / np.pi + 0.5 * cosine[:, np.newaxis] ** 50) * (0.4 + wavelength_nm / 2000.0)


SOURCE = FunctionSource(
    brdf=gloss, name="gloss", title="Coloured gloss", provenance="a test", wavelengths_nm=VISIBLE_NM, alpha=0.2
)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("publication") / "store"


@pytest.fixture(scope="module")
def published(root: Path) -> Published:
    return publish(root, SOURCE, tolerance=TOLERANCE)


def test_the_stated_error_is_that_at_directions_of_a_test(root: Path, published: Published) -> None:
    assert published.revision == "r000001"
    assert 0.0 < published.error.overall.p99 <= TOLERANCE
    table = brdfdb.open(root)["gloss"]
    assert table.error == published.error
    rng = np.random.default_rng(5)
    theta_i, theta_r = np.arccos(rng.uniform(0.0, 1.0, (2, 20_000)))
    wi, wr = unit_vector(theta_i, rng.uniform(0.0, 7.0, 20_000)), unit_vector(theta_r, rng.uniform(0.0, 7.0, 20_000))
    truth = gloss(wi, wr, np.array(VISIBLE_NM))
    error = np.abs(table.lookup_vectors(wi, wr) / truth - 1.0)
    assert 0.5 * published.error.overall.p99 < np.percentile(error, 99.0) <= TOLERANCE


@pytest.mark.usefixtures("published")
def test_a_table_of_a_function_keeps_its_provenance_and_is_audited_alone_or_against_the_function(root: Path) -> None:
    table = brdfdb.open(root)["gloss"]
    assert table.source == FunctionRecord.model_validate(SOURCE.document()["function"])
    assert (table.metadata.title, table.metadata.source, table.metadata.gaps) == ("Coloured gloss", "a test", "")
    wrong = replace(table, values=table.values * np.float32(1.1))
    audits = audit(table), audit(table, source=SOURCE), audit(wrong, source=SOURCE)
    assert [found.verdict for found in audits] == ["passes", "passes", "violates"]


def test_an_anisotropic_function_is_tabulated_over_light_and_viewer_and_audited_alone(root: Path) -> None:
    def skew(wi: np.ndarray, wr: np.ndarray, _: Any) -> np.ndarray:
        return 0.2 / np.pi * (1.0 + 0.3 * (wi[:, 0] * wr[:, 1] + wi[:, 1] * wr[:, 0]) + 0.1 * (wi[:, 0] + wr[:, 0]))

    source = FunctionSource(brdf=skew, name="skew", title="Skew", provenance="a test", anisotropic=True)
    assert publish(root, source, tolerance=0.1).error.overall.p99 <= 0.1
    table = brdfdb.open(root)["skew"]
    assert table.grid.names == ("theta_i", "phi_i", "theta_r", "phi_r")
    assert audit(table).verdict == "passes"  # its interpolant is not reciprocal between nodes, as its error explains


@pytest.mark.usefixtures("published")
def test_a_table_of_a_function_is_listed_shown_and_served(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["list", "--store", str(root)]) == 0
    assert "Coloured gloss" in capsys.readouterr().out
    assert cli.main(["show", "gloss", "--store", str(root)]) == 0
    said = capsys.readouterr().out
    assert "Coloured gloss" in said
    assert " of f_r relative to its source, at 99 % of " in said
    client = client_of(root)
    assert "gloss" in [material["name"] for material in client.get("/v1/materials").json()["materials"]]
    assert client.get("/v1/materials/gloss").status_code == 200
    at = {"theta_i": 30, "theta_r": 40, "phi_r": 180, "wavelength_nm": 500}
    answer = client.get("/v1/materials/gloss/lookup", params=at)
    expected = brdfdb.open(root)["gloss"].lookup(*np.deg2rad([30.0, 0.0, 40.0, 180.0]), 500.0)
    assert answer.json()["brdf"] == pytest.approx(expected)
    problem = client.problem("GET", "/v1/materials/gloss/lookup", 422, params={**at, "from": "model"})
    assert problem["detail"] == "from: the table of gloss keeps no model; ask for from=table"


@pytest.mark.usefixtures("published")
def test_a_function_and_its_table_are_charted_with_tables_of_their_own(root: Path) -> None:
    at = np.array(VISIBLE_NM[:2])
    wi, wr = unit_vector([0.3, 0.5], 0.0), unit_vector([0.4, 0.5], [3.0, 1.0])
    for source in (SOURCE, source_of_table(brdfdb.open(root)["gloss"])):
        truth, table, *others = forms(source, at, [0.1])
        assert [form.kind for form in (truth, table, *others)] == ["exact", *["table"] * (1 + len(others))]
        np.testing.assert_array_equal(truth.evaluate(wi, wr), source.lookup_vectors(wi, wr, at))
        np.testing.assert_allclose(table.evaluate(wi, wr), truth.evaluate(wi, wr), rtol=0.2)


def test_a_grey_table_without_its_source_has_forms_to_choose_from(root: Path) -> None:
    grey = FunctionSource(
        brdf=lambda wi, wr, _: 0.1 * (1.0 + wi[:, 2] * wr[:, 2]), name="grey", title="Grey", provenance="a test"
    )
    publish(root, grey, tolerance=0.1)
    source = source_of_table(brdfdb.open(root)["grey"])
    assert source.evaluated_at(np.array(VISIBLE_NM)) is None
    truth, *others = offered_forms(source, None, [0.1])
    assert truth.form.kind == "exact"
    assert "table" in [offered.form.kind for offered in others]


@pytest.mark.usefixtures("published")
def test_a_scene_shows_the_table_of_a_function_and_offers_its_forms(root: Path) -> None:
    path = root.parent / "scene.toml"
    path.write_text(SCENE.format(material="store:gloss"), encoding="utf-8")
    scene = scene_file.load(str(path))
    view = gather(scene, 24)
    shown = render(scene, view)
    own = {"store:gloss": lambda wi, wr, at: gloss(wi, wr, at)}
    expected = render(scene, view, own, materials=reflectors(scene))
    assert shown.max() > 0.1
    np.testing.assert_allclose(shown, expected, rtol=0.1, atol=1e-3)
    assert offered_forms(scene.materials["store:gloss"], np.array(VISIBLE_NM[:2]), [])[0].form.kind == "exact"
    foam = presets()["foam"]  # a scene evaluates the model of a stored material
    publish(root, foam, tolerance=0.1)
    path.write_text(SCENE.format(material="store:foam"), encoding="utf-8")
    assert scene_file.load(str(path)).materials == {"store:foam": foam}


@pytest.mark.parametrize(
    ("material", "store", "said"),
    [
        ("store:nothing", 'store = "store"\n', "no material 'nothing' in the store"),
        ("store:gloss", 'store = "elsewhere"\n', "elsewhere"),
        ("store:gloss", "", "objects.ball has the material store:gloss"),
    ],
)
@pytest.mark.usefixtures("published")
def test_a_scene_with_a_wrong_store_is_told_so(
    root: Path, material: str, store: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = root.parent / "wrong.toml"
    path.write_text(SCENE.format(material=material).replace('store = "store"\n', store), encoding="utf-8")
    assert cli.main(["render", str(path), "--out", str(root.parent / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line


def test_a_tolerance_that_is_not_allowed_is_refused_before_any_work(root: Path) -> None:
    with pytest.raises(ParameterError, match=r"^tolerance: 0\.9 is outside"):
        publish(root, SOURCE, tolerance=0.9)
