"""`brdfdb serve`: a socket, one or more worker processes, and an end that lets requests finish."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
import socket
import sys
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

import orjson
import uvicorn

import brdfdb
from brdfdb.errors import BrdfdbError, ParameterError
from brdfdb_api.http.protocol import BoundedProtocol
from brdfdb_api.serving.settings import Settings

PAUSE_S = 1.0  # time before a failed worker is replaced [s]
GRACE_S = 10  # time for requests in flight when the server stops [s]

LOG = logging.getLogger("brdfdb.server")
OTHERS = ("uvicorn", LOG.name, "py.warnings")  # loggers other than that of requests


class ServerError(BrdfdbError):
    """A service that cannot listen, or whose worker failed."""


def serve(store_dir: Path, host: str, port: int, workers: int = 1, snapshot: str | None = None) -> None:
    """Serve a store over HTTP until interrupted.

    Parameters
    ----------
    store_dir : Path
        Directory that ``brdfdb build --store`` wrote.
    host : str
        Name or address to listen on.
    port : int
        0 to 65535; 0 takes any free port.
    workers : int
        Processes that answer, each with tables of its own in memory.
    snapshot : str, optional
        Name of the snapshot that is served whatever is built later; by default ``BRDFDB_SNAPSHOT``, or none.

    Raises
    ------
    brdfdb.errors.StoreError
        If there is no store at `store_dir`, or no such snapshot in it.
    ParameterError
        If the port is out of range, or a variable ``BRDFDB_*`` has a value that is not allowed.
    ServerError
        If `host` is not an address of this machine or the port is taken; or if a worker fails.
    """
    if not 0 <= port <= 65535:
        raise ParameterError("port", f"{port} is outside [0, 65535]", port, (0, 65535))
    os.environ["BRDFDB_STORE"] = str(store_dir)  # the workers read it
    if snapshot is not None:
        os.environ["BRDFDB_SNAPSHOT"] = snapshot
    settings = Settings.from_environment()
    brdfdb.open(store_dir, snapshot=settings.snapshot)
    config = _config()
    with contextlib.ExitStack() as stack:
        listener = stack.enter_context(_listening(host, port))
        port = listener.getsockname()[1]
        print(f"serving {store_dir} at http://{f'[{host}]' if ':' in host else host}:{port}/", flush=True)
        stack.enter_context(_ended_by_signals())
        if workers == 1:
            uvicorn.Server(config).run(sockets=[listener])
        else:
            # directory where workers write their counts, so that each can report all of them
            counts = stack.enter_context(tempfile.TemporaryDirectory(prefix="brdfdb-metrics-"))
            asyncio.run(_keep(workers, listener, counts))


async def _keep(workers: int, listener: socket.socket, counts: str) -> None:
    """Keep a number of workers running until a signal; ServerError if one ends with an error of its own."""
    loop, stopping = asyncio.get_running_loop(), asyncio.Event()
    command = (sys.executable, "-P", "-m", "brdfdb_api.server", str(listener.fileno()))
    environment = {**os.environ, "PROMETHEUS_MULTIPROC_DIR": counts}

    def stop() -> None:
        listener.close()  # before the workers close theirs: it would accept connections that nobody answers
        stopping.set()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.remove_signal_handler(number)  # a second signal ends this process at once

    async def worker() -> int:
        # In a process group of its own: Ctrl-C goes to this process only. The worker stops when its stdin ends.
        process = await asyncio.create_subprocess_exec(
            *command, stdin=asyncio.subprocess.PIPE, pass_fds=[listener.fileno()], process_group=0, env=environment
        )
        ends = asyncio.create_task(process.wait()), asyncio.create_task(stopping.wait())
        await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        if not stopping.is_set():
            LOG.error("worker %d ended with status %d", process.pid, await process.wait())
        assert process.stdin is not None
        process.stdin.close()
        return await process.wait()

    async def place() -> int:
        status = 0
        while not stopping.is_set():
            status = await worker()
            if status > 0 and not stopping.is_set():  # it would fail again; a killed worker is replaced
                stop()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(stopping.wait(), PAUSE_S)
        return status

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop)
    status = max(await asyncio.gather(*(place() for _ in range(workers))))
    if status > 0:
        raise ServerError(f"a worker ended with status {status}; its log says why")


def _work(descriptor: int) -> None:
    """Run a worker on the socket that the parent listens on."""
    server = uvicorn.Server(_config())

    def wait() -> None:
        os.read(sys.stdin.fileno(), 1)
        server.should_exit = True

    threading.Thread(target=wait, daemon=True).start()
    with _ended_by_signals():
        server.run(sockets=[socket.socket(fileno=descriptor)])


def _config() -> uvicorn.Config:
    logging.captureWarnings(True)
    return uvicorn.Config(
        "brdfdb_api:create_app",
        factory=True,
        http=BoundedProtocol,
        access_log=False,
        log_config={
            "version": 1,
            "disable_existing_loggers": False,
            "formatters": {"lines": {"()": _Lines}},
            "handlers": {"stderr": {"class": "logging.StreamHandler", "formatter": "lines"}},
            "loggers": {name: {"handlers": ["stderr"], "propagate": False} for name in OTHERS},
        },
        log_level="warning",
        timeout_graceful_shutdown=GRACE_S,
    )


class _Lines(logging.Formatter):
    """Formatter of other messages of the server as lines of JSON."""

    def format(self, record: logging.LogRecord) -> str:
        line = {"time": round(record.created, 3), "failed": record.getMessage().strip()}
        if record.exc_info:
            line["traceback"] = self.formatException(record.exc_info)
        return orjson.dumps(line).decode()


@contextlib.contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Treat SIGTERM like Ctrl-C, and neither as an error: uvicorn raises them again after the last answer."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with contextlib.suppress(KeyboardInterrupt):
            yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _listening(host: str, port: int) -> socket.socket:
    """Return a socket that listens; ServerError where that is not possible."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # asyncio sets TCP_NODELAY only on a socket that names its protocol; without it, each small answer takes 40 ms.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen(1024)
    except (OSError, UnicodeError) as error:  # UnicodeError: a label of the name is empty or too long
        listener.close()
        reason = error.strerror if isinstance(error, OSError) else "not the name of a machine"
        raise ServerError(f"cannot listen on {host}, port {port}: {reason}") from error
    return listener


if __name__ == "__main__":
    _work(int(sys.argv[1]))
