"""Portsmouth, Kutz and Hill 2025: the energy-preserving Oren-Nayar model (EON), with the exact albedo of its lobe."""

from __future__ import annotations

import numpy as np

from brdfdb._elementary import arcsin
from brdfdb._numba import kernel
from brdfdb.models.declaration import DeclaredModel
from brdfdb.parameters import Parameter, SurfaceRelation, white

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


@DeclaredModel(
    title="Oren-Nayar, energy preserving (EON)",
    equation="EON, exact albedo",
    references="portsmouth2025",
    parameters=(RHO, ROUGHNESS),
    grazing_pole=True,
    grazing_power=0.0,
    lossless=white,
    surfaces=(SurfaceRelation(facets="diffuse", bounces="all", parameters=("roughness",), by_rho=True),),
)
def oren_nayar_energy_preserving(
    cos_i: float, sin_i: float, cos_r: float, sin_r: float, cos_dphi: float, rho: float, roughness: float
) -> float:
    """Return the BRDF [1/sr] of the energy-preserving Oren-Nayar model (EON), which reflects all light if rho = 1.

    f_r is the sum of Fujii's lobe (FON) and of a lobe that makes up for the loss of FON at rho = 1,
    rho_ms / pi (1 - E_FON(theta_i)) (1 - E_FON(theta_r)) / (1 - mean of E_FON), with the exact E_FON, not its fit.
    The model keeps the pole of FON at exact backscatter at grazing. The roughness is the sigma of `oren_nayar_fujii`,
    not the deviation of a slope.

    >>> round(float(oren_nayar_energy_preserving(0.3, 0.0, 0.4, 0.0, rho=0.9, roughness=0.5)), 4)
    0.307
    """
    A = 1.0 / (1.0 + _C1 * roughness)
    # f_ss: Fujii's lobe
    s = sin_i * sin_r * cos_dphi
    t = max(cos_i, cos_r) if s > 0.0 else 1.0
    single = rho / np.pi * A * max(0.0, 1.0 + roughness * s / t)
    # f_ms, with the 0 / 0 at r = 0 cancelled
    mean_lost = A * roughness * (_C1 - _C2)
    rho_ms = rho * rho * (1.0 - mean_lost) / (1.0 - rho * mean_lost)
    multiple = rho_ms / np.pi * A * roughness / (_C1 - _C2) * _lost(cos_i, sin_i) * _lost(cos_r, sin_r)
    return single + multiple
