"""The power of the audit: planted tables that it must name, and random sound materials that it must not.

    python tests/benchmarks/audit_power.py             # every planted table and 200 materials, some minutes
    python tests/benchmarks/audit_power.py --quick     # the planted tables and 16 materials

It ends with exit code 1 if a planted table passes, or a sound one does not.
"""

from __future__ import annotations

import argparse
import functools
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.audit import audit, sampling
from tests.benchmarks.planted_tables import PLANTED, reasons_of
from tests.benchmarks.sound_materials import materials

SAMPLES = 2000  # of each sampler: what is planted is in the tables


def planted() -> int:
    """Print a line for each planted table, and return how many were missed."""
    missed = 0
    for name, make in PLANTED.items():
        start = time.process_time()
        found = audit(make())
        named = found.verdict == "violates"
        missed += not named
        took = time.process_time() - start
        print(f"{'named ' if named else 'MISSED'} {name} ({took:.1f} s): {'; '.join(reasons_of(found))}", flush=True)
    print(f"{len(PLANTED) - missed} of {len(PLANTED)} planted tables named", flush=True)
    return missed


def sound(count: int, seed: int) -> int:
    """Print the false alarms among random sound materials, and return how many there are."""
    alarms = number = 0
    for number, (words, table) in enumerate(materials(count, seed), 1):
        found = audit(table)
        if found.verdict != "passes":
            alarms += 1
            print(f"ALARM {words}: {'; '.join(reasons_of(found))}", flush=True)
        if number % 20 == 0:
            print(f"{number} sound materials, {alarms} false alarms", flush=True)
    print(f"{alarms} false alarms among {number} sound materials", flush=True)
    return alarms


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="16 sound materials")
    parser.add_argument("--count", type=int, default=200, metavar="N", help="sound materials (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=15, metavar="N", help="of the materials (default: %(default)s)")
    parser.add_argument("--only", choices=("planted", "sound"), help="one of the two parts")
    options = parser.parse_args()
    sampling.SAMPLES = SAMPLES
    parts = {
        "planted": planted,
        "sound": functools.partial(sound, 16 if options.quick else options.count, options.seed),
    }
    wrong = sum(part() for name, part in parts.items() if options.only in (None, name))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
