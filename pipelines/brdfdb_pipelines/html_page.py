"""Templates of pages that are one HTML file each."""

from __future__ import annotations

import jinja2

from brdfdb_pipelines.figure_look import VARIABLES


def environment() -> jinja2.Environment:
    """Return the environment of the templates: text is escaped, and a missing name is an error."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("brdfdb_pipelines", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["colours"] = VARIABLES
    return environment
