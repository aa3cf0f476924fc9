"""He, Torrance, Sillion and Greenberg 1991: the measured samples, Figs 7 to 11."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from brdfdb.figure import Figure, Panel, Statement, curve_of, listed
from brdfdb.gallery import _he_torrance_by_hand as by_hand
from brdfdb.gallery._he_torrance_cuts import (
    CONE_SR,
    HALF_ANGLE_DEG,
    HIGHEST_DEG,
    Cut,
    Surface,
    cut_of,
    lobe_at,
    measured_cuts,
    parameters_text,
    polar,
    polar_panel,
    reflected,
    specular,
    specular_of_peak,
    surface_of,
)
from brdfdb.models import he_torrance, he_torrance_parts, he_torrance_very_rough
from brdfdb.parameters import Floats

# Angle over which two equal small cones share at least half of their solid angle. With axes 2 u half angles apart the
# share is half where 2 arccos(u) - 2 u sqrt(1 - u^2) = pi / 2.
HALF_SEEN_DEG = 4.0 * 0.40397 * HALF_ANGLE_DEG
CONSERVED = 0.95  # least share of |F|^2 at 10 degrees: gentle slopes hide and double-bounce little light there
BY_HAND = 1e-9  # relative difference of a closed form and the model
APERTURES = "Light and receiver have cones of π/1024 sr; the value in the mirror direction is 1 (eq. 11)."


def fig_07() -> Figure:
    """Draw Fig. 7: aluminum at 2 µm."""
    surface = surface_of("roughened-aluminum-2000nm")
    thetas = np.array([10.0, 45.0, 75.0])
    cuts = measured_cuts(surface, thetas)
    rho_s = specular(surface, thetas)
    diffuse = reflected(surface, thetas, specular=False)
    of_peaks = [specular_of_peak(surface, cut) for cut in cuts]
    short = specular(surface_of("roughened-aluminum-500nm"), thetas)
    expected = by_hand.specular(surface, 10.0)
    fresnel = float(by_hand.fresnel(10.0, surface["n"], surface["k"]))
    first_surface = float(rho_s[0] + diffuse[0])
    lobes = [cut_of(he_torrance, theta, **surface) for theta in thetas.tolist()]
    widths = [cut._replace(f_r=cut.f_r - lobe.f_r).width_deg for cut, lobe in zip(cuts, lobes, strict=True)]
    return Figure(
        key="he-torrance-1991-fig-07",
        paper="he1991",
        title="Fig. 7: roughened aluminum at 2 µm",
        caption=f"f_r in the plane of incidence; {parameters_text(surface)}. {APERTURES}",
        panels=[polar(cuts)],
        statements=[
            Statement(
                says="The surface shows strong specular reflection at this wavelength.",
                where="caption of Fig. 7",
                seen=f"All are largest in the mirror direction. The specular part is {listed(of_peaks, '.1%')} of f_r "
                f"there at {listed(thetas)} degrees.",
                holds=all(cut.peak_deg == cut.theta_i_deg for cut in cuts) and min(of_peaks) > 0.5,
                threshold_from="the paper's words: strong, read as more than half of the height",
            ),
            Statement(
                says="For incidence at 10 degrees, the reflected pattern displays both specular and directional "
                "diffuse components.",
                where="section 4, on Fig. 7",
                seen=f"Specular is {of_peaks[0]:.0%} of the height of the peak and {rho_s[0]:.3f} of the light; "
                f"directional diffuse is {diffuse[0]:.3f} of the light. By hand |F|² e^-g S is {expected:.3f}. The "
                f"two parts together are {first_surface / fresnel:.3f} of |F|².",
                holds=bool(np.isclose(rho_s[0], expected, rtol=BY_HAND) and CONSERVED < first_surface / fresnel <= 1.0),
                threshold_from="conservation: the first surface reflects |F|², less the loss of gentle slopes; the "
                "specular part is eq. 73 by hand, with the paper's σ_0, τ and λ",
            ),
            Statement(
                says="The angular width of the measured specular peak is determined by the solid angles of incident "
                "and received light.",
                where="section 4, on Fig. 7",
                seen=f"At half of their height above the lobe, the peaks are {listed(widths)} degrees wide. Two cones "
                f"of π/1024 sr share half of their solid angle or more over {HALF_SEEN_DEG:.3g} degrees.",
                holds=bool(np.allclose(widths, HALF_SEEN_DEG, rtol=0.01)),
                threshold_from="the paper's number: π/1024 sr; the overlap of two such cones, within 1 %",
            ),
            Statement(
                says="An emerging specular peak as the angle of incidence is increased and, for the metal, as the "
                "wavelength is increased.",
                where="section 4, on Figs 7 to 9; conclusion 3",
                seen=f"The specular part is {listed(rho_s)} of the light at {listed(thetas)} degrees, at 0.5 µm "
                f"{listed(short)}.",
                holds=bool(np.all(np.diff(rho_s) > 0.0) and np.all(np.diff(short) > 0.0) and np.all(rho_s > short)),
                threshold_from="the paper's words: increased",
            ),
        ],
    )


def fig_08() -> Figure:
    """Draw Fig. 8: aluminum at 0.5 µm."""
    surface = surface_of("roughened-aluminum-500nm")
    thetas = np.array([10.0, 30.0, 45.0, 60.0, 75.0])
    cuts = measured_cuts(surface, thetas)
    *off, last = cuts
    # Largest value of the lobe over its value in the mirror direction, by the model and by the reference
    peaks = [(cut.theta_i_deg, cut.peak_deg) for cut in off]
    ratios, expected = (
        [f_r(surface, theta, peak) / f_r(surface, theta, theta) for theta, peak in peaks]
        for f_r in (lobe_at, by_hand.directional_diffuse)
    )
    rho_s = specular(surface, thetas)
    diffuse = reflected(surface, thetas, specular=False)
    of_last = specular_of_peak(surface, last)
    return Figure(
        key="he-torrance-1991-fig-08",
        paper="he1991",
        title="Fig. 8: roughened aluminum at 0.5 µm",
        caption=f"f_r in the plane of incidence; {parameters_text(surface)}. {APERTURES}",
        panels=[polar(cuts)],
        statements=[
            Statement(
                says="A strong directional diffuse pattern appears.",
                where="section 4, on Fig. 8",
                seen=f"The directional diffuse part is {listed(diffuse, '.3f')} of the light at {listed(thetas)} "
                f"degrees, the specular part {listed(rho_s, '.2g')}.",
                holds=bool(np.all(diffuse > 0.5) and np.all(diffuse > rho_s)),
                threshold_from="the paper's words: strong, read as more than half of the light",
            ),
            Statement(
                says="For 10, 30, 45 and 60 degrees the reflected intensity is maximal at larger-than-specular angles.",
                where="section 4, on Fig. 8",
                seen=f"The largest values are at {listed([cut.peak_deg for cut in off])} degrees, "
                f"{listed([cut.peak for cut in off], '.3f')} times those in the mirror direction. Without the "
                f"average over cones the ratio is {listed(ratios, '.3f')}, by the reference {listed(expected, '.3f')}.",
                holds=all(cut.peak_deg > cut.theta_i_deg and cut.peak > 1.0 for cut in off)
                and bool(np.allclose(ratios, expected, rtol=BY_HAND)),
                threshold_from="the paper's words: larger than specular; an independent evaluation in 50 digits gives "
                "the ratio",
            ),
            Statement(
                says="For 75 degrees, a specular peak emerges.",
                where="section 4, on Fig. 8",
                seen=f"The largest value is at {last.peak_deg:g} degrees, and {of_last:.0%} of it is specular. At "
                f"60 degrees {specular_of_peak(surface, off[-1]):.1%} of f_r in the mirror direction is specular. The "
                f"surface appears smoother than it is: ρ_s is {rho_s[-1]:.4f}, by hand with the effective roughness "
                f"{by_hand.specular(surface, 75.0):.4f}.",
                holds=last.peak_deg == last.theta_i_deg
                and of_last > 0.5 > specular_of_peak(surface, off[-1])
                and bool(np.isclose(rho_s[-1], by_hand.specular(surface, 75.0), rtol=BY_HAND)),
                threshold_from="the paper's words: specular, read as more than half of the height; ρ_s is eq. 73 by "
                "hand",
            ),
        ],
    )


def fig_09() -> Figure:
    """Draw Fig. 9: magnesium oxide, also across the plane of incidence."""
    surface = surface_of("magnesium-oxide-ceramic")
    thetas = np.array([10.0, 45.0, 60.0, 75.0])
    cuts = measured_cuts(surface, thetas)
    across = [cut_of(he_torrance, theta, np.pi / 2.0, **surface) for theta in thetas.tolist()]
    total = _first_surface(surface, thetas) + surface["a"]
    excess = [float(cut.f_r.max()) / (surface["a"] / np.pi) - 1.0 for cut in across]
    return Figure(
        key="he-torrance-1991-fig-09",
        paper="he1991",
        title="Fig. 9: roughened magnesium oxide ceramic at 0.5 µm",
        caption="f_r in the plane of incidence, and across it, which the paper does not draw, over a/π; "
        f"{parameters_text(surface)}. {APERTURES}",
        panels=[
            polar(cuts),
            polar_panel(
                [cut.curve(surface["a"] / np.pi) for cut in across], "f_r over a/π", "Across the plane of incidence"
            ),
        ],
        statements=[
            *_diffuse_ceramic(surface, cuts, thetas),
            *_peak_of_ceramic(surface, cuts, thetas),
            Statement(
                says="The a(λ) of Fig. 9 keeps to the upper bound that energy conservation gives.",
                where="section 3.2.3",
                seen=f"With a = {surface['a']:g}, ρ_dh is {listed(total, '.3f')} at "
                f"{listed(thetas)} degrees. At larger angles no room is left for the first surface.",
                holds=bool(np.all(total <= 1.0)),
                threshold_from="conservation: no more light than is received",
            ),
            Statement(
                says="Subsurface scattered light is approximated as uniform-diffuse (i.e., Lambertian).",
                where="section 3.2.3",
                seen="Across the plane of incidence f_r is above a/π by at most "
                f"{listed(excess[1:], '.2g')} of it at {listed(thetas[1:])} degrees. At 10 degrees the lobe adds "
                f"{excess[0]:.2g}.",
                holds=0.0 < max(excess[1:]) < 0.05,
                threshold_from="our reading: approximated is within 5 %, and a lobe that is nowhere 0 adds something",
            ),
        ],
    )


def _first_surface(surface: Surface, thetas_deg: Floats) -> Floats:
    """Return the reflectance [1] of the first surface, without the uniform part."""
    return reflected({**surface, "a": 0.0}, thetas_deg)


def _diffuse_ceramic(surface: Surface, cuts: list[Cut], thetas_deg: Floats) -> list[Statement]:
    first_surface = _first_surface(surface, thetas_deg)
    fresnel = by_hand.fresnel(thetas_deg, surface["n"], surface["k"])
    spread = float(cuts[0].f_r.max() / cuts[0].f_r.min())
    return [
        Statement(
            says="This surface shows nearly uniform diffuse behavior at 10 degrees.",
            where="section 4, on Fig. 9",
            seen=f"f_r is the same within a factor of {spread:.2f} in the plane of incidence, and "
            f"{1.0 - first_surface[0] / (first_surface[0] + surface['a']):.0%} of the light is uniform diffuse.",
            holds=spread < 2.0 and bool(first_surface[0] < 0.1 * surface["a"]),
            threshold_from="our reading: nearly uniform is within a factor of 2, which a polar plot shows, with less "
            "than a tenth of the light from the first surface",
        ),
        Statement(
            says="Subsurface scattering has a relatively stronger role as compared to the aluminum surface: a "
            "strong uniform diffuse pattern.",
            where="section 4, on Fig. 9",
            seen=f"The first surface reflects {listed(first_surface, '.3f')} at {listed(thetas_deg)} degrees. |F|² is "
            f"{listed(fresnel, '.3f')}; the uniform part is {surface['a']:g}.",
            holds=bool(np.all(first_surface < surface["a"]) and abs(first_surface[0] / fresnel[0] - 1.0) < 0.05),
            threshold_from="the paper's number: a of 0.9; and conservation: at 10 degrees the first surface "
            "reflects |F|², within 5 % for slopes that turn it",
        ),
    ]


def _peak_of_ceramic(surface: Surface, cuts: list[Cut], thetas_deg: Floats) -> list[Statement]:
    mirror = np.array([cut.mirror for cut in cuts]) / (surface["a"] / np.pi)
    rho_s = specular(surface, thetas_deg)
    wavelengths = surface["sigma_0_um"] * 1000.0 / surface["wavelength_nm"]
    return [
        Statement(
            says="The surface displays an emerging peak as the angle of incidence is increased.",
            where="section 4, on Fig. 9, of both materials",
            seen=f"In the mirror direction f_r is {listed(mirror)} times the uniform part at {listed(thetas_deg)} "
            "degrees.",
            holds=bool(np.all(np.diff(mirror) > 0.0)),
            threshold_from="the paper's words: emerging as the angle is increased",
        ),
        Statement(
            says="The peak that emerges for larger angles of incidence is specular.",
            where='section 4, "an emerging specular peak for larger values of θ_i"; caption of Fig. 9',
            seen="It is the directional diffuse lobe, largest at "
            f"{listed([cut.peak_deg for cut in cuts])} degrees. The specular part falls as e^-g, and is "
            f"{rho_s[-1]:.0e} of the light at 75 degrees: σ_0 is {wavelengths:.1f} wavelengths.",
            holds=all(cut.peak_deg == cut.theta_i_deg for cut in cuts[1:]) and bool(rho_s[-1] > 1e-3),
            threshold_from="our reading: a thousandth of the light is the least that is seen as a mirror image",
        ),
    ]


def fig_10() -> Figure:
    """Draw Fig. 10: sandpaper."""
    surface = surface_of("sandpaper-220-grit")
    slope = surface["sigma_0_um"] / surface["tau_um"]
    optics = surface["n"], surface["k"]
    cut = cut_of(he_torrance, 0.0, **surface)
    limit = cut_of(
        he_torrance_very_rough, 0.0, sigma_0_over_tau=slope, **{key: surface[key] for key in ("n", "k", "a")}
    )
    larger = cut_of(
        he_torrance, 0.0, **{**surface, "sigma_0_um": 10 * surface["sigma_0_um"], "tau_um": 10 * surface["tau_um"]}
    )
    hand = np.array([by_hand.very_rough(slope, *optics, 0.0, x) for x in cut.x_deg])
    grazing = hand[-1] / by_hand.very_rough(slope, *optics, 0.0, 0.0)
    off = max(float(abs(other / cut.f_r - 1.0).max()) for other in (limit.f_r, larger.f_r, hand))
    normalised = cut.f_r / cut.mirror
    lowest = int(np.argmin(normalised))
    patterns = (
        cut_of(he_torrance, 45.0, **surface_of("roughened-aluminum-2000nm")),
        cut_of(he_torrance, 45.0, **surface_of("roughened-aluminum-500nm")),
        cut_of(he_torrance, 45.0, **surface),
    )
    return Figure(
        key="he-torrance-1991-fig-10",
        paper="he1991",
        title="Fig. 10: sandpaper, 220 grit",
        caption=f"f_r for normal incidence over f_r along the normal (eq. 11); {parameters_text(surface)} (as in the "
        f"text; the caption says 0.5). The paper prints only σ_0/τ = {slope:g}. σ_0 is our choice, and the limit is "
        "beside it.",
        panels=[
            polar_panel(
                [
                    curve_of(f"σ_0 = {surface['sigma_0_um']:g} µm", cut.x_deg, normalised, "ours"),
                    curve_of("σ_0/λ → ∞", limit.x_deg, limit.f_r / limit.mirror),
                ],
                "f_r over f_r along the normal",
            )
        ],
        statements=[
            Statement(
                says="The surface shows a large reflectance at grazing reflection angles.",
                where="caption of Fig. 10",
                seen=f"f_r falls to {normalised[lowest]:.2f} at {abs(cut.x_deg[lowest]):.0f} degrees and then grows, "
                f"to {normalised[-1]:.2f} at {HIGHEST_DEG:g} degrees, "
                f"by hand {grazing:.2f}. The surface reflects {reflected(surface, 0.0):.1e} of the light, which "
                "the normalised figure hides: such steep facets send light on into the surface.",
                holds=abs(cut.peak_deg) == HIGHEST_DEG and bool(np.isclose(normalised[-1], grazing, rtol=1e-4)),
                threshold_from="the paper's number: σ_0/τ of 4.4, by hand for σ_0/λ → ∞",
            ),
            Statement(
                says="For very rough surfaces, only the ratio σ_0/τ is required, not σ_0 and τ separately.",
                where="section 4, on Fig. 10",
                seen="With σ_0 and τ ten times as large, infinite, or infinite and by hand, the relative change of "
                f"f_r is {off:.1e} at most.",
                holds=off < 1e-3,
                threshold_from="a limit: the next term, of order 1 / g, is 1e-5 for the σ_0 that we chose",
            ),
            Statement(
                says="Maximal values in the specular direction for slightly rough surfaces, at off-specular angles for "
                "intermediate roughnesses, or at grazing reflection angles for very rough surfaces.",
                where="section 3.2.2; conclusion 4",
                seen="At 45 degrees the directional diffuse part is largest at "
                f"{listed([cut.peak_deg for cut in patterns])} degrees, for aluminum at 2 µm, at 0.5 µm, and for "
                f"sandpaper. {HIGHEST_DEG:g} degrees are the ends of the figure, towards the light and away from it.",
                holds=abs(patterns[0].peak_deg - 45.0) < 1.0
                and 46.0 < patterns[1].peak_deg < 80.0
                and abs(patterns[2].peak_deg) == HIGHEST_DEG,
                threshold_from="the paper's words: specular, off-specular, grazing, within the width of a step or at "
                "the ends of the figure",
            ),
        ],
    )


def fig_11() -> Figure:
    """Draw Fig. 11: blue plastic, in absolute values."""
    surface = surface_of("blue-plastic")
    thetas = np.array([15.0, 30.0, 45.0, 60.0])
    cuts = measured_cuts(surface, thetas)
    uniform = surface["a"] / np.pi
    reach = 2.0 * HALF_ANGLE_DEG
    expected = by_hand.fresnel(thetas, surface["n"], surface["k"]) / np.cos(np.deg2rad(thetas)) / CONE_SR + uniform
    outside = max(float(abs(cut.f_r / uniform - 1.0)[abs(cut.x_deg - cut.theta_i_deg) > reach].max()) for cut in cuts)
    directional = max(
        float(cut_of(lambda *angles: he_torrance_parts(*angles, **surface).directional_diffuse, theta).f_r.max())
        for theta in thetas.tolist()
    )
    fresnel = by_hand.fresnel(15.0, surface["n"], surface["k"])
    nearly = [{**surface, "sigma_0_um": sigma_0, "a": 0.0} for sigma_0 in (0.0005, 0.001)]
    diffuse = [float(reflected(rough, 15.0, specular=False, tolerance=1e-9)) for rough in nearly]
    missing = [float(fresnel - specular(rough, 15.0)) for rough in nearly]
    rho_dh = float(reflected(surface, 0.0))
    return Figure(
        key="he-torrance-1991-fig-11",
        paper="he1991",
        title="Fig. 11: smooth blue plastic at 0.46 µm",
        caption=f"f_r in the plane of incidence, in absolute values; {parameters_text(surface)}. The heights of the "
        "peaks are those of cones of π/1024 sr, as in Figs 7 to 9; the paper does not give the cones of this figure.",
        panels=[
            Panel(x_label="θ_r [degree]", y_label="f_r [1/sr]", log_y=True, curves=[cut.curve(1.0) for cut in cuts])
        ],
        statements=[
            Statement(
                says="The distributions for four incidence angles reveal a linear combination of specular and uniform "
                "diffuse behavior.",
                where="section 4, on Fig. 11",
                seen=f"More than {reach:.2f} degrees from the mirror direction f_r is a/π within {outside:.0e}. In the "
                f"mirror direction f_r is {listed([cut.mirror for cut in cuts])} /sr, and |F|²/(cos θ_i ω_i) + a/π is "
                f"{listed(expected)}.",
                holds=outside < BY_HAND
                and all(cut.peak_deg == cut.theta_i_deg for cut in cuts)
                and bool(np.allclose([cut.mirror for cut in cuts], expected, rtol=1e-3)),
                threshold_from="a closed form: eqs 10 and 72 with the paper's a and cones, within 0.1 %, because a cap "
                "of the sphere is larger than the circle below it",
            ),
            Statement(
                says="For a smooth surface the directional-diffuse term drops out.",
                where="section 4, on Fig. 11",
                seen=f"The largest value of that term is {directional:g} /sr. For σ_0 of 0.5 and 1 nm the term holds "
                f"{listed(diffuse, '.2e')} of the light, and {listed(missing, '.2e')} is missing from the specular "
                "part.",
                holds=directional == 0.0
                and bool(np.allclose(diffuse, missing, rtol=0.01) and diffuse[1] > 3.9 * diffuse[0]),
                threshold_from="conservation: for a small σ_0, light that leaves the specular part is diffuse, within "
                "1 %, and proportional to σ_0²",
            ),
            Statement(
                says="The directional-hemispherical reflectivity at 0 degrees, measured as 0.195, yields a = 0.15.",
                where="section 4, on Fig. 11",
                seen=f"ρ_dh is {rho_dh:.4f} at 0 degrees, {rho_dh - surface['a']:.4f} of it from the first surface; "
                f"with ρ_ud = a, as eq. (8) is printed, it would be {rho_dh + (np.pi - 1.0) * surface['a']:.3f}. The "
                "index of refraction is our choice: the paper prints none.",
                holds=round(rho_dh, 3) == 0.195,
                threshold_from="the paper's number: 0.195, to its digits",
            ),
        ],
    )


FIGURES: dict[str, Callable[[], Figure]] = {
    "he-torrance-1991-fig-07": fig_07,
    "he-torrance-1991-fig-08": fig_08,
    "he-torrance-1991-fig-09": fig_09,
    "he-torrance-1991-fig-10": fig_10,
    "he-torrance-1991-fig-11": fig_11,
}
