"""Contradictions of files that are joined: different values at the same directions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import counted
from brdfdb.geometry import degrees
from brdfdb.parameters import Floats

_SAME_DEG = 0.01  # directions closer than this are one
_RATIO = 1.3  # of the larger to the smaller value, in the median, above which files contradict
_UNLIKELY = 3.0  # standard uncertainties of the difference, in the median, from which on files contradict


class Part(Protocol):
    """Directions, values and uncertainties, as `brdfdb.measurements.Samples` has them."""

    @property
    def name(self) -> str:
        """Name of the file."""

    @property
    def theta_i(self) -> Floats:
        """Polar angles of the light (N,) [rad]."""

    @property
    def phi_i(self) -> Floats:
        """Azimuths of the light (N,) [rad]."""

    @property
    def theta_r(self) -> Floats:
        """Polar angles of the viewer (N,) [rad]."""

    @property
    def phi_r(self) -> Floats:
        """Azimuths of the viewer (N,) [rad]."""

    @property
    def values(self) -> Floats:
        """Values of f_r (N, C) [1/sr]."""

    @property
    def uncertainty(self) -> Floats | None:
        """Standard uncertainties (N, C) [1/sr]."""


def contradiction(parts: Sequence[Part]) -> str:
    """Return a sentence if parts hold different values at the same directions, else an empty text.

    Each part is compared with those before it, direction by direction, and the one that differs most is named. They
    contradict if the larger value is 1.3 times the smaller one in the median, or the difference three times its
    uncertainty.
    """
    codes = [_codes(part) for part in parts]
    values = np.concatenate([part.values for part in parts])
    noises = np.concatenate([_noise(part) for part in parts])
    worst, sentence = 0.0, ""
    for number in range(1, len(parts)):
        before = np.concatenate(codes[:number])
        _, one, two = np.intersect1d(before, codes[number], return_indices=True)
        two = two + len(before)
        positive = np.minimum(values[one], values[two]) > 0.0
        if not positive.any():
            continue
        a, b, u = values[one][positive], values[two][positive], np.hypot(noises[one], noises[two])[positive]
        ratio = float(np.median(np.maximum(a, b) / np.minimum(a, b)))
        stated = (u > 0.0) & np.isfinite(u)
        beyond = stated.any() and float(np.median(np.abs(a - b)[stated] / u[stated])) > _UNLIKELY
        if ratio > worst and (ratio > _RATIO or beyond):
            files = "both files have" if len(parts) == 2 else f"{parts[number].name} and files before it have"
            what = f"f_r differs by {100.0 * (ratio - 1.0):.3g} % in the median"
            end = ", which is beyond the stated uncertainties" if beyond else ""
            directions = counted(int(np.sum(positive.any(axis=1))), "direction")
            worst, sentence = ratio, f"At {directions} that {files}, {what}{end}."
    return sentence


def _noise(part: Part) -> Floats:
    """Return the standard uncertainties (N, C) [1/sr] of a part, 0 where none is stated."""
    return np.zeros(part.values.shape) if part.uncertainty is None else part.uncertainty


def _codes(part: Part) -> NDArray[np.int64]:
    """Return a number for each pair of directions, shape (N,): the same number, the same directions."""
    code = np.zeros(len(part.theta_i), dtype=np.int64)
    turn = round(360.0 / _SAME_DEG)
    for theta, phi in ((part.theta_i, part.phi_i), (part.theta_r, part.phi_r)):
        ring, azimuth = (np.rint(degrees(angle) / _SAME_DEG).astype(np.int64) for angle in (theta, phi))
        code = (code * turn + ring) * turn + np.where(ring == 0, 0, azimuth % turn)
    return code
