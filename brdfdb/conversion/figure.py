"""The figure of a conversion: f_r of source and model in the plane of incidence, and the error of each view."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdfdb.conversion.document import Conversion
from brdfdb.errors import percent
from brdfdb.figure import Curve, Figure, Panel, curve_of
from brdfdb.geometry import radians, unit_vector
from brdfdb.lobes import around_mirror
from brdfdb.materials import Source
from brdfdb.parameters import Floats

Array = NDArray[np.float64]

LIGHTS_DEG = (15.0, 45.0, 75.0)  # theta_i of the panels
_EVERY_DEG = 1.0  # step of theta_r
_LEAST = 1e-5  # share of the largest value below which a curve has a gap


def figure_of(source: Source, conversion: Conversion) -> Figure:
    """Return the figure of a conversion: f_r of both in the plane of incidence for three lights, and l1 of views.

    Viewers run from the side of the light (negative) to that of the mirror direction. An anisotropic source has two
    such planes. Spectra are shown at their middle wavelength.
    """
    at = conversion.wavelengths_nm
    middle = None if at is None else np.array(at[len(at) // 2 :][:1])
    panels = [_of_light(source, conversion, theta_deg, middle) for theta_deg in LIGHTS_DEG]
    views = curve_of(
        "worst view at this angle", conversion.views_deg, 100.0 * np.asarray(conversion.l1_of_views), "ours"
    )
    mean = curve_of("over all pairs", [0.0, conversion.views_deg[-1]], [100.0 * conversion.l1] * 2, "truth")
    panels.append(
        Panel(
            title="light in the wrong place",
            x_label="theta_r [degree]",
            y_label="l1 [%]",
            curves=[views, mean],
        )
    )
    where = "" if middle is None else f" at {middle[0]:g} nm"
    errors = f"l1 {percent(conversion.l1)}, p99 {percent(conversion.p99)}"
    return Figure(
        key=conversion.name,
        paper=conversion.material.spec.reference,
        title=f"{conversion.source} as {conversion.model}",
        caption=f"f_r in the plane of incidence{where}. {errors}.",
        panels=list(panels),
        statements=[],
    )


def _of_light(source: Source, conversion: Conversion, theta_deg: float, middle: Array | None) -> Panel:
    """Return the panel of one light."""
    made = conversion.material
    sides = ((conversion.source, source, "truth"), (conversion.model, made, "ours"))
    planes = {"along x": 0.0, "along y": 90.0} if source.anisotropic else {"": 0.0}
    curves: list[Curve] = []
    largest = 0.0
    drawn = []
    for plane, phi_deg in planes.items():
        wi = unit_vector(radians(theta_deg), radians(phi_deg))
        theta_r_deg = _angles(source, theta_deg, middle)
        wr = unit_vector(np.abs(radians(theta_r_deg)), radians(phi_deg + np.where(theta_r_deg > 0.0, 180.0, 0.0)))
        for name, side, role in sides:
            values = side.lookup_vectors(np.broadcast_to(wi, wr.shape), wr, middle if side.spectral else None)
            values = np.asarray(values, dtype=np.float64).reshape(-1)
            largest = max(largest, float(values.max()))
            drawn.append((f"{name} {plane}".strip(), theta_r_deg, values, role))
    for label, x, values, role in drawn:
        shown = np.where(values > _LEAST * largest, values, np.nan)
        curves.append(curve_of(label, x, shown, "truth" if role == "truth" else "ours"))
    return Panel(
        title=f"theta_i = {theta_deg:g} degrees",
        x_label="theta_r [degree], mirror side positive",
        y_label="f_r [1/sr]",
        curves=curves,
        log_y=True,
    )


def _angles(source: Source, theta_deg: float, middle: Array | None) -> Floats:
    """Return angles of the viewer [degree], crowded around the mirror direction of a lobe."""
    plain = np.arange(-89.0, 89.5, _EVERY_DEG)
    if not source.has_lobe:
        return plain
    lobe = source.lobe(np.cos(radians(theta_deg)), middle if source.spectral else None)
    if lobe is None:
        return plain
    return np.union1d(plain, around_mirror(theta_deg, lobe))
