"""Conversions between measures of roughness: slopes, angles, Beckmann's alpha, a shader's 0 to 1, and heights.

The common measure is alpha, the width of a Gaussian of facet slopes exp(-tan^2(delta) / alpha^2). It is the alpha of
Beckmann, of microfacet models and of Ward. It is not the rms slope along one axis, which is alpha / sqrt(2), although
Ward calls it the "standard deviation of the surface slope". tan(delta) is the slope along its own azimuth, with an rms
value of alpha.

============================  ========================================  =====================================
source                        parameter                                 alpha
============================  ========================================  =====================================
Ward 1992                     alpha_x, alpha_y                          the same
Beckmann, microfacet models   alpha, or m                               the same
statistics of surfaces        sigma, rms slope along one axis           sqrt(2) sigma
Torrance-Sparrow,             sigma, standard deviation of the facets'  sqrt(2) sigma, in radians,
Oren-Nayar                    slope angle, in degrees or radians        where it is small
He-Torrance                   sigma_0 and tau, in micrometres           2 sigma_0 / tau, where g >> 1
OpenPBR, OSL, MaterialX,      roughness of a specular lobe, 0 to 1      roughness^2
Disney, glTF
============================  ========================================  =====================================

The alpha of GGX is no width of a Gaussian. It is the t at which half of the slopes are steeper, and its slopes have no
rms value. Ward's alpha put into GGX gives another surface: docs/explanation/microfacets.md measures the error.
`brdfdb.conversion.convert.convert` searches the parameters of another model that come closest, where nothing is exact.

The roughness of a *diffuse* lobe is a different quantity, which is not squared and widens no lobe. The
`oren_nayar_diffuse_bsdf` of OSL and MaterialX takes it as Oren and Nayar's sigma in radians (1 is 57 degrees) in the
qualitative model. With energy compensation, and in OpenPBR's `base_diffuse_roughness`, it is the parameter of Fujii's
form, 0 to 1, which is no angle. The two agree only at 0, Lambert.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.arrays import array_function
from brdfdb.parameters import Floats, Parameter

_SQRT_2 = float(np.sqrt(2.0))

ALPHA = Parameter("alpha", "α", "1", 0.0, 1e12, "width of the Gaussian of slopes; its rms value")
SLOPE = Parameter("slope", "σ", "1", 0.0, 1e12, "rms slope along one axis")
SIGMA = Parameter("sigma", "σ", "rad", 0.0, np.pi / 2, "standard deviation of the slope angle in one plane")
SIGMA_DEG = Parameter("sigma_deg", "σ", "degree", 0.0, 90.0, "standard deviation of the slope angle in one plane")
SIGMA_0_UM = Parameter("sigma_0_um", "σ_0", "µm", 0.0, 1e4, "rms height")
TAU_UM = Parameter("tau_um", "τ", "µm", 1e-6, 1e6, "autocorrelation length")
ROUGHNESS = Parameter("roughness", "r", "1", 0.0, 1e6, "of a specular lobe; a shader's slider ends at 1")


@array_function
def alpha_from_slope(slope: ArrayLike) -> Floats:
    """Return alpha [1] of Ward and Beckmann, sqrt(2) times the rms slope along one axis [1], in [0, 1e12].

    >>> round(float(alpha_from_slope(0.1)), 6)
    0.141421
    """
    return _SQRT_2 * SLOPE.check(slope)


@array_function
def slope_from_alpha(alpha: ArrayLike) -> Floats:
    """Return the rms slope along one axis [1] of a surface with Ward's and Beckmann's alpha [1], in [0, 1e12].

    >>> round(float(slope_from_alpha(0.1)), 6)
    0.070711
    """
    return ALPHA.check(alpha) / _SQRT_2


@array_function
def alpha_from_angle(sigma: ArrayLike) -> Floats:
    """Return alpha [1], sqrt(2) sigma, of facets whose slope angle has the standard deviation sigma [rad] in [0, pi/2].

    With it exp(-delta^2 / (2 sigma^2)) of Torrance-Sparrow and Oren-Nayar has the same curvature at its peak as
    exp(-tan^2(delta) / alpha^2). The distributions are the same only where sigma is small: they differ by 2 % of the
    peak at 10 degrees, and by 17 % at 30 degrees.

    >>> round(float(alpha_from_angle(0.1)), 6)
    0.141421
    """
    return _SQRT_2 * SIGMA.check(sigma)


@array_function
def angle_from_alpha(alpha: ArrayLike) -> Floats:
    """Return the standard deviation of the slope angle [rad] with the same peak as alpha [1], alpha / sqrt(2).

    alpha is in [0, 1e12]. Oren-Nayar does not accept results above pi/2.

    >>> round(float(angle_from_alpha(0.1)), 6)
    0.070711
    """
    return ALPHA.check(alpha) / _SQRT_2


@array_function
def alpha_from_degrees(sigma_deg: ArrayLike) -> Floats:
    """Return alpha [1] by `alpha_from_angle` for a standard deviation [degree] in [0, 90].

    >>> round(float(alpha_from_degrees(10.0)), 6)
    0.246827
    """
    return _SQRT_2 * np.deg2rad(SIGMA_DEG.check(sigma_deg))


@array_function
def degrees_from_alpha(alpha: ArrayLike) -> Floats:
    """Return the standard deviation of the slope angle [degree] by `angle_from_alpha`.

    >>> round(float(degrees_from_alpha(0.1)), 6)
    4.051423
    """
    return np.asarray(np.rad2deg(angle_from_alpha(alpha)))


@array_function
def alpha_from_roughness(roughness: ArrayLike) -> Floats:
    """Return alpha [1], roughness^2, of a specular lobe with the roughness [1] of a shading language, in [0, 1e6].

    The square is that of Burley, in Disney, OpenPBR, MaterialX, glTF and the standard surfaces of OSL, where a slider
    goes from 0 to 1. A closure below them, such as OSL's `dielectric_bsdf` or MaterialX's `roughness_x`, takes alpha
    itself.

    >>> float(alpha_from_roughness(0.5))
    0.25
    """
    return ROUGHNESS.check(roughness) ** 2


@array_function
def roughness_from_alpha(alpha: ArrayLike) -> Floats:
    """Return the roughness [1] of a shading language, the square root of alpha [1] in [0, 1e12].

    >>> float(roughness_from_alpha(0.25))
    0.5
    """
    return np.asarray(np.sqrt(ALPHA.check(alpha)))


@array_function
def slope_from_heights(sigma_0_um: ArrayLike, tau_um: ArrayLike) -> Floats:
    """Return the rms slope along one axis [1] of He-Torrance's surface, sqrt(2) sigma_0 / tau.

    The heights have the rms value sigma_0 [um], in [0, 1e4], and the Gaussian autocorrelation exp(-(r / tau)^2), with
    tau [um] in [1e-6, 1e6]. Its curvature at 0, 2 / tau^2, is the variance of the slope over that of the heights.

    >>> round(float(slope_from_heights(0.18, 3.0)), 6)
    0.084853
    """
    return _SQRT_2 * SIGMA_0_UM.check(sigma_0_um) / TAU_UM.check(tau_um)


@array_function
def alpha_from_heights(sigma_0_um: ArrayLike, tau_um: ArrayLike) -> Floats:
    """Return alpha [1] of He-Torrance's surface, 2 sigma_0 / tau, the width of its lobe for g >> 1.

    Where g is about 1 or less, diffraction sets the width instead: wavelength / (pi tau (cos theta_i + cos theta_r)).
    Ranges as in `slope_from_heights`.

    >>> round(float(alpha_from_heights(0.18, 3.0)), 6)
    0.12
    """
    return _SQRT_2 * slope_from_heights(sigma_0_um, tau_um)


@array_function
def heights_from_alpha(alpha: ArrayLike, tau_um: ArrayLike) -> Floats:
    """Return the rms roughness sigma_0 [um] of He-Torrance's surface with an alpha [1] and a length tau [um].

    alpha is in [0, 1e12] and tau in [1e-6, 1e6]. He-Torrance does not accept results above 1e4.

    >>> round(float(heights_from_alpha(0.12, 3.0)), 6)
    0.18
    """
    return ALPHA.check(alpha) * TAU_UM.check(tau_um) / 2.0
