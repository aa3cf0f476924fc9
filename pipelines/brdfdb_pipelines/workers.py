"""Where the tasks of a build run: threads, processes, or a dask cluster, all of them a concurrent.futures Executor."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from brdfdb.errors import BrdfdbError, import_extra

_CONNECT_S = 10  # for the scheduler to answer
_ASK_S = 1.0  # how often a cluster is asked for its size: it may grow


class WorkersError(BrdfdbError):
    """Workers or a scheduler that do not answer."""


@dataclass(frozen=True)
class Workers:
    """An executor, and how many tasks it runs at a time, which may change; 0 while it has no workers."""

    executor: Executor
    slots: Callable[[], int]


@contextmanager
def threads(count: int) -> Iterator[Workers]:
    """Threads of this process: kernels and codecs hold no lock of the interpreter."""
    with ThreadPoolExecutor(count) as executor:
        yield Workers(executor, lambda: count)


@contextmanager
def processes(count: int) -> Iterator[Workers]:
    """Processes of this machine, started afresh: a fork would inherit locks of threads that it does not have."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(count, mp_context=context, initializer=_start_process) as executor:
        yield Workers(executor, lambda: count)


def _start_process() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all of them; the builder decides
    parent = multiprocessing.parent_process()
    if parent is not None:

        def leave() -> None:
            parent.join()
            os._exit(1)  # a builder that was killed does not tell its workers

        threading.Thread(target=leave, daemon=True).start()


@contextmanager
def cluster(address: str) -> Iterator[Workers]:
    """The workers of a dask scheduler that is running; they see the store under the same path.

    Raises
    ------
    WorkersError
        If nothing answers there; from `slots`, if the scheduler is gone.
    MissingExtraError
        If dask is not installed.
    """
    distributed: Any = import_extra("distributed")
    try:
        client = distributed.Client(address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise WorkersError(f"no dask scheduler answers at {address}") from error
    # a scheduler that dies is one sentence of ours; dask gives its loggers levels of their own
    for name in ("distributed", "distributed.client", "distributed.core", "tornado", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    asked, known = -_ASK_S, 1

    def slots() -> int:
        nonlocal asked, known
        if time.monotonic() - asked >= _ASK_S:
            try:
                known = sum(client.nthreads().values())
            except OSError as error:
                raise WorkersError(f"the dask scheduler at {address} is gone; build again to resume") from error
            asked = time.monotonic()
        return known

    with client:
        yield Workers(client.get_executor(pure=False), slots)


def lost(error: BaseException) -> bool:
    """Whether an error says that the workers are gone, and nothing of what they worked on."""
    return isinstance(error, BrokenProcessPool | CancelledError) or type(error).__name__ == "KilledWorker"
