"""Views of a material for pages and reports: albedos, lobes, files of other formats, and the findings of the audit."""

from __future__ import annotations

import functools
import hashlib
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import Path
from fastapi import Query as InQuery
from pydantic import Field
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from brdfdb import __version__
from brdfdb.formats import EXPORTERS, packed, served_options, served_schemas
from brdfdb.scenes import lit_sphere
from brdfdb.store.archive import ZIP
from brdfdb.store.summary_words import NOT_AUDITED
from brdfdb.tables.albedo import reflected
from brdfdb.tables.evaluation import MOST_POINTS, LookupPoints, LookupSubject, listed, view_directions
from brdfdb.tables.values_document import TableAlbedoDocument, TableLobe, lobe_document, npy_bytes, of_table
from brdfdb_api.http.addresses import NPY_ANSWER, Revision, addresses, answers, both, shelf_of
from brdfdb_api.http.errors import RequestError, refused
from brdfdb_api.http.lookups import LARGE, checked_size, evaluate, surface_in, tag_in, turn
from brdfdb_api.http.queries import LobeOptions, LobeQuery, Query, accept_of, parsed
from brdfdb_api.http.responses import NPY, Audit, Document, cache_headers, tag_of

SPHERE = {"image/png": "sRGB with transparent corners", NPY: "linear sRGB and coverage (size, size, 4), not clipped"}
EXPORTS_AT_ONCE = 2  # number of exported files that are made together
THUMBNAIL = 96  # width of a thumbnail [pixel]
MOST = 256  # largest width of a thumbnail [pixel]

# Options of all formats; an option that the format does not have is refused
EXPORT_OPTIONS = [
    {"name": name, "in": "query", "required": False, "description": text, "schema": schema}
    for name, (schema, text) in served_schemas().items()
]

views = addresses()


class SphereQuery(Query):
    """The query of a picture."""

    size: int = Field(default=256, ge=16, le=512, description="width and height [pixels]")
    format: Literal["png", "npy"] = Field(default="png", description="a picture, or its linear values as an array")


class ThumbnailQuery(Query):
    """The query of a thumbnail."""

    size: int = Field(default=THUMBNAIL, ge=16, le=MOST, description="width and height [pixels]")


@both(views, "/albedo", tags=["views"], responses=answers(TableAlbedoDocument, 304, 404, 503))
def albedo(request: Request, name: str, revision: Revision = None) -> Response:
    """Return the directional and the hemispherical albedo [1] of the table."""
    table = shelf_of(request).table(name, revision)
    about = of_table(table)
    return Document(about | reflected(table).document(table.wavelength_nm), cache_headers(tag_of(table)))


@both(views, "/lobe", tags=["views"], responses=answers(TableLobe, 304, 404, 413, 503, media=NPY_ANSWER))
def lobe(request: Request, name: str, query: Annotated[LobeQuery, InQuery()], revision: Revision = None) -> Response:
    """Return f_r [1/sr] for one light in the plane of incidence or over all viewers, or over theta_h and theta_d.

    Viewers are denser around the mirror direction. In the view half-difference, phi_h is phi_i and phi_d is 90 degrees.
    """
    table = shelf_of(request).table(name, revision)
    surface = surface_in(table, query)
    headers = cache_headers(tag_in(table, surface), query.kind(accept_of(request)))
    about = of_table(table)
    return lobe_answer(request, surface, query, about, headers)


def lobe_answer(
    request: Request,
    surface: LookupSubject,
    query: LobeQuery | LobeOptions,
    about: dict[str, Any],
    headers: dict[str, str],
) -> Response:
    """Return the answer with the lobe of a surface; `about` begins the document."""
    kind = query.kind(accept_of(request))
    glints = surface.source.glints if surface.kind == "table" else None
    axes, angles = view_directions(query.view, query.theta_i, query.phi_i, glints)
    points = LookupPoints.of(angles, listed(query.wavelength_nm))
    # The view fixes the points; the client chooses only the wavelengths. Arrays have the limit of JSON, too
    checked_size(max(request.app.state.settings.max_points, MOST_POINTS), points, query, surface, "json")
    values = evaluate(points, query, surface)
    if kind == "npy":
        return Response(npy_bytes(values.array), media_type=NPY, headers=headers)
    return Document(about | lobe_document(values, axes, query.view, query.theta_i, query.phi_i), headers)


@both(
    views,
    "/export/{file_format}",
    tags=["views"],
    responses=answers(
        *(None, 304, 404, 503),
        media={ZIP: "several files"} | {exporter.media_type: exporter.summary for exporter in EXPORTERS.values()},
        headers=("Content-Disposition",),
    ),
    openapi_extra={"parameters": EXPORT_OPTIONS},
)
async def export(
    request: Request,
    name: str,
    file_format: Annotated[str, Path(json_schema_extra={"enum": [*EXPORTERS]})],
    revision: Revision = None,
) -> Response:
    """Return the table, or a slice of it, as the file of another format that `brdfdb export` writes."""
    if file_format not in EXPORTERS:
        raise RequestError(404, f"{file_format!r} is not a format; allowed are {', '.join(EXPORTERS)}")
    allowed = served_options(file_format)
    query = parsed(request.scope["query_string"], allowed)
    with refused():
        options = {option: allowed[option].parse(text) for option, text in query.items()}
    shelf = shelf_of(request)
    table, known = await run_in_threadpool(lambda: (shelf.table(name, revision), shelf.verdict(name)))
    verdict = None
    if known and known.finding.is_of(table.revision, table.digest):
        verdict = known.finding.verdict_in_words or known.finding.verdict
    # The file states the program and the verdict, which a later audit may change. The tag is weak: some state the time
    headers = cache_headers(tag_of(table, hashlib.sha256(str(verdict).encode()).hexdigest()[:16]), file_format)
    headers["ETag"] = f"W/{headers['ETag']}"
    if request.headers.get("if-none-match") == headers["ETag"]:  # before the file is made, which takes seconds
        return Response(status_code=304, headers=headers)
    pack = functools.partial(packed, table, file_format, verdict=verdict or NOT_AUDITED, **options)
    async with turn(request.app.state.exports):
        with refused():
            file, media_type, content = await run_in_threadpool(pack)
    headers["Content-Disposition"] = f'attachment; filename="{file}"'
    return Response(content, media_type=media_type, headers=headers)


@both(views, "/audit", tags=["views"], responses=answers(Audit, 304, 404, 503))
def audit(request: Request, name: str, revision: Revision = None) -> Response:
    """Return the findings of the last `brdfdb audit` of a material: energy, reciprocity, error and others."""
    shelf = shelf_of(request)
    verdict = shelf.verdict(name)
    current = shelf.head(name)
    table = None if revision is None else shelf.table(name, revision)  # raises if there is no such revision
    if verdict is None or not (table is None or verdict.finding.is_of(table.revision, table.digest)):
        raise RequestError(404, f"{name}: this revision is not audited; run `brdfdb audit`")
    audited = verdict.finding.revision
    document = {"material": name, "revision": audited, "current": audited == current, "when": verdict.when}
    headers = cache_headers(f"{name}-{current}-{verdict.when}-{__version__}")
    return Document({**document, "finding": verdict.finding.model_dump(exclude_unset=True)}, headers)


@both(views, "/sphere", tags=["views"], responses=answers(None, 304, 404, 503, media=SPHERE), dependencies=[LARGE])
def sphere(
    request: Request, name: str, query: Annotated[SphereQuery, InQuery()], revision: Revision = None
) -> Response:
    """Return a draft picture of a sphere of the material in studio light, without the glints of measured data."""
    table = shelf_of(request).table(name, revision)
    return sphere_answer(table, query, cache_headers(tag_of(table, query.size), query.format))


def sphere_answer(surface: Any, query: SphereQuery, headers: dict[str, str]) -> Response:
    """Return the picture of a material or a table."""
    if query.format == "png":
        return Response(
            lit_sphere.sphere_png(surface, query.size, lit_sphere.DRAFT), media_type="image/png", headers=headers
        )
    linear = lit_sphere.linear_sphere(surface, query.size, detail=lit_sphere.DRAFT).astype(np.float32)
    return Response(npy_bytes(linear), media_type=NPY, headers=headers)


@both(views, "/thumbnail.png", tags=["views"], responses=answers(None, 304, 404, 503, media={"image/png": "a sphere"}))
def thumbnail(
    request: Request, name: str, query: Annotated[ThumbnailQuery, InQuery()], revision: Revision = None
) -> Response:
    """Return a small picture of the material for lists."""
    table = shelf_of(request).table(name, revision)
    headers = cache_headers(tag_of(table, query.size), "png")
    return Response(lit_sphere.thumbnail_png(table, query.size), media_type="image/png", headers=headers)
