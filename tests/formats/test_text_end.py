"""Texts that were cut: within a number, at a row, or below a light."""

from pathlib import Path

import pytest

from brdfdb import formats
from brdfdb.errors import FileFormatError
from brdfdb.measurements.statement import statement

NAMES = "theta_i,theta_r,delta_phi,brdf"
ROWS = [f"{light},{viewer},180,{0.1 * light + 0.01 * viewer:.6f}" for light in (10, 20, 30) for viewer in (0, 15, 25)]
FRED = ["type bsdf_data", "format angles=deg bsdf=value scale=1"]
BLOCKS = [
    FRED_ROW
    for light in (10, 20, 30)
    for FRED_ROW in (f"{light}\t0", *(f"{r}\t{p}\t{0.01 * (r + p):.4f}" for r in (5, 15) for p in (0, 90)))
]


def written(folder: Path, lines: list[str], cut: int = 0, name: str = "sheet.csv") -> Path:
    """Write lines, the last without its end and without some of its characters."""
    path = folder / name
    text = "\n".join(lines)
    path.write_text(text[: len(text) - cut], encoding="utf-8")
    return path


@pytest.mark.parametrize(("lines", "name"), [([NAMES, *ROWS], "sheet.csv"), ([*FRED, *BLOCKS], "sheet.fred.txt")])
def test_a_file_that_was_cut_within_its_last_number_is_refused(lines: list[str], name: str, tmp_path: Path) -> None:
    assert len(formats.samples(written(tmp_path, lines, 0, name))) > 1
    with pytest.raises(FileFormatError, match=rf"line {len(lines)}: '.*' has fewer decimals .* cut within it"):
        formats.samples(written(tmp_path, lines, 2, name))


@pytest.mark.parametrize("end", ["1.25e-0", "1.2"])
def test_an_exponent_that_was_cut_is_noticed(end: str, tmp_path: Path) -> None:
    rows = [f"10,{viewer},180,{0.0125 * viewer:.2e}" for viewer in range(5, 60, 5)]
    assert len(formats.samples(written(tmp_path, [NAMES, *rows]))) == 11
    with pytest.raises(FileFormatError, match=r"line 13: .* has fewer decimals"):
        formats.samples(written(tmp_path, [NAMES, *rows, f"10,60,180,{end}"]))


@pytest.mark.parametrize(
    ("lines", "name", "shown"),
    [
        ([NAMES, *ROWS[:-1]], "sheet.csv", "2 rows where others have 3"),
        ([*FRED, *BLOCKS[:-2]], "sheet.fred.txt", "2 rows where others have 4"),
    ],
)
def test_a_file_without_an_end_whose_last_light_has_few_viewers_is_doubted(
    lines: list[str], name: str, shown: str, tmp_path: Path
) -> None:
    notes = statement(formats.samples(written(tmp_path, lines, 0, name))).notes
    assert any(note.startswith("Cut? Its last line has no end") and shown in note for note in notes)
    ended = [*lines, ""]
    assert not any("Cut?" in note for note in statement(formats.samples(written(tmp_path, ended, 0, name))).notes)


def test_whole_files_without_an_end_and_numbers_of_any_length_are_not_doubted(tmp_path: Path) -> None:
    rows = ["10,0,180,0.125", "10,20,180,1", "20,0,180,0.5", "20,20,180,2"]
    for lines in ([NAMES, *ROWS], [NAMES, *rows]):
        assert not any("Cut?" in note for note in statement(formats.samples(written(tmp_path, lines))).notes)


@pytest.mark.parametrize(("lines", "line"), [([*FRED, *BLOCKS[:5], "20\t0"], 8), ([*FRED, "10\t0", *BLOCKS], 3)])
def test_a_light_of_fred_without_viewers_is_refused(lines: list[str], line: int, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=f"line {line} is a light without viewers"):
        formats.samples(written(tmp_path, [*lines, ""], 0, "sheet.fred.txt"))


@pytest.mark.parametrize(
    ("row", "sentence"),
    [
        ("20,500,180,0.5", "line 5: theta_r of 500 degrees is no polar angle"),
        ("-200,10,180,0.5", "line 5: theta_i of 200 degrees is no polar angle"),
        ("20,,180,0.5", "line 5, field theta_r: an angle is missing"),
    ],
)
def test_the_line_of_a_wrong_angle_is_its_own(row: str, sentence: str, tmp_path: Path) -> None:
    path = written(tmp_path, ["# title", NAMES, ROWS[0], "", row, *ROWS, ""])
    with pytest.raises(FileFormatError, match=sentence):
        formats.samples(path)


def test_the_line_of_a_missing_wavelength_is_its_own(tmp_path: Path) -> None:
    path = written(tmp_path, [f"{NAMES},wavelength_nm", "10,20,180,0.5,500", "10,30,180,0.5,", ""])
    with pytest.raises(FileFormatError, match="line 3, field wavelength_nm: a wavelength is missing"):
        formats.samples(path)


def test_a_first_column_without_a_name_is_that_of_pandas(tmp_path: Path) -> None:
    path = written(tmp_path, [f",{NAMES}", *(f"{number},{row}" for number, row in enumerate(ROWS)), ""])
    sheet = formats.samples(path)
    assert len(sheet) == len(ROWS)
    assert "Columns left out: index." in statement(sheet).notes


@pytest.mark.parametrize(
    ("title", "unit"), [("all angles in radians", "radians"), ("Angles: deg", "degrees"), ("25 degree angle", "")]
)
def test_a_title_on_angles_gives_their_unit(title: str, unit: str, tmp_path: Path) -> None:
    sheet = formats.samples(written(tmp_path, [f"# {title}", NAMES, "0.5,1,3,0.5", "0.5,1.2,3,0.5", ""]))
    assert sheet.record["angles"] == (unit or "degrees")
    notes = statement(sheet).notes
    assert any(note == f"Angles were taken as {unit}: a title says {title!r}." for note in notes) == bool(unit)
    assert any("may be radians" in note for note in notes) == (not unit)
