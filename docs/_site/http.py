"""The addresses of the service, from the OpenAPI document of the repository."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from _site.markup import code, plain, table, write_page
from _site.schemas import described, fields_of, kind_of, limits_of

_DOCUMENT = Path(__file__).parents[2] / "api" / "openapi.json"
_OF_REVISIONS = "/revisions/{revision}/"
Schema = dict[str, Any]
_EXAMPLES = {
    "/v1/materials": "curl 'http://127.0.0.1:8000/v1/materials?model=he_torrance&q=copper'",
    "/v1/materials/{name}": "curl http://127.0.0.1:8000/v1/materials/rolled-brass",
    "/v1/materials/{name}/lookup": "curl 'http://127.0.0.1:8000/v1/materials/rolled-brass/lookup"
    "?theta_i=30&theta_r=30&phi_r=180'",
    "/v1/materials/{name}/albedo": "curl http://127.0.0.1:8000/v1/materials/rolled-brass/albedo",
    "/v1/materials/{name}/lobe": "curl 'http://127.0.0.1:8000/v1/materials/rolled-brass/lobe?theta_i=45'",
    "/v1/materials/{name}/export/{file_format}": "curl -OJ http://127.0.0.1:8000/v1/materials/rolled-brass/export/exr",
    "/v1/materials/{name}/audit": "curl http://127.0.0.1:8000/v1/materials/rolled-brass/audit",
    "/v1/materials/{name}/sphere": "curl -o brass.png http://127.0.0.1:8000/v1/materials/rolled-brass/sphere",
    "/v1/materials/{name}/thumbnail.png": "curl -O http://127.0.0.1:8000/v1/materials/rolled-brass/thumbnail.png",
    "/v1/models/{model}": "curl http://127.0.0.1:8000/v1/models/ward",
    "/v1/materials/{name}/download.zarr": "curl -OJ http://127.0.0.1:8000/v1/materials/rolled-brass/download.zarr",
}


def write(docs: Path, _: Path) -> None:
    """Write ``reference/generated/http.txt``, which ``reference/http.md`` includes."""
    document = json.loads(_DOCUMENT.read_text(encoding="utf-8"))
    parts = ["## Addresses\n"]
    for path, methods in document["paths"].items():
        if _OF_REVISIONS in path and path.replace(_OF_REVISIONS, "/") in document["paths"]:
            continue  # the same of one revision: the page says so once
        for method, operation in methods.items():
            parts.append(_operation(method.upper(), path, operation))
    parts.append("## Documents\n")
    for name, schema in document["components"]["schemas"].items():
        parts += [f"(schema-http-{name.lower()})=", f"### {name}\n", *fields_of("http", schema)]
    write_page(docs / "reference" / "generated" / "http.txt", "\n".join(parts))


def _operation(method: str, path: str, operation: Schema) -> str:
    """Return the section of an address: its words, an example, parameters and answers."""
    parts = [f"### {method} {plain(path)}\n", described(operation.get("description", operation["summary"]))]
    body = operation.get("requestBody", {})
    if method == "GET" and path in _EXAMPLES:
        parts.append(code(_EXAMPLES[path], "sh"))
    content = body.get("content", {}).get("application/json", {})
    if "example" in content:
        address = path.replace("{name}", "rolled-brass").replace("{model}", "lambert").replace("{family}", "plaster")
        data = json.dumps(content["example"])
        parts.append(code(f"curl -d '{data}' \\\n  'http://127.0.0.1:8000{address}'", "sh"))
    if operation.get("parameters"):
        rows = [_parameter(parameter) for parameter in operation["parameters"]]
        parts.append(table(("parameter", "in", "type", "range", "default", "meaning"), rows))
    if body:
        parts += [f"Body: {described(body['description'])}", *fields_of("http", content["schema"])]
    rows = [(status, _media(answer), plain(answer["description"])) for status, answer in operation["responses"].items()]
    parts.append(table(("answer", "content", "meaning"), rows))
    return "\n".join(parts)


def _parameter(parameter: Schema) -> tuple[str, ...]:
    schema = parameter["schema"]
    default = "required" if parameter.get("required") else "left out"
    if "default" in schema:
        default = f"`{json.dumps(schema['default'])}`"
    limits = ", ".join(limits_of(schema))
    text = plain(parameter.get("description", ""))
    return f"`{parameter['name']}`", parameter["in"], kind_of("http", schema), limits, default, text


def _media(answer: Schema) -> str:
    kinds = []
    for media, content in answer.get("content", {}).items():
        reference = content.get("schema", {}).get("$ref")
        kinds.append(f"`{media}`" + (f" {kind_of('http', content['schema'])}" if reference else ""))
    return ", ".join(kinds)
