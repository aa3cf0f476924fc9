"""HTTP as uvicorn speaks it, with limits to heads and deadlines, and without offers of other protocols."""

from __future__ import annotations

import sys
from typing import Any

import httptools
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

PIPELINED = 1000  # requests that may wait for the answer to an earlier one
HEAD_BYTES = 64 * 2**10  # limit on a head [byte]; httptools reads no longer addresses
# Time in which a head must arrive, and a piece of an answer be read [s]. uvicorn closes kept connections that send
# nothing after 5 s already
QUIET_S = 10.0


class Connection(HttpToolsProtocol):
    """One connection: 400, and its end, where a head or a trailer does not end within `HEAD_BYTES`.

    The parser keeps address and headers until they are whole, and names no limit. Bytes are counted as they come, since
    the last head that was whole or the last piece of a body; what one read of the socket brings, 256 kB, may be beyond.
    """

    def __init__(self, *args: Any, **keywords: Any) -> None:
        super().__init__(*args, **keywords)
        self._pending = 0
        self._parts: list[bytes | memoryview] = []  # to be read, the last one first
        self._part: bytes | memoryview = b""  # that is being read
        self._quiet_since = self.loop.time()

    def end_if_quiet(self, now: float) -> None:
        """End the connection if nothing went on for `QUIET_S`; `now` is the time of the loop [s].

        A request that is answered goes on, unless the answer waits to be read.
        """
        if self.cycle is not None and not self.cycle.response_complete and not self.flow.write_paused:
            self._quiet_since = now
        elif now - self._quiet_since > QUIET_S:
            self.transport.abort()  # without an end that waits until all is read

    def data_received(self, data: bytes) -> None:
        self._parts = [data]
        while self._parts and not self.transport.is_closing():
            self._part = self._parts.pop()
            self._pending += len(self._part)
            super().data_received(self._part)  # type: ignore[arg-type]  # the callbacks below set _pending to 0
        if self._pending > HEAD_BYTES and not self.transport.is_closing():
            self.logger.warning("Address and headers are longer than %d bytes.", HEAD_BYTES)
            self.send_400_response(f"Address and headers are longer than {HEAD_BYTES} bytes.")

    def on_headers_complete(self) -> None:
        self._pending = 0
        if not self.flow.write_paused:
            self._quiet_since = self.loop.time()
        super().on_headers_complete()
        self.scope["headers"] = [*self.headers]  # fields behind the body, which come later, are none (RFC 9110, 6.5.1)
        if len(self.pipeline) > PIPELINED:
            self.transport.abort()

    def on_response_complete(self) -> None:
        super().on_response_complete()  # reads on, whatever waits already
        if self.pipeline:
            self.flow.pause_reading()

    def on_body(self, body: bytes) -> None:
        self._pending = 0
        super().on_body(body)

    def resume_writing(self) -> None:
        self._quiet_since = self.loop.time()  # a piece of the answer was read
        super().resume_writing()

    def send_400_response(self, msg: str) -> None:
        """Refuse what is no HTTP; answers to earlier requests come first, and are the last then."""
        cycle = self.cycle
        if cycle is not None and not cycle.response_complete and (cycle.response_started or not cycle.more_body):
            cycle.keep_alive = False
            return
        from brdfdb_api.http.errors import RequestError, problem_of  # loads fastapi, which workers alone need

        answer = problem_of(RequestError(400, msg))
        fields = b"".join(b"%s: %s\r\n" % field for field in (*answer.raw_headers, (b"connection", b"close")))
        self.transport.write(b"HTTP/1.1 400 Bad Request\r\n" + fields + b"\r\n" + answer.body)
        self.transport.close()

    def _should_upgrade(self) -> bool:
        return True  # the request waits for `handle_websocket_upgrade`

    def handle_websocket_upgrade(self) -> None:
        """Read a request again without its offer of another protocol, as Java's client makes one.

        An offer may be ignored. The parser reads no body after one, and stops with an error that says where it did.
        """
        error = sys.exception()
        if error is None or self.scope["method"] == "CONNECT":
            self.send_400_response("CONNECT is not offered.")
            return
        line = b"%s %s HTTP/%s\r\n" % (self.parser.get_method(), self.url, self.parser.get_http_version().encode())
        fields = (b"%s: %s\r\n" % field for field in self.headers if field[0] != b"upgrade")
        self.parser = httptools.HttpRequestParser(self)  # the other one reads nothing after a message that closes
        self._parts += [memoryview(self._part)[error.args[0] :], b"".join((line, *fields, b"\r\n"))]
