"""Published fits: their text, what is no physics in them, and the recipe of those whose formula is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.fitting.published import PublishedFits, read_published, recipe_of
from brdfdb.models import MODELS
from brdfdb_pipelines import recipe_file

TEXT = """\
# Lobes that somebody fitted
# to tiles: https://example.org/tiles
tile-1 = Aggregate(Lambertian(albedo = [0.1, 0.2, 0.3]), NganWard(albedo = [0.05, 0.06, 0.07], roughness = 0.15))
tile-2 = Aggregate(Lambertian(albedo = [0.7, 0.8, 0.6]), NganWard(albedo = [0.5, 0.5, 0.5], roughness = 0.3))
tile-3 = Aggregate(Lambertian(albedo = [0.1, 0.2, 0.3]), NganWard(albedo = [0.05, 1.5, 0.07], roughness = 0.15))
tile-4 = Aggregate(Lambertian(albedo = [0.1, 0.2, 0.3]), NganWardDuer(albedo = [0.05, 0.06, 0.07], roughness = 0.15))

slab-1 = Aggregate(Lambertian(albedo = [0.0, 0.0, 0.0]), NganHe(albedo = [2.5, 1e2, 0.1], autocorrelation = 28.0, roughness = 0.1, eta = 0.9))
slab-2 = Aggregate(Lambertian(albedo = [0.0, 0.0, 0.0]), NganCookTorrance(albedo = [0.2, 0.2, 0.1], eta = 0.1, roughness = 0.1))
slab-3 = Sheen(albedo = [0.2, 0.2, 0.1])
chalk = Lambertian(albedo = 0.9)
"""  # noqa: E501 - lines as long as those of such files


@pytest.fixture
def published(tmp_path: Path) -> PublishedFits:
    path = tmp_path / "tiles.fit"
    path.write_text(TEXT, encoding="utf-8")
    return read_published(path)


def test_what_is_no_physics_is_flagged(published: PublishedFits) -> None:
    assert published.comment == "Lobes that somebody fitted to tiles: https://example.org/tiles"
    flags = {one.name: " ".join(one.flags) for one in published.fits}
    assert [name for name, sentences in flags.items() if not sentences] == [
        "tile-1",
        "tile-4",
        "slab-2",
        "slab-3",
        "chalk",
    ]
    assert flags["tile-2"].startswith("it reflects 1.")
    assert "from 0 degrees" in flags["tile-2"]
    assert "the scale of NganWard is 1.5, above 1 rho_s: 1.5 is outside [0, 1]" in flags["tile-3"]
    assert flags["slab-1"] == ("the scale of NganHe is 100, above 1 the refractive index of NganHe is 0.9, below 1")


def test_models_are_taken_where_the_formula_is_the_same(published: PublishedFits) -> None:
    models = {one.name: one.model for one in published.fits}
    assert models == {
        **dict.fromkeys(("tile-1", "tile-2", "tile-3"), "ward"),
        "tile-4": "ward_duer",
        **dict.fromkeys(("slab-1", "slab-2", "slab-3")),
        "chalk": "lambert",
    }
    said = " ".join(published.sentences)
    for words in ("NganHe: no model", "NganCookTorrance: no model", "Sheen: its formula is not known"):
        assert words in said
    chalk = published.fits[-1].albedo
    assert chalk is not None
    assert chalk.value == pytest.approx(0.9)


def test_the_recipe_has_what_is_not_flagged(published: PublishedFits, tmp_path: Path) -> None:
    path = tmp_path / "recipe.toml"
    path.write_text(recipe_of(published, "B"), encoding="utf-8")
    jobs = {job.material.name: job.material for job in recipe_file.load(path).jobs()}
    assert set(jobs) == {"tile-1-tiles-b", "tile-4-tiles-b", "chalk-tiles-b"}
    tile = jobs["tile-1-tiles-b"]
    assert tile.parameters == {"rho_d": 0.3, "rho_s": 0.07, "alpha_x": 0.15, "alpha_y": 0.15}
    assert "tiles.fit, line 3. Lobes that somebody fitted" in tile.source
    # the formula that such files mean: Ward's with the roughness as alpha
    theta_i, theta_r = 0.4, 0.7
    tangent = np.tan(0.5 * (theta_r - theta_i))
    expected = 0.3 / np.pi + 0.07 * np.exp(-((tangent / 0.15) ** 2)) / (
        4.0 * np.pi * 0.15**2 * np.sqrt(np.cos(theta_i) * np.cos(theta_r))
    )
    assert MODELS["ward"].evaluate(theta_i, 0.0, theta_r, np.pi, **tile.parameters) == pytest.approx(expected)
    with pytest.raises(ParameterError, match="'X' is not one of R, G, B"):
        recipe_of(published, "X")


def test_other_texts_are_refused_in_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / "wrong.fit"
    refused = {
        "": "it has no line",
        "# nothing\n": "it has no line",
        "theta_i,theta_r,f_r\n10,10,0.3\n": "line 1 is not",
        "a = Lambertian(albedo = [0.1, 0.2])": "line 1 (a): albedo of Lambertian has 2 values",
        "a = Lambertian(albedo = 1e999)": "albedo of Lambertian has 1 values",
        f"a = Lambertian(albedo = {'9' * 400})": "albedo of Lambertian is neither",
        "a = Lambertian(albedo = [x, 0.2, 1])": "albedo of Lambertian is neither",
        "a = Aggregate(Lambertian(albedo = 0.1), 3)": "line 1 (a): it is not",
        "\n\na = Aggregate(Lambertian(albedo": "line 3 (a): it is not",
        "a = " + "f(" * 1000 + ")" * 1000: "line 1 (a): it is not",
        "a = Lambertian(albedo = 0.1)" + " " * 5000: "line 1 is not",
        "a = Lambertian(**{'albedo': 0.1})": "is neither",
    }
    for text, sentence in refused.items():
        path.write_text(text, encoding="utf-8")
        with pytest.raises(FileFormatError) as caught:
            read_published(path)
        assert str(caught.value).startswith(f"{path}: ")
        assert sentence in str(caught.value)
    path.write_bytes(b"a = \xff\xfe")
    with pytest.raises(FileFormatError, match="not UTF-8 text"):
        read_published(path)
