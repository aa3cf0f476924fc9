"""Lookups at many points in degrees: spectra or colours, errors, the specular part, Stokes vectors; views of a lobe."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, PlainValidator, ValidationInfo, WithJsonSchema, model_validator

from brdfdb.errors import ParameterError
from brdfdb.geometry import check_azimuth_deg, directions_from_half_difference, radians
from brdfdb.materials import Material
from brdfdb.measurements.glints import Glints
from brdfdb.parameters import Array, check_nanometres
from brdfdb.spectra import ILLUMINANT, colour_weights
from brdfdb.tables import stokes

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

ANGLES = ("theta_i", "phi_i", "theta_r", "phi_r")
Angles = tuple[Any, Any, Any, Any]  # theta_i, phi_i, theta_r, phi_r [rad]
TURN = 360.0  # degrees; fmod is exact

_MOST_AXES = 32  # axes that numpy broadcasts
_HEADER_BYTES = 4096  # limit on the header of a .npy file, which usually takes a hundred
_SHOWN = 40  # characters of the type of an array that a refusal repeats
Output = Literal["spectrum", "xyz", "linear-srgb"]

_ROUNDING = 1e-6  # of a degree of polarisation that is written as decimals
_AT_ONCE = 25_000  # points whose spectra are in memory at once while colours are computed
ViewName = Literal["cut", "hemisphere", "half-difference"]

# Angles of views
_CUT = np.arange(-90.0, 91.0)  # theta_r [degree], negative back towards the light
_OVER = np.linspace(0.0, 90.0, 31)  # theta_r of a hemisphere [degree]
_AROUND = np.linspace(0.0, 360.0, 61)  # delta_phi [degree]
# Angles from the mirror direction [degree]
_NEAR = np.array([-12.0, -8.0, -5.0, -3.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0])
_HALF: Array = np.arange(90, dtype=np.float64) + 0.5  # theta_h and theta_d [degree]
MOST_POINTS = _HALF.size**2  # points of the largest view


class LookupPoints(NamedTuple):
    """Checked directions and wavelengths of one lookup.

    `angles` are theta_i, phi_i, theta_r, phi_r [rad], which broadcast to `shape`. `wavelength_nm` is a number, an array
    (n,), or None for every wavelength of the surface.
    """

    angles: Angles
    shape: tuple[int, ...]
    wavelength_nm: float | NDArray[np.float64] | None

    @classmethod
    def of(cls, angles: Angles, wavelength_nm: float | NDArray[np.float64] | None) -> LookupPoints:
        """Return points at angles [rad]."""
        return cls(angles, np.broadcast_shapes(*(np.shape(angle) for angle in angles)), wavelength_nm)

    @property
    def count(self) -> int:  # type: ignore[override]
        """Return the number of points."""
        return math.prod(self.shape)


def listed(wavelengths: Sequence[float]) -> float | NDArray[np.float64] | None:
    """Return the wavelengths [nm] of a query: one as a number, none as None."""
    return (wavelengths[0] if len(wavelengths) == 1 else np.array(wavelengths)) if wavelengths else None


def _numbers(value: Any) -> NDArray[np.float64]:
    """Return a JSON number or nested lists of numbers as a float64 array: not empty, all finite."""
    try:
        types = _types(value)
        array = np.array(value, np.float64) if types <= {int, float} else None  # numpy alone would read true as 1
    except (ValueError, RecursionError):
        raise ValueError("the lists have unequal lengths or are nested too deep") from None
    except OverflowError:
        array = None
    if array is None:
        raise ValueError("not a number or a list of numbers")
    if array.ndim > _MOST_AXES:
        raise ValueError(f"lists in {array.ndim} levels; at most {_MOST_AXES} are allowed")
    if array.size == 0:
        raise ValueError("an empty list")
    if not np.all(finite := np.isfinite(array)):
        raise ValueError(f"{array[~finite][0]} is not a finite number")
    return array


def _types(value: Any) -> set[type]:
    """Return the types of the leaves of nested lists."""
    if type(value) is not list:
        return {type(value)}
    types = set(map(type, value))
    return types.union(*map(_types, value)) - {list} if list in types else types


def _polars(value: Any) -> NDArray[Any]:
    """Return polar angles [rad]."""
    degrees = value if isinstance(value, np.ndarray) else _numbers(value)
    bad = ~((degrees >= 0.0) & (degrees <= 180.0))
    if np.any(bad):
        raise ValueError(f"{degrees[bad].flat[0]} is outside [0, 180] degrees")
    return radians(degrees)


def _azimuths(value: Any, info: ValidationInfo) -> NDArray[Any]:
    """Return azimuths [rad]."""
    degrees = value if isinstance(value, np.ndarray) else _numbers(value)
    check_azimuth_deg(str(info.field_name), degrees)
    return radians(np.fmod(degrees, TURN))


def _wavelengths(value: Any) -> float | NDArray[np.float64] | None:
    if value is None or isinstance(value, np.ndarray):
        return value
    array = _numbers(value)
    if array.ndim > 1:
        raise ValueError("not a number or a flat list of numbers")
    array = check_nanometres("wavelength_nm", array)
    return array if array.ndim else array.item()


_NUMBERS = {"anyOf": [{"type": "number"}, {"type": "array", "items": {}}]}
_OF_LIGHT = [{"type": "number"}, {"type": "array", "items": {"type": "number"}, "minItems": 1}, {"type": "null"}]
_Polars = Annotated[Any, PlainValidator(_polars), WithJsonSchema(_NUMBERS)]
_Azimuths = Annotated[Any, PlainValidator(_azimuths), WithJsonSchema(_NUMBERS)]


class PointsBody(BaseModel):
    """Angles in degrees: numbers or nested lists of numbers that broadcast as numpy arrays do."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"example": {"theta_i": 45, "theta_r": [0, 30, 60], "phi_r": 180}}
    )

    theta_i: _Polars = Field(description="polar angle of the light [degrees], 0 to 180")
    phi_i: _Azimuths = Field(
        default=0.0, validate_default=True, description="azimuth of the light [degrees], -720 to 720"
    )
    theta_r: _Polars = Field(description="polar angle of the viewer [degrees], 0 to 180")
    phi_r: _Azimuths = Field(
        default=0.0, validate_default=True, description="azimuth of the viewer [degrees], -720 to 720"
    )
    wavelength_nm: Annotated[Any, PlainValidator(_wavelengths), WithJsonSchema({"anyOf": _OF_LIGHT})] = Field(
        default=None, description="wavelengths [nm]; missing or null: every wavelength of the table"
    )

    @property
    def angles(self) -> Angles:
        """theta_i, phi_i, theta_r, phi_r [rad]."""
        return self.theta_i, self.phi_i, self.theta_r, self.phi_r

    @model_validator(mode="after")
    def _broadcast(self) -> Self:
        shape: tuple[int, ...] = ()
        for name, angle in zip(ANGLES, self.angles, strict=True):
            try:
                shape = np.broadcast_shapes(shape, angle.shape)
            except ValueError:
                shapes = ", ".join(f"{key} {value.shape}" for key, value in zip(ANGLES, self.angles, strict=True))
                raise ParameterError(name, f"the shapes do not broadcast: {shapes}") from None
        return self

    @property
    def points(self) -> LookupPoints:
        """The points."""
        return LookupPoints.of(self.angles, self.wavelength_nm)


def fields_of_npy(body: bytes) -> dict[str, Any]:
    """Return the angles [degrees] of a .npy file: theta_i, phi_i, theta_r, phi_r, float32 or float64, in (..., 4).

    ParameterError for any other array.
    """
    degrees = _npy(body)
    if degrees.ndim == 0 or degrees.shape[-1] != 4:
        raise ParameterError("body", f"its shape {degrees.shape} is not (..., 4): {', '.join(ANGLES)}")
    if degrees.ndim > _MOST_AXES + 1:
        raise ParameterError("body", f"it has {degrees.ndim} axes; at most {_MOST_AXES + 1} are allowed")
    if degrees.size == 0:
        raise ParameterError("body", "it is an empty array")
    return {name: np.asarray(degrees[..., column]) for column, name in enumerate(ANGLES)}


def _npy(body: bytes) -> NDArray[Any]:
    """Return the float32 or float64 array of a .npy file; the length of the body must agree with its header."""
    stream = io.BytesIO(body)
    try:
        version = np.lib.format.read_magic(stream)
        read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[version]
        shape, by_columns, dtype = read(stream, max_header_size=_HEADER_BYTES)
    except Exception:  # the header is Python text, and reading it raises errors of many kinds
        raise ParameterError("body", "it is not a .npy file") from None
    if dtype not in (np.dtype("<f4"), np.dtype("<f8")):
        raise ParameterError("body", f"its type {str(dtype)[:_SHOWN]} is not float32 or float64, little endian")
    data = memoryview(body)[stream.tell() :]
    if math.prod(shape) * dtype.itemsize != len(data) or any(size < 0 for size in shape):
        raise ParameterError("body", "it is shorter or longer than its .npy header says")
    try:
        return np.frombuffer(data, dtype).reshape(shape, order="F" if by_columns else "C")
    except (TypeError, ValueError):  # an empty array with an axis that is too long, too many axes, or True for a length
        raise ParameterError("body", "its .npy header gives a shape that no array has") from None


class Values(NamedTuple):
    """Values at points: f_r [1/sr], its error or None, the specular part or None; colours on the last axis.

    `stokes` has the fields of `StokesDocument`, or is None where no incident Stokes vector was given.
    """

    surface: LookupSubject
    points: LookupPoints
    output: Output
    illuminant: str | None  # None of spectra
    brdf: Any
    error: Any
    specular_reflectance: Any
    stokes: dict[str, Any] | None = None

    @property
    def array(self) -> NDArray[np.float64]:
        """One array: the reflected Stokes vectors where there are some; else f_r, or f_r and error on a first axis."""
        if self.stokes is not None:
            return np.asarray(self.stokes["reflected"])
        return np.asarray(self.brdf if self.error is None else np.stack([self.brdf, self.error]))


class _Values(NamedTuple):
    """f_r [1/sr], and its stated error or None."""

    brdf: Any
    error: Any


class LookupSubject(NamedTuple):
    """A table, model or family. All have `lookup` and `specular_reflectance`, a table also errors and `extrapolated`.

    `wavelength_nm` (L,) are used where a request names none; None: grey.
    """

    source: Any
    kind: Literal["table", "model", "family"]
    wavelength_nm: NDArray[np.float64] | None

    def wavelengths(self, points: LookupPoints) -> Any:
        """Return the wavelengths [nm] of the values at some points; None if they are grey."""
        return self.wavelength_nm if points.wavelength_nm is None else points.wavelength_nm

    def values(
        self,
        points: LookupPoints,
        output: Output = "spectrum",
        illuminant: str | None = None,
        *,
        error: bool = False,
        specular: bool = True,
        incident: Sequence[float] | None = None,
    ) -> Values:
        """Return the values at points, with the stated `error`, and with the `specular` part at their theta_i.

        With an `incident` Stokes vector (I, Q, U, V) the light that a polarised table reflects is beside its spectra.
        ParameterError outside the range of the surface, where it makes no colour, or where it is not polarised.
        """
        if incident is not None and getattr(self.source, "facets", None) is None:
            raise ParameterError("stokes", f"the table of {self.source.name} is unpolarised", incident)
        # A table takes None as all of its wavelengths, which is faster than naming them
        at = points.wavelength_nm if self.kind == "table" else self.wavelengths(points)

        def spectra(angles: Angles) -> _Values:
            if error:
                return _Values(*self.source.lookup_with_error(*angles, at))
            return _Values(self.source.lookup(*angles, at), None)

        def dirac() -> Any:
            return self.source.specular_reflectance(points.angles[0], at) if specular else None

        if output == "spectrum":
            reflected = None if incident is None else stokes_document(self.source, points, incident)
            return Values(self, points, output, None, *spectra(points.angles), dirac(), reflected)
        grey = self.wavelength_nm is None
        if grey and points.wavelength_nm is not None:
            raise ParameterError("wavelength_nm", "a colour of a grey material has no wavelengths")
        wavelengths = None if grey else np.atleast_1d(self.wavelengths(points))
        light = illuminant or ILLUMINANT
        weights = colour_weights(output, wavelengths, light)
        brdf, stated = _coloured(points, spectra, weights, grey, error=error)
        mirrored = _mixed(dirac(), weights, grey) if specular else None
        return Values(self, points, output, light, brdf, stated, mirrored)


def surface_of(table: Table, kind: str = "table") -> LookupSubject:
    """Return a table, or the "model" that it was made of; ParameterError if it keeps none."""
    if kind == "table":
        return LookupSubject(table, "table", table.wavelength_nm)
    if not isinstance(table.source, Material):
        raise ParameterError("from", f"the table of {table.name} keeps no model; ask for from=table", kind)
    return LookupSubject(_InRange(table.source, table), "model", table.wavelength_nm)


class _InRange(NamedTuple):
    """A material at the wavelengths that a table covers."""

    material: Material
    table: Table

    def lookup(self, *given: Any) -> Any:
        self.table.specular_reflectance(0.0, given[-1])  # refuses wavelengths outside the table
        return self.material.lookup(*given)

    def specular_reflectance(self, theta_i: Any, wavelength_nm: Any) -> Any:
        return self.material.specular_reflectance(theta_i, wavelength_nm)


def _coloured(
    points: LookupPoints,
    spectra: Callable[[Angles], _Values],
    weights: NDArray[np.float64],
    grey: bool,
    *,
    error: bool,
) -> _Values:
    """Return colours of spectra, in batches of points: 41 values of each of a million points would be 300 MB."""
    flat = [np.broadcast_to(angle, points.shape).reshape(-1) for angle in points.angles]
    brdf = np.empty((points.count, 3))
    stated = np.empty((points.count, 3)) if error else None
    for start in range(0, points.count, _AT_ONCE):
        rows = slice(start, start + _AT_ONCE)
        t_i, p_i, t_r, p_r = (angle[rows] for angle in flat)
        spectrum, errors = spectra((t_i, p_i, t_r, p_r))
        brdf[rows] = _mixed(spectrum, weights, grey)
        if stated is not None:
            stated[rows] = _mixed(errors, np.abs(weights), grey)
    shape = (*points.shape, 3)
    return _Values(brdf.reshape(shape), None if stated is None else stated.reshape(shape))


def _mixed(values: Any, weights: NDArray[np.float64], grey: bool) -> Any:
    """Return colours (..., 3) of spectra (..., L), or of grey values (...)."""
    whole = np.asarray(values)
    return np.asarray((whole[..., np.newaxis] if grey else whole) @ weights)


class LobeDirections(NamedTuple):
    """The axes of a view [degree] in the order of those of its points, and theta_i, phi_i, theta_r, phi_r [rad].

    The angles broadcast to one point for each combination of the axes.
    """

    axes_deg: dict[str, Array]
    angles: Angles


def view_directions(
    view: ViewName, theta_i_deg: float, phi_i_deg: float, glints: Glints | None = None
) -> LobeDirections:
    """Return the directions of a view of a lobe, closer together around the mirror direction, and in glints.

    Parameters
    ----------
    view : str
        "cut" is the plane of incidence over theta_r, negative back towards the light. "hemisphere" is all viewers over
        theta_r and delta_phi. "half-difference" is theta_h and theta_d with phi_d = 90 degrees.
    theta_i_deg, phi_i_deg : float [degree]
        The light, theta_i in [0, 90]. Of half-difference phi_i is phi_h, and theta_i is not used.
    """
    light = radians(theta_i_deg)
    turned = radians(phi_i_deg)
    if view == "half-difference":
        points = directions_from_half_difference(radians(_HALF)[:, np.newaxis], turned, radians(_HALF), radians(90.0))
        return LobeDirections({"theta_h": _HALF, "theta_d": _HALF}, points)
    lit = np.empty(0) if glints is None else glints.viewers_deg(theta_i_deg, phi_i_deg)
    if view == "cut":
        signed = np.unique(np.clip(np.concatenate([_CUT, theta_i_deg + _NEAR, lit]), -90.0, 90.0))
        beyond = turned + np.where(signed > 0.0, np.pi, 0.0)
        return LobeDirections({"theta_r": signed}, (light, turned, radians(np.abs(signed)), beyond))
    theta_r = np.unique(np.clip(np.concatenate([_OVER, theta_i_deg + _NEAR]), 0.0, 90.0))
    spread = _NEAR / max(np.sin(light), 0.1)
    delta_phi = np.unique(np.clip(np.concatenate([_AROUND, 180.0 + spread]), 0.0, 360.0))
    axes = {"theta_r": theta_r, "delta_phi": delta_phi}
    return LobeDirections(axes, (light, turned, radians(theta_r)[:, np.newaxis], turned + radians(delta_phi)))


class StokesDocument(BaseModel):
    """Reflected light of a polarised table, for one incident Stokes vector."""

    incident: list[float] = Field(description="Stokes vector (I, Q, U, V) of the irradiance")
    reflected: list[Any] = Field(description="Stokes vector of the radiance [1/sr]: shape of brdf, then I, Q, U, V")
    specular: list[Any] = Field(
        description="of the specular part, without unit, towards phi_i + 180 degrees: shape of specular_reflectance, "
        "then I, Q, U, V"
    )
    convention: str = Field(description="meaning of Q, U and V, in words")
    basis: str = Field(description="basis of both vectors, in words")
    element_error: float | None = Field(
        description="99 of 100 of the elements m_ij / m_00 of the Mueller matrix are within it; null: not stated"
    )


def read_stokes(text: str) -> tuple[float, ...]:
    """Return the Stokes vector of a text such as 1,0.5,0,0; ParameterError if it is not one of real light."""
    try:
        numbers = tuple(float(number) for number in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != 4 or "_" in text or not np.all(np.isfinite(numbers)):
        shown = text.encode("ascii", "backslashreplace").decode()[:40]
        raise ParameterError("stokes", f"{shown!r} is not made of four finite numbers, I,Q,U,V", text)
    intensity, *others = numbers
    if not float(np.linalg.norm(others)) <= (1.0 + _ROUNDING) * intensity:
        raise ParameterError("stokes", f"sqrt(Q^2 + U^2 + V^2) exceeds I = {intensity:g}", text)
    return numbers


def stokes_document(table: Table, points: LookupPoints, incident: Sequence[float]) -> dict[str, Any]:
    """Return the fields of `StokesDocument`, with numpy arrays; ParameterError as by `Table.mueller`."""
    record = table.metadata.polarisation
    specular = stokes.reflected(table.specular_mueller(points.angles[0], points.wavelength_nm), incident)
    matrix = table.mueller(*points.angles, points.wavelength_nm)
    return {
        "incident": list(incident),
        "reflected": np.ascontiguousarray(stokes.reflected(matrix, incident)),
        "specular": np.ascontiguousarray(specular),
        "convention": stokes.CONVENTION,
        "basis": stokes.SURFACE_BASIS,
        "element_error": None if record is None else record.p99,
    }
