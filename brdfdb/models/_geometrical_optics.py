"""Assumptions of models of facets on the light: facets are large compared to the wavelength, and heights differ."""

from __future__ import annotations

from brdfdb.parameters import SurfaceAssumption

LARGE_FACETS = SurfaceAssumption(
    "large facets",
    "Further, the facet area is large compared to the wavelength λ of incident light and therefore geometrical optics "
    "can be used to derive the reflectance model.",
    "Oren and Nayar 1994, section 3, with eq. 5",
)
NO_SPECULAR_PART = SurfaceAssumption(
    "no specular part",
    "Waves of different heights do not interfere, and the specular part, exp(-g), is gone.",
    "He et al. 1991, eq. 79, for g >> 1",
)
