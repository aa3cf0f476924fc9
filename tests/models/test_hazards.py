"""Every hazard of the table: finite, not negative, reciprocal, continuous, and within 1e-10 of 40 digits."""

import functools
from typing import Any

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb import models
from brdfdb.models import MODELS
from brdfdb.models._diffraction_series import diffraction_series
from brdfdb.reference import mp
from tests.models import hazard_twins as twins
from tests.models import hazards
from tests.models.hazard_directions import EXACT, NEAR, PI, SOME, Directions
from tests.models.hazards import Arguments, Subject

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")

RECIPROCITY = {np.float64: 1e-12, np.float32: 2.0**-22}  # relative; float32: the rounding of two results


def disagreement(
    subject: Subject,
    form: str,
    values: twins.Reals,
    given: NDArray[Any],
    dtype: type,
    parameters: Arguments,
) -> float:
    """The largest relative error of the values of a pair of directions, less what rounding does if it is too large."""
    exact, point = twins.exact_parameters(parameters), twins.point_of(given)
    twin = twins.expected(subject.name, twins.direction_of(point), exact)
    assert len(twin) == len(values)
    floor = twins.TINY[dtype] + (hazards.INTEGRATED[dtype] * hazards.INTEGRATED_FLOOR if subject.integrated else 0.0)
    errors = [abs(mp.mpf(float(value)) - target) - floor for value, target in zip(values, twin, strict=True)]
    worst = max(map(twins.ratio, errors, twins.scales(subject, twin)))
    if worst > subject.agreement[dtype] and not subject.integrated:
        # the length of vectors is 1 to their own precision; angles are exact, and the arithmetic is float64
        epsilon = float(np.finfo(dtype).eps) if form == "vectors" else twins.EPSILON
        allowed = twins.roundings(subject, point, epsilon, exact)
        errors = [error - twins.ROUNDINGS * each for error, each in zip(errors, allowed, strict=True)]
        worst = max(map(twins.ratio, errors, twins.scales(subject, twin)))
    return worst


@functools.cache
def evaluations(subject: Subject, form: str, dtype: type) -> list[tuple[Arguments, NDArray[Any], NDArray[Any]]]:
    """Parameters, directions and values of the whole table."""
    rows = [(parameters, twins.given_as(form, directions, dtype)) for parameters, directions in subject.table()]
    return [(parameters, given, twins.evaluated(subject, form, given, parameters)) for parameters, given in rows]


every_form = pytest.mark.parametrize(("subject", "form"), twins.FORMS)


def test_every_model_is_in_the_table() -> None:
    assert set(MODELS) <= set(hazards.BY_NAME)
    assert len(hazards.BY_NAME) == len(hazards.SUBJECTS)


@every_form
@twins.every_dtype
def test_is_finite_and_not_negative(subject: Subject, form: str, dtype: type) -> None:
    for parameters, given, values in evaluations(subject, form, dtype):
        assert values.dtype == dtype
        assert np.isfinite(values).all(), parameters
        if subject.name not in hazards.MATRICES:
            assert (values >= 0.0).all(), parameters
        if subject.name == "he_torrance_mueller":
            assert (values[:, 0] >= np.max(np.abs(values[:, 1:]), axis=-1)).all(), parameters
        assert len(given) == len(values)


@pytest.mark.parametrize("name", ["he_torrance_aperture", "he_torrance_specular_mueller"])
@twins.every_dtype
def test_what_has_no_twin_is_finite(name: str, dtype: type) -> None:
    theta_i, phi_i, theta_r, phi_r = twins.angles_of([*EXACT.values(), *NEAR[::4]], dtype).T
    w = twins.vectors_of([*EXACT.values()], dtype)
    for parameters in hazards.HE_TORRANCE_TABLE:
        if name == "he_torrance_aperture":
            wanted = {"incident_solid_angle_sr": 1e-3, "received_solid_angle_sr": 1e-3, "rings": 1, **parameters}
            values = models.he_torrance_aperture(theta_i, phi_i, theta_r, phi_r, **wanted)
            of_vectors = models.he_torrance_aperture_vectors(*np.moveaxis(w, 0, 1), **wanted)
            assert (np.append(values, of_vectors) >= 0.0).all(), parameters
        else:
            values = models.he_torrance_specular_mueller(theta_i, **parameters)
        assert values.dtype == dtype
        assert np.isfinite(values).all(), parameters


@every_form
@twins.every_dtype
def test_agrees_with_its_twin(subject: Subject, form: str, dtype: type) -> None:
    for parameters, given, values in evaluations(subject, form, dtype):
        for each, value in zip(given, values, strict=True):
            error = disagreement(subject, form, value, each, dtype, parameters)
            assert error <= subject.agreement[dtype], f"off by {error:.3g}: {value} at {each}, {parameters}"


def exchanged(subject: Subject, values: twins.Reals) -> twins.Reals:
    """The values that belong to light and viewer exchanged."""
    if subject.name == "he_torrance_jones":  # J' = Z J^T Z
        matrix = values.reshape(-1, 2, 2, 2).swapaxes(1, 2)
        return (matrix * np.array([[1.0, -1.0], [-1.0, 1.0]])[..., None]).reshape(values.shape)
    if subject.name == "he_torrance_mueller":  # M' = D M^T D
        sign = np.array([1.0, 1.0, -1.0, 1.0])
        return (values.reshape(-1, 4, 4).swapaxes(1, 2) * sign * sign[:, None]).reshape(values.shape)
    return values


@every_form
@twins.every_dtype
def test_is_reciprocal(subject: Subject, form: str, dtype: type) -> None:
    if subject.of_one_direction:
        return
    for parameters, given, values in evaluations(subject, form, dtype):
        swap = given[:, ::-1] if form == "vectors" else given[:, [2, 3, 0, 1]]
        values, other = values.astype(np.float64), exchanged(subject, twins.evaluated(subject, form, swap, parameters))
        scale = np.max(np.abs(values), axis=-1, keepdims=True) if subject.name in hazards.MATRICES else np.abs(values)
        limit = RECIPROCITY[dtype] * scale + twins.TINY[dtype]
        assert (np.abs(values - other) <= limit).all(), parameters


# He-Torrance: the series of eq. 78, and rows along the azimuth

# where the summand peaks at m*, V being given; and where u = 2 ln(m* / g) is
PEAKS = [(m * np.exp(-V / m**2), V) for m, V in ((40.0, 0.0), (40.0, 10.0), (40.0, 1e4), (1e6, 0.0), (1e6, 1e6))]
OFF_PEAKS = [(g, 0.5 * g * g * u * np.exp(u)) for g in (10.0, 1e3, 1e5) for u in (0.25, 1e-3)]
OFF_PEAKS += [(g, 0.5e-3 * g * g) for g in (10.0, 1e3)]


@pytest.mark.parametrize(("g", "V"), [*PEAKS, *OFF_PEAKS])
def test_series_is_continuous_where_its_method_changes(g: float, V: float) -> None:
    relative = np.array([0.0, 2e-16, -2e-16, 1e-15, -1e-15, 1e-13, -1e-13])
    for values in (diffraction_series(g * (1.0 + relative), np.float64(V)), diffraction_series(g, V * (1 + relative))):
        assert np.max(np.abs(values - values[0])) <= hazards.JUMP[np.float64] * values[0]


@twins.every_dtype
@pytest.mark.parametrize("length", [47, 48, 64], ids="{}-values".format)
def test_rows_along_the_azimuth_agree_with_the_twin(length: int, dtype: type) -> None:
    """From 48 values on a row is interpolated, where that is less work."""
    subject = hazards.BY_NAME["he_torrance"]
    for parameters in subject.parameters[2:6]:
        for at in SOME:
            given = np.array(at, dtype=dtype)
            phi_r = np.append(np.linspace(-3.0, 3.0, length - 1), given[3]).astype(dtype)
            value = models.he_torrance(*given[:3], phi_r, **parameters)[-1:]
            error = disagreement(subject, "angles", value, given, dtype, parameters)
            assert error <= hazards.AGREEMENT[dtype], f"off by {error:.3g} at {at}, {parameters}"


# Narrow lobes next to the horizon, half a width beside the mirror direction

WARD_NARROW = "rho_d=0 rho_s=1 alpha_x=1e-4 alpha_y=1e-4"
NARROW_LOBES = [
    ("torrance_sparrow", "sigma=1e-4", False),
    *((name, WARD_NARROW, True) for name in ("ward", "ward_half_vector", "ward_duer", "ward_bounded")),
    ("he_torrance_very_rough", "sigma_0_over_tau=1e-4 n=1.5 k=0", False),
]
CANCELS = "sin(theta_i) - sin(theta_r) cancels at the horizon: 1e-16 / alpha^2 of the value instead of 1e-16 / alpha"


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        pytest.param(name, row, marks=[pytest.mark.xfail(strict=True, reason=CANCELS)] if cancels else [], id=name)
        for name, row, cancels in NARROW_LOBES
    ],
)
def test_narrow_lobes_beside_the_mirror_direction_at_grazing(name: str, parameters: str) -> None:
    row, subject = hazards.table(parameters)[0], hazards.BY_NAME[name]
    directions = [
        Directions(x, 0.0, x - width, PI) for x in (1.57, 1.5707, 1.57079) for width in (3.1e-4, 2.3e-4, 1.7e-4)
    ]
    given = twins.given_as("angles", directions, np.float64)
    for each, value in zip(given, twins.evaluated(subject, "angles", given, row), strict=True):
        error = disagreement(subject, "angles", value, each, np.float64, row)
        assert error <= hazards.AGREEMENT[np.float64], f"off by {error:.3g} at {each}"
