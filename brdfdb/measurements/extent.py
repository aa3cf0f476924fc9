"""The extent of measured directions: pairs of directions at samples, or between samples that are close together."""

from __future__ import annotations

import base64
import functools
import zlib
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from brdfdb.errors import ParameterError
from brdfdb.geometry import HALF_PI, degrees, radians, unit_vector
from brdfdb.measurements.coordinates import DirectionPairs, beyond, places
from brdfdb.measurements.samples import Samples
from brdfdb.parameters import Floats

# cells of three coordinates, and of four, which are many more
_CELL_DEG = 2.5
_TURNED_CELL_DEG = 7.5
# volume of a ball, in those that typically fit between samples
_LIGHTS = 2.0
_VIEWERS = 4.0
_SCATTERED = 4.0
_THINNED = 400  # samples that the typical ball is measured with
_LOWEST = radians(89.9)  # polar angle of directions that are drawn, at most
_LEAST = 1.5  # radius of a ball in cells, at least: smaller ones slip through the cells
_FLAT = 1e-6  # spread along an axis, relative to the largest, that counts as none
_ROUNDING = 1e-6  # of distances, in radii
_SEED = 1983

Cells = NDArray[np.bool_]
_Number = TypeVar("_Number", np.float64, np.int64)


class Extent(BaseModel):
    """The pairs of directions that samples tell f_r of, in cells of some degrees.

    A pair is extrapolated if it lies outside of the convex hull of the samples, or in a hole: a ball around a pair of
    the hull, without samples. The ball is larger than those that fit between neighbouring samples of the same data.
    What lies between neighbours is thus measured, and wide gaps are not.

    Notes
    -----
    The hull is that of directions as theta (cos phi, sin phi). An isotropic surface has theta_i alone, which continues
    beyond the normal, and mirror images. The hull of flat data, such as samples in the plane of incidence, is flat, and
    cells make it wider by half a cell on either side.

    Balls are those of coordinates in which lobes stay in place: the direction of the light, and that of the viewer
    less the mirror direction. Scans have many viewers for each light: balls are as wide as the typical gap between
    lights on either side, and for viewers twice as wide as those that typically fit between them. So a hole among the
    viewers of one light is found whatever its neighbours saw, and a gap between lights that is about twice as wide as
    usual, as are the gaps at lights that are held out. Samples without such a pattern have balls of one size for light
    and viewer, with four times the typical volume. Holes are those of the alpha hull.

    References
    ----------
    edelsbrunner1983
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    turned: bool = Field(description="true: the azimuth of the light counts, which makes four coordinates of three")
    cell_deg: float = Field(ge=1.0, le=45.0, description="width of a cell in theta (cos phi, sin phi)")
    cells: str = Field(
        description="base64 of the zlib-compressed bits of the cells, 1 where f_r was measured, with theta n cells at "
        "most: theta_i 0 to n, theta_r cos(delta_phi) -n to n, theta_r abs(sin(delta_phi)) 0 to n; turned: "
        "theta (cos phi, sin phi) of light and viewer, each -n to n; the last varies fastest"
    )

    @classmethod
    def of(cls, samples: Samples, *, turned: bool) -> Extent:
        """Return the extent of the samples of which a value is known; `turned` if the azimuth of the light counts."""
        samples = samples.selected(np.flatnonzero(samples.known.any(axis=1)))
        cell = float(radians(_TURNED_CELL_DEG if turned else _CELL_DEG))
        x = np.asarray(places(samples.w_i, samples.w_r, turned=turned), dtype=np.float64)
        lights = 2 if turned else 1
        light = x[:, :lights]
        sheared = _sheared(x, lights)
        if samples.scanned:
            incidence = samples.incidence
            centres = np.stack([np.bincount(incidence, column) for column in light.T], axis=1)
            of_light = _typical(centres / np.bincount(incidence)[:, np.newaxis])
            of_viewers = [_typical(sheared[incidence == one, lights:]) for one in np.unique(incidence)]
            radii = np.array(
                [_LIGHTS ** (1.0 / lights) * of_light] * lights + [_VIEWERS**0.5 * float(np.median(of_viewers))] * 2
            )
        else:
            radii = np.full(lights + 2, _SCATTERED ** (1.0 / (lights + 2)) * _typical(sheared))
        radii = np.maximum(radii / cell, _LEAST)
        at = np.unique(np.rint(x / cell).astype(np.int64), axis=0)
        if not turned:  # mirror images, and both with the surface turned by 180 degrees
            at = np.concatenate([at, at * [1, 1, -1]])
            at = np.unique(np.concatenate([at, -at]), axis=0)
        count = round(HALF_PI / cell)
        whole = np.argwhere(np.ones((2 * count + 1,) * at.shape[1], dtype=bool)) - count
        inside = whole[~beyond(whole.astype(np.float64), at.astype(np.float64))]
        inside = inside[~_in_holes(_sheared(inside, lights), _sheared(at, lights), radii)] + count
        cells = np.zeros((2 * count + 1,) * at.shape[1], dtype=bool)
        cells[tuple(inside.T)] = True
        cells = cells if turned else cells[count:, :, count:]
        packed = base64.b64encode(zlib.compress(np.packbits(cells).tobytes(), 9)).decode()
        return cls(turned=turned, cell_deg=float(degrees(cell)), cells=packed)

    @functools.cached_property
    def measured(self) -> Cells:
        """The cells, with three or four axes as `cells` has them; ParameterError if they are damaged."""
        count = round(90.0 / self.cell_deg)
        both = 2 * count + 1
        shape = (both,) * 4 if self.turned else (count + 1, both, count + 1)
        size = (int(np.prod(shape)) + 7) // 8
        try:
            packed = zlib.decompressobj().decompress(base64.b64decode(self.cells, validate=True), size + 1)
        except (ValueError, zlib.error):
            packed = b""
        if len(packed) != size:
            raise ParameterError("extent", f"the cells are damaged: {len(packed)} bytes are not {size}", len(packed))
        bits = np.unpackbits(np.frombuffer(packed, dtype=np.uint8), count=int(np.prod(shape)))
        return bits.astype(bool).reshape(shape)

    def outside(self, wi: Floats, wr: Floats) -> NDArray[np.bool_]:
        """Return which pairs of unit vectors (N, 3) are extrapolated."""
        count = round(90.0 / self.cell_deg)
        at = np.rint(places(wi, wr, turned=self.turned) / radians(self.cell_deg)).astype(np.int64)
        at = at if self.turned else np.stack([at[:, 0], at[:, 1], np.abs(at[:, 2])], axis=1)
        at = np.clip(at + _origin(count, turned=self.turned), 0, np.array(self.measured.shape) - 1)
        return np.asarray(~self.measured[tuple(at.T)])

    def drawn(self, count: int, rng: np.random.Generator) -> DirectionPairs:
        """Draw pairs of unit vectors (count, 3) above the horizon, evenly over the cells that were measured."""
        cells = np.argwhere(self.measured) - _origin(round(90.0 / self.cell_deg), turned=self.turned)
        x = cells[rng.integers(len(cells), size=count)] + rng.uniform(-0.5, 0.5, (count, cells.shape[1]))
        x = x * radians(self.cell_deg)
        theta_i = np.hypot(x[:, 0], x[:, 1]) if self.turned else np.abs(x[:, 0])
        phi_i = np.arctan2(x[:, 1], x[:, 0]) if self.turned else rng.uniform(0.0, 2.0 * np.pi, count)
        theta_r = np.hypot(x[:, -2], x[:, -1])
        phi_r = np.arctan2(x[:, -1], x[:, -2]) + phi_i * (not self.turned)
        theta_i, theta_r = (np.minimum(theta, _LOWEST) for theta in (theta_i, theta_r))
        return DirectionPairs(unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r))


def _origin(count: int, *, turned: bool) -> NDArray[np.int64]:
    """Return the index of the cell of light and viewer at the normal."""
    return np.full(4, count) if turned else np.array([0, count, 0])


def _sheared(x: NDArray[_Number], lights: int) -> NDArray[_Number]:
    """Return places (N, D) with the viewer relative to the mirror direction."""
    moved = x.copy()
    moved[:, lights : 2 * lights] += x[:, :lights]
    return moved


def _typical(x: Floats) -> float:
    """Return the radius of the balls that typically fit between points (N, D): the median over the volume.

    Balls are those through the corners of the simplices of Delaunay's triangulation. Points in a plane or on
    a line have balls there. 0 for fewer than two points.
    """
    from scipy.spatial import Delaunay

    x = np.unique(np.round(x, 4), axis=0)
    whole = len(x)
    x = x[np.random.default_rng(_SEED).permutation(whole)[:_THINNED]]
    x = x - x.mean(axis=0)
    if len(x) < 2:
        return 0.0
    _, spread, axes = np.linalg.svd(x, full_matrices=False)
    wide = spread > _FLAT * max(spread[0], 1e-12)
    x = x @ axes[wide].T
    sizes = x.shape[1]
    if sizes == 0:
        return 0.0
    thinner = (len(x) / whole) ** (1.0 / sizes)
    if sizes == 1:
        gaps = np.diff(np.unique(np.round(x[:, 0], 6)))
        return float(0.5 * thinner * np.median(gaps))
    corners = x[Delaunay(x).simplices]
    edges = corners[:, 1:] - corners[:, :1]
    volume = np.abs(np.linalg.det(edges))
    good = volume > _FLAT * volume.max()
    edges, volume = edges[good], volume[good]
    centre = np.linalg.solve(edges, 0.5 * np.sum(edges**2, axis=2)[..., np.newaxis])[..., 0]
    radius = np.linalg.norm(centre, axis=1)
    order = np.argsort(radius)
    part = np.cumsum(volume[order])
    return float(thinner * radius[order][np.searchsorted(part, 0.5 * part[-1])])


def _in_holes(inside: NDArray[np.int64], at: NDArray[np.int64], radii: Floats) -> NDArray[np.bool_]:
    """Return which cells (N, D) are in a ball around one of them that has none of the cells `at` (M, D).

    `radii` (D,) are the half axes of the balls, in cells.
    """
    from scipy.ndimage import distance_transform_edt

    low = inside.min(axis=0)
    shape = inside.max(axis=0) - low + 1
    own = tuple((inside - low).T)
    empty = np.ones(shape, dtype=bool)
    empty[tuple((at - low).T)] = False
    centre = distance_transform_edt(empty, sampling=1.0 / radii)[own] >= 1.0 - _ROUNDING
    if not centre.any():
        return np.asarray(centre)
    free = np.ones(shape, dtype=bool)
    free[tuple(part[centre] for part in own)] = False
    return np.asarray(distance_transform_edt(free, sampling=1.0 / radii)[own] < 1.0 - 2.0 * _ROUNDING)
