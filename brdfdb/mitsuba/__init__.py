"""Models as BSDF plugins of Mitsuba 3, in Dr.Jit: one source for CPU, GPU and derivatives.

``import brdfdb.mitsuba`` registers the plugins, whether a variant of Mitsuba is set before or after. It is the only
room that imports Mitsuba, and needs the extra ``mitsuba``. `PLUGINS` names the plugins.
"""

from brdfdb.mitsuba.plugins import PLUGINS, register

__all__ = ["PLUGINS"]

register()
