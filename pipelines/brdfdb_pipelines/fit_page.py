"""The page of fits as one HTML file, which needs neither network nor other files."""

from __future__ import annotations

from brdfdb.figure import Figure
from brdfdb.fitting.document import Fits
from brdfdb_pipelines import figure_look, figure_svg, html_page


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
    keys = [f"fit-{number}" for number, _ in enumerate(figure.panels, 1)]
    plots = [(key, one.kind, figure_svg.svg(one, key)) for key, one in zip(keys, figure.panels, strict=True)]
    cuts, _, maps = figure.caption.partition(". ")
    return (
        html_page.environment()
        .get_template("fit.html")
        .render(
            document=document,
            best=document.fits[0],
            plots=plots,
            captions={"curves": f"{cuts}.", "map": maps},
            colours=figure_look.VARIABLES,
        )
    )
