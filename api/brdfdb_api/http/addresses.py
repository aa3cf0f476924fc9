"""Routes of the service, and the descriptions of their answers in the OpenAPI document."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Coroutine, Mapping
from typing import Annotated, Any, TypeVar

from fastapi import APIRouter, Depends
from fastapi.routing import APIRoute
from pydantic import BaseModel, WithJsonSchema
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaMode, models_json_schema
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from brdfdb.store.shelf import Shelf
from brdfdb_api.http.errors import PROBLEM_JSON, RequestError
from brdfdb_api.http.queries import names_of, parsed, shortened
from brdfdb_api.http.responses import DIGEST, JSON, NPY, REVISION, ServedProblem, unchanged

T = TypeVar("T")

Revision = Annotated[
    str | None,
    WithJsonSchema({"type": "string", "description": "such as r000001, or with its digest, r000001-0123456789abcdef"}),
]
NPY_ANSWER = {NPY: "brdf as a .npy file; with error=true, brdf and error along a first axis"}
NPY_BODY = (
    "Or a .npy array of shape (..., 4), float32 or float64: theta_i, phi_i, theta_r, phi_r. "
    "A body of any other media type is read as JSON."
)

_REFERENCE = "#/components/schemas/{model}"
_OTHERS = {
    304: "The ETag in If-None-Match is still current",
    404: "Unknown name or revision; the answer lists the closest names",
    413: "The body is too large, or one answer cannot have so many points",
    415: "The body is compressed",
    416: "The range begins after the end of the file",
    422: "A parameter is missing, unknown or out of range; the answer names it",
    503: "The store or the files of the material cannot be read, or the service is too busy",
}
_HEADERS = {
    "X-Request-ID": "ID of the request, from its own header or new; the log has it, too",
    "ETag": "changes when the answer changes",
    "Cache-Control": "how long the answer may be cached: without end where a revision is named with its digest",
    REVISION: "revision of the table",
    DIGEST: "SHA-256 of the manifest of the revision",
    "Content-Disposition": "file name",
    "Retry-After": "seconds after which the same request may succeed",
}


def is_pinned(revision: str | None) -> bool:
    """Return True if a revision is named with its digest, so that its numbers are the same in any store."""
    return revision is not None and "-" in revision


def shelf_of(request: Request) -> Shelf:
    """Return the shelf of the application."""
    shelf: Shelf = request.app.state.shelf
    return shelf


async def _content(request: Request) -> bytes:
    return await request.body()


Content = Annotated[bytes, Depends(_content)]  # for endpoints that run in a thread


class Address(APIRoute):
    """A route that refuses unknown query parameters, and answers 304 to a client that has the current answer."""

    def __init__(self, path: str, endpoint: Callable[..., Any], **keywords: Any) -> None:
        super().__init__(path, endpoint, **keywords)
        self.summary = " ".join(self.description.partition("\n\n")[0].splitlines()).removesuffix(".")

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        handle = super().get_route_handler()
        kinds: list[Any] = [parameter.field_info.annotation for parameter in self.dependant.query_params]
        names = [name for kind in kinds for name in names_of(kind)]
        reads_itself = "parameters" in (self.openapi_extra or {})

        async def answer(request: Request) -> Response:
            if not reads_itself:
                parsed(request.scope["query_string"], names)
            if (coding := request.headers.get("content-encoding", "identity").lower()) != "identity":
                detail = f"Content-Encoding: {shortened(coding)!r} is not supported; send the body uncompressed"
                raise RequestError(415, detail, Accept_Encoding="identity")
            return unchanged(await handle(request), request.headers.get("if-none-match"))

        return answer


class Quick(Address):
    """A GET route whose endpoint parses its query itself, because FastAPI takes three times as long to answer.

    FastAPI describes the parameters in the OpenAPI document.
    """

    def __init__(self, path: str, endpoint: Callable[..., Any], **keywords: Any) -> None:
        super().__init__(path, endpoint, **keywords)
        self.app = self._answered

    async def _answered(self, scope: Scope, receive: Receive, send: Send) -> None:
        answer = await self.endpoint(Request(scope), query=None, **scope["path_params"])
        await answer(scope, receive, send)


def addresses() -> APIRouter:
    """Return a router of addresses."""
    return APIRouter(route_class=Address, default_response_class=Response)


def both(
    router: APIRouter, path: str, *, method: str = "GET", **keywords: Any
) -> Callable[[Callable[..., T]], Callable[..., T]]:
    """Add a route for the current revision of a material, and the same route for a named revision."""

    def add(function: Callable[..., T]) -> Callable[..., T]:
        signature = inspect.signature(function, eval_str=True)
        others = [parameter for parameter in signature.parameters.values() if parameter.name != "revision"]
        current = functools.update_wrapper(functools.partial(function, revision=None), function)
        current.__signature__ = signature.replace(parameters=others)  # type: ignore[attr-defined]
        name = getattr(function, "__name__", "")
        for endpoint, prefix, suffix in ((current, "", ""), (function, "/revisions/{revision}", "_of_revision")):
            address = f"/v1/materials/{{name}}{prefix}{path}"
            router.add_api_route(address, endpoint, methods=[method], name=f"{name}{suffix}", **keywords)
        return function

    return add


_DESCRIBED: dict[str, tuple[type[BaseModel], JsonSchemaMode]] = {}  # models of the document, by their names


def _schema(model: type[BaseModel], mode: JsonSchemaMode = "serialization") -> dict[str, Any]:
    """Return a reference to the JSON Schema of a model, which becomes one of the `schemas` of the document."""
    name = model.__name__.removeprefix("Served")
    _DESCRIBED[name] = model, mode
    return {"schema": {"$ref": _REFERENCE.format(model=name)}}


class _SchemaGenerator(GenerateJsonSchema):
    """Names schemas as clients know them."""

    def normalize_name(self, name: str) -> str:
        return super().normalize_name(name).removeprefix("Served")


def schemas() -> dict[str, Any]:
    """Return the JSON Schemas of all bodies and answers by name."""
    _, document = models_json_schema([*_DESCRIBED.values()], ref_template=_REFERENCE, schema_generator=_SchemaGenerator)
    schemas: dict[str, Any] = document["$defs"]
    return schemas


def answers(
    model: type[BaseModel] | None, *statuses: int, media: Mapping[str, str] = {}, headers: tuple[str, ...] = ()
) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI description of the answers of an address: `model` at 200 or other media, and `statuses`."""
    content = {} if model is None else {JSON: _schema(model)}  # first, because generated clients use the first one
    for kind, text in media.items():
        binary = {"type": "string"} if "text" in kind else {"type": "string", "format": "binary"}
        content[kind] = {"schema": {"description": text, **({"type": "object"} if kind == JSON else binary)}}
    cached = ("ETag", "Cache-Control") if 304 in statuses else ()
    described: dict[int | str, dict[str, Any]] = {200: _answer("Success", *cached, *headers, content=content)}
    for status in (*statuses, 422):
        more = {304: cached, 503: ("Retry-After",)}.get(status, ())
        problem = {} if status < 400 else {"content": {PROBLEM_JSON: _schema(ServedProblem)}}
        described[status] = _answer(_OTHERS[status], *more, **problem)
    return described


def _answer(description: str, *names: str, **more: Any) -> dict[str, Any]:
    headers = {
        name: {"description": _HEADERS[name], "schema": {"type": "integer" if name == "Retry-After" else "string"}}
        for name in ("X-Request-ID", *names)
    }
    return {"description": description, "headers": headers, **more}


def body(model: type[BaseModel], *, npy: bool = False) -> dict[str, Any]:
    """Return the OpenAPI description of a body that is JSON, or also .npy."""
    example: Any = model.model_config.get("json_schema_extra")
    content = {JSON: {**_schema(model, "validation"), **example}}
    if npy:
        content[NPY] = {"schema": {"type": "string", "format": "binary", "description": NPY_BODY}}
    words = f"{model.__doc__} {NPY_BODY if npy else ''}".strip()
    return {"requestBody": {"required": True, "description": words, "content": content}}
