"""Ordinary and cornered arguments for any model of the registry."""

import inspect
import itertools
import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.models import MODELS
from brdfdb.parameters import WAVELENGTH_NM, K, ModelSpec, N, Parameter

HALF_PI = np.pi / 2
HORIZON_32 = np.float32(HALF_PI)  # lies above pi/2, and is read as the horizon
TINY = 1e-280
ROWS = 1e-11  # 1e-12: rows of He-Torrance share the terms of a table, see test_he_torrance_series
LIGHT = (WAVELENGTH_NM, N, K)  # of every spectral model
ANGLES = ("theta_i", "phi_i", "theta_r", "phi_r")
SLOW = ("oren_nayar_gaussian",)  # an integral, 30 us a value

every_model = pytest.mark.parametrize("spec", MODELS.values(), ids=MODELS.keys())

Arguments = dict[str, Any]


def parameters_of(spec: ModelSpec) -> tuple[Parameter, ...]:
    """The parameters of the model, and those of the light that it reads: some need no wavelength beside n and k."""
    signature = inspect.signature(spec.evaluate).parameters
    light = [each for each in LIGHT if spec.spectral and signature[each.name].default is not None]
    return (*spec.parameters, *light)


def drawn(spec: ModelSpec, rng: np.random.Generator, count: int | None = None) -> Arguments:
    """Ordinary parameters, for any model: the part of each range below 1, and visible light."""
    ranges = {parameter.name: (parameter.low, min(parameter.high, 1.0)) for parameter in spec.parameters}
    if spec.spectral:
        ranges |= {"wavelength_nm": (400.0, 800.0), "n": (0.2, 2.5), "k": (0.0, 7.0)}
    return {name: rng.uniform(low, high, count) for name, (low, high) in ranges.items()}


def middle(spec: ModelSpec) -> dict[str, float]:
    """Each parameter in the middle of the part of its range below 1."""
    return {parameter.name: 0.5 * (parameter.low + min(parameter.high, 1.0)) for parameter in spec.parameters}


def beyond(parameter: Parameter) -> float:
    """Return a value above the range of a parameter."""
    return parameter.high + max(0.5 * abs(parameter.high), 0.125)


def drawn_angles(rng: np.random.Generator, count: int) -> tuple[NDArray[np.float64], ...]:
    theta_i, theta_r = rng.uniform(0.0, HALF_PI, (2, count))
    phi_i, phi_r = rng.uniform(-np.pi, np.pi, (2, count))
    return theta_i, phi_i, theta_r, phi_r


def corner_parameters(spec: ModelSpec) -> Arguments:
    """Every combination of the lowest, the highest and the default value of the parameters, along one axis."""
    ends = [
        sorted(
            {parameter.low, parameter.high, float(parameter.low if parameter.default is None else parameter.default)}
        )
        for parameter in parameters_of(spec)
    ]
    columns = zip(*itertools.product(*ends), strict=True)
    return {parameter.name: np.array(column) for parameter, column in zip(parameters_of(spec), columns, strict=True)}


def corner_angles() -> tuple[NDArray[np.float64], ...]:
    """Every combination of the corners of the directions, on four axes."""
    thetas = np.array([0.0, 5e-324, 1e-8, np.pi / 4, 1.3, np.nextafter(HALF_PI, 0.0), HALF_PI])
    phis = np.array([0.0, np.pi, -HALF_PI, 2.0 * np.pi, 1e15])
    theta_i, phi_i, theta_r, phi_r = np.meshgrid(thetas, phis, thetas, phis, indexing="ij", sparse=True)
    return theta_i, phi_i, theta_r, phi_r


def specular(spec: ModelSpec, theta_i: Any, parameters: Arguments) -> Any:
    assert spec.specular is not None
    return spec.specular(theta_i, **{name: parameters[name] for name in spec.specular_parameters})


def refused(spec: ModelSpec, parameter: Parameter, wrong: Any) -> str:
    """What the model says to a wrong parameter, and its specular part in the same words."""
    parameters = drawn(spec, np.random.default_rng(19)) | {parameter.name: wrong}
    with pytest.raises(ValueError) as caught:  # noqa: PT011  # the callers look at the message
        spec.evaluate(0.1, 0.2, 0.3, 0.4, **parameters)
    message = str(caught.value)
    if spec.specular and parameter.name in spec.specular_parameters:
        with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
            specular(spec, 0.1, parameters)
    return message
