"""`brdfdb serve` as a command: several workers that answer as one, and ends at which requests are answered."""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.api import proxies
from tests.api.a_store import publish
from tests.api.connections import BODY, LOOKUP, POINT, WAIT_S, all_of, connected, in_threads, post, wait_until

COUNTED = re.compile(r'^brdfdb_requests_total{route="/v1/materials/{name}/lookup",status="200"} (\d+)', re.MULTILINE)
CLIENTS = 24
LAST_S = 2.0  # time in which requests on open connections are answered after the signal to stop; half a second else [s]
# The command that serves, and the program that it starts as a worker. On a busy machine requests in flight take longer
# than ten seconds
SERVE = """
import sys
from brdfdb_api import server
from brdfdb_pipelines import cli
server.LAST_S, server.HALTED_S, server.STOPPED_S = map(float, sys.argv[2:5])
server.GRACE_S = 300
sys.executable = sys.argv[1]
sys.exit(cli.main(sys.argv[5:]))
"""
WORKER = """\
#!{}
import sys
from brdfdb_api import server
server.LAST_S, server.GRACE_S = {}, 300
server._work(int(sys.argv[-1]))
"""


class Serving:
    """A command that serves, its port and its log."""

    def __init__(self, process: subprocess.Popen[str], log: Path) -> None:
        assert process.stdout is not None
        self.process, self.log = process, log
        self.answered: list[str] = []  # addresses of lookups; a list, because threads ask, too
        self.port = int(process.stdout.readline().rsplit(":", 1)[1].strip(" /\n"))

    def get(self, path: str = POINT) -> tuple[int, bytes]:
        """Status and body of an answer over a new connection."""
        with contextlib.closing(http.client.HTTPConnection("127.0.0.1", self.port, timeout=WAIT_S)) as connection:
            connection.request("GET", path)
            answer = connection.getresponse()
            body = answer.read()
        if answer.status == 200 and path.startswith(LOOKUP):
            self.answered.append(path)
        return answer.status, body

    @property
    def workers(self) -> set[int]:
        """Processes that the command started."""
        return {
            int(pid) for pid in Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
        }

    @contextlib.contextmanager
    def alone(self, worker: int) -> Iterator[None]:
        """While all other workers are halted."""
        others = self.workers - {worker}
        for other in others:
            os.kill(other, signal.SIGSTOP)
        try:
            yield
        finally:
            for other in others:
                os.kill(other, signal.SIGCONT)

    def count(self) -> int:
        """Lookups of one point that were answered, as /metrics says. A worker counts once its answer is sent."""
        return sum(map(int, COUNTED.findall(self.get("/metrics")[1].decode())))

    def counts_all(self) -> bool:
        """Whether /metrics says as many as were answered here."""
        return self.count() == len(self.answered)

    def logged(self) -> list[dict[str, object]]:
        """The whole lines of the log; an error where one is no JSON."""
        return [json.loads(line) for line in self.log.read_text().splitlines(keepends=True) if line.endswith("\n")]


@contextlib.contextmanager
def serving(
    store: Path,
    log: Path,
    workers: int,
    *,
    ready: bool = True,
    last_s: float = 0.5,
    halted_s: float = 3600.0,  # a worker that a test halts is not replaced meanwhile
    stopped_s: float = 600.0,
    log_is_read: bool = True,
) -> Iterator[Serving]:
    """A command that serves a store; if `ready`, with the kernels of all workers loaded."""
    worker = log.with_name("worker")
    worker.write_text(WORKER.format(sys.executable, last_s), encoding="utf-8")
    worker.chmod(0o755)
    command = [sys.executable, "-c", SERVE, str(worker), str(last_s), str(halted_s), str(stopped_s)]
    command += ["serve", "--store", str(store), "--port", "0", "--workers", str(workers)]
    with (
        log.open("w") as errors,
        subprocess.Popen(
            command,
            env={**os.environ, "TMPDIR": str(log.parent)},  # where one that is killed leaves its counts
            stdout=subprocess.PIPE,
            stderr=errors if log_is_read else subprocess.PIPE,
            text=True,
        ) as process,
    ):
        found = Serving(process, log)
        try:
            wait_until(lambda: len(found.workers) == workers * (workers > 1))
            if ready:
                wait_until(lambda: found.get("/readyz")[0] == 200)
                for worker in found.workers:
                    with found.alone(worker):
                        wait_until(lambda: found.get("/readyz")[0] == 200)
            yield found
        finally:
            process.terminate()


@pytest.fixture(scope="module")
def pair(grey_store: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    """Two workers."""
    with serving(grey_store, tmp_path_factory.mktemp("pair") / "log", 2) as found:
        yield found
        found.process.terminate()
        assert found.process.wait(WAIT_S) == 0


def test_all_workers_answer_the_same_revision_after_a_publication(grey_store: Path, pair: Serving) -> None:
    for rho in (0.5, 0.75):
        revision = publish(grey_store, "grey", "lambert", rho=rho)
        answers = []
        for worker in pair.workers:
            with pair.alone(worker):
                answers.append(json.loads(pair.get()[1]))
        assert [answer["revision"] for answer in answers] == [revision] * 2
        assert answers[0] == answers[1]


def test_any_worker_counts_the_requests_of_all(pair: Serving) -> None:
    for asked, worker in enumerate(pair.workers, 3):
        with pair.alone(worker):
            for _ in range(asked):
                pair.get()
    wait_until(pair.counts_all)
    for worker in pair.workers:
        with pair.alone(worker):
            assert pair.counts_all()


def test_a_worker_that_is_killed_is_replaced_and_what_it_counted_stays(pair: Serving) -> None:
    wait_until(pair.counts_all)
    before = pair.workers
    killed = min(before)
    os.kill(killed, signal.SIGKILL)
    while not pair.workers - before:
        assert pair.get()[0] == 200
    wait_until(pair.counts_all)
    (new,) = pair.workers - before
    with pair.alone(new):
        assert pair.get()[0] == 200
        wait_until(pair.counts_all)
    wait_until(lambda: any(str(killed) in str(line.get("failed")) for line in pair.logged()))


def test_lines_of_the_log_are_whole_under_load(pair: Serving) -> None:
    queries = [f"theta_i=10&theta_r=20&phi_r={number}{'0' * 300}" for number in range(100)]

    def load() -> None:
        for query in queries:
            pair.get(f"{LOOKUP}?{query}")

    def found() -> Counter[object]:
        return Counter(line.get("query", line.get("failed")) for line in pair.logged())

    with in_threads(load, 4):
        pass
    with connected(pair.port) as connection:
        connection.sendall(b"no HTTP\r\n\r\n")
        assert connection.recv(65536).startswith(b"HTTP/1.1 400 ")
    expected = {**dict.fromkeys(queries, 4), "Invalid HTTP request received.": 1}
    wait_until(lambda: expected.items() <= found().items())  # a line is written once its answer is sent


@pytest.mark.parametrize(("workers", "word"), [(1, signal.SIGTERM), (2, signal.SIGINT)])
def test_requests_are_answered_after_a_signal(
    grey_store: Path, tmp_path: Path, workers: int, word: signal.Signals
) -> None:
    with serving(grey_store, tmp_path / "log", workers, last_s=LAST_S) as served:
        statuses: Counter[int] = Counter()
        refused: list[ConnectionError] = []

        def ask() -> None:
            try:
                while True:
                    statuses[served.get()[0]] += 1
            except (ConnectionRefusedError, ConnectionResetError) as error:  # reset: nobody had accepted it
                refused.append(error)

        request = f"GET {POINT} HTTP/1.1\r\nHost: x\r\n\r\n".encode()
        idle, used, half = connected(served.port), connected(served.port), connected(served.port)
        used.sendall(request)
        first = b""
        while not first.endswith(b"}"):
            first += used.recv(65536)
        half.sendall(post(BODY[:10], length=len(BODY)))
        with in_threads(ask, 4):
            time.sleep(0.1)
            children = served.workers
            served.process.send_signal(word)
            idle.sendall(request)
            used.sendall(request)
        half.sendall(BODY[10:])  # when nobody is let in any more
        for connection in (idle, used, half):
            answer = all_of(connection)
            assert answer.startswith(b"HTTP/1.1 200 ")
            assert b'"specular_reflectance"' in answer
        assert served.process.wait(WAIT_S) == 0
    assert len(refused) == 4
    assert set(statuses) == {200}
    # 503: before kernels were loaded
    others = [line for line in served.logged() if line.get("status") not in (200, 503)]
    assert [line for line in others if "compiles" not in line] == []
    assert not any(Path(f"/proc/{child}").exists() for child in children)


def test_a_worker_that_fails_ends_the_server_with_a_sentence(grey_store: Path, tmp_path: Path) -> None:
    (tmp_path / "fastapi.py").write_text(  # workers alone import it
        "import warnings\nwarnings.warn('beware')\nraise RuntimeError('no such luck')\n"
    )
    command = [sys.executable, "-m", "brdfdb_pipelines.cli", "serve", "--store", str(grey_store), "--port", "0"]
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    ended = subprocess.run(
        [*command, "--workers", "2"], env=environment, capture_output=True, text=True, timeout=WAIT_S, check=False
    )
    said = ended.stderr.splitlines()
    assert (ended.returncode, said[-1]) == (2, "brdfdb: a worker ended with status 1; its log has the reason")
    assert "RuntimeError: no such luck" in ended.stderr
    # two workers write at once: a line of the log may begin in the middle of a line of the other's traceback
    warned = [json.loads(line[line.index("{") :])["failed"] for line in said if "UserWarning" in line]
    assert warned
    assert all("UserWarning: beware" in line for line in warned)


def test_workers_end_with_the_command_that_started_them_even_while_they_start(grey_store: Path, tmp_path: Path) -> None:
    with serving(grey_store, tmp_path / "log", 2, ready=False) as served:
        workers = served.workers
        served.process.kill()
        wait_until(lambda: not any(map(_runs, workers)))
    assert len(workers) == 2
    assert list(tmp_path.glob("brdfdb-metrics-*")) == []
    assert served.logged() == []


def test_a_log_that_nobody_reads_stops_neither_answers_nor_the_end(grey_store: Path, tmp_path: Path) -> None:
    with serving(grey_store, tmp_path / "log", 2, log_is_read=False) as served:
        for _ in range(100):  # 300 kB of lines; a pipe holds 64
            assert served.get(f"{POINT}&phi_r={'0' * 3000}")[0] == 200
        served.process.send_signal(signal.SIGTERM)
        assert served.process.wait(WAIT_S) == 0


def test_a_halted_worker_is_replaced_and_does_not_keep_the_server_from_ending(grey_store: Path, tmp_path: Path) -> None:
    with serving(grey_store, tmp_path / "log", 2, halted_s=6.0, stopped_s=1.0) as served:
        first, second = sorted(served.workers)
        time.sleep(2.0)  # signs of life come each second
        os.kill(first, signal.SIGSTOP)
        wait_until(lambda: len(served.workers - {first, second}) == 1)
        assert not Path(f"/proc/{first}").exists()
        for _ in range(4):
            assert served.get()[0] == 200
        os.kill(second, signal.SIGSTOP)
        served.process.send_signal(signal.SIGTERM)
        assert served.process.wait(WAIT_S) == 0
    assert not Path(f"/proc/{second}").exists()


def test_counts_of_workers_have_room_before_a_disk_is_full(pair: Serving) -> None:
    (folder,) = pair.log.parent.glob("brdfdb-metrics-*")
    files = [file.stat() for file in folder.glob("*.db")]
    assert len(files) >= 4
    assert all(512 * file.st_blocks >= file.st_size for file in files)  # SIGBUS ends who writes to what has no block


@pytest.mark.parametrize("proxy", [proxies.nginx, proxies.caddy])
def test_workers_are_replaced_one_by_one_behind_a_proxy_without_a_lost_request(
    grey_store: Path, tmp_path: Path, proxy: Callable[[Path, int], contextlib.AbstractContextManager[int]]
) -> None:
    proxies.program(proxy.__name__)
    with serving(grey_store, tmp_path / "log", 2) as served, proxy(tmp_path, served.port) as port:
        stop, statuses = threading.Event(), Counter[object]()

        def ask() -> None:
            client = http.client.HTTPConnection("127.0.0.1", port, timeout=WAIT_S)
            while not stop.wait(0.005):
                is_post = sum(statuses.values()) % 4 == 0
                try:
                    client.request(*(("POST", LOOKUP, BODY) if is_post else ("GET", POINT)))
                    answer = client.getresponse()
                    answer.read()
                    statuses[answer.status] += 1
                except OSError as error:
                    statuses[repr(error)] += 1
                    client.close()
            client.close()

        with in_threads(ask, CLIENTS):
            for worker in sorted(served.workers):
                others = served.workers
                os.kill(worker, signal.SIGTERM)
                wait_until(lambda others=others: len(served.workers - others) == 1)
                (new,) = served.workers - others
                with served.alone(new):
                    wait_until(lambda: served.get("/readyz")[0] == 200)
            stop.set()
        assert set(statuses) == {200}


def _runs(pid: int) -> bool:
    """Whether a process is there and not only its exit status."""
    with contextlib.suppress(FileNotFoundError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False
