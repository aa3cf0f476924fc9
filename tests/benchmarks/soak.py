"""The service under mixed load while new revisions are published: ``python tests/benchmarks/soak.py --minutes 5``.

The albedo of a Lambertian material names the revision in every answer: 0.001 is the first, 0.002 the second, and 0.001
comes again after a thousand. Exits with 1 after an answer that is an error, mixes revisions or is of one that was not
current, or if memory goes on growing.
"""

from __future__ import annotations

import http.client
import io
import json
import sys
import tempfile
import threading
import time
import zipfile
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.materials import Material
from brdfdb.store.publication import publish_dataset
from brdfdb.store.revisions import collect
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import tabulate
from tests.benchmarks.recording import Column, Run
from tests.benchmarks.service import as_npy, points, served

GRID = Grid({"theta_i": [0, 30, 60, 85], "theta_r": [0, 30, 60, 85], "delta_phi": [0, 90, 180]})
NAME = "changing"
KEPT = 60.0  # seconds for which a revision is kept: a busy machine may take long over a request that names one
STEPS = 1000  # of albedo, from one revision to the next; far more than are current while a request is answered
OFF = 1e-7  # of float32 tables, albedos up to 1: 3e-9 measured up to 0.06, neighbours are 1e-3 apart
GROWTH = 1.1  # of memory, from the middle of the time to its end
MANY = points(2000)
MEASURED = (
    "Answers of the service while new revisions are published: each must be that of a revision which was current."
)
QUICK_MINUTES, QUICK_EVERY = 0.01, 0.2

Get = Callable[..., bytes]
Told = Sequence[float] | np.ndarray  # steps of albedo; none where there is nothing to tell yet


def step(revision: int) -> int:
    """The step of albedo that a revision has, 1 to `STEPS`."""
    return 1 + (revision - 1) % STEPS


def published(store: Path, revision: int) -> None:
    """A revision whose albedo says which it is."""
    table = {
        "title": "Changing",
        "model": "lambert",
        "source": "no paper",
        "parameters": {"rho": step(revision) / STEPS},
    }
    found, _ = publish_dataset(store, NAME, tabulate(Layout(Material.from_table(NAME, table), GRID)))
    assert found == f"r{revision:06d}", found


def step_of(answer: dict[str, Any]) -> int:
    """The step of the revision that an answer names."""
    return step(int(answer["revision"][1:]))


def one(get: Get) -> Told:
    """One point: its value and the revision that it names."""
    answer = json.loads(get(f"/v1/materials/{NAME}/lookup?theta_i=10&theta_r=40"))
    return [answer["brdf"] * np.pi * STEPS, step_of(answer)]


def bound(get: Get) -> Told:
    """One point of the revision that is current, by its own address."""
    current = json.loads(get(f"/v1/materials/{NAME}"))
    answer = json.loads(get(f"/v1/materials/{NAME}/revisions/{current['revision']}/lookup?theta_i=10&theta_r=40"))
    return [answer["brdf"] * np.pi * STEPS, step_of(answer), step_of(current)]


def many(get: Get) -> Told:
    """Thousands of points as .npy, which name no revision."""
    return np.load(io.BytesIO(get(f"/v1/materials/{NAME}/lookup?format=npy", as_npy(MANY)))) * np.pi * STEPS


def described(get: Get) -> Told:
    """A description: its parameter and its revision."""
    answer = json.loads(get(f"/v1/materials/{NAME}"))
    return [answer["parameters"][0]["value"] * STEPS, step_of(answer)]


def albedo(get: Get) -> Told:
    """Integrals, one for each theta_i."""
    answer = json.loads(get(f"/v1/materials/{NAME}/albedo"))
    return [*np.ravel(answer["albedo"]) * STEPS, step_of(answer)]


def downloaded(get: Get) -> Told:
    """A zip: its parameter, if its files are whole."""
    archive = zipfile.ZipFile(io.BytesIO(get(f"/v1/materials/{NAME}/download.zarr")))
    if broken := archive.testzip():
        raise RuntimeError(f"{broken} is damaged")
    return [json.loads(archive.read("zarr.json"))["attributes"]["parameters"]["rho"] * STEPS]


def listed(get: Get) -> Told:
    """A list that shows it."""
    (line,) = json.loads(get("/v1/materials"))["materials"]
    return [step_of(line)]


ASKED = {
    "one point": one,
    "one point of a revision": bound,
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
        self.begun = self.done = 1  # the newest revision that is being published, and that is
        self.stop = threading.Event()
        self.right: Counter[str] = Counter()
        self.wrong: list[str] = []

    def client(self, what: str) -> None:
        """Ask one kind of question over one connection."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)

        def get(path: str, body: bytes | None = None) -> bytes:
            media = {"Content-Type": "application/x-npy"} if body else {}
            connection.request("POST" if body else "GET", path, body, media)
            answer = connection.getresponse()
            content = answer.read()
            if answer.status != 200:
                raise RuntimeError(f"{answer.status}: {content[:300]!r}")
            return content

        while not self.stop.is_set():
            try:
                oldest = self.done
                told = np.asarray(ASKED[what](get), dtype=float)
                if told.size == 0:
                    continue
                found = round(told[0])
                if np.abs(told - found).max() > OFF * STEPS:
                    self.wrong.append(f"{what}: revisions are mixed")
                elif found not in map(step, range(oldest, self.begun + 1)):
                    self.wrong.append(f"{what}: of a revision that was not current")
                else:
                    self.right[what] += 1
            except Exception as error:
                self.wrong.append(f"{what}: {type(error).__name__}: {error}")
                connection.close()
        connection.close()


def resident(pid: int) -> float:
    """Memory of a process [MB]."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def main(arguments: Sequence[str] | None = None) -> int:
    """Ask while revisions are published, and return 1 if an answer is wrong."""
    run = Run("soak", "accuracy", "The service while revisions change", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--every", type=float, default=1.0, metavar="S", help="seconds between revisions")
    options = run.parse(parser, arguments)
    minutes, every = (QUICK_MINUTES, QUICK_EVERY) if options.quick else (options.minutes, options.every)
    with tempfile.TemporaryDirectory() as folder:
        soak, revision, memory = soaked(Path(folder), 60.0 * minutes, every)
    table = run.table(f"{minutes:g} minutes, {revision} revisions", Column(name="request", width=28), "right answers")
    for what in ASKED:
        table.add(what, soak.right[what])
    half = len(memory) // 2
    memories = run.table("Memory of the service", Column(name="time", width=28), Column(name="memory", unit="MB"))
    for name, megabytes in (("at first", memory[0]), ("half way", memory[half]), ("at the end", memory[-1])):
        memories.add(name, megabytes)
    for line, count in Counter(soak.wrong).most_common(10):
        print(f"{count} times {line}")
    run.say(f"{soak.right.total()} answers are right, {len(soak.wrong)} are wrong.")
    # a quick run is too short to see what memory does
    grown = not options.quick and memory[-1] > GROWTH * memory[half]
    if grown:
        run.say("Memory goes on growing.")
    run.end()
    return 1 if soak.wrong or grown or set(soak.right) != set(ASKED) else 0


def soaked(store: Path, seconds: float, every: float) -> tuple[Soak, int, list[float]]:
    """Publish and ask for some seconds, and until each kind of question has an answer."""
    published(store, 1)
    with served(str(store)) as (port, pid, _):
        soak = Soak(port)
        threads = [threading.Thread(target=soak.client, args=(what,)) for what in ASKED]
        for thread in threads:
            thread.start()
        start, revision, memory = time.monotonic(), 1, [resident(pid)]
        while time.monotonic() - start < seconds or not (soak.wrong or set(soak.right) == set(ASKED)):
            time.sleep(every)
            revision = soak.begun = revision + 1
            published(store, revision)
            soak.done = revision
            if revision % 10 == 0:
                collect(store, keep=max(10, round(KEPT / every)))
            memory.append(resident(pid))
        soak.stop.set()
        for thread in threads:
            thread.join()
    return soak, revision, memory


if __name__ == "__main__":
    sys.exit(main())
