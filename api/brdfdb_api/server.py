"""`brdfdb serve`: a socket, one or more worker processes, and an end after the last answer."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import logging
import os
import shutil
import signal
import socket
import sys
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import uvicorn

from brdfdb._numba import when_compiling
from brdfdb.errors import BrdfdbError, ParameterError
from brdfdb.store import open_tables
from brdfdb_api import log
from brdfdb_api.settings import Settings

PAUSE_S = 1.0  # time before a failed worker is replaced [s]
LAST_S = 0.5  # time after the signal to stop in which open connections may send further requests [s]
GRACE_S = 10  # time for requests in flight when the service stops [s]
STOPPED_S = LAST_S + GRACE_S + 3.0  # time after which a worker that does not stop is killed [s]
BEAT_S = 1  # time between two heartbeats of a worker [s]
HALTED_S = 15.0  # time without a heartbeat after which a worker is replaced [s]
LOADED_S = 120.0  # time until the first heartbeat, in which packages are loaded [s]
COUNTS_BYTES = 2**20  # size of a file of counters; all addresses and statuses take a tenth of it

OPEN_ADDRESS = "other computers can reach this address: put nginx or Caddy in front of it (see 'Serving on a network')"
COMPILES: dict[str, object] = {"compiles": "kernels, once after an installation; the first answers take longer"}
OTHERS = ("uvicorn", "py.warnings")  # loggers of other packages


class ServerError(BrdfdbError):
    """A service that cannot listen, or whose worker failed."""


def serve(store: Path | str, host: str, port: int, workers: int = 1, snapshot: str | None = None) -> None:
    """Serve a store, a snapshot of it, or an edition, over HTTP until interrupted; port 0 is any free port.

    Raises
    ------
    brdfdb.errors.StoreError
        If there is no store or edition at `store`, or no such snapshot in it.
    ParameterError
        If the port is out of range, or a variable ``BRDFDB_*`` has a value that is not allowed.
    ServerError
        If `host` is not an address of this machine, the port is taken, or a worker fails.
    """
    if not 0 <= port <= 65535:
        raise ParameterError("port", f"{port} is outside [0, 65535]", port, (0, 65535))
    os.environ["BRDFDB_STORE"] = str(store)  # for the workers
    if snapshot is not None:
        os.environ["BRDFDB_SNAPSHOT"] = snapshot
    settings = Settings.from_environment()
    open_tables(store, snapshot=settings.snapshot)
    with contextlib.ExitStack() as stack:
        listener = stack.enter_context(_listening(host, port))
        address, port = listener.getsockname()[:2]
        print(f"serving {store} at http://{f'[{host}]' if ':' in host else host}:{port}/", flush=True)
        if not ipaddress.ip_address(address).is_loopback:
            print(OPEN_ADDRESS, flush=True)
        stack.enter_context(_ended_by_signals())
        if workers == 1:
            stack.enter_context(when_compiling(lambda: log.write(COMPILES)))
            DrainingServer(_config()).run(sockets=[listener])
        else:
            # Directory of the counters of all workers, so that each worker can report their sums
            directory = tempfile.TemporaryDirectory(prefix="brdfdb-metrics-", ignore_cleanup_errors=True)
            counts = stack.enter_context(directory)
            asyncio.run(_keep(workers, listener, counts))


class DrainingServer(uvicorn.Server):
    """A server that still answers requests on open connections for `LAST_S` after the signal to stop."""

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        for server in self.servers:
            server.close()
        self.server_state.default_headers.append((b"connection", b"close"))  # so that clients send no further request
        await asyncio.sleep(LAST_S)
        await super().shutdown(sockets)


async def _keep(workers: int, listener: socket.socket, counts: str) -> None:
    """Keep a number of workers running until a signal; ServerError if a worker fails."""
    loop = asyncio.get_running_loop()
    stopping = asyncio.Event()
    command = (sys.executable, "-P", "-m", "brdfdb_api.server", str(listener.fileno()))
    environment = {**os.environ, "PROMETHEUS_MULTIPROC_DIR": counts}

    def stop() -> None:
        listener.close()  # before the workers close it: it would accept connections that nobody answers
        stopping.set()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.remove_signal_handler(number)  # a second signal ends this process at once

    async def worker() -> int:
        # In a separate process group, so that Ctrl-C reaches this process only. The worker stops when its stdin ends.
        process = await asyncio.create_subprocess_exec(
            *command,
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            pass_fds=[listener.fileno()],
            process_group=0,
            env=environment,
        )
        assert process.stdin is not None
        assert process.stdout is not None
        ends = asyncio.create_task(_ended(process.stdout)), asyncio.create_task(stopping.wait())
        await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        if not stopping.is_set():
            if ends[0].result() == "halted":
                log.write({"failed": f"worker {process.pid} did not respond for {HALTED_S:g} s"})
                process.kill()
            log.write({"failed": f"worker {process.pid} ended with status {await process.wait()}"})
        process.stdin.close()
        try:
            return await asyncio.wait_for(process.wait(), STOPPED_S)
        except TimeoutError:
            log.write({"failed": f"worker {process.pid} did not stop"})
            process.kill()
            return await process.wait()

    async def place() -> int:
        status = 0
        while not stopping.is_set():
            status = await worker()
            if status > 0 and not stopping.is_set():  # it would fail again; only killed workers are replaced
                stop()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(stopping.wait(), PAUSE_S)
        return status

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop)
    status = max(await asyncio.gather(*(place() for _ in range(workers))))
    log.flush()
    if status > 0:
        raise ServerError(f"a worker ended with status {status}; its log has the reason")


async def _ended(heartbeats: asyncio.StreamReader) -> str:
    """Wait until a worker ends or halts; return which."""
    limit = LOADED_S
    try:
        while await asyncio.wait_for(heartbeats.read(64), limit):
            limit = HALTED_S
    except TimeoutError:
        return "halted"
    return "ended"


def _work(descriptor: int) -> None:
    """Run a worker on the socket of the parent until stdin ends; heartbeats go to stdout."""
    heartbeats = os.dup(sys.stdout.fileno())
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    os.set_blocking(heartbeats, False)

    async def beat() -> None:
        with contextlib.suppress(OSError):  # nobody reads any more
            os.write(heartbeats, b".")

    server = DrainingServer(_config(callback_notify=beat, timeout_notify=BEAT_S))

    counts = Path(os.environ["PROMETHEUS_MULTIPROC_DIR"])
    for kind in ("counter", "histogram"):  # mapped files: without their blocks, a full disk kills the process
        try:
            with (counts / f"{kind}_{os.getpid()}.db").open("wb") as file:
                os.posix_fallocate(file.fileno(), 0, COUNTS_BYTES)
        except FileNotFoundError:  # the parent was killed
            return
        except OSError as error:  # the disk is full: the next worker tries again
            log.write({"failed": f"a worker cannot start: {error.strerror}: {counts}"})
            return

    def wait() -> None:
        os.read(sys.stdin.fileno(), 1)
        shutil.rmtree(counts, ignore_errors=True)  # all workers stop, and the parent may have been killed
        if not server.started:
            os._exit(0)  # there is nothing to answer
        server.should_exit = True

    threading.Thread(target=wait, daemon=True).start()
    with _ended_by_signals(), when_compiling(lambda: log.write(COMPILES)):
        server.run(sockets=[socket.socket(fileno=descriptor)])


def _config(**keywords: Any) -> uvicorn.Config:
    logging.captureWarnings(True)
    return uvicorn.Config(
        "brdfdb_api:create_app",
        factory=True,
        http="httptools",
        ws="none",
        access_log=False,
        log_config={
            "version": 1,
            "disable_existing_loggers": False,
            "handlers": {"lines": {"()": log.Handler}},
            "loggers": {name: {"handlers": ["lines"], "propagate": False} for name in OTHERS},
        },
        log_level="warning",
        timeout_graceful_shutdown=GRACE_S,
        **keywords,
    )


@contextlib.contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Treat SIGTERM like Ctrl-C, and neither as an error: uvicorn repeats them after the last answer."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with contextlib.suppress(KeyboardInterrupt):
            yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _listening(host: str, port: int) -> socket.socket:
    """Return a listening socket; ServerError if the address cannot be used."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # asyncio sets TCP_NODELAY only if the socket names its protocol; without it, a small answer takes 40 ms
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen(1024)
    except (OSError, UnicodeError) as error:  # UnicodeError: a label of the name is empty or too long
        listener.close()
        reason = error.strerror if isinstance(error, OSError) else "not a host name"
        raise ServerError(f"cannot listen on {host}, port {port}: {reason}") from error
    return listener


if __name__ == "__main__":
    _work(int(sys.argv[1]))
