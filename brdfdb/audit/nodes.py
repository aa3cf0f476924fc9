"""The stored numbers and refractive indices of a table, compared with those of its model at the same nodes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from pydantic import Field

from brdfdb.audit.finding import Cell, Finding, Sentence, Subject, Verdict
from brdfdb.errors import ParameterError
from brdfdb.materials import Material, Source
from brdfdb.tables.error_measurement import FLOOR
from brdfdb.tables.layout import Layout
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import block, rounded, specular_nodes

# Largest number of values of the model that are computed for the comparison. Tables with more nodes are compared at
# some rows of their first axis, evenly spread. A value of the integral over facets takes 30 us, other values 0.2 us
MOST_VALUES = 1 << 20
_MOST_SLOW = 1 << 15
# Rounding error of float64 sums on another processor, relative to the largest number of the table. It is allowed in
# addition to the rounding to the stored bits
_ROUNDING = 1e-11
# Relative tolerance of n, k and the uniform part, which are stored as float64
SAME = 1e-9


class Nodes(Finding):
    """The stored numbers of a table, compared with those of its source at the same nodes."""

    key = "nodes"
    order = 4
    explanation = "Stored numbers are compared with those of the model at the same nodes. They differ by rounding only."

    compared: int = Field(
        description="number of stored numbers that were compared; large tables: some rows of the first axis"
    )
    count: int = Field(description="number of stored numbers")
    wrong: int = Field(description="number of compared numbers that differ by more than rounding")
    stored: float | None = Field(
        description="the stored number with the largest difference; null: none is wrong, or it is not finite"
    )
    expected: float | None = Field(description="number of the model at that node")
    beside: list[str] = Field(
        description="sentences on n, k, uniform part, specular part and stated error, where they are wrong"
    )
    verdict: Verdict

    @classmethod
    def judge(cls, subject: Subject) -> Finding:
        """Compare the nodes of a table with those of its source."""
        if subject.source is None:
            return subject.not_judged("values at nodes are compared with those of the source")
        return nodes_of(subject.table, subject.source)

    def sentences(self) -> list[Sentence]:
        """Return a sentence on the numbers of the table, its refractive index and its uniform part."""
        part = "" if self.compared == self.count else f", of the {self.count} in the table,"
        numbers = f"all {self.compared} stored values that were compared{part} are the model's"
        if self.wrong:
            numbers = f"{self.wrong} of {self.compared} stored values{part} are not the model's"
            if self.expected is not None:
                stored = "a value that is not finite" if self.stored is None else f"{self.stored:.4g}"
                numbers += f", such as {stored} for {self.expected:.4g}"
        return [self.sentence(self.verdict, "; ".join([numbers, *self.beside]))]

    def cells(self) -> list[Cell]:
        """Return the number of wrong values."""
        good = "all good" if self.verdict == "passes" else "bad"
        return [Cell(self.verdict, f"{self.wrong} bad" if self.wrong else good, self.wrong)]


class _Wrong(NamedTuple):
    """A stored number, the expected one, and their difference in excess of rounding."""

    excess: float
    stored: float
    expected: float


def nodes_of(table: Table, source: Source) -> Nodes:
    """Return the number of stored numbers that are not those of the model, and the one with the largest difference.

    ParameterError if no layout of the source has the shape of the table.
    """
    bits = table.metadata.bits
    layout = table.laid_out(source)
    if layout.shape != table.values.shape:
        text = f"shape {table.values.shape} is not {layout.shape}, that of its axes"
        raise ParameterError(layout.variable, text, table.values.shape, layout.shape)
    rows = 0
    wrong = 0
    worst = _Wrong(0.0, 0.0, 0.0)
    for span in _rows(layout):
        stored = table.values[span].astype(np.float64)
        expected = block(layout, span).astype(np.float64)
        rows += span.stop - span.start
        off = np.abs(stored - expected)
        allowed = 2.0**-bits * np.abs(expected)
        off = np.where(np.isfinite(off) | (stored == expected), off, np.inf)
        excess = off - allowed * (1.0 + _ROUNDING) - _ROUNDING * np.max(np.abs(expected))
        beyond = (excess > 0.0) | (rounded(table.values[span], bits) != table.values[span])
        wrong += int(np.count_nonzero(beyond))
        if beyond.any() and (largest := float(np.max(excess, where=beyond, initial=-np.inf))) > worst.excess:
            at = np.unravel_index(int(np.argmax(np.where(beyond, excess, -np.inf))), excess.shape)
            worst = _Wrong(largest, float(stored[at]), float(expected[at]))
    beside = [*_refraction(table, source), *_uniform(table, layout), *_specular(table, layout)]
    tolerance = (table.metadata.request or {}).get("tolerance")
    if table.error is None and tolerance is not None:
        beside.append(f"no error is stated, though a tolerance of {tolerance:g} was asked for")
    return Nodes(
        compared=rows * (table.values.size // table.values.shape[0]),
        count=table.values.size,
        wrong=wrong,
        stored=_finite(worst.stored) if wrong else None,
        expected=_finite(worst.expected) if wrong else None,
        beside=beside,
        verdict="violates" if wrong or beside else "passes",
    )


def _rows(layout: Layout) -> Iterator[slice]:
    """Yield slices of the first axis: all rows, or as many single rows as `MOST_VALUES` allows."""
    wavelengths = 1 if layout.wavelength_nm is None else layout.wavelength_nm.size
    slow = isinstance(layout.source, Material) and layout.source.spec.slow
    most = (_MOST_SLOW if slow else MOST_VALUES) // (int(np.prod(layout.grid.shape[1:])) * wavelengths)
    if most >= layout.shape[0]:
        yield from layout.blocks
        return
    for row in np.unique(np.linspace(0, layout.shape[0] - 1, max(most, 2)).round().astype(int)):
        yield slice(int(row), int(row) + 1)


def _refraction(table: Table, source: Source) -> Iterator[str]:
    """Yield a sentence on each of n and k that differs from the entry. Tables in memory may store neither."""
    indices = source.refractive_indices(table.wavelength_nm)
    if indices is None or table.wavelength_nm is None:
        return
    scale = np.hypot(*indices)
    for name, stored, expected in zip(("n", "k"), (table.n, table.k), indices, strict=True):
        if stored is None:
            continue
        if stored.shape != expected.shape:
            text = f"shape {stored.shape} is not {expected.shape}, that of the wavelengths"
            raise ParameterError(name, text, stored.shape, expected.shape)
        off = np.where(np.isfinite(stored), np.abs(stored - expected), np.inf) / scale
        if np.any(off > SAME):
            worst = int(np.argmax(off))
            yield (
                f"{name} is stored as {stored[worst]:.5g} at {table.wavelength_nm[worst]:g} nm, where "
                f"{source.attributes()['refractive_index']} has {expected[worst]:.5g}"
            )


def _uniform(table: Table, layout: Layout) -> Iterator[str]:
    """Yield a sentence on the uniform part of f_r [1/sr] if it is not that of the parameters."""
    expected = np.zeros(1) if layout.uniform is None else layout.uniform
    stored = np.zeros(1) if table.uniform is None else table.uniform
    off = np.abs(stored - expected) / np.maximum(expected, FLOOR / np.pi)
    if not np.all(off <= SAME):
        worst = int(np.argmax(np.where(np.isfinite(off), off, np.inf)))
        was, right = (float(np.broadcast_to(values, off.shape)[worst]) for values in (stored, expected))
        yield f"the uniform part is stored as {was:.5g} 1/sr, the parameters make {right:.5g}"


def _specular(table: Table, layout: Layout) -> Iterator[str]:
    """Yield a sentence on a specular part that is missing, or whose nodes are not those of the layout."""
    if not layout.source.has_specular:
        return
    if table.specular is None:
        yield "the specular part of the model is not stored"
        return
    nodes = table.axes_deg.get("theta_i") if table.specular_theta_deg is None else table.specular_theta_deg
    expected = specular_nodes(layout)
    if nodes is None or not np.array_equal(nodes, expected):
        count = 0 if nodes is None else len(nodes)
        yield f"the specular part is stored at {count} angles that are not the {len(expected)} of its layout"


def _finite(value: float) -> float | None:
    return float(f"{value:.6g}") if np.isfinite(value) else None
