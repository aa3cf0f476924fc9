"""The limits of validity that a paper states for its model, judged for a material."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import counted
from brdfdb.materials.material import Material
from brdfdb.parameters import Standing, StatedLimit

_WORDS: dict[Standing, str] = {
    "outside": "not kept",
    "at the edge": "at the edge",
    "unknown": "not known",
    "inside": "kept",
}


def limits_of(material: Material, wavelength_nm: NDArray[np.float64] | None) -> list[StatedLimit]:
    """Return the limits of the model of a material, judged at wavelengths [nm] if it is spectral."""
    stated = material.spec.limits
    return [] if stated is None else list(stated(material.arguments(wavelength_nm)))


def counts_of(standings: Sequence[Standing]) -> Iterator[tuple[Standing, str]]:
    """Yield the standings that occur, the worst first, with the number of limits of each in words."""
    for standing, words in _WORDS.items():
        if standing in standings:
            yield standing, f"{standings.count(standing)} {words}"


def in_words(standings: Sequence[Standing]) -> str:
    """Return the number of limits that are kept, at the edge and not kept, in a few words."""
    if not standings:
        return "its paper states no limits"
    return f"its paper states {counted(len(standings), 'limit')}: {', '.join(dict(counts_of(standings)).values())}"
