"""The lowest versions of the extra `serve`: installed in a folder of their own, they serve what the present ones do."""

from __future__ import annotations

import importlib.metadata
import os
import tomllib
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from packaging.requirements import Requirement
from packaging.version import Version

from tests.api.a_store import client_of, serving_command
from tests.api.connections import WAIT_S

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
FOLDER = os.environ.get("BRDFDB_LOWEST", "")
pytestmark = pytest.mark.skipif(
    not Path(FOLDER, "fastapi").is_dir(), reason="BRDFDB_LOWEST names no folder with the lowest versions of `serve`"
)
FOIL = "/v1/materials/copper-foil"
LIGHT = {"theta_i": 20.0, "theta_r": [10.0, 70.0]}
RHO = {"parameters": {"rho": 0.5}}
ASKED = [
    *("/", "/explorer/explorer.js", "/docs", "/healthz", "/v1/models/ward", "/v1/families", "/v1/store/zarr.json"),
    *(FOIL, "/v1/materials?sort=-bytes&limit=2&wavelength_nm=500&anisotropic=false", f"{FOIL}/revisions/r000001"),
    *(f"{FOIL}/lookup?theta_i=1&theta_r=2&{more}" for more in ("error=true", "from=model", "output=xyz&format=npy")),
    *(f"{FOIL}/{view}" for view in ("albedo", "lobe", "lobe?view=hemisphere&from=model", "sphere?size=16")),
    *(f"{FOIL}/thumbnail.png?size=16", "/v1/store/materials/copper-foil/r000001/brdf/c/0/0/0/0"),
    *(f"{FOIL}/lookup?theta_i=1&thetar=2", f"{FOIL}/lobe?view=all", "/v1/materials/copper-foul", f"{FOIL}/audit"),
]
POSTED = {
    f"{FOIL}/lookup?from=model": LIGHT,
    f"{FOIL}/revisions/r000001/lookup": LIGHT,
    "/v1/lookup": {"materials": ["white-tile", "grey-felt"], **LIGHT},
    **{f"/v1/models/lambert/{view}": RHO for view in ("lobe", "albedo", "sphere?size=16")},
    "/v1/models/lambert/lookup": RHO | LIGHT,
    "/v1/models/ward/lobe": RHO,
}


@pytest.fixture(scope="module")
def address(root: Path) -> Iterator[str]:
    """Address of `brdfdb serve` with the lowest versions."""
    path = os.pathsep.join([FOLDER, *filter(None, [os.environ.get("PYTHONPATH", "")])])
    with serving_command(root, PYTHONPATH=path) as (_, port):
        yield f"http://127.0.0.1:{port}"


def test_the_folder_holds_what_the_project_states() -> None:
    lines = [*PROJECT["optional-dependencies"]["serve"], *PROJECT["dependencies"]]
    lowest = {
        requirement.name: specifier.version
        for requirement in map(Requirement, lines)
        for specifier in requirement.specifier
        if specifier.operator == ">="
    }
    installed = {
        one.name.lower().replace("_", "-"): one.version for one in importlib.metadata.distributions(path=[FOLDER])
    }
    named = [Requirement(line).name for line in PROJECT["optional-dependencies"]["serve"]]
    for name in (*named, "pydantic"):
        assert Version(installed[name.lower()]) == Version(lowest[name]), name


def test_an_address_answers_as_with_the_present_versions(address: str, root: Path) -> None:
    for path in ASKED:
        present = client_of(root).get(path)
        answer = httpx.get(f"{address}{path}", timeout=WAIT_S)
        assert (answer.status_code, answer.headers["content-type"]) == (
            present.status_code,
            present.headers["content-type"],
        )
        assert answer.content == present.content


def test_a_body_is_answered_as_with_the_present_versions(address: str, root: Path) -> None:
    for path in POSTED:
        present = client_of(root).post(path, json=POSTED[path])
        answer = httpx.post(f"{address}{path}", json=POSTED[path], timeout=WAIT_S)
        assert (answer.status_code, answer.content) == (present.status_code, present.content)
