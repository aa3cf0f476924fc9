"""Values of a file through Eradiate's own loader: in a process of its own, because two Mitsubas do not share one.

It is imported only by the Python of an environment with the package eradiate.
"""

import json
import sys

try:
    import eradiate
except ImportError:
    sys.exit(5)

eradiate.set_mode("mono_double")

import mitsuba  # noqa: E402  # takes its variant from the mode
from eradiate.contexts import KernelContext  # noqa: E402
from eradiate.scenes.bsdfs import bsdf_factory  # noqa: E402
from eradiate.scenes.core import traverse  # noqa: E402


def values(path: str, wi: list[list[float]], wr: list[list[float]]) -> list[float]:
    """Return f_r [1/sr] of a file, pair by pair."""
    template, _ = traverse(bsdf_factory.convert({"type": "mqdiffuse", "data": path}))
    surface = mitsuba.load_dict(template.render(KernelContext()))
    context, interaction = mitsuba.BSDFContext(), mitsuba.SurfaceInteraction3f()
    f_r = []
    for light, viewer in zip(wi, wr, strict=True):
        interaction.wi = mitsuba.Vector3f(*viewer)  # a path comes from the camera
        f_r.append(surface.eval(context, interaction, mitsuba.Vector3f(*light))[0] / light[2])
    return f_r


if __name__ == "__main__":
    asked = json.load(sys.stdin)
    json.dump(values(asked["path"], asked["wi"], asked["wr"]), sys.stdout)
