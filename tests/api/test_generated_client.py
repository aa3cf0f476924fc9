"""A client that openapi-python-client generates from the document: every operation is called, each answer read."""

from __future__ import annotations

import importlib
import io
import json
import os
import shutil
import subprocess
import sys
import types
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb.audit import FINDINGS
from tests.api.a_store import npy, read_npy, serving
from tests.api.test_views import report

pytest.importorskip("openapi_python_client")

OPENAPI = Path(__file__).parents[2] / "api" / "openapi.json"
BYTES = ("application/x-npy", "application/x-npz", "application/zip", "image/png")
CONFIG = {"content_type_overrides": dict.fromkeys(BYTES, "application/octet-stream"), "post_hooks": []}
TILE = {"name": "white-tile"}
LIGHT = {"theta_i": 20.0, "theta_r": [10.0, 70.0]}
RHO = {"parameters": {"rho": 0.5}}
# Arguments of each operation, and the names of bodies; those of revisions have a revision beside them
CALLS: dict[str, dict[str, Any]] = {
    "healthz": {},
    "readyz": {},
    "metrics": {},
    "catalogue": {"limit": 2, "anisotropic": False, "sort": "-bytes"},
    "material": TILE,
    "lookup_point": {**TILE, "theta_i": 20.0, "theta_r": 70.0},
    "lookup_points": {**TILE, "PointsBody": LIGHT},
    "lookup_many": {"ManyBody": {"materials": ["white-tile", "grey-felt"], **LIGHT}},
    "albedo": TILE,
    "lobe": {**TILE, "view": "cut", "theta_i": 30.0},
    "export": {**TILE, "file_format": "csv", "resolution": 45.0},
    "audit": TILE,
    "sphere": {**TILE, "size": 16},
    "thumbnail": {**TILE, "size": 16},
    "download": TILE,
    "root": {},
    "manifest": {**TILE, "revision": "r000001"},
    "stored_file": {**TILE, "revision": "r000001", "file": "zarr.json"},
    "model_list": {},
    "model_document": {"model": "lambert"},
    "model_lookup": {"model": "lambert", "PointsAt": {**RHO, **LIGHT}},
    "model_lobe": {"model": "lambert", "Parameters": RHO},
    "model_albedo": {"model": "lambert", "Parameters": RHO},
    "model_sphere": {"model": "lambert", "size": 16, "Parameters": RHO},
    "family_list": {},
}
OPERATIONS = [
    (operation["tags"][0], operation["operationId"])
    for path in json.loads(OPENAPI.read_text(encoding="utf-8"))["paths"].values()
    for operation in path.values()
]


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Iterator[types.ModuleType]:
    """The package of the client."""
    folder = tmp_path_factory.mktemp("client")
    (folder / "config.json").write_text(json.dumps(CONFIG), encoding="utf-8")
    command = [sys.executable, "-m", "openapi_python_client", "generate", "--meta", "none", "--path", str(OPENAPI)]
    command += ["--config", str(folder / "config.json"), "--output-path", str(folder / "generated_client")]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=folder, env=os.environ.copy())
    assert "WARNING" not in done.stdout + done.stderr
    assert "Unable" not in done.stdout + done.stderr
    sys.path.insert(0, str(folder))
    yield importlib.import_module("generated_client")
    sys.path.remove(str(folder))


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory, root: Path) -> Iterator[str]:
    """Address of a service of a store with an audit."""
    own = Path(shutil.copytree(root, tmp_path_factory.mktemp("generated") / "store"))
    finding = report(own) | {"findings": {key: {"verdict": "not judged", "reason": "a test"} for key in FINDINGS}}
    audit = {"when": "2026-11-21T12:00:00Z", "materials": [finding]}
    (own / "audit.json").write_text(json.dumps(audit), encoding="utf-8")
    with serving(own) as address:
        yield address


def called(package: types.ModuleType, address: str, tag: str, name: str, arguments: dict[str, Any]) -> Any:
    """Answer of an operation of the generated client."""
    operation = importlib.import_module(f"{package.__name__}.api.{tag}.{name}")
    models = importlib.import_module(f"{package.__name__}.models")
    bodies = {key: value for key, value in arguments.items() if key[0].isupper()}
    given = {key: value for key, value in arguments.items() if key not in bodies}
    for kind, fields in bodies.items():
        given["body"] = getattr(models, kind).from_dict(fields)
    prefix = "".join(word.capitalize() for word in name.split("_"))
    for key in given.keys() & {"sort", "view", "file_format"}:
        given[key] = getattr(models, prefix + "".join(word.capitalize() for word in key.split("_")))(given[key])
    with package.Client(base_url=address) as client:
        return operation.sync_detailed(client=client, **given)


@pytest.mark.parametrize(("tag", "name"), OPERATIONS)
def test_every_operation_answers(generated: types.ModuleType, service: str, tag: str, name: str) -> None:
    if name == "family_lookup":  # the store has no family: the refusal is read, too
        body = {"parameters": {"sigma_deg": 3.0}, **LIGHT}
        answer = called(generated, service, tag, name, {"family": "none", "PointsOfFamily": body})
        assert (answer.status_code, answer.parsed.status) == (404, 404)
        assert answer.parsed.detail.startswith("no family 'none'")
        return
    arguments = CALLS[name.removesuffix("_of_revision")]
    answer = called(
        generated, service, tag, name, arguments | ({"revision": "r000001"} if name.endswith("_of_revision") else {})
    )
    assert answer.status_code == 200, answer.content
    assert answer.parsed is not None
    if not isinstance(answer.parsed, str | generated.types.File | bytes):
        back = answer.parsed.to_dict()
        assert back == {key: value for key, value in json.loads(answer.content).items() if key in back}


def test_numbers_arrive_and_may_be_npy_both_ways(generated: types.ModuleType, service: str) -> None:
    model = called(generated, service, "models", "model_lookup", CALLS["model_lookup"]).parsed
    np.testing.assert_allclose(model.brdf, 0.5 / np.pi, rtol=1e-15)
    many = called(generated, service, "lookup", "lookup_many", CALLS["lookup_many"]).parsed
    assert [each.material for each in many.materials] == ["white-tile", "grey-felt"]
    np.testing.assert_allclose(many.materials[0].brdf, 1.0 / np.pi, rtol=1e-6)
    zipped = called(generated, service, "files", "download", TILE).content
    assert "zarr.json" in zipfile.ZipFile(io.BytesIO(zipped)).namelist()
    operation = importlib.import_module("generated_client.api.lookup.lookup_points")
    models = importlib.import_module("generated_client.models")
    body, file_format = models.PointsBody.from_dict(LIGHT), models.LookupPointsFormatType0
    request = operation._get_kwargs("white-tile", body=body, format_=file_format.NPY)
    file = generated.types.File(payload=io.BytesIO(npy(np.full((3, 4), 10.0))))
    with generated.Client(base_url=service) as client:
        answer = client.get_httpx_client().request(**request)
    with generated.Client(base_url=service) as client:
        posted = operation.sync_detailed("white-tile", client=client, body=file, format_=file_format.JSON)
    np.testing.assert_allclose(read_npy(answer.content), [1.0 / np.pi] * 2, rtol=1e-6)
    np.testing.assert_allclose(posted.parsed.brdf, [1.0 / np.pi] * 3, rtol=1e-6)
