"""Efficiency of samplers: estimates that agree, variances that theory gives, and the same numbers in every run."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from brdfdb.forms import sampler_efficiency
from brdfdb.forms.sampler_efficiency import SAMPLERS, Work, works
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.materials import Material, presets

LAMBERT = Material(name="m", title="m", model="lambert", parameters={"rho": 0.5}, source="a test")


def within(means: Any, expected: float, sigmas: float = 4.0) -> bool:
    """Whether the mean of independent estimates is the expected number but for noise."""
    return bool(abs(means.mean() - expected) <= sigmas * means.std(ddof=1) / np.sqrt(means.size) + 1e-12)


@pytest.mark.parametrize(("name", "wavelength"), [("rolled-brass", None), ("clay-vase", None)])
def test_every_sampler_estimates_the_albedo_of_the_quadrature(name: str, wavelength: float | None) -> None:
    material = presets()[name]
    theta_i = np.deg2rad(sampler_efficiency.THETA_DEG)
    expected = float(np.ravel(directional_albedo(material.spec, theta_i, **material.arguments(None)).albedo)[0])
    for key, (albedo, _) in works(material, wavelength, rounds=8).items():
        assert within(albedo.mean, expected), key


def test_all_samplers_estimate_the_same_sphere() -> None:
    found = works(presets()["rolled-brass"], None, rounds=8)
    own = found["model"][1].mean
    for key in ("cosine", "uniform"):
        assert within(found[key][1].mean - own, 0.0), key


def test_variances_of_lamberts_albedo_are_those_of_theory() -> None:
    # a sample of the cosine is rho itself; a uniform one is 2 rho u, of variance rho^2 / 3
    found = works(LAMBERT, None, rounds=3)
    np.testing.assert_allclose(found["cosine"][0].variance, 0.0, atol=1e-20)
    np.testing.assert_allclose(found["model"][0].variance, 0.0, atol=1e-20)
    np.testing.assert_allclose(found["uniform"][0].variance, 1.0 / 3.0, rtol=0.02)


def test_the_noise_of_a_lambertian_sphere_under_the_sky_is_that_of_theory(monkeypatch: pytest.MonkeyPatch) -> None:
    # A cosine sample is rho L, L = 0.2 (1 + y). At a point of the normal n, y has the mean 2/3 n_y and the mean square
    # (1 + n_y^2) / 4; over the disc n_y has the mean 0 and the mean square 1/4
    monkeypatch.setattr(sampler_efficiency, "_LAMP", 0.0)
    (_, sphere) = works(LAMBERT, None, rounds=3)["cosine"]
    np.testing.assert_allclose(sphere.mean, 0.5 * 0.2, rtol=0.01)
    np.testing.assert_allclose(sphere.variance, 1.0 / 4.0 - 7.0 / 36.0 / 4.0, rtol=0.04)


def test_time_to_a_percent_is_variance_times_time() -> None:
    # n samples have the variance v / n: 1 % takes 10 000 v of them
    work = Work(np.ones(2), np.array([0.5, 2.0]), np.array([1e-6, 3e-6]))
    np.testing.assert_allclose(work.seconds_to_percent, [5e-3, 6e-2])


def test_numbers_but_for_times_are_the_same_in_every_run() -> None:
    ticks = itertools.count()
    first, second = (works(LAMBERT, None, rounds=2, samples=1024, clock=lambda: float(next(ticks))) for _ in range(2))
    for key in SAMPLERS:
        for one, two in zip(first[key], second[key], strict=True):
            np.testing.assert_array_equal(one.variance, two.variance)
            np.testing.assert_array_equal(one.mean, two.mean)
            np.testing.assert_allclose(one.seconds, 1.0 / 1024.0)
