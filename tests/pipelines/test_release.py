"""`brdfdb release`: what it refuses before any work, the documents that it makes of an edition, and their judges."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

import brdfdb
from brdfdb.distribution import UNSTATED, distribution
from brdfdb.store.edition.reader import Edition
from brdfdb.store.paths import EDITION
from brdfdb_pipelines import release
from brdfdb_pipelines import release_documents as documents
from tests.pipelines.command import Captured, refused

ROOT = Path(__file__).parents[2]
LIBRARIES = {"papers": "Materials of papers", "others": "Others"}
NAMES = {"papers": ["rolled-brass"], "others": ["copper", "grey-001", "grey-002"]}
JUDGES = Path(os.environ.get("BRDFDB_CF", "")).parent  # the folder of programs that judge documents
FRONT = "<!DOCTYPE html>\n<html><head><title>brdfdb</title></head><body></body></html>\n"


@pytest.fixture(autouse=True)
def small_database(monkeypatch: pytest.MonkeyPatch) -> None:
    """The kept store in the place of the default database, and a clone that is clean."""
    monkeypatch.setattr(release, "libraries", lambda: LIBRARIES)
    monkeypatch.setattr(release, "presets", lambda library: dict.fromkeys(NAMES[library]))
    monkeypatch.setattr(release, "check_clone", lambda _: None)


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kept")
    shutil.unpack_archive(ROOT / "tests" / "store" / "kept" / "store-2.zip", folder)
    return folder


@pytest.fixture
def made(kept: Path, tmp_path: Path) -> tuple[Path, documents.EditionFacts]:
    """A release of the kept store, without the program, and the facts that it states."""
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "index.html").write_text(FRONT)
    edition = release._publish(ROOT, kept, tmp_path)
    release._describe(ROOT, tmp_path, edition)
    return tmp_path, edition


def of_json(path: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return document


# What is refused before any work


def test_a_place_that_is_no_clone_or_has_changes_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    with pytest.raises(release.ReleaseError, match="is not a clone of the repository"):
        release.check_clone(tmp_path)
    for command in (
        ["init", "-q"],
        ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "a", "--allow-empty"],
    ):
        subprocess.run(["git", "-C", str(tmp_path), *command], check=True)
    release.check_clone(tmp_path)
    (tmp_path / "new.txt").touch()
    with pytest.raises(release.ReleaseError, match=r"changes that are not committed, such as new\.txt;"):
        release.check_clone(tmp_path)


def test_a_missing_extra_and_a_full_directory_are_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").touch()
    for module in release._NEEDED:
        monkeypatch.setitem(sys.modules, module, None if module == "hatchling" else sys)
    assert "[release]" in refused(capsys, "release", tmp_path / "full")
    monkeypatch.setitem(sys.modules, "hatchling", sys)
    assert refused(capsys, "release", tmp_path / "full").endswith("full is not an empty directory; name a new one")
    assert "docs/new lies in the clone, which must stay" in refused(capsys, "release", ROOT / "docs" / "new")
    assert not (ROOT / "docs" / "new").exists()


# The steps


def test_the_directory_has_everything_or_does_not_exist(
    kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    for module in ("hatchling", "sphinx", "myst_nb"):
        monkeypatch.setitem(sys.modules, module, sys)
    asked: list[str] = []

    @contextlib.contextmanager
    def running(
        _clone: Path, work: Path, module: str, *arguments: str, store: Path | None = None
    ) -> Iterator[Callable[[], None]]:
        asked.append(" ".join([module, *arguments[:1]]))
        if module == "sphinx":
            assert store == work / "papers"
            Path(arguments[-1]).mkdir(parents=True)
            (Path(arguments[-1]) / "index.html").write_text(FRONT)
        yield lambda: asked.append(f"{module} ended")

    monkeypatch.setattr(release, "_running", running)
    monkeypatch.setattr(shutil, "copytree", lambda *_, **__: None)
    whole = release._publish
    monkeypatch.setattr(release, "_publish", lambda clone, _, part: whole(clone, kept, part))
    monkeypatch.setattr(brdfdb, "__file__", str(tmp_path / "clone" / "brdfdb" / "__init__.py"))
    monkeypatch.setattr(release, "git", lambda *_: "2026-11-29\n")
    (tmp_path / "clone").mkdir()
    (tmp_path / "clone" / "CITATION.cff").write_bytes((ROOT / "CITATION.cff").read_bytes())
    assert refused(capsys, "release", tmp_path / "clone") == (
        f"OUT: {tmp_path / 'clone'} is not an empty directory; name a new one"
    )
    edition = release.run(tmp_path / "out")
    program = "brdfdb_pipelines.cli"
    assert asked == [
        *("hatchling build", "hatchling ended", f"{program} build", f"{program} ended", f"{program} audit"),
        *(f"{program} ended", "sphinx -W", f"{program} build", f"{program} ended", "sphinx ended"),
    ]
    assert edition.materials == 4
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"edition", "site", "CITATION.cff", "datacite.json", "croissant.json", "SHA256SUMS"}
    monkeypatch.setattr(release, "_describe", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        release.run(tmp_path / "second")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["clone", "out"]


def test_a_step_that_fails_names_its_log(tmp_path: Path) -> None:
    with pytest.raises(
        release.ReleaseError, match=r"^brdfdb_pipelines\.cli list failed: brdfdb: no store at .*\.log has"
    ):
        release._run(ROOT, tmp_path, "brdfdb_pipelines.cli", "list", "--store", str(tmp_path / "none"))
    assert "no store at" in (tmp_path / "brdfdb_pipelines.log").read_text()


def test_a_store_with_other_materials_is_not_released(
    kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(NAMES, "others", ["copper"])
    with pytest.raises(release.ReleaseError, match="has materials of other recipes; remove "):
        release._publish(ROOT, kept, tmp_path)


# What the documents say


def test_the_numbers_are_those_of_the_edition(made: tuple[Path, documents.EditionFacts]) -> None:
    out, edition = made
    opened = Edition(out / "edition")
    assert edition.digest == opened.digest
    assert (edition.materials, dict(edition.libraries)) == (len(opened), {"Materials of papers": 1, "Others": 3})
    assert edition.title == f"brdfdb {distribution().version}: BRDF tables of 4 materials"
    files = [path for path in (out / "edition").rglob("*") if path.is_file()]
    assert edition.objects == len(files)
    assert edition.bytes == sum(path.stat().st_size for path in files if path.name != EDITION)
    cited = yaml.safe_load((out / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["identifiers"] == cited["references"][-1]["identifiers"]
    assert cited["identifiers"][0]["value"] == f"sha256:{edition.digest}"
    assert len(cited["references"]) == 4
    record = of_json(out / "datacite.json")
    assert record["sizes"] == ["4 materials", f"{edition.objects} files", f"{edition.bytes} bytes"]
    dois = [reference["doi"] for reference in cited["references"] if "doi" in reference]
    assert [related["relatedIdentifier"] for related in record["relatedIdentifiers"]] == dois
    (script,) = re.findall(r'<script type="application/ld\+json">(.*)</script>', (out / "site/index.html").read_text())
    dataset = json.loads(script)
    assert (dataset["@type"], dataset["identifier"]) == ("Dataset", f"sha256:{edition.digest}")
    assert (out / "site" / dataset["distribution"][0]["contentUrl"]).stat().st_size == edition.catalogue_bytes


def test_what_the_owner_must_state_is_marked_and_what_he_stated_is_taken(
    made: tuple[Path, documents.EditionFacts], monkeypatch: pytest.MonkeyPatch
) -> None:
    out, edition = made
    for name in ("CITATION.cff", "datacite.json", "croissant.json"):
        assert UNSTATED in (out / name).read_text(encoding="utf-8")
    stated = distribution()._replace(authors=("Ada", "Bo"), licence="MIT", address="https://example.org")
    monkeypatch.setattr(documents, "distribution", lambda: stated)
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    cited = documents.citation(text, edition)
    assert yaml.safe_load(cited)["license"] == "MIT"
    assert yaml.safe_load(cited)["references"][-1]["authors"] == [{"name": "Ada"}, {"name": "Bo"}]
    record = documents.datacite(text, edition)
    assert record["rightsList"][0]["rightsIdentifier"] == "MIT"
    assert record["creators"] == [{"name": "Ada"}, {"name": "Bo"}]
    assert UNSTATED not in cited + json.dumps([record, documents.croissant(edition), documents.schema_org(edition)])


def test_the_checksums_are_those_of_all_files(made: tuple[Path, documents.EditionFacts]) -> None:
    out, _ = made
    listed = dict(line.split("  ")[::-1] for line in (out / release.CHECKSUMS).read_text().splitlines())
    files = {path.relative_to(out).as_posix(): path for path in out.rglob("*") if path.is_file()}
    assert listed.keys() == files.keys() - {release.CHECKSUMS}
    assert all(hashlib.sha256(files[name].read_bytes()).hexdigest() == digest for name, digest in listed.items())


READ_ALL = """
import json, sys
import mlcroissant
from datacite import schema45
schema45.validator.validate(json.load(open("datacite.json")))
dataset = mlcroissant.Dataset("croissant.json")
print(json.dumps([row["materials/name"].decode() for row in dataset.records("materials")]))
"""


@pytest.mark.judge
@pytest.mark.skipif(Path() == JUDGES, reason="BRDFDB_CF names no folder of judges")
def test_judges_of_documents_find_no_fault(made: tuple[Path, documents.EditionFacts]) -> None:
    out, _ = made
    subprocess.run([JUDGES / "cffconvert", "--validate"], cwd=out, check=True)
    done = subprocess.run([JUDGES / "python", "-c", READ_ALL], cwd=out, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == sorted([*NAMES["papers"], *NAMES["others"]])
    assert "WARNING" not in done.stderr
