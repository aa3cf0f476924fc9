"""The render job: the picture of a scene, as PNG and as spectral EXR."""

from __future__ import annotations

from pathlib import Path

from brdfdb.errors import ParameterError
from brdfdb.scenes import image
from brdfdb.scenes.gbuffer import gather
from brdfdb.scenes.recorded_directions import Recorded
from brdfdb.scenes.renderer import reflectors, render
from brdfdb_pipelines import terminal
from brdfdb_pipelines.scene_file import SceneError, load

WIDTH = 256  # pixels, where none are asked for


def run(name: str, directory: Path, *, width: int | None = None, across: int | None = None) -> None:
    """Render a scene by its file or name, write NAME.png and NAME.exr, and say where they are."""
    scene = load(name)
    if isinstance(scene.objects[0].shape, Recorded) and (width is not None or across is not None):
        raise SceneError(name, "", "is recorded, and has the pixels of its file; leave out --width and --across")
    try:
        with terminal.progress(counted=False, transient=True) as bar:
            bar.add_task("tracing rays", total=None)
            view, materials = gather(scene, width or WIDTH, across=across or 1), reflectors(scene)
    except ParameterError as error:
        raise SceneError(name, error.parameter, error.sentence) from None
    with terminal.progress() as bar:
        task = bar.add_task("rendering", total=len(view.points))
        radiance = render(scene, view, materials=materials, progress=lambda: bar.advance(task))
    directory.mkdir(parents=True, exist_ok=True)
    stem = directory / Path(name).stem
    for write, suffix in ((image.write_png, ".png"), (image.write_exr, ".exr")):
        write(stem.with_name(stem.name + suffix), scene, radiance)
    points = sum(len(each.at) for each in view.points)
    print(f"{stem}.png and {stem.name}.exr: {view.width} x {view.height} pixels, {points} points")
