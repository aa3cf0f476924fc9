"""The largest directional albedo of a fit."""

from __future__ import annotations

import numpy as np

from brdfdb.fitting.document import Albedo
from brdfdb.fitting.problem import Point
from brdfdb.fitting.surface import Surface
from brdfdb.geometry import degrees, radians
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.measurements import Samples

_ANGLES_DEG = (0.0, 30.0, 60.0, 75.0, 85.0)  # theta_i at which it is looked for, beside those of the samples
_MOST = 4  # of the samples
_TOLERANCE = 1e-3


def albedo_of(surface: Surface, point: Point, samples: Samples) -> Albedo:
    """Return the largest directional albedo [1] of a fit with its specular part, at some angles of the light.

    The channel is that with the largest f_r at the samples. Polar angles of the light are 0 to 85 degrees, and some of
    those of the samples. The azimuth is 0.
    """
    own = np.unique(np.round(degrees(samples.theta_i), 3))
    own = own[np.linspace(0, own.size - 1, min(_MOST, own.size)).round().astype(np.int64)]
    angles = np.union1d(_ANGLES_DEG, own[own < 89.0])
    channel = int(np.argmax(np.mean(point.f_r, axis=0)))
    total, error = np.zeros(angles.size), np.zeros(angles.size)
    for number, term in enumerate(surface.terms):
        given, scale = surface.in_channel(point.x, point.values, number, channel)
        if scale <= 0.0:
            continue
        albedo = directional_albedo(
            term.spec, radians(angles), tolerance=_TOLERANCE, specular=term.spec.specular is not None, **given
        )
        total += scale * albedo.albedo
        error += scale * albedo.error
    index = int(np.argmax(total))
    value, uncertain = float(total[index]), float(error[index])
    return Albedo(
        theta_i_deg=float(angles[index]), value=value, error=uncertain, conserves=value <= 1.0 + uncertain + _TOLERANCE
    )
