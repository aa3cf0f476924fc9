"""Portsmouth, Kutz and Hill 2025: the energy-preserving Oren-Nayar model (EON), with the exact albedo of its lobe."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from brdfdb._elementary import arcsin
from brdfdb._numba import elementwise, kernel
from brdfdb.geometry import Directions, checked_angles, checked_vectors, finished
from brdfdb.models.large_calls import for_large_calls
from brdfdb.parameters import Floats, ModelSpec, Parameter, white

RHO = Parameter("rho", "ρ", "1", 0.0, 1.0, "albedo of a single scattering; the albedo at 1", reflectance=True)
ROUGHNESS = Parameter("roughness", "r", "1", 0.0, 1.0, "Fujii's mixing ratio; 0 is Lambert")

_C1 = 0.5 - 2.0 / (3.0 * np.pi)  # A = 1 / (1 + C1 r)
_C2 = 2.0 / 3.0 - 28.0 / (15.0 * np.pi)  # mean of E_FON = A (1 + C2 r)


@kernel
def _lost(cos_theta: float, sin_theta: float) -> float:
    """Return (1 - E_FON) / (A r) [1], the loss of a single scattering, without a difference that cancels at grazing."""
    small = arcsin(min(cos_theta, sin_theta))
    rest = small if cos_theta < sin_theta else np.pi / 2 - small  # pi/2 - theta
    versine = cos_theta * cos_theta / (1.0 + sin_theta)  # 1 - sin(theta)
    # G(theta) and its value at the horizon, pi C1
    chord = 2.0 / 3.0 * sin_theta * cos_theta * (1.0 + sin_theta + sin_theta * sin_theta) / (1.0 + sin_theta)
    G_less = (np.pi / 2 - 2.0 / 3.0) * versine + sin_theta * (rest + sin_theta * cos_theta) - chord
    return G_less / np.pi


@kernel
def _energy_preserving(
    cos_i: float, sin_i: float, cos_r: float, sin_r: float, cos_dphi: float, rho: float, r: float
) -> float:
    A = 1.0 / (1.0 + _C1 * r)
    # f_ss: Fujii's lobe
    s = sin_i * sin_r * cos_dphi
    t = max(cos_i, cos_r) if s > 0.0 else 1.0
    single = rho / np.pi * A * max(0.0, 1.0 + r * s / t)
    # f_ms, with the 0 / 0 at r = 0 cancelled
    mean_lost = A * r * (_C1 - _C2)
    rho_ms = rho * rho * (1.0 - mean_lost) / (1.0 - rho * mean_lost)
    multiple = rho_ms / np.pi * A * r / (_C1 - _C2) * _lost(cos_i, sin_i) * _lost(cos_r, sin_r)
    return single + multiple


_evaluate = elementwise(_energy_preserving)


@for_large_calls
def oren_nayar_energy_preserving(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: ArrayLike,
    roughness: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of the energy-preserving Oren-Nayar model (EON), which reflects all light if rho = 1.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    rho : array_like [1]
        Albedo of a single scattering, in [0, 1].
    roughness : array_like [1]
        Roughness, in [0, 1]; 0 is Lambert. It is the sigma of `oren_nayar_fujii`, not the deviation of a slope.

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
    f_r is the sum of Fujii's lobe (FON) and of a lobe that makes up for the loss of FON at rho = 1,
    rho_ms / pi (1 - E_FON(theta_i)) (1 - E_FON(theta_r)) / (1 - mean of E_FON), with the exact E_FON, not its fit.
    The model keeps the pole of FON at exact backscatter at grazing.

    References
    ----------
    portsmouth2025

    Examples
    --------
    >>> round(float(oren_nayar_energy_preserving(0.3, 0.0, 0.4, 0.0, rho=0.9, roughness=0.5)), 4)
    0.307
    """
    return _f_r(checked_angles(theta_i, phi_i, theta_r, phi_r), rho, roughness)


@for_large_calls
def oren_nayar_energy_preserving_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, roughness: ArrayLike
) -> Floats:
    """Return `oren_nayar_energy_preserving` for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    return _f_r(checked_vectors(wi, wr), rho, roughness)


def _f_r(directions: Directions, rho: ArrayLike, roughness: ArrayLike) -> Floats:
    pair = directions.cos_i, directions.sin_i, directions.cos_r, directions.sin_r, directions.cos_dphi
    return finished(_evaluate(*pair, RHO.check(rho), ROUGHNESS.check(roughness)), directions)


SPEC = ModelSpec(
    name="oren_nayar_energy_preserving",
    version=1,
    title="Oren-Nayar, energy preserving (EON)",
    equation="EON, exact albedo",
    reference="portsmouth2025",
    parameters=(RHO, ROUGHNESS),
    evaluate=oren_nayar_energy_preserving,
    vectors=oren_nayar_energy_preserving_vectors,
    grazing_pole=True,
    grazing_power=0.0,
    lossless=white,
)
