"""Energy of a material: of the model behind a table and of the table, and the worse of the two."""

from __future__ import annotations

import numpy as np

from brdfdb.audit.excess import ANGLE_TOLERANCE_DEG, published_excess
from brdfdb.audit.findings import Energy, EnergyVerdict, ModelEnergy
from brdfdb.audit.model_energy import TOLERANCE, model_energy_of
from brdfdb.audit.table_energy import table_energy_of
from brdfdb.materials import Material
from brdfdb.materials.provenance import KnownExcess
from brdfdb.tables.table import Table

_SEVERITY: tuple[EnergyVerdict, ...] = (
    "conserves",
    "loses",
    "known published excess",
    "accepted excess",
    "violates",
)
_ACCEPTED = "accepted, not published"


def energy_of(table: Table, material: Material, *, accept_excess: bool = False) -> Energy:
    """Return the energy of a model and its table. With `accept_excess` both may exceed 1 as far as the model does."""
    known = published_excess(material, table.wavelength_nm)
    claim = str(table.attrs.get("known_excess", {}).get("citation", ""))
    model = model_energy_of(material, table.wavelength_nm, known, claim, accept_excess=accept_excess)
    # what is published, or accepted, is an excess of the model: where it has none, that of a table is the table's own
    excess = {"known published excess": known, "accepted excess": _of_model(model)}.get(model.verdict)
    accepted = model.verdict == "accepted excess"
    stored = table_energy_of(table, excess, "accepted excess" if accepted else "known published excess")
    of_table: EnergyVerdict = "conserves" if stored.verdict == "passes" else stored.verdict
    if _SEVERITY.index(of_table) > _SEVERITY.index(model.verdict):
        reason = stored.reason if of_table.startswith("known") else f"the table {stored.reason}"
        return Energy(model=model, table=stored, verdict=of_table, reason=reason)
    return Energy(model=model, table=stored, verdict=model.verdict, reason=model.reason)


def _of_model(model: ModelEnergy) -> KnownExcess | None:
    """The excess that a model has, as far as it goes."""
    if model.exceeds_1_from_theta_i_deg is None or model.max_albedo is None or not np.isfinite(model.max_albedo):
        return None
    return KnownExcess(
        max_albedo=model.max_albedo + TOLERANCE,
        from_theta_i_deg=max(model.exceeds_1_from_theta_i_deg - 2.0 * ANGLE_TOLERANCE_DEG, 0.0),
        citation=_ACCEPTED,
    )
