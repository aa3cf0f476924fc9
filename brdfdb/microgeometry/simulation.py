"""Simulations: independent estimates of f_r by the goniometer, their mean with its standard error, and when to stop."""

from __future__ import annotations

import functools
import math
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from brdfdb.errors import ParameterError
from brdfdb.geometry import spherical_angles
from brdfdb.measurements.samples import Samples
from brdfdb.microgeometry.facets import Bounces, Facets
from brdfdb.microgeometry.goniometer import bounces, shadowed
from brdfdb.microgeometry.height_map import HeightMap
from brdfdb.microgeometry.mirrors import CONE, one_bounce_is_smoothed
from brdfdb.microgeometry.rays import Tracer, Vectors
from brdfdb.microgeometry.surfaces import MadeSurface

PartOfLight = Literal["one", "two", "further", "total"]  # a number of bounces, or all
PARTS: tuple[PartOfLight, ...] = ("one", "two", "further", "total")
_QUANTITIES = (*PARTS, "escaped")

_CONE = f"{np.degrees(CONE):.0f} degrees about the viewer"
_SHADOW = 4.0  # heights of shadows, in standard deviations of the heights
_FEWEST = 8  # estimates of a made surface between two looks at their error, at least
_DIM = 0.01  # of the peak: relative errors are those of f_r above it
_JUDGED_DEG = 83.0  # polar angle up to which the standard error is judged: the 145 patches, without the lowest ring


class Estimated(NamedTuple):
    """f_r [1/sr] with its standard errors, each of shape (lights, viewers, wavelengths).

    Attributes
    ----------
    mean : array [1/sr]
        f_r.
    error : array [1/sr]
        Standard error: of a single map, for the surface that it is a sample of, from its blocks.
    noise : array [1/sr]
        Standard error of the rays alone; of made surfaces it is `error`.
    """

    mean: NDArray[np.float64]
    error: NDArray[np.float64]
    noise: NDArray[np.float64]


class StandardErrors(NamedTuple):
    """Relative standard errors [1] of f_r where it exceeds a hundredth of its peak.

    Attributes
    ----------
    judged : float [1]
        The largest of the rays, for lights and viewers up to 83 degrees. The rule that stops a simulation judges it.
    lowest : float [1]
        The same at all lights and viewers.
    median : float [1]
        Of the rays, up to 83 degrees: the median in place of the largest.
    of_map : float [1]
        The largest of a single finite map, from its blocks, up to 83 degrees; of made surfaces the same as `judged`.
    """

    judged: float
    lowest: float
    median: float
    of_map: float


@dataclass(frozen=True, eq=False)
class Simulation:
    """A measurement of a surface by a goniometer, as estimates that are independent of each other.

    Of a made surface, each estimate is a map of its own. A single map is divided into blocks: an estimate is that of a
    block, with random numbers of its own, and a round has an estimate of each block. ParameterError if a value is
    outside its range.
    """

    surface: MadeSurface | HeightMap
    facets: Facets
    lights: Vectors = field(repr=False)  #: unit vectors to the lights, (I, 3) [1]
    viewers: Vectors = field(repr=False)  #: unit vectors to the viewers, (V, 3), or (I, V, 3) of each light [1]
    rays: int = 1 << 13  #: rays for each light in an estimate
    blocks: int = 4  #: blocks of a single map along each axis
    turned: bool = False  #: True for a single map that stands for a surface without a direction: it is turned
    seed: int = 0  #: the same seed gives the same estimates
    target: float = 0.02  #: relative standard error at which estimates are enough [1]
    least: int = 16  #: estimates at least; of a single map, rounds of all blocks are complete, and two or more
    most: int = 512  #: estimates at most

    def __post_init__(self) -> None:
        ranges = {
            "rays": (1, 1 << 24),
            "blocks": (2, 64),
            "seed": (0, 1 << 62),
            "least": (2, 1 << 20),
            "most": (2, 1 << 20),
        }
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise ParameterError(name, f"{value} is not allowed; allowed are {low} to {high}", value, (low, high))
        if not 0.0 < self.target < 1.0:
            text = f"{self.target:g} is no relative error; allowed are numbers between 0 and 1"
            raise ParameterError("target", text, self.target, (0.0, 1.0))
        if self.most < self.minimum:
            text = f"{self.most} is less than the {self.minimum} estimates that are needed at least"
            raise ParameterError("most", text, self.most, (self.minimum, None))

    @property
    def round(self) -> int:
        """Estimates that belong together: all blocks of a single map, or one of a made surface."""
        return 1 if isinstance(self.surface, MadeSurface) else self.blocks**2

    @property
    def minimum(self) -> int:
        """Estimates at least: complete rounds, two or more."""
        return max(2, -(-self.least // self.round)) * self.round

    def estimate(self, number: int) -> Bounces:
        """Return an estimate. It depends on the simulation and the number alone, whichever process computes it."""
        measure = functools.partial(
            bounces,
            facets=self.facets,
            lights=self.lights,
            viewers=self.viewers,
            rays=self.rays,
            seed=_seed(self.seed, number),
        )
        if isinstance(self.surface, MadeSurface):
            gaussian = self.surface.gaussian_slopes
            return measure(self.drawn(number), turned=self.surface.isotropic, gaussian_slopes=gaussian)
        i, j = divmod(number % self.round, self.blocks)
        x = np.linspace(0.0, self.surface.width_um, self.blocks + 1)
        y = np.linspace(0.0, self.surface.length_um, self.blocks + 1)
        return measure(_tracer(self.surface), turned=self.turned, region=(x[i], x[i + 1], y[j], y[j + 1]))

    @property
    def receivers(self) -> str:
        """Which light of mirrors is a mean over directions around the viewer, in words; empty without mirrors."""
        if self.facets.mirror == 0.0:
            return ""
        least = "one reflection or more" if one_bounce_is_smoothed(self.drawn(0)) else "several reflections"
        return f"light that leaves after {least}, the last by a mirror, is a mean over {_CONE}"

    @functools.cached_property
    def widening(self) -> float:
        """Factor on the standard error of a single map [1]: its blocks are alike where they are narrow.

        The correlation of what two places reflect is taken to fall as exp(-(distance / tau)^2), with the length of
        correlation of the heights.
        """
        if isinstance(self.surface, MadeSurface):
            return 1.0
        realised = self.surface.realised()
        sides = np.array([self.surface.width_um, self.surface.length_um])
        spans = np.divide(sides, [realised.tau_x_um, realised.tau_y_um])
        of_map = _variance_of_mean(spans)
        of_block = _variance_of_mean(spans / self.blocks)
        if of_block <= of_map:  # neither height nor slope differs from place to place
            return 1.0
        return float(np.sqrt((self.round - 1) * of_map / (of_block - of_map)))

    @property
    def shadows(self) -> str:
        """Which shadows are longer than a single map, in words; empty if all shadows of lights and viewers fit."""
        if isinstance(self.surface, MadeSurface) or self.surface.periodic:
            return ""
        side = min(self.surface.width_um, self.surface.length_um)
        steepest = float(np.arctan2(side, _SHADOW * self.surface.heights_um.std()))
        lowest = min(np.min(self.lights[:, 2]), np.min(self.viewers[..., 2]))
        if lowest >= np.cos(steepest):
            return ""
        text = f"beyond {np.degrees(steepest):.0f} degrees shadows may be longer than the map: "
        return text + "there f_r depends on places of the map that stand in for its surroundings"

    def drawn(self, number: int) -> HeightMap:
        """Return the map of an estimate: always the same single map, or the one that a made surface draws for it."""
        return self.surface if isinstance(self.surface, HeightMap) else self.surface.draw(_seed(self.seed, number, 1))

    def shadowed(self, maps: int = 4) -> NDArray[np.float64]:
        """Return the share [1] of the area of facets facing each light that lies in shadow, from some maps, (I,).

        Facets facing a viewer in the same direction are masked to the same share.
        """
        if isinstance(self.surface, HeightMap):
            return shadowed(_tracer(self.surface), self.lights, rays=self.rays, seed=self.seed, turned=self.turned)
        shares = [
            shadowed(
                self.surface.draw(_seed(self.seed, number, 1)),
                self.lights,
                rays=self.rays,
                seed=_seed(self.seed, number),
                turned=self.surface.isotropic,
            )
            for number in range(maps)
        ]
        return np.asarray(np.mean(shares, axis=0))

    def combined(self, estimates: Iterable[Bounces]) -> SimulatedBrdf:
        """Return f_r of estimates in their order; ParameterError if rounds are not complete, or less than two."""
        sums = _Sums(self)
        for estimate in estimates:
            sums.add(estimate)
        return sums.brdf()

    def following(self, count: int, error: float) -> int:
        """Return how many estimates there should be after `count` of them with a relative error [1]; `count` if enough.

        The error falls with the square root of the count. The count at most doubles, since a few estimates tell their
        error roughly.
        """
        most = self.most // self.round * self.round
        if error <= self.target or count >= most:
            return count
        wanted = math.ceil(count * min((error / self.target) ** 2, 2.0) / self.round)
        return min(max(wanted * self.round, count + max(self.round, _FEWEST)), most)

    def run(
        self, *, executor: Executor | None = None, progress: Callable[[int, float | None], None] | None = None
    ) -> SimulatedBrdf:
        """Add estimates until their relative error is below the target, or there are as many as allowed.

        An executor computes estimates at the same time: threads gain, because rays are traced without the interpreter's
        lock. `progress` is called with the number of estimates and the relative error, None while that is not known.
        """
        sums = _Sums(self)
        compute = map if executor is None else executor.map
        following = self.minimum
        while True:
            for estimate in compute(self.estimate, range(sums.count, following)):
                sums.add(estimate)
                if progress is not None:
                    progress(sums.count, None)
            brdf = sums.brdf()
            error = brdf.standard_errors.judged
            if progress is not None:
                progress(sums.count, error)
            following = self.following(sums.count, error)
            if following == sums.count:
                return brdf


class _Sums:
    """Sums over the estimates of a simulation, of which memory does not grow with their number."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.count = 0
        self._of_blocks: dict[str, list[NDArray[np.float64]]] = {name: [] for name in _QUANTITIES}
        self._squares: dict[str, NDArray[np.float64]] = {}

    def add(self, estimate: Bounces) -> None:
        """Add the next estimate."""
        block = self.count % self.simulation.round
        for name in _QUANTITIES:
            value = getattr(estimate, name)
            if self.count < self.simulation.round:
                self._of_blocks[name].append(np.zeros_like(value))
            self._of_blocks[name][block] += value
            self._squares[name] = self._squares.get(name, 0.0) + value * value
        self.count += 1

    def brdf(self) -> SimulatedBrdf:
        """Return f_r of the estimates so far; ParameterError if rounds are not complete, or less than two."""
        blocks = self.simulation.round
        if self.count % blocks or self.count < 2 * blocks:
            text = f"{self.count} are given; needed are {2 * blocks} or more, and a multiple of {blocks}"
            raise ParameterError("estimates", text, self.count, (2 * blocks, None))
        return SimulatedBrdf(self.simulation, self.count, **{name: self._estimated(name) for name in _QUANTITIES})

    def _estimated(self, name: str) -> Estimated:
        rounds = self.count // self.simulation.round
        means = np.stack(self._of_blocks[name]) / rounds
        within = self._squares[name] - rounds * np.sum(means * means, axis=0)
        noise = np.sqrt(np.maximum(within, 0.0) / (self.count - len(means)) / self.count)
        error = noise
        if len(means) > 1:
            error = self.simulation.widening * means.std(axis=0, ddof=1) / np.sqrt(len(means))
        return Estimated(means.mean(axis=0), error, noise)


@dataclass(frozen=True, eq=False)
class SimulatedBrdf:
    """f_r of a simulation after one, two, further and all bounces, from a number of estimates."""

    simulation: Simulation
    count: int  #: number of estimates
    one: Estimated = field(repr=False)
    two: Estimated = field(repr=False)
    further: Estimated = field(repr=False)
    total: Estimated = field(repr=False)
    escaped: Estimated = field(repr=False)  #: share of the light that leaves, (lights, 3, wavelengths) [1]

    @functools.cached_property
    def standard_errors(self) -> StandardErrors:
        """The relative standard errors of f_r after all bounces."""
        total = self.total
        viewers = np.broadcast_to(self.simulation.viewers, (*total.mean.shape[:2], 3))[..., 2]
        high = np.minimum(self.simulation.lights[:, np.newaxis, 2], viewers) > np.cos(np.radians(_JUDGED_DEG))
        bright = total.mean > _DIM * total.mean.max(axis=(0, 1), where=high[..., np.newaxis], initial=0.0)
        inside = bright & high[..., np.newaxis]
        of_rays, of_map = (error / np.where(bright, total.mean, 1.0) for error in (total.noise, total.error))
        return StandardErrors(
            judged=float(np.max(of_rays, where=inside, initial=0.0)),
            lowest=float(np.max(of_rays, where=bright, initial=0.0)),
            median=float(np.median(of_rays[inside])) if inside.any() else 0.0,
            of_map=float(np.max(of_map, where=inside, initial=0.0)),
        )

    def samples(self, name: str, part: PartOfLight = "total") -> Samples:
        """Return f_r with its standard uncertainty as samples of a measurement, in the order of lights and viewers."""
        simulation = self.simulation
        estimated: Estimated = getattr(self, part)
        shape = estimated.mean.shape
        lights = np.repeat(simulation.lights, shape[1], axis=0)
        viewers = np.broadcast_to(simulation.viewers, (*shape[:2], 3)).reshape(-1, 3)
        wavelength_nm = simulation.facets.wavelength_nm
        channels = ("grey",) if wavelength_nm is None else tuple(f"{at:g}nm" for at in np.asarray(wavelength_nm))
        surface = simulation.surface
        made = (
            asdict(surface) if isinstance(surface, MadeSurface) else {"map": surface.name, "blocks": simulation.blocks}
        )
        return Samples(
            name,
            *spherical_angles(lights),
            *spherical_angles(viewers),
            channels,
            None if wavelength_nm is None else np.asarray(wavelength_nm, np.float64),
            estimated.mean.reshape(-1, shape[2]),
            uncertainty=estimated.error.reshape(-1, shape[2]),
            provenance=f"rays on facets, {self.count} realisations of {simulation.rays} rays for each light",
            record={
                "surface": made,
                "bounces": part,
                "seed": simulation.seed,
                "rays": simulation.rays,
                "realisations": self.count,
                **self.standard_errors._asdict(),
                "target": simulation.target,
                **{name: words for name in ("receivers", "shadows") if (words := getattr(simulation, name))},
            },
        )


def _variance_of_mean(spans: NDArray[np.float64]) -> float:
    """Return the variance of the mean over a rectangle of a field of variance 1, correlated as exp(-distance^2).

    `spans` are the sides of the rectangle; nan for an axis along which the field does not change.
    """
    span = np.maximum(np.nan_to_num(spans), 1e-3)
    return float(np.prod((np.sqrt(np.pi) * span * erf(span) - 1.0 + np.exp(-(span**2))) / span**2))


def _seed(*numbers: int) -> int:
    """Return a seed for numbers: those of different numbers are independent."""
    return int(np.random.SeedSequence(numbers).generate_state(1, np.uint64)[0])


_PREPARING = threading.Lock()  # threads that want the same map wait for the first: a large map takes 1 GB
_prepared = functools.lru_cache(maxsize=1)(Tracer)


def _tracer(surface: HeightMap) -> Tracer:
    """Return the facets of a map, prepared for rays: estimates of its blocks share them."""
    with _PREPARING:
        return _prepared(surface)
