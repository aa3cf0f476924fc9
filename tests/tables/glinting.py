"""Tables with glints made by hand: no detection of peaks decides what a test sees."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import brdfdb
from brdfdb.measurements import MeasuredSource
from brdfdb.measurements.glints import Glint, Glints
from brdfdb.store.publication import publish
from brdfdb.tables.table import Table

PEAK = 5000.0  # 1/sr, of the sample at light 60 degrees, viewer 60.5 degrees in the mirror half plane
GROUND = 0.05  # 1/sr, of the smooth part, everywhere
POWER = 0.05  # of the glint of light at 30 degrees, one degree wide
NM = np.array([450.0, 550.0, 650.0])
_TINT = np.array([1.0, 0.5, 0.25])  # of the peak at these wavelengths


def glints(channels: int = 1) -> Glints:
    """Glints of two lights: resolved at 30 degrees, and one sample of PEAK at 60 degrees."""
    tint = _TINT[:channels]
    wide = Glint(theta_i_deg=30.0, width_deg=1.0, resolved=True, power=tuple((POWER * tint).tolist()), error=0.02)
    light, viewer = (
        np.array([np.sin(t) * side, 0.0, np.cos(t)]) for t, side in ((np.pi / 3, 1), (np.deg2rad(60.5), -1))
    )
    narrow = Glint.through(light, viewer, PEAK * tint, 0.4, resolved=False, error=0.02)
    return Glints(glints=(wide, narrow))


def source(channels: int = 1, *, lit: bool = True) -> MeasuredSource:
    """A matt surface with these glints, or without."""
    names = ("grey",) if channels == 1 else tuple(f"{nm:g}nm" for nm in NM[:channels])
    made = MeasuredSource.of_function(
        lambda wi, wr: np.full((len(wi), channels), GROUND) * (1.0 + 0.0 * wr[:, :1]),
        names,
        None if channels == 1 else NM[:channels],
        name="glinting",
        title="A matt surface with glints",
        provenance="made up for a test",
    )
    return made.recorded(glints=glints(channels)) if lit else made


def stored(root: Path, channels: int = 1, *, lit: bool = True) -> Table:
    """The table of this source, as a store gives it back."""
    made = source(channels, lit=lit)
    publish(root, made, tolerance=0.05)
    return brdfdb.open(root)[made.name]
