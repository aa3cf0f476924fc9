"""Sweeps that become editions: ``python tests/benchmarks/editions.py [COUNT...]``.

Two dask workers without a common directory build sweeps of small Oren-Nayar tables into a bucket of an S3 server on
this machine (moto). The processor time and the memory of builder, scheduler and workers are those that the system
counts. The smallest sweep is built into a store first, on threads: that is the time of a material without an edition.
"""

from __future__ import annotations

import math
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[2]))

import boto3

import brdfdb
from tests.benchmarks.recording import Column, Run

COUNTS, QUICK_COUNTS = (10_000, 100_000), (8,)
IN_STORE, QUICK_IN_STORE = 3000, 8
WORKERS = 2
MEASURED = "The cost of a sweep that dask workers without a common directory build into a bucket."
RECIPE = """\
title = "Plaster over albedo and roughness"
materials = ["plaster"]
[grids.isotropic]
theta_i_deg = [0, 15, 30, 45, 60, 75, 89]
theta_r_deg = [0, 15, 30, 45, 60, 75, 89]
delta_phi_deg = [0, 30, 60, 90, 120, 150, 180]
[sweep.plaster]
title = "Plaster"
model = "oren_nayar"
source = "no paper"
[sweep.plaster.parameters]
rho = {rho}
sigma_deg = {sigma}
"""


class Cost(NamedTuple):
    """The cost of a process: its processor time [s], and its largest memory [byte]."""

    cpu: float
    memory: int


def recipe(folder: Path, count: int) -> Path:
    """Write the recipe of a sweep with about the same number of values for both parameters."""
    rows = max(divisor for divisor in range(1, math.isqrt(count) + 1) if count % divisor == 0)
    rho = [round(0.95 * (number + 1) / rows, 6) for number in range(rows)]
    columns = count // rows
    sigma = [round(1.0 + 59.0 * number / (columns - 1), 6) for number in range(columns)]
    path = folder / f"{count}.toml"
    path.write_text(RECIPE.format(rho=rho, sigma=sigma), encoding="utf-8")
    return path


def free_port() -> int:
    """Return a port of this machine that nothing uses."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


def wait_for(port: int) -> None:
    """Wait until a server listens."""
    for _ in range(300):
        with socket.socket() as client:
            if client.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise TimeoutError(f"nothing listens at port {port}")


def ended(process: subprocess.Popen[bytes], sent: int | None = None) -> Cost:
    """Wait for the end of a process, after a signal if one is given, and return its cost."""
    if sent is not None:
        process.send_signal(sent)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return Cost(usage.ru_utime + usage.ru_stime, 1024 * usage.ru_maxrss)


def in_a_store(folder: Path, count: int) -> Cost:
    """Build a sweep into a store on threads."""
    command = (sys.executable, "-m", "brdfdb_pipelines.cli", "build", str(recipe(folder, count)))
    process = subprocess.Popen((*command, "--store", str(folder / "store"), "--json"), stdout=subprocess.DEVNULL)
    cost = ended(process)
    assert process.returncode == 0
    return cost


def into_a_bucket(folder: Path, count: int, destination: str) -> dict[str, Cost]:
    """Build a sweep into a bucket by a dask cluster of this machine; return the cost of each kind of process."""
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    dask = (sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port))
    scheduler = subprocess.Popen((*dask, "--no-dashboard"), cwd=folder, stderr=subprocess.DEVNULL)
    wait_for(port)
    workers = []
    for number in range(WORKERS):
        own = folder / f"worker-{number}"
        own.mkdir(exist_ok=True)
        dask = (sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny")
        once = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}  # as the nanny of a worker sets it, which is left out here
        workers.append(subprocess.Popen((*dask, "--no-dashboard"), cwd=own, stderr=subprocess.DEVNULL, env=once))
    command = (sys.executable, "-m", "brdfdb_pipelines.cli", "build", str(recipe(folder, count)), "--to", destination)
    builder = subprocess.Popen((*command, "--scheduler", address, "--json"), stdout=subprocess.DEVNULL)
    costs = {"builder": ended(builder)}
    assert builder.returncode == 0
    of_workers = [ended(worker, signal.SIGTERM) for worker in workers]
    costs["workers"] = Cost(sum(cost.cpu for cost in of_workers), max(cost.memory for cost in of_workers))
    costs["scheduler"] = ended(scheduler, signal.SIGTERM)
    return costs


def main(arguments: Sequence[str] | None = None) -> int:
    """Build a sweep into a store, and sweeps of each number of materials into a bucket."""
    run = Run("editions", "speed", "Sweeps into a bucket", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("counts", nargs="*", type=int, metavar="COUNT", help=f"by default {COUNTS}")
    options = run.parse(parser, arguments)
    counts = sorted(options.counts or (QUICK_COUNTS if options.quick else COUNTS))
    port = free_port()
    endpoint = f"http://127.0.0.1:{port}"
    options_of_s3 = {"AWS_ENDPOINT_URL": endpoint, "AWS_ALLOW_HTTP": "true", "AWS_REGION": "us-east-1"}
    os.environ.update(options_of_s3, AWS_ACCESS_KEY_ID="none", AWS_SECRET_ACCESS_KEY="none")
    command = (sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port))
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        wait_for(port)
        boto3.client("s3", endpoint_url=endpoint).create_bucket(Bucket="sweeps")
        with tempfile.TemporaryDirectory() as folder:
            _measure(run, Path(folder), counts, QUICK_IN_STORE if options.quick else IN_STORE)
    finally:
        ended(server, signal.SIGTERM)
    run.end()
    return 0


def _measure(run: Run, folder: Path, counts: Sequence[int], in_store: int) -> None:
    table = run.table(
        "A material of a sweep of small Oren-Nayar tables",
        *(Column(name="built", width=32), Column(name="materials"), Column(name="processor", unit="ms")),
        *(Column(name="builder", unit="ms"), Column(name="scheduler", unit="ms"), Column(name="wall", unit="ms")),
        *(Column(name="memory of a worker", unit="MB"), Column(name="memory of the builder", unit="MB")),
    )
    start = time.perf_counter()
    cost = in_a_store(folder, in_store)
    wall = time.perf_counter() - start
    table.add(
        "into a store, threads",
        in_store,
        1e3 * cost.cpu / in_store,
        *(None, None, 1e3 * wall / in_store, None),
        cost.memory / 1e6,
    )
    times = []
    for count in counts:
        destination = f"s3://sweeps/{count}"
        start = time.perf_counter()
        costs = into_a_bucket(folder, count, destination)
        wall = time.perf_counter() - start
        cpu = sum(cost.cpu for cost in costs.values())
        times.append(cpu)
        memory = [costs[name].memory / 1e6 for name in ("workers", "builder")]
        row = [1e3 * seconds / count for seconds in (cpu, costs["builder"].cpu, costs["scheduler"].cpu, wall)]
        table.add("into a bucket, 2 dask workers", count, *row, *memory)
        edition = brdfdb.open(destination)
        assert len(edition) == count
        edition[edition.index["groups"][0]["first"]].lookup(0.1, 0.0, 0.2, 0.0)
        groups = edition.index["groups"]
        objects = sum(entry["objects"] for entry in groups)
        run.say(f"{count} materials: {edition.index['bytes'] / count:.0f} bytes a material, {objects} objects.")
    if len(counts) > 1:
        exponent = math.log(times[-1] / times[0]) / math.log(counts[-1] / counts[0])
        grown = f"from {counts[0]} to {counts[-1]} materials"
        run.say(f"The exponent of the growth of processor time {grown} is {exponent:.3f}.")


if __name__ == "__main__":
    sys.exit(main())
