"""The explorer, a page at `/`: its files, and plotly.js as the installed package holds it."""

from __future__ import annotations

import functools
import gzip
import hashlib
import importlib.metadata
from importlib.resources import files
from pathlib import PurePath

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from brdfdb_api.http.errors import RequestError
from brdfdb_api.http.responses import unchanged

SCRIPT = "text/javascript; charset=utf-8"
_TYPES = {".html": "text/html; charset=utf-8", ".css": "text/css; charset=utf-8", ".js": SCRIPT}
_VIEWS = "views.js"
FOLDER = files("brdfdb_api").joinpath("explorer")
# Media types of all files of the explorer: those of the folder, and the list of its views
MEDIA = {file.name: _TYPES[PurePath(file.name).suffix] for file in FOLDER.iterdir()} | {_VIEWS: SCRIPT}

# plotly writes style attributes, and reads its pictures from data: and blob: addresses
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
    """Return the page of the explorer."""
    return explorer_file(request, "index.html")


@pages.get("/explorer/plotly.js")
def plotly(request: Request) -> Response:
    """Return plotly.js; its address holds the version, so that a browser fetches it once."""
    packed = "gzip" in request.headers.get("accept-encoding", "")
    content, tag = _plotly(packed=packed)
    headers = {
        **_SAFE,
        "ETag": f'"{tag}"',
        "Cache-Control": "public, max-age=31536000, immutable",
        "Vary": "Accept-Encoding",
        **({"Content-Encoding": "gzip"} if packed else {}),
    }
    return unchanged(Response(content, media_type=SCRIPT, headers=headers), request.headers.get("if-none-match"))


@pages.get("/explorer/{file}")
def explorer_file(request: Request, file: str) -> Response:
    """Return a file of the explorer."""
    if file not in MEDIA:
        raise RequestError(404, "the explorer has no such file")
    content, tag = _file(file)
    headers = {**_SAFE, "ETag": f'"{tag}"', "Cache-Control": "no-cache"}
    return unchanged(Response(content, media_type=MEDIA[file], headers=headers), request.headers.get("if-none-match"))


@functools.cache
def _file(name: str) -> tuple[bytes, str]:
    """Return a file of the explorer and its digest."""
    content = _views() if name == _VIEWS else FOLDER.joinpath(name).read_bytes()
    content = content.replace(b"PLOTLY_VERSION", importlib.metadata.version("plotly").encode())
    return content, hashlib.sha256(content).hexdigest()[:16]


def _views() -> bytes:
    """Return a script that exports VIEWS: the views of all modules ``view_*.js`` by name, in their order."""
    modules = sorted(name for name in MEDIA if name.startswith("view_"))
    lines = [f'import view{number} from "./{name}";' for number, name in enumerate(modules)]
    views = ", ".join(f"view{number}" for number in range(len(modules)))
    lines.append("const by = (a, b) => a.order - b.order;")
    lines.append(f"export const VIEWS = Object.fromEntries([{views}].sort(by).map((view) => [view.name, view]));")
    return ("\n".join(lines) + "\n").encode()


@functools.cache
def _plotly(*, packed: bool) -> tuple[bytes, str]:
    """plotly.js and its tag: 4.8 MB, or 1.5 MB packed, which takes 0.15 s once."""
    content = files("plotly").joinpath("package_data", "plotly.min.js").read_bytes()
    version = importlib.metadata.version("plotly")
    return (gzip.compress(content, 6, mtime=0), f"{version}-gzip") if packed else (content, version)
