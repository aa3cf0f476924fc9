"""From a material and a grid to a table: an xarray Dataset in memory that says where every number comes from."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from brdfdb.geometry import radians
from brdfdb.grids import Grid, check_wavelengths
from brdfdb.materials import Material
from brdfdb.parameters import Floats

TABLE_VERSION = 1  # of the variables, dimensions and attributes below

_SLAB = 1 << 17  # values evaluated at a time: fewer cost calls, more cost memory
_BANDS = 6  # at least, of a reciprocal grid: the squares on the diagonal are computed whole


def tabulate(
    material: Material,
    grid: Grid,
    wavelength_nm: NDArray[np.float64] | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> xr.Dataset:
    """Tabulate the BRDF of a material.

    Parameters
    ----------
    material : Material
        Model, parameters and where they come from.
    grid : Grid
        Angles [degree]; anisotropic for anisotropic materials.
    wavelength_nm : array of shape (L,) [nm], optional
        For spectral materials, and only for them.
    progress : callable
        Called with the number of values that were just computed.

    Returns
    -------
    Dataset
        ``brdf`` [1/sr], float32, over the axes of the grid and, last, ``wavelength``; for models with a Dirac part
        ``specular_reflectance`` [1] over theta_i and wavelength; for spectral materials ``n`` and ``k`` as used.
        Coordinates in degrees and nm, with units. Attributes: title, model, parameters, sources and notes.

    Raises
    ------
    ValueError
        If grid or wavelengths do not suit the material: no wavelengths for a spectral one, an isotropic grid for an
        anisotropic one, a node at 90 degrees where the model has a pole.
    """
    check_suits(material, grid, wavelength_nm)
    brdf = np.empty(grid.shape if wavelength_nm is None else (*grid.shape, wavelength_nm.size), dtype=np.float32)
    for index, values in _slabs(material, grid, wavelength_nm):
        brdf[index] = values
        progress(values.size)
    return _dataset(material, grid, wavelength_nm, brdf)


def check_suits(material: Material, grid: Grid, wavelength_nm: NDArray[np.float64] | None) -> None:
    """Raise the ValueError that `tabulate` would raise, at no cost."""
    spec = material.spec
    if material.spectral != (wavelength_nm is not None):
        raise ValueError(f"wavelengths_nm: {material.name} {'needs them' if material.spectral else 'is grey'}")
    if material.anisotropic and not grid.anisotropic:
        raise ValueError(f"grid: {material.name} is anisotropic and needs the axes theta_i, phi_i, theta_r, phi_r")
    if spec.grazing_pole and grid.reaches_horizon:
        raise ValueError(
            f"grid: theta of 90 degrees is a pole of the model {spec.name} ({material.name}); end the axis below 90"
        )
    if wavelength_nm is not None:
        material.arguments(check_wavelengths(wavelength_nm))


def _slabs(
    material: Material, grid: Grid, wavelength_nm: NDArray[np.float64] | None
) -> Iterator[tuple[tuple[Any, ...], Floats]]:
    """Pieces of the table: the index where each goes, and its values."""
    spectrum: list[tuple[tuple[int, ...], dict[str, Any]]]
    if wavelength_nm is None:
        spectrum = [((), material.arguments())]
    else:
        spectrum = [((w,), material.arguments(one)) for w, one in enumerate(wavelength_nm)]
    for block, angles in _blocks(grid):
        for last, arguments in spectrum:
            values = material.spec.evaluate(*angles, **arguments)
            yield (*block, ..., *last), values
            if grid.reciprocal:  # as every model is: what is right of the block stands below it too
                here = block[0]
                mirrored = np.swapaxes(values[:, here.stop - here.start :], 0, 1)
                yield (slice(here.stop, None), here, ..., *last), mirrored


def _blocks(grid: Grid) -> Iterator[tuple[tuple[slice, ...], tuple[NDArray[np.float64], ...]]]:
    """Blocks of rows of the first axis, and their directions of light and viewer; of a reciprocal grid one half."""
    axes = [radians(nodes) for nodes in grid.axes.values()]
    rows = max(1, _SLAB // int(np.prod(grid.shape[1:])))
    if grid.reciprocal:
        rows = min(rows, -(-grid.shape[0] // _BANDS))
    for start in range(0, grid.shape[0], rows):
        here = slice(start, min(start + rows, grid.shape[0]))
        if grid.anisotropic:
            theta_i, *others = axes
            yield (here,), np.ix_(theta_i[here], *others)
        else:
            theta_i, theta_r, delta_phi = axes
            viewer = slice(start if grid.reciprocal else 0, None)
            light, seen, turned = np.ix_(theta_i[here], theta_r[viewer], delta_phi)
            yield (here, viewer), (light, np.zeros(()), seen, turned)


def _dataset(
    material: Material, grid: Grid, wavelength_nm: NDArray[np.float64] | None, brdf: NDArray[np.float32]
) -> xr.Dataset:
    spec = material.spec
    spectral = () if wavelength_nm is None else ("wavelength",)
    coordinates: dict[str, Any] = {
        name: (name, nodes, {"units": "degree", "long_name": _LONG_NAMES[name]}) for name, nodes in grid.axes.items()
    }
    variables: dict[str, Any] = {
        "brdf": ((*grid.axes, *spectral), brdf, {"units": "sr-1", "long_name": "bidirectional reflectance f_r"})
    }
    arguments = material.arguments(wavelength_nm)
    if wavelength_nm is not None:
        coordinates["wavelength"] = (
            "wavelength",
            wavelength_nm,
            {"units": "nm", "long_name": "wavelength in vacuum"},
        )
        for name, meaning in (("n", "refractive index"), ("k", "extinction coefficient")):
            variables[name] = ("wavelength", arguments[name], {"units": "1", "long_name": meaning})
    if spec.specular is not None:
        theta_i = radians(grid.axes["theta_i"])
        specular = spec.specular(
            theta_i[:, np.newaxis] if spectral else theta_i,
            **{name: arguments[name] for name in spec.specular_parameters},
        )
        variables["specular_reflectance"] = (
            ("theta_i", *spectral),
            specular,
            {"units": "1", "long_name": "reflectance of the Dirac part, in the exact mirror direction"},
        )
    extent = [] if wavelength_nm is None else [float(wavelength_nm[0]), float(wavelength_nm[-1])]
    return xr.Dataset(
        variables,
        coordinates,
        _attributes(material)
        | {"anisotropic": grid.anisotropic, "symmetries": grid.symmetries, "wavelength_range_nm": extent},
    )


def _attributes(material: Material) -> dict[str, Any]:
    spec = material.spec
    # parameters by the names that files give them
    written = dict(zip(material.parameters, material.file_parameters(), strict=True))
    return {
        "title": material.title,
        "material": material.name,
        "table_version": TABLE_VERSION,
        "model": spec.name,
        "model_version": spec.version,
        "model_title": spec.title,
        "model_equation": spec.equation,
        "model_reference": spec.reference,
        "parameters": material.file_parameters(),
        "parameter_sources": {written[name]: material.sources.get(name, material.source) for name in written},
        "source": material.source,
        "assumed": [written.get(name, name) for name in material.assumed],
        "note": material.note,
        "refractive_index": material.refractive_index or "",
        "known_excess": material.known_excess.model_dump() if material.known_excess else {},
        "conventions": (
            "directions point away from the surface; delta_phi = phi_r - phi_i, 0 is back towards the light, "
            "180 degrees the mirror half plane; f_r without cosine; isotropic tables are even in delta_phi"
        ),
    }


_LONG_NAMES = {
    "theta_i": "polar angle of the light",
    "theta_r": "polar angle of the viewer",
    "phi_i": "azimuth of the light",
    "phi_r": "azimuth of the viewer",
    "delta_phi": "azimuth of the viewer minus azimuth of the light",
}
