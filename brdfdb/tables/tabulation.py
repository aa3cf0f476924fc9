"""Tabulation: from a layout to a table, an xarray Dataset in memory with its provenance."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb._elementary import COS_HORIZON
from brdfdb.geometry import HALF_PI, radians, unit_vector, vectors_from_half_difference
from brdfdb.materials import Source
from brdfdb.measurements import MeasuredSource
from brdfdb.measurements.glints import Glints
from brdfdb.parameters import Floats
from brdfdb.tables.grids import RECIPROCITY, Axis, Grid
from brdfdb.tables.layout import TABLE_VERSION, Layout
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.mueller_field import AXES as MUELLER_AXES
from brdfdb.tables.polarisation import facets_of
from brdfdb.tables.stokes import Polarisation, record

if TYPE_CHECKING:
    import xarray as xr

_SLOPE_STEP = np.deg2rad(2.0)  # step of the difference that gives the slope at the horizon
POLE_END_DEG = 89.9  # last angle of light and viewer if the pole of a model is tabulated
_RISE = 1.0  # largest rise of the stored numbers of measured data beyond the horizon, where their slope is noise
_CONTINUED = 7.5  # number of steps up to which numbers are continued beyond the horizon
# Nodes of the specular part, unless a recipe gives an axis theta_i: planned nodes do not suit it
SPECULAR_THETA_DEG = np.append(np.arange(0.0, 60.0, 0.5), np.arange(60.0, 90.01, 0.1).round(1))
_SLAB = 1 << 17  # number of values that are evaluated together: fewer cost calls, more cost memory


class StoredArray(NamedTuple):
    """An array of a table: the names of its axes, its values, and its attributes such as units."""

    dims: tuple[str, ...]
    values: NDArray[Any]
    attrs: Mapping[str, Any]


class Frame(NamedTuple):
    """A table without its values. Builds write it as it is: xarray takes longer to import than a small table to build.

    Coordinates hold the axes, in degrees and nm. Variables hold the specular part, the basis and refractive indices.
    """

    variables: Mapping[str, StoredArray]
    coordinates: Mapping[str, StoredArray]
    attrs: Mapping[str, Any]


def tabulate(layout: Layout, values: NDArray[np.float32] | None = None) -> xr.Dataset:
    """Tabulate the BRDF of a source in memory: all blocks of a layout, or their `values` if they are known.

    The Dataset has ``brdf`` [1/sr], or ``parts``, from which it is rebuilt as the attribute ``reconstruction`` says:
    float32, over the axes of the grid and, last, ``wavelength`` or ``part``; for models with a specular part
    ``specular_reflectance`` [1] over theta_i, or specular_theta_i, and wavelength; for spectral materials ``n`` and
    ``k`` as used. Coordinates are in degrees and nm, with units. Attributes: title, model, parameters, sources and
    notes.
    """
    import xarray as xr

    if values is None:
        values = np.concatenate([block(layout, rows) for rows in layout.blocks])
    dataset = xr.Dataset(*frame(layout))
    return dataset.assign({layout.variable: (layout.dims, values, VARIABLES[layout.variable])})


def block(layout: Layout, rows: slice) -> NDArray[np.float32]:
    """Return the values of some rows of the first axis of a table: float32, over its other axes, too."""
    values = np.empty((rows.stop - rows.start, *layout.shape[1:]), dtype=np.float32)
    for slab in slabs(layout, rows):
        at = slice(slab.start - rows.start, slab.stop - rows.start)
        if layout.plain and not layout.grid.half_difference:
            evaluated_nm = layout.evaluated_nm
            for number, wavelength in enumerate([None] if evaluated_nm is None else evaluated_nm.tolist()):
                index: tuple[Any, ...] = (at, ...) if wavelength is None else (at, ..., number)
                values[index] = _evaluated(layout, slab, wavelength)
        else:
            numbers = stored(layout, node_numbers(layout, slab))
            values[at] = numbers.reshape(slab.stop - slab.start, *layout.shape[1:])
    return rounded(values, layout.bits)


def slabs(layout: Layout, rows: slice) -> Iterator[slice]:
    """Yield rows of the first axis of a table that are evaluated together."""
    step = max(1, _SLAB // int(np.prod(layout.grid.shape[1:])))
    for start in range(rows.start, rows.stop, step):
        yield slice(start, min(start + step, rows.stop))


def stored(layout: Layout, numbers: Floats) -> Floats:
    """Return the numbers that a table stores: coefficients of a factored spectrum, or `node_numbers` themselves."""
    if layout.spectra is None or layout.part_nm is not None:
        return numbers
    # A BLAS sums in an order that depends on the position of a row, which would break the symmetry of a table
    return np.asarray(np.einsum("...w,pw->...p", numbers, layout.spectra))


def rounded(values: NDArray[np.float32], bits: int) -> NDArray[np.float32]:
    """Return float32 values rounded to a number of bits of their mantissa, with an error of 2**-(bits + 1) at most."""
    drop = 23 - bits
    if drop == 0:
        return values
    mantissa = np.ascontiguousarray(values, dtype=np.float32).view(np.uint32)
    return ((mantissa + np.uint32(1 << (drop - 1))) >> np.uint32(drop) << np.uint32(drop)).view(np.float32)


def _evaluated(layout: Layout, rows: slice, wavelength_nm: ArrayLike | None) -> Floats:
    """Return f_r [1/sr] at some rows of the first axis; on a reciprocal grid with the smaller theta always the light's.

    There a table is its own transpose to the last bit, in whatever pieces it is computed.
    """

    def evaluate(theta_i: Floats, phi_i: Floats, theta_r: Floats, phi_r: Floats) -> Floats:
        return layout.tabulated.lookup(theta_i, phi_i, theta_r, phi_r, wavelength_nm)

    if not (layout.grid.reciprocal and layout.source.reciprocal):
        return evaluate(*layout.grid.directions(rows))
    theta, _, delta_phi = (radians(nodes) for nodes in layout.grid.axes.values())
    row, column = (index.ravel() for index in np.indices((rows.stop - rows.start, theta.size)))
    smaller = np.minimum(row + rows.start, column)
    larger = np.maximum(row + rows.start, column)
    pairs, pair = np.unique(smaller * theta.size + larger, return_inverse=True)  # each pair is evaluated once
    light = theta[pairs // theta.size]
    viewer = theta[pairs % theta.size]
    values = evaluate(light[:, np.newaxis], np.zeros(()), viewer[:, np.newaxis], delta_phi)
    return values[pair].reshape(-1, theta.size, *values.shape[1:])


def numbers(layout: Layout, wi: Floats, wr: Floats) -> Floats:
    """Return the numbers of a table at unit vectors (..., 3), before a spectrum is factored, shape (..., L).

    If spectra mix f_r itself, they are those of the parts, shape (..., parts).
    """
    return layout.interpolation.numbers(*factors(layout, wi, wr))


class NumberFactors(NamedTuple):
    """Sources of stored numbers: f_r [1/sr], shape (..., L), and mu = cos theta_i cos theta_r."""

    f_r: Floats
    mu: Floats


def factors(layout: Layout, wi: Floats, wr: Floats) -> NumberFactors:
    """Return f_r to tabulate, and the cosines, at unit vectors as `numbers` takes them."""
    wi, wr = np.broadcast_arrays(wi, wr)
    mu = np.maximum(wi[..., 2], COS_HORIZON) * np.maximum(wr[..., 2], COS_HORIZON)
    f_r = layout.tabulated.brdf_at(layout.evaluated_nm)(wi.reshape(-1, 3), wr.reshape(-1, 3))
    return NumberFactors(f_r.reshape(*mu.shape, -1), mu)


def node_numbers(layout: Layout, rows: slice) -> Floats:
    """Return `numbers` at some rows of nodes, continued beyond the horizon on a grid of half and difference vectors.

    They are continued along theta_d, with the slope at the largest theta_d: the one where light or viewer is at the
    horizon, or at 89.9 degrees if the numbers have a pole there.
    """
    grid = layout.grid
    if not grid.half_difference:
        angles = grid.directions(rows)
        mu = np.maximum(np.cos(angles[0]), COS_HORIZON) * np.maximum(np.cos(angles[2]), COS_HORIZON)
        f_r = _evaluated(layout, rows, layout.evaluated_nm)
        return layout.interpolation.numbers(f_r[..., np.newaxis] if layout.evaluated_nm is None else f_r, mu)
    axes = [radians(nodes) for nodes in grid.axes.values()]
    axes[0] = axes[0][rows]
    nodes = np.ix_(*axes)
    theta_h, phi_h, theta_d, phi_d = nodes if grid.anisotropic else (nodes[0], np.zeros(()), nodes[1], nodes[2])
    return continued(layout, theta_h, phi_h, theta_d, phi_d)


def continued(layout: Layout, theta_h: Floats, phi_h: Floats, theta_d: Floats, phi_d: Floats) -> Floats:
    """Return `numbers` at half and difference angles [rad], continued beyond the horizon as by `node_numbers`."""
    return extended(layout.source, *evaluated_to_horizon(layout, theta_h, phi_h, theta_d, phi_d, numbers))


class Beyond(NamedTuple):
    """Mask of half and difference angles beyond the horizon, and their distance from it in steps [1]."""

    mask: NDArray[np.bool_]
    steps: Floats


Evaluated = TypeVar("Evaluated")


class HorizonValues(NamedTuple, Generic[Evaluated]):
    """Values up to the horizon and, for the angles beyond it, the values a step before it with these angles."""

    values: Evaluated
    before: tuple[Evaluated, Beyond] | None


def evaluated_to_horizon(
    layout: Layout,
    theta_h: Floats,
    phi_h: Floats,
    theta_d: Floats,
    phi_d: Floats,
    evaluate: Callable[[Layout, Floats, Floats], Evaluated],
) -> HorizonValues[Evaluated]:
    """Evaluate a layout at half and difference angles [rad], with theta_d limited to its largest value."""
    lowest = 0.0  # cosine of light and viewer
    if layout.source.grazing_pole and layout.interpolation.power == 0.0:
        end = radians(POLE_END_DEG)
        lowest = float(np.cos(end))
        theta_h = np.minimum(theta_h, end)
    # cos theta_r = along cos theta_d - across sin theta_d, at phi_d or at the other side
    along = np.cos(theta_h)
    across = np.sin(theta_h) * np.abs(np.cos(phi_d))
    largest = np.arccos(np.minimum(lowest / np.hypot(along, across), 1.0)) - np.arctan2(across, along)
    largest = np.maximum(largest * (1.0 - 1e-12), 0.0)
    within = np.minimum(theta_d, largest)
    values = evaluate(layout, *_half_vectors(theta_h, phi_h, within, phi_d))
    step = np.minimum(_SLOPE_STEP, 0.5 * largest)
    before = np.maximum(within - step, 0.0)
    steps = np.minimum((theta_d - within) / np.maximum(step, 1e-9), _CONTINUED)
    *angles, steps = np.broadcast_arrays(theta_h, phi_h, before, phi_d, steps)
    mask = steps > 0.0
    if not mask.any():
        return HorizonValues(values, None)
    before_horizon = evaluate(layout, *_half_vectors(*(angle[mask] for angle in angles)))
    return HorizonValues(values, (before_horizon, Beyond(mask, steps[mask])))


def extended(source: Source, values: Floats, before: tuple[Floats, Beyond] | None) -> Floats:
    """Return the numbers of a table, continued with their slope, from those of `evaluated_to_horizon`."""
    if before is None:
        return values
    inside, beyond = before
    change = beyond.steps[:, np.newaxis] * (values[beyond.mask] - inside)
    values[beyond.mask] += np.minimum(change, _RISE) if isinstance(source, MeasuredSource) else change
    return values


def _half_vectors(theta_h: Floats, phi_h: Floats, theta_d: Floats, phi_d: Floats) -> tuple[Floats, Floats]:
    light, viewer = vectors_from_half_difference(theta_h, phi_h, theta_d, phi_d)
    for w in (light, viewer):
        w[..., 2] = np.maximum(w[..., 2], 0.0)  # rounding at the horizon
    return light, viewer


def frame(layout: Layout) -> Frame:
    """Return a table without its values: coordinates, specular part, basis, refractive indices and attributes."""
    source = layout.source
    grid = layout.grid
    wavelength_nm = layout.wavelength_nm
    spectral = () if wavelength_nm is None else ("wavelength",)
    coordinates = {name: _coordinate(name, nodes) for name, nodes in grid.axes.items()}
    variables = {}
    if wavelength_nm is not None:
        coordinates["wavelength"] = StoredArray(
            ("wavelength",),
            wavelength_nm,
            {"units": "nm", "long_name": "wavelength in vacuum", "standard_name": "radiation_wavelength"},
        )
    if (indices := source.refractive_indices(wavelength_nm)) is not None:
        for name, meaning, values in zip("nk", ("refractive index", "extinction coefficient"), indices, strict=True):
            variables[name] = StoredArray(("wavelength",), np.asarray(values), {"units": "1", "long_name": meaning})
    if layout.spectra is not None:
        name = "spectra" if layout.part_nm is None else "mixture"
        variables[name] = StoredArray(("part", "wavelength"), layout.spectra, VARIABLES[name])
    if layout.uniform is not None:
        of_each = layout.uniform.size > 1
        value = layout.uniform if of_each else layout.uniform[0]
        dims = ("wavelength",) if of_each else ()
        variables["uniform"] = StoredArray(dims, np.asarray(value), VARIABLES["uniform"])
    if source.has_specular:
        theta_i_deg = specular_nodes(layout)
        name = "specular_theta_i" if theta_i_deg is SPECULAR_THETA_DEG else "theta_i"
        coordinates[name] = _coordinate(name, theta_i_deg)
        variables["specular_reflectance"] = StoredArray(
            (name, *spectral),
            np.asarray(source.specular_reflectance(radians(theta_i_deg), wavelength_nm)),
            {"units": "1", "long_name": "reflectance of the specular part, in the exact mirror direction"},
        )
    if isinstance(source, MeasuredSource) and source.measured.extent is not None:
        variables["extrapolated"] = StoredArray(grid.names, extrapolated(source, grid), VARIABLES["extrapolated"])
    if (field := layout.field) is not None:
        for name, nodes in zip(MUELLER_AXES, field.axes_deg, strict=True):
            coordinates[name] = _coordinate(name, nodes)
        elements = field.elements if wavelength_nm is not None else field.elements[..., 0, :]
        named = (*MUELLER_AXES, *spectral, "element")
        variables["mueller"] = StoredArray(named, elements, VARIABLES["mueller"])
    elif (facets := facets_of(layout)) is not None:
        coordinates["mueller_theta_d"] = _coordinate("mueller_theta_d", facets.theta_d_deg)
        named = ("mueller_theta_d", "wavelength", "element")
        variables["mueller"] = StoredArray(named, facets.elements, VARIABLES["mueller"])
        depolarised = facets.depolarised if facets.depolarised.size > 1 else facets.depolarised[0]
        at = ("wavelength",) if facets.depolarised.size > 1 else ()
        variables["depolarised"] = StoredArray(at, np.asarray(depolarised), VARIABLES["depolarised"])
    return Frame(variables, coordinates, metadata_of(layout).attributes())


def extrapolated(source: MeasuredSource, grid: Grid) -> NDArray[np.bool_]:
    """Return which nodes of a grid lie outside of the directions that were measured, or below the horizon."""
    theta_i, phi_i, theta_r, phi_r = (angle.ravel() for angle in np.broadcast_arrays(*grid.directions()))
    outside = source.extrapolated(unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r))
    return np.asarray(outside | (np.maximum(theta_i, theta_r) > HALF_PI)).reshape(grid.shape)


def specular_nodes(layout: Layout) -> Axis:
    """Return the angles of incidence [degree] at which the specular part of a table is stored."""
    given = "theta_i" in layout.grid.axes and not layout.reason
    return layout.grid.axes["theta_i"] if given else SPECULAR_THETA_DEG


def _coordinate(name: str, nodes: Axis) -> StoredArray:
    return StoredArray((name,), nodes, {"units": "degree", "long_name": _LONG_NAMES[name]})


def _reconstruction(layout: Layout) -> str:
    """Return the formula for f_r from the arrays of a table, in one line."""
    over = "brdf is linear" if layout.interpolation.straight else "cubic"
    spectrum = "" if layout.wavelength_nm is None else f"; over wavelengths {over}"
    glints = "; lookups add the glints of the attribute measured" if glints_of(layout) is not None else ""
    if layout.plain:
        return f"brdf is f_r; between nodes {layout.interpolation.method}{spectrum}{glints}"
    how = layout.interpolation
    mixed = layout.part_nm is not None
    number = "parts @ spectra" if layout.spectra is not None and not mixed else "parts"
    value = f"max(exp({number}) - {how.offset!r}, 0)" if how.logarithm else number
    value = f"max({value} @ mixture, 0)" if mixed else value
    if how.power != 0.0:
        value = f"{value} / (cos(theta_i) * cos(theta_r))**{how.power:g}"
    value = f"uniform + {value}" if layout.uniform is not None else value
    beyond = "; nodes below the horizon hold a continuation" if layout.grid.half_difference else ""
    return f"brdf = {value}; between nodes, parts are interpolated, {how.method}{spectrum}{beyond}{glints}"


def metadata_of(layout: Layout) -> TableMetadata:
    """Return the metadata of a table that is known before its values are: without request and stated error."""
    source = layout.source
    wavelength_nm = layout.wavelength_nm
    measured = source.measured if isinstance(source, MeasuredSource) else None
    if measured is not None and measured.glints is not None:
        measured = measured.model_copy(update={"glints": glints_of(layout)})
    return TableMetadata(
        table_version=TABLE_VERSION,
        **source.attributes(),
        source_record=source.document(),
        measured=measured,
        conventions=(
            "directions point away from the surface; delta_phi = phi_r - phi_i, 0 is back towards the light, "
            "180 degrees the mirror half plane; f_r without cosine; isotropic tables are even in delta_phi"
        ),
        anisotropic=layout.grid.anisotropic,
        symmetries=[s for s in layout.grid.symmetries if source.reciprocal or s != RECIPROCITY],
        wavelength_range_nm=[] if wavelength_nm is None else [float(wavelength_nm[0]), float(wavelength_nm[-1])],
        interpolation=layout.interpolation,
        part_wavelengths_nm=[] if layout.part_nm is None else layout.part_nm.tolist(),
        bits=layout.bits,
        reconstruction=_reconstruction(layout),
        reason=layout.reason,
        polarisation=_polarisation(layout),
    )


def _polarisation(layout: Layout) -> Polarisation | None:
    """Return the record of the polarisation of a layout, without the error that is measured; None without it."""
    if layout.field is not None:
        return layout.field.record
    return None if layout.facet_theta_d_deg is None else record()


def glints_of(layout: Layout) -> Glints | None:
    """Return the glints of a source at the wavelengths of a layout; None if it has none that reflects light."""
    source = layout.source
    glints: Glints | None = getattr(source, "glints", None)
    if glints is None or not glints.lit:
        return None
    if layout.wavelength_nm is None or source.wavelengths_nm is None:
        return glints
    weights = [np.interp(layout.wavelength_nm, source.wavelengths_nm, row) for row in np.eye(glints.channels)]
    return glints.mixed(np.stack(weights))


_LONG_NAMES = {
    "theta_i": "polar angle of the light",
    "specular_theta_i": "polar angle of the light, of the specular part",
    "theta_r": "polar angle of the viewer",
    "phi_i": "azimuth of the light",
    "phi_r": "azimuth of the viewer",
    "delta_phi": "azimuth of the viewer minus azimuth of the light",
    "theta_h": "polar angle of the half vector, the bisector of light and viewer",
    "phi_h": "azimuth of the half vector",
    "theta_d": "angle between light and half vector",
    "phi_d": "azimuth of the light about the half vector",
    "mueller_theta_h": "polar angle of the half vector, of the Mueller matrix",
    "mueller_theta_d": "half the angle between light and viewer, of the Mueller matrix",
    "mueller_phi_d": "azimuth of the light about the half vector, of the Mueller matrix",
}

VARIABLES = {
    "brdf": {"units": "sr-1", "long_name": "bidirectional reflectance f_r"},
    "parts": {"units": "1", "long_name": "what f_r is rebuilt from, as the attribute reconstruction says"},
    "spectra": {"units": "1", "long_name": "how the parts make up each wavelength"},
    "mixture": {"units": "1", "long_name": "how f_r of the parts makes f_r at each wavelength"},
    "extrapolated": {"long_name": "true: the node lies outside of the directions that were measured"},
    "mueller": {"units": "1", "long_name": "elements of the Mueller matrix, as the attribute polarisation says"},
    "depolarised": {"units": "sr-1", "long_name": "the part of f_r that is not polarised"},
    "uniform": {"units": "sr-1", "long_name": "the part of f_r that is the same in all directions"},
}
