"""The command `brdfdb fit`: its ranking, JSON, page and recipe, published fits, and its sentences on mistakes."""

from __future__ import annotations

import contextlib
import io
import json
import re
from pathlib import Path
from typing import Any, NamedTuple

import jsonschema
import numpy as np
import pytest

from brdfdb.fitting import fit as fitting
from brdfdb.geometry import unit_vector
from brdfdb.measurements import Samples
from brdfdb.models import MODELS
from brdfdb.store.reader import Store
from brdfdb_pipelines import recipe_file
from brdfdb_pipelines.documents import schema
from tests.pipelines.a_page import Document
from tests.pipelines.command import Captured, refused, run

TRUTH = {"rho_d": 0.2, "rho_s": 0.1, "alpha_x": 0.25, "alpha_y": 0.25}
HEADER = "theta_i_deg,theta_r_deg,delta_phi_deg,f_r"


def rows() -> list[list[float]]:
    """Return noisy samples of a surface: theta_i, theta_r, delta_phi [degree] and f_r [1/sr]."""
    grid = np.meshgrid([10.0, 30.0, 55.0], np.arange(0.0, 81.0, 10.0), [0.0, 90.0, 170.0, 180.0], indexing="ij")
    theta_i, theta_r, turn = (axis.ravel() for axis in grid)
    light, viewer = np.deg2rad([theta_i, 0.0 * theta_i]), np.deg2rad([theta_r, turn])
    f_r = MODELS["ward"].vectors(unit_vector(*light), unit_vector(*viewer), **TRUTH)
    noise = 1.0 + 0.03 * np.random.default_rng(1).standard_normal(f_r.shape)
    return np.stack([theta_i, theta_r, turn, f_r * noise], axis=1).tolist()


def written(path: Path, lines: list[list[float]]) -> Path:
    text = "\n".join([HEADER, *(",".join(f"{value:.6g}" for value in line) for line in lines), ""])
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def tile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("fit") / "tile.csv", rows())


class Answer(NamedTuple):
    printed: str
    folder: Path


@pytest.fixture(scope="module")
def answer(tile: Path) -> Answer:
    """The answer to one fit of three models, with all files."""
    files = [part for name, kind in KINDS.items() for part in (f"--{kind}", tile.parent / name)]
    models = [part for name in ("lambert", "ward", "lambert + beckmann_schlick") for part in ("--model", name)]
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        assert run("fit", tile, *models, *files) == 0
    return Answer(printed.getvalue(), tile.parent)


KINDS = {"fit.json": "json", "new/fit.html": "page", "fit.toml": "recipe"}


def test_the_ranking_is_printed(answer: Answer) -> None:
    first, note, heading, *others = answer.printed.splitlines()
    assert first.startswith("tile: 108 values at 3 incidences, residuals: noise")
    assert note.startswith("  note  The light comes from one azimuth of the surface")
    assert heading.split() == ["model", "held", "out", "all", "numbers", "BIC", "albedo"]
    ranked = [
        re.match(r"  (lambert \+ beckmann_schlick|ward|lambert) +([\d.]+) +([\d.]+) +(\d+)", line)
        for line in others[:3]
    ]
    assert [line[1] for line in ranked if line] == ["ward", "lambert + beckmann_schlick", "lambert"]
    held = [float(line[2]) for line in ranked if line]
    assert 0.02 < held[0] < 0.045 < held[1] < held[2]
    assert "best: ward" in others
    assert others[-1].startswith("The samples cannot tell: ")
    numbers = {line.split()[0]: line for line in others if "95 %:" in line}
    assert numbers.keys() == {"alpha_x", "rho_d", "rho_s"}
    for name, line in numbers.items():
        value, error, low, high = map(float, re.findall(r"([\d.]+) ± ([\d.]+)  95 %: ([\d.]+) to ([\d.]+)", line)[0])
        assert abs(value - TRUTH[name]) < 4.0 * error
        assert (low, high) == pytest.approx((value - 1.96 * error, value + 1.96 * error), rel=0.02)


def test_json_has_its_schema(answer: Answer) -> None:
    document = json.loads((answer.folder / "fit.json").read_text(encoding="utf-8"))
    jsonschema.validate(document, json.loads(schema("fits")))
    assert [one["model"] for one in document["fits"]] == ["ward", "lambert + beckmann_schlick", "lambert"]
    assert document["ranked_by"] == "held-out rms of ln"
    assert document["left_out"] == {"below_horizon": 0, "holes": 0, "at_horizon": 0, "unusable": 0}
    assert document["receiver_solid_angle_sr"] is None


def test_the_page_is_html_with_figures_and_no_script(answer: Answer) -> None:
    text = (answer.folder / "new" / "fit.html").read_text(encoding="utf-8")
    page = Document(text)
    assert text.startswith("<!doctype html>")
    assert page.unbalanced == []
    assert not any(name.startswith("on") for _, attributes in page.elements for name in attributes)
    assert page.count("script") == 0
    assert page.count("figure") == 6  # a cut and a map for each incidence
    assert page.count("svg") >= 6
    assert not re.search(r"(src|href)=.?https?:", text)
    for words in ("The best of 3 fits is", "held out", "residuals", "theta_i = 55 degrees", "[define.tile-as-ward]"):
        assert words in text
    headings = re.findall("<h2>(.*)</h2>", text)
    assert headings == ["Ranking", "Cuts of ward", "Residuals of ward", "Numbers of ward"]
    figures = re.findall(r'<figure class="(\w+)".*?</figure>', text, re.DOTALL)
    assert figures == ["curves"] * 3 + ["map"] * 3
    first = text[text.index('<figure class="curves"') : text.index("</figure>")]
    line, dots = first[first.index('data-curve="0"') :].split('data-curve="1"')
    assert "h0" not in line
    assert dots.count("h0") == 20  # 18 samples in the plane and 2 at the normal


def test_the_recipe_of_the_best_model_builds(answer: Answer, tmp_path: Path) -> None:
    recipe, store = answer.folder / "fit.toml", tmp_path / "store"
    (job,) = recipe_file.load(recipe).jobs()
    assert job.material.parameters["alpha_x"] == pytest.approx(TRUTH["alpha_x"], rel=0.05)
    assert run("build", recipe, "--store", store, "--jobs", "1") == 0
    at = (0.5, 0.0, 0.3, 3.0)
    expected = MODELS["ward"].evaluate(*at, **job.material.parameters)
    assert Store(store)["tile-as-ward"].lookup(*at) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("model", ["ward", "abg"])
def test_the_recipe_of_a_fit_at_one_wavelength_holds_there(
    model: str, tile: Path, tmp_path: Path, capsys: Captured
) -> None:
    recipe, store = tmp_path / "fit.toml", tmp_path / "store"
    assert run("fit", tile, "--model", model, "--wavelength-nm", "650", "--recipe", recipe) == 0
    assert run("build", recipe, "--store", store, "--jobs", "1") == 0
    name = f"tile-as-{model.replace('_', '-')}"
    lookup = ("lookup", name, 30, 0, 30, 170, "--store", store)
    capsys.readouterr()
    if model == "abg":  # no parameter of it is a reflectance, which could be a spectrum
        assert run("show", name, "--store", store) == 0
        assert "note        fitted at 650 nm; the model is grey" in capsys.readouterr().out
        return
    assert run(*lookup, "--wavelength-nm", "650") == 0
    assert run(*lookup, "--wavelength-nm", "450") == 2
    assert "450 is not 650 nm, the one wavelength of" in capsys.readouterr().err
    assert run("show", name, "--store", store) == 0
    shown = capsys.readouterr().out
    assert "wavelength      650 nm only" in shown
    assert " at 650 nm; fitted to tile" in shown
    assert not re.search(r"\dfitted", shown)


def test_an_aperture_can_be_said(tile: Path, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "fit.json"
    assert run("fit", tile, "--model", "ward", "--receiver-deg", "4", "--source-deg", "1", "--json", out) == 0
    assert "  averaged over the aperture: receiver 4°, light 1°\n" in capsys.readouterr().out
    document = json.loads(out.read_text(encoding="utf-8"))
    assert document["receiver_solid_angle_sr"] == pytest.approx(np.pi * np.deg2rad(2.0) ** 2, rel=1e-3)
    (alpha,) = (one["value"] for one in document["fits"][0]["estimates"] if one["name"] == "alpha_x")
    assert alpha == pytest.approx(TRUTH["alpha_x"], rel=0.03)


def test_files_of_one_surface_are_joined(tile: Path, tmp_path: Path, capsys: Captured) -> None:
    lines = rows()
    parts = [written(tmp_path / f"tile-{number}.csv", lines[number::2]) for number in range(2)]
    assert run("fit", *parts, "--model", "ward", "--json", tmp_path / "parts.json") == 0
    assert run("fit", tile, "--model", "ward", "--json", tmp_path / "whole.json") == 0
    capsys.readouterr()
    several, whole = (json.loads((tmp_path / f"{name}.json").read_text("utf-8")) for name in ("parts", "whole"))
    assert several["samples"] == whole["samples"] == 108
    values = [[one["value"] for one in document["fits"][0]["estimates"]] for document in (several, whole)]
    assert values[0] == pytest.approx(values[1], rel=1e-4)
    brighter = written(tmp_path / "brighter.csv", [[*line[:3], 2.0 * line[3]] for line in lines])
    assert run("fit", tile, brighter, "--model", "lambert") == 0
    assert "  note  At 99 directions that both files have, f_r differs by 100 %" in capsys.readouterr().out
    assert run("fit", tile, tmp_path / "other.fit", "--model", "lambert") == 2
    assert "DATA: " in capsys.readouterr().err


def test_ctrl_c_keeps_the_models_that_are_finished(
    tile: Path, tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    finished = fitting.fit

    def stopped(samples: Samples, model: str, **options: Any) -> Any:
        if model == "ggx_schlick":
            raise KeyboardInterrupt
        return finished(samples, model, **options)

    monkeypatch.setattr(fitting, "fit", stopped)
    out = tmp_path / "fit.json"
    models = [part for name in ("lambert", "ward", "ggx_schlick", "beckmann") for part in ("--model", name)]
    assert run("fit", tile, *models, "--json", out) == 130
    printed = capsys.readouterr()
    assert "  interrupted: 2 models not fitted" in printed.out
    assert "best: ward" in printed.out
    assert printed.err == "brdfdb: interrupted; 2 finished models printed above\n"
    document = json.loads(out.read_text(encoding="utf-8"))
    assert document["interrupted"]
    assert [one["model"] for one in document["fits"]] == ["ward", "lambert"]
    assert document["skipped"] == dict.fromkeys(["ggx_schlick", "beckmann"], fitting.INTERRUPTED)
    out.unlink()
    assert run("fit", tile, "--model", "ggx_schlick", "--json", out) == 130
    assert capsys.readouterr().err == "brdfdb: interrupted\n"
    assert not out.exists()


def test_two_lengths_that_are_not_told_apart_are_named(tmp_path: Path, capsys: Captured) -> None:
    lines = np.array(rows())
    wi = unit_vector(np.deg2rad(lines[:, 0]), np.zeros(len(lines)))
    wr = unit_vector(np.deg2rad(lines[:, 1]), np.deg2rad(lines[:, 2]))
    rough = {"wavelength_nm": 500.0, "sigma_0_um": 2.0, "tau_um": 8.0, "n": 1.7, "k": 0.0, "a": 0.3}
    lines[:, 3] = MODELS["he_torrance"].vectors(wi, wr, **rough)
    data, page = written(tmp_path / "rough.csv", lines.tolist()), tmp_path / "rough.html"
    options = ("--model", "he_torrance", "--refractive-index", "constant/1.7/0.0", "--wavelength-nm", "500")
    assert run("fit", data, *options, "--page", page) == 0
    for text in (capsys.readouterr().out, page.read_text(encoding="utf-8")):
        assert "sigma_0_um and tau_um are correlated by " in text
        assert "only their ratio is measured." in text


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--model", "wrad"], "model: 'wrad' is unknown; closest: ward"),
        (["--channel", "green"], "channel: 'green' is not one of grey"),
        (["--wavelength-nm", "-5"], "wavelength_nm: -5 is outside"),
        (["--receiver-deg", "0"], "receiver-deg: 0 is outside (0, 30] degrees"),
        (["--source-deg", "nan"], "source-deg: nan is outside (0, 30] degrees"),
    ],
)
def test_mistakes_are_one_sentence(
    options: list[str], sentence: str, tile: Path, tmp_path: Path, capsys: Captured
) -> None:
    out = tmp_path / "fit.json"
    assert sentence in refused(capsys, "fit", tile, *options, "--json", out)
    assert not out.exists()


@pytest.mark.parametrize(
    ("line", "sentence"), [([float("nan"), 20.0, 0.0, 0.3], "theta_i"), ([20.0, 20.0, 0.0, float("inf")], "f_r")]
)
def test_samples_that_are_none_are_refused(line: list[float], sentence: str, tmp_path: Path, capsys: Captured) -> None:
    data = written(tmp_path / "wrong.csv", [*rows()[:5], line])
    error = refused(capsys, "fit", data, "--model", "lambert")
    assert str(data) in error
    assert sentence in error


def test_values_that_are_left_out_are_counted(tmp_path: Path, capsys: Captured) -> None:
    wrong = [[20.0, 130.0, 0.0, 0.3], [95.0, 0.0, 0.0, 0.3], [20.0, 21.0, 0.0, float("nan")], [20.0, 22.0, 0.0, -0.1]]
    data = written(tmp_path / "some.csv", [*rows(), *wrong, [20.0, 90.0, 0.0, 0.3]])
    assert run("fit", data, "--model", "lambert") == 0
    printed = capsys.readouterr().out
    assert "  left out: 2 below the horizon, 1 holes, 1 at the horizon, 1 not positive\n" in printed


def test_texts_are_read_by_the_options_of_an_import_and_doubts_are_said(tmp_path: Path, capsys: Captured) -> None:
    """The lobe of the file is at azimuth 0, because the file counts from the direction into which light travels."""
    lines = [f"{line[0]},{line[1]},{180.0 - line[2]},{100.0 * line[3]}" for line in rows()]
    data = tmp_path / "scan.csv"
    data.write_text("\n".join(["ein,aus,dreh,wert", *lines]) + "\n")
    names = [f"--column={role}={name}" for role, name in (("theta_i", "ein"), ("theta_r", "aus"), ("values", "wert"))]
    assert run("fit", data, "--model", "ward") == 2
    assert "--column theta_i=NAME" in capsys.readouterr().err
    percent = ["--column=delta_phi=dreh", *names]
    assert run("fit", data, "--model", "ward", *percent) == 0
    printed = capsys.readouterr().out
    assert "--azimuth forward" in printed
    assert "Units? An albedo above 1" in printed


def test_files_without_a_usable_sample_are_refused(tmp_path: Path, capsys: Captured) -> None:
    dark = written(tmp_path / "dark.csv", [[*line[:3], -0.01] for line in rows()])
    holes = written(tmp_path / "holes.csv", [[*line[:3], float("nan")] for line in rows()])
    noise = tmp_path / "noise.csv"
    noise.write_bytes(np.random.default_rng(0).bytes(4096))
    for file, words in (
        (dark, "dark has no value that the residual noise can use"),
        (holes, "no value"),
        (noise, "no format recognises it"),
        (tmp_path / "missing.csv", "No such file or directory"),
    ):
        assert run("fit", file, "--model", "lambert") == 2
        error = capsys.readouterr().err
        assert words in error
        assert error.count("\n") == 1


def test_a_sum_has_no_recipe(tile: Path, tmp_path: Path, capsys: Captured) -> None:
    recipe = tmp_path / "fit.toml"
    assert run("fit", tile, "--model", "lambert + ward", "--recipe", recipe) == 2
    captured = capsys.readouterr()
    reason = "no recipe can be written: "
    assert reason in captured.err
    assert reason in captured.out  # also where no recipe is asked for
    assert not recipe.exists()


PUBLISHED = """\
# Lobes of tiles
tile-1 = Aggregate(Lambertian(albedo = [0.1, 0.2, 0.3]), NganWard(albedo = [0.05, 0.06, 0.07], roughness = 0.3))
slab = Aggregate(Lambertian(albedo = [0.0, 0.0, 0.0]), NganHe(albedo = [2.5, 9, 1], autocorrelation = 28.0, eta = 0.9))
"""


def test_published_fits_are_listed_and_become_a_recipe(tmp_path: Path, capsys: Captured) -> None:
    data, out, recipe = tmp_path / "tiles.fit", tmp_path / "tiles.json", tmp_path / "tiles.toml"
    data.write_text(PUBLISHED, encoding="utf-8")
    assert run("fit", data, "--json", out, "--recipe", recipe, "--channel", "R") == 0
    printed = capsys.readouterr().out
    assert printed.startswith("tiles: 2 published fits, Lambertian + NganWard + NganHe\n  Lobes of tiles\n")
    assert re.search(
        r"physics: the scale of NganHe is 9, .*\n.* physics: the refractive index of NganHe is 0.9", printed
    )
    assert re.search(r"  1 of 2 .* physics; 1 are models of the registry \(ward\)", printed)
    assert "  note  NganHe: no model of the registry is used for it" in printed
    assert [len(one["flags"]) for one in json.loads(out.read_text(encoding="utf-8"))["fits"]] == [0, 2]
    assert "the recipe has channel" not in printed
    assert [job.material.name for job in recipe_file.load(recipe).jobs()] == ["tile-1-tiles-r"]
    assert run("fit", data, "--recipe", recipe) == 0
    assert "  note  the recipe has channel G " in capsys.readouterr().out
    assert run("fit", data, "--model", "ward") == 2
    assert "--model: " in capsys.readouterr().err


def test_nuisance_numbers_are_proposed_fitted_and_printed(tmp_path: Path, capsys: Captured) -> None:
    lines = np.array(rows())
    lines[:, 3] *= 1.0 - 0.2 * np.linspace(0.0, 1.0, len(lines))
    data, out, recipe = written(tmp_path / "lamp.csv", lines.tolist()), tmp_path / "fit.json", tmp_path / "fit.toml"
    assert run("fit", data, "--model", "ward", "--json", out) == 0
    assert "--nuisance drift fits it" in capsys.readouterr().out
    (plain,) = json.loads(out.read_text(encoding="utf-8"))["fits"]
    assert plain["proposed"] == ["drift"]
    assert run("fit", data, "--model", "ward", "--nuisance", "drift", "--json", out, "--recipe", recipe) == 0
    printed = capsys.readouterr().out
    assert re.search(r"\n  drift +-0\.\d+ ± [\d.]+  95 %: -0\.\d+ to -0\.\d+ ", printed)
    document = json.loads(out.read_text(encoding="utf-8"))
    jsonschema.validate(document, json.loads(schema("fits")))
    assert document["nuisance"] == ["drift"]
    (fitted,) = document["fits"]
    assert [one["name"] for one in fitted["nuisance"]] == ["drift", "curvature of the drift"]
    (job,) = recipe_file.load(recipe).jobs()
    for one in fitted["estimates"]:
        interval = f"{one['name']} {one['low']:.4g} to {one['high']:.4g}"
        assert interval in job.material.note
        assert one["low"] < TRUTH[one["name"]] < one["high"]
    assert "nuisance: 'lamp' is not one of tilt, drift, dark" in refused(
        capsys, "fit", data, "--nuisance", "drift,lamp", "--model", "ward"
    )


def test_a_fit_at_an_assumed_wavelength_says_so(tile: Path, tmp_path: Path, capsys: Captured) -> None:
    out, recipe = tmp_path / "fit.json", tmp_path / "fit.toml"
    assert run("fit", tile, "--model", "beckmann", "--json", out, "--recipe", recipe) == 0
    assert "fitted at an assumed wavelength of 550 nm" in capsys.readouterr().out
    assert "fitted at an assumed wavelength of 550 nm" in recipe.read_text(encoding="utf-8")
    document = json.loads(out.read_text(encoding="utf-8"))
    assert document["assumed_wavelength_nm"] == 550.0
    assert any("assumed wavelength of 550 nm" in one for one in document["fits"][0]["remarks"])
    assert run("fit", tile, "--model", "beckmann", "--wavelength-nm", "650", "--json", out) == 0
    assert "assumed wavelength" not in capsys.readouterr().out
