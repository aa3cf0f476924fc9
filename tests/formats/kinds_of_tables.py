"""Small tables of several kinds, for tests of formats: grey, anisotropic, diffuse, spectral with a specular part."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from brdfdb.materials import Material
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.table import Table, table_from
from brdfdb.tables.tabulation import tabulate

KINDS = ("ward", "anisotropic ward", "oren-nayar", "copper")
ISOTROPIC = tuple(kind for kind in KINDS if kind != "anisotropic ward")

_THETA = [0, 15, 30, 45, 60, 75, 85, 89.5]
_HALF = {"theta_h": [0, 4, 8, 12, 18, 25, 40, 60, 90], "theta_d": [0, 30, 60, 80, 89], "phi_d": [0, 45, 90]}
_TURNED = {
    "theta_h": _HALF["theta_h"],
    "phi_h": [0, 20, 45, 70, 90],
    "theta_d": _HALF["theta_d"],
    "phi_d": [0, 60, 120, 180],
}
_FACTS: dict[str, tuple[str, dict[str, Any], dict[str, Any], dict[str, Any], list[float] | None]] = {
    "ward": ("ward", {"rho_d": 0.2, "rho_s": 0.1, "alpha_x": 0.2, "alpha_y": 0.2}, {}, _HALF, None),
    "anisotropic ward": ("ward", {"rho_d": 0.2, "rho_s": 0.1, "alpha_x": 0.15, "alpha_y": 0.3}, {}, _TURNED, None),
    "oren-nayar": (
        "oren_nayar_qualitative",
        {"rho": 0.7, "sigma_deg": 30.0},
        {},
        {"theta_i": _THETA, "theta_r": _THETA, "delta_phi": [0, 45, 90, 135, 180]},
        None,
    ),
    "copper": (
        "he_torrance",
        {"sigma_0_um": 0.1, "tau_um": 1.5, "a": 0.0},
        {"refractive_index": "main/Cu/Johnson"},
        {"theta_i": _THETA, "theta_r": _THETA, "delta_phi": np.arange(0, 181, 15)},
        [400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0],
    ),
}


@functools.cache
def table_of(kind: str) -> Table:
    """Return the table of one of `KINDS`."""
    model, parameters, about, axes, wavelength_nm = _FACTS[kind]
    name = kind.replace(" ", "-")
    entries = {"title": name, "model": model, "source": "no paper", "parameters": parameters, **about}
    layout = Layout(
        Material.from_table(name, entries), Grid(axes), None if not wavelength_nm else np.array(wavelength_nm)
    )
    dataset = tabulate(layout)
    arrays = {str(key): np.asarray(variable.values) for key, variable in dataset.variables.items()}
    return table_from(name, "r000001", arrays, dataset.attrs)
