"""Fits of models to samples: parameters with intervals, the remaining error, and a ranking."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.fitting.document import (
    ALBEDO_ANGLES_DEG,
    ALBEDO_TOLERANCE,
    Estimate,
    Fit,
    FitAlbedo,
    Fits,
    HeldOutIncidences,
    Outlier,
    UnusedSamples,
)
from brdfdb.fitting.estimates import correlations_of, estimates_of, nuisance_estimates
from brdfdb.fitting.judgement import judged, with_nuisance
from brdfdb.fitting.nuisance import NuisanceKind, kinds_of
from brdfdb.fitting.residuals import CREDIBLE, Kind, Residual
from brdfdb.fitting.search import FAR, LEAST_SCALE, FittedSurface, incidence_groups, searched
from brdfdb.fitting.surface import ASSUMED_NM, NotDescribedError, SearchedSurface, fitted_by_default
from brdfdb.geometry import degrees, radians
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.materials import Material, written_name
from brdfdb.materials.provenance import MOST_NAME
from brdfdb.materials.recipe_text import rounded, toml_of
from brdfdb.measurements import Samples
from brdfdb.measurements.aperture import RESOLVED
from brdfdb.measurements.measured_source import slug
from brdfdb.models import MODELS
from brdfdb.parameters import Floats

Mask = NDArray[np.bool_]

_MANY = 0.02  # share of the samples above which the outliers of every fit are no accident
_REACHED = 0.1  # share of f_r that a fit must reach at nearly all samples
_NEARLY_ALL = 5.0  # percentage of the samples that may be below that share
_LISTED = 20  # largest number of outliers in the document
INTERRUPTED = "the search was interrupted"  # reason of a model that was not fitted
_NOTED = 12  # numbers whose intervals the note of a material has
_MOST_ANGLES = 4  # largest number of theta_i of the samples at which the albedo is computed
_NARROW = 0.05  # width of a lobe, in slopes, below which usual apertures change it
_UNEVEN = 3.0  # largest ratio of relative uncertainties, at the ends of the middle 90 %, without a remark
_LEFT_OUT = 0.01  # largest share of values that are not positive without a remark
_SAME_AZIMUTH = 0.01  # degrees
ONE_AZIMUTH = (
    "The light comes from one azimuth of the surface, so anisotropy cannot be determined, and models with two widths "
    "are fitted with one."
)


def fit(
    samples: Samples,
    model: str,
    *,
    residual: Kind = "noise",
    refractive_index: str | None = None,
    nuisance: Sequence[NuisanceKind] = (),
) -> FittedSurface:
    """Fit a model, or a sum of models, to samples.

    Parameters
    ----------
    samples : Samples
        f_r at some directions; the more incidences, the better.
    model : str
        A name in `brdfdb.models.MODELS`, or several joined by +, such as "A + 2 B": a sum of three terms, each with a
        scale.
    residual : {"noise", "log", "relative", "cosine", "uncertainty"}
        What is made small, as `brdfdb.fitting.residuals.Residual` has it.
    refractive_index : str, optional
        For models with n and k, the entry ``shelf/book/page`` that has them. Without one they are searched.
    nuisance : sequence of {"tilt", "drift", "dark"}
        Errors of the measurement that are fitted as well, as `brdfdb.fitting.nuisance.Nuisance` has them.

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
    turned = _sees_anisotropy(samples)
    surface = SearchedSurface(
        model, samples.wavelength_nm, len(samples.channels), turned=turned, entry=refractive_index
    )
    fitted = searched(samples, surface, residual)
    return with_nuisance(fitted, kinds_of(nuisance)) if nuisance else fitted


def fits(
    samples: Samples,
    models: Sequence[str] | None = None,
    *,
    residual: Kind = "noise",
    refractive_index: str | None = None,
    nuisance: Sequence[NuisanceKind] = (),
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
    residual, refractive_index, nuisance
        As of `fit`.
    profiles : bool
        True to correct the intervals of the best fit: by profiles where the covariance misleads, by incidences left out
        in turn where residuals are correlated, and by fits with nuisance numbers or other residuals where residuals
        show a pattern.
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
    kinds = kinds_of(nuisance)
    one_fit = partial(fit, samples, residual=residual, refractive_index=refractive_index, nuisance=kinds)
    unordered, skipped = _fitted_models(models, one_fit, samples.name, tick, keep_finished)
    interrupted = INTERRUPTED in skipped.values()
    shared = _shared_outliers(unordered)
    # by the held-out error to three digits, then by BIC, which outliers hardly change
    ranked = sorted(((_document(fitted, shared), fitted) for fitted in unordered), key=lambda pair: _rank(pair[0]))
    records, surfaces = [record for record, _ in ranked], [fitted for _, fitted in ranked]
    if profiles and not interrupted:
        try:
            tick("intervals")
            records[0] = _judged(*ranked[0])
        except KeyboardInterrupt:
            if not keep_finished:
                raise
            interrupted = True
    sigmas = _sigmas(surfaces[0])
    indexed = any(fitted.surface.indexed for fitted in surfaces)
    document = Fits(
        **_on_samples(samples, counting),
        assumed_wavelength_nm=ASSUMED_NM if indexed and samples.wavelength_nm is None else None,
        residual=residual,
        refractive_index=refractive_index,
        nuisance=list(kinds),
        ranked_by="BIC" if records[0].held_out is None else "held-out rms of ln",
        fits=records,
        outliers=_outliers(surfaces[0], sigmas),
        outlier_count=int(np.count_nonzero(np.abs(sigmas) > FAR)),
        shared_outlier_count=int(shared.sum()),
        skipped=skipped,
        interrupted=interrupted,
    )
    return document, surfaces


def _on_samples(samples: Samples, counting: Residual) -> dict[str, Any]:
    """Return the entries of the document on the samples, and on those that count."""
    return {
        "name": samples.name,
        "provenance": samples.provenance,
        "samples": counting.count,
        "incidences": int(np.unique(samples.incidence).size),
        "channels": list(samples.channels),
        "wavelengths_nm": None if samples.wavelength_nm is None else samples.wavelength_nm.tolist(),
        "source_solid_angle_sr": samples.instrument.source_solid_angle_sr,
        "receiver_solid_angle_sr": samples.instrument.receiver_solid_angle_sr,
        "left_out": UnusedSamples(
            below_horizon=int(samples.record.get("below_the_horizon", 0)),
            holes=counting.holes,
            at_horizon=counting.at_horizon,
            unusable=counting.left_out,
        ),
        "remarks": _remarks_on_samples(samples, counting),
    }


def _fitted_models(
    models: Sequence[str] | None,
    one_fit: Callable[[str], FittedSurface],
    name: str,
    tick: Callable[[str], None],
    keep_finished: bool,
) -> tuple[list[FittedSurface], dict[str, str]]:
    """Return the fits of all models that can describe the samples, and by name the reasons that others are skipped."""
    finished: list[FittedSurface] = []
    skipped: dict[str, str] = {}
    tried = fitted_by_default() if models is None else models
    for number, model in enumerate(tried):
        try:
            tick(model)
            fitted = one_fit(model)
            fitted.predicted  # noqa: B018, computed here: it takes as long as a fit
            finished.append(fitted)
        except NotDescribedError as error:
            if models is not None and len(models) == 1:
                raise
            skipped[model] = error.sentence
        except KeyboardInterrupt:
            if not (keep_finished and finished):
                raise
            skipped |= dict.fromkeys(tried[number:], INTERRUPTED)
            break
    if not finished:
        raise ParameterError("model", f"no model can describe {name}: {next(iter(skipped.values()))}")
    if models is None:
        slow = "its values are integrals, which take minutes; name it to fit it"
        skipped |= {model: slow for model in MODELS if model not in tried}
    _check_reach(finished)
    return finished, skipped


def _check_reach(every: Sequence[FittedSurface]) -> None:
    """Raise ParameterError if f_r of the samples is larger than that of every model."""
    for fitted in every:
        logs = fitted.logarithms[np.isfinite(fitted.logarithms)]
        if not logs.size or np.percentile(logs, 100.0 - _NEARLY_ALL) > np.log(_REACHED):
            return
    samples = every[0].samples
    median = float(np.nanmedian(samples.values))
    text = f"{samples.name} has a median f_r of {median:.3g} /sr, and no model reaches these values; check their unit"
    raise ParameterError("samples", text, median)


def _shared_outliers(every: Sequence[FittedSurface]) -> Mask:
    """Return the samples (N, C) that are far from every fit; none where they are too many to be accidents."""
    of_fits = [np.abs(_sigmas(fitted)) > FAR for fitted in every]
    hidden = [fitted.hidden[:, np.newaxis] for fitted in every]
    far = np.any(of_fits, axis=0) & np.all([a | b for a, b in zip(of_fits, hidden, strict=True)], axis=0)
    return far if far.sum() <= max(_MANY * every[0].samples.known.sum(), 1.0) else np.zeros_like(far)


def _rank(record: Fit) -> tuple[float, float]:
    return float(f"{record.held_out.rms:.3g}") if record.held_out else 0.0, record.bic


def _document(fitted: FittedSurface, shared: Mask) -> Fit:
    """Return the record of a fit, with intervals of its covariance."""
    logs = fitted.logarithms[np.isfinite(fitted.logarithms) & ~shared]
    used = fitted.problem.residual.count
    numbers = len(fitted.problem.searched) + fitted.point.values.size
    deviance = used * float(np.log(max(2.0 * fitted.point.cost / used, 1e-300))) + _of_scale(fitted)
    estimates = estimates_of(fitted, profiles=False)
    material, recipe = _material_of(fitted, estimates)
    record = Fit(
        model=fitted.surface.name,
        estimates=estimates,
        rms_ln=float(np.sqrt(np.mean(logs**2))) if logs.size else None,
        median_ln=float(np.median(np.abs(logs))) if logs.size else None,
        sigma=fitted.sigma,
        held_out=_held_out(fitted, shared),
        numbers=numbers,
        aic=deviance + 2.0 * (numbers + 1),
        bic=deviance + (numbers + 1) * float(np.log(used)),
        pattern=fitted.pattern,
        at_mirror=int(np.sum(fitted.hidden)),
        albedo=_albedo_of(fitted),
        correlations=correlations_of(fitted),
        remarks=[],
        nuisance=nuisance_estimates(fitted),
        noise_floor=None if fitted.residual.noise is None else fitted.residual.noise.level,
        material=material,
        recipe=recipe,
    )
    return record.model_copy(update={"remarks": _remarks_of(record, fitted)})


def _of_scale(fitted: FittedSurface) -> float:
    """Return what makes the cost of a residual with a floor comparable to that of logarithms: -2 ln of its slopes."""
    if fitted.residual.noise is None:
        return 0.0
    used, y = fitted.problem.residual.used, fitted.problem.residual.truth
    sizes = np.log(np.hypot(y[used], fitted.residual.noise.level))
    return 2.0 * float(np.sum(sizes) - np.sum(np.log(y[used & (y > 0.0)])))


def _judged(record: Fit, fitted: FittedSurface) -> Fit:
    """Return the record of a fit with intervals that can be believed, and with what makes them wide."""
    judgement = judged(fitted)
    material, recipe = _material_of(fitted, judgement.estimates)
    believed = {**judgement._asdict(), "material": material, "recipe": recipe}
    del believed["sentences"]
    return record.model_copy(update={**believed, "remarks": [*judgement.sentences, *record.remarks]})


def _sigmas(fitted: FittedSurface) -> Floats:
    """Return the residuals (N, C) of all samples over their robust standard deviation; 0 where they do not count."""
    counts = fitted.residual.used & ~fitted.hidden[:, np.newaxis]
    of_all = fitted.residual.of(fitted.readings) / max(fitted.sigma, LEAST_SCALE)
    return np.asarray(np.where(counts, of_all, 0.0))


def _outliers(fitted: FittedSurface, sigmas: Floats) -> list[Outlier]:
    """Return the samples that are far from a fit, the farthest first."""
    samples = fitted.samples
    f_r = fitted.readings
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


def _held_out(fitted: FittedSurface, outliers: Mask) -> HeldOutIncidences | None:
    """Return the error at incidences that were left out, less outliers (N, C); None if nothing was predicted."""
    errors, samples = fitted.predicted, fitted.samples
    if errors is None:
        return None
    counts = np.isfinite(errors) & ~outliers
    groups = [rows for rows in incidence_groups(samples) if counts[rows].any()]
    if not groups:
        return None
    together = errors[counts]
    return HeldOutIncidences(
        theta_i_deg=[np.unique(np.round(degrees(samples.theta_i[rows]), 3)).tolist() for rows in groups],
        rms_ln=[float(np.sqrt(np.mean(errors[rows][counts[rows]] ** 2))) for rows in groups],
        rms=float(np.sqrt(np.mean(together**2))),
        median=float(np.median(np.abs(together))),
    )


def _material_of(fitted: FittedSurface, estimates: Sequence[Estimate]) -> tuple[Material | None, str | None]:
    """Return a fit as a material and its text in a recipe; None for a sum, and for colours without wavelengths.

    Its note has the intervals, and says where a wavelength was assumed. Reflectances of samples with a wavelength are
    spectra, also of one wavelength: the material holds there only.
    """
    surface, point, samples = fitted.surface, fitted.point, fitted.samples
    at = samples.wavelength_nm
    several = len(samples.channels) > 1
    if len(surface.terms) > 1 or (several and at is None):
        return None, None
    spec = surface.terms[0].spec
    origin = f"fitted to {samples.name}"
    (numbers,) = surface.numbers(point.x)
    columns = {one.name: row for one, row in zip(surface.coefficients, point.values, strict=True)}
    values: dict[str, Any] = {}
    for parameter in spec.parameters:
        row = columns.get(parameter.name)
        if at is not None and parameter.reflectance and (row is not None or not several):
            spectrum = [numbers[parameter.name]] if row is None else row.tolist()
            spectrum = [rounded(value) for value in spectrum]
            values[parameter.name] = {"wavelengths_nm": at.tolist(), "values": spectrum, "origin": origin}
        elif row is not None and several:
            return None, None  # an amplitude that is no reflectance has no spectrum
        else:
            value = numbers[parameter.name] if row is None else float(row[0])
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
    notes = []
    if at is not None and not (spec.spectral or spectra):
        notes.append(f"fitted at {at[0]:g} nm; the model is grey, and its numbers hold at this wavelength only")
    if spec.spectral and at is None:
        notes.append(f"fitted at an assumed wavelength of {ASSUMED_NM:g} nm, as the samples state none")
    intervals = [
        f"{one.name}{'' if one.channel is None else f' ({one.channel})'} {one.low:.4g} to {one.high:.4g}"
        for one in estimates[:_NOTED]
    ]
    table["note"] = "; ".join([*notes, f"95 % intervals: {', '.join(intervals)}"])
    table["parameters"] = values
    name = slug(f"{samples.name}-as-{spec.name}")[:MOST_NAME].rstrip("-")
    return Material.from_table(name, table), toml_of(name, table)


def _albedo_of(fitted: FittedSurface) -> FitAlbedo:
    """Return the largest directional albedo [1] of a fit with its specular part, at some angles of the light.

    The channel is that with the largest f_r at the samples. Polar angles of the light are 0 to 85 degrees, and some of
    those of the samples. The azimuth is 0.
    """
    surface, point, samples = fitted.surface, fitted.point, fitted.samples
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


def _sees_anisotropy(samples: Samples) -> bool:
    """Return True if the light comes from azimuths that are neither the same nor half a turn apart.

    Half a turn of the surface changes no lobe of two widths.
    """
    phi = degrees(samples.phi_i[samples.theta_i > 0.0])
    apart = np.abs((phi - phi[:1] + 90.0) % 180.0 - 90.0)
    return bool(np.any(apart > _SAME_AZIMUTH))


def _remarks_of(fit: Fit, fitted: FittedSurface) -> list[str]:
    """Return sentences on apertures, an albedo above 1, ends of ranges, and pairs of numbers."""
    surface, samples = fitted.surface, fitted.samples
    width = float(np.min(surface.widths(fitted.point.x[np.newaxis]), initial=math.inf))
    half_angle = fitted.view.half_angle
    sentences = []
    if fit.at_mirror:
        sentences.append(
            f"{fit.at_mirror} samples near the mirror direction are left out, because the model has a specular part "
            "there and the solid angle of the receiver is not known."
        )
    if half_angle and width < RESOLVED * half_angle:
        sentences.append(
            f"Its lobe is narrower than an aperture of {2.0 * float(degrees(half_angle)):.3g} degrees resolves: "
            "the width is an upper limit."
        )
    if not half_angle and width < _NARROW:
        sentences.append(
            f"Its lobe has a width of {width:.2g} in slopes, and no solid angle of the receiver is known: an opening "
            f"that is not much smaller than {float(degrees(width)):.2g} degrees has widened it."
        )
    if not fit.albedo.conserves:
        sentences.append(
            f"It reflects {100.0 * fit.albedo.value:.3g} % of the light from {fit.albedo.theta_i_deg:g} degrees: more "
            "than arrives."
        )
    ends = [
        f"{one.name} = {one.value:.4g}" + (f" ({one.channel})" if one.channel else "")
        for one in fit.estimates
        if one.standard_error is None
    ]
    if ends:
        more = f" and {len(ends) - 4} more" if len(ends) > 4 else ""
        sentences.append(f"At an end of its range, without a standard error: {', '.join(ends[:4])}{more}.")
    sentences += [pair.sentence for pair in fit.correlations]
    if surface.indexed and samples.wavelength_nm is None:
        lengths = any(p.unit == "µm" for term in surface.terms for p in term.free)
        end = ", and lengths scale with it." if lengths else "."
        assumed = f"it is fitted at an assumed wavelength of {ASSUMED_NM:g} nm"
        sentences.append(f"The samples state no wavelength: {assumed}{end}")
    if len(surface.terms) > 1:
        sentences.append("A sum is not a model of the registry; a table of it needs a source that is a function.")
    return sentences


def _remarks_on_samples(samples: Samples, residual: Residual) -> list[str]:
    """Return sentences on missing azimuths of the light, on uncertainties, and on files that contradict each other."""
    sentences = [] if _sees_anisotropy(samples) else [ONE_AZIMUTH]
    sentences += _on_uncertainties(samples, residual)
    if "contradiction" in samples.record:
        sentences.append(str(samples.record["contradiction"]))
    return sentences


def _on_uncertainties(samples: Samples, residual: Residual) -> list[str]:
    """Return a sentence on uncertainties that are not credible, or that the residual does not use."""
    if residual.raised:
        verb = "uncertainty is" if residual.raised == 1 else "uncertainties are"
        return [
            f"{residual.raised} {verb} below {100.0 * CREDIBLE:g} % of the median and of the median relative to f_r; "
            "the lower of the two is used instead."
        ]
    if residual.kind == "uncertainty" or samples.uncertainty is None:
        return []
    stated, sizes = samples.uncertainty[residual.used], np.abs(samples.values[residual.used])
    if not np.all((stated > 0.0) & np.isfinite(stated)):
        return []
    advice = "--residual uncertainty weights samples by what is stated."
    low, high = np.percentile(stated[sizes > 0.0] / sizes[sizes > 0.0], [5.0, 95.0]) if sizes.any() else (1.0, 1.0)
    if high > _UNEVEN * low:
        return [
            f"The stated uncertainty is {100.0 * low:.2g} to {100.0 * high:.2g} % of f_r at 90 % of the samples, and "
            f"the residual {residual.kind} does not follow it: intervals may miss the truth. {advice}"
        ]
    if residual.left_out > _LEFT_OUT * (residual.count + residual.left_out):
        return [
            f"{residual.left_out} values that are not positive are left out, so the other values are too high on "
            f"average. {advice}"
        ]
    return []
