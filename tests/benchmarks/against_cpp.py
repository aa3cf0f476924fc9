"""Our models against the same arithmetic in C++, on one core: ``python tests/benchmarks/against_cpp.py [section ...]``.

The contestants take turns, in several rounds of one run. A rate is the median over rounds of the median pass, "spread"
that of the rounds; a ratio is the median over rounds of ours over theirs.
Seconds are those of the processor: others on the machine count less.
"public" is the function as a user calls it, checks and new arrays and all; "loop" is its compiled loop alone, on the
arrays that the public function hands it. "random angles" are four plain arrays, and the C++ takes their sines, too.
A floor is a goal, not a test. Values are compared before they are timed.
``NUMBA_CPU_NAME=haswell`` compiles both for a processor with AVX2 and without AVX-512.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from subprocess import PIPE
from typing import Any, NamedTuple
from unittest import mock

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.geometry import spherical_angles, unit_vector
from brdfdb.materials import Material, presets
from brdfdb.models import MODELS
from tests.benchmarks.recording import Column, Run, Table, Value

PROCESSOR = os.environ.get("NUMBA_CPU_NAME", "native")  # that both compile for
FLAGS = ["-std=c++17", "-O3", f"-march={PROCESSOR}", "-ffast-math"]
FLOAT32 = ["-DREAL=float", "-fsingle-precision-constant"]
SEED = 1994
# Share of values that agree, and their largest relative difference; values below TINY are 0
AGREEMENT = {"float64": (1.0, 1e-8), "float32": (0.99, 1e-3)}
TINY = 1e-30
ROWS = 2  # of theta_i at a time, as brdfdb.tables.tabulation cuts a grid of this size
MEASURED = "Million values of f_r per second on one core: our models, and the same arithmetic in C++."


class Size(NamedTuple):
    """The size of a run: numbers of directions, of nodes, of rounds, and the length of a turn [s]."""

    directions: int
    summed: int  # directions of He-Torrance, where each is a sum
    integrated: int  # directions of the Gaussian facets, where each is an integral
    polar: int
    azimuths: int
    coarse_polar: int
    coarse_azimuths: int
    light_step: int  # of the tables of He-Torrance every so manieth row is computed: a rate, sooner
    wavelengths: int
    presets: int
    rounds: int
    long_rounds: int  # of passes that take a second or more
    seconds: float

    @property
    def axes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Nodes of polar angle and azimuth."""
        return _nodes(self.polar, self.azimuths)


FULL = Size(1_000_000, 50_000, 2000, 90, 180, 46, 91, 6, 31, 1000, 5, 2, 0.2)
SMALL = Size(2000, 20, 2, 6, 12, 3, 5, 3, 2, 1, 1, 1, 0.001)


def _nodes(polar: int, azimuths: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return np.deg2rad(np.linspace(0.0, 89.5, polar)), np.deg2rad(np.linspace(0.0, 180.0, azimuths))


ANALYTIC: dict[str, dict[str, float]] = {
    "ward": {"rho_d": 0.1, "rho_s": 0.33, "alpha_x": 0.15, "alpha_y": 0.3},
    "ggx": {"alpha_x": 0.15, "alpha_y": 0.3, "n": 0.95, "k": 2.6},
    "ggx_schlick": {"rho_d": 0.1, "f_0": 0.33, "alpha_x": 0.15, "alpha_y": 0.3},
    "rpv": {"rho_0": 0.1, "k": 0.7, "asymmetry": -0.2, "rho_c": 0.3},
    "oren_nayar": {"rho": 0.9, "sigma": 0.5, "interreflection": 1.0},
    "oren_nayar_qualitative": {"rho": 0.9, "sigma": 0.5, "offset": 0.33},
}
IN_FLOAT32 = ("ward", "oren_nayar")
SUMMED = ((10, 0.2516, 4.0), (500, 1.779, 20.0))  # g of the median direction, sigma_0 [um], floor; tau is 10 sigma_0
ALUMINUM = {"wavelength_nm": 500.0, "n": 0.769, "k": 6.08, "a": 0.0}
MANY_RATE = 1e3 / 170.0  # a surface of its own for each value of He-Torrance: 170 ns
OVER_CPP, OVER_RANDOM, TABLE_RATE, GAUSSIAN_RATE = 0.9, 1.5, {"float64": 30.0, "float32": 80.0}, 0.02

Call = Callable[[], Any]
Clock = Callable[[], float]  # median seconds of a pass
Rates = list[float]  # million values a second of each round
Vectors = tuple[NDArray[Any], NDArray[Any]]


@dataclass(frozen=True)
class Row:
    """One line: our rate, what it is held against, and the floor of the ratio or, without one, of the rate."""

    case: str
    timed: str
    ours: Rates
    theirs: Rates | None = None
    floor: float | None = None

    def add_to(self, table: Table) -> None:
        """Add the line to a table."""
        theirs = ratio = None
        rate = value = median(self.ours)
        spread = 100.0 * (max(self.ours) - min(self.ours)) / rate
        if self.theirs is not None:
            theirs = median(self.theirs)
            ratio = value = median(a / b for a, b in zip(self.ours, self.theirs, strict=True))
        verdict = "" if self.floor is None else "ok" if value >= self.floor else "below"
        table.add(self.case, self.timed, theirs, rate, spread, ratio, self.floor, verdict)


def columns() -> list[Column]:
    """Return the columns of `Row`."""
    names = [Column(name="case / against", width=56), Column(name="timed", recorded=False)]
    rates = [Column(name=name, unit="1e6/s") for name in ("C++", "ours")]
    return [
        *names,
        *rates,
        Column(name="ours, spread", unit="%"),
        *(Column(name=name) for name in ("ratio", "floor", "verdict")),
    ]


class Cpp:
    """The compiled baseline, a process that waits for requests."""

    def __init__(self, process: subprocess.Popen[str], folder: Path) -> None:
        self.process, self.folder = process, folder

    def _ask(self, *words: object) -> list[str]:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        print(*words, file=self.process.stdin, flush=True)
        return self.process.stdout.readline().split()

    def clock(self, kernel: str, parameters: list[float], seconds: float) -> Clock:
        return lambda: float(self._ask("time", kernel, seconds, *parameters)[0])

    def check(self, kernel: str, parameters: list[float], ours: NDArray[np.floating]) -> None:
        """Compare our values with those of the C++; SystemExit if they differ."""
        self._ask("dump", kernel, self.folder / "values", *parameters)
        theirs = np.fromfile(self.folder / "values", ours.dtype, count=ours.size)
        share, largest = AGREEMENT[ours.dtype.name]
        if not np.quantile(np.abs(ours.ravel() - theirs) / np.maximum(np.abs(theirs), TINY), share) < largest:
            raise SystemExit(f"{kernel}: C++ and Python compute different things")


@contextmanager
def baseline(wi: NDArray[Any], wr: NDArray[Any], size: Size) -> Iterator[Cpp]:
    """Compile baseline.cpp and start it on the directions and axes, in the dtype of the directions."""
    compiler = shutil.which("g++")
    if compiler is None:
        raise SystemExit("g++ is not installed")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = folder / "baseline"
        flags = FLAGS if wi.dtype == np.float64 else [*FLAGS, *FLOAT32]
        subprocess.run([compiler, *flags, "-o", program, Path(__file__).with_name("baseline.cpp")], check=True)
        theta, phi = size.axes
        angles = np.stack([*spherical_angles(wi), *spherical_angles(wr)])
        named = {"w_i": wi, "w_r": wr, "angles": angles, "theta": theta, "phi": phi}
        for file, array in named.items():
            array.astype(wi.dtype).tofile(folder / file)
        with subprocess.Popen([program, folder], text=True, stdin=PIPE, stdout=PIPE) as process:
            yield Cpp(process, folder)
            process.communicate()


def clock(call: Call, seconds: float) -> Clock:
    """Time passes of `call` for that long, after one to warm up."""

    def passes() -> float:
        call()
        times: list[float] = []
        start = time.perf_counter()
        while len(times) < 3 or time.perf_counter() - start < seconds:
            before = time.process_time()
            call()
            elapsed = time.process_time() - before
            if elapsed > 0.0:  # on a busy machine the clock sometimes stands still during a short pass
                times.append(elapsed)
        return median(times)

    return passes


def once(call: Call) -> Clock:
    """Time one pass of `call`, which is long."""

    def one() -> float:
        before = time.process_time()
        call()
        return time.process_time() - before

    return one


def in_turns(rounds: int, contestants: Mapping[str, tuple[int, Clock]]) -> dict[str, Rates]:
    """Rates of all contestants, each the size of its pass and its clock."""
    rates: dict[str, Rates] = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, (size, passes) in contestants.items():
            rates[name].append(size / passes() / 1e6)
    return rates


def compiled_loop(call: Call) -> Call | None:
    """The compiled loop that `call` ends in, with the arrays it is handed; None if there is no single one."""
    caught: list[Call] = []

    def catching(by_rows: Callable[..., Any]) -> Callable[..., Any]:
        def through(loop: Callable[..., None], *rest: Any) -> Any:
            def catch(*arrays: Any) -> None:
                caught.append(partial(loop, *arrays))
                loop(*arrays)

            return by_rows(catch, *rest)

        return through

    with ExitStack() as stack:
        for module in [module for name, module in sys.modules.items() if name.startswith("brdfdb.models.")]:
            for name in [name for name in ("by_rows", "by_rows_of_vectors") if hasattr(module, name)]:
                stack.enter_context(mock.patch.object(module, name, catching(getattr(module, name))))
        call()
    return caught[0] if len(caught) == 1 else None


def grid(model: str, theta: NDArray[Any], phi: NDArray[Any], **parameters: Any) -> NDArray[np.floating]:
    """The model over theta_i, theta_r and delta_phi, as one writes it with broadcasting axes."""
    return MODELS[model].evaluate(theta[:, None, None], 0.0, theta[:, None], phi, **parameters)


def analytic(model: str, cpp: Cpp, directions: Vectors, size: Size) -> Iterator[Row]:
    """Random directions and a grid of one model, against C++ and against each other, in one dtype."""
    dtype = directions[0].dtype
    parameters = ANALYTIC[model]
    values = list(parameters.values())
    contestants: dict[str, tuple[int, Clock]] = {}
    angles = [angle.astype(dtype) for w in directions for angle in spherical_angles(w)]
    layouts: dict[str, Call] = {
        "": partial(MODELS[model].vectors, *directions, **parameters),
        "_angles": partial(MODELS[model].evaluate, *angles, **parameters),
        "_grid": partial(grid, model, *(axis.astype(dtype) for axis in size.axes), **parameters),
    }
    for layout, public in layouts.items():
        ours = public()
        cpp.check(model + layout, values, ours)
        loop = None if layout == "_angles" else compiled_loop(public)  # it takes vectors, which are computed before
        contestants[f"cpp{layout}"] = ours.size, cpp.clock(model + layout, values, size.seconds)
        if loop is not None:
            contestants[f"loop{layout}"] = ours.size, clock(loop, size.seconds)
        contestants[f"public{layout}"] = ours.size, clock(public, size.seconds)
    cpp.check(f"{model}_six", values, layouts[""]())
    contestants["cpp_six"] = size.directions, cpp.clock(f"{model}_six", values, size.seconds)
    rates = in_turns(size.rounds, contestants)
    for case, ours, theirs, floor in (
        ("random / C++", "", "cpp", OVER_CPP),
        ("random / C++ on six arrays", "", "cpp_six", None),
        ("random angles / C++", "_angles", "cpp_angles", None),
        ("grid / C++", "_grid", "cpp_grid", OVER_CPP),
        ("grid / our random", "_grid", "", OVER_RANDOM),
    ):
        for kind in [kind for kind in ("loop", "public") if kind + ours in rates]:
            yield Row(f"{model} {dtype}, {case}", kind, rates[kind + ours], rates[theirs or kind], floor)


def he_torrance(cpp: Cpp, directions: Vectors, size: Size) -> Iterator[Row]:
    """Random directions, against the sum of eq. 78 term by term until the terms fall below 1e-9 or 1e-12 of it."""
    w_i, w_r = (w[: size.summed] for w in directions)
    for g, sigma_0, floor in SUMMED:
        surface = {"sigma_0_um": sigma_0, "tau_um": 10.0 * sigma_0, **ALUMINUM}
        public = partial(MODELS["he_torrance"].vectors, w_i, w_r, **surface)
        ours = public()
        loop = compiled_loop(public)
        contestants = {"public": (ours.size, clock(public, size.seconds))}
        if loop is not None:
            contestants["loop"] = (ours.size, clock(loop, size.seconds))
        for tolerance in (1e-12, 1e-9):
            order = (surface["wavelength_nm"] / 1e3, sigma_0, 10.0 * sigma_0, *(surface[name] for name in "nka"))
            values = [*order, tolerance, size.summed]
            cpp.check("he_torrance", values, ours)
            contestants[f"{tolerance:g}"] = ours.size, cpp.clock("he_torrance", values, size.seconds)
        rates = in_turns(size.rounds, contestants)
        for stopped in ("1e-09", "1e-12"):
            for kind in [kind for kind in ("loop", "public") if kind in rates]:
                yield Row(f"he_torrance, g ~ {g} / C++ to {stopped}", kind, rates[kind], rates[stopped], floor)
    low, high = [400.0, -2.0, 3.0, 0.2, 0.0], [700.0, 0.5, 20.0, 2.5, 7.0]
    nm, log_sigma_0, ratio, n, k = np.random.default_rng(SEED).uniform(low, high, (len(w_i), 5)).T.copy()
    many = {"wavelength_nm": nm, "sigma_0_um": 10.0**log_sigma_0, "tau_um": ratio * 10.0**log_sigma_0, "n": n, "k": k}
    public = partial(MODELS["he_torrance"].vectors, w_i, w_r, **many)
    rates = in_turns(size.rounds, {"public": (len(w_i), clock(public, size.seconds))})
    yield Row("he_torrance, random surfaces", "public", rates["public"], floor=MANY_RATE)


def by_slabs(material: Material, axes: list[NDArray[Any]], spectrum: list[dict[str, Any]]) -> None:
    """A table as brdfdb.tables.tabulation fills it, one wavelength and a few rows a call."""
    lights, viewers, turned = axes
    for start in range(0, lights.size, ROWS):
        light, viewer, delta_phi = np.ix_(lights[start : start + ROWS], viewers, turned)
        for arguments in spectrum:
            material.spec.evaluate(light, 0.0, viewer, delta_phi, **arguments)


def in_one_call(material: Material, axes: list[NDArray[Any]], spectrum: list[dict[str, Any]]) -> None:
    """The same with the wavelengths on a leading axis."""
    leading = {
        name: np.reshape([each[name] for each in spectrum], (-1, 1, 1, 1)) for name in ("wavelength_nm", "n", "k")
    }
    light, viewer, delta_phi = np.ix_(*axes)
    material.spec.evaluate(light, 0.0, viewer, delta_phi, **spectrum[0] | leading)


def he_torrance_tables(size: Size) -> Iterator[Row]:
    """Every preset on a grid with a spectrum, in both precisions, by slabs and with all wavelengths in one call.

    A preset whose refractive index is not known from 400 to 700 nm keeps the one at the wavelength it is stated for.
    """
    theta, phi = size.axes
    lights, wavelengths_nm = theta[:: size.light_step], np.linspace(400.0, 700.0, size.wavelengths)
    values = lights.size * theta.size * phi.size * wavelengths_nm.size
    seen: list[tuple[Any, ...]] = []
    for material in presets().values():
        surface = (material.parameters, material.refractive_index)
        if material.model != "he_torrance" or surface in seen or len(seen) == size.presets:
            continue
        seen.append(surface)
        try:
            spectrum = [material.arguments(wavelength_nm) for wavelength_nm in wavelengths_nm]
        except ValueError:
            stated = {name: np.ravel(value)[0] for name, value in material.arguments().items()}
            spectrum = [stated | {"wavelength_nm": wavelength_nm} for wavelength_nm in wavelengths_nm]
        contestants: dict[str, tuple[int, Clock]] = {}
        for dtype in TABLE_RATE:
            axes = [axis.astype(dtype) for axis in (lights, theta, phi)]
            for name, fill in (("slabs", by_slabs), ("one call", in_one_call)):
                fill(material, [axis[:ROWS] for axis in axes], spectrum)  # compile before the clock runs
                contestants[f"{name} {dtype}"] = values, once(partial(fill, material, axes, spectrum))
        for name, rates in in_turns(size.long_rounds, contestants).items():
            yield Row(f"{material.name}, {name}", "public", rates, floor=TABLE_RATE[name.split()[-1]])


def oren_nayar_gaussian(directions: Vectors, size: Size) -> Iterator[Row]:
    """Time the model without the paper's fit: its masking integral direction by direction."""
    spec = MODELS["oren_nayar_gaussian"]
    parameters = {each.name: each.default for each in spec.parameters if each.default is not None}
    parameters |= {"rho": 0.9, "sigma": 0.5}
    w_i, w_r = (w[: size.integrated] for w in directions)
    theta, phi = _nodes(size.coarse_polar, size.coarse_azimuths)
    spec.vectors(w_i[:2], w_r[:2], **parameters)  # compile before the clock runs
    grid(spec.name, theta[:2], phi[:2], **parameters)
    name = f"{theta.size} x {theta.size} x {phi.size} grid"
    contestants: dict[str, tuple[int, Clock]] = {
        "random": (len(w_i), once(partial(spec.vectors, w_i, w_r, **parameters))),
        name: (theta.size**2 * phi.size, once(partial(grid, spec.name, theta, phi, **parameters))),
    }
    for title, rate in in_turns(size.long_rounds, contestants).items():
        yield Row(f"{spec.name}, {title}", "public", rate, floor=GAUSSIAN_RATE if title == "random" else None)


def random_directions(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Return unit vectors, uniform over the hemisphere, contiguous (N, 3)."""
    return unit_vector(np.arccos(rng.uniform(0.0, 1.0, count)), rng.uniform(-np.pi, np.pi, count))


@contextmanager
def one_core() -> Iterator[None]:
    """Keep this process and those that it starts on one core."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


def _way(row: list[Value]) -> str:
    """Return what a row is about, without the material of a table."""
    case = str(row[0])
    return case.partition(", ")[2] if "slabs" in case or "one call" in case else case


def main(arguments: Sequence[str] | None = None) -> int:
    """Time all sections or those that are named, and print each row as it is known."""
    float32 = [f"{model}_float32" for model in IN_FLOAT32]
    sections = [*ANALYTIC, *float32, "he_torrance", "he_torrance_tables", "oren_nayar_gaussian"]
    run = Run("against_cpp", "speed", "Models against C++", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("section", nargs="*", help=", ".join(sections))
    parser.add_argument("--rounds", type=int, default=FULL.rounds, help="turns that each contestant takes")
    parser.add_argument("--seconds", type=float, default=FULL.seconds, help="length of a turn")
    options = run.parse(parser, arguments)
    if options.rounds < 1:
        parser.error(f"--rounds: {options.rounds} is less than 1")
    if unknown := [name for name in options.section if name not in sections]:
        parser.error(f"{', '.join(unknown)}: the sections are {', '.join(sections)}")
    size = SMALL if options.quick else FULL._replace(rounds=options.rounds, seconds=options.seconds)
    rng = np.random.default_rng(SEED)
    directions = random_directions(rng, size.directions), random_directions(rng, size.directions)
    table = run.table("Values a second", *columns())
    single = directions[0].astype(np.float32), directions[1].astype(np.float32)
    with one_core(), baseline(*directions, size) as cpp, baseline(*single, size) as cpp32:
        runs: dict[str, Iterator[Row]] = {model: analytic(model, cpp, directions, size) for model in ANALYTIC}
        runs |= {each: analytic(model, cpp32, single, size) for each, model in zip(float32, IN_FLOAT32, strict=True)}
        runs["he_torrance"] = he_torrance(cpp, directions, size)
        runs["he_torrance_tables"] = he_torrance_tables(size)
        runs["oren_nayar_gaussian"] = oren_nayar_gaussian(directions, size)
        for section in options.section or sections:
            for row in runs[section]:
                row.add_to(table)
    run.say(
        "The page shows public functions, and for tables of He-Torrance the slowest material of each way to fill them."
    )
    table.rows = [row for row in table.rows if row[1] == "public"]
    table.keep_worst("ours", _way, smallest=True)
    run.end()
    return 0


if __name__ == "__main__":
    sys.exit(main())
