"""Families: a model at any parameters between those of the tables of a sweep, interpolated, with a measured error.

ROOT/families/NAME.json   which tables, over which parameters, how values between them are found, and how well
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from brdfdb.arrays import array_lookup
from brdfdb.errors import ParameterError, StoreError, percent, sentence_of
from brdfdb.geometry import checked_angles, checked_vectors, degrees, radians
from brdfdb.materials import written_name
from brdfdb.models import MODELS
from brdfdb.notebook import card
from brdfdb.parameters import Floats, Parameter
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
    """The nodes around a value of a parameter: the number of the first, and the weight of each."""

    first: int
    weights: Floats


def stencil(nodes: Axis, value: float, power: int, *, cubic: bool) -> Stencil:
    """Return the nodes around a value of a parameter, with their weights.

    Lagrange's polynomial through 2 nodes, or 4 (3 if there are no more), in a power of the parameter or its logarithm
    (power 0). At a node its weight is exactly 1, that of others 0.
    """
    width = min(4 if cubic else 2, nodes.size)
    cell = int(np.searchsorted(nodes, value, side="right")) - 1
    first = min(max(cell - (width - 2) // 2, 0), nodes.size - width)
    near = nodes[first : first + width]
    x = np.log(near) if power == 0 else near ** float(power)
    at = np.log(value) if power == 0 else value ** float(power)
    others = ~np.eye(width, dtype=bool)
    factors = np.divide(at - x, x[:, np.newaxis] - x, out=np.ones((width, width)), where=others)
    return Stencil(first, np.prod(factors, axis=1))


def blended(values: Sequence[Floats], weights: Sequence[ArrayLike], offset: float | None) -> Floats:
    """Return the weighted mean of values, or of the logarithms of values plus `offset`; 0 where all values are."""
    if offset is None:
        mean = sum(np.asarray(weight) * value for weight, value in zip(weights, values, strict=True))
        return np.maximum(mean, 0.0)
    logarithms = sum(
        np.asarray(weight) * np.log(np.maximum(value, 0.0) + offset)
        for weight, value in zip(weights, values, strict=True)
    )
    black = np.logical_and.reduce([np.equal(value, 0.0) for value in values])
    return np.where(black, 0.0, np.maximum(np.exp(logarithms) - offset, 0.0))


class _Part(NamedTuple):
    """A member and its weight."""

    table: Table
    weight: float


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
        **parameters: float,
    ) -> Floats:
        """Interpolate f_r [1/sr] over directions, wavelengths and parameters.

        Parameters
        ----------
        theta_i, phi_i, theta_r, phi_r, wavelength_nm
            As in `Table.lookup`: angles in radians.
        **parameters : float
            One number for each swept parameter, in the unit of the model: angles in radians.

        Returns
        -------
        array [1/sr]
            Shaped as by `Table.lookup`. At the parameters of a member, what that table gives.

        Raises
        ------
        ParameterError
            If a parameter is missing, not swept, not one number or outside its swept range, or an angle or wavelength
            is outside its range.
        StoreError
            If a member was built anew since the family was recorded.
        """
        given = (theta_i, phi_i, theta_r, phi_r, wavelength_nm)
        return self._blended(self._parts(parameters), lambda table: table.lookup(*given))

    @array_lookup
    def lookup_vectors(
        self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None, **parameters: float
    ) -> Floats:
        """Interpolate f_r [1/sr] for unit vectors `wi` of the light and `wr` of the viewer, each of shape (..., 3)."""
        return self._blended(self._parts(parameters), lambda table: table.lookup_vectors(wi, wr, wavelength_nm))

    @array_lookup
    def lookup_with_error(
        self,
        theta_i: ArrayLike,
        phi_i: ArrayLike,
        theta_r: ArrayLike,
        phi_r: ArrayLike,
        wavelength_nm: ArrayLike | None = None,
        **parameters: float,
    ) -> Stated:
        """Interpolate f_r [1/sr], and give the stated error [1/sr] of each value.

        Parameters and errors are those of `lookup`. At the parameters of a member the error is what its table states,
        elsewhere what was measured of the family.
        """
        parts = self._parts(parameters)
        given = (theta_i, phi_i, theta_r, phi_r, wavelength_nm)
        if len(parts) == 1:
            return parts[0].table.lookup_with_error(*given)
        brdf = self._blended(parts, lambda table: table.lookup(*given))
        directions = checked_angles(theta_i, phi_i, theta_r, phi_r)
        return Stated(brdf, parts[0].table.stated_by(self.error, directions, brdf, wavelength_nm))

    @array_lookup
    def lookup_vectors_with_error(
        self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None, **parameters: float
    ) -> Stated:
        """Interpolate f_r [1/sr] for unit vectors, and give the stated error [1/sr]; as `lookup_with_error`."""
        parts = self._parts(parameters)
        if len(parts) == 1:
            return parts[0].table.lookup_vectors_with_error(wi, wr, wavelength_nm)
        brdf = self._blended(parts, lambda table: table.lookup_vectors(wi, wr, wavelength_nm))
        return Stated(brdf, parts[0].table.stated_by(self.error, checked_vectors(wi, wr), brdf, wavelength_nm))

    @array_lookup
    def specular_reflectance(
        self, theta_i: ArrayLike, wavelength_nm: ArrayLike | None = None, **parameters: float
    ) -> Floats:
        """Interpolate the reflectance [1] of the specular part; 0 for models that have none.

        Arguments, shape and errors are those of `Table.specular_reflectance` and `lookup`. The error is at most
        `record.specular_error`.
        """
        parts = self._parts(parameters)
        values = [part.table.specular_reflectance(theta_i, wavelength_nm) for part in parts]
        if len(parts) == 1:
            return values[0]
        return blended(values, [part.weight for part in parts], self.record.interpolation.specular_offset)[()]

    def around(self, **parameters: float) -> list[Table]:
        """Return the members that a lookup at these parameters interpolates; errors as by `lookup`."""
        return [part.table for part in self._parts(parameters)]

    def _blended(self, parts: Sequence[_Part], look: Callable[[Table], Floats]) -> Floats:
        """Return the weighted mean of the values that `look` finds in members, or those of a single member."""
        values = [look(part.table) for part in parts]
        if len(parts) == 1:
            return values[0]
        mean = blended(
            [np.asarray(value, dtype=np.float64) for value in values],
            [part.weight for part in parts],
            self.record.interpolation.offset,
        )
        return mean.astype(np.asarray(values[0]).dtype)[()]

    def _parts(self, parameters: Mapping[str, Any]) -> list[_Part]:
        """Return the members around a point, with weights that add up to 1."""
        names = list(self.axes)
        for name in parameters:
            if name not in names:
                known = f"the parameters of the family {self.name} are {', '.join(names)}"
                raise ParameterError(name, f"{parameters[name]!r} given, but {known}", parameters[name], tuple(names))
        around = []
        cubic = self.record.interpolation.method == "cubic"
        for limits, nodes, power in zip(self._limits, self.axes.values(), self._powers, strict=True):
            if limits.name not in parameters:
                needed = f"missing, {self.name} needs a value in {limits.interval}"
                raise ParameterError(limits.name, needed, None, (limits.low, limits.high))
            near = stencil(nodes, _checked(limits, nodes, parameters[limits.name]), power, cubic=cubic)
            around.append([(near.first + k, weight) for k, weight in enumerate(near.weights) if weight != 0.0])
        shape = [nodes.size for nodes in self.axes.values()]
        parts = []
        for corner in itertools.product(*around):
            number = int(np.ravel_multi_index([at for at, _ in corner], shape))
            parts.append(_Part(self._member(number), float(np.prod([weight for _, weight in corner]))))
        return parts


def _checked(limits: Parameter, nodes: Axis, value: Any) -> float:
    """Return a number within limits; a number that differs from a node by rounding is that of the node."""
    if np.ndim(value) != 0:
        raise ParameterError(
            limits.name, f"{value!r} is not one number in {limits.interval}", value, (limits.low, limits.high)
        )
    given: NDArray[Any] = np.asarray(value)
    if given.dtype.kind in "iuf":
        nearest = nodes[np.argmin(np.abs(nodes - given))]
        if abs(nearest - given) <= _SAME * np.abs(nodes).max():
            return float(nearest)
    return float(limits.check(value))
