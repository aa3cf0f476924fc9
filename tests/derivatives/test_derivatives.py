"""Derivatives by parameters: against differences of the twins at many digits, at hazards and at random arguments."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import pytest

from brdfdb.derivatives import gradient, gradient_vectors
from brdfdb.errors import ParameterError
from brdfdb.geometry import unit_vector
from brdfdb.models import MODELS
from brdfdb.models import _diffraction_series as series
from brdfdb.parameters import ModelSpec
from brdfdb.reference import mp
from tests.compiled import compiled
from tests.models.draws import drawn, drawn_angles
from tests.models.hazard_directions import EXACT
from tests.models.hazard_twins import direction_of, exact_parameters, point_of
from tests.models.hazards import BY_NAME

# Relative errors, each just above the worst measured, which stands behind it
AT_RANDOM = {"he_torrance": 1e-8}  # 1.6e-10; 2.2e-9 in 180 other draws, at a derivative that is nearly 0
CLOSED_FORM = 2e-13  # 5e-14; 9.1e-14 in 180 other draws
AT_HAZARDS = 1e-10  # 2e-11, where both directions graze; 3e-14 elsewhere
BY_ROUNDING = 1e-13  # f_r of the gradient and of the model
LARGE_G = 4e-12  # 2.5e-12, beside the first order in 1 / g
# Next to a change of sign a derivative is compared with this share of f_r over the parameter
CANCELLED = 1e-5
NOTHING = 1e-18  # smaller derivatives are 0: the differences at 45 digits know no better
DRAWS = 60

DERIVED = [spec for spec in MODELS.values() if spec.gradient is not None]
every_derived = pytest.mark.parametrize("spec", DERIVED, ids=lambda spec: spec.name)


def difference(name: str, directions: Any, exact: dict[str, Any], parameter: str) -> Any:
    """Return the derivative of a twin by a parameter, one-sided at 0.

    The sum of He-Torrance ends at 50 digits, of which its uniform part must take none. The others take 400.
    """
    if parameter == "sigma_0_um" and exact[parameter] == 0:
        return mp.zero  # f_r goes with its square, at grazing for the first 1e-16 um only
    if parameter != "a" and "a" in exact:
        exact = exact | {"a": mp.zero}
    twin, x = BY_NAME[name].twin, exact[parameter]
    digits, step = (45, mp.mpf(10) ** -13) if name == "he_torrance" else (400, mp.mpf(10) ** -60)

    def f_r(value: Any) -> Any:
        return twin(*directions, **(exact | {parameter: value}))

    with mp.workdps(digits):
        if x == 0:
            return (4 * f_r(step) - f_r(2 * step) - 3 * f_r(mp.zero)) / (2 * step)
        return (f_r(x * (1 + step)) - f_r(x * (1 - step))) / (2 * step * x)


def worst(spec: ModelSpec, directions: Any, row: dict[str, Any]) -> float:
    """Return the largest relative error of the derivatives at one pair of directions."""
    exact = dict(exact_parameters(row))
    at = direction_of(point_of(np.array(directions)))
    found = gradient(spec.name, *directions, **row)
    errors = [0.0]
    for name in found.derivatives.keys() & row.keys():
        value = found.derivatives[name]
        expected = difference(spec.name, at, exact, name)
        lobe = float(found.f_r) - float(row.get("a", 0.0)) / np.pi
        share = CANCELLED * lobe / row[name] if row[name] > 0.0 else 0.0
        errors.append(float(abs(mp.mpf(float(value)) - expected) / max(abs(expected), share, NOTHING)))
    return max(errors)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")
@every_derived
def test_derivatives_at_every_hazard(spec: ModelSpec) -> None:
    for row in BY_NAME[spec.name].parameters:
        for label, directions in EXACT.items():
            assert worst(spec, directions, row) <= AT_HAZARDS, (row, label)


@every_derived
def test_derivatives_at_random_arguments(spec: ModelSpec) -> None:
    rng = np.random.default_rng(22)
    arguments = drawn(spec, rng, DRAWS) | {name: np.full(DRAWS, float(value)) for name, value in switches(spec).items()}
    if spec.spectral:
        arguments["tau_um"] = arguments["sigma_0_um"] * 10.0 ** rng.uniform(-0.3, 1.5, DRAWS)
    for index, directions in enumerate(zip(*drawn_angles(rng, DRAWS), strict=True)):
        row = {name: float(values[index]) for name, values in arguments.items()}
        assert worst(spec, directions, row) <= AT_RANDOM.get(spec.name, CLOSED_FORM), row


def switches(spec: ModelSpec) -> dict[str, bool]:
    return {one.name: one.default for one in spec.parameters if isinstance(one.default, bool)}


@every_derived
def test_f_r_is_that_of_the_model_and_arguments_broadcast(spec: ModelSpec) -> None:
    rng = np.random.default_rng(5)
    angles = drawn_angles(rng, 40)
    angles[0][3], angles[2][7], angles[1][9] = 2.0, 3.0, np.nan
    columns = {name: values[:, np.newaxis] for name, values in drawn(spec, rng, 3).items()}
    found = gradient(spec.name, *angles, **columns)
    model = spec.evaluate(*angles, **columns)
    assert model.shape == (3, 40)
    np.testing.assert_allclose(found.f_r, model, rtol=BY_ROUNDING)
    assert set(found.derivatives) >= {one.name for one in spec.parameters if not isinstance(one.default, bool)}
    for values in found.derivatives.values():
        assert values.shape == (3, 40)
        assert np.all(values[:, [3, 7]] == 0.0)
        assert np.all(np.isnan(values[:, 9]))
        assert np.all(np.isfinite(np.delete(values, 9, axis=1)))


@every_derived
def test_float32_in_float32_out(spec: ModelSpec) -> None:
    rng = np.random.default_rng(6)
    angles = drawn_angles(rng, 30)
    parameters = drawn(spec, rng)
    wi, wr = unit_vector(*angles[:2]), unit_vector(*angles[2:])
    single = gradient_vectors(spec.name, wi.astype(np.float32), wr.astype(np.float32), **parameters)
    double = gradient_vectors(
        spec.name, wi.astype(np.float32).astype(float), wr.astype(np.float32).astype(float), **parameters
    )
    for name, values in single.derivatives.items():
        assert values.dtype == np.float32
        np.testing.assert_array_equal(values, double.derivatives[name].astype(np.float32))


@pytest.mark.parametrize("g", [1e8, 1e10, 1e12, 1e16, 1e22])
def test_the_sum_of_he_torrance_has_the_slopes_of_its_limit(g: float) -> None:
    b = np.array([1e-6, 0.1, 1.0, 10.0])
    log_sum, by_g, by_V = np.empty((3, b.size))
    work, index = np.empty((series.ROWS_OF_WORK, series.BLOCK)), np.empty((series.GROUPS, series.BLOCK), np.int64)
    compiled(series.log_series)(True, np.full(b.size, g), g * b, 1.0, log_sum, by_g, by_V, work, index)
    # The limit is e^-b / g^2
    bound = LARGE_G + 2.0 * (1.0 + b * b) / g
    assert np.all(np.abs(by_g - (b - 1.0)) <= bound)
    assert np.all(np.abs(by_V / -b - 1.0) <= bound)


def test_a_model_without_derivatives_is_refused_with_those_that_have_them() -> None:
    with pytest.raises(ParameterError, match=r"^model: lambert has no derivatives; .* oren_nayar, "):
        gradient("lambert", 0.1, 0.0, 0.2, 0.0, rho=0.5)
