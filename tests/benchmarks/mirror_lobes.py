"""Interpolated lobes of mirrors against their closed form: ``python tests/benchmarks/mirror_lobes.py``.

f_r of one reflection by facets of Gaussian slopes that reflect all light, without shadows, is known at the directions
of the goniometer, with noise of 0.5 %. It is interpolated as simulated tables are, over Lambert with one lobe and over
Beckmann's model, which has shadows, and compared with the closed form at other directions, whose half vectors have the
slopes of the surface. Exits with 1 if fewer than 95 % of the values are within the stated error.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.geometry import spherical_angles, unit_vector
from brdfdb.measurements import MeasuredSource, Samples
from brdfdb.microgeometry.directions import goniometer_directions
from brdfdb.models import beckmann
from tests.benchmarks.recording import Column, Run

Array = NDArray[np.float64]
LOBES = ((0.15, 0.15, 0.0), (0.3, 0.1, 0.0), (0.1, 0.3, 0.0), (0.3, 0.1, 30.0))  # slopes, azimuth [degree]
NOISE = 0.005
HIGH_DEG, LOWEST_DEG = 70.0, 82.5
COUNT = 3000
PROMISED = 0.95
MEASURED = "The error of interpolation of lobes between the directions of the goniometer, against their closed form."


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print the errors, and return 1 if stated errors do not hold."""
    run = Run("mirror_lobes", "accuracy", "Lobes of mirrors between the directions of the goniometer", MEASURED)
    options = run.parse(run.parser(__doc__), arguments)
    table = run.table(
        "Errors of interpolated f_r relative to the closed form, for light and viewer up to the polar angle",
        Column(name="slope along x", width=14),
        Column(name="slope along y", width=14),
        Column(name="azimuth", unit="degree"),
        Column(name="base", width=14),
        Column(name="polar angle", unit="degree"),
        Column(name="median"),
        Column(name="95th percentile", width=16),
        Column(name="stated, median", width=16),
        Column(name="within the stated error", width=24),
    )
    least = 1.0
    for slope_x, slope_y, azimuth_deg in LOBES[:1] if options.quick else LOBES:
        azimuth = np.radians(azimuth_deg)
        for base in ("Lambert, lobe", "Beckmann"):
            source = interpolated(slope_x, slope_y, azimuth, base)
            wi, wr = directions(slope_x, slope_y, azimuth)
            truth = f_r(wi, wr, slope_x, slope_y, azimuth)
            value = source.lookup_vectors(wi, wr)
            lowest = np.minimum(wi[:, 2], wr[:, 2])
            stated = source.measured.error_of(value[:, np.newaxis], wi, wr, np.zeros(1))[:, 0]
            off = np.abs(value - truth)
            for low, high in ((0.0, HIGH_DEG), (HIGH_DEG, LOWEST_DEG)):
                some = (lowest <= np.cos(np.radians(low))) & (lowest > np.cos(np.radians(high)))
                relative = off[some] / truth[some]
                share = float(np.mean(off[some] <= stated[some]))
                least = min(least, share)
                error = (float(np.median(relative)), float(np.percentile(relative, 95)))
                width = float(np.median(stated[some] / value[some]))
                table.add(slope_x, slope_y, azimuth_deg, base, high, *error, width, share)
    run.say(f"Polar angles of {LOWEST_DEG} degrees stand for those above {HIGH_DEG:g} degrees.")
    run.end()
    return int(least < PROMISED)


def f_r(wi: Array, wr: Array, slope_x: float, slope_y: float, azimuth: float) -> Array:
    """Return f_r [1/sr] of one reflection without shadows: P22 / (4 h_z^4 cos(theta_i) cos(theta_r)), (N,)."""
    half = wi + wr
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    x, y = half[:, :2].T / half[:, 2]
    along = (x * np.cos(azimuth) + y * np.sin(azimuth)) / slope_x
    across = (y * np.cos(azimuth) - x * np.sin(azimuth)) / slope_y
    density = np.exp(-0.5 * (along**2 + across**2)) / (2.0 * np.pi * slope_x * slope_y)
    return np.asarray(density / (4.0 * half[:, 2] ** 4 * wi[:, 2] * wr[:, 2]))


def interpolated(slope_x: float, slope_y: float, azimuth: float, base: str) -> MeasuredSource:
    """Return f_r at the directions of the goniometer, interpolated over a base."""
    isotropic = slope_x == slope_y
    lights, viewers = goniometer_directions(isotropic=isotropic, slopes=(slope_x, slope_y), azimuth=azimuth)
    wi = np.repeat(lights, viewers.shape[1], axis=0)
    wr = viewers.reshape(-1, 3)
    values = f_r(wi, wr, slope_x, slope_y, azimuth)[:, np.newaxis]
    noise = NOISE * np.random.default_rng(1).standard_normal(values.shape)
    angles = (*spherical_angles(wi), *spherical_angles(wr))
    uncertainty = NOISE * values + 1e-12
    samples = Samples("lobe", *angles, ("grey",), None, values * (1.0 + noise), uncertainty=uncertainty)

    def beckmann_base(wi: Array, wr: Array) -> Array:
        theta_i, phi_i, theta_r, phi_r = (angle[:, np.newaxis] for w in (wi, wr) for angle in spherical_angles(w))
        alpha = {"alpha_x": np.sqrt(2.0) * slope_x, "alpha_y": np.sqrt(2.0) * slope_y}
        return np.asarray(beckmann(theta_i, phi_i - azimuth, theta_r, phi_r - azimuth, **alpha, n=100.0, k=1e4))

    given = beckmann_base if base == "Beckmann" else None
    return MeasuredSource.of_samples(samples, base=given, reciprocal=True)


def directions(slope_x: float, slope_y: float, azimuth: float) -> tuple[Array, Array]:
    """Return lights and viewers (N, 3) up to the lowest polar angle, whose half vectors have the slopes of the lobe."""
    rng = np.random.default_rng(2)
    highest = np.cos(np.radians(LOWEST_DEG))
    lights = unit_vector(np.arccos(rng.uniform(highest, 1.0, COUNT)), rng.uniform(0.0, 2.0 * np.pi, COUNT))
    along, across = rng.standard_normal((2, COUNT)) * np.array([[slope_x], [slope_y]])
    cos, sin = np.cos(azimuth), np.sin(azimuth)
    half = np.column_stack([along * cos - across * sin, along * sin + across * cos, np.ones(COUNT)])
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    viewers = 2.0 * np.sum(lights * half, axis=1, keepdims=True) * half - lights
    above = viewers[:, 2] > highest
    return lights[above], viewers[above]


if __name__ == "__main__":
    sys.exit(main())
