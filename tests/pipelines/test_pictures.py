"""brdfdb plot and gallery: the files that they write, and what they refuse."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import OpenEXR
import pytest
from matplotlib.image import imread

import brdfdb
from brdfdb import errors
from brdfdb.materials import Material
from brdfdb.scenes.lit_sphere import lit_sphere
from brdfdb.store.publication import publish_dataset
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import tabulate
from brdfdb_pipelines import contact_sheet
from tests.pipelines.a_lambert import publish_lambert
from tests.pipelines.command import Captured, refused, run


def test_plot_writes_a_file_of_each_kind(built: Path, tmp_path: Path, capsys: Captured) -> None:
    assert run("plot", "foam", "--store", built, "--out", tmp_path / "plots") == 0
    names = sorted(path.name for path in (tmp_path / "plots").iterdir())
    assert names == [f"foam-{kind}.png" for kind in ("albedo", "cuts", "lobe", "slices")]
    assert all(np.ptp(imread(path)[..., :3]) > 0.5 for path in (tmp_path / "plots").iterdir())
    assert capsys.readouterr().out == f"4 PNG files in {tmp_path / 'plots'}\n"


def test_plot_writes_the_same_svg_again(built: Path, tmp_path: Path) -> None:
    texts = []
    for out in (tmp_path / "one", tmp_path / "two"):
        assert run("plot", "foam", "--kind", "lobe", "--format", "svg", "--store", built, "--out", out) == 0
        texts.append((out / "foam-lobe.svg").read_bytes())
    assert texts[0] == texts[1]
    assert ElementTree.fromstring(texts[0]).tag.endswith("svg")


def test_unknown_names_are_refused_before_anything_is_drawn(built: Path, tmp_path: Path, capsys: Captured) -> None:
    for command, name in (("plot", "new"), ("gallery", "new.png")):
        sentence = refused(capsys, command, "foam", "foan", "--store", built, "--out", tmp_path / name)
        assert "no material 'foan' in the store; closest: foam" in sentence
    assert list(tmp_path.iterdir()) == []


def test_gallery_has_a_sphere_of_each_material(built: Path, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "sheet.png"
    assert run("gallery", "--store", built, "--out", out, "--jobs", "2") == 0
    store = brdfdb.open(built)
    image = imread(out)[..., :3]
    count = len(store)
    assert f"{count} materials, {image.shape[1]} x {image.shape[0]} pixels" in capsys.readouterr().out
    assert image.shape[1] == contact_sheet.WIDTH
    # the first sphere stands in the upper left cell; its middle has the colour of the library
    first = next(iter(contact_sheet.sections({name: store[name] for name in store}).values()))[0]
    sphere = lit_sphere(first, contact_sheet.SPHERE)
    middle = sphere[contact_sheet.SPHERE // 2, contact_sheet.SPHERE // 2, :3]
    differences = np.abs(image - middle).max(axis=-1)
    assert differences[:400, :200].min() < 2.0 / 255.0


def test_gallery_in_linear_light_is_the_same_sheet(built: Path, tmp_path: Path, capsys: Captured) -> None:
    for suffix in (".png", ".exr"):
        assert run("gallery", "foam", "--store", built, "--out", tmp_path / f"sheet{suffix}") == 0
    assert "sheet.png: 1 material, 1400 x" in capsys.readouterr().out
    screen = imread(tmp_path / "sheet.png")[..., :3]
    with OpenEXR.File(str(tmp_path / "sheet.exr"), separate_channels=True) as file:
        linear = np.stack([file.channels()[name].pixels for name in "RGB"], axis=-1).clip(0.0, 1.0)
    encoded = np.where(linear > 0.0031308, 1.055 * linear ** (1.0 / 2.4) - 0.055, 12.92 * linear)
    # edges of spheres are mixed with the page with and without the transfer curve
    assert np.mean(np.abs(encoded - screen).max(axis=-1) < 1.0 / 255.0) > 0.995


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """Directory of a store with gold in steps of 25 nm, and gold that is known from 400 to 600 nm."""
    about = {"title": "Gold", "model": "he_torrance", "source": "a test", "refractive_index": "main/Au/Johnson"}
    parameters = {"sigma_0_um": 0.1, "tau_um": 2.0}
    theta = [0, 30, 60, 85]
    grid = Grid({"theta_i": theta, "theta_r": theta, "delta_phi": [0, 90, 180]})
    for name, last_nm in (("gold", 700.0), ("narrow", 600.0)):
        material = Material.from_table(name, about | {"parameters": parameters})
        publish_dataset(tmp_path / "own", name, tabulate(Layout(material, grid, np.arange(400.0, last_nm + 1.0, 25.0))))
    return tmp_path / "own"


def test_gallery_shows_a_colour_or_says_why_not(own: Path, tmp_path: Path, capsys: Captured) -> None:
    assert run("gallery", "--store", own, "--out", tmp_path / "sheet.png") == 0
    assert capsys.readouterr().out.splitlines()[1:] == [
        "narrow: grey, at 400 nm: a colour needs wavelengths from 420 to 680 nm, and the table has 400 to 600 nm"
    ]
    gold, narrow = (brdfdb.open(own)[name] for name in ("gold", "narrow"))
    assert [contact_sheet.colour_known(table) for table in (gold, narrow)] == ["", "400-600 nm, grey"]
    red, _, blue, _ = lit_sphere(gold, 16)[8, 8]
    assert red > 1.2 * blue
    grey = lit_sphere(narrow, 16)[8, 8, :3]
    assert np.ptp(grey) < 1e-6


@pytest.mark.parametrize(("rho", "words"), [(0.005, "albedo < 0.01"), (0.5, "grey")])
def test_a_black_sphere_names_its_albedo(tmp_path: Path, rho: float, words: str) -> None:
    largest = {"albedo": rho, "theta_i_deg": 0.0, "wavelength_nm": None, "tolerance": 0.001}
    publish_lambert(tmp_path, "felt", rho, largest_albedo=largest)
    assert contact_sheet.colour_known(brdfdb.open(tmp_path)["felt"]) == words


def test_sources_of_one_material_share_a_row(tmp_path: Path, capsys: Captured) -> None:
    sources = {name: f"a very long run {name} of a gonio" for name in "abcd"} | {"e": "twice", "f": "twice, again"}
    for name, source in sources.items():
        publish_lambert(tmp_path / "own", name, 0.5, source)
    store = brdfdb.open(tmp_path / "own")
    groups = contact_sheet.sections({name: store[name] for name in store})
    assert {paper: [table.name for table in tables] for paper, tables in groups.items()} == {
        "twice": ["e", "f"],
        contact_sheet.OTHERS: ["a", "b", "c", "d"],
    }
    assert contact_sheet.shortened(sources["a"]) == "a very long run a\nof a gonio"
    assert contact_sheet.shortened("one two three four five six seven eight") == "one two three four\nfive six seven…"
    assert run("gallery", "--store", tmp_path / "own", "--out", tmp_path / "sheet.png") == 0
    assert "6 materials, 1400 x" in capsys.readouterr().out
    assert len(imread(tmp_path / "sheet.png")) < 800


def test_names_are_broken_after_hyphens() -> None:
    assert contact_sheet.wrapped("latex-semi-gloss-sprayed-sheetrock") == "latex-semi-gloss-\nsprayed-sheetrock"
    assert contact_sheet.wrapped("foam") == "foam"
    assert "".join(contact_sheet.wrapped("a-" * 40 + "b").split("\n")) == "a-" * 40 + "b"


@pytest.mark.parametrize("command", ["plot", "gallery"])
def test_a_missing_extra_is_named(command: str, built: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    def missing(module: str) -> None:
        raise errors.MissingExtraError(f"{module} is not installed")

    monkeypatch.setattr(errors, "import_extra", missing)
    assert "is not installed" in refused(capsys, command, "foam", "--store", built)


@pytest.mark.parametrize(
    ("name", "sentence"), [("", "is a directory"), ("sheet.svg", "does not end in .png"), ("sheet", "in .png")]
)
def test_gallery_refuses_other_files_before_it_draws(
    name: str, sentence: str, built: Path, tmp_path: Path, capsys: Captured
) -> None:
    with pytest.raises(SystemExit, match="2"):
        run("gallery", "foam", "--store", built, "--out", f"{tmp_path}/{name}")
    assert sentence in capsys.readouterr().err


def test_gallery_makes_no_directories(built: Path, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "no" / "sheet.png"
    assert f"cannot write {out}: " in refused(capsys, "gallery", "foam", "--store", built, "--out", out)
    assert list(tmp_path.iterdir()) == []
