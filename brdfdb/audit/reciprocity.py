"""Whether light and viewer may be exchanged: of a model at the parameters of a table, and of the table."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdfdb.albedo import wavelengths_of
from brdfdb.audit.findings import Asymmetry, Reciprocity
from brdfdb.audit.pairs import SEED, LookedUp
from brdfdb.geometry import radians
from brdfdb.grids import Axis
from brdfdb.lookup import Table
from brdfdb.materials import Material
from brdfdb.parameters import Floats

# The models are reciprocal; what is left is rounding, worst where exp(-V) has a large exponent: measured 3e-13
MODEL_RECIPROCITY_TOLERANCE = 1e-11
# float32 rounds two values that differ by that to the same number or to neighbours, 6e-8 apart: measured 0
TABLE_RECIPROCITY_TOLERANCE = 1e-6
# Sums of the same numbers in another order, of f_r with the offset of its logarithm: measured 1.6e-14
LOOKUP_RECIPROCITY_TOLERANCE = 5e-14
MODEL_RECIPROCITY_PAIRS = 2000
_POLAR = ("theta_i", "theta_r", "theta_h", "theta_d")


def reciprocity_of(table: Table, material: Material, looked_up: LookedUp | None) -> Reciprocity:
    rng = np.random.default_rng(SEED)
    # uniform over the cosine up to the last node of the table
    lowest = np.cos(radians(min(table.axes_deg[name][-1] for name in table.axes_deg if name in _POLAR)))
    theta_i, theta_r = np.arccos(rng.uniform(lowest, 1.0, (2, MODEL_RECIPROCITY_PAIRS)))
    phi_i, phi_r = rng.uniform(0.0, 2.0 * np.pi, (2, MODEL_RECIPROCITY_PAIRS))
    forward, backward = (theta_i, phi_i, theta_r, phi_r), (theta_r, phi_r, theta_i, phi_i)
    wavelengths = table.wavelength_nm
    model = _asymmetry(
        _model(material, wavelengths, forward),
        _model(material, wavelengths, backward),
        MODEL_RECIPROCITY_PAIRS,
        MODEL_RECIPROCITY_TOLERANCE,
    )
    stored = _table_asymmetry(table, looked_up)
    good = model.max <= model.tolerance and stored.max <= stored.tolerance
    return Reciprocity(model=model, table=stored, verdict="passes" if good else "violates")


def _table_asymmetry(table: Table, looked_up: LookedUp | None) -> Asymmetry:
    """The pairs that a grid holds both ways round, and those that were looked up."""
    found = []
    if not table.grid.half_difference:
        found.append(_node_asymmetry(table))
    if looked_up is not None and (table.grid.half_difference or table.grid.reciprocal):
        # what is interpolated is the logarithm of f_r with an offset: of f_r far below it, rounding alone is left
        forward, backward = (each + table.interpolation.offset for each in looked_up)
        found.append(_asymmetry(forward, backward, len(forward), LOOKUP_RECIPROCITY_TOLERANCE))
    worst = max(found, key=lambda each: each.max / each.tolerance)
    pairs = sum(each.pairs for each in found)
    return worst.model_copy(
        update={"pairs": pairs, "mean": sum(each.mean * each.pairs for each in found) / max(pairs, 1)}
    )


def _node_asymmetry(table: Table) -> Asymmetry:
    """Stored values against stored values: an interpolant is as symmetric as its nodes, if the axes are the same."""
    axes = table.axes_deg
    _, i, r = np.intersect1d(axes["theta_i"], axes["theta_r"], return_indices=True)
    if table.anisotropic:
        _, phi_i, phi_r = np.intersect1d(axes["phi_i"], axes["phi_r"], return_indices=True)
        f = table.brdf[np.ix_(i, phi_i, r, phi_r)]
        swapped = np.moveaxis(f, (0, 1), (2, 3))
    else:
        f = table.brdf[np.ix_(i, r)]  # exchanging them turns delta_phi to -delta_phi, where the table is the same
        swapped = np.swapaxes(f, 0, 1)
    return _asymmetry(f, swapped, f.size // wavelengths_of(table), TABLE_RECIPROCITY_TOLERANCE)


def _model(material: Material, wavelength_nm: Axis | None, angles: tuple[NDArray[np.float64], ...]) -> Floats:
    """The model behind a table, at the table's wavelengths."""
    if wavelength_nm is not None:
        angles = tuple(angle[:, np.newaxis] for angle in angles)
    return material.spec.evaluate(*angles, **material.arguments(wavelength_nm))


def _asymmetry(f: Floats, swapped: Floats, pairs: int, tolerance: float) -> Asymmetry:
    differs = f != swapped  # nan does; hardly any other value, which saves the time of the rest
    f, swapped = f[differs].astype(np.float64), swapped[differs].astype(np.float64)
    with np.errstate(invalid="ignore"):  # what is not finite counts as 1
        relative = np.abs(f - swapped) / (np.abs(f) + np.abs(swapped))
    relative = np.where(np.isfinite(relative), relative, 1.0)
    mean, largest = float(relative.sum() / differs.size), float(relative.max(initial=0.0))
    return Asymmetry(pairs=pairs, mean=mean, max=largest, tolerance=tolerance)
