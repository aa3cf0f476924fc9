"""Measurement of the error of a formula against the highest rung of its surface, and of the largest albedo."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.materials import Material, Source
from brdfdb.models.shared_integrals import sharing
from brdfdb.parameters import ModelForm
from brdfdb.tables import error_measurement
from brdfdb.tables.first_numbers import FormulaError
from brdfdb.tables.largest_albedo import largest_albedo
from brdfdb.tables.layout import Layout
from brdfdb.tables.polarisation_measurement import element_error
from brdfdb.tables.polarisation_record import record
from brdfdb.tables.stated_error import Overall
from brdfdb.tables.table import Table
from brdfdb.tables.worst_pair import worst_pair

DIRECTIONS, SEED = 1000, 1992  # directions of a band of theta_i, and their seed: those of the charts
_WAVELENGTHS = 4  # largest number of wavelengths: a rung may be an integral for each of them

LARGE = 1 << 24  # number of values of a table that is not read whole for its albedo

_NONE_KNOWN = FormulaError(against="none known", rung="", directions=0, overall=None, worst=None)


def first_numbers(layout: Layout, read: Callable[[slice], NDArray[np.float32]]) -> dict[str, Any]:
    """Return the attributes of a table that lists show beside its stated error.

    Parameters
    ----------
    layout : Layout
        Of the table.
    read : callable
        Gives some rows of the first axis of the stored array.

    Returns
    -------
    dict
        `formula_error`; `largest_albedo` unless the table has more than `LARGE` values; `polarisation` of a polarised
        table.
    """
    numbers: dict[str, Any] = {"formula_error": formula_error_of(layout.source, layout.wavelength_nm)}
    if layout.size <= LARGE:
        table = Table.of(layout, read(slice(0, layout.shape[0])))
        numbers["largest_albedo"] = largest_albedo(table, layout.source)
    if layout.facet_theta_d_deg is not None:
        whole = Table.of(layout, read(slice(0, layout.shape[0])))
        numbers["polarisation"] = record(element_error(whole, layout.source))
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
    """Measure the error of the formula of a source against the highest rung.

    Parameters
    ----------
    source : Source
        Material, or function, of which no rung is known.
    wavelength_nm : array of shape (L,) [nm], or None
        Wavelengths of a spectral source, and only of such a source. At most four of them are measured.

    Returns
    -------
    FormulaError
        Measured with the directions and the metric of the charts.
    """
    if not isinstance(source, Material):
        return _NONE_KNOWN
    some = wavelength_nm
    if wavelength_nm is not None and wavelength_nm.size > _WAVELENGTHS:
        some = wavelength_nm[np.round(np.linspace(0, wavelength_nm.size - 1, _WAVELENGTHS)).astype(int)]
    rung = highest_rung(source, some)
    if rung is None:
        if not source.spec.highest_rung:
            return _NONE_KNOWN
        exact = Overall(l1=0.0, median=0.0, p95=0.0, p99=0.0, max=0.0)
        return FormulaError(
            against="highest rung", rung=source.spec.highest_rung, directions=0, overall=exact, worst=None
        )
    drawn = error_measurement.draw(source, some, DIRECTIONS, SEED)
    with sharing():  # materials of one model are measured at the same directions
        truth = source.brdf_at(some, rung.vectors, rung.degree)(drawn.wi, drawn.wr)
    values = error_measurement.model_values(source, some, drawn.wi, drawn.wr)
    floor, above = error_measurement.floor_of(truth, drawn), drawn.above
    relative = error_measurement.relative(values, truth, floor)[above]
    return FormulaError(
        against="measured",
        rung=rung.title,
        directions=int(np.count_nonzero(above)),
        overall=error_measurement.compare(values, truth, drawn, SEED).overall,
        worst=worst_pair(
            relative, truth[above], floor, drawn.wi[above], drawn.wr[above], drawn.in_lobe[above], source, some
        ),
    )
