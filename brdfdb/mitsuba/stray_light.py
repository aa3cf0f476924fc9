"""ABg and Harvey-Shack in Dr.Jit: scatter of polished surfaces around the mirror direction."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from brdfdb.mitsuba._parameters import PluginParameters
from brdfdb.mitsuba._surface import GLOSSY, Formula, Values
from brdfdb.models import MODELS

FORMS = ("abg", "harvey_shack")

_LEAST = 1e-30
_LEAST_Z = 1e-10  # z of a half vector below which the density counts as 0
_SHARE, _ALPHA_RANGE = 0.5, (1e-6, 2.0)  # share of samples in the lobe, and its range of widths


class _GgxLobe(NamedTuple):
    """Slopes around the mirror direction whose density falls as GGX does, as in `brdfdb.lobes`."""

    alpha: Any
    share: float = _SHARE
    alone: float = _SHARE

    def draw(self, wi: Any, _: Any, sample: Any) -> Any:
        """Return the direction `wi` mirrored in a half vector of the lobe."""
        radius = self.alpha * dr.sqrt(sample.x / dr.maximum(1.0 - sample.x, 1e-7))
        sin, cos = dr.sincos(2.0 * dr.pi * sample.y)
        return mi.reflect(wi, dr.normalize(mi.Vector3f(radius * cos, radius * sin, 1.0)))

    def density(self, wi: Any, wo: Any) -> Any:
        """Return the density [1/sr] of the directions that `draw` gives."""
        x, y, z = wi.x + wo.x, wi.y + wo.y, dr.maximum(wi.z + wo.z, _LEAST_Z)
        inverse = 1.0 / z
        slope2 = dr.square(x * inverse) + dr.square(y * inverse)
        profile = self.alpha / (dr.square(self.alpha) + slope2)
        value = dr.square(profile) * dr.inv_pi * (slope2 + 1.0) * inverse * 0.5
        return dr.select(z > _LEAST_Z, value, 0.0)


class StrayLight(Formula):
    """The plugins ``brdfdb_abg`` and ``brdfdb_harvey_shack``. Their parameters are those of these models."""

    components = (GLOSSY,)

    def __init__(self, props: Any, model: str) -> None:
        self._model = model
        self.parameters = PluginParameters(props, MODELS[model])

    def parts(self, values: Values, wi: Any, wo: Any) -> dict[str, Any]:
        """Return f_r [1/sr]."""
        x2 = dr.square(wi.x + wo.x) + dr.square(wi.y + wo.y)
        if self._model == "abg":
            # A / (B + x^g)
            power = dr.exp(0.5 * values["g"] * dr.log(dr.maximum(x2, _LEAST)))
            return {GLOSSY: values["a"] / (values["b"] + power)}
        # b_0 (1 + (x / L)^2)^(s / 2)
        power = dr.exp(0.5 * values["slope"] * dr.log(1.0 + x2 / dr.square(values["knee"])))
        return {GLOSSY: values["b_0"] * power}

    def lobe(self, values: Values, wi: Any) -> _GgxLobe:
        """Return a lobe as wide as the distance at which the profile bends."""
        knee = dr.exp(dr.log(values["b"]) / values["g"]) if self._model == "abg" else values["knee"]
        width = dr.detach(knee) / (2.0 * dr.maximum(wi.z, 1e-6))
        return _GgxLobe(dr.clip(width, *_ALPHA_RANGE))
