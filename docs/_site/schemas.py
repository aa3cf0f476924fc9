"""The pages of the formats: the JSON Schemas of the repository as tables of fields, a section a definition."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from _site.markup import plain, table, write_page

_SCHEMAS = Path(__file__).parents[2] / "schemas"
Schema = dict[str, Any]


class _Text(NamedTuple):
    title: str
    text: str


_PAGES = {
    "recipe": _Text(
        "Recipe",
        "A recipe is a TOML file that `brdfdb build RECIPE.toml` reads. Angles are in degrees. "
        "[Limits](../limits.md) lists how much a recipe may ask for.",
    ),
    "material": _Text(
        "Material",
        "A material is a model with its parameters and their sources. A recipe defines one in `[define.NAME]`, where "
        "angles are in degrees under names that end in `_deg`. A store keeps it in the units of the model.",
    ),
    "scene": _Text("Scene", "A scene is a TOML file that `brdfdb render` and `brdfdb choose` read."),
    "table": _Text(
        "Attributes of a table",
        "The zarr group of a table has these attributes. [The format](../format.md) says how the arrays lie on disk.",
    ),
    "family": _Text("Family", "The record of a family of materials, in the store."),
    "audit": _Text("Audit", "The report that `brdfdb audit` writes as `audit.json`."),
    "chart": _Text("Chart", "The document that `brdfdb chart` writes beside its pictures."),
    "choice": _Text("Choice", "The document that `brdfdb choose` writes beside its pictures."),
    "fits": _Text("Fits", "The document that `brdfdb fit --json` writes."),
    "conversion": _Text("Conversion", "The document that `brdfdb convert --json` prints."),
}


def write(docs: Path, _: Path) -> None:
    """Write ``reference/generated``: a page a schema."""
    for name in sorted(path.name.removesuffix(".schema.json") for path in _SCHEMAS.glob("*.schema.json")):
        schema = json.loads((_SCHEMAS / f"{name}.schema.json").read_text(encoding="utf-8"))
        write_page(docs / "reference" / "generated" / f"{name}.md", _page(name, schema))


def _page(name: str, schema: Schema) -> str:
    title, text = _PAGES[name]
    parts = [f"# {title}\n", f"{text}\n"]
    parts += ["## Fields\n", *fields_of(name, schema)]
    for definition, content in schema.get("$defs", {}).items():
        parts += [f"({anchor(name, definition)})=", f"## {plain(definition)}\n", *fields_of(name, content)]
    parts.append(f"The JSON Schema is `schemas/{name}.schema.json` in the repository.\n")
    return "\n".join(parts)


def anchor(name: str, definition: str) -> str:
    """Return the anchor of a definition."""
    return f"schema-{name}-{definition.lower()}"


def fields_of(name: str, schema: Schema) -> list[str]:
    """Return the description of a schema, and the table of its fields."""
    parts = [described(schema["description"])] if schema.get("description") else []
    properties: Schema = schema.get("properties", {})
    if not properties:
        return [*parts, f"{kind_of(name, schema)}.\n"]
    required = schema.get("required", [])
    rows = []
    for field, content in properties.items():
        default = "required" if field in required else _default(content)
        limits = ", ".join(limits_of(content))
        text = " ".join(str(content.get("description", "")).split())
        rows.append((f"`{field}`", kind_of(name, content), limits, default, plain(text).replace("\\`", "`")))
    return [*parts, table(("field", "type", "range", "default", "meaning"), rows)]


def described(text: str) -> str:
    """Return the words of a docstring before its sections."""
    words = text.split("\n\nAttributes\n")[0].split("\n\nParameters\n")[0].split("\n\nRaises\n")[0]
    return "\n\n".join(plain(block).replace("\\`", "`") for block in words.split("\n\n")) + "\n"


def kind_of(name: str, schema: Schema) -> str:
    """Return the type of a value in words, with links to definitions."""
    if "$ref" in schema:
        definition = schema["$ref"].rpartition("/")[2]
        return f"[{plain(definition)}](#{anchor(name, definition)})"
    for choice in ("anyOf", "oneOf"):
        if choice in schema:
            return " or ".join(dict.fromkeys(kind_of(name, each) for each in schema[choice]))
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    if "enum" in schema:
        return ", ".join(f"`{json.dumps(value)}`" for value in schema["enum"])
    kind = schema.get("type", "any value")
    if isinstance(kind, list):
        return " or ".join(kind_of(name, {**schema, "type": each}) for each in kind)
    if kind == "array":
        if "prefixItems" in schema:
            return f"list of {', '.join(kind_of(name, item) for item in schema['prefixItems'])}"
        return f"list of {kind_of(name, schema.get('items', {}))}"
    if kind == "object":
        values = schema.get("additionalProperties")
        if isinstance(values, dict):
            kind = kind_of(name, values)
            return f"table of {'tables' if kind == 'table' else kind}"
        return "table"
    return {"boolean": "true or false", "string": "text"}.get(kind, str(kind))


def limits_of(schema: Schema) -> list[str]:
    """Return the limits of a value, or of the kinds that it may have, in words."""
    words = {
        "minimum": "{} or more",
        "exclusiveMinimum": "more than {}",
        "maximum": "{} or less",
        "exclusiveMaximum": "less than {}",
        "minLength": "{} characters or more",
        "maxLength": "{} characters at most",
        "minItems": "{} items or more",
        "maxItems": "{} items at most",
        "minProperties": "{} entries or more",
        "maxProperties": "{} entries at most",
    }
    limits = [_counted(text, schema[key]) for key, text in words.items() if key in schema]
    if "pattern" in schema:
        limits.append(f"pattern `{schema['pattern']}`")
    for choice in ("anyOf", "oneOf"):
        for each in schema.get(choice, []):
            limits += [limit for limit in limits_of(each) if limit not in limits]
    return limits


def _counted(text: str, value: float) -> str:
    """Return a limit in words: one item or character, and more of them."""
    words = text.format(f"{value:g}" if abs(value) < 1e5 or value != int(value) else str(int(value)))
    return words.replace("items", "item").replace("characters", "character") if value == 1 else words


def _default(schema: Schema) -> str:
    if "default" not in schema:
        return "left out"
    written = json.dumps(schema["default"], ensure_ascii=False)
    return f"`{written}`" if len(written) <= 60 else "an object with all defaults"
