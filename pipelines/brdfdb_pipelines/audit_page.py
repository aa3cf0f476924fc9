"""The report of an audit as one HTML file, which needs neither network nor other files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

from brdfdb.audit import FINDINGS, AuditReport, MaterialAudit
from brdfdb.audit.energy import Energy
from brdfdb.audit.finding import LAST, LEVELS, RANKS, Cell, NotJudged, NumberTable, Word
from brdfdb.audit.report import NO_PAPER, OF_DATA, QUESTIONS, Answer
from brdfdb.audit.validity import Validity
from brdfdb.figure import Figure
from brdfdb_pipelines import figure_svg, html_page

PAPERS = {
    "ward1992": "Ward 1992: Measuring and modeling anisotropic reflection",
    "orennayar1994": "Oren and Nayar 1994: Generalization of Lambert's reflectance model",
    "he1991": "He, Torrance, Sillion and Greenberg 1991: A comprehensive physical model for light reflection",
    "rahman1993": "Rahman, Pinty and Verstraete 1993: A semiempirical model of land surfaces",
    "lucht2000": "Lucht, Schaaf and Strahler 2000: Kernels of the MODIS albedo product",
}
# Mark of each word, beside its colour
_MARKS: dict[Word, str] = {
    **dict.fromkeys(LEVELS, "✓"),
    "loses": "↓",
    "at the edge": "≈",
    "unknown": "?",
    "not judged": "–",
    "compared": "±",
    "outside": "!",
    "gains": "!",
    "known published excess": "!",
    "accepted excess": "!",
    "violates": "✕",
}
_COUNTED: tuple[Word, ...] = (
    "conserves",
    "not judged",
    "loses",
    "gains",
    "known published excess",
    "accepted excess",
    "violates",
)


class DrawnPlot(NamedTuple):
    """A drawing as a section shows it."""

    kind: str
    svg: str


class Row(NamedTuple):
    """A material in the table of all materials: its audit, its cells, and the tables of its section."""

    audit: MaterialAudit
    anchor: str
    answers: list[Answer]
    cells: list[Cell]
    tables: list[NumberTable]


def key_of(subject: MaterialAudit | Figure) -> str:
    """Return the key of a material or a figure, unique in a report."""
    return f"figure-{subject.key}" if isinstance(subject, Figure) else anchor(subject.material)


def plots_of(subject: MaterialAudit | Figure) -> list[DrawnPlot]:
    """Return the drawn plots of a material or a figure. This takes most of the time of a page."""
    if isinstance(subject, Figure):
        drawings = subject.panels
    else:
        drawings = [drawing for finding in subject.findings.values() for drawing in finding.figures()]
    return [
        DrawnPlot(drawing.kind, figure_svg.svg(drawing, f"{key_of(subject)}-{n}"))
        for n, drawing in enumerate(drawings, 1)
    ]


def render(report: AuditReport, plots: Mapping[str, list[DrawnPlot]] | None = None) -> str:
    """Return the page of a report as HTML; plots by `key_of` are drawn with `plots_of` if they are not given."""
    environment = html_page.environment()
    environment.filters |= {"level": LEVELS.__getitem__, "mark": _MARKS.__getitem__, "sentence": _sentence}
    environment.globals |= {"anchor": anchor, "key_of": key_of, "rank": RANKS.__getitem__}
    energy: dict[str, Word] = {a.material: a.findings[Energy.key].verdict for a in report.materials}
    for a in report.materials:  # the albedo of data may be above 1 within their error
        if energy[a.material] == "conserves" and a.conserves_energy.word == "not judged":
            energy[a.material] = "not judged"
    tables = {
        a.material: [table for finding in a.findings.values() for table in finding.tables() if table.rows]
        for a in report.materials
    }
    rows = [Row(a, anchor(a.material), answers_of(a), cells_of(a), tables[a.material]) for a in report.materials]
    rows.sort(key=lambda row: (RANKS[row.audit.verdict], RANKS[energy[row.audit.material]], row.audit.material))
    if plots is None:
        subjects: list[MaterialAudit | Figure] = [*report.materials, *report.atlas, *report.gallery]
        plots = {key_of(subject): plots_of(subject) for subject in subjects}
    papers: dict[str, list[Figure]] = {}  # in the order of their first figures
    for figure in report.gallery:
        papers.setdefault(PAPERS.get(figure.paper, figure.paper), []).append(figure)
    return environment.get_template("page.html").render(
        report=report,
        plots=plots,
        rows=rows,
        questions=QUESTIONS,
        of_data=OF_DATA,
        no_paper=NO_PAPER,
        remarked=remarked(report),
        columns=columns(),
        counts=[(word, sum(verdict == word for verdict in energy.values())) for word in _COUNTED],
        gallery=list(papers.items()),
    )


def remarked(report: AuditReport) -> int:
    """Return the number of materials that pass although their model gains light or they leave its limits."""
    passing = [a for a in report.materials if a.verdict == "passes"]
    return sum(a.conserves_energy.word == "gains" or a.findings[Validity.key].verdict == "outside" for a in passing)


def anchor(name: str) -> str:
    """Return the id of a material's section: its name, with numbers for letters that an address cannot hold."""
    return "m-" + re.sub(r"[^A-Za-z0-9-]", lambda letter: f"_{ord(letter[0]):x}_", name)


def columns() -> tuple[str, ...]:
    """Return the headings of the cells of all findings."""
    return tuple(column for kind in FINDINGS.values() for column in kind.columns)


def answers_of(a: MaterialAudit) -> list[Answer]:
    """Return the answers to the two questions on a material."""
    return [a.as_published, a.conserves_energy]


def cells_of(a: MaterialAudit) -> list[Cell]:
    """Return the cells of all findings on a material, in the order of `columns`."""
    cells: list[Cell] = []
    for key, finding in a.findings.items():
        judged = not isinstance(finding, NotJudged)
        cells += finding.cells() if judged else [Cell(finding.verdict, "–", LAST)] * len(FINDINGS[key].columns)
    return cells


def _sentence(text: str) -> str:
    """Return a text with a capital and a full stop."""
    return f"{text[:1].upper()}{text[1:].removesuffix('.')}." if text else ""
