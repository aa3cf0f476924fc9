"""Energy of the model behind a table: its directional albedo, its white furnace, and the bound on a uniform part."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from brdfdb.audit.excess import DIGITS, ENERGY_TOLERANCE, cause_of, crossing, limit_of, place
from brdfdb.audit.finding import STRICT
from brdfdb.figure import Numbers, numbers, rows
from brdfdb.geometry import radians
from brdfdb.integrals.quadrature import Albedo, reflected_share
from brdfdb.integrals.uniform_bound import largest_uniform_beside, tops
from brdfdb.lobes import narrowest
from brdfdb.materials import Material, Source
from brdfdb.materials.provenance import KnownExcess
from brdfdb.materials.source import Lossless
from brdfdb.models.shared_integrals import sharing
from brdfdb.parameters import Floats
from brdfdb.tables.first_numbers import Grazing
from brdfdb.tables.grids import Axis
from brdfdb.tables.largest_albedo import LAST_LIGHT_DEG, grazing_of_source, last_light

EnergyVerdict = Literal["conserves", "loses", "gains", "known published excess", "accepted excess", "violates"]

# Absolute tolerance of each albedo [1], of which four digits are shown, and of one that is closer to a limit
TOLERANCE, FINE = 1e-5, 1e-6
SURE_DECIMALS = 5  # decimals of an albedo that its tolerance leaves
MOST_PANELS = 1000  # number of panels at which the quadrature of one light stops
BOUND_TOLERANCE = 2e-5  # absolute tolerance of the largest a(lambda) [1]
# Lights at round angles [degree]. Gauss's nodes in theta_i are added to them, so that the mean over uniform light,
# 2 int albedo cos theta_i sin theta_i dtheta_i, is a sum over lights that are computed anyway
THETA_I_DEG = (0.0, 10.0, 30.0, 45.0, 60.0, 75.0, 80.0, 85.0, 87.5, 89.0, 89.5, LAST_LIGHT_DEG)
NODES = 16  # number of Gauss nodes: the mean differs by less than 2e-4 from that of 48 nodes, for all presets
# Lights are added next to the largest albedo in at most ROUNDS rounds: until it differs by less than FLAT from its
# neighbours, or, after LEAST_ROUNDS, from the top of the parabola through them
LEAST_ROUNDS, ROUNDS, FLAT = 2, 4, 1e-6
# A lossless model loses light if it reflects less than this share at an angle [degree] up to this one. At larger angles
# shadowing alone takes more from every model of single scattering
LOSSLESS, LOSS_UP_TO_DEG = 0.99, 85.0
GAIN = 1e-4  # smallest excess over 1 of a lossless model that is reported
LIMITS = (LOSSLESS, 1.0, 1.0 + GAIN)  # albedos [1] that a verdict depends on
# Azimuths of a light over a lobe with two axes; the other quadrants repeat them
_ELLIPSE_DEG = np.array([0.0, 30.0, 60.0, 90.0])
_TURN_DEG = np.arange(0.0, 360.0, 60.0)


class Furnace(BaseModel):
    """The white furnace: the model with lossless parameters in uniform light. An ideal model shows 1."""

    model_config = STRICT

    lossless: str = Field(description="parameters that were changed, with their values")
    theta_i_deg: list[float]
    wavelength_nm: list[float] | None = Field(
        description="null: grey. Spectral tables use the first, the middle and the last wavelength"
    )
    albedo: list[Numbers] = Field(description="[theta_i][wavelength], specular part included")
    hemispherical: Numbers = Field(description="[wavelength], albedo in uniform light")
    smallest: float | None = Field(description="null: not finite")
    smallest_at_theta_i_deg: float
    smallest_at_wavelength_nm: float | None = Field(default=None, description="null: grey")
    largest: float | None = Field(description="null: not finite")
    largest_at_theta_i_deg: float
    largest_at_wavelength_nm: float | None = Field(default=None, description="null: grey")


class UniformBound(BaseModel):
    """The largest uniform diffuse part a(lambda) that conserves energy at all angles, and that of the material."""

    model_config = STRICT

    wavelength_nm: list[float]
    largest: Numbers
    preset: Numbers
    keeps: bool = Field(description="true: the a(lambda) of the material is no larger at any wavelength")


class ModelEnergy(BaseModel):
    """Directional albedo of the model behind a table, by adaptive quadrature, specular part included."""

    model_config = STRICT

    theta_i_deg: list[float]
    wavelength_nm: list[float] | None = Field(description="null: grey")
    albedo: list[Numbers] = Field(description="[theta_i][wavelength]; largest over the azimuths of the light")
    specular: list[Numbers] = Field(description="[theta_i][wavelength], the specular part of the albedo")
    integration_error: float | None = Field(description="largest estimated error of the albedo; null: not finite")
    hemispherical: Numbers = Field(description="[wavelength], albedo in uniform light")
    max_albedo: float | None = Field(description="null: not finite")
    max_at_theta_i_deg: float
    max_at_wavelength_nm: float | None
    exceeds_1_from_theta_i_deg: float | None = Field(description="to 0.001 degrees")
    judged_up_to_theta_i_deg: float = Field(description="largest angle of the lights: the verdict is for these")
    grazing: Grazing | None = Field(description="albedo of lights beyond; null: not finite")
    furnace: Furnace | None = Field(description="null: the model has no lossless parameters")
    bound_on_a: UniformBound | None = Field(description="null: the model has no such part")
    verdict: EnergyVerdict
    reason: str = Field(description="largest albedo, its angle and wavelength; for a known excess the citation")


class _Lights(NamedTuple):
    """Angles of incidence [degree], and their weights in the mean over uniform light."""

    theta_i_deg: Axis
    weights: Axis


class _White(NamedTuple):
    """The lossless form of a source, and the wavelengths [nm] of its white furnace; None if grey."""

    lossless: Lossless
    nm: Axis | None


class _Model(NamedTuple):
    """A source with its wavelengths [nm] and its lossless form, and the albedos [1] that its verdict depends on."""

    source: Source
    wavelength_nm: Axis | None
    white: _White | None
    limits: tuple[float, ...]


class _Reflected(NamedTuple):
    """Albedos [1], shape (theta_i, wavelengths): largest and mean over azimuths, specular part included.

    `error` (theta_i, 1) is the largest error over azimuths and wavelengths. The error of one light excuses no other.
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
    grazing: Grazing | None = None,
) -> ModelEnergy:
    """Return the energy of a material or a function, at wavelengths [nm] if it is spectral.

    `known` is the excess that is known as published. `claim` is the sentence of a recipe on an excess: the reason
    quotes it, and it excuses nothing. With `accept_excess` an excess that is not known is accepted. `grazing`
    is the albedo for lights beyond the last; by default it is measured.
    """
    limits = LIMITS if known is None else (*LIMITS, known.max_albedo)
    model = _Model(source, wavelength_nm, _white_of(source, wavelength_nm), limits)
    lights = _lights(source)
    with sharing():  # model and furnace are evaluated at the same directions
        reflected, white = _reflected(model, lights)
        furnace = None if model.white is None or white is None else _furnace(model.white, lights, white)
        lights, reflected = _refined(model, lights, reflected)
        first = _first_above_1(model, lights, reflected)
        largest = float(reflected.largest.max())
        if grazing is None:
            grazing = grazing_of_source(source, wavelength_nm, largest)
        elif grazing.max_albedo is not None:  # more lights were looked at
            most = max(grazing.max_albedo, float(f"{largest:.4g}"))
            grazing = grazing.model_copy(update={"max_albedo": most})
    theta, wavelength = _worst(reflected.largest)
    growth = "" if grazing is None else f"; {grazing.in_words(float(reflected.largest.max()))}"
    verdict, reason = _verdict(lights, wavelength_nm, reflected, furnace, known, growth)
    if verdict == "violates" and first is not None:
        reason += _explained(source, wavelength_nm, reflected, first, known, claim)
        verdict = "accepted excess" if accept_excess and np.isfinite(reflected.largest).all() else verdict
    return ModelEnergy(
        theta_i_deg=lights.theta_i_deg.tolist(),
        wavelength_nm=None if wavelength_nm is None else wavelength_nm.tolist(),
        albedo=rows(reflected.largest, DIGITS),
        specular=rows(reflected.specular, DIGITS),
        integration_error=_finite(float(f"{reflected.error.max():.2g}")),
        hemispherical=numbers(lights.weights @ reflected.mean, 4),
        max_albedo=_finite(reflected.largest[theta, wavelength]),
        max_at_theta_i_deg=float(lights.theta_i_deg[theta]),
        max_at_wavelength_nm=None if wavelength_nm is None else float(wavelength_nm[wavelength]),
        exceeds_1_from_theta_i_deg=first,
        judged_up_to_theta_i_deg=float(lights.theta_i_deg[-1]),
        grazing=grazing,
        furnace=furnace,
        bound_on_a=_bound(source, wavelength_nm, lights, reflected),
        verdict=verdict,
        reason=reason,
    )


def _refined(model: _Model, lights: _Lights, reflected: _Reflected) -> tuple[_Lights, _Reflected]:
    """Return lights and albedos with more lights around the largest albedo, because peaks lie between round angles."""
    for rounds in range(ROUNDS):
        worst, _ = _worst(reflected.largest)
        around, largest = slice(max(worst - 1, 0), worst + 2), reflected.largest.max(axis=1)
        if not np.ptp(largest[around]) > FLAT:  # nan is not
            break
        if rounds >= LEAST_ROUNDS and tops(lights.theta_i_deg, largest[:, np.newaxis])[0] - largest[worst] <= FLAT:
            break
        beside = lights.theta_i_deg[around]
        between = np.round((beside[1:] + beside[:-1]) / 2.0, 4)
        more = _Lights(between, np.zeros(between.size))
        order = np.argsort(np.concatenate([lights.theta_i_deg, between]))
        lights = _Lights(*(np.concatenate(pair)[order] for pair in zip(lights, more, strict=True)))
        new, _ = _reflected(model, more)
        reflected = _Reflected(*(np.concatenate(pair)[order] for pair in zip(reflected, new, strict=True)))
    return lights, reflected


def _first_above_1(model: _Model, lights: _Lights, reflected: _Reflected) -> float | None:
    """Return the angle [degree] above which an albedo exceeds 1, or None. It lies between two lights."""

    def excess(reflected: _Reflected) -> Axis:
        return np.asarray(np.max(reflected.largest - reflected.error, axis=1) - 1.0 - ENERGY_TOLERANCE)

    excesses = excess(reflected)
    if not np.any(excesses > 0.0):
        return None
    first = int(np.argmax(excesses > 0.0))
    if first == 0 or not np.isfinite(excesses[first - 1]):
        return float(lights.theta_i_deg[first])

    def between(theta_i_deg: float) -> float:
        return float(excess(_reflected(model, _Lights(np.array([theta_i_deg]), np.zeros(1)))[0])[0])

    return crossing(between, *lights.theta_i_deg[first - 1 : first + 1].tolist())


def _explained(
    source: Source,
    wavelength_nm: Axis | None,
    reflected: _Reflected,
    first: float,
    known: KnownExcess | None,
    claim: str,
) -> str:
    """Return a clause on an excess that is not known as published: its origin, and the claim on it."""
    most = float(np.max(np.where(np.isfinite(reflected.largest), reflected.largest, -np.inf)))
    clause = f"; this model does so by itself for such parameters: up to {most:.4g}, from {first:.4g} degrees"
    if isinstance(source, Material) and (cause := cause_of(source, wavelength_nm)):
        clause += f" ({cause})"
    if known is not None:
        return f"{clause}; the paper has up to {known.max_albedo:.4g}, from {known.from_theta_i_deg:.4g} degrees"
    return f"{clause}; its recipe excuses it, which is not accepted: {claim}" if claim else clause


def _worst(albedo: Floats) -> tuple[int, int]:
    """Return the index of the largest albedo. Non-finite values rank first; ties resolve to the smallest angle."""
    ranked = np.where(np.isfinite(albedo), np.round(albedo, 12), np.inf)
    theta, wavelength = np.unravel_index(np.argmax(ranked), ranked.shape)
    return int(theta), int(wavelength)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _verdict(
    lights: _Lights,
    wavelength_nm: Axis | None,
    reflected: _Reflected,
    furnace: Furnace | None,
    known: KnownExcess | None,
    growth: str,
) -> tuple[EnergyVerdict, str]:
    """Return the verdict on a model, and its reason with angle and wavelength, and the growth for lights beyond."""
    theta_i_deg, certain = lights.theta_i_deg, reflected.largest - reflected.error
    if not np.isfinite(certain).all():
        broken, wavelength = np.argwhere(~np.isfinite(certain))[0]
        at = place(theta_i_deg[broken], _nm(wavelength_nm, wavelength))
        return "violates", f"the model reflects no finite share of what arrives at {at}"
    worst, wavelength = _worst(reflected.largest)
    if np.any(certain > 1.0 + ENERGY_TOLERANCE):
        beyond = np.max(certain, axis=1) - limit_of(known, theta_i_deg) - ENERGY_TOLERANCE
        published = known is not None and bool(np.all(beyond <= 0.0))
        if known is not None and not published:
            worst = int(np.argmax(beyond))
            wavelength = int(np.argmax(reflected.largest[worst]))
        at = place(theta_i_deg[worst], _nm(wavelength_nm, wavelength))
        share = f"{reflected.largest[worst].max():.4g} of what arrives at {at}{growth}"
        if known is not None and published:
            return "known published excess", f"reflects {share}: {known.citation}"
        return "violates", f"the model reflects {share}"
    at = place(theta_i_deg[worst], _nm(wavelength_nm, wavelength))
    up_to = f"for lights up to {theta_i_deg[-1]:g} degrees"
    largest = f"reflects at most {np.max(reflected.largest):.4g} of what arrives, {up_to}, at {at}{growth}"
    if furnace is None:
        return "conserves", f"{largest}; no parameters make the model lossless"
    return _where_nothing_absorbs(furnace, largest)


def _where_nothing_absorbs(furnace: Furnace, largest: str) -> tuple[EnergyVerdict, str]:
    """Return the verdict on a model that reflects at most what arrives: by its lossless form, a gain before a loss."""
    albedo = np.array(furnace.albedo, dtype=np.float64)[np.array(furnace.theta_i_deg) <= LOSS_UP_TO_DEG]
    row, column = np.unravel_index(np.argmin(albedo), albedo.shape)
    at = place(furnace.theta_i_deg[row], _nm(furnace.wavelength_nm, column))
    least = f"{albedo[row, column]:.3g} of what arrives at {at}" if albedo[row, column] < LOSSLESS else ""
    if furnace.largest is not None and furnace.largest > 1.0 + GAIN:
        at = place(furnace.largest_at_theta_i_deg, furnace.largest_at_wavelength_nm)
        more = f"{furnace.largest:.5g} of what arrives at {at}" + (f", and {least}" if least else "")
        return "gains", f"{largest}; lossless ({furnace.lossless}), the model would reflect {more}"
    if least:
        return "loses", f"lossless ({furnace.lossless}), the model reflects {least}; as it is, it {largest}"
    return "conserves", largest


def _nm(wavelength_nm: Axis | Sequence[float] | None, index: int | np.integer[Any]) -> float | None:
    return None if wavelength_nm is None else float(wavelength_nm[int(index)])


def _lights(source: Source) -> _Lights:
    """Return the lights of a source, 90 degrees included unless f_r has a pole at grazing."""
    x, weight = np.polynomial.legendre.leggauss(NODES)
    nodes, weights = np.round(45.0 * (1.0 + x), 4), weight * (np.pi / 4.0)  # rounded for the report
    others = np.unique([*THETA_I_DEG, last_light(source)])
    theta_i_deg = np.concatenate([nodes, others])
    weights = np.concatenate([weights * np.sin(2.0 * radians(nodes)), np.zeros(others.size)])
    order = np.argsort(theta_i_deg)
    return _Lights(theta_i_deg[order], weights[order])


def _reflected(model: _Model, lights: _Lights) -> tuple[_Reflected, _Reflected | None]:
    """Return the albedos [1] of a source, and of its lossless form, for lights from all azimuths that differ.

    Both are integrated over the same directions. Lights whose albedo is closer to a limit than its error are integrated
    again, to `FINE`.
    """
    source, theta_i = model.source, radians(lights.theta_i_deg)
    phi_i_deg, weights = _azimuths(source)
    forms = [(source, model.wavelength_nm)]
    if model.white is not None:
        forms.append((model.white.lossless.source, model.white.nm))
    widths = [1 if nm is None else nm.size for _, nm in forms]
    specular = [
        np.broadcast_to(np.reshape(form.specular_reflectance(theta_i, nm), (theta_i.size, -1)), (theta_i.size, width))
        for (form, nm), width in zip(forms, widths, strict=True)
    ]
    evaluated = [form.brdf_at(nm) for form, nm in forms]

    def brdf(wi: Floats, wr: Floats) -> Floats:
        with np.errstate(all="ignore"):  # nodes lie in every corner; what is finite is tested, not flagged
            # f_r of a lossless form may be the same at all wavelengths, and have one column
            values = [
                np.broadcast_to(f_r(wi, wr), (len(wi), width)) for f_r, width in zip(evaluated, widths, strict=True)
            ]
        return np.concatenate(values, axis=-1)

    def integrated(rows: NDArray[np.intp], tolerance: float) -> Albedo:
        return reflected_share(
            brdf,
            theta_i[rows, np.newaxis],
            radians(phi_i_deg),
            narrowest(source.lobe(np.cos(theta_i[rows])[:, np.newaxis, np.newaxis], model.wavelength_nm)),
            tolerance=tolerance,
            most_panels=MOST_PANELS,
            width=sum(widths),
            # f_r is the same on both sides of a light along an axis of an ellipse
            mirrored=(phi_i_deg % 90.0 == 0.0) & (source.elliptical or not source.anisotropic),
        )

    diffuse, error = integrated(np.arange(theta_i.size), TOLERANCE)
    whole = diffuse + np.concatenate(specular, axis=1)[:, np.newaxis]
    off = np.abs(np.subtract.outer(whole, model.limits)).min(axis=(2, 3))
    near = np.flatnonzero(np.any(off <= error + ENERGY_TOLERANCE, axis=1))
    if near.size:
        diffuse[near], error[near] = integrated(near, FINE)
    own, *others = (
        _Reflected(
            part.max(axis=1) + extra,
            np.einsum("tpw,p->tw", part, weights) + extra,
            extra,
            np.max(error, axis=1, keepdims=True),
        )
        for part, extra in zip(np.split(diffuse, widths[:1], axis=2), specular, strict=False)
    )
    return own, others[0] if others else None


def _azimuths(source: Source) -> tuple[Axis, Axis]:
    """Return the azimuths of lights [degree] that differ, and their weights in the mean over azimuths."""
    if not source.anisotropic:
        return np.zeros(1), np.ones(1)
    if source.elliptical:
        return _ELLIPSE_DEG, np.array([1.0, 2.0, 2.0, 1.0]) / 6.0
    return _TURN_DEG, np.full(_TURN_DEG.size, 1.0 / _TURN_DEG.size)


def _white_of(source: Source, wavelength_nm: Axis | None) -> _White | None:
    """Return the lossless form of a source, with the first, the middle and the last wavelength; None if it has none."""
    if source.lossless is None:
        return None
    few = None if wavelength_nm is None else np.unique([0, wavelength_nm.size // 2, wavelength_nm.size - 1])
    return _White(source.lossless, None if wavelength_nm is None else wavelength_nm[few])


def _furnace(white: _White, lights: _Lights, reflected: _Reflected) -> Furnace:
    """Return the white furnace of a source from the albedos of its lossless form."""
    wavelengths = white.nm
    # Albedos that differ by less than their error are alike, and the smallest of their angles stands for them
    alike = np.round(reflected.largest, SURE_DECIMALS)
    low, high = (np.unravel_index(extreme(alike), alike.shape) for extreme in (np.argmin, np.argmax))
    return Furnace(
        lossless=", ".join(f"{name} = {value:.4g}" for name, value in white.lossless.changes.items()),
        theta_i_deg=lights.theta_i_deg.tolist(),
        wavelength_nm=None if wavelengths is None else wavelengths.tolist(),
        albedo=rows(reflected.largest, DIGITS),
        hemispherical=numbers(lights.weights @ reflected.mean, 4),
        smallest=_finite(reflected.largest[low]),
        smallest_at_theta_i_deg=float(lights.theta_i_deg[low[0]]),
        smallest_at_wavelength_nm=_nm(wavelengths, low[1]),
        largest=_finite(reflected.largest[high]),
        largest_at_theta_i_deg=float(lights.theta_i_deg[high[0]]),
        largest_at_wavelength_nm=_nm(wavelengths, high[1]),
    )


def _bound(source: Source, wavelength_nm: Axis | None, lights: _Lights, reflected: _Reflected) -> UniformBound | None:
    """Return the largest uniform part [1] that conserves energy; None unless the model leaves that part free.

    A uniform part a raises the albedo by a at every angle of the light.
    """
    if not isinstance(source, Material):
        return None
    spec, arguments = source.spec, source.arguments(wavelength_nm)
    if spec.uniform_bound_cosine is None or spec.uniform is None:
        return None
    nm = np.ravel(arguments["wavelength_nm"])
    a = np.broadcast_to(arguments[spec.uniform], nm.shape)
    surfaces = {name: value for name, value in arguments.items() if name != spec.uniform}
    largest = largest_uniform_beside(
        spec, radians(lights.theta_i_deg), reflected.largest - a, surfaces, BOUND_TOLERANCE
    )
    return UniformBound(
        wavelength_nm=nm.tolist(),
        largest=numbers(np.round(largest, 9)),
        preset=a.tolist(),
        keeps=bool(np.all(a <= largest + BOUND_TOLERANCE)),
    )
