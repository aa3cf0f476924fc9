"""The addresses under /v1/materials: lists, materials and lookups; and the addresses that report health."""

from __future__ import annotations

import hashlib
import io
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import urlencode

import numpy as np
from fastapi import Query as InQuery
from pydantic import Field, TypeAdapter, ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import Scope

from brdfdb.formats import EXPORTERS
from brdfdb.store.catalogue import Choice
from brdfdb.store.material_document import material_document
from brdfdb.tables.points import PointsBody
from brdfdb.tables.values_document import values_document
from brdfdb_api.http import middleware
from brdfdb_api.http.addresses import NPY_ANSWER, Content, Revision, addresses, answers, body, both, shelf_of
from brdfdb_api.http.errors import RequestError
from brdfdb_api.http.lookups import (
    INLINE_VALUES,
    LIMITS,
    answered,
    checked_size,
    evaluate,
    surface_in,
    tag_in,
    write_answer,
)
from brdfdb_api.http.queries import (
    BodyQuery,
    Flag,
    Format,
    ManyBody,
    ManyQuery,
    PointQuery,
    Query,
    Wavelengths,
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
    Catalogue,
    Document,
    Health,
    Lookup,
    Lookups,
    Material,
    cache_headers,
    json_bytes,
    lookup_headers,
    tag_of,
    tagged,
    unchanged,
)
from brdfdb_api.serving.shelf import Shelf

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

EXPORTS_AT_ONCE, EXPORT_WAIT_S = 2, 10  # files of other formats that are made at a time, and the wait for a turn [s]
PAGE, MOST = 100, 1000  # materials on a page: default and largest number
NPZ = "application/x-npz"
PARTS = ("lookup", "albedo", "lobe", "sphere", "thumbnail.png", "audit", "download.zarr")  # of a material

router = addresses()


@router.get("/healthz", tags=["service"], responses=answers(Health))
async def healthz() -> Response:
    """Report that the process answers."""
    return Document({"status": "ok"})


@router.get("/readyz", tags=["service"], responses=answers(Health, 503))
def readyz(request: Request) -> Response:
    """Report that kernels are loaded and the store can be read, and the number of its materials."""
    if shelf_of(request).warming:
        raise RequestError(503, "kernels are being loaded; the first time they are compiled, which takes half a minute")
    return Document({"status": "ok", "materials": len(shelf_of(request).names())})


@router.get("/metrics", tags=["service"], responses=answers(None, media={"text/plain": "counts as text"}))
def metrics() -> Response:
    """Requests, seconds and points counted, as Prometheus reads them."""
    return Response(middleware.metrics(), media_type="text/plain; version=1.0.0; charset=utf-8")


_PLACE = TypeAdapter(tuple[bool, float, str])


class CatalogueQuery(Choice, Query):
    """The materials of a page, and their order."""

    cursor: str = Field(default="", description="as `next` of the page before has it")
    limit: int = Field(default=PAGE, ge=1, le=MOST, description="materials on a page")
    family: str = Field(default="", description="only the members of this family of the store")
    anisotropic: Flag | None = Field(default=None, description=Choice.model_fields["anisotropic"].description)
    wavelength_nm: Wavelengths = Field(default=(), description=Choice.model_fields["wavelength_nm"].description)

    @property
    def after(self) -> tuple[bool, float, str]:
        """The place after which the page begins; RequestError (422) if the cursor is none."""
        try:
            return _PLACE.validate_json(self.cursor) if self.cursor else (False, -np.inf, "")
        except ValidationError:
            raise RequestError(422, "cursor: it is not that of `next` of a page", "cursor") from None

    @property
    def given(self) -> dict[str, Any]:
        """The parameters that were given, as a query has them."""
        given = self.model_dump(exclude={"cursor"}, exclude_defaults=True)
        return {key: str(value).lower() if isinstance(value, bool) else value for key, value in given.items()}


@router.get("/v1/materials", tags=["materials"], responses=answers(Catalogue, 304, 404, 503))
def catalogue(request: Request, query: Annotated[CatalogueQuery, InQuery()]) -> Response:
    """Materials of the store, a page at a time."""
    shelf = shelf_of(request)
    names = shelf.names()
    if query.family:
        members = shelf.store.family_content(query.family)["members"]
        names = [name for name in names if name in members]
    places, after = query.chosen(names, shelf.summary), query.after
    page = [place for place in places if place > after][: query.limit]
    lines = [shelf.summary(name) for _, _, name in page]
    for line in lines:
        address = f"/v1/materials/{line['name']}"
        line |= {"href": address} if "damaged" in line else {"href": address, "thumbnail": f"{address}/thumbnail.png"}
    following = None
    if page and places[-1] > page[-1]:
        cursor = json_bytes(page[-1]).decode()
        following = f"/v1/materials?{urlencode({**query.given, 'cursor': cursor}, doseq=True)}"
    return tagged({"materials": lines, "total": len(places), "next": following}, "materials")


@both(router, "", tags=["materials"], responses=answers(Material, 304, 404, 503))
def material(request: Request, name: str, revision: Revision = None) -> Response:
    """Return the origin of the table of a material, its grid (axes in degrees), and its error."""
    shelf = shelf_of(request)
    table = shelf.table(name, revision)
    verdict, revisions = shelf.verdict(name), shelf.store.revisions(name)
    # facts that change while the table does not
    beside = f"{'' if verdict is None else verdict.when} {revisions}"
    headers = cache_headers(tag_of(table, hashlib.sha256(beside.encode()).hexdigest()[:8]))
    address = f"/v1/materials/{name}" + ("" if revision is None else f"/revisions/{revision}")
    links = {
        "self": address,
        **{key: f"{address}/{key}" for key in (*PARTS, *(f"export/{file_format}" for file_format in EXPORTERS))},
        "store": f"/v1/store/materials/{name}/{table.revision}",
        "revision": f"/v1/materials/{name}/revisions/{table.revision}",
        "materials": "/v1/materials",
    }
    return Document(material_document(table, verdict) | {"revisions": revisions, "links": links}, headers)


@both(
    router,
    "/lookup",
    tags=["lookup"],
    responses=answers(Lookup, 304, 404, 413, 503, media=NPY_ANSWER, headers=(REVISION,)),
)
async def lookup_point(
    request: Request,
    name: str,
    query: Annotated[PointQuery, InQuery()],  # noqa: ARG001 of the document
    revision: Revision = None,
) -> Response:
    """Return the BRDF at one pair of directions (angles in degrees).

    The wavelengths are an axis, unless wavelength_nm is one number or the material is grey. Below the horizon (theta
    above 90 degrees) the BRDF is 0.
    """
    return await answer_point(request.scope, name, revision)


_OF_POINTS = names_of(PointQuery)


async def answer_point(scope: Scope, name: str, revision: str | None) -> Response:
    """Answer GET of a lookup, from the query as it came: what lies behind the edge takes three times as long."""
    query = checked(PointQuery, parsed(scope["query_string"], _OF_POINTS), "query")
    accept = held = ""
    for key, value in scope["headers"]:
        if key == b"accept":
            accept += f",{value.decode('latin-1')}"  # the header may come in several lines
        elif key == b"if-none-match":
            held = value.decode("latin-1")
    state, kind, points = scope["app"].state, query.kind(accept), query.points
    table = await _table(state.shelf, name, revision)
    surface = surface_in(table, query)
    computed = query.source == "model" or query.output != "spectrum"
    headers = lookup_headers(
        tag_in(table, surface), table.revision, kind, immutable=revision is not None and not computed
    )
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
    router,
    "/lookup",
    method="POST",
    tags=["lookup"],
    responses=answers(Lookup, 404, 413, 503, media=NPY_ANSWER, headers=(REVISION,)),
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
    kind = query.kind(request.headers.get("accept", ""), binary=binary)
    table = await _table(shelf_of(request), name, revision)
    surface, content = surface_in(table, query), await request.body()
    about, headers = {"material": table.name, "revision": table.revision}, lookup_headers(None, table.revision, kind)
    return await answered(
        *(request.app.state, surface, query, kind, len(content)),
        lambda: from_array(content, query.wavelength_nm) if binary else from_json(PointsBody, content).points,
        lambda points: write_answer(points, query, surface, kind, headers, about),
    )


@router.post(
    "/v1/lookup",
    tags=["lookup"],
    responses=answers(Lookups, 404, 413, 503, media={NPZ: "an array a material, by its name"}),
    openapi_extra=body(ManyBody),
)
def lookup_many(request: Request, query: Annotated[ManyQuery, InQuery()], content: Content) -> Response:
    """Return the BRDF of several materials at the same pairs of directions (angles in degrees)."""
    given, shelf = from_json(ManyBody, content), shelf_of(request)
    points = given.points
    kind: Format = "npy" if query.format == "npz" else "json"
    max_points, total, results = request.app.state.settings.max_points, 0, {}
    for name in dict.fromkeys(given.materials):
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
