"""Small tables of presets, one of each kind, for the tests of formats."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path

import numpy as np

import brdfdb
from brdfdb.materials import presets
from brdfdb.store.publication import publish_dataset
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import tabulate

GREY, ANISOTROPIC, DIFFUSE = "white-ceramic-tile", "rolled-brass", "clay-vase"
SPECTRAL, SMOOTH = "scene-copper-sphere", "blue-plastic"
KINDS = (GREY, ANISOTROPIC, DIFFUSE, SPECTRAL, SMOOTH)

_THETAS = [0.0, 10.0, 20.0, 30.0, 37.0, 42.0, 45.0, 48.0, 53.0, 60.0, 70.0, 80.0, 88.0]
_PHIS = [0.0, 60.0, 120.0, 160.0, 172.0, 180.0]


@functools.cache
def small_table(name: str) -> Table:
    """Return a table of a preset with few nodes."""
    material = presets()[name]
    axes = {"theta_i": _THETAS, "theta_r": _THETAS, "delta_phi": _PHIS}
    if material.anisotropic:
        phis = np.linspace(0.0, 360.0, 49).tolist()
        axes = {"theta_i": _THETAS, "phi_i": [0.0, 30.0, 60.0, 90.0], "theta_r": _THETAS, "phi_r": phis}
    wavelengths = {SPECTRAL: np.arange(420.0, 681.0, 20.0), SMOOTH: np.array([460.0])}.get(name)
    with tempfile.TemporaryDirectory() as folder:
        publish_dataset(Path(folder), name, tabulate(Layout(material, Grid(axes), wavelengths)))
        return brdfdb.open(folder)[name]
