"""Environments: radiance over the sphere, and directions towards it drawn where a material reflects."""

from __future__ import annotations

import functools
import zipfile
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, field_validator, model_validator

from brdfdb.errors import ParameterError
from brdfdb.integrals.sampling import DIFFUSE, directions, mixture_density
from brdfdb.lobes import Lobe
from brdfdb.materials import Source
from brdfdb.place import path_of
from brdfdb.scenes.shapes import STRICT, Array
from brdfdb.tables.table import TableSource

# Least share of directions that follow a lobe: with fewer, a few directions would carry all of a faint gloss
_LEAST = 0.25
# Largest share of them, which bounds f_r cos / pdf in the tails, also for other forms at the same directions
_MOST = 0.9
_TURN = (np.sqrt(5.0) - 1.0) / 2.0  # the golden section
_LUMINANCE = {"R": 0.2126, "G": 0.7152, "B": 0.0722}  # luminance of the primaries of linear sRGB


class Environment(BaseModel):
    """Radiance from far away in every direction, in multiples of the scene's illuminant, without a colour of its own.

    Rows of numbers, all equally long, are a picture in latitude and longitude, seen from inside. The first row is
    around the zenith (+z), and the last around the nadir. The azimuth falls from 180 degrees on the left to -180
    degrees on the right: the middle of the picture is towards +x, its left quarter towards +y, and both edges towards
    -x. A number is the radiance at the middle of its pixel. Interpolation is bilinear, also across both edges. It is
    constant from the middles of the first and the last row to the poles.

    `file`, in place of rows, is an EXR (its channel ``Y``, or else the luminance of ``R``, ``G``, ``B``), an .npz with
    an array ``radiance``, or a .npy. The environment is dark where an object stands in its light, because the light of
    that object is not traced. The lights of the scene are not in the picture, or they would count twice.
    """

    model_config = STRICT

    rows: list[list[float]] | None = Field(default=None, description="from the zenith to the nadir")
    file: str | None = Field(default=None, min_length=1, description="EXR, .npz or .npy, in the directory of the scene")
    samples: int = Field(
        default=32, ge=1, le=4096, description="directions for each point, drawn from its lobe or table"
    )
    seed: int = Field(default=0, ge=0, description="seed of the random turns of these directions from point to point")

    @field_validator("rows")
    @classmethod
    def _check_rows(cls, rows: list[list[float]] | None) -> list[list[float]] | None:
        if rows is not None:
            if not rows or not rows[0] or any(len(row) != len(rows[0]) for row in rows):
                raise ParameterError("rows", "must be lists of numbers of equal length")
            _checked("rows", np.array(rows, dtype=np.float64))
        return rows

    @model_validator(mode="after")
    def _check(self) -> Environment:
        if (self.rows is None) == (self.file is None):
            raise ParameterError("rows, file", "give one of the two")
        return self

    def resolved(self, folder: Path) -> Environment:
        """Return the environment with its file, if it has one, named relative to a folder."""
        if self.file is None:
            return self
        return self.model_copy(update={"file": str(folder / path_of(self.file, "environment.file"))})

    @property
    def picture(self) -> Array:
        """The radiance (rows, columns), in multiples of the illuminant.

        ParameterError if the file does not exist, is not readable, or holds no picture, or if radiance is negative, not
        finite, or nowhere above 0.
        """
        if self.file is None:
            return np.array(self.rows, dtype=np.float64)
        path = path_of(self.file, "environment.file")
        if not path.is_file():
            raise ParameterError("environment.file", f"{path}: there is no such file")
        return _read(path, path.stat().st_mtime_ns)

    def radiance(self, towards: Array) -> Array:
        """Return the radiance that comes from directions (..., 3), unit vectors in the frame of the scene."""
        picture = self.picture
        rows, columns = picture.shape
        theta = np.arccos(np.clip(towards[..., 2], -1.0, 1.0))
        row = np.clip(theta / np.pi * rows - 0.5, 0.0, rows - 1.0)
        column = (0.5 - np.arctan2(towards[..., 1], towards[..., 0]) / (2.0 * np.pi)) * columns - 0.5
        upper, left = np.floor(row).astype(np.int64), np.floor(column).astype(np.int64)
        down, right = row - upper, column - left
        lower = np.minimum(upper + 1, rows - 1)

        def along(at: NDArray[np.int64]) -> Array:
            return np.asarray((1.0 - right) * picture[at, left % columns] + right * picture[at, (left + 1) % columns])

        return np.asarray((1.0 - down) * along(upper) + down * along(lower))

    def drawn(self, source: Source, wavelength_nm: Array, wr: Array, stream: tuple[int, ...]) -> DrawnDirections:
        """Draw `samples` directions for each point of a source, the same in every call.

        `wr` (N, 3) are unit vectors towards the viewer in the frame of the surface, `stream` numbers that identify the
        points: the turns of other points are independent. Directions of a table follow its own sampler, as in
        `Table.sample`, unless its f_r hardly varies. The sampler finds peaks that no lobe states. For other sources,
        the lobe around the mirror direction of the viewer equals that of the light by reciprocity, at the wavelength
        where it is widest. Half vectors follow eq. (7) of Ward 1992 (``ward1992``), with its misprint corrected and
        weights in place of "uniformly weighted" samples.
        """
        turns = np.random.default_rng([self.seed, *stream]).random((2, 1, len(wr)))
        number = np.arange(self.samples)[:, np.newaxis]
        # The numbers are even over the unit square for any number of samples. Random turns make points independent
        u1 = (number / self.samples + turns[0]) % 1.0
        u2 = (number * _TURN + turns[1]) % 1.0
        sampler = source.sampler if isinstance(source, TableSource) else None
        if sampler is not None:
            wi = sampler.draw(u1, u2, wr)
            density = sampler.density(wr, wi)
        else:
            lobe = widest_lobe(source.lobe(wr[:, np.newaxis, 2], source.evaluated_at(wavelength_nm)), len(wr))
            wi = directions(lobe, u1, u2, wr)
            density = mixture_density(lobe, wr, wi)
        solid_angle = np.divide(1.0, self.samples * density, where=wi[..., 2] > 0.0, out=np.zeros(density.shape))
        return DrawnDirections(wi, solid_angle)


class DrawnDirections(NamedTuple):
    """Unit vectors (samples, N, 3) in the frame of the surface, and their solid angles (samples, N) [sr].

    The sum over samples of f_r times radiance times cosine times solid angle is an unbiased estimate of the reflected
    radiance. Solid angles are 0 below the horizon.
    """

    wi: Array
    solid_angle: Array


def widest_lobe(lobe: Lobe | None, count: int) -> Lobe:
    """Return a lobe of shape (count,), no narrower than that of any wavelength.

    `lobe` is that of a source around the mirror directions of viewers, (count, 1) or (count, wavelengths); None for a
    diffuse source.
    """
    share, alpha_x, alpha_y = (
        np.broadcast_to(value, np.broadcast_shapes(np.shape(value), (count, 1))) for value in (lobe or DIFFUSE)[:3]
    )
    mean = share.mean(axis=1)
    share = np.where(mean > 0.0, np.clip(mean, _LEAST, _MOST), 0.0)
    return (lobe or DIFFUSE)._replace(share=share, alpha_x=alpha_x.max(axis=1), alpha_y=alpha_y.max(axis=1))


def _checked(name: str, picture: Array) -> Array:
    bad = ~(np.isfinite(picture) & (picture >= 0.0))
    if np.any(bad):
        row, column = np.argwhere(bad)[0]
        value = picture[row, column]
        text = f"{value:g} at row {row}, column {column} must be finite and not below 0"
        raise ParameterError(name, text, float(value))
    if not np.any(picture):
        raise ParameterError(name, "radiance is 0 everywhere")
    return picture


@functools.lru_cache(maxsize=4)
def _read(path: Path, _written: int) -> Array:
    """Return the picture of a file. It stays in memory until the file changes, because all lists of points use it."""
    picture = _from_exr(path) if path.suffix == ".exr" else _from_numpy(path)
    if picture.ndim != 2 or picture.dtype.kind not in "iuf" or not picture.size:
        raise ParameterError("environment.file", f"{path}: must hold numbers of shape (rows, columns)")
    return _checked(f"environment.file: {path}", picture.astype(np.float64))


def _from_numpy(path: Path) -> NDArray[np.generic]:
    try:
        arrays = np.load(path)
        if isinstance(arrays, np.ndarray):
            return arrays
        with arrays:
            if "radiance" in arrays:
                return np.asarray(arrays["radiance"])
    except (ValueError, EOFError, zipfile.BadZipFile, zlib.error):
        text = f"{path}: is not an .npz or .npy file of numbers, or is damaged"
        raise ParameterError("environment.file", text) from None
    raise ParameterError("environment.file", f"{path}: has no array `radiance`")


def _from_exr(path: Path) -> NDArray[np.generic]:
    import OpenEXR

    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: np.asarray(channel.pixels, dtype=np.float64) for name, channel in file.channels().items()}
    except RuntimeError:
        raise ParameterError("environment.file", f"{path}: is not an OpenEXR file, or is damaged") from None
    if "Y" in channels:
        return channels["Y"]
    if channels.keys() >= _LUMINANCE.keys():
        return np.asarray(sum(weight * channels[name] for name, weight in _LUMINANCE.items()))
    text = f"{path}: has neither a channel Y nor R, G, B; it has {', '.join(channels)}"
    raise ParameterError("environment.file", text)
