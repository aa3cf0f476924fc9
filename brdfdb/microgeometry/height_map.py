"""A height map: heights on a grid of equal steps, with its slopes, and its facets as triangles."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError

Heights = NDArray[np.float64]


class Triangles(NamedTuple):
    """Facets of a height map.

    Attributes
    ----------
    vertices : array (V, 3) [um]
        Corners of the facets.
    faces : array (F, 3)
        Numbers of the three corners of each facet, counter-clockwise as seen from above.
    normals : array (F, 3) [1]
        Unit normals, which point upwards.
    """

    vertices: Heights
    faces: NDArray[np.int32]
    normals: Heights


class Realised(NamedTuple):
    """Statistics of a height map, in place of those that were asked for.

    Attributes
    ----------
    sigma_0_um : float [um]
        Standard deviation of the heights.
    slope_x, slope_y : float [1]
        Standard deviations of the slopes of the facets along x and y, weighted by their horizontal areas.
    tau_x_um, tau_y_um : float [um]
        Distances along x and y at which the correlation of the heights has fallen to 1 / e; nan if it does not.
    """

    sigma_0_um: float
    slope_x: float
    slope_y: float
    tau_x_um: float
    tau_y_um: float


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Heights of a surface at the nodes of a grid. The grid of a periodic map goes on beyond its last node.

    ParameterError if a height is not finite, a step is not positive, or there are fewer than two nodes along an axis.
    """

    heights_um: Heights = field(repr=False)  #: heights at x = i step_x, y = j step_y, (nx, ny) [um]
    step_x_um: float  #: distance of nodes along x [um]
    step_y_um: float  #: distance of nodes along y [um]
    periodic: bool = False  #: True if the map repeats itself along both axes
    name: str = "surface"  #: name of the surface, or of the file

    def __post_init__(self) -> None:
        heights = np.ascontiguousarray(self.heights_um, np.float64)
        if heights.ndim != 2 or min(heights.shape) < 2:
            raise ParameterError("heights_um", f"shape {heights.shape} is not a grid of 2 x 2 nodes or more")
        if not np.all(np.isfinite(heights)):
            holes = np.count_nonzero(~np.isfinite(heights))
            raise ParameterError("heights_um", f"{holes} of {heights.size} heights are holes; fill or cut them first")
        for name in ("step_x_um", "step_y_um"):
            step = getattr(self, name)
            if not 0.0 < step < np.inf:
                raise ParameterError(name, f"{step:g} um is not a positive length", step, (0.0, np.inf))
        object.__setattr__(self, "heights_um", heights)

    @property
    def width_um(self) -> float:
        """Length of the map along x [um]."""
        return float(self.heights_um.shape[0] - (not self.periodic)) * self.step_x_um

    @property
    def length_um(self) -> float:
        """Length of the map along y [um]."""
        return float(self.heights_um.shape[1] - (not self.periodic)) * self.step_y_um

    def closed(self) -> Heights:
        """Return the heights with the first row and column of a periodic map repeated at its end [um]."""
        return np.pad(self.heights_um, ((0, 1), (0, 1)), mode="wrap") if self.periodic else self.heights_um

    def tilted(self) -> float:
        """Return the share [1] that the plane that fits best has in the variance of the heights."""
        z = self.heights_um - self.heights_um.mean()
        total = np.mean(z * z)
        share = 0.0
        for row in (z.mean(axis=1), z.mean(axis=0)):
            x = np.linspace(-1.0, 1.0, row.size)
            share += np.mean(x * row) ** 2 / np.mean(x * x)
        return float(share / total) if total > 0.0 else 0.0

    def triangles(self) -> Triangles:
        """Return two facets for each cell of the grid, divided along the diagonal from the first node to the last."""
        z = self.closed()
        nx, ny = z.shape
        x = np.broadcast_to((np.arange(nx) * self.step_x_um)[:, np.newaxis], z.shape)
        y = np.broadcast_to(np.arange(ny) * self.step_y_um, z.shape)
        first = (np.arange(nx - 1, dtype=np.int32)[:, np.newaxis] * ny + np.arange(ny - 1, dtype=np.int32)).reshape(-1)
        right = np.stack([first, first + ny, first + ny + 1], axis=-1)
        left = np.stack([first, first + ny + 1, first + 1], axis=-1)
        vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
        faces = np.concatenate([right, left])
        along_x, along_y = np.diff(z, axis=0) / self.step_x_um, np.diff(z, axis=1) / self.step_y_um
        normals = np.ones((len(faces), 3))
        normals[:, 0] = -np.concatenate([along_x[:, :-1].reshape(-1), along_x[:, 1:].reshape(-1)])
        normals[:, 1] = -np.concatenate([along_y[1:].reshape(-1), along_y[:-1].reshape(-1)])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return Triangles(vertices, faces, normals)

    def realised(self) -> Realised:
        """Return standard deviations of heights and slopes, and the lengths of correlation."""
        z = self.closed()
        along_x = np.diff(z, axis=0) / self.step_x_um
        along_y = np.diff(z, axis=1) / self.step_y_um
        # The slope of a facet along x is that of its edge along x: each inner edge belongs to two facets
        slope_x = np.sqrt(np.mean((along_x[:, :-1] ** 2 + along_x[:, 1:] ** 2) / 2.0))
        slope_y = np.sqrt(np.mean((along_y[:-1] ** 2 + along_y[1:] ** 2) / 2.0))
        return Realised(
            float(np.std(self.heights_um)),
            float(slope_x),
            float(slope_y),
            self._correlation_length(axis=0) * self.step_x_um,
            self._correlation_length(axis=1) * self.step_y_um,
        )

    def _correlation_length(self, axis: int) -> float:
        """Return the steps along an axis at which the correlation of the heights falls to 1 / e, or nan."""
        z = self.heights_um - self.heights_um.mean()
        count = z.shape[axis]
        # zeros double a map that is not periodic, so that its end does not meet its beginning
        size = count if self.periodic else 2 * count
        power = np.sum(np.abs(np.fft.rfft(z, size, axis=axis)) ** 2, axis=1 - axis)
        correlation = np.fft.irfft(power, size)[: count // 2]
        if not self.periodic:
            correlation /= count - np.arange(correlation.size)
        if correlation[0] <= 0.0:
            return float("nan")
        correlation /= correlation[0]
        below = np.flatnonzero(correlation < np.exp(-1.0))
        if not below.size:
            return float("nan")
        last = int(below[0])
        before, after = correlation[last - 1], correlation[last]
        return float(last - 1 + (before - np.exp(-1.0)) / (before - after))
