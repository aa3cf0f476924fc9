"""Fits of models to samples: parameters with intervals, the error that is left, and a ranking."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.fitting.albedo import albedo_of
from brdfdb.fitting.document import Fit, Fits, Left, Outlier
from brdfdb.fitting.estimates import correlations_of, estimates_of
from brdfdb.fitting.fitted import Fitted
from brdfdb.fitting.held_out import held_out, predicted
from brdfdb.fitting.material import material_of
from brdfdb.fitting.problem import Point, Problem
from brdfdb.fitting.remarks import remarks_of, remarks_on_samples, sees_anisotropy
from brdfdb.fitting.residuals import Kind, Residual
from brdfdb.fitting.surface import ASSUMED_NM, NotDescribedError, Surface, fitted_by_default
from brdfdb.geometry import degrees, radians, versine
from brdfdb.measurements import Samples
from brdfdb.measurements.aperture import InstrumentView
from brdfdb.models import MODELS
from brdfdb.parameters import Floats

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ROBUST = 3.0  # robust standard deviations of residuals from which on a sample counts less than squared
FAR = 6.0  # the same, from which on a sample of the best fit is an outlier
MAD = 1.4826  # standard deviation of normal noise over the median of its size
_MANY = 0.02  # share of the samples from which on outliers of every fit are no accident
_REACHED, _NEARLY_ALL = 0.1, 5.0  # share of f_r that a fit must have, at this percentage of the samples
_LISTED = 20  # outliers that are listed
_SETTLED = 0.05  # relative change of the scale that ends the iterations
_SCALES, _EVALUATIONS = 4, 60
_LEAST_SCALE = 1e-9  # of noise-free samples
INTERRUPTED = "the search was interrupted"  # why a model was not fitted
_NEAR_MIRROR = float(radians(3.0))  # angle from the mirror direction within which apertures may catch a specular part
_COUNTS = 0.01  # share of f_r that a specular part adds in an aperture of that half angle, so that it counts


def fit(samples: Samples, model: str, *, residual: Kind = "log", refractive_index: str | None = None) -> Fitted:
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
    Fitted
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
    surface = Surface(model, samples.wavelength_nm, len(samples.channels), turned=turned, entry=refractive_index)
    fitted = _searched(samples, surface, residual, np.zeros(len(samples), dtype=np.bool_))
    hidden = _hidden(fitted)
    if hidden.any() and np.any(fitted.problem.residual.used[~hidden[fitted.rows]]):
        return _searched(samples, surface, residual, hidden)
    return fitted


def _searched(samples: Samples, surface: Surface, residual: Kind, hidden: Mask) -> Fitted:
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
        last, sigma = sigma, _sigma(problem, point)
        if abs(sigma - last) <= _SETTLED * last:
            break
    return Fitted(samples, problem, point, sigma, rows, hidden)


def _hidden(fitted: Fitted) -> Mask:
    """Return the samples at which the specular part of a fit counts, where the aperture is not known, shape (N,)."""
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
) -> tuple[Fits, list[Fitted]]:
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
    Fits, list of Fitted
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
    shared = _shared_outliers([fitted for fitted, _ in searches])
    made = [(_document(fitted, errors, shared), fitted) for fitted, errors in searches]
    by_held_out = made[0][0].held_out is not None
    made.sort(key=lambda one: _rank(one[0]))
    if profiles and not interrupted:
        try:
            tick("intervals")
            made[0] = _profiled(*made[0])
        except KeyboardInterrupt:
            if not keep_finished:
                raise
            interrupted = True
    far, count = _outliers(made[0][1])
    indexed = any(fitted.surface.indexed for _, fitted in made)
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
        left_out=_left_out(samples, counting),
        remarks=remarks_on_samples(samples, counting),
        ranked_by="held-out rms of ln" if by_held_out else "BIC",
        fits=[one for one, _ in made],
        outliers=far,
        outlier_count=count,
        shared_outlier_count=int(shared.sum()),
        skipped=skipped,
        interrupted=interrupted,
    )
    return document, [fitted for _, fitted in made]


def _left_out(samples: Samples, counting: Residual) -> Left:
    """Return the numbers of values that no fit uses, by reason."""
    return Left(
        below_horizon=int(samples.record.get("below_the_horizon", 0)),
        holes=counting.holes,
        at_horizon=counting.at_horizon,
        unusable=counting.left_out,
    )


def _profiled(record: Fit, fitted: Fitted) -> tuple[Fit, Fitted]:
    """Return a fit with the intervals of profiles where the covariance misleads."""
    return record.model_copy(update={"estimates": estimates_of(fitted, profiles=True)}), fitted


def _searches(
    samples: Samples,
    models: Sequence[str] | None,
    residual: Kind,
    refractive_index: str | None,
    tick: Callable[[str], None],
    keep_finished: bool,
) -> tuple[list[tuple[Fitted, Floats | None]], dict[str, str]]:
    """Return the fits of all models that can describe the samples with their errors held out, and why others lack."""
    searches: list[tuple[Fitted, Floats | None]] = []
    skipped: dict[str, str] = {}
    tried = fitted_by_default() if models is None else models
    for number, model in enumerate(tried):
        try:
            tick(model)
            fitted = fit(samples, model, residual=residual, refractive_index=refractive_index)
            searches.append((fitted, predicted(fitted)))
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
        raise ParameterError("model", f"none can describe {samples.name}: {next(iter(skipped.values()))}")
    if models is None:
        slow = "its values are integrals, which take minutes; name it to fit it"
        skipped |= {name: slow for name in MODELS if name not in tried}
    _check_reach([fitted for fitted, _ in searches])
    return searches, skipped


def _check_reach(searches: Sequence[Fitted]) -> None:
    """Raise ParameterError if f_r of the samples is beyond what any of the models can have."""
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


def _shared_outliers(searches: Sequence[Fitted]) -> Mask:
    """Return the samples (N, C) that are far from every fit; none where they are too many to be accidents."""
    of_fits = [np.abs(_sigmas(one)) > FAR for one in searches]
    hidden = [one.hidden[:, np.newaxis] for one in searches]
    far = np.any(of_fits, axis=0) & np.all([a | b for a, b in zip(of_fits, hidden, strict=True)], axis=0)
    return far if far.sum() <= max(_MANY * searches[0].samples.known.sum(), 1.0) else np.zeros_like(far)


def _rank(one: Fit) -> tuple[float, float]:
    """Return what fits are sorted by: the error held out to three digits, then BIC, which outliers hardly change."""
    return (0.0 if one.held_out is None else float(f"{one.held_out.rms:.3g}"), one.bic)


def _document(fitted: Fitted, errors: Floats | None, shared: Mask) -> Fit:
    """Return the record of a fit, with intervals of its covariance."""
    logs = fitted.logarithms[np.isfinite(fitted.logarithms) & ~shared]
    used = fitted.problem.residual.count
    searched = len(fitted.problem.free) + fitted.point.values.size
    deviance = used * float(np.log(max(2.0 * fitted.point.cost / used, 1e-300)))
    albedo = albedo_of(fitted.surface, fitted.point, fitted.samples)
    material, recipe = material_of(fitted.surface, fitted.point, fitted.samples)
    correlations = correlations_of(fitted)
    record = Fit(
        model=fitted.surface.name,
        estimates=estimates_of(fitted, profiles=False),
        rms_ln=float(np.sqrt(np.mean(logs**2))) if logs.size else None,
        median_ln=float(np.median(np.abs(logs))) if logs.size else None,
        sigma=fitted.sigma,
        held_out=held_out(fitted.samples, errors, shared),
        numbers=searched,
        aic=deviance + 2.0 * (searched + 1),
        bic=deviance + (searched + 1) * float(np.log(used)),
        pattern=_pattern(fitted),
        at_mirror=int(np.sum(fitted.hidden)),
        albedo=albedo,
        correlations=correlations,
        remarks=[],
        material=material,
        recipe=recipe,
    )
    return record.model_copy(update={"remarks": remarks_of(record, fitted)})


def _pattern(fitted: Fitted) -> float:
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


def _sigmas(fitted: Fitted) -> Floats:
    """Return the residuals (N, C) of all samples over their robust standard deviation; 0 where they do not count."""
    residual = Residual(fitted.samples, fitted.problem.residual.kind)
    counts = residual.used & ~fitted.hidden[:, np.newaxis]
    of_all = residual.of(fitted.seen(fitted.view)) / max(fitted.sigma, _LEAST_SCALE)
    return np.asarray(np.where(counts, of_all, 0.0))


def _outliers(fitted: Fitted) -> tuple[list[Outlier], int]:
    """Return the samples that are far from a fit, the farthest first, and their number."""
    samples, f_r, sigmas = fitted.samples, fitted.seen(fitted.view), _sigmas(fitted)
    far = np.argwhere(np.abs(sigmas) > FAR)
    order = np.argsort(-np.abs(sigmas[far[:, 0], far[:, 1]]), kind="stable")[:_LISTED]
    listed = [
        Outlier(
            theta_i_deg=_degrees(samples.theta_i[row]),
            phi_i_deg=_degrees(samples.phi_i[row]),
            theta_r_deg=_degrees(samples.theta_r[row]),
            phi_r_deg=_degrees(samples.phi_r[row]),
            channel=samples.channels[column],
            value=float(samples.values[row, column]),
            model=float(f_r[row, column]),
            sigmas=float(sigmas[row, column]),
        )
        for row, column in far[order].tolist()
    ]
    return listed, len(far)


def _degrees(angle: float) -> float:
    return round(float(degrees(angle)), 6)
