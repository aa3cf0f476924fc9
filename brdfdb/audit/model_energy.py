"""Energy of the model behind a table: its directional albedo, its white furnace, and the bound on a uniform part."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, Field

from brdfdb.audit.excess import DIGITS, ENERGY_TOLERANCE, crossing, limit_of
from brdfdb.audit.finding import STRICT
from brdfdb.figure import Numbers, numbers, rows
from brdfdb.geometry import radians
from brdfdb.integrals.uniform_bound import largest_uniform_beside
from brdfdb.materials import Material, Source
from brdfdb.materials.provenance import KnownExcess
from brdfdb.parameters import Floats
from brdfdb.tables.albedo import source_albedo
from brdfdb.tables.grids import Axis

EnergyVerdict = Literal["conserves", "loses", "known published excess", "accepted excess", "violates"]

TOLERANCE = 1e-6  # absolute, of each albedo
MOST_PANELS = 1000  # where the quadrature of one light gives up
BOUND_TOLERANCE = 2e-5  # absolute, of the largest a
# Lights that people ask for [degree]. Gauss's nodes in theta_i join them, so that the mean over uniform light,
# 2 int albedo cos theta_i sin theta_i dtheta_i, is a sum over some of the same lights
THETA_I_DEG = (0.0, 10.0, 30.0, 45.0, 60.0, 75.0, 80.0, 85.0, 87.5, 89.0, 89.5, 89.9)
NODES = 16  # the mean is within 2e-4 of that of 48 nodes for every material of the papers
# Lights are added beside the largest albedo, so many times, as long as it differs by more than this from those beside
ROUNDS, FLAT = 4, 1e-6
# A lossless model loses light if it reflects less than this share of it, up to this angle [degree]: beyond, shadowing
# alone takes more from every model of single scattering
LOSSLESS, LOSS_UP_TO_DEG = 0.99, 85.0
GAIN = 1e-4  # beyond 1, of a lossless model, that is worth saying
_ELLIPSE_DEG = np.array([0.0, 30.0, 60.0, 90.0])  # azimuths of a light over a lobe with two axes: the rest is the same
_TURN_DEG = np.arange(0.0, 360.0, 60.0)


class Furnace(BaseModel):
    """The white furnace: the model made lossless, in light that is the same from everywhere; an ideal one shows 1."""

    model_config = STRICT

    lossless: str = Field(description="which parameters were set to what")
    theta_i_deg: list[float]
    wavelength_nm: list[float] | None = Field(description="null: grey; of many wavelengths the ends and the middle")
    albedo: list[Numbers] = Field(description="[theta_i][wavelength], specular part included")
    hemispherical: Numbers = Field(description="[wavelength], the mean over uniform light")
    smallest: float | None = Field(description="null: not finite")
    smallest_at_theta_i_deg: float
    largest: float | None = Field(description="null: not finite")
    largest_at_theta_i_deg: float


class UniformBound(BaseModel):
    """The largest uniform diffuse part a(lambda) that conserves energy at all angles, against the material's own."""

    model_config = STRICT

    wavelength_nm: list[float]
    largest: Numbers
    preset: Numbers
    keeps: bool = Field(description="whether the material's own is no larger at any wavelength")


class ModelEnergy(BaseModel):
    """Directional albedo of the model behind a table, by adaptive quadrature, specular part included."""

    model_config = STRICT

    theta_i_deg: list[float]
    wavelength_nm: list[float] | None = Field(description="null: grey")
    albedo: list[Numbers] = Field(description="[theta_i][wavelength]; over the azimuths of the light the largest")
    specular: list[Numbers] = Field(description="[theta_i][wavelength], the share of the specular part in it")
    integration_error: float | None = Field(description="of the albedo, the largest estimate; null: not finite")
    hemispherical: Numbers = Field(description="[wavelength], of light that is the same from everywhere")
    max_albedo: float | None = Field(description="null: not finite")
    max_at_theta_i_deg: float
    max_at_wavelength_nm: float | None
    exceeds_1_from_theta_i_deg: float | None = Field(description="to 0.001 degrees")
    furnace: Furnace | None = Field(description="null: the model has no lossless parameters")
    bound_on_a: UniformBound | None = Field(description="null: the model has no such part")
    verdict: EnergyVerdict
    reason: str = Field(description="how much, where; of a known excess the citation")


class _Lights(NamedTuple):
    """Angles of incidence [degree], and their weights in the mean over uniform light."""

    theta_i_deg: Axis
    weights: Axis


class _Reflected(NamedTuple):
    """Albedos (theta_i, wavelengths): the largest and the mean over azimuths, with the specular part in them.

    `error` (theta_i, 1) is the largest over azimuths and wavelengths: the error of one light excuses no other.
    """

    largest: Floats
    mean: Floats
    specular: Floats
    error: Floats


def model_energy_of(
    source: Source,
    wavelength_nm: Axis | None,
    known: KnownExcess | None,
    claim: str = "",
    *,
    accept_excess: bool = False,
) -> ModelEnergy:
    """Return the energy of a material or a function, at wavelengths [nm] if it is spectral.

    `known` is the excess that is known as published. `claim` is what a recipe says of an excess: it is repeated, and
    excuses nothing. With `accept_excess` one that is not known is accepted.
    """
    lights = _lights(source)
    furnace = _furnace(source, wavelength_nm, lights)
    lights, found = _refined(source, wavelength_nm, lights, _reflected(source, wavelength_nm, lights))
    theta, wavelength = _worst(found.largest)
    first = _first_above_1(source, wavelength_nm, lights, found)
    verdict, reason = _verdict(lights, found, furnace, known)
    if verdict == "violates" and first is not None:
        reason += _explained(source, found, first, known, claim)
        verdict = "accepted excess" if accept_excess and np.isfinite(found.largest).all() else verdict
    return ModelEnergy(
        theta_i_deg=lights.theta_i_deg.tolist(),
        wavelength_nm=None if wavelength_nm is None else wavelength_nm.tolist(),
        albedo=rows(found.largest, DIGITS),
        specular=rows(found.specular, DIGITS),
        integration_error=_finite(float(f"{found.error.max():.2g}")),
        hemispherical=numbers(lights.weights @ found.mean, 4),
        max_albedo=_finite(found.largest[theta, wavelength]),
        max_at_theta_i_deg=float(lights.theta_i_deg[theta]),
        max_at_wavelength_nm=None if wavelength_nm is None else float(wavelength_nm[wavelength]),
        exceeds_1_from_theta_i_deg=first,
        furnace=furnace,
        bound_on_a=_bound(source, wavelength_nm, lights, found),
        verdict=verdict,
        reason=reason,
    )


def _refined(
    source: Source, wavelength_nm: Axis | None, lights: _Lights, found: _Reflected
) -> tuple[_Lights, _Reflected]:
    """Return more lights around the largest albedo, half way to their neighbours: peaks lie between round angles."""
    for _ in range(ROUNDS):
        worst, _ = _worst(found.largest)
        around = slice(max(worst - 1, 0), worst + 2)
        if not np.ptp(found.largest[around].max(axis=1)) > FLAT:  # nan is not
            break
        beside = lights.theta_i_deg[around]
        between = np.round((beside[1:] + beside[:-1]) / 2.0, 4)
        more = _Lights(between, np.zeros(between.size))
        order = np.argsort(np.concatenate([lights.theta_i_deg, between]))
        lights = _Lights(*(np.concatenate(pair)[order] for pair in zip(lights, more, strict=True)))
        new = _reflected(source, wavelength_nm, more)
        found = _Reflected(*(np.concatenate(pair)[order] for pair in zip(found, new, strict=True)))
    return lights, found


def _first_above_1(source: Source, wavelength_nm: Axis | None, lights: _Lights, found: _Reflected) -> float | None:
    """Return the angle [degree] above which an albedo exceeds 1: its crossing of 1 between two lights."""

    def excess(of: _Reflected) -> Axis:
        return np.asarray(np.max(of.largest - of.error, axis=1) - 1.0 - ENERGY_TOLERANCE)

    at = excess(found)
    if not np.any(at > 0.0):
        return None
    first = int(np.argmax(at > 0.0))
    if first == 0 or not np.isfinite(at[first - 1]):
        return float(lights.theta_i_deg[first])

    def between(theta_i_deg: float) -> float:
        return float(excess(_reflected(source, wavelength_nm, _Lights(np.array([theta_i_deg]), np.zeros(1))))[0])

    return crossing(between, *lights.theta_i_deg[first - 1 : first + 1].tolist())


def _explained(source: Source, found: _Reflected, first: float, known: KnownExcess | None, claim: str) -> str:
    """Return a sentence on an excess that is not known as published: its origin, and what does not excuse it."""
    most = float(np.max(np.where(np.isfinite(found.largest), found.largest, -np.inf)))
    said = f"; this model does so by itself for such parameters: up to {most:.4g}, from {first:.4g} degrees"
    if isinstance(source, Material) and source.spec.excess:
        said += f" ({source.spec.excess})"
    if known is not None:
        return f"{said}; published are {known.max_albedo:.4g}, from {known.from_theta_i_deg:.4g} degrees"
    return f"{said}; its recipe excuses it, which counts for nothing: {claim}" if claim else said


def _worst(albedo: Floats) -> tuple[int, int]:
    """Return the index of the largest albedo. Non-finite values rank first; ties resolve to the smallest angle."""
    ranked = np.where(np.isfinite(albedo), np.round(albedo, 12), np.inf)
    theta, wavelength = np.unravel_index(np.argmax(ranked), ranked.shape)
    return int(theta), int(wavelength)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _verdict(
    lights: _Lights, found: _Reflected, furnace: Furnace | None, known: KnownExcess | None
) -> tuple[EnergyVerdict, str]:
    theta_i_deg, certain = lights.theta_i_deg, found.largest - found.error
    if not np.isfinite(certain).all():
        broken = theta_i_deg[~np.isfinite(certain).all(axis=1)]
        return "violates", f"the model reflects no finite share of what arrives at {broken[0]:g} degrees"
    if np.any(certain > 1.0 + ENERGY_TOLERANCE):
        beyond = np.max(certain, axis=1) - limit_of(known, theta_i_deg) - ENERGY_TOLERANCE
        worst, _ = _worst(found.largest)
        if known is None or np.all(beyond <= 0.0):
            share = f"{found.largest[worst].max():.4g} of what arrives at {theta_i_deg[worst]:.4g} degrees"
            if known is not None:
                return "known published excess", f"reflects {share}: {known.citation}"
            return "violates", f"the model reflects {share}"
        worst = int(np.argmax(beyond))
        share = f"{found.largest[worst].max():.4g} of what arrives at {theta_i_deg[worst]:.4g} degrees"
        return "violates", f"the model reflects {share}"
    largest = f"reflects at most {np.max(found.largest):.4g} of what arrives"
    if furnace is None:
        return "conserves", f"{largest}; no parameters make the model lossless"
    gains = ""
    if furnace.largest is not None and furnace.largest > 1.0 + GAIN:
        where = "" if furnace.largest_at_theta_i_deg is None else f" at {furnace.largest_at_theta_i_deg:.4g} degrees"
        gains = f"; lossless ({furnace.lossless}), it would reflect {furnace.largest:.4g}{where}"
    albedo = np.array(furnace.albedo, dtype=np.float64).min(axis=1)
    judged = np.array(furnace.theta_i_deg) <= LOSS_UP_TO_DEG
    least = np.argmin(albedo[judged])
    if albedo[judged][least] < LOSSLESS:
        angle = np.array(furnace.theta_i_deg)[judged][least]
        of_what = f"{albedo[judged][least]:.3g} of what arrives at {angle:.3g} degrees"
        return "loses", f"lossless ({furnace.lossless}), the model reflects {of_what}{gains}"
    return "conserves", f"{largest}{gains}"


def _lights(source: Source) -> _Lights:
    """Return the lights of a source; 90 degrees is one of them unless f_r has a pole there."""
    x, weight = np.polynomial.legendre.leggauss(NODES)
    nodes, weights = np.round(45.0 * (1.0 + x), 4), weight * (np.pi / 4.0)  # people read them
    others = np.array(THETA_I_DEG if source.grazing_pole else (*THETA_I_DEG, 90.0))
    theta_i_deg = np.concatenate([nodes, others])
    weights = np.concatenate([weights * np.sin(2.0 * radians(nodes)), np.zeros(others.size)])
    order = np.argsort(theta_i_deg)
    return _Lights(theta_i_deg[order], weights[order])


def _reflected(source: Source, wavelength_nm: Axis | None, lights: _Lights) -> _Reflected:
    """Return the albedos of a source for lights from all azimuths that matter."""
    theta_i = radians(lights.theta_i_deg)
    phi_i_deg, weights = np.zeros(1), np.ones(1)
    if source.anisotropic and source.elliptical:
        phi_i_deg, weights = _ELLIPSE_DEG, np.array([1.0, 2.0, 2.0, 1.0]) / 6.0
    elif source.anisotropic:
        phi_i_deg, weights = _TURN_DEG, np.full(_TURN_DEG.size, 1.0 / _TURN_DEG.size)
    limits: dict[str, Any] = {"tolerance": TOLERANCE, "most_panels": MOST_PANELS}
    found = [
        [source_albedo(source, float(theta), float(phi), wavelength_nm, **limits) for phi in radians(phi_i_deg)]
        for theta in theta_i
    ]
    diffuse = np.array([[each.albedo for each in row] for row in found])
    specular = np.reshape(source.specular_reflectance(theta_i, wavelength_nm), (theta_i.size, -1))
    specular = np.broadcast_to(specular, diffuse[:, 0].shape)
    mean = np.einsum("tpw,p->tw", diffuse, weights) + specular
    error = np.array([[max(float(each.error) for each in row)] for row in found])
    return _Reflected(diffuse.max(axis=1) + specular, mean, specular, error)


def _furnace(source: Source, wavelength_nm: Axis | None, lights: _Lights) -> Furnace | None:
    """Return the source with nothing absorbed, of many wavelengths at the first, the middle and the last."""
    lossless = source.lossless
    if lossless is None:
        return None
    some = wavelength_nm
    if wavelength_nm is not None:
        some = wavelength_nm[np.unique([0, wavelength_nm.size // 2, wavelength_nm.size - 1])]
    found = _reflected(lossless.source, some, lights)
    low, high = found.largest.min(axis=1), found.largest.max(axis=1)
    return Furnace(
        lossless=", ".join(f"{name} = {value:.4g}" for name, value in lossless.changes.items()),
        theta_i_deg=lights.theta_i_deg.tolist(),
        wavelength_nm=None if some is None else some.tolist(),
        albedo=rows(found.largest, DIGITS),
        hemispherical=numbers(lights.weights @ found.mean, 4),
        smallest=_finite(low.min()),
        smallest_at_theta_i_deg=float(lights.theta_i_deg[np.argmin(low)]),
        largest=_finite(high.max()),
        largest_at_theta_i_deg=float(lights.theta_i_deg[np.argmax(high)]),
    )


def _bound(source: Source, wavelength_nm: Axis | None, lights: _Lights, found: _Reflected) -> UniformBound | None:
    """Return the largest albedo of a uniform part that only energy bounds; None of other models.

    With a uniform part of a, a surface reflects as much more than without it, at every light.
    """
    if not isinstance(source, Material):
        return None
    spec, arguments = source.spec, source.arguments(wavelength_nm)
    if spec.uniform_bound_cosine is None or spec.uniform is None:
        return None
    a = float(source.parameters[spec.uniform])
    surfaces = {name: value for name, value in arguments.items() if name != spec.uniform}
    largest = largest_uniform_beside(spec, radians(lights.theta_i_deg), found.largest - a, surfaces, BOUND_TOLERANCE)
    nm = np.ravel(arguments["wavelength_nm"])
    return UniformBound(
        wavelength_nm=nm.tolist(),
        largest=numbers(np.round(largest, 9)),
        preset=[a] * nm.size,
        keeps=bool(np.all(a <= largest + BOUND_TOLERANCE)),
    )
