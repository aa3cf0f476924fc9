"""Failures of forms of He et al. 1991: sum of eq. 78, its limit, shadowing, eq. 81, and the vectors of eqs 61-86."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from brdfdb import fresnel, models
from brdfdb.atlas._errors import (
    BY_KEY,
    CLOSED,
    DISTANCES,
    LIGHT,
    OFF_LIGHT,
    ROLES,
    SINGLE,
    TRUTH,
    VIEWER,
    ComparedForm,
    ErrorPanel,
    FormSweep,
    directions,
    error_map,
    errors,
    figure,
    misprint,
    of_misprint,
    of_vectors,
    wrong,
    zero,
)
from brdfdb.figure import Figure
from brdfdb.geometry import unit_vector
from brdfdb.misprints import HE
from brdfdb.models._diffraction_series import diffraction_series
from brdfdb.reference import he_torrance_1991, mp

SERIES = 1e-11  # Relative error of eq. 78 that `diffraction_series` promises. Worst measured: 8.3e-13

_HORIZON = 1e-17  # drawn for a cosine of 0 on a logarithmic axis
_GLOSSY = {"wavelength_nm": 500.0, "sigma_0_um": 0.1, "tau_um": 1.5, "n": 1.5, "k": 0.0}

_MIRROR = 1e-3, 1e4  # n and k


# Vectors


def _jones(theta_i: float, phi_i: float, theta_r: float, phi_r: float, *, n: float, k: float) -> Any:
    """Return the Jones matrix [1]."""
    return he_torrance_1991.jones(theta_i, theta_r, mp.mpf(phi_r) - mp.mpf(phi_i), n, k)


def _geometry(theta_i: float, phi_i: float, theta_r: float, phi_r: float) -> Any:
    """Return G [1] of eq. 76 without its factor that is 1."""
    theta_i = mp.mpf(theta_i)
    theta_r = mp.mpf(theta_r)
    delta_phi = mp.mpf(phi_r) - mp.mpf(phi_i)
    v_z = mp.cos(theta_i) + mp.cos(theta_r)
    v_xy2 = mp.sin(theta_i) ** 2 + mp.sin(theta_r) ** 2
    v_xy2 += 2 * mp.sin(theta_i) * mp.sin(theta_r) * mp.cos(delta_phi)
    return ((v_xy2 + v_z**2) / v_z) ** 2


def _around_the_normal(key: str, title: str, note: str = "") -> tuple[str, Callable[[], Figure]]:
    """Return key and drawing of a misprint of the Jones matrix, over the azimuth of the viewer."""
    return misprint(
        key,
        title,
        FormSweep(
            np.linspace(5.0, 175.0, 35),
            "viewer's azimuth from the light's [degrees]",
            lambda x: {"phi_r": np.deg2rad(x)},
            _jones,
        ),
        caption="Light at 50 degrees, viewer at 30, a perfect mirror: the 2x2 matrix of amplitudes, over its largest. "
        f"{note}{TRUTH}",
    )


def four_dot_products() -> Figure:
    """Draw the errors of G towards backscatter and towards the normal."""
    entry = BY_KEY["four-dot-products"]
    forms = [wrong(entry, "dot products"), ComparedForm("ours", "ours", entry.corrected)]
    back = FormSweep(
        DISTANCES,
        f"{OFF_LIGHT} (1e-13: 0)",
        lambda x: directions(40.0, 40.0 + np.rad2deg(zero(x)), np.rad2deg(zero(x))),
        _geometry,
        title="towards backscatter, at 40 degrees",
        log_x=True,
    ).panel(forms)
    normal = FormSweep(
        DISTANCES,
        "light and viewer [radians from the normal] (1e-13: 0)",
        lambda x: directions(0.0, 0.0, 90.0) | dict.fromkeys(("theta_i", "theta_r"), zero(x)),
        _geometry,
        title="towards the normal",
        log_x=True,
    ).panel(forms)
    caption = f"The factor G of eq. 76. {TRUTH}"
    title = "Four dot products over a cross product"
    return of_misprint(entry.key, title, caption, [back, normal], within=CLOSED)


# The whole


def _over_the_mirror_direction(theta_i: float, phi_i: float, theta_r: float, phi_r: float, **surface: float) -> Any:
    """Return the directional diffuse f_r [1] over its value in the mirror direction."""
    values = [surface[name] for name in ("wavelength_nm", "sigma_0_um", "tau_um", "n", "k")]
    seen, specular = (
        he_torrance_1991.directional_diffuse(theta_i, theta, mp.mpf(azimuth), *values)
        for theta, azimuth in ((theta_r, phi_r - phi_i), (theta_i, np.pi))
    )
    return seen / specular


def _perfect_mirror(
    theta_i: Any,
    phi_i: Any,
    theta_r: Any,
    phi_r: Any,
    *,
    wavelength_nm: float,
    sigma_0_um: float,
    tau_um: float,
) -> Any:
    """Return f_r [1/sr] of eq. 71 with abs(F)^2 = 1: the reflectance of a good mirror is divided out."""
    angles = mp.mpf(theta_i), mp.mpf(theta_r), mp.mpf(phi_r) - mp.mpf(phi_i)
    cosines, sines = (f(angles[0]) * f(angles[1]) for f in (mp.cos, mp.sin))
    half = mp.sqrt((1 + cosines + sines * mp.cos(angles[2])) / 2)
    f_r = he_torrance_1991.directional_diffuse(*angles, wavelength_nm, sigma_0_um, tau_um, *_MIRROR)
    return f_r / he_torrance_1991.fresnel_unpolarised(half, *_MIRROR)


@functools.cache
def _sum(g: float, V: float) -> Any:
    """Return the sum of eq. 78 without its factor [1]; kept because several figures need it, slow where g is large."""
    return he_torrance_1991.series(g, V)


def _ours(g: float, V: float) -> Any:
    """Return the sum of eq. 78 [1] by our series."""
    return g * diffraction_series(np.asarray(g), np.asarray(V))


def _all_terms(g: Any, V: Any) -> Any:
    """Return the sum of eq. 78 [1] as many programs have it, in the type of g.

    Each term is computed from the term before, and the first one from e^-g.
    """
    one = type(g)(1)
    poisson = np.exp(-g)
    total = 0 * g
    if poisson > 0:  # If e^-g underflows, all terms are 0
        for m in range(1, 2 * int(g) + 100):
            poisson = poisson * g / (m * one)
            total = total + poisson / (m * one) * np.exp(-V / (m * one))
    return total


def _corrected_limit(g: float, V: float) -> Any:
    """Return Beckmann's limit of eq. 78 [1] with the term of first order in 1 / g."""
    b = V / g
    return np.exp(-b) / g * (1.0 + (b**2 / 2.0 - 2.0 * b + 1.0) / g)


# Eq. 78


def ten_terms() -> Figure:
    """Draw the sum of eq. 78 by ten terms, by all terms and by our series, over g and over V."""
    entry = BY_KEY["ten-terms"]
    forms = [
        wrong(entry, "ten terms"),
        ComparedForm("all terms, from e^-g on", "textbook", _all_terms),
        ComparedForm("ours", "ours", _ours),
    ]
    over_g = FormSweep(
        np.logspace(-6.0, 6.0, 25), "g", lambda g: {"g": g, "V": 0.0}, _sum, title="V = 0", log_x=True
    ).panel(forms)
    over_V = FormSweep(
        np.logspace(-2.0, 3.0, 21), "V", lambda V: {"g": 2.0, "V": V}, _sum, title="g = 2", log_x=True
    ).panel(forms)
    caption = f"The sum of eq. 78. {TRUTH}"
    title = "Ten terms of a sum that needs thousands"
    return of_misprint(entry.key, title, caption, [over_g, over_V], within=SERIES)


def beckmanns_limit() -> Figure:
    """Draw the sum of eq. 78 against its limit for large g, at three ratios V / g."""
    entry = BY_KEY["beckmanns-limit"]
    forms = [
        wrong(entry, "Beckmann's limit"),
        ComparedForm("the limit, corrected to first order", "textbook", _corrected_limit),
        ComparedForm("ours", "ours", _ours),
    ]

    def panel(b: float) -> ErrorPanel:
        title = f"V / g = {b:g}"
        return FormSweep(
            np.logspace(0.0, 5.0, 21), "g", lambda g: {"g": g, "V": b * g}, _sum, title=title, log_x=True
        ).panel(forms)

    panels = [panel(0.0), panel(1.0), panel(8.0)]
    caption = f"The sum of eq. 78 against its limit for large g, b = V / g. {TRUTH}"
    return of_misprint(entry.key, "When is g large?", caption, panels, within=SERIES)


def large_g() -> Figure:
    """Draw the errors of three methods for eq. 78 as maps over g and V."""
    g, V = np.logspace(-5.0, 4.0, 19), np.logspace(-1.0, 3.0, 7)
    rows = [{"g": x, "V": y} for y in V for x in g]
    truths = [float(_sum(**row)) for row in rows]
    forms = [
        wrong(BY_KEY["ten-terms"], "ten terms"),
        wrong(BY_KEY["beckmanns-limit"], "Beckmann's limit"),
        ComparedForm("ours", "ours", _ours),
    ]
    maps = [error_map(g, V, form, errors(form.evaluate, rows, truths), x_label="g", y_label="V") for form in forms]
    caption = f"The sum of eq. 78 by three methods. {TRUTH}"
    title = "The sum over roughness g and lateral phase V"
    return figure("he-torrance-large-g", HE, "eq. 78", title, caption, maps, within=SERIES)


# Shadowing, and eq. 81


def _shadowing_over_cosine(cos_theta: float, slope: float) -> Any:
    """Return S_1 / cos(theta) [1] of one direction; on the horizon it is a limit."""
    if cos_theta == 0.0:
        return mp.sqrt(mp.pi) / (2 * mp.mpf(slope))
    return he_torrance_1991.shadowing(mp.acos(cos_theta), slope, 1) / mp.mpf(cos_theta)


def shadowing_divided_by_cosines() -> Figure:
    """Draw S_1 / cos(theta) towards the horizon, and on it over the slope."""
    entry = BY_KEY["shadowing-divided-by-cosines"]
    forms = [wrong(entry), ComparedForm("ours", "ours", entry.corrected)]
    towards_horizon = FormSweep(
        [*np.logspace(-0.1, -16.0, 32), _HORIZON],
        "cosine of the direction (1e-17: 0, the horizon)",
        lambda x: {"cos_theta": 0.0 if x == _HORIZON else x, "slope": entry.where["slope"]},
        _shadowing_over_cosine,
        title="towards the horizon, aluminum of Fig. 8",
        log_x=True,
    ).panel(forms)
    on_horizon = FormSweep(
        np.logspace(-3.0, 1.0, 21),
        "sigma_0 / tau",
        lambda slope: {"cos_theta": 0.0, "slope": slope},
        _shadowing_over_cosine,
        title="on the horizon",
        log_x=True,
    ).panel(forms)
    caption = f"S_1 / cos(theta) of one direction. {TRUTH} On the horizon: the limit sqrt(pi) tau / (2 sigma_0)."
    title = "0 over 0 on the horizon"
    return of_misprint(entry.key, title, caption, [towards_horizon, on_horizon], within=CLOSED)


def root_search() -> Figure:
    """Draw the effective roughness of eq. 80 by Newton's search and by Lambert's W."""
    entry = BY_KEY["root-search"]

    def roughness(height: Callable[..., Any]) -> Callable[..., Any]:
        return lambda **arguments: 1.0 / np.sqrt(1.0 + height(**arguments) ** 2)

    forms = [
        ComparedForm("Newton's search", ROLES[entry.kind], roughness(entry.as_printed)),
        ComparedForm("Lambert's W, ours", "ours", roughness(entry.corrected)),
    ]

    def panel(slope: float) -> ErrorPanel:
        return FormSweep(
            np.logspace(1.5, -3.0, 30),
            "light and viewer [degrees above the horizon]",
            lambda x: dict.fromkeys(("theta_i", "theta_r"), np.deg2rad(90.0 - x)) | {"slope": slope},
            lambda theta_i, theta_r, slope: he_torrance_1991.effective_roughness(theta_i, theta_r, slope, 1) / slope,
            title=f"sigma_0 / tau = {slope:g}",
            log_x=True,
        ).panel(forms)

    panels = [panel(0.16), panel(1.0)]
    caption = f"The effective roughness sigma / sigma_0 of eq. 80. {TRUTH}"
    title = "A root search that oscillates"
    return of_misprint(entry.key, title, caption, panels, within=CLOSED)


# The whole


def plainly() -> Figure:
    """Draw eq. 71 by the right equations, evaluated as they stand, towards four corners."""
    forms = [
        ComparedForm("as the equations stand", "textbook", _plainly),
        ComparedForm("ours, angles", "ours", models.he_torrance),
        ComparedForm("ours, unit vectors", "ours", of_vectors(models.he_torrance_vectors)),
    ]

    def towards(title: str, x_label: str, pair: Callable[[float], dict[str, Any]]) -> ErrorPanel:
        return FormSweep(
            DISTANCES,
            f"{x_label} (1e-13: 0)",
            lambda x: pair(zero(x)) | _GLOSSY | {"wavelength_nm": 2000.0},
            _directional,
            title=title,
            log_x=True,
        ).panel(forms)

    def angles(theta_i: float, theta_r: float, phi_r: float) -> dict[str, Any]:
        return {"theta_i": theta_i, "phi_i": 0.0, "theta_r": theta_r, "phi_r": phi_r}

    panels = [
        towards("grazing", "viewer [radians above the horizon]", lambda x: angles(0.6, np.pi / 2 - x, 2.0)),
        towards("backscatter", OFF_LIGHT, lambda x: angles(0.6, 0.6 + x, x)),
        towards("normal incidence", "light [radians from the normal]", lambda x: angles(x, 0.3, 0.0)),
        FormSweep(
            np.logspace(3.5, 1.5, 21),
            "wavelength [nm]",
            lambda wavelength: angles(0.6, 0.7, 3.0) | _GLOSSY | {"wavelength_nm": wavelength},
            _directional,
            title="short waves, large g",
            log_x=True,
        ).panel(forms),
    ]
    caption = (
        "Directional diffuse part, sigma_0 of 0.1 um, tau of 1.5 um, n of 1.5; 2000 nm except in the last panel. As "
        "the equations stand: dot products for G, S over cosines, Newton's search for z_0, ten terms of the sum. "
        + TRUTH
    )
    title = "The right equations, evaluated as they stand"
    return figure("he-torrance-plainly", HE, "eqs 71-86", title, caption, panels, within=CLOSED)


def _directional(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, **surface: float) -> Any:
    """Return the directional diffuse f_r [1/sr] by the reference."""
    angles = float(theta_i), float(theta_r), mp.mpf(float(phi_r)) - mp.mpf(float(phi_i))
    return he_torrance_1991.directional_diffuse(*angles, *(surface[name] for name in _GLOSSY))


def _plainly(
    theta_i: Any,
    phi_i: Any,
    theta_r: Any,
    phi_r: Any,
    *,
    total: Callable[[Any, Any], Any] = BY_KEY["ten-terms"].as_printed,
    **surface: float,
) -> Any:
    """Return the directional diffuse f_r [1/sr] by eqs 71 to 86 as they stand; `total` is the sum of eq. 78."""
    wavelength = surface["wavelength_nm"] / 1000.0
    sigma_0_um = surface["sigma_0_um"]
    tau_um = surface["tau_um"]
    slope = sigma_0_um / tau_um
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
    return fresnel.unpolarised(np.linalg.norm(v) / 2.0, surface["n"], surface["k"]) / np.pi * G * light * viewer * D


def in_float32() -> Figure:
    """Draw f_r for angles of 32 bits: e^-g underflows at g of 104 in 32-bit arithmetic."""

    def arguments(wavelength: float) -> dict[str, Any]:
        angles = {"theta_i": 0.6, "phi_i": 0.0, "theta_r": 0.7, "phi_r": 3.0}
        return {name: np.float32(x) for name, x in angles.items()} | _GLOSSY | {"wavelength_nm": wavelength}

    def plainly_in_float32(**given: Any) -> Any:
        return _plainly(**given, total=lambda g, V: _all_terms(np.float32(g), np.float32(V)))

    return figure(
        "he-torrance-float32",
        HE,
        "eq. 78",
        "e^-g in 32 bits",
        "Directional diffuse part, sigma_0 of 0.1 um, tau of 1.5 um, n of 1.5, angles of 32 bits. "
        "Truth: 40 digits, at those angles.",
        [
            FormSweep(np.logspace(3.5, 1.5, 21), "wavelength [nm]", arguments, _directional, log_x=True).panel(
                [
                    ComparedForm("all terms, in float32", "textbook", plainly_in_float32),
                    ComparedForm("ours, float32 in and out", "ours", models.he_torrance),
                ]
            )
        ],
        within=SINGLE,
    )


FIGURES: dict[str, Callable[[], Figure]] = dict(
    (
        misprint(
            "hemispherical-for-bidirectional",
            "The curves of Figs 7 to 10 are those of rho_bd",
            FormSweep(
                np.linspace(0.0, 85.0, 18),
                VIEWER,
                lambda theta: directions(45.0, theta, 180.0),
                _over_the_mirror_direction,
            ),
            caption="Aluminum of Fig. 8, light at 45 degrees, 500 nm: the drawn value, 1 in the mirror direction. "
            f"rho_hd is the directional albedo of the viewer's direction. {TRUTH}",
        ),
        misprint(
            "uniform-diffuse-without-pi",
            "An albedo is no BRDF",
            FormSweep(np.linspace(0.05, 1.0, 20), "a(lambda)", lambda a: {"a": a}, he_torrance_1991.uniform_diffuse),
            caption=f"The uniform diffuse part. {TRUTH}",
        ),
        _around_the_normal("one-matrix-for-two", "Incident light in the plane of incidence"),
        misprint(
            "two-pi-in-the-cone",
            "Light that a mirror sends into its cone",
            FormSweep(
                np.linspace(0.0, 85.0, 18),
                LIGHT,
                lambda theta: {"theta_i": np.deg2rad(theta)},
                lambda theta_i, n, k, wavelength_nm: he_torrance_1991.specular_reflectance(
                    theta_i, wavelength_nm, 0, 1, n, k
                ),
            ),
            caption=f"A smooth surface, n of 1.5: the specular reflectance. {TRUTH}",
        ),
        misprint(
            "amplitudes-over-cross-product",
            "Amplitudes at backscatter: 0 over 0",
            FormSweep(
                DISTANCES,
                f"{OFF_LIGHT} (1e-13: 0, backscatter)",
                lambda x: {"theta_r": np.deg2rad(40.0) + zero(x), "phi_r": zero(x)},
                _jones,
                log_x=True,
            ),
            caption="Light and viewer at 40 degrees, n of 1.5: the 2x2 matrix of amplitudes, over its largest. "
            f"{TRUTH}",
        ),
        _around_the_normal("sign-of-m-ps", "The sign of M_ps"),
        misprint(
            "intensities-without-shadowing",
            "Shadowed parts do not shine",
            FormSweep(np.linspace(0.0, 89.5, 30), LIGHT, lambda theta: directions(theta, 40.0, 180.0), _perfect_mirror),
            caption=f"Aluminum of Fig. 8 as a perfect mirror, seen from 40 degrees, 500 nm: f_r. {TRUTH}",
        ),
        misprint(
            "squares-without-moduli",
            "A reflectance is no complex number",
            FormSweep(
                np.linspace(0.0, 89.0, 30),
                "angle of incidence [degrees]",
                lambda theta: {"cos_theta": np.cos(np.deg2rad(theta))},
                he_torrance_1991.fresnel_unpolarised,
            ),
            caption=f"Aluminum at 500 nm: |F|^2 of unpolarised light. {TRUTH}",
        ),
        ("four-dot-products", four_dot_products),
        misprint(
            "v-without-wave-number",
            "The unit of v",
            FormSweep(np.linspace(0.0, 85.0, 35), VIEWER, lambda theta: directions(0.0, theta, 0.0), _perfect_mirror),
            caption=f"Aluminum of Fig. 8 as a perfect mirror, light along the normal, 500 nm: f_r. {TRUTH}",
        ),
        _around_the_normal(
            "local-normal-for-z", "The normal that defines s and p", "G of eq. 76 has the same value with either. "
        ),
        ("shadowing-divided-by-cosines", shadowing_divided_by_cosines),
        misprint(
            "lambda-without-gaussian",
            "Smith's Lambda has a Gaussian",
            FormSweep(
                np.linspace(30.0, 89.9, 40),
                "direction [degrees from the normal]",
                lambda theta: {"theta": np.deg2rad(theta)},
                lambda theta, slope: he_torrance_1991.shadowing(theta, slope, 1),
            ),
            caption=f"Shadowing S_1 of one direction, sigma_0 / tau of 0.16. {TRUTH}",
        ),
        ("ten-terms", ten_terms),
        ("beckmanns-limit", beckmanns_limit),
        ("root-search", root_search),
        ("he-torrance-large-g", large_g),
        ("he-torrance-plainly", plainly),
        ("he-torrance-float32", in_float32),
    )
)
