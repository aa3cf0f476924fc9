"""Tables as xarray Datasets: f_r over all axes, computed when it is read, and attributes that any file format takes."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from xarray.backends import BackendArray
from xarray.core import indexing

from brdfdb.errors import ParameterError
from brdfdb.tables.grids import axes_among, directions
from brdfdb.tables.layout import rebuilt
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.tabulation import VARIABLES

CF_VERSION = "CF-1.11"  # of the conventions that units, long_name and standard_name follow


def opened(store: Any) -> xr.Dataset:
    """Open a revision as a lazy Dataset with ``brdf`` [1/sr] over all axes, and attributes of `plain_attributes`.

    `store` is the group of the revision: a zarr store, a directory, or an address that fsspec reads. ``brdf`` is
    computed where coefficients are stored in its place.
    """
    dataset = with_brdf(xr.open_zarr(store, chunks=None))
    dataset.attrs = plain_attributes(dataset.attrs)
    if "wavelength" in dataset.coords:  # tables built earlier do not have the name
        dataset["wavelength"].attrs.setdefault("standard_name", "radiation_wavelength")
    return without_missing_coordinates(dataset)


def without_missing_coordinates(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset whose coordinates are written without ``_FillValue``, which CF forbids there (section 2.5.1)."""
    for coordinate in dataset.coords.values():
        coordinate.encoding["_FillValue"] = None
    return dataset


def plain_attributes(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes as text and numbers, which netCDF can hold, too.

    Empty ones and null are left out. True and false become 1 and 0. Objects and lists of anything but numbers become
    JSON text: ``json.loads(dataset.attrs["parameters"])``.
    """
    plain: dict[str, Any] = {"Conventions": CF_VERSION}
    for key, value in attributes.items():
        if isinstance(value, bool):
            plain[key] = int(value)
        elif isinstance(value, Mapping) or (
            isinstance(value, list)
            and any(isinstance(item, bool) or not isinstance(item, int | float) for item in value)
        ):
            plain[key] = json.dumps(value, ensure_ascii=False)
        else:
            plain[key] = value
    return {key: value for key, value in plain.items() if value not in (None, "", [], "{}")}


def stored_attributes(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes as a store keeps them: the inverse of `plain_attributes`, for those of `TableMetadata`.

    JSON text becomes objects and lists. What `plain_attributes` leaves out of a table of this program is filled in.
    """
    stored: dict[str, Any] = {}
    for key, given in attributes.items():
        value = given.tolist() if isinstance(given, np.ndarray | np.generic) else given
        known = TableMetadata.model_fields.get(key)
        if known is not None and isinstance(value, str) and known.annotation not in (str, str | None):
            with contextlib.suppress(ValueError):  # other text is stored as it is: readers say what is wrong
                value = json.loads(value)
        elif known is not None and known.annotation == list[float] and not isinstance(value, list):
            value = [value]  # netCDF has no lists of one number
        stored[key] = value
    if stored.get("Conventions") != CF_VERSION:
        return stored
    del stored["Conventions"]
    if "table_version" not in stored:  # written by another program
        return stored
    metadata = TableMetadata.read(stored)
    sound = {key: value for key, value in metadata.attributes().items() if key not in metadata.strange}
    return sound | {key: value for key, value in stored.items() if key not in sound}


def with_brdf(dataset: xr.Dataset) -> xr.Dataset:
    """Return a stored table with ``brdf`` [1/sr] over its axes and wavelengths, computed on demand if it is not stored.

    ValueError if the dataset has neither ``brdf`` nor the coefficients that it is rebuilt from.
    """
    if "brdf" in dataset:
        return dataset
    if "parts" not in dataset:
        raise ParameterError(
            "brdf", f"neither it nor parts is among the arrays {', '.join(map(str, dataset)) or 'none'}"
        )
    brdf = _Rebuilt(dataset)
    return dataset.assign(brdf=xr.Variable(brdf.dims, indexing.LazilyIndexedArray(brdf), VARIABLES["brdf"]))


class _Rebuilt(BackendArray):
    """The array that xarray indexes: f_r [1/sr] at the nodes and wavelengths of a request."""

    def __init__(self, dataset: xr.Dataset) -> None:
        self._parts = dataset["parts"]
        self._mixed = "mixture" in dataset
        basis = "mixture" if self._mixed else "spectra"
        self._spectra = dataset[basis].values if basis in dataset else None
        self._uniform = np.atleast_1d(dataset["uniform"].values) if "uniform" in dataset else None
        self._interpolation = TableMetadata.read(dataset.attrs).known_interpolation()
        self._names = axes_among(self._parts.dims)
        self._nodes = [dataset[name].values for name in self._names]
        spectral = ("wavelength",) if "wavelength" in dataset.sizes else ()
        self.dims = (*self._names, *spectral)
        self.shape = tuple(dataset.sizes[name] for name in self.dims)
        self.dtype = np.dtype(np.float32)

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.OUTER, self._read)

    def _read(self, key: tuple[Any, ...]) -> NDArray[np.float32]:
        chosen: Mapping[str, Any] = dict(zip(self.dims, key, strict=True))
        kept = {
            name: np.atleast_1d(np.arange(size)[chosen[name]]) for name, size in zip(self.dims, self.shape, strict=True)
        }
        at = {name: index for name, index in kept.items() if name in self._parts.dims}
        parts = self._parts.isel(at).values.reshape(*(kept[name].size for name in self._names), -1)
        spectra = self._spectra
        if spectra is not None:
            spectra = spectra[:, kept["wavelength"]]
        nodes = [nodes[kept[name]] for name, nodes in zip(self._names, self._nodes, strict=True)]
        theta_i, _, theta_r, _ = directions(self._names, nodes)
        uniform = self._uniform
        if uniform is not None and uniform.size > 1:
            uniform = uniform[kept["wavelength"]]
        f_r = rebuilt(parts, self._interpolation, spectra, uniform, theta_i, theta_r, mixed=self._mixed)
        f_r = f_r.reshape([kept[name].size for name in self.dims])
        scalars = tuple(
            axis
            for axis, name in enumerate(self.dims)
            if np.ndim(chosen[name]) == 0 and not isinstance(chosen[name], slice)
        )
        return np.squeeze(f_r, axis=scalars).astype(np.float32)
