"""Figures 15 to 21 of Oren and Nayar 1994: the model with the parameters of the measured samples."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from brdfdb.figure import Figure, Panel, Statement, listed
from brdfdb.gallery import _oren_nayar_by_hand as by_hand
from brdfdb.gallery._oren_nayar_lines import (
    PAPER,
    SMALL,
    THETA_R,
    VERY_ACCURATE,
    across,
    at,
    between,
    curve,
    distance,
    evaluated,
    left_past,
    line_panel,
    very_accurate,
)
from brdfdb.materials import Material, presets
from brdfdb.models import oren_nayar, oren_nayar_body_surface, oren_nayar_gaussian, torrance_sparrow
from brdfdb.parameters import Floats

LIGHTS_DEG = [30.0, 45.0, 60.0]
NORMALISED = "L_r(θ_r) / L_r(0)"
EXACT = 1e-9  # relative difference of a closed form and the model
CLOSE_DEG = 10.0  # largest angle that is "close to" a direction, our reading


def _normalised(f_r: Floats) -> Floats:
    """Return f_r over its value along the normal [1]."""
    return f_r / at(f_r, 0.0)


def _printed(material: Material) -> str:
    """Return the parameters as the captions print them."""
    names = {"sigma_deg": "σ = {:g}°", "rho": "ρ = {:.2f}", "k_s": "k_s/k_b = {:g}"}
    values = material.file_parameters()
    return ", ".join(text.format(values[name]) for name, text in names.items() if name in values)


class _Lines(NamedTuple):
    """Normalised radiance of one sample over THETA_R."""

    evaluated: Floats  # eqs 24 and 49, which the paper drew
    facets: Floats  # eq. 47, without the approximations of eqs 44 and 48
    functional: Floats  # the fit, which tables hold


def _panel(theta_i_deg: float, lines: _Lines, where: str = "") -> Panel:
    """Return a panel of all three forms for one light."""
    return line_panel(
        [
            curve("the paper's own evaluation, eqs 24 and 49", lines.evaluated, "printed"),
            curve("facet by facet, eq. 47", lines.facets, "truth"),
            curve("functional approximation, eqs 27 and 28", lines.functional, "ours"),
        ],
        title=f"θ_i = {theta_i_deg:.0f}°{where}",
        y_label=NORMALISED,
    )


def _rough(material: Material, theta_i_deg: float, delta_phi_deg: float = 0.0) -> _Lines:
    """Return the normalised radiance [1] of a sample without a surface part."""
    rho, sigma = material.numbers["rho"], material.numbers["sigma"]
    models = evaluated, oren_nayar_gaussian, oren_nayar
    return _Lines(*(_normalised(across(model, theta_i_deg, delta_phi_deg, rho=rho, sigma=sigma)) for model in models))


def _accurate(lines: list[_Lines], lights_deg: list[float]) -> Statement:
    return very_accurate([distance(line.functional, line.evaluated) for line in lines], lights_deg, "section 4.3")


def _assumptions(lines: list[_Lines], lights_deg: list[float]) -> Statement:
    off = [distance(line.evaluated, line.facets) for line in lines]
    forward = [line.evaluated[0] / line.facets[0] - 1.0 for line in lines]
    return Statement(
        says="the numerical evaluation of the model (equation 25) demonstrates not only its accuracy but also the "
        "validity of all assumptions made while developing it",
        where="section 5; eqs 44 and 48 are approximations of appendix B",
        seen=f"Facet by facet, with eq. 47 in place of eq. 48, radiance is {listed(off, '.1%')} of the mean off, root "
        f"mean square, for θ_i of {listed(lights_deg, '.0f')}°. At the horizon away from the light the paper's own "
        f"evaluation is {listed(forward, '+.1%')} brighter.",
        threshold_from="our reading: valid assumptions change radiance by less than 5 % of the mean",
        holds=max(off) < VERY_ACCURATE,
    )


def _in_plane(number: int, sample: str) -> Figure:
    """Draw one of samples A to C in the plane of incidence."""
    material = presets()[sample]
    lines = [_rough(material, light) for light in LIGHTS_DEG]
    own = [(light, line.evaluated) for light, line in zip(LIGHTS_DEG, lines, strict=True)]
    rising = [between(values, -90.0, light) for light, values in own]
    past = [at(values, light + 5.0) / at(values, light) for light, values in own]
    angles = "" if number == 15 else " The angles are those of Fig. 15."
    return Figure(
        key=f"oren-nayar-1994-fig-{number}",
        paper=PAPER,
        title=f"Fig. {number}: {material.title[0].lower()}{material.title[1:]}",
        caption=f"{_printed(material)}. The model alone: the measured dots are not in the text.{angles}",
        panels=[_panel(light, line) for light, line in zip(LIGHTS_DEG, lines, strict=True)],
        statements=[
            Statement(
                says="for all three samples, radiance increases as the viewing direction approaches the source "
                "direction (backward reflection)",
                where=f"section 5, Fig. {number}",
                seen=f"From θ_r = -90° to θ_i it grows {listed([line[-1] / line[0] for line in rising], '.2f')} times, "
                f"for θ_i of {listed(LIGHTS_DEG, '.0f')}°.",
                threshold_from="the paper's words: increases, at every degree",
                holds=all(bool(np.all(np.diff(line) > 0.0)) for line in rising),
            ),
            Statement(
                says="the small peak noticed near the source direction is different from what is described by our "
                "model",
                where=f"section 5, Fig. {number}",
                seen=f"The model has no peak there: five degrees past θ_i of {listed(LIGHTS_DEG, '.0f')}° it has "
                f"{listed(past, '.3f')} times the radiance at θ_i.",
                threshold_from="the paper's words: the model has no peak and continues to rise",
                holds=min(past) > 1.0,
            ),
            _accurate(lines, LIGHTS_DEG),
            _assumptions(lines, LIGHTS_DEG),
        ],
    )


def fig_18() -> Figure:
    """Draw Fig. 18: sample C outside the plane of incidence."""
    material = presets()["white-sand"]
    lights_deg, azimuths_deg = [60.0, 75.0], [45.0, 60.0]
    lines = [_rough(material, light, azimuth) for light, azimuth in zip(lights_deg, azimuths_deg, strict=True)]
    sides = [
        (at(line.evaluated, -light), at(line.evaluated, light)) for light, line in zip(lights_deg, lines, strict=True)
    ]
    return Figure(
        key="oren-nayar-1994-fig-18",
        paper=PAPER,
        title="Fig. 18: white sand (sample C) outside the plane of incidence",
        caption=f"{_printed(material)}. The model alone: the measured dots are not in the text.",
        panels=[
            _panel(light, line, f", φ_r = {azimuth:.0f}°")
            for light, azimuth, line in zip(lights_deg, azimuths_deg, lines, strict=True)
        ],
        statements=[
            Statement(
                says="the body reflectance from rough surfaces is not uniform but increases as the viewer moves toward "
                "the source direction",
                where="section 1",
                seen=f"For θ_i of {listed(lights_deg, '.0f')}° it is {listed([back for _, back in sides], '.2f')} "
                f"times that along the normal at θ_r = θ_i on the side of the light, "
                f"{listed([front for front, _ in sides], '.2f')} on the other.",
                threshold_from="the paper's words: increases towards the source",
                holds=all(front < 1.0 < back for front, back in sides),
            ),
            _accurate(lines, lights_deg),
            _assumptions(lines, lights_deg),
        ],
    )


def _with_surface(number: int, sample: str) -> Figure:
    """Draw one of samples D to F: body and surface, eq. 32."""
    material = presets()[sample]
    rho, sigma = material.numbers["rho"], material.numbers["sigma"]
    sums = [across(oren_nayar_body_surface, light, **material.numbers) for light in LIGHTS_DEG]
    bodies = [across(oren_nayar, light, rho=rho, sigma=sigma, interreflection=False) for light in LIGHTS_DEG]
    left = [left_past(total, light) for light, total in zip(LIGHTS_DEG, sums, strict=True)]
    return Figure(
        key=f"oren-nayar-1994-fig-{number}",
        paper=PAPER,
        title=f"Fig. {number}: {material.title[0].lower()}{material.title[1:]}",
        caption=f"{_printed(material)}, F = 1, plane of incidence. Eq. 32 with eq. 27 for the body; both curves over "
        "the sum along the normal. The measured dots are not in the text; the angles are those of Fig. 15.",
        panels=[
            line_panel(
                [
                    curve("body and surface", _normalised(total), "ours"),
                    curve("body alone", body / at(total, 0.0)),
                ],
                title=f"θ_i = {light:.0f}°",
                y_label=NORMALISED,
            )
            for light, total, body in zip(LIGHTS_DEG, sums, bodies, strict=True)
        ],
        statements=[
            _approaching(number, sums, material),
            Statement(
                says="the cut-off in radiance that takes place in the source direction",
                where=f"section 5, Fig. {number}",
                seen=f"In the first degree past θ_i of {listed(LIGHTS_DEG, '.0f')}° radiance grows by "
                f"{listed(left, '.0%')} of its growth in the last degree before.",
                holds=max(left) < 1.0 - SMALL,
                threshold_from="our reading: a cut-off leaves less than nine tenths of the slope",
            ),
            *([_foam(sums, bodies, material), _peak(), _width()] if sample == "foam" else []),
        ],
    )


def _sum_by_hand(material: Material, theta_i_deg: float, theta_r_deg: float) -> float:
    """Return f_r [1/sr] of eq. 32 by hand in the plane of incidence, with k_b = 1 and E_0 = pi."""
    printed = material.numbers
    sigma_deg = _sigma_deg(material)
    body = by_hand.fit(theta_i_deg, theta_r_deg, printed["rho"], sigma_deg).direct
    return body + printed["k_s"] * by_hand.surface(theta_i_deg, theta_r_deg, sigma_deg) / np.pi


def _sigma_deg(material: Material) -> float:
    """Return the standard deviation of the slopes [degree] as the paper prints it."""
    return float(f"{material.file_parameters()['sigma_deg']}")


def _approaching(number: int, sums: list[Floats], material: Material) -> Statement:
    last = [between(total, light / 2.0, light) for light, total in zip(LIGHTS_DEG, sums, strict=True)]
    grows = [at(total, light) / at(total, 10.0) for light, total in zip(LIGHTS_DEG, sums, strict=True)]
    expected = [_sum_by_hand(material, light, light) / _sum_by_hand(material, light, 10.0) for light in LIGHTS_DEG]
    return Statement(
        says="the increase in radiance as the viewer approaches the source",
        where=f"section 5, Fig. {number}",
        seen=f"From half of θ_i to θ_i it grows {listed([line[-1] / line[0] for line in last], '.2f')} times, for θ_i "
        f"of {listed(LIGHTS_DEG, '.0f')}°; from 10° {listed(grows, '.4f')} times, by hand {listed(expected, '.4f')}.",
        holds=all(bool(np.all(np.diff(line) > 0.0)) for line in last)
        and bool(np.allclose(grows, expected, rtol=EXACT)),
        threshold_from="the paper's words: increase, at every degree; a closed form, eqs 27, 31 and 32 with the "
        "numbers of the caption and E_0 = π",
    )


def _foam(sums: list[Floats], bodies: list[Floats], material: Material) -> Statement:
    forward = [at(total, -80.0) / float(between(total, -80.0, 0.0).min()) for total in sums]
    over_normal = [at(total, -80.0) / at(total, 0.0) for total in sums]
    expected = [_sum_by_hand(material, light, -80.0) / _sum_by_hand(material, light, 0.0) for light in LIGHTS_DEG]
    alone = [at(body, -80.0) / float(between(body, -80.0, 0.0).min()) for body in bodies]
    return Statement(
        says="for the foam sample, the surface reflectance component is a radiance increase in the forward direction",
        where="section 5, Fig. 19",
        seen=f"At θ_r = -80° radiance is {listed(forward, '.2f')} times its lowest value from there to the normal, "
        f"for θ_i of {listed(LIGHTS_DEG, '.0f')}°; that of the body alone {listed(alone, '.2f')} times. Over its "
        f"value along the normal it is {listed(over_normal, '.4f')}, by hand {listed(expected, '.4f')}.",
        holds=forward[-1] > 1.0 and max(alone) <= 1.0 and bool(np.allclose(over_normal, expected, rtol=EXACT)),
        threshold_from="the paper's words: an increase, where the body has none; a closed form, eqs 27, 31 and 32 with "
        "k_s/k_b = 0.019 and E_0 = π",
    )


def _lobes(theta_i_deg: float) -> dict[float, Floats]:
    """Return f_r [1/sr] of eq. 31 of the samples that have a surface, by their σ [degree]."""
    samples = [presets()[name] for name in ("foam", "wood-shavings", "cotton-towel")]
    return {
        _sigma_deg(sample): across(torrance_sparrow, theta_i_deg, sigma=sample.numbers["sigma"]) for sample in samples
    }


def _peak() -> Statement:
    peaks = {light: [float(-THETA_R[np.argmax(lobe)]) for lobe in _lobes(light).values()] for light in LIGHTS_DEG}
    rows = "; ".join(f"{listed(row, '.0f')}° for θ_i = {light:.0f}°" for light, row in peaks.items())
    return Statement(
        says="the Torrance-Sparrow model predicts a peak in the forward direction (close to the specular direction)",
        where="section 5, eq. 31",
        seen=f"For σ of {listed(list(_lobes(LIGHTS_DEG[0])), '.0f')}° the peak is forward, but at θ_r of {rows} "
        f"(close: {CLOSE_DEG:.0f}°): eq. 31 has 1 / cos θ_r, and so wide a lobe follows it until masking begins.",
        holds=all(abs(peak - light) <= CLOSE_DEG for light, row in peaks.items() for peak in row),
        threshold_from="our reading: close is within 10°",
    )


def _deviation(lobe: Floats) -> float:
    """Return the standard deviation [degree] of θ_r under a lobe, without the horizon, where eq. 31 has a pole."""
    theta_r = THETA_R[1:-1]
    mean = np.average(theta_r, weights=lobe)
    return float(np.sqrt(np.average((theta_r - mean) ** 2, weights=lobe)))


def _width() -> Statement:
    lobes = {sigma_deg: lobe[1:-1] for sigma_deg, lobe in _lobes(45.0).items()}
    widths = [_deviation(lobe) for lobe in lobes.values()]
    expected = [
        _deviation(np.array([by_hand.surface(45.0, x, sigma_deg) for x in THETA_R[1:-1].tolist()]))
        for sigma_deg in lobes
    ]
    return Statement(
        says="the distribution of the reflected radiance gets wider with increase in surface roughness σ",
        where="section 5, eq. 31",
        seen=f"At θ_i = 45° the standard deviation of θ_r under eq. 31 is {listed(widths, '.3f')}°, for σ of "
        f"{listed(list(lobes), '.0f')}°; by hand {listed(expected, '.3f')}°.",
        holds=bool(np.all(np.diff(widths) > 0.0) and np.allclose(widths, expected, rtol=EXACT)),
        threshold_from="the paper's words: wider, with each σ; the closed form of eq. 31 gives the width",
    )


FIGURES: dict[str, Callable[[], Figure]] = {
    "oren-nayar-1994-fig-15": partial(_in_plane, 15, "wall-plaster"),
    "oren-nayar-1994-fig-16": partial(_in_plane, 16, "painted-sandpaper"),
    "oren-nayar-1994-fig-17": partial(_in_plane, 17, "white-sand"),
    "oren-nayar-1994-fig-18": fig_18,
    "oren-nayar-1994-fig-19": partial(_with_surface, 19, "foam"),
    "oren-nayar-1994-fig-20": partial(_with_surface, 20, "cotton-towel"),
    "oren-nayar-1994-fig-21": partial(_with_surface, 21, "wood-shavings"),
}
