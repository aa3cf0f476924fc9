"""The addresses under /v1/materials: lists, materials and lookups; and the addresses that report health."""

from __future__ import annotations

import hashlib
import io
from datetime import datetime
from typing import TYPE_CHECKING, Annotated, Any, Literal
from urllib.parse import urlencode

import numpy as np
from fastapi import Query as InQuery
from pydantic import Field, TypeAdapter, ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import Scope

from brdfdb.formats import EXPORTERS
from brdfdb_api.http import middleware
from brdfdb_api.http.addresses import NPY_ANSWER, Content, Revision, addresses, answers, body, both, shelf_of
from brdfdb_api.http.errors import RequestError
from brdfdb_api.http.lookups import (
    INLINE_VALUES,
    LIMITS,
    answered,
    checked_size,
    document_of,
    evaluate,
    surface_of,
    write_answer,
)
from brdfdb_api.http.queries import (
    BodyQuery,
    Flag,
    Format,
    ManyBody,
    ManyQuery,
    PointQuery,
    PointsBody,
    Query,
    Wavelengths,
    checked,
    from_json,
    from_npy,
    names_of,
    parsed,
)
from brdfdb_api.http.responses import (
    NPY,
    REVISION,
    AuditSummary,
    Catalogue,
    Health,
    Lookup,
    Lookups,
    Material,
    cache_headers,
    json_bytes,
    json_response,
    lookup_headers,
    tag_of,
    unchanged,
)
from brdfdb_api.serving.shelf import Shelf, Verdict, spectrum_of

if TYPE_CHECKING:
    from brdfdb.tables.metadata import TableMetadata
    from brdfdb.tables.table import Table

EXPORTS_AT_ONCE, EXPORT_WAIT_S = 2, 10  # files of other formats that are made at a time, and the wait for a turn [s]
PAGE, MOST = 100, 1000  # materials on a page: default and largest number
NPZ = "application/x-npz"
SEARCHED = ("name", "title", "model", "model_title", "paper", "source")

router = addresses()


@router.get("/healthz", tags=["service"], responses=answers(Health))
async def healthz() -> Response:
    """Report that the process answers."""
    return json_response({"status": "ok"})


@router.get("/readyz", tags=["service"], responses=answers(Health, 503))
def readyz(request: Request) -> Response:
    """Report that kernels are loaded and the store can be read, and the number of its materials."""
    if shelf_of(request).warming:
        raise RequestError(503, "kernels are being loaded; the first time they are compiled, which takes half a minute")
    return json_response({"status": "ok", "materials": len(shelf_of(request).names())})


@router.get("/metrics", tags=["service"], responses=answers(None, media={"text/plain": "counts as text"}))
def metrics() -> Response:
    """Requests, seconds and points counted, as Prometheus reads them."""
    return Response(middleware.metrics(), media_type="text/plain; version=1.0.0; charset=utf-8")


_PLACE = TypeAdapter(tuple[bool, float, str])


class CatalogueQuery(Query):
    """The materials of a page, and their order."""

    cursor: str = Field(default="", description="as `next` of the page before has it")
    limit: int = Field(default=PAGE, ge=1, le=MOST, description="materials on a page")
    sort: Literal["name", "error_p99", "-error_p99", "created", "-created", "bytes", "-bytes"] = Field(
        default="name",
        description="order; with a minus the largest, or the newest, first; unknown ones last, then by name",
    )
    model: str = Field(default="", description="only of this model; measured: only of measured data")
    paper: str = Field(default="", description="only with this in the key of the paper or in the source")
    q: str = Field(default="", description="only with all of these words in name, title, model or source")
    family: str = Field(default="", description="only the members of this family of the store")
    verdict: Literal["passes", "known published excess", "accepted excess", "violates", "not audited"] | None = Field(
        default=None, description="only with this verdict of the audit of the current revision"
    )
    anisotropic: Flag | None = Field(default=None, description="only anisotropic, or only isotropic ones")
    wavelength_nm: Wavelengths = Field(
        default=(), description="only with tables at this wavelength [nm], repeatable; grey ones hold at all"
    )

    @property
    def after(self) -> tuple[bool, float, str]:
        """The place after which the page begins; RequestError (422) if the cursor is none."""
        try:
            return _PLACE.validate_json(self.cursor) if self.cursor else (False, -np.inf, "")
        except ValidationError:
            raise RequestError(422, "cursor: it is not that of `next` of a page", "cursor") from None

    @property
    def chosen(self) -> dict[str, Any]:
        """The parameters that were given, as a query has them."""
        given = self.model_dump(exclude={"cursor"}, exclude_defaults=True)
        return {key: str(value).lower() if isinstance(value, bool) else value for key, value in given.items()}

    @property
    def filters(self) -> bool:
        """True if some materials may be left out."""
        return bool(self.chosen.keys() - {"limit", "sort"})

    def rank(self, name: str, line: dict[str, Any]) -> tuple[bool, float, str]:
        """Return the place of a material in the order."""
        value = line.get(self.sort.removeprefix("-"))
        if self.sort == "name" or value is None:
            return self.sort != "name", 0.0, name
        number = datetime.fromisoformat(value).timestamp() if isinstance(value, str) else float(value)
        return False, -number if self.sort.startswith("-") else number, name

    def lets_through(self, line: dict[str, Any]) -> bool:
        """Return True if the filters let a line of the catalogue through."""
        text = " ".join(str(line.get(key) or "") for key in SEARCHED).casefold()
        papers = f"{line.get('paper', '')} {line.get('source', '')}".casefold()
        low, high = line.get("wavelength_range_nm") or (0.0, np.inf)
        return (
            self.model in ("", line.get("model", ""), "measured" if line.get("measured") else "")
            and self.paper.casefold() in papers
            and all(word in text for word in self.q.casefold().split())
            and self.verdict in (None, line.get("verdict") or "not audited")
            and self.anisotropic in (None, line.get("anisotropic"))
            and all(low <= wavelength <= high for wavelength in self.wavelength_nm)
        )


@router.get("/v1/materials", tags=["materials"], responses=answers(Catalogue, 304, 404, 503))
def catalogue(request: Request, query: Annotated[CatalogueQuery, InQuery()]) -> Response:
    """Materials of the store, a page at a time."""
    shelf = shelf_of(request)
    names = shelf.names()
    if query.family:
        members = shelf.store.family_content(query.family)["members"]
        names = [name for name in names if name in members]
    known = {name: shelf.summary(name) for name in names} if query.filters or query.sort != "name" else {}
    ranks = [query.rank(name, known.get(name, {})) for name in names if not known or query.lets_through(known[name])]
    ranks.sort()
    after = query.after
    page = [rank for rank in ranks if rank > after][: query.limit]
    lines = [known.get(name) or shelf.summary(name) for _, _, name in page]
    following = None
    if page and ranks[-1] > page[-1]:
        cursor = json_bytes(page[-1]).decode()
        following = f"/v1/materials?{urlencode({**query.chosen, 'cursor': cursor}, doseq=True)}"
    answer = json_response({"materials": lines, "total": len(ranks), "next": following})
    answer.headers.update(cache_headers(f"materials-{hashlib.sha256(answer.body).hexdigest()[:16]}"))
    return answer


@both(router, "", tags=["materials"], responses=answers(Material, 304, 404, 503))
def material(request: Request, name: str, revision: Revision = None) -> Response:
    """Return the origin of the table of a material, its grid (axes in degrees), and its error."""
    shelf = shelf_of(request)
    table = shelf.table(name, revision)
    verdict, revisions = shelf.verdict(name), shelf.store.revisions(name)
    # facts that change while the table does not
    beside = f"{'' if verdict is None else verdict.when} {revisions}"
    headers = cache_headers(f"{tag_of(table)}-{hashlib.sha256(beside.encode()).hexdigest()[:8]}")
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
        "audit": None if verdict is None else _audited(verdict, table.revision),
        "attributes": {
            key: value for key, value in table.attrs.items() if key not in ("error", "request", *metadata.strange)
        },
        "revisions": revisions,
        "links": {
            "self": address,
            **{
                key: f"{address}/{key}"
                for key in ("lookup", "albedo", "lobe", "sphere", "thumbnail.png", "audit", "download.zarr")
            },
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


def _audited(verdict: Verdict, revision: str) -> dict[str, Any]:
    """Return the verdict of an audit, its two answers, and its findings in sentences."""
    finding = verdict.finding.model_dump(include={*AuditSummary.model_fields}, exclude_unset=True)
    return {**finding, "current": verdict.finding.revision == revision, "when": verdict.when}


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
            accept += value.decode("latin-1")  # the header may come in several lines
        elif key == b"if-none-match":
            held = value.decode("latin-1")
    state, kind, points = scope["app"].state, query.kind(accept), query.points
    table = await _table(state.shelf, name, revision)
    headers = lookup_headers(tag_of(table), table.revision, kind, immutable=revision is not None)
    surface = surface_of(table, query.source)
    values = checked_size(state.settings.max_points, points, query, surface, kind)
    slow = values > INLINE_VALUES or query.source == "model" or query.output != "spectrum"
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
    surface, content = surface_of(table, query.source), await request.body()
    about, headers = {"material": table.name, "revision": table.revision}, lookup_headers(None, table.revision, kind)
    return await answered(
        *(request.app.state, surface, query, kind, len(content)),
        lambda: from_npy(content, query.wavelength_nm) if binary else from_json(PointsBody, content).points,
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
    max_points, total, values_of = request.app.state.settings.max_points, 0, {}
    for name in dict.fromkeys(given.materials):
        surface = surface_of(shelf.table(name), query.source)
        total += checked_size(max_points, points, query, surface, kind)
        if total > (most := LIMITS[kind][1] * max_points):
            raise RequestError(413, f"the values of all materials are more than the {most} that one answer may hold")
        values_of[name] = surface, evaluate(points, query, surface, error=query.error)
    if kind == "npy":
        arrays = {name: values.brdf for name, (_, values) in values_of.items()}
        arrays |= {f"{name}.error": values.error for name, (_, values) in values_of.items() if values.error is not None}
        data = io.BytesIO()
        np.savez(data, **arrays)
        return Response(data.getvalue(), media_type=NPZ, headers={"Cache-Control": "no-store"})
    documents = [
        document_of(points, query, surface, values, {"material": name, "revision": shelf.head(name)})
        for name, (surface, values) in values_of.items()
    ]
    return json_response({"materials": documents}, {"Cache-Control": "no-store"})
