"""Made surfaces: heights, slopes and correlation against closed forms, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import j1

from brdfdb.errors import ParameterError
from brdfdb.microgeometry.goniometer import shadowed
from brdfdb.microgeometry.height_map import HeightMap
from brdfdb.microgeometry.surfaces import KINDS, Correlation, MadeSurface, gaussian_field, v_grooves

FIELDS: tuple[Correlation, ...] = ("gaussian", "exponential", "band")


def correlation(kind: str, r: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the closed form of a correlation at distances in lengths of correlation."""
    if kind == "gaussian":
        return np.exp(-(r**2))
    return np.exp(-r) if kind == "exponential" else j1(2.0 * r) / r


@pytest.mark.parametrize("kind", FIELDS)
def test_fields_have_the_heights_and_the_correlation_that_are_asked_for(kind: Correlation) -> None:
    lags = np.array([0, 4, 8, 12, 20])
    along: list[list[NDArray[np.float64]]] = [[], []]
    for seed in range(24):
        field = gaussian_field(
            sigma_0_um=2.0, tau_x_um=1.0, tau_y_um=2.0, step_um=0.125, nodes=256, correlation=kind, seed=seed
        )
        z = field.heights_um
        assert abs(z.mean()) < 1e-12
        along[0].append(np.array([np.mean(z * np.roll(z, lag, axis=0)) for lag in lags]))
        along[1].append(np.array([np.mean(z * np.roll(z, lag, axis=1)) for lag in lags]))
    for products, tau in zip(along, (1.0, 2.0), strict=True):
        expected = 4.0 * correlation(kind, np.maximum(lags * 0.125 / tau, 1e-9))
        error = np.std(products, axis=0, ddof=1) / np.sqrt(24)
        # frequencies beyond the grid's are folded into it, the mean is left out: 2 % of the exponential's peak
        assert np.all(np.abs(np.mean(products, axis=0) - expected) < 3.3 * error + 0.02 * 4.0)
        assert np.all(error < 0.05 * 4.0)


def test_heights_and_slopes_of_a_field_are_gaussian() -> None:
    z = np.concatenate([MadeSurface(nodes=128, steps=4).draw(seed).heights_um.reshape(-1) for seed in range(24)])
    z /= z.std()
    assert np.mean(z**4) == pytest.approx(3.0, abs=0.15)
    assert np.mean(np.abs(z) < 1.0) == pytest.approx(0.6827, abs=0.01)


def test_a_gaussian_correlation_has_the_slope_of_the_closed_form() -> None:
    # sqrt(2) sigma_0 / tau; chords over a tenth of tau are less steep by the factor sqrt((1 - exp(-0.01)) / 0.01)
    realised = [MadeSurface("gaussian", 0.4, nodes=256).draw(seed).realised() for seed in range(16)]
    sigma_0 = np.array([surface.sigma_0_um for surface in realised])
    expected = 0.4 / np.sqrt(2.0) / np.sqrt((1.0 - np.exp(-0.01)) / 0.01)
    assert abs(sigma_0.mean() - expected) < 3.0 * sigma_0.std(ddof=1) / 4.0
    assert np.mean([surface.tau_x_um for surface in realised]) == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("kind", FIELDS)
@pytest.mark.parametrize("slopes", [(0.3, None), (0.5, 0.3), (0.3, 0.5)])
def test_facets_have_the_slopes_that_are_asked_for(kind: Correlation, slopes: tuple[float, float | None]) -> None:
    surface = MadeSurface(kind, *slopes, nodes=320, steps=10)
    realised = [surface.draw(seed).realised() for seed in range(12)]
    for found, asked in (
        ([each.slope_x for each in realised], slopes[0]),
        ([each.slope_y for each in realised], slopes[1] or slopes[0]),
    ):
        variance = np.square(found)
        error = variance.std(ddof=1) / np.sqrt(12)
        assert abs(variance.mean() - asked**2) < 3.3 * error
        assert error < 0.1 * asked**2
    assert surface.isotropic == (slopes[1] is None)
    assert surface.gaussian_slopes == (slopes[0], slopes[1] or slopes[0])


def test_v_grooves_have_one_slope() -> None:
    realised = MadeSurface("grooves", 0.7).draw(0).realised()
    assert realised.slope_x == pytest.approx(0.7, rel=1e-12)
    assert realised.slope_y == 0.0
    normals = v_grooves(np.radians(35.0)).triangles().normals
    np.testing.assert_allclose(normals[:, 2], np.cos(np.radians(35.0)), rtol=1e-12)
    assert normals[:, 0].sum() == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("all_azimuths", [False, True])
def test_slope_angles_of_gaussian_grooves_have_their_density_over_the_horizontal_area(all_azimuths: bool) -> None:
    sigma = 0.4
    surface = MadeSurface("gaussian-grooves", np.tan(sigma), all_azimuths=all_azimuths, nodes=1024)
    normals = surface.draw(5).triangles().normals
    theta_a = np.arccos(normals[:, 2])  # all facets have the same horizontal area
    x = np.linspace(0.0, np.pi / 2, 20_001)
    density = np.exp(-0.5 * (x / sigma) ** 2) * (np.sin(x) if all_azimuths else 1.0)
    for power in (1, 2, 4):
        expected = np.sum(x**power * density) / np.sum(density)
        assert np.mean(theta_a**power) == pytest.approx(expected, rel=0.01)
    assert surface.isotropic == all_azimuths
    assert surface.gaussian_slopes is None


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "grooves"])
def test_the_seed_decides(kind: Any) -> None:
    surface = MadeSurface(kind, nodes=64, steps=4)
    np.testing.assert_array_equal(surface.draw(3).heights_um, surface.draw(3).heights_um)
    assert not np.array_equal(surface.draw(3).heights_um, surface.draw(4).heights_um)
    assert surface.draw(3).periodic


@pytest.mark.parametrize(
    ("arguments", "parameter"),
    [
        ({"kind": "fractal"}, "kind"),
        ({"slope": 0.0}, "slope"),
        ({"slope": np.nan}, "slope"),
        ({"slope_y": -0.1}, "slope_y"),
        ({"slope_y": 0.01}, "slope_y"),
        ({"kind": "grooves", "slope_y": 0.3}, "slope_y"),
        ({"all_azimuths": True}, "all_azimuths"),
        ({"nodes": 8}, "nodes"),
        ({"nodes": 100_000}, "nodes"),
        ({"steps": 1}, "steps"),
        ({"steps": 100}, "nodes"),  # 512 nodes are five lengths of correlation
    ],
)
def test_what_cannot_be_made_is_refused(arguments: dict[str, Any], parameter: str) -> None:
    with pytest.raises(ParameterError) as refused:
        MadeSurface(**arguments)
    assert refused.value.parameter == parameter


@pytest.mark.parametrize(
    ("arguments", "parameter"),
    [
        ({"sigma_0_um": 0.0}, "sigma_0_um"),
        ({"step_um": -1.0}, "step_um"),
        ({"tau_x_um": 2.0}, "tau_x_um"),
        ({"tau_y_um": 0.15}, "tau_y_um"),
        ({"correlation": "fractal"}, "correlation"),
    ],
)
def test_fields_that_do_not_fit_on_their_grid_are_refused(arguments: dict[str, Any], parameter: str) -> None:
    given = {"sigma_0_um": 1.0, "tau_x_um": 1.0, "step_um": 0.1, "nodes": 128, **arguments}
    with pytest.raises(ParameterError) as refused:
        gaussian_field(**given)
    assert refused.value.parameter == parameter


def test_grooves_of_no_slope_are_refused() -> None:
    with pytest.raises(ParameterError, match="90 degrees is not in"):
        v_grooves(np.pi / 2)


def test_rays_see_the_shape_alone_at_both_ends_of_the_range_of_steps() -> None:
    rough = gaussian_field(sigma_0_um=0.3, tau_x_um=1.0, step_um=0.1, nodes=100, seed=1)
    light = [[np.sin(1.4), 0.0, np.cos(1.4)]]
    shares = []
    for step_um in (1e-6, 0.1, 1e9):
        scaled = HeightMap(rough.heights_um * (step_um / 0.1), step_um, step_um, periodic=True)
        shares.append(shadowed(scaled, light, rays=1024, seed=0)[0])
    assert 0.2 < shares[1] < 0.6
    assert shares == pytest.approx([shares[1]] * 3, abs=0.002)  # two rays of 1024


@pytest.mark.parametrize(
    ("height_um", "step_x_um", "step_y_um", "sentence"),
    [
        (1.0, 1e-7, 1.0, r"step_x_um: 1e-07 um is outside \[1e-06, 1e\+09\] um"),
        (1.0, 1.0, 1e15, r"step_y_um: 1e\+15 um is outside"),
        (1.0, float("nan"), 1.0, "step_x_um: nan um is outside"),
        (1e15, 1.0, 1.0, r"heights_um: a range of heights of 1e\+15 um is too large for steps of 1 um; allowed are up"),
        (1.0, 0.1, 1e5, r"heights_um: a length of 1e\+05 um is too large for steps of 0\.1 um"),
    ],
)
def test_maps_beyond_the_digits_of_rays_are_refused(
    height_um: float, step_x_um: float, step_y_um: float, sentence: str
) -> None:
    with pytest.raises(ParameterError, match=sentence):
        HeightMap(np.array([[0.0, height_um], [0.0, 0.0]]), step_x_um, step_y_um)
