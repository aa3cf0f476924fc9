"""The command `brdfdb render`."""

from __future__ import annotations

import argparse
from pathlib import Path

from brdfdb_pipelines.commands._arguments import MOST_WIDTH, add_out, add_scene, whole_number

HELP = "Render a scene with the models of its materials as PNG and spectral EXR."

WIDTH = 256  # pixels across the picture by default
MOST_ACROSS = 16  # rays across a pixel: more take tens of gigabytes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the scene and the size of the picture."""
    add_scene(parser)
    add_out(parser, "brdf-scenes")
    # no defaults: a recorded scene has the pixels of its file
    parser.add_argument(
        "--width", type=whole_number(MOST_WIDTH), metavar="N", help=f"width of the picture [pixel] (default: {WIDTH})"
    )
    parser.add_argument(
        "--across", type=whole_number(MOST_ACROSS), metavar="N", help="rays across and down each pixel (default: 1)"
    )


def run(options: argparse.Namespace) -> int:
    """Render the scene, write NAME.png and NAME.exr, and print where they are."""
    from brdfdb.errors import ParameterError, import_extra
    from brdfdb.scenes import image
    from brdfdb.scenes.gbuffer import gather
    from brdfdb.scenes.renderer import reflectors, render
    from brdfdb.scenes.shapes import Recorded
    from brdfdb_pipelines import scene_file, terminal

    for module in ("matplotlib.image", "OpenEXR"):  # before the time is spent
        import_extra(module)
    name = options.scene
    scene = scene_file.load(name)
    if isinstance(scene.objects[0].shape, Recorded) and (options.width is not None or options.across is not None):
        raise scene_file.SceneError(
            name, "", "is recorded with a fixed number of pixels; leave out --width and --across"
        )
    try:
        with terminal.progress(counted=False, transient=True) as bar:
            bar.add_task("tracing rays", total=None)
            view = gather(scene, options.width or WIDTH, across=options.across or 1)
            materials = reflectors(scene)
            terminal.say_without_glints("the picture", *scene.materials.values())
    except ParameterError as error:
        raise scene_file.SceneError(name, error.parameter, error.sentence) from None
    with terminal.progress() as bar:
        task = bar.add_task("rendering points", total=len(view.points))
        radiance = render(scene, view, materials=materials, progress=lambda: bar.advance(task))
    options.out.mkdir(parents=True, exist_ok=True)
    stem = options.out / Path(name).stem
    for write, suffix in ((image.write_png, ".png"), (image.write_exr, ".exr")):
        write(stem.with_name(stem.name + suffix), scene, radiance)
    count = sum(len(points.at) for points in view.points)
    print(f"{stem}.png and {stem.name}.exr: {view.width} x {view.height} pixels, {count} points")
    return 0
