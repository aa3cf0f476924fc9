"""f_r as a polynomial in reflectances: a model that is evaluated a few times serves any values of them."""

from __future__ import annotations

import itertools
from functools import cache

import numpy as np
from numpy.typing import NDArray

from brdfdb.fitting.variables import spread, switches
from brdfdb.geometry import unit_vector
from brdfdb.parameters import Floats, ModelSpec, Parameter

Array = NDArray[np.float64]

_PROBES, _SETS = 64, 4  # pairs of directions and sets of parameters at which a model is tried
_SAME = 1e-9  # difference of values of a polynomial, relative to the largest
_STEEPEST = 1.2  # rad, of directions that are tried


def unit_of(parameter: Parameter) -> float:
    """Return the value of a coefficient at which the model is evaluated: 1, or the end of its range."""
    return min(parameter.high, 1.0)


@cache
def coefficients(spec: ModelSpec) -> tuple[tuple[str, ...], int]:
    """Return the parameters in which f_r is a polynomial, and its degree.

    Notes
    -----
    Models say so of their reflectances (`ModelSpec.degree`). The others are tried: at a few directions and parameters,
    f_r half way between two reflectances or amplitudes [1/sr] is the mean of its values there.
    """
    names = [p.name for p in spec.parameters if _is_amplitude(p)]
    if spec.degree is not None:
        return tuple(name for name in names if spec.parameter(name).reflectance), spec.degree
    linear: list[str] = []
    for name in names:
        if _is_linear(spec, [*linear, name]):
            linear.append(name)
    return tuple(linear), 1


def _is_amplitude(parameter: Parameter) -> bool:
    return parameter.low == 0.0 and (parameter.reflectance or parameter.unit == "1/sr")


def _is_linear(spec: ModelSpec, names: list[str]) -> bool:
    """Return True if f_r is linear in some parameters together."""
    u = spread(_PROBES, 3)
    wi = unit_vector(_STEEPEST * u[:, 0], np.zeros(_PROBES))
    wr = unit_vector(_STEEPEST * u[:, 1], 2.0 * np.pi * u[:, 2])
    index = {"wavelength_nm": 550.0, "n": 1.5, "k": 0.0} if spec.spectral else {}
    low = np.array([p.low for p in spec.parameters])
    high = np.array([unit_of(p) if _is_amplitude(p) else min(p.high, 2.0) for p in spec.parameters])
    for row in low + (high - low) * spread(_SETS, low.size):
        numbers = dict(zip((p.name for p in spec.parameters), row.tolist(), strict=True)) | switches(spec)
        first = {name: 0.2 * unit_of(spec.parameter(name)) for name in names}
        second = {name: numbers[name] for name in names}
        middle = {name: 0.5 * (first[name] + second[name]) for name in names}
        with np.errstate(all="ignore"):
            a, b, m = (spec.vectors(wi, wr, **index, **(numbers | given)) for given in (first, second, middle))
        if not np.max(np.abs(m - 0.5 * (a + b))) <= _SAME * max(float(np.max(np.abs(b))), 1e-30):
            return False
    return True


class Polynomial:
    """The monomials of K coefficients up to a degree, as arrays over M monomials.

    Attributes
    ----------
    exponents : array (M, K) of int
        Powers of the coefficients.
    nodes : array (M, K)
        Values of the coefficients, in their units, at which the model is evaluated.

    Without `constant`, the polynomial is 0 where its coefficients are.
    """

    def __init__(self, count: int, degree: int, *, constant: bool) -> None:
        powers = itertools.product(range(degree + 1), repeat=count)
        rows = [row for row in powers if (0 if constant or not count else 1) <= sum(row) <= degree]
        self.exponents = np.array(rows, dtype=np.int64).reshape(len(rows), count)
        self.nodes = self.exponents / max(degree, 1)
        self.inverse = np.linalg.inv(self.monomials(self.nodes.T).T)
        self.lowered = np.maximum(self.exponents[np.newaxis] - np.eye(count, dtype=np.int64)[:, np.newaxis], 0)

    def monomials(self, values: Floats) -> Floats:
        """Return the monomials (M, ...) of coefficients (K, ...)."""
        powers = self.exponents.reshape(*self.exponents.shape, *(1,) * (values.ndim - 1))
        return np.asarray(np.prod(values[np.newaxis] ** powers, axis=1))

    def slopes(self, values: Floats) -> Floats:
        """Return the derivatives (K, M, ...) of the monomials by each coefficient."""
        further = (1,) * (values.ndim - 1)
        factors = self.exponents.T.reshape(*self.exponents.T.shape, *further)
        powers = self.lowered.reshape(*self.lowered.shape, *further)
        return np.asarray(factors * np.prod(values[np.newaxis, np.newaxis] ** powers, axis=2))

    def parts(self, values: Floats) -> Floats:
        """Return the factors (..., M, N) of the monomials from the values (..., M, N) of a model at the nodes."""
        return np.asarray(self.inverse @ values)
