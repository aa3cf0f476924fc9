"""Made height maps with known statistics, faults and noise, and the files that instruments would write of them.

The map is a part of a periodic Gaussian field of four times its area, so that its ends do not meet. Its statistics are
sums of the spectrum over the frequencies of the grid, and do not come from the code under test.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tifffile
from numpy.typing import NDArray
from PIL import Image
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from brdfdb.microgeometry.height_map_files import MapOptions, MeasuredHeights

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MadeMap:
    """A made surface, and the instrument that measures it; lengths are um."""

    correlation: str = "gaussian"
    sigma: float = 0.5
    tau_x: float = 5.0
    tau_y: float = 5.0
    step_x: float = 0.5
    step_y: float = 0.5
    nodes: tuple[int, int] = (192, 192)
    noise: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)  # slopes along x and y
    holes: float = 0.0  # share
    file: str = "npy"

    @property
    def spectrum(self) -> Array:
        """Spectrum on the grid of the periodic field, whose mean is the variance."""
        k = [
            2.0 * np.pi * np.fft.fftfreq(2 * count, step) * tau
            for count, step, tau in zip(self.nodes, (self.step_x, self.step_y), (self.tau_x, self.tau_y), strict=True)
        ]
        k2 = k[0][:, np.newaxis] ** 2 + k[1] ** 2
        power = {
            "gaussian": lambda: np.exp(-0.25 * k2),
            "exponential": lambda: (1.0 + k2) ** -1.5,
            "band": lambda: np.where(k2 <= 4.0, 1.0, 0.0),
        }[self.correlation]()
        return np.asarray(self.sigma**2 * power / power.mean())

    def truth(self) -> dict[str, float]:
        """Return the statistics of the surface, by the names of `SurfaceStatistics`."""
        covariance = np.fft.ifft2(self.spectrum).real
        known = {"sigma_0_um": math.sqrt(covariance[0, 0])}
        for axis, line, step in (("x", covariance[:, 0], self.step_x), ("y", covariance[0], self.step_y)):
            known[f"slope_{axis}"] = math.sqrt(2.0 * (line[0] - line[1])) / step
            first = int(np.flatnonzero(line < line[0] / math.e)[0])
            curve = CubicSpline(np.arange(first + 8), line[: first + 8] / line[0])
            known[f"tau_{axis}_um"] = step * brentq(lambda lag, c=curve: float(c(lag)) - 1.0 / math.e, first - 1, first)
        return known

    def surface(self, seed: int) -> Array:
        """Return the heights of a part of the surface without faults."""
        spectrum = self.spectrum
        white = np.random.default_rng(seed).standard_normal(spectrum.shape)
        return np.fft.ifft2(np.fft.fft2(white) * np.sqrt(spectrum)).real[: self.nodes[0], : self.nodes[1]]

    def measured(self, seed: int) -> MeasuredHeights:
        """Return what the instrument measures."""
        rng = np.random.default_rng((seed, 1))
        x = np.arange(self.nodes[0])[:, np.newaxis] * self.step_x
        y = np.arange(self.nodes[1]) * self.step_y
        z = self.surface(seed) + self.noise * rng.standard_normal(self.nodes) + self.tilt[0] * x + self.tilt[1] * y
        z[rng.random(self.nodes) < self.holes] = np.nan
        return MeasuredHeights(z, self.step_x, self.step_y)


def write(path: Path, measured: MeasuredHeights) -> MapOptions:
    """Write heights in the format of the suffix, and return the options that a reader needs."""
    z = measured.heights_um
    step_x, step_y = measured.step_x_um, measured.step_y_um
    pixel = (step_x,) if step_x == step_y else (step_x, step_y)
    if path.suffix == ".sdf":
        path.write_bytes(sdf(z, step_x, step_y))
        return MapOptions()
    if path.suffix == ".npy":
        np.save(path, 1e3 * z.T[::-1])  # the first row is the uppermost
        return MapOptions(pixel, 1e-3)
    low, high = np.nanmin(z), np.nanmax(z)
    unit = (high - low) / 65_000.0
    numbers = np.where(np.isfinite(z), np.rint((z - low) / unit) + 1.0, 0.0).astype(np.uint16)
    rows = np.ascontiguousarray(numbers.T[::-1])  # the first row of a picture is the uppermost
    if path.suffix == ".tif":
        tifffile.imwrite(path, rows)
    else:
        Image.fromarray(rows).save(path)
    return MapOptions(pixel, unit, hole=0.0)


def sdf(z: Array, step_x: float, step_y: float) -> bytes:
    """Return a binary file of ISO 25178-71 with heights as float64 [um]."""
    head = struct.pack(
        "<8s10s12s12sHHddddBBB",
        *(b"bISO-1.0", b"made".ljust(10), b"280620261200", b"280620261200"),
        *z.shape,
        *(1e-6 * step_x, 1e-6 * step_y, 1e-6, -1.0),
        *(0, 7, 0),
    )
    return head + np.ascontiguousarray(z.T).astype("<f8").tobytes()


TWELVE = (
    MadeMap(file="npy", noise=0.02, tilt=(0.02, -0.01)),
    MadeMap(file="tif", sigma=0.2, tau_x=4.0, tau_y=4.0, holes=0.03, tilt=(0.01, 0.0)),
    MadeMap(file="png", sigma=1.5, tau_x=6.0, tau_y=6.0, noise=0.05, holes=0.01),
    MadeMap(file="sdf", sigma=0.05, tau_x=3.0, tau_y=3.0, noise=0.005, holes=0.05, tilt=(0.0, 0.03)),
    MadeMap(file="npy", tau_x=6.0, tau_y=2.5, noise=0.03),
    MadeMap(file="tif", tau_x=2.5, tau_y=5.0, nodes=(160, 256), tilt=(-0.05, 0.02)),
    MadeMap(file="png", tau_x=4.0, tau_y=8.0, step_y=1.0, holes=0.02, noise=0.01),
    MadeMap(file="sdf", tau_x=4.0, tau_y=4.0, step_x=0.4, step_y=0.8, nodes=(256, 128), noise=0.01),
    MadeMap("band", file="npy", sigma=0.3, tau_x=4.0, tau_y=4.0, holes=0.02, noise=0.01),
    MadeMap("band", file="tif", sigma=2.0, tau_x=3.0, tau_y=5.0, tilt=(0.1, 0.1)),
    MadeMap("exponential", file="png", sigma=0.4, tau_x=4.0, tau_y=4.0, tilt=(0.01, 0.01)),
    MadeMap("exponential", file="sdf", sigma=0.8, tau_x=3.0, tau_y=5.0, noise=0.05, holes=0.02),
)
