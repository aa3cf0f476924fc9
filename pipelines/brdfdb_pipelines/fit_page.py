"""The page of fits as one HTML file, which needs neither network nor other files."""

from __future__ import annotations

import jinja2

from brdfdb.figure import Figure
from brdfdb.fitting.document import Fits
from brdfdb_pipelines import figure_svg


def render(document: Fits, figure: Figure) -> str:
    """Return the page of some fits.

    Parameters
    ----------
    document : Fits
        The fits, best first.
    figure : Figure
        Figures of the best one.

    Returns
    -------
    str
        An HTML document.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("brdfdb_pipelines", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    plots = [(one.kind, figure_svg.svg(one, f"fit-{number}")) for number, one in enumerate(figure.panels, 1)]
    return environment.get_template("fit.html").render(
        document=document, best=document.fits[0], figure=figure, plots=plots, colours=figure_svg.VARIABLES
    )
