"""What albedos are held against: 1, or what is known of an excess, from which angle on, and who says so."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from brdfdb.grids import Axis
from brdfdb.lookup import Table
from brdfdb.materials import Material

# A sum of float32 values: an ideal diffuser, albedo 1, measures 1 + 1.2e-7
ENERGY_TOLERANCE = 1e-6
DIGITS = 7  # of albedos in a report: what a float32 holds


def known_excess(table: Table, material: Material) -> Mapping[str, Any]:
    """What a table says of its material, or else its model, as a mapping like `KnownExcess`; empty where nothing."""
    return table.attrs.get("known_excess") or material.spec.known_excess or {}


def known_limit(known: Mapping[str, Any], theta_i_deg: Axis) -> Axis:
    """What an albedo may be: 1 up to an angle, and a published excess from there on."""
    one = np.full(theta_i_deg.size, 1.0 + ENERGY_TOLERANCE)
    return np.where(theta_i_deg >= known["from_theta_i_deg"], known["max_albedo"], one) if known else one
