"""Clients that withhold bytes, read nothing or smuggle requests: others are served, and memory and time are bounded."""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from brdfdb_api.http import connection as connections
from brdfdb_api.http import middleware
from tests.api.a_store import npy, publish, serving

PATH = "/v1/materials/grey/lookup"
POINT = f"{PATH}?theta_i=10&theta_r=20"
NPY = "application/x-npy"
BODY = b'{"theta_i": 10, "theta_r": 20}'
SHORT_S = 0.4  # deadlines in these tests [s]
WAIT_S = 300.0  # for what takes a second or two where the machine has nothing else to do
LIMIT = 400_000  # bytes of a body that the service of these tests takes


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("abuse") / "store"
    publish(root, "grey", "lambert", rho=0.25)
    return root


@pytest.fixture
def port(store: Path) -> Iterator[int]:
    """A service with its own deadlines: a busy machine may hold up what a test sends."""
    with serving(store, max_body_bytes=LIMIT) as address:
        yield urlsplit(address).port or 0


@pytest.fixture
def hasty_port(monkeypatch: pytest.MonkeyPatch, port: int) -> int:
    """A service with short deadlines."""
    monkeypatch.setattr(connections, "QUIET_S", SHORT_S)
    monkeypatch.setattr(middleware, "STALLED_S", SHORT_S)
    return port


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


UPGRADES = {
    "HTTP/2": ("Connection: Upgrade, HTTP2-Settings", "Upgrade: h2c", "HTTP2-Settings: AAMAAABkAAQAAP__"),
    "TLS": ("Connection: upgrade", "Upgrade: TLS/1.2"),
    "websocket": ("Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13"),
}


@pytest.mark.parametrize("offer", UPGRADES)
@pytest.mark.parametrize("cut", [None, 40, -35, -10], ids=["whole", "head", "line", "body"])
def test_bodies_beside_offers_of_other_protocols_are_read(port: int, offer: str, cut: int | None) -> None:
    request = post(BODY, *UPGRADES[offer])
    connection = connected(port, request[:cut])
    if cut is not None:
        time.sleep(0.05)
        connection.sendall(request[cut:])
    connection.sendall(f"GET {POINT} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n".encode())
    answers = all_of(connection)
    assert answers.count(b"HTTP/1.1 200 ") == 2
    assert answers.count(b'"material":"grey"') == 2


def test_hundreds_of_offers_in_one_read_are_answered_one_by_one(port: int) -> None:
    head = "\r\n".join(["GET /healthz HTTP/1.1", "Host: x", *UPGRADES["HTTP/2"], "", ""]).encode()
    last = b"GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"
    assert all_of(connected(port, head * 900 + last)).count(b"HTTP/1.1 200 ") == 901


def test_connect_is_refused(port: int) -> None:
    answer = all_of(connected(port, b"CONNECT x:1 HTTP/1.1\r\nHost: x\r\n\r\n"))
    assert answer.startswith(b"HTTP/1.1 400 ")
    assert json.loads(answer.partition(b"\r\n\r\n")[2])["detail"] == "CONNECT is not offered."


@pytest.mark.parametrize(
    ("version", "fields"),
    [
        ("1.1", ["Connection: close, Upgrade", "Upgrade: h2c"]),
        ("1.1", ["Connection: Upgrade", "Connection: close", "Upgrade: TLS/1.2"]),
        ("1.0", ["Connection: Upgrade", "Upgrade: h2c"]),
    ],
)
def test_an_offer_of_a_client_that_closes_is_ignored_too(port: int, version: str, fields: list[str]) -> None:
    request = post(BODY, *fields).replace(b"HTTP/1.1", f"HTTP/{version}".encode())
    answer = all_of(connected(port, request))
    assert answer.startswith(b"HTTP/1.1 200 ")
    assert b'"material":"grey"' in answer


@pytest.mark.parametrize("bad", [b"CONNECT x:1 HTTP/1.1\r\nHost: x\r\n\r\n", b"no HTTP\r\n\r\n"])
def test_what_is_no_http_does_not_overtake_answers(port: int, bad: bytes) -> None:
    request = b"GET /v1/materials/grey/sphere?size=64&format=npy HTTP/1.1\r\nHost: x\r\n\r\n"
    answer = all_of(connected(port, request + bad))
    assert answer.startswith(b"HTTP/1.1 200 ")
    assert answer.count(b"HTTP/1.1 ") == 1


def test_a_kept_connection_stays_while_requests_come(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "QUIET_S", 2.0)  # longer than a busy machine holds up a request
    with contextlib.closing(http.client.HTTPConnection("127.0.0.1", port, timeout=WAIT_S)) as client:
        client.connect()
        kept = client.sock
        end = time.monotonic() + 5.0  # the server looks once a second
        while time.monotonic() < end:
            client.request("GET", POINT)
            assert client.getresponse().read()
            time.sleep(SHORT_S / 4)
        assert client.sock is kept


def test_requests_that_nobody_waits_for_stay_outside(hasty_port: int) -> None:
    request = b"GET /v1/materials/grey/download.zarr HTTP/1.1\r\nHost: x\r\n\r\n"
    sent = 0
    with contextlib.closing(connected(hasty_port, room=4096)) as connection, contextlib.suppress(OSError):
        connection.settimeout(1.0)
        while sent < 30_000_000:
            sent += connection.send(request * 1000)
    assert sent < 30_000_000


def test_a_body_that_drips_after_a_burst_is_refused_in_time(hasty_port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(middleware, "RATE", 1000)  # a burst of 100 kB is no credit for 100 s
    body = npy(np.full((3_000, 4), 30.0))
    begin = time.monotonic()
    with connected(hasty_port, post(body[:-100], f"Content-Type: {NPY}", length=len(body))) as connection:
        with contextlib.suppress(OSError):
            while time.monotonic() < begin + 20.0 and not _readable(connection):
                connection.sendall(b"x")
                time.sleep(SHORT_S / 4)
        assert connection.recv(65536).startswith(b"HTTP/1.1 408 ")


def _readable(connection: socket.socket) -> bool:
    return bool(select.select([connection], [], [], 0.0)[0])


@pytest.mark.parametrize("offer", ["h2c", "TLS/1.2"])
def test_a_body_that_looks_like_heads_stays_a_body_also_after_an_early_refusal(port: int, offer: str) -> None:
    # 404 comes while the body arrives; what it contains must be no request, whatever is done to offers in heads
    inner = f"GET {POINT} HTTP/1.1\r\nHost: x\r\nConnection: Upgrade\r\nUpgrade: {offer}\r\n\r\n".encode()
    chunk = b"%x\r\n%s\r\n" % (len(inner), inner)
    connection = connected(
        port, b"POST /v1/nothing HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n" + chunk[:20]
    )
    time.sleep(0.1)
    connection.sendall(chunk[20:] + b"0\r\n\r\n")
    connection.sendall(b"GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
    answers = all_of(connection)
    assert answers.count(b"HTTP/1.1 ") == 2
    assert b'"material"' not in answers
    assert answers.endswith(b'{"status":"ok"}')


@pytest.mark.parametrize("start", [b"", b"GET /healthz HTTP/1.1\r\nHost: x\r\nA: ", b"POST /"])
def test_a_connection_whose_head_does_not_arrive_is_ended(hasty_port: int, start: bytes) -> None:
    begin = time.monotonic()
    assert all_of(connected(hasty_port, start)) == b""
    assert SHORT_S <= time.monotonic() - begin < WAIT_S


def test_a_head_that_arrives_byte_by_byte_is_ended_too(hasty_port: int) -> None:
    connection, sent = connected(hasty_port, b"GET /healthz HTTP/1.1\r\nHost: x\r\nA: "), 0
    with contextlib.suppress(OSError):
        while sent < 400:
            sent += connection.send(b"b")
            time.sleep(0.05)
    connection.close()
    assert sent < 400


def test_a_body_that_stops_arriving_is_refused_in_time(hasty_port: int) -> None:
    with connected(hasty_port, post(BODY[:10], length=len(BODY))) as connection:
        answer = connection.recv(65536)
    assert answer.startswith(b"HTTP/1.1 408 ")
    assert json.loads(answer.partition(b"\r\n\r\n")[2])["detail"].startswith("the body did not arrive in time")


def test_large_bodies_that_are_withheld_keep_out_large_ones_alone_and_not_for_good(
    hasty_port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(middleware, "STALLED_S", 3.0)
    array = npy(np.full((10_000, 4), 30.0))
    large = post(array, f"Content-Type: {NPY}")
    assert middleware.SMALL < len(array) < middleware.BODIES * LIMIT < 2 * len(array)
    refusal = b""
    while not refusal.startswith(b"HTTP/1.1 503 "):  # unless that came first
        with contextlib.closing(connected(hasty_port, large[:-1])):
            time.sleep(0.2)
            refusal = _answer(hasty_port, large)
            small = _answer(hasty_port, post(BODY))
    assert b"\r\nretry-after: 3\r\n" in refusal
    assert small.startswith(b"HTTP/1.1 200 ")
    with contextlib.closing(connected(hasty_port, large[:-1])):
        wait_until(lambda: _answer(hasty_port, large).startswith(b"HTTP/1.1 200 "))


def _answer(port: int, request: bytes) -> bytes:
    """The first piece of the answer to a request."""
    with connected(port, request) as connection:
        return connection.recv(65536)


def test_answers_that_are_not_read_wait_in_little_room_and_are_ended(
    hasty_port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "QUIET_S", 5.0)
    monkeypatch.setattr(middleware, "ROOM", {"memory": 9_000_000, "files": 9_000_000})  # one answer in each
    # a million numbers: the system itself keeps 4 MB of an answer that is not read
    rows = {"theta_i": [[10.0]] * 1000, "theta_r": [[*range(80)] * 12 + [1.0] * 40]}
    request = post(json.dumps(rows).encode(), path=f"{PATH}?format=npy")
    with contextlib.ExitStack() as stack:
        for _ in range(4):
            stack.enter_context(contextlib.closing(connected(hasty_port, request, 4096)))
        wait_until(lambda: b" 503 " in _answer(hasty_port, request))  # in memory and in files there is no more room
        assert get(hasty_port)[0] == 200
        whole = b""

        def answered() -> bool:
            nonlocal whole
            whole = all_of(connected(hasty_port, request.replace(b"Host: x", b"Host: x\r\nConnection: close")))
            return whole.startswith(b"HTTP/1.1 200 ")

        wait_until(answered)  # those that were not read are ended
    np.testing.assert_allclose(np.frombuffer(whole[-8_000_000:]), 0.25 / np.pi, rtol=1e-6)


SCRIPT = """
import sys
from pathlib import Path
from brdfdb_api import server
ended = server._ended

async def told(signs):
    if not await signs.read(64):
        return "ended"
    print("a worker gives its first sign of life", flush=True)
    return await ended(signs)

server._ended = told
{}
server.serve(Path(sys.argv[1]), "127.0.0.1", 0, workers=2)
"""


@contextlib.contextmanager
def process(store: Path, change: str, **pipes: int) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """`brdfdb serve` with two workers and a constant that is changed; its process and port."""
    command = [sys.executable, "-c", SCRIPT.format(change), str(store)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, **pipes) as served:
        try:
            assert served.stdout is not None
            port = int(served.stdout.readline().rsplit(":", 1)[1].strip(" /\n"))
            for _ in range(2):
                assert served.stdout.readline() == "a worker gives its first sign of life\n"
            wait_until(lambda: get(port, "/readyz")[0] == 200)
            assert len(_children(served.pid)) == 2
            yield served, port
        finally:
            served.kill()


def _children(pid: int) -> set[int]:
    return {int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()}


def test_a_log_that_nobody_reads_stops_neither_answers_nor_the_end(store: Path) -> None:
    with process(store, "pass", stderr=subprocess.PIPE) as (served, port):
        query = f"{POINT}&phi_r={'0' * 3000}"
        for _ in range(100):  # 300 kB of lines; a pipe holds 64
            assert get(port, query)[0] == 200
        served.send_signal(signal.SIGTERM)
        assert served.wait(WAIT_S) == 0


def test_a_halted_worker_is_replaced_and_does_not_keep_the_server_from_ending(store: Path) -> None:
    change = "server.LOADED_S, server.HALTED_S, server.STOPPED_S = 6.0, 6.0, 1.0"  # after the first sign of life
    with process(store, change, stderr=subprocess.DEVNULL) as (served, port):
        before = _children(served.pid)
        os.kill(min(before), signal.SIGSTOP)
        wait_until(lambda: len(_children(served.pid) - before) == 1)
        assert not Path(f"/proc/{min(before)}").exists()
        for _ in range(4):
            assert get(port)[0] == 200
        os.kill(max(before), signal.SIGSTOP)
        served.send_signal(signal.SIGTERM)
        assert served.wait(WAIT_S) == 0
    assert not Path(f"/proc/{max(before)}").exists()
