"""Sentences on what the model of a conversion cannot carry."""

from __future__ import annotations

from brdfdb.conversion.document import Conversion, percent
from brdfdb.materials import Material, Source, written_name
from brdfdb.models import MODELS
from brdfdb.parameters import closest

_NOT_NEAR = 0.9  # l1 from which on the model is hardly nearer than black, whose l1 is 1
_END = 1e-3  # distance from the end of a range, relative to that end, that is the end; 0 is none
_SEEN = 0.01  # share of the light from which on a part is worth a sentence
_LOST = 0.5  # share of the peak below which a highlight is lost
_UNSURE = 0.01  # error of l1, relative to l1, that is worth a sentence


def is_lost(source: Source, conversion: Conversion) -> bool:
    """Return True if a lobe of the source has less than half of its peak in the model."""
    return source.has_lobe and conversion.peak.after < _LOST * conversion.peak.before


def with_highlight(conversion: Conversion, least: Conversion) -> Conversion:
    """Return a conversion that keeps the highlight, with a sentence on the one with the least l1, which loses it."""
    sentence = (
        f"Cube roots of f_r were compared, because the least l1, {percent(least.l1)}, is without the highlight: f_r in "
        f"the mirror direction at {least.peak.theta_deg:g} degrees is {least.peak.after:.3g} /sr there."
    )
    return conversion.model_copy(update={"remarks": [sentence, *conversion.remarks]})


def _at_an_end(conversion: Conversion) -> list[str]:
    """Return the numbers that the search left at an end of their range, with the values, as recipes write them."""
    in_file, ends = conversion.material.file_parameters(), []
    for parameter in MODELS[conversion.model].parameters:
        value = conversion.parameters[parameter.name]
        if parameter.name in conversion.fixed or parameter.reflectance or not isinstance(value, float):
            continue
        if any(end != 0.0 and abs(value - end) <= _END * abs(end) for end in (parameter.low, parameter.high)):
            name = written_name(parameter)
            ends.append(f"{name} = {in_file[name]:g}")
    return ends


def remarks(source: Source, conversion: Conversion) -> list[str]:
    """Return sentences on how far the model is, what it lacks of the source, a lost highlight, and an inexact l1."""
    spec, made = MODELS[conversion.model], conversion.material
    sentences = []
    if conversion.l1 >= _NOT_NEAR:
        sentences.append(
            f"{spec.name} cannot carry {source.name}: black, which reflects nothing, has an l1 of 100 %, too."
        )
    if ends := _at_an_end(conversion):
        sentences.append(f"At the end of their range: {', '.join(ends)}. A closer fit lies beyond.")
    if conversion.specular_share > _SEEN:
        share = f"{percent(conversion.specular_share)} of the light of {source.name} is its specular part"
        lacks = "has one, too" if spec.specular else "has none: that light counts as error"
        sentences.append(f"{share} (a Dirac delta); {spec.name} {lacks}.")
    if isinstance(source, Material) and source.spec.uniform and spec.uniform is None and spec.lobe is not None:
        uniform = source.parameters[source.spec.uniform]
        if not isinstance(uniform, float) or uniform > 0.0:
            others = closest(
                spec.name, [name for name, other in MODELS.items() if other.uniform and name != source.model]
            )
            with_one = others.replace("; closest: ", "; models with one: ")
            sentences.append(
                f"{source.name} has a uniform part ({source.spec.uniform} = {uniform}); {spec.name} has none{with_one}."
            )
    if source.anisotropic and not made.anisotropic:
        sentences.append(f"{source.name} is anisotropic; {made.name} is not.")
    if is_lost(source, conversion):
        peak = conversion.peak
        sentences.append(
            f"The highlight is lost: f_r in the mirror direction at {peak.theta_deg:g} degrees falls from "
            f"{peak.before:.3g} to {peak.after:.3g} /sr. Fix reflectance and width to keep one."
        )
    if conversion.quadrature > _UNSURE * conversion.l1:
        sentences.append(f"l1 is known to within {percent(conversion.quadrature)} of the light.")
    return sentences
