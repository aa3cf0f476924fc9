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
