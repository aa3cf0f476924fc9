"""What a new audit takes from the last report, and what makes it audit again."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import brdfdb
from brdfdb_pipelines import audit
from tests.pipelines.a_lambert import publish_lambert
from tests.pipelines.command import Captured, run

NAMES = ("black", "grey", "white")


@pytest.fixture(scope="module")
def audited(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store of three materials that was audited, with its page."""
    root = tmp_path_factory.mktemp("audited") / "store"
    for name, rho in zip(NAMES, (0.1, 0.5, 0.9), strict=True):
        publish_lambert(root, name, rho)
    assert run("audit", "--store", root, "--no-figures", "--jobs", 1) == 0
    return root


@pytest.fixture
def store(audited: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(audited, tmp_path / "store"))


def taken(root: Path, *options: str) -> list[str]:
    assert run("audit", "--store", root, "--no-figures", "--jobs", 1, *options) == 0
    names: list[str] = json.loads((root / "audit.json").read_bytes())["taken_over"]
    return names


def test_nothing_new_is_taken_over_and_the_page_stays(store: Path, capsys: Captured) -> None:
    before = json.loads((store / "audit.json").read_bytes())
    page = (store / "audit.html").read_bytes()
    assert before["taken_over"] == []
    assert taken(store) == list(NAMES)
    assert "3 of 3 results reused from the report of " in capsys.readouterr().out
    after = json.loads((store / "audit.json").read_bytes())
    assert after["materials"] == before["materials"]
    assert (store / "audit.html").read_bytes() == page
    (store / "audit.html").unlink()
    assert taken(store) == list(NAMES)
    assert (store / "audit.html").is_file()


@pytest.mark.usefixtures("no_plots")
def test_a_damaged_or_foreign_report_and_another_program_audit_everything(
    store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert taken(store, "--all") == []
    report = store / "audit.json"
    text = report.read_text(encoding="utf-8")
    changed, older = text.replace('"passes"', '"violates"', 1), text.replace('"version":8', '"version":7', 1)
    for harmed in (changed, text[: len(text) // 2], older, "{}"):
        assert harmed != text
        report.write_text(harmed, encoding="utf-8")
        assert taken(store) == []
    monkeypatch.setattr(audit, "program", lambda: "another")
    assert taken(store) == []


@pytest.mark.usefixtures("no_plots")
def test_other_bytes_under_the_same_number_are_audited_again(store: Path) -> None:
    shutil.rmtree(store / "materials" / "grey")
    publish_lambert(store, "grey", 0.4)
    assert brdfdb.open(store).head("grey") == "r000001"
    assert taken(store) == ["black", "white"]


@pytest.mark.usefixtures("no_plots")
def test_a_damaged_table_is_found_though_its_audit_is_known(store: Path) -> None:
    chunk = next(path for path in (store / "materials" / "grey").rglob("c/**/0") if path.is_file())
    chunk.write_bytes(chunk.read_bytes()[:-1] + b"\0\1")
    with pytest.raises(brdfdb.errors.StoreError, match="grey"):
        audit.run(store, [], store / "audit.json", jobs=1, figures=False, shown=False)
    document = json.loads((store / "audit.json").read_bytes())
    assert document["taken_over"] == ["black", "white"]
    assert len(document["damaged"]) == 1


@pytest.mark.usefixtures("no_plots")
def test_materials_whose_excess_is_allowed_are_audited_again(store: Path) -> None:
    assert taken(store, "--allow", "grey") == ["black", "white"]
