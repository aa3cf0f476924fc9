"""The directional albedo of a table: an exact integral if f_r is linear between nodes, else a quadrature."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from typing import Any, Literal, NamedTuple, TypeVar, cast
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, Field

from brdfdb.geometry import degrees, radians, unit_vector
from brdfdb.integrals.panels import Indices
from brdfdb.integrals.quadrature import MOST_PANELS, Albedo, reflected_share, reflected_shares
from brdfdb.lobes import narrowest
from brdfdb.materials import FunctionRecord, Material, Source
from brdfdb.measurements import MeasuredSource
from brdfdb.parameters import Floats
from brdfdb.tables.grids import Axis
from brdfdb.tables.stated_error import Grazing, LargestAlbedo
from brdfdb.tables.table import Table, TableSource

# Absolute tolerance of the albedo of a table without an exact integral; the kinks of its interpolant limit it
QUADRATURE_TOLERANCE = 2e-5
MEASURED_TOLERANCE = 2e-4  # the same of measured tables: data are less exact, and it takes a quarter of the time
# Absolute tolerance of the largest albedo that a table states: it has three digits, and takes a third of the time
LARGEST_TOLERANCE = 1e-3
_MOST_PANELS = 1000  # largest number of panels for a light
# Lights for which such a table is integrated [degree]; phi_i covers one period of the symmetry of the grid
THETA_I_DEG = np.array([*range(0, 85, 5), 82.5, 85.0, 87.5, 89.0, 89.5], dtype=np.float64)
_PHI_I_STEP_DEG = 30.0
LAST_LIGHT_DEG = 89.9  # largest angle at which the albedo of a source with a pole at the horizon is judged
_ROUNDS = 4  # rounds of the search for the largest albedo of a source; each halves the steps around it
# Cosines of the lights that show the growth of an albedo towards 90 degrees
_NEAR = 1e-4
_NEARER = 1e-6
_NEAREST = 1e-8
_LEAST = 1e-12  # smallest cosine that is tried
_GRAZING_TOLERANCE = 1e-5  # tolerance of those albedos, relative to the albedo of the light before, or to 1
_PASSING = 1e-3  # relative tolerance of the cosine below which an albedo exceeds 1
_FLAT = 1e-4  # largest rise from light to light, relative to the albedo, of a bounded albedo

# From lights [degree] and a tolerance to albedos (theta_i, wavelengths) [1]
AlbedoAt = Callable[[Axis, float], Floats]


class _AlbedoRequest(NamedTuple):
    """Lights [degree] at which a search needs albedos (theta_i, wavelengths), and their absolute tolerance [1]."""

    theta_i_deg: Axis
    tolerance: float


_Result = TypeVar("_Result")
_Search = Generator[_AlbedoRequest, Floats, _Result]  # those of many materials go on together, each with its answers


class TableAlbedo(NamedTuple):
    """The directional albedo [1] of a table, (theta_i, phi_i, wavelengths), without the specular part, and its lights.

    `error` (theta_i,) estimates the largest absolute error over phi_i and wavelengths; 0 where the integral is exact.
    `glints`, shaped as `albedo`, is the part of it that glints reflect, and `guessed` what may be missing of this part:
    the power of a glint that is not resolved is an upper bound, and one between measured lights is a guess. Such power
    counts up to an albedo of 1. Isotropic tables have one phi_i, 0, and grey ones one wavelength.
    """

    theta_i_deg: Axis
    phi_i_deg: Axis
    albedo: Floats
    error: Floats
    glints: Floats | None = None
    guessed: Floats | None = None

    @property
    def mean(self) -> Floats:
        """The mean over phi_i, of shape (theta_i, wavelengths)."""
        return self.mean_of(self.albedo)

    def mean_of(self, shares: Floats) -> Floats:
        """Return the mean over phi_i of numbers shaped as `albedo`, (theta_i, wavelengths)."""
        if self.phi_i_deg.size == 1:
            return shares[:, 0]
        weights = _trapezoid_weights(self.phi_i_deg) / self.phi_i_deg[-1]
        return np.asarray(np.einsum("tpw,p->tw", shares, weights))


def directional_albedo(
    table: Table, theta_i_deg: Axis | None = None, tolerance: float | None = None, source: Source | None = None
) -> TableAlbedo:
    """Integrate f_r cos theta_r over the hemisphere [1], as the table gives f_r between its nodes.

    Parameters
    ----------
    table : Table
        Any decoded table. Of those that are not f_r, linear over light and viewer, the attributes name the source.
    theta_i_deg : array (theta_i,) [degree], optional
        The lights, in [0, 90]. By default the nodes of theta_i and phi_i where the integral is exact, else
        `THETA_I_DEG` and every 30 degrees of phi_i; nodes and `THETA_I_DEG` if a planner chose the nodes: the attribute
        ``reason`` says so. Such nodes are at 90 degrees only if f_r has no pole there.
    tolerance : float [1], optional
        Absolute tolerance of the quadrature, where the integral is not exact; by default `tolerance_of`.
    source : Source, optional
        Source whose lobe the quadrature follows; by default that of the table.

    Notes
    -----
    Exact for what `Table.lookup` returns where that is linear in each angle, so that the integral is a sum of the
    stored values with the integrals of the hat functions of their axes as weights. Other tables are looked up, by the
    quadrature of `brdfdb.integrals.quadrature`, to the tolerance. The power of glints is added, as
    `TableAlbedo` says.
    """
    if table.glints is not None:
        lights = theta_i_deg
        if lights is None:
            lights = np.union1d(THETA_I_DEG, np.array([glint.theta_i_deg for glint in table.glints.glints]))
        smooth = directional_albedo(table.without_glints(), lights, tolerance, source)
        wi = unit_vector(radians(smooth.theta_i_deg)[:, np.newaxis], radians(smooth.phi_i_deg)).reshape(-1, 3)
        power, guessed = (table.glints.power(wi, guessed=part).reshape(smooth.albedo.shape) for part in (False, True))
        least = smooth.albedo + power - guessed
        counted = np.clip(1.0 - least, 0.0, guessed)
        return smooth._replace(albedo=least + counted, glints=power - guessed + counted, guessed=counted)
    if not linear_in_angles(table):
        within = tolerance_of(table) if tolerance is None else tolerance
        of_lobe = table.source if source is None else source
        return _integrated(table, of_lobe, THETA_I_DEG if theta_i_deg is None else theta_i_deg, within)
    nodes = table.axes_deg["theta_i"]
    theta_weights = _theta_weights(radians(table.axes_deg["theta_r"]))
    if table.anisotropic:
        phi_i = table.axes_deg["phi_i"]
        phi_weights = _trapezoid_weights(radians(table.axes_deg["phi_r"]))
        albedo = _sums(table.brdf, phi_i.size, np.outer(theta_weights, phi_weights))
    else:
        phi_i = np.zeros(1)
        phi_weights = 2.0 * _trapezoid_weights(radians(table.axes_deg["delta_phi"]))  # the other half by symmetry
        albedo = _sums(table.brdf, 1, np.outer(theta_weights, phi_weights))
    lights = theta_i_deg
    if lights is None and table.metadata.reason:  # a planner's nodes are few
        lights = np.union1d(THETA_I_DEG, nodes)
    if lights is not None:
        matrix = np.stack([np.interp(lights, nodes, one) for one in np.eye(nodes.size)], axis=1)
        nodes = lights
        albedo = np.tensordot(matrix, albedo, axes=1)
    return TableAlbedo(nodes, phi_i, np.asarray(albedo), np.zeros(nodes.size))


def _sums(brdf: NDArray[np.float32], phi_i: int, weights: Floats) -> Floats:
    """Return the weighted sums of f_r over viewers, shape (theta_i, phi_i, L), a row in float64 at a time."""
    rows = brdf.reshape(len(brdf), phi_i, weights.size, -1)
    return np.stack([np.einsum("pkl,k->pl", row.astype(np.float64), weights.ravel()) for row in rows])


def tolerance_of(table: Table) -> float:
    """Return the absolute tolerance [1] of the albedo of a table, where its integral is not exact."""
    return QUADRATURE_TOLERANCE if table.metadata.measured is None else MEASURED_TOLERANCE


def hemispherical_albedo(theta_i_deg: Axis, albedo: Floats) -> Floats:
    """Return the share [1] of uniform light that is reflected, twice the integral of albedo cos(theta_i) sin(theta_i).

    `albedo` (theta_i, wavelengths) is linear between the angles, which begin at 0, and the same beyond the last.
    """
    return np.asarray(2.0 * _theta_weights(radians(theta_i_deg)) @ albedo)


class Reflected(NamedTuple):
    """Share of light reflected, averaged over phi_i: arrays (theta_i, wavelengths) [1], one wavelength if grey.

    `albedo` is without the `specular` part, `hemispherical` (wavelengths,) of light from everywhere with it. `glints`
    is the part of `albedo` that glints reflect, None without any. `error` is the largest estimate of the error of the
    integration, and of what glints may lack.
    """

    theta_i_deg: Axis
    albedo: Floats
    specular: Floats
    glints: Floats | None
    hemispherical: Floats
    error: float

    def document(self, wavelength_nm: Axis | None) -> dict[str, Any]:
        """Return the fields of `AlbedoDocument`, with numpy arrays."""
        return {
            "wavelength_nm": wavelength_nm,
            "theta_i": np.ascontiguousarray(self.theta_i_deg),
            "albedo": np.ascontiguousarray(self.albedo),
            "specular_reflectance": np.ascontiguousarray(self.specular),
            "glints": None if self.glints is None else np.ascontiguousarray(self.glints),
            "hemispherical": self.hemispherical,
            "error": self.error,
        }


class AlbedoDocument(BaseModel):
    """Directional albedo: the share of light from theta_i that is reflected, averaged over phi_i."""

    wavelength_nm: list[float] | None = Field(description="null: grey")
    theta_i: list[float] = Field(description="degrees")
    albedo: list[list[float]] = Field(description="[theta_i][wavelength], without the specular part")
    specular_reflectance: list[list[float]] = Field(description="[theta_i][wavelength], the specular part")
    glints: list[list[float]] | None = Field(
        description="[theta_i][wavelength], the part of albedo that glints reflect at most; null: there are none"
    )
    hemispherical: list[float] = Field(description="[wavelength], of light that is the same from everywhere, both")
    error: float = Field(
        description="of albedo, the largest estimate: of the integration, and of glints whose power is an upper bound"
    )


def reflected(table: Table) -> Reflected:
    """Return the share of light that a table reflects, cached: a quadrature takes a third of a second."""
    if table not in _REFLECTED:
        _REFLECTED[table] = _reflected(directional_albedo(table), table, table.wavelength_nm)
    return _REFLECTED[table]


_REFLECTED: WeakKeyDictionary[Table, Reflected] = WeakKeyDictionary()


def reflected_by(source: Source, wavelength_nm: Axis | None) -> Reflected:
    """Return the share of light that a source reflects at wavelengths (L,) [nm]; ParameterError outside its range."""
    phi_i_deg = azimuths_deg(source)
    angles = radians(THETA_I_DEG)[:, np.newaxis], radians(phi_i_deg)
    albedo, error = source_albedo(source, *angles, wavelength_nm, tolerance=LARGEST_TOLERANCE)
    return _reflected(TableAlbedo(THETA_I_DEG, phi_i_deg, albedo, error.max(axis=1)), source, wavelength_nm)


def azimuths_deg(source: Source) -> Axis:
    """Return the azimuths of lights [degree] up to where the symmetry of a source begins anew."""
    phi_i_deg = np.arange(0.0, 91.0 if source.elliptical else 361.0, _PHI_I_STEP_DEG)
    return phi_i_deg if source.anisotropic else phi_i_deg[:1]


def _reflected(albedo: TableAlbedo, surface: Table | Source, wavelength_nm: Axis | None) -> Reflected:
    diffuse = albedo.mean
    theta_i_deg = albedo.theta_i_deg
    specular = np.asarray(surface.specular_reflectance(radians(theta_i_deg), wavelength_nm))
    specular = np.broadcast_to(specular.reshape(diffuse.shape[0], -1), diffuse.shape)
    hemispherical = hemispherical_albedo(theta_i_deg, diffuse + specular)
    of_glints, guessed = (None if part is None else albedo.mean_of(part) for part in (albedo.glints, albedo.guessed))
    error = albedo.error if guessed is None else albedo.error + guessed.max(axis=1)
    return Reflected(theta_i_deg, diffuse, specular, of_glints, hemispherical, float(error.max()))


def source_albedo(
    source: Source,
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    wavelength_nm: Axis | None,
    *,
    tolerance: float,
    most_panels: int = MOST_PANELS,
) -> Albedo:
    """Integrate f_r cos theta_r of a source over the hemisphere [1], at all its wavelengths (L,) [nm] at once.

    The lights at `theta_i`, `phi_i` [rad], theta up to pi/2, broadcast. All else is as in
    `brdfdb.integrals.quadrature.reflected_share`. The specular part is left out.
    """
    f_r = source.brdf_at(wavelength_nm)

    def brdf(wi: Floats, wr: Floats) -> Floats:
        with np.errstate(
            all="ignore"
        ):  # nodes lie at grazing angles, too; callers check for values that are not finite
            return f_r(wi, wr)

    cos_i = np.cos(np.asarray(theta_i, dtype=np.float64))[..., np.newaxis]
    return reflected_share(
        brdf,
        theta_i,
        phi_i,
        narrowest(source.lobe(cos_i, wavelength_nm)),
        tolerance=tolerance,
        most_panels=most_panels,
        width=1 if wavelength_nm is None else wavelength_nm.size,
        mirrored=not source.anisotropic,
    )


def linear_in_angles(table: Table) -> bool:
    """Return True if the table is f_r over light and viewer, linear in each angle between its nodes."""
    return table.values_are_brdf and not table.grid.half_difference and not table.interpolation.cubic


def wavelengths_of(table: Table) -> int:
    """Return the number of wavelengths of a table; 1 if it is grey."""
    return 1 if table.wavelength_nm is None else table.wavelength_nm.size


def _integrated(
    table: Table, source: Source | FunctionRecord | None, theta_i_deg: Axis, tolerance: float
) -> TableAlbedo:
    """Return the albedo by quadrature of lookups, at all wavelengths at once."""
    width = wavelengths_of(table)
    phi_i_deg = np.zeros(1)
    if table.grid.turned:
        phi_i_deg = np.arange(0.0, 360.0 / table.grid.copies + 1.0, _PHI_I_STEP_DEG)
    theta_i = radians(theta_i_deg)[:, np.newaxis]

    def brdf(wi: Floats, wr: Floats) -> Floats:
        return table.lookup_vectors(wi, wr).reshape(len(wr), width)

    albedo, error = reflected_share(
        brdf,
        theta_i,
        radians(phi_i_deg),
        narrowest(None if source is None else source.lobe(np.cos(theta_i)[..., np.newaxis], table.wavelength_nm)),
        tolerance=tolerance,
        most_panels=_MOST_PANELS,
        width=width,
        mirrored=not table.anisotropic,
    )
    return TableAlbedo(theta_i_deg, phi_i_deg, albedo, error.max(axis=1))


def _trapezoid_weights(nodes: Axis) -> Axis:
    steps = np.diff(nodes)
    weights = np.zeros(nodes.size)
    weights[:-1] += steps / 2.0
    weights[1:] += steps / 2.0
    return weights


def _theta_weights(nodes: Axis) -> Axis:
    """Return the integrals of hat_j(theta) cos(theta) sin(theta) over [0, pi/2], the last hat constant up to pi/2.

    With F = sin^2 / 2 and its integral G = theta / 4 - sin(2 theta) / 8, the rising half over [a, b] gives
    F(b) - (G(b) - G(a)) / (b - a).
    """
    F = np.sin(nodes) ** 2 / 2.0
    slope = np.diff(nodes / 4.0 - np.sin(2.0 * nodes) / 8.0) / np.diff(nodes)
    weights = np.zeros(nodes.size)
    weights[1:] += F[1:] - slope
    weights[:-1] += slope - F[:-1]
    weights[-1] += 0.5 - F[-1]
    return weights


def largest_albedo(table: Table, source: Source | None) -> LargestAlbedo:
    """Return the largest directional albedo [1] that a table states, specular part included.

    It is that of the model or function that was tabulated, so that it is the same at each tolerance of a table, for
    lights up to `last_light`. The albedo of measured data, and of a table whose source is not known, is that of the
    lookups, for the lights of `directional_albedo`.
    """
    wavelength_nm = table.wavelength_nm
    if source is not None and not _looked_up(source):
        return _answered(_largest_of_source(source, wavelength_nm), _of_source(source, wavelength_nm))
    integrated = directional_albedo(table, tolerance=LARGEST_TOLERANCE)
    lights = integrated.theta_i_deg
    results = _Albedos(lights, _with_specular(table, lights, wavelength_nm, integrated.albedo))
    return _answered(_stated(results, None, "table", wavelength_nm), _of_table(table))


def largest_albedos(materials: Sequence[Material]) -> list[LargestAlbedo]:
    """Return `largest_albedo` of grey materials of one model, whose integrals are computed together."""
    searches = [_largest_of_source(material, None) for material in materials]
    requests = {number: next(search) for number, search in enumerate(searches)}
    results: dict[int, LargestAlbedo] = {}
    while requests:
        answers = _albedos_of([materials[number] for number in requests], [*requests.values()])
        before, requests = requests, {}
        for number, answer in zip(before, answers, strict=True):
            try:
                requests[number] = searches[number].send(answer)
            except StopIteration as finished:
                results[number] = finished.value
    return [results[number] for number in range(len(materials))]


def _largest_of_source(source: Source, wavelength_nm: Axis | None) -> _Search[LargestAlbedo]:
    lights = np.append(THETA_I_DEG, np.unique([LAST_LIGHT_DEG, last_light(source)]))
    results = yield from _searched(lights)
    return (yield from _stated(results, source.grazing_power(wavelength_nm), "source", wavelength_nm))


def _stated(
    results: _Albedos, power: float | None, of: Literal["source", "table"], wavelength_nm: Axis | None
) -> _Search[LargestAlbedo]:
    """Return the largest of the albedos that were found, and the growth beyond the last light."""
    lights, albedos = results
    row, column = np.unravel_index(int(np.argmax(np.where(np.isfinite(albedos), albedos, np.inf))), albedos.shape)
    largest = float(albedos[row, column])
    return LargestAlbedo(
        albedo=float(f"{largest:.4g}") if np.isfinite(largest) else None,
        theta_i_deg=float(f"{lights[row]:.6g}"),
        wavelength_nm=None if wavelength_nm is None else float(wavelength_nm[column]),
        tolerance=LARGEST_TOLERANCE,
        of=of,
        up_to_theta_i_deg=float(lights[-1]),
        grazing=(yield from _grazing(power, largest, float(lights[-1]))),
    )


def _answered(search: _Search[_Result], albedo_at: AlbedoAt) -> _Result:
    """Return what a search finds, with the albedos of one surface."""
    try:
        request = next(search)
        while True:
            request = search.send(albedo_at(*request))
    except StopIteration as finished:
        return cast(_Result, finished.value)


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
    return _answered(_grazing(power, largest, last_light(source)), _of_source(source, wavelength_nm))


def grazing_of_table(table: Table, largest: float, up_to_theta_i_deg: float) -> Grazing | None:
    """Return the albedo of the lookups of a table for lights beyond an angle [degree], whose growth is measured."""
    return _answered(_grazing(None, largest, up_to_theta_i_deg), _of_table(table))


def _of_source(source: Source, wavelength_nm: Axis | None) -> AlbedoAt:
    """Return the albedo of a source with its specular part, largest over the azimuths of the light."""
    phi_i = radians(azimuths_deg(source))

    def albedo_at(theta_i_deg: Axis, tolerance: float) -> Floats:
        theta_i = radians(theta_i_deg)[:, np.newaxis]
        albedo, _ = source_albedo(source, theta_i, phi_i, wavelength_nm, tolerance=tolerance, most_panels=_MOST_PANELS)
        return _with_specular(source, theta_i_deg, wavelength_nm, albedo)

    return albedo_at


def _albedos_of(materials: Sequence[Material], requests: Sequence[_AlbedoRequest]) -> list[Floats]:
    """Return the albedos of grey materials of one model, each at lights and to a tolerance of its own."""
    grids = [
        np.broadcast_arrays(radians(lights)[:, np.newaxis], radians(azimuths_deg(m)))
        for m, (lights, _) in zip(materials, requests, strict=True)
    ]
    of_light = np.repeat(np.arange(len(materials)), [theta.size for theta, _ in grids])
    theta_i, phi_i = (np.concatenate([angles[axis].ravel() for angles in grids]) for axis in (0, 1))
    spec = materials[0].spec
    given = [material.arguments() for material in materials]
    parameters = {name: np.array([one[name] for one in given])[:, np.newaxis] for name in given[0]}

    def brdf(of: Indices, wi: Floats, wr: Floats) -> Floats:
        with np.errstate(all="ignore"):  # as in `source_albedo`
            return spec.vectors(wi, wr, **{name: values[of_light[of]] for name, values in parameters.items()})

    cos_i = np.cos(theta_i)[:, np.newaxis]
    lobe = None if spec.lobe is None else spec.lobe(cos_i, **{name: v[of_light] for name, v in parameters.items()})
    integrals = reflected_shares(
        brdf,
        theta_i,
        phi_i,
        narrowest(lobe),
        tolerance=np.array([tolerance for _, tolerance in requests])[of_light],
        most_panels=_MOST_PANELS,
        mirrored=np.array([not material.anisotropic for material in materials])[of_light],
    )
    ends = np.cumsum([theta.size for theta, _ in grids])[:-1]
    return [
        _with_specular(material, lights, None, albedo.reshape(*theta.shape, 1))
        for material, (lights, _), (theta, _), albedo in zip(
            materials, requests, grids, np.split(integrals.albedo, ends), strict=True
        )
    ]


def _of_table(table: Table) -> AlbedoAt:
    """Return the albedo of the lookups of a table with its specular part, largest over the azimuths of the light."""
    return lambda theta_i_deg, tolerance: _with_specular(
        table, theta_i_deg, table.wavelength_nm, directional_albedo(table, theta_i_deg, tolerance).albedo
    )


def _with_specular(surface: Table | Source, theta_i_deg: Axis, wavelength_nm: Axis | None, albedo: Floats) -> Floats:
    """Return albedos (theta_i, wavelengths) [1] with the specular part, from those (theta_i, phi_i, wavelengths)."""
    specular = np.asarray(surface.specular_reflectance(radians(theta_i_deg), wavelength_nm))
    return np.asarray(albedo.max(axis=1) + specular.reshape(theta_i_deg.size, -1))


class _Albedos(NamedTuple):
    """Lights [degree], and albedos (lights, wavelengths) [1] with the specular part."""

    theta_i_deg: Axis
    albedo: Floats


def _searched(lights: Axis) -> _Search[_Albedos]:
    """Return the albedos of lights, and of more lights around each maximum that may be the largest albedo."""
    albedos = yield _AlbedoRequest(lights, LARGEST_TOLERANCE)
    for _ in range(_ROUNDS):
        of_lights = albedos.max(axis=1)
        between: set[float] = set()
        for at, albedo in enumerate(of_lights):
            around = slice(max(at - 1, 0), at + 2)
            drop = np.ptp(of_lights[around])
            # The maximum between two lights is assumed to rise by at most the drop to the next light
            if albedo == of_lights[around].max() and drop > LARGEST_TOLERANCE / 2.0 and albedo + drop > of_lights.max():
                between.update((lights[around][1:] + lights[around][:-1]) / 2.0)
        if not between:
            break
        added = np.array(sorted(between))
        order = np.argsort(np.append(lights, added))
        albedos = np.concatenate([albedos, (yield _AlbedoRequest(added, LARGEST_TOLERANCE))])[order]
        lights = np.append(lights, added)[order]
    return _Albedos(lights, albedos)


def _grazing(declared: float | None, largest: float, up_to_theta_i_deg: float) -> _Search[Grazing | None]:
    """Return the growth of an albedo beyond an angle, by quadrature next to 90 degrees; None if it is not finite."""

    def at(cos_i: float, before: float) -> _Search[float]:
        theta_i_deg = np.array([90.0 - float(degrees(np.arcsin(cos_i)))])
        return float(np.max((yield _AlbedoRequest(theta_i_deg, min(_GRAZING_TOLERANCE * max(before, 1.0), 1.0)))))

    if not np.isfinite(largest):
        return None
    near = yield from at(_NEAR, largest)
    nearer = yield from at(_NEARER, near)
    nearest = yield from at(_NEAREST, nearer)
    if not np.isfinite([near, nearer, nearest]).all():
        return None
    power = declared
    if power is None:  # from differences, of which a constant part drops out
        rises = nearer - near, nearest - nearer
        grows = rises[1] > rises[0] > _FLAT * nearest
        power = round(float(np.log(rises[1] / rises[0]) / np.log(_NEARER / _NEAREST)), 2) if grows else 0.0
    factor = nearest
    rest = 0.0
    if power > 0.0:  # of an albedo of rest + factor cos^-power
        factor = max((nearest - nearer) / (_NEAREST**-power - _NEARER**-power), 0.0)
        rest = nearest - factor * _NEAREST**-power
    most = max(largest, near, nearer, nearest)
    passes = None
    if largest <= 1.0 and (power > 0.0 or most > 1.0 + LARGEST_TOLERANCE):
        tried = {_NEAR: near, _NEARER: nearer, _NEAREST: nearest, _LEAST: (yield from at(_LEAST, nearest))}
        above = next((cos_i for cos_i, albedo in tried.items() if albedo > 1.0), None)
        if above is not None:
            below = float(np.cos(radians(min(up_to_theta_i_deg, LAST_LIGHT_DEG))))
            if power > 0.0 and factor > 0.0 and rest < 1.0:  # the law of growth is close
                guess = (factor / (1.0 - rest)) ** (1.0 / power)
                for tried_cos in (guess * (1.0 + _PASSING), guess * (1.0 - _PASSING)):
                    if above < tried_cos < below:
                        below, above = (
                            (below, tried_cos) if (yield from at(tried_cos, 1.0)) > 1.0 else (tried_cos, above)
                        )
            while below > above * (1.0 + _PASSING):
                between = float(np.sqrt(below * above))
                below, above = (below, between) if (yield from at(between, 1.0)) > 1.0 else (between, above)
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
