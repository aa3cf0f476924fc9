"""Measurement of the numbers that a table states: builds write them, and audits repeat the measurement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.materials import Material, Source
from brdfdb.materials.polarised import polarised_source
from brdfdb.models.shared_integrals import sharing
from brdfdb.parameters import Floats, ModelForm
from brdfdb.tables import error_measurement
from brdfdb.tables.albedo import largest_albedo
from brdfdb.tables.error_measurement import Read, measure
from brdfdb.tables.layout import Layout, digest
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.stated_error import FormulaError, LargestAlbedo, Overall
from brdfdb.tables.stokes import ElementError, record
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import glints_of, metadata_of

DIRECTIONS = 1000  # directions of a band of theta_i for the error of a formula, as in charts
SEED = 1992  # seed of these directions
_WAVELENGTHS = 4  # largest number of wavelengths of that error: a rung may be an integral for each of them

LARGE = 1 << 24  # number of values of a table that is not read completely for its albedo

_NONE_KNOWN = FormulaError(against="none known", rung="", directions=0, overall=None, worst=None)
# Error of Mueller matrices
_ELEMENT_SEED = 1852  # seed of the directions
_ELEMENT_DIRECTIONS = 2000  # directions of a band of theta_i, up to _FEW wavelengths
_FEWER_DIRECTIONS = 500  # directions for more wavelengths
_FEW = 4
_FACET_ANGLES = 2001  # number of theta_d at which the stored elements are measured
_WAVELENGTHS_AT_ONCE = 8  # wavelengths that are evaluated together
MEASURED = ("error", "formula_error", "largest_albedo", "polarisation")  # attributes that hold measured numbers


def first_numbers(layout: Layout, read: Read, largest: LargestAlbedo | None = None) -> dict[str, Any]:
    """Return the attributes of a table that lists show next to its stated error.

    They are `formula_error`; `largest_albedo`, unless it is given, or the table has more than `LARGE` values;
    `polarisation` of a polarised table. `read` gives some rows of the first axis of the stored array.
    """
    numbers: dict[str, Any] = {"formula_error": formula_error_of(layout.source, layout.wavelength_nm)}
    polarised = layout.facet_theta_d_deg is not None
    if largest is not None:
        numbers["largest_albedo"] = largest
    if (layout.size <= LARGE and largest is None) or polarised:
        table = replace(Table.of(layout, read(slice(0, layout.shape[0]))), glints=glints_of(layout))
        if layout.size <= LARGE and largest is None:
            numbers["largest_albedo"] = largest_albedo(table, layout.source)
        if polarised:
            numbers["polarisation"] = record(element_error(table, layout.source))
    return numbers


def highest_rung(material: Material, wavelength_nm: NDArray[np.float64] | None) -> ModelForm | None:
    """Return the exact form that the model of a material approximates; None if it has no other than itself."""
    spec = material.spec
    if spec.forms is None:
        return None
    first = next(iter(spec.forms(material.arguments(wavelength_nm))), None)
    other = first is not None and first.kind == "exact" and first.python != f"models.{spec.name}"
    return first if other else None


def formula_error_of(source: Source, wavelength_nm: NDArray[np.float64] | None) -> FormulaError:
    """Measure the error of the formula of a source against the highest rung, by directions and metric of the charts.

    At most four of the wavelengths (L,) [nm] of a spectral source are measured. No rung of a function is known.
    """
    if not isinstance(source, Material):
        return _NONE_KNOWN
    few_nm = wavelength_nm
    if wavelength_nm is not None and wavelength_nm.size > _WAVELENGTHS:
        few_nm = wavelength_nm[np.round(np.linspace(0, wavelength_nm.size - 1, _WAVELENGTHS)).astype(int)]
    rung = highest_rung(source, few_nm)
    if rung is None:
        if not source.spec.highest_rung:
            return _NONE_KNOWN
        exact = Overall(l1=0.0, median=0.0, p95=0.0, p99=0.0, max=0.0)
        return FormulaError(
            against="highest rung", rung=source.spec.highest_rung, directions=0, overall=exact, worst=None
        )
    pairs = error_measurement.draw(source, few_nm, DIRECTIONS, SEED)
    with sharing():  # materials of one model are measured at the same directions
        truth = source.brdf_at(few_nm, rung.vectors, rung.degree)(pairs.wi, pairs.wr)
    values = error_measurement.model_values(source, few_nm, pairs.wi, pairs.wr)
    floor = error_measurement.floor_of(truth, pairs)
    error = error_measurement.relative(values, truth, floor)
    return FormulaError(
        against="measured",
        rung=rung.title,
        directions=int(np.count_nonzero(pairs.above)),
        overall=error_measurement.compare(values, truth, pairs, SEED).overall,
        worst=error_measurement.worst_pair(error, truth, floor, pairs, source, few_nm),
    )


def element_error(table: Table, source: Source, seed: int = _ELEMENT_SEED) -> ElementError:
    """Measure the error of m_ij / m_00 between bases of the surface, at wavelengths and half way between them.

    Directions are those of `brdfdb.tables.error_measurement.draw` above the horizon. Those at which the model reflects
    nothing do not count.
    """
    assert table.wavelength_nm is not None
    nodes = table.wavelength_nm
    count = _ELEMENT_DIRECTIONS if nodes.size <= _FEW else _FEWER_DIRECTIONS
    pairs = error_measurement.draw(source, nodes, count, seed)
    wi = pairs.wi[pairs.above]
    wr = pairs.wr[pairs.above]
    at_nodes = _element_errors(table, source, wi, wr, nodes)
    middles = 0.5 * (nodes[1:] + nodes[:-1])
    between = None if nodes.size < 2 else _element_errors(table, source, wi, wr, middles)
    return ElementError(
        directions=len(wi),
        seed=seed,
        p99=_up(at_nodes.p99),
        max=_up(at_nodes.largest),
        between_p99=None if between is None else _up(between.p99),
        between_max=None if between is None else _up(between.largest),
        facet=_facet_error(table, source, nodes),
        between_facet=None if between is None else _facet_error(table, source, middles),
    )


class _ElementErrors(NamedTuple):
    """99th percentile and maximum of the error of each element (4, 4) of Mueller matrices, at the worst wavelength."""

    p99: Floats
    largest: Floats


def _element_errors(
    table: Table, source: Source, wi: Floats, wr: Floats, wavelength_nm: NDArray[np.float64]
) -> _ElementErrors:
    """Return the errors of the normalised elements at unit vectors (N, 3)."""
    model = polarised_source(source)
    p99 = np.zeros((4, 4))
    largest = np.zeros((4, 4))
    for start in range(0, wavelength_nm.size, _WAVELENGTHS_AT_ONCE):
        some = wavelength_nm[start : start + _WAVELENGTHS_AT_ONCE]
        wrong = np.abs(_normalised(table.mueller_vectors(wi, wr, some)) - _normalised(model.mueller(wi, wr, some)))
        p99 = np.maximum(p99, np.nanpercentile(wrong, 99.0, axis=0).max(axis=0))
        largest = np.maximum(largest, np.nanmax(wrong, axis=(0, 1)))
    return _ElementErrors(p99, largest)


def _facet_error(table: Table, source: Source, wavelength_nm: NDArray[np.float64]) -> float:
    """Return the largest error of the elements of the facet over theta_d, between bases of the plane."""
    theta_d = np.linspace(0.0, np.pi / 2.0, _FACET_ANGLES)
    stored = table.facet_mueller(theta_d, wavelength_nm)
    wrong = np.abs(stored - polarised_source(source).facet(theta_d, wavelength_nm)).max()
    return _up(np.full((1, 1), wrong))[0][0]


def _normalised(mueller: Floats) -> Floats:
    """Return m_ij / m_00; nan where nothing is reflected."""
    first = mueller[..., :1, :1]
    return np.divide(mueller, first, out=np.full_like(mueller, np.nan), where=first > 0.0)


def _up(values: Floats) -> list[list[float]]:
    """Return numbers to three digits, rounded up."""
    return [[float(f"{1.00501 * value:.3g}") for value in row] for row in values.tolist()]


def stated_metadata(
    layout: Layout, read: Read, request: Mapping[str, Any] | None = None, largest: LargestAlbedo | None = None
) -> TableMetadata:
    """Return the metadata of a table with its stated error, its first numbers and the request that it was made for.

    `read` gives some rows of the first axis of the stored array: large tables are read piece by piece. The metadata is
    the same whenever it is measured, but for rounding: directions are drawn with seeds of their own. The largest albedo
    is computed unless it is given.
    """
    known = metadata_of(layout)
    made_for = {} if request is None else {"request": known.without_source(request), "request_sha256": digest(request)}
    return known.model_copy(update={**made_for, "error": measure(layout, read), **first_numbers(layout, read, largest)})
