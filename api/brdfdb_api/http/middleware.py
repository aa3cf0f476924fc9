"""The outermost ASGI layer: request IDs, the log, metrics, limits of memory, and lookups of one point."""

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

GONE = 499  # status of a request whose client disconnected, as in nginx
SMALL = 64 * 2**10  # size up to which bodies and answers are not counted [byte]
BODIES = 1  # number of bodies of the largest size that fit in memory
RETRY_S = 10  # time after which memory may be free again [s]
PIECE = 256 * 2**10  # size of the pieces of larger answers [byte]
ROOM = {"memory": 64 * 2**20, "files": 2**31}  # size of all larger answers that clients have not read yet [byte]
_REQUEST_ID = re.compile(rb"[A-Za-z0-9._-]{1,64}")

# One of each per process, like the registry
REQUESTS = Counter("brdfdb_requests", "Requests answered", ["route", "status"])
SECONDS = Histogram(
    "brdfdb_request_seconds",
    "Seconds from the first byte of a request to the last byte of its answer",
    ["route"],
    buckets=(0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.1, 0.5, 2.5, 10.0),
)
POINTS = Counter("brdfdb_points", "Pairs of directions looked up", ["source"])

LOGGED_FROM: dict[LogLevel, int] = {"info": 0, "warning": 400, "error": 500}  # lowest status in the log


@functools.lru_cache(maxsize=4096)
def _labelled(metric: Any, *labels: object) -> Any:
    """Return a metric with its labels; cached, because the search for them takes as long as a lookup."""
    return metric.labels(*labels)


class Edge:
    """ASGI middleware around the application `app`; it answers GET requests to the `quick` routes itself.

    A body larger than `limit` bytes is refused (413) while it arrives. `failed` makes the answer to an exception.
    """

    def __init__(
        self,
        app: ASGIApp,
        limit: int,
        quick: Sequence[BaseRoute],
        failed: Callable[[Exception], Response],
        log_level: LogLevel,
    ) -> None:
        self.app = app
        self.get = Router(quick, default=app, redirect_slashes=False)
        self.limit = limit
        self.failed = failed
        self.logged_from = LOGGED_FROM[log_level]
        self.bodies = 0  # size of all larger bodies in memory [byte]
        self.unread = dict.fromkeys(ROOM, 0)  # size of all larger answers that are not read yet [byte]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        start = time.perf_counter()
        exchange = _Exchange(self, scope, receive, send)
        if exchange.head:  # answered like GET, without the body
            scope = {**scope, "method": "GET"}
        try:
            app = self.get if scope["method"] == "GET" else self.app
            await app(scope, exchange.receive, exchange.send)
            await exchange.send_large()
        except Exception as error:
            refusal = self.failed(error)
            if refusal.status_code == 500 and not exchange.gone:
                failed = log.ascii_of(f"{type(error).__name__}: {error}")
                lines = log.ascii_of(traceback.format_exc())
                log.write(exchange.line() | {"failed": failed, "traceback": lines})
            if not exchange.started:
                await refusal(scope, receive, exchange.send)
            elif not exchange.ended:  # it is too late for another answer
                exchange.status = 500
                raise
        finally:
            self.bodies -= exchange.counted
            seconds = time.perf_counter() - start
            status = exchange.status or GONE  # cancelled, because the client disconnected
            route = getattr(scope.get("route"), "path", "other")
            _labelled(REQUESTS, route, status).inc()
            _labelled(SECONDS, route).observe(seconds)
            if status >= self.logged_from:
                log.write(exchange.line() | {"status": status, "ms": round(1e3 * seconds, 3)})


class _Exchange:
    """A request and its answer: the ID, the size of the body in memory, and a large answer before it is sent."""

    def __init__(self, edge: Edge, scope: Scope, receive: Receive, send: Send) -> None:
        self.edge = edge
        self._scope = scope
        self._receive = receive
        self._send = send
        given = (bytes(value) for name, value in scope["headers"] if name == b"x-request-id")
        self.id = next(filter(_REQUEST_ID.fullmatch, given), None) or b"%016x" % random.getrandbits(64)
        self.head = scope["method"] == "HEAD"
        self.size = 0  # size of the body so far [byte]
        self.counted = 0  # part of it that counts against the limit of all bodies [byte]
        self.status = 0  # status of the answer; 0: there is none yet
        self.start: Message | None = None  # head of the answer, sent with the first piece of its body
        self.large: bytes | None = None  # body of a larger answer, sent when the application has returned
        self.started = self.ended = self.gone = False

    def line(self) -> dict[str, object]:
        """Return the fields of the request for a line of the log."""
        scope = self._scope
        client = scope.get("client")
        return {
            "request": self.id.decode(),
            "client": client[0] if client else "",
            "method": scope["method"],
            "path": log.ascii_of(scope["path"]),
            "query": scope["query_string"].decode("ascii", "backslashreplace"),
        }

    async def receive(self) -> Message:
        message = await self._receive()
        if message["type"] == "http.disconnect":
            if not self.ended:
                self.gone = self.ended = True
                self.status = GONE
            return message
        size = len(message.get("body", b""))
        self.size += size
        if self.size > self.edge.limit:
            raise RequestError(413, f"the body is larger than the {self.edge.limit} bytes allowed")
        if self.size > SMALL:
            self.edge.bodies += self.size - self.counted
            self.counted = self.size
            if self.edge.bodies > BODIES * self.edge.limit:
                detail = "the service has no memory for another large body; try again later"
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
            start = self.start
            self.start = None
            self.started = True
            await self._send(start)
        await self._send(message)

    async def send_large(self) -> None:
        """Send a large answer in pieces, as fast as the client reads them, from memory or else from a file."""
        self.edge.bodies -= self.counted  # the body is not needed any more
        self.counted = 0
        if self.large is None:
            return
        size = len(self.large)
        unread = self.edge.unread
        place = next((place for place, room in ROOM.items() if unread[place] + size <= room), None)
        if place is None:
            detail = "too many large answers are not read yet; try again later"
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
        except OSError as error:  # the disk is full
            raise RequestError(503, "the service has no disk space for a large answer; try again later") from error
        finally:
            unread[place] -= size


def _in_file(content: bytes) -> IO[bytes]:
    """Return a temporary file with this content."""
    file = tempfile.TemporaryFile()  # noqa: SIM115 the caller closes it
    file.write(content)
    file.seek(0)
    return file


def metrics() -> bytes:
    """Return the counters of all workers in the format of Prometheus."""
    if "PROMETHEUS_MULTIPROC_DIR" not in os.environ:
        return generate_latest(REGISTRY)
    from prometheus_client.multiprocess import MultiProcessCollector

    registry = CollectorRegistry()
    MultiProcessCollector(registry)  # type: ignore[no-untyped-call]
    return generate_latest(registry)
