"""Minnaert 1941: the lunar-photometry reflectance, as Oren and Nayar (1994, section 1) print it."""

from __future__ import annotations

import math

import numpy as np

from brdfdb.models.declaration import DeclaredModel
from brdfdb.parameters import Parameter, white

K = Parameter("k", "k", "1", 0.0, 1.0, "limb darkening exponent; 1 is Lambert")
RHO = Parameter("rho", "ρ", "1", 0.0, 1.0, "scale; the albedo at k = 1", default=1.0, reflectance=True)


@DeclaredModel(
    title="Minnaert",
    equation="Oren and Nayar 1994, section 1",
    references="minnaert1941, orennayar1994 (section 1)",
    parameters=(K, RHO),
    degree=1,
    grazing_pole=True,
    grazing_power=lambda given: 1.0 - given["k"] if np.any(given["rho"]) else 0.0,
    # The albedo for k = 0 and rho = 1 at 89.5 degrees is 1 / cos, 114.6
    excess="Oren and Nayar 1994, section 1: as printed, Minnaert's law reflects 1 at normal incidence and, for k "
    "below 1, more the further the light is from it, cos(theta_i)^(k - 1), without bound",
    lossless=white,
)
def minnaert(cos_i: float, cos_r: float, k: float, rho: float) -> float:
    """Return the BRDF [1/sr] of Minnaert's law, rho (k + 1) / (2 pi) (cos theta_i cos theta_r)^(k - 1).

    For k < 1 the law grows without bound towards grazing; at 90 degrees it is the finite value at the float64 nearest
    pi/2. The directional albedo is rho at k = 1 and rho cos(theta_i)^(k - 1) in general, which exceeds 1 near grazing.

    >>> round(float(minnaert(0.3, 0.0, 0.4, 0.0, k=1.0)), 6)
    0.31831
    """
    return rho * (k + 1.0) / (2.0 * np.pi) * math.pow(cos_i * cos_r, k - 1.0)
