"""KAIST: measured Mueller matrices on half and difference vectors (.pbsdf, Baek et al. 2020), of which f_r is read.

The file is a tensor file of RGL's container. f_r of unpolarised light is the first element of the matrix, in 1/sr. What
was not measured is nan.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from brdfdb.errors import FileFormatError
from brdfdb.formats._angles import HalfDifference
from brdfdb.formats._nodes import samples_of_grid
from brdfdb.formats._rgl_tensor import MAGIC, read_tensors

if TYPE_CHECKING:
    from brdfdb.measurements.samples import Samples

suffix = ".pbsdf"
_AXES = ("phi_d", "theta_d", "theta_h")
_SYSTEM = HalfDifference(anisotropic=False, mirrored=False, reciprocal=False)


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
    path = Path(path)
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
    samples = samples_of_grid(_SYSTEM, axes[::-1], values, path.stem, channels, at, {"element": "M[0, 0]"})
    return samples.selected(np.any(samples.known, axis=1))
