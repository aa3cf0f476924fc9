"""The application and its factory."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import AsyncIterator
from typing import TYPE_CHECKING, Any

import orjson
from fastapi import FastAPI
from starlette.middleware.cors import CORSMiddleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.types import ASGIApp, Receive, Scope, Send

from brdfdb_api.http.errors import HANDLED, PROBLEM_JSON, handler, problem_of
from brdfdb_api.http.files import files
from brdfdb_api.http.lookups import LARGE_AT_ONCE
from brdfdb_api.http.middleware import Edge
from brdfdb_api.http.models import models
from brdfdb_api.http.pages import pages
from brdfdb_api.http.responses import REVISION
from brdfdb_api.http.routes import EXPORTS_AT_ONCE, answer_point, router
from brdfdb_api.http.views import views
from brdfdb_api.serving.settings import Settings
from brdfdb_api.serving.shelf import Shelf

if TYPE_CHECKING:
    from brdfdb.store.reader import Store

DESCRIPTION = """\
Lookups in audited tables of spectral BRDFs, in 1/sr with the cosine not folded in.

All angles are in degrees: theta from the normal, phi counter-clockwise; index i is the light, r the viewer.
phi_r - phi_i = 0 looks back towards the light, 180 is the side of the mirror direction. Every error is an
application/problem+json document with one sentence."""


# Media types that are not compressed: binary numbers hardly shrink, and files are compressed already
UNCOMPRESSED = (*("application/x-npy", "application/octet-stream", "application/zip"), "image/*", "text/*")


class Application(FastAPI):
    """FastAPI behind an edge, whose OpenAPI document gives problems the media type that they are sent with."""

    outermost: ASGIApp

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        scope["app"] = self
        await self.outermost(scope, receive, send)

    async def routed(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Run the router, which lies behind the edge."""
        await super().__call__(scope, receive, send)

    def openapi(self) -> dict[str, Any]:
        document = super().openapi()
        schemas = document["components"]["schemas"]
        for path in document["paths"].values():
            for operation in path.values():
                for status, response in operation["responses"].items():
                    content = response.get("content", {})
                    if "$ref" in content.get("application/json", {}).get(
                        "schema", {}
                    ):  # first: generated clients take the first that they can read
                        kind = PROBLEM_JSON if status >= "400" else "application/json"
                        response["content"] = {kind: content.pop("application/json"), **content}
        for part in (*document["paths"].values(), *list(schemas.values())):
            for key, value in part.items():
                part[key] = _named(value, schemas)
        return document


def _named(part: Any, schemas: dict[str, Any]) -> Any:
    """Return a part of the document with references to the objects that have titles, which join the schemas."""
    if isinstance(part, list):
        return [_named(item, schemas) for item in part]
    if not isinstance(part, dict):
        return part
    part = {key: _named(value, schemas) for key, value in part.items()}
    if part.get("type") != "object" or "properties" not in part or not isinstance(part.get("title"), str):
        return part
    schemas.setdefault(part["title"], part)
    return {"$ref": f"#/components/schemas/{part['title']}"}


def create_app(settings: Settings | None = None, store: Store | None = None) -> FastAPI:
    """Make the application.

    Parameters
    ----------
    settings : Settings, optional
        Read from the environment (``BRDFDB_*``) if missing.
    store : Store, optional
        An open store, instead of `settings.store`. That one is opened by the first request that needs it, so that an
        application can start, and answer 503, before there is a store.

    Raises
    ------
    ValueError
        If a variable of the environment has a value that is not allowed.
    """
    app = Application(
        title="brdfdb",
        version="1.0",
        summary="Spectral BRDF tables from published surface parameters",
        description=DESCRIPTION,
        generate_unique_id_function=lambda route: route.name,
        lifespan=_warmed,
        redirect_slashes=False,  # an unknown address is 404
    )
    app.state.settings = settings or Settings.from_environment()
    app.state.shelf = Shelf(app.state.settings, store)
    app.state.large = asyncio.Semaphore(LARGE_AT_ONCE)
    app.state.exports = asyncio.Semaphore(EXPORTS_AT_ONCE)
    app.include_router(router)
    app.include_router(views)
    app.include_router(models)
    app.include_router(files)
    app.include_router(pages)
    for kind in HANDLED:
        app.add_exception_handler(kind, handler)
    app.add_middleware(GZipMiddleware, minimum_size=1024, compresslevel=5, exclude_content_types=UNCOMPRESSED)
    limit, level = app.state.settings.max_body_bytes, app.state.settings.log_level
    app.outermost = Edge(app.routed, limit=limit, lookup=answer_point, failed=problem_of, log_level=level)
    if app.state.settings.cors_origins:
        app.outermost = CORSMiddleware(
            app.outermost,
            allow_origins=app.state.settings.cors_origins,
            allow_methods=["GET", "POST"],
            allow_headers=["*"],
            expose_headers=["ETag", "X-Request-ID", REVISION],
        )
    return app


@contextlib.asynccontextmanager
async def _warmed(app: FastAPI) -> AsyncIterator[None]:
    """Run a thread that finds the colours of the first page of a list, until the application ends."""
    threading.Thread(target=app.state.shelf.warm, daemon=True).start()
    yield


def openapi_json() -> bytes:
    """Return the OpenAPI document as it stands in ``api/openapi.json``."""
    return orjson.dumps(create_app(Settings()).openapi(), option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE)


if __name__ == "__main__":
    print(openapi_json().decode(), end="")
