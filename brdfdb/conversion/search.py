"""The search for the parameters of a model that come closest to a source."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.conversion.nodes import TruthNodes
from brdfdb.errors import ParameterError
from brdfdb.fitting.variables import EDGE, NORMAL, best_apart, index_of, index_variables, spread, switches, variable
from brdfdb.integrals.pairs import WIDTHS, Symmetry
from brdfdb.materials import Source
from brdfdb.parameters import Floats, ModelSpec, closest
from brdfdb.refractive_indices import refractive_index

Array = NDArray[np.float64]

SPREAD = 4096  # points of the unit cube, of which those with a lobe about as wide are tried
TRIED = 160  # points that are tried at coarse nodes
FEW_TRIED = 40  # the same for a model whose values are integrals, or whose colours are searched at each point
BEGINNINGS = 3  # points at which simplexes begin
STEPS = 1 + 2 * BEGINNINGS  # largest number of calls of `tick` in a search
REFUSED = 1e9  # distance of parameters that are not tried
_COARSE = 1e-4  # tolerance of simplexes at coarse nodes
_FINE = 1e-7  # tolerance of simplexes at all nodes
_COLOURS = 1e-6  # tolerance of the simplexes of colours, below that of the shared parameters
_FIRST_EDGE = 0.1  # edge of the first simplex of colours
_NEXT_EDGE = 0.02  # edge of the next ones, which begin where the last one ended
_PROMISING = 1.03  # largest distance of a promising descent, over the least: coarse nodes themselves change less
_AS_GOOD = 1.01  # largest distance of parameters that are as good, over the least
_NARROWEST = 0.25  # width of the narrowest lobe that is tried, over that of the source: nodes would miss others
_SAME_HIGHLIGHT = 0.5, 2.0  # the range of widths where lightness is weighed, to keep a highlight
# Share by which the distance rises, at most four times less, from the middle of ranges to their ends. It decides where
# nothing else does, as between surfaces of He and Torrance with the same slopes
_LOOSE = 1e-3
_EXTENT = 100.0  # size of the last simplex, relative to the tolerance of its values
_NOTHING = 0.01  # value below which differences are relative to this value: hardly anything can be gained
_LEAST_K = 1e-6  # smaller values of k are taken as 0


class Minimum(NamedTuple):
    """A point of the unit cube where a function is least, and its value there."""

    point: Array
    value: float


def downhill(
    function: Callable[[Array], float], begin: Array, size: Array, *, tolerance: float = 1e-7, most: int = 400
) -> Minimum:
    """Return a minimum of a function in the unit cube, by the simplex of Nelder and Mead 1965 (``neldermead1965``).

    The simplex begins at `begin`, with edges of the lengths `size`. The search stops after `most` evaluations, or when
    values at the corners differ by less than `tolerance`, relative to the first value or to a hundredth if that is
    more, and the corners by less than a hundred times as much: corners on both sides of a minimum may share a value.
    Corners outside the cube are moved to its surface. No gradient is needed: the integral of an absolute difference has
    none where the difference is 0 over a region.
    """
    from scipy.optimize import minimize

    close = tolerance * max(abs(function(begin)), _NOTHING)
    limits = {"fatol": close, "xatol": _EXTENT * tolerance, "maxfev": most}
    best = begin
    value = np.inf
    for _ in range(2):  # again, because a simplex collapses on the surface of the cube
        towards = np.where(best <= 0.5, size, -size)  # the side with more room
        corners = np.clip(np.vstack([best, best + np.diag(towards)]), 0.0, 1.0)
        options = {"initial_simplex": corners, **limits}
        end = minimize(function, best, method="Nelder-Mead", bounds=[(0.0, 1.0)] * begin.size, options=options)
        if end.fun < value:
            best = np.asarray(end.x)
            value = float(end.fun)
    return Minimum(best, value)


class Target:
    """A model whose parameters are searched, for a source at L wavelengths, or 1 without any.

    `shape` are the variables that all wavelengths share, `colours` the reflectances with a value at each of several
    wavelengths. `symmetry` is common to source and model. `entry` is the refractive index of a spectral model, None
    where n and k are searched.
    """

    def __init__(
        self,
        spec: ModelSpec,
        source: Source,
        wavelength_nm: Array | None,
        fixed: Mapping[str, float],
        entry: str | None,
    ) -> None:
        self.spec = spec
        self.wavelength_nm = wavelength_nm
        self.entry = entry
        self.count = 1 if wavelength_nm is None else wavelength_nm.size
        self.fixed = {**switches(spec), **_checked(spec, fixed)}
        self.tied = None
        if spec.lobe_axes and not source.anisotropic:  # an isotropic source has an isotropic likeness
            given = [self.fixed[name] for name in spec.lobe_axes if name in self.fixed]
            if len(given) == 1:
                self.fixed |= dict.fromkeys(spec.lobe_axes, given[0])
            elif not given:
                self.tied = spec.lobe_axes
        self.symmetry = Symmetry(True, source.elliptical)
        if spec.anisotropic is not None:
            self.symmetry = Symmetry(True, False)
        elif not source.anisotropic:
            self.symmetry = Symmetry(len({self.fixed.get(name) for name in spec.lobe_axes or ()}) > 1, True)
        free = [p for p in spec.parameters if p.name not in self.fixed and not (self.tied and p.name == self.tied[1])]
        several = self.count > 1
        self.shape = [variable(p) for p in free if not (several and p.reflectance)]
        self.colours = [variable(p) for p in free if several and p.reflectance]
        self.searched_index = spec.spectral and entry is None
        if self.searched_index:
            self.shape += index_variables()
        self.indices: list[dict[str, float]] = [{}] * self.count
        if spec.spectral:
            assert wavelength_nm is not None
            self.indices = [{"wavelength_nm": float(wavelength)} for wavelength in wavelength_nm]
            if entry is not None:
                n, k = refractive_index(entry, wavelength_nm)
                self.indices = [index | {"n": float(n[w]), "k": float(k[w])} for w, index in enumerate(self.indices)]
        if not self.shape and not self.colours:
            raise ParameterError(
                "fixed",
                f"all parameters of {spec.name} are fixed; leave at least one parameter to search",
                tuple(fixed),
            )

    def numbers(self, shape: Array) -> dict[str, float]:
        """Return the shared parameters at a point of the unit cube, with n and k where they are searched."""
        values = {variable.name: variable.value(u) for variable, u in zip(self.shape, shape.tolist(), strict=True)}
        if self.tied:
            values[self.tied[1]] = values[self.tied[0]]
        if self.searched_index:
            n, k = index_of(values.pop(NORMAL), values.pop(EDGE))
            k = k if k > _LEAST_K else 0.0
            values |= {"n": n, "k": k}
        return values

    def arguments(self, numbers: Mapping[str, float], column: int, colours: Mapping[str, float]) -> dict[str, Any]:
        """Return the arguments of the model at one wavelength."""
        return {**self.fixed, **self.indices[column], **numbers, **colours}

    def specular(self, arguments: Mapping[str, Any], theta: Array) -> Floats | None:
        """Return the reflectance (V,) of the specular part; None without one."""
        if self.spec.specular is None:
            return None
        return self.spec.specular(theta, **{name: arguments[name] for name in self.spec.specular_parameters})

    def coloured(self, numbers: Mapping[str, float], column: int, wi: Floats, wr: Floats) -> Callable[[Array], Floats]:
        """Return f_r (N,) as a function of a point of the unit cube of colours, quick where f_r is linear in them."""
        names = [variable.name for variable in self.colours]

        def called(colours: Array) -> Floats:
            values = {v.name: v.value(u) for v, u in zip(self.colours, colours.tolist(), strict=True)}
            return self.spec.vectors(wi, wr, **self.arguments(numbers, column, values))

        if self.spec.degree != 1:
            return called
        none = called(np.zeros(len(names)))
        each_one = [called(unit) - none for unit in np.eye(len(names))]

        def summed(colours: Array) -> Floats:
            values = none.copy()
            for u, values_of_one in zip(colours, each_one, strict=True):
                values += u * values_of_one
            return values

        return summed

    def lobe_alphas(self, numbers: Mapping[str, float]) -> Array:
        """Return the widths (2,) of the lobe at normal incidence, at the first wavelength; nan for a diffuse model."""
        if self.spec.lobe is None:
            return np.full(2, np.nan)
        colours = {variable.name: 0.5 for variable in self.colours}
        lobe = self.spec.lobe(np.asarray(1.0), **self.arguments(numbers, 0, colours))
        return np.array([np.min(lobe.alpha_x), np.min(lobe.alpha_y)])


def _checked(spec: ModelSpec, fixed: Mapping[str, float]) -> dict[str, float]:
    """Return fixed parameters of a model; ParameterError if one is unknown, out of range or of another type."""
    names = [parameter.name for parameter in spec.parameters]
    for name, value in fixed.items():
        if name not in names:
            raise ParameterError(
                name, f"the parameters of {spec.name} are {', '.join(names)}{closest(name, names)}", name, tuple(names)
            )
        spec.parameter(name).check(value)
        is_switch = isinstance(spec.parameter(name).default, bool)
        if is_switch != isinstance(value, bool):
            raise ParameterError(name, f"{value!r} is not {'true or false' if is_switch else 'a number'}", value)
    return dict(fixed)


class Result(NamedTuple):
    """The parameters that came closest."""

    numbers: dict[str, float]  # parameters that all wavelengths share, with n and k where they were searched
    distance: float  # distance [1] at the nodes of the search
    as_good: dict[str, tuple[float, float]]  # range of each number among the sets with nearly this distance
    evaluations: int  # sets of parameters that were tried


class Distance:
    """The mean distance over the columns of a truth, as a function of a point of the unit cube of shared parameters.

    The colours of each column are searched inside, from where the last search ended.
    """

    def __init__(self, target: Target, nodes: TruthNodes, columns: NDArray[np.int64], alphas: Array) -> None:
        self.target = target
        self.nodes = nodes
        self.columns = columns
        free = not set(target.spec.lobe_axes or ()) & set(target.fixed)
        low, high = _SAME_HIGHLIGHT if nodes.weigh == "lightness" and free else (_NARROWEST, np.inf)
        self.narrowest = low * np.where(np.isnan(alphas), WIDTHS[1], alphas)
        self.widest = high * np.where(np.isnan(alphas), np.inf, alphas)
        self.loose = np.array([variable.loose for variable in target.shape], dtype=bool)
        self.colours = np.full((columns.size, len(target.colours)), 0.5)
        self.edge = _FIRST_EDGE
        self.record: list[tuple[float, dict[str, float]]] = []

    def __call__(self, shape: Array) -> float:
        """Return the distance [1], with a trifle for loose variables; `REFUSED` where nodes do not resolve the lobe."""
        numbers = self.target.numbers(shape)
        widths = self.target.lobe_alphas(numbers)
        if np.any((widths < self.narrowest) | (widths > self.widest)):
            return REFUSED
        total = 0.0
        for row, column in enumerate(self.columns.tolist()):
            self.colours[row], least = self.of_column(numbers, row, column)
            total += least
        self.edge = _NEXT_EDGE
        mean = total / self.columns.size
        mean = min(mean, REFUSED) if math.isfinite(mean) else REFUSED
        mean *= 1.0 + _LOOSE * float(np.mean((shape[self.loose] - 0.5) ** 2)) if self.loose.any() else 1.0
        self.record.append((mean, numbers))
        return mean

    def of_column(self, numbers: Mapping[str, float], row: int, column: int) -> Minimum:
        """Return the colours that make the distance [1] in a column of the truth least, and that distance.

        `row` is the column of the truth at the nodes, `column` the wavelength of the target.
        """
        nodes = self.nodes
        target = self.target
        f_r = target.coloured(numbers, column, nodes.wi, nodes.wr)

        def distance(colours: Array) -> float:
            values = {v.name: v.value(u) for v, u in zip(target.colours, colours.tolist(), strict=True)}
            mirror = target.specular(target.arguments(numbers, column, values), nodes.theta)
            with np.errstate(all="ignore"):  # extreme parameters may raise flags; the sum is tested
                return nodes.distance(row, f_r(colours), mirror)

        if not target.colours:
            return Minimum(np.zeros(0), distance(np.zeros(0)))
        size = np.full(len(target.colours), self.edge)
        return downhill(distance, self.colours[row], size, tolerance=_COLOURS, most=60 * size.size)


def search(
    target: Target,
    coarse: TruthNodes,
    fitted: TruthNodes,
    columns: NDArray[np.int64],
    alphas: Array,
    tick: Callable[[], None],
) -> Result:
    """Search the shared parameters of a target for the lobe of a source with the widths `alphas` (2,).

    Points are spread evenly over the ranges of the parameters. The first of them, and those whose lobe is most nearly
    as wide as that of the source, are tried at coarse nodes. Simplexes begin at the best three that are not near each
    other, and go downhill at coarse nodes. Ends within 3 % of the best go on at all nodes. `alphas` are nan
    without a lobe. `columns` are the wavelengths of the target in the columns of the nodes. `tick` is called at most
    `STEPS` times.
    """
    distances = Distance(target, coarse, columns, alphas), Distance(target, fitted, columns, alphas)
    steps = np.array([variable.step for variable in target.shape])
    if not target.shape:
        distances[1](np.zeros(0))
        return _result(distances)
    points = _beginnings(target, alphas)
    values = np.array([distances[0](point) for point in points])
    tick()
    starts = []
    for point in best_apart(points, values, BEGINNINGS):
        starts.append(downhill(distances[0], point, steps, tolerance=_COARSE, most=80 * steps.size))
        tick()
    ends = np.array([minimum.point for minimum in starts])
    values = np.array([minimum.value for minimum in starts])
    good = values <= _PROMISING * values.min()
    for point in best_apart(ends[good], values[good], BEGINNINGS):
        downhill(distances[1], point, 0.2 * steps, tolerance=_FINE, most=100 * steps.size)
        tick()
    return _result(distances)


def _result(distances: tuple[Distance, Distance]) -> Result:
    record = distances[1].record
    if not record:
        return Result({}, REFUSED, {}, 0)
    best, numbers = min(record, key=lambda entry: entry[0])
    near = [entry[1] for entry in record if entry[0] <= _AS_GOOD * best]
    ranges = {name: (min(one[name] for one in near), max(one[name] for one in near)) for name in numbers}
    return Result(numbers, best, ranges, sum(len(distance.record) for distance in distances))


def _beginnings(target: Target, alphas: Array) -> Array:
    """Return points of the unit cube to try, spread over it: half of them any, half those whose lobe is as wide."""
    points = spread(SPREAD, len(target.shape))
    tried = FEW_TRIED if target.spec.slow or target.colours else TRIED
    if target.spec.lobe is None or np.isnan(alphas).any():
        return points[:tried]
    with np.errstate(all="ignore"):  # a lobe of extreme parameters may be no number
        widths = np.array([target.lobe_alphas(target.numbers(point)) for point in points])
        off = np.abs(np.log(widths / alphas)).sum(axis=1)
    nearest = np.argsort(np.where(np.isfinite(off), off, np.inf), kind="stable")
    # A highlight may best be left out, by a lobe of another width
    wide = np.flatnonzero(np.all(widths >= _NARROWEST * alphas, axis=1))
    chosen = np.unique(np.concatenate([nearest[: tried // 2], wide[: tried // 2]]))
    return np.asarray(points[chosen])
