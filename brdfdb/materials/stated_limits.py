"""The limits of validity that a paper states for its model, judged for a material."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import counted
from brdfdb.materials.material import Material
from brdfdb.parameters import Standing, StatedLimit

_WORDS: dict[Standing, str] = {
    "outside": "not met",
    "at the edge": "at the edge",
    "unknown": "not known",
    "inside": "met",
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
    """Return whether a material is within the limits of its paper, or the limits of each standing."""
    count = len(standings)
    if not standings:
        return "the paper states no limits"
    if all(standing == "inside" for standing in standings):
        limits = {1: "the limit", 2: "both limits"}.get(count, f"all {count} limits")
        return f"within {limits} that the paper states"
    return f"{counted(count, 'limit')} that the paper states: {', '.join(dict(counts_of(standings)).values())}"
