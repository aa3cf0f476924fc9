"""What every model of the registry promises: a model is held to all of it from the day it is registered."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brdfdb.models import MODELS
from brdfdb.parameters import ModelSpec, Parameter
from tests.models import draws

# Relative differences, each just above the worst measured, which stands behind it
pytestmark = pytest.mark.filterwarnings("ignore::brdfdb.errors.DegreesWarning")  # azimuths of many turns are meant

RECIPROCITY = 1e-12  # 0: each formula is symmetric to the last bit; the rest is room for other vector units
AZIMUTH = 1e-13  # 8.6e-14 (parallel cavities): what the rounding of phi + 2 pi does
# Of a lobe without a uniform part the exponent multiplies that rounding: 5.3e-12, where the lobe is down to 1e-142
AZIMUTH_OF = {"torrance_sparrow": 6e-12, "beckmann": 6e-12, "beckmann_separable": 6e-12}
AZIMUTH_OF["ross_li"] = 2e-11  # 1.2e-11, where kernels of both signs add up to next to nothing


@draws.every_model
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_is_finite_and_not_negative_in_every_corner(spec: ModelSpec, dtype: type) -> None:
    angles = [angle.astype(dtype) for angle in draws.corner_angles()]
    parameters = {name: values.reshape(-1, 1, 1, 1, 1) for name, values in draws.corner_parameters(spec).items()}
    values = spec.evaluate(*angles, **parameters)
    assert values.shape == (next(iter(parameters.values())).size, 7, 5, 7, 5)
    assert values.dtype == dtype
    assert np.isfinite(values).all()
    assert (values >= 0.0).all()
    if spec.specular:
        reflected = draws.specular(spec, angles[0], parameters)
        assert reflected.dtype == dtype
        assert ((reflected >= 0.0) & (reflected <= 1.0)).all()


@draws.every_model
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_is_finite_and_not_negative_at_every_degree(spec: ModelSpec, dtype: type) -> None:
    rng = np.random.default_rng(90)
    theta = np.deg2rad(np.arange(0.0, 91.0, 5.0 if spec.name in draws.SLOW else 1.0)).astype(dtype)
    phi = np.deg2rad(np.arange(0.0, 181.0, 15.0)).astype(dtype)
    assert theta[-1] == dtype(draws.HALF_PI)
    for _ in range(3 if spec.name in draws.SLOW else 10):
        parameters = draws.drawn(spec, rng)
        values = spec.evaluate(theta[:, None, None], dtype(0.0), theta[:, None], phi, **parameters)
        assert np.isfinite(values).all(), parameters
        assert (values >= 0.0).all(), parameters
        assert (values > 0.0).any(), parameters
        if spec.specular:
            reflected = draws.specular(spec, theta, parameters)
            assert ((reflected >= 0.0) & (reflected <= 1.0)).all(), parameters


def within(parameter: Parameter) -> st.SearchStrategy[float]:
    """Any value of a parameter; where the range spans decades, of every decade."""
    uniform = st.floats(parameter.low, parameter.high)
    if parameter.high < 100.0 * max(parameter.low, 1e-2):
        return uniform
    decades = st.floats(np.log10(max(parameter.low, 1e-9)), np.log10(parameter.high))
    return st.one_of(uniform, decades.map(lambda x: min(max(10.0**x, parameter.low), parameter.high)))


@draws.every_model
@given(data=st.data())
def test_any_arguments_give_a_finite_reciprocal_value(spec: ModelSpec, data: st.DataObject) -> None:
    theta = st.one_of(st.floats(0.0, draws.HALF_PI), st.sampled_from([0.0, draws.HALF_PI]))
    phi = st.floats(-7.0, 7.0)
    theta_i, phi_i, theta_r, phi_r = (data.draw(strategy) for strategy in (theta, phi, theta, phi))
    parameters = {
        parameter.name: data.draw(within(parameter), parameter.name) for parameter in draws.parameters_of(spec)
    }
    value = spec.evaluate(theta_i, phi_i, theta_r, phi_r, **parameters)
    assert 0.0 <= value < np.inf
    assert spec.evaluate(theta_r, phi_r, theta_i, phi_i, **parameters) == pytest.approx(
        value, rel=RECIPROCITY, abs=draws.TINY
    )
    if spec.specular:
        assert 0.0 <= draws.specular(spec, theta_i, parameters) <= 1.0


@draws.every_model
def test_is_zero_just_below_the_horizon(spec: ModelSpec) -> None:
    parameters = draws.drawn(spec, np.random.default_rng(1))
    for dtype, horizon in ((np.float64, draws.HALF_PI), (np.float32, draws.HORIZON_32)):
        at, above, below, opposite = dtype(horizon), dtype(0.3), np.nextafter(dtype(horizon), dtype(4.0)), dtype(np.pi)
        for under in (below, opposite):
            assert spec.evaluate(under, dtype(0.1), above, dtype(2.0), **parameters) == 0.0
            assert spec.evaluate(above, dtype(0.1), under, dtype(2.0), **parameters) == 0.0
            assert spec.evaluate(under, dtype(0.1), under, dtype(2.0), **parameters) == 0.0
            if spec.specular:
                assert draws.specular(spec, under, parameters) == 0.0
        values = spec.evaluate(np.array([above, below, at]), dtype(0.1), above, dtype(2.0), **parameters)
        assert values.dtype == dtype
        assert values[1] == 0.0
        assert values[0] > 0.0


@draws.every_model
def test_grazing_pole_says_which_models_grow_without_bound(spec: ModelSpec) -> None:
    rng = np.random.default_rng(89)
    parameters = {name: values[:, None] for name, values in draws.drawn(spec, rng, 50).items()}
    phi = np.array([0.0, 1.0, np.pi])

    def largest(distance: float) -> float:
        theta = draws.HALF_PI - distance
        return float(np.max(spec.evaluate(theta, 0.0, theta, phi, **parameters)))

    growth = largest(1e-9) / largest(1e-3)
    assert growth > 1e3 if spec.grazing_pole else growth < 10.0


def asymmetry(spec: ModelSpec, seed: int) -> tuple[Callable[..., Any], Callable[..., None]]:
    """Values of 4000 draws after a turn of light and viewer, and the assertion that a turn changed nothing."""
    rng = np.random.default_rng(seed)
    theta_i, phi_i, theta_r, phi_r = draws.drawn_angles(rng, 4000)
    parameters = draws.drawn(spec, rng, 4000)

    def turned(light: Any, viewer: Any, sign: int = 1, **changed: Any) -> Any:
        return spec.evaluate(theta_i, sign * phi_i + light, theta_r, sign * phi_r + viewer, **parameters | changed)

    def same(values: Any, **changed: Any) -> None:
        tolerance = AZIMUTH_OF.get(spec.name, AZIMUTH)
        np.testing.assert_allclose(values, turned(0.0, 0.0, **changed), rtol=tolerance, atol=draws.TINY)

    return turned, same


@draws.every_model
def test_has_the_period_of_the_azimuth_turns_with_the_surface_and_is_its_mirror_image(spec: ModelSpec) -> None:
    turned, same = asymmetry(spec, 3)
    for turns_i, turns_r in ((1, 0), (0, 1), (-1, 2)):
        same(turned(turns_i * 2 * np.pi, turns_r * 2 * np.pi))
    anisotropic = spec.lobe_axes is not None or spec.anisotropic is not None
    turn = np.pi if anisotropic else np.random.default_rng(4).uniform(-np.pi, np.pi, 4000)
    same(turned(turn, turn))
    if spec.anisotropic is None:
        same(turned(0.0, 0.0, sign=-1))


@pytest.mark.parametrize("spec", [s for s in MODELS.values() if s.lobe_axes], ids=lambda s: s.name)
def test_lobe_axes_make_the_difference(spec: ModelSpec) -> None:
    assert spec.lobe_axes is not None
    turned, same = asymmetry(spec, 5)
    rng = np.random.default_rng(6)
    x, y = (spec.parameter(axis) for axis in spec.lobe_axes)
    first, second = (rng.uniform(axis.low, min(axis.high, 1.0), 4000) for axis in (x, y))
    value, quarter = (turned(turn, turn, **{x.name: first, y.name: second}) for turn in (0.0, draws.HALF_PI))
    assert np.mean(np.abs(quarter - value) > 0.01 * value) > 0.3
    same(turned(draws.HALF_PI, draws.HALF_PI, **{x.name: second, y.name: first}), **{x.name: first, y.name: second})
    turn = rng.uniform(-np.pi, np.pi, 4000)
    same(turned(turn, turn, **{x.name: first, y.name: first}), **{x.name: first, y.name: first})


@draws.every_model
def test_nan_goes_through_and_leaves_its_neighbours_alone(spec: ModelSpec) -> None:
    parameters = draws.drawn(spec, np.random.default_rng(6))
    # a nan among others, on an axis of its own: rows share work in some models
    axis = np.linspace(0.1, 1.5, 70)
    dirty = axis.copy()
    dirty[[0, 33, 69]] = np.nan
    known = ~np.isnan(dirty)
    for position, name in enumerate(draws.ANGLES):

        def evaluate(given: Any, *angles: float, position: int = position) -> Any:
            return spec.evaluate(*angles[:position], given, *angles[position + 1 :], **parameters)

        clean = (0.4, 0.2, 0.7, 1.9)
        for scalar in (np.nan, np.float32(np.nan), [np.nan]):
            assert np.isnan(evaluate(scalar, *clean)).all(), name
        values = evaluate(dirty, *clean)
        np.testing.assert_array_equal(np.isnan(values), ~known, err_msg=name)
        np.testing.assert_allclose(values[known], evaluate(axis, *clean)[known], rtol=draws.ROWS, err_msg=name)
        # below the horizon, nan is still not a number
        assert np.isnan(evaluate(np.nan, 2.0, 0.2, 0.7, 1.9)), name
