"""Publication of a source from Python: tabulated to a tolerance in this process, measured, and put into a store."""

from __future__ import annotations

import os
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.materials import Source
from brdfdb.store.staging import publish_dataset
from brdfdb.tables import error_measurement
from brdfdb.tables.grids import check_wavelengths
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import plan
from brdfdb.tables.stated_error import Error
from brdfdb.tables.tabulation import tabulate


class Published(NamedTuple):
    """A revision of a store, its size [byte], and the error of its table as measured."""

    revision: str
    bytes: int
    error: Error


def publish(
    root: str | os.PathLike[str], source: Source, *, tolerance: float, wavelengths_nm: ArrayLike | None = None
) -> Published:
    """Tabulate a source to a tolerance and publish the table in a store.

    This is the way for a `brdfdb.materials.FunctionSource`, which no recipe can name and no other process can read. It
    runs in this process, with the whole table in memory, and starts anew after a crash: a build from a recipe
    (``brdfdb build``) goes on where it was.

    Parameters
    ----------
    root : path
        Directory of the store; made if it does not exist.
    source : Source
        Function or material; its name is that of the material in the store.
    tolerance : float
        99th percentile of the relative error of f_r, in [1e-4, 0.5]: see `brdfdb.tables.planner.plan`.
    wavelengths_nm : array_like of shape (L,) [nm], optional
        For spectral sources; by default those that the source is stated for.

    Returns
    -------
    Published
        Revision, size, and the error against the source at directions that the planner has not seen.

    Raises
    ------
    ParameterError
        If the tolerance is outside its range or takes too many values, or the wavelengths do not suit the source.
    StoreError
        If the store cannot be written.

    Examples
    --------
    >>> import numpy as np, tempfile
    >>> from brdfdb.materials import FunctionSource
    >>> def velvet(wi, wr, wavelength_nm):
    ...     return 0.2 / np.pi * (1.0 + (1.0 - wi[:, 2]) * (1.0 - wr[:, 2]))
    >>> source = FunctionSource(brdf=velvet, name="velvet", title="Velvet", provenance="made up for this example")
    >>> with tempfile.TemporaryDirectory() as root:
    ...     published = publish(root, source, tolerance=0.01)
    >>> published.revision, published.error.overall.p99 <= 0.01
    ('r000001', True)
    """
    given = source.wavelengths_nm if wavelengths_nm is None else np.atleast_1d(np.asarray(wavelengths_nm))
    at = None if given is None else check_wavelengths(given)
    return publish_layout(root, source.name, plan(source, at, tolerance))


def publish_layout(root: str | os.PathLike[str], name: str, layout: Layout) -> Published:
    """Tabulate a layout in memory, measure its error, and publish the table under a name; errors as by `publish`."""
    dataset = tabulate(layout)
    values = dataset[layout.variable].to_numpy()
    error = error_measurement.measure(layout, lambda rows: values[rows])
    return Published(*publish_dataset(root, name, dataset.assign_attrs(error=error.model_dump(mode="json"))), error)
