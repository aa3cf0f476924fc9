"""Judge by harmonics of the slopes over azimuth whether a height map stands for an isotropic surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.microgeometry.height_map import HeightMap

_HARMONICS = 6  # of azimuth: 1 of slopes that lean to one side, 2 of an axis, 4 of square and 6 of hexagonal patterns
_ALLOWED = 0.1  # of an isotropic surface; harmonic 2 is 0.1 where the slopes along two axes differ by 10 %
_LEVEL = 0.05  # probability that any harmonic of an isotropic surface counts as no chance
_LARGE = 0.6  # a harmonic that is no chance, however few its areas; harmonic 2 of slopes that differ by a factor of 2
_BLOCKS = 4  # along each axis


class SlopeHarmonics(NamedTuple):
    """Harmonics of the squared slopes of a map over their azimuth."""

    #: moduli of the means of exp(i m phi), weighted by the squared slopes, for m of 1 to 6; 0: isotropic [1]
    sizes: tuple[float, ...]
    chances: tuple[float, ...]  #: probabilities that chance alone makes them as large [1]

    @property
    def preferred(self) -> int:
        """Return the number of the largest harmonic that is no chance and exceeds a tenth; 0 if there is none."""
        no_chance = [
            size if size > _LARGE or (size > _ALLOWED and chance < _LEVEL / _HARMONICS) else 0.0
            for size, chance in zip(self.sizes, self.chances, strict=True)
        ]
        return 1 + int(np.argmax(no_chance)) if any(no_chance) else 0

    @property
    def sentence(self) -> str:
        """Say which harmonic decides, and how large it is."""
        number = self.preferred or 1 + int(np.argmax(self.sizes))
        size = 100.0 * self.sizes[number - 1]
        limit = 100.0 * _ALLOWED
        if self.preferred:
            return f"harmonic {number} of its squared slopes over azimuth is {size:.2g} %, more than {limit:g} %"
        largest = f"the largest harmonic of its squared slopes over azimuth, number {number}, is {size:.2g} %"
        return f"{largest}, which is within chance" if size > limit else f"{largest}, which is less than {limit:g} %"


def slope_harmonics(surface: HeightMap) -> SlopeHarmonics:
    """Return the harmonics of the slopes of a height map over azimuth.

    Slopes are the mean slopes of the cells of the grid: those of single facets differ along the two diagonals.

    Parameters
    ----------
    surface : HeightMap
        A map of 5 x 5 nodes or more; ParameterError for fewer.

    Returns
    -------
    SlopeHarmonics

    Notes
    -----
    Sixteen blocks of the map tell the chance, by Hotelling's test that the means of cosine and sine are 0. Blocks of a
    small map are alike if the correlation has a long tail, as that of a limited bandwidth has. So harmonic 2, a sum
    over the spectrum of the slopes, is also compared with its covariance for Gaussian surfaces (Priestley 1981, section
    6.2) whose spectrum, as that of all isotropic surfaces, depends on the modulus of the wave vector alone. The larger
    probability counts.
    """
    from scipy.stats import f as f_distribution

    z = surface.closed()
    if min(z.shape) <= _BLOCKS:
        raise ParameterError("heights_um", f"{z.shape[0]} x {z.shape[1]} nodes are too few; allowed are 5 x 5 or more")
    along_x = np.diff(z, axis=0) / surface.step_x_um
    along_y = np.diff(z, axis=1) / surface.step_y_um
    slopes = 0.5 * (along_x[:, 1:] + along_x[:, :-1]) + 0.5j * (along_y[1:] + along_y[:-1])
    lengths = np.abs(slopes)
    mean_square = float(np.mean(lengths**2)) or 1.0
    weighted = (lengths**2 / mean_square).astype(np.complex128)
    azimuths = slopes / np.where(lengths > 0.0, lengths, 1.0)
    count = _BLOCKS**2
    sizes, chances = [], []
    for _ in range(_HARMONICS):
        weighted *= azimuths
        rows = np.array_split(weighted, _BLOCKS, axis=0)
        means = np.array([part.mean() for row in rows for part in np.array_split(row, _BLOCKS, axis=1)])
        parts = np.stack([means.real, means.imag])
        mean = parts.mean(axis=1)
        covariance = np.cov(parts) / count + 1e-12 * np.eye(2)  # equal blocks of a periodic pattern have none
        hotelling = mean @ np.linalg.solve(covariance, mean)
        sizes.append(float(np.hypot(*mean)))
        chances.append(float(f_distribution.sf((count - 2) / (2 * (count - 1)) * hotelling, 2, count - 2)))
        if len(sizes) == 2:
            covariance = _covariance_of_second(slopes / mean_square**0.5, surface)
            chances[1] = max(chances[1], float(np.exp(-0.5 * mean @ np.linalg.solve(covariance, mean))))
    return SlopeHarmonics(tuple(sizes), tuple(chances))


def _covariance_of_second(slopes: NDArray[np.complex128], surface: HeightMap) -> NDArray[np.float64]:
    """Return the covariance of cosine and sine of harmonic 2 over maps of an isotropic Gaussian surface.

    `slopes` have the mean square 1. Each wave vector has its part of the spectrum in the direction of its own azimuth.
    """
    spectrum = np.abs(np.fft.fft2(slopes)) ** 2 / slopes.size**2
    spectrum = 0.5 * (spectrum + np.roll(spectrum[::-1, ::-1], (1, 1), axis=(0, 1)))  # of k and of -k
    steps = (surface.step_x_um, surface.step_y_um)
    k = [np.fft.fftfreq(nodes, step) for nodes, step in zip(slopes.shape, steps, strict=True)]
    waves = k[0][:, np.newaxis] + 1j * k[1]
    half = 0.5 * max(1.0 / (nodes * step) for nodes, step in zip(slopes.shape, steps, strict=True))
    ring = np.rint(np.abs(waves) / half).astype(np.int64).reshape(-1)
    mean = np.bincount(ring, spectrum.reshape(-1)) / np.maximum(np.bincount(ring), 1)
    doubled = 2.0 * np.angle(waves).reshape(-1)
    parts = mean[ring] * np.stack([np.cos(doubled), np.sin(doubled)])
    return np.asarray(2.0 * parts @ parts.T + 1e-12 * np.eye(2))
