"""The catalogue, the document of a material, and the health of the service."""

from __future__ import annotations

import hashlib
from typing import Annotated, Any
from urllib.parse import urlencode

import numpy as np
from fastapi import Query as InQuery
from pydantic import Field, TypeAdapter, ValidationError
from starlette.requests import Request
from starlette.responses import Response

from brdfdb.formats import EXPORTERS
from brdfdb.store.catalogue import Choice, material_document
from brdfdb.store.paths import pinned
from brdfdb_api.http import middleware
from brdfdb_api.http.addresses import Revision, addresses, answers, both, shelf_of
from brdfdb_api.http.errors import RequestError, refused
from brdfdb_api.http.queries import Flag, Query, Wavelengths
from brdfdb_api.http.responses import (
    Catalogue,
    Document,
    Health,
    ServedMaterial,
    cache_headers,
    json_bytes,
    tag_of,
    tagged,
)

PAGE = 100  # materials on a page
MOST = 1000  # largest number of materials on a page
PARTS = ("lookup", "albedo", "lobe", "sphere", "thumbnail.png", "audit", "download.zarr")  # links of a material

router = addresses()


@router.get("/healthz", tags=["service"], responses=answers(Health))
async def healthz() -> Response:
    """Report that the process answers."""
    return Document({"status": "ok"})


@router.get("/readyz", tags=["service"], responses=answers(Health, 503))
def readyz(request: Request) -> Response:
    """Report that kernels are loaded and the store can be read, with the number of its materials."""
    if shelf_of(request).warming:
        raise RequestError(503, "kernels are being loaded, which takes half a minute after an installation")
    return Document({"status": "ok", "materials": len(shelf_of(request).names())})


@router.get("/metrics", tags=["service"], responses=answers(None, media={"text/plain": "counters as text"}))
def metrics() -> Response:
    """Return the counters of requests, seconds and points in the format of Prometheus."""
    return Response(middleware.metrics(), media_type="text/plain; version=1.0.0; charset=utf-8")


_PLACE = TypeAdapter(tuple[bool, float, str])


class CatalogueQuery(Choice, Query):
    """The filters and the order of the catalogue, and a page of it."""

    cursor: str = Field(default="", description="begin of the page, from `next` of the previous page")
    limit: int = Field(default=PAGE, ge=1, le=MOST, description="largest number of materials on the page")
    family: str = Field(default="", description="only members of this family")
    anisotropic: Flag | None = Field(default=None, description=Choice.model_fields["anisotropic"].description)
    wavelength_nm: Wavelengths = Field(default=(), description=Choice.model_fields["wavelength_nm"].description)

    @property
    def after(self) -> tuple[bool, float, str]:
        """The place after which the page begins; RequestError (422) if the cursor is not valid."""
        try:
            return _PLACE.validate_json(self.cursor) if self.cursor else (False, -np.inf, "")
        except ValidationError:
            raise RequestError(422, "cursor: it is not from `next` of a page", "cursor") from None

    @property
    def given(self) -> dict[str, Any]:
        """The parameters of the request, as text of a query."""
        given = self.model_dump(exclude={"cursor"}, exclude_defaults=True)
        return {key: str(value).lower() if isinstance(value, bool) else value for key, value in given.items()}


@router.get("/v1/materials", tags=["materials"], responses=answers(Catalogue, 304, 404, 503))
def catalogue(request: Request, query: Annotated[CatalogueQuery, InQuery()]) -> Response:
    """Return the catalogue of the store, page by page."""
    shelf = shelf_of(request)
    names = shelf.names()
    if query.family:
        members = shelf.store.family_content(query.family)["members"]
        names = [name for name in names if name in members]
    with refused():
        places = query.chosen(names, shelf.line)
    after = query.after
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


@both(router, "", tags=["materials"], responses=answers(ServedMaterial, 304, 404, 503))
def material(request: Request, name: str, revision: Revision = None) -> Response:
    """Return the source, the grid (axes in degrees) and the error of the table of a material."""
    shelf = shelf_of(request)
    table = shelf.table(name, revision)
    verdict = shelf.verdict(name)
    revisions = shelf.store.revisions(name)
    # These change while the table does not
    changing = f"{'' if verdict is None else verdict.when} {revisions}"
    headers = cache_headers(tag_of(table, hashlib.sha256(changing.encode()).hexdigest()[:8]))
    address = f"/v1/materials/{name}" + ("" if revision is None else f"/revisions/{revision}")
    links = {
        "self": address,
        **{key: f"{address}/{key}" for key in (*PARTS, *(f"export/{file_format}" for file_format in EXPORTERS))},
        "store": f"/v1/store/materials/{name}/{pinned(table.revision, table.digest)}",
        "revision": f"/v1/materials/{name}/revisions/{pinned(table.revision, table.digest)}",
        "materials": "/v1/materials",
    }
    return Document(material_document(table, verdict) | {"revisions": revisions, "links": links}, headers)
