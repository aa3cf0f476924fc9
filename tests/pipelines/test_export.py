"""The export job: what is left out, what is beyond its tolerance, and whose verdict is written."""

from __future__ import annotations

import json
import os
import signal
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from brdfdb.errors import CannotHoldError, ParameterError
from brdfdb.formats import EXPORTERS
from brdfdb.formats._interface import TOLERANCE
from brdfdb.formats._stated_error import FileError, FileStatement
from brdfdb.formats._written import Written, whole
from brdfdb.materials import Material
from brdfdb.store.publication import publish_dataset
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import tabulate
from brdfdb_pipelines.commands import TERMINATED
from tests.pipelines.command import Captured, refused, run

P99 = {"grey": 0.01, "dark": 0.03001}


def write(table: Any, path: Path, *, tolerance: float = 0.02, verdict: str | None = None) -> Written:
    if table.name == "strange":
        raise CannotHoldError("strange: this format holds nothing strange")
    with whole(path) as (half,):
        half.write_text(str(verdict))
    p99, rows = P99[table.name], {"bands": [0.1] * 9, "one_grazing": [0.3] * 3, "both_grazing": [0.4] * 3}
    stated = {"against": "the model", "p98": 2.0 * p99, "floor": [1e-4], "between": None}
    statement = FileStatement.model_validate(stated | {"places": rows | {"alongside": [0.2] * 9}})
    error = FileError(p99, p99, p99, 0.0, 0.0, lambda: statement)
    remarks = ("a specular part is not in the file",) if table.name == "dark" else ()
    return Written((path,), error, tolerance, remarks)


LIST = SimpleNamespace(
    suffix=".list", media_type="text/plain", summary="lists", tools="", kinds=(), options=(TOLERANCE,), write=write
)


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A store with three grey tables, and the format in the registry."""
    monkeypatch.setitem(EXPORTERS, "list", LIST)
    grid = Grid({"theta_i": [0, 80], "theta_r": [0, 80], "delta_phi": [0, 90, 180]})
    for name in ("grey", "dark", "strange"):
        table = {"title": name, "model": "lambert", "source": "no paper", "parameters": {"rho": 0.5}}
        publish_dataset(tmp_path / "store", name, tabulate(Layout(Material.from_table(name, table), grid)))
    return tmp_path / "store"


def test_sigterm_leaves_no_half_file(
    store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    def ended(_: Any, path: Path, **__: Any) -> Written:
        with whole(path) as (half,):
            half.write_text("half")
            os.kill(os.getpid(), signal.SIGTERM)
            half.write_text("whole")
        return Written((path,))

    monkeypatch.setattr(LIST, "write", ended)
    before = signal.signal(signal.SIGTERM, signal.SIG_DFL)
    try:
        assert run("export", "list", "grey", "--store", store, "--out", tmp_path / "out") == TERMINATED == 143
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    finally:
        signal.signal(signal.SIGTERM, before)
    assert capsys.readouterr().err.endswith("\nbrdfdb: interrupted\n")
    assert [(path.name, path.read_text()) for path in (tmp_path / "out").iterdir()] == [("grey.list", "whole")]


def test_all_leaves_out_what_the_format_cannot_hold(store: Path, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "out"
    assert run("export", "list", "--all", "--store", store, "--out", out) == 0
    text = capsys.readouterr().out
    assert text.startswith("2 LIST files, ")
    assert "99 % of the values within 3.01% (dark.list)" in text  # rounded up as in the file
    assert "98 % of the values within 6% (dark.list), near the light 20%, next to the horizon 40%\n" in text
    assert "dark.list: 3.01%, above the tolerance of 2%\n" in text
    assert "dark: a specular part is not in the file\n" in text
    assert text.endswith("strange: this format holds nothing strange; left out\n")
    assert sorted(path.name for path in out.iterdir()) == ["dark.list", "grey.list"]


def test_places_without_data_are_named(
    store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    def of_data(table: Any, path: Path, **options: Any) -> Written:
        written = write(table, path, **options)
        assert written.error is not None
        known = written.error.statement
        assert known is not None
        nowhere = known.places.model_copy(update={"one_grazing": [0.0] * 3, "both_grazing": [0.0] * 3})
        statement = known.model_copy(update={"against": "the data", "places": nowhere})
        return replace(written, error=replace(written.error, measure=lambda: statement))

    monkeypatch.setattr(LIST, "write", of_data)
    assert run("export", "list", "grey", "--store", store, "--out", tmp_path / "out") == 0
    assert "near the light 20%, next to the horizon there are no data\n" in capsys.readouterr().out


def test_a_material_that_is_named_is_refused_and_others_are_written(
    store: Path, tmp_path: Path, capsys: Captured
) -> None:
    said = "strange: this format holds nothing strange"
    assert refused(capsys, "export", "list", "strange", "--store", store, "--out", tmp_path / "out") == said
    assert run("export", "list", "strange", "grey", "--store", store, "--out", tmp_path / "out") == 2
    captured = capsys.readouterr()
    assert captured.out.startswith("1 LIST file, ")
    assert captured.err.endswith(f"\nbrdfdb: {said}\n")


def test_kinds_before_one_that_is_refused_count(
    store: Path, tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    def write_kind(_: Any, path: Path, *, kind: str, verdict: str | None = None) -> Written:
        if kind == "colour":
            raise ParameterError("wavelength", "900 nm is outside")
        (path.with_suffix(".more")).write_text("")
        path.write_text(str(verdict))
        return Written((path, path.with_suffix(".more")))

    kinds = SimpleNamespace(**{**vars(LIST), "kinds": ("plain", "colour"), "options": (), "write": write_kind})
    monkeypatch.setitem(EXPORTERS, "list", kinds)
    assert run("export", "list", "grey", "--store", store, "--out", tmp_path / "out") == 2
    captured = capsys.readouterr()
    assert captured.out.startswith("1 LIST file and 1 more, ")
    assert captured.err.endswith("\nbrdfdb: grey: wavelength: 900 nm is outside\n")


def test_strict_is_no_option_of_formats_without_a_tolerance(tmp_path: Path, capsys: Captured) -> None:
    with pytest.raises(SystemExit, match="2"):
        run("export", "exr", "grey", "--strict", "--out", tmp_path / "out")
    assert "--strict" in capsys.readouterr().err


def test_errors_above_all_of_the_value_are_multiples(
    store: Path, tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(P99, "dark", 449.3)
    assert run("export", "list", "dark", "--store", store, "--out", tmp_path / "out") == 0
    assert "\ndark.list: 450 times the value, above the tolerance of 2%\n" in capsys.readouterr().out


@pytest.mark.parametrize(("name", "code"), [("grey", 0), ("dark", 1)])
def test_strict_fails_beyond_the_tolerance(store: Path, tmp_path: Path, name: str, code: int) -> None:
    assert run("export", "list", name, "--strict", "--store", store, "--out", tmp_path) == code
    assert (tmp_path / f"{name}.list").exists()


def test_the_verdict_of_this_revision_is_written(store: Path, tmp_path: Path) -> None:
    entries = [("grey", "r000001", "passes"), ("dark", "r000009", "violates")]
    report = {"materials": [dict(zip(("material", "revision", "verdict"), entry, strict=True)) for entry in entries]}
    (store / "audit.json").write_text(json.dumps(report))
    assert run("export", "list", "grey", "dark", "--store", store, "--out", tmp_path) == 0
    assert (tmp_path / "grey.list").read_text() == "passes"
    assert (tmp_path / "dark.list").read_text() == "not audited"
    (store / "audit.json").write_text("[")
    assert run("export", "list", "grey", "--store", store, "--out", tmp_path) == 0
    assert (tmp_path / "grey.list").read_text() == "not audited"


@pytest.mark.parametrize("text", ["[", "[]", '{"materials": [1]}', None])
def test_a_report_that_is_named_must_be_one(store: Path, tmp_path: Path, capsys: Captured, text: str | None) -> None:
    report, reason = tmp_path / "report.json", "No such file or directory"
    if text is not None:
        report.write_text(text)
        reason = "it is not a report of `brdfdb audit`"
    out = tmp_path / "out"
    said = refused(capsys, "export", "list", "grey", "--audit", report, "--store", store, "--out", out)
    assert said == f"audit: {report} cannot be read: {reason}"
    assert not out.exists()


def test_an_output_that_is_a_directory_is_refused(store: Path, tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "grey.list").mkdir()
    said = refused(capsys, "export", "list", "grey", "--store", store, "--out", tmp_path)
    assert said.endswith("grey.list: it is a directory")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["grey.list", "store"]
