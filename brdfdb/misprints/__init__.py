"""Misprints, ambiguities and unsafe forms of the three papers: each beside the right form, and nothing else.

The models hold only the right forms. The printed forms are kept in this package, literal and short, for the atlas. No
other room of the library uses them. Angles are radians, and lengths of the surface micrometres. A BRDF is f_r in 1/sr,
by the conventions of `brdfdb.geometry`. Division by zero gives inf or nan, as in print.
"""

from brdfdb.misprints import he_torrance_1991, oren_nayar_1994, ward_1992
from brdfdb.misprints._entry import HE, ORENNAYAR, WARD, Kind, Misprint

__all__ = ["HE", "MISPRINTS", "ORENNAYAR", "WARD", "Kind", "Misprint"]

MISPRINTS: tuple[Misprint, ...] = (*oren_nayar_1994.ENTRIES, *he_torrance_1991.ENTRIES, *ward_1992.ENTRIES)
