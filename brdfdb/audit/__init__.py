"""The audit of a table: what it and its model conserve, where they jump or err, and where the model is valid."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from importlib.metadata import version

from brdfdb.audit.energy import energy_of
from brdfdb.audit.findings import AuditReport, MaterialAudit, Verdict
from brdfdb.audit.nodes import nodes_of
from brdfdb.audit.pairs import pairs_of
from brdfdb.audit.reciprocity import reciprocity_of
from brdfdb.audit.sampling import sampling_of
from brdfdb.audit.smoothness import smoothness_of
from brdfdb.audit.table_error import table_error_of
from brdfdb.audit.validity import validity_of
from brdfdb.audit.values import values_of
from brdfdb.errors import BrdfdbError
from brdfdb.figure import Figure
from brdfdb.materials import Material
from brdfdb.tables.albedo import linear_in_angles
from brdfdb.tables.table import Table

__all__ = ["AuditReport", "MaterialAudit", "audit", "report"]


def audit(table: Table, *, accept_excess: bool = False) -> MaterialAudit:
    """Audit one table: what it says of the table holds for what is looked up in it.

    Parameters
    ----------
    table : Table
        A decoded table; its attributes name the model and its parameters.
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
    material = table.source
    if not isinstance(material, Material):
        raise BrdfdbError(f"{table.name}: the table does not name a model that is known here, so it cannot be audited")
    pairs = pairs_of(table, material)
    energy = energy_of(table, material, accept_excess=accept_excess)
    reciprocity = reciprocity_of(table, pairs)
    # what is linear between its nodes is no less than they are
    values = values_of(table, None if linear_in_angles(table) else pairs.table[pairs.drawn.above])
    smoothness = smoothness_of(table, material, pairs)
    nodes = nodes_of(table, material)
    table_error = table_error_of(table, material, pairs, nodes.verdict)
    sampling = sampling_of(table, material)
    found = (
        *(energy.verdict, reciprocity.verdict, values.positivity, values.finiteness),
        *(nodes.verdict, smoothness.verdict, table_error.verdict, sampling.verdict),
    )
    order: tuple[Verdict, ...] = ("violates", "accepted excess", "known published excess")
    worst: Verdict = next((word for word in order if word in found), "passes")
    return MaterialAudit(
        material=table.name,
        revision=table.revision,
        model=str(table.attrs["model"]),
        energy=energy,
        reciprocity=reciprocity,
        values=values,
        nodes=nodes,
        smoothness=smoothness,
        table_error=table_error,
        sampling=sampling,
        validity=validity_of(material, table.wavelength_nm),
        verdict=worst,
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
