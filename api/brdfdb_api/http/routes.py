"""The addresses under /v1/materials: lists, materials and lookups; and the addresses that report health."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any, TypeVar
from urllib.parse import urlencode

import numpy as np
from fastapi import APIRouter, Depends, Query
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import Scope

from brdfdb.formats import EXPORTERS
from brdfdb_api.http import middleware, openapi_notes
from brdfdb_api.http.errors import RequestError
from brdfdb_api.http.lookups import FIELDS, OPTIONS, Options, Points, evaluate, parsed
from brdfdb_api.http.openapi_notes import BODY, ERROR, NPY_ANSWER, POINT, WAVELENGTHS, answers
from brdfdb_api.http.responses import (
    JSON,
    NPY,
    Alive,
    Catalogue,
    Encoded,
    EncodedResponse,
    Health,
    Lookup,
    Material,
    cache_headers,
    json_bytes,
    json_response,
    lookup_headers,
    not_modified,
    npy_bytes,
    plain,
    tag_of,
)
from brdfdb_api.serving.shelf import Shelf, answers_of, spectrum_of

if TYPE_CHECKING:
    from brdfdb.tables.metadata import TableMetadata
    from brdfdb.tables.table import Table

T = TypeVar("T")

INLINE_VALUES = 1000  # larger lookups run in a thread, so that the event loop can serve others
INLINE_BYTES = 96 * 2**10  # larger bodies are read in a thread; 1000 points take about this many bytes
# Number of larger bodies, or larger answers, that are processed at a time
LARGE_BYTES, LARGE_VALUES, LARGE_AT_ONCE = 2**20, 100_000, 8
EXPORTS_AT_ONCE, EXPORT_WAIT_S = 2, 10  # files of other formats that are made at a time, and the wait for a turn [s]
JSON_BYTES = 8 * 2**20  # limit on a JSON body [byte]: numbers in lists take twenty times the memory of the text
LIMITS = {"json": (1, 100), "npy": (100, 1000)}  # points and values of one answer, as multiples of max_points
SPECTRA_OF_COLOURS = 10  # factor on the number of values where only colours are returned
PAGE, MOST = 100, 1000  # materials on a page: default and largest number
_ALLOWED = (*FIELDS, *OPTIONS)  # parameters in the query of a lookup
SEARCHED = ("name", "title", "model", "model_title", "paper", "source")

router = APIRouter()


def query_names(*allowed: str) -> Any:
    """Return a dependency that refuses parameters that are not `allowed`, and all but wavelength_nm given twice."""

    async def check(request: Request) -> None:
        parsed(request.scope["query_string"], allowed)

    return Depends(check)


def shelf_of(request: Request) -> Shelf:
    """Return the shelf of the application."""
    shelf: Shelf = request.app.state.shelf
    return shelf


@router.get("/healthz", tags=["service"], dependencies=[query_names()], responses=answers(Alive, 422))
async def healthz() -> Response:
    """Report that the process answers."""
    return json_response({"status": "ok"})


@router.get("/readyz", tags=["service"], dependencies=[query_names()], responses=answers(Health, 422, 503))
def readyz(request: Request) -> Response:
    """Report that kernels are loaded and the store can be read, and the number of its materials."""
    if shelf_of(request).warming:
        raise RequestError(503, "kernels are being loaded; the first time they are compiled, which takes half a minute")
    return json_response({"status": "ok", "materials": len(shelf_of(request).names())})


@router.get(
    "/metrics", tags=["service"], dependencies=[query_names()], responses=answers(None, 422, media={"text/plain": ""})
)
def metrics() -> Response:
    """Requests, seconds and points counted, as Prometheus reads them."""
    return Response(middleware.metrics(), media_type="text/plain; version=1.0.0; charset=utf-8")


@router.get(
    "/v1/materials",
    tags=["materials"],
    dependencies=[query_names("cursor", "limit", "model", "paper", "q")],
    responses=answers(Catalogue, 304, 422, 503),
)
def catalogue(
    request: Request,
    cursor: Annotated[str, Query(description="of the page before, its last name")] = "",
    limit: Annotated[int, Query(ge=1, le=MOST, description="materials on a page")] = PAGE,
    model: Annotated[str, Query(description="only of this model; measured: only of measured data")] = "",
    paper: Annotated[str, Query(description="only with this in the key of the paper or in the source")] = "",
    q: Annotated[str, Query(description="only with all of these words in name, title, model or source")] = "",
) -> Response:
    """Materials of the store, sorted by name, a page at a time."""
    shelf = shelf_of(request)
    names = shelf.names()
    if model or paper or q:
        words = q.casefold().split()
        names = [name for name in names if _let_through(shelf.summary(name), model, paper.casefold(), words)]
    page = [name for name in names if name > cursor][:limit]
    lines = [shelf.summary(name) for name in page]
    shelf.colour(line["name"] for line in lines if line.get("colour") is None and "damaged" not in line)
    following = None
    if page and names[-1] > page[-1]:
        query = {"model": model, "paper": paper, "q": q, "limit": limit, "cursor": page[-1]}
        following = f"/v1/materials?{urlencode({key: value for key, value in query.items() if value})}"
    answer = json_response({"materials": lines, "total": len(names), "next": following})
    headers = cache_headers(f"materials-{hashlib.sha256(answer.body).hexdigest()[:16]}")
    if held := not_modified(request.headers.get("if-none-match"), headers):
        return held
    answer.headers.update(headers)
    return answer


def _let_through(line: dict[str, Any], model: str, paper: str, words: list[str]) -> bool:
    """Return True if the filters let a line of the catalogue through."""
    text = " ".join(str(line.get(key) or "") for key in SEARCHED).casefold()
    papers = f"{line.get('paper', '')} {line.get('source', '')}".casefold()
    models = ("", line.get("model", ""), "measured" if line.get("measured") else "")
    return model in models and paper in papers and all(word in text for word in words)


def both(
    path: str, *, router: APIRouter = router, method: str = "GET", **keywords: Any
) -> Callable[[Callable[..., T]], Callable[..., T]]:
    """Serve an address of the current revision, and the same of any revision, which never changes."""

    def add(function: Callable[..., T]) -> Callable[..., T]:
        name = getattr(function, "__name__", "")
        for prefix, suffix in (("", ""), ("/revisions/{revision}", "_of_revision")):
            router.add_api_route(
                f"/v1/materials/{{name}}{prefix}{path}",
                function,
                methods=[method],
                name=f"{name}{suffix}",
                **keywords,
            )
        return function

    return add


@both("", tags=["materials"], dependencies=[query_names()], responses=answers(Material, 304, 404, 422, 503))
def material(request: Request, name: str, revision: str | None = None) -> Response:
    """Return the origin of the table of a material, its grid (axes in degrees), and its error."""
    shelf = shelf_of(request)
    table = shelf.table(name, revision)
    verdict, revisions = shelf.verdict(name), shelf.store.revisions(name)
    # facts that change while the table does not
    beside = f"{'' if verdict is None else verdict.when} {revisions}"
    headers = cache_headers(f"{tag_of(table)}-{hashlib.sha256(beside.encode()).hexdigest()[:8]}")
    if held := not_modified(request.headers.get("if-none-match"), headers):
        return held
    address = f"/v1/materials/{name}" + ("" if revision is None else f"/revisions/{revision}")
    metadata = table.metadata
    document = {
        "name": table.name,
        "revision": table.revision,
        "title": metadata.title or "",
        "model": metadata.model,
        "parameters": _parameters(metadata),
        "anisotropic": table.anisotropic,
        "wavelength_nm": table.wavelength_nm,
        "spectrum": spectrum_of([] if table.wavelength_nm is None else table.wavelength_nm.tolist()),
        "axes_deg": {axis: np.ascontiguousarray(values) for axis, values in table.axes_deg.items()},
        "specular": table.specular is not None,
        "error": None if table.error is None else table.attrs["error"],
        "measured": None if metadata.measured is None else metadata.measured.model_dump(exclude={"extent"}),
        "formula_error": table.attrs.get("formula_error"),
        "largest_albedo": table.attrs.get("largest_albedo"),
        "incomplete": metadata.gaps or None,
        "audit": None if verdict is None else _verdicts(verdict.finding, verdict.when, table.revision),
        "colour": shelf.swatch(table),
        "attributes": {key: value for key, value in table.attrs.items() if key not in ("error", "request")},
        "revisions": revisions,
        "links": {
            "self": address,
            **{key: f"{address}/{key}" for key in ("lookup", "albedo", "lobe", "audit", "download.zarr")},
            **{f"export/{file_format}": f"{address}/export/{file_format}" for file_format in EXPORTERS},
            "store": f"/v1/store/materials/{name}/{table.revision}",
            "revision": f"/v1/materials/{name}/revisions/{table.revision}",
            "materials": "/v1/materials",
        },
    }
    return json_response(document, headers)


def _parameters(metadata: TableMetadata) -> list[dict[str, Any]]:
    """Return the parameters as recipes write them: value, unit, meaning, source."""
    from brdfdb.materials import written_name
    from brdfdb.materials.spectrum import Spectrum
    from brdfdb.models import MODELS

    spec = MODELS.get(metadata.model or "")
    meanings = {} if spec is None else {written_name(parameter): parameter for parameter in spec.parameters}
    return [
        {
            "name": name,
            "value": value.model_dump() if isinstance(value, Spectrum) else value,
            "unit": ("degree" if meanings[name].unit == "rad" else meanings[name].unit) if name in meanings else "",
            "meaning": meanings[name].meaning if name in meanings else "",
            "source": metadata.parameter_sources.get(name, metadata.source or ""),
            "assumed": name in metadata.assumed,
        }
        for name, value in metadata.parameters.items()
    ]


def _verdicts(finding: dict[str, Any], when: str, revision: str) -> dict[str, Any]:
    """Return the verdict of an audit, its two answers, and its findings in sentences."""
    return {
        "verdict": finding["verdict"],
        **answers_of(finding),
        "model": finding["model"],
        "sentences": finding["sentences"],
        "revision": finding["revision"],
        "current": finding["revision"] == revision,
        "when": when,
    }


@both(
    "/lookup",
    tags=["lookup"],
    responses=answers(Lookup, 304, 404, 413, 422, 503, media=NPY_ANSWER),
    openapi_extra={"parameters": [*POINT, WAVELENGTHS, *openapi_notes.OPTIONS, ERROR]},
)
async def lookup_point(request: Request, name: str, revision: str | None = None) -> Response:
    """Return the BRDF at one pair of directions (angles in degrees).

    The wavelengths are an axis, unless wavelength_nm is one number or the material is grey. Below the horizon (theta
    above 90 degrees) the BRDF is 0.
    """
    return await answer_point(request.scope, name, revision)


async def answer_point(scope: Scope, name: str, revision: str | None) -> Response:
    """Answer GET of a lookup, from the query as it came."""
    query, wavelengths = parsed(scope["query_string"], _ALLOWED)
    options, points = Options.from_query(query), Points.from_query(query, wavelengths)
    accept, held = _headers(scope)
    state = scope["app"].state
    table = await _table(state.shelf, name, revision)
    kind = options.format or ("npy" if NPY in accept else "json")
    headers = lookup_headers(tag_of(table), table.revision, kind, immutable=revision is not None)
    if held and (unchanged := not_modified(held, headers, certain=False)):
        return unchanged
    values = checked_size(state.settings.max_points, points, options, table, kind)
    in_thread = slow(values, options)
    answer = await run(write_answer, points, options, table, kind, headers, in_thread=in_thread)
    return (held and not_modified(held, headers)) or answer


def _headers(scope: Scope) -> tuple[str, str]:
    """Accept and If-None-Match."""
    accept = held = b""
    for key, value in scope["headers"]:
        if key == b"accept":
            accept += value  # the header may come in several lines
        elif key == b"if-none-match":
            held = value
    return accept.decode("latin-1"), held.decode("latin-1")


async def _table(shelf: Shelf, name: str, revision: str | None) -> Table:
    """Return a table at once if it is decoded, else from a thread."""
    table = shelf.held(name)
    if table is not None and revision in (None, table.revision):
        return table
    return await run_in_threadpool(shelf.table, name, revision)


@both(
    "/lookup",
    method="POST",
    tags=["lookup"],
    responses=answers(Lookup, 404, 413, 422, 503, media=NPY_ANSWER),
    openapi_extra={"requestBody": BODY, "parameters": [WAVELENGTHS, *openapi_notes.OPTIONS, ERROR]},
)
async def lookup_points(request: Request, name: str, revision: str | None = None) -> Response:
    """Return the BRDF at many pairs of directions (angles in degrees), in the shape that the angles broadcast to.

    The wavelengths are a last axis, unless wavelength_nm is one number or the material is grey. Below the horizon
    (theta above 90 degrees) the BRDF is 0. wavelength_nm in the query is for .npy bodies; JSON holds its own.
    """
    query, wavelengths = parsed(request.scope["query_string"], ("wavelength_nm", *OPTIONS))
    options = Options.from_query(query)
    binary = request.headers.get("content-type", "").partition(";")[0].strip().lower() == NPY
    if wavelengths and not binary:
        raise RequestError(422, "wavelength_nm: a JSON body holds it, not the query", "wavelength_nm")
    accept = request.headers.get("accept", "")
    kind = options.format or ("npy" if NPY in accept or (binary and JSON not in accept) else "json")
    table = await _table(shelf_of(request), name, revision)
    headers = lookup_headers(None, table.revision, kind)
    max_points = request.app.state.settings.max_points

    def points_of(body: bytes) -> tuple[Points, int]:
        points = Points.from_npy(body, wavelengths) if binary else Points.from_json(body)
        return points, checked_size(max_points, points, options, table, kind)

    def answer(body: bytes) -> Response:
        return write_answer(points_of(body)[0], options, table, kind, headers)

    body = await request.body()
    if not binary and len(body) > JSON_BYTES:
        raise RequestError(413, f"a JSON body may have {JSON_BYTES} bytes; send as many points as {NPY}")
    large = request.app.state.large
    if len(body) > INLINE_BYTES:
        async with large if len(body) > LARGE_BYTES else contextlib.nullcontext():
            return await run_in_threadpool(answer, body)
    points, values = points_of(body)
    # a row and a column of angles take few bytes and make many points
    async with large if values > LARGE_VALUES else contextlib.nullcontext():
        return await run(write_answer, points, options, table, kind, headers, in_thread=slow(values, options))


async def run(function: Callable[..., T], *args: Any, in_thread: bool) -> T:
    """Call `function`, in a thread where that pays: it costs about as long as 1000 values do."""
    return await run_in_threadpool(function, *args) if in_thread else function(*args)


def slow(values: int, options: Options) -> bool:
    """Return True if a lookup of this many values would keep other requests waiting."""
    return values > INLINE_VALUES or options.source == "model" or options.output != "spectrum"


def checked_size(max_points: int, points: Points, options: Options, table: Table, kind: str) -> int:
    """Return the number of values to look up; RequestError (413) if they are too many for one answer."""
    most_points, most_values = LIMITS[kind]
    most_points, most_values = most_points * max_points, most_values * max_points
    if points.count > most_points:
        hint = "; format=npy may hold more" if kind == "json" else ""
        raise RequestError(
            413, f"{points.count} points are more than the {most_points} that one {kind} answer may hold{hint}"
        )
    values = points.values(table)
    if options.output != "spectrum" and options.source == "table":
        most_values *= SPECTRA_OF_COLOURS
    if values > most_values:
        raise RequestError(413, f"{values} values are more than the {most_values} that one {kind} answer may be of")
    return values


def write_answer(points: Points, options: Options, table: Table, kind: str, headers: Encoded) -> Response:
    """Look the points up and write them as `kind`."""
    middleware.points_counted(options.source, points.count)
    values = evaluate(points, options, table, specular=kind == "json")
    if kind == "npy":
        content = npy_bytes(values.brdf if values.error is None else np.stack([values.brdf, values.error]))
        return EncodedResponse(content, headers)
    document = {
        "material": table.name,
        "revision": table.revision,
        "source": options.source,
        "unit": "1/sr",
        "output": options.output,
        "illuminant": None if options.output == "spectrum" else options.illuminant,
        "wavelength_nm": points.wavelengths(table),
        "brdf": plain(values.brdf),
        "error": None if values.error is None else plain(values.error),
        "extrapolated": None if values.error is None else plain(table.extrapolated(*points.angles)),
        "specular_reflectance": plain(values.specular_reflectance),
    }
    return EncodedResponse(json_bytes(document), headers)
