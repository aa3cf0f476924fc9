"""The addresses of the HTTP layer, and what each answers."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import numpy as np
from fastapi import APIRouter, Depends, Query
from numpy.typing import NDArray
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

import brdfdb
from brdfdb_api.lookups import FIELDS, Points, refuse_unknown
from brdfdb_api.responses import (
    NPY,
    Catalogue,
    Health,
    Lookup,
    Material,
    Problem,
    RequestError,
    json_response,
    npy_response,
)

if TYPE_CHECKING:
    from brdfdb.lookup import Table
    from brdfdb.store import Store

T = TypeVar("T")

INLINE_VALUES = 500  # looking up more numbers happens in a thread, so that the event loop serves others meanwhile
INLINE_BYTES = 32 * 2**10  # the same for reading a body; 500 points are about this long
LIMITS = {"json": (1, 100), "npy": (100, 1000)}  # points, and numbers, in one answer, as multiples of max_points

ANGLE_SCHEMA = {"anyOf": [{"type": "number"}, {"type": "array", "items": {}}]}
BODY = {
    "description": "Angles in degrees, numbers or nested lists of numbers that broadcast as numpy arrays do.",
    "required": True,
    "content": {
        "application/json": {
            "schema": {
                "type": "object",
                "required": ["theta_i", "theta_r"],
                "additionalProperties": False,
                "properties": {
                    "theta_i": {**ANGLE_SCHEMA, "description": "polar angle of the light [degrees], 0 to 180"},
                    "phi_i": {**ANGLE_SCHEMA, "description": "azimuth of the light [degrees]", "default": 0},
                    "theta_r": {**ANGLE_SCHEMA, "description": "polar angle of the viewer [degrees], 0 to 180"},
                    "phi_r": {**ANGLE_SCHEMA, "description": "azimuth of the viewer [degrees]", "default": 0},
                    "wavelength_nm": {
                        "anyOf": [
                            {"type": "number"},
                            {"type": "array", "items": {"type": "number"}, "minItems": 1},
                            {"type": "null"},
                        ],
                        "description": "wavelengths [nm]; missing or null: every wavelength of the table",
                    },
                },
            },
            "example": {"theta_i": 45, "theta_r": [0, 30, 60], "phi_r": 180},
        }
    },
}

Theta = Annotated[float, Query(description="polar angle [degrees]", json_schema_extra={"minimum": 0, "maximum": 180})]
Phi = Annotated[float, Query(description="azimuth [degrees], any finite number; phi_r - phi_i = 180 is the mirror")]
Wavelengths = Annotated[list[float] | None, Query(description="wavelength [nm], repeatable; missing: all of the table")]
Format = Annotated[
    Literal["json", "npy"] | None, Query(description=f"missing: npy if the Accept header names {NPY}, else json")
]


def answers(model: type, *statuses: int, npy: bool = False) -> dict[int | str, dict[str, Any]]:
    """What OpenAPI says of the responses of a route: `model` at 200, and `statuses`."""
    others: dict[int, dict[str, Any]] = {
        304: {"description": "The ETag in If-None-Match still holds"},
        404: {"description": "No such material; the closest names are listed", "model": Problem},
        413: {"description": "Too large a body, or too many points for one answer", "model": Problem},
        422: {"description": "A parameter is missing, unknown or out of range; it is named", "model": Problem},
        503: {"description": "The store cannot be read", "model": Problem},
    }
    success: dict[str, Any] = {"description": "Success", "model": model}
    if npy:
        schema = {"type": "string", "format": "binary", "description": "brdf alone, as a .npy file"}
        success["content"] = {NPY: {"schema": schema}}
    return {200: success, **{status: others[status] for status in statuses}}


def query_names(*allowed: str) -> Any:
    """A dependency that refuses query parameters that are not `allowed`, and any but wavelength_nm given twice."""

    async def check(request: Request) -> None:
        seen = set()
        for name, _ in request.query_params.multi_items():
            refuse_unknown(name, allowed)
            if name in seen and name != "wavelength_nm":
                raise RequestError(422, f"{name}: given more than once", name)
            seen.add(name)

    return Depends(check)


router = APIRouter()


@router.get("/healthz", tags=["service"], responses=answers(Health, 503))
def health(request: Request) -> Response:
    """Whether the store can be read, and how many materials it holds."""
    return json_response({"status": "ok", "materials": len(store_of(request))})


@router.get("/v1/materials", tags=["materials"], dependencies=[query_names()], responses=answers(Catalogue, 422, 503))
def catalogue(request: Request) -> Response:
    """Every material of the store, sorted by name."""
    store = store_of(request)
    return json_response({"materials": [summary(store, name) for name in store]})


@router.get(
    "/v1/materials/{name}",
    tags=["materials"],
    dependencies=[query_names()],
    responses=answers(Material, 304, 404, 422, 503),
)
def material(request: Request, name: str) -> Response:
    """Where the table of a material comes from, and where it is sampled (axes in degrees)."""
    store = store_of(request)
    if held := not_modified(request, store, name, "json"):
        return held
    table = store[name]
    here = f"/v1/materials/{table.name}"
    document = {
        "name": table.name,
        "revision": table.revision,
        "anisotropic": table.anisotropic,
        "wavelength_nm": table.wavelength_nm,
        "axes_deg": {axis: np.ascontiguousarray(values) for axis, values in table.axes_deg.items()},
        "specular": table.specular is not None,
        "attributes": dict(table.attrs),
        "links": {"self": here, "lookup": f"{here}/lookup", "materials": "/v1/materials"},
    }
    return json_response(document, head_headers(table.name, table.revision, "json"))


@router.get(
    "/v1/materials/{name}/lookup",
    tags=["lookup"],
    dependencies=[query_names(*FIELDS, "format")],
    responses=answers(Lookup, 304, 404, 413, 422, 503, npy=True),
)
async def lookup_point(
    request: Request,
    name: str,
    theta_i: Theta,
    theta_r: Theta,
    phi_i: Phi = 0.0,
    phi_r: Phi = 0.0,
    wavelength_nm: Wavelengths = None,
    format: Format = None,
) -> Response:
    """The BRDF of one pair of directions (angles in degrees): a number, or a list where there are several wavelengths.

    Index i is the light, r the viewer. Below the horizon (theta above 90 degrees) the BRDF is 0.
    """
    fields = {"theta_i": theta_i, "phi_i": phi_i, "theta_r": theta_r, "phi_r": phi_r}
    wavelengths = wavelength_nm[0] if wavelength_nm and len(wavelength_nm) == 1 else wavelength_nm
    points = Points.from_fields({**fields, "wavelength_nm": wavelengths})
    store, kind = store_of(request), answer_kind(request, format)
    if held := not_modified(request, store, name, kind):
        return held
    return await answer(request, points, store[name], kind)


@router.post(
    "/v1/materials/{name}/lookup",
    tags=["lookup"],
    dependencies=[query_names("format")],
    responses=answers(Lookup, 404, 413, 422, 503, npy=True),
    openapi_extra={"requestBody": BODY},
)
async def lookup_points(request: Request, name: str, format: Format = None) -> Response:
    """The BRDF of many pairs of directions (angles in degrees): an array of the shape that the angles broadcast to.

    The wavelengths are a last axis, unless wavelength_nm is one number or the material is grey. Below the horizon
    (theta above 90 degrees) the BRDF is 0.
    """
    table = store_of(request)[name]
    body = await request.body()
    points = await run(Points.from_json, body, in_thread=len(body) > INLINE_BYTES)
    return await answer(request, points, table, answer_kind(request, format))


def store_of(request: Request) -> Store:
    """The store of the application, opened when it is first needed; a StoreError where that is not possible."""
    state = request.app.state
    if state.store is None:
        state.store = brdfdb.open(state.settings.store)
    store: Store = state.store
    return store


def summary(store: Store, name: str) -> dict[str, Any]:
    """One line of the catalogue, from the attributes alone: no table is decoded for it."""
    attributes = store.attributes(name)
    return {
        "name": name,
        "title": attributes["title"],
        "model": attributes["model"],
        "anisotropic": attributes["anisotropic"],
        "wavelength_range_nm": attributes["wavelength_range_nm"] or None,
        "revision": store.head(name),
        "href": f"/v1/materials/{name}",
    }


def head_headers(name: str, revision: str, kind: str) -> dict[str, str]:
    """Headers of an answer that changes when the material gets a new revision."""
    tag = f"{name}-{revision}" if kind == "json" else f"{name}-{revision}-{kind}"
    return {"ETag": f'"{tag}"', "Cache-Control": "no-cache", "Vary": "Accept"}


def not_modified(request: Request, store: Store, name: str, kind: str) -> Response | None:
    """The 304 of a client that already holds this answer, None for any other."""
    held = request.headers.get("if-none-match")
    if held is None:
        return None
    headers = head_headers(name, store.head(name), kind)
    tags = [tag.strip().removeprefix("W/") for tag in held.split(",")]
    return Response(status_code=304, headers=headers) if headers["ETag"] in tags or "*" in tags else None


def answer_kind(request: Request, format: str | None) -> str:
    """json or npy: `format` decides, without it the Accept header."""
    return format or ("npy" if NPY in request.headers.get("accept", "") else "json")


async def run(function: Callable[..., T], *args: Any, in_thread: bool) -> T:
    """Call `function`, in a thread where that pays: it costs about as long as 500 values do."""
    return await run_in_threadpool(function, *args) if in_thread else function(*args)


async def answer(request: Request, points: Points, table: Table, kind: str) -> Response:
    """Look the points up and write them as `kind`; a RequestError (413) where they are too many for one answer."""
    max_points, max_values = (factor * request.app.state.settings.max_points for factor in LIMITS[kind])
    if points.count > max_points:
        raise RequestError(413, f"{points.count} points are more than the {max_points} that one {kind} answer may hold")
    values = points.values(table)
    if values > max_values:
        raise RequestError(413, f"{values} values are more than the {max_values} that one {kind} answer may hold")
    return await run(write_answer, points, table, kind, in_thread=values > INLINE_VALUES)


def write_answer(points: Points, table: Table, kind: str) -> Response:
    """Look the points up and write them as `kind`."""
    headers = head_headers(table.name, table.revision, kind)
    brdf = points.brdf(table)
    if kind == "npy":
        return npy_response(brdf, headers)
    document = {
        "material": table.name,
        "revision": table.revision,
        "unit": "1/sr",
        "wavelength_nm": points.wavelengths(table),
        "brdf": plain(brdf),
        "specular_reflectance": plain(points.specular_reflectance(table)),
    }
    return json_response(document, headers)


def plain(array: NDArray[Any]) -> Any:
    """What orjson can write: a number for a 0-d array, contiguous memory for any other."""
    return array.item() if array.ndim == 0 else np.ascontiguousarray(array)
