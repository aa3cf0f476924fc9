"""KAIST: Mueller matrices on half and difference vectors, of which f_r is read (.pbsdf, Baek et al. 2020).

The file is a tensor file of RGL's container. It holds M in 1/sr, without the cosine, over phi_d, theta_d, theta_h and
wavelength. Readers interpolate linearly along all four.

Bases are those of the plane of light and viewer, x along its normal for both, y = z x x with z the direction of travel.
Q > 0 is s-polarised, as here. U > 0 is linear along x + y, which is s - p: U and V of the file have the opposite sign.
Both signs together leave the matrix between bases of the plane as it is.

A file can hold polarised isotropic tables, at no more than five wavelengths in whole nanometres, because Mitsuba reads
five. The specular part is left out. A reader of files gets f_r of unpolarised light, the first element of the matrix;
values that were not measured are nan.
"""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import CannotHoldError, FileFormatError, ParameterError
from brdfdb.formats._angles import HalfDifference
from brdfdb.formats._channels import Channels, names_of
from brdfdb.formats._interface import MEGABYTES, TOLERANCE
from brdfdb.formats._nodes import samples_of_grid
from brdfdb.formats._record import document_of, record, specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.formats.rgl._tensors import MAGIC, read_tensors, write_tensors
from brdfdb.parameters import Floats
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._stated_error import FileError
    from brdfdb.measurements.samples import Samples
    from brdfdb.tables.grids import Grid
    from brdfdb.tables.table import Table

suffix = ".pbsdf"
media_type = "application/octet-stream"
summary = "Mueller matrices of polarised tables"
tools = "Mitsuba 3 (`measured_polarized`)"
kinds = ()
options = (
    TOLERANCE,
    MEGABYTES,
)
HOLDS = (
    "Mueller BRDF M [1/sr] without the cosine, between Stokes bases of the plane of light and viewer: x along its "
    "normal, y = z cross x, z the direction of travel; U > 0 is linear along x + y, V > 0 turns clockwise for an "
    "observer who looks towards the incoming light"
)
_AXES = ("phi_d", "theta_d", "theta_h")
_SYSTEM = HalfDifference(anisotropic=False, mirrored=False, reciprocal=False)
_MOST_WAVELENGTHS = 5  # that Mitsuba reads
_MOST_NM = 65535  # of 16 bits
_BESIDE = 20_000  # bytes beside the matrices: the record and the axes
_ELEMENTS = ((0, 0), (0, 1), (1, 1), (2, 2), (2, 3))  # that are stored; [1, 0], [3, 3] and [3, 2] follow from them
_BYTES = 16 * 4  # of a matrix
_COPIES = 4  # of phi_d, of which symmetry leaves a quarter
_SPLIT = 0.5  # share of the tolerance up to which a cell of theta_d may change the elements of a facet
_FIRST_DEG = np.linspace(0.0, 90.0, 10)
_LEAST_DEG = 0.1


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    tolerance: float = 0.02,
    megabytes: float = 64.0,
    verdict: str | None = None,
) -> Written:
    """Write the Mueller matrices of a polarised table.

    The tolerance is that of f_r, and of the normalised elements. Unpolarised tables are refused, and wavelengths above
    65535 nm.
    """
    if table.facets is None:
        raise CannotHoldError(f"{table.name}: the table is unpolarised, and the format holds Mueller matrices")
    channels = _channels(table)
    made = mueller_grid(table, channels, tolerance, 1e6 * megabytes - _BESIDE)
    remarks = (*specular_remark(table), *channels.remarks)
    document = record(table, made.error, verdict, holds=HOLDS, remarks=remarks, tolerance=tolerance)
    document["error_of_elements"] = {"p99": float(f"{1.005 * made.element_p99:.3g}")}
    with whole(path) as (temporary,):
        write_tensors(temporary, _tensors(made, json.dumps(document)))
    return Written((path_of(path),), made.error, tolerance, remarks)


def _channels(table: Table) -> Channels:
    """Return up to five wavelengths in whole nanometres: those of the table, or equal steps over them."""
    at = table.wavelength_nm
    assert at is not None  # of all polarised tables
    if at[-1] > _MOST_NM:
        raise CannotHoldError(f"{table.name}: {at[-1]:g} nm; the format holds wavelengths up to {_MOST_NM} nm")
    few = at if at.size <= _MOST_WAVELENGTHS else np.linspace(np.ceil(at[0]), np.floor(at[-1]), _MOST_WAVELENGTHS)
    nm = np.unique(np.round(few))
    if at.size > 1:
        nm = nm[(nm >= at[0]) & (nm <= at[-1])]
    remarks: tuple[str, ...] = ()
    if at.size > 1 and not np.array_equal(nm, at):
        remarks = (f"at {', '.join(f'{value:g}' for value in nm)} nm alone: straight lines lie between them",)
    elif at.size == 1 and nm[0] != at[0]:
        remarks = (f"of {at[0]:g} nm, which the file calls {nm[0]:g} nm",)
    known = at if at.size == 1 else nm
    return Channels(names_of(nm), known, None, "M at each wavelength", remarks)


def _tensors(made: MuellerGrid, description: str) -> dict[str, NDArray[np.generic]]:
    """Return the fields of a file: phi_d over the whole turn, of which the grid has the first quarter."""
    theta_h, theta_d, quarter = (np.deg2rad(axis) for axis in made.grid.axes.values())
    half = np.concatenate([quarter, np.pi - quarter[-2::-1]])
    phi_d = np.concatenate([-half[:0:-1], half])
    within = np.concatenate([np.arange(quarter.size), np.arange(quarter.size - 2, -1, -1)])
    index = np.concatenate([within[:0:-1], within])
    matrix = np.ascontiguousarray(made.values.transpose(2, 1, 0, 3, 4, 5)[index])
    axes = {"phi_d": phi_d, "theta_d": theta_d, "theta_h": theta_h}
    return {
        **{name: axis.astype(np.float32)[np.newaxis] for name, axis in axes.items()},
        "wvls": np.array([int(name.removesuffix("nm")) for name in made.channels.names], np.uint16),
        "M": matrix,
        "description": np.frombuffer(description.encode(), np.uint8),
    }


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a tensor file with wavelengths and half vectors of this format."""
    return head.startswith(MAGIC) and all(name in head for name in (b"theta_h", b"theta_d", b"wvls"))


def read(path: str | os.PathLike[str]) -> Samples:
    """Return f_r of a file at its own directions above the horizon.

    Names, shapes and directions as in Mitsuba's ``measured_polarized``: the axes of M are phi_d, theta_d, theta_h, the
    wavelength, and those of the Mueller matrix.
    """
    path = path_of(path)
    tensors = read_tensors(path)
    for name in (*_AXES, "wvls", "M"):
        if name not in tensors:
            raise FileFormatError(f"{path}: it has no field {name!r}")
    axes = [tensors[name].reshape(-1).astype(np.float64) for name in _AXES]
    at = tensors["wvls"].reshape(-1).astype(np.float64)
    shape = (*(axis.size for axis in axes), at.size, 4, 4)
    matrix = tensors["M"]
    if matrix.shape != shape or matrix.dtype != np.float32:
        raise FileFormatError(f"{path}: field 'M' is {matrix.dtype} of shape {matrix.shape}; its axes give {shape}")
    for name, axis in zip((*_AXES, "wvls"), (*axes, at), strict=True):
        if not axis.size or not np.all(np.isfinite(axis)) or np.any(np.diff(axis) <= 0.0):
            raise FileFormatError(f"{path}: field {name!r} does not increase")
    values = np.ascontiguousarray(matrix[..., 0, 0].transpose(2, 1, 0, 3)).astype(np.float64)
    values[np.isinf(values)] = np.nan
    description = tensors.get("description")
    known = {} if description is None else document_of(description.tobytes())
    name = str(known.get("name") or path.stem)
    samples = samples_of_grid(_SYSTEM, axes[::-1], values, name, names_of(at), at, {**known, "element": "M[0, 0]"})
    return samples.selected(np.any(samples.known, axis=1))


@dataclass(frozen=True, eq=False)
class MuellerGrid:
    """Mueller matrices at nodes of theta_h, theta_d and phi_d.

    Attributes
    ----------
    grid : Grid
        Nodes [degree]; phi_d ends at 90.
    channels : Channels
        Wavelengths.
    values : float32 array (theta_h, theta_d, phi_d, L, 4, 4) [1/sr]
        Matrices between bases of the plane of light and viewer, continued below the horizon.
    error : FileError
        Error of f_r against the table.
    element_p99 : float [1]
        Limit of 99 of 100 errors of the normalised elements, of the worst element and wavelength.
    """

    grid: Grid
    channels: Channels
    values: NDArray[np.float32]
    error: FileError
    element_p99: float


def mueller_grid(table: Table, channels: Channels, tolerance: float, nbytes: float) -> MuellerGrid:
    """Return the smallest grid within a tolerance, of f_r and of the normalised elements, or the nearest of a size.

    Raises
    ------
    ParameterError
        If no grid is so small [byte].
    """
    from brdfdb.formats._dense_grid import dense_table
    from brdfdb.tables.grids import Grid

    facet = _theta_d(table, channels, _SPLIT * tolerance)
    most = nbytes / (_BYTES * _COPIES)
    share = 1.0
    while True:
        dense = dense_table(table, tolerance, axes="half_difference", most_values=int(share * most), channels=channels)
        axes = dense.grid.axes
        grid = Grid({**axes, "theta_d": np.union1d(axes["theta_d"], facet)})
        size = math.prod(grid.shape) * len(channels.names)
        if size <= most:
            return _filled(table, channels, grid)
        if share * most < 8 * len(channels.names):
            raise ParameterError("megabytes", f"{nbytes / 1e6:g} MB are too few for any file of {table.name}", nbytes)
        share *= 0.9 * most / size


def _theta_d(table: Table, channels: Channels, tolerance: float) -> NDArray[np.float64]:
    """Return nodes [degree] of theta_d between which straight lines keep to the elements of a facet."""
    from brdfdb.geometry import radians

    nodes = _FIRST_DEG
    while True:
        at = radians(nodes)
        middle = 0.5 * (at[1:] + at[:-1])
        ends, between = (table.facet_mueller(angle, channels.wavelength_nm) for angle in (at, middle))
        wrong = np.abs(0.5 * (ends[1:] + ends[:-1]) - between).max(axis=(1, 2, 3))
        split = (wrong > tolerance) & (np.diff(nodes) > _LEAST_DEG)
        if not split.any():
            return nodes
        nodes = np.sort(np.concatenate([nodes, np.rad2deg(middle[split]).round(4)]))


def _filled(table: Table, channels: Channels, grid: Grid) -> MuellerGrid:
    """Return the matrices at the nodes of a grid, with the errors of f_r and of the normalised elements."""
    from brdfdb.formats._angular_grid import AngularGrid
    from brdfdb.formats._dense_grid import values_at_nodes
    from brdfdb.formats._stated_error import Comparison
    from brdfdb.geometry import radians

    f_r = values_at_nodes(table, channels, grid).astype(np.float64)
    depolarised = table.depolarised(channels.wavelength_nm)
    facet = table.facet_mueller(radians(grid.axes["theta_d"]), channels.wavelength_nm)
    values = (f_r - depolarised)[..., np.newaxis, np.newaxis] * facet[np.newaxis, :, np.newaxis]
    values[..., 0, 0] = f_r
    stored = values.astype(np.float32)
    rows, columns = np.array(_ELEMENTS).T
    nodes = tuple(radians(axis) for axis in grid.axes.values())
    elements = stored[..., rows, columns].reshape(*grid.shape, -1)
    reader = AngularGrid(HalfDifference(anisotropic=False), nodes, elements)

    def evaluate(wi: Floats, wr: Floats) -> Floats:
        return reader.evaluate(wi, wr).reshape(len(wi), len(channels.names), len(_ELEMENTS))

    comparison = Comparison(table, channels)
    error = comparison.error_of(lambda wi, wr: np.maximum(evaluate(wi, wr)[..., 0], 0.0))
    above = comparison.wr[:, 2] > 0.0
    wi, wr = comparison.wi[above], comparison.wr[above]
    truth = table.mueller_in_plane(wi, wr, channels.wavelength_nm)[..., rows, columns]
    read = evaluate(wi, wr)
    counted = (truth[..., 0] > 0.0) & (read[..., 0] > 0.0)
    wrong = np.abs(read[counted] / read[counted][:, :1] - truth[counted] / truth[counted][:, :1])
    element_p99 = float(np.percentile(wrong, 99.0, axis=0).max(initial=0.0))
    return MuellerGrid(grid, channels, stored, error, element_p99)
