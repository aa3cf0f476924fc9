"""The result of reading a file whose tools know f_r between its values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.arrays import array_lookup
from brdfdb.errors import ParameterError
from brdfdb.formats._channels import check_file_wavelengths
from brdfdb.formats._nodes import samples_of
from brdfdb.formats._record import note
from brdfdb.geometry import checked_angles, checked_vectors, finished, unit_vector
from brdfdb.materials.source import FourAngles, Lookups
from brdfdb.measurements.conventions import (
    ANGLES,
    LOGARITHMS,
    NODES,
    REFUSED,
    Convention,
    FormatConventions,
    ListedRows,
    f_r_of,
    numbers_of,
)
from brdfdb.measurements.samples import Samples
from brdfdb.parameters import Floats, check_nanometres
from brdfdb.tables.table_base import Stated

_SAME_NM = 0.05  # difference of wavelengths that are the same
_RANGE_NM = (10.0, 1e6)
_OPPOSITE = np.array([-1.0, -1.0, 1.0])

Reading = TypeVar("Reading", "FileTable", "Samples")


@dataclass(frozen=True, eq=False)
class FileTable(Lookups):
    """f_r of a file, evaluated as the tool that reads the format evaluates it."""

    name: str  #: name of the material, or of the file
    #: as of `Channels`: ("R", "G", "B"), ("X", "Y", "Z"), ("grey",), or wavelengths
    channels: tuple[str, ...]
    #: wavelengths of the channels, (L,) [nm]; None of colours and of grey files
    wavelength_nm: NDArray[np.float64] | None
    #: gives f_r [1/sr], shape (N, C), at unit vectors (N, 3) of light and viewer above the horizon
    evaluate: Callable[[Floats, Floats], Floats] = field(repr=False)
    #: the record in the file or next to it; empty for files of other programs
    record: Mapping[str, Any] = field(default_factory=dict, repr=False)
    #: gives the values of the file at their own directions, as its reader takes them; None of a formula
    rows: Callable[[], ListedRows] | None = field(default=None, repr=False)
    #: True if the file lists the directions that were measured, which may leave some out: f_r there is extrapolated
    listed: bool = False
    #: gives these above the horizon as samples, of a file that `brdfdb.formats.read` has read
    nodes: Callable[[], Samples] | None = field(default=None, repr=False)

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

        ParameterError if the file states no error, or none between its wavelengths.
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


def as_stated(
    reading: FileTable | ListedRows | Samples,
    convention: Convention,
    own: FormatConventions,
    file_format: str,
    missing: float | None,
) -> FileTable | Samples:
    """Return f_r of a file whose numbers mean what the user states, or what its format says.

    Here rows become samples. Of a table f_r is converted between its values; where the user states what its angles are,
    or a number that is `missing`, the nodes that the file lists are samples. ParameterError if it lists no angles.
    """
    if isinstance(reading, Samples):  # of a file of brdfdb: its values are f_r, its angles degrees
        if convention or missing is not None:
            return samples_of(_listed(reading), convention, own, missing)
        if reading.wavelength_nm is not None:
            check_file_wavelengths(reading.wavelength_nm, own.wavelengths, own.refused)
        return replace(reading, record={**reading.record, REFUSED: [*own.refused]}) if own.refused else reading
    if isinstance(reading, ListedRows):
        return samples_of(reading, convention, own, missing)
    rows = reading.rows
    as_rows = convention.of_rows or convention.quantity in LOGARITHMS or missing is not None
    if rows is None and as_rows:
        words = "missing" if missing is not None else "quantity" if convention.quantity in LOGARITHMS else "angles"
        raise ParameterError(
            words,
            f"files of {file_format} hold a formula, and no rows with {words}",
            getattr(convention, words, missing),
        )
    nodes = None if rows is None else lambda: samples_of(rows(), convention, own, missing)
    if nodes is not None and not as_rows and convention.azimuth in ("light", "mirror", "absolute"):
        as_rows = bool(np.any(nodes().phi_i))
    if nodes is not None and as_rows:
        listed = nodes()
        return replace(listed, record={**listed.record, NODES: True})
    if reading.wavelength_nm is not None:
        check_file_wavelengths(reading.wavelength_nm, own.wavelengths, own.refused)
    if not convention:
        return replace(reading, nodes=nodes)
    evaluate = reading.evaluate

    def f_r(wi: Floats, wr: Floats) -> Floats:
        values = evaluate(wi * _OPPOSITE if convention.azimuth in ("forward", "mirror") else wi, wr)
        if not convention.quantity:
            return values
        theta_i, theta_r = (np.arccos(np.clip(w[:, 2], -1.0, 1.0)) for w in (wi, wr))
        numbers = numbers_of(str(reading.record.get("quantity", "f_r")), values, theta_i, theta_r)
        return f_r_of(convention.quantity, numbers, theta_i, theta_r)

    return replace(reading, evaluate=f_r, nodes=nodes)


def _listed(samples: Samples) -> ListedRows:
    """Return the rows of samples."""
    record = {key: entry for key, entry in samples.record.items() if key not in ("quantity", "angles")}
    angles = np.stack([getattr(samples, name) for name in ANGLES], axis=1)
    known = {part.name: getattr(samples, part.name) for part in fields(ListedRows) if hasattr(samples, part.name)}
    return ListedRows(angles, **{**known, "record": record})


def in_frame(reading: FileTable | Samples, frame: str) -> FileTable | Samples:
    """Return the samples of a file whose Mueller matrices are in a frame that the user states.

    ParameterError if it is not one of `brdfdb.measurements.mueller.FRAMES`, or the file has no elements of matrices.
    """
    from brdfdb.measurements.mueller import FRAME_WORDS, from_frame

    if not isinstance(reading, Samples) or reading.mueller is None or reading.record.get("polarisers"):
        text = f"{reading.name} has no elements of Mueller matrices; s and p of polarisers need no frame"
        raise ParameterError("mueller_frame", text, frame)
    record = {**reading.record, "mueller_frame": frame}
    note(record, f"The frame of the Mueller matrices was stated: {FRAME_WORDS.get(frame, frame)}.")
    return replace(reading, mueller=from_frame(reading.mueller, frame), record=record)


def check_wavelength(wavelength_nm: float) -> None:
    """Raise ParameterError if a wavelength [nm] that a user states is outside [10, 1e6] nm."""
    low, high = _RANGE_NM
    if not low <= wavelength_nm <= high:
        raise ParameterError(
            "wavelength_nm", f"{wavelength_nm:g} is outside [{low:g}, {high:g}] nm", wavelength_nm, _RANGE_NM
        )


def at_wavelength(reading: FileTable | Samples, wavelength_nm: float) -> FileTable | Samples:
    """Return f_r of a file that gives no wavelength, with the one [nm] that the user states.

    ParameterError if the wavelength is outside [10, 1e6] nm, or the file states another wavelength or colours.
    """
    check_wavelength(wavelength_nm)
    if isinstance(reading, Samples):
        return _named(reading, wavelength_nm)
    nodes = reading.nodes
    named = _named(reading, wavelength_nm)
    return named if nodes is None else replace(named, nodes=lambda: _named(nodes(), wavelength_nm))


def _named(reading: Reading, wavelength_nm: float) -> Reading:
    """Return f_r of one channel at a wavelength [nm]; ParameterError if it states other channels."""
    own = reading.wavelength_nm
    if own is not None and len(own) == 1 and abs(own[0] - wavelength_nm) < _SAME_NM:
        return reading
    if reading.channels != ("grey",) or own is not None:
        text = f"{reading.name} states its own: {', '.join(reading.channels)[:100]}; leave it out"
        raise ParameterError("wavelength_nm", text, wavelength_nm)
    record = dict(reading.record)
    note(record, f"The wavelength {wavelength_nm:g} nm was stated; the file has none.")
    return replace(reading, channels=(f"{wavelength_nm:g}nm",), wavelength_nm=np.array([wavelength_nm]), record=record)
