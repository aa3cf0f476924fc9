"""The computed libraries: time and size of their tables, and what the audit says of them.

``python tests/benchmarks/libraries.py`` builds each library as `brdfdb build --library NAME` does, in a program of its
own that has to read its kernels, and audits it. It exits with 1 if a table violates, or if the library metals takes
three minutes or more of two cores. Seconds of processors are those of the program and its threads: they say less of
what else the machine does.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.materials import PAPERS, libraries
from tests.benchmarks.recording import Column, Run

MEASURED = "Time and size of the tables of each computed library, built from nothing, and the verdicts of its audit."
MOST_S, CORES = 180.0, 2
QUICK = 'library = "{}"\nmaterials = ["gold-mirror*"]\nwavelengths_nm = [550]\ntolerance = 0.5\n'


def main(arguments: Sequence[str] | None = None) -> int:
    """Build and audit the libraries; return 1 if a promise is broken."""
    run = Run("libraries", "speed", "Libraries of computed materials", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--jobs", type=int, default=CORES)
    options = run.parse(parser, arguments)
    options.jobs = 1 if options.quick else options.jobs  # each job of an audit is a process that has to start
    names = [name for name in libraries() if name != PAPERS]
    table = run.table(
        f"Build and audit with {options.jobs} jobs",
        Column(name="library", width=18),
        Column(name="tables"),
        Column(name="values", unit="1e6"),
        Column(name="build", unit="s"),
        Column(name="processors", unit="s"),
        Column(name="stored", unit="MB"),
        *("passes", "known published excess", "violates"),
        *("inside", "at the edge", "outside"),
    )
    broken: list[str] = []
    for name in names[:1] if options.quick else names:
        with tempfile.TemporaryDirectory() as folder:
            store, report = Path(folder, "store"), Path(folder, "audit.json")
            recipe = Path(folder, "quick.toml")
            recipe.write_text(QUICK.format(name), encoding="utf-8")
            what = [str(recipe)] if options.quick else ["--library", name]
            jobs = ["--store", str(store), "--jobs", str(options.jobs)]
            start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
            events = _output("build", *what, *jobs, "--json")
            seconds, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
            processors = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            planned, done = (
                next(json.loads(line) for line in events.splitlines() if f'"event": "{event}"' in line)
                for event in ("planned", "done")
            )
            _output("audit", *jobs, "--no-figures", "--report", str(report))
            audits = json.loads(report.read_text(encoding="utf-8"))["materials"]
        verdicts = Counter(audit["verdict"] for audit in audits)
        standings = Counter(audit["findings"]["validity"]["verdict"] for audit in audits)
        table.add(
            name,
            done["tables"],
            planned["values"] / 1e6,
            seconds,
            processors,
            done["bytes"] / 1e6,
            *(verdicts[word] for word in ("passes", "known published excess", "violates")),
            *(standings[word] for word in ("inside", "at the edge", "outside")),
        )
        broken += [f"{name}: {verdicts['violates']} violate"] if verdicts["violates"] else []
        slow = name == "metals" and min(seconds, processors / CORES) >= MOST_S
        broken += [f"{name}: {seconds:.0f} s"] if slow else []
    run.say("Broken: " + "; ".join(broken) if broken else "No table violates.")
    run.end()
    return min(len(broken), 1)


def _output(*arguments: str) -> str:
    """Return what a command of the program prints; an audit that finds a violation exits with 1."""
    command = [sys.executable, "-m", "brdfdb_pipelines.cli", *arguments]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode > 1:
        raise RuntimeError(done.stderr)
    return done.stdout


if __name__ == "__main__":
    sys.exit(main())
