"""Heitz 2014: mirror facets with the slopes of GGX or Beckmann, and Smith's shadowing correlated in height."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from numpy.typing import ArrayLike

from brdfdb.lobes import GAUSSIAN, GGX
from brdfdb.models import _microfacets
from brdfdb.models._microfacets import (
    ALPHA_X,
    ALPHA_Y,
    BECKMANN,
    CORRELATED,
    EXACT,
    F_0,
    RHO_D,
    SCHLICK,
    by_angles,
    by_vectors,
    lobe_of_metal,
    lobe_of_painted,
    lossless_metal,
    lossless_painted,
    metal,
    painted,
)
from brdfdb.models.large_calls import for_large_calls
from brdfdb.models.walter_2007 import beckmann_separable_vectors, ggx_separable_vectors
from brdfdb.models.ward_1992 import ward_vectors
from brdfdb.parameters import Arguments, Floats, FormKind, ModelForm, ModelSpec, bytes_of

_GGX, _GGX_SCHLICK = (_microfacets.GGX, CORRELATED, EXACT), (_microfacets.GGX, CORRELATED, SCHLICK)
_BECKMANN, _BECKMANN_SCHLICK = (BECKMANN, CORRELATED, EXACT), (BECKMANN, CORRELATED, SCHLICK)


@for_large_calls
def ggx(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    alpha_x: ArrayLike,
    alpha_y: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
    wavelength_nm: ArrayLike | None = None,
) -> Floats:
    """Return the BRDF [1/sr] of mirror facets with GGX slopes (Trowbridge-Reitz), of a metal or a dielectric.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi]; phi from x.
    alpha_x, alpha_y : array_like [1]
        Widths of the slopes along x and y, in [1e-6, 2]. A share 1 / (1 + t^2) of the slopes exceeds t alpha. The same
        alpha of Ward's model is another surface, because the tails of GGX are long.
    n, k : array_like [1]
        Refractive index n + ik of the facets, n in [1e-3, 100] and k in [0, 1e4].
    wavelength_nm : array_like [nm], optional
        Wavelength of n and k, in [1, 1e7]. The formula does not read it.

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    Notes
    -----
    F D G / (4 cos theta_i cos theta_r) with Smith's shadowing of light and viewer, correlated in height, eq. (99), and
    alpha^2 = (alpha_x cos phi)^2 + (alpha_y sin phi)^2 towards each direction. F is the reflectance of unpolarised
    light at half the angle between light and viewer. Light that facets reflect to one another is lost: with F = 1 the
    albedo is 0.69 at normal incidence for an alpha of 0.5. Where both directions reach 90 degrees, f_r grows as
    1 / cos. There it is the finite value at the float64 nearest pi/2.

    References
    ----------
    heitz2014, walter2007, trowbridgereitz1975

    Examples
    --------
    >>> import numpy as np
    >>> round(float(ggx(0.3, 0.0, 0.4, np.pi, alpha_x=0.2, alpha_y=0.3, n=0.95, k=2.6)), 4)
    0.8565
    """
    facets = metal(alpha_x, alpha_y, n, k, wavelength_nm)
    return by_angles(_GGX, (theta_i, phi_i, theta_r, phi_r), facets)


@for_large_calls
def ggx_vectors(
    wi: ArrayLike,
    wr: ArrayLike,
    *,
    alpha_x: ArrayLike,
    alpha_y: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
    wavelength_nm: ArrayLike | None = None,
) -> Floats:
    """Return `ggx` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    return by_vectors(_GGX, wi, wr, metal(alpha_x, alpha_y, n, k, wavelength_nm))


@for_large_calls
def ggx_schlick(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho_d: ArrayLike,
    f_0: ArrayLike,
    alpha_x: ArrayLike,
    alpha_y: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of GGX facets with Schlick's reflectance over a uniform part.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi]; phi from x.
    rho_d, f_0 : array_like [1]
        Albedo of the uniform part, and reflectance of a facet at normal incidence, each in [0, 1].
    alpha_x, alpha_y : array_like [1]
        Widths of the slopes along x and y, in [1e-6, 2], as in `ggx`.

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    Notes
    -----
    `ggx` with F = f_0 + (1 - f_0) (1 - cos)^5 of the angle on the facet, and rho_d / pi. The facets take nothing from
    the uniform part, so the sum may reflect more than it receives towards grazing, where F is 1.

    References
    ----------
    heitz2014, schlick1994

    Examples
    --------
    >>> import numpy as np
    >>> round(float(ggx_schlick(0.3, 0.0, 0.4, np.pi, rho_d=0.1, f_0=0.05, alpha_x=0.2, alpha_y=0.3)), 4)
    0.0987
    """
    return by_angles(_GGX_SCHLICK, (theta_i, phi_i, theta_r, phi_r), painted(rho_d, f_0, alpha_x, alpha_y))


@for_large_calls
def ggx_schlick_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho_d: ArrayLike, f_0: ArrayLike, alpha_x: ArrayLike, alpha_y: ArrayLike
) -> Floats:
    """Return `ggx_schlick` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    return by_vectors(_GGX_SCHLICK, wi, wr, painted(rho_d, f_0, alpha_x, alpha_y))


@for_large_calls
def beckmann(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    alpha_x: ArrayLike,
    alpha_y: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
    wavelength_nm: ArrayLike | None = None,
) -> Floats:
    """Return the BRDF [1/sr] of mirror facets with Gaussian slopes (Beckmann), of a metal or a dielectric.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r, n, k, wavelength_nm : array_like
        As in `ggx`: angles [rad], the refractive index [1] and its wavelength [nm].
    alpha_x, alpha_y : array_like [1]
        Widths of the slopes along x and y, exp(-(slope / alpha)^2), in [1e-6, 2], as in `ward`.

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    Notes
    -----
    As `ggx`, with the Lambda of a Gaussian, which has an error function. `beckmann_separable` has the approximation
    that programs use. Where both directions reach 90 degrees, f_r grows as 1 / cos.

    References
    ----------
    heitz2014, walter2007, beckmannspizzichino1963

    Examples
    --------
    >>> import numpy as np
    >>> round(float(beckmann(0.3, 0.0, 0.4, np.pi, alpha_x=0.2, alpha_y=0.3, n=0.95, k=2.6)), 4)
    0.9109
    """
    facets = metal(alpha_x, alpha_y, n, k, wavelength_nm)
    return by_angles(_BECKMANN, (theta_i, phi_i, theta_r, phi_r), facets)


@for_large_calls
def beckmann_vectors(
    wi: ArrayLike,
    wr: ArrayLike,
    *,
    alpha_x: ArrayLike,
    alpha_y: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
    wavelength_nm: ArrayLike | None = None,
) -> Floats:
    """Return `beckmann` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    return by_vectors(_BECKMANN, wi, wr, metal(alpha_x, alpha_y, n, k, wavelength_nm))


@for_large_calls
def beckmann_schlick(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho_d: ArrayLike,
    f_0: ArrayLike,
    alpha_x: ArrayLike,
    alpha_y: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of facets with Gaussian slopes and Schlick's reflectance over a uniform part.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r, rho_d, f_0 : array_like
        As in `ggx_schlick`: angles [rad], albedo and reflectance [1] in [0, 1].
    alpha_x, alpha_y : array_like [1]
        Widths of the slopes along x and y, exp(-(slope / alpha)^2), in [1e-6, 2].

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    Notes
    -----
    `beckmann` with the F of `ggx_schlick`, and rho_d / pi.

    References
    ----------
    heitz2014, schlick1994, beckmannspizzichino1963

    Examples
    --------
    >>> import numpy as np
    >>> round(float(beckmann_schlick(0.3, 0.0, 0.4, np.pi, rho_d=0.1, f_0=0.05, alpha_x=0.2, alpha_y=0.3)), 4)
    0.103
    """
    return by_angles(_BECKMANN_SCHLICK, (theta_i, phi_i, theta_r, phi_r), painted(rho_d, f_0, alpha_x, alpha_y))


@for_large_calls
def beckmann_schlick_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho_d: ArrayLike, f_0: ArrayLike, alpha_x: ArrayLike, alpha_y: ArrayLike
) -> Floats:
    """Return `beckmann_schlick` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    return by_vectors(_BECKMANN_SCHLICK, wi, wr, painted(rho_d, f_0, alpha_x, alpha_y))


def _form(
    key: str, title: str, kind: FormKind, vectors: Callable[..., Floats], arguments: Arguments, *, single: bool = False
) -> ModelForm:
    name = vectors.__name__.removesuffix("_vectors")
    return ModelForm(key, title, kind, f"models.{name}", vectors, bytes_of(arguments), single)


def ggx_forms(arguments: Arguments) -> Iterator[ModelForm]:
    """Yield the forms that charts compare: the shadowing of programs, and Beckmann's slopes at the same alpha."""
    yield _form("correlated", "GGX, correlated shadowing", "exact", ggx_vectors, arguments, single=True)
    yield _form("separable", "separable shadowing", "customary", ggx_separable_vectors, arguments, single=True)
    yield _form("beckmann", "Beckmann of the same alpha", "other model", beckmann_vectors, arguments)


def beckmann_forms(arguments: Arguments) -> Iterator[ModelForm]:
    """Yield the forms that charts compare: the shadowing of programs, and the slopes of GGX at the same alpha."""
    yield _form("correlated", "Beckmann, correlated shadowing", "exact", beckmann_vectors, arguments, single=True)
    yield _form("separable", "separable shadowing, fitted", "customary", beckmann_separable_vectors, arguments)
    yield _form("ggx", "GGX of the same alpha", "other model", ggx_vectors, arguments)


def _ward(wi: Floats, wr: Floats, *, rho_d: float, f_0: float, alpha_x: float, alpha_y: float) -> Floats:
    return ward_vectors(wi, wr, rho_d=rho_d, rho_s=f_0, alpha_x=alpha_x, alpha_y=alpha_y)


def schlick_forms(arguments: Arguments) -> Iterator[ModelForm]:
    """Yield the forms that charts compare: GGX, Beckmann and Ward, with the same reflectance and the same alpha."""
    yield _form("ggx", "GGX, Schlick", "exact", ggx_schlick_vectors, arguments, single=True)
    yield _form("beckmann", "Beckmann of the same alpha", "other model", beckmann_schlick_vectors, arguments)
    title = "Ward of the same alpha, rho_s = f_0"
    yield ModelForm("ward", title, "other model", "models.ward", _ward, bytes_of(arguments))


def beckmann_schlick_forms(arguments: Arguments) -> Iterator[ModelForm]:
    """Yield the forms that charts compare: Beckmann and GGX, with the same reflectance and the same alpha."""
    yield _form("beckmann", "Beckmann, Schlick", "exact", beckmann_schlick_vectors, arguments, single=True)
    yield _form("ggx", "GGX of the same alpha", "other model", ggx_schlick_vectors, arguments)


# The albedo was measured for narrow lobes, rho_d = 1 and f_0 = 0.04
_EXCESS = (
    "Schlick 1994: the facets reflect all light at grazing and take none of it from the uniform part, which no paper "
    "couples; measured 1.96 at 89.5 degrees for rho_d = 1 and f_0 = 0.04"
)

SPEC = ModelSpec(
    name="ggx",
    version=1,
    title="GGX",
    equation="eq. 99, GGX",
    reference="heitz2014",
    parameters=(ALPHA_X, ALPHA_Y),
    evaluate=ggx,
    vectors=ggx_vectors,
    spectral=True,
    grazing_pole=True,
    grazing_power=0.0,
    lobe_axes=("alpha_x", "alpha_y"),
    lobe=lobe_of_metal(GGX),
    lossless=lossless_metal,
    forms=ggx_forms,
)
SCHLICK_SPEC = ModelSpec(
    name="ggx_schlick",
    version=1,
    title="GGX, Schlick's reflectance",
    equation="eq. 99, GGX",
    reference="heitz2014",
    parameters=(RHO_D, F_0, ALPHA_X, ALPHA_Y),
    evaluate=ggx_schlick,
    vectors=ggx_schlick_vectors,
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
BECKMANN_SPEC = ModelSpec(
    name="beckmann",
    version=1,
    title="Beckmann",
    equation="eq. 99, Beckmann",
    reference="heitz2014",
    parameters=(ALPHA_X, ALPHA_Y),
    evaluate=beckmann,
    vectors=beckmann_vectors,
    spectral=True,
    grazing_pole=True,
    grazing_power=0.0,
    lobe_axes=("alpha_x", "alpha_y"),
    lobe=lobe_of_metal(GAUSSIAN),
    lossless=lossless_metal,
    forms=beckmann_forms,
)
BECKMANN_SCHLICK_SPEC = ModelSpec(
    name="beckmann_schlick",
    version=1,
    title="Beckmann, Schlick's reflectance",
    equation="eq. 99, Beckmann",
    reference="heitz2014",
    parameters=(RHO_D, F_0, ALPHA_X, ALPHA_Y),
    evaluate=beckmann_schlick,
    vectors=beckmann_schlick_vectors,
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
