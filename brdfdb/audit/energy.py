"""Energy of a material: the verdicts on the model behind a table and on the table, the worse of the two, and plots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from brdfdb.audit.finding import LAST, Cell, Finding, Sentence, Subject, Word
from brdfdb.audit.model_energy import (
    ANGLE_TOLERANCE_DEG,
    LOSSLESS,
    TOLERANCE,
    EnergyVerdict,
    Furnace,
    ModelEnergy,
    model_energy_of,
    published_excess,
)
from brdfdb.audit.table_energy import TableEnergy, table_energy_of
from brdfdb.errors import counted
from brdfdb.figure import Curve, Map, Numbers, Panel, number
from brdfdb.materials import Material, Source
from brdfdb.materials.provenance import KnownExcess
from brdfdb.tables.albedo import grazing_of_table
from brdfdb.tables.stated_error import Grazing
from brdfdb.tables.table import Table

_SEVERITY: tuple[EnergyVerdict, ...] = (
    "conserves",
    "loses",
    "gains",
    "known published excess",
    "accepted excess",
    "violates",
)
# Verdicts on models that reflect at most what arrives with the parameters of the material
WITHIN_1: tuple[EnergyVerdict, ...] = ("conserves", "loses", "gains")
_ACCEPTED = "accepted, not published"
_OF_MODEL = "the model itself reflects more than arrives, and the table follows it"
_CURVES = 4  # Largest number of wavelengths in a plot
_ALL_OF_IT = Curve(label="all that arrives", x=[0.0, 90.0], y=[1.0, 1.0])
_IDEAL = Curve(label="ideal", x=[0.0, 90.0], y=[1.0, 1.0], role="truth")
_THETA = "angle of the light, degrees"
_ALBEDO = "directional albedo"


class Energy(Finding):
    """Directional albedo of the model behind a table and of the table, and the verdict on both."""

    key = "energy"
    order = 1
    columns = ("albedo of the model", "albedo of the table", "white furnace")
    explanation = (
        "Directional albedo is the share of the light from one direction that leaves the surface in any direction, "
        "specular part included: the integral of f_r cos theta_r over the hemisphere. An albedo above 1 creates "
        "energy. The verdict is for lights up to 90°, or up to 89.9° if f_r grows without bound at the horizon. The "
        "largest albedo of a table is the largest at a list of angles; that of a model is also searched for between "
        "these angles. Beyond the last angle the albedo is bounded, or grows as a power of 1 / cos theta_i. The model "
        "declares this power, or the audit measures it. The report says where the albedo exceeds 1. The white furnace "
        "is the surface in uniform light, with its parameters set so that nothing is absorbed. An ideal model then "
        "shows 1 at every angle. Less than 1 is light that single scattering loses, more than 1 is energy that the "
        "model creates. The table of all materials shows the mean over angles, which counts as a loss or a gain "
        "beyond 1 %. A model loses light if the white furnace loses more than 1 % at any angle up to 85°. It gains "
        "light if the white furnace reflects more than arrives at any angle, but the material, with its own "
        "parameters, does not."
    )

    model: ModelEnergy | None = Field(description="null: the source is not known")
    table: TableEnergy
    verdict: EnergyVerdict = Field(description="the worse of the two")
    reason: str = Field(description="reason of the worse verdict")

    @classmethod
    def judge(cls, subject: Subject) -> Energy:
        """Judge the energy of a table and its source, or of the table alone if the source is not known."""
        known = None if subject.restated is None else subject.restated.largest_albedo
        grazing = None if known is None or known.of == "table" else known.grazing
        return energy_of(subject.table, subject.source, accept_excess=subject.accept_excess, grazing=grazing)

    def sentences(self) -> list[Sentence]:
        """Return sentences on model, table, white furnace and uniform diffuse part."""
        model, table = self.model, self.table
        up_to = f"for lights up to {table.theta_i_deg[-1]:g}°"
        most = f"reflects at most {_albedo(table.max_albedo)} {up_to}, at {table.max_at_theta_i_deg:.4g}°"
        of_table = table.reason or most
        if table.grazing is not None and table.max_albedo is not None:
            of_table += f"; {table.grazing.in_words(table.max_albedo)}"
        if model is None:
            return [
                self.sentence("not judged", "no model of this table can be evaluated", title="Energy of the model"),
                self.sentence(table.word, of_table, title="Energy of the table"),
            ]
        of_table = "as the model" if table.reason and table.reason == model.reason else of_table
        if len(model.hemispherical) == 1:
            both = f"{number(model.hemispherical[0], 4)}, the table {number(table.hemispherical[0], 4)}"
            of_table += f"; in uniform light the model reflects {both}"
        overall = [] if self.reason in (model.reason, table.reason) else [self.sentence(self.verdict, self.reason)]
        sentences = [
            *overall,
            self.sentence(model.verdict, model.reason, title="Energy of the model"),
            self.sentence(table.verdict, of_table, title="Energy of the table"),
        ]
        if (furnace := model.furnace) is not None:
            cell = furnace_cell(furnace)
            least = f"{number(furnace.smallest, 4)} at {furnace.smallest_at_theta_i_deg:.4g}°"
            most = f"{number(furnace.largest, 4)} at {furnace.largest_at_theta_i_deg:.4g}°"
            text = f"{furnace.lossless}; the albedo is between {least} and {most}, in uniform light {cell.text}"
            sentences.append(self.sentence(cell.word, text, title="White furnace"))
        if (bound := model.bound_on_a) is not None:
            preset = largest = ""
            if len(bound.largest) == 1:
                preset = f" of {number(bound.preset[0], 4)}"
                largest = f" of {number(bound.largest[0], 4)}"
            keeps = "keeps to" if bound.keeps else "is above"
            text = f"the a(λ) of the material{preset} {keeps} the largest that conserves energy{largest}"
            sentences.append(self.sentence("inside" if bound.keeps else "outside", text, title="Uniform diffuse part"))
        return sentences

    def problems(self) -> list[str]:
        """Return a sentence if an albedo exceeds 1, even if the stated error of the table explains it."""
        reason = self.table.reason if self.verdict in WITHIN_1 else self.reason
        return [reason] if reason else []

    def cells(self) -> list[Cell]:
        """Return the largest albedos, and the albedo of the lossless surface in uniform light."""
        model, table = self.model, self.table
        if model is None:
            nothing = Cell("not judged", "–", LAST)
            return [nothing, _largest(table.word, table.max_albedo, table.max_at_theta_i_deg), nothing]
        of_model = _largest(model.verdict, model.max_albedo, model.max_at_theta_i_deg)
        of_table = _largest(table.verdict, table.max_albedo, table.max_at_theta_i_deg)
        return [of_model, of_table, furnace_cell(model.furnace)]

    def figures(self) -> list[Panel | Map]:
        """Return albedos of model and table, the furnace, and the bound on the uniform diffuse part."""
        return [*panels_of(self.model, self.table)]

    @classmethod
    def overview(cls, findings: Sequence[Finding]) -> list[str]:
        """Return a sentence on tables that exceed 1 where their models do not, and on models that lose light."""
        energies = [finding for finding in findings if isinstance(finding, Energy)]
        sentences = []
        coarse = [energy for energy in energies if energy.table.verdict == "violates"]
        if any(energy.model is None or energy.model.verdict in WITHIN_1 for energy in coarse):
            sentences.append(
                "a table whose grid is too coarse for its lobe can exceed 1 where its model does not: try a finer grid"
            )
        within = sum(energy.table.verdict == "passes" and bool(energy.table.reason) for energy in energies)
        if within:
            sentences.append(
                f"{counted(within, 'table')} above 1 by no more than the stated error, or that of the integration, "
                f"{'passes' if within == 1 else 'pass'}"
            )
        for verdict in ("loses", "gains"):
            count = sum(energy.verdict == verdict for energy in energies)
            if count:
                does = f"a model that {verdict} light" if count == 1 else f"models that {verdict[:-1]} light"
                of_model = f"{counted(count, 'table')} of {does} where nothing absorbs it"
                sentences.append(f"{of_model}: the report gives the amount and the angle")
        return sentences


def _largest(word: Word, albedo: float | None, theta_i_deg: float) -> Cell:
    return Cell(word, f"{_albedo(albedo)} at {theta_i_deg:.4g}°", LAST if albedo is None else albedo)


def _albedo(value: float | None) -> str:
    return "not finite" if value is None else f"{value:.4f}"


def furnace_cell(furnace: Furnace | None) -> Cell:
    """Return the albedo [1] of the lossless surface in uniform light, at the worst wavelength."""
    values = [] if furnace is None else [value for value in furnace.hemispherical if value is not None]
    if not values:
        return Cell("unknown", "no lossless form", LAST)
    worst = max(values, key=lambda value: abs(value - 1.0))
    word: Word = "loses" if worst < LOSSLESS else "gains" if worst > 2.0 - LOSSLESS else "conserves"
    return Cell(word, f"{worst:.3f}", worst)


def energy_of(
    table: Table, source: Source | None, *, accept_excess: bool = False, grazing: Grazing | None = None
) -> Energy:
    """Return the energy of a model and its table. With `accept_excess` both may exceed 1 by the excess of the model.

    `grazing` is the albedo of the source for lights beyond the last; by default it is measured.
    """
    if source is None:
        stored = table_energy_of(table, None)
        if stored.max_albedo is not None:
            beyond = grazing_of_table(table, stored.max_albedo, stored.theta_i_deg[-1])
            stored = stored.model_copy(update={"grazing": beyond})
        verdict: EnergyVerdict = "conserves" if stored.verdict == "passes" else stored.verdict
        largest = table.metadata.largest_albedo
        if verdict == "conserves" and largest is not None and largest.of == "source" and largest.above_1:
            reason = f"the table states of its function: {largest.in_words()}"
            return Energy(
                model=None, table=stored, verdict="accepted excess" if accept_excess else "violates", reason=reason
            )
        return Energy(model=None, table=stored, verdict=verdict, reason=stored.reason)
    known = published_excess(source, table.wavelength_nm) if isinstance(source, Material) else None
    stated = table.metadata.known_excess
    claim = "" if stated is None else stated.citation
    model = model_energy_of(source, table.wavelength_nm, known, claim, accept_excess=accept_excess, grazing=grazing)
    # The excess that is published or accepted is that of the model. An excess of the table alone is excused by neither
    excess = known if model.verdict == "known published excess" else None
    most = model.max_albedo
    first = model.exceeds_1_from_theta_i_deg
    if model.verdict in ("accepted excess", "violates") and first is not None and most is not None:
        excess = KnownExcess(
            max_albedo=most + TOLERANCE,
            from_theta_i_deg=max(first - 2.0 * ANGLE_TOLERANCE_DEG, 0.0),
            citation=_ACCEPTED if model.verdict == "accepted excess" else _OF_MODEL,
        )
    excused = model.verdict if model.verdict in ("accepted excess", "violates") else "known published excess"
    stored = table_energy_of(table, excess, excused)
    of_table: EnergyVerdict = "conserves" if stored.verdict == "passes" else stored.verdict
    if _SEVERITY.index(of_table) > _SEVERITY.index(model.verdict):
        reason = stored.reason if of_table.startswith("known") else f"the table {stored.reason}"
        return Energy(model=model, table=stored, verdict=of_table, reason=reason)
    return Energy(model=model, table=stored, verdict=model.verdict, reason=model.reason)


def panels_of(model: ModelEnergy | None, table: TableEnergy) -> list[Panel]:
    """Return the panels of a table, and of its model if it is known."""
    panels: list[Panel] = []
    strongest = 0
    at = ""
    wavelengths = table.wavelength_nm
    if wavelengths is not None and len(wavelengths) > 1:
        albedo = np.array((table if model is None else model).albedo, dtype=np.float64)  # nan for None
        strongest = int(np.argmax(np.nan_to_num(albedo, nan=-np.inf).max(axis=0)))
        at = f" at {wavelengths[strongest]:g} nm"
        if model is not None:
            curves = _spectral(model.theta_i_deg, model.albedo, wavelengths)
            panels.append(Panel(title="Albedo of the model", x_label=_THETA, y_label=_ALBEDO, curves=curves))
        curves = [Curve(label="table", x=wavelengths, y=table.hemispherical, role="ours")]
        if model is not None:
            curves.append(Curve(label="model", x=wavelengths, y=model.hemispherical, role="truth"))
        panels.append(Panel(title="In uniform light", x_label="wavelength, nm", y_label="albedo", curves=curves))
    both = [Curve(label="table", x=table.theta_i_deg, y=_column(table.albedo, strongest), role="ours")]
    if model is not None:
        both.append(Curve(label="model", x=model.theta_i_deg, y=_column(model.albedo, strongest), role="truth"))
    title = f"{'Table' if model is None else 'Model and table'}{at}"
    panels.append(Panel(title=title, x_label=_THETA, y_label=_ALBEDO, curves=[*both, _ALL_OF_IT]))
    if model is not None and model.furnace is not None:
        furnace = model.furnace
        curves = [*_spectral(furnace.theta_i_deg, furnace.albedo, furnace.wavelength_nm), _IDEAL]
        panels.append(Panel(title="White furnace: made lossless", x_label=_THETA, y_label=_ALBEDO, curves=curves))
    if model is not None and model.bound_on_a is not None and len(model.bound_on_a.wavelength_nm) > 1:
        x = model.bound_on_a.wavelength_nm
        curves = [
            Curve(label="this material", x=x, y=model.bound_on_a.preset, role="ours"),
            Curve(label="largest that conserves", x=x, y=model.bound_on_a.largest, role="truth"),
        ]
        title = "Uniform diffuse part a(λ)"
        panels.append(Panel(title=title, x_label="wavelength, nm", y_label="a(λ)", curves=curves))
    return panels


def _spectral(x: list[float], rows: list[Numbers], wavelengths: list[float] | None) -> list[Curve]:
    """Return curves at a few wavelengths, the first and the last among them."""
    if wavelengths is None or len(rows[0]) == 1:
        return [Curve(label="model", x=x, y=_column(rows, 0), role="ours")]
    count = min(_CURVES, len(wavelengths))
    chosen = sorted({round(k * (len(wavelengths) - 1) / max(count - 1, 1)) for k in range(count)})
    return [Curve(label=f"{wavelengths[k]:g} nm", x=x, y=_column(rows, k)) for k in chosen]


def _column(rows: list[Numbers], k: int) -> Numbers:
    return [row[k] for row in rows]
