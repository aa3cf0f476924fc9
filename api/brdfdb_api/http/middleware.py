"""The outermost ASGI layer: request ids, the log, metrics, room for bodies and answers, and lookups of one point."""

from __future__ import annotations

import functools
import io
import os
import random
import re
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from typing import IO, Any

from prometheus_client import REGISTRY, CollectorRegistry, Counter, Histogram, generate_latest
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response
from starlette.routing import BaseRoute, Router
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from brdfdb_api import log
from brdfdb_api.http.errors import RequestError
from brdfdb_api.settings import LogLevel

GONE = 499  # status of a request whose client went away, as nginx counts it
SMALL = 64 * 2**10  # size up to which bodies and answers are not counted [byte]
BODIES = 1  # bodies of the largest size that may be in memory together
RETRY_S = 10  # time after which room may be free again [s]
PIECE = 256 * 2**10  # size of the pieces of larger answers [byte]
ROOM = {"memory": 64 * 2**20, "files": 2**31}  # bytes of larger answers that may wait to be read
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


@functools.lru_cache(maxsize=4096)
def _labelled(metric: Any, *labels: object) -> Any:
    """Return a metric with its labels, cached: finding them takes as long as a lookup."""
    return metric.labels(*labels)


class Edge:
    """ASGI middleware around the whole application.

    Parameters
    ----------
    app : ASGI application
        What answers all other requests.
    limit : int
        Bytes that a body may have; past that, reading it is a RequestError (413), counted while it arrives.
    quick : sequence of routes
        GET at their addresses is answered without the application.
    failed : callable
        From an exception to the answer.
    log_level : str
        "info" logs each request, "warning" those that were refused, "error" those that failed here.
    """

    def __init__(
        self,
        app: ASGIApp,
        limit: int,
        quick: Sequence[BaseRoute],
        failed: Callable[[Exception], Response],
        log_level: LogLevel,
    ) -> None:
        self.app, self.get = app, Router(quick, default=app, redirect_slashes=False)
        self.limit, self.failed = limit, failed
        self.logged_from = LOGGED_FROM[log_level]
        self.bodies = 0  # bytes of larger bodies in memory
        self.unread = dict.fromkeys(ROOM, 0)  # bytes of larger answers

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        start = time.perf_counter()
        exchange, original_scope = _Exchange(self, scope, receive, send), scope
        if scope["method"] == "HEAD":  # answered like GET, without the body
            scope = {**scope, "method": "GET"}
        try:
            app = self.get if scope["method"] == "GET" else self.app
            await app(scope, exchange.receive, exchange.send)
            await exchange.send_large()
        except Exception as error:
            refusal = self.failed(error)
            if refusal.status_code == 500 and not exchange.gone:
                failed, lines = log.ascii_of(f"{type(error).__name__}: {error}"), log.ascii_of(traceback.format_exc())
                log.write({**_about(original_scope, exchange.id), "failed": failed, "traceback": lines})
            if not exchange.started:
                await refusal(scope, receive, exchange.send)
            elif not exchange.ended:  # the answer has started: no other is possible
                exchange.status = 500
                raise
        finally:
            self.bodies -= exchange.counted
            seconds = time.perf_counter() - start
            status = exchange.status or GONE  # no client waits for a cancelled request
            route = getattr(scope.get("route"), "path", "other")
            _labelled(REQUESTS, route, status).inc()
            _labelled(SECONDS, route).observe(seconds)
            if status >= self.logged_from:
                log.write(_about(original_scope, exchange.id) | {"status": status, "ms": round(1e3 * seconds, 3)})


class _Exchange:
    """A request and its answer: its id, the bytes of its body in memory, and a large answer that waits to be read."""

    def __init__(self, edge: Edge, scope: Scope, receive: Receive, send: Send) -> None:
        self.edge, self._receive, self._send = edge, receive, send
        self.id = _request_id(scope)
        self.head = scope["method"] == "HEAD"
        self.size = 0  # bytes of the body so far
        self.counted = 0  # bytes of the body that are counted against the limit of all bodies
        self.status = 0  # status of the answer, once there is one
        self.start: Message | None = None  # the head of the answer, which waits for the first piece of the body
        self.large: bytes | None = None  # the body of an answer that is sent once the application has ended
        self.started = self.ended = self.gone = False

    async def receive(self) -> Message:
        message = await self._receive()
        if message["type"] == "http.disconnect":
            if not self.ended:
                self.gone, self.status, self.ended = True, GONE, True
            return message
        size = len(message.get("body", b""))
        self.size += size
        if self.size > self.edge.limit:
            raise RequestError(413, f"the body is larger than the {self.edge.limit} bytes that are allowed")
        if self.size > SMALL:
            self.edge.bodies += self.size - self.counted
            self.counted = self.size
            if self.edge.bodies > BODIES * self.edge.limit:
                detail = "the server holds as many large bodies as it can; ask again later"
                raise RequestError(503, detail, retry_after_s=RETRY_S)
        return message

    async def send(self, message: Message) -> None:
        if self.gone:
            return
        if message["type"] == "http.response.start":
            self.status = message["status"]
            message["headers"] = [*message["headers"], (b"x-request-id", self.id)]
            self.start = message
            return
        if self.head:
            message = {**message, "body": b""}
        more = message.get("more_body", False)
        if not more and len(message.get("body", b"")) > SMALL:
            self.large = message["body"]
            return
        await self._sent(message)
        self.ended = not more

    async def _sent(self, message: Message) -> None:
        if self.start is not None:
            start, self.start, self.started = self.start, None, True
            await self._send(start)
        await self._send(message)

    async def send_large(self) -> None:
        """Send a large answer in pieces, as fast as they are read. What does not fit in memory waits in a file."""
        self.edge.bodies -= self.counted  # nobody needs the body any more
        self.counted = 0
        if self.large is None:
            return
        size, unread = len(self.large), self.edge.unread
        place = next((place for place, room in ROOM.items() if unread[place] + size <= room), None)
        if place is None:
            detail = "too many large answers wait to be read; ask again later"
            raise RequestError(503, detail, retry_after_s=RETRY_S)
        unread[place] += size
        try:
            in_memory = place == "memory"
            with io.BytesIO(self.large) if in_memory else await run_in_threadpool(_in_file, self.large) as file:
                self.large = None
                for end in range(PIECE, size + PIECE, PIECE):
                    piece = {"type": "http.response.body", "body": file.read(PIECE), "more_body": end < size}
                    await self._sent(piece)
            self.ended = True
        except OSError as error:  # no room for the file
            raise RequestError(503, "no large answer can wait to be read; ask again later") from error
        finally:
            unread[place] -= size


def _in_file(content: bytes) -> IO[bytes]:
    """Return a temporary file with this content, to be read from its start."""
    file = tempfile.TemporaryFile()  # noqa: SIM115 the caller closes it
    file.write(content)
    file.seek(0)
    return file


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


def _about(scope: Scope, request_id: bytes) -> dict[str, object]:
    """Return what a line of the log says of a request."""
    client = scope.get("client")
    return {
        "request": request_id.decode(),
        "client": client[0] if client else "",
        "method": scope["method"],
        "path": log.ascii_of(scope["path"]),
        "query": scope["query_string"].decode("ascii", "backslashreplace"),
    }
