"""Measured surfaces: samples of f_r with their noise, the instruments that take them, and measured data as a source."""

from __future__ import annotations

from brdfdb.measurements.joining import joined
from brdfdb.measurements.measured_source import MeasuredSource
from brdfdb.measurements.record import Measured, Noise
from brdfdb.measurements.samples import Instrument, Samples

__all__ = ["Instrument", "Measured", "MeasuredSource", "Noise", "Samples", "joined"]
