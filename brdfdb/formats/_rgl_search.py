"""The smallest file of RGL's format that is as near to a table as was asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from brdfdb.errors import ParameterError
from brdfdb.formats._rgl_build import Plan, Surface, build
from brdfdb.formats._rgl_fields import Fields

if TYPE_CHECKING:
    from brdfdb.formats._channels import Channels
    from brdfdb.formats._stated_error import FileError
    from brdfdb.tables.table import Table


@dataclass(frozen=True, eq=False)
class Found:
    """The fields of a file, its error, the names of its channels, and remarks."""

    fields: Fields
    error: FileError
    channels: list[str]
    remarks: tuple[str, ...]


def smallest(table: Table, kind: str, tolerance: float) -> Found:
    """Return the smallest file within a tolerance, or the best one of those that are tried."""
    from brdfdb.formats._stated_error import Comparison

    channels = _channels(table, kind)
    comparison = Comparison(table, channels)
    surface = Surface(table, channels, 4 if table.anisotropic else 1)
    best = None
    for size in (16, 24, 32, 48, 64, 96, 128):
        fields = build(surface, Plan(size, 24, 9 if table.anisotropic else 1))
        fields = replace(fields, wavelength_nm=_wavelengths(channels, kind))
        error = comparison.error_of(fields.evaluate)
        if best is None or error.p99 < best[1].p99:
            best = fields, error
        if error.p99 <= tolerance:
            break
    assert best is not None
    return Found(*best, list(channels.names), ())


def _channels(table: Table, kind: str) -> Channels:
    from brdfdb.formats._channels import channels_of

    return channels_of(table, "rgb" if kind == "rgb" else "")


def _wavelengths(channels: Channels, kind: str):
    if kind == "rgb":
        return None
    if channels.wavelength_nm is None:
        return np.array([550.0], np.float32)
    return channels.wavelength_nm.astype(np.float32)
