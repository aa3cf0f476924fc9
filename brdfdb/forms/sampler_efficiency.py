"""Efficiency of samplers: the variance of Monte Carlo estimates and the time per sample."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import radians, unit_vector
from brdfdb.integrals.sampling import DIFFUSE, directions, mixture_density
from brdfdb.materials import Source

Array = NDArray[np.float64]

SAMPLERS = {
    "model": "the source's own: its lobe and cosine",
    "cosine": "cosine of the polar angle",
    "uniform": "uniform over the hemisphere",
}
THETA_DEG = 60.0  # polar angle of the light for which the albedo is estimated
SAMPLES = 1 << 15  # samples per estimate and round
ROUNDS = 9
PER_POINT = 4  # samples per point of the sphere; the noise is their variance, not the difference between points
SEED = 1994

# Radiance of the light on the sphere: a sky that brightens upwards, and a lamp on the right
_SKY = 0.2
_LAMP = 5.0
_SHARPNESS = 20.0  # a lamp about 20 degrees wide
_LAMP_AT = np.array([0.6, 0.4, np.sqrt(1.0 - 0.6**2 - 0.4**2)])

Draw = Callable[[Array, Array, Array], tuple[Array, Array]]


class Work(NamedTuple):
    """Noise and time of a sampler, arrays of shape (rounds,).

    `mean` is the estimate, `variance` [1] the variance of one sample over the square of the mean, and `seconds` the
    processor time per sample.
    """

    mean: Array
    variance: Array
    seconds: Array

    @property
    def seconds_to_percent(self) -> Array:
        """Time [s] to an estimate with a standard deviation of 1 %, for each round."""
        return 1e4 * self.variance * self.seconds


def works(
    source: Source,
    wavelength_nm: float | None,
    *,
    rounds: int = ROUNDS,
    samples: int = SAMPLES,
    clock: Callable[[], float] = time.process_time,
) -> dict[str, tuple[Work, Work]]:
    """Measure noise and time of samplers for the directional albedo and for the picture of a lit sphere.

    For each of `SAMPLERS`, the result has the work of the albedo and that of the sphere. The source is sampled without
    its specular part, at one wavelength [nm] if it is spectral. All samplers share the random numbers of a round, and
    take `samples` of them per estimate. `clock()` gives the time in seconds.

    The light comes from `THETA_DEG` for the albedo. The sphere is seen from afar under a sky and a lamp. Its variance
    is the mean over points of the variance at a point. Random numbers are drawn before the clock starts. Seeds are
    fixed, so that means and variances are the same in every run.
    """
    draws = _draws(source, None if wavelength_nm is None else np.array([wavelength_nm]))
    numbers = np.empty((len(draws), 2, 3, rounds))
    for row in range(rounds):
        for problem, estimate in enumerate((_albedo, _sphere)):
            u = np.random.default_rng([SEED, row]).random((4, samples))
            for number, draw in enumerate(draws.values()):
                if row == 0:
                    estimate(draw, u[:, :256])  # compile the kernels before the clock starts
                start = clock()
                estimates = estimate(draw, u)
                seconds = (clock() - start) / samples
                mean = estimates.mean()
                spread = estimates.var() if problem == 0 else estimates.var(axis=1, ddof=1).mean()
                numbers[number, problem, :, row] = mean, spread / mean**2 if mean > 0.0 else 0.0, seconds
    return {key: (Work(*numbers[number, 0]), Work(*numbers[number, 1])) for number, key in enumerate(draws)}


def _draws(source: Source, wavelength_nm: NDArray[np.float64] | None) -> dict[str, Draw]:
    """Return for each sampler a function of u1, u2 and lights that gives viewers and f_r cos / density [1]."""
    brdf = source.brdf_at(wavelength_nm)

    def of_source(u1: Array, u2: Array, wi: Array) -> tuple[Array, Array]:
        lobe = source.lobe(wi[:, 2], wavelength_nm) or DIFFUSE
        wr = directions(lobe, u1, u2, wi)
        density = mixture_density(lobe, wi, wr)
        reflected = brdf(wi, wr)[:, 0] * np.maximum(wr[:, 2], 0.0)
        return wr, np.divide(reflected, density, where=density != 0.0, out=np.zeros(density.shape))

    def of_cosine(u1: Array, u2: Array, wi: Array) -> tuple[Array, Array]:
        wr = _around(np.sqrt(u1), np.sqrt(1.0 - u1), u2)
        return wr, np.asarray(np.pi * brdf(wi, wr)[:, 0])

    def uniformly(u1: Array, u2: Array, wi: Array) -> tuple[Array, Array]:
        wr = _around(np.sqrt(u1 * (2.0 - u1)), 1.0 - u1, u2)
        return wr, np.asarray(2.0 * np.pi * wr[:, 2] * brdf(wi, wr)[:, 0])

    return dict(zip(SAMPLERS, (of_source, of_cosine, uniformly), strict=True))


def _around(sin_theta: Array, cos_theta: Array, u2: Array) -> Array:
    angle = 2.0 * np.pi * u2
    return np.stack([sin_theta * np.cos(angle), sin_theta * np.sin(angle), cos_theta], axis=-1)


def _albedo(draw: Draw, u: Array) -> Array:
    """Return samples (N,) of the directional albedo [1]."""
    wi = np.broadcast_to(unit_vector(radians(THETA_DEG), 0.0), (u.shape[1], 3))
    return draw(u[0], u[1], wi)[1]


def _sphere(draw: Draw, u: Array) -> Array:
    """Return samples (points, `PER_POINT`) of the radiance of points of a sphere, seen along z from afar."""
    points = u.shape[1] // PER_POINT
    radius = np.sqrt(u[2, :points])
    angle = 2.0 * np.pi * u[3, :points]
    n = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1.0 - radius**2)], axis=-1)
    # The tangent is horizontal around the sphere
    level = np.hypot(n[:, 0], n[:, 2])
    t = np.stack([n[:, 2] / level, np.zeros(points), -n[:, 0] / level], axis=-1)
    b = np.cross(n, t)
    viewer = np.stack([t[:, 2], b[:, 2], n[:, 2]], axis=-1)
    t, b, n, viewer = (np.repeat(vector, PER_POINT, axis=0) for vector in (t, b, n, viewer))
    light, weight = draw(u[0, : len(n)], u[1, : len(n)], viewer)
    world = light[:, :1] * t + light[:, 1:2] * b + light[:, 2:] * n
    sky = _SKY * (1.0 + world[:, 1])
    return np.asarray(weight * (sky + _LAMP * np.exp(_SHARPNESS * (world @ _LAMP_AT - 1.0)))).reshape(points, PER_POINT)
