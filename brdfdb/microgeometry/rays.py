"""Rays that meet the facets of a height map, traced by Embree."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from brdfdb.errors import ParameterError, import_extra
from brdfdb.microgeometry.height_map import HeightMap

Vectors = NDArray[np.float64]

_OFF = 4.0 * float(np.finfo(np.float32).eps)  # of the largest coordinate: Embree computes in float32
MOST_NODES = 2048**2  #: nodes of a map that rays can be traced on
_TILTED = 0.25  # largest share of a plane in the variance of heights that are continued
_ALIKE = 8  # places at which a ray beyond a side may go on
_SEARCHED = 1 << 16  # nodes among which these places are searched
_MOST_TILES = 10_000  # tiles that a ray may cross; only a ray along the horizon crosses more


class Region(NamedTuple):
    """A rectangle of a map, from a low to a high coordinate [um] along each axis."""

    x_low: float
    x_high: float
    y_low: float
    y_high: float


class Hits(NamedTuple):
    """Points at which rays meet the surface.

    Attributes
    ----------
    points : array (N, 3) [um]
        Points on the facets, in the first tile of a periodic map; meaningless where a ray meets none.
    faces : array (N,)
        Numbers of the facets; -1 for a ray that leaves the surface.
    """

    points: Vectors
    faces: NDArray[np.int64]

    def selected(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> Hits:
        """Return some of the points."""
        return Hits(self.points[rows], self.faces[rows])


class Tracer:
    """The facets of a height map, prepared for rays.

    A ray that leaves a side of a periodic map enters it at the opposite side. Over any other map it goes on at another
    place of the same height and slopes, in the half of the map that is farther from that side: no seam casts shadows.
    """

    def __init__(self, surface: HeightMap) -> None:
        scene = import_extra("embreex.rtcore_scene")
        mesh = import_extra("embreex.mesh_construction")
        if surface.heights_um.size > MOST_NODES:
            text = (
                f"the map has {surface.heights_um.size} nodes; at most {MOST_NODES} fit into 2 GB: cut it, or average"
            )
            raise ParameterError("surface", text, surface.heights_um.size, (4, MOST_NODES))
        if not surface.periodic and (share := surface.tilted()) > _TILTED:
            text = f"a tilted plane makes {share:.0%} of the variance of its heights: level the map first"
            raise ParameterError("surface", text, share, (0.0, _TILTED))
        self.measured = Region(0.0, surface.width_um, 0.0, surface.length_um)
        # Embree computes in float32: heights far from 0 would lose their digits
        self.surface = replace(surface, heights_um=surface.heights_um - surface.heights_um.mean())
        triangles = self.surface.triangles()
        self.normals = triangles.normals
        self.sides = np.array([self.surface.width_um, self.surface.length_um])
        self.steps = np.array([surface.step_x_um, surface.step_y_um])
        self.top = float(self.surface.heights_um.max())
        self._alike = None if surface.periodic else _alike(self.surface)
        self._off = _OFF * float(np.abs(triangles.vertices).max())  # distance from a facet at which a ray leaves it
        self._scene: Any = scene.EmbreeScene()
        mesh.TriangleMesh(self._scene, triangles.vertices.astype(np.float32), triangles.faces)

    def checked(self, region: tuple[float, float, float, float] | None) -> Region:
        """Return a rectangle of the map, by default all of it; ParameterError if it is not inside the map."""
        if region is None:
            return self.measured
        part = Region(*region)
        x_side, y_side = self.measured.x_high, self.measured.y_high
        if not (0.0 <= part.x_low < part.x_high <= x_side and 0.0 <= part.y_low < part.y_high <= y_side):
            inside = f"x from 0 to {x_side:g} um and y from 0 to {y_side:g} um"
            raise ParameterError("region", f"{tuple(part)} is no rectangle inside {inside}", part, self.measured)
        return part

    def at(self, places: Vectors, region: Region) -> Hits:
        """Return points of the surface at places (N, 2) in [0, 1)^2 of a rectangle: equal horizontal area."""
        return self._on(
            [region.x_low, region.y_low] + places * [region.x_high - region.x_low, region.y_high - region.y_low]
        )

    def _on(self, xy: Vectors) -> Hits:
        """Return the points of the surface at coordinates (N, 2) [um]."""
        z = self.surface.closed()
        cells = np.array(z.shape) - 1
        i, j = np.minimum(np.floor(xy / self.steps).astype(np.int64), cells - 1).T
        u, v = (xy / self.steps - np.stack([i, j], axis=-1)).T
        right = u >= v  # the triangle that has the edge along x from the first node
        corner = np.where(right, z[i + 1, j], z[i, j + 1])
        height = z[i, j] + np.maximum(u, v) * (corner - z[i, j]) + np.minimum(u, v) * (z[i + 1, j + 1] - corner)
        return Hits(np.column_stack([xy, height]), i * cells[1] + j + np.where(right, 0, cells.prod()))

    def off(self, hits: Hits) -> Vectors:
        """Return the points of hits, moved away from their facets (N, 3) [um]."""
        return hits.points + self._off * self.normals[hits.faces]

    def hits(self, origins: Vectors, directions: Vectors) -> Hits:
        """Return where rays from points [um] along unit vectors, both (N, 3), meet the surface first."""
        points = origins.copy()
        faces = np.full(len(points), -1, np.int64)
        open_rays = np.arange(len(points))
        for _ in range(_MOST_TILES):
            hits = self._scene.run(
                points[open_rays].astype(np.float32), directions[open_rays].astype(np.float32), output=True
            )
            met = hits["primID"] >= 0
            ended = open_rays[met]
            faces[ended] = hits["primID"][met]
            points[ended] += hits["tfar"][met, np.newaxis].astype(np.float64) * directions[ended]
            open_rays = self._entering(points, directions, open_rays[~met])
            if not open_rays.size:
                break
        return Hits(points, faces)

    def leave(self, origins: Vectors, directions: Vectors) -> NDArray[np.bool_]:
        """Return whether rays from points [um] along unit vectors, both (N, 3), leave the surface without a hit."""
        points = origins.copy()
        free = np.ones(len(points), dtype=bool)
        open_rays = np.arange(len(points))
        for _ in range(_MOST_TILES):
            met = self._scene.run(
                points[open_rays].astype(np.float32), directions[open_rays].astype(np.float32), query="OCCLUDED"
            )
            free[open_rays[met >= 0]] = False
            open_rays = self._entering(points, directions, open_rays[met < 0])
            if not open_rays.size:
                break
        return free

    def _entering(self, points: Vectors, directions: Vectors, rays: NDArray[np.int64]) -> NDArray[np.int64]:
        """Move rays that met nothing to where they enter the next tile; return those that may still meet a facet."""
        along = directions[rays, :2]
        with np.errstate(divide="ignore", invalid="ignore"):
            to_side = np.where(along > 0.0, self.sides - points[rays, :2], -points[rays, :2]) / along
        to_side = np.where(along == 0.0, np.inf, np.maximum(to_side, 0.0))
        # of two columns: reductions along an axis of two take several times as long
        side = (to_side[:, 1] < to_side[:, 0]).astype(np.int64)
        distance = np.minimum(to_side[:, 0], to_side[:, 1])
        height = points[rays, 2] + np.where(np.isfinite(distance), distance, 0.0) * directions[rays, 2]
        inside = np.isfinite(distance) & ((height <= self.top) | (directions[rays, 2] < 0.0))
        rays, side, distance = rays[inside], side[inside], distance[inside]
        points[rays] += distance[:, np.newaxis] * directions[rays]
        high = directions[rays, side] > 0.0
        if self._alike is None:
            points[rays, side] = np.where(high, 0.0, self.sides[side])
        elif rays.size:
            points[rays, side] = np.where(high, self.sides[side], 0.0)
            points[rays] = self._elsewhere(points[rays], side, high)
        return rays

    def _elsewhere(self, points: Vectors, side: NDArray[np.int64], high: NDArray[np.bool_]) -> Vectors:
        """Return points at the same height above another place, for points over high or low sides of an axis."""
        assert self._alike is not None
        along = np.take_along_axis(points, 1 - side[:, np.newaxis], axis=1)[:, 0] / self.steps[1 - side]
        node = np.rint(along).astype(np.int64)
        choice = np.floor(_ALIKE * (997.0 * along % 1.0)).astype(np.int64)  # the same for the same ray
        moved = np.empty_like(points)
        for axis in (0, 1):
            for end in (False, True):
                rows = (side == axis) & (high == end)
                moved[rows, :2] = self._alike[axis][int(end)][node[rows], choice[rows]]
        moved[np.arange(len(points)), 1 - side] += (along - node) * self.steps[1 - side]
        moved[:, :2] = np.clip(moved[:, :2], 0.0, self.sides)
        above = points[:, 2] - self._on(points[:, :2]).points[:, 2]
        moved[:, 2] = self._on(moved[:, :2]).points[:, 2] + np.maximum(above, self._off)
        return moved


def _alike(surface: HeightMap) -> list[list[Vectors]]:
    """Return for both axes places (nodes, 8, 2) [um] that are like the nodes at its low and at its high side.

    Their heights, their slopes across the side inside the map, and their slopes along it are nearest.
    """
    steps = np.array([surface.step_x_um, surface.step_y_um])
    places = []
    for axis in (0, 1):
        z = np.moveaxis(surface.heights_um, axis, 0)
        indices = np.moveaxis(np.stack(list(np.indices(surface.heights_um.shape)), axis=-1), axis, 0)
        half = len(z) // 2
        slopes = np.diff(z, axis=0)
        ends = []
        for side, far in ((0, slice(-half, None)), (-1, slice(0, half))):
            across = np.concatenate([slopes, slopes[-1:]] if side == 0 else [slopes[:1], slopes])
            traits = np.stack([z, across, np.gradient(z, axis=1)], axis=-1)
            traits /= np.maximum(traits.std(axis=(0, 1)), 1e-300)
            nodes, candidates = indices[far].reshape(-1, 2), traits[far].reshape(-1, 3)
            if len(nodes) > _SEARCHED:
                chosen = np.random.default_rng(0).choice(len(nodes), _SEARCHED, replace=False)
                nodes, candidates = nodes[chosen], candidates[chosen]
            nearest = KDTree(candidates).query(traits[side], np.arange(_ALIKE) % len(nodes) + 1)[1]
            ends.append(nodes[nearest] * steps)
        places.append(ends)
    return places
