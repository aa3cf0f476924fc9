"""Layouts of measured data: a ladder of grids, of which the first that keeps to a tolerance is taken."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import degrees
from brdfdb.materials import Source
from brdfdb.measurements import MeasuredSource
from brdfdb.tables import error_measurement, tabulation
from brdfdb.tables.grids import (
    ANISOTROPIC_AXES,
    ANISOTROPIC_HALF_DIFFERENCE_AXES,
    HALF_DIFFERENCE_AXES,
    ISOTROPIC_AXES,
    Axis,
    Grid,
)
from brdfdb.tables.layout import Interpolation, Layout
from brdfdb.tables.mixture import mixture_of
from brdfdb.tables.planner import check_tolerance, offset_of
from brdfdb.tables.table import Table, TableSource

_LADDER = (16, 24, 36, 54, 72)  # nodes of theta_h or theta_i
_ANISOTROPIC_LADDER = (10, 14, 20)
_WIDE = 0.5  # width [1] of a lobe beyond which directions of light and viewer suit as well
_DIRECTIONS = 300  # pairs of directions in a band of theta_i
_SEED = 1867
_EASED = 0.02  # share of the nodes of theta_h that are spread evenly, so that no two are the same
_BITS = 14  # rounds a logarithm by less than measured data are uncertain
# nodes of the other axes, as shares of those of the first
_SHARES = {"theta_d": 0.6, "phi_d": 0.7, "theta_r": 1.0, "delta_phi": 1.0, "phi_h": 1.2, "phi_i": 1.2, "phi_r": 1.6}


class MeasuredLayout(NamedTuple):
    """The layout of a table of measured data, and its values, which were tabulated to choose it."""

    layout: Layout
    values: NDArray[np.float32]


def tabulated(
    source: MeasuredSource | TableSource, wavelength_nm: NDArray[np.float64] | None, tolerance: float
) -> MeasuredLayout:
    """Return the coarsest layout of measured data, or of a table of them, that keeps to a tolerance.

    Parameters
    ----------
    source, wavelength_nm : MeasuredSource or TableSource, array (L,) [nm] or None
        Measured data, and the wavelengths of spectral data.
    tolerance : float
        95th percentile of the relative error against the source, and the l1 error, in [1e-4, 0.5]. If the finest grid
        does not keep to it, the grid is taken all the same, and its table states the error that it has: noise, steps
        and the edge where values end at 0 have no smallest table.

    Raises
    ------
    ParameterError
        If the tolerance is outside its range, or no value is above 0.

    Notes
    -----
    The planner of models looks along each axis for the smallest table. Data have noise, and it would spend nodes on it.
    Directions that are extrapolated do not count: no node makes them better.
    The axes of these grids crowd where lobes are: theta_h at 0, theta_d and the azimuths at the mirror direction.
    """
    check_tolerance(tolerance)
    offset = offset_of(source, wavelength_nm)
    mixture = mixture_of(source, wavelength_nm)
    drawn = error_measurement.draw(source, wavelength_nm, _DIRECTIONS, _SEED)
    truth = error_measurement.model_values(source, wavelength_nm, drawn.wi, drawn.wr)
    if not np.any(truth > 0.0):
        raise ParameterError("values", "no value is above 0, which leaves nothing to tabulate", 0.0)
    floor = error_measurement.floor_of(truth, drawn)
    weight = np.where(drawn.above, drawn.weight, 0.0)
    layout = None
    values = np.empty(0, np.float32)
    reached = math.inf
    chiral = source.measured is not None and source.measured.chiral
    for count in _ANISOTROPIC_LADDER if source.anisotropic and not chiral else _LADDER:
        layout = Layout(
            source,
            _grid(source, count, chiral=chiral),
            wavelength_nm,
            Interpolation("cubic", True, offset),
            spectra=None if mixture is None else mixture.spectra,
            part_nm=None if mixture is None else mixture.part_nm,
            bits=_BITS,
            reason="measured",
        )
        values = np.concatenate([tabulation.block(layout, rows) for rows in layout.blocks])
        looked_up = Table.of(layout, values).lookup_vectors(drawn.wi, drawn.wr).reshape(truth.shape)
        error = error_measurement.relative(looked_up, truth, floor)[drawn.above]
        wrong = weight @ np.abs(looked_up - truth) / np.maximum(weight @ truth, 1e-300)
        reached = max(float(np.percentile(error, 95, axis=0).max()), float(wrong.max()))
        if reached <= tolerance:
            break
    assert layout is not None
    kept = "keeps" if reached <= tolerance else "is the finest grid of measured data, and does not keep"
    reason = f"{math.prod(layout.grid.shape)} nodes; {kept} to a tolerance of {tolerance:g} against the data"
    return MeasuredLayout(replace(layout, reason=reason), values)


def _grid(source: Source, count: int, *, chiral: bool) -> Grid:
    """Return a grid with `count` nodes of its first axis, which makes use of the symmetries of the source.

    That of a `chiral` source, which is the same at each turn of the surface, has two nodes of phi_h.
    """
    lobe = source.lobe(np.ones(1), None)
    alpha = None if lobe is None else float(lobe.alpha_x[0])
    half = chiral or (alpha is not None and alpha < _WIDE)
    names: tuple[str, ...]
    if source.anisotropic:
        names = ANISOTROPIC_HALF_DIFFERENCE_AXES if half else ANISOTROPIC_AXES
    else:
        names = HALF_DIFFERENCE_AXES if half else ISOTROPIC_AXES
    # a third of the nodes of theta_h lie within two widths of the lobe
    power = 1.0 if alpha is None else np.clip(np.log(45.0 / degrees(np.arctan(alpha))) / np.log(3.0), 1.0, 4.0)
    axes: dict[str, Axis] = {}
    for name in names:
        s = np.linspace(0.0, 1.0, max(4, round(_SHARES.get(name, 1.0) * count)))
        end = {"delta_phi": 180.0, "phi_i": 360.0, "phi_r": 360.0, "phi_h": 360.0}.get(name, 90.0)
        if name == "phi_d":
            end *= (1 + source.anisotropic) * (2 - source.reciprocal)
            s = np.linspace(0.0, 1.0, max(4, round(_SHARES[name] * count * (2 - source.reciprocal))))
        if name == "theta_h":
            s = (1.0 - _EASED) * s ** float(power) + _EASED * s
        elif name in ("theta_d", "theta_i", "theta_r", "delta_phi"):
            s = 1.0 - (1.0 - s) ** 1.5
        axes[name] = np.append(np.round(end * s[:-1], 4), end)
    if chiral and "phi_h" in axes:
        axes["phi_h"] = np.array([0.0, 360.0])
    return Grid(axes)
