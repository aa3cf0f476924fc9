"""OpenEXR: slices of a table as images, with one channel a wavelength, and its lit sphere.

A pixel is f_r in 1/sr at one pair of directions. A slice is a lobe for one light, a plane of incidence, or the plane of
half and difference vectors. Spectral tables have one channel for each wavelength, and linear sRGB for viewers. A file
is one slice, and not the whole table; no error is stated.

Anisotropic tables and all wavelengths fit, slice by slice. The specular part is not in the picture. The header states
it.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from brdfdb.formats._interface import Option

if TYPE_CHECKING:
    from brdfdb.formats._written import Written
    from brdfdb.tables.table import Table

suffix = ".exr"
media_type = "image/x-exr"
summary = "slices and lit spheres of tables as OpenEXR files"
tools = "every viewer of OpenEXR; spectral channels in the layout of Fichet et al. (2021)"
SPHERE = "sphere"
kinds = ("lobe", "half_difference", "in_plane", SPHERE)
options = (
    Option("theta_i", 45.0, "polar angle of the light of a lobe [degrees]", low=0.0, high=90.0),
    Option("phi_i", 0.0, "azimuth of the light, or of the half vector [degrees]", low=-720.0, high=720.0),
    Option("half", False, "16-bit floats, for viewing (default: 32-bit, for data)"),
)


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    kind: str = "lobe",
    theta_i: float = 45.0,
    phi_i: float = 0.0,
    half: bool = False,
    verdict: str | None = None,
) -> Written:
    """Write a slice, or the lit sphere, of a table as an OpenEXR file: whole, or not at all.

    Parameters
    ----------
    table : Table
        Table in memory.
    path : path
        The file; one that is there is replaced.
    kind : str
        "half_difference", "in_plane" or "lobe", as in `brdfdb.tables.slices`; or "sphere", the picture of
        `brdfdb.scenes.lit_sphere` in linear light.
    theta_i, phi_i : float [degree]
        Direction of the light. theta_i matters for a lobe only, phi_i for anisotropic tables only; it is the azimuth of
        the half vector in a half/difference slice.
    half : bool
        Write 16-bit floats, for viewing, instead of 32-bit floats, for computing.
    verdict : str, optional
        Verdict of the audit of this revision.

    Raises
    ------
    ParameterError
        If an angle is outside its range, or two wavelengths are equal.
    WriteError
        If the file cannot be written.
    """
    from brdfdb.formats._exr_file import write_slice, write_sphere
    from brdfdb.formats._pictures import slice_of

    if kind == SPHERE:
        return write_sphere(path, table, half, verdict)
    return write_slice(path, slice_of(table, kind, theta_i, phi_i), table, half, verdict)
