"""Values of the twins at 40 digits beside each hazard, and the disagreement that roundings allow."""

import functools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb import models
from brdfdb.geometry import unit_vector
from brdfdb.models import MODELS
from brdfdb.reference import mp
from tests.models.hazard_directions import HALF_PI, Directions
from tests.models.hazards import BY_NAME, COS_HORIZON, MATRICES, SUBJECTS, Arguments, Subject

TINY = {np.float64: 1e-270, np.float32: 2.0**-126}  # smaller values carry too few digits, or none
# exp(-tan^2(delta) / alpha^2), the pole at grazing, the kink at the angle of total reflection: of the rounding of the
# arguments each makes more than is promised, in any float64 code. As many roundings of every argument are allowed.
ROUNDINGS = 2.0
EPSILON = 2.0**-52
SUBNORMAL = 1e-300  # [rad] such an angle is 0, but has an azimuth

Reals = NDArray[np.float64]


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
    """Return 40 digits of a value; a refractive index is the decimal that was typed, see `brdfdb.fresnel`."""
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
    """Return the largest change of each value by rounding one argument; next to pi/2 the distance to it is rounded."""
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
    """Return the scale of relative errors: each value, in a matrix the largest element."""
    if subject.name in MATRICES:
        return [max(abs(value) for value in values)] * len(values)
    return [abs(value) for value in values]


def ratio(error: Any, scale: Any) -> float:
    return 0.0 if error <= 0 else float(error / scale) if scale > 0 else np.inf


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


def evaluated(subject: Subject, form: str, given: NDArray[Any], parameters: Arguments) -> NDArray[Any]:
    """Values of shape (N, values) of angles (N, 4), or of vectors (N, 2, 3).

    In the form "rows" each pair of directions begins a row of two azimuths: rows have loops of their own.
    """
    if form == "rows":
        *others, phi_r = np.moveaxis(given, 0, -1)[..., np.newaxis]
        turned = np.concatenate([phi_r, phi_r + 1], axis=-1)
        return flat(getattr(models, subject.name)(*others, turned, **parameters)[:, 0])
    name = f"{subject.name}_vectors" if form == "vectors" else subject.name
    directions = np.moveaxis(given, 0, -1) if given.ndim == 2 else np.moveaxis(given, 0, 1)
    return flat(getattr(models, name)(*directions[: 1 if subject.of_one_direction else None], **parameters))


FORMS = [
    pytest.param(subject, form, id=f"{subject.name}-{form}")
    for subject in SUBJECTS
    for form in ("angles", "rows", "vectors")
    if form == "angles"
    or (form == "rows" and subject.name in MODELS and not subject.integrated)
    or (form == "vectors" and hasattr(models, f"{subject.name}_vectors"))
]
every_dtype = pytest.mark.parametrize("dtype", [np.float64, np.float32], ids=["float64", "float32"])
