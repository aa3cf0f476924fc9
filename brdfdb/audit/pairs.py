"""Pairs of directions at which a table and its model are evaluated, also with light and viewer exchanged."""

from __future__ import annotations

from typing import NamedTuple

from brdfdb.materials import Material, Source
from brdfdb.parameters import Floats
from brdfdb.tables import error_measurement
from brdfdb.tables.albedo import wavelengths_of
from brdfdb.tables.error_measurement import RandomPairs
from brdfdb.tables.table import Table

SEED = 1967  # differs from the seeds of build and planner, which the table was fitted to
# Directions per band of theta_i, half of them in the lobe. Tables with more than `_FEW` wavelengths use fewer, because
# their wavelengths vary in the same way. Tables of slow models use fewer, too
DIRECTIONS = 3000
_FEW = 4
_FEWER_DIRECTIONS = 1000


class ComparedPairs(NamedTuple):
    """f_r [1/sr] of table and model at pairs of directions, shape (N, L), and with light and viewer exchanged.

    Where the source of a table is not known, `model` and `model_exchanged` are those of the table itself.
    """

    drawn: RandomPairs
    table: Floats
    table_exchanged: Floats
    model: Floats
    model_exchanged: Floats


def pairs_of(table: Table, source: Source | None) -> ComparedPairs:
    """Return f_r [1/sr] of a table, and of its source if it is known, at all wavelengths of the table."""
    slow = isinstance(source, Material) and source.spec.slow
    count = DIRECTIONS if wavelengths_of(table) <= _FEW and not slow else _FEWER_DIRECTIONS
    drawn = error_measurement.draw(table.source if source is None else source, table.wavelength_nm, count, SEED)
    shape = (len(drawn.wi), wavelengths_of(table))
    both = ((drawn.wi, drawn.wr), (drawn.wr, drawn.wi))
    looked_up = [table.lookup_vectors(*directions).reshape(shape) for directions in both]
    if source is None:
        return ComparedPairs(drawn, *looked_up, *looked_up)
    return ComparedPairs(
        drawn,
        *looked_up,
        *(error_measurement.model_values(source, table.wavelength_nm, *directions) for directions in both),
    )


def representative_nm(table: Table) -> float | None:
    """Return the middle wavelength [nm] of a table, for findings that show one wavelength only; None if grey."""
    return None if table.wavelength_nm is None else float(table.wavelength_nm[table.wavelength_nm.size // 2])
