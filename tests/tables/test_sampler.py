"""Directions drawn from tables alone: their density, and the albedo that their weights add up to."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import unit_vector
from brdfdb.tables.albedo import directional_albedo
from brdfdb.tables.sampler import LOBE_SHARE
from tests.formats.small_tables import ANISOTROPIC, DIFFUSE, GREY, KINDS, SPECTRAL, small_table
from tests.integrals.test_sampling import chance

LIGHTS_DEG, TURNED = (0.0, 20.0, 45.0, 60.0, 75.0, 85.0), np.pi / 6
CHANCE = 1e-4  # below this p, samples are not those of the density
DRAWN = 200_000
# Mean weight over the albedo, less 1, in standard errors
STANDARD_ERRORS = 4.0
INTEGRAL = 2e-3  # of the density above and below the horizon, from cells of a quadrature; measured 4e-4
# The heaviest weight over the mean; measured 5.4. That of the sampler of Ward's model is 3.4 at these parameters
HEAVIEST = 8.0

Array = NDArray[Any]


def light(theta_deg: float) -> Array:
    return unit_vector(np.deg2rad(theta_deg), TURNED)


# Places in z and phi: edges of cells are rings around the normal if the light is there, and narrow in phi at grazing
PLACES = {0.0: (400, 4), 45.0: (60, 60), 75.0: (50, 100)}


def expected_shares(kind: str, wi: Array, theta_deg: float) -> Array:
    """The integral of the density over the bins of `chance`, by its mean at some places in each."""
    rows, columns = PLACES[theta_deg]
    z = (np.arange(12 * rows) + 0.5) / (12 * rows)
    phi = -np.pi + (np.arange(16 * columns) + 0.5) * (2.0 * np.pi / (16 * columns))
    density = small_table(kind).pdf(wi, unit_vector(np.arccos(z)[:, np.newaxis], phi))
    return density.reshape(12, rows, 16, columns).mean(axis=(1, 3)) * (2.0 * np.pi / (12 * 16))


@pytest.mark.parametrize("theta_deg", PLACES)
@pytest.mark.parametrize("kind", KINDS)
def test_samples_have_the_density_that_they_say(kind: str, theta_deg: float) -> None:
    wi, table = light(theta_deg), small_table(kind)
    u1, u2 = np.random.default_rng(7).random((2, DRAWN))
    drawn = table.sample(u1, u2, wi)
    shares = expected_shares(kind, wi, theta_deg)
    assert shares.sum() < 1.0 + INTEGRAL
    assert chance(drawn.wr, shares) > CHANCE
    np.testing.assert_allclose(np.linalg.norm(drawn.wr, axis=-1), 1.0, rtol=1e-14)
    np.testing.assert_array_equal(drawn.pdf, table.pdf(wi, drawn.wr))


@pytest.mark.parametrize("kind", KINDS)
def test_weights_average_to_the_albedo(kind: str) -> None:
    table = small_table(kind)
    u1, u2 = np.random.default_rng(11).random((2, DRAWN))
    for theta_deg in LIGHTS_DEG:
        weight = table.sample(u1, u2, light(theta_deg)).weight.reshape(DRAWN, -1)
        column = 1 if table.anisotropic else 0  # albedos of such a table are computed every 30 degrees of phi_i
        albedo = directional_albedo(table, np.array([theta_deg])).albedo[0, column].reshape(-1)
        error = np.std(weight, axis=0) / np.sqrt(DRAWN)
        assert np.all(np.abs(np.mean(weight, axis=0) - albedo) <= STANDARD_ERRORS * error + 1e-4 * albedo)
        assert np.all(weight >= 0.0)
        assert np.all(weight.max(axis=0) <= HEAVIEST * albedo)


def test_no_weight_is_above_its_bound() -> None:
    table = small_table(GREY)
    u1, u2 = np.random.default_rng(3).random((2, 10_000))
    drawn = table.sample(u1, u2, light(70.0))
    above = drawn.wr[:, 2] > 0.0
    f_r = table.lookup_vectors(np.tile(light(70.0), (10_000, 1)), drawn.wr)
    assert np.all(drawn.weight[above] <= np.pi * f_r[above] / (1.0 - LOBE_SHARE))
    assert np.all(drawn.weight[~above] == 0.0)


@pytest.mark.parametrize("kind", [GREY, ANISOTROPIC, SPECTRAL])
def test_is_finite_in_the_corners(kind: str) -> None:
    table = small_table(kind)
    corners = np.array([0.0, 1e-17, 0.25, LOBE_SHARE, 1.0 - 2.0**-53, 1.0])
    theta = np.array([0.0, 1e-9, 1.0, 1.57, np.pi / 2])
    wi = np.concatenate([unit_vector(theta, TURNED), [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]])
    drawn = table.sample(corners[:, None, None], corners[:, None], wi)
    assert drawn.wr.shape == (6, 6, 7, 3)
    assert drawn.pdf.shape == (6, 6, 7)
    assert drawn.weight.shape[:3] == (6, 6, 7)
    for values in drawn:
        assert np.all(np.isfinite(values))
    assert np.all(drawn.pdf >= 0.0)
    assert np.all(drawn.weight[drawn.wr[..., 2] < 0.0] == 0.0)


def test_nan_goes_through_and_bad_numbers_are_named() -> None:
    table = small_table(DIFFUSE)
    drawn = table.sample([0.1, np.nan, 0.9], 0.5, [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [np.nan, 0.0, 1.0]])
    assert np.isfinite(drawn.weight).tolist() == [True, False, False]
    with pytest.raises(ParameterError, match=r"u2: 1\.5 is outside \[0, 1\]"):
        table.sample(0.5, 1.5, [0.0, 0.0, 1.0])
    with pytest.raises(ParameterError, match="wi"):
        table.sample(0.5, 0.5, [0.0, 0.0, 2.0])
    with pytest.raises(ParameterError, match=r"u1, u2, wi.*: the shapes \(3,\), \(4,\), \(\) do not broadcast"):
        table.sample(np.zeros(3), np.zeros(4), [0.0, 0.0, 1.0])
    with pytest.raises(ParameterError, match=r"the shapes \(3,\), \(\), \(4,\) do not broadcast"):
        table.sample(np.zeros(3), 0.5, np.tile([0.0, 0.0, 1.0], (4, 1)))


def test_one_wavelength_adds_no_axis() -> None:
    table = small_table(SPECTRAL)
    assert np.shape(table.sample(0.3, 0.4, light(30.0), 550.0).weight) == ()
    assert np.shape(table.sample(0.3, 0.4, light(30.0), [450.0, 550.0]).weight) == (2,)
    assert np.shape(table.sample(0.3, 0.4, light(30.0)).weight) == (3,)
