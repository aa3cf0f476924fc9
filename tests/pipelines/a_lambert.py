"""Small constant tables in a store."""

from __future__ import annotations

from pathlib import Path

from brdfdb.materials import Material
from brdfdb.store.publication import publish_dataset
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import tabulate

GRID = Grid({"theta_i": [0, 45, 90], "theta_r": [0, 45, 90], "delta_phi": [0, 90, 180]})


def publish_lambert(root: Path, name: str, rho: float, source: str = "no paper", **attributes: object) -> None:
    """Publish the table of a Lambertian surface, with additional attributes."""
    fields = {"title": name, "model": "lambert", "source": source, "parameters": {"rho": rho}}
    dataset = tabulate(Layout(Material.from_table(name, fields), GRID))
    publish_dataset(root, name, dataset.assign_attrs(attributes))
