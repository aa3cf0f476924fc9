"""Every leaf of what tables state is forged in turn, and audited: it is noticed, or the page on audits lists it.

    python tests/benchmarks/audit_leaves.py             # eight tables of all kinds, some minutes
    python tests/benchmarks/audit_leaves.py --quick     # one table

It ends with exit code 1 if a leaf that is not listed goes unnoticed. False alarms are counted by audit_power.py.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from unittest import mock

sys.path.insert(0, str(Path(__file__).parents[2]))

import brdfdb
from brdfdb.audit import audit, sampling
from brdfdb.audit.finding import Subject
from brdfdb.audit.record import UNCHECKED, expected_of, record_of
from brdfdb.errors import BrdfdbError
from brdfdb.materials import Material
from brdfdb.store.reader import Store
from brdfdb.tables.table import Table
from tests.benchmarks import forged_stores
from tests.benchmarks.recording import Column, Run

SAMPLES = 2000  # of each sampler: what is forged is in the attributes
QUICK = "rolled-brass"
MEASURED = (
    "Attributes of tables changed one at a time, with updated digests: how many changes an audit does not notice."
)


def noticed(table: Table) -> bool:
    """Return whether an audit lets no such table pass."""
    source = table.source if isinstance(table.source, Material) else None
    if record_of(table, expected_of(Subject(table, source)), source).verdict == "violates":
        return True
    return audit(table).verdict not in ("passes", "known published excess")


def main(arguments: Sequence[str] | None = None) -> int:
    """Forge all leaves, and return 1 if one of them is silent."""
    run = Run("audit_leaves", "accuracy", "Forged statements under audit", MEASURED)
    options = run.parse(run.parser(__doc__), arguments)
    columns = ("what it is", "leaves", "noticed", "listed", Column(name="silent"))
    table = run.table("Tables", Column(name="table", width=24), *columns)
    silent: list[str] = []
    with tempfile.TemporaryDirectory() as folder, mock.patch.object(sampling, "SAMPLES", SAMPLES):
        root = Path(folder) / "store"
        for name, kind in forged_stores.build(root).items():
            if options.quick and name != QUICK:
                continue
            attributes = dict(brdfdb.open(root)[name].attrs)
            found = dict.fromkeys(("noticed", "listed", "silent"), 0)
            for path in forged_stores.leaves(attributes):
                leaf = ".".join(map(str, path))
                forged_stores.forge_attributes(root, name, forged_stores.changed(attributes, path))
                try:
                    word = "noticed" if noticed(Store(root)[name]) else "silent"
                except BrdfdbError:  # it is no table
                    word = "noticed"
                listed = any(each.where in ("table", kind) and fnmatchcase(leaf, each.leaf) for each in UNCHECKED)
                word = "listed" if word == "silent" and listed else word
                found[word] += 1
                silent += [f"{name} {leaf}"] if word == "silent" else []
            table.add(name, kind, sum(found.values()), *found.values())
    run.say(f"{len(silent)} leaves are silent{''.join(f'; {each}' for each in silent)}.")
    run.end()
    return 1 if silent else 0


if __name__ == "__main__":
    sys.exit(main())
