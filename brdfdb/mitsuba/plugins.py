"""Names of the plugins, and their registration with every variant of Mitsuba."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import mitsuba as mi

from brdfdb.mitsuba._surface import Formula, surface_class
from brdfdb.mitsuba.diffuse import FORMULAS, Diffuse
from brdfdb.mitsuba.he_torrance import HeTorrance
from brdfdb.mitsuba.oren_nayar import OrenNayar
from brdfdb.mitsuba.stray_light import FORMS, StrayLight
from brdfdb.mitsuba.table import TableFormula
from brdfdb.mitsuba.ward import Ward

PLUGINS: dict[str, Callable[[Any], Formula]] = {
    "brdfdb_ward": Ward,
    "brdfdb_oren_nayar": OrenNayar,
    "brdfdb_he_torrance": HeTorrance,
    "brdfdb_table": TableFormula,
    **{f"brdfdb_{model}": functools.partial(Diffuse, model=model) for model in FORMULAS},
    **{f"brdfdb_{model}": functools.partial(StrayLight, model=model) for model in FORMS},
}


def register() -> None:
    """Register all plugins with the variant that is set, and with those that are set later."""
    mi.detail.add_variant_callback(_register)
    if mi.variant() is not None:
        _register(None, mi.variant())


def _register(_: str | None, __: str) -> None:
    surface = surface_class()
    for name, formula in PLUGINS.items():
        mi.register_bsdf(name, lambda props, formula=formula: surface(props, formula(props)))
