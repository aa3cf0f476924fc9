"""The parameters of another model that come closest to a source."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.conversion.document import Conversion, Peak, WorstView
from brdfdb.conversion.nodes import (
    COARSE,
    FINER,
    FITTED,
    WEIGHS,
    RemainingDifference,
    Sides,
    TruthNodes,
    ViewError,
    Weigh,
    lobe_of,
    sides_of,
    specular_of,
)
from brdfdb.conversion.search import REFUSED, Distance, Result, Target, search
from brdfdb.conversion.search import STEPS as _SEARCH_STEPS
from brdfdb.errors import ParameterError, percent
from brdfdb.geometry import degrees, radians, unit_vector
from brdfdb.integrals.pairs import Counts, Symmetry, view_of
from brdfdb.lobes import Lobe
from brdfdb.materials import Material, Source, written_name
from brdfdb.materials.provenance import MOST_NAME
from brdfdb.materials.recipe_text import rounded, toml_of
from brdfdb.measurements import MeasuredSource
from brdfdb.models import MODELS
from brdfdb.parameters import ModelSpec, check_nanometres, closest
from brdfdb.tables import error_measurement
from brdfdb.tables.table import TableSource

Array = NDArray[np.float64]

FIT = "fit"  # the refractive index that asks for a search of n and k
SEARCHED = 5  # wavelengths at most at which shared parameters are searched
ASSUMED_NM = 550.0  # wavelength of the n and k that are searched for a grey source
STEPS = _SEARCH_STEPS  # calls of `tick` in a conversion
DIRECTIONS = 1000  # directions of p99 per band of theta_i, as in charts
SEED = 1992  # seed of these directions
VIEWS_DEG = np.arange(0.0, 90.0, 5.0)  # theta_r of the viewers among whom the worst one is searched
STEP_DEG = 15.0  # step of phi_r of these viewers, for an anisotropic source
PEAK_DEG = 45.0  # theta_i of the mirror direction whose f_r is stated

# Thresholds of remarks
_NOT_NEAR = 0.9  # l1 above which the model is hardly nearer than black, whose l1 is 1
_END = 1e-3  # distance from the end of a range, relative to that end, that counts as the end; 0 is no end
_SEEN = 0.01  # share of the light above which a specular part is mentioned
_LOST = 0.5  # share of its peak below which a highlight is lost
_UNSURE = 0.01  # error of l1, relative to l1, above which it is mentioned


def convert(
    source: Source,
    model: str,
    wavelength_nm: ArrayLike | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    refractive_index: str | None = None,
    weigh: Weigh | None = None,
    tick: Callable[[], None] = lambda: None,
) -> Conversion:
    """Search the parameters of a model that come closest to a source, and measure the remaining error.

    Parameters
    ----------
    source : Source
        A material of any other model, or a function.
    model : str
        Name of a model in `brdfdb.models.MODELS`.
    wavelength_nm : array_like [nm], optional
        Wavelengths of a spectral source, by default those for which it is stated. For a grey source and a model with n
        and k, the wavelength of these, by default 550 nm.
    fixed : mapping of str to float, optional
        Parameters that are not searched, in the units of the model (angles in radians).
    refractive_index : str, optional
        For a model with n and k, the entry ``shelf/book/page`` that has them, or "fit". By default it is the entry of
        the source. Without one, n and k are searched.
    weigh : {"light", "lightness"}
        What the search makes least: l1; or the root mean square difference of cube roots of f_r, with the same cosines,
        of lobes half to twice as wide. By default it is l1, unless that loses the highlight and cube roots keep it.
    tick : callable
        A function that is called `STEPS` times at most, to show progress.

    Returns
    -------
    Conversion
        Parameters, l1, p99, the worst view, and the result as a material and as a part of a recipe.

    Raises
    ------
    ParameterError
        If the model is that of the source or unknown, if n and k would be searched at several wavelengths, if a fixed
        parameter is not allowed, or if the source reflects nothing.

    Notes
    -----
    The distance between f, the source, and g, the model, is

        l1 = integral of abs(g - f) cos theta_i cos theta_r / integral of f cos theta_i cos theta_r

    over all lights and viewers above the horizon: the light in the wrong place under light from everywhere, counted
    where it is missing and where it is too much. It is 0 for the same surface, 1 for black, 2 for one that reflects as
    much to other places alone, and more for one that reflects more. Specular parts (Dirac deltas) count with their
    reflectance, abs(S_g - S_f). Of several wavelengths it is the mean. The mean square would follow the largest values,
    next to grazing, and a specular part has none. l1 has a price: a highlight with few hundredths of the light may go.

    All numbers of the model are searched within their ranges, as in `brdfdb.conversion.search`. A reflectance has
    a value at each wavelength; the others are shared, and searched at five wavelengths. Switches keep their defaults.
    An isotropic source gives one alpha. n and k are searched as the reflectance at normal incidence and a place between
    the two n of k = 0, which matters little: `Conversion.as_good` shows that. Integrals are sums at nodes that follow
    the lobe of the source (`brdfdb.integrals.pairs`). The stated l1 is measured at more than five times as many nodes;
    `Conversion.quadrature` is the difference. `brdfdb.roughness` has the conversions that are exact.

    References
    ----------
    neldermead1965

    Examples
    --------
    >>> from brdfdb.materials import presets
    >>> clay = convert(presets()["clay-vase"], "oren_nayar_fujii")
    >>> round(clay.parameters["rho"], 2), round(clay.l1, 3)
    (0.63, 0.013)
    """
    request = _request(source, model, wavelength_nm, fixed or {}, refractive_index, weigh or "light")
    least = _measured(request, _searched(request, tick))
    if weigh is not None or MODELS[model].lobe is None or not _is_lost(source, least):
        return least
    request = request._replace(weigh="lightness")
    other = _measured(request, _searched(request, tick))
    if _is_lost(source, other):
        return least
    sentence = (
        f"Cube roots of f_r were compared, because the least l1, {percent(least.l1)}, is without the highlight: f_r in "
        f"the mirror direction at {least.peak.theta_deg:g} degrees is {least.peak.after:.3g} /sr there."
    )
    return other.model_copy(update={"remarks": [sentence, *other.remarks]})


class MaterialDifference(NamedTuple):
    """The distance of two materials, l1 and p99 as in `Conversion`."""

    l1: float
    p99: float


def compare(source: Source, other: Material, wavelength_nm: ArrayLike | None = None) -> MaterialDifference:
    """Return the error of a material in the place of a source, such as one with a copied alpha.

    Parameters
    ----------
    source : Source
        The truth.
    other : Material
        A material that is compared with it.
    wavelength_nm : array_like [nm], optional
        Wavelengths, as of `convert`.

    Returns
    -------
    MaterialDifference
        l1 [1] and p99 [1].

    Raises
    ------
    ParameterError
        If one of them does not hold at the wavelengths.

    Examples
    --------
    >>> from brdfdb.materials import presets
    >>> tile, paper = presets()["white-ceramic-tile"], presets()["glossy-grey-paper"]
    >>> round(compare(tile, paper).l1, 2)
    0.55
    """
    at = _wavelengths(source, other, wavelength_nm)
    sides = sides_of(source, other, at)
    symmetry = Symmetry(
        source.anisotropic or other.anisotropic,
        (source.elliptical or not source.anisotropic) and (other.elliptical or not other.anisotropic),
    )
    remaining = RemainingDifference(sides, FITTED.finer(FINER), symmetry)
    return MaterialDifference(float(np.mean(remaining.l1)), _p99_of(source, at if source.spectral else None, sides))


class _Request(NamedTuple):
    """A checked request: the source, its wavelengths, and those of the target."""

    source: Source
    before: Array | None  # wavelengths of the source, None for a grey one
    at: Array | None  # wavelengths of the comparison, None where both are grey
    target: Target
    symmetry: Symmetry
    counts: Counts  # of the search
    weigh: Weigh

    @property
    def columns(self) -> NDArray[np.int64]:
        """Return the wavelengths at which shared parameters are searched."""
        several = min(SEARCHED, self.target.count)
        return np.unique(np.linspace(0, self.target.count - 1, several).round().astype(np.int64))


class _Fit(NamedTuple):
    """The result of a search: colours (L, C) of all wavelengths in the unit cube, and the truth at nodes."""

    result: Result
    colours: Array
    nodes: TruthNodes


def _request(
    source: Source,
    model: str,
    wavelength_nm: ArrayLike | None,
    fixed: Mapping[str, float],
    entry: str | None,
    weigh: Weigh,
) -> _Request:
    if weigh not in WEIGHS:
        raise ParameterError("weigh", f"{weigh!r} is not one of {', '.join(WEIGHS)}", weigh, WEIGHS)
    if model not in MODELS:
        raise ParameterError("model", f"{model!r} is unknown{closest(model, MODELS)}", model, tuple(MODELS))
    spec = MODELS[model]
    if isinstance(source, Material) and source.model == model:
        raise ParameterError("model", f"{source.name} is of the model {model} itself; choose another model", model)
    at = _wavelengths(source, spec, wavelength_nm)
    if entry is not None and not spec.spectral:
        raise ParameterError("refractive_index", f"the model {model} has no refractive index", entry)
    if entry is None and spec.spectral and isinstance(source, Material):
        entry = source.refractive_index
    entry = None if entry == FIT else entry
    if spec.spectral and entry is None and at is not None and at.size > 1:
        raise ParameterError(
            "refractive_index",
            f"missing; n and k of {model} are searched only at a single wavelength, and {at.size} are given",
            entry,
        )
    target = Target(spec, source, at, fixed, entry)
    counts = COARSE if spec.slow else FITTED
    return _Request(source, at if source.spectral else None, at, target, target.symmetry, counts, weigh)


def _wavelengths(source: Source, other: ModelSpec | Material, wavelength_nm: ArrayLike | None) -> Array | None:
    """Return the wavelengths of the comparison; None where source and model are grey."""
    if wavelength_nm is not None:
        at = np.atleast_1d(check_nanometres("wavelength_nm", wavelength_nm))
        if at.ndim != 1 or not at.size or not np.all(np.diff(at) > 0.0):
            raise ParameterError("wavelength_nm", "wavelengths must be positive and increasing", wavelength_nm)
    elif source.spectral and source.wavelengths_nm is not None:
        at = np.array(source.wavelengths_nm, dtype=np.float64)
    elif source.spectral:
        raise ParameterError("wavelength_nm", f"missing; f_r of {source.name} depends on the wavelength")
    else:
        at = np.array([ASSUMED_NM])
    if source.spectral or other.spectral:
        return at
    if wavelength_nm is not None:
        raise ParameterError(
            "wavelength_nm", f"neither {source.name} nor {other.name} depends on it; leave it out", wavelength_nm
        )
    return None


def _searched(request: _Request, tick: Callable[[], None]) -> _Fit:
    """Search the shared parameters at a few wavelengths, then the colours at all of them."""
    source = request.source
    target = request.target
    columns = request.columns
    some = None if request.before is None else request.before[columns]
    lobe = lobe_of(source, some)
    coarse, fitted = (_nodes(request, lobe, counts, some) for counts in (COARSE, request.counts))
    result = search(target, coarse, fitted, columns, _alphas(lobe), tick)
    if result.distance >= REFUSED:
        raise ParameterError(
            "fixed",
            f"with these values the lobe of {target.spec.name} is less than a quarter as wide as that of {source.name}",
        )
    if target.count == columns.size and not target.colours:
        return _Fit(result, np.zeros((target.count, 0)), fitted)
    nodes = _nodes(request, lobe, request.counts, request.before)
    every = Distance(target, nodes, np.arange(target.count, dtype=np.int64), _alphas(lobe))
    ends = [every.of_column(result.numbers, column, column).point for column in range(target.count)]
    return _Fit(result, np.stack(ends), nodes)


def _nodes(
    request: _Request, lobe: Callable[[Array], Lobe | None], counts: Counts, wavelength_nm: Array | None
) -> TruthNodes:
    """Return the truth at nodes, of a source that reflects something at each wavelength."""
    f_r = request.source.brdf_at(wavelength_nm)
    mirror = specular_of(request.source, wavelength_nm)
    nodes = TruthNodes(lobe, counts, request.symmetry, f_r, mirror, request.weigh)
    dark = ~(np.max(nodes.truth, axis=0) > 0.0)
    if np.any(dark):
        where = "" if wavelength_nm is None else f" at {wavelength_nm[dark][0]:g} nm"
        name = request.source.name
        raise ParameterError(
            "source",
            f"{name} reflects no light{where} outside the mirror direction, so no model is close to it",
            name,
        )
    return nodes


def _alphas(lobe: Callable[[Array], Lobe | None]) -> Array:
    """Return the widths (2,) of a lobe at normal incidence, where a wavelength is narrowest; nan without one."""
    normal = lobe(np.asarray(1.0))
    return np.full(2, np.nan) if normal is None else np.array([np.min(normal.alpha_x), np.min(normal.alpha_y)])


def _measured(request: _Request, fit: _Fit) -> Conversion:
    """Return the conversion to the parameters that the search ended at, with its errors at more nodes."""
    source = request.source
    target = request.target
    spec = target.spec
    table = _table(request, fit, f"converted from {source.name}")
    name = f"{source.name}-as-{spec.name.replace('_', '-').lower()}"[:MOST_NAME].rstrip("-")
    material = Material.from_table(name, table)
    sides = sides_of(source, material, request.at)
    finer = request.counts.finer(FINER)
    remaining = RemainingDifference(sides, finer, request.symmetry)
    l1 = float(np.mean(remaining.l1))
    p99 = _p99_of(source, request.before, sides)
    was = f" ({source.model})" if isinstance(source, Material) else ""
    source_model = ""
    if isinstance(source, Material):
        source_model = source.model
    elif isinstance(source, MeasuredSource | TableSource) and source.measured is not None:
        source_model = "measured"
    table["source"] = f"converted from {source.name}{was}; l1 {percent(l1)}, p99 {percent(p99)}"
    largest, worst = _worst_view(sides, finer, request.symmetry, request.at)
    searched = fit.result.numbers if target.searched_index else {}
    conversion = Conversion(
        source=source.name,
        source_model=source_model,
        model=spec.name,
        weigh=request.weigh,
        parameters=material.parameters,
        n=rounded(searched["n"]) if searched else None,
        k=rounded(searched["k"]) if searched else None,
        fixed=sorted(target.fixed),
        refractive_index=target.entry,
        wavelengths_nm=None if request.at is None else request.at.tolist(),
        l1=l1,
        l1_of=remaining.l1.tolist(),
        quadrature=abs(l1 - _l1_at(fit.nodes, sides)),
        p99=p99,
        reflected=float(np.mean(remaining.reflected)),
        specular_share=float(np.mean(remaining.specular)),
        peak=_peak_of(sides),
        worst_view=worst,
        views_deg=VIEWS_DEG.tolist(),
        l1_of_views=largest,
        as_good=fit.result.as_good,
        evaluations=fit.result.evaluations,
        material=Material.from_table(name, table),
        recipe=toml_of(name, table),
        remarks=[],
    )
    return conversion.model_copy(update={"remarks": _remarks(source, conversion)})


def _table(request: _Request, fit: _Fit, origin: str) -> dict[str, Any]:
    """Return the material as a recipe writes it, with rounded parameters."""
    target = request.target
    at = request.at
    values: dict[str, Any] = {}
    for parameter in target.spec.parameters:
        name = parameter.name
        column = next((i for i, variable in enumerate(target.colours) if variable.name == name), None)
        if column is not None and at is not None:
            colour = [rounded(target.colours[column].value(u)) for u in fit.colours[:, column].tolist()]
            values[name] = {"wavelengths_nm": at.tolist(), "values": colour, "origin": origin}
            continue
        value = {**target.fixed, **fit.result.numbers}[name]
        in_file = float(degrees(value)) if parameter.unit == "rad" else value
        values[written_name(parameter)] = value if isinstance(value, bool) else rounded(in_file)
    table: dict[str, Any] = {
        "title": f"{request.source.title}, as {target.spec.title}",
        "model": target.spec.name,
        "source": origin,
    }
    if target.searched_index:
        n, k = (rounded(fit.result.numbers[name]) for name in ("n", "k"))
        table["refractive_index"] = f"constant/{n!r}/{k!r}"
    elif target.entry is not None:
        table["refractive_index"] = target.entry
    stated = target.searched_index or request.source.wavelengths_nm is not None
    if at is not None and stated and (target.spec.spectral or target.colours):
        table["wavelengths_nm"] = at.tolist()
    return {**table, "parameters": values}


def _l1_at(nodes: TruthNodes, sides: Sides) -> float:
    """Return the mean l1 [1] at the nodes of a search, of all wavelengths that these have."""
    values = sides.model(nodes.wi, nodes.wr)
    mirror = sides.model_specular
    specular = np.zeros(nodes.specular.shape) if mirror is None else mirror(nodes.theta)
    wrong = nodes.weight @ np.abs(values - nodes.truth) + nodes.theta_weight @ np.abs(specular - nodes.specular)
    return float(np.mean(wrong / nodes.total))


def _peak_of(sides: Sides) -> Peak:
    """Return f_r of both in the mirror direction at `PEAK_DEG`, at the middle wavelength."""
    wi, wr = (unit_vector(radians(PEAK_DEG), phi)[np.newaxis] for phi in (0.0, np.pi))
    before, after = (np.ravel(one(wi, wr)) for one in (sides.truth, sides.model))
    return Peak(theta_deg=PEAK_DEG, before=float(before[before.size // 2]), after=float(after[after.size // 2]))


def _p99_of(source: Source, wavelength_nm: Array | None, sides: Sides) -> float:
    """Return the 99th percentile of the relative error [1], at directions drawn as charts draw them."""
    drawn = error_measurement.draw(source, wavelength_nm, DIRECTIONS, SEED)
    truth = sides.truth(drawn.wi, drawn.wr)
    values = sides.model(drawn.wi, drawn.wr)
    return error_measurement.compare(values, truth, drawn).overall.p99


def _worst_view(
    sides: Sides, counts: Counts, symmetry: Symmetry, wavelength_nm: Array | None
) -> tuple[list[float], WorstView]:
    """Return the largest l1 of viewers at each theta_r, and the viewer with the largest of all."""
    anisotropic, elliptical = symmetry
    end_deg = 90.0 if elliptical else 345.0
    phis_deg = np.arange(0.0, end_deg + 1.0, STEP_DEG) if anisotropic else np.zeros(1)
    largest: list[float] = []
    worst: tuple[float, int, ViewError] | None = None
    for theta_deg in VIEWS_DEG.tolist():
        of_theta = 0.0
        for phi_deg in phis_deg.tolist():
            view = view_of(sides.lobe, float(radians(theta_deg)), float(radians(phi_deg)), counts, symmetry)
            error = ViewError(view, sides)
            column = int(np.argmax(error.l1))
            l1 = float(error.l1[column])
            of_theta = max(of_theta, l1)
            if worst is None or l1 > worst[0]:
                worst = l1, column, error
        largest.append(of_theta)
    assert worst is not None
    l1, column, error = worst
    light = error.largest(column)
    x, y, z = error.view.wi[light]
    return largest, WorstView(
        theta_r_deg=round(float(degrees(error.view.theta)), 6),
        phi_r_deg=round(float(degrees(error.view.phi)), 6),
        l1=l1,
        wavelength_nm=None if wavelength_nm is None else float(wavelength_nm[column]),
        theta_i_deg=round(float(degrees(np.arccos(np.clip(z, -1.0, 1.0)))), 2),
        phi_i_deg=round(float(degrees(np.arctan2(y, x))) % 360.0, 2),
        before=float(error.f[light, column]),
        after=float(error.g[light, column]),
    )


def _is_lost(source: Source, conversion: Conversion) -> bool:
    """Return True if a lobe of the source has less than half of its peak in the model."""
    return source.has_lobe and conversion.peak.after < _LOST * conversion.peak.before


def _at_an_end(conversion: Conversion) -> list[str]:
    """Return the numbers that ended at a limit of their range, with the values, as recipes write them."""
    in_file = conversion.material.file_parameters()
    ends = []
    for parameter in MODELS[conversion.model].parameters:
        value = conversion.parameters[parameter.name]
        if parameter.name in conversion.fixed or parameter.reflectance or not isinstance(value, float):
            continue
        if any(end != 0.0 and abs(value - end) <= _END * abs(end) for end in (parameter.low, parameter.high)):
            name = written_name(parameter)
            ends.append(f"{name} = {in_file[name]:g}")
    return ends


def _remarks(source: Source, conversion: Conversion) -> list[str]:
    """Return sentences on how far the model is, what it lacks of the source, a lost highlight, and an inexact l1."""
    spec = MODELS[conversion.model]
    made = conversion.material
    sentences = []
    if conversion.l1 >= _NOT_NEAR:
        sentences.append(
            f"{spec.name} cannot carry {source.name}: black, which reflects nothing, has an l1 of 100 %, too."
        )
    if ends := _at_an_end(conversion):
        sentences.append(f"At the end of their range: {', '.join(ends)}. A closer fit lies beyond.")
    if conversion.specular_share > _SEEN:
        share = f"{percent(conversion.specular_share)} of the light of {source.name} is its specular part"
        lacks = "has one, too" if spec.specular else "has none: that light counts as error"
        sentences.append(f"{share} (a Dirac delta); {spec.name} {lacks}.")
    if isinstance(source, Material) and source.spec.uniform and spec.uniform is None and spec.lobe is not None:
        uniform = source.parameters[source.spec.uniform]
        if not isinstance(uniform, float) or uniform > 0.0:
            others = closest(
                spec.name, [name for name, other in MODELS.items() if other.uniform and name != source.model]
            )
            with_one = others.replace("; closest: ", "; models with one: ")
            sentences.append(
                f"{source.name} has a uniform part ({source.spec.uniform} = {uniform}); {spec.name} has none{with_one}."
            )
    if source.anisotropic and not made.anisotropic:
        sentences.append(f"{source.name} is anisotropic; {made.name} is not.")
    if _is_lost(source, conversion):
        peak = conversion.peak
        sentences.append(
            f"The highlight is lost: f_r in the mirror direction at {peak.theta_deg:g} degrees falls from "
            f"{peak.before:.3g} to {peak.after:.3g} /sr. Fix reflectance and width to keep one."
        )
    if conversion.quadrature > _UNSURE * conversion.l1:
        sentences.append(f"l1 is known to within {percent(conversion.quadrature)} of the light.")
    return sentences
