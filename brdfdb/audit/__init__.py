"""What a model and its table conserve: energy, reciprocity, positivity and finiteness, with a verdict on each."""

from __future__ import annotations

from collections.abc import Sequence

from brdfdb.albedo import linear_in_angles, material_of
from brdfdb.audit.energy import energy_of
from brdfdb.audit.findings import AuditReport, MaterialAudit, Verdict
from brdfdb.audit.pairs import look_up
from brdfdb.audit.reciprocity import reciprocity_of
from brdfdb.audit.values import values_of
from brdfdb.figure import Figure
from brdfdb.lookup import Table

__all__ = ["AuditReport", "MaterialAudit", "audit", "report"]


def audit(table: Table) -> MaterialAudit:
    """Audit one table: what it says of energy, positivity and finiteness holds for what is looked up in it.

    Parameters
    ----------
    table : Table
        A decoded table; its attributes name the model and its parameters.

    Returns
    -------
    MaterialAudit
        The findings. The verdict on energy is "known published excess" where the albedo exceeds 1 no further than
        the material's attribute ``known_excess``, or its model, says, and "violates" where it exceeds 1 otherwise.
        A table that states its error may exceed either by what that error explains. That a model "loses" light that
        nothing absorbs is said, and passes.
    """
    material, plain = material_of(table), linear_in_angles(table)
    looked_up = None if plain else look_up(table, material)
    energy = energy_of(table, material)
    reciprocity = reciprocity_of(table, material, looked_up)
    values = values_of(table, looked_up)
    found = (energy.verdict, reciprocity.verdict, values.positivity, values.finiteness)
    excused: Verdict = "known published excess" if "known published excess" in found else "passes"
    return MaterialAudit(
        material=table.name,
        revision=table.revision,
        model=str(table.attrs["model"]),
        energy=energy,
        reciprocity=reciprocity,
        values=values,
        verdict="violates" if "violates" in found else excused,
    )


def report(audits: list[MaterialAudit], atlas: Sequence[Figure] = (), gallery: Sequence[Figure] = ()) -> AuditReport:
    """Collect audits and figures into the report of a store."""
    return AuditReport(
        materials=audits,
        atlas=list(atlas),
        gallery=list(gallery),
        violations=[a.material for a in audits if a.verdict == "violates"],
    )
