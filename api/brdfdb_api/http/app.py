"""The application and its factory."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import threading
from collections.abc import AsyncIterator
from typing import TYPE_CHECKING, Any

import orjson
from fastapi import FastAPI
from starlette.datastructures import Headers
from starlette.middleware.cors import CORSMiddleware
from starlette.responses import Response
from starlette.types import ASGIApp

from brdfdb.scenes import lit_sphere
from brdfdb.store.shelf import Shelf
from brdfdb_api.http.addresses import Quick, schemas
from brdfdb_api.http.errors import HANDLED, RequestError, handler, problem_of
from brdfdb_api.http.files import files
from brdfdb_api.http.lookups import LARGE_AT_ONCE, lookups
from brdfdb_api.http.middleware import Edge
from brdfdb_api.http.models import models
from brdfdb_api.http.pages import pages
from brdfdb_api.http.responses import DIGEST, REVISION
from brdfdb_api.http.routes import router
from brdfdb_api.http.views import EXPORTS_AT_ONCE, views
from brdfdb_api.settings import Settings

if TYPE_CHECKING:
    from brdfdb.store.edition.reader import Edition
    from brdfdb.store.reader import Store

DESCRIPTION = """\
Lookups in audited tables of spectral BRDFs [1/sr], without the cosine.

All angles are in degrees: theta from the normal, phi counter-clockwise; index i is the light, r the viewer.
phi_r - phi_i = 0 is back towards the light, 180 is the side of the mirror direction. Every error is an
application/problem+json document with one sentence."""


class Application(FastAPI):
    """A FastAPI application behind `Edge`, with the schemas of all answers in its OpenAPI document."""

    def build_middleware_stack(self) -> ASGIApp:
        given = self.state.settings
        inner = super().build_middleware_stack()
        quick = [route for route in lookups.routes if isinstance(route, Quick)]
        edge = Edge(inner, given.max_body_bytes, quick, self.state.failed, given.log_level)
        if not given.cors_origins:
            return edge
        return _Cors(
            edge,
            allow_origins=given.cors_origins,
            allow_methods=["GET", "POST"],
            allow_headers=["*"],
            expose_headers=["ETag", "Retry-After", "X-Request-ID", REVISION, DIGEST],
        )

    def openapi(self) -> dict[str, Any]:
        if self.openapi_schema is None:
            super().openapi()["components"] = {"schemas": schemas()}  # FastAPI keeps the document
        return super().openapi()


def create_app(settings: Settings | None = None, store: Store | Edition | None = None) -> FastAPI:
    """Make the application.

    Parameters
    ----------
    settings : Settings, optional
        Read from the environment (``BRDFDB_*``) if missing.
    store : Store, optional
        An open store, instead of the one at `settings.store`, which the first request opens. Until a store exists, the
        application answers 503.

    Raises
    ------
    ValueError
        If an environment variable has a value that is not allowed.
    """
    app = Application(
        title="brdfdb",
        version="1.0",
        summary="Spectral BRDF tables from published surface parameters",
        description=DESCRIPTION,
        generate_unique_id_function=lambda route: route.name,
        lifespan=_warmed,
        redirect_slashes=False,  # an unknown address is 404
        openapi_url=None,  # `pages` has it
    )
    given = app.state.settings = settings or Settings.from_environment()
    app.state.failed = functools.partial(
        problem_of, root=None if isinstance(given.store, str) else given.store.absolute()
    )
    app.state.shelf = Shelf(given.store, given.audit_files, given.cache_bytes, given.snapshot, store)
    app.state.large = asyncio.Semaphore(LARGE_AT_ONCE)
    app.state.exports = asyncio.Semaphore(EXPORTS_AT_ONCE)
    app.state.routes = []
    for part in (router, lookups, views, models, files, pages):
        app.include_router(part)
        app.state.routes += part.routes
    for kind in HANDLED:
        app.add_exception_handler(kind, handler)
    return app


class _Cors(CORSMiddleware):
    """CORS middleware whose refusals are problem documents, too."""

    def preflight_response(self, request_headers: Headers) -> Response:
        answer = super().preflight_response(request_headers)
        if answer.status_code < 400:
            return answer
        return problem_of(RequestError(answer.status_code, bytes(answer.body).decode()))


@contextlib.asynccontextmanager
async def _warmed(app: FastAPI) -> AsyncIterator[None]:
    """Load the kernels of lookups and the data of pictures in a thread, while the application already answers."""
    loads = (app.state.shelf.warm, lit_sphere.prepare)
    threading.Thread(target=lambda: [load() for load in loads], daemon=True).start()
    yield


def openapi_json() -> bytes:
    """Return the OpenAPI document as in ``api/openapi.json``."""
    return orjson.dumps(create_app(Settings()).openapi(), option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE)


if __name__ == "__main__":
    print(openapi_json().decode(), end="")
