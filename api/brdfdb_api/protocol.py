"""HTTP as uvicorn speaks it, with a limit to heads and trailers, and an end at which no connection is dropped."""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import socket
import struct
import sys
from typing import Any

import uvicorn
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

HEAD_BYTES = 64 * 2**10  # httptools reads no longer addresses
QUEUE_S = 0.1  # for the event loop to accept what waits in a socket
SO_ATTACH_FILTER = 26  # of Linux, without a name in Python
LAST_S = 0.5  # from the word to stop to the last byte of a request that is answered still


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
        self._pending += len(data)
        super().data_received(data)  # callbacks below set it to 0
        if self._pending > HEAD_BYTES and not self.transport.is_closing():
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
        """Close when what is asked is answered; a request may be under way on a connection that looks idle."""
        self._stopping = True
        if self.cycle is None or self.cycle.response_complete:
            self.loop.call_later(LAST_S, super().shutdown)
        else:
            super().shutdown()


class PatientServer(uvicorn.Server):
    """A server that answers, when it stops, the connections that the kernel took for it until then."""

    shared = False  # whether the sockets are those of other workers, too

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        for listener in [] if self.shared else sockets or []:
            keep_out(listener)
        await asyncio.sleep(QUEUE_S)
        await super().shutdown(sockets)


def keep_out(listener: socket.socket) -> None:
    """Let no new connection into a socket that listens, while those that wait in it can still be accepted.

    What waits when a socket is closed is reset. Linux drops here what begins a connection; it is sent again a second
    later, and refused if the socket is closed by then. Where there is no such filter, all goes on.
    """
    if sys.platform == "linux":
        # BPF: the byte of flags, SYN or not, dropped or let through
        steps = ((0x30, 0, 0, 13), (0x45, 0, 1, 2), (0x06, 0, 0, 0), (0x06, 0, 0, 0xFFFFFFFF))
        program = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *step) for step in steps))
        attached = struct.pack("HP", len(steps), ctypes.addressof(program))
        with contextlib.suppress(OSError):
            listener.setsockopt(socket.SOL_SOCKET, SO_ATTACH_FILTER, attached)
