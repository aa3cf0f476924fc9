"""The explorer, a page at `/`: its files, and plotly.js as the installed package holds it."""

from __future__ import annotations

import functools
import gzip
import hashlib
import importlib.metadata
from importlib.resources import files

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from brdfdb_api.http.errors import RequestError
from brdfdb_api.http.responses import not_modified

SCRIPT = "text/javascript; charset=utf-8"
MEDIA = {
    "index.html": "text/html; charset=utf-8",
    "explorer.css": "text/css; charset=utf-8",
    **dict.fromkeys(
        (
            *("main.js", "state.js", "series.js", "api.js", "list.js", "controls.js"),
            *("facts.js", "figures.js", "hemisphere.js", "sphere.js", "copy.js", "dom.js", "cut.js", "scales.js"),
        ),
        SCRIPT,
    ),
}

# plotly writes style attributes, and reads its pictures back from data: and blob: addresses
POLICY = "; ".join(
    (
        *("default-src 'none'", "script-src 'self'", "style-src 'self' 'unsafe-inline'"),
        *("img-src 'self' data: blob:", "connect-src 'self'"),
        *("base-uri 'none'", "form-action 'none'", "frame-ancestors 'none'"),
    )
)
_SAFE = {"Content-Security-Policy": POLICY, "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}

pages = APIRouter(include_in_schema=False)


@pages.get("/")
def index(request: Request) -> Response:
    """The explorer."""
    return explorer_file(request, "index.html")


@pages.get("/explorer/plotly.js")
def plotly(request: Request) -> Response:
    """The library that draws; its address in the page holds its version, so that it is fetched once."""
    packed = "gzip" in request.headers.get("accept-encoding", "")
    content, tag = _plotly(packed=packed)
    headers = {
        **_SAFE,
        "ETag": f'"{tag}"',
        "Cache-Control": "public, max-age=31536000, immutable",
        "Vary": "Accept-Encoding",
        **({"Content-Encoding": "gzip"} if packed else {}),
    }
    return not_modified(request.headers.get("if-none-match"), headers) or Response(
        content, media_type=SCRIPT, headers=headers
    )


@pages.get("/explorer/{file}")
def explorer_file(request: Request, file: str) -> Response:
    """A file of the explorer, of those that there are."""
    if file not in MEDIA:
        raise RequestError(404, "the explorer has no such file")
    content, tag = _file(file)
    headers = {**_SAFE, "ETag": f'"{tag}"', "Cache-Control": "no-cache"}
    return not_modified(request.headers.get("if-none-match"), headers) or Response(
        content, media_type=MEDIA[file], headers=headers
    )


@functools.cache
def _file(name: str) -> tuple[bytes, str]:
    """A file of the explorer and its digest."""
    content = files("brdfdb_api").joinpath("explorer", name).read_bytes()
    content = content.replace(b"PLOTLY_VERSION", importlib.metadata.version("plotly").encode())
    return content, hashlib.sha256(content).hexdigest()[:16]


@functools.cache
def _plotly(*, packed: bool) -> tuple[bytes, str]:
    """plotly.js and its tag: 4.8 MB, or 1.5 MB packed, which takes 0.15 s once."""
    content = files("plotly").joinpath("package_data", "plotly.min.js").read_bytes()
    version = importlib.metadata.version("plotly")
    return (gzip.compress(content, 6, mtime=0), f"{version}-gzip") if packed else (content, version)
