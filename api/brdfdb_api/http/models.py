"""The addresses under /v1/models and /v1/families: values at the parameters of a request."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
from fastapi import Depends
from fastapi import Query as InQuery
from pydantic import ConfigDict, Field
from starlette.requests import Request
from starlette.responses import Response

from brdfdb.errors import UnknownModelError
from brdfdb.materials.model_document import Parameters, document_of
from brdfdb.materials.spectrum import Spectrum
from brdfdb.models import MODELS
from brdfdb.parameters import ModelSpec
from brdfdb.spectra import PICTURE_NM
from brdfdb.store.family import FamilyLine
from brdfdb.tables.albedo import reflected_by
from brdfdb.tables.evaluation import LookupSubject, PointsBody
from brdfdb.tables.values_document import FamilyLookup, ModelAlbedo, ModelLobe, ModelLookup
from brdfdb_api.http.addresses import NPY_ANSWER, Content, addresses, answers, body, shelf_of
from brdfdb_api.http.errors import refused
from brdfdb_api.http.lookups import LARGE, RequestedPoints, looked_up
from brdfdb_api.http.queries import Flag, LobeOptions, Options, Query, Wavelengths, from_json
from brdfdb_api.http.responses import NO_STORE, NPY, Document, Families, Model, Models
from brdfdb_api.http.views import SPHERE, SphereQuery, lobe_answer, sphere_answer

models = addresses()


class PointsAt(PointsBody, Parameters):
    """A material as recipes define it, and the points to look up."""

    model_config = ConfigDict(
        json_schema_extra={"example": {"parameters": {"rho": 0.5}, "theta_i": 45, "theta_r": [0, 30]}}
    )


class PointsOfFamily(PointsBody):
    """Parameters between those of the members of a family, and the points to look up."""

    parameters: dict[str, float] = Field(description="value of each swept parameter, in the units of recipes")


class FamilyQuery(Options):
    """The query of a lookup in a family."""

    error: Flag = Field(default=False, description="add the error that the family states")


def _spec(model: str) -> ModelSpec:
    if model not in MODELS:
        raise UnknownModelError(model, MODELS)
    return MODELS[model]


Spec = Annotated[ModelSpec, Depends(_spec)]


@models.get("/v1/models", tags=["models"], responses=answers(Models))
def model_list() -> Response:
    """Return all models and their parameters, with units, ranges and published values."""
    return Document({"models": [_with_address(spec) for spec in MODELS.values()]})


@models.get("/v1/models/{model}", tags=["models"], responses=answers(Model, 404))
def model_document(spec: Spec) -> Response:
    """Return one model."""
    return Document(_with_address(spec))


def _with_address(spec: ModelSpec) -> dict[str, Any]:
    return {**document_of(spec), "href": f"/v1/models/{spec.name}"}


class ModelSurface(NamedTuple):
    """A model at the parameters of a request, and the fields that begin its documents."""

    surface: LookupSubject
    about: dict[str, Any]


def _surface(spec: ModelSpec, given: Parameters) -> ModelSurface:
    """Return the model at the parameters of a request, by default at the wavelengths of pictures."""
    with refused():
        material = given.material(spec)
    written = {
        name: value.model_dump(mode="json") if isinstance(value, Spectrum) else value
        for name, value in material.file_parameters().items()
    }
    about = {"model": spec.name, "model_version": spec.version, "parameters": written}
    return ModelSurface(LookupSubject(material, "model", PICTURE_NM if material.spectral else None), about)


@models.post(
    "/v1/models/{model}/lookup",
    tags=["models"],
    responses=answers(ModelLookup, 404, 413, 415, 503, media=NPY_ANSWER),
    openapi_extra=body(PointsAt),
)
async def model_lookup(
    request: Request, spec: Spec, query: Annotated[Options, InQuery()], content: Content
) -> Response:
    """Return the BRDF of a model at the given parameters and many pairs of directions (angles in degrees).

    Without wavelength_nm, a spectral model is evaluated from 420 to 680 nm in steps of 20 nm.
    """

    def read() -> RequestedPoints:
        given = from_json(PointsAt, content)
        surface, about = _surface(spec, given)
        return RequestedPoints(surface, given.points, about)

    return await looked_up(request, query, len(content), read)


@models.post(
    "/v1/models/{model}/lobe",
    tags=["models"],
    responses=answers(ModelLobe, 404, 413, 415, 503, media={NPY: "brdf as a .npy file"}),
    openapi_extra=body(Parameters),
)
def model_lobe(request: Request, spec: Spec, query: Annotated[LobeOptions, InQuery()], content: Content) -> Response:
    """Return f_r [1/sr] of a model for one light, in the same views as for a material.

    After an installation, the first request for a model may take 20 s, because its kernels are compiled.
    """
    surface, about = _surface(spec, from_json(Parameters, content))
    return lobe_answer(request, surface, query, about, NO_STORE)


class WavelengthQuery(Query):
    """The query of an albedo."""

    wavelength_nm: Wavelengths = ()


@models.post(
    "/v1/models/{model}/albedo",
    tags=["models"],
    responses=answers(ModelAlbedo, 404, 413, 415, 503),
    openapi_extra=body(Parameters),
)
def model_albedo(spec: Spec, query: Annotated[WavelengthQuery, InQuery()], content: Content) -> Response:
    """Return the directional and the hemispherical albedo [1] of a model, to 0.001."""
    surface, about = _surface(spec, from_json(Parameters, content))
    at = surface.wavelength_nm
    if at is not None and query.wavelength_nm:
        at = np.array(query.wavelength_nm)
    with refused():
        return Document(about | reflected_by(surface.source, at).document(at), NO_STORE)


@models.post(
    "/v1/models/{model}/sphere",
    tags=["models"],
    responses=answers(None, 404, 413, 415, 503, media=SPHERE),
    openapi_extra=body(Parameters),
    dependencies=[LARGE],
)
def model_sphere(spec: Spec, query: Annotated[SphereQuery, InQuery()], content: Content) -> Response:
    """Return a draft picture of a sphere of a model in studio light."""
    with refused():
        return sphere_answer(from_json(Parameters, content).material(spec), query, NO_STORE)


@models.get("/v1/families", tags=["models"], responses=answers(Families, 503))
def family_list(request: Request) -> Response:
    """Return the families of the store: materials of one model, between whose parameters lookups interpolate."""
    store = shelf_of(request).store
    contents = (store.family_content(name) for name in store.families())
    shown = ({key: content[key] for key in FamilyLine.model_fields} for content in contents)
    return Document({"families": list(shown)})


@models.post(
    "/v1/families/{family}/lookup",
    tags=["models"],
    responses=answers(FamilyLookup, 404, 413, 415, 503, media=NPY_ANSWER),
    openapi_extra=body(PointsOfFamily),
)
async def family_lookup(
    request: Request, family: str, query: Annotated[FamilyQuery, InQuery()], content: Content
) -> Response:
    """Return the BRDF of a family at parameters between those of its members, interpolated between their tables."""

    def read() -> RequestedPoints:
        given = from_json(PointsOfFamily, content)
        with refused():
            surface = shelf_of(request).store.family(family).surface(given.parameters)
        return RequestedPoints(surface, given.points, {"family": family, "parameters": given.parameters})

    return await looked_up(request, query, len(content), read)
