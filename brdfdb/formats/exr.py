"""EXR slices of a table: the half/difference image, the plane of incidence and the lobe over the hemisphere."""

from __future__ import annotations

import contextlib
import os
import uuid
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from brdfdb import geometry, spectra
from brdfdb.errors import ParameterError, WriteError

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

QUANTITY = "f_r"
UNIT = "1/sr"
HALF_MAX = 65504.0
LOBE_SIZE = 256

RGB_COLOUR = "linear sRGB, D65"
RGB_GREY = "grey: colour was not measured"
RGB_MEAN = "grey: colour was not measured, mean over the wavelengths"

LEFT_TO_RIGHT = "left to right"
BOTTOM_TO_TOP = "bottom to top"


@dataclass(frozen=True)
class Axis:
    """One axis of a slice: `first` and `last` are the pixel centres where `direction` starts and where it ends."""

    name: str
    first: float
    last: float
    direction: str
    unit: str = "degree"


@dataclass(frozen=True, eq=False)
class Slice:
    """A picture of a table: f_r [1/sr] over two angles, row 0 at the top as in an image file.

    Attributes
    ----------
    kind : str
        "half_difference", "in_plane" or "lobe".
    description : str
        How to read the picture, in words.
    x, y : Axis
        What the columns and the rows are.
    fixed_deg : tuple of (str, float)
        The angles that are the same in every pixel, by name [degrees].
    values : float32 array, shape (H, W) or (H, W, L) [1/sr]
        Without and with a wavelength axis.
    wavelength_nm : float array, shape (L,), or None
        The wavelengths of the last axis of `values` [nm].

    Raises
    ------
    ValueError
        If the shape of `values` does not fit `wavelength_nm`.
    """

    kind: str
    description: str
    x: Axis
    y: Axis
    fixed_deg: tuple[tuple[str, float], ...]
    values: NDArray[np.float32]
    wavelength_nm: NDArray[Any] | None

    def __post_init__(self) -> None:
        spectral = () if self.wavelength_nm is None else self.wavelength_nm.shape
        if self.values.ndim < 2 or self.values.shape[2:] != spectral:
            raise ParameterError(
                "values", f"shape {self.values.shape} is not (height, width, *{spectral})", self.values.shape
            )


def half_difference_slice(table: Table, *, phi_h_deg: float = 0.0, phi_d_deg: float = 90.0) -> Slice:
    """The image slice of a table: theta_h to the right, theta_d upwards, one pixel a degree.

    Parameters
    ----------
    table : Table
        What is sliced.
    phi_h_deg : float [degree]
        Azimuth of the half vector; matters for anisotropic tables only.
    phi_d_deg : float [degree]
        Azimuth of the light about the half vector. At 90 degrees, the usual choice for pictures of measured
        materials, light and viewer are equally far from the normal and no pixel is below the horizon.

    Returns
    -------
    Slice
        Shape (90, 90) or (90, 90, L) [1/sr]; 0 where light or viewer is below the horizon. Column x is
        theta_h = x + 0.5 degrees, row y is theta_d = 89.5 - y degrees: the specular lobe is on the left edge, grazing
        incidence along the top, retroreflection along the bottom.
    """
    theta_h_deg = np.arange(90) + 0.5
    theta_d_deg = theta_h_deg[::-1, np.newaxis]
    directions = geometry.directions_from_half_difference(
        *(geometry.radians(angle) for angle in (theta_h_deg, phi_h_deg, theta_d_deg, phi_d_deg))
    )
    return Slice(
        kind="half_difference",
        description="specular lobe on the left edge, grazing incidence at the top, retroreflection at the bottom",
        x=Axis("theta_h", 0.5, 89.5, LEFT_TO_RIGHT),
        y=Axis("theta_d", 0.5, 89.5, BOTTOM_TO_TOP),
        fixed_deg=(("phi_h", phi_h_deg), ("phi_d", phi_d_deg)),
        values=np.asarray(table.lookup(*directions), dtype=np.float32),
        wavelength_nm=table.wavelength_nm,
    )


def in_plane_slice(table: Table, *, phi_i_deg: float = 0.0) -> Slice:
    """The plane of incidence: theta_r with a sign to the right, theta_i upwards, one pixel a degree.

    Parameters
    ----------
    table : Table
        What is sliced.
    phi_i_deg : float [degree]
        Azimuth of the light; matters for anisotropic tables only.

    Returns
    -------
    Slice
        Shape (90, 180) or (90, 180, L) [1/sr]. Column x is theta_r = x - 89.5 degrees, positive on the mirror side
        (phi_r = phi_i + 180 degrees) and negative back towards the light (phi_r = phi_i); row y is
        theta_i = 89.5 - y degrees. The mirror direction is the diagonal from the middle of the bottom edge to the top
        right corner, retroreflection the one to the top left corner.
    """
    signed_deg = np.arange(180) - 89.5
    theta_i_deg = np.arange(90)[::-1, np.newaxis] + 0.5
    phi_r_deg = phi_i_deg + np.where(signed_deg > 0.0, 180.0, 0.0)
    directions = (geometry.radians(angle) for angle in (theta_i_deg, phi_i_deg, np.abs(signed_deg), phi_r_deg))
    return Slice(
        kind="in_plane",
        description="theta_r is positive on the mirror side and negative back towards the light",
        x=Axis("signed theta_r", -89.5, 89.5, LEFT_TO_RIGHT),
        y=Axis("theta_i", 0.5, 89.5, BOTTOM_TO_TOP),
        fixed_deg=(("phi_i", phi_i_deg),),
        values=np.asarray(table.lookup(*directions), dtype=np.float32),
        wavelength_nm=table.wavelength_nm,
    )


def lobe_map(table: Table, *, theta_i_deg: float = 45.0, phi_i_deg: float = 0.0) -> Slice:
    """The hemisphere of viewing directions for one light, as a disc whose radius is theta_r.

    Parameters
    ----------
    table : Table
        What is sliced.
    theta_i_deg : float [degree]
        Polar angle of the light, 0 to 90.
    phi_i_deg : float [degree]
        Azimuth of the light; matters for anisotropic tables only.

    Returns
    -------
    Slice
        Shape (256, 256) or (256, 256, L) [1/sr], 0 outside the disc. The surface is seen from above and turned so that
        the light comes from the left: the point (x, y) degrees from the centre, x to the right and y upwards, is
        x = -theta_r cos(phi_r - phi_i), y = -theta_r sin(phi_r - phi_i). Retroreflection is thus theta_i to the left
        of the centre, the mirror direction theta_i to the right, and phi_r grows counter-clockwise.

    Raises
    ------
    ValueError
        If `theta_i_deg` is outside [0, 90].
    """
    if not 0.0 <= theta_i_deg <= 90.0:
        raise ParameterError("theta_i_deg", f"{theta_i_deg:g} is outside [0, 90] degrees", theta_i_deg, (0.0, 90.0))
    pitch = 180.0 / LOBE_SIZE
    x_deg = (np.arange(LOBE_SIZE) + 0.5) * pitch - 90.0
    y_deg = x_deg[::-1, np.newaxis]
    # the corners reach theta_r = 127 degrees: below the horizon, where a table is 0
    theta_r_deg = np.hypot(x_deg, y_deg)
    phi_r_deg = phi_i_deg + geometry.degrees(np.arctan2(-y_deg, -x_deg))
    directions = (geometry.radians(angle) for angle in (theta_i_deg, phi_i_deg, theta_r_deg, phi_r_deg))
    edge = 90.0 - 0.5 * pitch
    return Slice(
        kind="lobe",
        description="radius = theta_r, seen from above, light from the left, mirror direction on the right",
        x=Axis("-theta_r cos(phi_r - phi_i)", -edge, edge, LEFT_TO_RIGHT),
        y=Axis("-theta_r sin(phi_r - phi_i)", -edge, edge, BOTTOM_TO_TOP),
        fixed_deg=(("theta_i", theta_i_deg), ("phi_i", phi_i_deg)),
        values=np.asarray(table.lookup(*directions), dtype=np.float32),
        wavelength_nm=table.wavelength_nm,
    )


def export(table: Table, directory: str | os.PathLike[str], *, half: bool = False) -> list[Path]:
    """Write the three slices of a table into a directory, which is created where it is missing.

    Parameters
    ----------
    table : Table
        What is written.
    directory : path
        Receives NAME_half_difference.exr, NAME_in_plane.exr and NAME_lobe.exr; files of that name are replaced.
    half : bool
        16 bit floats to look at instead of 32 bit floats to compute with.

    Returns
    -------
    list of Path
        The three files, in that order.

    Raises
    ------
    OSError
        If the directory or a file cannot be written.
    """
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for image in (half_difference_slice(table), in_plane_slice(table), lobe_map(table)):
        path = folder / f"{table.name}_{image.kind}.exr"
        write(path, image, table, half=half)
        paths.append(path)
    return paths


def _dirac(specular: NDArray[np.float32]) -> str:
    """What an image leaves out of a table with a Dirac part."""
    return f"not in this image: up to {specular.max():.4g} of the light leaves in the exact mirror direction"


def write(path: str | os.PathLike[str], image: Slice, table: Table, half: bool = False) -> None:
    """Write a slice as an OpenEXR file, ZIP compressed: whole, or not at all.

    Parameters
    ----------
    path : path
        The file; one that is there is replaced.
    image : Slice
        The pixels and what their axes are.
    table : Table
        What the slice was taken from: its name, revision and model go into the header.
    half : bool
        16 bit floats to look at instead of 32 bit floats to compute with. A value past 65504, the largest of them, is
        written as 65504, and the attribute ``brdf:half`` counts these.

    Raises
    ------
    OSError
        If the file cannot be written.
    ValueError
        If two wavelengths are equal.

    Notes
    -----
    Channels: R, G, B for viewers, and one a wavelength in the reflective layout of Fichet et al. (2021,
    ``fichet2021``), ``T.550,0nm``. The pixels are f_r itself [1/sr], which can exceed 1; the Dirac part of a
    mirror-like material is no part of f_r and not in the file. R, G, B are linear sRGB under D65 where the wavelengths
    cover the visible range, else all three are the value, averaged over the wavelengths.

    The attributes begin with ``brdf:``. Angles and wavelengths are strings, as OpenEXR rounds a number to 32 bits; the
    pixel centres are a pair of 64 bit floats. ``brdf:error_p99`` is the relative error against the model that 99 of
    100 values of the table stay within, as the table states it.
    """
    path = Path(path)
    rgb, rgb_meaning = _rgb(image)
    pixels = {name: rgb[..., index] for index, name in enumerate("RGB")}
    header: dict[str, Any] = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    header |= _attributes(image, table)
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

    # OpenEXR reads a strided array as if it were contiguous: wrong pixels and no error.
    channels = {name: np.ascontiguousarray(array) for name, array in pixels.items()}
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    try:
        OpenEXR.File(header, channels).write(str(temporary))
        os.replace(temporary, path)
    except RuntimeError as error:  # what OpenEXR raises for a missing directory and for a full disk alike
        raise WriteError(f"cannot write {path}: {error}") from error
    finally:
        with contextlib.suppress(OSError):  # there only after a failure
            temporary.unlink()


def _rgb(image: Slice) -> tuple[NDArray[np.float32], str]:
    """R, G, B of a slice, shape (H, W, 3), and what they are."""
    if image.wavelength_nm is None:
        grey, meaning = image.values, RGB_GREY
    elif spectra.covers_visible(image.wavelength_nm):
        return np.asarray(spectra.linear_srgb(image.wavelength_nm, image.values), dtype=np.float32), RGB_COLOUR
    else:
        grey, meaning = image.values.mean(axis=-1, dtype=np.float64).astype(np.float32), RGB_MEAN
    return np.repeat(grey[..., np.newaxis], 3, axis=-1), meaning


def _attributes(image: Slice, table: Table) -> dict[str, Any]:
    """The header entries that say what the pixels are."""
    attributes: dict[str, Any] = {
        "brdf:material": str(table.name),
        "brdf:revision": str(table.revision),
        "brdf:model": table.metadata.model or "",
        "brdf:title": table.metadata.title or "",
        "brdf:quantity": QUANTITY,
        "brdf:unit": UNIT,
        "brdf:dirac": "none" if table.specular is None else _dirac(table.specular),
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
    """The shortest decimals that read back as the wavelengths, padded with zeros to one number of places."""
    shortest = [np.format_float_positional(value, trim="0") for value in wavelength_nm.astype(np.float64)]
    places = max(len(text.partition(".")[2]) for text in shortest)
    return [text + "0" * (places - len(text.partition(".")[2])) for text in shortest]


def _spectral_channels(wavelength_nm: NDArray[Any]) -> list[str]:
    """Channel names such as ``T.550,0nm``; ValueError where two wavelengths would share one."""
    names = [f"T.{text.replace('.', ',')}nm" for text in _decimals(wavelength_nm)]
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise ParameterError("wavelength_nm", f"the wavelength of channel {repeated[0]} occurs twice")
    return names
