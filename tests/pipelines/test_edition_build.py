"""Builds of an edition: the tables of an ordinary build, shards that go on, and families."""

from __future__ import annotations

import json
import re
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb.errors import ParameterError, StoreError
from brdfdb.materials import Material
from brdfdb.store.edition import publishing
from brdfdb.store.edition.reader import Edition
from brdfdb.store.reader import Store
from brdfdb.store.records import make_store
from brdfdb_pipelines import edition_build
from brdfdb_pipelines.build import build
from brdfdb_pipelines.cli import main
from brdfdb_pipelines.edition_build import Shard, build_edition, build_shard, shards_of
from brdfdb_pipelines.recipe_file import Recipe, load
from brdfdb_pipelines.recipe_grids import RecipeError
from brdfdb_pipelines.workers import Workers, threads
from tests.pipelines.command import Captured, refused, run
from tests.pipelines.recipes import anisotropic, isotropic

SWEEP = """\
[sweep.sheet]
title = "Sheet"
model = "oren_nayar"
source = "made up for this test"
[sweep.sheet.parameters]
rho = [0.2, 0.5, 0.8]
sigma_deg = [5, 15, 30]
"""
ON_GRID = 'materials = ["foam", "sheet"]\n' + isotropic("[0, 40, 80]", "[0, 90, 180]") + SWEEP
TO_TOLERANCE = 'materials = ["sheet"]\ntolerance = 0.1\n' + SWEEP


def recipe_of(folder: Path, text: str) -> Recipe:
    path = folder / "recipe.toml"
    path.write_text(text)
    return load(path)


def built(recipe: Recipe, to: Path, report: Any = lambda _: None) -> Edition:
    with threads(1) as at:
        edition = build_edition(recipe, to, at, report)
    opened = Edition(to)
    assert opened.digest == edition.digest
    return opened


@pytest.fixture(autouse=True)
def small_shards(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(edition_build, "_FEWEST_MEMBERS", 4)


def test_an_edition_has_the_tables_and_families_of_an_ordinary_build(tmp_path: Path) -> None:
    recipe = recipe_of(tmp_path, ON_GRID)
    edition = built(recipe, tmp_path / "edition")
    with threads(1) as at:
        build(recipe, tmp_path / "store", at)
    store = Store(tmp_path / "store")
    assert [*edition] == [*store]
    for name in store:
        assert edition.attributes(name) == store.metadata(name).attributes()
        assert np.array_equal(edition[name].values, store[name].values)
        edition.verify(name)
    assert edition.families() == store.families() == ["sheet"]
    assert edition.family_content("sheet") == store.family_content("sheet")
    assert edition.family("sheet").lookup(0.3, 0.0, 0.4, 1.0, rho=0.4, sigma=0.2) > 0.0


def test_a_second_build_tabulates_missing_shards_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recipe = recipe_of(tmp_path, ON_GRID)
    first = built(recipe, tmp_path / "edition")
    shards = [shard for order in recipe.orders() for shard in shards_of(order)]
    parts = {shard.digest for shard in shards}
    assert len(parts) == 4  # foam, and 9 members in shards of 4
    lost = next(iter(parts))
    (tmp_path / "edition" / "parts" / f"{lost}.json").unlink()
    (tmp_path / "edition" / "edition.json").unlink()
    tabulated: list[str] = []

    def noted(destination: str, options: str, requests: str, digest: str, *more: Any) -> None:
        tabulated.append(digest)
        build_shard(destination, options, requests, digest, *more)

    monkeypatch.setattr(edition_build, "build_shard", noted)
    events: list[dict[str, Any]] = []
    second = built(recipe, tmp_path / "edition", events.append)
    assert tabulated == [lost]
    assert [*second] == [*first]
    kept = [event["tables"] for event in events if event["event"] == "shard" and event["kept"]]
    assert sum(kept) == len(first) - next(shard.tables for shard in shards if shard.digest == lost)
    (tmp_path / "edition" / "groups" / f"{second.index['groups'][0]['digest']}.records").unlink()
    tabulated.clear()
    assert built(recipe, tmp_path / "edition").digest == second.digest
    assert len(tabulated) == 1
    second.verify(next(iter(second)))


def test_rewriting_repairs_damaged_objects(tmp_path: Path, capsys: Captured) -> None:
    recipe_of(tmp_path, ON_GRID)
    place = tmp_path / "edition"
    command = ("build", tmp_path / "recipe.toml", "--to", place, "--jobs", 1)
    assert run(*command) == 0
    edition = Edition(place)
    files = [path for path in place.rglob("*") if path.is_file() and path.parent.name != "index"]
    for path in files:
        if path.name not in ("edition.json", ".edition.json.lock"):
            path.write_bytes(path.read_bytes()[:-1] + b"!")
    assert run("verify", "--store", place) == 2
    assert "`brdfdb publish` or `brdfdb build --to`, with --rewrite, writes it again" in capsys.readouterr().err
    assert run(*command, "--rewrite") == 0
    assert run("verify", "--store", place) == 0
    assert Edition(place).families() == edition.families()
    assert [*Edition(place)] == [*edition]


def test_a_group_that_is_written_again_keeps_its_digest(tmp_path: Path) -> None:
    shard = next(shards_of(recipe_of(tmp_path, ON_GRID).orders()[1]))
    build_shard(str(tmp_path), "{}", *shard, "2026-01-01T00:00:00+00:00")
    before = {path: path.read_bytes() for path in (tmp_path / "groups").rglob("*") if path.is_file()}
    for path in before:
        path.write_bytes(b"damage")
    build_shard(str(tmp_path), "{}", *shard, "2027-01-01T00:00:00+00:00", rewrite=True)
    assert {path: path.read_bytes() for path in (tmp_path / "groups").rglob("*") if path.is_file()} == before


def test_the_command_names_the_edition_that_it_replaces(tmp_path: Path, capsys: Captured) -> None:
    recipe_of(tmp_path, ON_GRID)
    command = ("build", tmp_path / "recipe.toml", "--to", tmp_path / "edition", "--jobs", 1)
    for _ in range(2):
        assert run(*command) == 0
        assert "replaces" not in capsys.readouterr().out
    old = Edition(tmp_path / "edition").digest
    recipe_of(tmp_path, ON_GRID.replace('"foam", ', ""))
    assert run(*command) == 0
    assert capsys.readouterr().out.replace("\n", "").endswith(f"; it replaces an edition of 10 materials, sha256 {old}")
    (tmp_path / "edition" / "edition.json").write_bytes(b"{}")
    assert run(*command) == 0
    assert "; it replaces an edition that cannot be read" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (("--to", "STORE"), "destination: .*STORE is a store, or lies in one; name another directory"),
        (
            ("--to", "STORE/materials"),
            "destination: .*STORE/materials is a store, or lies in one; name another directory",
        ),
        (("--to", "NEW", "--memory", "1GB"), "--memory: cannot be combined with --to: a shard takes little memory"),
        (("--rewrite",), "--rewrite: is for editions, and --to is missing; a store repairs itself"),
    ],
)
def test_options_and_destinations_are_refused(
    more: tuple[str, ...], sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    make_store(Path("STORE"))
    recipe_of(tmp_path, ON_GRID)
    before = sorted(tmp_path.rglob("*"))
    assert re.fullmatch(sentence, refused(capsys, "build", "recipe.toml", *more))
    assert sorted(tmp_path.rglob("*")) == before


def test_a_store_and_an_edition_are_not_built_together(tmp_path: Path, capsys: Captured) -> None:
    with pytest.raises(SystemExit, match="2"):
        run("build", "--store", tmp_path / "store", "--to", tmp_path / "edition")
    assert "argument --to: not allowed with argument --store" in capsys.readouterr().err


def test_a_cluster_without_workers_is_said_and_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(edition_build, "_LOOK_S", 0.05)
    events: list[str] = []
    idle = threading.Event()

    def report(event: dict[str, Any]) -> None:
        events.append(event["event"])
        if event["event"] == "idle":
            idle.set()

    with ThreadPoolExecutor(1) as executor:
        executor.submit(idle.wait, 60.0)
        at = Workers(executor, lambda: int(idle.is_set()))
        build_edition(recipe_of(tmp_path, ON_GRID), tmp_path / "edition", at, report)
    assert events.count("idle") == 1


def test_a_task_that_runs_twice_writes_the_same(tmp_path: Path) -> None:
    shard = next(shards_of(recipe_of(tmp_path, ON_GRID).orders()[1]))
    written = []
    for _ in range(2):
        build_shard(str(tmp_path / "edition"), "{}", *shard, "2026-01-01T00:00:00+00:00")
        files = [path for path in (tmp_path / "edition").rglob("*") if path.is_file()]
        written.append({path: path.read_bytes() for path in files})
    assert written[0] == written[1]


def test_members_that_share_a_plan_keep_to_the_tolerance(tmp_path: Path) -> None:
    edition = built(recipe_of(tmp_path, TO_TOLERANCE), tmp_path / "edition")
    assert len(edition) == 9
    errors = [edition.metadata(name).error for name in edition]
    assert all(error is not None and error.overall.p99 <= 0.1 for error in errors)
    shared = [name for name in edition if "planned for" in str(edition.attributes(name)["reason"])]
    assert shared
    assert edition.attributes(shared[0])["request"]["shared_plan"] == 1
    assert edition.family_content("sheet")["members"] == [*edition]


SWEEPS = """\
[sweep.brushed]
title = "Brushed"
model = "ward"
source = "a test"
parameters = { rho_d = 0.1, rho_s = [0.2, 0.4], alpha_x = [0.1, 0.2, 0.3], alpha_y = 0.3 }
[sweep.moon]
title = "Moon"
model = "hapke"
source = "a test"
parameters = { w = { csv = "w.csv" }, b = 0.24, c = 0.6, b_0 = 1.0, h = [0.07, 0.1], theta_bar_deg = [10, 20] }
"""


def test_requests_survive_the_way_to_a_worker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "w.csv").write_text("wavelength_nm,value\n415,0.21\n689,0.5\n")
    head = 'materials = ["*"]\nwavelengths_nm = [500, 600]\n'
    to_tolerance = 'tolerance = 0.1\nhot_spot_tolerance = 0.2\nforms = "exact"\n'
    kinds = [isotropic(), isotropic(kind="spectral"), anisotropic()]
    for how in (to_tolerance, "".join(kinds)):
        recipe = recipe_of(tmp_path, head + how + SWEEP + SWEEPS)
        jobs = recipe.jobs()
        assert sum(job.family is not None for job in jobs) == 9 + 6 + 4
        shards = [shard for order in recipe.orders() for shard in shards_of(order)]
        with monkeypatch.context() as elsewhere:
            elsewhere.chdir("/")
            found = [job.request for shard in shards for job in shard.jobs()]
        assert found == json.loads(json.dumps([job.request for job in jobs]))


def test_a_family_that_was_measured_is_not_measured_again(tmp_path: Path) -> None:
    recipe = recipe_of(tmp_path, ON_GRID)
    first = built(recipe, tmp_path / "edition")
    states: list[str] = []
    second = built(recipe, tmp_path / "edition", lambda event: states.append(event.get("state", "")))
    assert "published" in states
    assert "measuring" not in states
    assert first.digest == second.digest


def test_names_of_many_tables_are_not_in_the_index(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (edition_build, publishing):
        monkeypatch.setattr(module, "FEW_NAMES", 5)
    edition = built(recipe_of(tmp_path, ON_GRID), tmp_path / "edition")
    assert all("names" not in group for group in edition.index["groups"])
    assert [*edition] == ["foam", *(f"sheet-{number:03d}" for number in range(1, 10))]


def test_a_worker_says_in_a_sentence_what_is_wrong_with_a_member(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def below_zero(*_: Any, **parameters: float) -> Any:
        return np.full(48, -1.0 if parameters["rho"] == 0.5 else 0.1)

    monkeypatch.setattr(Material, "lookup_vectors", lambda self, *_: below_zero(**self.parameters))
    recipe = recipe_of(tmp_path, ON_GRID.replace('"foam", ', ""))
    with threads(1) as at, pytest.raises(ParameterError, match=r"sheet-004: .* with rho = 0.5, .* gives -1 /sr at"):
        build_edition(recipe, tmp_path / "edition", at)


def test_a_shard_of_another_version_is_refused(tmp_path: Path) -> None:
    shard = Shard.of(recipe_of(tmp_path, ON_GRID).orders()[0])
    other = shard._replace(requests=shard.requests.replace('"model_version": 1', '"model_version": 7'))
    assert other != shard
    with pytest.raises(StoreError, match="another version of this program"):
        other.jobs()


def test_tables_without_a_model_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    (tmp_path / "dots.csv").write_text("theta_i,phi_i,theta_r,phi_r,brdf\n0,0,10,0,0.3\n")
    text = 'materials = ["dots"]\ntolerance = 0.1\n[define.dots]\nsamples = "dots.csv"\ntitle = "Dots"\nsource = "me"\n'
    with threads(1) as at, pytest.raises(RecipeError, match="dots has no model"):
        build_edition(recipe_of(tmp_path, text), tmp_path / "edition", at)
    assert not (tmp_path / "edition").exists()


def test_the_command_builds_an_edition(tmp_path: Path, capsys: Captured) -> None:
    recipe_of(tmp_path, ON_GRID)
    place = tmp_path / "edition"
    assert main(["build", str(tmp_path / "recipe.toml"), "--to", str(place), "--jobs", "2"]) == 0
    assert "10 tables in" in capsys.readouterr().out
    assert main(["verify", "--store", str(place)]) == 0
