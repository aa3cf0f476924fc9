"""Oren and Nayar 1994: rough surfaces of Lambertian facets, as fits, as closed forms, and integrated.

The fits of the paper are `oren_nayar` and `oren_nayar_qualitative`. The others take the facets one by one: parallel
cavities of one slope, one slope in all azimuths, and Gaussian slopes. `oren_nayar_body_surface` adds Torrance and
Sparrow's lobe.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from operator import attrgetter
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.errors import counted
from brdfdb.gauss import gauss_rule
from brdfdb.geometry import Directions, Vectors, checked_vectors, degrees, finished
from brdfdb.lobes import Lobe
from brdfdb.models import torrance_sparrow_1967
from brdfdb.models._geometrical_optics import LARGE_FACETS, NO_SPECULAR_PART
from brdfdb.models._oren_nayar_facets import NODES, bounce_of_cavity, direct_of_cavity, gaussian
from brdfdb.models._oren_nayar_kernels import (
    functional_angle_rows,
    functional_gradient_rows,
    functional_vector_rows,
    qualitative_angle_rows,
    qualitative_gradient_rows,
    qualitative_vector_rows,
    rest_of_angle,
)
from brdfdb.models._oren_nayar_single_slope import bounce_of_slope, direct_of_slope, over_slopes
from brdfdb.models._rows import Out, RowLoops, by_rows, by_rows_of_vectors
from brdfdb.models.declaration import DeclaredModel, Slopes, of_directions
from brdfdb.models.fujii_2013 import oren_nayar_fujii
from brdfdb.models.lambert import lambert
from brdfdb.models.portsmouth_2025 import oren_nayar_energy_preserving
from brdfdb.models.torrance_sparrow_1967 import torrance_sparrow
from brdfdb.parameters import (
    Arguments,
    Draw,
    Floats,
    FormKind,
    HeightRelation,
    K,
    ModelForm,
    N,
    Parameter,
    StatedLimit,
    SurfaceAssumption,
    SurfaceRelation,
    standing,
    white,
)

RHO = Parameter("rho", "ρ", "1", 0.0, 1.0, "albedo of a facet", reflectance=True)
SIGMA = Parameter("sigma", "σ", "rad", 0.0, np.pi / 2, "standard deviation of the facets' slope angle")
INTERREFLECTION = Parameter("interreflection", "L²", "1", 0.0, 1.0, "add the second bounce of eq. 28", default=True)
OFFSET = Parameter(
    "offset", "", "1", 0.0, 10.0, "constant in A; 0.57 stands in for interreflection (note 7)", default=0.33
)
THETA_A = Parameter("theta_a", "θ_a", "rad", 0.0, np.pi / 2, "slope of the facets")
PHI_A = Parameter("phi_a", "φ_a", "rad", 0.0, np.pi, "azimuth of the facets' normals, and half a turn from it")
K_B = Parameter("k_b", "k_b", "1", 0.0, 1.0, "weight of the body's reflection", default=1.0, reflectance=True)
K_S = Parameter("k_s", "k_s", "1", 0.0, 1.0, "weight of the surface's reflection, eq. 31 as printed", reflectance=True)
E_0 = Parameter(
    "e_0", "E_0", "1", 1.0, 10.0, "irradiance of a facet facing the light, in the unit of eq. 31", default=1.0
)
_WITH_INTERREFLECTION = replace(INTERREFLECTION, default=False)

PartName = Literal["direct", "interreflected"]  # a field of `Parts`


class Parts(NamedTuple):
    """The two parts of the BRDF [1/sr] of Lambertian facets: light reflected once, and light reflected twice."""

    direct: Floats
    interreflected: Floats


# Limits and excesses that the paper states, or that were measured

# Shares of a Gaussian of slopes beyond 90 degrees, up to which a surface is inside the limits or at their edge
_BEYOND = 0.01
_FAR_BEYOND = 0.1

# The albedo was measured at rho = 1 over sigma. It reaches 1.0510 (sigma of 17 degrees) and exceeds 1 from 50 degrees
# on. The albedo of the qualitative model reaches 1.015, or 1.044 with an offset of 0.57
_EXCESS = (
    "Oren and Nayar 1994, eqs 27, 28 and 30: near grazing and with an albedo near 1 the fit reflects up to "
    "5 % more than it receives, for sigma below 40 degrees"
)

_OF_SLOPE = SurfaceRelation(
    facets="diffuse",
    bounces="one",
    words="sigma [rad] is the slope along an axis, as facets of small slopes have it",
    parameters=("sigma",),
    per_slope=1.0,
    bounds=(1e-4, 1.5),
)
_OF_HEIGHTS = HeightRelation(
    lambda surface: {"sigma": surface.slope},
    "sigma is the rms slope along an axis, as an angle in radians",
    (
        LARGE_FACETS,
        NO_SPECULAR_PART,
        SurfaceAssumption("Gaussian slopes", "The slopes are Gaussian.", "Oren and Nayar 1994, eq. 26"),
        SurfaceAssumption("diffuse facets", "The facets are Lambertian.", "Oren and Nayar 1994, eq. 10"),
    ),
)


def _facets(_: Arguments) -> list[StatedLimit]:
    """Return the limit that Oren and Nayar state for all their surfaces."""
    return [
        StatedLimit(
            quantity="area of facets / wavelength^2",
            value="not a parameter of the model",
            valid="at least 10",
            standing="unknown",
            words=LARGE_FACETS.words,
            where=LARGE_FACETS.where,
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


# Forms that charts compare

_NODES = (8, 6, 4, 3, 2, 1)  # nodes of the coarser quadratures of the facets; the exact form has 16
# Slopes of eq. 25 over the closed forms. 2000 slopes change the mean of f_r by 3e-5 and no value by more than 1e-3
_SLOPES = 24
_WIDEST = 6.0  # range of the integral over slopes, in standard deviations


def forms(arguments: Arguments) -> Iterator[ModelForm]:
    """Yield the forms at the albedo and sigma of a model. The surface of the body and surface model is added to each.

    The integrated facets come first. Forms with a bounce approximate facets with a bounce. Forms without it approximate
    facets in direct light.
    """
    sigma = float(arguments["sigma"])
    bounces = bool(arguments.get("interreflection", True))

    def form(
        key: str,
        title: str,
        kind: FormKind,
        python: str,
        body: Callable[..., Floats],
        constants: int = 0,
        single: bool = False,
        degree: Literal[1, 2] | None = 2,
        **more: Any,
    ) -> ModelForm:
        def vectors(wi: Floats, wr: Floats, **given: Any) -> Floats:
            f_r = body(wi, wr, rho=given["rho"], sigma=sigma, **more)
            if "k_s" in given:
                surface = torrance_sparrow.vectors(wi, wr, sigma=sigma)
                # Eq. (32)
                f_r = given["k_b"] * f_r + given["k_s"] / given["e_0"] * surface
            return f_r

        return ModelForm(key, title, kind, f"models.{python}", vectors, 8 * (2 + len(more) + constants), single, degree)

    facets = functools.partial(gaussian_rung, nodes=NODES, bounce=bounces)
    title = "facets integrated, eqs 8-20 and 47"
    yield form("facets", title, "exact", "oren_nayar_gaussian", facets, 2 * NODES, single=True)
    for nodes in _NODES:
        rung = functools.partial(gaussian_rung, nodes=nodes, bounce=bounces)
        title = f"facets, {counted(nodes, 'node')} of {NODES}"
        python = "oren_nayar_1994.gaussian_rung"
        yield form(f"facets-{nodes}", title, "quadrature", python, rung, 2 * (NODES + nodes))
    averaged = "oren_nayar_1994.single_slope_mean"
    closed = functools.partial(_over_slopes, bounce=bounces)
    equations = "eqs 45 and 49" if bounces else "eq. 45"
    yield form("closed-forms", f"closed forms of B.2, {equations}", "closed form", averaged, closed, 3 * _SLOPES)
    if bounces:
        both = 3 * _SLOPES + 2 * NODES
        own_bounce = _mixed("direct", functools.partial(_over_slopes, lit=False))
        yield form("bounce-49", "facets, but eq. 49 for the bounce", "printed", averaged, own_bounce, both)
        own_direct = _mixed("interreflected", functools.partial(_over_slopes, bounce=False))
        yield form("direct-45", "facets, but eq. 45 for direct light", "closed form", averaged, own_direct, both)
    fit = oren_nayar.vectors
    title = "functional fit, eqs 27-29"
    yield form("fit", title, "approximation", "oren_nayar", fit, single=True, interreflection=bounces)
    if bounces:
        title = "fit without bounce, eq. 27"
        yield form("fit-direct", title, "approximation", "oren_nayar", fit, interreflection=False)
    for key, title, offset in (
        ("qualitative", "qualitative, eq. 30", 0.33),
        ("qualitative-057", "qualitative, 0.57 (note 7)", 0.57),
    ):
        rough = oren_nayar_qualitative.vectors
        yield form(key, title, "approximation", "oren_nayar_qualitative", rough, offset=offset)
    if sigma <= 1.0:
        yield form("fujii", "Fujii's form", "approximation", "oren_nayar_fujii", oren_nayar_fujii.vectors)
        yield form("eon", "energy preserving (EON)", "other model", "oren_nayar_energy_preserving", _eon, degree=None)
    yield form("lambert", "Lambert, no roughness", "approximation", "lambert", _smooth)


def _eon(wi: Floats, wr: Floats, *, rho: float, sigma: float) -> Floats:
    return oren_nayar_energy_preserving.vectors(wi, wr, rho=rho, roughness=sigma)


def _smooth(wi: Floats, wr: Floats, *, rho: float, **_: float) -> Floats:
    return lambert.vectors(wi, wr, rho=rho)


def _mixed(facets: PartName, other: Callable[..., Floats]) -> Callable[..., Floats]:
    """Return a function of vectors that takes one part from the facets and the other part from another form."""

    def evaluate(wi: Floats, wr: Floats, **own: float) -> Floats:
        return gaussian_part(wi, wr, **own, part=facets) + other(wi, wr, **own)

    return evaluate


def _over_slopes(wi: Floats, wr: Floats, *, rho: float, sigma: float, lit: bool = True, bounce: bool = True) -> Floats:
    """Return f_r [1/sr] of the closed forms, eqs 45 and 49, averaged over slopes by the weights of eqs 25 and 26."""
    theta_a, weight = _slopes(sigma)
    return single_slope_mean(wi, wr, rho=rho, theta_a=theta_a, weight=weight, lit=lit, bounce=bounce)


@functools.cache
def _slopes(sigma: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return slopes [rad] and their weights [1], which add up to 1, each of shape (_SLOPES,)."""
    x, w = gauss_rule(_SLOPES)
    deviation = max(sigma, 1e-9)  # above 0, because all slopes of a flat surface are 0
    theta_a = (x + 1.0) * min(np.pi / 2, _WIDEST * deviation) / 2.0
    weight = w * np.exp(-(theta_a**2) / (2.0 * deviation**2)) * np.sin(theta_a)
    return theta_a, weight / weight.sum()


# The fits

_FUNCTIONAL = RowLoops(
    functional_angle_rows,
    functional_vector_rows,
    columns=attrgetter("cos_dphi", "one_less_abs_cos_dphi"),  # the latter is magnified by tan_mean near grazing
    polar=attrgetter("theta_i", "sin_i", "cos_i", "theta_r", "sin_r", "cos_r"),
    of_viewers=True,
    single=True,
)


@DeclaredModel(
    version=2,
    title="Oren-Nayar, functional approximation",
    equation="eqs 27-29",
    references="orennayar1994",
    parameters=(RHO, SIGMA, INTERREFLECTION),
    degree=2,
    grazing_pole=True,
    grazing_power=0.0,
    excess=_EXCESS,
    lossless=white,
    forms=forms,
    exact_model=_integrated,
    limits=_limits,
    slopes=Slopes(functional_gradient_rows, ("rho", "sigma")),
    draw=_DRAW,
    surfaces=(
        replace(_OF_SLOPE, bounces="two", by_rho=True, arguments={"interreflection": True}),
        replace(_OF_SLOPE, arguments={"interreflection": False}),
    ),
    heights=_OF_HEIGHTS,
)
def oren_nayar(directions: Directions, out: Out, *parameters: Floats) -> Floats:
    """Return the BRDF [1/sr] of Lambertian V-cavities with Gaussian slopes, by the functional fit of the paper.

    Eqs (27) to (29), divided by E_0 cos theta_i. beta is the smaller of the two polar angles, so tan beta grows
    without bound only where both reach 90 degrees. There the value is the one at the float64 nearest pi/2.

    Departures from the paper: f_r is 0 where the fit falls below 0, which happens for rough dark surfaces at grazing
    angles in the forward direction. Published excess: with rho = 1 the directional albedo reaches 1.05 near grazing,
    for sigma below 40 degrees.

    >>> round(float(oren_nayar(0.3, 0.0, 0.4, 0.0, rho=0.9, sigma=0.5)), 4)
    0.2639
    """
    return _functional(directions, out, *parameters)


def _functional(directions: Directions, out: Out, *parameters: Floats) -> Floats:
    return _FUNCTIONAL.evaluated(directions, out, parameters)


@DeclaredModel(
    version=2,
    title="Oren-Nayar, qualitative model",
    equation="eq. 30",
    references="orennayar1994",
    parameters=(RHO, SIGMA, OFFSET),
    degree=1,
    grazing_pole=True,
    grazing_power=0.0,
    excess=_EXCESS,
    lossless=white,
    forms=forms,
    exact_model=_integrated,
    limits=_limits,
    slopes=Slopes(qualitative_gradient_rows, ("rho", "sigma", "offset")),
    draw=_DRAW,
    surfaces=(
        replace(_OF_SLOPE, arguments={"offset": 0.33}),
        replace(_OF_SLOPE, bounces="two", by_rho=True, arguments={"offset": 0.57}),
    ),
)
def oren_nayar_qualitative(directions: Directions, out: Out, *parameters: Floats) -> Floats:
    """Return the BRDF [1/sr] of the qualitative model: the fit without its third term and without interreflection.

    Eq. (30), divided by E_0 cos theta_i.

    >>> round(float(oren_nayar_qualitative(0.3, 0.0, 0.4, 0.0, rho=0.9, sigma=0.5)), 4)
    0.2362
    """
    return _qualitative(directions, out, *parameters)


def _qualitative(directions: Directions, out: Out, *parameters: Floats) -> Floats:
    if isinstance(directions, Vectors):
        return by_rows_of_vectors(qualitative_vector_rows, directions, parameters, out)
    if directions.lights_scattered:
        return finished(by_rows_of_vectors(qualitative_vector_rows, directions.vectors, parameters, out), directions)
    sin_alpha = np.maximum(directions.sin_i, directions.sin_r)
    tan_beta = np.minimum(np.tan(directions.theta_i), np.tan(directions.theta_r))
    scalars = (sin_alpha, tan_beta, *parameters)
    return finished(by_rows(qualitative_angle_rows, (directions.cos_dphi,), scalars, directions.dtype, out), directions)


def _returns(model: str) -> str:
    return f"Parts [1/sr]\n    The arrays `direct` and `interreflected`, which add up to `{model}`."


@of_directions(
    parameters=(RHO, SIGMA),
    references="orennayar1994",
    returns=f"""{_returns("oren_nayar")} Where eq. (27) falls below 0, the direct
    part is 0 and the sum of both equations, if positive, is the other part.""",
)
def oren_nayar_parts(directions: Directions, rho: Floats, sigma: Floats) -> Parts:
    """Return the parts [1/sr] of `oren_nayar`: direct light (eq. 27) and the second bounce (eq. 28).

    >>> parts = oren_nayar_parts(0.3, 0.0, 0.4, 0.0, rho=0.9, sigma=0.5)
    >>> round(float(parts.direct), 4), round(float(parts.interreflected), 4)
    (0.2362, 0.0278)
    """
    in_float64 = _in_float64(directions)
    direct = _functional(in_float64, None, rho, sigma, np.zeros(()))
    total = _functional(in_float64, None, rho, sigma, np.ones(()))
    variance = sigma**2
    cos_dphi = directions.cos_dphi
    # 1 - cos(dphi) x^2 with x = 2 beta / pi, without a difference where both are near 1
    rest = rest_of_angle(np.minimum(directions.sin_i, directions.sin_r), np.maximum(directions.cos_i, directions.cos_r))
    less = rest * (2.0 / np.pi) * (2.0 - rest * (2.0 / np.pi))  # 1 - x^2
    near_1 = directions.one_less_abs_cos_dphi + cos_dphi * less
    bracket = np.where(cos_dphi > 0.0, near_1, 1.0 - cos_dphi * (1.0 - less))
    # Eq. (28)
    bounce = 0.17 * rho**2 / np.pi * variance / (variance + 0.13) * bracket
    return Parts(finished(direct, directions), finished(np.where(direct > 0.0, bounce, total), directions))


def _in_float64(directions: Directions) -> Directions:
    """Return the directions for values in float64, whatever their dtype."""
    if isinstance(directions, Vectors):
        return Vectors(directions.w_i.astype(np.float64), directions.w_r.astype(np.float64), np.dtype(np.float64))
    return replace(directions, dtype=np.dtype(np.float64))


# Facets of one slope


@DeclaredModel(
    title="Oren-Nayar, parallel cavities of one slope",
    equation="eqs 10-22",
    references="orennayar1994",
    parameters=(RHO, THETA_A, PHI_A),
    degree=2,
    grazing_pole=True,
    grazing_power=0.0,
    anisotropic=lambda parameters: parameters["theta_a"] > 0.0,
    lossless=white,
    limits=_facets,
    surfaces=(
        SurfaceRelation(
            facets="diffuse", bounces="two", parameters=("theta_a",), arguments={"phi_a": 0.0}, grooves=True
        ),
    ),
)
def oren_nayar_unidirectional(directions: Directions, rho: Floats, theta_a: Floats, phi_a: Floats) -> Floats:
    """Return the BRDF [1/sr] of parallel V-cavities of one slope, exact in direct light and the second bounce.

    Eq. (22), the mean over both facets of a cavity. Eqs (10) and (11) give direct light, and eqs (15) to (20) the light
    from the opposite facet. The BRDF is anisotropic, and mirror symmetric only for phi_a along an axis. It grows as
    1 / cos towards exact backscatter at grazing. At 90 degrees it is the finite value at the float64 nearest pi/2.

    Departures from the paper: GAF = Min[1, Max[0, Min[A, B]]], as eq. 33 of the paper requires. The shadowed row of
    Table 1 is divided by <v,n>, not <s,a>. A facet that faces away from light or viewer adds no direct light, but one
    that faces away from the light alone is lit by its neighbour. Eqs (15) and (16) are as printed: m_v and m_s are the
    masked and shadowed widths, which the text of the paper calls visible and illuminated.

    >>> round(float(oren_nayar_unidirectional(0.9, 0.0, 0.4, 0.0, rho=0.9, theta_a=0.5, phi_a=0.2)), 4)
    0.3133
    """
    return _total(_unidirectional(directions, rho, theta_a, phi_a))


@of_directions(
    parameters=(RHO, THETA_A, PHI_A), references="orennayar1994", returns=_returns("oren_nayar_unidirectional")
)
def oren_nayar_unidirectional_parts(directions: Directions, rho: Floats, theta_a: Floats, phi_a: Floats) -> Parts:
    """Return the parts [1/sr] of `oren_nayar_unidirectional`: direct light and the second bounce.

    >>> parts = oren_nayar_unidirectional_parts(0.9, 0.0, 0.9, np.pi, rho=0.9, theta_a=0.7, phi_a=0.0)
    >>> round(float(parts.direct), 4), round(float(parts.interreflected), 4)
    (0.0, 0.0913)
    """
    return _finished_parts(_unidirectional(directions, rho, theta_a, phi_a), directions)


def _unidirectional(directions: Directions, rho: Floats, theta_a: Floats, phi_a: Floats) -> Parts:
    x_a, y_a = np.cos(phi_a), np.sin(phi_a)
    # tan(theta) cos(phi - phi_a)
    slope_i = (directions.x_i * x_a + directions.y_i * y_a) / directions.cos_i
    slope_r = (directions.x_r * x_a + directions.y_r * y_a) / directions.cos_r
    facet = slope_i, slope_r, np.sin(theta_a), np.cos(theta_a)
    return _scaled(direct_of_cavity(*facet), bounce_of_cavity(*facet), rho)


def _scaled(direct: Floats, bounce: Floats, rho: Floats) -> Parts:
    """Return the parts of the BRDF [1/sr] from radiances divided by rho E_0 cos(theta_i) / pi, and by rho more."""
    return Parts(rho / np.pi * direct, rho * rho / np.pi * bounce)


def _total(parts: Parts) -> Floats:
    # Eq. (21)
    return parts.direct + parts.interreflected


def _finished_parts(parts: Parts, directions: Directions) -> Parts:
    return Parts(finished(parts.direct, directions), finished(parts.interreflected, directions))


@DeclaredModel(
    version=2,
    title="Oren-Nayar, one slope in all azimuths",
    equation="eqs 45, 49",
    references="orennayar1994",
    parameters=(RHO, THETA_A),
    degree=2,
    grazing_pole=True,
    grazing_power=0.0,
    # The albedo was measured at rho = 1 over theta_a. It reaches 1.0625 (theta_a of 41 degrees, theta_i of 89.999) and
    # exceeds 1 from 74 degrees on. The weights of eq. 44 cause this: the integrals of eqs 23 and 46 stay below 1
    excess="Oren and Nayar 1994, eqs 44, 45 and 49: near grazing and with an albedo near 1 the closed forms "
    "reflect up to 6 % more than they receive, for slopes below 60 degrees",
    lossless=white,
    limits=_facets,
)
def oren_nayar_single_slope(directions: Directions, rho: Floats, theta_a: Floats) -> Floats:
    """Return the BRDF [1/sr] of V-cavities of one slope in all azimuths, by the closed forms of the paper.

    Eqs (45), which is (24), and (49). They are exact for direct light in the plane of incidence and across it. Between
    them eq. (44) weights the two. The second bounce has the interreflection factor of eq. (48), not (47). f_r grows as
    1 / cos towards exact backscatter at grazing. At 90 degrees it is the finite value at the float64 nearest pi/2.

    >>> round(float(oren_nayar_single_slope(0.9, 0.0, 0.4, 0.0, rho=0.9, theta_a=0.5)), 4)
    0.2969
    """
    return _total(_single_slope(directions, rho, theta_a))


@of_directions(parameters=(RHO, THETA_A), references="orennayar1994", returns=_returns("oren_nayar_single_slope"))
def oren_nayar_single_slope_parts(directions: Directions, rho: Floats, theta_a: Floats) -> Parts:
    """Return the parts [1/sr] of `oren_nayar_single_slope`: direct light and the second bounce.

    >>> parts = oren_nayar_single_slope_parts(0.9, 0.0, 0.9, np.pi, rho=0.9, theta_a=0.7)
    >>> round(float(parts.direct), 4), round(float(parts.interreflected), 4)
    (0.0997, 0.0717)
    """
    return _finished_parts(_single_slope(directions, rho, theta_a), directions)


def _single_slope(directions: Directions, rho: Floats, theta_a: Floats) -> Parts:
    """Return both parts [1/sr] of the closed forms."""
    facet = *_features(directions), np.sin(theta_a), np.cos(theta_a)
    return _scaled(direct_of_slope(*facet), bounce_of_slope(*facet), rho)


class _Features(NamedTuple):
    """Terms of the directions in the closed forms: two tangents [1], cos(dphi) and 1 - abs(cos(dphi)) [1]."""

    tan_i: Floats
    tan_r: Floats
    cos_dphi: Floats
    one_less_abs_cos_dphi: Floats


def _features(directions: Directions) -> _Features:
    tan_i, tan_r = directions.sin_i / directions.cos_i, directions.sin_r / directions.cos_r
    return _Features(tan_i, tan_r, directions.cos_dphi, directions.one_less_abs_cos_dphi)


def single_slope_mean(
    wi: ArrayLike,
    wr: ArrayLike,
    *,
    rho: ArrayLike,
    theta_a: NDArray[np.float64],
    weight: NDArray[np.float64],
    lit: bool = True,
    bounce: bool = True,
) -> Floats:
    """Return the mean f_r [1/sr] of `oren_nayar_single_slope_vectors` over slopes `theta_a` [rad] with weights.

    It includes direct light if `lit`, and the second bounce if `bounce`. Slopes and weights have the shape (S,), and
    vectors (N, 3).
    """
    directions = checked_vectors(wi, wr)
    direct, bounced = over_slopes(*_features(directions), theta_a, weight, lit=lit, bounce=bounce)
    return finished(_total(_scaled(direct, bounced, RHO.check(rho))), directions)


# Facets with Gaussian slopes


@DeclaredModel(
    version=2,
    title="Oren-Nayar, Gaussian slopes, integrated",
    equation="eqs 8, 10-20, 47",
    references="orennayar1994",
    parameters=(RHO, SIGMA),
    degree=2,
    grazing_pole=True,
    grazing_power=0.0,
    lossless=white,
    forms=forms,
    highest_rung="facets integrated, eqs 8-20 and 47",
    limits=_limits,
    slow=True,
    surfaces=(replace(_OF_SLOPE, bounces="two", by_rho=True),),
)
def oren_nayar_gaussian(directions: Directions, rho: Floats, sigma: Floats) -> Floats:
    """Return the BRDF [1/sr] of V-cavities with Gaussian slopes, integrated, which the fit `oren_nayar` approximates.

    Eqs (8) and (26) with eqs (10) to (20) for every facet, and eq. (47), without the approximations (44) and (48). The
    weight is normalised to one over the slope. A value takes about 10 us. The error, measured against a refined
    integration, is below 1.1e-6 of the value for any arguments, the horizon included. It is below 3e-8 of the value for
    sigma from 10 to 40 degrees and random directions. f_r grows as 1 / cos towards exact backscatter at grazing. At 90
    degrees it is the finite value at the float64 nearest pi/2.

    Departures from the paper: those of `oren_nayar_unidirectional`.

    >>> round(float(oren_nayar_gaussian(0.3, 0.0, 0.4, 0.0, rho=0.9, sigma=0.5)), 4)
    0.2671
    """
    return _total(_gaussian(directions, rho, sigma))


@of_directions(parameters=(RHO, SIGMA), references="orennayar1994", returns=_returns("oren_nayar_gaussian"))
def oren_nayar_gaussian_parts(directions: Directions, rho: Floats, sigma: Floats) -> Parts:
    """Return the parts [1/sr] of `oren_nayar_gaussian`: direct light and the second bounce.

    >>> parts = oren_nayar_gaussian_parts(0.9, 0.0, 0.9, np.pi, rho=0.9, sigma=0.5)
    >>> round(float(parts.direct), 4), round(float(parts.interreflected), 4)
    (0.1552, 0.0522)
    """
    return _finished_parts(_gaussian(directions, rho, sigma), directions)


def gaussian_part(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike, part: PartName) -> Floats:
    """Return one part [1/sr] of `oren_nayar_gaussian_parts` for unit vectors without computing the other."""
    directions = checked_vectors(wi, wr)
    return finished(getattr(_gaussian(directions, RHO.check(rho), SIGMA.check(sigma), part), part), directions)


def gaussian_rung(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike, nodes: int, bounce: bool = True
) -> Floats:
    """Return f_r [1/sr] of `oren_nayar_gaussian` for unit vectors with a coarser quadrature of `nodes` in [1, 16].

    Without `bounce` it is direct light alone.
    """
    directions = checked_vectors(wi, wr)
    only: PartName | None = None if bounce else "direct"
    parts = _gaussian(directions, RHO.check(rho), SIGMA.check(sigma), only, nodes)
    return finished(_total(parts) if bounce else parts.direct, directions)


def _gaussian(
    directions: Directions, rho: Floats, sigma: Floats, only: PartName | None = None, nodes: int = NODES
) -> Parts:
    """Return both parts [1/sr]. A part that is not requested is undefined."""
    tangents = directions.sin_i / directions.cos_i, directions.sin_r / directions.cos_r
    features = *tangents, directions.cos_dphi, directions.sin_dphi, sigma
    direct, bounce = gaussian(*features, lit=only != "interreflected", bounce=only != "direct", nodes=nodes)
    return _scaled(direct, bounce, rho)


# Body and surface


class _BodySurface(NamedTuple):
    """The parameters of `oren_nayar_body_surface`."""

    rho: Floats
    sigma: Floats
    k_s: Floats
    k_b: Floats
    e_0: Floats
    interreflection: Floats
    n: Floats | None
    k: Floats | None


def _surface_lobe(
    cos_i: Floats,
    *,
    rho: ArrayLike,
    sigma: ArrayLike,
    k_s: ArrayLike,
    k_b: ArrayLike = 1.0,
    e_0: ArrayLike = 1.0,
    **_: ArrayLike,
) -> Lobe:
    """Return the lobe of the surface. Its share follows from the albedos, and its width from sigma."""
    whole = torrance_sparrow_1967.lobe(cos_i, sigma=sigma)
    surface = np.asarray(k_s) / np.asarray(e_0) * 4.0 * np.pi * whole.alpha_x**2  # albedo of a narrow lobe for F = 1
    body = np.asarray(k_b) * np.asarray(rho)
    total = surface + body
    return whole._replace(share=np.divide(surface, total, where=total > 0.0, out=np.zeros(np.shape(total))))


@DeclaredModel(
    title="Oren-Nayar body with a Torrance-Sparrow surface",
    equation="eq. 32",
    references="orennayar1994, torrancesparrow1967",
    parameters=(RHO, SIGMA, K_S, K_B, E_0, _WITH_INTERREFLECTION),
    optional=(N, K),
    grazing_pole=True,
    grazing_power=0.0,
    lobe=_surface_lobe,
    # The excess is the sum of those of the two models, at rho = k_b = k_s = e_0 = 1
    excess="Oren and Nayar 1994, eq. 32: a fitted sum of two radiances, of which that of eq. 31 is not normalised",
    forms=forms,
    limits=_limits,
)
def oren_nayar_body_surface(directions: Directions, *parameters: Floats) -> Floats:
    """Return the BRDF [1/sr] of a rough body with a glossy surface: k_b `oren_nayar` + k_s / e_0 `torrance_sparrow`.

    Eq. (32) with eqs (27) and (31), divided by E_0 cos(theta_i). Weights are fitted, not derived: the sum may reflect
    more than it receives (see `torrance_sparrow`).

    Departures from the paper: eq. 27 has the factor E_0, but eq. 31 as printed does not. The printed k_s / k_b
    therefore carries the unit of a radiance over an irradiance, which the paper does not state. With e_0 = 1 eq. 31
    stands as printed. With e_0 = pi radiances are relative to that of a white Lambertian facet that faces the light.

    The paper prints k_s / k_b: 0.019 foam, 0.085 cotton towel, 0.043 wood shavings. It leaves out the second bounce of
    the body, and its Fresnel coefficient is 1, as it is here without n.

    >>> round(float(oren_nayar_body_surface(0.3, 0.0, 0.4, np.pi, rho=0.8, sigma=0.35, k_s=0.019)), 4)
    0.2338
    """
    p = _BodySurface(*parameters)
    in_float64 = _in_float64(directions)
    body = _functional(in_float64, None, p.rho, p.sigma, p.interreflection)
    surface = torrance_sparrow_1967.facets(in_float64, p.sigma, p.n, p.k)
    # Eq. (32)
    return p.k_b * body + p.k_s / p.e_0 * surface
