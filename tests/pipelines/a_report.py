"""A report with one material of every verdict and one drawing of every kind, of numbers made up."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import numpy as np

from brdfdb.audit.energy import Energy
from brdfdb.audit.finding import Finding, Verdict
from brdfdb.audit.glints import GlintsFinding
from brdfdb.audit.model_energy import EnergyVerdict, Furnace, ModelEnergy, UniformBound
from brdfdb.audit.nodes import Nodes
from brdfdb.audit.polarisation import PolarisationFinding
from brdfdb.audit.reciprocity import Asymmetry, Reciprocity
from brdfdb.audit.record import Record
from brdfdb.audit.registry import FINDINGS
from brdfdb.audit.report import AuditReport, MaterialAudit, as_published, conserves_energy, explanations
from brdfdb.audit.sampling import Sampling
from brdfdb.audit.smoothness import Jump, Smoothness
from brdfdb.audit.table_energy import TableEnergy
from brdfdb.audit.table_error import TableError
from brdfdb.audit.validity import Limit, Validity
from brdfdb.audit.values import ValueCounts
from brdfdb.figure import Curve, Figure, Map, Panel, Picture, Statement, numbers
from brdfdb.tables.stated_error import Grazing

THETA = np.linspace(0.0, 89.0, 60)
ODD = '<b>&"it\'s" $größe$'


def report_of(materials: list[MaterialAudit], violations: list[str], **more: Any) -> AuditReport:
    """A report of these materials, of one store at one time."""
    given: dict[str, Any] = {"atlas": [], "gallery": [], "damaged": [], **more}
    when = datetime(2026, 11, 21, 12, 34, tzinfo=UTC)
    given |= {"explanations": explanations(), "materials": materials, "violations": violations}
    return AuditReport(store=f"the store {ODD}", brdfdb="1.2.3", when=when, **given)


def asymmetry(largest: float = 1e-14) -> Asymmetry:
    return Asymmetry(pairs=2000, min=0.0, mean=largest / 10.0, max=largest, tolerance=1e-11)


def error_map(title: str = "550 nm") -> Map:
    x, y = np.linspace(-88.0, 88.0, 45), np.linspace(0.0, 88.0, 23)
    rows = [numbers(0.02 * np.sin(x / 9.0 + each / 11.0)) for each in y]
    labels = {"x_label": "theta_r, degrees", "y_label": "theta_i, degrees", "value_label": "relative error"}
    return Map(title=title, x=x.tolist(), y=y.tolist(), values=rows, **labels)


def panel(title: str = "Relative error of the series", **settings: object) -> Panel:
    g = np.geomspace(0.01, 1e6, 80)
    curves = [
        Curve(label="ours", x=numbers(g), y=numbers(1e-15 * (1.0 + np.log1p(g))), role="ours"),
        Curve(label="ten terms", x=numbers(g), y=numbers(np.minimum(1.0, 1e-13 * g**3)), role="printed"),
        Curve(label="Beckmann's limit", x=numbers(g), y=numbers(1.0 / (1.0 + g)), role="textbook"),
    ]
    return Panel(title=title, x_label="g", y_label="relative error", curves=curves, log_x=True, log_y=True, **settings)


def polar() -> Panel:
    theta = np.linspace(-90.0, 90.0, 121)
    lobe = np.exp(-(((theta - 45.0) / 15.0) ** 2)) + 0.2
    curves = [
        Curve(label="as printed", x=numbers(theta), y=numbers(0.8 * lobe), role="printed"),
        Curve(label="truth", x=numbers(theta), y=numbers(lobe), role="truth"),
        Curve(label="ours", x=numbers(theta), y=numbers(lobe), role="ours"),
    ]
    return Panel(kind="polar", title="Light from 45°", x_label="theta_r", y_label="f_r, 1/sr", curves=curves)


def sphere(title: str = "sigma 0°", flatness: float = 1.0, side: int = 96) -> Picture:
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, side), np.linspace(1.0, -1.0, side))
    z = 1.0 - x**2 - y**2
    shade = np.where(z > 0.0, 0.9 * np.maximum(z, 0.0) ** (0.5 * flatness), np.nan)
    return Picture(title=title, radiance=[numbers(row) for row in shade])


def energy(verdict: EnergyVerdict, strength: float, spectral: bool) -> Energy:
    """The energy of a material that reflects so much at normal incidence."""
    wavelengths = [400.0, 500.0, 600.0, 700.0] if spectral else None
    scale = np.linspace(0.8, 1.0, 4) if spectral else np.ones(1)
    rows = strength * (1.0 + (THETA / 90.0) ** 3 / 5.0)[:, np.newaxis] * scale
    reason = f"reflects up to {rows.max():.4g} at 89 degrees"
    shared: dict[str, Any] = {
        "theta_i_deg": THETA.tolist(),
        "wavelength_nm": wavelengths,
        "albedo": [numbers(row) for row in rows],
        "specular": [numbers(np.zeros(scale.size)) for _ in THETA],
        "max_albedo": float(rows.max()),
        "max_at_theta_i_deg": 89.0,
        "exceeds_1_from_theta_i_deg": None,
        "max_at_wavelength_nm": 700.0 if spectral else None,
        "reason": reason,
    }
    furnace = Furnace(
        lossless="rho = 1",
        wavelength_nm=wavelengths,
        theta_i_deg=THETA.tolist(),
        albedo=[numbers(row / strength) for row in rows],
        hemispherical=numbers(scale),
        smallest=0.8,
        smallest_at_theta_i_deg=0.0,
        largest=1.2,
        largest_at_theta_i_deg=89.0,
    )
    bound = UniformBound(wavelength_nm=[400.0, 700.0], largest=[0.6, 0.7], preset=[0.5, 0.65], keeps=True)
    model = ModelEnergy(
        **shared,
        integration_error=1e-9,
        hemispherical=numbers(0.7 * scale),
        furnace=furnace,
        bound_on_a=bound if spectral else None,
        judged_up_to_theta_i_deg=90.0,
        grazing=Grazing(
            power=0.0, origin="declared", factor=0.5, max_albedo=float(rows.max()), passes_1_at_theta_i_deg=None
        ),
        verdict=verdict,
    )
    table = TableEnergy(
        **shared,
        integration_error=1e-4,
        hemispherical=numbers(0.69 * scale),
        bands=None,
        exceeds_1_beyond_error_from_theta_i_deg=None,
        verdict=overall(verdict),
    )
    return Energy(model=model, table=table, verdict=verdict, reason=reason)


def overall(verdict: EnergyVerdict) -> Verdict:
    """The verdict on a material whose energy has one."""
    return "passes" if verdict in ("conserves", "loses", "gains") else verdict  # type: ignore[return-value]


def table_error() -> TableError:
    return TableError(
        stated_p99=0.0093,
        fresh_p99=0.0091,
        specular=None,
        directions=9,
        contradictions=[],
        disagreements=0,
        worst=[],
        bias=-0.002,
        likeness="",
        maps=[error_map()],
        verdict="passes",
    )


def sampling(spectral: bool) -> Sampling:
    return Sampling(
        samples=100_000,
        phi_i_deg=0.0,
        theta_i_deg=[0.0, 45.0, 80.0],
        wavelength_nm=550.0 if spectral else None,
        chi_square_p=[0.31, 0.0004, None],
        largest_weight=[1.2, 1.5, 4.0],
        weight_spread=[0.1, 0.2, 0.5],
        monte_carlo=[0.7, 0.69, 0.6],
        monte_carlo_error=[1e-3] * 3,
        quadrature=[0.7, 0.69, 0.6],
        verdict="passes",
    )


def others() -> tuple[Finding, ...]:
    """Findings that are the same on each material."""
    limit = {"quantity": "alpha", "valid": "at most 0.2", "words": "up to about 0.2", "where": "section 4"}
    limits = [Limit(value="0.05", standing="inside", **limit), Limit(value="0.2", standing="at the edge", **limit)]
    values = {"count": 720, "looked_up": 5000, "smallest": 0.0123, "negative": 0, "not_finite": 0}
    return (
        Reciprocity(
            model_random=asymmetry(),
            model_lobe=asymmetry(3e-13),
            table_random=asymmetry(),
            table_lobe=asymmetry(),
            table_nodes=asymmetry(0.0),
            verdict="passes",
        ),
        ValueCounts(**values, positivity="passes", finiteness="passes", verdict="passes"),
        Nodes(compared=360, count=720, wrong=0, stored=None, expected=None, beside=[], verdict="passes"),
        Smoothness(
            model=[Jump(seam="alpha = 45°", crossings=9, largest=2e-7, where="45°, 45°", tolerance=1e-5)],
            table=[Jump(seam="delta_phi = 180°", crossings=9, largest=1e-4, where="theta_i 80°", tolerance=1e-2)],
            verdict="passes",
        ),
        table_error(),
        GlintsFinding(
            glints=[], held_out_p95=None, p95=None, worst=None, energies=[], worst_energy=None, verdict="passes"
        ),
        PolarisationFinding(
            lookups=5000,
            smallest_eigenvalue=-0.001,
            eigenvalue_tolerance=0.008,
            error_p99=0.0041,
            stated_p99=0.004,
            verdict="passes",
        ),
        Validity(limits=limits, verdict="at the edge"),
        Record(compared=1234, wrong=0, worst=[], verdict="passes"),
    )


def material(
    name: str, verdict: EnergyVerdict = "conserves", strength: float = 0.7, *, spectral: bool = False
) -> MaterialAudit:
    """All findings on a material that reflects so much at normal incidence."""
    found = {each.key: each for each in (energy(verdict, strength, spectral), *others(), sampling(spectral))}
    findings = {key: found[key] for key in FINDINGS}
    return MaterialAudit(
        material=name,
        revision="r000001",
        model="he_torrance" if spectral else "ward",
        findings=findings,
        sentences=[sentence for each in findings.values() for sentence in each.sentences()],
        as_published=as_published(findings),
        conserves_energy=conserves_energy(findings),
        verdict=overall(verdict),
    )


def figure(key: str, paper: str, panels: list[Panel | Map | Picture]) -> Figure:
    statements = [
        Statement(
            says=f"{key}: it peaks at 45°",
            where="Fig. 3",
            seen="the peak is at 45.0°",
            holds=True,
            threshold_from="the paper's curve: its grid is a degree",
        ),
        Statement(says=f"{key}: ten terms are enough", where="eq. 78", seen="81 % of the sum at g = 9", holds=False),
    ]
    caption = "He et al.'s eq. 78 against 50 digits, V = 3."
    return Figure(key=key, paper=paper, title=f"Title of {key}", caption=caption, panels=panels, statements=statements)


def whole() -> AuditReport:
    """A report with one material of every verdict and one drawing of every kind."""
    materials = [
        material("brass"),
        material("paint", "loses", 0.4),
        material("oxide", "known published excess", 0.9, spectral=True),
        material("gold", "accepted excess", 1.1),
        material(ODD, "violates", 1.3),
    ]
    atlas = [
        figure("series", "he1991", [panel()]),
        figure("lobes", "ward1992", [polar()]),
        figure("error-map", "he1991", [error_map(), error_map("600 nm")]),
    ]
    gallery = [
        figure("vases", "orennayar1994", [sphere(), sphere("sigma 20°", 0.6), sphere("sigma 40°", 0.3)]),
        figure("fig-3", "ward1992", [polar(), panel()]),
        figure("fig-4", "orennayar1994", [polar()]),
    ]
    return report_of(materials, [ODD], atlas=atlas, gallery=gallery)
