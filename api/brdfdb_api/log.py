"""The log: lines of JSON on standard error. A thread writes them, so that no request waits for their reader."""

from __future__ import annotations

import atexit
import contextlib
import functools
import itertools
import logging
import os
import threading
import time
from collections import deque

import orjson

LINE = 4096  # largest length of a line [byte]: pipes mix longer lines of several workers
MOST = 10_000  # lines in the queue; further lines are counted and dropped
BATCH_S = 0.05  # time between two writes [s]
LAST_S = 1.0  # time for the last lines when the process ends [s]
SHOWN = 100  # characters of a path, and of a query, in a shortened line
KEPT = {"path": slice(SHOWN), "query": slice(SHOWN), "failed": slice(SHOWN), "traceback": slice(-1000, None)}
_STDERR = 2

_waiting: deque[bytes] = deque()
_dropped = 0
_wake = threading.Event()
_hurry = threading.Event()


def write(record: dict[str, object]) -> None:
    """Add a line with the time to the queue of the log; a long line is shortened."""
    global _dropped
    record = {"time": round(time.time(), 3), **record}
    line = orjson.dumps(record, option=orjson.OPT_APPEND_NEWLINE)
    if len(line) > LINE:
        short = {key: str(record[key])[part] for key, part in KEPT.items() if key in record}
        line = orjson.dumps(record | short, option=orjson.OPT_APPEND_NEWLINE)
    if len(_waiting) >= MOST:
        _dropped += 1
        return
    _waiting.append(line)
    if not _wake.is_set():
        _start()
        _wake.set()


def flush() -> None:
    """Wait until all lines are written, for at most `LAST_S`."""
    end = time.monotonic() + LAST_S
    _hurry.set()
    while _waiting and time.monotonic() < end:
        time.sleep(0.0005)
    _hurry.clear()


class Handler(logging.Handler):
    """Handler of `logging` that adds messages of other packages to the log."""

    def emit(self, record: logging.LogRecord) -> None:
        line: dict[str, object] = {"failed": ascii_of(record.getMessage().strip())}
        if record.exc_info:
            line["traceback"] = ascii_of(logging.Formatter().formatException(record.exc_info))
        write(line)


def ascii_of(text: str) -> str:
    """Return text with all characters escaped that are not ASCII, lone surrogates included."""
    return text.encode("ascii", "backslashreplace").decode()


@functools.cache
def _start() -> None:
    threading.Thread(target=_run, daemon=True, name="log").start()
    atexit.register(flush)


def _run() -> None:
    while True:
        _wake.wait()
        _hurry.wait(BATCH_S)
        _wake.clear()
        while _waiting:
            _write_some()


def _write_some() -> None:
    """Write lines in one call, at most `LINE` bytes, and then remove them from the queue."""
    global _dropped
    size = count = 0
    while count < len(_waiting) and (count == 0 or size + len(_waiting[count]) <= LINE):
        size += len(_waiting[count])
        count += 1
    lines = b"".join(itertools.islice(_waiting, count))
    with contextlib.suppress(OSError):  # nobody reads the log any more
        os.write(_STDERR, lines)
    for _ in range(count):
        _waiting.popleft()
    if _dropped and len(_waiting) < MOST // 2:
        write({"failed": f"{_dropped} lines of the log were dropped, because nothing read them"})
        _dropped = 0
