"""Tables of choices in a store: they state their error, say where they come from, and replace others with a word."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb.audit.pairs import pairs_of
from brdfdb.audit.table_error import table_error_of
from brdfdb.forms.catalogue import forms
from brdfdb.materials import presets
from brdfdb.store.records import make_store
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import plan
from brdfdb.tables.tabulation import tabulate
from brdfdb_pipelines import choose, terminal
from brdfdb_pipelines.choose import PublishedChoice, with_reason

NAME = "clay-vase"


def layout(steps: int) -> Layout:
    """Even angles."""
    quarter = np.linspace(0.0, 85.0, steps)
    axes = {"theta_i": quarter, "theta_r": quarter, "delta_phi": np.linspace(0.0, 180.0, steps)}
    return Layout(presets()["clay-vase"], Grid(axes))


@pytest.fixture
def store(tmp_path: Path) -> Path:
    make_store(tmp_path / "store")
    return tmp_path / "store"


def error_of(store: Path, name: str) -> float:
    error = brdfdb.open(store)[name].error
    assert error is not None
    return error.overall.p99


def test_a_chosen_table_states_its_error_and_where_it_comes_from(store: Path) -> None:
    material = presets()["sandpaper-220-grit"]
    planned = plan(material, np.array([550.0]), 0.1)
    wanted = with_reason(planned, "table, planned for 10 %", "table-top, within 1 (CIEDE2000)")
    built = choose.publish_choices(store, {material.name: wanted})
    table = brdfdb.open(store)[material.name]
    assert 0.0 < error_of(store, material.name) <= 0.1
    stated = terminal.error(error_of(store, material.name))
    said = f"r000001 is a table of he_torrance, whose error (p99) is {stated}; it is new in the store"
    assert built == {material.name: PublishedChoice("r000001", said)}
    assert table_error_of(table, material, pairs_of(table, material)).verdict == "passes"
    attributes = table.attrs
    for name in ("title", "source", "note", "refractive_index"):
        assert attributes[name] == getattr(material, name)
    assert list(attributes["assumed"]) == list(material.assumed)
    assert set(attributes["parameter_sources"].values()) == {material.source}
    said = "table, planned for 10 %, chosen for table-top, within 1 (CIEDE2000); "
    assert attributes["reason"] == said + planned.reason


def test_a_table_that_replaces_another_says_so_with_both_errors(store: Path) -> None:
    choose.publish_choices(store, {NAME: layout(10)})
    before = error_of(store, NAME)
    built = choose.publish_choices(store, {NAME: layout(19)})
    after = error_of(store, NAME)
    assert after < before
    said = f"r000002 is a table of oren_nayar, whose error (p99) is {terminal.error(after)}; "
    said += f"it replaces r000001, of oren_nayar, whose error was {terminal.error(before)}"
    assert built[NAME] == PublishedChoice("r000002", said)
    assert brdfdb.open(store).head(NAME) == "r000002"


def test_a_table_that_answers_is_left_whatever_it_was_chosen_for(store: Path) -> None:
    choose.publish_choices(store, {NAME: with_reason(layout(10), "table", "spheres")})
    same = choose.publish_choices(store, {NAME: with_reason(layout(10), "table", "clay-vase")})
    assert same[NAME] == PublishedChoice("r000001", "r000001 of the store is this table")
    retitled = layout(10).source.model_copy(update={"title": "Another"})
    other = choose.publish_choices(store, {NAME: replace(layout(10), source=retitled)})
    assert other[NAME].revision == "r000002"


def test_a_damaged_table_is_replaced(store: Path) -> None:
    choose.publish_choices(store, {NAME: layout(10)})
    group = brdfdb.open(store).path(NAME)
    (group / "brdf" / "c" / "0" / "0" / "0").write_bytes(b"")
    assert choose.publish_choices(store, {NAME: layout(10)})[NAME].revision == "r000002"
    brdfdb.open(store).verify(NAME)


def test_a_table_with_the_values_of_its_form_is_that_which_would_be_tabulated(store: Path) -> None:
    form = next(form for form in forms(layout(10).source, None, [0.1]) if form.layout is not None)
    assert form.layout is not None
    choose.publish_choices(store, {NAME: form.layout}, {NAME: form.values})
    stored = brdfdb.open(store).dataset(NAME)[form.layout.variable]
    np.testing.assert_array_equal(stored, tabulate(form.layout)[form.layout.variable])
