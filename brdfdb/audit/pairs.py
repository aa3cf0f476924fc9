"""Pairs of directions at which a table is looked up, with light and viewer exchanged, too."""

from __future__ import annotations

from typing import NamedTuple

from brdfdb import accuracy
from brdfdb.albedo import wavelengths_of
from brdfdb.lookup import Table
from brdfdb.materials import Material
from brdfdb.parameters import Floats

SEED = 1994
_LOOKED_UP = 250  # directions of each band of theta_i, half of them in the lobe, where values are looked at


class LookedUp(NamedTuple):
    """Values of f_r between the nodes: with light and viewer exchanged, too."""

    forward: Floats
    backward: Floats


def look_up(table: Table, material: Material) -> LookedUp:
    """f_r, shape (N, L), of pairs of directions above the horizon, half of them in the lobe."""
    drawn = accuracy.draw(material, table.wavelength_nm, _LOOKED_UP, SEED)
    wi, wr = drawn.wi[drawn.above], drawn.wr[drawn.above]
    shape = (len(wi), wavelengths_of(table))
    return LookedUp(table.lookup_vectors(wi, wr).reshape(shape), table.lookup_vectors(wr, wi).reshape(shape))
