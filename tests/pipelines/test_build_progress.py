"""How a build tells where it is: rates leave out what was kept, bars show tables in progress, lines are JSON."""

from __future__ import annotations

import json

import pytest

from brdfdb_pipelines import build_progress
from brdfdb_pipelines.build_progress import Bars, Tally, print_json
from tests.pipelines.command import Captured


def test_the_rate_is_that_of_what_was_computed_and_tells_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([100.0, 101.0, 102.0, 104.0])
    monkeypatch.setattr(build_progress.time, "perf_counter", lambda: next(clock))
    tally = Tally(1000)
    assert tally.add(300, kept=True) == {
        "values_done": 300, "values_total": 1000, "values_per_s": 0, "seconds_left": None
    }  # fmt: skip
    assert tally.add(100, kept=False) == {
        "values_done": 400, "values_total": 1000, "values_per_s": 50, "seconds_left": 12.0
    }  # fmt: skip
    assert tally.add(600, kept=False)["seconds_left"] == 0.0


def test_lines_are_json_and_bars_are_on_stderr(capsys: Captured) -> None:
    print_json({"event": "unchanged", "material": "Größe", "revision": "r000001"})
    out, err = capsys.readouterr()
    assert (json.loads(out), err) == ({"event": "unchanged", "material": "Größe", "revision": "r000001"}, "")
    block = {"event": "block", "blocks": 2, "kept": False, "values_total": 4, "values_per_s": 2e6, "seconds_left": 0.0}
    with Bars() as bars:
        bars({"event": "compiling", "kernels": 0})
        bars({"event": "compiling", "kernels": 2})
        bars({"event": "compiled"})
        (compiling,) = bars._progress.tasks
        assert (compiling.description, compiling.completed) == ("compiling, once after an installation", 1)
        assert compiling.fields["rate"] == "1/2 kernels"
        bars({"event": "start", "tables": 2, "store": "store"})
        bars({"event": "surveyed", "material": "white", "state": "missing", "why": "new"})
        (overall,) = bars._progress.tasks
        assert overall.fields["rate"] == "1/2 tables"
        bars({"event": "planned", "tables": 2, "values": 4})
        bars({"event": "waiting", "material": "grey"})
        bars({**block, "material": "white", "block": 0, "values_done": 2})
        assert [task.description for task in bars._progress.tasks] == ["tabulating", "  white"]
        bars({**block, "material": "white", "block": 1, "values_done": 4})
        bars({"event": "failed", "material": "grey", "error": "[no] idea"})
        bars({"event": "published", "material": "white", "revision": "r000001", "bytes": 1, "why": "new"})
        (overall,) = bars._progress.tasks
        assert (overall.completed, overall.total, overall.fields["rate"]) == (4, 4, "2.0 M values/s")
        bars({"event": "done"})
    out, err = capsys.readouterr()
    assert out == ""
    # where nobody sees a bar move, lines say what begins
    begun = ["compiling kernels, once after an installation", "planning 2 tables", "tabulating 2 tables"]
    assert [line for line in dict.fromkeys(err.splitlines()) if line in begun] == begun
    assert "waiting for grey: " in err
    assert "grey failed: [no] idea" in err


def test_a_log_says_what_a_simulation_does(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build_progress, "_LOG_S", 0.0)
    judged = {"event": "judged", "material": "rough", "target": 0.02}
    with Bars() as bars:
        bars({"event": "start", "tables": 1, "store": "store"})
        bars({"event": "planned", "tables": 0, "values": 0})
        assert bars._progress.tasks == []  # no table of a model is to be tabulated
        bars({"event": "simulating", "material": "rough", "tables": 1})
        for number in (1, 0):  # as processes finish them
            bars({"event": "estimate", "material": "rough", "number": number, "of": 2, "kept": False})
        bars({**judged, "realisations": 2, "standard_error": 0.031, "next": 3})
        bars({"event": "estimate", "material": "rough", "number": 2, "of": 3, "kept": False})
        (bar,) = bars._progress.tasks
        assert (bar.completed, bar.total, bar.fields["rate"]) == (3, 3, "standard error 3.1 %")
        bars({"event": "interpolating", "material": "rough"})
        (bar,) = bars._progress.tasks
        assert bar.description == "  rough, interpolating and tabulating"
        bars({"event": "published", "material": "rough", "revision": "r000001", "bytes": 1, "why": "new"})
        bars({"event": "estimate", "material": "rough", "number": 3, "of": 4, "kept": False})  # too late for a bar
    assert capsys.readouterr().err.split("\n")[:7] == [
        "planning 1 table",
        "simulating rough by rays",
        "rough: 1 of 2 realisations",
        "rough: 2 of 2 realisations",
        "rough: 2 realisations, standard error 3.1 %, target 2 %",
        "rough: 3 of 3 realisations",
        "rough: interpolating and tabulating",
    ]


def test_a_table_of_measured_data_that_failed_does_not_count_as_done(capsys: Captured) -> None:
    with Bars() as bars:
        for name in ("grey", "white"):
            bars({"event": "measuring", "material": name, "tables": 2})
        bars({"event": "failed", "material": "grey", "error": "no idea"})
        bars({"event": "published", "material": "white", "revision": "r000001", "bytes": 1, "why": "new"})
        (overall,) = bars._progress.tasks
        assert (overall.completed, overall.fields["rate"]) == (1, "1/2 tables")
    capsys.readouterr()
