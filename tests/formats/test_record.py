"""Records in headers of text: read back exactly, and no title becomes a formula, a line or markup of its own."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brdfdb import formats
from brdfdb.formats import EXPORTERS, IMPORTERS, radiance
from brdfdb.formats._record import lines, of_lines
from brdfdb.materials import Material
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from tests.formats.a_file import POLARISED_ALONE, options_of
from tests.formats.small_tables import table_of

FORMULA = 'Copper,=HYPERLINK("http://a.example","here")'
HOSTILE = (
    f'{FORMULA}; -2+3,@SUM(A1) , +1\tTab\nvoid plastic injected\n--> ]]> </Comments> <b> & -- --- "hi',
    "*/ #include <a> \\",
    "true",
)
TITLES = st.one_of(st.text(), st.text(alphabet='=+-@,;" \tx1', max_size=20))
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | TITLES,
    lambda some: st.lists(some, max_size=4) | st.dictionaries(TITLES, some, max_size=3),
    max_leaves=6,
)
DIFFUSE = {"rho": 0.5, "sigma_deg": 20.0}


def layout_of(title: str) -> Layout:
    entries = {"title": title, "model": "oren_nayar_qualitative", "source": "no paper", "parameters": DIFFUSE}
    grid = Grid({"theta_i": [0, 45, 89.9], "theta_r": [0, 45, 89.9], "delta_phi": [0, 90, 180]})
    return Layout(Material.from_table("titled", entries), grid)


def formulas(text: str) -> list[str]:
    """Return the cells of a text that a spreadsheet takes as formulas, for each sign that it may cut at."""
    cells = [
        cell
        for delimiter in ",;\t"
        for row in csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
        for cell in row
    ]
    return [cell for cell in cells if re.match(r"[=+\-@\t\r]", cell) and not re.fullmatch(r"-?[\d.]+(e-?\d+)?", cell)]


@given(st.dictionaries(st.sampled_from(["title", "note", "parameters"]), VALUES))
def test_lines_are_read_back_exactly_and_begin_no_formula(document: dict[str, Any]) -> None:
    written = lines(document)
    assert all(line.isprintable() for line in written)
    assert of_lines([line.strip() for line in written]) == document
    assert formulas("\n".join(f"# {line}" for line in written)) == []


@pytest.mark.parametrize("title", HOSTILE)
@pytest.mark.parametrize("name", [name for name in EXPORTERS if name not in POLARISED_ALONE])
def test_no_title_breaks_a_file(name: str, title: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{EXPORTERS[name].suffix}"
    written = formats.write(table_of(layout_of(title)), path, name, **options_of(name))
    if name in IMPORTERS:
        assert formats.read(path, name).record["title"] == title
    if path.suffix in (".xml", ".mtlx"):
        ElementTree.parse(path)
    if name in ("glsl", "osl", "slang"):
        head = path.read_text(encoding="utf-8").partition("#define")[0]
        assert all(line.startswith("//") and not line.endswith("\\") for line in head.splitlines() if line)
    if name == "radiance":
        text = written.paths[1].read_text(encoding="utf-8")
        assert all(line.startswith("#") for line in text.partition("\nvoid ")[0].splitlines() if line)
        assert "plastic injected" not in [line[5:] for line in text.splitlines() if line.startswith("void ")]
    if name == "csv":
        assert formulas(path.read_text(encoding="utf-8")) == []


@pytest.mark.judge
def test_radiance_reads_a_material_whose_file_has_a_space_in_its_name(tmp_path: Path) -> None:
    from tests.formats.bsdf_judges import traced

    radiance.write(table_of(layout_of("a")), tmp_path / "my wall.xml", cells=8)
    material = (tmp_path / "my wall.rad").read_text(encoding="utf-8")
    light = "void light sun\n0\n0\n3 1e5 1e5 1e5\nsun source disk\n0\n0\n4 0 0 1 0.5\n"
    floor = "titled polygon floor\n0\n0\n12 -1 -1 0 1 -1 0 1 1 0 -1 1 0\n"
    (seen,) = traced(f"{light}{material}{floor}", np.array([[0.1, 0.1, 5.0, 0.0, 0.0, -1.0]]), tmp_path)
    assert seen > 0.1
