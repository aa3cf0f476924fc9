"""KAIST: Mueller matrices on half and difference vectors, of which f_r is read (.pbsdf, Baek et al. 2020).

The file is a tensor file of RGL's container. It holds M in 1/sr, without the cosine, over phi_d, theta_d, theta_h and
wavelength. Readers interpolate linearly along all four.

Bases are those of the plane of light and viewer, x along its normal for both, y = z x x with z the direction of travel.
Q > 0 is s-polarised, as here. U > 0 is linear along x + y, which is s - p: U and V of the file have the opposite sign.
Both signs together leave the matrix between bases of the plane as it is.

Polarised isotropic tables are written at no more than five wavelengths in whole nanometres, because Mitsuba reads
five. The specular part is left out. Files of any number of wavelengths are read: f_r of unpolarised light, the first
element of the matrix, and the matrices. A nan was not measured.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import CannotHoldError, FileFormatError, ParameterError
from brdfdb.formats._angles import HALF_PI, HalfDifference
from brdfdb.formats._channels import Channels, names_of
from brdfdb.formats._interface import MEGABYTES, TOLERANCE
from brdfdb.formats._nodes import rows_of_grid, samples_of
from brdfdb.formats._record import document_of, note, record, specular_remark
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
_ROUNDING = 1e-5  # of angles [rad] of 32 bits
_MOST_READ = 400_000  # values of f_r that are read of a file, as samples of fewer directions
_FEWEST_READ = 20_000  # directions that are read whatever the number of wavelengths
_THINNED = (1.0, 1.0, 0.25)  # what a node of phi_d, theta_d and theta_h counts
_MOST_JUDGED = 500_000  # matrices of a file whose eigenvalues are computed
_AT_ONCE = 1 << 14
_SEED = 2020


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
    from brdfdb.tables.mueller_field import MuellerField

    if isinstance(table.facets, MuellerField):
        raise CannotHoldError(
            f"{table.name}: its Mueller matrices are measured; files are written of models, whose matrices are facets'"
        )
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
    """Return f_r and Mueller matrices of a file at its own directions above the horizon.

    Names, shapes and directions as in Mitsuba's ``measured_polarized``: the axes of M are phi_d, theta_d, theta_h, the
    wavelength, and those of the Mueller matrix. Files of more values than samples may have are thinned, and are never
    read as a whole. The record has sentences on the share of all matrices that is physical, in the entry "physical".
    """
    from brdfdb.measurements.conventions import Convention, FormatConventions
    from brdfdb.measurements.mueller import mirrored
    from brdfdb.tables.mueller_field import to_surface

    path = path_of(path)
    file = _tensor_file(path)
    counts = [axis.size for axis in file.axes]
    nodes = [_thinned(count, step) for count, step in zip(counts, _steps(counts, file.wavelength_nm.size), strict=True)]
    matrix = file.matrix[np.ix_(*nodes)].astype(np.float64)
    matrix[~np.isfinite(matrix)] = np.nan
    matrix = matrix.transpose(2, 1, 0, 3, 4, 5)
    values = matrix[..., 0, 0]
    if np.all(np.isnan(values)):
        raise FileFormatError(f"{path}: field 'M' has no number at the nodes that are read: all of M[0, 0] are nan")
    with np.errstate(invalid="ignore", divide="ignore"):
        mueller = matrix / np.where(values > 0.0, values, np.nan)[..., np.newaxis, np.newaxis]
    mueller[np.isnan(mueller).any(axis=(-1, -2))] = np.nan
    record = {**file.known, "element": "M[0, 0]", "physical": _physical(file), "mueller_frame": "s"}
    note(record, "Bases of Mueller matrices were turned to those of the surface; U and V change their sign.")
    if math.prod(axis.size for axis in nodes) < math.prod(counts):
        shape = " x ".join(str(count) for count in counts)
        every = ", ".join(str(axis.size) for axis in nodes)
        note(record, f"Of {shape} nodes of phi_d, theta_d and theta_h, {every} were read, evenly spread.")
    axes = [axis[some] for axis, some in zip(file.axes, nodes, strict=True)]
    rows = rows_of_grid(
        _SYSTEM,
        axes[::-1],
        values,
        file.name,
        names_of(file.wavelength_nm),
        file.wavelength_nm,
        record,
        mueller=mirrored(mueller).reshape(-1, file.wavelength_nm.size, 4, 4),  # U and V have the opposite sign
    )
    samples = samples_of(rows, Convention(), FormatConventions())
    return to_surface(samples.selected(np.any(samples.known, axis=1)))


class TensorFile(NamedTuple):
    """A checked file: phi_d, theta_d and theta_h [rad], wavelengths (L,) [nm], M [1/sr] as it lies in the file."""

    name: str
    axes: list[NDArray[np.float64]]
    wavelength_nm: NDArray[np.float64]
    matrix: NDArray[Any]
    known: dict[str, Any]


def _tensor_file(path: Path) -> TensorFile:
    """Return the fields of a file; FileFormatError if one is missing or is not what it must be."""
    tensors = read_tensors(path)
    for name in (*_AXES, "wvls", "M"):
        if name not in tensors:
            raise FileFormatError(f"{path}: it has no field {name!r}")
    axes = [tensors[name].reshape(-1).astype(np.float64) for name in _AXES]
    at = tensors["wvls"].reshape(-1).astype(np.float64)
    shape = (*(axis.size for axis in axes), at.size, 4, 4)
    matrix = tensors["M"]
    if matrix.shape != shape or matrix.dtype.kind != "f":
        raise FileFormatError(f"{path}: field 'M' is {matrix.dtype} of shape {matrix.shape}; its axes give {shape}")
    for name, axis in zip((*_AXES, "wvls"), (*axes, at), strict=True):
        if not axis.size or not np.all(np.isfinite(axis)) or np.any(np.diff(axis) <= 0.0):
            raise FileFormatError(f"{path}: field {name!r} does not increase")
    for name, axis, most in zip(_AXES, axes, (2.0 * np.pi, HALF_PI, HALF_PI), strict=True):
        low = -np.pi if name == "phi_d" else 0.0
        if axis[0] < low - _ROUNDING or axis[-1] > most + _ROUNDING:
            span = f"{axis[0]:g} to {axis[-1]:g}"
            raise FileFormatError(
                f"{path}: field {name!r} has angles of {span}; allowed are {low:.4g} to {most:.4g} rad"
            )
    description = tensors.get("description")
    known = {} if description is None else dict(document_of(description.tobytes()))
    return TensorFile(str(known.get("name") or path.stem), axes, at, matrix, known)


def _steps(counts: Sequence[int], wavelengths: int) -> list[int]:
    """Return the steps of nodes of phi_d, theta_d and theta_h that leave as many samples as are read at most.

    theta_h, across which lobes lie, keeps its nodes longest.
    """
    most = max(_FEWEST_READ, _MOST_READ // wavelengths)
    steps = [1, 1, 1]
    while math.prod(_thinned(count, step).size for count, step in zip(counts, steps, strict=True)) > most:
        left = [share * count / step for share, count, step in zip(_THINNED, counts, steps, strict=True)]
        steps[left.index(max(left))] += 1
    return steps


def _thinned(count: int, step: int) -> NDArray[np.int64]:
    """Return every so many nodes of an axis, and the last."""
    return np.unique(np.append(np.arange(0, count, step), count - 1))


def _physical(file: TensorFile) -> list[str]:
    """Return sentences on the share of the matrices of a file that is physical: all, or some drawn at random."""
    from brdfdb.measurements.mueller import HalfDifferenceAngles, PhysicalShare

    counts = [axis.size for axis in file.axes]
    directions = math.prod(counts)
    wavelengths = file.wavelength_nm.size
    most = max(1, _MOST_JUDGED // wavelengths)
    drawn = np.arange(directions)
    if directions > most:
        drawn = np.sort(np.random.default_rng(_SEED).choice(directions, most, replace=False, shuffle=False))
    share = PhysicalShare(file.wavelength_nm)
    step = max(1, _AT_ONCE // wavelengths)
    for start in range(0, len(drawn), step):
        index = np.unravel_index(drawn[start : start + step], counts)
        phi_d, theta_d, theta_h = (axis[at] for axis, at in zip(file.axes, index, strict=True))
        wi, wr = _SYSTEM.vectors(np.stack([theta_h, theta_d, phi_d], axis=1))
        above = (wi[:, 2] > -_ROUNDING) & (wr[:, 2] > -_ROUNDING)
        matrix = file.matrix[tuple(at[above] for at in index)].astype(np.float64)
        matrix[~np.isfinite(matrix).all(axis=(-1, -2))] = np.nan
        share.add(matrix, HalfDifferenceAngles(theta_h[above], theta_d[above], _within_half_turn(phi_d[above])))
    return share.sentences(share.count * directions // len(drawn))


def _within_half_turn(phi: Floats) -> Floats:
    return np.asarray((phi + np.pi) % (2.0 * np.pi) - np.pi)


@dataclass(frozen=True, eq=False)
class MuellerGrid:
    """Mueller matrices at nodes of theta_h, theta_d and phi_d."""

    grid: Grid  #: nodes [degree]; phi_d ends at 90
    channels: Channels  #: wavelengths
    #: matrices between bases of the plane of light and viewer, continued below the horizon, (theta_h, theta_d, phi_d,
    #: L, 4, 4) [1/sr]
    values: NDArray[np.float32]
    error: FileError  #: error of f_r against the table
    #: limit of 99 of 100 errors of the normalised elements, of the worst element and wavelength, [1]
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
