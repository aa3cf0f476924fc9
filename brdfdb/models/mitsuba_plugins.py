"""Models that Mitsuba has as plugins after ``import brdfdb.mitsuba``; this table is read without Mitsuba."""

from __future__ import annotations

# The plugin of each model, and whether its property `form` names the model
OF_MITSUBA: dict[str, tuple[str, bool]] = {
    "ward": ("brdfdb_ward", True),
    "ward_half_vector": ("brdfdb_ward", True),
    "ward_duer": ("brdfdb_ward", True),
    "ward_bounded": ("brdfdb_ward", True),
    "oren_nayar": ("brdfdb_oren_nayar", True),
    "oren_nayar_qualitative": ("brdfdb_oren_nayar", True),
    "oren_nayar_fujii": ("brdfdb_oren_nayar", True),
    "oren_nayar_energy_preserving": ("brdfdb_oren_nayar", True),
    "he_torrance": ("brdfdb_he_torrance", False),
    "minnaert": ("brdfdb_minnaert", False),
    "rpv": ("brdfdb_rpv", False),
    "ross_li": ("brdfdb_ross_li", False),
    "hapke": ("brdfdb_hapke", False),
    "abg": ("brdfdb_abg", False),
    "harvey_shack": ("brdfdb_harvey_shack", False),
}
