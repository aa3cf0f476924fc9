"""Figures of the approximations of Oren and Nayar 1994: later bounces, eq. 44 between planes, and eq. 48."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.figure import Figure, Map, Panel, Statement, curve_of, listed, rows
from brdfdb.gallery._oren_nayar_lines import (
    PAPER,
    SMALL,
    THETA_R,
    VERY_ACCURATE,
    across,
    at,
    curve,
    distance,
    evaluated,
    evaluated_parts,
    left_past,
    line_panel,
    rough,
    to_radiance,
    very_accurate,
)
from brdfdb.gauss import gauss_rule
from brdfdb.geometry import degrees, radians
from brdfdb.models import (
    oren_nayar,
    oren_nayar_gaussian_parts,
    oren_nayar_single_slope_parts,
    oren_nayar_unidirectional_parts,
)
from brdfdb.parameters import Floats

Array = NDArray[np.float64]

RAPIDLY = 0.5  # ratio of bounces for "diminishes rapidly", our reading: at most half of the bounce before
SAME = 0.01  # relative error of sums over strips, slopes and azimuths: 0.6 % at 88 degrees
ORDERS = 5  # bounces 1 to 4, and the sum of all later bounces
SAMPLES = {"Fig. 8, and wall plaster": (0.9, 30.0), "painted sandpaper": (0.8, 40.0), "white sand": (0.8, 35.0)}
VIEWERS_DEG = np.arange(-88.0, 89.0, 4.0)
SLOPE_DEG = 30.0  # slope of the facets of the figure of eq. 44
GRID_DEG = np.arange(2.5, 90.0, 5.0)
TURN_DEG = 45.0  # azimuth half way between the planes in which eq. 44 is exact

# V-grooves of Lambertian facets with all bounces of light, by strips and the strings between their edges
STRIPS = 32  # strips of a facet: more strips change no bounce by 0.2 % of the radiance
AZIMUTHS = 48  # azimuths of the grooves, spread over half a turn
SLOPES = 12  # Gauss-Legendre nodes of the slopes
_REACH = 4.5  # largest slope over sigma; steeper facets have 4e-5 of the weight


def view_factors(theta_a: float, strips: int = STRIPS) -> Array:
    """Return the share of light [1] that a strip of one facet (row) sends to a strip of the other (column).

    Hottel's rule of crossed strings: the share is half of the crossed distances less the straight ones, over the width
    of the strip. Facets have the slope theta_a [rad] and width 1. Strips count from the bottom of the groove.
    """
    edges = np.linspace(0.0, 1.0, strips + 1)
    x = edges[:, None]
    y = edges[None, :]
    distance = np.sqrt(x * x + 2.0 * x * y * np.cos(2.0 * theta_a) + y * y)
    crossed = distance[:-1, 1:] + distance[1:, :-1] - distance[:-1, :-1] - distance[1:, 1:]
    return np.asarray(0.5 * strips * crossed)


def _met(slope: Array, theta_a: float) -> tuple[Array, Array]:
    """Return <w, a> over cos(theta) [1] of both facets, (..., 2), and the widths [1] that a direction reaches.

    `slope` is tan(theta) cos(phi - phi_a) of the direction. A direction reaches a facet from its upper edge downwards.
    The rest lies behind the upper edge of the other facet.
    """
    facing = np.cos(theta_a) + np.sin(theta_a) * np.stack([slope, -slope], axis=-1)
    width = np.minimum(2.0 * np.cos(theta_a) / np.maximum(facing, 1e-300), 1.0)
    return np.maximum(facing, 0.0), np.where(facing > 0.0, width, 0.0)


def _on_strips(facing: Array, width: Array, strips: int) -> Array:
    """Return <w, a> over cos(theta) [1] on each strip, (..., 2, strips), reduced by the hidden part of the strip."""
    upper = np.linspace(0.0, 1.0, strips + 1)[1:]
    return facing[..., None] * np.clip((upper - 1.0 + width[..., None]) * strips, 0.0, 1.0)


def bounces(
    theta_i: float, theta_r: Array, delta_phi: Array, rho: float, sigma: float, orders: int, strips: int = STRIPS
) -> Array:
    """Return f_r [1/sr] of Gaussian slopes bounce by bounce, shape (orders, viewers).

    The last row has all later bounces. Angles are radians: the polar angle of the light, those of viewers, and their
    azimuths from the light. The surface is that of Oren and Nayar 1994 (eqs 8 and 26): long grooves. Each facet is cut
    into strips, and a strip has one radiosity. The view factors of strips are exact. No equation of the paper for
    interreflection is used.
    """
    azimuth = (np.arange(AZIMUTHS) + 0.5) * np.pi / AZIMUTHS
    slope_i = np.tan(theta_i) * np.cos(azimuth)
    slope_r = np.tan(theta_r)[:, None] * np.cos(azimuth - delta_phi[:, None])
    last = min(_REACH * sigma, np.pi / 2.0)
    nodes, weights = gauss_rule(SLOPES)
    slopes = (nodes + 1.0) / 2.0 * last
    # Eq. (26) with the sine of eq. (8), normalised over the slope
    weights = weights * np.exp(-0.5 * (slopes / sigma) ** 2) * np.sin(slopes)
    total = np.zeros((orders, theta_r.size))
    for theta_a, weight in zip(slopes.tolist(), (weights / weights.sum()).tolist(), strict=True):
        factors = view_factors(theta_a, strips)
        lit, seen = _met(slope_i, theta_a), _met(slope_r, theta_a)
        scale = weight / (2.0 * np.cos(theta_a) * np.pi * AZIMUTHS)
        # Direct light comes from the part of a facet that is both lit and seen
        total[0] += scale * rho * np.sum(lit[0] * seen[0] * np.minimum(lit[1], seen[1]), axis=(1, 2))
        left = rho * _on_strips(*lit, strips)
        viewed = scale / strips * _on_strips(*seen, strips)
        for order in range(1, orders - 1):
            left = rho * left[:, ::-1] @ factors.T
            total[order] += np.einsum("vafs,afs->v", viewed, left)
        # All later bounces, by the sum and the difference of both facets: (1 - rho F)^-1 and (1 + rho F)^-1
        left = rho * left[:, ::-1] @ factors.T
        sums = (left[:, 0] + left[:, 1]) / 2.0
        differences = (left[:, 0] - left[:, 1]) / 2.0
        even = np.linalg.solve(np.eye(strips) - rho * factors, sums.T).T
        odd = np.linalg.solve(np.eye(strips) + rho * factors, differences.T).T
        total[-1] += np.einsum("vafs,afs->v", viewed, np.stack([even + odd, even - odd], axis=1))
    return total


class _Bounces(NamedTuple):
    """Radiance over VIEWERS_DEG, by bounce (ORDERS, viewers), and the two parts of the model."""

    summed: Floats
    direct: Floats
    second: Floats


def _bounces(theta_i_deg: float, rho: float, sigma_deg: float) -> _Bounces:
    """Return the radiance [E_0] by bounce in the plane of incidence."""
    theta_i, sigma = float(radians(theta_i_deg)), float(radians(sigma_deg))
    theta_r = radians(np.abs(VIEWERS_DEG))
    delta_phi = np.where(VIEWERS_DEG < 0.0, np.pi, 0.0)
    cosine = np.cos(theta_i)
    parts = oren_nayar_gaussian_parts(theta_i, 0.0, theta_r, delta_phi, rho=rho, sigma=sigma)
    summed = cosine * bounces(theta_i, theta_r, delta_phi, rho, sigma, ORDERS)
    return _Bounces(summed, cosine * parts.direct, cosine * parts.interreflected)


def two_bounces() -> Figure:
    """Draw the bounces one by one, to judge the approximation by two."""
    lights_deg = [30.0, 75.0]
    lines = {light: _bounces(light, 0.9, 30.0) for light in lights_deg}
    return Figure(
        key="oren-nayar-1994-bounces",
        paper=PAPER,
        title="Bounces of light in V-cavities, one by one",
        caption="σ = 30°, ρ = 0.90, plane of incidence. Each facet is cut into 32 strips that exchange light by their "
        "view factors; no equation of the paper's interreflection is used. The paper mentions such a simulation but "
        "shows no figure. θ_i = 75° is that of Fig. 8.",
        panels=[
            line_panel(
                [
                    curve_of("all bounces", VIEWERS_DEG, line.summed.sum(axis=0), "truth"),
                    curve_of("two bounces, eqs 10 to 20", VIEWERS_DEG, line.direct + line.second, "ours"),
                    curve_of("second bounce", VIEWERS_DEG, line.summed[1]),
                    curve_of("third", VIEWERS_DEG, line.summed[2]),
                    curve_of("fourth", VIEWERS_DEG, line.summed[3]),
                    curve_of("fifth and later", VIEWERS_DEG, line.summed[4]),
                ],
                title=f"θ_i = {light:.0f}°",
            )
            for light, line in lines.items()
        ],
        statements=[_diminishes(list(lines.values()), lights_deg), _good(), _strips(list(lines.values()), lights_deg)],
    )


def _diminishes(lines: list[_Bounces], lights_deg: list[float]) -> Statement:
    shares = [line.summed[1:4].mean(axis=1) / line.summed[:3].mean(axis=1) for line in lines]
    ratios = "; ".join(
        f"{listed(share, '.2f')} for θ_i = {light:.0f}°" for share, light in zip(shares, lights_deg, strict=True)
    )
    return Statement(
        says="in the case of Lambertian surfaces, the energy in an incident light ray diminishes rapidly with each "
        "interreflection bounce",
        where="section 4.1.2",
        seen=f"The mean radiance of bounces 2, 3 and 4 over that of the bounce before is {ratios} "
        f"(rapidly: {RAPIDLY:.1f} or less). The ratio grows, because the steepest cavities keep the light.",
        threshold_from="our reading: a bounce that diminishes rapidly has at most half of the one before",
        holds=bool(np.max(shares) <= RAPIDLY),
    )


def _good() -> Statement:
    off, worst = [], []
    for rho, sigma_deg in SAMPLES.values():
        lines = [_bounces(light, rho, sigma_deg) for light in (30.0, 60.0)]
        totals = [line.summed.sum(axis=0) for line in lines]
        pairs = list(zip(lines, totals, strict=True))
        off.append(max(distance(line.direct + line.second, total) for line, total in pairs))
        worst.append(max(float((1.0 - (line.direct + line.second) / total).max()) for line, total in pairs))
    return Statement(
        says="simulations of the interreflection process were used to verify that this approximation (two bounces) is "
        "good",
        where="section 4.1.2",
        seen=f"For {', '.join(SAMPLES)} (θ_i of 30 and 60°) two bounces lack at most {listed(off, '.1%')} of "
        f"the mean radiance, root mean square (good: {SMALL:.0%}), and in single directions up to "
        f"{listed(worst, '.0%')} of the value.",
        threshold_from="our reading: good is within 10 % of the mean, root mean square",
        holds=max(off) < SMALL,
    )


def _strips(lines: list[_Bounces], lights_deg: list[float]) -> Statement:
    direct = max(float(np.abs(line.direct / line.summed[0] - 1.0).max()) for line in lines)
    second = max(float(np.abs(line.second / line.summed[1] - 1.0).max()) for line in lines)
    return Statement(
        says="eqs 10 to 20, averaged over the slopes, are the first and the second bounce",
        where="property of the form: view factors of strips, which use none of eqs 11 to 20",
        seen=f"The sums differ by {direct:.2%} of direct light at most, and by {second:.2%} of the second bounce, for "
        f"θ_i of {listed(lights_deg, '.0f')}°.",
        threshold_from="an independent evaluation: strips and their strings, within the error of the sums",
        holds=max(direct, second) < SAME,
    )


def _integrated(theta_i: Floats, theta_r: Floats, delta_phi: Floats, theta_a: Floats, *, azimuths: int = 90) -> Floats:
    """Return direct f_r [1/sr] of one slope in all azimuths, eq. 23, by a mean over azimuths of cavities; rho = 1."""
    azimuth = (np.arange(azimuths) + 0.5) * np.pi / azimuths
    arguments = (angle[..., None] for angle in (theta_i, np.zeros_like(theta_i), theta_r, delta_phi))
    parts = oren_nayar_unidirectional_parts(*arguments, rho=1.0, theta_a=theta_a[..., None], phi_a=azimuth)
    return np.asarray(parts.direct.mean(axis=-1))


def _weighted(theta_i: Floats, theta_r: Floats, delta_phi: Floats, theta_a: Floats) -> Floats:
    """Return direct f_r [1/sr] of one slope in all azimuths by eq. 44, from the closed forms in its two planes."""
    return oren_nayar_single_slope_parts(theta_i, 0.0, theta_r, delta_phi, rho=1.0, theta_a=theta_a).direct


def weighted_sum() -> Figure:
    """Draw eq. 44 against the integral that it approximates, and eq. 48 against eq. 47."""
    turn = np.arange(0.0, 181.0, 3.0)
    lines = []
    for theta_deg in (60.0, 75.0, 85.0):
        angles = np.broadcast_arrays(radians(theta_deg), radians(theta_deg), radians(turn), radians(SLOPE_DEG))
        lines += [
            curve_of(f"integral of eq. 23, θ_i = θ_r = {theta_deg:.0f}°", turn, _integrated(*angles), "truth"),
            curve_of(f"eq. 44, {theta_deg:.0f}°", turn, _weighted(*angles), "printed"),
        ]
    theta_i, theta_r = np.meshgrid(radians(GRID_DEG), radians(GRID_DEG), indexing="ij")
    angles = np.broadcast_arrays(theta_i, theta_r, radians(TURN_DEG), radians(SLOPE_DEG))
    off = _weighted(*angles) / _integrated(*angles) - 1.0
    hidden, factors, limits = _interreflection_factors()
    return Figure(
        key="oren-nayar-1994-eq-44",
        paper=PAPER,
        title="Eqs 44 and 48: two approximations of appendix B",
        caption=f"Direct light of cavities of one slope, {SLOPE_DEG:.0f}°, in all azimuths, ρ = 1: the weighted sum of "
        "eq. 44 against the integral of eq. 23, facet by facet. Last, the interreflection factor of eq. 48 over that "
        "of eq. 47, of single cavities whose facets are hidden by the same width from light and viewer.",
        panels=[
            Panel(title="θ_i = θ_r", x_label="φ_r - φ_i [degree]", y_label="f_r [1/sr]", curves=lines, log_y=True),
            Map(
                title=f"eq. 44 over the integral, less 1, φ_r - φ_i = {TURN_DEG:.0f}°",
                x_label="θ_r [degree]",
                y_label="θ_i [degree]",
                value_label="relative error",
                x=GRID_DEG.tolist(),
                y=GRID_DEG.tolist(),
                values=rows(off, 3),
            ),
            Panel(
                title="eq. 48 over eq. 47",
                x_label="width hidden, m_s / w = m_v / w",
                y_label="ratio",
                curves=[curve_of(f"θ_a = {slope_deg:.0f}°", hidden, ratio) for slope_deg, ratio in factors.items()],
            ),
        ],
        statements=[_in_general(), *_over_estimation(), _exact_in_planes(), *_factor(factors, limits)],
    )


def _in_general() -> Statement:
    slopes_deg = [10.0, 20.0, 30.0, 40.0, 50.0]
    turn = radians(np.arange(7.5, 180.0, 15.0))
    grid = np.meshgrid(radians(GRID_DEG), radians(GRID_DEG), turn, radians(slopes_deg), indexing="ij")
    theta_i, theta_r, _, _ = grid
    weight = np.sin(2.0 * theta_i) * np.sin(2.0 * theta_r)
    exact = _integrated(*grid)
    square = np.average((_weighted(*grid) - exact) ** 2, axis=(0, 1, 2), weights=weight)
    off = np.sqrt(square) / np.average(exact, axis=(0, 1, 2), weights=weight)
    return Statement(
        says="the weighted sum of the radiance in the two planes (eq. 44) is in general very accurate",
        where="appendix B.1",
        seen=f"In uniform light, over all viewers, eq. 44 is {listed(off, '.1%')} of the mean off, "
        f"root mean square, for facets of {listed(slopes_deg, '.0f')}° (very accurate: {VERY_ACCURATE:.0%}).",
        threshold_from="our reading: very accurate is within 5 % of the mean, root mean square",
        holds=bool(np.max(off) < VERY_ACCURATE),
    )


def _over_estimation() -> list[Statement]:
    turn = radians(np.arange(0.0, 181.0, 15.0))
    grid = np.meshgrid(radians(GRID_DEG), radians(GRID_DEG), turn, radians([SLOPE_DEG]), indexing="ij")
    off = _weighted(*grid) / _integrated(*grid) - 1.0
    theta_i, theta_r = degrees(grid[0]), degrees(grid[1])
    over = off > VERY_ACCURATE
    apart = float(np.abs(theta_i - theta_r)[over].max(initial=0.0))
    low = float(np.minimum(theta_i, theta_r)[over].min(initial=90.0))
    most, least = np.argmax(off), np.argmin(off)
    place = [f"{theta_i.flat[i]:.1f}, {theta_r.flat[i]:.1f} and {degrees(grid[2]).flat[i]:.0f}°" for i in (most, least)]
    return [
        Statement(
            says="there is an over-estimation only for θ_r ≈ θ_i and θ_i → π/2",
            where="appendix B.1",
            seen=f"For facets of {SLOPE_DEG:.0f}° eq. 44 is more than {VERY_ACCURATE:.0%} too bright only where θ_i "
            f"and θ_r are both above {low:.0f}° and at most {apart:.0f}° apart.",
            threshold_from="our reading: ≈ is within 10°, and → π/2 the last third of the angles",
            holds=bool(over.any()) and apart <= 10.0 and low >= 60.0,
        ),
        Statement(
            says="the over-estimation for θ_r ≈ θ_i and θ_i → π/2 is slight",
            where="appendix B.1",
            seen=f"For facets of {SLOPE_DEG:.0f}° it is up to {off.flat[most]:+.0%} of the value (slight: {SMALL:.0%}) "
            f"at θ_i, θ_r and φ_r - φ_i of {place[0]}; on the other side eq. 44 is up to {off.flat[least]:+.0%} too "
            f"dark, at {place[1]}.",
            threshold_from="our reading: slight is 10 % of the value",
            holds=float(off.max()) < SMALL,
        ),
    ]


def _exact_in_planes() -> Statement:
    grid = np.meshgrid(
        radians(GRID_DEG), radians(GRID_DEG), radians([0.0, 90.0, 180.0]), radians([20.0, 40.0]), indexing="ij"
    )
    exact = _integrated(*grid, azimuths=360)
    off = float((np.abs(_weighted(*grid) - exact) / exact.mean()).max())
    return Statement(
        says="in the plane of incidence and across it, eqs 40 to 43 are the integral of eq. 23",
        where="property of the form: appendix B.1, and the integral facet by facet",
        seen=f"For facets of 20 and 40° they differ by {off:.1e} of the mean at most.",
        threshold_from="an independent evaluation: facets at 360 azimuths, within the error of their sum",
        holds=off < SAME,
    )


def _interreflection_factors() -> tuple[Floats, dict[float, Floats], list[float]]:
    """Return hidden widths [1], the factor of eq. 48 over that of eq. 47 by slope [degree], and its limits.

    Light and viewer stand opposite each other across the cavity, at the same angle. At
    tan(theta) = (1 + m) / (1 - m) cot(theta_a) each of them hides a width m of a facet (eqs 15 and 16).
    """
    hidden = np.linspace(0.0, 0.98, 50)
    factors = {}
    for slope_deg in (15.0, 30.0, 45.0, 60.0):
        slope = float(radians(slope_deg))
        theta = np.arctan((1.0 + hidden) / (1.0 - hidden) / np.tan(slope))
        exact = oren_nayar_unidirectional_parts(theta, 0.0, theta, np.pi, rho=1.0, theta_a=slope, phi_a=0.0)
        # Eqs (17) and (22) with eq. (48). The factor of 1 / 2: one of the two facets faces the viewer
        facing = np.cos(slope) + np.sin(slope) * np.tan(theta)
        factor = np.pi * (1.0 - np.cos(slope)) * (1.0 - hidden) ** 2
        factors[slope_deg] = 0.5 / np.pi**2 * facing**2 / np.cos(slope) * factor / exact.interreflected
    limits = [float(4.0 * np.cos(radians(slope)) / (1.0 + np.cos(radians(slope)))) for slope in factors]
    return hidden, factors, limits


def _factor(factors: dict[float, Floats], limits: list[float]) -> list[Statement]:
    first, last = ([float(ratio[index]) for ratio in factors.values()] for index in (0, -1))
    off = float(np.abs(np.subtract(first, 1.0)).max())
    return [
        Statement(
            says="where nothing is hidden the factor of eq. 48 is that of eq. 47",
            where="property of the form: eqs 47 and 48 with m_s = m_v = 0",
            seen=f"For facets of {listed(factors, '.0f')}° they differ by {off:.0e} of it at most.",
            threshold_from="a closed form: eqs 47 and 48, to rounding",
            holds=off < 1e-9,
        ),
        Statement(
            says="where nearly all is hidden the factor of eq. 48 is 4 cos θ_a / (1 + cos θ_a) times that of eq. 47",
            where="property of the form: the strings of eq. 20 where m_s and m_v tend to 1",
            seen=f"For facets of {listed(factors, '.0f')}° it is {listed(last, '.3f')} times as large with 98 % "
            f"hidden; the limits are {listed(limits, '.3f')}.",
            threshold_from="a limit: the strings of eq. 20, within 2 % at 0.98",
            holds=bool(np.allclose(last, limits, rtol=0.02)),
        ),
    ]


def evaluation() -> Figure:
    """Draw Figs 8 and 12 by eqs 24 and 49, as the paper evaluates them."""
    surface = rough(30.0)
    light = 75.0
    cosine = to_radiance(light)
    own, facets = (across(model, light, **surface) for model in (evaluated_parts, oren_nayar_gaussian_parts))
    totals = [cosine * (parts.direct + parts.interreflected) for parts in (own, facets)]
    lights_deg = [15.0, 30.0, 45.0, 60.0, 75.0]
    fits = [(across(oren_nayar, theta_i, **surface), across(evaluated, theta_i, **surface)) for theta_i in lights_deg]
    off = [distance(fit, numbers) for fit, numbers in fits]
    share = own.interreflected / (own.direct + own.interreflected)
    left = left_past(totals[0], light)
    return Figure(
        key="oren-nayar-1994-evaluation",
        paper=PAPER,
        title="Figs 8 and 12 by the paper's own evaluation",
        caption="σ = 30°, ρ = 0.90, plane of incidence: eqs 24 and 49 over Gaussian slopes (eq. 25), which section 4.3 "
        "evaluates, beside the facets with eq. 47 and the functional approximation.",
        panels=[
            line_panel(
                [
                    curve("the paper's own evaluation, eqs 24 and 49", totals[0], "printed"),
                    curve("facet by facet, eq. 47", totals[1], "truth"),
                    curve("direct illumination alone, eq. 24", cosine * own.direct),
                ],
                title="Fig. 8, θ_i = 75°",
            ),
            *(
                line_panel(
                    [
                        curve("the paper's own evaluation, eqs 24 and 49", numbers, "printed"),
                        curve("functional approximation, eqs 27 and 28", fit, "ours"),
                    ],
                    title=f"Fig. 12, θ_i = {theta_i:.0f}°",
                    y_label="f_r [1/sr]",
                )
                for theta_i, (fit, numbers) in zip(lights_deg, fits, strict=True)
                if theta_i in (30.0, 75.0)
            ),
        ],
        statements=[
            very_accurate(off, lights_deg, "section 4.3, Fig. 12"),
            Statement(
                says="the cut-off occurs exactly at θ_r = θ_i",
                where="section 4.3, Fig. 8",
                seen=f"The sharpest bend is at {THETA_R[1:-1][np.argmin(np.diff(totals[0], 2))]:.0f}°. In the first "
                f"degree past it radiance grows by {left:.0%} of its growth in the last degree before.",
                threshold_from="the paper's words: exactly, to the degree that is drawn",
                holds=bool(THETA_R[1:-1][np.argmin(np.diff(totals[0], 2))] == light and left < 1.0 - SMALL),
            ),
            Statement(
                says="interreflections dominate in the forward direction",
                where="section 4.3, Fig. 8",
                seen=f"They are {at(share, -60.0):.0%} of the radiance at θ_r = -60°, at most {share.max():.1%} at "
                f"{THETA_R[np.argmax(share)]:.0f}°, and {at(share, 75.0):.1%} at 75°.",
                threshold_from="the paper's words: dominate, read as more than half",
                holds=bool(share.max() > 0.5 and THETA_R[np.argmax(share)] < 0.0),
            ),
            Statement(
                says="eq. 48 brightens the forward direction: with eq. 47 radiance at the horizon is lower",
                where="property of the form: eq. 48 is above eq. 47 where most of a cavity is hidden, for slopes below "
                "70.5°",
                seen=f"At θ_r = -90° the paper's own evaluation is {totals[0][0] / totals[1][0] - 1.0:+.1%} of the "
                f"facets' radiance off, at 0° {at(totals[0], 0.0) / at(totals[1], 0.0) - 1.0:+.2%}.",
                threshold_from="a limit: eq. 48 exceeds eq. 47 by up to a factor of two where all is hidden; a "
                "tenth of the sum",
                holds=bool(totals[0][0] / totals[1][0] > 1.0 + SMALL),
            ),
        ],
    )


FIGURES: dict[str, Callable[[], Figure]] = {
    "oren-nayar-1994-evaluation": evaluation,
    "oren-nayar-1994-bounces": two_bounces,
    "oren-nayar-1994-eq-44": weighted_sum,
}
