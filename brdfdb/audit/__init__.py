"""The audit of a table: what it and its model conserve, where they jump or err, and where the model is valid."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from importlib.metadata import version

from brdfdb.albedo import linear_in_angles, material_of
from brdfdb.audit.energy import energy_of
from brdfdb.audit.findings import AuditReport, MaterialAudit, Verdict
from brdfdb.audit.pairs import pairs_of
from brdfdb.audit.reciprocity import reciprocity_of
from brdfdb.audit.sampling import sampling_of
from brdfdb.audit.smoothness import smoothness_of
from brdfdb.audit.table_error import table_error_of
from brdfdb.audit.validity import validity_of
from brdfdb.audit.values import values_of
from brdfdb.figure import Figure
from brdfdb.lookup import Table

__all__ = ["AuditReport", "MaterialAudit", "audit", "report"]


def audit(table: Table) -> MaterialAudit:
    """Audit one table: what it says of the table holds for what is looked up in it.

    Parameters
    ----------
    table : Table
        A decoded table; its attributes name the model and its parameters.

    Returns
    -------
    MaterialAudit
        The findings. The verdict on energy is "known published excess" where the albedo of the model exceeds 1, and
        it and that of the table no further than the material's attribute ``known_excess``, or its model, says; it is
        "violates" where either exceeds 1 otherwise. A table that states its error may exceed 1, or what is known, by
        what that error explains. That a model "loses" light that nothing absorbs is said, and passes.
    """
    material = material_of(table)
    pairs = pairs_of(table, material)
    energy = energy_of(table, material)
    reciprocity = reciprocity_of(table, pairs)
    # what is linear between its nodes is no less than they are
    values = values_of(table, None if linear_in_angles(table) else pairs.table[pairs.drawn.above])
    smoothness = smoothness_of(table, material, pairs)
    table_error = table_error_of(table, material, pairs)
    sampling = sampling_of(table, material)
    found = (
        *(energy.verdict, reciprocity.verdict, values.positivity, values.finiteness),
        *(smoothness.verdict, table_error.verdict, sampling.verdict),
    )
    excused: Verdict = "known published excess" if "known published excess" in found else "passes"
    return MaterialAudit(
        material=table.name,
        revision=table.revision,
        model=str(table.attrs["model"]),
        energy=energy,
        reciprocity=reciprocity,
        values=values,
        smoothness=smoothness,
        table_error=table_error,
        sampling=sampling,
        validity=validity_of(material, table.wavelength_nm),
        verdict="violates" if "violates" in found else excused,
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
    """Collect audits, figures and what could not be audited into the report of a store."""
    return AuditReport(
        store=store,
        brdfdb=version("brdfdb"),
        when=when,
        materials=list(audits),
        atlas=list(atlas),
        gallery=list(gallery),
        damaged=list(damaged),
        violations=[a.material for a in audits if a.verdict == "violates"],
    )
