"""The signs and the finiteness of the stored values and of f_r between them."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from brdfdb.audit.finding import Cell, Finding, Sentence, Subject, Verdict
from brdfdb.figure import number
from brdfdb.parameters import Floats
from brdfdb.tables.albedo import linear_in_angles
from brdfdb.tables.table import Table


class ValueCounts(Finding):
    """Counts of stored values and of values of f_r that are negative or not finite."""

    key = "values"
    order = 3
    explanation = (
        "Stored values and f_r between the nodes are finite, and f_r is not negative. Values at nodes below the "
        "horizon may be negative: they continue the table, and lookups are clipped at 0."
    )

    count: int = Field(description="number of stored values")
    looked_up: int = Field(description="number of lookups between the nodes; 0: f_r is linear between nodes")
    smallest: float | None = Field(description="smallest f_r at the nodes and of the lookups; null: none is finite")
    negative: int = Field(description="number of negative values of f_r and of the specular part")
    not_finite: int = Field(description="number of these values, and of the stored ones, that are not finite")
    positivity: Verdict
    finiteness: Verdict
    verdict: Verdict = Field(description="worse of the two")

    @classmethod
    def judge(cls, subject: Subject) -> ValueCounts:
        """Return the counts of values of a table that are negative or not finite."""
        # A linear interpolant is never below its nodes
        pairs = subject.pairs
        linear = linear_in_angles(subject.table)
        return values_of(subject.smooth, None if linear else pairs.table[pairs.drawn.above])

    def sentences(self) -> list[Sentence]:
        """Return a sentence on the sign of the values, and one on those that are not finite."""
        negative = f"{self.negative} values are negative; the smallest f_r is {number(self.smallest)} 1/sr"
        finite = f"{self.not_finite} of {self.count} stored values and {self.looked_up} lookups are not finite"
        return [
            self.sentence(self.positivity, negative, title="Positivity"),
            self.sentence(self.finiteness, finite, title="Finiteness"),
        ]

    def cells(self) -> list[Cell]:
        """Return the number of bad values."""
        bad = self.negative + self.not_finite
        return [Cell(self.verdict, f"{bad} bad" if bad else "all good", bad)]


def values_of(table: Table, looked_up: Floats | None) -> ValueCounts:
    """Return the counts of values that are negative or not finite, at nodes and in lookups of f_r [1/sr].

    `looked_up` is None for a table that is linear between its nodes. Nodes over half and difference vectors may be
    negative: those below the horizon continue the table, and lookups are clipped at 0.
    """
    brdf: list[Floats] = [table.brdf] if looked_up is None else [table.brdf, looked_up]
    judged = [looked_up] if looked_up is not None and table.grid.half_difference else brdf
    specular: list[Floats] = [] if table.specular is None else [table.specular]
    reflected = [*brdf, *specular]
    apart: list[Floats] = [array for array in (table.spectra, table.uniform) if array is not None]
    others = apart if table.values_are_brdf else [table.values, *apart]
    not_finite = sum(array.size - int(np.count_nonzero(np.isfinite(array))) for array in (*reflected, *others))
    # -inf counts as not finite, not as negative
    negative = sum(int(np.count_nonzero((array < 0.0) & np.isfinite(array))) for array in (*judged, *specular))
    smallest = min(float(np.min(array, initial=np.inf, where=np.isfinite(array))) for array in judged)
    return ValueCounts(
        count=sum(array.size for array in (table.values, *apart))
        + (0 if table.specular is None else table.specular.size),
        looked_up=0 if looked_up is None else len(looked_up),
        smallest=smallest if np.isfinite(smallest) else None,
        negative=negative,
        not_finite=not_finite,
        positivity="violates" if negative else "passes",
        finiteness="violates" if not_finite else "passes",
        verdict="violates" if negative or not_finite else "passes",
    )
