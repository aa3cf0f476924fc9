"""Quick runs of every benchmark: each ends well, and its record is valid, finite and of sensible numbers."""

from __future__ import annotations

import importlib
import os
import re
import shutil
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from tests.benchmarks import recording
from tests.benchmarks.recording import Record, Table

FOLDER = Path(__file__).parent
HELPERS = {"forged_stores", "picture_judge", "plain", "planted_tables", "recording", "sound_materials"}
SCRIPTS = sorted({path.stem for path in FOLDER.glob("*.py")} - HELPERS - {"test_benchmarks"})
SIGNED = {"difference"}  # columns whose numbers may be negative

needs = {
    "against_cpp": pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed"),
    "mitsuba_microfacet": pytest.mark.skipif(find_spec("mitsuba") is None, reason="mitsuba is not installed"),
    "mitsuba_plugins": pytest.mark.skipif(
        find_spec("mitsuba") is None or "DRJIT_LIBLLVM_PATH" not in os.environ,
        reason="mitsuba is not installed, or DRJIT_LIBLLVM_PATH names no LLVM 19",
    ),
}


def test_helpers_are_no_scripts_and_all_others_are() -> None:
    runs = {path.stem for path in FOLDER.glob("*.py") if '\nif __name__ == "__main__":\n' in path.read_text("utf-8")}
    assert runs == {*SCRIPTS}


def test_every_script_has_a_record_and_every_record_a_script() -> None:
    assert sorted(path.stem for path in recording.FOLDER.glob("*.json")) == SCRIPTS


@pytest.mark.parametrize("name", SCRIPTS)
def test_records_of_the_site_are_valid_and_name_no_machine(name: str) -> None:
    text = (recording.FOLDER / f"{name}.json").read_text(encoding="utf-8")
    check(Record.model_validate_json(text), name)
    assert not re.search(r'[" ](/[\w.-]+){2}', text)


@pytest.mark.judge
@pytest.mark.parametrize("name", [pytest.param(name, marks=needs.get(name, ())) for name in SCRIPTS])
def test_a_quick_run_ends_well(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(recording, "FOLDER", tmp_path)
    script = importlib.import_module(f"tests.benchmarks.{name}")
    assert script.main(["--quick", "--record"]) == 0
    record = Record.model_validate_json((tmp_path / f"{name}.json").read_text(encoding="utf-8"))
    check(record, name)
    assert record.quick
    assert record.command == f"python tests/benchmarks/{name}.py --quick --record"
    printed = capsys.readouterr().out
    for table in record.tables:
        assert table.title in printed
        for row in table.rows:
            assert all(column.cell(value) in printed for column, value in zip(table.columns, row, strict=True))


def check(record: Record, name: str) -> None:
    """Check a record: tables of the same width throughout, with numbers that are not negative."""
    assert record.name == name
    assert record.title
    assert record.measured.endswith(".")
    assert record.tables
    for table in record.tables:
        assert table.rows, table.title
        check_numbers(table)
    names = [table.title for table in record.tables]
    assert len(set(names)) == len(names)


def check_numbers(table: Table) -> None:
    """Check that numbers are positive or 0, and that shares are no more than the whole."""
    assert {len(row) for row in table.rows} == {len(table.columns)}
    for number, column in enumerate(table.columns):
        values = [row[number] for row in table.rows]
        numbers = [value for value in values if isinstance(value, int | float)]
        if column.name not in SIGNED:
            assert all(value >= 0 for value in numbers), (table.title, column.heading)
        if table.title.startswith("Share "):
            assert all(value <= 1 for value in numbers), (table.title, column.heading)


def test_a_record_holds_numbers_of_numpy_and_leaves_out_what_is_not_finite() -> None:
    table = Table(title="A table", columns=[recording.Column(name=name) for name in "abcd"])
    table.add("a", np.int64(3), np.float32(0.25), np.nan)
    assert table.rows == [["a", 3, 0.25, None]]


def test_a_record_has_the_worst_row_of_each_group_and_no_column_that_is_only_printed() -> None:
    columns = [recording.Column(name=name, recorded=name != "seconds") for name in ("name", "error", "seconds")]
    table = Table(title="A table", columns=columns)
    for row in (["ab", 1.0, 5.0], ["ac", 3.0, 4.0], ["b", None, 3.0], ["ad", 2.0, 2.0]):
        table.add(*row)
    table.keep_worst("error", lambda row: str(row[0])[0])
    assert table.recorded().rows == [["ac", 3.0], ["b", None]]
    table.keep_worst("error", lambda _: None, smallest=True)
    assert table.rows == [["ac", 3.0, 4.0]]


def test_numbers_are_shown_with_three_digits() -> None:
    values = [0.0, 1234.5, 0.012345, 1e-5, 2.5e7, None, "x"]
    cells = ["0", "1230", "0.0123", "1.00e-05", "2.50e+07", "-", "x"]
    assert [recording.Column(name="any").cell(value) for value in values] == cells
