"""The parameters of another model that come closest to a source."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.conversion.document import Conversion, percent
from brdfdb.conversion.measurement import (
    VIEWS_DEG,
    l1_at,
    left_by,
    lobe_of,
    p99_of,
    peak_of,
    sides_of,
    worst_view,
)
from brdfdb.conversion.nodes import COARSE, FINER, FITTED, WEIGHS, Nodes, Weigh, specular_of
from brdfdb.conversion.remarks import is_lost, remarks, with_highlight
from brdfdb.conversion.search import REFUSED, Distance, Result, search
from brdfdb.conversion.search import STEPS as _SEARCH_STEPS
from brdfdb.conversion.target import Target
from brdfdb.errors import ParameterError
from brdfdb.geometry import degrees
from brdfdb.integrals.pairs import Counts, Symmetry
from brdfdb.lobes import Lobe
from brdfdb.materials import Material, Source, written_name
from brdfdb.materials.provenance import MOST_NAME
from brdfdb.materials.recipe_text import rounded, toml_of
from brdfdb.measurements import MeasuredSource
from brdfdb.models import MODELS
from brdfdb.parameters import ModelSpec, check_nanometres, closest
from brdfdb.tables.table import TableSource

Array = NDArray[np.float64]

FIT = "fit"  # the refractive index that asks for a search of n and k
SEARCHED = 5  # wavelengths at most at which shared parameters are searched
ASSUMED_NM = 550.0  # wavelength of the n and k that are searched for a grey source
STEPS = _SEARCH_STEPS  # calls of `tick` in a conversion


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
    if weigh is not None or MODELS[model].lobe is None or not is_lost(source, least):
        return least
    request = request._replace(weigh="lightness")
    other = _measured(request, _searched(request, tick))
    return least if is_lost(source, other) else with_highlight(other, least)


class Difference(NamedTuple):
    """The distance of two materials, l1 and p99 as in `Conversion`."""

    l1: float
    p99: float


def compare(source: Source, other: Material, wavelength_nm: ArrayLike | None = None) -> Difference:
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
    Difference
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
    left = left_by(sides, FITTED.finer(FINER), _symmetry(source, other))
    return Difference(float(np.mean(left.l1)), p99_of(source, at if source.spectral else None, sides))


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
    counts = COARSE if spec.slow else FITTED
    return _Request(source, at if source.spectral else None, at, target, target.symmetry, counts, weigh)


def _wavelengths(source: Source, other: ModelSpec | Material, wavelength_nm: ArrayLike | None) -> Array | None:
    """Return the wavelengths of the comparison; None where source and model are grey."""
    if wavelength_nm is not None:
        at = np.atleast_1d(check_nanometres("wavelength_nm", wavelength_nm))
        if at.ndim != 1 or not at.size or not np.all(np.diff(at) > 0.0):
            raise ParameterError("wavelength_nm", "they must be positive and increasing", wavelength_nm)
    elif source.spectral and source.wavelengths_nm is not None:
        at = np.array(source.wavelengths_nm, dtype=np.float64)
    elif source.spectral:
        raise ParameterError("wavelength_nm", f"missing; f_r of {source.name} depends on the wavelength")
    else:
        at = np.array([ASSUMED_NM])
    if source.spectral or other.spectral:
        return at
    if wavelength_nm is not None:
        raise ParameterError("wavelength_nm", f"{source.name} and {other.name} have none; leave it out", wavelength_nm)
    return None


def _symmetry(source: Source, other: Material) -> Symmetry:
    """Return the symmetry that two have in common."""
    return Symmetry(
        source.anisotropic or other.anisotropic,
        (source.elliptical or not source.anisotropic) and (other.elliptical or not other.anisotropic),
    )


def _searched(request: _Request, tick: Callable[[], None]) -> _Fit:
    """Search the shared parameters at a few wavelengths, then the colours at all of them."""
    source, target, columns = request.source, request.target, request.columns
    some = None if request.before is None else request.before[columns]
    lobe = lobe_of(source, some)
    coarse, fitted = (_nodes(request, lobe, counts, some) for counts in (COARSE, request.counts))
    result = search(target, coarse, fitted, columns, _alphas(lobe), tick)
    if result.distance >= REFUSED:
        raise ParameterError(
            "fixed", f"the lobe of {target.spec.name} is then less than a quarter as wide as that of {source.name}"
        )
    if target.count == columns.size and not target.colours:
        return _Fit(result, np.zeros((target.count, 0)), fitted)
    nodes = _nodes(request, lobe, request.counts, request.before)
    every = Distance(target, nodes, np.arange(target.count, dtype=np.int64), _alphas(lobe))
    ends = [every.of_column(result.numbers, column, column)[1] for column in range(target.count)]
    return _Fit(result, np.stack(ends), nodes)


def _nodes(
    request: _Request, lobe: Callable[[Array], Lobe | None], counts: Counts, wavelength_nm: Array | None
) -> Nodes:
    """Return the truth at nodes, of a source that reflects something at each wavelength."""
    f_r, mirror = request.source.brdf_at(wavelength_nm), specular_of(request.source, wavelength_nm)
    nodes = Nodes(lobe, counts, request.symmetry, f_r, mirror, request.weigh)
    dark = ~(np.max(nodes.truth, axis=0) > 0.0)
    if np.any(dark):
        where = "" if wavelength_nm is None else f" at {wavelength_nm[dark][0]:g} nm"
        name = request.source.name
        raise ParameterError(
            "source",
            f"{name} reflects nothing{where} beside the mirror direction, so that no model is close to it",
            name,
        )
    return nodes


def _alphas(lobe: Callable[[Array], Lobe | None]) -> Array:
    """Return the widths (2,) of a lobe at normal incidence, where a wavelength is narrowest; nan without one."""
    normal = lobe(np.asarray(1.0))
    return np.full(2, np.nan) if normal is None else np.array([np.min(normal.alpha_x), np.min(normal.alpha_y)])


# What is left


def _measured(request: _Request, fit: _Fit) -> Conversion:
    """Measure what a material with the parameters that were found leaves, at more nodes."""
    source, target = request.source, request.target
    spec = target.spec
    table = _table(request, fit, f"converted from {source.name}")
    name = f"{source.name}-as-{spec.name.replace('_', '-').lower()}"[:MOST_NAME].rstrip("-")
    material = Material.from_table(name, table)
    sides = sides_of(source, material, request.at)
    finer = request.counts.finer(FINER)
    left = left_by(sides, finer, request.symmetry)
    l1, p99 = float(np.mean(left.l1)), p99_of(source, request.before, sides)
    was = f" ({source.model})" if isinstance(source, Material) else ""
    table["source"] = f"converted from {source.name}{was}; l1 {percent(l1)}, p99 {percent(p99)}"
    largest, worst = worst_view(sides, finer, request.symmetry, request.at)
    searched = fit.result.numbers if target.searched_index else {}
    conversion = Conversion(
        source=source.name,
        source_model=_model_of(source),
        model=spec.name,
        weigh=request.weigh,
        parameters=material.parameters,
        n=rounded(searched["n"]) if searched else None,
        k=rounded(searched["k"]) if searched else None,
        fixed=sorted(target.fixed),
        refractive_index=target.entry,
        wavelengths_nm=None if request.at is None else request.at.tolist(),
        l1=l1,
        l1_of=left.l1.tolist(),
        quadrature=abs(l1 - l1_at(fit.nodes, sides)),
        p99=p99,
        reflected=float(np.mean(left.reflected)),
        specular_share=float(np.mean(left.specular)),
        peak=peak_of(sides),
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


def _model_of(source: Source) -> str:
    """Return the model of a source, "measured" of measured data, or nothing of a function."""
    if isinstance(source, Material):
        return source.model
    return "measured" if isinstance(source, MeasuredSource | TableSource) and source.measured is not None else ""
