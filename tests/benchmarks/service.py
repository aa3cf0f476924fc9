"""How fast the service answers on loopback: python tests/benchmarks/service.py --store brdf-store

Starts `brdfdb serve`, one worker, and asks over 8 connections from a process of its own, each connection as soon as it
has its answer. Prints requests a second, percentiles of the time to an answer, and CPU time of the server a request.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import io
import json
import os
import re
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

CONNECTIONS = 8
LENGTH = re.compile(rb"\r\ncontent-length: (\d+)", re.IGNORECASE)


class Client(asyncio.Protocol):
    """A connection that sends one request over and over until it is told to stop."""

    def __init__(self, request: bytes, stop_at: float) -> None:
        self.request, self.stop_at = request, stop_at
        self.seconds: list[float] = []
        self.wrong: list[bytes] = []
        self.got, self.wanted, self.sent_at = bytearray(), 0, 0.0
        self.done = asyncio.get_running_loop().create_future()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport
        self._send()

    def _send(self) -> None:
        self.got, self.wanted, self.sent_at = bytearray(), 0, time.perf_counter()
        self.transport.write(self.request)  # type: ignore[attr-defined]

    def data_received(self, data: bytes) -> None:
        self.got += data
        if not self.wanted:
            end = self.got.find(b"\r\n\r\n")
            if end < 0:
                return
            length = LENGTH.search(self.got, 0, end + 2)
            assert length is not None
            self.wanted = end + 4 + int(length[1])
            if not self.got.startswith(b"HTTP/1.1 200"):
                self.wrong.append(bytes(self.got[:300]))
        if len(self.got) < self.wanted:
            return
        now = time.perf_counter()
        self.seconds.append(now - self.sent_at)
        if now < self.stop_at:
            self._send()
        else:
            self.transport.close()

    def connection_lost(self, _: Exception | None) -> None:
        self.done.set_result(None)


def load(port: int, request: bytes, connections: int, seconds: float) -> tuple[list[float], float]:
    """Ask for a while; the time each answer took, and the whole."""

    async def ask() -> tuple[list[float], float]:
        loop = asyncio.get_running_loop()
        start = time.perf_counter()
        clients = [Client(request, start + seconds) for _ in range(connections)]
        for client in clients:
            await loop.create_connection(lambda client=client: client, "127.0.0.1", port)
        await asyncio.gather(*(client.done for client in clients))
        wrong = [each for client in clients for each in client.wrong]
        if wrong:
            raise RuntimeError(f"{len(wrong)} answers were not 200, such as {wrong[0]!r}")
        return [each for client in clients for each in client.seconds], time.perf_counter() - start

    import uvloop

    return uvloop.run(ask())


def get(path: str) -> bytes:
    return f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()


def post(path: str, media: str, body: bytes) -> bytes:
    head = f"POST {path} HTTP/1.1\r\nHost: localhost\r\nContent-Type: {media}\r\nContent-Length: {len(body)}\r\n\r\n"
    return head.encode() + body


def points(count: int) -> np.ndarray:
    """Directions all over the hemisphere [degrees], shape (count, 4)."""
    rng = np.random.default_rng(1992)
    return rng.random((count, 4)) * [85.0, 360.0, 85.0, 360.0]


def as_npy(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


@contextlib.contextmanager
def served(store: str) -> Iterator[tuple[int, int, float]]:
    """A server: its port, its process and the seconds until it was ready."""
    start = time.perf_counter()
    command = [sys.executable, "-m", "brdfdb_pipelines.cli", "serve", "--store", store, "--port", "0"]
    with open(os.devnull, "wb") as nowhere:
        server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=nowhere, text=True)
    try:
        assert server.stdout is not None
        line = server.stdout.readline()
        port = int(line.rsplit(":", 1)[1].strip(" /\n"))
        while True:
            with contextlib.suppress(OSError), urllib.request.urlopen(f"http://127.0.0.1:{port}/readyz") as answer:
                if answer.status == 200:
                    break
            time.sleep(0.01)
        yield port, server.pid, time.perf_counter() - start
    finally:
        server.terminate()
        server.wait()


def cpu_seconds(pid: int) -> float:
    """Of a process, so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def report(title: str, seconds: list[float], whole: float, cpu: float | None = None) -> None:
    p50, p99 = 1e3 * np.percentile(seconds, [50.0, 99.0])
    used = "" if cpu is None else f"{1e6 * cpu / len(seconds):9.0f} us CPU"
    print(f"{title:42s}{len(seconds) / whole:9.0f} a second   p50 {p50:6.2f} ms   p99 {p99:6.2f} ms{used}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", default="brdf-store")
    parser.add_argument("--seconds", type=float, default=5.0, help="of each measurement")
    options = parser.parse_args()
    with (
        served(options.store) as (port, pid, ready),
        ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool,
    ):
        print(f"ready after {ready:.2f} s")
        time.sleep(5.0)  # the server decodes what lists show
        names = ("rolled-brass", "scene-copper-sphere")

        def measure(title: str, request: bytes, connections: int = CONNECTIONS) -> None:
            pool.submit(load, port, request, 1, 0.5).result()  # tables decoded, threads started
            before = cpu_seconds(pid)
            seconds, whole = pool.submit(load, port, request, connections, options.seconds).result()
            report(title, seconds, whole, cpu_seconds(pid) - before)

        one = {
            name: get(f"/v1/materials/{name}/lookup?theta_i=45&theta_r=30&phi_r=180&wavelength_nm=550")
            for name in names
        }
        for name in names:
            measure(f"one point of {name}", one[name])
        measure(
            "one point, 41 wavelengths", get("/v1/materials/scene-copper-sphere/lookup?theta_i=45&theta_r=30&phi_r=180")
        )
        thousand = dict(zip(("theta_i", "phi_i", "theta_r", "phi_r"), points(1000).round(3).T.tolist(), strict=True))
        body = json.dumps({**thousand, "wavelength_nm": 550.0}).encode()
        many = as_npy(points(100_000))
        for name in names:
            measure(f"1000 points as JSON of {name}", post(f"/v1/materials/{name}/lookup", "application/json", body))
        for name in names:
            path = f"/v1/materials/{name}/lookup?wavelength_nm=550&format=npy"
            measure(f"100 000 points as npy of {name}", post(path, "application/x-npy", many), 2)
        path = "/v1/materials/rolled-brass/lookup?wavelength_nm=550&format=npy"
        beside = pool.submit(load, port, post(path, "application/x-npy", many), 2, options.seconds)
        report(
            "one point beside 100 000 as npy",
            *pool.submit(load, port, one["rolled-brass"], 1, options.seconds).result(),
        )
        report("100 000 as npy beside one point", *beside.result())


if __name__ == "__main__":
    main()
