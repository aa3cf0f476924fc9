"""Forks: a child goes on with a store that its parent uses in other threads."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.store.a_store import lambert, publish

WAIT_S = 600.0

FORKING = """
import os, signal, sys, threading, time, warnings
import brdfdb
from brdfdb.store.reader import Store
warnings.simplefilter("ignore")  # from Python 3.12 on a fork warns where there are threads
store = Store(sys.argv[1], cache_bytes=1)
over = threading.Event()
store["white"]  # what it imports is there, and zarr's thread runs

def decode():
    while not over.is_set():
        for name in ("white", "black"):  # each displaces the other
            store[name]

threads = [threading.Thread(target=decode, daemon=True) for _ in range(2)]
for thread in threads:
    thread.start()
for number in range(int(sys.argv[2])):
    time.sleep(0.003 * (number % 4))
    if (child := os.fork()) == 0:
        signal.alarm(100)  # a child that hangs dies of it
        os._exit(0 if store["white"].brdf[0, 0, 0] > store["black"].brdf[0, 0, 0] == 0.0 else 1)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if status != 0:
        sys.exit(f"child {number} ended with {status}")
over.set()
for thread in threads:
    thread.join()
"""


@pytest.fixture
def root(tmp_path: Path) -> Path:
    publish(tmp_path, white=lambert(1.0), black=lambert(0.0))
    return tmp_path


def test_a_child_that_was_forked_while_threads_decode_reads_on(root: Path) -> None:
    command = [sys.executable, "-c", FORKING, str(root), "20"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=WAIT_S)
    assert (done.returncode, done.stderr) == (0, "")
