"""Errors of the HTTP layer: the one table from exceptions to statuses, and application/problem+json (RFC 9457)."""

from __future__ import annotations

import contextlib
import errno
from collections.abc import Iterator, Mapping, Sequence
from http import HTTPStatus
from pathlib import Path
from typing import Any

import orjson
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Match

from brdfdb import errors

PROBLEM_JSON = "application/problem+json"

BUSY_S = 1  # time until a busy service may answer [s]
DAMAGED_S = 60  # time until somebody may have repaired a store [s]

# Phrases of RFC 9110; those of http.HTTPStatus differ between versions of Python
_TITLES = {413: "Content Too Large", 422: "Unprocessable Content"}


class RequestError(errors.BrdfdbError):
    """A refused request: its status, the sentence `detail` and the wrong parameter.

    `headers` of the answer have ``_`` in place of ``-``. Answers of status 503 have Retry-After.
    """

    def __init__(
        self, status: int, detail: str, parameter: str | None = None, *, retry_after_s: int = BUSY_S, **headers: str
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.parameter = parameter
        self.retry_after_s = retry_after_s
        self.headers = {name.replace("_", "-"): value for name, value in headers.items()}


@contextlib.contextmanager
def refused() -> Iterator[None]:
    """Turn errors about parameters of a request, and tables that a format cannot hold, into refusals (422)."""
    try:
        yield
    except (errors.ParameterError, errors.CannotHoldError) as error:
        raise RequestError(422, str(error), getattr(error, "parameter", None)) from error


def refusal_of(finding: Mapping[str, Any]) -> RequestError:
    """Return the refusal (422) of an error that pydantic found; it names the parameter, or else the body."""
    wrong = finding.get("ctx", {}).get("error")
    parameter = wrong.parameter if isinstance(wrong, errors.ParameterError) else str((*finding["loc"], "body")[0])
    return RequestError(422, f"{parameter}: {errors.sentence_of(finding)}", parameter)


# Errors that the router passes to `handler`. Any other error of brdfdb is a bug of the service: 500
HANDLED = (
    errors.UnknownMaterialError,
    errors.UnknownRevisionError,
    errors.StoreError,
    RequestError,
    RequestValidationError,
    HTTPException,
    Exception,
)


async def handler(request: Request, error: Exception) -> Response:
    """Return the answer of the router to an exception."""
    state = request.app.state
    if isinstance(error, HTTPException) and error.status_code in (404, 405):
        routes = [route for route in state.routes if route.matches(request.scope)[0] is not Match.NONE]
        methods = {method for route in routes for method in route.methods}  # the router lists those of one route only
        allowed = ", ".join(sorted(methods | {"HEAD"} if "GET" in methods else methods))
        unknown = RequestError(404, f"{request.scope['path'][:100]!r} is not an address of this service; see /docs")
        detail = f"{request.method[:20]} is not allowed at this address; allowed are {allowed}"
        error = RequestError(405, detail, Allow=allowed) if routes else unknown
    answer: Response = state.failed(error)
    return answer


def problem_of(error: Exception, root: Path | None = None) -> Response:
    """Return the answer to an exception; of the directory of the store, `root`, it shows only the last name.

    A ParameterError here is about a parameter that no client sent, so it is a bug: 500.
    """
    match error:
        case RequestError():
            wait = {"Retry-After": str(error.retry_after_s)} if error.status == 503 else {}
            return _problem(error.status, str(error), error.parameter, headers=error.headers | wait)
        case RequestValidationError():
            first = error.errors()[0]
            return problem_of(refusal_of({**first, "loc": first["loc"][1:]}))  # ("query", name, ...)
        case errors.UnknownMaterialError():
            parameter = "name" if error.kind == "material" else error.kind
            return _problem(404, str(error), parameter, closest=error.closest)
        case errors.UnknownRevisionError():
            return _problem(404, str(error), "revision")
        case errors.StoreError():
            detail = str(error) if root is None else str(error).replace(str(root), root.name)
            return _problem(503, detail, headers={"Retry-After": str(DAMAGED_S)})
        case OSError() if error.errno in (errno.EMFILE, errno.ENFILE):
            return problem_of(RequestError(503, "too many files and connections are open; try again later"))
        case HTTPException():
            return _problem(error.status_code, error.detail, headers=dict(error.headers or {}))
        case _:
            return _problem(500, "the service failed on this request; its log has the reason")


def _problem(
    status: int,
    detail: str,
    parameter: str | None = None,
    closest: Sequence[str] | None = None,
    headers: dict[str, str] | None = None,
) -> Response:
    """Return an error as application/problem+json, with the fields `parameter` and `closest` if they are given."""
    problem: dict[str, Any] = {
        "type": "about:blank",
        "title": _TITLES.get(status) or HTTPStatus(status).phrase,
        "status": status,
        "detail": _shown(detail, 2000),
    }
    if parameter is not None:
        problem["parameter"] = _shown(parameter, 100)
    if closest is not None:
        problem["closest"] = list(closest)
    return Response(orjson.dumps(problem), status_code=status, media_type=PROBLEM_JSON, headers=headers)


def _shown(text: str, most: int) -> str:
    """Return a text with escapes for bytes that are not text, shortened to `most` characters."""
    text = text.encode(errors="backslashreplace").decode()
    return text if len(text) <= most else f"{text[: most - 1]}…"
