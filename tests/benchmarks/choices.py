"""The forms that `brdfdb choose` takes for the shipped scenes: ``python tests/benchmarks/choices.py``.

Pictures that share no code with `choose` judge the choices of three of them, or of the scenes that are named (see
picture_judge.py), at four widths and 16 offsets of the pixels. It exits with 1 if more pixels are beyond the tolerance
than choice.json states.
"""

from __future__ import annotations

import contextlib
import io
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import brdfdb_pipelines
from brdfdb.scenes.choice import SceneChoice
from brdfdb_pipelines import choose
from tests.benchmarks.picture_judge import WIDTHS, judge
from tests.benchmarks.recording import Column, Run

SCENES = Path(brdfdb_pipelines.__file__).parent / "scenes"
JUDGED = ("clay-vase", "clay-vase-20deg", "spheres")
WIDTH, OFFSETS = 128, 16
QUICK_WIDTH, QUICK_WIDTHS, QUICK_OFFSETS, QUICK_MOST, QUICK_EDGES = 16, (16,), 1, 50, 20
# A scene that takes a second: one sphere, and a light without an extent
QUICK_SCENE = """\
lights = [{ direction = [0, -1, 0.5] }]
camera = { position = [0, -5, 0], height = 2.5 }
wavelengths_nm = [420, 440, 460, 480, 500, 520, 540, 560, 580, 600, 620, 640, 660, 680]
tolerance = { ciede2000 = 1.0 }
[[objects]]
name = "ball"
material = "rolled-brass"
shape = { kind = "sphere", radius = 1 }
"""
MEASURED = (
    "The cheapest form of each material that the picture of a scene cannot distinguish from the exact form, its "
    "errors in CIEDE2000, and its cost as a share of the cost of the exact form."
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Choose for scenes and judge the choices, and return 1 if a choice breaks its statement."""
    run = Run("choices", "accuracy", "Choices for scenes", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help="names or files, by default those that are shipped")
    options = run.parse(parser, arguments)
    table = run.table(
        "Choices of the scenes",
        Column(name="scene", width=20),
        Column(name="material", width=26),
        Column(name="choice", width=46),
        *(Column(name=name, unit="CIEDE2000", digits=2) for name in ("error alone", "of the whole picture")),
        *("evenly, 1 in", "edges, 1 in"),
        Column(name="cost / exact", digits=2),
        Column(name="next cheaper", width=46),
        Column(name="its error", unit="CIEDE2000", digits=2),
    )
    choices: dict[Path, tuple[SceneChoice, Path]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for number, scene in enumerate(scene_files(options.scenes, Path(folder), options.quick)):
            choices[scene] = chosen(scene, Path(folder, str(number)), options.quick)
            for one in choices[scene][0].materials:
                cheaper = one.next_cheaper
                table.add(
                    scene.stem,
                    one.material,
                    one.choice.title,
                    *(one.choice.error.counted, one.whole.most),
                    *(None if sample is None else sample.one_in for sample in (one.even, one.edges)),
                    one.choice.share,
                    *((None, None) if cheaper is None else (cheaper.title, cheaper.error.counted)),
                )
        named = options.quick or options.scenes
        wanted = {scene: choice for scene, choice in choices.items() if named or scene.stem in JUDGED}
        broken = judged(run, wanted, options.quick)
    run.end()
    return min(broken, 1)


def scene_files(names: Sequence[str], folder: Path, quick: bool) -> list[Path]:
    """Return the files of scenes: those that are named, or all that are shipped; of a quick run one of its own."""
    if quick:
        path = folder / "ball.toml"
        path.write_text(QUICK_SCENE, encoding="utf-8")
        return [path]
    if not names:
        return sorted(SCENES.glob("*.toml"))
    return [Path(name) if name.endswith(".toml") else SCENES / f"{name}.toml" for name in names]


def chosen(scene: Path, out: Path, quick: bool) -> tuple[SceneChoice, Path]:
    """Return the choice for a scene, and its file."""
    with contextlib.redirect_stdout(io.StringIO()):  # the job prints tables of its own
        if quick:
            choice = choose.run(str(scene), out, width=QUICK_WIDTH, tolerances=[])
        else:
            choice = choose.run(str(scene), out, width=WIDTH)
    return choice, out / "choice.json"


def judged(run: Run, choices: dict[Path, tuple[SceneChoice, Path]], quick: bool) -> int:
    """Judge choices by other pictures, and return the number of broken statements."""
    widths, offsets = (QUICK_WIDTHS, QUICK_OFFSETS) if quick else (WIDTHS, OFFSETS)
    table = run.table(
        f"Other pictures, at {len(widths)} widths and {offsets} offsets",
        Column(name="scene", width=20),
        Column(name="material", width=26),
        *("pixels", "beyond the tolerance"),
        Column(name="largest error", unit="CIEDE2000", digits=2),
        *("stated: fewer than 1 in", "statement"),
    )
    broken = 0
    for scene, (choice, path) in choices.items():
        counts = judge(scene, path, widths=widths, offsets=offsets, most=QUICK_MOST if quick else None)
        for one in choice.materials:
            count, one_in = counts[one.material], one.even.one_in if one.even is not None else 1
            holds = count.beyond * one_in <= count.pixels
            broken += not holds
            row = (count.pixels, count.beyond, count.most, one_in, "holds" if holds else "BROKEN")
            table.add(scene.stem, one.material, *row)
    return broken


if __name__ == "__main__":
    sys.exit(main())
