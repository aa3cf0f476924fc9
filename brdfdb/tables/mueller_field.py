"""Measured polarisation of a table: normalised Mueller elements over half and difference vectors, beside f_r.

The matrices of a measured surface depend on all angles, and need not be those of a facet. Nodes hold convex sums of
measured matrices, and lookups are linear in angles and wavelength: where all measured matrices are physical, so are
those of the table. With rows and columns I, Q and U or more, elements are between bases of the plane of light and
viewer, in which they change slowly. The block of I and Q alone, as measured by polarisers, cannot be turned: it is
between bases of the surface, to which polarisers are aligned.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import radians, unit_vector
from brdfdb.measurements.mueller import (
    BLOCKS,
    HalfDifferenceAngles,
    block_of,
    convex_weights,
    elements_of,
    half_difference_angles,
    mirrored,
    physical_share,
)
from brdfdb.measurements.samples import Samples
from brdfdb.parameters import Floats
from brdfdb.tables import stokes
from brdfdb.tables.grids import Located
from brdfdb.tables.stokes import MeasuredElements, Polarisation

AXES = ("mueller_theta_h", "mueller_theta_d", "mueller_phi_d")
_THETA_H_DEG = np.array([0.0, 1.0, 2.0, 3.5, 5.0, 7.5, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0, 60.0, 75.0, 90.0])
_THETA_D_DEG = np.append(np.arange(0.0, 30.0, 5.0), np.arange(30.0, 90.1, 2.5))
_PHI_D_DEG = np.arange(0.0, 180.1, 30.0)
_TURNED = "its lights have several azimuths, and polarised tables of measured data are isotropic"
_COLOURS = "its channels are colours; a polarised table needs wavelengths, or one channel"
_CORNERS = 8  # of a cell of the grid
_OF_POLARISERS = ("m01", "m10", "m11")  # elements that are between bases of the surface
_FEWEST = 4  # samples with all elements
_COMPARED = 2000  # samples at which a table is compared with them
_PARTS = 10  # in which samples are held out, where lights are scattered
_MOST_LIGHTS = 100
_P99_OF_MEDIAN = 3.819  # 99th percentile of the magnitude of normal noise over its median
_SEED = 1941  # of Jones' first paper


@dataclass(frozen=True, eq=False)
class MuellerField:
    """Measured Mueller matrices of a table in memory, at nodes of theta_h, theta_d and phi_d.

    `axes_deg` are the nodes (H,), (D,) and (P,) [degree]. `elements` (H, D, P, L, E) are m_ij / m_00 in the order of
    `names` (E,). phi_d ends at 180 if mirror images are the same, else at 360. `wavelength_nm` (L,) is None of a grey
    table, whose L is 1.
    """

    axes_deg: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
    elements: NDArray[np.float32]
    names: tuple[str, ...]
    wavelength_nm: NDArray[np.float64] | None
    record: Polarisation | None = None

    @property
    def nbytes(self) -> int:
        """Size [byte] of the arrays."""
        return self.elements.nbytes + sum(axis.nbytes for axis in self.axes_deg)

    @property
    def of_plane(self) -> bool:
        """True if the bases are those of the plane of light and viewer, False if they are those of the surface."""
        return len(self.names) > len(_OF_POLARISERS)

    def in_plane(self, w_i: Floats, w_r: Floats, _f_r: Floats, located: Located) -> NDArray[np.float64]:
        """Return m_ij / m_00 between bases of the plane, (..., M, 4, 4), at unit vectors (..., 3).

        Elements that were not measured are nan. ParameterError if only the block of I and Q was measured.
        """
        if not self.of_plane:
            text = "the table holds the rows and columns I and Q between bases of the surface; use table.mueller"
            raise ParameterError("polarised", text)
        return self.between_bases(w_i, w_r, located)

    def of_surface(self, angles: tuple[ArrayLike, ...], _f_r: Floats, located: Located) -> NDArray[np.float64]:
        """Return m_ij / m_00 between bases of the surface, (..., M, 4, 4), at four angles [rad]; else as `in_plane`."""
        theta_i, phi_i, theta_r, phi_r = np.broadcast_arrays(*(np.asarray(angle, np.float64) for angle in angles))
        matrix = self.between_bases(unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r), located)
        if not self.of_plane:
            return matrix
        plane = stokes.plane(theta_i, phi_i, theta_r, phi_r)
        return _turned(plane.viewer, matrix, plane.light)

    def between_bases(self, w_i: Floats, w_r: Floats, located: Located) -> NDArray[np.float64]:
        """Return the matrices between the bases of the field, as `in_plane`; linear in angles and wavelengths."""
        shape = w_i.shape[:-1]
        flat = (np.nan_to_num(w).reshape(-1, 3) for w in (w_i, w_r))
        angles = half_difference_angles(*flat)
        folds = self.axes_deg[2][-1] == 180.0
        image = (angles.phi_d < 0.0) & folds
        angles = angles.folded if folds else angles._replace(phi_d=angles.phi_d % (2.0 * np.pi))
        few = _CORNERS * len(angles.theta_h) < self.elements[..., 0, 0].size  # the shorter way takes wavelengths last
        rows = self.elements if few else self._of_wavelengths(self.elements, located)
        values = np.zeros((len(angles.theta_h), rows.shape[-2], len(self.names)))
        corners = []
        for nodes_deg, angle in zip(self.axes_deg, angles, strict=True):
            nodes = radians(nodes_deg)
            below = np.clip(np.searchsorted(nodes, angle, side="right") - 1, 0, nodes.size - 2)
            part = np.clip((angle - nodes[below]) / (nodes[below + 1] - nodes[below]), 0.0, 1.0)
            corners.append(((below, 1.0 - part), (below + 1, part)))
        for corner in itertools.product(*corners):
            weight = np.prod([part for _, part in corner], axis=0)
            values += weight[:, np.newaxis, np.newaxis] * rows[tuple(at for at, _ in corner)]
        values = self._of_wavelengths(values, located) if few else values
        matrix = np.full((*values.shape[:2], 4, 4), np.nan)
        matrix[..., 0, 0] = 1.0
        for number, name in enumerate(self.names):
            matrix[..., int(name[1]), int(name[2])] = values[..., number]
        matrix[image] = mirrored(matrix[image])
        return np.asarray(matrix.reshape(*shape, located.size, 4, 4))

    def _of_wavelengths(self, elements: NDArray[Any], located: Located) -> NDArray[np.float64]:
        """Return elements (..., L, E) at the wavelengths of a lookup, (..., M, E), on lines between those known.

        Weights of cubics sum to the wavelength itself, and are negative in places: convex sums of matrices need lines.
        """
        nm = self.wavelength_nm
        if nm is None or nm.size == 1:
            return np.repeat(elements[..., :1, :], located.size, axis=-2).astype(np.float64)
        wanted = np.clip(np.einsum("mk,mk->m", nm[located.nodes], located.weight), nm[0], nm[-1])
        below = np.clip(np.searchsorted(nm, wanted, side="right") - 1, 0, nm.size - 2)
        part = ((wanted - nm[below]) / (nm[below + 1] - nm[below]))[:, np.newaxis]
        return np.asarray(elements[..., below, :] * (1.0 - part) + elements[..., below + 1, :] * part)


def field_of(samples: Samples, *, chiral: bool = False) -> MuellerField:
    """Return the Mueller matrices of samples at the nodes of a table, with the record of what was measured.

    Parameters
    ----------
    samples : Samples
        Samples with `mueller`, of one azimuth of the light.
    chiral : bool
        True if f_r is not the same for the mirror image: matrices of mirror images are then kept apart.

    Raises
    ------
    ParameterError
        If the polarisation was not measured, elements are missing, the channels are colours, the lights have several
        azimuths, or fewer than four samples have all elements.
    """
    check_polarised(samples)
    assert samples.mueller is not None
    rows, columns = block_of(samples.mueller)
    names = elements_of(rows, columns)
    scattered = _scattered(samples, names, chiral=chiral)
    phi_d_deg = np.append(_PHI_D_DEG, 360.0 - _PHI_D_DEG[-2::-1]) if chiral else _PHI_D_DEG
    axes_deg = (_THETA_H_DEG, _THETA_D_DEG, phi_d_deg)
    nodes = HalfDifferenceAngles(*(radians(grid).ravel() for grid in np.meshgrid(*axes_deg, indexing="ij")))
    shape = (*(axis.size for axis in axes_deg), *scattered.elements.shape[1:])
    stored = scattered.at(nodes.places).astype(np.float32).reshape(shape)
    nm = None if samples.wavelength_nm is None else np.sort(samples.wavelength_nm)
    field = MuellerField(axes_deg, stored, names, nm)

    some = np.sort(np.random.default_rng(_SEED).permutation(len(samples))[:_COMPARED])
    number = np.arange(stored.shape[3])  # all wavelengths, as a lookup finds them
    located = Located(number[:, np.newaxis], np.ones((number.size, 1)), number, (number.size,))
    looked_up = field.between_bases(samples.w_i[some], samples.w_r[some], located)
    if not chiral:
        image = half_difference_angles(samples.w_i[some], samples.w_r[some]).phi_d < 0.0
        looked_up[image] = mirrored(looked_up[image])
    of_table = np.abs(_listed(looked_up, names) - scattered.elements[some])
    parts = np.random.default_rng(_SEED).integers(0, _PARTS, len(samples))
    at_random = scattered.held_out(parts)
    of_lights = scattered.held_out(_inner_lights(samples)) if scattered.lights > 1 else at_random
    share = physical_share(samples)
    measured = MeasuredElements(
        rows=rows,
        columns=columns,
        samples=int(np.count_nonzero(scattered.known.any(axis=1))),
        table_p99=_rounded_up(of_table),
        held_out_p99=None if of_lights is None else _rounded_up(of_lights),
        noise=_rounded_up(_P99_OF_MEDIAN * (of_table if at_random is None else at_random), 50.0),
        physical=float(f"{share.share:.4g}"),
        stokes=float(f"{share.stokes_share:.4g}"),
        statement=[str(text) for text in samples.record.get("physical") or share.sentences()],
    )
    return replace(field, record=stokes.measured_record(names, measured))


class _Scattered(NamedTuple):
    """Elements (N, L, E) of samples at `places` (N, 3) [rad], which of them are `known` (N, L), and `groups` (N,).

    Neighbours are looked for in groups, which are the lights, or one if lights are scattered.
    """

    places: Floats
    elements: Floats
    known: NDArray[np.bool_]
    groups: NDArray[np.int64]

    @property
    def lights(self) -> int:
        """Number of lights; 1 if they are scattered."""
        return int(np.unique(self.groups).size)

    def selected(self, rows: NDArray[np.bool_]) -> _Scattered:
        """Return some of the samples."""
        return _Scattered(self.places[rows], self.elements[rows], self.known[rows], self.groups[rows])

    def at(self, wanted: Floats) -> Floats:
        """Return convex sums (W, L, E) of the elements at other places (W, 3); ParameterError of too few samples."""
        values = np.empty((len(wanted), *self.elements.shape[1:]))
        patterns, of_channel = np.unique(self.known, axis=1, return_inverse=True)
        for number, pattern in enumerate(patterns.T):
            rows = np.flatnonzero(pattern)
            if rows.size < _FEWEST:
                text = f"{rows.size} samples have all elements; at least {_FEWEST} are needed"
                raise ParameterError("polarised", text)
            channels = np.flatnonzero(of_channel.reshape(-1) == number)
            neighbours, weight = convex_weights(self.places[rows], self.groups[rows], wanted)
            values[:, channels] = np.einsum("nk,nkle->nle", weight, self.elements[rows][:, channels][neighbours])
        return values

    def held_out(self, parts: NDArray[np.int64]) -> Floats | None:
        """Return the errors (..., E) at samples of parts (N,) that are left out; None if there is nothing to leave out.

        Samples of a part below 0 are never left out.
        """
        rng = np.random.default_rng(_SEED)
        numbers = np.unique(parts[parts >= 0])
        errors = []
        for number in numbers:
            left = np.flatnonzero(parts == number)
            left = left[rng.permutation(left.size)[: _COMPARED // numbers.size + 1]]
            others = self.selected(parts != number)
            if others.known.sum(axis=0).min() >= _FEWEST:
                errors.append(np.abs(others.at(self.places[left]) - self.elements[left]))
        return np.concatenate(errors) if errors else None


def _inner_lights(samples: Samples) -> NDArray[np.int64]:
    """Return the numbers of the lights of samples (N,), -1 of the lowest and the highest, which no others surround."""
    number = samples.incidence
    theta_i = np.bincount(number, samples.theta_i) / np.bincount(number)
    return np.where(np.isin(number, (np.argmin(theta_i), np.argmax(theta_i))), -1, number)


def _scattered(samples: Samples, names: Sequence[str], *, chiral: bool) -> _Scattered:
    """Return the elements of samples between the bases of a field, wavelengths in order and mirror images folded."""
    assert samples.mueller is not None
    matrix = samples.mueller
    if samples.wavelength_nm is not None:
        matrix = matrix[:, np.argsort(samples.wavelength_nm)]
    if len(names) > len(_OF_POLARISERS):
        plane = stokes.plane(samples.theta_i, samples.phi_i, samples.theta_r, samples.phi_r)
        matrix = _turned(np.swapaxes(plane.viewer, -1, -2), matrix, np.swapaxes(plane.light, -1, -2))
    angles = half_difference_angles(samples.w_i, samples.w_r)
    if not chiral:
        matrix = np.where((angles.phi_d < 0.0)[:, np.newaxis, np.newaxis, np.newaxis], mirrored(matrix), matrix)
        angles = angles.folded
    elements = _listed(matrix, names)
    known: NDArray[np.bool_] = np.all(np.isfinite(elements), axis=-1)
    groups = samples.incidence if samples.incidence.max() < _MOST_LIGHTS else np.zeros(len(samples), np.int64)
    return _Scattered(angles.places, elements, known, groups)


def _listed(matrix: Floats, names: Sequence[str]) -> Floats:
    """Return the elements (..., E) of matrices (..., 4, 4) in the order of their names."""
    return np.stack([matrix[..., int(name[1]), int(name[2])] for name in names], axis=-1)


def to_surface(samples: Samples) -> Samples:
    """Return samples with `mueller` between bases of the surface, of ones between those of light and viewer's plane."""
    if samples.mueller is None:
        return samples
    plane = stokes.plane(samples.theta_i, samples.phi_i, samples.theta_r, samples.phi_r)
    return replace(samples, mueller=_turned(plane.viewer, samples.mueller, plane.light))


def _turned(viewer: Floats, matrix: Floats, light: Floats) -> NDArray[np.float64]:
    """Return matrices (..., L, 4, 4) between other bases, by rotations (..., 4, 4); what is unknown stays so."""
    turned = viewer[..., np.newaxis, :, :] @ np.nan_to_num(matrix) @ light[..., np.newaxis, :, :]
    turned[np.isnan(matrix)] = np.nan
    return np.asarray(turned)


def check_polarised(samples: Samples) -> None:
    """Raise ParameterError if no polarised table can be made of samples; as of `field_of`."""
    if samples.mueller is None:
        text = f"{samples.name} has no polarised values; known are the columns ss, sp, ps and pp, the elements of "
        raise ParameterError("polarised", f"{text}Mueller matrices (m00 to m33, M11 to M44), and .pbsdf files")
    block_of(samples.mueller, samples.record.get("polarised_columns", ""))
    if samples.turned:
        raise ParameterError("polarised", _TURNED)
    if samples.wavelength_nm is None and samples.values.shape[1] > 1:
        raise ParameterError("polarised", _COLOURS)


def _rounded_up(errors: Floats, percentile: float = 99.0) -> float:
    """Return a percentile of errors (..., E) of the worst element, to three digits, rounded up."""
    worst = np.nanpercentile(errors.reshape(-1, errors.shape[-1]), percentile, axis=0).max()
    return float(f"{1.00501 * worst:.3g}")


def checked_field(
    arrays: Mapping[str, NDArray[Any]], wavelength_nm: NDArray[np.float64] | None, record: Polarisation | None
) -> MuellerField | None:
    """Return the measured polarisation among stored arrays; None without it, ParameterError if arrays do not fit."""
    if AXES[0] not in arrays:
        return None
    missing = [name for name in ("mueller", *AXES) if name not in arrays]
    if missing or record is None:
        raise ParameterError("mueller", f"it needs {', '.join(missing) or 'the attribute polarisation'}")
    axes = tuple(np.asarray(arrays[name], np.float64) for name in AXES)
    for name, axis in zip(AXES, axes, strict=True):
        ends = (180.0, 360.0) if name == AXES[2] else (90.0,)
        if axis.size < 2 or np.any(np.diff(axis) <= 0.0) or axis[0] != 0.0 or axis[-1] not in ends:
            text = f"it does not ascend from 0 to {' or '.join(f'{end:g}' for end in ends)} degrees"
            raise ParameterError(name, text)
    elements = arrays["mueller"]
    if wavelength_nm is None:
        elements = elements[..., np.newaxis, :]
    expected = (*(axis.size for axis in axes), 1 if wavelength_nm is None else wavelength_nm.size, len(record.elements))
    if elements.shape != expected:
        raise ParameterError("mueller", f"shape {elements.shape} is not {expected}, of its axes")
    names = tuple(record.elements)
    if names not in [elements_of(rows, columns) for rows, columns in BLOCKS]:
        raise ParameterError("mueller", f"the elements {', '.join(names)} are no block of a Mueller matrix", names)
    return MuellerField((axes[0], axes[1], axes[2]), elements, names, wavelength_nm, record)
