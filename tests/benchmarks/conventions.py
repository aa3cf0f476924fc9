"""Files whose numbers mean something else than they say: ``python tests/benchmarks/conventions.py``.

Twelve surfaces are written as texts with neutral names, with noise, right and by nine wrong conventions, for lights and
viewers of usual instruments that are drawn anew in each run. A statement on a wrong file should name the option that
mends it, where the samples can tell, and no other option. One on a right file should name none. Exits with 1 if fewer
than 95 % of those that can be told are named, more than 3 % of right files are doubted, or a wrong option is named.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb import formats
from brdfdb.errors import BrdfdbError
from brdfdb.measurements.statement import statement
from tests.benchmarks.recording import Column, Run

Array = NDArray[np.float64]
REQUIRED, DOUBTED = 0.95, 0.03
MEASURED = (
    "Statements on made-up files of twelve surfaces, right and by nine wrong conventions: how often the right option "
    "is named, and how often another is."
)


class Directions(NamedTuple):
    """theta_i, theta_r and azimuth from the light [rad] of samples, with cosines of angles between directions."""

    theta_i: Array
    theta_r: Array
    delta: Array

    @property
    def vectors(self) -> tuple[Array, Array]:
        sine = np.sin(self.theta_r)
        wi = np.stack([np.sin(self.theta_i), 0.0 * self.theta_i, np.cos(self.theta_i)], axis=1)
        return wi, np.stack([sine * np.cos(self.delta), sine * np.sin(self.delta), np.cos(self.theta_r)], axis=1)


def fresnel(cosine: Array, f_0: float) -> Array:
    return f_0 + (1.0 - f_0) * (1.0 - cosine) ** 5


def microfacets(at: Directions, alpha_x: float, alpha_y: float, f_0: float) -> Array:
    """Return the lobe of GGX with Smith's shadowing (Heitz 2014), and Schlick's Fresnel reflectance."""
    wi, wr = at.vectors
    half = wi + wr
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    slopes = (half[:, 0] / alpha_x) ** 2 + (half[:, 1] / alpha_y) ** 2 + half[:, 2] ** 2
    d = 1.0 / (np.pi * alpha_x * alpha_y * slopes**2)

    def shadowed(w: Array) -> Array:
        tangent2 = ((alpha_x * w[:, 0]) ** 2 + (alpha_y * w[:, 1]) ** 2) / np.maximum(w[:, 2], 1e-9) ** 2
        return (np.sqrt(1.0 + tangent2) - 1.0) / 2.0

    g = 1.0 / (1.0 + shadowed(wi) + shadowed(wr))
    cosine = np.sum(wi * half, axis=1)
    return d * g * fresnel(cosine, f_0) / np.maximum(4.0 * wi[:, 2] * wr[:, 2], 1e-9)


def oren_nayar(at: Directions, albedo: float, sigma: float) -> Array:
    """Return the qualitative model of Oren and Nayar 1994."""
    a = 1.0 - 0.5 * sigma**2 / (sigma**2 + 0.33)
    b = 0.45 * sigma**2 / (sigma**2 + 0.09)
    alpha = np.maximum(at.theta_i, at.theta_r)
    beta = np.minimum(at.theta_i, at.theta_r)
    slope = np.sin(alpha) * np.tan(np.minimum(beta, 1.5))
    return albedo / np.pi * (a + b * np.maximum(np.cos(at.delta), 0.0) * slope)


def retro(at: Directions) -> Array:
    """Return a retro-reflective sheet: a round lobe about the light that fades at oblique lights."""
    wi, wr = at.vectors
    angle = np.arccos(np.clip(np.sum(wi * wr, axis=1), -1.0, 1.0))
    return 0.08 + 2.0 * np.cos(at.theta_i) * np.cos(at.theta_r) * np.exp(-((angle / 0.2) ** 2))


def velvet(at: Directions) -> Array:
    """Return a sheen that grows to the horizon for light and viewer (Ashikhmin, Premoze and Shirley 2000)."""
    wi, wr = at.vectors
    half = wi + wr
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    slope2 = 1.0 / np.maximum(half[:, 2] ** -2 - 1.0, 1e-3)
    d = 1.0 + 4.0 * np.exp(-slope2 / 0.25)
    return 0.03 + 0.03 * d / (wi[:, 2] + wr[:, 2] - wi[:, 2] * wr[:, 2])


def soil(at: Directions) -> Array:
    """Return Rahman's model of soil: a bowl that is bright towards the light, with a hot spot (Rahman 1993)."""
    wi, wr = at.vectors
    k, asymmetry, rho = 0.75, -0.15, 0.2
    phase = np.clip(np.sum(wi * wr, axis=1), -1.0, 1.0)
    f = (1.0 - asymmetry**2) / (1.0 + asymmetry**2 - 2.0 * asymmetry * phase * -1.0) ** 1.5
    tan_i, tan_r = np.tan(np.minimum(at.theta_i, 1.5)), np.tan(np.minimum(at.theta_r, 1.5))
    far = np.sqrt(np.maximum(tan_i**2 + tan_r**2 - 2.0 * tan_i * tan_r * np.cos(at.delta), 0.0))
    cosines = wi[:, 2] * wr[:, 2] * (wi[:, 2] + wr[:, 2])
    return rho / np.pi * cosines ** (k - 1.0) * f * (1.0 + (1.0 - rho) / (1.0 + far))


SURFACES: dict[str, Callable[[Directions], Array]] = {
    "Spectralon": lambda at: oren_nayar(at, 0.97, 0.1),
    "rough plaster": lambda at: oren_nayar(at, 0.5, 0.6),
    "satin metal": lambda at: microfacets(at, 0.25, 0.25, 0.8),
    "glossy paint": lambda at: 0.12 + microfacets(at, 0.1, 0.1, 0.04),
    "mirror-like": lambda at: 1e-3 + microfacets(at, 0.03, 0.03, 0.9),
    "brushed": lambda at: 0.02 + microfacets(at, 0.12, 0.4, 0.7),
    "retro-reflective": retro,
    "velvet": velvet,
    "black coating": lambda at: 0.0025 + microfacets(at, 0.35, 0.35, 0.01),
    "off-specular": lambda at: 0.05 + microfacets(at, 0.6, 0.6, 0.3),
    "soil": soil,
    # light that enters the paint and is lost on no way out: not reciprocal
    "coupled paint": lambda at: 0.25 * (1.0 - fresnel(np.cos(at.theta_i), 0.04)) + microfacets(at, 0.2, 0.2, 0.04),
}


class Numbers(NamedTuple):
    """Columns of a file: four angles [degree] and f_r."""

    theta_i: Array
    phi_i: Array
    theta_r: Array
    phi_r: Array
    values: Array


def _of_quantity(factor: Callable[[Numbers], Array]) -> Callable[[Numbers], Numbers]:
    return lambda right: right._replace(values=factor(right))


# The wrong conventions: what the file says instead, and the option that mends it
WRONG: dict[str, tuple[Callable[[Numbers], Numbers], str]] = {
    "f cos_r": (_of_quantity(lambda n: n.values * np.cos(np.radians(n.theta_r))), "--quantity f_r_cos"),
    "f cos_i": (_of_quantity(lambda n: n.values * np.cos(np.radians(n.theta_i))), "--quantity f_r_cos_i"),
    "factor": (_of_quantity(lambda n: n.values * np.pi), "--quantity reflectance_factor"),
    "percent": (_of_quantity(lambda n: n.values * 100.0), "--quantity percent"),
    "log10": (_of_quantity(lambda n: np.log10(n.values)), "--quantity log10"),
    "forward": (lambda n: n._replace(phi_r=(n.phi_r + 180.0) % 360.0), "--azimuth forward"),
    "elevation": (lambda n: n._replace(theta_i=90.0 - n.theta_i, theta_r=90.0 - n.theta_r), "--angles elevation"),
    "radians": (lambda n: Numbers(*(np.radians(angle) for angle in n[:4]), n.values), "--angles rad"),
    "exchanged": (lambda n: Numbers(n.phi_i, n.theta_i, n.phi_r, n.theta_r, n.values), "--angles exchanged"),
}


def measured(rng: np.random.Generator, f_r: Callable[[Directions], Array], noise: float, absolute: bool) -> Numbers:
    """Return samples of a surface at directions of a usual instrument, drawn anew."""
    kind = rng.choice(["grid", "grid", "scan", "offset", "plane"])
    lights = np.arange(
        *[(10.0, 71.0, 10.0), (15.0, 76.0, 15.0), (5.0, 66.0, 20.0), (10.0, 71.0, 20.0)][rng.integers(4)]
    )
    polar = np.arange(rng.choice([0.0, 5.0, 10.0]), 80.1, rng.choice([5.0, 10.0]))
    turns = np.arange(0.0, 360.0, rng.choice([15.0, 30.0])) if rng.random() < 0.5 else np.arange(0.0, 181.0, 15.0)
    if kind == "scan":  # as many instruments: few lights, viewers in fine steps
        lights, polar = np.array([15.0, 30.0, 45.0, 60.0]), np.arange(0.0, 80.1, 2.5)
    if kind == "offset":  # no pair of samples is exchanged
        lights = lights + 2.0
    if kind == "plane":
        turns, polar = np.array([0.0, 180.0]), np.arange(0.0, 80.1, 2.5)
    i, r, d = (axis.reshape(-1) for axis in np.meshgrid(lights, polar, turns, indexing="ij"))
    values = f_r(Directions(*np.radians([i, r, d]))) * np.exp(rng.normal(0.0, noise, i.size))
    return Numbers(i, np.zeros_like(i), r, d, values) if absolute else Numbers(i, np.full_like(i, np.nan), r, d, values)


def written(path: Path, numbers: Numbers) -> None:
    """Write columns as a text whose names say nothing but the role; azimuths of lights only where they are known."""
    columns = {"theta_i": numbers.theta_i, "phi_i": numbers.phi_i, "theta_r": numbers.theta_r, "phi_r": numbers.phi_r}
    if np.isnan(numbers.phi_i).any():
        columns = {"theta_i": numbers.theta_i, "theta_r": numbers.theta_r, "delta_phi": numbers.phi_r}
    rows = np.column_stack([*columns.values(), numbers.values])
    np.savetxt(path, rows, delimiter=",", header=",".join([*columns, "brdf"]), comments="", fmt="%.7g")


def albedo_of(f_r: Callable[[Directions], Array]) -> float:
    """Return the directional albedo for light at 45 degrees, by the rule of rectangles."""
    cosine, turn = (np.arange(400) + 0.5) / 400, (np.arange(400) + 0.5) * np.pi / 200
    mu, delta = (axis.reshape(-1) for axis in np.meshgrid(cosine, turn, indexing="ij"))
    values = f_r(Directions(np.full(mu.size, np.pi / 4.0), np.arccos(mu), delta))
    return float(np.mean(values * mu) * 2.0 * np.pi)


def told(name: str, wrong: str, right: Numbers) -> bool:
    """Return True if the samples can tell a wrong convention from the right one, by what is known of the surface."""
    lights = np.unique(right.theta_i)
    in_plane = np.unique(right.phi_r).size < 3
    values, lobes = right.values, []
    for light in lights[lights >= 35.0]:
        of_light = right.theta_i == light
        mirror = of_light & (right.phi_r == 180.0) & (np.abs(right.theta_r - light) <= 10.0)
        lobes.append(values[mirror].max(initial=0.0) / np.median(values[of_light]))
    contrast = float(np.median(lobes))
    lobed = name not in ("Spectralon", "rough plaster", "velvet", "soil")
    paired = np.isin(right.theta_r, lights) & (right.theta_r > lights.min())
    scale = {"factor": np.pi, "percent": 100.0}.get(wrong, 0.0) * albedo_of(SURFACES[name]) > 1.05
    return {
        "f cos_r": bool(paired.any()) and lights.size > 2 and name != "coupled paint",
        "f cos_i": bool(paired.any()) and lights.size > 2 and name != "coupled paint",
        # in one plane there is no albedo, and a lobe narrower than the steps has none
        "factor": scale and not in_plane and name != "mirror-like",
        "percent": scale and not in_plane and name != "mirror-like",
        "forward": name != "retro-reflective" and contrast > (2.2 if in_plane else 1.6),
        "elevation": lobed and not in_plane and bool(np.isin(right.theta_r, lights).any()) and lights.size > 2,
        "log10": True,
        "radians": True,
        "exchanged": True,
    }[wrong]


def options_named(path: Path) -> list[str]:
    """Return the options that a statement on a file names, or that the refusal of the file names."""
    try:
        texts = statement(formats.samples(path)).hints
    except BrdfdbError as error:
        texts = (str(error),)
    return [match.rstrip(".,:;)") for text in texts for match in re.findall(r"--(?:quantity|azimuth|angles) \S+", text)]


class Judged(NamedTuple):
    """A file: its surface, its convention, if the samples can tell it, the option that mends it, and those named."""

    surface: str
    wrong: str
    can: bool
    option: str
    named: list[str]

    @property
    def is_right(self) -> bool:
        """True if the option is named; scales that cannot be told apart are named together."""
        return self.option in self.named

    @property
    def is_false(self) -> bool:
        """True if other options are named, and not the right one."""
        return bool(self.named) and not self.is_right


def judged(rng: np.random.Generator, noise: float, folder: Path) -> Iterator[Judged]:
    """Yield a right file and nine wrong ones of each surface."""
    path = folder / "sheet.csv"
    for name, f_r in SURFACES.items():
        for wrong, (changed, option) in {"right": (lambda n: n, ""), **WRONG}.items():
            right = measured(rng, f_r, noise, absolute=bool(rng.random() < 0.5))
            numbers = changed(right)
            if wrong == "exchanged" and np.isnan(right.phi_i).any():
                numbers = Numbers(right.theta_i, right.phi_i, right.phi_r, right.theta_r, right.values)
            written(path, numbers)
            yield Judged(name, wrong, wrong != "right" and told(name, wrong, right), option, options_named(path))


def main(arguments: Sequence[str] | None = None) -> int:
    """Write, read and judge all files."""
    run = Run("conventions", "accuracy", "Conventions that a file does not say", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--seed", type=int, help="seed of the draws (default: a new one)")
    parser.add_argument("--rounds", type=int, default=3, help="files of each surface and convention (default: 3)")
    parser.add_argument("--noise", type=float, default=0.02, help="relative noise of values (default: 0.02)")
    options = run.parse(parser, arguments)
    rng = np.random.default_rng(options.seed)
    counts = {name: np.zeros(5, dtype=int) for name in ("right", *WRONG)}
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(1 if options.quick else options.rounds):
            for file in judged(rng, options.noise, Path(folder)):
                besides = not file.can and file.is_right
                counts[file.wrong] += [1, file.can, file.can and file.is_right, file.is_false, besides]
                if (file.can and not file.is_right) or file.is_false:
                    print(f"  {file.surface}, {file.wrong}: named {file.named or 'nothing'}", flush=True)
    names = ("files", "can be told", "named", "wrongly named", "named besides")
    shown = run.table("Options named", Column(name="convention", width=12), *names)
    for wrong, numbers in counts.items():
        shown.add(wrong, *numbers.tolist())
    of_wrong = sum(counts[name] for name in WRONG)
    share = float(of_wrong[2] / of_wrong[1])
    doubted = float(counts["right"][3] / counts["right"][0])
    run.say(f"{share:.1%} of {of_wrong[1]} files that can be told are named right; at least 95 % is required.")
    run.say(f"{doubted:.1%} of {counts['right'][0]} right files are doubted; at most 3 % is allowed.")
    run.say(f"{of_wrong[3]} wrong options are named; none is allowed.")
    run.end()
    return 0 if share >= REQUIRED and doubted <= DOUBTED and of_wrong[3] == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
