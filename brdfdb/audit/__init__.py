"""The audit of a table: energy, reciprocity, values, jumps and errors of table and model, validity of the model."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from importlib.metadata import version

import numpy as np

from brdfdb.audit.finding import DECISIVE, Finding, NotJudged, Sentence, Subject, TableVerdict
from brdfdb.audit.glints import resting_on
from brdfdb.audit.registry import FINDINGS
from brdfdb.audit.report import AuditReport, MaterialAudit, as_published, conserves_energy, explanations
from brdfdb.errors import ParameterError
from brdfdb.figure import Figure
from brdfdb.materials import Material, Source
from brdfdb.models.shared_integrals import sharing
from brdfdb.tables.table import Table

__all__ = ["FINDINGS", "AuditReport", "Finding", "MaterialAudit", "audit", "report"]


def audit(table: Table, *, source: Source | None = None, accept_excess: bool = False) -> MaterialAudit:
    """Return the audit of one table: each finding of `FINDINGS`, on values that are looked up in the table.

    `source` is that of the table, for example a function, which a store does not hold; by default the source that the
    table names. If it is not known, the table is audited alone, and findings that need a source are not judged. With
    `accept_excess` the model may reflect more than it receives at these parameters, and the table with it.
    ParameterError if the table is behind a service.

    Notes
    -----
    The verdict is "not judged" if nothing says what the values of the table are of; a table of measured data or of a
    function is judged as far as that goes without them. The verdict on energy is "known published excess" if the albedo
    of the model exceeds 1, its parameters are those of a preset, and the albedos of model and table are within the
    excess that is recorded for the preset. It is "accepted excess" if the caller accepts the excess of the model, and
    "violates" if either albedo exceeds 1 otherwise. A table may exceed these limits by as much as its stated error
    explains. A model that "loses" or "gains" light where nothing absorbs is reported, and passes. `as_published` and
    `conserves_energy` answer the two questions that a reader has, of the table and of its model.
    """
    if not isinstance(table, Table):
        raise ParameterError("table", f"{type(table).__name__}: an audit needs a table that is decoded in this process")
    if source is None and isinstance(table.source, Material):
        source = table.source
    subject = Subject(table, source, accept_excess)
    sentences: list[Sentence] = []
    # What is not finite is counted, not flagged
    with (
        np.errstate(divide="ignore", invalid="ignore", over="ignore"),
        sharing(),
    ):  # albedo, furnace and errors of a model integrate at the same directions
        for key, kind in FINDINGS.items():
            finding = subject.findings[key] = kind.judge(subject)
            if isinstance(finding, NotJudged):
                sentences.append(kind.sentence("not judged", finding.reason))
            else:
                sentences += finding.sentences()
    measured = table.metadata.measured
    words = {finding.verdict for finding in subject.findings.values()}
    otherwise: TableVerdict = "not judged" if subject.unrecorded else "passes"
    verdict: TableVerdict = next((word for word in DECISIVE if word in words), otherwise)
    return MaterialAudit(
        material=table.name,
        revision=table.revision,
        manifest_sha256=table.digest,
        model=source.model if isinstance(source, Material) else "",
        findings=subject.findings,
        sentences=sentences,
        as_published=as_published(subject.findings, measured=measured),
        conserves_energy=conserves_energy(subject.findings, measured=measured),
        verdict=verdict,
        verdict_in_words=f"{verdict} {resting_on(measured)}".strip(),
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
        not_judged=[a.material for a in audits if a.verdict == "not judged"],
    )
