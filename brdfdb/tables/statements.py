"""All that a table states of itself, measured as a build measures it: builds write it, and audits repeat it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.tables.error_measurement import measure
from brdfdb.tables.formula_measurement import first_numbers
from brdfdb.tables.layout import Layout, digest
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.tabulation import metadata_of

MEASURED = ("error", "formula_error", "largest_albedo", "polarisation")  # attributes that hold measured numbers


def stated_metadata(
    layout: Layout, read: Callable[[slice], NDArray[np.float32]], request: Mapping[str, Any] | None = None
) -> TableMetadata:
    """Return the metadata of a table with its stated error, its first numbers and the request that it was made for.

    Parameters
    ----------
    layout : Layout
        Of the table.
    read : callable
        Gives some rows of the first axis of the stored array. Large tables are read piece by piece.
    request : mapping, optional
        The whole request of a build.

    Returns
    -------
    TableMetadata
        The same whenever it is measured, but for rounding: directions are drawn with seeds of their own.
    """
    known = metadata_of(layout)
    made_for = {} if request is None else {"request": known.without_source(request), "request_sha256": digest(request)}
    return known.model_copy(update={**made_for, "error": measure(layout, read), **first_numbers(layout, read)})
