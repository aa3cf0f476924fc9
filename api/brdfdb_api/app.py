"""The application: its factory, which exception becomes which status, the body limit, and the server."""

from __future__ import annotations

import contextlib
import socket
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import orjson
from fastapi import FastAPI
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

import brdfdb
from brdfdb.store import StoreError, UnknownMaterialError
from brdfdb_api.responses import PROBLEM_JSON, RequestError, problem_response
from brdfdb_api.routes import router
from brdfdb_api.settings import Settings

if TYPE_CHECKING:
    from brdfdb.store import Store

DESCRIPTION = """\
Lookups in audited tables of spectral BRDFs, in 1/sr with the cosine not folded in.

All angles are in degrees: theta from the normal, phi counter-clockwise; index i is the light, r the viewer.
phi_r - phi_i = 0 looks back towards the light, 180 is the side of the mirror direction. Every error is an
application/problem+json document with one sentence."""


class Application(FastAPI):
    """FastAPI whose OpenAPI document gives problems the media type that they are sent with."""

    def openapi(self) -> dict[str, Any]:
        document = super().openapi()
        for path in document["paths"].values():
            for operation in path.values():
                for status, response in operation["responses"].items():
                    if status >= "400" and "application/json" in response.get("content", {}):
                        response["content"][PROBLEM_JSON] = response["content"].pop("application/json")
        return document


class BodyLimit:
    """ASGI middleware that counts a body while it arrives: past `limit` [bytes] reading it is a RequestError (413)."""

    def __init__(self, app: ASGIApp, limit: int) -> None:
        self.app = app
        self.limit = limit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        count = 0

        async def counted() -> Message:
            nonlocal count
            message = await receive()
            count += len(message.get("body", b""))
            if count > self.limit:
                raise RequestError(413, f"the body is larger than the {self.limit} bytes that are allowed")
            return message

        await self.app(scope, counted, send)


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
    )
    app.state.settings = settings or Settings.from_environment()
    app.state.store = store
    app.include_router(router)
    app.add_middleware(BodyLimit, limit=app.state.settings.max_body_bytes)
    for kind in (RequestError, RequestValidationError, UnknownMaterialError, StoreError, HTTPException, Exception):
        app.add_exception_handler(kind, problem)
    return app


async def problem(_: Request, error: Exception) -> Response:
    """The one table from exceptions to statuses."""
    match error:
        case RequestError():
            return problem_response(error.status, str(error), error.parameter)
        case RequestValidationError():
            first = error.errors()[0]
            parameter = str(first["loc"][1])  # ("query", name, ...)
            return problem_response(422, f"{parameter}: {first['msg'].lower()}", parameter)
        case UnknownMaterialError():
            return problem_response(404, str(error), closest=error.closest)
        case StoreError():
            return problem_response(503, str(error))
        case HTTPException():
            return problem_response(error.status_code, error.detail, headers=dict(error.headers or {}))
        case _:
            return problem_response(500, "the server failed on this request; its log says why")


def openapi_json() -> bytes:
    """The OpenAPI document as it stands in ``api/openapi.json``."""
    return orjson.dumps(create_app(Settings()).openapi(), option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE)


def serve(store_dir: Path, host: str, port: int) -> None:
    """Serve a store over HTTP until interrupted.

    Parameters
    ----------
    store_dir : Path
        Directory that ``brdfdb build --store`` wrote.
    host : str
        Name or address to listen on.
    port : int
        0 to 65535; 0 takes any free port.

    Raises
    ------
    brdfdb.store.StoreError
        If there is no store at `store_dir`.
    ValueError
        If the port is out of range, or a variable ``BRDFDB_*`` has a value that is not allowed.
    OSError
        If `host` is not an address of this machine or the port is taken.
    """
    import uvicorn

    if not 0 <= port <= 65535:
        raise ValueError(f"port: {port} is outside [0, 65535]")
    app = create_app(replace(Settings.from_environment(), store=store_dir), brdfdb.open(store_dir))
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # asyncio sends small answers at once (TCP_NODELAY) only on a socket that names its protocol: else each takes 40 ms.
    with socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((host, port))
            listener.listen()
        except OSError as error:
            raise OSError(f"cannot listen on {host}, port {port}: {error.strerror}") from error
        port = listener.getsockname()[1]
        print(f"serving {store_dir} at http://{f'[{host}]' if ':' in host else host}:{port}/v1/materials", flush=True)
        with contextlib.suppress(KeyboardInterrupt):
            uvicorn.Server(uvicorn.Config(app, host=host, port=port)).run(sockets=[listener])


if __name__ == "__main__":
    print(openapi_json().decode(), end="")
