"""The pages: the explorer at `/`, the OpenAPI document, and the list of its operations at `/docs`."""

from __future__ import annotations

import functools
import gzip
import hashlib
import re
from collections.abc import Iterator, Mapping
from html import escape
from importlib.resources import files
from pathlib import PurePath
from typing import Any, NamedTuple

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from brdfdb_api.http.errors import RequestError
from brdfdb_api.http.queries import shortened
from brdfdb_api.http.responses import preferred, tagged, unchanged

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
SAFE = {"Content-Security-Policy": POLICY, "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}

SCRIPT = "text/javascript; charset=utf-8"
_TYPES = {".html": "text/html; charset=utf-8", ".css": "text/css; charset=utf-8", ".js": SCRIPT}
_VIEWS = "views.js"  # generated: the views of all modules view_*.js
# Generated: all modules as one script, because the first picture is then 150 ms earlier, 220 ms at 50 ms of latency
_BUNDLE = "explorer.js"
FOLDER = files("brdfdb_api").joinpath("explorer")
# Media types of the files of the explorer
MEDIA = {
    **{file.name: _TYPES[kind] for file in FOLDER.iterdir() if (kind := PurePath(file.name).suffix) in _TYPES},
    **dict.fromkeys((_VIEWS, _BUNDLE), SCRIPT),
}

pages = APIRouter(include_in_schema=False)


@pages.get("/openapi.json")
def document(request: Request) -> Response:
    """Return the OpenAPI document."""
    return unchanged(tagged(request.app.openapi(), "openapi"), request.headers.get("if-none-match"))


@pages.get("/docs")
def operations(request: Request) -> Response:
    """Return a page that lists all operations."""
    return Response(operations_page(request.app.openapi()), media_type=MEDIA["index.html"], headers=SAFE)


@pages.get("/")
def index(request: Request) -> Response:
    """Return the page of the explorer."""
    return explorer_file(request, "index.html")


@pages.get("/explorer/{file}")
def explorer_file(request: Request, file: str) -> Response:
    """Return a file of the explorer."""
    if file not in MEDIA:
        raise RequestError(404, f"the explorer has no file {shortened(file)!r}")
    packed = preferred(request.headers.get("accept-encoding", ""), "identity", "gzip") == "gzip"
    stored = _explorer_file(file, packed=packed)
    headers = {
        **SAFE,
        "ETag": f'"{stored.tag}"',
        "Cache-Control": "no-cache",
        "Vary": "Accept-Encoding",
        **({"Content-Encoding": "gzip"} if packed else {}),
    }
    answer = Response(stored.content, media_type=MEDIA[file], headers=headers)
    return unchanged(answer, request.headers.get("if-none-match"))


# Files of the explorer, and its modules as one script

_COMMENT = re.compile(r"^[ \t]*(?:/\*\*(?:[^*]|\*(?!/))*\*/|//.*)\n", re.MULTILINE)
_IMPORT = re.compile(r"""^import ([^;]+) from "\./(.+)";$""", re.MULTILINE)


class ExplorerFile(NamedTuple):
    """The bytes of a file of the explorer and their digest."""

    content: bytes
    tag: str


@functools.cache
def _explorer_file(name: str, *, packed: bool) -> ExplorerFile:
    """Return a file of the explorer, compressed if it is to be `packed`."""
    content = _text(name).encode()
    content = gzip.compress(content, 9, mtime=0) if packed else content
    return ExplorerFile(content, hashlib.sha256(content).hexdigest()[:16])


def _text(name: str) -> str:
    if name == _BUNDLE:
        return "const modules = {};\n" + "".join(_modules("main.js", set()))
    return _views() if name == _VIEWS else FOLDER.joinpath(name).read_text(encoding="utf-8")


def _modules(name: str, before: set[str]) -> Iterator[str]:
    """Yield a module as a function that is called once, after its imports, except those that are in `before`.

    An import is one statement per line; an export declares a constant, a function or a class, or is the default.
    """
    before.add(name)
    text = re.sub(r"^ +", "", _COMMENT.sub("", _text(name)), flags=re.MULTILINE)
    for _, other in _IMPORT.findall(text):
        if other not in before:
            yield from _modules(other, before)
    text = _IMPORT.sub(lambda line: f"const {_bound(line[1])} = modules[{line[2]!r}];", text)
    names = re.findall(r"^export (?:async )?(?:const|function\*?|class) (\w+)", text, re.MULTILINE)
    text = re.sub("^export default ", "const exported = ", text, flags=re.MULTILINE)
    exports = ", ".join([*names, *(["default: exported"] if "\nconst exported = " in text else [])])
    text = re.sub("^export ", "", text, flags=re.MULTILINE)
    yield f"modules[{name!r}] = (() => {{\n{text}return {{ {exports} }};\n}})();\n"


def _bound(names: str) -> str:
    """Return the pattern of a `const` declaration that has the names of an import."""
    if names.startswith("*"):
        return names.removeprefix("* as ")
    return names.replace(" as ", ": ") if names.startswith("{") else f"{{ default: {names} }}"


def _views() -> str:
    """Return a script that exports VIEWS: the views of all modules ``view_*.js`` by name, in their order."""
    modules = sorted(name for name in MEDIA if name.startswith("view_"))
    lines = [f'import view{number} from "./{name}";' for number, name in enumerate(modules)]
    views = ", ".join(f"view{number}" for number in range(len(modules)))
    lines.append("const by = (a, b) => a.order - b.order;")
    lines.append(f"export const VIEWS = Object.fromEntries([{views}].sort(by).map((view) => [view.name, view]));")
    return "\n".join(lines) + "\n"


# The list of operations

_PAGE = """<!doctype html>
<html lang="en">
<head><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{title}: operations</title>
<link rel="icon" href="data:,"><link rel="stylesheet" href="/explorer/explorer.css"></head>
<body><main class="text">
<h1>{title}: operations</h1><p>{description}</p>
<p><a href="/openapi.json">openapi.json</a> also has the schemas of bodies and answers.</p>
{operations}</main></body></html>
"""
_OPERATION = """<section><h2>{method} {path}</h2>
<p>{summary}</p><ul>{parameters}</ul></section>"""
_NAMED = {"name": "a material", "file": "a file of the table", "file_format": "a format"}


def operations_page(document: Mapping[str, Any]) -> str:
    """Return the page of an OpenAPI document."""
    operations = [
        _OPERATION.format(
            method=method.upper(),
            path=escape(path),
            summary=escape(operation.get("description", "")),
            parameters="".join(map(_parameter, operation.get("parameters", ()))),
        )
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    ]
    about = document["info"]
    return _PAGE.format(
        title=escape(about["title"]), description=escape(about["description"]), operations="\n".join(operations)
    )


def _parameter(parameter: Mapping[str, Any]) -> str:
    schema = parameter["schema"]
    name = parameter["name"]
    words = parameter.get("description") or schema.get("description") or f"name of {_NAMED.get(name, f'a {name}')}"
    needed = ", required" if parameter.get("required") and parameter["in"] == "query" else ""
    return f"<li><code>{escape(name)}</code> ({parameter['in']}{needed}): {escape(words)}</li>"
