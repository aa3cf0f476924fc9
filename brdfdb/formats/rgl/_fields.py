"""The fields of RGL's files, and f_r of them as Mitsuba's `measured`, pbrt-v4 and RGL's loader evaluate it."""

from __future__ import annotations

import functools
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.parameters import Floats

_REQUIRED = {"theta_i": 1, "phi_i": 1, "ndf": 2, "sigma": 2, "vndf": 4, "luminance": 4, "jacobian": 1}
_BYTES = ("description", "jacobian")
_ROUNDING = 1e-3  # of the angles of a file [rad]

Floats32 = NDArray[np.float32]
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Fields:
    """The fields of a file."""

    theta_i: Floats32  #: polar angles of the light, (N,) [rad]
    phi_i: Floats32  #: azimuths of the light: one of isotropic materials, (P,) [rad]
    ndf: Floats32  #: a factor over the half vector, (h, w)
    sigma: Floats32  #: a divisor, four times, over the light, (h, w)
    vndf: Floats32  #: the density over the half vector whose warp the next two are stored by, (P, N, h, w)
    luminance: Floats32  #: the density over the uniform numbers of that warp that samples are drawn from, (P, N, S, S)
    #: Values: with the factors above f_r cos(theta_r) [1/sr], (P, N, W, S, S). Channels are wavelengths, or R, G, B.
    spectra: Floats32
    wavelength_nm: Floats32 | None  #: wavelengths; None where the channels are R, G, B, (W,) [nm]
    jacobian: bool = True  #: true if the factors count
    description: str = ""  #: text of the file

    @property
    def isotropic(self) -> bool:
        """True if the readers take the azimuth of the half vector from that of the light."""
        return self.phi_i.size <= 2

    @property
    def reduction(self) -> int:
        """Parts of the circle, of which the file holds one azimuth of the light: 1, 2 or 4."""
        if self.isotropic:
            return 1
        span = float(self.phi_i[-1] - self.phi_i[0])
        return int(np.rint(2.0 * np.pi / span))

    @property
    def nbytes(self) -> int:
        """Size of the arrays [byte]."""
        return sum(array.nbytes for array in self.tensors().values())

    def tensors(self) -> dict[str, NDArray[Any]]:
        """Return the arrays by the names that they have in the file."""
        names = ("theta_i", "phi_i", "ndf", "sigma", "vndf", "luminance")
        arrays: dict[str, NDArray[Any]] = {
            "description": np.frombuffer(self.description.encode(), np.uint8),
            **{name: getattr(self, name) for name in names},
            "spectra" if self.wavelength_nm is not None else "rgb": self.spectra,
            "jacobian": np.array([self.jacobian], np.uint8),
        }
        return arrays if self.wavelength_nm is None else arrays | {"wavelengths": self.wavelength_nm}

    @functools.cached_property
    def warp(self) -> Warp:
        """The warp of the values."""
        return Warp(self.vndf.reshape(-1, *self.vndf.shape[2:]))

    @functools.cached_property
    def _last_channels(self) -> Array:
        """The values with the channels last: (slices, S, S, W)."""
        stored = self.spectra.reshape(-1, *self.spectra.shape[2:])
        return np.ascontiguousarray(np.moveaxis(stored, 1, -1), dtype=np.float64)

    def evaluate(self, wi: Floats, wr: Floats) -> Floats:
        """Return f_r [1/sr], shape (M, W), at unit vectors (M, 3) above the horizon."""
        return self.at(SquarePlaces.of(wi, wr, self.isotropic, self.reduction))

    def at(self, places: SquarePlaces) -> Array:
        """Return f_r [1/sr], shape (M, W), at places."""
        mixture = self.mixture(places)
        s_x, s_y = self.warp.inverse(mixture, places.u_m[0], places.u_m[1])
        size = self.spectra.shape[-1]
        (i, u), (j, v) = Interval.even(s_x, size), Interval.even(s_y, size)
        values = np.zeros((len(i), self.spectra.shape[2]))
        for di, dj, weight in ((0, 0, (1 - u) * (1 - v)), (1, 0, u * (1 - v)), (0, 1, (1 - u) * v), (1, 1, u * v)):
            values += weight[:, np.newaxis] * mixture.of(self._last_channels, j + dj, i + di)
        if self.jacobian:
            values *= (bilinear(self.ndf, *places.u_m) / (4.0 * bilinear(self.sigma, *places.u_i)))[:, np.newaxis]
        return np.asarray(values / places.cosine[:, np.newaxis])

    def at_nodes(self) -> LightsAndViewers:
        """Return all values with their light and viewer."""
        phi_i, theta_i = np.meshgrid(self.phi_i.astype(np.float64), self.theta_i.astype(np.float64), indexing="ij")
        wi = np.stack([np.sin(theta_i) * np.cos(phi_i), np.sin(theta_i) * np.sin(phi_i), np.cos(theta_i)], axis=-1)
        size = self.spectra.shape[-1]
        u_x, u_y = self.warp.forward(size)
        undefined = np.isnan(u_x) | np.isnan(u_y)  # where the density is 0
        u_x, u_y = np.where(undefined, 0.0, u_x), np.where(undefined, 0.0, u_y)
        turn = of_azimuth(phi_i.reshape(-1, 1, 1)) - 0.5 if self.isotropic else 0.0
        m = directions(u_x, u_y + turn)
        wi = np.broadcast_to(wi.reshape(-1, 1, 1, 3), m.shape).reshape(-1, 3)
        m = m.reshape(-1, 3)
        wr = 2.0 * np.sum(wi * m, axis=-1, keepdims=True) * m - wi
        wr = np.where(undefined.reshape(-1, 1), [0.0, 0.0, -1.0], wr)
        values = self._last_channels.reshape(len(m), -1)
        if self.jacobian:
            u_i = of_polar_angle(theta_i), of_azimuth(phi_i)
            sigma = np.broadcast_to(bilinear(self.sigma, *u_i).reshape(-1, 1, 1), u_x.shape).reshape(-1)
            values = values * (bilinear(self.ndf, u_x.reshape(-1), u_y.reshape(-1)) / (4.0 * sigma))[:, np.newaxis]
        above = wr[:, 2] > 0.0
        cosine = np.where(above, wr[:, 2], 1.0)
        return LightsAndViewers(wi, wr, values / cosine[:, np.newaxis])

    def mixture(self, places: SquarePlaces) -> MixedSlices:
        """Return the slices that are mixed at places."""
        j, v = Interval.between(self.theta_i, places.theta_i)
        if self.phi_i.size == 1:
            step = min(1, self.theta_i.size - 1)
            return MixedSlices(np.stack([j, j + step]), np.stack([1.0 - v, v]))
        i, u = Interval.between(self.phi_i, places.phi_i)
        step = min(1, self.theta_i.size - 1)
        count = self.theta_i.size
        numbers = [i * count + j, i * count + j + step, (i + 1) * count + j, (i + 1) * count + j + step]
        return MixedSlices(np.stack(numbers), np.stack([(1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v]))


@dataclass(frozen=True, eq=False)
class SquarePlaces:
    """Pairs of directions in the coordinates of a file."""

    #: light, its azimuth in the part of the circle that the file holds, (M,) [rad]
    theta_i: Array
    phi_i: Array
    #: light and half vector in the unit square: first of the polar angle, then of the azimuth, (2, M)
    u_i: Array
    u_m: Array
    cosine: Array  #: cosine of theta_r, (M,) [1]

    @classmethod
    def of(cls, wi: Floats, wr: Floats, isotropic: bool, reduction: int = 1) -> SquarePlaces:
        """Return the places of unit vectors (M, 3) of light and viewer."""
        light = wi.astype(np.float64)
        viewer = wr.astype(np.float64)
        if reduction >= 2:  # the light is mirrored, or turned, into the part of the circle from -pi on
            flip_y = np.where(light[:, 1] > 0.0, -1.0, 1.0)
            flip_x = np.where(light[:, 0] > 0.0, -1.0, 1.0) if reduction == 4 else flip_y
            flips = np.stack([flip_x, flip_y, np.ones_like(flip_x)], axis=-1)
            light = light * flips
            viewer = viewer * flips
        m = light + viewer
        m = m / np.linalg.norm(m, axis=-1, keepdims=True)
        theta_i = _polar_angle(light)
        theta_m = _polar_angle(m)
        phi_i = np.arctan2(light[:, 1], light[:, 0])
        phi_m = np.arctan2(m[:, 1], m[:, 0])
        u_y = of_azimuth(phi_m - phi_i if isotropic else phi_m)
        u_m = np.stack([of_polar_angle(theta_m), u_y - np.floor(u_y)])
        return cls(theta_i, phi_i, np.stack([of_polar_angle(theta_i), of_azimuth(phi_i)]), u_m, viewer[:, 2])


def fields_of(path: str | os.PathLike[str], arrays: Mapping[str, NDArray[Any]]) -> Fields:
    """Return the fields of a tensor file, checked as its readers check them; FileFormatError if one is not right."""
    spectral = "wavelengths" in arrays
    values = "spectra" if spectral else "rgb"
    axes = _REQUIRED | {values: 5} | ({"wavelengths": 1} if spectral else {}) | {"description": 1}
    for name, count in axes.items():
        if name not in arrays:
            raise FileFormatError(f"{path}: it has no field {name!r}, which measured materials of RGL need")
        dtype = np.dtype(np.uint8 if name in _BYTES else np.float32)
        if arrays[name].ndim != count or arrays[name].dtype != dtype:
            raise FileFormatError(f"{path}: field {name!r} does not have {count} axes and the type {dtype}")
        if dtype == np.float32 and not np.all(np.isfinite(arrays[name])):
            raise FileFormatError(f"{path}: field {name!r} has numbers that are not finite")
    slices = (arrays["phi_i"].size, arrays["theta_i"].size)
    channels = arrays["wavelengths"].size if spectral else 3
    size = arrays["luminance"].shape[-1]
    expected = {
        "vndf": (*slices, *arrays["vndf"].shape[2:]),
        "luminance": (*slices, size, size),
        values: (*slices, channels, size, size),
        "jacobian": (1,),
    }
    for name, shape in expected.items():
        if arrays[name].shape != shape:
            raise FileFormatError(f"{path}: field {name!r} has the shape {arrays[name].shape}; its axes give {shape}")
    for name in ("ndf", "sigma", "vndf", "luminance"):
        if min(arrays[name].shape) < 1 or min(arrays[name].shape[-2:]) < 2:
            raise FileFormatError(f"{path}: field {name!r} of shape {arrays[name].shape} is too small")
    for name in ("theta_i", "phi_i", *(("wavelengths",) if spectral else ())):
        if arrays[name].size < 1 or not np.all(np.diff(arrays[name]) > 0.0):
            raise FileFormatError(f"{path}: field {name!r} does not increase")
    _check_numbers(path, arrays)
    return Fields(
        **{name: arrays[name] for name in ("theta_i", "phi_i", "ndf", "sigma", "vndf", "luminance")},
        spectra=arrays[values],
        wavelength_nm=arrays["wavelengths"] if spectral else None,
        jacobian=bool(arrays["jacobian"][0]),
        description=arrays["description"].tobytes().decode("utf-8", "replace"),
    )


def _check_numbers(path: str | os.PathLike[str], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Raise FileFormatError for angles out of range, and for densities that cannot be warped or divided by."""
    for name, low, high in (("theta_i", 0.0, 0.5 * np.pi), ("phi_i", -2.0 * np.pi, 2.0 * np.pi)):
        first, last = arrays[name][[0, -1]]
        if first < low - _ROUNDING or last > high + _ROUNDING:
            raise FileFormatError(
                f"{path}: field {name!r} is from {first:g} to {last:g}; allowed is [{low:.4g}, {high:.4g}] rad"
            )
    vndf = arrays["vndf"]
    if np.any(vndf < 0.0) or not np.all(np.any(vndf > 0.0, axis=(2, 3))):
        raise FileFormatError(f"{path}: field 'vndf' has a negative number, or a slice of zeros")
    if arrays["jacobian"][0] and not np.all(arrays["sigma"] > 0.0):
        raise FileFormatError(f"{path}: field 'sigma' has the number {arrays['sigma'].min():g}; it divides f_r")


def directions(u_x: Array, u_y: Array) -> Array:
    """Return unit vectors (..., 3) of points of the unit square."""
    theta, phi = u_x**2 * (np.pi / 2.0), (2.0 * u_y - 1.0) * np.pi
    sine = np.sin(theta)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), np.broadcast_to(np.cos(theta), phi.shape)], axis=-1)


def _polar_angle(w: Array) -> Array:
    """Return theta [rad] of unit vectors without the loss of digits near the normal."""
    return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * np.hypot(np.hypot(w[:, 0], w[:, 1]), w[:, 2] - 1.0), 1.0)))


def of_polar_angle(theta: Array) -> Array:
    """Return the coordinate in the unit square of theta [rad]."""
    return np.asarray(np.sqrt(theta * (2.0 / np.pi)))


def of_azimuth(phi: Array) -> Array:
    """Return the coordinate in the unit square of phi [rad]."""
    return np.asarray((phi + np.pi) / (2.0 * np.pi))


def bilinear(values: Floats32, x: Array, y: Array) -> Array:
    """Return values (rows, columns) at points of the unit square."""
    (i, u), (j, v) = Interval.even(x, values.shape[1]), Interval.even(y, values.shape[0])
    exact = values.astype(np.float64)
    low = (1.0 - u) * exact[j, i] + u * exact[j, i + 1]
    return np.asarray((1.0 - v) * low + v * ((1.0 - u) * exact[j + 1, i] + u * exact[j + 1, i + 1]))


@dataclass(frozen=True, eq=False)
class MixedSlices:
    """Slices that are mixed for each of M points: their numbers and weights, both of shape (K, M)."""

    numbers: NDArray[np.int64]
    weights: Array

    def of(self, values: Array, *index: NDArray[np.int64]) -> Array:
        """Return the mixture of values (slices, ...) at an index into their other axes."""
        mixed = self.weights[0][..., *[np.newaxis] * (values.ndim - 1 - len(index))] * values[(self.numbers[0], *index)]
        for number, weight in zip(self.numbers[1:], self.weights[1:], strict=True):
            mixed += weight[..., *[np.newaxis] * (values.ndim - 1 - len(index))] * values[(number, *index)]
        return np.asarray(mixed)


class Interval(NamedTuple):
    """Intervals between ascending nodes that hold numbers, and the shares of them, in [0, 1], below the numbers."""

    number: NDArray[np.int64]
    share: Array

    @classmethod
    def even(cls, x: Array, size: int) -> Interval:
        """Return the intervals of points of [0, 1] between `size` nodes at equal distances."""
        scaled = np.clip(x, 0.0, 1.0) * (size - 1)
        index = np.minimum(scaled.astype(np.int64), size - 2)
        return cls(index, scaled - index)

    @classmethod
    def between(cls, nodes: Floats32, wanted: Array) -> Interval:
        """Return the intervals of numbers between nodes; of one node there is none, and the share is 0."""
        if nodes.size == 1:
            return cls(np.zeros(wanted.shape, np.int64), np.zeros(wanted.shape))
        exact = nodes.astype(np.float64)
        index = np.clip(np.searchsorted(exact, wanted) - 1, 0, nodes.size - 2)
        return cls(index, np.clip((wanted - exact[index]) / (exact[index + 1] - exact[index]), 0.0, 1.0))


class SquarePoints(NamedTuple):
    """Points of the unit square."""

    x: Array
    y: Array


class LightsAndViewers(NamedTuple):
    """Unit vectors (M, 3) of light and viewer, and f_r (M, W) [1/sr]; viewers may be below the horizon."""

    wi: Array
    wr: Array
    values: Array


class Edges(NamedTuple):
    """Values on the left and on the right edge of cells."""

    left: Array
    right: Array


class Warp:
    """Densities on the unit square, one a slice, as the readers of RGL's files normalise and integrate them.

    Parameters
    ----------
    values : float32 array (slices, rows, columns)
        Values that each density is proportional to, positive.
    """

    def __init__(self, values: NDArray[np.float32]) -> None:
        exact = values.astype(np.float64)
        self.rows, self.columns = values.shape[1:]
        columns = np.zeros(exact.shape)
        np.cumsum(0.5 * (exact[..., :-1] + exact[..., 1:]), axis=-1, out=columns[..., 1:])
        ends = columns[..., -1]
        rows = np.zeros(ends.shape)
        np.cumsum(0.5 * (ends[:, :-1] + ends[:, 1:]), axis=-1, out=rows[:, 1:])
        scale = 1.0 / rows[:, -1:]
        self._density = exact * scale[..., np.newaxis]
        self._columns = columns * scale[..., np.newaxis]
        self._rows = rows * scale

    def density(self, mixture: MixedSlices, x: Array, y: Array) -> Array:
        """Return the density at points (M,) of the unit square."""
        (i, u), (j, v) = Interval.even(x, self.columns), Interval.even(y, self.rows)
        low, high = self._edges(mixture, i, j, v)
        return np.asarray(((1.0 - u) * low + u * high) * (self.rows - 1) * (self.columns - 1))

    def inverse(self, mixture: MixedSlices, x: Array, y: Array) -> SquarePoints:
        """Return the uniform numbers that the warp takes to points (M,) of the unit square."""
        (i, u), (j, v) = Interval.even(x, self.columns), Interval.even(y, self.rows)
        low, high = self._edges(mixture, i, j, v)
        last = np.full_like(i, self.columns - 1)
        below = (1.0 - v) * mixture.of(self._columns, j, i) + v * mixture.of(self._columns, j + 1, i)
        row, above = mixture.of(self._columns, j, last), mixture.of(self._columns, j + 1, last)
        whole = (1.0 - v) * row + v * above
        part = below + u * (low + 0.5 * u * (high - low))
        s_x = np.divide(part, whole, out=np.zeros_like(part), where=whole > 0.0)  # no density on the line
        s_y = mixture.of(self._rows, j) + v * (row + 0.5 * v * (above - row))
        return SquarePoints(s_x, s_y)

    def forward(self, size: int) -> SquarePoints:
        """Return the points x, y, shape (slices, size, size), that the warps take a grid of uniform numbers to."""
        s = np.linspace(0.0, 1.0, size)
        slices = np.arange(len(self._rows))[:, np.newaxis]
        j = _interval_of_lines(self._rows, np.broadcast_to(s, (len(slices), size)))
        ends = self._columns[..., -1]
        row, above = ends[slices, j], ends[slices, j + 1]
        v = _root(s - self._rows[slices, j], row, above)
        part = v[..., np.newaxis]
        columns = (1.0 - part) * self._columns[slices, j] + part * self._columns[slices, j + 1]
        density = (1.0 - part) * self._density[slices, j] + part * self._density[slices, j + 1]
        flat = columns.reshape(-1, self.columns)
        wanted = s * columns[..., -1:].reshape(-1, 1)
        i = _interval_of_lines(flat, wanted)
        lines = np.arange(len(flat))[:, np.newaxis]
        dense = density.reshape(-1, self.columns)
        u = _root(wanted - flat[lines, i], dense[lines, i], dense[lines, i + 1])
        x = ((i + u) / (self.columns - 1)).reshape(len(slices), size, size)
        y = ((j + v) / (self.rows - 1))[..., np.newaxis]
        return SquarePoints(x, np.broadcast_to(y, x.shape))

    def _edges(self, mixture: MixedSlices, i: NDArray[np.int64], j: NDArray[np.int64], v: Array) -> Edges:
        """Return the values on the left and on the right edge of cells at the height v."""
        low = (1.0 - v) * mixture.of(self._density, j, i) + v * mixture.of(self._density, j + 1, i)
        high = (1.0 - v) * mixture.of(self._density, j, i + 1) + v * mixture.of(self._density, j + 1, i + 1)
        return Edges(low, high)


def _interval_of_lines(nodes: Array, wanted: Array) -> NDArray[np.int64]:
    """Return the interval of each line of ascending nodes (lines, n) that holds wanted numbers (lines, m)."""
    scale = nodes[:, -1:]
    lines = np.arange(len(nodes))[:, np.newaxis] * 2.0
    flat = (nodes / scale + lines).reshape(-1)
    index = np.searchsorted(flat, (wanted / scale + lines).reshape(-1), side="right").reshape(wanted.shape) - 1
    return np.asarray(np.clip(index - np.arange(len(nodes))[:, np.newaxis] * nodes.shape[1], 0, nodes.shape[1] - 2))


def _root(area: Array, low: Array, high: Array) -> Array:
    """Return where the integral of a line from `low` to `high` over [0, 1] is `area`."""
    area = np.maximum(area, 0.0)
    return np.asarray(
        np.minimum(2.0 * area / (low + np.sqrt(np.maximum(low**2 + 2.0 * area * (high - low), 0.0))), 1.0)
    )
