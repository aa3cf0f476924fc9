"""The standing of a material in the range that a paper states of its model, in the paper's own words."""

from __future__ import annotations

from brdfdb.audit.findings import Limit, Standing, Validity
from brdfdb.materials import Material
from brdfdb.tables.grids import Axis

_ORDER: tuple[Standing, ...] = ("inside", "at the edge", "outside")


def validity_of(material: Material, wavelength_nm: Axis | None) -> Validity:
    """Return the limits of the model, judged at the wavelengths [nm] of the table where they depend on them."""
    stated = material.spec.limits
    limits = [] if stated is None else [Limit(**each._asdict()) for each in stated(material.arguments(wavelength_nm))]
    known = [limit.standing for limit in limits if limit.standing != "unknown"]
    return Validity(limits=limits, standing=max(known, key=_ORDER.index, default="inside"))
