"""Points of a lookup, as JSON and .npy hold them: angles in degrees, checked, and wavelengths."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, PlainValidator, ValidationInfo, WithJsonSchema, model_validator

from brdfdb.errors import ParameterError
from brdfdb.geometry import check_azimuth_deg, radians
from brdfdb.parameters import check_nanometres

ANGLES = ("theta_i", "phi_i", "theta_r", "phi_r")
Angles = tuple[Any, Any, Any, Any]  # theta_i, phi_i, theta_r, phi_r [rad]
TURN = 360.0  # degrees; fmod is exact

_MOST_AXES = 32  # axes that numpy broadcasts
_HEADER_BYTES = 4096  # limit on the header of a .npy file, which usually takes a hundred
_SHOWN = 40  # characters of the type of an array that a refusal repeats


class Points(NamedTuple):
    """Directions and wavelengths of one lookup, checked.

    Attributes
    ----------
    angles : tuple of arrays [rad]
        theta_i, phi_i, theta_r, phi_r; they broadcast.
    shape : tuple of int
        What they broadcast to.
    wavelength_nm : float, array of shape (n,) or None
        None is every wavelength of the surface.
    """

    angles: Angles
    shape: tuple[int, ...]
    wavelength_nm: float | NDArray[np.float64] | None

    @classmethod
    def of(cls, angles: Angles, wavelength_nm: float | NDArray[np.float64] | None) -> Points:
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
    def points(self) -> Points:
        """The points."""
        return Points.of(self.angles, self.wavelength_nm)


def fields_of_npy(body: bytes) -> dict[str, Any]:
    """Return the angles [degrees] of a .npy file: theta_i, phi_i, theta_r, phi_r, float32 or float64, in (..., 4).

    Raises
    ------
    ParameterError
        For any other array.
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
