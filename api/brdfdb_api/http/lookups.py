"""Values of tables, models and families at the points of a request, and the answers that hold them."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import State
from starlette.responses import Response

from brdfdb.errors import ParameterError
from brdfdb_api.http.errors import RequestError
from brdfdb_api.http.middleware import points_counted
from brdfdb_api.http.queries import ANGLES, Angles, Format, Points, Values
from brdfdb_api.http.responses import Encoded, EncodedResponse, json_bytes, npy_bytes, plain

if TYPE_CHECKING:
    from brdfdb.materials import Material
    from brdfdb.tables.table import Table

T = TypeVar("T")

INLINE_VALUES = 1000  # larger lookups run in a thread, so that the event loop can serve others
INLINE_BYTES = 96 * 2**10  # larger bodies are read in a thread; 1000 points take about this many bytes
# Number of larger bodies, or larger answers, that are processed at a time
LARGE_BYTES, LARGE_VALUES, LARGE_AT_ONCE = 2**20, 100_000, 2
LIMITS = {"json": (1, 100), "npy": (100, 800)}  # points and values of one answer, as multiples of max_points
SPECTRA_OF_COLOURS = 10  # factor on the number of values where only colours are returned
_PARAMETERS = (*ANGLES, "wavelength_nm", "illuminant", "error")  # of the library, which a request calls the same
_AT_ONCE = 25_000  # points whose spectra are in memory at once while colours are computed


class Surface(NamedTuple):
    """Subject of a lookup.

    Attributes
    ----------
    source : Table, Material or other object
        It has `lookup` and `specular_reflectance`; a table has `lookup_with_error` and `extrapolated`, too.
    kind : str
        "table", "model" or "family".
    wavelength_nm : array (L,) [nm] or None
        Wavelengths that are meant where a request names none; None: grey.
    """

    source: Any
    kind: str
    wavelength_nm: NDArray[np.float64] | None

    def wavelengths(self, points: Points) -> Any:
        """Return the wavelengths [nm] of the values at some points; None if they are grey."""
        return self.wavelength_nm if points.wavelength_nm is None else points.wavelength_nm


def surface_of(table: Table, kind: str) -> Surface:
    """Return a table, or the model that it was made of; RequestError (422) if it keeps none."""
    if kind == "table":
        return Surface(table, kind, table.wavelength_nm)
    from brdfdb.materials import Material

    if not isinstance(table.source, Material):
        raise RequestError(422, f"from: the table of {table.name} keeps no model; ask for from=table", "from")
    return Surface(_InRange(table.source, table), kind, table.wavelength_nm)


class _InRange(NamedTuple):
    """A material at the wavelengths that a table covers."""

    material: Material
    table: Table

    def lookup(self, *given: Any) -> Any:
        self.table.specular_reflectance(0.0, given[-1])  # refuses wavelengths outside the table
        return self.material.lookup(*given)

    def specular_reflectance(self, theta_i: Any, wavelength_nm: Any) -> Any:
        return self.material.specular_reflectance(theta_i, wavelength_nm)


class Found(NamedTuple):
    """The result of a lookup: f_r [1/sr], its error or None, the specular part or None; colours on the last axis."""

    brdf: Any
    error: Any
    specular_reflectance: Any


def evaluate(points: Points, options: Values, surface: Surface, *, error: bool = False, specular: bool = True) -> Found:
    """Look up points, with the stated `error`, and with the `specular` part at their theta_i.

    Raises RequestError (422) outside the range of the surface, or where it makes no colour.
    """
    source = surface.source
    # A table takes None as all of its wavelengths, which is faster than naming them
    at = points.wavelength_nm if surface.kind == "table" else surface.wavelengths(points)

    def spectra(angles: Angles) -> tuple[Any, Any]:
        return source.lookup_with_error(*angles, at) if error else (source.lookup(*angles, at), None)

    try:
        if options.output != "spectrum":
            return _coloured(points, options, surface, spectra, error=error, specular=specular)
        return Found(*spectra(points.angles), source.specular_reflectance(points.angles[0], at) if specular else None)
    except ParameterError as error:
        if error.parameter not in _PARAMETERS:
            raise
        raise RequestError(422, str(error), error.parameter) from error


@contextlib.contextmanager
def refused() -> Iterator[None]:
    """Turn errors about the parameters of a request into refusals (422)."""
    try:
        yield
    except ParameterError as error:
        raise RequestError(422, str(error), error.parameter) from error


def _coloured(
    points: Points,
    options: Values,
    surface: Surface,
    spectra: Callable[[Angles], tuple[Any, Any]],
    *,
    error: bool,
    specular: bool,
) -> Found:
    """Return colours of spectra, in batches of points: 41 values of each of a million points would be 300 MB."""
    from brdfdb.spectra import colour_weights

    assert options.output != "spectrum"
    wavelengths, grey = surface.wavelengths(points), surface.wavelength_nm is None
    if grey and points.wavelength_nm is not None:
        raise RequestError(422, "wavelength_nm: a colour of a grey material has no wavelengths", "wavelength_nm")
    of = colour_weights(options.output, None if grey else np.atleast_1d(wavelengths), options.illuminant or "D65")
    flat = [np.broadcast_to(angle, points.shape).reshape(-1) for angle in points.angles]
    brdf, stated = np.empty((points.count, 3)), np.empty((points.count, 3)) if error else None
    for start in range(0, points.count, _AT_ONCE):
        rows = slice(start, start + _AT_ONCE)
        t_i, p_i, t_r, p_r = (angle[rows] for angle in flat)
        spectrum, errors = spectra((t_i, p_i, t_r, p_r))
        brdf[rows] = _mixed(spectrum, of, grey)
        if stated is not None:
            stated[rows] = _mixed(errors, np.abs(of), grey)
    shape = (*points.shape, 3)
    dirac = surface.source.specular_reflectance(points.angles[0], wavelengths) if specular else None
    return Found(
        brdf.reshape(shape),
        None if stated is None else stated.reshape(shape),
        None if dirac is None else _mixed(dirac, of, grey),
    )


def _mixed(values: Any, of: NDArray[np.float64], grey: bool) -> Any:
    """Return colours (..., 3) of spectra (..., L), or of grey values (...)."""
    whole = np.asarray(values)
    return np.asarray((whole[..., np.newaxis] if grey else whole) @ of)


def checked_size(max_points: int, points: Points, options: Values, surface: Surface, kind: Format) -> int:
    """Return the number of values to look up; RequestError (413) if they are too many for one answer."""
    most_points, most_values = (factor * max_points for factor in LIMITS[kind])
    if points.count > most_points:
        hint = "; format=npy may hold more" if kind == "json" else ""
        raise RequestError(
            413, f"{points.count} points are more than the {most_points} that one {kind} answer may hold{hint}"
        )
    wavelengths = surface.wavelengths(points)
    values = points.count * (1 if wavelengths is None else int(np.size(wavelengths)))
    if options.output != "spectrum" and surface.kind == "table":
        most_values *= SPECTRA_OF_COLOURS
    if values > most_values:
        raise RequestError(413, f"{values} values are more than the {most_values} that one {kind} answer may be of")
    return values


async def answered(
    state: State, surface: Surface, options: Values, kind: Format, size: int, read: Callable[[], Points], write: Any
) -> Response:
    """Read the points of a body of `size` bytes and write their values: in a thread if they are many."""

    def checked() -> tuple[Points, int]:
        points = read()
        return points, checked_size(state.settings.max_points, points, options, surface, kind)

    if size > INLINE_BYTES:
        async with state.large if size > LARGE_BYTES else contextlib.nullcontext():
            return await run_in_threadpool(lambda: write(checked()[0]))
    points, values = checked()
    # a row and a column of angles take few bytes and make many points
    async with state.large if values > LARGE_VALUES else contextlib.nullcontext():
        # a thread costs about as long as 1000 values do
        slow = values > INLINE_VALUES or surface.kind != "table" or options.output != "spectrum"
        return await run_in_threadpool(write, points) if slow else write(points)


def write_answer(
    points: Points, options: Values, surface: Surface, kind: Format, headers: Encoded, about: dict[str, Any]
) -> Response:
    """Look the points up and write them as `kind`; `about` begins the document."""
    error = getattr(options, "error", False)
    values = evaluate(points, options, surface, error=error, specular=kind == "json")
    points_counted(surface.kind, points.count)
    if kind == "npy":
        content = npy_bytes(values.brdf if values.error is None else np.stack([values.brdf, values.error]))
        return EncodedResponse(content, headers)
    return EncodedResponse(json_bytes(document_of(points, options, surface, values, about)), headers)


def document_of(
    points: Points, options: Values, surface: Surface, values: Found, about: dict[str, Any]
) -> dict[str, Any]:
    """Return the document of an answer, which begins with `about`."""
    stated, of_table = values.error is not None, surface.kind == "table"
    return {
        **about,
        "source": surface.kind,
        **options.document(),
        "wavelength_nm": surface.wavelengths(points),
        "brdf": plain(values.brdf),
        "error": plain(values.error) if stated else None,
        "extrapolated": plain(surface.source.extrapolated(*points.angles)) if stated and of_table else None,
        "specular_reflectance": plain(values.specular_reflectance),
    }
