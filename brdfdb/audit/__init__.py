"""The audit of a table: what it and its model conserve, where they jump or err, and where the model is valid."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from importlib.metadata import version

from brdfdb.audit.finding import DECISIVE, Finding, NotJudged, Sentence, Subject, Verdict
from brdfdb.audit.registry import FINDINGS
from brdfdb.audit.report import AuditReport, MaterialAudit, explanations
from brdfdb.figure import Figure
from brdfdb.materials import Material, Source
from brdfdb.tables.table import Table

__all__ = ["FINDINGS", "AuditReport", "Finding", "MaterialAudit", "audit", "report"]


def audit(table: Table, *, source: Source | None = None, accept_excess: bool = False) -> MaterialAudit:
    """Audit one table: each finding of `FINDINGS`, for what is looked up in the table.

    Parameters
    ----------
    table : Table
        A decoded table. Where it does not give back its source, the table is audited alone, and findings that take a
        source are not judged.
    source : Source, optional
        Source of the table, such as a function, which no store can give back; by default that of the table.
    accept_excess : bool
        Accept that the model reflects more than it receives at these parameters, and the table with it.

    Returns
    -------
    MaterialAudit
        The findings. The verdict on energy is "known published excess" where the albedo of the model exceeds 1, its
        parameters are those that a paper prints, as a built-in material has them, and the albedos of model and table
        go no further than is recorded there. It is "accepted excess" where the caller accepts that of the model, and
        "violates" where either exceeds 1 otherwise. A table that states its error may exceed 1, or what is known, by
        what that error explains. That a model "loses" light that nothing absorbs is said, and passes.
    """
    if source is None and isinstance(table.source, Material):
        source = table.source
    subject = Subject(table, source, accept_excess)
    sentences: list[Sentence] = []
    for key, kind in FINDINGS.items():
        finding = subject.found[key] = kind.judge(subject)
        if isinstance(finding, NotJudged):
            sentences.append(kind.sentence("not judged", finding.reason))
        else:
            sentences += finding.sentences()
    words = {finding.verdict for finding in subject.found.values()}
    verdict: Verdict = next((word for word in DECISIVE if word in words), "passes")
    return MaterialAudit(
        material=table.name,
        revision=table.revision,
        model=source.model if isinstance(source, Material) else "",
        findings=subject.found,
        sentences=sentences,
        verdict=verdict,
    )


def report(
    audits: Sequence[MaterialAudit],
    *,
    store: str,
    when: datetime,
    atlas: Sequence[Figure] = (),
    gallery: Sequence[Figure] = (),
    damaged: Sequence[str] = (),
) -> AuditReport:
    """Collect audits, figures and sentences on damaged tables into the report of a store."""
    return AuditReport(
        store=store,
        brdfdb=version("brdfdb"),
        when=when,
        explanations=explanations(),
        materials=list(audits),
        atlas=list(atlas),
        gallery=list(gallery),
        damaged=list(damaged),
        violations=[a.material for a in audits if a.verdict == "violates"],
    )
