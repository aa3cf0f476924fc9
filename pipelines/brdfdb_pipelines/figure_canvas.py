"""Pictures of several panels, drawn by matplotlib, as small SVG and as PNG.

A page has SVG of `figure_svg` alone. These pictures are files: the same drawing as SVG and as PNG.
"""

from __future__ import annotations

import html
import io
import re
from collections.abc import Callable
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure as Canvas

from brdfdb_pipelines.figure_look import FRAME_WIDTH, GRID, MUTED, TRUTH

_DPI = 110
_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",  # text stays text: small, and set in the font of the page
    "svg.hashsalt": "brdfdb",  # the same figure gives the same bytes
    "text.parse_math": False,  # a $ in a name is a letter
    "path.simplify": True,
    "font.family": "sans-serif",
    "font.size": 8.0,
    "axes.edgecolor": GRID,
    "axes.labelcolor": MUTED,
    "xtick.labelcolor": MUTED,
    "ytick.labelcolor": MUTED,
    "text.color": TRUTH,
    "axes.linewidth": FRAME_WIDTH,
    "axes.axisbelow": True,
}
_WITHOUT_DATE: dict[str, Any] = {"Date": None, "Creator": None, "Format": None, "Type": None}
_INVISIBLE = (
    r"<!--.*?-->",
    r"<metadata>.*?</metadata>",
    r"<defs>\s*<style.*?</defs>",
    r"<g id=\"patch_1\">.*?</g>",
)


def svg(draw: Callable[[], Canvas], description: str) -> str:
    """Return a canvas as an SVG document on white, with a description for readers who do not see it."""
    with mpl.rc_context(_STYLE):
        text = io.StringIO()
        draw().savefig(text, format="svg", metadata=_WITHOUT_DATE)
    opening, rest = _shortened(text.getvalue()).split(">", 1)
    described = html.escape(description)
    plate = '<rect width="100%" height="100%" fill="#fff"/>'
    return f'{opening} font-family="sans-serif" role="img" aria-label="{described}">{plate}{rest}\n'


def png(draw: Callable[[], Canvas]) -> bytes:
    """Return a canvas as PNG."""
    with mpl.rc_context(_STYLE):
        data = io.BytesIO()
        draw().savefig(data, format="png", dpi=_DPI, metadata={"Software": None})
    return data.getvalue()


def _shortened(text: str) -> str:
    """Return an SVG of matplotlib from its first tag on, without invisible parts and unused ids.

    Points have one decimal.
    """
    text = text[text.index("<svg") :]
    for invisible in _INVISIBLE:
        text = re.sub(invisible, "", text, flags=re.DOTALL)
    text = re.sub(r"font-family:[^;\"]*;?", "", text)  # the document states its font once

    def short(tag: re.Match[str]) -> str:
        text = re.sub(r' transform="rotate\(-0 [^"]*"', "", tag[0])
        if "scale(" not in text:
            text = re.sub(r"-?\d+\.\d{2,}(?!\w)", lambda number: f"{float(number[0]):.1f}".removesuffix(".0"), text)
        text = re.sub(r"\s+", " ", text)
        if not re.search(r"[CQ] ", text):
            text = re.sub(r"(?<=\d) L ", " ", text)  # a path repeats its last command: L of a line, not that of a curve
        return text.replace(": ", ":").replace("; ", ";").replace(' "', '"')

    text = re.sub(r"<[^>]+>", short, text)
    used = set(re.findall(r'(?:url\(|href=")#([^)"]+)', text))
    text = re.sub(r' id="([^"]*)"', lambda m: f' id="c-{m[1]}"' if m[1] in used else "", text)
    text = re.sub(r'(url\(|href=")#', r"\1#c-", text)
    text = re.sub(r">\s+<", "><", text).strip()
    return re.sub(r"<g/>|<g></g>", "", text)
