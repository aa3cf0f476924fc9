"""The audit job: audit tables of a store, write the JSON report, show what was found."""

from __future__ import annotations

from pathlib import Path

import brdfdb
from brdfdb.audit import AuditReport, MaterialAudit, audit, report
from brdfdb_pipelines import terminal


def run(root: Path, names: list[str], report_path: Path) -> AuditReport:
    """Audit the named materials of a store, or all of them.

    Parameters
    ----------
    root : Path
        Directory of the store.
    names : list of str
        Materials; empty for all.
    report_path : Path
        The JSON report, written when everything has been audited.

    Raises
    ------
    StoreError, UnknownMaterialError
        If the store or a material is missing or damaged: every file is checked against its manifest.
    """
    store = brdfdb.open(root)
    revisions = {name: store.head(name) for name in names or store}
    audits: list[MaterialAudit] = []
    with terminal.progress() as bar:
        for name in bar.track(revisions, description="auditing"):
            store.verify(name)
            audits.append(audit(store[name]))
    found = report(audits)
    report_path.write_text(found.model_dump_json(indent=1) + "\n", encoding="utf-8")
    numbers = ("albedo of model", "of table", "model", "table", "smallest f_r")
    terminal.print_table(
        f"Audit of {root}, the tables as interpolated (model, table: largest asymmetry under exchange of directions)",
        ("material", "verdict", "energy", *numbers),
        [_row(a) for a in audits],
        numbers=numbers,
    )
    for a in audits:
        for reason in _reasons(a):
            print(f"{a.material}: {reason}")
    if any(a.energy.table.verdict == "violates" for a in audits):
        print("a table whose grid is too coarse for its lobe can exceed 1 where its model does not: try a finer grid")
    within = sum(a.energy.table.verdict == "passes" and bool(a.energy.table.reason) for a in audits)
    if within:
        print(f"{within} exceed 1 by no more than the error that they state, or that of the integration, and pass")
    losing = sum(a.energy.verdict == "loses" for a in audits)
    if losing:
        print(
            f"{losing} are of models that lose light even where nothing absorbs it: the report says how much, and where"
        )
    known = sum(a.verdict == "known published excess" for a in audits)
    print(
        f"{len(audits)} audited: {len(audits) - known - len(found.violations)} pass, {known} exceed 1 as their "
        f"published parameters are known to, {len(found.violations)} violate; report in {report_path}"
    )
    return found


def _row(a: MaterialAudit) -> tuple[str, ...]:
    model, table = a.energy.model, a.energy.table
    albedo = "not finite" if table.max_albedo is None else f"{table.max_albedo:.4f}"
    return (
        a.material,
        a.verdict,
        a.energy.verdict,
        f"{model.max_albedo:.4f} at {model.max_at_theta_i_deg:4.3g}°",
        f"{albedo} at {table.max_at_theta_i_deg:4g}°",
        f"{a.reciprocity.model.max:.0e}",
        f"{a.reciprocity.table.max:.0e}",
        "none" if a.values.smallest is None else f"{a.values.smallest:.3g}",
    )


def _reasons(a: MaterialAudit) -> list[str]:
    """A sentence for each finding that is not a pass, or is one only because of the error that the table states."""
    energy = a.energy.reason if a.energy.verdict in ("known published excess", "violates") else a.energy.table.reason
    reasons = [energy] if energy else []
    reasons += ["not reciprocal"] if a.reciprocity.verdict == "violates" else []
    reasons += [f"{a.values.negative} negative values"] if a.values.negative else []
    reasons += [f"{a.values.not_finite} values are not finite"] if a.values.not_finite else []
    return reasons
