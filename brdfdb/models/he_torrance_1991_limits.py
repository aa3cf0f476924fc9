"""He et al. 1991: limits of the model, its parts one by one, and its average over finite apertures of an instrument."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb import fresnel
from brdfdb.gauss import gauss_rule
from brdfdb.geometry import Directions, Vectors, common_solid_angle, finished, versine
from brdfdb.models import he_torrance_1991 as full
from brdfdb.models._he_torrance_kernels import hidden, shadowing, variance
from brdfdb.models.declaration import of_directions
from brdfdb.models.he_torrance_1991 import SIGMA_0_UM, TAU_UM, A
from brdfdb.parameters import WAVELENGTH_NM, Count, Floats, K, N, Parameter

SIGMA_0_OVER_TAU = Parameter("sigma_0_over_tau", "σ_0/τ", "1", 1e-6, 1e6, "rms roughness over autocorrelation length")
INCIDENT = Parameter("incident_solid_angle_sr", "ω_i", "sr", 1e-12, 1.0, "solid angle of the cone of light")
RECEIVED = Parameter("received_solid_angle_sr", "ω_r", "sr", 1e-12, 1.0, "solid angle of the cone that is received")
RINGS = Count("rings", "", "1", 0, 8, "number of rings of nodes in each cone; 0 takes the axes alone", default=2)

_SURFACE = (WAVELENGTH_NM, SIGMA_0_UM, TAU_UM, N, K)


@of_directions(parameters=(SIGMA_0_OVER_TAU, N, K, A), references="he1991, smith1967, corless1996")
def he_torrance_very_rough(directions: Directions, sigma_0_over_tau: Floats, n: Floats, k: Floats, a: Floats) -> Floats:
    """Return the BRDF [1/sr] of a very rough surface: `he_torrance` in the limit g -> infinity, geometrical optics.

    The rms slope of the surface is sqrt(2) times sigma_0_over_tau. The wavelength enters only through n and k. The
    limit has no specular part. Section 4: "For very rough surfaces, only the ratio is required". Cylinder (a) of Fig.
    13 is an example. The sum of eq. (78) tends to e^-b / g with b = v_xy^2 tau^2 / (4 g) (Beckmann and Spizzichino
    1963), in which the wave number cancels. The first term that is left out is the share (b^2 / 2 - 2 b + 1) / g of the
    whole. Shadowing and effective roughness are those of `he_torrance`. g falls with cos^2 towards grazing, where the
    limit needs rougher surfaces.

    >>> round(float(he_torrance_very_rough(0.5, 0.0, 0.6, 3.0, sigma_0_over_tau=0.16, n=0.769, k=6.08)), 3)
    0.957
    """
    return _very_rough(directions, sigma_0_over_tau, n, k, a)


@of_directions(
    parameters=(N, K),
    references="he1991",
    returns="""\
array [1]
    |F|^2, in [0, 1], in the broadcast shape of all arguments; 0 below the horizon, nan where theta_i is nan. The
    directional diffuse part is 0 in this limit.""",
)
def he_torrance_smooth(light: Directions, n: Floats, k: Floats) -> Floats:
    """Return the specular reflectance [1] of a smooth surface: `he_torrance_specular` as sigma_0 / wavelength -> 0.

    Eq. (10) without its factor 1 / (cos theta_i d omega_i).

    >>> round(float(he_torrance_smooth(0.0, n=1.5, k=0.0)), 4)
    0.04
    """
    return _smooth(light, n, k)


class HeTorranceParts(NamedTuple):
    """The two parts of `he_torrance` that are functions, f_r [1/sr] each."""

    directional_diffuse: Floats
    uniform_diffuse: Floats


@of_directions(
    parameters=(*_SURFACE, A),
    references="he1991",
    returns="""\
HeTorranceParts [1/sr]
    (directional_diffuse, uniform_diffuse), each in the broadcast shape of all arguments; 0 below the horizon, nan
    where an angle is nan. Their sum is `he_torrance`.""",
)
def he_torrance_parts(directions: Directions, *parameters: Floats) -> HeTorranceParts:
    """Return f_r [1/sr] of the directional diffuse and of the uniform diffuse part of `he_torrance`, separately.

    The third part of eq. (5) is the specular part: `he_torrance_specular` gives its reflectance.

    Eqs (71) and (72).

    >>> surface = dict(wavelength_nm=500.0, sigma_0_um=1.45, tau_um=13.2, n=1.745, k=0.0, a=0.9)
    >>> parts = he_torrance_parts(1.0, 0.0, 1.0, 3.14, **surface)
    >>> round(float(parts.directional_diffuse), 2), round(float(parts.uniform_diffuse), 2)
    (0.65, 0.29)
    """
    *surface, albedo = parameters
    return _parts(directions, full.surface_of(*surface), albedo)


@of_directions(
    parameters=(INCIDENT, RECEIVED, *_SURFACE, A, RINGS),
    references="he1991",
    returns="""\
array [1/sr]
    In the broadcast shape of all arguments; 0 where an axis is below the horizon, nan where an angle is nan.""",
)
def he_torrance_aperture(directions: Directions, *parameters: Floats) -> Floats:
    """Return the BRDF [1/sr] that an instrument with a cone of light and a cone of its receiver measures.

    All three parts are included, with the specular part spread over the cones.

    Section 4, on Fig. 7: "The angular width of the measured specular peak is determined by the solid angles of incident
    and received light in the experiments (d omega_i = d omega_r = pi / 1024). To allow comparisons, the theoretical
    peaks have been averaged over the same solid angles." The averages are as follows.

    The specular part, eq. (70), is rho_s(theta_i) / (cos theta_i omega_i) times the share of the received cone that the
    mirror image of the cone of light covers. That share is the area that both have in common on the unit sphere,
    divided by omega_r. rho_s and cos theta_i are those of the axis of the cone of light, as in eq. (70), which is the
    limit for omega_r -> 0. The integral over all axes of the receiver, weighted by cos theta_r, is rho_s.

    The diffuse parts are averaged over both cones, by equal solid angles. They are 0 in the part of a cone below the
    horizon. The figures show the result divided by its value at theta_r = theta_i, eq. (11).

    >>> cones = dict(incident_solid_angle_sr=np.pi / 1024, received_solid_angle_sr=np.pi / 1024)
    >>> aluminum = dict(wavelength_nm=2000.0, sigma_0_um=0.28, tau_um=1.77, n=2.15, k=20.7)
    >>> around = np.deg2rad([5.0, 8.0, 10.0, 12.0, 15.0])
    >>> he_torrance_aperture(np.deg2rad(10.0), 0.0, around, np.pi, **cones, **aluminum).round(2).tolist()
    [0.95, 6.27, 17.12, 6.28, 0.97]
    """
    incident, received, *surface, albedo, rings = parameters
    return _aperture(directions, _Apertures(incident, received, int(rings)), full.surface_of(*surface), albedo)


def _very_rough(directions: Directions, slope: Floats, n: Floats, k: Floats, albedo: Floats) -> Floats:
    sin_i, cos_i, sin_r, cos_r = directions.sin_i, directions.cos_i, directions.sin_r, directions.cos_r
    # Eqs (23)-(25)
    S_over_cos_cos = shadowing(sin_i, cos_i, slope) * shadowing(sin_r, cos_r, slope)
    # Eqs (79)-(83)
    slope2 = slope**2 * variance(hidden(sin_i, cos_i, slope) + hidden(sin_r, cos_r, slope))
    # Eq. (84) gives tan^2 of the inclination of the facet
    v_xy2, v_z2 = full.v_squared(directions)
    tan2 = v_xy2 / v_z2
    # Eq. (78) with e^-b / g for its sum, b = tan^2 / (4 slope^2)
    lobe = np.exp(-tan2 / (4.0 * slope2)) / (16.0 * np.pi * slope2)
    # Eq. (75), at the bisecting angle
    F2 = fresnel.unpolarised(full.cos_bisecting(directions), n, k)
    # Eqs (71), (76) and (72)
    return finished(F2 * lobe * (1.0 + tan2) ** 2 * S_over_cos_cos + albedo / np.pi, directions)


def _smooth(directions: Directions, n: Floats, k: Floats) -> Floats:
    # Eq. (10)
    return finished(fresnel.unpolarised(directions.cos_i, n, k), directions)


def _parts(directions: Directions, surface: full.Surface, albedo: Floats) -> HeTorranceParts:
    with np.errstate(all="ignore"):
        F2 = fresnel.unpolarised(full.cos_bisecting(directions), surface.n, surface.k)
        directional = F2 * full.directional_diffuse(directions, surface)
    uniform = albedo / np.pi + np.zeros(np.shape(directional))
    return HeTorranceParts(
        finished(directional + np.zeros(np.shape(albedo)), directions), finished(uniform, directions)
    )


class _Apertures(NamedTuple):
    """Solid angles [sr] of the two cones, and the number of rings of nodes in each."""

    incident: Floats
    received: Floats
    rings: int


def _aperture(directions: Directions, apertures: _Apertures, surface: full.Surface, albedo: Floats) -> Floats:
    # Eq. (70), with the share of the received cone in the cone of reflection for its Delta
    rho_s = full.rho_s(directions, surface)
    # The angle between the viewer and the mirror image of the light
    chord2 = full.v_squared(directions)[0] + (directions.cos_i - directions.cos_r) ** 2
    apart = 2.0 * np.arcsin(np.minimum(0.5 * np.sqrt(chord2), 1.0))
    incident, received = (np.arcsin(np.sqrt(omega / np.pi)) for omega in apertures[:2])
    common = common_solid_angle(incident, received, apart) / (apertures.incident * apertures.received)
    return finished(rho_s * common / directions.cos_i + _averaged(directions, apertures, surface, albedo), directions)


def _averaged(directions: Directions, apertures: _Apertures, surface: full.Surface, albedo: Floats) -> Floats:
    """Return the diffuse parts [1/sr], averaged over both cones."""
    light, weights = _nodes(_frame(directions, "i"), apertures.incident, apertures.rings)
    viewers, _ = _nodes(_frame(directions, "r"), apertures.received, apertures.rings)
    total: Any = 0.0
    for j, weight in enumerate(weights):
        with np.errstate(all="ignore"):
            f_r = full.he_torrance.vectors(
                light[..., j : j + 1, :],
                viewers,
                wavelength_nm=surface.wavelength_um[..., None] * 1000.0,
                sigma_0_um=surface.sigma_0[..., None],
                tau_um=surface.tau[..., None],
                n=surface.n[..., None],
                k=surface.k[..., None],
                a=albedo[..., None],
            )
        total = total + weight * (f_r @ weights)
    return np.asarray(total, dtype=np.float64)


def _frame(directions: Directions, which: str) -> tuple[Floats, Floats, Floats]:
    """Return the axis of a cone, and the unit vectors of growing theta and phi there."""
    x, y, z, sin = (getattr(directions, f"{name}_{which}") for name in ("x", "y", "cos", "sin"))
    if isinstance(directions, Vectors):
        z = getattr(directions, f"w_{which}")[..., 2].astype(np.float64)  # `cos` is held at 0 below the horizon
        cos_phi, sin_phi = full.unit_azimuth(x, y, sin)
    else:
        phi = getattr(directions, f"phi_{which}")
        cos_phi, sin_phi = np.cos(phi), np.sin(phi)
    axis, along, across = (
        np.stack(np.broadcast_arrays(*vector, x)[:3], axis=-1)
        for vector in ((x, y, z), (z * cos_phi, z * sin_phi, -sin), (-sin_phi, cos_phi, np.zeros_like(x)))
    )
    return axis, along, across


def _nodes(frame: tuple[Floats, Floats, Floats], solid_angle: Floats, rings: int) -> tuple[Floats, NDArray[np.float64]]:
    """Return unit vectors (..., nodes, 3) in a cone and their weights (nodes,) [1], which add up to 1."""
    axis, along, across = (vector[..., None, :] for vector in frame)
    if rings == 0:
        return axis, np.ones(1)
    # Gauss's rule in the versine, in which solid angle is uniform, with equal steps around: exact to degree 4 rings - 1
    x, weight = gauss_rule(rings)
    turn = 2.0 * np.pi * np.arange(4 * rings) / (4 * rings)
    off = versine(np.arcsin(np.sqrt(solid_angle / np.pi)))[..., None] * np.repeat(0.5 * (1.0 + x), turn.size)
    sin_off = np.sqrt(off * (2.0 - off))
    turns = np.tile(turn, rings)
    w = (
        (1.0 - off)[..., None] * axis
        + (sin_off * np.cos(turns))[..., None] * along
        + (sin_off * np.sin(turns))[..., None] * across
    )
    return w, np.repeat(0.5 * weight, turn.size) / turn.size
