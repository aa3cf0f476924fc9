"""A height map: heights on a grid of equal steps, with its slopes, and its facets as triangles."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.microgeometry.random_fields import crossing

Heights = NDArray[np.float64]

STEPS_UM = (1e-6, 1e9)  #: distances of nodes that are allowed: rays are traced in float32, whose squares have an end
_LARGEST = 1e5  # sides and heights of a map, in its smaller step: rays leave facets at 5e-7 of the largest length


class Triangles(NamedTuple):
    """Facets of a height map."""

    vertices: Heights  #: corners of the facets, (V, 3) [um]
    #: numbers of the three corners of each facet, counter-clockwise as seen from above, (F, 3)
    faces: NDArray[np.int32]
    normals: Heights  #: unit normals, which point upwards, (F, 3) [1]


class Realised(NamedTuple):
    """Statistics of a height map, in place of those that were asked for."""

    sigma_0_um: float  #: standard deviation of the heights [um]
    slope_x: float  #: standard deviation of the slopes of the facets along x, weighted by their horizontal areas [1]
    slope_y: float  #: the same along y [1]
    tau_x_um: float  #: distance along x at which the correlation of the heights is 1 / e; nan: it stays above [um]
    tau_y_um: float  #: the same along y [um]


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Heights of a surface at the nodes of a grid. The grid of a periodic map goes on beyond its last node.

    ParameterError if a height is not finite, if a step is outside [1e-6, 1e9] um, if a side or the range of heights is
    more than 1e5 smaller steps, or if there are fewer than two nodes along an axis.
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
        low, high = STEPS_UM
        for name in ("step_x_um", "step_y_um"):
            step = getattr(self, name)
            if not low <= step <= high:
                raise ParameterError(name, f"{step:g} um is outside [{low:g}, {high:g}] um", step, STEPS_UM)
        object.__setattr__(self, "heights_um", heights)
        finest = min(self.step_x_um, self.step_y_um)
        lengths = {float(np.ptp(heights)): "range of heights", self.width_um: "width", self.length_um: "length"}
        longest = max(lengths)
        if longest > _LARGEST * finest:
            text = f"a {lengths[longest]} of {longest:.3g} um is too large for steps of {finest:.3g} um; "
            text += f"allowed are up to {_LARGEST:g} steps, {_LARGEST * finest:.3g} um"
            raise ParameterError("heights_um", text, longest, (0.0, _LARGEST * finest))

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
        steps = crossing(correlation)
        return float("nan") if steps is None else steps
