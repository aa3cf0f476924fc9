"""The power of the audit: planted tables that it must name, and random sound materials that it must not.

    python tests/benchmarks/audit_power.py             # every planted table and 200 materials, some minutes
    python tests/benchmarks/audit_power.py --quick     # two planted tables and two materials

It ends with exit code 1 if a planted table passes, or a sound one does not.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from unittest import mock

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.audit import audit, sampling
from tests.benchmarks.planted_tables import PLANTED, reasons_of
from tests.benchmarks.recording import Column, Run
from tests.benchmarks.sound_materials import materials

SAMPLES = 2000  # of each sampler: what is planted is in the tables
COUNT, SEED = 200, 15  # of random sound materials
QUICK, QUICK_COUNT = ("clay times 1.05", "every statistic a tenth"), 2
MEASURED = "Audits of tables with one error each, which must be reported, and of correct tables, which must pass."


def planted(run: Run, names: Sequence[str]) -> int:
    """Audit planted tables, and return how many were missed."""
    table = run.table(
        "Planted tables",
        Column(name="what is wrong", width=52),
        "verdict",
        Column(name="problems named"),
        Column(name="processor time", unit="s"),
    )
    missed = 0
    for name in names:
        start = time.process_time()
        report = audit(PLANTED[name]())
        seconds = time.process_time() - start
        named = report.verdict == "violates"
        missed += not named
        table.add(name, report.verdict, len(reasons_of(report)), seconds)
        if not named:
            print(f"MISSED {name}")
    run.say(f"{len(names) - missed} of {len(names)} planted tables are named.")
    return missed


def sound(run: Run, count: int) -> int:
    """Audit random sound materials, and return the number of false alarms."""
    table = run.table("Sound tables of random materials", Column(name="model", width=32), "tables", "false alarms")
    tables: dict[str, int] = {}
    alarms: dict[str, int] = {}
    for number, (words, made) in enumerate(materials(count, SEED), 1):
        report = audit(made)
        model = str(made.attrs["model"])
        tables[model] = tables.get(model, 0) + 1
        alarms[model] = alarms.get(model, 0) + (report.verdict != "passes")
        if report.verdict != "passes":
            print(f"ALARM {words}: {'; '.join(reasons_of(report))}", flush=True)
        if number % 20 == 0:
            print(f"{number} of {count}", file=sys.stderr, flush=True)
    for model in sorted(tables):
        table.add(model, tables[model], alarms[model])
    run.say(f"{sum(alarms.values())} false alarms among {sum(tables.values())} sound tables.")
    return sum(alarms.values())


def main(arguments: Sequence[str] | None = None) -> int:
    """Audit both kinds of tables, and return 1 if a verdict is wrong."""
    run = Run("audit_power", "accuracy", "Power of the audit", MEASURED)
    options = run.parse(run.parser(__doc__), arguments)
    with mock.patch.object(sampling, "SAMPLES", SAMPLES):
        missed = planted(run, QUICK if options.quick else tuple(PLANTED))
        alarms = sound(run, QUICK_COUNT if options.quick else COUNT)
    run.end()
    return 1 if missed or alarms else 0


if __name__ == "__main__":
    sys.exit(main())
