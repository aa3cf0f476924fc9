"""The surface that a fit searches: a registered model, or a sum of them, each with a scale."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np

from brdfdb.errors import ParameterError
from brdfdb.fitting.variables import EDGE, NORMAL, index_of, index_slopes, index_variables, spread, switches, variable
from brdfdb.geometry import unit_vector
from brdfdb.measurements.aperture import InstrumentView
from brdfdb.models import MODELS
from brdfdb.parameters import Floats, ModelSpec, Parameter, closest
from brdfdb.refractive_indices import refractive_index

Numbers = Mapping[str, Any]

ASSUMED_NM = 550.0  # wavelength of samples that state none, for models with n and k
SCALE = "scale"
_MOST_LOBES = 4  # largest number of terms of a sum
_MOST_SHAPE = 2  # largest number of shape parameters of a lobe in the sums that are fitted by default
_VALUES = 1 << 18  # values that are computed together: they stay in the caches
_LEAST_K = 1e-6  # smaller values of k are taken as 0

_PROBES = 64  # pairs of directions at which a model is tried
_SETS = 4  # sets of parameters at which it is tried
_SAME = 1e-9  # largest difference of values of a polynomial, relative to the largest value
_STEEPEST = 1.2  # largest polar angle [rad] of these directions


def unit_of(parameter: Parameter) -> float:
    """Return the value of a coefficient at which the model is evaluated: 1, or the end of its range."""
    return min(parameter.high, 1.0)


@cache
def linear_parameters(spec: ModelSpec) -> tuple[str, ...]:
    """Return the parameters in which f_r is a polynomial, of degree 1 if the model states none.

    Notes
    -----
    Models say so of their reflectances (`ModelSpec.degree`). The others are tried: at a few directions and parameters,
    f_r half way between two reflectances or amplitudes [1/sr] is the mean of its values there.
    """
    names = [p.name for p in spec.parameters if _is_amplitude(p)]
    if spec.degree is not None:
        return tuple(name for name in names if spec.parameter(name).reflectance)
    linear: list[str] = []
    for name in names:
        linear += [name] if _is_linear(spec, [*linear, name]) else []
    return tuple(linear)


def _is_amplitude(parameter: Parameter) -> bool:
    return parameter.low == 0.0 and (parameter.reflectance or parameter.unit == "1/sr")


def _is_linear(spec: ModelSpec, names: list[str]) -> bool:
    """Return True if f_r is linear in the named parameters together."""
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
    """The M monomials of K coefficients up to a degree.

    `exponents` (M, K) are the powers of the coefficients, `nodes` (M, K) the coefficients, in their units, at which the
    model is evaluated. `inverse` (M, M) turns its values there (..., M, N) into the factors of the monomials. Without
    `constant`, the polynomial is 0 where its coefficients are.
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


class NotDescribedError(ParameterError):
    """Error: a model cannot describe the samples; str() has the reason."""


class Coefficient(NamedTuple):
    """A number in which f_r is a polynomial, with a value for each channel: a reflectance, an amplitude or a scale.

    `term` is its term, `name` its parameter, or "scale"; `label` names it in a sum. `unit` is the value at which the
    term is evaluated.
    """

    term: int
    name: str
    label: str
    low: float
    high: float
    unit: float


class Term:
    """One term of a sum: a model, in which some parameters are linear, others free, and two widths may be the same.

    `linear` are the parameters in which f_r is a polynomial; a term with a scale has none. `free` are the others that
    are searched, without n and k. `label` precedes the names of its parameters in a sum.
    """

    def __init__(self, spec: ModelSpec, label: str, *, alone: bool, beside_flat: bool, turned: bool) -> None:
        self.spec, self.label = spec, label
        self.fixed: dict[str, float] = switches(spec)
        names = linear_parameters(spec)
        if beside_flat and spec.uniform is not None and spec.lobe is not None:
            self.fixed[spec.uniform] = 0.0
            names = tuple(name for name in names if name != spec.uniform)
        bright = not names or self._is_bright(names)
        self.scaled = bright and not alone
        self.linear = () if self.scaled else names
        degree = 1 if self.scaled or spec.degree is None else spec.degree
        count, constant = (1, False) if self.scaled else (len(names), bright)
        self.polynomial = Polynomial(count, degree, constant=constant)
        self.own = self.monomials = slice(0)  # its coefficients and monomials among those of all terms
        self.memory: tuple[InstrumentView, dict[Any, Floats]] | None = None
        self.tied = None if turned else spec.lobe_axes
        out = {*self.fixed, *self.linear, *(self.tied or ())[1:]}
        self.free = [p for p in spec.parameters if p.name not in out]

    def _is_bright(self, names: tuple[str, ...]) -> bool:
        """Return True if the model reflects light where its reflectances are 0, as facets do at grazing angles."""
        middle = {p.name: 0.5 * (p.low + min(p.high, 1.0)) for p in self.spec.parameters}
        index = {"wavelength_nm": ASSUMED_NM, "n": 1.5, "k": 0.0} if self.spec.spectral else {}
        given = middle | self.fixed | dict.fromkeys(names, 0.0) | index
        wi = unit_vector(np.full(3, 1.2), np.zeros(3))
        wr = unit_vector(np.array([0.1, 0.7, 1.2]), np.full(3, np.pi))
        return bool(np.any(self.spec.vectors(wi, wr, **given) > 0.0))

    def coefficients(self, number: int) -> list[Coefficient]:
        """Return the coefficients of this term, whose number is given."""
        if self.scaled:
            return [Coefficient(number, SCALE, f"{self.label}{SCALE}", 0.0, 1.0, 1.0)]
        parameters = [self.spec.parameter(name) for name in self.linear]
        return [Coefficient(number, p.name, f"{self.label}{p.name}", p.low, p.high, unit_of(p)) for p in parameters]

    def basis(self, view: InstrumentView, points: Sequence[Numbers], *, remember: bool) -> Floats:
        """Return the factors (B, M, N) [1/sr] of the monomials of this term at B points.

        Points are evaluated together, equal ones once. Those of the last call with `remember` are known.
        """
        keys = [tuple(one.items()) for one in points]
        known = self.memory[1] if self.memory is not None and self.memory[0] is view else {}
        new = {key: one for key, one in zip(keys, points, strict=True) if key not in known}
        if new:
            known = known | dict(zip(new, self._computed(view, list(new.values())), strict=True))
        if remember:
            self.memory = view, {key: known[key] for key in keys}
        return np.stack([known[key] for key in keys])

    def widths(self, points: Sequence[Numbers]) -> Floats | None:
        """Return the widths (B,) of the lobe of this term, the smaller of two, in slopes; None for a diffuse model."""
        if self.spec.lobe is None:
            return None
        middle = {name: 0.5 * unit_of(self.spec.parameter(name)) for name in self.linear}
        with np.errstate(all="ignore"):
            lobe = self.spec.lobe(np.asarray(1.0), **columns(points), **middle)
        return np.broadcast_to(np.minimum(lobe.alpha_x, lobe.alpha_y).reshape(-1), len(points))

    @cached_property
    def nodes(self) -> list[dict[str, float]]:
        """The coefficients at which the model is evaluated for the factors of its monomials."""
        if self.scaled:
            return [{}]
        units = [unit_of(self.spec.parameter(name)) for name in self.linear]
        return [
            {name: u * unit for name, u, unit in zip(self.linear, node, units, strict=True)}
            for node in self.polynomial.nodes.tolist()
        ]

    def _computed(self, view: InstrumentView, points: Sequence[Numbers]) -> Floats:
        """Return the factors (B, M, N) [1/sr] of the monomials at points that are not known yet."""
        nodes = self.nodes
        rows = [{**one, **node} for one in points for node in nodes]
        widths = self.widths(points) if view.half_angle else None
        of_rows = np.full(len(rows), np.inf) if widths is None else np.repeat(widths, len(nodes))
        spread = np.array([view.points(width) for width in of_rows.tolist()])  # directions of the aperture
        seen = np.empty((len(rows), len(view)))
        for count in np.unique(spread).tolist():
            same = np.flatnonzero(spread == count)
            for some in np.array_split(same, -(-same.size * count * len(view) // _VALUES)):
                seen[some] = self._seen(view, float(of_rows[some[0]]), [rows[row] for row in some.tolist()])
        return np.asarray(self.polynomial.inverse @ seen.reshape(len(points), len(nodes), -1))

    def _seen(self, view: InstrumentView, width: float, points: Sequence[Numbers]) -> Floats:
        """Return f_r (B, N) [1/sr] as an instrument sees it, with the specular part that falls into its aperture."""
        given, shape = columns(points), (len(points), len(view))
        if not view.half_angle:
            return np.asarray(self.spec.vectors(view.w_i, view.w_r, **given)).reshape(shape)
        f_r = view.mean(lambda wi, wr: self.spec.vectors(wi, wr, **given).T, width).T.reshape(shape)
        if self.spec.specular is None:
            return f_r
        return f_r + view.mirror * self.reflected(view, given)

    def slopes(self, view: InstrumentView, given: Mapping[str, float], names: set[str]) -> dict[str, Floats]:
        """Return the derivatives (M, N) [1/sr] of the factors of the monomials by some parameters of the model."""
        gradient = self.spec.gradient
        assert gradient is not None
        arguments = columns([{**given, **node} for node in self.nodes])
        count, ordered = len(self.nodes), sorted(names)
        width = self.widths([given]) if view.half_angle else None

        def derivatives(wi: Floats, wr: Floats) -> Floats:
            by = gradient(wi, wr, **arguments).derivatives
            return np.concatenate([np.broadcast_to(by[name], (count, len(wi))) for name in ordered]).T

        with np.errstate(all="ignore"):  # extreme parameters may raise flags
            seen = view.mean(derivatives, None if width is None else float(width[0])).T
        factors = self.polynomial.inverse @ seen.reshape(len(ordered), count, len(view))
        return dict(zip(ordered, factors, strict=True))

    def reflected(self, view: InstrumentView, given: Mapping[str, Any]) -> Floats:
        """Return the specular reflectance (N,) [1] for each direction of the light; 0 for models without one."""
        if self.spec.specular is None:
            return np.zeros(len(view))
        return np.asarray(
            self.spec.specular(view.theta_i, **{name: given[name] for name in self.spec.specular_parameters})
        )


class SearchedSurface:
    """A model, or a sum of models, whose numbers are searched.

    `shape` has the variables that all channels share, `owners` their terms, None for n and k. `coefficients` have a
    value in each channel.

    Parameters
    ----------
    name : str
        A model, or models joined by " + "; "2 NAME" is two lobes of one.
    wavelength_nm : array (C,) [nm] or None
        Wavelengths of the channels.
    channels : int
        Number of channels, C.
    turned : bool
        True if the light comes from several azimuths, so that samples distinguish two widths.
    entry : str, optional
        Refractive index of models with n and k; without one they are searched.

    Raises
    ------
    ParameterError
        If a model is unknown.
    NotDescribedError
        If it cannot describe such samples.
    """

    def __init__(
        self, name: str, wavelength_nm: Floats | None, channels: int, *, turned: bool, entry: str | None = None
    ) -> None:
        names = _parsed(name)
        alone, beside_flat = len(names) == 1, len(names) > 1 and flat_model() in names
        self.name, self.channels, self.entry = name, channels, entry
        self.terms: list[Term] = []
        for at, model in enumerate(names):
            ordinal = f" {names[: at + 1].count(model)}" if names.count(model) > 1 else ""
            label = "" if alone else f"{model}{ordinal} "
            self.terms.append(Term(MODELS[model], label, alone=alone, beside_flat=beside_flat, turned=turned))
        self.indexed = any(term.spec.spectral for term in self.terms)
        self.searched_index = self.indexed and entry is None
        self._refuse(turned)
        self.shape = [variable(p) for term in self.terms for p in term.free]
        self.owners: list[int | None] = [number for number, term in enumerate(self.terms) for _ in term.free]
        if self.searched_index:
            self.shape += index_variables()
            self.owners += [None, None]
        self.coefficients: list[Coefficient] = []
        self.monomial_count = 0
        for number, term in enumerate(self.terms):
            own, size = term.coefficients(number), len(term.polynomial.exponents)
            term.own = slice(len(self.coefficients), len(self.coefficients) + len(own))
            term.monomials = slice(self.monomial_count, self.monomial_count + size)
            self.coefficients += own
            self.monomial_count += size
        self.units = np.array([one.unit for one in self.coefficients]).reshape(-1, 1)
        self.wavelength_nm = np.full(channels, ASSUMED_NM) if wavelength_nm is None else wavelength_nm
        self.indices = refractive_index(entry, self.wavelength_nm) if self.indexed and entry else None

    def _refuse(self, turned: bool) -> None:
        for term in self.terms:
            name = term.spec.name
            if term.spec.anisotropic is not None and not turned:
                text = f"{name} changes when the surface is turned, and the light comes from one azimuth only"
                raise NotDescribedError("model", text)
            if self.channels > 1 and len(self.terms) == 1 and any(p.reflectance for p in term.free):
                text = f"{name}: f_r is not a polynomial in its reflectances, so spectra of them cannot be fitted; "
                raise NotDescribedError("model", f"{text}choose one channel")
        if self.searched_index and self.channels > 1:
            raise NotDescribedError(
                "model",
                f"{self.name} needs n and k, which can be fitted at one wavelength only, and the samples have "
                f"{self.channels} channels; give a refractive index, or choose one channel",
            )

    @property
    def labels(self) -> list[str]:
        """Return the names of the numbers in `shape`."""
        return [
            one.name if owner is None else f"{self.terms[owner].label}{one.name}"
            for one, owner in zip(self.shape, self.owners, strict=True)
        ]

    def numbers(self, x: Floats) -> list[dict[str, float]]:
        """Return the shared parameters of each term at a point of the unit cube, with n and k if they are searched."""
        numbers: list[dict[str, float]] = [dict(term.fixed) for term in self.terms]
        index: dict[str, float] = {}
        for one, owner, u in zip(self.shape, self.owners, x.tolist(), strict=True):
            (index if owner is None else numbers[owner])[one.name] = one.value(u)
        if index:
            n, k = index_of(index[NORMAL], index[EDGE])
            index = {"n": n, "k": k if k > _LEAST_K else 0.0}
        for term, given in zip(self.terms, numbers, strict=True):
            if term.tied:
                given[term.tied[1]] = given[term.tied[0]]
            if term.spec.spectral:
                given |= index
        return numbers

    def arguments(self, number: int, given: Mapping[str, float], channel: int) -> dict[str, float]:
        """Return the shared arguments of a term in a channel."""
        if not self.terms[number].spec.spectral:
            return dict(given)
        of_channel = {"wavelength_nm": float(self.wavelength_nm[channel])}
        if self.indices is not None:
            n, k = self.indices
            of_channel |= {"n": float(n[channel]), "k": float(k[channel])}
        return {**given, **of_channel}

    def in_channel(self, x: Floats, values: Floats, number: int, channel: int) -> tuple[dict[str, float], float]:
        """Return all arguments of a term in a channel, and its scale."""
        given = self.arguments(number, self.numbers(x)[number], channel)
        own = self.terms[number].own
        names = [one.name for one in self.coefficients[own]]
        given |= dict(zip(names, values[own, channel].tolist(), strict=True))
        return given, given.pop(SCALE, 1.0)

    def basis(self, x: Floats, view: InstrumentView) -> Floats:
        """Return the factors (M, N, C) [1/sr] of all monomials; (M, N, 1) if they are the same in each channel."""
        return np.asarray(self.bases(x[np.newaxis], view)[0])

    def bases(self, points: Floats, view: InstrumentView) -> Floats:
        """Return the factors (B, M, N, C) or (B, M, N, 1) [1/sr] at points (B, S), which models take together.

        The terms of a point that was evaluated alone are remembered until the next: its neighbours share some of them.
        """
        parts = []
        numbers = [self.numbers(x) for x in points]
        several = self.channels if self.indexed else 1
        for number, term in enumerate(self.terms):
            count = several if term.spec.spectral else 1
            wanted = [self.arguments(number, of_point[number], c) for of_point in numbers for c in range(count)]
            with np.errstate(all="ignore"):  # extreme parameters may raise flags
                part = term.basis(view, wanted, remember=len(points) == 1)
            part = part.reshape(len(points), count, *part.shape[1:]).transpose(0, 2, 3, 1)
            parts.append(np.broadcast_to(part, (*part.shape[:3], several)))
        bases = np.concatenate(parts, axis=1)
        return bases if np.all(np.isfinite(bases)) else np.nan_to_num(bases, nan=0.0, posinf=0.0, neginf=0.0)

    def monomials(self, values: Floats) -> Floats:
        """Return the monomials (M, C) of coefficients (K, C)."""
        in_units = values / self.units
        return np.concatenate([term.polynomial.monomials(in_units[term.own]) for term in self.terms])

    def slopes(self, values: Floats) -> Floats:
        """Return the derivatives (K, M, C) of the monomials by each coefficient."""
        in_units = values / self.units
        slopes = np.zeros((len(values), self.monomial_count, values.shape[1]))
        for term in self.terms:
            slopes[term.own, term.monomials] = term.polynomial.slopes(in_units[term.own])
        return np.asarray(slopes / self.units[:, np.newaxis])

    def f_r_slopes(self, basis: Floats, values: Floats) -> Floats:
        """Return the derivatives (K, N, C) [1/sr] of f_r by each coefficient (K, C)."""
        slopes = self.slopes(values)
        if basis.shape[2] == 1:
            return np.asarray(np.einsum("mn,kmc->knc", basis[:, :, 0], slopes))
        return np.asarray(np.einsum("mnc,kmc->knc", basis, slopes))

    def basis_slopes(self, x: Floats, view: InstrumentView) -> dict[int, Floats]:
        """Return the derivatives (M, N, C) or (M, N, 1) [1/sr] of `basis` by shape variables, by their index.

        Only models with a gradient have them. A specular part inside an aperture has none, nor have n and k where k is
        0, the end of its range: it begins there like a square root.
        """
        numbers = self.numbers(x)
        by_variable = {index: moves for index in range(len(self.shape)) if (moves := self._moves(index, x, numbers))}
        by_term: list[list[dict[str, Floats]]] = []  # derivatives of the factors of each term in each channel, by name
        for number, term in enumerate(self.terms):
            names = {name for moves in by_variable.values() for name in moves.get(number, ())}
            known = bool(names) and term.spec.gradient is not None
            if view.half_angle and term.spec.specular is not None:
                known = False
            count = (self.channels if term.spec.spectral else 1) if known else 0
            arguments = [self.arguments(number, numbers[number], channel) for channel in range(count)]
            by_term.append([term.slopes(view, given, names) for given in arguments])
        several = self.channels if self.indexed else 1
        slopes: dict[int, Floats] = {}
        for index, moves in by_variable.items():
            if not all(by_term[number] for number in moves):
                continue
            slopes[index] = np.zeros((self.monomial_count, len(view), several))
            for number, by_name in moves.items():
                of_channels = [sum(move * one[name] for name, move in by_name.items()) for one in by_term[number]]
                slopes[index][self.terms[number].monomials] = np.stack(of_channels, axis=-1)
        return {index: np.nan_to_num(of_index, nan=0.0, posinf=0.0, neginf=0.0) for index, of_index in slopes.items()}

    def _moves(self, index: int, x: Floats, numbers: list[dict[str, float]]) -> dict[int, dict[str, float]]:
        """Return the derivatives of parameters by a shape variable: by the number of their term, then by name."""
        variable, owner = self.shape[index], self.owners[index]
        if owner is not None:
            tied = self.terms[owner].tied
            names = tied if tied and variable.name == tied[0] else (variable.name,)
            return {owner: dict.fromkeys(names, variable.slope(float(x[index])))}
        ends = [one.value(float(u)) for one, u in zip(self.shape[-2:], x[-2:], strict=True)]  # n and k are last
        slopes = index_slopes(*ends)[variable.name]
        moves = {"n": slopes.n * variable.slope(0.5), "k": slopes.k * variable.slope(0.5)}
        spectral = [number for number, term in enumerate(self.terms) if term.spec.spectral]
        return {number: moves for number in spectral if numbers[number]["k"] > 0.0}

    def f_r(self, x: Floats, values: Floats, view: InstrumentView) -> Floats:
        """Return f_r (N, C) [1/sr] as an instrument sees it, with coefficients (K, C)."""
        return total(self.basis(x, view), self.monomials(values))

    def reflected(self, x: Floats, values: Floats, view: InstrumentView) -> Floats:
        """Return the specular reflectance (N, C) [1] for each direction of the light."""
        sums = np.zeros((len(view), self.channels))
        for number, term in enumerate(self.terms):
            for channel in range(self.channels if term.spec.specular is not None else 0):
                given, scale = self.in_channel(x, values, number, channel)
                sums[:, channel] += scale * term.reflected(view, given)
        return sums

    def widths(self, points: Floats) -> Floats:
        """Return the widths (B, L) of the L lobes at points (B, S) of the unit cube, in slopes."""
        numbers = [self.numbers(x) for x in points]
        widths = [
            term.widths([self.arguments(number, of_point[number], 0) for of_point in numbers])
            for number, term in enumerate(self.terms)
        ]
        return np.array([of_term for of_term in widths if of_term is not None]).reshape(-1, len(points)).T


def columns(points: Sequence[Numbers]) -> dict[str, Any]:
    """Return the arguments of points as columns (B, 1), or as one number where all have the same."""
    columns: dict[str, Any] = {}
    for name, first in points[0].items():
        values = [point[name] for point in points]
        columns[name] = first if values.count(first) == len(values) else np.array(values)[:, np.newaxis]
    return columns


def total(basis: Floats, monomials: Floats) -> Floats:
    """Return the sum (N, C) over monomials (M, C) times their factors (M, N, C) or (M, N, 1)."""
    if basis.shape[2] == 1:
        return np.asarray(np.einsum("mn,mc->nc", basis[:, :, 0], monomials))
    return np.asarray(np.einsum("mnc,mc->nc", basis, monomials))


def flat_model() -> str:
    """Return the model of a uniform f_r: a reflectance, of degree 1, and nothing else."""
    return next(
        name
        for name, spec in MODELS.items()
        if spec.lobe is None and len(spec.parameters) == 1 and spec.degree == 1 and not spec.grazing_pole
    )


def _parsed(name: str) -> list[str]:
    """Return the models of a sum."""
    names: list[str] = []
    for part in name.split("+"):
        match = re.fullmatch(r"\s*(?:(\d+)\s+)?([\w-]+)\s*", part)
        if match is None:
            text = f"{name!r} is neither a model nor a sum of models such as 'A + 2 B'"
            raise ParameterError("model", text, name, tuple(MODELS))
        model = match[2]
        if model not in MODELS:
            hint = closest(model, MODELS) or f"; the models are {', '.join(MODELS)}"
            raise ParameterError("model", f"{model!r} is unknown{hint}", model, tuple(MODELS))
        names += [model] * int(match[1] or 1)
    if not 1 <= len(names) <= _MOST_LOBES:
        raise ParameterError("model", f"{name!r} has {len(names)} terms; 1 to {_MOST_LOBES} are allowed", name)
    return names


def _is_simple(name: str) -> bool:
    """Return True if a term of a sum with this model has a shape of few numbers."""
    spec = MODELS[name]
    out = {*switches(spec), spec.uniform, *(spec.lobe_axes or ())[1:]}
    if sum(p.name not in out for p in spec.parameters) <= _MOST_SHAPE:
        return True  # whatever f_r is a polynomial in: a term finds that by evaluating the model, which compiles it
    term = Term(spec, "", alone=False, beside_flat=True, turned=False)
    return len(term.free) <= _MOST_SHAPE


def fitted_by_default(*, sums: bool = True) -> list[str]:
    """Return the surfaces that are fitted unless others are named: every model, and sums with a uniform f_r.

    Models whose values are integrals are left out. Sums have one or two lobes of a model without a uniform part.
    """
    alone = [name for name, spec in MODELS.items() if not spec.slow]
    if not sums:
        return alone
    flat = flat_model()
    lobes = [name for name in alone if MODELS[name].lobe is not None and _is_simple(name)]
    one = [f"{flat} + {name}" for name in lobes if MODELS[name].uniform is None]
    return [*alone, *one, *(f"{flat} + 2 {name}" for name in lobes)]
