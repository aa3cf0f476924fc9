"""Spectral pictures as colours: XYZ, sRGB under any illuminant, differences in CIEDE2000, PNG and spectral EXR."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.errors import WriteError
from brdfdb.place import path_of
from brdfdb.scenes.scene import Scene
from brdfdb.spectra import colour_science, illuminant_spectrum, srgb_weights, xyz_weights

Array = NDArray[np.float64]


def xyz(scene: Scene, radiance: ArrayLike) -> Array:
    """Return exposed X, Y, Z (..., 3) of spectral radiances (..., L), multiples of the illuminant; white has Y = 1."""
    return np.asarray(scene.exposure * (np.asarray(radiance) @ _weights(scene)))


def srgb(scene: Scene, radiance: ArrayLike) -> Array:
    """Return sRGB (..., 3) in [0, 1] with its transfer curve, for a screen. Radiance brighter than white is clipped.

    The illuminant of the scene is white on the screen, too: Bradford's matrix adapts it to D65.
    """
    return np.asarray(colour_science().cctf_encoding(np.clip(linear_srgb(scene, radiance), 0.0, 1.0), function="sRGB"))


def linear_srgb(scene: Scene, radiance: ArrayLike) -> Array:
    """Return sRGB (..., 3) without its transfer curve, not clipped. White under the scene's illuminant is (1, 1, 1)."""
    weights = srgb_weights(tuple(scene.wavelengths_nm), scene.illuminant, scene.observer)
    return np.asarray(scene.exposure * (np.asarray(radiance) @ weights))


def difference(scene: Scene, radiance: ArrayLike, other: ArrayLike) -> Array:
    """Return the CIEDE2000 difference of two spectral pictures (..., L), pixel by pixel. About 1 is just noticeable.

    White is the scene's illuminant at a radiance of 1 over the exposure. Radiances below 0 count as 0.
    """
    colour = colour_science()
    white = colour.XYZ_to_xy(_weights(scene).sum(axis=0))
    first, second = (colour.XYZ_to_Lab(np.maximum(xyz(scene, picture), 0.0), white) for picture in (radiance, other))
    return np.asarray(colour.delta_E(first, second, method="CIE 2000"))


def write_png(path: str | os.PathLike[str], scene: Scene, radiance: ArrayLike) -> None:
    """Write a picture (height, width, L) as a PNG of 8 bits; OSError if that fails."""
    from matplotlib.image import imsave

    imsave(path_of(path), np.round(255.0 * srgb(scene, radiance)).astype(np.uint8))


def write_exr(path: str | os.PathLike[str], scene: Scene, radiance: ArrayLike) -> None:
    """Write a picture (height, width, L), in multiples of the illuminant of a scene, as an OpenEXR file.

    An existing file is replaced; OSError if the file cannot be written. R, G, B are linear sRGB, exposed, by
    `linear_srgb`. Channels such as ``S0.550,0nm``, the emissive layout of Fichet et al. (2021, ``fichet2021``), are
    spectral radiance: the multiples times the illuminant, which is 1 at 560 nm, not exposed.
    """
    values = np.asarray(radiance)
    rgb = linear_srgb(scene, values)
    spectral = values * illuminant_spectrum(scene.illuminant, scene.wavelengths_nm)
    channels = {name: rgb[..., index] for index, name in enumerate("RGB")}
    decimals = [np.format_float_positional(wavelength, trim="0") for wavelength in scene.wavelengths_nm]
    names = [f"S0.{text.replace('.', ',')}nm" for text in decimals]
    channels |= {name: spectral[..., index] for index, name in enumerate(names)}
    header = {
        "spectralLayoutVersion": "1.0",
        "emissiveUnits": "1 is that of a white Lambertian surface at 560 nm that faces a light of strength 1",
        "brdf:title": scene.title,
        "brdf:illuminant": scene.illuminant,
        "brdf:exposure": repr(scene.exposure),
    }
    write_channels(path, header, channels)


def write_channels(
    path: str | os.PathLike[str], header: dict[str, Any], channels: Mapping[str, NDArray[np.floating[Any]]]
) -> None:
    """Write channels (height, width) as 32 bit floats, ZIP compressed; OSError if that fails."""
    import OpenEXR

    complete = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    # OpenEXR reads a strided array as if it were contiguous, which gives wrong pixels and no error
    arrays = {name: np.ascontiguousarray(array, dtype=np.float32) for name, array in channels.items()}
    try:
        OpenEXR.File(complete, arrays).write(str(path_of(path)))
    except RuntimeError as error:
        raise WriteError(f"cannot write {path}: {error}") from error


def _weights(scene: Scene) -> Array:
    return xyz_weights(tuple(scene.wavelengths_nm), scene.illuminant, scene.observer)
