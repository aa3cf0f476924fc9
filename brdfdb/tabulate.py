"""From a material and a grid to a table: an xarray Dataset in memory that says where every number comes from."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from brdfdb.geometry import radians
from brdfdb.layout import TABLE_VERSION, Layout
from brdfdb.materials import Material
from brdfdb.parameters import Floats

_SLAB = 1 << 17  # values evaluated at a time: fewer cost calls, more cost memory


def tabulate(layout: Layout) -> xr.Dataset:
    """Tabulate the BRDF of a material: all blocks of a layout, in memory.

    Returns
    -------
    Dataset
        ``brdf`` [1/sr], float32, over the axes of the grid and, last, ``wavelength``; for models with a Dirac part
        ``specular_reflectance`` [1] over theta_i and wavelength; for spectral materials ``n`` and ``k`` as used.
        Coordinates in degrees and nm, with units. Attributes: title, model, parameters, sources and notes.
    """
    values = np.concatenate([block(layout, rows) for rows in layout.blocks])
    return frame(layout).assign({layout.variable: (layout.dims, values, VARIABLES[layout.variable])})


def block(layout: Layout, rows: slice) -> NDArray[np.float32]:
    """The values of some rows of the first axis of a table: float32, in the shape of the table's other axes."""
    axes = [radians(nodes) for nodes in layout.grid.axes.values()]
    values = np.empty((rows.stop - rows.start, *layout.shape[1:]), dtype=np.float32)
    spectrum: list[tuple[tuple[int, ...], dict[str, Any]]]
    if layout.wavelength_nm is None:
        spectrum = [((), layout.material.arguments())]
    else:
        spectrum = [((w,), layout.material.arguments(one)) for w, one in enumerate(layout.wavelength_nm)]
    step = max(1, _SLAB // int(np.prod(layout.grid.shape[1:])))
    for start in range(rows.start, rows.stop, step):
        here = slice(start, min(start + step, rows.stop))
        for last, arguments in spectrum:
            at: tuple[Any, ...] = (slice(here.start - rows.start, here.stop - rows.start), ..., *last)
            values[at] = _evaluated(layout, axes, here, arguments)
    return values


def _evaluated(layout: Layout, axes: list[NDArray[np.float64]], rows: slice, arguments: dict[str, Any]) -> Floats:
    """The model at some rows of the first axis; on a reciprocal grid with the smaller theta always the light's.

    There a table is its own transpose to the last bit, in whatever pieces it is computed.
    """
    evaluate = layout.material.spec.evaluate
    first, *others = axes
    if not layout.grid.reciprocal:
        return evaluate(*_directions(layout, [first[rows], *others]), **arguments)
    theta, delta_phi = others
    values = np.empty((rows.stop - rows.start, theta.size, delta_phi.size))
    values[:, rows.start :] = evaluate(*_directions(layout, [first[rows], theta[rows.start :], delta_phi]), **arguments)
    swapped = evaluate(*_directions(layout, [theta[: rows.stop], first[rows], delta_phi]), **arguments)
    smaller = np.arange(rows.stop) < np.arange(rows.start, rows.stop)[:, np.newaxis]
    np.copyto(values[:, : rows.stop], np.swapaxes(swapped, 0, 1), where=smaller[..., np.newaxis])
    return values


def _directions(layout: Layout, axes: list[NDArray[np.float64]]) -> tuple[NDArray[np.float64], ...]:
    """theta_i, phi_i, theta_r, phi_r of the nodes that axes span, each on its own axis."""
    if layout.grid.anisotropic:
        return np.ix_(*axes)
    light, seen, turned = np.ix_(*axes)
    return light, np.zeros(()), seen, turned


def frame(layout: Layout) -> xr.Dataset:
    """All of a table but its values: coordinates, the Dirac part, refractive indices and attributes."""
    material, grid, wavelength_nm = layout.material, layout.grid, layout.wavelength_nm
    spec = material.spec
    spectral = () if wavelength_nm is None else ("wavelength",)
    coordinates: dict[str, Any] = {
        name: (name, nodes, {"units": "degree", "long_name": _LONG_NAMES[name]}) for name, nodes in grid.axes.items()
    }
    variables: dict[str, Any] = {}
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

VARIABLES = {"brdf": {"units": "sr-1", "long_name": "bidirectional reflectance f_r"}}
