"""A store of one white material, and what its directories hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

import brdfdb
from brdfdb.materials import Material
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import tabulate

GRID = Grid({"theta_i": [0, 30, 60, 80], "theta_r": [0, 40, 80], "delta_phi": [0, 90, 180]})


def layout(rho: float) -> Layout:
    table = {"title": "White", "model": "lambert", "source": "no paper", "parameters": {"rho": rho}}
    return Layout(Material.from_table("white", table), GRID)


def lambert(rho: float) -> xr.Dataset:
    """A table whose values tell which one it is."""
    return tabulate(layout(rho))


def rho(root: Path, name: str = "white") -> float:
    """Return the albedo that tells which table is current."""
    return float(np.round(brdfdb.open(root)[name].brdf[0, 0, 0] * np.pi, 6))


def contents(directory: Path) -> dict[str, bytes]:
    return {str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def staged(root: Path) -> list[str]:
    return sorted(str(path.relative_to(root / ".staging")) for path in (root / ".staging").rglob("*"))
