"""A second distribution of slopes, GGX: samplers, quadrature, error measurement and audit take it from the lobe."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from brdfdb.audit import sampling as audit_sampling
from brdfdb.geometry import unit_vector
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.integrals.sampling import directions, lobe_of, mixture_density, pdf, sample
from brdfdb.lobes import GAUSSIAN, GGX, Lobe, SlopeDistribution
from brdfdb.materials import Material
from brdfdb.models import MODELS
from brdfdb.parameters import Floats, ModelSpec, Parameter
from brdfdb.tables import error_measurement

ALPHA = Parameter("alpha", "α", "1", 1e-4, 1.0, "width of the slopes")

CHANCE = 1e-4  # below this p, samples are not those of the density
STANDARD_ERRORS = 5.0
SHARES = 1e-5  # of the mass of a density in bins that reach out to t = 1e5
DISTRIBUTIONS = pytest.mark.parametrize("distribution", [GAUSSIAN, GGX], ids=lambda each: each.name)


def microfacets(wi: ArrayLike, wr: ArrayLike, *, alpha: ArrayLike) -> Floats:
    """f_r [1/sr] of mirror facets with GGX's slopes and Smith's masking of each direction."""
    i, r, a2 = np.asarray(wi), np.asarray(wr), ALPHA.check(alpha) ** 2
    h = (i + r) / np.linalg.norm(i + r, axis=-1, keepdims=True)
    cos_i, cos_r, cos_h = np.maximum(i[..., 2], 1e-9), np.maximum(r[..., 2], 1e-9), h[..., 2]
    density = a2 / (np.pi * (cos_h**2 * (a2 - 1.0) + 1.0) ** 2)
    seen = [2.0 / (1.0 + np.sqrt(1.0 + a2 * (1.0 / cos**2 - 1.0))) for cos in (cos_i, cos_r)]
    above = (i[..., 2] >= 0.0) & (r[..., 2] >= 0.0)
    return np.asarray(np.where(above, density * seen[0] * seen[1] / (4.0 * cos_i * cos_r), 0.0))


def spec_of(distribution: SlopeDistribution) -> ModelSpec:
    def lobe(cos_i: Any, *, alpha: ArrayLike) -> Lobe:
        width = np.asarray(alpha, dtype=np.float64)
        return Lobe(np.full(np.shape(cos_i), 0.9), width, width, distribution)

    def unused(*_: Any, **__: Any) -> Floats:
        raise AssertionError

    return ModelSpec("facets", 1, "Facets", "a test", "none", (ALPHA,), unused, microfacets, lobe=lobe)


def light(theta_deg: float) -> NDArray[np.float64]:
    return unit_vector(np.deg2rad(theta_deg), 0.4)


@DISTRIBUTIONS
def test_radius_and_density_are_of_one_distribution(distribution: SlopeDistribution) -> None:
    t2 = np.geomspace(1e-9, 1e4, 200_001)
    beyond = np.array([0.9, 0.5, 0.1, 1e-3])  # shares of slopes
    density = distribution.density(t2)
    mass = np.append(0.0, np.cumsum(np.diff(t2) * (density[1:] + density[:-1]) / 2.0))
    np.testing.assert_allclose(np.interp(distribution.radius(beyond) ** 2, t2, mass), 1.0 - beyond, atol=1e-6)
    assert distribution.radius(np.ones(1)) == [0.0]


@DISTRIBUTIONS
@pytest.mark.parametrize("theta_deg", [10.0, 45.0, 80.0])
def test_samples_have_the_density_of_their_distribution(distribution: SlopeDistribution, theta_deg: float) -> None:
    spec, wi = spec_of(distribution), light(theta_deg)
    drawn = sample(spec, *np.random.default_rng(5).random((2, 40_000)), wi, alpha=0.3)
    lobe = lobe_of(spec, wi, {"alpha": 0.3})
    assert audit_sampling._chance(drawn.wr, wi, lobe) > CHANCE
    np.testing.assert_allclose(drawn.pdf, pdf(spec, wi, drawn.wr, alpha=0.3), rtol=1e-12)
    other = lobe._replace(distribution=GAUSSIAN if distribution is GGX else GGX)
    assert audit_sampling._chance(drawn.wr, wi, other) < 1e-12


@DISTRIBUTIONS
def test_a_density_integrates_to_1(distribution: SlopeDistribution) -> None:
    alpha = np.array([0.2, 0.6])
    lobe = Lobe(np.ones(()), np.asarray(alpha[0]), np.asarray(alpha[1]), distribution)
    t_edges = np.append(0.0, np.geomspace(1e-2, 1e5, 60))
    shares = audit_sampling._shares(light(60.0), lobe, alpha, t_edges)
    assert shares.sum() == pytest.approx(1.0, abs=SHARES)


@DISTRIBUTIONS
@pytest.mark.parametrize("theta_deg", [0.0, 60.0])
def test_the_mean_weight_is_the_albedo(distribution: SlopeDistribution, theta_deg: float) -> None:
    spec = spec_of(distribution)
    weight = sample(spec, *np.random.default_rng(6).random((2, 100_000)), light(theta_deg), alpha=0.1).weight
    albedo, error = directional_albedo(spec, np.deg2rad(theta_deg), 0.4, alpha=0.1, tolerance=1e-7)
    assert error < 1e-6
    assert 0.9 < albedo <= 1.0
    assert abs(weight.mean() - albedo) < STANDARD_ERRORS * weight.std() / np.sqrt(weight.size)
    # of its own facets every lobe direction weighs about as much; a Gaussian never draws the tail
    assert (weight.max() < 2.0) == (distribution is GGX)


@pytest.mark.parametrize("theta_deg", [0.0, 60.0, 89.0])
def test_weights_of_visible_facets_are_the_share_that_the_viewer_sees(theta_deg: float) -> None:
    # Heitz 2018: F G_2 / G_1, here with F = 1 and separable shadowing, G_1 of the viewer
    alpha, wi = 0.7, light(theta_deg)
    lobe = Lobe(np.ones(()), np.asarray(alpha), np.asarray(alpha), GGX, visible=True)
    u1, u2 = np.random.default_rng(8).random((2, 10_000))
    wr = directions(lobe, u1, u2, wi)
    wr = wr[wr[:, 2] > 0.0]
    weight = microfacets(wi, wr, alpha=alpha) * wr[:, 2] / mixture_density(lobe, wi, wr)
    tan2 = 1.0 / wr[:, 2] ** 2 - 1.0
    np.testing.assert_allclose(weight, 2.0 / (1.0 + np.sqrt(1.0 + alpha**2 * tan2)), rtol=1e-9)


def test_visible_facets_of_an_anisotropic_surface_have_their_density() -> None:
    alpha, wi = np.array([0.2, 0.8]), light(75.0)
    lobe = Lobe(np.ones(()), np.asarray(alpha[0]), np.asarray(alpha[1]), GGX, visible=True)
    u1, u2 = np.random.default_rng(9).random((2, 40_000))
    wr = directions(lobe, u1, u2, wi)
    assert audit_sampling._chance(wr, wi, lobe) > CHANCE
    assert audit_sampling._chance(wr, wi, lobe._replace(visible=False)) < 1e-12
    of_all = directions(lobe._replace(visible=False), u1, u2, wi)
    assert np.mean(wr[:, 2] < 0.0) < 0.6 * np.mean(of_all[:, 2] < 0.0)


@DISTRIBUTIONS
def test_errors_are_measured_in_the_lobe_of_the_distribution(
    distribution: SlopeDistribution, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(MODELS, "facets", spec_of(distribution))
    material = Material(name="facets", title="Facets", model="facets", parameters={"alpha": 0.05}, source="a test")
    drawn = error_measurement.draw(material, None, 4000, 7)
    h = (drawn.wi + drawn.wr)[drawn.in_lobe]
    t2 = (h[:, 0] ** 2 + h[:, 1] ** 2) / h[:, 2] ** 2 / 0.05**2
    for beyond in (1.0, 4.0, 25.0):
        share = np.mean([distribution_share(distribution, beyond / width**2) for width in error_measurement.WIDTHS])
        assert stats.binomtest(int(np.count_nonzero(t2 > beyond)), t2.size, float(share)).pvalue > CHANCE
    assert np.mean(drawn.weight) / np.pi == pytest.approx(1.0, abs=0.02)


def distribution_share(distribution: SlopeDistribution, t2: float) -> float:
    """Share of slopes beyond a t^2, in closed form."""
    return float(1.0 / (1.0 + t2) if distribution is GGX else np.exp(-t2))
