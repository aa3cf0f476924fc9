"""A page with all operations of the service, made from the OpenAPI document: no script, nothing from elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

_PAGE = """<!doctype html>
<html lang="en">
<head><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{title}: operations</title>
<link rel="icon" href="data:,"><link rel="stylesheet" href="/explorer/explorer.css"></head>
<body><main class="text">
<h1>{title}: operations</h1><p>{description}</p>
<p><a href="/openapi.json">openapi.json</a> has all of this with the schemas of bodies and answers.</p>
{operations}</main></body></html>
"""
_OPERATION = """<section><h2>{method} {path}</h2>
<p>{summary}</p><ul>{parameters}</ul></section>"""
_NAMED = {"name": "a material", "file": "a file of the table", "file_format": "a format", "revision": "a revision"}


def page_of(document: Mapping[str, Any]) -> str:
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
    schema, name = parameter["schema"], parameter["name"]
    words = parameter.get("description") or schema.get("description") or f"name of {_NAMED.get(name, f'a {name}')}"
    needed = ", required" if parameter.get("required") and parameter["in"] == "query" else ""
    return f"<li><code>{escape(name)}</code> ({parameter['in']}{needed}): {escape(words)}</li>"
