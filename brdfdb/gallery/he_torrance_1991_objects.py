"""He, Torrance, Sillion and Greenberg 1991: the rendered cylinders, Figs 12 and 13, and the scene of Fig. 14."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from brdfdb.figure import Curve, Figure, Panel, Statement, curve_of, listed
from brdfdb.gallery import _he_torrance_by_hand as by_hand
from brdfdb.gallery._he_torrance_cuts import (
    Cut,
    Surface,
    cut_of,
    lobe_at,
    parameters_text,
    polar_panel,
    reflected,
    smooth,
    specular,
    surface_of,
)
from brdfdb.models import he_torrance, he_torrance_very_rough, lambert
from brdfdb.parameters import Floats

GREEN_NM = 550.0
BLUE_NM = 450.0
RED_NM = 650.0
BY_HAND = 1e-9  # relative difference of a closed form and the model
THETA_DEG = np.arange(0.0, 90.0)  # angles of incidence of drawn reflectances


def _over_incidence(label: str, values: Floats) -> Curve:
    """Return a curve over the angles of incidence."""
    return curve_of(label, THETA_DEG, values)


class _Cylinder(NamedTuple):
    """A rendered cylinder of Fig. 12, with what its image and its highlight are made of."""

    label: str
    surface: Surface
    image: Floats  # rho_s over THETA_DEG
    lobe: Cut  # directional diffuse part at 30 degrees

    @property
    def slope(self) -> float:
        """sigma_0 / tau [1]."""
        return float(self.surface["sigma_0_um"] / self.surface["tau_um"])


def _cylinder(letter: str) -> _Cylinder:
    """Return the cylinder of Fig. 12 with a letter."""
    surface = surface_of(f"aluminum-cylinder-12{letter}", GREEN_NM)
    label = f"({letter}) σ_0 = {surface['sigma_0_um']:g} µm, τ = {surface['tau_um']:g} µm"
    return _Cylinder(label, surface, specular(surface, THETA_DEG), cut_of(he_torrance, 30.0, **surface))


def fig_12() -> Figure:
    """Draw Fig. 12: aluminum cylinders (a) to (f)."""
    cylinders = [_cylinder(letter) for letter in "abcdef"]
    return Figure(
        key="he-torrance-1991-fig-12",
        paper="he1991",
        title="Fig. 12: aluminum cylinders of growing roughness",
        caption="The quantities behind the specular images and the highlights of the rendered cylinders, at "
        f"{GREEN_NM:g} nm: ρ_s (eq. 73) over the angle of incidence, and the directional diffuse part in the plane of "
        "incidence at 30 degrees over its value in the mirror direction; a = 0.",
        panels=[
            Panel(
                title="Specular reflectance",
                x_label="θ_i [degree]",
                y_label="ρ_s",
                curves=[_over_incidence(cylinder.label, cylinder.image) for cylinder in cylinders],
            ),
            polar_panel(
                [
                    cylinder.lobe.curve(cylinder.lobe.mirror).model_copy(update={"label": cylinder.label})
                    for cylinder in cylinders
                ],
                "f_r over f_r in the mirror direction",
                "Directional diffuse, θ_i = 30°",
            ),
        ],
        statements=[
            _diminishing_image(cylinders),
            *_spreading_lobe(cylinders),
            _specular_edges(cylinders[:3]),
            _colour_shift(),
        ],
    )


def _diminishing_image(cylinders: list[_Cylinder]) -> Statement:
    at_80 = [float(cylinder.image[80]) for cylinder in cylinders]
    expected = [by_hand.specular(cylinder.surface, 80.0) for cylinder in cylinders]
    falls = np.all(np.diff([cylinder.image for cylinder in cylinders], axis=0) <= 0.0, axis=0)
    in_order = THETA_DEG[np.logical_and.accumulate(falls)][-1]
    return Statement(
        says="The sharp specular image diminishes with increasing surface roughness.",
        where="section 5, on Fig. 12",
        seen=f"From (a) to (f) ρ_s is {listed(at_80, '.2g')} at 80 degrees. It falls from (a) to (f) at all angles up "
        f"to {in_order:g} degrees. Beyond, (f) is in less shadow than (e), because its slope σ_0/τ is smaller. By hand "
        f"ρ_s is {listed(expected, '.2g')} at 80 degrees.",
        holds=bool(in_order >= 80.0 and np.allclose(at_80, expected, rtol=BY_HAND)),
        threshold_from="the paper's words: diminishes, up to where σ_0 alone orders the images; at 80 degrees "
        "a closed form, eq. 73 by hand with the σ_0 and τ of the caption",
    )


def _spreading_lobe(cylinders: list[_Cylinder]) -> list[Statement]:
    widths = [cylinder.lobe.width_deg for cylinder in cylinders]
    slopes = [cylinder.slope for cylinder in cylinders]
    halves = [cut_of(he_torrance, 0.0, **cylinder.surface).width_deg / 2.0 for cylinder in cylinders]
    expected_halves = [by_hand.half_width_deg(slope) for slope in slopes]
    first_order = [
        (cylinder.surface["wavelength_nm"] / (4000.0 * np.pi * cylinder.surface["sigma_0_um"])) ** 2
        for cylinder in cylinders
    ]
    return [
        Statement(
            says="With increasing surface roughness, (a) to (f), the image of the light source spreads out.",
            where="section 5, on Fig. 12",
            seen=f"At half of its height the lobe is {listed(widths)} degrees wide. (f) has the largest σ_0, but is "
            f"narrower than (e): its slope σ_0/τ is {slopes[5]:.3f}, that of (e) {slopes[4]:.3f}.",
            holds=bool(np.all(np.diff(widths) > 0.0)),
            threshold_from="the paper's words: with increasing roughness, (a) to (f)",
        ),
        Statement(
            says="The lobe spreads out from (a) to (e), where τ is the same.",
            where="section 5, on Fig. 12, and its caption",
            seen=f"At half of its height the lobe is {listed(widths[:5])} degrees wide. For light along the normal "
            f"half of the width is {listed(halves[:5])}, and slopes of σ_0/τ lead to {listed(expected_halves[:5])}.",
            holds=bool(np.all(np.diff(widths[:5]) > 0.0))
            and all(
                abs(half / expected - 1.0) < first + 0.01
                for half, expected, first in zip(halves[:5], expected_halves, first_order, strict=False)
            ),
            threshold_from="the paper's words: spreads out; the limit of large g gives the width, within 1 / g and 1 %",
        ),
    ]


def _specular_edges(cylinders: list[_Cylinder]) -> Statement:
    images = [cylinder.image for cylinder in cylinders]
    return Statement(
        says="The top and lateral edges can appear specular or nearly specular at grazing angles, even when "
        "the face on the front side appears to be rough.",
        where="section 5, on Fig. 12",
        seen=f"ρ_s of (a) to (c) is {listed([image[0] for image in images], '.1e')} at normal "
        f"incidence, and up to {listed([image.max() for image in images], '.2f')} near grazing.",
        holds=all(image[0] < 1e-6 and image.max() > 0.1 for image in images),
        threshold_from="our reading: a millionth of the light is no image, a tenth is one",
    )


def _colour_shift() -> Statement:
    blue, red = (surface_of("aluminum-cylinder-12a", wavelength) for wavelength in (BLUE_NM, RED_NM))
    image = [float(specular(surface, 60.0)) for surface in (blue, red)]
    face = [float(reflected(surface, 60.0, specular=False)) for surface in (blue, red)]
    return Statement(
        says="A slight color shift: a blue shift on the front faces, and an enhanced red shift of the specular "
        "images, which is not so apparent.",
        where="section 5, on Fig. 12",
        seen=f"At 60 degrees (a) reflects {face[0]:.3f} of the light diffusely at 0.45 µm and {face[1]:.3f} at "
        f"0.65 µm; {image[0]:.4f} and {image[1]:.4f} specularly.",
        holds=face[0] > face[1] and image[0] < image[1],
        threshold_from="the paper's words: a shift towards blue, one towards red",
    )


class _Approach(NamedTuple):
    """Distances of a surface from its two limits at one slope, from smooth to very rough."""

    waves: Floats  # sigma_0 over the wavelength
    from_rough: Floats  # largest difference of f_r over the largest f_r
    from_smooth: Floats  # 1 - rho_s / |F|^2
    diffuse: Floats  # share of the light in the directional diffuse part


def _off_limit(surface: Surface, slope: float, theta_i_deg: float = 30.0) -> float:
    """Return the largest difference of f_r from the limit of very rough surfaces, over the largest f_r [1]."""
    limit = cut_of(he_torrance_very_rough, theta_i_deg, sigma_0_over_tau=slope, n=surface["n"], k=surface["k"]).f_r
    return float(abs(cut_of(he_torrance, theta_i_deg, **surface).f_r - limit).max() / limit.max())


def _approach(rough: Surface, slope: float) -> _Approach:
    """Return the distances from both limits at 30 degrees."""
    waves = np.logspace(-3.0, 2.0, 21)
    scaled = [
        {**rough, "sigma_0_um": ratio * GREEN_NM / 1000.0, "tau_um": ratio * GREEN_NM / 1000.0 / slope}
        for ratio in waves
    ]
    return _Approach(
        waves,
        np.array([_off_limit(surface, slope) for surface in scaled]),
        1.0 - np.array([float(specular(surface, 30.0)) for surface in scaled]) / float(smooth(rough, 30.0)),
        np.array([float(reflected(surface, 30.0, specular=False)) for surface in scaled]),
    )


def fig_13() -> Figure:
    """Draw Fig. 13: the three parts apart, and the approach of the model to its limits."""
    rough, mirror = (surface_of(f"aluminum-cylinder-13{letter}", GREEN_NM) for letter in "ab")
    slope = rough["sigma_0_um"] / rough["tau_um"]
    cut = cut_of(he_torrance, 30.0, **rough)
    limit = cut_of(he_torrance_very_rough, 30.0, sigma_0_over_tau=slope, n=rough["n"], k=rough["k"])
    uniform = cut_of(lambert, 30.0, **surface_of("aluminum-cylinder-13c"))
    approach = _approach(rough, slope)
    return Figure(
        key="he-torrance-1991-fig-13",
        paper="he1991",
        title="Fig. 13: limiting cases, directional diffuse, specular, uniform diffuse",
        caption=f"Cylinders (a) σ_0 = {rough['sigma_0_um']:g} µm with σ_0/τ = {slope:.3g}, (b) σ_0 = 0 and (c) ideal "
        f"diffuse, at {GREEN_NM:g} nm. The first panel has f_r in the plane of incidence at 30 degrees, with the limit "
        "of (a). The specular part of (b) is a Dirac delta; the second panel has its reflectance. The last panel has "
        "the distances of He and Torrance's model from its two limits at the slope of (a), at 30 degrees.",
        panels=[
            polar_panel(
                [
                    curve_of(label, lobe.x_deg, lobe.f_r)
                    for label, lobe in (("(a)", cut), ("(a), σ_0/λ → ∞", limit), ("(c)", uniform))
                ],
                "f_r [1/sr]",
            ),
            Panel(
                title="Specular reflectance",
                x_label="θ_i [degree]",
                y_label="ρ_s",
                curves=[
                    _over_incidence("(a)", specular(rough, THETA_DEG)),
                    _over_incidence("(b)", specular(mirror, THETA_DEG)),
                ],
            ),
            Panel(
                title="Distance from the limits",
                x_label="σ_0/λ",
                y_label="share",
                log_x=True,
                log_y=True,
                curves=[
                    curve_of(label, approach.waves, values)
                    for label, values in (
                        ("very rough: largest difference of f_r over largest f_r", approach.from_rough),
                        ("smooth: 1 - ρ_s / |F|²", approach.from_smooth),
                        ("light in the directional diffuse part", approach.diffuse),
                    )
                ],
            ),
        ],
        statements=[
            _very_rough_cylinder(rough, slope),
            _smooth_cylinder(mirror),
            _ideal_diffuse_cylinder(cut, uniform, _limit_by_hand(rough, slope, 30.0)),
            *_limits_of_smooth_surfaces(approach),
        ],
    )


def _limit_by_hand(rough: Surface, slope: float, theta_r_deg: float) -> float:
    """Return f_r [1/sr] of the limit of very rough surfaces by hand, for light at 30 degrees."""
    return by_hand.very_rough(slope, rough["n"], rough["k"], theta_i_deg=30.0, theta_r_deg=theta_r_deg)


def _very_rough_cylinder(rough: Surface, slope: float) -> Statement:
    thetas = (0.0, 30.0, 60.0, 80.0)
    offs = [_off_limit(rough, slope, theta) for theta in thetas]
    off_hand = max(
        abs(lobe_at(rough, 30.0, x) / _limit_by_hand(rough, slope, x) - 1.0) for x in (-10.0, 10.0, 30.0, 50.0)
    )
    rho_s = float(specular(rough, THETA_DEG)[30])
    return Statement(
        says="Cylinder (a) represents the directional diffuse term in the limit of σ_0/λ → ∞ with σ_0/τ fixed at 0.16.",
        where="section 5, on Fig. 13",
        seen=f"At σ_0/λ = {rough['sigma_0_um'] * 1000.0 / GREEN_NM:.2g} f_r differs from the limit by "
        f"{listed(offs, '.1e')} of its largest value at {listed(thetas)} degrees: towards grazing g falls. "
        f"ρ_s is {rho_s:g} at 30 degrees. At 30 degrees f_r is within {off_hand:.1e} of the limit by hand.",
        holds=max(*offs[:3], off_hand) < 0.01 and rho_s < 1e-9,
        threshold_from="a limit: eqs 71 to 84 by hand with e^-b / g, within 1 % up to 60 degrees",
    )


def _smooth_cylinder(mirror: Surface) -> Statement:
    images = specular(mirror, THETA_DEG)
    fresnel = by_hand.fresnel(THETA_DEG, mirror["n"], mirror["k"])
    directional = float(cut_of(he_torrance, 30.0, **mirror).f_r.max())
    return Statement(
        says="Cylinder (b) is described by the specular term, in which the reflectance is a function of "
        "incidence angle according to the Fresnel reflectivity.",
        where="section 5, on Fig. 13",
        seen=f"ρ_s and |F|² differ by {abs(images - fresnel).max():.0e} at most, from {images[0]:.4f} at "
        f"normal incidence to {images[-1]:.4f} at {THETA_DEG[-1]:g} degrees; the directional diffuse part is "
        f"{directional:g}.",
        holds=bool(np.allclose(images, fresnel, rtol=BY_HAND)) and directional == 0.0,
        threshold_from="a closed form: |F|² of textbooks, eq. 75, at every degree",
    )


def _ideal_diffuse_cylinder(cut: Cut, uniform: Cut, limit: float) -> Statement:
    return Statement(
        says="Cylinder (c) is ideal diffuse; note the striking differences between the three cylinders.",
        where="section 5, on Fig. 13",
        seen=f"f_r of (c) is {uniform.f_r.min():.4f} /sr everywhere; of (a) it goes from {cut.f_r.min():.1e} "
        f"to {cut.f_r.max():.2f} /sr.",
        holds=bool(np.ptp(uniform.f_r) == 0.0 and cut.f_r.max() > 2.0 * uniform.f_r.max() > 4.0 * cut.f_r.min())
        and abs(cut.mirror / limit - 1.0) < 0.01,
        threshold_from="our reading: striking is a factor of 2; in the mirror direction (a) has its limit by "
        "hand, within 1 %",
    )


def _limits_of_smooth_surfaces(approach: _Approach) -> list[Statement]:
    waves, shares, diffuse = approach.waves, approach.from_smooth, approach.diffuse
    expected = -np.expm1(-((4.0 * np.pi * waves[[0, 4]] * np.cos(np.deg2rad(30.0))) ** 2))
    return [
        Statement(
            says="As the wavelength of the incident light becomes large relative to the projected surface "
            "roughness, the specular term is not attenuated, since g → 0 and S → 1.",
            where="section 3.2.1",
            seen=f"At σ_0/λ = {waves[0]:g} the specular part is less than |F|² by {shares[0]:.1e} of it, at "
            f"{waves[4]:.2g} by {shares[4]:.1e}. 1 - e^-g is {listed(expected, '.1e')}.",
            holds=bool(np.all(np.diff(shares) >= 0.0) and np.allclose(shares[[0, 4]], expected, rtol=1e-6)),
            threshold_from="a closed form: 1 - e^-g, with g of eq. 9 and the roughness that is there",
        ),
        Statement(
            says="For smooth surfaces, as σ_0/λ approaches zero, the directional diffuse part diminishes to zero.",
            where="section 3.2.2",
            seen=f"At σ_0/λ = {waves[4]:.2g} it has {diffuse[4]:.1e} of the light, at {waves[0]:g} {diffuse[0]:.1e}.",
            holds=bool(np.all(np.diff(diffuse[:9]) > 0.0) and diffuse[0] < 1e-3),
            threshold_from="our reading: diminishing to zero is less than a thousandth of the light, and falling",
        ),
    ]


def fig_14() -> Figure:
    """Draw Fig. 14: the plastic cube and the table under it."""
    cube, table = (surface_of(f"scene-plastic-{name}") for name in ("cube", "table"))
    on_cube, on_table = specular(cube, THETA_DEG), specular(table, THETA_DEG)
    fresnel = by_hand.fresnel(THETA_DEG, table["n"], table["k"])
    low, high = 45, 80
    expected = [by_hand.specular(table, float(theta)) for theta in (high, low)]
    rise, of_fresnel = on_table[high] / on_table[low], fresnel[high] / fresnel[low]
    return Figure(
        key="he-torrance-1991-fig-14",
        paper="he1991",
        title="Fig. 14: images in smooth and in rough plastic",
        caption=f"ρ_s (eq. 73) over the angle of incidence, of the cube, {parameters_text(cube)}, and of the table, "
        f"{parameters_text(table)}.",
        panels=[
            Panel(
                x_label="θ_i [degree]",
                y_label="ρ_s",
                curves=[_over_incidence("cube", on_cube), _over_incidence("table", on_table)],
            )
        ],
        statements=[
            Statement(
                says="On the faces of the cube, the specular image varies with reflection angle, an effect caused "
                "solely by the Fresnel reflectivity.",
                where="section 5, on Fig. 14",
                seen=f"ρ_s grows from {on_cube[0]:.3f} to {on_cube[-1]:.3f} at {THETA_DEG[-1]:g} degrees, and differs "
                f"from |F|² by {abs(on_cube - fresnel).max():.0e} at most.",
                holds=bool(np.allclose(on_cube, fresnel, rtol=BY_HAND)),
                threshold_from="the paper's words: solely by |F|², which is that of textbooks at every degree",
            ),
            Statement(
                says="The specular images on the table top also vary with reflection angle (and disappear), but this "
                "is caused mainly by roughness effects.",
                where="section 5, on Fig. 14",
                seen=f"ρ_s is {on_table[high]:.3f} at {high} degrees and {on_table[low]:.1e} at {low}: a factor of "
                f"{rise:.1e}. |F|² contributes a factor of {of_fresnel:.2g}. By hand ρ_s is "
                f"{listed(expected, '.2g')}.",
                holds=bool(
                    on_table[low] < 1e-4
                    and rise / of_fresnel > of_fresnel
                    and np.allclose(on_table[[high, low]], expected, rtol=BY_HAND)
                ),
                threshold_from="the paper's words: mainly, read as the larger factor; a closed form, eq. 73 by hand "
                "with the σ_0 and τ of the text",
            ),
        ],
    )


FIGURES: dict[str, Callable[[], Figure]] = {
    "he-torrance-1991-fig-12": fig_12,
    "he-torrance-1991-fig-13": fig_13,
    "he-torrance-1991-fig-14": fig_14,
}
