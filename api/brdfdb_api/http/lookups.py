"""Values of tables, models and families at the points of a request, and the answers that hold them."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import State
from starlette.responses import Response

from brdfdb.errors import ParameterError
from brdfdb.tables.evaluation import Surface, Values, surface_of
from brdfdb.tables.points import ANGLES, Points
from brdfdb.tables.table import Table
from brdfdb.tables.values_document import values_document
from brdfdb_api.http.errors import RequestError
from brdfdb_api.http.middleware import points_counted
from brdfdb_api.http.queries import Format, OfTable, Options
from brdfdb_api.http.responses import Encoded, EncodedResponse, json_bytes, npy_bytes, tag_of

INLINE_VALUES = 1000  # larger lookups run in a thread, so that the event loop can serve others
INLINE_BYTES = 96 * 2**10  # larger bodies are read in a thread; 1000 points take about this many bytes
# Number of larger bodies, or larger answers, that are processed at a time
LARGE_BYTES, LARGE_VALUES, LARGE_AT_ONCE = 2**20, 100_000, 8
LIMITS = {"json": (1, 100), "npy": (100, 1000)}  # points and values of one answer, as multiples of max_points
SPECTRA_OF_COLOURS = 10  # factor on the number of values where only colours are returned
_PARAMETERS = (*ANGLES, "wavelength_nm", "illuminant", "error")  # of the library, which a request calls the same


@contextlib.contextmanager
def refused() -> Iterator[None]:
    """Turn errors about the parameters of a request into refusals (422)."""
    try:
        yield
    except ParameterError as error:
        raise RequestError(422, str(error), error.parameter) from error


def surface_in(table: Table, options: OfTable) -> Surface:
    """Return a table, or the model that it was made of; RequestError (422) if it keeps none."""
    if options.source == "table":
        return surface_of(table)
    with refused():
        return surface_of(table, options.source)


def tag_in(table: Table, surface: Surface) -> str:
    """Return the ETag of values of a table, or of its model, whose version it names then."""
    return tag_of(table, surface.source.material.spec.version) if surface.kind == "model" else tag_of(table)


def evaluate(points: Points, options: Options, surface: Surface, *, specular: bool = True) -> Values:
    """Look up points; RequestError (422) outside the range of the surface, or where it makes no colour."""
    stated = getattr(options, "error", False)
    try:
        return surface.values(points, options.output, options.illuminant, error=stated, specular=specular)
    except ParameterError as error:
        if error.parameter not in _PARAMETERS:
            raise
        raise RequestError(422, str(error), error.parameter) from error


def checked_size(max_points: int, points: Points, options: Options, surface: Surface, kind: Format) -> int:
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
    state: State, surface: Surface, options: Options, kind: Format, size: int, read: Callable[[], Points], write: Any
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
    points: Points, options: Options, surface: Surface, kind: Format, headers: Encoded, about: dict[str, Any]
) -> Response:
    """Look the points up and write them as `kind`; `about` begins the document."""
    values = evaluate(points, options, surface, specular=kind == "json")
    points_counted(surface.kind, points.count)
    if kind == "npy":
        content = npy_bytes(values.brdf if values.error is None else np.stack([values.brdf, values.error]))
        return EncodedResponse(content, headers)
    return EncodedResponse(json_bytes(about | values_document(values)), headers)
