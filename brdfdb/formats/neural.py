"""Neural BRDF: a small network that gives f_r of an isotropic material in three colours (Sztrajman et al. 2021).

Networks are files of Keras (HDF5): layers of 21, 21 and 3 neurons, 675 weights in all. The input is the half vector,
turned to an azimuth of 0, and the difference vector. The output y stands for f_r = exp(y) - 1 in 1/sr. An archive
(.zip) of such files is read with the name of a member.
"""

from __future__ import annotations

import contextlib
import functools
import io
import os
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from brdfdb.errors import FileFormatError, ParameterError, import_extra
from brdfdb.formats._angles import HalfDifference, Spherical
from brdfdb.formats._channels import RGB
from brdfdb.formats._nodes import rows_of_grid
from brdfdb.parameters import Floats
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.measurements.conventions import ListedRows

suffix = ".h5"
keywords = ("member",)
_HDF5 = b"\x89HDF\r\n\x1a\n"
_ZIP = b"PK\x03\x04"
_LAYERS = ("dense_1", "dense_2", "dense_3")
_SHAPES = ((6, 21), (21, 21), (21, 3))
_MOST_BYTES = 1 << 24  # of a file with 675 weights, which has 19 kB
_MOST_MEMBERS = 10_000
_SYSTEM = HalfDifference(anisotropic=False, mirrored=False, reciprocal=False)
_NODES_DEG = (np.arange(0.0, 76.0, 15.0), np.arange(0.0, 90.0, 5.0), np.arange(0.0, 181.0, 10.0))
_NETWORK = (
    "A network has no values of its own: these are f_r at every 15 degrees of theta_i, 5 of theta_r and 10 of azimuth"
)


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of an HDF5 file, or of an archive that begins with one or with a folder."""
    if head.startswith(_ZIP):
        name = head[30 : 30 + int.from_bytes(head[26:28], "little")]
        return name.endswith((b".h5", b"/", b".json"))
    return head.startswith(_HDF5)


def read(path: str | os.PathLike[str], member: str = "") -> FileTable:
    """Return f_r of a network of Keras, or of the `member` of an archive, with or without its folder and suffix.

    Layers, input and output are those of the authors' repository (``binary_to_nbrdf.py``, ``nbrdf_npy.cpp``). f_r may
    be slightly negative.

    Raises
    ------
    ParameterError
        If an archive has no such member, or several.
    MissingExtraError
        If h5py is not installed.
    """
    from brdfdb.formats._readings import FileTable

    path = path_of(path)
    name, content = _content(path, member)
    layers = _layers(f"{path}: {name}" if name != path.stem else f"{path}", content)
    evaluate = functools.partial(_evaluated, layers)
    return FileTable(name, RGB, None, evaluate, {"network": _NETWORK}, functools.partial(_rows, name, evaluate))


def _rows(name: str, evaluate: Any) -> ListedRows:
    """Return values of a network on a grid."""
    system = Spherical(anisotropic=False, mirrored=True)
    nodes = [np.deg2rad(axis) for axis in _NODES_DEG]
    angles = np.stack([grid.reshape(-1) for grid in np.meshgrid(*nodes, indexing="ij")], axis=1)
    values = evaluate(*system.vectors(angles))
    return rows_of_grid(system, nodes, values, name, RGB, None, {"network": _NETWORK})


def _content(path: Path, member: str) -> tuple[str, bytes]:
    """Return the name of a network, and the bytes of its file."""
    with path.open("rb") as file:
        magic = file.read(len(_HDF5))
    if not magic.startswith(_ZIP):
        if member:
            raise ParameterError("member", f"{path} is not an archive", member)
        if magic != _HDF5 or path.stat().st_size > _MOST_BYTES:
            raise FileFormatError(f"{path}: it is not an HDF5 file of at most {_MOST_BYTES} bytes")
        return path.stem, path.read_bytes()
    with _opened(path) as archive:
        entries = _entries(archive)
        names = {entry.filename: Path(entry.filename).stem for entry in entries}
        wanted = [
            entry for entry in entries if member in (entry.filename, Path(entry.filename).name, names[entry.filename])
        ]
        wanted = entries if not member and len(entries) == 1 else wanted
        if len(wanted) != 1:
            shown = ", ".join(sorted(names.values())[:60])
            problem = f"{member!r} is not one of the members" if member else "name one of the members"
            raise ParameterError("member", f"{problem} of {path}: {shown}", member, tuple(names.values()))
        if wanted[0].file_size > _MOST_BYTES:
            raise FileFormatError(f"{path}: {wanted[0].filename} has {wanted[0].file_size} bytes")
        name = names[wanted[0].filename]
        with _sound(f"{path}: {name}"), archive.open(wanted[0]) as stream:
            return name, stream.read(_MOST_BYTES)


def members(path: str | os.PathLike[str]) -> list[str]:
    """Return the names of the networks of an archive, without folders if these are distinct; none of a network."""
    path = path_of(path)
    with path.open("rb") as file:
        if file.read(len(_ZIP)) != _ZIP:
            return []
    with _opened(path) as archive:
        names = sorted(entry.filename for entry in _entries(archive))
    if not names:
        raise FileFormatError(f"{path}: none of the files in the archive ends in {suffix}")
    stems = [Path(name).stem for name in names]
    return stems if len(set(stems)) == len(stems) else names


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open an archive; FileFormatError if it is damaged."""
    with _sound(f"{path}: it is not an archive, or"), zipfile.ZipFile(path) as archive:
        yield archive


@contextlib.contextmanager
def _sound(subject: str) -> Iterator[None]:
    """Raise FileFormatError, with a subject, for what the parser of archives comes to."""
    try:
        yield
    except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError, zlib.error) as error:
        raise FileFormatError(f"{subject} is damaged ({error})") from error


def _entries(archive: zipfile.ZipFile) -> list[zipfile.ZipInfo]:
    """Return the networks of an archive."""
    return [entry for entry in archive.infolist()[:_MOST_MEMBERS] if entry.filename.endswith(suffix)]


def _layers(path: str, content: bytes) -> list[tuple[Floats, Floats]]:
    """Return the weights and biases of the layers."""
    h5py = import_extra("h5py")
    layers: list[tuple[Floats, Floats]] = []
    try:
        with h5py.File(io.BytesIO(content), "r") as file:
            root = file.get("model_weights", file)
            for layer, shape in zip(_LAYERS, _SHAPES, strict=True):
                parts = []
                for part, expected in (("kernel", shape), ("bias", shape[1:])):
                    dataset = root[layer][layer][f"{part}:0"]
                    if dataset.shape != expected or dataset.dtype.kind != "f":
                        raise FileFormatError(
                            f"{path}: field {layer}/{part} is {dataset.dtype} of shape {dataset.shape}, not {expected}"
                        )
                    parts.append(np.asarray(dataset[()], dtype=np.float64))
                layers.append((parts[0], parts[1]))
    except FileFormatError:
        raise
    except Exception as error:  # h5py raises what its parser comes to
        if b"_NCProperties" in content or path.endswith(".nc"):
            text = "netCDF 4 is not read; write netCDF 3, for example with nccopy -k classic"
            raise FileFormatError(f"{path}: {text}") from error
        wanted = ", ".join(_LAYERS)
        raise FileFormatError(f"{path}: it is not a network of Keras with the layers {wanted} ({error})") from error
    if not all(np.all(np.isfinite(part)) for layer in layers for part in layer):
        raise FileFormatError(f"{path}: a weight is not finite")
    return layers


def _evaluated(layers: list[tuple[Floats, Floats]], wi: Floats, wr: Floats) -> Floats:
    """Return f_r [1/sr], shape (N, 3), at unit vectors (N, 3)."""
    theta_h, theta_d, phi_d = _SYSTEM.angles(wi, wr).T
    sine = np.sin(theta_d)
    half = np.sin(theta_h), np.zeros_like(theta_h), np.cos(theta_h)
    x = np.stack([*half, sine * np.cos(phi_d), sine * np.sin(phi_d), np.cos(theta_d)], axis=1)
    for weights, bias in layers[:-1]:
        x = np.maximum(x @ weights + bias, 0.0)
    return np.asarray(np.expm1(x @ layers[-1][0] + layers[-1][1]))
