"""The result of reading a file whose tools know f_r between its values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.arrays import array_lookup
from brdfdb.errors import ParameterError
from brdfdb.formats._record import note
from brdfdb.geometry import checked_angles, checked_vectors, finished, unit_vector
from brdfdb.materials.source import FourAngles, Lookups
from brdfdb.parameters import Floats, check_nanometres
from brdfdb.tables.table_base import Stated

if TYPE_CHECKING:
    from brdfdb.measurements.samples import Samples

_RANGE_NM = (10.0, 1e6)
_OPPOSITE = np.array([-1.0, -1.0, 1.0])

Reading = TypeVar("Reading", "FileTable", "Samples")


@dataclass(frozen=True, eq=False)
class FileTable(Lookups):
    """f_r of a file, evaluated as the tool that reads the format evaluates it.

    Attributes
    ----------
    name : str
        Name of the material, or of the file.
    channels : tuple of str
        As of `Channels`: ("R", "G", "B"), ("X", "Y", "Z"), ("grey",), or wavelengths.
    wavelength_nm : array (L,) [nm] or None
        Wavelengths of the channels; None of colours and of grey files.
    evaluate : callable
        Gives f_r [1/sr], shape (N, C), at unit vectors (N, 3) of light and viewer above the horizon.
    record : mapping
        The record in the file or next to it; empty for files of other programs.
    nodes : callable or None
        Gives the values of the file at their own directions above the horizon, unaltered; None of a formula.
    listed : bool
        True if the file lists the directions that were measured, which may leave some out: f_r there is extrapolated.
    """

    name: str
    channels: tuple[str, ...]
    wavelength_nm: NDArray[np.float64] | None
    evaluate: Callable[[Floats, Floats], Floats] = field(repr=False)
    record: Mapping[str, Any] = field(default_factory=dict, repr=False)
    nodes: Callable[[], Samples] | None = field(default=None, repr=False)
    listed: bool = False

    @array_lookup
    def lookup_vectors(self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Return f_r [1/sr] for unit vectors: a last axis for the channels, or for the wavelengths that are given."""
        vectors = checked_vectors(wi, wr)
        shape = np.broadcast_shapes(vectors.w_i.shape, vectors.w_r.shape)
        flat = [np.broadcast_to(w, shape).reshape(-1, 3).astype(np.float64) for w in (vectors.w_i, vectors.w_r)]
        above = (flat[0][:, 2] > 0.0) & (flat[1][:, 2] > 0.0)
        values: Floats = np.zeros((len(above), len(self.channels)))
        values[above] = self.evaluate(flat[0][above], flat[1][above])
        values = values.reshape(*shape[:-1], len(self.channels))
        if self.wavelength_nm is None and len(self.channels) == 1:
            values = values[..., 0]
        elif self.wavelength_nm is not None and wavelength_nm is not None:
            nodes, share = self._around(wavelength_nm)
            values = values[..., nodes[..., 0]] * (1.0 - share) + values[..., nodes[..., 1]] * share
        return finished(values, vectors, trailing=values.ndim - len(shape) + 1)

    @array_lookup
    def lookup_vectors_with_error(self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Stated:
        """Return f_r [1/sr] as `lookup_vectors`, and the error [1/sr] that the file states for each value.

        Raises
        ------
        ParameterError
            If the file states no error, or none between its wavelengths.
        """
        from brdfdb.formats._stated_error import FileStatement

        statement = FileStatement.read(self.record, self.name)
        brdf = self.lookup_vectors(wi, wr, wavelength_nm)
        at = self.wavelength_nm
        directions = checked_vectors(wi, wr)
        shape = np.broadcast_shapes(np.shape(wi), np.shape(wr))[:-1]
        values = np.asarray(brdf).reshape(*shape, -1)
        if at is None or wavelength_nm is None:
            error = statement.error(directions, values)
        else:
            nodes, share = self._around(wavelength_nm)
            error = statement.error(directions, values, nodes.reshape(-1, 2), np.ravel((share == 0.0) | (share == 1.0)))
        return Stated(brdf, error.reshape(np.shape(brdf))[()])

    def _at_angles(self, angles: FourAngles, wavelength_nm: ArrayLike | None) -> Floats:
        given = checked_angles(*angles)
        wi, wr = unit_vector(given.theta_i, given.phi_i), unit_vector(given.theta_r, given.phi_r)
        values = np.asarray(self.lookup_vectors(wi, wr, wavelength_nm))
        return finished(values, given, trailing=values.ndim - np.broadcast(*given.given).ndim)

    def _around(self, wavelength_nm: ArrayLike) -> tuple[NDArray[np.int64], Floats]:
        """Return the two channels next to wavelengths [nm], shape (..., 2), and the place between them in [0, 1]."""
        stored = self.wavelength_nm
        wanted = check_nanometres("wavelength_nm", wavelength_nm)
        assert stored is not None
        if not np.all((wanted >= stored[0]) & (wanted <= stored[-1])):
            raise ParameterError(
                "wavelength_nm", f"{wanted.tolist()} is outside [{stored[0]:g}, {stored[-1]:g}] nm", wavelength_nm
            )
        below = np.clip(np.searchsorted(stored, wanted, side="right") - 1, 0, max(stored.size - 2, 0))
        above = np.minimum(below + 1, stored.size - 1)
        width = np.where(above > below, stored[above] - stored[below], 1.0)
        return np.stack([below, above], axis=-1), (wanted - stored[below]) / width


def from_forward(reading: FileTable | Samples) -> FileTable | Samples:
    """Return f_r of a file whose azimuth of the light is the one into which it travels: 180 degrees from the light."""
    from brdfdb.measurements.samples import Samples

    if isinstance(reading, Samples):
        return _turned(reading)
    evaluate = reading.evaluate
    nodes = reading.nodes

    def turned(wi: Floats, wr: Floats) -> Floats:
        return evaluate(wi * _OPPOSITE, wr)

    return replace(reading, evaluate=turned, nodes=None if nodes is None else lambda: _turned(nodes()))


def _turned(samples: Samples) -> Samples:
    """Return samples with the light on the other side; azimuths that are relative to it stay so."""
    from brdfdb.measurements.samples import RELATIVE

    of = "phi_r" if samples.record.get("azimuths") == RELATIVE else "phi_i"
    changed: dict[str, Any] = {of: (getattr(samples, of) + np.pi) % (2.0 * np.pi)}
    return replace(samples, **changed, record={**samples.record, "azimuth": "forward"})


def check_wavelength(wavelength_nm: float) -> None:
    """Raise ParameterError if a wavelength [nm] that a user states is outside [10, 1e6] nm."""
    low, high = _RANGE_NM
    if not low <= wavelength_nm <= high:
        raise ParameterError(
            "wavelength_nm", f"{wavelength_nm:g} is outside [{low:g}, {high:g}] nm", wavelength_nm, _RANGE_NM
        )


def at_wavelength(reading: FileTable | Samples, wavelength_nm: float) -> FileTable | Samples:
    """Return f_r of a file that gives no wavelength, with the one [nm] that the user states.

    Raises
    ------
    ParameterError
        If the wavelength is outside [10, 1e6] nm, or the file states a wavelength or colours.
    """
    check_wavelength(wavelength_nm)
    from brdfdb.measurements.samples import Samples

    if isinstance(reading, Samples):
        return _named(reading, wavelength_nm)
    nodes = reading.nodes
    named = _named(reading, wavelength_nm)
    return named if nodes is None else replace(named, nodes=lambda: _named(nodes(), wavelength_nm))


def _named(reading: Reading, wavelength_nm: float) -> Reading:
    """Return f_r of one channel at a wavelength [nm]; ParameterError if it states its channels."""
    if reading.channels != ("grey",) or reading.wavelength_nm is not None:
        text = f"{reading.name} states its own: {', '.join(reading.channels)[:100]}; leave it out"
        raise ParameterError("wavelength_nm", text, wavelength_nm)
    record = dict(reading.record)
    note(record, f"The wavelength {wavelength_nm:g} nm was stated; the file has none.")
    return replace(reading, channels=(f"{wavelength_nm:g}nm",), wavelength_nm=np.array([wavelength_nm]), record=record)
