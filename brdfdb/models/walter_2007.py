"""Walter et al. 2007: mirror facets of GGX or Beckmann slopes, separable shadowing; formulas in `_microfacets`."""

from __future__ import annotations

from brdfdb.geometry import Directions
from brdfdb.lobes import GAUSSIAN, GGX
from brdfdb.models._geometrical_optics import LARGE_FACETS, NO_SPECULAR_PART
from brdfdb.models._microfacets import (
    ALPHA_X,
    ALPHA_Y,
    BECKMANN_SEPARABLE_LOOPS,
    GGX_SEPARABLE_LOOPS,
    lobe_of_metal,
    lossless_metal,
    metal,
)
from brdfdb.models._rows import Out
from brdfdb.models.declaration import DeclaredModel
from brdfdb.parameters import (
    WAVELENGTH_NM,
    Floats,
    HeightRelation,
    K,
    N,
    SurfaceAssumption,
    SurfaceNumbers,
    SurfaceRelation,
)

GGX_SURFACE = SurfaceRelation(
    facets="mirror", bounces="one", parameters=("alpha_x", "alpha_y"), bounds=(1e-2, 2.0), only_fit=True
)
BECKMANN_SURFACE = SurfaceRelation(
    facets="mirror",
    bounces="one",
    words="alpha is sqrt(2) times the slope along an axis, exactly",
    parameters=("alpha_x", "alpha_y"),
    per_slope=2.0**0.5,
)


def _alphas(surface: SurfaceNumbers) -> dict[str, float]:
    return {"alpha_x": 2.0**0.5 * surface.slope_x, "alpha_y": 2.0**0.5 * surface.slope_y}


def _of_heights(slopes: SurfaceAssumption) -> HeightRelation:
    """Return the relation of mirror-like facets to a measured surface, by the assumption on their slopes."""
    mirrors = SurfaceAssumption("mirror-like facets", "The facets are mirrors.", "Walter et al. 2007, eq. 20")
    words = "alpha is sqrt(2) times the rms slope along an axis"
    return HeightRelation(_alphas, words, (LARGE_FACETS, NO_SPECULAR_PART, slopes, mirrors))


GGX_HEIGHTS = _of_heights(
    SurfaceAssumption(
        "long-tailed slopes",
        "Slopes have tails longer than those of a Gaussian, and no rms value.",
        "Walter et al. 2007, eq. 33",
    )
)
BECKMANN_HEIGHTS = _of_heights(
    SurfaceAssumption("Gaussian slopes", "The slopes are Gaussian.", "Walter et al. 2007, eq. 25")
)


@DeclaredModel(
    title="GGX, separable shadowing",
    equation="eqs 20, 23, 33, 34",
    references="walter2007, trowbridgereitz1975, heitz2014",
    parameters=(ALPHA_X, ALPHA_Y),
    light=(N, K),
    optional=(WAVELENGTH_NM,),
    grazing_power=0.0,
    lobe_axes=("alpha_x", "alpha_y"),
    lobe=lobe_of_metal(GGX),
    lossless=lossless_metal,
    surfaces=(GGX_SURFACE,),
)
def ggx_separable(directions: Directions, out: Out, *parameters: Floats) -> Floats:
    """Return the BRDF [1/sr] of GGX facets with the shadowing of light times that of viewer, as the paper prints it.

    Eq. (20) with D of eq. (33), G of eqs. (23) and (34), and the exact reflectance of unpolarised light. For two alphas
    it takes alpha^2 = (alpha_x cos phi)^2 + (alpha_y sin phi)^2 towards each direction, as Heitz 2014 does. The
    paper has one alpha, for both. Programs evaluate this form, for example Mitsuba's `roughconductor`. A facet low in
    the surface is hidden from both directions. This form counts that twice, so it loses more than `ggx`, most at
    grazing: its albedo is 0.60 at 89 degrees for F = 1 and an alpha of 1, and that of `ggx` is 0.93.

    >>> round(float(ggx_separable(0.3, 0.0, 0.4, np.pi, alpha_x=0.2, alpha_y=0.3, n=0.95, k=2.6)), 4)
    0.8565
    """
    return GGX_SEPARABLE_LOOPS.evaluated(directions, out, metal(*parameters))


@DeclaredModel(
    title="Beckmann, separable shadowing",
    equation="eqs 20, 23, 25, 27",
    references="walter2007, beckmannspizzichino1963",
    parameters=(ALPHA_X, ALPHA_Y),
    light=(N, K),
    optional=(WAVELENGTH_NM,),
    grazing_power=0.0,
    lobe_axes=("alpha_x", "alpha_y"),
    lobe=lobe_of_metal(GAUSSIAN),
    lossless=lossless_metal,
    surfaces=(BECKMANN_SURFACE,),
)
def beckmann_separable(directions: Directions, out: Out, *parameters: Floats) -> Floats:
    """Return the BRDF [1/sr] of Gaussian facets with the paper's approximation of their shadowing.

    Eq. (20) with D of eq. (25), G of eq. (23) and the rational approximation of G_1 in eq. (27). Its value is up to
    0.3 % from that with the error function. At a = 1 / (alpha tan theta) = 1.6, where it becomes 1, it jumps by 6e-5.

    The widths are those of slopes whose density is exp(-(slope / alpha)^2). The paper has one alpha, for both axes.

    >>> round(float(beckmann_separable(0.3, 0.0, 0.4, np.pi, alpha_x=0.2, alpha_y=0.3, n=0.95, k=2.6)), 4)
    0.9109
    """
    return BECKMANN_SEPARABLE_LOOPS.evaluated(directions, out, metal(*parameters))
