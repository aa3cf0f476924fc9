"""Speed against accuracy of the forms of four materials: ``python tests/benchmarks/chart.py``.

Times are those of the processor, but programs that share its caches on a busy machine lengthen them. ``--pictures``
copies the pictures of the materials and of a family to docs/pictures/NAME.svg.
"""

from __future__ import annotations

import contextlib
import io
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from unittest import mock

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.forms import sampler_efficiency, timing, tradeoff
from brdfdb.forms.tradeoff import Chart, Cost
from brdfdb_pipelines import chart
from tests.benchmarks.recording import Column, Run

ROOT = Path(__file__).parents[2]
NAMES = ("clay-vase", "magnesium-oxide-ceramic", "rolled-brass", "scene-copper-sphere")
FAMILY, RECIPE = "copper-roughness", ROOT / "pipelines" / "brdfdb_pipelines" / "recipes" / "copper-roughness.toml"
PICTURES = ROOT / "docs" / "pictures"
QUICK = NAMES[2:3]
# The least of all that makes a chart complete
FEWER = (
    (timing, "ROUNDS", 1),
    (timing, "MIXED_ROUNDS", 1),
    (timing, "MATERIALS", 2),
    (tradeoff, "SINGLES", 1),
    (sampler_efficiency, "ROUNDS", 1),
)
MEASURED = (
    "Error against the exact form, and time of a value of f_r on one core, of every form of a material; the time that "
    "a sampler takes to a standard deviation of 1 %, for the albedo in light from 60 degrees and a picture of a sphere."
)
TIMES = ("many at once", "256 at once", "one", "64 materials in turn")


def main(arguments: Sequence[str] | None = None) -> int:
    """Chart the materials, and print their tables."""
    run = Run("chart", "speed", "Speed against accuracy", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--pictures", action="store_true", help="write docs/pictures/NAME.svg")
    parser.add_argument("names", metavar="NAME", nargs="*", help="of presets, by default four")
    options = run.parse(parser, arguments)
    names = options.names or (QUICK if options.quick else NAMES)
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        stack.enter_context(contextlib.redirect_stdout(io.StringIO()))  # the job prints tables of its own
        for module, name, value in FEWER if options.quick else ():
            stack.enter_context(mock.patch.object(module, name, value))
        charts = chart.run(names, folder, tolerances=[0.2] if options.quick else None).charts
        if options.pictures:
            chart.run((FAMILY,), folder, recipe_path=RECIPE)
            for path in folder.glob("*.svg"):
                shutil.copy(path, PICTURES)
    for one in charts:
        forms(run, one)
        samplers(run, one)
    run.end()
    return 0


def forms(run: Run, one: Chart) -> None:
    """Print the forms of a material, the most accurate first."""
    table = run.table(
        f"{one.material}: forms",
        Column(name="form", width=44),
        Column(name="key", recorded=False),
        "worth having",
        *(Column(name=name, unit="%") for name in ("mean error", "p99")),
        *(Column(name=name, unit="%", recorded=False) for name in ("p99 from", "p99 to", "forward")),
        *(Column(name=name, unit="ns", recorded=name in ("many at once", "64 materials in turn")) for name in TIMES),
        Column(name="times as fast as its rung", digits=2),
        "rung",
        Column(name="bytes", recorded=False),
    )
    for point in sorted(one.points, key=lambda point: point.l1):
        errors = (point.l1, point.p99, point.p99_low, point.p99_high, point.forward)
        costs: tuple[Cost, ...] = (point.batch, point.block, point.single, point.mixed)
        table.add(
            point.title,
            point.key,
            "*" if point.key in one.fronts.batch else "",
            *(None if error is None else 100.0 * error for error in errors),
            *(cost.ns for cost in costs),
            None if point.saving is None else point.saving.times,
            point.rung,
            point.bytes,
        )


def samplers(run: Run, one: Chart) -> None:
    """Print the samplers of a material."""
    table = run.table(
        f"{one.material}: samplers",
        Column(name="sampler", width=44),
        *(
            Column(name=f"{problem}, {name}", unit=unit, recorded=name == "time to 1 %")
            for problem in ("albedo", "sphere")
            for name, unit in (("variance", ""), ("time", "ns"), ("time to 1 %", "ms"), ("from", "ms"), ("to", "ms"))
        ),
    )
    for sampler in one.samplers:
        works = (sampler.albedo, sampler.sphere)
        table.add(sampler.title, *(n for w in works for n in (w.variance, w.ns, w.ms, w.low_ms, w.high_ms)))


if __name__ == "__main__":
    sys.exit(main())
