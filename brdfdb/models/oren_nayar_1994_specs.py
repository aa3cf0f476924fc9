"""Specifications of the models of Oren and Nayar 1994, with their limits of validity and known excesses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from brdfdb.geometry import degrees
from brdfdb.models._limits import standing
from brdfdb.models.oren_nayar_1994 import (
    INTERREFLECTION,
    OFFSET,
    RHO,
    SIGMA,
    oren_nayar,
    oren_nayar_gradient,
    oren_nayar_qualitative,
    oren_nayar_qualitative_gradient,
    oren_nayar_qualitative_vectors,
    oren_nayar_vectors,
)
from brdfdb.models.oren_nayar_1994_body_surface import (
    E_0,
    K_B,
    K_S,
    WITH_INTERREFLECTION,
    oren_nayar_body_surface,
    oren_nayar_body_surface_vectors,
)
from brdfdb.models.oren_nayar_1994_body_surface import lobe as body_surface_lobe
from brdfdb.models.oren_nayar_1994_forms import forms
from brdfdb.models.oren_nayar_1994_surfaces import (
    PHI_A,
    THETA_A,
    oren_nayar_gaussian,
    oren_nayar_gaussian_vectors,
    oren_nayar_single_slope,
    oren_nayar_single_slope_vectors,
    oren_nayar_unidirectional,
    oren_nayar_unidirectional_vectors,
)
from brdfdb.parameters import Arguments, Draw, ModelSpec, StatedLimit, white

# Shares of a Gaussian of slopes beyond 90 degrees, up to which a surface is inside the limits or at their edge
_BEYOND, _FAR_BEYOND = 0.01, 0.1

# The albedo was measured at rho = 1 over sigma. It reaches 1.0510 (sigma of 17 degrees) and exceeds 1 from 50 degrees
# on. The albedo of the qualitative model reaches 1.015, or 1.044 with an offset of 0.57
_EXCESS = (
    "Oren and Nayar 1994, eqs 27, 28 and 30: near grazing and with an albedo near 1 the fit reflects up to "
    "5 % more than it receives, for sigma below 40 degrees"
)
# The albedo was measured at rho = 1 over theta_a. It reaches 1.0625 (theta_a of 41 degrees, theta_i of 89.999) and
# exceeds 1 from 74 degrees on. The weights of eq. 44 cause this: the integrals of eqs 23 and 46 stay below 1
_SINGLE_SLOPE_EXCESS = (
    "Oren and Nayar 1994, eqs 44, 45 and 49: near grazing and with an albedo near 1 the closed forms "
    "reflect up to 6 % more than they receive, for slopes below 60 degrees"
)
# The excess is the sum of those of the two models, at rho = k_b = k_s = e_0 = 1
_BODY_SURFACE_EXCESS = (
    "Oren and Nayar 1994, eq. 32: a fitted sum of two radiances, of which that of eq. 31 is not normalised"
)


def _facets(_: Arguments) -> list[StatedLimit]:
    """Return the limit that Oren and Nayar state for all their surfaces."""
    return [
        StatedLimit(
            quantity="area of facets / wavelength^2",
            value="not a parameter of the model",
            valid="at least 10",
            standing="unknown",
            words="Further, the facet area is large compared to the wavelength λ of incident light and therefore "
            "geometrical optics can be used to derive the reflectance model.",
            where="Oren and Nayar 1994, section 3, with eq. 5",
        )
    ]


def _limits(arguments: Arguments) -> list[StatedLimit]:
    """Return the limits of validity that Oren and Nayar state for surfaces with Gaussian slopes."""
    sigma = float(arguments["sigma"])
    beyond = 0.0 if sigma == 0.0 else math.erfc(math.pi / 2.0 / (sigma * math.sqrt(2.0)))
    return [
        *_facets(arguments),
        StatedLimit(
            quantity="share of the Gaussian of slopes that lies beyond 90 degrees",
            value=f"{100.0 * beyond:.2g} % with sigma = {degrees(sigma):.3g} degrees",
            valid="up to 1 %, at the edge below 10 %",
            standing=standing(beyond, _BEYOND, _FAR_BEYOND),
            words="If the surface is extremely rough, causing the zero-mean Gaussian model to be an inaccurate "
            "approximation, an additional parameter can be used to weight the interreflection component.",
            where="Oren and Nayar 1994, section 4.3, below eq. 29",
        ),
    ]


def _integrated(parameters: Mapping[str, Any]) -> tuple[str, dict[str, Any]] | None:
    """Return the model of integrated facets with its parameters, which the fits with a bounce approximate."""
    if not parameters.get("interreflection", True):
        return None
    return "oren_nayar_gaussian", {"rho": parameters["rho"], "sigma": parameters["sigma"]}


_DRAW = Draw((("sigma", 0.0, math.pi / 3.0), ("offset", 0.33, 0.57)))

SPEC = ModelSpec(
    name="oren_nayar",
    version=2,
    title="Oren-Nayar, functional approximation",
    equation="eqs 27-29",
    reference="orennayar1994",
    parameters=(RHO, SIGMA, INTERREFLECTION),
    evaluate=oren_nayar,
    vectors=oren_nayar_vectors,
    degree=2,
    grazing_pole=True,
    grazing_power=0.0,
    excess=_EXCESS,
    lossless=white,
    forms=forms,
    exact_model=_integrated,
    limits=_limits,
    gradient=oren_nayar_gradient,
    draw=_DRAW,
)
QUALITATIVE_SPEC = ModelSpec(
    name="oren_nayar_qualitative",
    version=2,
    title="Oren-Nayar, qualitative model",
    equation="eq. 30",
    reference="orennayar1994",
    parameters=(RHO, SIGMA, OFFSET),
    evaluate=oren_nayar_qualitative,
    vectors=oren_nayar_qualitative_vectors,
    degree=1,
    grazing_pole=True,
    grazing_power=0.0,
    excess=_EXCESS,
    lossless=white,
    forms=forms,
    exact_model=_integrated,
    limits=_limits,
    gradient=oren_nayar_qualitative_gradient,
    draw=_DRAW,
)
UNIDIRECTIONAL_SPEC = ModelSpec(
    name="oren_nayar_unidirectional",
    version=1,
    title="Oren-Nayar, parallel cavities of one slope",
    equation="eqs 10-22",
    reference="orennayar1994",
    parameters=(RHO, THETA_A, PHI_A),
    evaluate=oren_nayar_unidirectional,
    vectors=oren_nayar_unidirectional_vectors,
    degree=2,
    grazing_pole=True,
    grazing_power=0.0,
    anisotropic=lambda parameters: parameters["theta_a"] > 0.0,
    lossless=white,
    limits=_facets,
)
SINGLE_SLOPE_SPEC = ModelSpec(
    name="oren_nayar_single_slope",
    version=2,
    title="Oren-Nayar, one slope in all azimuths",
    equation="eqs 45, 49",
    reference="orennayar1994",
    parameters=(RHO, THETA_A),
    evaluate=oren_nayar_single_slope,
    vectors=oren_nayar_single_slope_vectors,
    degree=2,
    grazing_pole=True,
    grazing_power=0.0,
    excess=_SINGLE_SLOPE_EXCESS,
    lossless=white,
    limits=_facets,
)
GAUSSIAN_SPEC = ModelSpec(
    name="oren_nayar_gaussian",
    version=2,
    title="Oren-Nayar, Gaussian slopes, integrated",
    equation="eqs 8, 10-20, 47",
    reference="orennayar1994",
    parameters=(RHO, SIGMA),
    evaluate=oren_nayar_gaussian,
    vectors=oren_nayar_gaussian_vectors,
    degree=2,
    grazing_pole=True,
    grazing_power=0.0,
    lossless=white,
    forms=forms,
    highest_rung="facets integrated, eqs 8-20 and 47",
    limits=_limits,
    slow=True,
)
BODY_SURFACE_SPEC = ModelSpec(
    name="oren_nayar_body_surface",
    version=1,
    title="Oren-Nayar body with a Torrance-Sparrow surface",
    equation="eq. 32",
    reference="orennayar1994",
    parameters=(RHO, SIGMA, K_S, K_B, E_0, WITH_INTERREFLECTION),
    evaluate=oren_nayar_body_surface,
    vectors=oren_nayar_body_surface_vectors,
    grazing_pole=True,
    grazing_power=0.0,
    lobe=body_surface_lobe,
    excess=_BODY_SURFACE_EXCESS,
    forms=forms,
    limits=_limits,
)
