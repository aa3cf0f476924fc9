"""Families from a recipe to a store: built, measured, resumed, shown, looked up, verified."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import brdfdb
from brdfdb.audit.record import differences
from brdfdb.errors import StoreError, UnknownFamilyError
from brdfdb.store import family_records
from brdfdb.store.family import Sweep
from brdfdb.store.files import write_sealed
from brdfdb_pipelines import cli, terminal
from brdfdb_pipelines.build import build
from brdfdb_pipelines.recipe_file import load
from tests.benchmarks.forged_stores import changed, leaves
from tests.pipelines.a_build import OneByOne, failing
from tests.pipelines.recipes import COARSE, material

SCHEMA = Path(__file__).parent.parent.parent / "schemas" / "family.schema.json"
COPPER = 'materials = ["rough-copper"]\nwavelengths_nm = [450, 550, 650]\ntolerance = 0.2\n' + material(
    "rough-copper", "Rough copper", "he_torrance", "sigma_0_um = [0.1, 0.12]", "tau_um = [1, 1.2]", table="sweep"
)
SIGMA = "sigma_deg = [{ start = 0, stop = 30, step = 10 }]"
GREY = (
    'materials = ["grey", "foam"]\nwavelengths_nm = [500]\n'
    + COARSE
    + material("grey", "Rough grey", "oren_nayar", "rho = 0.5", SIGMA, table="sweep")
)

Captured = pytest.CaptureFixture[str]
Event = dict[str, Any]


@pytest.fixture(scope="module", autouse=True)
def fewer_points() -> Iterator[None]:
    """Measure at a quarter of the points: it is fast, and what is tested here does not hang on it."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(family_records, "POINTS", 64)
        yield


@pytest.fixture(scope="module")
def copper(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with a family of He-Torrance's over two parameters, at three wavelengths; tests must not change it."""
    root = tmp_path_factory.mktemp("copper")
    recipe = root / "recipe.toml"
    recipe.write_text(COPPER, encoding="utf-8")
    assert cli.main(["build", str(recipe), "--store", str(root / "store"), "--jobs", "2"]) == 0
    return root / "store"


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with a grey family of four members, and foam; tests must not change it."""
    root = tmp_path_factory.mktemp("grey")
    assert "published" in [event.get("state") for event in built(root / "store", GREY)]
    return root / "store"


@pytest.fixture
def grey(first: Path, tmp_path: Path) -> Path:
    """A copy of that store."""
    shutil.copytree(first, tmp_path / "store")
    return tmp_path / "store"


def built(root: Path, text: str) -> list[Event]:
    """The events of a build of a recipe."""
    recipe = root.with_name("recipe.toml")
    recipe.write_text(text, encoding="utf-8")
    events: list[Event] = []
    with ThreadPoolExecutor(2) as executor:
        build(load(recipe), root, executor, events.append)
    return events


def of_family(events: list[Event]) -> list[str]:
    return [event["state"] for event in events if event["event"] == "family"]


def tree(root: Path) -> dict[str, tuple[bytes, int]]:
    files = (path for path in root.rglob("*") if path.is_file() and path.name != "lock")
    return {str(path): (path.read_bytes(), path.stat().st_mtime_ns) for path in files}


def run(root: Path, *arguments: object) -> int:
    return cli.main([*map(str, arguments), "--store", str(root)])


# He-Torrance, to a tolerance


def test_the_record_says_what_the_family_is(copper: Path) -> None:
    store = brdfdb.open(copper)
    assert store.families() == ["rough-copper"]
    content = json.loads((copper / "families" / "rough-copper.json").read_text(encoding="utf-8"))
    jsonschema.validate(content, json.loads(SCHEMA.read_text(encoding="utf-8")))
    assert content["axes"] == {"sigma_0_um": [0.1, 0.12], "tau_um": [1.0, 1.2]}
    assert content["members"] == list(store) == [f"rough-copper-{number:03d}" for number in range(1, 5)]
    assert content["request_sha256"] == [store.summary(name)["request_sha256"] for name in store]
    last = store.metadata("rough-copper-003")
    assert last.title == "Rough copper, sigma_0_um 0.12, tau_um 1"
    assert last.request["family"] == {"name": "rough-copper", "parameters": {"sigma_0_um": 0.12, "tau_um": 1.0}}
    assert store["rough-copper-003"].error is not None


def test_a_family_is_listed_shown_and_looked_up(copper: Path, capsys: Captured) -> None:
    assert run(copper, "list") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].strip() == f"4 materials in {copper}"
    assert lines[7].strip() == "1 family"
    assert lines[9].split()[:5] == ["rough-copper", "Rough", "copper", "he_torrance", "4"]
    family = brdfdb.open(copper).family("rough-copper")
    p99 = family.error.overall.p99
    assert run(copper, "show", "rough-copper") == 0
    out = capsys.readouterr().out
    assert "  tables      4, rough-copper-001 to rough-copper-004\n" in out
    assert "    sigma_0_um      2 values, 0.1 to 0.12\n" in out
    assert f"  error       {terminal.error(p99)} of f_r relative to the model, at 99 % of " in out
    assert f"{terminal.error(max(family.error.p99[-1])).replace(' %', '%'):>9}\n" in out
    assert f"  worst       {terminal.error(family.record.worst.p99)} at sigma_0_um " in out
    assert "  specular    within " in out
    asked = ("lookup", "rough-copper", 30, 0, 40, 170, "--set", "sigma_0_um=0.104", "--set", "tau_um=1.05")
    assert run(copper, *asked) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[:2] for line in lines] == [["450", "nm"], ["550", "nm"], ["650", "nm"]]
    assert all(line.endswith(" of the light in the exact mirror direction") for line in lines)
    assert run(copper, *asked, "--wavelength-nm", 500, "--json", "--with-error") == 0
    answer = json.loads(capsys.readouterr().out)
    angles = np.deg2rad([30.0, 0.0, 40.0, 170.0])
    stated = family.lookup_with_error(*angles, [500.0], sigma_0_um=0.104, tau_um=1.05)
    assert (answer["brdf"], answer["error"]) == (stated.brdf.tolist(), stated.error.tolist())
    specular = family.specular_reflectance(angles[0], [500.0], sigma_0_um=0.104, tau_um=1.05)
    assert answer["specular_reflectance"] == specular.tolist()
    assert answer["parameters"] == {"sigma_0_um": 0.104, "tau_um": 1.05}


# Builds


def test_an_unchanged_recipe_writes_nothing(grey: Path) -> None:
    before = tree(grey)
    events = built(grey, GREY)
    assert of_family(events) == ["unchanged"]
    assert events[-1]["unchanged"] == 5
    assert tree(grey) == before


def test_a_family_is_measured_once_its_members_are_there(first: Path, tmp_path: Path) -> None:
    events = built(tmp_path / "store", GREY)
    names = [(event["event"], event.get("state")) for event in events]
    assert names[-3:] == [("family", "measuring"), ("family", "published"), ("done", None)]
    record = brdfdb.open(first).family("grey").record
    assert events[-2] == {
        "event": "family",
        "family": "grey",
        "state": "published",
        "members": 4,
        "error_p99": record.error.overall.p99,
    }
    assert brdfdb.open(tmp_path / "store").family("grey").record == record
    assert list((tmp_path / "store" / ".staging").iterdir()) == []


class Killed(BaseException):
    """What ends a process."""


@pytest.mark.parametrize("last", ["measure", "write_sealed", "sync_path"])
def test_a_build_that_was_killed_before_the_record_goes_on_there(
    last: str, first: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def kill(*_: object) -> None:
        raise Killed

    root = tmp_path / "store"
    with monkeypatch.context() as patched:
        patched.setattr(f"brdfdb.store.family_records.{last}", kill)
        with pytest.raises(Killed):
            built(root, GREY)
    members = tree(root / "materials")
    events = built(root, GREY)
    assert of_family(events) == (["unchanged"] if last == "sync_path" else ["measuring", "published"])
    assert events[-1]["unchanged"] == 5
    assert tree(root / "materials") == members
    assert brdfdb.open(root).family("grey").record == brdfdb.open(first).family("grey").record


@pytest.mark.usefixtures("no_plots")
def test_every_leaf_of_a_family_that_is_forged_is_noticed(grey: Path, capsys: Captured) -> None:
    root = grey
    path = root / "families" / "grey.json"
    record = brdfdb.open(root).family_content("grey")
    measured = family_records.measure(Sweep(**{name: record[name] for name in Sweep.model_fields}), brdfdb.open(root))
    assert [*differences(record, measured.model_dump(mode="json"), "", measured=True)] == []
    unnoticed = []
    for leaf in leaves(record):
        forged = changed(record, leaf)
        write_sealed(path, forged)
        try:
            family_records.verify_family(root, "grey")
        except StoreError:
            continue
        if not [*differences(forged, measured.model_dump(mode="json"), "", measured=True)]:
            unnoticed.append(leaf)
    assert unnoticed == []
    write_sealed(path, changed(record, ("error", "p99", 3, 0)))
    arguments = ["audit", "--no-figures", "--jobs", "1", "--store", str(root)]
    assert cli.main(arguments) == 1
    assert "family grey: error.p99.3.0 is " in capsys.readouterr().out
    write_sealed(path, record)
    assert cli.main(arguments) == 0
    said = f"family grey: all {len(leaves(record))} numbers and words of its record agree with a new measurement"
    assert said in capsys.readouterr().out


def test_a_changed_sweep_makes_the_record_anew(grey: Path) -> None:
    before = brdfdb.open(grey).family("grey").record
    events = built(grey, GREY.replace("step = 10", "step = 15"))
    assert of_family(events) == ["measuring", "published"]
    record = brdfdb.open(grey).family("grey").record
    assert (before.axes, record.axes) == ({"sigma_deg": [0.0, 10.0, 20.0, 30.0]}, {"sigma_deg": [0.0, 15.0, 30.0]})
    assert record.error.overall.p99 != before.error.overall.p99
    assert of_family(built(grey, GREY.replace("Rough grey", "Grey"))) == ["measuring", "published"]


def test_a_family_some_of_whose_members_are_asked_for_is_not_measured(tmp_path: Path) -> None:
    events = built(tmp_path / "store", GREY.replace('["grey", "foam"]', '["grey-00[12]"]'))
    assert of_family(events) == []
    store = brdfdb.open(tmp_path / "store")
    assert list(store) == ["grey-001", "grey-002"]
    assert store.families() == []
    with pytest.raises(UnknownFamilyError, match=r"^no family 'grey' in the store$"):
        store.family("grey")


def test_a_family_with_a_member_that_failed_is_not_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    failing(monkeypatch, "grey-003", RuntimeError("no idea"))
    with pytest.raises(RuntimeError, match=r"^no idea$"):
        built(tmp_path / "store", GREY)
    assert brdfdb.open(tmp_path / "store").families() == []


def test_a_record_that_is_damaged_is_made_anew(grey: Path) -> None:
    path = grey / "families" / "grey.json"
    whole = path.read_bytes()
    path.write_bytes(whole[:100])
    assert of_family(built(grey, GREY)) == ["measuring", "published"]
    assert path.read_bytes() == whole


def test_a_family_is_told_on_the_terminal(grey: Path, tmp_path: Path, capsys: Captured) -> None:
    (grey / "families" / "grey.json").unlink()
    recipe = tmp_path / "recipe.toml"
    recipe.write_text(GREY, encoding="utf-8")
    assert run(grey, "build", recipe) == 0
    p99 = terminal.error(brdfdb.open(grey).family("grey").error.overall.p99)
    assert f"family grey: 4 tables, error at parameters between them {p99} (p99)" in capsys.readouterr().err
    assert run(grey, "build", recipe, "--json") == 0
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert of_family(events) == ["unchanged"]


def test_it_is_measured_on_workers(grey: Path, tmp_path: Path) -> None:
    (grey / "families" / "grey.json").unlink()
    recipe = tmp_path / "recipe.toml"
    recipe.write_text(GREY, encoding="utf-8")
    executor = OneByOne()
    build(load(recipe), grey, executor)
    assert executor.submitted[-1][0] == "write_family"


# Verify, gc, mistakes


def test_verify_looks_at_families_too(grey: Path, capsys: Captured) -> None:
    assert run(grey, "verify") == 0
    out, _ = capsys.readouterr()
    assert out.startswith("5 materials and 1 family verified, ")
    assert run(grey, "verify", "grey") == 0
    assert capsys.readouterr().out.startswith("0 materials and 1 family verified, ")
    built(grey, GREY.replace('["grey", "foam"]', '["grey-002"]').replace("rho = 0.5", "rho = 0.6"))
    assert run(grey, "verify") == 2
    why = "grey-002 was rebuilt since the error of the family was measured; build its recipe again"
    said = f"the family grey is out of date: {why}"
    assert f"brdfdb: {said}; `brdfdb build` with its recipe repairs it" in capsys.readouterr().err.splitlines()
    assert run(grey, "lookup", "grey", 0, 0, 0, 0, "--set", "sigma_deg=5") == 2
    assert capsys.readouterr().err.startswith(f"brdfdb: {said}")
    shutil.rmtree(grey / "materials" / "grey-001")
    assert run(grey, "verify", "grey") == 2
    assert "the family grey is out of date: the store has no grey-001" in capsys.readouterr().err
    (grey / "families" / "grey.json").write_text("{}", encoding="utf-8")
    assert run(grey, "verify", "grey") == 2
    assert "the family grey is damaged: the first line of grey.json is not its digest; " in capsys.readouterr().err


def test_gc_leaves_families_alone_and_takes_what_a_crash_left(grey: Path, capsys: Captured) -> None:
    half = grey / ".staging" / "grey" / ".grey.json.0123"
    half.parent.mkdir()
    half.write_text("{", encoding="utf-8")
    assert run(grey, "gc") == 0
    assert "removed .staging/grey/.grey.json.0123" in capsys.readouterr().out
    assert brdfdb.open(grey).families() == ["grey"]
    assert run(grey, "verify") == 0


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ([], "--set: sigma_deg "),
        (["sigma_deg=31"], "--set sigma_deg=31: "),
        (["sigma_deg"], "--set sigma_deg: give a number, "),
        (["sigma_deg=x"], "--set sigma_deg=x: give a number, "),
        (["rho=0.1"], "--set rho=0.1: the parameters of grey are sigma_deg"),
    ],
)
def test_other_parameters_are_refused(settings: list[str], said: str, first: Path, capsys: Captured) -> None:
    options = [part for setting in settings for part in ("--set", setting)]
    assert run(first, "lookup", "grey", 0, 0, 0, 0, *options) == 2
    assert capsys.readouterr().err.startswith(f"brdfdb: {said}")


def test_parameters_of_a_material_are_fixed_and_degrees_are_degrees(first: Path, capsys: Captured) -> None:
    assert run(first, "lookup", "foam", 0, 0, 0, 0, "--set", "rho=0.1") == 2
    assert capsys.readouterr().err.startswith("brdfdb: --set rho=0.1: foam is a material")
    assert run(first, "lookup", "gray", 0, 0, 0, 0) == 2
    assert capsys.readouterr().err.startswith("brdfdb: no material 'gray' in the store; closest: ")
    assert run(first, "lookup", "grey", 30, 0, 40, 90, "--set", "sigma_deg=20", "--json") == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["brdf"] == [brdfdb.open(first)["grey-003"].lookup(*np.deg2rad([30.0, 0.0, 40.0, 90.0]))]
