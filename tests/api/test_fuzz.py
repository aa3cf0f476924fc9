"""Requests that schemathesis makes up from the whole OpenAPI document: answers are as it says, none is a 5xx."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

pytest.importorskip("schemathesis")

import schemathesis
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from tests.api.test_hostile import WAIT_S, Server, running

# Requests to each address. `BRDFDB_REQUESTS=45 pytest tests/api/test_fuzz.py` searches for long, also under /revisions
REQUESTS = int(os.environ.get("BRDFDB_REQUESTS", "8"))
SCHEMA = schemathesis.openapi.from_path(Path(__file__).parents[2] / "api" / "openapi.json")
if "BRDFDB_REQUESTS" not in os.environ:  # those of a revision share the functions of the current one
    SCHEMA = SCHEMA.exclude(path_regex="/revisions/")
CHECKS = [not_a_server_error, status_code_conformance, content_type_conformance, response_schema_conformance]


@schemathesis.serializer("application/x-npy")
def as_it_is(_: object, value: object) -> bytes:
    """Bytes made up for a .npy body."""
    return value if isinstance(value, bytes) else str(value).encode()


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with running(tmp_path_factory.mktemp("fuzz")) as found:
        yield found


@SCHEMA.parametrize()
@settings(
    max_examples=REQUESTS,
    deadline=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
    phases=[Phase.explicit, Phase.generate],
)
def test_answers_are_as_documented_whatever_is_asked(case: schemathesis.Case, server: Server) -> None:
    for known in (False, True):  # names as they come, then a material that is there
        if known:
            case.path_parameters.update({"name": "white"} if "name" in case.path_parameters else {})
            case.path_parameters.update({"revision": "r000001"} if "revision" in case.path_parameters else {})
        answer = case.call(base_url=f"http://127.0.0.1:{server.port}", timeout=WAIT_S)
        case.validate_response(answer, checks=CHECKS)
        if answer.status_code >= 400:
            assert answer.headers["content-type"] == ["application/problem+json"]
            problem = json.loads(answer.content)
            assert problem["status"] == answer.status_code
            assert problem["detail"]
            assert "\n" not in problem["detail"]
