"""Clients that withhold, do not read or break the protocol, before the nginx and the Caddy of the documentation."""

from __future__ import annotations

import contextlib
import http.client
import json
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from tests.api import proxies
from tests.api.a_store import serving
from tests.api.connections import BODY, LOOKUP, MILLION_POINTS, POINT, WAIT_S, all_of, connected, in_threads, post

# Deadlines of 10 s and more, made short
NGINX = {" 10s;": " 1s;"}
CADDY = {"read_header 10s": "read_header 1s", "read_body 2m": "read_body 2s", "write 5m": "write 4s"}
PROXIES = {"nginx": (proxies.nginx, NGINX), "caddy": (proxies.caddy, CADDY)}


@pytest.fixture(scope="module", params=PROXIES)
def port(request: pytest.FixtureRequest, grey_store: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """The port of a proxy with short deadlines before a service."""
    started, changes = PROXIES[request.param]
    with serving(grey_store) as address:
        upstream = urlsplit(address).port or 0
        with started(tmp_path_factory.mktemp(request.param), upstream, changes) as found:
            yield found


@pytest.fixture(autouse=True)
def _others_are_served(port: int) -> Iterator[None]:
    """While a test keeps a proxy busy another client asks, and each of its requests is answered."""
    stop, found = threading.Event(), Counter[int]()

    def ask() -> None:
        while not stop.wait(0.02):
            found[_get(port)] += 1

    with in_threads(ask, 1):
        yield
        stop.set()
    found[_get(port)] += 1
    assert set(found) == {200}


def _get(port: int) -> int:
    with contextlib.closing(http.client.HTTPConnection("127.0.0.1", port, timeout=WAIT_S)) as client:
        client.request("GET", POINT)
        answer = client.getresponse()
        assert b"grey" in answer.read()
        return answer.status


def _is_refusal(answer: bytes) -> bool:
    """Return True if nothing came back, or a status that blames the client."""
    return not answer or answer.split(b" ", 2)[1][:1] == b"4"


@pytest.mark.parametrize("start", [b"", b"GET /healthz HTTP/1.1\r\nHost: x\r\nA: ", b"POST /"])
def test_a_head_that_does_not_arrive_is_cut_off(port: int, start: bytes) -> None:
    assert _is_refusal(all_of(connected(port, start)))


def test_a_head_that_arrives_byte_by_byte_is_cut_off(port: int) -> None:
    sent = 0
    with contextlib.suppress(OSError), connected(port, b"GET /healthz HTTP/1.1\r\nHost: x\r\nA: ") as connection:
        while sent < 1000:
            sent += connection.send(b"b")
            time.sleep(0.05)
    assert sent < 1000


@pytest.mark.parametrize("sent", [0, 10])
def test_a_body_that_stops_arriving_is_cut_off(port: int, sent: int) -> None:
    answer = all_of(connected(port, post(BODY[:sent], length=len(BODY))))
    assert b'"material"' not in answer  # Caddy 2.6 says 200, without content, to a client that withholds


@pytest.mark.parametrize(
    "start",
    [
        b"GET /no/such/address HTTP/1.1\r\nHost: x\r\nA: ",
        b"GET /",
        b"POST " + LOOKUP.encode() + b" HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n0\r\nA: ",
    ],
    ids=["header", "address", "trailer"],
)
def test_a_head_that_is_too_long_is_refused(port: int, start: bytes) -> None:
    with connected(port, start) as connection:
        with contextlib.suppress(ConnectionError):
            connection.sendall(b"b" * 10**6)
        assert _is_refusal(all_of(connection))


def test_an_answer_that_nobody_reads_is_cut_off(port: int) -> None:
    request = post(json.dumps(MILLION_POINTS).encode(), "Accept: application/x-npy", "Connection: close")
    assert len(all_of(connected(port, request))) > 8_000_000
    with connected(port, request, room=4096) as connection:
        time.sleep(6.0)  # longer than the deadline
        with contextlib.suppress(ConnectionResetError):
            assert len(all_of(connection)) < 8_000_000


OFFERS = {
    "HTTP/2": ("Connection: Upgrade, HTTP2-Settings", "Upgrade: h2c", "HTTP2-Settings: AAMAAABkAAQAAP__"),
    "TLS": ("Connection: upgrade", "Upgrade: TLS/1.2"),
    "websocket": ("Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13"),
}


@pytest.mark.parametrize("offer", OFFERS)
def test_bodies_beside_offers_of_other_protocols_are_read(port: int, offer: str) -> None:
    last = f"GET {POINT} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n".encode()
    answers = all_of(connected(port, post(BODY, *OFFERS[offer]) + last))
    assert answers.count(b"HTTP/1.1 200 ") == 2
    assert answers.count(b'"material":"grey"') == 2


def test_fields_behind_a_body_are_no_headers(port: int) -> None:
    head = f"POST {LOOKUP} HTTP/1.1\r\nHost: x\r\nConnection: close\r\nTransfer-Encoding: chunked\r\n\r\n"
    fields = b"Accept: application/x-npy\r\nContent-Encoding: gzip\r\nX-Request-ID: mine\r\n\r\n"
    answer = all_of(connected(port, head.encode() + b"%x\r\n%b\r\n0\r\n" % (len(BODY), BODY) + fields))
    assert answer.startswith(b"HTTP/1.1 200 ")
    assert b"application/json" in answer
    assert b"mine" not in answer


def test_a_body_that_looks_like_a_request_stays_a_body(port: int) -> None:
    inner = f"GET {POINT} HTTP/1.1\r\nHost: x\r\nConnection: Upgrade\r\nUpgrade: h2c\r\n\r\n".encode()
    request = b"POST /v1/nothing HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n"
    last = b"GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"
    answers = all_of(connected(port, request + b"%x\r\n%s\r\n0\r\n\r\n" % (len(inner), inner) + last))
    assert answers.count(b"HTTP/1.1 ") == 2
    assert b'"material"' not in answers
    assert answers.endswith(b'{"status":"ok"}')


@pytest.mark.parametrize(
    "request_",
    [b"CONNECT x:1 HTTP/1.1\r\nHost: x\r\n\r\n", b"no HTTP\r\n\r\n", post(bytes(70_000_000))],
    ids=["CONNECT", "no HTTP", "too large a body"],
)
def test_what_a_proxy_does_not_pass_on_is_refused(port: int, request_: bytes) -> None:
    with connected(port, b"") as connection:
        with contextlib.suppress(ConnectionError):
            connection.sendall(request_)
        with contextlib.suppress(ConnectionResetError):
            assert _is_refusal(connection.recv(65536))
