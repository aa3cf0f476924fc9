"""Small tables of every kind for the tests of formats: on few nodes, cubic, so that they are smooth between them."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from brdfdb.materials import Material
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Interpolation, Layout
from brdfdb.tables.table import Table, table_from
from brdfdb.tables.tabulation import tabulate

GREY, ANISOTROPIC, DIFFUSE = "grey-ward", "anisotropic-ward", "oren-nayar"
SPECTRAL, SMOOTH = "copper", "smooth-plastic"  # both have a specular part; the second one has one wavelength
KINDS = (GREY, ANISOTROPIC, DIFFUSE, SPECTRAL, SMOOTH)
ISOTROPIC = tuple(kind for kind in KINDS if kind != ANISOTROPIC)
SPECULAR = (SPECTRAL, SMOOTH)
WAVELENGTHS_NM = [400.0, 550.0, 700.0]
ALPHA_X, ALPHA_Y = 0.15, 0.3

_HALF = [0, 3, 6, 10, 15, 20, 30, 45, 90]
_THETA = [0, 20, 40, 55, 70, 80, 89.9]
_GLOSSY = [*range(0, 70, 6), 70, 75, 80, 85, 90]
_LIGHT_VIEWER = {"theta_i": _THETA, "theta_r": _THETA, "delta_phi": [0, 45, 90, 135, 180]}
_MODELS: dict[str, tuple[str, dict[str, Any], str | None]] = {
    GREY: ("ward", {"rho_d": 0.2, "rho_s": 0.1, "alpha_x": 0.2, "alpha_y": 0.2}, None),
    ANISOTROPIC: ("ward", {"rho_d": 0.1, "rho_s": 0.33, "alpha_x": ALPHA_X, "alpha_y": ALPHA_Y}, None),
    DIFFUSE: ("oren_nayar_qualitative", {"rho": 0.7, "sigma_deg": 30.0}, None),
    SPECTRAL: ("he_torrance", {"sigma_0_um": 0.13, "tau_um": 1.2, "a": 0.0}, "main/Cu/Johnson"),
    SMOOTH: ("he_torrance", {"sigma_0_um": 0.0, "tau_um": 1.0, "a": 0.15}, "other/ZeonexE48R/Sultanova"),
}
_AXES: dict[str, dict[str, Any]] = {
    GREY: {"theta_h": _HALF, "theta_d": [0, 45, 90], "phi_d": [0, 90]},
    ANISOTROPIC: {"theta_h": _HALF, "phi_h": range(0, 91, 15), "theta_d": [0, 90], "phi_d": range(0, 181, 60)},
    DIFFUSE: _LIGHT_VIEWER,
    SPECTRAL: {"theta_i": _GLOSSY, "theta_r": _GLOSSY, "delta_phi": [0, 60, 120, 150, 165, 172, 180]},
    SMOOTH: _LIGHT_VIEWER,
}
_WAVELENGTHS_NM = {SPECTRAL: np.array(WAVELENGTHS_NM), SMOOTH: np.array([460.0])}
_FINE_NM = np.arange(420.0, 681.0, 20.0)


@functools.cache
def small_table(kind: str, *, fine_spectrum: bool = False) -> Table:
    """Return the table of one of `KINDS`, which is its name, too; in fine steps of wavelengths for pictures."""
    at = _FINE_NM if fine_spectrum else _WAVELENGTHS_NM.get(kind)
    model, parameters, metal = _MODELS[kind]
    index = {"refractive_index": metal} if metal else {}
    entries = {"title": kind, "model": model, "source": "no paper", "parameters": parameters, **index}
    power = 0.5 if model == "ward" else 0.0
    interpolation = Interpolation("cubic", True, 1e-4, power)
    return table_of(Layout(Material.from_table(kind, entries), Grid(_AXES[kind]), at, interpolation))


def table_of(layout: Layout) -> Table:
    """Return the table of a layout, as a store gives it back."""
    dataset = tabulate(layout)
    arrays = {str(name): np.asarray(variable.values) for name, variable in dataset.variables.items()}
    return table_from(layout.source.name, "r000001", arrays, dataset.attrs)
