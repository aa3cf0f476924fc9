"""Conversion from one model to another: the parameters that come closest, and the error that is left."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.errors import ParameterError
from brdfdb.forms.conversion_document import Conversion, Peak, WorstView, percent, toml_of
from brdfdb.forms.conversion_nodes import (
    COARSE,
    FINER,
    FITTED,
    WEIGHS,
    Evaluate,
    Left,
    Nodes,
    Specular,
    ViewError,
    Weigh,
    specular_of,
)
from brdfdb.forms.conversion_remarks import remarks
from brdfdb.forms.conversion_search import STEPS as _SEARCH_STEPS
from brdfdb.forms.conversion_search import Distance, Result, search
from brdfdb.forms.conversion_target import Target
from brdfdb.geometry import degrees, radians, unit_vector
from brdfdb.integrals.pairs import Counts, Symmetry, view_of, views
from brdfdb.lobes import Lobe
from brdfdb.materials import Material, Source, written_name
from brdfdb.materials.provenance import MOST_NAME
from brdfdb.models import MODELS
from brdfdb.parameters import ModelSpec, closest
from brdfdb.tables import error_measurement

Array = NDArray[np.float64]

FIT = "fit"  # the refractive index that asks for a search of n and k
SEARCHED = 5  # wavelengths at most at which shared parameters are searched
ASSUMED_NM = 550.0  # wavelength of the n and k that are searched for a grey source
DIRECTIONS, SEED = 1000, 1992  # of p99: those of charts
VIEWS_DEG = np.arange(0.0, 90.0, 5.0)  # theta_r of the viewers among whom the worst one is looked for
STEP_DEG = 15.0  # between phi_r of these viewers, for an anisotropic source
PEAK_DEG = 45.0  # theta_i of the mirror direction whose f_r is stated
DIGITS = 6  # significant digits of the parameters; what is left is measured with these
_ZERO = 1e-12  # parameters that are not larger are 0
STEPS = _SEARCH_STEPS + 1  # calls of `tick` in a conversion


def convert(
    source: Source,
    model: str,
    wavelength_nm: ArrayLike | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    refractive_index: str | None = None,
    weigh: Weigh = "light",
    tick: Callable[[], None] = lambda: None,
) -> Conversion:
    """Search the parameters of a model that come closest to a source, and measure the error that is left.

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
        What the search makes least: l1, or the root mean square difference of cube roots of f_r, with the same cosines,
        as the eye weighs light. The latter keeps a highlight that carries little of the light.
    tick : callable
        A function that is called `STEPS` times at most, to show progress.

    Returns
    -------
    Conversion
        Parameters, l1, p99, the worst view, and the result as a material and as a part of a recipe.

    Raises
    ------
    ParameterError
        If the model is that of the source or unknown, if n and k would have to be searched at several wavelengths, if
        a fixed parameter is unknown or out of range, or if the source reflects nothing.

    Notes
    -----
    The distance between f, the source, and g, the model, is

        l1 = integral of abs(g - f) cos theta_i cos theta_r / integral of f cos theta_i cos theta_r

    over all lights and viewers above the horizon: the light in the wrong place under light from everywhere, counted
    where it is missing and where it is too much. It is 0 for the same surface, and 2 for one that reflects as much to
    other places alone. Specular parts (Dirac deltas) count with their reflectance, abs(S_g - S_f). Of several
    wavelengths it is the mean. The mean square would follow the largest values, next to grazing, and give up the
    uniform part of brass; a specular part has none. l1 has a price, too: a highlight with a few hundredths of the light
    may go, if the model cannot put it right. `Conversion.peak` shows that.

    All numbers of the model are searched within their ranges, as in `brdfdb.forms.conversion_search`. A reflectance has
    a value at each wavelength; the others are shared, and searched at five wavelengths. Switches keep their defaults.
    An isotropic source gives one alpha. n and k are searched as the reflectance at normal incidence, which the light
    fixes well, and the place between the two n of k = 0, which matters little: `Conversion.as_good` shows that.

    Integrals are sums at nodes that follow the lobe of the source (`brdfdb.integrals.pairs`). The stated l1 is measured
    at five times as many nodes as the search has, or more. `Conversion.quadrature` is the difference of the two.
    `brdfdb.roughness` has the conversions that are exact.

    References
    ----------
    neldermead1965

    Examples
    --------
    >>> from brdfdb.materials import presets
    >>> brass = convert(presets()["rolled-brass"], "ward_duer")
    >>> round(brass.parameters["alpha_x"], 2), round(brass.l1, 2)
    (0.05, 0.14)
    """
    request = _request(source, model, wavelength_nm, fixed or {}, refractive_index, weigh)
    fit = _searched(request, tick)
    tick()
    return _measured(request, fit)


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
    nodes: Nodes


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
        raise ParameterError("model", f"{source.name} is of the model {model} itself; name another one", model)
    at = _wavelengths(source, spec, wavelength_nm)
    if entry is not None and not spec.spectral:
        raise ParameterError("refractive_index", f"the model {model} takes none", entry)
    if entry is None and spec.spectral and isinstance(source, Material):
        entry = source.refractive_index
    entry = None if entry == FIT else entry
    if spec.spectral and entry is None and at is not None and at.size > 1:
        raise ParameterError(
            "refractive_index",
            f"missing; {model} takes n and k, which are searched at one wavelength alone, and {at.size} are given",
            entry,
        )
    target = Target(spec, source, at, fixed, entry)
    symmetry = Symmetry(source.anisotropic, source.elliptical)
    counts = COARSE if spec.slow else FITTED
    return _Request(source, at if source.spectral else None, at, target, symmetry, counts, weigh)


def _wavelengths(source: Source, spec: ModelSpec, wavelength_nm: ArrayLike | None) -> Array | None:
    """Return the wavelengths of the comparison; None where source and model are grey."""
    if wavelength_nm is not None:
        at = np.atleast_1d(np.asarray(wavelength_nm, dtype=np.float64))
        if at.ndim != 1 or not at.size or not np.all(at > 0.0) or not np.all(np.diff(at) > 0.0):
            raise ParameterError("wavelength_nm", "they must be positive and increasing", wavelength_nm)
    elif source.spectral and source.wavelengths_nm is not None:
        at = np.array(source.wavelengths_nm, dtype=np.float64)
    elif source.spectral:
        raise ParameterError("wavelength_nm", f"missing; f_r of {source.name} depends on the wavelength")
    else:
        at = np.array([ASSUMED_NM])
    if source.spectral or spec.spectral:
        return at
    if wavelength_nm is not None:
        raise ParameterError("wavelength_nm", f"{source.name} and {spec.name} have none; leave it out", wavelength_nm)
    return None


def _searched(request: _Request, tick: Callable[[], None]) -> _Fit:
    """Search the shared parameters at a few wavelengths, then the colours at all of them."""
    source, target, columns = request.source, request.target, request.columns
    some = None if request.before is None else request.before[columns]
    lobe = _lobe_of(source, some)
    coarse, fitted = (_nodes(request, lobe, counts, some) for counts in (COARSE, request.counts))
    result = search(target, coarse, fitted, columns, _alpha(lobe), tick)
    if target.count == columns.size and not target.colours:
        return _Fit(result, np.zeros((target.count, 0)), fitted)
    nodes = _nodes(request, lobe, request.counts, request.before)
    every = Distance(target, nodes, np.arange(target.count, dtype=np.int64))
    ends = [every.of_column(result.numbers, column, column)[1] for column in range(target.count)]
    return _Fit(result, np.stack(ends), nodes)


def _nodes(
    request: _Request, lobe: Callable[[Array], Lobe | None], counts: Counts, wavelength_nm: Array | None
) -> Nodes:
    """Return the truth at nodes, of a source that reflects something at each wavelength."""
    f_r, mirror = request.source.brdf_at(wavelength_nm), specular_of(request.source, wavelength_nm)
    nodes = Nodes(lobe, counts, request.symmetry, f_r, mirror, request.weigh)
    dark = ~(nodes.total > 0.0)
    if np.any(dark):
        where = "" if wavelength_nm is None else f" at {wavelength_nm[dark][0]:g} nm"
        name = request.source.name
        raise ParameterError("source", f"{name} reflects nothing{where}, so that no model is close to it", name)
    return nodes


def _lobe_of(source: Source, wavelength_nm: Array | None) -> Callable[[Array], Lobe | None]:
    return lambda cosine: source.lobe(cosine, wavelength_nm) if source.has_lobe else None


def _alpha(lobe: Callable[[Array], Lobe | None]) -> float:
    """Return the width [1] of a lobe at normal incidence, at the wavelength where it is narrowest; nan without one."""
    normal = lobe(np.asarray(1.0))
    return np.nan if normal is None else float(np.sqrt(np.min(normal.alpha_x) * np.min(normal.alpha_y)))


# What is left


def _measured(request: _Request, fit: _Fit) -> Conversion:
    """Measure what a material with the parameters that were found leaves, at more nodes."""
    source, target = request.source, request.target
    spec = target.spec
    table = _table(request, fit, f"converted from {source.name}")
    name = f"{source.name}-as-{spec.name.replace('_', '-').lower()}"[:MOST_NAME].rstrip("-")
    material = Material.from_table(name, table)
    sides = _sides(request, material)
    finer = request.counts.finer(FINER)
    left = Left(views(sides.lobe, finer, request.symmetry), *sides[:3])
    l1, p99 = float(np.mean(left.l1)), _p99(request, sides)
    was = f" ({source.model})" if isinstance(source, Material) else ""
    table["source"] = f"converted from {source.name}{was}; l1 {percent(l1)}, p99 {percent(p99)}"
    largest, worst = _views(request, sides, finer)
    searched = fit.result.numbers if target.searched_index else {}
    conversion = Conversion(
        source=source.name,
        source_model=source.model if isinstance(source, Material) else "",
        model=spec.name,
        weigh=request.weigh,
        parameters=material.parameters,
        n=_rounded(searched["n"]) if searched else None,
        k=_rounded(searched["k"]) if searched else None,
        fixed=sorted(target.fixed),
        refractive_index=target.entry,
        wavelengths_nm=None if request.at is None else request.at.tolist(),
        l1=l1,
        l1_of=left.l1.tolist(),
        quadrature=abs(l1 - _at_nodes(request, material, fit.nodes)),
        p99=p99,
        reflected=float(np.mean(left.reflected)),
        specular_share=float(np.mean(left.specular)),
        peak=_peak(sides),
        worst_view=worst,
        views_deg=VIEWS_DEG.tolist(),
        l1_of_views=largest,
        as_good=fit.result.as_good,
        evaluations=fit.result.evaluations,
        material=Material.from_table(name, table),
        recipe=toml_of(name, table),
        remarks=[],
    )
    return conversion.model_copy(update={"remarks": remarks(source, conversion)})


def _table(request: _Request, fit: _Fit, origin: str) -> dict[str, Any]:
    """Return the material as a recipe writes it, with rounded parameters."""
    target, at = request.target, request.at
    values: dict[str, Any] = {}
    for parameter in target.spec.parameters:
        name = parameter.name
        column = next((i for i, variable in enumerate(target.colours) if variable.name == name), None)
        if column is not None and at is not None:
            colour = [_rounded(target.colours[column].value(u)) for u in fit.colours[:, column].tolist()]
            values[name] = {"wavelengths_nm": at.tolist(), "values": colour, "origin": origin}
            continue
        value = {**target.fixed, **fit.result.numbers}[name]
        in_file = float(degrees(value)) if parameter.unit == "rad" else value
        values[written_name(parameter)] = value if isinstance(value, bool) else _rounded(in_file)
    table: dict[str, Any] = {
        "title": f"{request.source.title}, as {target.spec.title}",
        "model": target.spec.name,
        "source": origin,
    }
    if target.searched_index:
        n, k = (_rounded(fit.result.numbers[name]) for name in ("n", "k"))
        table["refractive_index"] = f"constant/{n!r}/{k!r}"
    elif target.entry is not None:
        table["refractive_index"] = target.entry
    stated = target.searched_index or request.source.wavelengths_nm is not None
    if at is not None and stated and (target.spec.spectral or target.colours):
        table["wavelengths_nm"] = at.tolist()
    return {**table, "parameters": values}


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}") if abs(value) > _ZERO else 0.0


class _Sides(NamedTuple):
    """Source and model as functions: f_r (N, L) of both, their specular parts, and the narrower of their lobes."""

    truth: Evaluate
    model: Evaluate
    mirrors: tuple[Specular | None, Specular | None]
    lobe: Callable[[Array], Lobe | None]


def _sides(request: _Request, material: Material) -> _Sides:
    source, before = request.source, request.before
    after = request.at if material.spectral else None
    lobes = _lobe_of(source, before), _lobe_of(material, after)

    def narrower(cosine: Array) -> Lobe | None:
        both = [lobe for lobe in (one(cosine) for one in lobes) if lobe is not None]
        if not both:
            return None
        alpha_x = min(np.min(lobe.alpha_x) for lobe in both)
        alpha_y = min(np.min(lobe.alpha_y) for lobe in both)
        return Lobe(np.asarray(1.0), np.asarray(alpha_x), np.asarray(alpha_y))

    mirrors = specular_of(source, before), specular_of(material, after)
    return _Sides(source.brdf_at(before), material.brdf_at(after), mirrors, narrower)


def _at_nodes(request: _Request, material: Material, nodes: Nodes) -> float:
    """Return the mean l1 at the nodes of the search, of all wavelengths that these have."""
    after = request.at if material.spectral else None
    values, mirror = material.brdf_at(after)(nodes.wi, nodes.wr), specular_of(material, after)
    specular = np.zeros(nodes.specular.shape) if mirror is None else mirror(nodes.theta)
    wrong = nodes.weight @ np.abs(values - nodes.truth) + nodes.theta_weight @ np.abs(specular - nodes.specular)
    return float(np.mean(wrong / nodes.total))


def _peak(sides: _Sides) -> Peak:
    """Return f_r of both in the mirror direction at `PEAK_DEG`, at the middle wavelength."""
    wi, wr = (unit_vector(radians(PEAK_DEG), phi)[np.newaxis] for phi in (0.0, np.pi))
    before, after = (np.ravel(one(wi, wr)) for one in (sides.truth, sides.model))
    return Peak(theta_deg=PEAK_DEG, before=float(before[before.size // 2]), after=float(after[after.size // 2]))


def _p99(request: _Request, sides: _Sides) -> float:
    drawn = error_measurement.draw(request.source, request.before, DIRECTIONS, SEED)
    truth, values = sides.truth(drawn.wi, drawn.wr), sides.model(drawn.wi, drawn.wr)
    return error_measurement.compare(values, truth, drawn).overall.p99


def _views(request: _Request, sides: _Sides, counts: Counts) -> tuple[list[float], WorstView]:
    """Return the largest l1 of viewers at each theta_r, and the viewer with the largest of all."""
    anisotropic, elliptical = request.symmetry
    end_deg = 90.0 if elliptical else 345.0
    phis_deg = np.arange(0.0, end_deg + 1.0, STEP_DEG) if anisotropic else np.zeros(1)
    largest: list[float] = []
    worst: tuple[float, int, ViewError] | None = None
    for theta_deg in VIEWS_DEG.tolist():
        of_theta = 0.0
        for phi_deg in phis_deg.tolist():
            view = view_of(sides.lobe, float(radians(theta_deg)), float(radians(phi_deg)), counts, request.symmetry)
            error = ViewError(view, *sides[:3])
            column = int(np.argmax(error.l1))
            l1 = float(error.l1[column])
            of_theta = max(of_theta, l1)
            if worst is None or l1 > worst[0]:
                worst = l1, column, error
        largest.append(of_theta)
    assert worst is not None
    l1, column, error = worst
    (theta_i_deg, phi_i_deg), before, after = error.largest(column)
    return largest, WorstView(
        theta_r_deg=round(float(degrees(error.view.theta)), 6),
        phi_r_deg=round(float(degrees(error.view.phi)), 6),
        l1=l1,
        wavelength_nm=None if request.at is None else float(request.at[column]),
        theta_i_deg=round(theta_i_deg, 2),
        phi_i_deg=round(phi_i_deg, 2),
        before=before,
        after=after,
    )
