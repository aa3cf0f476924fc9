"""The log: lines of JSON on standard error, written by a thread, which alone waits for their reader."""

from __future__ import annotations

import atexit
import contextlib
import functools
import logging
import os
import threading
import time
from collections import deque

import orjson

LINE = 4096  # length of a line [byte] beyond which pipes mix the lines of several workers
MOST = 10_000  # lines that may wait; further ones are counted, and dropped
BATCH_S = 0.05  # time in which lines gather before they are written [s]
LAST_S = 1.0  # time that the last lines have to be written when the process ends [s]
SHOWN = 100  # characters of a path, and of a query, in a shortened line
KEPT = {"path": slice(SHOWN), "query": slice(SHOWN), "failed": slice(SHOWN), "traceback": slice(-1000, None)}
_STDERR = 2

_waiting: deque[bytes] = deque()
_dropped = 0
_wake = threading.Event()
_hurry = threading.Event()


def write(record: dict[str, object]) -> None:
    """Add a line with a time to the log; a long one is shortened. It is written a little later."""
    global _dropped
    record = {"time": round(time.time(), 3), **record}
    line = orjson.dumps(record, option=orjson.OPT_APPEND_NEWLINE)
    if len(line) > LINE:  # an escaped character takes six at most
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
    """Wait until all lines are written, but not longer than `LAST_S`."""
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
    """Return ASCII text, which orjson writes and terminals show: other characters, lone surrogates too, are escaped."""
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
    """Write lines in one call, as many as pipes do not mix; they wait until they are written."""
    global _dropped
    size = count = 0
    while count < len(_waiting) and (count == 0 or size + len(_waiting[count]) <= LINE):
        size, count = size + len(_waiting[count]), count + 1
    lines = b"".join(_waiting[number] for number in range(count))
    with contextlib.suppress(OSError):  # the reader has gone
        os.write(_STDERR, lines)
    for _ in range(count):
        _waiting.popleft()
    if _dropped and len(_waiting) < MOST // 2:
        dropped, _dropped = _dropped, 0
        write({"failed": f"{dropped} lines of the log were dropped, because nothing read them"})
