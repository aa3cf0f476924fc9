"""Judge by harmonics of the slopes over azimuth whether a height map stands for an isotropic surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from brdfdb.errors import ParameterError
from brdfdb.microgeometry.height_map import HeightMap

_HARMONICS = 6  # of azimuth: 1 of slopes that lean to one side, 2 of an axis, 4 of square and 6 of hexagonal patterns
_ALLOWED = 0.1  # of an isotropic surface; harmonic 2 is 0.1 where the slopes along two axes differ by 10 %
_CHANCE = 0.01  # probability of a harmonic as large, at which it is no chance
_LARGE = 0.5  # a harmonic that is no chance, however much the blocks of the map differ
_BLOCKS = 4  # along each axis


class SlopeHarmonics(NamedTuple):
    """Harmonics of the squared slopes of a map over their azimuth.

    Attributes
    ----------
    sizes : tuple of float [1]
        Moduli of the means of exp(i m phi), weighted by the squared slopes, for m of 1 to 6; 0 of an isotropic surface.
    chances : tuple of float [1]
        Probabilities that chance alone makes them as large, from their spread over blocks of the map.
    """

    sizes: tuple[float, ...]
    chances: tuple[float, ...]

    @property
    def preferred(self) -> int:
        """Return the number of the largest harmonic that is no chance and exceeds a tenth; 0 if there is none."""
        found = [
            size if size > _LARGE or (size > _ALLOWED and chance < _CHANCE) else 0.0
            for size, chance in zip(self.sizes, self.chances, strict=True)
        ]
        return 1 + int(np.argmax(found)) if any(found) else 0

    @property
    def sentence(self) -> str:
        """Say which harmonic decides, and how large it is."""
        number = self.preferred or 1 + int(np.argmax(self.sizes))
        size = 100.0 * self.sizes[number - 1]
        said = f"harmonic {number} of its squared slopes over azimuth is {size:.2g} %"
        if self.preferred:
            return f"{said}, more than {100.0 * _ALLOWED:g} %"
        return f"{said}, the largest, {'within chance' if size > 100.0 * _ALLOWED else 'small'}"


def slope_harmonics(surface: HeightMap) -> SlopeHarmonics:
    """Return the harmonics of the slopes of a height map over azimuth.

    Slopes are the mean slopes of the cells of the grid: those of single facets differ along the two diagonals. Blocks
    of a sixteenth of the map tell the chance, by Hotelling's test that the means of cosine and sine are 0.

    Parameters
    ----------
    surface : HeightMap
        A map of 5 x 5 nodes or more; ParameterError for fewer.

    Returns
    -------
    SlopeHarmonics
    """
    from scipy.stats import f as f_distribution

    z = surface.closed()
    if min(z.shape) <= _BLOCKS:
        raise ParameterError("heights_um", f"{z.shape[0]} x {z.shape[1]} nodes are too few; allowed are 5 x 5 or more")
    along_x = np.diff(z, axis=0) / surface.step_x_um
    along_y = np.diff(z, axis=1) / surface.step_y_um
    slopes = 0.5 * (along_x[:, 1:] + along_x[:, :-1]) + 0.5j * (along_y[1:] + along_y[:-1])
    lengths = np.abs(slopes)
    weighted = (lengths**2 / (np.mean(lengths**2) or 1.0)).astype(np.complex128)
    slopes /= np.where(lengths > 0.0, lengths, 1.0)
    count = _BLOCKS**2
    sizes, chances = [], []
    for _ in range(_HARMONICS):
        weighted *= slopes
        rows = np.array_split(weighted, _BLOCKS, axis=0)
        means = np.array([part.mean() for row in rows for part in np.array_split(row, _BLOCKS, axis=1)])
        parts = np.stack([means.real, means.imag])
        mean = parts.mean(axis=1)
        covariance = np.cov(parts) / count + 1e-12 * np.eye(2)  # equal blocks of a periodic pattern have none
        hotelling = mean @ np.linalg.solve(covariance, mean)
        sizes.append(float(np.hypot(*mean)))
        chances.append(float(f_distribution.sf((count - 2) / (2 * (count - 1)) * hotelling, 2, count - 2)))
    return SlopeHarmonics(tuple(sizes), tuple(chances))
