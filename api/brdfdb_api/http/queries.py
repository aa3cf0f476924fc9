"""Contents of requests: typed parameters of queries, and points from JSON and .npy, in degrees and checked."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Collection, Sequence
from typing import Annotated, Any, Literal, NamedTuple, TypeVar
from urllib.parse import parse_qsl

import numpy as np
import orjson
from fastapi.exceptions import RequestValidationError
from numpy.typing import NDArray
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    Strict,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    field_validator,
)

from brdfdb.geometry import radians
from brdfdb.tables.lobe_views import View
from brdfdb_api.http.errors import RequestError
from brdfdb_api.http.responses import JSON, NPY

ANGLES = ("theta_i", "phi_i", "theta_r", "phi_r")
JSON_BYTES = 8 * 2**20  # limit on a JSON body [byte]: numbers in lists take twenty times the memory of the text

Format = Literal["json", "npy"]
Angles = tuple[Any, Any, Any, Any]  # theta_i, phi_i, theta_r, phi_r [rad]
M = TypeVar("M", bound=BaseModel)

_TURN = 360.0  # degrees; fmod is exact, while radians have no digits left at 1e15
_MOST_AXES = 32  # axes that numpy broadcasts
_HEADER_BYTES = 4096  # limit on the header of a .npy file, which usually takes a hundred


def _digits(value: object) -> object:
    if isinstance(value, str) and "_" in value:  # which Python reads as a number
        raise ValueError(f"{shortened(value)!r} is not a finite number")
    return value


Finite = Annotated[float, Field(allow_inf_nan=False), BeforeValidator(_digits)]
Polar = Annotated[float, Field(ge=0.0, le=180.0), BeforeValidator(_digits)]
Flag = Annotated[bool, BeforeValidator(lambda text: {"true": True, "false": False}.get(text, text)), Strict()]
Wavelengths = Annotated[tuple[Finite, ...], Field(description="wavelength [nm], repeatable; missing: all of the table")]


class Query(BaseModel):
    """The parameters of a query; others are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Values(Query):
    """Form of values: a spectrum or a colour, as JSON or .npy."""

    output: Literal["spectrum", "xyz", "linear-srgb"] = Field(
        default="spectrum", description="colours are in 1/sr like f_r: white is Y = 1/pi"
    )
    illuminant: str | None = Field(
        default=None, description="of a colour: a name of colour-science, such as A or FL2; missing: D65"
    )
    format: Format | None = Field(
        default=None, description=f"missing: npy if the Accept header names {NPY}, or of a .npy body does not name JSON"
    )

    @field_validator("illuminant")
    @classmethod
    def _of_a_colour(cls, name: str | None, info: ValidationInfo) -> str | None:
        if info.data.get("output") == "spectrum":
            raise ValueError("a spectrum has none; output may be xyz or linear-srgb")
        return name

    def kind(self, accept: str, *, binary: bool = False) -> Format:
        """Return the format of the answer to a request with this Accept header, and a body that is .npy or not."""
        return self.format or ("npy" if NPY in accept or (binary and JSON not in accept) else "json")

    def document(self) -> dict[str, Any]:
        """Return what an answer repeats of these options."""
        illuminant = None if self.output == "spectrum" else self.illuminant or "D65"
        return {"unit": "1/sr", "output": self.output, "illuminant": illuminant}


class OfTable(Values):
    """Form of values of a table, or of the model that it was made of."""

    source: Literal["table", "model"] = Field(
        default="table", alias="from", description="the table, or the model that it was made of"
    )


class Stated(OfTable):
    """Form of values of a table, with the errors that it states."""

    error: Flag = Field(
        default=False, description="the error that the table states beside the values; npy then has a first axis for it"
    )

    @field_validator("error")
    @classmethod
    def _of_the_table(cls, error: bool, info: ValidationInfo) -> bool:
        if error and info.data.get("source") == "model":
            raise ValueError("the model has none; it is the table that states one")
        return error


class BodyQuery(Stated):
    """The query of a lookup whose points are in the body."""

    wavelength_nm: Wavelengths = Field(default=(), description="wavelength [nm] of a .npy body; JSON holds its own")


class ManyQuery(Stated):
    """The query of a lookup of many materials."""

    format: Literal["json", "npz"] = Field(
        default="json", description="npz holds an array a material, by its name, and NAME.error"
    )  # type: ignore[assignment]


class PointQuery(Stated):
    """The query of a lookup of one point."""

    wavelength_nm: Wavelengths = ()
    theta_i: Polar = Field(description="polar angle of the light [degrees]")
    phi_i: Finite = Field(default=0.0, description="azimuth of the light [degrees], any finite number")
    theta_r: Polar = Field(description="polar angle of the viewer [degrees]")
    phi_r: Finite = Field(default=0.0, description="azimuth of the viewer [degrees]; phi_r - phi_i = 180 is the mirror")

    @property
    def points(self) -> Points:
        """The point."""
        t_i, p_i, t_r, p_r = (
            math.radians(math.fmod(angle, _TURN)) for angle in (self.theta_i, self.phi_i, self.theta_r, self.phi_r)
        )
        return Points((t_i, p_i, t_r, p_r), (), listed(self.wavelength_nm))


class Light(Query):
    """The direction of one light, and the viewers that are looked at."""

    view: View = Field(default="cut", description="the plane of incidence, all viewers, or theta_h and theta_d")
    theta_i: Finite = Field(default=45.0, ge=0.0, le=90.0, description="polar angle of the light [degrees]")
    phi_i: Finite = Field(default=0.0, ge=-720.0, le=720.0, description="azimuth of the light [degrees]")
    wavelength_nm: Wavelengths = ()


class LobeQuery(Light, OfTable):
    """The query of a lobe of a table."""


class Points(NamedTuple):
    """Directions and wavelengths of one lookup, checked.

    Attributes
    ----------
    angles : tuple of arrays [rad]
        theta_i, phi_i, theta_r, phi_r; they broadcast.
    shape : tuple of int
        What they broadcast to.
    wavelength_nm : float, array of shape (n,) or None
        None is every wavelength of the table.
    """

    angles: Angles
    shape: tuple[int, ...]
    wavelength_nm: float | NDArray[np.float64] | None

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


def _azimuths(value: Any) -> NDArray[Any]:
    """Return azimuths [rad]."""
    degrees = value if isinstance(value, np.ndarray) else _numbers(value)
    if not np.all(finite := np.isfinite(degrees)):
        raise ValueError(f"{degrees[~finite].flat[0]} is not a finite number")
    return radians(np.fmod(degrees, _TURN))


def _wavelengths(value: Any) -> float | NDArray[np.float64] | None:
    if value is None or isinstance(value, np.ndarray):
        return value
    array = _numbers(value)
    if array.ndim > 1:
        raise ValueError("not a number or a flat list of numbers")
    return array if array.ndim else array.item()


_NUMBERS = {"anyOf": [{"type": "number"}, {"type": "array", "items": {}}]}
_OF_LIGHT = {"anyOf": [{"type": "number"}, {"type": "array", "items": {"type": "number"}, "minItems": 1}]}
_Polars = Annotated[Any, PlainValidator(_polars), WithJsonSchema(_NUMBERS)]
_Azimuths = Annotated[Any, PlainValidator(_azimuths), WithJsonSchema(_NUMBERS)]


class PointsBody(BaseModel):
    """Angles in degrees: numbers or nested lists of numbers that broadcast as numpy arrays do."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"example": {"theta_i": 45, "theta_r": [0, 30, 60], "phi_r": 180}}
    )

    theta_i: _Polars = Field(description="polar angle of the light [degrees], 0 to 180")
    phi_i: _Azimuths = Field(default=0.0, validate_default=True, description="azimuth of the light [degrees]")
    theta_r: _Polars = Field(description="polar angle of the viewer [degrees], 0 to 180")
    phi_r: _Azimuths = Field(default=0.0, validate_default=True, description="azimuth of the viewer [degrees]")
    wavelength_nm: Annotated[
        Any, PlainValidator(_wavelengths), WithJsonSchema({"anyOf": [*_OF_LIGHT["anyOf"], {"type": "null"}]})
    ] = Field(default=None, description="wavelengths [nm]; missing or null: every wavelength of the table")

    @property
    def points(self) -> Points:
        """The points; RequestError (422) if the angles do not broadcast."""
        angles = (self.theta_i, self.phi_i, self.theta_r, self.phi_r)
        try:
            shape = np.broadcast_shapes(*(angle.shape for angle in angles))
        except ValueError:
            shapes = ", ".join(f"{name} {angle.shape}" for name, angle in zip(ANGLES, angles, strict=True))
            raise RequestError(422, f"the shapes of the angles do not broadcast: {shapes}") from None
        return Points(angles, shape, self.wavelength_nm)


class ManyBody(PointsBody):
    """Points that are looked up in several materials."""

    model_config = ConfigDict(
        json_schema_extra={"example": {"materials": ["rolled-brass", "foam"], "theta_i": 45, "theta_r": [0, 30, 60]}}
    )

    materials: list[str] = Field(min_length=1, max_length=1000, description="names, each once")


def from_json(model: type[M], body: bytes) -> M:
    """Return a JSON body as a model; RequestError (422, 413) if it is none: of the body it repeats names and numbers.

    NaN and Infinity, which some clients write, are not JSON. They are read to name the parameter.
    """
    if len(body) > JSON_BYTES:
        raise RequestError(413, f"a JSON body may have {JSON_BYTES} bytes; send as many points as {NPY}")
    try:
        fields = orjson.loads(body)
    except orjson.JSONDecodeError:
        try:
            fields = json.loads(body)
        except (ValueError, RecursionError):
            raise RequestError(422, "the body is not JSON") from None
    if not isinstance(fields, dict):
        raise RequestError(422, f"the body is not a JSON object with {', '.join(model.model_fields)}")
    return checked(model, fields, "body")


def checked(model: type[M], fields: dict[str, Any], where: str) -> M:
    """Return fields as a model; a refusal (422) names the first that is unknown, missing or not allowed."""
    try:
        return model.model_validate(fields)
    except ValidationError as error:
        for name in fields:
            if name not in (names := names_of(model)):
                raise unknown(name, names) from None
        first = error.errors(include_url=False)[0]
        raise RequestValidationError([{**first, "loc": (where, *first["loc"])}]) from None


def from_npy(body: bytes, wavelengths: Sequence[float]) -> Points:
    """Read a .npy body: float32 or float64 of shape (..., 4), the angles theta_i, phi_i, theta_r, phi_r [degrees].

    Raises
    ------
    RequestError
        422, naming the parameter; for any other array.
    """
    degrees = _npy(body)
    if degrees.ndim == 0 or degrees.shape[-1] != 4:
        raise RequestError(422, f"the body: its shape {degrees.shape} is not (..., 4): {', '.join(ANGLES)}")
    if degrees.ndim > _MOST_AXES + 1:
        raise RequestError(422, f"the body: {degrees.ndim} axes; at most {_MOST_AXES + 1} are allowed")
    if degrees.size == 0:
        raise RequestError(422, "the body: an empty array")
    fields = {name: np.asarray(degrees[..., column]) for column, name in enumerate(ANGLES)}
    return checked(PointsBody, {**fields, "wavelength_nm": listed(wavelengths)}, "body").points


def _npy(body: bytes) -> NDArray[Any]:
    """Return the float32 or float64 array of a .npy file; the length of the body must agree with its header."""
    stream = io.BytesIO(body)
    try:
        version = np.lib.format.read_magic(stream)
        read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[version]
        shape, by_columns, dtype = read(stream, max_header_size=_HEADER_BYTES)
    except Exception:  # the header is Python text, and reading it raises errors of many kinds
        raise RequestError(422, "the body is not a .npy file") from None
    if dtype not in (np.dtype("<f4"), np.dtype("<f8")):
        raise RequestError(422, f"the body: {shortened(str(dtype))} is not float32 or float64, little endian")
    data = memoryview(body)[stream.tell() :]
    if math.prod(shape) * dtype.itemsize != len(data) or any(size < 0 for size in shape):
        raise RequestError(422, "the body is shorter or longer than its .npy header says")
    return np.frombuffer(data, dtype).reshape(shape, order="F" if by_columns else "C")


def parsed(query: bytes, allowed: Collection[str]) -> dict[str, Any]:
    """Return the values of a query string by name, of wavelength_nm, which may be repeated, as a list.

    Raises
    ------
    RequestError
        422, for a name that is not allowed, or one that is given twice.
    """
    text = query.decode("latin-1")
    if "%" in text or "+" in text:
        pairs = parse_qsl(text, keep_blank_values=True)
    else:
        pairs = [(name, value) for name, _, value in (part.partition("=") for part in text.split("&") if part)]
    fields: dict[str, Any] = {}
    for name, value in pairs:
        if name not in allowed:
            raise unknown(name, allowed)
        if name == "wavelength_nm":
            fields.setdefault(name, []).append(value)
        elif name in fields:
            raise RequestError(422, f"{name}: given more than once", name)
        else:
            fields[name] = value
    return fields


def names_of(kind: type) -> tuple[str, ...]:
    """Return the names that the parameters of a query have."""
    fields = kind.model_fields if issubclass(kind, BaseModel) else {}
    return tuple(field.alias or name for name, field in fields.items())


def unknown(name: str, allowed: Collection[str]) -> RequestError:
    """Return the refusal (422) of a parameter that is not one of `allowed`: a misspelt one is never ignored."""
    shown = shortened(name)
    return RequestError(422, f"{shown}: unknown parameter; allowed are {', '.join(allowed) or 'none'}", shown)


def shortened(text: str) -> str:
    """Return a text of the client for a sentence: at most 40 characters, control characters escaped."""
    return text.encode("ascii", "backslashreplace").decode()[:40]
