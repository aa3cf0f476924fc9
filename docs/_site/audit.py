"""The audit of the store that the site shows: its findings and figures, and the plots that the audit drew of them."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

from brdfdb.audit import AuditReport, MaterialAudit
from brdfdb_pipelines import figure_look

_PLOT = re.compile(r'<figure class="(\w+)" data-name="([^"]+)-\d+">(<svg.*?</svg>)</figure>', re.DOTALL)
_STYLES = Path(figure_look.__file__).parent / "templates" / "page.css"


class Plot(NamedTuple):
    """A drawing: its kind (curves, polar, map or picture) and an inline SVG."""

    kind: str
    svg: str


class Audit(NamedTuple):
    """The report of an audit, its materials by name, and the plots of every material and figure."""

    report: AuditReport
    materials: dict[str, MaterialAudit]
    plots: dict[str, list[Plot]]


@cache
def read(store: Path) -> Audit:
    """Return the audit of a store, with the plots of its page: nothing is computed or drawn twice."""
    report = AuditReport.model_validate_json((store / "audit.json").read_text(encoding="utf-8"))
    plots: dict[str, list[Plot]] = {}
    for kind, name, svg in _PLOT.findall((store / "audit.html").read_text(encoding="utf-8")):
        plots.setdefault(name, []).append(Plot(kind, svg))
    return Audit(report, {each.material: each for each in report.materials}, plots)


def drawn(plots: list[Plot]) -> str:
    """Return plots side by side as HTML."""
    figures = "".join(f'<figure class="{plot.kind}">{plot.svg}</figure>' for plot in plots)
    return f'<div class="plots plots-{min(len(plots), 3)}">{figures}</div>'


def style() -> str:
    """Return the colours of plots and verdicts, light and dark, as the page of the audit has them."""
    text = _STYLES.read_text(encoding="utf-8")
    dark = text[text.index("prefers-color-scheme: dark") :]
    dark = dark[: dark.index("\n}")]
    light = {name: colour for colour, name in figure_look.VARIABLES.items()} | _colours(text[: text.index("@media")])
    return f"html {{{_listed(light)}}}\nhtml[data-theme=dark] {{{_listed(_colours(dark))}}}\n"


def _colours(text: str) -> dict[str, str]:
    return dict(re.findall(r"(--[\w-]+): (#[0-9a-f]{6})", text))


def _listed(colours: dict[str, str]) -> str:
    return " ".join(f"{name}: {colour};" for name, colour in colours.items())
