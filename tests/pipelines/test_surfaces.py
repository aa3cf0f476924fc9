"""The command `brdfdb surfaces`: the maps that are shipped, their pictures, and a computation that is interrupted."""

from __future__ import annotations

import json
import statistics
from pathlib import Path

import numpy as np
import pytest

from brdfdb.microgeometry import error_maps
from brdfdb.microgeometry.error_maps import COMPARISONS, MIRRORS, RHOS, SLOPES, Floats, Task, lights, viewers
from brdfdb.models import MODELS
from brdfdb_pipelines import surface_maps, surface_picture, surfaces
from tests.pipelines.command import Captured, refused, run


def test_the_table_shows_where_models_are_within_a_limit(capsys: Captured) -> None:
    assert run("surfaces", "oren_nayar", "beckmann") == 0
    out = capsys.readouterr().out
    lines = {line.split("  ")[0]: line.split() for line in out.splitlines()}
    assert {"oren_nayar", "oren_nayar interreflection=false", "beckmann"} <= set(lines)
    assert "vmf_diffuse" not in out
    entry = surface_maps.shipped()["models"]["beckmann"]
    within = [row["slope"] for row in entry["rows"] if max(row["p95"][:-1]) <= 0.2]
    assert lines["beckmann"][-1] == f"{max(within):g}"
    # the median over lights, and the error of 95 % of the viewers at the worst light up to 60 degrees and of all
    (row,) = (row for row in entry["rows"] if row["slope"] == 0.35)
    noise = statistics.median(row["noise"])
    assert statistics.median(row["median"]) < noise
    cell = f"<{100 * noise:.2g} ({100 * max(row['p95'][:-1]):.2g}, {100 * max(row['p95']):.2g})"
    assert cell in next(line for line in out.splitlines() if line.startswith("beckmann "))
    assert "realisations of each surface" in out


@pytest.mark.parametrize("option", ["--rays", "--realisations"])
def test_numbers_of_rays_without_a_file_to_write_are_refused(option: str, capsys: Captured) -> None:
    assert refused(capsys, "surfaces", option, 8) == f"{option}: is allowed only with --out"


def test_a_model_without_a_map_is_refused(capsys: Captured) -> None:
    sentence = refused(capsys, "surfaces", "ward")
    assert sentence.startswith("MODEL: ward has no map of its error; models with a map: lambert, oren_nayar,")


@pytest.mark.parametrize("suffix", ["svg", "png"])
def test_a_picture_of_chosen_maps_is_drawn(suffix: str, tmp_path: Path) -> None:
    file = tmp_path / f"maps.{suffix}"
    assert run("surfaces", "oren_nayar_gaussian", "beckmann", "--picture", file) == 0
    data = file.read_bytes()
    if suffix == "png":
        assert data.startswith(b"\x89PNG")
        return
    text = data.decode()
    assert "oren_nayar_gaussian" in text
    assert "red: limit of the paper" in text  # of Oren and Nayar
    assert "no limit stated" in text  # of Beckmann
    row = next(row for row in surface_maps.shipped()["models"]["beckmann"]["rows"] if row["slope"] == SLOPES[-1])
    assert f">{surface_maps.percent(row['p95'][-1])}<" in text


def test_the_limit_of_the_paper_is_between_the_slopes_that_it_divides() -> None:
    # Oren and Nayar: 1 % of a Gaussian of angles lies beyond 90 degrees for sigma = 90 / 2.576 degrees, 0.610 rad
    entry = surface_maps.shipped()["models"]["oren_nayar"]
    slopes = list(SLOPES)
    assert surface_picture.limit_of(entry, slopes) == slopes.index(0.65)
    assert surface_picture.limit_of(surface_maps.shipped()["models"]["beckmann"], slopes) is None


def made_up(task: Task) -> Floats:
    """Return rays that are Lambert's f_r, or Beckmann's, with a little noise."""
    rng = np.random.default_rng(task.number)
    wi, wr = lights()[:, np.newaxis], viewers(task.facets, task.slope)
    if task.facets == "diffuse":
        f_r = np.asarray(MODELS["lambert"].vectors(wi, wr, rho=1.0))[..., np.newaxis] * np.array(RHOS)
    else:
        alpha = np.sqrt(2.0) * task.slope
        f_r = np.asarray(MODELS["beckmann"].vectors(wi, wr, alpha_x=alpha, alpha_y=alpha, n=1.0, k=1e4))
        f_r = np.repeat(f_r[..., np.newaxis], len(MIRRORS), axis=-1)
    return np.stack([f_r] * 3) * (1.0 + 0.01 * rng.standard_normal((3, *f_r.shape)))


def test_an_interrupted_computation_resumes(monkeypatch: pytest.MonkeyPatch, capsys: Captured, tmp_path: Path) -> None:
    out = tmp_path / "maps.json"
    few = {name: COMPARISONS[name] for name in ("lambert", "oren_nayar_fujii", "beckmann")}
    monkeypatch.setattr(error_maps, "COMPARISONS", few)
    done: list[Task] = []

    def interrupted(task: Task, rays: int) -> Floats:
        assert rays == 64
        if len(done) == 7:
            raise KeyboardInterrupt
        done.append(task)
        return made_up(task)

    monkeypatch.setattr(surfaces, "traced", interrupted)
    command = ("surfaces", "lambert", "--out", out, "--realisations", 3, "--rays", 64, "--jobs", 1)
    assert run(*command) == 130
    assert "to resume: brdfdb surfaces" in capsys.readouterr().err
    assert not out.exists()
    # other rays do not belong into the same directory
    assert "estimates of other settings" in refused(capsys, *command[:-4], "--rays", 128, "--jobs", 1)

    def resumed(task: Task, rays: int) -> Floats:
        assert (rays, task in done) == (64, False)
        done.append(task)
        return made_up(task)

    monkeypatch.setattr(surfaces, "traced", resumed)
    assert run(*command) == 0
    assert len(done) == len(set(done)) == 3 * 2 * len(SLOPES)
    assert not out.with_name("maps.json.partial").exists()
    document = json.loads(out.read_text(encoding="utf-8"))
    assert document["provenance"]["realisations"] == 3
    assert document["provenance"]["rays"] == 64
    for row in document["models"]["lambert"]["rows"] + document["models"]["beckmann"]["rows"]:
        assert max(row["worst"]) < 0.04  # the noise of a mean of three
        assert min(row["noise"]) > 0.003


def test_one_realisation_and_a_directory_are_refused(capsys: Captured, tmp_path: Path) -> None:
    out = tmp_path / "maps.json"
    assert "no standard error" in refused(capsys, "surfaces", "--out", out, "--realisations", 1)
    assert "is a directory" in refused(capsys, "surfaces", "--out", tmp_path)
    assert not list(tmp_path.iterdir())
