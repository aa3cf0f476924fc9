"""Values of a table at any direction and wavelength: multilinear interpolation on the stored grid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb._numba import kernel
from brdfdb.geometry import checked_angles, finished, fold_delta_phi, radians
from brdfdb.grids import ANISOTROPIC_AXES, Axis
from brdfdb.parameters import Floats


@dataclass(frozen=True, eq=False)
class Table:
    """A decoded table: the values of one revision of one material, in memory.

    Attributes
    ----------
    name, revision : str
        Which material, and which of its revisions.
    attrs : dict
        What the store says of it: title, model, parameters, sources and more.
    axes_deg : dict of str to array [degree]
        Nodes of the angular axes, in the order of the dimensions.
    wavelength_nm : array (L,) [nm] or None
        Wavelengths of a spectral table; None for a grey one, which holds at any wavelength.
    brdf : float32 array [1/sr]
        f_r over the angular axes and, last, the wavelengths.
    specular : float32 array (theta_i[, L]) [1] or None
        Reflectance of the Dirac part, None if the model has none.
    """

    name: str
    revision: str
    attrs: Mapping[str, Any]
    axes_deg: Mapping[str, Axis]
    wavelength_nm: Axis | None
    brdf: NDArray[np.float32]
    specular: NDArray[np.float32] | None

    @property
    def anisotropic(self) -> bool:
        """Whether the table resolves the azimuth of the light."""
        return "phi_i" in self.axes_deg

    def lookup(
        self,
        theta_i: ArrayLike,
        phi_i: ArrayLike,
        theta_r: ArrayLike,
        phi_r: ArrayLike,
        wavelength_nm: ArrayLike | None = None,
    ) -> Floats:
        """Interpolate f_r.

        Parameters
        ----------
        theta_i, phi_i, theta_r, phi_r : array_like [rad]
            Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi]; broadcast.
        wavelength_nm : float or array_like (M,) [nm], optional
            Within the table's wavelengths; grey tables take any. By default all wavelengths of the table.

        Returns
        -------
        array [1/sr]
            In the shape of the angles, with a last axis for the wavelengths of a spectral table, or M if an array of
            wavelengths was given; a single wavelength adds no axis. 0 below the horizon, nan where an angle is nan.
            Between the last theta node and 90 degrees the value is the last node's.

        Raises
        ------
        ValueError
            If an angle or a wavelength is outside its range; the message names it.
        """
        angles = checked_angles(theta_i, phi_i, theta_r, phi_r)
        low, weight, wavelength_shape = self._wavelengths(wavelength_nm)
        if self.anisotropic:
            phis = np.remainder(angles.phi_i, 2.0 * np.pi), np.remainder(angles.phi_r, 2.0 * np.pi)
            axes = [radians(self.axes_deg[name]) for name in ANISOTROPIC_AXES]
        else:
            phis = np.zeros(()), fold_delta_phi(angles.phi_r - angles.phi_i)
            theta_axis, theta_r_axis, delta_phi_axis = (radians(nodes) for nodes in self.axes_deg.values())
            axes = [theta_axis, np.zeros(1), theta_r_axis, delta_phi_axis]
        points = np.broadcast_arrays(angles.theta_i, phis[0], angles.theta_r, phis[1])
        shape = points[0].shape
        values = np.empty((points[0].size, weight.size))
        table = self.brdf.reshape(*(nodes.size for nodes in axes), -1)
        _interpolate(tuple(axes), table, tuple(np.ravel(p) for p in points), low, weight, values)
        return finished(values.reshape(*shape, weight.size), angles, trailing=1).reshape(shape + wavelength_shape)[()]

    def specular_reflectance(self, theta_i: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Interpolate the reflectance of the Dirac part; 0 for models that have none.

        Parameters
        ----------
        theta_i : array_like [rad]
            Angle of incidence, in [0, pi].
        wavelength_nm : float or array_like (M,) [nm], optional
            As in `lookup`.

        Returns
        -------
        array [1]
            Shaped as by `lookup`.

        Raises
        ------
        ValueError
            If theta_i or a wavelength is outside its range.
        """
        angles = checked_angles(theta_i, 0.0, 0.0, 0.0)
        low, weight, wavelength_shape = self._wavelengths(wavelength_nm)
        values = np.zeros((*angles.theta_i.shape, weight.size))
        if self.specular is not None:
            table = self.specular.reshape(self.specular.shape[0], -1).astype(np.float64)
            upper = np.minimum(low + 1, table.shape[1] - 1)
            table = (1.0 - weight) * table[:, low] + weight * table[:, upper]
            nodes = radians(self.axes_deg["theta_i"])
            position = np.interp(angles.theta_i, nodes, np.arange(nodes.size))  # nan stays nan
            at = np.minimum(np.nan_to_num(position).astype(np.int64), nodes.size - 2)
            share = (position - at)[..., np.newaxis]
            values = (1.0 - share) * table[at] + share * table[at + 1]
        shape = angles.theta_i.shape
        return finished(values, angles, trailing=1).reshape(shape + wavelength_shape)[()]

    def _wavelengths(
        self, wavelength_nm: ArrayLike | None
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], tuple[int, ...]]:
        """Lower node and weight of the upper one for each wavelength asked for, and the shape they add."""
        stored = self.wavelength_nm
        if wavelength_nm is None:
            count = 1 if stored is None else stored.size
            return np.arange(count), np.zeros(count), () if stored is None else (count,)
        given = np.asarray(wavelength_nm)
        if given.size and given.dtype.kind not in "iuf":
            raise ValueError(f"wavelength_nm: {wavelength_nm!r} is not a number of nanometres")
        wanted = given.astype(np.float64)
        if wanted.ndim > 1:
            raise ValueError(f"wavelength_nm: {wanted.ndim} axes; allowed are a number and a list of numbers")
        flat = wanted.reshape(-1)
        good = (flat > 0.0) & np.isfinite(flat)
        if not np.all(good):
            raise ValueError(f"wavelength_nm: {flat[~good][0]:g} is not a positive number of nanometres")
        if stored is None:
            return np.zeros(flat.size, dtype=np.int64), np.zeros(flat.size), wanted.shape
        outside = (flat < stored[0]) | (flat > stored[-1])
        if np.any(outside):
            raise ValueError(
                f"wavelength_nm: {flat[outside][0]:.9g} is outside [{stored[0]:g}, {stored[-1]:g}] nm of {self.name}"
            )
        low = np.searchsorted(stored, flat, side="right") - 1
        step = stored[np.minimum(low + 1, stored.size - 1)] - stored[low]
        weight = np.divide(flat - stored[low], step, out=np.zeros(flat.size), where=step > 0.0)
        return low, weight, wanted.shape


@kernel
def _bracket(nodes: NDArray[np.float64], x: float) -> tuple[int, float]:
    """Index of the node at or below x and the weight of the next one; outside the nodes, the end node alone."""
    last = nodes.size - 1
    if not x > nodes[0]:
        return 0, 0.0
    if x >= nodes[last]:
        return last, 0.0
    low, high = 0, last
    while high - low > 1:
        middle = (low + high) // 2
        if nodes[middle] <= x:
            low = middle
        else:
            high = middle
    return low, (x - nodes[low]) / (nodes[low + 1] - nodes[low])


@kernel
def _interpolate(
    nodes: tuple[NDArray[np.float64], ...],
    table: NDArray[np.float32],
    points: tuple[NDArray[np.float64], ...],
    low: NDArray[np.int64],
    weight: NDArray[np.float64],
    values: NDArray[np.float64],
) -> None:
    """Multilinear over the four angles and the wavelength. An isotropic table has one phi_i node and delta_phi last."""
    index = np.empty((4, 2), np.int64)
    share = np.empty((4, 2))
    for point in range(values.shape[0]):
        for axis in range(4):
            at, upper = _bracket(nodes[axis], points[axis][point])
            index[axis, 0] = at
            index[axis, 1] = min(at + 1, table.shape[axis] - 1)
            share[axis, 0] = 1.0 - upper
            share[axis, 1] = upper
        for m in range(low.size):
            values[point, m] = 0.0
        for corner in range(16):
            a, b, c, d = corner & 1, (corner >> 1) & 1, (corner >> 2) & 1, corner >> 3
            factor = share[0, a] * share[1, b] * share[2, c] * share[3, d]
            if factor == 0.0:
                continue
            row = table[index[0, a], index[1, b], index[2, c], index[3, d]]
            for m in range(low.size):
                value = np.float64(row[low[m]])
                if weight[m] > 0.0:
                    value += weight[m] * (np.float64(row[low[m] + 1]) - value)
                values[point, m] += factor * value
