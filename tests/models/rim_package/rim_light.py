"""A model of somebody else's package: a made-up diffuser with a bright rim."""

import math

from brdfdb.models.declaration import DeclaredModel
from brdfdb.parameters import Parameter

RHO = Parameter("rho", "ρ", "1", 0.0, 1.0, "level of the reflectance")
RIM = Parameter("rim", "r", "1", 0.0, 4.0, "brightness of the rim, which is absent at 0", default=0.0)
POWER = Parameter("power", "p", "1", 0.5, 4.0, "1 is a wide rim, 4 a narrow one")


@DeclaredModel(
    title="Rim light",
    equation="made up",
    references="none",
    parameters=(RHO, RIM, POWER),
    excess="made up: with a rim it can reflect more than it receives",
)
def rim_light(cos_i: float, cos_r: float, rho: float, power: float, rim: float) -> float:
    """Return f_r [1/sr] of a diffuser with a bright rim."""
    return rho / math.pi * (1.0 + rim * ((1.0 - cos_i) * (1.0 - cos_r)) ** power)
