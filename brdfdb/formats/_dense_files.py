"""Files of dense tables: what netCDF, zarr, NumPy and CSV have in common."""

from __future__ import annotations

import contextlib
import functools
import json
import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError, ParameterError, import_extra
from brdfdb.formats._channels import names_of
from brdfdb.formats._input import opened_text
from brdfdb.formats._interface import TOLERANCE, FormatOption
from brdfdb.formats._record import CONVENTION, discovery, history_of, record, specular_remark
from brdfdb.measurements.conventions import ANGLE_WORDS, AZIMUTHS, RELATIVE, ListedRows
from brdfdb.place import path_of

if TYPE_CHECKING:
    import xarray as xr

    from brdfdb.formats._dense_grid import DenseTable
    from brdfdb.formats._readings import FileTable
    from brdfdb.measurements.samples import Samples
    from brdfdb.tables.table import Table

RESOLUTION = FormatOption(
    "resolution",
    0.0,
    "distance [degrees] of nodes on all axes; 0 places few nodes where f_r is curved",
    low=0.0,
    high=45.0,
)
OPTIONS = (
    TOLERANCE,
    FormatOption(
        "axes",
        "smallest",
        "angles of the grid: those of light and viewer, of half and difference vectors, or whichever need fewer values",
        choices=("smallest", "light_viewer", "half_difference"),
    ),
    RESOLUTION,
)


class DenseOptions(TypedDict, total=False):
    """Options of `dense_table` that a format with any grid of angles takes."""

    tolerance: float
    axes: str
    resolution: float


INTERPOLATION = "linear along all axes; at angles beyond the last node f_r is that of the node; 0 below the horizon"
_CONTINUED = "where light or viewer is below the horizon f_r is 0; values of such nodes only serve interpolation"
_TURNED = {
    "theta_i": "polar angle of the light",
    "theta_r": "polar angle of the viewer",
    "phi_i": "azimuth of the light",
    "phi_r": "azimuth of the viewer",
    "delta_phi": "azimuth of the viewer minus that of the light; 180 is the side of the mirror direction",
    "theta_h": "polar angle of the half vector",
    "phi_h": "azimuth of the half vector",
    "theta_d": "angle between the light and the half vector",
    "phi_d": "azimuth of the light about the half vector",
}
_MOST_VALUES = 1 << 27  # of a file that is read
_MOST_NODES = 1 << 22  # of an axis that is read
_DEGREES = ("", "degree", "degrees", "deg", "°")
_RIGHT_ANGLE = 1.58  # polar angles without a unit, none of which is larger, may be radians
_RADIANS = ("rad", "radian", "radians")
MOST_BYTES = 40_000_000  # size of a file that is written, about
_MOST_READ = 1 << 29  # of a file that is read
_DECIMALS = 4  # of angles [degree]: radians in files have six


@contextlib.contextmanager
def opened_netcdf(path: Path) -> Iterator[xr.Dataset]:
    """Open a netCDF 3 file; FileFormatError if it is damaged, MissingExtraError if SciPy is not installed."""
    import xarray as xr

    import_extra("scipy.io")
    try:
        with xr.open_dataset(path, engine="scipy", mmap=False) as opened:  # the map of a damaged file stays open
            yield opened
    except (FileFormatError, FileNotFoundError):
        raise
    except Exception as error:  # SciPy raises what its parser comes to
        first = str(error).partition("\n")[0]
        raise FileFormatError(f"{path}: it is not a netCDF 3 file, or is damaged ({first})") from error


def dense_record(table: Table, dense: DenseTable, verdict: str | None, *, specular: bool) -> dict[str, Any]:
    """Return the record of a file with a dense table; `specular` says that the file holds the specular part, too."""
    remarks = () if specular else specular_remark(table)
    document = record(table, dense.error, verdict, holds=CONVENTION, remarks=remarks, tolerance=dense.tolerance)
    continued = [_CONTINUED] if dense.grid.half_difference else []
    return {**document, "interpolation": "; ".join([INTERPOLATION, *continued]), "symmetries": dense.grid.symmetries}


def dataset(table: Table, dense: DenseTable, verdict: str | None) -> xr.Dataset:
    """Return a dense table as a Dataset: ``brdf``, the specular part, units and the record as attributes."""
    import xarray as xr

    from brdfdb.tables.xarray_view import plain_attributes, without_missing_coordinates

    at = dense.channels.wavelength_nm
    spectral = () if at is None else ("wavelength",)
    coordinates: dict[str, Any] = {
        name: (name, nodes, {"units": "degree", "long_name": _TURNED[name]}) for name, nodes in dense.grid.axes.items()
    }
    if at is not None:
        names = {"standard_name": "radiation_wavelength", "long_name": "wavelength", "units": "nm"}
        coordinates["wavelength"] = ("wavelength", at, names)
    values = dense.values if spectral else dense.values[..., 0]
    origin = {"coverage_content_type": "modelResult" if table.metadata.measured is None else "physicalMeasurement"}
    quantity = {"long_name": "bidirectional reflectance distribution function", "units": "sr-1", **origin}
    variables: dict[str, Any] = {"brdf": ((*dense.grid.names, *spectral), values, quantity)}
    if specular_remark(table) and table.specular is not None:
        nodes = table.axes_deg["theta_i"] if table.specular_theta_deg is None else table.specular_theta_deg
        coordinates["specular_theta_i"] = ("specular_theta_i", nodes, {"units": "degree", "long_name": "theta_i"})
        share = {"long_name": "reflectance of the specular part, in the exact mirror direction", "units": "1", **origin}
        variables["specular_reflectance"] = (("specular_theta_i", *spectral), table.specular, share)
    known = dense_record(table, dense, verdict, specular=True)
    attributes = plain_attributes({**known, **discovery(known), "history": history_of(known)})
    return without_missing_coordinates(xr.Dataset(variables, coordinates, attributes))


def record_of_attributes(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the record in attributes, whose objects and lists are JSON text."""
    document = {}
    for key, value in attributes.items():
        document[key] = value.item() if isinstance(value, np.generic) else value
        if isinstance(value, str) and value[:1] in ("{", "["):
            try:
                document[key] = json.loads(value)
            except (ValueError, RecursionError):
                continue
    return document


def read_dataset(path: Path, opened: xr.Dataset) -> FileTable | ListedRows | Samples:
    """Return f_r of a dataset that a file holds, or its samples; FileFormatError if it is neither."""
    from brdfdb.measurements.samples import Samples
    from brdfdb.tables.grids import axes_among

    if "brdf" not in opened.data_vars:
        raise FileFormatError(
            f"{path}: it has no variable brdf, only {', '.join(map(str, opened.data_vars)) or 'none'}"
        )
    brdf = opened["brdf"]
    # Values outside of the range that the attributes of CF declare valid are holes
    valid = brdf.attrs
    low, high = valid.get("valid_range", (valid.get("valid_min", -np.inf), valid.get("valid_max", np.inf)))
    if not low == -high == -np.inf:
        brdf = brdf.where((brdf >= low) & (brdf <= high))
    opened = opened.assign(brdf=brdf)
    if "sample" in brdf.dims:
        try:
            return Samples.from_xarray(opened)
        except (ValueError, TypeError) as error:
            raise FileFormatError(f"{path}: {error}") from None
    try:
        names = axes_among(brdf.dims)
    except ParameterError as error:
        raise FileFormatError(f"{path}: {error}") from None
    spectral = ("wavelength",) if "wavelength" in brdf.dims else ()
    if set(brdf.dims) != {*names, *spectral} or not set(brdf.dims) <= set(opened.coords):
        raise FileFormatError(
            f"{path}: the dimensions of brdf, {', '.join(map(str, brdf.dims))}, are not those of a table"
        )
    check_sizes(path, {name: opened[name].shape for name in ("brdf", *brdf.dims)})
    from brdfdb.measurements.conventions import PER_SR

    if _unit(brdf) not in PER_SR:
        raise FileFormatError(f"{path}: brdf has the units {_unit(brdf)!r}; allowed is sr-1")
    values = brdf.transpose(*names, *spectral).values
    at = _in_nm(path, opened["wavelength"]) if spectral else None
    axes = {name: _in_degrees(path, opened[name]) for name in names}
    for name in axes:
        if name.startswith("theta") and not _unit(opened[name]) and max(axes[name], default=0.0) < _RIGHT_ANGLE:
            text = "it has no units, and no angle above 1.6; state the attribute units as degree or rad"
            raise FileFormatError(f"{path}: field {name}: {text}")
    return file_table(path, axes, values, at, record_of_attributes(opened.attrs))


def check_sizes(path: Path, shapes: Mapping[Any, tuple[int, ...]]) -> None:
    """Raise FileFormatError if the values or the nodes of an axis are more than are read."""
    for name, shape in shapes.items():
        most = _MOST_NODES if len(shape) == 1 else _MOST_VALUES
        if math.prod(shape) > most:
            raise FileFormatError(f"{path}: {name} has {math.prod(shape)} numbers; at most {most} are read")


def _unit(variable: xr.DataArray) -> str:
    return str(variable.attrs.get("units", "")).strip()


def _in_nm(path: Path, variable: xr.DataArray) -> NDArray[Any]:
    """Return wavelengths [nm], in the unit that a file names."""
    from brdfdb.measurements.conventions import NM_PER

    if _unit(variable) not in NM_PER:
        raise FileFormatError(f"{path}: {variable.name} has the units {_unit(variable)!r}; allowed are nm, um and m")
    scale = NM_PER[_unit(variable)]
    return np.asarray(variable.values if scale == 1.0 else np.round(variable.values * scale, 9))


def _in_degrees(path: Path, variable: xr.DataArray) -> NDArray[Any]:
    """Return angles [degree], in the unit that a file names."""
    if _unit(variable) in _RADIANS:
        return degrees_of(variable.values, "rad")
    if _unit(variable) not in _DEGREES:
        raise FileFormatError(f"{path}: {variable.name} has the units {_unit(variable)!r}; allowed are degree and rad")
    return np.asarray(variable.values)


def file_table(
    path: str | os.PathLike[str],
    axes: Mapping[str, NDArray[Any]],
    values: NDArray[Any],
    wavelength_nm: NDArray[Any] | None,
    known: Mapping[str, Any],
) -> FileTable | ListedRows:
    """Return f_r that is interpolated linearly on the grid of a file; its rows if it has holes, or negative values.

    Raises
    ------
    FileFormatError
        If the axes, the wavelengths or the shape are not those of a table, or a value is infinite.
    """
    from brdfdb.formats._dense_grid import interpolated
    from brdfdb.formats._readings import FileTable
    from brdfdb.tables.grids import Grid, check_wavelengths

    try:
        grid = Grid(axes)
        at = None if wavelength_nm is None else check_wavelengths(wavelength_nm)
    except (ValueError, TypeError) as error:
        raise FileFormatError(f"{path}: {error}") from None
    shape = grid.shape if at is None else (*grid.shape, at.size)
    if values.shape != shape or values.dtype.kind not in "iuf":
        raise FileFormatError(f"{path}: brdf is {values.dtype} of shape {values.shape}, not numbers of shape {shape}")
    with np.errstate(over="ignore"):
        stored = values.astype(np.float32)
    if np.any(np.isinf(stored)) or np.all(np.isnan(stored)):
        raise FileFormatError(
            f"{path}: brdf has only holes, or values that are infinite or too large for 32-bit floats"
        )
    channels = names_of(at)
    name = str(known.get("name") or path_of(path).stem)

    def rows() -> ListedRows:
        angles = np.stack(np.broadcast_arrays(*grid.directions()), axis=-1).reshape(-1, 4)
        flat = values.reshape(-1, len(channels)).astype(np.float64)
        refused = [f"--azimuth {word}" for word in AZIMUTHS if word != "forward"]
        refused += [f"--angles {word}" for word in ANGLE_WORDS]
        own = tuple(refused) if grid.half_difference else ()
        return ListedRows(angles, flat, name, channels, at, known, refused=own)

    continued = grid.half_difference  # below the horizon, where a negative number serves the interpolation
    if np.any(np.isnan(values)) or (np.any(values < 0.0) and not continued):
        return rows()
    table = interpolated(grid, stored, at)
    return FileTable(
        name=name,
        channels=channels,
        wavelength_nm=at,
        evaluate=lambda wi, wr: np.asarray(table.lookup_vectors(wi, wr)).reshape(len(wi), len(channels)),
        record=known,
        rows=rows,
    )


def reading_of_rows(
    path: Path,
    angles: Mapping[str, NDArray[np.float64]],
    values: NDArray[np.float64],
    wavelength_nm: NDArray[np.float64] | None,
    known: Mapping[str, Any],
    rows: Callable[[], ListedRows] | None = None,
    *,
    stated: bool = False,
) -> FileTable | ListedRows:
    """Return f_r of rows of angles [degree]: interpolated linearly if they are a grid without holes, else as rows.

    There is a column of angles (N,) for each axis, and one of values (N, C) [1/sr] for each wavelength, or a single
    one. `known` is the record of the file. `rows` gives its rows (default: `listed_rows`). With `stated` the user says
    what angles or wavelengths are: the numbers may be none of a grid.

    Raises
    ------
    FileFormatError
        If the rows are over half and difference vectors and no grid, or there are more values than wavelengths.
    """
    from brdfdb.formats._readings import FileTable

    if values.shape[1] != (1 if wavelength_nm is None else wavelength_nm.size):
        raise FileFormatError(
            f"{path}: it has {values.shape[1]} columns of values; expected is one, or one for each wavelength"
        )
    of_axes = {name: np.unique(column) for name, column in angles.items()}
    shape = tuple(column.size for column in of_axes.values())
    of_vectors = {"theta_i", "theta_r"} <= set(angles)
    if of_vectors and rows is None:
        rows = functools.partial(listed_rows, path, angles, values, wavelength_nm, known)
    holes = not np.all(values >= 0.0)  # and what no interpolation can tell from them
    if rows is not None and (stated or holes):
        return rows()
    if np.prod(shape, dtype=object) == len(values) and _is_grid(angles, of_axes):
        ordered = values.reshape(*shape, -1)
        table = file_table(path, of_axes, ordered[..., 0] if wavelength_nm is None else ordered, wavelength_nm, known)
        return replace(table, rows=rows) if isinstance(table, FileTable) and rows is not None else table
    if rows is None:
        raise FileFormatError(f"{path}: the rows over {', '.join(angles)} do not form a grid")
    return rows()


def listed_rows(
    path: Path,
    angles: Mapping[str, NDArray[np.float64]],
    values: NDArray[np.float64],
    wavelength_nm: NDArray[np.float64] | None,
    known: Mapping[str, Any],
    **keywords: Any,
) -> ListedRows:
    """Return the rows of theta_i, theta_r and their azimuths, or delta_phi [degree], as `reading_of_rows`.

    Keywords are those of `ListedRows`.
    """
    zero = np.zeros(len(values))
    phi_i = angles.get("phi_i", zero)
    relative = "delta_phi" in angles and "phi_i" not in angles
    known = {**known, "azimuths": RELATIVE} if relative else known
    phi_r = phi_i + angles["delta_phi"] if "delta_phi" in angles else angles.get("phi_r", zero)
    rows = np.deg2rad(np.stack([angles["theta_i"], phi_i, angles["theta_r"], phi_r], axis=1))
    name = str(known.get("name") or path.stem)
    channels = names_of(wavelength_nm)
    return ListedRows(rows, values, name, channels, wavelength_nm, known, relative=relative, **keywords)


def _is_grid(angles: Mapping[str, NDArray[np.float64]], nodes: Mapping[str, NDArray[np.float64]]) -> bool:
    """Return True if the rows are all nodes of a grid of a table, the last axis fastest."""
    from brdfdb.tables.grids import KINDS

    if tuple(nodes) not in KINDS or any(column.size < 2 or column[0] != 0.0 for column in nodes.values()):
        return False
    expected = np.meshgrid(*nodes.values(), indexing="ij")
    return all(np.array_equal(grid.reshape(-1), angles[name]) for grid, name in zip(expected, nodes, strict=True))


def parsed(path: Path) -> dict[str, Any]:
    """Return the object in a JSON file; FileFormatError if it holds none, or more than 512 MiB."""
    try:
        with opened_text(path, _MOST_READ) as file:
            document = json.load(file, object_pairs_hook=_once)
    except FileFormatError:
        raise
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{path}: it is not JSON, or is damaged ({error})") from error
    if not isinstance(document, dict):
        raise FileFormatError(f"{path}: it is not a JSON object")
    return document


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of JSON; ValueError if it has a name twice, of which parsers take the last."""
    document = dict(pairs)
    if len(document) != len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"an object has the field {twice!r:.80} twice; write a file for each")
    return document


def column(path: Path, name: str, values: Any, *, holes: bool = False) -> NDArray[np.float64]:
    """Return a list of numbers, with nan for null if it may have holes; FileFormatError if it holds anything else."""
    try:
        numbers = np.array(values, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        numbers = np.empty((0, 0))
    if numbers.ndim != 1 or not numbers.size or np.any(np.isinf(numbers) | (np.isnan(numbers) & ~holes)):
        raise FileFormatError(f"{path}: field {name}: it is not a list of numbers")
    return numbers


def degrees_of(values: NDArray[np.float64], unit: str) -> NDArray[np.float64]:
    """Return angles [degree] to four decimals; `unit` is "rad" or another word for degrees."""
    return np.round(np.rad2deg(values) if unit == "rad" else values, _DECIMALS)


def title_of(known: Mapping[str, Any]) -> str:
    """Return what a record says of a file, its error and the audit, in one line."""
    error = known["error_of_file"]["p99"]
    text = f"{known['title'] or known['name']}; model {known['model']}; {known['holds']}; audit: {known['audit']}; "
    return text + f"99 of 100 values are within {error:.3g} of the table, relative, with linear interpolation"
