"""The glints of a table of measured data, and the samples and incidences that the table misses."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import BaseModel, Field

from brdfdb.audit.finding import LAST, STRICT, Cell, Finding, NumberTable, Sentence, Subject, Word
from brdfdb.errors import counted, percent
from brdfdb.figure import number
from brdfdb.geometry import radians, unit_vector
from brdfdb.measurements.glints import Glint, Glints, sentence_of
from brdfdb.measurements.record import IncidenceEnergy, Measured, WorstSample

MOST_OFF = 0.05  # largest difference of the table from a sample that passes, relative to it or to the floor
MOST_ENERGY_OFF = 0.02  # the same of the energy of an incidence
_LOST = 0.1  # difference of the energy of an incidence that violates, or the tolerance of the table if it is larger
_NORMAL_95 = 2.0  # standard deviations within which 95 of 100 values of normal noise lie
_NAMED = 5  # incidences that a sentence names


class GlintCheck(BaseModel):
    """A glint, and f_r of it with light and viewer exchanged."""

    model_config = STRICT

    glint: Glint
    asymmetry: float = Field(
        description="abs(f - f') / (f + f') at its centre, f' with light and viewer exchanged, largest over wavelengths"
    )


class GlintsFinding(Finding):
    """The glints of a table, their reciprocity, and the samples and incidences that the table misses."""

    key = "glints"
    order = 4
    title = "Glints and samples"
    columns = ("worst sample",)
    explanation = (
        "Measured f_r may have peaks that no grid holds. They are glints: Gaussians beside the grid, which lookups, "
        "samples and albedos include. A table is compared with its samples at their own directions: a sample that it "
        "misses by more than 5 % is outside, and so is an incidence whose energy, the trapezoid sum of f_r cos theta_r "
        "over its samples, it changes by more than 2 %. Noise makes such differences, too: they do not count for the "
        "verdict, unless an incidence is off by more than 10 %, and more than the tolerance of the table. Of a glint "
        "that one sample shows, width and power are upper bounds. Between the lights that were measured a glint is a "
        "guess, and f_r of it with light and viewer exchanged may differ. Doubts about the file come from its import, "
        "and do not count for the verdict."
    )

    glints: list[GlintCheck]
    doubts: list[str] = Field(default=[], description="what looks wrong in the file, as its statement says")
    held_out_p95: float | None = Field(description="the same at samples that the interpolation did not get; null: none")
    p95: float | None = Field(
        description="95th percentile of the relative differences from samples; null: the table records no samples"
    )
    worst: WorstSample | None = Field(description="null: the table records no samples")
    energies: list[IncidenceEnergy] = Field(description="incidences whose energy is off by more than 2 %, worst first")
    worst_energy: IncidenceEnergy | None = Field(description="null: no incidence has samples enough")
    verdict: Literal["passes", "outside", "violates"]

    @classmethod
    def judge(cls, subject: Subject) -> Finding:
        """Return what the table records of its glints and samples; nothing of a table of a model."""
        measured = subject.table.metadata.measured
        at_samples = None if measured is None else measured.at_samples
        energies = [] if at_samples is None else sorted(at_samples.energies, key=lambda energy: -energy.error)
        missed = [energy for energy in energies if energy.error > MOST_ENERGY_OFF]
        outside = bool(missed) or (at_samples is not None and at_samples.worst.error > MOST_OFF)
        allowed = max(_LOST, subject.table.metadata.whole_request.get("tolerance") or 0.0)
        lost = bool(missed) and missed[0].error > allowed
        return cls(
            glints=checks_of(subject.table.glints),
            doubts=[] if measured is None else measured.doubts,
            held_out_p95=None if measured is None or measured.held_out is None else measured.held_out.p95,
            p95=None if at_samples is None else at_samples.p95,
            worst=None if at_samples is None else at_samples.worst,
            energies=missed,
            worst_energy=energies[0] if energies else None,
            verdict="violates" if lost else "outside" if outside else "passes",
        )

    def sentences(self) -> list[Sentence]:
        """Return a sentence on each doubt, on samples, on incidences and on glints."""
        sentences = [self.sentence("unknown", doubt, title="Doubt about the file") for doubt in self.doubts]
        if self.worst is not None and self.p95 is not None:
            text = f"95 of 100 samples are within {percent(self.p95)} of the table; worst {self.worst.sentence}"
            if self.held_out_p95 is not None:
                text += f"; 95 of 100 that were held out are within {percent(self.held_out_p95)} of the interpolation"
            word: Word = "outside" if self.worst.error > MOST_OFF else "passes"
            sentences.append(self.sentence(word, text, title="Table at the samples"))
        if self.worst_energy is not None:
            text = f"energy, summed over the samples, within {percent(self.worst_energy.error)} for each incidence"
            word = "violates" if self.verdict == "violates" else "outside" if self.energies else "passes"
            if self.energies:
                text = f"energy, summed over the samples: {counted(len(self.energies), 'incidence')} off by more than "
                text += f"{percent(MOST_ENERGY_OFF)}: " + "; ".join(
                    f"{percent(energy.error)} at theta_i {energy.theta_i_deg:g}°, phi_i {energy.phi_i_deg:g}°"
                    for energy in self.energies[:_NAMED]
                )
            sentences.append(self.sentence(word, text, title="Energy of incidences"))
        if self.glints:
            asymmetry = max(check.asymmetry for check in self.glints)
            named = sentence_of([check.glint for check in self.glints])
            text = f"{named}; with light and viewer exchanged they differ by up to {percent(asymmetry)}"
            sentences.append(self.sentence("passes", text, title="Glints"))
        return sentences or [self.sentence("passes", "the table records no samples and has no glints")]

    def problems(self) -> list[str]:
        """Return the sentences on doubts, on what the table misses, and on its glints."""
        named = [sentence for sentence in self.sentences() if sentence.word != "passes" or sentence.title == "Glints"]
        return [sentence.text for sentence in named]

    def cells(self) -> list[Cell]:
        """Return the error at the worst sample, and the number of glints."""
        parts = [] if self.worst is None else [f"{percent(self.worst.error)} off"]
        parts += [counted(len(self.glints), "glint")] if self.glints else []
        sort = LAST if self.worst is None else self.worst.error
        return [Cell(self.verdict, ", ".join(parts) or "–", sort)]

    def tables(self) -> list[NumberTable]:
        """Return the glints, a row each, and the incidences that are off."""
        of_glints = (
            "theta_i/phi_i, degrees",
            "from the mirror direction, degrees",
            "full width at half maximum, degrees",
            "power",
            "asymmetry",
        )
        glints = [
            (
                _light(glint),
                f"{glint.in_plane_deg:.3g} in the plane, {glint.across_deg:.3g} across",
                f"{'' if glint.resolved else 'at most '}{glint.fwhm_deg:.3g}",
                f"{'' if glint.resolved else 'at most '}{number(max(glint.power), 3)}",
                number(asymmetry, 2),
            )
            for glint, asymmetry in ((check.glint, check.asymmetry) for check in self.glints)
        ]
        energies = [
            (_light(one), one.channel, number(one.samples, 4), number(one.table, 4), percent(one.error))
            for one in self.energies
        ]
        of_energies = ("theta_i/phi_i, degrees", "channel", "samples", "table", "off")
        return [
            NumberTable("Glints", of_glints, glints),
            NumberTable("Incidences whose energy is off", of_energies, energies),
        ]


def _light(of: Glint | IncidenceEnergy) -> str:
    return f"{of.theta_i_deg:g}/{of.phi_i_deg:g}"


def resting_on(measured: Measured | None) -> str:
    """Return what a verdict on a table rests on, such as "where measured, 1.4 %", in clauses; empty: f_r is known.

    Others are the share of the samples that the table misses by more than their noise, and what the file leaves in
    doubt.
    """
    if measured is None:
        return ""
    clauses = [measured.where] if measured.where else []
    found = measured.at_samples
    noise = 0.0 if measured.noise is None else measured.noise.p95
    if found is not None and found.within and found.p95 > max(MOST_OFF, _NORMAL_95 * noise):
        missed = f"{percent(1.0 - found.within)} of the samples off by more than {percent(MOST_OFF)}"
        clauses.append(missed if clauses else f"but {missed}")
    if measured.doubts:
        named = dict.fromkeys(doubt.partition("?")[0].partition(":")[0].lower() for doubt in measured.doubts)
        clauses.append(f"{'the' if clauses else 'but the'} file leaves doubts: {', '.join(named)}")
    return "; ".join(clauses)


def checks_of(glints: Glints | None) -> list[GlintCheck]:
    """Return the glints that have power, each with its asymmetry."""
    lit = () if glints is None else glints.lit
    if glints is None or not lit:
        return []
    wi = unit_vector(radians([glint.theta_i_deg for glint in lit]), radians([glint.phi_i_deg for glint in lit]))
    wr = np.stack([glint.centre for glint in lit])
    f_r, exchanged = glints.f_r(wi, wr), glints.f_r(wr, wi)
    total = f_r + exchanged
    relative = np.divide(np.abs(f_r - exchanged), total, out=np.zeros(total.shape), where=total > 0.0).max(axis=1)
    return [
        GlintCheck(glint=glint, asymmetry=float(f"{asymmetry:.3g}"))
        for glint, asymmetry in zip(lit, relative.tolist(), strict=True)
    ]
