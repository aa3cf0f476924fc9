"""Surfaces of He et al. 1991, the cones of the experiments, and directions over them."""

from typing import Any

import numpy as np

HALF_PI = np.pi / 2
ALUMINUM: dict[str, float] = {"sigma_0_um": 0.28, "tau_um": 1.77, "n": 0.769, "k": 6.08}
CERAMIC: dict[str, float] = {"wavelength_nm": 500.0, "sigma_0_um": 1.45, "tau_um": 13.2, "n": 1.74555, "k": 0.0}
CONE = np.pi / 1024  # of light and receiver, in the experiments of Figs 7 to 9
CONES = {"incident_solid_angle_sr": CONE, "received_solid_angle_sr": CONE}


def directions(rng: np.random.Generator, count: int) -> Any:
    return rng.uniform([0.0, -3.0, 0.0, -3.0], [HALF_PI, 3.0, HALF_PI, 3.0], (count, 4)).T
