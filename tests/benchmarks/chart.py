"""Pictures and table of the README's section on speed against accuracy: ``python tests/benchmarks/chart.py``.

Run it on an idle machine, in the root of the repository: it writes docs/NAME.svg and prints the table.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from brdfdb.chart import Chart
from brdfdb_pipelines import chart, scatter, terminal

NAMES = ("wall-plaster", "rolled-brass", "scene-copper-sphere")
FAMILY, RECIPE = "copper-roughness", Path("pipelines/brdfdb_pipelines/recipes/copper-roughness.toml")
PICTURES = Path("docs")


def rows(one: Chart) -> list[str]:
    """The front, each with what it saves over the truth."""
    points = {point.key: point for point in one.points}
    truth = points[one.truth].batch.ns
    lines = []
    for key in one.fronts.batch:
        point = points[key]
        errors = f"{scatter.percent(point.l1)} | {scatter.percent(point.p99)} | {scatter.percent(point.forward)}"
        faster = float(f"{truth / point.batch.ns:.2g}")
        time = f"{terminal.count(point.batch.ns)} | {terminal.count(faster)}"
        lines.append(f"| {one.material} | {point.title} | {errors} | {time} | {terminal.size(point.bytes)} |")
    return lines


if __name__ == "__main__":
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        found = chart.run(NAMES, Path(folder))
        chart.run((FAMILY,), Path(folder), recipe_file=RECIPE)
        for name in (*NAMES, FAMILY):
            shutil.copy(Path(folder, f"{name}.svg"), PICTURES)
    print("| material | form | mean error | p99 | forward | ns a value | times as fast | bytes |")
    print("|---|---|---|---|---|---|---|---|")
    print("\n".join(line for one in found.charts for line in rows(one)))
