"""Places where forms of He et al. 1991 fail: names and units, polarisation, vectors, sums of the parts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from brdfdb.atlas._errors import BY_KEY, Form, directions, misprint, of_misprint, sweep, wrong
from brdfdb.figure import Figure
from brdfdb.reference import he_torrance_1991, mp

CLOSED = 1e-10  # as the models promise; worst measured: 8.8e-13, with the sum of eq. 78, 8e-16 without

_TRUTH = "Truth: 40 digits."
_CORNER = 1e-13  # drawn for 0 on a logarithmic axis
_BACK = "viewer off the light [radians]"
_LIGHT = "light [degrees from the normal]"
_DISTANCES = [*np.logspace(-0.5, -12.0, 24), _CORNER]
_MIRROR = 1e-3, 1e4  # n and k


def _zero(x: float) -> float:
    return 0.0 if x == _CORNER else x


# Vectors


def _jones(theta_i: float, phi_i: float, theta_r: float, phi_r: float, *, n: float, k: float) -> Any:
    return he_torrance_1991.jones(theta_i, theta_r, mp.mpf(phi_r) - mp.mpf(phi_i), n, k)


def _geometry(theta_i: float, phi_i: float, theta_r: float, phi_r: float) -> Any:
    """Eq. 76 without its factor that is 1."""
    theta_i, theta_r, delta_phi = mp.mpf(theta_i), mp.mpf(theta_r), mp.mpf(phi_r) - mp.mpf(phi_i)
    v_z = mp.cos(theta_i) + mp.cos(theta_r)
    v_xy2 = mp.sin(theta_i) ** 2 + mp.sin(theta_r) ** 2
    v_xy2 += 2 * mp.sin(theta_i) * mp.sin(theta_r) * mp.cos(delta_phi)
    return ((v_xy2 + v_z**2) / v_z) ** 2


def amplitudes_over_cross_product() -> Figure:
    return misprint(
        "amplitudes-over-cross-product",
        "Amplitudes at backscatter: 0 over 0",
        _DISTANCES,
        f"{_BACK} (1e-13: 0, backscatter)",
        lambda x: {"theta_r": np.deg2rad(40.0) + _zero(x), "phi_r": _zero(x)},
        _jones,
        caption=f"Light and viewer at 40 degrees, n of 1.5: the 2x2 matrix of amplitudes, over its largest. {_TRUTH}",
        within=CLOSED,
        log_x=True,
    )


def sign_of_m_ps() -> Figure:
    return misprint(
        "sign-of-m-ps",
        "The sign of M_ps",
        np.linspace(5.0, 175.0, 35),
        "viewer's azimuth from the light's [degrees]",
        lambda x: {"phi_r": np.deg2rad(x)},
        _jones,
        caption="Light at 50 degrees, viewer at 30, a perfect mirror: the 2x2 matrix of amplitudes, over its largest. "
        f"{_TRUTH}",
        within=CLOSED,
    )


def four_dot_products() -> Figure:
    entry = BY_KEY["four-dot-products"]
    forms = [wrong(entry, "dot products"), Form("ours", "ours", entry.corrected)]
    back = sweep(
        _DISTANCES,
        f"{_BACK} (1e-13: 0)",
        lambda x: directions(40.0, 40.0 + np.rad2deg(_zero(x)), np.rad2deg(_zero(x))),
        _geometry,
        forms,
        title="towards backscatter, at 40 degrees",
        log_x=True,
    )
    normal = sweep(
        _DISTANCES,
        "light and viewer [radians from the normal] (1e-13: 0)",
        lambda x: directions(0.0, 0.0, 90.0) | dict.fromkeys(("theta_i", "theta_r"), _zero(x)),
        _geometry,
        forms,
        title="towards the normal",
        log_x=True,
    )
    caption = f"The factor G of eq. 76. {_TRUTH}"
    title = "Four dot products over a cross product"
    return of_misprint(entry.key, title, caption, [back, normal], within=CLOSED)


def one_matrix_for_two() -> Figure:
    return misprint(
        "one-matrix-for-two",
        "Incident light in the plane of incidence",
        np.linspace(5.0, 175.0, 35),
        "viewer's azimuth from the light's [degrees]",
        lambda x: {"phi_r": np.deg2rad(x)},
        _jones,
        caption="Light at 50 degrees, viewer at 30, a perfect mirror: the 2x2 matrix of amplitudes, over its largest. "
        f"{_TRUTH}",
        within=CLOSED,
    )


def local_normal_for_z() -> Figure:
    return misprint(
        "local-normal-for-z",
        "Which normal has s and p",
        np.linspace(5.0, 175.0, 35),
        "viewer's azimuth from the light's [degrees]",
        lambda x: {"phi_r": np.deg2rad(x)},
        _jones,
        caption="Light at 50 degrees, viewer at 30, a perfect mirror: the 2x2 matrix of amplitudes, over its largest. "
        f"G of eq. 76 has the same value with either. {_TRUTH}",
        within=CLOSED,
    )


def squares_without_moduli() -> Figure:
    return misprint(
        "squares-without-moduli",
        "A reflectance is no complex number",
        np.linspace(0.0, 89.0, 30),
        "angle of incidence [degrees]",
        lambda theta: {"cos_theta": np.cos(np.deg2rad(theta))},
        he_torrance_1991.fresnel_unpolarised,
        caption=f"Aluminum at 500 nm: |F|^2 of unpolarised light. {_TRUTH}",
        within=CLOSED,
    )


# The whole


def two_pi_in_the_cone() -> Figure:
    def truth(theta_i: float, *, n: float, k: float, wavelength_nm: float) -> Any:
        return he_torrance_1991.specular_reflectance(theta_i, wavelength_nm, 0, 1, n, k)

    return misprint(
        "two-pi-in-the-cone",
        "What a mirror sends into its cone",
        np.linspace(0.0, 85.0, 18),
        _LIGHT,
        lambda theta: {"theta_i": np.deg2rad(theta)},
        truth,
        caption=f"A smooth surface, n of 1.5: the specular reflectance. {_TRUTH}",
        within=CLOSED,
    )


def intensities_without_shadowing() -> Figure:
    return misprint(
        "intensities-without-shadowing",
        "What is shadowed does not shine",
        np.linspace(0.0, 89.5, 30),
        _LIGHT,
        lambda theta: directions(theta, 40.0, 180.0),
        _of_a_mirror,
        caption=f"Aluminum of Fig. 8 as a perfect mirror, seen from 40 degrees, 500 nm: f_r. {_TRUTH}",
        within=CLOSED,
    )


def hemispherical_for_bidirectional() -> Figure:
    def truth(theta_i: float, phi_i: float, theta_r: float, phi_r: float, **surface: float) -> Any:
        values = [surface[name] for name in ("wavelength_nm", "sigma_0_um", "tau_um", "n", "k")]
        seen, specular = (
            he_torrance_1991.directional_diffuse(theta_i, theta, mp.mpf(azimuth), *values)
            for theta, azimuth in ((theta_r, phi_r - phi_i), (theta_i, np.pi))
        )
        return seen / specular

    return misprint(
        "hemispherical-for-bidirectional",
        "The curves of Figs 7 to 10 are those of rho_bd",
        np.linspace(0.0, 85.0, 18),
        "viewer [degrees from the normal]",
        lambda theta: directions(45.0, theta, 180.0),
        truth,
        caption="Aluminum of Fig. 8, light at 45 degrees, 500 nm: what is drawn, 1 in the mirror direction. rho_hd is "
        f"the directional albedo of the viewer's direction. {_TRUTH}",
        within=CLOSED,
    )


def uniform_diffuse_without_pi() -> Figure:
    return misprint(
        "uniform-diffuse-without-pi",
        "An albedo is no BRDF",
        np.linspace(0.05, 1.0, 20),
        "a(lambda)",
        lambda a: {"a": a},
        he_torrance_1991.uniform_diffuse,
        caption=f"The uniform diffuse part. {_TRUTH}",
        within=CLOSED,
    )


def _of_a_mirror(
    theta_i: Any,
    phi_i: Any,
    theta_r: Any,
    phi_r: Any,
    *,
    wavelength_nm: float,
    sigma_0_um: float,
    tau_um: float,
) -> Any:
    """Eq. 71 with abs(F)^2 = 1: what a good mirror reflects is divided out."""
    angles = mp.mpf(theta_i), mp.mpf(theta_r), mp.mpf(phi_r) - mp.mpf(phi_i)
    cosines, sines = (f(angles[0]) * f(angles[1]) for f in (mp.cos, mp.sin))
    half = mp.sqrt((1 + cosines + sines * mp.cos(angles[2])) / 2)
    f_r = he_torrance_1991.directional_diffuse(*angles, wavelength_nm, sigma_0_um, tau_um, *_MIRROR)
    return f_r / he_torrance_1991.fresnel_unpolarised(half, *_MIRROR)


def v_without_wave_number() -> Figure:
    return misprint(
        "v-without-wave-number",
        "The unit of v",
        np.linspace(0.0, 85.0, 35),
        "viewer [degrees from the normal]",
        lambda theta: directions(0.0, theta, 0.0),
        _of_a_mirror,
        caption=f"Aluminum of Fig. 8 as a perfect mirror, light along the normal, 500 nm: f_r. {_TRUTH}",
        within=CLOSED,
    )


FIGURES: dict[str, Callable[[], Figure]] = {
    "hemispherical-for-bidirectional": hemispherical_for_bidirectional,
    "uniform-diffuse-without-pi": uniform_diffuse_without_pi,
    "one-matrix-for-two": one_matrix_for_two,
    "two-pi-in-the-cone": two_pi_in_the_cone,
    "amplitudes-over-cross-product": amplitudes_over_cross_product,
    "sign-of-m-ps": sign_of_m_ps,
    "intensities-without-shadowing": intensities_without_shadowing,
    "squares-without-moduli": squares_without_moduli,
    "four-dot-products": four_dot_products,
    "v-without-wave-number": v_without_wave_number,
    "local-normal-for-z": local_normal_for_z,
}
