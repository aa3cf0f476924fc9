"""Heitz 2014: mirror facets of GGX or Beckmann slopes, shadowing correlated in height; formulas in `_microfacets`."""

from __future__ import annotations

from collections.abc import Iterator

from brdfdb.geometry import Directions
from brdfdb.lobes import GAUSSIAN, GGX
from brdfdb.models._microfacets import (
    ALPHA_X,
    ALPHA_Y,
    BECKMANN_LOOPS,
    BECKMANN_SCHLICK_LOOPS,
    F_0,
    GGX_LOOPS,
    GGX_SCHLICK_LOOPS,
    RHO_D,
    lobe_of_metal,
    lobe_of_painted,
    lossless_metal,
    lossless_painted,
    metal,
    painted,
)
from brdfdb.models._rows import Out
from brdfdb.models.declaration import DeclaredModel, ModelFunction
from brdfdb.models.walter_2007 import (
    BECKMANN_HEIGHTS,
    BECKMANN_SURFACE,
    GGX_HEIGHTS,
    GGX_SURFACE,
    beckmann_separable,
    ggx_separable,
)
from brdfdb.models.ward_1992 import ward
from brdfdb.parameters import WAVELENGTH_NM, Arguments, Floats, FormKind, K, ModelForm, N, bytes_of


def _form(
    key: str, title: str, kind: FormKind, model: ModelFunction, arguments: Arguments, *, single: bool = False
) -> ModelForm:
    return ModelForm(key, title, kind, f"models.{model.__name__}", model.vectors, bytes_of(arguments), single)


def ggx_forms(arguments: Arguments) -> Iterator[ModelForm]:
    """Yield the forms that charts compare: the shadowing of programs, and Beckmann's slopes at the same alpha."""
    yield _form("correlated", "GGX, correlated shadowing", "exact", ggx, arguments, single=True)
    yield _form("separable", "separable shadowing", "customary", ggx_separable, arguments, single=True)
    yield _form("beckmann", "Beckmann of the same alpha", "other model", beckmann, arguments)


def beckmann_forms(arguments: Arguments) -> Iterator[ModelForm]:
    """Yield the forms that charts compare: the shadowing of programs, and the slopes of GGX at the same alpha."""
    yield _form("correlated", "Beckmann, correlated shadowing", "exact", beckmann, arguments, single=True)
    yield _form("separable", "separable shadowing, fitted", "customary", beckmann_separable, arguments)
    yield _form("ggx", "GGX of the same alpha", "other model", ggx, arguments)


def _ward(wi: Floats, wr: Floats, *, rho_d: float, f_0: float, alpha_x: float, alpha_y: float) -> Floats:
    return ward.vectors(wi, wr, rho_d=rho_d, rho_s=f_0, alpha_x=alpha_x, alpha_y=alpha_y)


def schlick_forms(arguments: Arguments) -> Iterator[ModelForm]:
    """Yield the forms that charts compare: GGX, Beckmann and Ward, with the same reflectance and the same alpha."""
    yield _form("ggx", "GGX, Schlick", "exact", ggx_schlick, arguments, single=True)
    yield _form("beckmann", "Beckmann of the same alpha", "other model", beckmann_schlick, arguments)
    title = "Ward of the same alpha, rho_s = f_0"
    yield ModelForm("ward", title, "other model", "models.ward", _ward, bytes_of(arguments))


def beckmann_schlick_forms(arguments: Arguments) -> Iterator[ModelForm]:
    """Yield the forms that charts compare: Beckmann and GGX, with the same reflectance and the same alpha."""
    yield _form("beckmann", "Beckmann, Schlick", "exact", beckmann_schlick, arguments, single=True)
    yield _form("ggx", "GGX of the same alpha", "other model", ggx_schlick, arguments)


# The albedo was measured for narrow lobes, rho_d = 1 and f_0 = 0.04
_EXCESS = (
    "Schlick 1994: the facets reflect all light at grazing and take none of it from the uniform part, which no paper "
    "couples; measured 1.96 at 89.5 degrees for rho_d = 1 and f_0 = 0.04"
)


@DeclaredModel(
    title="GGX",
    equation="eq. 99, GGX",
    references="heitz2014, walter2007, trowbridgereitz1975",
    parameters=(ALPHA_X, ALPHA_Y),
    light=(N, K),
    optional=(WAVELENGTH_NM,),
    grazing_pole=True,
    grazing_power=0.0,
    lobe_axes=("alpha_x", "alpha_y"),
    lobe=lobe_of_metal(GGX),
    lossless=lossless_metal,
    forms=ggx_forms,
    surfaces=(GGX_SURFACE,),
    heights=GGX_HEIGHTS,
)
def ggx(directions: Directions, out: Out, *parameters: Floats) -> Floats:
    """Return the BRDF [1/sr] of mirror facets with GGX slopes (Trowbridge-Reitz), of a metal or a dielectric.

    F D G / (4 cos theta_i cos theta_r) with Smith's shadowing of light and viewer, correlated in height, eq. (99), and
    alpha^2 = (alpha_x cos phi)^2 + (alpha_y sin phi)^2 towards each direction. F is the reflectance of unpolarised
    light at half the angle between light and viewer. Light that facets reflect to one another is lost: with F = 1 the
    albedo is 0.69 at normal incidence for an alpha of 0.5. Where both directions reach 90 degrees, f_r grows as
    1 / cos. There it is the finite value at the float64 nearest pi/2.

    A share 1 / (1 + t^2) of the slopes exceeds t alpha. The same alpha of Ward's model is another surface, because the
    tails of GGX are long. The formula does not read the wavelength, which is that of n and k.

    >>> round(float(ggx(0.3, 0.0, 0.4, np.pi, alpha_x=0.2, alpha_y=0.3, n=0.95, k=2.6)), 4)
    0.8565
    """
    return GGX_LOOPS.evaluated(directions, out, metal(*parameters))


@DeclaredModel(
    title="GGX, Schlick's reflectance",
    equation="eq. 99, GGX",
    references="heitz2014, schlick1994",
    parameters=(RHO_D, F_0, ALPHA_X, ALPHA_Y),
    degree=1,
    grazing_pole=True,
    grazing_power=0.0,
    lobe_axes=("alpha_x", "alpha_y"),
    lobe=lobe_of_painted(GGX),
    uniform="rho_d",
    excess=_EXCESS,
    lossless=lossless_painted,
    forms=schlick_forms,
)
def ggx_schlick(directions: Directions, out: Out, *parameters: Floats) -> Floats:
    """Return the BRDF [1/sr] of GGX facets with Schlick's reflectance over a uniform part.

    `ggx` with F = f_0 + (1 - f_0) (1 - cos)^5 of the angle on the facet, and rho_d / pi. The facets take nothing from
    the uniform part, so the sum may reflect more than it receives towards grazing, where F is 1.

    >>> round(float(ggx_schlick(0.3, 0.0, 0.4, np.pi, rho_d=0.1, f_0=0.05, alpha_x=0.2, alpha_y=0.3)), 4)
    0.0987
    """
    return GGX_SCHLICK_LOOPS.evaluated(directions, out, painted(*parameters))


@DeclaredModel(
    title="Beckmann",
    equation="eq. 99, Beckmann",
    references="heitz2014, walter2007, beckmannspizzichino1963",
    parameters=(ALPHA_X, ALPHA_Y),
    light=(N, K),
    optional=(WAVELENGTH_NM,),
    grazing_pole=True,
    grazing_power=0.0,
    lobe_axes=("alpha_x", "alpha_y"),
    lobe=lobe_of_metal(GAUSSIAN),
    lossless=lossless_metal,
    forms=beckmann_forms,
    surfaces=(BECKMANN_SURFACE,),
    heights=BECKMANN_HEIGHTS,
)
def beckmann(directions: Directions, out: Out, *parameters: Floats) -> Floats:
    """Return the BRDF [1/sr] of mirror facets with Gaussian slopes (Beckmann), of a metal or a dielectric.

    As `ggx`, with the Lambda of a Gaussian, which has an error function. `beckmann_separable` has the approximation
    that programs use. Where both directions reach 90 degrees, f_r grows as 1 / cos.

    The widths are those of slopes whose density is exp(-(slope / alpha)^2), as in `ward`.

    >>> round(float(beckmann(0.3, 0.0, 0.4, np.pi, alpha_x=0.2, alpha_y=0.3, n=0.95, k=2.6)), 4)
    0.9109
    """
    return BECKMANN_LOOPS.evaluated(directions, out, metal(*parameters))


@DeclaredModel(
    title="Beckmann, Schlick's reflectance",
    equation="eq. 99, Beckmann",
    references="heitz2014, schlick1994, beckmannspizzichino1963",
    parameters=(RHO_D, F_0, ALPHA_X, ALPHA_Y),
    degree=1,
    grazing_pole=True,
    grazing_power=0.0,
    lobe_axes=("alpha_x", "alpha_y"),
    lobe=lobe_of_painted(GAUSSIAN),
    uniform="rho_d",
    excess=_EXCESS,
    lossless=lossless_painted,
    forms=beckmann_schlick_forms,
)
def beckmann_schlick(directions: Directions, out: Out, *parameters: Floats) -> Floats:
    """Return the BRDF [1/sr] of facets with Gaussian slopes and Schlick's reflectance over a uniform part.

    `beckmann` with the F of `ggx_schlick`, and rho_d / pi.

    >>> round(float(beckmann_schlick(0.3, 0.0, 0.4, np.pi, rho_d=0.1, f_0=0.05, alpha_x=0.2, alpha_y=0.3)), 4)
    0.103
    """
    return BECKMANN_SCHLICK_LOOPS.evaluated(directions, out, painted(*parameters))
