"""What each community calls roughness, translated: slopes, angles, Beckmann's alpha, a shader's 0 to 1, microns.

The common coin is alpha, the width of a Gaussian of facet slopes exp(-tan^2(delta) / alpha^2): the alpha of Beckmann,
of microfacet models and of Ward. It is not the rms slope along one axis, which is alpha / sqrt(2), though Ward calls it
the "standard deviation of the surface slope": tan(delta) is the slope along its own azimuth; its rms value is alpha.

============================  ========================================  =====================================
who                           what they give                            alpha
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

The roughness of a *diffuse* lobe is another matter: it is not squared, and widens no lobe. OSL's and MaterialX's
`oren_nayar_diffuse_bsdf` take it as Oren and Nayar's sigma in radians (1 is 57 degrees) in the qualitative model; with
energy compensation, and in OpenPBR's `base_diffuse_roughness`, it is the parameter of Fujii's form, 0 to 1, which is no
angle: the two agree at 0, Lambert, and nowhere else.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.parameters import Floats, Parameter

_SQRT_2 = float(np.sqrt(2.0))

ALPHA = Parameter("alpha", "α", "1", 0.0, 1e12, "width of the Gaussian of slopes; its rms value")
SLOPE = Parameter("slope", "σ", "1", 0.0, 1e12, "rms slope along one axis")
SIGMA = Parameter("sigma", "σ", "rad", 0.0, np.pi / 2, "standard deviation of the slope angle in one plane")
SIGMA_DEG = Parameter("sigma_deg", "σ", "degree", 0.0, 90.0, "standard deviation of the slope angle in one plane")
SIGMA_0_UM = Parameter("sigma_0_um", "σ_0", "µm", 0.0, 1e4, "rms height")
TAU_UM = Parameter("tau_um", "τ", "µm", 1e-6, 1e6, "autocorrelation length")
ROUGHNESS = Parameter("roughness", "r", "1", 0.0, 1e6, "of a specular lobe; a shader's slider ends at 1")


def alpha_from_slope(slope: ArrayLike) -> Floats:
    """Return the alpha [1] of Ward and Beckmann, sqrt(2) times the rms slope along one axis [1], in [0, 1e12].

    >>> round(float(alpha_from_slope(0.1)), 6)
    0.141421
    """
    return _SQRT_2 * SLOPE.check(slope)


def slope_from_alpha(alpha: ArrayLike) -> Floats:
    """Return the rms slope along one axis [1] of a surface with Ward's and Beckmann's alpha [1], in [0, 1e12].

    >>> round(float(slope_from_alpha(0.1)), 6)
    0.070711
    """
    return ALPHA.check(alpha) / _SQRT_2


def alpha_from_angle(sigma: ArrayLike) -> Floats:
    """Return alpha [1] of facets whose slope angle has the standard deviation sigma [rad], in [0, pi/2]: sqrt(2) sigma.

    exp(-delta^2 / (2 sigma^2)), of Torrance-Sparrow and Oren-Nayar, and exp(-tan^2(delta) / alpha^2) have then the same
    curvature at their peak. They are the same distribution only where sigma is small: at 10 degrees they differ by
    2 % of the peak, at 30 degrees by 17 %.

    >>> round(float(alpha_from_angle(0.1)), 6)
    0.141421
    """
    return _SQRT_2 * SIGMA.check(sigma)


def angle_from_alpha(alpha: ArrayLike) -> Floats:
    """Return the standard deviation of the slope angle [rad] that has the same peak as alpha [1]: alpha / sqrt(2).

    For alpha in [0, 1e12]; what it gives above pi/2 is no angle that Oren-Nayar takes.

    >>> round(float(angle_from_alpha(0.1)), 6)
    0.070711
    """
    return ALPHA.check(alpha) / _SQRT_2


def alpha_from_degrees(sigma_deg: ArrayLike) -> Floats:
    """Return `alpha_from_angle` for a standard deviation in degrees, in [0, 90].

    >>> round(float(alpha_from_degrees(10.0)), 6)
    0.246827
    """
    return _SQRT_2 * np.deg2rad(SIGMA_DEG.check(sigma_deg))


def degrees_from_alpha(alpha: ArrayLike) -> Floats:
    """Return `angle_from_alpha` in degrees.

    >>> round(float(degrees_from_alpha(0.1)), 6)
    4.051423
    """
    return np.asarray(np.rad2deg(angle_from_alpha(alpha)))


def alpha_from_roughness(roughness: ArrayLike) -> Floats:
    """Return alpha [1] of a specular lobe with a shading language's roughness [1], 0 to 1 on its slider: roughness^2.

    Burley's square, of Disney, OpenPBR, MaterialX, glTF and OSL's standard surfaces. A closure below them, such as
    OSL's `dielectric_bsdf` or MaterialX's `roughness_x`, takes alpha itself. Allowed is [0, 1e6].

    >>> float(alpha_from_roughness(0.5))
    0.25
    """
    return ROUGHNESS.check(roughness) ** 2


def roughness_from_alpha(alpha: ArrayLike) -> Floats:
    """Return a shading language's roughness [1] of a specular lobe: the square root of alpha [1], in [0, 1e12].

    >>> float(roughness_from_alpha(0.25))
    0.5
    """
    return np.asarray(np.sqrt(ALPHA.check(alpha)))


def slope_from_heights(sigma_0_um: ArrayLike, tau_um: ArrayLike) -> Floats:
    """Return the rms slope along one axis [1] of He-Torrance's surface: sqrt(2) sigma_0 / tau.

    Of heights with the rms value sigma_0 [um], in [0, 1e4], and the Gaussian autocorrelation exp(-(r / tau)^2), tau
    [um] in [1e-6, 1e6]: its curvature at 0, 2 / tau^2, is the variance of the slope over that of the heights.

    >>> round(float(slope_from_heights(0.18, 3.0)), 6)
    0.084853
    """
    return _SQRT_2 * SIGMA_0_UM.check(sigma_0_um) / TAU_UM.check(tau_um)


def alpha_from_heights(sigma_0_um: ArrayLike, tau_um: ArrayLike) -> Floats:
    """Return alpha [1] of He-Torrance's surface, 2 sigma_0 / tau: the width of its lobe for g >> 1, geometrical optics.

    Where g is about 1 or less, diffraction sets the width instead: wavelength / (pi tau (cos theta_i + cos theta_r)).
    Ranges as in `slope_from_heights`.

    >>> round(float(alpha_from_heights(0.18, 3.0)), 6)
    0.12
    """
    return _SQRT_2 * slope_from_heights(sigma_0_um, tau_um)


def heights_from_alpha(alpha: ArrayLike, tau_um: ArrayLike) -> Floats:
    """Return the rms roughness sigma_0 [um] that gives He-Torrance's surface of a length tau [um] an alpha [1].

    For alpha in [0, 1e12] and tau in [1e-6, 1e6]; what it gives above 1e4 is more than He-Torrance takes.

    >>> round(float(heights_from_alpha(0.12, 3.0)), 6)
    0.18
    """
    return ALPHA.check(alpha) * TAU_UM.check(tau_um) / 2.0
