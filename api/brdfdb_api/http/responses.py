"""Answers as JSON and .npy, their headers, and the documents that OpenAPI describes."""

from __future__ import annotations

import contextlib
import functools
import gzip
import hashlib
import re
from typing import TYPE_CHECKING, Annotated, Any

import orjson
from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler
from pydantic_core import CoreSchema
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from brdfdb import __version__
from brdfdb.materials.model_document import ModelDocument
from brdfdb.store.catalogue import Line, MaterialDocument
from brdfdb.store.family import FamilyLine

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

JSON = "application/json"
NPY = "application/x-npy"
REVISION = "Brdfdb-Revision"  # header that names the revision of the values of a lookup
DIGEST = "Brdfdb-Digest"  # header with the sha256 of its manifest
NO_STORE = {"Cache-Control": "no-store"}
Encoded = list[tuple[bytes, bytes]]  # headers
COMPRESSED_FROM = 1024  # length of a document [byte]
_QUALITY = re.compile(r"(?<![^\s;])q=(0(?:\.\d*)?|1(?:\.0*)?)\s*(?:;|$)")


class ServedProblem(BaseModel):
    """An error (RFC 9457)."""

    model_config = ConfigDict(title="Problem")

    type: str = Field(description="about:blank, because the status tells the kind of error")
    title: str
    status: int
    detail: str = Field(description="one sentence; if a parameter is wrong, the sentence begins with its name")
    parameter: str = Field(default="", description="name of the wrong parameter, if the error is about one")
    closest: list[str] = Field(default=[], description="for an unknown name: the most similar names")


class Health(BaseModel):
    """State of the process, and of the store if `/readyz` was asked."""

    status: str
    materials: int | None = Field(default=None, description="number of materials in the store")


class ServedSummary(Line):
    """One line of the catalogue. A damaged material has only `name`, `damaged` and `href`."""

    model_config = ConfigDict(title="Summary")

    href: str
    thumbnail: str | None = Field(default=None, description="address of its picture")


class Catalogue(BaseModel):
    """One page of the catalogue of the store."""

    materials: list[ServedSummary]
    total: int = Field(description="number of materials that match the filters, on all pages")
    next: str | None = Field(description="address of the next page; null: this is the last page")


class ServedMaterial(MaterialDocument):
    """One material: the source, the grid and the error of its table."""

    model_config = ConfigDict(title="Material")

    revisions: list[str] = Field(description="revisions in the store, oldest first")
    links: dict[str, str]


class Model(ModelDocument):
    """A model and its parameters."""

    href: str


class Models(BaseModel):
    """All models."""

    models: list[Model]


class Families(BaseModel):
    """All families of the store."""

    families: list[FamilyLine]


class _Audited:
    """The JSON schema of the audit of a material, whose modules are loaded for the OpenAPI document only."""

    @classmethod
    def __get_pydantic_json_schema__(cls, _: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        with contextlib.suppress(ImportError):  # without the extra `report`, findings are plain objects
            from brdfdb.audit import MaterialAudit

            return handler(MaterialAudit.__pydantic_core_schema__)
        return {"type": "object"}


class Audit(BaseModel):
    """The findings of the audit on a material."""

    material: str
    revision: str = Field(description="the revision that was audited")
    current: bool = Field(description="whether that is the current revision")
    when: str
    finding: Annotated[dict[str, Any], _Audited]


def json_bytes(document: Any) -> bytes:
    """Return a document as JSON; it may contain numpy arrays, but no 0-d arrays."""
    return orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY)


@functools.lru_cache(maxsize=1024)
def preferred(accepted: str, *offers: str) -> str:
    """Return the offer that an Accept or Accept-Encoding header prefers; the first offer if all are equal."""
    known: dict[str, tuple[float, int]] = {}
    for place, part in enumerate(accepted.lower().split(",")):
        name, _, parameters = part.partition(";")
        quality = _QUALITY.search(parameters)
        known.setdefault(name.strip(), (float(quality[1]) if quality else 1.0, -place))

    def rank(offer: str) -> tuple[float, int, int]:
        for vagueness, name in enumerate((offer, f"{offer.partition('/')[0]}/*", "*/*", "*")):
            if name in known:
                quality, place = known[name]
                return (quality, -vagueness, place) if quality else (-1.0, 0, 0)
        return 0.0, 0, 0

    return max(offers, key=rank)


class Document(Response):
    """A JSON document, compressed if the client accepts gzip. Level 1 takes a quarter of the time of level 5.

    Lookups are not compressed, because compression takes longer than the lookup.
    """

    media_type = JSON

    def __init__(self, document: dict[str, Any] | bytes, headers: dict[str, str] | None = None) -> None:
        super().__init__(document if isinstance(document, bytes) else json_bytes(document), headers=headers)
        self.headers.add_vary_header("Accept-Encoding")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        accepted = ",".join(Headers(scope=scope).getlist("accept-encoding"))
        if len(self.body) > COMPRESSED_FROM and preferred(accepted, "identity", "gzip") == "gzip":
            self.body = await run_in_threadpool(gzip.compress, self.body, 1, mtime=0)
            self.headers.update({"Content-Encoding": "gzip", "Content-Length": str(len(self.body))})
        await super().__call__(scope, receive, send)


class ValuesResponse(Response):
    """Values as JSON or .npy; their headers are encoded only once, because encoding takes as long as a lookup."""

    def __init__(self, content: bytes, headers: Encoded) -> None:
        self.status_code = 200
        self.background = None
        self.body = content
        self.raw_headers = [*headers, (b"content-length", b"%d" % len(content))]


@functools.lru_cache(maxsize=1024)
def value_headers(
    kind: str,
    tag: str | None = None,
    revision: str | None = None,
    digest: str | None = None,
    *,
    immutable: bool = False,
) -> Encoded:
    """Return the headers of values of a `kind`, with a tag (None: not to be cached) and a revision."""
    named = NO_STORE if tag is None else cache_headers(tag, kind, immutable=immutable)
    if revision is not None and digest is not None:
        named = named | {REVISION: revision, DIGEST: digest}
    named = named | {"Content-Type": NPY if kind == "npy" else JSON}
    return [(name.lower().encode(), value.encode()) for name, value in named.items()]


def tag_of(table: Table, *more: object) -> str:
    """Return the ETag of an answer about a table: of the digest, the version of this program and `more` dependencies.

    The revision alone is not enough, because a new store begins to count again.
    """
    tag = f"{table.name}-{table.revision}-{table.digest[:16]}-{__version__}"
    return "-".join((tag, *map(str, more))) if more else tag


def cache_headers(tag: str, kind: str = "json", *, immutable: bool = False) -> dict[str, str]:
    """Return ETag, weak for JSON, which may be compressed, and Cache-Control, without end for immutable content."""
    etag = f'W/"{tag}"' if kind == "json" else f'"{tag}-{kind}"'
    cache_control = "public, max-age=31536000, immutable" if immutable else "no-cache"
    return {"ETag": etag, "Cache-Control": cache_control, "Vary": "Accept"}


def tagged(document: dict[str, Any], name: str) -> Document:
    """Return a document whose ETag is a digest of its content."""
    content = json_bytes(document)
    return Document(content, cache_headers(f"{name}-{hashlib.sha256(content).hexdigest()[:16]}"))


def unchanged(answer: Response, if_none_match: str | None) -> Response:
    """Return 304 in place of an answer whose tag is in If-None-Match; ``*`` matches any tag."""
    tag = answer.headers.get("etag")
    if if_none_match is None or tag is None or answer.status_code != 200:
        return answer
    tags = {tag.strip().removeprefix("W/") for tag in if_none_match.split(",")}
    if not tags & {"*", tag.removeprefix("W/")}:
        return answer
    headers = {key: answer.headers[key] for key in ("ETag", "Cache-Control", "Vary") if key in answer.headers}
    return Response(status_code=304, headers=headers)
