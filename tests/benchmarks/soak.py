"""The service under mixed load while new revisions are published: python tests/benchmarks/soak.py --minutes 5

Of a Lambertian material whose albedo is its revision's number / 1000, so that every answer tells which revision its
numbers are of. Exits with 1 after an answer that is an error or mixes revisions, or if memory goes on growing.
"""

from __future__ import annotations

import argparse
import http.client
import io
import json
import sys
import tempfile
import threading
import time
import zipfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from service import as_npy, points, served

from brdfdb.grids import Grid
from brdfdb.layout import Layout
from brdfdb.materials import Material
from brdfdb.revisions import collect
from brdfdb.staging import publish_dataset
from brdfdb.tabulate import tabulate

GRID = Grid({"theta_i": [0, 30, 60, 85], "theta_r": [0, 30, 60, 85], "delta_phi": [0, 90, 180]})
NAME = "changing"
OFF = 1e-6  # of float32 tables
GROWTH = 1.1  # of memory, from the middle of the time to its end
MANY = points(2000)


def published(store: Path, revision: int) -> None:
    """A revision whose albedo says which it is."""
    table = {"title": "Changing", "model": "lambert", "source": "no paper", "parameters": {"rho": revision / 1000}}
    found, _ = publish_dataset(store, NAME, tabulate(Layout(Material.from_table(NAME, table), GRID)))
    assert found == f"r{revision:06d}", found


def number(revision: str) -> int:
    return int(revision[1:])


def one(get: Callable[..., Any]) -> bool:
    """One point: the value is that of the revision it names."""
    answer = json.loads(get(f"/v1/materials/{NAME}/lookup?theta_i=10&theta_r=40")[0])
    return bool(abs(answer["brdf"] * np.pi * 1000 - number(answer["revision"])) < OFF * 1000)


def many(get: Callable[..., Any]) -> bool:
    """Thousands of points as .npy: one revision, that of the ETag."""
    body, headers = get(f"/v1/materials/{NAME}/lookup?format=npy", as_npy(MANY))
    values = np.load(io.BytesIO(body)) * np.pi * 1000
    revision = number(headers["etag"].strip('"').split("-")[1])
    return bool(np.all(np.abs(values - revision) < OFF * 1000))


def described(get: Callable[..., Any]) -> bool:
    """A description: parameters and revision agree."""
    answer = json.loads(get(f"/v1/materials/{NAME}")[0])
    return bool(answer["parameters"][0]["value"] * 1000 == number(answer["revision"]))


def albedo(get: Callable[..., Any]) -> bool:
    """An integral over one revision."""
    answer = json.loads(get(f"/v1/materials/{NAME}/albedo")[0])
    return bool(np.all(np.abs(np.array(answer["albedo"]) * 1000 - number(answer["revision"])) < 1.0))


def downloaded(get: Callable[..., Any]) -> bool:
    """A zip of one revision."""
    archive = zipfile.ZipFile(io.BytesIO(get(f"/v1/materials/{NAME}/download.zarr")[0]))
    return archive.testzip() is None and "zarr.json" in archive.namelist()


def listed(get: Callable[..., Any]) -> bool:
    """A list that shows it."""
    return [line["name"] for line in json.loads(get("/v1/materials")[0])["materials"]] == [NAME]


ASKED = {
    "one point": one,
    "2000 points": many,
    "material": described,
    "albedo": albedo,
    "zip": downloaded,
    "list": listed,
}


class Soak:
    """Clients that ask until they are told to stop, and what they saw."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.stop = threading.Event()
        self.right: Counter[str] = Counter()
        self.wrong: list[str] = []

    def client(self, what: str) -> None:
        """Ask one kind of question over one connection."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)

        def get(path: str, body: bytes | None = None) -> tuple[bytes, dict[str, str]]:
            media = {"Content-Type": "application/x-npy"} if body else {}
            connection.request("POST" if body else "GET", path, body, media)
            answer = connection.getresponse()
            content = answer.read()
            if answer.status != 200:
                raise RuntimeError(f"{answer.status}: {content[:300]!r}")
            return content, {key.lower(): value for key, value in answer.getheaders()}

        while not self.stop.is_set():
            try:
                if ASKED[what](get):
                    self.right[what] += 1
                else:
                    self.wrong.append(f"{what}: revisions are mixed")
            except Exception as error:
                self.wrong.append(f"{what}: {type(error).__name__}: {error}")
                connection.close()


def resident(pid: int) -> float:
    """Memory of a process [MB]."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--every", type=float, default=1.0, metavar="S", help="seconds between revisions")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder)
        published(store, 1)
        with served(str(store)) as (port, pid, _):
            soak = Soak(port)
            threads = [threading.Thread(target=soak.client, args=(what,)) for what in ASKED]
            for thread in threads:
                thread.start()
            start, revision, memory = time.monotonic(), 1, []
            while time.monotonic() - start < 60.0 * options.minutes:
                time.sleep(options.every)
                revision += 1
                published(store, revision)
                if revision % 10 == 0:
                    collect(store, keep=3)
                memory.append(resident(pid))
            soak.stop.set()
            for thread in threads:
                thread.join()
    half = len(memory) // 2
    table = Table(title=f"{options.minutes:g} minutes, {revision} revisions")
    table.add_column("asked")
    table.add_column("answers", justify="right")
    for what, count in soak.right.items():
        table.add_row(what, str(count))
    Console().print(table)
    print(f"memory: {memory[0]:.0f} MB at first, {memory[half]:.0f} MB half way, {memory[-1]:.0f} MB at the end")
    for line, count in Counter(soak.wrong).most_common(10):
        print(f"{count} times {line}")
    grown = memory[-1] > GROWTH * memory[half]
    if grown:
        print("memory goes on growing")
    return 1 if soak.wrong or grown or set(soak.right) != set(ASKED) else 0


if __name__ == "__main__":
    sys.exit(main())
