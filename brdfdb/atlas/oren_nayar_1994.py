"""Where forms of Oren and Nayar 1994 fail: cavities, slopes, the fit below zero and next to the horizon."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from brdfdb import models
from brdfdb.atlas._errors import BY_KEY, Form, directions, figure, misprint, sweep
from brdfdb.figure import Figure
from brdfdb.misprints import ORENNAYAR
from brdfdb.reference import mp, oren_nayar_1994
from brdfdb.reference.torrance_sparrow_1967 import torrance_sparrow

CLOSED = 1e-10  # closed forms, as the models promise; worst measured: 9.9e-16
SLOPES = 1e-6  # integrals over slopes, as promised; worst measured: 7.8e-15
SINGLE = 2e-5  # of float32, as promised; worst measured: 4.4e-8

_THETA_I = "light and viewer [degrees from the normal]"
_LIGHT = "light [degrees from the normal]"
_TRUTH = "Truth: 40 digits."


def _cavity(part: int) -> Callable[..., Any]:
    def truth(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, rho: float, theta_a: float, phi_a: float) -> Any:
        return oren_nayar_1994.unidirectional(theta_i, phi_i, theta_r, phi_r, rho, theta_a, phi_a)[part]

    return truth


@functools.cache
def _gaussian(theta_i: float, theta_r: float, delta_phi: float, rho: float, sigma: float) -> tuple[float, float]:
    """Half a second each; the two figures that ask share their directions."""
    return oren_nayar_1994.gaussian(theta_i, theta_r, delta_phi, rho, sigma)


def _slopes(part: int) -> Callable[..., Any]:
    def truth(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, rho: float, sigma: float) -> Any:
        return _gaussian(float(theta_i), float(theta_r), float(phi_r - phi_i), rho, sigma)[part]

    return truth


def _fit(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, rho: Any, sigma: Any) -> Any:
    """Eq. 29, held at 0 where the fit is below."""
    theta_i, theta_r, delta_phi = map(float, (theta_i, theta_r, phi_r - phi_i))  # mpmath does not know float32
    return max(mp.zero, sum(oren_nayar_1994.functional(theta_i, theta_r, delta_phi, rho, sigma)))


def _fit_of_vectors(wi: Any, wr: Any, *, rho: float, sigma: float) -> Any:
    (theta_i, phi_i), (theta_r, phi_r) = (
        # at 90 degrees the limit from below
        (min(mp.atan2(mp.hypot(x, y), z), mp.mpf(np.pi / 2)), mp.atan2(y, x))
        for x, y, z in (map(mp.mpf, wi), map(mp.mpf, wr))
    )
    return max(mp.zero, sum(oren_nayar_1994.functional(theta_i, theta_r, phi_r - phi_i, rho, sigma)))


def gaf_of_the_larger() -> Figure:
    return misprint(
        "gaf-of-the-larger",
        "Shadowing and masking: the smaller of the two",
        np.linspace(0.0, 85.0, 35),
        _THETA_I,
        lambda theta: directions(theta, theta, 180.0),
        _cavity(0),
        caption="Cavities of slopes of 45 degrees, light and viewer opposite: direct part of f_r, its error over that "
        f"of Lambert, 1 / pi, for beyond 45 degrees the right value is 0. {_TRUTH}",
        within=CLOSED,
        scale=1.0 / np.pi,
    )


def shadowed_facet() -> Figure:
    return misprint(
        "shadowed-facet",
        "What a shadowed facet shows",
        np.linspace(0.0, 85.0, 35),
        _LIGHT,
        lambda theta: directions(theta, 20.0, 0.0),
        _cavity(0),
        caption=f"Cavities of slopes of 45 degrees, seen from 20: direct part of f_r. {_TRUTH}",
        within=CLOSED,
    )


def visible_and_masked_widths() -> Figure:
    return misprint(
        "visible-and-masked-widths",
        "The second bounce: widths that are masked",
        np.linspace(0.0, 85.0, 35),
        _LIGHT,
        lambda theta: directions(theta, 20.0, 0.0),
        _cavity(1),
        caption=f"Cavities of slopes of 45 degrees, seen from 20: interreflected part of f_r. {_TRUTH}",
        within=CLOSED,
    )


def normalised_over_the_hemisphere() -> Figure:
    return misprint(
        "normalised-over-the-hemisphere",
        "Slopes are distributed over slopes",
        [0.0, 15.0, 30.0, 45.0, 60.0, 75.0],
        _LIGHT,
        lambda theta: directions(theta, 0.0, 0.0) | {"sigma": np.deg2rad(30.0)},
        _slopes(0),
        caption="Seen along the normal, sigma of 30 degrees: direct part of f_r. Truth: the double integral, to 1e-11.",
        within=SLOPES,
    )


def interreflection_factor() -> Figure:
    return misprint(
        "interreflection-factor",
        "Eq. 48 in place of eq. 47",
        [0.0, 15.0, 30.0, 45.0, 60.0, 75.0],
        _LIGHT,
        lambda theta: directions(theta, 0.0, 0.0),
        _slopes(1),
        caption="Seen along the normal, sigma of 30 degrees: interreflected part of f_r. "
        "Truth: the double integral, to 1e-11.",
        within=SLOPES,
    )


def fit_below_zero() -> Figure:
    return misprint(
        "fit-below-zero",
        "The fit falls below zero",
        np.linspace(40.0, 89.5, 34),
        _THETA_I,
        lambda theta: directions(theta, theta, 180.0),
        _fit,
        caption="Light and viewer opposite, sigma of 60 degrees, rho of 0.1: error of f_r over rho / pi, for the right "
        f"value is 0 where the fit is below. {_TRUTH}",
        within=CLOSED,
        scale=0.1 / np.pi,
    )


def tangent_at_grazing() -> Figure:
    horizon = 1e-17

    def both(x: float) -> dict[str, Any]:
        cosine = 0.0 if x == horizon else x
        sine = float(np.sqrt((1.0 - cosine) * (1.0 + cosine)))
        return {"wi": [sine, 0.0, cosine], "wr": [-sine, 0.0, cosine]}

    return misprint(
        "tangent-at-grazing",
        "0 times infinity on the horizon",
        [*np.logspace(-0.5, -16.0, 32), horizon],
        "cosine of light and viewer (1e-17: 0, the horizon)",
        both,
        _fit_of_vectors,
        caption="Unit vectors of light and viewer, opposite: f_r of sigma 0.5. "
        f"The difference in C_2 cancels as tan(beta) grows. {_TRUTH}",
        within=CLOSED,
        log_x=True,
    )


def surface_radiance_as_brdf() -> Figure:
    def truth(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, sigma: float) -> Any:
        return torrance_sparrow(theta_i, theta_r, phi_r - phi_i, sigma)

    return misprint(
        "surface-radiance-as-brdf",
        "A radiance is no BRDF",
        np.linspace(0.0, 89.0, 30),
        _LIGHT,
        lambda theta: directions(theta, 30.0, 180.0),
        truth,
        caption=f"Facets of sigma 20 degrees, seen from 30 degrees in the mirror half plane: f_r. {_TRUTH}",
        within=CLOSED,
    )


def surface_without_e_0() -> Figure:
    def truth(theta_i: float, phi_i: float, theta_r: float, phi_r: float, *, e_0: float) -> Any:
        sigma, weights = np.deg2rad(42.0), {"k_b": 1, "k_s": mp.mpf(0.085) / mp.mpf(np.pi)}
        body, _, surface = oren_nayar_1994.body_surface(theta_i, theta_r, phi_r - phi_i, 0.75, sigma, **weights)
        return body + surface + 0 * e_0

    return misprint(
        "surface-without-e-0",
        "A surface that does not follow the light",
        np.logspace(0.0, 1.0, 21),
        "E_0, in the unit of the radiance of eq. 31",
        lambda e_0: {"e_0": e_0},
        truth,
        caption="The towel of Fig. 20, light at 60 degrees, viewer at 70 opposite: f_r = L_r / (E_0 cos(theta_i)) in "
        f"more and more light. Ours is scaled for E_0 = pi, where the two agree. {_TRUTH}",
        within=CLOSED,
        log_x=True,
    )


def fit_in_float32() -> Figure:
    """Angles of 32 bits: the same cancellation eight digits earlier, unless arithmetic is of 64."""

    def both(angle: float) -> dict[str, Any]:
        theta = np.float32(np.pi / 2 - angle)
        return {"theta_i": theta, "phi_i": np.float32(0), "theta_r": theta, "phi_r": np.float32(np.pi)} | {
            "rho": 0.5,
            "sigma": 0.5,
        }

    distances = np.logspace(0.0, -6.5, 27)
    forms = [
        Form("eq. 29 in float32", "textbook", BY_KEY["fit-below-zero"].as_printed),
        Form("ours, float32 in and out", "ours", models.oren_nayar),
    ]
    panel = sweep(distances, "light and viewer [radians above the horizon]", both, _fit, forms, log_x=True)
    caption = (
        "Light and viewer opposite, rho 0.5, sigma 0.5: f_r of angles of 32 bits. Truth: 40 digits, at those angles."
    )
    title = "Angles of 32 bits next to the horizon"
    return figure("oren-nayar-float32", ORENNAYAR, "eqs 27-29", title, caption, [panel], within=SINGLE)


FIGURES: dict[str, Callable[[], Figure]] = {
    "gaf-of-the-larger": gaf_of_the_larger,
    "shadowed-facet": shadowed_facet,
    "visible-and-masked-widths": visible_and_masked_widths,
    "normalised-over-the-hemisphere": normalised_over_the_hemisphere,
    "fit-below-zero": fit_below_zero,
    "tangent-at-grazing": tangent_at_grazing,
    "surface-radiance-as-brdf": surface_radiance_as_brdf,
    "surface-without-e-0": surface_without_e_0,
    "interreflection-factor": interreflection_factor,
    "oren-nayar-float32": fit_in_float32,
}
