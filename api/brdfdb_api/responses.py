"""What goes out: problem+json, JSON through orjson, .npy bytes, and the documents that OpenAPI describes."""

from __future__ import annotations

import io
from collections.abc import Sequence
from http import HTTPStatus
from typing import Annotated, Any

import numpy as np
import orjson
from numpy.typing import NDArray
from pydantic import BaseModel, Field, WithJsonSchema
from starlette.responses import Response

PROBLEM_JSON = "application/problem+json"
NPY = "application/x-npy"

# The phrases of RFC 9110; those of http.HTTPStatus change from one Python to the next.
TITLES = {413: "Content Too Large", 422: "Unprocessable Content"}


class RequestError(Exception):
    """A request that is not answered, in one sentence.

    Parameters
    ----------
    status : int
        The HTTP status.
    detail : str
        The sentence.
    parameter : str, optional
        The parameter that is at fault.
    """

    def __init__(self, status: int, detail: str, parameter: str | None = None) -> None:
        super().__init__(detail)
        self.status = status
        self.parameter = parameter


class Problem(BaseModel):
    """An error (RFC 9457)."""

    type: str = Field(description="about:blank: the status says which kind of error this is")
    title: str
    status: int
    detail: str = Field(description="one sentence; an error of a parameter starts with its name")
    parameter: str = Field(default="", description="the parameter at fault, where there is one")
    closest: list[str] = Field(default=[], description="for an unknown material: the names most like it")


class Health(BaseModel):
    """The store can be read."""

    status: str
    materials: int = Field(description="number of materials in the store")


class Summary(BaseModel):
    """One line of the catalogue."""

    name: str
    title: str
    model: str
    anisotropic: bool
    wavelength_range_nm: list[float] | None = Field(description="first and last wavelength [nm]; null: grey")
    revision: str
    href: str


class Catalogue(BaseModel):
    """Every material of the store, sorted by name."""

    materials: list[Summary]


class Material(BaseModel):
    """One material: where its table comes from and where it is sampled."""

    name: str
    revision: str
    anisotropic: bool
    wavelength_nm: list[float] | None = Field(description="wavelengths [nm]; null: grey")
    axes_deg: dict[str, list[float]] = Field(description="the grid of the table [degrees]")
    specular: bool = Field(description="whether there is a Dirac part: specular_reflectance is not 0 everywhere")
    attributes: Annotated[dict[str, Any], WithJsonSchema({"type": "object"})] = Field(
        description="title, model, parameters, source and all else the table records"
    )
    links: dict[str, str]


class Lookup(BaseModel):
    """Values of a BRDF."""

    material: str
    revision: str
    unit: str = Field(description="unit of brdf: 1/sr")
    wavelength_nm: float | list[float] | None = Field(description="wavelengths of the last axis [nm]; null: grey")
    brdf: float | list[Any] = Field(
        description="shape of the broadcast angles, then the wavelengths unless they are one number or null"
    )
    specular_reflectance: float | list[Any] = Field(
        description="Dirac part, a reflectance without unit that is not in brdf: shape of theta_i, then the wavelengths"
    )


def json_response(document: dict[str, Any], headers: dict[str, str] | None = None) -> Response:
    """A JSON answer; numpy arrays may stand anywhere in `document` except as 0-d arrays."""
    content = orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY)
    return Response(content, media_type="application/json", headers=headers)


def npy_response(array: NDArray[Any], headers: dict[str, str] | None = None) -> Response:
    """An array as the bytes of a .npy file."""
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    return Response(buffer.getvalue(), media_type=NPY, headers=headers)


def problem_response(
    status: int,
    detail: str,
    parameter: str | None = None,
    closest: Sequence[str] | None = None,
    headers: dict[str, str] | None = None,
) -> Response:
    """An error as application/problem+json, with the members `parameter` and `closest` where they are known."""
    problem: dict[str, Any] = {
        "type": "about:blank",
        "title": TITLES.get(status) or HTTPStatus(status).phrase,
        "status": status,
        "detail": detail,
    }
    if parameter is not None:
        problem["parameter"] = parameter
    if closest is not None:
        problem["closest"] = list(closest)
    return Response(orjson.dumps(problem), status_code=status, media_type=PROBLEM_JSON, headers=headers)
