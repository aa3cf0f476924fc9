"""The speed of the service on loopback: ``python tests/benchmarks/service.py [--store brdf-store]``.

Starts `brdfdb serve`, one worker, and asks over 8 connections from a process of its own, each connection as soon as it
has its answer. Prints requests a second, percentiles of the time to an answer, and processor time of the server for a
request. Without a store it builds the two tables that it asks for. Then it looks up the same points through the Python
client and in the directory.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import json
import os
import re
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.benchmarks.recording import Column, Run, Table, times_of

CONNECTIONS = 8
NAMES = ("rolled-brass", "scene-copper-sphere")
SECONDS, QUICK_SECONDS = 2.0, 0.05
DECODING = 5.0  # seconds that the server may take to decode what lists show
REPEATS = 5
MEASURED = "Requests a second and the time to an answer of one worker on loopback, and lookups of the Python client."
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
    """Ask for a while; return the time to each answer, and the whole."""

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
    """Start a server: yield its port, its process and the seconds until it was ready."""
    start = time.perf_counter()
    command = [sys.executable, "-m", "brdfdb_pipelines.cli", "serve", "--store", store, "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
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


def cpu_seconds(pid: int) -> float:
    """Return the processor time of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def made_store(root: Path, quick: bool) -> None:
    """Publish the tables that are asked for, as the default build has them; coarse ones for a quick run."""
    from brdfdb.store.publication import publish_layout  # here, since the processes that ask import this module
    from brdfdb_pipelines import recipe_file
    from tests.benchmarks.plain import plain_recipe

    recipe = plain_recipe(coarse=True) if quick else recipe_file.load()
    for job in recipe.jobs():
        if job.material.name in NAMES:
            publish_layout(root, job.material.name, job.layout())


def requests() -> list[tuple[str, bytes, int]]:
    """Return requests with their titles and numbers of connections."""
    query = "theta_i=45&theta_r=30&phi_r=180"
    made = [
        (f"one point of {name}", get(f"/v1/materials/{name}/lookup?{query}&wavelength_nm=550"), CONNECTIONS)
        for name in NAMES
    ]
    made.append(("one point, all wavelengths", get(f"/v1/materials/{NAMES[1]}/lookup?{query}"), CONNECTIONS))
    thousand = dict(zip(("theta_i", "phi_i", "theta_r", "phi_r"), points(1000).round(3).T.tolist(), strict=True))
    body = json.dumps({**thousand, "wavelength_nm": 550.0}).encode()
    for name in NAMES:
        request = post(f"/v1/materials/{name}/lookup", "application/json", body)
        made.append((f"1000 points as JSON of {name}", request, CONNECTIONS))
    made += [(f"100 000 points as npy of {name}", as_npy_request(name), 2) for name in NAMES]
    return made


def as_npy_request(name: str) -> bytes:
    """Return a request for 100 000 points."""
    path = f"/v1/materials/{name}/lookup?wavelength_nm=550&format=npy"
    return post(path, "application/x-npy", as_npy(points(100_000)))


def add(table: Table, title: str, connections: int, seconds: list[float], whole: float, cpu: float | None) -> None:
    """Add the row of a measurement."""
    p50, p99 = 1e3 * np.percentile(seconds, [50.0, 99.0])
    used = None if cpu is None else 1e6 * cpu / len(seconds)
    table.add(title, connections, len(seconds) / whole, p50, p99, used)


def clients(run: Run, store: str, port: int, quick: bool) -> None:
    """Time lookups through the Python client and in the directory."""
    import brdfdb

    table = run.table(
        "Lookups in Python of rolled-brass",
        Column(name="points", width=28),
        *(Column(name=name, unit="ms") for name in ("from the service", "from the directory")),
    )

    def seconds_of(table: Any, angles: np.ndarray, calls: int) -> float:
        """Return the median time of a lookup."""
        times = times_of(lambda: [table.lookup(*angles) for _ in range(calls)], REPEATS, time.perf_counter)
        return float(np.median(times)) / calls

    tables = [brdfdb.open(place)[NAMES[0]] for place in (f"http://127.0.0.1:{port}", store)]
    for count in (1, 1000) if quick else (1, 1000, 1_000_000):
        angles = np.radians(points(count)).T
        # many calls of one point: a single one takes microseconds
        calls = 100 if count == 1 and not quick else 1
        table.add(count, *(1e3 * seconds_of(one, angles, calls) for one in tables))


def main(arguments: Sequence[str] | None = None) -> int:
    """Start the service, ask it, and print the times."""
    run = Run("service", "speed", "Lookups over HTTP", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--store", help="by default two tables are built")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of each measurement (default: %(default)s)")
    options = run.parse(parser, arguments)
    with tempfile.TemporaryDirectory() as folder:
        store = options.store or folder
        if options.store is None:
            made_store(Path(folder), options.quick)
        measure(run, store, QUICK_SECONDS if options.quick else options.seconds, options.quick)
    run.end()
    return 0


def measure(run: Run, store: str, duration: float, quick: bool) -> None:
    """Ask for every kind of answer."""
    with served(store) as (port, pid, ready), ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        run.say(f"The service is ready {ready:.2f} s after its start.")
        time.sleep(0.0 if quick else DECODING)
        table = run.table(
            f"Requests, {duration:g} s each",
            Column(name="request", width=42),
            "connections",
            Column(name="requests", unit="1/s"),
            *(Column(name=name, unit="ms") for name in ("median", "p99")),
            Column(name="processor time", unit="us"),
        )
        made = requests()
        for title, request, connections in made:
            pool.submit(load, port, request, 1, min(duration, 0.5)).result()  # tables decoded, threads started
            before = cpu_seconds(pid)
            seconds, whole = pool.submit(load, port, request, connections, duration).result()
            add(table, title, connections, seconds, whole, cpu_seconds(pid) - before)
        beside = pool.submit(load, port, as_npy_request(NAMES[0]), 2, duration)
        add(
            table,
            "one point beside 100 000 as npy",
            1,
            *pool.submit(load, port, made[0][1], 1, duration).result(),
            None,
        )
        add(table, "100 000 as npy beside one point", 2, *beside.result(), None)
        clients(run, store, port, quick)


if __name__ == "__main__":
    sys.exit(main())
