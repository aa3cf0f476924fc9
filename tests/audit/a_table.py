"""Tables of made-up materials for the tests of the audit, changes of them, and the report as a file holds it."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.audit import MaterialAudit, report
from brdfdb.audit.energy import Energy
from brdfdb.audit.reciprocity import Reciprocity
from brdfdb.audit.sampling import Sampling
from brdfdb.audit.smoothness import Smoothness
from brdfdb.audit.table_error import TableError
from brdfdb.audit.values import ValueCounts
from brdfdb.geometry import degrees
from brdfdb.materials import Material, written_name
from brdfdb.materials.provenance import KnownExcess
from brdfdb.models import MODELS
from brdfdb.parameters import ModelSpec
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import tabulate
from tests.json_schema import validate
from tests.models.draws import middle

SCHEMA = json.loads((Path(__file__).parents[2] / "schemas" / "audit.schema.json").read_text(encoding="utf-8"))

THETA = [0.0, 10.0, 30.0, 60.0, 80.0, 89.5]
ISOTROPIC = Grid({"theta_i": THETA, "theta_r": THETA, "delta_phi": [0, 20, 90, 150, 180]})
UNEQUAL = Grid({"theta_i": [0, 30, 70], "theta_r": [0, 15, 30, 45, 85], "delta_phi": [0, 20, 180]})
ANISOTROPIC = Grid(
    {"theta_i": THETA[::2], "phi_i": [0, 100, 200, 360], "theta_r": THETA[::2], "phi_r": [0, 100, 200, 360]}
)
WAVELENGTHS = np.array([450.0, 500.0, 700.0])


def in_file(spec: ModelSpec) -> dict[str, float]:
    """Return parameters in the middle of their ranges, as files write them."""
    values = middle(spec)
    return {
        written_name(p): float(degrees(values[p.name])) if p.unit == "rad" else values[p.name] for p in spec.parameters
    }


# What a table of each model takes: a model without a line here is tested in its middle
PARAMETERS: dict[str, dict[str, Any]] = {name: in_file(spec) for name, spec in MODELS.items()} | {
    "lambert": {"rho": 0.6},
    "minnaert": {"k": 0.6, "rho": 0.5},
    "oren_nayar": {"rho": 0.6, "sigma_deg": 30},
    "oren_nayar_qualitative": {"rho": 0.6, "sigma_deg": 30},
    "oren_nayar_unidirectional": {"rho": 0.6, "theta_a_deg": 30, "phi_a_deg": 20},
    "oren_nayar_single_slope": {"rho": 0.6, "theta_a_deg": 30},
    "oren_nayar_gaussian": {"rho": 0.6, "sigma_deg": 30},
    "oren_nayar_body_surface": {"rho": 0.6, "sigma_deg": 30, "k_s": 0.02},
    "oren_nayar_fujii": {"rho": 0.6, "sigma": 0.5},
    "oren_nayar_energy_preserving": {"rho": 0.6, "roughness": 0.5},
    "torrance_sparrow": {"sigma_deg": 10},
    "ward": {"rho_d": 0.2, "rho_s": 0.2, "alpha_x": 0.4, "alpha_y": 0.3},
    "ward_half_vector": {"rho_d": 0.2, "rho_s": 0.2, "alpha_x": 0.4, "alpha_y": 0.3},
    "ward_duer": {"rho_d": 0.2, "rho_s": 0.2, "alpha_x": 0.4, "alpha_y": 0.3},
    "ward_bounded": {"rho_d": 0.2, "rho_s": 0.2, "alpha_x": 0.4, "alpha_y": 0.3},
    "he_torrance": {"sigma_0_um": 0.3, "tau_um": 3.0, "a": 0.1},
}


def material(model: str, parameters: dict[str, Any], **more: Any) -> Material:
    spectral = {"refractive_index": "main/Cu/Johnson"} if MODELS[model].spectral else {}
    table = {"title": "Made up", "model": model, "source": "no paper", "parameters": parameters, **spectral, **more}
    return Material.from_table("made-up", table)


def tabulated(made_up: Material, grid: Grid, wavelengths: NDArray[np.float64] | None = None) -> Table:
    dataset = tabulate(Layout(made_up, grid, wavelengths))
    specular = dataset["specular_reflectance"].values.astype(np.float32) if "specular_reflectance" in dataset else None
    brdf = dataset["brdf"].values
    return Table(made_up.name, "r000001", dataset.attrs, grid, wavelengths, brdf, specular)


def lambert(rho: float, grid: Grid = ISOTROPIC, **more: Any) -> Table:
    return tabulated(material("lambert", {"rho": rho}, **more), grid)


def verdicts(found: MaterialAudit) -> dict[str, str]:
    """Every finding that is not a pass."""
    every = {
        "energy": found.of(Energy).table.verdict,
        "reciprocity": found.of(Reciprocity).verdict,
        "positivity": found.of(ValueCounts).positivity,
        "finiteness": found.of(ValueCounts).finiteness,
        "smoothness": found.of(Smoothness).verdict,
        "table_error": found.of(TableError).verdict,
        "sampling": found.of(Sampling).verdict,
    }
    return {name: verdict for name, verdict in every.items() if verdict != "passes"}


ABOUT: dict[str, Any] = {"store": "a store", "when": datetime(2026, 11, 21, tzinfo=UTC)}


def written(audits: list[MaterialAudit]) -> dict[str, Any]:
    """The report as a file holds it, valid by the schema in the repository."""
    document = json.loads(report(audits, **ABOUT).model_dump_json())
    validate(document, SCHEMA)
    return document


def node(table: Table, value: float) -> Table:
    """A copy with one value changed, away from every edge, where light and viewer are not at the same angle."""
    brdf = table.brdf.copy()
    index = (1, 1, 2, 2) if table.anisotropic else (1, 2, 1)
    brdf[index] = value
    return replace(table, values=brdf)


def known(max_albedo: float, from_theta_i_deg: float) -> KnownExcess:
    return KnownExcess(max_albedo=max_albedo, from_theta_i_deg=from_theta_i_deg, citation="Somebody 1991, p. 3")


def fine(step: float) -> Grid:
    theta = np.append(np.arange(0.0, 89.0, step), [89.0, 89.5])
    return Grid({"theta_i": theta, "theta_r": theta, "delta_phi": np.arange(0.0, 181.0, step)})
