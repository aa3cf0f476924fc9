"""Tables of presets of every kind, small enough for tests of formats."""

from __future__ import annotations

import functools

import numpy as np

from brdfdb.materials import presets
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Interpolation, Layout
from brdfdb.tables.table import Table, table_from
from brdfdb.tables.tabulation import tabulate

GREY, ANISOTROPIC, DIFFUSE, SPECTRAL = (
    "plastic-laminate",
    "latex-gloss-rolled-metal",
    "clay-vase",
    "scene-copper-sphere",
)
KINDS = (GREY, ANISOTROPIC, DIFFUSE, SPECTRAL)

_HALF = [0.0, 3.0, 6.0, 10.0, 15.0, 20.0, 30.0, 45.0, 90.0]
_THETA = [0.0, 20.0, 40.0, 55.0, 70.0, 80.0, 89.9]
_GLOSSY = [*np.arange(0.0, 70.0, 6.0), 70.0, 75.0, 80.0, 85.0, 90.0]
_TURNED = [0.0, 60.0, 120.0, 150.0, 165.0, 172.0, 180.0]
_GRIDS = {
    GREY: {"theta_h": _HALF, "theta_d": [0.0, 90.0], "phi_d": [0.0, 90.0]},
    ANISOTROPIC: {"theta_h": _HALF, "phi_h": [0.0, 30.0, 60.0, 90.0], "theta_d": [0.0, 90.0], "phi_d": [0.0, 180.0]},
    DIFFUSE: {"theta_i": _THETA, "theta_r": _THETA, "delta_phi": [0.0, 45.0, 90.0, 135.0, 180.0]},
    SPECTRAL: {"theta_i": _GLOSSY, "theta_r": _GLOSSY, "delta_phi": _TURNED},
}
_WAVELENGTHS_NM = np.array([450.0, 550.0, 650.0])


@functools.cache
def table_of(name: str) -> Table:
    """Return a table of a preset on few nodes, cubic in logarithms, at three wavelengths if it is spectral."""
    material = presets()[name]
    at = _WAVELENGTHS_NM if material.spectral else None
    power = 0.5 if name in (GREY, ANISOTROPIC) else 0.0
    layout = Layout(material, Grid(_GRIDS[name]), at, Interpolation("cubic", True, 1e-4, power))
    dataset = tabulate(layout)
    arrays = {str(key): variable.values for key, variable in dataset.variables.items()}
    return table_from(name, "r000001", arrays, dataset.attrs)
