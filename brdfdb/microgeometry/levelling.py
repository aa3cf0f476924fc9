"""Faults of measured heights: tilt, outliers, steps at stitching and holes; all are named, and mended on request."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError, counted, import_extra
from brdfdb.microgeometry.height_map import HeightMap
from brdfdb.microgeometry.height_map_files import MeasuredHeights

Array = NDArray[np.float64]
Level = Literal["none", "plane", "quadratic"]
OnOutliers = Literal["refuse", "leave-out", "keep"]
OnSteps = Literal["refuse", "remove", "keep"]
OnHoles = Literal["leave-out", "fill", "refuse"]

_DEGREES: dict[str, int] = {"none": 0, "plane": 1, "quadratic": 2}
_FAR = 10.0  # robust standard deviations beyond which a height is an outlier
_FROM_NEIGHBOURS = 1.0  # multiple of the robust rms height that an outlier departs from the median of its neighbours
_JUMP = 8.0  # robust standard deviations of the differences of rows beyond which a jump is a step
_LEAST_JUMP = 0.05  # share of the rms height below which a jump is no step
_MOST_STEPS = 0.02  # share of the rows: more steps are a texture
_MOST_HOLES = 0.5  # share of the heights: with more holes, the statistics mean nothing
_ROBUST = 1.4826  # standard deviation of a Gaussian over its median absolute deviation


class StitchingStep(NamedTuple):
    """A jump of the mean height between two neighbouring rows or columns."""

    axis: int  #: 0 for a jump along x, 1 along y
    node: int  #: number of the last node before the jump
    height_um: float  #: height of the jump [um]


@dataclass(frozen=True)
class LevellingOptions:
    """The treatment of tilt and faults of a height map.

    ParameterError if a value is not among those allowed.
    """

    level: Level = "plane"  #: polynomial that is subtracted; "none" subtracts the mean alone
    outliers: OnOutliers = "refuse"  #: "leave-out" makes holes of them
    steps: OnSteps = "refuse"  #: "remove" shifts the part behind a step
    holes: OnHoles = "leave-out"  #: "fill" interpolates between neighbours

    def __post_init__(self) -> None:
        kinds = {"level": Level, "outliers": OnOutliers, "steps": OnSteps, "holes": OnHoles}
        for name, kind in kinds.items():
            allowed, value = get_args(kind), getattr(self, name)
            if value not in allowed:
                raise ParameterError(name, f"{value!r} is not one of {', '.join(allowed)}", value, allowed)


@dataclass(frozen=True)
class Levelled:
    """A height map that is ready for statistics, and what was done to it."""

    measured: MeasuredHeights  #: heights after levelling; nan are holes
    degree: int  #: degree of the polynomial that was subtracted
    tilt_deg: float  #: angle of the plane that suits the heights best [degree]
    holes: int  #: heights that the file does not have
    filled: int  #: holes that were interpolated
    outliers: int  #: heights that are far from the others
    left_out: int  #: outliers that were left out
    steps: tuple[StitchingStep, ...]  #: jumps of rows or columns
    removed: bool  #: True if the steps were removed

    def document(self) -> dict[str, Any]:
        """Return what was done to the map as JSON."""
        measured = self.measured
        facts = {item.name: getattr(self, item.name) for item in fields(self) if item.name != "measured"}
        return {
            "nodes": list(measured.heights_um.shape),
            "step_um": [measured.step_x_um, measured.step_y_um],
            **facts,
            "steps": [step._asdict() for step in self.steps],
            "notes": list(measured.notes),
        }

    def height_map(self) -> HeightMap:
        """Return the facets' height map, mean 0; ParameterError if a hole is not filled."""
        measured = self.measured
        return HeightMap(measured.heights_um, measured.step_x_um, measured.step_y_um, name=measured.name)


def levelled(measured: MeasuredHeights, options: LevellingOptions | None = None) -> Levelled:
    """Return a height map without tilt, and what was found in it.

    Parameters
    ----------
    measured : MeasuredHeights
        Heights as the file states them.
    options : LevellingOptions, optional
        Treatment of tilt and faults.

    Returns
    -------
    Levelled

    Raises
    ------
    ParameterError
        For holes, outliers or steps that are refused; for more than half of the heights missing; and for a flat map.

    Notes
    -----
    A height is an outlier if it is more than 10 robust standard deviations (1.4826 times the median absolute deviation)
    from the plane, or from the median of the 5 x 5 heights around it and by the rms height. A step is a
    difference of two rows, in the median, that exceeds those before and after it by 8 robust standard deviations and
    by 5 % of the rms height.
    """
    chosen = LevellingOptions() if options is None else options
    degree = _DEGREES[chosen.level]
    z = np.array(measured.heights_um, np.float64)
    holes = int(np.count_nonzero(~np.isfinite(z)))
    if holes > _MOST_HOLES * z.size:
        share = f"{100.0 * holes / z.size:.0f} %"
        raise ParameterError("holes", f"{share} of the heights are holes; allowed are up to 50 %", holes)
    if holes and chosen.holes == "refuse":
        raise ParameterError("holes", f"{holes} of {z.size} heights are holes; allowed is none", holes, 0)
    steps = tuple(_steps(z, 0) + _steps(z, 1))
    if steps and chosen.steps == "refuse":
        largest = max(steps, key=lambda step: abs(step.height_um))
        place = (largest.node + 0.5) * (measured.step_x_um, measured.step_y_um)[largest.axis]
        more = f" and {len(steps) - 1} more" if len(steps) > 1 else ""
        text = (
            f"the mean height jumps by {largest.height_um:.3g} um at {'xy'[largest.axis]} = {place:.4g} um{more}, as "
        )
        text += "at stitching; allowed values of the option are remove and keep"
        raise ParameterError("steps", text, len(steps), ("remove", "keep"))
    if chosen.steps == "remove":
        for step in steps:
            (z if step.axis == 0 else z.T)[step.node + 1 :] -= step.height_um
    tilt = _coefficients(z, 1)
    far = _outliers(z - _polynomial(_coefficients(z, degree), z.shape, degree))
    outliers = int(np.count_nonzero(far))
    if outliers and chosen.outliers == "refuse":
        raise ParameterError("outliers", _outliers_in_words(far, measured.heights_um), outliers, ("leave-out", "keep"))
    if chosen.outliers == "leave-out":
        z[far] = np.nan
        tilt = _coefficients(z, 1)
    filled = 0
    if chosen.holes == "fill":
        filled = int(np.count_nonzero(~np.isfinite(z)))
        z = fill_holes(z)
    z -= _polynomial(_coefficients(z, degree), z.shape, degree)
    if not np.nanmax(np.abs(z)) > 1e-12 * max(1e-6, float(np.nanmax(np.abs(measured.heights_um)))):
        raise ParameterError("heights_um", "all heights are the same after levelling; a rough surface is needed", 0.0)
    rises = 2.0 * tilt[:0:-1]  # of the plane from one side of the map to the other, along x and y
    slope = math.hypot(*rises / ((np.array(z.shape) - 1) * (measured.step_x_um, measured.step_y_um)))
    return Levelled(
        replace(measured, heights_um=z),
        degree=degree,
        tilt_deg=math.degrees(math.atan(slope)),
        holes=holes,
        filled=filled,
        outliers=outliers,
        left_out=outliers if chosen.outliers == "leave-out" else 0,
        steps=steps,
        removed=bool(steps) and chosen.steps == "remove",
    )


def fill_holes(heights: Array) -> Array:
    """Return heights whose holes (nan) are interpolated linearly between the heights around each hole.

    Holes at the edge of a map, which have neighbours on one side only, take the nearest height.
    """
    interpolate = import_extra("scipy.interpolate")
    ndimage = import_extra("scipy.ndimage")
    hole = ~np.isfinite(heights)
    filled = heights.copy()
    if not hole.any():
        return filled
    rim = ndimage.binary_dilation(hole, structure=np.ones((3, 3))) & ~hole
    around = np.argwhere(rim)
    filled[hole] = interpolate.NearestNDInterpolator(around, heights[rim])(np.argwhere(hole))
    if len(around) > 3 and np.ptp(around, axis=0).min() > 0:
        values = interpolate.LinearNDInterpolator(around, heights[rim])(np.argwhere(hole))
        filled[hole] = np.where(np.isfinite(values), values, filled[hole])
    return filled


def _basis(shape: tuple[int, int], degree: int) -> list[tuple[Array, Array]]:
    """Return pairs of polynomials of x and of y on [-1, 1], whose products span those of a degree."""
    x, y = (np.linspace(-1.0, 1.0, count) for count in shape)
    return [(x**a, y**b) for a in range(degree + 1) for b in range(degree + 1 - a)]


def _coefficients(z: Array, degree: int) -> Array:
    """Return the coefficients of the polynomial that suits the heights best, in the order of `_basis`."""
    basis = _basis(z.shape, degree)
    known = np.isfinite(z)
    heights = np.where(known, z, 0.0)
    right = [x @ heights @ y for x, y in basis]
    weight = known.astype(np.float64)
    normal = [[(x * other_x) @ weight @ (y * other_y) for other_x, other_y in basis] for x, y in basis]
    return np.asarray(np.linalg.lstsq(np.array(normal), np.array(right), rcond=None)[0])


def _polynomial(coefficients: Array, shape: tuple[int, int], degree: int) -> Array:
    """Return the heights of a polynomial."""
    total = np.zeros(shape)
    for coefficient, (x, y) in zip(coefficients, _basis(shape, degree), strict=True):
        total += (coefficient * x)[:, np.newaxis] * y
    return total


def _spread(values: Array) -> float:
    """Return the robust standard deviation of values without nan."""
    return float(_ROBUST * np.median(np.abs(values - np.median(values)))) if values.size else 0.0


def _outliers(z: Array) -> NDArray[np.bool_]:
    """Return where heights are far from the plane, or from their neighbours."""
    known = np.isfinite(z)
    spread = _spread(z[known])
    if spread == 0.0:
        return np.zeros(z.shape, bool)
    ndimage = import_extra("scipy.ndimage")
    whole = z
    if not known.all():  # holes take the mean of the heights around them, so that they do not move the median
        share = ndimage.uniform_filter(known.astype(np.float64), size=5)
        mean = ndimage.uniform_filter(np.where(known, z, 0.0), size=5)
        whole = np.where(known, z, np.divide(mean, share, out=np.zeros_like(mean), where=share > 1e-9))
    continued = np.pad(whole, 2, mode="reflect", reflect_type="odd")  # slopes go on beyond the edges
    departure = np.abs(z - ndimage.median_filter(continued, size=5)[2:-2, 2:-2])
    local = float(_ROBUST * np.median(departure[known]))
    far = np.abs(z - np.median(z[known])) > _FAR * spread
    return np.asarray((far | (departure > max(_FAR * local, _FROM_NEIGHBOURS * spread))) & known)


def _steps(z: Array, axis: int) -> list[StitchingStep]:
    """Return the jumps of the mean height along an axis."""
    rows = z if axis == 0 else z.T
    with np.errstate(all="ignore"):
        known = np.isfinite(rows).sum(axis=1) > rows.shape[1] // 4
        difference = np.diff(rows, axis=0)
        difference[~np.isfinite(difference).any(axis=1)] = 0.0
        jump = np.nanmedian(difference, axis=1)
    jump[~(known[1:] & known[:-1])] = 0.0
    before = jump - np.concatenate([jump[1:2], jump[:-1]])
    after = jump - np.concatenate([jump[1:], jump[-2:-1]])
    excess = np.where(before * after > 0.0, np.sign(before) * np.minimum(np.abs(before), np.abs(after)), 0.0)
    rough = _spread(rows[np.isfinite(rows)])
    limit = max(_JUMP * _spread(before), _LEAST_JUMP * rough)
    nodes = np.flatnonzero(np.abs(excess) > limit)
    if nodes.size > max(1, _MOST_STEPS * jump.size) or rough == 0.0:
        return []
    return [StitchingStep(axis, int(node), float(0.5 * (before[node] + after[node]))) for node in nodes]


def _outliers_in_words(far: NDArray[np.bool_], heights_um: Array) -> str:
    """Return a sentence on the outliers of a map."""
    x, y = np.argwhere(far)[0]
    values = heights_um[far]
    verb = "is an outlier" if values.size == 1 else "are outliers"
    hint = ""
    if values.size > 1 and np.all(values == values[0]):
        hint = f"; all are {values[0]:g} um: if this stands for missing heights, give hole = {values[0]:g}"
    return (
        f"{counted(values.size, 'height')} of {heights_um.size} {verb}, the first at node ({x}, {y}); "
        f"allowed values of the option are leave-out and keep{hint}"
    )
