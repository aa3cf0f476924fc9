"""Failures at hot spots: the models of Rahman 1993 and Lucht 2000 where light and viewer nearly meet."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from brdfdb import models
from brdfdb.atlas._errors import CLOSED, OFF_LIGHT, TRUTH, ComparedForm, FormSweep, figure, of_vectors
from brdfdb.figure import Figure
from brdfdb.reference import lucht_2000, rahman_1993

LIGHT_DEG = 85.0  # angle of incidence, at which squares of tangents cancel over two digits sooner than at 30
DISTANCES = np.logspace(-12.0, -1.0, 45)  # of the viewer from the light [rad]
SAVANNA = {"rho_0": 0.06, "k": 0.7, "asymmetry": -0.2, "rho_c": 0.06}
LEAVES = {"f_iso": 0.3, "f_vol": 0.2, "f_geo": 0.01}


def _beside(distance: float) -> dict[str, Any]:
    """Return the angles [rad] of a viewer whose polar angle differs from that of the light by a distance [rad]."""
    theta = np.deg2rad(LIGHT_DEG)
    return {"theta_i": theta, "phi_i": 0.0, "theta_r": theta - distance, "phi_r": 0.0}


def _distance2(theta_i: float, theta_r: float, delta_phi: float) -> Any:
    """Return the square of the distance [1] of the two tangents, as the papers write it."""
    tan_i, tan_r = np.tan(theta_i), np.tan(theta_r)
    return tan_i**2 + tan_r**2 - 2.0 * tan_i * tan_r * np.cos(delta_phi)


def _rpv_plainly(
    theta_i: float,
    phi_i: float,
    theta_r: float,
    phi_r: float,
    *,
    rho_0: float,
    k: float,
    asymmetry: float,
    rho_c: float,
) -> Any:
    """Return f_r [1/sr] of RPV by the formulas of the paper in float64."""
    cos_i = np.cos(theta_i)
    cos_r = np.cos(theta_r)
    delta_phi = phi_r - phi_i
    cos_g = cos_i * cos_r + np.sin(theta_i) * np.sin(theta_r) * np.cos(delta_phi)
    F = (1.0 - asymmetry**2) / (1.0 + asymmetry**2 + 2.0 * asymmetry * cos_g) ** 1.5
    G = np.sqrt(_distance2(theta_i, theta_r, delta_phi))
    return rho_0 / np.pi * (cos_i * cos_r * (cos_i + cos_r)) ** (k - 1.0) * F * (1.0 + (1.0 - rho_c) / (1.0 + G))


def _ross_li_plainly(
    theta_i: float, phi_i: float, theta_r: float, phi_r: float, *, f_iso: float, f_vol: float, f_geo: float
) -> Any:
    """Return f_r [1/sr] of the Ross-Li kernels by the formulas of the papers in float64."""
    cos_i = np.cos(theta_i)
    cos_r = np.cos(theta_r)
    delta_phi = phi_r - phi_i
    cos_xi = cos_i * cos_r + np.sin(theta_i) * np.sin(theta_r) * np.cos(delta_phi)
    xi = np.arccos(cos_xi)
    sec = 1.0 / cos_i + 1.0 / cos_r
    k_vol = ((np.pi / 2.0 - xi) * cos_xi + np.sin(xi)) / (cos_i + cos_r) - np.pi / 4.0
    across = np.tan(theta_i) * np.tan(theta_r) * np.sin(delta_phi)
    t = np.arccos(np.minimum(1.0, 2.0 * np.sqrt(_distance2(theta_i, theta_r, delta_phi) + across**2) / sec))
    overlap = (t - np.sin(t) * np.cos(t)) * sec / np.pi
    k_geo = overlap - sec + (1.0 + cos_xi) / (2.0 * cos_i * cos_r)
    return (f_iso + f_vol * k_vol + f_geo * k_geo) / np.pi


def rpv_hot_spot() -> Figure:
    """Draw the hot spot of RPV, whose distance of tangents is a difference of squares."""

    def truth(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, **parameters: float) -> Any:
        return rahman_1993.rpv(theta_i, theta_r, phi_r - phi_i, **parameters)

    sweep = FormSweep(DISTANCES, OFF_LIGHT, lambda x: _beside(x) | SAVANNA, truth, log_x=True)
    forms = [
        ComparedForm("tan^2 + tan^2 - 2 tan tan cos", "textbook", _rpv_plainly),
        ComparedForm("ours, angles", "ours", models.rpv),
        ComparedForm("ours, unit vectors", "ours", of_vectors(models.rpv_vectors)),
    ]
    title = "The hot spot is a distance, and not a difference of squares"
    caption = (
        f"Light at {LIGHT_DEG:g} degrees, viewer beside it: f_r. The sum of squares is rounded and may be below 0. "
        f"Where it should be 0, its root is off by 1e-8 tan(theta). {TRUTH}"
    )
    panels = [sweep.panel(forms)]
    return figure("rpv-hot-spot", "rahman1993", "the function G", title, caption, panels, within=CLOSED)


def ross_li_hot_spot() -> Figure:
    """Draw the kernels of Ross and Li near the light, where the phase angle is the arccosine of a rounded 1."""

    def truth(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, **weights: float) -> Any:
        return lucht_2000.ross_li(theta_i, theta_r, phi_r - phi_i, **weights)

    sweep = FormSweep(DISTANCES, OFF_LIGHT, lambda x: _beside(x) | LEAVES, truth, log_x=True)
    forms = [
        ComparedForm("phase angle by its cosine", "textbook", _ross_li_plainly),
        ComparedForm("ours, angles", "ours", models.ross_li),
        ComparedForm("ours, unit vectors", "ours", of_vectors(models.ross_li_vectors)),
    ]
    title = "The arccosine of more than 1"
    caption = (
        f"Light at {LIGHT_DEG:g} degrees, viewer beside it: f_r. The cosine of the phase angle may be rounded to more "
        f"than 1, and the distance of the tangents is a difference of squares. {TRUTH}"
    )
    panels = [sweep.panel(forms)]
    return figure("ross-li-hot-spot", "lucht2000", "the kernels", title, caption, panels, within=CLOSED)


FIGURES: dict[str, Callable[[], Figure]] = {"rpv-hot-spot": rpv_hot_spot, "ross-li-hot-spot": ross_li_hot_spot}
