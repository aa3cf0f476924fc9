"""The render job: the picture of a scene, as PNG and as spectral EXR."""

from __future__ import annotations

from pathlib import Path

from brdfdb import picture
from brdfdb.gather import gather
from brdfdb.render import reflectors, render
from brdfdb_pipelines import terminal
from brdfdb_pipelines.scene import SceneError, load


def run(name: str, directory: Path, *, width: int, across: int) -> None:
    """Render a scene by its file or name, write NAME.png and NAME.exr, and say where they are."""
    scene = load(name)
    try:
        with terminal.progress(counted=False, transient=True) as bar:
            bar.add_task("tracing rays", total=None)
            view, materials = gather(scene, width, across=across), reflectors(scene)
    except ValueError as error:
        raise SceneError(f"{name}: {error}") from None
    with terminal.progress() as bar:
        task = bar.add_task("rendering", total=len(view.points))
        radiance = render(scene, view, materials=materials, progress=lambda: bar.advance(task))
    directory.mkdir(parents=True, exist_ok=True)
    stem = directory / Path(name).stem
    for write, suffix in ((picture.write_png, ".png"), (picture.write_exr, ".exr")):
        write(stem.with_name(stem.name + suffix), scene, radiance)
    points = sum(len(each.at) for each in view.points)
    print(f"{stem}.png and {stem.name}.exr: {view.width} x {view.height} pixels, {points} points")
