"""Values of tables, models and families at the points of a request, and the lookup addresses of tables."""

from __future__ import annotations

import asyncio
import contextlib
import io
from collections.abc import AsyncIterator, Callable
from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np
from fastapi import Depends
from fastapi import Query as InQuery
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import State
from starlette.requests import Request
from starlette.responses import Response

from brdfdb.errors import ParameterError
from brdfdb.store.paths import pinned
from brdfdb.store.shelf import Shelf
from brdfdb.tables.evaluation import ANGLES, LookupPoints, LookupSubject, PointsBody, Values, surface_of
from brdfdb.tables.table import Table
from brdfdb.tables.values_document import Lookup, TableLookups, arrays_of, npy_bytes, of_table, values_document
from brdfdb_api.http import queries, responses
from brdfdb_api.http.addresses import (
    NPY_ANSWER,
    Content,
    Quick,
    Revision,
    addresses,
    answers,
    body,
    both,
    is_pinned,
    shelf_of,
)
from brdfdb_api.http.errors import RequestError, refused
from brdfdb_api.http.middleware import POINTS

T = TypeVar("T")

INLINE_VALUES = 1000  # larger lookups run in a thread, so that the event loop can serve others
INLINE_BYTES = 96 * 2**10  # larger bodies are read in a thread; 1000 points take about this many bytes
LARGE_BYTES = 2**20  # size of bodies above which they wait for a turn
LARGE_VALUES = 100_000  # number of values above which answers wait for a turn
LARGE_AT_ONCE = 2  # number of turns that run together
TURN_S = 10.0  # longest wait for a turn [s]
LIMITS = {"json": (1, 100), "npy": (100, 400)}  # points and values of one answer, as multiples of max_points
MATRIX = 16  # elements of a Mueller matrix, which a Stokes vector needs
SPECTRA_OF_COLOURS = 10  # factor on the allowed number of values if only colours are returned
# Parameters with the same name in the library and in requests
_PARAMETERS = (*ANGLES, "wavelength_nm", *queries.TableOptions.model_fields)
NPZ = "application/x-npz"

lookups = addresses()


class RequestedPoints(NamedTuple):
    """The surface and the points of a request, and the fields that begin its document."""

    surface: LookupSubject
    points: LookupPoints
    about: dict[str, Any]


@contextlib.asynccontextmanager
async def turn(turns: asyncio.Semaphore) -> AsyncIterator[None]:
    """Wait until fewer large requests run; RequestError (503) after `TURN_S`."""
    try:
        async with asyncio.timeout(TURN_S):
            await turns.acquire()
    except TimeoutError:
        detail = "the service is busy with other large requests; try again later"
        raise RequestError(503, detail, retry_after_s=round(TURN_S)) from None
    try:
        yield
    finally:
        turns.release()


async def _large(request: Request) -> AsyncIterator[None]:
    async with turn(request.app.state.large):
        yield


LARGE = Depends(_large)  # for endpoints that need much memory or time


async def in_thread(state: State, work: Callable[[], T], *, large: bool) -> T:
    """Run work in a thread and return its result; large work waits for a turn."""
    async with turn(state.large) if large else contextlib.nullcontext():
        return await run_in_threadpool(work)


def surface_in(table: Table, query: queries.TableOptions) -> LookupSubject:
    """Return a table, or the model that it was made from; RequestError (422) if the table has no model."""
    if query.source == "table":
        return surface_of(table)
    with refused():
        return surface_of(table, query.source)


def tag_in(table: Table, surface: LookupSubject) -> str:
    """Return the ETag of values of a table, or of its model, with the version of the model."""
    if surface.kind == "table":
        return responses.tag_of(table)
    return responses.tag_of(table, surface.source.material.spec.version)


def evaluate(points: LookupPoints, query: queries.Options, surface: LookupSubject, *, specular: bool = True) -> Values:
    """Look up points; RequestError (422) outside the range of the surface, or if it has no colour."""
    error = getattr(query, "error", False)  # not a parameter of models
    incident = getattr(query, "stokes", None)  # not a parameter of models
    try:
        return surface.values(points, query.output, query.illuminant, error=error, specular=specular, incident=incident)
    except ParameterError as wrong:
        if surface.kind == "table" and wrong.parameter not in _PARAMETERS:
            raise
        raise RequestError(422, str(wrong), wrong.parameter) from wrong


def checked_size(
    max_points: int, points: LookupPoints, query: queries.Options, surface: LookupSubject, kind: queries.Format
) -> int:
    """Return the number of values to look up; RequestError (413) if it is too large for one answer."""
    most_points, most_values = (factor * max_points for factor in LIMITS[kind])
    if points.count > most_points:
        hint = "; ask for format=npy" if kind == "json" else ""
        raise RequestError(413, f"{points.count} points are more than the {most_points} of a {kind} answer{hint}")
    wavelengths = surface.wavelengths(points)
    values = points.count * (1 if wavelengths is None else int(np.size(wavelengths)))
    values *= 1 if getattr(query, "stokes", None) is None else MATRIX
    if query.output != "spectrum" and surface.kind == "table":
        most_values *= SPECTRA_OF_COLOURS
    if values > most_values:
        raise RequestError(413, f"{values} values are more than the {most_values} for a {kind} answer")
    return values


async def looked_up(
    request: Request,
    query: queries.Options,
    size: int,
    read: Callable[[], RequestedPoints],
    *,
    binary: bool = False,
    quick: bool = False,
) -> Response:
    """Read a body of `size` bytes, in a thread unless it is `quick`, and answer with the values at its points."""
    state = request.app.state
    kind = query.kind(queries.accept_of(request), binary=binary)
    requested = read() if quick else await in_thread(state, read, large=size > LARGE_BYTES)
    headers = responses.value_headers(kind, None, requested.about.get("revision"), requested.about.get("digest"))
    return await answered(state, requested, query, kind, headers)


async def answered(
    state: State, requested: RequestedPoints, query: queries.Options, kind: queries.Format, headers: responses.Encoded
) -> Response:
    """Answer with the values at points as `kind`, in a thread unless they are few."""
    surface, points, about = requested
    count = checked_size(state.settings.max_points, points, query, surface, kind)

    def write() -> Response:
        POINTS.labels(surface.kind).inc(points.count)
        values = evaluate(points, query, surface, specular=kind == "json")
        if kind == "npy":
            return responses.ValuesResponse(npy_bytes(values.array), headers)
        return responses.ValuesResponse(responses.json_bytes(about | values_document(values)), headers)

    if count <= INLINE_VALUES and surface.kind == "table" and query.output == "spectrum":
        return write()
    # A row and a column of angles are few bytes and many points
    return await in_thread(state, write, large=count > LARGE_VALUES)


_OF_POINTS = queries.names_of(queries.PointQuery)


@both(
    lookups,
    "/lookup",
    tags=["lookup"],
    responses=answers(Lookup, 304, 404, 413, 503, media=NPY_ANSWER, headers=(responses.REVISION, responses.DIGEST)),
    route_class_override=Quick,
)
async def lookup_point(
    request: Request,
    name: str,
    query: Annotated[queries.PointQuery, InQuery()],  # for the OpenAPI document only
    revision: Revision = None,
) -> Response:
    """Return the BRDF at one pair of directions (angles in degrees).

    The BRDF has an axis of wavelengths, unless wavelength_nm is one number or the material is grey. Below the horizon
    (theta above 90 degrees) it is 0.
    """
    scope = request.scope
    query = queries.checked(queries.PointQuery, queries.parsed(scope["query_string"], _OF_POINTS))
    accept = if_none_match = ""
    for key, value in scope["headers"]:
        if key == b"accept":
            accept += f",{value.decode('latin-1')}"  # the header may come in several lines
        elif key == b"if-none-match":
            if_none_match = value.decode("latin-1")
    state = scope["app"].state
    kind = query.kind(accept)
    table = await _table(state.shelf, name, revision)
    surface = surface_in(table, query)
    computed = query.source == "model" or query.output != "spectrum" or query.stokes is not None
    immutable = is_pinned(revision) and not computed
    headers = responses.value_headers(kind, tag_in(table, surface), table.revision, table.digest, immutable=immutable)
    requested = RequestedPoints(surface, query.points, of_table(table))
    answer = await answered(state, requested, query, kind, headers)
    return responses.unchanged(answer, if_none_match) if if_none_match else answer


async def _table(shelf: Shelf, name: str, revision: str | None) -> Table:
    """Return a table that is in memory, or decode it in a thread."""
    table = shelf.held(name)
    if table is not None and (revision is None or revision in (table.revision, pinned(table.revision, table.digest))):
        return table
    return await run_in_threadpool(shelf.table, name, revision)


@both(
    lookups,
    "/lookup",
    method="POST",
    tags=["lookup"],
    responses=answers(Lookup, 404, 413, 415, 503, media=NPY_ANSWER, headers=(responses.REVISION, responses.DIGEST)),
    openapi_extra=body(PointsBody, npy=True),
)
async def lookup_points(
    request: Request, name: str, query: Annotated[queries.BodyQuery, InQuery()], revision: Revision = None
) -> Response:
    """Return the BRDF at many pairs of directions (angles in degrees), in the shape to which the angles broadcast.

    Wavelengths are the last axis, unless wavelength_nm is one number or the material is grey. Below the horizon (theta
    above 90 degrees) the BRDF is 0. A body of any media type except .npy is read as JSON.
    """
    binary = request.headers.get("content-type", "").partition(";")[0].strip().lower() == responses.NPY
    if query.wavelength_nm and not binary:
        raise RequestError(422, "wavelength_nm: must be in the JSON body, not in the query", "wavelength_nm")
    table = await _table(shelf_of(request), name, revision)
    surface = surface_in(table, query)
    content = await request.body()
    about = of_table(table)

    def read() -> RequestedPoints:
        if binary:
            points = queries.from_array(content, query.wavelength_nm)
        else:
            points = queries.from_json(PointsBody, content).points
        return RequestedPoints(surface, points, about)

    quick = len(content) <= INLINE_BYTES
    return await looked_up(request, query, len(content), read, binary=binary, quick=quick)


@lookups.post(
    "/v1/lookup",
    tags=["lookup"],
    responses=answers(TableLookups, 404, 413, 415, 503, media={NPZ: "one array per material, by name"}),
    openapi_extra=body(queries.ManyBody),
    dependencies=[LARGE],
)
def lookup_many(request: Request, query: Annotated[queries.ManyQuery, InQuery()], content: Content) -> Response:
    """Return the BRDF of several materials at the same pairs of directions (angles in degrees)."""
    given = queries.from_json(queries.ManyBody, content)
    shelf = shelf_of(request)
    points = given.points
    kind: queries.Format = "npy" if query.format == "npz" else "json"
    max_points = request.app.state.settings.max_points
    total = 0
    results = {}
    for name in given.materials:
        table = shelf.table(name)
        surface = surface_in(table, query)
        total += checked_size(max_points, points, query, surface, kind)
        if total > (most := LIMITS[kind][1] * max_points):
            raise RequestError(413, f"the values of all materials are more than the {most} of a {kind} answer")
        results[name] = table, evaluate(points, query, surface)
    if kind == "npy":
        data = io.BytesIO()
        arrays: dict[str, Any] = arrays_of({name: values for name, (_, values) in results.items()})
        np.savez(data, **arrays)
        return Response(data.getvalue(), media_type=NPZ, headers=responses.NO_STORE)
    documents = [of_table(table) | values_document(values) for table, values in results.values()]
    return responses.ValuesResponse(responses.json_bytes({"materials": documents}), responses.value_headers("json"))
