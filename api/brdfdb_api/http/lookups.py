"""Lookups: values of tables, models and families at the points of a request, and the addresses of tables."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import io
from collections.abc import AsyncIterator, Callable
from typing import Annotated, Any, TypeVar

import numpy as np
from fastapi import Depends
from fastapi import Query as InQuery
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import State
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from brdfdb.errors import ParameterError
from brdfdb.store.shelf import Shelf
from brdfdb.tables.evaluation import Surface, Values, surface_of
from brdfdb.tables.points import ANGLES, Points, PointsBody
from brdfdb.tables.table import Table
from brdfdb.tables.values_document import Lookup, Lookups, values_document
from brdfdb_api.http.addresses import (
    NPY_ANSWER,
    Address,
    Content,
    Revision,
    accept_of,
    addresses,
    answers,
    body,
    both,
    shelf_of,
)
from brdfdb_api.http.errors import RequestError, refused
from brdfdb_api.http.middleware import POINTS
from brdfdb_api.http.queries import (
    BodyQuery,
    Format,
    ManyBody,
    ManyQuery,
    OfTable,
    Options,
    PointQuery,
    checked,
    from_array,
    from_json,
    names_of,
    parsed,
)
from brdfdb_api.http.responses import (
    JSON,
    NPY,
    REVISION,
    Answer,
    Encoded,
    json_bytes,
    npy_bytes,
    tag_of,
    unchanged,
    value_headers,
)

T = TypeVar("T")

INLINE_VALUES = 1000  # larger lookups run in a thread, so that the event loop can serve others
INLINE_BYTES = 96 * 2**10  # larger bodies are read in a thread; 1000 points take about this many bytes
# Number of larger bodies, or larger answers, that are processed at a time
LARGE_BYTES, LARGE_VALUES, LARGE_AT_ONCE = 2**20, 100_000, 2
TURN_S = 10.0  # longest wait for a turn [s]
LIMITS = {"json": (1, 100), "npy": (100, 800)}  # points and values of one answer, as multiples of max_points
MATRIX = 16  # elements of the Mueller matrix that a Stokes vector takes
SPECTRA_OF_COLOURS = 10  # factor on the number of values where only colours are returned
_PARAMETERS = (
    *ANGLES,
    "wavelength_nm",
    "illuminant",
    "error",
    "stokes",
)  # of the library, which a request calls the same
NPZ = "application/x-npz"
Asked = tuple[Surface, Points, dict[str, Any]]  # surface and points of a body, and what the answer says of them

lookups = addresses()


class Quick(Address):
    """GET of a lookup of one point. FastAPI describes it; to answer it, too, takes FastAPI three times as long."""

    def __init__(self, *args: Any, **keywords: Any) -> None:
        super().__init__(*args, **keywords)
        self.app = _answered


async def _answered(scope: Scope, receive: Receive, send: Send) -> None:
    answer = await point_of(scope)
    await answer(scope, receive, send)


@contextlib.asynccontextmanager
async def turn(turns: asyncio.Semaphore) -> AsyncIterator[None]:
    """Wait for a turn; RequestError (503) if none comes within `TURN_S`."""
    try:
        async with asyncio.timeout(TURN_S):
            await turns.acquire()
    except TimeoutError:
        detail = "the server does as much at once as it can; ask again later"
        raise RequestError(503, detail, retry_after_s=round(TURN_S)) from None
    try:
        yield
    finally:
        turns.release()


async def _large(request: Request) -> AsyncIterator[None]:
    async with turn(request.app.state.large):
        yield


LARGE = Depends(_large)  # of addresses that take much memory, or much time


async def in_thread(state: State, work: Callable[[], T], *, large: bool) -> T:
    """Return what work returns, done in a thread; large work waits for a turn."""
    async with turn(state.large) if large else contextlib.nullcontext():
        return await run_in_threadpool(work)


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
    error, incident = getattr(options, "error", False), getattr(options, "stokes", None)
    try:
        return surface.values(
            points, options.output, options.illuminant, error=error, specular=specular, incident=incident
        )
    except ParameterError as wrong:
        if surface.kind == "table" and wrong.parameter not in _PARAMETERS:
            raise
        raise RequestError(422, str(wrong), wrong.parameter) from wrong


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
    values *= 1 if getattr(options, "stokes", None) is None else MATRIX
    if options.output != "spectrum" and surface.kind == "table":
        most_values *= SPECTRA_OF_COLOURS
    if values > most_values:
        raise RequestError(413, f"{values} values are more than the {most_values} that one {kind} answer may be of")
    return values


async def looked_up(
    request: Request,
    options: Options,
    size: int,
    read: Callable[[], Asked],
    *,
    binary: bool = False,
    quick: bool = False,
) -> Response:
    """Answer a body of `size` bytes: read it, in a thread unless it is `quick`, and look its points up."""
    state, kind = request.app.state, options.kind(accept_of(request), binary=binary)

    def checked_too() -> tuple[Asked, int]:
        surface, points, about = read()
        return (surface, points, about), checked_size(state.settings.max_points, points, options, surface, kind)

    parts, values = checked_too() if quick else await in_thread(state, checked_too, large=size > LARGE_BYTES)
    surface, points, about = parts
    headers = value_headers(kind, None, about.get("revision"))
    if values <= INLINE_VALUES and surface.kind == "table" and options.output == "spectrum":
        return write_answer(points, options, surface, kind, headers, about)
    # a row and a column of angles take few bytes and make many points
    write = functools.partial(write_answer, points, options, surface, kind, headers, about)
    return await in_thread(state, write, large=values > LARGE_VALUES)


def write_answer(
    points: Points, options: Options, surface: Surface, kind: Format, headers: Encoded, about: dict[str, Any]
) -> Response:
    """Look the points up and write them as `kind`; `about` begins the document."""
    POINTS.labels(surface.kind).inc(points.count)
    values = evaluate(points, options, surface, specular=kind == "json")
    content = npy_bytes(values.array) if kind == "npy" else json_bytes(about | values_document(values))
    return Answer(content, headers)


@both(
    lookups,
    "/lookup",
    tags=["lookup"],
    responses=answers(Lookup, 304, 404, 413, 503, media=NPY_ANSWER, headers=(REVISION,)),
    route_class_override=Quick,
)
async def lookup_point(
    request: Request,
    name: str,  # noqa: ARG001 of the document, like those below
    query: Annotated[PointQuery, InQuery()],  # noqa: ARG001
    revision: Revision = None,  # noqa: ARG001
) -> Response:
    """Return the BRDF at one pair of directions (angles in degrees).

    The wavelengths are an axis, unless wavelength_nm is one number or the material is grey. Below the horizon (theta
    above 90 degrees) the BRDF is 0.
    """
    return await point_of(request.scope)


_OF_POINTS = names_of(PointQuery)


async def point_of(scope: Scope) -> Response:
    """Return the answer to GET of a lookup, from the query as it came."""
    name, revision = scope["path_params"]["name"], scope["path_params"].get("revision")
    query = checked(PointQuery, parsed(scope["query_string"], _OF_POINTS))
    accept = held = ""
    for key, value in scope["headers"]:
        if key == b"accept":
            accept += f",{value.decode('latin-1')}"  # the header may come in several lines
        elif key == b"if-none-match":
            held = value.decode("latin-1")
    state, kind, points = scope["app"].state, query.kind(accept), query.points
    table = await _table(state.shelf, name, revision)
    surface = surface_in(table, query)
    computed = query.source == "model" or query.output != "spectrum" or query.stokes is not None
    tag, immutable = tag_in(table, surface), revision is not None and not computed
    headers = value_headers(kind, tag, table.revision, immutable=immutable)
    values = checked_size(state.settings.max_points, points, query, surface, kind)
    slow = values > INLINE_VALUES or computed
    given = (points, query, surface, kind, headers, {"material": table.name, "revision": table.revision})
    answer = await run_in_threadpool(write_answer, *given) if slow else write_answer(*given)
    return unchanged(answer, held) if held else answer


async def _table(shelf: Shelf, name: str, revision: str | None) -> Table:
    """Return a table at once if it is decoded, else from a thread."""
    table = shelf.held(name)
    if table is not None and revision in (None, table.revision):
        return table
    return await run_in_threadpool(shelf.table, name, revision)


@both(
    lookups,
    "/lookup",
    method="POST",
    tags=["lookup"],
    responses=answers(Lookup, 404, 413, 415, 503, media=NPY_ANSWER, headers=(REVISION,)),
    openapi_extra=body(PointsBody, npy=True),
)
async def lookup_points(
    request: Request, name: str, query: Annotated[BodyQuery, InQuery()], revision: Revision = None
) -> Response:
    """Return the BRDF at many pairs of directions (angles in degrees), in the shape that the angles broadcast to.

    The wavelengths are a last axis, unless wavelength_nm is one number or the material is grey. Below the horizon
    (theta above 90 degrees) the BRDF is 0. A body of any media type but .npy is read as JSON.
    """
    binary = request.headers.get("content-type", "").partition(";")[0].strip().lower() == NPY
    if query.wavelength_nm and not binary:
        raise RequestError(422, "wavelength_nm: a JSON body holds it, not the query", "wavelength_nm")
    table = await _table(shelf_of(request), name, revision)
    surface, content = surface_in(table, query), await request.body()
    about = {"material": table.name, "revision": table.revision}

    def read() -> Asked:
        points = from_array(content, query.wavelength_nm) if binary else from_json(PointsBody, content).points
        return surface, points, about

    quick = len(content) <= INLINE_BYTES
    return await looked_up(request, query, len(content), read, binary=binary, quick=quick)


@lookups.post(
    "/v1/lookup",
    tags=["lookup"],
    responses=answers(Lookups, 404, 413, 415, 503, media={NPZ: "an array a material, by its name"}),
    openapi_extra=body(ManyBody),
    dependencies=[LARGE],
)
def lookup_many(request: Request, query: Annotated[ManyQuery, InQuery()], content: Content) -> Response:
    """Return the BRDF of several materials at the same pairs of directions (angles in degrees)."""
    given, shelf = from_json(ManyBody, content), shelf_of(request)
    points = given.points
    kind: Format = "npy" if query.format == "npz" else "json"
    max_points, total, results = request.app.state.settings.max_points, 0, {}
    for name in given.materials:
        table = shelf.table(name)
        surface = surface_in(table, query)
        total += checked_size(max_points, points, query, surface, kind)
        if total > (most := LIMITS[kind][1] * max_points):
            raise RequestError(413, f"the values of all materials are more than the {most} that one answer may hold")
        results[name] = table.revision, evaluate(points, query, surface)
    if kind == "npy":
        arrays = {name: values.brdf for name, (_, values) in results.items()}
        arrays |= {f"{name}.error": values.error for name, (_, values) in results.items() if values.error is not None}
        data = io.BytesIO()
        np.savez(data, **arrays)
        return Response(data.getvalue(), media_type=NPZ, headers={"Cache-Control": "no-store"})
    documents = [
        {"material": name, "revision": revision, **values_document(values)}
        for name, (revision, values) in results.items()
    ]
    return Response(json_bytes({"materials": documents}), media_type=JSON, headers={"Cache-Control": "no-store"})
