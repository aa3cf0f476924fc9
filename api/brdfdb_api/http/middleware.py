"""The outermost ASGI layer: request ids, the log, metrics, and one-point lookups, which skip all that lies behind."""

from __future__ import annotations

import contextlib
import functools
import os
import random
import re
import time
import traceback
from collections.abc import Awaitable, Callable

import orjson
from prometheus_client import REGISTRY, CollectorRegistry, Counter, Histogram, generate_latest
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from brdfdb_api.http.errors import RequestError
from brdfdb_api.serving.settings import LogLevel

LOOKUP = re.compile(r"/v1/materials/([^/]+)(?:/revisions/([^/]+))?/lookup")
LOOKUP_ROUTE = "/v1/materials/{name}/lookup"

GONE = 499  # status of a request whose client went away, as nginx counts it
BODIES = 8  # bodies of the largest size that may be in memory together
_REQUEST_ID = re.compile(rb"[A-Za-z0-9._-]{1,64}")

# made once per process, like the registry
REQUESTS = Counter("brdfdb_requests", "Requests answered", ["route", "status"])
SECONDS = Histogram(
    "brdfdb_request_seconds",
    "From the first byte of a request to the last of its answer",
    ["route"],
    buckets=(0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.1, 0.5, 2.5, 10.0),
)
POINTS = Counter("brdfdb_points", "Pairs of directions looked up", ["source"])

LOGGED_FROM: dict[LogLevel, int] = {"info": 0, "warning": 400, "error": 500}  # lowest status that is logged
LINE = 4096  # length of a line [byte] beyond which pipes mix the lines of several workers
SHOWN = 100  # characters of a path, and of a query, in a shortened line
KEPT = {"failed": slice(SHOWN), "traceback": slice(-1000, None)}
_STDERR = 2

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
    log_level : str
        "info" logs each request, "warning" those that were refused, "error" those that failed here.
    """

    def __init__(
        self,
        app: ASGIApp,
        limit: int,
        lookup: Answerer,
        failed: Callable[[Exception], Response],
        log_level: LogLevel,
    ) -> None:
        self.app, self.limit, self.lookup, self.failed = app, limit, lookup, failed
        self.logged_from = LOGGED_FROM[log_level]
        self.waiting = 0  # bytes of bodies in memory

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        start = time.perf_counter()
        exchange, original_scope = _Exchange(self, scope, receive, send), scope
        if scope["method"] == "HEAD":  # answered like GET, without the body
            scope = {**scope, "method": "GET"}
        route = ""
        try:
            if scope["method"] == "GET" and (match := LOOKUP.fullmatch(scope["path"])):
                route = LOOKUP_ROUTE
                answer = await self.lookup(scope, match[1], match[2])
                await answer(scope, receive, exchange.send)
            else:
                await self.app(scope, exchange.receive, exchange.send)
        except Exception as error:
            refusal = self.failed(error)
            if refusal.status_code == 500 and not exchange.gone:
                failed = f"{type(error).__name__}: {error}"
                _log(original_scope, exchange.id, failed=_ascii(failed), traceback=_ascii(traceback.format_exc()))
            if exchange.status == 0:
                await refusal(scope, receive, exchange.send)
            elif not exchange.ended:  # the answer has started: no other is possible
                exchange.status = 500
                raise
        finally:
            self.waiting -= exchange.size
            seconds = time.perf_counter() - start
            status = exchange.status or GONE  # no client waits for a cancelled request
            requests, observed = _counters(route or getattr(scope.get("route"), "path", "other"), status)
            requests.inc()
            observed.observe(seconds)
            if status >= self.logged_from:
                _log(original_scope, exchange.id, status=status, ms=round(1e3 * seconds, 3))


class _Exchange:
    """A request and its answer: counts the bytes of the body, also over all requests, and gives the answer an id."""

    def __init__(self, edge: Edge, scope: Scope, receive: Receive, send: Send) -> None:
        self.edge, self._receive, self._send = edge, receive, send
        self.id = _request_id(scope)
        self.head = scope["method"] == "HEAD"
        self.size = 0  # bytes of the body so far
        self.status = 0  # status of the answer, once it has started
        self.ended = self.gone = False

    async def receive(self) -> Message:
        message = await self._receive()
        if message["type"] == "http.disconnect":
            if not self.ended:
                self.gone, self.status, self.ended = True, GONE, True
            return message
        size = len(message.get("body", b""))
        self.size += size
        self.edge.waiting += size
        if self.size > self.edge.limit:
            raise RequestError(413, f"the body is larger than the {self.edge.limit} bytes that are allowed")
        if self.edge.waiting > BODIES * self.edge.limit:
            raise RequestError(503, "the server holds as many large bodies as it can; ask again later")
        return message

    async def send(self, message: Message) -> None:
        if self.gone:
            return
        if message["type"] == "http.response.start":
            self.status = message["status"]
            message["headers"] = [*message["headers"], (b"x-request-id", self.id)]
        else:
            self.ended = not message.get("more_body", False)
            if self.head:
                message = {**message, "body": b""}
        await self._send(message)


def points_counted(source: str, count: int) -> None:
    """Add to the pairs of directions that were looked up in a "table" or "model"."""
    _points(source).inc(count)


@functools.cache
def _points(source: str) -> Counter:
    return POINTS.labels(source)


@functools.lru_cache(maxsize=4096)
def _counters(route: str, status: int) -> tuple[Counter, Histogram]:
    """Return the counters of a route and a status, cached: finding labels takes as long as a lookup."""
    return REQUESTS.labels(route, status), SECONDS.labels(route)


def metrics() -> bytes:
    """Return the counts of all workers in the format of Prometheus."""
    if "PROMETHEUS_MULTIPROC_DIR" not in os.environ:
        return generate_latest(REGISTRY)
    from prometheus_client.multiprocess import MultiProcessCollector

    registry = CollectorRegistry()
    MultiProcessCollector(registry)  # type: ignore[no-untyped-call]
    return generate_latest(registry)


def _request_id(scope: Scope) -> bytes:
    """Return the id that a client gives a request, else a new one."""
    for name, value in scope["headers"]:
        if name == b"x-request-id" and _REQUEST_ID.fullmatch(value):
            return bytes(value)
    return b"%016x" % random.getrandbits(64)


def _log(scope: Scope, request_id: bytes, **more: object) -> None:
    """Write a line of JSON to standard error in one call: `logging` takes as long as a lookup."""
    client = scope.get("client")
    record = {
        "time": round(time.time(), 3),
        "request": request_id.decode(),
        "client": client[0] if client else "",
        "method": scope["method"],
        "path": _ascii(scope["path"]),
        "query": scope["query_string"].decode("ascii", "backslashreplace"),
        **more,
    }
    line = orjson.dumps(record, option=orjson.OPT_APPEND_NEWLINE)
    if len(line) > LINE:  # an escaped character takes six at most
        shown = {"path": record["path"][:SHOWN], "query": record["query"][:SHOWN]}
        shown |= {key: str(more[key])[part] for key, part in KEPT.items() if key in more}
        line = orjson.dumps(record | shown, option=orjson.OPT_APPEND_NEWLINE)
    with contextlib.suppress(OSError):  # the reader has gone
        os.write(_STDERR, line)


def _ascii(text: str) -> str:
    """Return ASCII text, which orjson writes and terminals show: other characters, lone surrogates too, are escaped."""
    return text.encode("ascii", "backslashreplace").decode()
