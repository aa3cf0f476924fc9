"""The integrals over Gaussian slopes against quadratures with many nodes, and where all slopes of rays are 0."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb import models
from brdfdb.models import _gaussian_slopes as slopes
from tests.compiled import compiled

# Relative, just above the worst measured, which stands behind it
SERIES = 2e-12  # 1.5e-12: of ten degrees, with 34 terms
STEEP = 1e-11  # 6.9e-12: where what is integrated in closed form begins to count


@pytest.mark.parametrize("sigma_deg", [1e-6, 10.0, 14.9, 15.1, 20.0, 40.0, 90.0])
def test_every_integral_from_next_to_nothing_to_its_end(sigma_deg: float) -> None:
    sigma = np.radians(sigma_deg)
    x_max = min(0.5 * np.pi / sigma, 6.0)
    ends = np.array([1e-8, 1e-3, 0.1, 0.5, 0.9, 0.99]) * x_max
    series = compiled(slopes.series_of)(sigma, x_max)
    result = np.full((slopes.INTEGRALS, slopes.RAYS), np.nan)
    compiled(slopes.integrate)(0, slopes.INTEGRALS, ends, series, np.empty((4, slopes.RAYS)), result)
    node, weight = np.polynomial.legendre.leggauss(200)  # all integrands are positive: nothing cancels
    x = np.append(ends, x_max)[:, np.newaxis] * (node + 1.0) / 2.0
    S, C = np.sin(sigma * x), np.cos(sigma * x)
    W = np.append(ends, x_max)[:, np.newaxis] * weight / 2.0 * np.exp(-0.5 * x**2) * S
    expected = np.empty((slopes.INTEGRALS, len(x)))
    expected[slopes.OF_C] = np.sum(W * C, axis=1)
    expected[slopes.OF_S] = np.sum(W * S, axis=1)
    expected[slopes.OF_SC] = np.sum(W * S * C, axis=1)
    expected[slopes.OF_SS] = np.sum(W * S**2, axis=1)
    expected[slopes.OF_OPEN] = np.sum(W * S**2 * C / (1.0 + C), axis=1)
    expected[slopes.OF_SLANT] = np.sum(W * S**3 / (1.0 + C), axis=1)
    expected[slopes.OF_STEEP] = np.sum(W * S**4 / (C * (1.0 + C)), axis=1)
    values = result[:, : ends.size]
    np.testing.assert_allclose(values[: slopes.OF_STEEP], expected[: slopes.OF_STEEP, :-1], rtol=SERIES)
    np.testing.assert_allclose(values[slopes.OF_STEEP], expected[slopes.OF_STEEP, :-1], rtol=STEEP)
    whole = [np.sum(W[-1]), expected[slopes.OF_C, -1], expected[slopes.OF_S, -1]]
    np.testing.assert_allclose(series[4:], whole, rtol=SERIES)


def test_at_the_normal_no_azimuth_matters() -> None:
    # the slopes of light and viewer are 0 in all azimuths, and second bounces of some sigmas were nan
    sigma = np.linspace(0.0, np.pi / 2, 2000)
    straight = models.oren_nayar_gaussian(0.0, 0.0, 0.0, 0.0, rho=0.5, sigma=sigma)
    assert np.isfinite(straight).all()
    for azimuth in (1.0, np.pi / 2, 3.0):
        turned = models.oren_nayar_gaussian(0.0, 0.0, 0.0, azimuth, rho=0.5, sigma=sigma)
        np.testing.assert_allclose(turned, straight, rtol=1e-13)
