"""Pictures and table of the README's section on speed against accuracy: ``python tests/benchmarks/chart.py``.

Run it in the root of the repository: it writes docs/pictures/NAME.svg and prints the tables. Times are those of the
processor, but what shares its caches on a busy machine lengthens them.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from brdfdb.forms.tradeoff_document import Chart
from brdfdb_pipelines import chart, plot_panels, terminal, tradeoff_plot

NAMES = ("clay-vase", "magnesium-oxide-ceramic", "rolled-brass", "scene-copper-sphere")
FAMILY, RECIPE = "copper-roughness", Path("pipelines/brdfdb_pipelines/recipes/copper-roughness.toml")
PICTURES = Path("docs/pictures")


def rows(one: Chart) -> list[str]:
    """Return rows of the front, each with what it saves over the rung of the truth that is as accurate."""
    points = {point.key: point for point in one.points}
    lines = []
    for key in one.fronts.batch:
        point = points[key]
        errors = f"{plot_panels.percent(point.l1)} | {tradeoff_plot.tail(point)} | {plot_panels.percent(point.forward)}"
        times = " | ".join(terminal.count(each.ns) for each in (point.batch, point.block, point.single, point.mixed))
        faster = tradeoff_plot.against(point) or "-"
        lines.append(
            f"| {one.material} | {point.title} | {errors} | {times} | {faster} | {terminal.size(point.bytes)} |"
        )
    return lines


def noise(one: Chart) -> list[str]:
    """Return rows of the samplers."""
    return [f"| {one.material} | {each.title} | {' | '.join(tradeoff_plot.works(each))} |" for each in one.samplers]


if __name__ == "__main__":
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        found = chart.run(NAMES, Path(folder))
        chart.run((FAMILY,), Path(folder), recipe_path=RECIPE)
        for name in (*NAMES, FAMILY):
            shutil.copy(Path(folder, f"{name}.svg"), PICTURES)
    print("| material | form | mean error | p99 | forward | ns, many | 256 | one | in turn | over its rung | bytes |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    print("\n".join(line for one in found.charts for line in rows(one)))
    print("| material | sampler | albedo: variance | ns | ms to 1 % | sphere: variance | ns | ms to 1 % |")
    print("|---|---|---|---|---|---|---|---|")
    print("\n".join(line for one in found.charts for line in noise(one)))
