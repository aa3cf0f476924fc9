"""Requests as bytes over plain connections, and waiting: shared by tests of servers and of proxies."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator

WAIT_S = 300.0  # for anything that takes a second or two on an idle machine
LOOKUP = "/v1/materials/grey/lookup"  # of the fixture `grey_store`
POINT = f"{LOOKUP}?theta_i=10&theta_r=20"
BODY = b'{"theta_i": 10, "theta_r": 20}'
# A million points, 8 MB as .npy. The system itself stores 4 MB of an answer that nobody reads
MILLION_POINTS = {"theta_i": [[10.0]] * 1000, "theta_r": [[*range(80)] * 12 + [1.0] * 40]}


def wait_until(true: Callable[[], bool]) -> None:
    """Wait until a condition holds; fail after `WAIT_S`."""
    deadline = time.monotonic() + WAIT_S
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@contextlib.contextmanager
def in_threads(work: Callable[[], None], count: int) -> Iterator[None]:
    """Begin a block after `work` has begun in some threads; at its end, wait for them."""
    threads = [threading.Thread(target=work) for _ in range(count)]
    for thread in threads:
        thread.start()
    yield
    for thread in threads:
        thread.join()


def connected(port: int, data: bytes = b"", room: int | None = None) -> socket.socket:
    """A connection over which bytes were sent; the system stores about `room` bytes of the answer."""
    connection = socket.socket()
    connection.settimeout(WAIT_S)
    if room is not None:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, room)
    connection.connect(("127.0.0.1", port))
    connection.sendall(data)
    return connection


def all_of(connection: socket.socket) -> bytes:
    """All bytes that arrive until the server closes the connection."""
    parts = []
    with contextlib.suppress(ConnectionResetError), connection:
        while part := connection.recv(1 << 20):
            parts.append(part)
    return b"".join(parts)


def post(body: bytes, *fields: str, path: str = LOOKUP, length: int | None = None) -> bytes:
    """A POST request; its Content-Length may differ from the length of its body."""
    lines = [f"POST {path} HTTP/1.1", "Host: x", *fields, f"Content-Length: {len(body) if length is None else length}"]
    return "\r\n".join([*lines, "", ""]).encode() + body
