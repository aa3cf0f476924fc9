"""Sheets of laboratories: names, units, blocks, matrices, polarisations and rows that are selected, with their values.

The values of all sheets are a formula of theta_i and the place of the viewer along the plane of incidence, positive on
the mirror side, where the lobe is.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats.text import choices
from brdfdb.formats.text._fields import number_of
from brdfdb.measurements.samples import Samples
from brdfdb.measurements.statement import statement
from tests.formats.a_file import notes_of, samples_of

LIGHTS = (10, 30, 50)
PLACES = range(-80, 81, 10)
CHECKED = ((10, 0), (30, 30), (50, -40))  # theta_i and place of directions
NAMES = "AOI (deg),Scatter angle (deg),BRDF (1/sr)"


def f_r(light: float, place: float) -> float:
    """Return a lobe that grows as mirror lobes do."""
    growth = np.cos(np.radians(light)) ** -2.0
    return 0.1 + 0.3 * growth * float(np.exp(-(((place - light) / 10.0) ** 2))) + 0.001 * light


def rows(form: str = "{i},{s},{v:.6f}", number: Callable[..., float] = lambda *row: row[2]) -> list[str]:
    """Return rows of all directions; `number` makes the number of a row of theta_i, the place and f_r."""
    return [
        form.format(i=i, s=s, a=abs(s), p=180 if s > 0 else 0, o=s - i, v=number(i, s, f_r(i, s)))
        for i in LIGHTS
        for s in PLACES
    ]


def text(*lines: str) -> str:
    return "\n".join([*lines, ""])


def at(samples: Samples, light: float, place: float) -> list[float]:
    """Return the values of the first channel in a direction."""
    side = np.where(np.cos(samples.phi_r - samples.phi_i) < 0.0, 1.0, -1.0)
    near = np.abs(np.degrees(samples.theta_i) - light) + np.abs(side * np.degrees(samples.theta_r) - place) < 1e-6
    return samples.values[near, 0].tolist()


def check(samples: Samples, scale: float = 1.0, count: int = 1) -> None:
    """Check f_r in three directions, each of which has as many rows."""
    for light, place in CHECKED:
        assert at(samples, light, place) == pytest.approx([scale * f_r(light, place)] * count, rel=1e-4)


def in_blocks(line: str, names: str, form: str, *, each: bool = True, blank: bool = False) -> str:
    """Return a text with a line, and names, above the rows of each light."""
    lines = []
    for light in LIGHTS:
        lines += [line.format(i=light), *([names] if each or light == LIGHTS[0] else [])]
        lines += [form.format(s=s, a=abs(s), p=180 if s > 0 else 0, v=f_r(light, s)) for s in PLACES]
        lines += [""] if blank else []
    return text(*lines)


def commas(lines: list[str]) -> list[str]:
    return [line.replace(".", ",") for line in lines]


def times(factor: float) -> Callable[..., float]:
    return lambda *row: factor * row[2]


def with_cosine(*row: float) -> float:
    return row[2] * float(np.cos(np.radians(row[1])))


SEMICOLONS = "{i};{s};{v:.6f}"
SPACES = "{i:6d} {s:8d} {v:12.6f}"
# Sheets by what is peculiar to them, and what the statement says
SHEETS: list[tuple[str, str, str]] = [
    ("csv", text(NAMES, *rows()), "positive theta_r on the mirror side; the lobe is on the mirror side, too"),
    ("tabs", text(NAMES.replace(",", "\t"), *rows("{i}\t{s}\t{v:.6f}")), "on the mirror side"),
    ("german", text("Einfallswinkel (Grad);Streuwinkel (Grad);BRDF (1/sr)", *commas(rows(SEMICOLONS))), ""),
    ("french", text("Angle d'incidence (°);Angle de diffusion (°);BRDF (sr^-1)", *commas(rows(SEMICOLONS))), ""),
    ("fixed", text("AOI (deg)  Scatter angle (deg)  BRDF (1/sr)", *rows(SPACES)), ""),
    ("one space", text("AOI (deg) Scatter angle (deg) BRDF (1/sr)", *rows(SPACES)), ""),
    ("units below", text("AOI,Scatter angle,BRDF", "(deg),(deg),(sr^-1)", *rows()), ""),
    ("theta_s, phi_s", text("theta_in;theta_s;phi_s;BSDF", *rows("{i};{a};{p};{v:.6f}")), ""),
    ("azimuth", text("Incidence,theta_s,azimuth,BRDF", *rows("{i},{a},{p},{v:.6f}")), "azimuth from the light"),
    ("ARS", text("AOI,theta_s,ARS (1/sr)", *rows(number=with_cosine)), "with the cosine of the viewer"),
    ("CCBSDF", text("AOI,theta_s,CCBSDF", *rows(number=with_cosine)), "with the cosine of the viewer"),
    ("R%", text("AOI,theta_s,R%", *rows(number=times(100.0 * np.pi))), "reflectance factors"),
    ("percent", text("AOI,theta_s,BRDF_percent", *rows(number=times(100.0))), "divided by 100"),
    ("log", text("AOI,theta_s,lg(BRDF)", *rows(number=lambda *row: np.log10(row[2]))), "as the name lg(BRDF) says"),
    ("log10", text("AOI,theta_s,log10(BRDF) (1/sr)", *rows(number=lambda *row: np.log10(row[2]))), "of logarithms"),
    ("ln", text("AOI,theta_s,ln BRDF", *rows(number=lambda *row: np.log(row[2]))), "natural logarithms"),
    ("dB", text("AOI,theta_s,BRDF [dB]", *rows(number=lambda *row: 10.0 * np.log10(row[2]))), "decibels"),
    ("micron", text("AOI,theta_s,Wavelength (micron),BRDF", *rows("{i},{s},0.633,{v:.6f}")), "Wavelengths are those"),
    ("from specular", text("AOI,angle from specular,BRDF", *rows("{i},{o},{v:.6f}")), "theta_r is theta_i + the"),
    (
        "from specular, title",
        text("# scatter angles are relative to the specular direction", NAMES, *rows("{i},{o},{v:.6f}")),
        "as a title says",
    ),
    ("text column", text("AOI,detector,Scatter angle,BRDF", *rows("{i},PMT,{s},{v:.6f}")), "left out: detector"),
    ("date", text("date;time;AOI;theta_s;BRDF", *rows(f"12.03.2024;12:01;{SEMICOLONS}")), "left out: date, time"),
    ("thousands", text(f"{NAMES},counts", *rows('{i},{s},{v:.6f},"12,345.6"')), "left out: counts"),
    ("commas and thousands", text("AOI;theta_s;BRDF;n", *commas(rows(f"{SEMICOLONS};1'234"))), "left out: n"),
    ("spreadsheet", text(f"{NAMES},,", *rows("{i},{s},{v:.6f},,"), ",,,,"), ""),
    ("exclamation marks", text("! sheet", "! of tile", NAMES, *rows()), ""),
    ("below the horizon", text(NAMES, *rows(), "10,100,0.5"), "1 row below the horizon was left out"),
    (
        "elevation",
        text("angles are elevation above the surface", "theta_i,theta_r,delta_phi,brdf")
        + text(*(f"{90 - i},{90 - abs(s)},{180 if s > 0 else 0},{f_r(i, s):.6f}" for i in LIGHTS for s in PLACES)),
        "90 degrees minus the numbers of the file. --angles deg",
    ),
    (
        "elevation in names",
        text("sun elevation,view elevation,raa,brdf")
        + text(*(f"{90 - i},{90 - abs(s)},{180 if s > 0 else 0},{f_r(i, s):.6f}" for i in LIGHTS for s in PLACES)),
        "which count from the surface",
    ),
    ("block", in_blocks("AOI = {i}", "theta_s phi_s BRDF", "{a} {p} {v:.6f}"), "give AOI: 10, 30, 50"),
    ("block in comments", in_blocks("# theta_i: {i} deg", "theta_s,BRDF", "{s},{v:.6f}"), "theta_i [deg]: 10"),
    ("block without a sign", in_blocks("Incident angle {i}", "theta_s,BRDF", "{s},{v:.6f}", each=False), "10, 30, 50"),
    ("block in a cell", in_blocks("AOI (deg),{i},", "Scatter angle (deg),az,BRDF", "{a},{p},{v:.6f}", blank=True), ""),
    ("names in comments", in_blocks("% AOI: {i}", "% theta_s BRDF", "{s} {v:.6f}"), ""),
    ("semicolons as comments", in_blocks("; AOI = {i}", "; theta_s; BRDF", "{s};{v:.6f}"), ""),
    ("slashes", in_blocks("// AOI={i}°, phi_i = 0°", "theta_s;BRDF", "{s};{v:.6f}"), "phi_i [°] = 0 to all"),
    ("pairs without signs", in_blocks("theta_i {i} phi_i 0", "theta_s BRDF", "{s} {v:.6f}"), "theta_i: 10, 30, 50"),
    ("units in blocks", in_blocks("AOI = {i}", "theta_s,BRDF\ndeg,1/sr", "{s},{v:.6f}"), "AOI: 10, 30, 50"),
    ("units in cells", text(NAMES, *rows("{i}°,{s}°,{v:.6f}  # good")), ""),
    ("merged cells", text(NAMES, *(r if ",-80," in r else r[2:] for r in rows())), "Empty cells of AOI"),
    ("exponents of Fortran", text(NAMES, *rows("{i},{s},{v:.6f}D+00")), ""),
    ("footer", text(NAMES, *rows(), "TIS = 0.35", "end"), ""),
    ("in a sentence", in_blocks("Scan at theta_i = {i} deg", "theta_s,BRDF", "{s},{v:.6f}"), ""),
]


@pytest.mark.parametrize("suffix", [".csv", ".txt"])
@pytest.mark.parametrize(("sheet", "note"), [case[1:] for case in SHEETS], ids=[case[0] for case in SHEETS])
def test_sheets_of_laboratories_are_read(sheet: str, note: str, suffix: str, tmp_path: Path) -> None:
    samples = samples_of(tmp_path, sheet, f"sheet{suffix}")
    check(samples)
    assert len(samples) == len(LIGHTS) * len(PLACES)
    assert note in notes_of(samples)


MATRIX = [",".join([str(s), *(f"{f_r(i, s):.6f}" for i in LIGHTS)]) for s in PLACES]
TRANSPOSED = [",".join([str(i), *(f"{f_r(i, s):.6f}" for s in PLACES)]) for i in LIGHTS]


@pytest.mark.parametrize(
    ("above", "lines"),
    [
        (["theta_s,10,30,50"], MATRIX),
        (["BRDF (1/sr) of a tile", "theta_s\\AOI,10,30,50"], MATRIX),
        (["Scatter angle (deg) / AOI (deg),10,30,50"], MATRIX),
        (["Rows: scatter angle, columns: AOI", ",10,30,50"], MATRIX),
        (["Scatter angle (deg),AOI 10,AOI 30,AOI 50"], MATRIX),
        (["Scatter angle (deg),BRDF AOI=10°,BRDF AOI=30°,BRDF AOI=50°"], MATRIX),
        (["Scatter angle,BRDF @ 10 deg,BRDF @ 30 deg,BRDF @ 50 deg"], MATRIX),
        (["Scatter angle (deg),AOI = 10 (1/sr),AOI = 30 (1/sr),AOI = 50 (1/sr)"], MATRIX),
        (["AOI (deg):,10,30,50", "Scatter angle (deg),BRDF,BRDF,BRDF"], MATRIX),
        ([",AOI (deg),,", "Scatter angle,10,30,50"], MATRIX),
        ([f"AOI,{','.join(map(str, PLACES))}"], TRANSPOSED),
    ],
)
def test_matrices_have_an_angle_a_column(above: list[str], lines: list[str], tmp_path: Path) -> None:
    check(samples_of(tmp_path, text(*above, *lines)))


def test_a_matrix_may_be_in_percent_and_have_a_column_a_wavelength(tmp_path: Path) -> None:
    scaled = [",".join([str(s), *(f"{100.0 * np.pi * f_r(i, s):.6f}" for i in LIGHTS)]) for s in PLACES]
    check(samples_of(tmp_path, text("BRF in %", "theta_s\\AOI,10,30,50", *scaled)))
    waves = samples_of(tmp_path, text("# AOI = 30", "theta_s,450,550,650", *MATRIX))
    assert waves.channels == ("450nm", "550nm", "650nm")
    assert at(waves, 30.0, 20.0) == pytest.approx([f_r(10, 20)], rel=1e-4)


def test_numbers_above_columns_that_nothing_explains_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"line 1 has numbers above the columns, and nothing says .* theta_r"):
        samples_of(tmp_path, text(",10,30,50", *MATRIX))


def test_a_sample_that_a_line_names_is_another(tmp_path: Path) -> None:
    sheet = text(NAMES, *rows(), "sample B", NAMES, *rows(number=times(2.0)))
    with pytest.raises(FileFormatError, match="unnamed, B; --where sample=unnamed"):
        samples_of(tmp_path, sheet)
    check(samples_of(tmp_path, sheet, where={"sample": "B"}), 2.0)


def test_the_unit_of_a_line_above_rows_is_its_own(tmp_path: Path) -> None:
    lines = [line for i in LIGHTS for line in (f"AOI (rad) = {np.radians(i):.9f}", "theta_s,BRDF", *of_light(i))]
    samples = samples_of(tmp_path, text(*lines))
    assert at(samples, 30, 30) == pytest.approx([f_r(30, 30)], rel=1e-4)


@pytest.mark.parametrize(
    ("names", "columns"), [("alpha1,beta1,scat", ("alpha1", "beta1", "scat")), ("", ("1", "2", "3"))]
)
def test_three_columns_without_known_names_are_named(names: str, columns: Any, tmp_path: Path) -> None:
    sheet = text(*([names] if names else []), *rows())
    with pytest.raises(FileFormatError, match=f"it has the columns {', '.join(columns)}: name them with --column"):
        samples_of(tmp_path, sheet)
    check(samples_of(tmp_path, sheet, **dict(zip(("theta_i", "theta_r", "values"), columns, strict=True))))


@pytest.mark.parametrize("line", ["Angle of incidence: {i} deg, wavelength 633 nm", "wavelength 633 nm, AOI {i}\u00b0"])
def test_a_line_above_rows_may_give_two_numbers(line: str, tmp_path: Path) -> None:
    samples = samples_of(tmp_path, in_blocks(line, "theta_s,BRDF", "{s},{v:.6f}"))
    check(samples)
    assert samples.channels == ("633nm",)


def test_an_elevation_of_the_source_counts_from_the_surface(tmp_path: Path) -> None:
    lines = [f"{90 - i},{s},{f_r(i, s):.6f}" for i in LIGHTS for s in PLACES]
    check(samples_of(tmp_path, text("Elevation of source,theta_s,BRDF", *lines)))


def test_numbers_below_the_last_row_are_told(tmp_path: Path) -> None:
    assert "left out: TIS = 0.23" in notes_of(samples_of(tmp_path, text(NAMES, *rows(), "TIS,0.23")))


def of_light(light: int) -> list[str]:
    return [f"{s},{f_r(light, s):.6f}" for s in PLACES]


def test_units_in_titles_are_those_of_angles(tmp_path: Path) -> None:
    names = "AOI,theta_s,BRDF"
    mrad = [f"{1e3 * np.radians(i):.7g},{1e3 * np.radians(s):.7g},{f_r(i, s):.6f}" for i in LIGHTS for s in PLACES]
    check_near = samples_of(tmp_path, text("units: mrad", names, *mrad))
    np.testing.assert_allclose(np.unique(np.round(np.degrees(check_near.theta_i), 3)), LIGHTS)
    with pytest.raises(FileFormatError, match="the unit 'gon'"):
        samples_of(tmp_path, text("angle unit: gon", names, *rows()))


@pytest.mark.parametrize(
    ("title", "note"),
    [
        ("quantity: BRF", "--quantity reflectance_factor"),
        ("# reflectance factor relative to PTFE", "--quantity reflectance_factor"),
        ("# log10 of BRDF", "--quantity log10"),
        ("# BRDF values x 1000", "Factor?"),
        ("# azimuth counts clockwise", "read counter-clockwise"),
        ("# BRDF times cosine of scatter angle", "--quantity f_r_cos"),
        ("# not BRDF times cosine", ""),
    ],
)
def test_what_titles_say_of_values_is_told(title: str, note: str, tmp_path: Path) -> None:
    samples = samples_of(tmp_path, text(title, NAMES, *rows()))
    check(samples)
    assert note in notes_of(samples)
    assert note or "Quantity?" not in notes_of(samples)


def test_an_azimuth_that_a_title_explains_is_that_of_its_column(tmp_path: Path) -> None:
    lines = rows("{i},{a},{p},{v:.6f}")
    samples = samples_of(tmp_path, text("# phi_s = 0 is the forward direction", "theta_i,theta_s,phi_s,BRDF", *lines))
    assert "--azimuth forward" in notes_of(samples)


def test_three_columns_are_enough_with_their_names(tmp_path: Path) -> None:
    columns = {"theta_i": "a", "theta_r": "b", "values": "c"}
    check(samples_of(tmp_path, text("a b c", *rows("{i} {s} {v:.6f}")), "sheet.txt", **columns))
    numbered = {"theta_i": "1", "theta_r": "2", "values": "3"}
    check(samples_of(tmp_path, text(*rows("{i} {s} {v:.6f}")), "sheet.txt", **numbered))
    one_side = samples_of(tmp_path, "a,b,c\n30,0,0.2\n30,40,0.3\n", **columns)
    assert np.degrees(one_side.phi_r - one_side.phi_i) == pytest.approx([180.0, 180.0])
    assert "all on the mirror side (delta_phi 180), as no theta_r is negative" in notes_of(one_side)


def test_a_lobe_on_the_other_side_or_at_the_normal_is_doubted(tmp_path: Path) -> None:
    other = text(NAMES, *(f"{i},{-s},{f_r(i, s):.6f}" for i in LIGHTS for s in PLACES))
    samples = samples_of(tmp_path, other)
    assert at(samples, 30, -30) == pytest.approx([f_r(30, 30)], rel=1e-4)
    (hint,) = statement(samples).hints
    assert hint.startswith("Sides? The lobe is on the side of the light, where it grows")
    assert hint.endswith("--azimuth forward puts it on the mirror side.")
    mended = samples_of(tmp_path, other, azimuth="forward")
    check(mended)
    assert "positive theta_r on the side of the light; the lobe is on the mirror side, too" in notes_of(mended)
    relative = text(NAMES, *rows("{i},{o},{v:.6f}"))
    assert "Specular? The lobe stays at theta_r 0 at all incidences" in notes_of(samples_of(tmp_path, relative))
    check(samples_of(tmp_path, relative, from_specular="Scatter angle (deg)"))
    forward = text("AOI,theta_s,phi_s,BRDF", *rows("{i},{s},0,{v:.6f}"))
    assert "same in all rows: negative theta_r is on its other side" in notes_of(samples_of(tmp_path, forward))
    assert statement(samples_of(tmp_path, forward)).hints == (hint,)
    check(samples_of(tmp_path, forward, azimuth="forward"))
    towards = [f"{i},{i - s},{f_r(i, s):.6f}" for i in LIGHTS for s in PLACES]
    check(samples_of(tmp_path, text("AOI,aspecular angle,BRDF", *towards)))


def lobe(light: float, place: float) -> float:
    """Return a round lobe about the light."""
    return 0.05 + 2.0 * float(np.exp(-(((place + light) / 8.0) ** 2)))


def velvet(light: float, place: float) -> float:
    """Return a sheen that grows to the horizon on the side of the light."""
    return 0.1 + 0.1 * float(np.sin(np.radians(light)) * np.sin(np.radians(abs(place) * (1.0 if place < 0.0 else 0.3))))


def plaster(light: float, place: float) -> float:
    """Return the model of Oren and Nayar 1994, sigma 0.6."""
    low, high = np.radians(sorted((light, abs(place))))
    return 0.15 + 0.18 * (place < 0.0) * float(np.sin(high) * np.tan(low))


@pytest.mark.parametrize("surface", [lobe, velvet, plaster])
@pytest.mark.parametrize("noise", [0.0, 0.02, 0.1])
@pytest.mark.parametrize("sign", [1, -1])
def test_light_on_its_own_side_is_not_taken_for_a_mirror_lobe(
    tmp_path: Path, surface: Callable[[float, float], float], noise: float, sign: int
) -> None:
    draw = np.random.default_rng(4)
    lines = [f"{i},{s},{surface(i, sign * s) * np.exp(draw.normal(0.0, noise)):.6f}" for i in LIGHTS for s in PLACES]
    known = statement(samples_of(tmp_path, text(NAMES, *lines)))
    assert known.hints == ()
    assert not any(note.startswith("Sides?") for note in known.notes)
    if surface is lobe and sign == 1:
        assert "whether the surface is retro-reflective or sides are exchanged" in known.untold[0]


SAMPLES = text(f"sample,{NAMES}", *rows("A,{i},{s},{v:.6f}"), *rows("B,{i},{s},{v:.6f}", times(2.0)))
IN_BLOCKS = text("# Sample: A", NAMES, *rows(), "# Sample: B", *rows(number=times(2.0)))


@pytest.mark.parametrize("sheet", [SAMPLES, IN_BLOCKS, SAMPLES.replace("A,", "1,").replace("B,", "2,")])
def test_one_of_several_samples_is_chosen(sheet: str, tmp_path: Path) -> None:
    first, second = ("A", "B") if "A," in sheet or "A\n" in sheet else ("1", "2")
    with pytest.raises(FileFormatError, match=rf"different values, {first}, {second}; --where .*={first} reads"):
        samples_of(tmp_path, sheet)
    check(samples_of(tmp_path, sheet, where={"sample": first.lower()}))
    check(samples_of(tmp_path, sheet, where={"sample": second, "theta_i": ["10", "30", "50"]}), 2.0)
    with pytest.raises(ParameterError, match=f"no row has sample = C; the values are {first}, {second}"):
        samples_of(tmp_path, sheet, where={"sample": "C"})
    with pytest.raises(ParameterError, match=r"'tile' is not a column of .*sheet.csv, which has "):
        samples_of(tmp_path, sheet, where={"tile": "C"})
    assert choices(tmp_path / "sheet.csv")[next(iter(choices(tmp_path / "sheet.csv")))] == (first, second)


STATES = {"s": 1.2, "p": 0.8}
OF_ROWS = text(
    f"polarization,{NAMES}",
    *(r for n, k in STATES.items() for r in rows(n + ",{i},{s},{v:.6f}", times(k))),
)
OF_NAMES = text(
    "AOI,theta_s,BRDF_s,BRDF_p",
    *(f"{i},{s},{1.2 * f_r(i, s):.6f},{0.8 * f_r(i, s):.6f}" for i in LIGHTS for s in PLACES),
)


@pytest.mark.parametrize(("sheet", "name"), [(OF_ROWS, "polarization"), (OF_NAMES, "polarisation")])
def test_unpolarised_is_the_mean_of_s_and_p(sheet: str, name: str, tmp_path: Path) -> None:
    samples = samples_of(tmp_path, sheet)
    check(samples)
    assert f"Unpolarised: f_r is the mean of s and p at the same directions. --where {name}=s" in notes_of(samples)
    assert samples.instrument.polarisation == samples.record["polarisation"] == "mean of s and p"
    assert choices(tmp_path / "sheet.csv")[samples.record["polarisation_column"]] == ("s", "p")
    for state, scale in STATES.items():
        one = samples_of(tmp_path, sheet, where={name: state})
        check(one, scale)
        assert one.instrument.polarisation == state


def test_directions_without_both_polarisations_are_left_out(tmp_path: Path) -> None:
    samples = samples_of(tmp_path, OF_ROWS.rsplit("\n", 3)[0])
    assert len(samples) == len(LIGHTS) * len(PLACES) - 2
    assert "2 rows without the other polarisation were left out" in notes_of(samples)
    with pytest.raises(FileFormatError, match=r"different polarisations, 45, s, and only s and p"):
        samples_of(tmp_path, OF_ROWS.replace("\np,", "\n45,"))
    pairs = {"ss": 0.9, "pp": 0.5, "sp": 0.4, "ps": 0.2}  # half of the sum is 1
    lines = [r for n, k in pairs.items() for r in rows(f"{n[0]},{n[1]},{{i}},{{s}},{{v:.6f}}", times(k))]
    check(samples_of(tmp_path, text(f"source pol,detector pol,{NAMES}", *lines)))


def test_uncertainties_of_a_mean_are_those_of_independent_values(tmp_path: Path) -> None:
    lines = ["s,30,0,1.0,0.3", "p,30,0,3.0,0.4"]
    samples = samples_of(tmp_path, text("pol,AOI,theta_s,BRDF,uncertainty", *lines, "s,30,-10,1,1", "p,30,-10,1,1"))
    assert samples.uncertainty is not None
    assert samples.uncertainty[:, 0] == pytest.approx([0.25, np.sqrt(0.5)])


def test_the_rotation_of_the_sample_turns_light_and_viewer(tmp_path: Path) -> None:
    lines = [row for turn in (0, 45, 90) for row in rows("{i},{s}," + str(turn) + ",{v:.6f}")]
    samples = samples_of(tmp_path, text("AOI,theta_s,Sample rotation,BRDF", *lines))
    assert samples.turned
    assert np.unique(np.round(np.degrees(samples.phi_i))).tolist() == [0.0, 45.0, 90.0]
    check(samples, count=3)
    assert "rotation of the sample was added" in notes_of(samples)


def test_the_column_that_explains_a_contradiction_is_named(tmp_path: Path) -> None:
    lines = [
        *rows("20,1,{i},{s},{v:.6f}"),
        *rows("60,2,{i},{s},{v:.6f}", lambda *row: row[2] * (3.0 if row[1] > 0 else 0.5)),
    ]
    sheet = text(f"temperature,humidity,{NAMES}", *lines)
    assert "The column temperature tells these rows apart (20, 60): --where temperature=20" in notes_of(
        samples_of(tmp_path, sheet.replace("2,", "1,"))
    )
    check(samples_of(tmp_path, sheet, where={"temperature": "20"}))
    random = np.random.default_rng(1).permutation([1] * 51 + [2] * 51)
    mixed = [f"{n},{row}" for n, row in zip(random, [*rows(), *rows(number=times(2.0))], strict=True)]
    assert "differs by 100 % in the median.\n" in notes_of(samples_of(tmp_path, text(f"humidity,{NAMES}", *mixed)))


def test_the_same_wavelength_twice_is_a_repeated_measurement(tmp_path: Path) -> None:
    names = "AOI,theta_s,550nm,550nm,650nm"
    samples = samples_of(tmp_path, text(names, *rows("{i},{s},{v:.6f},{v:.6f}1,{v:.6f}")))
    assert samples.channels == ("550nm", "650nm")
    check(samples, count=2)
    assert np.isnan(samples.values[:, 1]).sum() == len(LIGHTS) * len(PLACES)
    assert "550 nm, were read as repeated measurements" in notes_of(samples)


def test_wavelengths_of_blocks_are_channels(tmp_path: Path) -> None:
    lines = [line for nm in (450, 550) for line in (f"# Wavelength: {nm} nm", NAMES, *rows())]
    samples = samples_of(tmp_path, text(*lines))
    assert samples.channels == ("450nm", "550nm")
    check(samples)


@pytest.mark.parametrize("mark", ["#N/A", "n/a", "-", "", "#DIV/0!", "NaN"])
def test_words_for_holes_are_holes(mark: str, tmp_path: Path) -> None:
    samples = samples_of(tmp_path, text(NAMES, *rows(), f"60,10,{mark}"))
    check(samples)
    assert np.flatnonzero(~samples.known[:, 0]).tolist() == [len(LIGHTS) * len(PLACES)]


@pytest.mark.parametrize(
    ("field", "number"),
    [
        ("12,345.6", 12345.6),
        ("-1.234.567,5", -1234567.5),
        ("1\u202f234,5", 1234.5),
        ("1'234.5", 1234.5),
        ("0,25", 0.25),
        ("\u22120.5", -0.5),
        ("1.5D-03", 1.5e-3),
        ("30\u00b0", 30.0),
        ("1,234,5", None),
        ("1_000", None),
        ("wet", None),
    ],
)
def test_numbers_are_read_with_signs_between_thousands(field: str, number: float | None) -> None:
    assert number_of(field) == number


def test_a_number_may_mark_holes(tmp_path: Path) -> None:
    samples = samples_of(tmp_path, text(NAMES.replace("BRDF", "BRF"), *rows(), "60,10,1e-6"), missing=1e-6)
    check(samples, 1.0 / np.pi)
    assert int((~samples.known).sum()) == 1
    assert "Holes, as was stated: 1 value of 1e-06." in notes_of(samples)


@pytest.mark.parametrize("corner", ["theta_s", "theta_s\\phi_s"])
def test_a_block_may_be_a_matrix_of_azimuths(corner: str, tmp_path: Path) -> None:
    turns = (0, 60, 120, 180, 240, 300)
    lines = []
    for light in LIGHTS:
        lines += [f"AOI = {light}", f"{corner},{','.join(map(str, turns))}"]
        lines += [
            f"{r},{','.join(f'{f_r(light, -r * np.cos(np.radians(t))):.6f}' for t in turns)}" for r in (0, 30, 40)
        ]
    samples = samples_of(tmp_path, text(*lines))
    turn = np.round(np.degrees(samples.phi_r - samples.phi_i)) % 360.0
    for light, viewer, angle in ((10, 0, 0), (30, 30, 180), (50, 40, 60)):
        near = np.abs(np.degrees(samples.theta_i) - light) + np.abs(np.degrees(samples.theta_r) - viewer) < 1e-6
        expected = f_r(light, -viewer * np.cos(np.radians(angle)))
        assert samples.values[near & (turn == angle), 0] == pytest.approx([expected], rel=1e-4)


def test_rows_of_a_matrix_may_be_wavelengths(tmp_path: Path) -> None:
    lines = [f"{nm},{','.join(f'{f_r(30, s):.6f}' for s in PLACES)}" for nm in (450, 550)]
    samples = samples_of(tmp_path, text("# AOI = 30 deg", f"wavelength (nm),{','.join(map(str, PLACES))}", *lines))
    assert samples.channels == ("450nm", "550nm")
    assert at(samples, 30, 30) == pytest.approx([f_r(30, 30)], rel=1e-4)


@pytest.mark.parametrize("title", ["Elevations in degrees", "Measured at grazing angles", "theta is 90 - elevation"])
def test_a_title_that_may_speak_of_elevations_is_doubted(title: str, tmp_path: Path) -> None:
    samples = samples_of(tmp_path, text(f"# {title}", NAMES, *rows()))
    check(samples)
    assert f"Elevation? A title says {title!r}" in notes_of(samples)


@pytest.mark.parametrize("name", ["BRDF", "ARS"])
def test_a_floor_at_many_directions_is_doubted(name: str, tmp_path: Path) -> None:
    floor = rows(number=lambda *row: 1e-6 if abs(row[1] + row[0]) < 15.0 else row[2])
    sheet = text(f"AOI,theta_s,{name}", *floor)
    doubt = "Holes? 9 values are 1e-06, and no other is below 0.11: if they mean missing, --missing 1e-06"
    assert doubt in " ".join(statement(samples_of(tmp_path, sheet)).hints)
    mended = samples_of(tmp_path, sheet, missing=1e-6)
    assert int((~mended.known).sum()) == 9
    assert "Holes?" not in " ".join(statement(mended).hints)


LISTS = ("AOI: 10 30 50", "AOI: 10 deg, 30 deg", "AOI: 10°/30°", "AOI 10-70", "AOI = 10 to 70 deg")
EXPORTS = [
    ("Wavelength: 0.55 um", "AOI: 30.0", "", "Angle\tBRDF\tccBRDF", "{s}\t{v:.5E}\t{c:.5E}"),
    ("Wellenlänge;550,0;nm", "Einfallswinkel;30,0;Grad", "", "Streuwinkel [°];BRDF [1/sr]", "{s};{v:.6f}"),
    (
        "# wavelength[nm] = 550",
        "# theta_i[deg] = 30",
        "# columns: theta_s[deg] phi_s[deg] ARS[1/sr]",
        "{a} {p} {c:.7f}",
    ),
    ("Sample,Tile A", "Wavelength (nm),550", "AOI (deg),30", "Scatter Angle (deg),BRDF (sr-1),Std", "{s},{v:.6f},0.01"),
    ("! theta_i = 30 deg", "! lambda = 550 nm", "! theta_s(deg) BRDF(1/sr)", "{s:8.2f} {v:.5e}"),
]


@pytest.mark.parametrize("export", EXPORTS, ids=range(len(EXPORTS)))
def test_exports_of_one_incidence_have_it_in_their_titles(export: tuple[str, ...], tmp_path: Path) -> None:
    *titles, form = export
    lines = [
        form.format(s=s, a=abs(s), p=180 if s > 0 else 0, v=f_r(30, s), c=with_cosine(30, s, f_r(30, s)))
        for s in PLACES
    ]
    decimals = [line.replace(".", ",") if ";" in line else line for line in lines]
    samples = samples_of(tmp_path, text(*titles, *decimals), "export.txt")
    assert samples.channels == ("550nm",)
    for place in (0, 30, -40):
        assert at(samples, 30, place) == pytest.approx([f_r(30, place)], rel=1e-4)


def test_a_column_that_is_f_r_times_a_cosine_is_checked(tmp_path: Path) -> None:
    right = [f"{line},{with_cosine(*map(float, line.split(','))):.6f}" for line in rows()]
    samples = samples_of(tmp_path, text("AOI,theta_s,BRDF,CCBSDF", *right))
    check(samples)
    assert "BRDF was read; CCBSDF agrees with it." in notes_of(samples)
    wrong = [f"{line},{1.2 * with_cosine(*map(float, line.split(','))):.6f}" for line in rows()]
    with pytest.raises(FileFormatError, match=r"BRDF and CCBSDF are different quantities; .* --column values=NAME"):
        samples_of(tmp_path, text("AOI,theta_s,BRDF,CCBSDF", *wrong))


REFUSED: list[tuple[str, dict[str, Any], str]] = [
    (text("AOI,theta_s,Signal (V)", "10,20,0.5"), {}, "no column is values, among AOI, theta_s, Signal .V.; name it"),
    (text("AOI (deg),arm,BRDF", "10,20,0.5"), {}, "line 1: no column is theta_r, among AOI .deg., arm, BRDF; name it"),
    (text("theta_s,BRDF", "10,0.5", "20,0.5"), {}, "no column is theta_i, .* a line such as AOI = 30 above rows"),
    (text(NAMES, *rows(), '50,85,"1,234"'), {}, "write numbers without signs between thousands"),
    (
        in_blocks("AOI = {i} deg", "theta_s,BRDF", "{s},{v:.6f}").replace("30 deg", "0.5 rad"),
        {},
        "gives AOI .rad., but",
    ),
    (text("AOI,angle from specular,azimuth,BRDF", "10,5,0,0.5"), {}, "read in the plane of incidence only"),
    (
        text("coating,AOI,theta_s,BRDF", "matt,10,5,0.5", "gloss,10,-5,0.5", "gloss,10,-7,1", "matt,10,-9,1"),
        {},
        "matt, gl",
    ),
    *((text(f"# {title}", "theta_s,BRDF", "10,0.5"), {}, "no column is theta_i") for title in LISTS),
    (text("theta_s,BRDF", "10,0.5", "AOI = 20", "10,0.5"), {}, "but no line gives one to line 2"),
]


@pytest.mark.parametrize(("sheet", "keywords", "sentence"), REFUSED)
def test_what_is_not_meant_is_refused_with_a_remedy(sheet: str, keywords: Any, sentence: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=sentence):
        samples_of(tmp_path, sheet, **keywords)


@pytest.mark.parametrize(
    "title",
    [
        "site elevation 300 m",
        "AOI: 10, 30, 50 deg",
        "angles up to grazing",
        "AOI 10 to 50",
        "Angles are measured from the surface normal",
        "scatter angles to the sample normal",
        "all angles relative to the surface's normal",
    ],
)
def test_titles_that_speak_of_other_things_change_nothing(title: str, tmp_path: Path) -> None:
    samples = samples_of(tmp_path, text(f"# {title}", NAMES, *rows()))
    check(samples)
    assert notes_of(samples).count("\n") == 0
