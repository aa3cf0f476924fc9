"""Fits of models to samples: parameters with intervals, the remaining error, and a ranking."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.fitting.document import (
    ALBEDO_ANGLES_DEG,
    ALBEDO_TOLERANCE,
    Fit,
    FitAlbedo,
    Fits,
    HeldOutIncidences,
    Outlier,
    UnusedSamples,
)
from brdfdb.fitting.estimates import correlations_of, estimates_of
from brdfdb.fitting.fitted import FittedSurface
from brdfdb.fitting.problem import Point, Problem
from brdfdb.fitting.remarks import remarks_of, remarks_on_samples, sees_anisotropy
from brdfdb.fitting.residuals import Kind, Residual, logarithms
from brdfdb.fitting.surface import ASSUMED_NM, NotDescribedError, SearchedSurface, fitted_by_default
from brdfdb.geometry import degrees, radians, versine
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.materials import Material, written_name
from brdfdb.materials.provenance import MOST_NAME
from brdfdb.materials.recipe_text import rounded, toml_of
from brdfdb.measurements import Samples
from brdfdb.measurements.aperture import InstrumentView
from brdfdb.measurements.measured_source import slug
from brdfdb.models import MODELS
from brdfdb.parameters import Floats

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ROBUST = 3.0  # size of a residual [robust standard deviations] above which it counts less than squared
FAR = 6.0  # size of the residual of an outlier [robust standard deviations]
MAD = 1.4826  # standard deviation of normal noise over the median of its size
_MANY = 0.02  # share of the samples above which the outliers of every fit are no accident
_REACHED = 0.1  # share of f_r that a fit must reach at nearly all samples
_NEARLY_ALL = 5.0  # percentage of the samples that may be below that share
_LISTED = 20  # largest number of outliers in the document
_SETTLED = 0.05  # relative change of the scale that ends the iterations
_SCALES = 4  # largest number of iterations of the scale
_EVALUATIONS = 60  # evaluations of a descent at all samples
_HELD_OUT_EVALUATIONS = 40  # evaluations of a descent without one group of incidences
_LEAST_SCALE = 1e-9  # scale of noise-free samples
INTERRUPTED = "the search was interrupted"  # reason of a model that was not fitted
_NEAR_MIRROR = float(radians(3.0))  # angle from the mirror direction within which apertures may catch a specular part
_COUNTS = 0.01  # share of f_r that a specular part must add in an aperture of that half angle to count
GROUPS = 8  # largest number of groups of incidences; fewer incidences are left out one at a time
_MOST_ANGLES = 4  # largest number of theta_i of the samples at which the albedo is computed


def fit(samples: Samples, model: str, *, residual: Kind = "log", refractive_index: str | None = None) -> FittedSurface:
    """Fit a model, or a sum of models, to samples.

    Parameters
    ----------
    samples : Samples
        f_r at some directions; the more incidences, the better.
    model : str
        A name in `brdfdb.models.MODELS`, or several joined by +, such as "A + 2 B": a sum of three terms, each with a
        scale.
    residual : {"log", "relative", "cosine", "uncertainty"}
        What is made small, as `brdfdb.fitting.residuals.Residual` has it.
    refractive_index : str, optional
        For models with n and k, the entry ``shelf/book/page`` that has them. Without one they are searched.

    Returns
    -------
    FittedSurface
        The best point.

    Raises
    ------
    ParameterError
        If a name is unknown, or no sample counts.
    NotDescribedError
        If the model cannot describe such samples: an anisotropic one without azimuths of the light, a spectrum of what
        is no polynomial, n and k of several channels.

    Notes
    -----
    The cost is the sum of s^2 rho((r / s)^2) / 2 over the residuals r, with rho(z) = 2 (sqrt(1 + z) - 1): squares of
    small residuals, sizes of large ones. s is three robust standard deviations of the residuals, and follows them. All
    numbers stay within the ranges of the model. Coefficients in which f_r is a polynomial, such as reflectances, have a
    value for each channel and are solved for at every shape (variable projection); the shape is shared.

    Where the instrument of the samples has solid angles, lobes are averaged over them, and a specular part within them
    is added (`brdfdb.measurements.aperture.InstrumentView`). Where it has none, samples near the mirror direction are
    left out if the specular part of the fit counts there.

    References
    ----------
    golubpereyra1973

    Examples
    --------
    >>> import numpy as np
    >>> from brdfdb.materials import presets
    >>> from brdfdb.measurements import Samples
    >>> theta_i, theta_r = np.repeat([0.3, 0.9], 40), np.tile(np.linspace(0.0, 1.3, 40), 2)
    >>> phi_i, phi_r = np.zeros(80), np.full(80, np.pi)
    >>> f_r = presets()["clay-vase"].lookup(theta_i, phi_i, theta_r, phi_r)[:, np.newaxis]
    >>> fitted = fit(Samples("clay", theta_i, phi_i, theta_r, phi_r, ("grey",), None, f_r), "oren_nayar")
    >>> print(np.round(fitted.point.values, 3))
    [[0.7]]
    """
    turned = sees_anisotropy(samples)
    surface = SearchedSurface(
        model, samples.wavelength_nm, len(samples.channels), turned=turned, entry=refractive_index
    )
    fitted = _searched(samples, surface, residual, np.zeros(len(samples), dtype=np.bool_))
    hidden = _hidden(fitted)
    if hidden.any() and np.any(fitted.problem.residual.used[~hidden[fitted.rows]]):
        return _searched(samples, surface, residual, hidden)
    return fitted


def _searched(samples: Samples, surface: SearchedSurface, residual: Kind, hidden: Mask) -> FittedSurface:
    """Return the best point of a surface at the samples that count and are not hidden."""
    counting = Residual(samples, residual)
    rows = np.flatnonzero(counting.used.any(axis=1) & ~hidden)
    view = InstrumentView(samples.w_i[rows], samples.w_r[rows], samples.instrument)
    problem = Problem(surface, view, counting.selected(rows))
    point = problem.best()
    sigma = _sigma(problem, point)
    for _ in range(_SCALES):
        problem.scale = max(ROBUST * sigma, _LEAST_SCALE)
        point = problem.descend(point.x[problem.free], _EVALUATIONS)
        last = sigma
        sigma = _sigma(problem, point)
        if abs(sigma - last) <= _SETTLED * last:
            break
    return FittedSurface(samples, problem, point, sigma, rows, hidden)


def _hidden(fitted: FittedSurface) -> Mask:
    """Return the samples (N,) at which a specular part is too large to ignore and the aperture is not known."""
    view = fitted.view
    near = (view.from_mirror < _NEAR_MIRROR) & (view.w_r[:, 2] > 0.0)
    if view.half_angle or not near.any() or all(term.spec.specular is None for term in fitted.surface.terms):
        return np.zeros(len(view), dtype=np.bool_)
    rows = np.flatnonzero(near)
    some = view.selected(rows)
    reflected = fitted.surface.reflected(fitted.point.x, fitted.point.values, some)
    added = reflected / (2.0 * np.pi * versine(np.asarray(_NEAR_MIRROR)) * some.w_r[:, 2:])
    near[rows] = np.any(added > _COUNTS * fitted.seen(some), axis=1)
    return near


def _sigma(problem: Problem, point: Point) -> float:
    return MAD * float(np.median(np.abs(point.residuals[problem.residual.used])))


def fits(
    samples: Samples,
    models: Sequence[str] | None = None,
    *,
    residual: Kind = "log",
    refractive_index: str | None = None,
    profiles: bool = True,
    tick: Callable[[str], None] = lambda _: None,
    keep_finished: bool = False,
) -> tuple[Fits, list[FittedSurface]]:
    """Fit several models to samples and rank them.

    Parameters
    ----------
    samples : Samples
        f_r at some directions.
    models : sequence of str, optional
        Models and sums, by default `brdfdb.fitting.surface.fitted_by_default`.
    residual, refractive_index
        As of `fit`.
    profiles : bool
        True to correct the intervals of the best fit by profiles where the covariance misleads.
    tick : callable
        A function that is called with the name of each model before it is fitted.
    keep_finished : bool
        True to end at Ctrl-C with the models that are finished, if there are any.

    Returns
    -------
    Fits, list of FittedSurface
        The document, and the fits in its order. They are ranked by the root mean square of ln(model / sample) over
        incidences that were left out, or by BIC where the light has one direction. Samples that are outliers of every
        fit do not count in it, unless they are many.

    Raises
    ------
    ParameterError
        If a name is unknown, a model that was named cannot describe the samples, no sample counts, or f_r is so large
        that all fits are below a tenth of it at 95 % of the samples.
    """
    counting = Residual(samples, residual)
    searches, skipped = _searches(samples, models, residual, refractive_index, tick, keep_finished)
    interrupted = INTERRUPTED in skipped.values()
    shared = _shared_outliers([search.fitted for search in searches])
    every = [_document(search, shared) for search in searches]
    # by the held-out error to three digits, then by BIC, which outliers hardly change
    keys = [(float(f"{fit.held_out.rms:.3g}") if fit.held_out else 0.0, fit.bic) for fit in every]
    order = sorted(range(len(every)), key=keys.__getitem__)
    records = [every[index] for index in order]
    surfaces = [searches[index].fitted for index in order]
    if profiles and not interrupted:
        try:
            tick("intervals")
            records[0] = records[0].model_copy(update={"estimates": estimates_of(surfaces[0], profiles=True)})
        except KeyboardInterrupt:
            if not keep_finished:
                raise
            interrupted = True
    sigmas = _sigmas(surfaces[0])
    indexed = any(fitted.surface.indexed for fitted in surfaces)
    document = Fits(
        name=samples.name,
        provenance=samples.provenance,
        samples=counting.count,
        incidences=int(np.unique(samples.incidence).size),
        channels=list(samples.channels),
        wavelengths_nm=None if samples.wavelength_nm is None else samples.wavelength_nm.tolist(),
        assumed_wavelength_nm=ASSUMED_NM if indexed and samples.wavelength_nm is None else None,
        residual=residual,
        refractive_index=refractive_index,
        source_solid_angle_sr=samples.instrument.source_solid_angle_sr,
        receiver_solid_angle_sr=samples.instrument.receiver_solid_angle_sr,
        left_out=UnusedSamples(
            below_horizon=int(samples.record.get("below_the_horizon", 0)),
            holes=counting.holes,
            at_horizon=counting.at_horizon,
            unusable=counting.left_out,
        ),
        remarks=remarks_on_samples(samples, counting),
        ranked_by="BIC" if records[0].held_out is None else "held-out rms of ln",
        fits=records,
        outliers=_outliers(surfaces[0], sigmas),
        outlier_count=int(np.count_nonzero(np.abs(sigmas) > FAR)),
        shared_outlier_count=int(shared.sum()),
        skipped=skipped,
        interrupted=interrupted,
    )
    return document, surfaces


class _FittedModel(NamedTuple):
    """A fit, and ln(model / sample) (N, C) at incidences that were left out in turn; None if the light has one."""

    fitted: FittedSurface
    errors: Floats | None


def _searches(
    samples: Samples,
    models: Sequence[str] | None,
    residual: Kind,
    refractive_index: str | None,
    tick: Callable[[str], None],
    keep_finished: bool,
) -> tuple[list[_FittedModel], dict[str, str]]:
    """Return the fits of all models that can describe the samples, and by name the reasons that others are skipped."""
    searches: list[_FittedModel] = []
    skipped: dict[str, str] = {}
    tried = fitted_by_default() if models is None else models
    for number, model in enumerate(tried):
        try:
            tick(model)
            fitted = fit(samples, model, residual=residual, refractive_index=refractive_index)
            searches.append(_FittedModel(fitted, _predicted(fitted)))
        except NotDescribedError as error:
            if models is not None and len(models) == 1:
                raise
            skipped[model] = error.sentence
        except KeyboardInterrupt:
            if not (keep_finished and searches):
                raise
            skipped |= dict.fromkeys(tried[number:], INTERRUPTED)
            break
    if not searches:
        raise ParameterError("model", f"no model can describe {samples.name}: {next(iter(skipped.values()))}")
    if models is None:
        slow = "its values are integrals, which take minutes; name it to fit it"
        skipped |= {name: slow for name in MODELS if name not in tried}
    _check_reach([search.fitted for search in searches])
    return searches, skipped


def _check_reach(searches: Sequence[FittedSurface]) -> None:
    """Raise ParameterError if f_r of the samples is larger than that of every model."""
    for one in searches:
        logs = one.logarithms[np.isfinite(one.logarithms)]
        if not logs.size or np.percentile(logs, 100.0 - _NEARLY_ALL) > np.log(_REACHED):
            return
    samples = searches[0].samples
    median = float(np.nanmedian(samples.values))
    raise ParameterError(
        "samples",
        f"{samples.name} has a median f_r of {median:.3g} /sr, and no model reaches these values; check their unit",
        median,
    )


def _shared_outliers(searches: Sequence[FittedSurface]) -> Mask:
    """Return the samples (N, C) that are far from every fit; none where they are too many to be accidents."""
    of_fits = [np.abs(_sigmas(one)) > FAR for one in searches]
    hidden = [one.hidden[:, np.newaxis] for one in searches]
    far = np.any(of_fits, axis=0) & np.all([a | b for a, b in zip(of_fits, hidden, strict=True)], axis=0)
    return far if far.sum() <= max(_MANY * searches[0].samples.known.sum(), 1.0) else np.zeros_like(far)


def _document(search: _FittedModel, shared: Mask) -> Fit:
    """Return the record of a fit, with intervals of its covariance."""
    fitted = search.fitted
    logs = fitted.logarithms[np.isfinite(fitted.logarithms) & ~shared]
    used = fitted.problem.residual.count
    searched = len(fitted.problem.free) + fitted.point.values.size
    deviance = used * float(np.log(max(2.0 * fitted.point.cost / used, 1e-300)))
    material, recipe = _material_of(fitted.surface, fitted.point, fitted.samples)
    record = Fit(
        model=fitted.surface.name,
        estimates=estimates_of(fitted, profiles=False),
        rms_ln=float(np.sqrt(np.mean(logs**2))) if logs.size else None,
        median_ln=float(np.median(np.abs(logs))) if logs.size else None,
        sigma=fitted.sigma,
        held_out=_held_out(fitted.samples, search.errors, shared),
        numbers=searched,
        aic=deviance + 2.0 * (searched + 1),
        bic=deviance + (searched + 1) * float(np.log(used)),
        pattern=_pattern(fitted),
        at_mirror=int(np.sum(fitted.hidden)),
        albedo=_albedo_of(fitted.surface, fitted.point, fitted.samples),
        correlations=correlations_of(fitted),
        remarks=[],
        material=material,
        recipe=recipe,
    )
    return record.model_copy(update={"remarks": remarks_of(record, fitted)})


def _pattern(fitted: FittedSurface) -> float:
    """Return the correlation of residuals with those of the nearest other direction."""
    from scipy.spatial import cKDTree

    problem = fitted.problem
    pairs = np.concatenate([problem.view.w_i, problem.view.w_r], axis=1)
    if len(pairs) < 3:
        return 0.0
    nearest = cKDTree(pairs).query(pairs, k=2)[1][:, 1]
    used = problem.residual.used & problem.residual.used[nearest]
    r = np.clip(fitted.point.residuals, -FAR * fitted.sigma, FAR * fitted.sigma)
    size = float(np.sum((r * r)[used]))
    return min(float(np.sum((r * r[nearest])[used]) / size), 1.0) if size > 0.0 else 0.0


def _sigmas(fitted: FittedSurface) -> Floats:
    """Return the residuals (N, C) of all samples over their robust standard deviation; 0 where they do not count."""
    residual = Residual(fitted.samples, fitted.problem.residual.kind)
    counts = residual.used & ~fitted.hidden[:, np.newaxis]
    of_all = residual.of(fitted.seen(fitted.view)) / max(fitted.sigma, _LEAST_SCALE)
    return np.asarray(np.where(counts, of_all, 0.0))


def _outliers(fitted: FittedSurface, sigmas: Floats) -> list[Outlier]:
    """Return the samples that are far from a fit, the farthest first."""
    samples = fitted.samples
    f_r = fitted.seen(fitted.view)
    far = np.argwhere(np.abs(sigmas) > FAR)
    order = np.argsort(-np.abs(sigmas[far[:, 0], far[:, 1]]), kind="stable")[:_LISTED]
    angles = {f"{name}_deg": degrees(getattr(samples, name)) for name in ("theta_i", "phi_i", "theta_r", "phi_r")}
    return [
        Outlier(
            **{name: round(float(values[row]), 6) for name, values in angles.items()},
            channel=samples.channels[column],
            value=float(samples.values[row, column]),
            model=float(f_r[row, column]),
            sigmas=float(sigmas[row, column]),
        )
        for row, column in far[order].tolist()
    ]


def _predicted(fitted: FittedSurface) -> Floats | None:
    """Return ln(model / sample) (N, C) at incidences that were left out in turn; None if the light has one direction.

    Each search begins at the best point for all samples, and fits the remaining samples. More than eight incidences
    are left out in groups of neighbours. Samples that are hidden or not positive have nan.
    """
    samples, surface, view = fitted.samples, fitted.surface, fitted.view
    groups = _groups_of(samples)
    if len(groups) < 2:
        return None
    residual = Residual(samples, fitted.problem.residual.kind)
    counts = residual.used.any(axis=1) & ~fitted.hidden
    errors = np.full(samples.values.shape, np.nan)
    for rows in groups:
        remaining = counts.copy()
        remaining[rows] = False
        if not remaining.any():
            continue
        fitted_rows = np.flatnonzero(remaining)
        part = Problem(surface, view.selected(fitted_rows), residual.selected(fitted_rows))
        part.scale = fitted.problem.scale
        end = part.descend(fitted.point.x[part.free], _HELD_OUT_EVALUATIONS)
        errors[rows] = logarithms(samples.selected(rows), surface.f_r(end.x, end.values, view.selected(rows)))
    errors[fitted.hidden] = np.nan
    return errors


def _held_out(samples: Samples, errors: Floats | None, outliers: Mask) -> HeldOutIncidences | None:
    """Return the error at incidences that were left out, less outliers (N, C); None if nothing was predicted."""
    if errors is None:
        return None
    counts = np.isfinite(errors) & ~outliers
    groups = [rows for rows in _groups_of(samples) if counts[rows].any()]
    if not groups:
        return None
    together = errors[counts]
    return HeldOutIncidences(
        theta_i_deg=[np.unique(np.round(degrees(samples.theta_i[rows]), 3)).tolist() for rows in groups],
        rms_ln=[float(np.sqrt(np.mean(errors[rows][counts[rows]] ** 2))) for rows in groups],
        rms=float(np.sqrt(np.mean(together**2))),
        median=float(np.median(np.abs(together))),
    )


def _groups_of(samples: Samples) -> list[NDArray[np.int64]]:
    """Return the rows of each incidence, or of groups of neighbouring ones, by theta_i and then phi_i."""
    numbers, first = np.unique(samples.incidence, return_index=True)
    order = np.lexsort((samples.phi_i[first], samples.theta_i[first]))
    parts = np.array_split(numbers[order], min(GROUPS, numbers.size))
    return [np.flatnonzero(np.isin(samples.incidence, part)) for part in parts]


def _material_of(surface: SearchedSurface, point: Point, samples: Samples) -> tuple[Material | None, str | None]:
    """Return a fit as a material and its text in a recipe; None for a sum, and for colours without wavelengths.

    Reflectances of samples with a wavelength are spectra, also of one wavelength: the material holds there only.
    """
    at = samples.wavelength_nm
    several = len(samples.channels) > 1
    if len(surface.terms) > 1 or (several and at is None):
        return None, None
    spec = surface.terms[0].spec
    origin = f"fitted to {samples.name}"
    (numbers,) = surface.numbers(point.x)
    values: dict[str, Any] = {}
    for parameter in spec.parameters:
        name = parameter.name
        column = next((i for i, one in enumerate(surface.coefficients) if one.name == name), None)
        if at is not None and parameter.reflectance and (column is not None or not several):
            fitted = [numbers[name]] if column is None else point.values[column].tolist()
            spectrum = [rounded(value) for value in fitted]
            values[name] = {"wavelengths_nm": at.tolist(), "values": spectrum, "origin": origin}
            continue
        if column is not None and several:
            return None, None  # an amplitude that is no reflectance has no spectrum
        value = float(point.values[column, 0]) if column is not None else numbers[name]
        in_file = float(degrees(value)) if parameter.unit == "rad" else value
        values[written_name(parameter)] = value if isinstance(value, bool) else rounded(in_file)
    table: dict[str, Any] = {"title": f"{samples.name}, as {spec.title}", "model": spec.name, "source": origin}
    if surface.searched_index:
        table["refractive_index"] = f"constant/{rounded(numbers['n'])!r}/{rounded(numbers['k'])!r}"
    elif surface.entry is not None and spec.spectral:
        table["refractive_index"] = surface.entry
    spectra = any(isinstance(value, dict) for value in values.values())
    if spec.spectral or spectra:
        table["wavelengths_nm"] = surface.wavelength_nm.tolist()
    elif at is not None:
        table["note"] = f"fitted at {at[0]:g} nm; the model is grey, and its numbers hold at this wavelength only"
    table["parameters"] = values
    name = slug(f"{samples.name}-as-{spec.name}")[:MOST_NAME].rstrip("-")
    return Material.from_table(name, table), toml_of(name, table)


def _albedo_of(surface: SearchedSurface, point: Point, samples: Samples) -> FitAlbedo:
    """Return the largest directional albedo [1] of a fit with its specular part, at some angles of the light.

    The channel is that with the largest f_r at the samples. Polar angles of the light are 0 to 85 degrees, and some of
    those of the samples. The azimuth is 0.
    """
    measured = np.unique(np.round(degrees(samples.theta_i), 3))
    measured = measured[np.linspace(0, measured.size - 1, min(_MOST_ANGLES, measured.size)).round().astype(np.int64)]
    angles = np.union1d(ALBEDO_ANGLES_DEG, measured[measured < 89.0])
    channel = int(np.argmax(np.mean(point.f_r, axis=0)))
    total, error = np.zeros(angles.size), np.zeros(angles.size)
    for number, term in enumerate(surface.terms):
        given, scale = surface.in_channel(point.x, point.values, number, channel)
        if scale <= 0.0:
            continue
        albedo = directional_albedo(
            term.spec, radians(angles), tolerance=ALBEDO_TOLERANCE, specular=term.spec.specular is not None, **given
        )
        total += scale * albedo.albedo
        error += scale * albedo.error
    return FitAlbedo.largest(angles, total, error)
