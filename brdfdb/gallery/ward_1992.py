"""Ward 1992: slices and highlights of the elliptical Gaussian model, and all figures of its lobe."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from brdfdb.figure import Figure, Map, Panel, Picture, Statement, curve_of, rows
from brdfdb.gallery._ward_slices import (
    ALONG_X,
    ANGLE,
    BRDF,
    PLANES,
    ROUNDING,
    SLICES_DEG,
    VIEWERS_DEG,
    WIDTH,
    Array,
    f_r_of,
    half_widths_deg,
    isotropic,
    parameters_text,
    slice_of,
)
from brdfdb.gallery._ward_sphere import CAMERA_DEG, LIGHT_DEG, points_at
from brdfdb.gallery.ward_1992_forms import forms, lobes
from brdfdb.geometry import degrees, radians
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.materials import Material, presets

_WHITE = 0.2  # share of the brightest point that is white, so that the diffuse part shows, too
_ON_THE_RIDGE = 0.01  # tolerance in the projected plane; the ridge is 0.06 wide on each side
_BENT = 0.1  # share of the thickness of a highlight by which a crescent is bent
_SECOND_ORDER = 0.1  # share of the first order of a series in alpha, for alpha up to 0.16
_NEAR_TOTAL = (
    0.05  # share of rho_s for "will equal", our reading; "accurate as long as alpha is not much greater than 0.2"
)


def _image() -> Figure:
    """Draw Fig. 4: the hemisphere that the gonioreflectometer sees at once."""
    aluminum = presets()["rolled-aluminum"]
    theta_i = float(radians(30.0))
    axis = np.linspace(-1.0, 1.0, 61)
    values = _projected(aluminum, theta_i, axis, axis)

    across = np.linspace(-0.3, 0.3, 7)
    along = np.linspace(-1.0, 1.0, 2001)
    ridge = along[np.nanargmax(np.nan_to_num(_projected(aluminum, theta_i, along, across), nan=-1.0), axis=1)]
    off = float(np.max(np.abs(ridge + np.sin(theta_i))))
    widths, expected = half_widths_deg(aluminum)
    return Figure(
        key="ward-1992-fig-04",
        paper="ward1992",
        title="Fig. 4: the highlight of rolled aluminum over the hemisphere",
        caption=f"{parameters_text(aluminum)}, lit from (theta_i, phi_i) = (30, 0) degrees, from x > 0; after Fig. 4, "
        "a photograph. The axes are the direction of the viewer, projected on the surface.",
        panels=[
            Map(
                x_label="sin(theta_r) cos(phi_r)",
                y_label="sin(theta_r) sin(phi_r)",
                value_label=BRDF,
                x=np.round(axis, 4).tolist(),
                y=np.round(axis, 4).tolist(),
                values=rows(values, 4),
                log=True,
            )
        ],
        statements=[
            Statement(
                says="the half vectors that lean along the wider axis mirror light from the x axis to "
                "sin(theta_r) cos(phi_r) = -sin(theta_i): a straight streak in this projection, a cone about x",
                where="property of the form: Fig. 5 and eq. 5a, exponent with alpha_x < alpha_y",
                seen=f"up to 0.3 on both sides of the plane of incidence, the largest f_r is within {off:.4f} of that "
                "line",
                holds=off < _ON_THE_RIDGE,
                threshold_from="a closed form: the mirror direction of half vectors along y, within "
                f"{_ON_THE_RIDGE:g}, a sixth of half the width of the streak",
            ),
            Statement(
                says='"Unfinished aluminum exhibits anisotropy from rolling during its manufacture"',
                where="Fig. 6, caption",
                seen=f"lit along the normal, the lobe falls to half its peak {widths[0]:.2f} degrees off along x and "
                f"{widths[1]:.2f} along y; alpha of .04 and .09 lead to {expected[0]:.2f} and {expected[1]:.2f}",
                holds=bool(np.allclose(widths, expected, rtol=WIDTH)),
                threshold_from="the paper's number: alpha of the table in section 6, by eq. 5a",
            ),
        ],
    )


def _projected(material: Material, theta_i: float, x: Array, y: Array) -> Array:
    """Return f_r [1/sr] by the projection of the viewer on the surface, [y][x]; nan outside of the hemisphere."""
    x_r, y_r = np.meshgrid(x, y)
    sin_r = np.hypot(x_r, y_r)
    inside = sin_r < 1.0
    f_r = f_r_of(material, theta_i, ALONG_X, np.arcsin(np.where(inside, sin_r, 0.0)), np.arctan2(y_r, x_r))
    return np.where(inside, f_r, np.nan)


def _slices() -> Figure:
    """Draw Fig. 6: slices in the plane of incidence."""
    aluminum = presets()["rolled-aluminum"]
    panels = [
        Panel(
            title=f"plane of incidence along {axis}",
            x_label=ANGLE,
            y_label=BRDF,
            curves=[
                curve_of(f"theta_i = {theta_i_deg:g}", VIEWERS_DEG, slice_of(aluminum, theta_i_deg, phi))
                for theta_i_deg in SLICES_DEG
            ],
            log_y=True,
        )
        for axis, phi in PLANES
    ]
    beyond_deg, expected_deg = _peak_beyond_mirror(aluminum, SLICES_DEG[-1])
    asymmetry = _asymmetry(aluminum)
    total = float(directional_albedo(aluminum.model, 0.0, tolerance=1e-6, **aluminum.arguments()).albedo)
    reflectances = aluminum.numbers["rho_d"] + aluminum.numbers["rho_s"]
    missing = (reflectances - total) / aluminum.numbers["rho_s"]
    first_order = 1.5 * (aluminum.numbers["alpha_x"] ** 2 + aluminum.numbers["alpha_y"] ** 2)
    return Figure(
        key="ward-1992-fig-06",
        paper="ward1992",
        title="Fig. 6: the elliptical Gaussian fit of unfinished aluminum, in the plane of incidence",
        caption=f"{parameters_text(aluminum)}. Fig. 6 shows a slice at 6 angles, which the text does not name. The "
        "text does not say either how the plane lies to the rolling, so ours are in the planes along both axes. The "
        "measured points are not printed as numbers.",
        panels=list(panels),
        statements=[
            Statement(
                says='"It is clear by inspection that the above formula is symmetric with respect to its incident and '
                'reflected angles"',
                where="section 4.1, of eq. 4; 5a inherits it",
                seen=f"light and viewer exchanged, at 6 angles and 24 azimuths: {asymmetry:.1g} of f_r apart at most",
                holds=asymmetry < ROUNDING,
                threshold_from="the paper's words: symmetric, except for rounding",
            ),
            Statement(
                says='"the normalization of the above anisotropic model is such that the total surface reflectance '
                'will equal the diffuse reflectance coefficient, rho_d, plus the ... coefficient, rho_s"',
                where="section 4.2",
                seen=f"lit along the normal the surface reflects {total:.4f}, rho_d + rho_s is {reflectances:g}; "
                f"{100.0 * missing:.2f} % of rho_s is missing, and 3 (alpha_x^2 + alpha_y^2) / 2 is "
                f"{100.0 * first_order:.2f} %",
                holds=0.0 < missing < _NEAR_TOTAL and abs(missing / first_order - 1.0) < _SECOND_ORDER,
                threshold_from="conservation: eq. 5a integrated for small alpha, within a tenth for the next order",
            ),
            Statement(
                says="1 / sqrt(cos(theta_r)) draws the peak of a slice beyond the mirror direction, so that "
                "theta_r - theta_i = alpha^2 tan(theta_r)",
                where="property of the form: eq. 5a, derivative of its logarithm for small alpha",
                seen=f"at theta_i = {SLICES_DEG[-1]:g} degrees it lies {beyond_deg[0]:.2f} degrees beyond "
                f"along x and {beyond_deg[1]:.2f} along y; the condition gives {expected_deg[0]:.2f} and "
                f"{expected_deg[1]:.2f}",
                holds=bool(np.allclose(beyond_deg, expected_deg, atol=0.01)),
                threshold_from="a closed form: the derivative of eq. 5a, within 0.01 degrees",
            ),
        ],
    )


def _peak_beyond_mirror(material: Material, theta_i_deg: float) -> tuple[list[float], list[float]]:
    """Return the angles [degree] of peaks beyond the mirror direction, along x and y, and those expected."""
    viewers_deg = np.linspace(theta_i_deg - 2.0, theta_i_deg + 5.0, 7001)
    beyond, expected = [], []
    for axis, phi in PLANES:
        peak_deg = float(viewers_deg[np.argmax(slice_of(material, theta_i_deg, phi, viewers_deg))])
        beyond.append(peak_deg - theta_i_deg)
        slope2 = material.numbers[f"alpha_{axis}"] ** 2
        expected.append(float(degrees(slope2 * np.tan(radians(peak_deg)))))
    return beyond, expected


def _asymmetry(material: Material) -> float:
    """Return the largest relative change [1] of f_r when light and viewer are exchanged."""
    theta = radians(SLICES_DEG)
    theta_i, theta_r, phi_r = np.meshgrid(theta, theta, radians(np.arange(0.0, 360.0, 15.0)), indexing="ij")
    forth, back = f_r_of(material, theta_i, 0.4, theta_r, phi_r), f_r_of(material, theta_r, phi_r, theta_i, 0.4)
    return float(np.max(np.abs(forth - back) / forth))


def _crescent() -> Figure:
    """Draw Fig. 7a: the highlight of a light source alone, on a brushed sphere."""
    brass = presets()["rolled-brass"]
    round_brass = isotropic(brass)
    axis = np.linspace(-1.0, 1.0, 72)
    across, up = np.meshgrid(axis, axis[::-1])
    white = _WHITE * np.nanmax(_sphere(brass, across, up))
    panels = [
        Picture(title=title, radiance=rows(np.minimum(_sphere(form, across, up) / white, 1.0), 3))
        for title, form in (("eq. 5a", brass), ("eq. 4", round_brass))
    ]
    bend, thickness = _bend(brass)
    round_bend, round_thickness = _bend(round_brass)
    return Figure(
        key="ward-1992-fig-07",
        paper="ward1992",
        title="Fig. 7: the crescent of an anisotropic highlight",
        caption=f"{parameters_text(brass)}, on a sphere with x along its meridians; a distant light "
        f"{LIGHT_DEG:g} degrees above the equator, a distant camera {CAMERA_DEG:g} degrees, on one meridian. White "
        f"is {_WHITE:g} of the peak. The second picture is eq. 4 with alpha = sqrt(alpha_x alpha_y).",
        panels=list(panels),
        statements=[
            Statement(
                says='"Note that the crescent shape of the highlight is due to longitudinal anisotropy and not the '
                'light source"',
                where="section 5, of Fig. 7a, another object",
                seen=f"the light is a point; the ends of the highlight bend up by {100.0 * bend / thickness:.0f} % of "
                f"its thickness with eq. 5a, by {100.0 * round_bend / round_thickness:.0f} % with eq. 4",
                holds=bend > _BENT * thickness and abs(round_bend) < _BENT * round_thickness,
                threshold_from="our reading: a crescent is bent by more than a tenth of its thickness",
            )
        ],
    )


def _sphere(material: Material, across: Array, up: Array) -> Array:
    """Return the radiance over the irradiance [1/sr] at places in the image of a unit sphere; nan beside it."""
    outside = across**2 + up**2 >= 1.0
    points = points_at(np.where(outside, 0.0, across), np.where(outside, 0.0, up))
    f_r = material.spec.vectors(points.light, points.camera, **material.arguments())
    return np.where(outside, np.nan, f_r * np.maximum(points.light[..., 2], 0.0))


def _bend(material: Material) -> tuple[float, float]:
    """Return the height of the ends of the highlight above its middle, and the thickness of the middle [radius].

    At the ends the brightest point of a column of the image has half the peak.
    """
    across, up = np.linspace(-0.4, 0.4, 81), np.linspace(0.1, 0.9, 4001)
    radiance = _sphere(material, *np.meshgrid(across, up, indexing="ij"))
    ridge, brightest = up[radiance.argmax(axis=1)], radiance.max(axis=1)
    first, *_, last = np.flatnonzero(brightest > 0.5 * brightest.max())
    middle = radiance[len(across) // 2]
    bright = up[middle > 0.5 * middle.max()]
    return float(0.5 * (ridge[first] + ridge[last]) - ridge[len(across) // 2]), float(bright[-1] - bright[0])


FIGURES: dict[str, Callable[[], Figure]] = {
    "ward-1992-fig-04": _image,
    "ward-1992-fig-06": _slices,
    "ward-1992-fig-07": _crescent,
    "ward-1992-lobes": lobes,
    "ward-1992-forms": forms,
}
