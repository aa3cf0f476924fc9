"""Energy of microfacets: two shadowings against closed forms, and two ways to return the light that facets lose."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from brdfdb.atlas._albedos import THETA, THETA_DEG, TOLERANCE, Array, albedo_of, at, close, curve, panel
from brdfdb.figure import Figure, Panel, Statement
from brdfdb.geometry import radians
from brdfdb.models import ggx_compensated, ggx_scaled

_MIRROR = {"n": 1e-3, "k": 1e4}  # |F|^2 is 1 within 1e-8 up to 89.9 degrees
_F_0, _F_AVG = 0.5, 11.0 / 21.0  # reflectance at normal incidence, and its mean (20 f_0 + 1) / 21
_FROM_DEG = 30.0  # one of the directions that are exchanged
_UP_TO = THETA_DEG[THETA_DEG <= 89.0]


def _shadowing() -> Figure:
    """Draw the albedos of mirror-like facets with both shadowings, and with the light that they lose."""
    alphas = (0.3, 1.0)
    surfaces = {alpha: {"alpha_x": alpha, "alpha_y": alpha, **_MIRROR} for alpha in alphas}
    correlated = {alpha: albedo_of("ggx", **surfaces[alpha]) for alpha in alphas}
    separable = {alpha: albedo_of("ggx_separable", **surfaces[alpha]) for alpha in alphas}
    compensated = {alpha: albedo_of("ggx_compensated", f_0=1.0, alpha=alpha) for alpha in alphas}
    mu = np.cos(radians(THETA_DEG))
    exact = {"correlated": 1.0 - mu * np.log1p(1.0 / mu), "separable": 2.0 * (1.0 - np.log(2.0)) / (1.0 + mu)}
    off = max(
        float(np.max(np.abs(correlated[1.0] - exact["correlated"]))),
        float(np.max(np.abs(separable[1.0] - exact["separable"]))),
    )
    white = max(float(np.max(np.abs(albedo - 1.0))) for albedo in compensated.values())
    grazing = at(separable[1.0], 89.0), at(correlated[1.0], 89.0)
    last = min(float(correlated[alpha][-1]) for alpha in alphas)
    return Figure(
        key="energy-microfacets",
        paper="walter2007",
        title="GGX of a mirror-like metal, with two shadowings",
        caption="F = 1, to which n = 0.001 and k = 10000 come within 1e-8. Correlated shadowing is eq. 99 of Heitz "
        "2014, separable shadowing eq. 23 of Walter et al. 2007. For alpha of 1 the albedo is 1 - mu ln(1 + 1 / mu) "
        "with the first and 2 (1 - ln 2) / (1 + mu) with the second, mu = cos(theta_i).",
        panels=[
            panel(
                f"alpha = {alpha:g}",
                [
                    curve("correlated", correlated[alpha], "ours"),
                    curve("separable", separable[alpha], "textbook"),
                    curve("compensated", compensated[alpha]),
                ],
            )
            for alpha in alphas
        ],
        statements=[
            Statement(
                says="for alpha of 1 both albedos have a closed form",
                where="property of the forms: eqs 23 and 99",
                seen=f"the quadrature is within {off:.1g} of them up to 89.9 degrees",
                holds=off < TOLERANCE,
            ),
            Statement(
                says="separable shadowing counts facets twice that are hidden from both directions: 0.60 at 89 degrees "
                "for alpha of 1, where correlated shadowing keeps 0.93",
                where="Heitz 2014, section 3; property of the forms",
                seen="at 89 degrees {:.3f} and {:.3f}".format(*grazing),
                holds=close(grazing, (0.60, 0.93), 0.005),
            ),
            Statement(
                says="at grazing the light meets the highest facets only, which send all of it back: the albedo of "
                "correlated shadowing goes to 1",
                where="property of the form: eq. 99",
                seen=f"at least {last:.3f} at 89.9 degrees; with separable shadowing {separable[1.0][-1]:.3f}",
                holds=last > 0.98 and bool(separable[1.0][-1] < 0.65),
            ),
            Statement(
                says="the compensated form reflects all of the light at every angle",
                where="Kulla and Conty 2017",
                seen=f"within {white:.1g} of 1",
                holds=white < TOLERANCE,
            ),
        ],
    )


def _compensation() -> Figure:
    """Draw what the forms of energy compensation break: reciprocity, and the order of reflection."""
    other = radians(_UP_TO)
    there = {
        f.__name__: np.asarray(f(radians(_FROM_DEG), 0.0, other, np.pi, f_0=1.0, alpha=1.0))
        for f in (ggx_compensated, ggx_scaled)
    }
    back = {
        f.__name__: np.asarray(f(other, 0.0, radians(_FROM_DEG), np.pi, f_0=1.0, alpha=1.0))
        for f in (ggx_compensated, ggx_scaled)
    }
    ratio: dict[str, Array] = {name: back[name] / there[name] for name in there}
    single = albedo_of("ggx_schlick", rho_d=0.0, f_0=_F_0, alpha_x=1.0, alpha_y=1.0)
    both = albedo_of("ggx_compensated", f_0=_F_0, alpha=1.0)
    once = single + (both - single) / _F_AVG  # with F_avg in the place of its square
    lost = np.cos(radians(THETA_DEG)) * np.log1p(1.0 / np.cos(radians(THETA_DEG)))
    shares = [float(np.max((albedo - single) / lost)) for albedo in (both, once)]
    even = float(np.max(np.abs(ratio["ggx_compensated"] - 1.0)))
    uneven = float(np.max(ratio["ggx_scaled"]))
    return Figure(
        key="energy-compensation",
        paper="walter2007",
        title="GGX with the light that facets lose, in three forms",
        caption="alpha = 1. First f_0 = 1, f_r of light at theta towards a viewer at 30 degrees, in the mirror half "
        "plane, over f_r with the two exchanged. Then f_0 = 0.5: albedos with the reflectance of the second lobe of "
        "order F_avg^2, of order F_avg as the first slides print it, and without that lobe.",
        panels=[
            Panel(
                title="light and viewer exchanged",
                x_label="theta [degree]",
                y_label="ratio [1]",
                curves=[
                    curve("Kulla and Conty 2017", ratio["ggx_compensated"], "ours", _UP_TO),
                    curve("Turquin 2019", ratio["ggx_scaled"], "textbook", _UP_TO),
                ],
            ),
            Panel(
                title="f_0 = 0.5",
                x_label=THETA,
                y_label="directional albedo [1]",
                curves=[
                    curve("F_avg^2, Hill 2018", both, "ours"),
                    curve("F_avg, first slides", once, "printed"),
                    curve("single scattering", single),
                ],
            ),
        ],
        statements=[
            Statement(
                says="light and viewer exchanged give the same f_r with Kulla and Conty's lobe, and not with Turquin's "
                "factor, which knows the viewer alone: 2.77 times as much from 89 to 30 degrees as back",
                where="Helmholtz's reciprocity",
                seen=f"off by {even:.1g} and by a factor of up to {uneven:.2f}",
                holds=even < 1e-12 and close(uneven, 2.77, 0.005),
            ),
            Statement(
                says="light of the second lobe has met two facets, so that it is at most F_avg^2 of what the facets "
                "lose; with the reflectance of the first slides it is more",
                where="Hill 2018",
                seen=f"f_0 = 0.5, F_avg^2 = {_F_AVG**2:.3f}: {shares[0]:.3f} of it, with the first slides "
                f"{shares[1]:.3f}",
                holds=shares[0] <= _F_AVG**2 < shares[1],
            ),
        ],
    )


FIGURES: dict[str, Callable[[], Figure]] = {
    "energy-microfacets": _shadowing,
    "energy-compensation": _compensation,
}
