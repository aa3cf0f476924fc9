"""Importance sampling of every model: samples against their density, weights against the albedo, and Ward's eq. 7."""

from typing import Any

import numpy as np
import pytest
from scipy import stats

from brdfdb import models
from brdfdb.geometry import unit_vector
from brdfdb.integrals import sampling
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.integrals.sampling import Sample, pdf, sample
from brdfdb.models import MODELS
from brdfdb.parameters import Array
from brdfdb.reference import ward_1992
from tests.models.draws import middle

HALF_PI = np.pi / 2
PHI = 0.4
GOLD = {"wavelength_nm": 500.0, "n": 0.9, "k": 1.9}
WARD = {"rho_d": 0.2, "rho_s": 0.5, "alpha_x": 0.15, "alpha_y": 0.4}

# Parameters, and the heaviest weight of 2^17 samples at each of 0, 60 and 85 degrees, rounded up. Weights of Ward's
# lobe are rho_s (h.i) cos^3(delta) times sqrt(cos_r / cos_i), 1 / cos_i or, bounded, at most 2 rho_s. Minnaert's grow
# as cos_r^(k - 1), Oren-Nayar's as far as theta_i lets them. Other models are sampled in the middle of their ranges
CASES: dict[str, tuple[dict[str, float], float]] = {
    "lambert": ({"rho": 0.7}, 0.7 + 1e-12),
    "minnaert": ({"k": 0.7, "rho": 0.8}, 7.2),
    "oren_nayar": ({"rho": 0.9, "sigma": 0.5}, 4.13),
    "oren_nayar_qualitative": ({"rho": 0.9, "sigma": 0.5}, 4.12),
    "ward": (WARD, 0.71),
    "ward_half_vector": (WARD, 1.23),
    "ward_duer": (WARD, 2.22),
    "ward_bounded": (WARD, 1.18),
    "he_torrance": (GOLD | {"sigma_0_um": 0.3, "tau_um": 3.0, "a": 0.1}, 2.32),
}
SLOW = {"oren_nayar_gaussian": 32}  # microseconds a value: that many times fewer samples

# The integral of a density over the sphere, worst measured: 2.3e-7, at the edge of the cosine on the horizon
DENSITY = 3e-7
# Of visible facets, worst measured: 3.6e-6, opposite to the light, where the density has a limit for each azimuth
DENSITY_OF_VISIBLE = 5e-6
CHANCE = 1e-4  # below this p, samples are not those of the density
STANDARD_ERRORS = 5.0
BATCHES, STRATA = 16, (128, 64)  # 2^17 samples in all
PDF = 2e-14  # Ward's density against 40 digits, worst measured: 1.6e-14
EQ_7 = 2e-15  # samples against eq. 7 as the paper writes it, worst measured: 1.2e-15

every_model = pytest.mark.parametrize("name", MODELS)
every_theta = pytest.mark.parametrize("theta_deg", [0.0, 60.0, 85.0])


def parameters_of(name: str) -> dict[str, float]:
    if name in CASES:
        return CASES[name][0]
    spec = MODELS[name]
    return middle(spec) | (GOLD if spec.spectral else {})


def light(theta_deg: float) -> Array:
    return unit_vector(np.deg2rad(theta_deg), PHI)


def stratified(rng: np.random.Generator, shape: tuple[int, int]) -> tuple[Array, Array]:
    """Uniform numbers, one in each cell of a grid."""
    u1 = (np.arange(shape[0])[:, None] + rng.random(shape)) / shape[0]
    u2 = (np.arange(shape[1]) + rng.random(shape)) / shape[1]
    return u1.ravel(), u2.ravel()


def gauss(low: Array, high: Array, nodes: int) -> tuple[Array, Array]:
    """Nodes and weights on each interval, as rows."""
    x, weight = np.polynomial.legendre.leggauss(nodes)
    half = (high - low)[:, None] / 2.0
    return (high + low)[:, None] / 2.0 + half * x, half * weight


Z_EDGES, PHI_EDGES = np.linspace(0.0, 1.0, 13), np.linspace(-np.pi, np.pi, 17)


def expected_shares(density: Any) -> Array:
    """The integral of a density over bins of the upper hemisphere, even in z and phi."""
    z, z_weight = gauss(Z_EDGES[:-1], Z_EDGES[1:], 24)
    phi, phi_weight = gauss(PHI_EDGES[:-1], PHI_EDGES[1:], 24)
    wr = unit_vector(np.arccos(z)[:, :, None, None], phi)
    return np.einsum("abcd,ab,cd->ac", density(wr), z_weight, phi_weight)


def chance(wr: Array, shares: Array) -> float:
    """p of the samples in bins above the horizon, and in one below, by Pearson's chi-square."""
    above = wr[wr[:, 2] >= 0.0]
    phi = np.arctan2(above[:, 1], above[:, 0])
    counts, _, _ = np.histogram2d(above[:, 2], phi, bins=(Z_EDGES, PHI_EDGES))
    below = len(wr) - len(above)
    expected = len(wr) * np.append(shares.ravel(), max(1.0 - shares.sum(), 0.0))
    found = np.append(counts.ravel(), below)
    rare = expected < 10.0
    expected = np.append(expected[~rare], expected[rare].sum())
    found = np.append(found[~rare], found[rare].sum())
    if expected[-1] < 10.0:  # too rare even together: Poisson
        if found[-1] and stats.poisson.sf(found[-1] - 1, expected[-1]) < CHANCE:
            return 0.0
        expected, found = expected[:-1], found[:-1]
    return float(stats.chi2.sf(np.sum((found - expected) ** 2 / expected), len(expected) - 1))


@every_theta
@every_model
def test_samples_have_the_density_that_they_say(name: str, theta_deg: float) -> None:
    rng = np.random.default_rng(7)
    wi, parameters = light(theta_deg), parameters_of(name)
    u1, u2 = rng.random((2, 200_000 // SLOW.get(name, 1)))
    drawn = sample(name, u1, u2, wi, **parameters)
    shares = expected_shares(lambda wr: pdf(name, wi, wr, **parameters))
    assert shares.sum() < 1.0 + DENSITY
    assert chance(drawn.wr, shares) > CHANCE
    np.testing.assert_allclose(np.linalg.norm(drawn.wr, axis=-1), 1.0, rtol=2e-15)
    np.testing.assert_array_equal(drawn.pdf, pdf(name, wi, drawn.wr, **parameters))


def integral_of_visible(name: str, wi: Array, parameters: dict[str, float]) -> float:
    """The integral of a density over the sphere; it is 0 below the plane of directions mirrored in upright facets."""
    edges = np.array([-wi[2], 0.0, 0.3, 0.6, 0.9, 1.0])
    z, z_weight = gauss(edges[:-1], edges[1:], 60)
    psi = np.linspace(0.0, 2.0 * np.pi, 600, endpoint=False)
    wr = unit_vector(np.arccos(z.ravel())[:, None], psi)
    total = np.sum(pdf(name, wi, wr, **parameters) * z_weight.ravel()[:, None]) * 2.0 * np.pi / psi.size
    below = pdf(name, wi, unit_vector(np.arccos(np.linspace(-1.0, -wi[2], 5)[:-1]), PHI), **parameters)
    assert (below == 0.0).all()
    return float(total)


@every_theta
@every_model
def test_the_density_integrates_to_one_over_the_sphere(name: str, theta_deg: float) -> None:
    # around the direction of -wi, where the density of mirrored half vectors has a pole in 1 / distance
    wi, parameters = light(theta_deg), parameters_of(name)
    if sampling.lobe_of(MODELS[name], wi, parameters).visible:
        assert integral_of_visible(name, wi, parameters) == pytest.approx(1.0, abs=DENSITY_OF_VISIBLE)
        return
    gamma, gamma_weight = gauss(np.linspace(0.0, np.pi, 9)[:-1], np.linspace(0.0, np.pi, 9)[1:], 60)
    psi = np.linspace(0.0, 2.0 * np.pi, 600, endpoint=False)
    across = unit_vector(np.deg2rad(theta_deg) + HALF_PI, PHI)
    local = unit_vector(gamma.ravel()[:, None], psi)
    wr = local[..., :1] * across + local[..., 1:2] * np.cross(wi, across) - local[..., 2:] * wi
    density = pdf(name, wi, wr, **parameters)
    total = np.sum(density * (gamma_weight * np.sin(gamma)).ravel()[:, None]) * 2.0 * np.pi / psi.size
    assert total == pytest.approx(1.0, abs=DENSITY)


@every_theta
@every_model
def test_weights_average_to_the_albedo(name: str, theta_deg: float) -> None:
    rng = np.random.default_rng(11)
    wi, parameters = light(theta_deg), parameters_of(name)
    strata = (STRATA[0] // SLOW.get(name, 1), STRATA[1])
    batches = [sample(name, *stratified(rng, strata), wi, **parameters).weight for _ in range(BATCHES)]
    means = [np.mean(each) for each in batches]
    albedo, error = directional_albedo(name, np.deg2rad(theta_deg), PHI, **parameters)
    standard_error = np.std(means, ddof=1) / np.sqrt(BATCHES)
    assert abs(np.mean(means) - albedo) <= STANDARD_ERRORS * standard_error + error + 1e-12
    weights = np.concatenate(batches)
    assert (weights >= 0.0).all()
    assert name not in CASES or weights.max() <= CASES[name][1]


@every_model
def test_is_finite_at_the_pole_at_grazing_and_in_the_corners_of_u(name: str) -> None:
    corners = np.array([0.0, 5e-324, 1e-17, 0.25, 0.5, 1.0 - 2.0**-53, 1.0])
    theta = np.array([0.0, 1e-9, 1.0, 1.57, np.nextafter(HALF_PI, 0.0), HALF_PI])
    wi = np.concatenate([unit_vector(theta, PHI), [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]])
    drawn = sample(name, corners[:, None, None], corners[:, None], wi, **parameters_of(name))
    assert drawn.wr.shape == (7, 7, 8, 3)
    assert drawn.pdf.shape == drawn.weight.shape == (7, 7, 8)
    for values in drawn:
        assert np.isfinite(values).all()
    assert (drawn.pdf >= 0.0).all()
    assert (drawn.weight >= 0.0).all()
    assert (drawn.weight[drawn.wr[..., 2] < 0.0] == 0.0).all()


@every_model
def test_nan_goes_through_and_a_light_below_the_horizon_weighs_nothing(name: str) -> None:
    parameters = parameters_of(name)
    wi = np.array([[0.0, 0.0, 1.0], [np.nan, 0.6, 0.8], [0.0, 0.6, -0.8]])
    drawn = sample(name, 0.9, [0.3, 0.3, 0.3], wi, **parameters)
    for each in drawn:
        assert np.isnan(each[1]).all()
        assert np.isfinite(each[[0, 2]]).all()
    assert drawn.weight[2] == 0.0
    assert np.isnan(pdf(name, wi[1], wi[0], **parameters))
    assert np.isnan(sample(name, np.nan, 0.3, wi[0], **parameters).weight)
    assert np.isnan(sample(name, 0.3, np.nan, wi[0], **parameters).weight)


@every_model
def test_broadcasts_and_scalars_give_scalars(name: str) -> None:
    parameters = parameters_of(name)
    wi = light(30.0)
    one = sample(name, 0.3, 0.6, wi, **parameters)
    assert isinstance(one, Sample)
    assert one.wr.shape == (3,)
    assert isinstance(one.weight, np.float64)
    assert isinstance(one.pdf, np.float64)
    assert isinstance(pdf(name, wi, one.wr, **parameters), np.float64)
    several = sample(MODELS[name], [0.3, 0.4], [[0.6], [0.7], [0.8]], wi.astype(np.float32), **parameters)
    assert several.wr.shape == (3, 2, 3)
    assert several.weight.dtype == np.float64
    np.testing.assert_allclose(several.wr[0, 0], one.wr, atol=1e-6)
    stretched = {key: np.full((2, 1), value) for key, value in parameters.items()}
    rows = sample(name, [0.3, 0.4, 0.5], 0.6, wi, **stretched)
    assert rows.wr.shape == (2, 3, 3)
    assert rows.pdf.shape == rows.weight.shape == (2, 3)
    np.testing.assert_allclose(rows.weight[1, 0], one.weight, rtol=1e-12)


def test_a_surface_that_reflects_nothing_weighs_nothing() -> None:
    black = {"rho_d": 0.0, "rho_s": 0.0, "alpha_x": 0.1, "alpha_y": 0.1}
    assert sample("ward", 0.3, 0.6, light(30.0), **black).weight == 0.0
    smooth = GOLD | {"sigma_0_um": 0.0, "tau_um": 3.0}
    assert sample("he_torrance", 0.3, 0.6, light(30.0), **smooth).weight == 0.0


def test_refuses_what_is_out_of_range() -> None:
    up, long = [0.0, 0.0, 1.0], [0.0, 0.0, 2.0]
    for model, u1, u2, wi, rho, message in (
        ("lambert", -0.1, 0.5, up, 0.5, r"u1: -0\.1 is outside \[0, 1\]$"),
        ("lambert", 0.5, [0.1, 1.5], up, 0.5, r"u2: 1\.5 is outside \[0, 1\]$"),
        ("lambert", "a", 0.5, up, 0.5, r"u1: 'a' is not a number in \[0, 1\]$"),
        ("lambert", 0.1, 0.5, up, 2.0, "rho: 2 is outside"),
        ("lambert", 0.1, 0.5, long, 0.5, "wi: .* has the length"),
        ("phong", 0.1, 0.5, up, 0.5, "model: 'phong' is not one of "),
    ):
        with pytest.raises(ValueError, match=f"^{message}"):
            sample(model, u1, u2, wi, rho=rho)
    with pytest.raises(ValueError, match=r"^alpha_x: 0 is outside"):
        pdf("ward", up, up, **WARD | {"alpha_x": 0.0})


def equation_7(u1: Array, u2: Array, wi: Array, alpha_x: float, alpha_y: float, *, arctan: bool) -> Array:
    """Directions by eq. 7 as it stands, with the arctan that (7a) needs or, as printed, without."""
    turn = 2.0 * np.pi * u2
    phi = np.arctan(alpha_y / alpha_x * np.tan(turn)) + np.pi * np.round(turn / np.pi)  # in its quadrant
    delta = np.sqrt(-np.log(u1) / (np.cos(phi) ** 2 / alpha_x**2 + np.sin(phi) ** 2 / alpha_y**2))
    h = unit_vector(np.arctan(delta) if arctan else delta, phi)
    return np.asarray(2.0 * np.sum(h * wi, axis=-1, keepdims=True) * h - wi)


@every_theta
def test_ward_samples_are_those_of_eq_7_with_its_arctan(theta_deg: float) -> None:
    rng = np.random.default_rng(1992)
    u1, u2 = rng.random((2, 20_000))
    wi = light(theta_deg)
    drawn = sample("ward", u1, u2, wi, rho_d=0.0, rho_s=0.5, alpha_x=0.15, alpha_y=0.4)
    literal = equation_7(u1, u2, wi, 0.15, 0.4, arctan=True)
    np.testing.assert_allclose(drawn.wr, literal, atol=EQ_7)
    f_r = models.ward_vectors(wi, drawn.wr, rho_d=0.0, rho_s=0.5, alpha_x=0.15, alpha_y=0.4)
    expected = f_r * drawn.wr[:, 2] / drawn.pdf
    np.testing.assert_allclose(drawn.weight, np.where(drawn.wr[:, 2] > 0.0, expected, 0.0), rtol=1e-13)
    # its closed form
    h = wi + drawn.wr
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    above = drawn.wr[:, 2] > 1e-6
    closed = 0.5 * (h @ wi) * h[:, 2] ** 3 * np.sqrt(np.maximum(drawn.wr[:, 2], 0.0) / wi[2])
    np.testing.assert_allclose(drawn.weight[above], closed[above], rtol=1e-10)


@every_theta
def test_eq_7a_as_printed_has_another_density(theta_deg: float) -> None:
    rng = np.random.default_rng(7)
    wi = light(theta_deg)
    u1, u2 = rng.random((2, 200_000))
    shares = expected_shares(lambda wr: pdf("ward", wi, wr, rho_d=0.0, rho_s=1.0, alpha_x=0.15, alpha_y=0.4))
    right, printed = (equation_7(u1, u2, wi, 0.15, 0.4, arctan=arctan) for arctan in (True, False))
    assert chance(right, shares) > CHANCE
    assert chance(printed, shares) < 1e-100


def test_the_density_of_wards_lobe_against_the_reference() -> None:
    rng = np.random.default_rng(77)
    theta_i, theta_r = rng.uniform(0.0, 1.5, (2, 200))
    phi_i, phi_r = rng.uniform(-np.pi, np.pi, (2, 200))
    alpha_x, alpha_y = rng.uniform(0.3, 1.5, (2, 200))
    lobe = {"rho_d": 0.0, "rho_s": 1.0, "alpha_x": alpha_x, "alpha_y": alpha_y}
    values = pdf("ward", unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r), **lobe)
    compared = 0
    for value, *arguments in zip(values, theta_i, phi_i, theta_r, phi_r, alpha_x, alpha_y, strict=True):
        expected = float(ward_1992.sampling_pdf(*arguments))
        if expected > 1e-30:
            assert value == pytest.approx(expected, rel=PDF)
            compared += 1
    assert compared > 100


@pytest.mark.parametrize("alpha", [1e-6, 1e-3, 2.0])
def test_ward_weights_do_not_depend_on_how_narrow_the_lobe_is(alpha: float) -> None:
    # their mean is the albedo, about rho_s cos(theta_i) for narrow lobes
    rng = np.random.default_rng(3)
    lobe = {"rho_d": 0.0, "rho_s": 1.0, "alpha_x": alpha, "alpha_y": alpha}
    drawn = sample("ward", *stratified(rng, STRATA), light(60.0), **lobe)
    albedo, _ = directional_albedo("ward", np.deg2rad(60.0), **lobe)
    assert np.mean(drawn.weight) == pytest.approx(albedo, abs=2e-3)
    assert drawn.weight.max() < 1.0


def test_a_model_is_called_with_its_own_defaults_and_names_itself_when_it_cannot_be() -> None:
    wi = [0.6, 0.0, 0.8]
    with_default = sample("oren_nayar_body_surface", 0.3, 0.4, wi, rho=0.8, sigma=0.3, k_s=0.05)
    given = sample("oren_nayar_body_surface", 0.3, 0.4, wi, rho=0.8, sigma=0.3, k_s=0.05, k_b=1.0)
    np.testing.assert_array_equal(with_default.wr, given.wr)
    assert sample("torrance_sparrow", 0.3, 0.4, wi, sigma=0.2, n=1.5).weight > 0.0
    with pytest.raises(TypeError, match=r"^ward: missing a required argument: 'rho_s'$"):
        sample("ward", 0.1, 0.1, wi, rho_d=0.1)
    with pytest.raises(TypeError, match=r"^ward: got an unexpected keyword argument 'foo'$"):
        pdf("ward", wi, wi, rho_d=0.1, rho_s=0.1, alpha_x=0.1, alpha_y=0.1, foo=1)
