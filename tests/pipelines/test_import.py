"""The command `brdfdb import`: its statements, JSON, columns of texts, and samples as netCDF."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from brdfdb import formats, models
from brdfdb.measurements.statement import Claim, statement
from brdfdb_pipelines.import_samples import _percent, in_a_line
from tests.pipelines.command import Captured, refused, run


@pytest.fixture
def tile(tmp_path: Path) -> Path:
    """A white tile whose values are reflectance factors under a name that says nothing."""
    rows = [f"20 {theta} {turn} 0.8" for theta in range(0, 81, 10) for turn in range(0, 360, 30)]
    path = tmp_path / "tile.dat"
    path.write_text("\n".join(["sun view turn number", *rows, ""]), encoding="utf-8")
    return path


COLUMNS = ("theta_i=sun", "theta_r=view", "delta_phi=turn", "values=number")
OPTIONS = [part for column in COLUMNS for part in ("--column", column)]


def test_units_that_are_wrong_are_noticed_and_can_be_said(tile: Path, capsys: Captured) -> None:
    assert run("import", tile, *OPTIONS) == 0
    printed = capsys.readouterr().out
    assert printed.startswith(f"{tile}: tile\n  97 samples of 1 channel: 1 direction of the light, from one azimuth")
    assert "Albedo at theta_i 20: 2.513;" in printed
    assert "Units? An albedo above 1: the values integrate to 2.513. The values may be reflectance factors" in printed
    assert run("import", tile, *OPTIONS, "--quantity", "reflectance_factor") == 0
    printed = capsys.readouterr().out
    assert "Albedo at theta_i 20: 0.8000;" in printed
    assert "Units?" not in printed


def test_several_files_are_one_object_of_json(tile: Path, capsys: Captured) -> None:
    assert run("import", tile, tile, *OPTIONS, "--angles", "deg", "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    documents = printed["statements"]
    assert printed["refused"] == []
    assert [document["file"] for document in documents] == [str(tile)] * 2
    assert documents[0]["incidences"][0]["albedo"] == pytest.approx([0.8 * np.pi])
    assert documents[0]["hints"] == [documents[0]["sentences"][-1]]


def test_samples_are_written_as_netcdf_that_is_imported_again(tile: Path, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "tile.nc"
    assert run("import", tile, *OPTIONS, "--quantity", "reflectance_factor", "--out", out) == 0
    first = capsys.readouterr().out.splitlines()
    assert first[-1] == f"  written: {out}"
    assert formats.samples(out).values == pytest.approx(0.8 / np.pi)
    assert run("import", out) == 0
    assert capsys.readouterr().out.splitlines()[1:] == first[1:-1]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--column", "theta_i"], "--column: 'theta_i' is not NAME=HEADER"),
        (["--column", "theta_q=sun"], "theta_q: no format has this keyword; allowed are angles, delta_phi"),
        ([*OPTIONS, "--out", "tile.txt"], "--out: 'tile.txt' does not end in .nc"),
        (["--format", "paper"], "file_format: 'paper' is not one of astm,"),
        (["--wavelength-nm", "0.5", *OPTIONS], "wavelength_nm: 0.5 is outside [10, 1e+06] nm"),
        (["--member", "white"], "no format recognises it"),
        ([], "no format recognises it"),
    ],
)
def test_mistakes_are_one_sentence(options: list[str], sentence: str, tile: Path, capsys: Captured) -> None:
    assert sentence in refused(capsys, "import", tile, *options)


def test_empty_words_are_refused(tile: Path, tmp_path: Path, capsys: Captured) -> None:
    assert refused(capsys, "import", tile, *OPTIONS, "--angles", "").startswith("--angles: it is empty")
    store = ("--store", tmp_path / "store")
    assert refused(capsys, "import", tile, *OPTIONS, *store, "--name", "").startswith("--name: '' is not made of")


FITS = "# published fits\nbrass = Ward(a = 0.1)\n"


def test_one_file_is_written_at_a_time(tile: Path, tmp_path: Path, capsys: Captured) -> None:
    out, fits = tmp_path / "two.nc", tmp_path / "ward.fit"
    fits.write_text(FITS)
    assert refused(capsys, "import", tile, tile, *OPTIONS, "--out", out).startswith("--out: ")
    assert not out.exists()
    no_samples = "ward.fit: a file of published fits holds no samples; `brdfdb fit` lists the fits"
    assert no_samples in refused(capsys, "import", fits)
    assert "missing.csv: No such file or directory" in refused(capsys, "import", tmp_path / "missing.csv")


def test_fits_take_azimuths_from_the_forward_direction(tmp_path: Path, capsys: Captured) -> None:
    rows = ["sza,vza,raa,brdf"]
    for light, viewer, turn in ((i, r, t) for i in (30, 60) for r in range(0, 81, 10) for t in range(0, 181, 30)):
        angles = np.radians([light, 0.0, viewer, 180.0 - turn])
        rows.append(f"{light},{viewer},{turn},{models.ward(*angles, rho_d=0.2, rho_s=0.1, alpha_x=0.2, alpha_y=0.2)}")
    path = tmp_path / "forward.csv"
    path.write_text("\n".join([*rows, ""]))
    for options, found in ((["--azimuth", "forward"], True), ([], False)):
        assert run("fit", path, "--model", "ward", *options, "--json", tmp_path / "fits.json") == 0
        (fit,) = json.loads((tmp_path / "fits.json").read_text())["fits"]
        assert (fit["rms_ln"] < 1e-3) == found
    capsys.readouterr()
    fits = tmp_path / "ward.fit"
    fits.write_text(FITS)
    assert refused(capsys, "fit", fits, "--azimuth", "forward").startswith("--azimuth: ")


def test_materials_that_are_lost_are_counted(tile: Path, tmp_path: Path, capsys: Captured) -> None:
    files = [tile, tmp_path / "none.csv", tmp_path / "neither.csv"]
    assert run("import", *files, *OPTIONS) == 2
    *sentences, count = capsys.readouterr().err.splitlines()
    assert [file.name in sentence for file, sentence in zip(files[1:], sentences, strict=True)] == [True, True]
    assert count == "brdfdb: 2 of 3 materials were not imported"


SHEET = "AOI (deg),Scatter angle (deg),BRDF (1/sr)\n"


def test_a_folder_is_a_line_for_each_file_or_the_whole_statements(tmp_path: Path, capsys: Captured) -> None:
    folder = tmp_path / "day 1"
    folder.mkdir()
    rows = [
        f"{light},{viewer},{0.1 + 0.1 * np.exp(-(((viewer - light) / 9.0) ** 2)):.6f}\n"
        for light in (20, 40)
        for viewer in range(-80, 81, 5)
    ]
    (folder / "b.csv").write_text("# wavelength 532 nm\n" + SHEET + "".join(rows))
    (folder / "a.csv").write_text(
        SHEET + "".join(row.replace(",", ",-").replace("--", "").replace(",-0", ",0") for row in rows)
    )
    (folder / ".hidden").write_text("nothing")
    assert run("import", folder) == 0
    first, second, hint = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{folder / 'a.csv'}: a; 66 samples, 2 lights, no wavelength; ")
    assert second == f"{folder / 'b.csv'}: b; 66 samples, 2 lights, 532 nm; no doubt"
    assert hint == "Statement on a file: `brdfdb import FILE`; on all files: --full"
    assert run("import", folder, "--full") == 0
    assert capsys.readouterr().out.count("No column is an azimuth") == 2
    (folder / "c.csv").write_text("no numbers")
    assert run("import", folder) == 2
    captured = capsys.readouterr()
    assert len(captured.out.splitlines()) == 3
    assert "c.csv" in captured.err
    (tmp_path / "empty").mkdir()
    assert "has no files" in refused(capsys, "import", tmp_path / "empty")


def test_a_claim_of_the_header_that_its_values_contradict_is_in_the_line(tile: Path) -> None:
    keys = dict(option.split("=") for option in COLUMNS)
    known = statement(formats.samples(tile, **keys))
    claims = tuple(Claim(10.0, "grey", claimed, 0.1, at_least=False, known=True) for claimed in (0.07, 0.081, 0.099))
    assert in_a_line(replace(known, claims=claims)).endswith("; Units?; claims of the header off by up to 30 %")
    assert in_a_line(replace(known, claims=claims[2:])).endswith(", no wavelength; Units?")


def test_rows_are_selected_and_the_recipe_says_so(tmp_path: Path, capsys: Captured) -> None:
    path, recipe = tmp_path / "tiles.csv", tmp_path / "tile.toml"
    rows = [f"{name},{angle},{factor}\n" for name, factor in (("A 1", 0.1), ("B", 0.2)) for angle in ("20,10", "40,5")]
    path.write_text("Sample name,AOI,theta_s,BRDF\n" + "".join(rows) + "B,40,9,1e-6\n")
    sentence = refused(capsys, "import", path)
    assert sentence.endswith("rows have different values, A 1, B; --where 'Sample name'=A 1 reads one value")
    options = ("--where", "Sample name=B", "--missing", "1e-6")
    assert run("import", path, *options, "--recipe", recipe, "--name", "tile") == 0
    printed = capsys.readouterr().out
    assert "3 samples of 1 channel" in printed
    assert "1 hole" in printed
    keys = tomllib.loads(recipe.read_text())["define"]["tile"]
    assert keys == {"samples": "tiles.csv", "where": {"Sample name": ["B"]}, "missing": 1e-6}
    assert refused(capsys, "import", path, "--where", "Sample name").startswith(
        "--where: 'Sample name' is not HEADER=V"
    )


def test_percentages_of_summaries_are_plain_numbers() -> None:
    assert [_percent(value) for value in (None, 0.00123, 0.0999, 0.995, 2.5, 123.0)] == [
        *("-", "0.12 %", "10 %", "100 %", "250 %", "12300 %")
    ]
