"""Slow, literal transcriptions of the papers' equations at 40 digits, the references in tests of `brdfdb.models`.

Each paper has one module, with the name of its module in `brdfdb.models` and no code in common with it. All functions
are scalar. They take int, float, str or mpf (a str is read as the exact decimal) and return an mpf of 40 digits, or a
tuple or matrix of them; ``float()`` makes it a float64. `oren_nayar_1994.gaussian` and
`he_torrance_1991.aperture_diffuse`, integrals over two and four angles, are float64 throughout.

Angles are radians. ``delta_phi = phi_r - phi_i`` is 0 back towards the light and pi in the mirror half plane. Values
are f_r in 1/sr without a cosine. Directions must be above the horizon, theta in [0, pi/2]: nothing is clipped or
checked here. Misprinted equations are corrected, and the docstring states the correction.

Importing `brdfdb` imports neither this package nor mpmath. `brdfdb.atlas` and the tests import them.
"""

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import mpmath

P = ParamSpec("P")
R = TypeVar("R")

Number = Any  # int, float, str or mpf; mpmath ships no types

mp = mpmath.MPContext()  # a separate context, so that the caller's mpmath.mp.dps is neither read nor changed
mp.dps = 40


def exact(function: Callable[P, R]) -> Callable[P, R]:
    """Return a function whose arguments become mpf, each as the number that it stands for; None remains."""

    def number(value: Any) -> Any:
        return None if value is None else mp.mpf(value)

    @functools.wraps(function)
    def converted(*arguments: P.args, **named: P.kwargs) -> R:
        exact_arguments: Any = map(number, arguments)
        exact_named: Any = {name: number(value) for name, value in named.items()}
        return function(*exact_arguments, **exact_named)

    return converted
