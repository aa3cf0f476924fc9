"""Polarised tables from a recipe: built, looked up and audited; recipes that cannot be are refused in a sentence."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb.audit import audit
from brdfdb_pipelines.recipe_file import load
from brdfdb_pipelines.recipe_grids import RecipeError
from tests.pipelines.command import Captured, refused, run

RECIPE = """\
materials = ["magnesium-oxide-ceramic"]
tolerance = 0.05
polarised = true
"""


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "recipe.toml"
    path.write_text(text)
    return path


def test_a_polarised_recipe_builds_tables_that_are_looked_up_and_pass(tmp_path: Path, capsys: Captured) -> None:
    store = tmp_path / "store"
    build = ("build", written(tmp_path, RECIPE), "--store", store)
    assert run(*build) == 0
    table = brdfdb.open(store)["magnesium-oxide-ceramic"]
    assert table.mueller(0.5, 0.0, 0.7, 3.0).shape == (1, 4, 4)
    record = table.metadata.polarisation
    assert record is not None
    assert record.error is not None
    assert record.error.worst_p99 <= 0.05
    assert record.error.between_p99 is None
    assert audit(table).findings["polarisation"].verdict == "passes"
    assert run(*build) == 0
    assert brdfdb.open(store)["magnesium-oxide-ceramic"].revision == "r000001"
    assert "unchanged" in capsys.readouterr().out
    lookup = ("lookup", "magnesium-oxide-ceramic", 60, 0, 50, 165, "--store", store, "--stokes")
    assert run(*lookup, "1,0,1,0", "--json") == 0
    light = json.loads(capsys.readouterr().out)["stokes"]
    expected = table.mueller(*np.radians([60.0, 0.0, 50.0, 165.0])) @ [1.0, 0.0, 1.0, 0.0]
    np.testing.assert_allclose(light["reflected"], expected, rtol=1e-12)
    assert run(*lookup, "1,0,1,0") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].startswith(f"500 nm  I, Q, U, V: {expected[0, 0]:.6g}, {expected[0, 1]:.6g}")
    assert "Q > 0 is s-polarised" in lines[2]
    assert "stokes: sqrt(Q^2 + U^2 + V^2) exceeds I = 1" in refused(capsys, *lookup, "1,2,0,0")


def test_requests_of_unpolarised_tables_do_not_mention_polarisation(tmp_path: Path) -> None:
    (job,) = load(written(tmp_path, RECIPE)).jobs()
    (plain,) = load(written(tmp_path, RECIPE.replace("true", "false"))).jobs()
    assert set(job.request) - set(plain.request) == {"polarised"}
    assert "facet_theta_d_deg" not in plain.layout().document()
    assert job.layout().document()["facet_theta_d_deg"][-1] == 90.0


@pytest.mark.parametrize(
    ("name", "sentence"),
    [("rolled-brass", "polarised: its model ward has no Mueller"), ("mine", "polarised: mine ")],
)
def test_what_has_no_mueller_matrices_is_refused(tmp_path: Path, name: str, sentence: str) -> None:
    (tmp_path / "mine.csv").write_text("theta_i_deg,theta_r_deg,delta_phi_deg,brdf\n0,0,0,0.1\n")
    mine = '[define.mine]\nsamples = "mine.csv"\n' if name == "mine" else ""
    with pytest.raises(RecipeError, match=sentence):
        load(written(tmp_path, RECIPE.replace("magnesium-oxide-ceramic", name) + mine)).jobs()


def sheet(tmp_path: Path) -> Path:
    """Polarisers before light and viewer, in the plane of incidence: m01 of 0.25, m10 of 0.15, m11 of 0.6."""
    lines = ["AOI,theta_r,delta_phi,ss,sp,ps,pp"]
    for aoi in (10, 30, 50, 70):
        for viewer in range(0, 81, 10):
            f_r = 0.1 + 0.2 * np.exp(-(((viewer - aoi) / 25.0) ** 2))
            lines.append(f"{aoi},{viewer},180," + ",".join(f"{f_r * share:.6g}" for share in (1.0, 0.25, 0.15, 0.6)))
    path = tmp_path / "plate.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_polarisers_are_imported_looked_up_and_built_again(tmp_path: Path, capsys: Captured) -> None:
    store, again, recipe = tmp_path / "store", tmp_path / "again", tmp_path / "plate.toml"
    imported = ("import", sheet(tmp_path), "--tolerance", 0.3, "--store", store, "--polarised")
    assert run(*imported, "--recipe", recipe) == 0
    assert "Polarised: 2 rows and 2 columns" in capsys.readouterr().out
    assert "polarised = true" in recipe.read_text()
    lookup = ("lookup", "plate", 50, 0, 40, 180, "--store", store, "--stokes")
    assert run(*lookup, "1,-1,0,0", "--json") == 0
    answer = json.loads(capsys.readouterr().out)
    light = answer["stokes"]["reflected"]
    assert light[:2] == pytest.approx([0.75 * answer["brdf"][0], -0.45 * answer["brdf"][0]], rel=1e-5)
    assert light[2:] == [None, None]
    assert run(*lookup, "1,-1,0,0") == 0
    assert "not measured, not measured /sr" in capsys.readouterr().out
    assert run(*lookup, "1,-1,0,0", "--with-error") == 0
    stated = f"99 of 100 are within {answer['stokes']['element_error']:.2g}\n"
    assert f"error of the elements m_ij / m_00 of the Mueller matrix: {stated}" in capsys.readouterr().out
    assert run("show", "plate", "--store", store) == 0
    assert "  polarised   Mueller matrices; stored are m01, m10, m11, over m_00; " in capsys.readouterr().out
    assert run("build", recipe, "--store", again) == 0
    angles = np.radians([50.0, 0.0, 40.0, 180.0])
    first, second = (brdfdb.open(root)["plate"].mueller(*angles) for root in (store, again))
    np.testing.assert_array_equal(first, second)


def test_a_file_without_polarisation_makes_no_polarised_table(tmp_path: Path, capsys: Captured) -> None:
    path = sheet(tmp_path)
    path.write_text(path.read_text().replace("ss,sp,ps,pp", "brdf,a,b,c"))
    sentence = refused(capsys, "import", path, "--store", tmp_path / "store", "--polarised")
    assert "plate.csv: polarised: plate has no polarised values; known are the columns ss, sp, ps and pp" in sentence
    assert "--polarised: is allowed only together with --store" in refused(capsys, "import", path, "--polarised")
