"""Commands in forks of a process that has imported the program: each starts within milliseconds."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

# A fork is safe while there is one thread
_CODE = """
import json, os, resource, signal, sys
from brdfdb_pipelines import cli
exec(sys.argv[1])
for line in sys.stdin:
    arguments, told, seconds = json.loads(line)
    if (child := os.fork()) == 0:
        if seconds:
            resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))  # of this child alone
            signal.alarm(20 * seconds)  # ends a child that waits and takes no processor time
        os.dup2(os.open(told, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 1)
        os.dup2(1, 2)
        os._exit(cli.main(arguments))
    print(child, flush=True)
    sys.stdin.readline()  # until then the number of the child is not given again, whether it runs or not
    _, status, usage = os.wait4(child, 0)
    print(json.dumps([os.waitstatus_to_exitcode(status), usage.ru_maxrss * 1024]), flush=True)
"""


class Ended(NamedTuple):
    """Exit code and peak memory [byte] of a command."""

    code: int
    peak: int


class Nursery:
    """The process that forks; `prepare` is Python code that it runs first."""

    def __init__(self, prepare: str) -> None:
        command = [sys.executable, "-c", _CODE, prepare]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def __enter__(self) -> Nursery:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._process.communicate(timeout=300.0)

    def run(self, *arguments: object, told: Path, cpu_s: int = 0, kill_after_s: float | None = None) -> Ended:
        """Run a command whose output goes to the file `told`; limit its processor time, or kill it after a time."""
        child = int(self._answer([[str(argument) for argument in arguments], str(told), cpu_s]))
        if kill_after_s is not None:
            time.sleep(kill_after_s)
            os.kill(child, signal.SIGKILL)
        return Ended(*json.loads(self._answer("wait")))

    def _answer(self, said: object) -> str:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(said) + "\n")
        self._process.stdin.flush()
        return self._process.stdout.readline()
