"""Templates of pages that are one HTML file each."""

from __future__ import annotations

import jinja2


def environment() -> jinja2.Environment:
    """Return the environment of the templates: text is escaped, and a name that is missing is an error."""
    return jinja2.Environment(
        loader=jinja2.PackageLoader("brdfdb_pipelines", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
