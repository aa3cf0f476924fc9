"""What the unit-vector twin of every model promises: the values of its angles, and the same ends."""

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.geometry import unit_vector
from brdfdb.parameters import Floats, ModelSpec
from tests.models import draws

TWIN = 1e-14  # 6.0e-15 (He-Torrance), beside what rounding the angles does: unit vectors against angles
TWIN_ROUNDING = 3e-16  # [rad] the rounding of an angle, of which a narrow lobe makes much


def drawn_vectors(rng: np.random.Generator, *shape: int) -> NDArray[np.float64]:
    """Random unit vectors above the horizon, of shape (*shape, 3)."""
    return unit_vector(rng.uniform(0.0, draws.HALF_PI, shape), rng.uniform(-np.pi, np.pi, shape))


def check_twin(error: Floats, expected: Floats, conditioning: Floats) -> None:
    """Assert that vectors give the values of their angles, but for rounding and how it is amplified."""
    assert np.mean(expected > draws.TINY) > 0.5
    worst = np.max((error - TWIN_ROUNDING * conditioning) / np.maximum(expected, draws.TINY))
    assert worst <= TWIN, f"off by {worst:.3g}"


@draws.every_model
def test_vectors_give_the_values_of_their_angles(spec: ModelSpec) -> None:
    rng = np.random.default_rng(23)
    *others, phi_r = (angle[:, np.newaxis] for angle in draws.drawn_angles(rng, 2000))
    angles = [*others, np.append(phi_r, phi_r + 1.0, axis=1)]  # rows of azimuths, which have loops of their own
    parameters = {name: values[:, np.newaxis] for name, values in draws.drawn(spec, rng, 2000).items()}
    wi, wr = unit_vector(*angles[:2]), unit_vector(*angles[2:])
    expected = spec.evaluate(*angles, **parameters)
    step = 1e-9
    moved = [spec.evaluate(*angles[:i], angles[i] - step, *angles[i + 1 :], **parameters) for i in range(4)]
    conditioning = sum(np.abs(each - expected) for each in moved) / step
    error = np.abs(spec.vectors(wi, wr, **parameters) - expected)
    check_twin(error, expected, conditioning)


@draws.every_model
def test_float32_vectors_give_float32_and_the_arithmetic_is_float64(spec: ModelSpec) -> None:
    rng = np.random.default_rng(24)
    parameters = draws.drawn(spec, rng)
    wi, wr = drawn_vectors(rng, 50).astype(np.float32), drawn_vectors(rng, 50).astype(np.float32)
    values = spec.vectors(wi, wr, **parameters)
    assert values.dtype == np.float32
    double = spec.vectors(wi.astype(np.float64), wr.astype(np.float64), **parameters)
    assert double.dtype == np.float64
    np.testing.assert_allclose(values, double, rtol=2.0**-23, atol=2.0**-126)  # one rounding, next to a tie
    assert spec.vectors(wi, wr.astype(np.float64), **parameters).dtype == np.float64
    assert isinstance(spec.vectors(wi[0], wr[0], **parameters), np.float32)
    assert isinstance(spec.vectors([0, 0, 1], [0.0, 0.6, 0.8], **parameters), np.float64)


@draws.every_model
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_vectors_in_every_corner_give_finite_values_above_the_horizon_and_0_below(spec: ModelSpec, dtype: type) -> None:
    corners = np.array(
        [
            *([0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0.6, 0, 0.8], [-0.6, 0, 0.8], [0, 0.8, 0.6]),
            *([1, 0, 1e-30], [-1, 0, 1e-30], [1e-30, 0, 1], [1, 1e-20, 1e-20], [-0.6, 0.8, 0.0]),
            *([0, 1e-150, 1], [1e-200, 1e-200, 1], [0, -1e-290, 1]),  # squares of them underflow
        ],
        dtype=dtype,
    )
    parameters = {name: values.reshape(-1, 1, 1) for name, values in draws.corner_parameters(spec).items()}
    values = spec.vectors(corners[:, None], corners, **parameters)
    assert values.dtype == dtype
    assert np.isfinite(values).all()
    assert (values >= 0.0).all()
    under = corners * np.array([1.0, 1.0, -1.0], dtype=dtype)
    under = under[under[:, 2] < 0.0]
    for wi, wr in ((under[:, None], corners), (corners[:, None], under), (under[:, None], under)):
        assert (spec.vectors(wi, wr, **parameters) == 0.0).all()


@draws.every_model
def test_a_nan_in_a_vector_goes_through_and_leaves_its_neighbours_alone(spec: ModelSpec) -> None:
    rng = np.random.default_rng(25)
    parameters = draws.drawn(spec, rng)
    wi, wr = drawn_vectors(rng, 70), drawn_vectors(rng, 70)
    wr[5] *= -1.0
    expected = spec.vectors(wi, wr, **parameters)
    for row, axis in ((0, 0), (5, 1), (69, 2)):
        dirty_i, dirty_r = wi.copy(), wr.copy()
        dirty_i[row, axis] = dirty_r[row, axis] = np.nan
        for values in (spec.vectors(dirty_i, wr, **parameters), spec.vectors(wi, dirty_r, **parameters)):
            np.testing.assert_array_equal(np.isnan(values), np.arange(70) == row)
            np.testing.assert_allclose(np.delete(values, row), np.delete(expected, row), rtol=draws.ROWS)


@draws.every_model
def test_broadcasts_over_vectors(spec: ModelSpec) -> None:
    rng = np.random.default_rng(26)
    parameters = draws.drawn(spec, rng)
    wi, wr = drawn_vectors(rng, 5), drawn_vectors(rng, 7)
    values = spec.vectors(wi[:, None], wr, **parameters)
    assert values.shape == (5, 7)
    for row, one in zip(values, wi, strict=True):
        np.testing.assert_allclose(spec.vectors(one, wr, **parameters), row, rtol=draws.ROWS)
    np.testing.assert_allclose(spec.vectors(wi, wr[0], **parameters), values[:, 0], rtol=draws.ROWS)
    assert np.shape(spec.vectors(wi[0], wr[0], **parameters)) == ()
    assert spec.vectors(wi[:0], wr[0], **parameters).shape == (0,)
    assert spec.vectors(wi[:0, None], wr, **parameters).shape == (0, 7)
    several = {name: value[:, None] for name, value in draws.drawn(spec, rng, 3).items()}
    rows = spec.vectors(wi[0], wr, **several)
    assert rows.shape == (3, 7)
    for index, row in enumerate(rows):
        alone = {name: value[index, 0] for name, value in several.items()}
        np.testing.assert_allclose(spec.vectors(wi[0], wr, **alone), row, rtol=draws.ROWS)
