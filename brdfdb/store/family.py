"""Families: a model at any parameters between those of the tables of a sweep, interpolated, with a measured error.

ROOT/families/NAME.json   which tables, over which parameters, how values between them are found, and how well
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import EllipsisType
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from brdfdb.arrays import array_lookup
from brdfdb.errors import ParameterError, StoreError, percent, sentence_of
from brdfdb.geometry import asked_for, checked_angles, checked_vectors, common_shape, degrees, radians
from brdfdb.materials import written_name
from brdfdb.models import MODELS
from brdfdb.notebook import card
from brdfdb.parameters import Floats, Gradient, Parameter
from brdfdb.store.files import read_sealed
from brdfdb.tables.evaluation import LookupSubject
from brdfdb.tables.grids import Axis
from brdfdb.tables.stated_error import Error
from brdfdb.tables.table import Table
from brdfdb.tables.table_base import Stated

FORMAT = "brdfdb-family"
FORMAT_VERSION: Literal[2] = 2  # 1: without an error near the light and at the horizon
_STRICT = ConfigDict(frozen=True, extra="forbid")
_SAME = 1e-12  # relative tolerance for treating a parameter as equal to a member's value
_SAME_SINGLE = 1.2e-7  # the same for float32


class FamilyLine(BaseModel):
    """A family, as lists show it."""

    model_config = _STRICT

    name: str
    title: str
    model: str
    axes: dict[str, list[float]] = Field(
        description="values of each swept parameter, named and in the unit as in files: degrees under names in _deg"
    )
    members: list[str] = Field(description="names of the materials; the last axis runs fastest")


class Sweep(FamilyLine):
    """Tables of a family, with the requests that they were built for."""

    request_sha256: list[str] = Field(description="sha256 of the request of each member")

    @property
    def parameters(self) -> dict[str, Parameter]:
        """The swept parameters, by the names that `axes` gives them."""
        by_name = {written_name(parameter): parameter for parameter in MODELS[self.model].parameters}
        return {written: by_name[written] for written in self.axes}

    @property
    def nodes(self) -> dict[str, Axis]:
        """The values of the swept parameters by the names and in the units of the model: angles in radians."""
        return {
            parameter.name: np.array([radians(v) if parameter.unit == "rad" else v for v in self.axes[written]])
            for written, parameter in self.parameters.items()
        }

    def in_model_units(self, written: Mapping[str, float]) -> dict[str, float]:
        """Return parameters of files by the names and in the units of the model; ParameterError for another name."""
        swept = self.parameters
        for name, value in written.items():
            if name not in swept:
                raise ParameterError(name, f"the parameters of {self.name} are {', '.join(swept)}", value, tuple(swept))
        return {
            swept[name].name: float(radians(value)) if swept[name].unit == "rad" else value
            for name, value in written.items()
        }

    def in_file_units(self, at: Mapping[str, float]) -> dict[str, float]:
        """Return parameters of the model by the names and in the units of files, to six digits."""
        return {
            written: float(f"{degrees(at[parameter.name]) if parameter.unit == 'rad' else at[parameter.name]:.6g}")
            for written, parameter in self.parameters.items()
        }


class Blend(BaseModel):
    """The interpolation between members: by polynomials, in one parameter after the other."""

    model_config = _STRICT

    method: Literal["linear", "cubic"] = Field(
        description="between the two values next to a parameter, or by the cubic through the four around it, fewer if "
        "there are no more"
    )
    powers: dict[str, Literal[-2, -1, 0, 1, 2]] = Field(
        description="of each swept parameter, in which these are polynomials; 0: its logarithm"
    )
    offset: float | None = Field(
        description="1/sr; the logarithm of f_r plus this number is interpolated; null: f_r itself"
    )
    specular_offset: float | None = Field(description="the same for the specular part, without unit")
    reason: str = Field(description="measured errors of this and of the other interpolations")


class WorstPoint(BaseModel):
    """The measured parameters at which the interpolation is worst."""

    model_config = _STRICT

    parameters: dict[str, float] = Field(description="as in axes")
    p99: float = Field(description="99th percentile of the relative error of f_r, at the worst wavelength")


class FamilyRecord(Sweep):
    """A family as the store records it."""

    format: Literal["brdfdb-family"] = "brdfdb-family"
    version: Literal[2] = FORMAT_VERSION
    interpolation: Blend
    error: Error = Field(
        description="error of interpolated f_r against the model, over all directions and parameters together. The "
        "parameters are spread evenly over the cells between members, the same number in each; of more than 256 cells, "
        "256 random ones have one each. 99 of 100 values are within p99; places are measured at the same parameters"
    )
    points: int = Field(description="number of parameters at which the error was measured")
    worst: WorstPoint
    specular_error: float | None = Field(
        description="largest absolute error of the specular part at the same parameters"
    )


def read_record(path: Path) -> FamilyRecord:
    """Return the record of a family in a file; StoreError, naming the family, as by `record_from`."""
    where = f"the family {path.stem}"
    return record_from(read_sealed(path, where), where)


def record_from(content: Mapping[str, Any], where: str) -> FamilyRecord:
    """Return a family from its JSON; StoreError, beginning with `where`, if this program cannot read it."""
    if (content.get("format"), content.get("version")) != (FORMAT, FORMAT_VERSION):
        raise StoreError(
            f"{where} is of format {content.get('format')} version {content.get('version')}, "
            f"this program reads {FORMAT} version {FORMAT_VERSION}"
        )
    try:
        record = FamilyRecord.model_validate(content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise StoreError(f"{where} is damaged: {'.'.join(map(str, first['loc']))}: {sentence_of(first)}") from None
    if where != f"the family {record.name}":
        raise StoreError(f"{where} is damaged: its record is that of {record.name}")
    return record


def member_loader(sweep: Sweep, tables: Mapping[str, Table]) -> Callable[[int], Table]:
    """Return a function that loads a member by its number, and caches the members used last.

    It raises StoreError for a member that was built anew for another request, or has other wavelengths than another.
    """
    shared: dict[str, Axis] = {}  # wavelengths of the member that was loaded first

    @functools.lru_cache(maxsize=2 * math.prod(min(4, len(values)) for values in sweep.axes.values()))
    def load(number: int) -> Table:
        name = sweep.members[number]
        table = tables[name]
        if table.metadata.request_sha256 != sweep.request_sha256[number]:
            raise StoreError(stale(sweep.name, name))
        wavelengths = np.empty(0) if table.wavelength_nm is None else table.wavelength_nm
        if not np.array_equal(shared.setdefault("wavelength_nm", wavelengths), wavelengths):
            raise StoreError(f"the family {sweep.name}: {name} is at other wavelengths than another member")
        return table

    return load


def stale(family: str, member: str) -> str:
    """Return the sentence about a family whose member is not the one that its record was made of."""
    return (
        f"the family {family} is out of date: {member} was rebuilt since the error of the family was measured; "
        "build its recipe again"
    )


class Stencil(NamedTuple):
    """The nodes around values of a parameter: numbers of the first ones (...), and weights (..., nodes).

    `slopes` are the derivatives of the weights by the parameter; 0 unless they are wanted.
    """

    first: NDArray[np.int64]
    weights: Floats
    slopes: Floats


def stencil(nodes: Axis, value: ArrayLike, power: int, *, cubic: bool, derive: bool = False) -> Stencil:
    """Return the nodes around values (...) of a parameter, with their weights, and with `derive` their derivatives.

    Lagrange's polynomial through 2 nodes, or 4 (3 if there are no more), in a power of the parameter or its logarithm
    (power 0). At a node its weight is exactly 1, that of others 0.
    """
    width = min(4 if cubic else 2, nodes.size)
    at = np.asarray(value, dtype=np.float64)
    cell = np.searchsorted(nodes, at, side="right") - 1
    first = np.clip(cell - (width - 2) // 2, 0, nodes.size - width)
    x = np.log(nodes) if power == 0 else nodes ** float(power)
    scaled = np.where(at == nodes[cell], x[cell], np.log(at) if power == 0 else at ** float(power))
    near = [x[first + k] for k in range(width)]
    pairs = list(itertools.permutations(range(width), 2))
    factors = {(j, k): (scaled - near[k]) / (near[j] - near[k]) for j, k in pairs}
    weights = np.ones((*at.shape, width))
    slopes = np.zeros((*at.shape, width))
    for j, k in pairs:
        weights[..., j] *= factors[j, k]
    if not derive:
        return Stencil(first, weights, slopes)
    for j, k in pairs:
        rest = [factors[j, m] for m in range(width) if m not in (j, k)]
        slopes[..., j] += math.prod(rest, start=1.0 / (near[j] - near[k]))
    by_x = 1.0 / at if power == 0 else power * at ** float(power - 1)  # derivative of the power
    return Stencil(first, weights, slopes * np.asarray(by_x)[..., np.newaxis])


class _Mean:
    """The weighted mean of values (...), or of logarithms of values plus `offset`, with its derivatives.

    Points that are `single` have one value, of weight 1, and get it unchanged.
    """

    def __init__(
        self, shape: tuple[int, ...], offset: float | None, single: ArrayLike = False, slopes: int = 0
    ) -> None:
        self._offset = offset
        self._single = np.broadcast_to(single, shape)
        self._total = np.zeros(shape)
        self._slopes = [np.zeros(shape) for _ in range(slopes)]
        self._black = np.ones(shape, dtype=bool)  # where values that have a weight are 0
        self._flat = np.ones(shape, dtype=bool)  # where all values are

    def add(self, rows: Any, value: Floats, weight: ArrayLike, slopes: Sequence[ArrayLike] = ()) -> None:
        """Add the values of some points, with their weight and its derivatives."""
        value = np.asarray(value, dtype=np.float64)
        summand = value if self._offset is None else np.log(np.maximum(value, 0.0) + self._offset)
        black = np.equal(value, 0.0)
        self._black[rows] &= black | np.equal(weight, 0.0)
        self._total[rows] += np.multiply(weight, np.where(self._single[rows], value, summand))
        if self._slopes:
            self._flat[rows] &= black
        for total, slope in zip(self._slopes, slopes, strict=True):
            total[rows] += np.multiply(slope, summand)

    def result(self) -> tuple[Floats, list[Floats]]:
        """Return the mean, 0 where all values are and at least 0 elsewhere, and its derivatives, 0 where it is cut."""
        mean, factor = self._total, np.ones(())
        if self._offset is not None:
            mean = np.where(self._single, mean, np.exp(np.where(self._single, 0.0, mean)) - self._offset)
            factor = mean + self._offset
        cut = self._flat | (mean < 0.0)
        return (
            np.where(self._black, 0.0, np.maximum(mean, 0.0)),
            [np.where(cut, 0.0, factor * slope) for slope in self._slopes],
        )


def blended(values: Sequence[Floats], weights: Sequence[ArrayLike], offset: float | None) -> Floats:
    """Return the weighted mean of values, or of the logarithms of values plus `offset`; 0 where all values are."""
    mean = _Mean(np.broadcast_shapes(*map(np.shape, [*values, *weights])), offset)
    for value, weight in zip(values, weights, strict=True):
        mean.add(..., value, weight)
    return mean.result()[0]


class _Use(NamedTuple):
    """A member, its points among those of a call, its weight there, and the derivatives of this weight."""

    table: Table
    rows: Any  # an array, or all
    weight: Any
    slopes: list[Any]


class _Query(NamedTuple):
    """Points of one call: angles or vectors, and the members around their parameters.

    Parameters and directions that broadcast to `shape` have a row for each point, in the `order` of the cells between
    members, which keeps close together what a member needs. Of a single set of parameters `shape` is None, and the
    directions are as they were given.
    """

    given: tuple[Any, ...]
    stencils: list[Stencil]
    derive: bool
    shape: tuple[int, ...] | None = None
    order: NDArray[np.int64] = np.zeros(1, dtype=np.int64)

    @property
    def single(self) -> NDArray[np.bool_]:
        """True at points that are members."""
        return np.asarray(np.all([np.count_nonzero(along.weights, axis=-1) == 1 for along in self.stencils], axis=0))

    def at(self, rows: Any) -> tuple[Any, ...]:
        """Return the angles or vectors of rows."""
        return self.given if self.shape is None else tuple(array[rows] for array in self.given)


class _AtParameters:
    """A family at given parameters, with the lookups of a table."""

    def __init__(self, family: Family, at: dict[str, float]) -> None:
        self.lookup = functools.partial(family.lookup, **at)
        self.lookup_with_error = functools.partial(family.lookup_with_error, **at)
        self.specular_reflectance = functools.partial(family.specular_reflectance, **at)


class Family:
    """A family opened for reading: f_r at any parameters within the swept ranges, without the model.

    Attributes
    ----------
    record : FamilyRecord
        The record in the store: members, interpolation, measured error.
    axes : dict of str to array
        The values of the swept parameters, in the units of the model: angles in radians.
    """

    def __init__(self, record: FamilyRecord, tables: Mapping[str, Table]) -> None:
        self.record = record
        self.axes = record.nodes
        self._member = member_loader(record, tables)
        self._limits = [
            replace(parameter, low=float(self.axes[parameter.name][0]), high=float(self.axes[parameter.name][-1]))
            for parameter in record.parameters.values()
        ]
        self._powers = [record.interpolation.powers[written] for written in record.axes]

    @property
    def name(self) -> str:
        """Name of the family."""
        return self.record.name

    def _repr_html_(self) -> str:
        """Return the family for notebooks: what its record states."""
        record = self.record
        swept = [f"{name} {values[0]:g} to {values[-1]:g} ({len(values)})" for name, values in record.axes.items()]
        facts = [
            ("model", record.model),
            ("parameters", ", ".join(swept)),
            ("members", str(len(record.members))),
            ("interpolation", record.interpolation.method),
            ("stated error", f"{percent(record.error.overall.p99)} (99 of 100 values)"),
        ]
        return card("Family", record.name, record.title, facts)

    @property
    def error(self) -> Error:
        """The measured error of f_r between members, over directions and parameters."""
        return self.record.error

    @property
    def wavelength_nm(self) -> Axis | None:
        """Wavelengths [nm] of all members; None if they are grey."""
        return self._member(0).wavelength_nm

    def surface(self, written: Mapping[str, float]) -> LookupSubject:
        """Return the family at parameters as files write them; a lookup raises what `lookup` does."""
        return LookupSubject(_AtParameters(self, self.record.in_model_units(written)), "family", self.wavelength_nm)

    @array_lookup
    def lookup(
        self,
        theta_i: ArrayLike,
        phi_i: ArrayLike,
        theta_r: ArrayLike,
        phi_r: ArrayLike,
        wavelength_nm: ArrayLike | None = None,
        **parameters: ArrayLike,
    ) -> Floats:
        """Interpolate f_r [1/sr] over directions, wavelengths and parameters.

        Parameters
        ----------
        theta_i, phi_i, theta_r, phi_r, wavelength_nm
            As in `Table.lookup`: angles in radians.
        **parameters : array_like
            Each swept parameter, in the unit of the model: angles in radians. They broadcast with the angles.

        Returns
        -------
        array [1/sr]
            Shaped as by `Table.lookup`. At the parameters of a member, what that table gives.

        Raises
        ------
        ParameterError
            If a parameter is missing, not swept or outside its swept range, or an angle or wavelength is outside its
            range.
        StoreError
            If a member was built anew since the family was recorded.

        Notes
        -----
        Each member is read once in a call, at all the points that need it: one call with a million sets of parameters
        is a thousand times faster than a million calls.
        """
        query = self._query(parameters, (theta_i, phi_i, theta_r, phi_r))
        return self._interpolated(query, Table.lookup, wavelength_nm).f_r

    @array_lookup
    def lookup_vectors(
        self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None, **parameters: ArrayLike
    ) -> Floats:
        """Interpolate f_r [1/sr] for unit vectors `wi` of the light and `wr` of the viewer, each of shape (..., 3)."""
        query = self._query(parameters, (wi, wr), 1)
        return self._interpolated(query, Table.lookup_vectors, wavelength_nm).f_r

    @array_lookup
    def gradient(
        self,
        theta_i: ArrayLike,
        phi_i: ArrayLike,
        theta_r: ArrayLike,
        phi_r: ArrayLike,
        wavelength_nm: ArrayLike | None = None,
        **parameters: ArrayLike,
    ) -> Gradient:
        """Return f_r [1/sr] and its derivatives by the swept parameters, as `brdfdb.derivatives.gradient` does.

        Arguments and errors are those of `lookup`.

        Returns
        -------
        Gradient
            `f_r` [1/sr], the same as by `lookup`, and `derivatives`, a dict from the names of the swept parameters to
            arrays of the same shape, each in 1/sr over the unit of its parameter.

        Notes
        -----
        The derivatives are those of the interpolation polynomials, without differences, and not those of the model. At
        the parameters of a member, where two polynomials meet, they are those of the polynomial above, at the upper end
        of a range that below. Where f_r is held at 0, they are 0.
        """
        query = self._query(parameters, (theta_i, phi_i, theta_r, phi_r), derive=True)
        return self._interpolated(query, Table.lookup, wavelength_nm)

    @array_lookup
    def gradient_vectors(
        self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None, **parameters: ArrayLike
    ) -> Gradient:
        """Return `gradient` for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
        query = self._query(parameters, (wi, wr), 1, derive=True)
        return self._interpolated(query, Table.lookup_vectors, wavelength_nm)

    @array_lookup
    def lookup_with_error(
        self,
        theta_i: ArrayLike,
        phi_i: ArrayLike,
        theta_r: ArrayLike,
        phi_r: ArrayLike,
        wavelength_nm: ArrayLike | None = None,
        **parameters: ArrayLike,
    ) -> Stated:
        """Interpolate f_r [1/sr], and give the stated error [1/sr] of each value.

        Parameters and errors are those of `lookup`. At the parameters of a member the error is what its table states,
        elsewhere what was measured of the family.
        """
        given = (theta_i, phi_i, theta_r, phi_r)
        return self._with_error(
            self._query(parameters, given),
            Table.lookup,
            Table.lookup_with_error,
            wavelength_nm,
            lambda table, brdf: table.stated_by(self.error, checked_angles(*given), brdf, wavelength_nm),
        )

    @array_lookup
    def lookup_vectors_with_error(
        self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None, **parameters: ArrayLike
    ) -> Stated:
        """Interpolate f_r [1/sr] for unit vectors, and give the stated error [1/sr]; as `lookup_with_error`."""
        return self._with_error(
            self._query(parameters, (wi, wr), 1),
            Table.lookup_vectors,
            Table.lookup_vectors_with_error,
            wavelength_nm,
            lambda table, brdf: table.stated_by(self.error, checked_vectors(wi, wr), brdf, wavelength_nm),
        )

    @array_lookup
    def specular_reflectance(
        self, theta_i: ArrayLike, wavelength_nm: ArrayLike | None = None, **parameters: ArrayLike
    ) -> Floats:
        """Interpolate the reflectance [1] of the specular part; 0 for models that have none.

        Arguments, shape and errors are those of `Table.specular_reflectance` and `lookup`. The error is at most
        `record.specular_error`.
        """
        query = self._query(parameters, (theta_i,))
        return self._interpolated(
            query,
            Table.specular_reflectance,
            wavelength_nm,
            offset=self.record.interpolation.specular_offset,
        ).f_r

    def around(self, **parameters: ArrayLike) -> list[Table]:
        """Return the members that a lookup at these parameters interpolates; errors as by `lookup`."""
        return [use.table for use in self._uses(self._query(parameters, ()))]

    def _query(
        self, parameters: Mapping[str, Any], given: tuple[Any, ...], own: int = 0, *, derive: bool = False
    ) -> _Query:
        """Return the points of a call; the last `own` axes of what is given do not broadcast."""
        stencils = self._stencils(parameters, derive=derive)
        if (swept := stencils[0].first.shape) == ():
            return _Query(given, stencils, derive)
        arrays = [np.asarray(array) for array in given]
        try:
            shape = np.broadcast_shapes(swept, *(array.shape[: array.ndim - own] for array in arrays))
        except ValueError:
            shapes = ", ".join(str(array.shape[: array.ndim - own]) for array in arrays)
            raise ParameterError(
                next(iter(self.axes)), f"the shapes of parameters, {swept}, and directions, {shapes}, do not broadcast"
            ) from None
        dtype = asked_for(*given)
        first = [np.broadcast_to(along.first, shape).reshape(-1) for along in stencils]
        order = np.argsort(self._number(first), kind="stable")

        def rows(array: NDArray[Any], last: tuple[int, ...]) -> NDArray[Any]:
            return np.broadcast_to(array, (*shape, *last)).reshape(-1, *last)[order]

        numbers = [array.astype(dtype) if array.dtype.kind in "iuf" else array for array in arrays]
        return _Query(
            tuple(rows(array, array.shape[array.ndim - own :]) for array in numbers),
            [Stencil(*(rows(part, part.shape[stencils[0].first.ndim :]) for part in along)) for along in stencils],
            derive,
            shape,
            order,
        )

    def _number(self, corner: Iterable[NDArray[np.int64]]) -> NDArray[np.int64]:
        """Return the numbers of members from their places along the parameters."""
        return np.asarray(np.ravel_multi_index(tuple(corner), tuple(nodes.size for nodes in self.axes.values())))

    def _uses_of_one(self, query: _Query) -> Iterator[_Use]:
        """Yield the members around a single set of parameters, with all directions; numbers of Python are faster."""
        near = [
            [(int(first) + k, *both) for k, both in enumerate(zip(weights.tolist(), slopes.tolist(), strict=True))]
            for first, weights, slopes in query.stencils
        ]
        for corner in itertools.product(*([part for part in along if part[1] or part[2]] for along in near)):
            number = 0
            for nodes, part in zip(self.axes.values(), corner, strict=True):
                number = number * nodes.size + part[0]
            weights = [weight for _, weight, _ in corner]
            by = [math.prod([*weights[:k], part[2], *weights[k + 1 :]]) for k, part in enumerate(corner)]
            if (weight := math.prod(weights)) or any(by):
                yield _Use(self._member(number), ..., np.float64(weight), [np.float64(slope) for slope in by])

    def _uses(self, query: _Query) -> Iterator[_Use]:
        """Yield each member that has a weight, once, with its points; points of a cell have the same members."""
        if query.shape is None:
            yield from self._uses_of_one(query)
            return
        first, weights, slopes = zip(*query.stencils, strict=True)
        cells, starts = np.unique(self._number(first), return_index=True)
        corners = np.indices([along.shape[-1] for along in weights]).reshape(len(first), -1)
        beyond = self._number(corners).tolist()
        points: dict[int, list[NDArray[np.int64]]] = {}
        groups = np.split(np.arange(first[0].size), starts[1:])
        for lowest, rows in zip(cells.tolist(), groups, strict=False):  # no cell of no points
            for number in beyond:
                points.setdefault(lowest + number, []).append(rows)
        for number in sorted(points) or [0]:
            rows = np.concatenate(points.get(number, [np.arange(0)]))
            place = np.unravel_index([number], tuple(nodes.size for nodes in self.axes.values()))
            within = [i - f[rows] for i, f in zip(place, first, strict=True)]
            along = [w[rows, k] for w, k in zip(weights, within, strict=True)]
            weight = np.asarray(math.prod(along))
            by = [
                np.asarray(math.prod([*along[:axis], slope[rows, within[axis]], *along[axis + 1 :]]))
                for axis, slope in enumerate(slopes)
                if query.derive
            ]
            used = np.logical_or.reduce([np.not_equal(w, 0.0) for w in (weight, *by)])
            if used.any() or not used.size:
                yield _Use(self._member(number), rows[used], weight[used], [w[used] for w in by])

    def _interpolated(
        self,
        query: _Query,
        look: Callable[..., Floats],
        wavelength_nm: ArrayLike | None,
        *,
        offset: float | EllipsisType | None = ...,
    ) -> Gradient:
        """Return the mean over members of the values that `look` finds, and its derivatives."""
        blend = self.record.interpolation.offset if offset is ... else offset
        mean = None
        for use in self._uses(query):
            value = np.asarray(look(use.table, *query.at(use.rows), wavelength_nm))
            if mean is None:
                dtype = value.dtype
                tail = value.shape if query.shape is None else value.shape[1:]
                spread = (..., *(np.newaxis,) * len(tail))
                points = () if query.shape is None else (math.prod(query.shape),)
                mean = _Mean((*points, *tail), blend, query.single[spread], len(self.axes) if query.derive else 0)
            mean.add(use.rows, value, use.weight[spread], [slope[spread] for slope in use.slopes if query.derive])
        assert mean is not None
        brdf, slopes = mean.result()
        arrays = [array.astype(dtype) for array in (brdf, *slopes)]
        if query.shape is not None:
            back = np.argsort(query.order)
            arrays = [array[back].reshape((*query.shape, *tail)) for array in arrays]
        shaped = [array[()] for array in arrays]
        return Gradient(shaped[0], dict(zip(self.axes, shaped[1:], strict=query.derive)))

    def _with_error(
        self,
        query: _Query,
        look: Callable[..., Floats],
        of_member: Callable[..., Stated],
        wavelength_nm: ArrayLike | None,
        stated: Callable[[Table, Floats], Floats],
    ) -> Stated:
        """Return f_r and its error: what members state at their parameters, what the family states elsewhere."""
        single = query.single
        if query.shape is None and single:
            return of_member(next(self._uses(query)).table, *query.given, wavelength_nm)
        brdf = self._interpolated(query, look, wavelength_nm).f_r
        error = np.asarray(stated(self._member(0), brdf))
        if single.any():
            rows = error.reshape(single.size, -1).copy()
            for use in self._uses(query):
                exact = use.rows[single[use.rows]]
                if exact.size:
                    own = of_member(use.table, *query.at(exact), wavelength_nm).error
                    rows[query.order[exact]] = own.reshape(exact.size, -1)
            error = rows.reshape(error.shape)
        return Stated(brdf, error[()])

    def _stencils(self, parameters: Mapping[str, Any], *, derive: bool) -> list[Stencil]:
        """Return the members around points, along each parameter; all broadcast to the same shape."""
        names = list(self.axes)
        for name in parameters:
            if name not in names:
                known = f"the parameters of the family {self.name} are {', '.join(names)}"
                raise ParameterError(name, f"{parameters[name]!r} given, but {known}", parameters[name], tuple(names))
        values = []
        for limits, nodes in zip(self._limits, self.axes.values(), strict=True):
            if limits.name not in parameters:
                needed = f"missing, {self.name} needs a value in {limits.interval}"
                raise ParameterError(limits.name, needed, None, (limits.low, limits.high))
            values.append(_checked(limits, nodes, parameters[limits.name]))
        common_shape(", ".join(names), *values)
        cubic = self.record.interpolation.method == "cubic"
        return [
            stencil(nodes, value, power, cubic=cubic, derive=derive)
            for nodes, value, power in zip(self.axes.values(), np.broadcast_arrays(*values), self._powers, strict=True)
        ]


def _checked(limits: Parameter, nodes: Axis, value: Any) -> Floats:
    """Return numbers within limits; a number that differs from a node by rounding is that of the node."""
    given: NDArray[Any] = np.asarray(value)
    if given.dtype.kind not in "iuf":
        return limits.check(value)
    nearest = nodes[np.searchsorted((nodes[1:] + nodes[:-1]) / 2.0, given)]
    same = _SAME_SINGLE if given.dtype == np.float32 else _SAME
    return limits.check(np.where(np.abs(nearest - given) <= same * np.abs(nodes).max(), nearest, given))
