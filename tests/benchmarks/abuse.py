"""Clients that withhold and do not read: ``python tests/benchmarks/abuse.py [--store brdf-store]``.

While clients ask for the largest answers and read nothing, hold back the last byte of the largest bodies, or send half
of a head, another one looks up single points. Prints how long its answers take, and the memory of the server. Then the
server is told to stop, again and again, while 24 kept connections ask, and requests without an answer are counted.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import re
import signal
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.benchmarks.recording import Column, Run
from tests.benchmarks.service import NAMES, get, made_store, post, served

PLACE = f"/v1/materials/{NAMES[1]}/lookup"
POINT = get(f"{PLACE}?theta_i=45&theta_r=30&phi_r=180&wavelength_nm=550")
SECONDS, QUICK_SECONDS = 15.0, 1.0
PAUSE_S = 0.01  # between the lookups of the other client [s]
KEPT, STOPS, QUICK_STOPS = 24, 18, 2
MEASURED = "Memory of one worker, and the time of others' lookups of a point, while clients withhold and do not read."


def unread(quick: bool) -> bytes:
    """Return the request of 17 kB for an answer of 64 MB: a row and a column of angles, at eight wavelengths."""
    row, column = (20, 50) if quick else (1000, 1000)
    angles = {"theta_i": [[10.0]] * row, "theta_r": [np.linspace(0.0, 80.0, column).round(2).tolist()]}
    wavelengths = np.linspace(420.0, 680.0, 8).round().tolist()
    return post(
        f"{PLACE}?format=npy", "application/json", json.dumps({**angles, "wavelength_nm": wavelengths}).encode()
    )


def withheld(quick: bool) -> bytes:
    """Return the request with the largest body that is allowed, without its last byte."""
    return post(PLACE, "application/x-npy", bytes(2**16 if quick else 64 * 2**20))[:-1]


ATTACKS: dict[str, tuple[int, Callable[[bool], bytes]]] = {
    "nothing": (0, lambda _: b""),
    "answers of 64 MB, unread": (20, unread),
    "bodies of 64 MiB without the last byte": (8, withheld),
    "half of a head": (200, lambda _: POINT[:40]),
}


@contextlib.contextmanager
def attack(port: int, count: int, request: bytes) -> Iterator[None]:
    """Send a request on many connections, read nothing, and begin again where the server ends one."""
    stop = asyncio.Event()
    loop = asyncio.new_event_loop()

    async def one() -> None:
        while not stop.is_set():
            with contextlib.suppress(OSError):
                connection = socket.socket()
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                connection.setblocking(False)
                with connection:
                    await loop.sock_connect(connection, ("127.0.0.1", port))
                    await loop.sock_sendall(connection, request)
                    while not stop.is_set():
                        await asyncio.sleep(0.2)
                        if ended(connection):
                            break
            await asyncio.sleep(0.05)

    async def all_of_them() -> None:
        await asyncio.gather(*(one() for _ in range(count)))

    thread = threading.Thread(target=loop.run_until_complete, args=(all_of_them(),))
    thread.start()
    try:
        yield
    finally:
        loop.call_soon_threadsafe(stop.set)
        thread.join()
        loop.close()


def ended(connection: socket.socket) -> bool:
    """Return True if the server reset a connection, or closed it with nothing to read."""
    if connection.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
        return True
    try:
        return connection.recv(1, socket.MSG_PEEK) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def memory_mb(pid: int, key: str = "VmRSS") -> float:
    """Return the memory of a process [MB]: resident, or at its peak (VmHWM)."""
    return int(re.findall(rf"{key}:\s+(\d+)", Path(f"/proc/{pid}/status").read_text())[0]) / 1000


def lookups(port: int, pid: int, seconds: float) -> tuple[list[float], float]:
    """Return the times [s] of lookups of a point, each on a connection of its own, and the largest memory [MB]."""
    times, largest, end = [], 0.0, time.monotonic() + seconds
    while time.monotonic() < end:
        start = time.perf_counter()
        with socket.create_connection(("127.0.0.1", port), timeout=60) as connection:
            connection.sendall(POINT)
            if not connection.recv(65536).startswith(b"HTTP/1.1 200 "):
                raise RuntimeError("a lookup of a point was refused")
        times.append(time.perf_counter() - start)
        largest = max(largest, memory_mb(pid))
        time.sleep(PAUSE_S)
    return times, largest


async def kept(port: int, seconds: float, stop: Callable[[], None]) -> tuple[int, int]:
    """Ask over kept connections, and stop the server; return the number of answers, and of requests that got none."""
    answered = lost = 0

    async def ask() -> None:
        nonlocal answered, lost
        with contextlib.suppress(OSError):  # nobody listens any more
            while True:
                reader, writer = await asyncio.open_connection("127.0.0.1", port)
                head = b""
                while b"connection: close" not in head:
                    try:
                        writer.write(POINT)
                        head = await reader.readuntil(b"\r\n\r\n")
                        await reader.readexactly(int(re.findall(rb"content-length: (\d+)", head)[0]))
                        answered += 1
                    except (OSError, asyncio.IncompleteReadError):
                        lost += 1
                        break
                writer.close()

    asking = [asyncio.create_task(ask()) for _ in range(KEPT)]
    await asyncio.sleep(seconds)
    stop()
    await asyncio.gather(*asking)
    return answered, lost


def main(arguments: Sequence[str] | None = None) -> int:
    """Attack the service, stop it, and print what others notice."""
    run = Run("abuse", "speed", "A service under abuse", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--store", help="by default two tables are built")
    options = run.parse(parser, arguments)
    seconds = QUICK_SECONDS if options.quick else SECONDS
    with tempfile.TemporaryDirectory() as folder:
        store = options.store or folder
        if options.store is None:
            made_store(Path(folder), options.quick)
        table = run.table(
            f"Lookups of a point by others, {seconds:g} s each",
            Column(name="clients send", width=40),
            "clients",
            *(Column(name=name, unit="ms") for name in ("median", "p99", "longest")),
            Column(name="memory", unit="MB"),
        )
        with served(store) as (port, pid, _):
            for title, (count, request) in ATTACKS.items():
                with attack(port, 2 if options.quick else count, request(options.quick)):
                    times, largest = lookups(port, pid, seconds)
                table.add(title, count, *(1e3 * np.percentile(times, [50.0, 99.0, 100.0])), largest)
        stops = run.table("Stops under load", "stops", "kept connections", "answers", "lost requests")
        answers = lost = 0
        count = QUICK_STOPS if options.quick else STOPS
        for number in range(count):
            with served(store) as (port, pid, _):
                pause = 0.2 + 0.05 * number

                answered, missed = asyncio.run(kept(port, pause, lambda pid=pid: os.kill(pid, signal.SIGTERM)))
            answers, lost = answers + answered, lost + missed
        stops.add(count, KEPT, answers, lost)
    run.end()
    return 0


if __name__ == "__main__":
    sys.exit(main())
