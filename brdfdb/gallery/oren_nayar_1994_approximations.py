"""Figures 12 and 13 of Oren and Nayar 1994: errors of their approximations against the integral."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from brdfdb.figure import Figure, Panel, Statement, listed
from brdfdb.gallery._oren_nayar_lines import (
    GRAZING_LIGHT,
    PAPER,
    RADIANCE,
    RHO,
    ROUNDING,
    SMALL,
    THETA_R,
    THETA_R_LABEL,
    VERY_ACCURATE,
    across,
    curve,
    distance,
    rough,
    to_radiance,
)
from brdfdb.geometry import degrees, radians
from brdfdb.models import (
    lambert,
    oren_nayar,
    oren_nayar_gaussian,
    oren_nayar_gaussian_parts,
    oren_nayar_parts,
    oren_nayar_qualitative,
)
from brdfdb.parameters import Floats

EXACT = 1e-9  # relative difference of a closed form and the model


class _Forms(NamedTuple):
    """Radiance over THETA_R of the surface of Figs 12 and 13."""

    integrated: Floats
    functional: Floats
    qualitative: Floats


def _forms(theta_i_deg: float, delta_phi_deg: float = 0.0) -> _Forms:
    """Return the radiance [E_0] of all forms for one light."""
    models = oren_nayar_gaussian, oren_nayar, oren_nayar_qualitative
    cosine = to_radiance(theta_i_deg)
    return _Forms(*(cosine * across(model, theta_i_deg, delta_phi_deg, **rough(30.0)) for model in models))


def _side_by_side(title: str, forms: _Forms) -> Panel:
    """Return a panel of the radiance of all forms."""
    return Panel(
        title=title,
        x_label=THETA_R_LABEL,
        y_label=RADIANCE,
        curves=[
            curve("integrated", forms.integrated, "truth"),
            curve("functional approximation, eqs 27 and 28", forms.functional, "ours"),
            curve("qualitative model, eq. 30", forms.qualitative, "textbook"),
        ],
    )


def fig_12() -> Figure:
    """Draw Fig. 12: the functional approximation against the integral."""
    lights_deg = [15.0, 30.0, 45.0, 60.0, 75.0]
    lines = [_forms(light) for light in lights_deg]
    off = [distance(forms.functional, forms.integrated) for forms in lines]
    last = lines[-1].functional / lines[-1].integrated - 1.0
    return Figure(
        key="oren-nayar-1994-fig-12",
        paper=PAPER,
        title="Fig. 12: numerical evaluation and functional approximation",
        caption="σ = 30°, ρ = 0.90, plane of incidence. The angles of incidence are our choice; the qualitative model "
        "is not in the paper's figure.",
        panels=[_side_by_side(f"θ_i = {light:.0f}°", forms) for light, forms in zip(lights_deg, lines, strict=True)],
        statements=[
            Statement(
                says="in all cases, the functional approximation proves to be very accurate",
                where="section 4.3, Fig. 12",
                seen=f"It is {listed(off, '.1%')} of the mean radiance off, root mean square, for θ_i of "
                f"{listed(lights_deg, '.0f')}° (very accurate: {VERY_ACCURATE:.0%}). The largest difference is "
                f"{last[np.argmax(np.abs(last))]:+.0%} of the value, at θ_i = 75° and θ_r = "
                f"{THETA_R[np.argmax(np.abs(last))]:.0f}°.",
                holds=min(off) > 0.0 and max(off) < VERY_ACCURATE,
                threshold_from="our reading: very accurate is within 5 % of the mean, and an approximation is not the "
                "integral",
            ),
            _twice_reflected(),
        ],
    )


def _twice_reflected() -> Statement:
    """Return the statement that the second bounce follows the square of the albedo."""
    dark, bright = 0.45, 0.9
    angles, sigma = (0.5, 0.0, 0.9, 2.5), float(radians(30.0))
    ratios = []
    for parts in (oren_nayar_parts, oren_nayar_gaussian_parts):
        low, high = (parts(*angles, rho=rho, sigma=sigma).interreflected for rho in (dark, bright))
        ratios.append(float(high / low))
    expected = (bright / dark) ** 2
    return Statement(
        says="a factor of ρ/π for each of two bounces",
        where="eqs 12, 17 and 28: (ρ/π)² E_0",
        seen=f"With twice the ρ the second bounce is {listed(ratios, '.6f')} times as bright, by the functional "
        "approximation and by the integral.",
        holds=bool(np.allclose(ratios, expected, rtol=EXACT)),
        threshold_from="conservation: light that two facets reflect is absorbed twice",
    )


def fig_13() -> Figure:
    """Draw Fig. 13: the qualitative model against the integral."""
    azimuths_deg = [0.0, 45.0, 90.0]
    lines = [_forms(GRAZING_LIGHT, azimuth) for azimuth in azimuths_deg]
    return Figure(
        key="oren-nayar-1994-fig-13",
        paper=PAPER,
        title="Fig. 13: numerical evaluation and qualitative model",
        caption="σ = 30°, ρ = 0.90, θ_i = 75°. The azimuths outside the plane of incidence are our choice; the "
        "functional approximation is not in the paper's figure.",
        panels=[
            _side_by_side(f"φ_r - φ_i = {azimuth:.0f}°", forms)
            for azimuth, forms in zip(azimuths_deg, lines, strict=True)
        ],
        statements=[_slight_sacrifice(lines), _third_coefficient(), _note_7(), _smooth_qualitative()],
    )


def _slight_sacrifice(lines: list[_Forms]) -> Statement:
    """Return the statement on the accuracy that the qualitative model gives up."""
    functional = [distance(forms.functional, forms.integrated) for forms in lines]
    qualitative = [distance(forms.qualitative, forms.integrated) for forms in lines]
    forward = [float(values[0]) for values in lines[0]]
    return Statement(
        says="in order to obtain this simplification, a slight sacrifice in accuracy must be made",
        where="section 4.4, Fig. 13",
        seen=f"At azimuths of 0, 45 and 90° the qualitative model is {listed(qualitative, '.0%')} of the mean radiance "
        f"off (slight: {SMALL:.0%}), the functional approximation {listed(functional, '.0%')}. Eq. 30 keeps radiance "
        f"constant on the side away from the light: {forward[2]:.3f} at the horizon, where the integral falls to "
        f"{forward[0]:.3f}.",
        holds=max(qualitative) < SMALL,
        threshold_from="our reading: slight is a tenth of the mean radiance",
    )


def _hemispheres() -> tuple[Floats, Floats, Floats, Floats]:
    """Return theta_i, theta_r, phi_r - phi_i [rad] of pairs of directions, and the weights of f_r in uniform light."""
    theta, azimuth = radians(np.arange(5.0, 90.0, 10.0)), radians(np.arange(10.0, 180.0, 20.0))
    theta_i, theta_r, delta_phi = np.meshgrid(theta, theta, azimuth, indexing="ij")
    cosines = np.sin(2.0 * theta_i) * np.sin(2.0 * theta_r)
    return theta_i, theta_r, delta_phi, cosines * np.pi / cosines.sum()


def _third_coefficient() -> Statement:
    """Return the statement on the contribution of C_3."""
    theta_i, theta_r, delta_phi, weight = _hemispheres()
    total = oren_nayar(theta_i, 0.0, theta_r, delta_phi, **rough(30.0))
    # The term depends on |cos(delta_phi)|. On the side of the light it is the only difference of eqs 27 and 30
    folded = theta_i, 0.0, theta_r, np.minimum(delta_phi, np.pi - delta_phi)
    term = oren_nayar(*folded, **rough(30.0), interreflection=False) - oren_nayar_qualitative(*folded, **rough(30.0))
    share = float(np.sum(term * weight) / np.sum(total * weight))
    alpha, beta, s2 = np.maximum(theta_i, theta_r), np.minimum(theta_i, theta_r), radians(30.0) ** 2
    C_3 = 0.125 * s2 / (s2 + 0.09) * (4.0 * alpha * beta / np.pi**2) ** 2
    printed = RHO / np.pi * (1.0 - np.abs(np.cos(delta_phi))) * C_3 * np.tan((alpha + beta) / 2.0)
    expected = float(np.sum(printed * weight) / np.sum(total * weight))
    most = np.argmax(term / total)
    where = [float(degrees(angle.flat[most])) for angle in (theta_i, theta_r, delta_phi)]
    return Statement(
        says="the simulations showed that coefficient C_3 makes a relatively small contribution to the total radiance",
        where="section 4.4",
        seen=f"It is {share:.2%} of the reflected part of uniform light, by C_3 of eq. 27 {expected:.2%}, at σ = 30° "
        f"(small: {SMALL:.0%}), but up to "
        f"{np.max(term / total):.0%} of the radiance, at θ_i, θ_r and φ_r - φ_i of {listed(where, '.1f')}°.",
        holds=share < SMALL and bool(np.isclose(share, expected, rtol=EXACT)),
        threshold_from="our reading: small is a tenth; the closed form of C_3 gives the share",
    )


def _note_7() -> Statement:
    """Return the statement on the constant that compensates the missing interreflection."""
    theta_i, theta_r, delta_phi, weight = _hemispheres()
    angles = theta_i, 0.0, theta_r, delta_phi
    surface = float(np.sum(weight * oren_nayar_gaussian(*angles, **rough(30.0))))
    printed, changed = (
        float(np.sum(weight * oren_nayar_qualitative(*angles, **rough(30.0), offset=offset))) for offset in (0.33, 0.57)
    )
    return Statement(
        says="discrepancies caused by the lack of the interreflection component in the qualitative model can be "
        "partially compensated by replacing the constant 0.33 in coefficient A with 0.57",
        where="note 7",
        seen=f"The surface reflects {surface:.3f} of uniform light, the model {printed:.3f} with 0.33 and "
        f"{changed:.3f} with 0.57.",
        holds=abs(changed - surface) < SMALL * abs(printed - surface),
        threshold_from="our reading: partially compensated, in uniform light, leaves a tenth or less",
    )


def _smooth_qualitative() -> Statement:
    """Return the statement that the qualitative model of a smooth surface is Lambert's."""
    flat = across(lambert, GRAZING_LIGHT, rho=RHO)
    off = float(np.abs(across(oren_nayar_qualitative, GRAZING_LIGHT, **rough(0.0)) / flat - 1.0).max())
    return Statement(
        says="the qualitative model also reduces to the Lambertian model when σ = 0",
        where="section 4.4",
        seen=f"f_r differs from ρ / π by {off:.1g} of it at most.",
        holds=off <= ROUNDING,
        threshold_from="the paper's words: reduces to, in float64",
    )


FIGURES: dict[str, Callable[[], Figure]] = {
    "oren-nayar-1994-fig-12": fig_12,
    "oren-nayar-1994-fig-13": fig_13,
}
