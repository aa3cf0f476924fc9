"""Measured surfaces: samples of f_r with their noise, and the instruments that take them."""

from __future__ import annotations

from brdfdb.measurements.samples import Instrument, Samples, joined

__all__ = ["Instrument", "Samples", "joined"]
