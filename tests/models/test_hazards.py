"""Every hazard of the table: finite, not negative, reciprocal, continuous, and within 1e-10 of 40 digits."""

import functools
from typing import Any

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb import models
from brdfdb.geometry import unit_vector
from brdfdb.models import MODELS
from brdfdb.models._diffraction_series import diffraction_series
from brdfdb.reference import he_torrance_1991, mp
from tests.models.hazards import (
    AGREEMENT,
    BRANCHES,
    BY_NAME,
    COS_HORIZON,
    EXACT,
    HALF_PI,
    HE_TORRANCE_TABLE,
    INTEGRATED,
    INTEGRATED_FLOOR,
    JUMP,
    MATRICES,
    NEAR,
    PI,
    SOME,
    SUBJECTS,
    Arguments,
    Directions,
    Subject,
    table,
)

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")

RECIPROCITY = {np.float64: 1e-12, np.float32: 2.0**-22}  # relative; float32: the rounding of two results
TINY = {np.float64: 1e-270, np.float32: 2.0**-126}  # smaller values carry too few digits, or none
# exp(-tan^2(delta) / alpha^2), the pole at grazing, the kink at the angle of total reflection: of the rounding of the
# arguments each makes more than is promised, in any float64 code. As many roundings of every argument are allowed.
ROUNDINGS = 2.0
EPSILON = 2.0**-52
SUBNORMAL = 1e-300  # [rad] such an angle is 0, but has an azimuth

Reals = NDArray[np.float64]


# Their values


def flat(values: Any) -> Reals:
    if isinstance(values, tuple):  # parts
        values = np.stack(values, axis=-1)
    if np.iscomplexobj(values):
        values = np.stack([values.real, values.imag], axis=-1)
    array = np.asarray(values)
    return array.reshape(array.shape[0], -1)


@functools.cache
def expected(name: str, directions: tuple[Any, ...], parameters: tuple[tuple[str, Any], ...]) -> tuple[Any, ...]:
    value = BY_NAME[name].twin(*directions, **dict(parameters))
    return tuple(value) if isinstance(value, tuple | list) else (mp.mpf(value),)


def exact_parameters(parameters: Arguments) -> tuple[tuple[str, Any], ...]:
    """As 40 digits; a refractive index is the decimal that was typed, see `brdfdb.fresnel`."""
    return tuple((name, mp.mpf(repr(x) if name == "n" else x)) for name, x in parameters.items())


Point = tuple[Any, ...]  # exact: four angles, or six components


def point_of(given: NDArray[Any]) -> Point:
    return tuple(mp.mpf(float(x)) for x in given.ravel())


def direction_of(point: Point) -> tuple[Any, ...]:
    """The exact angles; z = 0, and an angle beyond the float64 nearest pi/2, is the horizon."""
    if len(point) == 4:
        angles = [*point]
    else:
        angles = [
            angle
            for x, y, z in (point[:3], point[3:])
            for angle in (
                mp.atan2(mp.hypot(x, y), z) if z > COS_HORIZON else mp.pi,
                mp.atan2(y, x) if x or y else mp.zero,
            )
        ]
    for i in (0, 2):  # erfc of the cotangent of a subnormal angle is too small for mpmath
        angles[i] = mp.zero if angles[i] < SUBNORMAL else min(angles[i], mp.mpf(HALF_PI))
    return tuple(angles)


def roundings(subject: Subject, point: Point, epsilon: float, parameters: tuple[tuple[str, Any], ...]) -> list[Any]:
    """How much every value moves, at most, as each argument is rounded in turn; next to pi/2, what is left to it."""
    at = expected(subject.name, direction_of(point), parameters)
    total = [mp.zero] * len(at)

    def add(*near: tuple[Any, ...]) -> None:
        for i, value in enumerate(at):
            total[i] += max(abs(each[i] - value) for each in near)

    for i, x in enumerate(point):
        size = epsilon * (min(x, abs(mp.pi / 2 - x)) if len(point) == 4 and i % 2 == 0 else x)
        near = ((*point[:i], x + change, *point[i + 1 :]) for change in (size, -size))
        add(*(expected(subject.name, direction_of(each), parameters) for each in near))
    for i, (name, x) in enumerate(parameters):
        near = ((*parameters[:i], (name, x * change), *parameters[i + 1 :]) for change in (1 + EPSILON, 1 - EPSILON))
        add(*(expected(subject.name, direction_of(point), each) for each in near))
    return total


def scales(subject: Subject, values: Any) -> list[Any]:
    """What errors are relative to: each value, in a matrix the largest element."""
    if subject.name in MATRICES:
        return [max(abs(value) for value in values)] * len(values)
    return [abs(value) for value in values]


def ratio(error: Any, scale: Any) -> float:
    return 0.0 if error <= 0 else float(error / scale) if scale > 0 else np.inf


def disagreement(
    subject: Subject, form: str, values: Reals, given: NDArray[Any], dtype: type, parameters: Arguments
) -> float:
    """The largest relative error of the values of a pair of directions, less what rounding does if it is too large."""
    exact, point = exact_parameters(parameters), point_of(given)
    twin = expected(subject.name, direction_of(point), exact)
    assert len(twin) == len(values)
    floor = TINY[dtype] + (INTEGRATED[dtype] * INTEGRATED_FLOOR if subject.integrated else 0.0)
    errors = [abs(mp.mpf(float(value)) - target) - floor for value, target in zip(values, twin, strict=True)]
    worst = max(map(ratio, errors, scales(subject, twin)))
    if worst > subject.agreement[dtype] and not subject.integrated:
        # the length of vectors is 1 to their own precision; angles are exact, and the arithmetic is float64
        epsilon = float(np.finfo(dtype).eps) if form == "vectors" else EPSILON
        allowed = roundings(subject, point, epsilon, exact)
        errors = [error - ROUNDINGS * each for error, each in zip(errors, allowed, strict=True)]
        worst = max(map(ratio, errors, scales(subject, twin)))
    return worst


def angles_of(directions: list[Directions], dtype: type) -> NDArray[Any]:
    """Shape (N, 4), each pair of directions once."""
    return np.array(list(dict.fromkeys(tuple(np.asarray(each, dtype=dtype)) for each in directions)), dtype=dtype)


def vectors_of(directions: list[Directions], dtype: type) -> NDArray[Any]:
    """Shape (N, 2, 3); z = 0 at 90 degrees."""
    w = unit_vector(*np.array(directions).reshape(-1, 2, 2).transpose(2, 0, 1))
    w[..., 2] = np.where(w[..., 2] < 1e-16, 0.0, w[..., 2])
    return w.astype(dtype)


def given_as(form: str, directions: list[Directions], dtype: type) -> NDArray[Any]:
    return vectors_of(directions, dtype) if form == "vectors" else angles_of(directions, dtype)


def evaluated(subject: Subject, given: NDArray[Any], parameters: Arguments) -> NDArray[Any]:
    """Values of shape (N, values) of angles (N, 4), or of vectors (N, 2, 3)."""
    name = f"{subject.name}_vectors" if given.ndim == 3 else subject.name
    directions = np.moveaxis(given, 0, -1) if given.ndim == 2 else np.moveaxis(given, 0, 1)
    return flat(getattr(models, name)(*directions[: 1 if subject.of_one_direction else None], **parameters))


@functools.cache
def hazards(subject: Subject, form: str, dtype: type) -> list[tuple[Arguments, NDArray[Any], NDArray[Any]]]:
    """Parameters, directions and values of the whole table."""
    rows = [(parameters, given_as(form, directions, dtype)) for parameters, directions in subject.table()]
    return [(parameters, given, evaluated(subject, given, parameters)) for parameters, given in rows]


FORMS = [
    pytest.param(subject, form, id=f"{subject.name}-{form}")
    for subject in SUBJECTS
    for form in ("angles", "vectors")
    if form == "angles" or hasattr(models, f"{subject.name}_vectors")
]
every_form = pytest.mark.parametrize(("subject", "form"), FORMS)
# float32 vectors have lengths of 1 to 6e-8 only, and lengths of neighbours differ
CONTINUOUS = [
    pytest.param(*each.values, dtype, id=f"{each.id}-{dtype.__name__}")
    for each in FORMS
    for dtype in (np.float64, np.float32)
    if (each.values[1], dtype) != ("vectors", np.float32)
]
every_dtype = pytest.mark.parametrize("dtype", [np.float64, np.float32], ids=["float64", "float32"])


def test_every_model_is_in_the_table() -> None:
    assert set(MODELS) <= set(BY_NAME)
    assert len(BY_NAME) == len(SUBJECTS)


@every_form
@every_dtype
def test_is_finite_and_not_negative(subject: Subject, form: str, dtype: type) -> None:
    for parameters, given, values in hazards(subject, form, dtype):
        assert values.dtype == dtype
        assert np.isfinite(values).all(), parameters
        if subject.name not in MATRICES:
            assert (values >= 0.0).all(), parameters
        if subject.name == "he_torrance_mueller":
            assert (values[:, 0] >= np.max(np.abs(values[:, 1:]), axis=-1)).all(), parameters
        assert len(given) == len(values)


@pytest.mark.parametrize("name", ["he_torrance_aperture", "he_torrance_specular_mueller"])
@every_dtype
def test_what_has_no_twin_is_finite(name: str, dtype: type) -> None:
    theta_i, phi_i, theta_r, phi_r = angles_of([*EXACT.values(), *NEAR[::4]], dtype).T
    w = vectors_of([*EXACT.values()], dtype)
    for parameters in HE_TORRANCE_TABLE:
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
@every_dtype
def test_agrees_with_its_twin(subject: Subject, form: str, dtype: type) -> None:
    for parameters, given, values in hazards(subject, form, dtype):
        for each, value in zip(given, values, strict=True):
            error = disagreement(subject, form, value, each, dtype, parameters)
            assert error <= subject.agreement[dtype], f"off by {error:.3g}: {value} at {each}, {parameters}"


def exchanged(subject: Subject, values: Reals) -> Reals:
    """The values that belong to light and viewer exchanged."""
    if subject.name == "he_torrance_jones":  # J' = Z J^T Z
        matrix = values.reshape(-1, 2, 2, 2).swapaxes(1, 2)
        return (matrix * np.array([[1.0, -1.0], [-1.0, 1.0]])[..., None]).reshape(values.shape)
    if subject.name == "he_torrance_mueller":  # M' = D M^T D
        sign = np.array([1.0, 1.0, -1.0, 1.0])
        return (values.reshape(-1, 4, 4).swapaxes(1, 2) * sign * sign[:, None]).reshape(values.shape)
    return values


@every_form
@every_dtype
def test_is_reciprocal(subject: Subject, form: str, dtype: type) -> None:
    if subject.of_one_direction:
        return
    for parameters, given, values in hazards(subject, form, dtype):
        swap = given[:, ::-1] if form == "vectors" else given[:, [2, 3, 0, 1]]
        values, other = values.astype(np.float64), exchanged(subject, evaluated(subject, swap, parameters))
        scale = np.max(np.abs(values), axis=-1, keepdims=True) if subject.name in MATRICES else np.abs(values)
        limit = RECIPROCITY[dtype] * scale + TINY[dtype]
        assert (np.abs(values - other) <= limit).all(), parameters


# Continuity


def test_continuity_is_of_the_twins_too() -> None:
    """Between a corner and 1e-32 beside it no twin jumps: what `jump` takes from the twin is a slope."""
    for subject in SUBJECTS:
        if subject.integrated or subject.name in MATRICES:  # s and p turn at the pole
            continue
        parameters = exact_parameters(subject.parameters[-1])
        for directions in EXACT.values():
            at = direction_of(point_of(np.array(directions)))
            value = expected(subject.name, at, parameters)
            for i, x in enumerate(at):
                inward = -1 if i % 2 == 0 and x > 1 else 1
                beside = expected(subject.name, (*at[:i], x + inward * mp.mpf("1e-32"), *at[i + 1 :]), parameters)
                for a, b in zip(value, beside, strict=True):
                    assert abs(a - b) <= JUMP[np.float64] * abs(a) + TINY[np.float64], (
                        subject.name,
                        directions,
                        parameters,
                    )


def steps(x: float, dtype: type, low: float, high: float) -> list[float]:
    """A hair to either side: 1 and 4 units in the last place and, of float64, 1e-12 and 1e-9."""
    near = [float(np.nextafter(dtype(x), dtype(end))) for end in (-np.inf, np.inf)]
    near = [*near, *(x + 4.0 * (each - x) for each in near)]
    if dtype == np.float64:
        near += [x + sign * step for step in (1e-12, 1e-9) for sign in (1.0, -1.0)]
    return [each for each in near if low <= each <= high]


def jump(
    subject: Subject,
    here: tuple[NDArray[Any], Arguments, Reals],
    there: tuple[NDArray[Any], Arguments, Reals],
    dtype: type,
) -> float:
    """How far two neighbouring values lie apart, relative; if that is too much, less the difference of their twins."""
    difference = there[2].astype(np.float64) - here[2].astype(np.float64)
    sizes = np.maximum(scales(subject, here[2].astype(np.float64)), scales(subject, there[2].astype(np.float64)))
    tolerance = JUMP[dtype]
    if np.all(np.abs(difference) <= tolerance * sizes + TINY[dtype]):
        return 0.0
    form = "vectors" if here[0].ndim == 2 else "angles"
    epsilon = float(np.finfo(dtype).eps) if form == "vectors" else EPSILON
    ends = [(point_of(given), exact_parameters(parameters)) for given, parameters, _ in (here, there)]
    before, after = (expected(subject.name, direction_of(point), parameters) for point, parameters in ends)
    errors = [abs(mp.mpf(float(d)) - (b - a)) - TINY[dtype] for d, a, b in zip(difference, before, after, strict=True)]
    worst = max(map(ratio, errors, sizes))
    if worst > tolerance and not subject.integrated:
        allowed = [roundings(subject, point, epsilon, parameters) for point, parameters in ends]
        errors = [e - ROUNDINGS * (a + b) for e, a, b in zip(errors, *allowed, strict=True)]
        worst = max(map(ratio, errors, sizes))
    return worst


def check_continuity(
    subject: Subject, form: str, directions: list[Directions], near: list[list[Directions]], dtype: type, row: Arguments
) -> None:
    """Of every pair of directions to those near it."""
    for at, beside in zip(directions, near, strict=True):
        given = given_as(form, [at, *beside], dtype)
        values = evaluated(subject, given, row)
        for each, value in zip(given[1:], values[1:], strict=True):
            size = jump(subject, (given[0], row, values[0]), (each, row, value), dtype)
            assert size <= JUMP[dtype], f"jumps by {size:.3g} from {values[0]} to {value} at {at}, {row}"


def beside(at: Directions, dtype: type) -> list[Directions]:
    """Each angle a hair to either side."""
    near = []
    for i, x in enumerate(at):
        low, high = (0.0, HALF_PI) if i % 2 == 0 else (-np.inf, np.inf)
        near += [Directions(*at[:i], each, *at[i + 1 :]) for each in steps(x, dtype, low, high)]
    return near


@pytest.mark.parametrize(("subject", "form", "dtype"), CONTINUOUS)
def test_is_continuous_in_direction(subject: Subject, form: str, dtype: type) -> None:
    for index, row in enumerate(subject.parameters):
        directions = [*EXACT.values()][index % 4 :: 4]
        if subject.name in MATRICES or subject.integrated:  # s and p turn at the pole
            directions = [at for at in directions if min(at.theta_i, at.theta_r) > SUBNORMAL][
                : 2 if subject.integrated else 9
            ]
        check_continuity(subject, form, directions, [beside(at, dtype) for at in directions], dtype, row)


def nudged(name: str, x: float) -> float:
    """A parameter next to x; a refractive index has at most 15 decimals, see `brdfdb.fresnel`."""
    return round(x - 1e-12, 12) if name == "n" else x * (1.0 - 4.0 * EPSILON) if x else 1e-12


@pytest.mark.parametrize("subject", SUBJECTS, ids=lambda subject: subject.name)
@every_dtype
def test_is_continuous_in_its_parameters(subject: Subject, dtype: type) -> None:
    directions = [EXACT[name] for name in ("ordinary", "mirror, turned", "backscatter", "light at 90")]
    given = given_as("angles", directions[: 1 if subject.integrated else None], dtype)
    for row in subject.parameters:
        values = evaluated(subject, given, row)
        for name, x in row.items():
            other = row | {name: nudged(name, x)}
            for each, a, b in zip(given, values, evaluated(subject, given, other), strict=True):
                size = jump(subject, (each, row, a), (each, other, b), dtype)
                assert size <= JUMP[dtype], f"jumps by {size:.3g} from {a} to {b} at {each}, {row}, {other}"


@pytest.mark.parametrize(
    ("name", "at", "moving", "parameters"),
    [pytest.param(*rest, id=f"{rest[0]}-{what}") for what, *rest in BRANCHES],
)
@every_dtype
def test_is_continuous_across_its_branches(
    name: str, at: Directions, moving: tuple[int, ...], parameters: str, dtype: type
) -> None:
    near = [
        Directions(*at[:i], each, *at[i + 1 :])
        for i in moving
        for each in steps(at[i], dtype, 0.0 if i % 2 == 0 else -np.inf, np.inf)
    ]
    for form in ("angles", "vectors"):
        if form == "angles" or (dtype == np.float64 and hasattr(models, f"{name}_vectors")):
            check_continuity(BY_NAME[name], form, [at], [near], dtype, table(parameters)[0])


# He-Torrance: the series of eq. 78, and rows along the azimuth

SERIES = ((1e-12, 0.0), (1e-12, 1e3), (1e-12, 1e6), (40.0, 1e3), (1e4, 1e6), (1e7, 1e6))


@pytest.mark.parametrize(("g", "V"), SERIES)
def test_series_from_tiny_to_huge_g(g: float, V: float) -> None:
    expected_sum = he_torrance_1991.series(g, V)
    value = mp.mpf(g) * mp.mpf(float(diffraction_series(np.float64(g), np.float64(V))))
    assert abs(value - expected_sum) <= AGREEMENT[np.float64] * expected_sum + TINY[np.float64]


# where the summand peaks at m*, V being given; and where u = 2 ln(m* / g) is
PEAKS = [(m * np.exp(-V / m**2), V) for m, V in ((40.0, 0.0), (40.0, 10.0), (40.0, 1e4), (1e6, 0.0), (1e6, 1e6))]
OFF_PEAKS = [(g, 0.5 * g * g * u * np.exp(u)) for g in (10.0, 1e3, 1e5) for u in (0.25, 1e-3)]
OFF_PEAKS += [(g, 0.5e-3 * g * g) for g in (10.0, 1e3)]


@pytest.mark.parametrize(("g", "V"), [*PEAKS, *OFF_PEAKS])
def test_series_is_continuous_where_its_method_changes(g: float, V: float) -> None:
    relative = np.array([0.0, 2e-16, -2e-16, 1e-15, -1e-15, 1e-13, -1e-13])
    for values in (diffraction_series(g * (1.0 + relative), np.float64(V)), diffraction_series(g, V * (1 + relative))):
        assert np.max(np.abs(values - values[0])) <= JUMP[np.float64] * values[0]


@every_dtype
@pytest.mark.parametrize("length", [47, 48, 64], ids="{}-values".format)
def test_rows_along_the_azimuth_agree_with_the_twin(length: int, dtype: type) -> None:
    """From 48 values on a row is interpolated, where that is less work."""
    subject = BY_NAME["he_torrance"]
    for parameters in subject.parameters[2:6]:
        for at in SOME:
            given = np.array(at, dtype=dtype)
            phi_r = np.append(np.linspace(-3.0, 3.0, length - 1), given[3]).astype(dtype)
            value = models.he_torrance(*given[:3], phi_r, **parameters)[-1:]
            error = disagreement(subject, "angles", value, given, dtype, parameters)
            assert error <= AGREEMENT[dtype], f"off by {error:.3g} at {at}, {parameters}"


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
    row, subject = table(parameters)[0], BY_NAME[name]
    directions = [
        Directions(x, 0.0, x - width, PI) for x in (1.57, 1.5707, 1.57079) for width in (3.1e-4, 2.3e-4, 1.7e-4)
    ]
    given = given_as("angles", directions, np.float64)
    for each, value in zip(given, evaluated(subject, given, row), strict=True):
        error = disagreement(subject, "angles", value, each, np.float64, row)
        assert error <= AGREEMENT[np.float64], f"off by {error:.3g} at {each}"
