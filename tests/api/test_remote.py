"""A store behind a service: the same code, and the same numbers, as with the directory."""

from __future__ import annotations

import http.client
import pickle
import shutil
import socket
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brdfdb
from brdfdb import remote
from brdfdb.geometry import unit_vector
from brdfdb.store import Store, StoreError, UnknownMaterialError, UnknownRevisionError
from tests.api.a_store import npy, publish, serving

# Of the value plus the median; 2.7e-14 is the worst measured, on the flanks of copper: degrees round the angles
AGREEMENT = 3e-14
KEPT = ("white-tile", "r000001")
NAMES = ("white-tile", "grey-felt", "brushed-metal", "copper-foil")


@pytest.fixture(scope="module")
def address(root: Path) -> Iterator[str]:
    with serving(root) as url:
        yield url


@pytest.fixture(params=["directory", "service"])
def opened(request: pytest.FixtureRequest, root: Path, address: str) -> Any:
    """The store, opened in one way and in the other."""
    return brdfdb.open(root if request.param == "directory" else address)


def angles(count: int = 400) -> list[np.ndarray]:
    """Light and viewer [rad] everywhere, also below the horizon, and every other viewer near the mirror direction."""
    rng = np.random.default_rng(7)
    theta_i, theta_r = rng.uniform(0.0, 1.7, (2, count))
    phi_i, phi_r = rng.uniform(-20.0, 20.0, (2, count))
    theta_r[::2], phi_r[::2] = np.abs(theta_i[::2] + rng.normal(0.0, 0.05, count // 2)), phi_i[::2] + np.pi
    return [theta_i, phi_i, theta_r, phi_r]


def same(found: Any, expected: Any, tolerance: float = AGREEMENT) -> None:
    assert (np.shape(found), np.result_type(found)) == (np.shape(expected), np.result_type(expected))
    np.testing.assert_array_equal(np.equal(found, 0.0), np.equal(expected, 0.0))
    atol = tolerance * np.nanmedian(np.abs(expected)) if np.size(expected) else 0.0
    np.testing.assert_allclose(found, expected, rtol=tolerance, atol=atol)


# The same code, from a directory and from a service


def test_it_is_a_mapping(opened: Any) -> None:
    assert list(opened) == sorted(NAMES)
    assert len(opened) == 4
    assert "grey-felt" in opened
    assert not any(
        name in opened for name in ("grey-fell", "grey", "", "../grey-felt", "\ud800", "a" * 100_000, None, 7)
    )


def test_what_lists_show(opened: Any) -> None:
    line = opened.summary("grey-felt")
    assert (line["title"], line["model"], line["revision"]) == ("Test grey-felt", "oren_nayar", "r000001")
    assert opened.head("grey-felt") == "r000001"
    assert opened.revisions("grey-felt") == ["r000001"]
    assert opened.attributes("grey-felt")["parameters"]["sigma_deg"] == 20.0
    assert opened["grey-felt"].attrs["source"] == "no paper, grey-felt"


@pytest.mark.parametrize("ask", ["__getitem__", "summary", "head", "attributes", "revisions", "dataset"])
@pytest.mark.parametrize("name", ["grey-fell", "GREY-FELT", "..", "grey-felt/..", ""])
def test_an_unknown_material_names_the_closest(opened: Any, ask: str, name: str) -> None:
    with pytest.raises(UnknownMaterialError, match=r"^no material '.*' in the store") as raised:
        getattr(opened, ask)(name)
    assert raised.value.name == name
    assert raised.value.closest[:1] == (["grey-felt"] if "grey" in name else [])


def test_an_unknown_revision(opened: Any) -> None:
    with pytest.raises(UnknownRevisionError, match=r"^grey-felt has no revision 'r000007'; the current one is"):
        opened.table("grey-felt", "r000007")
    with pytest.raises(UnknownMaterialError):
        opened.table("grey-fell", "r000001")


@pytest.mark.parametrize(
    ("name", "arguments", "said"),
    [
        ("grey-felt", (2.0, 0.0, 4.0, 0.0), r"^theta_r: 4 rad \(229.183 degrees\) is outside \[0, pi\] rad$"),
        ("grey-felt", (1.0, np.inf, 1.0, 0.0), r"^phi_i: inf rad is outside \[-1e\+15, 1e\+15\] rad$"),
        ("grey-felt", ("1", 0.0, 1.0, 0.0), r"^theta_i: '1' is not a number of radians$"),
        ("grey-felt", ([1.0, 2.0], 0.0, [1.0, 2.0, 3.0], 0.0), "shape mismatch"),
        ("grey-felt", (1.0, 0.0, 1.0, 0.0, np.nan), "^wavelength_nm: nan is not a positive number of nanometres$"),
        ("copper-foil", (1.0, 0.0, 1.0, 0.0, 300), r"^wavelength_nm: 300 is outside \[400, 700\] nm of copper-foil$"),
        ("copper-foil", (1.0, 0.0, 1.0, 0.0, [[500]]), "^wavelength_nm: 2 axes; allowed are"),
    ],
)
def test_wrong_arguments_are_refused_in_the_same_words(opened: Any, name: str, arguments: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        opened[name].lookup(*arguments)


def test_an_error_that_is_not_stated(opened: Any) -> None:
    assert opened["white-tile"].error is None
    with pytest.raises(ValueError, match=r"^with_error: the table of white-tile states no error; build it anew$"):
        opened["white-tile"].lookup(0.5, 0.0, 0.5, 0.0, with_error=True)


# The same numbers


@pytest.fixture(params=NAMES)
def pair(request: pytest.FixtureRequest, root: Path, address: str) -> tuple[Any, Any]:
    """A table behind the service, and the same in the directory."""
    return brdfdb.open(address)[request.param], brdfdb.open(root)[request.param]


def test_what_a_table_says_of_itself(pair: Any) -> None:
    there, here = pair
    assert (there.name, there.revision, there.anisotropic) == (here.name, here.revision, here.anisotropic)
    assert there.attrs == {key: value for key, value in here.attrs.items() if key != "request"}
    assert there.error == here.error
    assert list(there.axes_deg) == list(here.axes_deg)
    for axis in here.axes_deg:
        np.testing.assert_array_equal(there.axes_deg[axis], here.axes_deg[axis])
    np.testing.assert_array_equal(there.wavelength_nm, here.wavelength_nm)


@pytest.mark.parametrize("wavelength_nm", [None, 455.5, [455.5], (650, 450), []], ids=str)
def test_lookups_agree(pair: Any, wavelength_nm: Any) -> None:
    there, here = pair
    theta_i, phi_i, theta_r, phi_r = angles()
    shapes = [(theta_i[:7, None], 0.25, theta_r[:9], phi_r[:9]), (theta_i, phi_i, theta_r, phi_r), (0.5, 0.0, 0.5, 3.1)]
    for given in [*shapes, ([], 0.0, 0.1, 0.2), (0.5, 1, 0, np.pi), (np.pi / 2, 0.0, np.pi / 2, 1.0)]:
        same(there.lookup(*given, wavelength_nm), here.lookup(*given, wavelength_nm))
    wi, wr = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    same(there.lookup_vectors(wi, wr, wavelength_nm), here.lookup_vectors(wi, wr, wavelength_nm))
    same(there.lookup_vectors(wi[0], wr, wavelength_nm), here.lookup_vectors(wi[0], wr, wavelength_nm))
    for theta in (theta_i, theta_i.reshape(4, -1), 0.5, np.pi / 2, np.float32(0.5)):
        same(there.specular_reflectance(theta, wavelength_nm), here.specular_reflectance(theta, wavelength_nm))


def test_float32_and_nan_come_back_as_they_do_from_a_table(pair: Any) -> None:
    there, here = pair
    given = [angle.astype(np.float32) for angle in angles()]
    given[0][0] = np.float32(np.pi / 2)  # lies above pi/2, and is the horizon all the same
    given[0][1], given[3][2] = np.nan, np.nan
    single = np.finfo(np.float32).eps
    same(there.lookup(*given), here.lookup(*given), single)
    same(there.specular_reflectance(given[0]), here.specular_reflectance(given[0]), single)
    wi, wr = (unit_vector(*given[each : each + 2]).astype(np.float32) for each in (0, 2))
    same(there.lookup_vectors(wi, wr), here.lookup_vectors(wi, wr), single)


@pytest.mark.parametrize("wavelength_nm", [None, 455.5, [455.5, 600]], ids=str)
@pytest.mark.parametrize("name", ["grey-felt", "copper-foil"])
def test_errors_are_stated_as_by_a_table(root: Path, address: str, name: str, wavelength_nm: Any) -> None:
    there, here = brdfdb.open(address)[name], brdfdb.open(root)[name]
    given = angles()
    wi, wr = unit_vector(given[0], given[1]), unit_vector(given[2], given[3])
    found = there.lookup(*given, wavelength_nm, with_error=True)
    for each, other in zip(found, here.lookup(*given, wavelength_nm, with_error=True), strict=True):
        same(each, other)
    found = there.lookup_vectors(wi, wr, wavelength_nm, with_error=True)
    for each, other in zip(found, here.lookup_vectors(wi, wr, wavelength_nm, with_error=True), strict=True):
        same(each, other)


def test_a_dataset_is_that_of_the_directory(root: Path, address: str) -> None:
    pytest.importorskip("aiohttp")
    there, here = brdfdb.open(address).dataset("copper-foil"), brdfdb.open(root).dataset("copper-foil")
    assert there.load().identical(here.load())


def test_a_dataset_without_what_reads_it(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(remote, "find_spec", lambda _: None)
    with pytest.raises(StoreError, match=r"needs fsspec and aiohttp: pip install 'brdfdb\[http\]'$"):
        brdfdb.open(address).dataset("grey-felt")


# A service is not a directory


def test_more_points_than_one_answer_holds(root: Path) -> None:
    here = brdfdb.open(root)["copper-foil"]
    given = angles(2000)
    with serving(root, max_points=4, max_body_bytes=20_000) as url:
        there = brdfdb.open(url)["copper-foil"]
        same(there.lookup(*given), here.lookup(*given))
        theta = given[0][:100]
        same(there.specular_reflectance(theta), here.specular_reflectance(theta))
        many = np.linspace(400, 700, 2001)
        same(there.lookup(0.1, 0.2, [0.3, 0.4], 0.4, many), here.lookup(0.1, 0.2, [0.3, 0.4], 0.4, many))
        with pytest.raises(
            StoreError, match=r"^http://\S+ answered 413 [A-Za-z ]+: 2001 values are more than the 400 "
        ):
            there.specular_reflectance([0.1, 0.2], many)


def test_a_table_stays_that_of_its_revision(own: Path) -> None:
    with serving(own) as url:
        there = brdfdb.open(url)
        first = there["white-tile"]
        assert publish(own, "white-tile", "lambert", rho=0.25) == "r000002"
        assert there["white-tile"].revision == there.head("white-tile") == "r000002"
        assert there.revisions("white-tile") == ["r000001", "r000002"]
        values = [each.lookup(0.5, 0.0, 0.5, 0.0) for each in (first, there["white-tile"], there.table(*KEPT))]
        np.testing.assert_allclose(np.pi * np.array(values), [1.0, 0.25, 1.0], rtol=1e-6)  # float32
        shutil.rmtree(own / "materials" / "white-tile" / "r000001")
        (own / "materials" / "white-tile" / "r000001.MANIFEST.json").unlink()
    with serving(own) as url, pytest.raises(UnknownRevisionError, match=r"^white-tile has no revision 'r000001'"):
        brdfdb.open(url).table(*KEPT)


def test_a_damaged_material_is_an_error_of_the_store(own: Path) -> None:
    (own / "materials" / "grey-felt" / "r000001" / "zarr.json").write_bytes(b"{}")
    with serving(own) as url:
        there = brdfdb.open(url)
        assert "grey-felt" in there
        assert "grey-felt" in there.summary("grey-felt")["damaged"]
        for ask in (there.__getitem__, there.attributes, there.head):
            with pytest.raises(StoreError, match=r"^grey-felt r000001 is damaged: "):
                ask("grey-felt")
        assert there["white-tile"].lookup(0.5, 0.0, 0.5, 0.0) > 0.0


def test_families_are_not_served(address: str) -> None:
    for ask in (brdfdb.open(address).families, lambda: brdfdb.open(address).family("copper")):
        with pytest.raises(StoreError, match=r"^http://.* serves materials, no families; open the directory"):
            ask()


def test_a_server_that_is_not_there(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with pytest.raises(StoreError, match=rf"^no answer from http://127.0.0.1:{port}: Connection refused$"):
        brdfdb.open(f"http://127.0.0.1:{port}")
    with serving(tmp_path) as url, pytest.raises(StoreError, match=r"^no store at "):
        brdfdb.open(url)


@pytest.mark.parametrize(
    "url",
    [
        *("http://", "http://host:port", "ftp://host", "http://host/?a=1", "host:8000"),
        *("http://me:secret@host", "http://my host", "http://host/\u00e4", "http://host/\n"),
    ],
)
def test_an_address_that_is_none(url: str) -> None:
    with pytest.raises(ValueError, match=r"^url: '.*' is not an address"):
        remote.RemoteStore(url)


def test_an_address_that_no_name_service_takes() -> None:
    with pytest.raises(StoreError, match=r"^no answer from http://a\.\.b: "):
        remote.RemoteStore("http://a..b")


@pytest.mark.parametrize(("scheme", "port"), [("http", 80), ("https", 443)])
def test_an_address_of_ipv6_without_a_port(scheme: str, port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def refuse(address: tuple[str, int], *_: Any) -> socket.socket:
        asked.append(address)
        raise ConnectionRefusedError("nobody")

    monkeypatch.setattr(socket, "create_connection", refuse)
    with pytest.raises(StoreError, match=r"nobody$"):
        remote.RemoteStore(f"{scheme}://[::1]/brdf/")
    assert asked == [("::1", port)]


@pytest.mark.parametrize("timeout_s", [0.0, -1.0, np.inf, np.nan])
def test_a_time_that_no_socket_waits(timeout_s: float) -> None:
    with pytest.raises(ValueError, match=r"^timeout_s: \S+ is outside \(0, 9\.\d+e\+09\] s$"):
        remote.RemoteStore("http://127.0.0.1:1", timeout_s)


def test_a_service_that_does_not_answer_in_time() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"http://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(StoreError, match=f"^no answer from {url}: timed out$"):
            remote.RemoteStore(url, timeout_s=0.05)


@contextmanager
def answering(*answers: bytes, close: bool = True) -> Iterator[tuple[str, list[bytes]]]:
    """A server that sends each of its answers to the beginning of one request, on a connection of its own."""
    asked: list[bytes] = []
    with socket.create_server(("127.0.0.1", 0)) as listener, ExitStack() as held:
        listener.settimeout(5.0)  # a client that asks less often fails the test, and does not hang it

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
TOO_LARGE = answer(PAGE, "413 Request Entity Too Large", "Content-Type: text/html", "Connection: close")
FAR_TOO_LARGE = bytes(16_000_000)  # more than sockets keep: it cannot be sent to whom does not read it


def test_a_connection_that_was_closed_in_between_is_made_anew() -> None:
    with answering(READY, READY) as (url, asked):
        assert len(remote.RemoteStore(url)) == 3
    assert len(asked) == 2
    assert all(b"Accept-Encoding: identity" in request for request in asked)


def test_it_is_made_anew_once() -> None:
    with answering(READY, b"") as (url, asked):
        there = remote.RemoteStore(url)
        with pytest.raises(StoreError, match=f"^no answer from {url}: "):
            len(there)
    assert len(asked) == 2


def test_a_new_connection_that_breaks_is_not_tried_again() -> None:
    with answering(b"") as (url, asked), pytest.raises(StoreError, match=f"^no answer from {url}: "):
        remote.RemoteStore(url)
    assert len(asked) == 1


def test_an_answer_in_chunks() -> None:
    chunks = b'4\r\n{"ma\r\nb\r\nterials":3}\r\n0\r\n\r\n'
    with answering(b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n" + chunks) as (url, _):
        assert remote.Service(url).document("/readyz") == {"materials": 3}


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (answer(PAGE, "502 Bad Gateway"), "^http://[^ ]+ answered 502 Bad Gateway, and does not say why$"),
        (answer(PAGE, "504 Gateway Time-out"), "^http://[^ ]+ answered 504 Gateway Time-out, and does not say why$"),
        (
            answer(PAGE, "503 Service Unavailable"),
            "^http://[^ ]+ answered 503 Service Unavailable, and does not say why$",
        ),
        (answer(b"\xff\xfe", "422 "), "^http://[^ ]+ answered 422, and does not say why$"),
        (answer(b'{"detail": "Not Found"}', "404 Not Found"), "^http://[^ ]+ answered 404 Not Found: Not Found$"),
        (answer(b"", "304 Not Modified"), "^http://[^ ]+ answered 304 Not Modified, and does not say why$"),
        (TOO_LARGE, "^http://[^ ]+ answered 413 Request Entity Too Large, and does not say why$"),
        (answer(PAGE), "^http://[^ ]+ is no service of brdfdb$"),
        (answer(b"[]"), "^http://[^ ]+ is no service of brdfdb$"),
        (answer(b""), "^http://[^ ]+ is no service of brdfdb$"),
        (answer(b'{"title": "\xe4"}'), "^http://[^ ]+ is no service of brdfdb$"),
        (answer(b'{"status": "ready"}'), "^http://[^ ]+ is no service of brdfdb$"),
        (answer(b'{"materials": "3"}'), "^http://[^ ]+ is no service of brdfdb$"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: 99\r\n\r\n{}", "^no answer from http://[^ ]+: IncompleteRead"),
        (b"SSH-2.0\r\n", "^no answer from http://[^ ]+: SSH-2.0$"),
    ],
)
def test_something_else_at_the_address(found: bytes, said: str) -> None:
    with answering(found) as (url, _), pytest.raises(StoreError, match=said):
        remote.RemoteStore(url)


NUMBERS = npy(np.zeros((3, 2)))


@pytest.mark.parametrize(
    "content",
    [
        *(PAGE, b"", b"PK\x03\x04", NUMBERS[:-1], NUMBERS[:20], NUMBERS.replace(b"(3, 2), ", b"(3, 2 , ")),
        *(npy(np.zeros(shape)) for shape in [(2, 3), 6, (3, 2, 1), ()]),
        *(npy(np.zeros((3, 2), dtype)) for dtype in ("f4", "i8", ">f8", "c16", "S8", "O")),
    ],
)
def test_something_else_than_the_array_asked_for(content: bytes) -> None:
    said = "^http://[^ ]+ is no service of brdfdb$"
    with answering(answer(content)) as (url, _), pytest.raises(StoreError, match=said):
        remote.Service(url).array("/v1", (3, 2))


@pytest.mark.parametrize("status", ["301 Moved Permanently", "302 Found", "307 Temporary Redirect", "308 Permanent"])
def test_a_redirect_is_told_and_not_followed(status: str) -> None:
    moved = answer(PAGE, status, "Location: https://there.example/brdf/v1?a=1")
    for body in (None, {"theta_i": 0}):
        with answering(moved) as (url, _), pytest.raises(StoreError) as raised:
            remote.Service(f"{url}/brdf/").document("/v1?a=1", body)
        where = "https://there.example/brdf/v1; open the address that the service itself has"
        assert str(raised.value) == f"{url}/brdf redirects /v1 to {where}"


# Behind a proxy


def test_a_body_that_is_refused_before_it_was_read() -> None:
    with answering(TOO_LARGE, READY, TOO_LARGE, READY) as (url, asked):
        there = remote.Service(url)
        for _ in range(2):  # the second time, the connection is one that was closed in between
            with pytest.raises(
                StoreError, match=f"^{url} answered 413 Request Entity Too Large, and does not say why$"
            ):
                there.content("/v1", FAR_TOO_LARGE, remote.NPY)
            assert there.document("/readyz") == {"materials": 3}
    assert [request[:4] for request in asked] == [b"POST", b"GET ", b"POST", b"GET "]


def test_a_connection_on_which_a_body_was_not_sent_whole_is_not_used_again() -> None:
    with answering(answer(PAGE, "413"), READY, close=False) as (url, asked):
        there = remote.Service(url, timeout_s=1.0)
        with pytest.raises(StoreError, match=f"^{url} answered 413, and does not say why$"):
            there.content("/v1", FAR_TOO_LARGE, remote.NPY)
        assert there.document("/readyz") == {"materials": 3}
    assert len(asked) == 2


class Proxy(ThreadingHTTPServer):
    """What nginx is before a service: too large a body is refused unread, with a page, and answers come in chunks.

    `asked` are the sizes of request line and body; lines above 8 kB are refused as well.
    """

    def __init__(self, service: str) -> None:
        super().__init__(("127.0.0.1", 0), Passing)
        self.service, self.url = service.removeprefix("http://"), f"http://127.0.0.1:{self.server_port}"
        self.most_bytes = 2**20
        self.asked: list[tuple[int, int]] = []

    def refused(self) -> list[int]:
        """The sizes of the bodies that were too large."""
        return [size for _, size in self.asked if size > self.most_bytes]


class Passing(BaseHTTPRequestHandler):
    """One connection of a `Proxy`."""

    protocol_version = "HTTP/1.1"
    server: Proxy

    def do_GET(self) -> None:
        line, size = len(self.raw_requestline), int(self.headers.get("Content-Length", 0))
        self.server.asked.append((line, size))
        if size > self.server.most_bytes or line > 8192:
            self.wfile.write(TOO_LARGE if line <= 8192 else answer(PAGE, "414 Request-URI Too Large"))
            self.close_connection = True
            return
        behind = http.client.HTTPConnection(self.server.service)
        behind.request(self.command, self.path, self.rfile.read(size) or None, dict(self.headers))
        response = behind.getresponse()
        self.send_response(response.status)
        self.send_header("Transfer-Encoding", "chunked")
        self.end_headers()
        while part := response.read(5000):
            self.wfile.write(b"%x\r\n%b\r\n" % (len(part), part))
        self.wfile.write(b"0\r\n\r\n")
        behind.close()

    def do_POST(self) -> None:
        self.do_GET()

    def log_message(self, *_: Any) -> None: ...


@pytest.fixture
def proxy(address: str) -> Iterator[Proxy]:
    with Proxy(address) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def test_a_proxy_passes_as_much_as_is_sent_at_once(proxy: Proxy, root: Path) -> None:
    there, here = brdfdb.open(proxy.url)["copper-foil"], brdfdb.open(root)["copper-foil"]
    given = [np.tile(angle, 100) for angle in angles()]
    same(there.lookup(*given, 500.5), here.lookup(*given, 500.5))
    many = np.linspace(400, 700, 1003)
    same(there.lookup(0.1, 0.2, 0.3, 0.4, many), here.lookup(0.1, 0.2, 0.3, 0.4, many))
    assert proxy.refused() == []
    assert max(size for _, size in proxy.asked) > 0.9 * proxy.most_bytes
    assert 0.7 * 8192 < max(line for line, _ in proxy.asked) < 8192


def test_what_is_too_large_for_a_proxy_is_halved(proxy: Proxy, root: Path) -> None:
    there, here = brdfdb.open(proxy.url)["copper-foil"], brdfdb.open(root)["copper-foil"]
    proxy.most_bytes = 4000
    given = angles()
    same(there.lookup(*given), here.lookup(*given))
    head = len(npy(np.zeros((1, 4)))) - 32
    assert proxy.refused() == [head + 32 * points for points in (400, 200)]
    same(there.specular_reflectance(given[0]), here.specular_reflectance(given[0]))
    assert len(proxy.refused()) == 3


@pytest.mark.parametrize(("points", "requests"), [(8, 4), (3, 2), (1, 1)])
def test_one_point_that_is_too_large_for_a_proxy_is_an_error(proxy: Proxy, points: int, requests: int) -> None:
    there = brdfdb.open(proxy.url)["copper-foil"]
    proxy.most_bytes = -1
    theta = np.full(points, 0.3)
    for ask in (lambda: there.lookup(0.1, 0.2, theta, 0.4), lambda: there.specular_reflectance(theta)):
        proxy.asked.clear()
        with pytest.raises(StoreError, match=f"^{proxy.url} answered 413 Request Entity Too Large, and does not say"):
            ask()
        assert len(proxy.asked) == requests


def test_threads_and_processes_ask_at_the_same_time(address: str, store: Store) -> None:
    there, here = brdfdb.open(address)["brushed-metal"], store["brushed-metal"]
    copy = pickle.loads(pickle.dumps(there))
    ask: Callable[[float], Any] = lambda theta: copy.lookup(theta, 0.1, 0.5, 2.0)  # noqa: E731
    thetas = np.linspace(0.0, 1.4, 64)
    with ThreadPoolExecutor(8) as pool:
        found = np.array(list(pool.map(ask, thetas)))
    same(found, here.lookup(thetas, 0.1, 0.5, 2.0))
