"""Klems matrices: patches by hand, what Radiance and WINDOW's engine see of them, and refusals of damaged files."""

from __future__ import annotations

import functools
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from brdfdb import formats
from brdfdb.errors import ParameterError
from brdfdb.formats import klems
from brdfdb.formats._channels import channels_of
from brdfdb.formats.klems import averages
from brdfdb.geometry import unit_vector
from brdfdb.integrals.patches import BASES, Basis
from brdfdb.measurements.statement import statement
from brdfdb.parameters import Floats
from brdfdb.tables.table import Table
from tests.formats.a_file import check_changes_refused, exported, random_pairs
from tests.formats.bsdf_judges import check_bsdf, in_window, klems_total, made, queried, thermal
from tests.formats.small_tables import ANISOTROPIC, DIFFUSE, GREY, small_table

WRITTEN = [(GREY, "full"), (GREY, "half"), (GREY, "quarter"), (ANISOTROPIC, "half"), ("spectral", "quarter")]
FILES = pytest.mark.parametrize(("material", "kind"), WRITTEN)

# Radiance varies values of pairs by up to 3e-4; worst measured 3.1e-4. It keeps 8 bits of each chromaticity,
# and takes a diffuse part out: worst measured 0.047 of Y
AS_RADIANCE, AS_RADIANCE_COLOURED = 4e-4, 0.06
TOTAL = 5e-3  # sums of columns against the albedo of the table, besides the last digit printed; worst measured 2e-3


@functools.cache
def table_of(material: str) -> Table:
    if material == "spectral":
        return made("ggx_separable", {"alpha_x": 0.4, "alpha_y": 0.4}, np.arange(400.0, 701.0, 20.0))
    return small_table(material)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], Path]:
    folder = tmp_path_factory.mktemp("matrices")
    paths = {(material, kind): folder / f"{material}_{kind}.xml" for material, kind in WRITTEN}
    for (material, kind), path in paths.items():
        klems.write(table_of(material), path, kind=kind)
    return paths


@pytest.mark.parametrize(("kind", "count"), [("full", 145), ("half", 77), ("quarter", 41)])
def test_the_patches_fill_the_hemisphere(kind: str, count: int) -> None:
    basis = BASES[kind]
    assert len(basis) == count
    assert basis.solid_angles.sum() == pytest.approx(np.pi)
    patch = np.arange(count)
    place = np.random.default_rng(2).random((20, count, 2))
    for places in place:
        assert np.array_equal(basis.patches(basis.vectors(patch, places)), patch)


def test_the_first_patches_of_the_full_basis_lie_where_they_should() -> None:
    degrees = np.array([[0, 0], [4.9, 77], [5.1, 0], [10, 22], [10, 23], [14, 338], [20, 0], [89, 359], [89, 345]])
    patches = BASES["full"].patches(unit_vector(*np.radians(degrees.T)))
    assert patches.tolist() == [0, 0, 1, 1, 2, 1, 9, 133, 133]


def test_averages_are_those_of_the_patches_of_a_lopsided_function() -> None:
    """f_r = 1 + x of the viewer + 2 y of the light, which has closed averages, in the order of files."""
    basis = BASES["quarter"]

    def lopsided(wi: Floats, wr: Floats) -> Floats:
        wi, wr = np.broadcast_arrays(wi, wr)
        return np.asarray(1.0 + wr[..., :1] + 2.0 * wi[..., 1:2])

    matrix = averages(lopsided, basis, 1, isotropic=False)[..., 0]
    ring = np.radians(np.array(basis.bounds_deg))
    sine3, sine2 = np.diff(np.sin(ring) ** 3), np.diff(np.sin(ring) ** 2)
    width = np.pi / np.array(basis.counts)
    radius = (2.0 / 3.0 * sine3 / sine2 * np.sin(width) / width)[basis.rings]
    middle = np.concatenate([2.0 * np.pi * np.arange(count) / count for count in basis.counts])
    # The light of a column comes from the other side than the patch that it would mirror to
    expected = 1.0 + (radius * np.cos(middle))[:, np.newaxis] - 2.0 * radius * np.sin(middle)
    assert matrix == pytest.approx(expected, abs=3e-3)


def test_isotropic_averages_are_those_of_all_pairs() -> None:
    table, basis = table_of(GREY), BASES["quarter"]

    def brdf(wi: Floats, wr: Floats) -> Floats:
        return channels_of(table, "auto").values(table, wi, wr)

    alike, whole = (averages(brdf, basis, 1, isotropic=isotropic) for isotropic in (True, False))
    assert alike == pytest.approx(whole, rel=1e-4)


def test_fixed_patches_report_a_tolerance_that_is_out_of_reach(tmp_path: Path) -> None:
    for tolerance in (0.02, 1.0):
        written = klems.write(table_of(DIFFUSE), tmp_path / "a.xml", kind="quarter", tolerance=tolerance)
        assert written.error is not None
        assert 0.02 < written.error.p99 < 1.0
        assert written.within == (tolerance == 1.0)
        assert klems.read(tmp_path / "a.xml").record["tolerance"] == tolerance


@pytest.mark.judge
def test_rows_and_bases_of_others_are_read(tmp_path: Path, files: dict[tuple[str, str], Path]) -> None:
    own = Basis("Two rings", (0.0, 45.0, 90.0), (1, 4))
    numbers = np.arange(25.0).reshape(5, 5)
    path = tmp_path / "a.xml"
    text = files[GREY, "quarter"].read_text()
    definition = text[text.index("<AngleBasis>") : text.index("<Comments>")]
    text = text.replace(definition, "\n".join(klems._definition(own))).replace("LBNL/Klems Quarter", own.name)
    head, *blocks = text.split("<ScatteringData>")
    text = head + "".join(
        "<ScatteringData>" + "\t".join(map(str, numbers.ravel())) + block[block.index("</ScatteringData>") :]
        for block in blocks
    )
    wi, wr = unit_vector(1.2, np.pi), unit_vector(1.2, 0.5 * np.pi)  # column 1 and row 2
    for structure, expected in (("Columns", numbers[2, 1]), ("Rows", numbers[1, 2])):
        path.write_text(text.replace("Columns", structure))
        reading = klems.read(path)
        assert reading.lookup_vectors(wi, wr) == expected
    reflected = queried(path, wi[np.newaxis], wr[np.newaxis])
    assert reflected[0, 1] == pytest.approx(numbers[1, 2], rel=AS_RADIANCE)


def test_damaged_files_are_refused_with_a_sentence(tmp_path: Path, files: dict[tuple[str, str], Path]) -> None:
    changes = [
        ("Columns", "Diagonals", "its structure 'Diagonals' is not Columns or Rows"),
        ("Reflection Back", "Reflection Front", "it has no Visible block of Reflection Back"),
        ("<RowAngleBasis>LBNL", "<RowAngleBasis>CIE", "the angle basis 'CIE/Klems Quarter' is not defined"),
        ("<ScatteringData>\n", "<ScatteringData>\n1,", "has 1682 numbers instead of 41 x 41"),
        ("<ScatteringData>\n", "<ScatteringData>\none,", "could not convert string to float"),
        ("<nPhis>12</nPhis>", "<nPhis>many</nPhis>", r"invalid literal for int\(\)"),
        ("<nPhis>12</nPhis>", "<nPhis>1000000000000</nPhis>", "more than 100000"),
        ("<nPhis>12</nPhis>", "<nPhis>11</nPhis>", r"this name means patches \(1, 8, 12, 12, 8\)"),
        ("<UpperTheta>45", "<UpperTheta>5", "ring begins at 45 degrees, but the one before it ends at 5"),
    ]
    check_changes_refused(tmp_path / "a.xml", files[GREY, "quarter"].read_text(), changes, "klems")


@pytest.mark.judge
@pytest.mark.parametrize(("material", "kind"), [(GREY, "full"), (ANISOTROPIC, "half")])
def test_radiance_sees_the_values_that_are_read(files: dict[tuple[str, str], Path], material: str, kind: str) -> None:
    path = files[material, kind]
    wi, wr = random_pairs(1000)
    assert queried(path, wi, wr)[:, 1] == pytest.approx(klems.read(path).lookup_vectors(wi, wr), rel=AS_RADIANCE)


@pytest.mark.judge
def test_radiance_sees_the_colour(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    klems.write(table_of("spectral"), path, kind="quarter", colour=True)
    reading = klems.read(path)
    assert reading.channels == ("X", "Y", "Z")
    wi, wr = random_pairs(1000)
    values = reading.lookup_vectors(wi, wr)
    assert np.max(np.abs(queried(path, wi, wr) - values) / values[:, 1:2]) < AS_RADIANCE_COLOURED


@pytest.mark.judge
@FILES
def test_the_totals_are_the_albedo(files: dict[tuple[str, str], Path], material: str, kind: str) -> None:
    largest, normal = klems_total(table_of(material), BASES[kind])
    name, total = check_bsdf(files[material, kind])
    assert name == {"full": "Klems_Full", "half": "Unknown_Matrix", "quarter": "Klems_Quarter"}[kind]
    assert total == pytest.approx(largest, rel=TOTAL, abs=5e-4)
    if kind == "full":
        shares = in_window(files[material, kind], kind, "PHOTOPIC")
        assert shares == pytest.approx([normal] * 2, rel=TOTAL)
    elif material == GREY:
        assert in_window(files[material, kind], kind) == []


@pytest.mark.judge
def test_the_statement_has_the_totals_of_windows_engine(files: dict[tuple[str, str], Path], tmp_path: Path) -> None:
    path = files[GREY, "full"]
    (window, _) = in_window(path, "full", "PHOTOPIC")
    known = statement(formats.samples(path))
    assert len(known.incidences) == len(BASES["full"])
    assert known.incidences[0].theta_i_deg == 0.0
    assert known.incidences[0].albedo[0] == pytest.approx(window, rel=TOTAL)
    other = tmp_path / "other.xml"  # the front of the file is twice as bright
    text = path.read_text(encoding="utf-8")
    start = text.index("<ScatteringData>", text.index("Reflection Front")) + len("<ScatteringData>")
    end = text.index("</ScatteringData>", start)
    doubled = " ".join(f"{2.0 * float(number):.6g}" for number in text[start:end].replace(",", " ").split())
    other.write_text(text[:start] + doubled + text[end:], encoding="utf-8")
    assert statement(formats.samples(other)).incidences[0].albedo == known.incidences[0].albedo
    front = statement(formats.samples(other, side="front"))
    assert front.incidences[0].albedo[0] == pytest.approx(2.0 * known.incidences[0].albedo[0], rel=1e-4)
    with pytest.raises(ParameterError, match="side: 'left' is not one of back, front"):
        formats.samples(other, side="left")


@pytest.mark.judge
def test_windows_engine_finds_the_emissivity_that_was_given_and_the_effect_of_an_assumed_one(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    written = klems.write(table_of(DIFFUSE), path, kind="full", emissivity_front=0.05, emissivity_back=0.05)
    assert not any("emissivity" in remark for remark in written.remarks)
    # Without the options the file stated 0.9 for aluminium, and no remark said that it was made up
    ((front, back, u), assumed, of_front, of_back) = thermal(path, (0.0, 0.0), (0.9, 0.9), (0.05, 0.9), (0.9, 0.05))
    assert (front, back) == (0.05, 0.05)
    assert (round(u, 2), round(assumed[2], 2)) == (3.29, 6.18)
    (remark,) = [text for text in klems.write(table_of(DIFFUSE), path).remarks if "emissivity" in text]
    assert remark.startswith("emissivity 0.9 of the front and the back is assumed")
    numbers = [float(text) for text in re.findall(r"\b[1-9]\.\d\d\b", remark)]
    assert numbers == [round(some, 2) for some in (assumed[2], of_front[2], of_back[2], u)]


def test_the_emissivity_of_a_table_in_the_infrared_is_one_minus_its_albedo(tmp_path: Path) -> None:
    at = np.array([*range(400, 701, 20), 1000.0, 5000.0, 10000.0, 20000.0, 40000.0])
    rho = {"wavelengths_nm": [400, 5000, 40000], "values": [0.5, 0.9, 0.2]}

    def planck(um: float) -> float:
        return um**-5 / math.expm1(14387.769 / (um * 300.0))

    reflected = quad(lambda um: planck(um) * (0.9 - 0.02 * (um - 5.0)), 5.0, 40.0)[0]
    expected = 1.0 - reflected / quad(planck, 5.0, 40.0)[0]
    for most, stated in ((at, f"{expected:.4g}"), (at[:-1], "0.9")):  # to 20 um alone
        written = klems.write(made("lambert", {"rho": rho}, most, index=None), tmp_path / "a.xml", kind="quarter")
        text = (tmp_path / "a.xml").read_text(encoding="utf-8")
        assert re.findall(r"<Emissivity(?:Front|Back)>([^<]*)", text) == [stated, stated]
        (remark,) = [some for some in written.remarks if "emissivity" in some]
        assert remark.startswith(f"emissivity {stated} of the front and the back")
        assert ("assumed" in remark) == (most is not at)


def test_an_emissivity_that_is_not_given_is_assumed(tmp_path: Path) -> None:
    text = exported(tmp_path, "klems", emissivity_back=0.05).read_text(encoding="utf-8")
    assert re.findall(r"<Emissivity(?:Front|Back)>([^<]*)", text) == ["0.9", "0.05"]
    assert "emissivity 0.9 of the front is assumed" in text
    with pytest.raises(ParameterError, match=r"emissivity_back: '1\.2' is not"):
        exported(tmp_path, "klems", emissivity_back=1.2)
