"""Answers as JSON and .npy, their headers, and the documents that OpenAPI describes."""

from __future__ import annotations

import contextlib
import functools
import io
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import orjson
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler
from pydantic_core import CoreSchema
from starlette.responses import Response

from brdfdb.materials.provenance import KnownExcess
from brdfdb.materials.spectrum import Spectrum
from brdfdb.measurements.record import Measured
from brdfdb.store.last_audit import ShownAnswer, ShownSentence
from brdfdb.tables.first_numbers import FormulaError, LargestAlbedo
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.stated_error import Error

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

JSON = "application/json"
NPY = "application/x-npy"
REVISION = "Brdfdb-Revision"  # header that names the revision of the values of a lookup


class Attributes(TableMetadata):
    """The attributes of a table; tables of other programs may lack any."""

    model_config = ConfigDict(json_schema_extra={"required": []})

    known_excess: KnownExcess | dict[str, Any] | None = None  # type: ignore[assignment]


class Problem(BaseModel):
    """An error (RFC 9457)."""

    type: str = Field(description="about:blank: the status says which kind of error this is")
    title: str
    status: int
    detail: str = Field(description="one sentence; an error of a parameter starts with its name")
    parameter: str = Field(default="", description="the parameter at fault, where there is one")
    closest: list[str] = Field(default=[], description="for an unknown name: the names most like it")


class Health(BaseModel):
    """State of the process, and of the store where that was asked for."""

    status: str
    materials: int | None = Field(default=None, description="number of materials in the store")


class FormulaRung(BaseModel):
    """Standing of the formula of a table among the forms of its surface."""

    against: Literal["measured", "highest rung", "none known"] = Field(
        description="measured: against a higher rung; highest rung: it is that rung; none known: it is a fit"
    )
    rung: str = Field(description="name of the highest rung; empty: none is known")
    p99: float | None = Field(description="relative error that 99 of 100 values keep to; null: no rung is known")


SpectrumKind = Annotated[
    Literal["grey", "one wavelength", "spectral"],
    Field(description="grey: no colour is known, all wavelengths are alike; one wavelength: shown as grey"),
]


class Summary(BaseModel):
    """One line of the catalogue; of a damaged material only `name`, `damaged` and `href`."""

    name: str
    title: str = ""
    model: str | None = Field(default=None, description="null: measured, or a function")
    model_title: str = ""
    paper: str = Field(default="", description="key of the paper of the model, such as he1991")
    source: str = Field(default="", description="paper and table, figure or section of the parameters")
    measured: bool = Field(default=False, description="true: the table is of measured data")
    anisotropic: bool | None = None
    wavelength_range_nm: list[float] | None = Field(default=None, description="first and last [nm]; null: grey")
    error_p99: float | None = Field(
        default=None, description="of the table: relative error that 99 of 100 values keep to; null: not measured"
    )
    formula_error: FormulaRung | None = Field(default=None, description="of its formula; null: not measured")
    largest_albedo: LargestAlbedo | None = Field(default=None, description="with the specular part; null: not measured")
    spectrum: SpectrumKind | None = None
    verdict: str | None = Field(default=None, description="of the audit of this revision; null: it has none")
    as_published: ShownAnswer | None = Field(default=None, description="is the table what the paper says?")
    conserves_energy: ShownAnswer | None = Field(default=None, description="does the published model conserve energy?")
    revision: str = ""
    created: str | None = None
    bytes: int | None = None
    incomplete: str | None = Field(default=None, description="what the table does not state of itself; null: nothing")
    damaged: str | None = Field(default=None, description="what is wrong with its files")
    href: str
    thumbnail: str | None = Field(default=None, description="address of its picture")


class Catalogue(BaseModel):
    """Materials of the store, a page of them."""

    materials: list[Summary]
    total: int = Field(description="materials that the filters let through, on all pages")
    next: str | None = Field(description="address of the next page; null: this is the last")


class ParameterDocument(BaseModel):
    """A parameter of a material."""

    name: str
    value: float | bool | Spectrum
    unit: str
    meaning: str
    source: str
    assumed: bool = Field(description="the paper does not print it: our choice, explained in attributes.assumed")


class AuditSummary(BaseModel):
    """The verdict of an audit, its answers to two questions, and its findings in sentences."""

    verdict: str
    as_published: ShownAnswer
    conserves_energy: ShownAnswer
    model: str
    sentences: list[ShownSentence]
    revision: str = Field(description="that was audited")
    current: bool = Field(description="whether that is this one")
    when: str


class Material(BaseModel):
    """One material: where its table comes from, where it is sampled, how far to believe it."""

    name: str
    revision: str
    title: str
    model: str | None = Field(description="name of the model; null: measured, or a function")
    parameters: list[ParameterDocument]
    anisotropic: bool
    wavelength_nm: list[float] | None = Field(description="wavelengths [nm]; null: grey")
    spectrum: SpectrumKind
    axes_deg: dict[str, list[float]] = Field(description="the grid of the table [degrees]")
    specular: bool = Field(description="whether there is a specular part: specular_reflectance is not 0 everywhere")
    error: Error | None = Field(description="of the table against its model, or the data; null: not measured")
    measured: Measured | None = Field(
        description="origin, symmetries and errors of measured data; null: the values are a model's or a function's"
    )
    formula_error: FormulaError | None = Field(description="of the model against the highest rung; null: not measured")
    largest_albedo: LargestAlbedo | None = Field(description="of the table, specular part included; null: not measured")
    incomplete: str | None = Field(description="what the table does not state of itself; null: nothing")
    audit: AuditSummary | None = Field(description="null: none")
    attributes: Attributes = Field(description="all that the table records of itself")
    revisions: list[str] = Field(description="that are kept, oldest first")
    links: dict[str, str]


class Evaluated(BaseModel):
    """Values of a BRDF."""

    source: Literal["table", "model", "family"]
    unit: str = Field(description="unit of brdf and error: 1/sr")
    output: Literal["spectrum", "xyz", "linear-srgb"]
    illuminant: str | None = Field(description="of a colour; null of a spectrum")
    wavelength_nm: float | list[float] | None = Field(description="of the values [nm]; null: grey")
    brdf: float | list[Any] = Field(
        description="shape of the broadcast angles, or of axes_deg, then the wavelengths unless they are one number or "
        "null; of a colour, then three numbers"
    )
    error: float | list[Any] | None = Field(
        description="in the shape of brdf, 99 of 100 values are within that of the model, or of what was measured; "
        "null: not asked for, and in a list: not known, because it is extrapolated"
    )
    extrapolated: bool | list[Any] | None = Field(
        description="shape of the broadcast angles; true: outside of the directions that were measured; null: error "
        "was not asked for"
    )
    specular_reflectance: float | list[Any] | None = Field(
        description="specular part, a reflectance without unit that is not in brdf: shape of theta_i, then as brdf"
    )


class Lookup(Evaluated):
    """Values of a material."""

    material: str
    revision: str


class Lookups(BaseModel):
    """Values of several materials."""

    materials: list[Lookup]


class View(BaseModel):
    """One light, and the axes of the values."""

    view: Literal["cut", "hemisphere", "half-difference"]
    theta_i: float | None = Field(description="degrees; null of half-difference")
    phi_i: float
    axes_deg: dict[str, list[float]] = Field(
        description="of the axes of brdf, in order; in a cut theta_r is negative back towards the light; in a "
        "hemisphere delta_phi is phi_r - phi_i"
    )


class Lobe(Lookup, View):
    """f_r of a material for one light over viewers, or over half and difference angles."""


class AlbedoValues(BaseModel):
    """Directional albedo: the share of light from theta_i that is reflected, averaged over phi_i."""

    wavelength_nm: list[float] | None = Field(description="null: grey")
    theta_i: list[float] = Field(description="degrees")
    albedo: list[list[float]] = Field(description="[theta_i][wavelength], without the specular part")
    specular_reflectance: list[list[float]] = Field(description="[theta_i][wavelength], the specular part")
    hemispherical: list[float] = Field(description="[wavelength], of light that is the same from everywhere, both")
    error: float = Field(description="of albedo, the largest estimate of the integration")


class Albedo(AlbedoValues):
    """Directional albedo of a table."""

    material: str
    revision: str


class _Audited:
    """The JSON schema of the audit of a material. Its modules are loaded for the document only."""

    @classmethod
    def __get_pydantic_json_schema__(cls, _: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        with contextlib.suppress(ImportError):  # without the extra `report` findings are objects
            from brdfdb.audit import MaterialAudit

            return handler(MaterialAudit.__pydantic_core_schema__)
        return {"type": "object"}


class Audit(BaseModel):
    """The findings of the audit on a material."""

    material: str
    revision: str = Field(description="that was audited")
    current: bool = Field(description="whether that is the current one")
    when: str
    finding: Annotated[dict[str, Any], _Audited]


def json_bytes(document: Any) -> bytes:
    """Return a document as JSON; it may contain numpy arrays, except 0-d ones."""
    return orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY)


def json_response(document: dict[str, Any], headers: dict[str, str] | None = None) -> Response:
    """Return a JSON answer with a document that `json_bytes` takes."""
    return Response(json_bytes(document), media_type=JSON, headers=headers)


def media_type(kind: str) -> str:
    """Return the media type of a format."""
    return NPY if kind == "npy" else JSON


def npy_bytes(array: NDArray[Any]) -> bytes:
    """Return an array as a .npy file."""
    buffer, array = io.BytesIO(), np.asarray(array, order="C")
    np.lib.format.write_array_header_1_0(buffer, np.lib.format.header_data_from_array_1_0(array))
    return b"".join((buffer.getvalue(), array.data))  # np.save copies twice


class Encoded(dict[str, str]):
    """Headers that many answers share, encoded once: encoding takes as long as the lookup of a point."""

    @functools.cached_property
    def raw(self) -> list[tuple[bytes, bytes]]:
        """Encoded headers, as they are sent."""
        return [(name.lower().encode("latin-1"), value.encode("latin-1")) for name, value in self.items()]


class EncodedResponse(Response):
    """An answer with encoded headers, which also name its media type."""

    def __init__(self, content: bytes, headers: Encoded) -> None:
        self.status_code, self.background, self.body = 200, None, content
        self.raw_headers = [*headers.raw, (b"content-length", str(len(content)).encode())]


@functools.lru_cache(maxsize=1024)
def lookup_headers(tag: str | None, revision: str, kind: str, *, immutable: bool = False) -> Encoded:
    """Return the headers of the answer to a lookup: its tag (None: not to be cached) and the revision of its values."""
    cached = {"Cache-Control": "no-store"} if tag is None else cache_headers(tag, kind, immutable=immutable)
    return Encoded({**cached, REVISION: revision, "Content-Type": media_type(kind)})


def plain(array: Any) -> Any:
    """Return what orjson can write: a number for a 0-d array, contiguous memory for any other."""
    if isinstance(array, np.ndarray):
        return np.ascontiguousarray(array) if array.ndim else array.item()
    return array


def tag_of(table: Table) -> str:
    """Return the ETag of a table: name, revision, and digest, because revisions are numbered anew in a new store."""
    return f"{table.name}-{table.revision}-{table.digest[:16]}"


def cache_headers(tag: str, kind: str = "json", *, immutable: bool = False) -> dict[str, str]:
    """Return ETag and Cache-Control: forever for an address with a revision. JSON may be compressed: a weak tag."""
    etag = f'W/"{tag}"' if kind == "json" else f'"{tag}-{kind}"'
    kept = "public, max-age=31536000, immutable" if immutable else "no-cache"
    return {"ETag": etag, "Cache-Control": kept, "Vary": "Accept"}


def unchanged(answer: Response, held: str | None) -> Response:
    """Return 304 in place of an answer that a client already holds, by its If-None-Match; ``*`` stands for any."""
    tag = answer.headers.get("etag")
    if held is None or tag is None or answer.status_code != 200:
        return answer
    tags = {one.strip().removeprefix("W/") for one in held.split(",")}
    if not tags & {"*", tag.removeprefix("W/")}:
        return answer
    kept = {key: answer.headers[key] for key in ("ETag", "Cache-Control", "Vary") if key in answer.headers}
    return Response(status_code=304, headers=kept)
