"""Pictures of materials: a sphere of each under the same light, at the same exposure."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from brdfdb.errors import ParameterError
from brdfdb.figure import png_of
from brdfdb.geometry import radians, spherical_angles, unit_vector
from brdfdb.integrals.sampling import directions, mixture_density
from brdfdb.materials import FunctionRecord, Source
from brdfdb.parameters import Floats
from brdfdb.refractive_indices import refractive_index
from brdfdb.scenes.environment import widest_lobe
from brdfdb.spectra import PICTURE_NM, colour_science, picture_wavelengths, srgb_weights
from brdfdb.tables.table_base import BaseTable

Array = NDArray[np.float64]

# Radiance [1] that comes from directions (..., 3): x to the right, y upwards, z towards the viewer
Light = Callable[[Array], Array]

SIZE = 160  # usual pixels across a picture
MOST_SIZE = 2048  # most pixels across a picture
WHITE = 0.8  # linear value of a white Lambertian sphere where it is brightest
_LAST_DEG = 89.0  # largest angle to the viewer of normals at which reflected light is computed
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
# Table of the light, about half a degree apart
_ROWS = 385
_COLUMNS = 768  # a multiple of the azimuths
_COARSE = 8  # every eighth row and column is blurred
# Standard deviations of the blurred light, and the radius of a sample from which each is used
_BLURS_DEG = np.array([3.5, 7.0])
_BLURS_FROM = radians(np.array([1.2, 2.4]))
_TABULATION = threading.Lock()  # one thread makes the table in 0.4 s; others that need it wait
_KEPT_SIZE = 512  # largest picture [pixels across] whose weights stay in memory: 30 MB
_BLOCK_SIZE = 2**17  # directions of light, or points of pixels, of a block: its arrays stay in the cache


class _Softbox(NamedTuple):
    """A rectangle of light far away.

    `centre` is the direction of its middle, `width` and `height` are the tangents of half of its angles, `edge` is the
    part of these over which its radiance falls to 0, and `radiance` is that of its middle.
    """

    centre: tuple[float, float, float]
    width: float
    height: float
    edge: float
    radiance: float


# In the frame of the picture: x to the right, y upwards, z towards the viewer
_KEY = _Softbox((-0.58, 0.64, 0.50), 0.46, 0.46, 0.30, 11.0)
_STRIP = _Softbox((0.92, 0.10, 0.10), 0.16, 0.80, 0.50, 3.5)
# Radiance above, at the horizon, and below
_SKY = 0.48
_HORIZON = 0.24
_FLOOR = 0.05


def studio(towards: Array) -> Array:
    """Return the radiance [1] that comes from directions (..., 3) in the frame of the picture.

    The unit is arbitrary; `brdfdb.scenes.lit_sphere` exposes it. x points to the right, y upwards and z towards the
    viewer.
    """
    up = towards[..., 1]
    above = _HORIZON + (_SKY - _HORIZON) * _smooth(up)
    sky = _FLOOR + (above - _FLOOR) * _smooth((up + 0.25) / 0.35)
    return np.asarray(sky + _seen(_KEY, towards) + _seen(_STRIP, towards))


def _seen(light: _Softbox, towards: Array) -> Array:
    """Return the radiance [1] of one light in directions."""
    axis = np.array(light.centre) / np.linalg.norm(light.centre)
    right = np.cross((0.0, 1.0, 0.0), axis)
    right /= np.linalg.norm(right)
    forward = towards @ axis
    depth = np.maximum(forward, 1e-6)
    x = np.abs(towards @ right) / depth
    y = np.abs(towards @ np.cross(axis, right)) / depth
    inside = _smooth((1.0 - x / light.width) / light.edge) * _smooth((1.0 - y / light.height) / light.edge)
    return np.asarray(np.where(forward > 0.0, light.radiance * inside, 0.0))


def _smooth(x: Array) -> Array:
    """Return the smooth step from 0 at x = 0 to 1 at x = 1."""
    t = np.clip(x, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


class Detail(NamedTuple):
    """The numbers that decide between the quality of a picture and the time that it takes."""

    thetas: int  # normals at which reflected light is computed: angles to the viewer
    phis: int  # azimuths of these normals, a multiple of 4
    samples: int  # directions of light for each normal, a multiple of 4
    samples_anisotropic: int  # the same for anisotropic surfaces, which have many more normals
    across: int  # points across each pixel, and down; with one, the edge is smoothed by the distance to it


FINE = Detail(72, 96, 768, 256, 3)
DRAFT = Detail(24, 32, 128, 64, 1)  # for pictures that follow a slider: a tenth of the time


def lit_sphere(surface: Source | BaseTable, size: int = SIZE, light: Light = studio, detail: Detail = FINE) -> Array:
    """Return a picture of a sphere in sRGB (size, size, 4) in [0, 1], with its coverage as the last channel.

    Parameters
    ----------
    surface : Source or BaseTable
        A material, a function or a table. Of a table the picture shows the lookups.
    size : int
        Pixels across and down, up to 2048. The sphere fills the picture.
    light : callable
        ``light(towards)`` gives the radiance [1] from directions (..., 3). The default is `studio`.
    detail : Detail
        `FINE`, or `DRAFT` for a picture in a hurry.

    Returns
    -------
    array (size, size, 4) [1]
        Red, green, blue and coverage. A white Lambertian sphere has 0.8 of the screen's white, without the transfer
        curve, where it is brightest. Radiance brighter than white is clipped.

    Raises
    ------
    ParameterError
        If `size` is out of range.

    Notes
    -----
    The viewer is far away. The reflected light is the integral of f_r L cos theta_i over the hemisphere, by
    importance sampling with the lobe of the source and the same pairs of numbers for each normal. Thus there is no
    noise, and a small smooth error. It is computed on a grid of normals and interpolated. The specular part shows the
    light in the mirror direction of each point, exactly. There is one reflection and no shadow. The grain of
    an anisotropic material (its x axis) runs around the vertical axis of the sphere, as in scenes.

    A spectrum is summed from 420 to 680 nm under D65, in steps of 20 nm. A table with wider steps is interpolated
    between its wavelengths, as by any lookup. A table whose wavelengths do not reach from 420 to 680 nm is grey, at the
    first of them.
    """
    linear = linear_sphere(surface, size, light, detail)
    encoded = colour_science().cctf_encoding(np.clip(linear[..., :3], 0.0, 1.0), function="sRGB")
    return np.concatenate([encoded, linear[..., 3:]], axis=-1)


def sphere_png(surface: Source | BaseTable, size: int = SIZE, detail: Detail = FINE) -> bytes:
    """Return the picture of `lit_sphere` as a PNG file of 8 bits with transparent corners."""
    pixels = np.rint(255.0 * lit_sphere(surface, size, detail=detail)).astype(np.uint8)
    return png_of(pixels, level=1)


def thumbnail_png(table: BaseTable, size: int) -> bytes:
    """Return the bytes of a small draft as by `sphere_png`; the last one stays in memory with its table."""
    kept_size, picture = _THUMBNAILS.get(table, (0, b""))
    if kept_size != size:
        picture = sphere_png(table, size, DRAFT)
        _THUMBNAILS[table] = size, picture
    return picture


_THUMBNAILS: WeakKeyDictionary[BaseTable, tuple[int, bytes]] = WeakKeyDictionary()


def prepare() -> None:
    """Load what all pictures share, in two seconds: colours, the table of a studio's light, refractive indices."""
    srgb_weights(tuple(PICTURE_NM.tolist()))
    _tabulated(studio)
    refractive_index("main/Al/Rakic", 550.0)


def linear_sphere(surface: Source | BaseTable, size: int = SIZE, light: Light = studio, detail: Detail = FINE) -> Array:
    """Return the picture of `lit_sphere` in linear sRGB (size, size, 4), not clipped, with its coverage at the end."""
    if not 1 <= size <= MOST_SIZE:
        raise ParameterError("size", f"{size} is not a number of pixels from 1 to {MOST_SIZE}", size, (1, MOST_SIZE))
    pixels = (_kept_pixels if size <= _KEPT_SIZE else _pixels)(size, light, detail)
    total = _radiance(surface, pixels.weights, light, detail).reshape(size, size, 3)
    linear = WHITE / _tabulated(light).brightest * total / np.maximum(pixels.coverage, 1e-9)[..., np.newaxis]
    return np.concatenate([linear, pixels.coverage[..., np.newaxis]], axis=-1)


def sphere_radiance(
    surface: Source | BaseTable, theta: Array, phi: Array, light: Light, detail: Detail = FINE
) -> Array:
    """Return the radiance (..., 3) in linear sRGB of points of a sphere, in the unit of the light.

    `theta` [rad] is the angle between the normal and the viewer, in [0, pi/2]. `phi` [rad] is the azimuth of the normal
    in the picture, counter-clockwise from the right.
    """
    theta, phi = np.broadcast_arrays(theta, phi)
    weights = _weights_at(theta.ravel(), phi.ravel(), light, detail)
    return _radiance(surface, weights, light, detail).reshape(*theta.shape, 3)


class _Weights(NamedTuple):
    """Matrices that make the radiance of N points, or pixels, of what the grid of normals reflects.

    `normals` (N, thetas phis) multiplies the light that is reflected at the normals of the grid, `mirrors` (N, thetas)
    the specular reflectance at its angles to the viewer.
    """

    normals: csr_array
    mirrors: csr_array


def _weights_at(theta: Array, phi: Array, light: Light, detail: Detail) -> _Weights:
    """Return the weights of points (N,), linear between the normals of the grid."""
    turn = phi / (2.0 * np.pi)
    down = np.minimum(theta / radians(_LAST_DEG), 1.0) * (detail.thetas - 1)
    places = np.stack([2.0 * theta / np.pi * (_ROWS - 1), turn * _COLUMNS])
    mirrored = _between(_ROWS, _COLUMNS, places) @ _tabulated(light).sharp.ravel()
    along = _between(detail.thetas, 1, np.stack([down, np.zeros(down.shape)]))
    return _Weights(
        _between(detail.thetas, detail.phis, np.stack([down, turn * detail.phis])),
        csr_array(along.multiply(mirrored[:, np.newaxis])),
    )


def _radiance(surface: Source | BaseTable, weights: _Weights, light: Light, detail: Detail) -> Array:
    """Return the radiance (N, 3) of a surface at points, or of pixels."""
    shown = _shown(surface)
    nodes = radians(np.linspace(0.0, _LAST_DEG, detail.thetas))
    sky = _tabulated(light)
    lights = len(nodes) * detail.phis * detail.samples_anisotropic
    blocks = np.array_split(nodes, max(lights // _BLOCK_SIZE, 1) if shown.surface.anisotropic else 1)
    grid = np.concatenate([_reflected(shown, block, sky, detail) for block in blocks])
    values = weights.normals @ grid.reshape(detail.thetas * detail.phis, -1)
    mirror = shown.specular(nodes)
    if np.any(mirror):
        values = values + weights.mirrors @ mirror
    return np.broadcast_to(values, (len(values), 3))


class _Pixels(NamedTuple):
    """The pixels of a picture: the weights of each, times its coverage, and the coverage (size, size)."""

    weights: _Weights
    coverage: Array


def _pixels(size: int, light: Light, detail: Detail) -> _Pixels:
    """Return the pixels of a picture, which all surfaces share."""
    across = detail.across
    fine = (np.arange(size * across) + 0.5) / across - size / 2.0
    normals, mirrors, coverage = [], [], []
    for y in np.array_split(-fine.reshape(size, across), -(-fine.size * fine.size // _BLOCK_SIZE)):
        radius = np.hypot(fine, y.reshape(-1, 1)) / (size / 2.0)
        covered = np.clip((1.0 - radius) * size / 2.0 + 0.5, 0.0, 1.0) if across == 1 else (radius <= 1.0).astype(float)
        coverage.append(covered.reshape(len(y), across, size, across).mean(axis=(1, 3)))
        seen = covered > 0.0
        theta = np.arcsin(np.minimum(radius[seen], 1.0))
        phi = np.arctan2(y.reshape(-1, 1), fine)[seen]
        weights = _weights_at(theta, phi, light, detail)
        pixel = np.arange(coverage[-1].size).reshape(len(y), 1, size, 1)
        pixel = np.broadcast_to(pixel, (len(y), across, size, across)).reshape(seen.shape)[seen]
        at = pixel, np.arange(len(pixel))
        mean = csr_array((covered[seen] / across**2, at), shape=(coverage[-1].size, len(pixel)))
        normals.append(mean @ weights.normals)
        mirrors.append(mean @ weights.mirrors)
    return _Pixels(_Weights(csr_array(vstack(normals)), csr_array(vstack(mirrors))), np.concatenate(coverage))


_kept_pixels = functools.lru_cache(maxsize=4)(_pixels)


class _Shown(NamedTuple):
    """A surface as a picture shows it: with weights (L, 3) of its wavelengths for linear sRGB."""

    surface: Source | BaseTable
    source: Source | FunctionRecord | None
    wavelength_nm: Array | None
    weights: Array

    @property
    def elliptical(self) -> bool:
        """True if quarters of the sphere have mirrored reflections."""
        return self.source is not None and self.source.elliptical

    def azimuths(self, phis: int) -> Array:
        """Return the azimuths [rad] whose reflection gives that of all others: one, a quarter turn, or all of them."""
        full = 2.0 * np.pi * np.arange(phis) / phis
        if not self.surface.anisotropic:
            return full[:1]
        return full[: phis // 4 + 1] if self.elliptical else full

    def brdf(self, wi: Array, wr: Array) -> Array:
        """Return f_r [1/sr] in linear sRGB (..., 3), of a table without its glints, which would be noise."""
        f_r = self.surface.smooth_vectors if isinstance(self.surface, BaseTable) else self.surface.lookup_vectors
        return self._coloured(f_r(wi, wr, self.wavelength_nm))

    def specular(self, theta: Array) -> Array:
        """Return the specular reflectance [1] in linear sRGB (..., 3)."""
        return self._coloured(self.surface.specular_reflectance(theta, self.wavelength_nm))

    def _coloured(self, values: Floats) -> Array:
        return np.asarray((values[..., np.newaxis] if self.wavelength_nm is None else values) @ self.weights)


def _shown(surface: Source | BaseTable) -> _Shown:
    """Return a surface with the wavelengths of its picture: the visible, or the first one that it is known for."""
    if isinstance(surface, BaseTable):
        source: Source | FunctionRecord | None = surface.source
        at = surface.wavelength_nm
        if at is not None:
            visible = picture_wavelengths(at)
            at = at[:1] if visible is None else visible
    else:
        source = surface
        at = surface.evaluated_at(PICTURE_NM)
    weights = np.ones((1, 1)) if at is None else srgb_weights(tuple(at.tolist()))
    return _Shown(surface, source, at, weights)


def _reflected(shown: _Shown, nodes: Array, sky: _Sky, detail: Detail) -> Array:
    """Return the radiance (thetas, azimuths, 3) that a sphere reflects, without the specular part."""
    theta, phi = np.meshgrid(nodes, shown.azimuths(detail.phis), indexing="ij")
    # The rows of a frame are a tangent around the vertical axis, the bitangent and the normal; the viewer is along z
    normal = unit_vector(theta, phi).reshape(-1, 3)
    tangent = np.cross((0.0, 1.0, 0.0), normal)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    frame = np.stack([tangent, np.cross(normal, tangent), normal], axis=-2)
    wr = frame[..., 2]
    lobe = None if shown.source is None else shown.source.lobe(wr[:, np.newaxis, 2], shown.wavelength_nm)
    widest = widest_lobe(lobe, len(wr))
    samples = detail.samples_anisotropic if shown.surface.anisotropic else detail.samples
    wi = directions(widest, *_numbers(samples), wr)
    density = samples * mixture_density(widest, wr, wi)
    share = np.divide(wi[..., 2], density, where=wi[..., 2] > 0.0, out=np.zeros(density.shape))
    weight = shown.brdf(wi, np.broadcast_to(wr, wi.shape)) * share[..., np.newaxis]
    towards = np.moveaxis(wi, 0, 1) @ frame
    across = (*theta.shape, samples)
    weight = np.moveaxis(weight, 0, -1).reshape(*theta.shape, -1, samples)
    from_viewer, around = (angle.reshape(across) for angle in spherical_angles(towards))
    rows = np.rint(from_viewer / np.pi * (_ROWS - 1)).astype(np.int64)
    radius = np.sqrt(1.0 / (np.pi * np.maximum(density, 1e-9)))  # of a cone with the solid angle of a sample
    rows += _ROWS * np.searchsorted(_BLURS_FROM, radius).T.reshape(across)
    columns = np.rint(around / (2.0 * np.pi) * _COLUMNS).astype(np.int64) % _COLUMNS
    start = 2 * _COLUMNS * rows
    places = {1: start + columns, -1: start + _COLUMNS - columns}  # by the sign of columns
    radiance = np.empty((len(nodes), detail.phis, weight.shape[2]))
    for number_of_phi in range(detail.phis):
        same, sign, turn = _same_as(number_of_phi, theta.shape[1], detail.phis)
        incoming = sky.twice_around[turn:].take(places[sign][:, same])
        radiance[:, number_of_phi] = (weight[:, same] @ incoming[..., np.newaxis])[..., 0]
    return radiance


def _numbers(samples: int) -> tuple[Array, Array]:
    """Return pairs of numbers (samples, 1) in [0, 1], whose azimuths 2 pi u2 are symmetric about both axes."""
    number = np.arange(samples // 4)[:, np.newaxis]
    u1 = (number + 0.5) / len(number)
    u2 = number * _GOLDEN % 1.0
    return np.tile(u1, (4, 1)), np.concatenate([u2, 1.0 - u2, (0.5 + u2) % 1.0, (1.5 - u2) % 1.0])


def _same_as(phi: int, known: int, phis: int) -> tuple[int, int, int]:
    """Return the known azimuth with the same reflection, and the sign and turn of the columns of its light there."""
    half = phis // 2
    if known == 1:
        return 0, 1, phi * _COLUMNS // phis
    if known == phis:
        return phi, 1, 0
    quadrant, rest = divmod(phi, half // 2)
    return (
        (rest, 1, 0),
        (half // 2 - rest, -1, _COLUMNS // 2),
        (rest, 1, _COLUMNS // 2),
        (half // 2 - rest, -1, 0),
    )[quadrant]


class _Sky(NamedTuple):
    """The light over the angle to the viewer and the azimuth: (385, 768), about half a degree apart.

    `twice_around` has the rows of the light, sharp and more and more blurred, from 0 to 720 degrees, one after the
    other. `brightest` is the largest radiance of a white Lambertian sphere, of normals that the viewer sees.
    """

    sharp: Array
    twice_around: Array
    brightest: float


def _tabulated(light: Light) -> _Sky:
    with _TABULATION:
        return _table_of(light)


@functools.lru_cache(maxsize=4)
def _table_of(light: Light) -> _Sky:
    def grid(rows: int, columns: int) -> tuple[Array, Array]:
        theta = np.linspace(0.0, np.pi, rows)[:, np.newaxis]
        return theta, unit_vector(theta, 2.0 * np.pi * np.arange(columns) / columns)

    sharp = light(grid(_ROWS, _COLUMNS)[1])
    coarse = sharp[::_COARSE, ::_COARSE]
    theta, towards = grid(*coarse.shape)
    area = np.sin(theta)
    # Directions of the first column stand for all: those of another column see the same light, turned
    cosine = np.einsum("ri,sci->rsc", towards[:, 0], towards)
    turned = np.stack([np.roll(coarse, -column, axis=1) for column in range(coarse.shape[1])], axis=-1)

    def summed(weight: Array) -> Array:
        return np.asarray(np.tensordot(weight * area, turned, axes=2))

    places = np.stack(np.meshgrid(np.arange(_ROWS) / _COARSE, np.arange(_COLUMNS) / _COARSE, indexing="ij"))
    levels = [sharp]
    for width in radians(_BLURS_DEG):
        spread = np.exp((cosine - 1.0) / width**2)
        mean = summed(spread) / (spread * area).sum(axis=(1, 2))[:, np.newaxis]
        levels.append(
            (_between(mean.shape[0], mean.shape[1], places.reshape(2, -1)) @ mean.ravel()).reshape(sharp.shape)
        )
    seen = np.maximum(cosine[towards[:, 0, 2] >= 0.0], 0.0)
    brightest = np.max(summed(seen)) / (area.sum() * coarse.shape[1] / 4.0)
    return _Sky(sharp, np.tile(np.concatenate(levels), 2).ravel(), float(brightest))


def _between(rows: int, columns: int, at: Array) -> csr_array:
    """Return the matrix (N, rows columns) from values of a grid to those at places (2, N), linear between them.

    Columns are periodic.
    """
    row = np.minimum(at[0].astype(np.int32), rows - 2)
    column = np.floor(at[1]).astype(np.int32)
    down, along = at[0] - row, at[1] - column
    left = row * columns + column % columns
    right = row * columns + (column + 1) % columns
    node = np.stack([left, right, left + columns, right + columns], axis=1)
    weight = np.stack([(1.0 - down) * (1.0 - along), (1.0 - down) * along, down * (1.0 - along), down * along], axis=1)
    ends = np.arange(0, node.size + 1, 4, dtype=np.int32)
    return csr_array((weight.ravel(), node.ravel(), ends), shape=(len(node), rows * columns))
