"""The command `brdfdb convert`: what it prints, its JSON, and its snippet in a recipe."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from brdfdb.figure import Panel, curve_of
from brdfdb_pipelines import recipe_file
from brdfdb_pipelines.convert import curves_on
from tests.pipelines.command import Captured, refused, run


@pytest.fixture(scope="module")
def fit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recipe with the fit of the paper: the facets of the default recipe take seconds to integrate."""
    recipe = tmp_path_factory.mktemp("fit") / "fit.toml"
    recipe.write_text('materials = ["clay-vase"]\nforms = "paper"\ntolerance = 0.05\n', encoding="utf-8")
    return recipe


def clay(recipe: Path, model: str = "oren_nayar_fujii") -> tuple[str, ...]:
    return "convert", "clay-vase", "--to", model, "--recipe", str(recipe)


def test_the_snippet_is_a_recipe_that_builds(fit: Path, tmp_path: Path, capsys: Captured) -> None:
    assert run(*clay(fit)) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("clay-vase (oren_nayar) as oren_nayar_fujii\n  parameters\n    rho ")
    assert "  worst view  l1 " in printed
    recipe = tmp_path / "recipe.toml"
    recipe.write_text(
        'materials = ["clay-*-as-*"]\ntolerance = 0.05\n\n' + printed[printed.index("[define") :], encoding="utf-8"
    )
    (job,) = recipe_file.load(recipe).jobs()
    assert job.material.model == "oren_nayar_fujii"
    recipe.write_text(printed[printed.index("[define") :], encoding="utf-8")  # by itself it is no recipe to build
    assert run("convert", "clay-vase-as-oren-nayar-fujii", "--recipe", recipe, "--to", "lambert", "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert document["source_model"] == "oren_nayar_fujii"
    assert document["material"]["parameters"].keys() == {"rho"}


def test_both_models_are_drawn(fit: Path, tmp_path: Path, capsys: Captured) -> None:
    first, again, bitmap = tmp_path / "new" / "clay.svg", tmp_path / "again.svg", tmp_path / "clay.png"
    for file in (first, again, bitmap):
        assert run(*clay(fit), "--picture", file) == 0
    text = first.read_text(encoding="utf-8")
    assert text == again.read_text(encoding="utf-8")
    assert text.startswith("<svg ")
    for words in ("clay-vase as oren_nayar_fujii", "theta_i = 75 degrees", "light in the wrong place", "f_r [1/sr]"):
        assert words in text
    assert "l1 [%]" in text
    assert bitmap.read_bytes().startswith(b"\x89PNG")
    capsys.readouterr()
    with pytest.raises(SystemExit):
        run(*clay(fit), "--picture", tmp_path / "clay.pdf")
    assert "does not end in .svg or .png" in capsys.readouterr().err


def test_logarithmic_panels_side_by_side_have_the_same_kind_of_labels() -> None:
    labels = []
    for low in (2e-3, 2e-6):
        curve = curve_of("a lobe", [0.0, 1.0], [low, 1.0])
        panel = Panel(x_label="x", y_label="y", curves=[curve], log_y=True)
        axes = Figure().add_subplot()
        curves_on(axes, panel)
        labels.append([label.get_text() for label in axes.get_yticklabels()])
    assert "10⁻²" in labels[0]
    assert "10⁻⁴" in labels[1]


def test_a_fixed_angle_is_in_degrees(fit: Path, capsys: Captured) -> None:
    assert run(*clay(fit, "oren_nayar_qualitative"), "--fix", "sigma_deg=20") == 0
    assert "sigma_deg       20          fixed" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            ("clay-vas", "--to", "lambert"),
            "clay-vas: no such material, neither in the store nor in the recipe",
        ),
        (("clay-vase", "--to", "lamber"), "model: 'lamber' is unknown; closest: lambert"),
        (("clay-vase", "--to", "lambert", "--fix", "r=1"), "--fix r=1: the parameters of lambert are rho"),
        (("clay-vase", "--to", "lambert", "--fix", "rho=x"), "--fix rho=x: 'x' is not a number, true or false"),
        (("clay-vase", "--to", "lambert", "--fix", "rho=true"), "rho: True is not a number"),
    ],
)
def test_a_wrong_request_gets_a_sentence(
    arguments: tuple[str, ...], sentence: str, tmp_path: Path, capsys: Captured
) -> None:
    assert refused(capsys, "convert", *arguments, "--store", tmp_path / "none").startswith(sentence)
