"""OpenEXR: slices of a table as images, with one channel for each wavelength, and its lit sphere.

A pixel is f_r in 1/sr at one pair of directions. A slice is a lobe for one light, a plane of incidence, or the plane of
half and difference vectors. Spectral tables have one channel for each wavelength, and linear sRGB for viewers. A file
is one slice, and not the whole table; no error is stated.

Slices of anisotropic tables and all wavelengths can be written. The specular part is not in the picture. The header
states it.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError, WriteError
from brdfdb.formats._interface import FormatOption
from brdfdb.formats._record import record, specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.tables.slices import Slice
    from brdfdb.tables.table import Table

suffix = ".exr"
media_type = "image/x-exr"
summary = "slices and lit spheres of tables as OpenEXR files"
tools = "every viewer of OpenEXR; spectral channels in the layout of Fichet et al. (2021)"
SPHERE = "sphere"
kinds = ("lobe", "half_difference", "in_plane", SPHERE)
options = (
    FormatOption("theta_i", 45.0, "polar angle of the light of a lobe [degrees]", low=0.0, high=90.0),
    FormatOption("phi_i", 0.0, "azimuth of the light, or of the half vector [degrees]", low=-720.0, high=720.0),
    FormatOption("half", False, "16-bit floats, for viewing (default: 32-bit, for data)"),
)
QUANTITY = "f_r"
UNIT = "1/sr"
HALF_MAX = 65504.0
SPHERE_PIXELS = 256  # pixels across the picture of a sphere
LIT = "radiance of a lit sphere, linear sRGB under D65; a white Lambertian one has 0.8 where it is brightest"


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
    """Write a slice of `brdfdb.tables.slices`, or the lit sphere of `brdfdb.scenes.lit_sphere` in linear light.

    theta_i matters for a lobe only, phi_i for anisotropic tables only. In a half/difference slice it is the azimuth of
    the half vector.
    """
    import OpenEXR  # noqa: F401  # a missing extra is named before anything is computed

    from brdfdb.formats._pictures import slice_of

    if kind == SPHERE:
        return write_sphere(path, table, half, verdict)
    return write_slice(path, slice_of(table, kind, theta_i, phi_i), table, half, verdict)


def write_slice(
    path: str | os.PathLike[str], image: Slice, table: Table, half: bool = False, verdict: str | None = None
) -> Written:
    """Write a slice as an OpenEXR file, ZIP compressed.

    Channels: R, G, B for viewers, and one a wavelength in the reflective layout of Fichet et al. (2021,
    ``fichet2021``), ``T.550,0nm``; zeros in front, ``T.0550,0nm``, if others reach 1000 nm. The pixels are f_r itself
    [1/sr], which can exceed 1; the specular part of a mirror-like material is no part of f_r and not in the file. R, G,
    B are linear sRGB under D65 where the wavelengths cover the visible range, else all three are the value, averaged
    over the wavelengths.

    The attributes begin with ``brdf:``. Angles and wavelengths are strings, as OpenEXR rounds a number to 32 bits; the
    pixel centres are a pair of 64 bit floats. ``brdf:error_p99`` is the relative error against the model that 99 of 100
    values of the table stay within, as the table states it. With `half`, values above 65504, the largest 16-bit float,
    are written as 65504, and the attribute ``brdf:half`` counts them.

    Raises
    ------
    ParameterError
        If two wavelengths are equal.
    """
    from brdfdb.formats._pictures import rgb_of

    path = path_of(path)
    rgb, rgb_meaning = rgb_of(image)
    pixels = {name: rgb[..., index] for index, name in enumerate("RGB")}
    header = _attributes(image, table)
    header["brdf:record"] = json.dumps(record(table, None, verdict))
    header["brdf:rgb"] = rgb_meaning
    if image.wavelength_nm is not None:
        names = _spectral_channels(image.wavelength_nm)
        pixels |= {name: image.values[..., index] for index, name in enumerate(names)}
        header["spectralLayoutVersion"] = "1.0"
        header["brdf:wavelength_nm"] = " ".join(_decimals(image.wavelength_nm))
    if half:
        clipped = sum(int(np.count_nonzero(np.abs(array) > HALF_MAX)) for array in pixels.values())
        header["brdf:half"] = f"values above {HALF_MAX:g} are written as {HALF_MAX:g}: {clipped} in all channels"
        pixels = {name: np.clip(array, -HALF_MAX, HALF_MAX).astype(np.float16) for name, array in pixels.items()}
    return _write(path, header, pixels)


def _write(path: Path, header: dict[str, Any], pixels: dict[str, NDArray[Any]]) -> Written:
    import OpenEXR

    # OpenEXR reads a strided array as if it were contiguous: wrong pixels and no error.
    channels = {name: np.ascontiguousarray(array) for name, array in pixels.items()}
    begin = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with whole(path) as (temporary,):
        try:
            OpenEXR.File(begin | header, channels).write(str(temporary))
        except RuntimeError as error:  # raised by OpenEXR both for a missing directory and for a full disk
            raise WriteError(f"cannot write {path}: {error}") from error
    return Written((path,))


def _attributes(image: Slice, table: Table) -> dict[str, Any]:
    """Return the header entries that describe the pixels."""
    attributes: dict[str, Any] = {
        "brdf:material": str(table.name),
        "brdf:revision": str(table.revision),
        "brdf:model": table.metadata.model or "",
        "brdf:title": table.metadata.title or "",
        "brdf:quantity": QUANTITY,
        "brdf:unit": UNIT,
        "brdf:dirac": " ".join(specular_remark(table)) or "none",
        "brdf:error_p99": "not measured" if table.error is None else repr(table.error.overall.p99),
        "brdf:slice": image.kind,
        "brdf:description": image.description,
    }
    for letter, axis in (("x", image.x), ("y", image.y)):
        attributes[f"brdf:{letter}_axis"] = axis.name
        attributes[f"brdf:{letter}_unit"] = axis.unit
        attributes[f"brdf:{letter}_direction"] = axis.direction
        attributes[f"brdf:{letter}_first_last"] = np.array([axis.first, axis.last])
    return attributes | {f"brdf:{name}_deg": repr(float(angle)) for name, angle in image.fixed_deg}


def _decimals(wavelength_nm: NDArray[Any]) -> list[str]:
    """Return the shortest decimals that read back as the wavelengths, padded with zeros to one number of places."""
    shortest = [np.format_float_positional(value, trim="0") for value in wavelength_nm.astype(np.float64)]
    places = max(len(text.partition(".")[2]) for text in shortest)
    return [text + "0" * (places - len(text.partition(".")[2])) for text in shortest]


def _spectral_channels(wavelength_nm: NDArray[Any]) -> list[str]:
    """Return channel names such as ``T.550,0nm``; ValueError where two wavelengths would share one.

    OpenEXR sorts channels by name: zeros in front, as in ``T.0950,0nm``, make that the order of wavelengths.
    """
    texts = _decimals(wavelength_nm)
    longest = max(map(len, texts))
    names = [f"T.{text.zfill(longest).replace('.', ',')}nm" for text in texts]
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise ParameterError("wavelength_nm", f"the wavelength of channel {repeated[0]} occurs twice")
    return names


def write_sphere(path: str | os.PathLike[str], table: Table, half: bool = False, verdict: str | None = None) -> Written:
    """Write the lit sphere of a table as an OpenEXR file, ZIP compressed.

    The channels are linear sRGB, in which a white Lambertian sphere has 0.8 where it is brightest, and A, the coverage,
    by which the others are multiplied.
    """
    from brdfdb.scenes.lit_sphere import linear_sphere

    linear = linear_sphere(table, SPHERE_PIXELS)
    linear[..., :3] *= linear[..., 3:]
    linear = np.minimum(linear, HALF_MAX).astype(np.float16 if half else np.float32)
    header = {"brdf:material": str(table.name), "brdf:record": json.dumps(record(table, None, verdict, holds=LIT))}
    return _write(path_of(path), header, {name: linear[..., index] for index, name in enumerate("RGBA")})
