"""Forms, charts and choices of every model: ``python tests/benchmarks/every_form.py --sets 1``, half an hour.

Materials of each model are drawn at random. Each is charted, and chosen for in a scene of a sphere in sunlight. A
table that cannot be made is named and left out. Exits with 1 if a material has no chart or no choice, or if a table is
neither made nor named.
"""

from __future__ import annotations

import contextlib
import io
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.errors import BrdfdbError
from brdfdb.forms.catalogue import SPECTRAL_TOLERANCES, TOLERANCES
from brdfdb.forms.tradeoff import chart
from brdfdb.materials import Material
from brdfdb.models import MODELS
from brdfdb.scenes.offered_forms import offered_forms
from brdfdb_pipelines import choose
from tests.benchmarks.recording import Column, Run
from tests.models.draws import drawn

SETS, SEED = 5, 41
COPPER, NM = "main/Cu/Johnson", [450.0, 550.0, 650.0]
MEASURED = "Materials of each model, drawn at random: the tables offered to charts and choices, and those left out."
SCENE = """\
lights = [{{ direction = [0.2, -1, 0.6] }}]
camera = {{ position = [0, -6, 0], height = 1.2 }}
wavelengths_nm = [420, 440, 460, 480, 500, 520, 540, 560, 580, 600, 620, 640, 660, 680]
tolerance = {{ ciede2000 = 1.0 }}
[[objects]]
name = "ball"
material = "drawn"
shape = {{ kind = "sphere", radius = 0.5 }}
[define.drawn]
title = "Drawn at random"
source = "a test"
model = "{model}"
{index}parameters = {parameters}
"""


def draws(model: str, count: int = SETS) -> list[Material]:
    """Return materials of a model, with parameters from the part of each range below 1."""
    rng = np.random.default_rng(SEED)
    spec, made = MODELS[model], []
    for _ in range(count):
        every = drawn(spec, rng)
        parameters = {
            parameter.name: bool(every[parameter.name] > 0.5) if isinstance(parameter.default, bool)
            else float(every[parameter.name])
            for parameter in spec.parameters
        }  # fmt: skip
        fields: dict[str, Any] = {"title": "Drawn at random", "source": "a test", "parameters": parameters}
        index = {"refractive_index": COPPER} if spec.spectral else {}
        made.append(Material(name="drawn", model=model, **fields, **index))
    return made


def scene(material: Material, folder: Path) -> str:
    """Write a scene of a sphere of a material, and return its path."""
    parameters = ", ".join(f"{name} = {json.dumps(value)}" for name, value in material.file_parameters().items())
    index = f'refractive_index = "{COPPER}"\n' if material.spectral else ""
    text = SCENE.format(model=material.model, index=index, parameters=f"{{ {parameters} }}")
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def missing(tolerances: tuple[float, ...], made: list[str], left_out: list[str]) -> list[str]:
    """Return the keys of planned tables that are neither made nor left out, or both."""
    wanted = [f"table-{100.0 * tolerance:g}".replace(".", "-") for tolerance in tolerances]
    return [key for key in wanted if (key in made) == (key in left_out)]


class Walk(NamedTuple):
    """Outcome for a material: numbers of tables made and left out, seconds, and faults in words."""

    tables: int
    left_out: int
    seconds: float
    faults: list[str]


def walk(material: Material) -> Walk:
    """Chart a material, and choose for a sphere of it."""
    begin, nm = time.monotonic(), np.array(NM) if material.spectral else None
    try:
        drawn_chart = chart(material, nm)
        with tempfile.TemporaryDirectory() as folder:
            choice = choose.run(scene(material, Path(folder)), Path(folder) / "out", width=32)
            offered = offered_forms(material, nm, ())
    except (BrdfdbError, ValueError) as error:
        return Walk(0, 0, time.monotonic() - begin, [f"{material.model}: {error}"])
    made = [point.key for point in drawn_chart.points]
    (one,) = choice.materials
    faults = missing(
        SPECTRAL_TOLERANCES if material.spectral else TOLERANCES, made, [x.key for x in drawn_chart.left_out]
    )
    if one.truth.key != offered[0].form.key:
        faults.append(f"the truth is {one.truth.key}")
    out = len(drawn_chart.left_out) + len(one.left_out)
    tables = sum(point.kind == "table" for point in drawn_chart.points)
    return Walk(tables, out, time.monotonic() - begin, [f"{material.model}: {fault}" for fault in faults])


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark."""
    run = Run("every_form", "accuracy", "Forms of charts and choices", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--sets", type=int, default=SETS, help="materials of each model (default: %(default)s)")
    options = run.parse(parser, arguments)
    names, count = (["lambert"], 1) if options.quick else ([*MODELS], options.sets)
    table = run.table(
        "Every model", Column(name="model", width=28), "materials", "charted and chosen", "tables", "left out",
        Column(name="time", unit="s"),
    )  # fmt: skip
    faults = []
    for name in names:
        with contextlib.redirect_stdout(io.StringIO()):
            walks = [walk(material) for material in draws(name, count)]
        whole = sum(not one.faults for one in walks)
        faults += [fault for one in walks for fault in one.faults]
        sums = (sum(one.tables for one in walks), sum(one.left_out for one in walks))
        table.add(name, count, whole, *sums, sum(one.seconds for one in walks))
    run.say(f"{len(names) * count} materials: {len(faults)} without a chart or a choice")
    for fault in faults:
        print(fault)
    run.end()
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
