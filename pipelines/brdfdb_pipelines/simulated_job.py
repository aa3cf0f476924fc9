"""The job that builds one table of a simulated surface: estimates in rounds, and the table of their mean."""

from __future__ import annotations

import functools
import math
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.errors import FileFormatError, ParameterError, counted, import_extra
from brdfdb.geometry import spherical_angles
from brdfdb.measurements import MeasuredSource, Samples
from brdfdb.measurements.instrument import Instrument
from brdfdb.measurements.lobe_base import Base
from brdfdb.measurements.record import SimulationRecord
from brdfdb.microgeometry.directions import goniometer_directions
from brdfdb.microgeometry.facets import Bounces
from brdfdb.microgeometry.height_map import HeightMap
from brdfdb.microgeometry.isotropy import SlopeHarmonics, slope_harmonics
from brdfdb.microgeometry.levelling import Levelled
from brdfdb.microgeometry.mirrors import one_bounce_is_smoothed
from brdfdb.microgeometry.simulation import SimulatedBrdf, Simulation
from brdfdb.microgeometry.surfaces import MadeSurface
from brdfdb.models import MODELS
from brdfdb.parameters import Floats, ModelSpec, SurfaceRelation
from brdfdb.place import path_of
from brdfdb.store.estimates import read_estimate, write_estimate
from brdfdb.store.lock import Lock
from brdfdb.tables.albedo import largest_albedo
from brdfdb.tables.layout import TABLE_VERSION
from brdfdb.tables.measured_layout import MeasuredLayout
from brdfdb.tables.table import Table
from brdfdb_pipelines.measured_job import MeasuredResult, build_of_data, sha256_of, tabulated_lawfully
from brdfdb_pipelines.recipe_grids import RecipeError
from brdfdb_pipelines.simulated_table import (
    SINGLE_DIRECTIONS,
    SimulatedTable,
    SpectralFacets,
    simulated_table,
    spectral_facets,
)

SIMULATED_VERSION = 2  # of the way from a surface to the values of its table
# Keys that decide the table, and not the estimates
_OF_TABLE = ("standard_error", "realisations", "conserving", "noise_um", "title", "source")
# Memory of a task [byte]: rays that are traced at once, and the facets of a map; 2048 x 2048 nodes take 2 GB
_RAYS_BYTES = 200_000_000
_NODE_BYTES = 500
# Parameters of surfaces and simulations, and their keys in a recipe
_KEYS = {"slope": "slope_deg", "slope_y": "slope_y_deg", "most": "realisations", "heights_um": "height_map"}
_KEYS |= {"wavelength_nm": "wavelengths_nm"}
_DRAWN = 8  # made maps whose slopes are recorded


@dataclass(frozen=True, eq=False)
class SimulatedJob:
    """One table of a simulated surface to build, to a tolerance."""

    name: str
    table: SimulatedTable
    tolerance: float
    reflecting: SpectralFacets
    path: Path | None = None  # of the height map
    sha256: str = ""

    model = "simulated"

    @property
    def task_bytes(self) -> int:
        """Memory that an estimate needs [byte]."""
        nodes = self.table.nodes**2 if self.levelled is None else self.levelled.surface.heights_um.size
        return _RAYS_BYTES + _NODE_BYTES * nodes

    @property
    def estimates_request(self) -> dict[str, Any]:
        """Everything that decides the estimates, ready for JSON."""
        table = self.table.model_dump(mode="json", exclude={*_OF_TABLE, "rho", "n", "k", "mirror", "refractive_index"})
        facets = self.reflecting.facets
        at = self.reflecting.wavelength_nm
        return {
            **{key: value for key, value in table.items() if value is not None and key != "wavelengths_nm"},
            "simulated_version": SIMULATED_VERSION,
            "height_map": "" if self.path is None else self.path.name,
            "file_sha256": self.sha256,
            "rho": np.asarray(facets.rho).tolist(),
            "mirror": facets.mirror,
            "n": None if facets.n is None else np.asarray(facets.n).tolist(),
            "k": np.asarray(facets.k).tolist(),
            "wavelengths_nm": None if at is None else at.tolist(),
        }

    @property
    def request(self) -> dict[str, Any]:
        """Everything that decides the table, ready for JSON: the same request makes the same table."""
        of_table = self.table.model_dump(mode="json", include=set(_OF_TABLE))
        return {
            "table_version": TABLE_VERSION,
            "simulated_name": self.name,
            "tolerance": self.tolerance,
            **self.estimates_request,
            **of_table,
        }

    @property
    def levelled(self) -> LevelledMap | None:
        """The levelled height map; None for a made surface. FileFormatError, ParameterError or OSError if it is bad."""
        return None if self.path is None else _levelled(self.path, self.sha256, self.table.model_dump_json())

    @functools.cached_property
    def simulation(self) -> Simulation:
        """The simulation; errors as of the reader of its height map, or ParameterError."""
        surface = self.table.made() if self.levelled is None else self.levelled.surface
        facets = self.reflecting.facets
        if isinstance(surface, HeightMap):
            if facets.mirror > 0.0 and one_bounce_is_smoothed(surface):
                raise ParameterError("facets", SINGLE_DIRECTIONS, self.table.facets)
            isotropic = self.table.isotropic
            if isotropic is None:
                assert self.levelled is not None
                isotropic = not self.levelled.harmonics.preferred
        else:
            isotropic = surface.isotropic
        slopes = None
        azimuth = 0.0
        if facets.mirror > 0.0:
            lobe = _lobe(surface, turned=isotropic)
            # viewers stand on a curve around the lobe, however narrow it is
            slopes = (max(lobe.steepest, 0.1 * lobe.across), max(lobe.across, 0.1 * lobe.steepest))
            azimuth = lobe.azimuth
        at = goniometer_directions(isotropic=isotropic, slopes=slopes, azimuth=azimuth)
        return Simulation(
            surface,
            facets,
            at.lights,
            at.viewers,
            rays=self.table.rays,
            turned=isotropic,
            seed=self.table.seed,
            target=self.table.standard_error,
            most=self.table.realisations,
        )

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields: workers make the simulation themselves."""
        return {key: value for key, value in self.__dict__.items() if key != "simulation"}


class PrincipalSlopes(NamedTuple):
    """Slopes of facets along the principal axes of their ellipse.

    Attributes
    ----------
    steepest, across : float [1]
        Standard deviations of the slopes along the steepest axis, and across it.
    azimuth : float [rad]
        Azimuth of the steepest axis.
    """

    steepest: float
    across: float
    azimuth: float


def principal_slopes(surface: HeightMap) -> PrincipalSlopes:
    """Return the slopes of a map along its steepest axis, and across it."""
    normals = surface.triangles().normals
    slopes = normals[:, :2] / normals[:, 2:]
    variances, axes = np.linalg.eigh(np.cov(slopes.T))
    across, steepest = np.sqrt(np.maximum(variances, 0.0))
    return PrincipalSlopes(float(steepest), float(across), float(np.arctan2(axes[1, 1], axes[0, 1])))


def _lobe(surface: MadeSurface | HeightMap, *, turned: bool) -> PrincipalSlopes:
    """Return the slopes that the lobe of mirrors has; of a made surface those along x and y. A turned map has one."""
    if isinstance(surface, MadeSurface):
        return PrincipalSlopes(surface.slope, surface.slope if surface.slope_y is None else surface.slope_y, 0.0)
    steepest, across, azimuth = principal_slopes(surface)
    if not turned:
        return PrincipalSlopes(steepest, across, azimuth)
    both = _mean_square((steepest, across))
    return PrincipalSlopes(both, both, 0.0)


class LevelledMap(NamedTuple):
    """A levelled height map, and what was done to it; the map is the same object each time: its tracer is shared."""

    levelling: Levelled
    surface: HeightMap
    harmonics: SlopeHarmonics
    noise: str


@functools.lru_cache(maxsize=1)
def _levelled(path: Path, sha256: str, table: str) -> LevelledMap:
    """Return the levelled height map in a file; the cache serves a worker that gets many estimates of it.

    The file must have the digest of the request, under which estimates are written: it may be replaced during a build.
    """
    before = path.stat()
    try:
        filtered = SimulatedTable.model_validate_json(table).filtered(path)
    finally:
        after = path.stat()
        same = (before.st_ino, before.st_ctime_ns) == (after.st_ino, after.st_ctime_ns)  # while it was read
        if not same or sha256_of(path) != sha256:
            raise FileFormatError(f"{path}: the file changed since the recipe was read; build again")
    surface = filtered.levelled.height_map()
    return LevelledMap(filtered.levelled, surface, slope_harmonics(surface), filtered.sentence)


# Estimates


def estimate_simulated(folder: str, job: SimulatedJob, number: int) -> bool:
    """Compute an estimate and write it, unless it is there: a task for a worker. Return True if it was there."""
    if read_estimate(Path(folder), number) is not None:
        return True
    write_estimate(Path(folder), number, job.simulation.estimate(number)._asdict())
    return False


def combined(folder: Path, job: SimulatedJob, count: int) -> SimulatedBrdf:
    """Return the mean of the first estimates.

    Those that are damaged are computed again, and so are those that another build of the material has removed.
    """

    def estimates() -> Iterator[Bounces]:
        for number in range(count):
            arrays = read_estimate(folder, number)
            yield job.simulation.estimate(number) if arrays is None else Bounces(**arrays)

    return job.simulation.combined(estimates())


def estimates_needed(
    job: SimulatedJob, folder: Path, compute: Callable[[range], bool], report: Callable[[dict[str, Any]], None]
) -> int | None:
    """Compute estimates in rounds until their error is below the target; return their number, or None if a task failed.

    `compute` writes estimates of some numbers, and returns False if one failed. Estimates are judged in the order of
    their numbers: the result depends neither on workers nor on interruptions.
    """
    simulation = job.simulation
    count = 0
    following = simulation.minimum
    while True:
        if not compute(range(count, following)):
            return None
        count = following
        error = combined(folder, job, count).standard_errors.judged
        following = simulation.following(count, error)
        errors = {"standard_error": error, "target": simulation.target}
        report({"event": "judged", "material": job.name, "realisations": count, **errors, "next": following})
        if following == count:
            return count


# The table


def simulated_samples(job: SimulatedJob, result: SimulatedBrdf) -> Samples:
    """Return f_r of a simulation as samples with their uncertainty, and a record of what was simulated."""
    samples = result.samples(job.name)
    record = simulation_record(job, result)
    return replace(
        samples,
        instrument=Instrument(name="rays on the facets of a surface, brdfdb simulate"),
        provenance="; ".join([*_origin(job), *record.in_words()]),
        record={**samples.record, "simulation": record.model_dump(mode="json")},
    )


def simulated_source(job: SimulatedJob, result: SimulatedBrdf) -> MeasuredSource:
    """Return f_r of a simulation as a reciprocal source: light on facets follows geometric optics.

    Of mirror-like facets, and of Lambertian grooves in one direction, the samples are interpolated over two bases,
    Lambert with one lobe and that of a model of the surface, of which f_r has the lobe and the edges. The base with the
    smaller error at samples that were held out is taken.
    """
    samples = simulated_samples(job, result)
    title = job.table.title or f"{surface_words(job)}, {facet_words(job)}"
    provenance = "; ".join([*_origin(job), samples.instrument.name])
    made = functools.partial(
        MeasuredSource.of_samples, samples, name=job.name, title=title, provenance=provenance, reciprocal=True
    )
    source = made()
    base = _base(result)
    if base is not None:
        source = min(source, made(base=base), key=_held_out)
    record = SimulationRecord.model_validate(samples.record["simulation"])
    file = {} if job.path is None else {"file": job.path.name, "file_sha256": job.sha256}
    return source.recorded(simulation=record, **file)


def _origin(job: SimulatedJob) -> list[str]:
    return [job.table.source] if job.table.source else [] if job.path is None else [f"height map {job.path.name}"]


def simulation_record(job: SimulatedJob, result: SimulatedBrdf) -> SimulationRecord:
    """Return the record of a simulation."""
    simulation = result.simulation
    errors = result.standard_errors
    notes = job.levelled.levelling.measured.notes if job.levelled is not None else ()
    made = not isinstance(simulation.surface, HeightMap)
    if isinstance(simulation.surface, HeightMap):
        slopes = principal_slopes(simulation.surface)[:2]
    else:
        drawn = [simulation.drawn(number).realised() for number in range(min(_DRAWN, result.count))]
        slopes = (_mean_square([map_.slope_x for map_ in drawn]), _mean_square([map_.slope_y for map_ in drawn]))
        if job.table.all_azimuths:  # each map has grooves along y, and is turned
            slopes = (_mean_square(slopes), _mean_square(slopes))
    along_x = np.flatnonzero(np.abs(simulation.lights[:, 1]) + np.minimum(simulation.lights[:, 0], 0.0) <= 1e-9)
    along_x = along_x[np.argsort(-simulation.lights[along_x, 2])]
    lights = simulation.lights[along_x]
    one, two, further = (_digits(share) for share in result.escaped.mean[along_x].mean(axis=2).T)
    return SimulationRecord(
        surface="; ".join([surface_words(job) + _azimuth_words(job), *notes]),
        noise="" if job.levelled is None else job.levelled.noise,
        facets=facet_words(job),
        slopes=_digits(slopes),
        realisations=result.count,
        rays=simulation.rays,
        target=simulation.target,
        standard_error=float(f"{errors.judged:.3g}"),
        standard_error_lowest=float(f"{errors.lowest:.3g}"),
        standard_error_median=float(f"{errors.median:.3g}"),
        standard_error_of_map=None if made else float(f"{errors.of_map:.3g}"),
        lights_deg=_digits(np.degrees(np.arccos(np.clip(lights[:, 2], 0.0, 1.0))), 6),
        spectral=job.reflecting.wavelength_nm is not None,
        one=one,
        two=two,
        further=further,
        in_shadow=_digits(simulation.shadowed()[along_x], 3),
        receivers=simulation.receivers,
        shadows=simulation.shadows,
    )


def _digits(values: Sequence[float] | Floats, count: int = 4) -> list[float]:
    return [float(f"{value:.{count}g}") for value in values]


def _mean_square(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _held_out(source: MeasuredSource) -> float:
    held_out = source.measured.held_out
    return math.inf if held_out is None else held_out.l1


def _base(result: SimulatedBrdf) -> Base | None:
    """Return f_r [1/sr] of a model of the surface, which its samples are interpolated over; None without a model."""
    simulation = result.simulation
    if simulation.facets.mirror > 0.0:
        return _lobe_base(simulation)
    surface = simulation.surface
    if isinstance(surface, MadeSurface) and surface.kind == "grooves" and not simulation.turned:
        return _groove_base(surface.slope, np.asarray(simulation.facets.rho), result.further.mean.mean(axis=(0, 1)))
    return None


def _model_of(suits: Callable[[SurfaceRelation], bool]) -> tuple[ModelSpec, SurfaceRelation]:
    """Return the first model with a relation to surfaces that suits, and the relation."""
    return next((spec, relation) for spec in MODELS.values() for relation in spec.surfaces if suits(relation))


def _groove_base(slope: float, rho: Floats, further: Floats) -> Base:
    """Return f_r [1/sr] of Lambertian V-grooves along y: two bounces by a model of their facets, and a mean of more."""
    model, relation = _model_of(lambda relation: relation.grooves)
    arguments = {**relation.arguments, relation.parameters[0]: float(np.arctan(slope)), "rho": rho}

    def base(wi: Floats, wr: Floats) -> Floats:
        angles = [angle[:, np.newaxis] for w in (wi, wr) for angle in spherical_angles(w)]
        both = model.evaluate(*angles, **arguments) + model.evaluate(*angles[2:], *angles[:2], **arguments)
        return np.asarray(0.5 * both + further)

    return base


def _lobe_base(simulation: Simulation) -> Base:
    """Return f_r [1/sr] of one bounce of facets with Gaussian slopes, and of an even Lambertian surface.

    It is the first model of mirror-like facets whose widths are multiples of the slopes.
    """
    model, relation = _model_of(lambda relation: relation.facets == "mirror" and relation.per_slope is not None)
    lobe = _lobe(simulation.surface, turned=simulation.turned)
    facets = simulation.facets
    index, extinction = (100.0, 1e4) if facets.n is None else (facets.n, facets.k)  # or else all light is reflected
    alphas = (relation.per_slope or 1.0) * np.array([lobe.steepest, lobe.across])
    widths = dict(zip(relation.parameters, np.clip(alphas, 1e-3, 2.0), strict=True))

    def base(wi: Floats, wr: Floats) -> Floats:
        theta_i, phi_i, theta_r, phi_r = (a[:, np.newaxis] for w in (wi, wr) for a in spherical_angles(w))
        angles = theta_i, phi_i - lobe.azimuth, theta_r, phi_r - lobe.azimuth
        f_r = model.evaluate(*angles, **widths, n=index, k=extinction)
        return np.asarray(facets.mirror * f_r + np.asarray(facets.rho) / np.pi)

    return base


def surface_words(job: SimulatedJob) -> str:
    """Return the surface of a job in words."""
    table = job.table
    if table.surface is None:
        assert job.path is not None
        turned = ", turned to all azimuths" if job.simulation.turned else ", not turned"
        assert job.levelled is not None
        done = job.levelled.levelling
        level = {0: "", 1: "less a plane", 2: "less a quadratic"}[done.degree]
        parts = [level, f"{counted(done.filled, 'hole')} filled" if done.filled else ""]
        parts += [f"{counted(len(done.steps), 'step')} removed" if done.removed else ""]
        return ", ".join([f"height map {job.path.name}", *filter(None, parts)]) + turned
    across = "" if table.slope_y_deg is None else f" and {table.slope_y_deg:g}"
    if table.surface in ("grooves", "gaussian-grooves"):
        kind = "V-grooves" if table.surface == "grooves" else "V-grooves with Gaussian slopes"
        where = "in all directions" if table.all_azimuths else "in one direction"
        return f"{kind} {where}, {table.slope_deg:g} degrees"
    kind = {"gaussian": "Gaussian", "exponential": "exponential", "band": "band-limited"}[table.surface]
    return f"Gaussian heights with {kind} correlation, slopes of {table.slope_deg:g}{across} degrees"


def _azimuth_words(job: SimulatedJob) -> str:
    """Return why a height map was turned to all azimuths, or was not, in words; empty of a made surface."""
    if job.levelled is None:
        return ""
    chosen = "as was asked for; " if job.table.isotropic is not None else ""
    return f" ({chosen}{job.levelled.harmonics.sentence})"


def facet_words(job: SimulatedJob) -> str:
    """Return the facets of a job in words."""
    facets = job.reflecting.facets
    parts = []
    if np.any(facets.rho):
        parts.append(f"Lambertian facets of albedo {_span(facets.rho)}")
    if facets.mirror > 0.0:
        weight = "" if facets.mirror == 1.0 else f" of weight {facets.mirror:g}"
        index = job.table.refractive_index or (None if facets.n is None else f"{_span(facets.n)} + {_span(facets.k)}i")
        parts.append(f"mirrors{weight} {'that reflect all light' if index is None else f'with the index {index}'}")
    return " and ".join(parts) or "black facets"


def _span(values: ArrayLike) -> str:
    low, high = float(np.min(values)), float(np.max(values))
    return f"{low:.4g}" if low == high else f"{low:.3g} to {high:.3g}"


def build_simulated(root: str, folder: str, job: SimulatedJob, count: int) -> MeasuredResult:
    """Tabulate the first estimates of a job and publish the table: a task for a worker."""

    def table() -> MeasuredLayout:
        source = simulated_source(job, combined(Path(folder), job, count))
        tabulate = functools.partial(tabulated_lawfully, source, job.tolerance, reciprocal=False)
        made = tabulate(conserving=False)
        if job.table.conserving and largest_albedo(Table.of(*made), source).above_1:
            made = tabulate(conserving=True)
        return made

    made = build_of_data(Path(root), job.name, job.request, table)
    with Lock(Path(root), job.name):  # which leaves no empty folder
        shutil.rmtree(Path(folder).parent, ignore_errors=True)
    return made


def simulated_job(
    name: str,
    fields: Mapping[str, Any],
    folder: Path | None,
    tolerance: float | None,
    wavelengths_nm: Sequence[float] | None,
) -> SimulatedJob:
    """Return the job of a simulated material of a recipe; RecipeError if it cannot be built."""
    if tolerance is None:
        raise RecipeError("tolerance", f"is missing; {name} is simulated, and grids are only for models")
    table = simulated_table(name, fields)
    import_extra("embreex")  # before the time is spent
    path = None
    sha256 = ""
    try:
        reflecting = spectral_facets(table, wavelengths_nm, folder)
        if table.height_map is not None:
            path = ((folder or Path()) / path_of(table.height_map, "height_map")).absolute()
            sha256 = sha256_of(path)
        job = SimulatedJob(name, table, tolerance, reflecting, path, sha256)
        assert job.simulation  # checked before anything is computed
    except (ParameterError, FileFormatError) as error:
        parameter = getattr(error, "parameter", "height_map")
        parameter = _KEYS.get(parameter, parameter)
        sentence = error.sentence if isinstance(error, ParameterError) else str(error)
        raise RecipeError(f"define.{name}.{parameter}", sentence) from None
    except OSError as error:
        raise RecipeError(f"define.{name}.height_map", f"{path}: {error.strerror}") from None
    return job
