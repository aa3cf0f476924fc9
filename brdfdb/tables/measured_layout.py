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
from brdfdb.measurements import MeasuredSource, Samples
from brdfdb.measurements.acceptance import at_samples
from brdfdb.measurements.glints import Glints
from brdfdb.measurements.peaks import glint_of, missed_peaks, tracks_of
from brdfdb.measurements.usable_values import floor_of
from brdfdb.parameters import Floats
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
_ENERGY = 0.015  # relative difference of the energy of an incidence that asks for a finer grid
_AT_SAMPLES = 0.05  # relative error at the own directions of a sample that does
_STEPS_DEG = (20.0, 10.0, 5.0, 3.0, 1.5, 1.0)  # largest steps of polar angles in grids with nodes at the samples
_MOST_NODES = 330_000  # of such grids
_MISSED_COUNTS = 100.0  # weight of a share of missed samples: a tenth is as bad as eleven times the tolerance
_MOST_ERROR = 1.0  # relative error between samples beyond which none is worse
_WORTH = 0.75  # fault of a larger grid over that of a smaller one, at most
_BESIDE = 0.005  # what a table may add to the relative difference of the interpolation from a sample
_AZIMUTH_STEPS = 2.0  # steps of azimuths over those of polar angles
_CROWDED = 0.3  # step of delta_phi over the distance from the mirror direction
_MOST_STEP_DEG = 40.0
_MOST_ANGLES = 120  # on an axis of such grids; more are no scans
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
    samples = source.samples_at(wavelength_nm) if isinstance(source, MeasuredSource) else None
    scans: _Scans | None = None
    if samples is not None and isinstance(source, MeasuredSource) and source.measured.simulation is None:
        f_r = error_measurement.model_values(source, wavelength_nm, samples.w_i, samples.w_r)
        scans = _Scans(source, samples, f_r, _of_glints(source, samples.w_i, samples.w_r))
    best: _Trial | None = None
    for grid in _grids(source, samples):
        layout = Layout(
            source,
            grid,
            wavelength_nm,
            Interpolation("cubic", True, offset),
            spectra=None if mixture is None else mixture.spectra,
            part_nm=None if mixture is None else mixture.part_nm,
            bits=_BITS,
            reason="measured",
        )
        values = np.concatenate([tabulation.block(layout, rows) for rows in layout.blocks])
        table = Table.of(layout, values)
        looked_up = table.lookup_vectors(drawn.wi, drawn.wr).reshape(truth.shape)
        error = error_measurement.relative(looked_up, truth, floor)[drawn.above]
        wrong = weight @ np.abs(looked_up - truth) / np.maximum(weight @ truth, 1e-300)
        reached = max(float(np.percentile(error, 95, axis=0).max()), float(wrong.max()))
        of_samples = 0.0 if scans is None else _missed_samples(table, scans)
        fault = max(min(reached, _MOST_ERROR) / tolerance - 1.0, 0.0) + of_samples
        if best is None or fault < _WORTH * best.fault:
            best = _Trial(fault, reached, layout, values)
        if fault == 0.0:
            break
    assert best is not None
    layout = best.layout
    kept = "keeps" if best.reached <= tolerance else "is the best grid of measured data, and does not keep"
    reason = f"{math.prod(layout.grid.shape)} nodes; {kept} to a tolerance of {tolerance:g} against the data"
    layout = replace(layout, reason=reason)
    table = Table.of(layout, best.values)
    if scans is not None:
        layout = replace(layout, source=_with_glints(table, scans))
    if samples is not None and isinstance(layout.source, MeasuredSource):
        looked_up = table.lookup_vectors(samples.w_i, samples.w_r).reshape(samples.values.shape)
        looked_up = looked_up + _of_glints(layout.source, samples.w_i, samples.w_r)
        at = at_samples(samples, samples.values, looked_up, floor_of(samples), samples.channels)
        layout = replace(layout, source=layout.source.recorded(at_samples=at))
    return MeasuredLayout(layout, best.values)


class _Trial(NamedTuple):
    """A table, its error, and how far it is from keeping tolerance and samples: the error over the tolerance counts."""

    fault: float
    reached: float
    layout: Layout
    values: NDArray[np.float32]


class _Scans(NamedTuple):
    """Samples that may have peaks, which simulated ones do not; at these, interpolated f_r and that of the glints."""

    source: MeasuredSource
    samples: Samples
    f_r: Floats
    of_glints: Floats | float


def _of_glints(source: MeasuredSource, wi: Floats, wr: Floats) -> Floats | float:
    return 0.0 if source.glints is None else source.glints.f_r(wi, wr)


def _with_glints(table: Table, scans: _Scans) -> MeasuredSource:
    """Return the source with glints where the grid misses a peak of the interpolated samples."""
    source, samples = scans.source, scans.samples

    def smooth(wi: Floats, wr: Floats) -> Floats:
        grid = np.asarray(table.lookup_vectors(wi, wr), np.float64).reshape(len(wi), -1)
        return np.asarray(grid + _of_glints(source, wi, wr))

    f_r = scans.f_r + scans.of_glints
    missed = missed_peaks(samples, f_r, (f_r - smooth(samples.w_i, samples.w_r)) / np.maximum(f_r, floor_of(samples)))
    if not missed:
        return source
    known = () if source.glints is None else source.glints.glints
    first = 1 + max((glint.track for glint in known), default=-1)
    passed = replace(samples, values=f_r)
    tracks = tracks_of(samples, missed)
    new = [glint_of(passed, peak, smooth, first + track) for peak, track in zip(missed, tracks, strict=True)]
    lights = np.unique(np.round(degrees(np.stack([samples.theta_i, samples.phi_i], axis=1)), 6), axis=0)
    glints = Glints(glints=(*known, *new), turned=samples.turned).with_dark_lights(lights[:, 0], lights[:, 1])
    return source.recorded(glints=glints)


def _missed_samples(table: Table, scans: _Scans) -> float:
    """Return the fault of a table that misses samples, by their share, and the energy of an incidence.

    It may differ from a sample by 5 %, or by little more than the interpolation does. A narrow lobe needs a finer grid
    than the directions at which the tolerance is tested tell.
    """
    samples, floor = scans.samples, floor_of(scans.samples)
    looked_up = table.lookup_vectors(samples.w_i, samples.w_r).reshape(scans.f_r.shape)
    at = at_samples(samples, scans.f_r, looked_up, floor, samples.channels)
    energy = None if at is None else at.worst_energy
    of_energy = 0.0 if energy is None else max(energy.error / _ENERGY - 1.0, 0.0)
    off, least = (
        np.abs(value + scans.of_glints - samples.values) / np.maximum(np.abs(samples.values), floor)
        for value in (looked_up, scans.f_r)
    )
    missed = float(np.mean((off > np.maximum(_AT_SAMPLES, least + _BESIDE))[samples.known]))
    return _MISSED_COUNTS * missed + of_energy


def _grids(source: MeasuredSource | TableSource, samples: Samples | None) -> list[Grid]:
    """Return the grids that are tried, the smallest first: those of the ladder, and those with nodes at the samples."""
    chiral = source.measured is not None and source.measured.chiral
    ladder = [
        _grid(source, count, chiral=chiral)
        for count in (_ANISOTROPIC_LADDER if source.anisotropic and not chiral else _LADDER)
    ]
    measured = source.measured
    if samples is None or chiral or not samples.scanned or measured is None or measured.simulation is not None:
        return ladder
    of_samples = [_grid_of_samples(samples, step_deg) for step_deg in _STEPS_DEG]
    known = [grid for grid in of_samples if grid is not None and math.prod(grid.shape) <= _MOST_NODES]
    return sorted(ladder + known, key=lambda grid: math.prod(grid.shape))


def _grid_of_samples(samples: Samples, step_deg: float) -> Grid | None:
    """Return a grid whose nodes are the angles of scans, with others at most a step [degree] apart in between.

    Steps of azimuths are wider. A table passes f_r exactly at its nodes. None if the samples are no scans with
    the same angles at all lights.
    """
    theta_i, theta_r = degrees(np.stack([samples.theta_i, samples.theta_r]))
    phi_i, phi_r = degrees(np.stack([samples.phi_i, samples.phi_r]))
    inclined = theta_r > 0.0  # a viewer at the pole has no azimuth
    if samples.turned:
        nodes = {
            "theta_i": theta_i,
            "phi_i": np.mod(phi_i[theta_i > 0.0], 360.0),
            "theta_r": theta_r,
            "phi_r": np.mod(phi_r[inclined], 360.0),
        }
    else:
        delta = np.abs(np.mod(phi_r - phi_i + 180.0, 360.0) - 180.0)
        nodes = {"theta_i": theta_i, "theta_r": theta_r, "delta_phi": delta[inclined]}
    axes: dict[str, Axis] = {}
    for name, angles in nodes.items():
        end = {"delta_phi": 180.0, "phi_i": 360.0, "phi_r": 360.0}.get(name, 90.0)
        known = np.unique(np.round(np.append(angles, [0.0, end]), 4))
        if known.size > _MOST_ANGLES:
            return None
        listed = [0.0]
        for angle in known[1:]:
            while listed[-1] < angle:
                step = step_deg if name.startswith("theta") else _AZIMUTH_STEPS * step_deg
                if name == "delta_phi":  # lobes are narrow at the mirror direction, and wide beside it
                    step = np.clip(_CROWDED * (180.0 - listed[-1]), step_deg, min(3.0 * step, _MOST_STEP_DEG))
                pieces = np.ceil((angle - listed[-1]) / step - 1e-6)
                listed.append(angle if pieces <= 1.0 else listed[-1] + (angle - listed[-1]) / pieces)
        axes[name] = np.array(listed)
    return Grid(axes)


def _grid(source: Source, count: int, *, chiral: bool) -> Grid:
    """Return a grid with `count` nodes of its first axis, which makes use of the symmetries of the source.

    That of a `chiral` source, which is the same at each turn of the surface, has two nodes of phi_h.
    """
    lobe = source.lobe(np.ones(1), None)
    alpha = None if lobe is None else float(min(lobe.alpha_x[0], lobe.alpha_y[0]))
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
