"""Figures 8 to 13 of Oren and Nayar 1994: predictions of their model, and errors of its approximations."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from brdfdb.figure import Figure, Panel, Statement, listed
from brdfdb.gallery import _oren_nayar_by_hand as by_hand
from brdfdb.gallery._oren_nayar_lines import (
    GRAZING_LIGHT,
    PAPER,
    RHO,
    ROUNDING,
    SMALL,
    THETA_R,
    VERY_ACCURATE,
    across,
    at,
    between,
    curve,
    distance,
    left_past,
    line_panel,
    rough,
    to_radiance,
    variation,
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

BY_HAND = 2e-3  # relative difference of a plain sum over facets and the integral
EXACT = 1e-9  # relative difference of a closed form and the model


def _facets(theta_r_deg: float, sigma_deg: float = 30.0) -> by_hand.Direct:
    """Return f_r [1/sr] of Figs 8 and 9 by a plain sum over facets."""
    return by_hand.facets(GRAZING_LIGHT, theta_r_deg, RHO, sigma_deg)


def fig_08() -> Figure:
    """Draw Fig. 8: radiance in the plane of incidence, with the second bounce and without."""
    cosine = to_radiance(GRAZING_LIGHT)
    parts = across(oren_nayar_gaussian_parts, GRAZING_LIGHT, **rough(30.0))
    direct, bounce = cosine * parts.direct, cosine * parts.interreflected
    total = direct + bounce
    flat = cosine * across(lambert, GRAZING_LIGHT, rho=RHO)
    share = total / flat
    largest = THETA_R[np.argmax(total)]
    return Figure(
        key="oren-nayar-1994-fig-08",
        paper=PAPER,
        title="Fig. 8: diffuse reflectance in the plane of incidence",
        caption="σ = 30°, ρ = 0.90, θ_i = 75°. Eqs 8 to 20 integrated over the slopes, with eq. 47 for the second "
        "bounce.",
        panels=[
            line_panel(
                [
                    curve("with interreflections", total, "truth"),
                    curve("direct illumination alone", direct),
                    curve("Lambert", flat),
                ]
            )
        ],
        statements=[
            Statement(
                says="these radiance plots deviate substantially from Lambertian reflectance",
                where="section 4.3, Fig. 8",
                seen=f"The radiance is {share.min():.2f} to {share.max():.2f} times Lambert's.",
                holds=bool(share.min() < 1.0 - SMALL and share.max() > 1.0 + SMALL),
                threshold_from="our reading: substantial is more than a tenth, on both sides",
            ),
            _towards_the_source(total),
            Statement(
                says="in the backward (source) direction, the radiance is maximum",
                where="section 4.3, Fig. 8",
                seen=f"It is largest at θ_r = {largest:.0f}°, past the source, and there "
                f"{total.max() / at(total, GRAZING_LIGHT) - 1.0:.1%} more than at 75°.",
                holds=bool(largest >= GRAZING_LIGHT),
                threshold_from="the paper's words: in the backward direction, where θ_r exceeds θ_i",
            ),
            _cut_off(),
            _scaled_tangent(total),
            _interreflections_dominate(bounce / total),
            _not_symmetrical(total),
        ],
    )


def _towards_the_source(total: Floats) -> Statement:
    rising = between(total, -90.0, GRAZING_LIGHT)
    grows = at(total, GRAZING_LIGHT) / at(total, -80.0)
    expected = sum(_facets(GRAZING_LIGHT)) / sum(_facets(-80.0))
    return Statement(
        says="surface radiance increases as the viewing direction approaches the source direction",
        where="section 4.3, Fig. 8",
        seen=f"From θ_r = -90° to 75° it grows {rising[-1] / rising[0]:.1f} times, by {np.diff(rising).min():.2g} "
        f"or more with each degree. From -80° to 75° it is {grows:.3f} times, by a plain sum over facets "
        f"{expected:.3f}.",
        holds=bool(np.all(np.diff(rising) > 0.0) and np.isclose(grows, expected, rtol=BY_HAND)),
        threshold_from="the paper's words: increases, at every degree; an independent evaluation of the growth",
    )


def _cut_off() -> Statement:
    sigmas_deg = [10.0, 20.0, 30.0, 40.0]
    curves = [across(oren_nayar_gaussian, GRAZING_LIGHT, **rough(sigma_deg)) for sigma_deg in sigmas_deg]
    bends = [float(THETA_R[1:-1][np.argmin(np.diff(values, 2))]) for values in curves]
    left = [left_past(values, GRAZING_LIGHT) for values in curves]
    return Statement(
        says='radiance gets "cut-off" when θ_r exceeds θ_i; exactly at θ_r = θ_i, and independent of roughness',
        where="section 4.3, Fig. 8",
        seen=f"For σ of {listed(sigmas_deg, '.0f')}° the sharpest bend is at {listed(bends, '.0f')}°. In the first "
        f"degree past it radiance grows by {listed(left, '.0%')} of its growth in the last degree before.",
        holds=bends == [GRAZING_LIGHT] * len(bends) and max(left) < 1.0 - SMALL,
        threshold_from="the paper's words: exactly at θ_i, to the degree of the line, for every roughness",
    )


def _scaled_tangent(total: Floats) -> Statement:
    low = -45.0
    high = GRAZING_LIGHT
    middle = between(total, low, high)
    basis = np.stack([np.ones_like(middle), np.tan(radians(between(THETA_R, low, high)))], axis=1)
    (offset, scale), *_ = np.linalg.lstsq(basis, middle)
    off = float(np.abs(basis @ [offset, scale] - middle).max() / middle.max())
    return Statement(
        says="in the middle section, radiance varies approximately as a scaled tan θ_r function with constant offset",
        where="section 4.3, Fig. 8",
        seen=f"From {low:.0f}° to {high:.0f}°, {offset:.4f} + {scale:.4f} tan θ_r differs by at most {off:.1%} of the "
        "largest value.",
        holds=off < SMALL,
        threshold_from="our reading: approximately is within a tenth of the largest value",
    )


def _interreflections_dominate(share: Floats) -> Statement:
    expected = [f_r.bounced / sum(f_r) for f_r in map(_facets, (-60.0, 0.0, 75.0))]
    return Statement(
        says="interreflections dominate in the forward direction",
        where="section 4.3, Fig. 8",
        seen=f"They are {at(share, -60.0):.0%} of the radiance at θ_r = -60°, at most {share.max():.1%} at "
        f"{THETA_R[np.argmax(share)]:.0f}°, {at(share, 0.0):.0%} at 0° and {at(share, 75.0):.1%} at 75°. "
        f"By a plain sum over facets they are {listed(expected, '.1%')} at -60, 0 and 75°.",
        holds=bool(share.max() > 0.5 and THETA_R[np.argmax(share)] < 0.0)
        and bool(np.allclose([at(share, angle) for angle in (-60.0, 0.0, 75.0)], expected, rtol=BY_HAND)),
        threshold_from="the paper's words: dominate, more than half; an independent evaluation of the shares",
    )


def _not_symmetrical(total: Floats) -> Statement:
    ratio = at(total, 60.0) / at(total, -60.0)
    expected = sum(_facets(60.0)) / sum(_facets(-60.0))
    return Statement(
        says="Minnaert's function assumes that the radiance is symmetrical with respect to the surface normal; this "
        "assumption is incorrect",
        where="section 1",
        seen=f"At θ_r = 60° it is {ratio:.3f} times the value at -60°, by a plain sum over facets {expected:.3f}.",
        holds=abs(ratio - 1.0) > SMALL and bool(np.isclose(ratio, expected, rtol=BY_HAND)),
        threshold_from="our reading: not symmetrical is a tenth; an independent evaluation of the ratio",
    )


def fig_09() -> Figure:
    """Draw Fig. 9: the effect of roughness."""
    cosine = to_radiance(GRAZING_LIGHT)
    sigmas_deg = [0.0, 10.0, 20.0, 30.0, 40.0]
    curves = [cosine * across(oren_nayar_gaussian, GRAZING_LIGHT, **rough(sigma_deg)) for sigma_deg in sigmas_deg]
    flat = cosine * across(lambert, GRAZING_LIGHT, rho=RHO)
    off = float(np.abs(curves[0] / flat - 1.0).max())
    away = [distance(values, flat) for values in curves]
    forward = [at(values, -60.0) / cosine for values in curves[1:]]
    expected = [sum(_facets(-60.0, sigma_deg)) for sigma_deg in sigmas_deg[1:]]
    return Figure(
        key="oren-nayar-1994-fig-09",
        paper=PAPER,
        title="Fig. 9: the effect of roughness on radiance",
        caption="θ_i = 75°, ρ = 0.9, plane of incidence, Gaussian slopes integrated. The roughnesses are our choice.",
        panels=[
            line_panel(
                [curve(f"σ = {sigma_deg:.0f}°", values) for sigma_deg, values in zip(sigmas_deg, curves, strict=True)]
            )
        ],
        statements=[
            Statement(
                says="when σ = 0, the model predicts exactly Lambertian reflectance",
                where="section 4.3, Fig. 9",
                seen=f"The radiance differs from ρ cos θ_i / π by {off:.1g} of it at most.",
                holds=off <= ROUNDING,
                threshold_from="the paper's words: exactly, in float64",
            ),
            Statement(
                says="the deviation from Lambertian behavior increases dramatically with roughness",
                where="section 4.3, Fig. 9",
                seen=f"For σ of {listed(sigmas_deg[1:], '.0f')}° radiance is {listed(away[1:], '.0%')} off Lambert's, "
                f"root mean square over the plane. f_r at θ_r = -60° is {listed(forward)}, by a plain sum over facets "
                f"{listed(expected)}.",
                holds=bool(np.all(np.diff(away) > 0.0) and away[-1] > 2.0 * away[1])
                and bool(np.allclose(forward, expected, rtol=BY_HAND)),
                threshold_from="our reading: dramatic is more than twice, from σ of 10° to 40°; an independent "
                "evaluation of f_r",
            ),
        ],
    )


def fig_10() -> Figure:
    """Draw Fig. 10: the effect of the angle of incidence."""
    lights_deg = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0]
    curves = [across(oren_nayar_gaussian, light, **rough(40.0)) for light in lights_deg]
    varies = [variation(values) for values in curves]
    pairs = list(zip(lights_deg, curves, strict=True))[1:]
    back = [at(values, light) / at(values, -light) for light, values in pairs]
    behind = [at(values, light) / at(values, 0.0) for light, values in pairs]
    return Figure(
        key="oren-nayar-1994-fig-10",
        paper=PAPER,
        title="Fig. 10: BRDF for different angles of incidence",
        caption="σ = 40°, ρ = 0.9, plane of incidence, Gaussian slopes integrated. The angles are our choice.",
        panels=[
            line_panel(
                [curve(f"θ_i = {light:.0f}°", values) for light, values in zip(lights_deg, curves, strict=True)],
                y_label="f_r [1/sr]",
            )
        ],
        statements=[
            Statement(
                says="the model predicts near-Lambertian behavior for very small incidence angles (θ_i ≈ 0)",
                where="section 4.3, Fig. 10",
                seen=f"At θ_i = 0 the standard deviation over viewers is {varies[0]:.1%} of the mean (near: "
                f"{SMALL:.0%}).",
                holds=varies[0] < SMALL,
                threshold_from="our reading: near is a tenth of the mean",
            ),
            Statement(
                says="as the incidence angle increases, the backscatter phenomenon begins to dominate",
                where="section 4.3, Fig. 10",
                seen=f"Towards the light f_r is {listed(back, '.2f')} times the value in the mirror direction, for "
                f"θ_i of {listed(lights_deg[1:], '.0f')}°.",
                holds=back[0] > 1.0 and bool(np.all(np.diff(back) > 0.0)),
                threshold_from="the paper's words: increases, and begins to dominate",
            ),
            Statement(
                says="this deviation is significant for very rough surfaces, and increases with the angle of incidence",
                where="section 1",
                seen=f"The standard deviation over viewers is {listed(varies, '.0%')} of the mean, for θ_i of "
                f"{listed(lights_deg, '.0f')}°.",
                holds=varies[-1] > SMALL and bool(np.all(np.diff(varies) > 0.0)),
                threshold_from="our reading: significant is more than a tenth of the mean; increases, at every angle",
            ),
            Statement(
                says="the moon reflects more light back in the direction of the source than in the normal direction or "
                "in the forward direction",
                where="section 1",
                seen=f"Towards the light f_r is {listed(behind, '.2f')} times the value along the normal, for θ_i of "
                f"{listed(lights_deg[1:], '.0f')}°.",
                holds=min(behind) > 1.0 and min(back) > 1.0,
                threshold_from="the paper's words: more than in either direction",
            ),
        ],
    )


def fig_11() -> Figure:
    """Draw Fig. 11: radiance outside the plane of incidence."""
    lights_deg = [60.0, GRAZING_LIGHT]
    azimuths_deg = [0.0, 30.0, 60.0, 90.0]
    lines = {
        light: [
            to_radiance(light) * across(oren_nayar_gaussian, light, azimuth, **rough(40.0)) for azimuth in azimuths_deg
        ]
        for light in lights_deg
    }
    radiances = [at(values, GRAZING_LIGHT) for values in lines[GRAZING_LIGHT]]
    return Figure(
        key="oren-nayar-1994-fig-11",
        paper=PAPER,
        title="Fig. 11: radiance outside the plane of incidence",
        caption="σ = 40°, ρ = 0.9, Gaussian slopes integrated. The caption prints no θ_i. 75° is the angle of the "
        "figures around it, and 60° is for comparison. The azimuths are our choice.",
        panels=[
            line_panel(
                [
                    curve(f"φ_r - φ_i = {azimuth:.0f}°", values)
                    for azimuth, values in zip(azimuths_deg, lines[light], strict=True)
                ],
                title=f"θ_i = {light:.0f}°",
            )
            for light in lights_deg
        ],
        statements=[
            _perpendicular(lights_deg, [lines[light][-1] for light in lights_deg]),
            Statement(
                says="the radiance of rough diffuse surfaces increases as the viewer approaches the source direction",
                where="section 4",
                seen=f"With θ_r = θ_i = 75° it is {listed(radiances, '.3f')} for φ_r - φ_i of 0, 30, 60 and 90°.",
                holds=bool(np.all(np.diff(radiances) < 0.0)),
                threshold_from="the paper's words: increases, with every step towards the light",
            ),
        ],
    )


def _perpendicular(lights_deg: list[float], lines: list[Floats]) -> Statement:
    varies = [variation(values) for values in lines]
    outwards = between(lines[-1], 0.0, 90.0)
    far = between(THETA_R, 0.0, 90.0)[np.abs(outwards / outwards[0] - 1.0) <= SMALL].max()
    return Statement(
        says="when the sensor-normal plane is perpendicular to the source-normal plane, the rough surface again "
        "exhibits near-Lambertian characteristics",
        where="section 4.3, Fig. 11",
        seen=f"For θ_i of {listed(lights_deg, '.0f')}° the standard deviation over viewers is {listed(varies, '.0%')} "
        f"of the mean (near: {SMALL:.0%}). For the last θ_i, radiance is within {SMALL:.0%} of its value along the "
        f"normal up to θ_r = {far:.0f}°. Then it grows to {outwards[-1] / outwards[0]:.2f} times that value at the "
        "horizon, where shadowing and masking overlap (eq. 43).",
        holds=max(varies) < SMALL,
        threshold_from="our reading: near is a tenth of the mean",
    )


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
    return line_panel(
        [
            curve("integrated", forms.integrated, "truth"),
            curve("functional approximation, eqs 27 and 28", forms.functional, "ours"),
            curve("qualitative model, eq. 30", forms.qualitative, "textbook"),
        ],
        title=title,
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
    dark, bright = 0.45, 0.9
    angles = (0.5, 0.0, 0.9, 2.5)
    sigma = float(radians(30.0))
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
    theta_i, theta_r, delta_phi, weight = _hemispheres()
    total = oren_nayar(theta_i, 0.0, theta_r, delta_phi, **rough(30.0))
    # The term depends on |cos(delta_phi)|. On the side of the light it is the only difference of eqs 27 and 30
    folded = theta_i, 0.0, theta_r, np.minimum(delta_phi, np.pi - delta_phi)
    term = oren_nayar(*folded, **rough(30.0), interreflection=False) - oren_nayar_qualitative(*folded, **rough(30.0))
    share = float(np.sum(term * weight) / np.sum(total * weight))
    alpha = np.maximum(theta_i, theta_r)
    beta = np.minimum(theta_i, theta_r)
    s2 = radians(30.0) ** 2
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
    "oren-nayar-1994-fig-08": fig_08,
    "oren-nayar-1994-fig-09": fig_09,
    "oren-nayar-1994-fig-10": fig_10,
    "oren-nayar-1994-fig-11": fig_11,
    "oren-nayar-1994-fig-12": fig_12,
    "oren-nayar-1994-fig-13": fig_13,
}
