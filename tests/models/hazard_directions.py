"""Corners of the directions, and the directions beside them."""

from typing import NamedTuple

import numpy as np

HALF_PI, PI = np.pi / 2, np.pi


class Directions(NamedTuple):
    """Polar angles and azimuths [rad] of light (i) and viewer (r)."""

    theta_i: float
    phi_i: float
    theta_r: float
    phi_r: float


EXACT = {
    "ordinary": Directions(0.5, 0.3, 0.9, 2.0),
    "normal": Directions(0.0, 0.0, 0.0, 0.0),
    "normal light": Directions(0.0, 0.7, 0.6, 2.0),
    "as good as normal light": Directions(1e-323, 0.7, 0.6, 2.0),
    "normal viewer": Directions(0.6, 0.7, 0.0, 2.0),
    "backscatter": Directions(0.5, 0.0, 0.5, 0.0),
    "backscatter, turned": Directions(1.2, 0.7, 1.2, 0.7),
    "mirror": Directions(0.5, 0.0, 0.5, PI),
    "mirror, turned": Directions(1.2, 0.7, 1.2, 0.7 + PI),
    "light at 90": Directions(HALF_PI, 0.0, 0.4, 2.0),
    "light at 90, back": Directions(HALF_PI, 0.0, 0.4, 0.0),
    "viewer at 90": Directions(0.4, 0.3, HALF_PI, 1.0),
    "viewer at 90, mirror": Directions(0.4, 0.0, HALF_PI, PI),
    "both at 90, back": Directions(HALF_PI, 0.0, HALF_PI, 0.0),
    "both at 90, mirror": Directions(HALF_PI, 0.0, HALF_PI, PI),
    "both at 90, across": Directions(HALF_PI, 0.0, HALF_PI, HALF_PI),
    "both at 90, oblique": Directions(HALF_PI, 0.0, HALF_PI, 2.9),
}
# what is moved, away from its corner; both azimuth differences
MOVES = ((1, 0, 0, 0), (0, 0, 1, 0), (1, 0, 1, 0), (0, 0, 0, 1), (0, 0, 0, -1), (1, 0, 1, 1))
DISTANCES = (1e-9, 1e-12)


def moved(directions: Directions, move: tuple[int, ...], distance: float) -> Directions:
    inward = (-1.0 if directions.theta_i > 1.5 else 1.0, 1.0, -1.0 if directions.theta_r > 1.5 else 1.0, 1.0)
    return Directions(*(x + m * s * distance for x, m, s in zip(directions, move, inward, strict=True)))


NEAR = [
    moved(directions, move, DISTANCES[(i + j) % 2])
    for i, directions in enumerate(EXACT.values())
    for j, move in enumerate(MOVES)
]
SOME = [EXACT[name] for name in ("normal", "backscatter", "mirror", "viewer at 90", "both at 90, oblique")]
FEW = [EXACT["normal"], Directions(0.0, 0.0, HALF_PI, 0.0)]  # exact in every form: the twin is asked once
