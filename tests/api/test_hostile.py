"""Hostile requests to a real server: no 5xx, each refusal a sentence of problem+json, memory bounded, still serving."""

from __future__ import annotations

import contextlib
import http.client
import json
import re
import struct
import subprocess
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.api.a_store import NPY, npy, publish, read_npy, serving_command
from tests.api.connections import WAIT_S, connected, post, wait_until

LOOKUP = "/v1/materials/white/lookup"
GONE = "499"
JSON = "application/json"
MEMORY_MB = 700.0  # of the server: 240 before, 390 after the bodies of 64 MiB that it may take


class Server:
    """A server in a process of its own."""

    def __init__(self, process: subprocess.Popen[str], port: int) -> None:
        self.process, self.port = process, port

    def ask(self, method: str, path: str, body: Any = None, **headers: str) -> tuple[int, str, bytes]:
        """Status, media type and body of an answer."""
        named = {key.replace("_", "-"): value for key, value in headers.items()}
        chunked = not isinstance(body, bytes | str | None)
        with contextlib.closing(http.client.HTTPConnection("127.0.0.1", self.port, timeout=WAIT_S)) as connection:
            # A body may be refused before all of it was read; the answer is there then
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                connection.request(method, path, body, named, encode_chunked=chunked)
            answer = connection.getresponse()
            return answer.status, answer.headers["content-type"] or "", answer.read()

    def refused(self, status: int, method: str, path: str, body: Any = None, **headers: str) -> str:
        """Ask what must be refused; its sentence."""
        found, media, content = self.ask(method, path, body, **headers)
        assert (found, media) == (status, "application/problem+json"), content[:300]
        problem = json.loads(content)
        assert problem["status"] == status
        sentence: str = problem["detail"]
        assert sentence
        assert len(sentence) < 500
        assert "\n" not in sentence
        assert "Traceback" not in sentence
        return sentence

    @property
    def memory_mb(self) -> float:
        """Largest resident memory so far [MB]."""
        lines = Path(f"/proc/{self.process.pid}/status").read_text().splitlines()
        return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1e3

    @property
    def counted(self) -> Counter[str]:
        """How many requests were answered with each status."""
        text = self.ask("GET", "/metrics")[2].decode()
        found: Counter[str] = Counter()
        for status, count in re.findall(r'^brdfdb_requests_total{.*status="(\d+)"} ([\d.]+)$', text, re.MULTILINE):
            found[status] += int(float(count))
        return found


@contextlib.contextmanager
def running(folder: Path) -> Iterator[Server]:
    """A server of a store with one white material, until the end."""
    publish(folder / "store", "white", "lambert", rho=1.0)
    with (folder / "log").open("w") as log, serving_command(folder / "store", stderr=log) as (process, port):
        server = Server(process, port)
        wait_until(lambda: server.ask("GET", "/readyz")[0] == 200)  # kernels are loaded, or compiled
        yield server


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with running(tmp_path_factory.mktemp("hostile")) as found:
        yield found


@pytest.fixture(autouse=True)
def still_serving(server: Server) -> Iterator[None]:
    yield
    status, _, content = server.ask("GET", f"{LOOKUP}?theta_i=10&theta_r=20")
    assert status == 200
    assert json.loads(content)["brdf"] == pytest.approx(1 / np.pi, rel=1e-6)


def header_of(shape: str, data: bytes = b"", descr: str = "'<f8'", version: bytes = b"\x01\x00") -> bytes:
    """A .npy file with a header of our own."""
    header = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode().ljust(117) + b"\n"
    return b"\x93NUMPY" + version + struct.pack("<H", len(header)) + header + data


BODIES = {
    "not UTF-8": b'{"theta_i": "\xff\xfe"}',
    "an integer of a thousand digits": b'{"theta_i": ' + b"9" * 1000 + b', "theta_r": 0}',
    "an integer of a million digits": b'{"theta_i": ' + b"9" * 10**6 + b', "theta_r": 0}',
    "deep lists": b'{"theta_r": 0, "theta_i": ' + b"[" * 900 + b"1" + b"]" * 900 + b"}",
    "deeper lists": b'{"theta_r": 0, "theta_i": ' + b"[" * 200_000 + b"1" + b"]" * 200_000 + b"}",
    "deep objects": b'{"a":' * 100_000 + b"1" + b"}" * 100_000,
    "a name of a megabyte": b'{"theta_i": 1, "theta_r": 0, "' + b"x" * 2**20 + b'": 2}',
}
ARRAYS = {
    "a header that is code": b"\x93NUMPY\x01\x00"
    + struct.pack("<H", 40)
    + b"__import__('os').system('echo hi')".ljust(40),
    "a header of 64 kB": b"\x93NUMPY\x01\x00\xff\xff" + b" " * 65535,
    "deep brackets": b"\x93NUMPY\x01\x00" + struct.pack("<H", 4000) + b"(" * 4000,
    "a petabyte": header_of("(35184372088832, 4)", bytes(64)),
    "a product past 64 bits": header_of("(4611686018427387904, 4611686018427387904, 4)", bytes(64)),
    "records": header_of("(1, 4)", bytes(32), "[('a', '<f8')]"),
    "no rows, and more of them than 64 bits count": header_of("(0, 1000000000000000000000000000000, 4)"),
    "no columns of more than memory": header_of("(4611686018427387904, 0, 4)"),
    "seventy axes": header_of(f"({'1, ' * 70}4)", bytes(32)),
    "truth for a length": header_of("(True, 4)", bytes(32)),
}


@pytest.mark.parametrize(("media", "bodies"), [(JSON, BODIES), (NPY, ARRAYS)])
def test_hostile_bodies_are_refused_in_a_sentence(server: Server, media: str, bodies: dict[str, bytes]) -> None:
    for body in bodies.values():
        server.refused(422, "POST", LOOKUP, body, Content_Type=media)


def test_a_body_that_is_not_said_to_be_an_array_is_json(server: Server) -> None:
    body = b'{"theta_i": 10, "theta_r": 20}'
    for media in ("text/plain", "application/x-www-form-urlencoded", "application/xml", "", "/;="):
        assert server.ask("POST", LOOKUP, body, Content_Type=media)[:2] == (200, JSON)
        assert "JSON" in server.refused(422, "POST", LOOKUP, header_of("(1, 4)", bytes(32)), Content_Type=media)


def test_a_body_of_100_mb_is_refused_while_it_arrives_with_a_length_or_without(server: Server) -> None:
    for media, body in ((JSON, bytes(100 * 10**6)), (NPY, bytes(100 * 10**6)), (JSON, (bytes(2**20),) * 100)):
        assert "67108864 bytes" in server.refused(413, "POST", LOOKUP, body, Content_Type=media)
        assert server.memory_mb < MEMORY_MB


def test_a_body_as_large_as_may_be_is_read_and_refused(server: Server) -> None:
    for media, body in (
        (JSON, b'{"theta_i": [' + b"1," * 33_000_000 + b"1]}"),
        (NPY, header_of("(2097000, 4)", bytes(67104000))),
    ):
        status, kind, content = server.ask("POST", LOOKUP, body, Content_Type=media)
        assert (status, kind) in ((413, "application/problem+json"), (422, "application/problem+json")), content[:300]


def test_points_that_broadcast_to_more_than_may_be_are_refused_before_they_are_made(server: Server) -> None:
    angles = [1.0] * 3000
    body = {"theta_i": [[[each]] for each in angles], "theta_r": [[each] for each in angles], "phi_r": angles}
    said = server.refused(413, "POST", LOOKUP, json.dumps(body), Content_Type=JSON)
    assert said.startswith("27000000000 points are more than")
    assert server.memory_mb < MEMORY_MB


QUERIES = [
    "theta_i=0x10&theta_r=0",
    "theta_i=1&theta_r=0&output=xyz&illuminant=%00",
    "theta_i=1&theta_r=0&format=pickle",
    "theta_i=1&theta_r=0&%F0%9F%92%A9=1",
    "theta_i=%ff%fe&theta_r=0",
    "theta_i=" + "9" * 5000 + "&theta_r=0",
    "&&&=&",
]


PATHS = [
    "/v1/materials/..%2f..%2fetc/lookup?theta_i=1&theta_r=0",
    "/v1/materials/%2e%2e/lookup?theta_i=1&theta_r=0",
    "/v1/materials/white%00/lookup?theta_i=1&theta_r=0",
    "/v1/materials/white%0a/lookup?theta_i=1&theta_r=0",
    "/v1/materials/" + "x" * 5000,
    "/v1/materials/white/revisions/..%2fr000001/lookup?theta_i=1&theta_r=0",
    "/v1/materials/white/revisions/r000001%00",
    "/v1/materials/white/revisions/r%D9%A3",
    "/v1/store/materials/white/r000001/../../../brdfdb.json",
    "/v1/store/materials/white/r000001/%2e%2e/HEAD.json",
    "/v1/store/materials/white/r000001/..%2fHEAD.json",
    "/v1/store/materials/white/r000001//etc/passwd",
    "/v1/store/materials/%2e%2e/materials/white",
    "/v1/store/materials/white/r000001/zarr.json%00",
    "/no/such/address",
]


def test_hostile_queries_and_paths_are_refused_in_a_sentence(server: Server) -> None:
    for query in QUERIES:
        server.refused(422, "GET", f"{LOOKUP}?{query}")
    for path in PATHS:
        server.refused(404, "GET", path)


def test_a_client_that_goes_away_leaves_nothing_behind(server: Server) -> None:
    earlier = server.counted
    for _ in range(20):
        connected(server.port, post(b"x" * 10, path=LOOKUP, length=1000)).close()
    wait_until(lambda: server.counted[GONE] >= earlier[GONE] + 20)
    more = server.counted - earlier
    assert (more[GONE], [status for status in more if status[0] == "5"]) == (20, [])


def test_a_million_points_are_answered(server: Server) -> None:
    array = npy(np.full((1_000_000, 4), 30.0))
    status, media, content = server.ask("POST", f"{LOOKUP}?format=npy", array, Content_Type=NPY)
    assert (status, media) == (200, NPY)
    np.testing.assert_allclose(read_npy(content), np.full(1_000_000, 1 / np.pi), rtol=1e-6)
    assert server.memory_mb < MEMORY_MB
