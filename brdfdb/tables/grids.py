"""The angular grids of tables: which axes, in degrees, what an axis must satisfy, and what symmetry leaves out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import directions_from_half_difference, radians
from brdfdb.parameters import check_nanometres

Axis = NDArray[np.float64]

ISOTROPIC_AXES = ("theta_i", "theta_r", "delta_phi")
ANISOTROPIC_AXES = ("theta_i", "phi_i", "theta_r", "phi_r")
HALF_DIFFERENCE_AXES = ("theta_h", "theta_d", "phi_d")
ANISOTROPIC_HALF_DIFFERENCE_AXES = ("theta_h", "phi_h", "theta_d", "phi_d")
KINDS: tuple[tuple[str, ...], ...] = (
    ISOTROPIC_AXES,
    ANISOTROPIC_AXES,
    HALF_DIFFERENCE_AXES,
    ANISOTROPIC_HALF_DIFFERENCE_AXES,
)

# Where azimuths may end [degree]; all begin at 0. Polar angles end anywhere up to 90.
_AZIMUTHS: dict[tuple[str, ...], dict[str, tuple[float, ...]]] = {
    ISOTROPIC_AXES: {"delta_phi": (180.0,)},
    ANISOTROPIC_AXES: {"phi_i": (360.0, 180.0, 90.0), "phi_r": (360.0,)},
    HALF_DIFFERENCE_AXES: {"phi_d": (90.0, 180.0)},
    ANISOTROPIC_HALF_DIFFERENCE_AXES: {"phi_h": (360.0, 180.0, 90.0), "phi_d": (180.0, 360.0)},
}

RECIPROCITY = "brdf(theta_i, theta_r) = brdf(theta_r, theta_i)"
_HALF_TURN = "brdf(phi_i + 180, phi_r + 180) = brdf(phi_i, phi_r)"
_MIRROR = "brdf(-phi_i, -phi_r) = brdf(phi_i, phi_r)"


@dataclass(frozen=True, eq=False)
class Grid:
    """A rectilinear grid of directions.

    Grids of light and viewer have the axes theta_i, theta_r and delta_phi (0 to 180 degrees, the rest by mirror
    symmetry), anisotropic ones theta_i, phi_i, theta_r and phi_r. Grids of half and difference vectors (Rusinkiewicz
    1998, ``rusinkiewicz1998``) have theta_h, theta_d and phi_d (0 to 90, the rest by mirror symmetry and reciprocity),
    anisotropic ones theta_h, phi_h, theta_d and phi_d (0 to 180, the rest by reciprocity). Where light and viewer may
    not be exchanged, phi_d ends at 180 or, of anisotropic grids, at 360. phi_i and phi_h end at 360,
    at 180 for surfaces that half a turn leaves the same, or at 90 for those that are also their own mirror image in x.
    Both ends of an axis are nodes; nodes need not be uniform.

    Raises
    ------
    ValueError
        If the axes are not one of the four sets, or an axis does not start, end or increase as it must.
    """

    axes: dict[str, Axis]  #: nodes of each axis, strictly increasing, in the order of the table's dimensions, [degree]

    @classmethod
    def part(cls, grid: Grid, rows: slice) -> Grid:
        """Return rows of the first axis of a grid, which need not begin at 0."""
        part = object.__new__(cls)
        leading, *others = grid.axes
        axes = {leading: grid.axes[leading][rows], **{name: grid.axes[name] for name in others}}
        object.__setattr__(part, "axes", axes)
        return part

    def __init__(self, axes: Mapping[str, Any]) -> None:
        names = tuple(axes)
        if names not in KINDS:
            raise ParameterError("grid axes", f"{names} is none of {', '.join(map(str, KINDS))}", names, tuple(KINDS))
        object.__setattr__(self, "axes", {name: _checked(names, name, nodes) for name, nodes in axes.items()})

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the axes, in the order of the dimensions."""
        return tuple(self.axes)

    @property
    def anisotropic(self) -> bool:
        """True if the grid resolves the turn of the surface about its normal."""
        return len(self.axes) == 4

    @property
    def turned(self) -> bool:
        """True if a turn of the surface may change the values: of two nodes of phi_h, 0 and 360, both have the same."""
        return self.anisotropic and not (self.half_difference and self.axes["phi_h"].size == 2)

    @property
    def half_difference(self) -> bool:
        """True if the axes are those of half and difference vectors."""
        return "theta_h" in self.axes

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of nodes along each axis."""
        return tuple(nodes.size for nodes in self.axes.values())

    @property
    def copies(self) -> int:
        """Number of times the azimuth of an anisotropic grid, phi_i or phi_h, goes into a full turn: 1, 2 or 4."""
        turned = self.axes.get("phi_i", self.axes.get("phi_h"))
        return 1 if turned is None else round(360.0 / turned[-1])

    @property
    def reciprocal(self) -> bool:
        """True if the grid assumes that light and viewer may be exchanged.

        Half of phi_d is then left out of a grid of half and difference vectors. A table over theta_i, theta_r and
        delta_phi with the same nodes for both thetas is then its own transpose.
        """
        if self.half_difference:
            return bool(self.axes["phi_d"][-1] == (180.0 if self.anisotropic else 90.0))
        return self.names == ISOTROPIC_AXES and np.array_equal(self.axes["theta_i"], self.axes["theta_r"])

    @property
    def symmetries(self) -> list[str]:
        """The symmetries that a table on the grid makes use of, in words."""
        known = [] if self.anisotropic else ["brdf(delta_phi) = brdf(-delta_phi)"]
        known += [_HALF_TURN] if self.copies > 1 else []
        known += [_MIRROR] if self.copies == 4 else []
        return known + ([RECIPROCITY] if self.reciprocal else [])

    @property
    def ends(self) -> list[tuple[str, str]]:
        """The continuation of a table beyond the ends of each axis, as of `_interpolation.prepared`."""
        even_pole = "even" if not self.anisotropic or self.copies > 1 else "open"
        known = {
            "delta_phi": ("even", "even"),
            "phi_r": ("periodic", "periodic"),
            "phi_i": ("periodic", "periodic") if self.copies == 1 else ("open", "open"),
            "phi_h": ("periodic", "periodic") if self.copies < 4 else ("open", "open"),
            "phi_d": ("periodic", "periodic") if self.anisotropic else ("even", "even"),
            "theta_h": (even_pole, "open"),  # past the pole the half vector, and the light about it, are turned by 180
            "theta_d": ("even" if self.reciprocal else "open", "open"),  # past the pole light and viewer are exchanged
        }
        return [known.get(name, ("open", "open")) for name in self.axes]

    def directions(self, first: slice = slice(None)) -> tuple[NDArray[np.float64], ...]:
        """theta_i, phi_i, theta_r, phi_r [rad] of the nodes, of some rows of the first axis only.

        Arrays that broadcast to the shape of the grid. On a grid of half and difference vectors either theta may pass
        pi/2, where that direction is below the horizon.
        """
        leading, *others = self.axes.values()
        return directions(self.names, [leading[first], *others])

    @property
    def reaches_horizon(self) -> bool:
        """True if a theta axis of light or viewer has a node at exactly 90 degrees."""
        return any(nodes[-1] == 90.0 for name, nodes in self.axes.items() if name in ("theta_i", "theta_r"))


def directions(names: tuple[str, ...], nodes: Sequence[Axis]) -> tuple[NDArray[np.float64], ...]:
    """Return theta_i, phi_i, theta_r, phi_r [rad] of nodes [degree] on named axes: see `Grid.directions`."""
    on_axes = np.ix_(*(radians(axis) for axis in nodes))
    if names == ISOTROPIC_AXES:
        return on_axes[0], np.zeros(()), on_axes[1], on_axes[2]
    if names == ANISOTROPIC_AXES:
        return on_axes
    if names == ANISOTROPIC_HALF_DIFFERENCE_AXES:
        return directions_from_half_difference(*on_axes)
    return directions_from_half_difference(on_axes[0], 0.0, on_axes[1], on_axes[2])


def axes_among(names: Iterable[Any]) -> tuple[str, ...]:
    """Return the axes of a grid among the names of arrays or dimensions; ParameterError if there are none.

    An anisotropic grid of half and difference vectors has the axes of an isotropic one, too.
    """
    known = set(names)
    for kind in reversed(KINDS):
        if set(kind) <= known:
            return kind
    raise ParameterError(
        "grid axes", f"none of {', '.join(map(str, KINDS))} is among {', '.join(sorted(map(str, known)))}"
    )


def _checked(names: tuple[str, ...], name: str, nodes: Any) -> Axis:
    """Return the nodes of an axis [degree] as float64; ParameterError for nodes that are not allowed."""
    axis = np.array(nodes, dtype=np.float64)
    if axis.ndim != 1 or axis.size < 2:
        raise ParameterError(
            name, f"needs a list of at least two nodes, got an array of shape {axis.shape}", axis.shape
        )
    if not np.all(np.diff(axis) > 0.0):
        raise ParameterError(name, "the nodes must increase strictly")
    if axis[0] != 0.0:
        raise ParameterError(name, f"starts at {axis[0]:g} degrees, must start at 0", float(axis[0]), 0.0)
    ends = _AZIMUTHS[names].get(name)
    if ends is not None and axis[-1] not in ends:
        raise ParameterError(
            name,
            f"ends at {axis[-1]:g} degrees, must end at {' or '.join(f'{end:g}' for end in ends)}",
            float(axis[-1]),
            ends,
        )
    if ends is None and not axis[-1] <= 90.0:
        raise ParameterError(name, f"ends at {axis[-1]:g} degrees, must end at or below 90", float(axis[-1]))
    return axis


def check_wavelengths(nodes: Any) -> Axis:
    """Return wavelengths [nm] as float64, or raise a ParameterError."""
    axis = np.array(nodes, dtype=np.float64)
    if axis.ndim != 1 or axis.size == 0 or not (axis[0] > 0.0 and np.all(np.diff(axis) > 0.0)):
        raise ParameterError("wavelengths_nm", "must be positive and increase strictly")
    return check_nanometres("wavelengths_nm", axis)


class Located(NamedTuple):
    """Wavelengths that are asked for, M of them, on the axis of a table.

    `nodes` (M, 4) are the numbers of the wavelengths of the table that count, `weight` (M, 4) their weights, as by
    `weights_of_nodes`. `column` (M,) is the column of `Error.limits` for each. `tail` is the shape that the wavelengths
    add to that of the directions.
    """

    nodes: NDArray[np.int64]
    weight: NDArray[np.float64]
    column: NDArray[np.int64]
    tail: tuple[int, ...]

    @property
    def size(self) -> int:
        """Number of wavelengths."""
        return self.column.size

    def mixed(self, values: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
        """Return values (N, L) at the wavelengths of the table at those asked for (N, M), at least 0."""
        return np.asarray(np.maximum(np.einsum("nmk,mk->nm", values[:, self.nodes], self.weight), 0.0))
