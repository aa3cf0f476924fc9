"""Directions recorded by a renderer for each pixel: normals, or viewer and lights in the frame of the surface."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from brdfdb.errors import ParameterError
from brdfdb.place import path_of
from brdfdb.scenes.shapes import STRICT, Array

WANTED = "neither `normal`, nor `wr` and `wi`, of shape (height, width, 3)"


class Recorded(BaseModel):
    """A picture of directions in place of a shape. `file` is an EXR or .npz.

    The file holds one of two sets of vectors. The first is ``normal`` and, if the material is anisotropic, ``tangent``,
    in the frame of the scene. The second is ``wr`` and ``wi``, towards the viewer and towards each light of the scene
    in the frame of the surface (x the tangent, z the normal), for lights without a solid angle. An .npz has arrays of
    shape (height, width, 3), and ``wi`` of shape (lights, height, width, 3). An EXR has channels such as ``normal.X``,
    ``normal.Y`` and ``normal.Z``, and ``wi0.X``, ``wi1.X`` and so on for lights. Pixels where a vector is 0 or not
    finite show nothing. Nothing casts a shadow.
    """

    model_config = STRICT

    kind: Literal["recorded"]
    file: Annotated[str, Field(min_length=1)]

    def resolved(self, folder: Path) -> Recorded:
        """Return the shape with its file named relative to a folder."""
        return self.model_copy(update={"file": str(folder / path_of(self.file, "file"))})

    def read(self) -> dict[str, Array]:
        """Return the arrays of the file, float64, by name; ``wi`` with its axis of lights.

        Raises
        ------
        ParameterError
            If the file does not exist, is not readable, or holds no directions.
        """
        path = path_of(self.file, "file")
        if not path.is_file():
            raise ParameterError(str(path), "there is no such file")
        arrays = _from_exr(path) if path.suffix == ".exr" else _from_npz(path)
        if "normal" not in arrays and not {"wr", "wi"} <= arrays.keys():
            raise ParameterError(str(path), f"has {WANTED}; it has {', '.join(arrays) or 'no vectors'}")
        first = "normal" if "normal" in arrays else "wr"
        pixels = arrays[first].shape[:2]
        for name, array in arrays.items():
            lights = array.shape[:1] if name == "wi" else ()
            if array.shape != (*lights, *pixels, 3):
                wanted = "(lights, height, width, 3)" if name == "wi" else "(height, width, 3)"
                sentence = f"{name} has the shape {array.shape}, which is not that of a picture of vectors, {wanted}"
                if name != first:
                    sentence += f", of as many pixels as {first} has, {pixels}"
                raise ParameterError(str(path), sentence, array.shape)
        return arrays


def _from_npz(path: Path) -> dict[str, Array]:
    try:
        with np.load(path) as file:
            arrays = {name: file[name] for name in ("normal", "tangent", "wr", "wi") if name in file}
    except (ValueError, TypeError, EOFError, zipfile.BadZipFile, zlib.error):
        raise ParameterError(str(path), "is no .npz of numbers, or a damaged one") from None
    if any(array.dtype.kind not in "iuf" for array in arrays.values()):
        raise ParameterError(str(path), f"has {WANTED}: what has these names is not made of numbers")
    return {name: array.astype(np.float64) for name, array in arrays.items()}


def _from_exr(path: Path) -> dict[str, Array]:
    import OpenEXR

    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels: dict[str, NDArray[np.floating]] = {name: c.pixels for name, c in file.channels().items()}
    except RuntimeError:
        raise ParameterError(str(path), "is no OpenEXR file, or a damaged one") from None
    arrays = {name: vector for name in ("normal", "tangent", "wr") if (vector := _vector(channels, name)) is not None}
    lights: list[Array] = []
    while (light := _vector(channels, f"wi{len(lights)}")) is not None:
        lights.append(light)
    return {**arrays, "wi": np.stack(lights)} if lights else arrays


def _vector(channels: Mapping[str, NDArray[np.floating]], name: str) -> Array | None:
    names = [f"{name}.{axis}" for axis in "XYZ"]
    if not all(channel in channels for channel in names):
        return None
    return np.stack([channels[channel] for channel in names], axis=-1).astype(np.float64)
