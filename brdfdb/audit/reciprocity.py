"""Reciprocity of a table and of its model: f_r compared with f_r with light and viewer exchanged."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, Field

from brdfdb._elementary import COS_HORIZON
from brdfdb.audit.finding import STRICT, Cell, Finding, NumberTable, Sentence, Subject, Verdict
from brdfdb.audit.pairs import ComparedPairs
from brdfdb.figure import number
from brdfdb.parameters import Floats
from brdfdb.tables.albedo import wavelengths_of
from brdfdb.tables.grids import Grid
from brdfdb.tables.table import Table

# Tolerance of the asymmetry of a model [1]. Rounding is worst where exp(-V) has a large exponent: measured 3e-13
MODEL_RECIPROCITY_TOLERANCE = 1e-11
# Tolerance of the asymmetry of stored values [1]. float32 rounds values that differ by the tolerance of the model to
# the same number or to neighbours, 6e-8 apart: measured 0
TABLE_RECIPROCITY_TOLERANCE = 1e-6
# Tolerance of the asymmetry of lookups [1], after the offset of the logarithm is added to f_r. The same numbers are
# summed in another order: measured 1.6e-14. If the pole at the horizon is taken out, the offset is divided by the
# cosines, as f_r is
LOOKUP_RECIPROCITY_TOLERANCE = 5e-14
_TINY = 1e-270  # value [1/sr] below which f_r carries too few digits


class Asymmetry(BaseModel):
    """The asymmetry abs(f - f') / (abs(f) + abs(f')) over pairs of directions; f' has light and viewer exchanged."""

    model_config = STRICT

    pairs: int
    min: float
    mean: float
    median: float | None = None  # reports written earlier do not have both
    p99: float | None = None
    max: float
    tolerance: float | None = Field(
        description="largest allowed max, or p99 of measured data; null: not judged, because f and f' are interpolated "
        "from different nodes, or the uncertainty of measured data is not known"
    )
    measured: bool = Field(default=False, description="true: p99 is judged, within the uncertainty of measured data")

    @property
    def kept(self) -> bool:
        """Return True if the asymmetry is allowed, or not judged."""
        return (
            self.tolerance is None
            or (self.p99 if self.measured and self.p99 is not None else self.max) <= self.tolerance
        )


class Reciprocity(Finding):
    """Asymmetry of the model at the parameters of the table, and of the table.

    Values of the table are looked up. If they are interpolated in logarithms, the offset of the logarithms is added.
    """

    key = "reciprocity"
    order = 2
    explanation = (
        "Asymmetry is |f − f′| / (|f| + |f′|), where f′ has light and viewer exchanged. 0 is reciprocal "
        "(Helmholtz), 1 is the largest possible asymmetry. Measured data have noise. Of their asymmetries, "
        "99 of 100 must be explained by the uncertainty of the data and the stated error of the table. Only pairs of "
        "directions that were measured in both orders are judged."
    )

    model_random: Asymmetry | None = Field(description="viewers over the hemisphere; null: the source is not known")
    model_lobe: Asymmetry | None = Field(
        description="viewers in the lobe and on its shoulder; null: the model has no lobe"
    )
    table_random: Asymmetry
    table_lobe: Asymmetry | None
    table_nodes: Asymmetry | None = Field(
        description="over all pairs of nodes that the grid also holds exchanged; null: half and difference vectors"
    )
    verdict: Verdict

    @classmethod
    def judge(cls, subject: Subject) -> Reciprocity:
        """Judge a table and its source; without a source the table alone."""
        both = reciprocity_of(subject.smooth, subject.pairs)
        if subject.source is not None and subject.table.metadata.measured is None:
            return both
        return both.model_copy(update={"model_random": None, "model_lobe": None}).judged()

    def judged(self) -> Reciprocity:
        """Return the same asymmetries with the verdict that follows from them."""
        good = all(pairs.kept for _, pairs in self.named())
        return self.model_copy(update={"verdict": "passes" if good else "violates"})

    def sentences(self) -> list[Sentence]:
        """Return a sentence on the largest asymmetry of those that are judged."""
        if any(asymmetry.measured for _, asymmetry in self.named()):
            measured = [asymmetry for _, asymmetry in self.named() if asymmetry.measured]
            worst = max(measured, key=lambda asymmetry: asymmetry.p99 or 0.0)
            text = f"asymmetry of the table: median {_shown(worst.median)}, 99 of 100 up to {_shown(worst.p99)}"
            if worst.tolerance is None:
                text += "; not judged, because the uncertainty of the data is not known"
            else:
                text += f", of {number(worst.tolerance, 2)} that its uncertainty, its stated error and rounding explain"
            return [self.sentence(self.verdict, text)]
        judged = [
            (asymmetry.max, asymmetry.tolerance) for _, asymmetry in self.named() if asymmetry.tolerance is not None
        ]
        if not judged:
            text = "light and viewer have different nodes, so that lookups need not be symmetric"
            return [self.sentence(self.verdict, text)]
        most, allowed = max(judged, key=lambda pair: (pair[0] > pair[1], pair[0]))
        text = f"asymmetry up to {number(most)}, of {number(allowed)} allowed"
        return [self.sentence(self.verdict, text if most <= allowed else f"not reciprocal: {text}")]

    def cells(self) -> list[Cell]:
        """Return the largest asymmetry."""
        largest = max(asymmetry.max for _, asymmetry in self.named())
        return [Cell(self.verdict, number(largest, 2), largest)]

    def tables(self) -> list[NumberTable]:
        """Return the asymmetry of each set of pairs."""
        rows = [
            (
                name,
                str(asymmetry.pairs),
                *(_shown(value) for value in (asymmetry.mean, asymmetry.median, asymmetry.p99)),
                *(number(value, 2) for value in (asymmetry.max, asymmetry.tolerance)),
            )
            for name, asymmetry in self.named()
        ]
        return [
            NumberTable("Asymmetry", ("of", "pairs", "mean", "median", "99th percentile", "largest", "allowed"), rows)
        ]

    def named(self) -> list[tuple[str, Asymmetry]]:
        """Return the sets of pairs that there are, with their names."""
        named = (
            ("model, random directions", self.model_random),
            ("model, in the lobe", self.model_lobe),
            ("table, random directions", self.table_random),
            ("table, in the lobe", self.table_lobe),
            ("table, its nodes", self.table_nodes),
        )
        return [(name, asymmetry) for name, asymmetry in named if asymmetry is not None]


def reciprocity_of(table: Table, pairs: ComparedPairs) -> Reciprocity:
    """Return the asymmetry of random pairs, of pairs in the lobe, and of all pairs of nodes."""
    above = pairs.drawn.above
    in_lobe = pairs.drawn.in_lobe
    measured = table.metadata.measured
    if measured is not None and measured.extent is not None:
        wi, wr = pairs.drawn.wi, pairs.drawn.wr
        above = above & ~(measured.extent.outside(wi, wr) | measured.extent.outside(wr, wi))
    interpolation = table.interpolation
    mu = np.maximum(pairs.drawn.wi[:, 2:] * pairs.drawn.wr[:, 2:], COS_HORIZON**2)
    offset = interpolation.offset / mu**interpolation.power  # f_r far below the offset is rounding only
    allowed = _interpolant_tolerance(table.grid)
    if measured is not None and not (table.grid.reciprocal and measured.reciprocity.assumed):
        stated = 0.0 if table.error is None else table.error.overall.p99
        allowed = None if measured.uncertainty is None else measured.uncertainty + stated

    def of(f: Floats, exchanged: Floats, tolerance: float | None, *, measured: bool) -> list[Asymmetry | None]:
        """Return the asymmetry of random viewers, and that of viewers in the lobe."""
        chosen = [above & ~in_lobe, above & in_lobe]
        both = [_asymmetry(f[rows], exchanged[rows], tolerance, measured=measured) for rows in chosen]
        return [both[0], both[1] if in_lobe.any() else None]

    model_random, model_lobe = of(pairs.model, pairs.model_exchanged, MODEL_RECIPROCITY_TOLERANCE, measured=False)
    table_random, table_lobe = of(
        pairs.table + offset, pairs.table_exchanged + offset, allowed, measured=measured is not None
    )
    assert table_random is not None
    return Reciprocity(
        model_random=model_random,
        model_lobe=model_lobe,
        table_random=table_random,
        table_lobe=table_lobe,
        table_nodes=None if table.grid.half_difference or measured is not None else _node_asymmetry(table),
        verdict="passes",
    ).judged()


def _interpolant_tolerance(grid: Grid) -> float | None:
    """Return the allowed asymmetry [1] of lookups; None where light and viewer have different nodes."""
    if grid.half_difference:
        return LOOKUP_RECIPROCITY_TOLERANCE
    same = np.array_equal(grid.axes["theta_i"], grid.axes["theta_r"])
    if grid.anisotropic:
        same = same and np.array_equal(grid.axes["phi_i"], grid.axes["phi_r"])
    return TABLE_RECIPROCITY_TOLERANCE if same else None


def _node_asymmetry(table: Table) -> Asymmetry:
    """Return the asymmetry [1] of all stored values, so that a single wrong value is noticed."""
    axes = table.axes_deg
    _, i, r = np.intersect1d(axes["theta_i"], axes["theta_r"], return_indices=True)
    if table.anisotropic:
        _, phi_i, phi_r = np.intersect1d(axes["phi_i"], axes["phi_r"], return_indices=True)
        f = table.brdf[np.ix_(i, phi_i, r, phi_r)]
        exchanged = np.moveaxis(f, (0, 1), (2, 3))
    else:
        f = table.brdf[np.ix_(i, r)]  # the exchange turns delta_phi to -delta_phi, where the table is the same
        exchanged = np.swapaxes(f, 0, 1)
    width = wavelengths_of(table)
    return _asymmetry(f.reshape(-1, width), exchanged.reshape(-1, width), TABLE_RECIPROCITY_TOLERANCE)


def _asymmetry(f: Floats, exchanged: Floats, tolerance: float | None, *, measured: bool = False) -> Asymmetry:
    """Return the asymmetry of values of shape (pairs, wavelengths)."""
    differs = f != exchanged  # True for nan. Few nodes differ, and only they are computed
    values = f[differs].astype(np.float64)
    others = exchanged[differs].astype(np.float64)
    with np.errstate(invalid="ignore"):  # values that are not finite count as 1
        relative = np.abs(values - others) / (np.abs(values) + np.abs(others) + _TINY)
    relative = np.where(np.isfinite(relative), relative, 1.0)
    smallest = float(relative.min(initial=1.0)) if differs.all() else 0.0
    with_zeros = np.zeros(max(differs.size, 1))
    with_zeros[: relative.size] = relative
    median, p99 = (float(value) for value in np.percentile(with_zeros, [50.0, 99.0]))
    return Asymmetry(
        pairs=len(f),
        min=smallest,
        mean=float(relative.sum() / max(differs.size, 1)),
        median=median,
        p99=p99,
        max=float(relative.max(initial=0.0)),
        tolerance=tolerance,
        measured=measured,
    )


def _shown(value: float | None) -> str:
    """Return a number with two digits, or a hyphen if there is none."""
    return "-" if value is None else number(value, 2)
