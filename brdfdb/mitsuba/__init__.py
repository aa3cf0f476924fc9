"""Models as BSDF plugins of Mitsuba 3, in Dr.Jit: one source for CPU, GPU and derivatives.

``import brdfdb.mitsuba`` registers the plugins, whether a variant of Mitsuba is set before or after. It is the only
room that imports Mitsuba, and needs the extra ``mitsuba``. `PLUGINS` names the plugins.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import mitsuba as mi

from brdfdb.mitsuba._surface import Formula, surface_class
from brdfdb.mitsuba.diffuse import FORMULAS, Diffuse, OrenNayar
from brdfdb.mitsuba.he_torrance import HeTorrance
from brdfdb.mitsuba.stray_light import FORMS, StrayLight
from brdfdb.mitsuba.table import TableFormula
from brdfdb.mitsuba.ward import Ward

__all__ = ["PLUGINS"]

PLUGINS: dict[str, Callable[[Any], Formula]] = {
    "brdfdb_ward": Ward,
    "brdfdb_oren_nayar": OrenNayar,
    "brdfdb_he_torrance": HeTorrance,
    "brdfdb_table": TableFormula,
    **{f"brdfdb_{model}": functools.partial(Diffuse, model=model) for model in FORMULAS},
    **{f"brdfdb_{model}": functools.partial(StrayLight, model=model) for model in FORMS},
}


def _register(_: str | None, __: str) -> None:
    surface = surface_class()
    for name, formula in PLUGINS.items():
        mi.register_bsdf(name, lambda props, formula=formula: surface(props, formula(props)))


mi.detail.add_variant_callback(_register)
if mi.variant() is not None:
    _register(None, mi.variant())
