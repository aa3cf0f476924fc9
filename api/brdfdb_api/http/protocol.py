"""HTTP as uvicorn speaks it, with a limit to heads and trailers, and an end that lets requests finish."""

from __future__ import annotations

import re
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

HEAD_BYTES = 64 * 2**10  # limit on a head [byte]; httptools reads no longer addresses
# Java's client offers HTTP/2. The offer may be ignored, but the parser reads no body after it
UPGRADE = re.compile(rb"\r\nupgrade: h2c(?=\r|$)", re.IGNORECASE)
LAST_S = 0.5  # time after the signal to stop in which a request may still arrive completely [s]


class BoundedProtocol(HttpToolsProtocol):
    """One connection: 400, and its end, where a head or a trailer does not end within `HEAD_BYTES`.

    The parser keeps address and headers until they are whole, and names no limit. Bytes are counted as they come, since
    the last head that was whole or the last piece of a body; what one read of the socket brings, 256 kB, may be beyond.
    """

    def __init__(self, *args: Any, **keywords: Any) -> None:
        super().__init__(*args, **keywords)
        self._pending = 0
        self._stopping = False

    def data_received(self, data: bytes) -> None:
        if b"pgrade: h2c" in data and (self.cycle is None or self.cycle.response_complete):
            head, end, rest = data.partition(b"\r\n\r\n")
            data = UPGRADE.sub(b"", head) + end + rest
        self._pending += len(data)
        super().data_received(data)  # the callbacks below set it to 0
        if self._pending > HEAD_BYTES and not self.transport.is_closing():
            self.logger.warning("Address and headers are longer than %d bytes.", HEAD_BYTES)
            self.send_400_response(f"Address and headers are longer than {HEAD_BYTES} bytes.")

    def on_headers_complete(self) -> None:
        self._pending = 0
        super().on_headers_complete()
        if self._stopping:
            self.cycle.keep_alive = False

    def on_body(self, body: bytes) -> None:
        self._pending = 0
        super().on_body(body)

    def shutdown(self) -> None:
        """Close after requests in flight are completed. A connection that looks idle may have one under way."""
        self._stopping = True
        if self.cycle is None or self.cycle.response_complete:
            self.loop.call_later(LAST_S, super().shutdown)
        else:
            super().shutdown()
