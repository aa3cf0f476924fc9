"""Variables of a search: numbers within ranges, in logarithms where a range spans decades, and points to begin at."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.parameters import Floats, ModelSpec, Parameter

Array = NDArray[np.float64]

# The two variables in the place of n and k
NORMAL = "reflectance at normal incidence"
EDGE = "edge"
REFLECTANCES = 1e-4, 0.9999  # at normal incidence, of facets whose n and k are searched

_DECADES = 1e3  # ratio of the ends of a range from which on a variable is searched in logarithms
_LEAST = 1e-7  # share of the upper end at which a logarithmic range begins that has 0 as its lower end
_MOST_N = 100.0  # n that models take, and 1 / n
_NEAR = 0.05  # distance, in the unit cube, below which two points are the same beginning


@dataclass(frozen=True)
class Variable:
    """One number that is searched, and its range. `step` is the length of an edge of the first simplex."""

    name: str
    low: float
    high: float
    logarithmic: bool
    loose: bool = False  # other values may be as good

    def value(self, u: float) -> float:
        """Return the value at u in [0, 1]."""
        if self.logarithmic:
            return min(max(self.low * float((self.high / self.low) ** u), self.low), self.high)
        return self.low + (self.high - self.low) * u

    def slope(self, u: float) -> float:
        """Return the derivative of the value at u in [0, 1]."""
        return self.value(u) * math.log(self.high / self.low) if self.logarithmic else self.high - self.low

    @property
    def step(self) -> float:
        """A tenth of the range, or half an octave of a logarithmic one."""
        return 0.35 / math.log(self.high / self.low) if self.logarithmic else 0.1


def variable(parameter: Parameter) -> Variable:
    """Return the variable of a parameter: logarithmic if its range spans three decades, or begins at 0 and is long."""
    low, high = parameter.low, parameter.high
    logarithmic = high > _DECADES * low if low > 0.0 else high > 100.0
    if logarithmic and low <= 0.0:
        low = high * _LEAST
    return Variable(parameter.name, low, high, logarithmic, loose=logarithmic)


def index_variables() -> list[Variable]:
    """Return the two variables in the place of n and k; `index_of` converts them."""
    return [Variable(NORMAL, *REFLECTANCES, False), Variable(EDGE, 0.0, 1.0, False, loose=True)]


class Index(NamedTuple):
    """The refractive index n + ik of facets, or its derivatives."""

    n: float
    k: float


def index_of(normal: float, edge: float) -> Index:
    """Return n and k [1] of facets with a reflectance at normal incidence, and their place between the two ends of n.

    ln n runs evenly from -ln m at `edge` = 0 to ln m at 1, m = (1 + sqrt(R)) / (1 - sqrt(R)), where k is 0. All n and k
    with the reflectance R = ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2) lie on this line, once. n stays in [0.01, 100].
    """
    root = math.sqrt(normal)
    n = min((1.0 + root) / (1.0 - root), _MOST_N) ** (2.0 * edge - 1.0)
    k2 = (normal * (n + 1.0) ** 2 - (n - 1.0) ** 2) / (1.0 - normal)
    return Index(n, math.sqrt(max(k2, 0.0)))


def index_slopes(normal: float, edge: float) -> dict[str, Index]:
    """Return the derivatives of n and k of `index_of` by NORMAL and EDGE; those of k are 0 where k is."""
    root = math.sqrt(normal)
    most = (1.0 + root) / (1.0 - root)
    n, k = index_of(normal, edge)
    power = 2.0 * edge - 1.0
    by_normal = n * power / (most * root * (1.0 - root) ** 2) if most < _MOST_N else 0.0
    by_edge = 2.0 * n * math.log(min(most, _MOST_N))
    half = 0.5 / k if k > 0.0 else 0.0  # k is a square root
    k2_by_n = (2.0 * normal * (n + 1.0) - 2.0 * (n - 1.0)) / (1.0 - normal)
    k2_by_normal = 4.0 * n / (1.0 - normal) ** 2
    return {
        NORMAL: Index(by_normal, half * (k2_by_n * by_normal + k2_by_normal)),
        EDGE: Index(by_edge, half * k2_by_n * by_edge),
    }


def switches(spec: ModelSpec) -> dict[str, float]:
    """Return the parameters that are true or false, at their defaults: they are not searched."""
    return {p.name: p.default for p in spec.parameters if isinstance(p.default, bool)}


def spread(count: int, variables: int) -> Array:
    """Return points (count, variables) spread evenly over the unit cube: Halton's sequence, the same at every call."""
    from scipy.stats.qmc import Halton

    halton = Halton(variables, scramble=False).fast_forward(1)  # its first point is a corner of the cube
    return np.asarray(halton.random(count))


def best_apart(points: Floats, values: Floats, count: int) -> Floats:
    """Return the points with the least values, of which no two are near each other."""
    chosen: list[Floats] = []
    for index in np.argsort(values, kind="stable"):
        if all(np.max(np.abs(points[index] - other)) > _NEAR for other in chosen):
            chosen.append(points[index])
        if len(chosen) == count:
            break
    return np.array(chosen)
