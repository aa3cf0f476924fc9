"""Objects in notebooks: HTML with all text escaped, in the colours of the page, without anything to download."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

_SMALL_ERROR = 1e-5  # error [1] below which a reader needs no digits
_LARGE_ERROR = 10.0  # error [1] above which a factor reads better than a percentage
_HUGE_ERROR = 1e4  # error [1] above which the factor has an exponent
_CARD = (
    "display:inline-block;max-width:60em;padding:0.6em 1em;border:1px solid rgba(128,128,128,0.4);border-radius:6px;"
    "line-height:1.4;color:inherit"
)
_CELL = "padding:0.1em 1em 0.1em 0;text-align:left;vertical-align:top;border:none;background:none;color:inherit"
_TABLE = "border:none;margin:0.3em 0 0;color:inherit;font-size:inherit"
_MUTED = "opacity:0.65"
_MOST_ROWS = 200


def card(kind: str, name: str, title: str, facts: Iterable[tuple[str, str]], picture: str = "") -> str:
    """Return an object as HTML.

    Parameters
    ----------
    kind : str
        Word for the object, such as "Table".
    name, title : str
        Name of the object, and its title for people.
    facts : iterable of (str, str)
        Labels and texts. A fact without text is left out.
    picture : str
        SVG that is shown on the right; it is not escaped.
    """
    rows = [
        f'<tr><td style="{_CELL};{_MUTED}">{escape(label)}</td><td style="{_CELL}">{escape(text)}</td></tr>'
        for label, text in facts
        if text
    ]
    shown = f'<div style="float:right;margin:0 0 0 1.5em">{picture}</div>' if picture else ""
    return (
        f'<div style="{_CARD}">{shown}<div><span style="{_MUTED}">{escape(kind)}</span> <b>{escape(name)}</b></div>'
        f'<div>{escape(title)}</div><table style="{_TABLE}">{"".join(rows)}</table></div>'
    )


def listing(kind: str, name: str, title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return an object as HTML with a list that scrolls; of more than 200 rows the first 200."""
    head = "".join(f'<th style="{_CELL};{_MUTED};font-weight:normal">{escape(column)}</th>' for column in columns)
    lines = [
        "<tr>" + "".join(f'<td style="{_CELL};white-space:nowrap">{escape(cell)}</td>' for cell in row) + "</tr>"
        for row in rows[:_MOST_ROWS]
    ]
    more = f'<div style="{_MUTED}">and {len(rows) - _MOST_ROWS} more</div>' if len(rows) > _MOST_ROWS else ""
    return (
        f'<div style="{_CARD}"><div><span style="{_MUTED}">{escape(kind)}</span> <b>{escape(name)}</b></div>'
        f'<div>{escape(title)}</div><div style="max-height:18em;overflow:auto">'
        f'<table style="{_TABLE}"><tr>{head}</tr>{"".join(lines)}</table></div>{more}</div>'
    )


def listed(parameters: Mapping[str, Any]) -> str:
    """Return parameters as text: names with their numbers, or with the range of their spectra."""
    return ", ".join(f"{name} = {value:g}" for name, value in parameters.items())


def error_in_words(error: float | None) -> str:
    """Return a relative error [1] as text: in percent, or above 1000 % as a factor."""
    if error is None:
        return "not measured"
    if error < _SMALL_ERROR:
        return "< 0.001 %"
    if error > _LARGE_ERROR:
        return f"a factor of {round(1.0 + error)}" if error < _HUGE_ERROR else f"a factor of {error:.2g}"
    return f"{100.0 * error:.0f} %" if error >= 0.995 else f"{100.0 * error:#.2g}".rstrip(".") + " %"


def spectrum(wavelength_nm: Sequence[float] | None) -> str:
    """Return wavelengths as text: their range and number, or that there are none."""
    if wavelength_nm is None:
        return "grey: the same at all wavelengths"
    if len(wavelength_nm) == 1:
        return f"{wavelength_nm[0]:g} nm"
    return f"{wavelength_nm[0]:g} to {wavelength_nm[-1]:g} nm, {len(wavelength_nm)} values"


def polar_sketch(theta_r_deg: Sequence[float], brdf: Sequence[float], theta_i_deg: float) -> str:
    """Return a polar cut of f_r as a small SVG: the light on the left, the mirror direction on the right.

    Parameters
    ----------
    theta_r_deg : sequence [degree]
        Angles of the viewer, negative towards the light.
    brdf : sequence [1/sr]
        f_r at these angles.
    theta_i_deg : float [degree]
        Polar angle of the light.
    """
    largest = max((value for value in brdf if math.isfinite(value)), default=0.0) or 1.0

    def at(angle_deg: float, radius: float) -> str:
        angle = math.radians(angle_deg)
        return f"{80.0 + 72.0 * radius * math.sin(angle):.1f},{78.0 - 72.0 * radius * math.cos(angle):.1f}"

    points = " ".join(
        at(a, value / largest) for a, value in zip(theta_r_deg, brdf, strict=True) if math.isfinite(value)
    )
    light = at(-theta_i_deg, 1.0).replace(",", " ")
    text = escape(f"f_r in the plane of incidence, light at {theta_i_deg:g} degrees, largest value {largest:.3g} 1/sr")
    return (
        f'<svg viewBox="0 0 160 84" width="160" height="84" role="img" aria-label="{text}"><title>{text}</title>'
        '<path d="M8 78A72 72 0 0 1 152 78Z" fill="none" stroke="currentColor" stroke-opacity="0.3"/>'
        f'<path d="M{light}L80 78" stroke="currentColor" stroke-opacity="0.6" stroke-dasharray="4 3"/>'
        f'<polygon points="80,78 {points}" fill="#3e97cf" fill-opacity="0.45" stroke="#3e97cf"/></svg>'
    )
