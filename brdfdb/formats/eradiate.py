"""Eradiate: tables of its BSDF ``mqdiffuse``, measured and almost diffuse, as netCDF.

f_r in 1/sr is on a regular grid: the cosines of light and viewer, and the azimuth between them. Eradiate repeats the
first azimuth behind the last one, and its kernel interpolates linearly along all three. Narrow lobes need more nodes
than a grid can have. A grid that is searched has 193 cosines and 256 azimuths at most, 38 MB.

The file holds one wavelength (``--wavelength``) of an isotropic table. Anisotropic tables are refused. The specular
part is left out.
"""

from __future__ import annotations

import bisect
import functools
import itertools
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import CannotHoldError, FileFormatError, import_extra
from brdfdb.formats._channels import at_wavelength, names_of
from brdfdb.formats._dense_files import opened_netcdf, record_of_attributes
from brdfdb.formats._interface import TOLERANCE, WAVELENGTH, FormatOption
from brdfdb.formats._nodes import weighted, without_holes
from brdfdb.formats._record import history_of, record, specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.measurements.conventions import ListedRows
from brdfdb.parameters import Floats
from brdfdb.place import path_of

if TYPE_CHECKING:
    import xarray as xr

    from brdfdb.formats._channels import Channels
    from brdfdb.formats._readings import FileTable
    from brdfdb.formats._stated_error import Comparison
    from brdfdb.tables.table import Table

suffix = ".nc"
media_type = "application/netcdf"
summary = "netCDF tables of Eradiate's mqdiffuse, at one wavelength"
tools = "Eradiate (`mqdiffuse`), xarray"
kinds = ()
options = (
    TOLERANCE,
    WAVELENGTH,
    FormatOption(
        "nodes",
        0,
        "number of nodes in the cosines of light and viewer; 0 takes the fewest within the tolerance",
        low=3.0,
        high=513.0,
        most_served=129.0,
    ),
)
_DIMS = ("cos_theta_o", "phi_d", "cos_theta_i")
_COSINES = (2, 4, 6, 9, 13, 19, 28, 41, 60, 88, 129, 193)
_AZIMUTHS = (2, 4, 6, 8, 12, 18, 26, 40, 60, 90, 130, 192, 256)  # even: a node is at the mirror direction
_FROM_POLE = 0.25  # cosine in steps of the grid that stands for 0 where f_r has a pole at the horizon
_MOST_VALUES = 1 << 28  # of a file that is read
HOLDS = (
    "f_r [1/sr], the BRDF without the cosine, at the coordinates; Eradiate repeats phi_d = 0 at 2 pi; "
    "cos_theta_o is that of the viewer"
)


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    tolerance: float = 0.02,
    wavelength: float = 550.0,
    nodes: int = 0,
    verdict: str | None = None,
) -> Written:
    """Write f_r at one wavelength for Eradiate's ``mqdiffuse``.

    The dimensions are cos_theta_o, phi_d and cos_theta_i: cosines from 0 to 1, and azimuths 2 pi d / N, both in equal
    steps. Eradiate's ``MQDiffuseBSDF`` appends the values of phi_d = 0 at 2 pi before it calls the kernel, whose plugin
    alone would read node d of N at 2 pi d / (N - 1). If no grid of 38 MB is within the tolerance, the nearest is
    written. With `nodes` cosines there are as many azimuths, or one more if the number is odd: 513 take 541 MB.
    """
    from brdfdb.formats._stated_error import Comparison

    import_extra("scipy.io")
    if table.anisotropic:
        raise CannotHoldError(f"{table.name}: the table is anisotropic, and mqdiffuse holds only isotropic tables")
    channels = at_wavelength(table, wavelength)
    comparison = Comparison(table, channels)
    shape = (nodes, nodes + nodes % 2, nodes) if nodes else _smallest(table, comparison, tolerance)
    azimuths_and_lights = np.ix_(np.arange(shape[1]), np.arange(shape[2]))
    rows = [_node(table, channels, shape, np.array([row]), *azimuths_and_lights)[..., 0] for row in range(shape[0])]
    values = np.stack(rows).astype(np.float32)
    error = comparison.error_of(functools.partial(_evaluated, values))
    remarks = (*specular_remark(table), *channels.remarks)
    wanted = None if nodes else tolerance
    known = record(table, error, verdict, holds=HOLDS, remarks=remarks, tolerance=wanted)
    known["wavelength_nm"] = None if channels.wavelength_nm is None else float(channels.wavelength_nm[0])
    with whole(path) as (half,):
        _dataset(values, known).to_netcdf(half, engine="scipy", format="NETCDF3_64BIT")
    return Written((path_of(path),), error, wanted, remarks)


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a netCDF 3 file with the dimensions of ``mqdiffuse``."""
    return head.startswith((b"CDF\x01", b"CDF\x02")) and all(name.encode() in head for name in _DIMS)


def read(path: str | os.PathLike[str]) -> FileTable:
    """Return f_r of a table of ``mqdiffuse`` as Eradiate's kernel interpolates it."""
    from brdfdb.formats._readings import FileTable

    path = path_of(path)
    with opened_netcdf(path) as opened:
        values = _checked(opened, path)
        known = record_of_attributes(opened.attrs)
    name = str(known.get("name") or path.stem)
    nm = known.get("wavelength_nm")
    at = np.array([float(nm)]) if isinstance(nm, int | float) else None

    def rows() -> ListedRows:
        axes = (axis for _, axis, _ in _coordinates(values.shape).values())
        viewer, turn, light = (grid.reshape(-1) for grid in np.meshgrid(*axes, indexing="ij"))
        zero = np.zeros(values.size)
        angles = np.stack([np.arccos(light), zero, np.arccos(viewer), -turn % (2.0 * np.pi)], axis=1)
        return ListedRows(angles, values.reshape(-1, 1).astype(np.float64), name, names_of(at), at, known)

    return FileTable(name, names_of(at), at, functools.partial(_evaluated, values), known, rows)


def _smallest(table: Table, comparison: Comparison, tolerance: float) -> tuple[int, int, int]:
    """Return the shape of the smallest grid within the tolerance, or of the nearest one."""
    known: dict[tuple[int, int, int], float] = {}

    def within(cosines: int, azimuths: int) -> bool:
        shape = (cosines, azimuths, cosines)
        node = functools.partial(_node, table, comparison.channels, shape)
        known[shape] = comparison.error_of(functools.partial(_interpolated, shape, node)).p99
        return known[shape] <= tolerance

    def order(shape: tuple[int, int, int]) -> tuple[float, int]:
        return max(known[shape], tolerance), math.prod(shape)

    for cosines in _COSINES:
        if known and (best := min(known, key=order)) and known[best] <= tolerance:
            if cosines**2 * _AZIMUTHS[0] >= math.prod(best):
                break
            if not within(cosines, max(n for n in _AZIMUTHS if cosines**2 * n < math.prod(best) or n == _AZIMUTHS[0])):
                continue
        elif not within(cosines, _AZIMUTHS[-1]):
            continue
        bisect.bisect_left(_AZIMUTHS[:-1], True, key=functools.partial(within, cosines))
    return min(known, key=order)


def _node(table: Table, channels: Channels, shape: tuple[int, int, int], viewer: Any, turn: Any, light: Any) -> Floats:
    """Return f_r [1/sr] of a table at nodes of a grid, shape (N, 1)."""
    from brdfdb.geometry import unit_vector

    lowest = _FROM_POLE if table.source is None or table.source.grazing_pole else 0.0
    theta_r, theta_i = (np.arccos(np.maximum(node, lowest) / (shape[0] - 1)) for node in (viewer, light))
    azimuth = np.minimum(turn, shape[1] - turn) * (2.0 * np.pi / shape[1])
    wi, wr = unit_vector(theta_i, np.zeros(1)), unit_vector(theta_r, azimuth)
    for w in (wi, wr):
        w[..., 2] = np.maximum(w[..., 2], 0.0)  # rounding at the horizon
    return channels.values(table, wi, wr)


def _interpolated(
    shape: tuple[int, int, int], node: Callable[[Any, Any, Any], Floats], wi: Floats, wr: Floats
) -> Floats:
    """Return f_r [1/sr], shape (N, 1), as Eradiate's kernel interpolates the nodes of a grid."""
    turn = np.arctan2(wi[:, 1], wi[:, 0]) - np.arctan2(wr[:, 1], wr[:, 0])
    steps = np.array([shape[0] - 1, shape[1], shape[2] - 1])[:, np.newaxis]
    x = np.stack([wr[:, 2], np.mod(turn / (2.0 * np.pi), 1.0), wi[:, 2]]) * steps
    x = np.maximum(x, 0.0)  # viewers below the horizon, whose values do not count
    first = np.minimum(x.astype(np.int64), steps - 1)
    share = x - first
    total: Floats = np.zeros((len(wi), 1))
    for corner in itertools.product((0, 1), repeat=3):
        side = np.array(corner)[:, np.newaxis]
        weight = np.prod(np.where(side == 1, share, 1.0 - share), axis=0)
        viewer, azimuth, light = first + side
        total = total + weighted(weight, node(viewer, azimuth % shape[1], light))
    return np.where(wr[:, 2:] > 0.0, total, 0.0)


def _evaluated(values: NDArray[Any], wi: Floats, wr: Floats) -> Floats:
    shape = (values.shape[0], values.shape[1], values.shape[2])
    return _interpolated(shape, lambda *at: values[at][:, np.newaxis].astype(np.float64), wi, wr)


def _coordinates(shape: tuple[int, ...]) -> dict[str, tuple[str, NDArray[np.float64], dict[str, str]]]:
    """Return the coordinates that Eradiate checks."""
    viewer, azimuths, light = shape
    nodes = {
        "cos_theta_o": (np.linspace(0.0, 1.0, viewer), "1", "cosine of the polar angle of the viewer"),
        "phi_d": (np.linspace(0.0, 2.0 * np.pi, azimuths, endpoint=False), "rad", "azimuth between light and viewer"),
        "cos_theta_i": (np.linspace(0.0, 1.0, light), "1", "cosine of the polar angle of the light"),
    }
    return {name: (name, at, {"units": unit, "long_name": text}) for name, (at, unit, text) in nodes.items()}


def _dataset(values: NDArray[np.float32], known: dict[str, Any]) -> xr.Dataset:
    import xarray as xr

    from brdfdb.tables.xarray_view import plain_attributes, without_missing_coordinates

    brdf = (_DIMS, values, {"units": "sr-1", "long_name": "bidirectional reflectance f_r", "comment": HOLDS})
    attributes = plain_attributes({**known, "history": history_of(known)})
    return without_missing_coordinates(xr.Dataset({"brdf": brdf}, _coordinates(values.shape), attributes))


def _checked(opened: xr.Dataset, path: Path) -> NDArray[Any]:
    """Return the values of a file; FileFormatError where Eradiate would refuse it."""
    if "brdf" not in opened.data_vars or set(opened["brdf"].dims) != set(_DIMS):
        raise FileFormatError(f"{path}: it has no variable brdf over {', '.join(_DIMS)}")
    brdf = opened["brdf"].transpose(*_DIMS)
    if brdf.size > _MOST_VALUES or min(brdf.shape) < 2:
        raise FileFormatError(f"{path}: brdf has the shape {brdf.shape}; each axis needs at least two nodes")
    for name, (_, expected, _) in _coordinates(brdf.shape).items():
        if name not in opened.coords or not np.allclose(opened[name], expected):
            raise FileFormatError(f"{path}: the coordinates {name} do not have the equal steps that mqdiffuse needs")
    values = brdf.values
    if values.dtype.kind not in "iuf" or not np.all(np.isfinite(values)):
        raise FileFormatError(f"{path}: brdf holds values that are not finite numbers")
    return without_holes(np.asarray(values, np.float32))
