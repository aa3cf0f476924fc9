"""KAIST: Mueller matrices on half and difference vectors, of which f_r is read (.pbsdf, Baek et al. 2020).

The file is a tensor file of RGL's container. It holds M in 1/sr, without the cosine, over phi_d, theta_d, theta_h and
wavelength. Readers interpolate in straight lines along all four.

Bases are those of the plane of light and viewer, x along its normal for both, y = z x x with z the direction of travel.
Q > 0 is s-polarised, as here. U > 0 is linear along x + y, which is s - p: U and V of the file have the opposite sign.
Both signs together leave the matrix between bases of the plane as it is.

Polarised isotropic tables fit, at no more than five wavelengths in whole nanometres, because Mitsuba reads five. The
specular part is left out. Of files that are read, f_r of unpolarised light is the first element of the matrix. What was
not measured is nan.
"""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import CannotHoldError, FileFormatError
from brdfdb.formats._angles import HalfDifference
from brdfdb.formats._channels import Channels
from brdfdb.formats._interface import MEGABYTES, TOLERANCE
from brdfdb.formats._nodes import samples_of_grid
from brdfdb.formats._record import document_of, record, specular_remark
from brdfdb.formats._rgl_tensor import MAGIC, read_tensors, write_tensors
from brdfdb.formats._written import Written, whole
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._mueller_grid import MuellerGrid
    from brdfdb.measurements.samples import Samples
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


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    tolerance: float = 0.02,
    megabytes: float = 64.0,
    verdict: str | None = None,
) -> Written:
    """Write the Mueller matrices of a polarised table: whole, or not at all.

    Parameters
    ----------
    table : Table
        Polarised isotropic table in memory.
    path : path
        The file; one that is there is replaced.
    tolerance : float [1]
        Largest error against the table that 99 of 100 values of f_r, and of the normalised elements, may have.
    megabytes : float [1e6 byte]
        Largest size of the file.
    verdict : str, optional
        Verdict of the audit of this revision.

    Raises
    ------
    CannotHoldError
        If the table is unpolarised, or its wavelengths are above 65535 nm.
    ParameterError
        If no file of this table is so small.
    WriteError
        If the file cannot be written.
    """
    from brdfdb.formats._mueller_grid import mueller_grid

    if table.facets is None:
        raise CannotHoldError(f"{table.name}: is unpolarised, and the format holds Mueller matrices")
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
    return Channels(tuple(f"{value:g}nm" for value in nm), known, None, "M at each wavelength", remarks)


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

    Raises
    ------
    FileFormatError
        If the file is damaged, or an array is missing or of another shape.
    OSError
        If it cannot be read.

    Notes
    -----
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
        raise FileFormatError(f"{path}: field 'M' is {matrix.dtype} of shape {matrix.shape}; its axes say {shape}")
    for name, axis in zip((*_AXES, "wvls"), (*axes, at), strict=True):
        if not axis.size or not np.all(np.isfinite(axis)) or np.any(np.diff(axis) <= 0.0):
            raise FileFormatError(f"{path}: field {name!r} does not ascend")
    values = np.ascontiguousarray(matrix[..., 0, 0].transpose(2, 1, 0, 3)).astype(np.float64)
    values[np.isinf(values)] = np.nan
    channels = tuple(f"{nm:g}nm" for nm in at)
    description = tensors.get("description")
    known = {} if description is None else document_of(description.tobytes())
    name = str(known.get("name") or path.stem)
    samples = samples_of_grid(_SYSTEM, axes[::-1], values, name, channels, at, {**known, "element": "M[0, 0]"})
    return samples.selected(np.any(samples.known, axis=1))
