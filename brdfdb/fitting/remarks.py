"""Sentences on what a fit cannot carry, and on what its numbers do not mean."""

from __future__ import annotations

from brdfdb.fitting.document import Fit
from brdfdb.fitting.surface import Surface
from brdfdb.measurements import Samples

PATTERN = 0.5  # correlation of neighbouring residuals from which on the rest is a pattern


def remarks_of(fit: Fit, surface: Surface, samples: Samples) -> list[str]:
    """Return sentences on light from nothing, a pattern in the residuals, ends of ranges, and pairs of numbers."""
    sentences = []
    if not fit.albedo.conserves:
        sentences.append(
            f"It reflects {100.0 * fit.albedo.value:.3g} % of the light from {fit.albedo.theta_i_deg:g} degrees: more "
            "than arrives."
        )
    if fit.pattern > PATTERN:
        sentences.append(
            f"The residuals of neighbouring samples are correlated by {fit.pattern:.2f}: what is left is a pattern and "
            "no noise, and the intervals are too narrow."
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
    if surface.indexed and samples.wavelength_nm is None and any(p.unit == "µm" for t in surface.terms for p in t.free):
        sentences.append("The samples state no wavelength; lengths are those at 550 nm, and scale with it.")
    if len(surface.terms) > 1:
        sentences.append("A sum is no model of the registry: it takes a source that is a function.")
    return sentences
