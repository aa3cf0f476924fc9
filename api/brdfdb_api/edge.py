"""The outermost ASGI layer: request ids, the log, metrics, and one-point lookups, which skip all that lies behind."""

from __future__ import annotations

import functools
import logging
import os
import re
import sys
import time
import traceback
from collections.abc import Awaitable, Callable

import orjson
from prometheus_client import REGISTRY, CollectorRegistry, Counter, Histogram, generate_latest
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from brdfdb_api.responses import RequestError
from brdfdb_api.settings import LogLevel

LOG = logging.getLogger("brdfdb.http")

LOOKUP = re.compile(r"/v1/materials/([^/]+)(?:/revisions/([^/]+))?/lookup")
LOOKUP_ROUTE = "/v1/materials/{name}/lookup"

GONE = 499  # nobody is there to be answered: as nginx counts it
BODIES = 8  # of the largest size that may be in memory together
_REQUEST_ID = re.compile(rb"[A-Za-z0-9._-]{1,64}")

# made once a process, as the registry is
REQUESTS = Counter("brdfdb_requests", "Requests answered", ["route", "status"])
SECONDS = Histogram(
    "brdfdb_request_seconds",
    "From the first byte of a request to the last of its answer",
    ["route"],
    buckets=(0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.1, 0.5, 2.5, 10.0),
)
POINTS = Counter("brdfdb_points", "Pairs of directions looked up", ["source"])

Answerer = Callable[[Scope, str, str | None], Awaitable[ASGIApp]]


class Edge:
    """ASGI middleware around the whole application.

    Parameters
    ----------
    app : ASGI application
        What answers all but lookups of one point.
    limit : int
        Bytes that a body may have; past that, reading it is a RequestError (413), counted while it arrives.
    lookup : callable
        Answers GET of a lookup: from the scope, the name of a material and of a revision, or None for the current one.
    failed : callable
        From an exception to the answer.
    """

    def __init__(self, app: ASGIApp, limit: int, lookup: Answerer, failed: Callable[[Exception], Response]) -> None:
        self.app, self.limit, self.lookup, self.failed = app, limit, lookup, failed
        self.waiting = 0  # bytes of bodies in memory

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        start = time.perf_counter()
        request_id = _request_id(scope)
        status = 0
        head = scope["method"] == "HEAD"
        if head:  # answered as GET, without the body
            scope = {**scope, "method": "GET"}

        async def labelled(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                message["headers"] = [*message["headers"], (b"x-request-id", request_id)]
            elif head:
                message = {**message, "body": b""}
            await send(message)

        route, body = "", _Body(self)
        try:
            if scope["method"] == "GET" and (match := LOOKUP.fullmatch(scope["path"])):
                route = LOOKUP_ROUTE
                answer = await self.lookup(scope, match[1], match[2])
                await answer(scope, receive, labelled)
            else:
                await self.app(scope, body.counted(receive), labelled)
        except ClientDisconnect:
            status = GONE
        except Exception as error:
            refusal = self.failed(error)
            if refusal.status_code == 500:
                failed = f"{type(error).__name__}: {error}"
                LOG.error(_line(scope, request_id, failed=failed, traceback=traceback.format_exc()))
            if status:  # too late for another answer
                raise
            await refusal(scope, receive, labelled)
        finally:
            body.forget()
            seconds = time.perf_counter() - start
            route = route or getattr(scope.get("route"), "path", "other")
            requests, observed = _counters(route, status)
            requests.inc()
            observed.observe(seconds)
            level = logging.INFO if status < 400 else logging.WARNING if status < 500 else logging.ERROR
            if LOG.isEnabledFor(level):
                LOG.log(level, _line(scope, request_id, status=status, ms=round(1e3 * seconds, 3)))


class _Body:
    """The body of a request, counted while it arrives, and with those of all others."""

    def __init__(self, edge: Edge) -> None:
        self.edge, self.size = edge, 0

    def counted(self, receive: Receive) -> Receive:
        async def more() -> Message:
            message = await receive()
            size = len(message.get("body", b""))
            self.size += size
            self.edge.waiting += size
            if self.size > self.edge.limit:
                raise RequestError(413, f"the body is larger than the {self.edge.limit} bytes that are allowed")
            if self.edge.waiting > BODIES * self.edge.limit:
                raise RequestError(503, "the server holds as many large bodies as it can; ask again later")
            return message

        return more

    def forget(self) -> None:
        self.edge.waiting -= self.size


@functools.lru_cache(maxsize=4096)
def _counters(route: str, status: int) -> tuple[Counter, Histogram]:
    """What counts a route and a status: labels take as long to look up as a point."""
    return REQUESTS.labels(route, status), SECONDS.labels(route)


def metrics() -> bytes:
    """What was counted, of all workers, as Prometheus reads it."""
    if "PROMETHEUS_MULTIPROC_DIR" not in os.environ:
        return generate_latest(REGISTRY)
    from prometheus_client.multiprocess import MultiProcessCollector

    registry = CollectorRegistry()
    MultiProcessCollector(registry)  # type: ignore[no-untyped-call]
    return generate_latest(registry)


def log_to_stderr(level: LogLevel) -> None:
    """Write the log as lines of JSON, unless the program around has handlers of its own."""
    LOG.setLevel(level.upper())
    if not LOG.handlers and not logging.getLogger().handlers:
        handler = logging.StreamHandler(sys.stderr)
        handler.setFormatter(logging.Formatter("%(message)s"))
        LOG.addHandler(handler)


def _request_id(scope: Scope) -> bytes:
    """The id that a client gives a request, else a new one."""
    for name, value in scope["headers"]:
        if name == b"x-request-id" and _REQUEST_ID.fullmatch(value):
            return bytes(value)
    return os.urandom(8).hex().encode()


def _line(scope: Scope, request_id: bytes, **more: object) -> str:
    client = scope.get("client")
    record = {
        "time": round(time.time(), 3),
        "request": request_id.decode(),
        "client": client[0] if client else "",
        "method": scope["method"],
        "path": scope["path"],
        "query": scope["query_string"].decode("latin-1"),
        **more,
    }
    return orjson.dumps(record).decode()
