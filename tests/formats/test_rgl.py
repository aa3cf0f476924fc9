"""Tensor files of RGL: what Mitsuba's `measured` makes of them, and what damaged ones are told."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb import presets
from brdfdb.materials import Material
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.table import Table, table_from
from brdfdb.tables.tabulation import tabulate

# Mitsuba computes in float32; the largest relative difference of f_r measured is 9e-5, where rows of a warp are dark
FLOAT32 = 3e-4
# Mean weight of Mitsuba's samples over the albedo, less 1; measured 0.0035, at 80 degrees
FURNACE = 0.005
# Standard deviation of a sample over the mean; measured 0.09
NOISE = 0.2
LIGHTS_DEG = np.array([0.0, 40.0, 75.0])
LOOSE = 0.1  # tolerance of the files of these tests: small ones are as good a test

Array = NDArray[Any]

ANGLES = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0, 89.0]
HALF, DIFFERENCE = [0, 2, 4, 7, 11, 16, 25, 40, 60, 85], [0, 30, 60, 75, 85]
WARD = {"rho_d": 0.2, "rho_s": 0.1}
KINDS = ("grey-ward", "anisotropic-ward", "oren-nayar", "he-torrance")


@functools.cache
def table_of(kind: str) -> Table:
    """A small table: of a model, on a grid that is coarse on purpose."""
    document: dict[str, Any] = {"title": kind, "source": "no paper"}
    wavelengths = None
    if kind == "grey-ward":
        document |= {"model": "ward", "parameters": WARD | {"alpha_x": 0.15, "alpha_y": 0.15}}
        grid = Grid({"theta_h": HALF, "theta_d": DIFFERENCE, "phi_d": [0, 45, 90]})
    elif kind == "anisotropic-ward":
        document |= {"model": "ward", "parameters": WARD | {"alpha_x": 0.3, "alpha_y": 0.2}}
        grid = Grid({"theta_h": HALF, "phi_h": [0, 30, 60, 90], "theta_d": DIFFERENCE, "phi_d": [0, 90, 180]})
    else:
        document |= {"model": "oren_nayar", "parameters": {"rho": 0.6, "sigma_deg": 30}}
        grid = Grid({"theta_i": ANGLES, "theta_r": ANGLES, "delta_phi": [0, 45, 90, 120, 140, 160, 170, 180]})
        wavelengths = np.array([450.0, 550.0, 650.0]) if kind == "he-torrance" else None
    source = presets()["scene-copper-sphere"] if kind == "he-torrance" else Material.from_table(kind, document)
    dataset = tabulate(Layout(source, grid, wavelengths))
    arrays = {str(name): array.to_numpy() for name, array in dataset.variables.items()}
    return table_from(kind, "r000001", arrays, dataset.attrs)
