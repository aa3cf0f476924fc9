"""The contents of requests: typed query parameters, and points from JSON and .npy in degrees."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Sequence
from typing import Annotated, Any, Literal, TypeVar
from urllib.parse import parse_qsl

import orjson
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    Strict,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    field_validator,
)
from starlette.requests import Request

from brdfdb.geometry import AZIMUTH_MOST_DEG
from brdfdb.tables.evaluation import (
    TURN,
    LookupPoints,
    Output,
    PointsBody,
    ViewName,
    fields_of_npy,
    listed,
    read_stokes,
)
from brdfdb_api.http.errors import RequestError, refusal_of, refused
from brdfdb_api.http.responses import JSON, NPY, preferred

JSON_BYTES = 8 * 2**20  # largest JSON body [byte]; lists of numbers need twenty times the memory of their text

Format = Literal["json", "npy"]
M = TypeVar("M", bound=BaseModel)


def _digits(value: object) -> object:
    if isinstance(value, str) and "_" in value:  # Python reads 1_0 as 10
        raise ValueError(f"{shortened(value)!r} is not a finite number")
    return value


def _radians(angle: float) -> float:
    return math.radians(math.fmod(angle, TURN))


Finite = Annotated[float, Field(allow_inf_nan=False), BeforeValidator(_digits)]
Polar = Annotated[Finite, Field(ge=0.0, le=180.0)]
Azimuth = Annotated[Finite, Field(ge=-AZIMUTH_MOST_DEG, le=AZIMUTH_MOST_DEG)]
Flag = Annotated[bool, BeforeValidator(lambda text: {"true": True, "false": False}.get(text, text)), Strict()]
Stokes = Annotated[Any, PlainValidator(read_stokes), WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "null"}]})]
Wavelengths = Annotated[tuple[Finite, ...], Field(description="wavelength [nm], repeatable; missing: all wavelengths")]


class Query(BaseModel):
    """The parameters of a query; `Address` refuses any other."""

    model_config = ConfigDict(frozen=True)


class Options(Query):
    """The form of values: spectra or colours, as JSON or .npy."""

    output: Output = Field(default="spectrum", description="colours are in 1/sr, like f_r; white has Y = 1/pi")
    illuminant: str | None = Field(
        default=None, description="illuminant of a colour, a name of colour-science such as A or FL2; missing: D65"
    )
    format: Format | None = Field(
        default=None, description=f"missing: {NPY} or JSON as the Accept header prefers, else the format of the body"
    )

    @field_validator("illuminant")
    @classmethod
    def _of_a_colour(cls, name: str | None, info: ValidationInfo) -> str | None:
        if info.data.get("output") == "spectrum":
            raise ValueError("a spectrum has no illuminant; set output to xyz or linear-srgb")
        return name

    def kind(self, accept: str, *, binary: bool = False) -> Format:
        """Return the format of the answer to a request with this Accept header, and a body that is .npy or not."""
        if self.format is not None:
            return self.format
        offers = (NPY, JSON) if binary else (JSON, NPY)
        return "npy" if preferred(accept, *offers) == NPY else "json"


class TableOptions(Options):
    """The form of values of a table or of its model; tables also have stated errors and reflected Stokes vectors."""

    source: Literal["table", "model"] = Field(
        default="table", alias="from", description="the table, or the model that it was made from"
    )
    error: Flag = Field(
        default=False, description="add the error that the table states; in .npy, brdf and error are a first axis"
    )
    stokes: Stokes = Field(
        default=None,
        description="incident Stokes vector I,Q,U,V: the answer of a polarised table has the reflected Stokes vector; "
        ".npy has it in place of f_r, along a last axis",
    )

    @field_validator("error")
    @classmethod
    def _of_the_table(cls, error: bool, info: ValidationInfo) -> bool:
        if error and info.data.get("source") == "model":
            raise ValueError("a model states no error; set from=table")
        return error

    @field_validator("stokes")
    @classmethod
    def _of_light(cls, stokes: Any, info: ValidationInfo) -> Any:
        if stokes and (info.data.get("source") == "model" or info.data.get("output") != "spectrum"):
            raise ValueError("needs from=table and output=spectrum")
        return stokes

    def kind(self, accept: str, *, binary: bool = False) -> Format:
        kind = super().kind(accept, binary=binary)
        if kind == "npy" and self.stokes and self.error:
            raise RequestError(422, "stokes: a .npy answer cannot have error=true, too", "stokes")
        return kind


class BodyQuery(TableOptions):
    """The query of a lookup whose points are in the body."""

    wavelength_nm: Wavelengths = Field(default=(), description="wavelength [nm] of a .npy body; JSON contains its own")


class ManyQuery(TableOptions):
    """The query of a lookup of many materials."""

    format: Literal["json", "npz"] = Field(
        default="json", description="npz has one array per material, by name, and NAME.error"
    )  # type: ignore[assignment]


class PointQuery(TableOptions):
    """The query of a lookup of one point."""

    wavelength_nm: Wavelengths = ()
    theta_i: Polar = Field(description="polar angle of the light [degrees]")
    phi_i: Azimuth = Field(default=0.0, description="azimuth of the light [degrees]")
    theta_r: Polar = Field(description="polar angle of the viewer [degrees]")
    phi_r: Azimuth = Field(
        default=0.0, description="azimuth of the viewer [degrees]; the mirror direction has phi_r - phi_i = 180"
    )

    @property
    def points(self) -> LookupPoints:
        """The point."""
        light = (_radians(self.theta_i), _radians(self.phi_i))
        viewer = (_radians(self.theta_r), _radians(self.phi_r))
        return LookupPoints((*light, *viewer), (), listed(self.wavelength_nm))


class LightQuery(Query):
    """The direction of one light, and a set of viewers."""

    view: ViewName = Field(default="cut", description="the plane of incidence, all viewers, or theta_h and theta_d")
    theta_i: Finite = Field(default=45.0, ge=0.0, le=90.0, description="polar angle of the light [degrees]")
    phi_i: Azimuth = Field(default=0.0, description="azimuth of the light [degrees]")
    wavelength_nm: Wavelengths = ()


class LobeQuery(LightQuery, TableOptions):
    """The query of a lobe of a table."""


class LobeOptions(LightQuery, Options):
    """The query of a lobe of a model."""


def accept_of(request: Request) -> str:
    """Return the header Accept, which may come in several lines."""
    return ",".join(request.headers.getlist("accept"))


class ManyBody(PointsBody):
    """Materials, and the points to look up in each of them."""

    model_config = ConfigDict(
        json_schema_extra={"example": {"materials": ["rolled-brass", "foam"], "theta_i": 45, "theta_r": [0, 30, 60]}}
    )

    materials: list[str] = Field(min_length=1, max_length=1000, description="names, each once")

    @field_validator("materials")
    @classmethod
    def _each_once(cls, names: list[str]) -> list[str]:
        for place, name in enumerate(names):
            if name in names[:place]:
                raise ValueError(f"{shortened(name)!r} is given more than once")
        return names


def from_json(model: type[M], body: bytes) -> M:
    """Return a JSON body as a model; RequestError (422, 413) if it is not valid, which repeats only names and numbers.

    NaN and Infinity, which some clients write, are not JSON. They are read so that the refusal names the parameter.
    """
    if len(body) > JSON_BYTES:
        raise RequestError(413, f"the JSON body is larger than {JSON_BYTES} bytes; send many points as {NPY}")
    try:
        fields = orjson.loads(body)
    except orjson.JSONDecodeError:
        try:
            fields = json.loads(body)
        except (ValueError, RecursionError):
            raise RequestError(422, "body: it is not valid JSON", "body") from None
    if not isinstance(fields, dict):
        raise RequestError(422, f"body: it is not a JSON object with {', '.join(model.model_fields)}", "body")
    return checked(model, fields)


def from_array(body: bytes, wavelengths: Sequence[float]) -> LookupPoints:
    """Return the points of a .npy body; RequestError (422) if it is not valid."""
    with refused():
        fields = fields_of_npy(body)
    return checked(PointsBody, fields | {"wavelength_nm": listed(wavelengths)}).points


def checked(model: type[M], fields: dict[str, Any]) -> M:
    """Return fields as a model; a refusal (422) names the first that is unknown, missing or not allowed."""
    try:
        return model.model_validate(fields)
    except ValidationError as error:
        for name in fields:
            if name not in (names := names_of(model)):
                raise unknown(name, names) from None
        raise refusal_of(error.errors(include_url=False)[0]) from None


def parsed(query: bytes, allowed: Collection[str]) -> dict[str, Any]:
    """Return the values of a query string by name; those of wavelength_nm, which may be repeated, are a list.

    Raises
    ------
    RequestError
        422, if a name is not allowed or is given twice.
    """
    text = query.decode("latin-1")
    if "%" in text or "+" in text:
        pairs = parse_qsl(text, keep_blank_values=True)
    else:
        pairs = [(name, value) for name, _, value in (part.partition("=") for part in text.split("&") if part)]
    fields: dict[str, Any] = {}
    for name, value in pairs:
        if name not in allowed:
            raise unknown(name, allowed)
        if name == "wavelength_nm":
            fields.setdefault(name, []).append(value)
        elif name in fields:
            raise RequestError(422, f"{name}: given more than once", name)
        else:
            fields[name] = value
    return fields


def names_of(kind: type) -> tuple[str, ...]:
    """Return the names of the parameters of a query."""
    fields = kind.model_fields if issubclass(kind, BaseModel) else {}
    return tuple(field.alias or name for name, field in fields.items())


def unknown(name: str, allowed: Collection[str]) -> RequestError:
    """Return the refusal (422) of a parameter that is not `allowed`, such as a misspelt one."""
    shown = shortened(name)
    return RequestError(422, f"{shown}: unknown parameter; allowed are {', '.join(allowed) or 'none'}", shown)


def shortened(text: str) -> str:
    """Return a text of the client as a sentence may repeat it: at most 40 characters, all of them ASCII."""
    return text.encode("ascii", "backslashreplace").decode()[:40]
