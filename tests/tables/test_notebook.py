"""Objects in notebooks: text is escaped, numbers are those of the metadata, nothing is downloaded."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np

from brdfdb.materials import presets
from brdfdb.notebook import card, listing, polar_sketch
from brdfdb.tables.table import Table
from tests.tables.made_up import WAVELENGTHS, made_up

HOSTILE = "<script>alert('1')</script> & \"more\""


def texts(html: str) -> list[str]:
    """The texts of well-formed HTML; entities that XML does not have would fail."""
    return [text.strip() for text in ElementTree.fromstring(html).itertext() if text.strip()]


def test_all_text_is_escaped() -> None:
    for html in (
        card(HOSTILE, HOSTILE, HOSTILE, [(HOSTILE, HOSTILE)]),
        listing(HOSTILE, HOSTILE, HOSTILE, [HOSTILE], [[HOSTILE]]),
    ):
        assert "<script" not in html
        assert texts(html).count(HOSTILE) >= 4


def test_nothing_is_downloaded() -> None:
    table = made_up("isotropic")
    for html in (table._repr_html_(), presets()["rolled-brass"]._repr_html_()):
        assert not re.search(r"https?:|url\(|src=|href=|<script|<style", html)


def test_table_shows_its_metadata() -> None:
    attrs = {"title": HOSTILE, "model": "ward", "parameters": {"rho_d": 0.125}, "source": "a paper"}
    attrs |= {"source_record": {"material": {}}}  # without a record no paper is cited
    whole = made_up("isotropic", WAVELENGTHS)
    table = Table("random", "r000007", attrs, whole.grid, WAVELENGTHS, whole.values, None)
    found = texts(table._repr_html_())
    for text in (
        "random",
        HOSTILE,
        "ward",
        "rho_d = 0.125",
        "a paper",
        "400 to 2000 nm, 4 values",
        "theta_i 4 × theta_r 5 × delta_phi 5",
        "r000007",
    ):
        assert text in found, text
    assert "stated error" not in found  # none was measured


def test_sketch_has_the_largest_value_on_the_half_circle() -> None:
    svg = polar_sketch([-60.0, 0.0, 30.0], [0.5, 0.0, 2.0], 30.0)
    points = ElementTree.fromstring(svg).findall("polygon")[0].attrib["points"].split()
    x, y = map(float, points[-1].split(","))
    radius = np.hypot(x - 80.0, 78.0 - y)
    assert abs(radius - 72.0) < 0.1
    assert x > 80.0  # the mirror side is on the right
    assert "largest value 2 1/sr" in svg


def test_material_shows_its_parameters() -> None:
    material = presets()["clay-vase"]
    found = texts(material._repr_html_())
    for name, value in material.file_parameters().items():
        assert any(f"{name} = {value:g}" in text for text in found)
    assert material.source in found


def test_long_lists_end_with_their_number() -> None:
    html = listing("Store", "here", "", ["name"], [[str(number)] for number in range(230)])
    assert "and 30 more" in texts(html)
    assert html.count("<tr>") == 201
