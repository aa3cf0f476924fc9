"""The audit job: audit tables of a store, write the JSON report, show what was found."""

from __future__ import annotations

from pathlib import Path

import brdfdb
from brdfdb.audit import AuditReport, MaterialAudit, audit, report
from brdfdb.audit.findings import Asymmetry
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
    numbers = ("albedo up to", "model", "table", "smallest f_r")
    terminal.print_table(
        f"Audit of {root}, the tables as interpolated (model, table: largest asymmetry under exchange of directions)",
        ("material", "verdict", *numbers),
        [_row(a) for a in audits],
        numbers=numbers,
    )
    for a in audits:
        for reason in _reasons(a):
            print(f"{a.material}: {reason}")
    if any(a.energy.verdict == "violates" for a in audits):
        print("a table whose grid is too coarse for its lobe can exceed 1 where its model does not: try a finer grid")
    within = sum(a.energy.verdict == "passes" and bool(a.energy.reason) for a in audits)
    if within:
        print(f"{within} exceed 1 by no more than the error that they state, or that of the integration, and pass")
    known = sum(a.verdict == "known published excess" for a in audits)
    print(
        f"{len(audits)} audited: {len(audits) - known - len(found.violations)} pass, {known} exceed 1 as their "
        f"published parameters are known to, {len(found.violations)} violate; report in {report_path}"
    )
    return found


def _row(a: MaterialAudit) -> tuple[str, ...]:
    albedo = "not finite" if a.energy.max_albedo is None else f"{a.energy.max_albedo:.4f}"
    return (
        a.material,
        a.verdict,
        f"{albedo} at {a.energy.max_at_theta_i_deg:4g}°",
        f"{_largest(a.reciprocity.model_random, a.reciprocity.model_lobe):.0e}",
        f"{_largest(a.reciprocity.table_random, a.reciprocity.table_lobe, a.reciprocity.table_nodes):.0e}",
        "none" if a.values.smallest is None else f"{a.values.smallest:.3g}",
    )


def _largest(*found: Asymmetry | None) -> float:
    return max(each.max for each in found if each is not None)


def _reasons(a: MaterialAudit) -> list[str]:
    """A sentence for each finding that is not a pass, or is one only because of the error that the table states."""
    reasons = [a.energy.reason] if a.energy.reason else []
    reasons += ["not reciprocal"] if a.reciprocity.verdict == "violates" else []
    reasons += [f"{a.values.negative} negative values"] if a.values.negative else []
    reasons += [f"{a.values.not_finite} values are not finite"] if a.values.not_finite else []
    for what, jumps in (("model", a.smoothness.model), ("table", a.smoothness.table)):
        worst = max(jumps, key=lambda jump: jump.largest / jump.tolerance)
        if worst.largest > worst.tolerance:
            reasons.append(f"the {what} jumps by {worst.largest:.2g} at a seam, {worst.seam}: {worst.where}")
    error = a.table_error
    if error.verdict == "violates" and error.stated_p99 is not None:
        fresh = "no number" if error.fresh_p99 is None else terminal.error(error.fresh_p99)
        reasons.append(f"its error (p99) is {fresh}, not the {terminal.error(error.stated_p99)} that it states")
    if a.sampling.verdict == "violates":
        reasons.append("samples of the model do not have the density or the albedo that they should")
    return reasons
