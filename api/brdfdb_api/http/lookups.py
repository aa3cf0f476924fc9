"""Lookups: the points of a request, read from a query, JSON or .npy in degrees and checked, and their values."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Self, cast, get_args
from urllib.parse import parse_qsl

import numpy as np
import orjson
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import radians
from brdfdb_api.http.errors import RequestError

if TYPE_CHECKING:
    from brdfdb.materials import Material
    from brdfdb.tables.table import Table

ANGLES = ("theta_i", "phi_i", "theta_r", "phi_r")
REQUIRED = ("theta_i", "theta_r")
FIELDS = (*ANGLES, "wavelength_nm")
OPTIONS = ("from", "error", "output", "illuminant", "format")
_PARAMETERS = (*FIELDS, "illuminant", "error")  # of the library, which a request calls the same

Source = Literal["table", "model"]
Output = Literal["spectrum", "xyz", "linear-srgb"]
Format = Literal["json", "npy"]
Angles = tuple[Any, Any, Any, Any]  # theta_i, phi_i, theta_r, phi_r [rad]

_TURN = 360.0  # degrees; fmod is exact, while radians have no digits left at 1e15
_AT_ONCE = 25_000  # points whose spectra are in memory at once while colours are computed
_MOST_AXES = 32  # axes that numpy broadcasts
_HEADER_BYTES = 4096  # limit on the header of a .npy file, which usually takes a hundred


@dataclass(frozen=True)
class Options:
    """The options of a lookup.

    Attributes
    ----------
    source : str
        "table", or "model": what the table was made of.
    error : bool
        Whether to give the error that the table states beside the values.
    output : str
        "spectrum", or "xyz" or "linear-srgb" under `illuminant`, in 1/sr like f_r: white is Y = 1/pi.
    illuminant : str
        A name of colour-science.
    format : str or None
        "json" or "npy"; None leaves it to the Accept header.
    """

    source: Source = "table"
    error: bool = False
    output: Output = "spectrum"
    illuminant: str = "D65"
    format: Format | None = None

    @classmethod
    def from_query(cls, query: Mapping[str, str]) -> Self:
        """Read what a query names of `OPTIONS`; a RequestError (422) for a value that is not allowed."""
        if query.keys().isdisjoint(OPTIONS):
            return cls()
        error = _one_of(query, "error", ("false", "true"), "false") == "true"
        source = cast(Source, _one_of(query, "from", get_args(Source), "table"))
        output = cast(Output, _one_of(query, "output", get_args(Output), "spectrum"))
        if error and source == "model":
            raise RequestError(422, "error: the model has none; it is the table that states one", "error")
        if "illuminant" in query and output == "spectrum":
            raise RequestError(422, "illuminant: a spectrum has none; output may be xyz or linear-srgb", "illuminant")
        chosen = cast(Format, _one_of(query, "format", get_args(Format), "json")) if "format" in query else None
        return cls(source, error, output, query.get("illuminant", cls.illuminant), chosen)


@dataclass(frozen=True)
class Points:
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
    def count(self) -> int:
        """Return the number of points."""
        return math.prod(self.shape)

    @classmethod
    def from_query(cls, query: Mapping[str, str], wavelengths: list[str]) -> Self:
        """Return one point from the numbers of a query; errors as of `from_fields`."""
        angles = []
        for name in ANGLES:
            text = query.get(name)
            if text is None and name in REQUIRED:
                raise RequestError(422, f"{name}: missing", name)
            degrees = 0.0 if text is None else _number(name, text)
            if name in REQUIRED and not 0.0 <= degrees <= 180.0:
                raise RequestError(422, f"{name}: {degrees} is outside [0, 180] degrees", name)
            angles.append(math.radians(math.fmod(degrees, _TURN)))
        at = [_number("wavelength_nm", text) for text in wavelengths]
        wavelength_nm = None if not at else at[0] if len(at) == 1 else np.array(at)
        return cls((angles[0], angles[1], angles[2], angles[3]), (), wavelength_nm)

    @classmethod
    def from_json(cls, body: bytes) -> Self:
        """Read a JSON body.

        Raises
        ------
        RequestError
            422, with the sentence that the client reads; of the body it repeats names and single numbers at most.
        """
        try:
            fields = orjson.loads(body)
        except orjson.JSONDecodeError:
            # NaN and Infinity, which some clients write, are not JSON. They are read here to name the parameter.
            try:
                fields = json.loads(body)
            except (ValueError, RecursionError):
                raise RequestError(422, "the body is not JSON") from None
        if not isinstance(fields, dict):
            raise RequestError(422, f"the body is not a JSON object with {', '.join(FIELDS)}")
        return cls.from_fields(fields)

    @classmethod
    def from_fields(cls, fields: Mapping[str, Any]) -> Self:
        """Check numbers or nested lists of numbers: angles in degrees, wavelengths in nm.

        theta is within [0, 180] degrees, phi any finite number and 0 where it is missing; `wavelength_nm` is a finite
        number or a list of them, and missing or None for every wavelength.

        Raises
        ------
        RequestError
            422, naming the parameter.
        """
        for name in fields:
            if name not in FIELDS:
                raise unknown(name, FIELDS)
        angles = []
        for name in ANGLES:
            if name not in fields and name in REQUIRED:
                raise RequestError(422, f"{name}: missing", name)
            angles.append(_in_radians(name, _numbers(name, fields.get(name, 0.0))))
        try:
            shape = np.broadcast_shapes(*(angle.shape for angle in angles))
        except ValueError:
            shapes = ", ".join(f"{name} {angle.shape}" for name, angle in zip(ANGLES, angles, strict=True))
            raise RequestError(422, f"the shapes of the angles do not broadcast: {shapes}") from None
        return cls((angles[0], angles[1], angles[2], angles[3]), shape, _wavelengths(fields.get("wavelength_nm")))

    @classmethod
    def from_npy(cls, body: bytes, wavelengths: list[str]) -> Self:
        """Read a .npy body: float32 or float64 of shape (..., 4), the angles theta_i, phi_i, theta_r, phi_r [degrees].

        Raises
        ------
        RequestError
            422, as by `from_fields`; for any other array.
        """
        degrees = _npy(body)
        if degrees.ndim == 0 or degrees.shape[-1] != 4:
            raise RequestError(422, f"the body: its shape {degrees.shape} is not (..., 4): {', '.join(ANGLES)}")
        if degrees.ndim > _MOST_AXES + 1:
            raise RequestError(422, f"the body: {degrees.ndim} axes; at most {_MOST_AXES + 1} are allowed")
        if degrees.size == 0:
            raise RequestError(422, "the body: an empty array")
        angles = [_in_radians(name, degrees[..., column]) for column, name in enumerate(ANGLES)]
        at = [_number("wavelength_nm", text) for text in wavelengths]
        wavelength_nm = None if not at else at[0] if len(at) == 1 else np.array(at)
        return cls((angles[0], angles[1], angles[2], angles[3]), degrees.shape[:-1], wavelength_nm)

    def wavelengths(self, table: Table) -> float | NDArray[np.float64] | None:
        """Return the wavelengths [nm] of the values: those of the request, else of the table; None if it is grey."""
        return table.wavelength_nm if self.wavelength_nm is None else self.wavelength_nm

    def values(self, table: Table) -> int:
        """Return the number of values to look up: points times wavelengths."""
        wavelengths = self.wavelengths(table)
        return self.count * (wavelengths.size if isinstance(wavelengths, np.ndarray) else 1)


class Values(NamedTuple):
    """The result of a lookup: f_r [1/sr], its error or None, the specular part or None; colours on the last axis."""

    brdf: Any
    error: Any
    specular_reflectance: Any


def evaluate(points: Points, options: Options, table: Table, *, specular: bool = True) -> Values:
    """Look up points, and if `specular` the specular part at their theta_i.

    Raises RequestError (422) outside the range of the table, or where it makes no colour.
    """
    try:
        source: Table | Material = table
        at = points.wavelength_nm
        if options.source == "model":
            from brdfdb.materials import Material

            at = points.wavelengths(table)
            table.specular_reflectance(0.0, at)  # refuses wavelengths outside the table
            if not isinstance(table.source, Material):
                sentence = f"the table of {table.name} keeps no model; ask for from=table"
                raise RequestError(422, f"from: {sentence}", "from")
            source = table.source

        def spectra(angles: Angles) -> tuple[Any, Any]:
            if options.error:
                return table.lookup_with_error(*angles, at)
            return source.lookup(*angles, at), None

        if options.output != "spectrum":
            return _coloured(points, options, table, source if specular else None, spectra)
        return Values(*spectra(points.angles), source.specular_reflectance(points.angles[0], at) if specular else None)
    except ParameterError as error:
        refusal = _refusal(error)
        if refusal is None:
            raise
        raise refusal from error


def _coloured(
    points: Points,
    options: Options,
    table: Table,
    specular: Table | Material | None,
    spectra: Callable[[Angles], tuple[Any, Any]],
) -> Values:
    """Return colours of spectra, in batches of points: 41 values of each of a million points would be 300 MB."""
    from brdfdb_api.serving.colours import coloured, weights

    assert options.output != "spectrum"
    wavelengths = points.wavelengths(table)
    grey = table.wavelength_nm is None
    if grey and points.wavelength_nm is not None:
        raise RequestError(422, "wavelength_nm: a colour of a grey material has no wavelengths", "wavelength_nm")
    of = weights(options.output, None if grey else np.atleast_1d(cast(Any, wavelengths)), options.illuminant)
    flat = [np.broadcast_to(angle, points.shape).reshape(-1) for angle in points.angles]
    brdf, error = np.empty((points.count, 3)), np.empty((points.count, 3)) if options.error else None
    for start in range(0, points.count, _AT_ONCE):
        rows = slice(start, start + _AT_ONCE)
        t_i, p_i, t_r, p_r = (angle[rows] for angle in flat)
        spectrum, stated = spectra((t_i, p_i, t_r, p_r))
        brdf[rows] = coloured(spectrum, of, grey=grey)
        if error is not None:
            error[rows] = coloured(stated, np.abs(of), grey=grey)
    shape = (*points.shape, 3)
    dirac = None if specular is None else specular.specular_reflectance(points.angles[0], wavelengths)
    return Values(
        brdf.reshape(shape),
        None if error is None else error.reshape(shape),
        None if dirac is None else coloured(dirac, of, grey=grey),
    )


def _refusal(error: ParameterError) -> RequestError | None:
    """Return the answer (422) to an error about a parameter of the request; None for any other."""
    return RequestError(422, str(error), error.parameter) if error.parameter in _PARAMETERS else None


def parsed(query: bytes, allowed: tuple[str, ...]) -> tuple[dict[str, str], list[str]]:
    """Return the single values of a query string by name, and those of wavelength_nm, which may be repeated.

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
    single: dict[str, str] = {}
    wavelengths = []
    for name, value in pairs:
        if name not in allowed:
            raise unknown(name, allowed)
        if name == "wavelength_nm":
            wavelengths.append(value)
        elif name in single:
            raise RequestError(422, f"{name}: given more than once", name)
        else:
            single[name] = value
    return single, wavelengths


def unknown(name: str, allowed: tuple[str, ...]) -> RequestError:
    """Return the refusal (422) of a parameter that is not one of `allowed`: a misspelt one is never ignored."""
    shown = shortened(name)
    reason = "belongs in the query" if allowed == FIELDS and name in OPTIONS else "unknown parameter"
    return RequestError(422, f"{shown}: {reason}; allowed are {', '.join(allowed) or 'none'}", shown)


def shortened(text: str) -> str:
    """Return a text of the client for a sentence: at most 40 characters, control characters escaped."""
    return text.encode("ascii", "backslashreplace").decode()[:40]


def _one_of(query: Mapping[str, str], name: str, allowed: tuple[str, ...], default: str) -> str:
    value = query.get(name, default)
    if value not in allowed:
        raise RequestError(422, f"{name}: {shortened(value)!r} is not one of {', '.join(allowed)}", name)
    return value


def _number(name: str, text: str) -> float:
    """Return a finite number from a query."""
    try:
        value = float(text) if "_" not in text else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        hint = f"; of several, write each as {name}=NUMBER" if "," in text else ""
        raise RequestError(422, f"{name}: {shortened(text)!r} is not a finite number{hint}", name)
    return value


def _in_radians(name: str, degrees: NDArray[Any]) -> NDArray[Any]:
    """Return angles [rad] from degrees; polar angles must be within [0, 180] degrees."""
    if name.startswith("theta"):
        bad = ~((degrees >= 0.0) & (degrees <= 180.0))
        if np.any(bad):
            raise RequestError(422, f"{name}: {degrees[bad].flat[0]} is outside [0, 180] degrees", name)
    elif not np.all(finite := np.isfinite(degrees)):
        raise RequestError(422, f"{name}: {degrees[~finite].flat[0]} is not a finite number", name)
    return radians(np.fmod(degrees, _TURN))


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


def _numbers(name: str, value: Any) -> NDArray[np.float64]:
    """Return a JSON number or nested lists of numbers as a float64 array: not empty, all finite."""
    try:
        types = _types(value)
        array = np.array(value, np.float64) if types <= {int, float} else None  # numpy alone would read true as 1
    except (ValueError, RecursionError):
        raise RequestError(422, f"{name}: the lists have unequal lengths or are nested too deep", name) from None
    except OverflowError:
        array = None
    if array is None:
        raise RequestError(422, f"{name}: not a number or a list of numbers", name)
    if array.ndim > _MOST_AXES:
        raise RequestError(422, f"{name}: lists in {array.ndim} levels; at most {_MOST_AXES} are allowed", name)
    if array.size == 0:
        raise RequestError(422, f"{name}: an empty list", name)
    if not np.all(finite := np.isfinite(array)):
        raise RequestError(422, f"{name}: {array[~finite][0]} is not a finite number", name)
    return array


def _types(value: Any) -> set[type]:
    """Return the types of the leaves of nested lists."""
    if type(value) is not list:
        return {type(value)}
    types = set(map(type, value))
    return types.union(*map(_types, value)) - {list} if list in types else types


def _wavelengths(value: Any) -> float | NDArray[np.float64] | None:
    if value is None:
        return None
    array = _numbers("wavelength_nm", value)
    if array.ndim > 1:
        raise RequestError(422, "wavelength_nm: not a number or a flat list of numbers", "wavelength_nm")
    return array if array.ndim else array.item()
