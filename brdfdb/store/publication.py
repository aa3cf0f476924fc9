"""Publication: a table becomes the current revision of its material."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.errors import ParameterError
from brdfdb.materials import Source
from brdfdb.measurements import MeasuredSource
from brdfdb.place import path_of
from brdfdb.store.decoding import table_of
from brdfdb.store.files import FileEntry, Sync, sealed, syncing, write_file, write_files
from brdfdb.store.lock import Lock, writing
from brdfdb.store.paths import NAME, manifest_path, material_path, staged_path
from brdfdb.store.records import Manifest, make_store, newest, read_metadata, summary_of, swap_pointers
from brdfdb.tables.grids import check_wavelengths
from brdfdb.tables.layout import Layout
from brdfdb.tables.measured_layout import tabulated
from brdfdb.tables.planner import plan
from brdfdb.tables.stated_error import Error
from brdfdb.tables.statements import stated_metadata
from brdfdb.tables.tabulation import tabulate

if TYPE_CHECKING:
    import xarray as xr

_MANIFEST = "manifest.json"  # of a staged table that is about to be published


class NewRevision(NamedTuple):
    """The name of a new revision, and its size [byte]."""

    revision: str
    bytes: int


class Staged(NamedTuple):
    """A table in its staging directory, and the files of its group."""

    name: str
    staging: Path
    files: Mapping[str, FileEntry]


class Published(NamedTuple):
    """The name of a new revision, its size [byte], and the measured error of its table."""

    revision: str
    bytes: int
    error: Error


class StatedTable(NamedTuple):
    """The files of a table, by their paths in its zarr group, and its measured error."""

    files: dict[str, bytes]
    error: Error


def publish(
    root: str | os.PathLike[str],
    source: Source,
    *,
    tolerance: float,
    wavelengths_nm: ArrayLike | None = None,
    hot_spot_tolerance: float | None = None,
) -> Published:
    """Tabulate a source to a tolerance and publish the table in a store.

    Use it for a `brdfdb.materials.FunctionSource`, which no recipe can name and no other process can read. It runs in
    this process, with the whole table in memory, and cannot resume after a crash as ``brdfdb build`` does.

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
    hot_spot_tolerance : float, optional
        Largest error near the light, as of `plan`; not of measured data.

    Returns
    -------
    Published
        Revision, size, and the error against the source at directions that the planner has not seen.

    Raises
    ------
    ParameterError
        If `root` is no path, the tolerance is outside its range or takes too many values, or the wavelengths do not
        suit the source.
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
    root = path_of(root, "root")
    given = source.wavelengths_nm if wavelengths_nm is None else np.atleast_1d(np.asarray(wavelengths_nm))
    at = None if given is None else check_wavelengths(given)
    if isinstance(source, MeasuredSource):
        if hot_spot_tolerance is not None:
            raise ParameterError("hot_spot_tolerance", f"{source.name} is measured; it is for models and functions")
        layout, values = tabulated(source, at, tolerance)
        return publish_layout(root, source.name, layout, values=values)
    return publish_layout(root, source.name, plan(source, at, tolerance, hot_spot_tolerance=hot_spot_tolerance))


def publish_layout(
    root: str | os.PathLike[str],
    name: str,
    layout: Layout,
    request: Mapping[str, Any] | None = None,
    *,
    values: NDArray[np.float32] | None = None,
) -> Published:
    """Tabulate a layout in memory, measure its error, and publish the table under a name; errors as by `publish`.

    The table records the request of a build if it is given, so that the same request is not built again. `values` are
    those of all blocks of the layout, if they are known already.
    """
    stated = stated_table(layout, request, values=values)
    return Published(*_published(path_of(root, "root"), name, stated.files), stated.error)


def stated_table(
    layout: Layout, request: Mapping[str, Any] | None = None, *, values: NDArray[np.float32] | None = None
) -> StatedTable:
    """Tabulate a layout in memory and measure its error; arguments as of `publish_layout`, which publishes it."""
    from brdfdb.store.codec import dataset_files

    dataset = tabulate(layout, values)
    values = dataset[layout.variable].to_numpy()
    metadata = stated_metadata(layout, lambda rows: values[rows], request)
    assert metadata.error is not None
    checked = checked_dataset(layout.source.name, dataset.assign_attrs(metadata.attributes()))
    return StatedTable(dataset_files(checked), metadata.error)


def publish_dataset(root: str | os.PathLike[str], name: str, dataset: xr.Dataset) -> NewRevision:
    """Publish a table in memory, of this program or another, as the next revision of a material.

    Parameters
    ----------
    root : path
        Directory of the store; made if it does not exist.
    name : str
        Name of the material.
    dataset : Dataset
        The table, as `brdfdb.tables.tabulation.tabulate` makes it: ``brdf`` [1/sr] over the axes of a
        `brdfdb.tables.grids.Grid` [degree], in their order, and last, if it is spectral, ``wavelength`` [nm]. Values
        are float32; float64 is converted. Attributes may be missing. What `Store.dataset` gives is stored as it was:
        ``parts`` take the place of the ``brdf`` that is rebuilt of them.

    Raises
    ------
    ParameterError
        If the name is not one of a material, or no lookup could read the dataset: also if ``brdf`` was changed and
        ``parts`` were not.
    StoreError
        If the store cannot be written.
    """
    from brdfdb.store.codec import dataset_files

    return _published(path_of(root, "root"), name, dataset_files(checked_dataset(name, dataset)))


def _published(root: Path, name: str, files: Mapping[str, bytes]) -> NewRevision:
    """Publish the files of a table; ParameterError if the name is not one of a material."""
    if not NAME.fullmatch(name):
        raise ParameterError("name", f"{name!r} is not made of lower-case letters, digits and single hyphens", name)
    make_store(root)
    with Lock(root, name):
        return publish_files(root, name, files)


def publish_files(root: Path, name: str, files: Mapping[str, bytes]) -> NewRevision:
    """Make a table, as its files, the current revision of its material; the caller holds the lock.

    StoreError says that the store cannot be written.
    """
    staging = staged_path(root, name) / "dataset"
    with writing(root, name):
        shutil.rmtree(staging, ignore_errors=True)
        try:
            staging.mkdir()
            with syncing(root) as sync:
                written = write_files(staging / "table", files, staging, sync=False)
                return publish_staged(root, [Staged(name, staging, written)], sync)[0]
        finally:
            shutil.rmtree(staging, ignore_errors=True)


def checked_dataset(name: str, dataset: xr.Dataset) -> xr.Dataset:
    """Return a table as it is stored, with values in float32; ParameterError if no lookup could read it."""
    from brdfdb.tables.xarray_view import stored_attributes, with_brdf  # xarray is slow to import

    dataset = dataset.copy()
    dataset.attrs = stored_attributes(dataset.attrs)
    if "brdf" in dataset and "parts" in dataset:
        rebuilt = with_brdf(dataset.drop_vars("brdf"))["brdf"]
        if not np.array_equal(rebuilt.values, dataset["brdf"].values, equal_nan=True):
            raise ParameterError("brdf", "differs from the f_r that is rebuilt from parts; leave out one of the two")
        dataset = dataset.drop_vars("brdf")
    variable = "brdf" if "brdf" in dataset else "parts"
    if variable in dataset and dataset[variable].dtype == np.float64:
        dataset = dataset.assign({variable: dataset[variable].astype(np.float32)})
    arrays = {str(key): np.asarray(array.values) for key, array in dataset.variables.items()}
    dims = {str(key): array.dims for key, array in dataset.variables.items()}
    values = table_of(name, "", arrays, dims, dataset.attrs).values
    if values.dtype != np.float32:
        raise ParameterError(variable, f"its values are {values.dtype}, not float32")
    return dataset


def publish_staged(root: Path, tables: Sequence[Staged], sync: Sync) -> list[NewRevision]:
    """Make staged tables the current revisions of their materials; the caller holds the locks.

    Three syncs serve all tables: of their files, of their names in the directories of materials, and of the pointers.
    Each is complete before what names the synced ones is written. Until the pointers are swapped readers see the
    revisions before. After a crash just before that, a revision is complete, and the next build of its request makes it
    current. Files of a group that `files` does not name are removed. StoreError says that it cannot be written.
    """
    made = []
    groups = []
    for table in tables:
        with writing(root, table.name):
            made.append(_numbered(root, table))
            groups.append(material_path(root, table.name) / made[-1].revision)
    with writing(root, tables[0].name if len(tables) == 1 else f"{len(tables)} tables"):
        sync(
            path
            for _, staging, _ in tables
            for path in (staging / _MANIFEST, staging / "table", *(staging / "table").rglob("*"))
        )
        for table, group in zip(tables, groups, strict=True):
            os.replace(table.staging / _MANIFEST, manifest_path(group))
            (table.staging / "table").rename(group)
        swap_pointers(groups, sync)
    for table in tables:
        shutil.rmtree(table.staging, ignore_errors=True)
    return made


def _numbered(root: Path, table: Staged) -> NewRevision:
    """Give a staged table the number of its revision and a manifest."""
    name, staging, files = table
    staged = staging / "table"
    material = material_path(root, name)
    for path in staged.rglob("*"):
        if path.is_file() and path.relative_to(staged).as_posix() not in files:
            path.unlink()
    stored = sum(entry["size"] for entry in files.values())
    summary = summary_of(read_metadata(staged), stored, datetime.now(UTC).isoformat(timespec="seconds"))
    material.mkdir(exist_ok=True)
    revision = f"r{newest(material) + 1:06d}"
    manifest: Manifest = {"material": name, "revision": revision, "summary": summary, "files": dict(files)}
    write_file(staging / _MANIFEST, sealed(manifest), staging, sync=False)
    return NewRevision(revision, stored)
