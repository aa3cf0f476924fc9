"""Maps of the error of models against rays on Gaussian surfaces, over the slope and the angle of the light.

A task traces one realisation of a surface, for all lights and albedos. `fitted` returns the parameters of a model that
suit a surface, `rows` its errors, and `document` the content of brdfdb/microgeometry/model_errors.json.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.figure import listed
from brdfdb.geometry import unit_vector
from brdfdb.microgeometry.facets import Facets
from brdfdb.microgeometry.goniometer import bounces
from brdfdb.microgeometry.surfaces import MadeSurface
from brdfdb.models import MODELS
from brdfdb.parameters import SurfaceRelation

Floats = NDArray[np.float64]
FacetKind = Literal["diffuse", "mirror"]
BounceCount = Literal["one", "two", "all"]

VERSION = 1  # of the file
SLOPES = (0.1, 0.2, 0.35, 0.5, 0.65, 0.8)  # standard deviations of the slopes along each axis [1]
LIGHTS_DEG = (0, 15, 30, 45, 60, 75)  # theta_i [degree]
VIEWERS = 72  # viewers of each light
STEEPEST_DEG = 80.0  # largest theta_r [degree] of a viewer
RHOS = (0.2, 0.5, 0.9, 1.0)  # albedos of Lambertian facets
MAPPED = RHOS[:3]  # the albedos of rows; 1 serves models that are proportional to the albedo
#: n and k of mirror-like facets. The first reflect all light; the metal is near iron at 550 nm
MIRRORS: dict[str, tuple[float, float]] = {"F = 1": (1.0, 1e4), "n = 1.5": (1.5, 0.0), "metal": (2.9, 3.0)}
_N, _K = np.array(list(MIRRORS.values())).T

SURFACES = "Gaussian correlation, isotropic, 512 x 512 nodes, ten in a length of correlation, periodic"

_LOBE = 3.035  # tilt of the half vector, in slopes, at which the density of slopes is a hundredth of that at 0
_COUNTED = 0.01  # share of the peak of f_r from which on a direction is counted
_GOLDEN = np.pi * (3.0 - np.sqrt(5.0))
_FORWARD_DEG = 30.0  # azimuth [degree] from a half plane, and least theta_r, of viewers of the signed errors


class Task(NamedTuple):
    """One realisation of a Gaussian surface with Lambertian or mirror-like facets."""

    facets: FacetKind
    slope: float
    number: int


@dataclass(frozen=True)
class SurfaceEstimate:
    """Means of f_r [1/sr] over realisations, and their standard errors, both (3, I, V, L).

    The first axis is one bounce, two bounces, and all bounces: sums, not the shares of each bounce.
    """

    f_r: Floats
    error: Floats

    def against(self, count: BounceCount, columns: list[int]) -> tuple[Floats, Floats]:
        """Return f_r [1/sr] and its standard error (I, V, columns) of a number of bounces, for albedos or mirrors."""
        row = ("one", "two", "all").index(count)
        return self.f_r[row][..., columns], self.error[row][..., columns]

    def noise(self) -> float:
        """Return the root mean square of the relative standard error [1] of all bounces where f_r is counted."""
        f_r, error = self.f_r[-1], self.error[-1]
        return float(np.sqrt(np.mean((error / f_r)[_counted(f_r)] ** 2)))


@dataclass(frozen=True, kw_only=True)
class ComparedModel(SurfaceRelation):
    """A model, and its relation to the surfaces that it is compared with."""

    model: str
    mirror: str = "F = 1"  #: which mirror-like facets; F of a facet falls out of the error of one bounce


_BEST = "has the least squares of (model - rays) / (model + rays) over all lights and viewers"


def _comparisons() -> Iterator[tuple[str, ComparedModel]]:
    """Yield the comparisons of models with Gaussian surfaces, with their names: that of a form has its arguments."""
    for name, spec in MODELS.items():
        for number, relation in enumerate(relation for relation in spec.surfaces if not relation.grooves):
            chosen = "".join(f" {key}={str(value).lower()}" for key, value in relation.arguments.items())
            yield f"{name}{chosen if number else ''}", ComparedModel(model=name, **vars(relation))


COMPARISONS: dict[str, ComparedModel] = dict(_comparisons())  #: comparisons by their names


def described(comparison: ComparedModel) -> str:
    """Return how the parameters of a model that suit a surface are found."""
    if comparison.words or not comparison.parameters:
        return comparison.words or "the model has no roughness"
    words = f"{comparison.parameters[0].removesuffix('_x')} {_BEST}"
    if comparison.factor:
        words += ", with a free factor, since the lobe is not normalised"
    return f"{words}; slopes of the model have no variance" if comparison.only_fit else words


def lights() -> Floats:
    """Return the unit vectors of the lights (I, 3)."""
    return unit_vector(np.radians(LIGHTS_DEG), 0.0)


def viewers(facets: FacetKind, slope: float) -> Floats:
    """Return the viewers of each light (I, V, 3), which have equal shares of the projected solid angle.

    Viewers of mirror-like facets are those whose half vector is tilted by less than three slopes.
    """
    chosen = []
    steepest = np.inf if facets == "diffuse" else _LOBE * slope
    for light in lights():
        for count in itertools.count(VIEWERS, VIEWERS // 2):
            number = np.arange(count)
            sine = np.sqrt((number + 0.5) / count) * np.sin(np.radians(STEEPEST_DEG))
            # The surface is isotropic: azimuths from 0 to 180 degrees are all that there are
            azimuth = np.abs((number * _GOLDEN + np.pi) % (2.0 * np.pi) - np.pi)
            directions = unit_vector(np.arcsin(sine), azimuth)
            half = directions + light
            seen = directions[np.hypot(half[:, 0], half[:, 1]) <= steepest * half[:, 2]]
            if len(seen) >= VIEWERS:
                break
        chosen.append(seen[np.round(np.linspace(0, len(seen) - 1, VIEWERS)).astype(int)])
    return np.stack(chosen)


def traced(task: Task, rays: int) -> Floats:
    """Return f_r [1/sr] of a task for one, two, and all bounces, (3, I, V, L): L albedos, or mirrors.

    The density of the slopes is known, so that rays tell of mirror-like facets which of them light and viewer see.
    """
    surface = MadeSurface("gaussian", task.slope).draw(task.number)
    seen = viewers(task.facets, task.slope)
    if task.facets == "diffuse":
        facets = Facets(rho=RHOS, wavelength_nm=_wavelengths(len(RHOS)))
        seen = seen[0]  # the same for all lights
    else:
        facets = Facets(mirror=1.0, n=_N, k=_K, wavelength_nm=_wavelengths(len(MIRRORS)))
    slopes = (task.slope, task.slope)
    shares = bounces(surface, facets, lights(), seen, rays=rays, seed=task.number, turned=True, gaussian_slopes=slopes)
    return np.asarray(np.cumsum([shares.one, shares.two, shares.further], axis=0))


def _wavelengths(count: int) -> Floats:
    # Facets have a value for each wavelength; here albedos and mirrors take their place
    return np.arange(count, dtype=np.float64) + 500.0


def estimated(realisations: Sequence[Floats]) -> SurfaceEstimate:
    """Return means and standard errors of realisations (3, I, V, L), of which there are at least two."""
    values = np.stack(realisations)
    return SurfaceEstimate(values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(len(values)))


class SurfaceFit(NamedTuple):
    """Parameters of a model that suit a surface, and the factor in front of it."""

    parameters: dict[str, float]
    factor: float = 1.0


def fitted(comparison: ComparedModel, slope: float, estimate: SurfaceEstimate) -> SurfaceFit:
    """Return the parameters that suit a surface: those of its slope, or those of the least squares."""
    from scipy.optimize import minimize_scalar

    columns = _columns(comparison)
    rays = estimate.against(comparison.bounces, columns)[0]
    counted = _counted(rays)

    def ratios(value: float) -> Floats:
        """Return model over rays in the directions that are counted."""
        return (_model(comparison, slope, dict.fromkeys(comparison.parameters, value), columns) / rays)[counted]

    def factor(ratio: Floats) -> float:
        return float(np.exp(-np.log(ratio).mean())) if comparison.factor else 1.0

    def cost(value: float) -> float:
        # In place of the relative error, which has no bound above: the tails of a lobe would decide alone
        ratio = ratios(value)
        ratio *= factor(ratio)
        return float((((ratio - 1.0) / (ratio + 1.0)) ** 2).sum())

    if comparison.per_slope is not None:
        value = comparison.per_slope * slope
    elif comparison.parameters:
        best = minimize_scalar(cost, bounds=comparison.bounds, method="bounded", options={"xatol": 1e-4}).x
        value = min(float(best), *comparison.bounds, key=cost)  # the search stops short of an end
    else:
        return SurfaceFit({})
    return SurfaceFit(dict.fromkeys(comparison.parameters, value), factor(ratios(value)))


def rows(comparison: ComparedModel, slope: float, estimate: SurfaceEstimate, fit: SurfaceFit) -> list[dict[str, Any]]:
    """Return the errors of a model at a slope as rows of the file: a row for each albedo, if they depend on it.

    `median`, `p95` and `worst` are of the absolute relative error of each light, over the viewers that are counted.
    `towards_light` and `forward` are means of the signed error within 30 degrees of azimuth of the half planes of the
    light and of its mirror direction, from a theta_r of 30 degrees on; None where no viewer is counted. `noise` is the
    root mean square of the relative standard error of the rays, which is not subtracted. It is rounded up to a
    thousandth, because errors are rounded to it.
    """
    result = []
    seen = viewers(comparison.facets, slope)
    azimuth = np.degrees(np.arctan2(np.abs(seen[..., 1]), seen[..., 0]))
    low = np.degrees(np.arccos(np.minimum(seen[..., 2], 1.0))) >= _FORWARD_DEG
    for column in _columns(comparison):
        rays, error = (part[..., 0] for part in estimate.against(comparison.bounces, [column]))
        model = fit.factor * _model(comparison, slope, fit.parameters, [column])[..., 0]
        counted = _counted(rays[..., np.newaxis])[..., 0]
        relative = np.where(counted, model / rays - 1.0, np.nan)
        absolute = np.abs(relative)
        noise = np.sqrt(np.nanmean(np.where(counted, (error / rays) ** 2, np.nan), axis=1))
        parameters = {**fit.parameters, **({"factor": fit.factor} if comparison.factor else {})}
        result.append(
            {
                "slope": slope,
                "rho": RHOS[column] if comparison.by_rho else None,
                "parameters": {name: float(f"{value:.4g}") for name, value in parameters.items()},
                "median": _listed(np.nanmedian(absolute, axis=1)),
                "p95": _listed(np.nanpercentile(absolute, 95.0, axis=1)),
                "worst": _listed(np.nanmax(absolute, axis=1)),
                "towards_light": _means(np.where(low & (azimuth <= _FORWARD_DEG), relative, np.nan)),
                "forward": _means(np.where(low & (azimuth >= 180.0 - _FORWARD_DEG), relative, np.nan)),
                "noise": _listed(np.ceil(1e3 * noise) / 1e3),
            }
        )
    return result


def document(
    estimates: Mapping[tuple[FacetKind, float], SurfaceEstimate], provenance: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the content of model_errors.json from the estimates of all kinds of facets and slopes.

    `rows` compare a model with the bounces that it states, and with the parameters that `words` describes. The lists
    under `also` are other comparisons: with all bounces, and with other parameters.
    """
    models = {}
    for name, comparison in COMPARISONS.items():
        by_slope = {slope: estimates[comparison.facets, slope] for slope in SLOPES}
        quoted = [
            row
            for slope, estimate in by_slope.items()
            for row in rows(comparison, slope, estimate, fitted(comparison, slope, estimate))
        ]
        if comparison.facets == "diffuse" and comparison.parameters:
            quoted = [*_flat(quoted), *quoted]
        also = [
            {"words": words, "rows": _short(other, by_slope, suited)} for words, other, suited in _others(comparison)
        ]
        models[name] = {
            "model": comparison.model,
            "arguments": dict(comparison.arguments),
            "surface": "gaussian",
            "bounces": comparison.bounces,
            **({"only_fit": True} if comparison.only_fit else {}),
            "words": described(comparison),
            "rows": quoted,
            **({"also": also} if also else {}),
        }
    return {"version": VERSION, "provenance": dict(provenance), "lights_deg": list(LIGHTS_DEG), "models": models}


def _others(comparison: ComparedModel) -> Iterator[tuple[str, ComparedModel, ComparedModel | None]]:
    """Yield further comparisons of a model, with their descriptions, and the comparison that gives the parameters."""
    if comparison.facets == "mirror":
        for mirror in MIRRORS:
            yield f"all bounces, {mirror}", replace(comparison, bounces="all", mirror=mirror), comparison
        return
    if comparison.bounces != "all":
        yield f"all bounces, albedos {listed(MAPPED)}", replace(comparison, bounces="all", by_rho=True), comparison
    if comparison.per_slope is not None:
        yield f"{comparison.parameters[0]} {_BEST}", replace(comparison, per_slope=None), None


def _short(
    comparison: ComparedModel, estimates: Mapping[float, SurfaceEstimate], suited: ComparedModel | None
) -> list[dict[str, Any]]:
    """Return a row for each slope: the median over lights and albedos of `median`, and the largest `p95`.

    The parameters are those of the comparison `suited`, or else of this one, which are in the rows.
    """
    short = []
    for slope, estimate in estimates.items():
        whole = rows(comparison, slope, estimate, fitted(suited or comparison, slope, estimate))
        median, p95 = np.median([row["median"] for row in whole]), np.max([row["p95"] for row in whole])
        parameters = {} if suited else {"parameters": whole[0]["parameters"]}
        short.append({"slope": slope, **parameters, "median": round(float(median), 3), "p95": float(p95)})
    return short


def _flat(rows: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield rows of slope 0, where diffuse models are exact, in place of those of the first slope."""
    for row in rows:
        if row["slope"] == SLOPES[0]:
            zeros = {name: [0.0] * len(LIGHTS_DEG) for name, values in row.items() if isinstance(values, list)}
            yield {**row, **zeros, "slope": 0.0, "parameters": dict.fromkeys(row["parameters"], 0.0)}


def _listed(values: Floats, decimals: int = 3) -> list[float | None]:
    """Return numbers with two digits, and at most so many decimals; None for nan, and 0 for 0.0, which is shorter."""
    return [None if np.isnan(value) else round(float(f"{value:.2g}"), decimals) or 0 for value in values]


def _means(values: Floats) -> list[float | None]:
    """Return the mean of the finite values of each row (I, V); None where there is none."""
    rows = (row[np.isfinite(row)] for row in values)
    return _listed(np.array([row.mean() if row.size else np.nan for row in rows]), 2)


def _columns(comparison: ComparedModel) -> list[int]:
    """Return the numbers of the albedos that a fit takes together, or of the mirror."""
    if comparison.facets == "mirror":
        return [list(MIRRORS).index(comparison.mirror)]
    return [RHOS.index(rho) for rho in MAPPED] if comparison.by_rho else [len(RHOS) - 1]


def _model(comparison: ComparedModel, slope: float, parameters: Mapping[str, float], columns: list[int]) -> Floats:
    """Return f_r [1/sr] of a model at columns: albedos of Lambertian facets, or mirrors (I, V, columns)."""
    wi = lights()[:, np.newaxis, np.newaxis]
    wr = viewers(comparison.facets, slope)[:, :, np.newaxis]
    facets = {"rho": np.array(RHOS)[columns]}
    if comparison.facets == "mirror":
        facets = {"n": _N[columns], "k": _K[columns]}
    return np.asarray(MODELS[comparison.model].vectors(wi, wr, **comparison.arguments, **parameters, **facets))


def _counted(f_r: Floats) -> NDArray[np.bool_]:
    """Return which directions (I, V, columns) have an f_r above a hundredth of the peak of their light."""
    return np.asarray(f_r > _COUNTED * f_r.max(axis=1, keepdims=True))
