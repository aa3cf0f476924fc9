"""The declaration of a model: what its functions refuse, the order of arguments, and mistakes of a declaration."""

import inspect
import pickle
import re
from typing import Any, get_type_hints

import numpy as np
import pytest

from brdfdb.errors import ParameterError
from brdfdb.geometry import Angles, Directions, Vectors
from brdfdb.models import MODELS, he_torrance_jones, lambert_vectors, minnaert, ward, ward_vectors
from brdfdb.models.declaration import FEATURES, DeclaredModel, of_directions
from brdfdb.parameters import Floats, ModelSpec, Parameter
from tests.models.draws import ANGLES, beyond, drawn, parameters_of, refused, specular

# A formula of numbers, a function of arrays, loops over rows, and a model with light and a specular part
FORMS = pytest.mark.parametrize("name", ["minnaert", "torrance_sparrow", "ward", "he_torrance"])
W = Parameter("w", "w", "1", 0.0, 1.0, "a weight", default=0.5)
DUST = {"title": "Dust", "equation": "eq. 1", "references": "seeliger1887, fest2013", "parameters": (W,)}


def given(spec: ModelSpec) -> dict[str, Any]:
    return drawn(spec, np.random.default_rng(16))


@FORMS
def test_angles_are_checked_as_those_of_geometry(name: str) -> None:
    spec = MODELS[name]
    for position, argument in enumerate(ANGLES):
        for wrong, words in (
            ("0.1", "'0.1' is not a number of radians"),
            (-np.inf, "-inf rad .*is outside"),
            ([[np.nan], [np.inf]], "inf rad .*is outside"),
        ):
            angles: list[Any] = [0.1, 0.2, 0.3, 0.4]
            angles[position] = wrong
            with pytest.raises(ParameterError, match=f"^{argument}: {words}"):
                spec.evaluate(*angles, **given(spec))
            if spec.specular and position == 0:
                with pytest.raises(ParameterError, match=f"^{argument}: {words}"):
                    specular(spec, wrong, given(spec))


@FORMS
def test_refuses_what_is_no_unit_vector(name: str) -> None:
    spec = MODELS[name]
    for position, argument in enumerate(("wi", "wr")):
        for wrong, message in (
            ([0.0, 0.0, 1.1], r"\(0, 0, 1\.1\) has the length 1\.1, not 1"),
            ([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]], r"\(0, 0, 0\) has the length 0, not 1"),
            ([np.inf, 0.0, 0.0], r"\(inf, 0, 0\) has the length inf, not 1"),
            ([0.0, 1.0], r"float64 of shape \(2,\) is not an array of vectors"),
            (1.0, r"float64 of shape \(\) is not an array of vectors"),
            ([True, False, False], r"bool of shape \(3,\) is not an array of vectors"),
            (["a", "b", "c"], r"<U1 of shape \(3,\) is not an array of vectors"),
            ([0.0, 0.0, 1j], r"complex128 of shape \(3,\) is not an array of vectors"),
        ):
            vectors: list[Any] = [[0.0, 0.6, 0.8], [0.0, 0.6, 0.8]]
            vectors[position] = wrong
            with pytest.raises(ParameterError, match=rf"^{argument}: {message}"):
                spec.vectors(*vectors, **given(spec))


@FORMS
def test_refuses_a_parameter_in_one_sentence_from_angles_and_from_vectors(name: str) -> None:
    spec = MODELS[name]
    for parameter in parameters_of(spec):
        for wrong in ("0.5", None, 0.5 + 0.0j, np.array([0.5j]), ["a"], {}):
            expected = f"{parameter.name}: {wrong!r} is not a number in {parameter.interval}"
            assert refused(spec, parameter, wrong) == expected
        for barely in (np.nextafter(parameter.low, -np.inf), np.nextafter(parameter.high, np.inf)):
            assert refused(spec, parameter, barely).startswith(f"{parameter.name}: ")
        for wrong in (parameter.low - 0.125, beyond(parameter), np.inf, -np.inf, np.nan):
            micrometres = "; is it in micrometres?" if parameter.unit == "nm" and 0.0 < wrong < 1.0 else ""
            expected = f"{parameter.name}: {wrong:.16g} is outside {parameter.interval}{micrometres}"
            assert refused(spec, parameter, wrong) == expected
            assert refused(spec, parameter, [parameter.low, wrong, parameter.high]) == expected
            assert refused(spec, parameter, np.array([[parameter.high], [wrong]])) == expected
            parameters = given(spec) | {parameter.name: wrong}
            with pytest.raises(ParameterError, match=f"^{re.escape(expected)}$"):
                spec.vectors([0.0, 0.6, 0.8], [0.0, 0.6, 0.8], **parameters)


def test_arguments_that_are_missing_or_unknown_are_named() -> None:
    for call, argument in (
        (lambda: minnaert(0.1, 0.2, 0.3, 0.4), "k"),
        (lambda: minnaert(0.1, 0.2, 0.3, k=0.5), "phi_r"),
        (lambda: minnaert(0.1, 0.2, 0.3, 0.4, k=0.5, sigma=0.1), "sigma"),
        (lambda: minnaert(0.1, 0.2, 0.3, 0.4, 0.5), "positional"),
        (lambda: he_torrance_jones(0.1, 0.2, 0.3, 0.4, n=1.5, k=0.0, threads=2), "threads"),
    ):
        with pytest.raises(TypeError, match=argument):
            call()
    by_name = minnaert(theta_i=0.1, phi_i=0.2, theta_r=0.3, phi_r=0.4, k=0.5)
    assert by_name == minnaert(0.1, 0.2, 0.3, 0.4, k=0.5, rho=1.0)


def test_functions_are_found_by_their_names_when_they_are_unpickled() -> None:
    for function in (minnaert, ward, ward_vectors, MODELS["ward"].gradient):
        assert pickle.loads(pickle.dumps(function)) is function


def test_features_are_those_of_directions_of_both_kinds() -> None:
    for directions in (Angles, Vectors):
        names = {*vars(directions), *directions.__dataclass_fields__}
        assert names >= FEATURES
    assert {"cos_i", "cos_r", "sin_i", "sin_r", "x_i", "y_r", "cos_dphi", "theta_i"} <= FEATURES


def test_three_forms_of_a_function_give_the_same_values() -> None:
    @DeclaredModel(**DUST)
    def dust(cos_i: float, cos_r: float, w: float) -> float:
        """Return f_r [1/sr]."""
        return w / (cos_i + cos_r)

    @DeclaredModel(**DUST)
    def dust_of_arrays(directions: Directions, w: Floats) -> Floats:
        """Return f_r [1/sr]."""
        return w / (directions.cos_i + directions.cos_r)

    @of_directions(parameters=(W,), references="seeliger1887")
    def dust_of_several(directions: Directions, *parameters: Floats) -> Floats:
        """Return f_r [1/sr]."""
        return parameters[0] / (directions.cos_i + directions.cos_r)

    assert (dust.spec.name, dust.spec.reference, dust.spec.spectral) == ("dust", "seeliger1887", False)
    assert dust.spec.evaluate is dust
    assert inspect.signature(dust.vectors).parameters == inspect.signature(dust_of_arrays.vectors).parameters
    for function in (dust, dust.vectors):
        assert [*get_type_hints(function)] == [*inspect.signature(function).parameters, "return"]
    for words in (
        "\nw : array_like [1]\n    A weight, in [0, 1]; by default 0.5.\n",
        "\nout : array",
        "\nthreads : int\n",
    ):
        assert words in (dust.__doc__ or "")
    angles = (np.array([0.3, 2.0, np.nan]), 0.0, 0.4, 1.0)
    expected = [0.5 / (np.cos(0.3) + np.cos(0.4)), 0.0, np.nan]
    for function in (dust, dust_of_arrays, dust_of_several):
        np.testing.assert_allclose(function(*angles), expected, rtol=1e-15)
        np.testing.assert_allclose(function.vectors([0.0, 0.0, 1.0], [0.0, 0.6, 0.8], w=0.9), 0.5, rtol=1e-15)


def test_a_declaration_that_does_not_fit_its_function_is_refused() -> None:
    with pytest.raises(TypeError, match=r"^dust: its arguments depth are not its parameters w; "):

        @DeclaredModel(**DUST)
        def dust(cos_i: float, depth: float) -> float:
            return depth / cos_i

    with pytest.raises(TypeError, match="decorates a function"):
        DeclaredModel(**DUST).evaluate(0.1, 0.2, 0.3, 0.4)


def test_parameters_are_checked_before_the_shapes_of_all_arguments() -> None:
    with pytest.raises(ValueError, match="broadcast"):
        lambert_vectors(np.tile([0.0, 0.0, 1.0], (3, 1)), [0.0, 0.0, 1.0], rho=[0.1, 0.2])
    with pytest.raises(ParameterError, match=r"^rho: 2 is outside"):
        lambert_vectors(np.tile([0.0, 0.0, 1.0], (3, 1)), [0.0, 0.0, 1.0], rho=[0.1, 2.0])
