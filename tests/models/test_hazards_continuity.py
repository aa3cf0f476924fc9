"""Every hazard of the table: no jump in direction, parameters, or across a branch."""

from typing import Any

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.reference import mp
from tests.models import hazard_twins as twins
from tests.models.hazard_branches import BRANCHES
from tests.models.hazard_directions import EXACT, HALF_PI, Directions
from tests.models.hazards import BY_NAME, JUMP, MATRICES, SUBJECTS, Arguments, Subject, table

# float32 vectors have lengths of 1 to 6e-8 only, and lengths of neighbours differ
CONTINUOUS = [
    pytest.param(*each.values, dtype, id=f"{each.id}-{dtype.__name__}")
    for each in twins.FORMS
    for dtype in (np.float64, np.float32)
    if (each.values[1], dtype) != ("vectors", np.float32)
]

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")


def test_continuity_is_of_the_twins_too() -> None:
    """Between a corner and 1e-32 beside it no twin jumps: what `jump` takes from the twin is a slope."""
    for subject in SUBJECTS:
        if subject.integrated or subject.name in MATRICES:  # s and p turn at the pole
            continue
        parameters = twins.exact_parameters(subject.parameters[-1])
        for directions in EXACT.values():
            at = twins.direction_of(twins.point_of(np.array(directions)))
            value = twins.expected(subject.name, at, parameters)
            for i, x in enumerate(at):
                inward = -1 if i % 2 == 0 and x > 1 else 1
                beside = twins.expected(subject.name, (*at[:i], x + inward * mp.mpf("1e-32"), *at[i + 1 :]), parameters)
                for a, b in zip(value, beside, strict=True):
                    assert abs(a - b) <= JUMP[np.float64] * abs(a) + twins.TINY[np.float64], (
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
    here: tuple[NDArray[Any], Arguments, twins.Reals],
    there: tuple[NDArray[Any], Arguments, twins.Reals],
    dtype: type,
) -> float:
    """Return the relative step between neighbouring values; a large one less the difference of their twins."""
    difference = there[2].astype(np.float64) - here[2].astype(np.float64)
    sizes = np.maximum(
        twins.scales(subject, here[2].astype(np.float64)), twins.scales(subject, there[2].astype(np.float64))
    )
    tolerance = JUMP[dtype]
    if np.all(np.abs(difference) <= tolerance * sizes + twins.TINY[dtype]):
        return 0.0
    form = "vectors" if here[0].ndim == 2 else "angles"
    epsilon = float(np.finfo(dtype).eps) if form == "vectors" else twins.EPSILON
    ends = [(twins.point_of(given), twins.exact_parameters(parameters)) for given, parameters, _ in (here, there)]
    before, after = (twins.expected(subject.name, twins.direction_of(point), parameters) for point, parameters in ends)
    errors = [
        abs(mp.mpf(float(d)) - (b - a)) - twins.TINY[dtype] for d, a, b in zip(difference, before, after, strict=True)
    ]
    worst = max(map(twins.ratio, errors, sizes))
    if worst > tolerance and not subject.integrated:
        allowed = [twins.roundings(subject, point, epsilon, parameters) for point, parameters in ends]
        errors = [e - twins.ROUNDINGS * (a + b) for e, a, b in zip(errors, *allowed, strict=True)]
        worst = max(map(twins.ratio, errors, sizes))
    return worst


def check_continuity(
    subject: Subject, form: str, directions: list[Directions], near: list[list[Directions]], dtype: type, row: Arguments
) -> None:
    """Return the steps from each pair of directions to those near it."""
    for at, beside in zip(directions, near, strict=True):
        given = twins.given_as(form, [at, *beside], dtype)
        values = twins.evaluated(subject, form, given, row)
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
            directions = [at for at in directions if min(at.theta_i, at.theta_r) > twins.SUBNORMAL][
                : 2 if subject.integrated else 9
            ]
        check_continuity(subject, form, directions, [beside(at, dtype) for at in directions], dtype, row)


def nudged(name: str, x: float) -> float:
    """A parameter next to x; a refractive index has at most 15 decimals, see `brdfdb.fresnel`."""
    return round(x - 1e-12, 12) if name == "n" else x * (1.0 - 4.0 * twins.EPSILON) if x else 1e-12


@pytest.mark.parametrize("subject", SUBJECTS, ids=lambda subject: subject.name)
@twins.every_dtype
def test_is_continuous_in_its_parameters(subject: Subject, dtype: type) -> None:
    directions = [EXACT[name] for name in ("ordinary", "mirror, turned", "backscatter", "light at 90")]
    given = twins.given_as("angles", directions[: 1 if subject.integrated else None], dtype)
    for row in subject.parameters:
        values = twins.evaluated(subject, "angles", given, row)
        for name, x in row.items():
            other = row | {name: nudged(name, x)}
            for each, a, b in zip(given, values, twins.evaluated(subject, "angles", given, other), strict=True):
                size = jump(subject, (each, row, a), (each, other, b), dtype)
                assert size <= JUMP[dtype], f"jumps by {size:.3g} from {a} to {b} at {each}, {row}, {other}"


@pytest.mark.parametrize(
    ("name", "at", "moving", "parameters"), [pytest.param(*rest, id=f"{rest[0]}-{what}") for what, *rest in BRANCHES]
)
@twins.every_dtype
def test_is_continuous_across_its_branches(
    name: str, at: Directions, moving: tuple[int, ...], parameters: str, dtype: type
) -> None:
    near = [
        Directions(*at[:i], each, *at[i + 1 :])
        for i in moving
        for each in steps(at[i], dtype, 0.0 if i % 2 == 0 else -np.inf, np.inf)
    ]
    for form in [each.values[1] for each in twins.FORMS if each.values[0].name == name]:
        if form != "vectors" or dtype == np.float64:
            check_continuity(BY_NAME[name], form, [at], [near], dtype, table(parameters)[0])
