"""The angular grids of tables: which axes, in degrees, and what an axis must satisfy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Axis = NDArray[np.float64]

ISOTROPIC_AXES = ("theta_i", "theta_r", "delta_phi")
ANISOTROPIC_AXES = ("theta_i", "phi_i", "theta_r", "phi_r")

# First and last node of an axis [degree]; None: anything up to 90. Azimuths close on themselves.
_ENDS: dict[str, tuple[float, float | None]] = {
    "theta_i": (0.0, None),
    "theta_r": (0.0, None),
    "delta_phi": (0.0, 180.0),
    "phi_i": (0.0, 360.0),
    "phi_r": (0.0, 360.0),
}


@dataclass(frozen=True, eq=False)
class Grid:
    """A rectilinear grid of directions.

    Isotropic grids have the axes theta_i, theta_r and delta_phi (0 to 180 degrees, the rest by mirror symmetry);
    anisotropic grids theta_i, phi_i, theta_r and phi_r (0 to 360, both ends stored). Nodes need not be uniform.

    Parameters
    ----------
    axes : mapping of str to sequence of float [degree]
        Nodes of each axis, strictly increasing, in the order of the table's dimensions.

    Raises
    ------
    ValueError
        If the axes are not one of the two sets, or an axis does not start, end or increase as it must.
    """

    axes: dict[str, Axis]

    def __init__(self, axes: Mapping[str, Any]) -> None:
        names = tuple(axes)
        if names not in (ISOTROPIC_AXES, ANISOTROPIC_AXES):
            raise ValueError(f"grid axes: {names} is neither {ISOTROPIC_AXES} nor {ANISOTROPIC_AXES}")
        object.__setattr__(self, "axes", {name: check_axis(name, nodes) for name, nodes in axes.items()})

    @property
    def anisotropic(self) -> bool:
        """Whether the grid resolves the azimuth of the light, not only the difference of azimuths."""
        return "phi_i" in self.axes

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of nodes along each axis."""
        return tuple(nodes.size for nodes in self.axes.values())

    @property
    def reciprocal(self) -> bool:
        """Whether a table is its own transpose: isotropic, with the same theta nodes for light and viewer."""
        return not self.anisotropic and np.array_equal(self.axes["theta_i"], self.axes["theta_r"])

    @property
    def symmetries(self) -> list[str]:
        """What a table on the grid leaves out or repeats, in words."""
        mirror = [] if self.anisotropic else ["brdf(delta_phi) = brdf(-delta_phi)"]
        return mirror + (["brdf(theta_i, theta_r) = brdf(theta_r, theta_i)"] if self.reciprocal else [])

    @property
    def reaches_horizon(self) -> bool:
        """Whether a theta axis has a node at exactly 90 degrees."""
        return any(nodes[-1] == 90.0 for name, nodes in self.axes.items() if name.startswith("theta"))


def check_axis(name: str, nodes: Any) -> Axis:
    """Return the nodes of axis `name` [degree] as float64, or raise a ValueError saying what is wrong with them."""
    axis = np.array(nodes, dtype=np.float64)
    if axis.ndim != 1 or axis.size < 2:
        raise ValueError(f"{name}: needs a list of at least two nodes, got an array of shape {axis.shape}")
    if not np.all(np.diff(axis) > 0.0):
        raise ValueError(f"{name}: the nodes must increase strictly")
    first, last = _ENDS[name]
    if axis[0] != first:
        raise ValueError(f"{name}: starts at {axis[0]:g} degrees, must start at {first:g}")
    if last is not None and axis[-1] != last:
        raise ValueError(f"{name}: ends at {axis[-1]:g} degrees, must end at {last:g}")
    if last is None and not axis[-1] <= 90.0:
        raise ValueError(f"{name}: ends at {axis[-1]:g} degrees, must end at or below 90")
    return axis


def check_wavelengths(nodes: Any) -> Axis:
    """Return wavelengths [nm] as float64, or raise a ValueError saying what is wrong with them."""
    axis = np.array(nodes, dtype=np.float64)
    if axis.ndim != 1 or axis.size == 0 or not (axis[0] > 0.0 and np.all(np.diff(axis) > 0.0)):
        raise ValueError("wavelengths_nm: must be positive and increase strictly")
    return axis
