"""Where forms of He et al. 1991 fail: the sum of eq. 78, its limit, shadowing, eq. 81, and the vectors of eqs 61-86."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from brdfdb import fresnel, models
from brdfdb.atlas._errors import (
    BY_KEY,
    ROLES,
    Form,
    Measured,
    error_map,
    errors,
    figure,
    misprint,
    of_misprint,
    sweep,
    wrong,
)
from brdfdb.figure import Figure
from brdfdb.geometry import unit_vector
from brdfdb.misprints import HE
from brdfdb.models._diffraction_series import diffraction_series
from brdfdb.reference import he_torrance_1991, mp

CLOSED = 1e-10  # as the models promise; worst measured: 8.8e-13, with the sum of eq. 78, 8e-16 without
SERIES = 1e-11  # the sum of eq. 78, as `diffraction_series` promises; worst measured: 8.3e-13
SINGLE = 2e-5  # of float32, as promised; worst measured: 3.8e-8

_TRUTH = "Truth: 40 digits."
_CORNER = 1e-13  # drawn for 0 on a logarithmic axis
_BACK = "viewer off the light [radians]"
_DISTANCES = [*np.logspace(-0.5, -12.0, 24), _CORNER]
_GLOSSY = {"wavelength_nm": 500.0, "sigma_0_um": 0.1, "tau_um": 1.5, "n": 1.5, "k": 0.0}


def _zero(x: float) -> float:
    return 0.0 if x == _CORNER else x


@functools.cache
def _sum(g: float, V: float) -> Any:
    """Eq. 78 without its factor; dear where g is large, and asked for by several figures."""
    return he_torrance_1991.series(g, V)


def _ours(g: float, V: float) -> Any:
    return g * diffraction_series(np.asarray(g), np.asarray(V))


def _all_terms(g: Any, V: Any) -> Any:
    """Eq. 78 as many programs have it: each term from the one before, the first from e^-g; in the type of g."""
    one = type(g)(1)
    poisson, total = np.exp(-g), 0 * g
    if poisson > 0:  # else no term ever is
        for m in range(1, 2 * int(g) + 100):
            poisson = poisson * g / (m * one)
            total = total + poisson / (m * one) * np.exp(-V / (m * one))
    return total


def _all_terms_in_float32(g: Any, V: Any) -> Any:
    return _all_terms(np.float32(g), np.float32(V))


def _corrected_limit(g: float, V: float) -> Any:
    b = V / g
    return np.exp(-b) / g * (1.0 + (b**2 / 2.0 - 2.0 * b + 1.0) / g)


# Eq. 78


def ten_terms() -> Figure:
    entry = BY_KEY["ten-terms"]
    forms = [
        wrong(entry, "ten terms"),
        Form("all terms, from e^-g on", "textbook", _all_terms),
        Form("ours", "ours", _ours),
    ]
    over_g = sweep(
        np.logspace(-6.0, 6.0, 25), "g", lambda g: {"g": g, "V": 0.0}, _sum, forms, title="V = 0", log_x=True
    )
    over_V = sweep(
        np.logspace(-2.0, 3.0, 21), "V", lambda V: {"g": 2.0, "V": V}, _sum, forms, title="g = 2", log_x=True
    )
    caption = f"The sum of eq. 78. {_TRUTH}"
    title = "Ten terms of a sum that needs thousands"
    return of_misprint(entry.key, title, caption, [over_g, over_V], within=SERIES)


def beckmanns_limit() -> Figure:
    entry = BY_KEY["beckmanns-limit"]
    forms = [
        wrong(entry, "Beckmann's limit"),
        Form("the limit, corrected to first order", "textbook", _corrected_limit),
        Form("ours", "ours", _ours),
    ]

    def of(b: float) -> Measured:
        title = f"V / g = {b:g}"
        return sweep(
            np.logspace(0.0, 5.0, 21), "g", lambda g: {"g": g, "V": b * g}, _sum, forms, title=title, log_x=True
        )

    panels = [of(0.0), of(1.0), of(8.0)]
    caption = f"The sum of eq. 78 against its limit for large g, b = V / g. {_TRUTH}"
    return of_misprint(entry.key, "When is g large?", caption, panels, within=SERIES)


def large_g() -> Figure:
    """Maps over g and V."""
    g, V = np.logspace(-5.0, 4.0, 19), np.logspace(-1.0, 3.0, 7)
    rows = [{"g": x, "V": y} for y in V for x in g]
    truths = [float(_sum(**row)) for row in rows]
    forms = [
        wrong(BY_KEY["ten-terms"], "ten terms"),
        wrong(BY_KEY["beckmanns-limit"], "Beckmann's limit"),
        Form("ours", "ours", _ours),
    ]
    maps = [error_map(g, V, form, errors(form.evaluate, rows, truths), x_label="g", y_label="V") for form in forms]
    caption = f"The sum of eq. 78 by three methods. {_TRUTH}"
    title = "The sum over roughness g and lateral phase V"
    return figure("he-torrance-large-g", HE, "eq. 78", title, caption, maps, within=SERIES)


# Shadowing, and eq. 81


def lambda_without_gaussian() -> Figure:
    return misprint(
        "lambda-without-gaussian",
        "Smith's Lambda has a Gaussian",
        np.linspace(30.0, 89.9, 40),
        "direction [degrees from the normal]",
        lambda theta: {"theta": np.deg2rad(theta)},
        lambda theta, slope: he_torrance_1991.shadowing(theta, slope, 1),
        caption=f"Shadowing S_1 of one direction, sigma_0 / tau of 0.16. {_TRUTH}",
        within=CLOSED,
    )


def shadowing_divided_by_cosines() -> Figure:
    entry, horizon = BY_KEY["shadowing-divided-by-cosines"], 1e-17

    def truth(cos_theta: float, slope: float) -> Any:
        if cos_theta == 0.0:
            return mp.sqrt(mp.pi) / (2 * mp.mpf(slope))
        return he_torrance_1991.shadowing(mp.acos(cos_theta), slope, 1) / mp.mpf(cos_theta)

    forms = [wrong(entry), Form("ours", "ours", entry.corrected)]
    towards = sweep(
        [*np.logspace(-0.1, -16.0, 32), horizon],
        "cosine of the direction (1e-17: 0, the horizon)",
        lambda x: {"cos_theta": 0.0 if x == horizon else x, "slope": entry.where["slope"]},
        truth,
        forms,
        title="towards the horizon, aluminum of Fig. 8",
        log_x=True,
    )
    there = sweep(
        np.logspace(-3.0, 1.0, 21),
        "sigma_0 / tau",
        lambda slope: {"cos_theta": 0.0, "slope": slope},
        truth,
        forms,
        title="on the horizon",
        log_x=True,
    )
    caption = f"S_1 / cos(theta) of one direction. {_TRUTH} On the horizon: the limit sqrt(pi) tau / (2 sigma_0)."
    title = "0 over 0 on the horizon"
    return of_misprint(entry.key, title, caption, [towards, there], within=CLOSED)


def root_search() -> Figure:
    entry = BY_KEY["root-search"]

    def effective(height: Callable[..., Any]) -> Callable[..., Any]:
        return lambda **arguments: 1.0 / np.sqrt(1.0 + height(**arguments) ** 2)

    forms = [
        Form("Newton's search", ROLES[entry.kind], effective(entry.as_printed)),
        Form("Lambert's W, ours", "ours", effective(entry.corrected)),
    ]

    def of(slope: float) -> Measured:
        return sweep(
            np.logspace(1.5, -3.0, 30),
            "light and viewer [degrees above the horizon]",
            lambda x: dict.fromkeys(("theta_i", "theta_r"), np.deg2rad(90.0 - x)) | {"slope": slope},
            lambda theta_i, theta_r, slope: he_torrance_1991.effective_roughness(theta_i, theta_r, slope, 1) / slope,
            forms,
            title=f"sigma_0 / tau = {slope:g}",
            log_x=True,
        )

    panels = [of(0.16), of(1.0)]
    caption = f"The effective roughness sigma / sigma_0 of eq. 80. {_TRUTH}"
    title = "A root search that goes to and fro"
    return of_misprint(entry.key, title, caption, panels, within=CLOSED)


# The whole


def plainly() -> Figure:
    """Eq. 71 with the right equations, evaluated as they stand, towards four corners."""
    forms = [
        Form("as the equations stand", "textbook", _plainly),
        Form("ours, angles", "ours", models.he_torrance),
        Form("ours, unit vectors", "ours", _of_vectors),
    ]

    def towards(title: str, x_label: str, at: Callable[[float], dict[str, Any]]) -> Measured:
        return sweep(
            _DISTANCES,
            f"{x_label} (1e-13: 0)",
            lambda x: at(_zero(x)) | _GLOSSY | {"wavelength_nm": 2000.0},
            _directional,
            forms,
            title=title,
            log_x=True,
        )

    def angles(theta_i: float, theta_r: float, phi_r: float) -> dict[str, Any]:
        return {"theta_i": theta_i, "phi_i": 0.0, "theta_r": theta_r, "phi_r": phi_r}

    panels = [
        towards("grazing", "viewer [radians above the horizon]", lambda x: angles(0.6, np.pi / 2 - x, 2.0)),
        towards("backscatter", _BACK, lambda x: angles(0.6, 0.6 + x, x)),
        towards("normal incidence", "light [radians from the normal]", lambda x: angles(x, 0.3, 0.0)),
        sweep(
            np.logspace(3.5, 1.5, 21),
            "wavelength [nm]",
            lambda wavelength: angles(0.6, 0.7, 3.0) | _GLOSSY | {"wavelength_nm": wavelength},
            _directional,
            forms,
            title="short waves, large g",
            log_x=True,
        ),
    ]
    caption = (
        "Directional diffuse part, sigma_0 of 0.1 um, tau of 1.5 um, n of 1.5, 2000 nm but in the last panel. As the "
        "equations stand: dot products for G, S over cosines, Newton's search for z_0, ten terms of the sum. " + _TRUTH
    )
    title = "The right equations, evaluated as they stand"
    return figure("he-torrance-plainly", HE, "eqs 71-86", title, caption, panels, within=CLOSED)


def _directional(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, **surface: float) -> Any:
    angles = float(theta_i), float(theta_r), mp.mpf(float(phi_r)) - mp.mpf(float(phi_i))
    return he_torrance_1991.directional_diffuse(*angles, *(surface[name] for name in _GLOSSY))


def _of_vectors(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, **surface: float) -> Any:
    return models.he_torrance_vectors(unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r), **surface)


def _plainly(
    theta_i: Any,
    phi_i: Any,
    theta_r: Any,
    phi_r: Any,
    *,
    wavelength_nm: float,
    sigma_0_um: float,
    tau_um: float,
    n: float,
    k: float,
    total: Callable[[Any, Any], Any] = BY_KEY["ten-terms"].as_printed,
) -> Any:
    wavelength, slope = wavelength_nm / 1000.0, sigma_0_um / tau_um
    v = unit_vector(theta_i, phi_i) + unit_vector(theta_r, phi_r)
    # Eqs (79)-(81)
    z_0 = BY_KEY["root-search"].as_printed(theta_i, theta_r, slope)
    g = (2.0 * np.pi * sigma_0_um / wavelength * v[2]) ** 2 / (1.0 + z_0**2)
    # Eq. (78)
    V = (np.pi * tau_um / wavelength) ** 2 * (v[0] ** 2 + v[1] ** 2)
    D = (np.pi * tau_um / (2.0 * wavelength)) ** 2 * total(g, V)
    # Eqs (71), (75), (76)
    G = BY_KEY["four-dot-products"].as_printed(theta_i, phi_i, theta_r, phi_r)
    light, viewer = (
        BY_KEY["shadowing-divided-by-cosines"].as_printed(np.cos(theta), slope) for theta in (theta_i, theta_r)
    )
    return fresnel.unpolarised(np.linalg.norm(v) / 2.0, n, k) / np.pi * G * light * viewer * D


def in_float32() -> Figure:
    """Angles of 32 bits: e^-g underflows at g of 104, unless arithmetic is of 64."""

    def at(wavelength: float) -> dict[str, Any]:
        angles = {"theta_i": 0.6, "phi_i": 0.0, "theta_r": 0.7, "phi_r": 3.0}
        return {name: np.float32(x) for name, x in angles.items()} | _GLOSSY | {"wavelength_nm": wavelength}

    forms = [
        Form("all terms, in float32", "textbook", functools.partial(_plainly, total=_all_terms_in_float32)),
        Form("ours, float32 in and out", "ours", models.he_torrance),
    ]
    panel = sweep(np.logspace(3.5, 1.5, 21), "wavelength [nm]", at, _directional, forms, log_x=True)
    caption = (
        "Directional diffuse part, sigma_0 of 0.1 um, tau of 1.5 um, n of 1.5, angles of 32 bits. "
        "Truth: 40 digits, at those angles."
    )
    title = "e^-g in 32 bits"
    return figure("he-torrance-float32", HE, "eq. 78", title, caption, [panel], within=SINGLE)


FIGURES: dict[str, Callable[[], Figure]] = {
    "shadowing-divided-by-cosines": shadowing_divided_by_cosines,
    "lambda-without-gaussian": lambda_without_gaussian,
    "ten-terms": ten_terms,
    "beckmanns-limit": beckmanns_limit,
    "root-search": root_search,
    "he-torrance-large-g": large_g,
    "he-torrance-plainly": plainly,
    "he-torrance-float32": in_float32,
}
