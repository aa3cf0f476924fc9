"""Patches of the hemisphere: the bases of Klems, with 145, 77 or 41 patches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brdfdb.parameters import Floats

Index = NDArray[np.int64]


@dataclass(frozen=True)
class Basis:
    """A basis: rings of patches, each of which lies at 0 degrees of azimuth with its middle.

    Attributes
    ----------
    name : str
        Name in files.
    bounds_deg : tuple of float (rings + 1,) [degree]
        Polar angles between the rings.
    counts : tuple of int (rings,)
        Patches of each ring.
    """

    name: str
    bounds_deg: tuple[float, ...]
    counts: tuple[int, ...]

    def __len__(self) -> int:
        return sum(self.counts)

    @property
    def rings(self) -> Index:
        """The ring of each patch."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @property
    def solid_angles(self) -> Floats:
        """Projected solid angles [sr] of the patches."""
        cosine2 = np.cos(np.radians(self.bounds_deg)) ** 2
        return np.asarray((np.pi * (cosine2[:-1] - cosine2[1:]) / np.array(self.counts))[self.rings])

    @property
    def middles(self) -> Floats:
        """Unit vectors (patches, 3) at the middles of the patches; for a patch that is a complete ring, at its axis."""
        bounds = np.radians(self.bounds_deg)
        theta = np.where(np.array(self.counts) == 1, bounds[:-1], 0.5 * (bounds[:-1] + bounds[1:]))[self.rings]
        counts = np.array(self.counts)
        number = np.arange(len(self)) - np.repeat(np.cumsum(counts) - counts, counts)
        phi = 2.0 * np.pi * number / counts[self.rings]
        return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)

    def vectors(self, patch: Index, place: Floats) -> Floats:
        """Return unit vectors (..., 3) at places (..., 2) in [0, 1]^2 of patches (...), which have equal measure."""
        counts = np.array(self.counts)
        first = np.cumsum(counts) - counts
        ring = self.rings[patch]
        sine2 = np.sin(np.radians(self.bounds_deg)) ** 2
        radius2 = sine2[ring] + place[..., 0] * (sine2[ring + 1] - sine2[ring])
        phi = 2.0 * np.pi * (patch - first[ring] + place[..., 1] - 0.5) / counts[ring]
        radius = np.sqrt(radius2)
        return np.stack([radius * np.cos(phi), radius * np.sin(phi), np.sqrt(1.0 - radius2)], axis=-1)

    def patches(self, vectors: Floats) -> Index:
        """Return the patches of unit vectors (N, 3) above the horizon."""
        counts = np.array(self.counts)
        theta = np.degrees(np.arccos(np.clip(vectors[:, 2], -1.0, 1.0)))
        ring = np.minimum(np.searchsorted(self.bounds_deg, theta, side="right") - 1, len(counts) - 1)
        turns = np.arctan2(vectors[:, 1], vectors[:, 0]) / (2.0 * np.pi)
        step = np.floor(turns * counts[ring] + 0.5).astype(np.int64) % counts[ring]
        return np.asarray((np.cumsum(counts) - counts)[ring] + step)


BASES = {
    "full": Basis("LBNL/Klems Full", (0, 5, 15, 25, 35, 45, 55, 65, 75, 90), (1, 8, 16, 20, 24, 24, 24, 16, 12)),
    "half": Basis("LBNL/Klems Half", (0, 6.5, 19.5, 32.5, 45.5, 58.5, 71.5, 90), (1, 8, 12, 16, 20, 12, 8)),
    "quarter": Basis("LBNL/Klems Quarter", (0, 9, 27, 45, 63, 90), (1, 8, 12, 12, 8)),
}
