"""Workers of a build: threads, processes or a dask cluster, each a concurrent.futures Executor."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from brdfdb.errors import BrdfdbError, ParameterError, StoreError, import_extra
from brdfdb.store.lock import is_taken

_CONNECT_S = 10  # time for the scheduler to answer [s]
_ASK_S = 1.0  # interval [s] at which a cluster is asked for its size, which may grow


class WorkersError(BrdfdbError):
    """Workers that fail, or a scheduler that does not answer."""


@dataclass(frozen=True)
class Workers:
    """An executor, the number of tasks that it runs at a time, and what stops it at once, where that is possible.

    The number may change; it is 0 while there are no workers. Workers `apart` are on machines that may not see the
    store.
    """

    executor: Executor
    slots: Callable[[], int]
    stop: Callable[[], None] = lambda: None
    apart: bool = False


class _InTurn(Executor):
    """Runs each task when it is submitted, in the thread that submits it: Ctrl-C interrupts the task."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future

    def map(self, fn: Callable[..., Any], *iterables: Any, **_: Any) -> Iterator[Any]:
        return map(fn, *iterables)


@contextmanager
def threads(count: int) -> Iterator[Workers]:
    """Provide threads of this process; kernels and codecs release the lock of the interpreter."""
    with ThreadPoolExecutor(count) as executor:
        yield Workers(executor, lambda: count)


@contextmanager
def processes(count: int) -> Iterator[Workers]:
    """Provide spawned processes of this machine; forked processes would inherit locks of threads that they lack.

    Ctrl-C kills them: a task may take a minute, and files that a task writes are complete or do not exist.
    """
    context = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())

    with ProcessPoolExecutor(count, mp_context=context, initializer=_start_process) as executor:

        def stop() -> None:
            for process in set(multiprocessing.active_children()) - others:
                process.kill()
            executor.shutdown()  # until all futures have failed: those cancelled before would end its thread in 3.11

        try:
            yield Workers(executor, lambda: count, stop)
        except KeyboardInterrupt:
            stop()
            raise
        except BaseException:
            executor.shutdown(cancel_futures=True)
            raise


def interruptible(count: int) -> AbstractContextManager[Workers]:
    """Provide processes, or this thread itself, for long tasks that may be killed: threads do not stop on Ctrl-C."""
    return processes(count) if count > 1 else nullcontext(Workers(_InTurn(), lambda: 1))


def _start_process() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes; the builder decides
    parent = multiprocessing.parent_process()
    if parent is not None:

        def leave() -> None:
            parent.join()
            os._exit(1)  # if the builder is killed, nothing else stops its workers

        threading.Thread(target=leave, daemon=True).start()


@contextmanager
def cluster(address: str) -> Iterator[Workers]:
    """Provide the workers of a running dask scheduler; they must see the store under the same path.

    WorkersError if nothing answers there, or from `slots` if the scheduler is gone. ParameterError for an address
    without a port; MissingExtraError without dask.
    """
    if ":" not in address:  # dask would wait for half a minute, and then print a traceback
        raise ParameterError("--scheduler", f"{address!r} is not an address such as tcp://10.0.0.1:8786", address)
    distributed: Any = import_extra("distributed")
    # a scheduler that ends is reported below in one sentence; dask sets the levels of its loggers itself, and when
    # Ctrl-C meets one of its requests, tornado reports a NameError of its function `sync`
    for name in ("distributed", "distributed.client", "distributed.core", "tornado", "tornado.application", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        client = distributed.Client(address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise WorkersError(f"no dask scheduler answers at {address}") from error
    asked_at = -_ASK_S
    size = 1

    def slots() -> int:
        nonlocal asked_at, size
        if time.monotonic() - asked_at >= _ASK_S:
            try:
                size = sum(client.nthreads().values())
            except OSError as error:
                raise WorkersError(f"the dask scheduler at {address} is gone; build again to resume") from error
            asked_at = time.monotonic()
        return size

    with client:
        yield Workers(client.get_executor(pure=False), slots, apart=True)


def at_store(token: str, task: Callable[..., Any], *arguments: Any) -> Any:
    """Run a task on a worker, after a look for a file in the store that the builder has locked.

    StoreError, naming the worker, says that it does not see this file, or that it does not see the lock.
    """
    _check_store(token)
    return task(*arguments)


@lru_cache(maxsize=8)  # a worker looks once for each build
def _check_store(token: str) -> None:
    root = Path(token).parents[2]
    try:
        if is_taken(Path(token)):
            return
        sees = f"sees the store at {root}, but not its locks: mount it with locks that all machines share"
    except OSError:
        sees = f"does not see the store at {root}: mount one file system there on all machines"
    raise StoreError(f"{_this_worker()} {sees}")


def at_place(token: Path | None, task: Callable[..., None], *arguments: Any) -> None:
    """Run a task on a worker, after a look for a file that the builder has put into a directory.

    WorkersError says that the worker does not see it, or that the task failed; it names the worker.
    """
    if token and not token.is_file():
        raise WorkersError(f"{_this_worker()} does not see {token.parent}: mount one file system there on all machines")
    try:
        task(*arguments)
    except BrdfdbError as error:
        raise WorkersError(f"{_this_worker()}: {error}") from error


def _this_worker() -> str:
    distributed: Any = import_extra("distributed")
    return f"the worker {distributed.get_worker().address} on the host {socket.gethostname()}"


def lost(error: BaseException) -> bool:
    """Return True if an error means that the workers are gone, and says nothing about their task."""
    return isinstance(error, BrokenProcessPool | CancelledError) or type(error).__name__ == "KilledWorker"
