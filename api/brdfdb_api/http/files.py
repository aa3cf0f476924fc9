"""The files of the store, read-only: one by one, as xarray reads them over HTTP, and a revision as one zip."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import FileResponse, Response, StreamingResponse

from brdfdb.errors import StoreError
from brdfdb.store.files import sha256_of
from brdfdb.store.manifest import check_manifest
from brdfdb.store.paths import manifest_path
from brdfdb_api.http.errors import RequestError
from brdfdb_api.http.openapi_notes import answers
from brdfdb_api.http.responses import cache_headers, not_modified
from brdfdb_api.http.routes import both, query_names, shelf_of

ZIP = "application/zip"
BYTES = "application/octet-stream"

_PIECE = 1 << 20

files = APIRouter()


@both(
    "/download.zarr",
    router=files,
    tags=["files"],
    dependencies=[query_names()],
    responses=answers(None, 304, 404, 422, 503, media={ZIP: "a zarr v3 group, for zarr.storage.ZipStore"}),
)
def download(request: Request, name: str, revision: str | None = None) -> Response:
    """Return a revision as one uncompressed zip file: xarray.open_zarr(zarr.storage.ZipStore(path, mode="r"))."""
    group, digest = _located(request, name, revision)
    headers = cache_headers(f"{name}-{group.name}-{digest[:16]}", "zip", immutable=revision is not None)
    headers["Content-Disposition"] = f'attachment; filename="{name}-{group.name}.zarr.zip"'
    if held := not_modified(request.headers.get("if-none-match"), headers):
        return held
    listed = sorted(check_manifest(group, digest, contents=True)["files"])
    return StreamingResponse(_zipped(group, listed), media_type=ZIP, headers=headers)


@files.get(
    "/v1/store/materials/{name}/{revision}/{file:path}",
    tags=["files"],
    dependencies=[query_names()],
    responses=answers(None, 304, 404, 422, 503, media={BYTES: "a file of the zarr group"}),
)
def stored_file(request: Request, name: str, revision: str, file: str) -> Response:
    """Return a file of a revision: ``xarray.open_zarr(".../v1/store/materials/NAME/REVISION")`` reads these."""
    group, digest = _located(request, name, revision)
    listed = check_manifest(group, digest, contents=False)["files"]
    if file not in listed:
        raise RequestError(404, f"{name} {revision} has no such file")
    kind = "json" if file.endswith(".json") else "file"  # JSON may be compressed on its way
    headers = cache_headers(f"{name}-{revision}-{listed[file]['sha256'][:16]}", kind, immutable=True)
    if held := not_modified(request.headers.get("if-none-match"), headers):
        return held
    if sha256_of(group / file) != listed[file]["sha256"]:  # a cache would keep it forever
        raise StoreError(f"{name} {revision} is damaged: the content of {file} changed")
    media = "application/json" if file.endswith(".json") else BYTES
    return FileResponse(group / file, media_type=media, headers=headers)


def _located(request: Request, name: str, revision: str | None) -> tuple[Path, str]:
    """Return the directory of a revision that the store has, and the digest of its manifest.

    Names are compared with what is there, never joined unseen.
    """
    shelf = shelf_of(request)
    group, digest = shelf.store.located(name, revision or shelf.head(name))
    if not manifest_path(group).is_file():
        raise StoreError(f"{name} {group.name} is damaged: its manifest is missing")
    return group, digest


class _Pieces:
    """A write-only stream without seek that hands out the bytes written to it."""

    def __init__(self) -> None:
        self.waiting: list[bytes] = []

    def write(self, data: bytes) -> int:
        self.waiting.append(bytes(data))
        return len(data)

    def flush(self) -> None:
        """Nothing lies anywhere else."""

    def taken(self) -> bytes:
        whole = b"".join(self.waiting)
        self.waiting.clear()
        return whole


def _zipped(group: Path, listed: list[str]) -> Iterator[bytes]:
    """Yield a zip of some files of a directory in pieces, so that memory does not grow with the table."""
    pieces = _Pieces()
    with zipfile.ZipFile(pieces, "w", zipfile.ZIP_STORED) as archive:  # type: ignore[call-overload]
        for name in listed:
            with (group / name).open("rb") as source, archive.open(name, "w", force_zip64=True) as target:
                while piece := source.read(_PIECE):
                    target.write(piece)
                    yield pieces.taken()
            yield pieces.taken()
    yield pieces.taken()
