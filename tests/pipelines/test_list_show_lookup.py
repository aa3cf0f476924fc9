"""What list, show and lookup tell of planned tables: the grid, how f_r comes of it, and the error that is stated."""

from __future__ import annotations

import json
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb.materials import Material, presets
from brdfdb.store.catalogue import line_of, material_document
from brdfdb.store.publication import publish_dataset
from brdfdb.tables.albedo import directional_albedo
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import tabulate
from brdfdb_pipelines import terminal
from brdfdb_pipelines.commands import show
from tests.pipelines.command import Captured, refused, run

RECIPE = """\
materials = ["rolled-brass", "scene-copper-sphere"]
wavelengths_nm = [{ start = 400, stop = 700, step = 25 }]
tolerance = 0.05
"""


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("planned")
    (folder / "recipe.toml").write_text(RECIPE, encoding="utf-8")
    assert run("build", folder / "recipe.toml", "--store", folder / "store", "--jobs", "1") == 0
    return folder / "store"


def test_list_has_a_column_with_the_stated_error(planned: Path, capsys: Captured) -> None:
    capsys.readouterr()
    assert run("list", "--store", planned) == 0
    title, head, *lines, explained = capsys.readouterr().out.splitlines()
    assert title.strip() == f"2 materials in {planned}"
    assert explained.startswith("table error: ")
    columns = re.split(r"  +", head)
    assert columns[3:8] == [
        *("colours", "table error (p99)", "formula error (p99)", "as published or measured?", "conserves energy?")
    ]
    store = brdfdb.open(planned)
    assert len(lines) == 2
    for line in lines:
        error = store[line.split()[0]].error
        assert error is not None
        assert f" {terminal.error(error.overall.p99)}  " in line
    # Ward's model is a fit itself, and He and Torrance's is the sum that others cut short
    assert [re.split(r"  +", line)[3:8:2] for line in lines] == [
        ["grey", "no exact form", "not audited: albedo of the model exceeds 1 above 89.9965°"],
        ["400-700 nm", "0, exact form", "not audited"],
    ]


def test_show_says_up_to_which_light_an_albedo_is_the_largest_and_how_it_goes_on(
    planned: Path, capsys: Captured
) -> None:
    assert run("show", "rolled-brass", "--store", planned) == 0
    largest = "reflects at most 0.417 for lights up to 89.9°, at 0°; grows as cos^-1/2 and exceeds 1 above 89.9965°"
    assert f"    largest     the model {largest}\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "names"),
    [
        (("--sort", "name"), ["rolled-brass", "scene-copper-sphere"]),
        (("--sort=-bytes",), ["scene-copper-sphere", "rolled-brass"]),
        (("--model", "ward"), ["rolled-brass"]),
        (("--paper", "HE1991"), ["scene-copper-sphere"]),
        (("--words", "copper rough"), ["scene-copper-sphere"]),
        (("--words", "copper", "--model", "ward"), []),
    ],
)
def test_list_shows_some_materials_in_an_order(
    planned: Path, capsys: Captured, options: tuple[str, ...], names: list[str]
) -> None:
    assert run("list", "--store", planned, *options) == 0
    first = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert [name for name in first if name in ("rolled-brass", "scene-copper-sphere")] == names


def test_list_refuses_what_it_cannot_do(planned: Path, capsys: Captured) -> None:
    list_planned = ("list", "--store", planned)
    assert refused(capsys, *list_planned, "--sort", "colour").startswith("--sort: 'colour' is not one of 'name', ")
    assert refused(capsys, *list_planned, "--presets", "--model", "ward").startswith("--model: ")


def test_a_table_of_another_program_is_shown_with_a_sentence_on_what_it_lacks(tmp_path: Path, capsys: Captured) -> None:
    grid = Grid({"theta_i": [0, 45, 85], "theta_r": [0, 45, 85], "delta_phi": [0, 90, 180]})
    whole = tabulate(Layout(presets()["clay-vase"], grid))
    publish_dataset(tmp_path, "bare", whole[["brdf"]].drop_attrs(deep=False))
    publish_dataset(tmp_path, "whole", whole)
    gaps = "does not state its title, material, table version, model, model version, parameters, source, conventions"
    assert run("list", "--store", tmp_path) == 0
    assert capsys.readouterr().out.endswith(f"\nbare r000001 {gaps}\n")
    assert run("show", "bare", "--store", tmp_path) == 0
    out = capsys.readouterr().out
    assert out.startswith(f"bare: no title\n  incomplete  the table {gaps}\n  grid\n")
    assert "  error       not measured\n" in out
    assert "\n  albedo, as tabulated" in out
    assert run("verify", "--store", tmp_path) == 0
    captured = capsys.readouterr()
    assert f"brdfdb: bare r000001 {gaps}\n" in captured.err
    assert captured.out.endswith(": none damaged\n")


def test_no_paper_is_cited_for_a_table_without_a_record_of_its_source(tmp_path: Path, capsys: Captured) -> None:
    """The attributes cite He et al. 1991; nothing says that the values are of them."""
    grid = Grid({"theta_i": [0, 45, 85], "theta_r": [0, 45, 85], "delta_phi": [0, 90, 180]})
    whole = tabulate(Layout(presets()["blue-plastic"], grid, np.array([460.0])))
    claimed = {key: value for key, value in whole.attrs.items() if key != "source_record"}
    publish_dataset(tmp_path, "whole", whole)
    publish_dataset(tmp_path, "claimed", whole.drop_attrs(deep=False).assign_attrs(claimed))
    said = {}
    for name in ("whole", "claimed"):
        assert run("show", name, "--store", tmp_path) == 0
        shown = capsys.readouterr().out
        assert run("export", "csv", name, "--store", tmp_path, "--out", tmp_path / name) == 0
        capsys.readouterr()
        exported = "".join(path.read_text(encoding="utf-8") for path in (tmp_path / name).iterdir() if path.is_file())
        store = brdfdb.open(tmp_path)
        document = json.dumps(material_document(store[name], None), default=str)
        line = json.dumps(line_of(name, store.summary(name), partial(store.metadata, name)))
        said[name] = [
            any(word in text for word in ("He et al.", "he1991")) for text in (shown, exported, document, line)
        ]
    assert said == {"whole": [True] * 4, "claimed": [False] * 4}
    assert "  source      not recorded" in shown


@pytest.mark.parametrize(
    ("p99", "text"),
    [
        (None, "not measured"),
        (0.0101, "1.0 %"),
        (0.00946, "0.95 %"),
        (0.2, "20 %"),
        (1.5, "150 %"),
        (34.0, "a factor of 35"),
        (0.998, "100 %"),
        (4e-8, "< 0.001 %"),
    ],
)
def test_errors_in_percent(p99: float | None, text: str) -> None:
    assert terminal.error(p99) == text


def in_percent(bands: list[list[float]]) -> list[str]:
    """The worst of each band, as a row of `show` has it, without blanks."""
    return [re.sub(r"a factor of ", "x", terminal.error(max(row))).replace(" ", "") for row in bands]


@pytest.mark.parametrize(("name", "edges"), [("rolled-brass", (False, False)), ("scene-copper-sphere", (False, True))])
def test_show_tells_grid_numbers_and_error_of_a_planned_table(
    name: str, edges: tuple[bool, bool], planned: Path, capsys: Captured
) -> None:
    assert run("show", name, "--store", planned) == 0
    out = capsys.readouterr().out
    table = brdfdb.open(planned)[name]
    assert ("parts   " in out) == (table.spectra is not None)
    assert f"    values          {table.values.size}, " in out
    assert f"{table.interpolation.method}, of " in out
    assert table.attrs["reason"] in out
    assert table.attrs["reconstruction"] in out
    assert table.error is not None
    assert f"  error       {terminal.error(table.error.overall.p99)} of f_r" in out
    (reflected,) = re.findall(r"^    reflected light +(.*)$", out, flags=re.MULTILINE)
    assert re.sub("([<x]) ", r"\1", reflected).split() == in_percent(table.error.l1)
    places = table.error.places
    assert places is not None
    limits = {"near the light": places.alongside, "one direction grazing": places.one_grazing}
    limits["both grazing"] = places.both_grazing
    if table.error.between is not None:
        limits["between wavelengths"] = table.error.between.bands
    assert ("between wavelengths" in limits) == (table.wavelength_nm is not None)
    for label, rows in limits.items():
        (printed,) = re.findall(rf"^    {label}  +(.*)$", out, flags=re.MULTILINE)
        assert re.sub("([<x]) ", r"\1", printed).split() == in_percent(rows)
    assert f"; {terminal.error(table.error.overall.l1)} of the reflected light (l1))" in out
    assert re.search(r"^  validity    .*that the paper states", out, flags=re.MULTILINE)
    assert ("    not met     " in out, "    at the edge " in out) == edges


def test_lookup_tells_the_stated_error_if_asked(planned: Path, capsys: Captured) -> None:
    store = brdfdb.open(planned)
    wavelengths = store["scene-copper-sphere"].wavelength_nm
    assert wavelengths is not None
    middle = float(0.5 * (wavelengths[0] + wavelengths[1]))
    command = ("lookup", "scene-copper-sphere", 30, 0, 30, 10, "--store", planned)
    angles = np.deg2rad([30.0, 0.0, 30.0, 10.0])
    found = store["scene-copper-sphere"].lookup_with_error(*angles, middle)
    assert run(*command, "--wavelength-nm", middle, "--with-error") == 0
    assert capsys.readouterr().out.startswith(f"{middle:g} nm  {found.brdf:.6g} +- {found.error:.2g} /sr")
    assert abs(found.brdf - presets()["scene-copper-sphere"].lookup(*angles, middle)) <= found.error
    assert run(*command, "--json") == 0
    without = json.loads(capsys.readouterr().out)
    assert run(*command, "--json", "--with-error") == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer.pop("error") == store["scene-copper-sphere"].lookup_with_error(*angles).error.tolist()
    assert answer == without


def test_a_title_of_a_strange_store_cannot_write_on_the_terminal(tmp_path: Path, capsys: Captured) -> None:
    dataset = tabulate(
        Layout(presets()["foam"], Grid({axis: [0, 80] for axis in ("theta_i", "theta_r")} | {"delta_phi": [0, 180]}))
    )
    publish_dataset(tmp_path, "foam", dataset.assign_attrs(title="\x1b[2Jgone\u202e"))
    assert run("show", "foam", "--store", tmp_path) == 0
    assert run("list", "--store", tmp_path) == 0
    out = capsys.readouterr().out
    assert out.count("\\x1b[2Jgone\\u202e") == 2
    assert "\x1b" not in out
    assert "\u202e" not in out


@pytest.mark.parametrize(
    ("angles", "like_radians"),
    [
        ((0.52, 0, 0.52, 3.14), True),
        ((0.5, -1.57, 0, 0), True),
        ((1, 0, 3, 2), False),
        ((0.5, 0, 0.5, 3.3), False),
        ((0, 0, 0, 0), False),
        ((3.2, 0, 0.1, 0), False),
    ],
)
def test_angles_like_radians_are_told_and_answered(
    angles: tuple[float, ...], like_radians: bool, built: Path, capsys: Captured
) -> None:
    assert run("lookup", "foam", *angles, "--store", built) == 0
    printed = capsys.readouterr()
    assert float(printed.out.split()[0]) > 0.0
    shown = " ".join(f"{angle:g}" for angle in angles)
    said = rf"brdfdb: angles .* radians: {re.escape(shown)}\n" if like_radians else ""
    assert re.fullmatch(said, printed.err)


def test_an_azimuth_without_meaning_is_refused_in_degrees(built: Path, capsys: Captured) -> None:
    said = refused(capsys, "lookup", "foam", 30, -720.5, 40, 0, "--store", built)
    assert said == "phi_i: -720.5 is outside [-720, 720] degrees"
    said = refused(capsys, "photograph", "foam", "--light", 30, 721, "--out", built / "pictures", "--store", built)
    assert said == "--light: 721 is outside [-720, 720] degrees"
    said = refused(capsys, "lookup", "foam", 30, -720, 40, 720, "--store", built, "--wavelength-nm", 0.55)
    assert said == "wavelength_nm: 0.55 is below 1 nm; is it in micrometres?"


def test_n_and_k_of_a_table_take_the_place_of_their_entry(planned: Path) -> None:
    """Compare what `show` computes with the n and k of the table, and with those of their entry."""
    table = brdfdb.open(planned)["scene-copper-sphere"]
    source = show._source_of(table)
    assert isinstance(source, Material)
    assert isinstance(table.source, Material)
    held, looked_up = (material.arguments(table.wavelength_nm) for material in (source, table.source))
    assert held.keys() == looked_up.keys()
    for name, value in looked_up.items():
        np.testing.assert_array_equal(held[name], value)
    angles = np.array(show.ALBEDO_ANGLES_DEG)
    albedos = [directional_albedo(table, angles, source=material).albedo for material in (source, None)]
    np.testing.assert_array_equal(*albedos)
