"""Stores for all tests of the HTTP layer, made once: a small one, and one to explore, its server and a browser."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from brdfdb.materials import presets
from brdfdb.measurements import MeasuredSource
from brdfdb.store.publication import publish as publish_source
from brdfdb.store.reader import Store
from brdfdb_pipelines import cli
from tests.api.a_store import TURNED, Client, client_of, publish, serving, serving_command
from tests.api.explored import AUDIT, RECIPE
from tests.measurements.made_up import scans


@pytest.fixture(scope="session")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Directory of a store with a white, a grey, an anisotropic and a spectral material, for reading only."""
    directory = tmp_path_factory.mktemp("api") / "store"
    publish(directory, "white-tile", "lambert", rho=1.0)
    publish(directory, "grey-felt", "oren_nayar", rho=0.5, sigma_deg=20.0, error=True)
    publish(directory, "brushed-metal", "ward", TURNED, rho_d=0.1, rho_s=0.3, alpha_x=0.3, alpha_y=0.6)
    publish(
        directory,
        *("copper-foil", "he_torrance"),
        refractive_index="main/Cu/Johnson",
        sigma_0_um=0.1,
        tau_um=2.0,
        error=True,
    )
    return directory


@pytest.fixture
def store(root: Path) -> Store:
    """The store as Python reads it: what the service must say, too."""
    return Store(root)


@pytest.fixture
def own(root: Path, tmp_path: Path) -> Path:
    """A copy of the store for a test that changes it."""
    return Path(shutil.copytree(root, tmp_path / "store"))


@pytest.fixture(scope="module")
def grey_store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Directory of a store with one material, `grey`, which the tests of a file may change."""
    directory = tmp_path_factory.mktemp("grey") / "store"
    publish(directory, "grey", "lambert", rho=0.25)
    return directory


@pytest.fixture(scope="session")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Directory of a store with a measured table, lights of 10 to 60 degrees, beside one of a model."""
    root = tmp_path_factory.mktemp("measured") / "store"
    clay = presets()["clay-vase"]
    samples = scans(clay.brdf_at(None), np.array([10.0, 35.0, 60.0]), 0.03, step_deg=15.0)
    source = MeasuredSource.of_samples(samples, name="my-clay", title="Clay", provenance="run 12")
    publish_source(root, source.recorded(file="clay.csv", file_sha256="0" * 64), tolerance=0.1)
    publish_source(root, clay, tolerance=0.3)
    return root


@pytest.fixture
def client(root: Path) -> Client:
    return client_of(root, max_points=1000, max_body_bytes=100_000)


@pytest.fixture(scope="session")
def explored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Directory of the store that the explorer shows."""
    root = tmp_path_factory.mktemp("explored")
    (root / "recipe.toml").write_text(RECIPE, encoding="utf-8")
    assert cli.main(["build", str(root / "recipe.toml"), "--store", str(root / "store"), "--jobs", "2"]) == 0
    (root / "store" / "audit.json").write_text(json.dumps(AUDIT), encoding="utf-8")
    return root / "store"


@pytest.fixture(scope="session")
def address(explored: Path) -> Iterator[str]:
    """Where `brdfdb serve` serves it."""
    with serving_command(explored) as (_, port):
        yield f"http://127.0.0.1:{port}/"


@pytest.fixture(autouse=True)
def _no_page_has_errors(request: pytest.FixtureRequest) -> Iterator[None]:
    """Fail a test that leaves a page with an error in the console of the browser."""
    yield
    if "chromium" in request.fixturenames:
        assert request.getfixturevalue("chromium").errors == []


@pytest.fixture
def plain(root: Path) -> Iterator[str]:
    """Where the store of the other tests is served: of its tables only two state an error."""
    with serving(root) as found:
        yield found
