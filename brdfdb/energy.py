"""The bound that energy conservation puts on the uniform diffuse part of He et al. 1991, section 3.2.3."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.geometry import HALF_PI
from brdfdb.models.he_torrance_1991 import checked_surface
from brdfdb.parameters import Floats
from brdfdb.quadrature import directional_albedo

_ANGLES = 40  # of the first search, even in ln(cos theta_i): near grazing the reflectance peaks where shadowing begins
_FINER, _ROUNDS = 9, 3  # of the search around the largest of them: the angle to 1e-4 of its spacing


def he_torrance_a_max(
    *,
    wavelength_nm: ArrayLike,
    sigma_0_um: ArrayLike,
    tau_um: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
    tolerance: float = 1e-6,
) -> Floats:
    """The largest a(lambda) with which `he_torrance` reflects no more than it receives, from any direction.

    Parameters
    ----------
    wavelength_nm, sigma_0_um, tau_um, n, k : array_like
        As in `brdfdb.models.he_torrance`; they broadcast.
    tolerance : float
        Absolute error of the directional albedo that is allowed, in [1e-13, 1].

    Returns
    -------
    array [1]
        1 less the largest directional-hemispherical reflectance, specular and directional diffuse, of all angles of
        incidence from 0 to 90 degrees; 0 where that is above 1.

    Raises
    ------
    ValueError
        If an argument is outside its range.

    Notes
    -----
    Section 3.2.3: a(lambda) is "a constrained, but otherwise free, parameter. The constraint is based on energy
    conservation and gives an upper bound." A smooth surface reflects everything at grazing: its bound is 0, and any
    a > 0 breaks it. The worst angle is searched in cos theta_i down to a hundredth of sigma_0 / tau, where
    shadowing has taken the specular part away.

    References
    ----------
    he1991 (section 3.2.3)

    Examples
    --------
    >>> ceramic = dict(wavelength_nm=500.0, sigma_0_um=1.45, tau_um=13.2, n=1.7456, k=0.0)
    >>> round(float(he_torrance_a_max(**ceramic)), 3)  # the paper takes 0.9
    0.777
    """
    surface = checked_surface(wavelength_nm, sigma_0_um, tau_um, n, k)
    arrays = np.broadcast_arrays(surface.wavelength_um * 1000.0, surface.sigma_0, surface.tau, surface.n, surface.k)
    bound = np.empty(arrays[0].shape)
    names = ("wavelength_nm", "sigma_0_um", "tau_um", "n", "k")
    for index in np.ndindex(bound.shape):
        one = {name: float(array[index]) for name, array in zip(names, arrays, strict=True)}
        bound[index] = max(0.0, 1.0 - _largest_reflectance(one, tolerance))
    return bound[()]


def _largest_reflectance(surface: dict[str, float], tolerance: float) -> float:
    def reflectance(cos_theta: NDArray[np.float64]) -> NDArray[np.float64]:
        theta_i = np.arccos(np.minimum(cos_theta, 1.0))
        albedo, _ = directional_albedo("he_torrance", theta_i, tolerance=tolerance, specular=True, **surface, a=0.0)
        return np.asarray(albedo, dtype=np.float64)

    lowest = np.log(min(1e-3, max(1e-2 * surface["sigma_0_um"] / surface["tau_um"], 1e-9)))
    log_cos = np.linspace(lowest, 0.0, _ANGLES)
    values = reflectance(np.exp(log_cos))
    largest = max(float(values.max()), float(reflectance(np.array([np.cos(HALF_PI)]))[0]))
    step = log_cos[1] - log_cos[0]
    centre = log_cos[np.argmax(values)]
    for _ in range(_ROUNDS):
        finer = np.minimum(centre + step * np.linspace(-1.0, 1.0, _FINER), 0.0)
        values = reflectance(np.exp(finer))
        largest = max(largest, float(values.max()))
        centre, step = finer[np.argmax(values)], 2.0 * step / (_FINER - 1)
    return largest
