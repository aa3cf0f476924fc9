"""The white material of the tests of revisions: its tables, and the albedo that tells which one is current."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

import brdfdb
from brdfdb.materials import Material
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout, digest
from brdfdb.tables.tabulation import tabulate

GRID = Grid({"theta_i": [0, 30, 60, 80], "theta_r": [0, 40, 80], "delta_phi": [0, 90, 180]})


def lambert(rho: float) -> xr.Dataset:
    """Return the table of an albedo, with a request of its albedo alone."""
    table = {"title": "White", "model": "lambert", "source": "no paper", "parameters": {"rho": rho}}
    dataset = tabulate(Layout(Material.from_table("white", table), GRID))
    del dataset.attrs["source_record"]
    return dataset.assign_attrs(request={"rho": rho}, request_sha256=digest({"rho": rho}))


def rho(root: Path) -> float:
    """Return the albedo of the current revision."""
    return float(np.round(brdfdb.open(root)["white"].brdf[0, 0, 0] * np.pi, 6))
