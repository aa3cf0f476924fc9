"""Measured surfaces: samples of f_r with their noise, the instruments that take them, and measured data as a source.

Importing this package is cheap: its classes load when they are first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from brdfdb.measurements.instrument import Instrument
    from brdfdb.measurements.joining import joined
    from brdfdb.measurements.measured_source import MeasuredSource
    from brdfdb.measurements.record import Measured, Noise
    from brdfdb.measurements.samples import Samples

__all__ = ["Instrument", "Measured", "MeasuredSource", "Noise", "Samples", "joined"]

_MODULES = {
    "Instrument": "instrument",
    "Measured": "record",
    "MeasuredSource": "measured_source",
    "Noise": "record",
    "Samples": "samples",
    "joined": "joining",
}


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return getattr(importlib.import_module(f"brdfdb.measurements.{_MODULES[name]}"), name)
    raise AttributeError(f"module 'brdfdb.measurements' has no attribute {name!r}")
