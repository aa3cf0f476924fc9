"""He, Torrance, Sillion and Greenberg 1991: the rendered cylinders, Figs 12 and 13, and the scene of Fig. 14."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from brdfdb.figure import Curve, Figure, Panel, Statement, curve_of, listed
from brdfdb.gallery import _he_torrance_by_hand as by_hand
from brdfdb.gallery._he_torrance_cuts import (
    Cut,
    Surface,
    cut_of,
    described,
    lobe_at,
    reflected,
    smooth,
    specular,
    surface_of,
)
from brdfdb.models import he_torrance, he_torrance_very_rough, lambert
from brdfdb.parameters import Floats

GREEN_NM, BLUE_NM, RED_NM = 550.0, 450.0, 650.0
BY_HAND = 1e-9  # relative, between a closed form and the model
THETA_DEG = np.arange(0.0, 90.0)  # angles of incidence that reflectances are drawn over


def _over_incidence(label: str, values: Floats) -> Curve:
    return curve_of(label, THETA_DEG, values)


def fig_12() -> Figure:
    """Aluminum cylinders (a) to (f)."""
    names = {letter: f"aluminum-cylinder-12{letter}" for letter in "abcdef"}
    surfaces = {letter: surface_of(name, GREEN_NM) for letter, name in names.items()}
    labels = {
        letter: f"({letter}) σ_0 = {surface['sigma_0_um']:g} µm, τ = {surface['tau_um']:g} µm"
        for letter, surface in surfaces.items()
    }
    images = {letter: specular(surface, THETA_DEG) for letter, surface in surfaces.items()}
    lobes = {letter: cut_of(he_torrance, 30.0, **surface) for letter, surface in surfaces.items()}
    return Figure(
        key="he-torrance-1991-fig-12",
        paper="he1991",
        title="Fig. 12: aluminum cylinders of growing roughness",
        caption="What the specular images and the highlights of the rendered cylinders are made of, at "
        f"{GREEN_NM:g} nm: ρ_s (eq. 73) over the angle of incidence, and the directional diffuse part in the plane of "
        "incidence at 30 degrees over its value in the mirror direction; a = 0.",
        panels=[
            Panel(
                title="Specular reflectance",
                x_label="θ_i [degree]",
                y_label="ρ_s",
                curves=[_over_incidence(labels[letter], image) for letter, image in images.items()],
            ),
            Panel(
                kind="polar",
                title="Directional diffuse, θ_i = 30°",
                x_label="θ_r [degree]",
                y_label="f_r over f_r in the mirror direction",
                curves=[
                    lobe.curve(lobe.mirror).model_copy(update={"label": labels[letter]})
                    for letter, lobe in lobes.items()
                ],
            ),
        ],
        statements=[
            _of_diminishing_images(surfaces, images),
            *_of_spreading_lobes(surfaces, lobes),
            _of_edges(images),
            _of_colours(names["a"]),
        ],
    )


def _of_diminishing_images(surfaces: dict[str, Surface], images: dict[str, Floats]) -> Statement:
    """Return the statement of Fig. 12 on the specular images of cylinders."""
    at_80 = [float(image[80]) for image in images.values()]
    expected_at_80 = [by_hand.specular(surface, 80.0) for surface in surfaces.values()]
    falls = np.all(np.diff(list(images.values()), axis=0) <= 0.0, axis=0)
    in_order = THETA_DEG[np.logical_and.accumulate(falls)][-1]
    return Statement(
        says="The sharp specular image diminishes with increasing surface roughness.",
        where="section 5, on Fig. 12",
        seen=f"From (a) to (f) ρ_s is {listed(at_80, '.2g')} at 80 degrees, and falls at all angles up to "
        f"{in_order:g}; beyond, (f), whose slope σ_0/τ is smaller, is in less shadow than (e). By hand it is "
        f"{listed(expected_at_80, '.2g')} at 80 degrees.",
        holds=bool(in_order >= 80.0 and np.allclose(at_80, expected_at_80, rtol=BY_HAND)),
        threshold_from="the paper's words: diminishes, up to where σ_0 alone orders the images; at 80 degrees "
        "a closed form, eq. 73 by hand with the σ_0 and τ of the caption",
    )


def _of_spreading_lobes(surfaces: dict[str, Surface], lobes: dict[str, Cut]) -> list[Statement]:
    """Return the statements of Fig. 12 on the widths of the lobes."""
    widths = [lobe.width_deg for lobe in lobes.values()]
    slopes = [surface["sigma_0_um"] / surface["tau_um"] for surface in surfaces.values()]
    halves = [cut_of(he_torrance, 0.0, **surface).width_deg / 2.0 for surface in surfaces.values()]
    expected_halves = [by_hand.half_width_deg(slope) for slope in slopes]
    first_order = [
        (surface["wavelength_nm"] / (4000.0 * np.pi * surface["sigma_0_um"])) ** 2 for surface in surfaces.values()
    ]
    return [
        Statement(
            says="With increasing surface roughness, (a) to (f), the image of the light source spreads out.",
            where="section 5, on Fig. 12",
            seen=f"At half of its height the lobe is {listed(widths)} degrees wide. (f), of the largest σ_0, is "
            f"narrower than (e): its slope σ_0/τ is {slopes[5]:.3f}, that of (e) {slopes[4]:.3f}.",
            holds=bool(np.all(np.diff(widths) > 0.0)),
            threshold_from="the paper's words: with increasing roughness, (a) to (f)",
        ),
        Statement(
            says="The lobe spreads out from (a) to (e), where τ is the same.",
            where="section 5, on Fig. 12, and its caption",
            seen=f"At half of its height the lobe is {listed(widths[:5])} degrees wide. For light along the normal "
            f"half of that is {listed(halves[:5])}, where slopes of σ_0/τ lead to {listed(expected_halves[:5])}.",
            holds=bool(np.all(np.diff(widths[:5]) > 0.0))
            and all(
                abs(half / expected - 1.0) < first + 0.01
                for half, expected, first in zip(halves[:5], expected_halves, first_order, strict=False)
            ),
            threshold_from="the paper's words: spreads out; by how much, the limit of large g says, within 1 / g "
            "and 1 %",
        ),
    ]


def _of_edges(images: dict[str, Floats]) -> Statement:
    """Return the statement of Fig. 12 on the edges of rough cylinders."""
    return Statement(
        says="The top and lateral edges can appear specular or nearly specular at grazing angles, even when "
        "the face on the front side appears to be rough.",
        where="section 5, on Fig. 12",
        seen=f"ρ_s of (a) to (c) is {listed([images[letter][0] for letter in 'abc'], '.1e')} at normal "
        f"incidence, and up to {listed([images[letter].max() for letter in 'abc'], '.2f')} near grazing.",
        holds=all(images[letter][0] < 1e-6 and images[letter].max() > 0.1 for letter in "abc"),
        threshold_from="our reading: a millionth of the light is no image, a tenth is one",
    )


def _of_colours(name: str) -> Statement:
    """Return the statement of Fig. 12 on the colours of cylinder (a)."""
    blue, red = (surface_of(name, wavelength) for wavelength in (BLUE_NM, RED_NM))
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


class _Limits(NamedTuple):
    """Shares over sigma_0 / lambda [1] at one slope sigma_0 / tau, from smooth to very rough."""

    ratios: Floats
    from_rough: Floats
    from_smooth: Floats
    left: Floats

    def curves(self) -> list[Curve]:
        """Return the curves of Fig. 13."""
        named = (
            ("very rough: largest difference of f_r over largest f_r", self.from_rough),
            ("smooth: 1 - ρ_s / |F|²", self.from_smooth),
            ("light in the directional diffuse part", self.left),
        )
        return [curve_of(label, self.ratios, values) for label, values in named]


def _very_rough(rough: Surface, theta_i_deg: float) -> Cut:
    """Return the cut of the very rough limit at the slope of a surface."""
    slope = rough["sigma_0_um"] / rough["tau_um"]
    return cut_of(he_torrance_very_rough, theta_i_deg, sigma_0_over_tau=slope, n=rough["n"], k=rough["k"])


def _off(surface: Surface, rough: Surface, theta_i_deg: float = 30.0) -> float:
    """Return the largest difference of f_r from the very rough limit, over its largest value."""
    tends = _very_rough(rough, theta_i_deg).f_r
    return float(abs(cut_of(he_torrance, theta_i_deg, **surface).f_r - tends).max() / tends.max())


def _limits_of(rough: Surface) -> _Limits:
    slope = rough["sigma_0_um"] / rough["tau_um"]
    ratios = np.logspace(-3.0, 2.0, 21)
    scaled = [
        {**rough, "sigma_0_um": ratio * GREEN_NM / 1000.0, "tau_um": ratio * GREEN_NM / 1000.0 / slope}
        for ratio in ratios
    ]
    from_smooth = 1.0 - np.array([float(specular(surface, 30.0)) for surface in scaled]) / float(smooth(rough, 30.0))
    left = np.array([float(reflected(surface, 30.0, specular=False)) for surface in scaled])
    return _Limits(ratios, np.array([_off(surface, rough) for surface in scaled]), from_smooth, left)


def fig_13() -> Figure:
    """The three terms apart, and how he_torrance tends to its limits."""
    rough, mirror = (surface_of(f"aluminum-cylinder-13{letter}", GREEN_NM) for letter in "ab")
    slope = rough["sigma_0_um"] / rough["tau_um"]
    cut, limit = cut_of(he_torrance, 30.0, **rough), _very_rough(rough, 30.0)
    uniform = cut_of(lambert, 30.0, **surface_of("aluminum-cylinder-13c"))
    images, dull = specular(mirror, THETA_DEG), specular(rough, THETA_DEG)
    limits = _limits_of(rough)
    return Figure(
        key="he-torrance-1991-fig-13",
        paper="he1991",
        title="Fig. 13: limiting cases, directional diffuse, specular, uniform diffuse",
        caption=f"Cylinders (a) σ_0 = {rough['sigma_0_um']:g} µm with σ_0/τ = {slope:.3g}, (b) σ_0 = 0 and (c) ideal "
        f"diffuse, at {GREEN_NM:g} nm. "
        "First f_r in the plane of incidence at 30 degrees, of (a) beside its limit; the specular part of (b) is a "
        "Dirac delta, and its reflectance follows. Last, how far He and Torrance's model is from its two limits at the "
        "slope of (a), at 30 degrees.",
        panels=[
            Panel(
                kind="polar",
                x_label="θ_r [degree]",
                y_label="f_r [1/sr]",
                curves=[
                    curve_of(label, lobe.x_deg, lobe.f_r)
                    for label, lobe in (("(a)", cut), ("(a), σ_0/λ → ∞", limit), ("(c)", uniform))
                ],
            ),
            Panel(
                title="Specular reflectance",
                x_label="θ_i [degree]",
                y_label="ρ_s",
                curves=[_over_incidence("(a)", dull), _over_incidence("(b)", images)],
            ),
            Panel(
                title="Distance from the limits",
                x_label="σ_0/λ",
                y_label="share",
                log_x=True,
                log_y=True,
                curves=limits.curves(),
            ),
        ],
        statements=[
            *_of_the_three_cylinders(rough, mirror, cut, uniform),
            *_of_the_limits(limits),
        ],
    )


def _of_the_three_cylinders(rough: Surface, mirror: Surface, cut: Cut, uniform: Cut) -> list[Statement]:
    """Return the statements on the cylinders of Fig. 13: very rough, smooth and ideal diffuse."""
    optics = {key: rough[key] for key in ("n", "k")}
    slope = rough["sigma_0_um"] / rough["tau_um"]
    thetas = (0.0, 30.0, 60.0, 80.0)
    offs = [_off(rough, rough, theta) for theta in thetas]
    fresnel = by_hand.fresnel(THETA_DEG, **optics)
    hand = [
        (lobe_at(rough, 30.0, x), by_hand.very_rough(slope, **optics, theta_i_deg=30.0, theta_r_deg=x))
        for x in (-10.0, 10.0, 30.0, 50.0)
    ]
    off_hand = max(abs(found / expected - 1.0) for found, expected in hand)
    images, dull = specular(mirror, THETA_DEG), specular(rough, THETA_DEG)
    directional = float(cut_of(he_torrance, 30.0, **mirror).f_r.max())
    return [
        Statement(
            says="Cylinder (a) represents the directional diffuse term in the limit of σ_0/λ → ∞ with σ_0/τ fixed "
            "at 0.16.",
            where="section 5, on Fig. 13",
            seen=f"At σ_0/λ = {rough['sigma_0_um'] * 1000.0 / GREEN_NM:.2g} f_r differs from the limit by "
            f"{listed(offs, '.1e')} of its largest value at {listed(thetas)} degrees: towards grazing g falls. "
            f"ρ_s is {dull[30]:g} at 30 degrees. At 30 degrees f_r is within {off_hand:.1e} of the limit by hand.",
            holds=max(*offs[:3], off_hand) < 0.01 and bool(dull[30] < 1e-9),
            threshold_from="a limit: eqs 71 to 84 by hand with e^-b / g, within 1 % up to 60 degrees",
        ),
        Statement(
            says="Cylinder (b) is described by the specular term, in which the reflectance is a function of "
            "incidence angle according to the Fresnel reflectivity.",
            where="section 5, on Fig. 13",
            seen=f"ρ_s and |F|² differ by {abs(images - fresnel).max():.0e} at most, from {images[0]:.4f} at "
            f"normal incidence to {images[-1]:.4f} at {THETA_DEG[-1]:g} degrees; the directional diffuse part is "
            f"{directional:g}.",
            holds=bool(np.allclose(images, fresnel, rtol=BY_HAND)) and directional == 0.0,
            threshold_from="a closed form: |F|² of textbooks, eq. 75, at every degree",
        ),
        Statement(
            says="Cylinder (c) is ideal diffuse; note the striking differences between the three cylinders.",
            where="section 5, on Fig. 13",
            seen=f"f_r of (c) is {uniform.f_r.min():.4f} /sr everywhere; of (a) it goes from {cut.f_r.min():.1e} "
            f"to {cut.f_r.max():.2f} /sr.",
            holds=bool(np.ptp(uniform.f_r) == 0.0 and cut.f_r.max() > 2.0 * uniform.f_r.max() > 4.0 * cut.f_r.min())
            and abs(cut.mirror / hand[2][1] - 1.0) < 0.01,
            threshold_from="our reading: striking is a factor of 2; in the mirror direction (a) has its limit by "
            "hand, within 1 %",
        ),
    ]


def _of_the_limits(limits: _Limits) -> list[Statement]:
    """Return the statements on smooth surfaces, as sigma_0 / lambda goes to 0."""
    ratios, _, from_smooth, left = limits
    expected_g = (4.0 * np.pi * ratios[[0, 4]] * np.cos(np.deg2rad(30.0))) ** 2
    return [
        Statement(
            says="As the wavelength of the incident light becomes large relative to the projected surface "
            "roughness, the specular term is not attenuated, since g → 0 and S → 1.",
            where="section 3.2.1",
            seen=f"At σ_0/λ = {ratios[0]:g} the specular part is less than |F|² by {from_smooth[0]:.1e} of it, at "
            f"{ratios[4]:.2g} by {from_smooth[4]:.1e}, where 1 - e^-g is "
            f"{listed(-np.expm1(-expected_g), '.1e')}.",
            holds=bool(
                np.all(np.diff(from_smooth) >= 0.0)
                and np.allclose(from_smooth[[0, 4]], -np.expm1(-expected_g), rtol=1e-6)
            ),
            threshold_from="a closed form: 1 - e^-g, with g of eq. 9 and the roughness that is there",
        ),
        Statement(
            says="For smooth surfaces, as σ_0/λ approaches zero, the directional diffuse part diminishes to zero.",
            where="section 3.2.2",
            seen=f"At σ_0/λ = {ratios[4]:.2g} it has {left[4]:.1e} of the light, at {ratios[0]:g} {left[0]:.1e}.",
            holds=bool(np.all(np.diff(left[:9]) > 0.0) and left[0] < 1e-3),
            threshold_from="our reading: diminishing to zero is less than a thousandth of the light, and falling",
        ),
    ]


def fig_14() -> Figure:
    """The plastic cube and the table under it."""
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
        caption=f"ρ_s (eq. 73) over the angle of incidence, of the cube, {described(cube)}, and of the table, "
        f"{described(table)}.",
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
                f"{rise:.1e}, of which |F|² is {of_fresnel:.2g}; by hand it is "
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
