"""Measurements made up of models: samples with noise, in the patterns of instruments."""

from __future__ import annotations

from typing import Any

import numpy as np

from brdfdb.geometry import radians, unit_vector
from brdfdb.materials.source import Evaluate
from brdfdb.measurements import Instrument, MeasuredSource, Samples
from brdfdb.parameters import Floats


def source_of(f_r: Evaluate, channels: tuple[str, ...] = ("grey",), **more: Any) -> MeasuredSource:
    """Return a function of directions as a measured source."""
    given = {"name": "Made up_1", "title": "Made up", "provenance": "this test", **more}
    return MeasuredSource.of_function(f_r, channels, None, **given)


def scattered(f_r: Evaluate, count: int, noise: float, seed: int = 5) -> Samples:
    """Return samples at random directions up to 75 degrees."""
    rng = np.random.default_rng(seed)
    theta_i, theta_r = radians(rng.uniform(0.0, 75.0, (2, count)))
    return _measured(f_r, theta_i, theta_r, rng.uniform(0.0, 2.0 * np.pi, count), noise, rng)


def scans(f_r: Evaluate, theta_i_deg: Floats, noise: float, seed: int = 6, step_deg: float = 7.5) -> Samples:
    """Return samples of whole hemispheres of viewers, up to 75 degrees, for some lights."""
    rng = np.random.default_rng(seed)
    viewers = np.arange(0.0, 76.0, step_deg), np.arange(0.0, 360.0, 20.0)
    light, viewer, turn = (radians(a.ravel()) for a in np.meshgrid(theta_i_deg, *viewers, indexing="ij"))
    return _measured(f_r, light, viewer, turn, noise, rng)


def _measured(
    f_r: Evaluate, theta_i: Floats, theta_r: Floats, phi_r: Floats, noise: float, rng: np.random.Generator
) -> Samples:
    values = f_r(unit_vector(theta_i, np.zeros_like(theta_i)), unit_vector(theta_r, phi_r))
    uncertainty = noise * (values + 0.01 * values.mean())
    return Samples(
        "made up", theta_i, np.zeros_like(theta_i), theta_r, phi_r, ("grey",), None,
        values + uncertainty * rng.standard_normal(values.shape), uncertainty,
        instrument=Instrument("a made-up goniophotometer"), provenance="made up for a test",
    )  # fmt: skip
