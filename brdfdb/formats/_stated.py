"""Facts that a file leaves out and the user states: the begin of its azimuths, and its wavelength."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from brdfdb.errors import ParameterError
from brdfdb.formats._record import note
from brdfdb.parameters import Floats

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.measurements.samples import Samples

AZIMUTHS = ("light", "forward")
_RANGE_NM = (10.0, 1e6)
_OPPOSITE = np.array([-1.0, -1.0, 1.0])

Reading = TypeVar("Reading", "FileTable", "Samples")


def from_forward(reading: FileTable | Samples) -> FileTable | Samples:
    """Return f_r of a file whose azimuth of the light is the one into which it travels: 180 degrees from the light."""
    from brdfdb.measurements.samples import Samples

    if isinstance(reading, Samples):
        return _turned(reading)
    evaluate, nodes = reading.evaluate, reading.nodes

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
