"""Coverage of the 95 % intervals of fits: ``python tests/benchmarks/intervals.py``, some minutes on one core.

Five surfaces are sampled as a goniometer does, with six kinds of error. The share of true parameters inside the
intervals of the fit that is printed, plain, and again with the nuisance numbers that the plain fit proposes. Exits with
1 if less than 90 % are inside with the proposals, for one of the kinds.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.fitting.fit import fit
from brdfdb.fitting.judgement import Judgement, judged, with_nuisance
from brdfdb.geometry import unit_vector
from brdfdb.measurements import Samples
from brdfdb.models import MODELS
from tests.benchmarks.recording import Column, Run

MEASURED = "The share of true parameters in the 95 % intervals of fits to samples with six kinds of error."
REQUIRED = 0.9
SEEDS, QUICK_SEEDS = 10, 1
SEED = 520_000  # of the first set of samples

Array = NDArray[np.float64]


class Surface(NamedTuple):
    """A surface: the sum of models that is fitted, and the true numbers of each term."""

    model: str
    terms: Mapping[str, Mapping[str, float]]
    truth: Mapping[str, float]  # by the names of the document


WIDE = {"rho_d": 0.0, "rho_s": 0.25, "alpha_x": 0.35, "alpha_y": 0.35}
COATING = {"rho_d": 0.03, "f_0": 0.05, "alpha_x": 0.2, "alpha_y": 0.2}
SURFACES = {
    "paint": Surface(
        "ggx_schlick",
        {"ggx_schlick": {"rho_d": 0.4, "f_0": 0.06, "alpha_x": 0.3, "alpha_y": 0.3}},
        {"rho_d": 0.4, "f_0": 0.06, "alpha_x": 0.3},
    ),
    "narrow lobe": Surface(
        "ward",
        {"ward": {"rho_d": 0.2, "rho_s": 0.1, "alpha_x": 0.06, "alpha_y": 0.06}},
        {"rho_d": 0.2, "rho_s": 0.1, "alpha_x": 0.06},
    ),
    "brushed": Surface(
        "ward",
        {"ward": {"rho_d": 0.1, "rho_s": 0.3, "alpha_x": 0.12, "alpha_y": 0.3}},
        {"rho_d": 0.1, "rho_s": 0.3, "alpha_x": 0.12, "alpha_y": 0.3},
    ),
    "plaster": Surface(
        "oren_nayar_gaussian",
        {"oren_nayar_gaussian": {"rho": 0.6, "sigma": 0.5}},
        {"rho": 0.6, "sigma_deg": float(np.rad2deg(0.5))},
    ),
    "coating": Surface("beckmann_schlick", {"beckmann_schlick": COATING}, {"rho_d": 0.03, "f_0": 0.05, "alpha_x": 0.2}),
}


class Directions(NamedTuple):
    """Directions [rad] of light and viewer, (N,), in the order of measurement, and the number of the incidence."""

    theta_i: Array
    phi_i: Array
    theta_r: Array
    phi_r: Array
    incidence: NDArray[np.int64]


def directions(rng: np.random.Generator, *, turned: bool) -> Directions:
    """Return the directions of a goniometer: some incidences, each with viewers that are dense at the mirror."""
    lights = np.sort(rng.choice([5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0], int(rng.integers(4, 7)), replace=False))
    azimuths = [0.0, 45.0, 90.0] if turned else [0.0]
    rows, number = [], 0
    for light in lights:
        for azimuth in azimuths:
            wide = np.meshgrid(np.arange(0.0, 76.0, 8.0), [0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 315.0], indexing="ij")
            near = np.meshgrid(light + np.arange(-8.0, 9.0, 2.0), [174.0, 180.0, 186.0], indexing="ij")
            theta_r, turn = (np.concatenate([a.ravel(), b.ravel()]) for a, b in zip(wide, near, strict=True))
            theta_r, turn = np.abs(theta_r), np.where(theta_r < 0.0, turn + 180.0, turn)
            rows.append(np.stack([np.full_like(turn, light), np.full_like(turn, azimuth), theta_r, azimuth + turn]))
            rows[-1] = np.concatenate([rows[-1], np.full((1, turn.size), float(number))])
            number += 1
    *angles, incidence = np.concatenate(rows, axis=1)
    return Directions(*np.deg2rad(angles), incidence.astype(np.int64))


def f_r(surface: Surface, w_i: Array, w_r: Array) -> Array:
    """Return the true f_r (N,) [1/sr]."""
    return np.sum([MODELS[name].vectors(w_i, w_r, **given) for name, given in surface.terms.items()], axis=0)


class Made(NamedTuple):
    """Directions, and true f_r (N,) [1/sr] there."""

    surface: Surface
    at: Directions
    clean: Array
    rng: np.random.Generator

    @property
    def proportional(self) -> Array:
        """f_r with 3 % of noise."""
        return self.clean * (1.0 + 0.03 * self.rng.standard_normal(self.clean.size))


def proportional(made: Made) -> Array:
    """3 % of noise."""
    return made.proportional


def floor(made: Made) -> Array:
    """1 or 3 % of noise, and noise of 3 to 30 % of the median."""
    noise = np.hypot(made.rng.choice([0.01, 0.03]) * made.clean, made.rng.uniform(0.03, 0.3) * np.median(made.clean))
    return made.clean + noise * made.rng.standard_normal(made.clean.size)


def dark(made: Made) -> Array:
    """A signal of 3 % of the median that is there without light, over the cosines by which readings are divided."""
    signal = 0.03 * np.median(made.clean) * made.rng.choice([-1.0, 1.0])
    powers = made.rng.permutation([(0, 1), (0, 1), (1, 0), (1, 1)])[0]
    return made.proportional + signal / (np.cos(made.at.theta_i) ** powers[0] * np.cos(made.at.theta_r) ** powers[1])


def tilt(made: Made) -> Array:
    """The normal is half a degree off, in a direction by chance. Half of the readings have the cosine of the viewer."""
    turn = made.rng.uniform(0.0, 2.0 * np.pi)
    axis, angle = np.array([np.cos(turn), np.sin(turn), 0.0]), np.deg2rad(0.5)

    def tilted(w: Array) -> Array:
        along = np.sum(w * axis, axis=1, keepdims=True) * axis
        return along + np.cos(angle) * (w - along) + np.sin(angle) * np.cross(axis, w)

    w_i, w_r = unit_vector(made.at.theta_i, made.at.phi_i), unit_vector(made.at.theta_r, made.at.phi_r)
    values = f_r(made.surface, tilted(w_i), tilted(w_r))
    if made.rng.random() < 0.5:
        values = values * tilted(w_r)[:, 2] / w_r[:, 2]
    return values * made.proportional / made.clean


def drift(made: Made) -> Array:
    """The lamp loses or gains 2 to 10 % from the first sample to the last, evenly or soon, calibrated at the first."""
    size = made.rng.uniform(0.02, 0.1) * made.rng.choice([-1.0, 1.0])
    t = np.linspace(0.0, 1.0, made.clean.size)
    course = t if made.rng.random() < 0.5 else (1.0 - np.exp(-3.0 * t)) / (1.0 - np.exp(-3.0))
    return made.proportional * (1.0 + size * course)


def correlated(made: Made) -> Array:
    """Each incidence has a gain of 1 +- 3 %, or an error of 3 % that is correlated over 30 degrees of the viewer."""
    count = made.at.incidence.max() + 1
    if made.rng.random() < 0.5:
        return made.proportional * (1.0 + 0.03 * made.rng.standard_normal(count))[made.at.incidence]
    w_r = unit_vector(made.at.theta_r, made.at.phi_r)
    error = np.empty(made.clean.size)
    for number in range(count):
        rows = np.flatnonzero(made.at.incidence == number)
        apart = np.sum((w_r[rows, np.newaxis] - w_r[rows]) ** 2, axis=2)
        correlation = np.exp(-apart / (2.0 * 0.5**2)) + 1e-9 * np.eye(rows.size)
        error[rows] = 0.03 * np.linalg.cholesky(correlation) @ made.rng.standard_normal(rows.size)
    return made.clean * (1.0 + error + 0.01 * made.rng.standard_normal(error.size))


KINDS: dict[str, Callable[[Made], Array]] = {
    "proportional": proportional,
    "floor": floor,
    "dark": dark,
    "tilt": tilt,
    "drift": drift,
    "correlated": correlated,
}


def samples(surface: Surface, kind: str, seed: int) -> Samples:
    """Return the samples of a surface with a kind of error."""
    rng = np.random.default_rng(seed)
    at = directions(rng, turned=surface is SURFACES["brushed"])
    clean = f_r(surface, unit_vector(at.theta_i, at.phi_i), unit_vector(at.theta_r, at.phi_r))
    values = KINDS[kind](Made(surface, at, clean, rng))[:, np.newaxis]
    return Samples("made", at.theta_i, at.phi_i, at.theta_r, at.phi_r, ("grey",), None, values)


def inside(best: Judgement, truth: Mapping[str, float]) -> list[str]:
    """Return the numbers whose interval contains the true one."""
    return [one.name for one in best.estimates if one.name in truth and one.low <= truth[one.name] <= one.high]


def coverage(run: Run, kinds: Sequence[str], names: Sequence[str], seeds: int) -> float:
    """Measure the share of parameters in their intervals; the least of all kinds with the proposed nuisance numbers."""
    table = run.table(
        "parameters in their 95 % intervals",
        Column(name="error", width=14),
        "intervals",
        Column(name="plain", unit="%"),
        Column(name="with proposals", unit="%"),
        Column(name="width", digits=3),
        Column(name="proposed", width=30),
        Column(name="missed", width=30, recorded=False),
        Column(name="time", unit="s", recorded=False),
    )
    shares = []
    for kind in kinds:
        proposals, missed = Counter[str](), Counter[str]()
        widths: list[float] = []
        every = plain = followed = 0
        begin = time.perf_counter()
        for number, name in enumerate(names):
            surface = SURFACES[name]
            for seed in range(seeds):
                made = samples(surface, kind, SEED + 1000 * list(KINDS).index(kind) + 100 * number + seed)
                fitted = fit(made, surface.model)
                best = judged(fitted)  # what `fits` and the command print of a fit
                hits = inside(best, surface.truth)
                every, plain = every + len(surface.truth), plain + len(hits)
                proposed = best.proposed
                if proposed:
                    best = judged(with_nuisance(fitted, proposed))
                    hits = inside(best, surface.truth)
                proposals[",".join(proposed) or "-"] += 1
                missed.update(f"{name} {one}" for one in surface.truth if one not in hits)
                followed += len(hits)
                widths += [
                    (one.high - one.low) / surface.truth[one.name]
                    for one in best.estimates
                    if one.name in surface.truth
                ]
        shares.append(followed / every)
        table.add(
            kind,
            every,
            100.0 * plain / every,
            100.0 * followed / every,
            float(np.median(widths)),
            " ".join(f"{what}:{count}" for what, count in proposals.most_common()),
            " ".join(f"{what}:{count}" for what, count in missed.most_common(6)),
            time.perf_counter() - begin,
        )
    return min(shares)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print and record."""
    run = Run("intervals", "accuracy", "Intervals of fits", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--kind", action="append", choices=list(KINDS))
    parser.add_argument("--surface", action="append", choices=list(SURFACES))
    parser.add_argument("--seeds", type=int)
    options = run.parse(parser, arguments)
    seeds = options.seeds or (QUICK_SEEDS if options.quick else SEEDS)
    least = coverage(run, options.kind or list(KINDS), options.surface or list(SURFACES), seeds)
    run.say(f"The least share is {100.0 * least:.1f} %; at least {100.0 * REQUIRED:.0f} % is required.")
    run.end()
    return 0 if least >= REQUIRED or options.quick else 1


if __name__ == "__main__":
    sys.exit(main())
