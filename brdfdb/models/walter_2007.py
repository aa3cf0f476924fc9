"""Walter, Marschner, Li and Torrance 2007: mirror facets with GGX or Beckmann slopes, and separable shadowing."""

from __future__ import annotations

from numpy.typing import ArrayLike

from brdfdb.lobes import GAUSSIAN, GGX
from brdfdb.models import _microfacets
from brdfdb.models._microfacets import (
    ALPHA_X,
    ALPHA_Y,
    BECKMANN,
    EXACT,
    SEPARABLE,
    by_angles,
    by_vectors,
    lobe_of_metal,
    lossless_metal,
    metal,
)
from brdfdb.models.large_calls import for_large_calls
from brdfdb.parameters import Floats, ModelSpec

_GGX, _BECKMANN = (_microfacets.GGX, SEPARABLE, EXACT), (BECKMANN, SEPARABLE, EXACT)


@for_large_calls
def ggx_separable(
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
    """Return the BRDF [1/sr] of GGX facets with the shadowing of light times that of viewer, as the paper prints it.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi]; phi from x.
    alpha_x, alpha_y : array_like [1]
        Widths of the slopes along x and y, in [1e-6, 2]. The paper has one alpha, for both.
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
    Eq. (20) with D of eq. (33), G of eqs. (23) and (34), and the exact reflectance of unpolarised light. For two alphas
    it takes alpha^2 = (alpha_x cos phi)^2 + (alpha_y sin phi)^2 towards each direction, as Heitz 2014 does. Programs
    evaluate this form, for example Mitsuba's `roughconductor`. A facet low in
    the surface is hidden from both directions. This form counts that twice, so it loses more than `ggx`, most at
    grazing: its albedo is 0.60 at 89 degrees for F = 1 and an alpha of 1, and that of `ggx` is 0.93.

    References
    ----------
    walter2007, trowbridgereitz1975, heitz2014

    Examples
    --------
    >>> import numpy as np
    >>> round(float(ggx_separable(0.3, 0.0, 0.4, np.pi, alpha_x=0.2, alpha_y=0.3, n=0.95, k=2.6)), 4)
    0.8565
    """
    facets = metal(alpha_x, alpha_y, n, k, wavelength_nm)
    return by_angles(_GGX, (theta_i, phi_i, theta_r, phi_r), facets)


@for_large_calls
def ggx_separable_vectors(
    wi: ArrayLike,
    wr: ArrayLike,
    *,
    alpha_x: ArrayLike,
    alpha_y: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
    wavelength_nm: ArrayLike | None = None,
) -> Floats:
    """Return `ggx_separable` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    return by_vectors(_GGX, wi, wr, metal(alpha_x, alpha_y, n, k, wavelength_nm))


@for_large_calls
def beckmann_separable(
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
    """Return the BRDF [1/sr] of Gaussian facets with the paper's approximation of their shadowing.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r, n, k, wavelength_nm : array_like
        As in `ggx_separable`: angles [rad], the refractive index [1] and its wavelength [nm].
    alpha_x, alpha_y : array_like [1]
        Widths of the slopes along x and y, exp(-(slope / alpha)^2), in [1e-6, 2]. The paper has one alpha, for both.

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
    Eq. (20) with D of eq. (25), G of eq. (23) and the rational approximation of G_1 in eq. (27). Its value is up to
    0.3 % from that with the error function. At a = 1 / (alpha tan theta) = 1.6, where it becomes 1, it jumps by 6e-5.

    References
    ----------
    walter2007, beckmannspizzichino1963

    Examples
    --------
    >>> import numpy as np
    >>> round(float(beckmann_separable(0.3, 0.0, 0.4, np.pi, alpha_x=0.2, alpha_y=0.3, n=0.95, k=2.6)), 4)
    0.9109
    """
    facets = metal(alpha_x, alpha_y, n, k, wavelength_nm)
    return by_angles(_BECKMANN, (theta_i, phi_i, theta_r, phi_r), facets)


@for_large_calls
def beckmann_separable_vectors(
    wi: ArrayLike,
    wr: ArrayLike,
    *,
    alpha_x: ArrayLike,
    alpha_y: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
    wavelength_nm: ArrayLike | None = None,
) -> Floats:
    """Return `beckmann_separable` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    return by_vectors(_BECKMANN, wi, wr, metal(alpha_x, alpha_y, n, k, wavelength_nm))


GGX_SPEC = ModelSpec(
    name="ggx_separable",
    version=1,
    title="GGX, separable shadowing",
    equation="eqs 20, 23, 33, 34",
    reference="walter2007",
    parameters=(ALPHA_X, ALPHA_Y),
    evaluate=ggx_separable,
    vectors=ggx_separable_vectors,
    grazing_power=0.0,
    spectral=True,
    lobe_axes=("alpha_x", "alpha_y"),
    lobe=lobe_of_metal(GGX),
    lossless=lossless_metal,
)
BECKMANN_SPEC = ModelSpec(
    name="beckmann_separable",
    version=1,
    title="Beckmann, separable shadowing",
    equation="eqs 20, 23, 25, 27",
    reference="walter2007",
    parameters=(ALPHA_X, ALPHA_Y),
    evaluate=beckmann_separable,
    vectors=beckmann_separable_vectors,
    grazing_power=0.0,
    spectral=True,
    lobe_axes=("alpha_x", "alpha_y"),
    lobe=lobe_of_metal(GAUSSIAN),
    lossless=lossless_metal,
)
