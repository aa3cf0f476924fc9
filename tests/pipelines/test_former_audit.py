"""What a new audit takes from the last report, and what makes it audit again."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

import brdfdb
from brdfdb_pipelines import audit
from tests.pipelines.command import Captured, run

NAMES = ("blue-plastic", "foam", "mirror")


@pytest.fixture(scope="module")
def audited(tmp_path_factory: pytest.TempPathFactory, built: Path) -> Path:
    """A store of three materials that was audited, with its page."""
    root = tmp_path_factory.mktemp("audited") / "store"
    root.mkdir()
    shutil.copy(built / "brdfdb.json", root)
    for name in NAMES:
        shutil.copytree(built / "materials" / name, root / "materials" / name)
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
    before, page = json.loads((store / "audit.json").read_bytes()), (store / "audit.html").read_bytes()
    assert before["taken_over"] == []
    assert taken(store) == list(NAMES)
    assert "3 of 3 taken from the report of " in capsys.readouterr().out
    after = json.loads((store / "audit.json").read_bytes())
    assert after["materials"] == before["materials"]
    assert (store / "audit.html").read_bytes() == page


@pytest.mark.usefixtures("no_plots")
def test_all_audits_everything(store: Path) -> None:
    assert taken(store, "--all") == []


@pytest.mark.usefixtures("no_plots")
@pytest.mark.parametrize(
    "harm",
    [
        lambda text: text.replace('"passes"', '"violates"', 1),
        lambda text: text[: len(text) // 2],
        lambda text: text.replace('"version":8', '"version":7', 1),
        lambda _: "{}",
    ],
    ids=["changed", "cut", "older", "foreign"],
)
def test_a_damaged_or_foreign_report_audits_everything(harm: Callable[[str], str], store: Path) -> None:
    report = store / "audit.json"
    text = report.read_text(encoding="utf-8")
    assert harm(text) != text
    report.write_text(harm(text), encoding="utf-8")
    assert taken(store) == []


@pytest.mark.usefixtures("no_plots")
def test_another_program_audits_everything(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audit, "program", lambda: "another")
    assert taken(store) == []


@pytest.mark.usefixtures("no_plots")
def test_other_bytes_under_the_same_number_are_audited_again(store: Path) -> None:
    shutil.rmtree(store / "materials" / "foam")
    recipe = store.parent / "foam.toml"
    recipe.write_text('materials = ["foam"]\ntolerance = 0.03\n', encoding="utf-8")
    assert run("build", recipe, "--store", store, "--jobs", 1) == 0
    assert brdfdb.open(store).head("foam") == "r000001"
    assert taken(store) == ["blue-plastic", "mirror"]


@pytest.mark.usefixtures("no_plots")
def test_a_damaged_table_is_found_though_its_audit_is_known(store: Path) -> None:
    chunk = next(path for path in (store / "materials" / "foam").rglob("c/**/0") if path.is_file())
    chunk.write_bytes(chunk.read_bytes()[:-1] + b"\0\1")
    with pytest.raises(brdfdb.errors.StoreError, match="foam"):
        audit.run(store, [], store / "audit.json", jobs=1, figures=False, shown=False)
    document = json.loads((store / "audit.json").read_bytes())
    assert document["taken_over"] == ["blue-plastic", "mirror"]
    assert len(document["damaged"]) == 1


@pytest.mark.usefixtures("no_plots")
def test_a_page_that_is_gone_is_written_again(store: Path) -> None:
    (store / "audit.html").unlink()
    assert taken(store) == list(NAMES)
    assert (store / "audit.html").is_file()


@pytest.mark.usefixtures("no_plots")
def test_materials_whose_excess_is_allowed_are_audited_again(store: Path) -> None:
    assert taken(store, "--allow", "foam") == ["blue-plastic", "mirror"]
