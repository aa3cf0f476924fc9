"""The files of the store, read-only: single files, as xarray reads them over HTTP, and a revision as a zip file."""

from __future__ import annotations

import itertools
import re
import zipfile

from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from brdfdb import __version__
from brdfdb.store.archive import ZIP, Group, root_group, zipped
from brdfdb.store.paths import pinned
from brdfdb_api.http.addresses import Revision, addresses, answers, both, is_pinned, shelf_of
from brdfdb_api.http.errors import RequestError
from brdfdb_api.http.queries import shortened
from brdfdb_api.http.responses import JSON, Document, cache_headers, tagged

BYTES = "application/octet-stream"

_RANGE = re.compile(r"bytes=(?:(?P<first>\d{1,18})-(?P<end>\d{1,18})?|-(?P<last>\d{1,18}))")  # others are ignored

files = addresses()


@both(
    files,
    "/download.zarr",
    tags=["files"],
    responses=answers(
        *(None, 304, 404, 503),
        media={ZIP: "a zarr v3 group for zarr.storage.ZipStore"},
        headers=("Content-Disposition",),
    ),
)
def download(request: Request, name: str, revision: Revision = None) -> Response:
    """Return a revision as an uncompressed zip file for xarray.open_zarr(zarr.storage.ZipStore(path, mode="r"))."""
    stored = shelf_of(request).revision(name, revision)
    tag = f"{name}-{pinned(stored.number, stored.digest)}-{__version__}"
    headers = cache_headers(tag, "zip", immutable=is_pinned(revision))
    headers["Content-Disposition"] = f'attachment; filename="{name}-{stored.number}.zarr.zip"'
    contents = ((key, stored.read(key)) for key in sorted(stored.manifest["files"]))
    pieces = zipped(contents, zipfile.ZIP_STORED)
    pieces = itertools.chain([next(pieces)], pieces)  # the first piece reads and checks every file
    return StreamingResponse(pieces, media_type=ZIP, headers=headers)


@files.get(
    "/v1/store/materials/{name}/{revision}/{file:path}",
    tags=["files"],
    responses=answers(None, 304, 404, 416, 503, media={BYTES: "a file of the zarr group"}),
)
def stored_file(request: Request, name: str, revision: str, file: str) -> Response:
    """Return a file of a revision, as ``xarray.open_zarr(".../v1/store/materials/NAME/REVISION")`` reads it.

    Take REVISION with its digest from ``links.store`` of the material: all files then belong to the same table.
    """
    stored = shelf_of(request).revision(name, revision)
    listed = stored.manifest["files"]
    if file not in listed:
        raise RequestError(404, f"{name} {revision} has no file {shortened(file)!r}")
    content = stored.read(file)  # a cache would never replace a damaged file
    is_json = file.endswith(".json")  # JSON may be compressed
    tag = f"{name}-{stored.number}-{listed[file]['sha256'][:16]}"
    headers = cache_headers(tag, "json" if is_json else "file", immutable=is_pinned(revision))
    return Document(content, headers) if is_json else _ranged(request, content, headers)


@files.get(
    "/v1/store/materials/{name}/{revision}.MANIFEST.json",
    tags=["files"],
    responses=answers(None, 304, 404, 503, media={JSON: "the stored manifest; its SHA-256 is the digest"}),
)
def manifest(request: Request, name: str, revision: str) -> Response:
    """Return the manifest of a revision: the size and the SHA-256 of each file."""
    stored = shelf_of(request).revision(name, revision)
    headers = cache_headers(f"{name}-{pinned(stored.number, stored.digest)}", immutable=is_pinned(revision))
    return Document(stored.manifest_bytes, headers)


def _ranged(request: Request, content: bytes, headers: dict[str, str]) -> Response:
    """Return the requested range of bytes, or all bytes; RequestError (416) if the range begins after the end."""
    part = _RANGE.fullmatch(request.headers.get("range", ""))
    size = len(content)
    headers = headers | {"Accept-Ranges": "bytes"}
    other = request.headers.get("if-range", headers["ETag"]) != headers["ETag"]
    if part is None or other or (part["end"] and int(part["end"]) < int(part["first"])):
        return Response(content, media_type=BYTES, headers=headers)
    first = max(0, size - int(part["last"])) if part["last"] else int(part["first"])
    if first >= size:
        raise RequestError(
            416, f"Range: begins after the end of the file, which has {size} bytes", Content_Range=f"bytes */{size}"
        )
    piece = content[first : int(part["end"] or size) + 1]
    headers["Content-Range"] = f"bytes {first}-{first + len(piece) - 1}/{size}"
    return Response(piece, 206, headers, BYTES)


@files.get("/v1/store/zarr.json", tags=["files"], responses=answers(Group, 304, 503))
def root(request: Request) -> Response:
    """Return the metadata of all current revisions: ``zarr.open_group(".../v1/store")`` lists materials/NAME/REVISION.

    Damaged materials are left out.
    """
    return tagged(root_group(shelf_of(request).store), "store")
