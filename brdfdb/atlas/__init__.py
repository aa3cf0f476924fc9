"""Places where methods fail: our forms of the models and others, against high-precision values and closed forms."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from brdfdb.atlas import energy, he_torrance_1991, hot_spots, oren_nayar_1994, ward_1992
from brdfdb.figure import Figure

ATLAS: Mapping[str, Callable[[], Figure]] = {
    **energy.FIGURES,
    **oren_nayar_1994.FIGURES,
    **he_torrance_1991.FIGURES,
    **ward_1992.FIGURES,
    **hot_spots.FIGURES,
}
