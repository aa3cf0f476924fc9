"""Tables of made-up values, and directions to look them up in."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from brdfdb.materials import Material
from brdfdb.tables import error_measurement
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.stated_error import Error
from brdfdb.tables.table import Table, table_from
from brdfdb.tables.tabulation import block

if TYPE_CHECKING:
    import xarray as xr

# Sums of sixteen products against scipy's sums in another order; measured 5e-15 of the largest value
INTERPOLATION_TOLERANCE = 1e-13

AXES = {
    "isotropic": {"theta_i": [0, 11, 45, 80], "theta_r": [0, 20, 60, 70, 85], "delta_phi": [0, 30, 100, 175, 180]},
    "anisotropic": {
        "theta_i": [0, 40, 80],
        "phi_i": [0, 70, 200, 360],
        "theta_r": [0, 20, 60, 85],
        "phi_r": [0, 100, 110, 300, 360],
    },
}
WAVELENGTHS = np.array([400.0, 450.0, 600.0, 2000.0])
KINDS = pytest.mark.parametrize("kind", AXES)


def made_up(kind: str, wavelengths: NDArray[np.float64] | None = None, *, dirac: bool = False) -> Table:
    """A table of random numbers: no symmetry or smoothness of a model can hide a mistake."""
    rng = np.random.default_rng(1991)
    axes = {name: np.array(nodes, dtype=np.float64) for name, nodes in AXES[kind].items()}
    spectral = () if wavelengths is None else wavelengths.shape
    brdf = rng.uniform(0.0, 1.0, (*(nodes.size for nodes in axes.values()), *spectral)).astype(np.float32)
    if kind == "anisotropic":  # azimuths close on themselves
        brdf[:, -1] = brdf[:, 0]
        brdf[:, :, :, -1] = brdf[:, :, :, 0]
    specular = rng.uniform(0.0, 1.0, (axes["theta_i"].size, *spectral)).astype(np.float32) if dirac else None
    return Table("random", "r000001", {}, Grid(axes), wavelengths, brdf, specular)


def random_directions(count: int, seed: int = 7) -> tuple[Any, ...]:
    """Directions above and, as azimuths go, far around the horizon."""
    rng = np.random.default_rng(seed)
    theta_i, theta_r = rng.uniform(0.0, np.pi / 2, (2, count))
    phi_i, phi_r = rng.uniform(-12.0, 12.0, (2, count))
    return theta_i, phi_i, theta_r, phi_r


def scipys_cubic(values: NDArray[np.float64], wavelengths: Any) -> NDArray[np.float64]:
    """Catmull-Rom over wavelengths by others: slopes of parabolas are second-order differences; nothing below 0."""
    slopes = np.gradient(values, WAVELENGTHS, axis=-1, edge_order=2)
    return np.maximum(CubicHermiteSpline(WAVELENGTHS, values, slopes, axis=-1)(wavelengths), 0.0)


def material(model: str, title: str = "Made up", **parameters: Any) -> Material:
    """A material of no paper; metals are copper."""
    metal = {"refractive_index": "main/Cu/Johnson"} if model == "he_torrance" else {}
    about = {"title": title, "model": model, "source": "no paper", "parameters": parameters, **metal}
    return Material.from_table("made-up", about)


def values_of(layout: Layout) -> NDArray[np.float32]:
    """The values of all blocks of a table."""
    return np.concatenate([block(layout, rows) for rows in layout.blocks])


def table_of(layout: Layout) -> Table:
    """The table of a layout in memory."""
    return Table.of(layout, values_of(layout))


def error_of(layout: Layout, **keywords: int) -> Error:
    """The measured error of the table of a layout."""
    values = values_of(layout)
    return error_measurement.measure(layout, lambda rows: values[rows], **keywords)


def read_back(dataset: xr.Dataset, **attrs: Any) -> Table:
    """The table that a store reads from a dataset, with further attributes."""
    arrays = {str(name): np.asarray(variable.values) for name, variable in dataset.variables.items()}
    return table_from("made-up", "r000001", arrays, {**dataset.attrs, **attrs})
