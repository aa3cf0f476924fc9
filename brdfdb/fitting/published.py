"""Published fits: parameters that others fitted to measured materials, read from text and checked."""

from __future__ import annotations

import ast
import math
import os
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.figure import DocumentPart
from brdfdb.fitting.document import ALBEDO_ANGLES_DEG, ALBEDO_TOLERANCE, FitAlbedo
from brdfdb.fitting.surface import flat_model
from brdfdb.geometry import radians
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.materials import Material
from brdfdb.materials.provenance import MOST_NAME
from brdfdb.materials.recipe_text import toml_of
from brdfdb.measurements.measured_source import slug
from brdfdb.models import MODELS
from brdfdb.place import path_of

SUFFIX = ".fit"
CHANNELS = ("R", "G", "B")
_MOST_BYTES = 1 << 24  # of a file
_MOST_LINE = 4096  # characters of a line
_FLAT = "Lambertian"
_NAMED = Path(__file__).with_name("published.toml")


class PublishedLobe(DocumentPart):
    """One term of a published fit."""

    name: str = Field(description="name in the file")
    numbers: dict[str, list[float]] = Field(description="its parameters; three values are those of R, G and B")


class PublishedFit(DocumentPart):
    """One material of a file of published fits."""

    name: str
    line: int = Field(description="line of the file")
    terms: list[PublishedLobe]
    model: str | None = Field(description="the model of the registry with the same formula; null: no model is known")
    albedo: FitAlbedo | None = Field(description="the largest directional albedo, of R, G or B; null: without a model")
    flags: list[str] = Field(description="sentences on contradictions to physics")


class PublishedFits(DocumentPart):
    """A file of published fits."""

    name: str
    comment: str = Field(description="the lines that the file begins with")
    fits: list[PublishedFit]
    sentences: list[str] = Field(description="conventions of the file that are not known")


@cache
def _named() -> dict[str, dict[str, Any]]:
    with _NAMED.open("rb") as file:
        return tomllib.load(file)


def read_published(path: str | os.PathLike[str]) -> PublishedFits:
    """Return the fits of a text with a line for each material, and their contradictions to physics.

    A line is ``NAME = Aggregate(Lambertian(albedo = [R, G, B]), LOBE(albedo = [R, G, B], roughness = NUMBER))``, or one
    lobe alone. Lines that begin with # are comments. A scale above 1, a refractive index below 1, a number outside the
    range of the model, and an albedo above 1 are flagged. Albedos are computed where the formula of the lobe is known,
    at polar angles of the light of 0 to 85 degrees.

    Raises
    ------
    FileFormatError
        If the file is no such text; the sentence names the line.
    OSError
        If it cannot be read.
    """
    path = path_of(path)
    if path.stat().st_size > _MOST_BYTES:
        raise FileFormatError(f"{path}: it has more than {_MOST_BYTES} bytes, too many for a list of fits")
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError:
        raise FileFormatError(f"{path}: it is not UTF-8 text") from None
    comments = [line.lstrip("# ") for line in lines if line.startswith("#")]
    numbered = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    fits = [_fit(path, number, line) for number, line in numbered if not line.lstrip().startswith("#")]
    if not fits:
        raise FileFormatError(f"{path}: it has no line of the form NAME = LOBE(NUMBER = ...)")
    names = {term.name for fit in fits for term in fit.terms} - {_FLAT}
    unsure = {name: _named()[name]["unsure"] for name in sorted(names) if "unsure" in _named().get(name, {})}
    sentences = [f"{name}: no model of the registry is used for it, because {why}." for name, why in unsure.items()]
    sentences += [f"{name}: its formula is not known." for name in sorted(names - set(_named()))]
    return PublishedFits(name=path.stem, comment=" ".join(comments)[:_MOST_LINE], fits=fits, sentences=sentences)


def recipe_of(published: PublishedFits, channel: str = "G", tolerance: float = 0.05) -> str:
    """Return a recipe of the fits that are models of the registry and are not flagged.

    Parameters
    ----------
    published : PublishedFits
        The fits.
    channel : {"R", "G", "B"}
        The channel whose reflectances are taken: the files state no wavelengths.
    tolerance : float [1]
        Of the tables.

    Raises
    ------
    ParameterError
        If the channel is unknown, or no fit is a model of the registry.
    """
    if channel not in CHANNELS:
        raise ParameterError("channel", f"{channel!r} is not one of {', '.join(CHANNELS)}", channel, CHANNELS)
    parts = {}
    for one in published.fits:
        if one.model is None or one.flags:
            continue
        name = slug(f"{one.name}-{published.name}-{channel}")[:MOST_NAME].rstrip("-")
        table = {
            "title": f"{one.name}, channel {channel}",
            "model": one.model,
            "source": f"{published.name}{SUFFIX}, line {one.line}. {published.comment}".strip(),
            "parameters": _parameters(one.terms, CHANNELS.index(channel)),
        }
        Material.from_table(name, table)
        parts[name] = toml_of(name, table)
    if not parts:
        raise ParameterError(
            "recipe", f"every fit of {published.name} is flagged or is not a model of the registry", published.name
        )
    listed = ", ".join(f'"{name}"' for name in parts)
    return f"materials = [{listed}]\ntolerance = {tolerance:g}\n\n" + "\n".join(parts.values())


def _fit(path: Path, number: int, line: str) -> PublishedFit:
    name, sign, text = line.partition(" = ")
    if not sign or len(line) > _MOST_LINE:
        raise FileFormatError(f"{path}: line {number} is not NAME = LOBE(NUMBER = ...): {line[:60]!r}")
    try:
        terms = _terms(ast.parse(text.strip(), mode="eval").body)
    except (FileFormatError, SyntaxError, ValueError, RecursionError, MemoryError) as error:
        reason = error if isinstance(error, FileFormatError) else "it is not LOBE(NUMBER = ...)"
        raise FileFormatError(f"{path}: line {number} ({name.strip()[:60]}): {reason}") from None
    model, flags, albedo = _model(terms), _flags(terms), None
    outside = [] if model is None else _out_of_range(model, terms)
    if model is not None and not outside:
        # in the channel whose reflectances add up to most
        given = [_parameters(terms, channel) for channel in range(len(CHANNELS))]
        sums = [sum(v for name, v in one.items() if MODELS[model].parameter(name).reflectance) for one in given]
        brightest: dict[str, Any] = dict(given[int(np.argmax(sums))])
        angles = radians(np.array(ALBEDO_ANGLES_DEG))
        computed = directional_albedo(model, angles, tolerance=ALBEDO_TOLERANCE, **brightest)
        albedo = FitAlbedo.largest(ALBEDO_ANGLES_DEG, computed.albedo, computed.error)
        if not albedo.conserves:
            flags.append(f"it reflects {albedo.value:.3g} of the light from {albedo.theta_i_deg:g} degrees")
    return PublishedFit(
        name=name.strip(), line=number, terms=terms, model=model, albedo=albedo, flags=[*flags, *outside]
    )


def _terms(node: ast.expr) -> list[PublishedLobe]:
    """Return the terms of a call: those of its arguments, or itself."""
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
        raise FileFormatError("it is not LOBE(NUMBER = ...)")
    name = node.func.id
    if node.args and node.keywords:
        raise FileFormatError(f"{name} has both terms and numbers")
    if node.args:
        return [term for part in node.args for term in _terms(part)]
    return [PublishedLobe(name=name, numbers={str(word.arg): _numbers(name, word) for word in node.keywords})]


def _numbers(name: str, word: ast.keyword) -> list[float]:
    """Return the value of a keyword as one number or three."""
    parts = word.value.elts if isinstance(word.value, ast.List) else [word.value]
    try:
        values = [float(ast.literal_eval(part)) for part in parts]
    except (ValueError, TypeError, SyntaxError, OverflowError):
        raise FileFormatError(f"{word.arg} of {name} is neither a number nor a list of numbers") from None
    if len(values) not in (1, len(CHANNELS)) or not all(map(math.isfinite, values)):
        raise FileFormatError(f"{word.arg} of {name} has {len(values)} values; 1 or 3 finite ones are read")
    return values


def _model(terms: list[PublishedLobe]) -> str | None:
    """Return the model of the registry with the formula of the terms, or None."""
    lobes = [term for term in terms if term.name != _FLAT]
    if not lobes:
        return flat_model() if len(terms) == 1 else None
    known = _named().get(lobes[0].name, {})
    if len(lobes) > 1 or len(terms) > 2 or "model" not in known:
        return None
    return str(known["model"]) if set(known["parameters"].values()) == set(lobes[0].numbers) else None


def _parameters(terms: list[PublishedLobe], channel: int) -> dict[str, float]:
    """Return the parameters of the model of the terms in a channel, as recipes write them."""
    model = _model(terms)
    assert model is not None
    uniform = MODELS[model].uniform or MODELS[model].parameters[0].name
    values = {uniform: 0.0}
    for term in terms:
        names = {uniform: "albedo"} if term.name == _FLAT else _named()[term.name]["parameters"]
        for name, theirs in names.items():
            numbers = term.numbers[theirs]
            values[name] = numbers[min(channel, len(numbers) - 1)]
    return values


def _flags(terms: list[PublishedLobe]) -> list[str]:
    flags = []
    for term in terms:
        known = _named().get(term.name, {"scale": "albedo"})
        scale = max(term.numbers.get(known.get("scale", ""), [0.0]))
        if scale > 1.0:
            flags.append(f"the scale of {term.name} is {scale:g}, above 1")
        index = min(term.numbers.get(known.get("index", ""), [math.inf]))
        if index < 1.0:
            flags.append(f"the refractive index of {term.name} is {index:g}, below 1")
    return flags


def _out_of_range(model: str, terms: list[PublishedLobe]) -> list[str]:
    """Return sentences on numbers outside the ranges of a model."""
    flags: dict[str, None] = {}
    for channel in range(len(CHANNELS)):
        for name, value in _parameters(terms, channel).items():
            try:
                MODELS[model].parameter(name).check(value)
            except ParameterError as error:
                flags[f"{name}: {error.sentence}"] = None
    return list(flags)
