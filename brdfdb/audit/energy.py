"""Energy of a material: of the model behind a table and of the table, and the worse of the two."""

from __future__ import annotations

from brdfdb.audit.findings import Energy, EnergyVerdict
from brdfdb.audit.known import known_excess
from brdfdb.audit.model_energy import model_energy_of
from brdfdb.audit.table_energy import table_energy_of
from brdfdb.lookup import Table
from brdfdb.materials import Material

_SEVERITY: tuple[EnergyVerdict, ...] = ("conserves", "loses", "known published excess", "violates")


def energy_of(table: Table, material: Material) -> Energy:
    known = known_excess(table, material)
    model = model_energy_of(material, table.wavelength_nm, known)
    # what is published is an excess of the model: where the model has none, that of a table is the table's own
    stored = table_energy_of(table, known if model.verdict == "known published excess" else {})
    of_table: EnergyVerdict = "conserves" if stored.verdict == "passes" else stored.verdict
    if _SEVERITY.index(of_table) > _SEVERITY.index(model.verdict):
        reason = stored.reason if of_table.startswith("known") else f"the table {stored.reason}"
        return Energy(model=model, table=stored, verdict=of_table, reason=reason)
    return Energy(model=model, table=stored, verdict=model.verdict, reason=model.reason)
