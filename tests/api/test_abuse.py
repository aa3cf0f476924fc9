"""Clients that withhold bodies or read nothing: others are served, and memory is bounded. Deadlines are a proxy's."""

from __future__ import annotations

import contextlib
import http.client
import json
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from brdfdb_api.http import middleware
from tests.api.a_store import npy, publish, serving

PATH = "/v1/materials/grey/lookup"
POINT = f"{PATH}?theta_i=10&theta_r=20"
NPY = "application/x-npy"
BODY = b'{"theta_i": 10, "theta_r": 20}'
WAIT_S = 300.0  # for what takes a second or two where the machine has nothing else to do
LIMIT = 400_000  # bytes of a body that the service of these tests takes


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("abuse") / "store"
    publish(root, "grey", "lambert", rho=0.25)
    return root


@pytest.fixture
def port(store: Path) -> Iterator[int]:
    with serving(store, max_body_bytes=LIMIT) as address:
        yield urlsplit(address).port or 0


def connected(port: int, data: bytes = b"", room: int | None = None) -> socket.socket:
    """A connection over which bytes were sent; the system keeps about `room` bytes of what comes back."""
    connection = socket.socket()
    connection.settimeout(WAIT_S)
    if room is not None:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, room)
    connection.connect(("127.0.0.1", port))
    connection.sendall(data)
    return connection


def all_of(connection: socket.socket) -> bytes:
    """Return what comes until the server closes the connection."""
    parts = []
    with contextlib.suppress(ConnectionResetError):
        while part := connection.recv(1 << 20):
            parts.append(part)
    connection.close()
    return b"".join(parts)


def get(port: int, path: str = POINT) -> tuple[int, bytes]:
    with contextlib.closing(http.client.HTTPConnection("127.0.0.1", port, timeout=WAIT_S)) as client:
        client.request("GET", path)
        answer = client.getresponse()
        return answer.status, answer.read()


def post(body: bytes, *fields: str, path: str = PATH, length: int | None = None) -> bytes:
    lines = [f"POST {path} HTTP/1.1", "Host: x", *fields, f"Content-Length: {len(body) if length is None else length}"]
    return "\r\n".join([*lines, "", ""]).encode() + body


def wait_until(true: Callable[[], bool]) -> None:
    deadline = time.monotonic() + WAIT_S
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_large_bodies_that_are_withheld_keep_out_large_ones_alone_and_not_for_good(port: int) -> None:
    array = npy(np.full((10_000, 4), 30.0))
    large = post(array, f"Content-Type: {NPY}")
    assert middleware.SMALL < len(array) < middleware.BODIES * LIMIT < 2 * len(array)
    refusal = b""
    while not refusal.startswith(b"HTTP/1.1 503 "):  # unless that came first
        with contextlib.closing(connected(port, large[:-1])):
            time.sleep(0.2)
            refusal = _answer(port, large)
            small = _answer(port, post(BODY))
    assert b"\r\nretry-after: 10\r\n" in refusal
    assert small.startswith(b"HTTP/1.1 200 ")
    wait_until(lambda: _answer(port, large).startswith(b"HTTP/1.1 200 "))


def _answer(port: int, request: bytes) -> bytes:
    """The first piece of the answer to a request."""
    with connected(port, request) as connection:
        return connection.recv(65536)


def test_answers_that_are_not_read_wait_in_little_room(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(middleware, "ROOM", {"memory": 9_000_000, "files": 9_000_000})  # one answer in each
    # a million numbers: the system itself keeps 4 MB of an answer that is not read
    rows = {"theta_i": [[10.0]] * 1000, "theta_r": [[*range(80)] * 12 + [1.0] * 40]}
    request = post(json.dumps(rows).encode(), path=f"{PATH}?format=npy")
    with contextlib.ExitStack() as stack:
        for _ in range(4):
            stack.enter_context(contextlib.closing(connected(port, request, 4096)))
        wait_until(lambda: b" 503 " in _answer(port, request))  # in memory and in files there is no more room
        assert get(port)[0] == 200
    whole = b""

    def answered() -> bool:
        nonlocal whole
        whole = all_of(connected(port, request.replace(b"Host: x", b"Host: x\r\nConnection: close")))
        return whole.startswith(b"HTTP/1.1 200 ")

    wait_until(answered)
    np.testing.assert_allclose(np.frombuffer(whole[-8_000_000:]), 0.25 / np.pi, rtol=1e-6)
