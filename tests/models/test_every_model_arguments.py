"""Every model of the registry: shapes and types, what it refuses, and its signature."""

import numpy as np
import pytest

from brdfdb import models
from brdfdb.models import MODELS
from brdfdb.parameters import ModelSpec
from tests.models import draws

SHAPES: tuple[tuple[tuple[int, ...], ...], ...] = (
    ((), (), (), ()),
    ((1,), (), (), ()),
    ((5,), (), (5,), (5,)),
    ((3, 1), (), (4,), ()),
    ((2, 1, 1), (), (3, 1), (4,)),
    ((), (), (), (40,)),
    ((), (), (40,), ()),
    ((2, 1, 1, 1), (3, 1, 1), (4, 1), (5,)),
    ((0,), (), (), ()),
    ((), (), (), (0,)),
    ((3, 1), (), (), (0,)),
    ((0, 1), (), (5,), ()),
    ((), (), (0, 1), (5,)),
)


@draws.every_model
def test_broadcasts_over_angles(spec: ModelSpec) -> None:
    for shapes in SHAPES:
        rng = np.random.default_rng(8)
        angles = [np.asarray(rng.uniform(0.0, 1.5, shape)) for shape in shapes]
        parameters = draws.drawn(spec, rng)
        values = spec.evaluate(*angles, **parameters)
        assert np.shape(values) == np.broadcast_shapes(*shapes)
        assert values.dtype == np.float64
        indices = np.ndindex(values.shape)
        expected = [spec.evaluate(*(a[i] for a in np.broadcast_arrays(*angles)), **parameters) for i in indices]
        np.testing.assert_allclose(np.ravel(values), expected, rtol=draws.ROWS, err_msg=str(shapes))


@draws.every_model
def test_broadcasts_over_each_parameter(spec: ModelSpec) -> None:
    for name in (parameter.name for parameter in draws.parameters_of(spec)):
        rng = np.random.default_rng(10)
        angles = np.array(draws.drawn_angles(rng, 6))
        parameters = draws.drawn(spec, rng)
        several = draws.drawn(spec, rng, 3)[name]
        values = spec.evaluate(*angles, **parameters | {name: several[:, None]})
        assert values.shape == (3, 6), name
        for row, value in zip(values, several, strict=True):
            alone = spec.evaluate(*angles, **parameters | {name: value})
            np.testing.assert_allclose(row, alone, rtol=draws.ROWS, err_msg=name)
        last = spec.evaluate(*angles[..., None], **parameters | {name: several})
        np.testing.assert_allclose(last.T, values, rtol=draws.ROWS, err_msg=name)
        if spec.specular and name in spec.specular_parameters:
            reflected = draws.specular(spec, angles[0], parameters | {name: several[:, None]})
            assert reflected.shape == (3, 6), name
            np.testing.assert_array_equal(
                reflected[1], draws.specular(spec, angles[0], parameters | {name: several[1]})
            )
        assert spec.evaluate(0.1, 0.2, 0.3, 0.4, **parameters | {name: np.array([])}).shape == (0,), name


@pytest.mark.parametrize("spec", [s for s in MODELS.values() if s.spectral], ids=lambda s: s.name)
def test_wavelengths_with_their_indices_along_an_axis(spec: ModelSpec) -> None:
    rng = np.random.default_rng(11)
    parameters = draws.drawn(spec, rng)
    spectrum = {light.name: draws.drawn(spec, rng, 4)[light.name] for light in draws.LIGHT}
    theta, phi = np.linspace(0.0, draws.HALF_PI, 5), np.linspace(0.0, np.pi, 9)
    columns = {name: values[:, None, None, None] for name, values in spectrum.items()}
    values = spec.evaluate(theta[:, None, None], 0.0, theta[:, None], phi, **parameters | columns)
    assert values.shape == (4, 5, 5, 9)
    inner = spec.evaluate(theta[:, None, None, None], 0.0, theta[:, None, None], phi[:, None], **parameters | spectrum)
    assert inner.shape == (5, 5, 9, 4)
    np.testing.assert_allclose(np.moveaxis(inner, -1, 0), values, rtol=draws.ROWS, atol=draws.TINY)
    for index in range(4):
        one = {name: float(each[index]) for name, each in spectrum.items()}
        alone = spec.evaluate(theta[:, None, None], 0.0, theta[:, None], phi, **parameters | one)
        np.testing.assert_allclose(values[index], alone, rtol=draws.ROWS, atol=draws.TINY)
    if spec.specular:
        rows = {name: each[:, None] for name, each in spectrum.items()}
        assert draws.specular(spec, theta, parameters | rows).shape == (4, 5)


@draws.every_model
def test_float32_angles_give_float32_and_the_arithmetic_is_float64(spec: ModelSpec) -> None:
    rng = np.random.default_rng(12)
    parameters = draws.drawn(spec, rng)
    single = [angle.astype(np.float32) for angle in draws.drawn_angles(rng, 50)]
    values = spec.evaluate(*single, **parameters)
    assert values.dtype == np.float32
    double = spec.evaluate(*(angle.astype(np.float64) for angle in single), **parameters)
    np.testing.assert_array_equal(values, double.astype(np.float32))
    assert spec.evaluate(single[0], 0.0, 0.5, 1, **parameters).dtype == np.float32  # Python numbers have no dtype
    assert spec.evaluate(single[0], np.float64(0.0), 0.5, 1, **parameters).dtype == np.float64
    single_parameters = {name: np.float32(value) for name, value in parameters.items()}
    assert isinstance(spec.evaluate(0.1, 0.2, 0.3, 0.4, **single_parameters), np.float64)
    assert isinstance(spec.evaluate(*np.float32([0.1, 0.2, 0.3, 0.4]), **parameters), np.float32)
    if spec.specular:
        assert isinstance(draws.specular(spec, 0.1, parameters), np.float64)
        assert isinstance(draws.specular(spec, np.float32(0.1), parameters), np.float32)


@draws.every_model
def test_inputs_are_left_alone_and_outputs_are_fresh(spec: ModelSpec) -> None:
    rng = np.random.default_rng(14)
    angles = [np.append(angle, [2.0, 0.5]) for angle in draws.drawn_angles(rng, 20)]
    parameters = draws.drawn(spec, rng, 22)
    arguments = [*angles, *parameters.values()]
    copies = [argument.copy() for argument in arguments]
    for argument in arguments:
        argument.setflags(write=False)
    values = spec.evaluate(*angles, **parameters)
    for argument, copy in zip(arguments, copies, strict=True):
        np.testing.assert_array_equal(argument, copy)
        assert not np.shares_memory(argument, values)
    values[0] = 7.0  # writeable, and nothing remembers it
    assert spec.evaluate(*angles, **parameters)[0] != 7.0


@draws.every_model
def test_non_contiguous_angles_give_the_same_values(spec: ModelSpec) -> None:
    rng = np.random.default_rng(15)
    parameters = draws.drawn(spec, rng)
    angles = [np.ascontiguousarray(angle) for angle in draws.drawn_angles(rng, 60)]
    expected = spec.evaluate(*angles, **parameters)
    strided = [np.repeat(angle, 3)[::3] for angle in angles]
    np.testing.assert_allclose(spec.evaluate(*strided, **parameters), expected, rtol=draws.ROWS)
    backwards = [angle[::-1] for angle in angles]
    np.testing.assert_allclose(spec.evaluate(*backwards, **parameters)[::-1], expected, rtol=draws.ROWS)


# What models refuse, and their signatures, are those of their declaration: tests/models/test_declaration.py


@draws.every_model
def test_the_registry_has_the_public_function(spec: ModelSpec) -> None:
    assert MODELS[spec.name] is spec
    assert getattr(models, spec.name) is spec.evaluate
    assert {*(spec.lobe_axes or ()), *(spec.specular_parameters or ())} <= {
        each.name for each in draws.parameters_of(spec)
    }
