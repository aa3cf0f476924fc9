"""Energy of the model behind a table: its directional albedo, its white furnace, and the bound on a uniform part."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from brdfdb.audit.finding import STRICT
from brdfdb.figure import Numbers, numbers, rows
from brdfdb.gauss import gauss_rule
from brdfdb.geometry import radians
from brdfdb.integrals.quadrature import Albedo, reflected_share
from brdfdb.integrals.uniform_bound import largest_uniform_beside, tops
from brdfdb.lobes import narrowest
from brdfdb.materials import Material, Source, presets
from brdfdb.materials.provenance import KnownExcess
from brdfdb.materials.source import Lossless
from brdfdb.models.shared_integrals import sharing
from brdfdb.parameters import Floats
from brdfdb.tables.albedo import LAST_LIGHT_DEG, grazing_of_source, last_light
from brdfdb.tables.grids import Axis
from brdfdb.tables.stated_error import Grazing

# Tolerance of an albedo of 1 [1]. Sums of float32 values round: an ideal diffuser measures 1 + 1.2e-7
ENERGY_TOLERANCE = 1e-6
DIGITS = 7  # significant digits of albedos in a report: as many as a float32 holds
ANGLE_TOLERANCE_DEG = 1e-3  # tolerance of the angle above which an albedo exceeds 1

EnergyVerdict = Literal["conserves", "loses", "gains", "known published excess", "accepted excess", "violates"]

TOLERANCE = 1e-5  # absolute tolerance of each albedo [1], of which four digits are shown
FINE = 1e-6  # tolerance of an albedo [1] that is closer to a limit than its error
SURE_DECIMALS = 5  # decimals of an albedo that its tolerance leaves
MOST_PANELS = 1000  # number of panels at which the quadrature of one light stops
BOUND_TOLERANCE = 2e-5  # absolute tolerance of the largest a(lambda) [1]
# Lights at round angles [degree]. Gauss's nodes in theta_i are added to them, so that the mean over uniform light,
# 2 int albedo cos theta_i sin theta_i dtheta_i, is a sum over lights that are computed anyway
THETA_I_DEG = (0.0, 10.0, 30.0, 45.0, 60.0, 75.0, 80.0, 85.0, 87.5, 89.0, 89.5, LAST_LIGHT_DEG)
NODES = 16  # number of Gauss nodes: the mean differs by less than 2e-4 from that of 48 nodes, for all presets
# Lights are added next to the largest albedo in at most ROUNDS rounds: until it differs by less than FLAT from its
# neighbours, or, after LEAST_ROUNDS, from the top of the parabola through them
LEAST_ROUNDS = 2
ROUNDS = 4
FLAT = 1e-6
# A lossless model loses light if it reflects less than this share at an angle [degree] up to this one. At larger angles
# shadowing alone takes more from every model of single scattering
LOSSLESS = 0.99
LOSS_UP_TO_DEG = 85.0
GAIN = 1e-4  # smallest excess over 1 of a lossless model that is reported
LIMITS = (LOSSLESS, 1.0, 1.0 + GAIN)  # albedos [1] that a verdict depends on
# Azimuths of a light over a lobe with two axes; the other quadrants repeat them
_ELLIPSE_DEG = np.array([0.0, 30.0, 60.0, 90.0])
_TURN_DEG = np.arange(0.0, 360.0, 60.0)


def published_excess(material: Material, wavelength_nm: Axis | None) -> KnownExcess | None:
    """Return the excess that is known as published of a material [1, degree], or None.

    Only presets have a known excess. A material has it if its parameters, index of refraction and wavelengths are
    those of the preset, under any name. Neither a model nor a recipe excuses an excess. `Material` refuses a known
    excess that rests on an assumption.
    """
    for preset in presets().values():
        known = preset.known_excess
        if known is None:
            continue
        stated = preset.wavelengths_nm
        same = (preset.model, preset.file_parameters(), preset.refractive_index) == (
            *(material.model, material.file_parameters()),
            material.refractive_index,
        )
        if same and (stated is None or np.array_equal(stated, wavelength_nm if wavelength_nm is not None else ())):
            return known
    return None


def cause_of(material: Material, wavelength_nm: Axis | None) -> str:
    """Return why the model of a material can reflect more than arrives, in words; empty if its paper does not say.

    A limit of energy that the parameters do not keep comes first. The general reason of the model follows only if they
    leave another limit, too, or keep all of them.
    """
    spec = material.spec
    stated = [] if spec.limits is None else list(spec.limits(material.arguments(wavelength_nm)))
    outside = [limit for limit in stated if limit.standing == "outside" and limit.of_energy]
    causes = [
        f"a limit is not met: {limit.quantity} is {limit.value}, valid {limit.valid}; {limit.where}"
        for limit in outside
    ]
    others = any(limit.standing in ("at the edge", "outside") for limit in stated if not limit.of_energy)
    if spec.excess and (others or not outside):
        causes.append(spec.excess)
    return "; ".join(causes)


def limit_of(known: KnownExcess | None, theta_i_deg: Axis) -> Axis:
    """Return the largest allowed albedo [1] at each angle [degree]: 1, or the known excess above its angle."""
    one = np.full(theta_i_deg.size, 1.0 + ENERGY_TOLERANCE)
    return one if known is None else np.where(theta_i_deg >= known.from_theta_i_deg, known.max_albedo, one)


def place(theta_i_deg: float, wavelength_nm: float | None) -> str:
    """Return the angle [degree] of an albedo in words, with its wavelength [nm] unless it is grey."""
    return f"{theta_i_deg:.4g} degrees" + ("" if wavelength_nm is None else f" and {wavelength_nm:g} nm")


def crossing(excess: Callable[[float], float], low: float, high: float) -> float:
    """Return the angle [degree] above which an excess is positive, by bisection to `ANGLE_TOLERANCE_DEG`.

    `excess` is an albedo minus 1 [1] as a function of the angle; it is not positive at `low`, and positive at `high`.
    """
    while high - low > ANGLE_TOLERANCE_DEG:
        between = (low + high) / 2.0
        low, high = (low, between) if excess(between) > 0.0 else (between, high)
    return round(high, 4)


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


class _Place(NamedTuple):
    """Indices of a light and of a wavelength."""

    theta: int
    wavelength: int


class _Reflected(NamedTuple):
    """Albedos [1], shape (theta_i, wavelengths): largest and mean over azimuths, specular part included.

    `error` (theta_i, 1) is the largest error over azimuths and wavelengths. The error of one light excuses no other.
    """

    largest: Floats
    mean: Floats
    specular: Floats
    error: Floats

    @property
    def certain(self) -> Floats:
        """Return the largest albedos less their errors."""
        return self.largest - self.error

    @property
    def worst(self) -> _Place:
        """Return the place of the largest albedo. Non-finite values rank first; ties resolve to the smallest angle."""
        ranked = np.where(np.isfinite(self.largest), np.round(self.largest, 12), np.inf)
        theta, wavelength = np.unravel_index(np.argmax(ranked), ranked.shape)
        return _Place(int(theta), int(wavelength))


class _ReflectedForms(NamedTuple):
    """Albedos of a source, and of its lossless form; None if it has none."""

    source: _Reflected
    lossless: _Reflected | None


class _Judgement(NamedTuple):
    """The verdict on a model, and its reason."""

    verdict: EnergyVerdict
    reason: str


class _Model(NamedTuple):
    """A source, and the lossless form of it (None if it has none), each with its wavelengths [nm] (None if grey).

    `limits` are the albedos [1] that the verdict depends on.
    """

    source: Source
    wavelength_nm: Axis | None
    lossless: Lossless | None
    lossless_nm: Axis | None
    limits: tuple[float, ...]

    @classmethod
    def of(cls, source: Source, wavelength_nm: Axis | None, limits: tuple[float, ...]) -> _Model:
        """Return the model of a source. Its lossless form has the first, the middle and the last wavelength."""
        few = wavelength_nm
        if wavelength_nm is not None:
            few = wavelength_nm[np.unique([0, wavelength_nm.size // 2, wavelength_nm.size - 1])]
        return cls(source, wavelength_nm, source.lossless, few, limits)

    def lights(self) -> _Lights:
        """Return the lights of the source, 90 degrees included unless f_r has a pole at grazing."""
        rule = gauss_rule(NODES)
        nodes = np.round(45.0 * (1.0 + rule.nodes), 4)  # rounded for the report
        weights = rule.weights * (np.pi / 4.0) * np.sin(2.0 * radians(nodes))
        others = np.unique([*THETA_I_DEG, last_light(self.source)])
        theta_i_deg = np.concatenate([nodes, others])
        order = np.argsort(theta_i_deg)
        return _Lights(theta_i_deg[order], np.concatenate([weights, np.zeros(others.size)])[order])

    def reflected(self, lights: _Lights) -> _ReflectedForms:
        """Return the albedos [1] of the source and of its lossless form, for lights from all azimuths that differ.

        Both are integrated over the same directions. Lights whose albedo is closer to a limit than its error are
        integrated again, to `FINE`.
        """
        source = self.source
        theta_i = radians(lights.theta_i_deg)
        phi_i_deg = np.zeros(1)
        of_azimuths = np.ones(1)  # weights in the mean over azimuths
        if source.anisotropic and source.elliptical:
            phi_i_deg = _ELLIPSE_DEG
            of_azimuths = np.array([1.0, 2.0, 2.0, 1.0]) / 6.0
        elif source.anisotropic:
            phi_i_deg = _TURN_DEG
            of_azimuths = np.full(_TURN_DEG.size, 1.0 / _TURN_DEG.size)
        forms = [(source, self.wavelength_nm)]
        if self.lossless is not None:
            forms.append((self.lossless.source, self.lossless_nm))
        widths = [1 if nm is None else nm.size for _, nm in forms]
        shapes = [(theta_i.size, width) for width in widths]
        specular = [
            np.broadcast_to(np.reshape(form.specular_reflectance(theta_i, nm), (theta_i.size, -1)), shape)
            for (form, nm), shape in zip(forms, shapes, strict=True)
        ]
        evaluated = [form.brdf_at(nm) for form, nm in forms]

        def brdf(wi: Floats, wr: Floats) -> Floats:
            with np.errstate(all="ignore"):  # extreme directions may overflow; values are tested later
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
                narrowest(source.lobe(np.cos(theta_i[rows])[:, np.newaxis, np.newaxis], self.wavelength_nm)),
                tolerance=tolerance,
                most_panels=MOST_PANELS,
                width=sum(widths),
                # f_r is the same on both sides of a light along an axis of an ellipse
                mirrored=(phi_i_deg % 90.0 == 0.0) & (source.elliptical or not source.anisotropic),
            )

        diffuse, error = integrated(np.arange(theta_i.size), TOLERANCE)
        albedo = diffuse + np.concatenate(specular, axis=1)[:, np.newaxis]
        distance = np.abs(np.subtract.outer(albedo, self.limits)).min(axis=(2, 3))
        near = np.flatnonzero(np.any(distance <= error + ENERGY_TOLERANCE, axis=1))
        if near.size:
            diffuse[near], error[near] = integrated(near, FINE)
        largest_error = np.max(error, axis=1, keepdims=True)
        reflected = [
            _Reflected(
                part.max(axis=1) + mirrored,
                np.einsum("tpw,p->tw", part, of_azimuths) + mirrored,
                mirrored,
                largest_error,
            )
            for part, mirrored in zip(np.split(diffuse, widths[:1], axis=2), specular, strict=False)
        ]
        return _ReflectedForms(reflected[0], reflected[1] if self.lossless is not None else None)

    def first_above_1(self, lights: _Lights, reflected: _Reflected) -> float | None:
        """Return the angle [degree] above which an albedo exceeds 1, or None. It lies between two lights."""

        def excess(reflected: _Reflected) -> Axis:
            return np.asarray(np.max(reflected.certain, axis=1) - 1.0 - ENERGY_TOLERANCE)

        excesses = excess(reflected)
        if not np.any(excesses > 0.0):
            return None
        first = int(np.argmax(excesses > 0.0))
        if first == 0 or not np.isfinite(excesses[first - 1]):
            return float(lights.theta_i_deg[first])

        def between(theta_i_deg: float) -> float:
            return float(excess(self.reflected(_Lights(np.array([theta_i_deg]), np.zeros(1))).source)[0])

        return crossing(between, *lights.theta_i_deg[first - 1 : first + 1].tolist())


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
    model = _Model.of(source, wavelength_nm, LIMITS if known is None else (*LIMITS, known.max_albedo))
    lights = model.lights()
    furnace = None
    with sharing():  # model and furnace are evaluated at the same directions
        forms = model.reflected(lights)
        if model.lossless is not None and forms.lossless is not None:
            furnace = _furnace(model.lossless, model.lossless_nm, lights, forms.lossless)
        reflected = forms.source
        for rounds in range(ROUNDS):  # peaks lie between round angles
            worst = reflected.worst.theta
            around = slice(max(worst - 1, 0), worst + 2)
            largest = reflected.largest.max(axis=1)
            if not np.ptp(largest[around]) > FLAT:  # nan is not
                break
            if rounds >= LEAST_ROUNDS and tops(lights.theta_i_deg, largest[:, np.newaxis])[0] - largest[worst] <= FLAT:
                break
            near = lights.theta_i_deg[around]
            between = np.round((near[1:] + near[:-1]) / 2.0, 4)
            more = _Lights(between, np.zeros(between.size))
            order = np.argsort(np.concatenate([lights.theta_i_deg, between]))
            added = model.reflected(more).source
            lights = _Lights(*(np.concatenate(pair)[order] for pair in zip(lights, more, strict=True)))
            reflected = _Reflected(*(np.concatenate(pair)[order] for pair in zip(reflected, added, strict=True)))
        first = model.first_above_1(lights, reflected)
        most = float(reflected.largest.max())
        if grazing is None:
            grazing = grazing_of_source(source, wavelength_nm, most)
        elif grazing.max_albedo is not None:  # more lights were looked at
            grazing = grazing.model_copy(update={"max_albedo": max(grazing.max_albedo, float(f"{most:.4g}"))})
    growth = "" if grazing is None else f"; {grazing.in_words(most)}"
    verdict, reason = _judged(lights, wavelength_nm, reflected, furnace, known, growth)
    if verdict == "violates" and first is not None:
        finite = float(np.max(np.where(np.isfinite(reflected.largest), reflected.largest, -np.inf)))
        reason += f"; this model does so by itself for such parameters: up to {finite:.4g}, from {first:.4g} degrees"
        if isinstance(source, Material) and (cause := cause_of(source, wavelength_nm)):
            reason += f" ({cause})"
        if known is not None:
            reason += f"; the paper has up to {known.max_albedo:.4g}, from {known.from_theta_i_deg:.4g} degrees"
        elif claim:
            reason += f"; its recipe excuses it, which is not accepted: {claim}"
        verdict = "accepted excess" if accept_excess and np.isfinite(reflected.largest).all() else verdict
    place_of_worst = reflected.worst
    return ModelEnergy(
        theta_i_deg=lights.theta_i_deg.tolist(),
        wavelength_nm=None if wavelength_nm is None else wavelength_nm.tolist(),
        albedo=rows(reflected.largest, DIGITS),
        specular=rows(reflected.specular, DIGITS),
        integration_error=_finite(float(f"{reflected.error.max():.2g}")),
        hemispherical=numbers(lights.weights @ reflected.mean, 4),
        max_albedo=_finite(reflected.largest[place_of_worst]),
        max_at_theta_i_deg=float(lights.theta_i_deg[place_of_worst.theta]),
        max_at_wavelength_nm=_nm(wavelength_nm, place_of_worst.wavelength),
        exceeds_1_from_theta_i_deg=first,
        judged_up_to_theta_i_deg=float(lights.theta_i_deg[-1]),
        grazing=grazing,
        furnace=furnace,
        bound_on_a=_bound(source, wavelength_nm, lights, reflected),
        verdict=verdict,
        reason=reason,
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _nm(wavelength_nm: Axis | Sequence[float] | None, index: int | np.integer[Any]) -> float | None:
    return None if wavelength_nm is None else float(wavelength_nm[int(index)])


def _judged(
    lights: _Lights,
    wavelength_nm: Axis | None,
    reflected: _Reflected,
    furnace: Furnace | None,
    known: KnownExcess | None,
    growth: str,
) -> _Judgement:
    """Return the verdict on a model, and its reason with angle and wavelength, and the growth for lights beyond.

    A model that reflects at most what arrives is judged by its lossless form, a gain before a loss.
    """
    theta_i_deg = lights.theta_i_deg
    certain = reflected.certain
    if not np.isfinite(certain).all():
        broken, wavelength = np.argwhere(~np.isfinite(certain))[0]
        at = place(theta_i_deg[broken], _nm(wavelength_nm, wavelength))
        return _Judgement("violates", f"the model reflects no finite share of the incident light at {at}")
    worst, wavelength = reflected.worst
    if np.any(certain > 1.0 + ENERGY_TOLERANCE):
        beyond = np.max(certain, axis=1) - limit_of(known, theta_i_deg) - ENERGY_TOLERANCE
        published = known is not None and bool(np.all(beyond <= 0.0))
        if known is not None and not published:
            worst = int(np.argmax(beyond))
            wavelength = int(np.argmax(reflected.largest[worst]))
        at = place(theta_i_deg[worst], _nm(wavelength_nm, wavelength))
        share = f"{reflected.largest[worst].max():.4g} of the incident light at {at}{growth}"
        if known is not None and published:
            return _Judgement("known published excess", f"reflects {share}: {known.citation}")
        return _Judgement("violates", f"the model reflects {share}")
    at = place(theta_i_deg[worst], _nm(wavelength_nm, wavelength))
    up_to = f"for lights up to {theta_i_deg[-1]:g} degrees"
    largest = f"reflects at most {np.max(reflected.largest):.4g} of the incident light, {up_to}, at {at}{growth}"
    if furnace is None:
        return _Judgement("conserves", f"{largest}; no parameters make the model lossless")
    albedo = np.array(furnace.albedo, dtype=np.float64)[np.array(furnace.theta_i_deg) <= LOSS_UP_TO_DEG]
    row, column = np.unravel_index(np.argmin(albedo), albedo.shape)
    at = place(furnace.theta_i_deg[row], _nm(furnace.wavelength_nm, column))
    least = f"{albedo[row, column]:.3g} of the incident light at {at}" if albedo[row, column] < LOSSLESS else ""
    if furnace.largest is not None and furnace.largest > 1.0 + GAIN:
        at = place(furnace.largest_at_theta_i_deg, furnace.largest_at_wavelength_nm)
        more = f"{furnace.largest:.5g} of the incident light at {at}" + (f", and {least}" if least else "")
        return _Judgement("gains", f"{largest}; lossless ({furnace.lossless}), the model would reflect {more}")
    if least:
        loss = f"lossless ({furnace.lossless}), the model reflects {least}; with the given parameters, it {largest}"
        return _Judgement("loses", loss)
    return _Judgement("conserves", largest)


def _furnace(lossless: Lossless, wavelength_nm: Axis | None, lights: _Lights, reflected: _Reflected) -> Furnace:
    """Return the white furnace of a source from the albedos of its lossless form."""
    # Albedos that differ by less than their error count as equal; the smallest of their angles is reported
    alike = np.round(reflected.largest, SURE_DECIMALS)
    low, high = (np.unravel_index(extreme(alike), alike.shape) for extreme in (np.argmin, np.argmax))
    return Furnace(
        lossless=", ".join(f"{name} = {value:.4g}" for name, value in lossless.changes.items()),
        theta_i_deg=lights.theta_i_deg.tolist(),
        wavelength_nm=None if wavelength_nm is None else wavelength_nm.tolist(),
        albedo=rows(reflected.largest, DIGITS),
        hemispherical=numbers(lights.weights @ reflected.mean, 4),
        smallest=_finite(reflected.largest[low]),
        smallest_at_theta_i_deg=float(lights.theta_i_deg[low[0]]),
        smallest_at_wavelength_nm=_nm(wavelength_nm, low[1]),
        largest=_finite(reflected.largest[high]),
        largest_at_theta_i_deg=float(lights.theta_i_deg[high[0]]),
        largest_at_wavelength_nm=_nm(wavelength_nm, high[1]),
    )


def _bound(source: Source, wavelength_nm: Axis | None, lights: _Lights, reflected: _Reflected) -> UniformBound | None:
    """Return the largest uniform part [1] that conserves energy; None unless the model leaves that part free.

    A uniform part a raises the albedo by a at every angle of the light.
    """
    if not isinstance(source, Material):
        return None
    spec = source.spec
    arguments = source.arguments(wavelength_nm)
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
