"""Functions of the papers beside the models (parts, limits, matrices, apertures): unit vectors, nan, horizon, types."""

import inspect
from typing import Any

import numpy as np
import pytest

from brdfdb import models
from brdfdb.geometry import unit_vector
from brdfdb.models import MODELS
from tests.models.hazard_twins import Reals, flat
from tests.models.hazards import MATRICES
from tests.models.he_torrance_surfaces import CONES, HALF_PI, directions

OPTICS = {"n": 0.769, "k": 6.08}
SURFACE = {"wavelength_nm": 2000.0, "sigma_0_um": 0.28, "tau_um": 1.77, **OPTICS}
# Parameters, and the largest difference of unit vectors from their angles: of each number, relative, of matrices
# relative to the largest element. The worst measured stands behind it
FUNCTIONS: dict[str, tuple[dict[str, float], float]] = {
    "ggx_scaled": ({"f_0": 0.7, "alpha": 0.5}, 2e-14),
    "he_torrance_aperture": (CONES | SURFACE | {"a": 0.1, "rings": 1}, 2e-14),  # 3.4e-15
    "he_torrance_jones": (OPTICS, 2e-14),  # 4.4e-15
    "he_torrance_mueller": (SURFACE | {"a": 0.1}, 5e-14),  # 7.8e-15
    "he_torrance_parts": (SURFACE | {"a": 0.1}, 2e-14),
    "he_torrance_smooth": (OPTICS, 2e-14),
    "he_torrance_specular": (SURFACE, 2e-14),
    "he_torrance_specular_mueller": (SURFACE, 5e-14),
    "he_torrance_very_rough": ({"sigma_0_over_tau": 0.2, **OPTICS, "a": 0.1}, 2e-14),
    "oren_nayar_parts": ({"rho": 0.7, "sigma": 0.5}, 3e-13),
    "oren_nayar_unidirectional_parts": ({"rho": 0.7, "theta_a": 0.6, "phi_a": 0.9}, 3e-13),
    "oren_nayar_single_slope_parts": ({"rho": 0.7, "theta_a": 0.6}, 3e-13),
    "oren_nayar_gaussian_parts": ({"rho": 0.7, "sigma": 0.5}, 3e-13),  # 8.8e-14, second bounce
}
OF_A_MATRIX = (*MATRICES, "he_torrance_specular_mueller")

every_function = pytest.mark.parametrize("name", FUNCTIONS)


def by_angles(name: str, *angles: Any, **changed: Any) -> Any:
    function = getattr(models, name)
    wanted = [
        each for each in inspect.signature(function).parameters if each in ("theta_i", "phi_i", "theta_r", "phi_r")
    ]
    return function(*angles[: len(wanted)], **FUNCTIONS[name][0] | changed)


def by_vectors(name: str, wi: Any, wr: Any, **changed: Any) -> Any:
    function = getattr(models, f"{name}_vectors")
    vectors = (wi, wr) if "wr" in inspect.signature(function).parameters else (wi,)
    return function(*vectors, **FUNCTIONS[name][0] | changed)


def test_every_function_is_in_the_table() -> None:
    twins = {name.removesuffix("_vectors") for name in models.__all__ if name.endswith("_vectors")}
    assert twins - set(MODELS) == set(FUNCTIONS)


@every_function
def test_vectors_give_what_angles_give(name: str) -> None:
    theta_i, phi_i, theta_r, phi_r = directions(np.random.default_rng(9), 200)
    if not name.startswith("he_torrance") or name == "he_torrance_smooth":  # others depend on the azimuth at the pole
        theta_i[:2], theta_r[1:3] = 0.0, 0.0
    if name.startswith("oren_nayar"):  # at the horizon facets make much of roundings
        theta_i, theta_r = np.minimum(theta_i, 1.5), np.minimum(theta_r, 1.5)
    expected = flat(by_angles(name, theta_i, phi_i, theta_r, phi_r))
    values = flat(by_vectors(name, unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)))
    scale: Reals = np.abs(expected)
    if name in OF_A_MATRIX:
        scale = scale.max(axis=-1, keepdims=True)
    assert (np.abs(values - expected) <= FUNCTIONS[name][1] * scale + 1e-16 * name.startswith("oren_nayar")).all()


@every_function
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_nan_goes_through_and_below_the_horizon_nothing_is_reflected(name: str, dtype: type) -> None:
    theta_i, *others = (np.asarray(each, dtype) for each in ([0.3, 0.3, 2.0, HALF_PI], 0.1, 0.5, 2.0))
    wi, wr = unit_vector(theta_i, others[0]).astype(dtype), unit_vector(*others[1:]).astype(dtype)
    theta_i[1], wi[1, 1], wi[3, 2] = np.nan, np.nan, 0.0
    results = [by_angles(name, theta_i, *others), by_vectors(name, wi, wr)]
    if "wr" in inspect.signature(getattr(models, f"{name}_vectors")).parameters:
        results += [by_angles(name, *others[1:], theta_i, others[0]), by_vectors(name, wr, wi)]
    for values in map(flat, results):
        assert values.dtype == dtype
        assert np.isfinite(values[[0, 3]]).all()
        assert (values[0] != 0.0).any()
        assert np.isnan(values[1]).all()
        assert (values[2] == 0.0).all()


@every_function
def test_arguments_broadcast_scalars_give_scalars_and_wrong_ones_are_refused(name: str) -> None:
    first, value = next(iter(FUNCTIONS[name][0].items()))
    one = by_angles(name, 0.3, 0.1, 0.5, 2.0)
    several = by_angles(name, [0.3, 0.4, 0.6], 0.1, 0.5, 2.0, **{first: [[0.9 * value], [value]]})
    of_vectors = by_vectors(name, [0, 0, 1], unit_vector(0.5, 2.0))
    if not isinstance(one, tuple):
        one, several, of_vectors = (one,), (several,), (of_vectors,)
    for alone, rows, of_vector in zip(one, several, of_vectors, strict=True):
        assert alone.dtype == of_vector.dtype == (np.complex128 if name == "he_torrance_jones" else np.float64)
        assert np.ndim(alone) == np.ndim(of_vector) == 2 * (name in OF_A_MATRIX)
        assert rows.shape == (2, 3, *np.shape(alone))
        np.testing.assert_allclose(rows[1, 0], alone, rtol=1e-10, atol=1e-15)
    with pytest.raises(ValueError, match=rf"^{first}: nan is outside \["):
        by_angles(name, 0.3, 0.1, 0.5, 2.0, **{first: np.nan})
    with pytest.raises(ValueError, match=r"^wi: \(0, 0, 2\) has the length 2, not 1$"):
        by_vectors(name, [0, 0, 2], [0.0, 0.6, 0.8])
