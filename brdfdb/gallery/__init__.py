"""The figures of the three papers, computed, with the sentences of the papers about them.

A function that returns a statement has no docstring: `says` is its first line.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from brdfdb.figure import Figure
from brdfdb.gallery import (
    he_torrance_1991,
    he_torrance_1991_objects,
    he_torrance_1991_polarisation,
    he_torrance_1991_roughness,
    oren_nayar_1994,
    oren_nayar_1994_bounces,
    oren_nayar_1994_images,
    oren_nayar_1994_samples,
    ward_1992,
    ward_1992_gonioreflectometer,
    ward_1992_renderings,
)

GALLERY: Mapping[str, Callable[[], Figure]] = {
    **oren_nayar_1994.FIGURES,
    **oren_nayar_1994_samples.FIGURES,
    **oren_nayar_1994_images.FIGURES,
    **oren_nayar_1994_bounces.FIGURES,
    **he_torrance_1991.FIGURES,
    **he_torrance_1991_objects.FIGURES,
    **he_torrance_1991_roughness.FIGURES,
    **he_torrance_1991_polarisation.FIGURES,
    **ward_1992.FIGURES,
    **ward_1992_gonioreflectometer.FIGURES,
    **ward_1992_renderings.FIGURES,
}
