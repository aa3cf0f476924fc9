"""The pages: the explorer at `/`, the OpenAPI document, and at `/docs` a list of its operations."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from brdfdb_api.explorer.bundle import MEDIA, content_of
from brdfdb_api.explorer.operations import page_of
from brdfdb_api.http.errors import RequestError
from brdfdb_api.http.responses import preferred, tagged, unchanged

POLICY = "; ".join(
    (
        *("default-src 'none'", "script-src 'self'", "style-src 'self'", "img-src 'self' data:", "connect-src 'self'"),
        *("base-uri 'none'", "form-action 'none'", "frame-ancestors 'none'"),
    )
)
SAFE = {"Content-Security-Policy": POLICY, "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}

pages = APIRouter(include_in_schema=False)


@pages.get("/openapi.json")
def document(request: Request) -> Response:
    """Return the OpenAPI document."""
    return unchanged(tagged(request.app.openapi(), "openapi"), request.headers.get("if-none-match"))


@pages.get("/docs")
def operations(request: Request) -> Response:
    """Return a page with all operations, which needs nothing from elsewhere."""
    return Response(page_of(request.app.openapi()), media_type=MEDIA["index.html"], headers=SAFE)


@pages.get("/")
def index(request: Request) -> Response:
    """Return the page of the explorer."""
    return explorer_file(request, "index.html")


@pages.get("/explorer/{file}")
def explorer_file(request: Request, file: str) -> Response:
    """Return a file of the explorer."""
    if file not in MEDIA:
        raise RequestError(404, "the explorer has no such file")
    packed = preferred(request.headers.get("accept-encoding", ""), "identity", "gzip") == "gzip"
    content, tag = content_of(file, packed=packed)
    headers = {
        **SAFE,
        "ETag": f'"{tag}"',
        "Cache-Control": "no-cache",
        "Vary": "Accept-Encoding",
        **({"Content-Encoding": "gzip"} if packed else {}),
    }
    return unchanged(Response(content, media_type=MEDIA[file], headers=headers), request.headers.get("if-none-match"))
