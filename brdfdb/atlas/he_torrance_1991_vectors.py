"""Failures of forms of He et al. 1991: names and units, polarisation, vectors, sums of the parts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from brdfdb.atlas._errors import (
    BY_KEY,
    CLOSED,
    DISTANCES,
    LIGHT,
    OFF_LIGHT,
    TRUTH,
    VIEWER,
    Drawing,
    Form,
    directions,
    misprint,
    of_misprint,
    sweep,
    wrong,
    zero,
)
from brdfdb.figure import Figure
from brdfdb.reference import he_torrance_1991, mp

_MIRROR = 1e-3, 1e4  # n and k


# Vectors


def _jones(theta_i: float, phi_i: float, theta_r: float, phi_r: float, *, n: float, k: float) -> Any:
    """Return the Jones matrix [1]."""
    return he_torrance_1991.jones(theta_i, theta_r, mp.mpf(phi_r) - mp.mpf(phi_i), n, k)


def _geometry(theta_i: float, phi_i: float, theta_r: float, phi_r: float) -> Any:
    """Return G [1] of eq. 76 without its factor that is 1."""
    theta_i, theta_r, delta_phi = mp.mpf(theta_i), mp.mpf(theta_r), mp.mpf(phi_r) - mp.mpf(phi_i)
    v_z = mp.cos(theta_i) + mp.cos(theta_r)
    v_xy2 = mp.sin(theta_i) ** 2 + mp.sin(theta_r) ** 2
    v_xy2 += 2 * mp.sin(theta_i) * mp.sin(theta_r) * mp.cos(delta_phi)
    return ((v_xy2 + v_z**2) / v_z) ** 2


def _around_the_normal(key: str, title: str, note: str = "") -> tuple[str, Drawing]:
    """Return key and drawing of a misprint of the Jones matrix, over the azimuth of the viewer."""
    return misprint(
        key,
        title,
        np.linspace(5.0, 175.0, 35),
        "viewer's azimuth from the light's [degrees]",
        lambda x: {"phi_r": np.deg2rad(x)},
        _jones,
        caption="Light at 50 degrees, viewer at 30, a perfect mirror: the 2x2 matrix of amplitudes, over its largest. "
        f"{note}{TRUTH}",
    )


def four_dot_products() -> Figure:
    """Draw the errors of G towards backscatter and towards the normal."""
    entry = BY_KEY["four-dot-products"]
    forms = [wrong(entry, "dot products"), Form("ours", "ours", entry.corrected)]
    back = sweep(
        DISTANCES,
        f"{OFF_LIGHT} (1e-13: 0)",
        lambda x: directions(40.0, 40.0 + np.rad2deg(zero(x)), np.rad2deg(zero(x))),
        _geometry,
        forms,
        title="towards backscatter, at 40 degrees",
        log_x=True,
    )
    normal = sweep(
        DISTANCES,
        "light and viewer [radians from the normal] (1e-13: 0)",
        lambda x: directions(0.0, 0.0, 90.0) | dict.fromkeys(("theta_i", "theta_r"), zero(x)),
        _geometry,
        forms,
        title="towards the normal",
        log_x=True,
    )
    caption = f"The factor G of eq. 76. {TRUTH}"
    title = "Four dot products over a cross product"
    return of_misprint(entry.key, title, caption, [back, normal], within=CLOSED)


# The whole


def _smooth(theta_i: float, *, n: float, k: float, wavelength_nm: float) -> Any:
    """Return the specular reflectance [1] of a smooth surface."""
    return he_torrance_1991.specular_reflectance(theta_i, wavelength_nm, 0, 1, n, k)


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


FIGURES: dict[str, Callable[[], Figure]] = dict(
    (
        misprint(
            "hemispherical-for-bidirectional",
            "The curves of Figs 7 to 10 are those of rho_bd",
            np.linspace(0.0, 85.0, 18),
            VIEWER,
            lambda theta: directions(45.0, theta, 180.0),
            _over_the_mirror_direction,
            caption="Aluminum of Fig. 8, light at 45 degrees, 500 nm: the drawn value, 1 in the mirror direction. "
            f"rho_hd is the directional albedo of the viewer's direction. {TRUTH}",
        ),
        misprint(
            "uniform-diffuse-without-pi",
            "An albedo is no BRDF",
            np.linspace(0.05, 1.0, 20),
            "a(lambda)",
            lambda a: {"a": a},
            he_torrance_1991.uniform_diffuse,
            caption=f"The uniform diffuse part. {TRUTH}",
        ),
        _around_the_normal("one-matrix-for-two", "Incident light in the plane of incidence"),
        misprint(
            "two-pi-in-the-cone",
            "Light that a mirror sends into its cone",
            np.linspace(0.0, 85.0, 18),
            LIGHT,
            lambda theta: {"theta_i": np.deg2rad(theta)},
            _smooth,
            caption=f"A smooth surface, n of 1.5: the specular reflectance. {TRUTH}",
        ),
        misprint(
            "amplitudes-over-cross-product",
            "Amplitudes at backscatter: 0 over 0",
            DISTANCES,
            f"{OFF_LIGHT} (1e-13: 0, backscatter)",
            lambda x: {"theta_r": np.deg2rad(40.0) + zero(x), "phi_r": zero(x)},
            _jones,
            caption="Light and viewer at 40 degrees, n of 1.5: the 2x2 matrix of amplitudes, over its largest. "
            f"{TRUTH}",
            log_x=True,
        ),
        _around_the_normal("sign-of-m-ps", "The sign of M_ps"),
        misprint(
            "intensities-without-shadowing",
            "Shadowed parts do not shine",
            np.linspace(0.0, 89.5, 30),
            LIGHT,
            lambda theta: directions(theta, 40.0, 180.0),
            _perfect_mirror,
            caption=f"Aluminum of Fig. 8 as a perfect mirror, seen from 40 degrees, 500 nm: f_r. {TRUTH}",
        ),
        misprint(
            "squares-without-moduli",
            "A reflectance is no complex number",
            np.linspace(0.0, 89.0, 30),
            "angle of incidence [degrees]",
            lambda theta: {"cos_theta": np.cos(np.deg2rad(theta))},
            he_torrance_1991.fresnel_unpolarised,
            caption=f"Aluminum at 500 nm: |F|^2 of unpolarised light. {TRUTH}",
        ),
        ("four-dot-products", four_dot_products),
        misprint(
            "v-without-wave-number",
            "The unit of v",
            np.linspace(0.0, 85.0, 35),
            VIEWER,
            lambda theta: directions(0.0, theta, 0.0),
            _perfect_mirror,
            caption=f"Aluminum of Fig. 8 as a perfect mirror, light along the normal, 500 nm: f_r. {TRUTH}",
        ),
        _around_the_normal(
            "local-normal-for-z", "The normal that defines s and p", "G of eq. 76 has the same value with either. "
        ),
    )
)
