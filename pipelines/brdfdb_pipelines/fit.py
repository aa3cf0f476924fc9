"""The fit job: it fits models to samples, or lists published fits, and writes JSON, a page and a recipe."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from brdfdb import formats
from brdfdb.errors import BrdfdbError, ParameterError, counted
from brdfdb.figure import Figure
from brdfdb.fitting import published
from brdfdb.fitting.document import Estimate, Fits
from brdfdb.fitting.figure import figure_of
from brdfdb.fitting.fit import INTERRUPTED, fits
from brdfdb.fitting.nuisance import kinds_of
from brdfdb.fitting.published import PublishedFits
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
_TOLERANCE = 0.05  # tolerance of a recipe that is written
_WIDEST_DEG = 30.0  # full angle of a cone: wider cones have no direction


@dataclass(frozen=True)
class FitOutputs:
    """Files that a fit writes: all fits, a page with figures of the best fit, and its recipe."""

    json: Path | None = None
    page: Path | None = None
    recipe: Path | None = None


@dataclass(frozen=True)
class FitSettings:
    """Settings of a fit: the models, and the reading of the samples.

    By default all models are fitted. `reading` are keys of `MeasuredTable`, without `samples`. Only one channel is
    fitted if it is given. The full angles [degree] of the cones of receiver and light, seen from the sample, replace
    those of the file.
    """

    models: Sequence[str] | None = None
    reading: Mapping[str, Any] = field(default_factory=dict)
    residual: Kind = "noise"
    channel: str | None = None
    refractive_index: str | None = None
    nuisance: Sequence[str] = ()
    receiver_deg: float | None = None
    source_deg: float | None = None


def run(data: Sequence[Path], settings: FitSettings, outputs: FitOutputs) -> Fits:
    """Fit models to the samples of a file, or of several files of one surface, and print the result.

    The notes of the reader, and what looks wrong with the samples, are printed before the search, and what the samples
    cannot tell below the ranking. Ctrl-C ends the search: finished models are ranked and written, and
    `Fits.interrupted` is true.

    Raises
    ------
    ParameterError
        If a name is unknown, files cannot be joined, or no model can describe the samples.
    KeyboardInterrupt
        If no model was finished.
    BrdfdbError
        If a recipe is asked for and no fit is a single model of the registry.
    """
    kinds_of(settings.nuisance)  # refused before a file is read
    table = MeasuredTable(samples=[str(file) for file in data], **settings.reading)
    samples = joined(
        [_of_channel(formats.samples(file, table.format, **table.keywords), settings.channel) for file in data]
    )
    samples = _with_cones(samples, settings)
    stated = statement(samples)
    for sentence in (*stated.notes, *stated.hints):
        if sentence != samples.record.get("contradiction"):  # a remark of the fits
            print(terminal.plain(f"{samples.name}: {sentence}"), flush=True)
    count = len(settings.models or fitted_by_default()) + 1
    with terminal.progress(transient=True) as bar:
        task = bar.add_task("fit", total=count)

        def tick(name: str) -> None:
            bar.update(task, advance=1, description=name)

        document, fitted = fits(
            samples,
            settings.models,
            residual=settings.residual,
            refractive_index=settings.refractive_index,
            nuisance=kinds_of(settings.nuisance),
            tick=tick,
            keep_finished=True,
        )
    if outputs.json is not None:
        _write(outputs.json, document.model_dump_json(indent=1) + "\n")
    if outputs.page is not None:
        _write(outputs.page, _page(document, figure_of(document, fitted[0])))
    print(terminal.plain("\n".join([*lines(document), *stated.untold])))
    if outputs.recipe is not None:
        _write(outputs.recipe, recipe_of(document))
    return document


def _of_channel(samples: Samples, channel: str | None) -> Samples:
    """Return the samples of one channel, or of all."""
    if channel is None:
        return samples
    if channel not in samples.channels:
        hint = closest(channel, samples.channels)
        raise ParameterError(
            "channel", f"{channel!r} is not one of {', '.join(samples.channels)}{hint}", channel, samples.channels
        )
    column = [samples.channels.index(channel)]
    return replace(
        samples,
        channels=(channel,),
        values=samples.values[:, column],
        wavelength_nm=None if samples.wavelength_nm is None else samples.wavelength_nm[column],
        uncertainty=None if samples.uncertainty is None else samples.uncertainty[:, column],
        bandwidth_nm=None if samples.bandwidth_nm is None else samples.bandwidth_nm[column],
    )


def _with_cones(samples: Samples, settings: FitSettings) -> Samples:
    """Return samples with the solid angles [sr] of the cones whose full angles are given."""
    solid_angles: dict[str, Any] = {}
    for option, name, angle_deg in (
        ("receiver-deg", "receiver_solid_angle_sr", settings.receiver_deg),
        ("source-deg", "source_solid_angle_sr", settings.source_deg),
    ):
        if angle_deg is None:
            continue
        if not 0.0 < angle_deg <= _WIDEST_DEG:
            raise ParameterError(
                option, f"{angle_deg:g} is outside (0, {_WIDEST_DEG:g}] degrees", angle_deg, (0.0, _WIDEST_DEG)
            )
        solid_angles[name] = float(2.0 * np.pi * versine(radians(0.5 * angle_deg)))
    return replace(samples, instrument=replace(samples.instrument, **solid_angles))


def _write(path: Path, text: str) -> None:
    """Write a file completely or not at all. Directories are made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, text.encode(), path.parent)


def _page(document: Fits, figure: Figure) -> str:
    """Return the page of fits with the figures of the best fit: one HTML file without any other file."""
    from brdfdb_pipelines import figure_svg, html_page

    keys = [f"fit-{number}" for number, _ in enumerate(figure.panels, 1)]
    plots = [(key, panel.kind, figure_svg.svg(panel, key)) for key, panel in zip(keys, figure.panels, strict=True)]
    cuts, _, maps = figure.caption.partition(". ")
    captions = {"curves": f"{cuts}.", "map": maps}
    template = html_page.environment().get_template("fit.html")
    return template.render(document=document, best=document.fits[0], plots=plots, captions=captions)


def recipe_of(document: Fits) -> str:
    """Return a recipe of the best fit that is a single model; BrdfdbError if there is none."""
    best = next((one for one in document.fits if one.recipe is not None), None)
    if best is None or best.material is None or best.recipe is None:
        raise BrdfdbError(f"{document.name}: {_no_recipe(document)}")
    return f'materials = ["{best.material.name}"]\ntolerance = {_TOLERANCE:g}\n\n{best.recipe}'


def lines(document: Fits) -> list[str]:
    """Return the lines that the command prints: the ranking, then the best fit."""
    left = document.left_out
    values = f"{counted(document.samples, 'value')} at {counted(document.incidences, 'incidence')}"
    text = [f"{document.name}: {values}, residuals: {document.residual}"]
    reasons = [
        f"{count} {reason}"
        for count, reason in (
            (left.below_horizon, "below the horizon"),
            (left.holes, "holes"),
            (left.at_horizon, "at the horizon"),
            (
                left.unusable,
                "not positive" if document.residual in ("noise", "log", "relative") else "without uncertainty",
            ),
        )
        if count
    ]
    if reasons:
        text.append(f"  left out: {', '.join(reasons)}")
    text += [f"  note  {sentence}" for sentence in document.remarks]
    solid_angles = {"receiver": document.receiver_solid_angle_sr, "light": document.source_solid_angle_sr}
    cones = [
        f"{name} {2.0 * float(degrees(np.arccos(max(1.0 - known / (2.0 * np.pi), 0.0)))):.3g}°"
        for name, known in solid_angles.items()
        if known is not None
    ]
    if cones:
        text.append(f"  averaged over the aperture: {', '.join(cones)}")
    width = max(len(one.model) for one in document.fits)
    text.append(f"  {'model':<{width}}  held out    all   numbers      BIC  albedo")
    for one in document.fits:
        held = "      -" if one.held_out is None else f"{one.held_out.rms:7.3f}"
        alone = "      -" if one.rms_ln is None else f"{one.rms_ln:6.3f}"
        light = "" if one.albedo.conserves else "  above 1"
        text.append(
            f"  {one.model:<{width}}  {held} {alone}   {one.numbers:7d} {one.bic:8.0f}  {one.albedo.value:6.3f}{light}"
        )
    text.append("  held out, all: rms of ln(model / sample) at the incidences left out of the fit, and at all")
    if document.shared_outlier_count:
        text.append(f"  both are without {counted(document.shared_outlier_count, 'value')} far from every fit")
    text += [
        f"  not fitted: {reason if reason.startswith(name) else f'{name}, {reason}'}"
        for name, reason in document.skipped.items()
        if reason != INTERRUPTED
    ]
    if document.interrupted:
        missing = list(document.skipped.values()).count(INTERRUPTED)
        text.append(f"  interrupted: {counted(missing, 'model')} not fitted, and intervals come from the covariance")
    best = document.fits[0]
    text += ["", f"best: {best.model}", *_numbers(best.estimates), *_numbers(best.nuisance)]
    if best.noise_floor is not None:
        text.append(f"  the noise has a floor: below {best.noise_floor:.3g} /sr it is no longer in proportion to f_r")
    text += [f"  note  {sentence}" for sentence in best.remarks]
    if document.outlier_count:
        farthest = document.outliers[0]
        text.append(
            f"  {counted(document.outlier_count, 'outlier')}; the farthest: f_r {farthest.value:.3g} /sr, of the model "
            f"{farthest.model:.3g} /sr, at theta_i {farthest.theta_i_deg:g}°, theta_r {farthest.theta_r_deg:g}°, "
            f"phi_r {farthest.phi_r_deg:g}°"
        )
    if best.recipe is None:
        single = next((one for one in document.fits if one.recipe is not None), None)
        if single is None or single.recipe is None:
            return [*text, "", _no_recipe(document)]
        return [*text, "", f"best single model of the registry: {single.model}", "", *single.recipe.splitlines()]
    return [*text, "", *best.recipe.splitlines()]


def _no_recipe(document: Fits) -> str:
    """Return a sentence on why no fit is a recipe."""
    why = "each fit is a sum of models, or has amplitudes of channels without wavelengths"
    if len(document.channels) > 1 and document.wavelengths_nm is None:
        why = "the channels have no wavelengths; fit one of them with --channel"
    elif all("+" in one.model for one in document.fits):
        why = "each fit is a sum, and a recipe takes a single model"
    return f"no recipe can be written: {why}"


def _numbers(estimates: Sequence[Estimate]) -> list[str]:
    """Return a line for each number: value, standard error and 95 % interval."""
    text = []
    for one in estimates[:_SHOWN]:
        name = one.name if one.channel is None else f"{one.name} ({one.channel})"
        several = one.method == "several fits"  # the standard error is that of one of them
        error = "" if several or one.standard_error is None else f" ± {one.standard_error:.2g}"
        unit = "" if one.unit == "1" else f" {one.unit}"
        method = f"{one.method}, as the notes say" if several else one.method
        text.append(f"  {name:<34}{one.value:.5g}{error}{unit}  95 %: {one.low:.5g} to {one.high:.5g} ({method})")
    if len(estimates) > _SHOWN:
        text.append(f"  and {len(estimates) - _SHOWN} more; --json has them")
    return text


def list_published(
    data: Path, *, channel: str | None = None, json: Path | None = None, recipe: Path | None = None
) -> PublishedFits:
    """Print the fits of a file of published fits, and which of them contradict physics.

    The recipe has the fits that are models of the registry, in the channel R, G or B, by default G. FileFormatError if
    it is no such file; ParameterError if a recipe is asked for and no fit is such a model.
    """
    with terminal.progress(counted=False, transient=True) as bar:
        bar.add_task(data.name, total=None)
        listed = published.read_published(data)
    text = None if recipe is None else published.recipe_of(listed, "G" if channel is None else channel)
    shown = lines_of_published(listed)
    if recipe is not None and channel is None:
        shown.append("  note  the recipe has channel G only, as the file states no wavelengths; choose with --channel")
    print(terminal.plain("\n".join(shown)))
    if json is not None:
        _write(json, listed.model_dump_json(indent=1) + "\n")
    if recipe is not None and text is not None:
        _write(recipe, text)
    return listed


def lines_of_published(listed: PublishedFits) -> list[str]:
    """Return a line for each material, the counts, and notes on missing conventions of the file."""
    names = list(dict.fromkeys(term.name for one in listed.fits for term in one.terms))
    unphysical = [one for one in listed.fits if one.flags]
    ours = [one for one in listed.fits if one.model is not None]
    text = [f"{listed.name}: {len(listed.fits)} published fits, {' + '.join(names)}"]
    if listed.comment:
        text.append(f"  {listed.comment}")
    width = max(len(one.name) for one in listed.fits)
    for one in listed.fits:
        numbers = [
            f"{name} {'/'.join(f'{value:.3g}' for value in values)}"
            for term in one.terms
            for name, values in term.numbers.items()
        ]
        albedo = "" if one.albedo is None else f"  albedo {one.albedo.value:.3f}"
        text.append(f"  {one.name:<{width}}  {'  '.join(numbers)}{albedo}")
        text += [f"    contradicts physics: {sentence}" for sentence in one.flags]
    models = ", ".join(sorted({one.model for one in ours if one.model}))
    counts = f"  {len(unphysical)} of {len(listed.fits)} contradict physics; {len(ours)} are models of the registry"
    text.append(f"{counts} ({models})" if models else counts)
    return [*text, *(f"  note  {sentence}" for sentence in listed.sentences)]
