"""Sentences on the limits of a fit and of its samples."""

from __future__ import annotations

import math

import numpy as np

from brdfdb.fitting.document import Fit
from brdfdb.fitting.fitted import FittedSurface
from brdfdb.fitting.residuals import CREDIBLE, Residual
from brdfdb.geometry import degrees
from brdfdb.measurements import Samples
from brdfdb.measurements.aperture import RESOLVED

NARROW = 0.05  # width of a lobe, in slopes, below which usual apertures change it
PATTERN = 0.5  # larger correlations of neighbouring residuals are a pattern
UNEVEN = 3.0  # largest ratio of relative uncertainties, at the ends of the middle 90 %, without a remark
LEFT_OUT = 0.01  # largest share of values that are not positive without a remark
_SAME_AZIMUTH = 0.01  # degrees
ONE_AZIMUTH = (
    "The light comes from one azimuth of the surface, so anisotropy cannot be determined, and models with two widths "
    "are fitted with one."
)


def sees_anisotropy(samples: Samples) -> bool:
    """Return True if the light comes from azimuths that are neither the same nor half a turn apart.

    Half a turn of the surface changes no lobe of two widths.
    """
    phi = degrees(samples.phi_i[samples.theta_i > 0.0])
    apart = np.abs((phi - phi[:1] + 90.0) % 180.0 - 90.0)
    return bool(np.any(apart > _SAME_AZIMUTH))


def remarks_of(fit: Fit, fitted: FittedSurface) -> list[str]:
    """Return sentences on an albedo above 1, patterns in residuals, ends of ranges, and pairs of parameters."""
    surface, samples = fitted.surface, fitted.samples
    sentences = _of_aperture(fit, fitted)
    if not fit.albedo.conserves:
        sentences.append(
            f"It reflects {100.0 * fit.albedo.value:.3g} % of the light from {fit.albedo.theta_i_deg:g} degrees: more "
            "than arrives."
        )
    if fit.pattern > PATTERN:
        sentences.append(
            f"The residuals of neighbouring samples are correlated by {fit.pattern:.2f}: they form a pattern and are "
            "not noise, so the intervals are too narrow."
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
        sentences.append("A sum is not a model of the registry; a table of it needs a source that is a function.")
    return sentences


def remarks_on_samples(samples: Samples, residual: Residual) -> list[str]:
    """Return sentences on missing azimuths of the light, on uncertainties, and on files that contradict each other."""
    sentences = _on_uncertainties(samples, residual)
    if "contradiction" in samples.record:
        sentences.append(str(samples.record["contradiction"]))
    if sees_anisotropy(samples):
        return sentences
    return [ONE_AZIMUTH, *sentences]


def _on_uncertainties(samples: Samples, residual: Residual) -> list[str]:
    """Return a sentence on uncertainties that are not credible, or that the residual does not use."""
    used = residual.used
    if residual.raised:
        verb = "uncertainty is" if residual.raised == 1 else "uncertainties are"
        return [
            f"{residual.raised} {verb} below {100.0 * CREDIBLE:g} % of the median and of the median relative to f_r; "
            "the lower of the two is used instead."
        ]
    if residual.kind == "uncertainty" or samples.uncertainty is None:
        return []
    stated = samples.uncertainty[used]
    if not np.all((stated > 0.0) & np.isfinite(stated)):
        return []
    sentences = []
    sizes = np.abs(samples.values[used])
    low, high = np.percentile(stated[sizes > 0.0] / sizes[sizes > 0.0], [5.0, 95.0]) if sizes.any() else (1.0, 1.0)
    advice = "--residual uncertainty weights samples by what is stated."
    if high > UNEVEN * low:
        sentences.append(
            f"The stated uncertainty is {100.0 * low:.2g} to {100.0 * high:.2g} % of f_r at 90 % of the samples, and "
            f"the residual {residual.kind} does not follow it: intervals may miss the truth. {advice}"
        )
    elif residual.left_out > LEFT_OUT * (residual.count + residual.left_out):
        sentences.append(
            f"{residual.left_out} values that are not positive are left out, so the other values are too high on "
            f"average. {advice}"
        )
    return sentences


def _of_aperture(fit: Fit, fitted: FittedSurface) -> list[str]:
    """Return sentences on a specular part or a lobe that the aperture changes."""
    width = float(np.min(fitted.surface.widths(fitted.point.x[np.newaxis]), initial=math.inf))
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
    if not half_angle and width < NARROW:
        sentences.append(
            f"Its lobe has a width of {width:.2g} in slopes, and no solid angle of the receiver is known: an opening "
            f"that is not much smaller than {float(degrees(width)):.2g} degrees has widened it."
        )
    return sentences
