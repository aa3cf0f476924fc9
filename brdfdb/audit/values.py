"""Whether the stored values, and those of f_r that come of them, are finite and not negative."""

from __future__ import annotations

import numpy as np

from brdfdb.audit.findings import Values
from brdfdb.lookup import Table
from brdfdb.parameters import Floats


def values_of(table: Table, looked_up: Floats | None) -> Values:
    """Of the nodes of a table and, where it is not linear between them, of f_r [1/sr] that was looked up, too."""
    brdf: list[Floats] = [table.brdf] if looked_up is None else [table.brdf, looked_up]
    dirac: list[Floats] = [] if table.specular is None else [table.specular]
    reflected = [*brdf, *dirac]
    apart: list[Floats] = [array for array in (table.spectra, table.uniform) if array is not None]
    others = apart if table.values_are_brdf else [table.values, *apart]
    not_finite = sum(array.size - int(np.count_nonzero(np.isfinite(array))) for array in (*reflected, *others))
    # -inf is not finite, and counted as that
    negative = sum(int(np.count_nonzero((array < 0.0) & np.isfinite(array))) for array in reflected)
    smallest = min(float(np.min(array, initial=np.inf, where=np.isfinite(array))) for array in brdf)
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
