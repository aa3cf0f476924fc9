"""Physical realisability of the Mueller matrices of a table, and their error against the model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from brdfdb.audit.finding import LAST, Cell, Finding, NumberTable, Sentence, Subject, Verdict
from brdfdb.figure import number
from brdfdb.parameters import Floats
from brdfdb.tables import error_measurement
from brdfdb.tables.statements import element_error

# directions of a band of theta_i, others than those of the stated error
_DIRECTIONS = 400
_SEED = 1986
# Allowed ratio of the error at these directions to the stated one, both a 99th percentile of a sample: measured up to
# 1.13
_OF_STATED = 1.5
_ROUNDING = 1e-6  # of elements, which are float32, of 24 bits

# sigma_i x conj(sigma_j), which sum, weighted by the elements of a Mueller matrix, to its coherency matrix
_PAULI = np.array([[[1, 0], [0, 1]], [[1, 0], [0, -1]], [[0, 1], [1, 0]], [[0, -1j], [1j, 0]]])
_BASIS = np.array([[np.kron(a, b.conj()) for b in _PAULI] for a in _PAULI])


class PolarisationFinding(Finding):
    """Cloude's eigenvalues of the Mueller matrices of a table, and the error of their normalised elements."""

    key = "polarisation"
    order = 7
    explanation = (
        "A Mueller matrix is physically realisable if no eigenvalue of its coherency matrix is negative (Cloude 1986): "
        "it is then a sum of Jones matrices. Eigenvalues are divided by the trace. Negative values up to the stated "
        "error of the stored matrix elements are allowed, because interpolated matrices may break the condition even "
        "if those at the nodes obey it. Unpolarised tables have no such matrices."
    )

    lookups: int = Field(description="directions and wavelengths at which the table was looked up; 0: unpolarised")
    smallest_eigenvalue: float = Field(description="smallest eigenvalue of the coherency matrix over its trace")
    eigenvalue_tolerance: float = Field(description="largest amount by which it may be negative")
    error_p99: float | None = Field(
        description="99th percentile of the error of the worst normalised element, at other directions than those of "
        "the stated error; null: the source is not known"
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
        stated = None if record is None else record.error
        drawn = error_measurement.draw(subject.source, table.wavelength_nm, _DIRECTIONS, _SEED)
        mueller = table.mueller_vectors(drawn.wi[drawn.above], drawn.wr[drawn.above])
        eigenvalues = coherency_eigenvalues(mueller[mueller[..., 0, 0] > 0.0])
        allowed = _ROUNDING + (0.0 if stated is None else stated.facet)
        measured = None if subject.source is None else element_error(table, subject.source, _SEED).worst_p99
        within = measured is None or stated is None or measured <= _OF_STATED * stated.worst_p99 + _ROUNDING
        smallest = float(eigenvalues.min(initial=0.0))
        return cls(
            lookups=len(eigenvalues),
            smallest_eigenvalue=smallest,
            eigenvalue_tolerance=allowed,
            error_p99=measured,
            stated_p99=None if stated is None else stated.worst_p99,
            verdict="passes" if smallest >= -allowed and within else "violates",
        )

    def sentences(self) -> list[Sentence]:
        """Return a sentence on the smallest eigenvalue and the error of the elements."""
        if not self.lookups:
            return [self.sentence(self.verdict, "the table is unpolarised")]
        allowed = number(-self.eigenvalue_tolerance, 2)
        text = f"smallest eigenvalue {number(self.smallest_eigenvalue, 2)}, of {allowed} allowed"
        if self.smallest_eigenvalue < -self.eigenvalue_tolerance:
            text = f"not physically realisable: {text}"
        if self.error_p99 is not None and self.stated_p99 is not None:
            text += f"; error of the elements {number(self.error_p99, 2)}, stated {number(self.stated_p99, 2)}"
        return [self.sentence(self.verdict, text)]

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
            *("-" if value is None else number(value, 2) for value in (self.error_p99, self.stated_p99)),
        )
        headings = ("lookups", "smallest eigenvalue", "allowed", "error of elements (p99)", "stated")
        return [NumberTable("Mueller matrices", headings, [row])]


def coherency_eigenvalues(mueller: Floats) -> NDArray[np.float64]:
    """Return Cloude's eigenvalues [1] of Mueller matrices (N, 4, 4), over the trace of the coherency matrix: (N, 4)."""
    coherency = np.einsum("nij,ijab->nab", np.asarray(mueller, np.float64), _BASIS) / 4.0
    trace = np.trace(coherency, axis1=1, axis2=2).real
    return np.asarray(np.linalg.eigvalsh(coherency) / trace[:, np.newaxis])
