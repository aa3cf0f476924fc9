"""The price of the service: ``python tests/benchmarks/service_price.py [--store brdf-store]``.

Asks `brdfdb serve`, a bare FastAPI endpoint that returns a constant, and a naive application of twenty lines over the
same table, one after the other in several rounds. Prints processor time of the server for a request, and ratios.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
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
from fastapi import FastAPI, Request, Response
from pydantic import BaseModel

import brdfdb

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.benchmarks.recording import Column, Run
from tests.benchmarks.service import NAMES, as_npy, cpu_seconds, get, load, made_store, points, post, served

NAME = NAMES[0]
ROUNDS, SECONDS, QUICK_SECONDS = 3, 1.0, 0.3
MEASURED = "Processor time of a request to the service, to a bare FastAPI endpoint, and to a naive application."


class Points(BaseModel):
    """Angles in degrees."""

    theta_i: list[float]
    phi_i: list[float]
    theta_r: list[float]
    phi_r: list[float]


def naive() -> Any:
    """Return the naive application, and in it the bare endpoint."""
    app, table = FastAPI(), brdfdb.open()[NAME]

    @app.get("/bare")
    async def bare() -> dict[str, float]:
        return {"brdf": 0.1}

    @app.get("/lookup")
    async def one(theta_i: float, theta_r: float, phi_i: float = 0.0, phi_r: float = 0.0) -> dict[str, Any]:
        return {"brdf": float(table.lookup(*np.radians([theta_i, phi_i, theta_r, phi_r])))}

    @app.post("/lookup")
    def many(at: Points) -> dict[str, Any]:
        return {"brdf": table.lookup(*np.radians([at.theta_i, at.phi_i, at.theta_r, at.phi_r])).tolist()}

    @app.post("/npy")
    async def arrays(request: Request) -> Response:
        angles = np.radians(np.load(io.BytesIO(await request.body())))
        return Response(as_npy(table.lookup(*np.moveaxis(angles, -1, 0))))

    return app


@contextlib.contextmanager
def naively_served(store: str) -> Iterator[tuple[int, int]]:
    """Start the naive application: yield its port and its process."""
    port = 20_000 + os.getpid() % 20_000
    command = [sys.executable, "-m", "uvicorn", "--factory", "tests.benchmarks.service_price:naive"]
    command += ["--port", str(port), "--no-access-log", "--log-level", "error", "--loop", "uvloop"]
    environment = {**os.environ, "BRDFDB_STORE": store}
    with subprocess.Popen(command, env=environment, cwd=Path(__file__).parents[2]) as server:
        try:
            while server.poll() is None:
                with contextlib.suppress(OSError):
                    urllib.request.urlopen(f"http://127.0.0.1:{port}/bare").close()
                    break
                time.sleep(0.05)
            yield port, server.pid
        finally:
            server.terminate()


def main(arguments: Sequence[str] | None = None) -> int:
    """Ask both servers, and print the times."""
    run = Run("service_price", "speed", "The price of the service", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--store", help="by default two tables are built")
    options = run.parse(parser, arguments)
    with tempfile.TemporaryDirectory() as folder:
        if options.store is None:
            made_store(Path(folder), options.quick)
        store = options.store or folder
        seconds, rounds = (QUICK_SECONDS, 1) if options.quick else (SECONDS, ROUNDS)
        pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"))
        with served(store) as (port, pid, _), naively_served(store) as (other, naive_pid), pool:
            measure(run, pool, (port, pid), (other, naive_pid), seconds, rounds)
    run.end()
    return 0


def measure(
    run: Run, pool: ProcessPoolExecutor, ours: tuple[int, int], naive: tuple[int, int], seconds: float, rounds: int
) -> None:
    """Add a row for each kind of request."""
    query = "theta_i=45&theta_r=30&phi_r=180"
    thousand = dict(zip(("theta_i", "phi_i", "theta_r", "phi_r"), points(1000).round(3).T.tolist(), strict=True))
    body, array = json.dumps(thousand).encode(), as_npy(points(100_000))
    place = f"/v1/materials/{NAME}/lookup"
    npy = "application/x-npy"
    asked = (
        ("one point, beside a constant", get(f"{place}?{query}"), get("/bare"), 8),
        ("one point, beside the naive one", get(f"{place}?{query}"), get(f"/lookup?{query}"), 8),
        ("1000 points as JSON", post(place, "application/json", body), post("/lookup", "application/json", body), 4),
        ("100 000 points as npy", post(f"{place}?format=npy", npy, array), post("/npy", npy, array), 2),
    )
    columns = (Column(name="service", unit="us"), Column(name="other", unit="us"))
    table = run.table("Processor time of a request", Column(name="request", width=34), *columns, "ratio")
    for title, here, there, connections in asked:
        used: dict[int, list[float]] = {}
        for _ in range(rounds):
            for (port, pid), request in ((ours, here), (naive, there)):
                pool.submit(load, port, request, 1, min(seconds, 0.3)).result()
                before = cpu_seconds(pid)
                answers, _whole = pool.submit(load, port, request, connections, seconds).result()
                used.setdefault(pid, []).append(1e6 * (cpu_seconds(pid) - before) / len(answers))
        mine, other = (float(np.median(used[pid])) for _, pid in (ours, naive))
        table.add(title, mine, other, mine / other)


if __name__ == "__main__":
    sys.exit(main())
