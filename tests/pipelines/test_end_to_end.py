"""Tables of a recipe are built and audited, and Python and a server look them up."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

import brdfdb
from tests.pipelines.a_build import changed
from tests.pipelines.command import Captured, refused, run

SAME = 1e-12  # HTTP writes what the library returns, digit by digit
ANGLES_DEG = (37.0, 12.0, 51.0, 200.5)
START_SECONDS = 300.0  # time limit; it takes two seconds on an idle machine


@pytest.fixture(params=["foam", "rolled-brass", "scene-copper-sphere", "blue-plastic", "mirror"])
def name(request: pytest.FixtureRequest) -> str:
    """Each material of the recipe."""
    return str(request.param)


def looked_up(root: Path, name: str, wavelength_nm: float | None = None) -> Any:
    return brdfdb.open(root)[name].lookup(*np.deg2rad(ANGLES_DEG), wavelength_nm)


def test_the_recipe_has_one_material_of_every_kind(built: Path, names: list[str]) -> None:
    store = brdfdb.open(built)
    tables = [store[name] for name in names]
    assert [table.anisotropic for table in tables] == [False, True, False, False, False]
    wavelengths = [table.wavelength_nm for table in tables]
    assert [None if array is None else array.size for array in wavelengths] == [None, None, 16, 1, 16]
    assert [table.specular is not None for table in tables] == [False, False, True, True, True]


def test_every_table_is_audited(built: Path, names: list[str], tmp_path: Path) -> None:
    report = tmp_path / "audit.json"
    code = run("audit", "--no-figures", "--store", built, "--report", report)
    entries = {entry["material"]: entry for entry in json.loads(report.read_bytes())["materials"]}
    assert sorted(entries) == sorted(names)
    for entry in entries.values():
        reciprocity, values = entry["findings"]["reciprocity"], entry["findings"]["values"]
        assert reciprocity["verdict"] == values["positivity"] == values["finiteness"] == "passes"
    # grids this coarse smear the lobes of the others past 1: what is stored is what is audited
    assert {entries[name]["verdict"] for name in ("foam", "mirror")} == {"passes"}
    assert code == int(any(entry["verdict"] == "violates" for entry in entries.values()))
    mirror = np.array(entries["mirror"]["findings"]["energy"]["table"]["albedo"])
    np.testing.assert_array_equal(mirror, entries["mirror"]["findings"]["energy"]["table"]["specular"])
    assert 0.3 < mirror.min() < mirror.max() <= 1.0


QUERY = dict(zip(("theta_i", "phi_i", "theta_r", "phi_r"), ANGLES_DEG, strict=True))


@pytest.fixture(scope="module")
def store(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the store, which is served and gets a new revision."""
    return Path(shutil.copytree(built, tmp_path_factory.mktemp("served") / "store"))


@pytest.fixture(scope="module")
def served(store: Path) -> Iterator[httpx.Client]:
    """A client of `brdfdb serve` in a process of its own."""
    command = [sys.executable, "-m", "brdfdb_pipelines.cli", "serve", "--store", str(store), "--port", "0"]
    environment = {key: value for key, value in os.environ.items() if not key.startswith("BRDFDB_")}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=environment)
    assert process.stdout is not None
    line = process.stdout.readline().decode()
    url = re.search(r"http://[^/\s]+", line)  # where it listens already
    assert url, line
    with httpx.Client(base_url=url[0], trust_env=False, timeout=START_SECONDS) as client:
        assert client.get("/healthz").status_code == 200
        yield client
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=START_SECONDS)
    assert process.returncode == 0, output.decode()
    assert b"Traceback" not in output


def test_the_server_answers_as_the_library_does(name: str, built: Path, served: httpx.Client) -> None:
    answer = served.get(f"/v1/materials/{name}/lookup", params=QUERY).json()
    assert (answer["material"], answer["revision"], answer["unit"]) == (name, "r000001", "1/sr")
    assert answer["brdf"] == pytest.approx(looked_up(built, name), rel=SAME)
    specular = brdfdb.open(built)[name].specular_reflectance(np.deg2rad(ANGLES_DEG[0]))
    assert answer["specular_reflectance"] == pytest.approx(specular, rel=SAME)
    posted = served.post(f"/v1/materials/{name}/lookup", json={**QUERY, "wavelength_nm": 460.0})
    assert posted.json()["brdf"] == pytest.approx(looked_up(built, name, 460.0), rel=SAME)


def test_the_server_serves_a_new_revision_as_soon_as_it_is_published(
    served: httpx.Client, store: Path, recipe: Path, tmp_path: Path
) -> None:
    assert served.get("/v1/materials/foam/lookup", params=QUERY).json()["revision"] == "r000001"
    assert run("build", changed(recipe, tmp_path / "changed.toml"), "--store", store) == 0
    assert served.get("/v1/materials/foam/lookup", params=QUERY).json()["revision"] == "r000002"


def test_the_server_tells_what_is_wrong(served: httpx.Client) -> None:
    unknown = served.get("/v1/materials/fome/lookup", params=QUERY)
    assert (unknown.status_code, unknown.json()["closest"]) == (404, ["foam"])
    bad = served.get("/v1/materials/foam/lookup", params={**QUERY, "theta_i": 181})
    assert (bad.status_code, bad.json()["parameter"]) == (422, "theta_i")
    below = served.get("/v1/materials/foam/lookup", params={**QUERY, "theta_r": 91})
    assert (below.status_code, below.json()["brdf"]) == (200, 0.0)


def test_a_port_that_is_taken_is_one_sentence(
    served: httpx.Client, built: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BRDFDB_STORE", "put back afterwards")
    port = served.base_url.port
    said = f"cannot listen on 127.0.0.1, port {port}: Address already in use"
    assert refused(capsys, "serve", "--store", built, "--port", port) == said
