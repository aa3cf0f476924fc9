"""Columns of uncertainties of texts: in 1/sr or relative, standard ones or expanded by a factor k."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._record import note
from brdfdb.formats._value_units import PERCENT, scale_of, units_in

_COVERAGE = re.compile(r"\bk ?= ?(\d+(?:\.\d+)?)[ ,;]*")
_RELATIVE = re.compile(r"[\[(]rel(?:ative|\.)?[\])]", re.IGNORECASE)
_PROBABILITY = re.compile(r"\d+(?:\.\d+)? ?(?:%|percent\b)")  # of an interval, such as U (95 %)
_SHOWN = 200  # characters of names that a sentence repeats


def uncertainty_of(
    where: str,
    names: Sequence[str],
    given: NDArray[np.float64],
    values: NDArray[np.float64],
    scale: NDArray[np.float64],
    factors: NDArray[np.float64],
    record: dict[str, Any],
) -> NDArray[np.float64]:
    """Return the standard uncertainties [1/sr] of values, shape (N, C).

    Parameters
    ----------
    where : str
        The file and the line of the names of its columns.
    names : sequence of str
        Names of the columns, with their units.
    given : array (N, C)
        Numbers of the columns.
    values : array (N, C) [1/sr]
        f_r.
    scale : array (N, C) or (1, C)
        Factors that make f_r of the quantity of the values.
    factors : array (C,)
        Factors of the units of the values, which uncertainties without a unit of their own share.
    record : dict
        Record, whose notes say how the columns were read.

    Raises
    ------
    FileFormatError
        If a name gives a probability and no factor k, or k is 0.
    """
    columns = f"column {names[0]}" if len(names) == 1 else f"columns {', '.join(names)}"
    note(record, f"Standard uncertainties were read from the {columns[:_SHOWN]}.")
    shares, coverages = [], []
    own = np.broadcast_to(factors, len(names)).copy()
    for column, name in enumerate(names):
        coverage, field = _COVERAGE.search(name), f"{where}, field {name}"
        if coverage is None and _PROBABILITY.search(name):
            raise FileFormatError(f"{field}: a probability is no unit; write the coverage factor, such as U (k=2)")
        coverages.append(1.0 if coverage is None else float(coverage[1]))
        if coverages[-1] == 0.0:
            raise FileFormatError(f"{field}: the coverage factor k is 0; allowed are positive numbers")
        unit = _COVERAGE.sub("", _PROBABILITY.sub("", name))
        shares.append(0.01 if PERCENT.search(unit) else 1.0 if _RELATIVE.search(unit) else 0.0)
        factor, unknown = scale_of(unit)
        if shares[-1]:
            continue
        if unknown:
            note(
                record, f"The unit {unknown!r} of the column {name} is not known: its numbers were taken as they stand."
            )
        elif any("sr" in text.lower() for text in units_in(unit)):
            own[column] = factor
    if 0.01 in shares:
        note(record, "Uncertainties in percent were taken as percent of the values of their rows.")
    if 1.0 in shares:
        note(record, "Relative uncertainties were multiplied by the values of their rows.")
    if expanded := sorted({k for k in coverages if k != 1.0}):
        shown = " and ".join(f"{k:g}" for k in expanded)
        note(record, f"Expanded uncertainties were divided by their coverage factor k, {shown}.")
    relative = np.array(shares)
    in_1_sr = np.where(relative > 0.0, relative * given * np.abs(values), given * own * scale)
    return np.asarray(in_1_sr / np.array(coverages))
