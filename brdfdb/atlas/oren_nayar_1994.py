"""Failures of forms of Oren and Nayar 1994: cavities, slopes, and the fit below zero and next to the horizon."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from brdfdb import models
from brdfdb.atlas._errors import BY_KEY, LIGHT, SINGLE, TRUTH, ComparedForm, FormSweep, directions, figure, misprint
from brdfdb.figure import Figure
from brdfdb.misprints import ORENNAYAR
from brdfdb.reference import mp, oren_nayar_1994
from brdfdb.reference.torrance_sparrow_1967 import torrance_sparrow

SLOPES = 1e-6  # Relative error that the models promise for integrals over slopes. Worst measured: 7.8e-15

_LIGHT_AND_VIEWER = "light and viewer [degrees from the normal]"
_ANGLES = np.linspace(0.0, 85.0, 35)  # [degree]
_FEW_ANGLES = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0]  # [degree] for truths that are double integrals
_HORIZON = 1e-17  # drawn for a cosine of 0 on a logarithmic axis


def _cavity(part: int) -> Callable[..., Any]:
    """Return the function of the direct (0) or interreflected (1) f_r [1/sr] of one cavity."""

    def truth(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, rho: float, theta_a: float, phi_a: float) -> Any:
        return oren_nayar_1994.unidirectional(theta_i, phi_i, theta_r, phi_r, rho, theta_a, phi_a)[part]

    return truth


_gaussian = functools.cache(oren_nayar_1994.gaussian)  # a value takes 0.5 s, and two figures share their directions


def _slopes(part: int) -> Callable[..., Any]:
    """Return the function of the direct (0) or interreflected (1) f_r [1/sr] of Gaussian slopes."""

    def truth(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, rho: float, sigma: float) -> Any:
        return _gaussian(float(theta_i), float(theta_r), float(phi_r - phi_i), rho, sigma)[part]

    return truth


def _fit(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, rho: Any, sigma: Any) -> Any:
    """Return f_r [1/sr] of eq. 29, held at 0 where the fit is below."""
    theta_i, theta_r, delta_phi = map(float, (theta_i, theta_r, phi_r - phi_i))  # mpmath does not know float32
    return max(mp.zero, sum(oren_nayar_1994.functional(theta_i, theta_r, delta_phi, rho, sigma)))


def _fit_of_vectors(wi: Any, wr: Any, *, rho: float, sigma: float) -> Any:
    """Return f_r [1/sr] of eq. 29 for unit vectors, held at 0 where the fit is below."""
    (theta_i, phi_i), (theta_r, phi_r) = (
        # At 90 degrees f_r is the limit from below
        (min(mp.atan2(mp.hypot(x, y), z), mp.mpf(np.pi / 2)), mp.atan2(y, x))
        for x, y, z in (map(mp.mpf, wi), map(mp.mpf, wr))
    )
    return max(mp.zero, sum(oren_nayar_1994.functional(theta_i, theta_r, phi_r - phi_i, rho, sigma)))


def _towards_the_horizon(x: float) -> dict[str, Any]:
    """Return opposite unit vectors of light and viewer with the cosine x [1]."""
    cosine = 0.0 if x == _HORIZON else x
    sine = float(np.sqrt((1.0 - cosine) * (1.0 + cosine)))
    return {"wi": [sine, 0.0, cosine], "wr": [-sine, 0.0, cosine]}


def _towel(theta_i: float, phi_i: float, theta_r: float, phi_r: float, *, e_0: float) -> Any:
    """Return f_r [1/sr] of the towel of Fig. 20, which does not depend on the irradiance e_0."""
    sigma = np.deg2rad(42.0)
    weights = {"k_b": 1, "k_s": mp.mpf(0.085) / mp.mpf(np.pi)}
    body, _, surface = oren_nayar_1994.body_surface(theta_i, theta_r, phi_r - phi_i, 0.75, sigma, **weights)
    return body + surface + 0 * e_0


def fit_in_float32() -> Figure:
    """Draw the fit for angles of 32 bits: the cancellation begins eight digits earlier in 32-bit arithmetic."""

    def arguments(angle: float) -> dict[str, Any]:
        theta = np.float32(np.pi / 2 - angle)
        pair = {"theta_i": theta, "phi_i": np.float32(0), "theta_r": theta, "phi_r": np.float32(np.pi)}
        return pair | {"rho": 0.5, "sigma": 0.5}

    return figure(
        "oren-nayar-float32",
        ORENNAYAR,
        "eqs 27-29",
        "Angles of 32 bits next to the horizon",
        "Light and viewer opposite, rho 0.5, sigma 0.5: f_r for angles of 32 bits. Truth: 40 digits, at those angles.",
        [
            FormSweep(
                np.logspace(0.0, -6.5, 27), "light and viewer [radians above the horizon]", arguments, _fit, log_x=True
            ).panel(
                [
                    ComparedForm("eq. 29 in float32", "textbook", BY_KEY["fit-below-zero"].as_printed),
                    ComparedForm("ours, float32 in and out", "ours", models.oren_nayar),
                ]
            )
        ],
        within=SINGLE,
    )


FIGURES: dict[str, Callable[[], Figure]] = dict(
    (
        misprint(
            "gaf-of-the-larger",
            "Shadowing and masking: the smaller of the two",
            FormSweep(
                _ANGLES, _LIGHT_AND_VIEWER, lambda theta: directions(theta, theta, 180.0), _cavity(0), scale=1.0 / np.pi
            ),
            caption="Cavities with slopes of 45 degrees, light and viewer opposite: direct part of f_r. The error is "
            "over that of Lambert, 1 / pi, because the right value is 0 beyond 45 degrees. " + TRUTH,
        ),
        misprint(
            "shadowed-facet",
            "Radiance of a shadowed facet",
            FormSweep(_ANGLES, LIGHT, lambda theta: directions(theta, 20.0, 0.0), _cavity(0)),
            caption=f"Cavities with slopes of 45 degrees, seen from 20 degrees: direct part of f_r. {TRUTH}",
        ),
        misprint(
            "visible-and-masked-widths",
            "The second bounce: widths that are masked",
            FormSweep(_ANGLES, LIGHT, lambda theta: directions(theta, 20.0, 0.0), _cavity(1)),
            caption=f"Cavities with slopes of 45 degrees, seen from 20 degrees: interreflected part of f_r. {TRUTH}",
        ),
        misprint(
            "normalised-over-the-hemisphere",
            "Slopes are distributed over slopes",
            FormSweep(
                _FEW_ANGLES, LIGHT, lambda theta: directions(theta, 0.0, 0.0) | {"sigma": np.deg2rad(30.0)}, _slopes(0)
            ),
            caption="Seen along the normal, sigma of 30 degrees: direct part of f_r. Truth: the double integral, to "
            "1e-11.",
            within=SLOPES,
        ),
        misprint(
            "fit-below-zero",
            "The fit falls below zero",
            FormSweep(
                np.linspace(40.0, 89.5, 34),
                _LIGHT_AND_VIEWER,
                lambda theta: directions(theta, theta, 180.0),
                _fit,
                scale=0.1 / np.pi,
            ),
            caption="Light and viewer opposite, sigma of 60 degrees, rho of 0.1. The error of f_r is over rho / pi, "
            f"because the right value is 0 where the fit is below. {TRUTH}",
        ),
        misprint(
            "tangent-at-grazing",
            "0 times infinity on the horizon",
            FormSweep(
                [*np.logspace(-0.5, -16.0, 32), _HORIZON],
                "cosine of light and viewer (1e-17: 0, the horizon)",
                _towards_the_horizon,
                _fit_of_vectors,
                log_x=True,
            ),
            caption="Opposite unit vectors of light and viewer: f_r for sigma of 0.5. "
            f"The difference in C_2 cancels as tan(beta) grows. {TRUTH}",
        ),
        misprint(
            "surface-radiance-as-brdf",
            "A radiance is no BRDF",
            FormSweep(
                np.linspace(0.0, 89.0, 30),
                LIGHT,
                lambda theta: directions(theta, 30.0, 180.0),
                lambda theta_i, phi_i, theta_r, phi_r, sigma: torrance_sparrow(theta_i, theta_r, phi_r - phi_i, sigma),
            ),
            caption=f"Facets with sigma of 20 degrees, seen from 30 degrees in the mirror half plane: f_r. {TRUTH}",
        ),
        misprint(
            "surface-without-e-0",
            "A surface that does not follow the light",
            FormSweep(
                np.logspace(0.0, 1.0, 21),
                "E_0, in the unit of the radiance of eq. 31",
                lambda e_0: {"e_0": e_0},
                _towel,
                log_x=True,
            ),
            caption="The towel of Fig. 20, light at 60 degrees, viewer at 70 opposite: f_r = L_r / (E_0 cos(theta_i)) "
            f"in more and more light. Ours is scaled for E_0 = pi, where the two agree. {TRUTH}",
        ),
        misprint(
            "interreflection-factor",
            "Eq. 48 in place of eq. 47",
            FormSweep(_FEW_ANGLES, LIGHT, lambda theta: directions(theta, 0.0, 0.0), _slopes(1)),
            caption="Seen along the normal, sigma of 30 degrees: interreflected part of f_r. "
            "Truth: the double integral, to 1e-11.",
            within=SLOPES,
        ),
        ("oren-nayar-float32", fit_in_float32),
    )
)
