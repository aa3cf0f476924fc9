"""Turquin 2019: GGX facets, scaled by the light that they lose to one another towards the viewer."""

from __future__ import annotations

from brdfdb.geometry import Directions
from brdfdb.models._ggx_albedo import lost_share
from brdfdb.models._microfacets import F_0, single_scattering
from brdfdb.models.declaration import of_directions
from brdfdb.parameters import Floats, Parameter

ALPHA = Parameter("alpha", "α", "1", 1e-6, 1.0, "width of the facets' slopes")


@of_directions(parameters=(F_0, ALPHA), references="turquin2019, heitz2014, schlick1994", together="alpha")
def ggx_scaled(directions: Directions, f_0: Floats, alpha: Floats) -> Floats:
    """Return the function [1/sr] of Turquin 2019: GGX facets, brighter by what they lose towards the viewer.

    `ggx_schlick` without a uniform part, times 1 + f_0 (1 - E) / E, with the albedo E of the facets towards the viewer
    at F = 1. It is not reciprocal, so it is no model of the registry: tables use reciprocity as a symmetry. With
    f_0 = 1 the integral over lights is 1 for every viewer, as a renderer needs that knows the viewer first. The
    integral over viewers, which is the albedo for a light, is not 1. `ggx_compensated` is the reciprocal form.

    >>> towards = ggx_scaled([0.3, 1.4], 0.0, [1.4, 0.3], np.pi, f_0=0.9, alpha=0.5)
    >>> [round(float(f_r), 4) for f_r in towards]
    [0.3175, 0.3692]
    """
    lost = lost_share(directions.cos_r, alpha)
    return single_scattering(directions, f_0, alpha) * (1.0 + f_0 * lost / (1.0 - lost))
