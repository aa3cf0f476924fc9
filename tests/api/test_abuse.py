"""Clients that withhold bodies or read nothing: others are served, and memory is bounded. Deadlines are a proxy's."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from brdfdb_api.http import middleware
from tests.api.a_store import NPY, npy, serving
from tests.api.connections import BODY, LOOKUP, MILLION_POINTS, POINT, all_of, connected, post, wait_until

LIMIT = 400_000  # largest body that the service accepts [bytes]


@pytest.fixture
def port(grey_store: Path) -> Iterator[int]:
    with serving(grey_store, max_body_bytes=LIMIT) as address:
        yield urlsplit(address).port or 0


def first_piece(port: int, request: bytes) -> bytes:
    """The first piece of the answer to a request."""
    with connected(port, request) as connection:
        return connection.recv(65536)


def test_large_bodies_that_are_withheld_keep_out_large_ones_alone_and_not_for_good(port: int) -> None:
    array = npy(np.full((10_000, 4), 30.0))
    large = post(array, f"Content-Type: {NPY}")
    assert middleware.SMALL < len(array) < middleware.BODIES * LIMIT < 2 * len(array)
    refusal = b""
    while not refusal.startswith(b"HTTP/1.1 503 "):  # unless that came first
        with contextlib.closing(connected(port, large[:-1])):
            time.sleep(0.2)
            refusal = first_piece(port, large)
            small = first_piece(port, post(BODY))
    assert b"\r\nretry-after: 10\r\n" in refusal
    assert small.startswith(b"HTTP/1.1 200 ")
    wait_until(lambda: first_piece(port, large).startswith(b"HTTP/1.1 200 "))


def test_answers_that_are_not_read_wait_in_little_room(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(middleware, "ROOM", {"memory": 9_000_000, "files": 9_000_000})  # one answer in each
    request = post(json.dumps(MILLION_POINTS).encode(), path=f"{LOOKUP}?format=npy")
    with contextlib.ExitStack() as stack:
        for _ in range(4):
            stack.enter_context(contextlib.closing(connected(port, request, 4096)))
        wait_until(lambda: b" 503 " in first_piece(port, request))  # in memory and in files there is no more room
        assert first_piece(port, f"GET {POINT} HTTP/1.1\r\nHost: x\r\n\r\n".encode()).startswith(b"HTTP/1.1 200 ")
    answer = b""

    def answered() -> bool:
        nonlocal answer
        answer = all_of(connected(port, request.replace(b"Host: x", b"Host: x\r\nConnection: close")))
        return answer.startswith(b"HTTP/1.1 200 ")

    wait_until(answered)
    np.testing.assert_allclose(np.frombuffer(answer[-8_000_000:]), 0.25 / np.pi, rtol=1e-6)
