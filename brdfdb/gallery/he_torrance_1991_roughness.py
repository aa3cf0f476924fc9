"""He et al. 1991: the three parts of reflection, Fig. 6, and the effective roughness at grazing angles, eq. 53."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.figure import Figure, Panel, Statement, curve_of, listed
from brdfdb.gallery._he_torrance_cuts import (
    Cut,
    Surface,
    cut_of,
    measured_cuts,
    parameters_text,
    reflected,
    specular,
    surface_of,
)
from brdfdb.geometry import radians
from brdfdb.models import he_torrance, he_torrance_aperture, he_torrance_parts, he_torrance_smooth
from brdfdb.parameters import Floats

Array = NDArray[np.float64]

GREEN_NM = 550.0
LOWEST = 1e-3  # least f_r [1/sr] that is drawn
NARROW_SR = 1e-6  # solid angle of cones in which the lobe is flat
PARTS_DEG = 60.0  # angle at which all three parts of the table top are seen
FAR = 10.0  # ratio of f_r for "far from ideal diffuse", our reading
CONSERVED = 0.01  # share of the light that gentle slopes may lose or gain (section 3.1)
SMALL = 0.1  # relative change for "somewhat", our reading
SPACING = 0.05  # distance of points over the autocorrelation length
POINTS = 2**17  # points of a profile, 6554 autocorrelation lengths


def profile(seed: int) -> Array:
    """Return heights over their rms value [1] along a line of a surface with the autocorrelation exp(-r^2 / tau^2).

    The array has POINTS heights, SPACING tau apart. Every cut through a Gaussian isotropic surface is such a line, so
    that the shadows along it are those of the surface.
    """
    rng = np.random.default_rng(seed)
    k = 2.0 * np.pi * np.fft.rfftfreq(POINTS, SPACING)
    # exp(-r^2) has the spectrum exp(-k^2 / 4)
    z = np.fft.irfft((rng.standard_normal(k.size) + 1j * rng.standard_normal(k.size)) * np.exp(-(k**2) / 8.0), POINTS)
    return np.asarray(z / z.std())


def reached(heights: Array, slope: float, theta: float) -> NDArray[np.bool_]:
    """Return whether a direction that leans by theta [rad] to the far end of a profile reaches each of its points.

    `slope` is sigma_0 / tau. A point is reached if no later point stands above the ray through it.
    """
    above = slope * heights - SPACING * np.arange(heights.size) / np.tan(theta)
    return np.asarray(above >= np.maximum.accumulate(above[::-1])[::-1])


def fig_06() -> Figure:
    """Draw the three parts of the light that one surface reflects."""
    surface = surface_of("scene-plastic-table", GREEN_NM)
    (total,) = measured_cuts(surface, np.array([PARTS_DEG]))
    parts = cut_of(lambda *angles: he_torrance_parts(*angles, **surface).directional_diffuse, PARTS_DEG)
    diffuse = cut_of(he_torrance, PARTS_DEG, **surface)
    uniform = np.full(parts.x_deg.shape, surface["a"] / np.pi)
    heights, shares = _shares()
    rest = diffuse.f_r - parts.f_r
    added = float(reflected(surface, PARTS_DEG) - reflected({**surface, "a": 0.0}, PARTS_DEG))
    return Figure(
        key="he-torrance-1991-fig-06",
        paper="he1991",
        title="Fig. 6: the three parts of a light intensity distribution",
        caption=f"The table top of Fig. 14 at θ_i = {PARTS_DEG:.0f}°: {parameters_text(surface)}. Fig. 6 is a sketch "
        "without parameters. Light and receiver have cones of π/1024 sr. The last panel has the shares of both "
        "parts for surfaces that reflect all light (|F|² = 1, a = 0, τ = 5 µm), at normal incidence.",
        panels=[
            _parts_panel("polar", total, parts.f_r, uniform),
            _parts_panel("curves", total, parts.f_r, uniform),
            Panel(
                title="Shares of the light, |F|² = 1",
                x_label="σ_0 / λ",
                y_label="share",
                log_x=True,
                curves=[
                    curve_of("specular", heights, shares.specular),
                    curve_of("directional diffuse", heights, shares.diffuse),
                    curve_of("both", heights, shares.specular + shares.diffuse, "ours"),
                ],
            ),
        ],
        statements=[
            _contained(surface),
            _far_from_diffuse(surface, parts.f_r),
            Statement(
                says="the last part is uniform diffuse (Lambertian)",
                where="section 3.2, on Fig. 6; a is an albedo by section 4, on Fig. 11",
                seen=f"It is {rest.min():.4f} to {rest.max():.4f} /sr in the plane of incidence, and {added:.3f} of "
                f"the light: a = {surface['a']:g}.",
                threshold_from="the paper's number: a of the table top, as an albedo",
                holds=bool(np.ptp(rest) < 1e-9) and abs(added - surface["a"]) < 1e-3,
            ),
            _partition(shares),
        ],
    )


def _parts_panel(kind: Literal["curves", "polar"], total: Cut, directional: Floats, uniform: Floats) -> Panel:
    """Return a panel of the three parts over the angle of the viewer."""
    return Panel(
        kind=kind,
        title=f"θ_i = {PARTS_DEG:.0f}°",
        x_label="θ_r [degree]",
        y_label="f_r [1/sr]",
        log_y=kind == "curves",
        curves=[
            curve_of("all, through the cones", total.x_deg, total.f_r, "ours"),
            curve_of("directional diffuse", total.x_deg, np.where(directional < LOWEST, np.nan, directional)),
            curve_of("uniform diffuse", total.x_deg, uniform),
        ],
    )


def _contained(surface: Surface) -> Statement:
    half_angle = float(np.arcsin(np.sqrt(NARROW_SR / np.pi)))
    off = np.linspace(-3.0, 3.0, 25)  # distance of the axes of both cones, in half angles of a cone
    theta = float(radians(PARTS_DEG))
    viewer = theta + off * half_angle
    cones: dict[str, Any] = {"incident_solid_angle_sr": NARROW_SR, "received_solid_angle_sr": NARROW_SR}
    through_cones = he_torrance_aperture(theta, 0.0, viewer, np.pi, **cones, **surface)
    spike = through_cones - he_torrance(theta, 0.0, viewer, np.pi, **surface)
    expected = float(specular(surface, PARTS_DEG)) / (np.cos(theta) * NARROW_SR)
    # Area that two equal circles share, over the area of one
    apart = np.minimum(np.abs(off) / 2.0, 1.0)
    shared = 2.0 / np.pi * (np.arccos(apart) - apart * np.sqrt(1.0 - apart**2))
    most = float(np.abs(spike / expected - shared).max())
    return Statement(
        says="the specularly-reflected part is contained within the specular cone of reflection",
        where="section 3.2, on Fig. 6",
        seen=f"Through cones of {NARROW_SR:.0e} sr it is {float(spike.max()):.4g} /sr in the mirror direction, where "
        f"ρ_s / (cos θ_i dω_i) of eq. 6 is {expected:.4g}. Around that direction it falls with the area that two "
        f"circles share, to 0 where the cones no longer overlap, within {most:.0e} of its height.",
        threshold_from="a closed form: eq. 6, and the area that two circles share",
        holds=most < 1e-3,
    )


def _far_from_diffuse(surface: Surface, f_r: Floats) -> Statement:
    mean = float(reflected({**surface, "a": 0.0}, PARTS_DEG, specular=False)) / np.pi
    return Statement(
        says="the diffraction-scattered part shows a directional distribution which is far from ideal diffuse",
        where="section 3.2, on Fig. 6",
        seen=f"Its largest f_r is {f_r.max() / mean:.0f} times that of an ideal diffuser of the same reflectance (far: "
        f"{FAR:.0f}).",
        threshold_from="our reading: far from ideal diffuse is ten times as high",
        holds=bool(f_r.max() > FAR * mean),
    )


class _Shares(NamedTuple):
    """Shares [1] of the light in the specular and in the directional diffuse part."""

    specular: Floats
    diffuse: Floats


def _shares() -> tuple[Floats, _Shares]:
    """Return sigma_0 over the wavelength, and the shares of the parts for a surface that reflects all light."""
    over_wavelength = np.geomspace(0.01, 0.3, 9)
    mirror = {"wavelength_nm": GREEN_NM, "tau_um": 5.0, "n": 1.0, "k": 1e4, "a": 0.0}
    surfaces = [{**mirror, "sigma_0_um": ratio * GREEN_NM / 1000.0} for ratio in over_wavelength.tolist()]
    return over_wavelength, _Shares(
        np.array([float(specular(surface, 0.0)) for surface in surfaces]),
        np.array([float(reflected(surface, 0.0, specular=False)) for surface in surfaces]),
    )


def _partition(shares: _Shares) -> Statement:
    total = shares.specular + shares.diffuse
    return Statement(
        says="the model partitions energy into specular and diffuse-like components according to the roughness of the "
        "surface",
        where="section 1",
        seen=f"For a surface that reflects all light the two parts add up to {total.min():.4f} to {total.max():.4f} at "
        f"normal incidence, while the specular share falls from {shares.specular[0]:.3f} to {shares.specular[-1]:.0e}.",
        threshold_from="conservation: all light that is received, within 1 %",
        holds=bool(
            np.all(np.abs(total - 1.0) < CONSERVED)
            and np.all(np.diff(shares.specular) < 0.0)
            and shares.specular[0] > 0.9
            and shares.specular[-1] < 0.01
        ),
    )


ANGLES_DEG = np.append(np.arange(0.0, 85.0, 2.5), [85.0, 86.0, 87.0, 88.0, 88.5, 89.0])
SLOPES = {"aluminum of Fig. 8": 0.28 / 1.77, "table top of Fig. 14": 0.1, "σ_0/τ = 0.05": 0.05}
SIMULATED_DEG = np.array([45.0, 60.0, 70.0, 75.0, 80.0, 83.0, 86.0, 88.0, 89.0])
LONG_NM = 1e7  # wavelength at which e^-g is 1, so that rho_s over |F|^2 is S


class _Visible(NamedTuple):
    """Shadowing and effective roughness of a surface, with the viewer in the mirror direction of the light."""

    shadowing: Floats  # S
    roughness: Floats  # sigma / sigma_0


def _of_model(slope: float, angles_deg: Floats) -> _Visible:
    """Return S and sigma / sigma_0 [1] of the model, from its specular part at two wavelengths."""
    cosine = np.cos(radians(angles_deg))
    sigma_0_um = 0.1
    surface = {"sigma_0_um": sigma_0_um, "tau_um": sigma_0_um / slope, "n": 1.0, "k": 1e4}
    # g is (sigma / sigma_0)^2 at this wavelength
    short_nm = 4.0 * np.pi * sigma_0_um * 1000.0 * cosine
    short, long = (specular({**surface, "wavelength_nm": nm}, angles_deg) for nm in (short_nm, LONG_NM))
    return _Visible(
        long / he_torrance_smooth(radians(angles_deg), n=surface["n"], k=surface["k"]),
        np.sqrt(np.maximum(-np.log(short / long), 0.0)),
    )


def _of_profiles(slope: float, angles_deg: Floats) -> tuple[_Visible, Floats]:
    """Return S and sigma / sigma_0 [1] of a simulated profile, and the share [1] that one direction alone reaches."""
    heights = profile(1991)
    lit = [reached(heights, slope, float(angle)) for angle in radians(angles_deg)]
    viewed = [reached(heights[::-1], slope, float(angle))[::-1] for angle in radians(angles_deg)]
    both = [one & other for one, other in zip(lit, viewed, strict=True)]
    visible = _Visible(
        np.array([points.mean() for points in both]), np.array([heights[points].std() for points in both])
    )
    return visible, np.array([points.mean() for points in lit])


def _g_with_sigma_0(surface: Surface, theta_deg: float | Floats) -> Floats:
    """Return g [1] of the specular part with sigma_0 in place of the effective roughness."""
    cosine = np.cos(radians(theta_deg))
    return np.asarray((4.0 * np.pi * surface["sigma_0_um"] * 1000.0 * cosine / surface["wavelength_nm"]) ** 2)


def _over_angles(title: str, y_label: str, models: dict[str, Floats], simulated: Floats) -> Panel:
    """Return a panel of a quantity over the angle, by the model for some slopes and by simulation."""
    return Panel(
        title=title,
        x_label="θ_i = θ_r [degree]",
        y_label=y_label,
        curves=[
            *(curve_of(name, ANGLES_DEG, values) for name, values in models.items()),
            curve_of("aluminum, simulated", SIMULATED_DEG, simulated, "truth"),
        ],
    )


def effective_roughness() -> Figure:
    """Draw shadowing and effective roughness towards grazing, of the model and of simulated surfaces."""
    slope = SLOPES["aluminum of Fig. 8"]
    aluminum = surface_of("roughened-aluminum-500nm")
    models = {name: _of_model(steepness, ANGLES_DEG) for name, steepness in SLOPES.items()}
    simulated, _ = _of_profiles(slope, SIMULATED_DEG)
    drawn = _of_model(slope, ANGLES_DEG)
    rho_s = specular(aluminum, ANGLES_DEG)
    g_0 = _g_with_sigma_0(aluminum, ANGLES_DEG)
    fixed = he_torrance_smooth(radians(ANGLES_DEG), n=aluminum["n"], k=aluminum["k"]) * drawn.shadowing * np.exp(-g_0)
    return Figure(
        key="he-torrance-1991-effective-roughness",
        paper="he1991",
        title="Effective roughness and shadowing at grazing angles",
        caption="Light and viewer in each other's mirror direction. S and σ are taken from ρ_s (eq. 73) at two "
        "wavelengths. Simulated: a Gaussian profile of 6554 autocorrelation lengths. Its points count if both light "
        "and viewer reach them; σ is the standard deviation of their heights. The paper has no such figure.",
        panels=[
            _over_angles(
                "Effective roughness, eq. 53",
                "σ / σ_0",
                {name: model.roughness for name, model in models.items()},
                simulated.roughness,
            ),
            _over_angles(
                "Shadowing, eq. 23",
                "S",
                {name: model.shadowing for name, model in models.items()},
                simulated.shadowing,
            ),
            Panel(
                title="Specular reflectance of aluminum at 0.5 µm",
                x_label="θ_i [degree]",
                y_label="ρ_s",
                curves=[
                    curve_of("effective roughness", ANGLES_DEG, rho_s, "ours"),
                    curve_of("with σ_0 in its place", ANGLES_DEG, fixed),
                ],
            ),
        ],
        statements=[_smaller(models), _of_lit_parts(slope), _smoother(slope), *_shadowing(slope)],
    )


def _smaller(models: dict[str, _Visible]) -> Statement:
    index = [int(np.searchsorted(ANGLES_DEG, angle)) for angle in (45.0, 75.0, 89.0)]
    values = {name: model.roughness[index] for name, model in models.items()}
    rows = "; ".join(f"{name}: {listed(row, '.3f')}" for name, row in values.items())
    return Statement(
        says="when roughness valleys are shadowed or masked, the effective surface roughness can be significantly "
        "smaller than the rms roughness σ_0, especially at grazing angles of incidence or reflection",
        where="section 3.1",
        seen=f"σ / σ_0 at 45, 75 and 89°: {rows}.",
        threshold_from="our reading: significantly smaller is less than half",
        holds=all(row[0] > 0.99 and row[-1] < 0.5 for row in values.values()),
    )


def _of_lit_parts(slope: float) -> Statement:
    model, (simulated, _) = _of_model(slope, SIMULATED_DEG), _of_profiles(slope, SIMULATED_DEG)
    off = model.roughness / simulated.roughness - 1.0
    return Statement(
        says="σ is the effective surface roughness because the surface averaging is carried over illuminated and "
        "visible parts only",
        where="appendix A.4, eqs 53 to 55",
        seen="On simulated surfaces with the slope of the aluminum the heights of such parts have a standard deviation "
        f"of {listed(simulated.roughness, '.2f')} σ_0 at {listed(SIMULATED_DEG, '.0f')}°; eq. 53 gives "
        f"{listed(model.roughness, '.2f')}, which is {off.min():+.0%} to {off.max():+.0%} off: it falls too late, and "
        "then too far.",
        threshold_from="our reading: the roughness of lit parts is within 10 % of that of a simulation",
        holds=bool(np.abs(off).max() < SMALL),
    )


def _smoother(slope: float) -> Statement:
    ratio = float(_of_model(slope, np.array([75.0])).roughness[0])
    g_0 = float(_g_with_sigma_0(surface_of("roughened-aluminum-500nm"), 75.0))
    return Statement(
        says="for 75° a specular peak emerges as the surface appears somewhat smoother to the incident radiation",
        where="section 4, on Fig. 8",
        seen=f"There σ is {ratio:.3f} σ_0 (somewhat: by less than {SMALL:.0%}, more than 1 %); e^-g is "
        f"{np.exp(-g_0 * ratio**2):.3f}, and would be {np.exp(-g_0):.3f} with σ_0.",
        threshold_from="our reading: somewhat is between 1 and 10 %",
        holds=1.0 - SMALL < ratio < 0.99,
    )


def _shadowing(slope: float) -> list[Statement]:
    model, (simulated, alone) = _of_model(slope, SIMULATED_DEG), _of_profiles(slope, SIMULATED_DEG)
    one = np.sqrt(model.shadowing)
    off = float(np.abs(one - alone).max())
    index = int(np.searchsorted(SIMULATED_DEG, 80.0))
    return [
        Statement(
            says="the shadowing factor due to Smith has been found to agree with statistical numerical simulations of "
            "a Gaussian rough surface",
            where="section 2.4",
            seen=f"Light reaches {listed(alone, '.3f')} of a simulated profile at {listed(SIMULATED_DEG, '.0f')}°; S_i "
            f"is {listed(one, '.3f')}, {off:.3f} off at most.",
            threshold_from="our reading: in agreement is within 5 % of the surface",
            holds=off < 0.05,
        ),
        Statement(
            says="S is the fraction of the surface that is both illuminated and viewed",
            where="appendix A.1, eq. 23",
            seen=f"At 80° {simulated.shadowing[index]:.3f} of a simulated profile is lit and seen from the mirror "
            f"direction, and S is {model.shadowing[index]:.3f}. A viewer next to the light sees all lit points, "
            f"{alone[index]:.3f}; S is the same {model.shadowing[index]:.3f} there.",
            threshold_from="our reading: the fraction is within 5 % of the surface",
            holds=abs(model.shadowing[index] - alone[index]) < 0.05,
        ),
    ]


FIGURES: dict[str, Callable[[], Figure]] = {
    "he-torrance-1991-fig-06": fig_06,
    "he-torrance-1991-effective-roughness": effective_roughness,
}
