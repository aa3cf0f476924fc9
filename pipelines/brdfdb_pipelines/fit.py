"""The fit job: fits models to the samples of files, prints their ranking, and writes JSON, a page and a recipe."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from brdfdb import formats
from brdfdb.errors import BrdfdbError, ParameterError, counted
from brdfdb.fitting.document import Estimate, Fit, Fits
from brdfdb.fitting.figure import figure_of
from brdfdb.fitting.fit import INTERRUPTED, fits
from brdfdb.fitting.residuals import Kind
from brdfdb.fitting.surface import fitted_by_default
from brdfdb.geometry import degrees, radians, versine
from brdfdb.measurements import Samples, joined
from brdfdb.measurements.statement import statement
from brdfdb.parameters import closest
from brdfdb.store.files import write_file
from brdfdb_pipelines import terminal
from brdfdb_pipelines.measured_job import MeasuredTable

_SHOWN = 12  # channels of a number that are printed
TOLERANCE = 0.05  # of the recipe that is written
_WIDEST_DEG = 30.0  # full angle of a cone: wider ones are no directions


def run(
    data: Sequence[Path],
    models: Sequence[str] | None = None,
    *,
    keys: Mapping[str, Any] | None = None,
    residual: Kind = "log",
    channel: str | None = None,
    refractive_index: str | None = None,
    receiver_deg: float | None = None,
    source_deg: float | None = None,
    json: Path | None = None,
    page: Path | None = None,
    recipe: Path | None = None,
) -> Fits:
    """Fit models to the samples of a file, or of several of one surface, and print the result.

    Before the search, what the reader noted and what looks wrong with the samples is printed, as by an import.
    Ctrl-C ends the search. The models that were finished are ranked and written; `Fits.interrupted` is then true.

    Parameters
    ----------
    data : sequence of Path
        Files that `brdfdb.formats.samples` reads. Several are joined, as by `brdfdb.measurements.joined`.
    models : sequence of str, optional
        Models and sums, by default all.
    keys : mapping, optional
        How the files are read: keys of `brdfdb_pipelines.measured_job.MeasuredTable`, `samples` apart.
    residual, refractive_index
        As of `brdfdb.fitting.fit.fits`.
    channel : str, optional
        The one channel that is fitted.
    receiver_deg, source_deg : float [degree], optional
        Full angles of the cones of receiver and light, as the sample sees them, in place of what the file states.
    json, page, recipe : Path, optional
        Files to write: all fits, figures, and the best model of the registry as a recipe.

    Returns
    -------
    Fits
        The document.

    Raises
    ------
    ParameterError
        If a name is unknown, files cannot be joined, or no model can describe the samples.
    KeyboardInterrupt
        If no model was finished.
    BrdfdbError
        If a recipe is asked for and no fit is one model of the registry.
    """
    samples = _seen(_read(data, keys or {}, channel), receiver_deg, source_deg)
    _doubt(samples)
    count = len(models or fitted_by_default()) + 1
    with terminal.progress(transient=True) as bar:
        task = bar.add_task("fit", total=count)

        def tick(name: str) -> None:
            bar.update(task, advance=1, description=name)

        document, fitted = fits(
            samples,
            models,
            residual=residual,
            refractive_index=refractive_index,
            tick=tick,
            keep_finished=True,
        )
    if json is not None:
        write(json, document.model_dump_json(indent=1) + "\n")
    if page is not None:
        from brdfdb_pipelines import fit_page

        write(page, fit_page.render(document, figure_of(document, fitted[0])))
    print(terminal.plain("\n".join(lines(document))))
    if recipe is not None:
        write(recipe, recipe_of(document))
    return document


def _read(data: Sequence[Path], keys: Mapping[str, Any], channel: str | None) -> Samples:
    """Return the samples of files as one, of one channel or of all."""
    table = MeasuredTable(samples=[str(file) for file in data], **keys)
    return joined([_selected(formats.samples(file, table.format, **table.keywords), channel) for file in data])


def _doubt(samples: Samples) -> None:
    """Print what the reader noted and what looks wrong; a contradiction of files is a remark of the fits."""
    known = statement(samples)
    for sentence in (*known.notes, *known.hints):
        if sentence != samples.record.get("contradiction"):
            print(terminal.plain(f"{samples.name}: {sentence}"), flush=True)


def _selected(samples: Samples, channel: str | None) -> Samples:
    """Return the samples of one channel, or of all."""
    if channel is not None:
        if channel not in samples.channels:
            hint = closest(channel, samples.channels)
            raise ParameterError(
                "channel", f"{channel!r} is not one of {', '.join(samples.channels)}{hint}", channel, samples.channels
            )
        column = [samples.channels.index(channel)]
        samples = replace(
            samples,
            channels=(channel,),
            values=samples.values[:, column],
            wavelength_nm=None if samples.wavelength_nm is None else samples.wavelength_nm[column],
            uncertainty=None if samples.uncertainty is None else samples.uncertainty[:, column],
            bandwidth_nm=None if samples.bandwidth_nm is None else samples.bandwidth_nm[column],
        )
    return samples


def _seen(samples: Samples, receiver_deg: float | None, source_deg: float | None) -> Samples:
    """Return samples with the solid angles of the cones that are given."""
    cones = {
        "receiver_solid_angle_sr": ("receiver-deg", receiver_deg),
        "source_solid_angle_sr": ("source-deg", source_deg),
    }
    known: dict[str, Any] = {
        name: _solid_angle(option, angle) for name, (option, angle) in cones.items() if angle is not None
    }
    return replace(samples, instrument=replace(samples.instrument, **known))


def _solid_angle(option: str, angle_deg: float) -> float:
    """Return the solid angle [sr] of a cone whose full angle is given."""
    if not 0.0 < angle_deg <= _WIDEST_DEG:
        raise ParameterError(
            option, f"{angle_deg:g} is outside (0, {_WIDEST_DEG:g}] degrees", angle_deg, (0.0, _WIDEST_DEG)
        )
    return float(2.0 * np.pi * versine(radians(0.5 * angle_deg)))


def write(path: Path, text: str) -> None:
    """Write a text: whole, or not at all. Folders are made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, text.encode(), path.parent)


def recipe_of(document: Fits) -> str:
    """Return a recipe of the best fit that is one model; BrdfdbError if none is."""
    best = next((one for one in document.fits if one.recipe is not None), None)
    if best is None or best.material is None or best.recipe is None:
        raise BrdfdbError(f"{document.name}: {_no_recipe(document)}")
    return f'materials = ["{best.material.name}"]\ntolerance = {TOLERANCE:g}\n\n{best.recipe}'


def lines(document: Fits) -> list[str]:
    """Return the lines that the command prints: the ranking, then the best fit."""
    left = document.left_out
    text = [f"{document.name}: {document.samples} values at {document.incidences} incidences, {document.residual}"]
    reasons = [
        f"{count} {reason}"
        for count, reason in (
            (left.below_horizon, "below the horizon"),
            (left.holes, "holes"),
            (left.at_horizon, "at the horizon"),
            (left.unusable, "not positive" if document.residual in ("log", "relative") else "without uncertainty"),
        )
        if count
    ]
    if reasons:
        text.append(f"  left out: {', '.join(reasons)}")
    text += [f"  note  {sentence}" for sentence in document.remarks]
    text += _aperture(document)
    width = max(len(one.model) for one in document.fits)
    text.append(f"  {'model':<{width}}  held out    all   numbers      BIC  albedo")
    for one in document.fits:
        held = "      -" if one.held_out is None else f"{one.held_out.rms:7.3f}"
        alone = "      -" if one.rms_ln is None else f"{one.rms_ln:6.3f}"
        light = "" if one.albedo.conserves else "  reflects more than arrives"
        text.append(
            f"  {one.model:<{width}}  {held} {alone}   {one.numbers:7d} {one.bic:8.0f}  {one.albedo.value:6.3f}{light}"
        )
    text.append("  held out, all: rms of ln(model / sample), at incidences left out of the fit, and of all")
    if document.shared_outlier_count:
        text.append(f"  both leave out {counted(document.shared_outlier_count, 'value')} far from every fit")
    text += [
        f"  not fitted: {reason if reason.startswith(name) else f'{name}, {reason}'}"
        for name, reason in document.skipped.items()
        if reason != INTERRUPTED
    ]
    if document.interrupted:
        missing = list(document.skipped.values()).count(INTERRUPTED)
        text.append(f"  interrupted: {counted(missing, 'model')} not fitted, and intervals are those of the covariance")
    best = document.fits[0]
    text += ["", f"best: {best.model}", *_numbers(best.estimates)]
    text += [f"  note  {sentence}" for sentence in best.remarks]
    if document.outlier_count:
        farthest = document.outliers[0]
        text.append(
            f"  {document.outlier_count} taken for outliers; the farthest: f_r {farthest.value:.3g} against "
            f"{farthest.model:.3g} /sr at theta_i {farthest.theta_i_deg:g}°, theta_r {farthest.theta_r_deg:g}°, "
            f"phi_r {farthest.phi_r_deg:g}°"
        )
    if best.recipe is None:
        return [*text, *(_alternative(document.fits) or ["", _no_recipe(document)])]
    return [*text, "", *best.recipe.splitlines()]


def _aperture(document: Fits) -> list[str]:
    """Return a line on the solid angles that lobes were averaged over, if any is known."""
    solid_angles = {"receiver": document.receiver_solid_angle_sr, "light": document.source_solid_angle_sr}
    cones = [
        f"{name} {2.0 * float(degrees(np.arccos(max(1.0 - known / (2.0 * np.pi), 0.0)))):.3g}°"
        for name, known in solid_angles.items()
        if known is not None
    ]
    return [f"  seen through the aperture: {', '.join(cones)}"] if cones else []


def _no_recipe(document: Fits) -> str:
    """Return a sentence on why no fit is a recipe."""
    why = "all are sums, or one model with amplitudes of channels that are no spectra"
    if len(document.channels) > 1 and document.wavelengths_nm is None:
        why = "the channels have no wavelengths; --channel fits one of them"
    elif all("+" in one.model for one in document.fits):
        why = "all are sums, and a recipe takes one model"
    return f"no fit is one model of the registry with wavelengths, so that there is no recipe: {why}"


def _alternative(ranked: Sequence[Fit]) -> list[str]:
    single = next((one for one in ranked if one.recipe is not None), None)
    if single is None or single.recipe is None:
        return []
    return ["", f"best model of the registry alone: {single.model}", "", *single.recipe.splitlines()]


def _numbers(estimates: Sequence[Estimate]) -> list[str]:
    """Return a line for each number: value, standard error and 95 % interval."""
    text = []
    for one in estimates[:_SHOWN]:
        name = one.name if one.channel is None else f"{one.name} ({one.channel})"
        error = "" if one.standard_error is None else f" ± {one.standard_error:.2g}"
        unit = "" if one.unit == "1" else f" {one.unit}"
        text.append(f"  {name:<34}{one.value:.5g}{error}{unit}  95 %: {one.low:.5g} to {one.high:.5g} ({one.method})")
    if len(estimates) > _SHOWN:
        text.append(f"  and {len(estimates) - _SHOWN} more; --json has them")
    return text
