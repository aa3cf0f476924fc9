"""The files of the store, read-only: one by one, as xarray reads them over HTTP, and a revision as one zip."""

from __future__ import annotations

import re
import zipfile

from starlette.requests import Request
from starlette.responses import FileResponse, Response, StreamingResponse

from brdfdb import __version__
from brdfdb.errors import StoreError
from brdfdb.store.archive import ZIP, Group, root_group, zipped
from brdfdb.store.files import sha256_of
from brdfdb.store.manifest import check_manifest
from brdfdb_api.http.addresses import Revision, addresses, answers, both, shelf_of
from brdfdb_api.http.errors import RequestError
from brdfdb_api.http.responses import Document, cache_headers, tagged

BYTES = "application/octet-stream"

_RANGE = re.compile(r"bytes=(?:(?P<first>\d{1,18})-(?P<end>\d{1,18})?|-(?P<last>\d{1,18}))")  # others are not read

files = addresses()


@both(
    files,
    "/download.zarr",
    tags=["files"],
    responses=answers(
        *(None, 304, 404, 503),
        media={ZIP: "a zarr v3 group, for zarr.storage.ZipStore"},
        headers=("Content-Disposition",),
    ),
)
def download(request: Request, name: str, revision: Revision = None) -> Response:
    """Return a revision as one uncompressed zip file: xarray.open_zarr(zarr.storage.ZipStore(path, mode="r"))."""
    group, digest = shelf_of(request).located(name, revision)
    headers = cache_headers(f"{name}-{group.name}-{digest[:16]}-{__version__}", "zip", immutable=revision is not None)
    headers["Content-Disposition"] = f'attachment; filename="{name}-{group.name}.zarr.zip"'
    listed = check_manifest(group, digest, contents=True)["files"]
    return StreamingResponse(zipped(group, listed, zipfile.ZIP_STORED), media_type=ZIP, headers=headers)


@files.get(
    "/v1/store/materials/{name}/{revision}/{file:path}",
    tags=["files"],
    responses=answers(None, 304, 404, 416, 503, media={BYTES: "a file of the zarr group"}),
)
def stored_file(request: Request, name: str, revision: str, file: str) -> Response:
    """Return a file of a revision: ``xarray.open_zarr(".../v1/store/materials/NAME/REVISION")`` reads these."""
    group, digest = shelf_of(request).located(name, revision)
    listed = check_manifest(group, digest, contents=False)["files"]
    if file not in listed:
        raise RequestError(404, f"{name} {revision} has no such file")
    path, digest = group / file, listed[file]["sha256"]
    if sha256_of(path) != digest:  # a cache would keep it forever
        raise StoreError(f"{name} {revision} is damaged: the content of {file} changed")
    is_json = file.endswith(".json")  # JSON may be compressed on its way
    headers = cache_headers(f"{name}-{revision}-{digest[:16]}", "json" if is_json else "file", immutable=True)
    if is_json:
        return Document(path.read_bytes(), headers)
    _check_range(request, listed[file]["size"])
    return FileResponse(path, media_type=BYTES, headers=headers)


def _check_range(request: Request, size: int) -> None:
    """Forget a range that is not one of bytes; RequestError (416) for one that begins after the end of the file."""
    part = _RANGE.fullmatch(request.headers.get("range", ""))
    if part is None or (part["end"] and int(part["end"]) < int(part["first"])):
        request.scope["headers"] = [header for header in request.scope["headers"] if header[0] != b"range"]
    elif int(part["first"] or 0) >= size or (part["last"] == "0" and not part["first"]):
        raise RequestError(416, f"the file has {size} bytes", Content_Range=f"bytes */{size}")


@files.get("/v1/store/zarr.json", tags=["files"], responses=answers(Group, 304, 503))
def root(request: Request) -> Response:
    """Return the metadata of all current revisions: ``zarr.open_group(".../v1/store")`` lists materials/NAME/REVISION.

    A material that is damaged is left out.
    """
    return tagged(root_group(shelf_of(request).store), "store")
