"""`brdfdb audit` on the command line: what it prints, the report, and the exit code of a violation."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb.materials import Material
from brdfdb.store.publication import publish_dataset
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import tabulate
from tests.json_schema import validate
from tests.pipelines.command import Captured, refused, run
from tests.pipelines.recipes import material, recipe_file_of

SCHEMA = Path(__file__).parent.parent.parent / "schemas" / "audit.schema.json"


def test_audit_of_some_materials_reports_those(built: Path, tmp_path: Path, capsys: Captured) -> None:
    report = tmp_path / "report.json"
    code = run("audit", "mirror", "foam", "mirror", "--store", built, "--report", report)
    out, err = capsys.readouterr()
    assert code == 0
    assert "auditing" in err
    assert "auditing" not in out
    lines = out.splitlines()
    assert lines[0].startswith(f"Audit of {built}")
    assert [re.split(r"  +", line)[:3] for line in lines[1:4]] == [
        ["material", "is it what the paper says?", "does the published model conserve energy?"],
        ["mirror", "yes", "yes"],
        ["foam", "yes", "yes, no lossless form to judge"],
    ]
    written = report.with_suffix(".html")
    assert lines[-1] == (f"2 audited: passes 2, known published excess 0, violates 0; page {written}, data {report}")
    assert written.read_text(encoding="utf-8").startswith("<!doctype html>")
    document = json.loads(report.read_bytes())
    validate(document, json.loads(SCHEMA.read_bytes()))
    assert [entry["material"] for entry in document["materials"]] == ["mirror", "foam"]
    assert document["violations"] == []


GRID = Grid({"theta_i": [0, 30, 60, 80], "theta_r": [0, 30, 60, 80], "delta_phi": [0, 90, 180]})


def publish_grey(root: Path, name: str, rho: float = 0.5, value: float | None = None, factor: float = 1.0) -> None:
    """Publish a table of a Lambertian, one of its values replaced, or all of them times a factor."""
    table = {"title": name, "model": "lambert", "source": "no paper", "parameters": {"rho": rho}}
    dataset = tabulate(Layout(Material.from_table(name, table), GRID))
    dataset["brdf"].values *= np.float32(factor)
    if value is not None:
        dataset["brdf"].values[1, 2, 1] = value
    publish_dataset(root, name, dataset)


NOT_FINITE = ["1 of 48 stored values and 0 lookups are not finite"]
ASYMMETRIC = [
    "not reciprocal: asymmetry up to 0.228, of 1·10⁻⁶ allowed",
    "1 of 48 stored values are not the model's, such as 0.1 for 0.1592",
]
# What is done to a table, and what an audit says of it
VIOLATIONS: dict[str, tuple[dict[str, float], list[str]]] = {
    "negative": ({"value": -0.1}, ["1 values are negative; the smallest f_r is −0.1 1/sr"]),
    "nan": ({"value": np.nan}, NOT_FINITE),
    "inf": ({"value": np.inf}, NOT_FINITE),
    "asymmetric": ({"value": 0.1}, ASYMMETRIC),
    "bright": ({"factor": 2.5}, ["the table reflects 1.25 of the incident light at 0 degrees"]),
}


@pytest.mark.usefixtures("no_plots")
def test_a_violation_is_exit_code_1_and_stands_in_the_report(tmp_path: Path, capsys: Captured) -> None:
    publish_grey(tmp_path, "good")
    for name, (change, _) in VIOLATIONS.items():
        publish_grey(tmp_path, name, **change)
    assert run("audit", "--no-figures", "--store", tmp_path) == 1
    out, err = capsys.readouterr()
    for name, (_, sentences) in VIOLATIONS.items():
        for said in sentences:
            assert f"{name}: {said}\n" in out
    assert "good: " not in out
    assert "6 audited: passes 1, known published excess 0, violates 5" in out
    assert "Traceback" not in err
    document = json.loads((tmp_path / "audit.json").read_text(encoding="utf-8"))
    validate(document, json.loads(SCHEMA.read_bytes()))
    assert document["violations"] == sorted(VIOLATIONS)
    assert run("audit", "good", "--store", tmp_path) == 0


def test_audit_notices_a_file_that_was_exchanged_for_a_sound_one(tmp_path: Path, capsys: Captured) -> None:
    publish_grey(tmp_path, "grey", 0.25)
    publish_grey(tmp_path, "white", 0.75)
    grey, white = (brdfdb.open(tmp_path).path(name) / "brdf" / "c" / "0" / "0" / "0" for name in ("grey", "white"))
    assert (grey.stat().st_size, grey.read_bytes() != white.read_bytes()) == (white.stat().st_size, True)
    shutil.copyfile(white, grey)
    assert run("audit", "--no-figures", "--store", tmp_path) == 2
    out, err = capsys.readouterr()
    assert err.splitlines()[-1] == "brdfdb: grey r000001 is damaged: the content of brdf/c/0/0/0 changed"
    assert "1 audited: passes 1" in out  # the other one
    document = json.loads((tmp_path / "audit.json").read_text(encoding="utf-8"))
    assert [entry["material"] for entry in document["materials"]] == ["white"]


WHITE = material("white", "White, rough", "oren_nayar", "rho = 1", "sigma_deg = 20")
KNOWN = """
[define.white.known_excess]
max_albedo = 1.05
from_theta_i_deg = 75
citation = "Erratum of eqs 27 and 28: Größe"
"""
THETA = "[{ start = 0, stop = 88, step = 2 }, 89, 89.5]"


@pytest.mark.usefixtures("no_plots")
@pytest.mark.parametrize("claim", ["", KNOWN], ids=["nothing", "an excuse"])
def test_white_oren_nayar_violates_whatever_its_recipe_says_and_can_be_accepted(
    claim: str, recipe: Path, tmp_path: Path, capsys: Captured
) -> None:
    text = recipe.read_text(encoding="utf-8").replace("[{ start = 0, stop = 80, step = 10 }, 85, 89.5]", THETA)
    text = re.sub(r"materials = .*", 'materials = ["mirror", "white"]', text) + WHITE + claim
    store = tmp_path / "store"
    assert run("build", recipe_file_of(tmp_path, text), "--store", store) == 0
    capsys.readouterr()
    assert run("audit", "white", "--store", store) == 1
    out, _ = capsys.readouterr()
    (line,) = [line for line in out.splitlines() if line.startswith("white: ")]
    assert line.startswith("white: the model reflects 1.0")
    assert "; this model does so by itself for such parameters: up to 1.0" in line
    assert line.endswith("; its recipe excuses it, which is not accepted: Erratum of eqs 27 and 28: Größe") == bool(
        claim
    )
    assert run("audit", "mirror", "white", "--allow", "white", "--store", store) == 0
    out, _ = capsys.readouterr()
    assert "2 audited: passes 1, known published excess 0, accepted excess 1" in out
    document = json.loads((store / "audit-part.json").read_text(encoding="utf-8"))
    entry = next(entry for entry in document["materials"] if entry["material"] == "white")
    assert (entry["verdict"], entry["findings"]["energy"]["verdict"]) == ("accepted excess", "accepted excess")
    assert entry["findings"]["energy"]["table"]["max_albedo"] == pytest.approx(1.046, abs=0.003)
    assert document["violations"] == []


def test_names_to_allow_are_those_of_materials_to_audit(built: Path, capsys: Captured) -> None:
    assert "gold" in refused(capsys, "audit", "mirror", "--allow", "gold", "--store", built)
    said = "--allow: foam is not among the materials to audit, mirror"
    assert refused(capsys, "audit", "mirror", "--allow", "foam", "--store", built) == said
