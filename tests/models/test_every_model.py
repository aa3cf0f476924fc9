"""What every model of the registry promises: a model is held to all of it from the day it is registered."""

import inspect
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brdfdb import models
from brdfdb.models import MODELS
from brdfdb.parameters import ModelSpec, Parameter
from tests.models.draws import (
    ANGLES,
    HALF_PI,
    HORIZON_32,
    LIGHT,
    ROWS,
    SLOW,
    TINY,
    corner_angles,
    corner_parameters,
    drawn,
    drawn_angles,
    every_model,
    every_parameter,
    every_specular,
    parameters_of,
    refused,
    specular,
)

# Relative differences, each just above the worst measured, which stands behind it
RECIPROCITY = 1e-12  # 0: each formula is symmetric to the last bit; the rest is room for other vector units
AZIMUTH = 1e-13  # 8.6e-14 (parallel cavities): what the rounding of phi + 2 pi does
AZIMUTH_OF = {"torrance_sparrow": 6e-12}  # 5.3e-12, where its lobe is down to 1e-142


# Values


@every_model
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_is_finite_and_not_negative_in_every_corner(spec: ModelSpec, dtype: type) -> None:
    angles = [angle.astype(dtype) for angle in corner_angles()]
    parameters = {name: values.reshape(-1, 1, 1, 1, 1) for name, values in corner_parameters(spec).items()}
    values = spec.evaluate(*angles, **parameters)
    assert values.shape == (next(iter(parameters.values())).size, 7, 5, 7, 5)
    assert values.dtype == dtype
    assert np.isfinite(values).all()
    assert (values >= 0.0).all()
    if spec.specular:
        reflected = specular(spec, angles[0], parameters)
        assert reflected.dtype == dtype
        assert ((reflected >= 0.0) & (reflected <= 1.0)).all()


@every_model
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_is_finite_and_not_negative_at_every_degree(spec: ModelSpec, dtype: type) -> None:
    rng = np.random.default_rng(90)
    theta = np.deg2rad(np.arange(0.0, 91.0, 5.0 if spec.name in SLOW else 1.0)).astype(dtype)
    phi = np.deg2rad(np.arange(0.0, 181.0, 15.0)).astype(dtype)
    assert theta[-1] == dtype(HALF_PI)
    for _ in range(3 if spec.name in SLOW else 10):
        parameters = drawn(spec, rng)
        values = spec.evaluate(theta[:, None, None], dtype(0.0), theta[:, None], phi, **parameters)
        assert np.isfinite(values).all(), parameters
        assert (values >= 0.0).all(), parameters
        assert (values > 0.0).any(), parameters
        if spec.specular:
            reflected = specular(spec, theta, parameters)
            assert ((reflected >= 0.0) & (reflected <= 1.0)).all(), parameters


def within(parameter: Parameter) -> st.SearchStrategy[float]:
    """Any value of a parameter; where the range spans decades, of every decade."""
    uniform = st.floats(parameter.low, parameter.high)
    if parameter.high < 100.0 * max(parameter.low, 1e-2):
        return uniform
    decades = st.floats(np.log10(max(parameter.low, 1e-9)), np.log10(parameter.high))
    return st.one_of(uniform, decades.map(lambda x: min(max(10.0**x, parameter.low), parameter.high)))


@every_model
@given(data=st.data())
def test_any_arguments_give_a_finite_reciprocal_value(spec: ModelSpec, data: st.DataObject) -> None:
    theta = st.one_of(st.floats(0.0, HALF_PI), st.sampled_from([0.0, HALF_PI]))
    phi = st.floats(-7.0, 7.0)
    theta_i, phi_i, theta_r, phi_r = (data.draw(strategy) for strategy in (theta, phi, theta, phi))
    parameters = {parameter.name: data.draw(within(parameter), parameter.name) for parameter in parameters_of(spec)}
    value = spec.evaluate(theta_i, phi_i, theta_r, phi_r, **parameters)
    assert 0.0 <= value < np.inf
    assert spec.evaluate(theta_r, phi_r, theta_i, phi_i, **parameters) == pytest.approx(
        value, rel=RECIPROCITY, abs=TINY
    )
    if spec.specular:
        assert 0.0 <= specular(spec, theta_i, parameters) <= 1.0


@every_model
def test_is_zero_just_below_the_horizon(spec: ModelSpec) -> None:
    parameters = drawn(spec, np.random.default_rng(1))
    for dtype, horizon in ((np.float64, HALF_PI), (np.float32, HORIZON_32)):
        at, above, below, opposite = dtype(horizon), dtype(0.3), np.nextafter(dtype(horizon), dtype(4.0)), dtype(np.pi)
        for under in (below, opposite):
            assert spec.evaluate(under, dtype(0.1), above, dtype(2.0), **parameters) == 0.0
            assert spec.evaluate(above, dtype(0.1), under, dtype(2.0), **parameters) == 0.0
            assert spec.evaluate(under, dtype(0.1), under, dtype(2.0), **parameters) == 0.0
            if spec.specular:
                assert specular(spec, under, parameters) == 0.0
        values = spec.evaluate(np.array([above, below, at]), dtype(0.1), above, dtype(2.0), **parameters)
        assert values.dtype == dtype
        assert values[1] == 0.0
        assert values[0] > 0.0


@every_model
def test_float32_horizon_is_the_float64_horizon(spec: ModelSpec) -> None:
    rng = np.random.default_rng(32)
    zero, one, half = np.float32(0.0), np.float32(1.0), np.float32(0.5)
    for _ in range(5):
        parameters = drawn(spec, rng)
        for theta_r_32, theta_r in ((half, 0.5), (HORIZON_32, HALF_PI)):
            single = spec.evaluate(HORIZON_32, zero, theta_r_32, one, **parameters)
            assert single.dtype == np.float32
            assert single == np.float32(spec.evaluate(HALF_PI, 0.0, theta_r, 1.0, **parameters))


@every_model
def test_grazing_pole_says_which_models_grow_without_bound(spec: ModelSpec) -> None:
    rng = np.random.default_rng(89)
    parameters = {name: values[:, None] for name, values in drawn(spec, rng, 50).items()}
    phi = np.array([0.0, 1.0, np.pi])

    def largest(distance: float) -> float:
        theta = HALF_PI - distance
        return float(np.max(spec.evaluate(theta, 0.0, theta, phi, **parameters)))

    growth = largest(1e-9) / largest(1e-3)
    assert growth > 1e3 if spec.grazing_pole else growth < 10.0


# Symmetry


@every_model
def test_is_reciprocal(spec: ModelSpec) -> None:
    rng = np.random.default_rng(2)
    theta_i, phi_i, theta_r, phi_r = drawn_angles(rng, 4000)
    parameters = drawn(spec, rng, 4000)
    one = spec.evaluate(theta_i, phi_i, theta_r, phi_r, **parameters)
    other = spec.evaluate(theta_r, phi_r, theta_i, phi_i, **parameters)
    assert np.mean(one > TINY) > 0.5
    np.testing.assert_allclose(one, other, rtol=RECIPROCITY, atol=TINY)


@every_model
def test_has_the_period_of_the_azimuth(spec: ModelSpec) -> None:
    rng = np.random.default_rng(3)
    theta_i, phi_i, theta_r, phi_r = drawn_angles(rng, 4000)
    parameters = drawn(spec, rng, 4000)
    value = spec.evaluate(theta_i, phi_i, theta_r, phi_r, **parameters)
    for turns_i, turns_r in ((1, 0), (0, 1), (-1, 2)):
        turned = spec.evaluate(theta_i, phi_i + turns_i * 2 * np.pi, theta_r, phi_r + turns_r * 2 * np.pi, **parameters)
        np.testing.assert_allclose(turned, value, rtol=AZIMUTH_OF.get(spec.name, AZIMUTH), atol=TINY)


@every_model
def test_turns_with_the_surface_and_is_its_own_mirror_image(spec: ModelSpec) -> None:
    rng = np.random.default_rng(4)
    theta_i, phi_i, theta_r, phi_r = drawn_angles(rng, 4000)
    parameters = drawn(spec, rng, 4000)
    value = spec.evaluate(theta_i, phi_i, theta_r, phi_r, **parameters)
    anisotropic = spec.lobe_axes is not None or spec.anisotropic is not None
    turn = np.pi if anisotropic else rng.uniform(-np.pi, np.pi, 4000)
    turned = spec.evaluate(theta_i, phi_i + turn, theta_r, phi_r + turn, **parameters)
    np.testing.assert_allclose(turned, value, rtol=AZIMUTH_OF.get(spec.name, AZIMUTH), atol=TINY)
    if spec.anisotropic is None:
        mirrored = spec.evaluate(theta_i, -phi_i, theta_r, -phi_r, **parameters)
        np.testing.assert_allclose(mirrored, value, rtol=AZIMUTH_OF.get(spec.name, AZIMUTH), atol=TINY)


@pytest.mark.parametrize("spec", [s for s in MODELS.values() if s.lobe_axes], ids=lambda s: s.name)
def test_lobe_axes_make_the_difference(spec: ModelSpec) -> None:
    assert spec.lobe_axes is not None
    x, y = spec.lobe_axes
    rng = np.random.default_rng(5)
    theta_i, phi_i, theta_r, phi_r = drawn_angles(rng, 4000)
    parameters = drawn(spec, rng, 4000)
    value = spec.evaluate(theta_i, phi_i, theta_r, phi_r, **parameters)
    turned = spec.evaluate(theta_i, phi_i + HALF_PI, theta_r, phi_r + HALF_PI, **parameters)
    assert np.mean(np.abs(turned - value) > 0.01 * value) > 0.3
    exchanged = spec.evaluate(
        theta_i, phi_i + HALF_PI, theta_r, phi_r + HALF_PI, **parameters | {x: parameters[y], y: parameters[x]}
    )
    np.testing.assert_allclose(exchanged, value, rtol=AZIMUTH, atol=TINY)
    parameters[y] = parameters[x]
    value = spec.evaluate(theta_i, phi_i, theta_r, phi_r, **parameters)
    turn = rng.uniform(-np.pi, np.pi, 4000)
    turned = spec.evaluate(theta_i, phi_i + turn, theta_r, phi_r + turn, **parameters)
    np.testing.assert_allclose(turned, value, rtol=AZIMUTH, atol=TINY)


# nan


@every_model
@pytest.mark.parametrize("position", range(4), ids=ANGLES)
def test_nan_goes_through_and_leaves_its_neighbours_alone(spec: ModelSpec, position: int) -> None:
    rng = np.random.default_rng(6)
    parameters = drawn(spec, rng)
    clean = [0.4, 0.2, 0.7, 1.9]
    for scalar in (np.nan, np.float32(np.nan), [np.nan]):
        angles: list[Any] = [*clean]
        angles[position] = scalar
        assert np.isnan(spec.evaluate(*angles, **parameters)).all()
    # a nan among others, on an axis of its own: rows share work in some models
    axis = np.linspace(0.1, 1.5, 70)
    angles = [*clean]
    angles[position] = axis
    expected = spec.evaluate(*angles, **parameters)
    dirty = axis.copy()
    dirty[[0, 33, 69]] = np.nan
    angles[position] = dirty
    values = spec.evaluate(*angles, **parameters)
    np.testing.assert_array_equal(np.isnan(values), np.isnan(dirty))
    np.testing.assert_allclose(values[~np.isnan(dirty)], expected[~np.isnan(dirty)], rtol=ROWS)
    # below the horizon, nan is still not a number
    angles = [2.0, 0.2, 0.7, 1.9]
    angles[position] = np.nan
    assert np.isnan(spec.evaluate(*angles, **parameters))


@every_specular
def test_specular_nan_goes_through(spec: ModelSpec) -> None:
    parameters = drawn(spec, np.random.default_rng(7))
    values = specular(spec, np.array([0.1, np.nan, 1.0]), parameters)
    np.testing.assert_array_equal(np.isnan(values), [False, True, False])


# Shapes and types


@every_model
@pytest.mark.parametrize(
    "shapes",
    [
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
    ],
    ids=str,
)
def test_broadcasts_over_angles(spec: ModelSpec, shapes: tuple[tuple[int, ...], ...]) -> None:
    rng = np.random.default_rng(8)
    angles = [np.asarray(rng.uniform(0.0, 1.5, shape)) for shape in shapes]
    parameters = drawn(spec, rng)
    values = spec.evaluate(*angles, **parameters)
    assert np.shape(values) == np.broadcast_shapes(*shapes)
    assert values.dtype == np.float64
    each = [
        spec.evaluate(*(a[i] for a in np.broadcast_arrays(*angles)), **parameters) for i in np.ndindex(values.shape)
    ]
    np.testing.assert_allclose(np.ravel(values), each, rtol=ROWS)


@every_model
def test_scalars_give_a_scalar(spec: ModelSpec) -> None:
    parameters = drawn(spec, np.random.default_rng(9))
    value = spec.evaluate(0.1, 0.2, 0.3, 0.4, **parameters)
    assert isinstance(value, np.float64)
    assert isinstance(spec.evaluate(*np.float32([0.1, 0.2, 0.3, 0.4]), **parameters), np.float32)
    if spec.specular:
        assert isinstance(specular(spec, 0.1, parameters), np.float64)
        assert isinstance(specular(spec, np.float32(0.1), parameters), np.float32)


@every_parameter
def test_broadcasts_over_a_parameter(spec: ModelSpec, parameter: Parameter) -> None:
    rng = np.random.default_rng(10)
    theta_i, phi_i, theta_r, phi_r = drawn_angles(rng, 6)
    parameters = drawn(spec, rng)
    several = drawn(spec, rng, 3)[parameter.name]
    values = spec.evaluate(theta_i, phi_i, theta_r, phi_r, **parameters | {parameter.name: several[:, None]})
    assert values.shape == (3, 6)
    for row, value in zip(values, several, strict=True):
        alone = spec.evaluate(theta_i, phi_i, theta_r, phi_r, **parameters | {parameter.name: value})
        np.testing.assert_allclose(row, alone, rtol=ROWS)
    last = spec.evaluate(
        *(a[:, None] for a in (theta_i, phi_i, theta_r, phi_r)), **parameters | {parameter.name: several}
    )
    np.testing.assert_allclose(last.T, values, rtol=ROWS)
    if spec.specular and parameter.name in spec.specular_parameters:
        reflected = specular(spec, theta_i, parameters | {parameter.name: several[:, None]})
        assert reflected.shape == (3, 6)
        np.testing.assert_array_equal(reflected[1], specular(spec, theta_i, parameters | {parameter.name: several[1]}))
    empty = spec.evaluate(0.1, 0.2, 0.3, 0.4, **parameters | {parameter.name: np.array([])})
    assert empty.shape == (0,)


@pytest.mark.parametrize("spec", [s for s in MODELS.values() if s.spectral], ids=lambda s: s.name)
def test_wavelengths_with_their_indices_along_an_axis(spec: ModelSpec) -> None:
    rng = np.random.default_rng(11)
    parameters = drawn(spec, rng)
    spectrum = {light.name: drawn(spec, rng, 4)[light.name] for light in LIGHT}
    theta, phi = np.linspace(0.0, HALF_PI, 5), np.linspace(0.0, np.pi, 9)
    columns = {name: values[:, None, None, None] for name, values in spectrum.items()}
    values = spec.evaluate(theta[:, None, None], 0.0, theta[:, None], phi, **parameters | columns)
    assert values.shape == (4, 5, 5, 9)
    inner = spec.evaluate(theta[:, None, None, None], 0.0, theta[:, None, None], phi[:, None], **parameters | spectrum)
    assert inner.shape == (5, 5, 9, 4)
    np.testing.assert_allclose(np.moveaxis(inner, -1, 0), values, rtol=ROWS, atol=TINY)
    for index in range(4):
        one = {name: float(each[index]) for name, each in spectrum.items()}
        alone = spec.evaluate(theta[:, None, None], 0.0, theta[:, None], phi, **parameters | one)
        np.testing.assert_allclose(values[index], alone, rtol=ROWS, atol=TINY)
    if spec.specular:
        rows = {name: each[:, None] for name, each in spectrum.items()}
        assert specular(spec, theta, parameters | rows).shape == (4, 5)


@every_model
def test_float32_angles_give_float32_and_the_arithmetic_is_float64(spec: ModelSpec) -> None:
    rng = np.random.default_rng(12)
    parameters = drawn(spec, rng)
    single = [angle.astype(np.float32) for angle in drawn_angles(rng, 50)]
    values = spec.evaluate(*single, **parameters)
    assert values.dtype == np.float32
    double = spec.evaluate(*(angle.astype(np.float64) for angle in single), **parameters)
    np.testing.assert_array_equal(values, double.astype(np.float32))
    assert spec.evaluate(single[0], 0.0, 0.5, 1, **parameters).dtype == np.float32  # Python numbers have no dtype
    assert spec.evaluate(single[0], np.float64(0.0), 0.5, 1, **parameters).dtype == np.float64
    single_parameters = {name: np.float32(value) for name, value in parameters.items()}
    assert spec.evaluate(0.1, 0.2, 0.3, 0.4, **single_parameters).dtype == np.float64


@every_model
def test_lists_integers_and_half_precision_are_numbers_too(spec: ModelSpec) -> None:
    parameters = drawn(spec, np.random.default_rng(13))
    expected = spec.evaluate(np.array([0.0, 1.0]), 0.0, np.array([1.0, 0.0]), 2.0, **parameters)
    for angles in (
        ([0, 1], 0, [1, 0], 2),
        ((0, 1.0), [0], (1, 0.0), [2]),
        (np.array([0, 1]), np.int8(0), np.array([1, 0], dtype=np.uint8), 2),
        (np.array([0, 1], dtype=np.float16), 0, [1, 0], np.longdouble(2)),
    ):
        values = spec.evaluate(*angles, **parameters)
        assert values.dtype == np.float64
        np.testing.assert_array_equal(values, expected)
    listed = {name: [float(value)] for name, value in parameters.items()}
    np.testing.assert_array_equal(spec.evaluate([0, 1], 0, [1, 0], 2, **listed), expected)


@every_model
def test_inputs_are_left_alone_and_outputs_are_fresh(spec: ModelSpec) -> None:
    rng = np.random.default_rng(14)
    angles = [np.append(angle, [2.0, 0.5]) for angle in drawn_angles(rng, 20)]
    parameters = drawn(spec, rng, 22)
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


@every_model
def test_non_contiguous_angles_give_the_same_values(spec: ModelSpec) -> None:
    rng = np.random.default_rng(15)
    parameters = drawn(spec, rng)
    angles = [np.ascontiguousarray(angle) for angle in drawn_angles(rng, 60)]
    expected = spec.evaluate(*angles, **parameters)
    strided = [np.repeat(angle, 3)[::3] for angle in angles]
    np.testing.assert_allclose(spec.evaluate(*strided, **parameters), expected, rtol=ROWS)
    backwards = [angle[::-1] for angle in angles]
    np.testing.assert_allclose(spec.evaluate(*backwards, **parameters)[::-1], expected, rtol=ROWS)


# Refusals


@every_model
@pytest.mark.parametrize("position", range(4), ids=ANGLES)
@pytest.mark.parametrize("wrong", [True, "0.1", 0.1 + 0.0j, None, [True], ["a"], np.array([1j]), b"1", {}], ids=repr)
def test_refuses_an_angle_that_is_not_a_real_number(spec: ModelSpec, position: int, wrong: Any) -> None:
    angles: list[Any] = [0.1, 0.2, 0.3, 0.4]
    angles[position] = wrong
    with pytest.raises(ValueError, match=rf"^{ANGLES[position]}: .* is not a number of radians$"):
        spec.evaluate(*angles, **drawn(spec, np.random.default_rng(16)))


@every_model
@pytest.mark.parametrize("position", [0, 2], ids=["theta_i", "theta_r"])
@pytest.mark.parametrize("wrong", [-1e-300, -0.1, np.nextafter(np.pi, 4.0), 90.0, np.inf, -np.inf])
def test_refuses_a_theta_outside_the_sphere(spec: ModelSpec, position: int, wrong: float) -> None:
    parameters = drawn(spec, np.random.default_rng(17))
    message = rf"^{ANGLES[position]}: {re.escape(f'{wrong:.9g}')} rad .* is outside \[0, pi\] rad$"
    for given_as in (wrong, [0.1, wrong], np.array([[np.nan], [wrong]])):
        angles: list[Any] = [0.1, 0.2, 0.3, 0.4]
        angles[position] = given_as
        with pytest.raises(ValueError, match=message):
            spec.evaluate(*angles, **parameters)
    if spec.specular and position == 0:
        with pytest.raises(ValueError, match=message):
            specular(spec, wrong, parameters)


@every_model
@pytest.mark.parametrize("position", [1, 3], ids=["phi_i", "phi_r"])
@pytest.mark.parametrize("wrong", [np.inf, -np.inf, 1.1e15, -1e308])
def test_refuses_a_phi_that_float64_does_not_resolve(spec: ModelSpec, position: int, wrong: float) -> None:
    parameters = drawn(spec, np.random.default_rng(18))
    message = rf"^{ANGLES[position]}: {re.escape(f'{wrong:.9g}')} rad is outside \[-1e\+15, 1e\+15\] rad$"
    for given_as in (wrong, [0.1, wrong]):
        angles: list[Any] = [0.1, 0.2, 0.3, 0.4]
        angles[position] = given_as
        with pytest.raises(ValueError, match=message):
            spec.evaluate(*angles, **parameters)


@every_parameter
def test_refuses_a_parameter_outside_its_range(spec: ModelSpec, parameter: Parameter) -> None:
    assert parameter.interval.startswith(f"[{parameter.low:g}, {parameter.high:g}]")
    for wrong in (parameter.low - 0.125, parameter.high * 1.5, np.inf, -np.inf, np.nan):
        expected = f"{parameter.name}: {wrong:.16g} is outside {parameter.interval}"
        assert refused(spec, parameter, wrong) == expected
        assert refused(spec, parameter, [parameter.low, wrong, parameter.high]) == expected
        assert refused(spec, parameter, np.array([[parameter.high], [wrong]])) == expected
    for barely in (np.nextafter(parameter.low, -np.inf), np.nextafter(parameter.high, np.inf)):
        assert refused(spec, parameter, barely).startswith(f"{parameter.name}: ")


@every_parameter
@pytest.mark.parametrize("wrong", ["0.5", None, 0.5 + 0.0j, np.array([0.5j]), ["a"], {}], ids=repr)
def test_refuses_a_parameter_that_is_not_a_number(spec: ModelSpec, parameter: Parameter, wrong: Any) -> None:
    expected = f"{parameter.name}: {wrong!r} is not a number in {parameter.interval}"
    assert refused(spec, parameter, wrong) == expected


@every_parameter
def test_takes_both_ends_of_a_range(spec: ModelSpec, parameter: Parameter) -> None:
    parameters = drawn(spec, np.random.default_rng(20))
    for end in (parameter.low, parameter.high):
        value = spec.evaluate(0.1, 0.2, 0.3, 0.4, **parameters | {parameter.name: end})
        assert 0.0 <= value < np.inf


# Signatures


@every_model
def test_the_registry_knows_the_public_function(spec: ModelSpec) -> None:
    assert MODELS[spec.name] is spec
    assert spec.evaluate.__name__ == spec.name
    assert getattr(models, spec.name) is spec.evaluate
    assert spec.name in models.__all__
    assert spec.version >= 1
    for axis in spec.lobe_axes or ():
        assert spec.parameter(axis).name == axis
    with pytest.raises(KeyError):
        spec.parameter("no such parameter")


@every_model
def test_parameters_match_the_signature(spec: ModelSpec) -> None:
    arguments = inspect.signature(spec.evaluate).parameters
    assert tuple(arguments)[:4] == ANGLES
    for name in ANGLES:
        assert arguments[name].kind is inspect.Parameter.POSITIONAL_OR_KEYWORD
        assert arguments[name].default is inspect.Parameter.empty
    # what may be None, such as a refractive index, is no parameter of a material
    own = [name for name in tuple(arguments)[4:] if arguments[name].default is not None]
    assert sorted(own) == sorted(parameter.name for parameter in parameters_of(spec))
    for parameter in parameters_of(spec):
        argument = arguments[parameter.name]
        assert argument.kind is inspect.Parameter.KEYWORD_ONLY
        default = None if argument.default is inspect.Parameter.empty else argument.default
        assert (default, type(default)) == (parameter.default, type(parameter.default))
        if parameter.default is not None:
            assert parameter.check(parameter.default) == parameter.default
    with pytest.raises(TypeError):
        spec.evaluate(0.1, 0.2, 0.3, 0.4, *drawn(spec, np.random.default_rng(21)).values())


@every_specular
def test_specular_parameters_match_the_signature(spec: ModelSpec) -> None:
    assert spec.specular is not None
    arguments = inspect.signature(spec.specular).parameters
    assert tuple(arguments) == ("theta_i", *spec.specular_parameters)
    assert {name for name, argument in arguments.items() if argument.kind is inspect.Parameter.KEYWORD_ONLY} == {
        *spec.specular_parameters
    }
    assert {*spec.specular_parameters} <= {parameter.name for parameter in parameters_of(spec)}


@every_model
def test_a_default_may_be_left_out(spec: ModelSpec) -> None:
    parameters = drawn(spec, np.random.default_rng(22))
    defaults = {p.name: p.default for p in spec.parameters if p.default is not None}
    without = {name: value for name, value in parameters.items() if name not in defaults}
    assert spec.evaluate(0.1, 0.2, 0.3, 0.4, **without) == spec.evaluate(0.1, 0.2, 0.3, 0.4, **without | defaults)
