"""Physical realisability of the Mueller matrices of a table, and their error against the model."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from brdfdb.audit.finding import LAST, Cell, Finding, NumberTable, Sentence, Subject, Verdict
from brdfdb.figure import number
from brdfdb.geometry import spherical_angles
from brdfdb.measurements.mueller import OF_TRACE, TOLERANCE, PhysicalShare, half_difference_angles
from brdfdb.tables import error_measurement
from brdfdb.tables.statements import element_error

# directions of a band of theta_i, others than those of the stated error
_DIRECTIONS = 400
_SEED = 1986
# Allowed ratio of the error at these directions to the stated one, both a 99th percentile of a sample: measured up to
# 1.13
_OF_STATED = 1.5
_ROUNDING = 1e-6  # of elements, which are float32, of 24 bits


class PolarisationFinding(Finding):
    """Cloude's eigenvalues of the Mueller matrices of a table, and the error of their normalised elements."""

    key = "polarisation"
    order = 7
    explanation = (
        "A Mueller matrix is physically realisable if no eigenvalue of its coherency matrix is negative (Cloude 1986): "
        "it is then a sum of Jones matrices. Eigenvalues are divided by the trace. Negative values up to the stated "
        "error of the stored matrix elements are allowed, because interpolated matrices may break the condition even "
        "if those at the nodes obey it; of measured data, up to their noise, or 0.001. Tables of measured data are "
        "judged where they were measured, and the share of the matrices that are physical to 0.001 is given, with the "
        "Stokes criterion: no light leaves more than fully polarised. It alone judges tables with fewer than sixteen "
        "elements, by I less sqrt(Q^2 + U^2 + V^2) in place of the smallest eigenvalue. Unpolarised tables have no "
        "such matrices."
    )

    lookups: int = Field(description="directions and wavelengths at which the table was looked up; 0: unpolarised")
    smallest_eigenvalue: float = Field(description="smallest eigenvalue of the coherency matrix over its trace")
    eigenvalue_tolerance: float = Field(description="largest amount by which it may be negative")
    physical: float = Field(
        default=1.0, description="share [0, 1] of the lookups whose eigenvalues are at least -0.001 of the trace"
    )
    stokes: float = Field(
        default=1.0, description="share [0, 1] of the lookups that make no light more polarised than 1.004"
    )
    measured_physical: float | None = Field(
        default=None, description="share [0, 1] of the measured matrices that are physical; null: a model's"
    )
    where: list[str] = Field(default=[], description="the shares of the lookups in words, and where they are lowest")
    error_p99: float | None = Field(
        description="99th percentile of the error of the worst normalised element, at other directions than those of "
        "the stated error; null: the source is not known, or measured"
    )
    stated_p99: float | None = Field(description="the same, as the table states it; null: it states none")
    verdict: Verdict

    @classmethod
    def judge(cls, subject: Subject) -> Finding:
        """Judge a polarised table; of an unpolarised one, return a finding without lookups."""
        table = subject.table
        record = subject.table.metadata.polarisation
        if table.facets is None:
            return cls(
                lookups=0,
                smallest_eigenvalue=0.0,
                eigenvalue_tolerance=0.0,
                error_p99=None,
                stated_p99=None,
                verdict="passes",
            )
        drawn = error_measurement.draw(subject.source, table.wavelength_nm, _DIRECTIONS, _SEED)
        wi = drawn.wi[drawn.above]
        wr = drawn.wr[drawn.above]
        measured = None if record is None else record.measured
        error = None if record is None else record.error
        if measured is not None:
            known = ~table.extrapolated(*spherical_angles(wi), *spherical_angles(wr))
            wi = wi[known]
            wr = wr[known]
        mueller = table.mueller_vectors(wi, wr)
        mueller = mueller if table.wavelength_nm is not None else mueller[:, np.newaxis]
        share = PhysicalShare(table.wavelength_nm)
        share.add(mueller, half_difference_angles(wi, wr))
        allowed = _ROUNDING + (0.0 if error is None else error.facet)
        if measured is not None:
            allowed = max(TOLERANCE, measured.noise) * (1.0 if share.whole else OF_TRACE)
        stated = None if record is None else record.p99
        of_model = None
        if measured is None and subject.source is not None:
            of_model = element_error(table, subject.source, _SEED).worst_p99
        within = of_model is None or stated is None or of_model <= _OF_STATED * stated + _ROUNDING
        smallest = share.smallest if share.whole else min(0.0, -share.most_excess)
        return cls(
            lookups=share.count,
            smallest_eigenvalue=smallest,
            eigenvalue_tolerance=allowed,
            physical=share.share,
            stokes=share.stokes_share,
            measured_physical=None if measured is None else measured.physical,
            where=share.sentences(),
            error_p99=of_model,
            stated_p99=stated,
            verdict="passes" if smallest >= -allowed and within else "violates",
        )

    def sentences(self) -> list[Sentence]:
        """Return sentences on the smallest eigenvalue and the error of the elements, and where they are unphysical."""
        if not self.lookups:
            return [self.sentence(self.verdict, "the table is unpolarised")]
        allowed = number(-self.eigenvalue_tolerance, 2)
        text = f"smallest eigenvalue {number(self.smallest_eigenvalue, 2)}, of {allowed} allowed"
        if self.smallest_eigenvalue < -self.eigenvalue_tolerance:
            text = f"not physically realisable: {text}"
        if self.error_p99 is not None and self.stated_p99 is not None:
            text += f"; error of the elements {number(self.error_p99, 2)}, stated {number(self.stated_p99, 2)}"
        if self.measured_physical is not None:
            text += f"; {100.0 * self.physical:.4g} % of the lookups are physical to 0.001, and "
            text += f"{100.0 * self.measured_physical:.4g} % of the measured matrices"
            if self.stated_p99 is not None:
                text += f"; error of the elements {number(self.stated_p99, 2)} (p99)"
        sentences = [self.sentence(self.verdict, text)]
        if self.physical < 1.0:
            sentences += [self.sentence(self.verdict, text) for text in self.where[1:]]
        return sentences

    def cells(self) -> list[Cell]:
        """Return the smallest eigenvalue, or a dash for an unpolarised table."""
        if not self.lookups:
            return [Cell(self.verdict, "–", LAST)]
        return [Cell(self.verdict, number(self.smallest_eigenvalue, 2), self.smallest_eigenvalue)]

    def tables(self) -> list[NumberTable]:
        """Return the numbers of the sentence."""
        if not self.lookups:
            return []
        row = (
            str(self.lookups),
            *(number(value, 2) for value in (self.smallest_eigenvalue, -self.eigenvalue_tolerance)),
            *(number(value, 4) for value in (self.physical, self.stokes)),
            *("-" if value is None else number(value, 2) for value in (self.error_p99, self.stated_p99)),
        )
        shares = ("lookups", "smallest eigenvalue", "allowed", "physical", "Stokes criterion")
        headings = (*shares, "error of elements (p99)", "stated")
        return [NumberTable("Mueller matrices", headings, [row])]
