"""Jumps of f_r: those of the model where its formula changes, and those of the table across the seams of its grid."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel, Field

from brdfdb.audit.finding import STRICT, Cell, Finding, NumberTable, Sentence, Subject, Verdict
from brdfdb.audit.pairs import ComparedPairs
from brdfdb.figure import number
from brdfdb.geometry import degrees, radians, spherical_angles, unit_vector, vectors_from_half_difference
from brdfdb.materials import Source
from brdfdb.parameters import Array, Floats
from brdfdb.tables import error_measurement
from brdfdb.tables.albedo import wavelengths_of
from brdfdb.tables.places import RINGS, RINGS_DEG
from brdfdb.tables.stated_error import Error
from brdfdb.tables.table import Table

# Tolerance of a jump of a model [1]: the rounding of directions times the slope of a lobe, measured 1e-12, and the
# error of the table of He-Torrance's sum, 1e-11
MODEL_TOLERANCE = 2e-11
# Tolerance of a jump of a table without stated error [1]: nodes for the same direction, at a pole or at both ends of a
# turn, are rounded to float32 one by one. Other tables may jump by the stated error of the band, up to _MOST_ERROR
TABLE_TOLERANCE, _MOST_ERROR = 1e-6, 0.5
_STEP = 1e-9  # distance [rad] of the points next to a seam
_BESIDE = _STEP * np.array([-2.0, -1.0, 1.0, 2.0])
_TINY = 1e-30  # value [1/sr] below which exponentials of large numbers carry too few digits
_LOWEST = 1e-3  # cosine of the lowest directions that are examined
_SEED = 1992
_NODES = 200  # number of crossings of nodes on each axis
_ROW = 64  # length of a row; its values are then read from the table of the sum

Function = Callable[[Array, Array], Floats]

_THETA = np.array([0.2, 0.6, 1.0, 1.4])
_PHI = np.array([0.0, 0.7, 1.6, 2.5, 3.1])
_QUARTERS = np.array([0.0, 0.5, 1.0, 1.5]) * np.pi
_NONE = np.zeros(1)


class _Seam(NamedTuple):
    """Directions on a seam, shape (N, 4), and the index of the angle that crosses it.

    The angles are theta_i, phi_i, theta_r and phi_r, or those of half and difference vector. Past the pole a theta is
    negative: the direction is on the other side of the normal.
    """

    name: str
    at: Array
    moved: int
    half_difference: bool = False


class _Directions(NamedTuple):
    """Unit vectors of light and viewer."""

    wi: Array
    wr: Array


class Jump(BaseModel):
    """The largest jump of f_r across a seam, relative to its value there, or to the floor of the error of a table.

    The largest jump is the one with the largest ratio to its tolerance. A slope is no jump: the value on either side is
    extrapolated from two points next to the seam.
    """

    model_config = STRICT

    seam: str = Field(description="name of the seam")
    crossings: int
    largest: float
    where: str = Field(description="directions [degree] and wavelength of the largest jump")
    tolerance: float = Field(description="allowed jump there; for a table the error that it states there")


class Smoothness(Finding):
    """Jumps of the model across its branches, and of the table across the seams of its grid."""

    key = "smoothness"
    order = 5
    explanation = (
        "Jumps of f_r where the formula of the model changes, and at the seams of the table: its nodes, the poles, and "
        "the ends of its azimuths. A table may jump by its stated error. A table of measured data may jump by the "
        "uncertainty of the data; if it is unknown, the jumps are not judged."
    )

    model: list[Jump] = Field(description="empty: the source is not known")
    table: list[Jump]
    verdict: Verdict

    @classmethod
    def judge(cls, subject: Subject) -> Smoothness:
        """Judge a table and its source; without a source the table alone."""
        return smoothness_of(subject.smooth, subject.source, subject.pairs)

    def sentences(self) -> list[Sentence]:
        """Return a sentence on the largest jump, or on the largest of those that are too large."""
        name, jump = max(self._named(), key=lambda item: (item[1].largest > item[1].tolerance, item[1].largest))
        text = (
            f"the {name} jumps by {number(jump.largest)} of f_r across {jump.seam}, of {number(jump.tolerance)} allowed"
        )
        return [self.sentence(self.verdict, text if self.verdict == "passes" else f"{text}: {jump.where}")]

    def cells(self) -> list[Cell]:
        """Return the largest jump."""
        largest = max(jump.largest for _, jump in self._named())
        return [Cell(self.verdict, number(largest, 2), largest)]

    def tables(self) -> list[NumberTable]:
        """Return the largest jump across each seam."""
        rows = [
            (name, jump.seam, number(jump.largest, 2), jump.where, number(jump.tolerance, 2))
            for name, jump in self._named()
        ]
        return [NumberTable("Jumps of f_r", ("of", "across", "largest, relative", "where", "allowed"), rows)]

    def _named(self) -> list[tuple[str, Jump]]:
        return [*(("model", jump) for jump in self.model), *(("table", jump) for jump in self.table)]


def smoothness_of(table: Table, source: Source | None, pairs: ComparedPairs) -> Smoothness:
    """Return the jumps of a table, and of its source if it is known, at all wavelengths of the table.

    A table may jump by the stated 99th percentile of the error in the band of theta_i at the wavelength. If theta_r is
    larger than theta_i, the band of theta_r counts, as if light and viewer were exchanged.
    """
    wavelengths = table.wavelength_nm

    def looked_up(wi: Array, wr: Array) -> Floats:
        return table.lookup_vectors(wi, wr).reshape(len(wi), wavelengths_of(table))

    # Jumps are relative to the floor of the error where f_r is below it
    floor = error_measurement.floor_of(pairs.model, pairs.drawn) + _TINY
    of_model = []
    if source is not None:
        model = partial(error_measurement.model_values, source, wavelengths)
        tiny = np.full_like(floor, _TINY)
        of_model = [_jump(seam, model, wavelengths, tiny, _rounding) for seam in _crossed(_of_model())]
        of_model.append(_between_methods(source, wavelengths, tiny))
    of_table = [
        _jump(seam, looked_up, wavelengths, floor, partial(_allowed, table)) for seam in _crossed(_of_table(table))
    ]
    good = all(jump.largest <= jump.tolerance for jump in (*of_model, *of_table))
    return Smoothness(model=of_model, table=of_table, verdict="passes" if good else "violates")


def _rounding(*_: Array) -> Floats:
    return np.full((1, 1), MODEL_TOLERANCE)


def _allowed(table: Table, wi: Array, wr: Array) -> Floats:
    """Return the jumps [1] that the stated error, or that of measured data, allows at pairs of directions, (N, L)."""
    measured = table.metadata.measured
    if measured is None:
        return _stated(table.error, wi, wr)
    uncertainty = 1.0 if measured.uncertainty is None else measured.uncertainty
    return np.asarray(np.maximum(_stated(table.error, wi, wr), uncertainty))


def _stated(error: Error | None, wi: Array, wr: Array) -> Floats:
    """Return the jumps [1] that the stated error allows at pairs of directions, shape (N, L)."""
    if error is None:
        return np.full((1, 1), TABLE_TOLERANCE)
    theta, _ = spherical_angles(np.stack([wi, wr]))
    band = np.searchsorted(error.theta_i_deg, degrees(np.max(theta, axis=0)), side="right") - 1
    allowed = np.array(error.p99)[np.clip(band, 0, len(error.p99) - 1)]
    if error.places is not None:  # a band pools all viewers; pairs that are both near the horizon have another limit
        lower = np.searchsorted(RINGS_DEG, degrees(np.max(theta, axis=0)), side="right") - 1
        rings = np.array(error.places.both_grazing)[np.clip(lower, 0, RINGS - 1)]
        both = degrees(np.min(theta, axis=0)) >= RINGS_DEG[0]
        allowed = np.where(both[:, np.newaxis], np.maximum(allowed, rings), allowed)
    return np.asarray(np.clip(allowed, TABLE_TOLERANCE, _MOST_ERROR))


def _of_model() -> Iterator[_Seam]:
    yield _Seam("viewer 90 degrees from the plane of incidence", _all(_THETA, _NONE, _THETA, _QUARTERS[1::2]), 3)
    equal = _all(_THETA, _NONE, _NONE, _PHI)
    equal[:, 2] = equal[:, 0]
    yield _Seam("theta_i = theta_r", equal, 2)
    yield _Seam("light at the normal", _all(_NONE, _PHI, _THETA, _NONE), 0)
    yield _Seam("viewer at the normal", _all(_THETA, _NONE, _NONE, _PHI), 2)
    yield _Seam("mirror direction", _all(_NONE, _QUARTERS + 0.3, _THETA, _PHI), 0, half_difference=True)
    yield _Seam("back towards the light", _all(_THETA, _QUARTERS + 0.3, _NONE, _PHI), 2, half_difference=True)


def _of_table(table: Table) -> Iterator[_Seam]:
    yield from _of_model()
    yield _Seam("azimuth of the light 0, 90, 180 and 270 degrees", _all(_THETA, _QUARTERS, _THETA, _PHI), 1)
    yield _Seam("azimuth of the viewer 0, 90, 180 and 270 degrees", _all(_THETA, _PHI, _THETA, _QUARTERS), 3)
    for name, delta_phi in (("0", 0.0), ("180", np.pi)):
        at = _all(_THETA, _PHI, _THETA, _NONE)
        at[:, 3] = at[:, 1] + delta_phi
        yield _Seam(f"delta_phi of {name} degrees", at, 3)
    rng = np.random.default_rng(_SEED)
    columns = list(range(4)) if table.anisotropic else [0, 2, 3]  # index of the angle of each axis
    for axis, (name, nodes) in enumerate(table.axes_deg.items()):
        on = np.stack(
            [radians(rng.uniform(0.0, axis_nodes[-1], _NODES)) for axis_nodes in table.axes_deg.values()], axis=1
        )
        on[:, axis] = radians(rng.choice(nodes, _NODES))
        at = np.zeros((_NODES, 4))
        at[:, columns] = on
        yield _Seam(f"nodes of {name}", at, columns[axis], table.grid.half_difference)
    if not table.grid.half_difference:
        for name, moved in (("theta_i", 0), ("theta_r", 2)):
            at = _all(_THETA, _PHI, _THETA, _PHI + 0.1)
            at[:, moved] = radians(table.axes_deg[name][-1])
            yield _Seam(f"last node of {name}", at, moved)


def _all(*angles: Floats) -> Array:
    return np.stack(np.meshgrid(*angles, indexing="ij"), axis=-1, dtype=np.float64).reshape(-1, 4)


def _directions(angles: Array, half_difference: bool) -> _Directions:
    """Return unit vectors of light and viewer."""
    t_i, p_i, t_r, p_r = np.moveaxis(angles, -1, 0)
    if half_difference:
        return _Directions(*vectors_from_half_difference(t_i, p_i, t_r, p_r))
    return _Directions(unit_vector(t_i, p_i), unit_vector(t_r, p_r))


def _crossed(seams: Iterable[_Seam]) -> Iterator[_Seam]:
    """Yield the seams that have directions above the horizon, with these directions only."""
    for seam in seams:
        wi, wr = _directions(seam.at, seam.half_difference)
        above = np.minimum(wi[:, 2], wr[:, 2]) > _LOWEST
        if above.any():
            yield seam._replace(at=seam.at[above])


def _jump(seam: _Seam, function: Function, wavelength_nm: Array | None, floor: Floats, allowed: Function) -> Jump:
    beside = np.repeat(seam.at[np.newaxis], _BESIDE.size, axis=0)
    beside[..., seam.moved] += _BESIDE[:, np.newaxis]
    wi, wr = (w.reshape(-1, 3) for w in _directions(beside, seam.half_difference))
    far_below, below, above, far_above = function(wi, wr).reshape(_BESIDE.size, len(seam.at), -1)
    with np.errstate(invalid="ignore"):  # values that are not finite
        sides = 2.0 * below - far_below, 2.0 * above - far_above
    relative = _relative(*sides, floor)
    at = _directions(seam.at, seam.half_difference)
    return _largest(seam.name, relative, at, wavelength_nm, allowed(*at))


def _between_methods(source: Source, wavelength_nm: Array | None, floor: Floats) -> Jump:
    """Return the largest difference of rows of values, for which He-Torrance reads a table, from single values."""
    theta_i, theta_r, phi_r = np.meshgrid(_THETA, _THETA, np.linspace(0.0, np.pi, _ROW), indexing="ij")
    rows, single = (
        np.reshape(source.lookup(*angles, wavelength_nm), (theta_i.size, -1))
        for angles in ((theta_i[..., :1], 0.0, theta_r[..., :1], phi_r), (theta_i, 0.0, theta_r, phi_r))
    )
    at = _Directions(unit_vector(theta_i, 0.0).reshape(-1, 3), unit_vector(theta_r, phi_r).reshape(-1, 3))
    relative = _relative(rows, single, floor)
    return _largest("values in rows and one by one", relative, at, wavelength_nm, _rounding())


def _relative(before: Floats, after: Floats, floor: Floats) -> Floats:
    """Return the jumps [1] between values (N, L), relative to the larger value or the floor."""
    with np.errstate(invalid="ignore"):  # values that are not finite count as 1
        relative = np.abs(after - before) / np.maximum(np.maximum(np.abs(after), np.abs(before)), floor)
    return np.where(np.isfinite(relative), relative, 1.0)


def _largest(seam: str, relative: Floats, at: _Directions, wavelength_nm: Array | None, allowed: Floats) -> Jump:
    """Return the jump with the largest ratio to its tolerance."""
    allowed = np.broadcast_to(allowed, relative.shape)
    row, column = np.unravel_index(int(np.argmax(relative / allowed)), relative.shape)
    theta, phi = (degrees(angles) for angles in spherical_angles(np.stack([w[row] for w in at])))
    named = zip(("theta_i", "phi_i", "theta_r", "phi_r"), (theta[0], phi[0], theta[1], phi[1]), strict=True)
    where = ", ".join(f"{name} {angle:.4g}" for name, angle in named) + " degrees"
    if wavelength_nm is not None:
        where += f", {wavelength_nm[column]:g} nm"
    largest = float(f"{relative[row, column]:.3g}")
    return Jump(seam=seam, crossings=len(relative), largest=largest, where=where, tolerance=float(allowed[row, column]))
