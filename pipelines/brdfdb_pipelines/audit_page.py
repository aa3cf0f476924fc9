"""The report of an audit as one HTML file that needs nothing else: no network, no other file."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from typing import Literal, NamedTuple

import jinja2

from brdfdb.audit import AuditReport, MaterialAudit
from brdfdb.audit.findings import Asymmetry, Furnace
from brdfdb.audit.model_energy import LOSSLESS
from brdfdb.figure import Curve, Figure, Map, Numbers, Panel
from brdfdb_pipelines import audit_sentences, figure_svg

Level = Literal["good", "calm", "note", "bad"]

PAPERS = {
    "ward1992": "Ward 1992: Measuring and modeling anisotropic reflection",
    "orennayar1994": "Oren and Nayar 1994: Generalization of Lambert's reflectance model",
    "he1991": "He, Torrance, Sillion and Greenberg 1991: A comprehensive physical model for light reflection",
}
# Verdicts of all findings, what a furnace shows and where a material stands in a model: how loud each is, and its mark
# beside the colour
_LEVELS: dict[str, Level] = {
    "passes": "good",
    "conserves": "good",
    "inside": "good",
    "loses": "calm",
    "at the edge": "calm",
    "unknown": "calm",
    "outside": "note",
    "gains": "note",
    "known published excess": "note",
    "accepted excess": "note",
    "violates": "bad",
}
_MARKS = dict.fromkeys(_LEVELS, "✓") | {
    "loses": "↓",
    "at the edge": "≈",
    "unknown": "?",
    "outside": "!",
    "gains": "!",
    "known published excess": "!",
    "accepted excess": "!",
    "violates": "✕",
}
_WORST_FIRST = (
    "violates",
    "accepted excess",
    "known published excess",
    "loses",
    "outside",
    "at the edge",
    "unknown",
    "conserves",
    "passes",
    "inside",
)
_LAST = 1e300  # what sorts after every number
_CURVES = 4  # wavelengths of a plot, at most
_ALL_OF_IT = Curve(label="all that arrives", x=[0.0, 90.0], y=[1.0, 1.0])
_IDEAL = Curve(label="ideal", x=[0.0, 90.0], y=[1.0, 1.0], role="truth")


class Plot(NamedTuple):
    """A drawing as a section shows it."""

    kind: str
    svg: str


class Cell(NamedTuple):
    """One finding on one material, in the table of all: what is shown, and what it is sorted by."""

    word: str
    text: str
    sort: float

    @property
    def level(self) -> Level:
        return _LEVELS[self.word]

    @property
    def mark(self) -> str:
        return _MARKS[self.word]


class Grid(NamedTuple):
    """A small table in the section of a material."""

    caption: str
    headings: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]


class Finding(NamedTuple):
    """A verdict with its reason."""

    title: str
    word: str
    reason: str


class Row(NamedTuple):
    """A material in the table of all, and what its section needs beside its audit."""

    audit: MaterialAudit
    anchor: str
    cells: list[Cell]
    findings: list[Finding]
    tables: list[Grid]


COLUMNS = (
    "of the model",
    "of the table",
    "white furnace",
    "reciprocity",
    "values",
    "smoothness",
    "table error",
    "sampling",
    "validity",
)


def key_of(subject: MaterialAudit | Figure) -> str:
    """The key of a material or a figure, unique in a report."""
    return f"figure-{subject.key}" if isinstance(subject, Figure) else anchor(subject.material)


def plots_of(subject: MaterialAudit | Figure) -> list[Plot]:
    """Draw what the section of a material or a figure shows; most of the time of a page goes into this."""
    drawings = subject.panels if isinstance(subject, Figure) else [*_panels(subject), *subject.table_error.maps]
    return [
        Plot(drawing.kind, figure_svg.svg(drawing, f"{key_of(subject)}-{n}")) for n, drawing in enumerate(drawings, 1)
    ]


def render(report: AuditReport, plots: Mapping[str, list[Plot]] | None = None) -> str:
    """The page of a report.

    Parameters
    ----------
    report : AuditReport
        What was found, where and when.
    plots : mapping, optional
        Of each material and figure what `plots_of` gives, under its `key_of`; drawn here if it is not given.

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
    environment.filters |= {"number": number, "angle": angle, "level": _LEVELS.__getitem__, "mark": _MARKS.__getitem__}
    environment.globals |= {"anchor": anchor, "key_of": key_of, "rank": _rank}
    rows = [_row(a) for a in report.materials]
    rows.sort(key=lambda row: (_rank(row.audit.verdict), _rank(row.audit.energy.verdict), row.audit.material))
    words = ("conserves", "loses", "known published excess", "accepted excess", "violates")
    counts = [(word, sum(a.energy.verdict == word for a in report.materials)) for word in words]
    if plots is None:
        subjects: list[MaterialAudit | Figure] = [*report.materials, *report.atlas, *report.gallery]
        plots = {key_of(subject): plots_of(subject) for subject in subjects}
    return environment.get_template("page.html").render(
        report=report,
        plots=plots,
        rows=rows,
        columns=COLUMNS,
        counts=counts,
        gallery=_by_paper(report.gallery),
        colours=figure_svg.VARIABLES,
    )


def anchor(name: str) -> str:
    """The id of a material's section: its name, where letters that an address cannot hold are numbers."""
    return "m-" + re.sub(r"[^A-Za-z0-9-]", lambda letter: f"_{ord(letter[0]):x}_", name)


def number(value: float | None, digits: int = 3) -> str:
    """A number for people: 0.0123, 1.2·10⁻⁹; what is missing is a dash."""
    if value is None:
        return "–"
    value += 0.0  # -0 is 0
    if not math.isfinite(value):
        return "not finite"
    if value != 0.0 and not 1e-4 <= abs(value) < 1e5:
        mantissa, exponent = f"{value:.1e}".split("e")
        return f"{mantissa.removesuffix('.0')}·10{figure_svg.superscript(int(exponent))}".replace("-", "−")
    return f"{value:.{digits}g}".replace("-", "−")


def angle(degrees: float) -> str:
    """Degrees for people."""
    return f"{degrees:.4g}°"


def probability(value: float | None) -> str:
    """A probability for people, without digits that mean nothing."""
    if value is None:
        return "–"
    return "below 0.001" if value < 0.001 else f"{value:.3f}"


def _rank(word: str) -> int:
    return _WORST_FIRST.index(word)


def _by_paper(figures: list[Figure]) -> list[tuple[str, list[Figure]]]:
    """Figures grouped by paper, papers in the order of their first figures."""
    order = list(dict.fromkeys(figure.paper for figure in figures))
    grouped = groupby(sorted(figures, key=lambda figure: order.index(figure.paper)), key=lambda figure: figure.paper)
    return [(PAPERS.get(paper, paper), list(group)) for paper, group in grouped]


def _row(a: MaterialAudit) -> Row:
    return Row(a, anchor(a.material), _cells(a), _findings(a), _tables(a))


def _cells(a: MaterialAudit) -> list[Cell]:
    """In the order of `COLUMNS`; what sorts is the number that is shown."""
    model, table = a.energy.model, a.energy.table
    asymmetry = max(each.max for _, each in _reciprocity(a))
    jump = max((jump.largest for jump in (*a.smoothness.model, *a.smoothness.table)), default=0.0)
    error, p = a.table_error, [p for p in a.sampling.chi_square_p if p is not None]
    wrong = a.values.negative + a.values.not_finite + a.nodes.wrong
    of_values = (a.values.positivity, a.values.finiteness, a.nodes.verdict)
    values = "violates" if "violates" in of_values else "passes"
    stated = "" if error.stated_p99 is None else f" of {number(error.stated_p99, 2)}"
    fresh = "not finite" if error.fresh_p99 is None else number(error.fresh_p99, 2)
    error_word = "unknown" if error.stated_p99 is None and error.verdict == "passes" else error.verdict
    edges = sum(limit.standing in ("at the edge", "outside") for limit in a.validity.limits)
    return [
        Cell(
            model.verdict, f"{_albedo(model.max_albedo)} at {angle(model.max_at_theta_i_deg)}", _last(model.max_albedo)
        ),
        Cell(
            table.verdict, f"{_albedo(table.max_albedo)} at {angle(table.max_at_theta_i_deg)}", _last(table.max_albedo)
        ),
        _furnace(model.furnace),
        Cell(a.reciprocity.verdict, number(asymmetry, 2), asymmetry),
        Cell(values, f"{wrong} bad" if wrong else "all good" if values == "passes" else "bad", wrong),
        Cell(a.smoothness.verdict, number(jump, 2), jump),
        Cell(
            error_word,
            fresh + stated,
            _last(error.fresh_p99),
        ),
        Cell(a.sampling.verdict, f"p {probability(min(p, default=None))}", min(p, default=1.0)),
        Cell(
            a.validity.standing,
            f"{edges} of {len(a.validity.limits)} limits" if edges else "",
            -_rank(a.validity.standing),
        ),
    ]


def _last(value: float | None) -> float:
    """What a number is sorted by: one that is not finite comes last."""
    return _LAST if value is None else value


def _furnace(furnace: Furnace | None) -> Cell:
    """What a lossless surface shows in uniform light, at the wavelength that is worst."""
    shown = [] if furnace is None else [value for value in furnace.hemispherical if value is not None]
    if not shown:
        return Cell("unknown", "–", _LAST)
    worst = max(shown, key=lambda value: abs(value - 1.0))
    word = "loses" if worst < LOSSLESS else "gains" if worst > 2.0 - LOSSLESS else "conserves"
    return Cell(word, f"{worst:.3f}", worst)


def _findings(a: MaterialAudit) -> list[Finding]:
    """What is said of a material, a sentence each."""
    model, table = a.energy.model, a.energy.table
    of_table = table.reason or f"reflects at most {_albedo(table.max_albedo)} at {angle(table.max_at_theta_i_deg)}"
    of_table = "as the model" if table.reason and table.reason == model.reason else of_table
    overall = [] if a.energy.reason in (model.reason, table.reason) else [("Energy", a.energy.verdict, a.energy.reason)]
    judged = [(each.max, each.tolerance) for _, each in _reciprocity(a) if each.tolerance is not None]
    most, allowed = max(judged, key=lambda pair: (pair[0] > pair[1], pair[0]))
    jumps = [*a.smoothness.model, *a.smoothness.table]
    jumped = "no seam to cross"
    if jumps:
        jump = max(jumps, key=lambda each: (each.largest > each.tolerance, each.largest))
        jumped = f"jumps by {number(jump.largest)} of f_r across {jump.seam}, of {number(jump.tolerance)} allowed"
    v, error, s = a.values, a.table_error, a.sampling
    stated = "states none" if error.stated_p99 is None else f"states {number(error.stated_p99)}"
    fresh = "no error can be measured"
    if error.fresh_p99 is not None:
        fresh = f"99 of 100 fresh values within {number(error.fresh_p99)}"
    bias = "" if error.bias is None else f", on average by {number(error.bias, 2)} of the model"
    mirror = "" if error.specular is None else f"; the mirror part is within {number(error.specular)} of the model's"
    erroneous = "; ".join([f"{fresh}{bias}; the table {stated}{mirror}", *audit_sentences.of_error(error)])
    p = min((p for p in s.chi_square_p if p is not None), default=None)
    sampled = (
        "no bins to compare" if p is None else f"the smallest p of {len(s.theta_i_deg)} lights is {probability(p)}"
    )
    limits = a.validity.limits
    standings = [limit.standing for limit in limits]
    kept = ", ".join(f"{standings.count(word)} {word}" for word in dict.fromkeys(standings))
    kept = f"of {len(limits)} {'limit' if len(limits) == 1 else 'limits'} that its paper states {kept}"
    finite = f"{v.not_finite} of {v.count} stored values and {v.looked_up} lookups are not finite"
    asymmetric = f"asymmetry up to {number(most)}, of {number(allowed)} allowed"
    negative = f"{v.negative} values are negative; the smallest f_r is {number(v.smallest)} 1/sr"
    found = [
        *overall,
        ("Energy of the model", model.verdict, model.reason),
        ("Energy of the table", table.verdict, of_table),
        ("Reciprocity", a.reciprocity.verdict, asymmetric),
        ("Positivity", v.positivity, negative),
        ("Finiteness", v.finiteness, finite),
        ("Nodes", a.nodes.verdict, audit_sentences.of_nodes(a.nodes)),
        ("Smoothness", a.smoothness.verdict, jumped),
        ("Table error", error.verdict, erroneous),
        ("Sampling", s.verdict, sampled),
        ("Validity", a.validity.standing, kept if limits else "its paper states no limits"),
    ]
    return [Finding(title, word, _sentence(reason)) for title, word, reason in found]


def _sentence(text: str) -> str:
    """With a capital and a full stop."""
    return f"{text[:1].upper()}{text[1:].removesuffix('.')}." if text else ""


def _albedo(value: float | None) -> str:
    return "not finite" if value is None else f"{value:.4f}"


def _reciprocity(a: MaterialAudit) -> list[tuple[str, Asymmetry]]:
    found = a.reciprocity
    named: list[tuple[str, Asymmetry | None]] = [
        ("model, random directions", found.model_random),
        ("model, in the lobe", found.model_lobe),
        ("table, random directions", found.table_random),
        ("table, in the lobe", found.table_lobe),
        ("table, its nodes", found.table_nodes),
    ]
    return [(name, each) for name, each in named if each is not None]


def _tables(a: MaterialAudit) -> list[Grid]:
    """Reciprocity, smoothness and sampling in numbers."""
    reciprocity = [
        (name, str(each.pairs), *(number(value, 2) for value in (each.min, each.mean, each.max, each.tolerance)))
        for name, each in _reciprocity(a)
    ]
    jumps = [
        (kind, jump.seam, number(jump.largest, 2), jump.where, number(jump.tolerance, 2))
        for kind, found in (("model", a.smoothness.model), ("table", a.smoothness.table))
        for jump in found
    ]
    s = a.sampling
    columns = (s.chi_square_p, s.largest_weight, s.weight_spread, s.monte_carlo, s.monte_carlo_error, s.quadrature)
    lights = [
        (angle(theta), probability(p), *(number(value) for value in rest))
        for theta, p, *rest in zip(s.theta_i_deg, *columns, strict=True)
    ]
    at = "" if s.wavelength_nm is None else f" at {s.wavelength_nm:g} nm"
    tables = [
        Grid("Asymmetry", ("of", "pairs", "smallest", "mean", "largest", "allowed"), reciprocity),
        Grid("Jumps of f_r", ("of", "across", "largest, relative", "where", "allowed"), jumps),
        Grid(
            f"Sampling: {s.samples} samples of each light{at}",
            ("light", "p", "largest weight", "spread", "diffuse albedo, sampled", "standard error", "integrated"),
            lights,
        ),
    ]
    return [table for table in tables if table.rows]


def _panels(a: MaterialAudit) -> list[Panel | Map]:
    """Albedo of model and table, over wavelengths; the furnace; the bound on a(lambda)."""
    model, table = a.energy.model, a.energy.table
    wavelengths = model.wavelength_nm
    theta, albedo = "angle of the light, degrees", "directional albedo"
    panels: list[Panel | Map] = []
    where, at = 0, ""
    if wavelengths is not None and len(wavelengths) > 1:
        where = _strongest(model.albedo)
        at = f" at {wavelengths[where]:g} nm"
        curves = _spectral(model.theta_i_deg, model.albedo, wavelengths)
        panels.append(Panel(title="Albedo of the model", x_label=theta, y_label=albedo, curves=curves))
        curves = [
            Curve(label="table", x=wavelengths, y=table.hemispherical, role="ours"),
            Curve(label="model", x=wavelengths, y=model.hemispherical, role="truth"),
        ]
        panels.append(Panel(title="In uniform light", x_label="wavelength, nm", y_label="albedo", curves=curves))
    both = [
        Curve(label="table", x=table.theta_i_deg, y=_column(table.albedo, where), role="ours"),
        Curve(label="model", x=model.theta_i_deg, y=_column(model.albedo, where), role="truth"),
        _ALL_OF_IT,
    ]
    panels.append(Panel(title=f"Model and table{at}", x_label=theta, y_label=albedo, curves=both))
    if (furnace := model.furnace) is not None:
        curves = _spectral(furnace.theta_i_deg, furnace.albedo, furnace.wavelength_nm)
        curves = [*curves, _IDEAL]
        panels.append(Panel(title="White furnace: made lossless", x_label=theta, y_label=albedo, curves=curves))
    if (bound := model.bound_on_a) is not None and len(bound.wavelength_nm) > 1:
        x = bound.wavelength_nm
        curves = [
            Curve(label="this material", x=x, y=bound.preset, role="ours"),
            Curve(label="largest that conserves", x=x, y=bound.largest, role="truth"),
        ]
        title, y_label = "Uniform diffuse part a(λ)", "a(λ)"
        panels.append(Panel(title=title, x_label="wavelength, nm", y_label=y_label, curves=curves))
    return panels


def _spectral(x: list[float], rows: list[Numbers], wavelengths: list[float] | None) -> list[Curve]:
    """Curves at a few wavelengths, the first and the last among them."""
    if wavelengths is None or len(rows[0]) == 1:
        return [Curve(label="model", x=x, y=_column(rows, 0), role="ours")]
    count = min(_CURVES, len(wavelengths))
    chosen = sorted({round(k * (len(wavelengths) - 1) / max(count - 1, 1)) for k in range(count)})
    return [Curve(label=f"{wavelengths[k]:g} nm", x=x, y=_column(rows, k)) for k in chosen]


def _strongest(rows: list[Numbers]) -> int:
    """At which wavelength the largest albedo is."""

    def largest(values: Iterable[float | None]) -> float:
        return max((value for value in values if value is not None), default=-math.inf)

    return max(range(len(rows[0])), key=lambda k: largest(row[k] for row in rows))


def _column(rows: list[Numbers], k: int) -> Numbers:
    return [row[k] for row in rows]
