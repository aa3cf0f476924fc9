"""Records of families: how interpolation between members is chosen, measured, written once and verified."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import StoreError, UnknownMaterialError
from brdfdb.geometry import radians
from brdfdb.materials import Material
from brdfdb.parameters import Floats
from brdfdb.store.family import (
    Blend,
    FamilyRecord,
    Sweep,
    WorstPoint,
    blended,
    member_loader,
    read_record,
    stale,
    stencil,
)
from brdfdb.store.files import sync_path, write_sealed
from brdfdb.store.lock import Lock, writing
from brdfdb.store.paths import family_path
from brdfdb.store.reader import Store
from brdfdb.tables import error_measurement, places
from brdfdb.tables.layout import PLAIN
from brdfdb.tables.places import BANDS
from brdfdb.tables.stated_error import Between, Places
from brdfdb.tables.table import Table

Power = Literal[-2, -1, 0, 1, 2]

SEED = 1991
POINTS = 256  # parameters at which a family is measured, at least
_DIRECTIONS = 50  # directions per band of theta_i at each of these parameters
_DIRECTIONS_BETWEEN = 10  # the same between wavelengths
_SEARCHED = 40  # directions of one member at which the worst wavelengths are searched
_FEWEST_DIRECTIONS = 10
_OF_A_SAMPLE = 2  # pairs of each sample in a place, at each of the points
_CORNER_VALUES = 10_000_000  # values of members in memory at a time; fewer directions are drawn for more
_THETA_I = radians(np.arange(0.0, 90.0, 5.0))  # angles [rad] at which the specular part is measured
_SPECULAR_OFFSET = 1e-6
_POWERS: tuple[Power, ...] = (-2, -1, 0, 1, 2)
_MOST_CORNERS = 64  # members of a cubic; a family of more than three swept parameters is linear
_THINNED = 4  # every fourth direction serves to choose powers


class _Point(NamedTuple):
    """Parameters inside a cell: its first corner, and how far the point is from there along each axis."""

    cell: tuple[int, ...]
    within: Floats


class _Way(NamedTuple):
    """A way to interpolate: the fields of a `Blend`."""

    method: Literal["linear", "cubic"]
    offset: float | None
    powers: tuple[Power, ...]

    def in_words(self, sweep: Sweep) -> str:
        """Return the way in words."""
        along = {-2: "1/{}^2", -1: "1/{}", 0: "ln {}", 1: "{}", 2: "{}^2"}
        axes = ", ".join(along[power].format(name) for name, power in zip(sweep.axes, self.powers, strict=True))
        return f"{self.method} in {'f_r' if self.offset is None else 'logarithms'} along {axes}"


class _Measured(NamedTuple):
    """Values at the points: of the members around them and of the model, at drawn directions."""

    points: list[_Point]
    parameters: list[dict[str, float]]  # in the units of the model
    corners: Floats  # f_r of the members that a cubic is made of, of shape (points, corners, directions, wavelengths)
    truth: Floats  # (points, directions, wavelengths)
    drawn: list[error_measurement.RandomPairs]
    specular_corners: Floats | None  # (points, corners, angles, wavelengths)
    specular_truth: Floats | None


def parameter_points(shape: tuple[int, ...], seed: int) -> list[_Point]:
    """Return the points at which a family of so many values along each axis is measured.

    The same number of points in each cell, 256 in all or the next multiple; of more than 256 cells, one point in each
    of 256. They follow a sequence that fills the cells evenly, from a random start.
    """
    rng = np.random.default_rng(seed)
    cells = tuple(nodes - 1 for nodes in shape)
    count = math.prod(cells)
    chosen = np.arange(count) if count <= POINTS else np.sort(rng.choice(count, POINTS, replace=False))
    chosen = np.repeat(chosen, math.ceil(POINTS / chosen.size))
    # Kronecker's sequence of the powers of the root of x^(k+1) = x + 1: for one axis the golden ratio
    root = 1.5
    for _ in range(60):
        root = (1.0 + root) ** (1.0 / (len(shape) + 1))
    steps = root ** -np.arange(1.0, len(shape) + 1.0)
    within = (rng.random(len(shape)) + np.arange(chosen.size)[:, np.newaxis] * steps) % 1.0
    return [_Point(tuple(map(int, np.unravel_index(cell, cells))), t) for cell, t in zip(chosen, within, strict=True)]


def measure(sweep: Sweep, tables: Mapping[str, Table], seed: int = SEED) -> FamilyRecord:
    """Choose the interpolation of a family by its smallest error, and measure its error against the model.

    `tables` has the members by name; `seed` is that of parameters and directions. StoreError says that a member is not
    the one that the sweep asks for, or that members have different wavelengths.
    """
    measured = _look(sweep, tables, seed)
    drawn = error_measurement.RandomPairs(*(np.concatenate(parts) for parts in zip(*measured.drawn, strict=True)))
    truth = measured.truth.reshape(-1, measured.truth.shape[-1])
    floor = error_measurement.floor_of(truth, drawn)
    ways = _ways(sweep, measured, drawn, floor)
    best = min(ways, key=lambda way: ways[way])
    pairs = places.draw(_OF_A_SAMPLE * len(measured.points), seed)
    value = _interpolated(sweep, measured, measured.corners, best)
    specular: dict[float | None, float] = {}  # largest error of the specular part, by the offset of its logarithm
    if measured.specular_corners is not None and measured.specular_truth is not None:
        for offset in (None, _SPECULAR_OFFSET):
            mirrored = _interpolated(sweep, measured, measured.specular_corners, best._replace(offset=offset))
            specular[offset] = float(np.abs(mirrored - measured.specular_truth).max())
    specular_offset = min(specular, key=lambda offset: specular[offset], default=None)
    between = _between(sweep, tables, seed, best, floor) if floor.size > 1 else None
    p99 = [
        float(np.percentile(error_measurement.relative(v, t, floor)[d.above], 99.0, axis=0).max())
        for v, t, d in zip(value, measured.truth, measured.drawn, strict=True)
    ]
    worst = int(np.argmax(p99))
    return FamilyRecord(
        **sweep.model_dump(include=set(Sweep.model_fields)),
        interpolation=Blend(
            method=best.method,
            powers=dict(zip(sweep.axes, best.powers, strict=True)),
            offset=best.offset,
            specular_offset=specular_offset,
            reason="; ".join(
                f"{way.in_words(sweep)}: p99 {left:.3g}" for way, left in sorted(ways.items(), key=lambda item: item[1])
            ),
        ),
        error=error_measurement.compare(value.reshape(truth.shape), truth, drawn, seed).model_copy(
            update={
                "between": between,
                "places": _in_places(sweep, best, _look(sweep, tables, seed, pairs=pairs), pairs, floor),
            }
        ),
        points=len(measured.points),
        worst=WorstPoint(parameters=sweep.in_file_units(measured.parameters[worst]), p99=float(f"{p99[worst]:.3g}")),
        specular_error=float(f"{specular[specular_offset]:.3g}") if specular else None,
    )


def _between(sweep: Sweep, tables: Mapping[str, Table], seed: int, way: _Way, floor: Floats) -> Between:
    """Measure the error between the wavelengths of the members, at fewer directions."""
    first = member_loader(sweep, tables)(0)
    material = _material(first)
    stored = first.wavelength_nm
    assert stored is not None
    pairs = error_measurement.draw(material, stored, _SEARCHED, seed)
    how = replace(PLAIN, wavelengths=first.interpolation.wavelengths)
    worst = error_measurement.worst_between(material, stored, how, pairs.wi[pairs.above], pairs.wr[pairs.above], floor)
    at = np.array([place.wavelength_nm for place in worst])
    measured = _look(sweep, tables, seed, at)
    drawn = error_measurement.RandomPairs(*(np.concatenate(parts) for parts in zip(*measured.drawn, strict=True)))
    truth = measured.truth.reshape(-1, at.size)
    value = _interpolated(sweep, measured, measured.corners, way).reshape(truth.shape)
    larger = np.maximum(floor[1:], floor[:-1])
    # Relative to the interpolated value, which a lookup knows
    error = error_measurement.relative(truth, value, larger)[drawn.above]
    elsewhere = ~places.anywhere(drawn.wi[drawn.above], drawn.wr[drawn.above])
    few = places.draw(len(measured.points), seed)
    return Between(
        wavelength_nm=at.tolist(),
        bands=error_measurement.limits_of_bands(error[elsewhere], drawn.band[drawn.above][elsewhere]),
        places=_in_places(sweep, way, _look(sweep, tables, seed, at, few), few, larger),
        overall=error_measurement.not_less(error_measurement.limit_of(error)),
    )


def _in_places(sweep: Sweep, way: _Way, measured: _Measured, pairs: places.Pairs, floor: Floats) -> Places:
    """Return the limits of the error near the light and at the horizon, over all points."""
    error = np.empty((len(pairs.wi), measured.truth.shape[-1]))
    value = _interpolated(sweep, measured, measured.corners, way)
    for point, rows in enumerate(_shared_out(pairs, len(measured.points))):
        error[rows] = error_measurement.relative(measured.truth[point], value[point], floor)
    return error_measurement.limits_in_places(error, pairs, np.ones(len(error), dtype=bool))


def _shared_out(pairs: places.Pairs, points: int) -> NDArray[np.int64]:
    """Return the pairs of each point, shape (points, N), the same number from each sample."""
    rows = np.arange(len(pairs.wi)).reshape(pairs.sample[-1] + 1, -1, points)
    return np.moveaxis(rows, -1, 0).reshape(points, -1)


def _material(member: Table) -> Material:
    """Return the material that a member of a family was tabulated from; StoreError if the table does not state it."""
    if not isinstance(member.source, Material):
        raise StoreError(f"{member.name} {member.revision} does not state its material; build it anew")
    return member.source


def _look(
    sweep: Sweep,
    tables: Mapping[str, Table],
    seed: int,
    at_nm: NDArray[np.float64] | None = None,
    pairs: places.Pairs | None = None,
) -> _Measured:
    """Return the values of the model and of the members around, at random directions of each point.

    By default the wavelengths are those of the members; at other wavelengths there are fewer directions. `pairs` in
    places are shared out among the points and replace directions over the hemisphere and in the lobe.
    """
    nodes = sweep.nodes
    shape = tuple(values.size for values in nodes.values())
    member = member_loader(sweep, tables)
    base = _material(member(0))
    wavelength_nm = member(0).wavelength_nm if at_nm is None else at_nm
    points = parameter_points(shape, seed)
    stencils = tuple(min(_width(shape), nodes) for nodes in shape)
    values = len(points) * BANDS * math.prod(stencils) * (1 if wavelength_nm is None else wavelength_nm.size)
    count = max(
        _FEWEST_DIRECTIONS, min(_DIRECTIONS if at_nm is None else _DIRECTIONS_BETWEEN, _CORNER_VALUES // values)
    )
    parameters = []
    corners = []
    truth = []
    draws = []
    specular_corners = []
    specular_truth = []
    for number, (cell, within) in enumerate(points):
        at = {
            name: float(axis[i] + t * (axis[i + 1] - axis[i]))
            for (name, axis), i, t in zip(nodes.items(), cell, within, strict=True)
        }
        material = base.model_copy(update={"parameters": {**base.parameters, **at}})
        first = [stencil(axis, at[name], 1, cubic=_width(shape) == 4).first for name, axis in nodes.items()]
        around = [member(int(np.ravel_multi_index(np.add(first, corner), shape))) for corner in np.ndindex(*stencils)]
        parameters.append(at)
        if pairs is None:
            draws.append(error_measurement.draw(material, wavelength_nm, count, seed + 1 + number))
            wi = draws[-1].wi
            wr = draws[-1].wr
        else:
            rows = _shared_out(pairs, len(points))[number]
            wi = pairs.wi[rows]
            wr = pairs.wr[rows]
        truth.append(error_measurement.model_values(material, wavelength_nm, wi, wr))
        corners.append([table.lookup_vectors(wi, wr, at_nm).reshape(truth[-1].shape) for table in around])
        if base.has_specular and at_nm is None and pairs is None:
            specular_corners.append(
                [table.specular_reflectance(_THETA_I).reshape(_THETA_I.size, -1) for table in around]
            )
            specular_truth.append(material.specular_reflectance(_THETA_I, wavelength_nm).reshape(_THETA_I.size, -1))
    return _Measured(
        points,
        parameters,
        np.array(corners),
        np.array(truth),
        draws,
        np.array(specular_corners) if specular_corners else None,
        np.array(specular_truth) if specular_truth else None,
    )


def _width(shape: tuple[int, ...]) -> int:
    """Return the largest number of values of each parameter that an interpolation is made of."""
    return 4 if math.prod(min(4, nodes) for nodes in shape) <= _MOST_CORNERS else 2


def _ways(sweep: Sweep, measured: _Measured, drawn: error_measurement.RandomPairs, floor: Floats) -> dict[_Way, float]:
    """Return the ways with the best powers, for each method in f_r and in logarithms, with their 99th percentile."""
    above = drawn.above.reshape(measured.truth.shape[:2])
    shape = tuple(map(len, sweep.axes.values()))
    offsets: list[float | None] = [None]
    if floor.max() > 0.0:
        offsets.append(float(f"{0.5 * floor[floor > 0.0].min():.6g}"))
    methods: list[Literal["linear", "cubic"]] = ["linear", "cubic"]

    def left(way: _Way, thinned: int = 1) -> float:
        thin = slice(None, None, thinned)
        value = _interpolated(sweep, measured, measured.corners[:, :, thin], way)
        error = error_measurement.relative(value, measured.truth[:, thin], floor)[above[:, thin]]
        return float(np.percentile(error, 99.0, axis=0).max())

    ways: dict[_Way, float] = {}
    for method in methods if _width(shape) == 4 and max(shape) > 2 else methods[:1]:
        for offset in offsets:
            straight: Power = 1
            best = _Way(method, offset, (straight,) * len(shape))
            least = left(best, _THINNED)
            for axis, values in [
                *enumerate(sweep.axes.values())
            ] * 2:  # the best power of an axis depends on the others
                for power in _POWERS if values[0] > 0.0 else (1, 2) if values[0] == 0.0 else (1,):
                    other = best._replace(powers=(*best.powers[:axis], power, *best.powers[axis + 1 :]))
                    if other != best and (there := left(other, _THINNED)) < least:
                        best = other
                        least = there
            ways[best] = left(best)
    return ways


def _interpolated(sweep: Sweep, measured: _Measured, corners: Floats, way: _Way) -> Floats:
    """Interpolate the values of the members around the points."""
    nodes = sweep.nodes
    shape = tuple(axis.size for axis in nodes.values())
    rows = []
    for at in measured.parameters:
        weight = np.ones(1)
        for (name, axis), power in zip(nodes.items(), way.powers, strict=True):
            widest = stencil(axis, at[name], 1, cubic=_width(shape) == 4)
            used = stencil(axis, at[name], power, cubic=way.method == "cubic")
            along = np.zeros(widest.weights.size)
            begin = used.first - widest.first
            along[begin : begin + used.weights.size] = used.weights
            weight = np.outer(weight, along).reshape(-1)
        rows.append(weight)
    weights = np.array(rows)
    members = np.flatnonzero(np.any(weights != 0.0, axis=0))
    spread = (slice(None), *(np.newaxis,) * (corners.ndim - 2))
    with np.errstate(over="ignore"):  # between few members a cubic of logarithms may overflow: its error is infinite
        return blended([corners[:, c] for c in members], [weights[:, c][spread] for c in members], way.offset)


def recorded(root: Path, sweep: Sweep) -> FamilyRecord | None:
    """Return the record of a family in the store at `root`, if it is of these members; else None."""
    try:
        record = read_record(family_path(root, sweep.name))
    except StoreError:
        return None
    return record if all(getattr(record, name) == getattr(sweep, name) for name in Sweep.model_fields) else None


def write_family(root: str, sweep: Sweep) -> FamilyRecord:
    """Measure a family whose members are built, and record it, unless that was done: a task for a worker.

    The record is written completely and synced to disk, or not at all. StoreError says that a member is not the one
    that the sweep asks for, or that the record cannot be written.
    """
    store = Path(root)
    path = family_path(store, sweep.name)
    with Lock(store, sweep.name) as lock:
        if (record := recorded(store, sweep)) is not None:
            return record
        record = measure(sweep, Store(store))
        with writing(store, sweep.name):
            path.parent.mkdir(exist_ok=True)
            write_sealed(path, record.model_dump(mode="json"), lock.path.parent)
            sync_path(path.parent)
            sync_path(store)
    return record


def verify_family(root: Path, name: str) -> int:
    """Check that the record of a family is one, and that its members are those that it names; return its bytes."""
    store = Store(root)
    path = family_path(root, name)
    record = read_record(path)
    if not len(record.members) == len(record.request_sha256) == math.prod(map(len, record.axes.values())):
        raise StoreError(f"the family {name} is damaged: its axes do not make {len(record.members)} members")
    for member, request_sha256, values in zip(
        record.members, record.request_sha256, itertools.product(*record.axes.values()), strict=True
    ):
        try:
            known = store.metadata(member)
        except UnknownMaterialError:
            raise StoreError(f"the family {name} is out of date: the store has no {member}") from None
        if known.request_sha256 != request_sha256:
            raise StoreError(stale(name, member))
        at = dict(zip(record.axes, values, strict=True))
        if known.model != record.model or any(known.parameters.get(x) != value for x, value in at.items()):
            raise StoreError(f"the family {name} is damaged: {member} is not of {record.model} at {at}")
        if not (known.title or "").startswith(record.title):
            raise StoreError(f"the family {name} is damaged: {record.title!r} is not the title of {member}")
    return path.stat().st_size
