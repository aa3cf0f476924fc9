"""Ward 1992: slices of f_r through the plane of incidence, and the widths of a lobe."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.geometry import HALF_PI, degrees, radians
from brdfdb.materials import Material

Array = NDArray[np.float64]

ALONG_X, ALONG_Y = 0.0, HALF_PI  # azimuths [rad] of light in the planes along x and y
PLANES = (("x", ALONG_X), ("y", ALONG_Y))
VIEWERS_DEG = np.arange(-88.0, 88.5, 1.0)
ANGLE = "theta_r [degree], negative: back towards the light"
BRDF = "f_r [1/sr]"
SLICES_DEG = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0)
ROUNDING = 1e-13  # relative difference of forms that are equal by algebra
WIDTH = 0.005  # relative error of half widths, which are read from a grid of 0.01 degrees


def f_r_of(material: Material, theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike) -> Array:
    """Return f_r [1/sr] of a material for angles [rad]."""
    value = material.spec.evaluate(theta_i, phi_i, theta_r, phi_r, **material.arguments())
    return np.asarray(value, dtype=np.float64)


def slice_of(material: Material, theta_i_deg: float, phi_i: float, viewers_deg: Array = VIEWERS_DEG) -> Array:
    """Return f_r [1/sr] in the plane of incidence; angles of viewers are negative on the side of the light."""
    phi_r = np.where(viewers_deg < 0.0, phi_i, phi_i + np.pi)
    return f_r_of(material, radians(theta_i_deg), phi_i, radians(np.abs(viewers_deg)), phi_r)


def in_form(model: str, material: Material) -> Material:
    """Return a material with the same parameters in another form."""
    return material.model_copy(update={"model": model})


def isotropic(material: Material) -> Material:
    """Return the material of eq. 4 with the same peak: alpha is the geometric mean."""
    alpha = float(np.sqrt(material.numbers["alpha_x"] * material.numbers["alpha_y"]))
    return material.model_copy(update={"parameters": {**material.numbers, "alpha_x": alpha, "alpha_y": alpha}})


def diffuse(material: Material) -> float:
    """Return the diffuse part [1/sr] of f_r."""
    return material.numbers["rho_d"] / np.pi


def half_width_deg(material: Material, phi: float) -> float:
    """Return the angle [degree] at which the lobe of light along the normal falls to half its peak."""
    viewers_deg = np.linspace(0.0, 60.0, 6001)
    lobe = slice_of(material, 0.0, phi, viewers_deg) - diffuse(material)
    return float(viewers_deg[np.argmax(lobe < 0.5 * lobe[0])])


def _expected_half_width_deg(alpha: float) -> float:
    """Return theta_r [degree] where eq. 5a, lit along the normal, has half its peak, for one alpha.

    There exp(-tan^2(delta) / alpha^2) is sqrt(cos(theta_r)) / 2, with theta_r = 2 delta. Iteration solves this.
    """
    theta_r = 0.0
    for _ in range(8):
        theta_r = 2.0 * np.arctan(alpha * np.sqrt(np.log(2.0) - 0.5 * np.log(np.cos(theta_r))))
    return float(degrees(theta_r))


def half_widths_deg(material: Material) -> tuple[list[float], list[float]]:
    """Return the half widths [degree] of the lobe along x and y: as measured, and as expected from alpha."""
    expected = [_expected_half_width_deg(material.numbers[f"alpha_{axis}"]) for axis, _ in PLANES]
    return [half_width_deg(material, phi) for _, phi in PLANES], expected


def parameters_text(material: Material) -> str:
    """Return the parameters of a material as captions write them."""
    p = material.numbers
    return (
        f"{material.title}: rho_d = {p['rho_d']:g}, rho_s = {p['rho_s']:g}, "
        f"alpha_x = {p['alpha_x']:g}, alpha_y = {p['alpha_y']:g} (section 6)"
    )
