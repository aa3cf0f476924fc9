"""Samples of a Gaussian of slopes around the mirror direction in Dr.Jit, as in `brdfdb.integrals.sampling`."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

_LEAST_Z = 1e-10  # z of a half vector below which the density counts as 0
_LARGEST_T2 = 80.0  # square of slopes in widths, beyond which the Gaussian counts as 0 in float32


class GaussianLobe(NamedTuple):
    """The share [1] of samples in the lobe, and the widths [1] of its slopes.

    They have no derivatives: directions are drawn and weighted alike whatever the parameters are.
    """

    share: Any
    alpha_x: Any
    alpha_y: Any
    alone: float = 0.9  # share of samples in the lobe if the glossy part is alone. The rest finds its tails

    @classmethod
    def of(cls, share: Any, alpha_x: Any, alpha_y: Any) -> GaussianLobe:
        """Return the lobe of parameters that may have derivatives."""
        return cls(dr.detach(share), dr.detach(alpha_x), dr.detach(alpha_y))

    def draw(self, wi: Any, _: Any, sample: Any) -> Any:
        """Return the direction `wi` mirrored in a half vector of the lobe, for random numbers in the unit square."""
        radius = dr.sqrt(-dr.log(dr.maximum(1.0 - sample.x, 1e-10)))
        sin, cos = dr.sincos(2.0 * dr.pi * sample.y)
        h = dr.normalize(mi.Vector3f(radius * self.alpha_x * cos, radius * self.alpha_y * sin, 1.0))
        return mi.reflect(wi, h)

    def density(self, wi: Any, wo: Any) -> Any:
        """Return the density [1/sr] of the directions that `draw` gives."""
        x, y, z = wi.x + wo.x, wi.y + wo.y, dr.maximum(wi.z + wo.z, _LEAST_Z)
        inverse = 1.0 / z
        s_x, s_y = x * inverse, y * inverse
        t2 = dr.square(s_x / self.alpha_x) + dr.square(s_y / self.alpha_y)
        inside = (t2 < _LARGEST_T2) & (z > _LEAST_Z)
        length2 = dr.square(s_x) + dr.square(s_y) + 1.0
        value = dr.exp(-dr.minimum(t2, _LARGEST_T2)) * length2 * inverse / (2.0 * dr.pi * self.alpha_x * self.alpha_y)
        return dr.select(inside, value, 0.0)
