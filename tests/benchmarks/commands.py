"""The time of whole commands, which is what a user waits for: ``python tests/benchmarks/commands.py``.

Each command runs in a process of its own. Cold means that no compiled code is kept yet. Seconds of the processors,
those of all workers together, depend less on what else the machine does than seconds of the clock.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

ROUNDS = 5  # of the commands that take less than a second or two; the fastest counts
# Of the default recipe on a quiet machine of two cores
WANTED_S = {"build, cached": 12.0, "build, cold": 30.0, "audit": 45.0, "audit, nothing new": 3.0, "lookup": 0.4}
QUICK = 'materials = ["rolled-brass"]\ntolerance = 0.05\n'
MEASURED = "Wall time and processor time of commands on the materials of the papers."


def timed(arguments: Sequence[str], cache: Path | None, rounds: int) -> tuple[float, float]:
    """Return the least seconds of the clock and of the processors that a command takes.

    `cache` is the folder of compiled code; None: that of the installation.
    """
    clock, used = [], []
    environment = os.environ | ({} if cache is None else {"NUMBA_CACHE_DIR": str(cache)})
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # as users have it: modules are compiled once
    for _ in range(rounds):
        before, start = os.times(), time.perf_counter()
        subprocess.run(
            [sys.executable, "-c", "import sys; from brdfdb_pipelines import cli; sys.exit(cli.main())", *arguments],
            env=environment,
            capture_output=True,
            check=True,
        )
        clock.append(time.perf_counter() - start)
        after = os.times()
        used.append(after.children_user + after.children_system - before.children_user - before.children_system)
    return min(clock), min(used)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the seconds of each command, against those that are wanted."""
    sys.path.insert(0, str(Path(__file__).parents[2]))
    from tests.benchmarks.recording import Column, Run

    run = Run("commands", "speed", "What a user waits for", MEASURED)
    options = run.parse(run.parser(__doc__), arguments)
    rounds = 1 if options.quick else ROUNDS
    table = run.table(
        "Seconds of each command",
        Column(name="command", width=24),
        Column(name="clock", unit="s"),
        Column(name="processors", unit="s"),
        Column(name="wanted", unit="s"),
    )
    with tempfile.TemporaryDirectory() as directory:
        folder = Path(directory)
        recipe = folder / "quick.toml"
        recipe.write_text(QUICK, encoding="utf-8")
        what = [str(recipe)] if options.quick else []
        first, second = (["--store", str(folder / name)] for name in ("first", "second"))
        figures = ["--no-figures"] if options.quick else []
        # the first audit draws its pages with kernels that the build did not need
        for name, command, repeated in (
            ("build, cold", ["build", *what, *first], 1),
            ("build, cached", ["build", *what, *second], 1),
            ("build, nothing new", ["build", *what, *second], 1),
            ("audit, first", ["audit", *figures, *first], 1),
            ("audit", ["audit", "--all", *figures, *first], 1),
            ("audit, nothing new", ["audit", *figures, *first], 1),
            ("lookup", ["lookup", "rolled-brass", "30", "0", "30", "180", *first], rounds),
            ("show", ["show", "rolled-brass", *first], rounds),
            ("list", ["list", *first], rounds),
            ("--help", ["--help"], rounds),
        ):
            cache, wanted = (None, None) if options.quick else (folder / "cache", WANTED_S.get(name))
            table.add(name, *timed(command, cache, repeated), wanted)
    run.end()
    return 0


if __name__ == "__main__":
    sys.exit(main())
