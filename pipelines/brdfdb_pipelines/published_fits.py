"""The job that lists published fits: what is no physics in them, and a recipe of those that are known models."""

from __future__ import annotations

from pathlib import Path

from brdfdb.fitting.published import PublishedFit, PublishedFits, read_published, recipe_of
from brdfdb_pipelines import terminal
from brdfdb_pipelines.fit import write


def run(
    data: Path, *, channel: str | None = None, json: Path | None = None, recipe: Path | None = None
) -> PublishedFits:
    """List the fits of a file, with what is no physics in them.

    Parameters
    ----------
    data : Path
        A file of published fits, as `brdfdb.fitting.published.read_published` reads it.
    channel : str, optional
        The channel of the recipe, R, G or B; G by default.
    json, recipe : Path, optional
        Files to write: all fits, and those that are models of the registry as a recipe.

    Raises
    ------
    FileFormatError
        If it is no such file.
    ParameterError
        If a recipe is asked for and no fit is a model of the registry.
    """
    with terminal.progress(counted=False, transient=True) as bar:
        bar.add_task(data.name, total=None)
        published = read_published(data)
    text = None if recipe is None else recipe_of(published, "G" if channel is None else channel)
    shown = lines(published)
    if recipe is not None and channel is None:
        shown.append("  note  the recipe has channel G alone, as the file states no wavelengths; --channel chooses")
    print(terminal.plain("\n".join(shown)))
    if json is not None:
        write(json, published.model_dump_json(indent=1) + "\n")
    if recipe is not None and text is not None:
        write(recipe, text)
    return published


def lines(published: PublishedFits) -> list[str]:
    """Return the lines that the command prints: a line for each material, then the counts and what is not known."""
    names = list(dict.fromkeys(term.name for one in published.fits for term in one.terms))
    flagged = [one for one in published.fits if one.flags]
    ours = [one for one in published.fits if one.model is not None]
    text = [f"{published.name}: {len(published.fits)} published fits, {' + '.join(names)}"]
    if published.comment:
        text.append(f"  {published.comment}")
    width = max(len(one.name) for one in published.fits)
    text += [f"  {one.name:<{width}}  {_numbers(one)}{_judged(one)}" for one in published.fits]
    models = ", ".join(sorted({one.model for one in ours if one.model}))
    text.append(f"  {len(flagged)} of {len(published.fits)} are no physics; {len(ours)} are models of the registry")
    if models:
        text[-1] += f" ({models})"
    return [*text, *(f"  note  {sentence}" for sentence in published.sentences)]


def _numbers(one: PublishedFit) -> str:
    return "  ".join(
        f"{name} {'/'.join(f'{value:.3g}' for value in values)}"
        for term in one.terms
        for name, values in term.numbers.items()
    )


def _judged(one: PublishedFit) -> str:
    light = "" if one.albedo is None else f"  reflects {one.albedo.value:.3f}"
    return light + "".join(f"\n    no physics: {sentence}" for sentence in one.flags)
