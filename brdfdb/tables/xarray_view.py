"""f_r of a stored table as an xarray variable that is computed from its parts when it is read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from xarray.backends import BackendArray
from xarray.core import indexing

from brdfdb.tables.grids import axes_among, directions
from brdfdb.tables.layout import Interpolation
from brdfdb.tables.table import rebuilt
from brdfdb.tables.tabulation import VARIABLES


def with_brdf(dataset: xr.Dataset) -> xr.Dataset:
    """A stored table with ``brdf`` [1/sr] over its axes and wavelengths: computed on demand where parts are stored."""
    if "brdf" in dataset:
        return dataset
    brdf = _Rebuilt(dataset)
    return dataset.assign(brdf=xr.Variable(brdf.dims, indexing.LazilyIndexedArray(brdf), VARIABLES["brdf"]))


class _Rebuilt(BackendArray):
    """What xarray indexes: f_r of the nodes and wavelengths that are asked for."""

    def __init__(self, dataset: xr.Dataset) -> None:
        self._parts = dataset["parts"]
        self._spectra = dataset["spectra"].values if "spectra" in dataset else None
        self._uniform = np.atleast_1d(dataset["uniform"].values) if "uniform" in dataset else None
        self._interpolation = Interpolation(**dataset.attrs["interpolation"])
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
        f_r = rebuilt(parts, self._interpolation, spectra, self._uniform, theta_i, theta_r)
        f_r = f_r.reshape([kept[name].size for name in self.dims])
        scalars = tuple(
            axis
            for axis, name in enumerate(self.dims)
            if np.ndim(chosen[name]) == 0 and not isinstance(chosen[name], slice)
        )
        return np.squeeze(f_r, axis=scalars).astype(np.float32)
