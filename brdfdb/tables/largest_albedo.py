"""The largest directional albedo that a table states, and how the albedo goes on towards grazing light."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from brdfdb.geometry import degrees, radians
from brdfdb.materials import Source
from brdfdb.measurements import MeasuredSource
from brdfdb.parameters import Floats
from brdfdb.tables.albedo import (
    LARGEST_TOLERANCE,
    THETA_I_DEG,
    azimuths_deg,
    directional_albedo,
    source_albedo,
)
from brdfdb.tables.first_numbers import Grazing, LargestAlbedo
from brdfdb.tables.grids import Axis
from brdfdb.tables.table import Table
from brdfdb.tables.table_source import TableSource

LAST_LIGHT_DEG = 89.9  # largest angle at which the albedo of a source with a pole at the horizon is judged
_MOST_PANELS = 1000  # of a light
_ROUNDS = 4  # of the search for the largest albedo of a source; each halves the steps around it
# Cosines of the lights that show the growth of an albedo towards 90 degrees; the least cosine that is tried
_NEAR, _NEARER, _NEAREST, _LEAST = 1e-4, 1e-6, 1e-8, 1e-12
_GRAZING_TOLERANCE = 1e-5  # of those albedos, relative to the albedo at the light before, or to 1
_PASSING = 1e-3  # relative tolerance of the cosine from which on an albedo exceeds 1
_FLAT = 1e-4  # rise from light to light, relative to the albedo, up to which it is bounded

AlbedoAt = Callable[[Axis, float], Floats]  # of lights [degree] and a tolerance: albedos (theta_i, wavelengths) [1]


def largest_albedo(table: Table, source: Source | None) -> LargestAlbedo:
    """Return the largest directional albedo [1] that a table states, specular part included.

    Parameters
    ----------
    table : Table
        The table.
    source : Source or None
        What was tabulated. The albedo is that of a model or a function, so that it is the same at each tolerance of a
        table. The albedo of measured data, and of a table whose source is not known, is that of the lookups.

    Returns
    -------
    LargestAlbedo
        For lights up to `last_light` of a source, or up to the last light of `directional_albedo` of a table.
    """
    nm, albedo_at = table.wavelength_nm, albedo_of(table, source)
    if _looked_up(source):
        of_source, power = False, None
        integrated = directional_albedo(table, tolerance=LARGEST_TOLERANCE)
        lights, whole = integrated.theta_i_deg, _whole(table, integrated.theta_i_deg, nm, integrated.albedo)
    else:
        assert source is not None
        of_source, power = True, source.grazing_power(nm)
        lights = np.append(THETA_I_DEG, np.unique([LAST_LIGHT_DEG, last_light(source)]))
        lights, whole = _searched(albedo_at, lights)
    row, column = np.unravel_index(int(np.argmax(np.where(np.isfinite(whole), whole, np.inf))), whole.shape)
    largest = float(whole[row, column])
    return LargestAlbedo(
        albedo=float(f"{largest:.4g}") if np.isfinite(largest) else None,
        theta_i_deg=float(f"{lights[row]:.6g}"),
        wavelength_nm=None if nm is None else float(nm[column]),
        tolerance=LARGEST_TOLERANCE,
        of="source" if of_source else "table",
        up_to_theta_i_deg=float(lights[-1]),
        grazing=_grazing(albedo_at, power, largest, float(lights[-1])),
    )


def albedo_of(table: Table, source: Source | None) -> AlbedoAt:
    """Return the albedo of which `largest_albedo` finds the largest: that of the source, or of the lookups."""
    if source is None or _looked_up(source):
        return _of_table(table)
    return _of_source(source, table.wavelength_nm)


def _looked_up(source: Source | None) -> bool:
    return source is None or isinstance(source, MeasuredSource | TableSource)


def last_light(source: Source) -> float:
    """Return the largest angle of incidence [degree] up to which the albedo of a source is judged."""
    return LAST_LIGHT_DEG if source.grazing_pole else 90.0


def grazing_of_source(source: Source, wavelength_nm: Axis | None, largest: float) -> Grazing | None:
    """Return the albedo of a source for lights between `last_light` and 90 degrees; None if it is not finite.

    `largest` is the largest albedo [1] for lights up to there.
    """
    power = source.grazing_power(wavelength_nm)
    return _grazing(_of_source(source, wavelength_nm), power, largest, last_light(source))


def grazing_of_table(table: Table, largest: float, up_to_theta_i_deg: float) -> Grazing | None:
    """Return the albedo of the lookups of a table for lights beyond an angle [degree], whose growth is measured."""
    return _grazing(_of_table(table), None, largest, up_to_theta_i_deg)


def _of_source(source: Source, wavelength_nm: Axis | None) -> AlbedoAt:
    """Return the albedo of a source with its specular part, largest over the azimuths of the light."""
    phi_i = radians(azimuths_deg(source))

    def albedo_at(theta_i_deg: Axis, tolerance: float) -> Floats:
        theta_i = radians(theta_i_deg)[:, np.newaxis]
        albedo, _ = source_albedo(source, theta_i, phi_i, wavelength_nm, tolerance=tolerance, most_panels=_MOST_PANELS)
        return _whole(source, theta_i_deg, wavelength_nm, albedo)

    return albedo_at


def _of_table(table: Table) -> AlbedoAt:
    """Return the albedo of the lookups of a table with its specular part, largest over the azimuths of the light."""
    return lambda theta_i_deg, tolerance: _whole(
        table, theta_i_deg, table.wavelength_nm, directional_albedo(table, theta_i_deg, tolerance).albedo
    )


def _whole(surface: Table | Source, theta_i_deg: Axis, wavelength_nm: Axis | None, albedo: Floats) -> Floats:
    """Return albedos (theta_i, wavelengths) [1] with the specular part, from those (theta_i, phi_i, wavelengths)."""
    specular = np.asarray(surface.specular_reflectance(radians(theta_i_deg), wavelength_nm))
    return np.asarray(albedo.max(axis=1) + specular.reshape(theta_i_deg.size, -1))


def _searched(albedo_at: AlbedoAt, lights: Axis) -> tuple[Axis, Floats]:
    """Return lights [degree] with more of them around each maximum that may be the largest albedo, and the albedos."""
    whole = albedo_at(lights, LARGEST_TOLERANCE)
    for _ in range(_ROUNDS):
        of_lights = whole.max(axis=1)
        between: set[float] = set()
        for at, albedo in enumerate(of_lights):
            around = slice(max(at - 1, 0), at + 2)
            drop = np.ptp(of_lights[around])
            # between lights the albedo rises by no more than it drops to the next, or the lights are too far apart
            if albedo == of_lights[around].max() and drop > LARGEST_TOLERANCE / 2.0 and albedo + drop > of_lights.max():
                between.update((lights[around][1:] + lights[around][:-1]) / 2.0)
        if not between:
            break
        added = np.array(sorted(between))
        order = np.argsort(np.append(lights, added))
        whole = np.concatenate([whole, albedo_at(added, LARGEST_TOLERANCE)])[order]
        lights = np.append(lights, added)[order]
    return lights, whole


def _grazing(albedo_at: AlbedoAt, declared: float | None, largest: float, up_to_theta_i_deg: float) -> Grazing | None:
    """Return the growth of an albedo beyond an angle, by quadrature next to 90 degrees; None if it is not finite."""

    def at(cos_i: float, before: float) -> float:
        theta_i_deg = np.array([90.0 - float(degrees(np.arcsin(cos_i)))])
        return float(np.max(albedo_at(theta_i_deg, min(_GRAZING_TOLERANCE * max(before, 1.0), 1.0))))

    if not np.isfinite(largest):
        return None
    near = at(_NEAR, largest)
    nearer = at(_NEARER, near)
    nearest = at(_NEAREST, nearer)
    if not np.isfinite([near, nearer, nearest]).all():
        return None
    power = declared
    if power is None:  # from differences, of which a constant part drops out
        rises = nearer - near, nearest - nearer
        grows = rises[1] > rises[0] > _FLAT * nearest
        power = round(float(np.log(rises[1] / rises[0]) / np.log(_NEARER / _NEAREST)), 2) if grows else 0.0
    factor, rest = nearest, 0.0
    if power > 0.0:  # of an albedo of rest + factor cos^-power
        factor = max((nearest - nearer) / (_NEAREST**-power - _NEARER**-power), 0.0)
        rest = nearest - factor * _NEAREST**-power
    most, passes = max(largest, near, nearer, nearest), None
    if largest <= 1.0 and (power > 0.0 or most > 1.0 + LARGEST_TOLERANCE):
        tried = {_NEAR: near, _NEARER: nearer, _NEAREST: nearest, _LEAST: at(_LEAST, nearest)}
        above = next((cos_i for cos_i, albedo in tried.items() if albedo > 1.0), None)
        if above is not None:
            below = float(np.cos(radians(min(up_to_theta_i_deg, LAST_LIGHT_DEG))))
            if power > 0.0 and factor > 0.0 and rest < 1.0:  # the law of growth is close
                guess = (factor / (1.0 - rest)) ** (1.0 / power)
                for tried_cos in (guess * (1.0 + _PASSING), guess * (1.0 - _PASSING)):
                    if above < tried_cos < below:
                        below, above = (below, tried_cos) if at(tried_cos, 1.0) > 1.0 else (tried_cos, above)
            while below > above * (1.0 + _PASSING):
                between = float(np.sqrt(below * above))
                below, above = (below, between) if at(between, 1.0) > 1.0 else (between, above)
        elif factor > 0.0 and rest < 1.0:  # closer than quadrature reaches, by the formula
            above = (factor / (1.0 - rest)) ** (1.0 / power)
        if above is not None:
            passes = 90.0 - float(f"{degrees(np.arcsin(above)):.3g}")
    return Grazing(
        power=float(f"{power:.6g}"),
        origin="measured" if declared is None else "declared",
        factor=float(f"{factor:.4g}"),
        max_albedo=float(f"{most:.4g}") if power == 0.0 else None,
        passes_1_at_theta_i_deg=passes,
    )
