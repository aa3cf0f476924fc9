"""The command line on a table with glints: what looks it up has them, what cannot hold them says so."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb.geometry import unit_vector
from brdfdb.measurements.glints import Glint, Glints
from brdfdb.store.publication import publish
from tests.pipelines.command import Captured, run
from tests.tables.glinting import GROUND, PEAK, POWER, source, stored

PAIR_75 = unit_vector(np.deg2rad(75.0), 0.0), unit_vector(np.deg2rad(75.0), np.pi)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with a table with glints of which 1.4 % of the directions were measured, audited."""
    root = tmp_path_factory.mktemp("glints") / "store"
    publish(root, source().recorded(extrapolated=0.986), tolerance=0.05)
    assert run("audit", "--store", root, "glinting", "--no-figures") == 0
    return root


def _printed(capsys: Captured, *arguments: object) -> str:
    capsys.readouterr()
    assert run(*arguments) == 0
    out, err = capsys.readouterr()
    return out + err


def test_lookup_says_that_a_glint_is_in_the_value(store: Path, capsys: Captured) -> None:
    text = _printed(capsys, "lookup", "glinting", 60, 0, 60.5, 180, "--store", store, "--with-error")
    assert text.startswith(f"{PEAK + GROUND:.6g} +- 1e+02 /sr\na glint is in it")
    assert "its shape is not known well" not in text
    beside = _printed(capsys, "lookup", "glinting", 60, 0, 60.8, 180, "--store", store, "--with-error")
    assert "its shape is not known well between samples: the error is more than half of f_r" in beside
    answer = json.loads(_printed(capsys, "lookup", "glinting", 60, 0, 20, 180, "--store", store, "--json"))
    assert answer["glint"] is False
    assert answer["brdf"][0] == pytest.approx(GROUND, rel=1e-3)
    between = _printed(capsys, "lookup", "glinting", 45, 0, 45, 180, "--store", store)
    assert "a glint is in it" in between
    assert "extrapolated: these directions were not measured" in between


def test_show_list_and_audit_say_what_the_verdict_rests_on_in_one_phrase(store: Path, capsys: Captured) -> None:
    phrase = "passes where measured, 1.4 %"
    assert " 2 glints " in " ".join(_printed(capsys, "list", "--store", store).split())
    shown = _printed(capsys, "show", "glinting", "--store", store)
    assert phrase in shown
    assert "2 glints kept beside the grid, which cannot hold such peaks: of light at 30 degrees" in shown
    assert f"audit       is it what the data say? {phrase}\n" in shown
    least = np.pi * GROUND + POWER  # of light at 30 degrees; at others the power of the glint is a guess
    assert re.search(rf"grey +at most 0\.\d+ +{least:.3f}\d +at most 0\.9\d+ +at most 0\.9\d+\n    at most: ", shown)
    assert phrase in " ".join(_printed(capsys, "list", "--store", store).split())
    assert phrase in " ".join(_printed(capsys, "audit", "--store", store, "glinting", "--no-figures").split())
    report = json.loads((store / "audit-part.json").read_bytes())
    assert report["materials"][0]["verdict_in_words"] == phrase
    page = (store / "audit-part.html").read_text(encoding="utf-8")
    assert phrase in page
    assert "is it what the data say?</button>" in page
    assert "is it what the paper says?</button>" not in page


def test_export_and_conversion_say_that_they_leave_the_glints_out(
    store: Path, tmp_path: Path, capsys: Captured
) -> None:
    text = _printed(capsys, "export", "merl", "glinting", "--store", store, "--out", tmp_path)
    assert "not in the values of the file: the glints of the table, up to 75.4 % of the light of a direction" in text


def test_plots_draw_the_glint_and_its_share_of_the_albedo(tmp_path: Path) -> None:
    from brdfdb.tables.plot import ALBEDO_DEG, albedo_shares

    table = stored(tmp_path)
    axes = table.plot.cuts(theta_i_deg=60.0)
    assert np.max(np.asarray(axes.lines[0].get_ydata())) == pytest.approx(PEAK + GROUND, rel=1e-3)
    shares = albedo_shares(table, 0.0, None)
    at_60 = 12
    assert shares["reflected"][at_60] == pytest.approx(np.pi * GROUND, abs=2e-3)
    power = PEAK * np.cos(np.deg2rad(60.5)) * 2.0 * np.pi * np.deg2rad(0.4) ** 2
    assert shares["glints, at most"][at_60] == pytest.approx(power, rel=1e-3)
    bright = Glint(theta_i_deg=60.0, width_deg=0.4, resolved=False, power=(1.5,))
    shares = albedo_shares(replace(table, glints=Glints(glints=(bright,))), 0.0, None)
    np.testing.assert_allclose(shares["reflected"] + shares["glints, at most"], 1.0, rtol=1e-6)  # as `show` prints
    sure = bright.model_copy(update={"resolved": True, "power": (0.1,)})
    lights = [sure.model_copy(update={"theta_i_deg": float(light)}) for light in ALBEDO_DEG]
    assert albedo_shares(replace(table, glints=Glints(glints=tuple(lights))), 0.0, None)["glints"] == pytest.approx(0.1)


def test_plots_by_default_show_the_strongest_glint_and_say_what_was_measured(
    store: Path, tmp_path: Path, capsys: Captured
) -> None:
    table = brdfdb.open(store)["glinting"]
    table = replace(table, glints=Glints(glints=(Glint.through(*PAIR_75, np.array([PEAK]), 0.4, resolved=False),)))
    lines = table.plot.cuts().lines
    assert len(lines) == 5  # 0, 20, 40, 60 and 75 degrees
    assert np.max(np.asarray(lines[4].get_ydata())) == pytest.approx(PEAK + GROUND, rel=1e-3)
    text = _printed(capsys, "plot", "glinting", "--store", store, "--kind", "cuts", "--out", tmp_path)
    assert "glinting: 1.4 % of all pairs of directions measured, the rest made up" in text
    assert "reflects at most" in text


def test_a_picture_says_that_it_leaves_the_glints_out(store: Path, tmp_path: Path, capsys: Captured) -> None:
    scene = tmp_path / "ball.toml"
    scene.write_text(
        f'store = "{store}"\nwavelengths_nm = {list(range(400, 701, 20))}\n'
        "lights = [{ direction = [-0.5, -1, 1] }]\n"
        "camera = { position = [0, -5, 0.7], target = [0, 0, 0.5], height = 1.2 }\n"
        '[[objects]]\nname = "ball"\nmaterial = "store:glinting"\n'
        'shape = { kind = "sphere", radius = 0.5, position = [0, 0, 0.5] }\n'
    )
    for command, where in (("render", "the picture"), ("choose", "the picture")):
        text = _printed(capsys, command, scene, "--width", 8, "--out", tmp_path)
        assert text.count(f"glinting: not in {where}: the glints of the table, up to 75.4 % of the light") == 1
    text = _printed(capsys, "chart", "glinting", "--store", store, "--out", tmp_path, "--tolerance", 0.1)
    assert "glinting: not in the chart: the glints of the table" in text
