"""Whether the stored values, and those of f_r that come of them, are finite and not negative."""

from __future__ import annotations

import numpy as np

from brdfdb.audit.findings import Values
from brdfdb.parameters import Floats
from brdfdb.tables.table import Table


def values_of(table: Table, looked_up: Floats | None) -> Values:
    """Count values that are negative or not finite: of nodes, and of f_r [1/sr] that was looked up.

    `looked_up` is None of a table that is linear between its nodes. Nodes over half and difference vectors may be
    negative: those below the horizon continue the table, and lookups end at 0.
    """
    brdf: list[Floats] = [table.brdf] if looked_up is None else [table.brdf, looked_up]
    judged = [looked_up] if looked_up is not None and table.grid.half_difference else brdf
    dirac: list[Floats] = [] if table.specular is None else [table.specular]
    reflected = [*brdf, *dirac]
    apart: list[Floats] = [array for array in (table.spectra, table.uniform) if array is not None]
    others = apart if table.values_are_brdf else [table.values, *apart]
    not_finite = sum(array.size - int(np.count_nonzero(np.isfinite(array))) for array in (*reflected, *others))
    # -inf is not finite, and counted as that
    negative = sum(int(np.count_nonzero((array < 0.0) & np.isfinite(array))) for array in (*judged, *dirac))
    smallest = min(float(np.min(array, initial=np.inf, where=np.isfinite(array))) for array in judged)
    return Values(
        count=sum(array.size for array in (table.values, *apart))
        + (0 if table.specular is None else table.specular.size),
        looked_up=0 if looked_up is None else len(looked_up),
        smallest=smallest if np.isfinite(smallest) else None,
        negative=negative,
        not_finite=not_finite,
        positivity="violates" if negative else "passes",
        finiteness="violates" if not_finite else "passes",
    )
