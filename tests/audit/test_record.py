"""Every leaf of what a table and its pointer state is forged in turn: the audit says so, or a page lists the leaf."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Any

import numba
import pytest

import brdfdb
from brdfdb.audit import audit
from brdfdb.audit.energy import Energy
from brdfdb.audit.finding import Subject
from brdfdb.audit.record import UNCHECKED, Record, expected_of, record_of
from brdfdb.audit.table_error import TableError
from brdfdb.errors import BrdfdbError, StoreError
from brdfdb.materials import Material, presets
from brdfdb.store.decoding import checked_bytes, read_group, table_of
from brdfdb.store.files import read_sealed
from brdfdb.store.reader import Store
from brdfdb.store.records import Summary, check_manifest, fields_of
from brdfdb.tables.table import Table
from brdfdb_pipelines import audit_page, cli
from tests.audit.a_table import ANISOTROPIC, tabulated
from tests.benchmarks import forged_stores
from tests.benchmarks.forged_stores import changed, leaves
from tests.benchmarks.sound_materials import materials

pytestmark = [
    pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation"),
    pytest.mark.usefixtures("few_samples"),
]

KINDS = {
    "scene-copper-sphere": "table",
    "rolled-brass": "table",
    "blue-plastic": "table",
    "cotton-towel": "table",
    "painted": "table",
    "made-up": "table",
    "sheen": "table of a function",
    "chip": "table of measured data",
}
# Attributes that decide how a table is laid out: what must then be stated is another thing, too
OF_LAYOUT = ("interpolation", "bits", "reason", "part_wavelengths_nm", "source_record", "measured")


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("record") / "store"
    assert forged_stores.build(root) == KINDS
    return root


SILENT: dict[str, set[str]] = {}


def listed(where: str, leaf: str) -> bool:
    return any(each.where in ("table", where) and fnmatchcase(leaf, each.leaf) for each in UNCHECKED)


def forged(store: Path, name: str, attributes: dict[str, Any]) -> Table:
    group = Store(store).path(name)
    files = check_manifest(group, None, contents=False)["files"]
    arrays, dims, _ = read_group(partial(checked_bytes, group, files=files)) or pytest.fail("not read")
    return table_of(name, group.name, arrays, dims, attributes)


def passes(store: Path, name: str, attributes: dict[str, Any], expected: dict[str, Any] | None) -> bool:
    """Return True if an audit passes a table with other attributes; `expected` may be known."""
    try:
        table = forged(store, name, attributes)
        source = of_store(table)
        expected = expected_of(Subject(table, source)) if expected is None else expected
        if record_of(table, expected, source).verdict != "passes":
            return False
        return audit(table).verdict in ("passes", "known published excess")
    except BrdfdbError:  # it is no table
        return False


@pytest.mark.judge
@pytest.mark.parametrize("name", KINDS)
def test_every_attribute_that_is_forged_is_noticed_or_listed(store: Path, name: str) -> None:
    table = brdfdb.open(store)[name]
    attributes, expected = dict(table.attrs), expected_of(Subject(table, of_store(table)))
    assert passes(store, name, attributes, None)
    unnoticed = set()
    for path in leaves(attributes):
        again = path[0] in OF_LAYOUT or KINDS[name] != "table"
        if passes(store, name, changed(attributes, path), None if again else expected):
            unnoticed.add(".".join(map(str, path)))
    assert {leaf for leaf in unnoticed if not listed(KINDS[name], leaf)} == set()
    SILENT.setdefault(KINDS[name], set()).update(unnoticed)


@pytest.mark.judge
def test_every_leaf_that_the_page_lists_was_forged_and_not_noticed() -> None:
    """The list has nothing that could be checked: the tests above leave here what they did not notice."""
    if SILENT.keys() < set(KINDS.values()):
        pytest.skip("it is about all tables")
    everywhere = SILENT | {"table": set().union(*SILENT.values())}
    for each in UNCHECKED:
        if each.where in KINDS.values():
            assert any(fnmatchcase(leaf, each.leaf) for leaf in everywhere[each.where]), each


@pytest.mark.parametrize("name", ["scene-copper-sphere", "cotton-towel", "sheen", "chip"])
def test_every_leaf_of_a_summary_that_is_forged_is_noticed_or_listed(store: Path, tmp_path: Path, name: str) -> None:
    root = tmp_path / "store"
    shutil.copytree(store, root)
    summary = read_sealed(root / "materials" / name / "r000001.MANIFEST.json", name)["summary"]
    Store(root).verify(name)
    unnoticed = []
    for path in leaves(summary):
        forged_stores.forge_summary(root, name, changed(summary, path))
        try:
            Store(root).verify(name)  # with which an audit begins
        except StoreError:
            continue
        unnoticed.append(".".join(map(str, path)))
    assert {field.name for field in fields_of(Summary)} <= summary.keys()
    assert unnoticed == [each.leaf for each in UNCHECKED if each.where == "pointer and manifest"]


def test_the_command_names_what_was_forged(
    store: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(audit_page, "plots_of", lambda _: [])
    root, name = tmp_path / "store", "scene-copper-sphere"
    shutil.copytree(store, root)
    attributes = dict(brdfdb.open(root)[name].attrs)
    stated = attributes["error"]["places"]["alongside"][2][1]
    forged_stores.forge_attributes(root, name, changed(attributes, ("error", "places", "alongside", 2, 1)))
    assert cli.main(["verify", "--store", str(root)]) == 0
    assert cli.main(["audit", name, "--jobs", "1", "--store", str(root)]) == 1
    said = rf"1 statement of \d+ wrong: error.places.alongside.2.1 is {1.1 * stated!r}, where {stated!r} is right"
    assert re.search(f"{name}: {said}", capsys.readouterr().out)
    manifest = read_sealed(root / "materials" / name / "r000001.MANIFEST.json", name)
    forged_stores.forge_summary(root, name, {**manifest["summary"], "error_p99": 1e-4})
    assert cli.main(["audit", name, "--jobs", "1", "--store", str(root)]) == 2
    assert "r000001.MANIFEST.json says error_p99 0.0001" in capsys.readouterr().err


def test_a_table_under_another_name_violates(store: Path) -> None:
    """A table of wood passed as rolled brass: its record was that of wood, and nothing compared the two names."""
    table = brdfdb.open(store)["rolled-brass"]
    assert audit(table).verdict == "passes"
    found = audit(replace(table, name="scene-copper-sphere"))
    assert found.verdict == "violates"
    assert [each.leaf for each in found.of(Record).worst] == ["material"]


def test_a_largest_albedo_of_a_function_that_contradicts_itself_or_is_above_1_violates(store: Path) -> None:
    table = brdfdb.open(store)["sheen"]
    stated = table.attrs["largest_albedo"]
    grazing = {**stated["grazing"], "max_albedo": 0.1 * stated["albedo"], "power": 0.0}
    for change, leaf in (({"grazing": grazing}, "largest_albedo.grazing.max_albedo"), ({"albedo": 1.6}, "")):
        forged = audit(replace(table, attrs={**table.attrs, "largest_albedo": {**stated, **change}}))
        assert forged.verdict == "violates"
        assert leaf in [each.leaf for each in forged.of(Record).worst] or forged.of(Energy).verdict == "violates"


def test_a_statement_of_few_directions_gets_no_wide_tolerance(store: Path) -> None:
    """A statement that said that it was measured at 10 directions was judged as if it were."""
    table = brdfdb.open(store)["rolled-brass"]
    error = table.attrs["error"]
    low = {name: [[0.5 * value for value in row] for row in error[name]] for name in ("p95", "p99", "max")}
    overall = {key: (0.5 if key in low else 1.0) * value for key, value in error["overall"].items()}
    numbers = []
    for directions in (error["directions"], 10):
        attrs = {**table.attrs, "error": {**error, **low, "overall": overall, "directions": directions}}
        found = audit(replace(table, attrs=attrs))
        assert (found.of(TableError).verdict, found.of(Record).verdict) == ("violates", "violates"), directions
        numbers.append(found.of(TableError).disagreements)
    assert numbers[0] == numbers[1] > 0


@pytest.mark.parametrize(
    ("changes", "leaf"),
    [
        ({"parameters": {"rho_d": 0.1, "rho_s": 0.33, "alpha_x": 0.05, "alpha_y": 0.17}}, "parameters.alpha_y"),
        ({"name": "other", "parameters": {"rho_d": 0.1, "rho_s": 0.33, "alpha_x": 0.05, "alpha_y": 0.17}}, "source"),
        ({"source": "Ward 1992, p. 9"}, "source"),
    ],
)
def test_what_cites_a_paper_has_the_parameters_of_the_paper(changes: dict[str, Any], leaf: str) -> None:
    """Record, attributes and digest agree: only the presets can tell."""
    forged = presets()["rolled-brass"].model_copy(update=changes)
    found = audit(tabulated(forged, ANISOTROPIC)).of(Record)
    assert [each.leaf for each in found.worst] == [f"source_record.material.{leaf}"]


def test_no_sound_table_of_any_model_is_accused() -> None:
    """`tests/benchmarks/audit_leaves.py` takes 60; here is a table of each of some models."""
    for words, table in materials(4, seed=41):
        source = of_store(table)
        assert record_of(table, expected_of(Subject(table, source)), source).verdict == "passes", words


def of_store(table: Table) -> Material | None:
    return table.source if isinstance(table.source, Material) else None
