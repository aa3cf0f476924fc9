"""Models of other people: a package with an entry point and a file, built, audited, charted and served as ours are."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brdfdb
from brdfdb import _numba
from brdfdb.errors import BrdfdbError, ParameterError
from brdfdb.forms import catalogue
from brdfdb.materials import Material
from brdfdb.models import MODELS
from brdfdb.models.registry import VARIABLE, Registry
from brdfdb.parameters import HeightRelation, ModelSpec, SurfaceAssumption
from tests.api.a_store import client_of
from tests.pipelines.command import run

PACKAGE = Path(__file__).parent / "rim_package"
FILE = PACKAGE / "rim_light.py"
FLOAT32 = 1e-6  # of a node
RECIPE = """
materials = ["peach"]
wavelengths_nm = [550]
[grids]
isotropic = { theta_i_deg = [0, 30, 60, 80], theta_r_deg = [0, 30, 60, 80], delta_phi_deg = [0, 60, 120, 180] }
spectral = { theta_i_deg = [0, 80], theta_r_deg = [0, 80], delta_phi_deg = [0, 180] }
anisotropic = { theta_i_deg = [0, 80], phi_i_deg = [0, 360], theta_r_deg = [0, 80], phi_r_deg = [0, 360] }
[define.peach]
title = "Peach"
model = "rim_light"
source = "made up"
parameters = { rho = 0.4, power = 2, rim = 0.5 }
"""
PARAMETERS = {"rho": 0.4, "power": 2.0, "rim": 0.5}


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store that another process built, with a worker process of its own; both were told of the file."""
    root = tmp_path_factory.mktemp("others")
    (root / "recipe.toml").write_text(RECIPE, encoding="utf-8")
    command = [sys.executable, "-c", "import sys; from brdfdb_pipelines import cli; sys.exit(cli.main())"]
    command += ["--models", str(FILE), "build", "recipe.toml", "--store", "store", "--processes", "--jobs", "1"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return root / "store"


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModelSpec]:
    """The model of the package, which Python finds as it finds what pip installs."""
    monkeypatch.syspath_prepend(str(PACKAGE))
    MODELS.add_packages()
    yield MODELS["rim_light"]
    del MODELS["rim_light"], sys.modules["rim_light"]


@pytest.fixture
def registry(monkeypatch: pytest.MonkeyPatch) -> Iterator[Registry]:
    """An empty registry; files that it loads are forgotten after the test."""
    monkeypatch.setenv(VARIABLE, "")
    before = set(sys.modules)
    yield Registry()
    for name in set(sys.modules) - before:
        if name.startswith("brdfdb_models_"):
            del sys.modules[name]


def test_a_table_of_their_model_has_its_values_and_those_that_a_hand_works_out(
    store: Path, installed: ModelSpec
) -> None:
    theta = np.deg2rad(60.0)  # 0.4 (1 + 2 / 16)
    by_hand = installed.evaluate(theta, 0.0, theta, 0.0, rho=0.4, power=2.0, rim=2.0)
    assert np.pi * by_hand == pytest.approx(0.45, rel=1e-8)
    table = brdfdb.open(store)["peach"]
    angles = np.deg2rad([30.0, 0.0, 60.0, 120.0])
    expected = installed.evaluate(*angles, **PARAMETERS)
    assert table.lookup(*angles) == pytest.approx(expected, rel=FLOAT32)


@pytest.mark.usefixtures("installed")
def test_their_model_is_audited(store: Path, tmp_path: Path) -> None:
    report = tmp_path / "audit.json"
    assert run("audit", "--no-figures", "--store", store, "--report", report) == 0
    (entry,) = json.loads(report.read_bytes())["materials"]
    assert (entry["model"], entry["verdict"]) == ("rim_light", "passes")
    judged = ("reciprocity", "nodes", "smoothness", "sampling")
    assert {entry["findings"][finding]["verdict"] for finding in judged} == {"passes"}
    assert entry["findings"]["validity"]["limits"] == []


def test_their_model_is_served(store: Path, installed: ModelSpec) -> None:
    client = client_of(store)
    asked = {"theta_i": 37.0, "phi_i": 0.0, "theta_r": 51.0, "phi_r": 100.0, "from": "model"}
    answer = client.get("/v1/materials/peach/lookup", params=asked)
    assert answer.status_code == 200, answer.text
    values = installed.evaluate(*np.deg2rad([37.0, 0.0, 51.0, 100.0]), **PARAMETERS)
    np.testing.assert_allclose(np.ravel(answer.json()["brdf"]), values, rtol=1e-12)


def test_their_model_is_charted_by_itself(installed: ModelSpec) -> None:
    material = Material(name="peach", title="Peach", model="rim_light", parameters=PARAMETERS, source="made up")
    exact, single = catalogue.forms(material, None, ())
    assert (exact.title, exact.python) == (f"{installed.title}, {installed.equation}", "models.rim_light")
    assert single.dtype is np.float32


def test_a_process_without_the_model_says_so(store: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ParameterError, match=r"^model: 'rim_light' is not one of lambert, "):
        MODELS["rim_light"]
    assert run("list", "--store", store) == 0
    assert "peach" in capsys.readouterr().out


def test_a_file_is_added_once_and_named_to_processes_that_come_later(registry: Registry) -> None:
    registry.add_files([FILE, FILE])
    assert list(registry) == ["rim_light"]
    assert os.environ[VARIABLE] == str(FILE)
    registry.add_environment()
    assert list(registry) == ["rim_light"]


LAMBERT = "from brdfdb.models.lambert import lambert\n"
CLASH = f"from dataclasses import replace\n{LAMBERT}MINE = replace(lambert.spec, version=9)\n"
ARGUMENT = """
from brdfdb.models.declaration import DeclaredModel
@DeclaredModel(title="", equation="", references="none", parameters=())
def mine(cos_i, depth): return depth
"""


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        pytest.param(None, "no such file of models", id="missing"),
        pytest.param("raise RuntimeError('boo\\nhoo')", "RuntimeError: boo", id="raises"),
        pytest.param("x = (", r"SyntaxError: .*", id="syntax"),
        pytest.param("import sys; sys.exit(0)", "SystemExit: 0", id="ends"),
        pytest.param(LAMBERT, r"it declares no model, .*ModelSpec", id="none"),
        pytest.param(ARGUMENT, r"TypeError: mine: its arguments depth are not its parameters none; .*", id="argument"),
        pytest.param(CLASH, "the name 'lambert' is that of another model; choose another name", id="clash"),
    ],
)
def test_a_file_that_is_wrong_is_refused_in_a_sentence(
    registry: Registry, tmp_path: Path, text: str | None, sentence: str
) -> None:
    registry.update(MODELS)
    file = tmp_path / "mine.py"
    if text is not None:
        file.write_text(text, encoding="utf-8")
    for _ in range(2):  # it is no better the second time
        with pytest.raises(BrdfdbError, match=rf"^{file}: {sentence}$"):
            registry.add_files([file])
    assert registry == dict(MODELS)
    assert os.environ[VARIABLE] == ""


@pytest.mark.skipif(_numba.INTERPRETED, reason="Python runs the formula, and names the fault itself")
def test_a_formula_that_cannot_be_compiled_is_refused_in_a_sentence(registry: Registry, tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text(ARGUMENT.replace("mine(cos_i, depth): return depth", "mine(cos_i): return cos_beta"))
    registry.add_files([file])
    sentence = "^mine: the formula cannot be compiled: NameError: name 'cos_beta' is not defined$"
    for evaluate in (registry["mine"].evaluate, registry["mine"].vectors):
        with pytest.raises(ParameterError, match=sentence):
            evaluate(*([0.0] * 4 if evaluate is registry["mine"].evaluate else [[0.0, 0.0, 1.0]] * 2))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *[("evaluate", 3), ("vectors", None), ("lobe", "wide"), ("specular", 0.5), ("grazing_power", -1.0)],
        *[("version", 0), ("parameters", ["rho"]), ("name", "my model"), ("name", ["a"])],
        ("heights", "rough"),
    ],
)
def test_a_model_with_a_wrong_field_is_refused(registry: Registry, field: str, value: Any) -> None:
    of_model = "" if field == "name" else "lambert: "
    with pytest.raises(BrdfdbError, match=rf"^mine\.py: {of_model}{field}: {re.escape(repr(value))} is not "):
        registry.add([replace(MODELS["lambert"], **{field: value})], "mine.py")
    assert not registry


def test_an_assumption_that_no_height_map_judges_is_refused(registry: Registry) -> None:
    relation = HeightRelation(assumptions=(SurfaceAssumption("wet", "The surface is wet.", "a notebook"),))  # type: ignore[arg-type]
    with pytest.raises(BrdfdbError, match=r"^mine\.py: lambert: heights: 'wet' is not one of Gaussian heights, "):
        registry.add([replace(MODELS["lambert"], heights=relation)], "mine.py")


def test_an_entry_point_that_gives_no_model_is_refused(
    registry: Registry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    about = tmp_path / "bad-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: bad\nVersion: 1.0\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    for value, sentence in (
        ("json:JSONEncoder", r"TypeError: .*"),
        ("json:__all__", r"'dump' is not a declared model .*ModelSpec"),
        ("nowhere:SPEC", r"ModuleNotFoundError: No module named 'nowhere'"),
    ):
        (about / "entry_points.txt").write_text(f"[brdfdb.models]\nbad = {value}\n", encoding="utf-8")
        with pytest.raises(BrdfdbError, match=rf"^entry point bad = {value}: {sentence}$"):
            registry.add_packages()
    assert not registry


def test_the_command_line_takes_files_before_and_after_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for arguments in (("--models", tmp_path / "a.py", "list"), ("list", "--models", tmp_path / "a.py")):
        assert run(*arguments) == 2
        assert capsys.readouterr().err == f"brdfdb: {tmp_path / 'a.py'}: no such file of models\n"


def test_a_file_that_splits_its_path_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BrdfdbError, match="separates paths"):
        Registry().add_files([tmp_path / "a:b.py"])
