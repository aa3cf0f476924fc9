"""A store behind a service that is not there, is another, does not answer, or stands behind a proxy."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brdfdb
from brdfdb.errors import StoreError
from brdfdb.store import http_client
from tests.api import proxies
from tests.api.a_store import angles, npy, same, serving


@pytest.fixture(scope="module")
def address(root: Path) -> Iterator[str]:
    with serving(root) as url:
        yield url


def test_a_server_that_is_not_there(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with pytest.raises(StoreError, match=rf"^no answer from http://127.0.0.1:{port}: Connection refused$"):
        brdfdb.open(f"http://127.0.0.1:{port}")
    with serving(tmp_path) as url, pytest.raises(StoreError, match=r"^no store at "):
        brdfdb.open(url)


def test_an_address_that_is_none() -> None:
    for url in [
        *("http://", "http://host:port", "ftp://host", "http://host/?a=1", "host:8000"),
        *("http://me:secret@host", "http://my host", "http://host/\u00e4", "http://host/\n"),
    ]:
        with pytest.raises(ValueError, match=r"^url: '.*' is not an address"):
            http_client.RemoteStore(url)
    with pytest.raises(StoreError, match=r"^no answer from http://a\.\.b: "):
        http_client.RemoteStore("http://a..b")


@pytest.mark.parametrize(("scheme", "port"), [("http", 80), ("https", 443)])
def test_an_address_of_ipv6_without_a_port(scheme: str, port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def refuse(address: tuple[str, int], *_: Any) -> socket.socket:
        asked.append(address)
        raise ConnectionRefusedError("nobody")

    monkeypatch.setattr(socket, "create_connection", refuse)
    with pytest.raises(StoreError, match=r"nobody$"):
        http_client.RemoteStore(f"{scheme}://[::1]/brdf/")
    assert asked == [("::1", port)]


def test_a_service_that_does_not_answer_in_time() -> None:
    for timeout_s in [0.0, -1.0, np.inf, np.nan]:
        with pytest.raises(ValueError, match=r"^timeout_s: \S+ is outside \(0, 9\.\d+e\+09\] s$"):
            http_client.RemoteStore("http://127.0.0.1:1", timeout_s)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"http://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(StoreError, match=f"^no answer from {url}: timed out$"):
            http_client.RemoteStore(url, timeout_s=0.05)


@contextmanager
def answering(*answers: bytes, close: bool = True) -> Iterator[tuple[str, list[bytes]]]:
    """A server that sends each of its answers to the beginning of one request, on a connection of its own."""
    asked: list[bytes] = []
    with socket.create_server(("127.0.0.1", 0)) as listener, ExitStack() as held:
        listener.settimeout(300.0)  # a client that asks less often fails the test, and does not hang it

        def work() -> None:
            for answer in answers:
                connection, _ = listener.accept()
                held.enter_context(connection)
                asked.append(connection.recv(65536))
                connection.sendall(answer)
                if close:
                    connection.close()

        thread = threading.Thread(target=work)
        thread.start()
        try:
            yield f"http://127.0.0.1:{listener.getsockname()[1]}", asked
        finally:
            thread.join()


def answer(content: bytes, status: str = "200 OK", *lines: str) -> bytes:
    """An answer of a server that says how long it is."""
    head = "\r\n".join([f"HTTP/1.1 {status}", f"Content-Length: {len(content)}", *lines])
    return head.encode() + b"\r\n\r\n" + content


PAGE = b"<html>\r\n<head><title>nginx</title></head></html>\r\n"
READY = answer(b'{"materials":3}')
TOO_LARGE_STATUS = "413 Request Entity Too Large"
TOO_LARGE = answer(PAGE, TOO_LARGE_STATUS, "Content-Type: text/html", "Connection: close")
FAR_TOO_LARGE = bytes(16_000_000)  # more than sockets store: it cannot be sent to a server that does not read it
NO_SERVICE = "^http://[^ ]+ is not a brdfdb service$"
BUSY = answer(b'{"detail": "the server is busy"}', "503 Service Unavailable", "Retry-After: 1")


def test_a_busy_service_is_asked_again_when_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    pauses: list[float] = []
    monkeypatch.setattr(http_client.time, "sleep", pauses.append)
    with answering(BUSY, READY, BUSY, READY) as (url, asked):  # it is opened, and counts its materials
        assert len(http_client.RemoteStore(url)) == 3
    assert (pauses, len(asked)) == ([1, 1], 4)


def test_a_wait_that_is_too_long_is_an_error_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_client.time, "sleep", lambda _: pytest.fail("waits"))
    for wait, timeout_s in [("60", 60.0), ("1", 0.5), ("Wed, 21 Oct 2026 07:28:00 GMT", 60.0)]:
        refusal = BUSY.replace(b"Retry-After: 1", f"Retry-After: {wait}".encode())
        with answering(refusal) as (url, _), pytest.raises(StoreError, match=r"^the server is busy$"):
            http_client.RemoteStore(url, timeout_s=timeout_s)


def test_a_connection_that_was_closed_in_between_is_made_anew_once() -> None:
    with answering(READY, READY) as (url, asked):
        assert len(http_client.RemoteStore(url)) == 3
    assert len(asked) == 2
    assert all(b"Accept-Encoding: identity" in request for request in asked)
    for answers in ([READY, b""], [b""]):  # a new connection that breaks is not tried again
        with answering(*answers) as (url, asked), pytest.raises(StoreError, match=f"^no answer from {url}: "):
            len(http_client.RemoteStore(url))
        assert len(asked) == len(answers)


def test_an_answer_in_chunks() -> None:
    chunks = b'4\r\n{"ma\r\nb\r\nterials":3}\r\n0\r\n\r\n'
    with answering(b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n" + chunks) as (url, _):
        assert http_client.Service(url).document("/readyz") == {"materials": 3}


def test_another_server_at_the_address() -> None:
    unexplained = ("502 Bad Gateway", "504 Gateway Time-out", "503 Service Unavailable")
    for found, error in [
        *((answer(PAGE, status), rf"^http://[^ ]+ answered {status} without a reason$") for status in unexplained),
        (answer(b"\xff\xfe", "422 "), "^http://[^ ]+ answered 422 without a reason$"),
        (answer(b'{"detail": "Not Found"}', "404 Not Found"), "^http://[^ ]+ answered 404 Not Found: Not Found$"),
        (answer(b"", "304 Not Modified"), "^http://[^ ]+ answered 304 Not Modified without a reason$"),
        (TOO_LARGE, f"^http://[^ ]+ answered {TOO_LARGE_STATUS} without a reason$"),
        *((answer(content), NO_SERVICE) for content in (PAGE, b"[]", b"", b'{"title": "\xe4"}')),
        *((answer(content), NO_SERVICE) for content in (b'{"status": "ready"}', b'{"materials": "3"}')),
        (b"HTTP/1.1 200 OK\r\nContent-Length: 99\r\n\r\n{}", "^no answer from http://[^ ]+: IncompleteRead"),
        (b"SSH-2.0\r\n", "^no answer from http://[^ ]+: SSH-2.0$"),
    ]:
        with answering(found) as (url, _), pytest.raises(StoreError, match=error):
            http_client.RemoteStore(url)
    numbers = npy(np.zeros((3, 2)))
    for content in [
        *(PAGE, b"", b"PK\x03\x04", numbers[:-1], numbers[:20], numbers.replace(b"(3, 2), ", b"(3, 2 , ")),
        *(npy(np.zeros(shape)) for shape in [(2, 3), 6, (3, 2, 1), ()]),
        *(npy(np.zeros((3, 2), dtype)) for dtype in ("f4", "i8", ">f8", "c16", "S8", "O")),
    ]:
        with answering(answer(content)) as (url, _), pytest.raises(StoreError, match=NO_SERVICE):
            http_client.Service(url).array("/v1", (3, 2))


def test_a_redirect_is_reported_and_not_followed() -> None:
    for status in ["301 Moved Permanently", "302 Found", "307 Temporary Redirect", "308 Permanent"]:
        moved = answer(PAGE, status, "Location: https://there.example/brdf/v1?a=1")
        for body in (None, {"theta_i": 0}):
            with answering(moved) as (url, _), pytest.raises(StoreError) as raised:
                http_client.Service(f"{url}/brdf/").document("/v1?a=1", body)
            where = "https://there.example/brdf/v1; open the address that the service itself has"
            assert str(raised.value) == f"{url}/brdf redirects /v1 to {where}"


# Behind a proxy


def test_a_body_that_is_refused_before_it_was_read() -> None:
    with answering(TOO_LARGE, READY, TOO_LARGE, READY) as (url, asked):
        there = http_client.Service(url)
        for _ in range(2):  # the second time, the connection is one that was closed in between
            with pytest.raises(StoreError, match=f"^{url} answered {TOO_LARGE_STATUS} without a reason$"):
                there.content("/v1", FAR_TOO_LARGE, http_client.NPY)
            assert there.document("/readyz") == {"materials": 3}
    assert [request[:4] for request in asked] == [b"POST", b"GET ", b"POST", b"GET "]


def test_a_connection_on_which_a_body_was_not_sent_whole_is_not_used_again() -> None:
    with answering(answer(PAGE, "413"), READY, close=False) as (url, asked):
        there = http_client.Service(url, timeout_s=3.0)
        with pytest.raises(StoreError, match=f"^{url} answered 413 without a reason$"):
            there.content("/v1", FAR_TOO_LARGE, http_client.NPY)
        assert there.document("/readyz") == {"materials": 3}
    assert len(asked) == 2


@contextmanager
def behind_nginx(address: str, folder: Path, **limits: str) -> Iterator[str]:
    """The address of an nginx before a service, with the limits that it has unless it is told otherwise."""
    of_nginx = {"body": "1m", "headers": "4 8k"} | limits
    changes = {
        "client_max_body_size 64m": f"client_max_body_size {of_nginx['body']}",
        "large_client_header_buffers 4 16k": f"large_client_header_buffers {of_nginx['headers']}",
    }
    with proxies.nginx(folder, int(address.rpartition(":")[2]), changes) as port:
        yield f"http://127.0.0.1:{port}"


def refused_by_nginx(folder: Path) -> int:
    """Return the number of requests that were too large."""
    log = (folder / "error.log").read_text(encoding="utf-8")
    return log.count("too large body") + log.count("too long URI")


def test_a_proxy_passes_as_much_as_is_sent_at_once(address: str, root: Path, tmp_path: Path) -> None:
    with behind_nginx(address, tmp_path) as url:
        there, here = brdfdb.open(url)["copper-foil"], brdfdb.open(root)["copper-foil"]
        given = [np.tile(angle, 100) for angle in angles()]
        same(there.lookup(*given, 500.5), here.lookup(*given, 500.5))
        many = np.linspace(400, 700, 1003)
        same(there.lookup(0.1, 0.2, 0.3, 0.4, many), here.lookup(0.1, 0.2, 0.3, 0.4, many))
    assert refused_by_nginx(tmp_path) == 0


def test_what_is_too_large_for_a_proxy_is_halved(address: str, root: Path, tmp_path: Path) -> None:
    with behind_nginx(address, tmp_path, body="4000") as url:
        there, here = brdfdb.open(url)["copper-foil"], brdfdb.open(root)["copper-foil"]
        given = angles()
        same(there.lookup(*given), here.lookup(*given))
        assert refused_by_nginx(tmp_path) == 2  # bodies of 400 and 200 points
        same(there.specular_reflectance(given[0]), here.specular_reflectance(given[0]))
        assert refused_by_nginx(tmp_path) == 3


def test_one_point_that_is_too_large_for_a_proxy_is_an_error() -> None:
    for points, requests in [(8, 4), (3, 2), (1, 1)]:
        asked: list[slice] = []

        def refuse(rows: slice, asked: list[slice] = asked) -> None:
            asked.append(rows)
            raise http_client.TooLargeError("too large")

        with pytest.raises(StoreError, match="too large"):
            http_client._in_parts(refuse, np.empty(points), 32_000)
        assert len(asked) == requests
