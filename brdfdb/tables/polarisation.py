"""Polarisation of a table: Mueller matrices beside f_r, from the three elements that symmetry leaves of sixteen.

A facet mirrors light to viewer in the plane of both. Between bases of that plane, its Mueller matrix over its first
element is a function of theta_d alone, half the angle between light and viewer::

    1    m01  0     0
    m01  1    0     0
    0    0    m22   m23
    0    0   -m23   m22

A mirror image of the plane leaves the surface the same, which makes eight elements 0. Amplitudes of s and p, of one
reflection, make the other pairs equal. The uniform part of f_r is depolarised: only [0, 0] of its matrix is not 0. A
polarised table stores the three elements over theta_d and wavelength, and the depolarised part. The rest is geometry.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import radians
from brdfdb.materials import Source
from brdfdb.materials.polarised import polarised_source
from brdfdb.parameters import Floats
from brdfdb.tables import stokes
from brdfdb.tables._interpolation import weights_of_nodes
from brdfdb.tables.grids import Located
from brdfdb.tables.layout import Layout
from brdfdb.tables.stokes import ELEMENTS

GRID_TOLERANCE = 1e-3  # of the elements, where a recipe gives grids and no tolerance
_SHARE = 0.5  # of the tolerance is for the elements of the facet: the share of light that is depolarised takes the rest
_FIRST_DEG = np.linspace(0.0, 90.0, 10)
_MOST_NODES = 10_000
_WITHIN_CELL = np.array([0.25, 0.5, 0.75])  # where a cell between nodes is measured


@dataclass(frozen=True, eq=False)
class MuellerFacets:
    """The polarisation of a table in memory, at nodes (T,) of theta_d from 0 to 90 degrees.

    `elements` (T, L, 3) are m01, m22 and m23 over m00 of the facet, between bases of the plane of light and viewer.
    `depolarised` (1,) or (L,) [1/sr] is the depolarised part of f_r.
    """

    theta_d_deg: NDArray[np.float64]
    elements: NDArray[np.float32]
    depolarised: NDArray[np.float64]

    @property
    def nbytes(self) -> int:
        """Size [byte] of the arrays."""
        return self.elements.nbytes + self.depolarised.nbytes + self.theta_d_deg.nbytes

    def facet(self, theta_d: Floats, located: Located) -> NDArray[np.float64]:
        """Return the matrix of the facet over its first element at theta_d [rad], (...), shape (..., M, 4, 4)."""
        flat = np.clip(np.asarray(theta_d, np.float64), 0.0, np.pi / 2.0).reshape(-1)
        nodes, weight = weights_of_nodes(radians(self.theta_d_deg), flat)
        # few nodes and wavelengths: all wavelengths of the lookup first, then the angles
        rows = np.einsum("tmke,mk->tme", self.elements[:, located.nodes], located.weight)
        values = np.einsum("nkme,nk->nme", rows[nodes], weight)
        m01, m22, m23 = np.moveaxis(values.reshape(*theta_d.shape, located.size, 3), -1, 0)
        matrix = np.zeros((*m01.shape, 4, 4))
        matrix[..., 0, 0] = matrix[..., 1, 1] = 1.0
        matrix[..., 0, 1] = matrix[..., 1, 0] = m01
        matrix[..., 2, 2] = matrix[..., 3, 3] = m22
        matrix[..., 2, 3], matrix[..., 3, 2] = m23, -m23
        return matrix

    def depolarised_at(self, located: Located) -> NDArray[np.float64]:
        """Return the depolarised part of f_r [1/sr], shape (M,)."""
        uniform = np.broadcast_to(self.depolarised, (self.elements.shape[1],))
        return np.asarray(np.einsum("mk,mk->m", uniform[located.nodes], located.weight))

    def polarising(self, f_r: Floats, located: Located) -> NDArray[np.float64]:
        """Return the share [0, 1] of f_r (..., M) that is not depolarised; 1 where f_r is 0."""
        share = np.divide(self.depolarised_at(located), f_r, out=np.zeros(np.shape(f_r)), where=f_r > 0.0)
        return np.asarray(1.0 - np.clip(share, 0.0, 1.0))

    def in_plane(self, w_i: Floats, w_r: Floats, f_r: Floats, located: Located) -> NDArray[np.float64]:
        """Return m_ij / m_00 between bases of the plane, (..., M, 4, 4), at unit vectors (..., 3) and f_r (..., M)."""
        return self._with_share(self.facet(stokes.half_angle(w_i, w_r), located), f_r, located)

    def of_surface(self, angles: tuple[ArrayLike, ...], f_r: Floats, located: Located) -> NDArray[np.float64]:
        """Return m_ij / m_00 between bases of the surface, (..., M, 4, 4), at four angles [rad] and f_r (..., M)."""
        plane = stokes.plane(*angles)
        light = plane.light[..., np.newaxis, :, :]
        viewer = plane.viewer[..., np.newaxis, :, :]
        turned = viewer @ self.facet(plane.theta_d, located) @ light
        return self._with_share(turned, f_r, located)

    def _with_share(self, matrix: NDArray[np.float64], f_r: Floats, located: Located) -> NDArray[np.float64]:
        matrix = matrix * self.polarising(f_r, located)[..., np.newaxis, np.newaxis]
        matrix[..., 0, 0] = 1.0
        return matrix


def facets_of(layout: Layout) -> MuellerFacets | None:
    """Return the polarisation that a layout asks for; None if its table is unpolarised."""
    if layout.facet_theta_d_deg is None:
        return None
    assert layout.wavelength_nm is not None  # of all models with Mueller matrices
    source = polarised_source(layout.source)
    elements = _elements(layout.source, radians(layout.facet_theta_d_deg), layout.wavelength_nm).astype(np.float32)
    return MuellerFacets(layout.facet_theta_d_deg, elements, source.depolarised(layout.wavelength_nm))


def _elements(source: Source, theta_d: Floats, wavelength_nm: NDArray[np.float64]) -> Floats:
    """Return m01, m22 and m23 over m00 of the facet, shape (N, L, 3)."""
    matrix = polarised_source(source).facet(theta_d, wavelength_nm)
    return np.stack([matrix[..., 0, 1], matrix[..., 2, 2], matrix[..., 2, 3]], axis=-1)


def planned_theta_d(source: Source, wavelength_nm: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
    """Return the nodes [degree] of theta_d at which no element of the facet is off by more than half a tolerance.

    Cells between nodes, in which cubic interpolation is off by more, are halved until none is. ParameterError if the
    source has no Mueller matrices, or the tolerance takes more than 10 000 nodes.
    """
    nodes = _FIRST_DEG
    while True:
        values = _elements(source, radians(nodes), wavelength_nm)
        cells = nodes[:-1, np.newaxis] + np.diff(nodes)[:, np.newaxis] * _WITHIN_CELL
        at, weight = weights_of_nodes(radians(nodes), radians(cells.ravel()))
        between = np.einsum("nkle,nk->nle", values[at], weight)
        wrong = np.abs(between - _elements(source, radians(cells.ravel()), wavelength_nm))
        split = wrong.reshape(*cells.shape, -1).max(axis=(1, 2)) > _SHARE * tolerance
        if not split.any():
            return nodes
        nodes = np.sort(np.concatenate([nodes, cells[split, 1]]))
        if nodes.size > _MOST_NODES:
            raise ParameterError(
                "tolerance", f"{tolerance:g} takes more than {_MOST_NODES} angles of the facet", tolerance
            )


def checked_facets(arrays: Mapping[str, NDArray[Any]], wavelengths: int) -> MuellerFacets | None:
    """Return the polarisation among stored arrays; None without it, ParameterError if the arrays do not fit."""
    if "mueller" not in arrays:
        return None
    elements, theta_d_deg, depolarised = (arrays.get(key) for key in ("mueller", "mueller_theta_d", "depolarised"))
    if elements is None or theta_d_deg is None or depolarised is None:
        raise ParameterError("mueller", "it needs the arrays mueller_theta_d and depolarised")
    ascending = theta_d_deg.size > 1 and bool(np.all(np.diff(theta_d_deg) > 0.0))
    if not ascending or theta_d_deg[0] != 0.0 or theta_d_deg[-1] != 90.0:
        raise ParameterError("mueller_theta_d", "it does not ascend from 0 to 90 degrees")
    if elements.shape != (theta_d_deg.size, wavelengths, len(ELEMENTS)):
        expected = (theta_d_deg.size, wavelengths, len(ELEMENTS))
        raise ParameterError("mueller", f"shape {elements.shape} is not {expected}, of its axes")
    if depolarised.size not in (1, wavelengths):
        raise ParameterError("depolarised", f"{depolarised.size} values are neither one nor one for each wavelength")
    return MuellerFacets(theta_d_deg, elements, np.atleast_1d(depolarised).astype(np.float64))
