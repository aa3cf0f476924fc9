"""A model of somebody else's package: a made-up diffuser with a bright rim."""

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.geometry import Directions, checked_angles, checked_vectors, finished
from brdfdb.parameters import Floats, ModelSpec, Parameter

RHO = Parameter("rho", "ρ", "1", 0.0, 1.0, "level of the reflectance")
RIM = Parameter("rim", "r", "1", 0.0, 4.0, "brightness of the rim, which is absent at 0", default=0.0)
POWER = Parameter("power", "p", "1", 0.5, 4.0, "1 is a wide rim, 4 a narrow one")


def f_r(w: Directions, rho: ArrayLike, power: ArrayLike, rim: ArrayLike) -> Floats:
    """Return the values [1/sr] for checked directions."""
    slanted = ((1.0 - w.cos_i) * (1.0 - w.cos_r)) ** POWER.check(power)
    return finished(RHO.check(rho) / np.pi * (1.0 + RIM.check(rim) * slanted), w)


def rim_light(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *,
    rho: ArrayLike, power: ArrayLike, rim: ArrayLike = 0.0,
) -> Floats:  # fmt: skip
    """Return f_r [1/sr] at angles [rad]."""
    return f_r(checked_angles(theta_i, phi_i, theta_r, phi_r), rho, power, rim)


def rim_light_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, power: ArrayLike, rim: ArrayLike = 0.0
) -> Floats:
    """Return f_r [1/sr] at unit vectors (..., 3)."""
    return f_r(checked_vectors(wi, wr), rho, power, rim)


SPEC = ModelSpec(
    name="rim_light",
    version=1,
    title="Rim light",
    equation="made up",
    reference="none",
    parameters=(RHO, RIM, POWER),
    evaluate=rim_light,
    vectors=rim_light_vectors,
    excess="made up: with a rim it can reflect more than it receives",
)
