"""The models of porous layers against transport of light in them, which shares no formula with their fits."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb import models
from brdfdb.integrals.quadrature import directional_albedo

Array = NDArray[np.float64]

NODES, AZIMUTHS = 24, 256
THINNEST, DOUBLINGS = 2.0**-22, 36  # optical depth of the first layer; the last is 16 000 deep: later, rounding grows


class Transport(NamedTuple):
    """Mean of f_r over azimuths and the coefficient of cos(delta_phi) [1/sr] at pairs of cosines."""

    cosines: Array
    weights: Array
    mean: Array
    first_cosine: Array


def phase_function(cosine: Array) -> Array:
    """Return the light [1/sr] that a Lambertian sphere deflects by an angle of this cosine."""
    u = np.clip(cosine, -1.0, 1.0)
    return np.asarray(2.0 / (3.0 * np.pi**2) * (np.sqrt(1.0 - u * u) - u * np.arccos(u)))


@cache
def transport(albedo: float) -> Transport:
    """Solve a deep layer of Lambertian spheres by adding layers of equal depth to themselves (van de Hulst 1963)."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    u, w = 0.5 * (x + 1.0), 0.5 * w
    azimuth = (np.arange(AZIMUTHS) + 0.5) * 2.0 * np.pi / AZIMUTHS
    sines = np.sqrt(1.0 - u * u)
    across = (sines[:, None] * sines)[..., None] * np.cos(azimuth)
    along = (u[:, None] * u)[..., None]
    modes = []
    for cosine in (np.ones(AZIMUTHS), np.cos(azimuth)):
        passed = (phase_function(along + across) * cosine).mean(axis=-1)
        turned = (phase_function(-along + across) * cosine).mean(axis=-1)
        step = 2.0 * np.pi * albedo * THINNEST / u[:, None] * w
        r, t = step * turned, np.diag(1.0 - THINNEST / u) + step * passed
        for _ in range(DOUBLINGS):
            down = np.linalg.solve(np.eye(NODES) - r @ r, t)
            r, t = r + t @ r @ down, t @ down
        modes.append(r / (w * u) / (2.0 * np.pi))
    # azimuths of travel: the light's points into the layer, so that its cosine has the other sign
    return Transport(u, w, modes[0], -2.0 * modes[1])


def modes_of(model: Any, albedo: float) -> tuple[Array, Array]:
    """Return the same two coefficients of a model."""
    theta = np.arccos(transport(albedo).cosines)
    phi = (np.arange(64) + 0.5) * 2.0 * np.pi / 64
    f_r = model(theta[:, None, None], 0.0, theta[None, :, None], phi, rho=albedo)
    return f_r.mean(axis=-1), 2.0 * (f_r * np.cos(phi)).mean(axis=-1)


def test_a_deep_layer_that_absorbs_nothing_returns_all_light() -> None:
    deep = transport(1.0)
    np.testing.assert_allclose(2.0 * np.pi * deep.mean @ (deep.weights * deep.cosines), 1.0, atol=5e-5)  # 2.6e-5


@pytest.mark.parametrize(
    ("albedo", "mean", "first_cosine"),
    # The worst: 0.00150 and 0.0010, 0.0036 and 0.0043, 0.0096 and 0.0069, 0.0273 and 0.0073
    [(0.1, 0.0016, 0.0011), (0.5, 0.0037, 0.0044), (0.9, 0.0097, 0.0069), (1.0, 0.0274, 0.0074)],
)
def test_lambertian_spheres_scatter_as_transport_says(albedo: float, mean: float, first_cosine: float) -> None:
    expected, (f_0, f_1) = transport(albedo), modes_of(models.lambert_sphere, albedo)
    np.testing.assert_allclose(f_0, expected.mean, rtol=mean)
    np.testing.assert_allclose(f_1, expected.first_cosine, atol=first_cosine * np.abs(expected.first_cosine).max())


def test_the_roughest_vmf_surface_is_a_layer_of_spheres_within_its_fit() -> None:
    def roughest(*angles: Any, rho: float) -> Array:
        return np.asarray(models.vmf_diffuse(*angles, rho=rho, roughness=1.0))

    expected, (f_0, _) = transport(0.9), modes_of(roughest, 0.9)
    np.testing.assert_allclose(f_0, expected.mean, rtol=0.134)  # 0.133
    weight = np.outer(expected.weights * expected.cosines, expected.weights * expected.cosines)
    assert np.sum(weight * abs(f_0 - expected.mean)) <= 0.05 * np.sum(weight * expected.mean)


def test_a_vmf_surface_reflects_as_much_as_its_excess_says() -> None:
    albedo, error = directional_albedo("vmf_diffuse", np.deg2rad(89.9), rho=1.0, roughness=0.98)
    assert f"{albedo:.2f}" in models.MODELS["vmf_diffuse"].excess
    assert error < 1e-4
