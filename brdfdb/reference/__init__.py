"""Slow, literal transcriptions of the papers' equations at 40 digits: what the tests measure `brdfdb.models` against.

One module a paper, with the same stems as `brdfdb.models` and no code in common with it. All functions are scalar, take
int, float, str or mpf (a str is read as the exact decimal) and return an mpf of 40 digits, or a tuple or matrix of
them; ``float()`` makes it a float64. (`oren_nayar_1994.gaussian` and `he_torrance_1991_aperture.aperture_diffuse`,
integrals over two and four angles, are float64 throughout.)

Angles are radians, ``delta_phi = phi_r - phi_i`` with 0 back towards the light and pi the mirror half plane; values are
f_r in 1/sr without a cosine. Directions are meant above the horizon, theta in [0, pi/2]: nothing is clipped or checked
here. Where a paper is misprinted the corrected equation stands, and the docstring says so.

Importing `brdfdb` imports neither this package nor mpmath: `brdfdb.atlas` and the tests do.
"""

from typing import Any

import mpmath

Number = Any  # int, float, str or mpf; mpmath ships no types

mp = mpmath.MPContext()  # a context of its own: the caller's mpmath.mp.dps is neither read nor changed
mp.dps = 40
