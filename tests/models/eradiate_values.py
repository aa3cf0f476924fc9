"""Values of eradiate's plugins: a process of its own, because its Mitsuba and that of others have one name."""

import json
import sys

import mitsuba


def values(plugin: dict[str, float | str], wi: list[list[float]], wr: list[list[float]]) -> list[float]:
    """Return f_r [1/sr] of a plugin, pair by pair."""
    surface, context, interaction = mitsuba.load_dict(plugin), mitsuba.BSDFContext(), mitsuba.SurfaceInteraction3f()
    f_r = []
    for light, viewer in zip(wi, wr, strict=True):
        interaction.wi = mitsuba.Vector3f(*light)
        f_r.append(surface.eval(context, interaction, mitsuba.Vector3f(*viewer))[0] / viewer[2])
    return f_r


if __name__ == "__main__":
    mitsuba.set_variant("scalar_mono_double")
    asked = json.load(sys.stdin)
    json.dump({name: values(plugin, asked["wi"], asked["wr"]) for name, plugin in asked["plugins"].items()}, sys.stdout)
