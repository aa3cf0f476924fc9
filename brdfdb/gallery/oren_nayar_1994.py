"""The figures of Oren and Nayar 1994: a function by key."""

from __future__ import annotations

from collections.abc import Callable

from brdfdb.figure import Figure
from brdfdb.gallery import (
    oren_nayar_1994_approximations,
    oren_nayar_1994_computed,
    oren_nayar_1994_images,
    oren_nayar_1994_samples,
)

FIGURES: dict[str, Callable[[], Figure]] = {
    **oren_nayar_1994_computed.FIGURES,
    **oren_nayar_1994_approximations.FIGURES,
    **oren_nayar_1994_samples.FIGURES,
    **oren_nayar_1994_images.FIGURES,
}
