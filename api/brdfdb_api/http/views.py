"""Views of a material for pages and reports: albedos, lobes, files of other formats, and the findings of the audit."""

from __future__ import annotations

import asyncio
import io
import tempfile
import zipfile
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Any, Literal
from weakref import WeakKeyDictionary

import numpy as np
from fastapi import APIRouter, Path, Query
from numpy.typing import NDArray
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from brdfdb import __version__
from brdfdb.errors import CannotHoldError, ParameterError
from brdfdb.formats import EXPORTERS
from brdfdb.geometry import radians
from brdfdb.store.summary_words import NOT_AUDITED
from brdfdb_api.http.errors import RequestError
from brdfdb_api.http.lookups import Options, Points, evaluate, parsed
from brdfdb_api.http.openapi_notes import (
    EXPORT_OPTIONS,
    LOBE_NPY_ANSWER,
    LOBE_OPTIONS,
    WAVELENGTHS,
    answers,
    served_options,
)
from brdfdb_api.http.responses import (
    JSON,
    NPY,
    Albedo,
    Audit,
    Lobe,
    cache_headers,
    json_bytes,
    json_response,
    not_modified,
    npy_bytes,
    plain,
    tag_of,
)
from brdfdb_api.http.routes import EXPORT_WAIT_S, both, checked_size, query_names, shelf_of

if TYPE_CHECKING:
    from brdfdb.tables.table import Table
    from brdfdb_api.serving.shelf import Shelf

View = Literal["cut", "hemisphere", "half-difference"]

_CUT = np.arange(-90.0, 91.0)  # theta_r [degree], negative back towards the light
_OVER = np.linspace(0.0, 90.0, 31)  # theta_r of a hemisphere [degree]
_AROUND = np.linspace(0.0, 360.0, 61)  # delta_phi
# Angles from the mirror direction [degree]
_NEAR = np.array([-12.0, -8.0, -5.0, -3.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0])
_HALF = np.arange(90) + 0.5  # theta_h and theta_d [degree]
_POINTS = _HALF.size**2  # points of the largest view

_LOBE = ("view", "theta_i", "phi_i", "wavelength_nm", "from", "output", "illuminant", "format")

_ALBEDOS: WeakKeyDictionary[Table, bytes] = WeakKeyDictionary()  # kept as long as the table

views = APIRouter()

Incidence = Annotated[float, Query(ge=0.0, le=90.0, description="polar angle of the light [degrees]")]
Azimuth = Annotated[float, Query(ge=-720.0, le=720.0, description="azimuth of the light [degrees]")]


@both(
    "/albedo",
    router=views,
    tags=["views"],
    dependencies=[query_names()],
    responses=answers(Albedo, 304, 404, 422, 503),
)
def albedo(request: Request, name: str, revision: str | None = None) -> Response:
    """Return the directional and the hemispherical albedo [1] of the table."""
    table = shelf_of(request).table(name, revision)
    headers = cache_headers(tag_of(table), immutable=revision is not None)
    if held := not_modified(request.headers.get("if-none-match"), headers):
        return held
    document = _ALBEDOS.get(table)
    if document is None:
        document = _ALBEDOS[table] = _albedo(table)
    return Response(document, media_type=JSON, headers=headers)


def _albedo(table: Table) -> bytes:
    """Return the document; the integration takes a third of a second."""
    from brdfdb.tables.albedo import directional_albedo, hemispherical_albedo

    albedo = directional_albedo(table)
    diffuse = albedo.mean
    specular = np.asarray(table.specular_reflectance(radians(albedo.theta_i_deg))).reshape(diffuse.shape[0], -1)
    specular = np.broadcast_to(specular, diffuse.shape)
    return json_bytes(
        {
            "material": table.name,
            "revision": table.revision,
            "wavelength_nm": table.wavelength_nm,
            "theta_i": np.ascontiguousarray(albedo.theta_i_deg),
            "albedo": np.ascontiguousarray(diffuse),
            "specular_reflectance": np.ascontiguousarray(specular),
            "hemispherical": hemispherical_albedo(albedo.theta_i_deg, diffuse + specular),
            "error": float(albedo.error.max()),
        }
    )


@both(
    "/lobe",
    router=views,
    tags=["views"],
    responses=answers(Lobe, 304, 404, 413, 422, 503, media=LOBE_NPY_ANSWER),
    openapi_extra={"parameters": [WAVELENGTHS, *LOBE_OPTIONS]},
)
def lobe(
    request: Request,
    name: str,
    view: Annotated[View, Query(description="the plane of incidence, all viewers, or theta_h and theta_d")] = "cut",
    theta_i: Incidence = 45.0,
    phi_i: Azimuth = 0.0,
    revision: str | None = None,
) -> Response:
    """Return f_r [1/sr] for one light, in the plane of incidence or over all viewers; or over theta_h and theta_d.

    Viewers are closer together around the mirror direction. In half-difference, phi_h is phi_i and phi_d is 90 degrees.
    """
    query, wavelengths = parsed(request.scope["query_string"], _LOBE)
    options = Options.from_query(query)
    table = shelf_of(request).table(name, revision)
    kind = options.format or ("npy" if NPY in request.headers.get("accept", "") else "json")
    headers = cache_headers(tag_of(table), kind, immutable=revision is not None)
    held = request.headers.get("if-none-match")
    if unchanged := not_modified(held, headers, certain=False):
        return unchanged
    axes, angles = _directions(view, theta_i, phi_i)
    at = Points.from_query({"theta_i": "0", "theta_r": "0"}, wavelengths).wavelength_nm
    points = Points(angles, np.broadcast_shapes(*(np.shape(angle) for angle in angles)), at)
    # The view fixes the points; the client chooses only the wavelengths.
    checked_size(max(request.app.state.settings.max_points, _POINTS), points, options, table, kind)
    values = evaluate(points, options, table)
    if unchanged := not_modified(held, headers):
        return unchanged
    if kind == "npy":
        return Response(npy_bytes(values.brdf), media_type=NPY, headers=headers)
    document = {
        "material": table.name,
        "revision": table.revision,
        "source": options.source,
        "view": view,
        "theta_i": None if view == "half-difference" else theta_i,
        "phi_i": phi_i,
        "output": options.output,
        "illuminant": None if options.output == "spectrum" else options.illuminant,
        "unit": "1/sr",
        "wavelength_nm": points.wavelengths(table),
        "axes_deg": axes,
        "brdf": plain(values.brdf),
        "extrapolated": None if table.metadata.measured is None else plain(table.extrapolated(*angles)),
        "specular_reflectance": None if view == "half-difference" else plain(values.specular_reflectance),
    }
    return json_response(document, headers)


def _directions(view: View, theta_i: float, phi_i: float) -> tuple[dict[str, NDArray[Any]], Any]:
    """Return the axes of a view [degree] and the angles of its points [rad]."""
    if view == "half-difference":
        from brdfdb.geometry import directions_from_half_difference

        theta_h, theta_d = radians(_HALF)[:, np.newaxis], radians(_HALF)
        points = directions_from_half_difference(theta_h, radians(phi_i), theta_d, radians(90.0))
        return {"theta_h": _HALF, "theta_d": _HALF}, points
    light, turned = radians(theta_i), radians(phi_i)
    if view == "cut":
        signed = np.unique(np.clip(np.concatenate([_CUT, theta_i + _NEAR]), -90.0, 90.0))
        return {"theta_r": signed}, (
            light,
            turned,
            radians(np.abs(signed)),
            turned + np.where(signed > 0.0, np.pi, 0.0),
        )
    theta_r = np.unique(np.clip(np.concatenate([_OVER, theta_i + _NEAR]), 0.0, 90.0))
    spread = _NEAR / max(np.sin(light), 0.1)
    delta_phi = np.unique(np.clip(np.concatenate([_AROUND, 180.0 + spread]), 0.0, 360.0))
    axes = {"theta_r": theta_r, "delta_phi": delta_phi}
    return axes, (light, turned, radians(theta_r)[:, np.newaxis], turned + radians(delta_phi))


@both(
    "/export/{file_format}",
    router=views,
    tags=["views"],
    responses=answers(
        None, 304, 404, 422, 503, media={exporter.media_type: exporter.summary for exporter in EXPORTERS.values()}
    ),
    openapi_extra={"parameters": EXPORT_OPTIONS},
)
async def export(
    request: Request,
    name: str,
    file_format: Annotated[str, Path(json_schema_extra={"enum": [*EXPORTERS]})],
    revision: str | None = None,
) -> Response:
    """Return the table, or a slice of it, as a file of another format, as `brdfdb export` writes it."""
    if file_format not in EXPORTERS:
        raise RequestError(404, f"{file_format!r} is no format; there are {', '.join(EXPORTERS)}")
    allowed = served_options(file_format)
    query, _ = parsed(request.scope["query_string"], tuple(allowed))
    try:
        options = {option: allowed[option].parse(text) for option, text in query.items()}
    except ParameterError as error:
        raise RequestError(422, str(error), error.parameter) from None
    table, verdict = await run_in_threadpool(_with_verdict, shelf_of(request), name, revision)
    # The file states the verdict, which a later audit may change, and the program. A weak tag: some state the time
    headers = cache_headers(f"{tag_of(table)}-{verdict}-{__version__}", file_format)
    headers["ETag"] = f"W/{headers['ETag']}"
    held = request.headers.get("if-none-match")
    if unchanged := not_modified(held, headers, certain=False):
        return unchanged
    exports = request.app.state.exports
    try:
        async with asyncio.timeout(EXPORT_WAIT_S):
            await exports.acquire()
    except TimeoutError:
        raise RequestError(
            503, "the server makes as many files as it can; ask again later", retry_after_s=EXPORT_WAIT_S
        ) from None
    try:
        answer = await run_in_threadpool(_exported, file_format, table, verdict, options, headers)
    finally:
        exports.release()
    return not_modified(held, headers) or answer


def _with_verdict(shelf: Shelf, name: str, revision: str | None) -> tuple[Table, str | None]:
    """Return a table, and the verdict of the audit of its revision."""
    table, known = shelf.table(name, revision), shelf.verdict(name)
    return table, known.finding["verdict"] if known and known.finding["revision"] == table.revision else None


def _exported(
    file_format: str, table: Table, verdict: str | None, options: dict[str, Any], headers: dict[str, str]
) -> Response:
    """Return a file of another format, or an archive of several, with these headers and its name."""
    exporter = EXPORTERS[file_format]
    kind = f"_{options.get('kind', exporter.kinds[0])}" if exporter.kinds else ""
    with tempfile.TemporaryDirectory() as folder:  # formats write files
        path = FilePath(folder) / f"{table.name}{kind}{exporter.suffix}"
        try:
            written = exporter.write(table, path, verdict=verdict or NOT_AUDITED, **options)
        except (CannotHoldError, ParameterError) as error:
            raise RequestError(422, str(error), getattr(error, "parameter", None)) from None
        single = len(written.paths) == 1 and path.is_file()
        content = path.read_bytes() if single else _zipped(FilePath(folder))
    media_type = exporter.media_type if single else "application/zip"
    named = {"Content-Disposition": f'attachment; filename="{path.name}{"" if single else ".zip"}"'}
    return Response(content, media_type=media_type, headers=headers | named)


def _zipped(folder: FilePath) -> bytes:
    """Return all files of a folder as a zip archive."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            archive.write(path, path.relative_to(folder))
    return data.getvalue()


@both(
    "/audit", router=views, tags=["views"], dependencies=[query_names()], responses=answers(Audit, 304, 404, 422, 503)
)
def audit(request: Request, name: str, revision: str | None = None) -> Response:
    """Return the findings of the last `brdfdb audit` on a material: energy, reciprocity, error and more."""
    shelf = shelf_of(request)
    verdict, current = shelf.verdict(name), shelf.head(name)
    if verdict is None or revision not in (None, verdict.finding["revision"]):
        if revision not in (None, current):
            shelf.table(name, revision)  # raises if there is no such revision
        raise RequestError(404, f"{name}: no audit of it is here; `brdfdb audit` makes one")
    headers = cache_headers(f"{name}-{current}-{verdict.when}")
    if held := not_modified(request.headers.get("if-none-match"), headers):
        return held
    document = {
        "material": name,
        "revision": verdict.finding["revision"],
        "current": verdict.finding["revision"] == current,
        "when": verdict.when,
        "finding": verdict.finding,
    }
    return json_response(document, headers)
